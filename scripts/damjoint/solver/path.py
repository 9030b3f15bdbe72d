"""The equilibrium path under displacement control, past limit points and unstable crack growth.

The level is unknown, and prescribed is how far the jumps move along the direction of the last
increment: the normal plane of Riks (Int. J. Solids Struct. 15, 1979), which passes limit points and
snap-backs. Where this does not converge it is the crest's displacement, or the mean jump of the
points whose damage grows [indirect displacement control: de Borst, Comput. Struct. 25, 1987].

A *branch* is the limit of short increments: an increment belongs to it if its two halves lead to
the same state. Where no increment does, however short, the branch ends, and where the level falls
it is passed over by single increments. A path whose level does not rise any more, however large the
displacement, is a mechanism.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from copy import copy
from dataclasses import replace
from itertools import takewhile
from typing import TypeVar

import numpy as np

from .. import ROUND_OFF
from ..arrays import Array
from ..input.case import Case
from ..model.results import column_of
from .controls import (
    BodyControl,
    DirectionControl,
    DisplacementControl,
    HeelControl,
    LevelControl,
    crack_tip,
)
from .path_point import FALL, PRECISION, SLIP, STRAIGHT, Point, Solved, solve_once
from .relaxation import over_unstable_growth

P = TypeVar("P", bound="EquilibriumPath")

# The length of the increments

#: First increment over the displacement so far [-].
FIRST = 0.05
#: Relative rise of the level that an increment aims at [-]; fewer equilibria above, more below.
RISE = 0.02
#: Least increment over the one before [-].
SHRINKING = 0.25
#: Largest increment over the one before [-].
GROWTH = 2.0

#: Part of the largest length at which the predictor's error is allowed that is tried next [-].
SAFETY = 0.8

# An increment is halved until it passes over no limit point, see `STRAIGHT`

#: This is looked at where the level is at least this part of the highest one [-].
NEAR_HIGHEST = 0.95
#: It is not looked at where an increment is shorter than this, over the displacement so far [-].
SHORT = 1e-3

# An increment that does not converge is tried with the next control, then shorter

#: Factor by which it is shortened [-].
SHORTENED = 1 / 16
#: It is given up when it is shorter than this, over the first trial [-]: the branch ends there.
SMALLEST = 1e-6
#: The same over the displacement so far [-].
LEAST = 1e-8
#: Parts of its length at which the slip is prescribed at last [-]: a long one may lead to another
#: branch.
SLIP_PARTS = SHORTENED**3, SHORTENED**4

# Where points are opened one by one, and no other displacement leads on

#: What is prescribed there: the opening of the point that opens next; if that leads nowhere, the
#: level.
TIP, LEVEL_RISE = "tip", "level rise"
#: What is prescribed where it is no displacement.
BY_LEVEL = "level", LEVEL_RISE
#: Largest relative rise of the level that is tried [-].
LARGEST_RISE = 4e-4
#: How many rises are tried, each a quarter of the one before.
MOST_RISES = 5

# A branch counts as lost after many short increments

#: An increment is short below this part of the displacement so far [-].
CRAWL = 1e-5
#: Number of short ones, one after the other.
MOST_SHORT = 40

#: The end of a branch is sought until a short increment would raise the level, by the slope before,
#: by less than this, over the level [-].
NEGLIGIBLE_RISE = 1e-6

# Increments where a branch ends, or falls

#: Relative rise of the level that they aim at [-].
SMALL_RISE = 0.005
#: Increment of the mean jump of the process zone over its change in the last step [-].
ZONE_GROWTH = 1.5
#: Parts of its length at which an increment is tried [-].
PARTS = (1, 1 / 4, 1 / 16)
#: Increments of the crest that are tried last, over the displacement so far [-].
JUMPS = (0.01, 0.05, 0.25)

# The highest level

#: Growth of the displacement after which a level counts as not rising any more [-]: for a first
#: estimate.
ROUGH = 1.5
#: The same for the result.
SURE = 4.0
#: Relative difference up to which levels are the same [-].
PLATEAU = 1e-7
#: A joint takes part in a mechanism if its jumps change by more than this, over the largest change.
MOVES = 0.5
#: Most increments that are inserted where a branch may be higher than its points.
MOST_REFINED = 40
#: How far a level may be above the points on both sides, over how far their lines meet above them,
#: away from the highest level.
CONVEX = 2
#: The path is repeated from this relative distance below the highest level [-].
REPEATED = 0.01
#: By how many times shorter increments it is repeated.
SHORTER = 4

#: A path whose level falls below this part of its highest one is not followed farther [-]: the
#: joints hold a sixteenth of the water's thrust, and what is left of them will not hold more again.
STRENGTH_LOST = 0.25
#: Most equilibria on a path by increments of the usual rise; by shorter ones as many more.
MOST_POINTS = 800


class EquilibriumPath:
    """Equilibria one after the other, each with a larger displacement than the one before."""

    #: whether it is followed to the first unstable crack growth only, and increments are short
    #: enough to find it
    to_growth = False
    #: whether its increments are halved until their halves lead to the same state
    verified = True
    #: whether those that continue the one before, as predicted, need no halves
    predicts = False

    def __init__(
        self, points: list[Point], time: float, tick: float = 0.0, solved: Solved | None = None
    ) -> None:
        """points: the first ones, the last of them to continue from; time: whose loads act, but for
        the level; tick: the time that an increment takes, for its row in the tables; solved: steps
        that have been solved.
        """
        self.points, self.time, self.tick = points, time, tick
        #: whether no further equilibrium has been found
        self.ended = not points
        #: whether the end of a branch is passed over by relaxation, not by a displacement
        self.relaxes = False
        #: how many increments one after the other have been short
        self.crawled = 0
        #: the number of the first point of each branch but the first
        self.starts = list[int]()
        #: the largest displacement of joint and crest before the first increment [m]
        self.size = points[-1].displacement if points else 0.0
        #: the next increment where a branch has ended [m]
        self.over = FIRST * self.size
        #: relative rise of the level that an increment aims at
        self.rise = RISE
        #: relative fall of the level that is unstable growth
        self.unstable_fall = FALL
        #: the next increment, over what the joints moved in the last one
        self.growth = 1.0
        #: the lowest and the highest of the highest levels [m] of the paths that have led to this
        #: one by shorter increments, where they differ, see `repeated`
        self.interval = np.nan, np.nan
        #: the longest increment [m]
        self.longest = np.inf
        #: intervals in which no increment leads to a state of the branch, by the points before them
        self.closed = list[Point]()
        #: the bounds of the level between its points, see `bound`: with the points that they follow
        #: from, by their identities
        self.bounds = dict[tuple[int, ...], tuple[tuple[Point, ...], float]]()
        #: the steps of this path and its copies
        self.solved: Solved = {} if solved is None else solved

    @property
    def falls(self) -> bool:
        """Whether the level falls unstably beyond its highest one, on the first branch."""
        first = self.starts[0] if self.starts else len(self.points)
        levels = self.levels[self.top : first]
        return bool(len(levels) and levels.min() < (1 - self.unstable_fall) * self.highest)

    @property
    def ends_at_strength(self) -> bool:
        """Whether all strength of a joint is used at its highest level, and no increment from there
        converges.
        """
        return self.stops and self.points[self.top].slipping is not None

    @property
    def stops(self) -> bool:
        """Whether increments have led to its highest level, and none leads on."""
        stops = bool(self.points) and self.ended and not self.exhausted
        return stops and self.points[self.top].control != "level"

    @property
    def exhausted(self) -> bool:
        """Whether it has as many points as a path may have, or the strength is lost."""
        return self.unfinished or self.loses_strength

    @property
    def loses_strength(self) -> bool:
        """Whether hardly any strength remains on it."""
        return self.points[-1].level < STRENGTH_LOST * self.highest

    @property
    def unfinished(self) -> bool:
        """Whether it has as many points as a path may have."""
        return len(self.points) >= MOST_POINTS * max(1.0, RISE / self.rise)

    def add(self, point: Point) -> None:
        """Append an equilibrium."""
        self.points.append(point)

    def imposed(self, point: Point) -> float:
        """The displacement imposed at a point, with that before the first increment [m]."""
        return point.imposed or self.size

    # -- its shape
    # ----------------------------------------------------------------------------------------------

    @property
    def admissible(self) -> list[Point]:
        """The points that are admissible."""
        return self.points

    @property
    def counted(self) -> int:
        """The number of points up to which the levels count."""
        return len(self.points)

    @property
    def levels(self) -> Array:
        """The level of each point [m]; -inf where loads that do not depend on it differ from those
        of the path's end.
        """
        return np.array([p.level for p in self.points])

    @property
    def top(self) -> int:
        """The number of the point with the highest level; of a plateau, the first."""
        levels = self.levels[: len(self.admissible)]
        return int(np.argmax(levels >= (1 - PLATEAU) * levels.max())) if len(levels) else 0

    @property
    def highest(self) -> float:
        """Its highest level [m]; nan if there is none."""
        return self.points[self.top].level if self.points else np.nan

    @property
    def limit_point(self) -> int:
        """The number of the point from which on the level rises by less than the precision."""
        return int(np.argmax(self.levels >= (1 - PRECISION / 2) * self.highest))

    @property
    def slides(self) -> bool:
        """Whether all of the joint's strength is used at its highest level."""
        return bool(self.points) and self.points[self.top].slides

    def settled(self, factor: float) -> bool:
        """Whether the level has not risen while the displacement grew so many times, and does not
        recover from a fall.
        """
        far = self.points[-1].imposed / factor
        by_point = zip(self.levels, self.points, strict=True)
        early = [level for level, p in by_point if self.imposed(p) <= far]
        if not early or self.points[-1].level > early[-1] * (1 + PRECISION / 2):
            return False
        return self.points[self.top].level <= max(early) * (1 + PRECISION / 2)

    @property
    def mode(self) -> str:
        """How the dam fails; empty if the path does not show it."""
        if self.slides or (not self.movements and self.failing):
            return "sliding"
        if not self.failing:
            return ""
        (number, *_), model = self.failing, self.points[-1].model
        interface, case = model.equilibrium.interface.joints[number], model.case
        crack = self.points[-1].last[column_of("crack_length", number)]
        along = interface.xi * interface.length
        return movement(case.joints[number], crack, along, self.movements[number])

    @property
    def failing(self) -> tuple[int, ...]:
        """The numbers of the joints at which it fails: that slides, or whose jumps change most
        beyond the limit point; empty if the path does not show it.
        """
        top = self.points[self.top] if self.points else None
        ends = top is not None and self.top + 1 == len(self.points)
        if top:
            slides = top.slipping if ends else top.sliding
            if slides is not None:
                return (slides,)
        sizes = np.array([np.abs(moved).max() for moved in self.movements])
        return tuple(np.flatnonzero(sizes > MOVES * sizes.max(initial=0)).tolist())

    @property
    def joint(self) -> str:
        """Their names; empty if the dam has a single joint."""
        return self.points[-1].model.case.named(self.failing) if self.points else ""

    @property
    def movements(self) -> list[Array]:
        """By how much the jumps at the nodes of each joint (n, 3) have changed beyond the limit
        point [m]; empty if the path ends there.
        """
        if not self.points or self.limit_point + 1 >= len(self.points):
            return []
        top, last = self.points[self.limit_point], self.points[-1]
        change = last.state.jump - top.state.jump
        joints = last.model.equilibrium.interface.joints
        return [joint.mean_at_nodes(joint.jumps(joint.at_nodes, change)) for joint in joints]

    # -- its continuation
    # ----------------------------------------------------------------------------------------------

    def advance(self) -> None:
        """Append the next equilibria of the branch; below its highest level, or where the branch
        ends or its increments stay short, the next one, whether of the branch or not.
        """
        last = self.points[-1]
        if not self.advance_branch():
            self.crawled = 0
            self.pass_over(last)

    def advance_branch(self) -> bool:
        """Append the next equilibria of the branch; whether there are any. Below its highest level,
        or where increments stay short, none are sought; where a joint slips whole, no short ones.
        To the first unstable growth the slip is prescribed where no other displacement leads on.
        """
        last, part = self.points[-1], 1.0
        if last.level < (1 - self.unstable_fall) * self.highest or self.crawled > MOST_SHORT:
            return False
        while part > (least := SHORTENED if last.slipping is not None else SMALLEST):
            if self.advance_by(last, last.controls, part):
                return True
            if last.opens_points and part == 1:
                new = self.by_tip(last) or self.by_level_rise(last)
                if new:
                    self.append(new)
                    self.crawled = 0
                    return True
            part *= SHORTENED
        if not self.to_growth or last.control == SLIP:
            return False
        parts = (part for part in SLIP_PARTS if part > least)
        return any(self.advance_by(last, last.slip_control, part) for part in parts)

    def advance_by(
        self, last: Point, controls: Mapping[str, DisplacementControl], part: float
    ) -> bool:
        """Append the next equilibria of the branch by a part of the next increment of one of these
        controls; whether there are any.
        """
        for kind, control in controls.items():
            by = part * self.increment(control)
            negligible = 0.0 if kind == SLIP else self.negligible(last, control)
            least = max(LEAST * self.imposed(last), negligible)
            if abs(by) < least and part < 1:
                continue
            smallest = abs(by) * (SHRINKING if last.opens_points and part == 1 else SHORTENED)
            if abs(by) < least:  # one control creeps to where it turns, and another one leads on
                by, smallest = float(np.copysign(least, by)), least / 2
            new, error = self.along(last, control, by, smallest, kind)
            if new:
                reached = new[-1].imposed - self.imposed(last)
                self.append(new, error=error, shortened=reached < 0.9 * abs(by) or part < 1)
                short = reached < CRAWL * self.imposed(last)
                self.crawled = self.crawled + 1 if short else 0
                return True
        return False

    def by_tip(self, last: Point) -> list[Point]:
        """The equilibria at the middle and the end of an increment of the opening of the point
        that opens next; empty if there is none.
        """
        tip = crack_tip(last.model.equilibrium, last.state)
        if tip is None:
            return []
        control, by = DirectionControl(0.0, tip[0]), tip[1]
        return self.along(last, control, by, SHORTENED**2 * by, TIP)[0]

    def by_level_rise(self, last: Point) -> list[Point]:
        """The equilibria at the middle and the end of the largest rise of the level in which the
        jumps change steadily; empty if there is none, or relaxation leads to one with less damage.
        """
        for rise in (LARGEST_RISE / 4**n for n in range(MOST_RISES)):
            middle = self.raised(last, rise / 2)
            end = middle and self.raised(middle, rise / 2)
            if middle and end and last.steady(middle, end):
                relaxed = self.relaxed(last, rise)
                return [] if relaxed and end.beyond(relaxed, last) else [middle, end]
        return []

    def raised(self, point: Point, rise: float) -> Point | None:
        """The equilibrium at a level higher by a relative rise."""
        level, time = point.level * (1 + rise), max(point.state.time, self.time) + self.tick
        if level > point.model.case.highest_level:
            return None
        end = solve_once(self.solved, point, time, LevelControl(level), 0.0, LEVEL_RISE)
        if end is None:
            return None
        return replace(end, imposed=self.imposed(point) + float(np.abs(end.movement).max()))

    def negligible(self, point: Point, control: DisplacementControl) -> float:
        """The increment from a point [m] up to which the branch ends there, to the precision: it is
        short, and the level would rise little if it went on as in the last one.
        """
        before, moved = point.state.previous, abs(point.moved(control))
        if before is None or not before.pressures:
            return 0.0
        rise = point.level - before.loading.level
        if rise < 0 and point.opens_points:  # the snap-back of a point begins with short ones
            return 0.0
        short = CRAWL * self.imposed(point)
        return min(short, NEGLIGIBLE_RISE * point.level * moved / abs(rise)) if rise else short

    def pass_over(self, last: Point) -> None:
        """Append an equilibrium beyond a point, whether of its branch or not."""
        self.pass_to(self.by_relaxation(last) if self.relaxes else self.by_displacement(last))

    def pass_to(self, end: Point | None) -> None:
        """Append an equilibrium beyond the last point, see `pass_over`; None: there is none."""
        last, self.ended = self.points[-1], end is None
        if end:
            rise = max((end.level - last.level) / end.level, 1e-12)
            by = end.imposed - self.imposed(last)
            self.over = by * min(max(SMALL_RISE / rise, SHRINKING), GROWTH)
            self.append([end], another=True)

    def by_displacement(self, last: Point) -> Point | None:
        """The next equilibrium at a larger displacement of the crest; where it moves back, of the
        process zone, which comes first while it does; of the heel; of the crest, over a snap-back
        of all of them.
        """
        far, crest = self.imposed(last), last.history.rows["crest_ux"][-2:]
        by = max(self.over, SHORT * far)
        controls = {"crest": BodyControl(0.0), **last.controls, "heel": HeelControl(0.0)}
        zone = last.controls.get("zone")
        lengths = {"crest": by, "zone": ZONE_GROWTH * last.moved(zone) if zone else 0.0, "heel": by}
        backwards = last.control == "zone" and crest[-1] < crest[0]
        order = sorted(lengths, key=lambda kind: backwards and kind == "crest")
        tried = [(kind, part * lengths[kind]) for kind in order for part in PARTS]
        for kind, by in [*tried, *(("crest", part * far) for part in JUMPS)]:
            if abs(by) <= LEAST * far:  # it would lead to the same point
                continue
            end = self.step(last, last.further(controls[kind], by), by, kind)
            if end:
                return end
        return None

    def by_relaxation(self, last: Point) -> Point | None:
        """The equilibrium after unstable crack growth at a level higher by the precision, and twice
        as much from one relaxation to the next, as long as there is one.
        """
        number, again = len(self.points), 0
        while number - 1 - again in self.starts:
            again += 1
        return next(self.relaxed_above(last, range(again, -1, -1)), None)

    def relaxed_above(self, last: Point, powers: Iterable[int]) -> Iterator[Point]:
        """Those of `relaxed` that there are at levels higher by the precision times these powers of
        2.
        """
        points = (self.relaxed(last, 2**power * PRECISION) for power in powers)
        return filter(None, points)

    def relaxed(self, last: Point, rise: float) -> Point | None:
        """The equilibrium to which relaxation leads at a level higher than a point's by a relative
        rise; None if there is none.
        """
        time = max(last.state.time, self.time) + self.tick
        control = LevelControl(last.level * (1 + rise))
        result, _ = over_unstable_growth(last.model, last.state, time, control, True)
        if result is None:
            return None
        by = float(np.abs(result.state.jump - last.state.jump).max())
        return last.after(result, self.imposed(last) + by, "level")

    def append(
        self, new: list[Point], another: bool = False, error: float = 0.0, shortened: bool = False
    ) -> None:
        """Append equilibria, reached by an increment, and choose the next increment; another:
        whether they may be of another branch; error: see `along`; shortened: whether a longer one
        was tried first.
        """
        last = self.points[-1]
        if another and len(self.points) > 1:  # nothing has led to the first point
            self.starts.append(len(self.points))
        rise = (new[-1].level - last.level) / new[-1].level
        growth = min(self.rise / max(rise, 1e-12), SAFETY / error if error else np.inf)
        growth = min(max(growth, SHRINKING), 1.0 if shortened else GROWTH)
        self.growth = growth * len(new)
        for point in new:
            self.add(point)
        self.ended = self.exhausted

    def increment(self, control: DisplacementControl) -> float:
        """The next increment of a control [m]: what it measures in the last movement, times the
        growth; without a last movement, a part of the displacement so far.
        """
        last = self.points[-1]
        if last.state.previous is None or not last.movement.any():
            return FIRST * self.imposed(last)
        factor = min(self.growth, self.longest / float(np.abs(last.movement).max()))
        by, least = factor * last.moved(control), CRAWL * self.imposed(last)
        # as the next point opens, the rest of the joint may hardly move
        return float(np.copysign(least, by)) if last.control == TIP and abs(by) < least else by

    def along(
        self, point: Point, control: DisplacementControl, by: float, smallest: float, kind: str
    ) -> tuple[list[Point], float]:
        """The equilibria at the middle and at the end of the longest increment from a point that
        belongs to the branch, from a length down to the smallest one [m]; empty if there is none.
        Or that at the end only, if it is as predicted, with the predictor's error over what is
        allowed; 0: not known.
        """
        whole: Point | None = None
        while abs(by) > smallest:
            ahead = point.further(control, by)
            whole = whole or self.step(point, ahead, by, kind)
            if whole is None:
                by *= SHRINKING
                continue
            if self.overshoots(point, whole, control, kind):
                whole, by = None, by / 2
                continue
            equilibrium = point.model.equilibrium
            if not (self.verified and (equilibrium.path_dependent or equilibrium.flowing)):
                return [whole], 0.0
            error = self.predictor_error(point, whole)
            if error <= 1:
                return [whole], error
            middle = self.step(point, point.further(control, by / 2), by / 2, kind)
            end = middle and self.step(middle, ahead, by / 2, kind)
            if middle and end and self.agree(point, whole, middle, end):
                if end.unloads(point) or (point.opens_points and middle.unloads(point)):
                    whole, by = middle, by / 2
                    continue
                moved = np.abs(end.state.jump - point.state.jump).max()
                short = kind == TIP or moved < SHORT * self.imposed(point)
                if short or self.straight(point, middle, end):
                    return [middle, end], 0.0
            whole, by = middle, by / 2 * (SHRINKING if middle is None else 1)
        return [], 0.0

    def overshoots(self, begin: Point, end: Point, control: DisplacementControl, kind: str) -> bool:
        """Whether an increment leads higher than any point before only as water has not entered the
        points that it opens: at its end, the level with this water is lower.
        """
        return False

    def predictor_error(self, begin: Point, end: Point) -> float:
        """How far an increment is off the one before, over what is allowed if it is to need no
        halves; inf if it needs them.
        """
        if not self.predicts or (self.to_growth and self.leaps(begin, end)) or end.unloads(begin):
            return np.inf
        highest = max(self.highest, begin.level, end.level)
        return begin.prediction_error(end, highest, self.to_growth)

    def agree(self, begin: Point, whole: Point, middle: Point, end: Point) -> bool:
        """Whether one step and two halves lead to the same state; up to unstable growth, also
        whether no tension is lost, and no water enters, at once in one of the halves.
        """
        grows = self.to_growth and self.grows_at_once(begin, middle, end)
        return not (grows or whole.differs(end, begin))

    def grows_at_once(self, begin: Point, middle: Point, end: Point) -> bool:
        """Whether tension is lost, or water enters, at once in one half of an increment."""
        if self.leaps(begin, middle) or self.leaps(middle, end):
            return True
        bend = np.abs(middle.uplifts - (begin.uplifts + end.uplifts) / 2).max(initial=0)
        enters = bend > FALL * middle.thrust and not end.reaches_joint(begin)
        lost = end.tension_lost(middle) - middle.tension_lost(begin)
        return bool(enters or abs(lost) / 2 > FALL * middle.thrust)

    def leaps(self, begin: Point, end: Point) -> bool:
        """Whether tension is lost at once in an increment, see `Point.leaps`; where points are
        opened one by one, also whether one of them breaks at once: the level may fall within, by
        more than the tension that is lost.
        """
        return end.leaps(begin) or (end.opens_points and end.opens_at_once(begin))

    def straight(self, begin: Point, middle: Point, end: Point) -> bool:
        """Whether no limit point is between three equilibria: the levels are in line, or low; where
        they fall beside the highest one, in line to the precision.
        """
        bend = abs(middle.level - (begin.level + end.level) / 2)
        levels = [point.level for point in (begin, middle, end)]
        highest = max(self.highest, *levels)
        beside = levels != sorted(levels) and max(levels) > (1 - STRAIGHT) * highest
        least = PRECISION if beside else STRAIGHT
        return bend <= least * highest or middle.level < NEAR_HIGHEST * highest

    def step(
        self, point: Point, control: DisplacementControl, by: float, kind: str
    ) -> Point | None:
        """The equilibrium at the value of a control, an increment [m] further than a point."""
        time = max(point.state.time, self.time) + self.tick
        return solve_once(self.solved, point, time, control, self.imposed(point) + abs(by), kind)

    # -- refinement of its highest level
    # ----------------------------------------------------------------------------------------------

    def refine(self, wanted: float = np.inf) -> None:
        """Insert points of the branch where the level may be higher, to the precision; no more than
        needed to show that a wanted level is out of reach.
        """
        for _ in range(MOST_REFINED):
            first, possible = self.uncertain()
            known = not possible - self.highest > PRECISION / 2 * possible
            if known or possible < wanted < np.inf:
                return
            self.insert(first, self.between(first))

    def copied(self: P) -> P:
        """Another path with the same points, to be continued independently."""
        other = copy(self)
        other.points, other.starts = list(self.points), list(self.starts)
        other.closed = list(self.closed)
        return other

    def repeated(self: P) -> P | None:
        """The path by shorter increments from before its highest level, to be continued; None if
        they lead to the same level, to the precision.
        """
        top = self.points[self.top] if self.points else None
        if top is None or top.is_last:
            return None
        again = self.by_shorter()
        if not self.widen(again, PRECISION / 2):
            return None
        again.longest = np.inf
        again.interval = self.interval
        return again

    def widen(self, other: EquilibriumPath, precision: float) -> bool:
        """Whether the highest level of another path differs by more than a relative precision; the
        interval of this one then contains both.
        """
        ends = [float(self.highest), float(other.highest)]
        if max(ends) - min(ends) <= precision * max(ends):
            return False
        known = [*ends, *self.interval]
        self.interval = float(np.fmin.reduce(known)), float(np.fmax.reduce(known))
        return True

    def by_shorter(self: P) -> P:
        """The path with shorter increments, compared with their halves, from before its highest
        level to beyond it.
        """
        again = self.copied()
        before = self.levels[: self.top] < (1 - REPEATED) * self.highest
        begin = max([0, *np.flatnonzero(before), *(n for n in self.starts if n <= self.top)])
        lengths = [self.length(number) for number in range(begin, self.top)]
        again.cut_after(begin)
        again.closed, again.ended = list[Point](), False
        again.growth, again.longest = 1.0, max(lengths, default=0.0) / SHORTER
        again.verified, distance = True, 0.0
        while not again.ended and distance < sum(lengths) + 2 * again.longest:
            number = len(again.points)
            if not again.advance_branch() or len(again.points) == number:
                break  # the branch ends, or its next points are not admissible
            distance += sum(again.length(n) for n in range(number - 1, len(again.points) - 1))
        again.verified = self.verified
        again.refine()
        return again

    def growth_until(self, number: int, part: float = 1.0) -> float | None:
        """The level [m] of the first limit point among so many points, after which the level falls
        unstably, or by a part of such a fall; None if there is none.
        """
        before = self.levels_before_falls(number, part)
        return float(before[0]) if len(before) else None

    def levels_before_falls(self, number: int, part: float = 1.0) -> Array:
        """The highest level [m] before each of so many points at which it has fallen unstably, or
        by a part of such a fall.
        """
        levels = self.levels[:number]
        highest = np.maximum.accumulate(levels)
        return highest[levels < (1 - part * self.unstable_fall) * highest]

    def cut_after(self, number: int) -> None:
        """Remove the points after one of a number."""
        del self.points[number + 1 :]
        self.starts = [start for start in self.starts if start <= number]

    def insert(self, first: int, new: list[Point]) -> None:
        """Insert equilibria after a point of a number; none: no increment is of the branch."""
        self.points[first + 1 : first + 1] = new
        self.starts = [start + len(new) * (start > first + 1) for start in self.starts]
        if not new:
            self.closed.append(self.points[first])

    def uncertain(self) -> tuple[int, float]:
        """Where the level may be highest: the number of the point before, and an upper bound [m];
        the highest level if there is no such interval.
        """
        top = self.top
        if not self.points:
            return top, self.highest
        point = self.points[top]
        if point.is_last:
            return top, self.highest
        last = min(self.counted, len(self.points) - 1)
        bounds = [(self.possible(first, top), first) for first in range(last)]
        possible, first = max(bounds, default=(self.highest, top))
        return first, max(possible, self.highest)

    def possible(self, first: int, top: int) -> float:
        """The level [m] that may be between a point and the next one: the bound, or, away from the
        highest point, twice as far above both of them, as levels may rise faster than the lines
        through the neighbours. top: the number of the highest point.
        """
        bound, ends = self.bound(first), max(p.level for p in self.points[first : first + 2])
        near = first <= top <= first + 1
        return bound if near else ends + CONVEX * (bound - ends)

    def bound(self, first: int, sign: int = 1) -> float:
        """An upper bound of the level [m] between a point and the next one; -inf where no point can
        be inserted. sign: -1 for the bound of its negative, by the slopes alone.
        """
        a, b = self.points[first : first + 2]
        closed = any(a is point for point in self.closed)
        if b.control in BY_LEVEL or first + 1 in self.starts or closed:
            return -np.inf
        near = tuple(self.points[max(first - 1, 0) : first + 3])
        on_branch = tuple(number not in self.starts for number in (first, first + 2))
        key = (*map(id, near), first > 0, *on_branch, sign)
        if key not in self.bounds:
            self.bounds[key] = near, self.new_bound(first, sign)
        return self.bounds[key][1]

    def new_bound(self, first: int, sign: int) -> float:
        """See `bound`, which has those that are known."""
        a, b = self.points[first : first + 2]
        if sign < 0:
            return self.bound_by_slopes(first, sign)
        before, chord = self.slope(first - 1), (b.level - a.level) / (self.length(first) or 1.0)
        if before is None or before <= max(chord, 0.0):
            return self.bound_by_slopes(first)
        # points that begin to soften, and water that enters, may do so after a rise
        highest = max(a.level, b.level)
        enters = min(highest + b.rise_before_water(a), a.level + before * self.length(first))
        return max(self.bound_by_slopes(first), highest + b.hidden_rise(a), enters)

    def bound_by_slopes(self, first: int, sign: int = 1) -> float:
        """An upper bound of the level [m], times the sign, between a point and the next one, where
        the lines through their neighbours meet.
        """
        begin, end = (sign * point.level for point in self.points[first : first + 2])
        slopes = (self.slope(number) for number in (first - 1, first + 1))
        before, after = (None if slope is None else sign * slope for slope in slopes)
        rise, length, ends = end - begin, self.length(first), max(begin, end)
        chord = rise / (length or 1.0)
        if before is None or after is None:
            steepest = max(abs(chord), 0.0 if before is None else before)
            return max(ends + abs(rise), begin + steepest * length)
        if before > chord > after:  # where the lines through the neighbours meet
            return begin + before * (rise - after * length) / (before - after)
        if before > chord:  # it may fall anywhere in between
            return max(ends, begin + before * length)
        return max(ends, end - after * length) if chord > after else ends

    def length(self, first: int) -> float:
        """How far the jumps move between a point and the next one [m]."""
        a, b = self.points[first : first + 2]
        return float(np.abs(b.state.jump - a.state.jump).max())

    def slope(self, first: int) -> float | None:
        """Rise of the level over the movement between a point and the next one; None if they are
        not on one branch.
        """
        if first < 0 or first + 1 >= len(self.points) or first + 1 in self.starts:
            return None
        a, b = self.points[first : first + 2]
        return (b.level - a.level) / (self.length(first) or 1.0)

    def between(self, first: int) -> list[Point]:
        """Equilibria of the branch between a point and the next one."""
        a, b = self.points[first : first + 2]
        control = a.towards(b.state.jump - a.state.jump)
        length = self.length(first) / 2
        if control is None:
            return []
        smallest = max(SMALLEST * length, self.negligible(a, control))
        new = self.along(a, control, length, smallest, b.control)[0]
        return list(takewhile(lambda point: not point.beyond(b, a), new))


def movement(case: Case, crack_length: float, x: np.ndarray, moved: np.ndarray) -> str:
    """Broken through, overturning or sliding, by the motion beyond the limit point.

    crack_length: [m], after the motion; x (n,): distance of the joint's nodes from the heel; moved
    (n, 3): the change of their jumps.

    Sliding: the slip of the joint is larger than the opening at the heel by rotation.
    """
    if crack_length > case.joint_along * (1 - ROUND_OFF):
        return "broken through"
    rotation = np.polyfit(x, moved[:, 0], 1)[0] * np.ptp(x)
    return "overturning" if -rotation > abs(moved[:, 1].mean()) else "sliding"
