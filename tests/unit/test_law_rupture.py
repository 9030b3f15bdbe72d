"""The rupture law of pro/law_rupture.pro against its closed form (code_aster R7.01.25,
JOINT_MECA_RUPT).
"""

import numpy as np
import pytest
from damjoint.engines.getdp import law
from numpy.testing import assert_allclose

K_N, K_T, S, P = 1e12, 5e11, 100.0, 0.2
D_E = S / K_N  # end of the elastic branch: 1e-10 m
L_C = (1 + P) * D_E  # broken: 1.2e-10 m
BASE = {"K_N": K_N, "K_T": K_T, "sigma_max": S, "pena_rupture": P, "alpha": 1}


def along(jumps, pressure=None, **settings):
    return law.evaluate("rupture", np.asarray(jumps, float), pressure, {**BASE, **settings})


def normal(openings, **settings):
    return along([(d, 0, 0) for d in openings], **settings)["sigma_n"]


def closed_form(jumps, sigma_max=S, alpha=1.0, pena_contact=1.0):
    """sigma_n, tau_1, tau_2 along a path, row by row."""
    d_e = sigma_max / K_N
    l_c = (1 + P) * d_e
    l_ct = max(
        {0: 0.0, 2: np.inf}.get(alpha, l_c * np.tan(alpha * np.pi / 4)), 1e-13 * 45
    )  # regularisation length under a dam of 45 m
    kappa, free, rows = d_e, np.zeros(2), []
    for d_n, *d_t in jumps:
        peak = sigma_max * (1 + P) / P
        if d_n <= 0:
            s = pena_contact * K_N * d_n
        elif max(kappa, d_n) >= l_c:
            s = 0.0
        else:
            envelope = max(kappa, d_n)
            s = peak * (1 - envelope / l_c) * d_n / envelope
        k_t = K_T if d_n <= 0 else K_T * (0.0 if d_n >= l_ct else 1 - d_n / l_ct)
        rows.append((s, *(k_t * (d_t - free))))
        kappa = max(kappa, d_n)
        free = np.array(d_t) if k_t == 0 else free
    return np.array(rows)


def test_stress_of_a_monotone_opening():
    """100 Pa at 1e-10 m, then linear to zero at 1.2e-10 m."""
    openings = np.array([0.5, 1.0, 1.05, 1.1, 1.15, 1.2, 2.0]) * 1e-10
    assert_allclose(normal(openings), [50, 100, 75, 50, 25, 0, 0], rtol=1e-9, atol=1e-9)


def test_unloading_to_the_origin_and_reloading():
    """From 50 Pa at 1.1e-10 m along the secant, back to the point, then along the softening."""
    openings = np.array([1.1, 0.55, 0.11, 0.55, 1.1, 1.15]) * 1e-10
    assert_allclose(normal(openings), [50, 25, 5, 25, 50, 25], rtol=1e-9)


def test_elastic_branch_is_reversible():
    openings = np.array([0.8, 0.3, 0.9, 0.1]) * D_E
    answer = along([(d, 0, 0) for d in openings])
    assert_allclose(answer["sigma_n"], K_N * openings, rtol=1e-12)
    assert_allclose(answer["damage"], 0)


def test_damage_is_the_share_of_the_softening_branch():
    answer = along([(d * 1e-10, 0, 0) for d in (0.9, 1.05, 1.0, 1.1, 1.3, 0.1)])
    assert_allclose(answer["damage"], [0, 0.25, 0.25, 0.5, 1, 1], rtol=1e-9)
    assert_allclose(answer["kappa"], np.array([1, 1.05, 1.05, 1.1, 1.3, 1.3]) * 1e-10, rtol=1e-12)


def test_a_broken_joint_has_no_tension_but_compression():
    openings = np.array([1.3, 0.5, -2.0, 0.5, 0.0]) * 1e-10
    assert_allclose(normal(openings), [0, 0, -200, 0, 0], atol=1e-9)


