"""The bodies of a run by their mesh, their sides, and finite element functions on sides."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: Corners of the sides of an element by its shape, in the order of Gmsh's nodes.
SIDES: dict[str, list[tuple[int, ...]]] = {
    "triangle": [(0, 1), (1, 2), (2, 0)],
    "quad": [(0, 1), (1, 2), (2, 3), (3, 0)],
    "tetra": [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)],
    "wedge": [(0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)],
    "hexahedron": [
        *((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4)),
        *((1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
    ],
}
#: Shape of a side by its number of corners.
SHAPES = {2: "line", 3: "triangle", 4: "quad"}
#: Nodes of a wedge in the order of Gmsh, from those of VTK.
FROM_VTK_WEDGE = [0, 2, 1, 3, 5, 4]
#: Regions of the lower body (rock, concrete below a lift joint), and distance of the numbers of
#: the regions of two joints.
ROCK, LOWER, LAYER = 2, 11, 1000
#: Distance within which points are the same, over the size of the body.
SAME = 1e-8


# -- functions on sides
# --------------------------------------------------------------------------------------------------

#: Reference coordinates of corners and, of order 2, of the middles of edges and of a quadrangle.
REFERENCE_POINTS: dict[str, list[tuple[float, ...]]] = {
    "line": [(-1,), (1,), (0,)],
    "triangle": [(0, 0), (1, 0), (0, 1), (0.5, 0), (0.5, 0.5), (0, 0.5)],
    "quad": [(-1, -1), (1, -1), (1, 1), (-1, 1), (0, -1), (1, 0), (0, 1), (-1, 0), (0, 0)],
}
CORNERS = {"line": 2, "triangle": 3, "quad": 4}


@cache
def reference_points(shape: str, order: int) -> Array:
    """Reference coordinates of the functions of a side (n, d)."""
    number = CORNERS[shape] if order == 1 else None
    return np.array(REFERENCE_POINTS[shape][:number], float)


def monomials(shape: str, order: int, u: Array) -> Array:
    """The monomials that span the functions, at reference points u (q, d)."""
    exponents = [
        powers
        for powers in product(range(order + 1), repeat=u.shape[1])
        if shape != "triangle" or sum(powers) <= order
    ]
    return np.stack([np.prod(u**powers, axis=1) for powers in exponents], axis=1)


@cache
def _coefficients(shape: str, order: int) -> Array:
    return np.asarray(np.linalg.inv(monomials(shape, order, reference_points(shape, order))), float)


def functions(shape: str, order: int, u: Array) -> Array:
    """Lagrange's functions (q, n) of a side at reference points u (q, d)."""
    return monomials(shape, order, u) @ _coefficients(shape, order)


_A, _B = 0.091576213509770743, 0.44594849091596489
_TRIANGLE_6 = [
    *((_A, _A), (1 - 2 * _A, _A), (_A, 1 - 2 * _A)),
    *((_B, _B), (1 - 2 * _B, _B), (_B, 1 - 2 * _B)),
]


@cache
def rule(shape: str) -> tuple[Array, Array]:
    """Quadrature of loads on a side: 4 points on a line, 6 on a triangle, 4 x 4 on a quadrangle;
    reference points (q, d) and weights (q,).
    """
    if shape == "triangle":
        weights = [0.054975871827660933] * 3 + [0.11169079483900573] * 3
        return np.array(_TRIANGLE_6), np.array(weights)
    x, w = np.polynomial.legendre.leggauss(4)
    if shape == "line":
        return x[:, None], w
    return np.array(list(product(x, x))), np.outer(w, w).ravel()


@dataclass(frozen=True)
class Points:
    """Points on sides: positions (q, 3), weights (q,), the side of each, functions (q, n)."""

    positions: Array
    weights: Array
    sides: IntArray
    functions: Array


@dataclass(frozen=True)
class Sides:
    """Sides of one shape: positions of their corners (m, c, 3)."""

    shape: str
    corners: Array
    order: int

    @cached_property
    def coordinates(self) -> Array:
        """Places of the functions (m, n, 3)."""
        at = functions(self.shape, 1, reference_points(self.shape, self.order))
        return np.asarray(np.einsum("nc,mcx->mnx", at, self.corners))

    @cached_property
    def slopes(self) -> Array:
        """Derivatives of the position with the reference coordinates at the first corner, and of a
        quadrangle those of a parallelogram (m, d, 3).
        """
        c = self.corners
        if self.shape == "line":
            return np.asarray((c[:, 1:] - c[:, :1]) / 2)
        if self.shape == "triangle":
            return np.asarray(c[:, 1:] - c[:, :1])
        return np.stack([(c[:, 1] - c[:, 0]) / 2, (c[:, 3] - c[:, 0]) / 2], axis=1)

    @cached_property
    def measures(self) -> Array:
        """Length or area of a side over that of its reference element (m,)."""
        gram = self.slopes @ self.slopes.transpose(0, 2, 1)
        return np.asarray(np.sqrt(np.linalg.det(gram)), float)

    def points(self) -> Points:
        """Points of the quadrature of loads on all sides."""
        u, w = rule(self.shape)
        number = len(self.corners)
        at = functions(self.shape, 1, u)
        return Points(
            np.einsum("qc,mcx->mqx", at, self.corners).reshape(-1, 3),
            np.outer(self.measures, w).ravel(),
            np.repeat(np.arange(number), len(u)),
            np.tile(functions(self.shape, self.order, u), (number, 1)),
        )

    def at(self, positions: Array, weights: Array) -> Points:
        """Points at positions (q, 3) with weights (q,), each in the side that it lies in."""
        inverse = np.linalg.pinv(self.slopes)  # (m, 3, d)
        origin = reference_points(self.shape, 1)[0]
        sides, u = np.empty(len(positions), int), np.empty((len(positions), len(origin)))
        tree = cKDTree(self.corners.mean(axis=1))
        reach = np.linalg.norm(self.corners - self.corners.mean(axis=1)[:, None], axis=2).max()
        for k, near in enumerate(tree.query_ball_point(positions, 1.001 * reach)):
            candidates = np.array(near, int)
            away = positions[k] - self.corners[candidates, 0]
            local = origin + np.einsum("mx,mxd->md", away, inverse[candidates])
            low = local if self.shape == "triangle" else local + 1
            high = 1 - local.sum(axis=1) if self.shape == "triangle" else (1 - local).min(axis=1)
            best = int(np.argmax(np.minimum(low.min(axis=1), high)))
            sides[k], u[k] = candidates[best], local[best]
        return Points(positions, weights, sides, functions(self.shape, self.order, u))


