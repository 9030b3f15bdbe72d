"""The interface for Python: import damjoint as dj."""

import re
import subprocess
import sys
from pathlib import Path

import damjoint as dj
import numpy as np
import pytest

PAGE = Path(__file__).parents[2] / "reference" / "python.md"
CASE = {"levels": [30, 40], "n_joint": 20}


@pytest.fixture(scope="module")
def run():
    return dj.run(dj.case("dam", **CASE))


def test_the_code_of_the_page_runs(tmp_path, monkeypatch):
    """One block after the other, with nothing left on disk."""
    monkeypatch.chdir(tmp_path)
    names = {}
    try:
        for block in re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(), re.S | re.M):
            exec(block, names)
    finally:
        dj.LAWS.pop("contact", None)
    assert names["limit"].mode == "sliding" and names["limit"].confirmed
    assert names["pushed"].loading.level > 40 and names["run"].verdict == "stands"
    assert not list(tmp_path.iterdir())


def test_an_import_loads_nothing_else():
    """Not even numpy: a script that only imports it starts at once."""
    code = "import sys, damjoint; print(any(n in sys.modules for n in ('numpy', 'gmsh', 'scipy')))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
    assert {"case", "run", "fill", "check", "critical", "Law", "LAWS"} <= set(dir(dj))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = dj.nothing


def test_tables_are_those_of_the_command(run, tmp_path):
    """Record arrays with the columns and values of the files that `save` writes."""
    run.save(tmp_path / "out")
    for name, table in (("joint", run.joint), ("history", run.history)):
        path = tmp_path / "out" / f"{name}.csv"
        assert path.read_text().splitlines()[0].split(",") == list(table.dtype.names)
        written = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
        columns = np.column_stack([table[n] for n in table.dtype.names])
        np.testing.assert_allclose(written, columns, rtol=1e-11, atol=1e-9)
    assert (tmp_path / "out" / "dam.png").is_file() and (tmp_path / "out" / "fields").is_dir()


def test_rows_of_a_level_or_a_time(run):
    rows = run.joint.at(level=30)
    assert set(rows.level) == {30} and set(rows.time) == {1} and np.all(np.diff(rows.s) >= 0)
    np.testing.assert_array_equal(run.joint.at(time=2).delta_n, run.joint.at(level=40).delta_n)
    with pytest.raises(dj.InputError, match="level = 35: must be one of 30, 40"):
        run.joint.at(level=35)
    with pytest.raises(dj.InputError, match="must have a level or a time"):
        run.joint.at()


def test_bad_input_is_one_line():
    for words, message in (
        ({"mu": -1}, "mu = -1: must be"),
        ({"law": "glue"}, "law = glue: must be one of rupture, friction, bond, endo"),
        ({"levels": [-3]}, "levels = -3: must be"),
        ({"colour": 3}, "colour: unknown parameter"),
    ):
        with pytest.raises(dj.InputError, match=message):
            dj.case("dam", **words)


def test_steps_are_the_rows_of_the_history(run):
    steps = list(dj.fill(dj.case("dam", **CASE)))
    assert [step.level for step in steps] == list(run.history.level)
    for name in ("N", "T", "M", "crack_length", "crest_ux"):
        rows = [step.row[name] for step in steps]
        assert rows == pytest.approx(list(run.history[name]), rel=1e-12)  # other threads


def test_a_run_that_stops_is_a_result():
    """Levels beyond what the dam holds: the verdict says so, the steps up to there are rows."""
    stopped = dj.run(dj.case("dam", levels=[40, 60], n_joint=20, law="friction", pena_tang=0))
    assert stopped.verdict in ("sliding", "overturning") and stopped.statement
    assert stopped.history.level[0] == 40 and stopped.history.level[-1] < 60


def test_a_law_of_ones_own_needs_its_file_in_getdp(monkeypatch):
    class Springs(dj.Law):
        pass

    monkeypatch.setitem(dj.LAWS, "springs", Springs)
    with pytest.raises(dj.InputError, match=r"law = springs: must have a file pro/law_springs.pro"):
        dj.run(dj.case("dam", **CASE, law="springs"), engine="getdp")


def test_check_and_critical_are_those_of_the_commands(command, tmp_path):
    """The same numbers as check.csv and the same lines as damjoint critical."""
    (found,) = dj.check([dj.case("dam", levels=40, n_joint=20, required_SSF=2)])
    words = "check", "dam", "--levels", "40", "--set", "n_joint=20", "--set", "required_SSF=2"
    command(*words, "--out", "checked")
    lines = (tmp_path / "checked" / "check.csv").read_text().splitlines()
    assert len(lines) == 1 + len(found.rows) and f"{found.rows[0]['SSF']:.9g}" in lines[1]

    words = "critical", "dam", "--levels", "40", "--set", "n_joint=20", "--set", "law=friction"
    _, out, _ = command(*words, "--out", "limit")
    limit = dj.critical("dam", levels=40, n_joint=20, law="friction")
    assert all(line in out for line in limit.statement)
    assert limit.equilibria.level.max() == pytest.approx(limit.value)
    with pytest.raises(dj.InputError, match="needs drains"):
        dj.critical("dam", of="uplift", levels=40, n_joint=20)
