"""The gravity method: the body above the joint as a rigid block, stresses linear along the joint.

The hand calculation with which the results of the finite elements are compared [USACE EM
1110-2-2200; FERC Engineering Guidelines, chapter 3; Leclerc, Leger and Tinawi 2003]. The state at a
time does not depend on the load history; the joint cracks from the heel only.

Forces are per metre of thickness: x downstream, y upwards, moments about the joint's toe, holding
the dam down > 0. Along the joint, s is the distance from the heel.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from .. import InputError
from ..arrays import Table
from ..input.case import Case
from ..input.constraints import ZANGAR
from ..input.parameters import constants
from ..input.values import flows, freezes_uplift, has_drains
from ..model.loads import Loading, heads_at_ends, line_forces, zangar_column, zangar_share
from ..model.network import WaterPath
from ..units import STRESSES, with_unit

#: Distance from a plane, over the length of a joint, within which a node lies in it.
PLANE = 1e-6

#: Columns of gravity.csv: a row per load on the body above the joint, and their sum.
LOADS = {
    "load": ("", "what acts"),
    "Fx": ("N/m", "horizontal force, downstream > 0"),
    "Fy": ("N/m", "vertical force, upwards > 0"),
    "moment": ("N m/m", "about the joint's toe, holding the dam down > 0"),
}


class Load(NamedTuple):
    """A load's resultant: forces [N/m], moments [N m/m] of its horizontal and vertical part."""

    name: str
    fx: float
    fy: float
    moment_of_fx: float
    moment_of_fy: float

    @property
    def moment(self) -> float:
        """About the joint's toe [N m/m]."""
        return self.moment_of_fx + self.moment_of_fy

    def times(self, factor: float) -> Load:
        """The load multiplied by a factor."""
        return Load(self.name, *(factor * value for value in self[1:]))


def resultant_of(name: str, loads: list[Load]) -> Load:
    """The resultant of loads, with its name."""
    _, *components = zip(Load("nothing", 0.0, 0.0, 0.0, 0.0), *loads, strict=True)
    return Load(name, *map(math.fsum, components))


def force(name: str, fx: float, fy: float, point: tuple[float, float]) -> Load:
    """The load of a force at a point [m from the joint's toe]."""
    return Load(name, fx, fy, -point[1] * fx, point[0] * fy)


class Segment(NamedTuple):
    """A straight part of a face from (x0, y0) to (x1, y1), counted from the joint's toe [m]; the
    body on its left.
    """

    x0: float
    y0: float
    x1: float
    y1: float

    def below(self, height: float) -> Segment | None:
        """The part below a height above the toe; None if there is none."""
        if min(self.y0, self.y1) >= height:
            return None
        if max(self.y0, self.y1) <= height:
            return self
        part = (height - self.y0) / (self.y1 - self.y0)
        middle = self.x0 + part * (self.x1 - self.x0), height
        return Segment(*self[:2], *middle) if self.y0 < height else Segment(*middle, *self[2:])

    def pressure_load(self, p0: float, p1: float) -> Load:
        """The resultant of a pressure [Pa] that is linear from one end to the other."""
        width, rise, mean = self.x1 - self.x0, self.y1 - self.y0, (p0 + p1) / 2

        def first_moment(v0: float, v1: float) -> float:
            return (p0 * (2 * v0 + v1) + p1 * (v0 + 2 * v1)) / 6

        return Load(
            "pressure",
            -mean * rise,
            mean * width,
            first_moment(self.y0, self.y1) * rise,
            first_moment(self.x0, self.x1) * width,
        )

    def westergaard_load(self, surface: float) -> Load:
        """The resultant of a pressure Sqrt[surface - y] (surface: height above the toe [m]), times
        the normal's horizontal part, by the integrals of u^1/2 and u^3/2 over u = surface - y.
        """
        width, rise = self.x1 - self.x0, self.y1 - self.y0
        if rise == 0:
            return Load("pressure", 0, 0, 0, 0)
        u0, u1 = surface - self.y0, surface - self.y1
        half, three_halves = (2 / k * (u0 ** (k / 2) - u1 ** (k / 2)) for k in (3, 5))
        lean = width / rise
        part = abs(rise) / math.hypot(width, rise)
        return Load(
            "pressure",
            -half,
            lean * half,
            surface * half - three_halves,
            lean * ((self.x0 + lean * u0) * half - lean * three_halves),
        ).times(part)

    def zangar_load(self, surface: float, floor: float) -> Load:
        """The resultant of a pressure H (u + Sqrt[u]), see `zangar_column` (surface and floor:
        heights above the toe [m]).
        """
        width, rise = self.x1 - self.x0, self.y1 - self.y0
        if rise == 0:
            return Load("pressure", 0, 0, 0, 0)
        low, high = sorted((self.y0, self.y1))
        column = zangar_column(surface, low, high, floor)
        total, lever = (math.copysign(1.0, rise) * part for part in column)
        lean = width / rise
        return Load(
            "pressure",
            -total,
            lean * total,
            lever,
            lean * ((self.x0 - lean * self.y0) * total + lean * lever),
        )


