"""Meshes of a case, made by Gmsh from geo/*.geo."""

from __future__ import annotations

from pathlib import Path

import gmsh
import numpy as np

from . import ROOT, RunError
from .parameters import Case, start_gmsh

#: Parameters that the mesh depends on, and nothing else.
GEOMETRY = ("dim", "mesh_pattern", "n_joint", "n_layers", "h_dam", "h_found", "dam_base", "dam_crest", "dam_height",
            "found_side", "found_depth", "thickness")


def key(case: Case) -> tuple:
    """What the mesh depends on: equal keys, equal meshes."""
    return tuple(case[name] for name in GEOMETRY)


def assignments(values: dict) -> str:
    """Lines default_name = value; in the common language of Gmsh and GetDP."""
    return "".join(f'default_{n} = "{v}";\n' if isinstance(v, str) else f"default_{n} = {v!r};\n" for n, v in values.items())


def write_mesh(case: Case, path: Path) -> dict[str, int]:
    """Mesh the case and write it to path (MSH 2.2, binary).

    Returns element and node counts: nodes, elements (of the bulk), joint_elements. Raises RunError with
    Gmsh's message.
    """
    start_gmsh()
    gmsh.clear()
    gmsh.parser.clear()
    gmsh.onelab.clear()
    dim = int(case["dim"])
    geometry = path.with_suffix(".geo")
    geometry.write_text(assignments({n: case[n] for n in GEOMETRY}) + f'Include "{ROOT}/geo/dam{dim}d.geo";\n')
    try:
        gmsh.open(str(geometry))
        gmsh.model.mesh.generate(dim)
        gmsh.option.setNumber("Mesh.MshFileVersion", 2.2)
        gmsh.option.setNumber("Mesh.Binary", 1)
        gmsh.write(str(path))
    except Exception as error:  # what gmsh raises
        raise RunError(f"mesh: {error}") from None

    def tags(dimension: int, group: int) -> np.ndarray:
        entities = gmsh.model.getEntitiesForPhysicalGroup(dimension, group)
        return np.concatenate([t for e in entities for t in gmsh.model.mesh.getElements(dimension, e)[1]])

    joint = tags(dim - 1, 3)
    if joint.max() >= 1_000_000:  # GetDP's memory keys hold six digits
        raise RunError(f"mesh: joint element tag {joint.max()}: must be below 1000000; use a coarser mesh")
    return {"nodes": len(gmsh.model.mesh.getNodes()[0]), "elements": len(tags(dim, 1)) + len(tags(dim, 2)),
            "joint_elements": len(joint)}
