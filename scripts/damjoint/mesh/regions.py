"""Regions of a mesh: their names in a user's own geometry, dimensions and Gmsh's types; those of
Gmsh's current mesh.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from .. import InputError, RunError
from ..arrays import IntArray
from ..input.case import Case
from ..input.parameters import constants, start_gmsh
from ..input.scene import BED, DOWN, FLOOR, LINES, SIDES, TOP, TRACTION, UP, numbered, stacked

#: Regions of a user's own geometry by the parameters that need them.
LOADED = {
    "hold_z": "sides",
    "ice_force": "ice",
    "anchor_force": "anchor",
    "force_x": "force",
    "force_y": "force",
    "traction_x": TRACTION,
    "traction_y": TRACTION,
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
    "point": 2,
    TRACTION: 1,
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
    **{name: name for name in (*LINES, TRACTION)},
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


class Regions(NamedTuple):
    """Names of the joints; physical groups by region, and those of the faces."""

    joints: tuple[str, ...]
    bodies: dict[str, int]
    faces: list[FaceRegion]


def section_regions(case: Case) -> Regions:
    """The regions of the section, by their numbers. Raises RunError if one is missing."""
    gmsh = start_gmsh()
    numbers, scene = constants(), stacked(case.joint_names)
    present = {group for _, group in gmsh.model.getPhysicalGroups()}
    tag_of = {name: int(numbers[name.upper()][0]) for name in REGIONS}
    layer = int(numbers["LAYER"][0])
    tag_of |= {
        numbered(name, k): tag_of[name] + k * layer
        for name in OF_JOINTS
        for k in range(1, len(scene))
    }
    solid = case["dim"] == 3
    bodies = {n: t for n, t in tag_of.items() if t in present and (n != "sides" or solid)}
    needed = [*NEEDED, *(numbered(n, k) for k in range(1, len(scene)) for n in OF_JOINTS)]
    if missing := [name for name in needed if name not in bodies]:
        raise RunError(f"mesh: no {missing[0]}; look at the geometry's proportions")
    faces, section = list[FaceRegion](), case.section
    for i, side in enumerate(section["seg_side"]):
        ends = section["seg_y0"][i], section["seg_y1"][i]
        number = int(section["seg_body"][i] - numbers["UPPER"][0])
        body = scene[number].upper if number >= 0 else scene[0].lower
        tag = int(numbers["SEGMENT"][0]) + i
        faces.append(FaceRegion(tag, body, SIDES[int(side)], min(ends), max(ends)))
    return Regions(case.joint_names, bodies, faces)


class Groups(NamedTuple):
    """The physical groups of a user's own geometry by their names: dimension and Gmsh's entities;
    in the mesh's order the names after the word dam of bodies, and of joints.
    """

    named: dict[str, tuple[int, IntArray]]
    dams: list[str]
    joints: list[str]


def user_groups(file: Path) -> Groups:
    """The physical groups of a user's own geometry.

    Raises InputError if one has an unknown name, or one that is needed is missing.
    """
    gmsh, named = start_gmsh(), dict[str, tuple[int, IntArray]]()
    parts: dict[str, list[str]] = {region: [] for region in OF_JOINTS}
    for d, tag in gmsh.model.getPhysicalGroups():
        if name := gmsh.model.getPhysicalName(d, tag).strip().lower():
            region, _, joint = name.partition(" ")
            if region in OF_JOINTS:
                parts[region].append(joint)
            elif name not in USER_NAMES | USER_FACES:
                allowed = ", ".join([*USER_NAMES, *USER_FACES])
                raise InputError(
                    f'geometry = {file}: region "{name}" is not known; allowed: {allowed}, and '
                    f"with several joints {', '.join(f'{region} NAME' for region in OF_JOINTS)}"
                )
            named[name] = d, gmsh.model.getEntitiesForPhysicalGroup(d, tag)
    joints = parts["joint"] or [""]
    needed = [n for n, region in USER_NAMES.items() if region in NEEDED and n not in OF_JOINTS]
    needed += [f"{n} {joint}".strip() for n in ("joint", "heel", "toe") for joint in joints]
    needed += [] if parts["dam"] else ["dam"]
    if missing := [name for name in needed if name not in named]:
        raise InputError(
            f"geometry = {file}: no region {', '.join(missing)}; the names of physical groups count"
        )
    return Groups(named, parts["dam"], joints)


def user_regions(file: Path, dim: int) -> Regions:
    """The regions of a user's own geometry by the names of its physical groups, which get the
    numbers of the package's own geometries.

    Raises InputError if a name, or the dimension of a group, is not suitable.
    """
    gmsh, numbers, groups = start_gmsh(), constants(), user_groups(file)
    gmsh.model.removePhysicalGroups()
    bodies, faces = dict[str, int](), list[FaceRegion]()
    order = {"dam": groups.dams, **dict.fromkeys(("joint", "heel", "toe"), groups.joints)}
    for name, (d, entities) in groups.named.items():
        kind, _, joint = name.partition(" ")
        # a face is as large as the joint
        region = kind if kind in OF_JOINTS else USER_NAMES.get(name, "joint")
        if d != dimension(region, dim):
            raise InputError(
                f'geometry = {file}: region "{name}" has dimension {d}: must be '
                f"{dimension(region, dim)} with dim = {dim}"
            )
        tag = int(numbers[region.upper()][0])
        if kind in OF_JOINTS:
            if joint not in order[kind]:
                raise InputError(f'geometry = {file}: region "{name}": there is no joint {joint}')
            number = order[kind].index(joint)
            tag += number * int(numbers["LAYER"][0])
            bodies[numbered(kind, number)] = tag
        elif name in USER_NAMES:
            bodies[region] = tag
        else:
            tag = int(numbers["SEGMENT"][0]) + len(faces)
            faces.append(FaceRegion(tag, *USER_FACES[name]))
        gmsh.model.addPhysicalGroup(d, entities, tag)
    return Regions(tuple(joint or "joint" for joint in groups.joints), bodies, faces)
