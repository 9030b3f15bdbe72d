"""The equilibrium path of one dam to its failure.

The levels are prescribed until all other loads act in full and the joints have begun to move; then
the path is followed under displacement control (see solver/path.py), and its highest level is
refined to the precision.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from .. import ROUND_OFF
from ..arrays import Array, BoolArray
from ..input.case import Case
from ..input.resolve import varied
from ..input.values import has_drains
from ..joint.interface import Interface
from ..model import process_zone
from ..model.loads import Loading
from ..model.results import HISTORY, Columns, column_of, with_all_joints
from ..solver.controls import DisplacementControl, LevelControl
from ..solver.history import FULL_HEAD, History, JointState
from ..solver.load_stepper import SAME_TIME, LoadStepper
from ..solver.path import (
    BY_LEVEL,
    LEVEL_RISE,
    MOST_REFINED,
    NEAR_HIGHEST,
    RISE,
    SURE,
    EquilibriumPath,
)
from ..solver.path_point import FALL, PRECISION, Point, Solved, filled_part, solve_once
from .critical_value import AFTER_GROWTH

#: Columns of critical.csv: a row per equilibrium of each dam that was tried. With several joints:
#: of the first one; see `critical_columns`.
CRITICAL = {
    "trial": ("-", "number of the trial"),
    "value": ("", "varied quantity: level [m], strength factor or the parameter"),
    "stands": ("-", "1: equilibrium reached with this value; 0: not reached"),
    "displacement_control": ("-", "0: the level was prescribed; 1: a displacement"),
    **{n: HISTORY[n] for n in ("level", "crest_ux", "crack_length", "slip_length", "N", "T", "M")},
    "imposed_displacement": (
        "m",
        "displacement since the first equilibrium under displacement control",
    ),
    "compression": ("Pa", "total compression at the toe"),
}

#: Part of a joint that may open or soften before a displacement is prescribed [-].
SOFTENED = 0.1
#: Number of elements in the process zone of shear below which its points soften one by one [-].
FEW = 5
#: How often a step of the level is halved at most, until its two halves lead to the same state.
HALVINGS = 4

#: First level of a path or run that begins lower, over that of the case [-].
LOWER_BEGIN = 0.6

#: Largest rise of the level in a step of a run, over its last level.
RUN_RISE = 0.05

#: At how many levels, of twice the rise each, relaxation is tried just above the highest one.
RISES = 4
#: The part by which uplift is less and, of the joint, by which the crack under the full head is
#: shorter, under a rising level, where the water withdraws [-].
WITHDRAWN = 0.005

#: Relative distance from the end of a path to the level above it that a run must not reach: up to
#: it, highest levels after unstable growth are the same.
ABOVE = AFTER_GROWTH

#: Precision to which it is sought how far the level falls, over the fall that is unstable.
EXACT = 0.02

#: Part of that fall from which on other increments may find all of it.
NEARLY = 0.9

#: Time of an increment of displacement, after the last level, where all loads act in full.
TICK = 1e-3


def critical_columns(case: Case) -> Columns:
    """The columns of a case's critical.csv: unit and meaning."""
    return with_all_joints(CRITICAL, case)


def row(point: Point) -> dict[str, float]:
    """The row of critical.csv of a point, but for trial and value."""
    columns = critical_columns(point.model.case)
    return {name: value for name, value in point.last.items() if name in columns} | {
        "displacement_control": float(point.control not in BY_LEVEL),
        "imposed_displacement": point.imposed,
        "compression": point.compression,
    }


