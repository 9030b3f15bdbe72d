"""Turbulent flow in the joint: friction factors of smooth plates, flow in series, derivatives."""

import numpy as np
import pytest
from damjoint import InputError
from damjoint.input.resolve import load
from damjoint.joint import turbulence
from damjoint.joint.flow_in_time import TimeStep
from damjoint.joint.turbulence import CRITICAL, slowed
from damjoint.model.loads import Loading
from damjoint.solver.load_stepper import LoadStepper
from damjoint.solver.model import Model
from damjoint.statics.hints import hints
from scipy.optimize import brentq

WATER, DENSITY, VISC = 9810.0, 1000.0, 1e-3
#: Dam of 28 m on a joint without tension, with a film of water in time.
FILM = {"law": "friction", "adhesion": 0.0, "mu": 1.5, "uplift": "flow", "n_joint": 24.0}
FILM |= {"turbulent": 1.0, "storage": 1e-12, "aperture_min": 1e-4}
COARSE = {"n_joint": 8.0, "order": 1.0}
SOLID = {"dim": 3.0, "thickness": 12.0, "n_layers": 3.0, "mesh_pattern": "split"}


@pytest.fixture(scope="module")
def model():
    return Model(load("dam", FILM, (30.0,)))


def gradient(flux, width):
    """Pressure gradient [Pa/m] of a flux per width [m2/s]: f rho v^2 / (4 w) by f itself."""
    number = 2 * DENSITY * flux / VISC
    factor = max(96 / number, 0.316 * number**-0.25)
    return factor * DENSITY * (flux / width) ** 2 / (4 * width)


def wedge(model, size):
    """A jump that opens the joint by `size` [m] at the heel, by a fifth of it at the toe."""
    system = model.equilibrium.flowing[0]
    xi = system.fields.at_points @ system.fields.xi
    return np.linalg.lstsq(system.flow.opening.toarray(), size * (1 - 0.8 * xi), rcond=None)[0]


def check_derivative(model, jump, part, size, seconds):
    """Compare the derivative of the pressure with differences of this size [m], at a part of a
    jump from which a step of these seconds begins, or in steady flow (None); water is conserved.
    Returns `slowed` of the flow.
    """
    (system,), variables = model.equilibrium.flowing, model.start().variables
    loading, step = Loading(30.0, 0.0), None
    if seconds:
        begin = system.stored_at(jump, variables, loading, 0.0)
        step = TimeStep(seconds=seconds, begin=begin)
    solve = lambda at: system.solve(at, variables, loading, None, step)
    solution = solve(part * jump)
    derivative = system.derivative(part * jump, variables, solution, None, step)
    way = np.random.default_rng(1).normal(size=len(jump)) * size
    above, below = (solve(part * jump + s * way).pressure for s in (1, -1))
    expected = derivative.pressure @ way[derivative.columns]
    assert (above - below) / 2 == pytest.approx(expected, abs=1e-5 * np.abs(expected).max())
    if step:
        stored = solution.stored(1.0, step.begin)
        kept = stored.volume.sum() - stored.inflow.sum()
        assert kept == pytest.approx(step.begin.volume.sum(), rel=1e-11)
    (of_flow,) = solution.systems
    return of_flow.slowed


@pytest.mark.parametrize("size", [1e-4, 2e-3, 1e-2])
def test_steady_flow_in_series(model, size):
    """One flux in all elements, by the friction factor, and drops that add up to the head."""
    (system,), variables = model.equilibrium.flowing, model.start().variables
    jump, loading, flow = wedge(model, size), Loading(30.0, 0.0), system.flow
    (water,) = system.members
    flux = water.pressure(jump, variables, loading).flux / DENSITY
    (steepness,) = system.gradients(system.solve(jump, variables, loading), water)
    lengths, widths = flow.points.weights, 1e-4 + flow.opening @ jump
    assert lengths @ steepness == pytest.approx(-30 * WATER, rel=1e-9)
    of_points = [
        brentq(lambda q, w=w, g=g: gradient(q, w) + g, 1e-12, 1e3, xtol=1e-16, rtol=1e-14)
        for w, g in zip(widths, steepness, strict=True)
    ]
    means = np.bincount(flow.points.elements, lengths * of_points) / flow.lengths
    assert means == pytest.approx(np.full(len(means), flux.mean()), rel=1e-8)
    assert flux == pytest.approx(means, rel=1e-8)
    assert (2 * DENSITY * flux.mean() / VISC > CRITICAL) == (size > 5e-3)