# -- bodies
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Solid:
    """A body: nodes (n, 3), elements and their region by shape."""

    points: Array
    cells: tuple[tuple[str, IntArray, int], ...]

    @cached_property
    def size(self) -> float:
        """Largest extent [m]."""
        return float(np.ptp(self.points, axis=0).max())

    @cached_property
    def surface(self) -> list[IntArray]:
        """Nodes of the sides on its surface, by number of corners."""
        by_number: dict[int, list[IntArray]] = {}
        for shape, table, _ in self.cells:
            for side in SIDES[shape]:
                by_number.setdefault(len(side), []).append(table[:, side])
        found = []
        for tables in by_number.values():
            table = np.concatenate(tables)
            _, first, count = np.unique(
                np.sort(table, axis=1), axis=0, return_index=True, return_counts=True
            )
            found.append(table[first[count == 1]])
        return found

    def sides_where(self, on: Callable[[Array], NDArray[np.bool_]], order: int) -> list[Sides]:
        """Sides on the surface whose corners all satisfy a condition on positions (n, 3)."""
        inside = on(self.points)
        chosen = [table[inside[table].all(axis=1)] for table in self.surface]
        return [Sides(SHAPES[t.shape[1]], self.points[t], order) for t in chosen if len(t)]


def body_name(region: int) -> str:
    """Name of the body that a region of the mesh is a part of."""
    kind, joint = region % LAYER, region // LAYER
    if kind in (ROCK, LOWER):
        return "foundation"
    return f"dam {joint + 1}" if joint else "dam"


#: Corners of a cell.
NUMBER_OF_CORNERS = {"line": 2, "triangle": 3, "quad": 4, "tetra": 4, "wedge": 6, "hexahedron": 8}


def corners_of(block: Any) -> tuple[str, IntArray]:
    """Shape and corners of the cells of a block, which may have midpoints: triangle6, ..."""
    shape = block.type.rstrip("0123456789")
    return shape, block.data[:, : NUMBER_OF_CORNERS[shape]]


def read_solids(folder: Path) -> dict[str, Solid]:
    """Read the bodies of a folder fields/ by name, from the files of one time."""
    end = next(folder.glob("foundation_t*.vtu")).name.removeprefix("foundation")
    solids = {}
    for path in (p for part in ("foundation", "dam", "dam_*") for p in folder.glob(part + end)):
        mesh: Any = meshio.read(path)
        cells: list[tuple[str, IntArray, int]] = []
        for block, regions in zip(mesh.cells, mesh.cell_data["body"], strict=True):
            shape, table = corners_of(block)
            if shape == "wedge":
                table = table[:, FROM_VTK_WEDGE]
            cells += [(shape, table[regions == r], r) for r in np.unique(regions).tolist()]
        used, numbers = np.unique(
            np.concatenate([t.ravel() for _, t, _ in cells]), return_inverse=True
        )
        ends = np.cumsum([t.size for _, t, _ in cells])[:-1]
        tables = zip(cells, np.split(numbers.ravel(), ends), strict=True)
        solids[body_name(cells[0][2])] = Solid(
            mesh.points[used], tuple((s, new.reshape(t.shape), r) for (s, t, r), new in tables)
        )
    return solids


def on_segment(
    start: Sequence[float], end: Sequence[float], tolerance: float
) -> Callable[[Array], NDArray[np.bool_]]:
    """Return the condition that a point lies on a straight segment in the plane of x and y, or on
    the surface that extends it along z.
    """
    (x0, y0), (x1, y1) = start, end
    length = math.hypot(x1 - x0, y1 - y0)
    along = np.array([x1 - x0, y1 - y0]) / length

    def on(points: Array) -> NDArray[np.bool_]:
        away = points[:, :2] - [x0, y0]
        s = away @ along
        distance = np.abs(away @ [-along[1], along[0]])
        return np.asarray((distance < tolerance) & (s > -tolerance) & (s < length + tolerance))

    return on
