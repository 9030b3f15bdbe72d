"""The friction law of pro/law_friction.pro against closed forms (code_aster R7.01.25,
JOINT_MECA_FROT).
"""

import numpy as np
import pytest
from damjoint.engines.getdp import law
from numpy.testing import assert_allclose

K_N, K_T, MU, C = 1e12, 2e12, 0.35, 1000.0
PRESSED = -1e-8  # sigma = -1e4 Pa
YIELD = C + MU * 1e4  # shear strength of the closed joint: 4500 Pa
BASE = {"K_N": K_N, "K_T": K_T, "mu": MU, "adhesion": C, "pena_tang": 0}


def along(jumps, pressure=None, **settings):
    return law.evaluate("friction", np.asarray(jumps, float), pressure, {**BASE, **settings})


def shear(d_t, d_n=PRESSED, **settings):
    """Response along tangent 1 at constant normal jump."""
    return along(np.column_stack([np.full(len(d_t), d_n), d_t, np.zeros(len(d_t))]), **settings)


def closed_form(jumps, hardening):
    """sigma_n, tau_1, tau_2, lambda along a path: implicit return to |tau| = c - mu sigma + H
    lambda.
    """
    slip, total, rows = np.zeros(2), 0.0, []
    for d_n, *d_t in jumps:
        sigma = min(K_N * d_n, C / MU)
        tau = K_T * (np.array(d_t) - slip)
        excess = np.linalg.norm(tau) + MU * sigma - hardening * total - C
        if excess > 0:
            step = excess / (K_T + hardening)
            slip = slip + step * tau / np.linalg.norm(tau)
            total += step
            tau = K_T * (np.array(d_t) - slip)
        rows.append((sigma, *tau, total))
    return np.array(rows)


def test_stress_of_sticking_and_slipping():
    """Elastic up to 4500 Pa at 2.25e-9 m; constant beyond; elastic unloading."""
    answer = shear([1e-9, 2e-9, 3e-9, 5e-9, 4e-9])
    assert_allclose(answer["tau_1"], [2000, 4000, 4500, 4500, 2500], rtol=1e-9)
    assert_allclose(answer["slip_1"], [0, 0, 0.75e-9, 2.75e-9, 2.75e-9], rtol=1e-9, atol=1e-20)
    assert_allclose(answer["sigma_n"], -1e4, rtol=1e-12)


@pytest.mark.parametrize("hardening", [0, 2e11, 2e12])
def test_hardening_slope(hardening):
    """During slip d tau/d delta_t = K_T H/(K_T + H)."""
    d_t = np.array([4e-9, 9e-9])
    tau = shear(d_t, pena_tang=hardening)["tau_1"]
    assert_allclose(
        tau, YIELD + K_T * hardening / (K_T + hardening) * (d_t - YIELD / K_T), rtol=1e-9
    )


def test_dissipation_of_a_cycle():
    """Between +-a without hardening the loop encloses 4 tau_y (a - tau_y/K_T); the cumulated slip
    increases only.
    """
    a = 6e-9
    d_t = a * np.interp(np.arange(101), [0, 20, 60, 100], [0, 1, -1, 1])
    answer = shear(d_t)
    tau, d_t = answer["tau_1"][20:], d_t[20:]
    work = np.sum(0.5 * (tau[1:] + tau[:-1]) * np.diff(d_t))
    assert work == pytest.approx(4 * YIELD * (a - YIELD / K_T), rel=2e-3)
    assert np.all(np.diff(answer["lambda"]) >= 0)
    assert answer["slip_1"][-1] == pytest.approx(a - YIELD / K_T)


def test_slip_is_parallel_to_the_shear_in_3d():
    """Along (3, -4)/5: the return is radial."""
    way = np.array([0.6, -0.8])
    jumps = [(PRESSED, *(d * way)) for d in (1e-9, 5e-9)]
    answer = along(jumps)
    assert_allclose([answer["tau_1"][1], answer["tau_2"][1]], YIELD * way, rtol=1e-9)
    assert_allclose(
        [answer["slip_1"][1], answer["slip_2"][1]], (5e-9 - YIELD / K_T) * way, rtol=1e-9
    )
    assert_allclose(answer["lambda"], [0, 5e-9 - YIELD / K_T], rtol=1e-9, atol=1e-20)


