"""Sweeps: each row is equal to a single run; a file is resumed."""

import csv
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from closed_forms import slide_level, slide_level_of_45_m_dam
from damjoint.input.case_names import CASES
from damjoint.input.resolve import load, varied
from damjoint.statics import gravity
from damjoint.studies import chart, sweep
from damjoint.studies.plan import plan_of, plan_with, quantity_of
from damjoint.units import LENGTHS
from processes import without_progress
from quakes import smooth_record
from scipy import stats


def rows(path):
    with path.open() as file:
        return list(csv.DictReader(file))


@pytest.mark.heavy
@pytest.mark.usefixtures("no_pictures")
def test_rows_are_equal_to_single_runs(solve, command, tmp_path):
    words = "sweep", "c", "--vary", "mu=0.35,0.4", "--vary", "level=8,9", "--jobs", "1"
    words = *words, "--out", "sweep.csv"
    assert command(*words)[0] == 0
    table = rows(tmp_path / "sweep.csv")
    assert [(row["mu"], row["level_requested"]) for row in table] == [
        ("0.35", "8"),
        ("0.35", "9"),
        ("0.4", "8"),
        ("0.4", "9"),
    ]
    for row in table:
        levels = "3,6,8" if row["level_requested"] == "8" else "3,6,8,9"
        history = solve("c", levels, uplift="imposed", mu=float(row["mu"]))[0].history
        for name in ("level", "max_opening", "crest_ux", "N", "T", "M"):
            assert float(row[name]) == pytest.approx(history[name][-1], rel=1e-6), name


@pytest.mark.usefixtures("no_pictures")
def test_a_sweep_is_resumed(command, tmp_path):
    """Half of the rows, then all on two processes: the first rows stay unchanged."""
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


