"""Time integration of an earthquake: closed forms, balance of momentum, order, both signs."""

from dataclasses import replace

import numpy as np
import pytest
from damjoint.dynamics.scheme import Motion
from damjoint.dynamics.step import TimeStep
from damjoint.fem.bodies import Bodies
from damjoint.solver.history import joint_row
from quakes import BLOCK, DAM, earthquake, joint_of, mean_slip, smooth_record, write_record
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

G = 9.81


def run(quake):
    """All steps."""
    return list(quake.steps())


# -- closed forms


def rectangle_slip(peak, mu, duration):
    """Slip of a rigid block under a rectangle of acceleration (Newmark 1965)."""
    return (peak - mu * G) * peak * duration**2 / (2 * mu * G)


def half_sine_slip(peak, mu, duration):
    """Slip of a rigid block under a half sine that ends while it slides."""
    omega = np.pi / duration
    start = np.arcsin(mu * G / peak) / omega
    rest = duration - start
    velocity = peak / omega * (np.cos(omega * start) + 1) - mu * G * rest
    way = peak / omega * (np.cos(omega * start) * rest + np.sin(omega * start) / omega)
    return way - mu * G * rest**2 / 2 + velocity**2 / (2 * mu * G)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("dt, error", [(0.01, 1e-3), (0.0025, 1e-4)])
def test_a_block_under_a_rectangle_of_acceleration(tmp_path, dt, error, sign):
    """The ground moves downstream: the block is left behind, upstream."""
    times, values = [0, dt, 0.2, 0.2 + dt], [0, 8 * sign, 8 * sign, 0]
    quake = earthquake(write_record(tmp_path / "r.csv", times, values), BLOCK | {"dt": dt})
    run(quake)
    assert rectangle_slip(8, 0.5, 0.2) == pytest.approx(0.10095821, rel=1e-6)
    assert mean_slip(quake) == pytest.approx(-sign * rectangle_slip(8, 0.5, 0.2), rel=error)


def test_a_block_under_a_half_sine(tmp_path):
    times = np.arange(0, 0.3025, 0.0025)
    values = np.maximum(8 * np.sin(np.pi * times / 0.3), 0)
    quake = earthquake(write_record(tmp_path / "r.csv", times, values), BLOCK | {"dt": 0.0025})
    run(quake)
    assert half_sine_slip(8, 0.5, 0.3) == pytest.approx(0.054306889, rel=1e-6)
    assert mean_slip(quake) == pytest.approx(-half_sine_slip(8, 0.5, 0.3), rel=5e-4)


def test_a_rocking_block_against_its_equations_of_motion(tmp_path):
    """A rigid block on unilateral springs at the joint's Gauss points, by scipy's Radau."""
    dt, peak, end, stiffness = 0.001, 6.0, 0.1, 1e9
    narrow = {"dam_base": 1.0, "dam_crest": 1.0, "dam_height": 4.0, "E": 1e14, "mu": 1e5}
    narrow |= {"K_N": stiffness, "K_T": stiffness, "n_joint": 10.0, "dt": dt, "record_rest": 0.4}
    times, values = [0, dt, end, end + dt], [0, peak, peak, 0]
    record = write_record(tmp_path / "r.csv", times, values)
    quake = earthquake(record, BLOCK | narrow)
    joint = joint_of(quake)
    x, weights = joint.points.positions[:, 0] - 0.5, joint.points.weights
    opening, at = [], []
    for step in quake.steps():
        jump = joint.jumps(joint.at_nodes, step.end.state.jump)
        opening.append(jump[joint.mesh.toe_nodes[0], 0])
        at.append(step.end.time)
    mass = 2400 * 4.0
    inertia = mass * (1 + 16) / 12

    def rates(t, y):
        up, v, turn, spin, right, u = y
        stress = stiffness * np.minimum(up + x * turn, 0)
        shear = -stiffness * (right + 2 * turn)  # the base's centre is 2 m below the block's
        moment = -weights @ (stress * x) + 2 * shear
        ground = np.interp(t, times, values)
        return [v, -weights @ stress / mass - G, spin, moment / inertia, u, shear / mass - ground]

    begin = [-mass * G / stiffness, 0, 0, 0, 0, 0]
    exact = solve_ivp(rates, (0, at[-1]), begin, "Radau", at, rtol=1e-8, atol=1e-12, max_step=dt).y
    toe = exact[0] + 0.5 * exact[2]
    assert toe.max() > 0.02
    assert max(opening) == pytest.approx(toe.max(), rel=2e-3)
    swing = slice(np.argmax(toe))
    assert opening[swing] == pytest.approx(toe[swing], abs=1e-2 * toe.max())


