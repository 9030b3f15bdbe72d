"""Sparse matrices by compressed rows, on numpy: scipy takes as long to load as a 2D run takes.

Large matrices are multiplied by scipy, in the same order of summation.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from .arrays import Array, IntArray

if TYPE_CHECKING:
    from scipy import sparse

#: Number of entries up to which numpy takes less time than scipy.
LARGE = 100_000
#: The same where scipy would have to be loaded first, which takes 0.1 s.
LARGER = 1_000_000


def is_large(entries: int) -> bool:
    """Whether scipy computes a transposed matrix or a product with a vector."""
    return entries > (LARGE if "scipy.sparse" in sys.modules else LARGER)


def ranges(starts: IntArray, counts: IntArray) -> IntArray:
    """The numbers starts[i], ..., starts[i] + counts[i] - 1 of all i, one after the other."""
    ends = np.cumsum(counts)
    return np.repeat(starts - ends + counts, counts) + np.arange(ends[-1] if len(ends) else 0)


@dataclass(frozen=True, eq=False)  # a key of caches, by identity
class CsrMatrix:
    """A matrix (m, n): row i has data[indptr[i] : indptr[i + 1]], each in another of `indices`."""

    data: Array
    indices: IntArray
    indptr: IntArray
    shape: tuple[int, int]

    @staticmethod
    def of_entries(
        values: Array, rows: IntArray, columns: IntArray, shape: tuple[int, int]
    ) -> CsrMatrix:
        """The matrix of entries; those of the same row and column are added."""
        if len(values) > LARGER:
            from scipy import sparse

            return CsrMatrix.of_scipy(sparse.coo_matrix((values, (rows, columns)), shape))
        codes, inverse = np.unique(rows * np.int64(shape[1]) + columns, return_inverse=True)
        row, column = np.divmod(codes, max(shape[1], 1))
        pointers = np.searchsorted(row, np.arange(shape[0] + 1))
        summed = np.asarray(np.bincount(inverse, values, len(codes)), float)
        return CsrMatrix(summed, column, pointers, shape)

    @staticmethod
    def of_scipy(matrix: Any) -> CsrMatrix:
        """The same matrix of scipy."""
        rows = matrix.tocsr()
        return CsrMatrix(rows.data, rows.indices, rows.indptr, rows.shape)

    def scipy(self) -> sparse.csr_matrix:
        """The same as a matrix of scipy."""
        from scipy import sparse

        return sparse.csr_matrix((self.data, self.indices, self.indptr), self.shape)

    def toarray(self) -> Array:
        """The same as a dense array."""
        dense = np.zeros(self.shape)
        self.add_to(dense)
        return dense

    @cached_property
    def dense(self) -> Array:
        """The same, stored for products of a small matrix."""
        return self.toarray()

    def add_to(self, dense: Array) -> None:
        """Add it to a dense array (m, n)."""
        dense[self.rows, self.indices] += self.data

    @cached_property
    def counts(self) -> IntArray:
        """Number of entries of each row (m,)."""
        return np.diff(self.indptr)

    @cached_property
    def rows(self) -> IntArray:
        """Row of each entry."""
        return np.repeat(np.arange(self.shape[0]), self.counts)

    @cached_property
    def T(self) -> CsrMatrix:
        """The transposed matrix."""
        shape = self.shape[::-1]
        if is_large(len(self.data)):
            return CsrMatrix.of_scipy(self.scipy().T)
        order = np.argsort(self.indices, kind="stable")
        pointers = np.concatenate([[0], np.cumsum(np.bincount(self.indices, minlength=shape[0]))])
        return CsrMatrix(self.data[order], self.rows[order], pointers, shape)

    @overload
    def __matmul__(self, other: Array) -> Array: ...
    @overload
    def __matmul__(self, other: CsrMatrix) -> CsrMatrix: ...
    def __matmul__(self, other: Array | CsrMatrix) -> Array | CsrMatrix:
        """The product with an array (n,) or (n, k), or with a matrix (n, k)."""
        if isinstance(other, CsrMatrix):
            return self._times(other)
        if other.ndim == 2 and self.shape[0] * self.shape[1] <= LARGE:
            return np.asarray(self.dense @ other)
        if other.ndim == 2 or is_large(len(self.data)):
            return np.asarray(self.scipy() @ other)
        products = self.data * other[self.indices]
        return np.asarray(np.bincount(self.rows, products, self.shape[0]), float)

    def on_rows(self, other: Array) -> Array:
        """The products (..., m) with an array (n,), or with each row of one (k, n); no scipy."""
        if other.ndim == 1:
            return self @ other
        result = np.zeros((self.shape[0], len(other)))
        if len(full := np.flatnonzero(self.counts)):
            products = self.data[:, None] * other.T[self.indices]
            result[full] = np.add.reduceat(products, self.indptr[full])
        return result.T

    def _times(self, other: CsrMatrix) -> CsrMatrix:
        """The product with a matrix."""
        if max(len(self.data), len(other.data)) > LARGE:
            return CsrMatrix.of_scipy(self.scipy() @ other.scipy())
        counts = other.counts[self.indices]
        entries = ranges(other.indptr[self.indices], counts)
        values = np.repeat(self.data, counts) * other.data[entries]
        rows = np.repeat(self.rows, counts)
        return CsrMatrix.of_entries(
            values, rows, other.indices[entries], (self.shape[0], other.shape[1])
        )

    def scaled(self, weights: Array) -> CsrMatrix:
        """The product diag(weights) self."""
        data = self.data * np.repeat(weights, self.counts)
        return CsrMatrix(data, self.indices, self.indptr, self.shape)

    def __neg__(self) -> CsrMatrix:
        """The matrix with the other sign."""
        return CsrMatrix(-self.data, self.indices, self.indptr, self.shape)

    def __getitem__(self, rows: IntArray | slice) -> CsrMatrix:
        """Some rows."""
        chosen = np.arange(self.shape[0])[rows]
        counts = self.counts[chosen]
        entries = ranges(self.indptr[chosen], counts)
        pointers = np.concatenate([[0], np.cumsum(counts)])
        shape = len(chosen), self.shape[1]
        return CsrMatrix(self.data[entries], self.indices[entries], pointers, shape)

    def columns(self, columns: IntArray) -> CsrMatrix:
        """Some columns, none of them twice."""
        number = np.full(self.shape[1], -1)
        number[columns] = np.arange(len(columns))
        return self.where(number[self.indices] >= 0).renumbered(number, len(columns))

    def where(self, chosen: np.ndarray) -> CsrMatrix:
        """Some of the entries, by a mask."""
        pointers = np.concatenate([[0], np.cumsum(chosen)])[self.indptr]
        return CsrMatrix(self.data[chosen], self.indices[chosen], pointers, self.shape)

    def renumbered(self, number: IntArray, size: int) -> CsrMatrix:
        """The same with the number of each column among `size` columns."""
        shape = self.shape[0], size
        return CsrMatrix(self.data, number[self.indices], self.indptr, shape)


def added(matrices: Sequence[CsrMatrix]) -> CsrMatrix:
    """The sum of matrices of a shape."""
    data, rows, columns = (
        np.concatenate([getattr(m, name) for m in matrices]) for name in ("data", "rows", "indices")
    )
    return CsrMatrix.of_entries(data, rows, columns, matrices[0].shape)


def stacked(matrices: Sequence[CsrMatrix]) -> CsrMatrix:
    """Matrices below each other."""
    counts = np.concatenate([matrix.counts for matrix in matrices])
    data, indices = (np.concatenate([getattr(m, n) for m in matrices]) for n in ("data", "indices"))
    shape = len(counts), matrices[0].shape[1]
    return CsrMatrix(data, indices, np.concatenate([[0], np.cumsum(counts)]), shape)
