"""Water that flows in the joint: the pressure for a given opening, and its derivatives."""

from __future__ import annotations

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import splu

from . import elements
from .bulk import Condensed


def scaled(matrix: sparse.csr_matrix, weights: np.ndarray) -> sparse.csr_matrix:
    """Diag(weights) matrix."""
    return sparse.csr_matrix(
        (matrix.data * np.repeat(weights, np.diff(matrix.indptr)), matrix.indices, matrix.indptr),
        matrix.shape,
    )


class Along:
    """Scalar fields of order 1 on the joint, and the way of the water from heel to toe.

    way: at the nodes, 0 at the heel, 1 at the toe, and harmonic in between: in the plane the
    distance along the joint over its length. heel_y, toe_y: height [m] of the heel and of the toe
    that a node lies between: harmonic, too, and nothing else where they are level.
    """

    def __init__(self, bulk: Condensed, joint: elements.Space) -> None:
        space = elements.Space(bulk.joint, 1)
        number = len(bulk.joint.points)
        at = elements.points_of(space, elements.JOINT[bulk.order], gradients=True)
        self.bulk, self.dim, self.nodes = bulk, bulk.dim, number
        #: fields at the law's points, their slopes there along x, y, z, and fields at the water's
        #: points and at all places, from their values at the nodes
        self.at_points = at.values
        self.slopes = [g for g in at.gradients[: bulk.dim] if np.abs(g.data).max() > 1e-12]
        self.at_water = elements.points_of(space, elements.WATER).values
        edges = joint.edges
        ends = sparse.csr_matrix(
            (np.full(2 * len(edges), 0.5), (np.repeat(np.arange(len(edges)), 2), edges.ravel())),
            (len(edges), number),
        )
        self.at_places = sparse.vstack([sparse.eye(number), ends], format="csr")
        laplace = sum(g.T @ scaled(g, at.weights) for g in self.slopes).tocsc()
        self.ends = np.concatenate([bulk.heel, bulk.toe])
        self.inside = np.setdiff1d(np.arange(number), self.ends)
        y = bulk.joint.points[:, 1]
        self.way = harmonic(laplace, self.ends, 1.0 * np.isin(self.ends, bulk.toe))
        self.heel_y, self.toe_y = (
            np.full(number, y[nodes[0]])
            if np.ptp(y[nodes]) < 1e-9 * np.abs(bulk.joint.points).max()
            else harmonic(laplace, nodes, y[nodes])
            for nodes in (bulk.heel, bulk.toe)
        )


