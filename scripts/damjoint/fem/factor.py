"""Sparse factorisations: Schur complements and systems of symmetric matrices.

By MUMPS through mumps.c, which `make setup` compiles, or its first use if the system has a C
compiler and MUMPS; else by scipy's SuperLU, which is several times slower in 3D (is_slow), but
faster for many right-hand sides of a small matrix. Large matrices are eliminated in METIS's order
where pymetis is installed: with a Schur complement, MUMPS itself orders by approximate minimum
degree, which needs twice the operations.
"""

from __future__ import annotations

import contextlib
import ctypes
import subprocess
import sys
import tempfile
import weakref
import zlib
from collections.abc import Iterator
from contextlib import AbstractContextManager
from functools import cache
from io import BytesIO
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from threadpoolctl import ThreadpoolController

from ..arrays import Array, IntArray, Sparse, mirror, others
from ..csr import CsrMatrix
from ..storage import MARK, cache_folder, checksum
from ..threads import limited_threads
from ..versions import installed
from .memory import available, check_memory, dense_memory

if TYPE_CHECKING:  # loaded where it is used, as a command with cached data does not need it
    from scipy.sparse.linalg import SuperLU

#: Number of eliminated times kept unknowns up to which many right-hand sides take less time by
#: SuperLU.
SMALL = 400_000
#: Number of unknowns from which on METIS's order saves more time than it takes.
LARGE = 15000

#: Results of mumps.c: the estimated memory exceeds what is available; a failed allocation.
TOO_LARGE, NO_MEMORY = 1, -13


SOURCE = Path(__file__).with_name("mumps.c")
#: Folder of the Python environment into which `make setup` compiles it.
INSTALLED = Path(sys.prefix) / "lib" / "damjoint"


@cache
def library() -> ctypes.CDLL | None:
    """mumps.c as a library, by `make setup` or compiled into the cache; None: it can not be."""
    cached = cache_folder()
    for folder in (INSTALLED, cached) if cached else (INSTALLED,):
        # OSError: not compiled yet, or for a MUMPS that is no longer installed
        with contextlib.suppress(OSError):
            if folder is INSTALLED or is_whole(folder / file_name()):
                return ctypes.CDLL(str(folder / file_name()))
    if cached:
        return compile_into(cached)
    with tempfile.TemporaryDirectory(prefix="damjoint-") as folder_name:  # it stays loaded
        return compile_into(Path(folder_name))


@contextlib.contextmanager
def single_thread() -> Iterator[None]:
    """Compute with a single thread, also in MUMPS: the matrices of a step are small."""
    library()  # a limit reaches only libraries that are loaded
    with limited_threads(1):
        yield


def is_whole(path: Path) -> bool:
    """Whether a library in the cache is as it was compiled: it ends in its checksum.

    Raises OSError.
    """
    content = path.read_bytes()
    return content[-MARK:] == checksum(BytesIO(content[:-MARK]))


def file_name() -> str:
    """The name of the compiled library: of this state of mumps.c."""
    return f"mumps-{zlib.crc32(SOURCE.read_bytes()):08x}.so"


def compile_into(folder: Path) -> ctypes.CDLL | None:
    """Compile mumps.c into a folder; None without compiler or MUMPS."""
    path = folder / file_name()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as temporary:  # others may compile it, too
            part = Path(temporary) / path.name
            options = "-O2", "-shared", "-fPIC", SOURCE, "-ldmumps_seq", "-o", part
            subprocess.run(["cc", *options], check=True, capture_output=True)
            with part.open("r+b") as file:  # what follows the sections is not loaded
                file.write(checksum(file))
            part.replace(path)
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
        import scipy

        return f"SuperLU (scipy {scipy.__version__})"
    mumps.damjoint_mumps_version.restype = ctypes.c_char_p
    ordering = installed("pymetis")
    order = f", METIS (pymetis {ordering})" if ordering else ""
    return f"MUMPS {mumps.damjoint_mumps_version().decode()}{order}"


def is_slow() -> bool:
    """Whether MUMPS is not available."""
    return library() is None


