"""The bond law of pro/law_bond.pro against its closed form."""

import numpy as np
import pytest
from damjoint import InputError
from damjoint.engines.getdp import law
from damjoint.input.resolve import load
from numpy.testing import assert_allclose

K_N, K_T, F, C, MU = 1e11, 5e10, 2e5, 3e5, 0.7
G_F, G_T = 100.0, 400.0
BASE = {"K_N": K_N, "K_T": K_T, "sigma_max": F, "adhesion": C, "mu": MU, "G_f": G_F, "G_t": G_T}
D_E, D_C = F / K_N, 2 * G_F / F  # 2e-6 m, 1e-3 m
LAMBDA_C = 2 * G_T / C


def along(jumps, **settings):
    return law.evaluate("bond", np.asarray(jumps, float), settings={**BASE, **settings})


def area(x, y):
    return np.sum((y[1:] + y[:-1]) / 2 * np.diff(x))


def test_stress_of_a_monotone_opening():
    """Elastic up to the strength, linear to zero at delta_c, zero beyond."""
    half = (D_E + D_C) / 2
    answer = along([(d, 0, 0) for d in (D_E / 2, D_E, half, D_C, 2 * D_C)])
    assert_allclose(answer["sigma_n"], [F / 2, F, F / 2, 0, 0], rtol=1e-9, atol=1e-6 * F)
    assert_allclose(answer["D"], [0, 0, 0.5, 1, 1], rtol=1e-9, atol=1e-12)


def test_the_work_of_opening_is_the_fracture_energy():
    opening = np.unique(np.r_[np.linspace(0, D_E, 3), np.linspace(D_E, D_C, 200)])
    assert area(opening, along([(d, 0, 0) for d in opening])["sigma_n"]) == pytest.approx(G_F)


def test_unloading_goes_to_the_origin():
    half = (D_E + D_C) / 2
    answer = along([(d, 0, 0) for d in (half, half / 2, half / 100, half / 2, half)])
    assert_allclose(answer["sigma_n"], F / 2 * np.array([1, 0.5, 0.01, 0.5, 1]), rtol=1e-9)
    assert_allclose(answer["D"], 0.5, rtol=1e-9)


@pytest.mark.parametrize("pressure", [0, 5e5])
def test_shear_under_constant_pressure(pressure):
    """Peak c - mu sigma, residual -mu sigma; the area above the residual over the slip is G_t."""
    residual = MU * pressure
    shift = np.r_[0, np.linspace((C + residual) / K_T, 1.2 * LAMBDA_C, 400)]
    answer = along([(-pressure / K_N, d, 0) for d in shift])
    assert_allclose(answer["tau_1"].max(), C + residual, rtol=1e-9)
    assert_allclose(answer["tau_1"][-1], residual, rtol=1e-9, atol=1e-6 * C)
    above = area(answer["slip_1"], answer["tau_1"] - residual)
    assert above == pytest.approx(G_T, rel=1e-3)  # the last interval, with the kink, by a trapezoid
    assert_allclose(answer["D"][-1], 1)


def test_neither_tension_nor_cohesion_recovers():
    """Opened beyond delta_c, then closed and sheared: friction only; opened again: no stress."""
    sigma = -4e5
    answer = along([(1.1 * D_C, 0, 0), (sigma / K_N, 1e-3, 0), (D_E, 1e-3, 0)])
    assert_allclose(answer["tau_1"], [0, -MU * sigma, 0], rtol=1e-9, atol=1e-3)
    assert_allclose(answer["sigma_n"], [0, sigma, 0], rtol=1e-9, atol=1e-3)


def test_damage_by_slip_reduces_the_tensile_strength():
    """Damage 1/4 by slip leaves 3/4 of the strength."""
    slip = 0.25 * LAMBDA_C
    answer = along([(0, slip + 0.75 * C / K_T, 0), (D_E + 0.25 * (D_C - D_E), slip, 0)])
    assert_allclose(answer["D"], 0.25, rtol=1e-9)
    assert_allclose([answer["tau_1"][0], answer["sigma_n"][1]], [0.75 * C, 0.75 * F], rtol=1e-9)


