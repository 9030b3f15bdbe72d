"""Water in a joint: heads, pressures and their forces on both joint faces, flow."""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from itertools import pairwise
from typing import Any

import numpy as np

from .. import ROUND_OFF
from ..arrays import Array, BoolArray, IntArray
from ..csr import CsrMatrix
from ..input.case import Case
from ..input.values import flows, freezes_uplift, has_drains
from ..laws import Law
from ..model.loads import Loading, heads_at_ends
from ..model.network import Network, WaterPath, water_networks
from .flow import NO_NODES, Flow, FlowDerivative, FlowSolution, JointFields
from .flow_in_time import (
    ROUNDING,
    FlowInTime,
    StoredWater,
    TimeStep,
    WaterBalance,
    stored_at_rest,
)
from .interface import Interface, JointInterface
from .joint_laws import JointVariables
from .turbulence import slowed, turbulent_flow


@dataclass(frozen=True)
class BeforeQuake:
    """The joints before a pseudo-static earthquake, from which their water follows with
    quake_uplift = unchanged or zero: jumps (j,) and internal variables.
    """

    jump: Array
    variables: JointVariables


@dataclass(frozen=True, kw_only=True)
class Drainage:
    """Drains of flowing water: their joint, the part of their effect that a crack leaves (0 to 1),
    and its derivative with the opening at the joint's points.
    """

    water: JointWater
    remaining: float
    rate: Array


@dataclass(frozen=True, kw_only=True)
class Apertures:
    """The apertures of the joints of a `WaterSystem`, one array for each."""

    #: `JointWater.widening`, and its derivative with the opening
    wider: list[Array]
    growth: list[Array]
    #: of all joints, over that of the closed first one, times weights of the points (q,)
    conductivity: Array
    #: the drains of which a crack leaves a part
    acting: list[Drainage]


@dataclass(frozen=True, kw_only=True)
class Pressure:
    """Water pressure in the joint [Pa] at the law's points, at those of `JointWater.wetted` and at
    the nodes.
    """

    points: Array
    water_points: Array
    nodes: Array
    #: of flowing water: mass flux, mean of each joint element [kg/(m s)], and out of the toe per
    #: metre of thickness
    flux: Array | None = None
    leakage: float = 0.0


