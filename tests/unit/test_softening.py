"""The softening curves of bond and rupture: the same strengths and energies, by closed forms."""

import numpy as np
import pytest
from damjoint import InputError
from damjoint.engines.getdp import law
from damjoint.input.resolve import load
from numpy.testing import assert_allclose
from variants import further

K_N, K_T, F, C, MU = 1e11, 5e10, 2e5, 3e5, 0.7
G_F, G_T = 100.0, 400.0
BASE = {"K_N": K_N, "K_T": K_T, "sigma_max": F, "adhesion": C, "mu": MU, "G_f": G_F, "G_t": G_T}
D_E, D_C, LAMBDA_C = F / K_N, 2 * G_F / F, 2 * G_T / C
CURVES = {"linear": lambda xi: np.clip(1 - xi, 0, 1), "exponential": lambda xi: np.exp(-2 * xi)}
#: Progress beyond which less than 1e-12 of a strength is left, and of the energy
FAR = 15.0


def along(jumps, **settings):
    """Tractions (n, 3) and damage (n,) of the Python law along a path, a step for each row."""
    model = load("dam", BASE | settings).law
    variables, rows = model.initial(1), []
    for jump in np.asarray(jumps, float)[:, None]:
        traction = model.traction_and_tangent(jump, variables)[0][0]
        variables = model.update_internal_variables(jump, variables)
        rows.append((*traction, model.damage(jump, variables)[0]))
    rows = np.array(rows)
    return rows[:, :3], rows[:, 3]


def work(jumps, tractions):
    """The work of all tractions on their jumps [N/m], by the trapezoidal rule."""
    return float(np.sum((tractions[1:] + tractions[:-1]) / 2 * np.diff(jumps, axis=0)))


@pytest.mark.parametrize("law_name", ["bond", "rupture"])
def test_pure_opening_is_czm_exp_reg(law_name):
    """sigma_c exp(-kappa/l) delta/kappa of the largest opening kappa from a l on, l = G/sigma_c;
    unloading to the origin and contact of the undamaged stiffness (b = 1), in both engines.
    """
    sigma_c, G, a = 1e6, 250.0, 1e-3
    length = G / sigma_c
    strength = sigma_c * np.exp(-a)
    settings = {"softening": "exponential", "sigma_max": strength, "K_N": strength / (a * length)}
    settings |= {"G_f": strength * length * (1 + a / 2), "alpha": 2.0, "adhesion": 0.0}
    opening = length * np.array([a / 2, 0.3, 1.0, 0.5, -1e-4, 0.2, 1.5, 4.0, 2.0, 7.0, 0.1])
    kappa = np.maximum(np.maximum.accumulate(opening), a * length)
    expected = sigma_c * np.exp(-kappa / length) / kappa * opening
    expected[opening < 0] = (settings["K_N"] * opening)[opening < 0]
    jumps = np.column_stack([opening, 0 * opening, 0 * opening])
    assert_allclose(along(jumps, law=law_name, **settings)[0][:, 0], expected, rtol=1e-12)
    getdp = law.evaluate(law_name, jumps, settings=BASE | settings)
    assert_allclose(getdp["sigma_n"], expected, rtol=1e-12)


@pytest.mark.heavy
@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("law_name", ["bond", "rupture"])
def test_opening_has_the_strength_the_curve_and_the_energy(law_name, curve):
    xi = np.r_[np.linspace(0, 1, 2001), np.linspace(1, FAR, 4001)[1:]]
    opening = np.r_[0, D_E + xi * (D_C - D_E)]
    jumps = np.column_stack([opening, 0 * opening, 0 * opening])
    traction, damage = along(jumps, law=law_name, softening=curve)
    left = CURVES[curve](xi)
    assert_allclose(traction[1:, 0], F * left, rtol=1e-9, atol=1e-9 * F)
    assert_allclose(damage[1:], 1 - left, atol=1e-12)
    assert work(jumps, traction) == pytest.approx(G_F, rel=1e-5)  # of the trapezoidal rule


