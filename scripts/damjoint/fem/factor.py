"""Sparse factorisations: Schur complements and systems of symmetric matrices.

By MUMPS through mumps.c, which is compiled at its first use if the system has a C compiler and
MUMPS (`make setup` installs both), else by scipy's SuperLU, which is several times slower in 3D
(is_slow). Large matrices are eliminated in METIS's order where pymetis is installed: with a Schur
complement, MUMPS itself orders by approximate minimum degree, which needs twice the operations.
"""

from __future__ import annotations

import ctypes
import hashlib
import subprocess
import tempfile
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Literal

import numpy as np
import scipy
from scipy import sparse
from threadpoolctl import threadpool_info, threadpool_limits

from ..arrays import Array, IntArray, Sparse
from ..storage import atomic_write, cache_folder
from .memory import available, check_memory, dense_memory

if TYPE_CHECKING:  # loaded where it is used, as a command with cached data does not need it
    from scipy.sparse.linalg import SuperLU

#: Number of unknowns from which on METIS's order saves more time than it takes.
LARGE = 15000

#: Results of mumps.c: the estimated memory exceeds what is available; a failed allocation.
TOO_LARGE, NO_MEMORY = 1, -13


@cache
def library() -> ctypes.CDLL | None:
    """mumps.c as a library, compiled into the cache folder; None without compiler or MUMPS."""
    source = Path(__file__).with_name("mumps.c")
    digest = hashlib.sha256(source.read_bytes()).hexdigest()[:16]
    parent = cache_folder() or Path(tempfile.mkdtemp(prefix="damjoint"))
    path = parent / f"mumps-{digest}.so"
    try:
        return ctypes.CDLL(str(path))
    except OSError:  # not compiled yet, or for a MUMPS that is no longer installed
        pass
    try:
        parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(path) as part:
            options = "-O2", "-shared", "-fPIC", source, "-ldmumps_seq", "-o", part
            subprocess.run(["cc", *options], check=True, capture_output=True)
        return ctypes.CDLL(str(path))
    except (OSError, subprocess.CalledProcessError):
        return None


@cache
def metis() -> ModuleType | None:
    """The module pymetis; None if it is not installed."""
    try:
        import pymetis
    except ImportError:
        return None
    return pymetis


def name() -> str:
    """Library that factorises, with its version, and the order of large matrices."""
    mumps = library()
    if mumps is None:
        return f"SuperLU (scipy {scipy.__version__})"
    mumps.damjoint_mumps_version.restype = ctypes.c_char_p
    ordering = metis()
    order = f", METIS (pymetis {ordering.version})" if ordering else ""
    return f"MUMPS {mumps.damjoint_mumps_version().decode()}{order}"


def is_slow() -> bool:
    """Whether MUMPS is not available."""
    return library() is None


def elimination_order(matrix: Sparse, keep: IntArray) -> IntArray | None:
    """Position (n,) from 1 of each unknown in METIS's order, with the unknowns `keep` last; None
    for MUMPS's own order.
    """
    size = matrix.shape[0]
    pymetis = metis() if size >= LARGE else None
    if pymetis is None:
        return None
    inside = np.setdiff1d(np.arange(size), keep)
    graph = matrix[inside][:, inside].tocsr()
    graph.setdiag(0)
    graph.eliminate_zeros()
    _, position = pymetis.nested_dissection(pymetis.CSRAdjacency(graph.indptr, graph.indices))
    order = np.empty(size, np.int32)
    order[inside] = 1 + np.asarray(position)
    order[keep] = 1 + np.arange(len(inside), size)
    return order