class JointLine:
    """A joint as the straight line from heel to toe (x, y) [m]."""

    def __init__(self, case: Case) -> None:
        section = case.section
        self.toe = section["toe_x"][0], section["toe_y"][0]
        self.heel = section["heel_x"][0], section["heel_y"][0]
        self.length = section["joint_length"][0]
        #: the joint's direction, from heel to toe
        self.along = tuple((t - h) / self.length for t, h in zip(self.toe, self.heel, strict=True))

    def is_plane(self, rows: Table) -> bool:
        """Whether the joint is plane, in 3D a rectangle with sides along z; rows: of its table."""
        (tx, ty), reach = self.along, PLANE * self.length
        x, y, z = rows["x"] - self.heel[0], rows["y"] - self.heel[1], rows["z"]
        s, away = tx * x + ty * y, ty * x - tx * y
        ends = np.abs(s) < reach, np.abs(s - self.length) < reach
        wide = all(end.any() and np.ptp(z) - np.ptp(z[end]) < reach for end in ends)
        return bool(wide and (np.abs(away) < reach).all())


class RigidBlock(JointLine):
    """The part of the section above the joint: outline, faces, marks, from the joint's toe [m]."""

    def __init__(self, case: Case) -> None:
        super().__init__(case)
        section, (x, y) = case.section, self.toe
        ends = zip(*(section[f"seg_{n}"] for n in ("x0", "y0", "x1", "y1")), strict=True)
        self.all_segments = [Segment(x0 - x, y0 - y, x1 - x, y1 - y) for x0, y0, x1, y1 in ends]
        self.sides, self.bodies = section["seg_side"], section["seg_body"]
        self.marks = {
            int(region): (mx - x, my - y)
            for region, mx, my, k in zip(
                *(section[f"mark_{n}"] for n in ("region", "x", "y", "segment")), strict=True
            )
            if self.bodies[int(k)] == constants()["UPPER"][0]
        }

    def segments(self, *sides: str) -> list[Segment]:
        """Its segments on sides named as in pro/section.pro, from the toe up and to the heel."""
        wanted = [constants()[side][0] for side in sides]
        upper = constants()["UPPER"][0]
        placed = zip(self.all_segments, self.sides, self.bodies, strict=True)
        return [s for s, side, body in placed if body == upper and side in wanted]

    @cached_property
    def outline(self) -> np.ndarray:
        """Its corners (n, 2) from the toe on, counterclockwise."""
        segments = self.segments("UP", "TOP", "DOWN")
        return np.array([s[:2] for s in segments] + [segments[-1][2:]])

    @cached_property
    def area_and_centroid(self) -> tuple[float, float, float]:
        """Its area [m2] and centroid (shoelace formula)."""
        x, y = self.outline.T
        x1, y1 = np.roll(x, -1), np.roll(y, -1)
        cross = x * y1 - x1 * y
        area = float(cross.sum() / 2)
        xc, yc = (float((cross * (v + v1)).sum() / (6 * area)) for v, v1 in ((x, x1), (y, y1)))
        return area, xc, yc

    def force_at(self, mark: str, name: str, fx: float, fy: float) -> Load:
        """A force at a mark of pro/section.pro; none where that lies below the joint."""
        point = self.marks.get(int(constants()[mark][0]))
        return force(name, fx, fy, point) if point else force(name, 0.0, 0.0, (0.0, 0.0))


def fluid_on(segments: list[Segment], weight: float, surface: float) -> list[Load]:
    """A fluid of a weight [N/m3] up to a surface [m above the toe] on segments."""
    wet = [part for s in segments if (part := s.below(surface))]
    return [s.pressure_load(weight * (surface - s.y0), weight * (surface - s.y1)) for s in wet]


