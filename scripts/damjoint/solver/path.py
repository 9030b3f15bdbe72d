"""The equilibrium path beyond a level that is prescribed no more.

A displacement is prescribed instead, and the level is found with it: limit points, plateaus and
unstable crack growth are passed, where steps of the level would only fail. It is the crest's, or,
where the crest turns back, the mean jump of the points whose damage grows, which does not turn back
while they do [indirect displacement control: de Borst, Comput. Struct. 25, 1987]. A path whose
level rises no more, however far the dam is pushed, is a mechanism.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..laws.base import Array
from ..model.case import Case
from .controls import (
    DRIVES,
    Control,
    DisplacementControl,
    LevelControl,
    ProcessZoneControl,
    process_zone,
)
from .history import History
from .model import Model
from .state import State

#: Relative precision of a critical value.
PRECISION = 1e-4

#: First push over the displacement so far; each one over the one before, at least and at most.
FIRST, SHRINKING, GROWTH = 0.05, 0.25, 2.0

#: A push that fails is tried at these parts of its length, but for what is smaller than this part
#: of the displacement so far; then over a snap-back, these parts of it.
PARTS, SMALLEST, JUMPS = (1, 1 / 4, 1 / 16), 1e-4, (0.01, 0.05, 0.25)

#: A push of the process zone over what it moved in the last step.
ZONE_GROWTH = 1.5

#: By how much a push should raise the level, relatively: the highest level of a joint that softens
#: depends on the steps by some hundredths of that.
RISE = 0.005

#: How many times as far a dam is pushed before its level counts as risen no more: for a first
#: opinion, and for sure.
ROUGH, SURE = 1.5, 4.0

#: Levels that differ relatively by less are the same.
PLATEAU = 1e-7

#: Points at most that are added where a path ends.
MOST_REFINED = 30

#: Equilibria at most on a path.
MOST_POINTS = 500


@dataclass(frozen=True)
class Point:
    """An equilibrium, with the history that led to it."""

    model: Model
    state: State
    history: History
    #: the displacement imposed so far, with that before the first push [m]; 0 where the level is
    #: prescribed
    pushed: float = 0.0
    #: what was prescribed: level, crest, zone or heel
    control: str = "level"

    @property
    def level(self) -> float:
        """The reservoir's level [m]."""
        return self.state.loading.level

    @cached_property
    def slides(self) -> bool:
        """Whether a plane joint transmits the shear by its whole strength, which slip cannot raise:
        a higher level has no equilibrium, it pushes more and presses less.
        """
        equilibrium, state = self.model.equilibrium, self.state
        law, interface = equilibrium.law, equilibrium.interface
        if law.hardens or not interface.flat:
            return False
        jump = interface.jumps(interface.at_points, state.jump)
        traction, _ = law.traction_and_tangent(jump, state.variables)
        damage, slip = law.damage(jump, state.variables), law.slip(state.variables, len(jump))
        strength = law.shear_strength(traction[:, 0], damage, slip)
        shear = np.linalg.norm(traction[:, 1:], axis=1)
        weights = interface.points.weights
        return bool(weights @ shear >= (1 - PRECISION / 2) * (weights @ strength))

    @cached_property
    def compression(self) -> float:
        """Largest total compression at the toe [Pa]."""
        equilibrium, state = self.model.equilibrium, self.state
        law, interface = equilibrium.law, equilibrium.interface
        assert state.pressure is not None  # of any converged state
        jump = interface.jumps(interface.at_nodes, state.jump)
        traction, _ = law.traction_and_tangent(jump, state.node_variables)
        toe = interface.way > 1 - 1e-9
        return float((state.pressure.nodes - interface.at_places(traction[:, 0]))[toe].max())

    @property
    def last(self) -> dict[str, float]:
        """Columns of history.csv at it, and the heel's opening."""
        return self.history.last

    @property
    def displacement(self) -> float:
        """The largest displacement of joint and crest [m]."""
        return max(float(np.abs(self.state.jump).max()), abs(self.history.crest(self.state)))

    @cached_property
    def zone(self) -> Array | None:
        """The process zone's mean jump from the unknowns, see `process_zone`."""
        return process_zone(self.model.equilibrium, self.state)

    @property
    def zone_moved(self) -> float:
        """By how much it has moved in the last step [m]."""
        if self.zone is None or self.state.previous is None:
            return 0.0
        return float(self.zone @ (self.state.jump - self.state.previous.jump))

    def moved(self, kind: str, by: float) -> DisplacementControl:
        """The control that moves crest, zone or heel further than here by a length [m]."""
        control: DisplacementControl
        if kind == "zone" and self.zone is not None:
            control = ProcessZoneControl(0.0, self.zone)
        else:
            control = DRIVES[kind](0.0)
        return replace(control, value=self.model.measure(control, self.state) + by)

    def step(self, time: float, control: Control) -> tuple[State, History] | None:
        """The next equilibrium, by the first strategy; None if it does not converge."""
        first = self.model.strategies[:1]
        found = self.model.advance(self.state, time, control, strategies=first, extrapolate=True)
        if found is None:
            return None
        history = self.history.copy()
        history.add(found, cuts=0)
        return found.state, history