@pytest.mark.parametrize("beta", [0.1, 1, 3])
def test_contact_stiffness(beta):
    """sigma = beta K_N delta_n in compression, K_N delta_n in tension, broken or not."""
    openings = np.array([-2.0, 0.5, 1.3, -1.0]) * 1e-10
    assert_allclose(
        normal(openings, pena_contact=beta), [-200 * beta, 50, 0, -100 * beta], rtol=1e-9, atol=1e-9
    )


def test_without_strength_there_is_no_tension():
    openings = [1e-14, 1e-9, -1e-9, 1e-12]
    assert_allclose(normal(openings, sigma_max=0), [0, 0, -1000, 0], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    "alpha, left", [(0, 0), (1, 0.5), (1.5, 1 - 0.5 / np.tan(1.5 * np.pi / 4)), (2, 1)]
)
def test_tangential_stiffness_half_way_to_rupture(alpha, left):
    """K_t = K_T (1 - delta_n/L_CT), L_CT = L_C tan(alpha pi/4): alpha = 0 loses it at once, alpha =
    2 never.
    """
    answer = along([(0, 2e-9, -1e-9), (0.5 * L_C, 2e-9, -1e-9)], alpha=alpha)
    assert_allclose(answer["tau_1"], K_T * 2e-9 * np.array([1, left]), rtol=1e-9, atol=1e-6)
    assert_allclose(answer["tau_2"], K_T * -1e-9 * np.array([1, left]), rtol=1e-9, atol=1e-6)


def test_slip_of_the_open_joint_is_kept_on_closing():
    """Sheared elastically, opened (free slip to 7e-9 m), closed: shear starts again from 7e-9 m."""
    jumps = [
        (-D_E, 1e-9, 0),
        (2 * L_C, 4e-9, 1e-9),
        (2 * L_C, 7e-9, 2e-9),
        (-D_E, 7e-9, 2e-9),
        (-D_E, 9e-9, -1e-9),
    ]
    answer = along(jumps)
    assert_allclose(answer["tau_1"], K_T * np.array([1e-9, 0, 0, 0, 2e-9]), rtol=1e-9, atol=1e-6)
    assert_allclose(answer["tau_2"], K_T * np.array([0, 0, 0, 0, -3e-9]), rtol=1e-9, atol=1e-6)
    assert_allclose(answer["released_1"][-1], 7e-9)


def test_a_partial_shear_release_is_recovered_on_closing():
    """The law is total: below L_CT the shear returns with the contact."""
    answer = along([(0.5 * L_C, 1e-9, 0), (-D_E, 1e-9, 0)])
    assert_allclose(answer["tau_1"], [0.5 * K_T * 1e-9, K_T * 1e-9], rtol=1e-9)


def test_pressure_lowers_the_total_normal_stress_only():
    jumps = [(-1e-9, 1e-9, 0), (0.5e-10, 1e-9, 0), (2e-10, 1e-9, 0)]
    dry, wet = along(jumps), along(jumps, pressure=[1e3, 2e3, 3e3])
    assert_allclose(wet["sigma_n"] - dry["sigma_n"], [-1e3, -2e3, -3e3], rtol=1e-9)
    assert_allclose(wet["tau_1"], dry["tau_1"])


@pytest.mark.parametrize(
    "settings",
    [
        *({"alpha": alpha} for alpha in (0, 0.5, 1, 1.5, 2)),
        {"sigma_max": 0, "alpha": 1},
        {"sigma_max": 1e4, "pena_contact": 2.5},
    ],
)
def test_random_path_against_the_closed_form(settings):
    """120 steps that open, break, close and slide in both directions."""
    scale = max(settings.get("sigma_max", S), 1) / K_N
    walk = np.cumsum(np.random.default_rng(142).normal(0, 0.3, (120, 3)), axis=0) * scale
    walk[:, 0] = 0.7 * scale * np.sin(np.arange(120) / 4) * np.linspace(0.5, 3, 120)
    answer = along(walk, **settings)
    assert_allclose(
        np.column_stack([answer[n] for n in ("sigma_n", "tau_1", "tau_2")]),
        closed_form(walk, **settings),
        rtol=1e-9,
        atol=1e-9 * K_N * scale,
    )