def water_on(
    name: str, segments: list[Segment], case: Case, body: RigidBlock, level: float
) -> Load:
    """Water up to a level, or of a uniform pressure, on the segments of a face."""
    weight = case["rho_water"] * case["g"]
    if case["face_load"] == "uniform":
        return resultant_of(
            name, [s.pressure_load(weight * level, weight * level) for s in segments]
        )
    return resultant_of(name, fluid_on(segments, weight, level - body.toe[1]))


def silt_on(case: Case, body: RigidBlock) -> Load:
    """Silt on the upstream face: horizontal pressure of an equivalent fluid; with silt_weight its
    weight on a batter, too.
    """
    unit_weight, surface = case["rho_silt"] * case["g"], case["silt_height"] - body.toe[1]
    pressure, weight = (
        resultant_of("silt", fluid_on(body.segments("UP"), unit_weight * share, surface))
        for share in (case["silt_K0"], case["silt_weight"])
    )
    return pressure._replace(fy=weight.fy, moment_of_fy=weight.moment_of_fy)


def added_pressure(case: Case, body: RigidBlock, level: float) -> Load:
    """The water's added pressure on the upstream face, H the level: Westergaard's 7/8 k_h rho_water
    g Sqrt[H (H - y)], times the normal's horizontal part [USACE EM 1110-2-2200, Westergaard 1933],
    or Zangar's C_m/2 k_h rho_water g H (u + Sqrt[u]), u = 1 - (y/H)^2 [Zangar 1952].
    """
    surface = level - body.toe[1]
    wet = [part for s in body.segments("UP") if (part := s.below(surface))]
    if case["added_mass"] == ZANGAR:
        size = zangar_share(case, level) / 2 * case["k_h"] * case["rho_water"] * case["g"]
        loads = [s.zangar_load(surface, -body.toe[1]) for s in wet]
        return resultant_of("added water pressure", loads).times(size)
    size = 7 / 8 * case["k_h"] * case["rho_water"] * case["g"] * math.sqrt(level)
    loads = [s.westergaard_load(surface) for s in wet]
    return resultant_of("added water pressure", loads).times(size * case["added_mass"])


def loads_on(
    case: Case, body: RigidBlock, time: float, level: float, tail: float
) -> tuple[Load, ...]:
    """All loads on the body above the joint but the water in the joint; the weight first, others
    only if they act.
    """
    area, *center = body.area_and_centroid
    centroid = (center[0], center[1])
    weight = case["rho_dam"] * case["g"] * area
    up, down, top = (body.segments(side) for side in ("UP", "DOWN", "TOP"))
    on_crest = case["crest_water"] and case["face_load"] == "hydrostatic"
    loading = Loading.at(case, time, level, tail)
    lines = line_forces(case, loading)
    quake = loading.part("quake")
    loads = (
        water_on("reservoir", up, case, body, level),
        water_on("tailwater", down, case, body, tail),
        water_on("water on the crest", top if on_crest else [], case, body, level),
        silt_on(case, body).times(loading.part("silt")),
        *(body.force_at(name.upper(), name, *lines[name]) for name in lines),
        force("earthquake", case["k_h"] * weight, case["k_v"] * weight, centroid).times(quake),
        added_pressure(case, body, level).times(quake),
    )
    return force("weight", 0.0, -weight, centroid), *(p for p in loads if any(p[1:]))


def path_of(case: Case, tail: float) -> WaterPath | None:
    """The path of the water through a joint at a level of the tailwater [m]; None if it leaves at
    more than one toe or at a heel, and in 3D where joints meet.
    """
    path = WaterPath.of(case)
    return path if path and tail <= path.highest_tail else None


