"""One dam followed to the end of its equilibria.

The levels are prescribed as far as a step is found, then its equilibrium path is followed (see
engines/condensed/path.py), and where it ends is looked at to the precision.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..engines.condensed.filling import Filling
from ..engines.condensed.interface import Interface
from ..engines.condensed.path import PRECISION, Path, Point
from ..results.tables import CRITICAL
from ..scene.case import Case

#: How many steps of the level may fail, each one half of the one before, until the dam is pushed.
FAILURES = 2

#: Looks at most at a branch's end.
MOST_LOOKS = 30

#: Time between two pushes, after the last level: only their order matters, and that all loads that
#: grow in time are there.
TICK = 1e-3


def row(point: Point) -> dict[str, float]:
    """What critical.csv says of a point, but for trial and value."""
    found = {name: value for name, value in point.last.items() if name in CRITICAL}
    driven = float(point.control != "level")
    return found | {"driven": driven, "pushed": point.pushed, "compression": point.compression}


class Branch(Path):
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
        filling = Filling(case, interface, lambda _: self.add(Point(filling.fork(case))))
        # from the weight alone on steps can be halved; else the first one holds it at any length
        if not (case["weight_first"] and filling.rest()):
            filling.reach(case.times[0])
        if not filling.stopped:
            fill(filling)
        ahead = [v for t, v in enumerate(case.levels, 1) if t >= filling.state.time]
        self.target = max(ahead) if target is None else target
        super().__init__(self.points, len(case.levels), TICK)

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
        for number, point in enumerate(self.sound):
            complete = point.control != "level" or point.filling.state.time == self.case.times[-1]
            if complete and point.level >= self.target:
                return number
        return None

    @property
    def reached(self) -> bool:
        """Whether there is an equilibrium at the target."""
        return self.arrival is not None

    @property
    def sound(self) -> list[Point]:
        """The points that are not crushed."""
        return self.points[:-1] if self.crushed else self.points

    @property
    def crushed_at_top(self) -> bool:
        """Whether it is the compression that ends it."""
        return self.crushed and self.top + 2 == len(self.points)

    @property
    def mode(self) -> str:
        """How the dam fails; empty if it is not seen."""
        return "crushed toe" if self.crushed_at_top else super().mode

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
            self.advance()
        if not self.reached:
            self.refine(self.target)

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
        filling = a.filling.fork(self.case)
        return Point(filling) if filling.step(times[0] + share * (times[1] - times[0])) else None


def fill(filling: Filling) -> None:
    """Go on through the times of a filling's case until some steps have failed."""
    failures, length = 0, np.inf
    for target in filling.case.times:
        while filling.state.time < target:
            ahead = min(length, target - filling.state.time)
            if not filling.step(filling.state.time + ahead):
                failures, length = failures + 1, ahead / 2
            if failures > FAILURES:
                return
