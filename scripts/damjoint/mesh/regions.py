"""Regions of a mesh: their names in a user's own geometry, dimensions and Gmsh's types."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..input.scene import BED, DOWN, FLOOR, LINES, TOP, UP

#: Regions of a user's own geometry by the parameters that need them.
LOADED = {
    "hold_z": "sides",
    "ice_force": "ice",
    "anchor_force": "anchor",
    "force_x": "force",
    "force_y": "force",
}

#: Codimension of the regions; their numbers are in pro/parameters.pro.
REGIONS = {
    "dam": 0,
    "foundation": 0,
    "lower": 0,
    "joint": 1,
    "fixed": 1,
    "sides": 1,
    "heel": 2,
    "toe": 2,
    "crest": 2,
    "ice": 2,
    "force": 2,
    "anchor": 2,
}

#: Regions of which each joint has its own.
OF_JOINTS = ("dam", "joint", "heel", "toe")

#: Regions that every geometry has.
NEEDED = ("dam", "foundation", "joint", "fixed", "heel", "toe", "crest")

#: Gmsh element types of order 1 by their VTK name.
SHAPES = {
    15: "vertex",
    1: "line",
    2: "triangle",
    3: "quad",
    4: "tetra",
    5: "hexahedron",
    6: "wedge",
}

#: Names of the physical groups of a user's own geometry: bodies and lines, faces by side and body.
USER_NAMES = {
    "dam": "dam",
    "foundation": "foundation",
    "lower dam": "lower",
    "joint": "joint",
    "fixed": "fixed",
    "z faces": "sides",
    "heel": "heel",
    "toe": "toe",
    "crest": "crest",
    **{name: name for name in LINES},
}

USER_FACES = {
    "upstream": ("dam", UP),
    "downstream": ("dam", DOWN),
    "crest surface": ("dam", TOP),
    "lower upstream": ("foundation", UP),
    "lower downstream": ("foundation", DOWN),
    "reservoir floor": ("foundation", FLOOR),
    "tailwater bed": ("foundation", BED),
}


def dimension(region: str, dim: int) -> int:
    """The dimension of a region's elements in 2D or 3D."""
    return 0 if region == "crest" else dim - REGIONS[region.split(" ")[0]]


class FaceRegion(NamedTuple):
    """The physical group of a face, and the face's attributes but for its surface."""

    tag: int
    body: str
    side: str
    low: float = np.nan
    high: float = np.nan
