"""Limit loads: sliding, overturning, and equilibrium beyond them under displacement control."""

import numpy as np
import pytest
from closed_forms import BASE, CENTROID, WATER, WEIGHT, slide_level, thrust
from damjoint import cli
from damjoint.statics.hints import hints
from damjoint.statics.statement import statement
from damjoint.statics.verdict import failed, verdict
from numpy.testing import assert_allclose


@pytest.mark.parametrize("hardening", [0, 1e-3])
@pytest.mark.parametrize("uplift, levels", [("none", "7.45,7.47"), ("imposed", "6.62,6.65")])
def test_sliding(solve, uplift, levels, hardening):
    """Up to T = mu N + c L: 7.45784 m dry, 6.63399 m with uplift. The last state is written."""
    (result,) = solve("c", levels, uplift=uplift, pena_tang=hardening)
    limit = slide_level(0.35, 1000, uplift == "imposed")
    last = result.history["level"][-1]
    assert limit - 1e-3 < last <= limit * (1 + 1e-9)
    assert statement(result).startswith("sliding") and f"{last:.6g} m" in statement(result)
    assert_allclose(np.unique(result.joint["level"]), [float(levels[:4]), last])
    assert result.history["slip_length"][-1] > 0.95 * BASE


def test_a_run_that_stops_exits_with_1_and_prints_the_level(command):
    words = "--set", "pena_tang=0", "--set", "uplift=none", "--no-fields", "--no-picture"
    code, out, err = command("run", "c", *words, "--levels", "7.4,7.6")
    assert code == 1
    assert "sliding: no equilibrium beyond level 7.45" in out + err


def test_hardening_holds_the_dam_beyond_sliding(solve):
    """All of the joint slips: H (mean slip) L = T - mu N - c L, 1.24492e-7 m at 9 m dry."""
    (result,) = solve("c", uplift="none")
    mean = (thrust(9) - 0.35 * WEIGHT - 1000 * BASE) / (2e11 * BASE)
    assert mean == pytest.approx(1.24492e-7, rel=1e-5)
    rows = result.at()
    slip = np.sum(np.diff(rows["x"]) * (rows["slip"][1:] + rows["slip"][:-1]) / 2) / BASE
    assert slip == pytest.approx(mean, rel=2e-3)
    assert result.history["slip_length"][-1] == pytest.approx(BASE)


@pytest.mark.parametrize("above, slides", [(-1e-4, False), (1e-4, True)])
def test_a_dam_does_not_stand_on_a_default_hardening(solve, above, slides):
    """T = mu N + c L; at a higher level a point at the toe still sticks, as the others harden. The
    verdict was "stands" up to 0.3 % above the critical level.
    """
    dam = {"dam_height": 110, "dam_base": 86.35, "dam_crest": 14.68, "n_joint": 20, "E": 2.15e10}
    dam |= {"nu": 0.199, "E_found": 1.694e10, "uplift": "drained", "drain_x": 8.635}
    joint = {"law": "friction", "K_N": 2.96e11, "K_T": 1.37e11, "mu": 1.01, "adhesion": 272e3}
    level = 170.2174 * (1 + above)
    (result,) = solve("dam", f"55,120,150,{level}", "0", **dam, **joint)
    last, words = result.last, statement(result)
    assert last["slip_length"] < 86 and verdict(result) == ("sliding" if slides else "stands")
    assert (last["T"] > 1.01 * last["N"] + 272e3 * 86.35) == slides
    assert ("the shear force on the joint exceeds its strength from level 170.2" in words) == slides
    assert failed(result) == slides


@pytest.mark.parametrize("level, stands", [(59.37, True), (59.40, False)])
def test_a_dam_of_which_each_point_has_slipped_stands_if_its_strength_is_not_used(
    solve, level, stands
):
    """T = mu N + c L at 59.385 m: from 59.355 m on each point has slipped once, and the verdict
    was "sliding", at 0.9989 of its strength.
    """
    dam = {"dam_height": 46.5, "dam_base": 39.85, "dam_crest": 6.695, "n_joint": 20, "E": 1.81e10}
    joint = {"law": "friction", "K_N": 1.76e11, "K_T": 1.725e11, "mu": 1.12, "adhesion": 0}
    rest = {"uplift": "imposed", "E_found": 1.528e10, "nu": 0.208}
    (result,) = solve("dam", f"23.25,40,50,57,{level}", "0", **dam, **joint, **rest)
    assert (result.last["T"] < 1.12 * result.last["N"]) == stands
    assert result.last["slip_length"] == pytest.approx(39.85)
    assert verdict(result) == ("stands" if stands else "sliding")


def test_overturning(solve):
    """Half the weight, no tension: N leaves the base at (6 W (b - xc)/WATER)^(1/3) = 9.097 m."""
    limit = (6 * WEIGHT / 2 * (BASE - CENTROID) / WATER) ** (1 / 3)
    (result,) = solve("i", "5,10", uplift="none", rho_dam=1200, K_N=1e13, K_T=1e13)
    assert "overturning" in statement(result)
    assert 0.97 * limit < result.history["level"][-1] < limit


