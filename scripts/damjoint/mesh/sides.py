"""Which elements of a body have the elements of a surface as sides; normals out of it, its area."""

from __future__ import annotations

import numpy as np

from ..arrays import Array, BoolArray, IntArray
from ..csr import CsrMatrix
from .body import Body


def area(surface: Body) -> float:
    """Area of a surface, length of a line [m2, m]."""
    total = 0.0
    for _, table in surface.cells:
        edges = surface.points[table[:, 1:]] - surface.points[table[:, :1]]
        if table.shape[1] == 2:
            total += np.linalg.norm(edges[:, 0], axis=1).sum()
        for i in range(edges.shape[1] - 1):
            total += np.linalg.norm(np.cross(edges[:, i], edges[:, i + 1]), axis=1).sum() / 2
    return float(total)


def outward(surface: Body, body: Body) -> tuple[Array, BoolArray] | None:
    """Unit normals (elements, 3) of a part of a body's surface, out of the body, and which elements
    are numbered the other way round; None if not all are sides of the body's elements.
    """
    inside = cells_inside(surface, body)
    if (inside < 0).any():
        return None
    normals = surface.unit_normals()
    from_body = surface.middles() - body.middles()[inside]
    inwards = np.einsum("ij,ij->i", normals, from_body) < 0
    normals[inwards] *= -1
    # without the mesh generator's rounding: a level joint's normal is (0, 1, 0)
    return np.round(normals, 12) + 0.0, inwards


def is_inside(surface: Body, body: Body) -> bool:
    """Whether each element of a surface is a side of two elements of a body."""
    size = int(max(surface.node_tags.max(), body.node_tags.max())) + 1
    shared = incidence(surface, size) @ incidence(body, size).T
    corners = np.concatenate([np.full(len(t), t.shape[1]) for _, t in surface.cells])
    beside = np.bincount(shared.rows[shared.data == corners[shared.rows]])
    return len(beside) == len(corners) and bool((beside == 2).all())


def cells_inside(surface: Body, body: Body) -> IntArray:
    """For each element of a surface, the body's cell that has all its nodes; -1: none."""
    size = int(max(surface.node_tags.max(), body.node_tags.max())) + 1
    rows = [incidence(b, size) for b in (surface, body)]
    shared = rows[0] @ rows[1].T
    corners = np.concatenate([np.full(len(t), t.shape[1]) for _, t in surface.cells])
    is_side = shared.data == corners[shared.rows]
    inside = np.full(len(corners), -1)
    inside[shared.rows[is_side]] = shared.indices[is_side]
    return inside


def sides(surface: Body, body: Body) -> BoolArray:
    """Which elements of a surface are sides of the body's elements."""
    return np.asarray(cells_inside(surface, body) >= 0)


def selected_part(surface: Body, selected: BoolArray) -> Body:
    """Some elements of a surface."""
    ends = np.cumsum([len(table) for _, table in surface.cells])[:-1]
    chosen = np.split(selected, ends)
    cells = [
        (shape, table[part]) for (shape, table), part in zip(surface.cells, chosen, strict=True)
    ]
    used = np.unique(np.concatenate([table.ravel() for _, table in cells]))
    return Body(
        surface.points[used],
        surface.node_tags[used],
        [(shape, np.searchsorted(used, table)) for shape, table in cells if len(table)],
        surface.element_tags[selected],
        [r for r, (_, table) in zip(surface.regions, cells, strict=True) if len(table)],
    )


def incidence(body: Body, size: int) -> CsrMatrix:
    """Which of the mesh's nodes each element has (elements, size)."""
    columns = np.concatenate([body.node_tags[table].ravel() for _, table in body.cells]).astype(int)
    widths = np.concatenate([np.full(len(t), t.shape[1]) for _, t in body.cells])
    pointers = np.concatenate([[0], np.cumsum(widths)])
    return CsrMatrix(np.ones(len(columns)), columns, pointers, (len(widths), size))