# -- exact at every step


def body_inertia(quake, bodies):
    """Functions of an acceleration (n,): inertia forces of the dam along x, y (2,), and their
    moment about the toe; by the load vectors of a body force, without the mass matrix.
    """
    body = bodies.by_name["dam"]
    toe = joint_of(quake).chord.toe
    density = quake.case["rho_dam"]
    forces = [density * body.unit_loads[f"dam_{axis}"] for axis in "xy"]
    moved = quake.system.motion["dam"]

    def resultant(acceleration):
        u = moved @ acceleration
        return np.array([force @ u for force in forces])

    return resultant, toe


@pytest.mark.parametrize("alpha", [-0.05, -0.3, 0.0])
@pytest.mark.parametrize("vertical", [False, True])
def test_momentum_is_balanced_at_every_step(tmp_path, alpha, vertical):
    """(1 + alpha) T1 - alpha T0 = static load - inertia, likewise N, while the dam slides and
    rocks; damping by the stiffness and the static loads have no further part in it.
    """
    times = np.arange(0, 1.0, 0.01)
    wave = 5 * np.sin(np.pi * times) ** 2 * np.sin(6 * np.pi * times)
    columns = [wave, -0.7 * wave] if vertical else [wave]
    record = write_record(tmp_path / "r.csv", times, *columns)
    quake = earthquake(record, DAM | {"hht_alpha": alpha, "added_mass": 0.0}, "40")
    resultant, _ = body_inertia(quake, Bodies.of(quake.case))
    equilibrium = quake.problem.model.equilibrium
    forces = lambda state: np.array([joint_row(equilibrium, state, 0)[n] for n in "TN"])
    ones = resultant(quake.system.translation(joint_of(quake), ["dam"], np.array([1.0, 0])))[0]
    static = before = forces(quake.problem.static)
    ground_before, worst, slid = np.zeros(2), 0.0, 0.0
    for step in quake.steps():
        now = forces(step.end.state)
        ground = (1 + alpha) * step.ground - alpha * ground_before
        inertia = resultant(step.end.motion.acceleration) + ones * ground
        expected = static + inertia * [-1, 1]
        worst = max(worst, np.abs((1 + alpha) * now - alpha * before - expected).max())
        before, ground_before = now, step.ground
        slid = max(slid, abs(mean_slip(quake)))
    assert slid > 1e-3
    assert worst < 1e-9 * np.abs(static).max()


def test_the_added_mass_is_westergaards(tmp_path):
    """7/12 rho H^2 in front of a vertical face, in the mass and in the load along x only."""
    record = smooth_record(tmp_path / "r.csv", 1.0)
    wet, dry = (
        earthquake(record, DAM | {"added_mass": flag, "n_joint": 30.0}, "40") for flag in (1.0, 0.0)
    )
    along, up = (wet.system.translation(joint_of(wet), ["dam"], d) for d in np.eye(2))
    concrete = 2400 * (34 + 5) / 2 * 45
    mass = lambda quake, d: d @ quake.system.mass @ d
    assert mass(dry, along) == pytest.approx(concrete)
    assert mass(wet, along) - mass(dry, along) == pytest.approx(7 / 12 * 1000 * 40**2)
    assert mass(wet, up) == pytest.approx(concrete)
    assert along @ wet.system.inertia[:, 0] == pytest.approx(mass(wet, along))
    assert up @ wet.system.inertia[:, 1] == pytest.approx(concrete)


