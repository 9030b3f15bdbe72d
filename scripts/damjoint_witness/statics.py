"""Loads on the concrete above a joint, from its polygon and the parameters of the command.

Section 6 of reference/theory.md. Forces are per metre of thickness: x downstream, y up. Pressures
are integrated by quadrature.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .files import Files
from .reader import Point, Request, Section, Values

#: Tolerance of forces and moments over the dam's weight (times the joint's length) [-].
TOLERANCE = 1e-7
#: The same over the residual of the step [-], which is added.
OF_RESIDUAL = 10.0
#: Zangar's largest pressure coefficient, by the face's angle from the vertical [degrees].
ZANGAR = {0: 0.735, 10: 0.67, 20: 0.62, 30: 0.55, 40: 0.48, 50: 0.4, 60: 0.31, 70: 0.225, 80: 0.125}
#: Values of added_mass.
WESTERGAARD = 1
#: Points of a quadrature on (0, 1).
NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)

Array = NDArray[np.float64]
#: A traction [Pa] at heights y (n,) of a face with a unit normal into the dam: (n, 2).
Traction = Callable[[Array, Point], Array]


class Resultant:
    """Sum of forces: along x and y [N/m], and their moment about a point, that presses the joint
    shut > 0 [N m/m].
    """

    def __init__(self, toe: Point) -> None:
        self.toe, self.x, self.y, self.moment = toe, 0.0, 0.0, 0.0

    def add(self, fx: float, fy: float, at: Point) -> None:
        """Add a force at a point."""
        self.x += fx
        self.y += fy
        # clockwise turns the dam over the toe
        self.moment += (at[0] - self.toe[0]) * fy - (at[1] - self.toe[1]) * fx

    def add_face(
        self, face: tuple[Point, ...], traction: Traction, surface: float = math.inf, side: int = 1
    ) -> None:
        """Add a traction on the part of a face, from its foot up, that is below a surface; side: 1
        upstream, -1 downstream.
        """
        for (x0, y0), (x1, y1) in pairwise(face):
            length = math.hypot(x1 - x0, y1 - y0)
            into = side * (y1 - y0) / length, side * (x0 - x1) / length
            share = min(1.0, (surface - y0) / (y1 - y0))
            if share <= 0:
                continue
            # t^2 from the upper end: a root of the depth is smooth there
            part = share * (1 - ((1 + NODES) / 2) ** 2)
            weights = WEIGHTS / 2 * 2 * ((1 + NODES) / 2) * share * length
            x, y = x0 + part * (x1 - x0), y0 + part * (y1 - y0)
            for q, (fx, fy) in enumerate(weights[:, None] * traction(y, into)):
                self.add(float(fx), float(fy), (float(x[q]), float(y[q])))


def ramp(time: float, complete: float) -> float:
    """Share of a load that is complete at a time and grows over the unit of t before."""
    return min(max(time - complete + 1, 0.0), 1.0)


def centroid(outline: tuple[Point, ...]) -> tuple[float, Point]:
    """Area and centroid of a polygon, by triangles from its first corner."""
    (x0, y0), *others = outline
    area = mx = my = 0.0
    for (x1, y1), (x2, y2) in pairwise(others):
        part = ((x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)) / 2
        area += part
        mx += part * (x0 + x1 + x2) / 3
        my += part * (y0 + y1 + y2) / 3
    return area, (mx / area, my / area)


def weight(section: Section, v: Values) -> float:
    """Weight of the concrete above a joint [N/m]."""
    return float(v["rho_dam"] * v["g"] * centroid(section.outline)[0])


def loads(section: Section, v: Values, time: float, level: float, tail: float) -> Resultant:
    """All loads at a time on the concrete above a joint, but the water in the joint."""
    total, unit = Resultant(section.toe), v["rho_water"] * v["g"]
    _, center = centroid(section.outline)
    size = weight(section, v)
    quake = ramp(time, v["quake_t"])
    total.add(quake * v["k_h"] * size, -size + quake * v["k_v"] * size, center)
    for face, surface, side in ((section.upstream, level, 1), (section.downstream, tail, -1)):
        uniform = v["face_load"] == "uniform"
        water = of_water(unit, surface, uniform)
        total.add_face(face, water, math.inf if uniform else surface, side)
    (x1, y1), (x0, _) = section.crest
    if v["crest_water"] and v["face_load"] == "hydrostatic" and level > y1:
        total.add(0.0, -unit * (level - y1) * (x1 - x0), ((x0 + x1) / 2, y1))
    silt = ramp(time, v["silt_t"]) * v["rho_silt"] * v["g"]

    def of_silt(y: Array, into: Point) -> Array:
        depth = silt * (v["silt_height"] - y)
        return np.column_stack([v["silt_K0"] * depth * into[0], v["silt_weight"] * depth * into[1]])

    total.add_face(section.upstream, of_silt, v["silt_height"])
    if quake and v["k_h"] and v["added_mass"]:
        add_quake_water(total, section, v, level, quake * v["k_h"] * unit)
    for fx, fy, point in line_forces(section, v, time):
        total.add(fx, fy, point)
    return total


def pressed(pressure: Callable[[Array], Array]) -> Traction:
    """A pressure normal to a face."""
    return lambda y, into: pressure(y)[:, None] * np.array(into)


def of_water(unit: float, surface: float, uniform: bool) -> Traction:
    """Water of a unit weight [N/m3] up to a surface; uniform: as if all were at y = 0."""
    return pressed(lambda y: unit * np.maximum(surface - (0 * y if uniform else y), 0))


def add_quake_water(
    total: Resultant, section: Section, v: Values, level: float, size: float
) -> None:
    """Add the water that moves with the upstream face, its foot at y = 0."""
    if v["added_mass"] == WESTERGAARD:
        westergaard = lambda y, into: (
            (7 / 8 * size * into[0] * np.sqrt(level * np.maximum(level - y, 0))[:, None])
            * np.array(into)
        )
        total.add_face(section.upstream, westergaard, level)
        return
    angle = 0.0
    if v["batter_height"] > v["dam_height"] / 2 and level > 0:
        wide = v["batter"] * min(level, v["batter_height"]) / v["batter_height"]
        angle = math.degrees(math.atan(wide / level))
    most = float(np.interp(angle, list(ZANGAR), list(ZANGAR.values())))

    def zangar(y: Array) -> Array:
        r = np.maximum(level - y, 0) / level
        u = r * (2 - r)
        return most / 2 * size * level * (u + np.sqrt(u))

    total.add_face(section.upstream, pressed(zangar), level)


def line_forces(section: Section, v: Values, time: float) -> Iterator[tuple[float, float, Point]]:
    """Ice, line force and anchor that act above the joint: force and point."""
    angle, (crest_x, crest_y) = math.radians(v["anchor_angle"]), section.crest[1]
    if v["ice_force"] and (point := point_on(section.upstream, v["ice_level"])):
        yield ramp(time, v["ice_t"]) * v["ice_force"], 0.0, point
    if v["force_x"] or v["force_y"]:
        face = {"upstream": section.upstream, "downstream": section.downstream}.get(v["force_face"])
        point = point_on(face, v["force_at"]) if face else (crest_x + v["force_at"], crest_y)
        grown = ramp(time, v["force_t"])
        if point:
            yield grown * v["force_x"], grown * v["force_y"], point
    if v["anchor_force"]:
        grown = ramp(time, v["anchor_t"]) * v["anchor_force"]
        along = -grown * math.sin(angle), -grown * math.cos(angle)
        yield *along, (crest_x + v["anchor_at"], crest_y)


def point_on(face: tuple[Point, ...], height: float) -> Point | None:
    """The point of a face, from its foot up, at a height; None if it lies below the face."""
    for (x0, y0), (x1, y1) in pairwise(face):
        share = (height - y0) / (y1 - y0)
        if -1e-9 < share < 1 + 1e-9:
            return x0 + share * (x1 - x0), height
    return None


def along_joint(section: Section, total: Resultant) -> tuple[float, float, float]:
    """N + U and T [N/m], M + M_U about the toe [N m/m] that loads cause in a joint."""
    tx, ty = math.cos(section.slope), math.sin(section.slope)
    return ty * total.x - tx * total.y, tx * total.x + ty * total.y, total.moment


def balance(files: Files, request: Request) -> Iterator[str]:
    """Check N + U, T and M + M_U of every joint in every row of history.csv."""
    for k, (section, values) in enumerate(zip(request.sections, request.joints, strict=True)):
        rows = files.history_of(k)
        size = weight(request.sections[0], request.joints[0])
        worst: dict[str, tuple[float, str]] = {}
        for n, (time, level) in enumerate(zip(rows["time"], rows["level"], strict=True)):
            exact = along_joint(section, loads(section, values, time, level, request.tail_at(time)))
            found = {
                "N + U": rows["N"][n] + rows["U"][n],
                "T": rows["T"][n],
                "M + M_U": rows["M"][n] + rows["M_U"][n],
            }
            room = (TOLERANCE + OF_RESIDUAL * rows["residual"][n]) * size
            for (name, value), by_hand in zip(found.items(), exact, strict=True):
                error = abs(value - by_hand) / room / (section.length if name[0] == "M" else 1)
                if not error <= 1 and error > worst.get(name, (0.0, ""))[0]:
                    words = f"{name} = {value:.9g} at t = {time:g}, by hand {by_hand:.9g}"
                    worst[name] = error, words
        yield from (f"joint {k + 1}: {words}" for _, words in worst.values())