class FailurePath(EquilibriumPath):
    """The equilibria of a case, up to a target level or to failure."""

    def __init__(
        self,
        case: Case,
        interface: Interface,
        target: float | None = None,
        on_step: Callable[[float], None] = lambda level: None,
        to_growth: bool = False,
        rise: float = RISE,
        solver: Mapping[str, float] | None = None,
        known: FailurePath | None = None,
    ) -> None:
        """target: the level [m] to reach, the highest still to come by default; on_step: called
        with the level of each equilibrium; to_growth: whether it is followed, with a law that
        softens in tension or releases its shear, to the first unstable crack growth only; rise: of
        the level that an increment aims at, relative. With a smaller one the levels are prescribed
        up to a smaller part of a joint; solver: parameters of the solver, for a beginning by all
        strategies of a run where single steps lead to no equilibrium; known: another path of the
        same case, whose steps are not solved again.
        """
        self.case, self.interface, self.on_step = case, interface, on_step
        self.solver = solver or {}
        self.points: list[Point] = []
        stepper = known.stepper if known else LoadStepper(case, interface)
        #: the steps so far, see `EquilibriumPath`
        self.solved: Solved = dict(known.solved) if known else {}
        #: whether it begins where only a run has an equilibrium, and whether the run has none under
        #: the weight alone
        self.begun_by_run = self.weight_with_water = False
        #: whether relaxation has reached a higher level from which no path leads on, see `fill_on`
        self.leads_higher = False
        #: the equilibria from which the path has been continued so
        self.filled_on: list[Point] = []
        #: its highest point, if it goes on from there with less uplift
        self.dry_beyond: Point | None = None
        #: the equilibria from which it goes on though its branch has ended before, see `step_over`
        self.stepped_to: list[Point] = []
        #: whether it has been continued from a run, see `run_on`
        self.ran_on = False
        #: the highest level [m] of other paths that pass the unstable growth at its own highest
        #: one; -inf: none
        self.passed_to = -np.inf
        #: the growth [m] that each other path has passed, if this one has, see `passed_growth`;
        #: None: none
        self.other_growths: list[float | None] = []
        #: whether one of them has another highest level
        self.differs_after_growth = False
        #: the runs from the beginning, by the level to which they were to lead
        self.runs: dict[float, LoadStepper] = known.runs if known else {}
        #: the part of a joint that may open or soften before a displacement is prescribed
        self.most_softened = SOFTENED * rise / RISE
        #: whether the loads of a time are those of the last one, but for the level
        self.stepper: LoadStepper = stepper
        self.same_loads = dict[float, bool]()
        #: the equilibrium under the weight alone; None: not known
        self.weighed: Point | None = None
        laws = stepper.model.equilibrium.laws
        #: whether water enters the crack element by element, at each of which the level falls
        self.entering = any(joint["uplift"] == "cracked" for joint in case.joints)
        #: whether a law softens, in tension or in shear
        self.softens = any(law.softens for law in laws.laws)
        brittle = any(law.softens and law.tensile_strength > 0 for law in laws.laws)
        #: whether elements do not resolve the softening in shear of a joint
        self.coarse = brittle_in_shear(case)
        #: whether a joint slips point by point before it slips whole, each of which loses its
        #: cohesion: the increments all the way decide which points are left
        self.loses_cohesion = self.coarse or any(
            law.softens and not law.tensile_strength and 0 < law.intact_cohesion < np.inf
            for law in laws.laws
        )
        self.predicts = not self.coarse
        self.releases_shear = laws.releases_shear
        self.to_growth = to_growth and (self.releases_shear or (brittle and not self.entering))
        # after a step of the weight alone steps can be halved; else the first includes the weight
        if known:
            self.weighed = known.weighed
        elif case["weight_first"] and stepper.weigh():
            self.weighed = point_of(stepper)
        if self.weighed:
            self.fill(self.weighed)
        if not self.points:
            self.begin_by_run()
        time = self.points[-1].state.time if self.points else 0.0
        ahead = [v for t, v in enumerate(case.levels, 1) if t >= time]
        self.target = max(ahead) if target is None else target
        super().__init__(self.points, len(case.levels), TICK, self.solved)
        self.rise = rise

    def begin_by_run(self) -> None:
        """Begin with the equilibria at the first time that a run reaches, by all its strategies."""
        self.begun_by_run = True
        model, run = self.stepper.model, LoadStepper(varied(self.case, self.solver), self.interface)
        run.on_step = lambda _: self.add(Point(model, run.state, run.history.copy()))
        run.advance_to(run.case.times[0])
        self.weight_with_water = run.weight_with_water
        if not run.stopped:
            self.fill(self.points[-1])

    def fill(self, point: Point) -> None:
        """Prescribe the levels, from a point on, until all other loads act in full and a part
        SOFTENED of a joint has opened or softens, or until a step has been halved HALVINGS times.
        """
        smallest, at_rest = 0.5**HALVINGS, softened(point)
        for target in self.case.times:
            length = np.inf
            while (remaining := target - point.state.time) > SAME_TIME:
                new = self.by_level(point, min(length, remaining))
                if not new:
                    return
                end, length = new[-1], new[-1].state.time - point.state.time
                softens = self.on_path(end) and softened(end) > at_rest + self.most_softened
                passed = self.on_path(end) and self.is_beyond_limit(end, point)
                if (softens or passed) and length > smallest:
                    length /= 2
                    continue
                if passed:
                    return
                for equilibrium in new:
                    self.add(equilibrium)
                if softens:
                    return
                point, length = end, 2 * length

    def is_beyond_limit(self, point: Point, begin: Point) -> bool:
        """Whether damage that has grown up to an equilibrium leaves none at a level just above: a
        long step of the level may lead to the falling part of a branch.
        """
        level, grown = (1 + PRECISION) * point.level, point.damage > begin.damage
        if not (self.softens and grown.any()) or level > self.case.highest_level:
            return False
        time = self.case.times[-1] + TICK
        return solve_once(self.solved, point, time, LevelControl(level), 0.0, LEVEL_RISE) is None

    def by_level(self, point: Point, length: float) -> list[Point]:
        """The equilibria at the middle and at the end of the longest step of the level from a
        point, up to a length in time, whose halves lead to the same state; empty if there is none.
        """
        begin, case = point.state.time, self.case

        def reach(start: Point, time: float) -> Point | None:
            control = LevelControl(case.level_at(time))
            return solve_once(self.solved, start, time, control, 0.0, "level")

        whole = reach(point, begin + length)
        for _ in range(HALVINGS):
            middle = reach(point, begin + length / 2)
            if whole and middle:
                end = reach(middle, begin + length)
                if end and self.agree(point, whole, middle, end):
                    return [middle, end]
            whole, length = middle, length / 2
        return []

    def agree(self, begin: Point, whole: Point, middle: Point, end: Point) -> bool:
        """See `EquilibriumPath.agree`; unstable growth is sought once all loads act in full."""
        if not self.on_path(begin):
            return not whole.differs(end, begin)
        return super().agree(begin, whole, middle, end)

    def add(self, point: Point) -> None:
        """Append an equilibrium, if the toe is not crushed before it."""
        if not self.crushed:
            self.points.append(point)
            self.on_step(point.level)

    # -- its shape
    # ----------------------------------------------------------------------------------------------

    @property
    def ends(self) -> bool:
        """Whether its branch ends at the highest level, and the joint does not slide there; where
        water enters the crack another element may follow.
        """
        return self.stops and not (self.entering or self.slides)

    @property
    def branch_ends(self) -> bool:
        """Whether nothing is known of its end but that no increment, however short, leads on."""
        known = self.ends_at_strength or self.falls
        return self.stops and not known

    @property
    def stops_at_water(self) -> bool:
        """Whether no increment leads on, not even to a mechanism, where water enters the crack: it
        may be an element of it at which the level falls, and filling leads on.
        """
        shown = self.slides or self.ends_at_strength or self.crushed_at_top or self.settled(SURE)
        return self.entering and self.stops and not shown

    @property
    def weighed_with_water(self) -> bool:
        """Whether the weight, which is to act first, has led to no equilibrium without water: a law
        with a history then depends on the first level.
        """
        history = self.stepper.model.equilibrium.path_dependent
        return self.weight_with_water and history

    @property
    def loses_drains(self) -> bool:
        """Whether a crack that reaches the drains of a joint takes their effect."""
        return any(j["uplift"] == "cracked" and has_drains(j) for j in self.case.joints)

    @property
    def crushed(self) -> bool:
        """Whether the toe is crushed at its last point."""
        return bool(self.points) and self.crushes(self.points[-1])

    def crushes(self, point: Point) -> bool:
        """Whether the compression at the toe exceeds f_c at a point."""
        return self.case["f_c"] > 0 and point.compression > self.case["f_c"]

    @property
    def arrival(self) -> int | None:
        """The number of the first point at the target or above it; None if there is none."""
        for number, point in enumerate(self.admissible):
            if self.complete(point) and point.level >= self.target:
                return number
        return None

    @property
    def levels(self) -> Array:
        """See `EquilibriumPath.levels`; of all points, as long as none has the last loads in full.

        An earthquake, for example, acts in full only at the last time: a level that is reached
        before counts no more once the path has gone on under all loads.
        """
        levels = super().levels
        if any(map(self.complete, self.points)):
            by_level = [n for n, point in enumerate(self.points) if point.control == "level"]
            levels[[n for n in by_level if not self.on_path(self.points[n])]] = -np.inf
        return levels

    def complete(self, point: Point) -> bool:
        """Whether a point has the loads of the last time."""
        return point.control != "level" or point.state.time == self.case.times[-1]

    def on_path(self, point: Point) -> bool:
        """Whether a point differs from the path under the last loads in nothing but its level."""
        return self.complete(point) or self.has_last_loads(point.state.time)

    def has_last_loads(self, time: float) -> bool:
        """Whether the loads of a time are those of the last one, but for the level."""
        if time not in self.same_loads:
            one, last = (
                Loading.at(self.case, t, 0.0, self.case.tail_at(t))
                for t in (time, self.case.times[-1])
            )
            self.same_loads[time] = self.stepper.same_but_for_level(one, last)
        return self.same_loads[time]

    @property
    def reached(self) -> bool:
        """Whether there is an equilibrium at the target."""
        return self.arrival is not None

    @property
    def admissible(self) -> list[Point]:
        """The points before the toe is crushed or the water withdraws."""
        return self.points[: min(self.counted, len(self.points) - self.crushed)]

    @property
    def crushed_at_top(self) -> bool:
        """Whether crushing ends it; also at its first point."""
        return self.crushed and self.top + 2 >= len(self.points)

    @property
    def mode(self) -> str:
        """How the dam fails; empty if the path does not show it."""
        return "crushed toe" if self.crushed_at_top else super().mode

    # -- its continuation
    # ----------------------------------------------------------------------------------------------

    def follow(self, factor: float, enough: float = np.inf) -> None:
        """Continue until the target is reached, the dam slides or is crushed, the level has settled
        or no further equilibrium is found. A highest level that is not far below the target is
        refined. enough: level above which it is not followed any farther [m].
        """
        while not (self.ended or self.decided(factor) or self.highest > enough):
            self.advance()
            if self.leads_out and self.points[self.top] is not self.dry_beyond:
                self.fill_on()
            if self.to_growth and self.top + 1 < len(self.points):
                self.refine(self.lowest_after_top / (1 - self.unstable_fall))  # how far it falls
                self.refine_fall()
        if not self.reached:
            self.refine(self.target)

    @property
    def leads_out(self) -> bool:
        """Whether the path leads out of the crack's water, or ends where it enters."""
        return not self.to_growth and (self.water_withdraws or (self.entering and self.ended))

    def overshoots(self, begin: Point, end: Point, control: DisplacementControl, kind: str) -> bool:
        """See `EquilibriumPath.overshoots`."""
        least = PRECISION / 2 * end.level
        if not self.entering or end.level <= max(begin.level + least, self.highest):
            return False
        cracks = (column_of("crack_length", number) for number in range(len(self.case.joints)))
        if all(end.last[name] <= begin.last[name] for name in cracks):
            return False
        filled = self.step(end, end.further(control, 0.0), 0.0, kind)
        return filled is None or filled.level < end.level - least

    def fill_on(self) -> None:
        """Continue from the highest level as filling does, which lets no water out and follows no
        falling level: by relaxation at a level just above, if others follow that equilibrium; once
        from each, as the same increments follow again.
        """
        top = self.points[self.top]
        if any(top is point for point in self.filled_on):
            self.leads_higher, self.dry_beyond = True, top
            return
        self.filled_on = [*self.filled_on, top]
        other = self.copied()
        other.cut_after(self.top)
        other.pass_to(next(other.relaxed_above(top, range(RISES)), None))
        if not other.ended:
            other.advance()
            self.leads_higher = other.ended
        if other.ended:
            self.dry_beyond = top
        else:
            vars(self).update(vars(other), leads_higher=False)

    def rise_on(self) -> bool:
        """Continue from the highest level by rises of it that belong to the branch, each twice as
        long; whether there is one. Where a branch splits, increments of a displacement may lead to
        the part on which the level falls, and filling leads to the other one.
        """
        if not self.points or self.reached or self.crushed or self.unfinished:
            return False
        point, rise, risen = self.points[self.top], PRECISION, False
        while True:
            whole, middle = self.raised(point, rise), self.raised(point, rise / 2)
            end = middle and self.raised(middle, rise / 2)
            if not (whole and middle and end and self.agree(point, whole, middle, end)):
                return risen
            if not risen:
                self.cut_after(self.top)
            self.append([middle, end])
            point, rise, risen = end, 2 * rise, True

    def run_on(self) -> bool:
        """Continue from a run that stands just above the highest level, with no less uplift, where
        water enters the crack and the path has led to no mechanism; whether there is one. The path
        has ended at a point that the water reaches, and filling leads over it; with a law that
        softens only where the water withdraws: else a crack grows unstably there.
        """
        shown = self.reached or self.crushed_at_top or self.slides or self.ends_at_strength
        leads_over = self.water_withdraws or not self.softens
        if shown or self.to_growth or not (self.entering and leads_over):
            return False
        top, run = self.points[self.top], self.run_to(self.level_above)
        if run.stopped or not self.has_full_uplift(run.history)[-1]:
            return False
        by = float(np.abs(run.state.jump - top.state.jump).max())
        end = Point(run.model, run.state, run.history.copy(), self.imposed(top) + by, "level")
        other = self.copied()
        other.cut_after(self.top)
        other.pass_to(end)
        other.follow(SURE)
        higher = other.highest > self.highest  # no level counts after which the water withdraws
        if higher:
            vars(self).update(vars(other), ran_on=True)
        return higher

    def step_over(self) -> bool:
        """Continue from an equilibrium at a level just above the highest one to which relaxation
        leads without growth of the crack, and from which a branch leads higher; whether there is
        one. Where a point releases its shear, or the uplift follows the opening, the branch ends,
        or its level falls, and no crack may have grown.
        """
        if not (self.to_growth and self.points) or self.crushed:
            return False
        top = self.points[self.top]
        if not (self.releases_shear or top.uplift_follows):
            return False  # of 125 random dams with bond or endo, none continued this way
        ends = self.relaxed_above(top, range(RISES))
        end = next((end for end in ends if not end.has_grown(top)), None)
        if end is None:
            return False
        other = self.copied()
        other.cut_after(self.top)
        other.pass_to(end)
        other.stepped_to = [*self.stepped_to, end]
        leads_on = other.advance_branch() and other.points[-1].level > end.level
        if leads_on:
            vars(self).update(vars(other))
        return leads_on

    @property
    def level_above(self) -> float:
        """The level above its highest one, up to the target, that a run must not reach [m]."""
        return min((1 + ABOVE) * self.highest, self.target)

    def run_to(self, level: float, before: LoadStepper | None = None) -> LoadStepper:
        """A run from the beginning to a level [m], by all strategies of a run and steps of RUN_RISE
        at most, or the one before to a lower level, continued; one to the same level, to the
        precision, is the same. Where water enters the crack a run may stop by chance: one that does
        is tried from a lower first level, too, also by long steps; if all stop, it is the one that
        has come farthest.
        """
        for known, run in self.runs.items():
            if abs(known - level) <= PRECISION * level:
                return run
        case = before.case if before else self.case
        levels, tails = tuple(min(known, level) for known in case.levels), case.tail_levels
        ways = [(levels, RUN_RISE)]
        if self.entering and not before:
            lower = LOWER_BEGIN * levels[0], *levels[1:]
            ways += (lower, RUN_RISE), (lower, 1.0)
        runs = list[LoadStepper]()
        for first, rise in ways:
            count = int(np.ceil((level - levels[-1]) / (rise * level)))
            further = tuple(np.linspace(levels[-1], level, count + 1)[1:])
            case = varied(case, self.solver, first + further, tails + count * tails[-1:])
            run = before.fork(case) if before else LoadStepper(case, self.interface)
            runs.append(self.finished_run(run))
            if not run.stopped:
                break
        run = max(runs, key=lambda run: run.state.loading.level)
        self.runs[level] = run
        return run

    def finished_run(self, run: LoadStepper) -> LoadStepper:
        """A run, at the end of its levels or stopped."""
        run.predicts = self.predicts
        for state in run.steps():
            if run.path_ended and state.loading.level > (1 - PRECISION) * self.highest:
                run.path_begin = state  # both paths have ended: no other one is begun from there
        return run

    def decided(self, factor: float) -> bool:
        """Whether the target is reached, or the dam slides, is crushed or its level has settled; or
        a crack has grown unstably, if that is to be found.
        """
        # with less water in it, a joint that slides may do so at a higher level
        slides = self.slides and not self.points[self.top].uplift_follows
        if self.reached or self.crushed or slides or self.settled(factor):
            return True
        if self.water_withdraws:  # it may enter again as long as the level rises
            level, highest = self.points[-1].level, max(point.level for point in self.points)
            return level < (1 - FALL) * highest or level > self.target
        return self.to_growth and self.grows

    def settled(self, factor: float) -> bool:
        """See `EquilibriumPath.settled`; levels with less uplift say nothing of it."""
        return not self.water_withdraws and super().settled(factor)

    @property
    def water_withdraws(self) -> bool:
        """Whether the water leaves the crack under a higher level: single points that close again
        part it from the reservoir. From there on the uplift is less than that of an open crack, and
        the levels do not count.
        """
        return self.counted < len(self.points)

    @property
    def counted(self) -> int:
        """The number of points up to the last one with as much uplift, or as long a crack full of
        water, as any, if the water withdraws after it: far below the highest level it does as the
        dam fails.
        """
        number, levels = len(self.points), np.array([point.level for point in self.points])
        if not self.entering or not number or levels[-1] < NEAR_HIGHEST * levels.max():
            return number
        parts, lower = [point.wet_parts for point in self.points], levels < levels[-1]
        for wet in np.array(parts).transpose(2, 0, 1):  # of a joint: (points, 2)
            largest = wet[lower].max(axis=0, initial=0.0)
            # where the tailwater enters a joint, its uplift is less above the same crack
            if np.all(wet[-1] < largest - WITHDRAWN * np.array([largest[0], 1.0])):
                full = np.any(wet >= largest - ROUND_OFF, axis=1)
                number = min(number, int(np.flatnonzero(full)[-1]) + 1)
        return number

    def has_full_uplift(self, history: History) -> BoolArray:
        """In which steps of a history the water reaches as far in all joints as on the path, before
        it withdraws: by the uplift or by the crack that is full of it.
        """
        rows, equilibrium = history.rows, self.stepper.model.equilibrium
        largest = np.max([point.wet_parts for point in self.admissible], axis=0)
        full = np.full(len(history), True)
        for number, joint in enumerate(equilibrium.interface.joints):
            uplifts = joint.width * np.array(rows[column_of("U", number)])
            shares = filled_part(
                joint, equilibrium.unit_weight, uplifts, rows["level"], rows["tail_level"]
            )
            wet = np.array([shares, rows[column_of(FULL_HEAD, number)]])
            full &= np.any(wet >= largest[:, [number]] - ROUND_OFF, axis=0)
        return full

    def opens_beyond(self, history: History) -> bool:
        """Whether a crack that water enters has grown unstably in a run beyond the highest level:
        its law softens, or it has less uplift than here; else `run_on` leads on.
        """
        return self.entering and (self.softens or not self.has_full_uplift(history)[-1])

    @property
    def grows(self) -> bool:
        """Whether a crack has grown unstably: the level has fallen, or the branch has ended; not
        beyond its highest level if the joint slides there.
        """
        count = self.top + 1 if self.slides else len(self.points)
        return any(n < count for n in self.jumps) or self.growth_until(count) is not None

    @property
    def lowest_after_top(self) -> float:
        """The lowest level from its highest one on [m]."""
        return min(point.level for point in self.points[self.top :])

    @property
    def nearly_grows(self) -> bool:
        """Whether the level has fallen, before its highest one, by nearly as much as is unstable
        growth: other increments may find that it has.
        """
        return self.to_growth and self.growth_until(self.top + 1, NEARLY) is not None

    @property
    def jumps(self) -> list[int]:
        """The numbers of the first points of branches that are reached by unstable growth: not of
        those to which the path has stepped, and not where the whole joint slides before.
        """
        known, points = set(map(id, self.stepped_to)), self.points
        return [n for n in self.starts if not (id(points[n]) in known or points[n - 1].slides)]

    def first_branch(self) -> FailurePath:
        """The path up to the first unstable growth by which it has passed to another branch."""
        return self.up_to(self.jumps[0] - 1)

    def up_to(self, number: int) -> FailurePath:
        """The path that ends at a point of a number."""
        other = self.copied()
        other.cut_after(number)
        other.ended = True
        return other

    @property
    def passes_growth(self) -> bool:
        """Whether it is followed beyond unstable growth: water enters a crack that softens."""
        return self.entering and self.softens and not self.to_growth

    @property
    def branches_with_less_tension(self) -> list[int]:
        """The numbers of the first points of branches, up to the highest point, that have much less
        tension than the point before: they are reached by unstable crack growth.
        """
        points, top = self.points, self.top
        return [n for n in self.starts if n <= top and points[n].leaps(points[n - 1])]

    def up_to_growth(self) -> FailurePath:
        """The path up to an unstable growth of a crack that water enters, if its highest level is
        the same up to what levels after growth are compared with; itself if there is none.
        """
        if not (self.passes_growth and self.starts):
            return self
        highest = np.maximum.accumulate(self.levels)
        least = (1 - ABOVE) * self.highest
        near = (n for n in self.branches_with_less_tension if highest[n - 1] > least)
        number = next(near, None)
        return self if number is None else self.up_to(number - 1)

    @property
    def precision(self) -> float:
        """Relative difference up to which its highest level and those of other ways are the same:
        less where they differ in each point that loses its cohesion.
        """
        return PRECISION / 2 if self.loses_cohesion else PRECISION

    @property
    def varies(self) -> bool:
        """Whether paths by longer increments have had quite another highest level."""
        lowest, highest = self.interval
        return highest - lowest > ABOVE * highest

    def widen(self, other: EquilibriumPath, precision: float) -> bool:
        """See `EquilibriumPath.widen`. Where water enters the crack of a joint that softens, a path
        may pass the unstable growth at the highest level of another one, and reach a higher level:
        they agree on the growth, and the lower path is the one to follow. They agree on it, too, if
        they pass the same growth, and reach different levels.
        """
        assert isinstance(other, FailurePath)
        growth = self.passed_growth
        same = growth is not None and other.grows_at(growth)
        if growth is not None:
            passed = growth if same else other.passed_growth
            self.other_growths = [*self.other_growths, passed]
        low, high = (self, other) if self.highest < other.highest else (other, self)
        apart = high.highest > (1 + precision) * low.highest
        if not (apart and self.passes_growth and not low.slides and high.grows_at(low.highest)):
            differs = super().widen(other, precision)
            self.differs_after_growth |= differs and same
            return differs and not same
        low.passed_to = max(low.passed_to, high.highest, high.passed_to)
        return self is high

    def grows_at(self, level: float) -> bool:
        """Whether a crack grows unstably at a level [m] on the way to its highest one, to the
        precision: the level falls from there by as much, or the branch is left there for a state
        with much less tension.
        """
        highest = np.maximum.accumulate(self.levels)
        branches = [highest[number - 1] for number in self.branches_with_less_tension]
        before = np.array([*self.levels_before_falls(self.top + 1), *branches])
        return bool(np.any(np.abs(before - level) <= PRECISION * level))

    @property
    def passed_growth(self) -> float | None:
        """The level [m] below its highest one at which its branch was left for a state with much
        less tension: unstable crack growth; None if there is none.
        """
        numbers = self.branches_with_less_tension
        return self.points[numbers[0] - 1].level if numbers else None

    @property
    def growth_of_all(self) -> tuple[float, float] | None:
        """The lowest and the highest growth [m] that this path and all others have passed; None if
        one of them has passed none, or there are no others.
        """
        growths = [self.passed_growth, *self.other_growths]
        passed = [growth for growth in growths if growth is not None]
        return (min(passed), max(passed)) if len(passed) == len(growths) > 1 else None

    # -- refinement of its end
    # ----------------------------------------------------------------------------------------------

    def insert(self, first: int, new: list[Point]) -> None:
        """Insert equilibria; if the toe is crushed at one of them, it is the last one."""
        super().insert(first, new)
        for number in range(first + 1, first + 1 + len(new)):
            if self.crushes(self.points[number]):
                del self.points[number + 1 :]
                return

    def refine_fall(self) -> None:
        """Insert points of the branch where the level may be lowest beyond its highest one, as long
        as it may have fallen unstably there: increments are so long that the level is nearly in
        line, to a part of that fall.
        """
        for _ in range(MOST_REFINED):
            fallen = self.unstable_fall * self.highest
            bounds = [(-self.bound(n, -1), n) for n in range(self.top, len(self.points) - 1)]
            possible, first = min(bounds, default=(self.highest, self.top))
            known = self.levels[self.top :].min()
            near = known - possible <= EXACT * fallen
            if near or possible > self.highest - fallen or known < self.highest - fallen:
                return
            self.insert(first, self.between(first))

    def uncertain(self) -> tuple[int, float]:
        """See `EquilibriumPath.uncertain`: also where it passes the target or f_c."""
        arrival = self.arrival
        if self.crushed_at_top or arrival is not None:
            right = len(self.points) - 1 if self.crushed or arrival is None else arrival
            ends = [p.level for p in self.points[max(right - 1, 0) : right + 1]]
            return right - 1, self.highest + max(ends) - min(ends)
        return super().uncertain()


@dataclass(frozen=True)
class Trial:
    """A value of the varied quantity, and the equilibrium path of the dam with it."""

    value: float
    path: FailurePath

    @property
    def stands(self) -> bool:
        """Whether there is an equilibrium at the target level."""
        return self.path.reached


def brittle_in_shear(case: Case) -> bool:
    """Whether elements do not resolve the softening in shear of a joint: its points soften one by
    one.
    """
    zones = map(process_zone.shear, case.joints)
    return any(zone and zone.elements < FEW for zone in zones)


def point_of(stepper: LoadStepper) -> Point:
    """The last converged step of a loading."""
    return Point(stepper.model, stepper.state, stepper.history.copy())


def softened(point: Point) -> float:
    """The largest part of a joint that is open or softens."""
    equilibrium, parts = point.model.equilibrium, list[float]()
    for number, joint in enumerate(equilibrium.interface.joints):
        row = JointState(equilibrium, point.state, number).row
        parts.append((row["crack_length"] + row["process_zone"]) / joint.length)
    return max(parts)
