"""The loading of a case followed step by step, with the strategy of pro/strategy.pro."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import replace

import numpy as np

from ... import RunError
from ...results.tables import Results
from ...scene.case import Case
from ...scene.loads import STAGED, Loading
from .equilibrium import Joint
from .interface import Interface
from .newton import Attempt, Fallen, Iterate, Limit, newton, repeated
from .record import Record, State

#: After how many rounds a burst that has not come to rest is given up.
ROUNDS = 100

#: Part of a residual by which that of another round must differ not to be the same state again.
SAME = 1e-6


class Filling:
    """The loading of a case followed step by step; the converged steps are rows, the requested
    levels tables.
    """

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
        self.stopped = False
        #: the levels at which the joint ran on, to a state that depends on the way there
        self.ran_on: tuple[float, ...] = ()

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

    def fork(self, case: Case) -> Filling:
        """Another filling, of a case that agrees with this one's as far as this one has come, to go
        on from there.
        """
        other = copy(self)
        if case is not self.case:
            other.case, other.reference = case, self.unbalanced(case)
        other.record = self.record.copy()
        return other

    def attempts(self) -> list[Attempt]:
        """The attempts at a step, in order; the last one, with the secant for long, is for before
        giving up.
        """
        parts = ("growth", "secant", "release", "iterations")
        of_each = zip(*(self.case.shared[f"attempt_{n}"] for n in parts), strict=True)
        halvings, most = int(self.case["max_halvings"]), 2 if self.joint.law.releases else 1
        return [
            Attempt(growth, int(secant), int(release), int(iterations), halvings)
            for growth, secant, release, iterations in of_each
            if release <= most
        ]

    def run(self) -> Results:
        """Follow all the times of the case that are still to come."""
        for target in self.case.times:
            if target > self.state.time and not self.stopped:
                self.reach(target)
                if target in self.case.requested and not self.stopped:
                    self.record.save(self.state)
        if self.stopped:
            self.keep_last()
        return self.results()

    def rest(self) -> bool:
        """The state under the weight alone, from where displacements count; whether there is one.

        It has no row in the history.
        """
        found = self.solve_by(self.attempts(), 0.0)
        if found is None:
            return False
        self.state = found[0]
        if self.case["weight_first"]:
            self.record.at_rest = self.state
        if self.driven:
            self.displacement = self.driven_displacement(self.state)
        return True

    def keep_last(self) -> None:
        """Make a table of the last converged state, if there is none yet."""
        if self.state.time > 0 and self.record.saved_until < self.state.time:
            self.record.save(self.state)

    def reach(self, target: float) -> None:
        """Steps up to a time; a step that fails is cut, the next ones grow back.

        The first step holds the weight, too, at any length: it is cut to the weight alone first.
        """
        # what is driven from t = 0 on counts from the weight alone, too
        first = self.case["weight_first"] or (self.driven and self.case["drive_begin"] == 0)
        if first and self.state.time == 0 and not self.state.jump.any():
            self.rest()
        *attempts, last_resort = self.attempts()
        cuts, dt, weighed = 0, np.inf, self.state.time > 0 or self.state.jump.any()
        while self.state.time < target and not self.stopped:
            time = min(self.state.time + dt, target)
            time = target if target - time < 1e-9 else time
            smallest = time - self.state.time < self.case["smallest_step"] * (1 + 1e-9)
            likely = attempts[:1] if self.ran_on and not smallest else attempts
            found = self.solve_by(likely, time, ahead=True, insist=smallest)
            if found is None and not weighed:
                weighed = True
                if self.rest():
                    cuts += 1
                    continue
            breaks = self.joint.law.breaks
            if found is None and (breaks or self.joint.flowing):
                known = self.ran_on or smallest or cuts > 0
                found = self.burst(time, wherever=breaks and bool(known))
            if found is None:
                tried, cuts = time - self.state.time, cuts + 1
                dt = max(self.case.shared["cut"][0] * tried, self.case["smallest_step"])
                if smallest:
                    time, found = target, self.solve_by([last_resort], target)
                    self.stopped = found is None
            if found:
                dt = 2 * (time - self.state.time)
                self.accept(cuts, *found)
                cuts = 0

    def water_at(self, time: float) -> tuple[float, float, bool, float]:
        """Reservoir and tailwater level, whether a displacement is prescribed instead, and how
        much.
        """
        case = self.case
        level, tail = case.level_at(time), case.tail_at(time)
        if not self.driven:
            return level, tail, False, 0.0
        begin, end, last = case["drive_begin"], case["drive_end"], case.times[-1]
        if time > end + 1e-9:  # the level goes on from where it was left
            level = self.left + (case.level_at(last) - self.left) * (time - end) / (last - end)
        target = self.displacement + case["drive_by"] * (time - begin) / (end - begin)
        return level, tail, begin + 1e-9 < time < end + 1e-9, target

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
        self, time: float, level: float, prescribed: bool, first: bool
    ) -> tuple[np.ndarray, float]:
        """Where Newton starts: the last state, for the first attempt extrapolated from the last two
        where the loading goes on in the same direction.
        """
        now, before = self.state, self.before
        if first and before and before.time > 0:
            new, old = (time, before.time) if self.driven else (level, before.loading.level)
            here = now.time if self.driven else now.loading.level
            ahead = (new - here) / (here - old) if here != old else 0.0
            if 0 < ahead < 4:
                jump = now.jump + ahead * (now.jump - before.jump)
                rise = now.loading.level - before.loading.level
                return jump, now.loading.level + ahead * rise if prescribed else level
        return now.jump, now.loading.level if prescribed else level

    def burst(self, time: float, wherever: bool) -> tuple[State, int, float] | None:
        """A step over a burst, see `solve`: Newton's method from where the joint comes to rest when
        it runs on; if that does not find it and `wherever`, the state of rest itself.

        Both are in equilibrium. What has run on has let go of more than the step's own law has.
        """
        at_rest = self.run_on(time)
        if at_rest is None:
            return None
        state, spent, residual = at_rest
        start = state.jump, state.loading.level
        first, *others = self.attempts()
        attempts = [first, *(one for one in others if one.release)]
        found = self.solve_by(attempts, time, insist=False, start=start)
        if found:
            return found[0], spent + found[1], found[2]
        if not wherever:
            return None
        self.ran_on += (state.loading.level,)
        return state, spent, residual

    def run_on(self, time: float) -> tuple[State, int, float] | None:
        """Where the joint comes to rest when it runs on under the loading of a time, see `solve`.

        It moves while nothing breaks or lets go, which it then does where it has opened or slid, by
        turns, until the law is in equilibrium. Where the flow cannot be solved for together with
        the jump its pressure waits for that, too: a crack opens, and then the water follows.
        """
        joint, begin, spent, sizes = self.joint, self.state, 0, []
        attempts = [one for one in self.attempts()[:-1] if not one.release]
        level, tail, prescribed, _ = self.water_at(time)
        try:
            for _ in range(ROUNDS):
                self.state = state = self.state.staged(joint, time).held(joint)
                coupled = attempts[:1] if joint.flowing else attempts
                found = self.solve_by(coupled, time, insist=False)
                if found is None and joint.flowing:
                    level = state.loading.level if prescribed else level
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
    ) -> tuple[State, int, float] | None:
        """A step from the last state: the new one, iterations, residual over reference; or None.

        first: whether it is the first attempt at the step; start: the jump and level that Newton
        starts with, if not those; held_lift: see `Joint.residual`. Raises Fallen.
        """
        joint, state = self.joint, self.state.staged(self.joint, time)
        memory = state.memory
        level, tail, prescribed, target = self.water_at(time)
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
            if prescribed:
                if self.case["drive"] == "heel":
                    found, row, rate = joint.interface.heel @ jump, joint.interface.heel, 0.0
                else:
                    found, row = joint.crest(jump, loading), joint.bulk.crest_jump
                    rate = joint.crest_rate(loading)
                size, edge = np.hypot(size, stiff * (found - target)), (row, rate, target - found)

            def correction(secant: bool) -> tuple[np.ndarray, float]:
                border = edge and (by_level(), *edge)
                return joint.interface.solve(joint.virgin, by_jump(secant), -value, border)

            return Iterate(jump, level, value, size, correction, side)

        with np.errstate(over="ignore", invalid="ignore"):  # an attempt that flies off is dropped
            begin = evaluate(*(start or self.start(time, level, prescribed, first)), None)
            found = newton(evaluate, begin, limit, attempt)
        if found is None:
            return None
        end, iterations = found
        if np.abs(end.jump).max() > limit.farthest:
            raise Fallen  # an equilibrium of small displacements only
        if prescribed and not 0 <= end.level <= self.case.highest_level:
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
        self.record.add(state, iterations, cuts, residual)
        if self.driven:
            if state.time < self.case["drive_begin"] + 1e-9:
                self.displacement = self.driven_displacement(state)
            if state.time < self.case["drive_end"] + 1e-9:
                self.left = state.loading.level
        self.on_step(state.time)

    def driven_displacement(self, state: State) -> float:
        """The displacement that is prescribed, in a state [m]."""
        joint = self.joint
        if self.case["drive"] == "heel":
            return float(joint.interface.heel @ state.jump)
        return joint.crest(state.jump, state.loading)

    def results(self) -> Results:
        """All tables so far."""
        return self.record.results(self.case, self.stopped)
