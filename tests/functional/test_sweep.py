"""Sweeps: each row is the run of its own; a file is resumed."""

import csv

import pytest
from closed_forms import slide_level
from damjoint.scene.case import CASES
from damjoint.studies import sweep
from distributed import LocalCluster


def rows(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def test_rows_are_the_runs(solve, command, tmp_path):
    words = (
        "sweep",
        "c",
        "--vary",
        "mu=0.35,0.4",
        "--vary",
        "level=8,9",
        "--jobs",
        "1",
        "--out",
        "sweep.csv",
    )
    assert command(*words)[0] == 0
    table = rows(tmp_path / "sweep.csv")
    assert [(row["mu"], row["level_asked"]) for row in table] == [
        ("0.35", "8"),
        ("0.35", "9"),
        ("0.4", "8"),
        ("0.4", "9"),
    ]
    for row in table:
        levels = "3,6,8" if row["level_asked"] == "8" else "3,6,8,9"
        history = solve("c", levels, uplift="imposed", mu=float(row["mu"]))[0].history
        for name in ("level", "max_opening", "crest_ux", "N", "T", "M"):
            assert float(row[name]) == pytest.approx(history[name][-1], rel=1e-6), name


def test_a_sweep_is_resumed(command, tmp_path):
    """Half of it, then all of it on two processes: the rows already there stay as they are."""
    sweep = lambda mu: command(
        "sweep", "c", "--vary", f"mu={mu}", "--jobs", "2", "--out", "sweep.csv"
    )
    assert sweep("0.3:0.4:0.1")[0] == 0
    before = (tmp_path / "sweep.csv").read_text()
    assert sweep("0.3:0.5:0.1")[0] == 0
    after = (tmp_path / "sweep.csv").read_text()
    assert after.startswith(before) and sorted(
        row["mu"] for row in rows(tmp_path / "sweep.csv")
    ) == ["0.3", "0.4", "0.5"]
    assert sweep("0.3:0.5:0.1")[0] == 0
    assert (tmp_path / "sweep.csv").read_text() == after


def test_a_dam_that_slides_is_a_row_that_says_so(command, tmp_path):
    command(
        "sweep",
        "c",
        "--set",
        "pena_tang=0",
        "--set",
        "uplift=none",
        "--vary",
        "mu=0.25,0.3",
        "--jobs",
        "1",
        "--out",
        "sweep.csv",
    )
    for row in rows(tmp_path / "sweep.csv"):
        assert row["verdict"] == "sliding" and row["statement"].startswith("sliding")
        assert float(row["level"]) == pytest.approx(
            slide_level(float(row["mu"]), 1000, False), rel=2e-3
        )


def test_no_level_without_equilibrium(command, tmp_path):
    """Without tensile strength the shear goes as soon as a point opens: a jump of the law that no
    level may fall into."""
    command(
        "sweep",
        "a",
        "--set",
        "sigma_max=0",
        "--vary",
        "level=8:9:0.02",
        "--jobs",
        "1",
        "--out",
        "sweep.csv",
    )
    openings = [
        float(row["max_opening"])
        for row in rows(tmp_path / "sweep.csv")
        if row["verdict"] == "stands"
    ]
    assert len(openings) == 51 and openings == sorted(openings)


def test_a_scheduler_with_two_workers(tmp_path):
    """The same rows as in this process, from a dask cluster of two processes."""
    vary = ["mu=0.35,0.4", "level=8,9"]
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        assert (
            sweep.sweep("c", vary, {}, tmp_path / "far.csv", scheduler=cluster.scheduler_address)
            == 4
        )
    assert sweep.sweep("c", vary, {}, tmp_path / "near.csv", jobs=1) == 4
    by_key = lambda name: {row["key"]: row for row in rows(tmp_path / name)}
    far, near = by_key("far.csv"), by_key("near.csv")
    assert far.keys() == near.keys()
    for key, row in near.items():
        assert {k: v for k, v in far[key].items() if k != "residual"} == {
            k: v for k, v in row.items() if k != "residual"
        }


def test_a_varied_level_keeps_the_tailwater(command, tmp_path):
    """A constant one, and one that rises with the reservoir: interpolated at the level asked."""
    common = "default_n_joint = 10; default_h_dam = 3; levels() = {3, 6, 9}; times() = {3};"
    for name, tails, expected in (("same", "1", 1.0), ("rises", "0, 1, 2", 1.5)):
        text = f'Include "ssnp142.case"; {common} tail_levels() = {{{tails}}};'
        (tmp_path / "ssnp142.case").write_text((CASES / "ssnp142.case").read_text())
        (tmp_path / f"{name}.case").write_text(text)
        out = f"{name}.csv"
        words = "sweep", f"{name}.case", "--vary", "level=7.5", "--jobs", "1", "--out", out
        assert command(*words)[0] == 0
        (row,) = rows(tmp_path / out)
        assert float(row["tail_level"]) == pytest.approx(expected)
        assert float(row["level"]) == 7.5
