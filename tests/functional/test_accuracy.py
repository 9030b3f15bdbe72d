"""--accuracy: meshes refined until the estimated errors are small enough, and what is said of
them."""

import json
from dataclasses import replace

import numpy as np
import pytest
from damjoint import RunError, accuracy
from damjoint.engines.condensed import solve as condensed
from damjoint.model.case import load

#: A dam of ordinary stiffness that slips and opens at its heel.
DAM = {"E_dam": 2e10, "E_found": 3e10, "K_N": 1e11, "K_T": 1e11}
DAM |= {"law": "friction", "adhesion": 1e5, "mu": 1.0}
PLAIN = "--no-fields", "--no-picture"


def solved(case, engine=condensed):
    """The one scene of a case."""
    return next(accuracy.solve(case, engine, lambda *_: None, False))


def words(settings):
    return [part for name, value in settings.items() for part in ("--set", f"{name}={value}")]


@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_error_left_of_a_power(order):
    """Of q + c h^p no less than what is left, and hardly more than what order 1 leaves."""
    h = np.array([1, 0.5, 0.25])[:, None]
    values = np.array([[3.0, -2.0]]) + np.array([[1.0, -0.2]]) * h**order
    for some in (values, values[1:]):
        true = np.abs(some[-1] - [3.0, -2.0])
        change = np.abs(some[-1] - some[-2]) * (1.25 if len(some) > 2 else 3)
        found = accuracy.discretisation_error(some, counted=False)
        assert np.all(found >= true * (1 - 1e-12)) and np.all(found <= change * (1 + 1e-12))


def test_two_values_that_agree_by_accident():
    assert accuracy.discretisation_error(
        np.array([[1.0], [2.0], [2.0]]), counted=False
    ) == pytest.approx(1.25 / 12)


def test_values_that_go_to_and_fro_show_no_order():
    """The slip of a dam whose crack is two elements long: 32, 64, 128, 512 elements."""
    values, limit = np.array([[2.1486e-05], [2.0175e-05], [2.0186e-05]]), 1.96e-05
    error = accuracy.discretisation_error(values, counted=False)
    assert error == pytest.approx(1.25 * (values.max() - values.min()) / 2)
    assert error > values[-1] - limit


@pytest.mark.parametrize("scene", [pytest.param("imposed", marks=pytest.mark.heavy), "flow"])
def test_what_is_said_is_true(scene):
    """The errors on the mesh found, by one four times as fine; each within its estimate."""
    case = load("dam", DAM | {"uplift": scene}, "40,46", accuracy="3%")
    outcome = solved(case)
    told = outcome.result.info["error_estimate"]
    assert told["reached"] and told["n_joint"][-1] == outcome.result.case["n_joint"]
    fine = accuracy.refine_mesh(outcome.result.case, 4)
    exact = solved(replace(fine, accuracy=None)).result
    times = sorted(accuracy.reached_times(exact))
    assert len(times) == 2
    pair = [accuracy.quantities_at(one, times) for one in (outcome.result, exact)]
    names = [name for name, one in told["quantities"].items() if one["used"]]
    assert {"max_opening", "slip", "crest_ux"} <= set(names) and ("flux" in names) == (
        scene == "flow"
    )
    for name in names:
        true = np.abs(np.subtract(*(one[name] for one in pair))).max()
        assert true <= told["quantities"][name]["error"], name
        if name not in accuracy.COUNTED_IN_ELEMENTS:
            assert told["quantities"][name]["relative"] <= 0.03


def test_a_summary_says_what_an_error_is_relative_to():
    """An opening's error stands beside the joint's largest jump, which may be all slip."""
    opening = accuracy.Estimate("max_opening", 1e-6, 7.2e-6, 1e-3)
    crest = accuracy.Estimate("crest_ux", 1e-2, 1e-4, 1e-2)
    said = accuracy.summary(0.01, [20, 40], 3, [opening, crest], "")
    assert said.endswith(": largest opening 0.72 % of the joint's largest jump, crest 1 %")