class JointWater:
    """The water in a joint."""

    def __init__(self, case: Case, joint: JointInterface, number: int) -> None:
        """case: of the joint, see `Case.joints`; number: of the joint, from 0."""
        self.case, self.joint, self.number = case, joint, number
        #: the joints that exchange water with this one, itself included, and the numbers of its
        #: nodes among theirs
        self.system = WaterSystem((self,))
        self.nodes: IntArray = np.arange(len(joint.surface.points))
        #: transmissivity of the closed joint over that of the first of these joints
        self.scale = 1.0
        #: whether the water follows from the joint before a pseudo-static earthquake, and whether
        #: it is absent in the crack that the earthquake opens
        self.freezes_uplift = freezes_uplift(case)
        self.dry_crack = self.freezes_uplift and case["quake_uplift"] == "zero"
        #: distance from the heel beyond which there is no water [m]
        self.waterstop = case["waterstop"] if case["uplift"] == "waterstop" else None
        self.wet = case["uplift"] != "none" and self.waterstop != 0
        #: whether the flow is computed, here or in a joint that exchanges water with this one
        self.flowing = flows(case)
        #: of the drains of flowing water: nodes, and weights of the points in elements beside them
        drained = self.flowing and has_drains(case)
        self.drains = joint.drains(case["drain_x"]) if drained else None
        self.unit_weight = case["rho_water"] * case["g"]
        #: the part of the joint on which water may press
        self.wetted = joint.wetted_within(self.waterstop) if self.waterstop else joint.wetted
        self.law: Law[Any] = case.law
        #: heights of heel and toe [m] and path coordinate at the points of `head`
        self.along = lru_cache(maxsize=4)(self._along)
        #: of the last loadings, see `_head`
        self.head = lru_cache(maxsize=8)(self._head)

    def with_law(self, case: Case) -> JointWater:
        """The same, that exchanges water with no other joint, for a case with another law."""
        other = copy(self)
        other.case, other.law, other.system = case, case.law, copy(self.system)
        other.system.members = (other,)
        other.system.last_solution = other.system.last_apertures = None
        return other

    def _along(self, matrix: CsrMatrix | None) -> tuple[Array, Array, Array]:
        along = self.system.fields
        values = [field[self.nodes] for field in (along.heel_y, along.toe_y, along.xi)]
        heel, toe, xi = values if matrix is None else [matrix @ field for field in values]
        return heel, toe, xi

    def _head(self, loading: Loading, matrix: CsrMatrix | None = None) -> Array:
        """Head [m] in a joint of uniform transmissivity, at the joint's nodes or at the points that
        an interpolation matrix of `JointFields` leads to: linear along the joint between the heads
        of `heads_at_ends`, along the whole path where joints meet. With a waterstop: that of the
        reservoir, or of the joint from which the water comes.

        Drains reduce the head above their outlet, the tailwater or their own height, by their
        effectiveness (EM 1110-2-2200); USBR counts the reduction from the reservoir's head.
        """
        if self.waterstop is not None and not self.system.network:
            number = len(self.nodes) if matrix is None else matrix.shape[0]
            return np.full(number, loading.level + self.case["joint_head_offset"])
        if self.system.branched:
            nodal = self.system.heads(loading)[self.nodes]
            return nodal if matrix is None else matrix @ nodal
        case, (heel, toe, xi) = self.case, self.along(matrix)
        levels = loading.level, loading.tail
        first, last = heads_at_ends(case, *levels, heel, toe, self.flowing)
        drains: Sequence[tuple[float, Array | float, float, float]] = ()
        path = WaterPath.of(case) if self.system.in_series else None
        if path:
            drains = path.drains
        elif case["uplift"] == "drained":
            at = case["drain_x"] / self.joint.length
            outlet = np.maximum(heel + (toe - heel) * at, case["drain_level"])
            reference = at if case["drain_reference"] == "linear" else 0.0
            drains = [(at, outlet, case["drain_effectiveness"], reference)]
        knots: list[tuple[float, Array]] = [(0.0, first)]
        for at, outlet, effectiveness, reference in drains:
            before, head = knots[-1]
            counted = at if before else reference
            drained = head + (last - head) * ((counted - before) / (1 - before))
            drained = drained - effectiveness * np.maximum(
                drained - np.maximum(outlet, loading.tail), 0
            )
            knots.append((at, drained))
        values, (start, head) = first, knots[0]
        for end, following in [*knots[1:], (1.0, last)]:
            along = head + (following - head) * (xi - start) / (end - start)
            values = np.where(xi < start, values, along) if start else along
            start, head = end, following
        return values

    def lowest(self, step: TimeStep | None) -> float:
        """The least pressure [Pa]: zero, of flow in time that at which voids form."""
        return self.case["pressure_min"] if step and flows(self.case) else 0.0

    def uplift(
        self,
        loading: Loading,
        matrix: CsrMatrix,
        y: Array,
        beyond: Array | float,
        lowest: float = 0.0,
    ) -> Array:
        """Pressure [Pa], not below the lowest, at points of height y that an interpolation matrix
        of `JointFields` leads to; beyond: pressure of flowing water beyond the imposed one.
        """
        pressure = self.unit_weight * (self.head(loading, matrix) - y) + beyond
        pressure = np.maximum(pressure, lowest)
        if self.waterstop is None:
            return pressure
        from_heel = matrix @ self.joint.fields.from_heel
        return pressure * (from_heel <= self.waterstop + ROUND_OFF * self.joint.length)

    def lift(self, loading: Loading, beyond: Array | float = 0.0, lowest: float = 0.0) -> Array:
        """Forces of the water in the joint on its two faces (j,), see `uplift`."""
        y = self.wetted.points.positions[:, 1]
        return self.force(self.uplift(loading, self.wetted.fields, y, beyond, lowest))

    def force(self, pressure: Array) -> Array:
        """Forces on the two faces (..., j) of pressures (..., q) at the points of `wetted` [Pa]."""
        return self.wetted.opening.T.on_rows(self.wetted.points.weights * pressure)

    @property
    def narrowest(self) -> float:
        """The aperture of the closed joint [m]."""
        flow = self.case["uplift"] == "flow"
        return self.case["aperture_min"] if flow else self.case.shared["crack_aperture"][0]

    def widening(self, jump: Array, variables: Any) -> tuple[Array, Array]:
        """By how much the aperture at the law's points exceeds that of the closed joint, over that
        of the closed joint, and its derivative with the opening.

        flow: cubic law, of the opening beyond that at which closing stress has narrowed the joint
        to `aperture_min`. cracked: the same, but of the opening beyond that of a crack, and bounded
        where an open point has practically the full head. Others: closed, whatever the opening.
        """
        if not flows(self.case):
            nothing = np.zeros(len(self.joint.points.weights))
            return nothing, nothing
        opening = self.joint.flow.opening @ jump
        narrowest, most = self.narrowest, np.inf
        if self.case["uplift"] != "flow":
            most = self.case.shared["crack_most"][0]
            opening = opening - self.law.opening_of_crack(variables, len(opening))
        elif self.case["aperture_elastic"]:
            opening = opening + self.case["aperture_elastic"]
        wider = np.maximum(opening, 0) / narrowest
        growing = (wider > 0) & (wider < most)
        return np.minimum(wider, most), np.where(growing, 1 / narrowest, 0)

    def conductivity(self, jump: Array, variables: Any) -> tuple[Array, Array]:
        """Conductivity at the law's points over that of the closed joint, and its derivative with
        the opening.
        """
        wider, growth = self.widening(jump, variables)
        return (1 + wider) ** 3, self.growing(wider, growth)

    def growing(self, wider: Array, growth: Array) -> Array:
        """Derivative of the `conductivity` with the opening, by the `widening`."""
        return np.where(growth > 0, 3 / self.narrowest * (1 + wider) ** 2, 0)

    def outlets(self, loading: Loading) -> tuple[IntArray, Array]:
        """Nodes of the drains of flowing water, by their numbers in `system`, and heads of their
        outlets [m]: the tailwater or their own height.
        """
        assert self.drains
        nodes, _ = self.drains
        height = self.joint.surface.points[nodes, 1]
        outlet = np.maximum(height, max(self.case["drain_level"], loading.tail))
        return self.nodes[nodes], outlet

    def drainage(self, wider: Array, growth: Array) -> Drainage:
        """What a crack leaves of the effect of the drains, by the `widening`: the part of the
        elements beside them that has not opened to the water.
        """
        assert self.drains
        _, beside = self.drains
        if self.case["uplift"] != "cracked":
            return Drainage(water=self, remaining=1.0, rate=np.zeros(len(beside)))
        most = self.case.shared["crack_most"][0]
        remaining = 1 - float(beside @ wider) / most
        if remaining < ROUND_OFF:
            return Drainage(water=self, remaining=0.0, rate=np.zeros(len(beside)))
        return Drainage(water=self, remaining=remaining, rate=-beside * growth / most)

    def opened(
        self, jump: Array, variables: JointVariables, before_quake: BeforeQuake | None
    ) -> tuple[Array, Any]:
        """Jump and internal variables of the joint that the water follows: the present ones, or
        those before an earthquake.
        """
        if before_quake and self.freezes_uplift:
            return before_quake.jump, before_quake.variables.joints[self.number]
        return jump, variables.joints[self.number]

    def lost_pressure(
        self, opening: Array, variables: Any, loading: Loading, before_quake: BeforeQuake
    ) -> tuple[Array, Array]:
        """Pressure [Pa] that the water loses at the law's points in the crack that an earthquake
        opens, as a traction (q, 3), and its derivative (q, 3, 3).

        It grows by K_N with the opening beyond that of a crack, so that a point is as stiff as in
        contact until all of its pressure is lost.
        """
        number, K_N = len(opening), self.case["K_N"]
        traction, rate = np.zeros((number, 3)), np.zeros((number, 3, 3))
        if not self.dry_crack:
            return traction, rate
        fields, joint = self.joint.fields, self.joint
        jump, before_variables = before_quake.jump, before_quake.variables.joints[self.number]
        beyond: Array | float = 0.0
        if self.flowing:
            solution = self.system.solve(jump, before_quake.variables, loading, before_quake)
            beyond = fields.at_points @ self.system.expand_to_nodes(solution)[self.nodes]
        y = joint.points.positions[:, 1]
        full = self.uplift(loading, fields.at_points, y, beyond)
        before = joint.jumps(joint.at_points, jump)[:, 0]
        cracked = before > self.law.opening_of_crack(before_variables, number)
        wider = np.where(cracked, 0, opening - self.law.opening_of_crack(variables, number))
        traction[:, 0] = np.clip(K_N * wider, 0, full)
        rate[:, 0, 0] = np.where((wider > 0) & (K_N * wider < full), K_N, 0)
        return traction, rate

    def in_time(self, stored: StoredWater, pressure: Pressure) -> dict[str, float]:
        """The columns IN_TIME of history.csv, from what is stored in `system`: at a node of several
        joints, by the part of it that is this joint's.
        """
        size = self.joint.fields.at_points.T @ self.joint.points.weights
        share = size / self.system.area[self.nodes]
        parts = {"water": stored.volume, "water_in": stored.inflow, "void": stored.void}
        width, nodes, flux = self.joint.width, pressure.nodes, pressure.flux
        number = 0.0 if flux is None else 2 * np.abs(flux).max() / self.case["visc"]
        row: dict[str, Any] = {n: share @ v[self.nodes] / width for n, v in parts.items()}
        row |= {"p_max": nodes.max(), "p_min": nodes.min(), "Re": number}
        return {name: float(value) for name, value in row.items()}

    def pressure(
        self,
        jump: Array,
        variables: JointVariables,
        loading: Loading,
        before_quake: BeforeQuake | None = None,
        step: TimeStep | None = None,
        beyond: Array | None = None,
    ) -> Pressure:
        """The water pressure in the joint at a jump, for the internal variables of all joints;
        before_quake: see `StepWater`; step: see `WaterSystem.solve`; beyond: the pressure of the
        flow beyond the imposed one at the nodes, where it is known.
        """
        joint, fields = self.joint, self.joint.fields
        if not self.flowing:
            beyond = np.zeros(fields.nodes)
        elif beyond is None or self.system.network:
            solution = self.system.solve(jump, variables, loading, before_quake, step)
            beyond = self.system.expand_to_nodes(solution)[self.nodes]

        def at(matrix: CsrMatrix, positions: Array) -> Array:
            if not self.wet:
                return np.zeros(len(positions))
            below = self.lowest(step)
            return self.uplift(loading, matrix, positions[:, 1], matrix @ beyond, below)

        flux, leakage = None, 0.0
        if self.case["uplift"] == "flow":
            factor, _ = self.conductivity(*self.opened(jump, variables, before_quake))
            closed = self.case["rho_water"] * self.narrowest**3
            conductivity = closed * factor / (12 * self.case["visc"])
            if self.system.network or step or self.case["turbulent"]:
                gradients = self.system.gradients(solution, self)
                if self.case["turbulent"]:
                    conductivity = conductivity * slowed(
                        gradients, 2 * conductivity / self.case["visc"]
                    )
                flux, leakage = joint.flow.flux_by(gradients, conductivity, joint.width)
            else:
                total = self.unit_weight * self.head(loading) + beyond
                drains = () if self.drains is None else (self.drains[0],)
                flux, leakage = joint.flow.flux(conductivity, total, joint.width, *drains)
        points = at(fields.at_points, joint.points.positions)
        water_points = at(self.wetted.fields, self.wetted.points.positions)
        nodes = at(fields.at_locations, joint.space.locations)
        if before_quake and self.dry_crack:
            opening, state = joint.jumps(joint.at_points, jump)[:, 0], variables.joints[self.number]
            lost_at_points = self.lost_pressure(opening, state, loading, before_quake)[0][:, 0]
            weights = joint.points.weights  # at the nodes so that the resultant is the same
            spread = fields.at_points.T @ (weights * lost_at_points)
            lost_at_nodes = spread / (fields.at_points.T @ weights)
            points = points - lost_at_points
            water_points = water_points - self.wetted.fields @ lost_at_nodes
            nodes = np.maximum(nodes - fields.at_locations @ lost_at_nodes, 0)
        return Pressure(
            points=points, water_points=water_points, nodes=nodes, flux=flux, leakage=leakage
        )


