"""Wet faces: the forces of what presses on them, exact in spite of the kink at a waterline.

On a straight face the quadrature is corrected by a factor a + b (y - low), which gives back the
exact resultant and moment (pro/loads.pro does the same); on any other the elements that the
waterline cuts are integrated over their wet part alone.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from ..fem import elements
from ..model.mesh import SIDES, Body

#: Height of pressure [m] for a surface at a level [m], at heights y [m] where the normal's
#: horizontal part has a size (0 to 1); and its column (see scene/loads.py) from low to high.
Height = Callable[[float, np.ndarray, np.ndarray], np.ndarray]
Column = Callable[[float, float, float], tuple[float, float]]


class WetFace:
    """A face with its quadrature; forces are (functions * dim,)."""

    def __init__(self, surface: Body, kind: np.ndarray, order: int, dim: int) -> None:
        self.side, self.dim = SIDES[int(kind[0])], dim
        self.low, self.high = kind[1:]
        self.surface, self.space = surface, elements.Space(surface, order)
        self.points = elements.points_of(self.space, elements.WATER)
        self.normals = surface.normals[self.points.elements][:, :dim]
        self.y, self.tilt = self.points.positions[:, 1], np.abs(self.normals[:, 0])
        self.straight = self.high > self.low
        self.flat = np.ptp(surface.points[:, 1]) < 1e-9 * np.abs(surface.points).max()

    @cached_property
    def elements(self) -> list[tuple[str, np.ndarray]]:
        """Shape and functions of each element."""
        return [(shape, row) for shape, table in self.space.connectivity for row in table]

    def spread(self, traction: np.ndarray) -> np.ndarray:
        """Forces of a traction (q, dim) [Pa]."""
        return (self.points.values.T @ (self.points.weights[:, None] * traction)).ravel()

    def press(self, level: float, height: Height, column: Column) -> np.ndarray:
        """Forces [m x area] of a height of pressure against the face."""
        if self.flat or not self.straight:
            cut = [] if self.flat else self.cut_by(level)
            outside = ~np.isin(self.points.elements, cut)
            forces = self.spread(
                -(height(level, self.y, self.tilt) * outside)[:, None] * self.normals
            )
            for element in cut:
                self.add_wet_part(forces, element, level, height)
        else:
            forces = self.spread(-self.corrected(level, height, column)[:, None] * self.normals)
        return forces

    def corrected(self, level: float, height: Height, column: Column) -> np.ndarray:
        """Heights of pressure at the points, times the factor that makes force and moment exact.

        Where the waterline leaves not enough points wet to tell force and moment apart, it is
        raised, for the shape of the pressure alone.
        """
        stretch = self.points.weights.sum() / (self.high - self.low)
        force, moment = (stretch * part for part in column(level, self.low, self.high))
        moment -= force * self.low
        y, shape_level = self.y - self.low, level
        if force == 0:
            return np.zeros_like(y)
        while True:
            shape = height(shape_level, self.y, self.tilt)
            m0, m1, m2 = (self.points.weights @ (shape * y**k) for k in range(3))
            determinant = m0 * m2 - m1**2
            if determinant > DISTINCT * m1**2 or shape_level > self.high:
                break
            shape_level = max(shape_level, self.low) + RAISE * (self.high - self.low)
        b = (m0 * moment - m1 * force) / determinant
        a = (force - b * m1) / m0
        return shape * (a + b * y)

    # -- elements that the waterline cuts

    def cut_by(self, level: float) -> np.ndarray:
        """The elements with the waterline inside."""
        heights = [self.surface.points[table][:, :, 1] for _, table in self.surface.cells]
        least, most = (np.concatenate([f(h, axis=1) for h in heights]) for f in (np.min, np.max))
        return np.flatnonzero((least < level) & (level < most))

    def add_wet_part(self, forces: np.ndarray, element: int, level: float, height: Height) -> None:
        """Add what presses on an element below the waterline, a straight line on a flat element."""
        shape, functions = self.elements[element]
        corners = elements.corners_of(shape)
        place = self.surface.points[functions[: len(corners)]]
        normal = self.surface.normals[element, : self.dim]
        of_functions = forces.reshape(-1, self.dim)
        simplex, points = ("line", 4) if len(corners) == 2 else ("triangle", 6)
        for part in below(corners, place[:, 1] - level):
            for x, weight in zip(*elements.rule(simplex, points), strict=True):
                u = elements.nodal(simplex, x)[0] @ part
                n, dn = elements.nodal(shape, u)
                jacobian = dn.T @ place
                area = measure(part) * weight * np.sqrt(np.linalg.det(jacobian @ jacobian.T))
                here = area * height(level, n @ place[:, 1], abs(normal[0]))
                values = elements.basis(shape, self.space.order, u)[0]
                of_functions[functions] -= here * np.outer(values, normal)


#: Moments that tell a force and its lever apart: m0 m2 - m1^2 over m1^2; and by how much of the
#: face's height the waterline is raised until they do.
DISTINCT, RAISE = 1e-3, 0.01


def below(corners: np.ndarray, height: np.ndarray) -> list[np.ndarray]:
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


def measure(simplex: np.ndarray) -> float:
    """Measure of a simplex in reference coordinates over that of its rule's own simplex."""
    if len(simplex) == 2:
        return abs(simplex[1, 0] - simplex[0, 0]) / 2
    (a, b), (c, d) = simplex[1] - simplex[0], simplex[2] - simplex[0]
    return abs(a * d - b * c)
