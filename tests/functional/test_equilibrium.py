"""Equilibrium of every converged step in any state of the joint: N, T, M against the loads."""

from dataclasses import replace

import numpy as np
import pytest
from closed_forms import BASE, CENTROID, WATER, WEIGHT, integral, resultants, slide_level, thrust
from damjoint import InputError, runner
from damjoint.input.resolve import load
from damjoint.statics import gravity
from damjoint.statics.rigid_block import RigidBlock
from damjoint.statics.uplift import Uplift
from numpy.testing import assert_allclose
from variants import further


def test_weight_centroid_and_sliding_levels_of_ssnp142():
    """The numbers of the documentation."""
    assert_allclose([WEIGHT, CENTROID], [765_180, 1.78205], rtol=1e-6)
    assert_allclose(
        [slide_level(0.35, 1000, False), slide_level(0.35, 1000, True)],
        [7.45784, 6.63399],
        rtol=1e-6,
    )


@pytest.mark.parametrize(
    "name, levels, tail_levels, settings",
    [
        ("a", None, None, {}),
        ("i", None, None, {}),
        ("c", None, None, {}),
        ("j", None, None, {}),
        ("a", "0.3,9.9", None, {}),
        ("c", "6,9,2,8", None, {}),
        ("c", None, "1,2,3,4", {}),
        ("a", "5,10", "5,10", {"uplift": "none"}),
        ("i", None, "2", {"n_joint": 20}),
        pytest.param("b", None, None, {}, marks=pytest.mark.heavy),
        pytest.param("d", None, None, {}, marks=pytest.mark.heavy),
        (
            "c",
            "3,8",
            "3",
            {"dim": 3, "n_joint": 20, "n_layers": 2, "thickness": 0.4, "h_dam": 2, "h_found": 3},
        ),
    ],
)
def test_resultants_without_flow(solve, name, levels, tail_levels, settings):
    for result in solve(name, levels, tail_levels, **settings):
        case, history = result.case, result.history
        tail = np.interp(history["time"], range(len(case.levels) + 1), (0, *case.tail_levels))
        expected = resultants(history["level"], tail, case["uplift"] != "none")
        assert not result.stopped and history["level"][-1] == pytest.approx(case.levels[-1])
        for key, value, scale in zip("NTM", expected, (WEIGHT, WEIGHT, WEIGHT * BASE), strict=True):
            assert_allclose(history[key], value, rtol=1e-6, atol=1e-9 * scale, err_msg=key)


@pytest.mark.heavy
@pytest.mark.parametrize("name", ["e", "g", "f", "h"])
def test_resultants_with_flow(solve, name):
    """The uplift is the computed pressure, linear between the nodes (in 3D nearly)."""
    (result,) = solve(name)
    history = result.history
    accuracy = 1e-6 if result.case["dim"] == 2 else 2e-4
    assert_allclose(history["T"], thrust(history["level"]), rtol=1e-6)
    for time in result.case.requested:
        step = np.flatnonzero(history["time"] == time)[0]
        rows = result.at(time)
        x, place = np.unique(rows["x"].round(9), return_inverse=True)
        p, level = np.bincount(place, rows["p"]) / np.bincount(place), history["level"][step]
        assert history["N"][step] == pytest.approx(WEIGHT - integral(x, p), rel=accuracy)
        assert history["M"][step] == pytest.approx(
            WEIGHT * (BASE - CENTROID) - thrust(level) * level / 3 - integral(x, p, BASE - x),
            rel=accuracy,
        )


def test_resultants_of_a_uniform_pressure(solve):
    """K: the level is a uniform pressure WATER level on the face, also while it is an unknown."""
    (result,) = solve("k")
    p = WATER * result.history["level"]
    assert_allclose(result.history["N"], WEIGHT, rtol=1e-6)
    assert_allclose(result.history["T"], p * 10, rtol=1e-6)
    assert_allclose(result.history["M"], WEIGHT * (BASE - CENTROID) - p * 10**2 / 2, rtol=1e-6)


@pytest.mark.parametrize("name", ["a", "c"])
def test_integrals_of_the_joint_table_are_the_resultants(solve, name):
    """But for the singular stresses at the ends."""
    result = solve(name)[0]
    rows = result.at()
    assert integral(rows["x"], -(rows["sigma_n"] + rows["p"])) == pytest.approx(
        result.history["N"][-1], rel=5e-3
    )
    assert integral(rows["x"], rows["tau_1"]) == pytest.approx(result.history["T"][-1], rel=3e-2)


