"""Sections with batter, neck, sloping and lift joints, and all loads: equilibrium against the
integration of sections.py, cracked uplift against the gravity method.
"""

import numpy as np
import pytest
from closed_forms import WATER
from damjoint import InputError
from damjoint.input.resolve import load
from damjoint.statics import gravity
from numpy.testing import assert_allclose
from sections import resultants
from variants import further

SHAPES = {
    "plain": {},
    "batter and neck": {"batter": 4, "batter_height": 20, "neck_height": 6},
    "sloping neck": {"batter": 4, "neck_height": 15, "neck_batter": 5},
    "polygon": {"batter": 4, "downstream_face": (30, 12, 12, 30, 7, 40)},
    "lift in a polygon": {
        "joint_height": 26,
        "joint_slope": -5,
        "downstream_face": (30, 12, 12, 28, 7, 40),
    },
    "rising base": {"batter": 4, "neck_height": 6, "joint_slope": 5},
    "falling base": {"batter": 4, "neck_height": 6, "joint_slope": -4},
    "lift": {"joint_height": 20, "neck_height": 6},
    "sloping lift": {"joint_height": 20, "batter": 4, "batter_height": 15, "joint_slope": 3},
    "lift in the batter": {"joint_height": 10, "batter": 4, "batter_height": 20},
    "lift in the neck": {"joint_height": 41, "neck_height": 6, "batter": 2},
    "sloping lift in a sloping neck": {
        "joint_height": 34,
        "joint_slope": 4,
        "neck_height": 15,
        "neck_batter": 5,
    },
}
LOADS = {
    "silt_height": 12,
    "ice_force": 1e5,
    "ice_level": 42,
    "anchor_force": 2e6,
    "anchor_angle": 10,
    "force_x": 3e4,
    "force_y": -2e4,
    "force_at": 1,
    "k_h": 0.1,
    "k_v": 0.05,
    "floor_water": 1,
}
SMALL = {"n_joint": 20, "h_dam": 6, "h_found": 30, "sigma_max": 1e6, "G_f": 1000}


def check(result, share=1.0):
    """Assert N, T, M of the last step against loads and a pressure linear along the joint."""
    case, last = result.case, result.last
    assert not result.stopped
    length, unit = case.joint_length, case["rho_water"] * case["g"]
    heel, toe = (case.section[f"{end}_y"][0] for end in ("heel", "toe"))
    level, tail = last["level"], last["tail_level"]
    before, behind = unit * max(level - heel, 0), unit * max(tail - toe, 0)
    uplift = length * (before + behind) / 2
    arm = length**2 * (before / 3 + behind / 6) / uplift if uplift else 0.0
    expected = resultants(case, level, tail, uplift, arm)
    scale = np.hypot(expected[0], expected[1])
    for name, value, size in zip("NTM", expected, (scale, scale, scale * length), strict=True):
        assert_allclose(last[name], value, rtol=1e-6, atol=1e-8 * size * share, err_msg=name)
    assert last["U"] == pytest.approx(uplift, rel=1e-9)


@pytest.mark.parametrize("levels, tails", further(1, [("20,43", "0,3"), ("46.5", "24")]))
@pytest.mark.parametrize("shape", SHAPES)
def test_resultants_of_water_on_a_section(solve, shape, levels, tails):
    (result,) = solve("dam", levels, tails, **SMALL, **SHAPES[shape])
    check(result)


@pytest.mark.parametrize("shape", SHAPES)
def test_resultants_of_all_loads_on_a_section(solve, shape):
    """Loads that act on the lower body are not loads of the upper body."""
    (result,) = solve("dam", "20,44.5", "0", **SMALL, **SHAPES[shape], **LOADS)
    check(result)


def test_resultants_of_low_water(solve):
    """Below the first integration point of a coarse face."""
    coarse = {"mesh_pattern": "regular", "h_dam": 20, "n_joint": 5, "uplift": "none"}
    (result,) = solve("dam", "0.5", **coarse)
    assert result.last["T"] == pytest.approx(WATER * 0.5**2 / 2, rel=1e-6)


