"""The dam through a record: steps of the prescribed length, halved where they do not converge or do
not resolve an impact.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from .. import RunError
from ..arrays import Array, Sparse
from ..fem.bodies import Bodies
from ..input.case import Case
from ..solver.model import LARGEST_JUMP, Model
from ..solver.state import State
from . import absorbing
from .absorbing import AbsorbingRock, travel_time
from .impact import Contact
from .massless import MasslessRock
from .published import with_corner_dashpots
from .record import Record
from .scheme import HHT
from .step import Moving, Problem, TimeStep
from .system import System
from .uplift import pressures_in_motion

#: How often a step can be halved.
MOST_HALVINGS = 10

#: Values of damping_mass.
WITHOUT, OF_CONCRETE, WITH_WATER = range(3)


@dataclass(frozen=True)
class Damping:
    """Rayleigh's damping a0 M + a1 K of the bodies, a0 = 0 without its mass part; M is that of the
    concrete or, if required, also of the added water.
    """

    #: the two frequencies [Hz], and the coefficients [1/s], [s]
    first: float
    second: float
    a0: float
    a1: float
    with_water: bool = False

    @staticmethod
    def of(case: Case, frequencies: Array) -> Damping:
        """The damping of a case, by default at the first and third natural frequency."""
        ends = (case["damping_f1"], frequencies[0]), (case["damping_f2"], frequencies[-1])
        f1, f2 = (float(natural if given == -1 else given) for given, natural in ends)
        w1, w2 = 2 * math.pi * f1, 2 * math.pi * f2
        a1 = 2 * case["damping"] / (w1 + w2)
        a0 = a1 * w1 * w2 if case["damping_mass"] != WITHOUT else 0.0
        return Damping(f1, f2, a0, a1, case["damping_mass"] == WITH_WATER)

    def matrix(self, system: System) -> Sparse:
        """The damping (n, n) of a system's mass and stiffness."""
        return self.a0 * (system.mass if self.with_water else system.solid) + (
            self.a1 * system.stiffness
        )


@dataclass(frozen=True)
class Mode:
    """A natural mode, undamped: with undamaged joints, the water's mass and massless rock."""

    #: [Hz]
    frequency: float
    #: damping ratio
    damping: float
    #: effective modal masses along x and y, over the whole mass
    along_x: float
    along_y: float

    @staticmethod
    def of(system: System, damping: Damping, frequencies: Array, shapes: Array) -> list[Mode]:
        """The modes of frequencies (k,) [Hz] and shapes (n, k)."""
        masses = np.einsum("nk,nk->k", shapes, system.mass @ shapes)
        damped = np.einsum("nk,nk->k", shapes, damping.matrix(system) @ shapes)
        ratios = damped / (4 * math.pi * frequencies * masses)
        shares = (shapes.T @ system.inertia) ** 2 / masses[:, None] / system.total
        values = np.column_stack([frequencies, ratios, shares])
        return [Mode(*map(float, row)) for row in values]


@dataclass(frozen=True)
class Converged:
    """A converged time step."""

    end: Moving
    #: acceleration of the ground (2,) at its end [m/s2]
    ground: Array
    dt: float
    iterations: int
    #: norm of the out-of-balance forces over that of the static loads
    residual: float


def with_stored_water(model: Model, static: State) -> State:
    """A static state with what is stored in its joints, from where time counts anew."""
    flowing = model.equilibrium.flowing
    stored = static.stored or tuple(
        system.stored_at(static.jump, static.variables, static.loading, 0.0) for system in flowing
    )
    return replace(static, stored=tuple(replace(s, time=0.0, begin=None) for s in stored))


#: Number of natural frequencies that are computed.
FREQUENCIES = 3


