"""--accuracy: meshes refined until the estimated errors are small enough."""

import json
from dataclasses import replace

import numpy as np
import pytest
from damjoint import RunError, accuracy
from damjoint.engines.condensed.solve import solve as condensed
from damjoint.input.resolve import load

#: A dam of ordinary stiffness that slips and opens at its heel.
DAM = {"E_dam": 2e10, "E_found": 3e10, "K_N": 1e11, "K_T": 1e11}
DAM |= {"law": "friction", "adhesion": 1e5, "mu": 1.0}
TABLES_ONLY = "--no-fields", "--no-picture"


def solved(case, engine=condensed):
    """Solve the only scene of a case."""
    return next(accuracy.solve(case, engine, lambda *_: None, False))


def words(settings):
    return [part for name, value in settings.items() for part in ("--set", f"{name}={value}")]


@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_estimate_bounds_the_error_of_a_power_law(order):
    """Of q + c h^p: not below the true error, and hardly above that of order 1."""
    h = np.array([1, 0.5, 0.25])[:, None]
    values = np.array([[3.0, -2.0]]) + np.array([[1.0, -0.2]]) * h**order
    for some in (values, values[1:]):
        true = np.abs(some[-1] - [3.0, -2.0])
        change = np.abs(some[-1] - some[-2]) * (1.25 if len(some) > 2 else 3)
        found = accuracy.discretisation_error(some, counted=False)
        assert np.all(found >= true * (1 - 1e-12)) and np.all(found <= change * (1 + 1e-12))


def test_two_values_that_agree_by_accident_do_not_give_a_zero_error():
    assert accuracy.discretisation_error(
        np.array([[1.0], [2.0], [2.0]]), counted=False
    ) == pytest.approx(1.25 / 12)


def test_oscillating_values_have_no_observed_order():
    """Slip of a dam whose crack is two elements long, on 32, 64, 128 and 512 elements."""
    values, limit = np.array([[2.1486e-05], [2.0175e-05], [2.0186e-05]]), 1.96e-05
    error = accuracy.discretisation_error(values, counted=False)
    assert error == pytest.approx(1.25 * (values.max() - values.min()) / 2)
    assert error > values[-1] - limit


@pytest.mark.heavy
@pytest.mark.parametrize("scene", ["imposed", "flow"])
def test_true_errors_are_within_the_estimates(scene):
    """True errors are those against a mesh four times as fine."""
    case = load("dam", DAM | {"uplift": scene}, "40,46", accuracy="3%")
    outcome = solved(case)
    estimate = outcome.result.info["error_estimate"]
    assert estimate["reached"] and estimate["n_joint"][-1] == outcome.result.case["n_joint"]
    fine = accuracy.refine_mesh(outcome.result.case, 4)
    exact = solved(replace(fine, accuracy=None)).result
    times = sorted(accuracy.reached_times(exact))
    assert len(times) == 2
    pair = [accuracy.quantities_at(one, times) for one in (outcome.result, exact)]
    names = [name for name, one in estimate["quantities"].items() if one["used"]]
    assert {"max_opening", "slip", "crest_ux"} <= set(names) and ("flux" in names) == (
        scene == "flow"
    )
    for name in names:
        true = np.abs(np.subtract(*(one[name] for one in pair))).max()
        assert true <= estimate["quantities"][name]["error"], name
        if name not in accuracy.COUNTED_IN_ELEMENTS:
            assert estimate["quantities"][name]["relative"] <= 0.03


def test_the_statement_names_the_scale_of_a_relative_error():
    """The error of an opening is relative to the joint's largest jump, which may be slip only."""
    opening = accuracy.Estimate("max_opening", 1e-6, 7.2e-6, 1e-3)
    crest = accuracy.Estimate("crest_ux", 1e-2, 1e-4, 1e-2)
    statement = accuracy.summary(0.01, [20, 40], 3, [opening, crest], "")
    assert statement.endswith(": largest opening 0.72 % of the joint's largest jump, crest 1 %")