@pytest.mark.parametrize("sigma_max", [0, 1.5e5])
@pytest.mark.parametrize("opening", [1e-3, 1e-2])
def test_beyond_the_critical_load_the_rigid_block_is_an_upper_bound(solve, sigma_max, opening):
    """K, heel opened far: W (b - xc) = p H^2/2, 5.02 m of uniform pressure, reached from below."""
    bound = WEIGHT * (BASE - CENTROID) / (WATER * 10**2 / 2)
    assert bound == pytest.approx(5.02, abs=5e-3)
    (result,) = solve(
        "k", "1,2,3,4", sigma_max=sigma_max, drive_begin=3, drive_end=4, drive_by=opening, steps=4
    )
    level = result.history["level"]
    assert np.all(level < bound) and level[-1] > 0.99 * bound
    assert result.heel[-1] - result.heel[11] == pytest.approx(opening, rel=1e-9)


def test_the_published_load_curve_rises_below_the_bound(solve):
    """K as published: beyond 3.34 (the last load of load control) the curve has no snap-back."""
    (result,) = solve("k")
    level, heel = result.history["level"], result.heel
    assert np.all(np.diff(level) > 0) and np.all(np.diff(heel) > 0)
    assert level.max() < 5.02
    assert_allclose(np.diff(heel)[4:9], 4e-6, rtol=1e-9)


@pytest.mark.parametrize("drive", ["heel", "crest"])
def test_displacement_and_level_control_give_the_same_states(solve, drive):
    """A from 8 m on by the heel's opening or the crest's displacement; then by these levels."""
    by = {"heel": 6e-7, "crest": 1e-6}[drive]
    (driven,) = solve(
        "a", steps=5, uplift="imposed", drive=drive, drive_begin=3, drive_end=4, drive_by=by
    )
    found = driven.history["level"][-5:]
    assert found[0] > 8 and np.all(np.diff(found) > 0)
    (controlled,) = solve(
        "a", ",".join(map(repr, [3.0, 6.0, 8.0, *map(float, found)])), uplift="imposed"
    )
    assert_allclose(controlled.heel[-5:], driven.heel[-5:], rtol=1e-5)
    assert_allclose(controlled.history["crest_ux"][-5:], driven.history["crest_ux"][-5:], rtol=1e-5)


def test_version_and_help_exit_with_0():
    for word in ("--version", "--help"):
        with pytest.raises(SystemExit) as stop:
            cli.main([word])
        assert stop.value.code == 0


@pytest.mark.parametrize(
    "settings, levels, message",
    [
        ({"found_side": 20}, "40", "the foundation reaches 20 m: less than 1.5 heights"),
        (
            {"K_N": 1e8, "K_T": 1e8, "G_f": 1000},
            "40",
            "K_N L/E = 0.136: the joint is softer than the dam",
        ),
        (
            {"uplift": "drained", "drain_x": 2.0, "drain_effectiveness": 0.1, "sigma_max": 0.0},
            "40,46",
            "has passed the drains (2 m)",
        ),
        ({"uplift": "drained", "drain_x": 6.1, "sigma_max": 0.0}, "30", ""),
        ({}, "45", "the heel is in tension"),
        ({"law": "friction", "adhesion": 1e4, "mu": 2}, "40,46", "law = bond does not"),
        ({"law": "friction", "adhesion": 1e5, "mu": 1}, "40,50", "% of the overturning moment)"),
        ({}, "30", ""),
    ],
)
def test_hints(solve, settings, levels, message):
    (result,) = solve("dam", levels, n_joint=40, **settings)
    found = "\n".join(hints(result))
    assert message in found if message else not found


@pytest.mark.parametrize("weight_first", [0, 1])
def test_displacement_control_from_an_empty_reservoir(solve, weight_first):
    """The thrust has no slope at level 0; displacements count from the state under weight."""
    settings = {"drive": "heel", "uplift": "none", "weight_first": weight_first}
    (driven,) = solve("ssnp142", "9", **settings)
    (weighed,) = solve("ssnp142", "1e-3", uplift="none", weight_first=1)
    assert not driven.stopped
    assert driven.heel[-1] - weighed.heel[-1] == pytest.approx(1e-6, rel=1e-6)
    (filled,) = solve("ssnp142", f"5,{driven.last['level']:.12g}", uplift="none")
    assert filled.heel[-1] == pytest.approx(driven.heel[-1], rel=1e-6)


@pytest.mark.heavy
@pytest.mark.parametrize(
    "by, settings, nearly", [(-1e-7, {}, 0), (1e-3, {"sigma_max": 1e7, "uplift": "none"}, 20)]
)
def test_displacement_control_stops_at_levels_out_of_range(solve, by, settings, nearly):
    """Below 0, or above twice the dam's height."""
    drive = {"drive": "heel" if by < 0 else "crest", "drive_by": by}
    (result,) = solve("ssnp142", "2,9", steps=8, **drive, **settings)
    assert result.stopped and verdict(result) == "out of range"
    assert result.last["level"] == pytest.approx(nearly, abs=0.7)
    assert 0 <= result.last["level"] <= 20
