"""Time integration of an earthquake: closed forms, balance of momentum, order, both signs."""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import damjoint as dj
import numpy as np
import pytest
from damjoint import RunError
from damjoint.dynamics.frames import MOST_FRAMES, Frames, frame_interval
from damjoint.dynamics.history import QuakeHistory
from damjoint.dynamics.impact import MOST_CHANGE
from damjoint.dynamics.record_files import read
from damjoint.dynamics.scheme import Motion
from damjoint.dynamics.step import TimeStep
from damjoint.fem import factor
from damjoint.fem.bodies import Bodies, material_of
from damjoint.fem.elasticity import stress
from damjoint.fem.elements import Space
from damjoint.input.resolve import load
from damjoint.joint import linear_system
from damjoint.post import stored
from damjoint.post.field_files import everywhere
from damjoint.solver.history import JointState
from damjoint.studies import (
    chart,
    outcome,
    quake_picture,
    quake_result,
    quake_study,
    quake_summary,
    sweep,
)
from damjoint.studies.plan import Limits, Plan
from damjoint.studies.quake import QuakeRun
from matplotlib.text import Text
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


@pytest.mark.heavy
def test_a_block_under_a_half_sine(tmp_path):
    times = np.arange(0, 0.3025, 0.0025)
    values = np.maximum(8 * np.sin(np.pi * times / 0.3), 0)
    quake = earthquake(write_record(tmp_path / "r.csv", times, values), BLOCK | {"dt": 0.0025})
    run(quake)
    assert half_sine_slip(8, 0.5, 0.3) == pytest.approx(0.054306889, rel=1e-6)
    assert mean_slip(quake) == pytest.approx(-half_sine_slip(8, 0.5, 0.3), rel=5e-4)


@pytest.mark.heavy
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


@pytest.mark.heavy
@pytest.mark.parametrize(
    "alpha, vertical, rock_mass",
    [
        (-0.3, True, 0),
        (-0.05, True, 1),
        (-0.05, False, 0),
        (0.0, False, 0),
    ],
)
def test_momentum_is_balanced_at_every_step(tmp_path, alpha, vertical, rock_mass):
    """(1 + alpha) T1 - alpha T0 = static load - inertia, likewise N, while the dam slides and
    rocks; damping by the stiffness and the static loads have no further part in it.
    """
    times = np.arange(0, 1.0, 0.01)
    wave = 5 * np.sin(np.pi * times) ** 2 * np.sin(6 * np.pi * times)
    columns = [wave, -0.7 * wave] if vertical else [wave]
    record = write_record(tmp_path / "r.csv", times, *columns)
    settings = {"hht_alpha": alpha, "added_mass": 0.0, "rock_mass": rock_mass, "rho_found": 2600.0}
    quake = earthquake(record, DAM | settings, "40")
    resultant, _ = body_inertia(quake, Bodies.of(quake.case))
    equilibrium = quake.problem.model.equilibrium
    forces = lambda state: np.array([JointState(equilibrium, state, 0).row[n] for n in "TN"])
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


@pytest.mark.heavy
def test_energy_is_only_lost_after_the_shaking(tmp_path):
    """Kinetic energy, strain energy of bodies and joint, less the work of the static forces, of a
    dam that still slides and rocks: friction, damping and the time integration only take from it.
    """
    record = smooth_record(tmp_path / "r.csv", 7.0, duration=0.5)
    quake = earthquake(record, DAM | {"dt": 0.001, "record_rest": 0.25}, "40")
    system, joint, static = quake.system, joint_of(quake), quake.problem.static
    equilibrium = quake.problem.model.equilibrium
    at_points = lambda state: joint.jumps(joint.at_points, state.jump)
    traction = lambda state: equilibrium.laws.evaluate(at_points(state), state.variables)[0]
    held = equilibrium.interface.forces(traction(static))
    compliance = 1 / np.array([quake.case["K_N"], *[quake.case["K_T"]] * 2])
    energies, moved = [], []
    for step in quake.steps():
        if step.end.time < 0.51:
            continue
        motion, state = step.end.motion, step.end.state
        elastic = joint.points.weights @ (traction(state) ** 2 @ compliance)
        strain = motion.displacement @ system.stiffness @ motion.displacement
        kinetic = motion.velocity @ system.mass @ motion.velocity
        energies.append((elastic + strain + kinetic) / 2 - held @ (state.jump - static.jump))
        moved.append(mean_slip(quake))
    changes = np.diff(energies)
    assert np.ptp(moved) > 1e-3 and changes.sum() < 0
    assert changes.max() < 1e-9 * np.ptp(energies)


@pytest.mark.heavy
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


@pytest.mark.heavy
@pytest.mark.parametrize("alpha", [-0.05, 0.0])
def test_the_error_falls_with_the_square_of_the_step(tmp_path, alpha):
    record = smooth_record(tmp_path / "r.csv", 2.0, duration=0.64)
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
    of_joints = interface.assembly.whole(problem.model.equilibrium.undamaged)
    stiffness = system.stiffness.toarray()
    stiffness[np.ix_(system.jumps, system.jumps)] += of_joints.toarray()
    largest = eigh(system.mass.toarray(), stiffness, eigvals_only=True)[::-1]
    expected = 1 / np.sqrt(largest[:3]) / (2 * np.pi)
    assert quake.frequencies == pytest.approx(expected, rel=1e-7)


@pytest.mark.heavy
@pytest.mark.parametrize("braked", [2.0, 1.0])
def test_free_vibration_decays_as_rayleigh_damping_says(tmp_path, braked):
    """In the first mode, at the damping's first frequency: amplitude exp(-xi omega t); braked by
    its mass part with the added water (2), or without (1).
    """
    settings = ELASTIC | {"damping": 0.05, "damping_mass": braked, "hht_alpha": 0.0}
    record = smooth_record(tmp_path / "r.csv", 1.0)
    quake = earthquake(record, settings, "40")
    problem, system = quake.problem, quake.system
    interface = problem.model.equilibrium.interface
    of_joints = interface.assembly.whole(problem.model.equilibrium.undamaged)
    frequencies, modes = system.frequencies(of_joints, 1)
    omega, mode = 2 * np.pi * frequencies[0], modes[:, 0]
    mode = 1e-3 * mode / (system.crest @ mode)[0]
    # the joint's stiffness is not damped: the part of K of the bodies in this mode
    share = mode @ system.stiffness @ mode / (omega**2 * (mode @ system.mass @ mode))
    dry = earthquake(record, settings | {"added_mass": 0.0}, "40").system
    of_mass = dry.mass if braked == 1 else system.mass
    mass_share = mode @ of_mass @ mode / (mode @ system.mass @ mode)
    assert (mass_share == 1) == (braked == 2) and mass_share > 0.5
    xi = quake.damping.a0 / (2 * omega) * mass_share + quake.damping.a1 * omega / 2 * share
    assert quake.modes[0].damping == pytest.approx(xi, rel=1e-6)
    assert quake.modes[0].frequency == pytest.approx(frequencies[0])
    nominal = quake.damping.a0 / (2 * omega) + quake.damping.a1 * omega / 2
    assert nominal == pytest.approx(0.05)
    dt = 2 * np.pi / omega / 200
    start = Motion(mode, np.zeros(len(mode)), -(omega**2) * mode)
    forces = of_joints @ mode[system.jumps]
    static = problem.static
    moved = replace(static, jump=static.jump + mode[system.jumps])
    state = replace(
        problem.at_rest, state=moved, retained=start.at(problem.retained), forces=forces
    )
    step, crest = TimeStep(problem, dt), []
    nothing = np.zeros((2, system.size))
    for _ in range(600):
        state, _ = step.advance(state, nothing, static.pressures, True)
        crest.append((system.crest @ state.motion.displacement)[0])
    peaks = [max(crest[k * 200 - 60 : k * 200 + 60]) for k in (1, 2)]
    expected = np.exp(-2 * np.pi * xi / np.sqrt(1 - xi**2))
    assert peaks[1] / peaks[0] == pytest.approx(expected, rel=2e-3)


