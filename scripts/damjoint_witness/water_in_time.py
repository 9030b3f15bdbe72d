"""Pressure of water that flows in the joints in time, replayed along the written openings.

With `time_unit` > 0, and in an earthquake with `quake_uplift = transient`: section 5 of
reference/theory.md. In every step what each node stores, S p + V - v, balances what flows to it:
implicit Euler, V and S lumped, voids v complementary to the pressure above `pressure_min`. In 2D
the linear equations are solved in numbers of PRECISION digits, in 3D those of finite elements of
order 1, whose entries beside the diagonal are conductances between pairs of nodes. The nodes with
voids are found one set after the other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal, localcontext
from typing import Any, TypeAlias

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from .files import Files, Table, rows_where, split_by
from .joint_state import (
    SAME_TIME,
    Heads,
    JointState,
    coordinates,
    is_stored,
    joint_rule,
    states,
    update_at,
    with_all_digits,
)
from .network import PRECISION, Flow, Graph, Network, networks
from .reader import Request
from .solids import Array, IntArray, functions
from .water import DIGITS, IN_3D

#: Number of the state before the first update, without loads: closed joints, no water.
UNLOADED = -1
#: Sets of nodes with voids at most. Where water runs down from nodes with voids, some may have
#: voids as long as they count as full, and none without: no set is the right one.
MOST_SETS = 50
#: Error of the mass of the water over what is stored and has come in at all nodes.
MASS = 1e-6
#: Pressure below the least one over the largest head, and a void below zero over what the node
#: stores, up to which they count as rounding [-].
ROUNDING = 1e-12


def applies(files: Files, request: Request) -> bool:
    """Whether water may be stored in the joints of a run; in 3D one with fields, which have the
    elements of the joints.
    """
    known = request.joints[0]["dim"] == 2 or (files.folder / "fields").is_dir()
    return known and any(joint["uplift"] == "flow" for joint in request.joints)


@dataclass(frozen=True)
class Stored:
    """Water at the nodes (n,) [m3; 2D: per metre]: stored, voids, what has come in so far."""

    volume: Array
    void: Array
    inflow: Array
    #: by which the last digits of the heads may have changed what has come in so far (n,)
    digits: Array

    def mixed(self, share: float, other: Stored) -> Stored:
        """Return the mean with a share of another state."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Stored(*((1 - share) * a + share * b for a, b in pairs))


#: Without drains, and with drains of full effect.
Histories: TypeAlias = tuple[Stored, Stored]


@dataclass(frozen=True)
class Filled:
    """The end of a step: pressure at the nodes (n,) [Pa], what is stored, and the drops of the
    head, see `Flow`.
    """

    pressure: Array
    stored: Stored
    drops: Array


class NoSet(Exception):
    """No set of nodes with voids is the right one."""


