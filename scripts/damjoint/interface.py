"""The joint of condensed bodies, whatever its law, its water and its levels: interpolations, flow operators, and the
linear systems of Newton's method.

The tangent is that of the virgin joint, A_0 = S + K_0, plus a change U at the points that have opened, broken or
slid, U = L - B p' (L: the law's; B: how the water lifts; p': the pressure's derivative). With C = A_0^-1, made once,

    (A_0 + U) x = r    <=>    (1 + C U) x = C r,

of which only the m unknowns that U acts on are coupled: an (m, m) system instead of a (j, j) one (Woodbury), in a
bordered form that stays regular where the load has its peak and A_0 + U is singular.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg, sparse

from . import fem
from .condense import Condensed


@dataclass
class Change:
    """U, without its zero columns: U x = scatter(local y) - lift (pressure y), y = x[active]."""

    #: (m,) unknowns
    active: np.ndarray
    #: the law's change (m, m); its rows are the active unknowns, too
    local: sparse.csr_matrix
    #: p', derivative of the inner pressures (p, m), of flowing water
    pressure: np.ndarray | None = None


class Interface:
    """Interpolation matrices of the joint from the unknowns, the jumps of `bulk.free`."""

    def __init__(self, bulk: Condensed) -> None:
        self.bulk, self.dim = bulk, bulk.dim
        space = self.space = fem.Space(bulk.joint, bulk.order)
        self.points = fem.points_of(space, fem.JOINT[bulk.order])
        nodes = len(bulk.joint.points)
        middles = sparse.eye(len(space.place), format="lil")
        for i, (a, b) in enumerate(space.edges):  # the middle of an edge: mean of its ends and a quarter of its function
            middles[nodes + i, nodes + i] = 0.25
            middles[nodes + i, a] = middles[nodes + i, b] = 0.5
        #: jump at the law's points and at the nodes (dim rows each: normal, tangent 1, tangent 2)
        self.at_points, self.at_nodes = self._components(self.points.values), self._components(middles.tocsr())
        self.touched = (self.at_points != 0).tocsc()
        self.water_points = fem.points_of(space, fem.WATER)
        self.water = self.water_points.values @ self._select(1)
        self.faces = {name: fem.points_of(fem.Space(body, bulk.order), fem.WATER) for name, body in bulk.faces.items()}
        self.heel = self._heel_row()
        self._made_for, self._compliance = None, None

    def _select(self, component: int) -> sparse.csr_matrix:
        """A displacement component of the space's functions, from the unknowns."""
        functions, parts = np.divmod(self.bulk.free, self.dim)
        here = np.flatnonzero(parts == component)
        return sparse.csr_matrix((np.ones(len(here)), (functions[here], here)), (len(self.space.place), len(self.bulk.free)))

    def _components(self, values: sparse.csr_matrix) -> sparse.csr_matrix:
        """Interpolation (q, functions) of the jump's components: point by point, from the unknowns."""
        stacked = sparse.vstack([values @ self._select(c) for c in (1, 0, 2)[: self.dim]], format="csr")
        return stacked[np.arange(stacked.shape[0]).reshape(self.dim, -1).T.ravel()]

    def jumps(self, matrix: sparse.csr_matrix, unknowns: np.ndarray) -> np.ndarray:
        """delta_n, delta_t1, delta_t2 (q, 3) by at_points or at_nodes."""
        return np.pad((matrix @ unknowns).reshape(-1, self.dim), ((0, 0), (0, 3 - self.dim)))

    def forces(self, traction: np.ndarray) -> np.ndarray:
        """Nodal forces of a traction (q, 3) at the law's points."""
        return self.at_points.T @ (self.points.weights[:, None] * traction[:, : self.dim]).ravel()

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

    # -- flow ----------------------------------------------------------------------------------------------

    @cached_property
    def flow(self) -> Flow:
        """The operators of water that flows in the joint."""
        return Flow(self)

    # -- linear systems ------------------------------------------------------------------------------------

    def stiffness(self, tangent: np.ndarray, points: np.ndarray, unknowns: np.ndarray) -> sparse.csr_matrix:
        """Stiffness of the joint at some of the law's points with a tangent (points, 3, 3), for the unknowns they touch."""
        number, d = len(points), self.dim
        if not number:
            return sparse.csr_matrix((len(unknowns), len(unknowns)))
        here = self.at_points[(d * points[:, None] + np.arange(d)).ravel()][:, unknowns]
        blocks = self.points.weights[points, None, None] * tangent[:, :d, :d]
        return (here.T @ (sparse.bsr_matrix((blocks, np.arange(number), np.arange(number + 1)), (d * number,) * 2) @ here)).tocsr()

    def compliance(self, virgin: np.ndarray) -> np.ndarray:
        """C = (S + K_0)^-1 (j, j) for a tangent (3, 3) that all points have; the last one is kept."""
        if self._made_for is None or not np.array_equal(virgin, self._made_for):
            number = len(self.points.weights)
            everything = self.stiffness(np.broadcast_to(virgin, (number, 3, 3)), np.arange(number), np.arange(len(self.bulk.free)))
            matrix = self.bulk.stiffness + everything.toarray()
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

    def change(self, tangent: np.ndarray, virgin: np.ndarray, also: np.ndarray | None = None) -> tuple[Change, np.ndarray]:
        """The law's part of U for a tangent (q, 3, 3); the unknowns of the points `also` (q,) are active as well."""
        differs = (tangent != virgin).any(axis=(1, 2))
        touching = differs if also is None else differs | also
        active = np.flatnonzero(self.touched.T @ np.repeat(touching, self.dim))
        points = np.flatnonzero(differs)
        return Change(active, self.stiffness(tangent[points] - virgin, points, active))

    def solve(self, virgin: np.ndarray, change: Change, right: np.ndarray, border: tuple | None) -> tuple[np.ndarray, float]:
        """x (j,) and s of A x + slope s = right and, with a border (slope, row, rate, gap), row x + rate s = gap.

        Raises LinAlgError if the system is singular.
        """
        compliance, active, local, p = self.compliance(virgin), change.active, change.local, change.pressure
        m = len(active)
        start = compliance @ right
        small = np.zeros((m + (border is not None),) * 2)
        small[:m, :m] = (local.T @ compliance[np.ix_(active, active)]).T
        if p is not None:
            small[:m, :m] -= self.lifted[active] @ p
        small[np.arange(m), np.arange(m)] += 1
        wanted = start[active]
        if border is not None:
            slope, row, rate, gap = border
            along, across = compliance @ slope, compliance @ row
            small[:m, m] = along[active]
            small[m, :m] = -(local.T @ across[active])
            if p is not None:
                small[m, :m] += (row @ self.lifted) @ p
            small[m, m] = rate - row @ along
            wanted = np.append(wanted, gap - row @ start)
        found = lu_solve(small, wanted)
        y, s = (found, 0.0) if border is None else (found[:-1], found[-1])
        force = np.zeros(len(right))
        force[active] = local @ y
        x = start - compliance @ force
        if p is not None:
            x += self.lifted @ (p @ y)
        if border is not None:
            x -= s * along
        return x, s


