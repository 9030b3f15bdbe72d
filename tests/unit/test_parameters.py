"""Parameters, case files, levels."""

from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from damjoint import InputError
from damjoint.input import parameters
from damjoint.input.parameters import independent
from damjoint.input.resolve import as_published, load
from damjoint.input.values import TextName
from numpy.testing import assert_allclose

# Values of each modeling in the verification document and the published test files.
PUBLISHED = {
    "a": {
        "dim": 2,
        "order": 1,
        "law": "rupture",
        "uplift": "imposed",
        "nu": 0,
        "sigma_max": 100,
        "alpha": 1,
        "pena_rupture": 0.2,
    },
    "b": {
        "dim": 3,
        "order": 1,
        "law": "rupture",
        "uplift": "imposed",
        "nu": 0,
        "sigma_max": 0,
        "thickness": 1,
    },
    "c": {
        "dim": 2,
        "order": 1,
        "law": "friction",
        "uplift": "imposed",
        "nu": 0.25,
        "mu": 0.35,
        "mesh_pattern": "regular",
    },
    "d": {
        "dim": 3,
        "order": 1,
        "law": "friction",
        "uplift": "none",
        "nu": 0,
        "mu": 0.35,
        "thickness": 1,
    },
    "e": {
        "dim": 2,
        "order": 2,
        "law": "rupture",
        "uplift": "flow",
        "nu": 0.25,
        "sigma_max": 100,
        "aperture_min": 1e-8,
    },
    "f": {
        "dim": 3,
        "order": 2,
        "law": "rupture",
        "uplift": "flow",
        "nu": 0.25,
        "aperture_min": 1e-8,
        "thickness": 0.1,
        "hold_z": 1,
    },
    "g": {
        "dim": 2,
        "order": 2,
        "law": "friction",
        "uplift": "flow",
        "nu": 0.25,
        "mu": 0.4,
        "aperture_min": 5e-8,
    },
    "h": {
        "dim": 3,
        "order": 2,
        "law": "friction",
        "uplift": "flow",
        "mu": 0.35,
        "aperture_min": 1e-7,
        "thickness": 0.1,
        "hold_z": 1,
    },
    "i": {"dim": 2, "order": 2, "law": "rupture", "uplift": "imposed", "nu": 0, "sigma_max": 0},
    "j": {
        "dim": 2,
        "order": 2,
        "law": "friction",
        "uplift": "imposed",
        "nu": 0.25,
        "mesh_pattern": "regular",
    },
    "k": {
        "dim": 2,
        "order": 1,
        "law": "rupture",
        "uplift": "none",
        "sigma_max": 1.5e5,
        "face_load": "uniform",
    },
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_published_cases(name):
    case = load(name)
    common = {
        "E": 3e12,
        "K_N": 1e12,
        "rho_dam": 2400,
        "rho_water": 1000,
        "g": 9.81,
        "dam_base": 5,
        "dam_crest": 1.5,
        "dam_height": 10,
    }
    joint = (
        {"K_T": 2e12, "adhesion": 1000, "pena_tang": 2e11}
        if case["law"] == "friction"
        else {"K_T": 1e12}
    )
    expected = {**common, **joint, **PUBLISHED[name]}
    assert {key: case[key] for key in expected} == expected
    if name != "k":
        assert case.levels == (3, 6, 8, 9) and case.times[-1] == 4
    assert [scene["uplift"] for scene in case.scenes()] == [
        case["uplift"],
        *(["none"] if name in "abi" else []),
    ]


def test_dependent_defaults():
    """E and nu set dam and foundation, E_dam one of them; pena_tang is (K_N + K_T) 1e-6."""
    plain, changed = (
        load("ssnp142"),
        load("ssnp142", {"E": 2e10, "E_dam": 3e10, "nu_found": 0.3, "K_T": 4e12}),
    )
    assert plain["pena_tang"] == pytest.approx(2e6)
    assert changed["pena_tang"] == pytest.approx(5e6)
    assert [changed[n] for n in ("E_dam", "E_found", "nu_dam", "nu_found")] == [3e10, 2e10, 0, 0.3]


def test_settings_become_checked_numbers_and_choices():
    found = parameters.settings(["E=3e9", " K_N = 1e11 ", "law=friction"])
    assert found == {"E": 3e9, "K_N": 1e11, "law": "friction"}


def test_levels_as_numbers_and_as_text():
    text = load("a", {"mu": 0.5}, "6,9", "1,2")
    numbers = load("a", {"mu": 0.5}, [6, 9.0], (1, 2))
    assert text == numbers and numbers.levels == (6, 9)
    with pytest.raises(InputError, match="levels = 3,nan: must be"):
        load("a", levels=[3, float("nan")])


def test_levels_and_steps():
    case = load("a", levels="6,9,2,8", steps=4)
    assert case.levels == (6, 9, 2, 8)
    assert case.tail_levels == (0, 0, 0, 0)
    assert_allclose(case.times, np.arange(1, 17) / 4)
    assert_allclose(case.requested, [1, 2, 3, 4])
    assert_allclose([case.level_at(t) for t in (0, 0.5, 1, 1.5, 2.25, 4)], [0, 3, 6, 7.5, 7.25, 8])


def test_one_tail_level_is_used_for_all_levels():
    assert load("a", levels="6,9", tail_levels="2").tail_levels == (2, 2)
    assert load("a", levels="6,9", tail_levels="1,2").tail_levels == (1, 2)


def test_steps_without_levels_use_the_levels_of_the_case():
    case = load("a", steps=2)
    assert case.levels == (3, 6, 8, 9)
    assert_allclose(case.times, np.arange(1, 9) / 2)


def test_a_case_file_of_the_user(tmp_path):
    """The name is that of the file; comments and arithmetic as in Gmsh; overrides win."""
    path = tmp_path / "mine.case"
    path.write_text(
        '// mine\ntitle = "mine";\ndefault_K_N = 2 * 1e11; default_dam_height = 12;\n'
        "levels() = {5, 11};\ntimes() = {1, 2};\n"
    )
    case = load(str(path), {"K_T": 3e11})
    assert (case.name, case.title, case.levels) == ("mine", "mine", (5, 11))
    assert (case["K_N"], case["K_T"], case["dam_height"]) == (2e11, 3e11, 12)


@pytest.mark.parametrize(
    "text, message",
    [
        ("default_KN = 1e12;", "KN"),
        ("default_nu = 0.5;", "nu = 0.5"),
        ("default_dam_height = 10;\nlevels() = {3, 21};", "21"),
        ('default_law = "glue";', "glue"),
        ("default_nu = ;", "must be a number"),
    ],
)
def test_a_bad_case_file_is_refused(tmp_path, text, message):
    path = tmp_path / "bad.case"
    path.write_text(text + "\n")
    with pytest.raises(InputError, match=message) as caught:
        load(str(path))
    assert "\n" not in str(caught.value)


def test_every_parameter_has_a_label_with_its_unit():
    numbers = [parameter for parameter in parameters.declared().values() if not parameter.text]
    for parameter in numbers:
        assert parameter.label.endswith("]"), parameter.name
    names = """dim order mesh_pattern n_joint h_dam h_found dam_base dam_crest dam_height found_side
    found_depth thickness
        E nu rho_dam rho_found rho_water g law K_N K_T sigma_max alpha pena_rupture pena_contact mu
        adhesion pena_tang uplift visc aperture_min face_load E_dam E_found nu_dam nu_found
        """
    assert set(names.split()) <= set(parameters.declared())


@pytest.mark.heavy
def test_an_independent_parameter_changes_nothing_else():
    """For each of them, a changed case equals a case loaded with the change."""
    common = {"law": "bond", "uplift": "drained"}
    base = load("dam", common)
    for name in independent():
        known, own = parameters.parameter(name), base[name]
        other = 1.0 if own == parameters.AUTOMATIC else own
        near = [own + 1] if known.integer else [other / 2, (other + 1) / 2, other - 1]
        values = known.choices or near
        value = next(v for v in values if v != own and known.allows(v))
        # not with law = bond, not on a section: refused in both ways
        if name in ("grout_pressure", "saw_thickness", "traction_x", "traction_y"):
            for way in (lambda v: load("dam", common | v), base.changed):
                with pytest.raises(InputError, match=name):
                    way({name: value})
            continue
        loaded, changed = load("dam", common | {name: value}), base.changed({name: value})
        assert (changed, changed.section) == (loaded, loaded.section), name
    assert {"mu", "adhesion", "G_t", "drain_effectiveness", "k_h"} <= independent()
    assert not {"K_N", "sigma_max", "E", "dam_height", "law"} & independent()


def test_a_changed_case_is_checked():
    base = load("dam", {"law": "bond"})
    for name, value in (("adhesion", 1e9), ("mu", -1)):
        with pytest.raises(InputError, match="must be"):
            base.changed({name: value})
    with pytest.raises(KeyError):
        base.changed({"K_N": 1e12})


def test_a_case_counts_as_published_with_another_mesh_only():
    """Or solver or uplift; any other parameter makes it a case of the user."""
    groups = {name: known.group for name, known in parameters.declared().items()}
    source = load("a").source
    published = {n for n in groups if as_published(source, {n: 0})}
    assert published == {n for n in groups if groups[n] in ("Mesh", "Solver")} | {"order", "uplift"}
    assert {"n_joint", "tolerance"} <= published
    assert not {"mu", "sigma_max", "K_N", "law"} & published
    assert load("a", {"n_joint": 10}).published and not load("a", {"sigma_max": 2e4}).published
    assert not load("a", levels="3").published


def test_a_case_has_the_values_of_all_parameters():
    """As items and as attributes that can not be set; type checkers know which are texts."""
    case, known = load("dam"), parameters.declared()
    assert sorted(case) == sorted(known)
    assert all(getattr(case, name) == case[name] for name in known if name != "law")
    names = {name for part in get_args(TextName) for name in get_args(part)}
    assert names == {n for n, parameter in known.items() if parameter.text}
    with pytest.raises(AttributeError):
        case.mu = 1.0


def test_reading_cases_leaves_no_files_open():
    """A sweep over sizes of the dam reads hundreds of cases."""
    opened = lambda: len(list(Path("/proc/self/fd").iterdir()))
    parameters.parse_by_gmsh(parameters.INCLUDE)
    before = opened()
    for base in (30, 31, 32):
        parameters.parse_by_gmsh(f"default_dam_base = {base};\n{parameters.INCLUDE}")
    assert opened() == before
