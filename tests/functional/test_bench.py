"""The short form of the benchmark: its files and the consistency of its figures; no speed is
asserted.
"""

import csv
import json
import shutil

import numpy as np
import pytest
from damjoint.input.resolve import load
from damjoint.studies.critical import Search
from damjoint_tools import bench_commands, bench_cost, bench_hard, bench_page
from damjoint_tools.bench_table import Measurements

#: Modelings whose times are measured, one of them in 3D.
MODELINGS = "aceh"
#: Part of an earthquake, on a coarse mesh.
QUAKES = {"2D, order 1, 0.5 s": ({"order": 1.0, "n_joint": 20.0}, 0.5)}


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """The log of the short benchmark, with less hard scenes, modelings and a coarser earthquake:
    its parts are measured once.
    """
    published = {name: bench_cost.PUBLISHED[name] for name in MODELINGS}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bench_hard, "NAMED", {"e": ("e", {"E_dam": 60e9})})
        patch.setattr(bench_hard, "FEW", 2)
        patch.setattr(bench_cost, "PUBLISHED", published)
        patch.setattr(bench_commands, "QUAKES", QUAKES)
        yield tmp_path_factory.mktemp("bench") / "measured.jsonl"


@pytest.fixture
def measurements(log):
    """Those of the log."""
    return Measurements(log, short=True)


@pytest.mark.heavy
def test_seconds_of_several_joints(measurements):
    measured = bench_cost.joints(measurements)
    assert measured["joints"] == [1, 2] and measured["ratio"][0] == 1
    one, two = measured["unknowns"]
    assert two > one and min(measured["iterations"]) >= 3
    parts = zip(*(measured[n] for n in ("condensation", "newton", "seconds")), strict=True)
    assert all(a > 0 and b > 0 and a + b < total for a, b, total in parts)
    assert measured["ratio"][1] == measured["seconds"][1] / measured["seconds"][0]
    title, text, rows = bench_page.of_joints(measured)
    assert title == "## Several joints" and "up to 2 joints" in text and rows.count("\n") == 3


@pytest.mark.heavy
def test_milliseconds_of_time_steps(measurements):
    measured = bench_commands.quakes(measurements)
    (scene,), (steps,) = measured["scene"], measured["steps"]
    assert (scene, steps) == ("2D, order 1, 0.5 s", 200)
    assert measured["seconds"][0] == pytest.approx(steps * measured["ms a step"][0] / 1e3)
    expected = measured["GetDP: ms a step"][0] / measured["ms a step"][0]
    assert measured["ratio"][0] == pytest.approx(expected)
    assert 0 < measured["difference"][0] < 1e-5
    title, text, rows = bench_page.of_quakes(measured)
    assert title == "## Earthquake" and "ms a step" in text and rows.count("\n") == 2


@pytest.mark.heavy
def test_what_hard_scenes_wait_for(measurements):
    """The parts of the time are of its whole; afterwards nothing is measured any more."""
    solve = bench_hard.step.solve_from
    table = bench_hard.hard(measurements)
    assert bench_hard.step.solve_from is solve
    assert table["scene"] == ["e", "random 1-0", "random 1-1"]
    for solutions, given_up, iterations in zip(
        table["solutions"], table["given up"], table["iterations"], strict=True
    ):
        assert 0 <= given_up <= solutions <= iterations
    assert table["given up"][0] < table["solutions"][0]
    for part in ("given up [%]", "linear systems [%]", "water [%]"):
        assert all(0 <= share <= 100 for share in table[part])
    assert table["water [%]"][0] > 0
    seconds = table["seconds"]
    chosen = bench_hard.slowest(table)["seconds"]
    assert chosen == [seconds[0], *sorted(seconds[1:], reverse=True)]
    title, text, rows = bench_page.of_hard(table)
    assert title == "## Hard scenes in 2D" and "of 2 random dams" in text and rows.count("\n") == 4


@pytest.mark.heavy
def test_a_row_of_critical_levels(measurements):
    """Its level is that of the search alone; nothing is searched in its time but it."""
    table = bench_hard.rows(measurements)
    (settings, varied, (_, value)), (row,) = bench_hard.ROWS["friction"], table["row"]
    search = Search(load("dam", settings | {varied: value}), "level")
    with bench_hard.clock() as measured:
        answer = search.find()
    assert (row, table["confirmed"]) == ("friction", ["yes"])
    assert table["level [m]"] == [answer.value]
    for name in ("solutions", "given up", "iterations"):
        assert table[name] == [getattr(measured, name.replace(" ", "_"))]
    assert 0 < table["LAPACK alone"][0] < np.inf
    _, text, rows = bench_page.of_rows(table)
    assert "A row takes" in text and rows.count("\n") == 2


@pytest.mark.heavy
def test_the_short_benchmark_writes_consistent_files(command, tmp_path, log):
    """Also if it is resumed: from what the tests before have measured, where they ran."""
    (tmp_path / "bench").mkdir()
    if log.exists():
        shutil.copy(log, tmp_path / "bench")
    assert command("bench", "--short", "--out", "bench")[0] == 0
    text = (tmp_path / "bench" / "benchmarks.md").read_text()
    assert text.startswith("# Benchmarks\n") and text.count("\n## ") == 17
    assert (tmp_path / "bench" / "accuracy.png").read_bytes()[:4] == b"\x89PNG"
    *lines, blank, source = (tmp_path / "bench" / "modelings.md").read_text().splitlines()
    assert len(lines) == 2 + len(MODELINGS) and not blank and source in text
    origin = json.loads((tmp_path / "bench" / "provenance.json").read_text())
    assert source.startswith(f"Measured with damjoint {origin['version']} (")
    assert origin["date"] in source and origin["machine"] in source and origin["commit"] in source

    def table(name):
        with (tmp_path / "bench" / f"{name}.csv").open() as file:
            return list(csv.DictReader(file))

    assert [row["case"] for row in table("cases")] == [*MODELINGS, "sum"]
    for row in table("recommended"):
        assert float(row["coarse: error [%]"]) < 3, row
    errors = {
        (row["scene"], row["dim"], row["pattern"], row["order"], row["n_joint"], row["steps"]): row
        for row in table("accuracy")
    }
    for scene in ("rupture", "friction", "flow"):
        steps = [
            float(errors[scene, "2", "free", "2", "10", s]["error_heel_opening"])
            for s in ("1", "2", "4")
        ]
        # monotone filling: one step is enough
        assert max(steps) == pytest.approx(min(steps), rel=1e-3)
        plane, split, coarser = (
            float(errors[scene, dim, pattern, order, "20", "published"]["error_toe_stress"])
            for dim, pattern, order in (("2", "free", "2"), ("3", "split", "2"), ("2", "free", "1"))
        )
        assert split < 1.2 * plane and plane < coarser
    assert {row["end"] for row in table("stress")} <= {"sliding", "overturning"}
    assert all(float(row["ratio"]) > 0 for row in table("switches"))
    first, *others = table("start")
    for row in others:
        ratio = float(row["seconds"]) / float(first["seconds"])
        assert float(row["times interpreter and numpy"]) == pytest.approx(ratio)
    (files,) = table("pictures")
    assert files["case"] == "c" and float(files["both over tables"]) > 1
    assert all(row["confirmed"] == "yes" for row in table("critical"))
    assert all(float(row["difference"]) < 1e-9 for row in table("orders"))
    assert [row["engine"] for row in table("engines")] == ["condensed", "iterative"]
