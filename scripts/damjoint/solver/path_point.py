"""A point of the equilibrium path: what it says of itself, and of others beside it."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .. import ROUND_OFF
from ..arrays import Array, BoolArray
from ..joint.interface import JointInterface
from ..laws.base import Law
from ..model.results import column_of
from .controls import (
    BodyControl,
    Control,
    DirectionControl,
    DisplacementControl,
    mean_slip,
    process_zone,
)
from .history import FULL_HEAD, History
from .model import Model, StepResult
from .state import State

#: Relative precision of a critical value [-].
PRECISION = 1e-4

#: What is prescribed where all other displacements move back, see `Point.slip_control`.
SLIP = "slip"

# Two steps from the same equilibrium lead to the same state

#: Relative difference of the levels up to which they do [-]; larger ones are on another branch.
SAME_LEVEL = 3e-5
#: Difference of the jumps up to which they do, over their change in the increment [-].
SAME_JUMP = 0.02

# An increment continues the one before, as predicted

#: Difference of its jumps from those extrapolated from the last increment, over their change [-].
#: Half of the change would be a path that turns, or leads back.
PREDICTED = 0.3
#: The same of the level, over its change [-]: it has no limit point within the increment as long
#: as it is below 1.
PREDICTED_LEVEL = 0.5
#: Movement of a joint over the largest one below which it counts as that [-].
LEAST_MOVED = 0.02
#: Relative difference of the level at its middle from the mean of those at its ends above which
#: there may be a limit point in it [-].
STRAIGHT = 3e-4
#: Difference of the change of the jumps in the first half from half of it, over it, up to which
#: they change steadily [-].
STEADY = 0.3

# Unstable growth of the crack

#: Relative fall of the level above which growth is unstable under a prescribed level [-]; smaller
#: falls are those from one integration point to the next.
FALL = 1e-3
#: An increment is halved, too, as long as points whose damage grows by more than this in a half [-]
#: lose tensile strength of more than the part FALL of the water's thrust: where they soften in a
#: single increment the level may fall within it.
LARGEST_GROWTH = 0.1
#: The same of laws that release their shear: it is released at once, and smaller growth that counts
#: lets branches end at single points that change no level.
LARGEST_GROWTH_OF_RELEASE = 0.35
#: Largest growth of the damage of a point in a half of an increment where points are opened one by
#: one [-].
AT_ONCE = 0.6
#: Growth of damage and slip over the movement, over what it was before, below which a fall of the
#: level is elastic unloading along the path [-].
UNLOADING = 0.05


@dataclass(frozen=True)
class Point:
    """An equilibrium, with the history that led to it."""

    model: Model
    state: State
    history: History
    #: the displacement imposed so far, with that before the first increment [m]; 0 where the level
    #: is prescribed
    imposed: float = 0.0
    #: what was prescribed: level, crest, arc, zone, slip or heel
    control: str = "level"

    @cached_property
    def level(self) -> float:
        """The reservoir's level [m]."""
        return self.state.loading.level

    @cached_property
    def sliding(self) -> int | None:
        """The number of a joint that transmits the shear by the largest strength that it can have,
        with all tension that is left elsewhere pressing on it, see `slipping`: a higher level has
        no equilibrium, it pushes more and presses less. None if there is none.
        """
        return self.at_strength(largest=True)

    @cached_property
    def slipping(self) -> int | None:
        """The number of a joint that alone holds what is above it and, being plane, transmits the
        shear by the whole strength that it has now, which slip cannot raise; None if there is none.
        """
        return self.at_strength(largest=False)

    def at_strength(self, largest: bool) -> int | None:
        """See `sliding`, `slipping`."""
        equilibrium, state = self.model.equilibrium, self.state
        for k, joint in enumerate(equilibrium.interface.joints):
            law, variables = equilibrium.laws.laws[k], state.variables.joints[k]
            if law.hardens or not joint.flat or not self.model.case.separates((k,)):
                continue
            jump = joint.jumps(joint.at_points, state.jump)
            traction, _ = law.traction_and_tangent(jump, variables)
            damage, slip = law.damage(jump, variables), law.slip(variables, len(jump))
            strength = law.shear_strength(traction[:, 0], damage, slip)
            if largest:
                strength = law.shear_strength(np.zeros(len(jump)), damage, slip)
                strength += law.mu * (law.tension_left(damage) - traction[:, 0])
            shear, weights = np.linalg.norm(traction[:, 1:], axis=1), joint.points.weights
            if weights @ shear >= (1 - PRECISION / 2) * (weights @ strength):
                return k
        return None

    @property
    def slides(self) -> bool:
        """Whether there is a joint that slides."""
        return self.sliding is not None

    @property
    def is_last(self) -> bool:
        """Whether it slides, and no other history and no smaller opening, with less water in it,
        has a higher level.
        """
        path_dependent = self.model.equilibrium.path_dependent
        return self.slides and not (path_dependent or self.uplift_follows)

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

    @property
    def movement(self) -> Array:
        """The change of the unknowns in the last step (j,) [m]; zero in the first one."""
        before = self.state.previous
        return self.state.jump - (before.jump if before else self.state.jump)

    def towards(self, movement: Array) -> DisplacementControl | None:
        """The control of the movement along one of the unknowns (j,), in terms of its largest
        component; None if there is none.
        """
        size = float(np.abs(movement).max())
        return DirectionControl(0.0, size / (movement @ movement) * movement) if size else None

    @property
    def controls(self) -> dict[str, DisplacementControl]:
        """What can be prescribed to continue: the crest, unless it has moved back, which it does if
        the dam is unloaded, too; the movement of the joints along the last one (arc); the mean jump
        of the points whose damage has grown (zone). First what has led to here.
        """
        crests = self.history.rows["crest_ux"][-2:]
        controls: dict[str, DisplacementControl] = {}
        if crests[-1] >= crests[0]:
            controls["crest"] = BodyControl(0.0)
        if arc := self.towards(self.movement):
            controls["arc"] = arc
        zone = process_zone(self.model.equilibrium, self.state)
        if zone is not None:
            controls["zone"] = DirectionControl(0.0, zone)
        if self.control == SLIP:
            controls |= self.slip_control
        return dict(sorted(controls.items(), key=lambda item: item[0] != self.control))

    @property
    def slip_control(self) -> dict[str, DisplacementControl]:
        """The mean slip, which still grows where all `controls` move back, as points that were
        pressed open beside the toe; empty if nothing slips.
        """
        slip = mean_slip(self.model.equilibrium, self.state)
        return {} if slip is None else {SLIP: DirectionControl(0.0, slip)}

    def moved(self, control: DisplacementControl) -> float:
        """What a control measures of the last movement [m]."""
        before = self.state.previous
        if before is None:
            return 0.0
        return self.model.measure(control, self.state) - self.model.measure(control, before)

    def further(self, control: DisplacementControl, by: float) -> DisplacementControl:
        """A control, moved further than here by a length [m]."""
        return replace(control, value=self.model.measure(control, self.state) + by)

    def step(self, time: float, control: Control, imposed: float, kind: str) -> Point | None:
        """The next equilibrium, see `Model.advance_along`; None if it does not converge.

        imposed: the displacement imposed there [m]; kind: what is prescribed.
        """
        advance = self.model.advance_along if self.opens_points else self.model.advance_by_first
        result = advance(self.state, time, control)
        return self.after(result, imposed, kind) if result else None

    def after(self, result: StepResult, imposed: float, kind: str) -> Point:
        """The equilibrium that a step from here has led to, see `step`."""
        history = self.history.copy()
        history.add(result, cuts=0)
        return replace(self, state=result.state, history=history, imposed=imposed, control=kind)

    def irreversible(self, state: State) -> Array:
        """Damage and slip of all points in a state, (2 q,); in place of the slip of a law that
        releases its shear, which goes back as well, the released part of its stiffness.
        """
        interface, laws = self.model.equilibrium.interface, self.model.equilibrium.laws
        variables, opens = state.variables, self.opens_points
        jumps = interface.jumps(interface.at_points, state.jump)
        parts = zip(laws.laws, variables.split(jumps), variables.joints, strict=True)
        slips = (
            law.released_part(jump, own)
            if opens and law.releases_shear
            else law.slip(own, len(jump))
            for law, jump, own in parts
        )
        return np.concatenate([laws.damage(jumps, variables), *slips])

    @cached_property
    def last_growth(self) -> Array:
        """The change of `irreversible` in the last step (2 q,); zero in the first one."""
        now = self.irreversible(self.state)
        return now - (self.irreversible(self.state.previous) if self.state.previous else now)

    @cached_property
    def dissipation(self) -> float:
        """How much damage and slip have grown in the last step, over the movement."""
        if not self.movement.any():
            return 0.0
        growth = self.last_growth
        growth = np.maximum(growth, 0) if self.opens_points else np.abs(growth)
        return float(growth.sum() / np.abs(self.movement).max())

    @cached_property
    def damage(self) -> Array:
        """The damage of all points (q,)."""
        return np.split(self.irreversible(self.state), 2)[0]

    def leaps(self, begin: Point) -> bool:
        """Whether tension of more than the part FALL of the water's thrust has been lost since
        another equilibrium by points that soften in a single increment.
        """
        lost = self.lost(begin, self.tensile_strengths, self.softened_at_once(begin))
        return lost > FALL * self.thrust

    def has_grown(self, begin: Point) -> bool:
        """Whether a crack has grown since another equilibrium at nearly the same level: tension of
        more than the part FALL of the water's thrust is lost, or more uplift has entered.
        """
        return max(self.tension_lost(begin), self.entered(begin)) > FALL * self.thrust

    def tension_lost(self, begin: Point) -> float:
        """The tensile strength [N] that points have lost since another equilibrium."""
        return self.lost(begin, self.tensile_strengths, self.damage > begin.damage)

    def entered(self, begin: Point) -> float:
        """The largest uplift of a joint [N] that has entered since another equilibrium, beyond that
        of the level's rise.
        """
        return float(((self.filled - begin.filled) * self.heads).max(initial=0.0))

    def opens_at_once(self, begin: Point) -> bool:
        """Whether a point has lost most of its tensile strength since another equilibrium."""
        at_once = self.damage - begin.damage > AT_ONCE
        parts = zip(self.laws, self.state.variables.split(at_once), strict=True)
        return any(law.tensile_strength > 0 and points.any() for law, points in parts)

    def hidden_rise(self, begin: Point) -> float:
        """By how much the level may be higher between another equilibrium and this one [m]: up to
        the strength that is lost by points that begin to soften in between.
        """
        strengths = list[float]()
        for law in self.laws:
            shear = law.intact_cohesion
            strengths.append(law.tensile_strength + (shear if shear < np.inf else 0.0))
        counts = self.softened_at_once(begin) | (begin.damage == 0)
        return self.level * self.lost(begin, strengths, counts) / self.thrust

    def rise_before_water(self, begin: Point) -> float:
        """By how much the level may be higher between another equilibrium and this one [m], before
        the uplift enters that has entered in between.
        """
        return self.level * self.entered(begin) / self.thrust

    @cached_property
    def opens_points(self) -> bool:
        """Whether points are opened one by one: there is a law whose shear opening releases, and
        the uplift does not follow the opening.
        """
        return self.model.equilibrium.laws.releases_shear and not self.uplift_follows

    @cached_property
    def uplift_follows(self) -> bool:
        """Whether the uplift of a joint follows its opening."""
        return any(joint["uplift"] in ("cracked", "flow") for joint in self.model.case.joints)

    @property
    def laws(self) -> Sequence[Law[Any]]:
        """The law of each joint."""
        return self.model.equilibrium.laws.laws

    @property
    def tensile_strengths(self) -> list[float]:
        """The tensile strength of each joint [Pa]."""
        return [law.tensile_strength for law in self.laws]

    def softened_at_once(self, begin: Point) -> BoolArray:
        """Which points (q,) have softened by much since another equilibrium."""
        releases = self.model.equilibrium.laws.releases_shear
        largest = LARGEST_GROWTH_OF_RELEASE if releases else LARGEST_GROWTH
        return np.asarray(self.damage - begin.damage > largest)

    def lost(self, begin: Point, strengths: Sequence[float], counts: BoolArray) -> float:
        """The strength [N] that points have lost since another equilibrium; strengths [Pa]: of each
        joint; counts (q,): which points.
        """
        return self.strength_of(np.where(counts, self.damage - begin.damage, 0), strengths)

    def strength_of(self, damage: Array, strengths: Sequence[float]) -> float:
        """The strength [N] that goes with a damage of all points (q,); strengths: see `lost`."""
        if not damage.any():
            return 0.0
        weighted = self.model.equilibrium.interface.weights * damage
        parts = zip(self.laws, strengths, self.state.variables.split(weighted), strict=True)
        return float(sum(strength * part.sum() for law, strength, part in parts if law.softens))

    @cached_property
    def tension_lost_last(self) -> float:
        """The tensile strength [N] that points have lost in the last step."""
        damage, _ = np.split(self.last_growth, 2)
        return self.strength_of(np.maximum(damage, 0), self.tensile_strengths)

    @property
    def thrust(self) -> float:
        """The horizontal force of the reservoir on a vertical face [N]."""
        case, width = self.model.case, self.model.equilibrium.bulk.width
        return float(case["rho_water"] * case["g"] * self.level**2 / 2 * width)

    def reaches_joint(self, begin: Point) -> bool:
        """Whether the level passes an end of a joint since another equilibrium: from there on the
        reservoir feeds the joint, whatever its opening.
        """
        joints = zip(self.model.equilibrium.interface.joints, self.model.case.joints, strict=True)
        for joint, case in joints:
            ends = np.vstack([joint.mesh.heel.points, joint.mesh.toe.points])[:, 1]
            ends = ends - case["joint_head_offset"]
            if np.any((begin.level < ends) & (ends <= self.level)):
                return True
        return False

    @cached_property
    def uplifts(self) -> Array:
        """The uplift in each joint [N]."""
        return self.uplifts_in(self.state)

    @cached_property
    def filled(self) -> Array:
        """How far each joint is filled, see `filled_part`."""
        equilibrium, loading = self.model.equilibrium, self.state.loading
        parts = zip(equilibrium.interface.joints, self.uplifts, strict=True)
        filled = [
            filled_part(joint, equilibrium.unit_weight, uplift, loading.level, loading.tail)
            for joint, uplift in parts
        ]
        return np.concatenate(filled)

    @cached_property
    def wet_parts(self) -> Array:
        """How far each joint is filled, and its part under the full head of the reservoir, with
        cracked uplift (2, n) [-].
        """
        last, number = self.last, len(self.model.equilibrium.interface.joints)
        return np.array([self.filled, [last[column_of(FULL_HEAD, k)] for k in range(number)]])

    @cached_property
    def heads(self) -> Array:
        """The uplift of each joint, full of the reservoir's water, beyond that of the tailwater
        alone [N].
        """
        equilibrium, loading = self.model.equilibrium, self.state.loading
        joints, weight = equilibrium.interface.joints, equilibrium.unit_weight
        heads = [heads_of(joint, weight, loading.level, loading.tail)[1] for joint in joints]
        return np.concatenate(heads)

    def uplifts_in(self, state: State) -> Array:
        """The uplift in each joint in another state [N]."""
        joints = zip(state.pressures, self.model.equilibrium.interface.joints, strict=True)
        return np.array([joint.points.weights @ pressure.points for pressure, joint in joints])

    def prediction_error(self, end: Point, highest: float, to_growth: bool) -> float:
        """How far an increment from here is off the extrapolation of the last one, over what is
        allowed: its jumps, its level, where the reservoir has not reached a joint its uplift, and,
        to the first unstable growth, the tension that is lost; inf if there is no last one.
        highest: level of the path [m].
        """
        before, last = self.state.previous, self.movement
        moved = end.state.jump - self.state.jump
        ahead = float(moved @ last) / (float(last @ last) or np.inf)
        if before is None or not before.pressures or ahead <= 0:  # the first one has no loads
            return np.inf
        joints = self.model.equilibrium.interface.joints
        parts = [joint.at_points @ np.column_stack([moved, ahead * last]) for joint in joints]
        sizes = np.array([np.abs(part[:, 0]).max() for part in parts])
        offs = np.array([np.abs(part[:, 0] - part[:, 1]).max() for part in parts])
        off = float((offs / np.maximum(sizes, LEAST_MOVED * sizes.max())).max())
        levels = end.level - self.level, ahead * (self.level - before.loading.level)
        errors = [off / PREDICTED, deviation(*levels, 2 * STRAIGHT * highest)]
        if not end.reaches_joint(self):
            now, then = end.uplifts - self.uplifts, self.uplifts - self.uplifts_in(before)
            off = np.abs(now - ahead * then).max(initial=0.0)
            errors.append(float(off) / (2 * FALL * end.thrust or 1.0))
        if to_growth:
            off = abs(end.tension_lost(self) - ahead * self.tension_lost_last)
            errors.append(off / (2 * FALL * end.thrust))
        return max(errors)

    def unloads(self, begin: Point) -> bool:
        """Whether the level falls in the last step while damage and slip grow by a small part of
        what they did up to another point: elastic unloading along the path already passed.
        """
        crests = self.history.rows["crest_ux"][-2:]
        if self.opens_points and crests[-1] > crests[0]:  # nothing grows where the whole dam tips
            return False
        return self.level < begin.level and self.dissipation <= UNLOADING * begin.dissipation

    def steady(self, middle: Point, end: Point) -> bool:
        """Whether the jumps change from here to the end of an increment as in its first half."""
        whole, half = (point.state.jump - self.state.jump for point in (end, middle))
        return bool(np.abs(half - whole / 2).max() <= STEADY * np.abs(whole).max())

    def beyond(self, end: Point, begin: Point) -> bool:
        """Whether more damage has grown than up to an end, both reached from the same begin: then
        it is not between the two, but on another branch.
        """
        own, largest = (float((p.damage - begin.damage).sum()) for p in (self, end))
        return own > (1 + SAME_JUMP) * largest + ROUND_OFF * float(begin.damage.sum())

    def differs(self, other: Point, begin: Point) -> bool:
        """Whether the state differs from another one, both reached from the same begin."""
        moved = np.abs(other.state.jump - begin.state.jump).max()
        apart = np.abs(other.state.jump - self.state.jump).max()
        return bool(
            abs(self.level - other.level) > SAME_LEVEL * abs(other.level)
            or apart > SAME_JUMP * moved
        )


