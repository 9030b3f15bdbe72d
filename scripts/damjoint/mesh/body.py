"""A part of a mesh: points, elements and their normals."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..arrays import Array, IntArray

#: Corners of the sides of a cell, by its shape.
SIDES: dict[str, tuple[list[int], ...]] = {
    "line": ([0], [1]),
    "triangle": ([0, 1], [1, 2], [2, 0]),
    "quad": ([0, 1], [1, 2], [2, 3], [3, 0]),
    "tetra": ([0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]),
    "wedge": ([0, 1, 2], [3, 4, 5], [0, 1, 4, 3], [1, 2, 5, 4], [0, 2, 5, 3]),
    "hexahedron": (
        [0, 1, 2, 3],
        [4, 5, 6, 7],
        [0, 1, 5, 4],
        [1, 2, 6, 5],
        [2, 3, 7, 6],
        [3, 0, 4, 7],
    ),
}


@dataclass
class Body:
    """One or several regions of the mesh: points (n, 3) [m], their node tags (n,), cells by shape
    as indices of points, element tags in that order.
    """

    points: Array
    node_tags: IntArray
    cells: list[tuple[str, IntArray]]
    element_tags: IntArray
    #: the region of each block of cells
    regions: list[str] = field(default_factory=list)
    #: of a surface: unit normals (elements, 3), out of the body it belongs to
    normals: Array = field(default_factory=lambda: np.zeros((0, 3)))

    def middles(self) -> Array:
        """The middle of each element (elements, 3)."""
        return np.concatenate([self.points[table].mean(axis=1) for _, table in self.cells])

    def unit_normals(self) -> Array:
        """Unit normals (elements, 3) of a surface, by the order of its elements' nodes."""
        directions = [np.zeros((0, 3))]
        for _, table in self.cells:
            edges = self.points[table[:, 1:3]] - self.points[table[:, :1]]
            if table.shape[1] == 2:  # a line in the plane
                across = np.column_stack([edges[:, 0, 1], -edges[:, 0, 0], np.zeros(len(table))])
            else:
                across = np.cross(edges[:, 0], edges[:, 1])
            directions.append(across / np.linalg.norm(across, axis=1)[:, None])
        return np.concatenate(directions)
