"""The law endo against its closed forms, and what it refuses."""

import numpy as np
import pytest
from damjoint import InputError
from damjoint.engines.getdp import law
from damjoint.input.resolve import load
from numpy.testing import assert_allclose
from scipy.optimize import brentq
from variants import further

K_N, K_T, F, C, MU, G_F = 1e12, 2e12, 9000.0, 1e4, 1.0, 1.0
BASE = {"K_N": K_N, "K_T": K_T, "sigma_max": F, "adhesion": C, "mu": MU, "G_f": G_F}
#: At the largest strength: alpha, S, -S' (SSNP164), and the moduli
PEAK, S_PEAK, D_PEAK = 0.0618615, 3.3196386, 37.4468437
B_N = D_PEAK * F**2 / (2 * G_F * S_PEAK**2)
B_T = D_PEAK * (C**2 - MU**2 * F**2) / (2 * G_F * S_PEAK**2)


def along(jumps, **settings):
    return law.evaluate("endo", np.asarray(jumps, float), settings=BASE | settings)


def at_apex(opening, tangential=0.0):
    """alpha, sigma_n, tau of an undamaged point after one step, from the scalar equation."""

    def plastic(alpha):
        root, rest = np.sqrt(alpha), (1 - alpha) ** 3
        return (
            K_N * opening * root / (K_N * root + B_N * rest),
            K_T * tangential * root / (K_T * root + B_T * rest),
        )

    def excess(alpha):
        normal, shear = plastic(alpha)
        rate = (B_N * normal**2 + B_T * shear**2) * (2.5 * alpha + 0.5) * (1 - alpha) ** 2
        return rate / (2 * G_F * alpha**1.5) - 1

    alpha = brentq(excess, 1e-15, 1 - 1e-12, xtol=1e-16, rtol=1e-14)
    back = (1 - alpha) ** 3 / np.sqrt(alpha)
    normal, shear = plastic(alpha)
    return alpha, back * B_N * normal, back * B_T * shear


@pytest.mark.parametrize(
    "opening", [1e-8, 1e-5, 1e-3, *(pytest.param(d, marks=pytest.mark.heavy) for d in (1e-6, 1e-4))]
)
@pytest.mark.parametrize("ratio", [0.0, 0.3, 0.9])
def test_one_step_to_the_apex_solves_the_scalar_equation(opening, ratio):
    jump = (opening, 0.6 * ratio * opening, 0.8 * ratio * opening)
    answer = along([jump])
    alpha, normal, shear = at_apex(opening, ratio * opening)
    assert_allclose(answer["alpha"], alpha, rtol=1e-6)
    assert_allclose(answer["sigma_n"], normal, rtol=1e-6)
    assert_allclose(answer["tau_1"], 0.6 * shear, rtol=1e-6, atol=1e-9)
    assert_allclose(answer["tau_2"], 0.8 * shear, rtol=1e-6, atol=1e-9)


def area(x, y):
    return np.sum((y[1:] + y[:-1]) / 2 * np.diff(x))


@pytest.mark.heavy
def test_tension_peaks_at_the_strength_and_its_work_is_the_fracture_energy():
    opening = np.concatenate([[0], np.geomspace(1e-9, 0.3, 1500)])
    answer = along([(d, 0, 0) for d in opening])
    peak = answer["sigma_n"].argmax()
    assert answer["sigma_n"][peak] == pytest.approx(F, rel=1e-5)
    assert answer["alpha"][peak] == pytest.approx(PEAK, rel=0.01)
    assert area(opening, answer["sigma_n"]) == pytest.approx(G_F, rel=2e-3)


@pytest.mark.parametrize("pressure", further(1, [1e4, 0.0, 1e6]))
def test_shear_under_constant_pressure(pressure):
    """Along the closed form, by its plastic slip: the normal stress is constant, the peak of the
    shear c - mu sigma, then it falls to the friction; the work above it is the fracture energy.
    """
    alpha = np.concatenate([np.geomspace(1e-12, PEAK, 500), np.linspace(PEAK, 0.9995, 1500)[1:]])
    modulus = B_T + MU**2 * B_N
    slip = np.sqrt(2 * G_F * alpha**1.5 / ((2.5 * alpha + 0.5) * modulus)) / (1 - alpha)
    tau = MU * pressure + (1 - alpha) ** 3 / np.sqrt(alpha) * modulus * slip
    jumps = np.column_stack([MU * slip - pressure / K_N, slip + tau / K_T, 0 * slip])
    answer = along(jumps)
    room = 1e-7 * (C + pressure)
    assert_allclose(answer["tau_1"], tau, atol=room)
    assert_allclose(answer["sigma_n"], -pressure, atol=room)
    assert_allclose(answer["alpha"], alpha, rtol=1e-5)
    assert_allclose(answer["plastic_n"], MU * answer["plastic_1"], rtol=1e-9)
    assert tau.max() == pytest.approx(C + MU * pressure, rel=1e-6)
    assert area(slip, tau - MU * pressure) == pytest.approx(G_F, rel=2e-3)
    model = load("dam", BASE | {"law": "endo"}).law
    after = alpha > PEAK
    strength = model.shear_strength(np.full(after.sum(), -pressure), alpha[after], 0.0)
    assert_allclose(strength, tau[after], rtol=1e-5)


def test_unloading_is_elastic_and_contact_is_not_damaged():
    answer = along([(1e-4, 0, 0), (5e-5, 0, 0), (-1e-3, 0, 0)])
    assert_allclose(np.diff(answer["sigma_n"]), K_N * np.diff([1e-4, 5e-5, -1e-3]), rtol=1e-9)
    assert_allclose(answer["alpha"], answer["alpha"][0])


@pytest.mark.parametrize(
    "changed, message",
    [
        ({"adhesion": 8999.0}, "adhesion = 8999: must be between mu sigma_max (9000 Pa)"),
        ({"adhesion": 12729.0}, "sqrt(2) mu sigma_max (12727.9 Pa) with law = endo"),
        ({"sigma_max": 0.0, "adhesion": 0.0}, "sigma_max = 0: must be > 0 with law = endo"),
        ({"K_N": 1.05e8}, "G_f = 1: must be > 1 N/m (1.2968 max"),
        ({"K_T": 1.29e8}, "G_f = 1: must be > 1.005 N/m (1.2968 max"),
    ],
)
def test_values_outside_the_law_s_conditions_are_refused(changed, message):
    with pytest.raises(InputError) as error:
        load("dam", BASE | {"law": "endo"} | changed)
    assert message in str(error.value)


def test_the_stiffness_bound_is_where_a_point_snaps_back():
    """sigma(delta) of the apex has a vertical tangent at K_N = 0.7632445 B_n, alpha = 0.2."""
    alpha = np.linspace(0.001, 0.9, 200_001)
    rest, root = (1 - alpha) ** 3, np.sqrt(alpha)
    for factor, snaps in ((1.0001, False), (0.9999, True)):
        stiffness = factor * 0.763244536 * B_N
        # opening at which the scalar equation has the root alpha
        size = np.sqrt(2 * G_F * root / (B_N * (2.5 * alpha + 0.5))) / (1 - alpha)
        opening = size * (stiffness * root + B_N * rest) / stiffness
        assert (np.diff(opening) < 0).any() == snaps