def upper_triangle(matrix: CsrMatrix | Sparse) -> tuple[IntArray, IntArray, Array]:
    """Rows, columns and values of the entries of the upper triangle of a matrix."""
    if isinstance(matrix, CsrMatrix):
        upper = matrix.rows <= matrix.indices
        return matrix.rows[upper], matrix.indices[upper], matrix.data[upper]
    from scipy import sparse

    entries = sparse.triu(matrix, format="coo")
    return entries.row, entries.col, entries.data


def elimination_order(matrix: CsrMatrix | Sparse, keep: IntArray) -> IntArray | None:
    """Position (n,) from 1 of each unknown in METIS's order, with the unknowns `keep` last; None
    for MUMPS's own order.
    """
    size = matrix.shape[0]
    pymetis = metis() if size >= LARGE else None
    if pymetis is None:
        return None
    inside = others(size, keep)
    whole = matrix.scipy() if isinstance(matrix, CsrMatrix) else matrix
    graph = whole[inside][:, inside].tocsr()
    graph.data[:] = 1.0
    # unknowns of a node follow each other and have the same neighbours: a vertex of the graph
    neighbours = graph @ np.random.default_rng(0).random(len(inside))
    vertex = np.cumsum(np.diff(neighbours, prepend=-1.0) != 0) - 1
    first = np.flatnonzero(np.diff(vertex, prepend=-1))
    graph = graph[first][:, first]
    graph.setdiag(0)
    graph.eliminate_zeros()
    _, position = pymetis.nested_dissection(pymetis.CSRAdjacency(graph.indptr, graph.indices))
    order = np.empty(size, np.int32)
    order[inside[np.argsort(np.asarray(position)[vertex], kind="stable")]] = 1 + np.arange(
        len(inside)
    )
    order[keep] = 1 + np.arange(len(inside), size)
    return order


def pointer(values: Array | IntArray) -> ctypes.c_void_p:
    """The address of an array, for a C function."""
    return ctypes.c_void_p(values.ctypes.data)


#: The libraries that have threads, MUMPS's own BLAS among them: called when it is loaded.
controller = cache(ThreadpoolController)


def as_other_libraries() -> AbstractContextManager[Any]:
    """Limit the threads of MUMPS's own BLAS to those of the others: a limit that was set before it
    was loaded has not reached it.
    """
    pools = (pool for pool in controller().info() if pool["user_api"] == "blas")
    number = min(pool["num_threads"] for pool in pools)
    limits: AbstractContextManager[Any] = controller().limit(limits=number, user_api="blas")
    return limits


class MumpsFactors:
    """MUMPS's factors of a symmetric matrix (n, n) with the unknowns `keep` (k,) not eliminated.

    No pivoting: the rest must be positive definite.
    """

    def __init__(
        self,
        mumps: ctypes.CDLL,
        matrix: CsrMatrix | Sparse,
        keep: IntArray,
        what: str,
        beside: float = 0.0,
        store: bool = True,
    ) -> None:
        """what: the unknowns, for the message; beside: further memory [bytes] that is needed;
        store: whether to store the factors: only then `solve`, `reduce` and `expand` work.

        Raises RunError if the estimated memory is not available, MemoryError if an allocation
        fails.
        """
        self.mumps, self.keep = mumps, (keep + 1).astype(np.int32)
        *indices, values = upper_triangle(matrix)
        order, self.size = elimination_order(matrix, keep), matrix.shape[0]
        #: lower triangle of the Schur complement of `keep` (k, k)
        self.lower = np.zeros((len(keep), len(keep)))
        beside += float(self.lower.nbytes)
        needed, error = ctypes.c_double(), ctypes.c_int()
        row, column = (i.astype(np.int32, copy=False) for i in indices)
        for index in row, column:
            index += 1
        mumps.damjoint_factorise.restype = ctypes.c_void_p
        with as_other_libraries():
            factors = mumps.damjoint_factorise(
                *(self.size, ctypes.c_longlong(len(values))),
                *(pointer(row), pointer(column), pointer(values)),
                None if order is None else pointer(order),
                *(len(keep), pointer(self.keep), pointer(self.lower), int(store)),
                *(ctypes.c_double((available() - beside) / 1e6), ctypes.byref(needed)),
                ctypes.byref(error),
            )
        if error.value == TOO_LARGE:
            check_memory(beside + 1e6 * needed.value, what)
        if error.value in (TOO_LARGE, NO_MEMORY):
            raise MemoryError(f"MUMPS, {what}")
        if error.value:
            raise RuntimeError(f"MUMPS, error {error.value}")
        self.factors = ctypes.c_void_p(factors)
        weakref.finalize(self, mumps.damjoint_release, self.factors)

    @property
    def schur(self) -> Array:
        """The Schur complement of `keep` (k, k)."""
        return mirror(self.lower)

    def solve(self, right: Array) -> Array:
        """Solution (n, m) with the unknowns `keep` zero."""
        solution = np.array(right, float, order="F")
        with as_other_libraries():
            self._run(solution, 0, None)
        return solution

    def reduce(self, right: Array) -> Array:
        """Right-hand side (k,) of the Schur complement, from that (n,) of the matrix."""
        self._partial, reduced = np.array(right, float), np.zeros(len(self.keep))
        self._run(self._partial, 1, reduced)
        return reduced

    def expand(self, solution: Array) -> Array:
        """The solution (n,) for the right-hand side last reduced, from that (k,) of `keep`."""
        self._run(self._partial, 2, np.array(solution, float))
        return self._partial

    def _run(self, right: Array, part: int, reduced: Array | None) -> None:
        """See damjoint_solve."""
        count = right.shape[1] if right.ndim > 1 else 1
        on_schur = None if reduced is None else pointer(reduced)
        error = self.mumps.damjoint_solve(self.factors, count, pointer(right), part, on_schur)
        if error:
            raise RuntimeError(f"MUMPS, error {error}")


