"""Water that flows in the joint: the pressure for a given opening, and its derivatives."""

from __future__ import annotations

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import splu

from ..fem import elements
from ..fem.condensation import Condensed


def scaled(matrix: sparse.csr_matrix, weights: np.ndarray) -> sparse.csr_matrix:
    """Diag(weights) matrix."""
    return sparse.csr_matrix(
        (matrix.data * np.repeat(weights, np.diff(matrix.indptr)), matrix.indices, matrix.indptr),
        matrix.shape,
    )


#: No drains.
NOWHERE = np.zeros(0, int)


class Along:
    """Scalar fields of order 1 on the joint, and the way of the water from heel to toe.

    way: at the nodes, 0 at the heel, 1 at the toe, and harmonic in between: in the plane the
    distance along the joint over its length. heel_y, toe_y: height [m] of the heel and of the toe
    that a node lies between: harmonic, too, and nothing else where they are level.
    """

    def __init__(self, bulk: Condensed, joint: elements.Space, rule: dict[str, int]) -> None:
        space = elements.Space(bulk.joint, 1)
        number = len(bulk.joint.points)
        at = elements.points_of(space, rule, gradients=True)
        self.bulk, self.dim, self.nodes = bulk, bulk.dim, number
        #: fields at the law's points, their slopes there along x, y, z, and fields at the water's
        #: points and at all places, from their values at the nodes
        self.at_points = at.values
        self.slopes = [g for g in at.gradients[: bulk.dim] if np.abs(g.data).max() > 1e-12]
        self.at_water = elements.points_of(space, elements.WATER).values
        self.at_places = joint.at_places(1)
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
        slopes = [g @ along.way for g in along.slopes]
        size = np.sqrt(sum(t**2 for t in slopes))
        #: unit vectors towards the toe at the law's points
        self.towards = [t / size for t in slopes]
        if along.dim == 2:
            #: the elements and the nodes from heel to toe, and where each inner node stands there
            self.order = np.argsort(along.way[along.bulk.joint.cells[0][1]].mean(axis=1))
            self.chain = np.argsort(along.way)
            self.stands = np.argsort(self.chain)[self.inside]
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

    def solve(
        self,
        conductivity: np.ndarray,
        imposed: np.ndarray,
        drains: np.ndarray = NOWHERE,
        drained: np.ndarray | float = 0.0,
    ) -> tuple[np.ndarray, object]:
        """Pressure [Pa] beyond the one imposed at the inner nodes, for conductivities times weights
        (q,) and the imposed head times the water's weight at the nodes [Pa]; and what `sensitivity`
        wants to know of the solution.

        drains: inner nodes where head times weight is drained [Pa].
        """
        solve = self._in_series if self.dim == 2 else self._in_the_plane
        return solve(conductivity, imposed, drains, drained)

    def resistances(self, conductivity: np.ndarray) -> np.ndarray:
        """2D: of the elements from heel to toe, for conductivities times weights (q,)."""
        whole = np.bincount(self.points.elements, conductivity)
        return (self.lengths**2 / whole)[self.order]

    def known(self, drains: np.ndarray) -> np.ndarray:
        """2D: where in the chain ends and drains stand."""
        return np.flatnonzero(np.isin(self.chain, [*self.along.ends, *drains]))

    def _in_series(
        self,
        conductivity: np.ndarray,
        imposed: np.ndarray,
        drains: np.ndarray,
        drained: np.ndarray | float,
    ) -> tuple:
        """2D: the elements are resistances in series, between ends and drains of known heads.

        No differences of nearly equal numbers, however far the conductivities lie apart (a
        factorised matrix loses the closed joint beside the open one).
        """
        resistance, known, chain = self.resistances(conductivity), self.known(drains), self.chain
        heads = np.where(np.isin(chain[known], drains), drained, imposed[chain[known]])
        total, along, parts = np.empty(len(chain)), np.empty(len(resistance)), []
        for i, k, first, last in zip(known[:-1], known[1:], heads[:-1], heads[1:], strict=True):
            here = resistance[i:k]
            left = np.concatenate([[0], np.cumsum(here)])
            right = np.concatenate([np.cumsum(here[::-1])[::-1], [0]])
            whole = left[-1]
            total[i : k + 1] = first * right / whole + last * left / whole
            along[i:k] = (last - first) * here / whole
            parts.append((i, k, left, right, whole))
        steepness = np.empty_like(along)
        steepness[self.order] = along
        steepness = (steepness / self.lengths)[self.points.elements]

        def inverse(coupling: np.ndarray) -> np.ndarray:
            """Of the flow matrix; only Newton's tangent asks for it."""
            green = np.zeros((len(chain),) * 2)
            for i, k, left, right, whole in parts:
                products = np.minimum.outer(left, left) * np.minimum.outer(right, right)
                green[i : k + 1, i : k + 1] += products / whole
            return green[np.ix_(self.stands, self.stands)] @ coupling

        gradients = [steepness * t for t in self.towards]
        return total[self.stands] - imposed[self.inside], (inverse, gradients)

    def _in_the_plane(
        self,
        conductivity: np.ndarray,
        imposed: np.ndarray,
        drains: np.ndarray,
        drained: np.ndarray | float,
    ) -> tuple:
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
        matrix = np.bincount(self.places, values, number**2).reshape(number, number)
        free = np.flatnonzero(~np.isin(self.inside, drains))
        nodes = self.inside[free]
        known = imposed.copy()
        known[drains] = drained
        total = known.copy()
        try:
            factor = linalg.cho_factor(matrix[np.ix_(nodes, nodes)])
            total[nodes] -= linalg.cho_solve(factor, matrix[nodes] @ known)
        except (linalg.LinAlgError, ValueError):
            return np.full(len(self.inside), np.nan), None
        gradients = [g @ total for g in self.along.slopes]

        def inverse(coupling: np.ndarray) -> np.ndarray:
            found = np.zeros_like(coupling)
            found[free] = linalg.cho_solve(factor, coupling[free])
            return found

        return (total - imposed)[self.inside], (inverse, gradients)

    def sensitivity(self, solution: object, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The pressure's derivatives with the unknowns that matter (p, m), and which these are
        (m,).

        rate (q,): how the conductivities times weights grow with the opening.
        """
        inverse, gradients = solution
        points = np.flatnonzero(rate)
        opening = self.opening[points]
        columns = np.unique(opening.indices)
        coupling = sum(
            g[points].T @ scaled(opening, rate[points] * d[points])
            for g, d in zip(self.inner_slopes, gradients, strict=True)
        )[:, columns].toarray()
        return -inverse(coupling), columns

    def flux(
        self,
        conductivity: np.ndarray,
        total: np.ndarray,
        width: float,
        drains: np.ndarray = NOWHERE,
    ) -> tuple[np.ndarray, float]:
        """Mass flux towards the toe: mean of each joint element [kg/(m s)], and out of the toe per
        metre of thickness.

        conductivity: rho w^3/(12 visc) at the law's points; total: head times the water's weight at
        the nodes [Pa]; width: along z [m]; drains: nodes where water leaves the joint.
        """
        points = self.points
        if self.dim == 2:  # the same from end to drain to end: the drop over resistances in series
            resistance = self.resistances(points.weights * conductivity)
            known = self.known(drains)
            drop = -np.diff(total[self.chain[known]])
            means = drop / np.add.reduceat(resistance, known[:-1])
            flux = np.empty(len(resistance))
            flux[self.order] = np.repeat(means, np.diff(known))
            return flux, float(means[-1])
        slopes = self.along.slopes
        at_toe = 1.0 * np.isin(np.arange(self.along.nodes), self.along.bulk.toe)
        # the flow's own test function at the toe
        out = sum((g @ total) * (g @ at_toe) for g in slopes)
        out = -float(points.weights @ (conductivity * out)) / width
        along = sum((g @ total) * t for g, t in zip(slopes, self.towards, strict=True))
        means = np.bincount(points.elements, -points.weights * conductivity * along)
        return means / np.bincount(points.elements, points.weights), out