def test_an_open_joint_is_at_the_apex_of_the_cone():
    """sigma never exceeds c/mu; there the shear is 0, and closing restores the contact."""
    tip = C / MU / K_N
    answer = along([(0.5 * tip, 0, 0), (2 * tip, 3e-9, 0), (PRESSED, 3e-9, 0)])
    assert_allclose(answer["sigma_n"], [0.5 * C / MU, C / MU, -1e4], rtol=1e-9)
    assert_allclose(answer["tau_1"], 0, atol=1e-6)
    assert_allclose(answer["open"], [0, 1, 0])


def test_the_shear_strength_increases_with_compression():
    """c - mu sigma of the current normal stress."""
    d_n = np.array([-1e-8, -2e-8, -5e-9, 0])
    answer = along([(d, 1e-6 * (i + 1), 0) for i, d in enumerate(d_n)])
    assert_allclose(answer["tau_1"], C - MU * K_N * d_n, rtol=1e-9)


def test_pressure_changes_the_total_stress_but_not_the_friction():
    """The shear strength depends on the effective stress."""
    d_t = np.column_stack([np.full(3, PRESSED), [1e-9, 3e-9, 5e-9], np.zeros(3)])
    dry, wet = along(d_t), along(d_t, pressure=[5e3] * 3)
    assert_allclose(wet["sigma_n"], dry["sigma_n"] - 5e3, rtol=1e-9)
    assert_allclose(wet["tau_1"], dry["tau_1"], rtol=1e-12)


def test_default_hardening():
    """(K_N + K_T) 1e-6."""
    settings = {k: v for k, v in BASE.items() if k != "pena_tang"}
    jumps = np.array([(PRESSED, 1e-6, 0)])
    answer = law.evaluate("friction", jumps, settings=settings)
    explicit = along(jumps, pena_tang=(K_N + K_T) * 1e-6)
    assert_allclose(answer["tau_1"], explicit["tau_1"], rtol=1e-12)
    assert answer["tau_1"][0] > YIELD


@pytest.mark.parametrize("hardening", [0, 3e6, 2e11])
def test_random_path_against_the_closed_form(hardening):
    """120 steps with slip in both directions, opening and closing."""
    walk = np.cumsum(np.random.default_rng(142).normal(0, 2e-9, (120, 3)), axis=0)
    walk[:, 0] = 1e-8 * np.sin(np.arange(120) / 9)
    answer = along(walk, pena_tang=hardening)
    expected = closed_form(walk, hardening)
    for name, column, scale in zip(
        ("sigma_n", "tau_1", "tau_2", "lambda"), expected.T, (1e4, 1e4, 1e4, 1e-8), strict=True
    ):
        assert_allclose(answer[name], column, rtol=1e-9, atol=1e-9 * scale, err_msg=name)


@pytest.mark.heavy
def test_sawing_takes_off_what_was_open():
    """A saw of 3e-8 m at t = 2, half of it at 1.5. Contact begins where the saw has left off: at
    -3e-8 m where the joint was closed, at -2e-8 m where it was open by 1e-8 m; beyond, the tension
    is K_N times the distance up to c/mu. The shear strength is that of the new normal stress.
    """
    saw = {"saw_thickness": 3e-8, "saw_t": 2.0}
    closed = along([(-1e-8, 0, 0), (-4e-8, 1e-8, 0), (-2.9e-8, 1e-8, 0), (0, 1e-8, 0)], **saw)
    assert_allclose(closed["sigma_n"], [-1e4, -1e4, 1e3, C / MU], rtol=1e-9)
    assert_allclose(closed["tau_1"][1], YIELD, rtol=1e-9)
    assert_allclose(closed["open"], [0, 0, 0, 1])
    opened = along([(1e-8, 0, 0), (-4e-8, 0, 0), (-1.9e-8, 0, 0)], **saw)
    assert_allclose(opened["sigma_n"], [C / MU, -2e4, 1e3], rtol=1e-9)
    assert_allclose(opened["gap"], 1e-8)
    halfway = along([(-4e-8, 0, 0)] * 3, saw_thickness=3e-8, saw_t=2.5)
    assert_allclose(halfway["sigma_n"], -1e4 * np.array([4, 2.5, 1]), rtol=1e-9)
