"""The loading of a case followed from its first to its last step, as in pro/strategy.pro."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import asdict, dataclass, replace
from typing import cast

import numpy as np

from ..input.case import Case
from ..joint.interface import Interface
from ..model import process_zone
from ..model.loads import LEVEL, Loading, Unknown
from ..model.results import Info, Results
from .controls import Control, DissipationControl, LevelControl, drive_control
from .history import History
from .model import Model, StepOptions, StepResult
from .newton import Strategy
from .path import ROUGH, SURE, EquilibriumPath
from .path_point import PRECISION, Point
from .relaxation import over_unstable_growth
from .state import State, Trace
from .step import not_given_up
from .trace_table import trace_table

#: Times and relative lengths of steps that differ by less are the same.
SAME_TIME = 1e-9

#: Mean damage of a joint that a step may add without being tried again by shorter ones [-]: it may
#: have led to another equilibrium than the nearest one, as where the whole joint slips at once.
LEAP = 0.2
#: Mean damage of a joint that a step may add without its halves being tried [-], where the mesh
#: does not resolve the fracture process zone: points break one by one there.
GROWS = 0.02
#: Mean difference of the damage of a joint up to which two states are the same [-].
SAME_DAMAGE = 0.02

#: Powers of 2 of the lengths over the smallest step at which a run that would stop relaxes.
POWERS_BEYOND = range(1, 5)

#: Number of strategies by which a step from the equilibrium path to the prescribed level is tried.
FROM_PATH = 2


@dataclass(frozen=True)
class Mechanism:
    """How the dam fails, as its equilibrium path has shown."""

    mode: str
    #: displacement at the end of the path over that at its limit point [-]
    displacement_ratio: float
    #: time whose loads act
    time: float
    #: the highest level [m]
    level: float = np.nan
    #: the joint that fails, or several; empty if the dam has only one
    joint: str = ""
    #: their numbers
    joints: tuple[int, ...] = ()


class LoadStepper:
    """Load stepping: the converged steps are rows of the history, the requested levels tables."""

    def __init__(
        self,
        case: Case,
        interface: Interface | None = None,
        on_step: Callable[[float], None] = lambda time: None,
    ) -> None:
        """interface: see `Model`; on_step: called with the time of each converged step."""
        self.model, self.on_step = Model(case, interface), on_step
        self.history = History(self.model.equilibrium)
        start = self.model.start()
        self.state = Trace.start(start) if case.all_steps else start
        self.stopped = False
        #: by which criterion the fallback has ended, where the run has stopped
        self.end_of_solution = ""
        #: whether an equilibrium path has been followed to its end
        self.path_ended = False
        #: whether the crack has grown unstably beyond its end
        self.grown_beyond_path = False
        #: whether its increments that are as predicted need no halves, see `EquilibriumPath`
        self.predicts = False
        #: the state from which the last one was followed
        self.path_begin: State | None = None
        #: how the dam fails, once its equilibrium path has shown that it does
        self.mechanism: Mechanism | None = None
        #: whether the weight alone, which is to act first, has not converged
        self.weight_with_water = False
        #: the level [m] at which a joint slides that holds what is above it: a higher one has no
        #: equilibrium under the same other loads
        self.slides_at = np.inf
        #: levels of the limit points that have been passed, and the lowest ones behind them [m]
        self.limit_points: tuple[tuple[float, float], ...] = ()
        #: the levels at which a crack grew unstably, to a state that depends on the steps
        self.relaxed_at: tuple[float, ...] = ()
        #: levels between which a joint has broken at once, and no shorter steps lead there [m]
        self.leapt: tuple[tuple[float, float], ...] = ()
        #: levels before and after each step of which a half leads to no equilibrium [m]
        self.passed_over: tuple[tuple[float, float], ...] = ()
        #: see `Plan`: of the strategies in direct steps and from relaxed states
        self.failures = Counter[Strategy]()
        #: the same with frozen damage
        self.frozen_failures = Counter[Strategy]()
        #: whether the mesh does not resolve the fracture process zone of a joint
        self.unresolved = any(map(process_zone.unresolved, self.case.joints))
        #: time of the step in which the pressure of water in time has changed most beyond the
        #: change of the levels, and by how much [Pa]
        self.largest_move = (0.0, 0.0)
        #: the prescribed displacement at drive_begin, and the level at drive_end
        self.displacement_at_begin = self.level_at_drive_end = 0.0

    @property
    def case(self) -> Case:
        """The case whose loading is followed."""
        return self.model.case

    @property
    def drives(self) -> bool:
        """Whether the case prescribes a displacement."""
        return bool(self.case["drive"] != "level")

    def fork(self, case: Case) -> LoadStepper:
        """The loading of a case that agrees with this one's up to its last step, to be continued
        from there independently.
        """
        other = copy(self)
        other.on_step = lambda time: None
        other.model, other.history = self.model.with_case(case), self.history.copy()
        other.failures = self.failures.copy()
        other.frozen_failures = self.frozen_failures.copy()
        return other

    # -- the loading

    def control(self, time: float) -> Control:
        """What the case prescribes at a time."""
        case, level = self.case, self.case.level_at(time)
        if not self.drives:
            return LevelControl(level)
        begin, end, last = case["drive_begin"], case["drive_end"], case.times[-1]
        if time > end + SAME_TIME:  # the level continues from that at the end of the displacement
            start = self.level_at_drive_end
            share = (time - end) / (last - end)
            return LevelControl(start + (case.level_at(last) - start) * share)
        if not begin + SAME_TIME < time:
            return LevelControl(level)
        share = (time - begin) / (end - begin)
        if case["drive"] == "dissipation":
            return self.dissipation(time)
        return drive_control(case, self.displacement_at_begin + case["drive_by"] * share)

    def run(self) -> Results:
        """Follow the times of the case from the last state on."""
        for _ in self.steps():
            pass
        return self.results()

    def steps(self) -> Iterator[State]:
        """Follow the times of the case from the last state on, and yield each converged state."""
        for target in self.case.times:
            if target > self.state.time and not self.stopped:
                yield from self.steps_to(target)
                if target in self.case.requested and not self.stopped:
                    self.history.save(self.state)
        if self.stopped:
            self.save_last()

    def save_last(self) -> None:
        """Make a table of the last converged state, unless it has one."""
        if self.state.time > 0 and self.history.saved_until < self.state.time:
            self.history.save(self.state)

    def weigh(self) -> StepResult | None:
        """Solve for the weight alone, from where displacements count; None if it does not converge.

        The state has no row in the history.
        """
        step = self.model.advance(self.state, 0.0, self.control(0.0))
        self.weight_with_water = step is None and bool(self.case["weight_first"])
        if step is None:
            return None
        self.state = step.state
        if self.case["weight_first"]:
            self.history.at_rest = self.state
        if self.drives:
            self.displacement_at_begin = self.controlled_displacement()
        return step

    def controlled_displacement(self) -> float:
        """The displacement that the case prescribes, in the last state [m]."""
        return self.model.measure(drive_control(self.case), self.state)

    def dissipation(self, time: float) -> DissipationControl:
        """The control of the energy that is dissipated from the last state to a time."""
        case, state, unknown = self.case, self.state, Unknown(self.case["drive_load"])
        energy, duration = case["drive_energy"], case["drive_end"] - case["drive_begin"]
        unit = case.size if unknown == LEVEL else 1.0
        return DissipationControl(
            energy * (time - state.time) / duration,
            unknown=unknown,
            laws=self.model.equilibrium.laws,
            interface=self.model.equilibrium.interface,
            variables=self.model.begin(state, time).start.variables,
            begin=state.jump,
            unknown_at_begin=unknown.of(state.loading),
            shift=case.shared["dissipation_shift"][0] * energy / unit,
            reference=self.model.reference,
        )

    def accept(self, step: StepResult, cuts: int) -> None:
        """Commit a converged step; cuts: how often it was shortened."""
        if step.state.stored:
            self.record_move(step)
        self.state = step.state.after(self.state)
        self.history.add(step, cuts)
        if self.drives:
            if self.state.time < self.case["drive_begin"] + SAME_TIME:
                self.displacement_at_begin = self.controlled_displacement()
            if self.state.time < self.case["drive_end"] + SAME_TIME:
                self.level_at_drive_end = self.state.loading.level
        self.on_step(self.state.time)

    def step(self, time: float) -> bool:
        """One step to a time by the first strategy; whether it converges."""
        step = self.model.advance_by_first(self.state, time, self.control(time))
        if step:
            self.accept(step, cuts=0)
        return step is not None

    def advance_to(self, target: float) -> None:
        """Take the steps up to a time, see `steps_to`."""
        for _ in self.steps_to(target):
            pass

    def steps_to(self, target: float) -> Iterator[State]:
        """The steps up to a time; one that does not converge is cut, the next ones grow again.

            weigh first, if the case says so
            while the time is before the target:
                step = direct step to the time (the strategies in turn)
                if it moves the pressure too far:    halve it, and try again
                if it breaks much at once:           shorter steps, if they lead to another state
                if none and the weight is in it:     weigh, and try again if that is not linear
                if none:                             over the limit point, along the equilibrium
                                                     path or by relaxation
                if none and it can be cut no more:   the whole step by the fallback, or stop
                elif none:                           cut the step
                if there is one:                     commit it, and double the next one

        The first step includes the weight at any length: it is cut to the weight alone first.
        """
        case = self.case
        # a displacement prescribed from t = 0 on counts from the weight alone, too
        first = case["weight_first"] or (self.drives and case["drive_begin"] == 0)
        if first and self.state.time == 0 and not self.state.jump.any():
            self.weigh()
        cuts, dt, weighed = 0, np.inf, self.state.time > 0 or self.state.jump.any()
        while self.state.time < target and not self.stopped:
            begin = self.state
            time = min(self.state.time + dt, target)
            time = target if target - time < SAME_TIME else time
            smallest = time - self.state.time < case["smallest_step"] * (1 + SAME_TIME)
            step = self.direct_step(time, smallest)
            if step and not smallest and self.moves_pressure(step):
                cuts += 1
                dt = max((time - self.state.time) / 2, case["smallest_step"])
                continue
            if step and self.leaps(step) and self.by_shorter_steps(step):
                yield self.state
                continue
            if step:
                self.passed_over += self.passed_by(step)
            if step is None and not weighed:
                weighed = True
                if weight := self.weigh():
                    cuts += 1
                    if weight.iterations > 1:
                        continue
                    # a linear response: the step from there begins as the one that has failed
                    begin = self.state
            if step is None and not self.beyond_path(smallest):
                step = self.over_limit_point(time, cuts, smallest)
            if step is None:
                cuts += 1
                dt = max(case.shared["cut"][0] * (time - self.state.time), case["smallest_step"])
                if smallest:
                    step = self.fallback_step(time, target)
                    time = step.state.time if step else target
            if step:
                dt = 2 * (time - self.state.time)
                self.accept(step, cuts)
                cuts = 0
            if self.state is not begin:  # by this step, or at the limit point of a path
                yield self.state

    def direct_step(self, time: float, smallest: bool) -> StepResult | None:
        """A step to a time from the last state; smallest: whether it can be cut no more. None if it
        has no equilibrium: a joint slides at a lower level.
        """
        most = (1 + PRECISION) * self.slides_at
        if self.case.level_at(time) > most and self.only_level_changes(time):
            return None
        first, *others, _ = self.model.strategies
        if self.beyond_path(smallest) or (self.relaxed_at and not smallest):
            others = []
        elif not smallest:
            others = not_given_up(others, self.failures)
        options = StepOptions(
            [first, *others], extrapolate=True, persist=smallest, failures=self.failures
        )
        return self.model.advance(self.state, time, self.control(time), options)

    def leaps(self, step: StepResult) -> bool:
        """Whether a step adds a mean damage of more than LEAP to a joint, whose law depends on the
        path.
        """
        if self.drives or not self.model.equilibrium.path_dependent:
            return False
        return self.model.damage_between(self.state, step.state) > LEAP

    def by_shorter_steps(self, whole: StepResult) -> bool:
        """Whether shorter steps lead to another state at the time of a step, none of which leaps;
        if they do they are taken: the step has passed to another branch. Where they lead nowhere
        the joint breaks at once, `leapt`.
        """
        other, end, smallest = self.fork(self.case), whole.state.time, self.case["smallest_step"]
        dt, accepted = end - self.state.time, False  # of the whole step
        taken = list[tuple[LoadStepper, StepResult]]()
        while other.state.time < end:
            if not accepted and dt < smallest * (1 + SAME_TIME):
                self.record_leap(other.state, whole.state)
                return False
            dt *= 2 if accepted else self.case.shared["cut"][0]
            time = min(other.state.time + max(dt, smallest), end)
            dt = time - other.state.time
            least = dt < smallest * (1 + SAME_TIME)
            step = other.direct_step(time, least)
            moves = bool(step and not least and other.moves_pressure(step))
            accepted = bool(step and not moves and not other.leaps(step))
            if step and accepted:
                taken.append((other.fork(self.case), step))
                other.accept(step, cuts=0)
        if self.model.damage_between(other.state, whole.state) <= SAME_DAMAGE:
            return False
        self.state, self.history = other.state, other.history
        self.largest_move = other.largest_move
        for begin, step in taken:
            self.passed_over += begin.passed_by(step)
        self.on_step(end)
        return True

    def passed_by(self, step: StepResult) -> tuple[tuple[float, float], ...]:
        """The levels of a direct step that adds damage, but of which a half leads to no
        equilibrium: it has passed over a limit point. Empty if it has not.
        """
        begin, end = self.state, step.state
        levels = float(begin.loading.level), float(end.loading.level)
        if self.drives or not self.unresolved or levels in self.leapt:
            return ()
        if self.model.damage_between(begin, end) <= GROWS:
            return ()
        other = self.fork(self.case)
        for time in ((begin.time + end.time) / 2, end.time):
            half = other.direct_step(time, smallest=False)
            if half is None:
                return (levels,)
            other.accept(half, cuts=0)
        return ()

    def record_leap(self, begin: State, end: State) -> None:
        """Record that a joint breaks at once from one state to another."""
        self.leapt += ((float(begin.loading.level), float(end.loading.level)),)

    def record_move(self, step: StepResult) -> None:
        """Record the largest change of the pressure in a step beyond that of the levels."""
        new, old = step.state.loading, self.state.loading
        rise = max(abs(new.level - old.level), abs(new.tail - old.tail))
        move = self.move_of_pressure(step) - self.model.equilibrium.unit_weight * rise
        if move > self.largest_move[1]:
            self.largest_move = (step.state.time, move)

    def moves_pressure(self, step: StepResult) -> bool:
        """Whether the pressure of water that flows in time changes by more than `pressure_step`."""
        most = self.case["pressure_step"]
        return bool(most) and self.move_of_pressure(step) > most

    def move_of_pressure(self, step: StepResult) -> float:
        """Largest change of the pressure of water that flows in time, at the nodes, from the last
        state to a step [Pa].
        """
        new, old = step.state, self.state
        if not (new.stored and old.pressures):
            return 0.0
        pairs = zip(new.pressures, old.pressures, strict=True)
        return max(float(np.abs(end.nodes - begin.nodes).max()) for end, begin in pairs)

    def beyond_path(self, smallest: bool) -> bool:
        """Whether nothing leads on beyond the end of an equilibrium path: the dam has failed, or
        the step can be shortened first, unless unstable growth has led beyond that end before.
        """
        first = not (smallest or self.grown_beyond_path)
        return self.path_ended and (self.mechanism is not None or first)

    def fallback_step(self, time: float, target: float) -> StepResult | None:
        """The whole step to a target by the last strategy or, where it does not converge, the one
        to a time by the last two, also from the extrapolation of the last states; or along the
        equilibrium path, if one from an earlier state was lost; else stop. None if the dam has
        failed.
        """
        step, (*_, stiff, fallback) = None, self.model.strategies
        if self.mechanism is None:
            step = self.model.advance(
                self.state, target, self.control(target), StepOptions([fallback])
            )
            end = self.model.end_of_solution
            for options in (
                StepOptions([stiff], extrapolate=True),
                StepOptions([fallback], extrapolate=True),
                StepOptions([fallback]),
            ):
                step = step or self.model.advance(self.state, time, self.control(time), options)
            if step is None and self.path_ended and self.state is not self.path_begin:
                step = self.along_path(target)
            if step is None and self.mechanism is None and not self.drives:
                step = self.relaxed_beyond(target)
            self.end_of_solution = "" if step or self.mechanism else end
            if step and self.leaps(step):
                self.record_leap(self.state, step.state)
        self.stopped = step is None
        return step

    def relaxed_beyond(self, target: float) -> StepResult | None:
        """A step of a few of the smallest ones, up to a target, over unstable crack growth by
        relaxation: at the smallest one it may fail by chance.
        """
        if not self.model.equilibrium.laws.softens:
            return None
        for power in POWERS_BEYOND:
            time = min(self.state.time + 2**power * self.case["smallest_step"], target)
            step = self.over_growth(time, accept_relaxed=True, smallest=True)
            if step or time == target:
                return step
        return None

    # -- beyond a limit point

    def over_limit_point(self, time: float, cuts: int, smallest: bool) -> StepResult | None:
        """A step over unstable crack growth, after which there is no equilibrium near the last one.

        Along the equilibrium path, unless opening releases the shear stiffness: such a path has a
        kink and a turn at every point. Else, and where the path is lost, by relaxation. No branch
        leads to other loads that act at once: their step is cut first.
        """
        equilibrium, step = self.model.equilibrium, None
        laws = equilibrium.laws
        follows = not (laws.releases_shear or self.drives or self.path_ended)
        if follows and (smallest or (not cuts and self.only_level_changes(time))):
            step = self.along_path(time)
            if self.path_ended and not smallest:  # shorter steps from where the path has ended
                return None
        if step is None and (laws.softens or equilibrium.flowing):
            accept_relaxed = laws.softens and (bool(self.relaxed_at) or smallest or cuts > 0)
            step = self.over_growth(time, accept_relaxed, smallest)
            if step and self.leaps(step):
                self.record_leap(self.state, step.state)
        return step

    def over_growth(self, time: float, accept_relaxed: bool, smallest: bool) -> StepResult | None:
        """A step over unstable crack growth by relaxation, see `over_unstable_growth`; smallest:
        whether it can be cut no more.
        """
        step, relaxed = over_unstable_growth(
            self.model,
            self.state,
            time,
            self.control(time),
            accept_relaxed,
            self.failures,
            None if smallest else self.frozen_failures,
        )
        if step and relaxed:
            self.relaxed_at += (step.state.loading.level,)
        if step:
            self.grown_beyond_path = self.path_ended
        return step

    def along_path(self, time: float, again: bool = True) -> StepResult | None:
        """A step along the equilibrium path, until it reaches the level of its time.

        If it never does the dam fails: `mechanism`. Then, and where the path is lost, its highest
        level is the last step if only the level changes in it; else shorter steps are to be tried.
        again: whether the path may begin before the last step, see `before_limit_point`, which it
        then replaces.
        """
        begin, level = self.state, self.case.level_at(time)
        if begin.time == 0 or level < begin.loading.level:
            return None
        self.path_begin = begin
        origin = start = Point(self.model, begin, self.history.copy())
        path = self.path_from(start, time)
        same = self.only_level_changes(time)
        if same:
            path.advance()
        else:  # no branch: the other loads change at once
            path.pass_over(start)
        if path.ended:
            return None
        if not same:
            del path.points[0]  # under other loads: not on this path
        while path.highest < level:
            # (a mechanism of an earlier path, under other loads, does not end this one)
            factor = ROUGH if path.ended else SURE
            fails = path.slides or path.loses_strength or path.settled(factor)
            first = again and same and origin is start
            if (fails or path.ended) and first and (earlier := self.before_limit_point(path)):
                origin, path = earlier, self.path_from(earlier, time)
                continue
            if fails or path.ended:
                break
            path.advance()
        mechanism = None
        if path.highest < level:
            mechanism = self.mechanism_on(path) if fails else None
            path.refine()
        if origin is not start and self.has_table and path.highest >= begin.loading.level:
            return self.along_path(time, again=False) if self.retake(path, origin) else None
        if path.highest < level:
            if mechanism:
                self.mechanism = replace(mechanism, level=float(path.highest))
                self.slides_at = float(path.highest) if path.slides else np.inf
            self.path_ended = same
            if same:
                self.end_at_limit_point(path, origin)
            return None
        step = self.to_level_on(path, origin, level, time)
        if step:
            self.rewind(origin)
            self.record_limit_points([point.level for point in path.points])
        return step

    def path_from(self, origin: Point, time: float) -> EquilibriumPath:
        """The equilibrium path from a state, under the loads of a time."""
        path = EquilibriumPath([origin], time)
        path.predicts = self.predicts
        return path

    def to_level_on(
        self, path: EquilibriumPath, origin: Point, level: float, time: float
    ) -> StepResult | None:
        """A step to a level [m] that a path reaches, from its last point below, or from the state
        from which it has been followed under other loads; the points beyond are removed.
        """
        arrival = next(n for n, point in enumerate(path.points) if point.level >= level)
        del path.points[arrival + 1 :]  # an increment has two points
        last, beyond = origin, path.points[-1]
        jump = beyond.state.jump
        if arrival:
            last = path.points[-2]
            share = (level - last.level) / (beyond.level - last.level)
            jump = last.state.jump + share * (jump - last.state.jump)
        options = StepOptions(self.model.strategies[:FROM_PATH], guess=(jump, level))
        step = self.model.advance(last.state, time, LevelControl(level), options)
        spent = beyond.history.iterations_since(len(origin.history))
        return step and replace(step, iterations=spent + step.iterations)

    @property
    def has_table(self) -> bool:
        """Whether the last step has a table."""
        return self.history.saved_until >= self.state.time

    def retake(self, path: EquilibriumPath, origin: Point) -> bool:
        """Replace the last step, and its table, by one to its level on a path that has been
        followed from before it; whether that converges.
        """
        level, time = self.state.loading.level, self.state.time
        step = self.to_level_on(path, origin, level, time)
        if step:
            self.rewind(origin)
            self.accept(step, cuts=0)
            self.history.save(self.state)
        return step is not None

    def rewind(self, origin: Point) -> None:
        """Return to a state: the steps after it are not on the path that has been followed from it,
        which supersedes them.
        """
        self.state, self.history = origin.state, origin.history.copy()

    def before_limit_point(self, path: EquilibriumPath) -> Point | None:
        """The state before the first one of a path that does not rise from it, under the same loads
        but for the level: the last step may have passed over the limit point, and led to the other
        one of two equilibria at its level. None if there is no such state, or the path rises.
        """
        start = path.points[0].state
        before = start.previous
        if before is None or before.time == 0 or before.loading.level > start.loading.level:
            return None
        if path.highest > (1 + PRECISION) * path.points[0].level:
            return None
        if not self.same_but_for_level(before.loading, start.loading):
            return None
        return Point(self.model, before, self.history.until(before.time))

    def record_limit_points(self, levels: list[float]) -> None:
        """Record the first limit point that a path has passed, and the lowest level behind it."""
        falls = np.flatnonzero(np.diff(levels) < 0)
        if len(falls):
            self.limit_points += ((float(levels[falls[0]]), float(min(levels[falls[0] :]))),)

    def only_level_changes(self, time: float) -> bool:
        """Whether nothing but the level changes from the last state to a time."""
        loading = self.model.loading(time, self.case.level_at(time))
        return self.same_but_for_level(loading, self.state.loading)

    def same_but_for_level(self, one: Loading, other: Loading) -> bool:
        """Whether two loadings differ in nothing else that acts."""
        dry, other_dry = (
            self.model.equilibrium.loads(replace(loads, level=0.0)) for loads in (one, other)
        )
        return one.tail == other.tail and np.array_equal(dry, other_dry)

    def mechanism_on(self, path: EquilibriumPath) -> Mechanism:
        """The mechanism of a path that does not reach the prescribed level."""
        ratio = path.points[-1].imposed / path.imposed(path.points[path.limit_point])
        joints = tuple(map(int, path.failing))
        return Mechanism(path.mode, float(ratio), path.time, joint=path.joint, joints=joints)

    def end_at_limit_point(self, path: EquilibriumPath, origin: Point) -> None:
        """Take a path's limit point as a step, in which nothing but the level has changed, from the
        state from which the path has been followed.
        """
        top, begin = path.points[path.limit_point], self.state
        rise = top.level - begin.loading.level
        if rise > 0:
            share = rise / (self.case.level_at(path.time) - begin.loading.level)
            time = begin.time + share * (path.time - begin.time)
            self.rewind(origin)
            spent = top.history.iterations_since(len(self.history))
            reached = replace(top.state, time=time)
            self.accept(StepResult(reached, spent, top.last["residual"]), cuts=0)
            self.record_limit_points([point.level for point in path.points[: path.limit_point + 1]])

    @property
    def saved_updates(self) -> tuple[Sequence[Trace], list[int]]:
        """The updates that lead to the last saved state of a run with `all_steps`, and the numbers
        of those that end at the saved ones, whose times may be others: below a limit.
        """
        traces = [state.trace.updates for state in self.history.saved if state.trace]
        return (traces[-1] if traces else []), [len(trace) - 1 for trace in traces]

    def results(self) -> Results:
        """All tables so far, and what is known of failure and unstable crack growth."""
        results = self.history.results(self.case, self.stopped)
        if not self.stopped:
            self.mechanism = None  # shorter steps have passed it
        elif self.mechanism:  # the last steps of the level may have reached a little higher
            time, last = self.mechanism.time, self.state.loading
            if self.same_but_for_level(Loading.at(self.case, time, 0.0, last.tail), last):
                highest = max(self.mechanism.level, float(last.level))
                self.mechanism = replace(self.mechanism, level=highest)
        info = {
            "mechanism": self.mechanism and asdict(self.mechanism),
            "weight_with_water": self.weight_with_water,
            "limit_points": self.limit_points,
            "unstable_growth": self.relaxed_at,
            "broken_at_once": self.leapt,
            "passed_over": self.passed_over,
            "pressure_moves": self.largest_move if self.largest_move[1] > 0 else (),
            "end_of_solution": self.end_of_solution,
            "converged_by_round_off": self.history.by_round_off,
        }
        results.info = cast(Info, {name: value for name, value in info.items() if value})
        if self.state.trace:
            results.steps = trace_table(self.model.equilibrium, self.state.trace)
        return results
