"""One dam followed to the end of its equilibria.

The levels are prescribed as far as a step is found. From there on the crest's displacement is
prescribed instead (or, where it turns back, the heel's opening), and the level is found with it:
peaks, plateaus and bursts are passed, where steps of the level would only fail. A branch whose
level rises no more, however far the dam is pushed, is a mechanism.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..engines.condensed.filling import Filling
from ..engines.condensed.interface import Interface
from ..results.tables import CRITICAL
from ..results.verdict import movement
from ..scene.case import Case

#: Relative precision of a critical value.
PRECISION = 1e-4

#: First push over the displacement so far; each one over the one before; one that fails is tried
#: at this part, down to the smallest over the displacement so far.
FIRST, GROWTH, CUT, SMALLEST = 0.05, 1.5, 0.25, 1e-5

#: How many times as far a dam is pushed before its level counts as risen no more: for a first
#: opinion, and for sure.
ROUGH, SURE = 1.5, 4.0

#: Levels that differ relatively by less are the same.
PLATEAU = 1e-7

#: Halvings at most of the interval around a peak.
HALVINGS = 16

#: Time between two pushes, after the last level: only their order matters, and that all loads that
#: grow in time are there.
TICK = 1e-3


@dataclass(frozen=True)
class Point:
    """An equilibrium, with all that led there."""

    filling: Filling
    #: how far the dam has been pushed, with its displacement before the first push [m]; 0 where the
    #: level is prescribed
    pushed: float = 0.0
    #: what was prescribed: level, crest or heel
    control: str = "level"

    @property
    def level(self) -> float:
        """The reservoir's level [m]."""
        return self.filling.state.level

    @cached_property
    def compression(self) -> float:
        """Largest effective compression at a node of the joint [Pa]."""
        joint, state = self.filling.joint, self.filling.state
        jump = joint.interface.jumps(joint.interface.at_nodes, state.jump)
        return float(-joint.law.respond(jump, state.nodes)[0][:, 0].min())

    @property
    def last(self) -> dict[str, float]:
        """What an engine has found there: columns of history.csv, and the heel's opening."""
        return {name: values[-1] for name, values in self.filling.record.rows.items()}

    @property
    def row(self) -> dict[str, float]:
        """What critical.csv says of it, but for trial and value."""
        found = {name: value for name, value in self.last.items() if name in CRITICAL}
        driven = float(self.control != "level")
        return found | {"driven": driven, "pushed": self.pushed, "compression": self.compression}