@dataclass(frozen=True)
class Slot:
    """The water of a network under written openings."""

    network: Network

    @property
    def elevation(self) -> Array:
        """Height of the nodes times the weight of water (n,) [Pa]."""
        return np.asarray(self.network.first.unit_weight * self.network.nodes[:, 1])

    def lumped(self, uniform: bool, only: int | None = None) -> Array:
        """Return the integral of the aperture, of 1 if uniform, lumped at the nodes (n,); only:
        that over one of the joints.
        """
        total = np.zeros(len(self.network.nodes))
        parts = zip(self.network.joints, self.network.tables, self.network.widening, strict=True)
        for k, (joint, tables, widening) in enumerate(parts):
            if only not in (None, k):
                continue
            for sides, table, factor in zip(joint.sides, tables, widening, strict=True):
                u, w = joint_rule(sides.shape, sides.order, joint.values["quadrature"])
                aperture = joint.values["aperture_min"] * factor
                sizes = np.outer(sides.measures, w) * (1 if uniform else aperture)
                np.add.at(total, table, sizes @ functions(sides.shape, 1, u))
        return total

    @property
    def storage(self) -> Array:
        """What the nodes store by pressure (n,) [m3/Pa; 2D: per metre]."""
        return np.asarray(self.network.first.values["storage"] * self.lumped(uniform=True))

    def at_rest(self) -> Histories:
        """Return what is stored in steady flow, without and with drains; suction stores nothing."""
        network = self.network
        weight, (outlets, _) = network.first.unit_weight, network.drains()
        free = network.solve(uniform=not network.flowing).heads
        act = bool(outlets) and all(free[n] > head for n, head in outlets.items())
        nothing = np.zeros(len(free))

        def under(heads: Array) -> Stored:
            pressure = np.maximum(weight * heads - self.elevation, 0)
            return Stored(self.lumped(False) + self.storage * pressure, nothing, nothing, nothing)

        return under(free), under(network.solve(False, outlets).heads if act else free)

    def step(self, begins: Histories, seconds: float) -> tuple[Filled, Histories]:
        """Return the end of a step, and what is stored by its parts: the water without drains, and
        that with drains of full effect, have histories of their own.
        """
        drains, effect = self.network.drains()
        weight = self.network.first.unit_weight
        outlets = {n: weight * head for n, head in drains.items()}
        free, drained = (self.without_drains(begin, seconds, {}) for begin in begins)
        total = drained.pressure + self.elevation
        least = ROUNDING * np.abs(total).max()
        if outlets and all(total[n] > head + least for n, head in outlets.items()):
            drained = self.without_drains(begins[1], seconds, outlets)
        pressure = (1 - effect) * free.pressure + effect * drained.pressure
        mean = free.stored.mixed(effect, drained.stored)
        return Filled(pressure, mean, free.drops), (free.stored, drained.stored)

    def of_joint(self, joint: int, values: Array) -> float:
        """Return the sum of values (n,) at the nodes of a joint, per metre of thickness: at a node
        of several joints by the part of its area that is this joint's.
        """
        share = self.lumped(True, joint) / self.lumped(True)
        return float(share @ values) / (float(np.ptp(self.network.nodes[:, 2])) or 1.0)

    def without_drains(self, begin: Stored, seconds: float, fixed: dict[int, float]) -> Filled:
        """Return the end of a step, see `step`; fixed: heads times the weight of water [Pa] beside
        those of the ends.
        """
        return self.network.settled(lambda drops: self._filled(begin, seconds, fixed, drops))

    def _filled(
        self, begin: Stored, seconds: float, fixed: dict[int, float], drops: Array | None
    ) -> Filled:
        network, elevation = self.network, self.elevation
        first = network.first
        number, lowest = len(elevation), float(first.values["pressure_min"])
        known: dict[int, float] = dict(fixed)
        dry = np.zeros(number, bool)
        for nodes, level in zip(network.ends, (first.level, first.tail), strict=True):
            for n in nodes.tolist():
                dry[n] = level <= network.nodes[n, 1]
                known[n] = max(first.unit_weight * level, float(elevation[n]))
        operator = network.operator(False, drops)
        solve = solved if isinstance(operator, Graph) else solved_by_matrix
        pairs, conductances = (
            (operator.pairs, operator.conductances)
            if isinstance(operator, Graph)
            else pairs_of(operator.matrix)
        )
        conductances = conductances / (12 * first.values["visc"])
        volume, storage = self.lumped(False), self.storage
        ground, rest = storage / seconds, begin.volume - volume + storage * elevation
        falls = conductances * (elevation[pairs[:, 0]] - elevation[pairs[:, 1]])
        upper = np.where(falls > 0, pairs[:, 0], pairs[:, 1])
        downwards = np.bincount(upper, np.abs(falls), number)
        is_known = np.isin(np.arange(number), list(known))
        voids, air = (begin.void > 0) & ~is_known, (begin.void > 0) & dry
        for _ in range(MOST_SETS):
            most = np.maximum(begin.volume, 0) / seconds
            short = (voids | air) & (downwards > most)
            share = np.where(short, most / np.where(short, downwards, 1), 1.0)
            missing = (1 - share[upper]) * falls
            lacking = np.bincount(pairs[:, 0], missing, number)
            lacking = lacking - np.bincount(pairs[:, 1], missing, number)
            heads = known | {int(n): lowest + float(elevation[n]) for n in np.flatnonzero(voids)}
            source = rest / seconds + lacking
            total, out, falling = solve(pairs, conductances, ground, source, heads)
            pressure = total - elevation
            excess = volume + storage * pressure - begin.volume + seconds * (out - lacking)
            largest = np.abs(total).max()
            diagonal = np.bincount(pairs.ravel(), np.repeat(conductances, 2), number)
            least = ROUNDING * (volume + np.abs(begin.volume) + seconds * diagonal * largest)
            empties = (pressure < lowest - ROUNDING * largest) & ~voids & ~is_known
            fills = voids & (excess < -least)
            drawn = dry & (excess > least * np.where(air, -1, 1))
            if not (empties.any() or fills.any()) and np.array_equal(air, drawn):
                void = np.where(voids | dry, np.maximum(excess, 0), 0)
                inflow = np.where(is_known, np.where(dry, np.minimum(excess, 0), excess), 0)
                stored = volume + storage * pressure - void
                digits = begin.digits + np.where(is_known, least, 0)
                end = Stored(stored, void, begin.inflow + inflow, digits)
                drops = falling if isinstance(operator, Graph) else operator.gradients(total)
                return Filled(pressure, end, drops / first.unit_weight)
            voids, air = (voids | empties) & ~fills, drawn
        raise NoSet