def test_modes_are_named_by_the_mass_that_moves_along_each_axis(tmp_path):
    """The first mode of a dam sways; all of a block on a soft joint move it along an axis each."""
    record = smooth_record(tmp_path / "r.csv", 1.0)
    first = earthquake(record, ELASTIC, "40").modes[0]
    assert first.along_x > 0.5 > 5 * first.along_y
    soft = {"dam_height": 8.0, "K_N": 1e7, "K_T": 1e5, "adhesion": 1e12}
    modes = earthquake(record, BLOCK | soft).modes
    assert sum(mode.along_x for mode in modes) == pytest.approx(1, rel=1e-2)
    assert max(mode.along_y for mode in modes) == pytest.approx(1, rel=1e-2)
    assert modes[0].along_x == pytest.approx(1, rel=1e-2)
    mass, length = 2400 * 64, 8.0
    assert modes[0].frequency == pytest.approx(np.sqrt(1e5 * length / mass) / 2 / np.pi, rel=2e-2)


@pytest.mark.heavy
def test_joint_dashpots_of_a_closed_joint(tmp_path):
    """A rigid block on springs and dashpots under a vertical record: a damped oscillator."""
    stiffness, dashpot, mass, length = 1e7, 8.8e4, 2400 * 16.0, 8.0
    settings = {"K_N": stiffness, "K_T": stiffness, "joint_damping_n": dashpot, "dt": 1e-3}
    times = np.arange(0, 0.6, 0.01)
    values = 3 * np.sin(40 * times)
    record = write_record(tmp_path / "r.csv", times, 0 * times, values)
    quake = earthquake(record, BLOCK | settings | {"record_rest": 0.3})
    joint = joint_of(quake)
    steps = list(quake.steps())
    opening = np.array([joint.heel @ step.end.state.jump for step in steps])
    opening -= joint.heel @ quake.problem.static.jump

    def rates(t, y):
        ground = quake.record.at(t)[1]
        return [y[1], -length * (stiffness * y[0] + dashpot * y[1]) / mass - ground]

    at = [step.end.time for step in steps]
    exact = solve_ivp(rates, (0, at[-1]), [0, 0], "DOP853", at, rtol=1e-9, max_step=5e-3).y[0]
    assert opening == pytest.approx(exact, abs=1e-3 * np.abs(exact).max())


@pytest.mark.heavy
@pytest.mark.parametrize(
    "mode, uplift",
    [("zero", "imposed"), ("unchanged", "cracked")],
)
def test_water_in_the_joint_during_an_earthquake(tmp_path, mode, uplift):
    """zero: less uplift while the joint is open; unchanged: the same at every step; by the crack:
    more while it is open.
    """
    record = smooth_record(tmp_path / "r.csv", 5.0, duration=0.6)

    def uplifts(value):
        settings = DAM | {"quake_uplift": value, "uplift": uplift, "n_joint": 20.0}
        quake = earthquake(record, settings, "30")
        equilibrium = quake.problem.model.equilibrium
        rows = [JointState(equilibrium, step.end.state, 0).row for step in quake.steps()]
        return np.array([[row["U"], row["crack_length"]] for row in rows]), quake

    changed, quake = uplifts(mode)
    static = JointState(quake.problem.model.equilibrium, quake.problem.static, 0).row
    assert changed[:, 1].max() > 5
    if mode == "zero":
        open_before = changed[:-1, 1] > 2
        assert (changed[1:, 0][open_before] < static["U"] * 0.999).all()
    else:
        assert changed[:, 0] == pytest.approx(static["U"])
        assert uplifts("crack")[0][:, 0].max() > 1.05 * static["U"]


@pytest.mark.heavy
def test_water_returns_to_a_crack_that_closes(tmp_path):
    """zero: the static uplift in each step that begins with a closed joint, broken or not; of
    law = rupture a broken point belongs to the crack for good.
    """
    settings = DAM | {"law": "rupture", "sigma_max": 2e5, "quake_uplift": "zero"}
    quake = earthquake(smooth_record(tmp_path / "r.csv", 5.0, duration=0.6), settings, "30")
    equilibrium, joint, begin = quake.problem.model.equilibrium, joint_of(quake), quake.now.state
    static, closed_again = JointState(equilibrium, begin, 0).row["U"], 0
    for step in quake.steps():
        row = JointState(equilibrium, step.end.state, 0).row
        opening = joint.jumps(joint.at_points, begin.jump)[:, 0].max()
        if opening <= 0:
            assert row["U"] == pytest.approx(static)
            closed_again += row["crack_length"] == pytest.approx(34)
        begin = step.end.state
    assert closed_again > 10


# -- condensation, three dimensions, several joints


@pytest.mark.heavy
@pytest.mark.parametrize("alpha", [-0.05, 0.0])
def test_steps_solve_the_equations_of_all_unknowns(tmp_path, alpha):
    """Residual of the uncondensed equations at every step, while the dam slides and rocks."""
    record = smooth_record(tmp_path / "r.csv", 6.0, duration=0.5)
    quake = earthquake(record, DAM | {"hht_alpha": alpha, "record_rest": 0.0}, "30")
    problem, system = quake.problem, quake.system
    assert problem.rock  # which is not among the unknowns of the steps
    interface, laws = problem.model.equilibrium.interface, problem.model.equilibrium.laws
    at_points = lambda state: interface.jumps(interface.at_points, state.jump)

    def forces(state, motion):
        traction, _ = laws.evaluate(at_points(state), state.variables)
        result = system.stiffness @ motion.displacement + problem.damping @ motion.velocity
        result[system.jumps] += interface.forces(traction)
        return result

    static = before = forces(problem.static, problem.at_rest.motion)
    ground_before, largest = np.zeros(2), 0.0
    for step in quake.steps():
        state, motion = step.end.state, step.end.motion
        assert state.jump - problem.static.jump == pytest.approx(
            motion.displacement[system.jumps], abs=1e-12
        )
        now = forces(state, motion)
        ground = (1 + alpha) * step.ground - alpha * ground_before
        residual = system.mass @ motion.acceleration + system.inertia @ ground
        residual += (1 + alpha) * (now - static) - alpha * (before - static)
        largest = max(largest, np.linalg.norm(residual) / problem.model.reference)
        before, ground_before = now, step.ground
    assert abs(mean_slip(quake)) > 0.01
    assert largest < 1e-8


@pytest.mark.heavy
@pytest.mark.parametrize("other", ["Woodbury", "MUMPS"])
def test_linear_solvers_agree(tmp_path, monkeypatch, other):
    """Dense matrices of few unknowns against the formula for many; SuperLU against MUMPS."""
    record = smooth_record(tmp_path / "r.csv", 6.0, duration=0.4)
    settings = DAM | {"dt": 0.0025, "mu": 0.75}  # no step is halved
    quakes = [earthquake(record, settings, "30")]
    run(quakes[0])
    if other == "MUMPS":
        monkeypatch.setattr(factor, "SMALL", 0)
    else:
        monkeypatch.setattr(linear_system, "MOST_DENSE", 0)
    quakes.append(earthquake(record, settings, "30"))
    run(quakes[1])
    slips = [mean_slip(quake) for quake in quakes]
    assert abs(slips[0]) > 0.01 and [quake.halvings for quake in quakes] == [0, 0]
    assert slips[1] == pytest.approx(slips[0], rel=1e-6)