@pytest.mark.parametrize("seconds", [1e-3, 0.1, None])
def test_the_derivative_is_that_of_finite_differences(model, seconds):
    """Of the film that a crack squeezes as it closes, with voids, and of steady flow."""
    jump = wedge(model, 2e-3 if seconds else 1e-2)
    slowed = check_derivative(model, jump, 0.99, 1e-10, seconds)
    assert slowed.min() < 0.57  # in part turbulent


def test_newton_finds_the_flow_of_the_secants(model, monkeypatch):
    """Of a film that closes, is squeezed out and has voids where it opens; in fewer solutions."""
    (system,), variables = model.equilibrium.flowing, model.start().variables
    loading, closes = Loading(30.0, 0.0), wedge(model, 5e-3)
    numbers = []
    for jump in 0.99 * closes, closes + wedge(model, 2e-3):
        begin = system.stored_at(closes, variables, loading, 0.0)
        step = TimeStep(seconds=5e-3, begin=begin)
        found = []
        for solve in turbulence.by_newton, lambda *given: None:
            calls = []
            counted = lambda *given, calls=calls: calls.append(given) or slowed(*given)
            system.last_solution = None
            system.last_slowed.clear()
            with monkeypatch.context() as patch:
                patch.setattr(turbulence, "by_newton", solve)
                patch.setattr(turbulence, "slowed", counted)
                found.append((system.solve(jump, variables, loading, None, step), len(calls)))
        (newton, few), (secants, many) = found
        scale = np.abs(secants.pressure).max()
        assert newton.pressure == pytest.approx(secants.pressure, abs=1e-9 * scale)
        assert newton.systems[0].slowed.min() < 0.57
        numbers.append((few, many))
    few, many = np.sum(numbers, axis=0)
    assert few < many


def test_it_resists_more():
    """Under a flood: less leaks, the Reynolds number is smaller, and nothing is noted."""
    settings = FILM | {"time_unit": 600.0, "aperture_min": 2e-3}
    laminar, turbulent = (
        LoadStepper(load("dam", settings | {"turbulent": t}, (30.0, 44.0), None, 5)).run()
        for t in (0.0, 1.0)
    )
    assert turbulent.history["Re"][-1] < 0.5 * laminar.history["Re"][-1]
    said = [any("Reynolds" in hint for hint in hints(run)) for run in (laminar, turbulent)]
    assert said == [True, False]


@pytest.fixture(scope="module")
def solid():
    return Model(load("dam", FILM | COARSE | SOLID, (30.0,)))


@pytest.mark.parametrize("width", [3e-3, 1e-4])
def test_uniform_flow_in_three_dimensions(solid, width):
    """Between two heads along a joint of constant aperture: the flux is that of the friction
    factor, at Re = 1.2e4 and, laminar, at 1.7.
    """
    (system,), variables = solid.equilibrium.flowing, solid.start().variables
    (water,) = system.members
    loading = Loading(30.0, 0.0)
    opened = np.full(len(system.flow.points.weights), width - 1e-4)
    jump = np.linalg.lstsq(system.flow.opening.toarray(), opened, rcond=None)[0]
    pressure = water.pressure(jump, variables, loading)
    along = 30 * WATER / 34
    flux = brentq(lambda q: gradient(q, width) - along, 1e-12, 1e3, xtol=1e-18, rtol=1e-14)
    assert pressure.flux == pytest.approx(np.full(len(pressure.flux), DENSITY * flux), rel=1e-8)
    assert pressure.leakage == pytest.approx(DENSITY * flux, rel=1e-8)
    assert (1e4 < 2 * DENSITY * flux / VISC < 1.5e4) == (width == 3e-3)


