"""Gmsh makes the mesh of a case, from geo/*.geo or a user's own geometry."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..arrays import Setting
from ..input.case import Case
from ..input.geometry_file import opened
from ..input.parameters import (
    AUTOMATIC,
    assignments,
    declared,
    empty_gmsh,
    interruptible,
    listing,
)
from ..input.values import has_drains, has_point

#: Parameters that the mesh always depends on.
GEOMETRY = (
    *("dim", "mesh_pattern", "n_joint", "n_layers", "h_dam", "h_found"),
    *("dam_base", "dam_crest", "dam_height", "batter", "batter_height", "neck_height"),
    *("neck_batter", "joint_slope", "joint_height", "found_side", "found_depth", "thickness"),
)

#: Parameters on which it depends only if a line force acts.
MARKS = {
    "ice_force": ("ice_level",),
    "anchor_force": ("anchor_at",),
    "force_x": ("force_face", "force_at"),
    "force_y": ("force_face", "force_at"),
}


def shares(case: Case) -> dict[str, Setting]:
    """The parameters on which the mesh of a case depends; lists of downstream face and lifts."""
    names = [*GEOMETRY, *(n for force, needs in MARKS.items() if case[force] for n in needs)]
    values: dict[str, Setting] = {name: case[name] for name in names}
    if has_point(case):
        values |= {"drive": "point"} | {name: case[name] for name in ("drive_face", "drive_at")}
    # of a force only whether it acts
    values |= {name: float(bool(case[name])) for name in MARKS}
    if has_drains(case):  # they need a node in all modes of uplift
        values |= {"uplift": "drained", "drain_x": case["drain_x"]}
    if case.downstream_face:
        values["downstream_face"] = case.downstream_face
    if case.lift_heights:
        _, *lifts = case.joints
        values["lift_heights"] = case.lift_heights
        values["lift_slopes"] = tuple(lift["joint_slope"] for lift in lifts)
        values["lift_drain_x"] = tuple(has_drains(lift) * lift["drain_x"] for lift in lifts)
    return values


def as_text(settings: Mapping[str, Setting]) -> str:
    """Values and lists of numbers in Gmsh's language."""
    lists = {name: value for name, value in settings.items() if isinstance(value, tuple)}
    values = {n: value for n, value in settings.items() if not isinstance(value, tuple)}
    listed = (listing(name, map(float, value)) for name, value in lists.items())
    return assignments(values) + "".join(listed)


#: Height [m] from which a section is in another unit of length, millimetres: Gmsh meshes it divided
#: by this. The last digit of a length moves nodes of a free mesh, and so all results by the error
#: of the mesh, 1e-5 to 1e-3; the numbers of a section in metres and millimetres are then the same.
THOUSAND = 1000.0
#: Lists of lengths among `shares`.
LISTS = ("downstream_face", "lift_heights", "lift_drain_x")
#: Automatic sizes of elements, whose last digit depends on the unit.
SIZES = ("h_dam", "h_found")


def divided(case: Case) -> dict[str, Setting]:
    """The parameters of `shares` with lengths divided by THOUSAND."""
    result, source = shares(case), case.source
    for name, value in result.items():
        if name in LISTS and isinstance(value, tuple):
            result[name] = tuple(float(v) / THOUSAND for v in value)
        elif name in declared() and declared()[name].unit == "m":
            result[name] = float(case[name]) / THOUSAND
    if source and not source.accuracy:
        given = source.text.defaults.keys() | source.overrides.keys()
        result |= {name: AUTOMATIC for name in SIZES if name not in given}
    return result


def generate(case: Case) -> None:
    """Make the mesh of a case, as Gmsh's current mesh.

    Raises RunError, and InputError if a user's own geometry can not be read.
    """
    gmsh, geometry = empty_gmsh(), case.geometry
    # a .geo file of a user may take sizes from the case
    large = not geometry and case["dam_height"] >= THOUSAND
    settings = (
        assignments(case.values) if geometry else as_text((divided if large else shares)(case))
    )
    with opened(geometry, settings):
        if not len(gmsh.model.mesh.getElements(int(case["dim"]))[0]):
            interruptible(gmsh.model.mesh.generate, int(case["dim"]))
    if large:
        gmsh.model.mesh.affineTransform(np.pad(THOUSAND * np.eye(3), [(0, 0), (0, 1)]).ravel())
    if geometry:
        # format MSH 2.2 has an element once for each of its groups: a point that is heel and toe
        ends = [e for d in range(int(case["dim"]) - 1) for e in gmsh.model.getEntities(d)]
        if ends:  # else of all entities
            gmsh.model.mesh.removeDuplicateElements(ends)
        # tags from 1 on, for small tables by tag and small keys in GetDP
        gmsh.model.mesh.renumberNodes()
        gmsh.model.mesh.renumberElements()