def lu_solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Dense LU, the matrix overwritten. Raises LinAlgError if it is singular."""
    if not len(right):
        return right
    factors, pivots, info = linalg.lapack.dgetrf(matrix.T, overwrite_a=True)
    if info:
        raise linalg.LinAlgError("singular matrix")
    return linalg.lapack.dgetrs(factors, pivots, right, trans=1)[0]


class Flow:
    """Water that flows in the joint: pressure beyond the linear one, unknown at the nodes between heel and toe.

    q = -rho w^3/(12 visc) grad p (cubic law), div q = 0; the conductivities may have any common factor.
    """

    def __init__(self, interface: Interface) -> None:
        bulk, self.interface = interface.bulk, interface
        space, points = fem.Space(bulk.joint, 1), interface.points
        x, number = bulk.joint.points[:, 0], len(bulk.joint.points)
        self.dim, self.base = bulk.dim, bulk.base
        self.inside = np.flatnonzero((x > 1e-9 * bulk.base) & (x < bulk.base * (1 - 1e-9)))
        at = fem.points_of(space, fem.JOINT[bulk.order], gradients=True)
        #: pressure at the law's points, its slopes along x and z, and pressure at the space's nodes, from that at the corners
        self.values, self.slopes = at.values, at.gradients[: bulk.dim - 1]
        edges = interface.space.edges
        ends = sparse.csr_matrix((np.full(2 * len(edges), 0.5), (np.repeat(np.arange(len(edges)), 2), edges.ravel())), (len(edges), number))
        self.at_nodes = sparse.vstack([sparse.eye(number), ends], format="csr")
        water = fem.points_of(space, fem.WATER).values[:, self.inside]
        #: nodal forces of the pressure at the inner nodes
        self.lift = (interface.water.T @ sparse.diags(interface.water_points.weights) @ water).tocsr()
        self.opening = interface.at_points[:: bulk.dim]
        self.inner_slopes = [g[:, self.inside] for g in self.slopes]
        if bulk.dim == 2:
            order = np.argsort(x[self.inside])
            self.inside_x = x[self.inside][order]
            self.back = np.argsort(order)  # from the order of x to that of `inside`
            self.along = np.argsort(x[bulk.joint.cells[0][1]].mean(axis=1))
            self.lengths = np.bincount(points.elements, points.weights)
        else:
            # the flow matrix is linear in the conductivities: where each point's products of slopes go
            gx, gz = self.slopes
            self.products, self.places = [], []
            for width in np.unique(np.diff(gx.indptr)):
                rows = np.flatnonzero(np.diff(gx.indptr) == width)
                entries = gx.indptr[rows][:, None] + np.arange(width)
                place = gx.indices[entries]
                product = sum(g.data[entries][:, :, None] * g.data[entries][:, None, :] for g in (gx, gz))
                self.products.append((rows, product))
                self.places.append((number * place[:, :, None] + place[:, None, :]).ravel())
            self.places = np.concatenate(self.places)

    def solve(self, conductivity: np.ndarray, drop: float) -> tuple[np.ndarray, object]:
        """Pressure [Pa] beyond the linear one at the inner nodes, for conductivities times weights (q,) and a pressure
        drop from heel to toe [Pa]; and what `sensitivity` wants to know of the solution.
        """
        return (self._in_series if self.dim == 2 else self._in_the_plane)(conductivity, drop)

    def _in_series(self, conductivity: np.ndarray, drop: float) -> tuple[np.ndarray, object]:
        """2D: the elements are resistances in series. No differences of nearly equal numbers, however far the
        conductivities lie apart (a factorised matrix loses the closed joint beside the open one).
        """
        resistance = self.lengths**2 / np.bincount(self.interface.points.elements, conductivity)
        ahead = np.zeros(len(resistance) + 1)  # from the heel to each node, in order of x
        np.cumsum(resistance[self.along], out=ahead[1:])
        behind = np.zeros_like(ahead)
        behind[:-1] = np.cumsum(resistance[self.along][::-1])[::-1]
        total, left, right = ahead[-1], ahead[1:-1], behind[1:-1]
        per_drop = (right / total - (1 - self.inside_x / self.base))[self.back]
        gradient = (-drop / total * resistance / self.lengths)[self.interface.points.elements]
        return drop * per_drop, (left, right, total, [gradient], per_drop)

    def _in_the_plane(self, conductivity: np.ndarray, drop: float) -> tuple[np.ndarray, object]:
        """3D: one symmetric positive definite system; not a number where the conductivities lie too far apart for it."""
        number = len(self.interface.bulk.joint.points)
        values = np.concatenate([(conductivity[rows][:, None, None] * product).ravel() for rows, product in self.products])
        matrix = np.bincount(self.places, values, number**2).reshape(number, number)[np.ix_(self.inside, self.inside)]
        try:
            factor = linalg.cho_factor(matrix)
        except (linalg.LinAlgError, ValueError):
            nothing = np.full(len(self.inside), np.nan)
            return nothing, None
        per_drop = linalg.cho_solve(factor, self.inner_slopes[0].T @ (conductivity / self.base))
        pressure = drop * per_drop
        gradient = [g @ pressure for g in self.inner_slopes]
        gradient[0] = gradient[0] - drop / self.base
        return pressure, (factor, gradient, per_drop)

    def sensitivity(self, solution: object, rate: np.ndarray, active: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The pressure's derivatives: (p, m) with the active unknowns and (p,) with the drop.

        rate (q,): how the conductivities times weights grow with the opening.
        """
        *system, gradients, per_drop = solution
        points = np.flatnonzero(rate)
        opening = self.opening[points][:, active]
        coupling = sum(g[points].T @ (sparse.diags(rate[points] * d[points]) @ opening)
                       for g, d in zip(self.inner_slopes, gradients, strict=True)).toarray()
        if self.dim == 2:
            left, right, total = system
            green = np.minimum.outer(left, left) * np.minimum.outer(right, right) / total  # the inverse of the flow matrix
            return -green[np.ix_(self.back, self.back)] @ coupling, per_drop
        return -linalg.cho_solve(system[0], coupling), per_drop
