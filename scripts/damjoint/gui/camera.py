"""How the scene lies in the window: cut to what is of interest, turned, placed and scaled."""

from __future__ import annotations

import itertools

import gmsh
import numpy as np

from ..model.case import Case

#: Distance between the maps of a 3D joint below the foundation, over the dam's height.
MAPS = 0.15
#: The option of a view that is clipped by the first three of Gmsh's planes.
CLIPPED = 0b111


def frame(case: Case, whole: bool = False) -> np.ndarray:
    """The corners (2, 3) of the box that is shown of a scene [m]: up to the crest or the water, of
    a large foundation what is of interest; or the whole of it.

    Of a user's own geometry all that is drawn.
    """
    if case.geometry:
        return np.array(gmsh.model.getBoundingBox(-1, -1)).reshape(2, 3)
    height, section = case["dam_height"], case.section
    beside, below = case["found_side"], case["found_depth"]
    if not whole:
        lowest = min(0.0, *section["seg_y0"], *section["seg_y1"])
        beside, below = min(beside, 0.6 * height), min(below, 0.5 * height - lowest)
    top = max(height, *case.levels, *case.tail_levels)
    depth = case["thickness"] if case["dim"] == 3 else 0.0
    return np.array([(-beside, -below, 0.0), (case["dam_base"] + beside, top, depth)])


def clip(case: Case) -> None:
    """Have Gmsh cut a large foundation to what is of interest."""
    (left, bottom, _), (right, *_) = frame(case)
    for i, plane in enumerate(((1, 0, 0, -left), (-1, 0, 0, right), (0, 1, 0, -bottom))):
        beyond = plane[3] + 0.05 * case.size  # what is shown whole moves, too
        for name, value in zip("ABCD", (*plane[:3], beyond), strict=True):
            gmsh.option.setNumber(f"General.Clip{i}{name}", value)


#: Degrees about x, then y, by which a solid scene is turned.
TURN = 20, 30


def turned(solid: bool) -> np.ndarray:
    """The rotation matrix of the way a scene is looked at."""
    about_x, about_y = np.radians(TURN if solid else (0, 0))
    (c, s), (d, t) = ((np.cos(a), np.sin(a)) for a in (about_x, about_y))
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ [[d, 0, t], [0, 1, 0], [-t, 0, d]]


def turn_to(solid: bool) -> None:
    """Look at a plane scene from the front, at a solid one from above and upstream."""
    if solid == (gmsh.option.getNumber("General.RotationY") != 0):
        return  # as the user has turned it
    gmsh.option.setNumber("General.Trackball", 0)
    for axis, degrees in zip("XYZ", (*TURN, 0) if solid else (0, 0, 0), strict=True):
        gmsh.option.setNumber(f"General.Rotation{axis}", degrees)


WINDOW = "GraphicsWidth", "GraphicsHeight", "MenuWidth"
#: Pixels that texts and scales take above and below the scene, and around it.
ABOVE, BELOW, MARGIN = 120, 130, 20


def aim(case: Case, graphs: float) -> None:
    """Place and scale the scene: all of it in the whole window, or its frame on the left of graphs
    of so many pixels.
    """
    box, solid = frame(case, not graphs), case["dim"] == 3
    if graphs and solid:
        box[0, 1] -= 4 * MAPS * case.size
    corners = np.array(list(itertools.product(*box.T)))
    low, high = (
        np.array([gmsh.option.getNumber(f"General.{end}{axis}") for axis in "XYZ"])
        for end in ("Min", "Max")
    )
    seen = (corners - (low + high) / 2) @ turned(solid).T
    wide, tall = (max(np.ptp(seen[:, i]), 1e-300) for i in (0, 1))
    size = {name: gmsh.option.getNumber(f"General.{name}") for name in WINDOW}
    window = size["GraphicsWidth"] - size["MenuWidth"], size["GraphicsHeight"]
    # unscaled, Gmsh fits the diagonal of the box around all, seen along z, into the window
    per_metre = min(window) / np.hypot(*(high - low)[:2])
    room = window[0] - graphs - 2 * MARGIN, window[1] - ABOVE - BELOW - 2 * MARGIN
    scale = min(room[0] / wide, room[1] / tall) / per_metre
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    place = -graphs / 2, (BELOW - ABOVE) / 2
    for i, axis in enumerate("XYZ"):
        gmsh.option.setNumber(f"General.Scale{axis}", scale)
        if i < 2:
            shift = place[i] / (scale * per_metre) - middle[i]
            gmsh.option.setNumber(f"General.Translation{axis}", shift)
