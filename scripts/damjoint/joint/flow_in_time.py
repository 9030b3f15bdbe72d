"""Water that flows in the joint and is stored in it: pressure and voids at the end of a time step.

    d(w + p/N)/dt + div q = 0,   q = -w^3/(12 visc) grad (p + rho g y)

by backward Euler with the aperture w at the end of the step: for given apertures linear in the
pressure. 1/N: storage [m/Pa]. Storage is lumped at the nodes, so that the matrix has no positive
value beside its diagonal.

Where the crack opens faster than water follows, the pressure falls to that of cavitation, p_c, and
no further: a void v >= 0 takes part of the aperture, complementary to p - p_c >= 0 [Jakobsson and
Floberg 1957, Olsson 1965; Elrod, J. Lubr. Technol. 103, 1981]. What a node stores is w + p/N - v:
mass is kept. At a dry end the pressure is zero, and what it draws in is air, a void, too. Water
flows down from a node with voids only as long as it has some.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Protocol

import numpy as np

from ..arrays import Array, BoolArray, IntArray
from ..threads import scipy_linalg
from .flow import Flow, FlowSolution, FlowSystem

#: Sets of nodes with voids at most; usually fewer than ten, and a front of water takes one for each
#: node.
MOST_SETS = 2000
#: Sets after which what nodes with voids do not give is that of the last set: else a node may have
#: voids as long as it counts as full, and none as long as it does not.
FREE_SETS = 50
#: Pressure below p_c over the largest one, and a void below zero over what the node stores and what
#: the largest head would let flow there, up to which they count as rounding [-].
ROUNDING = 1e-12
#: Rounding of a number [-].
LAST_BIT = 2.0**-53


@dataclass(frozen=True, kw_only=True)
class StoredWater:
    """The water in joints that exchange it, at their nodes (n,) [m3; 2D: per metre]: volume of the
    closed joints, and what is stored more or less than that; voids beside it; what has come in by
    ends and drains so far. time: t of this state; begin: that from which the step has led to here.
    parts: this is their mean, see `FlowInTime`.

    Two numbers: by the last digit of their sum a film without storage changes its pressure by more
    than an equilibrium may.
    """

    time: float
    closed: Array
    change: Array
    void: Array
    inflow: Array
    begin: StoredWater | None = None
    parts: tuple[StoredWater, ...] = ()

    @property
    def volume(self) -> Array:
        """All that is stored."""
        return self.closed + self.change

    def after(self, begin: StoredWater) -> StoredWater:
        """This state, as the end of a step from another one."""
        return replace(self, begin=replace(begin, begin=None))


@dataclass(frozen=True, kw_only=True)
class TimeStep:
    """A step of the water: its length [s] and what is stored at its beginning; part: its number
    among those of drains of part effect.
    """

    seconds: float
    begin: StoredWater
    part: int = 0

    @property
    def of_parts(self) -> tuple[TimeStep, TimeStep]:
        """The step without drains, and with drains of full effect."""
        begins = self.begin.parts or (self.begin,) * 2
        free, drained = (
            replace(self, begin=begin, part=number) for number, begin in enumerate(begins)
        )
        return free, drained


@dataclass(frozen=True, kw_only=True)
class FlowInTime(FlowSolution):
    """A solution at the end of a time step, with the water at the nodes: stored more than the
    volume of the closed joints, voids, inflow in the step, as in `StoredWater`. at_ends: pressure
    beyond the imposed one at the ends [Pa]: a dry one may be higher than the imposed head. parts:
    with drains of part effect, the solutions without drains and with full effect, of which this is
    the mean; each stores water of its own.
    """

    at_ends: Array
    change: Array
    void: Array
    inflow: Array
    parts: tuple[FlowInTime, ...] = ()

    def mixed(self, share: float, other: FlowSolution) -> FlowInTime:
        """Mean with another solution of some share (0 to 1)."""
        assert isinstance(other, FlowInTime)
        mean, rest = super().mixed(share, other), 1 - share
        return FlowInTime(
            pressure=mean.pressure,
            systems=mean.systems,
            at_ends=self.at_ends,
            change=rest * self.change + share * other.change,
            void=rest * self.void + share * other.void,
            inflow=rest * self.inflow + share * other.inflow,
        )

    def stored(self, time: float, begin: StoredWater) -> StoredWater:
        """The state at the end of a step from another one."""
        inflow = begin.inflow + self.inflow
        begins = begin.parts or (begin,) * 2
        parts = tuple(
            replace(part.stored(time, own), begin=None)
            for part, own in zip(self.parts, begins, strict=False)
        )
        end = StoredWater(
            time=time,
            closed=begin.closed,
            change=self.change,
            void=self.void,
            inflow=inflow,
            parts=parts,
        )
        return end.after(begin)


@dataclass(frozen=True, kw_only=True)
class WaterBalance:
    """The balance of the water at the nodes (n,) in a step."""

    flow: Flow
    step: TimeStep
    #: by how much the opening increases the volume that each node stands for, and what this volume
    #: stores [m3/Pa]
    opened: Array
    storage: Array
    #: height times the water's weight [Pa]; pressure of cavitation [Pa]
    elevation: Array
    lowest: float

    def solve(
        self,
        conductivity: Array,
        imposed: Array,
        heads: Array,
        known: BoolArray,
        dry: BoolArray,
        guess: BoolArray,
        beside: Array | None = None,
    ) -> FlowInTime:
        """Solve for conductivities w^3/(12 visc) times weights (q,), and heads times the water's
        weight (n,) [Pa] where they are known; imposed: as in `Flow.solve`; dry: ends of these;
        guess: where the search for voids begins (n,); beside: what flows out of the nodes beside
        the flow of these conductivities (n,) [m3/s], None: nothing.

        nan if no set of nodes with voids is found.
        """
        seconds, begin = self.step.seconds, self.step.begin
        ground, before = self.storage / seconds, begin.change
        rest = before - self.opened + self.storage * self.elevation
        if beside is not None:
            rest = rest - seconds * beside
        voids, air = guess & ~known, guess & dry
        lacking = np.zeros(len(heads))
        for sets in range(MOST_SETS):
            given, fixed = np.where(voids, self.lowest + self.elevation, heads), known | voids
            try:
                system = self.matrix(ground, fixed, conductivity)
            except (np.linalg.LinAlgError, ValueError):
                break
            if sets < FREE_SETS:
                most = np.maximum(begin.volume, 0) / seconds
                lacking = system.lacking(voids | air, most, self.elevation)
            source = rest / seconds + lacking
            total = system.solve(source, given)
            pressure = total - self.elevation
            excess = self.opened + self.storage * pressure - before
            excess += seconds * (system.outflow(total, source) - lacking)
            if beside is not None:
                excess += seconds * beside
            largest = np.abs(total).max()
            suction = pressure < self.lowest - ROUNDING * largest
            least = begin.closed + self.opened + np.abs(begin.volume)
            least += seconds * system.diagonal * largest
            empties, fills = suction & ~voids & ~known, voids & (excess < -ROUNDING * least)
            drawn = dry & (excess > ROUNDING * least * np.where(air, -1, 1))
            stays = sets >= FREE_SETS or np.array_equal(air, drawn)
            if stays and not (empties.any() or fills.any()):
                void = np.where(voids, np.maximum(excess, 0), 0)
                void[dry] = np.maximum(excess[dry], 0)
                inflow = np.where(known, excess, 0)
                inflow[dry] = np.minimum(excess[dry], 0)
                return FlowInTime(
                    pressure=(total - imposed)[self.flow.inside],
                    systems=[
                        FlowSystem(
                            gradients_of=partial(getattr, system, "gradients"),
                            inverse=system.inverse,
                            inverse_of=partial(self.inverse_of, ground, fixed, system.gradients),
                        )
                    ],
                    at_ends=(total - imposed)[self.flow.fields.ends],
                    change=self.opened + self.storage * pressure - void,
                    void=void,
                    inflow=inflow,
                )
            voids, air = (voids | empties) & ~fills, drawn
        nothing = np.full(len(heads), np.nan)
        return FlowInTime(
            pressure=nothing[self.flow.inside],
            systems=[],
            at_ends=nothing[self.flow.fields.ends],
            change=nothing,
            void=nothing,
            inflow=nothing,
        )

    def matrix(self, ground: Array, known: BoolArray, conductivity: Array) -> BalanceMatrix:
        """See `BalanceMatrix`."""
        form = OnLines if self.flow.dim == 2 else OnSurface
        return form(self.flow, conductivity, ground, known)

    def inverse_of(
        self,
        ground: Array,
        known: BoolArray,
        gradients: list[Array],
        across: Array,
        along: Array,
    ) -> Callable[[Array], Array]:
        """See `FlowSystem`."""
        if self.flow.dim == 2:
            return OnLines(self.flow, along, ground, known).inverse
        flux = self.flow.tangent_matrix(across, along, gradients)
        return OnSurface(self.flow, across, ground, known, flux).inverse


class BalanceMatrix(Protocol):
    """The matrix of the flow and of what is stored, K + C, with known heads at some nodes."""

    #: of K (n,)
    diagonal: Array
    #: gradient of the head times the water's weight at the Gauss points, along each of
    #: `JointFields.slopes`, of the last solution
    gradients: list[Array]

    def __init__(self, flow: Flow, conductivity: Array, ground: Array, known: BoolArray) -> None:
        """conductivity: times weights (q,); ground: diagonal of C (n,)."""

    def lacking(self, limited: BoolArray, most: Array, elevation: Array) -> Array:
        """What nodes do not give to those below them, as sources (n,): by gravity, a limited node
        gives at most `most`.
        """
        ...

    def solve(self, source: Array, heads: Array) -> Array:
        """Heads (n,) for sources (n,) and known heads."""
        ...

    def outflow(self, total: Array, source: Array) -> Array:
        """K times heads (n,): what flows out of each node into the joint."""
        ...

    def inverse(self, coupling: Array) -> Array:
        """Product of the inverse with a matrix (inner nodes, m); zero where heads are known."""
        ...


def limited_shares(limited: BoolArray, most: Array, falls: Array) -> Array:
    """What of its outflow by gravity, falls (n,), each node gives."""
    share = np.ones(len(falls))
    short = limited & (falls > most)
    share[short] = most[short] / falls[short]
    return share


class OnLines:
    """2D: nodes are eliminated one by one along each line between known heads and branchings, then
    the branchings (star and mesh, as in `junction_heads`): sums and products of positive numbers
    only, so that no conductance is lost beside a large one.
    """

    def __init__(self, flow: Flow, conductivity: Array, ground: Array, known: BoolArray) -> None:
        self.flow, self.known, self.ground = flow, known, ground
        self.conductance = 1 / flow.resistances(conductivity)
        self.cut = cut = flow.cut_lines(known.tobytes())
        both, number = np.concatenate([self.conductance, self.conductance]), len(known)
        self.diagonal = np.asarray(np.bincount(cut.nodes.ravel(), both, number), float)
        self.missing = np.zeros(len(self.conductance))
        self.gradients: list[Array] = []
        self.factors, between = [], self.conductance[cut.leading]
        at_ends = np.zeros(len(known))
        for k, cells, nodes in cut.long:
            onward, store = self.conductance[cells].tolist(), ground[nodes].tolist()
            store[0] = store[-1] = 0.0
            mutual, to_first, factors = onward[0], 0.0, []
            for i in range(1, len(onward)):
                whole = mutual + onward[i] + store[i]
                back, ahead = mutual / whole, onward[i] / whole
                to_first += back * store[i]
                store[i + 1] += ahead * store[i]
                factors.append((whole, back, ahead))
                mutual = back * onward[i]
            at_ends[nodes[0]] += to_first
            at_ends[nodes[-1]] += store[-1]
            self.factors.append(factors)
            between[k] = mutual
        self.terminals = cut.terminals
        self.stars = self._stars(cut.ends, between, (ground + at_ends)[self.terminals])

    def _stars(
        self, pairs: IntArray, between: Array, ground: Array
    ) -> list[tuple[int, float, Array]]:
        """The branchings and closed ends, eliminated one by one: number among the terminals, sum of
        the conductances, and their shares.
        """
        stars, terminals = [], self.terminals
        free = np.flatnonzero(~self.known[terminals])
        if not len(free):
            return []
        mesh, at = np.zeros((len(terminals),) * 2), np.searchsorted(terminals, pairs)
        np.add.at(mesh, (at[:, 0], at[:, 1]), between)
        mesh += mesh.T
        np.fill_diagonal(mesh, 0)
        for k in free:
            whole = float(mesh[k].sum() + ground[k])
            share = mesh[k] / whole
            stars.append((int(k), whole, share))
            ground = ground + share * ground[k]
            mesh += np.outer(mesh[k], share)
            mesh[k] = mesh[:, k] = 0
            np.fill_diagonal(mesh, 0)
        return stars

    def lacking(self, limited: BoolArray, most: Array, elevation: Array) -> Array:
        """See `BalanceMatrix`."""
        if not limited.any():
            return np.zeros(len(elevation))
        first, last = self.cut.nodes
        falls = self.conductance * (elevation[first] - elevation[last])
        upper, number = np.where(falls > 0, first, last), len(elevation)
        downwards = np.asarray(np.bincount(upper, np.abs(falls), number), float)
        share = limited_shares(limited, most, downwards)
        self.missing = (1 - share[upper]) * falls
        given = np.bincount(first, self.missing, number)
        return np.asarray(given - np.bincount(last, self.missing, number))

    def solve(self, source: Array, heads: Array) -> Array:
        """See `BalanceMatrix`; of several right sides, too: (n, m) each."""
        total = np.where(self.known if source.ndim == 1 else self.known[:, None], heads, source)
        single, kept = source.ndim == 1, list[list[Any]]()
        for (_, _, nodes), factors in zip(self.cut.long, self.factors, strict=True):
            inner = list[Any](source[nodes].tolist() if single else source[nodes])
            inner[0] = inner[-1] = 0.0 * inner[0]
            for i, (_, back, ahead) in enumerate(factors, 1):
                inner[0] = inner[0] + back * inner[i]
                inner[i + 1] = inner[i + 1] + ahead * inner[i]
            kept.append(inner)
            for end, value in ((nodes[0], inner[0]), (nodes[-1], inner[-1])):
                if not self.known[end]:
                    total[end] += value
        at_ends = total[self.terminals]
        for k, _, share in self.stars:
            for j in np.flatnonzero(share):
                if not self.known[self.terminals[j]]:
                    at_ends[j] += share[j] * at_ends[k]
        for k, whole, share in self.stars[::-1]:
            at_ends[k] = at_ends[k] / whole + share @ at_ends
        total[self.terminals] = at_ends
        for (_, _, nodes), factors, inner in zip(self.cut.long, self.factors, kept, strict=True):
            first, ahead = total[nodes[0]], total[nodes[-1]]
            if single:
                first, ahead = float(first), float(ahead)
            for i in range(len(factors), 0, -1):
                whole, to_first, to_next = factors[i - 1]
                ahead = inner[i] / whole + to_first * first + to_next * ahead
                inner[i] = ahead
            total[nodes[1:-1]] = inner[1:-1]
        return total

    def outflow(self, total: Array, source: Array) -> Array:
        """See `BalanceMatrix`: where the conductances differ by many decades, the flow in an
        element is that in the least conducting one of its line, and what is stored between them.
        """
        out = source - self.ground * total
        out[self.terminals[self.known[self.terminals]]] = 0
        largest, (first, last) = LAST_BIT * np.abs(total).max(), self.cut.nodes
        flows = self.conductance * (total[first] - total[last])
        for _, cells, nodes in self.cut.long:
            conductance, heads, direct = self.conductance[cells], total[nodes], flows[cells]
            k = int(conductance.argmin())
            flow = np.concatenate([[0.0], np.cumsum(out[nodes[1:-1]])])
            sizes = np.abs(source[nodes[1:-1]]) + self.ground[nodes[1:-1]] * np.abs(heads[1:-1])
            added = flow - flow[k] + direct[k]
            error = conductance[k] * largest + LAST_BIT * sizes.sum()
            flows[cells] = np.where(conductance * largest <= error, direct, added)
        cut = self.cut
        at_ends = np.column_stack([flows[cut.leading], -flows[cut.trailing]]).ravel()
        at_known = np.bincount(cut.ends.ravel(), at_ends, len(out))
        out[self.known] += at_known[self.known]
        steepness = -(flows - self.missing) / self.conductance / self.flow.lengths
        at_points = steepness[self.flow.points.elements]
        self.gradients = [at_points * t for t in self.flow.towards]
        return out

    def inverse(self, coupling: Array) -> Array:
        """See `BalanceMatrix`."""
        inside = self.flow.inside
        right = np.zeros((len(self.known), coupling.shape[1]))
        right[inside] = coupling
        right[self.known] = 0
        return self.solve(right, np.zeros_like(right))[inside]


class OnSurface:
    """3D: one symmetric positive definite matrix. Raises LinAlgError or ValueError if it is not."""

    def __init__(
        self,
        flow: Flow,
        conductivity: Array,
        ground: Array,
        known: BoolArray,
        flux: Array | None = None,
    ) -> None:
        """flux: matrix of the flow, where it is not that of the conductivities."""
        self.flow, self.free = flow, np.flatnonzero(~known)
        self.flux = flow.matrix(conductivity) if flux is None else flux
        self.diagonal = np.diag(self.flux)
        matrix = self.flux[np.ix_(self.free, self.free)]
        matrix[np.diag_indices_from(matrix)] += ground[self.free]
        self.gradients: list[Array] = []
        self._solve: Callable[[Array], Array] = lambda right: right
        if len(self.free):
            linalg = scipy_linalg()
            factor = linalg.cho_factor(matrix)
            self._solve = lambda right: linalg.cho_solve(factor, right)

    def lacking(self, limited: BoolArray, most: Array, elevation: Array) -> Array:
        """See `BalanceMatrix`."""
        if not limited.any():
            return np.zeros(len(elevation))
        falls = -self.flux * (elevation[:, None] - elevation)
        falls = np.where((falls > 0) & limited[:, None], falls, 0)
        share = limited_shares(limited, most, falls.sum(axis=1))
        missing = (1 - share)[:, None] * falls
        return np.asarray(missing.sum(axis=1) - missing.sum(axis=0))

    def solve(self, source: Array, heads: Array) -> Array:
        """See `BalanceMatrix`."""
        total = heads.copy()
        total[self.free] = 0
        right = source[self.free] - self.flux[self.free] @ total
        total[self.free] = self._solve(right)
        return total

    def outflow(self, total: Array, source: Array) -> Array:
        """See `BalanceMatrix`."""
        self.gradients = [g @ total for g in self.flow.fields.slopes]
        return np.asarray(self.flux @ total)

    def inverse(self, coupling: Array) -> Array:
        """See `BalanceMatrix`."""
        right = np.zeros((len(self.flux), coupling.shape[1]))
        right[self.flow.inside] = coupling
        solution = np.zeros_like(right)
        solution[self.free] = self._solve(right[self.free])
        return solution[self.flow.inside]


def stored_at_rest(
    closed: Array, opened: Array, storage: Array, pressure: Array, time: float
) -> StoredWater:
    """Full joints, of these volumes when closed and by their opening, under a pressure (n,) [Pa],
    from where inflow counts.
    """
    nothing, full = np.zeros(len(closed)), opened + storage * pressure
    return StoredWater(time=time, closed=closed, change=full, void=nothing, inflow=nothing)