def pairs_of(matrix: Any) -> tuple[IntArray, Array]:
    """Return the pairs of nodes that a symmetric matrix whose rows have the sum 0 connects (m, 2),
    and their conductances (m,).
    """
    upper = sparse.triu(matrix, 1).tocoo()
    return np.column_stack([upper.row, upper.col]).astype(int), -upper.data


def solved_by_matrix(
    pairs: IntArray, conductances: Array, ground: Array, source: Array, fixed: dict[int, float]
) -> tuple[Array, Array, Array]:
    """Return what `solved` does, by a dense matrix."""
    number = len(ground)
    matrix = np.zeros((number, number))
    np.add.at(matrix, (pairs[:, 0], pairs[:, 1]), -conductances)
    matrix += matrix.T
    np.fill_diagonal(matrix, -matrix.sum(axis=1))
    heads = np.zeros(number)
    heads[list(fixed)] = list(fixed.values())
    free = np.setdiff1d(np.arange(number), list(fixed))
    if len(free):
        square = matrix[np.ix_(free, free)] + np.diag(ground[free])
        heads[free] = np.linalg.solve(square, source[free] - matrix[free] @ heads)
    return heads, matrix @ heads, heads[pairs[:, 0]] - heads[pairs[:, 1]]


def solved(
    pairs: IntArray, conductances: Array, ground: Array, source: Array, fixed: dict[int, float]
) -> tuple[Array, Array, Array]:
    """Return heads (n,) of the flow with what nodes store, ground (n,), and sources (n,), for fixed
    heads by node; what flows out of each node (n,); the drops along the pairs (m,). The others are
    eliminated one by one.
    """
    number = len(ground)
    with localcontext() as context:
        context.prec = PRECISION
        links: list[dict[int, Decimal]] = [{} for _ in range(number)]
        for (i, k), size in zip(pairs.tolist(), conductances.tolist(), strict=True):
            for a, b in ((i, k), (k, i)):
                links[a][b] = links[a].get(b, Decimal(0)) + Decimal(size)
        original = [dict(linked) for linked in links]
        store, right = [[Decimal(float(x)) for x in values] for values in (ground, source)]
        eliminated = []
        for node in sorted(set(range(number)) - set(fixed), key=lambda n: len(links[n])):
            linked = links[node]
            whole = sum(linked.values(), store[node])
            for a, size in linked.items():
                del links[a][node]
                store[a] += size * store[node] / whole
                right[a] += size * right[node] / whole
                for b, other in linked.items():
                    if a != b:
                        links[a][b] = links[a].get(b, Decimal(0)) + size * other / whole
            eliminated.append((node, linked, whole))
        heads = {node: Decimal(head) for node, head in fixed.items()}
        for node, linked, whole in reversed(eliminated):
            flow = sum((size * heads[b] for b, size in linked.items()), right[node])
            heads[node] = flow / whole
        out = [
            float(sum((size * (heads[n] - heads[b]) for b, size in linked.items()), Decimal(0)))
            for n, linked in enumerate(original)
        ]
        drops = [float(heads[i] - heads[k]) for i, k in pairs.tolist()]
    return np.array([float(heads[n]) for n in range(number)]), np.array(out), np.array(drops)