class Uplift:
    """The water in the joint for a crack of length a from the heel: pressure [Pa] linear between
    positions s [m].

    Heads as in `heads_at_ends`. By `uplift`: none; imposed: linear from heel to toe; drained:
    reduced at the drains; cracked: that of the heel in the crack, beyond it as imposed or, with
    drains beyond the crack, as drained [USACE EM 1110-2-2200]; flow: as cracked without drains, the
    limit of the cubic law for a narrow closed joint; waterstop: the reservoir's up to it, none
    behind it. The pressure is not below zero.
    """

    def __init__(
        self,
        case: Case,
        body: JointLine,
        level: float,
        tail: float,
        crack: float,
        dry_until: float = 0.0,
    ) -> None:
        """dry_until: end of the part behind the crack [m] that an earthquake has opened, without
        pressure.
        """
        self.length, mode, path = body.length, case["uplift"], path_of(case, tail)
        if not path:
            raise InputError(
                f"uplift = {mode}: has no gravity method where joints meet and water leaves at "
                "more than one toe or at a heel"
            )
        path = path.at(level + case["joint_head_offset"])
        flowing = path.exits or flows(case)
        heights = path.heel_y, path.toe_y, flowing, path.rest_y
        ends = heads_at_ends(case, level, tail, *heights)
        #: heads at both ends of the path through the joint: heel and toe if it meets no other [m]
        self.first, self.last = first, last = float(ends[0]), float(ends[1])
        #: distance from the heel and head of the outlet [m] of drains that the crack has not passed
        self.drains: tuple[float, float] | None = None
        wet_crack, crack = crack, crack if mode in ("cracked", "flow") else 0.0
        drained = mode == "drained" or (mode == "cracked" and case["drains"])
        if mode == "waterstop" and not path.goes_on:
            first = last = level + case["joint_head_offset"]
        positions, heads = [0.0, crack, self.length], [first, first, last]
        at = case["drain_x"]
        if path.goes_on:
            positions, heads = self._on_path(case, body, path, tail, crack)
        elif drained and crack <= at < self.length:
            # that of the gallery or, if higher, the tailwater
            outlet = max(case["drain_level"], tail, body.heel[1] + at * body.along[1])
            self.drains = at, outlet
            undrained = float(np.interp(at, positions[1:], heads[1:]))
            if mode == "drained" and case["drain_reference"] == "reservoir":
                undrained = first
            positions.insert(2, at)
            effect = case["drain_effectiveness"]  # on the head above the outlet of the drains
            heads.insert(2, undrained - effect * max(undrained - outlet, 0.0))
        self.s = np.array(positions)
        height = np.interp(self.s, [0.0, self.length], [body.heel[1], body.toe[1]])
        weight = case["rho_water"] * case["g"] if mode != "none" else 0.0
        self.p = weight * (np.array(heads) - height)
        self.cut_off_suction()
        if mode == "waterstop":
            self.stop(min(case["waterstop"], self.length))
        if dry_until > wet_crack:
            self.dry(wet_crack, dry_until)

    def _on_path(
        self, case: Case, body: JointLine, path: WaterPath, tail: float, crack: float
    ) -> tuple[list[float], list[float]]:
        """Places [m] and heads [m] in a joint whose path goes on in others, which are not cracked:
        linear between the ends and the drains of the path without the crack, which conducts freely.
        """
        length, share = self.length, abs(path.end - path.begin)
        if not share:  # a branch in which the water is at rest
            head = self.first + (self.last - self.first) * path.begin
            return [0.0, length], [head, head]
        whole, forwards = length / share, path.end > path.begin
        start = path.begin * whole - (0 if forwards else crack)

        def along(s: float) -> float:
            return start + (1 if forwards else -1) * max(s - crack, 0.0)

        drains = [
            (whole * line.at, line.outlet, line.effectiveness, whole * line.reference)
            for line in path.drains
        ]
        at = case["drain_x"]
        if case["uplift"] == "cracked" and case["drains"] and crack <= at < length:
            outlet = max(case["drain_level"], body.heel[1] + at * body.along[1])
            self.drains = at, max(outlet, tail)
            drains = [(along(at), outlet, case["drain_effectiveness"], along(at))]
        ends = [0.0, whole - crack], [self.first, self.last]
        knots, positions = dict(zip(*ends, strict=True)), [0.0, crack, length]
        before, head = 0.0, self.first
        for drain, outlet, effect, reference in drains:
            share = (drain - before if before else reference) / (whole - crack - before)
            undrained = head + (self.last - head) * share
            knots[drain] = undrained - effect * max(undrained - max(outlet, tail), 0.0)
            before, head = drain, knots[drain]
            distance = (drain - start) * (1 if forwards else -1) + crack
            positions += [distance] if crack < distance < length else []
        positions, at_knots = sorted(positions), sorted(knots)
        heads = np.interp([along(s) for s in positions], at_knots, [knots[x] for x in at_knots])
        return positions, heads.tolist()

    def cut_off_suction(self) -> None:
        """Set negative pressures to zero."""
        s, p = self.s, self.p
        crossings = np.flatnonzero(p[:-1] * p[1:] < 0)
        if len(crossings):
            share = p[crossings] / (p[crossings] - p[crossings + 1])
            zeros = s[crossings] + share * (s[crossings + 1] - s[crossings])
            self.s, p = np.insert(s, crossings + 1, zeros), np.insert(p, crossings + 1, 0.0)
        self.p = np.maximum(p, 0.0)

    def stop(self, at: float) -> None:
        """Take the pressure away behind a waterstop [m from the heel]."""
        before = self.s < at
        pressure = np.interp(at, self.s, self.p) if at else 0.0
        self.s = np.concatenate([self.s[before], [at, at, self.length]])
        self.p = np.concatenate([self.p[before], [pressure, 0.0, 0.0]])

    def dry(self, start: float, end: float) -> None:
        """Take the pressure away between two positions [m from the heel]."""
        s, p = self.s, self.p
        first, last = np.interp([start, end], s, p)
        wet = [(s[s < start], p[s < start]), ([start], [first])] if start > 0 else []
        parts = [*wet, ([start, end], [0.0, 0.0]), ([end], [last]), (s[s > end], p[s > end])]
        self.s, self.p = (np.concatenate(column) for column in zip(*parts, strict=True))

    @property
    def force(self) -> float:
        """U, normal to the joint [N/m]."""
        return float(np.sum(np.diff(self.s) * (self.p[1:] + self.p[:-1])) / 2)

    @property
    def moment(self) -> float:
        """About the toe, lifting the dam > 0 [N m/m]."""
        arm, p = self.length - self.s, self.p
        parts = p[:-1] * (2 * arm[:-1] + arm[1:]) + p[1:] * (arm[:-1] + 2 * arm[1:])
        return float(np.sum(np.diff(self.s) * parts) / 6)


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
        return cracked(self.case, self.body, self.loads, self.time, self.level, tension=False)

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
    """The shortest crack in equilibrium and, if it grows past the drains or another limit, the
    longer ones.
    """
    longer = (f"; if it grows further, {state.description}" for state in shortest.further)
    return "".join([shortest.description, *longer])


