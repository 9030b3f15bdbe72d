"""Wet faces: forces of the pressure on them, exact in spite of the kink at a waterline.

On a straight face the quadrature is corrected by a factor a + b (y - low) that makes resultant and
moment exact (as in pro/loads.pro); on any other face the elements that the waterline cuts are
integrated over their wet part only. With a number of Gauss points per element side (parameter
face_points) the pressure is integrated with these alone, as in published tests.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property

import numpy as np

from .. import ROUND_OFF
from ..arrays import Array, IntArray, determinant
from ..csr import CsrMatrix
from ..fem import elements
from ..mesh.joint_mesh import Face

#: Height of pressure [m] for a surface at a level [m], at heights y [m] where the normal's
#: horizontal part has a size (0 to 1); and its column (see model/loads.py) from low to high.
Height = Callable[[float, Array, Array], Array]
Column = Callable[[float, float, float], tuple[float, float]]


class WetFace:
    """A face with its quadrature; forces are (functions * dim,)."""

    def __init__(self, face: Face, order: int, dim: int, side_points: int = 0) -> None:
        self.face, self.side, self.dim = face, face.side, dim
        self.low, self.high, surface = face.low, face.high, face.surface
        self.surface, self.space = surface, elements.Space(surface, order)
        rules = elements.SIDE_POINTS[side_points] if side_points else elements.WATER
        self.points = elements.points_of(self.space, rules)
        self.normals = surface.normals[self.points.elements][:, :dim]
        self.to_functions = self.points.values.T
        self.y, self.tilt = self.points.positions[:, 1], np.abs(self.normals[:, 0])
        self.above = self.y - self.low
        straight, self.exact = self.high > self.low, not side_points
        self.flat = np.ptp(surface.points[:, 1]) < ROUND_OFF * np.abs(surface.points).max()
        #: whether the quadrature is corrected
        self.corrects = self.exact and straight and not self.flat

    @cached_property
    def weights(self) -> Array:
        """Weights times heights above the lowest end to the power of 0, 1 and 2 (3, q)."""
        return np.array([self.points.weights * self.above**k for k in range(3)])

    @cached_property
    def inwards(self) -> Array:
        """Weights of the points along the normals, into the body (q, dim)."""
        return -self.points.weights[:, None] * self.normals

    @cached_property
    def elements(self) -> list[tuple[str, IntArray]]:
        """Shape and functions of each element."""
        return [(shape, row) for shape, table in self.space.connectivity for row in table]

    def pressed(self, pressure: Array) -> Array:
        """Nodal forces of a pressure (q,) [Pa]."""
        return np.ravel(self.to_functions @ (pressure[:, None] * self.inwards))

    def press(self, level: float, height: Height, column: Column) -> Array:
        """Nodal forces [m x area] of a height of pressure on the face."""
        if level <= self.low:
            return np.zeros(self.to_functions.shape[0] * self.dim)
        if self.corrects:
            return self.pressed(self.corrected(level, height, column))
        cut = self.cut_by(level) if self.exact and not self.flat else np.zeros(0, int)
        heights = height(level, self.y, self.tilt)
        if len(cut):
            heights *= ~np.isin(self.points.elements, cut)
        forces = self.pressed(heights)
        for element in cut:
            self.add_wet_part(forces, int(element), level, height)
        return forces

    def corrected(self, level: float, height: Height, column: Column) -> Array:
        """Heights of pressure at the points, times the factor that makes force and moment exact.

        Where too few points are wet to distinguish force and moment, the waterline is raised, for
        the shape of the pressure only.
        """
        stretch = self.points.weights.sum() / (self.high - self.low)
        force, moment = (stretch * part for part in column(level, self.low, self.high))
        moment -= force * self.low
        if force == 0:
            return np.zeros_like(self.y)
        shape_level = level
        while True:
            shape = height(shape_level, self.y, self.tilt)
            m0, m1, m2 = self.weights @ shape
            determinant = m0 * m2 - m1**2
            if determinant > DISTINCT * m1**2 or shape_level > self.high:
                break
            shape_level = max(shape_level, self.low) + RAISE * (self.high - self.low)
        b = (m0 * moment - m1 * force) / determinant
        a = (force - b * m1) / m0
        return np.asarray(shape * (a + b * self.above))

    # -- elements that the waterline cuts

    def cut_by(self, level: float) -> IntArray:
        """Elements that the waterline cuts."""
        heights = [self.surface.points[table][:, :, 1] for _, table in self.surface.cells]
        least, most = (np.concatenate([f(h, axis=1) for h in heights]) for f in (np.min, np.max))
        return np.flatnonzero((least < level) & (level < most))

    def add_wet_part(self, forces: Array, element: int, level: float, height: Height) -> None:
        """Add the forces on an element below the waterline, a straight line on a plane element."""
        shape, functions = self.elements[element]
        nodes = self.surface.points[functions[: len(elements.corners_of(shape))]]
        normal = self.surface.normals[element, : self.dim]
        of_functions = forces.reshape(-1, self.dim)
        for u, position, area in points_below(shape, nodes, nodes[:, 1] - level):
            force = area * height(level, position[1], abs(normal[0]))
            values = elements.basis(shape, self.space.order, u)[0]
            of_functions[functions] -= force * np.outer(values, normal)


#: No functions.
NONE = np.zeros(0, int)

#: Least variance over square of the mean of the heights of the points, (m0 m2 - m1^2)/m1^2 [-];
#: usually 0.1 to 1. Below it force and lever of the water can not be corrected both.
DISTINCT = 1e-3
#: Part of the face's height by which the waterline that weighs the points is raised until they can
#: [-]; usually never, a few times with water at the foot of the face.
RAISE = 0.01


def points_below(shape: str, nodes: Array, height: Array) -> Iterator[tuple[Array, Array, float]]:
    """Quadrature points on the part of an element where a linear field is negative: reference
    coordinates, position (3,), weight.

    nodes (n, 3), height (n,): positions and values of the field at its corners.
    """
    corners = elements.corners_of(shape)
    simplex, points = ("line", 4) if len(corners) == 2 else ("triangle", 6)
    for part in below(corners, height):
        for x, weight in zip(*elements.rule(simplex, points), strict=True):
            u = elements.nodal(simplex, x)[0] @ part
            n, dn = elements.nodal(shape, u)
            jacobian = dn.T @ nodes
            area = measure(part) * weight * np.sqrt(determinant(jacobian @ jacobian.T))
            yield u, n @ nodes, float(area)


def points_where(space: elements.Space, height: Array) -> elements.Points:
    """Quadrature points on the part of a surface where a field of order 1, from its values at the
    nodes, is negative; element by element.
    """
    surface, start = space.body, 0
    rows: list[tuple[Array, IntArray, Array, float, int]] = []
    for shape, table in space.connectivity:
        number = len(elements.corners_of(shape))
        for e, functions in enumerate(table):
            corners = functions[:number]
            if (height[corners] < 0).any():
                points = points_below(shape, surface.points[corners], height[corners])
                rows += [
                    (elements.basis(shape, space.order, u)[0], functions, position, area, start + e)
                    for u, position, area in points
                ]
        start += len(table)
    values, functions, positions, areas, numbers = zip(*rows, strict=True) if rows else ([],) * 5
    pointers = np.cumsum([0, *map(len, values)])
    data = (np.concatenate([[], *values]), np.concatenate([NONE, *functions]), pointers)
    return elements.Points(
        weights=np.array(areas, float),
        positions=np.array(positions, float).reshape(-1, 3),
        values=CsrMatrix(*data, (len(rows), len(space.locations))),
        gradients=(),
        elements=np.array(numbers, int),
    )


def below(corners: Array, height: Array) -> list[Array]:
    """The part of a convex reference element where a linear height is negative, as simplices."""
    polygon, number = [], len(corners)
    closed = number if number > 2 else 1
    for i in range(number):
        if height[i] <= 0:
            polygon.append(corners[i])
        k = (i + 1) % number
        if i < closed and height[i] * height[k] < 0:
            share = height[i] / (height[i] - height[k])
            polygon.append(corners[i] + share * (corners[k] - corners[i]))
    if number == 2:
        return [np.array(polygon)]
    return [np.array([polygon[0], *polygon[i : i + 2]]) for i in range(1, len(polygon) - 1)]


def measure(simplex: Array) -> float:
    """Measure of a simplex in reference coordinates over that of its rule's own simplex."""
    if len(simplex) == 2:
        return float(abs(simplex[1, 0] - simplex[0, 0]) / 2)
    (a, b), (c, d) = simplex[1] - simplex[0], simplex[2] - simplex[0]
    return float(abs(a * d - b * c))
