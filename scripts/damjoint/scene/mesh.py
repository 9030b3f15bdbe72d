"""Meshes of a case, made by Gmsh from geo/*.geo."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import gmsh
import numpy as np

from .. import RunError, data
from .case import Case
from .parameters import assignments, constants, start_gmsh

#: Parameters that the mesh depends on, and nothing else.
GEOMETRY = (
    "dim",
    "mesh_pattern",
    "n_joint",
    "n_layers",
    "h_dam",
    "h_found",
    "dam_base",
    "dam_crest",
    "dam_height",
    "found_side",
    "found_depth",
    "thickness",
)

#: Regions of geo/*.geo that are read, and the codimension of each; their numbers stand in
#: pro/parameters.pro.
REGIONS = {
    "dam": 0,
    "foundation": 0,
    "joint": 1,
    "upstream": 1,
    "downstream": 1,
    "fixed": 1,
    "sides": 1,
}

#: Gmsh element types of order 1 by their VTK name.
SHAPES = {1: "line", 2: "triangle", 3: "quad", 4: "tetra", 5: "hexahedron", 6: "wedge"}


@dataclass
class Body:
    """One region of the mesh: points (n, 3), their node tags, cells by shape, element tags in that
    order.
    """

    points: np.ndarray
    node_tags: np.ndarray
    cells: list[tuple[str, np.ndarray]]
    element_tags: np.ndarray


class Mesh:
    """The mesh of a case: its bodies by the names of REGIONS, and its size.

    Raises RunError with Gmsh's message if there is no mesh for the parameters.
    """

    def __init__(self, case: Case) -> None:
        start = time.perf_counter()
        start_gmsh()
        gmsh.clear()
        gmsh.parser.clear()
        gmsh.onelab.clear()
        dim = int(case["dim"])
        with tempfile.NamedTemporaryFile("w", suffix=".geo") as file:
            file.write(
                assignments({n: case[n] for n in GEOMETRY}) + f'Include "{data("geo")}/dam.geo";\n'
            )
            file.flush()
            try:
                gmsh.open(file.name)
                gmsh.model.mesh.generate(dim)
            except Exception as error:  # what gmsh raises
                raise RunError(f"mesh: {error}") from None
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        self.dim, self.nodes = dim, len(tags)
        self._place = np.zeros(int(tags.max()) + 1, int)
        self._place[tags] = np.arange(len(tags))
        self._coordinates = coordinates.reshape(-1, 3)
        numbers = constants()
        gmsh_regions = {
            name: int(numbers[name.upper()][0]) for name in REGIONS if dim == 3 or name != "sides"
        }
        self.bodies = {
            name: self._body(dim - REGIONS[name], tag) for name, tag in gmsh_regions.items()
        }
        joint = self.bodies["joint"].element_tags
        if joint.max() >= 1_000_000:  # the keys of the joint's memory in GetDP hold six digits
            raise RunError(
                f"mesh: joint element tag {joint.max()}: must be below 1000000; use a coarser mesh"
            )
        #: wall seconds it took
        self.seconds = time.perf_counter() - start

    def _body(self, dimension: int, group: int) -> Body:
        blocks, numbers = {}, {}
        try:
            entities = gmsh.model.getEntitiesForPhysicalGroup(dimension, group)
        except Exception as error:  # what gmsh raises: a region that is too thin to be found
            raise RunError(f"mesh: {error}; look at the geometry's proportions") from None
        for entity in entities:
            for kind, elements, nodes in zip(
                *gmsh.model.mesh.getElements(dimension, entity), strict=True
            ):
                blocks.setdefault(kind, []).append(nodes.reshape(len(elements), -1))
                numbers.setdefault(kind, []).append(elements)
        flat = np.concatenate([b.ravel() for block in blocks.values() for b in block])
        used, cells = np.unique(flat, return_inverse=True)
        shapes, start = [], 0
        for kind, block in blocks.items():
            table = np.vstack(block)
            shapes.append((SHAPES[kind], cells[start : start + table.size].reshape(table.shape)))
            start += table.size
        return Body(
            self._coordinates[self._place[used]],
            used,
            shapes,
            np.concatenate([t for n in numbers.values() for t in n]),
        )

    @property
    def counts(self) -> dict[str, int]:
        """Nodes, elements (of dam and foundation) and joint_elements."""
        size = {name: len(body.element_tags) for name, body in self.bodies.items()}
        return {
            "nodes": self.nodes,
            "elements": size["dam"] + size["foundation"],
            "joint_elements": size["joint"],
        }

    def write(self, path: Path) -> None:
        """Write the mesh for GetDP (MSH 2.2, binary); only while it is Gmsh's current one."""
        gmsh.option.setNumber("Mesh.Binary", 1)
        gmsh.write(str(path))


def write_mesh(case: Case, path: Path) -> dict[str, int]:
    """Mesh the case, write it to path and return its counts.

    Raises RunError.
    """
    mesh = Mesh(case)
    mesh.write(path)
    return mesh.counts
