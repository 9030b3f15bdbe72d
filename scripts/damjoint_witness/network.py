"""Water that flows in joints that meet: in 2D the elements are resistances in series, joined at the
nodes of several joints; in 3D finite elements. Heads, fluxes and drains.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal, localcontext
from functools import cached_property
from typing import Any, Protocol, TypeVar

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from .joint_state import (
    CRACK_MOST,
    SAME_POINT,
    Heads,
    JointState,
    heads_at_ends,
    joint_rule,
    line_over_drains,
)
from .solids import Array, IntArray, Sides, functions

#: Part of their effect below which drains have none [-]: rounding.
NO_EFFECT = 1e-9
#: Digits of the elimination in a network: conductances of open and closed joints differ by 1e18.
PRECISION = 60
#: Change of the drops of the head over the largest one up to which it is settled [-].
SETTLED = 1e-12
#: The same in 3D, where it is that of a system of equations [-].
SETTLED_IN_3D = 1e-10
#: Modes whose water flows, and those that water does not pass.
FLOWING, CLOSED = ("flow", "cracked"), ("none", "waterstop")


class HasDrops(Protocol):
    """A solution with the drops of the head, see `Flow`."""

    @property
    def drops(self) -> Array:
        """The drops."""


Solution = TypeVar("Solution", bound=HasDrops)


@dataclass(frozen=True)
class Flow:
    """A solution: heads at the nodes (n,) [m], what enters at the nodes (n,), and drops: in 2D
    those of the head along the elements (m,) [m], which may be small differences, in 3D its
    gradients at the points of the law (p, 3).
    """

    heads: Array
    drops: Array
    inflow: Array

    def mixed(self, share: float, other: Flow) -> Flow:
        """Return the mean with a share of another solution."""
        pairs = (
            (self.heads, other.heads),
            (self.drops, other.drops),
            (self.inflow, other.inflow),
        )
        return Flow(*((1 - share) * a + share * b for a, b in pairs))

    def plus(self, share: float, one: Flow, other: Flow) -> Flow:
        """Return the sum with a share of the difference of two solutions."""
        return Flow(
            self.heads + share * (one.heads - other.heads),
            self.drops + share * (one.drops - other.drops),
            self.inflow + share * (one.inflow - other.inflow),
        )


@dataclass(frozen=True)
class Graph:
    """Flow along lines: pairs of nodes with a conductance; fixed heads [m]."""

    pairs: IntArray
    conductances: Array
    number: int

    def solve(self, fixed: dict[int, float]) -> Flow:
        """Solve for fixed heads by node: the others are eliminated one by one, in numbers of
        PRECISION digits.
        """
        with localcontext() as context:
            context.prec = PRECISION
            links: list[dict[int, Decimal]] = [{} for _ in range(self.number)]
            for (i, k), size in zip(self.pairs.tolist(), self.conductances.tolist(), strict=True):
                for a, b in ((i, k), (k, i)):
                    links[a][b] = links[a].get(b, Decimal(0)) + Decimal(size)
            eliminated = []
            free = [node for node in range(self.number) if node not in fixed and links[node]]
            for node in sorted(free, key=lambda n: len(links[n])):
                linked = links[node]
                whole = sum(linked.values(), Decimal(0))
                for a, size in linked.items():
                    del links[a][node]
                    for b, other in linked.items():
                        if a != b:
                            links[a][b] = links[a].get(b, Decimal(0)) + size * other / whole
                eliminated.append((node, linked, whole))
            heads = {node: Decimal(head) for node, head in fixed.items()}
            inflow = np.zeros(self.number)
            for node in fixed:
                parts = [size * (heads[node] - heads[b]) for b, size in links[node].items()]
                inflow[node] = float(sum(parts, Decimal(0)))
            for node, linked, whole in reversed(eliminated):
                flows = (size * heads[b] for b, size in linked.items())
                heads[node] = sum(flows, Decimal(0)) / whole
            drops = [float(heads[i] - heads[k]) for i, k in self.pairs.tolist()]
        return Flow(
            np.array([float(heads[n]) for n in range(self.number)]), np.array(drops), inflow
        )


@dataclass(frozen=True)
class Surface:
    """Flow on surfaces: stiffness of order 1, and the matrices by which the heads give their
    gradients along x, y and z at the points of the law (p, n).
    """

    matrix: Any
    slopes: Sequence[Any]

    def solve(self, fixed: dict[int, float]) -> Flow:
        """Solve for fixed heads by node."""
        number = self.matrix.shape[0]
        heads, known = np.zeros(number), np.zeros(number, bool)
        known[list(fixed)] = True
        heads[list(fixed)] = list(fixed.values())
        free = np.flatnonzero(~known)
        if len(free):
            rows = self.matrix[free]
            heads[free] = splu(rows[:, free].tocsc()).solve(-(rows @ heads))
        return Flow(heads, self.gradients(heads), np.asarray(self.matrix @ heads))

    def gradients(self, heads: Array) -> Array:
        """Return the gradients (p, 3) of heads (n,)."""
        return np.column_stack([slope @ heads for slope in self.slopes])


@dataclass(frozen=True)
class DrainLine:
    """Drains of a joint: its number; nodes and heads of their outlets [m]; the part of their effect
    that remains with a crack in the elements beside them.
    """

    joint: int
    outlets: dict[int, float]
    remaining: float


@dataclass(frozen=True)
class Network:
    """Joints whose water is one: their states, and the nodes of order 1 of all of them."""

    joints: tuple[JointState, ...]
    #: positions of the nodes of all joints of the dam, each joint's once (n, 3)
    all_nodes: Array

    @property
    def first(self) -> JointState:
        """The first joint, whose weight of water and levels are those of all."""
        return self.joints[0]

    @property
    def flowing(self) -> bool:
        """Whether water flows through an opening."""
        return any(joint.values["uplift"] in FLOWING for joint in self.joints)

    @cached_property
    def _numbering(self) -> tuple[Array, list[list[IntArray]]]:
        corners = [sides.corners for joint in self.joints for sides in joint.sides]
        coordinates, number = distinct_points(np.concatenate([c.reshape(-1, 3) for c in corners]))
        parts = np.split(number, np.cumsum([c.size // 3 for c in corners])[:-1])
        tables = iter([part.reshape(c.shape[:2]) for part, c in zip(parts, corners, strict=True)])
        return coordinates, [[next(tables) for _ in joint.sides] for joint in self.joints]

    @property
    def nodes(self) -> Array:
        """Positions of the nodes (n, 3)."""
        return self._numbering[0]

    @property
    def tables(self) -> list[list[IntArray]]:
        """Nodes of the elements of each joint (m, c), by shape."""
        return self._numbering[1]

    def nodes_of(self, joint: int) -> IntArray:
        """Return the nodes of a joint."""
        return np.unique(np.concatenate([table.ravel() for table in self.tables[joint]]))

    @cached_property
    def widening(self) -> list[list[Array]]:
        """Of each joint and shape the aperture at the points of the law (m, q), over that of the
        closed joint.
        """
        return [joint.widening() for joint in self.joints]

    def conductivities(
        self, uniform: bool, drops: Array | None = None, closed: Sequence[int] = ()
    ) -> Iterator[tuple[Sides, IntArray, Array]]:
        """Yield elements, their nodes, and w^3 times weights at the points of the law (m, q), in a
        unit that is that of all joints; uniform: w = 1; drops: those of a `Flow`, under which the
        flow is turbulent, w^3 less by `slowed`; closed: nodes in whose elements the joint conducts
        as if closed.
        """
        first, plane = 0, self.first.values["dim"] == 2
        for joint, tables, widening in zip(self.joints, self.tables, self.widening, strict=True):
            narrowest = joint.values["aperture_min"] if self.by_aperture else 1.0
            for sides, table, factor in zip(joint.sides, tables, widening, strict=True):
                _, w = joint_rule(sides.shape, sides.order, joint.values["quadrature"])
                shut = np.isin(table, list(closed)).any(axis=1, keepdims=True)
                cube = np.where(shut, 1, factor)
                cube = np.ones_like(factor) if uniform else (narrowest * cube) ** 3
                number = len(table) if plane else factor.size
                if drops is not None and joint.values["uplift"] == "flow":
                    of_side = drops[first : first + number]
                    lengths = 2 * sides.measures[:, None]
                    slopes = of_side[:, None] / lengths if plane else steepness(of_side, factor)
                    cube = cube * joint.slowed(cube, slopes)
                first += number
                yield sides, table, cube * np.outer(sides.measures, w)

    @property
    def turbulent(self) -> bool:
        """Whether the water may be turbulent: in a joint with `flow`."""
        return bool(self.first.values["turbulent"]) and self.by_aperture

    @property
    def by_aperture(self) -> bool:
        """Whether the opening of a joint is the aperture of its water."""
        return any(joint.values["uplift"] == "flow" for joint in self.joints)

    def settled(self, solve: Callable[[Array | None], Solution]) -> Solution:
        """Return the flow that leads to its own conductances: by substitution, each iterate at
        least twice as close as the last; solve: the flow for the drops of the last one.
        """
        found = solve(None)
        room = SETTLED if self.first.values["dim"] == 2 else SETTLED_IN_3D
        while self.turbulent:
            before, found = found, solve(found.drops)
            if np.abs(found.drops - before.drops).max() <= room * np.abs(found.drops).max():
                break
        return found

    def operator(
        self, uniform: bool, drops: Array | None = None, closed: Sequence[int] = ()
    ) -> Graph | Surface:
        """Return the equations of the flow; uniform: of a uniform aperture; drops, closed: see
        `conductivities`.
        """
        parts = list(self.conductivities(uniform, drops, closed))
        if self.first.values["dim"] == 2:
            by_length = [c.sum(axis=1) / (2 * s.measures) ** 2 for s, _, c in parts]
            pairs = np.concatenate([table for _, table, _ in parts])
            return Graph(pairs, np.concatenate(by_length), len(self.nodes))
        number = len(self.nodes)
        total = sparse.csr_matrix((number, number))
        by_axis = list[list[Any]]()
        for sides, table, sizes in parts:
            u, _ = joint_rule(sides.shape, sides.order, self.first.values["quadrature"])
            slopes = gradients(sides, u)
            blocks = np.einsum("mq,mqax,mqbx->mab", sizes, slopes, slopes)
            rows = np.repeat(table, table.shape[1], axis=1).ravel()
            columns = np.tile(table, (1, table.shape[1])).ravel()
            entries = blocks.ravel(), (rows, columns)
            total = total + sparse.coo_matrix(entries, (number, number)).tocsr()
            points = np.repeat(np.arange(sizes.size), table.shape[1])
            nodes = np.repeat(table, len(u), axis=0).ravel()
            by_axis.append(
                [
                    sparse.csr_matrix((part.ravel(), (points, nodes)), (sizes.size, number))
                    for part in np.moveaxis(slopes, 3, 0)
                ]
            )
        return Surface(total, [sparse.vstack(matrices) for matrices in zip(*by_axis, strict=True)])

    # -- ends

    @cached_property
    def ends(self) -> tuple[IntArray, IntArray]:
        """Nodes of heels and of toes on the surface of the dam: at no other joint."""
        tree, ends = cKDTree(self.all_nodes), list[IntArray]()
        for which in (0, 1):
            nodes: list[int] = []
            for k, joint in enumerate(self.joints):
                numbers = self.nodes_of(k)
                s = joint.rows["s"][joint.find(self.nodes[numbers])]
                at_end = numbers[np.abs(s - (s.max() if which else s.min())) < SAME_POINT]
                near = tree.query_ball_point(self.nodes[at_end], SAME_POINT)
                nodes += [n for n, others in zip(at_end, near, strict=True) if len(others) == 1]
            ends.append(np.unique(np.array(nodes, int)))
        return ends[0], ends[1]

    @cached_property
    def branched(self) -> bool:
        """Whether it is more than one way, in 3D surface, from heel to toe."""
        heels, toes = self.ends
        if self.first.values["dim"] == 3:
            meet = self.most_at_edges > 2 or len(self.dead_ends)
            return bool(meet or not (len(heels) and len(toes)))
        if not len(heels) == len(toes) == 1:
            return True
        return bool((self.degrees > 2).any() or len(self.dead_ends))

    @cached_property
    def degrees(self) -> IntArray:
        """Number of elements at each node."""
        tables = [table.ravel() for tables in self.tables for table in tables]
        return np.bincount(np.concatenate(tables))

    @property
    def most_at_edges(self) -> int:
        """The largest number of elements at an edge of one, in 3D."""
        tables = [table for tables in self.tables for table in tables]
        edges = [np.stack([t, np.roll(t, -1, axis=1)], axis=2).reshape(-1, 2) for t in tables]
        same = np.sort(np.concatenate(edges), axis=1)
        return int(np.unique(same, axis=0, return_counts=True)[1].max())

    @cached_property
    def dead_ends(self) -> IntArray:
        """Nodes at heel or toe of a joint that end at a joint that water does not pass."""
        inner = list[IntArray]()
        for k, joint in enumerate(self.joints):
            numbers = self.nodes_of(k)
            s = joint.rows["s"][joint.find(self.nodes[numbers])]
            inner.append(numbers[(s - s.min() < SAME_POINT) | (s.max() - s < SAME_POINT)])
        of_joints = np.concatenate([self.nodes_of(k) for k in range(len(self.joints))])
        alone = np.bincount(of_joints, minlength=len(self.nodes)) == 1
        found = np.unique(np.concatenate(inner))
        return np.setdiff1d(found[alone[found]], np.concatenate(self.ends))

    def fixed(self) -> tuple[dict[int, float], set[int]]:
        """Return the heads [m] at the ends, and those ends where water leaves but does not
        enter.
        """
        first, (heels, toes) = self.first, self.ends
        heights = self.nodes[:, 1]
        if not self.branched:
            heel, toe = (float(heights[nodes].mean()) for nodes in (heels, toes))
            at_ends = heads_at_ends(heel, toe, first.level, first.tail, self.flowing)
            pairs = zip((heels, toes), at_ends, strict=True)
            return {int(n): head for nodes, head in pairs for n in nodes}, set()
        levels = ((heels, first.level), (toes, first.tail))
        heads = {int(n): max(heights[n], level) for nodes, level in levels for n in nodes}
        dry = {n for n in heads if heads[n] <= heights[n]}
        if len(dry) == len(heads):
            lowest = heights[[*heels, *toes, *self.dead_ends]].min()
            rest = float(min(lowest, max(first.level, first.tail)))
            return dict.fromkeys(range(len(heights)), rest), set()
        return heads, dry

    # -- solution

    def solve(self, uniform: bool, drains: dict[int, float] | None = None) -> Flow:
        """Solve the flow, with the heads [m] at drains by node."""
        if uniform:
            return self._solve(self.operator(uniform), drains or {})
        closed = self.closed if drains else ()
        return self.settled(
            lambda drops: self._solve(self.operator(False, drops, closed), drains or {})
        )

    def _solve(self, operator: Graph | Surface, drains: dict[int, float]) -> Flow:
        heads, exits = self.fixed()
        heads |= drains
        while True:
            found = operator.solve(heads)
            most = ENTERS * np.abs(found.inflow).max()
            entering = {n for n in exits if found.inflow[n] > most}
            if not entering:
                return found
            exits -= entering
            heads = {n: head for n, head in heads.items() if n not in entering}

    def drains(self) -> tuple[dict[int, float], float]:
        """Return the nodes of drains that act and the heads [m] of their outlets; their
        effectiveness.
        """
        nodes = {n: head for line in self.drain_lines for n, head in line.outlets.items()}
        values = [self.joints[line.joint].values for line in self.drain_lines]
        return nodes, float(values[0]["drain_effectiveness"]) if values else 0.0

    @cached_property
    def drain_lines(self) -> list[DrainLine]:
        """The drains of whose effect a part remains."""
        lines = []
        for k, joint in enumerate(self.joints):
            values = joint.values
            if values["uplift"] not in FLOWING or not values["drains"]:
                continue
            numbers = self.nodes_of(k)
            s = joint.rows["s"][joint.find(self.nodes[numbers])]
            inner = (s > s.min() + SAME_POINT) & (s < s.max() - SAME_POINT)
            numbers, s = numbers[inner], s[inner]
            away = np.abs(s - values["drain_x"])
            here = away < away.min() + SAME_POINT
            outlets = {
                n: float(max(self.nodes[n, 1], values["drain_level"], joint.tail))
                for n in numbers[here].tolist()
            }
            remaining = 1.0
            if values["uplift"] == "cracked":
                remaining -= self.cracked_beside(k, numbers[here], float(s[here].mean()))
            if remaining > NO_EFFECT:
                lines.append(DrainLine(k, outlets, remaining))
        return lines

    def cracked_beside(self, joint: int, nodes: IntArray, distance: float) -> float:
        """Return the cracked part of the elements before drains at a distance from the heel [m],
        plus that of those behind them.
        """
        state, parts = self.joints[joint], {-1: [0.0, 0.0], 1: [0.0, 0.0]}
        for sides, table, factor in zip(
            state.sides, self.tables[joint], self.widening[joint], strict=True
        ):
            _, w = joint_rule(sides.shape, sides.order, state.values["quadrature"])
            touching = np.isin(table, nodes).any(axis=1)
            middles = state.distance(sides.corners.mean(axis=1))
            sizes = np.outer(sides.measures, w)
            for side, part in parts.items():
                beside = touching & (side * (middles - distance) > SAME_POINT)
                part[0] += float((sizes * (factor - 1) / CRACK_MOST)[beside].sum())
                part[1] += float(sizes[beside].sum())
        return sum(cracked / whole for cracked, whole in parts.values() if whole)

    @cached_property
    def closed(self) -> list[int]:
        """Nodes of drains that fade. The elements beside them lose the head between crack and
        drains.
        """
        return [n for line in self.drain_lines if line.remaining < 1 for n in line.outlets]

    @cached_property
    def flow(self) -> Flow:
        """The flow: drains remove a part of the head that there would be without them. Of drains
        that fade as much as is left acts with all others, the rest of these without them.
        """
        free = self.solve(uniform=not self.flowing)
        drains, effect = self.drains()
        if not drains or not effect or any(free.heads[n] <= head for n, head in drains.items()):
            return free
        found, last = free, 0.0
        for remaining in sorted({line.remaining for line in self.drain_lines}):
            lines = [line for line in self.drain_lines if line.remaining >= remaining]
            fixed = {n: head for line in lines for n, head in line.outlets.items()}
            layer = self.solve(False, fixed)
            share = effect * (remaining - last)
            found = found.plus(share, layer, free)
            last = remaining
        return found

    @property
    def heads(self) -> Array:
        """Heads at the nodes (n,) [m]."""
        return self.flow.heads

    def heads_of(self, joint: int) -> Heads:
        """Return the head in a joint, by its functions of order 1."""
        if self.first.values["dim"] == 2:
            nodes = self.nodes_of(joint)
            s = self.joints[joint].distance(self.nodes[nodes])
            by_s = np.argsort(s)
            return lambda positions: np.interp(
                self.joints[joint].distance(positions), s[by_s], self.heads[nodes[by_s]]
            )

        def at(positions: Array) -> Array:
            (sides,), (table,) = self.joints[joint].sides, self.tables[joint]
            plane = Sides(sides.shape, sides.corners, 1)
            points = plane.at(positions, np.ones(len(positions)))
            return np.asarray((points.functions * self.heads[table[points.sides]]).sum(axis=1))

        return at

    def flux(self, joint: int) -> tuple[Array, float, float, float]:
        """Return the flux towards the toe [kg/(m s)] at the rows of a joint, mean of the elements
        around them, that out of the toe per metre of thickness; its scale, that of the aperture
        under the steepest head; and the flux by which the last digits of the heads change it where
        the joint is widest.
        """
        state, values = self.joints[joint], self.joints[joint].values
        (sides,), (table,), (factor,) = state.sides, self.tables[joint], self.widening[joint]
        u, w = joint_rule(sides.shape, sides.order, values["quadrature"])
        cube = (values["aperture_min"] * factor) ** 3
        share = state.unit_weight * values["rho_water"] / (12 * values["visc"])
        if values["dim"] == 2:
            lengths = 2 * sides.measures
            steepest = 1 / lengths.min()
            first = sum(len(t) for tables in self.tables[:joint] for t in tables)
            drops = self.flow.drops[first : first + len(table)]
            if values["turbulent"]:
                cube = cube * state.slowed(cube, (drops / lengths)[:, None])
            means = share * (cube @ w / 2 / lengths) * drops
            order = np.argsort(state.distance(sides.corners.mean(axis=1)))
            leakage = float(means[order[-1]])
        else:
            of_functions = gradients(sides, u)
            steepest = np.abs(of_functions).max()
            slopes = np.einsum("mqax,ma->mqx", of_functions, self.heads[table])
            if values["turbulent"]:
                cube = cube * state.slowed(cube, np.linalg.norm(slopes, axis=2))
            along = slopes[..., :2] @ state.along
            means = -share * (cube * along) @ w / w.sum()
            numbers = self.nodes_of(joint)
            along_joint = state.rows["s"][state.find(self.nodes[numbers])]
            toe = numbers[along_joint.max() - along_joint < SAME_POINT]
            at_toe = np.isin(np.arange(len(self.nodes)), toe).astype(float)[table]
            tested = np.einsum("mqax,ma->mqx", of_functions, at_toe)
            products = np.einsum("mqx,mqx->mq", slopes, tested) * cube
            leakage = float(-share * np.sum(products @ w * sides.measures))
            leakage /= float(np.ptp(self.nodes[:, 2]))
        rows = state.find(sides.coordinates)
        total, count = np.zeros(len(state.positions)), np.zeros(len(state.positions))
        np.add.at(total, rows, means[:, None])
        np.add.at(count, rows, 1)
        heads = np.ptp(self.heads) + max(state.level, 0) * 1e-3
        scale = max(float(np.abs(means).max()), share * values["aperture_min"] ** 3 * heads)
        digits = np.finfo(float).eps * np.abs(self.heads).max()
        return (
            total / np.maximum(count, 1),
            leakage,
            scale,
            float(share * cube.max() * steepest * digits),
        )


#: Water that enters at an exit, over the most at a node, up to which it counts as rounding.
ENTERS = 1e-12


def distinct_points(coordinates: Array) -> tuple[Array, IntArray]:
    """Return points (n, 3), each once, and the number of each of those given (m,)."""
    pairs = cKDTree(coordinates).query_pairs(SAME_POINT, output_type="ndarray")
    links = sparse.coo_matrix((np.ones(len(pairs)), pairs.T), (len(coordinates),) * 2)
    _, number = connected_components(links, directed=False)
    _, first = np.unique(number, return_index=True)
    return coordinates[first], np.asarray(number, int)


def steepness(gradients: Array, like: Array) -> Array:
    """Return the sizes (m, q) of gradients (m q, 3) at points, as many as those of an array."""
    return np.asarray(np.linalg.norm(gradients, axis=1).reshape(like.shape))


def gradients(sides: Sides, u: Array) -> Array:
    """Return the gradients (m, q, n, 3) of the functions of order 1 at reference points (q, d)."""
    step = 1e-3  # exact: functions are at most linear along each reference coordinate
    by_reference = np.stack(
        [
            functions(sides.shape, 1, u + step * e) - functions(sides.shape, 1, u - step * e)
            for e in np.eye(u.shape[1])
        ],
        axis=2,
    ) / (2 * step)
    return np.asarray(np.einsum("qnd,mxd->mqnx", by_reference, np.linalg.pinv(sides.slopes)))


def networks(joints: Sequence[JointState]) -> list[Network]:
    """Return the joints that share water: those that meet and that water passes."""
    everything = np.concatenate([joint.positions for joint in joints])
    groups: list[list[int]] = []
    for k, joint in enumerate(joints):
        if joint.values["uplift"] in CLOSED:
            continue
        tree = cKDTree(joint.positions)
        near = [
            group
            for group in groups
            if any(
                np.isfinite(tree.query(joints[i].positions, 1, 0, 2, SAME_POINT)[0]).any()
                for i in group
            )
        ]
        joined = [k, *(i for group in near for i in group)]
        groups = [*(g for g in groups if g not in near), joined]
    return [Network(tuple(joints[k] for k in sorted(group)), everything) for group in groups]


def heads_of(joints: Sequence[JointState]) -> list[Heads]:
    """Return the head of the water in each joint."""
    found: dict[int, Heads] = {}
    for network in networks(joints):
        alone = network.first.values["uplift"] in ("imposed", "drained")
        if len(network.joints) == 1 and alone and not joints[0].request.geometry:
            found[network.first.number] = line(network.first)
            continue
        for k, joint in enumerate(network.joints):
            found[joint.number] = network.heads_of(k)
    return [found.get(k, at_level(joint.level)) for k, joint in enumerate(joints)]


def at_level(level: float) -> Heads:
    """Return a uniform head [m]."""
    return lambda positions: np.full(len(positions), level)


def line(joint: JointState) -> Heads:
    """Return the head of a joint of uniform transmissivity, with drains or without."""
    distances, heads = line_over_drains(joint)
    return lambda positions: np.interp(joint.distance(positions), distances, heads)
