"""Steps of a loading, one at a time: Newton's method from the last state, by several attempts."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .. import RunError
from ..joint.equilibrium import Joint
from ..joint.interface import Interface
from ..model.case import Case
from ..model.loads import STAGED, Loading
from .history import Record, State
from .newton import Attempt, Fallen, Iterate, Limit, newton, repeated

#: After how many rounds a burst that has not come to rest is given up.
ROUNDS = 100

#: Part of a residual by which that of another round must differ not to be the same state again.
SAME = 1e-6


@dataclass(frozen=True)
class Control:
    """What is prescribed in a step in place of the level [m]: the displacement of the crest along
    x, the opening of the heel, or the mean jump of the process zone (see `Stepper.zone`).
    """

    of: str
    value: float
    #: of the process zone, from the unknowns (j,)
    row: np.ndarray | None = None


class Stepper:
    """The loading of a case as far as it has come, and the next step of it."""

    def __init__(
        self, case: Case, interface: Interface, on_step: Callable[[float], None] = lambda time: None
    ) -> None:
        if case.geometry:  # where its joint is, only the mesh knows
            case = replace(case, section=case.section | interface.section)
        self.case, self.joint, self.on_step = case, Joint(case, interface), on_step
        self.driven = case["drive"] != "level"
        self.record = Record(self.joint)
        self.state = State.virgin(self.joint)
        #: the step before
        self.before: State | None = None
        self.reference = self.unbalanced(case)
        #: the prescribed displacement at drive_begin, and the level at drive_end
        self.displacement = self.left = 0.0

    def unbalanced(self, case: Case) -> float:
        """Norm of the residual of the untouched joint under the highest water: what convergence is
        measured by.
        """
        joint, virgin = self.joint, State.virgin(self.joint)
        highest = Loading(max(case.levels), max(case.tail_levels), (1.0,) * len(STAGED))
        size = np.linalg.norm(joint.residual(virgin.jump, virgin.memory, highest)[0])
        if not np.isfinite(size):
            raise RunError("loads: are not finite numbers; look at densities, levels and gravity")
        return size

    def fork(self, case: Case) -> Stepper:
        """Another filling, of a case that agrees with this one's as far as this one has come, to go
        on from there by itself.
        """
        other = copy(self)
        other.on_step = lambda _: None
        if case is not self.case:
            other.case, other.reference = case, self.unbalanced(case)
        other.record = self.record.copy()
        return other

    def attempts(self) -> list[Attempt]:
        """The attempts at a step, in order; the last one, with the secant for long, is for before
        giving up.
        """
        parts = ("growth", "secant", "release", "iterations")
        of_each = zip(*(self.case.shared[f"strategy_{n}"] for n in parts), strict=True)
        halvings, most = int(self.case["max_halvings"]), 2 if self.joint.law.releases else 1
        return [
            Attempt(growth, int(secant), int(release), int(iterations), halvings)
            for growth, secant, release, iterations in of_each
            if release <= most
        ]

    def water_at(self, time: float) -> tuple[float, float, Control | None]:
        """Reservoir and tailwater level, and what is prescribed in place of the reservoir's."""
        case = self.case
        level, tail = case.level_at(time), case.tail_at(time)
        if not self.driven:
            return level, tail, None
        begin, end, last = case["drive_begin"], case["drive_end"], case.times[-1]
        if time > end + 1e-9:  # the level goes on from where it was left
            level = self.left + (case.level_at(last) - self.left) * (time - end) / (last - end)
        if not begin + 1e-9 < time < end + 1e-9:
            return level, tail, None
        target = self.displacement + case["drive_by"] * (time - begin) / (end - begin)
        return level, tail, Control(case["drive"], target)

    @property
    def limit(self) -> Limit:
        """When a step has converged."""
        shared, reference = self.case.shared, self.reference
        return Limit(
            self.case["tolerance"] * reference,
            shared["coarsest"][0] * reference,
            shared["round_off"][0],
            0.1 * self.case.size,
        )

    def start(
        self, time: float, level: float, control: Control | None, first: bool
    ) -> tuple[np.ndarray, float]:
        """Where Newton starts: the last state, for the first attempt extrapolated from the last two
        where the loading goes on in the same direction.
        """
        now, before = self.state, self.before
        if first and before and before.time > 0:
            if self.driven:
                new, here, old = time, now.time, before.time
            elif control:
                of = lambda state: self.measured(control.of, state.jump, state.loading, control.row)
                new, here, old = control.value, of(now), of(before)
            else:
                new, here, old = level, now.loading.level, before.loading.level
            ahead = (new - here) / (here - old) if here != old else 0.0
            if 0 < ahead < 4:
                jump = now.jump + ahead * (now.jump - before.jump)
                rise = now.loading.level - before.loading.level
                return jump, now.loading.level + ahead * rise if control else level
        return now.jump, now.loading.level if control else level

    def relaxed(self, time: float, wherever: bool) -> tuple[State, int, float, bool] | None:
        """A step over unstable crack growth, see `solve`: Newton's method from where the joint
        comes to rest by relaxation; if that does not find it and `wherever`, the state of rest. The
        last: whether it is the step's own state, by the law from the last one.

        Both are in equilibrium. The state of rest is more damaged than a direct step would give.
        """
        at_rest = self.relax(time)
        if at_rest is None:
            return None
        state, spent, residual = at_rest
        first, *others = self.attempts()
        attempts = [first, *(one for one in others if one.release)]
        start = state.jump, state.loading.level
        found = self.solve_by(attempts, time, insist=False, start=start)
        if found:
            return found[0], spent + found[1], found[2], True
        return (state, spent, residual, False) if wherever else None

    def relax(self, time: float) -> tuple[State, int, float] | None:
        """Where the joint comes to rest under the loading of a time, see `solve`.

        Alternate minimisation: the step is solved with frozen damage, then the damage is updated,
        by turns, until the law is in equilibrium. Where the flow cannot be solved for together with
        the jump its pressure is frozen, too: a crack opens, and then the water follows.
        """
        joint, begin, spent, sizes = self.joint, self.state, 0, []
        attempts = [one for one in self.attempts()[:-1] if not one.release]
        level, tail, control = self.water_at(time)
        try:
            for _ in range(ROUNDS):
                self.state = state = self.state.staged(joint, time).held(joint)
                coupled = attempts[:1] if joint.flowing else attempts
                found = self.solve_by(coupled, time, insist=False)
                if found is None and joint.flowing:
                    level = state.loading.level if control else level
                    loading = Loading.at(self.case, time, level, tail)
                    lift, _ = joint.flowing_lift(state.jump, state.memory, loading)
                    found = self.solve_by(attempts, time, insist=False, held_lift=lift)
                if found is None:
                    return None
                state, iterations, _ = found
                spent += iterations
                self.state = replace(state, time=begin.time)
                memory = self.state.staged(joint, time).memory
                size = np.linalg.norm(joint.residual(state.jump, memory, state.loading)[0])
                if size <= self.limit.size:
                    pressure = joint.pressure(state.jump, memory, state.loading)
                    return replace(state, pressure=pressure), spent, size / (self.reference or 1.0)
                if repeated(size, sizes, SAME):
                    return None
                sizes.append(size)
        finally:
            self.state = begin
        return None

    def solve_by(
        self,
        attempts: list[Attempt],
        time: float,
        ahead: bool = False,
        insist: bool = True,
        **given: object,
    ) -> tuple[State, int, float] | None:
        """A step by the first of some attempts that finds it, see `solve`.

        ahead: whether the very first one starts extrapolated; insist: whether the others are tried,
        too, once one sees the dam fall; given: see `solve`.
        """
        for one in attempts:
            try:
                found = self.solve(time, one, ahead and one is attempts[0], **given)
            except Fallen:
                if not insist:
                    return None
                continue
            if found:
                return found
        return None

    def solve(
        self,
        time: float,
        attempt: Attempt,
        first: bool = False,
        start: tuple[np.ndarray, float] | None = None,
        held_lift: np.ndarray | None = None,
        control: Control | None = None,
    ) -> tuple[State, int, float] | None:
        """A step from the last state: the new one, iterations, residual over reference; or None.

        first: whether it is the first attempt at the step; start: the jump and level that Newton
        starts with, if not those; held_lift: see `Joint.residual`; control: what is prescribed
        in place of the case's level. Raises Fallen.
        """
        joint, state = self.joint, self.state.staged(self.joint, time)
        memory = state.memory
        level, tail, scheduled = self.water_at(time)
        control = control or scheduled
        asked = Loading.at(self.case, time, level, tail)
        stiff, limit = joint.case["K_N"] * joint.bulk.width, self.limit

        def evaluate(jump: np.ndarray, level: float, last: Iterate | None) -> Iterate:
            side = within = None
            if attempt.release:
                at_points = joint.interface.jumps(joint.interface.at_points, jump)
                side = joint.law.side(at_points, memory)
                if last:
                    within = (side * last.side < 0) & ((side < 0) | (attempt.release > 1))
                    side = np.where(within, 0, side)
            loading = replace(asked, level=level)
            value, by_jump, by_level = joint.residual(jump, memory, loading, within, held_lift)
            size, edge = np.linalg.norm(value), None
            if control:
                gap = control.value - self.measured(control.of, jump, loading, control.row)
                if control.of == "crest":
                    row, rate = joint.bulk.crest_jump, joint.crest_rate(loading)
                else:
                    row = joint.interface.heel if control.row is None else control.row
                    rate = 0.0
                size, edge = np.hypot(size, stiff * gap), (row, rate, gap)

            def correction(secant: bool) -> tuple[np.ndarray, float]:
                border = edge and (by_level(), *edge)
                return joint.interface.solve(joint.virgin, by_jump(secant), -value, border)

            return Iterate(jump, level, value, size, correction, side)

        with np.errstate(over="ignore", invalid="ignore"):  # an attempt that flies off is dropped
            begin = evaluate(*(start or self.start(time, level, control, first)), None)
            found = newton(evaluate, begin, limit, attempt)
        if found is None:
            return None
        end, iterations = found
        if np.abs(end.jump).max() > limit.farthest:
            raise Fallen  # an equilibrium of small displacements only
        if control and not 0 <= end.level <= self.case.highest_level:
            return None  # no reservoir has that level
        memories, loading = state.remember(joint, end.jump), replace(asked, level=end.level)
        pressure = joint.pressure(end.jump, memory, loading)
        return (
            State(time, loading, end.jump, *memories, pressure),
            iterations,
            end.size / (self.reference or 1.0),
        )

    def accept(self, cuts: int, state: State, iterations: int, residual: float) -> None:
        """Commit a converged step and write its row of history."""
        self.before, self.state = self.state, state
        self.__dict__.pop("zone", None)
        self.record.add(state, iterations, cuts, residual)
        if self.driven:
            if state.time < self.case["drive_begin"] + 1e-9:
                self.displacement = self.driven_displacement(state)
            if state.time < self.case["drive_end"] + 1e-9:
                self.left = state.loading.level
        self.on_step(state.time)

    @cached_property
    def zone(self) -> np.ndarray | None:
        """The mean jump of the points whose damage has grown in the last step, weighted by that
        growth, from the unknowns (j,): the opening of open ones, the slip of closed ones, each in
        the direction of its last step; None if there is none.
        """
        if self.before is None:
            return None
        joint, interface = self.joint, self.joint.interface
        ends = self.before, self.state
        jumps = [interface.jumps(interface.at_points, state.jump) for state in ends]
        before, after = (
            joint.law.damage(jump, state.memory) for jump, state in zip(jumps, ends, strict=True)
        )
        opened = np.array([True, False, False]) == (jumps[1][:, :1] > 0)
        way = (jumps[1] - jumps[0]) * opened
        size = np.linalg.norm(way, axis=1)
        weights = interface.points.weights * np.maximum(after - before, 0) * (size > 0)
        if not weights.any():
            return None
        way *= (weights / np.where(size > 0, size, 1) / weights.sum())[:, None]
        return interface.at_points.T @ way[:, : interface.dim].ravel()

    @property
    def zone_moved(self) -> float:
        """How far it has moved in the last step [m]."""
        return 0.0 if self.zone is None else self.zone @ (self.state.jump - self.before.jump)

    def measured(
        self, of: str, jump: np.ndarray, loading: Loading, row: np.ndarray | None = None
    ) -> float:
        """What a `Control` prescribes [m]."""
        if row is not None:
            return float(row @ jump)
        if of == "heel":
            return float(self.joint.interface.heel @ jump)
        return self.joint.crest(jump, loading)

    def driven_displacement(self, state: State) -> float:
        """The displacement that is prescribed, in a state [m]."""
        return self.measured(self.case["drive"], state.jump, state.loading)

    def step(self, time: float, control: Control | None = None) -> bool:
        """One step to a time by the first attempt, whether it is found."""
        found = self.solve_by(self.attempts()[:1], time, ahead=True, control=control)
        if found:
            self.accept(0, *found)
        return bool(found)
