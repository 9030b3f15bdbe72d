"""The files with which the window of Gmsh runs the reference GetDP model on a user's own geometry,
without Python: NAME.geo and NAME.pro beside NAME.case.

They have what the Python package finds in the mesh: the numbers of the regions, which of them are
turned, bodies, ends and paths of the joints. None of these depends on the sizes of the elements,
but for the means over a curved heel or toe.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from textwrap import fill
from typing import TypeAlias

import numpy as np

from ... import InputError
from ...input.case import Case
from ...input.parameters import constants, listing, start_gmsh
from ...mesh.mesh import Mesh, mesh_of
from .paths import values_of_paths
from .process import macro_of_joint, position_of_joint, user_lists, user_names
from .solve import check

#: Gmsh's names of entities by dimension.
ENTITIES = "Point", "Curve", "Surface", "Volume"

#: Entities of the regions, by dimension and number.
Regions: TypeAlias = dict[tuple[int, int], list[int]]

#: Lines of NAME.geo and NAME.pro of a case with a hydrograph.
MADE_OF_FLOOD = "// Made by python -m damjoint_tools.gmsh_files from the hydrograph.\n"
WINDOW = 'Include "../geo/window.geo";\n'

MADE = "// Made by python -m damjoint_tools.gmsh_files, for dim = {dim}.\n"


def write_gmsh_files(cases: Sequence[Case], folder: Path) -> None:
    """Write NAME.geo and NAME.pro of cases into the folder of their files; regions or joints that
    several of them have alike into NAME_regions.geo and NAME_joints.pro of the first one.

    Raises InputError if a geometry is not a .geo file, or GetDP can not compute it.
    """
    texts = dict[str, tuple[str, str]]()
    for case in cases:
        geometry = case.geometry
        if not geometry and case.source and "hydrograph" in case.source.text.texts:
            check(case)
            flood = MADE_OF_FLOOD + text_of_flood(case)
            texts[case.name] = flood + WINDOW, flood
            continue
        if not geometry or geometry.suffix != ".geo":
            raise InputError(f"geometry = {geometry}: must be a .geo file")
        check(case)
        mesh = mesh_of(case)
        case = case.with_joints([joint.of_case for joint in mesh.joints])
        texts[case.name] = regions_text(geometry, mesh), joints_text(case, mesh)
    for name, both in texts.items():
        for kind, text in zip(("regions.geo", "joints.pro"), both, strict=True):
            alike = [n for n, others in texts.items() if text in others]
            if len(alike) > 1:
                shared = f"{alike[0]}_{kind}"
                (folder / shared).write_text(text)
                text = f'Include "{shared}";\n'
            path = folder / f"{name}{Path(kind).suffix}"
            path.write_text(HEADS[path.suffix].format(name=name) + text + TAILS[path.suffix])


#: What stands before and behind regions or joints in NAME.geo and NAME.pro.
HEADS = {
    ".geo": '// Mesh of {name}.case.\nInclude "../pro/units.pro";\nInclude "{name}.case";\n',
    ".pro": "// Problem of {name}.case.\n"
    'out_dir = StrCat[CurrentDirectory, "res/{name}/"];\n'
    'Include "../pro/units.pro";\nInclude "{name}.case";\n',
}
TAILS = {".geo": "", ".pro": 'Include "../pro/damjoint.pro";\n'}


def regions_text(geometry: Path, mesh: Mesh) -> str:
    """The geometry, and its regions by the numbers of pro/parameters.pro."""
    regions, inverse = regions_of(mesh)
    turned = sorted(inverse.difference(*turned_joints(regions, inverse, mesh).values()))
    return (
        MADE.format(dim=mesh.dim)
        + WINDOW
        + f'Include "../geo/{geometry.name}";\n'
        + f"If(dim != {mesh.dim})\n"
        + f'  Error("dim = %g: must be {mesh.dim}, as the regions in this file", dim);\n'
        + "EndIf\n"
        + "Mesh.MshFileVersion = 2.2;\n"
        + "Delete Physicals;\n"
        + "".join(
            fill(f"Physical {ENTITIES[d]}({tag}) = {{{numbers(of_region)}}};", 100) + "\n"
            for (d, tag), of_region in regions.items()
        )
        + (f"ReverseMesh {ENTITIES[mesh.dim - 1]} {{{numbers(turned)}}};\n" if turned else "")
    )


def text_of_flood(case: Case) -> str:
    """The levels of a hydrograph, which Gmsh and GetDP can not read, and what follows from it."""
    lists = {"levels": case.levels, "tail_levels": case.tail_levels}
    values = {f"default_{name}": case[name] for name in ("time_unit", "time_start")}
    return rounded(
        "".join(listing(name, values) for name, values in lists.items())
        + "".join(f"{name} = {value!r};\n" for name, value in values.items())
    )


def joints_text(case: Case, mesh: Mesh) -> str:
    """Position of the joints, and paths of the water."""
    inverse = turned_joints(*regions_of(mesh), mesh)
    lists = "".join(listing(name, values) for name, values in user_lists(mesh).items())
    joints = "".join(
        macro_of_joint(
            k, position_of_joint(mesh, k) + path + "side_of_normal = -1;\n" * (k in inverse)
        )
        for k, path in enumerate(values_of_paths(mesh, case))
    )
    return MADE.format(dim=mesh.dim) + rounded(lists) + user_names(mesh) + rounded(joints)


def turned_joints(regions: Regions, turned: set[int], mesh: Mesh) -> dict[int, list[int]]:
    """Entities of the joints, by number from 0, that are turned as a whole. They stay as they are,
    as curves along a joint need its elements in their order, and its normals are inverted.
    """
    first, layer = (int(constants()[name][0]) for name in ("JOINT", "LAYER"))
    entities = {k: regions[mesh.dim - 1, first + k * layer] for k in range(len(mesh.joints))}
    return {k: of_joint for k, of_joint in entities.items() if turned.issuperset(of_joint)}


def regions_of(mesh: Mesh) -> tuple[Regions, set[int]]:
    """Gmsh's entities of the regions, and those that are turned."""
    gmsh, d = start_gmsh(), mesh.dim - 1
    if mesh.divided:
        mesh.divide_faces()
    regions = {
        (dim, tag): sorted(map(int, gmsh.model.getEntitiesForPhysicalGroup(dim, tag)))
        for dim, tag in gmsh.model.getPhysicalGroups()
    }
    elements = {
        entity: np.concatenate(gmsh.model.mesh.getElements(d, entity)[1])
        for entity in {e for (dim, _), of_region in regions.items() if dim == d for e in of_region}
    }
    return regions, {e for e, tags in elements.items() if np.isin(tags, mesh.turned).any()}


def rounded(text: str) -> str:
    """A text with its numbers rounded, which thus are those of other machines, too."""
    return re.sub(r"-?\d+\.\d+(e[-+]?\d+)?", lambda number: f"{float(number[0]):.10g}", text)


def numbers(values: list[int]) -> str:
    """Ascending numbers in Gmsh's language: 1, 3 : 7, 9."""
    runs: list[list[int]] = []
    for value in values:
        if runs and runs[-1][-1] == value - 1:
            runs[-1].append(value)
        else:
            runs.append([value])
    return ", ".join(f"{run[0]} : {run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs)
