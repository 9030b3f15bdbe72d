"""The equilibrium path under displacement control, past limit points and unstable crack growth.

A displacement is prescribed, and the level is unknown. It is the crest's, or, where the crest moves
back, the mean jump of the points whose damage grows, which increases while it does [indirect
displacement control: de Borst, Comput. Struct. 25, 1987]. A path whose level does not rise any
more, however large the displacement, is a mechanism.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property

import numpy as np

from .. import ROUND_OFF
from ..arrays import Array
from ..classes import dataclass
from ..model.case import Case
from ..model.results import column_of
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

#: First increment over the displacement so far; each one over the one before, at least and at most.
FIRST, SHRINKING, GROWTH = 0.05, 0.25, 2.0

#: An increment that does not converge is tried at these parts of its length, down to this part of
#: the displacement so far; then over a snap-back, as these parts of it.
PARTS, SMALLEST, JUMPS = (1, 1 / 4, 1 / 16), 1e-4, (0.01, 0.05, 0.25)

#: Relative fall of the level over an increment, from which on shorter ones are tried.
FALL = 0.02

#: An increment of the process zone over what it moved in the last step.
ZONE_GROWTH = 1.5

#: Relative rise of the level that an increment aims at: the limit point of a joint that softens
#: depends on the steps, mostly by some hundredths of it, in one of thirty random dams by a tenth to
#: a half. And where the state does not depend on them, which is used in the search for a critical
#: value.
RISE, LARGE_RISE = 0.005, 0.02

#: How many times the displacement grows before a level counts as not rising any more: for a first
#: estimate, and for the result.
ROUGH, SURE = 1.5, 4.0

#: Levels that differ relatively by less are the same.
PLATEAU = 1e-7

#: A joint takes part in a mechanism if its jumps change by more than this part of the largest
#: change.
MOVES = 0.5

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
    #: the displacement imposed so far, with that before the first increment [m]; 0 where the level
    #: is prescribed
    imposed: float = 0.0
    #: what was prescribed: level, crest, zone or heel
    control: str = "level"

    @property
    def level(self) -> float:
        """The reservoir's level [m]."""
        return self.state.loading.level

    @cached_property
    def sliding(self) -> int | None:
        """The number of a joint that alone holds what is above it and, being plane, transmits the
        shear by its whole strength, which slip cannot raise: a higher level has no equilibrium, it
        pushes more and presses less. None if there is none.
        """
        equilibrium, state = self.model.equilibrium, self.state
        for k, joint in enumerate(equilibrium.interface.joints):
            law, variables = equilibrium.laws.laws[k], state.variables.joints[k]
            if law.hardens or not joint.flat or not self.model.case.separates((k,)):
                continue
            jump = joint.jumps(joint.at_points, state.jump)
            traction, _ = law.traction_and_tangent(jump, variables)
            damage, slip = law.damage(jump, variables), law.slip(variables, len(jump))
            strength = law.shear_strength(traction[:, 0], damage, slip)
            shear, weights = np.linalg.norm(traction[:, 1:], axis=1), joint.points.weights
            if weights @ shear >= (1 - PRECISION / 2) * (weights @ strength):
                return k
        return None

    @property
    def slides(self) -> bool:
        """Whether there is such a joint."""
        return self.sliding is not None

    @cached_property
    def compressions(self) -> list[float]:
        """Largest total compression at the toe of each joint [Pa]."""
        equilibrium, state = self.model.equilibrium, self.state
        parts = zip(
            *(equilibrium.interface.joints, equilibrium.laws.laws, state.pressures),
            state.node_variables.joints,
            strict=True,
        )
        largest = []
        for joint, law, pressure, variables in parts:
            jump = joint.jumps(joint.at_nodes, state.jump)
            traction, _ = law.traction_and_tangent(jump, variables)
            total = pressure.nodes - joint.mean_at_nodes(traction[:, 0])
            largest.append(float(total[joint.xi > 1 - ROUND_OFF].max()))
        return largest

    @property
    def compression(self) -> float:
        """The largest of them [Pa]."""
        return max(self.compressions)

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
        found = self.model.advance_by_first(self.state, time, control)
        if found is None:
            return None
        history = self.history.copy()
        history.add(found, cuts=0)
        return found.state, history


