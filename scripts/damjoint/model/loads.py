"""Loads besides the weight: their factors in time, the faces under water, resultants of pressures.

Coordinates: y = 0 at the heel of the base. A column is the resultant of a pressure per unit weight
[m] on a straight face, integrated over the height: force [m2] and moment about y = 0 [m3].
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Array
from ..input.case import Case
from ..input.constraints import STAGED, ZANGAR
from ..input.parameters import TINY
from ..input.scene import DOWN, SIDES, TAILWATER, TOP, UP
from ..input.values import flows


@dataclass(frozen=True)
class Loading:
    """The loading at a time: reservoir and tailwater level [m], and the factors of the loads in the
    order of STAGED, 0 to 1 (temperature: -1 to 1).
    """

    level: float
    tail: float
    grown: tuple[float, ...] = (0.0,) * len(STAGED)

    @staticmethod
    def at(case: Case, time: float, level: float, tail: float) -> Loading:
        """The loading of a case at a time, with levels of its own."""
        parts = {n: min(max(time - case[f"{n}_t"] + 1, 0.0), 1.0) for n in STAGED}
        since, period = time - case["temperature_t"], case["temperature_period"]
        if since > 0 and period > 0:
            parts["temperature"] = math.cos(2 * math.pi * since / period)
        return Loading(level, tail, tuple(parts.values()))

    def part(self, name: str) -> float:
        """The factor of a load of STAGED."""
        return self.grown[list(STAGED).index(name)]


@dataclass(frozen=True)
class Unknown:
    """What is unknown under displacement control: the level [m], or the factor of a load."""

    load: str = "level"

    def of(self, loading: Loading) -> float:
        """Its value in a loading."""
        return loading.level if self.load == "level" else loading.part(self.load)

    def at(self, loading: Loading, value: float) -> Loading:
        """A loading with another value of it."""
        if self.load == "level":
            return Loading(value, loading.tail, loading.grown)
        parts = dict(zip(STAGED, loading.grown, strict=True)) | {self.load: value}
        return replace(loading, grown=tuple(parts.values()))


LEVEL = Unknown()


def heads_at_ends(
    case: Case,
    level: float,
    tail: float,
    heel_y: Array | float,
    toe_y: Array | float,
    flowing: bool | None = None,
    rest_y: float = math.inf,
) -> tuple[Array, Array]:
    """Heads [m] of the water in a joint at its heel and toe of these elevations [m], for levels of
    reservoir and tailwater.

    A dry end has its own elevation as head: no pressure. Of water whose flow is computed (flowing;
    None: as the case says) this is an exit, and no water enters there: a head on the other side
    that is lower holds here, too. Where both are dry, water is at rest below the lower one, or
    below rest_y.
    """
    reservoir = level + case["joint_head_offset"]
    wet_heel, wet_toe = reservoir > heel_y, tail > toe_y
    exit_heel, exit_toe = heel_y, toe_y
    if flows(case) if flowing is None else flowing:
        exit_heel, exit_toe = np.minimum(heel_y, tail), np.minimum(toe_y, reservoir)
    at_rest = np.minimum(np.minimum(heel_y, toe_y), min(max(reservoir, tail), rest_y))
    return (
        np.where(wet_heel, reservoir, np.where(wet_toe, exit_heel, at_rest)),
        np.where(wet_toe, tail, np.where(wet_heel, exit_toe, at_rest)),
    )


#: All loads complete, without water.
COMPLETE = Loading(0.0, 0.0, (1.0,) * len(STAGED))


def line_forces(case: Case, loading: Loading) -> dict[str, tuple[float, float]]:
    """Line forces along x and y [N/m] in the order of the section's marks; traction [Pa]."""
    angle, pull = math.radians(case["anchor_angle"]), case["anchor_force"]
    full = {
        "ice": (case["ice_force"], 0.0),
        "force": (case["force_x"], case["force_y"]),
        "anchor": (-pull * math.sin(angle), -pull * math.cos(angle)),
        "traction": (case["traction_x"], case["traction_y"]),
    }
    return {
        name: (loading.part(name) * x, loading.part(name) * y)
        for name, (x, y) in full.items()
        if x or y
    }


def thermal_strains(case: Case, loading: Loading) -> dict[str, float]:
    """Free thermal strains of a case at a loading by region and distribution, if they can occur:
    uniform, and the difference between downstream and upstream face where it is linear.
    """
    uniform = case["expansion_dam"] * case["temperature_dam"]
    linear = case["expansion_dam"] * case["temperature_linear"]
    full = {
        "dam_uniform": uniform,
        "dam_linear": linear,
        "lower_uniform": uniform,
        "lower_linear": linear,
        "foundation_uniform": case["expansion_found"] * case["temperature_found"],
    }
    return {name: loading.part("temperature") * strain for name, strain in full.items() if strain}


def across(case: Case, positions: Array) -> Array:
    """Distance from the upstream face of the section over its thickness at the height of each
    position (n, 3), less a half: from -1/2 to 1/2 (n,).
    """
    section, y = case.section, positions[:, 1]

    def face(side: str) -> Array:
        segments = [i for i, number in enumerate(section["seg_side"]) if SIDES[int(number)] == side]
        ends = [
            (section[f"seg_y{k}"][i], section[f"seg_x{k}"][i]) for i in segments for k in (0, 1)
        ]
        heights, x = np.array(sorted(ends)).T
        return np.interp(y, heights, x)

    upstream, downstream = face(UP), face(DOWN)
    share: Array = (positions[:, 0] - upstream) / (downstream - upstream) - 0.5
    return share