@dataclass(frozen=True)
class Update:
    """A step of the water: its number among the updates, that of its beginning, its length [s]."""

    number: int
    begin: int
    seconds: float


def steps_of(request: Request, updates: Sequence[Table]) -> Iterator[Update]:
    """Yield the updates of a joint in which water flows in time."""
    values = request.joints[0]
    moving = values["quake_uplift"] == "transient"
    times = [(float(u["begin"][0]), float(u["time"][0])) for u in updates]
    for n, update in enumerate(updates):
        begin, time = times[n]
        if update["earthquake"][0]:
            if moving:
                yield Update(n, n - 1, time - begin)
            continue
        if any(u["earthquake"][0] for u in updates[:n]) or not is_stored(request, time):
            continue
        # a further point of a path starts from the water of the first one's beginning
        before = min(begin + SAME_TIME, time - SAME_TIME)
        start = max((k for k in range(n) if times[k][1] <= before), default=UNLOADED)
        since = max(times[start][1] if start >= 0 else 0.0, values["time_start"])
        seconds = (time - since) * values["time_unit"]
        yield Update(n, start, seconds)


@dataclass(frozen=True)
class Wet:
    """The water of a network after an update, by its number: pressure at the nodes (n,) [Pa], and
    what is stored; None: not known.
    """

    number: int
    network: Network
    pressure: Array
    stored: Stored | None

    def heads(self) -> dict[int, Heads]:
        """Return the head of each joint by its number."""
        weight, nodes = self.network.first.unit_weight, self.network.nodes
        solution = Flow(self.pressure / weight + nodes[:, 1], np.zeros(0), np.zeros(0))
        # of the functions of order 1 through these heads in place of those of steady flow
        known = replace(self.network)
        known.__dict__["flow"] = solution
        return {joint.number: known.heads_of(k) for k, joint in enumerate(self.network.joints)}


def replayed(files: Files, request: Request, steps: Table) -> Iterator[Wet]:
    """Yield the water of all networks that flow in time, after every update in which they do; the
    written one after a step without a set of nodes with voids.
    """
    if not applies(files, request):
        return
    updates = updates_of(request, steps)
    plan = list(steps_of(request, updates[0]))
    if not plan:
        return
    _, like = next(iter(states(files, request, steps)))
    known: dict[tuple[int, int], Histories] = {}
    lost = set[int]()

    def slots(number: int) -> list[Slot]:
        pairs = zip(like, updates, strict=True)
        joints = [at_update(joint, of[max(number, 0)], number >= 0) for joint, of in pairs]
        return [Slot(n) for n in networks(joints) if n.flowing]

    for step in plan:
        before = slots(step.begin) if (0, step.begin) not in known else []
        for which, slot in enumerate(slots(step.number)):
            if which not in lost:
                begin = known.get((which, step.begin)) or before[which].at_rest()
                try:
                    end, known[which, step.number] = slot.step(begin, step.seconds)
                    yield Wet(step.number, slot.network, end.pressure, end.stored)
                except NoSet:
                    lost.add(which)
            if which in lost:
                pressure = written(slot.network, [of[step.number] for of in updates])
                yield Wet(step.number, slot.network, pressure, None)


def written(network: Network, updates: Sequence[Table]) -> Array:
    """Return the written pressure [Pa] at the nodes of a network (n,), from the rows of all joints
    after an update.
    """
    pressure = np.zeros(len(network.nodes))
    for k, joint in enumerate(network.joints):
        numbers, rows = network.nodes_of(k), updates[joint.number]
        rows = rows_where(rows, rows["weight"] == 0)
        nearest = cKDTree(coordinates(rows)).query(network.nodes[numbers])[1]
        pressure[numbers] = rows["p"][np.asarray(nearest)]
    return pressure