@pytest.mark.heavy
@pytest.mark.parametrize("pattern, order", [("layers", 1.0), ("split", 2.0)])
def test_a_section_of_any_thickness_moves_as_in_plane_strain(tmp_path, pattern, order):
    """With both end faces fixed along z, per metre of thickness; the two meshes of the section
    differ a little.
    """
    record = smooth_record(tmp_path / "r.csv", 5.0, duration=0.4)
    small = {"n_joint": 6.0, "h_dam": 15.0, "h_found": 45.0, "order": order}
    solid = {"dim": 3.0, "thickness": 7.0, "hold_z": 1.0, "mesh_pattern": pattern}
    plane, thick = (earthquake(record, DAM | small | more, "30") for more in ({}, solid))
    assert thick.frequencies == pytest.approx(plane.frequencies, rel=1e-2)
    for quake in (plane, thick):
        assert len(run(quake)) >= 80
    assert mean_slip(thick) == pytest.approx(mean_slip(plane), rel=2e-2)
    assert abs(mean_slip(plane)) > 0.005
    masses = [
        d @ q.system.mass @ d / joint_of(q).width
        for q in (plane, thick)
        for d in [q.system.translation(joint_of(q), ["dam"], np.array([1.0, 0]))]
    ]
    assert masses[1] == pytest.approx(masses[0], rel=1e-9)


@pytest.mark.heavy
def test_momentum_above_each_of_several_joints(tmp_path):
    """T of each joint: the static one less the inertia of all that is above it; Newmark."""
    record = smooth_record(tmp_path / "r.csv", 6.0, duration=0.5)
    settings = DAM | {"lift_heights": (15.0, 30.0), "hht_alpha": 0.0, "added_mass": 0.0}
    quake = earthquake(record, settings | {"mu": (1.2, 0.7, 0.9)}, "40")
    equilibrium, system = quake.problem.model.equilibrium, quake.system
    forces = lambda state: np.array([JointState(equilibrium, state, k).row["T"] for k in range(3)])
    static, slid = forces(quake.problem.static), np.zeros(3)
    rigid = [
        system.translation(joint_of(quake, k), quake.case.graph.separated([k]), np.array([1.0, 0]))
        for k in range(3)
    ]
    masses = np.array([d @ system.mass @ d for d in rigid])
    widths = np.array([34, 34 - 29 * 15 / 45, 34 - 29 * 30 / 45])
    assert masses == pytest.approx(2400 * (widths + 5) / 2 * [45, 30, 15], rel=1e-9)
    for step in quake.steps():
        absolute = step.end.motion.acceleration
        inertia = [d @ (system.mass @ absolute) for d in rigid] + masses * step.ground[0]
        assert forces(step.end.state) == pytest.approx(static - inertia, abs=1e-8 * static.max())
        moved = step.end.state.jump - quake.problem.static.jump
        for k in range(3):
            joint = joint_of(quake, k)
            slid[k] = max(slid[k], np.abs(joint.jumps(joint.at_points, moved)[:, 1]).max())
    assert slid[1] > 0.01  # the smoothest one


# -- halving


def test_a_step_that_does_not_converge_is_halved(tmp_path, monkeypatch):
    """Around 0.1 s only steps of an eighth converge, here by force; then the full one again. A run
    that is interrupted there continues with the same steps.
    """
    record = smooth_record(tmp_path / "r.csv", 4.0, duration=0.2)
    advance, dt = TimeStep.advance, 0.005

    def limited(self, begin, *rest):
        wrong = abs(begin.time - 0.1) < 0.004 and self.dt > dt / 8 * 1.01
        return None if wrong else advance(self, begin, *rest)

    monkeypatch.setattr(TimeStep, "advance", limited)
    settings = DAM | {"record_rest": 0.1, "dt": dt}
    quake = earthquake(record, settings, "30")
    steps = run(quake)
    times = np.array([step.end.time for step in steps])
    lengths = np.array([step.dt for step in steps])
    assert np.diff([0, *times]) == pytest.approx(lengths) and times[-1] == pytest.approx(0.3)
    assert {1, 0.125} <= set(np.round(lengths / dt, 6)) and quake.halvings == 3
    assert lengths[np.abs(times - lengths - 0.1) < 0.004].max() == pytest.approx(dt / 8)
    assert (lengths[times > 0.111] == dt).all() and (lengths[times < 0.094] == dt).all()
    number = int(np.argmax(lengths < dt)) + 3
    other = earthquake(record, settings, "30")
    first = [step for _, step in zip(range(number), other.steps(), strict=False)]
    rest = run(other)
    assert [step.end.time for step in first + rest] == times.tolist()


@pytest.mark.parametrize("drift", [-1e-6, 1e-6])
def test_the_rounding_of_many_steps_is_no_interrupted_step(tmp_path, drift):
    """The time is a sum: after 9000 steps of 1.25 ms it is 1e-9 of a step off its multiple, after
    a million steps more.
    """
    record = smooth_record(tmp_path / "r.csv", 1.0, duration=0.2)
    quake = earthquake(record, BLOCK | {"dt": 0.01, "record_rest": 0.0})
    lengths = []
    for step in quake.steps():
        lengths.append(step.dt)
        quake.now = replace(step.end, time=step.end.time + drift * 0.01)
    assert lengths == [0.01] * 20


def test_a_step_that_never_converges_ends_the_run(tmp_path, monkeypatch):
    monkeypatch.setattr(TimeStep, "advance", lambda *_: None)
    quake = earthquake(smooth_record(tmp_path / "r.csv", 1.0), DAM)
    with pytest.raises(RunError, match="after t = 0 s no equilibrium"):
        run(quake)


def test_a_slip_beyond_small_displacements_ends_the_run(tmp_path):
    flat = BLOCK | {"dam_height": 0.5, "dam_base": 2.0, "dam_crest": 2.0, "dt": 0.005}
    times, values = [0, 0.005, 0.2, 0.205], [0, 8, 8, 0]
    quake = earthquake(write_record(tmp_path / "r.csv", times, values), flat)
    with pytest.raises(RunError, match="displacement jump reaches"):
        run(quake)
    assert 0.045 < abs(mean_slip(quake)) < 0.05


# -- the command


@pytest.fixture
def case_file(tmp_path):
    """A case with a record beside it."""
    smooth_record(tmp_path / "wave.csv", 5.0, duration=0.5)
    path = tmp_path / "my.case"
    settings = {n: v for n, v in DAM.items() if n != "record_unit"} | {"record_rest": 0.5}
    lines = [
        f'default_{n} = "{v}";' if isinstance(v, str) else f"default_{n} = {v};"
        for n, v in settings.items()
    ]
    path.write_text(
        "\n".join(
            [
                'title = "wave"; record = "wave.csv"; default_record_unit = "m/s2";',
                "levels() = {30};",
                *lines,
                "",
            ]
        )
    )
    return path


#: Where the accuracy does not matter.
LONG_STEPS = "--set", "dt=0.01", "--set", "record_rest=2"


@pytest.fixture
def records(tmp_path):
    """Two records, as options."""
    for name, size in (("weak", 2.0), ("strong", 6.0)):
        smooth_record(tmp_path / f"{name}.csv", size, duration=0.5)
    return [word for name in ("weak", "strong") for word in ("--record", tmp_path / f"{name}.csv")]


def quakes(folder):
    """Tables below a folder."""
    return {str(p.relative_to(folder)): p.read_text() for p in folder.rglob("*.csv")}


@pytest.mark.heavy
def test_several_records_in_several_processes(command, case_file, tmp_path, records):
    """Each earthquake has a folder and a row; one process computes the same."""
    words = "quake", case_file, *records, "--no-picture", *LONG_STEPS
    code, out, err = command(*words, "--jobs", 2, "--out", "two")
    assert code == 0 and err == "" and out.count("natural modes") == 2
    with (tmp_path / "two" / "records.csv").open() as file:
        weak, strong = csv.DictReader(file)
    assert (weak["folder"], strong["folder"]) == ("weak", "strong")
    assert float(weak["peak_ground_ax"]) < float(strong["peak_ground_ax"]) <= 6
    for row in (weak, strong):
        info = json.loads((tmp_path / "two" / row["folder"] / "run.json").read_text())
        assert row["verdict"] == info["verdict"] and info["commit"] and info["wall_seconds"]
        assert float(row["residual_slip"]) == pytest.approx(info["quake"]["residual"]["slip"])
    assert command(*words, "--jobs", 1, "--out", "one")[0] == 0
    assert quakes(tmp_path / "one") == quakes(tmp_path / "two")


