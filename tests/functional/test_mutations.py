"""Errors in a copy of the package, which the verification of random dams has to notice."""

import csv
from dataclasses import replace
from functools import cache
from pathlib import Path

import damjoint
import pytest
from damjoint_tools import mutations, trust
from damjoint_tools.mutations import MUTATIONS, look_for, scenes_of

BY_NAME = {mutation.name: mutation for mutation in MUTATIONS}


def test_there_are_47_mutations_each_of_one_place(tmp_path):
    assert len(BY_NAME) == 47
    for mutation in MUTATIONS:
        package = Path(damjoint.__file__).parent
        root = package.parents[1] if mutation.file.startswith("pro/") else package
        source = (root / mutation.file).read_text()
        assert source.count(mutation.text) == 1, mutation.name
        assert mutation.instead != mutation.text
    unknown = replace(MUTATIONS[0], text="no such line")
    with pytest.raises(ValueError, match=r"joint/water\.py has 0 times: no such line"):
        unknown.make(tmp_path)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """Scenes that are drawn once for all mutations, and the folder of their records."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("random_scene", "random_quake"):
            patch.setattr(mutations, name, cache(getattr(mutations, name)))
        yield tmp_path_factory.mktemp("records")


@pytest.mark.parametrize("name", BY_NAME)
def test_there_are_scenes_in_which_a_mutation_matters(name, drawn):
    assert next(scenes_of(BY_NAME[name], 31, drawn))


@pytest.mark.parametrize(
    "name, finding",
    [
        ("silt x 1.02", "by hand"),
        *(
            pytest.param(name, finding, marks=pytest.mark.heavy)
            for name, finding in (
                ("G_t x 1.1", "from the law"),
                ("mu of the first joint in all laws", "from the law"),
                ("order of the levels", "level is off"),
                ("damping by the mass x 1.1", "momentum"),
                ("no water in a crack that has closed", "of the earthquake"),
            )
        ),
    ],
)
def test_a_mutation_is_noticed(name, finding, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", "")  # is changed
    row = look_for(BY_NAME[name], 31)
    assert row["scene"] and finding in row["finding"], row


@pytest.mark.heavy
def test_what_changes_nothing_is_not_noticed(monkeypatch, tmp_path):
    """The same text, in one scene."""
    monkeypatch.setenv("PYTHONPATH", "")
    monkeypatch.setattr(mutations, "MOST_SCENES", 1)
    same = BY_NAME["silt x 1.02"]
    row = look_for(replace(same, instead=same.text), 31)
    assert row == {"mutation": same.name, "place": same.file, "relevant": 1}


def test_the_table_of_the_mutations_is_a_section_of_the_page(tmp_path):
    rows = [
        dict(zip(mutations.COLUMNS, (*cells, "1", "", "c", "m", "d"), strict=True))
        for cells in (("silt", "a.py", "3", "1-2", "T = 1"), ("ice", "b.py", "60", "", ""))
    ]
    with (tmp_path / "m.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, mutations.COLUMNS)
        table.writeheader()
        table.writerows(rows)
    mark, page = trust.trust_section(tmp_path / "m.csv")
    assert mark == "mutations" and "1 of 2 mutations" in page
    assert "| silt" in page and "T = 1" in page and "not noticed" in page
