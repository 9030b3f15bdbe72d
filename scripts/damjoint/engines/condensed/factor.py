"""Factorisation of large sparse symmetric matrices."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import scipy.sparse.linalg  # noqa: F401 (sparse.linalg)
from scipy import sparse

from ... import RunError

try:
    import mumps
except ImportError:  # no wheel for this Python
    mumps = None


def check_memory(needed: float, unknowns: int, joint: int) -> None:
    """Raise RunError if more memory [bytes] is needed than the machine has left."""
    try:
        left = (
            float(re.search(r"MemAvailable:\s+(\d+)", Path("/proc/meminfo").read_text())[1]) * 1024
        )
    except (OSError, TypeError):
        return
    if needed > left:
        raise RunError(
            f"memory: {unknowns} unknowns, {joint} of them on the joint and the wet faces, need about {needed / 1e9:.1f} GB and "
            f"{left / 1e9:.1f} GB are left; use a coarser mesh (n_joint, n_layers, h_dam, h_found)"
        )


def dense_memory(joint: int) -> float:
    """Memory [bytes] of the Schur complement of so many unknowns, its factors and the products made
    later on.
    """
    return 8.0 * joint**2 * 6


def schur_complement(matrix: sparse.csr_matrix, keep: np.ndarray) -> np.ndarray:
    """
    Dense Schur complement (k, k) of a symmetric matrix on the k unknowns `keep`.

    By MUMPS where python-mumps is installed; else by scipy's SuperLU, ten times slower in 3D.
    Raises RunError before it runs out of memory.
    """
    dense = dense_memory(len(keep))
    check_memory(dense, matrix.shape[0], len(keep))
    if mumps is None:
        return schur_by_superlu(matrix, keep)
    result = np.zeros((len(keep), len(keep)))
    with mumps.Context() as context:
        context.set_matrix(sparse.triu(matrix, format="coo"), symmetric=True)
        context.mumps_instance.icntl[19] = 1  # Schur complement on the host
        context.mumps_instance.icntl[31] = 1  # factors not kept
        indices = keep.astype(np.int32) + 1  # Fortran's; MUMPS keeps the address
        context.mumps_instance.set_schur(result, indices)
        context.analyze(ordering="metis" if matrix.shape[0] > 15000 else "scotch")
        check_memory(
            dense + 1e6 * context.mumps_instance.infog[16], matrix.shape[0], len(keep)
        )  # MUMPS's estimate in MB
        context.factor(reuse_analysis=True, pivot_tol=0.0)
    return (
        np.tril(result) + np.tril(result, -1).T
    )  # a symmetric factorisation leaves the lower triangle


def schur_by_superlu(matrix: sparse.csr_matrix, keep: np.ndarray) -> np.ndarray:
    """The same by a factorisation of the interior and one solve per kept unknown."""
    inside = np.setdiff1d(np.arange(matrix.shape[0]), keep)
    matrix = matrix.tocsc()
    factor = sparse.linalg.splu(
        matrix[inside][:, inside],
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    coupling = matrix[inside][:, keep]
    return matrix[keep][:, keep].toarray() - coupling.T @ factor.solve(coupling.toarray())


def solve_symmetric(matrix: sparse.csr_matrix, right: np.ndarray) -> np.ndarray:
    """Solution (n, m) of a symmetric positive definite system, by the solver of
    schur_complement.
    """
    if mumps is None:
        return sparse.linalg.splu(
            matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}
        ).solve(right)
    with mumps.Context() as context:
        context.set_matrix(sparse.triu(matrix, format="coo"), symmetric=True)
        context.factor(pivot_tol=0.0)
        # python-mumps 0.0.2 writes to the right-hand side once more when the context ends: own it
        # until then
        work = np.array(right, order="F")
        context.mumps_instance.set_dense_rhs(work)
        context.mumps_instance.job = 3
        context.call()
        solution = work.copy()
    return solution


def name() -> str:
    """The library in use."""
    return "MUMPS" if mumps else "SuperLU"


def is_slow() -> bool:
    """Whether it is the one that is many times slower in 3D."""
    return mumps is None