#: Ends of steps (None: it has not converged) with their begins, which the identities in their keys
#: need, by begin, time and control.
Solved: TypeAlias = dict[tuple[int, float, str, Hashable], tuple[Point, Point | None]]


def solve_once(
    solved: Solved, point: Point, time: float, control: Control, imposed: float, kind: str
) -> Point | None:
    """`Point.step`, unless the step has been solved."""
    key = id(point), time, kind, control.key
    if key not in solved:
        solved[key] = point, point.step(time, control, imposed, kind)
    _, end = solved[key]
    return end if end is None or end.imposed == imposed else replace(end, imposed=imposed)


def filled_part(
    joint: JointInterface,
    unit_weight: float,
    uplifts: ArrayLike,
    levels: ArrayLike,
    tails: ArrayLike,
) -> Array:
    """The uplift of a joint beyond that of the tailwater alone, over that of a joint full of the
    reservoir's water [-], (k,): it does not depend on the level, but on how far the water reaches.

    unit_weight: of the water [N/m3]; uplifts: [N], levels and tails: [m], k of each.
    """
    tail, head = heads_of(joint, unit_weight, levels, tails)
    return (np.atleast_1d(uplifts) - tail) / head


def heads_of(
    joint: JointInterface, unit_weight: float, levels: ArrayLike, tails: ArrayLike
) -> tuple[Array, Array]:
    """The uplift of the tailwater alone on a joint, and that of the reservoir beyond it [N], (k,)
    each; see `filled_part`.
    """
    heights = joint.points.positions[:, 1]

    def static(levels: ArrayLike) -> Array:
        depths = np.maximum(np.atleast_1d(levels)[:, None] - heights, 0)
        return unit_weight * (depths @ joint.points.weights)

    tail = static(tails)
    return tail, np.maximum(static(levels) - tail, unit_weight * ROUND_OFF)


def deviation(change: float, predicted: float, least: float) -> float:
    """Difference of a change from the predicted one over the largest that is allowed, the part
    PREDICTED_LEVEL of them, or a least value.
    """
    largest = PREDICTED_LEVEL * max(abs(change), abs(predicted))
    return abs(change - predicted) / (max(largest, least) or 1.0)