@pytest.mark.heavy
def test_resultants_in_3d(solve):
    solid = {"dim": 3, "mesh_pattern": "split", "thickness": 3, "n_layers": 2, "n_joint": 10}
    shape = {"batter": 4, "batter_height": 20, "neck_height": 6, "neck_batter": 2, "joint_slope": 4}
    (result,) = solve(
        "dam", "20,41", **solid, **shape, **{n: LOADS[n] for n in ("silt_height", "k_h")}
    )
    check(result)


def test_weight_of_the_foundation(solve):
    """It settles an unstressed rock, and the dam with it; in equilibrium it changes nothing."""
    plain, in_situ, settling = (
        solve("dam", "20", uplift="none", weight_first=0, **SMALL, **rock)[0].last
        for rock in ({}, {"rho_found": 2700}, {"rho_found": 2700, "in_situ": 0})
    )
    assert in_situ["crest_ux"] == plain["crest_ux"] != settling["crest_ux"]
    assert_allclose([settling[n] for n in "NTM"], [plain[n] for n in "NTM"], rtol=1e-6)


def test_crest_displacements_count_from_the_state_under_weight(solve):
    (first,), (both,) = (
        solve("dam", "0.001,20", uplift="none", weight_first=w, **SMALL) for w in (1, 0)
    )
    moved, whole = first.history["crest_ux"], both.history["crest_ux"]
    assert abs(moved[0]) < 1e-3 * abs(moved[1])
    assert_allclose(np.diff(moved), np.diff(whole), rtol=1e-6)
    assert abs(whole[0]) > 0.1 * abs(moved[1])


def test_loads_increase_linearly_up_to_their_time(solve):
    """Ice of 1e5 N/m from t = 1 to 2, constant beyond."""
    (result,) = solve(
        "dam", "30,30,30", steps=2, uplift="none", **SMALL, ice_force=1e5, ice_level=30, ice_t=2
    )
    (without,) = solve("dam", "30,30,30", steps=2, uplift="none", **SMALL)
    more = result.history["T"] - without.history["T"]
    assert_allclose(more, [0, 0, 5e4, 1e5, 1e5, 1e5], atol=1)


#: Dam and rock so stiff that the joint's stress is linear, as in the gravity method.
RIGID = {
    "E_dam": 1e15,
    "E_found": 1e15,
    "K_N": 1e10,
    "K_T": 1e10,
    "sigma_max": 0,
    "n_joint": 200,
    "h_dam": 10,
    "h_found": 50,
}


@pytest.mark.heavy
@pytest.mark.parametrize(
    "uplift, crack, force",
    [
        ("imposed", 1.0813, 12_683_000),
        ("cracked", 2.4149, 12_185_850),
        ("flow", 2.4149, 12_185_850),
    ],
)
def test_the_crack_of_a_rigid_dam_is_that_of_the_gravity_method(solve, uplift, crack, force):
    """45 m dam without tension, level 45 m, tailwater 3 m. Flow with a tiny aperture is full head
    in the crack, linear beyond.
    """
    (result,) = solve("dam", "40,45", "3", **RIGID, uplift=uplift, aperture_min=1e-9)
    assert result.last["crack_length"] == pytest.approx(crack, abs=0.05)
    assert result.last["N"] == pytest.approx(force, rel=2e-3)


@pytest.mark.heavy
def test_uplift_cracked_has_no_water_in_an_intact_bond(solve):
    """uplift = cracked: full head in the broken part; uplift = flow: in any opening."""
    (cracked,), (flow,), (linear,) = (
        solve("dam", "40,45", "3", uplift=u, aperture_min=1e-8, n_joint=100)
        for u in ("cracked", "flow", "imposed")
    )
    assert 0 < cracked.last["max_opening"] and cracked.last["crack_length"] == 0
    assert cracked.last["U"] == pytest.approx(linear.last["U"], rel=1e-9)
    assert flow.last["U"] > 1.01 * linear.last["U"]


