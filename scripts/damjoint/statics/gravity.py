"""The gravity method: the body above the joint as a rigid block, stresses linear along the joint.

The hand calculation with which the results of the finite elements are compared [USACE EM
1110-2-2200; FERC Engineering Guidelines, chapter 3; Leclerc, Leger and Tinawi 2003]. The state at a
time does not depend on the load history; the joint cracks from the heel only.

Forces as in rigid_block.py. Along the joint, s is the distance from the heel.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Table
from ..input.case import Case
from ..input.values import freezes_uplift, has_drains
from ..model.loads import Loading
from ..units import STRESSES, with_unit
from .rigid_block import LOADS, JointLine, Load, RigidBlock, loads_on, resultant_of
from .uplift import Uplift, path_of


def cohesion(case: Case, bonded: float) -> float:
    """Shear force [N/m] by the cohesion, divided by its partial factor, on a length [m]."""
    return case["adhesion"] / case["factor_c"] * bonded


def sliding_factor(case: Case, normal: float, shear: float, bonded: float) -> float:
    """SSF = (mu N' + c B) / |T|: shear friction factor, with mu and c divided by their partial
    factors; bonded: length B [m] on which cohesion is left, weighted with the part that is left.
    """
    resistance = case["mu"] / case["factor_mu"] * normal + cohesion(case, bonded)
    return resistance / abs(shear) if shear else math.inf


def overturning_factor(loads: tuple[Load, ...], uplift_moment: float) -> float:
    """OSF: stabilising over overturning moments about the toe, of the horizontal and the vertical
    part of each load apart; uplift_moment: of the water in the joint, lifting > 0 [N m/m].
    """
    moments = [*(m for load in loads for m in load[3:]), -uplift_moment]
    overturning = -math.fsum(m for m in moments if m < 0)
    return math.fsum(m for m in moments if m > 0) / overturning if overturning else math.inf


#: Parts of a joint, with half of their length over the joint's.
PARTS = {"middle third": 1 / 6, "middle half": 1 / 4, "within base": 1 / 2}


def position(x_resultant: float, length: float) -> str:
    """In which part of a joint N meets it."""
    away = abs(x_resultant / length - 1 / 2)
    return next((words for words, share in PARTS.items() if away <= share), "outside")


@dataclass(frozen=True)
class GravityMethod:
    """The rigid block at one time of a case. Stresses [Pa]: tension > 0, as in joint.csv."""

    case: Case
    #: the block above the joint; of a user's own geometry only the joint
    body: JointLine
    time: float
    level: float
    tail_level: float
    #: all but the water in the joint
    loads: tuple[Load, ...]
    #: from the heel [m]; the joint's length if no shorter crack is in equilibrium
    crack_length: float
    uplift: Uplift
    #: states that follow if the crack grows beyond this length or the drains: equilibria with a
    #: longer crack, or the joint cracked through
    further: tuple[GravityMethod, ...] = ()

    @property
    def uncracked(self) -> float:
        """Uncracked length of the joint [m]."""
        return self.body.length - self.crack_length

    @cached_property
    def resultant(self) -> Load:
        """Of all loads but the water in the joint."""
        return resultant_of("sum", list(self.loads))

    @property
    def U(self) -> float:
        """Uplift [N/m]."""
        return self.uplift.force

    @property
    def N(self) -> float:
        """Effective force normal to the joint, compression > 0 [N/m]."""
        (tx, ty), total = self.body.along, self.resultant
        return ty * total.fx - tx * total.fy - self.U

    @property
    def T(self) -> float:
        """Shear force along the joint, downstream > 0 [N/m]."""
        (tx, ty), total = self.body.along, self.resultant
        return tx * total.fx + ty * total.fy

    @property
    def M(self) -> float:
        """Moment of N about the toe, holding the dam down > 0 [N m/m]."""
        return self.resultant.moment - self.uplift.moment

    @property
    def stands(self) -> bool:
        """Whether an uncracked joint is under compression; sliding is not considered."""
        return self.uncracked > 0 and self.N > 0

    @property
    def x_resultant(self) -> float:
        """Where N meets the joint, from the heel [m]."""
        return self.body.length - self.M / self.N if self.N else math.nan

    @property
    def eccentricity(self) -> float:
        """Of N, from the middle of the joint (crack included), towards the toe > 0 [m]."""
        return self.x_resultant - self.body.length / 2

    @property
    def tip_stress(self) -> float:
        """Effective stress at the upstream end of the uncracked joint."""
        length = self.uncracked
        return (2 * self.N * length - 6 * self.M) / length**2 if length else math.nan

    @property
    def sigma_n_eff_heel(self) -> float:
        """Effective normal stress at the heel: 0 where it is cracked."""
        return 0.0 if self.crack_length else self.tip_stress

    @property
    def sigma_n_eff_toe(self) -> float:
        """Effective normal stress at the toe."""
        length = self.uncracked
        return (6 * self.M - 4 * self.N * length) / length**2 if length else math.nan

    @property
    def sigma_n_heel(self) -> float:
        """Total normal stress at the heel."""
        return self.sigma_n_eff_heel - float(self.uplift.p[0])

    @property
    def sigma_n_toe(self) -> float:
        """Total normal stress at the toe."""
        return self.sigma_n_eff_toe - float(self.uplift.p[-1])

    @property
    def SSF(self) -> float:
        """Sliding safety factor, with mu and adhesion of the case whatever its law."""
        return sliding_factor(self.case, self.N, self.T, self.uncracked)

    @property
    def cohesion(self) -> float:
        """Shear force by the cohesion of the uncracked joint [N/m]."""
        return cohesion(self.case, self.uncracked)

    @property
    def cohesion_undamaged(self) -> float:
        """Shear force by the cohesion of the joint without a crack [N/m]."""
        return cohesion(self.case, self.body.length)

    @property
    def OSF(self) -> float:
        """Overturning safety factor; nan if only the resultant of the loads is known."""
        if not isinstance(self.body, RigidBlock):
            return math.nan
        return overturning_factor(self.loads, self.uplift.moment)

    @property
    def without_tension(self) -> GravityMethod:
        """The same loads on a joint without tensile strength."""
        if isinstance(self.body, RigidBlock):
            return at(self.case, self.time, self.level, tension=False)
        return shortest_crack(
            self.case, self.body, self.loads, self.time, self.level, tension=False
        )

    @property
    def beside_drains(self) -> str:
        """On which side of the drains the crack ends; empty without drains or crack."""
        at = self.case["drain_x"]
        if not (has_drains(self.case) and at < self.body.length and self.crack_length):
            return ""
        side = "past" if self.crack_length > at else "before"
        return f" {side} the drains ({at:g} m)"

    @property
    def description(self) -> str:
        """Crack and safety factors."""
        if not self.stands:
            return f"overturning{self.beside_drains}"
        crack = f"crack {self.crack_length:.4g} m{self.beside_drains}"
        overturns = "" if math.isnan(self.OSF) else f", OSF {self.OSF:.4g}"
        return f"{crack}, SSF {self.SSF:.4g}{overturns}"

    @property
    def notes(self) -> list[str]:
        """Longer cracks in equilibrium; the result without tension, if it matters."""
        case, notes = self.case, []
        if self.further:
            notes.append(f"gravity method: {alternatives(self)}")
        if not self.crack_length and self.tip_stress > 0:
            strength = case.law.tensile_strength
            notes.append(
                f"gravity method: uncracked, as its {with_unit(self.tip_stress, STRESSES)} at the "
                f"heel are below the strength of {with_unit(strength, STRESSES)}; without tension: "
                f"{alternatives(self.without_tension)}"
            )
        return notes

    def table(self) -> dict[str, list[Any]]:
        """Resultants by the columns LOADS: the loads, the uplift, the sum."""
        tx, ty = self.body.along
        joint = Load("uplift", 0.0 - ty * self.U, tx * self.U, 0.0, 0.0 - self.uplift.moment)
        rows = [*self.loads, joint]
        rows.append(resultant_of("sum", rows))
        cells = [(row.name, row.fx, row.fy, row.moment) for row in rows]
        return dict(zip(LOADS, map(list, zip(*cells, strict=True)), strict=True))


def alternatives(shortest: GravityMethod) -> str:
    """The shortest crack in equilibrium and, if it grows past drains or such, longer ones."""
    longer = (f"; if it grows further, {state.description}" for state in shortest.further)
    return "".join([shortest.description, *longer])


def factors_of_state(
    case: Case, state: Mapping[str, float], block: GravityMethod | None = None
) -> dict[str, float]:
    """SSF, its cohesion and OSF of a state of the finite elements at a case's only joint, a row of
    the history: with its resultants, the cohesion that is left and, for OSF, the loads of the
    gravity method; it is nan for a user's own geometry, whose loads are known only in sum.

    block: `with_crack` of no crack, where it is known.
    """
    overturning = math.nan
    if not case.geometry:
        block = block or with_crack(case, state["time"], state["level"], 0.0)
        overturning = overturning_factor(block.loads, block.resultant.moment - state["M"])
    return {
        "cohesion": cohesion(case, state["bonded_length"]),
        "cohesion_undamaged": cohesion(case, case.joint_along),
        "SSF": sliding_factor(case, state["N"], state["T"], state["bonded_length"]),
        "OSF": overturning,
    }


def of_state(case: Case, rows: Table, state: Mapping[str, float]) -> GravityMethod | None:
    """The gravity method at the only joint of a user's own geometry, which alone holds what is
    above it, at a state of the finite elements, a row of the history: the resultant of the loads
    follows from N, T, M and the uplift. None if there is an `obstacle`.

    rows: of the joint's table.
    """
    if obstacle(case, rows, state):
        return None
    joint = JointLine(case)
    (tx, ty), normal, shear = joint.along, state["N"] + state["U"], state["T"]
    moment = state["M"] + state["M_U"]
    loads = Load("all loads", tx * shear + ty * normal, ty * shear - tx * normal, 0.0, moment)
    return shortest_crack(case, joint, (loads,), state["time"], state["level"])


def obstacle(case: Case, rows: Table, state: Mapping[str, float]) -> str:
    """Why a joint of a user's own geometry has no gravity method; empty if it has one: see
    `of_state`.
    """
    if freezes_uplift(case):
        return "its water pressure follows from the crack before the earthquake"
    if not path_of(case, case.tail_at(state["time"])):
        several = "it meets other joints in 3D" if case["dim"] == 3 else ""
        return several or "water leaves at more than one toe, or at a heel"
    return "" if JointLine(case).is_plane(rows) else "the joint is not plane"


def with_crack(case: Case, time: float, level: float, crack: float) -> GravityMethod:
    """The rigid block at a time of a case, with a reservoir level [m] and a crack length [m]."""
    body, tail = RigidBlock(case), case.tail_at(time)
    loads, uplift = loads_on(case, body, time, level, tail), Uplift(case, body, level, tail, crack)
    return GravityMethod(case, body, time, level, tail, loads, crack, uplift)


def at(case: Case, time: float, level: float | None = None, tension: bool = True) -> GravityMethod:
    """The gravity method at a time of a case: uncracked, or with the shortest crack in equilibrium;
    the states with longer cracks in `further`.

    level: of the reservoir [m], by default the prescribed one; tension: whether the joint has its
    tensile strength.
    """
    level = case.level_at(time) if level is None else level
    body = RigidBlock(case)
    loads = loads_on(case, body, time, level, case.tail_at(time))
    before = crack_before_earthquake(case, time, level, tension)
    return shortest_crack(case, body, loads, time, level, tension, before)


def shortest_crack(
    case: Case,
    body: JointLine,
    loads: tuple[Load, ...],
    time: float,
    level: float,
    tension: bool = True,
    before: float | None = None,
) -> GravityMethod:
    """As `at`, under given loads; before: see `crack_before_earthquake`."""
    tail = case.tail_at(time)

    def state(crack: float) -> GravityMethod:
        wet = crack if before is None else before
        dry_until = crack if case["quake_uplift"] == "zero" else 0.0
        uplift = Uplift(case, body, level, tail, wet, dry_until)
        return GravityMethod(case, body, time, level, tail, loads, crack, uplift)

    law = case.law
    strength, at_tip = (law.tensile_strength, law.open_tension) if tension else (0.0, 0.0)
    if state(0.0).tip_stress <= strength:
        return state(0.0)

    def excess(crack: float) -> float:
        block, uncracked = state(crack), body.length - crack
        return 2 * block.N * uncracked - 6 * block.M - at_tip * uncracked**2

    spans = uplift_spans(case, body, level, tail)
    if before is not None:
        spans = spans_between(sorted({0.0, before, min(case["drain_x"], body.length), body.length}))
    arrested = [state(crack) for crack in arrest_lengths(excess, spans)]
    standing = [block for block in arrested if block.stands]
    first, *further = standing or arrested[:1] or [state(body.length)]
    behind = float(np.nextafter(case["drain_x"], body.length))
    if first.stands and first.uplift.drains and not further and excess(behind) > 0:
        further = [state(body.length)]  # the crack grows through the joint
    return replace(first, further=tuple(further))


def crack_before_earthquake(case: Case, time: float, level: float, tension: bool) -> float | None:
    """The crack length [m] without the present earthquake; None: the water does not follow it."""
    if not freezes_uplift(case) or not Loading.at(case, time, level, 0.0).part("quake"):
        return None
    without_quake = replace(case, values=case.values | {"k_h": 0.0, "k_v": 0.0})
    return at(without_quake, time, level, tension).crack_length


def spans_between(ends: list[float]) -> list[tuple[float, float]]:
    """The intervals between numbers in ascending order, open at their starts."""
    return [(np.nextafter(a, b), b) for a, b in itertools.pairwise(ends) if b > a]


def uplift_spans(
    case: Case, body: JointLine, level: float, tail: float
) -> list[tuple[float, float]]:
    """Crack lengths [m], from and to, between which the uplift follows one formula: the drains'
    effect begins where the crack raises the head above their outlet, and ends behind them.
    """
    uplift = Uplift(case, body, level, tail, 0.0)
    ends = [0.0, body.length]
    if uplift.drains:
        at, outlet = uplift.drains
        first, last = uplift.first, uplift.last
        ends.append(at)
        if first != last and (share := (first - outlet) / (first - last)) != 1:
            ends.append((at - share * body.length) / (1 - share))
    return spans_between(sorted(e for e in ends if 0 <= e <= body.length))


#: Degree of the polynomial of `arrest_lengths`.
DEGREE = 4
#: Imaginary part of a real root of it over the length of its span [-]: rounding makes 1e-8 of a
#: double root. Larger ones are complex, and leave the spans as they are.
REAL_ROOT = 1e-6
#: Accuracy of a crack length over that of the joint [-].
CRACK_TOLERANCE = 1e-12
#: Distance within which a root is looked for first, over the same: a few times the rounding of the
#: polynomial. If it is not there, it is looked for in the whole span.
REACH = 1e-11


def arrest_lengths(
    excess: Callable[[float], float], spans: list[tuple[float, float]]
) -> list[float]:
    """The crack lengths [m] at which growth stops: the tension at the tip falls to its limit.

    excess: of the tension over its limit [N]; times the uncracked length it is a polynomial of
    degree 4 in the crack length within each of the spans (3 on a level joint).
    """
    length, lengths = spans[-1][1], []
    angles = np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1)
    for start, end in spans:
        x = (start + end) / 2 + (end - start) / 2 * np.cos(angles)
        values = [excess(a) * (length - a) for a in x]
        rough = np.polynomial.Polynomial.fit(x, values, DEGREE, domain=[start, end]).roots()
        rough = np.sort(rough.real[np.abs(rough.imag) < REAL_ROOT * (end - start)])
        turns = [a for a in rough if start < a < end]
        # between two roots, and beside the first and the last, the sign is known
        limits = [start, *((a + b) / 2 for a, b in itertools.pairwise(turns)), end]
        for (before, after), root in itertools.zip_longest(itertools.pairwise(limits), turns):
            if excess(before) > 0 >= excess(after):
                if root is not None:
                    low, high = root - REACH * length, root + REACH * length
                    if before < low and high < after and excess(low) > 0 >= excess(high):
                        before, after = low, high
                while after - before > CRACK_TOLERANCE * length:  # scipy would have to be loaded
                    middle = (before + after) / 2
                    before, after = (middle, after) if excess(middle) > 0 else (before, middle)
                lengths.append(float(after))
    return lengths
