"""The equations of all unknowns of an earthquake at each step, and its energies.

From the matrices of the bodies and the laws of the joints, without the factors, the condensation
and the strategies by which the steps are solved.
"""

from __future__ import annotations

import numpy as np
from damjoint.arrays import Array, Sparse
from damjoint.dynamics.published import with_corner_dashpots
from damjoint.dynamics.step import Moving, lift
from damjoint.dynamics.stepper import Earthquake
from damjoint.dynamics.uplift import pressures_in_motion
from damjoint.fem.factor import single_thread
from damjoint.input.case import Case
from damjoint.studies.quake import QuakeRun

#: Tolerance of the residual, relative to the static loads: a step has 1e-9.
RESIDUAL_TOLERANCE = 1e-8
#: Tolerance of the balance of energy, relative to its largest part.
ENERGY_TOLERANCE = 1e-8


def joint_forces(quake: Earthquake, begin: Moving, end: Moving) -> Array:
    """Return the nodal forces (j,) of laws and dashpots in the joints at the end of a step."""
    problem, jumps = quake.problem, quake.system.jumps
    equilibrium = problem.model.equilibrium
    interface, state = equilibrium.interface, end.state

    def at_points(jump: Array) -> Array:
        return interface.jumps(interface.at_points, jump)

    traction, _ = equilibrium.laws.evaluate(at_points(state.jump), state.variables)
    if not quake.published and end is not begin:
        closed = at_points(begin.state.jump)[:, :1] <= 0
        traction = traction + problem.dashpots * closed * at_points(end.motion.velocity[jumps])
    return interface.forces(traction)


def damping_matrix(quake: Earthquake, begin: Moving) -> Sparse:
    """Return the damping matrix (n, n) of a step."""
    problem = quake.problem
    return (with_corner_dashpots(problem, begin.state) if quake.published else problem).damping


def measures(case: Case) -> dict[str, float]:
    """Follow an earthquake and return: the largest `residual` of its equations, relative to the
    static loads; the share of the energy that the time integration takes as `lost`, the work of the
    ground less kinetic and strain energy and the work on damping and joints; the largest `rise` of
    the energy in a step in which the ground is at rest.
    """
    with single_thread():
        quake = QuakeRun(case).quake
        return follow(quake)


def follow(quake: Earthquake) -> dict[str, float]:
    """See `measures`."""
    system, problem, scheme = quake.system, quake.problem, quake.problem.scheme
    equilibrium, alpha = problem.model.equilibrium, scheme.shift
    begin, jumps = quake.now, system.jumps
    static = joint_forces(quake, begin, begin) - lift(equilibrium, problem.static.pressures)
    # since the static state: forces of the joints, of all but inertia, and of the ground
    joint, forces, load = np.zeros(len(static)), np.zeros(system.size), quake.load(0.0)
    viscous, worst, given, rise = np.zeros(system.size), 0.0, 0.0, 0.0
    energies = [np.zeros(4)]
    for step in quake.steps():
        end, damping = step.end, damping_matrix(quake, begin)
        motion, moved = end.motion, end.motion.displacement - begin.motion.displacement
        joint_before, forces_before, load_before = joint, forces, load
        water = pressures_in_motion(quake.case, problem, begin.state)
        joint = joint_forces(quake, begin, end) - lift(equilibrium, water) - static
        viscous_before, viscous = viscous, damping @ motion.velocity
        elastic = system.stiffness @ motion.displacement
        forces, load = elastic + viscous, quake.load(end.time)
        forces[jumps] += joint
        inertia = system.mass @ motion.acceleration
        residual = inertia + (1 + alpha) * (forces - load) - alpha * (forces_before - load_before)
        worst = max(worst, float(np.linalg.norm(residual)))
        given += float(moved @ (load + load_before)) / 2
        lost = moved @ (viscous + viscous_before) / 2
        on_joint = moved[jumps] @ (joint + joint_before) / 2
        kinetic = motion.velocity @ (system.mass @ motion.velocity) / 2
        strain = motion.displacement @ elastic / 2
        _, _, of_joint, of_damping = energies[-1]
        energies.append(np.array([kinetic, strain, of_joint + on_joint, of_damping + lost]))
        if not load.any() and not load_before.any():
            rise = max(rise, float(np.sum((energies[-1] - energies[-2])[:3])))
        begin = end
    parts = np.array(energies)
    return {
        "residual": worst / problem.model.reference,
        "lost": float((given - parts[-1].sum()) / np.abs(parts).max()),
        "rise": rise / float(np.abs(parts).max()),
    }