class Path:
    """Equilibria one after the other, each pushed a little further than the one before."""

    def __init__(self, points: list[Point], time: float, tick: float = 0.0) -> None:
        """points: those known, the last one to go on from; time: whose loads act, but for the
        level; tick: the time that a push takes, for its row in the tables.
        """
        self.points, self.time, self.tick = points, time, tick
        #: whether no further push has been found
        self.stuck = not points
        #: the largest displacement of joint and crest before the first push, and the next push [m]
        self.size = points[-1].displacement if points else 0.0
        self.push = FIRST * self.size

    def add(self, point: Point) -> None:
        """One more equilibrium."""
        self.points.append(point)

    # -- what it shows
    # ----------------------------------------------------------------------------------------------

    @property
    def sound(self) -> list[Point]:
        """The points that count."""
        return self.points

    @property
    def top(self) -> int:
        """The number of the point with the highest level; of a plateau, the first."""
        levels = np.array([p.level for p in self.sound])
        return int(np.argmax(levels >= (1 - PLATEAU) * levels.max())) if len(levels) else 0

    @property
    def highest(self) -> float:
        """Its highest level [m]; nan if there is none."""
        return self.points[self.top].level if self.points else np.nan

    @property
    def limit_point(self) -> int:
        """The number of the point from which on the level rises by less than the precision."""
        levels = np.array([p.level for p in self.points])
        return int(np.argmax(levels >= (1 - PRECISION / 2) * self.highest))

    @property
    def slides(self) -> bool:
        """Whether nothing of the joint's strength is left at its highest level."""
        return bool(self.points) and self.points[self.top].slides

    def settled(self, factor: float) -> bool:
        """Whether the level has risen no more since the dam had been pushed so many times less, and
        does not recover from a fall.
        """
        far = self.points[-1].pushed / factor
        early = [p.level for p in self.points if (p.pushed or self.size) <= far]
        if not early or self.points[-1].level > early[-1] * (1 + PRECISION / 2):
            return False
        return self.points[self.top].level <= max(early) * (1 + PRECISION / 2)

    @property
    def mode(self) -> str:
        """How the dam fails; empty if it is not seen."""
        if self.slides:
            return "sliding"
        if not self.points or self.limit_point + 1 >= len(self.points):
            return ""
        top, last = self.points[self.limit_point], self.points[-1]
        interface = last.model.equilibrium.interface
        moved = interface.jumps(interface.at_nodes, last.state.jump - top.state.jump)
        along = interface.way * interface.length
        crack = self.points[-1].last["crack_length"]
        return movement(last.model.case, crack, along, interface.at_places(moved))

    # -- following it
    # ----------------------------------------------------------------------------------------------

    def advance(self) -> None:
        """The next push."""
        last = self.points[-1]
        for of, by in self.pushes():
            found = self.pushed(last, by, of)
            if found:
                rise = max((found.level - last.level) / found.level, 1e-12)
                self.push = by * min(max(RISE / rise, SHRINKING), GROWTH)
                self.add(found)
                self.stuck = len(self.points) >= MOST_POINTS
                return
        self.stuck = True

    def pushes(self) -> Iterator[tuple[str, float]]:
        """What is tried for a push: of the crest; where it turns back, of the process zone, which
        comes first while the crest goes back; of the heel; of the crest, over a snap-back of all.
        """
        last = self.points[-1]
        far = last.pushed or self.size
        lengths = {"crest": self.push, "zone": ZONE_GROWTH * last.zone_moved, "heel": self.push}
        crest = last.history.rows["crest_ux"][-2:]
        backwards = last.control == "zone" and crest[-1] < crest[0]
        for of in sorted(lengths, key=lambda of: backwards and of == "crest"):
            smallest = 0.0 if of == "zone" else SMALLEST * far
            wanted = (part * lengths[of] for part in PARTS)
            yield from ((of, push) for push in wanted if push > smallest)
        yield from (("crest", part * far) for part in JUMPS)

    def pushed(self, point: Point, by: float, kind: str) -> Point | None:
        """The equilibrium at which what is prescribed has moved further [m]."""
        time = max(point.state.time, self.time) + self.tick
        found = point.step(time, point.moved(kind, by))
        if found is None:
            return None
        return replace(
            point,
            state=found[0],
            history=found[1],
            pushed=(point.pushed or self.size) + by,
            control=kind,
        )

    # -- its highest level, more closely
    # ----------------------------------------------------------------------------------------------

    def refine(self, wanted: float = np.inf) -> None:
        """Find more points where it ends, to the precision; no more than needed to see that a
        wanted level is out of reach.
        """
        for _ in range(MOST_REFINED):
            left, share, possible = self.unknown()
            known = not possible - self.highest > PRECISION / 2 * possible
            if known or possible < wanted < np.inf:
                return
            middle = self.between(left, share)
            if middle is None:
                return
            self.insert(left, middle)

    def insert(self, left: int, point: Point) -> None:
        """One more equilibrium, after a point of a number."""
        self.points.insert(left + 1, point)

    def unknown(self) -> tuple[int, float, float]:
        """Where its highest level is not known closely: the number of a point, the share of the way
        to the next one, and the highest level [m] that may be there; the highest one found if it is
        known.
        """
        if self.slides:
            return self.top, 0.5, self.highest
        inner = (i for i in (self.top - 1, self.top) if 0 <= i < len(self.points) - 1)
        sides = [(i, *self.summit(i)) for i in inner if self.points[i + 1].pushed]
        return max(sides, key=lambda side: side[2], default=(self.top, 0.5, self.highest))

    def summit(self, left: int) -> tuple[float, float]:
        """How high a path that gets no steeper can be between a point and the next one, and at
        which share of the way it is likely to bend: where the lines through their neighbours meet.
        """
        a, b = self.points[left], self.points[left + 1]
        length, chord = b.pushed - (a.pushed or self.size), self.slope(left)
        before, beyond = self.slope(left - 1), self.slope(left + 1)
        if before is None or chord is None:
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
        case, times = a.model.case, (a.state.time, b.state.time)
        time = times[0] + share * (times[1] - times[0])
        found = a.step(time, LevelControl(case.level_at(time)))
        return replace(a, state=found[0], history=found[1]) if found else None


def movement(case: Case, crack_length: float, x: np.ndarray, moved: np.ndarray) -> str:
    """Broken through, overturning or sliding, from how a dam that has lost its equilibrium goes on.

    crack_length: [m], after it; x (n,): distance of the joint's nodes from the heel; moved (n, 3):
    the change of their jumps.

    Sliding: the joint's slip is larger than what the rotation opens at the heel.
    """
    if crack_length > case.joint_along * (1 - 1e-9):
        return "broken through"
    rotation = np.polyfit(x, moved[:, 0], 1)[0] * np.ptp(x)
    return "overturning" if -rotation > abs(moved[:, 1].mean()) else "sliding"
