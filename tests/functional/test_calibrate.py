"""`damjoint calibrate`: closed forms, coverage of its intervals, wrong models, bad input."""

import csv
import json
from dataclasses import replace

import damjoint as dj
import numpy as np
import pytest
from damjoint.studies.calibrate import CONFIDENCE, Fit, free_of, inverse
from damjoint.studies.measurements import Measurements, Series, read
from numpy.testing import assert_allclose

COARSE = {"n_joint": 8, "order": 1, "found_side": 45.0, "found_depth": 45.0}
DRAINED = {**COARSE, "uplift": "drained", "drain_x": 10.0, "drain_effectiveness": 0.5}
#: Season of 12 readings; the temperature has its full amplitude at the first one.
SEASON = {"temperature_dam": 4.0, "temperature_t": 1.0, "temperature_period": 12.0}


def levels_of(number):
    """A reservoir that goes up and down once in 12 readings, three of them after the season."""
    return 30 + 8 * np.sin(2 * np.pi * (np.arange(number) - 3) / 12)


def instruments(number, **deviations):
    """Series without values."""
    return Measurements(
        tuple(levels_of(number)),
        None,
        ("",) * number,
        tuple(
            Series(name, "m", np.zeros(number), np.full(number, sd), *at(name))
            for name, sd in deviations.items()
        ),
    )


def at(name):
    """Joint and position of a piezometer."""
    return (0, float(name.removeprefix("head_"))) if name.startswith("head_") else ()


def measured(case, empty, generator=None):
    """The measurements that a case gives, with errors if there is a generator."""
    exact = empty.computed(empty.loaded(case))
    errors = generator.normal(size=exact.shape) if generator else np.zeros(exact.shape)
    series = [
        replace(one, measured=values + error * one.deviation)
        for one, values, error in zip(empty.series, exact, errors, strict=True)
    ]
    return replace(empty, series=tuple(series))


def write(measurements, path):
    """Write measurements as a CSV file."""
    series = measurements.series
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["date", "level", *(n for s in series for n in (s.name, f"{s.name}_sd"))])
        for k, level in enumerate(measurements.levels):
            cells = (repr(float(v[k])) for s in series for v in (s.measured, s.deviation))
            rows.writerow([f"day {k}", repr(float(level)), *cells])
    return path


@pytest.mark.heavy
def test_a_linear_parameter_has_the_estimate_of_linear_regression(tmp_path):
    """The head at the drains is u - e (u - o), u that without drains and o their outlet: e is the
    weighted mean of regression, and its interval that of the normal distribution.
    """
    dam = dj.case("dam", **DRAINED)
    empty = instruments(24, head_10=0.4)
    readings = measured(dam, empty, np.random.default_rng(3))
    file = write(readings, tmp_path / "m.csv")
    answer = dj.calibrate(dj.case(dam, drain_effectiveness=0.3), file, ["drain_effectiveness"])
    without = np.array(readings.levels) * (1 - 10 / dam["dam_base"])
    slope = -without / 0.4
    wanted = (readings.series[0].measured - without) / 0.4
    e, deviation = slope @ wanted / (slope @ slope), 1 / np.sqrt(slope @ slope)
    assert_allclose(answer.estimates, [e], rtol=1e-5)
    assert_allclose(answer.deviations, [deviation / e], rtol=1e-3)
    assert_allclose(
        answer.intervals[0], e * np.exp([-1.96 * deviation / e, 1.96 * deviation / e]), rtol=1e-3
    )
    assert answer.findings == [] and answer.undetermined == []
    assert answer.squares == pytest.approx(np.sum((wanted - e * slope) ** 2), rel=1e-6)


@pytest.mark.heavy
def test_derivatives_are_those_of_differences_without_their_runs():
    """Crest and piezometer with modulus, temperature and drains, direct; with the width of the
    base by differences; of a prior in closed form.
    """
    dam = dj.case("dam", **{**DRAINED, **SEASON})
    readings = measured(dam, instruments(5, crest_ux=1e-4, head_10=0.5))
    free = ["E_found", "temperature_dam=-20:20", "drain_effectiveness=lognorm(0.3,0,0.4)"]
    fit = Fit(dam, free_of(dam, [*free, "dam_base"]), readings, jobs=1)
    x = np.zeros(4)
    fit.residuals(x)
    slopes = fit.derivatives(x)
    assert fit.runs == 2 and np.isnan(fit.exact(x)[:, 3]).all()
    assert_allclose(slopes[:, :3], fit.by_differences(x, range(3), True), rtol=1e-4, atol=1e-4)
    assert slopes[-1].tolist() == [0.0, 0.0, pytest.approx(1 / 0.3), 0.0]


