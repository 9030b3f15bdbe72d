"""Pressure and flux of the water in the joints, from the written openings.

Heads at the ends by the levels; between them, by `uplift`, a straight line, the line over the
drains, or the flow through the openings: in 2D the elements are resistances in series, in a network
where joints meet, in 3D finite elements. The discretisation is that of reference/theory.md:
pressure of order 1, the cube of the aperture integrated by the points of the joint law.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal, localcontext
from functools import cache, cached_property
from typing import Any, Protocol, TypeVar

import meshio
import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from .files import Files, Table, rows_where
from .reader import Request, RequestedJoint, Values
from .solids import SHAPES, Array, IntArray, Sides, corners_of, functions, rule

#: Error of a pressure over the largest one, and of a flux over its scale: they are written with 12
#: digits. In 3D, of a system of equations.
DIGITS, IN_3D = 1e-9, 1e-6
#: Last digits of the heads by which a flux may differ: those of two solutions.
HEAD_DIGITS = 10
#: Places of nodes have 9 decimals [m].
SAME_POINT = 1e-7
#: Part of their effect below which drains have none [-]: rounding.
NO_EFFECT = 1e-9
#: Times that differ by less are the same.
SAME_TIME = 1e-9
#: Aperture of the closed joint with uplift = cracked [m].
CRACK_APERTURE = 1 / 4.5e9
#: Its largest growth over it [-].
CRACK_MOST = 100.0
#: Digits of the elimination in a network: conductances of open and closed joints differ by 1e18.
PRECISION = 60
#: Reynolds number from which flow between smooth plates is turbulent [-].
TURBULENT = (96 / 0.316) ** (4 / 3)
#: Change of the drops of the head over the largest one up to which it is settled [-].
SETTLED = 1e-12
#: The same in 3D, where it is that of a system of equations [-].
SETTLED_IN_3D = 1e-10
#: Modes whose water flows, and those that water does not pass.
FLOWING, CLOSED = ("flow", "cracked"), ("none", "waterstop")


# -- joints
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class JointState(RequestedJoint):
    """A joint at a time: rows of its nodes, its elements, and the openings."""

    rows: Table
    sides: tuple[Sides, ...]
    tail: float
    #: rows of its integration points when the step began; none: undamaged
    before: Table

    @property
    def level(self) -> float:
        """Level of the reservoir [m], with the offset of the joint's heel."""
        return float(self.rows["level"][0]) + float(self.values["joint_head_offset"])

    @cached_property
    def positions(self) -> Array:
        """Positions of the rows (n, 3)."""
        return coordinates(self.rows)

    @cached_property
    def ends(self) -> tuple[Array, Array]:
        """Positions (2,) of heel and toe in the plane of x and y."""
        s = self.rows["s"]
        return self.positions[s.argmin(), :2], self.positions[s.argmax(), :2]

    @cached_property
    def along(self) -> Array:
        """Direction (2,) from heel to toe of a plane joint."""
        heel, toe = self.ends
        return np.asarray((toe - heel) / np.linalg.norm(toe - heel))

    @property
    def length(self) -> float:
        """Distance from heel to toe [m]."""
        return float(np.linalg.norm(self.ends[1] - self.ends[0]))

    def distance(self, positions: Array) -> Array:
        """Return the distance from the heel at positions (q, 3) [m]."""
        return np.asarray((positions[:, :2] - self.ends[0]) @ self.along)

    @property
    def unit_weight(self) -> float:
        """Weight of water [N/m3]."""
        return float(self.values["rho_water"] * self.values["g"])

    def find(self, coordinates: Array) -> IntArray:
        """Return the rows at points (..., 3)."""
        distance, found = map(np.asarray, cKDTree(self.positions).query(coordinates))
        if distance.max(initial=0) > SAME_POINT:
            raise ValueError("joint.csv: a node of the joint's elements has no row")
        return np.asarray(found, int)

    def widening(self) -> list[Array]:
        """Return, of the elements of each shape, the hydraulic aperture over that of the closed
        joint at the points of the law (m, q).
        """
        found, start = [], 0
        for sides in self.sides:
            u, _ = joint_rule(sides.shape, sides.order, self.values["quadrature"])
            at = functions(sides.shape, sides.order, u)
            jump = self.rows["delta_n"][self.find(sides.coordinates)] @ at.T
            opening = np.maximum(jump, 0)
            if self.values["uplift"] == "flow":
                wider = np.maximum(jump + self.values["aperture_elastic"], 0)
                found.append(1 + wider / self.values["aperture_min"])
            elif self.values["uplift"] == "cracked":
                crack = self.crack_opening(start, opening.size).reshape(opening.shape)
                beyond = np.maximum(opening - crack, 0)
                aperture = CRACK_APERTURE * self.values["dam_height"]
                found.append(1 + np.minimum(beyond / aperture, CRACK_MOST))
            else:
                found.append(np.ones_like(opening))
            start += opening.size
        return found

    def slowed(self, cube: Array, slopes: Array) -> Array:
        """Return the flow between smooth plates over that of the cubic law, for the cubes of the
        aperture (m, q) and slopes of the head, of elements (m, 1) or at points (m, q): beyond the
        Reynolds number at which both friction factors are equal, 96/Re and 0.316/Re^(1/4), by the
        second one.
        """
        values = self.values
        gradient = self.unit_weight * np.abs(slopes)
        number = values["rho_water"] * cube * gradient / (6 * values["visc"] ** 2)
        return np.asarray(np.minimum(1.0, (TURBULENT / np.maximum(number, 1)) ** (3 / 7)))

    def crack_opening(self, start: int, number: int) -> Array:
        """Return the opening [m] beyond which integration points (start, ...) are cracked: what had
        broken before the step lets the water in.
        """
        values, f_t = self.values, float(self.values["sigma_max"])
        damage = self.before["damage"][start : start + number]
        damage = damage if len(damage) else np.zeros(number)
        if values["law"] == "friction":
            return np.full(number, values["adhesion"] / values["mu"] / values["K_N"])
        softened = 2 * values["G_f"] / f_t if f_t else 0.0
        if values["law"] == "rupture":
            softened = (1 + values["pena_rupture"]) * f_t / values["K_N"]
        if values["law"] == "endo":
            return np.full(number, softened)
        cracked = 1 - np.exp(-2) if values["softening"] == "exponential" else 1.0
        return np.where(damage >= cracked, 0.0, softened)


