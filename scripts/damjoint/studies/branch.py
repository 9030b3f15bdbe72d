"""One dam followed to the end of its equilibria.

The levels are prescribed as far as a step is found. From there on the crest's displacement is
prescribed instead (or, where it turns back, the heel's opening), and the level is found with it:
peaks, plateaus and bursts are passed, where steps of the level would only fail. A branch whose
level rises no more, however far the dam is pushed, is a mechanism.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
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

#: First push over the displacement so far; each one over the one before, at least and at most.
FIRST, SHRINKING, GROWTH = 0.05, 0.25, 2.0

#: A push that fails is tried at these parts of its length, but for what is smaller than this part
#: of the displacement so far; then over a burst in which the dam springs back, these parts of it.
PARTS, SMALLEST, JUMPS = (1, 1 / 4, 1 / 16), 1e-4, (0.01, 0.05, 0.25)

#: How many steps of the level may fail, each one half of the one before, until the dam is pushed.
FAILURES = 2

#: By how much a push should raise the level, relatively: the highest level of a joint that softens
#: depends on the steps by some hundredths of that.
RISE = 0.005

#: How many times as far a dam is pushed before its level counts as risen no more: for a first
#: opinion, and for sure.
ROUGH, SURE = 1.5, 4.0

#: Levels that differ relatively by less are the same.
PLATEAU = 1e-7

#: Equilibria at most on a branch.
MOST_POINTS = 500

#: Looks at most at a branch's end.
MOST_LOOKS = 30

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
        return self.filling.state.loading.level

    @cached_property
    def compression(self) -> float:
        """Largest total compression at the toe [Pa]."""
        joint, state, pressure = (
            self.filling.joint,
            self.filling.state,
            self.filling.state.pressure.nodes,
        )
        interface = joint.interface
        jump = interface.jumps(interface.at_nodes, state.jump)
        effective = interface.at_places(joint.law.respond(jump, state.nodes)[0][:, 0])
        toe = interface.way > 1 - 1e-9
        return float((pressure - effective)[toe].max())

    @cached_property
    def slides(self) -> bool:
        """Whether a flat joint holds the shear by its whole strength, which slip cannot raise: more
        water has no equilibrium, it pushes more and presses less.
        """
        joint, state = self.filling.joint, self.filling.state
        interface = joint.interface
        if not interface.flat:
            return False
        jump = interface.jumps(interface.at_points, state.jump)
        strength = joint.law.shear_strength(jump, state.memory)
        if strength is None:
            return False
        shear = np.linalg.norm(joint.law.respond(jump, state.memory)[0][:, 1:], axis=1)
        weights = interface.points.weights
        return bool(weights @ shear >= (1 - PRECISION / 2) * (weights @ strength))

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
        self.points: list[Point] = []
        filling = Filling(case, interface, lambda _: self.add(Point(kept(filling))))
        # from the weight alone on steps can be halved; else the first one holds it at any length
        if not (case["weight_first"] and filling.rest()):
            filling.reach(case.times[0])
        if not filling.stopped:
            fill(filling)
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
        """Whether the toe's compression has passed f_c at its last point."""
        return bool(self.points) and self.crushes(self.points[-1])

    def crushes(self, point: Point) -> bool:
        """Whether the toe's compression passes f_c at a point."""
        return self.case["f_c"] > 0 and point.compression > self.case["f_c"]

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
    def highest(self) -> float:
        """Its highest level [m]; nan if there is none."""
        return self.points[self.top].level if self.points else np.nan

    @property
    def knee(self) -> int:
        """The number of the point from which on the level rises by less than the precision."""
        levels = np.array([p.level for p in self.points])
        return int(np.argmax(levels >= (1 - PRECISION / 2) * self.highest))

    @property
    def crushed_at_top(self) -> bool:
        """Whether it is the compression that ends it."""
        return self.crushed and self.top + 2 == len(self.points)

    @property
    def slides(self) -> bool:
        """Whether nothing of the joint's strength is left at its highest level."""
        return bool(self.points) and self.points[self.top].slides

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
        if self.slides:
            return "sliding"
        if not self.points or self.knee + 1 >= len(self.points):
            return ""
        knee, last = self.points[self.knee].filling, self.points[-1].filling
        interface = last.joint.interface
        moved = interface.jumps(interface.at_nodes, last.state.jump - knee.state.jump)
        along = interface.way * interface.length
        crack = self.points[-1].last["crack_length"]
        return movement(self.case, crack, along, interface.at_places(moved))

    # -- following it
    # ----------------------------------------------------------------------------------------------

    def follow(self, factor: float) -> None:
        """Push the dam until the target is reached, it slides, the level has settled or no push is
        found.

        A highest level that is not far below the target is looked at more closely.
        """
        while not (
            self.stuck or self.reached or self.crushed or self.slides or self.settled(factor)
        ):
            self.go_on()
            self.stuck |= len(self.points) >= MOST_POINTS
        if not self.reached:
            self.refine(self.target)

    def go_on(self) -> None:
        """The next push."""
        last = self.points[-1]
        for control, push in self.pushes():
            found = self.pushed(last, push, control)
            if found:
                rise = max((found.level - last.level) / found.level, 1e-12)
                self.push = push * min(max(RISE / rise, SHRINKING), GROWTH)
                self.add(found)
                return
        self.stuck = True

    def pushes(self) -> Iterator[tuple[str, float]]:
        """What is tried for a push: of the crest; of the heel, where the crest turns back; of the
        crest, over a burst in which both turn back.
        """
        far = self.points[-1].pushed or self.size
        for control in ("crest", "heel"):
            wanted = (part * self.push for part in PARTS)
            yield from ((control, push) for push in wanted if push > SMALLEST * far)
        yield from (("crest", part * far) for part in JUMPS)

    def pushed(self, point: Point, by: float, control: str) -> Point | None:
        """The equilibrium at which the crest or the heel has moved further [m]."""
        end = max(point.filling.state.time, len(self.case.levels)) + TICK
        found = moved(point.filling, self.case, control, by, end)
        return found and Point(found, (point.pushed or self.size) + by, control)

    # -- its end, more closely
    # ----------------------------------------------------------------------------------------------

    def refine(self, wanted: float = np.inf) -> None:
        """Look at the branch's end to the precision: at its highest level, or where it passes the
        target or f_c; no closer than needed to see that a wanted level is out of reach.
        """
        for _ in range(MOST_LOOKS):
            left, share, possible = self.unknown()
            known = not possible - self.highest > PRECISION / 2 * possible
            if known or possible < wanted < np.inf:
                return
            middle = self.between(left, share)
            if middle is None:
                return
            if self.crushes(middle):
                self.points[left + 1 :] = [middle]
            else:
                self.points.insert(left + 1, middle)

    def unknown(self) -> tuple[int, float, float]:
        """Where to look next: the number of a point, the share of the way to the next one, and the
        highest level [m] that may be there; the highest one found if no look is needed.
        """
        if self.crushed_at_top or self.arrival is not None:
            right = len(self.points) - 1 if self.crushed else self.arrival
            ends = [p.level for p in self.points[max(right - 1, 0) : right + 1]]
            return right - 1, 0.5, self.highest + max(ends) - min(ends)
        if self.slides:
            return self.top, 0.5, self.highest
        inner = (i for i in (self.top - 1, self.top) if 0 <= i < len(self.points) - 1)
        sides = [(i, *self.summit(i)) for i in inner if self.points[i + 1].pushed]
        return max(sides, key=lambda side: side[2], default=(self.top, 0.5, self.highest))

    def summit(self, left: int) -> tuple[float, float]:
        """How high a branch that gets no steeper can be between a point and the next one, and at
        which share of the way it is likely to bend: where the lines through their neighbours meet.
        """
        a, b = self.points[left], self.points[left + 1]
        length, chord = b.pushed - (a.pushed or self.size), self.slope(left)
        before, beyond = self.slope(left - 1), self.slope(left + 1)
        if before is None:
            return 0.5, max(a.level, b.level) + abs(b.level - a.level)
        share = 0.5
        if beyond is not None and before > chord > beyond:
            share = np.clip((chord - beyond) / (before - beyond), 0.1, 0.9)
        return float(share), max(a.level + before * length, b.level)

    def slope(self, left: int) -> float | None:
        """Rise of the level over the push between a point and the next one; None if there is no
        push.
        """
        if left < 0 or left + 1 >= len(self.points) or not self.points[left + 1].pushed:
            return None
        a, b = self.points[left], self.points[left + 1]
        return (b.level - a.level) / (b.pushed - (a.pushed or self.size))

    def between(self, left: int, share: float) -> Point | None:
        """The equilibrium at a share of the way from a point to the next one."""
        a, b = self.points[left], self.points[left + 1]
        if b.pushed:
            return self.pushed(a, share * (b.pushed - (a.pushed or self.size)), b.control)
        times = a.filling.state.time, b.filling.state.time
        found = solved(kept(a.filling), times[0] + share * (times[1] - times[0]))
        return found and Point(found)


def kept(filling: Filling) -> Filling:
    """A filling as it is now, to be gone on with by itself."""
    found = filling.fork(filling.case)
    found.on_step = lambda _: None
    return found


def fill(filling: Filling) -> None:
    """Go on through the times of a filling's case until some steps have failed."""
    failures, length = 0, np.inf
    for target in filling.case.times:
        while filling.state.time < target:
            ahead = min(length, target - filling.state.time)
            if not solved(filling, filling.state.time + ahead, 1):
                failures, length = failures + 1, ahead / 2
            if failures > FAILURES:
                return


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
    if not driven.driven:  # no extrapolation from one control to the other
        driven.driven, driven.before = True, None
    driven.displacement = driven.driven_displacement(driven.state)
    return solved(driven, end)


def solved(filling: Filling, time: float, most: int = 3) -> Filling | None:
    """A filling gone on with to a time by one step; None if so many attempts do not find it."""
    found = filling.solve_by(filling.attempts()[:most], time, ahead=True)
    if found is None:
        return None
    filling.accept(0, *found)
    return filling
