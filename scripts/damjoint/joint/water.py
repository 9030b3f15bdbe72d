"""Water in a joint: heads, pressures and their forces on both joint faces, flow."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from .. import ROUND_OFF
from ..arrays import Array
from ..classes import dataclass
from ..csr import CsrMatrix
from ..laws import Law
from ..model.case import Case, flows, freezes_uplift, has_drains
from ..model.loads import Loading, heads_at_ends
from .flow import FlowDerivative, FlowSolution
from .interface import JointInterface
from .joint_laws import JointVariables


@dataclass(frozen=True)
class BeforeQuake:
    """The joints before a pseudo-static earthquake, from which their water follows with
    quake_uplift = unchanged or zero: jumps (j,) and internal variables.
    """

    jump: Array
    variables: JointVariables


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
        #: whether the water follows from the joint before a pseudo-static earthquake, and whether
        #: it is absent in the crack that the earthquake opens
        self.freezes_uplift = freezes_uplift(case)
        self.dry_crack = self.freezes_uplift and case["quake_uplift"] == "zero"
        #: distance from the heel beyond which there is no water [m]
        self.waterstop = case["waterstop"] if case["uplift"] == "waterstop" else None
        self.wet, self.flowing = case["uplift"] != "none" and self.waterstop != 0, flows(case)
        #: nodes and points of the drains of flowing water
        drained = self.flowing and has_drains(case)
        self.drains = joint.drains(case["drain_x"]) if drained else None
        self.unit_weight = case["rho_water"] * case["g"]
        #: the part of the joint on which water may press
        self.wetted = joint.wetted_within(self.waterstop) if self.waterstop else joint.wetted
        self.law: Law[Any] = case.law
        #: heights of heel and toe [m] and path coordinate at the places of `head`
        self.places = lru_cache(maxsize=4)(self._places)

    def _places(self, matrix: CsrMatrix | None) -> tuple[Array, Array, Array]:
        along = self.joint.fields
        if matrix is None:
            return along.heel_y, along.toe_y, along.xi
        return matrix @ along.heel_y, matrix @ along.toe_y, matrix @ along.xi

    def head(self, loading: Loading, matrix: CsrMatrix | None = None) -> Array:
        """Head [m] in a joint of uniform transmissivity, at the joint's nodes or at the places that
        an interpolation matrix of `JointFields` leads to: linear along the joint between the heads
        of `heads_at_ends`. With a waterstop: that of the reservoir.

        Drains reduce the head above their outlet, the tailwater or their own height, by their
        effectiveness (EM 1110-2-2200); USBR counts the reduction from the reservoir's head.
        """
        case, (heel, toe, xi) = self.case, self.places(matrix)
        if self.waterstop is not None:
            return np.full(len(xi), loading.level + case["joint_head_offset"])
        first, last = heads_at_ends(case, loading.level, loading.tail, heel, toe)
        if case["uplift"] != "drained":
            return first + (last - first) * xi
        at = case["drain_x"] / self.joint.length
        drained = first + (last - first) * (at if case["drain_reference"] == "linear" else 0)
        outlet = np.maximum(heel + (toe - heel) * at, max(case["drain_level"], loading.tail))
        drained = drained - case["drain_effectiveness"] * np.maximum(drained - outlet, 0)
        return np.where(
            xi < at,
            first + (drained - first) * xi / at,
            drained + (last - drained) * (xi - at) / (1 - at),
        )

    def uplift(self, loading: Loading, matrix: CsrMatrix, y: Array, beyond: Array | float) -> Array:
        """Pressure [Pa], not below zero, at places of height y that an interpolation matrix of
        `JointFields` leads to; beyond: pressure of flowing water beyond the imposed one.
        """
        pressure = np.maximum(self.unit_weight * (self.head(loading, matrix) - y) + beyond, 0)
        if self.waterstop is None:
            return pressure
        from_heel = matrix @ self.joint.fields.from_heel
        return pressure * (from_heel <= self.waterstop + ROUND_OFF * self.joint.length)

    def lift(self, loading: Loading, beyond: Array | float = 0.0) -> Array:
        """Forces of the water in the joint on its two faces (j,)."""
        y = self.wetted.points.positions[:, 1]
        return self.force(self.uplift(loading, self.wetted.fields, y, beyond))

    def force(self, pressure: Array) -> Array:
        """Forces on the two faces (j,) of pressures at the points of `wetted` [Pa]."""
        forces: Array = self.wetted.opening.T @ (self.wetted.points.weights * pressure)
        return forces

    def expand_to_nodes(self, inner: Array) -> Array:
        """A pressure at all nodes of the joint from that at the inner ones; zero at the ends."""
        pressure = np.zeros(self.joint.fields.nodes)
        pressure[self.joint.fields.inside] = inner
        return pressure

    def aperture(self, jump: Array, variables: Any) -> tuple[Array, Array, float]:
        """Conductivity at the law's points over that of the closed joint, its derivative with the
        opening, and the aperture of the closed joint [m].

        flow: cubic law. cracked: the same, but of the opening beyond that of a crack, and bounded
        where an open point has practically the full head.
        """
        opening = self.joint.flow.opening @ jump
        if self.case["uplift"] == "flow":
            narrowest, most = self.case["aperture_min"], np.inf
        else:
            shared = self.case.shared
            narrowest, most = (shared[f"crack_{n}"][0] for n in ("aperture", "most"))
            opening = opening - self.law.opening_of_crack(variables, len(opening))
        wider = np.maximum(opening, 0) / narrowest
        factor = 1 + np.minimum(wider, most)
        growing = (wider > 0) & (wider < most)
        return factor**3, np.where(growing, 3 / narrowest * factor**2, 0), narrowest

    def solve_flow(self, jump: Array, variables: Any, loading: Loading) -> FlowSolution:
        """Pressure beyond the imposed one at the inner nodes.

        Drains reduce the head above their outlet, the tailwater or their own height, by their
        effectiveness e: the pressure is e times that with the outlet's head at the drains, plus
        1 - e times that without drains. A crack that reaches the drains ends their effect
        (EM 1110-2-2200).
        """
        case, flow = self.case, self.joint.flow
        factor = self.aperture(jump, variables)[0]
        conductivity = factor * self.joint.points.weights
        head = self.head(loading)
        free = flow.solve(conductivity, self.unit_weight * head)
        if self.drains is None:
            return free
        nodes, points = self.drains
        own = self.joint.surface.points[nodes, 1]
        outlet = np.maximum(own, max(case["drain_level"], loading.tail))
        at_drains = head[nodes] + self.expand_to_nodes(free.pressure)[nodes] / self.unit_weight
        cracked = case["uplift"] == "cracked" and (factor[points] > 1).any()
        effect = case["drain_effectiveness"]
        if cracked or not (at_drains > outlet).all() or effect == 0:
            return free
        drained = flow.solve(
            conductivity, self.unit_weight * head, nodes, self.unit_weight * outlet
        )
        return free.mixed(effect, drained)

    def flowing_lift(
        self, jump: Array, variables: Any, loading: Loading
    ) -> tuple[Array, FlowSolution]:
        """Forces of flowing water on the faces of the joint (j,), and its flow's solution."""
        solution = self.solve_flow(jump, variables, loading)
        beyond = self.wetted.fields @ self.expand_to_nodes(solution.pressure)
        return self.lift(loading, beyond), solution

    def opened(
        self, jump: Array, variables: Any, before_quake: BeforeQuake | None
    ) -> tuple[Array, Any]:
        """Jump and internal variables that the water follows: the present ones, or those before an
        earthquake.
        """
        if before_quake and self.freezes_uplift:
            return before_quake.jump, before_quake.variables.joints[self.number]
        return jump, variables

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
        jump, before_variables = self.opened(before_quake.jump, None, before_quake)
        beyond: Array | float = 0.0
        if self.flowing:
            solution = self.solve_flow(jump, before_variables, loading)
            beyond = fields.at_points @ self.expand_to_nodes(solution.pressure)
        y = joint.points.positions[:, 1]
        full = self.uplift(loading, fields.at_points, y, beyond)
        before = joint.jumps(joint.at_points, jump)[:, 0]
        cracked = before > self.law.opening_of_crack(before_variables, number)
        wider = np.where(cracked, 0, opening - self.law.opening_of_crack(variables, number))
        traction[:, 0] = np.clip(K_N * wider, 0, full)
        rate[:, 0, 0] = np.where((wider > 0) & (K_N * wider < full), K_N, 0)
        return traction, rate

    def derivative(self, jump: Array, variables: Any, solution: FlowSolution) -> FlowDerivative:
        """Derivative of the pressure of flowing water with the unknowns."""
        growing = self.aperture(jump, variables)[1] * self.joint.points.weights
        return self.joint.flow.derivative(solution, growing)

    def pressure(
        self, jump: Array, variables: Any, loading: Loading, before_quake: BeforeQuake | None = None
    ) -> Pressure:
        """The water pressure in the joint at a jump; before_quake: see `Equilibrium.residual`."""
        joint, fields = self.joint, self.joint.fields
        opened = self.opened(jump, variables, before_quake)
        inner: Array | float = 0.0
        if self.flowing:
            inner = self.solve_flow(*opened, loading).pressure
        beyond = self.expand_to_nodes(np.asarray(inner))

        def at(matrix: CsrMatrix, positions: Array) -> Array:
            if not self.wet:
                return np.zeros(len(positions))
            return self.uplift(loading, matrix, positions[:, 1], matrix @ beyond)

        flux, leakage = None, 0.0
        if self.case["uplift"] == "flow":
            factor, _, narrowest = self.aperture(*opened)
            conductivity = self.case["rho_water"] * narrowest**3 * factor / (12 * self.case["visc"])
            total = self.unit_weight * self.head(loading) + beyond
            drains = () if self.drains is None else (self.drains[0],)
            flux, leakage = joint.flow.flux(conductivity, total, joint.width, *drains)
        points = at(fields.at_points, joint.points.positions)
        water_points = at(self.wetted.fields, self.wetted.points.positions)
        nodes = at(fields.at_locations, joint.space.locations)
        if before_quake and self.dry_crack:
            opening = joint.jumps(joint.at_points, jump)[:, 0]
            lost_at_points = self.lost_pressure(opening, variables, loading, before_quake)[0][:, 0]
            weights = joint.points.weights  # at the nodes so that the resultant is the same
            spread = fields.at_points.T @ (weights * lost_at_points)
            lost_at_nodes = spread / (fields.at_points.T @ weights)
            points = points - lost_at_points
            water_points = water_points - self.wetted.fields @ lost_at_nodes
            nodes = np.maximum(nodes - fields.at_locations @ lost_at_nodes, 0)
        return Pressure(
            points=points, water_points=water_points, nodes=nodes, flux=flux, leakage=leakage
        )