@pytest.mark.parametrize("engine", further(1, ["condensed", "getdp"]))
@pytest.mark.parametrize(
    "level, tail, effectiveness, outlet, at_drains",
    [
        (8, 0, 0, 0, 6.4),  # without effect: linear
        (8, 1, 0.5, 0, 1 + 0.5 * 5.6),  # down to the tailwater: 8 - 7/5 = 6.6
        (8, 1, 1, 3, 3),  # down to the gallery
        (3, 0, 1, 5, 2.4),  # the gallery is higher than the head
    ],
)
def test_resultants_with_drains(tmp_path, engine, level, tail, effectiveness, outlet, at_drains):
    """Uplift linear from heel to drains (1 m) to toe: U, N, M in closed form, p in the table."""
    drains = {"drain_x": 1.0, "drain_effectiveness": effectiveness, "drain_level": outlet}
    settings = {"uplift": "drained", "n_joint": 20.0, **{n: float(v) for n, v in drains.items()}}
    case = load("c", settings, str(level), str(tail))
    (result,) = runner.run(case, tmp_path, False, False, False, engine)
    heads = np.array([level, at_drains, tail]) * WATER
    uplift = (heads[0] + heads[1]) / 2 * 1 + (heads[1] + heads[2]) / 2 * 4
    x, p = result.at()["x"], result.at()["p"]
    assert_allclose(p, np.interp(x, (0, 1, 5), heads), rtol=1e-9, atol=1e-6)
    last = result.last
    assert last["U"] == pytest.approx(uplift, rel=1e-9)
    dry_n, _, dry_m = resultants(level, tail, False)
    moment = integral(np.array([0.0, 1, 5]), heads, np.array([5.0, 4, 0]))
    assert last["N"] == pytest.approx(dry_n - uplift, rel=1e-6)
    assert last["M"] == pytest.approx(dry_m - moment, rel=1e-6)


@pytest.mark.parametrize("engine", ["condensed", "getdp"])
def test_the_head_at_the_heel_is_above_the_reservoir_by_the_offset(tmp_path, engine):
    """As in a published mesh whose joint is 0.1 m thick: p = rho g h (1 - x/5) with h = 9 m, a face
    under 8.9 m of water.
    """
    case = load("c", {"joint_head_offset": 0.1, "n_joint": 20.0, "uplift": "imposed"}, "8.9")
    (result,) = runner.run(case, tmp_path, False, False, False, engine)
    x, p = result.at()["x"], result.at()["p"]
    assert_allclose(p, 9 * WATER * (1 - x / 5), rtol=1e-9, atol=1e-6)
    assert result.last["N"] == pytest.approx(
        resultants(8.9, 0, False)[0] - 9 * WATER * 5 / 2, rel=1e-6
    )
    uplift = Uplift(case, RigidBlock(case), 8.9, 0, 0)
    assert uplift.force == pytest.approx(9 * WATER * 5 / 2)


@pytest.mark.parametrize("order", further(1, [1, 2]))
@pytest.mark.parametrize(
    "engine, uplift, settings",
    further(
        6,
        [
            ("condensed", "drained", {}),
            ("getdp", "drained", {}),
            ("condensed", "cracked", {}),
            ("condensed", "flow", {}),
            ("getdp", "flow", {}),
            ("getdp", "cracked", {}),
            ("condensed", "drained", {"mesh_pattern": "regular"}),
            ("condensed", "cracked", {"mesh_pattern": "regular"}),
            ("condensed", "drained", {"dim": 3, "n_layers": 2, "mesh_pattern": "layers"}),
            ("condensed", "cracked", {"dim": 3, "n_layers": 2, "thickness": 10}),
        ],
    ),
)
def test_uplift_is_exact_with_drains_between_regular_nodes(
    tmp_path, engine, uplift, settings, order
):
    """The element lengths from heel to drains differ from the others."""
    drains = {"uplift": uplift, "drains": float(uplift != "drained"), "drain_x": 6.1}
    case = load("dam", {"n_joint": 9, "order": order} | drains | settings, "30", "3")
    (result,) = runner.run(case, tmp_path, False, False, False, engine)
    uplift = {"uplift": "drained" if uplift == "drained" else "cracked"}
    method = gravity.at(replace(case, values=case.values | uplift), 1.0)
    assert result.last["max_opening"] <= 0 == method.crack_length
    assert result.last["U"] == pytest.approx(method.U, rel=1e-8)
    assert result.last["M"] == pytest.approx(method.M, rel=1e-6)


def test_drains_beyond_the_joint_or_below_an_unknown_level_are_refused():
    for settings, message in (
        ({"drain_x": 5.0}, "drain_x = 5: must be < the joint's length"),
        ({"drain_level": 1.0, "drive": "heel"}, "drain_level = 1: must be 0"),
    ):
        with pytest.raises(InputError, match=message):
            load("c", {"uplift": "drained"} | settings)


def test_the_weight_of_settling_rock_stays_in_the_rock(solve):
    """It moves the dam and adds nothing to N, T, M."""
    rock = {"rho_found": 2700.0, "n_joint": 20, "weight_first": 0}
    (firm,), (settled,) = (solve("dam", "40", in_situ=value, **rock) for value in (1, 0))
    for name in ("N", "T", "M"):
        assert_allclose(settled.history[name], firm.history[name], rtol=1e-9)
    assert abs(settled.history["crest_ux"][-1] - firm.history["crest_ux"][-1]) > 1e-5