def harmonic(laplace: sparse.csc_matrix, fixed: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The harmonic field (n,) with these values at fixed nodes."""
    field = np.zeros(laplace.shape[0])
    field[fixed] = values
    free = np.setdiff1d(np.arange(len(field)), fixed)
    if len(free):
        field[free] = splu(laplace[free][:, free]).solve(-laplace[free][:, fixed] @ values)
    return field


class Flow:
    """Water that flows in the joint: pressure beyond the one imposed, unknown at the nodes between
    heel and toe.

    q = -rho w^3/(12 visc) grad (p + rho g y) (cubic law), div q = 0; the conductivities may have
    any common factor.
    """

    def __init__(
        self,
        along: Along,
        points: elements.Points,
        water_points: elements.Points,
        water: sparse.csr_matrix,
        at_points: sparse.csr_matrix,
    ) -> None:
        """Points, water_points: of the law, of the water's force; water: its lever on the unknowns;
        at_points: the jump at the law's points.
        """
        self.along, self.points, self.dim = along, points, along.dim
        self.inside, number = along.inside, along.nodes
        #: nodal forces of the pressure at the inner nodes
        self.lift = (water.T @ scaled(along.at_water[:, self.inside], water_points.weights)).tocsr()
        self.opening = at_points[:: along.dim]
        self.inner_slopes = [g[:, self.inside] for g in along.slopes]
        way = along.way
        if along.dim == 2:
            order = np.argsort(way[self.inside])
            self.inside_way = way[self.inside][order]
            self.back = np.argsort(order)  # from the order of the way to that of `inside`
            self.order = np.argsort(way[along.bulk.joint.cells[0][1]].mean(axis=1))
            self.lengths = np.bincount(points.elements, points.weights)
        else:
            # the flow matrix is linear in the conductivities: where each point's products of slopes
            # go
            self.products, self.places = [], []
            pattern = along.at_points
            for width in np.unique(np.diff(pattern.indptr)):
                rows = np.flatnonzero(np.diff(pattern.indptr) == width)
                entries = pattern.indptr[rows][:, None] + np.arange(width)
                place = pattern.indices[entries]
                product = sum(
                    g.data[entries][:, :, None] * g.data[entries][:, None, :] for g in along.slopes
                )
                self.products.append((rows, product))
                self.places.append((number * place[:, :, None] + place[:, None, :]).ravel())
            self.places = np.concatenate(self.places)

    def solve(self, conductivity: np.ndarray, imposed: np.ndarray) -> tuple[np.ndarray, object]:
        """Pressure [Pa] beyond the one imposed at the inner nodes, for conductivities times weights
        (q,) and the imposed head times the water's weight at the nodes [Pa]; and what `sensitivity`
        wants to know of the solution.
        """
        return (self._in_series if self.dim == 2 else self._in_the_plane)(conductivity, imposed)

    def drop(self, imposed: np.ndarray) -> float:
        """From heel to toe [Pa], where both are level."""
        return imposed[self.along.bulk.heel[0]] - imposed[self.along.bulk.toe[0]]

    def _in_series(self, conductivity: np.ndarray, imposed: np.ndarray) -> tuple:
        """2D: the elements are resistances in series.

        No differences of nearly equal numbers, however far the conductivities lie apart (a
        factorised matrix loses the closed joint beside the open one).
        """
        drop = self.drop(imposed)
        resistance = self.lengths**2 / np.bincount(self.points.elements, conductivity)
        ahead = np.zeros(len(resistance) + 1)  # from the heel to each node, in order of x
        np.cumsum(resistance[self.order], out=ahead[1:])
        behind = np.zeros_like(ahead)
        behind[:-1] = np.cumsum(resistance[self.order][::-1])[::-1]
        total, left, right = ahead[-1], ahead[1:-1], behind[1:-1]
        per_drop = (right / total - (1 - self.inside_way))[self.back]
        steepness = (-drop / total * resistance / self.lengths)[self.points.elements]
        # along the element, from heel to toe
        towards = [g @ self.along.way for g in self.along.slopes]
        size = np.sqrt(sum(t**2 for t in towards))
        gradients = [steepness * t / size for t in towards]
        return drop * per_drop, (left, right, total, gradients)

    def _in_the_plane(self, conductivity: np.ndarray, imposed: np.ndarray) -> tuple:
        """3D: one symmetric positive definite system; not a number where the conductivities lie too
        far apart for it.
        """
        number = self.along.nodes
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
            return np.full(len(self.inside), np.nan), None
        before = [g @ imposed for g in self.along.slopes]
        right = sum(
            g.T @ (conductivity * b) for g, b in zip(self.inner_slopes, before, strict=True)
        )
        pressure = -linalg.cho_solve(factor, right)
        gradients = [g @ pressure + b for g, b in zip(self.inner_slopes, before, strict=True)]
        return pressure, (factor, gradients)

    def sensitivity(self, solution: object, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The pressure's derivatives with the unknowns that matter (p, m), and which these are
        (m,).

        rate (q,): how the conductivities times weights grow with the opening.
        """
        *system, gradients = solution
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
            return -green[np.ix_(self.back, self.back)] @ coupling, columns
        return -linalg.cho_solve(system[0], coupling), columns

    def flux(
        self, conductivity: np.ndarray, pressure: np.ndarray, imposed: np.ndarray, width: float
    ) -> tuple[np.ndarray, float]:
        """Mass flux towards the toe: mean of each joint element [kg/(m s)], and out of the toe per
        metre of thickness.

        conductivity: rho w^3/(12 visc) at the law's points; pressure: beyond the imposed one at the
        inner nodes; imposed: head times the water's weight at the nodes [Pa]; width: along z [m].
        """
        points = self.points
        if self.dim == 2:  # the same in every element: the drop over the resistances in series
            total = np.sum(
                self.lengths**2 / np.bincount(points.elements, points.weights * conductivity)
            )
            flux = self.drop(imposed) / total
            return np.full(len(self.lengths), flux), flux
        whole = imposed.copy()
        whole[self.inside] += pressure
        towards = [g @ self.along.way for g in self.along.slopes]
        q = -conductivity * sum(
            (g @ whole) * t for g, t in zip(self.along.slopes, towards, strict=True)
        )
        # the flow's own test function: 1 at the toe, 0 at the heel
        out = float(points.weights @ q / width)
        size = np.sqrt(sum(t**2 for t in towards))
        means = np.bincount(points.elements, points.weights * q / size)
        return means / np.bincount(points.elements, points.weights), out
