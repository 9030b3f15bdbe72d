"""A time step of a given length: everything but the joints is linear and factorised once.

With w1 the end of a step, A w1 + (1 + alpha) g(d1) = r + alpha g(d0), A = M / (beta dt^2) +
(1 + alpha) (K + gamma / (beta dt) C), r from the motion before the step, and g the change of the
joints' forces since the static state. Reduced to the jumps (fem/factor.py), divided by 1 + alpha,

    S d1 + (joint forces) = loads,

the equation of joint/problem.py, solved by the same laws and strategies as at rest.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..arrays import Array, IntArray, Sparse
from ..fem.factor import partial_factors
from ..joint.equilibrium import Equilibrium
from ..joint.flow_in_time import TimeStep as WaterStep
from ..joint.joint_laws import JointVariables
from ..joint.linear_system import many_systems
from ..joint.problem import Dashpots, JointProblem
from ..joint.step_water import StepWater
from ..joint.water import Pressure
from ..solver.model import Model, StepResult
from ..solver.newton import NotConverged
from ..solver.state import State, StepLaws
from ..solver.step import Plan, Start, solve
from .massless import MasslessRock
from .scheme import HHT, Motion
from .system import System


@dataclass(frozen=True, kw_only=True)
class Moving:
    """The dam after a time step."""

    time: float
    state: State
    #: of the unknowns of the steps, see `Problem.retained`
    retained: Motion
    #: g: change of the joints' nodal forces, dashpots and water included, since the static state
    forces: Array
    #: what follows them
    rock: MasslessRock | None = None

    @property
    def motion(self) -> Motion:
        """Of all unknowns (n,)."""
        retained = self.retained
        if not self.rock:
            return retained
        parts = retained.displacement, retained.velocity, retained.acceleration
        return Motion(*map(self.rock.expand, parts))


@dataclass(frozen=True, kw_only=True)
class Problem:
    """What does not depend on the length of the steps."""

    model: Model
    static: State
    system: System
    scheme: HHT
    damping: Sparse
    #: of the joints' dashpots, normal and tangential (3,) [Pa s/m]
    dashpots: Array
    #: whether the water in the joints flows in the steps: quake_uplift = transient
    transient: bool = False
    #: that follows the bodies on it; None: it is eliminated in each step
    rock: MasslessRock | None = None

    @cached_property
    def retained(self) -> IntArray:
        """The unknowns of the steps (k,), of all (n,): without the rock that follows them."""
        return self.rock.retained if self.rock else np.arange(self.system.size)

    @cached_property
    def crest(self) -> Sparse:
        """Displacement of the crest along x and y (2, k)."""
        return self.system.crest[:, self.retained]

    def whole(self, retained: Array) -> Array:
        """The displacement of all unknowns (n, ...) from that of `retained` (k, ...)."""
        return self.rock.expand(retained) if self.rock else retained

    @property
    def at_rest(self) -> Moving:
        """The static state."""
        return Moving(
            time=0.0,
            state=self.static,
            retained=Motion.at_rest(len(self.retained)),
            forces=np.zeros(len(self.system.jumps)),
            rock=self.rock,
        )


class TimeStep:
    """Steps of one length dt."""

    def __init__(self, problem: Problem, dt: float) -> None:
        self.problem, self.dt = problem, dt
        system, scheme = problem.system, problem.scheme
        #: derivatives of velocity [1/s] and acceleration [1/s2] at the end with the displacement
        self.rate, acceleration = scheme.rates(dt)
        #: 1 + alpha
        self.weight = weight = 1 + scheme.shift
        matrices, rock = (system.mass, system.stiffness, problem.damping), problem.rock
        #: mass, stiffness and damping of the unknowns of the steps (k, k), and the jumps among them
        self.mass, self.of_bodies, self.damping = map(rock.reduce, matrices) if rock else matrices
        self.jumps = np.searchsorted(problem.retained, system.jumps)
        matrix = acceleration * self.mass + weight * (self.of_bodies + self.rate * self.damping)
        # with the published dashpots the matrix is another one in each step
        many = scheme.weighted or not problem.dashpots.any()
        self.factors = partial_factors(matrix.tocsr(), self.jumps, many)
        #: S (j, j)
        self.stiffness = self.factors.schur / weight
        self.equilibrium = problem.model.equilibrium
        all_closed = np.diag(self.rate * problem.dashpots)
        self.linear_system = many_systems(
            self.equilibrium.interface.assembly,
            self.stiffness,
            self.equilibrium.undamaged + all_closed,
        )
        #: nodal forces of the joints in the static state (j,)
        self.at_static = self.joint_forces(problem.static)

    def joint_forces(self, state: State) -> Array:
        """Nodal forces of the joints (j,), without dashpots, at a state."""
        interface = self.equilibrium.interface
        at_points = interface.jumps(interface.at_points, state.jump)
        traction, _ = self.equilibrium.laws.evaluate(at_points, state.variables)
        return interface.forces(traction) - lift(self.equilibrium, state.pressures)

    def advance(
        self,
        begin: Moving,
        loads: tuple[Array, Array],
        pressure: tuple[Pressure, ...],
        persist: bool,
    ) -> tuple[Moving, StepResult] | None:
        """A step from a state, None if it does not converge.

        loads: of the earthquake on the unknowns (n,) at begin and end; pressure: in the joints,
        constant in the step; persist: whether further strategies follow the first, also after one
        that has diverged.
        """
        equilibrium, model = self.equilibrium, self.problem.model
        now, loading = begin.state, begin.state.loading
        start = now.begin_step(equilibrium.laws, now.time)
        water = self.water_in_time(now, start.variables) if self.problem.transient else None
        lifted = lift(equilibrium, pressure)
        loaded = self.on_jumps(begin, loads, lifted)
        joints = self.joint_problem(begin, start.variables, loaded)
        ahead = now.jump + self.dt * begin.retained.velocity[self.jumps]
        both = ((jump, joints.residual(jump, loading)) for jump in (now.jump, ahead))
        guess, residual = min(both, key=lambda pair: float(np.linalg.norm(pair[1].value)))
        if water:  # that follows the jumps: only the choice of the start is by the pressures so far
            constant = loaded - lifted + lift(equilibrium, pressure, water)
            joints = replace(joints, constant=constant, water=water)
            residual = joints.residual(guess, loading)
        strategies = model.strategies
        if not persist:  # where points stick and slip by turns, only a descent of the residual ends
            strategies = strategies[0], replace(strategies[0], growth=1.0)
        starts = [Start(strategy, guess, loading.level, residual) for strategy in strategies]
        try:
            solution = solve(joints, loading, Plan(starts, model.convergence, persist))
        except NotConverged as error:
            model.end_of_solution = str(error)
            return None
        laws = StepLaws(equilibrium.laws, equilibrium.laws)
        state = start.update(equilibrium.interface, laws, solution.jump)
        if water:
            time = begin.time + self.dt
            pressure = water.pressures(solution.jump, loading)
            stored = water.stored(solution.jump, loading, time)
            state = replace(state, stored=tuple(replace(s, begin=None) for s in stored))
            lifted = lift(equilibrium, pressure)
        state = replace(state, pressures=pressure).after(now).traced(now, False)
        size = solution.size / (model.reference or 1.0)
        step = StepResult(state, solution.iterations, size, solution.criterion)
        return self.moved(begin, state, joints, lifted), step

    def water_in_time(self, begin: State, variables: JointVariables) -> StepWater:
        """The water that flows in the step and is solved together with the jumps."""
        steps = (WaterStep(seconds=self.dt, begin=stored) for stored in begin.stored)
        return self.equilibrium.water_in_step(variables, steps=tuple(steps))

    def on_jumps(self, begin: Moving, loads: tuple[Array, Array], lifted: Array) -> Array:
        """The loads (j,) of a step, see `advance`; lifted: of the water in the joints."""
        problem, motion, static = self.problem, begin.retained, self.problem.static
        alpha, weight = problem.scheme.shift, self.weight
        load = (weight * loads[1] - alpha * loads[0])[problem.retained]
        of_velocity, of_acceleration = problem.scheme.history(motion, self.dt)
        right = self.mass @ of_acceleration
        if self.damping.nnz:
            right += self.damping @ (weight * of_velocity + alpha * motion.velocity)
        if alpha:
            right += alpha * (self.of_bodies @ motion.displacement)
        right += load
        right[self.jumps] += alpha * begin.forces
        on_jumps = self.factors.reduce(right) / weight + self.stiffness @ static.jump
        on_jumps += self.at_static + lifted
        return on_jumps

    def joint_problem(
        self, begin: Moving, variables: JointVariables, constant: Array
    ) -> JointProblem:
        """The joints at the end of a step: internal variables of its beginning, and loads (j,)."""
        equilibrium = self.equilibrium
        return JointProblem(
            interface=equilibrium.interface,
            stiffness=self.stiffness,
            system=self.linear_system,
            laws=equilibrium.laws,
            variables=variables,
            constant=constant,
            dashpots=self.dashpots(begin) if self.problem.dashpots.any() else None,
        )

    def dashpots(self, begin: Moving) -> Dashpots:
        """The dashpots of the points that are closed when a step begins."""
        interface = self.equilibrium.interface
        of_velocity, _ = self.problem.scheme.history(begin.retained, self.dt)
        resting = self.problem.static.jump + of_velocity[self.jumps] / self.rate
        before, at_rest = (
            interface.jumps(interface.at_points, jump) for jump in (begin.state.jump, resting)
        )
        return Dashpots(self.rate * (self.problem.dashpots * (before[:, :1] <= 0)), at_rest)

    def moved(self, begin: Moving, state: State, joints: JointProblem, lifted: Array) -> Moving:
        """The dam after a step to a state, by the problem that has led to it."""
        traction = joints.traction(state.jump)
        displacement = self.factors.expand(state.jump - self.problem.static.jump)
        return replace(
            begin,
            time=begin.time + self.dt,
            state=state,
            retained=self.problem.scheme.step(begin.retained, displacement, self.dt),
            forces=self.equilibrium.interface.forces(traction) - lifted - self.at_static,
        )


def lift(
    equilibrium: Equilibrium, pressure: tuple[Pressure, ...], without: StepWater | None = None
) -> Array:
    """Nodal forces (j,) of the water pressure in the joints; without: those where it flows."""
    parts = (
        water.force(of_joint.water_points)
        for water, of_joint in zip(equilibrium.water, pressure, strict=True)
        if not (without and water.system in without.flowing)
    )
    return sum(parts, np.zeros(equilibrium.bulk.size))