class Branch:
    """The equilibria of a case up to a level, if there is one there."""

    def __init__(
        self,
        case: Case,
        interface: Interface,
        target: float | None = None,
        on_step: Callable[[float], None] = lambda level: None,
    ) -> None:
        """target: the level [m] that it has to reach, the highest still to come by default; on_step
        is called with each level found.
        """
        self.case, self.on_step = case, on_step
        self.strength = case.values.get("f_c", 0)
        self.points: list[Point] = []
        filling = Filling(case, interface, lambda _: self.add(Point(kept(filling))))
        filling.run()
        ahead = [v for t, v in enumerate(case.levels, 1) if t >= filling.state.time]
        self.target = max(ahead) if target is None else target
        #: whether no further push has been found
        self.stuck = not self.points
        #: the largest displacement of joint and crest before the first push, and the next push [m]
        self.size = displacement(self.points[-1]) if self.points else 0.0
        self.push = FIRST * self.size

    def add(self, point: Point) -> None:
        """One more equilibrium, if none before it is crushed."""
        if not self.crushed:
            self.points.append(point)
            self.on_step(point.level)

    # -- what it shows
    # ----------------------------------------------------------------------------------------------

    @property
    def crushed(self) -> bool:
        """Whether the joint's compression has passed f_c at its last point."""
        return bool(self.points) and self.crushes(self.points[-1])

    def crushes(self, point: Point) -> bool:
        """Whether the joint's compression passes f_c at a point."""
        return self.strength > 0 and point.compression > self.strength

    @property
    def arrival(self) -> int | None:
        """The number of the first point at the target, or pushed above it; None if there is none
        yet.
        """
        sound = self.points[:-1] if self.crushed else self.points
        for number, point in enumerate(sound):
            complete = point.control != "level" or point.filling.state.time == self.case.times[-1]
            if complete and point.level >= self.target:
                return number
        return None

    @property
    def reached(self) -> bool:
        """Whether there is an equilibrium at the target."""
        return self.arrival is not None

    @property
    def top(self) -> int:
        """The number of the point with the highest level that is not crushed; of a plateau, the
        first.
        """
        sound = self.points[:-1] if self.crushed else self.points
        levels = np.array([p.level for p in sound])
        return int(np.argmax(levels >= (1 - PLATEAU) * levels.max())) if sound else 0

    @property
    def missing(self) -> float:
        """How much its highest level is below the target [m]."""
        return self.target - self.points[self.top].level

    @property
    def crushed_at_top(self) -> bool:
        """Whether it is the compression that ends it."""
        return self.crushed and self.top + 2 == len(self.points)

    def settled(self, factor: float) -> bool:
        """Whether the level has risen no more since the dam had been pushed so many times less."""
        far = self.points[-1].pushed / factor
        early = [p.level for p in self.points if (p.pushed or self.size) <= far]
        highest = self.points[self.top].level
        return bool(early) and highest <= max(early) * (1 + PRECISION / 2)

    @property
    def mode(self) -> str:
        """How the dam fails; empty if it is not seen."""
        if self.crushed_at_top:
            return "crushed toe"
        if self.top + 1 >= len(self.points):
            return ""
        top, last = self.points[self.top].filling, self.points[-1].filling
        interface = last.joint.interface
        moved = interface.jumps(interface.at_nodes, last.state.jump - top.state.jump)
        x = interface.space.place[:, 0]
        return movement(self.case, self.points[-1].last["crack_length"], x, moved)

    # -- following it
    # ----------------------------------------------------------------------------------------------

    def follow(self, factor: float) -> None:
        """Push the dam until the target is reached, the level has settled or no push is found.

        A highest level that is not far below the target is looked at more closely.
        """
        while not (self.stuck or self.reached or self.crushed or self.settled(factor)):
            self.go_on()
        if not self.reached:
            self.refine(self.target)

    def go_on(self) -> None:
        """The next push, at any length."""
        last = self.points[-1]
        while self.push > SMALLEST * (last.pushed or self.size):
            found = self.pushed(last, self.push)
            if found:
                self.push *= GROWTH
                self.add(found)
                return
            self.push *= CUT
        self.stuck = True

    def pushed(self, point: Point, by: float) -> Point | None:
        """The equilibrium at which the crest, or else the heel, has moved further [m]."""
        end = max(point.filling.state.time, len(self.case.levels)) + TICK
        for control in ("crest", "heel"):
            found = moved(point.filling, self.case, control, by, end)
            if found:
                return Point(found, (point.pushed or self.size) + by, control)
        return None

    def between(self, a: Point, b: Point) -> Point | None:
        """An equilibrium between two neighbours."""
        if b.control != "level":
            return self.pushed(a, (b.pushed - (a.pushed or self.size)) / 2)
        found = solved(a.filling.fork(self.case), (a.filling.state.time + b.filling.state.time) / 2)
        return found and Point(found)

    # -- its end, more closely
    # ----------------------------------------------------------------------------------------------

    def refine(self, wanted: float = np.inf) -> None:
        """Halve the intervals around the branch's end to the precision: around its highest level,
        or where it passes the target or f_c; no further than needed to see that a wanted level is
        out of reach.
        """
        for _ in range(HALVINGS):
            passed = len(self.points) - 1 if self.crushed_at_top else self.arrival
            right = self.top if passed is None else passed
            if right == 0 or (passed is None and right + 1 == len(self.points)):
                return
            high, rise = self.points[right].level, self.rise(right, passed is None)
            if rise <= PRECISION / 2 * high or high + rise < wanted < np.inf:
                return
            for i in (right, right - 1) if passed is None else (right - 1,):
                middle = self.between(self.points[i], self.points[i + 1])
                if middle is None:
                    return
                if self.crushes(middle):
                    self.points[i + 1 :] = [middle]
                else:
                    self.points.insert(i + 1, middle)

    def rise(self, right: int, peak: bool) -> float:
        """What is unknown of a level [m] at the right end of an interval; at a peak, how much
        higher the branch can be on both sides of it if it is concave.
        """
        points = self.points[max(right - 2, 0) : right + 2]
        levels = np.array([p.level for p in points])
        if not peak or len(points) < 4 or not points[1].pushed:
            return abs(self.points[right].level - self.points[right - 1].level)
        place = np.array([p.pushed or self.size for p in points])
        if place[1] <= place[0]:
            return np.inf
        before, after = np.diff(levels)[:2] / np.diff(place)[:2]
        highest = levels[1:3] + np.array([before, after]) * np.diff(place)[1:]
        return float(highest.max() - levels[2])


def kept(filling: Filling) -> Filling:
    """A filling as it is now, to be gone on with by itself."""
    found = filling.fork(filling.case)
    found.on_step = lambda _: None
    return found


def displacement(point: Point) -> float:
    """The largest displacement of joint and crest [m]."""
    return max(np.abs(point.filling.state.jump).max(), abs(point.last["crest_ux"]))


def moved(filling: Filling, case: Case, control: str, by: float, end: float) -> Filling | None:
    """A filling gone on with by one push of the crest or the heel [m], until a time."""
    begin, level, tail = filling.state.time, case.levels[-1], case.tail_levels[-1]
    drive = {"drive": control, "drive_begin": begin, "drive_end": end, "drive_by": by}
    driven = filling.fork(
        replace(
            case,
            values=case.values | drive,
            levels=(*case.levels, level),
            tail_levels=(*case.tail_levels, tail),
            times=(*(t for t in case.times if t <= begin), end),
        )
    )
    driven.driven = True
    driven.displacement = filling.record.rows["heel" if control == "heel" else "crest_ux"][-1]
    return solved(driven, end)


def solved(filling: Filling, time: float) -> Filling | None:
    """A filling gone on with to a time by one step; None if it is not found."""
    attempts = filling.attempts()[:-1]
    for attempt in attempts:
        found = filling.solve(time, attempt, attempt is attempts[0])
        if found:
            filling.accept(0, *found)
            return filling
    return None