def test_the_table_of_several_records_fits_the_terminal():
    """Of long names and verdicts; what has no room is named."""
    numbers = dict.fromkeys(quake_summary.QUAKE_COLUMNS, -0.0012345)
    row = {"folder": "irpinia_1980_sturno_090", "verdict": "sliding on lift 12.5 m"} | numbers
    results = [SimpleNamespace(row=row)] * 2
    widest = quake_study.records_table(results).split("\n")
    assert "block [m]" in widest[1] and max(map(len, widest)) > 80
    lines = quake_study.records_table(results, 80).split("\n")
    assert max(map(len, lines)) <= 80 and "rigid_block_slip" in lines[-2]
    assert row["folder"] in lines[-3] and row["verdict"] in lines[-3]


@pytest.mark.heavy
def test_earthquakes_that_are_finished_are_not_computed_again(
    command, case_file, tmp_path, records, monkeypatch
):
    words = "quake", case_file, *records, "--no-picture", *LONG_STEPS, "--jobs", 1
    compute, computed = quake_study.compute, []

    def interrupted(case, *others):
        computed.append(case.record.stem)
        if computed == ["weak", "strong"]:
            raise KeyboardInterrupt
        return compute(case, *others)

    monkeypatch.setattr(quake_study, "compute", interrupted)
    assert command(*words)[0] == 130
    out = tmp_path / "out" / "my_quake"
    states = [json.loads((out / n / "run.json").read_text())["state"] for n in ("weak", "strong")]
    assert states == ["complete", "interrupted"] and not (out / "records.csv").exists()
    assert command(*words)[0] == 0 and computed == ["weak", "strong", "strong"]
    assert (out / "records.csv").read_text().count("\n") == 3


def test_two_records_of_one_name_are_refused(refused, case_file, tmp_path):
    smooth_record(tmp_path / "wave.csv", 2.0)
    message = refused("quake", case_file, *2 * ("--record", tmp_path / "wave.csv"))
    assert "must be given once, and have its own name" in message


@pytest.mark.heavy
@pytest.mark.parametrize("engine", ["condensed", "getdp"])
def test_from_python_an_earthquake_is_what_the_command_writes(command, case_file, tmp_path, engine):
    """Rows, static states, frames, stress and summary, of either engine; nothing is written."""
    words = "--no-picture", "--set", "dt=0.01", "--set", "record_rest=0.6", "--out", "out"
    assert command("quake", case_file, *words, "--engine", engine)[0] in (0, 1)
    before = {p for p in tmp_path.rglob("*") if "cache" not in str(p)}
    found = dj.quake(dj.case(case_file, dt=0.01, record_rest=0.6), engine=engine)
    assert {p for p in tmp_path.rglob("*") if "cache" not in str(p)} == before
    tables = {"quake": found.rows, "history": found.history, "joint": found.joint}
    if engine == "condensed":
        tables["quake_joint"] = found.frames
        with np.load("out/quake_stress.npz") as stored:
            assert all(np.array_equal(found.stress[name], stored[name]) for name in stored)
    for name, table in tables.items():
        stored = np.genfromtxt(f"out/{name}.csv", delimiter=",", names=True)
        assert table.dtype.names == stored.dtype.names and len(table) == len(stored)
        for column in stored.dtype.names:
            scale = np.abs(stored[column]).max()
            assert np.allclose(table[column], stored[column], 1e-6, 1e-9 * scale, equal_nan=True)
    info = json.loads(Path("out/run.json").read_text())
    assert (found.verdict, found.statement) == (info["verdict"], info["statement"])
    assert found.stands == (info["verdict"] == "stands")
    for name, peak in info["quake"]["peaks"].items():
        assert found.summary["peaks"][name] == pytest.approx(peak, rel=1e-6)
    assert found.units["crest_ux"] == "m" and found.units["ground_ax"] == "m/s2"
    frame = found.to_pandas()
    assert list(frame.columns) == list(found.rows.dtype.names)
    assert frame.attrs["units"]["N"] == "N/m"


def test_the_command_writes_rows_summary_and_picture(command, case_file, tmp_path, texts_drawn):
    code, out, _ = command("quake", case_file)
    assert code == 0
    folder = tmp_path / "out" / "my_quake"
    info = json.loads((folder / "run.json").read_text())
    found = info["quake"]
    rows = np.genfromtxt(folder / "quake.csv", delimiter=",", names=True)
    assert (info["state"], info["verdict"]) == ("complete", "stands")
    assert "residual slip" in info["statement"]
    assert len(rows) == found["steps"] and rows["time"][-1] == pytest.approx(1.0)
    peak = found["peaks"]["crest_ux"]
    assert abs(peak["value"]) == pytest.approx(np.abs(rows["crest_ux"]).max())
    assert rows["crest_ux"][rows["time"] == peak["time"]] == pytest.approx(peak["value"])
    assert found["after"]["equilibrium"] and found["after"]["N"] > 0
    assert np.abs(rows["residual"]).max() < 1e-6 and rows["dt"].max() == pytest.approx(0.005)
    # the static rows: the last level, and the state that the earthquake leaves
    history = np.genfromtxt(folder / "history.csv", delimiter=",", names=True)
    assert history["time"].tolist() == [1, 2] and history["level"].tolist() == [30, 30]
    moved = history["crest_ux"][1] - history["crest_ux"][0]
    assert moved == pytest.approx(rows["slip_mean"][-1], abs=2e-3) and moved > 0.01
    stress = np.load(folder / "quake_stress.npz")
    assert stress["sigma_n_eff"].shape == (len(rows), len(stress["s"]))
    (texts,) = texts_drawn
    assert (folder / "my_quake.png").exists() and info["statement"] in " ".join(texts)
    assert not (folder / "quake_state.npz").exists()
    assert "residual slip" in out and "rigid block" in out
    assert command("report", folder)[0] == 0
    page = Path("report.html").read_text()
    assert "earthquake wave.csv, " in page and "data:image/png" in page
    # of the ground: its largest acceleration in g, Arias' intensity
    ground = np.abs(rows["ground_ax"])
    arias = np.pi / (2 * 9.80665) * np.trapezoid(ground**2, rows["time"])
    cells = re.findall(r"<td>(.*?)</td>", page.split("Earthquake: ground motion")[1])
    assert cells[0] == "horizontal"
    assert float(cells[1]) == pytest.approx(ground.max() / 9.80665, rel=5e-3)
    assert float(cells[3]) == pytest.approx(arias, rel=1e-2)
    assert "tension &gt; 0, at level 30 m, static, after the earthquake</h3>" in page
    assert "principal stress" in page.split("static, after the earthquake")[1]
    assert "its stiffness part alone acts" in page and "The rigid block [Newmark 1965]" in page


@pytest.mark.heavy
def test_run_json_has_what_that_of_a_run_has(command, case_file, tmp_path):
    """But for the estimate of the discretisation error and what only load steps have."""
    short = "--set", "dt=0.01", "--no-picture", "--set", "record_rest=0.3"
    assert command("quake", case_file, *short)[0] in (0, 1)
    assert command("run", case_file, "--no-picture", "--no-fields")[0] == 0
    run, quake = (
        json.loads((tmp_path / "out" / name / "run.json").read_text())
        for name in ("my", "my_quake")
    )
    assert run.keys() <= quake.keys()
    for name in ("commit", "machine", "versions"):
        assert quake[name] == run[name] and quake[name]
    assert quake["peak_memory_mb"] > 10


