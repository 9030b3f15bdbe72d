"""View of the scene in the window: clipping, rotation, position and scale."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import gmsh
import numpy as np

from ..input.case import Case
from ..mesh.body import Body
from ..model.loads import Loading, line_forces
from .layout import ABOVE, BELOW, MARGIN, Layout

#: Foundation shown beside and below the dam, over its height.
BESIDE, BELOW_DAM = 0.6, 0.5
#: Rock shown beyond the ends of a dam across a valley, over its height.
ACROSS = 0.25
#: Space above the crest for the arrows of forces with their labels, over the dam's height.
ARROWS = 0.2
#: Strips below the scene: their number; over the height of the scene: height of a strip with its
#: name, least width; share of the strip without its name.
STRIPS, STRIP, WIDTH, BAND = 3, 0.2, 1.4, 0.55
#: Margin of the clipping planes over the dam's size: displaced parts of the frame stay visible.
CLIP_MARGIN = 0.07
#: Option of a view: clipped by the first five of Gmsh's planes.
CLIPPED = 0b11111
#: Rotation about x, then y [degrees]: of a plane scene; of a section extruded along z, from above
#: and upstream; of a user's 3D geometry, from upstream towards the dam.
PLANE, EXTRUDED, TOWARDS_DAM = (0, 0), (20, 30), (30, 72)


@dataclass(frozen=True)
class Camera:
    """What is shown: a box (2, 3) [m], seen by a rotation, with strips below it or without."""

    box: np.ndarray
    turn: tuple[int, int]
    strips: bool = False

    @property
    def rotation(self) -> np.ndarray:
        """Rotation matrix (3, 3): of coordinates of the scene to right, up, towards the viewer."""
        about_x, about_y = np.radians(self.turn)
        (c, s), (d, t) = ((np.cos(a), np.sin(a)) for a in (about_x, about_y))
        return np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ [[d, 0, t], [0, 1, 0], [-t, 0, d]]

    @property
    def seen(self) -> np.ndarray:
        """Ends (2, 3) of the box to the right, upwards and towards the viewer [m]."""
        corners = np.array(list(itertools.product(*self.box.T))) @ self.rotation.T
        return np.array([corners.min(axis=0), corners.max(axis=0)])

    def strip(self, number: int) -> np.ndarray:
        """Ends (2, 2) of a strip below the box to the right and upwards [m]."""
        (left, bottom, _), (right, top, _) = self.seen
        height = STRIP * (top - bottom)
        low = bottom - (number + 1) * height
        wider = max(WIDTH * (top - bottom) - (right - left), 0.0) / 2
        return np.array([(left - wider, low), (right + wider, low + BAND * height)])

    def points_at(self, right_up: np.ndarray) -> np.ndarray:
        """Points of the scene (n, 3) at places to the right and upwards (n, 2) [m]."""
        middle = np.full(len(right_up), self.seen[:, 2].mean())
        points: np.ndarray = np.column_stack([right_up, middle]) @ self.rotation
        return points

    def clip(self, size: float) -> None:
        """Set Gmsh's clipping planes to the box; size: of the dam [m]."""
        (left, bottom, back), (right, _, front) = self.box
        planes = (
            (1, 0, 0, -left),
            (-1, 0, 0, right),
            (0, 1, 0, -bottom),
            (0, 0, 1, -back),
            (0, 0, -1, front),
        )
        for i, plane in enumerate(planes):
            offset = plane[3] + CLIP_MARGIN * size
            for name, value in zip("ABCD", (*plane[:3], offset), strict=True):
                gmsh.option.setNumber(f"General.Clip{i}{name}", value)

    def rotate(self) -> None:
        """Rotate the view."""
        gmsh.option.setNumber("General.Trackball", 0)
        for axis, degrees in zip("XYZ", (*self.turn, 0), strict=True):
            gmsh.option.setNumber(f"General.Rotation{axis}", degrees)

    def fit(self, layout: Layout, width: float) -> None:
        """Position and scale the scene: its box in a width of the drawing area [pixels]."""
        seen = self.seen[:, :2]
        if self.strips:
            lowest = self.strip(STRIPS - 1)
            seen = np.array([np.minimum(seen[0], lowest[0]), np.maximum(seen[1], lowest[1])])
        low, high = (
            np.array([gmsh.option.getNumber(f"General.{end}{axis}") for axis in "XYZ"])
            for end in ("Min", "Max")
        )
        seen = seen - (self.rotation @ (low + high) / 2)[:2]
        wide, tall = np.maximum(np.ptp(seen, axis=0), 1e-300)  # may be flat
        # without scaling, Gmsh fits the bounding box, seen along z, with a border into the window
        border = 1 + 2 * gmsh.option.getNumber("General.DisplayBorderFactor")
        sizes = np.maximum(high - low, 1e-300)[:2]
        per_metre = min(layout.width / sizes[0], layout.height / sizes[1]) / border
        room = width - 2 * MARGIN, layout.height - ABOVE - BELOW - 2 * MARGIN
        scale = max(min(room[0] / wide, room[1] / tall), 1e-9) / per_metre
        offset = (width - layout.width) / 2, (BELOW - ABOVE) / 2
        for i, axis in enumerate("XYZ"):
            gmsh.option.setNumber(f"General.Scale{axis}", scale)
            if i < 2:
                shift = offset[i] / (scale * per_metre) - seen[:, i].mean()
                gmsh.option.setNumber(f"General.Translation{axis}", shift)