@cache
def joint_rule(shape: str, order: int, quadrature: str) -> tuple[Array, Array]:
    """Reference points (q, d) and weights (q,) of the joint law: as many as integrate the square of
    the jump, or those of the published elements.
    """
    if shape == "triangle":
        if order == 2:
            return rule("triangle")
        if quadrature == "published":
            return np.full((1, 2), 1 / 3), np.array([0.5])
        return np.array([[1, 1], [4, 1], [1, 4]]) / 6, np.full(3, 1 / 6)
    x, w = np.polynomial.legendre.leggauss(2 if quadrature == "published" else order + 1)
    if shape == "line":
        return x[:, None], w
    return np.array([(a, b) for a in x for b in x]), np.outer(w, w).ravel()


def sides_of(files: Files, request: Request, number: int, rows: Table) -> tuple[Sides, ...]:
    """Return the elements of a joint: in 2D between its nodes along it, in 3D those of the file
    fields/joint_t*.vtu, joint_2_t*.vtu, ...
    """
    order = int(request.joints[0]["order"])
    if request.joints[0]["dim"] == 2:
        by_s = np.argsort(rows["s"])[::order]
        corners = np.column_stack([rows[name][by_s] for name in "xyz"])
        return (Sides("line", np.stack([corners[:-1], corners[1:]], axis=1), order),)
    name = f"joint_{number + 1}_t*.vtu" if number else "joint_t*.vtu"
    mesh: Any = meshio.read(next((files.folder / "fields").glob(name)))
    tables = [corners_of(block)[1] for block in mesh.cells]
    return tuple(Sides(SHAPES[t.shape[1]], mesh.points[t], order) for t in tables)