def values_of(rest, law="friction", slip=0.0, opening=0.0, broken=0.0, K_T=1e9):
    """values_at_end of a dam whose joint, since the ground is at rest, slips by a part of its
    slip of 10 mm and opens by a part of its largest opening of 1 mm; it vibrates all the time.
    """
    case = load("dam", {"law": law, "K_T": K_T})
    time = np.arange(0.01, 2 + rest + 1e-6, 0.01)
    wave, shaken = np.sin(2 * np.pi * 5 * time), time < 2
    late = np.clip((time - 2) / max(rest, 0.01), 0, 1)
    rows = {name: np.where(shaken, wave, 0.0) for name in ("ground_ax", "ground_ay")}
    shear = 1e6 * wave
    plastic = 0.01 * np.clip(time / 1.5, 0, 1) + slip * 0.01 * late
    rows |= {"time": time, "crest_ux": wave, "crest_ax": wave, "T": shear}
    rows["slip_mean"] = plastic + shear / (K_T * case.joint_length)
    rows["heel_opening"] = np.where(shaken, 1e-3, -1e-4) * wave
    rows["toe_opening"] = np.where(shaken, -1e-4, opening * 1e-3) * wave
    rows["open_length"] = np.zeros(len(time))
    rows["broken_length"] = np.full(len(time), broken * case.joint_length)
    found = quake_summary.values_at_end(case, rows, np.float64(0.2))
    return case, json.loads(json.dumps(found))  # as run.json has it


@pytest.mark.parametrize(
    "rest, change, at_rest",
    [
        (2.0, {}, True),  # though the elastic part of the slip varies by 0.06 mm
        (2.0, {"slip": 0.015}, True),
        (2.0, {"slip": 0.05}, False),
        (2.0, {"opening": 0.05}, True),
        (2.0, {"opening": 0.5}, False),
        (0.5, {}, True),
        (0.3, {}, False),  # shorter than twice the first period
        (0.0, {}, False),
    ],
)
def test_a_residual_slip_is_one_at_rest(rest, change, at_rest):
    case, found = values_of(rest, **change)
    found["after"] = {"equilibrium": True}
    words = quake_summary.statement(case, found)
    verdict = "stands" if at_rest else "not at rest"
    assert quake_summary.verdict(case, found) == verdict
    assert found["at_rest"] == at_rest == ("slip" in found["residual"])
    assert words.startswith("residual slip 1" if at_rest else "not at rest in the last ")
    assert words.endswith(
        "the dam stands after the earthquake" if at_rest else "whether the dam stands is not known"
    )
    if not change and at_rest:
        assert found["residual"]["slip"] == pytest.approx(0.01, rel=1e-3)
    slides_on = change.get("slip") == 0.05
    assert ("the sliding does not slow down" in words) == slides_on == found["slides_on"]
    assert ("set a longer record_rest" in words) == (not at_rest and not slides_on)


@pytest.mark.parametrize(
    "law, broken, verdict, begin",
    [
        ("rupture", 1.0, "broken without friction", "law = rupture has no friction"),
        ("rupture", 0.6, "stands", "law = rupture has no friction"),
        ("rupture", 0.0, "stands", "residual slip"),
        ("bond", 1.0, "stands", "residual slip"),
    ],
)
def test_a_broken_joint_without_friction_is_said_first(law, broken, verdict, begin):
    case, found = values_of(2.0, law=law, broken=broken)
    found["after"] = {"equilibrium": True}
    words = quake_summary.statement(case, found)
    assert quake_summary.verdict(case, found) == verdict and words.startswith(begin)
    assert words.endswith("; the dam stands after the earthquake") == (verdict == "stands")


@pytest.mark.heavy
@pytest.mark.usefixtures("no_pictures")
def test_a_dam_that_flies_away_does_not_stand(command, case_file):
    """Broken by a law without friction; exit code 1, and the sentence is first."""
    weak = "--set", "law=rupture", "--set", "sigma_max=1e3", "--set", "G_f=1"
    code, out, _ = command("quake", case_file, *weak, "--set", "record_scale=2")
    assert code == 1
    assert out.startswith("my: law = rupture has no friction, and the joint has broken over 100%")
    info = json.loads(Path("out/my_quake/run.json").read_text())
    assert info["verdict"] in ("broken without friction", "no equilibrium")


@pytest.mark.heavy
@pytest.mark.usefixtures("no_pictures")
def test_notes_come_before_the_numbers(command, case_file):
    """Steps that do not resolve the first period; an offset of the record."""
    rows = read(smooth_record(Path("wave.csv"), 5.0, duration=0.5, frequency=4.0)).rows
    write_record(Path("wave.csv"), rows[:, 0], rows[:, 1] + 0.3)
    _, out, _ = command("quake", case_file, "--set", "dt=0.01", "--no-picture")
    assert [line.startswith("note: ") for line in out.splitlines()[:5]].count(True) == 2
    assert "the horizontal record leaves the ground with 0.15" in out
    assert "dt = 0.01 s is longer than a thirtieth of the first period, 0.00537 s" in out
    better = "--set", "record_baseline=corrected", "--set", "dt=0.005"
    assert "note: " not in command("quake", case_file, *better, "--no-picture")[1]


@pytest.mark.heavy
def test_a_joint_that_stays_closed_has_no_peak_of_its_opening(command, case_file, tmp_path):
    """Neither a value nor a picture of it; its water does not follow a crack."""
    weak = "--set", "record_scale=0.05", "--set", "required_SSF=1.2"
    code, out, _ = command("quake", case_file, *weak, "--no-picture")
    folder = tmp_path / "out" / "my_quake"
    found = json.loads((folder / "run.json").read_text())
    rows = np.genfromtxt(folder / "quake.csv", delimiter=",", names=True)
    for name in "heel_opening", "toe_opening":
        largest = found["quake"]["peaks"][name]["value"]
        assert largest == pytest.approx(rows[name].max()) and largest < 0
    assert code == 0 and out.count("closed") == 3  # and of the frequencies: joint closed
    case = load(
        "dam", DAM | {"record_rest": 0.5, "record_scale": 0.05}, "30", record=Path("wave.csv")
    )
    under_way = QuakeRun(case)
    for _ in under_way.steps():
        pass
    assert {name for name, _, _ in under_way.shapes()} == {"crest downstream", "crest upstream"}
    assert not any("--accuracy" in hint for hint in found["hints"])
    assert command("report", folder)[0] == 0
    page = Path("report.html").read_text()
    assert "Water pressure in the joint: as before the earthquake." in page
    assert "none of them halved" in page
    # nor is what is required of the static loads judged after the record
    assert (
        '<p class="fail lead">required_SSF: not judged in the state after the earthquake</p>'
        in page
    )
    assert 'class="verdict not-judged">not judged<' in page


def thrown(tmp_path, **settings):
    """A block on a ground that falls at 20 m/s2 for 0.05 s and is then stopped: its run, and the
    heights of its flights [m].
    """
    record = tmp_path / "pulse.csv"
    record.write_text(
        "time,ax,ay\n0,0,0\n0.001,0,-20\n0.05,0,-20\n0.051,0,20\n0.1,0,20\n0.101,0,0\n"
    )
    settings = BLOCK | {"record_rest": 0.2, "dt": 0.001} | settings
    under_way = QuakeRun(load("dam", settings, "0.001", record=record))
    for _ in under_way.steps():
        pass
    opening = under_way.history.table["heel_opening"]
    flights = np.split(opening, np.flatnonzero(np.diff(np.sign(opening))) + 1)
    heights = [flight.max() for flight in flights if flight.max() > 1e-4]
    return under_way, heights