def undeformed_camera(case: Case) -> Camera:
    """All of the outline of a case."""
    return Camera(frame(case, all_of_foundation=True), view_angles(case))


def result_camera(case: Case, bodies: dict[str, Body]) -> Camera:
    """The dam with a part of the foundation; strips below it in 3D."""
    box = frame(case)
    if case.geometry:
        dams = [body.points for name, body in bodies.items() if name.split(" ")[0] == "dam"]
        box = around(np.concatenate(dams), box)
    return Camera(box, view_angles(case), strips=case["dim"] == 3)


def view_angles(case: Case) -> tuple[int, int]:
    """Rotation of a scene."""
    if case["dim"] == 2:
        return PLANE
    return TOWARDS_DAM if case.geometry else EXTRUDED


def around(dam: np.ndarray, everything: np.ndarray) -> np.ndarray:
    """A box (2, 3) around the points of a dam (n, 3), within that of everything (2, 3) [m]."""
    low, high = dam.min(axis=0), dam.max(axis=0)
    height = high[1] - low[1]
    beside = np.array([BESIDE, BELOW_DAM, ACROSS]) * height
    higher = high + beside * [1, 0, 1]
    return np.array([np.maximum(low - beside, everything[0]), np.minimum(higher, everything[1])])


def frame(case: Case, all_of_foundation: bool = False) -> np.ndarray:
    """Corners (2, 3) of the box that is shown [m]: up to the crest or the water, with a part of the
    foundation or all of it; of a user's own geometry all.
    """
    if case.geometry:
        return np.array(gmsh.model.getBoundingBox(-1, -1)).reshape(2, 3)
    height, section = case["dam_height"], case.section
    beside, below = case["found_side"], case["found_depth"]
    if not all_of_foundation:
        lowest = min(0.0, *section["seg_y0"], *section["seg_y1"])
        beside, below = min(beside, BESIDE * height), min(below, BELOW_DAM * height - lowest)
    top = max(height, *case.levels, *case.tail_levels)
    loading = Loading.at(case, np.inf, max(case.levels), max(case.tail_levels))
    top += ARROWS * height * bool(line_forces(case, loading))
    depth = case["thickness"] if case["dim"] == 3 else 0.0
    return np.array([(-beside, -below, 0.0), (case["dam_base"] + beside, top, depth)])