def wet(case: Case, side: str, lowest: float) -> bool:
    """Whether water (or silt) may press on a face in a case, from its side and its lowest y [m]."""
    if side == UP:
        return True
    highest = max(case.tail_levels) if side in TAILWATER else case.reached
    loaded = {DOWN: True, TOP: overtopped(case)}.get(side, bool(case["floor_water"]))
    return loaded and highest > lowest


def wet_segments(case: Case) -> tuple[bool, ...]:
    """Whether water may press on each segment of the section of a case."""
    segments = zip(*(case.section[f"seg_{n}"] for n in ("side", "y0", "y1")), strict=True)
    return tuple(wet(case, SIDES[int(side)], min(y0, y1)) for side, y0, y1 in segments)


def overtopped(case: Case) -> bool:
    """Whether water may stand on the crest; a uniform pressure does not act there."""
    deep = case["crest_water"] and case["face_load"] == "hydrostatic"
    return bool(deep and (case.geometry or case.reached > case["dam_height"]))


def water_column(level: float, low: float, high: float) -> tuple[float, float]:
    """Column of hydrostatic pressure p = level - y on a face from low to high."""
    top = max(min(level, high), low)
    return (
        level * (top - low) - (top**2 - low**2) / 2,
        level * (top**2 - low**2) / 2 - (top**3 - low**3) / 3,
    )


def quake_column(level: float, low: float, high: float, floor: float) -> tuple[float, float]:
    """Column of Westergaard's sqrt(H (H - y')), H = level - floor, y' from the floor, per 7/8 k_h:
    the parabola of Westergaard (1933), as in EM 1110-2-2200.
    """
    depth = level - floor
    if level <= low or depth <= 0:
        return 0.0, 0.0
    # u = level - y from below the surface: int u^(1/2) du and int (level - u) u^(1/2) du
    most, least = level - low, max(level - high, 0.0)
    first = 2 / 3 * (most**1.5 - least**1.5)
    second = 2 / 5 * (most**2.5 - least**2.5)
    return depth**0.5 * first, depth**0.5 * (level * first - second)


def zangar_column(level: float, low: float, high: float, floor: float) -> tuple[float, float]:
    """Column of Zangar's H (u + sqrt(u)), u = 1 - v^2, v = y'/H, H = level - floor, y' from the
    floor, per C_m k_h/2 [Zangar 1952].
    """
    depth = level - floor
    if level <= low or depth <= 0:
        return 0.0, 0.0

    def integrals(y: float) -> tuple[float, float]:
        v = min((y - floor) / depth, 1.0)
        root = math.sqrt(1 - v**2)
        return v - v**3 / 3 + (v * root + math.asin(v)) / 2, v**2 / 2 - v**4 / 4 - root**3 / 3

    (area, lever), (area_low, lever_low) = integrals(high), integrals(low)
    first = depth**2 * (area - area_low)
    return first, floor * first + depth**3 * (lever - lever_low)


def zangar_share(case: Case, level: float) -> float:
    """Zangar's largest pressure coefficient C_m, by the angle of the upstream face.

    A face whose vertical part is at least half of the dam's height counts as vertical, any other as
    the line from its foot to the waterline [USBR 1987].
    """
    batter, height, angle = case["batter"], case["batter_height"], 0.0
    if height > case["dam_height"] / 2 and level > 0:
        angle = math.degrees(math.atan(batter * min(level, height) / height / level))
    return float(np.interp(angle, case.shared["zangar_angle"], case.shared["zangar_cm"]))


@dataclass(frozen=True)
class AddedPressure:
    """The added pressure of the water on the upstream face in an earthquake, per unit weight [m]:
    of Westergaard, times the horizontal part of the face's normal, or of Zangar.
    """

    #: 7/8 k_h, or C_m k_h/2
    size: float
    #: foot of the face [m]
    floor: float
    zangar: bool = False

    @staticmethod
    def of(case: Case, loading: Loading, floor: float) -> AddedPressure:
        """That of a case at a loading; size 0 without an earthquake."""
        full = AddedPressure.unit(case, loading.level, floor)
        return replace(full, size=full.size * case["k_h"] * loading.part("quake"))

    @staticmethod
    def unit(case: Case, level: float, floor: float) -> AddedPressure:
        """That of a case for k_h = 1: the depth of water that moves with the face."""
        zangar = case["added_mass"] == ZANGAR
        factor = zangar_share(case, level) / 2 if zangar else 7 / 8
        return AddedPressure(factor if case["added_mass"] else 0.0, floor, zangar)

    def height(self, level: float, y: Array, tilt: Array) -> Array:
        """Heights of pressure at heights y [m] where the normal has the horizontal part tilt."""
        depth = np.maximum(level - self.floor, 0)
        if not self.zangar:
            return self.size * tilt * np.sqrt(depth * np.maximum(level - y, 0))
        u = np.maximum(1 - ((y - self.floor) / max(depth, TINY)) ** 2, 0) * (y < level)
        return self.size * depth * (u + np.sqrt(u))

    def column(self, level: float, low: float, high: float, tilt: float) -> tuple[float, float]:
        """Its column on a face from low to high."""
        column = zangar_column if self.zangar else quake_column
        share = self.size * (1.0 if self.zangar else tilt)
        force, moment = column(level, low, high, self.floor)
        return share * force, share * moment