@pytest.mark.heavy
@pytest.mark.parametrize("dt", [1e-3, 5e-4])
def test_an_impact_does_not_depend_on_the_step(tmp_path, dt):
    """A block that lands on an elastic joint rises as high as v^2/(2 g), also by steps of three
    quarters or a third of the period of its mass on K_N, which are halved there; unhalved it rises
    half as high, or higher (23.9 and 55.1 mm for 49.2 mm).
    """
    under_way, (_, second, *_) = thrown(tmp_path, dt=dt)
    quake, table = under_way.quake, under_way.history.table
    period = 2 * np.pi * np.sqrt(2400 * 2 / 1e11)
    (contact,) = quake.contacts.values()
    assert contact.period == pytest.approx(period) and contact.mass == pytest.approx(2400 * 16)
    opening, time = table["heel_opening"], table["time"]
    landing = np.flatnonzero((opening[:-1] > 1e-3) & (opening[1:] <= 1e-3))[0]
    speed = (opening[landing - 1] - opening[landing]) / (time[landing] - time[landing - 1])
    height = speed**2 / (2 * 9.81) + 1e-3
    assert second == pytest.approx(height, rel=0.04)
    flying = opening > 1e-3
    assert (table["dt"][flying] > 0.99 * dt).mean() > 0.9
    assert 10 * table["dt"].min() < period and len(time) < 1.08 * 0.3 / dt
    note = under_way.summary()["notes"][-1]
    assert "what is above the joint lifts off and lands again" in note and "steps" not in note
    (note,) = quake_summary.lift_offs(quake, table, False)
    assert f"(the mass above on K_N), {period:.3g} s, has {period / dt:.2g} steps, too" in note
    assert f"dt = {period / 10:.2g}" in note


def test_the_energy_that_a_step_adds_to_an_impact(tmp_path):
    """Of a block that leaves the joint or lands on it: the difference between the mean force times
    the displacement and what the springs store, over the kinetic energy of a step's slower end.
    """
    quake = earthquake(smooth_record(tmp_path / "r.csv", 1.0), BLOCK)
    (contact,), problem = quake.contacts.values(), quake.problem
    above = quake.case.graph.separated([0])
    up = quake.system.translation(contact.joint, above, contact.joint.chord.normal)
    up = up[problem.retained]

    def moving(opening, speed):
        motion = Motion(opening * up, speed * up, 0 * up)
        state = replace(problem.static, jump=opening * up[contact.jumps])
        return replace(problem.at_rest, state=state, retained=motion)

    closed, open_, stiffness = 1e-4, 2e-4, 1e11 * 8
    change = stiffness * closed * open_ / 2
    speed = np.sqrt(2 * change / MOST_CHANGE / contact.mass)
    for share, resolved in ((0.99, False), (1.01, True)):
        ends = moving(-closed, share * speed), moving(open_, 2 * speed)
        assert contact.resolved(*ends) == contact.resolved(*ends[::-1]) == resolved
    # closed at both ends, or open: no impact; nor in a fall of less than 0.01 mm of 45 m
    for opening in -closed, open_:
        assert contact.resolved(moving(opening, 0.0), moving(2 * opening, 0.0))
    assert contact.resolved(moving(-1e-9, 0.0), moving(1e-9, 0.0))


@pytest.mark.heavy
@pytest.mark.parametrize("order", [1, 2])
def test_frames_are_states_of_the_bodies_and_the_joint(command, case_file, tmp_path, order):
    """Files for ParaView at the times asked for; the gap between the bodies is that of the joint,
    at midpoints, too, the stress that of the displacement.
    """
    settings = "--set", "weight_first=0", "--set", f"order={order}"
    code, _, err = command("quake", case_file, "--fields", "0.1:0.4", *settings)
    assert code == 0, err
    folder = tmp_path / "out" / "my_quake"
    joint = np.genfromtxt(folder / "quake_joint.csv", delimiter=",", names=True)
    times = np.unique(joint["time"])
    assert times == pytest.approx([0, *np.arange(0.1, 0.4001, 0.005)])
    names = {path.name for path in (folder / "fields").iterdir()}
    parts = "dam", "foundation", "joint"
    assert {f"{part}_t{t:g}.vtu" for part in parts for t in times} < names
    listed = (folder / "fields" / "fields.pvd").read_text()
    steps = [float(text) for text in re.findall('timestep="(.*?)"', listed)]
    assert steps == pytest.approx(np.repeat(times, 3))
    for part in parts:  # a frame at 1 s is not the static state of t = 1
        (folder / f"fields/{part}_t0.1.vtu").rename(folder / f"fields/{part}_t1.vtu")
    assert not stored.read(folder).fields
    changed = {"weight_first": 0.0, "order": float(order)}
    case = load("dam", DAM | changed, "30", record=tmp_path / "wave.csv")
    under_way = QuakeRun(case)
    for _ in under_way.steps():
        pass
    result, space = under_way.result(), under_way.quake.system.spaces
    fields, bodies = result.fields(), result.mesh.bodies
    surface, worst = joint_of(under_way.quake).surface, 0.0
    for time in result.frames.history["time"][::10]:
        on_joint = Space(surface, order)
        gap = [
            everywhere(fields[time], name)[Space(bodies[name], order).find(on_joint)]
            for name in ("dam", "foundation")
        ]
        rows = result.frames.at(time)
        opening = (gap[0] - gap[1])[np.argsort(on_joint.locations[:, 0]), 1]
        assert opening == pytest.approx(rows["delta_n"], abs=1e-12)
        if order == 1:
            moved = fields[time].displacement["dam"][None, :, :2]
            expected = stress(space["dam"], moved, material_of(case))[0]
            assert fields[time].stress["dam"] == pytest.approx(expected, abs=1e-3)
        worst = max(worst, opening.max())
    assert worst > 1e-4
    assert len(result.frames.history["time"]) <= MOST_FRAMES


@pytest.mark.parametrize("steps", [10, 196, 197, 198, 4001, 20000])
@pytest.mark.parametrize("span", [(0.0, np.inf), (0.015, np.inf), (0.01, 0.05), (0.0, 1.97)])
def test_frames_are_at_most_200(steps, span):
    """The static state, every n-th step within the span, and the end if it is in the span."""
    times = np.add.accumulate(np.full(steps, 0.005))
    duration = 0.005 * steps
    interval = frame_interval(0.005, duration, span)
    frames = Frames(interval, span, None)
    chosen = np.array([time for time in times if frames.wanted(time, duration)])
    assert 1 + len(chosen) <= MOST_FRAMES
    first, last = max(span[0], interval), min(span[1], duration)
    count = np.floor(last / interval + 1e-6) - np.ceil(first / interval - 1e-6) + 1
    rest = last == duration and duration % interval > 1e-6 < interval - duration % interval
    assert len(chosen) == count + rest
    assert len(chosen) > min(90, count - 1)


@pytest.mark.heavy
def test_an_interrupted_run_continues_with_the_same_rows(command, case_file, tmp_path, monkeypatch):
    add, steps = QuakeHistory.add, []

    def interrupted(self, quake, step):
        if len(steps) == 60:
            steps.append(None)
            self.rows["time"].append(0.0)  # in the middle of a row
            raise KeyboardInterrupt
        add(self, quake, step)
        steps.append(step)

    monkeypatch.setattr(QuakeHistory, "add", interrupted)
    words = "quake", case_file, "--no-picture", "--out"
    code, _, err = command(*words, "one")
    assert code == 130 and "interrupted" in err
    info = json.loads((tmp_path / "one" / "run.json").read_text())
    assert info["state"] == "interrupted"
    before = (tmp_path / "one" / "quake.csv").read_text().splitlines()
    assert len(before) == 61
    assert command(*words, "one")[0] == 0
    number = len(steps) - 1
    monkeypatch.setattr(QuakeHistory, "add", add)
    assert command(*words, "two")[0] == 0
    one, two = ((tmp_path / n / "quake.csv").read_text() for n in ("one", "two"))
    assert one == two and one.splitlines()[:61] == before
    assert number == len(two.splitlines()) - 1


