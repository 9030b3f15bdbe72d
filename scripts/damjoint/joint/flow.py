"""Water that flows in the joint: the pressure for a given opening, and its derivatives."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, TypeAlias

import numpy as np

from .. import ROUND_OFF
from ..arrays import Array, BoolArray, IntArray, distinct, others
from ..csr import CsrMatrix, added, ranges
from ..fem import elements
from ..mesh.joint_mesh import JointMesh
from ..threads import scipy_linalg

#: Number of unknowns up to which the Laplace equation is solved by a dense matrix: scipy takes
#: longer to load.
DENSE = 300

#: A series of resistances: its nodes, the resistance from its first node and from its last one to
#: each of them, and that of the whole.
Series: TypeAlias = tuple[IntArray, Array, Array, float]
#: Most series that are kept.
MOST_SERIES = 8

#: No drains.
NO_NODES = np.zeros(0, int)

#: Water that enters at an exit, over the most at a node, up to which it counts as rounding.
ENTERS = 1e-12


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
    toe that corresponds to a node: harmonic, too, and constant where they are level. A network of
    joints that branches has none of the three.
    """

    def __init__(
        self, joint: JointMesh, space: elements.Space, rule: dict[str, int], branched: bool = False
    ) -> None:
        surface, heel, toe = joint.surface, joint.heel_nodes, joint.toe_nodes
        linear, number = elements.Space(surface, 1), len(surface.points)
        points = elements.points_of(linear, rule, gradients=True)
        self.joint, self.dim, self.nodes, self.toe = joint, joint.dim, number, toe
        self.branched = branched
        #: fields at the Gauss points, their slopes there along those of x, y, z (axes) in which the
        #: joint extends, and fields at the locations of its space, from their values at the nodes;
        #: the nodes whose pressure may be unknown
        self.at_points = points.values
        steepest = [np.abs(g.data).max() for g in points.gradients[: joint.dim]]
        self.axes = [axis for axis, g in enumerate(steepest) if g > ROUND_OFF * max(steepest)]
        self.slopes = [points.gradients[axis] for axis in self.axes]
        self.at_locations = space.interpolation(1)
        self.ends = np.concatenate([heel, toe])
        self.inside = np.arange(number) if branched else others(number, self.ends)
        #: matrix of the Laplace equation on the joint
        self.laplace = added([g.T @ g.scaled(points.weights) for g in self.slopes])
        if branched:
            return
        y = surface.points[:, 1]
        self.xi = harmonic(self.laplace, self.ends, np.isin(self.ends, toe).astype(float))
        self.heel_y, self.toe_y = (
            np.full(number, y[nodes[0]])
            if np.ptp(y[nodes]) < ROUND_OFF * np.abs(surface.points).max()
            else harmonic(self.laplace, nodes, y[nodes])
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

    #: see `gradients`; only derivatives and fluxes need them
    gradients_of: Callable[[], list[Array]]
    #: product of the inverse flow matrix with a matrix (inner nodes, m)
    inverse: Callable[[Array], Array]
    #: the same for other conductivities (q,): of a change across the flow, and along it
    inverse_of: Callable[[Array, Array], Callable[[Array], Array]] | None = None
    share: float = 1.0
    #: derivative of the flux with the gradient, and with the aperture, over those of the cubic law
    #: (q,); None: it is that law
    slowed: Array | None = None

    @cached_property
    def gradients(self) -> list[Array]:
        """Gradient of the total head times the water's weight at the Gauss points, along each of
        JointFields.slopes.
        """
        return self.gradients_of()


@dataclass(frozen=True, kw_only=True)
class FlowSolution:
    """Pressure of flowing water beyond the imposed one at the inner nodes [Pa]: a weighted mean of
    those of flow problems.
    """

    pressure: Array
    systems: list[FlowSystem]
    #: of drains whose effect fades: derivative of the pressure with the part of it that is left,
    #: and of this part with the opening at the Gauss points (q,)
    fades: list[tuple[Array, Array]] = field(default_factory=list)

    def closed_at(self, shut: BoolArray) -> FlowSolution:
        """The same, at Gauss points (q,) whose conductivity does not grow with the opening."""
        systems = [
            replace(s, slowed=np.where(shut, 0, 1 if s.slowed is None else s.slowed))
            for s in self.systems
        ]
        return replace(self, systems=systems)

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
class Coupling:
    """The terms of G^T D O, point by point, with a diagonal D: the pattern is that of the slopes G
    (q, inner nodes) and of the openings O (q, j), and is computed once.
    """

    #: of each term: value in G, its inner node, and its entry in O
    slope: Array
    node: IntArray
    opening: IntArray

    @staticmethod
    def of(slopes: CsrMatrix, opening: CsrMatrix) -> Coupling:
        """The terms of two matrices."""
        entry = np.repeat(np.arange(len(slopes.data)), opening.counts[slopes.rows])
        starts, counts = opening.indptr[slopes.rows], opening.counts[slopes.rows]
        return Coupling(
            slope=slopes.data[entry],
            node=slopes.indices[entry],
            opening=ranges(starts, counts),
        )


@dataclass(frozen=True, kw_only=True)
class Pieces:
    """2D: lines of elements and their nodes, cut where the heads are known."""

    pieces: list[tuple[IntArray, IntArray]]
    #: first and last node of each (pieces, 2)
    ends: IntArray
    #: whether the head of one of these is not known: a branching or a closed end
    join: bool

    @cached_property
    def leading(self) -> IntArray:
        """First element of each."""
        return np.array([cells[0] for cells, _ in self.pieces])

    @cached_property
    def trailing(self) -> IntArray:
        """Last element of each."""
        return np.array([cells[-1] for cells, _ in self.pieces])

    @cached_property
    def long(self) -> list[tuple[int, IntArray, IntArray]]:
        """Those of more than one element: number, elements and nodes."""
        return [(k, *piece) for k, piece in enumerate(self.pieces) if len(piece[0]) > 1]

    @cached_property
    def nodes(self) -> IntArray:
        """First and last node of each element along its line (2, elements)."""
        table = np.empty((2, sum(len(cells) for cells, _ in self.pieces)), int)
        for cells, nodes in self.pieces:
            table[:, cells] = nodes[:-1], nodes[1:]
        return table

    @cached_property
    def terminals(self) -> IntArray:
        """Nodes at their ends."""
        return distinct(self.ends.ravel())


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


def junction_heads(
    heads: Array, known: BoolArray, ends: IntArray, conductances: Array
) -> tuple[Array, Array]:
    """Heads (n,) of a network at its branchings and closed ends, for known ones elsewhere, and the
    differences of heads along its pieces (last less first) of these ends (p, 2) and conductances.

    Node by node is eliminated (star and mesh): sums and products of positive numbers only, so that
    no conductance is lost beside a large one. The differences are weighted ones of known heads.
    """
    differences = heads[ends[:, 1]] - heads[ends[:, 0]]
    terminals = distinct(ends.ravel())
    free = np.flatnonzero(~known[terminals])
    if not len(free):
        return heads, differences
    pairs = np.searchsorted(terminals, ends)
    mesh = np.zeros((len(terminals),) * 2)
    np.add.at(mesh, (pairs[:, 0], pairs[:, 1]), conductances)
    mesh += mesh.T
    np.fill_diagonal(mesh, 0)
    shares = []
    for k in free:
        share = mesh[k] / mesh[k].sum()
        mesh += np.outer(mesh[k], share)
        mesh[k] = mesh[:, k] = 0
        np.fill_diagonal(mesh, 0)
        shares.append(share)
    values = heads[terminals]
    between = values[:, None] - values
    for k, share in zip(free[::-1], shares[::-1], strict=True):
        values[k] = share @ values
        between[k] = share @ between
        between[:, k] = -between[k]
        between[k, k] = 0
    heads = heads.copy()
    heads[terminals] = values
    return heads, between[pairs[:, 1], pairs[:, 0]]


class Flow:
    """Water that flows in the joint, or in joints that meet: pressure beyond the imposed one,
    unknown at the nodes between the ends; in a network that branches at all nodes.

    q = -rho w^3/(12 visc) grad (p + rho g y) (cubic law), div q = 0; the conductivities may have
    any common factor.
    """

    def __init__(
        self,
        fields: JointFields,
        points: elements.Points,
        weights: Array,
        wet_opening: CsrMatrix,
        wet_fields: CsrMatrix,
        at_points: CsrMatrix,
    ) -> None:
        """points: Gauss points of the law; weights, wet_opening, wet_fields: see `Wetted`;
        at_points: jump at the points of the law from the unknowns.
        """
        self.fields, self.points, self.dim = fields, points, fields.dim
        self.inside, number = fields.inside, fields.nodes
        #: nodal forces of the pressure at the inner nodes
        inner = wet_fields.columns(self.inside).scaled(weights)
        self.lift = wet_opening.T @ inner
        self.opening = at_points[:: fields.dim]
        self.inner_slopes = [g.columns(self.inside) for g in fields.slopes]
        if fields.dim == 2:
            #: 2D: lines of elements and of their nodes, from heel to toe or between branchings
            self.lines = self._branches() if fields.branched else [self._from_heel_to_toe()]
            self.lengths = np.bincount(points.elements, points.weights)
            #: the lines cut at nodes of known heads, by the bytes of their mask: of the last ones
            self.cut_lines = lru_cache(maxsize=64)(self._cut_lines)
            #: the last series of resistances by this mask, and of which conductivities
            self.last_series: dict[bytes, tuple[Array, Array, list[Series]]] = {}
            #: number of each node (n,) among the inner ones
            self.inner = np.full(fields.nodes, -1)
            self.inner[self.inside] = np.arange(len(self.inside))
        #: unit vectors along the lines or towards the toe at the Gauss points
        self.towards = self._along_lines() if fields.branched else self._towards_toe()
        if fields.dim == 3:
            # the flow matrix is linear in the conductivities: products of slopes of each point, and
            # their entries in the matrix
            self.products, positions = [], []
            pattern = fields.at_points
            for width in np.unique(pattern.counts):
                rows = np.flatnonzero(pattern.counts == width)
                entries = pattern.indptr[rows][:, None] + np.arange(width)
                nodes = pattern.indices[entries]
                product = sum(
                    g.data[entries][:, :, None] * g.data[entries][:, None, :] for g in fields.slopes
                )
                self.products.append((rows, product))
                positions.append((number * nodes[:, :, None] + nodes[:, None, :]).ravel())
            self.entries = np.concatenate(positions)

    def _towards_toe(self) -> list[Array]:
        slopes = [g @ self.fields.xi for g in self.fields.slopes]
        size = np.sqrt(sum(t**2 for t in slopes))
        return [t / size for t in slopes]

    def _along_lines(self) -> list[Array]:
        if self.dim == 3:
            return []
        points, along = self.fields.joint.surface.points, np.zeros((len(self.lengths), 3))
        for cells, nodes in self.lines:
            along[cells] = np.diff(points[nodes], axis=0) / self.lengths[cells, None]
        return [along[self.points.elements, axis] for axis in self.fields.axes]

    @cached_property
    def _table(self) -> IntArray:
        """2D: nodes of the elements."""
        return np.concatenate([table for _, table in self.fields.joint.surface.cells])

    def _from_heel_to_toe(self) -> tuple[IntArray, IntArray]:
        xi = self.fields.xi
        return np.argsort(xi[self._table].mean(axis=1)), np.argsort(xi)

    def _branches(self) -> list[tuple[IntArray, IntArray]]:
        """The lines of a network between its ends and the nodes where it branches."""
        table, lines = self._table, []
        elements_at = [
            np.flatnonzero((table == node).any(axis=1)) for node in range(table.max() + 1)
        ]
        terminal = np.array([len(at) != 2 for at in elements_at])
        terminal[self.fields.ends] = True
        free = np.ones(len(table), bool)
        for start in np.flatnonzero(terminal):
            for first in elements_at[start]:
                cells, nodes, cell = [], [start], first
                while free[cell]:
                    free[cell] = False
                    cells.append(cell)
                    nodes.append(table[cell].sum() - nodes[-1])
                    if not terminal[nodes[-1]]:
                        cell = elements_at[nodes[-1]].sum() - cell
                if cells:
                    lines.append((np.array(cells), np.array(nodes)))
        return lines

    def solve(
        self,
        conductivity: Array,
        imposed: Array,
        drains: IntArray = NO_NODES,
        drained: Array | float = 0.0,
        exits: IntArray = NO_NODES,
    ) -> FlowSolution:
        """Solve for conductivities times weights (q,) and the imposed head times the water's weight
        at the nodes [Pa].

        drains: inner nodes whose head times weight is `drained` [Pa]; exits: ends at which water
        leaves the joint, but does not enter it.
        """
        solve = self._in_lines if self.dim == 2 else self._on_surface
        heads, known = imposed.copy(), np.zeros(len(imposed), bool)
        heads[drains] = drained
        known[self.fields.ends] = known[drains] = True
        while True:  # one that is closed lowers all heads: none of these opens again
            solution, inflow_of = solve(conductivity, imposed, heads, known)
            if not len(exits):
                return solution
            inflow = inflow_of()
            entering = exits[known[exits] & (inflow[exits] > ENTERS * np.abs(inflow).max())]
            if not len(entering):
                return solution
            known[entering] = False

    def resistances(self, conductivity: Array) -> Array:
        """2D: of the elements, for conductivities times weights (q,)."""
        by_element = np.bincount(self.points.elements, conductivity)
        return self.lengths**2 / by_element

    def outflow_of(self, flux: list[Array]) -> Array:
        """2D: what flows out of the nodes (n,) by a flux times weights at the Gauss points (q,),
        along each of JointFields.axes.
        """
        along = np.asarray(sum(f * t for f, t in zip(flux, self.towards, strict=True)))
        by_element = np.bincount(self.points.elements, along) / self.lengths
        out = np.zeros(self.fields.nodes)
        for cells, nodes in self.lines:
            np.add.at(out, nodes[:-1], by_element[cells])
            np.add.at(out, nodes[1:], -by_element[cells])
        return out

    def _cut_lines(self, mask: bytes) -> Pieces:
        known, pieces = np.frombuffer(mask, bool), []
        for cells, nodes in self.lines:
            cuts = np.flatnonzero(known[nodes])
            cuts = np.unique([0, *cuts, len(cells)])
            pieces += [(cells[i:k], nodes[i : k + 1]) for i, k in itertools.pairwise(cuts)]
        ends = np.array([nodes[[0, -1]] for _, nodes in pieces])
        return Pieces(pieces=pieces, ends=ends, join=not known[ends].all())

    def _in_lines(
        self, conductivity: Array, imposed: Array, heads: Array, known: BoolArray
    ) -> tuple[FlowSolution, Callable[[], Array]]:
        """2D: the elements are resistances in series, between nodes of known heads and, in a
        network, branchings. The solution, and what enters at the nodes.

        No differences of nearly equal numbers, however large the ratio of the conductivities (a
        factorised matrix loses the closed joint beside the open one).
        """
        cut = self.cut_lines(known.tobytes())
        resistance, parts = self.series(conductivity, known)
        ends, wholes = cut.ends, np.array([whole for *_, whole in parts])
        if cut.join:
            heads, differences = junction_heads(heads, known, ends, 1 / wholes)
        else:
            differences = heads[ends[:, 1]] - heads[ends[:, 0]]
        total = heads.copy()
        for nodes, before, behind, whole in parts:
            first, last = heads[nodes[0]], heads[nodes[-1]]
            total[nodes] = (first * behind + last * before) / whole

        def gradients() -> list[Array]:
            drops = np.zeros(len(resistance))
            for (cells, _), whole, difference in zip(cut.pieces, wholes, differences, strict=True):
                drops[cells] = difference * resistance[cells] / whole
            steepness = (drops / self.lengths)[self.points.elements]
            return [steepness * t for t in self.towards]

        def inverse_of(_: Array, along: Array) -> Callable[[Array], Array]:
            other = self._in_lines(along, imposed, heads, known)[0]
            return other.systems[0].inverse

        def inverse(coupling: Array) -> Array:
            """By the Green's function of each part, for the nodes at which something couples; only
            Newton's tangent needs it.
            """
            coupled: BoolArray = np.asarray(coupling.any(axis=1))
            column = np.cumsum(coupled) - 1
            green = self._green_of_junctions(parts, known)[:, coupled]
            for nodes, before, behind, whole in parts:
                at, inner = self.inner[nodes[1:-1]], slice(1, -1)
                some = coupled[at]
                products = np.minimum.outer(before[inner], before[inner][some])
                products *= np.minimum.outer(behind[inner], behind[inner][some])
                green[np.ix_(at, column[at[some]])] += products / whole
            return green @ coupling[coupled]

        def inflow() -> Array:
            entering = np.zeros(len(total))
            np.add.at(entering, ends, np.outer(differences / wholes, [-1, 1]))
            return entering

        solution = FlowSolution(
            pressure=total[self.inside] - imposed[self.inside],
            systems=[
                FlowSystem(gradients_of=gradients, inverse=inverse, inverse_of=inverse_of),
            ],
        )
        return solution, inflow

    def series(self, conductivity: Array, known: BoolArray) -> tuple[Array, list[Series]]:
        """2D: resistances of the elements, and the series of them between nodes of known heads and
        branchings, see `_in_lines`; the last ones are kept.
        """
        mask = known.tobytes()
        if mask in self.last_series and self.last_series[mask][0] is conductivity:
            return self.last_series[mask][1:]
        resistance, parts = self.resistances(conductivity), list[Series]()
        for cells, nodes in self.cut_lines(mask).pieces:
            before, behind = np.zeros((2, len(nodes)))
            of_part = resistance[cells]
            np.cumsum(of_part, out=before[1:])
            np.cumsum(of_part[::-1], out=behind[-2::-1])
            parts.append((nodes, before, behind, before[-1]))
        if len(self.last_series) > MOST_SERIES:
            self.last_series.clear()
        self.last_series[mask] = conductivity, resistance, parts
        return resistance, parts

    def _green_of_junctions(self, parts: list[Series], known: BoolArray) -> Array:
        """The part of the Green's function at the inner nodes (p, p) by the heads at branchings and
        closed ends.
        """
        number, inner = len(known), len(self.inside)
        free = np.zeros(number, bool)
        free[[node for nodes, *_ in parts for node in nodes[[0, -1]]]] = True
        free &= ~known
        if not free.any():
            return np.zeros((inner, inner))
        shapes, laplace = np.zeros((number, number)), np.zeros((number, number))
        for nodes, before, behind, whole in parts:
            pair = nodes[[0, -1]]
            laplace[np.ix_(pair, pair)] += np.array([[1, -1], [-1, 1]]) / whole
            shapes[nodes, pair[0]], shapes[nodes, pair[1]] = behind / whole, before / whole
        shapes = shapes[np.ix_(self.inside, free)]
        return np.asarray(shapes @ np.linalg.solve(laplace[np.ix_(free, free)], shapes.T))

    def matrix(self, conductivity: Array) -> Array:
        """3D: the matrix of the flow (n, n) for conductivities times weights (q,)."""
        number = self.fields.nodes
        values = np.concatenate(
            [
                (conductivity[rows][:, None, None] * product).ravel()
                for rows, product in self.products
            ]
        )
        matrix = np.bincount(self.entries, values, number**2)
        return np.asarray(matrix.reshape(number, number), float)

    def tangent_matrix(self, across: Array, along: Array, gradients: list[Array]) -> Array:
        """3D: the same for conductivities times weights of a change across the flow, and along it;
        gradients: of the flow, as in `FlowSystem`.
        """
        size = np.maximum(np.sqrt(sum(g**2 for g in gradients)), 1e-300)
        slopes = zip(self.fields.slopes, gradients, strict=True)
        in_flow = added([slope.scaled(g / size) for slope, g in slopes])
        less = in_flow.T @ in_flow.scaled(across - along)
        return np.asarray(self.matrix(across) - less.toarray())

    def _on_surface(
        self, conductivity: Array, imposed: Array, heads: Array, known: BoolArray
    ) -> tuple[FlowSolution, Callable[[], Array]]:
        """3D: one symmetric positive definite system; nan if the ratio of the conductivities is too
        large for it. The solution, and what enters at the nodes.
        """
        matrix = self.matrix(conductivity)
        free = np.flatnonzero(~known[self.inside])
        nodes = self.inside[free]
        total = np.where(known, heads, imposed)
        linalg = scipy_linalg()
        try:
            factor = linalg.cho_factor(matrix[np.ix_(nodes, nodes)])
            total[nodes] -= linalg.cho_solve(factor, matrix[nodes] @ total)
        except (np.linalg.LinAlgError, ValueError):
            nothing = np.full(len(self.inside), np.nan)
            return FlowSolution(pressure=nothing, systems=[]), lambda: np.zeros(len(total))

        def inverse_by(factor: Any) -> Callable[[Array], Array]:
            def inverse(coupling: Array) -> Array:
                solution = np.zeros_like(coupling)
                solution[free] = linalg.cho_solve(factor, coupling[free])
                return solution

            return inverse

        def inverse_of(across: Array, along: Array) -> Callable[[Array], Array]:
            matrix = self.tangent_matrix(across, along, gradients)
            return inverse_by(linalg.cho_factor(matrix[np.ix_(nodes, nodes)]))

        gradients = [g @ total for g in self.fields.slopes]
        solution = FlowSolution(
            pressure=(total - imposed)[self.inside],
            systems=[
                FlowSystem(
                    gradients_of=lambda: gradients,
                    inverse=inverse_by(factor),
                    inverse_of=inverse_of,
                )
            ],
        )
        return solution, lambda: np.asarray(matrix @ total, float)

    @cached_property
    def couplings(self) -> list[Coupling]:
        """The terms of the coupling of pressure and opening, for each of JointFields.slopes."""
        return [Coupling.of(slope, self.opening) for slope in self.inner_slopes]

    @cached_property
    def storing(self) -> Coupling:
        """The terms of the coupling by what is stored."""
        return Coupling.of(self.fields.at_points.columns(self.inside), self.opening)

    def derivative(
        self, solution: FlowSolution, rate: Array, stored: Array | None = None
    ) -> FlowDerivative:
        """Derivative of a pressure that is a number.

        rate (q,): derivatives of the conductivities times weights with the opening; stored (q,):
        those of what is stored in a time step, over its length, None if nothing is.
        """
        opening = self.opening
        columns = distinct(opening.indices[rate[opening.rows] != 0])
        place = np.zeros(opening.shape[1], int)
        place[columns] = np.arange(len(columns))
        shape = len(self.inside), len(columns)

        def coupling(terms: Coupling, factor: Array) -> Array:
            grown = opening.data * factor[opening.rows]
            entries = np.flatnonzero(grown[terms.opening])
            node, unknown = terms.node[entries], terms.opening[entries]
            number = node * shape[1] + place[opening.indices[unknown]]
            values = terms.slope[entries] * grown[unknown]
            sums = np.bincount(number, values, shape[0] * shape[1])
            return np.asarray(sums, float).reshape(shape)

        def of(system: FlowSystem) -> Array:
            slowed = rate if system.slowed is None else rate * system.slowed
            parts = [
                coupling(terms, slowed * gradient)
                for terms, gradient in zip(self.couplings, system.gradients, strict=True)
            ]
            if stored is not None:
                parts.append(coupling(self.storing, np.where(rate != 0, stored, 0)))
            return -system.inverse(np.asarray(sum(parts)))

        parts = [system.share * of(system) for system in solution.systems]
        parts += [np.outer(by, (opening.T @ part)[columns]) for by, part in solution.fades]
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
            (cells, nodes), ends = self.lines[0], [*self.fields.ends, *drains]
            known = np.flatnonzero(np.isin(nodes, ends))
            drop = -np.diff(total[nodes[known]])
            of_parts = drop / np.add.reduceat(resistance[cells], known[:-1])
            flux = np.empty(len(resistance))
            flux[cells] = np.repeat(of_parts, np.diff(known))
            return flux, float(of_parts[-1])
        return self.flux_by([g @ total for g in self.fields.slopes], conductivity, width)

    def flux_by(
        self, gradients: list[Array], conductivity: Array, width: float
    ) -> tuple[Array, float]:
        """The same from the gradient of the total head times the water's weight at the Gauss points
        along each of JointFields.slopes.
        """
        points, slopes = self.points, self.fields.slopes
        along = sum(d * t for d, t in zip(gradients, self.towards, strict=True))
        whole = np.bincount(points.elements, -points.weights * conductivity * along)
        means = np.asarray(whole / np.bincount(points.elements, points.weights), float)
        if self.dim == 2:
            return means, float(means[self.lines[0][0][-1]])
        at_toe: Array = np.isin(np.arange(self.fields.nodes), self.fields.toe).astype(float)
        # tested with the function that is 1 at the toe: consistent with the weak form
        out = sum(d * (g @ at_toe) for d, g in zip(gradients, slopes, strict=True))
        return means, -float(points.weights @ (conductivity * out)) / width