def heads_in_time(files: Files, request: Request, steps: Table) -> dict[float, dict[int, Heads]]:
    """Return the heads in joints by their number, by the column `update` of the static loads."""
    found: dict[float, dict[int, Heads]] = {}
    if not request.joints[0]["time_unit"]:
        return found
    first = updates_of(request, steps)[0] if applies(files, request) else []
    for wet in replayed(files, request, steps):
        found.setdefault(float(first[wet.number]["update"][0]), {}).update(wet.heads())
    return found


def violations(files: Files, request: Request, steps: Table) -> Iterator[str]:
    """Yield of each joint the step whose pressure is wrong, and by how much the worst one is; rows
    of history.csv with another mass of the water.
    """
    worst: dict[int, tuple[float, float]] = {}
    masses = dict[int, str]()
    updates, room = updates_of(request, steps), DIGITS if request.joints[0]["dim"] == 2 else IN_3D
    rows = dict[float, int]()
    for wet in replayed(files, request, steps):
        rows = rows or rows_of_updates(files, steps)
        found = written(wet.network, [of[wet.number] for of in updates])
        row = rows.get(float(updates[0][wet.number]["update"][0]))
        for k, joint in enumerate(wet.network.joints):
            numbers = wet.network.nodes_of(k)
            error = float(np.abs(found[numbers] - wet.pressure[numbers]).max())
            scale = joint.unit_weight * max(joint.level, joint.tail, joint.values["dam_height"])
            if not error <= room * scale and error > worst.get(joint.number, (0.0, 0.0))[0]:
                worst[joint.number] = error, float(updates[0][wet.number]["time"][0])
            for text in () if row is None else mass(files, wet, k, row):
                masses.setdefault(joint.number, text)
    for k, (error, time) in worst.items():
        yield f"joint {k + 1}: p of the flow in time off by {error:.3g} Pa at t = {time:g}"
    yield from masses.values()


def rows_of_updates(files: Files, steps: Table) -> dict[float, int]:
    """Return the row of history.csv by the column `update`, of the static loads."""
    still = rows_where(steps, steps["earthquake"] == 0)
    pairs = zip(files.history["time"].tolist(), files.history["level"].tolist(), strict=True)
    return {update_at(still, time, level): n for n, (time, level) in enumerate(pairs)}


def mass(files: Files, wet: Wet, joint: int, row: int) -> Iterator[str]:
    """Yield how the columns `water`, `water_in` and `void` of a row of history.csv differ from the
    water of a joint of a network.
    """
    stored, slot = wet.stored, Slot(wet.network)
    number = wet.network.joints[joint].number
    history = files.history_of(number)
    if stored is None or "water" not in history:
        return
    moved = slot.of_joint(joint, stored.volume + stored.void + np.abs(stored.inflow))
    digits = slot.of_joint(joint, stored.digits)
    columns = {"water": stored.volume, "water_in": stored.inflow, "void": stored.void}
    for name, values in columns.items():
        exact, value = slot.of_joint(joint, values), float(history[name][row])
        if not abs(value - exact) <= MASS * moved + digits:
            off = f"{name} = {value:.9g} m2, from the openings {exact:.9g}"
            yield f"joint {number + 1}: {off} at t = {history['time'][row]:g}"


def updates_of(request: Request, steps: Table) -> list[list[Table]]:
    """Return the updates of each joint."""
    numbers = range(len(request.joints))
    return [split_by(rows_where(steps, steps["joint"] == k + 1), "update") for k in numbers]


def at_update(joint: JointState, rows: Table, loaded: bool) -> JointState:
    """Return a joint with the openings and levels of an update; loaded: else closed, and dry."""
    opened = with_all_digits(joint.rows, rows, rows)
    level = np.full(len(opened["level"]), rows["level"][0] * loaded)
    opened |= {"level": level, "delta_n": opened["delta_n"] * loaded}
    before = rows_where(rows, rows["weight"] > 0)
    return replace(joint, rows=opened, tail=float(rows["tail_level"][0]) * loaded, before=before)