@pytest.mark.heavy
def test_exact_measurements_give_the_parameters_that_made_them(tmp_path):
    truth = {"E_dam": 2.1e10, "E_found": 1.6e10, "temperature_dam": 5.0}
    dam = dj.case("dam", **{**COARSE, **SEASON, **truth})
    file = write(
        measured(dam, instruments(12, crest_ux=1e-6, max_opening=1e-6)), tmp_path / "m.csv"
    )
    start = dj.case(dam, E_dam=3e10, E_found=3e10, temperature_dam=1.0)
    free = ["E_dam", "E_found", "temperature_dam=-20:20"]
    answer = dj.calibrate(start, file, free, jobs=1)
    assert_allclose(answer.estimates, list(truth.values()), rtol=1e-4)
    assert answer.converged and answer.squares < 1e-2


@pytest.mark.heavy
def test_intervals_cover_the_truth_as_often_as_they_say(tmp_path):
    """Ten synthetic records of a year with noise and seasonal temperature: the number of intervals
    that contain the truth is binomial; in 99.9 % of such tests it is at least 7.
    """
    truth = {"E_found": 2e10, "temperature_dam": 4.0, "drain_effectiveness": 0.6}
    dam = dj.case("dam", **{**DRAINED, **SEASON, **truth})
    free = ["E_found", "temperature_dam=-20:20", "drain_effectiveness"]
    empty, generator = instruments(12, crest_ux=5e-5, head_10=0.3), np.random.default_rng(11)
    covered, rejected = np.zeros(3), 0
    for _ in range(10):
        file = write(measured(dam, empty, generator), tmp_path / "m.csv")
        answer = dj.calibrate(dam, file, free, jobs=1)
        values = np.array(list(truth.values()))
        covered += (answer.intervals[:, 0] < values) & (values < answer.intervals[:, 1])
        rejected += bool(answer.findings)
        assert answer.converged
    assert CONFIDENCE == 0.95 and (covered >= 7).all()
    assert rejected <= 1  # a right model, in one of a hundred


@pytest.mark.heavy
def test_a_missing_drain_is_noticed_in_the_residuals(tmp_path, command):
    drained = dj.case("dam", **DRAINED)
    readings = measured(
        drained, instruments(24, crest_ux=1e-4, head_10=0.5), np.random.default_rng(5)
    )
    file = write(readings, tmp_path / "m.csv")
    words = [f"--set={name}={value}" for name, value in DRAINED.items() if name != "uplift"]
    wrong = ["calibrate", "dam", str(file), *words, "--free", "E_found", "--jobs", "1"]
    code, out, _ = command(*wrong, "--set", "uplift=imposed", "--no-picture")
    assert code == 1 and "the model does not explain the measurements" in out
    assert "head_10: measured on average" in out and "below computed" in out
    code, out, _ = command(*wrong, "--set", "uplift=drained")
    assert code == 0 and "the residuals are those of the given standard deviations" in out