class WaterSystem:
    """The water of a joint, or of joints that meet and exchange it."""

    def __init__(
        self,
        members: tuple[JointWater, ...],
        network: Network | None = None,
        interface: Interface | None = None,
    ) -> None:
        """network: that of the joints if they meet, in the interface."""
        self.members, self.network, self.interface = members, network, interface
        self.branched = network is not None and network.branched
        #: whether the path through a joint goes on in another one
        self.in_series = network is not None and network.in_series
        self.unit_weight = members[0].case["rho_water"] * members[0].case["g"]
        #: voids of the last flow in time, by the number of drained nodes and the part: where the
        #: next search for them begins, whose result does not depend on it
        self.last_voids: dict[tuple[int, int], Array] = {}
        #: likewise: by how much turbulence slows the last flow
        self.last_slowed: dict[tuple[int, int], Array] = {}
        #: the last solution in 2D, and of what: at the end of a step it is needed again
        self.last_solution: tuple[Array, tuple[Any, ...], FlowSolution] | None = None
        #: likewise the last apertures, and of what: a derivative needs them again, as does the flow
        #: at other levels
        self.last_apertures: tuple[Array, tuple[Any, ...], Apertures] | None = None
        #: of the last loadings, see `_heads`
        self.heads = lru_cache(maxsize=4)(self._heads)

    @property
    def flow(self) -> Flow:
        """Operators of the flow."""
        if self.network and self.interface:
            waterstops = tuple(water.waterstop for water in self.members)
            return self.interface.network_flow(self.network, waterstops)
        return self.members[0].joint.flow

    @property
    def fields(self) -> JointFields:
        """Scalar fields on the joints."""
        return self.flow.fields if self.network else self.members[0].joint.fields

    def heads_of_ends(self, loading: Loading) -> tuple[Array, IntArray]:
        """Of a network that branches: heads [m] at its ends, in an array of all nodes, and the dry
        ends, where water leaves at the head of their own elevation, but does not enter.
        """
        assert self.network
        mesh, ends = self.network.mesh, self.fields.ends
        reservoir = loading.level + self.members[0].case["joint_head_offset"]
        y = mesh.surface.points[:, 1]
        heads = y.copy()
        for nodes, level in ((mesh.heel_nodes, reservoir), (mesh.toe_nodes, loading.tail)):
            heads[nodes] = np.maximum(heads[nodes], level)
        dry = ends[heads[ends] <= y[ends]]
        if len(dry) < len(ends):
            return heads, dry
        lowest = y[[*ends, *self.network.closed]].min()
        return np.full(len(y), min(lowest, max(reservoir, loading.tail))), NO_NODES

    def _heads(self, loading: Loading) -> Array:
        """Heads [m] at the nodes in joints of uniform transmissivity."""
        heads = np.empty(self.fields.nodes)
        if not self.branched:
            for water in self.members:
                heads[water.nodes] = water.head(loading)
            return heads
        at_ends, exits = self.heads_of_ends(loading)
        if not len(self.fields.ends):
            return at_ends
        return at_ends + self.flow.solve(self.flow.points.weights, at_ends, exits=exits).pressure

    def expand_to_nodes(self, solution: FlowSolution) -> Array:
        """The pressure of flowing water beyond the imposed one at all nodes."""
        pressure = np.zeros(self.fields.nodes)
        pressure[self.fields.inside] = solution.pressure
        if isinstance(solution, FlowInTime):
            pressure[self.fields.ends] = solution.at_ends
        return pressure

    def solve(
        self,
        jump: Array,
        variables: JointVariables,
        loading: Loading,
        before_quake: BeforeQuake | None = None,
        step: TimeStep | None = None,
        effect: float | None = None,
    ) -> FlowSolution:
        """Pressure of flowing water beyond the imposed one at the inner nodes, for the internal
        variables of all joints; before_quake: see `StepWater`; step: in which water is
        stored, the solution is a `FlowInTime`; None: the flow is steady; effect: of the drains,
        None: by `drain_effectiveness`.

        Drains reduce the head above their outlet, the tailwater or their own height, by their
        effectiveness e: the pressure is e times that with the outlet's head at the drains, plus
        1 - e times that without drains; both store water of their own. A crack that reaches the
        drains ends their effect (EM 1110-2-2200): e falls to zero while it grows through the
        elements beside them, in which all the head between it and the drains is lost meanwhile.
        """
        given = variables, loading, before_quake, step, effect
        if self.last_solution:
            at, of, solution = self.last_solution
            if all(map(operator.is_, of, given)) and np.array_equal(at, jump):
                return solution
        solution = self._solve(jump, *given)
        if self.flow.dim == 2:
            self.last_solution = jump.copy(), given, solution
        return solution

    def _solve(
        self,
        jump: Array,
        variables: JointVariables,
        loading: Loading,
        before_quake: BeforeQuake | None,
        step: TimeStep | None,
        effect: float | None,
    ) -> FlowSolution:
        at = self.apertures(jump, variables, before_quake)
        conductivity, acting = at.conductivity, at.acting
        flow = FlowAtLoading(self, at.wider, loading)
        if effect is None:
            effect = self.drain_effectiveness
        without, fully = step.of_parts if step and 0 < effect < 1 else (step, step)
        free = flow.solve(conductivity, *NO_DRAINS, without)
        if not acting or effect == 0:
            return free
        drains = outlets(acting, loading)
        if without is not fully:
            drained = flow.solve(conductivity, *NO_DRAINS, fully)
            if flow.is_above(*drains, drained, fully):
                drained = flow.solve(conductivity, *drains, fully)
            assert isinstance(free, FlowInTime) and isinstance(drained, FlowInTime)
            return replace(free.mixed(effect, drained), parts=(free, drained))
        if not flow.is_above(*drains, free, step):
            return free
        if all(line.remaining == 1 for line in acting):
            return free.mixed(effect, flow.solve(conductivity, *drains, step))
        solved = partial(flow.solve, step=step)
        return self.with_fading(free, acting, effect, conductivity, loading, solved, before_quake)

    def apertures(
        self, jump: Array, variables: JointVariables, before_quake: BeforeQuake | None
    ) -> Apertures:
        """The apertures for the internal variables of all joints, see `solve`."""
        given = variables, before_quake
        if self.last_apertures:
            at, of, apertures = self.last_apertures
            if all(map(operator.is_, of, given)) and np.array_equal(at, jump):
                return apertures
        members = [(w, w.widening(*w.opened(jump, *given))) for w in self.members]
        conductivities = [w.scale * (1 + at[0]) ** 3 * w.joint.points.weights for w, at in members]
        drains = [water.drainage(*at) for water, at in members if water.drains]
        apertures = Apertures(
            wider=[wider for _, (wider, _) in members],
            growth=[growth for _, (_, growth) in members],
            conductivity=np.concatenate(conductivities),
            acting=[line for line in drains if line.remaining],
        )
        self.last_apertures = jump.copy(), given, apertures
        return apertures

    def with_fading(
        self,
        free: FlowSolution,
        acting: list[Drainage],
        effect: float,
        conductivity: Array,
        loading: Loading,
        solved: Callable[[Array, IntArray, Array], FlowSolution],
        before_quake: BeforeQuake | None,
    ) -> FlowSolution:
        """The flow with drains of which a crack leaves a part: free, without drains; acting: those
        that do; effect, conductivity, loading, before_quake: see `solve`; solved: the flow for
        conductivities and heads at drains. The elements beside fading drains are closed in it.
        """
        shut, closed = np.zeros(len(conductivity), bool), conductivity.copy()
        for drains in acting:
            if drains.remaining < 1:
                water, of_joint = drains.water, self.point_slice(drains.water)
                assert water.drains
                shut[of_joint] = water.drains[1] > 0
                closed[of_joint] = water.scale * water.joint.points.weights
        conductivity = np.where(shut, closed, conductivity)
        # as much as remains of all drains, then as much as remains of all but the most faded ones
        shares, layers = sorted({drains.remaining for drains in acting}), list[FlowSolution]()
        for least in shares:
            of_layer = outlets([drains for drains in acting if drains.remaining >= least], loading)
            layers.append(solved(conductivity, *of_layer).closed_at(shut))
        mean = layers[0]
        for (less, more), layer in zip(pairwise(shares), layers[1:], strict=True):
            mean = layer.mixed(less / more, mean)
        fades = []
        for drains in acting:
            if drains.remaining < 1 and not (before_quake and drains.water.freezes_uplift):
                number, rate = shares.index(drains.remaining), np.zeros(len(conductivity))
                rate[self.point_slice(drains.water)] = drains.rate
                with_it, without = [*layers, free][number : number + 2]
                fades.append((effect * (with_it.pressure - without.pressure), rate))
        return replace(free.mixed(effect * shares[-1], mean), fades=fades)

    def flow_in_time(
        self,
        step: TimeStep,
        wider: list[Array],
        imposed: Array,
        at_ends: Array,
        drains: IntArray,
        drained: Array,
    ) -> Callable[..., FlowInTime]:
        """As `Flow.solve` at the end of a time step, see flow_in_time.py, as a function of
        w^3/(12 visc) times weights (q,) and, in 2D, of a flux beside it as in `Flow.outflow_of`;
        wider: see `opened_by`. The pressure at a dry end is 0.
        """
        ends, elevation = self.fields.ends, self.elevation
        heads, (known, dry) = at_ends.copy(), np.zeros((2, len(at_ends)), bool)
        dry[ends] = at_ends[ends] - elevation[ends] <= ROUNDING * np.abs(at_ends).max()
        heads[dry] = elevation[dry]
        heads[drains] = drained
        known[ends] = known[drains] = True
        like = len(drains), step.part
        balance = WaterBalance(
            flow=self.flow,
            step=step,
            opened=self.opened_by(wider),
            storage=self.storage,
            elevation=elevation,
            lowest=self.members[0].case["pressure_min"],
        )

        def flow_by(conductivity: Array, flux: list[Array] | None = None) -> FlowInTime:
            guess = self.last_voids.get(like, step.begin.void) > 0
            beyond = None if flux is None else self.flow.outflow_of(flux)
            solution = balance.solve(conductivity, imposed, heads, known, dry, guess, beyond)
            self.last_voids[like] = solution.void
            return solution

        return flow_by

    @cached_property
    def turbulent(self) -> BoolArray:
        """Whether the flow at the Gauss points (q,) may be turbulent: in a joint with `flow`, whose
        aperture is its opening.
        """
        may = [w.case["turbulent"] and w.case["uplift"] == "flow" for w in self.members]
        return np.repeat(np.array(may, bool), [len(w.joint.points.weights) for w in self.members])

    @cached_property
    def may_be_turbulent(self) -> bool:
        """Whether it may be anywhere."""
        return bool(self.turbulent.any())

    @property
    def drain_effectiveness(self) -> float:
        """Of its drains, the same for all; 0 without drains."""
        effects = (w.case["drain_effectiveness"] for w in self.members if w.drains)
        return float(next(effects, 0.0))

    @cached_property
    def reference(self) -> float:
        """w^3/(12 visc) of the closed first joint [m3/(Pa s)]."""
        case = self.members[0].case
        return float(case["aperture_min"] ** 3 / (12 * case["visc"]))

    @cached_property
    def area(self) -> Array:
        """Area of the joints that each node stands for (n,) [m2; 2D: per metre]."""
        return np.asarray(self.flow.fields.at_points.T @ self.flow.points.weights)

    @cached_property
    def elevation(self) -> Array:
        """Height of the nodes times the water's weight (n,) [Pa]."""
        return np.asarray(self.unit_weight * self.fields.joint.surface.points[:, 1])

    @cached_property
    def storage(self) -> Array:
        """What the nodes store by the water's compressibility (n,) [m3/Pa]."""
        flow = self.flow
        stored = self.members[0].case["storage"] * flow.points.weights
        return np.asarray(flow.fields.at_points.T @ stored)

    def volume(self, jump: Array) -> Array:
        """Volume of the joint that each node stands for (n,) [m3; 2D: per metre]."""
        return self.closed + self.opened_at(jump)

    def opened_at(self, jump: Array) -> Array:
        """By how much the opening increases that volume, at a jump."""
        return self.opened_by([water.widening(jump, None)[0] for water in self.members])

    @cached_property
    def closed(self) -> Array:
        """Volume of the closed joint that each node stands for (n,) [m3; 2D: per metre]."""
        return self.opened_by([np.ones(len(w.joint.points.weights)) for w in self.members])

    def opened_by(self, wider: list[Array]) -> Array:
        """By how much the `widening` of each joint increases that volume."""
        apertures = [
            water.case["aperture_min"] * one for water, one in zip(self.members, wider, strict=True)
        ]
        flow = self.flow
        return np.asarray(
            flow.fields.at_points.T @ (flow.points.weights * np.concatenate(apertures))
        )

    def stored_at(
        self, jump: Array, variables: JointVariables, loading: Loading, time: float
    ) -> StoredWater:
        """What is stored by steady flow at a jump, at a time; suction stores nothing."""
        imposed, opened = self.unit_weight * self.heads(loading), self.opened_at(jump)

        def by(effect: float) -> StoredWater:
            solution = self.solve(jump, variables, loading, effect=effect)
            pressure = np.maximum(imposed + self.expand_to_nodes(solution) - self.elevation, 0)
            return stored_at_rest(self.closed, opened, self.storage, pressure, time)

        effect = self.drain_effectiveness
        if not 0 < effect < 1:
            return by(effect)
        free, drained = by(0.0), by(1.0)
        mean = (1 - effect) * free.change + effect * drained.change
        return replace(free, change=mean, parts=(free, drained))

    def gradients(self, solution: FlowSolution, water: JointWater) -> list[Array]:
        """Gradient of the total head times the water's weight at the Gauss points of one of the
        joints, along the axes of its `JointFields`.
        """
        of_joint = self.point_slice(water)
        by_axis = {
            axis: sum(system.share * system.gradients[k][of_joint] for system in solution.systems)
            for k, axis in enumerate(self.fields.axes)
        }
        return [np.asarray(by_axis[axis]) for axis in water.joint.fields.axes]

    def point_slice(self, water: JointWater) -> slice:
        """The Gauss points of one of the joints among those of all."""
        sizes = [len(member.joint.points.weights) for member in self.members]
        number = self.members.index(water)
        return slice(sum(sizes[:number]), sum(sizes[: number + 1]))

    def derivative(
        self,
        jump: Array,
        variables: JointVariables,
        solution: FlowSolution,
        before_quake: BeforeQuake | None,
        step: TimeStep | None = None,
    ) -> FlowDerivative | None:
        """Derivative of the pressure of flowing water with the unknowns; None if it follows from
        the joints before an earthquake; step: see `solve`.
        """
        frozen = [bool(before_quake and water.freezes_uplift) for water in self.members]
        if all(frozen) or not solution.systems:
            return None
        at = self.apertures(jump, variables, before_quake)
        rates = [
            (0 if unchanged else water.scale) * water.growing(*one) * water.joint.points.weights
            for water, one, unchanged in zip(
                self.members, zip(at.wider, at.growth, strict=True), frozen, strict=True
            )
        ]
        if step is None:
            return self.flow.derivative(solution, np.concatenate(rates))
        growth = [
            water.case["aperture_min"] * rate
            for water, rate in zip(self.members, at.growth, strict=True)
        ]
        stored = self.flow.points.weights * np.concatenate(growth) / step.seconds
        return self.flow.derivative(solution, self.reference * np.concatenate(rates), stored)


