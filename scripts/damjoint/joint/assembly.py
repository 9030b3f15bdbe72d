"""Stiffness of the joints, assembled from the tangents at their Gauss points.

The pattern is that of the interpolation and is found once; a product of sparse matrices would sort
it anew in every iteration of Newton's method.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array, IntArray
from ..csr import CsrMatrix, ranges

#: Number of terms up to which they are kept: more take longer than a product of scipy's matrices.
MOST_TERMS = 500_000


def number_of_terms(at_points: CsrMatrix, dim: int) -> int:
    """Number of products of two interpolations, at most, that an `Assembly` adds."""
    of_points = np.add.reduceat(at_points.counts, np.arange(0, at_points.shape[0], dim))
    return int(of_points @ of_points)


class Assembly:
    """Sum of B^T D B over Gauss points with matrices D (dim, dim): B interpolates the jump."""

    def __init__(self, at_points: CsrMatrix, dim: int) -> None:
        """at_points: B of all points (dim * points, j), see `Interface.at_points`."""
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
        places = at_points.indices[self.entry] * size + unknown[self.pair]
        #: place of each term among the entries of the stiffness, and their rows and columns
        places, self.place = np.unique(places, return_inverse=True)
        self.rows, self.columns = np.divmod(places, size)
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
        place, used = self.place[some], np.zeros(len(self.rows), bool)
        used[place] = True
        data = np.asarray(np.bincount((np.cumsum(used) - 1)[place], terms), float)
        pointers = np.searchsorted(self.rows[used], np.arange(size + 1))
        return CsrMatrix(data, self.columns[used], pointers, (size, size))