def solve_by_mumps(
    mumps: ctypes.CDLL, matrix: Sparse, right: Array, keep: IntArray, what: str
) -> tuple[Array, Array]:
    """Solution (n, m) of a symmetric system with the unknowns `keep` (k,) zero, and the lower
    triangle of their Schur complement (k, k). No pivoting: the rest must be positive definite.

    what: the unknowns, for the message. Raises RunError if the estimated memory is not available,
    MemoryError if an allocation fails.
    """
    upper = sparse.triu(matrix, format="coo")
    order, schur = elimination_order(matrix, keep), np.zeros((len(keep), len(keep)))
    solution, needed = np.array(right, order="F"), ctypes.c_double()
    beside = float(schur.nbytes + solution.nbytes)

    def pointer(values: Array | IntArray) -> ctypes.c_void_p:
        return ctypes.c_void_p(values.ctypes.data)

    # MUMPS has a BLAS of its own, which a limit does not reach that was set before it was loaded
    threads = min(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas")
    row, column, indices = ((i + 1).astype(np.int32) for i in (upper.row, upper.col, keep))
    with threadpool_limits(threads, "blas"):
        error = mumps.damjoint_solve(
            *(matrix.shape[0], ctypes.c_longlong(upper.nnz)),
            *(pointer(row), pointer(column), pointer(upper.data)),
            None if order is None else pointer(order),
            *(len(keep), pointer(indices), pointer(schur)),
            *(solution.shape[1], pointer(solution)),
            *(ctypes.c_double((available() - beside) / 1e6), ctypes.byref(needed)),
        )
    if error == TOO_LARGE:
        check_memory(beside + 1e6 * needed.value, what)
    if error in (TOO_LARGE, NO_MEMORY):
        raise MemoryError(f"MUMPS, {what}")
    if error:
        raise RuntimeError(f"MUMPS, error {error}")
    return solution, schur


def schur_complement(matrix: Sparse, keep: IntArray, loads: Array) -> tuple[Array, Array]:
    """Dense Schur complement (k, k) of a symmetric matrix on the k unknowns `keep`, and loads (n,
    m) reduced to them (k, m).

    Raises RunError if the estimated memory is not available, MemoryError if an allocation fails.
    """
    what = f"{matrix.shape[0]} unknowns, {len(keep)} of them on the joint and the wet faces,"
    check_memory(dense_memory(len(keep)), what)
    mumps = library()
    if mumps is None:
        return schur_by_superlu(matrix, keep, loads)
    inside, lower = solve_by_mumps(mumps, matrix, loads, keep, what)
    return np.tril(lower) + np.tril(lower, -1).T, loads[keep] - matrix[keep] @ inside


def superlu(matrix: Sparse, ordering: Literal["NATURAL", "MMD_AT_PLUS_A"]) -> SuperLU:
    """SuperLU factors of a symmetric matrix, pivots on the diagonal."""
    from scipy.sparse.linalg import splu

    return splu(matrix, permc_spec=ordering, diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def schur_by_superlu(matrix: Sparse, keep: IntArray, loads: Array) -> tuple[Array, Array]:
    """The same by SuperLU: the last block of the factors of the matrix with `keep`, then the loads
    as its columns, ordered last.

    Five to ten times faster than one solve per kept unknown. The complement itself may be singular
    (a floating body): its diagonal is raised, which elimination leaves unchanged, and subtracted at
    the end.
    """
    n, k = matrix.shape[0], len(keep)
    border: Sparse = sparse.csr_matrix(loads)
    matrix = sparse.bmat([[matrix, border], [border.T, None]], format="csc")
    keep = np.append(keep, np.arange(n, matrix.shape[0]))
    inside = np.setdiff1d(np.arange(matrix.shape[0]), keep)
    order = np.empty_like(inside)
    order[superlu(matrix[inside][:, inside], "MMD_AT_PLUS_A").perm_c] = inside
    order = np.append(order, keep)
    raised = matrix.diagonal()[keep]
    added = sparse.diags(np.append(np.zeros(len(inside)), raised))
    factors = superlu((matrix[order][:, order] + added).tocsc(), "NATURAL")
    rows, columns = factors.perm_r[len(inside) :], factors.perm_c[len(inside) :]
    lower: Sparse = factors.L.tocsr()
    upper: Sparse = factors.U.tocsr()
    reduced = lower[rows][:, columns].toarray() @ upper[columns][:, columns].toarray()
    reduced -= np.diag(raised)
    return reduced[:k, :k], reduced[:k, k:]


def solve_symmetric(matrix: Sparse, right: Array) -> Array:
    """Solution (n, m) of a symmetric positive definite system, all right-hand sides at once.

    Raises RunError if the estimated memory is not available.
    """
    mumps = library()
    if mumps is None:
        return superlu(matrix.tocsc(), "MMD_AT_PLUS_A").solve(right)
    none = np.zeros(0, int)
    return solve_by_mumps(mumps, matrix, right, none, f"{matrix.shape[0]} unknowns")[0]