# -- order, frequencies, damping

#: The dam on a joint that stays elastic.
ELASTIC = DAM | {"adhesion": 1e12}


@pytest.mark.parametrize("alpha", [-0.05, 0.0])
def test_the_error_falls_with_the_square_of_the_step(tmp_path, alpha):
    record = smooth_record(tmp_path / "r.csv", 2.0, duration=0.64, interval=0.00125)
    ends = []
    for dt in (0.01, 0.005, 0.0025, 0.00125):
        settings = ELASTIC | {"dt": dt, "hht_alpha": alpha, "record_rest": 0.0}
        quake = earthquake(record, settings, "40")
        history = {round(s.end.time, 6): s.end.motion.displacement for s in quake.steps()}
        ends.append([(quake.system.crest @ history[t])[0] for t in (0.32, 0.48, 0.64)])
    changes = np.linalg.norm(np.diff(ends, axis=0), axis=1)
    orders = np.log2(changes[:-1] / changes[1:])
    assert orders == pytest.approx(2, abs=0.25)
    assert orders[-1] == pytest.approx(2, abs=0.06)


def test_frequencies_against_a_dense_eigenvalue_solution(tmp_path):
    quake = earthquake(smooth_record(tmp_path / "r.csv", 1.0), ELASTIC, "40")
    problem, system = quake.problem, quake.system
    interface = problem.model.equilibrium.interface
    of_joints = interface.stiffness(
        problem.model.equilibrium.undamaged, np.arange(len(interface.weights))
    )
    stiffness = system.stiffness.toarray()
    stiffness[np.ix_(system.jumps, system.jumps)] += of_joints.toarray()
    largest = eigh(system.mass.toarray(), stiffness, eigvals_only=True)[::-1]
    expected = 1 / np.sqrt(largest[:3]) / (2 * np.pi)
    assert quake.frequencies == pytest.approx(expected, rel=1e-7)


def test_free_vibration_decays_as_rayleigh_damping_says(tmp_path):
    """In the first mode, at the damping's first frequency: amplitude exp(-xi omega t)."""
    settings = ELASTIC | {"damping": 0.05, "damping_mass": 1.0, "hht_alpha": 0.0}
    quake = earthquake(smooth_record(tmp_path / "r.csv", 1.0), settings, "40")
    assert [quake.damping.ratio(f) for f in quake.frequencies[[0, 2]]] == pytest.approx([0.05] * 2)
    problem, system = quake.problem, quake.system
    interface = problem.model.equilibrium.interface
    points = np.arange(len(interface.weights))
    of_joints = interface.stiffness(problem.model.equilibrium.undamaged, points)
    frequencies, modes = system.frequencies(of_joints, 1)
    omega, mode = 2 * np.pi * frequencies[0], modes[:, 0]
    mode = 1e-3 * mode / (system.crest @ mode)[0]
    # the joint's stiffness is not damped: the part of K of the bodies in this mode
    share = mode @ system.stiffness @ mode / (omega**2 * (mode @ system.mass @ mode))
    xi = quake.damping.a0 / (2 * omega) + quake.damping.a1 * omega / 2 * share
    dt = 2 * np.pi / omega / 200
    start = Motion(mode, np.zeros(len(mode)), -(omega**2) * mode)
    forces = of_joints @ mode[system.jumps]
    static = problem.static
    moved = replace(static, jump=static.jump + mode[system.jumps])
    state = replace(problem.at_rest, state=moved, motion=start, forces=forces)
    step, crest = TimeStep(problem, dt), []
    nothing = (np.zeros(2), np.zeros(2))
    for _ in range(600):
        state, _ = step.advance(state, nothing, static.pressures, True)
        crest.append((system.crest @ state.motion.displacement)[0])
    peaks = [max(crest[k * 200 - 60 : k * 200 + 60]) for k in (1, 2)]
    expected = np.exp(-2 * np.pi * xi / np.sqrt(1 - xi**2))
    assert peaks[1] / peaks[0] == pytest.approx(expected, rel=2e-3)
