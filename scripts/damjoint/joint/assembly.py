"""Stiffness of the joints, assembled from the tangents at their Gauss points: the sum of w B^T D B,
with B the interpolation of the jump, D the tangent and w the weight of a point.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..arrays import Array, IntArray, Sparse
from ..csr import CsrMatrix, ranges

#: Number of terms up to which they are kept: more take longer than a product of scipy's matrices.
MOST_TERMS = 500_000


class Assembly:
    """The assembly of the stiffness (j, j) from tangents (q, 3, 3), whatever the bodies around."""

    def __init__(self, at_points: CsrMatrix, weights: Array) -> None:
        """at_points: B of all points (dim * q, j), dim rows for each; weights: (q,)."""
        self.at_points, self.weights = at_points, weights
        self.number, self.size = len(weights), at_points.shape[1]
        self.dim = at_points.shape[0] // self.number

    @cached_property
    def by_terms(self) -> Terms | None:
        """The terms of the stiffness; None for many points, by products of sparse matrices."""
        few = number_of_terms(self.at_points, self.dim) <= MOST_TERMS
        return Terms(self.at_points, self.dim) if few else None

    def stiffness(self, tangent: Array, points: IntArray) -> CsrMatrix:
        """The stiffness (j, j) of some Gauss points with a tangent (points, 3, 3)."""
        number, d = len(points), self.dim
        blocks = self.weights[points, None, None] * tangent[:, :d, :d]
        if self.by_terms:
            return self.by_terms.sum(blocks, points)
        rows = self.at_points[(d * points[:, None] + np.arange(d)).ravel()]
        columns = np.repeat(np.arange(d * number).reshape(number, d), d, axis=0)
        diagonal = CsrMatrix(
            blocks.ravel(), columns.ravel(), d * np.arange(d * number + 1), (d * number,) * 2
        )
        return rows.T @ (diagonal @ rows)

    def whole(self, tangent: Array) -> CsrMatrix:
        """The stiffness (j, j) of all Gauss points with a tangent (q, 3, 3)."""
        return self.stiffness(tangent, np.arange(self.number))

    def change(self, tangent: Array, before: Array) -> tuple[CsrMatrix, IntArray]:
        """The change from one tangent to another (q, 3, 3), without its zero rows, and the rows."""
        # rows: components of the traction
        differs = (tangent != before).any(axis=2)[:, : self.dim]
        points = np.flatnonzero(differs.any(axis=1))
        changes = np.zeros(self.size, bool)
        changes[self.at_points.indices[differs.ravel()[self.at_points.rows]]] = True
        rows = np.flatnonzero(changes)
        return self.stiffness(tangent[points] - before[points], points)[rows], rows

    @cached_property
    def operator(self) -> tuple[IntArray, Sparse]:
        """The entries of the stiffness, among j * j, that joints have (e,), and a matrix that leads
        to them from those of the tangents (e, q * dim * dim).
        """
        from scipy import sparse

        d, size = self.dim, self.size
        rows, columns, values = [], [], []
        for q in range(self.number):
            block = self.at_points[d * q : d * (q + 1)]
            touched = np.unique(block.indices)
            local = block.columns(touched).toarray()
            # d (w B^T D B)[a, b] / d D[k, l]
            parts = self.weights[q] * np.einsum("ka,lb->abkl", local, local)
            entries = touched[:, None] * size + touched
            rows.append(np.repeat(entries.ravel(), d * d))
            columns.append(np.tile(q * d * d + np.arange(d * d), entries.size))
            values.append(parts.ravel())
        data, row, column = (np.concatenate(part) for part in (values, rows, columns))
        entries, row = np.unique(row, return_inverse=True)
        return entries, sparse.csr_matrix(
            (data, (row, column)), (len(entries), self.number * d * d)
        )

    def with_joints(self, stiffness: Array, tangent: Array) -> Array:
        """A stiffness (j, j) with that of all Gauss points, by one product, for few unknowns."""
        (entries, operator), matrix = self.operator, stiffness.copy()
        matrix.ravel()[entries] += operator @ tangent[:, : self.dim, : self.dim].ravel()
        return matrix


def number_of_terms(at_points: CsrMatrix, dim: int) -> int:
    """Number of products of two interpolations, at most, that `Terms` add."""
    of_points = np.add.reduceat(at_points.counts, np.arange(0, at_points.shape[0], dim))
    return int(of_points @ of_points)


class Terms:
    """Sum of B^T D B over Gauss points with matrices D (dim, dim): B interpolates the jump.

    The pattern of the sum is that of the interpolation and is computed once; a product of sparse
    matrices would sort it anew in every iteration of Newton's method.
    """

    def __init__(self, at_points: CsrMatrix, dim: int) -> None:
        """at_points: B of all points (dim * points, j), see `Assembly`."""
        self.dim, self.at_points, size = dim, at_points, at_points.shape[1]
        point = at_points.rows // dim
        number = at_points.shape[0] // dim
        pairs, entry = np.unique(point * size + at_points.indices, return_inverse=True)
        #: pairs of a point and an unknown on which its jump depends, and B of them (dim, pairs)
        self.point, unknown = np.divmod(pairs, size)
        self.values = np.zeros((dim, len(pairs)))
        self.values[at_points.rows % dim, entry] = at_points.data
        counts = np.bincount(self.point, minlength=number)
        starts = np.cumsum(counts) - counts
        #: a term: an entry of B times a pair of the same point, point by point
        self.entry = np.repeat(np.arange(len(point)), counts[point])
        self.pair = ranges(starts[point], counts[point])
        self.component = at_points.rows[self.entry] % dim
        numbers = at_points.indices[self.entry] * size + unknown[self.pair]
        #: number of each term among the entries of the stiffness, and their rows and columns
        numbers, self.number = np.unique(numbers, return_inverse=True)
        self.rows, self.columns = np.divmod(numbers, size)
        self.terms = np.bincount(point, counts[point], number).astype(int)
        self.starts = np.cumsum(self.terms) - self.terms

    def sum(self, blocks: Array, points: IntArray) -> CsrMatrix:
        """The matrix (j, j) of some points, by their D (points, dim, dim)."""
        size = self.at_points.shape[1]
        every = np.zeros((len(self.terms), self.dim, self.dim))
        every[points] = blocks
        every = every[self.point]
        products = every[:, :, 0].T * self.values[0]
        for k in range(1, self.dim):
            products += every[:, :, k].T * self.values[k]
        some = ranges(self.starts[points], self.terms[points])
        terms = self.at_points.data[self.entry[some]]
        terms *= products[self.component[some], self.pair[some]]
        number, used = self.number[some], np.zeros(len(self.rows), bool)
        used[number] = True
        data = np.asarray(np.bincount((np.cumsum(used) - 1)[number], terms), float)
        pointers = np.searchsorted(self.rows[used], np.arange(size + 1))
        return CsrMatrix(data, self.columns[used], pointers, (size, size))