class SuperLUFactors:
    """The same by SuperLU: `schur`, `reduce` and `expand` of `MumpsFactors`."""

    def __init__(self, matrix: Sparse, keep: IntArray, dense: bool = False) -> None:
        """dense: whether to store what the kept unknowns move, for more right-hand sides."""
        self.keep, self.inside = keep, others(matrix.shape[0], keep)
        self.factors = superlu(matrix[self.inside][:, self.inside].tocsc(), "MMD_AT_PLUS_A")
        self.coupling = matrix[keep][:, self.inside].tocsr()
        #: what the kept unknowns move (n - k, k)
        self.follow: Array | None = None
        if dense:
            self.follow = np.ascontiguousarray(self.factors.solve(self.coupling.T.toarray()))
            schur = matrix[keep][:, keep].toarray() - self.coupling @ self.follow
            self.schur = (schur + schur.T) / 2
        else:
            self.schur = schur_by_superlu(matrix, keep)

    def reduce(self, right: Array) -> Array:
        """See `MumpsFactors`."""
        self._partial = self.factors.solve(right[self.inside])
        return right[self.keep] - self.coupling @ self._partial

    def expand(self, solution: Array) -> Array:
        """See `MumpsFactors`."""
        result = np.zeros(len(self.inside) + len(self.keep))
        moved = (
            self.factors.solve(self.coupling.T @ solution)
            if self.follow is None
            else self.follow @ solution
        )
        result[self.inside] = self._partial - moved
        result[self.keep] = solution
        return result


def unknowns_text(matrix: CsrMatrix | Sparse, keep: IntArray) -> str:
    """The unknowns of a matrix, for messages on memory."""
    return f"{matrix.shape[0]} unknowns, {len(keep)} of them on the joint and the wet faces,"


def partial_factors(
    matrix: Sparse, keep: IntArray, many: bool = False
) -> MumpsFactors | SuperLUFactors:
    """Factors of a symmetric matrix for many right-hand sides, one after the other, with the
    unknowns `keep` not eliminated; the rest must be positive definite. many: thousands of them, for
    which the eliminated unknowns of a small matrix take less time by SuperLU, whose calls take less
    than those of MUMPS, and a dense product with the others; the factors take longer.

    Raises RunError if the estimated memory is not available, MemoryError if an allocation fails.
    """
    what = unknowns_text(matrix, keep)
    check_memory(dense_memory(len(keep)), what)
    mumps = library()
    dense = many and (matrix.shape[0] - len(keep)) * len(keep) <= SMALL
    if mumps is None or dense:
        return SuperLUFactors(matrix, keep, dense)
    return MumpsFactors(mumps, matrix, keep, what)