@pytest.mark.heavy
def test_files_repeat_the_calibrated_run(tmp_path, command, texts_drawn):
    dam = dj.case("dam", **DRAINED)
    file = write(measured(dam, instruments(6, crest_ux=1e-4, head_10=0.5)), tmp_path / "m.csv")
    words = [f"--set={name}={value}" for name, value in DRAINED.items()]
    out = tmp_path / "fit"
    start = ["--set", "E_found=2e10", "--free", "E_found", "--out", str(out), "--jobs", "1"]
    assert command("calibrate", "dam", str(file), *words, *start)[0] == 0
    (row,) = csv.DictReader((out / "calibration.csv").open())
    assert float(row["estimate"]) == pytest.approx(dam["E_found"], rel=1e-4)
    assert float(row["low"]) < dam["E_found"] < float(row["high"]) and row["determined"] == "1"
    rows = list(csv.DictReader((out / "residuals.csv").open()))
    assert len(rows) == 12 and rows[0]["date"] == "day 0"
    for line in rows:
        error = float(line["measured"]) - float(line["computed"])
        assert float(line["residual"]) == pytest.approx(
            error / float(line["standard_deviation"]), abs=1e-6
        )
    info = json.loads((out / "run.json").read_text())
    assert info["calibration"]["parameters"]["E_found"]["estimate"] == pytest.approx(
        float(row["estimate"])
    )
    assert command("report", str(out), "--to", "report.html")[0] == 0
    page = (tmp_path / "report.html").read_text()
    assert "<h3>Calibration</h3>" in page and info["calibration"]["verdict"] in page
    low, high = (f"<td>{float(row[end]) / 1e9:.4g}</td>" for end in ("low", "high"))
    assert "12 measured values" in page and low in page and high in page
    again = dj.run(dj.case(out / "calibrated.case"))
    crest = [float(r["computed"]) for r in rows if r["series"] == "crest_ux"]
    assert_allclose(again.history.crest_ux[-6:], crest, rtol=1e-6)
    assert (out / "dam_calibration.png").exists()
    texts = next(t for t in texts_drawn if "residual / standard deviation" in t)
    estimate = f"E_found = {float(row['estimate']):.4g} Pa ({float(row['low']):.4g} to "
    assert {"crest_ux [mm]", "head_10 [m]", "computed"} <= set(texts) and estimate in " ".join(
        texts
    )


def test_what_the_measurements_do_not_determine_is_named(tmp_path, command):
    """A closed joint does not tell its fracture energy; a prior then gives the estimate."""
    dam = dj.case("dam", **DRAINED)
    file = write(measured(dam, instruments(6, head_10=0.5)), tmp_path / "m.csv")
    words = [f"--set={name}={value}" for name, value in DRAINED.items()]
    common = "calibrate", "dam", str(file), *words, "--no-picture", "--jobs", "1"
    code, out, _ = command(*common, "--free", "drain_effectiveness,G_f")
    assert code == 3 and "G_f: not determined" in out
    assert "drain_effectiveness: not determined" not in out
    answer = dj.calibrate(dam, file, ["G_f=lognorm(0.3,0,90)"], jobs=1)
    assert_allclose(answer.estimates, [90], rtol=1e-4)
    assert_allclose(answer.deviations, [0.3], rtol=1e-3)


@pytest.mark.heavy
def test_the_stiffness_of_one_lift_is_found_and_stored(tmp_path):
    soft = {"lift_heights": [12, 25], "law": "friction", "lift 25 m.K_N": 2e10, **COARSE}
    dam = dj.case("dam", **soft)
    file = write(measured(dam, instruments(6, crest_ux=1e-5)), tmp_path / "m.csv")
    first = dj.case(dam, **{"lift 25 m.K_N": 1e11})
    answer = dj.calibrate(first, file, ["lift 25 m.K_N"], jobs=1)
    assert_allclose(answer.estimates, [2e10], rtol=1e-6)
    assert answer.case.joints[2]["K_N"] == answer.estimates[0]
    assert answer.case.joints[0]["K_N"] == first.joints[0]["K_N"]
    with pytest.raises(dj.InputError, match="K_N: differs between the joints; must be of one"):
        dj.calibrate(dam, file, ["K_N"], jobs=1)
    for name, message in (("lift 26 m.K_N", "must be of a joint: base"), ("base.E", "whole dam")):
        with pytest.raises(dj.InputError, match=message):
            dj.calibrate(first, file, [name], jobs=1)


def test_fewer_values_than_parameters_determine_none_of_them():
    """One value of two parameters that both act; two values, one of each, determine both."""
    assert np.isinf(np.diag(inverse(np.array([[2.0, 1.0]])))).all()
    assert_allclose(np.diag(inverse(np.array([[2.0, 0.0], [0.0, 4.0]]))), [0.25, 0.0625])


@pytest.mark.heavy
def test_a_start_without_equilibrium_names_the_reading(tmp_path, command):
    (tmp_path / "m.csv").write_text("level,crest_ux,crest_ux_sd\n30,1e-3,1e-4\n75,1e-3,1e-4\n")
    words = [f"--set={name}={value}" for name, value in COARSE.items()]
    code, _, err = command("calibrate", "dam", "m.csv", *words, "--free", "E_found")
    assert code == 1 and "reading 2 (level 75 m)" in err