class Earthquake:
    """The time steps of a case from a static state on."""

    def __init__(self, case: Case, model: Model, static: State, bodies: Bodies) -> None:
        """model, static: of the static loads, and their last state; bodies: of the case.

        Raises InputError.
        """
        absorbing.check(case)
        self.case, self.bodies, self.record = case, bodies, Record.of(case)
        self.published = case["time_integration"] == "published"
        interface = model.equilibrium.interface
        massless = case.with_values({"rock_mass": 0.0})
        self.system = system = System.of(massless, bodies, interface)
        undamaged = model.equilibrium.undamaged
        of_joints = interface.assembly.whole(undamaged)
        #: natural frequencies [Hz] with undamaged joints, the water's mass and massless rock
        self.frequencies, shapes = system.frequencies(of_joints, FREQUENCIES)
        self.damping = Damping.of(case, self.frequencies)
        self.modes = Mode.of(system, self.damping, self.frequencies, shapes)
        normal, tangential = case["joint_damping_n"], case["joint_damping_t"]
        damping = self.damping.matrix(system)
        #: the rock, if it has mass
        self.rock: AbsorbingRock | None = None
        if case["rock_mass"]:
            self.record = self.record.delayed(travel_time(case, self.record.interval))
            self.system = system = System.of(case, bodies, interface)
            self.rock = rock = AbsorbingRock.of(case, bodies, system.motion, self.record)
            of_dam = replace(
                system,
                mass=system.mass - rock.mass,
                solid=system.solid - rock.mass,
                stiffness=system.stiffness - rock.stiffness,
            )
            damping = self.damping.matrix(of_dam) + rock.dashpots
        transient = case["quake_uplift"] == "transient"
        if transient:
            static = with_stored_water(model, static)
        self.problem = Problem(
            transient=transient,
            model=model,
            static=static,
            system=system,
            scheme=HHT(case["hht_alpha"], weighted=not self.published),
            damping=damping,
            # (the published dashpots change the matrices in each step)
            rock=None if self.published else MasslessRock.of(system, damping),
            dashpots=np.array([normal, tangential, tangential]),
        )
        #: longest step [s]
        self.dt = self.record.time_step(case)
        #: difference below which two times are the same [s]: half of the shortest step, above what
        #: the rounding of many steps adds up to
        self.same_time = self.dt / 2 ** (MOST_HALVINGS + 1)
        #: of the joints that part what is above them from the rest, by their numbers
        self.contacts = {
            number: contact
            for number in range(len(case.joints))
            if (contact := Contact.of(self.problem, case, number))
        }
        self.now = self.problem.at_rest
        self.steps_of_length: dict[int, TimeStep] = {}

    @property
    def finished(self) -> bool:
        """Whether the record has ended."""
        return self.now.time >= self.record.duration - self.same_time

    @property
    def halvings(self) -> int:
        """How often the shortest step so far was halved."""
        return max(self.steps_of_length, default=0)

    def load(self, time: float) -> Array:
        """External forces of the earthquake (n,) at a time."""
        load: Array = -self.system.inertia @ self.record.at(time)
        return load + self.rock.load(time) if self.rock else load

    def steps(self) -> Iterator[Converged]:
        """Follow the record from the last state to its end, and yield each converged step.

        Raises RunError where none converges, however short.
        """
        while not self.finished:
            # a whole number of steps from the start: an interrupted run has the same ones
            number = math.floor((self.now.time + self.same_time) / self.dt) + 1
            yield from self._steps_to(number * self.dt, 0)

    def _steps_to(self, end: float, halvings: int) -> Iterator[Converged]:
        """The steps up to a time, of the length dt / 2^halvings or shorter."""
        length = self.dt / 2**halvings
        remains = end - self.now.time
        if remains < length - self.same_time:  # the rest of an interrupted step
            if remains > self.same_time:
                yield from self._halves(end, halvings)
            return
        step = self._step(length, halvings)
        if step:
            self.now = step.end
            yield step
        else:
            yield from self._halves(end, halvings)

    def _halves(self, end: float, halvings: int) -> Iterator[Converged]:
        """Two steps of half the length up to a time, or their rest."""
        if halvings == MOST_HALVINGS:
            largest, limit = np.abs(self.now.state.jump).max(), LARGEST_JUMP * self.case.size
            end_of_solution = self.problem.model.end_of_solution
            reason = (
                f"no equilibrium with a time step of {self.dt / 2**halvings:.3g} s"
                + (f": {end_of_solution}" if end_of_solution else "")
                if largest < 0.9 * limit
                else f"the displacement jump reaches {limit:.3g} m, beyond small displacements"
            )
            raise RunError(f"earthquake: after t = {self.now.time:.6g} s {reason}")
        middle = end - self.dt / 2 ** (halvings + 1)
        for target in (middle, end):
            if self.now.time < target - self.same_time:
                yield from self._steps_to(target, halvings + 1)

    def _step(self, length: float, halvings: int) -> Converged | None:
        """A step of a length; None if it is to be halved: it does not converge, or does not resolve
        an impact.
        """
        now = self.now
        if self.published and self.problem.dashpots.any():
            problem = with_corner_dashpots(self.problem, now.state)
            self.steps_of_length[halvings] = TimeStep(problem, length)
        elif halvings not in self.steps_of_length:
            self.steps_of_length[halvings] = TimeStep(self.problem, length)
        loads = self.load(now.time), self.load(now.time + length)
        pressure = pressures_in_motion(self.case, self.problem, now.state)
        persist = halvings == MOST_HALVINGS
        advanced = self.steps_of_length[halvings].advance(now, loads, pressure, persist)
        if advanced is None:
            return None
        end, step = advanced
        if not persist and not all(
            contact.resolved(now, end) for contact in self.contacts.values()
        ):
            return None
        ground = self.record.at(now.time + length)
        return Converged(end, ground, length, step.iterations, step.residual)
