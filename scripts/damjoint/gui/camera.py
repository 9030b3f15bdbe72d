"""View of the scene in the window: clipping, rotation, position and scale."""

from __future__ import annotations

import itertools

import gmsh
import numpy as np

from ..model.case import Case

#: Distance between the maps of a 3D joint below the foundation, over the dam's height; number of
#: their rows and gaps.
MAPS, MAP_ROWS = 0.15, 4
#: Foundation shown beside and below the dam, over its height.
BESIDE, BELOW = 0.6, 0.5
#: Margin of the clipping planes over the dam's size: displaced parts of the frame stay visible.
CLIP_MARGIN = 0.05
#: Option of a view: clipped by the first three of Gmsh's planes.
CLIPPED = 0b111


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
        beside, below = min(beside, BESIDE * height), min(below, BELOW * height - lowest)
    top = max(height, *case.levels, *case.tail_levels)
    depth = case["thickness"] if case["dim"] == 3 else 0.0
    return np.array([(-beside, -below, 0.0), (case["dam_base"] + beside, top, depth)])


def clip(case: Case) -> None:
    """Set Gmsh's clipping planes to the frame of a scene."""
    (left, bottom, _), (right, *_) = frame(case)
    for i, plane in enumerate(((1, 0, 0, -left), (-1, 0, 0, right), (0, 1, 0, -bottom))):
        offset = plane[3] + CLIP_MARGIN * case.size
        for name, value in zip("ABCD", (*plane[:3], offset), strict=True):
            gmsh.option.setNumber(f"General.Clip{i}{name}", value)


#: Rotation of a 3D scene about x, then y [degrees].
TURN = 20, 30


def rotation(solid: bool) -> np.ndarray:
    """Rotation matrix of the view of a plane or 3D scene."""
    about_x, about_y = np.radians(TURN if solid else (0, 0))
    (c, s), (d, t) = ((np.cos(a), np.sin(a)) for a in (about_x, about_y))
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ [[d, 0, t], [0, 1, 0], [-t, 0, d]]


def rotate(solid: bool) -> None:
    """View a plane scene from the front, a 3D scene from above and upstream."""
    if solid == (gmsh.option.getNumber("General.RotationY") != 0):
        return  # keeps a rotation by the user
    gmsh.option.setNumber("General.Trackball", 0)
    for axis, degrees in zip("XYZ", (*TURN, 0) if solid else (0, 0, 0), strict=True):
        gmsh.option.setNumber(f"General.Rotation{axis}", degrees)


WINDOW = "GraphicsWidth", "GraphicsHeight", "MenuWidth"
#: Pixels for texts above and color scales below the scene, and around it.
ABOVE, BELOW_SCENE, MARGIN = 120, 130, 20


def fit(case: Case, graphs: float) -> None:
    """Position and scale the scene: its frame left of graphs of a width [pixels]; all of it in the
    window if that is 0.
    """
    box, solid = frame(case, not graphs), case["dim"] == 3
    if graphs and solid:
        box[0, 1] -= MAP_ROWS * MAPS * case.size
    corners = np.array(list(itertools.product(*box.T)))
    low, high = (
        np.array([gmsh.option.getNumber(f"General.{end}{axis}") for axis in "XYZ"])
        for end in ("Min", "Max")
    )
    seen = (corners - (low + high) / 2) @ rotation(solid).T
    wide, tall = (max(np.ptp(seen[:, i]), 1e-300) for i in (0, 1))  # may be flat
    size = {name: gmsh.option.getNumber(f"General.{name}") for name in WINDOW}
    window = size["GraphicsWidth"] - size["MenuWidth"], size["GraphicsHeight"]
    # without scaling, Gmsh fits the diagonal of the bounding box, seen along z, into the window
    per_metre = min(window) / np.hypot(*(high - low)[:2])
    room = window[0] - graphs - 2 * MARGIN, window[1] - ABOVE - BELOW_SCENE - 2 * MARGIN
    scale = min(room[0] / wide, room[1] / tall) / per_metre
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    offset = -graphs / 2, (BELOW_SCENE - ABOVE) / 2
    for i, axis in enumerate("XYZ"):
        gmsh.option.setNumber(f"General.Scale{axis}", scale)
        if i < 2:
            shift = offset[i] / (scale * per_metre) - middle[i]
            gmsh.option.setNumber(f"General.Translation{axis}", shift)
