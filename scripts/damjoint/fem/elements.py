"""Finite elements of the condensed engine: shape functions, quadrature, interpolation on a body.

The same spaces as pro/spaces.pro: nodal functions N_a of order 1; order 2 adds the products
N_a N_b, on the same straight mesh. The quadrature rules are those of pro/spaces.pro, so that both
engines solve one discrete problem. Wedges and hexahedra are of the condensed engine only.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import combinations, product

import numpy as np

from ..arrays import Array, IntArray, determinant
from ..csr import CsrMatrix, stacked
from ..mesh.body import Body

#: Corners of the reference elements, by node number.
CORNERS: dict[str, list[tuple[float, ...]]] = {
    "vertex": [()],
    "line": [(-1,), (1,)],
    "triangle": [(0, 0), (1, 0), (0, 1)],
    "quad": [(-1, -1), (1, -1), (1, 1), (-1, 1)],
    "tetra": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)],
}
CORNERS["wedge"] = [(*c, w) for w in (-1, 1) for c in CORNERS["triangle"]]
CORNERS["hexahedron"] = [(*c, w) for w in (-1, 1) for c in CORNERS["quad"]]


@cache
def corners_of(shape: str) -> Array:
    """Corners of a reference element (n, d)."""
    return np.array(CORNERS[shape], float)


@cache
def pairs_of(shape: str) -> IntArray:
    """Pairs of nodes whose products N_a N_b are the functions that order 2 adds to an element,
    (n, k, 2): k pairs with the same product; fewer are repeated.

    Pairs with the same midpoint have the same product: the ends of an edge; both diagonals of a
    quadrangular face; the four diagonals of a hexahedron. The functions span all products of
    quadratic ones of the coordinates: on simplices the full quadratic space, on other elements one
    that contains it.
    """
    corners = corners_of(shape)
    by_midpoint: dict[tuple[float, ...], list[tuple[int, int]]] = {}
    for a, b in combinations(range(len(corners)), 2):
        by_midpoint.setdefault(tuple(corners[a] + corners[b]), []).append((a, b))
    most = max(map(len, by_midpoint.values()), default=1)
    repeated = [(pairs * most)[:most] for pairs in by_midpoint.values()]
    return np.array(repeated, int).reshape(-1, most, 2)


@cache
def function_locations(shape: str, order: int) -> Array:
    """Location of each function of an order, (n, d): the nodes, then the midpoints of pairs."""
    corners = corners_of(shape)
    middles = corners[pairs_of(shape)[:, 0]].mean(axis=1)
    return np.concatenate([corners, middles]) if order == 2 else corners


def nodal(shape: str, u: Array) -> tuple[Array, Array]:
    """Nodal functions (n,) and their reference gradients (n, d) at a reference point u (d,)."""
    if shape in ("vertex", "triangle", "tetra"):
        d = len(u)
        return np.array([1 - u.sum(), *u]), np.vstack([-np.ones(d), np.eye(d)])
    if shape == "wedge":
        flat, flat_gradient = nodal("triangle", u[:2])
        low, high = (1 - u[2]) / 2, (1 + u[2]) / 2
        values = np.concatenate([flat * low, flat * high])
        up = np.concatenate([-flat, flat]) / 2
        return values, np.column_stack([np.vstack([flat_gradient * low, flat_gradient * high]), up])
    corners = corners_of(shape)
    factors = (1 + corners * u) / 2
    gradient = np.empty_like(corners)
    for i in range(len(u)):
        gradient[:, i] = corners[:, i] / 2 * np.prod(np.delete(factors, i, axis=1), axis=1)
    return factors.prod(axis=1), gradient


def basis(shape: str, order: int, u: Array | tuple[float, ...]) -> tuple[Array, Array]:
    """All functions (n,) of an order and their gradients (n, d) at a reference point u (d,)."""
    n, dn = nodal(shape, np.asarray(u, float))
    if order == 1:
        return n, dn
    a, b = pairs_of(shape)[:, 0].T
    return np.concatenate([n, n[a] * n[b]]), np.vstack(
        [dn, n[a, None] * dn[b] + n[b, None] * dn[a]]
    )


# Triangle rules with 1, 3, 6 and 7 points (degrees 1, 2, 4, 5): Strang and Fix, Dunavant
_A6, _B6, _A7, _B7 = 0.091576213509771, 0.445948490915965, 0.101286507323456, 0.470142064105115
TRIANGLE: dict[int, tuple[list[tuple[float, ...]], list[float]]] = {
    1: ([(1 / 3, 1 / 3)], [0.5]),
    3: ([(1 / 6, 1 / 6), (2 / 3, 1 / 6), (1 / 6, 2 / 3)], [1 / 6] * 3),
    6: (
        [
            (1 - 2 * _A6, _A6),
            (_A6, 1 - 2 * _A6),
            (_A6, _A6),
            (1 - 2 * _B6, _B6),
            (_B6, 1 - 2 * _B6),
            (_B6, _B6),
        ],
        [0.054975871827661] * 3 + [0.111690794839005] * 3,
    ),
    7: (
        [
            (1 / 3, 1 / 3),
            (1 - 2 * _A7, _A7),
            (_A7, 1 - 2 * _A7),
            (_A7, _A7),
            (1 - 2 * _B7, _B7),
            (_B7, 1 - 2 * _B7),
            (_B7, _B7),
        ],
        [0.1125] + [0.0629695902724135] * 3 + [0.066197076394253] * 3,
    ),
}
# Tetrahedron with 4 points (degree 2)
_A4, _B4 = 0.1381966011250105, 0.5854101966249685


@cache
def tensor(n: int, d: int) -> tuple[Array, Array]:
    """Gauss points (n^d, d) and weights on [-1, 1]^d."""
    x, w = np.polynomial.legendre.leggauss(n)
    return np.array(list(product(x, repeat=d))), np.array(
        [np.prod(v) for v in product(w, repeat=d)]
    )


def collapsed(n: int) -> tuple[Array, Array]:
    """Quadrature of a tetrahedron: n^3 points of a cube collapsed onto it, of degree 2 n - 3."""
    cube, weights = tensor(n, 3)
    u, v, w = ((cube + 1) / 2).T
    x = np.column_stack([u, v * (1 - u), w * (1 - u) * (1 - v)])
    return x, weights / 8 * (1 - u) ** 2 * (1 - v)


def rule(shape: str, points: int) -> tuple[Array, Array]:
    """Quadrature with a number of points on a reference element: points (n, d), weights (n,)."""
    if shape == "vertex":
        return np.zeros((1, 0)), np.ones(1)
    if shape == "line":
        return tensor(points, 1)
    if shape == "triangle":
        x, w = TRIANGLE[points]
    elif shape == "quad":
        return tensor(round(points**0.5), 2)
    elif shape == "tetra":
        if points > 4:
            return collapsed(round(points ** (1 / 3)))
        x, w = (
            ([(0.25,) * 3], [1 / 6])
            if points == 1
            else ([(_A4,) * 3, (_B4, _A4, _A4), (_A4, _B4, _A4), (_A4, _A4, _B4)], [1 / 24] * 4)
        )
    elif shape == "wedge":
        (flat, fw), (up, uw) = (
            rule("triangle", {6: 3, 21: 7}[points]),
            tensor({6: 2, 21: 3}[points], 1),
        )
        x, w = [(*f, *h) for h in up for f in flat], [a * b for b in uw for a in fw]
    else:
        return tensor(round(points ** (1 / 3)), 3)
    return np.array(x, float), np.array(w, float)


@cache
def to_corners(shape: str, points: int) -> Array:
    """Values at the corners (n, q) from values at the points of a rule, by the combination of nodal
    functions nearest to them (least squares); from one point a constant.
    """
    x, weights = rule(shape, points)
    root = np.sqrt(weights)
    functions = np.array([nodal(shape, u)[0] for u in x])
    return np.asarray(np.linalg.pinv(root[:, None] * functions) * root)


#: Number of quadrature points in a body, by order and shape.
BULK = {
    1: {"triangle": 1, "quad": 4, "tetra": 1, "wedge": 6, "hexahedron": 8},
    2: {"triangle": 3, "quad": 9, "tetra": 4, "wedge": 21, "hexahedron": 27},
}
#: For the mass: products of two functions are exact on elements with parallel sides.
MASS = {
    1: {"triangle": 3, "quad": 4, "tetra": 4, "wedge": 6, "hexahedron": 8},
    2: {"triangle": 6, "quad": 9, "tetra": 64, "wedge": 21, "hexahedron": 27},
}
#: In the joint, by parameter `quadrature`, order and shape. Published quadrangles of order 2 have 3
#: x 3 points; 2 x 2 are used instead, so that layers repeat the plane scene.
JOINT = {
    "full": {1: {"line": 2, "triangle": 3, "quad": 4}, 2: {"line": 3, "triangle": 6, "quad": 9}},
    "published": {
        1: {"line": 2, "triangle": 1, "quad": 4},
        2: {"line": 2, "triangle": 6, "quad": 4},
    },
}
#: For water pressure and other loads on surfaces and lines.
WATER = {"vertex": 1, "line": 4, "triangle": 6, "quad": 16}
#: On wet faces, by parameter `face_points`; as on a side of a triangle, the rule of like degree.
SIDE_POINTS = {2: {"line": 2, "triangle": 3, "quad": 4}, 4: {"line": 4, "triangle": 6, "quad": 16}}


@cache
def tabulated(shape: str, order: int, points: int) -> tuple[Array, Array, Array, Array]:
    """At the points of a rule: functions (q, n), reference gradients (q, n, d), nodal gradients (q,
    m, d), weights (q,).
    """
    x, w = rule(shape, points)
    values, gradients = zip(*(basis(shape, order, u) for u in x), strict=True)
    return np.array(values), np.array(gradients), np.array([nodal(shape, u)[1] for u in x]), w


class Space:
    """Scalar functions of an order on a region: nodal ones, then (order 2) products of two.

    locations: (n, 3) of each function: the node, or the midpoint of the edge, face or element.
    """

    def __init__(self, body: Body, order: int) -> None:
        self.body, self.order = body, order
        #: functions of each element, by shape: (elements, functions)
        self.connectivity: list[tuple[str, IntArray]] = body.cells
        self.locations = body.points
        #: a number for each product, equal on a region and on its parts, sorted
        self.codes = np.zeros(0, np.int64)
        if order == 2:
            pairs = [cells[:, pairs_of(shape)] for shape, cells in body.cells]
            codes = np.concatenate([edge_codes(body.node_tags[p]).ravel() for p in pairs])
            middles = [body.points[p].mean(axis=(2, 3)).reshape(-1, 3) for p in pairs]
            self.codes, first, inverse = np.unique(codes, return_index=True, return_inverse=True)
            self.locations = np.vstack([body.points, np.concatenate(middles)[first]])
            cuts = np.cumsum([m.size // 3 for m in middles])[:-1]
            products = np.split(len(body.points) + inverse, cuts)
            self.connectivity = [
                (shape, np.hstack([cells, numbers.reshape(p.shape[:2])]))
                for (shape, cells), p, numbers in zip(body.cells, pairs, products, strict=True)
            ]

    def find(self, part: Space) -> IntArray:
        """Functions of this space that are those of a part: a face, an edge, the joint.

        Raises KeyError if a node of the part is not in this space.
        """
        index = {t: i for i, t in enumerate(self.body.node_tags)}
        nodes = np.array([index[t] for t in part.body.node_tags], int)
        products = np.searchsorted(self.codes, part.codes)
        return np.concatenate([nodes, len(self.body.points) + products])

    def at_locations(self, u: Array) -> Array:
        """Displacement (..., locations, 3) at the locations, from factors (..., n, dim)."""
        matrix = self.interpolation(self.order)
        rows = u.reshape(-1, *u.shape[-2:])
        values = np.array([matrix @ row for row in rows]).reshape(u.shape)
        return np.pad(values, [(0, 0)] * (u.ndim - 1) + [(0, 3 - u.shape[-1])])

    def interpolation(self, order: int) -> CsrMatrix:
        """Values at the locations, from the functions up to an order (locations, functions)."""
        rows, matrices = [], []
        for shape, table in self.connectivity:
            local = [basis(shape, order, u)[0] for u in function_locations(shape, self.order)]
            columns = np.repeat(table[:, : len(local[0])], len(local), axis=0)
            pointers = columns.shape[1] * np.arange(len(columns) + 1)
            data = np.tile(np.ravel(local), len(table))
            size = len(columns), len(self.locations) if order == 2 else len(self.body.points)
            matrices.append(CsrMatrix(data, columns.ravel(), pointers, size))
            rows.append(table.ravel())
        _, first = np.unique(np.concatenate(rows), return_index=True)
        values = stacked(matrices)[first]
        return values.where(values.data != 0)


def edge_codes(pairs: IntArray) -> IntArray:
    """Number of each product (..., n), from the node tags of its pairs (..., n, k, 2): equal in all
    elements that share the edge or face.
    """
    ends = np.sort(pairs.astype(np.int64), axis=-1)
    return np.asarray((ends[..., 0] << 32 | ends[..., 1]).min(axis=-1))


def geometry(points: Array, cells: IntArray, dn: Array) -> tuple[Array, Array]:
    """Jacobian determinant of each element (e,) and the map from reference to real gradients
    (e, d, D).

    points (n, D); dn: (m, d) nodal gradients at one point. For d < D the pseudo-inverse of the
    Jacobian: gradients along the element.
    """
    jacobian = np.einsum("md,eml->edl", dn, points[cells])
    metric = jacobian @ jacobian.transpose(0, 2, 1)
    return np.sqrt(determinant(metric)), np.linalg.solve(metric, jacobian)


@dataclass(frozen=True, kw_only=True)
class Points:
    """Quadrature points of a space: weights (q,), positions (q, 3), functions, gradients."""

    weights: Array
    positions: Array
    #: (q, functions)
    values: CsrMatrix
    #: (q, functions) for x, y and z; empty if not wanted
    gradients: tuple[CsrMatrix, ...]
    #: element of each point
    elements: IntArray


def points_of(space: Space, numbers: dict[str, int], gradients: bool = False) -> Points:
    """Quadrature points of rules with these numbers of points by shape, element by element."""
    weights, positions, tables, coefficients, slopes, elements, start = [], [], [], [], [], [], 0
    for shape, table in space.connectivity:
        values, dg, dn, w = tabulated(shape, space.order, numbers[shape])
        cells = table[:, : dn.shape[1]]
        e, q, n = len(table), len(w), table.shape[1]
        measure, inverse = zip(*(geometry(space.body.points, cells, d) for d in dn), strict=True)
        weights.append((np.array(measure) * w[:, None]).T.ravel())
        positions.append(
            np.einsum("qm,eml->eql", values[:, : dn.shape[1]], space.body.points[cells]).reshape(
                -1, 3
            )
        )
        tables.append(np.repeat(table, q, axis=0).ravel())
        coefficients.append(np.broadcast_to(values, (e, q, n)).ravel())
        slopes.append(
            np.einsum("qnd,qedl->eqnl", dg, np.array(inverse)).reshape(-1, 3)
            if gradients
            else np.zeros((0, 3))
        )
        elements.append(start + np.repeat(np.arange(e), q))
        start += e
    widths = np.concatenate(
        [np.full(len(t) * numbers[s], t.shape[1]) for s, t in space.connectivity]
    )
    pointers = np.concatenate([[0], np.cumsum(widths)])
    size = (len(widths), len(space.locations))

    def build(data: Array) -> CsrMatrix:
        return CsrMatrix(data, np.concatenate(tables), pointers, size)

    slope = np.concatenate(slopes)
    return Points(
        weights=np.concatenate(weights),
        positions=np.concatenate(positions),
        values=build(np.concatenate(coefficients)),
        gradients=tuple(build(slope[:, i]) for i in range(3)) if gradients else (),
        elements=np.concatenate(elements),
    )
