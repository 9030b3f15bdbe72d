"""Sparse factorisations: Schur complements and systems of symmetric matrices.

By MUMPS where python-mumps is installed (`make setup` builds it), else by scipy's SuperLU, which
is several times slower in 3D (is_slow).
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from importlib.metadata import version
from typing import Literal

import numpy as np
import scipy
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from ..arrays import Array, IntArray, Sparse
from .memory import check_memory, dense_memory

try:
    import mumps
except ImportError:  # not built for this Python, or the system's libmumps is gone
    mumps = None


def name() -> str:
    """Library that factorises, with its version."""
    if mumps is None:
        return f"SuperLU (scipy {scipy.__version__})"
    return f"MUMPS (python-mumps {version('python-mumps')})"


def is_slow() -> bool:
    """Whether MUMPS is not available."""
    return mumps is None


#: MUMPS's error number for a failed allocation.
NO_MEMORY = -13


def estimate(session: mumps.Context) -> float:
    """Memory [bytes] that MUMPS needs for the matrix it has analysed."""
    return 1e6 * float(session.mumps_instance.infog[16])


@contextlib.contextmanager
def context() -> Iterator[mumps.Context]:
    """Open a context of MUMPS for one matrix.

    Raises MemoryError if MUMPS cannot allocate memory.
    """
    try:
        with mumps.Context() as session:
            yield session
    except RuntimeError as error:
        if getattr(error, "error", 0) == NO_MEMORY:
            raise MemoryError(str(error)) from None
        raise


def schur_complement(matrix: Sparse, keep: IntArray, loads: Array) -> tuple[Array, Array]:
    """Dense Schur complement (k, k) of a symmetric matrix on the k unknowns `keep`, and loads (n,
    m) reduced to them (k, m).

    Raises RunError if the estimated memory is not available, MemoryError if an allocation fails.
    """
    dense = dense_memory(len(keep))
    what = f"{matrix.shape[0]} unknowns, {len(keep)} of them on the joint and the wet faces,"
    check_memory(dense, what)
    if mumps is None:
        return schur_by_superlu(matrix, keep, loads)
    result = np.zeros((len(keep), len(keep)))
    with context() as session:
        session.set_matrix(sparse.triu(matrix, format="coo"), symmetric=True)
        instance = session.mumps_instance
        instance.icntl[19] = 1  # Schur complement on the host
        indices = keep.astype(np.int32) + 1  # Fortran's; MUMPS keeps the address
        instance.set_schur(result, indices)
        # Debian's MUMPS is built without METIS and takes another ordering then
        session.analyze(ordering="metis" if matrix.shape[0] > 15000 else "scotch")
        check_memory(dense + estimate(session), what)
        session.factor(reuse_analysis=True, pivot_tol=0.0)
        inside = solved(session, loads)  # with the kept unknowns fixed
    # a symmetric factorisation leaves the lower triangle
    return np.tril(result) + np.tril(result, -1).T, loads[keep] - matrix[keep] @ inside


def solved(session: mumps.Context, right: Array) -> Array:
    """Solution for right-hand sides (n, m) by the factors of a context."""
    # python-mumps writes to the right-hand side again when the context, which owns it, ends
    session.right = np.array(right, order="F")
    session.mumps_instance.set_dense_rhs(session.right)
    session.mumps_instance.job = 3
    session.call()
    return np.array(session.right)


def superlu(matrix: Sparse, ordering: Literal["NATURAL", "MMD_AT_PLUS_A"]) -> SuperLU:
    """SuperLU factors of a symmetric matrix, pivots on the diagonal."""
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
    if mumps is None:
        return superlu(matrix.tocsc(), "MMD_AT_PLUS_A").solve(right)
    with context() as session:
        session.set_matrix(sparse.triu(matrix, format="coo"), symmetric=True)
        # below this size nested dissection costs more than it saves
        session.analyze(ordering="amf" if matrix.shape[0] < 50000 else "auto")
        check_memory(estimate(session) + 3 * right.nbytes, f"{matrix.shape[0]} unknowns")
        session.factor(reuse_analysis=True, pivot_tol=0.0)
        return solved(session, right)