def test_run_writes_and_prints_the_estimate(command, tmp_path):
    """The folder is that of the last mesh, and a run on that mesh gives the same results."""
    arguments = "run", "dam", "--levels", "40", *words(DAM), *TABLES_ONLY
    code, out, _ = command(*arguments, "--accuracy", "5%", "--out", "x")
    record = json.loads((tmp_path / "x" / "run.json").read_text())
    estimate = record["error_estimate"]
    assert code == 0 and estimate["statement"] in out.splitlines()
    assert estimate["accuracy"] == 0.05 and estimate["reached"]
    assert not estimate["quantities"]["toe_stress"]["used"]
    assert "not required: stress at the toe" in estimate["statement"]
    mesh = {n: record["parameters"][n] for n in ("n_joint", "h_dam", "h_found", "order")}
    assert command(*arguments, *words(mesh), "--out", "y")[0] == 0
    pair = [(tmp_path / name / "history.csv").read_text() for name in "xy"]
    assert pair[0] == pair[1]


def test_refinement_scales_the_far_element_sizes_like_the_automatic_ones():
    for n in (64, 256):
        found = accuracy.refine_mesh(load("dam", DAM, accuracy="fine"), n / 32)
        own = load("dam", DAM | {"n_joint": n, "order": 2, "mesh_pattern": "free"})
        assert found.values == pytest.approx(own.values)


class Limited:
    """Condensed engine that raises an exception on meshes finer than `most`."""

    def __init__(self, most, what):
        self.most, self.what = most, what

    def __call__(self, case, on_step, fields):
        if case["n_joint"] > self.most:
            raise self.what
        yield from condensed(case, on_step, fields)


def test_if_memory_is_exceeded_the_results_of_the_mesh_before_are_returned():
    case = load("dam", DAM, "40", accuracy="0.01%")
    estimate = solved(case, Limited(64, RunError("memory: too much"))).result.info["error_estimate"]
    assert not estimate["reached"] and estimate["n_joint"] == [32, 64]
    assert "not reached, n_joint = 128: memory: too much" in estimate["statement"]
    with pytest.raises(RunError):
        solved(case, Limited(16, RunError("memory: too much")))


def test_if_interrupted_the_results_of_the_mesh_before_are_returned(command, tmp_path, monkeypatch):
    outcome = solved(load("dam", DAM, "40", accuracy="0.01%"), Limited(64, KeyboardInterrupt()))
    assert isinstance(outcome.error, KeyboardInterrupt) and outcome.result.last["level"] == 40
    assert outcome.result.info["error_estimate"]["n_joint"] == [32, 64]


def test_the_statement_names_the_limit_of_refinement(monkeypatch):
    monkeypatch.setitem(accuracy.FINEST, "plane", 64)
    estimate = solved(load("dam", DAM, "40", accuracy="0.01%")).result.info["error_estimate"]
    assert (
        not estimate["reached"] and "not reached, no finer mesh is tried" in estimate["statement"]
    )


@pytest.mark.parametrize("accuracy", ["1", "0%", "-1%", "100%", "nan%", "x%", "best"])
def test_a_bad_accuracy_is_refused(refused, accuracy):
    message = refused("run", "dam", f"--accuracy={accuracy}")
    assert f"accuracy = {accuracy}: must be" in message


@pytest.mark.heavy
def test_accuracy_of_two_scenes_and_in_3d():
    """Each scene of a case has its own mesh; a slice is not refined in layers."""
    slice_ = {"dim": 3, "thickness": 1.0, "hold_z": 1.0, "uplift": "imposed"}
    two = load("a", accuracy="coarse")
    both = [one.result for one in accuracy.solve(two, condensed, lambda *_: None, False)]
    assert [one.case["uplift"] for one in both] == ["imposed", "none"]
    assert all(one.info["error_estimate"]["reached"] for one in both)
    case = load("dam", DAM | slice_, "40", accuracy="5%")
    estimate = solved(case).result.info["error_estimate"]
    plane = solved(load("dam", DAM | {"uplift": "imposed"}, "40", accuracy="5%")).result
    assert estimate["reached"] and estimate["n_joint"][0] == 16
    crest = estimate["quantities"]["crest_ux"]["value"]
    assert crest == pytest.approx(plane.last["crest_ux"], rel=0.01)