@pytest.mark.heavy
def test_an_interrupted_sweep_ends_at_once_and_keeps_its_rows(tmp_path):
    """Not after the minute that the other rows would take."""
    words = "sweep", "c", "--set", "n_joint=20", "--vary", "mu=0.3:0.7:1e-4", "--jobs", "2"
    out = tmp_path / "c_sweep.csv"
    with subprocess.Popen(
        [sys.executable, "-m", "damjoint", *words],
        cwd=tmp_path,
        start_new_session=True,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        while not out.exists() or len(out.read_text().splitlines()) < 10:
            assert process.poll() is None
            time.sleep(0.05)
        os.killpg(process.pid, signal.SIGINT)
        try:
            _, error = process.communicate(timeout=120)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            raise
    assert process.returncode == 130 and len(without_progress(error).splitlines()) == 1
    assert 9 <= len(rows(out)) < 4001


@pytest.mark.usefixtures("no_pictures")
def test_the_row_of_a_dam_that_slides_has_its_verdict(command, tmp_path):
    words = "--set", "pena_tang=0", "--set", "uplift=none", "--vary", "mu=0.25,0.3"
    command("sweep", "c", *words, "--jobs", "1", "--out", "sweep.csv")
    for row in rows(tmp_path / "sweep.csv"):
        assert row["verdict"] == "sliding" and row["statement"].startswith("sliding")
        assert float(row["level"]) == pytest.approx(
            slide_level(float(row["mu"]), 1000, False), rel=2e-3
        )


@pytest.mark.heavy
@pytest.mark.usefixtures("no_pictures")
def test_all_rows_of_close_levels_converge_and_their_openings_increase(command, tmp_path):
    """Without tensile strength the shear is lost on opening, a jump of the law."""
    words = "--set", "sigma_max=0", "--vary", "level=8:9:0.02", "--set", "n_joint=25"
    command("sweep", "a", *words, "--jobs", "1", "--out", "sweep.csv")
    openings = [
        float(row["max_opening"])
        for row in rows(tmp_path / "sweep.csv")
        if row["verdict"] == "stands"
    ]
    assert len(openings) == 51 and openings == sorted(openings)


@pytest.mark.heavy
def test_a_scheduler_with_two_workers(tmp_path, monkeypatch):
    """The rows of this process, from a dask cluster of two processes; two bundles in a task."""
    from distributed import LocalCluster  # slow to import, and each process reads all tests

    monkeypatch.setattr(sweep, "TASKS_PER_THREAD", 1)
    plan = plan_of(["mu=0.35,0.36,0.38,0.4", "level=8,9"], [], None, {})
    planned = sweep.PlannedRows(load("c"), plan)
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        address = cluster.scheduler_address
        far = sweep.sweep(planned, tmp_path / "far.csv", scheduler=address)
    near = sweep.sweep(planned, tmp_path / "near.csv", jobs=1)
    assert far[0] == near[0] == len(far[1]) == len(near[1]) == 8
    by_key = lambda name: {row["key"]: row for row in rows(tmp_path / name)}
    far, near = by_key("far.csv"), by_key("near.csv")
    assert far.keys() == near.keys()
    for key, row in near.items():
        assert {k: v for k, v in far[key].items() if k != "residual"} == {
            k: v for k, v in row.items() if k != "residual"
        }


@pytest.mark.usefixtures("no_pictures")
def test_a_varied_level_has_the_tailwater_of_the_case(command, tmp_path):
    """Constant, or rising with the reservoir: interpolated at the varied level."""
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


LEVEL = f"{slide_level_of_45_m_dam(0.6):.5g}"
#: The 45 m dam without bond at a level at which it slides for mu < 0.6; N and T do not depend on
#: the mesh, which is coarse.
SLIDES = (
    *("sweep", "dam", "--levels", LEVEL, "--tail-levels", "3", "--set", "n_joint=40"),
    *("--set", "law=bond", "--set", "sigma_max=0", "--set", "adhesion=0", "--out", "sweep.csv"),
)


@pytest.mark.heavy
def test_the_probability_of_failure_is_that_of_the_distribution(command, tmp_path, texts_drawn):
    """Of a Latin hypercube of the friction coefficient the share below 0.6, to one row."""
    sample = "--sample", "40", "mu=normal(0.68,0.06)"
    code, out, _ = command(*SLIDES, *sample)
    assert code == 0 and "Probability of failure" in out and "nan" not in out
    (share,) = rows(tmp_path / "sweep_probability.csv")
    exact = stats.norm.cdf(0.6, 0.68, 0.06)
    assert float(share["low"]) < exact < float(share["high"])
    assert abs(float(share["probability"]) - exact) <= 1 / 40
    assert (share["rows"], share["undecided"]) == ("40", "0")
    (of_mu,) = rows(tmp_path / "sweep_sensitivity.csv")
    assert of_mu["input"] == "mu" and float(of_mu["crest_ux"]) < -0.99
    for row in rows(tmp_path / "sweep.csv"):
        assert (row["failed"] == "1") == (float(row["mu"]) < 0.6)
        assert row["statement"].startswith(f"sliding: no equilibrium at level {LEVEL} m") == (
            row["failed"] == "1"
        )
    before = (tmp_path / "sweep.csv").read_text()
    again = command(*SLIDES, *sample)[1]
    assert (
        again.replace("nothing to compute, 40 rows were there already", "40 rows computed") == out
    )
    assert (tmp_path / "sweep.csv").read_text() == before
    assert (tmp_path / "sweep.png").exists()
    shown = [f"{float(share[name]):.4g}" for name in ("probability", "low", "high")]
    line = "probability of failure {} ({} to {})".format(*shown)
    assert [line in texts for texts in texts_drawn] == [True, True]


@pytest.mark.heavy
def test_rows_skipped_by_statics_fail_in_a_full_run_too(command, tmp_path):
    """The same verdicts without the shortcut of a sample."""
    assert command(*SLIDES, "--vary", "mu=0.598,0.602")[0] == 0
    assert sorted((r["mu"], r["verdict"]) for r in rows(tmp_path / "sweep.csv")) == [
        ("0.598", "sliding"),
        ("0.602", "stands"),
    ]


#: The mesh of --accuracy but for its fineness.
MESH = "mesh_pattern=free", "quadrature=full", "n_layers=1", "h_dam=-1", "h_found=-1"


@pytest.mark.heavy
@pytest.mark.usefixtures("no_pictures")
def test_ties_loading_and_accuracy(command, solve, tmp_path):
    """A row with a tied parameter and given levels equals the single run; one mesh for all rows,
    refined for the case as it is.
    """
    loading = "--levels", "6,8", "--tail-levels", "1", "--steps", "2"
    words = "--vary", "mu=0.35,0.5", "--tie", "adhesion=1e4*mu", "--jobs", "1", "--out", "s.csv"
    code, out, _ = command("sweep", "c", *loading, "--accuracy", "coarse", *words)
    assert code == 0 and out.startswith("mesh of all rows")
    n = re.search(r"n_joint = (\d+)", out)[1]
    mesh = [part for name in (f"n_joint={n}", "order=2", *MESH) for part in ("--set", name)]
    for row in rows(tmp_path / "s.csv"):
        assert float(row["adhesion"]) == pytest.approx(1e4 * float(row["mu"]))
        options = "--no-fields", "--no-picture", "--out", row["mu"]
        values = "--set", f"mu={row['mu']}", "--set", f"adhesion={row['adhesion']}"
        assert command("run", "c", *loading, *mesh, *values, *options)[0] == 0
        last = rows(tmp_path / row["mu"] / "history.csv")[-1]
        for name in ("time", "level", "tail_level", "max_opening", "crest_ux", "T"):
            assert float(row[name]) == pytest.approx(float(last[name]), rel=1e-6), name


@pytest.mark.heavy
def test_a_critical_level_is_a_column(command, tmp_path):
    """That at which the dam slides; the file is not one of a sweep without --critical."""
    words = *SLIDES, "--levels", "30", "--set", "n_joint=10", "--vary", "mu=0.6"
    assert command(*words, "--critical")[0] == 0
    (row,) = rows(tmp_path / "sweep.csv")
    assert float(row["critical_level"]) == pytest.approx(float(LEVEL), rel=1e-4)
    assert (row["level"], row["verdict"]) == ("30", "stands")
    assert (row["mode"], row["confirmed"]) == ("sliding", "1") and row["confirmed_by"]
    assert (tmp_path / "sweep.png").exists()
    assert command(*words)[0] == 2


@pytest.mark.heavy
def test_the_search_of_a_row_is_that_of_its_case():
    """The parser resolves the case of all rows once; values differ in independent parameters."""
    base = load("dam", {"law": "bond", "lift_heights": (12.0,), "adhesion": (2e5, 3e5)}, steps=3)
    plan = plan_with([("mu", [0.7, 0.9]), ("rho_dam", [2300.0])], [], None, {}, "level")
    for _, row, task in sweep.planned(base, plan):
        search = task.search()
        settings = base.source.overrides | row
        own = load("dam", settings, levels=base.levels, tail_levels=base.tail_levels)
        assert search.base == replace(varied(own, search.settings), published=False)
        assert search.case == replace(own, published=False)


def test_what_varies_may_be_of_one_joint():
    """Its axis and its unit are those of the parameter of all joints."""
    label = "lift 12 m.adhesion [kPa]"
    assert chart.axis_of("lift 12 m.adhesion", np.array([2e5])) == (label, 1e-3)
    assert quantity_of("lift 12 m.adhesion") == ("lift 12 m.adhesion", "Pa")


@pytest.mark.usefixtures("no_pictures")
def test_a_failed_row_has_its_reason_and_the_others_are_computed(command, tmp_path, monkeypatch):
    whole = sweep.stepped

    def broken(case, known, interface):
        if case["mu"] == 0.4:
            raise MemoryError("no room\nfor it")
        return whole(case, known, interface)

    monkeypatch.setattr(sweep, "stepped", broken)
    assert command("sweep", "c", "--vary", "mu=0.4,0.5", "--jobs", "1", "--out", "s.csv")[0] == 0
    bad, good = rows(tmp_path / "s.csv")
    assert (bad["failed"], bad["verdict"]) == ("1", "failed")
    assert bad["statement"] == "MemoryError: no room for it"
    assert good["level"] == "9"


OF_UPLIFT = "--vary", "uplift=none,imposed"
OF_LEVEL = "--vary", "level=8,9"
SAMPLE = "--sample", "3", "mu=uniform(0.3,0.2)"


@pytest.mark.heavy
@pytest.mark.parametrize(
    "words, drawn",
    [
        (("--vary", "mu=0.4,0.5"), True),
        (("--vary", "mu=0.4,0.5", *OF_UPLIFT), True),
        (("--vary", "mu=0.4,0.5", *OF_LEVEL), True),
        (OF_UPLIFT, True),
        (("--vary", "mu=0.4,0.5", "--critical", "level"), True),
        ((*OF_LEVEL, *SAMPLE), True),
        ((*SAMPLE, "adhesion=uniform(0,1e3)"), True),
        (("--vary", "mu=0.4", "--vary", "level=9", "--vary", "adhesion=1,2"), False),
    ],
)
def test_the_chart_of_a_sweep(command, tmp_path, words, drawn):
    common = "--set", "n_joint=10", "--jobs", "1", "--out", "s.csv"
    code, out, _ = command("sweep", "c", *words, *common)
    assert code == 0 and ("no chart" in out) != drawn
    assert (tmp_path / "s.png").exists() == drawn


def chart_panels(command, tmp_path, monkeypatch, *words):
    """The axes of a sweep's chart by the quantity on their vertical axis."""
    figures = []
    monkeypatch.setattr(chart, "write_picture", lambda figure, *_: figures.append(figure))
    assert command("sweep", *words, "--set", "n_joint=10", "--jobs", "1", "--out", "s.csv")[0] == 0
    return {axes.get_ylabel().split(" [")[0]: axes for axes in figures[0].axes}


def test_a_chart_of_texts_has_categories(command, tmp_path, monkeypatch):
    """And no scale where nothing is cracked; verdicts with the factor against sliding."""
    words = "dam", "--vary", "uplift=none,imposed", "--levels", "20", "--set", "required_SSF=3"
    panels = chart_panels(command, tmp_path, monkeypatch, *words)
    crack, factor = panels["crack"], panels["safety factor against sliding"]
    assert [text.get_text() for text in crack.get_xticklabels()] == ["none", "imposed"]
    assert crack.get_xlabel() == "uplift"
    assert [text.get_text() for text in crack.texts] == ["zero in all rows"]
    assert list(crack.get_yticks()) == [0]
    cases = [load("dam", {"uplift": n, "n_joint": 10.0}, [20]) for n in ("none", "imposed")]
    expected = [gravity.at(case, 1.0, 20).SSF for case in cases]
    (verdicts,) = (line for line in factor.get_lines() if line.get_label() == "stands")
    assert verdicts.get_ydata() == pytest.approx(expected, rel=1e-4)
    assert "required 3" in [text.get_text() for text in factor.get_legend().get_texts()]


@pytest.mark.heavy
def test_rows_that_fail_do_not_set_the_scale_of_a_chart(command, tmp_path, monkeypatch):
    """Their last state may be a metre from the others; few values are ticks and curves."""
    words = "dam", "--vary", "level=30,40,60", "--set", "dam_base=26", "--set", "law=bond"
    words += "--set", "smallest_step=0.1"
    panels = chart_panels(command, tmp_path, monkeypatch, *words)
    opening = panels["largest opening"]
    assert list(opening.get_xticks()) == [30, 40, 60]
    (row,) = (row for row in rows(tmp_path / "s.csv") if row["failed"] == "1")
    (size,) = re.findall(r"\[(.*)\]", opening.get_ylabel())
    assert float(row["max_opening"]) * dict(LENGTHS)[size] > 3 * opening.get_ylim()[1]


def test_axes_of_a_chart_suit_what_was_varied(command, tmp_path, monkeypatch):
    """More than a decade is logarithmic, in the unit that suits the values; a change in the last
    digits is none, and a joint that stays closed has no negative opening.
    """
    words = "dam", "--vary", "K_N=3e10,1e11,1e12", "--levels", "20"
    panels = chart_panels(command, tmp_path, monkeypatch, *words)
    factor, opening = panels["safety factor against sliding"], panels["largest opening"]
    assert factor.get_xscale() == "log" and factor.get_xlabel() == "K_N [GPa/m]"
    assert [text.get_text() for text in factor.get_xticklabels()] == ["30", "100", "1000"]
    low, high = factor.get_ylim()
    assert high - low > 0.04 * high
    assert all(float(row["max_opening"]) < 0 for row in rows(tmp_path / "s.csv"))
    assert [text.get_text() for text in opening.texts] == ["zero in all rows"]
    title = factor.figure.get_suptitle()
    assert title == "own dam: 3 rows, law bond, uplift imposed, level 20 m"


@pytest.mark.heavy
def test_a_chart_says_that_the_slip_is_not_known(command, tmp_path, monkeypatch):
    """Of a dam that is not at rest in the end; it is not zero, and the dam does not fail."""
    smooth_record(tmp_path / "record.csv", 0.1, duration=0.05)
    (tmp_path / "own.case").write_text(
        'record = "record.csv"; default_record_unit = "m/s2"; default_record_rest = 0;'
        "default_order = 1; levels() = {9};"
    )
    words = "own.case", "--quake", "0.01", "--vary", "mu=0.5,0.6"
    panels = chart_panels(command, tmp_path, monkeypatch, *words)
    slip, block = panels["residual slip"], panels["slip of a rigid block"]
    assert [text.get_text() for text in slip.texts] == ["no row has a value"]
    assert [text.get_text() for text in block.texts] == ["zero in all rows"]
    (legend,) = slip.figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["fails or undecided"]


def test_rows_are_printed_in_a_table_that_fits_the_terminal():
    """Numbers with four digits, forces in MN/m, no negative opening; the first twenty rows."""
    plan = plan_of(["mu=0.5,0.7"], [], None, {}, "")
    row = {"mu": "0.5", "verdict": "stands", "level": "45", "crack_length": "0", "N": "2.06612e7"}
    row |= {"slip_length": "0", "max_opening": "-1e-6", "crest_ux": "0.0043", "T": "-1234567"}
    table = sweep.rows_table(plan, [row] * 23)
    lines = table.splitlines()
    assert lines[0].split() == [*list(row)[:4], "slip_length", "max_opening", "crest_ux", "N", "T"]
    assert lines[1].split() == ["[m]", "[m]", "[m]", "[mm]", "[mm]", "[MN/m]", "[MN/m]"]
    modulus = sweep.rows_table(plan_of(["E=2e10,3e10"], [], None, {}, ""), [{"E": "2e10"}])
    assert modulus.split()[:2] == ["E", "[Pa]"]
    assert lines[3].split() == ["0.5", "stands", "45", "0", "0", "0", "4.3", "20.66", "-1.235"]
    assert len(lines) == 3 + 20 + 1 and lines[-1] == "... and 3 rows more"
    assert max(map(len, sweep.rows_table(plan, [row] * 2, 60).splitlines()[:-1])) <= 60
    last, hint = sweep.rows_table(plan, [row] * 23, 60).splitlines()[-2:]
    assert last == "... and 3 rows more" and hint.startswith("(--wide shows also: ")
    assert sweep.rows_table(plan, []) == ""
