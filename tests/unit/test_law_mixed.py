"""Law mixed: the published CZM_EXP_REG in any mode, its energy, both engines."""

import numpy as np
import pytest
from damjoint.engines.getdp import law
from damjoint.input.resolve import load
from damjoint.laws.mixed import MixedVariables
from numpy.testing import assert_allclose

#: As published: critical stress [Pa], energy [N/m], regularisation [-]
SIGMA_C, G, A = 1e6, 250.0, 1e-3
LENGTH = G / SIGMA_C
STRENGTH = SIGMA_C * np.exp(-A)
K_N = STRENGTH / (A * LENGTH)
CZM = {"law": "mixed", "softening": "exponential", "sigma_max": STRENGTH, "K_N": K_N, "K_T": K_N}
CZM |= {"G_f": STRENGTH * LENGTH * (1 + A / 2)}


def along(jumps, **settings):
    """Tractions (n, 3) of the Python law along a path, a step for each row."""
    model = load("dam", CZM | settings).law
    variables, rows = model.initial(1), []
    for jump in np.asarray(jumps, float)[:, None]:
        rows.append(model.traction_and_tangent(jump, variables)[0][0])
        variables = model.update_internal_variables(jump, variables)
    return np.array(rows)


def test_czm_exp_reg_in_mixed_mode():
    """sigma_c exp(-kappa/l) jump/kappa of the largest equivalent jump from a l on, l = G/sigma_c;
    contact of the undamaged stiffness (b = 1), and under it shear without friction; both engines.
    """
    jumps = np.random.default_rng(3).normal(size=(40, 3)) * LENGTH
    jumps[:5] *= A / 10  # elastic
    equivalent = np.sqrt(np.maximum(jumps[:, 0], 0) ** 2 + (jumps[:, 1:] ** 2).sum(axis=1))
    kappa = np.maximum(np.maximum.accumulate(equivalent), A * LENGTH)
    expected = (SIGMA_C * np.exp(-kappa / LENGTH) / kappa)[:, None] * jumps
    pressed = jumps[:, 0] < 0
    expected[pressed, 0] = K_N * jumps[pressed, 0]
    scale = np.abs(expected).max(axis=0)
    assert_allclose(along(jumps) / scale, expected / scale, rtol=1e-12, atol=1e-14)
    getdp = law.evaluate("mixed", jumps, settings=CZM)
    found = np.column_stack([getdp[n] for n in ("sigma_n", "tau_1", "tau_2")])
    assert_allclose(found / scale, expected / scale, rtol=1e-12, atol=1e-14)
    wanted = -np.expm1(-(kappa / LENGTH - A))
    assert_allclose(getdp["damage"], wanted, atol=1e-12)


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 1, 0), (0.6, 0, -0.8), (1, 1, 1)])
def test_the_energy_lost_is_the_published_one_in_every_direction(direction):
    """Between kappa_0 = a l and kappa the published code counts G (1 - exp(-kappa/l)) less the
    stored sigma_c kappa exp(-kappa/l) / 2.
    """
    direction = np.array(direction, float) / np.linalg.norm(direction)
    size = A * LENGTH + np.linspace(0, 3 * LENGTH, 4001)
    jumps = np.vstack([size[:, None] * direction, 0 * direction])  # and unloaded
    tractions = along(jumps)
    work = np.sum((tractions[1:] + tractions[:-1]) / 2 * np.diff(jumps, axis=0))
    stored = STRENGTH * A * LENGTH / 2  # of the way to kappa_0
    lost = lambda k: G * -np.expm1(-k / LENGTH) - SIGMA_C * k * np.exp(-k / LENGTH) / 2
    # 1e-6: the trapezoidal rule
    assert work + stored == pytest.approx(lost(size[-1]) - lost(size[0]), rel=1e-6)


@pytest.mark.parametrize("curve", ["linear", "exponential"])
def test_shear_has_the_energy_of_tension_and_the_strength_by_the_stiffnesses(curve):
    """With K_T = 4 K_N the strength in shear is twice that in tension; pressed or not."""
    size = np.r_[0, np.linspace(A * LENGTH, 40 * LENGTH, 40001)] / 2
    for normal in (0.0, -0.1 * LENGTH):
        jumps = np.column_stack([normal + 0 * size, size, 0 * size])
        model = load("dam", CZM | {"softening": curve, "K_T": 4 * K_N}).law
        undamaged = model.initial(len(jumps))
        tau = model.traction_and_tangent(jumps, undamaged)[0][:, 1]
        assert tau.max() == pytest.approx(2 * STRENGTH, rel=1e-12)
        assert np.sum((tau[1:] + tau[:-1]) / 2 * np.diff(size)) == pytest.approx(
            CZM["G_f"],
            rel=1e-5,  # the trapezoidal rule
        )


def test_without_strength_there_is_contact_only():
    jumps = LENGTH * np.array([[1e-3, 1e-3, 0], [-1e-3, 1e-3, 0]])
    for values in (along(jumps, sigma_max=0.0), by_getdp(jumps)):
        assert_allclose(values, [[0, 0, 0], [-1e-3 * LENGTH * K_N, 0, 0]], rtol=1e-12)


def by_getdp(jumps):
    """Tractions (n, 3) of the GetDP law without strength."""
    values = law.evaluate("mixed", jumps, settings=CZM | {"sigma_max": 0.0})
    return np.column_stack([values[n] for n in ("sigma_n", "tau_1", "tau_2")])


@pytest.mark.parametrize("softening", ["linear", "exponential"])
@pytest.mark.parametrize("ratio", [0.3, 4.0])
def test_the_tangent_where_shear_is_not_as_stiff_as_tension(softening, ratio):
    """K_T = ratio K_N, central differences: tension or contact with shear, in both directions, that
    softens, unloads or is broken.
    """
    settings = CZM | {"K_T": ratio * K_N, "softening": softening, "pena_contact": 0.5}
    model = load("dam", settings).law
    length, rng = LENGTH, np.random.default_rng(40)
    jumps = length * rng.normal(size=(2000, 3)) * [1, ratio**-0.5, ratio**-0.5]
    kappa = np.maximum(length * rng.uniform(0, 2, 2000), model.delta_e)
    variables, step = MixedVariables(kappa), 1e-6 * length
    _, tangent = model.traction_and_tangent(jumps, variables)
    kink = np.abs(model.equivalent(jumps) - kappa) < 3 * step
    kink |= np.abs(model.equivalent(jumps) - model.L_C) < 3 * step
    kink |= np.abs(jumps[:, 0]) < 3 * step
    assert kink.mean() < 0.01
    for component, shift in enumerate(step * np.eye(3)):
        ends = [model.traction_and_tangent(jumps + s, variables)[0] for s in (shift, -shift)]
        slope = (ends[0] - ends[1]) / (2 * step)
        within = 2 * model.artificial * max(1, ratio) * K_N  # [Pa/m]
        assert_allclose(tangent[~kink, :, component], slope[~kink], rtol=1e-6, atol=within)
