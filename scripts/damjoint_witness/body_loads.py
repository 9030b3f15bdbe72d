"""Loads on the bodies: water, silt and added mass on their faces, forces on lines, temperature."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import quad

from .reader import Point, Request, Values, section_above_base
from .solids import (
    ROCK,
    SAME,
    Array,
)


def grown(values: Values, name: str, time: float) -> float:
    """Return the factor of a load at a time: linear over the unit of time before its own."""
    since = time - values[f"{name}_t"]
    if name == "temperature" and since > 0 and values["temperature_period"]:
        return math.cos(2 * math.pi * since / values["temperature_period"])
    return float(min(max(since + 1, 0.0), 1.0))


@dataclass(frozen=True)
class Liquid:
    """Pressure of a liquid with its surface at a level, as heights [m]; with the added mass of
    Westergaard (share: 7/8 k_h) or Zangar (C_m k_h / 2), above a floor.
    """

    level: float
    floor: float = 0.0
    westergaard: float = 0.0
    zangar: float = 0.0

    def height(self, level: float, y: Array, tilt: Array | float) -> Array:
        """Heights of pressure for a surface at another level; tilt: |n_x| of the face."""
        depth = max(level - self.floor, 0.0)
        below = np.maximum(level - y, 0)
        added = self.westergaard * tilt * np.sqrt(depth * below)
        if self.zangar and depth:
            u = np.maximum(1 - ((y - self.floor) / depth) ** 2, 0) * (y < level)
            added = added + self.zangar * depth * (u + np.sqrt(u))
        return np.asarray(below + added)

    def resultant(self, low: float, high: float, tilt: float) -> tuple[float, float]:
        """Force and moment about low, per metre of height."""
        top = max(min(high, self.level), low)
        least, most = self.level - top, self.level - low
        # u = level - y: integrals of u and of u (u_most - u), those of sqrt(u) likewise
        force = (most**2 - least**2) / 2
        moment = most * force - (most**3 - least**3) / 3
        if self.westergaard:
            share = self.westergaard * tilt * math.sqrt(max(self.level - self.floor, 0))
            half = 2 / 3 * (most**1.5 - least**1.5)
            force += share * half
            moment += share * (most * half - 2 / 5 * (most**2.5 - least**2.5))
        if self.zangar:

            def added(y: float, power: int) -> float:
                height = float(self.height(self.level, np.array(y), tilt)) - (self.level - y)
                return height * (y - low) ** power

            force += quad(added, low, top, (0,), epsabs=0, epsrel=1e-12)[0]
            moment += quad(added, low, top, (1,), epsabs=0, epsrel=1e-12)[0]
        return force, moment


@dataclass(frozen=True)
class Face:
    """A straight face of the concrete in the plane of x and y, from its foot to its top."""

    foot: Point
    top: Point
    upstream: bool

    @property
    def rise(self) -> float:
        """Height [m]."""
        return self.top[1] - self.foot[1]

    @property
    def length(self) -> float:
        """Length [m]."""
        return math.dist(self.foot, self.top)

    @property
    def normal(self) -> Array:
        """Outward normal."""
        along = (np.array(self.top) - self.foot) / self.length
        return np.array([-along[1], along[0], 0]) * (1 if self.upstream else -1)


def faces_between(corners: Sequence[Point], heights: Sequence[float], upstream: bool) -> list[Face]:
    """Return the straight faces of a polyline, cut at the heights of its joints."""
    coordinates = {y: x for x, y in corners}
    xs, ys = np.array(corners).T
    if (np.diff(ys) <= 0).any():
        return []
    for y in heights:
        if ys[0] < y < ys[-1] and min(abs(ys - y)) > SAME * ys[-1]:
            coordinates[y] = float(np.interp(y, ys, xs))
    ends = [(coordinates[y], y) for y in sorted(coordinates)]
    return [Face(foot, top, upstream) for foot, top in pairwise(ends)]


def x_at(face: Sequence[Point], y: Any) -> Any:
    """Return the position of a face at heights, that of its end beyond its ends [m]."""
    x, heights = np.array(face).T
    return np.interp(y, heights, x)


@dataclass(frozen=True)
class Loads:
    """Loads at a time: levels of reservoir and tailwater [m]."""

    request: Request
    time: float
    level: float
    tail: float

    @property
    def values(self) -> Values:
        """Parameters of the first joint, which are those of bodies and loads."""
        return self.request.joints[0]

    def part(self, name: str) -> float:
        """Return the factor of a load."""
        return grown(self.values, name, self.time)

    @cached_property
    def reservoir(self) -> Liquid:
        """The water on the upstream faces."""
        v = self.values
        size = v["k_h"] * self.part("quake")
        if not size or not v["added_mass"]:
            return Liquid(self.level)
        if v["added_mass"] == 1:
            return Liquid(self.level, westergaard=7 / 8 * size)
        return Liquid(self.level, zangar=zangar_coefficient(v, self.level) / 2 * size)

    def lines(self) -> dict[str, tuple[Point, Array]]:
        """Return points and forces [N/m] of the loads on lines, by name."""
        v, whole = self.values, section_above_base(self.values)
        angle = math.radians(v["anchor_angle"])
        anchor = -v["anchor_force"] * np.array([math.sin(angle), math.cos(angle)])
        forces = np.array([v["force_x"], v["force_y"]])
        sides = {"upstream": whole.upstream, "downstream": whole.downstream}

        def point_at(face: str, at: float) -> Point:
            if face == "crest":
                return v["batter"] + at, v["dam_height"]
            return x_at(sides[face], at), at

        found = {
            "ice": (point_at("upstream", v["ice_level"]), np.array([v["ice_force"], 0.0])),
            "force": (point_at(v["force_face"], v["force_at"]), forces),
            "anchor": (point_at("crest", v["anchor_at"]), anchor),
        }
        return {n: (at, self.part(n) * force) for n, (at, force) in found.items() if force.any()}

    def strain(self, region: int) -> Callable[[Any], Any]:
        """Return the free thermal strain in a region at positions (2 or 3, ...)."""
        v, part = self.values, self.part("temperature")
        if region == ROCK:
            rock = part * v["expansion_found"] * v["temperature_found"]
            return lambda x: rock + 0 * x[0]
        whole = section_above_base(v)

        def of_dam(x: Any) -> Any:
            upstream, downstream = (x_at(s, x[1]) for s in (whole.upstream, whole.downstream))
            share = (x[0] - upstream) / (downstream - upstream) - 0.5
            change = v["temperature_dam"] + v["temperature_linear"] * share
            return part * v["expansion_dam"] * change

        return of_dam


def zangar_coefficient(values: Values, level: float) -> float:
    """Return Zangar's C_m by the angle of the upstream face: one whose vertical part is at least
    half of the dam's height is vertical, any other the line from its foot to the waterline.
    """
    batter, height = values["batter"], values["batter_height"]
    angle = 0.0
    if height > values["dam_height"] / 2 and level > 0:
        angle = math.degrees(math.atan(batter * min(level, height) / height / level))
    coefficients = [0.735, 0.67, 0.62, 0.55, 0.48, 0.40, 0.31, 0.225, 0.125, 0]
    return float(np.interp(angle, range(0, 100, 10), coefficients))