@pytest.mark.parametrize(
    "settings, message",
    [
        ({"neck_height": 45}, "neck_height = 45: must be < dam_height"),
        ({"neck_height": 9, "neck_batter": 30}, "neck_batter = 30: must be at most 29 m"),
        ({"neck_height": 9, "neck_batter": 1e-9}, "neck_batter = 1e-09: must be >= 4.5e-05 m"),
        ({"batter_height": 46}, "batter_height = 46: must be <= dam_height"),
        ({"joint_height": 50}, "joint_height = 50: must be < dam_height"),
        ({"batter": 34}, "batter = 34: must be < dam_base"),
        ({"joint_slope": 60}, "joint_slope = 60: must let the joint leave the dam"),
        ({"ice_force": 1.0, "ice_level": 46}, "ice_level = 46: must lie on the upstream face"),
        ({"anchor_force": 1.0, "anchor_at": 6}, "anchor_at = 6: must lie on the crest"),
        ({"force_x": 1.0, "force_at": 6}, "force_at = 6: must lie on the crest face"),
        ({"mesh_pattern": "regular", "batter": 4}, "mesh_pattern = regular: must be free"),
    ],
)
def test_an_impossible_section_is_refused(settings, message):
    with pytest.raises(InputError, match=message):
        load("dam", settings)


@pytest.mark.heavy
@pytest.mark.parametrize("effectiveness", [1.0, 0.5, 0.0])
def test_drains_in_the_uncracked_part(solve, effectiveness):
    """As in the gravity method, on a rigid dam; there is a node at the drains."""
    drains = {"drains": 1, "drain_x": 4, "drain_effectiveness": effectiveness}
    mesh = {"n_joint": 340, "uplift": "cracked"}
    (result,) = solve("dam", "40,45", "3", **RIGID | mesh | drains)
    hand = gravity.at(result.case, 2.0)
    assert result.last["U"] == pytest.approx(hand.U, rel=1e-3)
    assert result.last["crack_length"] == pytest.approx(hand.crack_length, abs=0.05)


@pytest.mark.parametrize("uplift", ["cracked", "flow"])
def test_drains_of_a_closed_lift_joint(solve, uplift):
    """Their outlet, the heel of the base, is below them: they lower the head to their own height,
    as with uplift = drained; there is a node at the drains.
    """
    lift = {"joint_height": 20, "joint_slope": -3, "n_joint": 20}
    lift |= {"drains": 1, "drain_effectiveness": 0.8}
    lift["drain_x"] = 0.2 * load("dam", lift).joint_length
    flowing, drained = (solve("dam", "40", uplift=u, **lift)[0] for u in (uplift, "drained"))
    assert flowing.at()["p"] == pytest.approx(drained.at()["p"], rel=1e-6, abs=1)
    assert flowing.last["U"] == pytest.approx(drained.last["U"], rel=1e-6)


@pytest.mark.heavy
@pytest.mark.parametrize("name", ["e", "f"])
def test_drains_where_water_flows(solve, name):
    """They take a part of the flow, the rest leaves at the toe; in 2D and 3D the same. Where
    the joint is closed: rho w^3 / (12 eta) dp/ds.
    """
    (result,) = solve(name, drains=1, drain_x=1, drain_effectiveness=0.5)
    rows = result.at()
    x, flux = rows["s"], rows["flux"]
    closed = rows["delta_n"] < 0
    slope, _ = np.polyfit(x[closed], rows["p"][closed], 1)
    assert result.last["flux"] == pytest.approx(-1000 * 1e-8**3 / (12 * 1e-3) * slope, rel=1e-3)
    assert flux[x > 1.2] == pytest.approx(result.last["flux"], rel=1e-2)
    assert (flux[x < 0.9] > 2 * result.last["flux"]).all()
