"""The mesh of a section as a mesh file of a user geometry; moved, mirrored, renumbered."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from damjoint.input.case import Case
from damjoint.mesh.body import Body
from damjoint.mesh.mesh import Mesh
from damjoint.mesh.regions import SHAPES, USER_FACES, USER_NAMES, dimension

KINDS = {shape: kind for kind, shape in SHAPES.items()}


class InOrder:
    """Numbers from 1, in the order of the mesh."""

    first = apart = 1

    def order(self, number: int) -> np.ndarray:
        """Order of a number of items."""
        return np.arange(number)

    def tags(self, number: int) -> np.ndarray:
        """Tags of a number of items."""
        return self.first + self.apart * self.order(number)

    def corners(self, nodes: np.ndarray) -> np.ndarray:
        """Corners of an element, from any of them on, in either direction."""
        return nodes


@dataclass
class Shuffled(InOrder):
    """Tags from `first` on with gaps, and all items in random order."""

    seed: int
    first: int
    apart: int

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)

    def order(self, number: int) -> np.ndarray:
        return self.rng.permutation(number)

    def corners(self, nodes: np.ndarray) -> np.ndarray:
        return np.roll(nodes, self.rng.integers(3))[:: self.rng.choice([1, -1])]


@dataclass(frozen=True)
class OwnMesh:
    """Points (n, 3); regions by name: dimension, elements as Gmsh's type and rows of points."""

    points: np.ndarray
    regions: dict[str, tuple[int, list[tuple[int, np.ndarray]]]]

    @staticmethod
    def of(case: Case) -> OwnMesh:
        """Mesh of a section without a lift joint."""
        mesh, dim = Mesh(case), int(case["dim"])
        dam, foundation = mesh.bodies["dam"], mesh.bodies["foundation"]
        tags, first = np.unique(
            np.concatenate([dam.node_tags, foundation.node_tags]), return_index=True
        )

        def cells(body: Body) -> list[tuple[int, np.ndarray]]:
            rows = np.searchsorted(tags, body.node_tags)
            return [(KINDS[shape], rows[table]) for shape, table in body.cells]

        own = {region: name for name, region in USER_NAMES.items()}
        regions = {own[n]: (dimension(n, dim), cells(b)) for n, b in mesh.bodies.items()}
        own = {what: name for name, what in USER_FACES.items()}
        for face in mesh.faces.values():  # straight ones; one region for all of a side
            _, before = regions.get(own[face.body, face.side], (0, []))
            regions[own[face.body, face.side]] = dim - 1, before + cells(face.surface)
        return OwnMesh(np.concatenate([dam.points, foundation.points])[first], regions)

    def moved(self, by: tuple[float, float, float], mirrored: str = "") -> OwnMesh:
        """Mirror at x, y or z = 0, then move by a vector [m]."""
        signs = [-1.0 if axis == mirrored else 1.0 for axis in "xyz"]
        return replace(self, points=self.points * signs + by)

    def write(self, path: Path, numbering: InOrder | None = None) -> None:
        """Write as MSH 2.2; numbering: of nodes, elements and regions (other than InOrder:
        simplices only).
        """
        n = numbering or InOrder()
        names, nodes = list(self.regions), n.tags(len(self.points))
        groups = dict(zip(names, n.tags(len(names)), strict=True))
        elements = [
            [kind, 2, groups[name], groups[name], *n.corners(nodes[corners])]
            for name, (_, blocks) in self.regions.items()
            for kind, table in blocks
            for corners in table
        ]
        tags = n.tags(len(elements))
        sections = {
            "PhysicalNames": [[self.regions[name][0], groups[name], f'"{name}"'] for name in names],
            "Nodes": [[t, *p] for t, p in zip(nodes, self.points.tolist(), strict=True)],
            "Elements": [[t, *e] for t, e in zip(tags, elements, strict=True)],
        }
        lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat"]
        for title, rows in sections.items():
            entries = [" ".join(map(str, rows[i])) for i in n.order(len(rows))]
            lines += [f"${title}", str(len(rows)), *entries, f"$End{title}"]
        path.write_text("\n".join([*lines, ""]))
