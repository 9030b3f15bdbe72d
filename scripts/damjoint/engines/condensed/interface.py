"""The joint of condensed bodies, whatever its law, its water and its levels: interpolations, flow
operators, and the linear systems of Newton's method.

The tangent is that of the virgin joint, A_0 = S + K_0, plus what has changed where the joint has
opened, broken or slid: A = A_0 + L - B P (L: the law's change, on few rows; P: the derivative of
flowing water's pressures; B: how they lift). With C = A_0^-1, made once, A x = r reads

    x = C (r - f + B p),    f = L x,    p = P x,

a system of the forces f on the rows of L and the pressures p only (Woodbury). Bordered by one more
equation it stays regular where the load has its peak and A is singular.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg, sparse

from . import elements
from .bulk import Condensed
from .flow import Flow


@dataclass
class Change:
    """L and P, without their zero rows and columns."""

    #: L (rows, j): the law's
    law: sparse.csr_matrix
    rows: np.ndarray
    #: P (p, columns), if water flows
    pressure: np.ndarray | None = None
    columns: np.ndarray | None = None


class Interface:
    """Interpolation matrices of the joint from the unknowns, the jumps of `bulk.free`."""

    def __init__(self, bulk: Condensed) -> None:
        self.bulk, self.dim = bulk, bulk.dim
        space = self.space = elements.Space(bulk.joint, bulk.order)
        self.points = elements.points_of(space, elements.JOINT[bulk.order])
        nodes = len(bulk.joint.points)
        middles = sparse.eye(len(space.place), format="lil")
        for i, (a, b) in enumerate(
            space.edges
        ):  # the middle of an edge: mean of its ends and a quarter of its function
            middles[nodes + i, nodes + i] = 0.25
            middles[nodes + i, a] = middles[nodes + i, b] = 0.5
        #: jump at the law's points and at the nodes (dim rows each: normal, tangent 1, tangent 2)
        self.at_points, self.at_nodes = (
            self._components(self.points.values),
            self._components(middles.tocsr()),
        )
        self.from_points = self.at_points.T.tocsr()
        self.touched = self.from_points != 0
        self.water_points = elements.points_of(space, elements.WATER)
        self.water = self.water_points.values @ self._select(1)
        self.faces = {
            name: elements.points_of(elements.Space(body, bulk.order), elements.WATER)
            for name, body in bulk.faces.items()
        }
        self.heel = self._heel_row()
        self._made_for, self._compliance = None, None

    def _select(self, component: int) -> sparse.csr_matrix:
        """A displacement component of the space's functions, from the unknowns."""
        functions, parts = np.divmod(self.bulk.free, self.dim)
        here = np.flatnonzero(parts == component)
        return sparse.csr_matrix(
            (np.ones(len(here)), (functions[here], here)),
            (len(self.space.place), len(self.bulk.free)),
        )

    def _components(self, values: sparse.csr_matrix) -> sparse.csr_matrix:
        """Interpolation (q, functions) of the jump's components: point by point, from the
        unknowns.
        """
        stacked = sparse.vstack(
            [values @ self._select(c) for c in (1, 0, 2)[: self.dim]], format="csr"
        )
        return stacked[np.arange(stacked.shape[0]).reshape(self.dim, -1).T.ravel()]

    def jumps(self, matrix: sparse.csr_matrix, unknowns: np.ndarray) -> np.ndarray:
        """delta_n, delta_t1, delta_t2 (q, 3) by at_points or at_nodes."""
        return np.pad((matrix @ unknowns).reshape(-1, self.dim), ((0, 0), (0, 3 - self.dim)))

    def forces(self, traction: np.ndarray) -> np.ndarray:
        """Nodal forces of a traction (q, 3) at the law's points."""
        return self.from_points @ (self.points.weights[:, None] * traction[:, : self.dim]).ravel()

    def _heel_row(self) -> np.ndarray:
        """The heel's opening, mean over z, from the unknowns."""
        corners, weights = self.space.body.points, np.zeros(len(self.space.place))
        x = np.abs(corners[:, 0]) < 1e-9 * self.bulk.base
        if self.dim == 2:
            weights[np.flatnonzero(x)] = 1
        else:
            heel = np.flatnonzero(x)
            heel = heel[np.argsort(corners[heel, 2])]
            lengths = np.diff(corners[heel, 2]) / self.bulk.width
            np.add.at(weights, heel[:-1], lengths / 2)
            np.add.at(weights, heel[1:], lengths / 2)
            for i, (a, b) in enumerate(self.space.edges):
                if x[a] and x[b]:
                    weights[len(x) + i] = abs(corners[a, 2] - corners[b, 2]) / self.bulk.width / 6
        functions, parts = np.divmod(self.bulk.free, self.dim)
        return np.where(parts == 1, weights[functions], 0)

    # -- flow
    # ----------------------------------------------------------------------------------------------

    @cached_property
    def flow(self) -> Flow:
        """The operators of water that flows in the joint."""
        return Flow(
            self.bulk, self.space, self.points, self.water_points, self.water, self.at_points
        )

    # -- linear systems
    # ------------------------------------------------------------------------------------

    def stiffness(self, tangent: np.ndarray, points: np.ndarray) -> sparse.csr_matrix:
        """Stiffness (j, j) of the joint that some of the law's points add with a tangent (points,
        3, 3).
        """
        number, d = len(points), self.dim
        if not number:
            return sparse.csr_matrix((len(self.bulk.free),) * 2)
        here = self.at_points[(d * points[:, None] + np.arange(d)).ravel()]
        blocks = self.points.weights[points, None, None] * tangent[:, :d, :d]
        return (
            here.T
            @ (
                sparse.bsr_matrix(
                    (blocks, np.arange(number), np.arange(number + 1)), (d * number,) * 2
                )
                @ here
            )
        ).tocsr()

    def compliance(self, virgin: np.ndarray) -> np.ndarray:
        """C = (S + K_0)^-1 (j, j) for a tangent (3, 3) that all points have; the last one is
        kept.
        """
        if self._made_for is None or not np.array_equal(virgin, self._made_for):
            number = len(self.points.weights)
            matrix = (
                self.bulk.stiffness
                + self.stiffness(
                    np.broadcast_to(virgin, (number, 3, 3)), np.arange(number)
                ).toarray()
            )
            factor, info = linalg.lapack.dpotrf(matrix.T, lower=True, overwrite_a=True, clean=False)
            if info:
                raise linalg.LinAlgError("the joint does not hold the dam")
            inverse, _ = linalg.lapack.dpotri(factor, lower=True, overwrite_c=True)
            self._compliance, self._made_for = np.tril(inverse) + np.tril(inverse, -1).T, virgin
            self.__dict__.pop("lifted", None)
        return self._compliance

    @cached_property
    def lifted(self) -> np.ndarray:
        """C B (j, p), of the compliance last asked for."""
        return np.ascontiguousarray((self.flow.lift.T @ self._compliance).T)

    def change(self, tangent: np.ndarray, virgin: np.ndarray) -> Change:
        """The law's change for a tangent (q, 3, 3)."""
        differs = (tangent != virgin).any(axis=2)[:, : self.dim]  # rows: components of the traction
        points, rows = (
            np.flatnonzero(differs.any(axis=1)),
            np.flatnonzero(self.touched @ differs.ravel()),
        )
        return Change(self.stiffness(tangent[points] - virgin, points)[rows], rows)

    def solve(
        self, virgin: np.ndarray, change: Change, right: np.ndarray, border: tuple | None
    ) -> tuple[np.ndarray, float]:
        """x (j,) and s of A x + slope s = right and, with a border (slope, row, rate, gap), row x +
        rate s = gap.

        Raises LinAlgError if the system is singular.
        """
        compliance, law, rows, columns = (
            self.compliance(virgin),
            change.law,
            change.rows,
            change.columns,
        )
        m, start = len(rows), compliance @ right
        size = m + (0 if columns is None else len(change.pressure))
        small = np.zeros((size + (border is not None),) * 2)
        wanted = np.zeros(len(small))
        touched = np.unique(law.indices)
        small[:m, :m] = law[:, touched] @ compliance[np.ix_(touched, rows)]
        wanted[:m] = law @ start
        if columns is not None:
            small[:m, m:size] = -(law @ self.lifted)
            small[m:size, :m] = change.pressure @ compliance[np.ix_(columns, rows)]
            small[m:size, m:size] = -(change.pressure @ self.lifted[columns])
            wanted[m:size] = change.pressure @ start[columns]
        small[np.arange(size), np.arange(size)] += 1
        if border is not None:
            slope, row, rate, gap = border
            along, across = compliance @ slope, compliance @ row
            small[:m, size], small[size, :m] = law @ along, -across[rows]
            if columns is not None:
                small[m:size, size], small[size, m:size] = (
                    change.pressure @ along[columns],
                    row @ self.lifted,
                )
            small[size, size], wanted[size] = rate - row @ along, gap - row @ start
        found = lu_solve(small, wanted)
        force = np.zeros(len(right))
        force[rows] = found[:m]
        x, s = start - compliance @ force, found[size] if border is not None else 0.0
        if columns is not None:
            x += self.lifted @ found[m:size]
        if border is not None:
            x -= s * along
        return x, s


def lu_solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solution by LU, the matrix overwritten or not.

    Raises LinAlgError if it is singular.     A large matrix is factorised in single precision,
    twice as fast, and the solution refined; in double precision     where that does not converge.
    """
    if not right.any():
        return np.zeros_like(right)
    if len(right) > 300:
        factors, pivots, info = linalg.lapack.sgetrf(matrix.T.astype(np.float32), overwrite_a=True)
        found, left, size = np.zeros_like(right), right, np.linalg.norm(right)
        for _ in range(0 if info else 8):
            correction = linalg.lapack.sgetrs(factors, pivots, left / size, trans=1)[0]
            found = found + size * correction
            left, before = right - matrix @ found, size
            size = np.linalg.norm(left)
            if size <= 1e-12 * np.linalg.norm(right):
                return found
            if not size < 0.1 * before:
                break
    factors, pivots, info = linalg.lapack.dgetrf(matrix.T, overwrite_a=True)
    if info:
        raise linalg.LinAlgError("singular matrix")
    return linalg.lapack.dgetrs(factors, pivots, right, trans=1)[0]
