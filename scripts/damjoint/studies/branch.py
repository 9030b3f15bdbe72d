"""One dam followed to the end of its equilibria.

The levels are prescribed as far as a step is found, then its equilibrium path is followed (see
solver/path.py), and where it ends is looked at to the precision.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..joint.interface import Interface
from ..model.case import Case
from ..model.results import HISTORY
from ..solver.load_stepper import LoadStepper
from ..solver.path import Path, Point

#: Columns of critical.csv: a row per equilibrium of each dam that was tried.
CRITICAL = {
    "trial": ("-", "number of the dam that was tried"),
    "value": ("", "what was varied: level [m], strength, or the parameter"),
    "stands": ("-", "1: there is an equilibrium with this value, 0: none was found"),
    "driven": ("-", "0: the level was prescribed, 1: a displacement, and the level found"),
    **{n: HISTORY[n] for n in ("level", "crest_ux", "crack_length", "slip_length", "N", "T", "M")},
    "pushed": ("m", "how far the dam was pushed where a displacement was prescribed"),
    "compression": ("Pa", "total compression at the toe"),
}

#: How many steps of the level may fail, each one half of the one before, until the dam is pushed.
FAILURES = 2

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
        stepper = LoadStepper(case, interface, lambda _: self.add(point_of(stepper)))
        # from the weight alone on steps can be halved; else the first one includes it at any length
        if not (case["weight_first"] and stepper.weigh()):
            stepper.advance_to(case.times[0])
        if not stepper.stopped:
            advance(stepper)
        ahead = [v for t, v in enumerate(case.levels, 1) if t >= stepper.state.time]
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
            complete = point.control != "level" or point.state.time == self.case.times[-1]
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

    def insert(self, left: int, point: Point) -> None:
        """One more equilibrium; if it is crushed, the last one."""
        if self.crushes(point):
            self.points[left + 1 :] = [point]
        else:
            super().insert(left, point)

    def unknown(self) -> tuple[int, float, float]:
        """Where to look next, see `Path.unknown`: also where it passes the target or f_c."""
        if self.crushed_at_top or self.arrival is not None:
            right = len(self.points) - 1 if self.crushed else self.arrival
            ends = [p.level for p in self.points[max(right - 1, 0) : right + 1]]
            return right - 1, 0.5, self.highest + max(ends) - min(ends)
        return super().unknown()


def point_of(stepper: LoadStepper) -> Point:
    """The last converged step of a loading."""
    return Point(stepper.model, stepper.state, stepper.history.copy())


def advance(stepper: LoadStepper) -> None:
    """Continue through the times of a case until some steps have not converged."""
    failures, length = 0, np.inf
    for target in stepper.case.times:
        while stepper.state.time < target:
            ahead = min(length, target - stepper.state.time)
            if not stepper.step(stepper.state.time + ahead):
                failures, length = failures + 1, ahead / 2
            if failures > FAILURES:
                return
