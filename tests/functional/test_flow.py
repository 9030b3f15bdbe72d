"""Flow through the joint: cubic law, mass balance, limits."""

from dataclasses import replace

import numpy as np
import pytest
from closed_forms import BASE, WATER, differences
from damjoint import runner
from damjoint.input.resolve import load
from damjoint.model.loads import COMPLETE
from damjoint.solver.model import Model
from damjoint.statics import gravity
from damjoint.statics.hints import hints
from numpy.testing import assert_allclose


@pytest.mark.heavy
@pytest.mark.parametrize("name, level, tail", [("e", 2, 0), ("g", 3, 1)])
def test_flow_through_a_joint_of_uniform_aperture(solve, name, level, tail):
    """Aperture w: linear pressure, q = rho (p0 - pL) w^3 / (12 visc L)."""
    (result,) = solve(name, str(level), str(tail), K_N=1e14, visc=2e-3)
    rows, w = result.at(), result.case["aperture_min"]
    assert rows["delta_n"].max() <= 0
    assert_allclose(
        rows["p"], WATER * (level + (tail - level) * rows["x"] / BASE), rtol=1e-9, atol=1e-6
    )
    q = 1000 * WATER * (level - tail) * w**3 / (12 * 2e-3 * BASE)
    assert result.history["flux"][-1] == pytest.approx(q, rel=1e-9)
    assert_allclose(rows["flux"], q, rtol=1e-9)


@pytest.mark.parametrize(
    "name", ["e", "g", *(pytest.param(name, marks=pytest.mark.heavy) for name in "fh")]
)
def test_the_flux_is_uniform_along_the_joint(solve, name):
    """Equal to that of the history; in 3D nearly, as a mean over z of element values."""
    (result,) = solve(name)
    rows = result.at()
    q = result.history["flux"][-1]
    x = np.unique(rows["x"].round(9))
    means = np.array([rows["flux"][np.isclose(rows["x"], v)].mean() for v in x])
    flat = result.case["dim"] == 2
    assert means[0] == pytest.approx(means[-1], rel=1e-6 if flat else 2e-2)
    assert_allclose(means, q, rtol=1e-6 if flat else 5e-2)


@pytest.mark.parametrize(
    "name", ["e", "g", *(pytest.param(name, marks=pytest.mark.heavy) for name in "fh")]
)
def test_pressure_falls_from_heel_to_toe(solve, name):
    (result,) = solve(name)
    for time in result.case.requested:
        rows = result.at(time)
        level = result.case.level_at(time)
        rows = {key: column[rows["z"] == rows["z"].min()] for key, column in rows.items()}
        assert rows["p"][[0, -1]] == pytest.approx([WATER * level, 0], rel=1e-12, abs=1e-6)
        assert np.all(np.diff(rows["p"]) < 1e-6 * WATER * level)


@pytest.mark.parametrize("name, tolerance", [("e", 0.02), ("g", 0.005)])
def test_pressure_and_flux_follow_from_the_openings(solve, name, tolerance):
    """p0 - p(x) ~ int_0^x w^-3, q = rho p0 / (12 visc int w^-3), by trapezoids over joint.csv."""
    (result,) = solve(name)
    rows = result.at()
    x = rows["x"]
    resistance = (result.case["aperture_min"] + np.maximum(rows["delta_n"], 0)) ** -3
    along = np.r_[0, np.cumsum(np.diff(x) * (resistance[1:] + resistance[:-1]) / 2)]
    p = WATER * 9 * (1 - along / along[-1])
    assert_allclose(rows["p"], p, atol=tolerance * WATER * 9)
    assert result.history["flux"][-1] == pytest.approx(
        1000 * WATER * 9 / (12 * 1e-3 * along[-1]), rel=tolerance
    )


@pytest.mark.heavy
@pytest.mark.parametrize("name", ["e", "g"])
@pytest.mark.parametrize("steps", [5, 20])
def test_monotone_filling_with_flow_does_not_depend_on_the_steps(solve, name, steps):
    one, many = solve(name, "9")[0], solve(name, "9", steps=steps)[0]
    assert (
        max(differences(one, many, names=("delta_n", "delta_t1", "sigma_n", "tau_1", "p"))) < 1e-4
    )


def test_the_flux_is_the_cube_of_the_aperture(solve):
    """Closed joint."""
    q = [solve("e", "2", aperture_min=w)[0].history["flux"][-1] for w in (1e-8, 3e-8)]
    assert q[1] / q[0] == pytest.approx(27, rel=1e-6)


