"""Pressure of water that flows in the joints in time (2D), replayed along the written openings.

With `time_unit` > 0, and in an earthquake with `quake_uplift = transient`: section 5 of
reference/theory.md. In every step what each node stores, S p + V - v, balances what flows to it:
implicit Euler, V and S lumped, voids v complementary to the pressure above `pressure_min`. The
linear equations are solved in numbers of PRECISION digits, the nodes with voids found one set after
the other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal, localcontext
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from .files import Files, Table, rows_where, split_by
from .reader import Asked
from .solids import Array, functions
from .water import (
    DIGITS,
    PRECISION,
    SAME_TIME,
    Flow,
    Graph,
    Heads,
    JointState,
    Network,
    is_stored,
    joint_rule,
    networks,
    places,
    states,
    with_all_digits,
)

#: Number of the state before the first update, without loads: closed joints, no water.
UNLOADED = -1
#: Sets of nodes with voids at most. Where water runs down from nodes with voids, some may have
#: voids as long as they count as full, and none without: no set is the right one.
MOST_SETS = 50
#: Pressure below the least one over the largest head, and a void below zero over what the node
#: stores, up to which they count as rounding [-].
ROUNDING = 1e-12


def applies(asked: Asked) -> bool:
    """Whether water is stored in the joints of a run in 2D."""
    first = asked.joints[0]
    return bool(first["dim"] == 2 and any(joint["uplift"] == "flow" for joint in asked.joints))


@dataclass(frozen=True)
class Stored:
    """Water at the nodes (n,) [m3 per metre]: stored, voids, what has come in so far."""

    volume: Array
    void: Array
    inflow: Array


#: Without drains, and with drains of full effect.
Histories: TypeAlias = tuple[Stored, Stored]


@dataclass(frozen=True)
class Filled:
    """The end of a step: pressure at the nodes (n,) [Pa], what is stored, and the drops of the head
    along the elements (m,) [m].
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

    def lumped(self, uniform: bool) -> Array:
        """Return the integral of the aperture, of 1 if uniform, lumped at the nodes (n,)."""
        total = np.zeros(len(self.network.nodes))
        parts = zip(self.network.joints, self.network.tables, self.network.widening, strict=True)
        for joint, (table,), (factor,) in parts:
            (sides,) = joint.sides
            u, w = joint_rule(sides.shape, sides.order, joint.values["quadrature"])
            aperture = np.ones_like(factor) if uniform else joint.values["aperture_min"] * factor
            sizes = aperture * np.outer(sides.measures, w)
            np.add.at(total, table, sizes @ functions(sides.shape, 1, u))
        return total

    @property
    def storage(self) -> Array:
        """What the nodes store by pressure (n,) [m3/Pa per metre]."""
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
            return Stored(self.lumped(False) + self.storage * pressure, nothing, nothing)

        return under(free), under(network.solve(False, outlets).heads if act else free)

    def step(self, begins: Histories, seconds: float) -> tuple[Array, Histories]:
        """Return the pressure at the nodes (n,) [Pa] at the end of a step, and what is stored: the
        water without drains, and that with drains of full effect, have histories of their own.
        """
        drains, effect = self.network.drains()
        weight = self.network.first.unit_weight
        outlets = {n: weight * head for n, head in drains.items()}
        free, drained = (self.without_drains(begin, seconds, {}) for begin in begins)
        total = drained.pressure + self.elevation
        if outlets and all(total[n] > head for n, head in outlets.items()):
            drained = self.without_drains(begins[1], seconds, outlets)
        pressure = (1 - effect) * free.pressure + effect * drained.pressure
        return pressure, (free.stored, drained.stored)

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
        graph = network.operator(False, drops)
        assert isinstance(graph, Graph)  # in the plane
        pairs = graph.pairs
        conductances = graph.conductances / (12 * first.values["visc"])
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
            total, out, falling = solved(pairs, conductances, ground, source, heads)
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
                end = Stored(stored, void, begin.inflow + inflow)
                return Filled(pressure, end, falling / first.unit_weight)
            voids, air = (voids | empties) & ~fills, drawn
        raise NoSet