#: See `outlets`.
NO_DRAINS = NO_NODES, np.zeros(0)


class FlowAtLoading:
    """The flow of the water of a system under a loading, at given apertures."""

    def __init__(self, system: WaterSystem, wider: list[Array], loading: Loading) -> None:
        """wider: see `WaterSystem.opened_by`."""
        self.system, self.wider, self.exits = system, wider, NO_NODES
        self.head, weight = system.heads(loading), system.unit_weight
        self.imposed = self.at_ends = weight * self.head
        if system.branched:
            ends, self.exits = system.heads_of_ends(loading)
            self.at_ends = weight * ends

    def solve(
        self, conductivity: Array, nodes: IntArray, outlet: Array, step: TimeStep | None
    ) -> FlowSolution:
        """The flow by conductivities (q,) times weights of the points, over those of the closed
        first joint; nodes, outlet: of drains, see `outlets`; step: see `WaterSystem.solve`.
        """
        system, drained = self.system, self.system.unit_weight * outlet
        in_time = (
            system.flow_in_time(step, self.wider, self.imposed, self.at_ends, nodes, drained)
            if step
            else None
        )

        def flow_by(conductivity: Array) -> FlowSolution:
            return in_time(conductivity) if in_time else self.steady(conductivity, nodes, drained)

        laminar = system.reference * conductivity if step else conductivity
        if not system.may_be_turbulent:
            return flow_by(laminar)
        like = len(nodes), step.part if step else 0
        per_gradient = 2 * system.reference * conductivity / system.flow.points.weights
        per_gradient *= system.members[0].case["rho_water"] / system.members[0].case["visc"]
        per_gradient *= system.turbulent
        level = system.flow.dim == 2 and np.ptp(system.elevation) <= ROUNDING * system.unit_weight
        solution, system.last_slowed[like] = turbulent_flow(
            flow_by,
            laminar,
            per_gradient,
            system.last_slowed.get(like),
            in_time if level else None,
        )
        return solution

    def steady(self, conductivity: Array, nodes: IntArray, drained: Array) -> FlowSolution:
        """The same without time and turbulence; drained: pressures at the drains [Pa]."""
        fields, at_ends = self.system.fields, self.at_ends
        if not len(fields.ends):  # at rest
            return FlowSolution(pressure=0 * at_ends[fields.inside], systems=[])
        solution = self.system.flow.solve(conductivity, at_ends, nodes, drained, self.exits)
        if self.system.branched:
            beyond = solution.pressure + (at_ends - self.imposed)[fields.inside]
            return replace(solution, pressure=beyond)
        return solution

    def is_above(
        self, nodes: IntArray, outlet: Array, free: FlowSolution, step: TimeStep | None
    ) -> bool:
        """Whether the heads of a flow without drains are above their outlets, so that they act."""
        beyond = self.system.expand_to_nodes(free)[nodes] / self.system.unit_weight
        # voids at the pressure of the outlet give no water, nor do drains fill them
        least = ROUNDING * np.abs(self.head).max() if step else 0.0
        return bool((self.head[nodes] + beyond > outlet + least).all())


def outlets(drains: list[Drainage], loading: Loading) -> tuple[IntArray, Array]:
    """Nodes of drains, by their numbers in `WaterSystem`, and heads of their outlets [m]."""
    nodes, heads = zip(*(line.water.outlets(loading) for line in drains), strict=True)
    return np.concatenate(nodes), np.concatenate(heads)


def water_systems(waters: Sequence[JointWater], interface: Interface) -> list[WaterSystem]:
    """The water of joints: of each alone, or of those that meet and exchange it; each joint knows
    its own.

    Raises InputError if joints that meet have settings that do not go together.
    """
    meshes, cases = [w.joint.mesh for w in waters], [w.case for w in waters]
    systems = []
    for network in water_networks(meshes, cases):
        members = tuple(waters[k] for k in network.numbers)
        systems.append(WaterSystem(members, network, interface))
        for k, water in enumerate(members):
            water.system, water.nodes = systems[-1], network.nodes[k]
            water.flowing, water.scale = network.flowing, network.transmissivities[k]
    alone = [water.system for water in waters if not water.system.network]
    return [*alone, *systems]