# -- heads
# --------------------------------------------------------------------------------------------------

#: Head [m] at positions (q, 3).
Heads = Callable[[Array], Array]


def heads_at_ends(
    heel: float, toe: float, level: float, tail: float, flowing: bool
) -> tuple[float, float]:
    """Return the heads [m] at heel and toe of these heights. A dry end has its own elevation; water
    that flows does not enter there: a lower head on the other side holds here, too.
    """
    if level <= heel and tail <= toe:
        rest = min(heel, toe, max(level, tail))
        return rest, rest
    first = level if level > heel else min(heel, tail) if flowing else heel
    last = tail if tail > toe else min(toe, level) if flowing else toe
    return first, last


def line_over_drains(joint: JointState) -> tuple[list[float], list[float]]:
    """Return positions [m from the heel] and heads [m] of uplift = imposed or drained."""
    values, length = joint.values, joint.length
    heel, toe = (float(end[1]) for end in joint.ends)
    first, last = heads_at_ends(heel, toe, joint.level, joint.tail, flowing=False)
    if values["uplift"] != "drained":
        return [0, length], [first, last]
    at = values["drain_x"]
    undrained = first + (last - first) * at / length
    if values["drain_reference"] == "reservoir":
        undrained = first
    outlet = max(values["drain_level"], joint.tail, joint.ends[0][1] + at * joint.along[1])
    drained = undrained - values["drain_effectiveness"] * max(undrained - outlet, 0)
    return [0, at, length], [first, drained, last]


def pressure(joint: JointState, heads: Heads, least: float = 0.0) -> Callable[[Array], Array]:
    """Return the pressure [Pa] at positions (q, 3) from the head there; least: where voids form."""
    values = joint.values

    def at(positions: Array) -> Array:
        if values["uplift"] == "none":
            return np.zeros(len(positions))
        full = np.maximum(joint.unit_weight * (heads(positions) - positions[:, 1]), least)
        if values["uplift"] != "waterstop":
            return np.asarray(full)
        stop = values["waterstop"]
        return np.asarray(full * (joint.distance(positions) <= stop + SAME_POINT) * (stop > 0))

    return at


# -- flow
# --------------------------------------------------------------------------------------------------


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


# -- check
# --------------------------------------------------------------------------------------------------


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
    coordinates, heads = line_over_drains(joint)
    return lambda positions: np.interp(joint.distance(positions), coordinates, heads)


def states(
    files: Files, request: Request, steps: Table
) -> Iterator[tuple[float, list[JointState]]]:
    """Yield at each requested time the number of its update and the joints."""
    for table in files.joint_tables:
        still = rows_where(steps, steps["earthquake"] == 0)
        update = update_at(still, table["time"][0], table["level"][0])
        tail = float(steps["tail_level"][steps["update"] == update][0])
        joints = []
        for k in range(len(request.joints)):
            opened, softened = water_follows(request.joints[k], steps, update)
            now, then = (
                rows_where(steps, (steps["update"] == number) & (steps["joint"] == k + 1))
                for number in (update, opened)
            )
            rows = with_all_digits(rows_where(table, table["joint"] == k + 1), now, then)
            sides = sides_of(files, request, k, rows)
            before = rows_where(steps, (steps["update"] == softened) & (steps["joint"] == k + 1))
            before = rows_where(before, before["weight"] > 0)
            joints.append(JointState(request, k, rows, sides, tail, before))
        yield update, joints


