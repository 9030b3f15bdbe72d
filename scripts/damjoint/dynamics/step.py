"""A time step of a given length: everything but the joints is linear and factorised once.

With w1 the end of a step, A w1 + (1 + alpha) g(d1) = r + alpha g(d0), A = M / (beta dt^2) +
(1 + alpha) (K + gamma / (beta dt) C), r from the motion before the step, and g the change of the
joints' forces since the static state. Reduced to the jumps (fem/factor.py), divided by 1 + alpha,

    S d1 + (joint forces) = loads,

an equilibrium of the same form as the static one: solved by the same model, laws and strategies.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Array, Sparse
from ..fem.condensed import Condensed
from ..fem.factor import partial_factors
from ..joint.equilibrium import Equilibrium
from ..joint.interface import Interface
from ..joint.joint_laws import TANGENT, JointLaws, JointVariables, Mode
from ..joint.water import BeforeQuake, Pressure
from ..model.loads import Loading
from ..solver.controls import LevelControl
from ..solver.model import Model, StepResult
from ..solver.state import State
from .scheme import HHT, Motion
from .small_joints import MOST_UNKNOWNS, SmallInterface
from .system import System


class DampedLaws(JointLaws):
    """The laws of the joints with dashpots beside them at closed points: traction c d'."""

    def __init__(self, laws: JointLaws, coefficients: Array, rate: float) -> None:
        """coefficients: c of a closed point, normal and tangential (3,) [Pa s/m]; rate: of the
        velocity with the displacement at the end of a step [1/s].
        """
        super().__init__(laws.laws)
        self.coefficients, self.rate = coefficients, rate
        #: of the step under way: c of each point (q, 3), and the jump (q, 3) at which the
        #: velocity at the end of the step is zero
        self.active, self.resting = np.zeros((0, 3)), np.zeros((0, 3))

    def begin(self, before: Array, resting: Array) -> None:
        """Begin a step from jumps (q, 3)."""
        self.active = self.coefficients * (before[:, :1] <= 0)
        self.resting = resting

    def undamaged_tangent(self, points: list[int]) -> Array:  # type: ignore[override]
        """See `JointLaws`: with all dashpots."""
        return super().undamaged_tangent(points) + np.diag(self.rate * self.coefficients)

    def evaluate(
        self, jump: Array, variables: JointVariables, mode: Mode = TANGENT
    ) -> tuple[Array, Array]:
        """See `JointLaws`."""
        traction, tangent = super().evaluate(jump, variables, mode)
        return self.with_dashpots(jump, traction), tangent + self._stiffness()

    def secant_stiffness(self, jump: Array, variables: JointVariables) -> Array:
        """See `JointLaws`."""
        return super().secant_stiffness(jump, variables) + self._stiffness()

    def with_dashpots(self, jump: Array, traction: Array) -> Array:
        """A traction with that of the dashpots (q, 3)."""
        return traction + self.rate * self.active * (jump - self.resting)

    def _stiffness(self) -> Array:
        """Derivative of the dashpots' traction (q, 3, 3)."""
        return (self.rate * self.active)[:, :, None] * np.eye(3)


class DynamicEquilibrium(Equilibrium):
    """The equilibrium of the jumps in time steps of one length; its loads are those passed as
    `frozen_lift`.
    """

    def __init__(self, static: Equilibrium, stiffness: Array) -> None:
        """stiffness: S (j, j)."""
        vars(self).update(vars(static))
        bulk = replace(static.bulk, stiffness=stiffness)
        small = len(stiffness) <= MOST_UNKNOWNS
        around = SmallInterface if small else with_bulk
        self.interface, self.bulk = around(static.interface, bulk), bulk
        self.flowing = ()
        self.loads = lambda _loading: np.zeros(len(stiffness))  # type: ignore[assignment]
        #: of the step under way
        self.pressure: tuple[Pressure, ...] = ()

    def pressures(
        self,
        jump: Array,
        variables: JointVariables,
        loading: Loading,
        before_quake: BeforeQuake | None = None,
    ) -> tuple[Pressure, ...]:
        """The water pressure in each joint, which does not change within a step."""
        return self.pressure


def with_bulk(interface: Interface, bulk: Condensed) -> Interface:
    """The same joints with other bodies around them."""
    other = copy(interface)
    vars(other).update(bulk=bulk, _undamaged=None)
    return other