def solved(
    pairs: NDArray[np.int_],
    conductances: Array,
    ground: Array,
    source: Array,
    fixed: dict[int, float],
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
        original = [dict(own) for own in links]
        store, right = [[Decimal(float(x)) for x in values] for values in (ground, source)]
        eliminated = []
        for node in sorted(set(range(number)) - set(fixed), key=lambda n: len(links[n])):
            own = links[node]
            whole = sum(own.values(), store[node])
            for a, size in own.items():
                del links[a][node]
                store[a] += size * store[node] / whole
                right[a] += size * right[node] / whole
                for b, other in own.items():
                    if a != b:
                        links[a][b] = links[a].get(b, Decimal(0)) + size * other / whole
            eliminated.append((node, own, whole))
        heads = {node: Decimal(head) for node, head in fixed.items()}
        for node, own, whole in reversed(eliminated):
            flow = sum((size * heads[b] for b, size in own.items()), right[node])
            heads[node] = flow / whole
        out = [
            float(sum((size * (heads[n] - heads[b]) for b, size in own.items()), Decimal(0)))
            for n, own in enumerate(original)
        ]
        drops = [float(heads[i] - heads[k]) for i, k in pairs.tolist()]
    return np.array([float(heads[n]) for n in range(number)]), np.array(out), np.array(drops)


@dataclass(frozen=True)
class Update:
    """A step of the water: its number among the updates, that of its beginning, its length [s]."""

    number: int
    begin: int
    seconds: float


def steps_of(asked: Asked, updates: Sequence[Table]) -> Iterator[Update]:
    """Yield the updates of a joint in which water flows in time."""
    values = asked.joints[0]
    moving = values["quake_uplift"] == "transient"
    times = [(float(u["begin"][0]), float(u["time"][0])) for u in updates]
    for n, update in enumerate(updates):
        begin, time = times[n]
        if update["earthquake"][0]:
            if moving:
                yield Update(n, n - 1, time - begin)
            continue
        if any(u["earthquake"][0] for u in updates[:n]) or not is_stored(asked, time):
            continue
        # a further point of a path starts from the water of the first one's beginning
        before = min(begin + SAME_TIME, time - SAME_TIME)
        start = max((k for k in range(n) if times[k][1] <= before), default=UNLOADED)
        since = max(times[start][1] if start >= 0 else 0.0, values["time_start"])
        seconds = (time - since) * values["time_unit"]
        yield Update(n, start, seconds)


@dataclass(frozen=True)
class Wet:
    """The water of a network after an update, by its number: pressure at the nodes (n,) [Pa]."""

    number: int
    network: Network
    pressure: Array

    def heads(self) -> dict[int, Heads]:
        """Return the head of each joint by its number."""
        weight, nodes = self.network.first.unit_weight, self.network.nodes
        solution = Flow(self.pressure / weight + nodes[:, 1], np.zeros(0), np.zeros(0))
        # of the functions of order 1 through these heads in place of those of steady flow
        known = replace(self.network)
        known.__dict__["flow"] = solution
        return {joint.number: known.heads_of(k) for k, joint in enumerate(self.network.joints)}


def replayed(files: Files, asked: Asked, steps: Table) -> Iterator[Wet]:
    """Yield the water of all networks that flow in time, after every update in which they do; the
    written one after a step without a set of nodes with voids.
    """
    if not applies(asked):
        return
    updates = updates_of(asked, steps)
    plan = list(steps_of(asked, updates[0]))
    if not plan:
        return
    _, like = next(iter(states(files, asked, steps)))
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
                    pressure, known[which, step.number] = slot.step(begin, step.seconds)
                except NoSet:
                    lost.add(which)
            if which in lost:
                pressure = written(slot.network, [of[step.number] for of in updates])
            yield Wet(step.number, slot.network, pressure)


def written(network: Network, updates: Sequence[Table]) -> Array:
    """Return the written pressure [Pa] at the nodes of a network (n,), from the rows of all joints
    after an update.
    """
    pressure = np.zeros(len(network.nodes))
    for k, joint in enumerate(network.joints):
        own, rows = network.nodes_of(k), updates[joint.number]
        rows = rows_where(rows, rows["weight"] == 0)
        pressure[own] = rows["p"][np.asarray(cKDTree(places(rows)).query(network.nodes[own])[1])]
    return pressure


def heads_in_time(files: Files, asked: Asked, steps: Table) -> dict[float, dict[int, Heads]]:
    """Return the heads in joints by their number, by the column `update` of the static loads."""
    found: dict[float, dict[int, Heads]] = {}
    if not asked.joints[0]["time_unit"]:
        return found
    first = updates_of(asked, steps)[0] if applies(asked) else []
    for wet in replayed(files, asked, steps):
        found.setdefault(float(first[wet.number]["update"][0]), {}).update(wet.heads())
    return found


def violations(files: Files, asked: Asked, steps: Table) -> Iterator[str]:
    """Yield of each joint the step whose pressure is wrong, and by how much the worst one is."""
    worst: dict[int, tuple[float, float]] = {}
    updates = updates_of(asked, steps)
    for wet in replayed(files, asked, steps):
        found = written(wet.network, [of[wet.number] for of in updates])
        for k, joint in enumerate(wet.network.joints):
            own = wet.network.nodes_of(k)
            error = float(np.abs(found[own] - wet.pressure[own]).max())
            scale = joint.unit_weight * max(joint.level, joint.tail, joint.values["dam_height"])
            if not error <= DIGITS * scale and error > worst.get(joint.number, (0.0, 0.0))[0]:
                worst[joint.number] = error, float(updates[0][wet.number]["time"][0])
    for k, (error, time) in worst.items():
        yield f"joint {k + 1}: p of the flow in time off by {error:.3g} Pa at t = {time:g}"


def updates_of(asked: Asked, steps: Table) -> list[list[Table]]:
    """Return the updates of each joint."""
    numbers = range(len(asked.joints))
    return [split_by(rows_where(steps, steps["joint"] == k + 1), "update") for k in numbers]


def at_update(joint: JointState, rows: Table, loaded: bool) -> JointState:
    """Return a joint with the openings and levels of an update; loaded: else closed, and dry."""
    opened = with_all_digits(joint.rows, rows, rows)
    level = np.full(len(opened["level"]), rows["level"][0] * loaded)
    opened |= {"level": level, "delta_n": opened["delta_n"] * loaded}
    before = rows_where(rows, rows["weight"] > 0)
    return replace(joint, rows=opened, tail=float(rows["tail_level"][0]) * loaded, before=before)
