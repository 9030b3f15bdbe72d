"""Water that flows in the joint: the pressure for a given opening, and its derivatives."""

from __future__ import annotations

import numpy as np
from scipy import linalg, sparse

from . import elements
from .bulk import Condensed


def scaled(matrix: sparse.csr_matrix, weights: np.ndarray) -> sparse.csr_matrix:
    """Diag(weights) matrix."""
    return sparse.csr_matrix(
        (matrix.data * np.repeat(weights, np.diff(matrix.indptr)), matrix.indices, matrix.indptr),
        matrix.shape,
    )


class Flow:
    """Water that flows in the joint: pressure beyond the linear one, unknown at the nodes between
    heel and toe.

    q = -rho w^3/(12 visc) grad p (cubic law), div q = 0; the conductivities may have any common
    factor.
    """

    def __init__(
        self,
        bulk: Condensed,
        joint: elements.Space,
        points: elements.Points,
        water_points: elements.Points,
        water: sparse.csr_matrix,
        at_points: sparse.csr_matrix,
    ) -> None:
        """Joint: the displacement's functions; points, water_points: of the law, of the water's
        force; water: its lever on the unknowns; at_points: the jump at the law's points.
        """
        space = elements.Space(bulk.joint, 1)
        self.points, self.nodes = points, len(bulk.joint.points)
        x, number = bulk.joint.points[:, 0], len(bulk.joint.points)
        self.dim, self.base = bulk.dim, bulk.base
        self.inside = np.flatnonzero((x > 1e-9 * bulk.base) & (x < bulk.base * (1 - 1e-9)))
        at = elements.points_of(space, elements.JOINT[bulk.order], gradients=True)
        #: pressure at the law's points, its slopes along x and z, and pressure at the space's
        #: nodes, from that at the corners
        self.values, self.slopes = at.values, at.gradients[: bulk.dim - 1]
        edges = joint.edges
        ends = sparse.csr_matrix(
            (np.full(2 * len(edges), 0.5), (np.repeat(np.arange(len(edges)), 2), edges.ravel())),
            (len(edges), number),
        )
        self.at_nodes = sparse.vstack([sparse.eye(number), ends], format="csr")
        self.at_water = elements.points_of(space, elements.WATER).values
        #: nodal forces of the pressure at the inner nodes
        self.lift = (water.T @ scaled(self.at_water[:, self.inside], water_points.weights)).tocsr()
        self.opening = at_points[:: bulk.dim]
        self.inner_slopes = [g[:, self.inside] for g in self.slopes]
        if bulk.dim == 2:
            order = np.argsort(x[self.inside])
            self.inside_x = x[self.inside][order]
            self.back = np.argsort(order)  # from the order of x to that of `inside`
            self.along = np.argsort(x[bulk.joint.cells[0][1]].mean(axis=1))
            self.lengths = np.bincount(points.elements, points.weights)
        else:
            # the flow matrix is linear in the conductivities: where each point's products of slopes
            # go
            gx, gz = self.slopes
            self.products, self.places = [], []
            for width in np.unique(np.diff(gx.indptr)):
                rows = np.flatnonzero(np.diff(gx.indptr) == width)
                entries = gx.indptr[rows][:, None] + np.arange(width)
                place = gx.indices[entries]
                product = sum(
                    g.data[entries][:, :, None] * g.data[entries][:, None, :] for g in (gx, gz)
                )
                self.products.append((rows, product))
                self.places.append((number * place[:, :, None] + place[:, None, :]).ravel())
            self.places = np.concatenate(self.places)

    def solve(self, conductivity: np.ndarray, drop: float) -> tuple[np.ndarray, object]:
        """Pressure [Pa] beyond the linear one at the inner nodes, for conductivities times weights
        (q,) and a pressure drop from heel to toe [Pa]; and what `sensitivity` wants to know of the
        solution.
        """
        return (self._in_series if self.dim == 2 else self._in_the_plane)(conductivity, drop)

    def _in_series(self, conductivity: np.ndarray, drop: float) -> tuple[np.ndarray, object]:
        """2D: the elements are resistances in series.

        No differences of nearly equal numbers, however far the conductivities lie apart (a
        factorised matrix loses the closed joint beside the open one).
        """
        resistance = self.lengths**2 / np.bincount(self.points.elements, conductivity)
        ahead = np.zeros(len(resistance) + 1)  # from the heel to each node, in order of x
        np.cumsum(resistance[self.along], out=ahead[1:])
        behind = np.zeros_like(ahead)
        behind[:-1] = np.cumsum(resistance[self.along][::-1])[::-1]
        total, left, right = ahead[-1], ahead[1:-1], behind[1:-1]
        per_drop = (right / total - (1 - self.inside_x / self.base))[self.back]
        gradient = (-drop / total * resistance / self.lengths)[self.points.elements]
        return drop * per_drop, (left, right, total, [gradient], per_drop)

    def _in_the_plane(self, conductivity: np.ndarray, drop: float) -> tuple[np.ndarray, object]:
        """3D: one symmetric positive definite system; not a number where the conductivities lie too
        far apart for it.
        """
        number = self.nodes
        values = np.concatenate(
            [
                (conductivity[rows][:, None, None] * product).ravel()
                for rows, product in self.products
            ]
        )
        matrix = np.bincount(self.places, values, number**2).reshape(number, number)[
            np.ix_(self.inside, self.inside)
        ]
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

    def sensitivity(
        self, solution: object, rate: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The pressure's derivatives: with the unknowns that matter (p, m), which these are (m,),
        and with the drop (p,).

        rate (q,): how the conductivities times weights grow with the opening.
        """
        *system, gradients, per_drop = solution
        points = np.flatnonzero(rate)
        opening = self.opening[points]
        columns = np.unique(opening.indices)
        coupling = sum(
            g[points].T @ scaled(opening, rate[points] * d[points])
            for g, d in zip(self.inner_slopes, gradients, strict=True)
        )[:, columns].toarray()
        if self.dim == 2:
            left, right, total = system
            green = (
                np.minimum.outer(left, left) * np.minimum.outer(right, right) / total
            )  # the inverse of the flow matrix
            return -green[np.ix_(self.back, self.back)] @ coupling, columns, per_drop
        return -linalg.cho_solve(system[0], coupling), columns, per_drop

    def flux(
        self,
        conductivity: np.ndarray,
        pressure: np.ndarray,
        steepness: float,
        columns: float,
        width: float,
    ) -> tuple[np.ndarray, float]:
        """Mass flux along x: mean of each joint element [kg/(m s)], and out of the toe per metre of
        thickness.

        conductivity: rho w^3/(12 visc) at the law's points; pressure: beyond the linear one at the
        inner nodes; steepness: slope of the linear one [Pa/m]; columns: of elements from heel to
        toe; width: along z [m].
        """
        points = self.points
        if self.dim == 2:  # the same in every element: the drop over the resistances in series
            total = np.sum(
                self.lengths**2 / np.bincount(points.elements, points.weights * conductivity)
            )
            flux = -steepness * self.base / total
            return np.full(len(self.lengths), flux), flux
        q = -conductivity * (self.inner_slopes[0] @ pressure + steepness)
        means = np.bincount(points.elements, points.weights * q) / np.bincount(
            points.elements, points.weights
        )
        last = points.positions[:, 0] > self.base - self.base / columns
        return means, float(np.sum((points.weights * q)[last]) * columns / self.base / width)
