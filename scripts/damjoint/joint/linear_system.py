"""Linear systems (S + K) x = r of Newton's method on the joints: S of what is around them, K of
their tangent and of the pressures of flowing water that follow from the jumps.

Either assembled and factorised anew (`DenseSystem`), or by Woodbury's formula (`WoodburySystem`),
from the tangent of the undamaged joints and its change where a joint has opened, broken or slipped:
A = A_0 + L - B P, A_0 = S + K_0 (L: change by the law, on few rows; P: derivative of the pressures
of flowing water; B: their nodal forces). With C = A_0^-1, computed once, A x = r is

    x = C (r - f + B p),    f = L x,    p = P x,

a system of the forces f on the rows of L and the pressures p only. Bordered by one more equation it
stays regular at a limit point of the load, where A is singular.
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, Protocol

import numpy as np
from numpy.linalg import norm

from .. import RunError
from ..arrays import Array, IntArray, distinct, mirror
from ..csr import CsrMatrix, stacked
from ..threads import limited_threads, scipy_linalg
from .assembly import Assembly
from .flow import Flow, FlowDerivative

#: Number of unknowns up to which thousands of systems of one matrix S, few for each time step, are
#: solved faster by factorising each than by Woodbury's formula.
MOST_DENSE = 400
#: The same of any systems.
MOST_WHOLE = 100


@dataclass(frozen=True)
class Tangent:
    """The derivative of the joints' forces at a jump: of the laws at the Gauss points (q, 3, 3),
    and of the pressures of flowing water, and where it flows.
    """

    law: Array
    flow: FlowDerivative | None = None
    flowing: tuple[Flow, ...] = ()


def lift_matrix(flowing: tuple[Flow, ...]) -> CsrMatrix:
    """Nodal forces of the pressures of flowing water (j, p)."""
    return stacked([part.lift.T for part in flowing]).T


@dataclass(frozen=True)
class Border:
    """One more unknown s and equation: A x + slope s = right, row x + rate s = gap."""

    slope: Array
    row: Array
    rate: float
    #: of each right side, where there are several
    gap: float | Array


class Stalled(RunError):
    """The iterative solution of a linear system has stalled."""


class LinearSystem(Protocol):
    """Solves (S + K) x = r for tangents K."""

    def solve(
        self, tangent: Tangent, right: Array, border: Border | None = None
    ) -> tuple[Array, Any]:
        """Solve for right (j,), bordered or not: x, and s, 0 without border. By Woodbury's formula
        also for several right sides (j, k): x (j, k), and s (k,) with a border.

        Raises LinAlgError if the system is singular.
        """
        ...


class DenseSystem:
    """Assembled and factorised anew for each tangent."""

    def __init__(self, assembly: Assembly, stiffness: Array) -> None:
        """stiffness: S (j, j)."""
        self.assembly, self.stiffness = assembly, stiffness
        #: B (j, p), the nodal forces of the pressures of flowing water
        self.lift = lru_cache(maxsize=1)(lift_matrix)

    def solve(
        self, tangent: Tangent, right: Array, border: Border | None = None
    ) -> tuple[Array, Any]:
        """See `LinearSystem`."""
        return solve_whole(self.matrix(tangent), right, border)

    def matrix(self, tangent: Tangent) -> Array:
        """S + K (j, j), by dense products, which are faster for few unknowns."""
        matrix = self.assembly.with_joints(self.stiffness, tangent.law)
        if flow := tangent.flow:
            matrix[:, flow.columns] -= self.lift(tangent.flowing) @ flow.pressure
        return matrix


class WoodburySystem(DenseSystem):
    """By the inverse of the matrix with undamaged joints; the matrix itself is factorised if it has
    very few unknowns, or few and more than half of its rows change.
    """

    def __init__(self, assembly: Assembly, stiffness: Array, undamaged: Array) -> None:
        """stiffness: S (j, j); undamaged: tangent (q, 3, 3) of the undamaged joints."""
        super().__init__(assembly, stiffness)
        self.undamaged = undamaged
        self._by_pressure: tuple[CsrMatrix, Array] | None = None

    @cached_property
    def compliance(self) -> Array:
        """C = A_0^-1 (j, j).

        Raises LinAlgError if A_0 is not positive definite: the joint does not support the dam.
        """
        return positive_inverse(self.matrix(Tangent(self.undamaged)))

    def by_pressure(self, lift: CsrMatrix) -> Array:
        """C B (j, p), the jumps by unit pressures; the last one is kept."""
        if self._by_pressure is None or self._by_pressure[0] is not lift:
            self._by_pressure = lift, np.ascontiguousarray((lift.T @ self.compliance).T)
        return self._by_pressure[1]

    def solve(
        self, tangent: Tangent, right: Array, border: Border | None = None
    ) -> tuple[Array, Any]:
        """See `LinearSystem`."""
        if len(right) <= MOST_WHOLE:
            return super().solve(tangent, right, border)
        compliance, flow = self.compliance, tangent.flow
        law, rows = self.assembly.change(tangent.law, self.undamaged)
        lift = self.lift(tangent.flowing) if flow else None
        m = len(rows)
        size = m + (len(flow.pressure) if flow else 0)
        if len(right) <= FEW and size > len(right) / 2:
            columns = distinct(np.concatenate([law.indices, flow.columns if flow else NO_COLUMNS]))
            if len(columns) <= BY_COLUMNS * len(right):
                return self.solve_columns(law, rows, columns, tangent, right, border)
            return super().solve(tangent, right, border)
        start = compliance @ right
        small = np.zeros((size + (border is not None),) * 2)
        small_right = np.zeros((len(small), *right.shape[1:]))
        touched = distinct(law.indices)
        small[:m, :m] = law.columns(touched) @ compliance[np.ix_(touched, rows)]
        small_right[:m] = law.on_rows(start.T).T
        if flow and lift:
            by_pressure = self.by_pressure(lift)
            small[:m, m:size] = -(law @ by_pressure)
            small[m:size, :m] = flow.pressure @ compliance[np.ix_(flow.columns, rows)]
            small[m:size, m:size] = -(flow.pressure @ by_pressure[flow.columns])
            small_right[m:size] = flow.pressure @ start[flow.columns]
        small[np.arange(size), np.arange(size)] += 1
        if border:
            by_slope, by_row = compliance @ border.slope, compliance @ border.row
            small[:m, size], small[size, :m] = law @ by_slope, -by_row[rows]
            if flow:
                small[m:size, size] = flow.pressure @ by_slope[flow.columns]
                small[size, m:size] = border.row @ by_pressure
            small[size, size] = border.rate - border.row @ by_slope
            small_right[size] = border.gap - border.row @ start
        solution = lu_solve(small, small_right)
        force = np.zeros(right.shape)
        force[rows] = solution[:m]
        x = start - compliance @ force
        if flow:
            x += by_pressure @ solution[m:size]
        if border is None:
            return x, 0.0
        s = solution[size]
        x -= np.multiply.outer(by_slope, s)
        return x, s

    def solve_columns(
        self,
        law: CsrMatrix,
        rows: IntArray,
        columns: IntArray,
        tangent: Tangent,
        right: Array,
        border: Border | None,
    ) -> tuple[Array, Any]:
        """Solve by a system of the unknowns x_c alone on which the change M = L - B P of the matrix
        acts; law: L without its zero rows; columns: those of M that are not zero.

            x = C (r - slope s - M_c x_c)
        """
        compliance, flow, number = self.compliance, tangent.flow, len(columns)
        start = compliance @ right
        small = np.zeros((number + (border is not None),) * 2)
        law = law.columns(columns)
        small[:number, :number] = compliance[np.ix_(columns, rows)] @ law.dense
        if flow:
            lift = self.lift(tangent.flowing)
            by_pressure, place = self.by_pressure(lift), np.searchsorted(columns, flow.columns)
            small[:number, place] -= by_pressure[columns] @ flow.pressure
        small[np.arange(number), np.arange(number)] += 1
        small_right = start[columns]
        if border:
            by_slope, by_row = compliance @ border.slope, compliance @ border.row
            small[:number, number] = by_slope[columns]
            small[number, :number] = -(law.T @ by_row[rows])
            if flow:
                small[number, place] += (border.row @ by_pressure) @ flow.pressure
            small[number, number] = border.rate - border.row @ by_slope
            small_right = with_gap(small_right, border.gap - border.row @ start)
        solution = lu_solve(small, small_right)
        changed = solution[:number]
        force = np.zeros(right.shape)
        force[rows] = law.on_rows(changed.T).T
        x = start - compliance @ force
        if flow:
            x += by_pressure @ (flow.pressure @ changed[place])
        if border is None:
            return x, 0.0
        s = solution[number]
        return x - np.multiply.outer(by_slope, s), s


def many_systems(assembly: Assembly, stiffness: Array, undamaged: Array) -> LinearSystem:
    """What solves the systems of thousands of time steps, few for each, without border;
    see `WoodburySystem`.
    """
    if len(stiffness) <= MOST_DENSE:
        return DenseSystem(assembly, stiffness)
    return WoodburySystem(assembly, stiffness, undamaged)


def solve_whole(matrix: Array, right: Array, border: Border | None) -> tuple[Array, Any]:
    """Solve A x = right (j, ...), bordered or not, by LU; A may be overwritten."""
    if border is None:
        return lu_solve(matrix, right), 0.0
    whole = np.empty((len(right) + 1,) * 2)
    whole[:-1, :-1] = matrix
    # a row of the size of the others, for the choice of the pivots
    scale = max(matrix.max(), -matrix.min()) / (np.abs(border.row).max() or 1)
    whole[:-1, -1] = border.slope
    whole[-1, :-1], whole[-1, -1] = scale * border.row, scale * border.rate
    solution = lu_solve(whole, with_gap(right, scale * border.gap))
    return solution[:-1], solution[-1]


def with_gap(right: Array, gap: float | Array) -> Array:
    """Right sides (j, ...) with a gap (...) as their last row."""
    return np.concatenate([right, np.reshape(gap, (1, *right.shape[1:]))])


def positive_inverse(matrix: Array) -> Array:
    """The inverse of a symmetric positive definite matrix, which may be overwritten.

    Raises LinAlgError if it is not positive definite.
    """
    if len(matrix) <= FEW:
        np.linalg.cholesky(matrix)
        inverse = np.linalg.inv(matrix)
        return np.asarray((inverse + inverse.T) / 2)
    lapack = scipy_linalg().lapack
    with limited_threads(1) if len(matrix) > ONE_THREAD else nullcontext():
        factor, info = lapack.dpotrf(matrix.T, lower=True, overwrite_a=True, clean=False)
    if info:
        raise np.linalg.LinAlgError("not positive definite")
    inverse, _ = lapack.dpotri(factor, lower=True, overwrite_c=True)
    return mirror(inverse).T


#: Number of unknowns above which a Cholesky factorisation runs on one thread: on two, OpenBLAS
#: 0.3.30 ends with a segmentation fault from about 15 000 on.
ONE_THREAD = 10000

#: Number of unknowns up to which numpy inverts a matrix (by LU, three times the operations, but
#: scipy takes longer to load), and A is factorised where more than half of its rows change.
FEW = 600

#: Part of the columns of a small A that change, up to which a system of their unknowns takes less
#: time than the factorisation of A.
BY_COLUMNS = 0.6

#: No columns.
NO_COLUMNS = np.zeros(0, int)

#: Number of unknowns from which on single precision pays: fewer save less than it takes to load
#: scipy.
SINGLE_PRECISION = 450
#: Residual of a refined solution over the right side [-], as by double precision; usually reached
#: by two or three refinements.
REFINED = 1e-12
#: Most refinements, and ...
MOST_REFINEMENTS = 8
#: ... largest ratio of a residual to the one before [-]; usually 1e-5. Beyond either the matrix is
#: too ill-conditioned for single precision, and is factorised again in double precision.
DECAY = 0.1


def lu_solve(matrix: Array, right: Array) -> Array:
    """Solve a linear system by LU for right (j, ...); the matrix may be overwritten.

    With one right side a large matrix is factorised in single precision, twice as fast, and the
    solution refined; in double precision if the refinement does not converge. Raises LinAlgError
    if it is singular.
    """
    if not right.any():
        return np.zeros_like(right)
    if len(right) > SINGLE_PRECISION and right.ndim == 1:
        lapack = scipy_linalg().lapack
        factors, pivots, info = lapack.sgetrf(matrix.T.astype(np.float32), overwrite_a=True)
        solution: Array = np.zeros_like(right)
        residual, size = right, norm(right)
        for _ in range(0 if info else MOST_REFINEMENTS):
            correction = lapack.sgetrs(factors, pivots, residual / size, trans=1)[0]
            solution = solution + size * correction
            residual, before = right - matrix @ solution, size
            size = norm(residual)
            if size <= REFINED * norm(right):
                return solution
            if not size < DECAY * before:
                break
    return np.asarray(np.linalg.solve(matrix, right))