def water_follows(values: Values, steps: Table, update: float) -> tuple[float, float]:
    """Return the numbers of the updates whose openings and whose damage the water of an update
    follows: its own and the one before; in a pseudo-static earthquake with quake_uplift = unchanged
    the last one before it.
    """
    last = 1 - values["quake_t"]
    acts = bool(values["k_h"] or values["k_v"]) and values["quake_uplift"] == "unchanged"
    time = float(steps["time"][steps["update"] == update][0])
    if not acts or time + last <= 0:
        return update, update - 1
    earlier = float(steps["update"][steps["time"] + last <= SAME_TIME].max(initial=0))
    return earlier, earlier


def with_all_digits(rows: Table, now: Table, opened: Table) -> Table:
    """Return rows of a joint with the coordinates of the nodes in steps.csv, and with the openings
    that the water follows; none: closed.
    """
    nodes, then = (rows_where(table, table["weight"] == 0) for table in (now, opened))
    found = np.asarray(cKDTree(coordinates(nodes)).query(coordinates(rows))[1])
    exact = rows | {name: nodes[name][found] for name in "xyz"}
    openings = then["delta_n"][found] if len(then["delta_n"]) else np.zeros(len(found))
    return exact | {"delta_n": openings}


def coordinates(table: Table) -> Array:
    """Return the positions (n, 3) of rows."""
    return np.column_stack([table[name] for name in "xyz"])


def update_at(steps: Table, time: float, level: float) -> float:
    """Return the number of the last update at a time and level, which a table has with 12 digits.
    Points of an equilibrium path have the time of their step's end: they are found by the level.
    """
    by_level = np.abs(steps["level"] - level) <= SAME_TIME * max(abs(level), 1)
    exact = by_level & (np.abs(steps["time"] - time) <= SAME_TIME * max(time, 1))
    return float(steps["update"][exact if exact.any() else by_level].max())


def violations(files: Files, request: Request, steps: Table) -> Iterator[str]:
    """Yield where pressure or flux differ from those that follow from the openings, but where water
    is stored, see water_in_time; in 3D of a run with fields, which have the elements of the joints.
    """
    plane = request.joints[0]["dim"] == 2
    room = DIGITS if plane else IN_3D
    if not plane and not (files.folder / "fields").is_dir():
        return
    for _, joints in states(files, request, steps):
        time = joints[0].rows["time"][0]
        together = networks(joints)
        stored = {
            joint.number
            for network in together
            for joint in network.joints
            if network.flowing and is_stored(request, time)
        }
        for joint, heads in zip(joints, heads_of(joints), strict=True):
            if joint.number in stored:
                continue
            exact = pressure(joint, heads)(joint.positions)
            scale = joint.unit_weight * max(
                joint.level, joint.tail, request.joints[0]["dam_height"]
            )
            error = np.abs(joint.rows["p"] - exact).max()
            if error > room * scale:
                yield f"joint {joint.number + 1}: p off by {error:.3g} Pa at t = {time:g}"
        for network in together:
            for k, joint in enumerate(network.joints):
                if joint.values["uplift"] == "flow" and joint.number not in stored:
                    yield from flux(files, network, k, room)


def is_stored(request: Request, time: float) -> bool:
    """Whether water flows in time, see water_in_time, in the step to a time of the static loads."""
    first = request.joints[0]
    return bool(first["time_unit"] and time > first["time_start"])


def flux(files: Files, network: Network, joint: int, room: float) -> Iterator[str]:
    """Yield where the flux in the tables of a joint differs."""
    state = network.joints[joint]
    time, history = state.rows["time"][0], files.history_of(state.number)
    means, leakage, scale, by_digits = network.flux(joint)
    written = float(history["flux"][np.argmin(np.abs(history["time"] - time))])
    for what, error in (
        ("flux", np.abs(state.rows["flux"] - means).max()),
        ("leakage", abs(written - leakage)),
    ):
        if error > max(room * scale, HEAD_DIGITS * by_digits):
            yield f"joint {state.number + 1}: {what} off by {error:.3g} kg/(m s) at t = {time:g}"