@pytest.mark.heavy
@pytest.mark.parametrize("other", ["case", "shape"])
def test_a_run_under_way_that_is_of_another_case_or_damaged_is_not_continued(
    command, case_file, monkeypatch, other
):
    """shape: a changed bit in the head of an array, which zip does not notice if less is read."""
    add = QuakeHistory.add

    def interrupted(self, quake, step):
        add(self, quake, step)
        raise KeyboardInterrupt

    monkeypatch.setattr(QuakeHistory, "add", interrupted)
    assert command("quake", case_file, *LONG_STEPS, "--out", "one")[0] == 130
    monkeypatch.setattr(QuakeHistory, "add", add)
    Path("one/my_quake.png").touch()  # of an earlier run
    changed = ["quake", case_file, "--no-picture", *LONG_STEPS]
    if other == "case":
        changed += ["--set", "mu=0.85"]
    else:
        file = Path("one/quake_state.npz")
        content = file.read_bytes()
        place = content.index(b"'shape': (", content.index(b"variable_1.npy")) + 10
        file.write_bytes(content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :])
    assert command(*changed, "--out", "one")[0] == command(*changed, "--out", "two")[0] == 0
    one, two = (Path(n, "quake.csv").read_text() for n in ("one", "two"))
    assert one == two and not Path("one/my_quake.png").exists()


@pytest.mark.heavy
@pytest.mark.usefixtures("no_pictures")
def test_a_sweep_of_earthquakes(command, case_file, tmp_path):
    """A row fails by its residual slip, that of the single run; rows are not computed again."""
    words = "sweep", case_file, "--vary", "record_scale=0.2,1", "--jobs", 1, *LONG_STEPS
    code, out, _ = command(*words, "--quake", "0.005")
    assert code == 0 and "2 rows computed" in out
    rows = list(csv.DictReader(Path("my_sweep.csv").read_text().splitlines()))
    small, large = sorted(rows, key=lambda row: float(row["record_scale"]))
    assert (small["verdict"], small["failed"]) == ("stands", "0")
    assert (large["verdict"], large["failed"]) == ("residual slip", "1")
    assert command("quake", case_file, "--no-picture", *LONG_STEPS)[0] == 0
    found = json.loads(Path("out/my_quake/run.json").read_text())["quake"]
    assert float(large["residual_slip"]) == pytest.approx(found["residual"]["slip"], rel=1e-9)
    peaks = [float(row["peak_ground_ax"]) for row in (small, large)]
    assert peaks[0] == pytest.approx(0.2 * peaks[1])
    assert "nothing to compute" in command(*words, "--quake", "0.005")[1]
    assert "2 rows computed" in command(*words, "--quake", "0.5")[1]
    code, _, err = command(*words, "--quake", "0")
    assert code == 2 and "--quake 0: must be a slip > 0 m" in err
    assert command("sweep", "dam", "--both-signs", "--vary", "mu=0.8")[0] == 2


@pytest.mark.heavy
@pytest.mark.usefixtures("no_pictures")
def test_the_fragility_of_a_block_is_that_of_newmarks_slips(command, tmp_path):
    """Two half sines, one of them in the format of PEER, each in both signs at three scales: the
    slips are the closed form, and so are the numbers beyond each limit. Rows of a sweep with
    further records are computed alone.
    """
    seconds = {"a.csv": 0.3, "b.AT2": 0.2}
    waves = {n: 5 * np.sin(np.pi * np.arange(0, t + 1e-9, 0.0025) / t) for n, t in seconds.items()}
    write_record(tmp_path / "a.csv", 0.0025 * np.arange(len(waves["a.csv"])), waves["a.csv"])
    head = ["PEER", "b", "ACCELERATION TIME SERIES IN UNITS OF G", f"NPTS= {len(waves['b.AT2'])},"]
    lines = [*head[:3], f"{head[3]} DT= .0025 SEC", *(f"{v / 9.80665:.9e}" for v in waves["b.AT2"])]
    (tmp_path / "b.AT2").write_text("\n".join(lines))
    words = ["sweep", "dam", *(w for n, v in BLOCK.items() for w in ("--set", f"{n}={v}"))]
    words += ["--levels", "0", "--set", "dt=0.0025", "--jobs", "1", "--both-signs"]
    words += ["--quake", "slip=0.01,slip=0.03", "--vary", "record_scale=0.9,1.4,2"]
    words += ["--out", "f.csv"]
    code, out, _ = command(*words, "--record", "a.csv")
    assert code == 0 and "6 rows computed" in out
    code, out, _ = command(*words, "--record", "a.csv", "--record", "b.AT2")
    assert code == 0 and "6 rows computed" in out
    rows = list(csv.DictReader((tmp_path / "f.csv").read_text().splitlines()))
    assert len(rows) == 12
    for row in rows:
        scale = float(row["record_scale"])
        peak, time = 5 * abs(scale), seconds[row["record"]]
        assert float(row["peak_ground_ax"]) == pytest.approx(peak, rel=1e-6)
        assert float(row["peak_ground_vx"]) == pytest.approx(2 * peak * time / np.pi, rel=1e-3)
        arias = np.pi / (2 * 9.80665) * peak**2 * time / 2
        assert float(row["arias_x"]) == pytest.approx(arias, rel=1e-3)
        slip = 0.0 if peak < 0.5 * G else -np.sign(scale) * half_sine_slip(peak, 0.5, time)
        assert float(row["residual_slip"]) == pytest.approx(slip, rel=2e-3, abs=2e-6)
        assert float(row["failed"]) == (abs(slip) > 0.01)
    table = list(csv.DictReader((tmp_path / "f_fragility.csv").read_text().splitlines()))
    assert [r["limit"] for r in table][:2] == ["residual slip > 10 mm", "residual slip > 30 mm"]
    numbers = [sum(abs(float(r["residual_slip"])) > v for r in rows) for v in (0.01, 0.03)]
    assert [float(r["exceed"]) for r in table] == [*numbers, 0]
    assert "no row exceeds it" in table[2]["reason"] and "Fragility, lognormal in peak_" in out
    assert command("report", "f.csv")[0] == 0
    page = (tmp_path / "report.html").read_text()
    for text in ("<td>0.9, 1.4, 2", "a.csv, b.AT2", "residual slip &gt; 30 mm", table[2]["reason"]):
        assert text in page, text
    assert "Joint law friction" in page
    (tmp_path / "f_fragility.csv").unlink()
    code, _, err = command("report", "f.csv", "--to", "other.html")
    assert code == 2 and "its fragility, f_fragility.csv" in err
    assert not (tmp_path / "other.html").exists()


def quake_rows(name, values, slips, verdicts):
    """Rows of a sweep of earthquakes."""
    return [
        {
            name: f"{value:g}",
            "residual_slip": "" if slip is None else f"{slip:g}",
            "residual_tilt": "" if slip is None else "1e-5",
            "rigid_block_slip": "0.01",
            "peak_ground_ax": "2",
            "failed": "0" if verdict == "stands" else "1",
            "verdict": verdict,
            "crack_length": "0",
            "max_opening": "0",
            "crest_ux": "1",
        }
        for value, slip, verdict in zip(values, slips, verdicts, strict=True)
    ]


def drawn_panels(monkeypatch, plan, rows):
    """The axes of a chart by the label of their vertical axis."""
    figures = []
    monkeypatch.setattr(chart, "write_picture", lambda figure, *_: figures.append(figure))
    case = load("dam")
    assert chart.draw(plan, rows, [case] * len(rows), "earthquakes", Path("chart.png")) == ""
    return {axes.get_ylabel(): axes for axes in figures[0].axes}


