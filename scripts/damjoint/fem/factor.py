"""Sparse factorisations: Schur complements and systems of symmetric matrices.

By MUMPS where python-mumps is installed (`make setup` builds it), else by scipy's SuperLU, which
is several times slower in 3D: is_slow() says so.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from importlib.metadata import version

import numpy as np
import scipy
import scipy.sparse.linalg
from scipy import sparse

from .memory import check_memory

try:
    import mumps
except ImportError:  # not built for this Python, or the system's libmumps is gone
    mumps = None


def name() -> str:
    """What factorises, with its version."""
    if mumps is None:
        return f"SuperLU (scipy {scipy.__version__})"
    return f"MUMPS (python-mumps {version('python-mumps')})"


def is_slow() -> bool:
    """Whether the fast library is missing."""
    return mumps is None


#: MUMPS's number of that error.
NO_MEMORY = -13


def estimate(one: mumps.Context) -> float:
    """Memory [bytes] that MUMPS takes for a matrix it has analysed."""
    return 1e6 * one.mumps_instance.infog[16]


def dense_memory(joint: int) -> float:
    """Memory [bytes] of a Schur complement of so many unknowns, its factors and products."""
    return 8.0 * joint**2 * 6


@contextlib.contextmanager
def context() -> Iterator[mumps.Context]:
    """MUMPS, for one matrix.

    Raises MemoryError where MUMPS gets none.
    """
    try:
        with mumps.Context() as one:
            yield one
    except RuntimeError as error:
        if getattr(error, "error", 0) == NO_MEMORY:
            raise MemoryError(str(error)) from None
        raise


def schur_complement(
    matrix: sparse.csr_matrix, keep: np.ndarray, loads: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Dense Schur complement (k, k) of a symmetric matrix on the k unknowns `keep`, and loads (n,
    m) reduced to them (k, m).

    Raises RunError before it runs out of memory, MemoryError where it does.
    """
    dense = dense_memory(len(keep))
    what = f"{matrix.shape[0]} unknowns, {len(keep)} of them on the joint and the wet faces,"
    check_memory(dense, what)
    if mumps is None:
        return schur_by_superlu(matrix, keep, loads)
    result = np.zeros((len(keep), len(keep)))
    with context() as one:
        one.set_matrix(sparse.triu(matrix, format="coo"), symmetric=True)
        instance = one.mumps_instance
        instance.icntl[19] = 1  # Schur complement on the host
        indices = keep.astype(np.int32) + 1  # Fortran's; MUMPS keeps the address
        instance.set_schur(result, indices)
        # Debian's MUMPS knows no METIS and takes another ordering then
        one.analyze(ordering="metis" if matrix.shape[0] > 15000 else "scotch")
        check_memory(dense + estimate(one), what)
        one.factor(reuse_analysis=True, pivot_tol=0.0)
        inside = solved(one, loads)  # with nothing moving that is kept
    # a symmetric factorisation leaves the lower triangle
    return np.tril(result) + np.tril(result, -1).T, loads[keep] - matrix[keep] @ inside


def solved(one: mumps.Context, right: np.ndarray) -> np.ndarray:
    """Solution for right-hand sides (n, m) by the factors of a context."""
    # python-mumps writes to the right-hand side once more when the context ends, which owns it
    one.right = np.array(right, order="F")
    one.mumps_instance.set_dense_rhs(one.right)
    one.mumps_instance.job = 3
    one.call()
    return one.right.copy()


def superlu(matrix: sparse.csc_matrix, ordering: str) -> sparse.linalg.SuperLU:
    """SuperLU factors of a symmetric matrix, pivots on the diagonal."""
    return sparse.linalg.splu(
        matrix, permc_spec=ordering, diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )


def schur_by_superlu(
    matrix: sparse.csr_matrix, keep: np.ndarray, loads: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The same by SuperLU: the last block of the factors of the whole matrix, `keep` and the loads,
    as its columns, last.

    Five to ten times faster than one solve per kept unknown. The complement itself may be singular
    (a floating body): with its diagonal raised it is not, and elimination carries what was added
    through unchanged.
    """
    n, k = matrix.shape[0], len(keep)
    columns = sparse.csr_matrix(loads)
    matrix = sparse.bmat([[matrix, columns], [columns.T, None]], format="csc")
    keep = np.append(keep, np.arange(n, matrix.shape[0]))
    inside = np.setdiff1d(np.arange(matrix.shape[0]), keep)
    order = np.empty_like(inside)
    order[superlu(matrix[inside][:, inside], "MMD_AT_PLUS_A").perm_c] = inside
    order = np.append(order, keep)
    raised = matrix.diagonal()[keep]
    added = sparse.diags(np.append(np.zeros(len(inside)), raised))
    factors = superlu((matrix[order][:, order] + added).tocsc(), "NATURAL")
    rows, columns = factors.perm_r[len(inside) :], factors.perm_c[len(inside) :]
    lower = factors.L.tocsr()[rows][:, columns].toarray()
    upper = factors.U.tocsr()[columns][:, columns].toarray()
    found = lower @ upper - np.diag(raised)
    return found[:k, :k], found[:k, k:]


def solve_symmetric(matrix: sparse.csr_matrix, right: np.ndarray) -> np.ndarray:
    """Solution (n, m) of a symmetric positive definite system, all right-hand sides at once.

    Raises RunError before it runs out of memory.
    """
    if mumps is None:
        return superlu(matrix.tocsc(), "MMD_AT_PLUS_A").solve(right)
    with context() as one:
        one.set_matrix(sparse.triu(matrix, format="coo"), symmetric=True)
        # up to this size nested dissection costs more than it saves
        one.analyze(ordering="amf" if matrix.shape[0] < 50000 else "auto")
        check_memory(estimate(one) + 3 * right.nbytes, f"{matrix.shape[0]} unknowns")
        one.factor(reuse_analysis=True, pivot_tol=0.0)
        return solved(one, right)