@pytest.mark.parametrize(
    "text, free, message",
    [
        ("crest_ux,crest_ux_sd\n1,1\n", "mu", "must have a column level"),
        ("level,crest_ux\n30,1e-3\n", "mu", "needs its standard deviations, column crest_ux_sd"),
        ("level,crest_ux,crest_ux_sd\n30,1e-3,0\n", "mu", "row 2: crest_ux_sd: must be > 0"),
        ("level,crest_ux,crest_ux_sd\n30,x,1\n", "mu", "row 2: crest_ux = x: must be a number"),
        ("level,crest_ux,crest_ux_sd\n,1,1\n", "mu", "row 2: level: must be a level"),
        ("level,crest,crest_sd\n30,1,1\n", "mu", "column crest: must be one of crack_length"),
        ("level,head_90,head_90_sd\n30,1,1\n", "mu", "must be 0 to"),
        ("level,head_9_2,head_9_2_sd\n30,1,1\n", "mu", "joint 2: must be one of 1 to 1"),
        ("level,crest_ux,crest_ux_sd\n30,1\n", "mu", "row 2: must have 3 cells, has 2"),
        ("level,crest_ux,crest_ux_sd\n\n30,1\n", "mu", "row 3: must have 3 cells, has 2"),
        ("level,flux,flux_sd\n30,1,1\n\n30,a,1\n", "mu", "row 4: flux = a: must be a number"),
        ("level,flux,flux_sd\n\n30,1,0\n", "mu", "row 3: flux_sd: must be > 0"),
        ("level,flux_sd\n30,1\n", "mu", "flux_sd: has no column flux"),
        (None, "mu", "can not be read"),
        ("level,crest_ux,crest_ux_sd\n30,1e-3,1\n", "mus", "mus: unknown parameter"),
        ("level,crest_ux,crest_ux_sd\n30,1e-3,1\n", "law", "must be of a parameter that is a real"),
        ("level,crest_ux,crest_ux_sd\n30,1e-3,1\n", "temperature_dam", "must have limits"),
        ("level,crest_ux,crest_ux_sd\n30,1e-3,1\n", "mu=2:3", "must contain the start value"),
        ("level,crest_ux,crest_ux_sd\n30,1e-3,1\n", "mu=3:2", "must be LOW:HIGH"),
        ("level,crest_ux,crest_ux_sd\n30,1e-3,1\n", "mu=uniform(0,1)", "a prior must be normal"),
        (
            "level,crest_ux,crest_ux_sd\n30,1e-3,1\n",
            "mu=norml(1,2)",
            "--free mu=norml(1,2): must be a",
        ),
        ("level,crest_ux,crest_ux_sd\n30,1e-3,1\n", "mu,mu", "must be given once"),
    ],
)
def test_bad_input_is_one_line(tmp_path, command, text, free, message):
    if text is not None:
        (tmp_path / "m.csv").write_text(text)
    code, out, err = command("calibrate", "dam", "m.csv", "--free", free)
    assert code == 2 and message in err and err.count("\n") == 1 and not out
    assert not (tmp_path / "out").exists()


def test_a_reading_may_lack_instruments(tmp_path):
    text = (
        "level,tail_level,crest_ux,crest_ux_sd,head_10,head_10_sd\n30,0,1e-3,1e-4,,\n35,1,,,9,1\n"
    )
    (tmp_path / "m.csv").write_text(text)
    readings = read(tmp_path / "m.csv", dj.case("dam"))
    assert readings.number == 2 and readings.tail_levels == (0.0, 1.0)
    assert [np.isfinite(one.measured).tolist() for one in readings.series] == [
        [True, False],
        [False, True],
    ]


def test_free_parameters_start_at_the_case(tmp_path):
    dam = dj.case("dam", mu=0.9)
    first, second = free_of(dam, ["mu,K_N"])
    assert (first.value(0.0), second.value(0.0)) == (0.9, dam["K_N"])
    assert first.value(first.scaled(0.7)) == pytest.approx(0.7)