def test_the_chart_of_earthquakes_shows_their_slip(monkeypatch):
    """Also of the rows that fail by it; the limit; where a row has none a cross at the edge."""
    scales = [1.0, 2.0, 3.0]
    verdicts = ["stands", "residual slip", "not at rest"]
    rows = quake_rows("record_scale", scales, [-0.02, 0.08, None], verdicts)
    panels = drawn_panels(
        monkeypatch, Plan({"record_scale": scales}, {}, {}, "", Limits((0.05,))), rows
    )
    assert set(panels) == {
        "residual slip [mm]",
        "residual tilt [µrad]",
        "slip of a rigid block [mm]",
        "largest acceleration of the ground [m/s$^2$]",
    }
    lines = panels["residual slip [mm]"].lines
    good, crosses, edges = (line.get_ydata() for line in lines[:3])
    assert good[0] == pytest.approx(-20) and np.isnan(good[1:]).all()
    assert crosses == pytest.approx([80]) and len(edges) == 1
    limits = [line.get_ydata()[0] for line in lines if line.get_linestyle() == "--"]
    assert limits == pytest.approx([50, -50])
    small = quake_rows("record_scale", [1.0], [1e-9], ["stands"])
    plan = Plan({"record_scale": [1.0]}, {}, {}, "", Limits((0.05,)))
    assert "residual slip [mm]" in drawn_panels(monkeypatch, plan, small)  # the unit of the limit


def test_statistics_of_earthquakes_are_those_of_their_slip(monkeypatch):
    """The rank correlation is over all rows at rest; a dam that is not is undecided."""
    draws = [0.6, 0.7, 0.8, 0.9]
    slips, verdicts = [0.3, 0.2, 0.1, None], [*3 * ["residual slip"], "not at rest"]
    rows = quake_rows("mu", draws, slips, verdicts)
    plan = Plan({}, {"mu": draws}, {}, "", Limits((0.05,)))
    (row,) = outcome.sensitivities(plan, rows)
    assert row["residual_slip"] == pytest.approx(-1) and "max_opening" not in row
    (share,) = outcome.probabilities(plan, rows)
    assert (share["fail"], share["undecided"]) == (3, 1)
    panels = drawn_panels(monkeypatch, plan, rows)
    assert any("residual slip" in axes.get_title() for axes in panels.values())


def test_a_row_is_judged_by_its_slip_at_rest(monkeypatch):
    """Not at rest: by the slip at the end, or undecided."""
    case, found = values_of(2.0)
    found |= {"ground": dict.fromkeys(quake_summary.INTENSITIES, 2.0)}
    found |= {"after": {"equilibrium": True}, "peaks": {}}
    for name, value in (("heel_opening", 1e-3), ("toe_opening", -1e-3)):
        found["peaks"][name] = {"value": value}
    static = SimpleNamespace(results=lambda: SimpleNamespace(last={}))
    monkeypatch.setattr(sweep.quake, "outcome_of", lambda case: (static, found))
    judged = lambda *slips: sweep.quake_row(sweep.Task(case, False), Limits(slips, (0.002,)))
    assert (judged(0.05)["verdict"], judged(0.05)["failed"]) == ("stands", 0)
    assert judged(0.005)["verdict"] == "residual slip"
    assert judged(0.005)["residual_slip"] == pytest.approx(0.01, rel=1e-3)
    assert judged(0.05, 0.005)["verdict"] == "residual slip"
    assert judged(0.005)["peak_opening"] == 1e-3
    _, moving = values_of(2.0, slip=0.5)
    found |= moving
    row = judged(0.05)
    assert (row["verdict"], row["failed"], row["residual_slip"]) == ("not at rest", 1, "")
    assert "not at rest" in row["statement"] and "limit 50 mm" in row["statement"]
    assert judged(0.01)["verdict"] == "residual slip"
    found["peaks"]["heel_opening"]["value"] = 3e-3
    assert judged()["verdict"] == "opening"
    found["after"]["equilibrium"] = False
    assert judged(0.05)["verdict"] == "no equilibrium"
    assert {"not at rest", "broken without friction"} <= set(sweep.UNDECIDED)


@pytest.mark.parametrize(
    "options, message",
    [
        (["--set", "k_h=0.1"], "k_h = 0.1: must be 0 for damjoint quake"),
        (["--set", "record_unit=unstated"], "record_unit = unstated: must be m/s2 or g"),
        (["--set", "record_start=3"], "record_start = 3: must be >= 0 and < 0.5 s"),
        (["--set", "record_component=vertical"], "must have an acceleration other than zero"),
        (["--set", "hht_alpha=-0.5"], "hht_alpha = -0.5: must be"),
        (["--set", "dt=0"], "dt = 0: must be"),
        (["--set", "dt=7"], "dt = 7: must be <= 0.01 s, the shortest interval of"),
        (["--set", "dt=1e30"], "dt = 1e+30: must be <= 0.01 s"),
        (["--set", "record_rest=1e30"], "record_rest = 1e+30: must lead to at most 1000000 time"),
        (["--record", "/dev/zero"], "record = /dev/zero: must be a regular file"),
        (["--set", "rock_mass=1"], "rho_found = 0: must be > 0 with rock_mass = 1"),
        (["--set", "rock_mass=2"], "rock_mass = 2: must be one of 0, 1"),
        (
            ["--set", "rock_mass=1", "--set", "rho_found=2600", "--set", "dim=3"],
            "hold_z = 0: must be 1 with rock_mass = 1",
        ),
        (["--set", "drive=crest"], "drive = crest: must be level for damjoint quake"),
        (["--record", "nothing.csv"], "record = nothing.csv: No such file or directory"),
        (["--set", "record=wave.csv"], 'record: must be set in the case (record = "...";) or by'),
        (["--accuracy", "1%"], "unrecognized arguments: --accuracy 1%"),
        (["--fields", "2"], "--fields 2: must be two times FIRST:LAST"),
        (["--fields", "2:1"], "--fields 2:1: must be two times FIRST:LAST"),
        (["--fields", "3:4"], "fields = 3:4: must begin before the end of the record, 1 s"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(refused, case_file, options, message):
    assert message in refused("quake", case_file, *options)


@pytest.mark.heavy
def test_a_dam_without_static_equilibrium_is_a_failed_run(command, case_file):
    code, _, err = command("quake", case_file, "--set", "mu=0.2")
    assert code == 1 and "static loads have no equilibrium" in err
    assert json.loads(Path("out/my_quake/run.json").read_text())["state"] == "failed"


@pytest.mark.heavy
def test_bases_speak_for_the_dam_and_the_map_names_its_joint(tmp_path):
    """A contraction joint has no rigid block, its forces are not drawn; the notes are."""
    smooth_record(tmp_path / "r.csv", 2.0, duration=0.4)
    settings = {"record_unit": "m/s2", "record_rest": 0.1, "n_joint": 6.0, "h_dam": 20.0}
    case = dj.case("monoliths", **settings)
    result = dj.quake(case, record=tmp_path / "r.csv").tables
    contraction = len(result.joints)
    assert f"rigid_block_{contraction}" not in result.summary["residual"]
    assert "rigid_block" in result.summary["residual"]
    slips = [abs(result.summary["end"][quake_summary.column_of("slip", k)]) for k in result.joints]
    assert result.joint == np.argmax(slips[:-1])
    peaks, joints = quake_result.text(case, result.summary, 80).split("\n\n")[1:]
    assert max(map(len, [*peaks.splitlines(), *joints.splitlines()])) <= 80
    assert [line.split("  ")[0] for line in joints.splitlines()[-3:]] == [*case.joint_names]
    result.summary["notes"].append("what follows is not reliable")
    figure = quake_picture.figure(result)
    texts = [text.get_text() for text in figure.findobj(Text)]
    shapes = [axes for axes in figure.axes if not axes.axison]
    assert shapes  # a report cuts the picture above them, not below their titles
    figure.canvas.draw()
    for axes in shapes:
        assert axes.title.get_window_extent().y1 <= axes.get_window_extent().y0
    assert not [text for text in texts if re.match("N', contraction|T, contraction", text)]
    assert "stress along upstream base" in texts and "s from heel [m]" in texts
    assert any(text.endswith("note: what follows is not reliable") for text in texts)
