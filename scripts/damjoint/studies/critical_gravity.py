"""Critical values of the gravity method, beside those of the finite elements."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import brentq

from .. import InputError
from ..input.case import Case
from ..joint.interface import interface_of
from ..model.results import column_of
from ..solver.path_point import PRECISION, Point
from ..statics import gravity
from ..statics.limit import elastic_heel_stress
from ..statics.statement import cracks_and_drains
from ..units import STRESSES, with_unit
from .critical_value import CriticalValue

#: Further assumptions of the gravity method: tension, longest crack.
ASSUMPTIONS = {
    "with the crack past the drains": (True, True),
    "without tension": (False, False),
    "without tension, with the crack past the drains": (False, True),
}

#: By how much the gravity method's crack is longer than that of the finite elements where a note
#: says so, over the joint's length [-].
LONGER = 0.1

#: Relative distances from a value at which the gravity method's critical value is sought.
DISTANCES = (0.02, 0.05, 0.1, 0.2, 0.5, 0.9)


@dataclass(frozen=True)
class GravityValues:
    """The gravity method of a case with any value of a quantity."""

    case: Case
    #: the quantity: level, strength, uplift or a parameter
    of: str
    #: the case with a value, and that of each of its joints; raise InputError
    case_at: Callable[[float], Case]
    joints_at: Callable[[float], Sequence[Case]]
    #: the `rigid_blocks` so far, by value and tension: assumptions share most of them
    known: dict[tuple[float, bool], list[gravity.GravityMethod]] = field(default_factory=dict)

    def beside(self, result: CriticalValue, points: Sequence[Point]) -> CriticalValue:
        """A result with the values of the gravity method, and a note on them."""
        value, point = result.value, result.point
        if value is None or (by_hand := self.critical(value)) is None:
            return result
        joint, names = self.failing_block(by_hand), self.case.joint_names
        there = None
        if joint != result.joint and result.joint in names and self.case.of_joints:
            there = self.critical(value, joint=names.index(result.joint))
        others: dict[str, float] = {}
        for name, assumptions in ASSUMPTIONS.items():
            other = self.critical(value, *assumptions)
            known = by_hand, *others.values()
            if other is not None and not np.isclose(other, known, PRECISION, 0).any():
                where = self.failing_block(other, *assumptions)
                others[f"{name} on {where}" if where else name] = other
        of_drains = self.drains(value, point, points) if point else ()
        notes = filter(None, [self.tension(value), self.longer_crack(by_hand, points), *of_drains])
        return replace(
            result,
            gravity=by_hand,
            gravity_joint=joint,
            gravity_there=there,
            gravity_with=others,
            notes=[*notes],
        )

    def tension(self, value: float) -> str:
        """A note where the gravity method is uncracked but the elastic stress of the finite
        elements exceeds the tensile strength at the first joint's heel; else empty.
        """
        method, *_ = self.rigid_blocks(value)
        strength = method.case.law.tensile_strength
        if method.crack_length or method.tip_stress <= 0:
            return ""
        case = self.case if self.of == "level" else self.case_at(value)
        if self.of == "level":
            levels = (*case.levels[:-1], value)
            case = replace(case.with_values({"drive": "level"}), levels=levels)
        elastic = elastic_heel_stress(case, interface_of(case))
        if elastic <= strength:
            return ""
        linear, heel, most = (
            with_unit(v, STRESSES) for v in (method.tip_stress, elastic, strength)
        )
        return (
            f"there the gravity method is uncracked, {linear} at the heel; the elastic stress of "
            f"the finite elements (n_joint = {case['n_joint']:g}), {heel}, exceeds the strength of "
            f"{most}"
        )

    def longer_crack(self, level: float, points: Sequence[Point]) -> str:
        """A note where the gravity method's critical level [m] is below one of the finite elements
        as its crack is longer there than theirs; else empty.
        """
        above = [point for point in points if point.level >= level]
        if self.of != "level" or not above:
            return ""
        pairs = (self.rigid_blocks(level * (1 + side * PRECISION)) for side in (-1, 1))
        for k, (below, method) in enumerate(zip(*pairs, strict=True)):
            if reserve(method, False) >= 0:
                continue
            crack = above[0].last[column_of("crack_length", k)]
            if method.crack_length - crack <= LONGER * method.body.length:
                continue
            where = f" on {name}" if (name := self.case.named((k,))) else ""
            strength, why = with_unit(method.case.law.tensile_strength, STRESSES), ""
            if not below.crack_length:
                why = f", as its linear stress at the heel passes the strength of {strength}"
            return (
                f"above {level:.6g} m the gravity method{where} has {method.description}{why}; the "
                f"finite elements at {above[0].level:.6g} m: crack {crack:.4g} m"
            )
        return ""

    def drains(self, value: float, point: Point, points: Sequence[Point]) -> Iterator[str]:
        """Which crack passes the drains at a critical value, for each joint: of the finite elements
        at the last equilibrium, or beyond it on the way to failure.
        """
        beyond = [p for p in points if p.imposed > point.imposed]
        for k, method in enumerate(self.rigid_blocks(value)):
            name, at = self.case.named((k,)), method.case["drain_x"]
            cracks = [p.last[column_of("crack_length", k)] for p in (point, *beyond)]
            grown = next((crack for crack in cracks if crack > at), cracks[0])
            if note := cracks_and_drains(method.case, grown, method):
                yield f"{name}: {note}" if name else note

    def failing_block(self, value: float, tension: bool = True, longest: bool = False) -> str:
        """The joints that fail by the gravity method beyond its critical value, if there are
        several; arguments as in `critical`.
        """
        for beyond in (value * (1 + PRECISION), value * (1 - PRECISION)):
            methods = self.rigid_blocks(beyond, tension)
            failing = [k for k, m in enumerate(methods) if reserve(m, longest) < 0]
            if failing:
                return self.case.named(failing)
        return ""

    def critical(
        self,
        value: float,
        tension: bool = True,
        longest: bool = False,
        joint: int | None = None,
    ) -> float | None:
        """The critical value of the gravity method nearest to that of the finite elements; None if
        there is none within DISTANCES.

        tension: whether the joint has its tensile strength; longest: whether the longest of several
        cracks in equilibrium decides; joint: the number of the only joint that is considered.
        """

        def least(value: float) -> float:
            return self.reserve(value, tension, longest, joint)

        at_value = least(value)
        for share in DISTANCES:
            for other in (value * (1 + share), value * (1 - share)):
                at_other = least(other)
                fails = at_value < 0, at_other < 0
                if np.isfinite([at_value, at_other]).all() and fails[0] != fails[1]:
                    return float(brentq(least, value, other, rtol=PRECISION / 1000))
        return None

    def rigid_blocks(self, value: float, tension: bool = True) -> list[gravity.GravityMethod]:
        """The gravity method with a value, joint by joint; empty if the case allows no such value,
        or its geometry no gravity method.
        """
        if (value, tension) not in self.known:
            self.known[value, tension] = self._rigid_blocks(value, tension)
        return self.known[value, tension]

    def _rigid_blocks(self, value: float, tension: bool) -> list[gravity.GravityMethod]:
        if self.case.geometry:
            return []
        try:
            joints = self.joints_at(value)
        except InputError:
            return []
        level = value if self.of == "level" else None
        return [gravity.at(joint, joint.times[-1], level, tension) for joint in joints]

    def stands(self, value: float) -> bool | None:
        """Whether all joints have a `reserve`; None if there is no gravity method."""
        least = self.reserve(value)
        return None if np.isnan(least) else least >= 0

    def reserve(
        self,
        value: float,
        tension: bool = True,
        longest: bool = False,
        joint: int | None = None,
    ) -> float:
        """The least `reserve` of all joints, or of one by its number; nan if there is no gravity
        method.
        """
        methods = self.rigid_blocks(value, tension)
        methods = methods if joint is None else methods[joint : joint + 1]
        return min((reserve(method, longest) for method in methods), default=np.nan)


def reserve(method: gravity.GravityMethod, longest: bool) -> float:
    """The reserve of a rigid block against sliding, if its law has friction, and crushing of its
    toe, over its resistance: negative if it fails, -1 if it overturns [-]; longest: with the
    longest of several cracks in equilibrium.
    """
    case, method = method.case, (method, *method.further)[-1] if longest else method
    if not method.stands:
        return -1.0
    reserves = [1.0]
    if case.law.has_friction:
        reserves.append(1 - 1 / method.SSF if method.SSF > 0 else -1.0)
    if case["f_c"] > 0:
        reserves.append(1 + method.sigma_n_toe / case["f_c"])
    return min(reserves)