class EquilibriumPath:
    """Equilibria one after the other, each with a larger displacement than the one before."""

    def __init__(self, points: list[Point], time: float, tick: float = 0.0) -> None:
        """points: the first ones, the last of them to continue from; time: whose loads act, but for
        the level; tick: the time that an increment takes, for its row in the tables.
        """
        self.points, self.time, self.tick = points, time, tick
        #: whether no further equilibrium has been found
        self.ended = not points
        #: the largest displacement of joint and crest before the first increment, and the next
        #: increment [m]
        self.size = points[-1].displacement if points else 0.0
        self.increment = FIRST * self.size
        #: relative rise of the level that an increment aims at
        self.rise = RISE
        #: a far fall from an equilibrium, not taken yet: from, to, increment [m]
        self.fall: tuple[Point, Point, float] | None = None

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
        if self.slides:
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
        slides = self.points[self.top].sliding if self.points else None
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
        """Append the next equilibrium. From the highest one an increment over which the level falls
        far comes last, also after the path of shorter ones: it may pass over a higher one.
        """
        last, fall = self.points[-1], None
        for kind, by in self.increments():
            new = self.step(last, by, kind)
            if new and new.level < (1 - FALL) * last.level and last.level >= self.highest:
                fall = fall or (last, new, by)
            elif new:
                self.fall = fall or self.fall
                self.append(new, by)
                return
        start, new, by = fall or self.fall or (None, last, 0.0)
        self.fall, self.ended = None, True
        if start is self.points[self.top]:
            del self.points[self.top + 1 :]
            self.append(new, by)

    def append(self, new: Point, by: float) -> None:
        """Append an equilibrium, reached by an increment [m], and choose the next increment."""
        rise = max((new.level - self.points[-1].level) / new.level, 1e-12)
        self.increment = by * min(max(self.rise / rise, SHRINKING), GROWTH)
        self.add(new)
        self.ended = len(self.points) >= MOST_POINTS

    def increments(self) -> Iterator[tuple[str, float]]:
        """The increments to try: of the crest; where it moves back, of the process zone, which
        comes first while it does; of the heel; of the crest, over a snap-back of all of them.
        """
        last = self.points[-1]
        far, zone = self.imposed(last), ZONE_GROWTH * last.zone_moved
        lengths = {"crest": self.increment, "zone": zone, "heel": self.increment}
        crest = last.history.rows["crest_ux"][-2:]
        backwards = last.control == "zone" and crest[-1] < crest[0]
        for kind in sorted(lengths, key=lambda kind: backwards and kind == "crest"):
            smallest = 0.0 if kind == "zone" else SMALLEST * far
            parts = (part * lengths[kind] for part in PARTS)
            yield from ((kind, length) for length in parts if length > smallest)
        yield from (("crest", part * far) for part in JUMPS)

    def step(self, point: Point, by: float, kind: str) -> Point | None:
        """The equilibrium at which crest, zone or heel have moved further than at a point [m]."""
        time = max(point.state.time, self.time) + self.tick
        found = point.step(time, point.moved(kind, by))
        if found is None:
            return None
        return replace(
            point,
            state=found[0],
            history=found[1],
            imposed=self.imposed(point) + by,
            control=kind,
        )

    # -- refinement of its highest level
    # ----------------------------------------------------------------------------------------------

    def refine(self, wanted: float = np.inf) -> None:
        """Insert points around the highest level, to the precision; no more than needed to show
        that a wanted level is out of reach.
        """
        for _ in range(MOST_REFINED):
            left, share, possible = self.uncertain()
            known = not possible - self.highest > PRECISION / 2 * possible
            if known or possible < wanted < np.inf:
                return
            middle = self.between(left, share)
            if middle is None:
                return
            self.insert(left, middle)

    def insert(self, left: int, point: Point) -> None:
        """Insert an equilibrium after a point of a number."""
        self.points.insert(left + 1, point)

    def uncertain(self) -> tuple[int, float, float]:
        """Where its highest level is uncertain: the number of a point, the fraction between it and
        the next one, and an upper bound of the level [m] there; the highest level if it is certain.
        """
        if self.slides and not self.points[self.top].model.equilibrium.path_dependent:
            return self.top, 0.5, self.highest
        inner = (i for i in (self.top - 1, self.top) if 0 <= i < len(self.points) - 1)
        sides = [(i, *self.summit(i)) for i in inner if self.points[i + 1].imposed]
        return max(sides, key=lambda side: side[2], default=(self.top, 0.5, self.highest))

    def summit(self, left: int) -> tuple[float, float]:
        """At which fraction between a point and the next one a concave path is likely to bend,
        where the lines through their neighbours meet, and an upper bound of its level [m].
        """
        a, b = self.points[left], self.points[left + 1]
        length, chord = b.imposed - self.imposed(a), self.slope(left)
        before, beyond = self.slope(left - 1), self.slope(left + 1)
        if before is None or chord is None:
            return 0.5, max(a.level, b.level) + abs(b.level - a.level)
        share = 0.5
        if beyond is not None and before > chord > beyond:
            share = np.clip((chord - beyond) / (before - beyond), 0.1, 0.9)
        return float(share), max(a.level + before * length, b.level)

    def slope(self, left: int) -> float | None:
        """Rise of the level over the increment between a point and the next one; None if the next
        one has a prescribed level.
        """
        if left < 0 or left + 1 >= len(self.points) or not self.points[left + 1].imposed:
            return None
        a, b = self.points[left], self.points[left + 1]
        return (b.level - a.level) / (b.imposed - self.imposed(a))

    def between(self, left: int, share: float) -> Point | None:
        """The equilibrium at a fraction between a point and the next one."""
        a, b = self.points[left], self.points[left + 1]
        if b.imposed:
            return self.step(a, share * (b.imposed - self.imposed(a)), b.control)
        case, times = a.model.case, (a.state.time, b.state.time)
        time = times[0] + share * (times[1] - times[0])
        found = a.step(time, LevelControl(case.level_at(time)))
        return replace(a, state=found[0], history=found[1]) if found else None


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