@pytest.mark.parametrize("steps", [1, 4, 16, 64])
def test_damage_is_the_maximum_of_those_by_opening_and_slip(steps):
    """Opened by delta_c/2 while it slips by lambda_c/4, in any number of steps: damage 1/2, not
    3/4; and the other way round.
    """
    ramp = np.linspace(0, 1, steps + 1)[1:, None]
    opened = along(ramp * [D_E + (D_C - D_E) / 2, 0.25 * LAMBDA_C + C / 2 / K_T, 0])
    assert_allclose(opened["D"][-1], 0.5, rtol=1e-4)
    slid = along(ramp * [D_E + (D_C - D_E) / 4, LAMBDA_C / 2 + C / 2 / K_T, 0])
    assert_allclose(slid["D"][-1], 0.5, rtol=5e-3)


def test_slip_is_parallel_to_the_shear_in_3d():
    way = np.array([0.6, -0.8])
    answer = along([(-1e-6, *(1e-3 * way))])
    plane = along([(-1e-6, 1e-3, 0)])
    assert_allclose([answer["tau_1"][0], answer["tau_2"][0]], plane["tau_1"][0] * way, rtol=1e-9)


def test_without_strength_the_law_is_coulomb_friction():
    answer = along([(-1e-6, 1e-3, 0), (1e-9, 1e-3, 0)], sigma_max=0, adhesion=0)
    assert_allclose(answer["tau_1"], [MU * K_N * 1e-6, 0], rtol=1e-9, atol=1e-3)
    assert_allclose(answer["sigma_n"], [-K_N * 1e-6, 0], rtol=1e-9, atol=1e-3)


@pytest.mark.parametrize(
    "settings, message",
    [
        ({"law": "bond", "G_f": 0.1}, "G_f = 0.1: must be > 0.2"),
        ({"law": "bond", "G_t": 0.1}, "G_t = 0.1: must be > 0.4"),
        ({"law": "rupture", "G_f": 0.1}, "G_f = 0.1: must be > 0.2"),
        ({"law": "rupture", "G_f": 50.0, "pena_rupture": 3.0}, "one of them, the other -1"),
    ],
)
def test_impossible_fracture_energies_are_refused(settings, message):
    """Less than the elastic energy at the peak, or set twice."""
    with pytest.raises(InputError, match=message):
        load("dam", settings)


def test_fracture_energy_of_the_rupture_law():
    """From pena_rupture, or the other way round: sigma_max^2 (1 + P)/(2 K_N)."""
    assert load("dam", {"law": "rupture", "G_f": 50.0})["pena_rupture"] == pytest.approx(249)
    assert load("dam", {"law": "rupture", "pena_rupture": 249.0})["G_f"] == pytest.approx(50)
    assert load("a")["G_f"] == pytest.approx(100**2 * 1.2 / 2e12)
    assert load("dam", {"sigma_max": 0.0})["G_f"] == 100


@pytest.mark.parametrize("law_name", ["bond", "friction"])
def test_a_point_that_has_slipped_sticks_at_first(law_name):
    """On the yield surface up to rounding: no slip, and the elastic tangent."""
    case = load("dam", BASE | {"law": law_name})
    slipped = np.column_stack([np.full(50, -3e-6), np.linspace(2e-5, 2e-3, 50), np.zeros(50)])
    point = case.law.update_internal_variables(slipped, case.law.initial(50))
    assert (case.law.slip(point, 50) > 0).all()
    for jump in slipped * (1 + np.array([-1, 0, 1, 2, 5]) * 1e-16)[:, None, None]:
        again = case.law.update_internal_variables(jump, point)
        assert np.array_equal(again.plastic, point.plastic)
        _, tangent = case.law.traction_and_tangent(jump, point)
        assert_allclose(tangent, np.diag([K_N, K_T, K_T])[None].repeat(50, 0), rtol=1e-7)
