"""The body above a joint as a rigid block, and the loads on it, for the gravity method.

Forces are per metre of thickness: x downstream, y upwards, moments about the joint's toe, holding
the dam down > 0.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..arrays import Table
from ..input.case import Case
from ..input.constraints import ZANGAR
from ..input.parameters import constants
from ..model.loads import Loading, line_forces, zangar_column, zangar_share

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
    """A straight face from (x0, y0) to (x1, y1), from the joint's toe [m]; its body on the left."""

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
        """The resultant of H (u + Sqrt[u]), see `zangar_column` (heights above the toe [m])."""
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
    """All loads on the body above the joint but its water: the weight, then others that act."""
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