@pytest.mark.parametrize("curve", further(1, CURVES))
@pytest.mark.parametrize("pressure", further(1, [5e5, 0.0]))
def test_sliding_has_the_strength_the_curve_and_the_energy(curve, pressure):
    """The area above the residual friction over the slip is G_t, elastic part included."""
    xi = np.r_[np.linspace(0, 1, 2001), np.linspace(1, FAR, 4001)[1:]]
    stress = C * CURVES[curve](xi) + MU * pressure
    jumps = np.column_stack([0 * xi - pressure / K_N, xi * LAMBDA_C + stress / K_T, 0 * xi])
    traction, damage = along(jumps, softening=curve)
    assert_allclose(traction[:, 1], stress, rtol=1e-9, atol=1e-9 * C)
    assert_allclose(damage, 1 - CURVES[curve](xi), atol=1e-9)
    plastic = jumps[:, 1:2] - traction[:, 1:2] / K_T
    above = work(plastic, traction[:, 1:2] - MU * pressure)
    assert above == pytest.approx(G_T, rel=1e-5)  # of the trapezoidal rule


@pytest.mark.heavy
@pytest.mark.parametrize("curve", CURVES)
def test_both_modes_together_dissipate_both_energies(curve):
    """Where opening and slip do the same damage; where one of them does less, its strength is lost
    with the other's, after less slip: the work is G_f and G_t times the integral of what is left.
    """
    xi = np.r_[np.linspace(0, 1, 2001), np.linspace(1, FAR, 4001)[1:]]
    left = CURVES[curve](xi)
    for part in (1.0, 0.25):
        jumps = np.column_stack(
            [D_E + xi * (D_C - D_E), part * xi * LAMBDA_C + C * left / K_T, 0 * xi]
        )
        traction, damage = along(jumps, softening=curve)
        assert_allclose(damage, 1 - left, atol=1e-9)
        assert_allclose(traction[:, :2], np.outer(left, (F, C)), rtol=1e-7, atol=1e-9 * C)
        start = np.zeros((1, 3))
        total = work(np.vstack([start, jumps]), np.vstack([start, traction]))
        assert total == pytest.approx(G_F + part * G_T, rel=1e-5)  # of the trapezoidal rule


@pytest.mark.parametrize("way", [(1.0, 0.3, 0.0), (0.3, 0.7, 0.7), (-0.01, 1.0, 0.0)])
def test_exponential_softening_does_not_depend_on_the_steps(way):
    """Opening governs, slip governs, slip under pressure: 1 to 64 steps along a straight path."""
    end = np.array(way) * [D_C, LAMBDA_C, LAMBDA_C]
    found = [
        along(np.linspace(0, 1, steps + 1)[1:, None] * end, softening="exponential")
        for steps in (1, 8, 64)
    ]
    assert 0.3 < found[0][1][-1] < 1
    for traction, damage in found[1:]:
        # an elastic part of the jump that softens slips later: D_E/D_C, C/(K_T LAMBDA_C) of a step
        assert damage[-1] == pytest.approx(found[0][1][-1], rel=5e-3)
        assert_allclose(traction[-1], found[0][0][-1], rtol=2e-2, atol=1e-3 * C)


@pytest.mark.parametrize("G_t", [1.0001, 1.01, 10, 1e4])
def test_slip_of_exponential_softening_returns_to_the_yield_surface(G_t):
    """Also close to the least energy, at which the root of the return is double; any excess."""
    G_t *= C**2 / K_T
    model = load("dam", BASE | {"softening": "exponential", "G_t": G_t}).law
    shear = C / K_T * (1 + 10.0 ** np.linspace(-9, 4, 200))
    jump = np.column_stack([0 * shear, shear, 0 * shear])
    variables = model.update_internal_variables(jump, model.initial(200))
    traction = model.traction_and_tangent(jump, model.initial(200))[0]
    left = np.exp(-2 * variables.plastic[:, 0] * C / (2 * G_t))
    assert_allclose(traction[:, 1], C * left, rtol=1e-9, atol=1e-9 * C)
    assert (np.diff(variables.plastic[:, 0]) >= 0).all()


def test_the_least_energy_in_shear_follows_the_steepest_slope():
    """Twice that of linear softening: c^2/K_T = 1.8 N/m."""
    assert load("dam", BASE | {"G_t": 1.7})["G_t"] == 1.7
    with pytest.raises(InputError, match=r"G_t = 1.7: must be > 1.8 N/m \(adhesion\^2/K_T"):
        load("dam", BASE | {"G_t": 1.7, "softening": "exponential"})
    with pytest.raises(InputError, match="softening = cubic: must be one of linear, exponential"):
        load("dam", BASE | {"softening": "cubic"})
