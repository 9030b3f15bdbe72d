"""Water that flows in the joint: the pressure for a given opening, and its derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np

from ..arrays import Array, IntArray, distinct, others
from ..classes import dataclass
from ..csr import CsrMatrix, added
from ..fem import elements
from ..model.mesh import JointMesh
from ..threads import scipy_linalg

#: Number of unknowns up to which the Laplace equation is solved by a dense matrix: scipy takes
#: longer to load.
DENSE = 300

#: No drains.
NO_NODES = np.zeros(0, int)


@dataclass(frozen=True, kw_only=True)
class Wetted:
    """The quadrature of the water's force on a joint, or on a part of it: points, opening at them
    from the unknowns, and fields of order 1 at them from their values at the nodes.
    """

    points: elements.Points
    opening: CsrMatrix
    fields: CsrMatrix


class JointFields:
    """Scalar fields of order 1 on the joint, and its normalised path coordinate.

    xi: at the nodes, 0 at the heel, 1 at the toe, harmonic in between: in the plane the distance
    along the joint over its length. heel_y, toe_y: height [m] of the point of the heel and of the
    toe that corresponds to a node: harmonic, too, and constant where they are level.
    """

    def __init__(self, joint: JointMesh, space: elements.Space, rule: dict[str, int]) -> None:
        surface, heel, toe = joint.surface, joint.heel_nodes, joint.toe_nodes
        linear, number = elements.Space(surface, 1), len(surface.points)
        points = elements.points_of(linear, rule, gradients=True)
        self.joint, self.dim, self.nodes, self.toe = joint, joint.dim, number, toe
        #: fields at the Gauss points, their slopes there along x, y, z, and fields at the locations
        #: of the joint's space, from their values at the nodes
        self.at_points = points.values
        self.slopes = [g for g in points.gradients[: joint.dim] if np.abs(g.data).max() > 1e-12]
        self.at_locations = space.interpolation(1)
        laplace = added([g.T @ g.scaled(points.weights) for g in self.slopes])
        self.ends = np.concatenate([heel, toe])
        self.inside = others(number, self.ends)
        y = surface.points[:, 1]
        self.xi = harmonic(laplace, self.ends, np.isin(self.ends, toe).astype(float))
        self.heel_y, self.toe_y = (
            np.full(number, y[nodes[0]])
            if np.ptp(y[nodes]) < 1e-9 * np.abs(surface.points).max()
            else harmonic(laplace, nodes, y[nodes])
            for nodes in (heel, toe)
        )

    @cached_property
    def from_heel(self) -> Array:
        """Distance of the nodes from the line of the heel [m]."""
        heel, points = self.joint.heel, self.joint.surface.points
        ends = np.concatenate([heel.points[table[:, [0, -1]]] for _, table in heel.cells])
        start, along = ends[:, 0], ends[:, 1] - ends[:, 0]
        length = np.maximum(np.sum(along**2, axis=1), 1e-300)
        away = points[:, None] - start
        share = np.clip(np.einsum("nsc,sc->ns", away, along) / length, 0, 1)
        feet = share[:, :, None] * along
        return np.asarray(np.linalg.norm(away - feet, axis=2).min(axis=1))


def harmonic(laplace: CsrMatrix, fixed: IntArray, values: Array) -> Array:
    """Solve the Laplace equation (n,) with these values at fixed nodes."""
    field = np.zeros(laplace.shape[0])
    field[fixed] = values
    free = others(len(field), fixed)
    rows = laplace[free]
    right = -(rows.columns(fixed) @ values)
    matrix = rows.columns(free)
    if len(free) <= DENSE:
        field[free] = np.linalg.solve(matrix.toarray(), right)
    else:
        from scipy.sparse.linalg import splu

        field[free] = splu(matrix.scipy().tocsc()).solve(right)
    return field


@dataclass(frozen=True, kw_only=True)
class FlowSystem:
    """A solved flow problem, for derivatives of its pressure, and its share in a mean of such."""

    #: gradient of the total head times the water's weight at the Gauss points, along each of
    #: JointFields.slopes
    gradients: list[Array]
    #: product of the inverse flow matrix with a matrix (inner nodes, m)
    inverse: Callable[[Array], Array]
    share: float = 1.0


@dataclass(frozen=True, kw_only=True)
class FlowSolution:
    """Pressure of flowing water beyond the imposed one at the inner nodes [Pa]: a weighted mean of
    those of flow problems.
    """

    pressure: Array
    systems: list[FlowSystem]

    def mixed(self, share: float, other: FlowSolution) -> FlowSolution:
        """Mean with another solution of some share (0 to 1)."""
        rest = 1 - share
        return FlowSolution(
            pressure=rest * self.pressure + share * other.pressure,
            systems=[
                *(replace(s, share=rest * s.share) for s in self.systems),
                *(replace(s, share=share * s.share) for s in other.systems),
            ],
        )


@dataclass(frozen=True, kw_only=True)
class FlowDerivative:
    """Derivative of the pressure with the unknowns (p, columns), without its zero columns."""

    pressure: Array
    columns: IntArray

    @staticmethod
    def joined(parts: list[FlowDerivative]) -> FlowDerivative | None:
        """The derivatives of several joints, one below the other; None if there is none."""
        if len(parts) < 2:
            return parts[0] if parts else None
        columns = distinct(np.concatenate([part.columns for part in parts]))
        ends = np.cumsum([0, *(len(part.pressure) for part in parts)])
        pressure = np.zeros((ends[-1], len(columns)))
        for first, last, part in zip(ends, ends[1:], parts, strict=False):
            pressure[first:last, np.searchsorted(columns, part.columns)] = part.pressure
        return FlowDerivative(pressure=pressure, columns=columns)


class Flow:
    """Water that flows in the joint: pressure beyond the imposed one, unknown at the nodes between
    heel and toe.

    q = -rho w^3/(12 visc) grad (p + rho g y) (cubic law), div q = 0; the conductivities may have
    any common factor.
    """

    def __init__(
        self,
        fields: JointFields,
        points: elements.Points,
        wetted: Wetted,
        at_points: CsrMatrix,
    ) -> None:
        """points: Gauss points of the law; at_points: jump there from the unknowns."""
        self.fields, self.points, self.dim = fields, points, fields.dim
        self.inside, number = fields.inside, fields.nodes
        #: nodal forces of the pressure at the inner nodes
        inner = wetted.fields.columns(self.inside).scaled(wetted.points.weights)
        self.lift = wetted.opening.T @ inner
        self.opening = at_points[:: fields.dim]
        self.inner_slopes = [g.columns(self.inside) for g in fields.slopes]
        slopes = [g @ fields.xi for g in fields.slopes]
        size = np.sqrt(sum(t**2 for t in slopes))
        #: unit vectors towards the toe at the Gauss points
        self.towards = [t / size for t in slopes]
        if fields.dim == 2:
            #: the elements and the nodes from heel to toe; position of each inner node there
            (_, table), *_ = fields.joint.surface.cells
            self.order = np.argsort(fields.xi[table].mean(axis=1))
            self.chain = np.argsort(fields.xi)
            self.position = np.argsort(self.chain)[self.inside]
            self.lengths = np.bincount(points.elements, points.weights)
        else:
            # the flow matrix is linear in the conductivities: products of slopes of each point, and
            # their entries in the matrix
            self.products, entries_of = [], []
            pattern = fields.at_points
            for width in np.unique(pattern.counts):
                rows = np.flatnonzero(pattern.counts == width)
                entries = pattern.indptr[rows][:, None] + np.arange(width)
                nodes = pattern.indices[entries]
                product = sum(
                    g.data[entries][:, :, None] * g.data[entries][:, None, :] for g in fields.slopes
                )
                self.products.append((rows, product))
                entries_of.append((number * nodes[:, :, None] + nodes[:, None, :]).ravel())
            self.entries = np.concatenate(entries_of)

    def solve(
        self,
        conductivity: Array,
        imposed: Array,
        drains: IntArray = NO_NODES,
        drained: Array | float = 0.0,
    ) -> FlowSolution:
        """Solve for conductivities times weights (q,) and the imposed head times the water's weight
        at the nodes [Pa].

        drains: inner nodes whose head times weight is `drained` [Pa].
        """
        solve = self._in_series if self.dim == 2 else self._on_surface
        return solve(conductivity, imposed, drains, drained)

    def resistances(self, conductivity: Array) -> Array:
        """2D: of the elements from heel to toe, for conductivities times weights (q,)."""
        by_element = np.bincount(self.points.elements, conductivity)
        return (self.lengths**2 / by_element)[self.order]

    def known(self, drains: IntArray) -> IntArray:
        """2D: positions in the chain of ends and drains, whose heads are known."""
        return np.flatnonzero(np.isin(self.chain, [*self.fields.ends, *drains]))

    def _in_series(
        self, conductivity: Array, imposed: Array, drains: IntArray, drained: Array | float
    ) -> FlowSolution:
        """2D: the elements are resistances in series, between ends and drains of known heads.

        No differences of nearly equal numbers, however large the ratio of the conductivities (a
        factorised matrix loses the closed joint beside the open one).
        """
        resistance, known, chain = self.resistances(conductivity), self.known(drains), self.chain
        heads = np.where(np.isin(chain[known], drains), drained, imposed[chain[known]])
        total, drops, parts = np.empty(len(chain)), np.empty(len(resistance)), []
        for i, k, first, last in zip(known[:-1], known[1:], heads[:-1], heads[1:], strict=True):
            of_part = resistance[i:k]
            before = np.concatenate([[0], np.cumsum(of_part)])
            behind = np.concatenate([np.cumsum(of_part[::-1])[::-1], [0]])
            whole = before[-1]
            total[i : k + 1] = first * behind / whole + last * before / whole
            drops[i:k] = (last - first) * of_part / whole
            parts.append((i, k, before, behind, whole))
        steepness = np.empty_like(drops)
        steepness[self.order] = drops
        steepness = (steepness / self.lengths)[self.points.elements]

        def inverse(coupling: Array) -> Array:
            """By the Green's function of each part; only Newton's tangent needs it."""
            green = np.zeros((len(chain),) * 2)
            for i, k, before, behind, whole in parts:
                products = np.minimum.outer(before, before) * np.minimum.outer(behind, behind)
                green[i : k + 1, i : k + 1] += products / whole
            return green[np.ix_(self.position, self.position)] @ coupling

        gradients = [steepness * t for t in self.towards]
        return FlowSolution(
            pressure=total[self.position] - imposed[self.inside],
            systems=[FlowSystem(gradients=gradients, inverse=inverse)],
        )

    def _on_surface(
        self, conductivity: Array, imposed: Array, drains: IntArray, drained: Array | float
    ) -> FlowSolution:
        """3D: one symmetric positive definite system; nan if the ratio of the conductivities is too
        large for it.
        """
        number = self.fields.nodes
        values = np.concatenate(
            [
                (conductivity[rows][:, None, None] * product).ravel()
                for rows, product in self.products
            ]
        )
        matrix = np.bincount(self.entries, values, number**2).reshape(number, number)
        free = np.flatnonzero(~np.isin(self.inside, drains))
        nodes = self.inside[free]
        total = imposed.copy()
        total[drains] = drained
        linalg = scipy_linalg()
        try:
            factor = linalg.cho_factor(matrix[np.ix_(nodes, nodes)])
            total[nodes] -= linalg.cho_solve(factor, matrix[nodes] @ total)
        except (np.linalg.LinAlgError, ValueError):
            return FlowSolution(pressure=np.full(len(self.inside), np.nan), systems=[])

        def inverse(coupling: Array) -> Array:
            solution = np.zeros_like(coupling)
            solution[free] = linalg.cho_solve(factor, coupling[free])
            return solution

        gradients = [g @ total for g in self.fields.slopes]
        return FlowSolution(
            pressure=(total - imposed)[self.inside],
            systems=[FlowSystem(gradients=gradients, inverse=inverse)],
        )

    def derivative(self, solution: FlowSolution, rate: Array) -> FlowDerivative:
        """Derivative of a pressure that is a number.

        rate (q,): derivatives of the conductivities times weights with the opening.
        """
        points = np.flatnonzero(rate)
        opening = self.opening[points]
        columns = distinct(opening.indices)

        def of(system: FlowSystem) -> Array:
            coupling = added(
                [
                    g[points].T @ opening.scaled(rate[points] * d[points])
                    for g, d in zip(self.inner_slopes, system.gradients, strict=True)
                ]
            )
            return -system.inverse(coupling.columns(columns).toarray())

        parts = (system.share * of(system) for system in solution.systems)
        return FlowDerivative(pressure=np.asarray(sum(parts)), columns=columns)

    def flux(
        self, conductivity: Array, total: Array, width: float, drains: IntArray = NO_NODES
    ) -> tuple[Array, float]:
        """Mass flux towards the toe: mean of each joint element [kg/(m s)], and out of the toe per
        metre of thickness.

        conductivity: rho w^3/(12 visc) at the Gauss points; total: head times the water's weight at
        the nodes [Pa]; width: along z [m]; drains: nodes where water leaves the joint.
        """
        points = self.points
        if self.dim == 2:  # constant between ends and drains: the drop over resistances in series
            resistance = self.resistances(points.weights * conductivity)
            known = self.known(drains)
            drop = -np.diff(total[self.chain[known]])
            of_parts = drop / np.add.reduceat(resistance, known[:-1])
            flux = np.empty(len(resistance))
            flux[self.order] = np.repeat(of_parts, np.diff(known))
            return flux, float(of_parts[-1])
        slopes = self.fields.slopes
        at_toe: Array = np.isin(np.arange(self.fields.nodes), self.fields.toe).astype(float)
        # tested with the function that is 1 at the toe: consistent with the weak form
        out = sum((g @ total) * (g @ at_toe) for g in slopes)
        leakage = -float(points.weights @ (conductivity * out)) / width
        along = sum((g @ total) * t for g, t in zip(slopes, self.towards, strict=True))
        means = np.bincount(points.elements, -points.weights * conductivity * along)
        return means / np.bincount(points.elements, points.weights), leakage