@pytest.mark.heavy
@pytest.mark.parametrize("slope", [0.0, 6.0])
def test_water_up_to_a_waterstop(solve, slope):
    """In a lift joint, within an element: U as in the gravity method."""
    section = {"n_joint": 12, "joint_height": 20, "joint_slope": slope}
    (result,) = solve("dam", "45", uplift="waterstop", waterstop=1.2, **section)
    rows, U = result.at(), result.history["U"][-1]
    assert U == pytest.approx(gravity.at(result.case, 1).U, rel=1e-9)
    head = 45 - 20 - 1.2 * np.sin(np.radians(slope)) / 2
    assert U == pytest.approx(WATER * head * 1.2, rel=1e-9)
    assert not rows["p"][rows["s"] > 1.2].any()


@pytest.mark.heavy
@pytest.mark.parametrize("engine", ["condensed", "getdp"])
@pytest.mark.parametrize("slope, level, tail", [(4, 5.3, 0), (4, 5.3, 5.35), (-4, 4.9, 4.8)])
def test_no_water_enters_at_a_dry_end(tmp_path, engine, slope, level, tail):
    """A lift joint from 5 m at the heel to 5.4 m or 4.6 m at the toe, one of them above the water:
    at rest if the flow is computed, else linear to a pressure of zero there.
    """
    section = {"dam_height": 13, "dam_base": 8, "dam_crest": 1.5, "joint_height": 5}
    for uplift in ("imposed", "flow"):
        settings = section | {"joint_slope": slope, "uplift": uplift, "n_joint": 13}
        case = load("dam", settings, [level], [tail])
        (result,) = runner.run(case, tmp_path, False, False, False, engine)
        ends, rows = case.section, result.at()
        heel, toe = ends["heel_y"][0], ends["toe_y"][0]
        p = WATER * np.maximum([level - heel, tail - toe], 0)
        if uplift == "imposed":
            exact = p[0] + (p[1] - p[0]) * rows["s"] / ends["joint_length"][0]
        else:
            exact = WATER * np.maximum((level if p[0] else tail) - rows["y"], 0)
            assert result.history["flux"][-1] == 0
        assert max(p) > 0 and min(p) == 0
        assert_allclose(rows["p"], exact, atol=1e-6)
        assert result.history["U"][-1] == pytest.approx(
            gravity.at(case, 1).U, rel=1e-9 if uplift == "imposed" else 1e-3
        )


def test_a_crack_ends_the_effect_of_drains_while_it_grows_through_an_element(solve):
    """Drains behind the first element: the Gauss points of it that are closed leave as much of the
    effect as their weights. Full head in the crack, linear from the drains to the toe.
    """
    drains = {"drains": 1.0, "drain_x": 6.0, "drain_effectiveness": 2 / 3}
    dam = {"dam_height": 80.0, "dam_base": 60.0, "n_joint": 8.0, "h_dam": 12.0, "h_found": 40.0}
    settings = dam | drains | {"uplift": "cracked", "sigma_max": 0.0}
    (result,) = solve("dam", "60,78", "0", **settings)
    assert 0 < result.last["crack_length"] < 6
    head = 78 * (1 - 2 / 3 * 13 / 18)
    force = WATER * ((78 + head) / 2 * 6 + head / 2 * 54)
    assert result.last["U"] == pytest.approx(force, rel=1e-5)
    assert "in the element before the drains (6 m)" in "\n".join(hints(result))


def test_a_trial_that_exceeds_the_most_without_the_flowing_water_has_none():
    """Its norm shows that on the unknowns on which the water does not act; less needs the water."""
    model = Model(load("dam", {"uplift": "flow", "n_joint": 10.0}))
    problem, loading = model.begin(model.start(), 1.0).problem, replace(COMPLETE, level=30.0)
    jump = 1e-4 * np.random.default_rng(1).normal(size=len(problem.stiffness))
    whole, beside = problem.residual(jump, loading).value, problem.water.beside
    assert 0 < beside.sum() < len(beside)
    bound = np.linalg.norm(whole[beside])
    least = problem.residual(jump, loading, most=0.99 * bound).value
    assert_allclose(least[beside], whole[beside], rtol=0, atol=0)
    assert np.abs(least - whole)[~beside].max() > 1e3 and np.linalg.norm(least) > 0.99 * bound
    for most in (1.01 * bound, np.inf):
        assert np.array_equal(problem.residual(jump, loading, most=most).value, whole)