def test_run_writes_and_says_it(command, tmp_path):
    """One line; the folder is the last mesh's, and a run on that mesh gives the same."""
    asked = "run", "dam", "--levels", "40", *words(DAM), *PLAIN
    code, said, _ = command(*asked, "--accuracy", "5%", "--out", "x")
    told = json.loads((tmp_path / "x" / "run.json").read_text())
    estimate = told["error_estimate"]
    assert code == 0 and estimate["statement"] in said.splitlines()
    assert estimate["accuracy"] == 0.05 and estimate["reached"]
    assert not estimate["quantities"]["toe_stress"]["used"]
    assert "not required: stress at the toe" in estimate["statement"]
    mesh = {n: told["parameters"][n] for n in ("n_joint", "h_dam", "h_found", "order")}
    assert command(*asked, *words(mesh), "--out", "y")[0] == 0
    pair = [(tmp_path / name / "history.csv").read_text() for name in "xy"]
    assert pair[0] == pair[1]


def test_sizes_far_away_follow_as_automatic_ones():
    for n in (64, 256):
        found = accuracy.refine_mesh(load("dam", DAM, accuracy="fine"), n / 32)
        own = load("dam", DAM | {"n_joint": n, "order": 2, "mesh_pattern": "free"})
        assert found.values == pytest.approx(own.values)


class Stub:
    """The condensed engine on meshes below a size; above, something happens."""

    def __init__(self, most, what):
        self.most, self.what = most, what

    def solve(self, case, on_step, fields):
        if case["n_joint"] > self.most:
            raise self.what
        yield from condensed.solve(case, on_step, fields)


def test_a_mesh_beyond_the_memory_leaves_the_one_before():
    case = load("dam", DAM, "40", accuracy="0.01%")
    told = solved(case, Stub(64, RunError("memory: too much"))).result.info["error_estimate"]
    assert not told["reached"] and told["n_joint"] == [32, 64]
    assert "not reached, n_joint = 128: memory: too much" in told["statement"]
    with pytest.raises(RunError):
        solved(case, Stub(16, RunError("memory: too much")))


def test_an_interruption_keeps_the_mesh_before(command, tmp_path, monkeypatch):
    outcome = solved(load("dam", DAM, "40", accuracy="0.01%"), Stub(64, KeyboardInterrupt()))
    assert isinstance(outcome.error, KeyboardInterrupt) and outcome.result.last["level"] == 40
    assert outcome.result.info["error_estimate"]["n_joint"] == [32, 64]


def test_the_finest_mesh_is_said(monkeypatch):
    monkeypatch.setitem(accuracy.FINEST, "plane", 64)
    told = solved(load("dam", DAM, "40", accuracy="0.01%")).result.info["error_estimate"]
    assert not told["reached"] and "not reached, no finer mesh is tried" in told["statement"]


@pytest.mark.parametrize("asked", ["1", "0%", "-1%", "100%", "nan%", "x%", "best"])
def test_bad_accuracies(command, asked, tmp_path):
    code, _, error = command("run", "dam", f"--accuracy={asked}")
    assert code == 2 and f"accuracy = {asked}: must be" in error and error.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.heavy
def test_both_scenes_and_3d():
    """Each scene of a case on a mesh of its own; a slice needs no layers."""
    slice_ = {"dim": 3, "thickness": 1.0, "hold_z": 1.0, "uplift": "imposed"}
    two = load("a", accuracy="coarse")
    both = [one.result for one in accuracy.solve(two, condensed, lambda *_: None, False)]
    assert [one.case["uplift"] for one in both] == ["imposed", "none"]
    assert all(one.info["error_estimate"]["reached"] for one in both)
    case = load("dam", DAM | slice_, "40", accuracy="5%")
    told = solved(case).result.info["error_estimate"]
    plane = solved(load("dam", DAM | {"uplift": "imposed"}, "40", accuracy="5%")).result
    assert told["reached"] and told["n_joint"][0] == 16
    crest = told["quantities"]["crest_ux"]["value"]
    assert crest == pytest.approx(plane.last["crest_ux"], rel=0.01)
