"""Meshes of a case, made by Gmsh from geo/*.geo."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import gmsh
import numpy as np
from scipy import sparse

from .. import RunError, data
from .case import Case
from .parameters import assignments, constants, start_gmsh

#: Parameters that the mesh depends on, and nothing else.
GEOMETRY = (
    *("dim", "mesh_pattern", "n_joint", "n_layers", "h_dam", "h_found"),
    *("dam_base", "dam_crest", "dam_height", "batter", "batter_height", "neck_height"),
    *("joint_slope", "joint_height", "found_side", "found_depth", "thickness"),
)
#: Those that matter only where a line force acts.
MARKS = {
    "ice_force": ("ice_level",),
    "anchor_force": ("anchor_at",),
    "force_x": ("force_face", "force_at"),
    "force_y": ("force_face", "force_at"),
}

#: Regions and the codimension of each; their numbers stand in pro/parameters.pro.
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
#: Those that every geometry has.
NEEDED = ("dam", "foundation", "joint", "fixed", "heel", "toe", "crest")
#: What stands before a face, in the order of the numbers in pro/section.pro.
SIDES = ("up", "down", "top", "floor", "bed")

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


@dataclass
class Body:
    """One region of the mesh, or several: points (n, 3), their node tags, cells by shape, element
    tags in that order.
    """

    points: np.ndarray
    node_tags: np.ndarray
    cells: list[tuple[str, np.ndarray]]
    element_tags: np.ndarray
    #: the region of each block of cells
    regions: list[str] = field(default_factory=list)
    #: of a surface: unit normals (elements, 3), out of the body it belongs to
    normals: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))

    def middles(self) -> np.ndarray:
        """The middle of each element (elements, 3)."""
        return np.concatenate([self.points[table].mean(axis=1) for _, table in self.cells])


@dataclass
class Face:
    """A face that water can press on: its surface, whether it is one of the upper body, which of
    SIDES it is, and for a straight one from where to where [m] it reaches (not a number for any
    other).
    """

    surface: Body
    upper: bool
    side: str
    low: float = np.nan
    high: float = np.nan


def shares(case: Case) -> dict[str, float | str]:
    """The parameters that the mesh of a case depends on."""
    names = [*GEOMETRY, *(n for force, needs in MARKS.items() if case[force] for n in needs)]
    # whether there is a force, not how large
    there = {name: float(bool(case[name])) for name in MARKS}
    return {name: case[name] for name in names} | there


class Mesh:
    """The mesh of a case: its bodies by the names of REGIONS (foundation: with what lies under a
    lift joint), its faces, and its size.

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
            file.write(assignments(shares(case)) + f'Include "{data("geo")}/dam.geo";\n')
            file.flush()
            try:
                gmsh.open(file.name)
                gmsh.model.mesh.generate(dim)
            except Exception as error:  # what gmsh raises
                raise RunError(f"mesh: {error}") from None
        self.dim = dim
        self._read()
        numbers = constants()
        present = {group for _, group in gmsh.model.getPhysicalGroups()}
        tag_of = {name: int(numbers[name.upper()][0]) for name in REGIONS}
        there = [n for n in REGIONS if tag_of[n] in present and (n != "sides" or dim == 3)]
        if missing := [name for name in NEEDED if name not in there]:
            raise RunError(f"mesh: no {missing[0]}; look at the geometry's proportions")
        groups = {name: [(name, tag_of[name])] for name in there if name != "lower"}
        if "lower" in there:
            groups["foundation"].append(("lower", tag_of["lower"]))
        self.bodies = {
            name: self._body(0 if name == "crest" else dim - REGIONS[name], parts)
            for name, parts in groups.items()
        }
        first, section = int(numbers["SEGMENT"][0]), case.section
        self.faces = {}
        for i, side in enumerate(section["seg_side"]):
            ends = section["seg_y0"][i], section["seg_y1"][i]
            upper = section["seg_body"][i] == numbers["UPPER"][0]
            surface = self._body(dim - 1, [(f"face{i}", first + i)])
            self.faces[f"face{i}"] = Face(surface, upper, SIDES[int(side)], min(ends), max(ends))
        self._turn_outwards()
        joint = self.bodies["joint"].element_tags
        if joint.max() >= 1_000_000:  # the keys of the joint's memory in GetDP hold six digits
            raise RunError(
                f"mesh: joint element tag {joint.max()}: must be below 1000000; use a coarser mesh"
            )
        #: wall seconds it took
        self.seconds = time.perf_counter() - start

    def _read(self) -> None:
        """Take the nodes of Gmsh's current mesh."""
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        self.nodes = len(tags)
        self._place = np.zeros(int(tags.max()) + 1, int)
        self._place[tags] = np.arange(len(tags))
        self._coordinates = coordinates.reshape(-1, 3)

    def _body(self, dimension: int, parts: list[tuple[str, int]]) -> Body:
        """Some regions (name, number of the physical group) as one body."""
        blocks, numbers = {}, {}
        for name, group in parts:
            for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, group):
                for kind, elements, nodes in zip(
                    *gmsh.model.mesh.getElements(dimension, entity), strict=True
                ):
                    block = nodes.reshape(len(elements), -1)
                    blocks.setdefault((name, kind), []).append(block)
                    numbers.setdefault((name, kind), []).append(elements)
        if not blocks:
            raise RunError(f"mesh: nothing in {parts[0][0]}; look at the geometry's proportions")
        flat = np.concatenate([b.ravel() for block in blocks.values() for b in block])
        used, cells = np.unique(flat, return_inverse=True)
        shapes, start = [], 0
        for (_, kind), block in blocks.items():
            table = np.vstack(block)
            shapes.append((SHAPES[kind], cells[start : start + table.size].reshape(table.shape)))
            start += table.size
        return Body(
            self._coordinates[self._place[used]],
            used,
            shapes,
            np.concatenate([t for n in numbers.values() for t in n]),
            [name for name, _ in blocks],
        )

    def _turn_outwards(self) -> None:
        """Give joint and faces their normals: the joint's from foundation to dam, a face's out of
        its body.
        """
        surfaces = {True: [], False: [self.bodies["joint"]]}
        for face in self.faces.values():
            surfaces[face.upper].append(face.surface)
        for upper, some in surfaces.items():
            body = self.bodies["dam" if upper else "foundation"]
            for surface in some:
                surface.normals = outward(surface, body)

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