@pytest.mark.parametrize("seconds", [0.1, None])
def test_the_tangent_in_three_dimensions(solid, seconds):
    """Flow across the joint, too: a change across the flow has another conductivity than along."""
    (system,) = solid.equilibrium.flowing
    x, _, z = system.flow.points.positions.T
    size = 8e-3 * (1.3 + np.sin(0.2 * x) * np.cos(z))
    jump = np.linalg.lstsq(system.flow.opening.toarray(), size, rcond=None)[0]
    slowed = check_derivative(solid, jump, 0.999, 1e-7, seconds)
    assert slowed.max() < 0.57


@pytest.mark.heavy
def test_a_slice_has_the_flow_of_the_section():
    """Of a wedge, turbulent and laminar: the quadratures of triangles and lines differ, the less
    the finer both meshes are, in z, too.
    """
    loading = Loading(30.0, 0.0)
    for size, order in (1e-2, 1.2), (1e-4, 1.8):
        errors = []
        for n in 8.0, 16.0:
            found, mesh = [], COARSE | {"n_joint": n, "h_dam": 8.0, "h_found": 40.0}
            for dim in {}, SOLID | {"n_layers": 3 * n / 8}:
                of = Model(load("dam", FILM | mesh | dim, (30.0,)))
                (system,), variables = of.equilibrium.flowing, of.start().variables
                jump = wedge(of, size)
                beyond = system.expand_to_nodes(system.solve(jump, variables, loading))
                leakage = system.members[0].pressure(jump, variables, loading).leakage
                found.append((system.fields.joint.surface.points[:, 0], beyond, leakage))
            (x, of_section, out), (at, of_slice, out_of_slice) = found
            along = np.argsort(x)
            expected = np.interp(at, x[along], of_section[along])
            error = np.abs(of_slice - expected).max() / np.abs(expected).max()
            errors.append([error, abs(out_of_slice / out - 1)])
        (coarse, coarse_out), (fine, fine_out) = errors
        assert coarse < 1e-2 and np.log2(coarse / fine) > order
        assert coarse_out < 1e-4 and np.log2(coarse_out / fine_out) > 2


def test_getdp_refuses_it(refused):
    words = "run", "dam", "--engine", "getdp", "--set", "uplift=flow", "--set", "turbulent=1"
    assert "turbulent = 1: must be 0 with engine = getdp" in refused(*words)


def test_closing_stress_narrows_the_joint():
    """w = aperture_min + max(0, w_0 + delta_n): its cubic flow, and its derivative."""
    settings = FILM | {"turbulent": 0.0, "aperture_min": 1e-6, "aperture_elastic": 2e-5}
    model = Model(load("dam", settings, (30.0,)))
    (system,), variables = model.equilibrium.flowing, model.start().variables
    (water,) = system.members
    jump, loading = wedge(model, -2.5e-5), Loading(30.0, 0.0)
    widths = 1e-6 + np.maximum(2e-5 + system.flow.opening @ jump, 0)
    assert widths.min() == 1e-6 and widths.max() > 1.4e-5  # closed at the heel
    of_points = system.flow.points.weights * widths**3 / (12 * VISC)
    means = np.bincount(system.flow.points.elements, of_points) / system.flow.lengths
    flux = DENSITY * 30 * WATER / (system.flow.lengths / means).sum()
    assert water.pressure(jump, variables, loading).flux == pytest.approx(flux, rel=1e-9)
    solution = system.solve(jump, variables, loading)
    derivative = system.derivative(jump, variables, solution, None)
    way = np.random.default_rng(1).normal(size=len(jump)) * 1e-12
    above, below = (system.solve(jump + s * way, variables, loading).pressure for s in (1, -1))
    expected = derivative.pressure @ way[derivative.columns]
    assert (above - below) / 2 == pytest.approx(expected, abs=1e-5 * np.abs(expected).max())


def test_a_storage_that_cannot_be():
    with pytest.raises(InputError, match="storage = 1: must be at most"):
        load("dam", FILM | {"storage": 1.0})
