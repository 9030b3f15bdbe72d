"""Types of arrays and of the values of parameters; determinants; symmetric matrices in place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
#: of any width: numbers of nodes, elements, unknowns; Gmsh's tags are unsigned
IntArray: TypeAlias = NDArray[np.integer[Any]]
BoolArray: TypeAlias = NDArray[np.bool_]
#: scipy.sparse.csr_matrix, of which type checkers do not know that its product with an array is one
Sparse: TypeAlias = Any

#: A table of results, by column.
Table: TypeAlias = dict[str, Array]

#: The value of a parameter: a number, or one of its choices.
Value: TypeAlias = float | str
#: What a parameter is set to: a value, or one for each joint.
Setting: TypeAlias = Value | tuple[Value, ...]
#: Settings by the names of pro/parameters.pro.
Settings: TypeAlias = Mapping[str, Setting]
#: Values by the names of pro/parameters.pro.
Values: TypeAlias = Mapping[str, Value]


def distinct(numbers: IntArray) -> IntArray:
    """The different ones of some numbers >= 0, sorted. (numpy.unique loads numpy.ma.)"""
    return np.flatnonzero(np.bincount(numbers))


def others(size: int, numbers: IntArray) -> IntArray:
    """The numbers from 0 to size - 1 that are not among some numbers, sorted."""
    mask = np.ones(size, bool)
    mask[numbers] = False
    return np.flatnonzero(mask)


def determinant(matrices: Array) -> Array:
    """Determinants (...) of small matrices (..., d, d), by their first rows. A power of two as unit
    of length changes no digit. (numpy.linalg.det takes logarithms, whose rounding depends on it.)
    """
    first, rest = matrices[..., :1, :], matrices[..., 1:, :]
    if not rest.shape[-2]:
        return np.asarray(first.prod(axis=(-2, -1)))
    minors = [determinant(np.delete(rest, i, axis=-1)) for i in range(rest.shape[-1])]
    signs = (-1.0) ** np.arange(len(minors))
    return np.asarray((signs * first[..., 0, :] * np.stack(minors, axis=-1)).sum(axis=-1))


#: Size of the blocks that are transposed.
BLOCK = 128


def mirror(lower: Array) -> Array:
    """The symmetric matrix (n, n) of a lower triangle, in place."""
    for first in range(0, len(lower), BLOCK):
        rows, below = slice(first, first + BLOCK), slice(first + BLOCK, None)
        lower[rows, below] = lower[below, rows].T
        diagonal = lower[rows, rows]
        diagonal[:] = np.tril(diagonal) + np.tril(diagonal, -1).T
    return lower