def outward(surface: Body, body: Body) -> np.ndarray:
    """Unit normals (elements, 3) of a surface, out of the body whose skin it is a part of."""
    # the body's cells that hold all nodes of an element
    size = int(max(surface.node_tags.max(), body.node_tags.max())) + 1
    rows = [incidence(b, size) for b in (surface, body)]
    shared = (rows[0] @ rows[1].T).tocoo()
    corners = np.concatenate([np.full(len(t), t.shape[1]) for _, t in surface.cells])
    whole = shared.data == corners[shared.row]
    inside = np.full(len(corners), -1)
    inside[shared.row[whole]] = shared.col[whole]
    middles = surface.middles()
    normals = []
    for _, table in surface.cells:
        edges = surface.points[table[:, 1:3]] - surface.points[table[:, :1]]
        if table.shape[1] == 2:  # a line in the plane
            across = np.column_stack([edges[:, 0, 1], -edges[:, 0, 0], np.zeros(len(table))])
        else:
            across = np.cross(edges[:, 0], edges[:, 1])
        normals.append(across / np.linalg.norm(across, axis=1)[:, None])
    normals = np.concatenate(normals)
    inwards = np.einsum("ij,ij->i", normals, middles - body.middles()[inside]) < 0
    normals[inwards] *= -1
    # no digits that only the mesh generator has made: a level joint's normal is (0, 1, 0)
    return np.round(normals, 12) + 0.0


def incidence(body: Body, size: int) -> sparse.csr_matrix:
    """Which of the mesh's nodes each element has (elements, size)."""
    columns = np.concatenate([body.node_tags[table].ravel() for _, table in body.cells])
    widths = np.concatenate([np.full(len(t), t.shape[1]) for _, t in body.cells])
    pointers = np.concatenate([[0], np.cumsum(widths)])
    return sparse.csr_matrix((np.ones(len(columns)), columns, pointers), (len(widths), size))
