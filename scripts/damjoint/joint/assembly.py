"""Stiffness of the joints, assembled from the tangents at their Gauss points: the sum of w B^T D B,
with B the interpolation of the jump, D the tangent and w the weight of a point.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..arrays import Array, IntArray
from ..csr import CsrMatrix, ranges

#: Number of terms up to which they are kept: more take longer than a product of sparse matrices.
MOST_TERMS = 500_000


class Assembly:
    """The assembly of the stiffness (j, j) from tangents (q, 3, 3), whatever the bodies around."""

    def __init__(self, at_points: CsrMatrix, weights: Array) -> None:
        """at_points: B of all points (dim * q, j), dim rows for each; weights: (q,)."""
        self.at_points, self.weights = at_points, weights
        self.number, self.size = len(weights), at_points.shape[1]
        self.dim = at_points.shape[0] // self.number

    @cached_property
    def terms(self) -> Terms | None:
        """The terms of the stiffness; None for many points, by products of sparse matrices."""
        few = number_of_terms(self.at_points, self.dim) <= MOST_TERMS
        return Terms(self.at_points, self.weights) if few else None

    def product(self, tangent: Array, points: IntArray) -> CsrMatrix:
        """The stiffness (j, j) of some Gauss points with a tangent (points, 3, 3), by products."""
        number, d = len(points), self.dim
        blocks = self.weights[points, None, None] * tangent[:, :d, :d]
        rows = self.at_points[(d * points[:, None] + np.arange(d)).ravel()]
        columns = np.repeat(np.arange(d * number).reshape(number, d), d, axis=0)
        diagonal = CsrMatrix(
            blocks.ravel(), columns.ravel(), d * np.arange(d * number + 1), (d * number,) * 2
        )
        return rows.T @ (diagonal @ rows)

    def whole(self, tangent: Array) -> CsrMatrix:
        """The stiffness (j, j) of all Gauss points with a tangent (q, 3, 3)."""
        if self.terms:
            return self.terms.matrix(tangent)
        return self.product(tangent, np.arange(self.number))

    def change(self, tangent: Array, before: Array) -> tuple[CsrMatrix, IntArray]:
        """The change from one tangent to another (q, 3, 3), without its zero rows, and the rows."""
        if self.terms:
            matrix = self.terms.matrix(tangent - before)
        else:
            points = np.flatnonzero((tangent != before).any(axis=(1, 2)))
            matrix = self.product(tangent[points] - before[points], points)
        matrix = matrix.where(matrix.data != 0)
        rows = np.flatnonzero(matrix.counts)
        return matrix[rows], rows

    def with_joints(self, stiffness: Array, tangent: Array) -> Array:
        """A stiffness (j, j) with that of all Gauss points."""
        matrix = stiffness.copy()
        if self.terms:
            matrix.ravel()[self.terms.entries] += self.terms.sums(tangent)
        else:
            self.whole(tangent).add_to(matrix)
        return matrix


def number_of_terms(at_points: CsrMatrix, dim: int) -> int:
    """Number of products of two interpolations, at most, that `Terms` add."""
    of_points = np.add.reduceat(at_points.counts, np.arange(0, at_points.shape[0], dim))
    return int(of_points @ of_points)


class Terms:
    """The stiffness as a linear function of the components of all tangents, whose pattern is that
    of the interpolation and is computed once: a product of sparse matrices would sort it anew in
    every iteration of Newton's method.
    """

    def __init__(self, at_points: CsrMatrix, weights: Array) -> None:
        """See `Assembly`."""
        number, size, data = len(weights), at_points.shape[1], at_points.data
        self.dim, self.size = at_points.shape[0] // number, size
        point, component = np.divmod(at_points.rows, self.dim)
        counts = np.bincount(point, minlength=number)
        starts = np.cumsum(counts) - counts
        # a term: two entries of B of the same point, point by point
        one = np.repeat(np.arange(len(point)), counts[point])
        other = ranges(starts[point], counts[point])
        numbers = at_points.indices[one] * size + at_points.indices[other]
        #: the entries of the stiffness, among j * j, that joints have, and their rows and columns
        self.entries, entry = np.unique(numbers, return_inverse=True)
        rows, self.columns = np.divmod(self.entries, size)
        self.pointers = np.searchsorted(rows, np.arange(size + 1))
        #: what leads to them from the components of the tangents (e, q * dim * dim)
        self.operator = CsrMatrix.of_entries(
            weights[point[one]] * data[one] * data[other],
            entry,
            (point[one] * self.dim + component[one]) * self.dim + component[other],
            (len(self.entries), number * self.dim**2),
        )

    def sums(self, tangent: Array) -> Array:
        """The entries (e,) for a tangent (q, 3, 3)."""
        return self.operator @ tangent[:, : self.dim, : self.dim].ravel()

    def matrix(self, tangent: Array) -> CsrMatrix:
        """The matrix (j, j) for a tangent (q, 3, 3)."""
        return CsrMatrix(self.sums(tangent), self.columns, self.pointers, (self.size, self.size))