@dataclass(frozen=True, kw_only=True)
class Moving:
    """The dam after a time step."""

    time: float
    state: State
    motion: Motion
    #: g: change of the joints' nodal forces, dashpots and water included, since the static state
    forces: Array


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

    @property
    def at_rest(self) -> Moving:
        """The static state."""
        forces = np.zeros(len(self.system.jumps))
        return Moving(
            time=0.0, state=self.static, motion=Motion.at_rest(self.system.size), forces=forces
        )


class TimeStep:
    """Steps of one length dt."""

    def __init__(self, problem: Problem, dt: float) -> None:
        self.problem, self.dt = problem, dt
        system, scheme, model = problem.system, problem.scheme, problem.model
        velocity, acceleration = scheme.rates(dt)
        #: 1 + alpha
        self.weight = weight = 1 + scheme.shift
        matrix = acceleration * system.mass + weight * (
            system.stiffness + velocity * problem.damping
        )
        self.factors = partial_factors(matrix.tocsr(), system.jumps)
        self.stiffness = self.factors.schur / weight
        equilibrium = DynamicEquilibrium(model.equilibrium, self.stiffness)
        self.laws = None
        if problem.dashpots.any():
            laws = DampedLaws(equilibrium.laws, problem.dashpots, velocity)
            points = [len(joint.points.weights) for joint in equilibrium.interface.joints]
            equilibrium.laws, equilibrium.undamaged = laws, laws.undamaged_tangent(points)
            self.laws = laws
        self.equilibrium = equilibrium
        self.model = copy(model)
        self.model.equilibrium = equilibrium
        #: nodal forces of the joints in the static state (j,)
        self.at_static = self.joint_forces(problem.static)

    def joint_forces(self, state: State) -> Array:
        """Nodal forces of the joints (j,), without dashpots, at a state."""
        interface = self.equilibrium.interface
        at_points = interface.jumps(interface.at_points, state.jump)
        traction, _ = JointLaws.evaluate(self.equilibrium.laws, at_points, state.variables)
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
        constant in the step; persist: whether further strategies follow the first. Raises Diverged.
        """
        problem, dt = self.problem, self.dt
        system, scheme, motion = problem.system, problem.scheme, begin.motion
        alpha, weight, static = scheme.shift, self.weight, problem.static
        of_velocity, of_acceleration = scheme.history(motion, dt)
        right = system.mass @ of_acceleration
        if problem.damping.nnz:
            right += problem.damping @ (weight * of_velocity + alpha * motion.velocity)
        if alpha:
            right += alpha * (system.stiffness @ motion.displacement)
        right += weight * loads[1] - alpha * loads[0]
        right[system.jumps] += alpha * begin.forces
        lifted = lift(self.equilibrium, pressure)
        on_jumps = self.factors.reduce(right) / weight + self.stiffness @ static.jump
        on_jumps += self.at_static + lifted

        equilibrium, interface = self.equilibrium, self.equilibrium.interface
        equilibrium.pressure = pressure
        now, jumps = begin.state, system.jumps
        if self.laws:
            before = interface.jumps(interface.at_points, now.jump)
            resting = static.jump + of_velocity[jumps] / self.laws.rate
            self.laws.begin(before, interface.jumps(interface.at_points, resting))
        ahead = now.jump + dt * motion.velocity[jumps]
        variables = now.begin_step(equilibrium.laws, now.time).variables

        def size(jump: Array) -> float:
            value = equilibrium.residual(jump, variables, now.loading, frozen_lift=on_jumps).value
            return float(np.linalg.norm(value))

        guess = min(now.jump, ahead, key=size)
        first = self.model.strategies[0]
        # where points stick and slip one after the other, only a descent of the residual ends
        quick = first, replace(first, growth=1.0)
        step = self.model.advance(
            now,
            now.time,
            LevelControl(now.loading.level),
            strategies=self.model.strategies if persist else quick,
            guess=(guess, now.loading.level),
            frozen_lift=on_jumps,
        )
        if step is None:
            return None
        state = step.state
        at_points = interface.jumps(interface.at_points, state.jump)
        traction, _ = equilibrium.laws.evaluate(at_points, variables)
        forces = interface.forces(traction) - lifted - self.at_static
        displacement = self.factors.expand(state.jump - static.jump)
        end = Moving(
            time=begin.time + dt,
            state=state,
            motion=scheme.step(motion, displacement, dt),
            forces=forces,
        )
        return end, step


def lift(equilibrium: Equilibrium, pressure: tuple[Pressure, ...]) -> Array:
    """Nodal forces (j,) of the water pressure in the joints."""
    parts = (
        water.force(own.water_points)
        for water, own in zip(equilibrium.water, pressure, strict=True)
    )
    return sum(parts, np.zeros(len(equilibrium.bulk.stiffness)))