def schur_complement(matrix: CsrMatrix, keep: IntArray, loads: Array) -> tuple[Array, Array]:
    """Dense Schur complement (k, k) of a symmetric matrix on the k unknowns `keep`, and loads (n,
    m) reduced to them (k, m).

    Raises RunError if the estimated memory is not available, MemoryError if an allocation fails.
    """
    if len(keep) == matrix.shape[0]:  # a body whose nodes all lie on joints and wet faces
        return matrix[keep].columns(keep).toarray(), loads[keep]
    mumps = library()
    if mumps is None:
        from scipy import sparse

        size, k = matrix.shape[0], len(keep)
        keep = np.append(keep, np.arange(size, size + loads.shape[1]))
        schur = schur_by_superlu(bordered(matrix.scipy(), sparse.csr_matrix(loads)), keep)
        return schur[:k, :k], schur[:k, k:]
    what = unknowns_text(matrix, keep)
    check_memory(dense_memory(len(keep)), what)
    factors = MumpsFactors(mumps, matrix, keep, what, loads.nbytes)
    rows, moved = matrix[keep], factors.solve(loads)
    return factors.schur, loads[keep] - np.column_stack([rows @ column for column in moved.T])


def dense_schur(matrix: Sparse, keep: IntArray) -> Array:
    """Dense Schur complement (k, k) of a symmetric matrix on the k unknowns `keep`; the rest must
    be positive definite. No factors are stored.

    Raises RunError if the estimated memory is not available, MemoryError if an allocation fails.
    """
    what = unknowns_text(matrix, keep)
    check_memory(dense_memory(len(keep)), what)
    mumps = library()
    if mumps is None:
        return schur_by_superlu(matrix, keep)
    return MumpsFactors(mumps, matrix, keep, what, store=False).schur


def bordered(matrix: Sparse, loads: Sparse) -> Sparse:
    """A symmetric matrix (n, n) with a border of loads (n, m). Its Schur complement on unknowns of
    the matrix and the border has the loads reduced to those unknowns and, negative, the work of
    each load on the displacements by each other one.
    """
    from scipy import sparse

    return sparse.bmat([[matrix, loads], [loads.T, None]], format="csr")


def superlu(matrix: Sparse, ordering: Literal["NATURAL", "MMD_AT_PLUS_A"]) -> SuperLU:
    """SuperLU factors of a symmetric matrix, pivots on the diagonal."""
    from scipy.sparse.linalg import splu

    return splu(matrix, permc_spec=ordering, diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def schur_by_superlu(matrix: Sparse, keep: IntArray) -> Array:
    """Schur complement (k, k) by SuperLU: the last block of the factors of the matrix with `keep`
    ordered last.

    Five to ten times faster than one solve per kept unknown. The complement itself may be singular
    (a floating body): its diagonal is raised, that of a border of loads lowered, which elimination
    leaves unchanged, and subtracted at the end.
    """
    from scipy import sparse

    inside = others(matrix.shape[0], keep)
    order = np.empty_like(inside)
    order[superlu(matrix[inside][:, inside].tocsc(), "MMD_AT_PLUS_A").perm_c] = inside
    diagonal = matrix.diagonal()
    lowered = matrix[keep][:, inside].power(2) @ (1 / diagonal[inside])
    raised = np.where(diagonal[keep] > 0, diagonal[keep], -lowered)
    added = sparse.diags(np.append(np.zeros(len(inside)), raised))
    order = np.append(order, keep)
    factors = superlu((matrix[order][:, order] + added).tocsc(), "NATURAL")
    rows, columns = factors.perm_r[len(inside) :], factors.perm_c[len(inside) :]
    lower: Sparse = factors.L.tocsr()
    upper: Sparse = factors.U.tocsr()
    schur: Array = lower[rows][:, columns].toarray() @ upper[columns][:, columns].toarray()
    return schur - np.diag(raised)


def solve_symmetric(matrix: CsrMatrix, right: Array) -> Array:
    """Solution (n, m) of a symmetric positive definite system, all right-hand sides at once.

    Raises RunError if the estimated memory is not available.
    """
    mumps = library()
    if mumps is None:
        return superlu(matrix.scipy().tocsc(), "MMD_AT_PLUS_A").solve(right)
    what = f"{matrix.shape[0]} unknowns"
    return MumpsFactors(mumps, matrix, np.zeros(0, int), what, right.nbytes).solve(right)