def test_a_grouted_joint_closes_on_the_grout():
    """Open by 1 mm, grouted at 5e4 Pa: contact at the thickness 1 mm + p/K_N, no tension beyond."""
    gap, p = 1e-3, 5e4
    filled = gap + p / K_N
    openings = np.array([gap, gap, filled - 2 * p / K_N, filled + 1e-6, -p / K_N])
    answer = along([(d, 0, 0) for d in openings], grout_pressure=p, grout_t=2)
    assert_allclose(answer["thickness"], [0, *[filled] * 4], rtol=1e-12)
    contact = K_N * (openings[-1] - filled)
    assert_allclose(answer["sigma_n"], [0, -p, -2 * p, 0, contact], rtol=1e-9, atol=1e-3)


@pytest.mark.parametrize("beta", [0.5, 1])
def test_grout_is_a_pressure_until_it_sets(beta):
    """Half the pressure at half the time, at any opening; a point under a higher contact stress
    takes no grout.
    """
    p, stiffness = 5e4, beta * K_N
    settings = {"grout_pressure": p, "grout_t": 2.5, "pena_contact": beta}
    answer = along([(d, 0, 0) for d in (1e-3, 2e-3, 3e-3, 3e-3)], **settings)
    assert_allclose(answer["sigma_n"], [0, -p / 2, -p, -p], rtol=1e-6)
    assert_allclose(answer["thickness"], [0, 2e-3 + p / 2 / stiffness, *[3e-3 + p / stiffness] * 2])
    pressed = along([(-2 * p / stiffness, 0, 0)] * 4, **settings)
    assert_allclose(pressed["sigma_n"], -2 * p, rtol=1e-9)
    assert_allclose(pressed["thickness"], 0)


def test_shear_of_a_grouted_joint_counts_from_its_slip_at_grouting():
    jumps = [(1e-3, 1e-6, 0), (1e-3, 1e-6, 0), (1e-3, 3e-6, -1e-6), (2e-3, 3e-6, 0)]
    answer = along(jumps, grout_pressure=5e4, grout_t=2)
    assert_allclose(answer["tau_1"], K_T * np.array([0, 0, 2e-6, 0]), rtol=1e-9, atol=1e-3)
    assert_allclose(answer["tau_2"], K_T * np.array([0, 0, -1e-6, 0]), rtol=1e-9, atol=1e-3)


def test_a_sawn_joint_has_no_bond_and_closes_later():
    """2e-10 m sawn at t = 2, half at 1.5: contact from there, no tension, less what was open."""
    saw = 2e-10
    openings = np.array([0.5 * D_E, 0.5 * D_E, -0.5 * saw, -1.5 * saw])
    answer = along([(d, 0, 0) for d in openings], saw_thickness=saw, saw_t=2)
    assert_allclose(
        answer["sigma_n"], [50, 0, 0, -(0.5 * saw + 0.5 * D_E) * K_N], rtol=1e-9, atol=1e-9
    )
    assert_allclose(answer["damage"], [0, 1, 1, 1])
    halfway = along([(-1.5 * saw, 0, 0)] * 3, saw_thickness=saw, saw_t=2.5)
    assert_allclose(halfway["sigma_n"], -K_N * saw * np.array([1.5, 1, 0.5]), rtol=1e-9)


def test_stress_of_a_sawn_joint_between_elastic_blocks():
    """Blocks of 10 m in all, compressed by 3e-6 m; sawing 1e-6 m reduces the stress by a third
    (code_aster, SSNP143 C).
    """
    push, saw, beta, young, length = 3e-6, 1e-6, 0.8, 3e12, 10.0
    soft = 1 / (beta * K_N) + length / young
    sigma = -np.array([push, push - saw]) / soft
    jumps = [(-push - s * length / young, 0, 0) for s in sigma]
    settings = {"sigma_max": 3e6, "pena_contact": beta, "saw_thickness": saw, "saw_t": 2}
    assert_allclose(along(jumps, **settings)["sigma_n"], sigma, rtol=1e-9)