def factors_of_state(case: Case, state: Mapping[str, float]) -> dict[str, float]:
    """SSF, its cohesion and OSF of a state of the finite elements at a case's only joint, a row of
    the history: with its resultants, the cohesion that is left and, for OSF, the loads of the
    gravity method; it is nan for a user's own geometry, whose loads are known only in sum.
    """
    overturning = math.nan
    if not case.geometry:
        block = with_crack(case, state["time"], state["level"], 0.0)
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
    follows from N, T, M and the uplift. None if the joint is not plane, if the water has no path
    (see `path_of`), or if it follows from a crack before a pseudo-static earthquake.

    rows: of the joint's table.
    """
    joint, path = JointLine(case), path_of(case, case.tail_at(state["time"]))
    if freezes_uplift(case) or not (path and joint.is_plane(rows)):
        return None
    (tx, ty), normal, shear = joint.along, state["N"] + state["U"], state["T"]
    moment = state["M"] + state["M_U"]
    loads = Load("all loads", tx * shear + ty * normal, ty * shear - tx * normal, 0.0, moment)
    return cracked(case, joint, (loads,), state["time"], state["level"])


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
    return cracked(case, body, loads, time, level, tension, before)


def cracked(
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

    spans = pieces(case, body, level, tail)
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
    """The crack length [m] without the earthquake that acts at a time; None if the water in the
    joint does not follow from it.
    """
    if not freezes_uplift(case) or not Loading.at(case, time, level, 0.0).part("quake"):
        return None
    without_quake = replace(case, values=case.values | {"k_h": 0.0, "k_v": 0.0})
    return at(without_quake, time, level, tension).crack_length


def spans_between(ends: list[float]) -> list[tuple[float, float]]:
    """The intervals between numbers in ascending order, open at their starts."""
    return [(np.nextafter(a, b), b) for a, b in itertools.pairwise(ends) if b > a]


def pieces(case: Case, body: JointLine, level: float, tail: float) -> list[tuple[float, float]]:
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
