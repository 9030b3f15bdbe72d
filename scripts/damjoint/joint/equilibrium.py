"""The equilibrium of the joint with the condensed bodies around it (see fem/condensation.py).

Unknown: the jump. Residual R = N^T W t(jump) - (water in the joint) + S jump - t_0(loading) = 0;
the pressure of flowing water is solved at the same jump before every residual, and its derivative
is part of the tangent.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from ..arrays import Array, Sparse
from ..laws import TANGENT, Law, Mode
from ..model.case import Case, flows, has_drains
from ..model.loads import AddedPressure, Loading, line_forces, thermal_strains, water_column
from .flow import FlowSolution
from .interface import Interface
from .linear_system import Change
from .wet_faces import WetFace


@dataclass(frozen=True, kw_only=True)
class Pressure:
    """Water pressure in the joint [Pa] at the law's points, at the integration points of the water
    and at the nodes.
    """

    points: Array
    water_points: Array
    nodes: Array
    #: of flowing water: mass flux, mean of each joint element [kg/(m s)], and out of the toe per
    #: metre of thickness
    flux: Array | None = None
    leakage: float = 0.0


@dataclass(frozen=True)
class Still:
    """The joint before an earthquake that leaves its water as it is: jump (j,) and internal
    variables.
    """

    jump: Array
    variables: Any


@dataclass(frozen=True)
class Residual:
    """The forces out of balance at a jump and a level (j,), and their derivatives."""

    value: Array
    #: with the jump, a change of the undamaged joint's, by the law's tangent or by its secant
    by_jump: Callable[[bool], Change]
    #: with the level (j,)
    by_level: Callable[[], Array]


#: Step of a difference with the level, over the size of the dam; level below which the reservoir
#: counts as empty, and the level that replaces it, over the same.
DIFFERENCE, EMPTY, SMALL_LEVEL = 1e-5, 1e-3, 0.1


class Equilibrium:
    """The joint with the condensed bodies: loads, water pressure, residual and tangent."""

    def __init__(self, case: Case, interface: Interface) -> None:
        self.case, self.bulk, self.interface = case, interface.bulk, interface
        self.wet, self.flowing = case["uplift"] != "none", flows(case)
        #: nodes and points of the drains of flowing water
        drained = self.flowing and has_drains(case)
        self.drains = interface.drains(case["drain_x"]) if drained else None
        self.unit_weight = case["rho_water"] * case["g"]
        self.law: Law[Any] = case.law
        #: tangent (3, 3) of the undamaged joint
        self.undamaged = self.law.traction_and_tangent(np.zeros((1, 3)), self.law.initial(1))[1][0]
        #: forces on the loaded unknowns and t_0; with the water in the joint: of the last loadings
        self.external_forces = lru_cache(maxsize=4)(self._external_forces)
        self.loads = lru_cache(maxsize=4)(self._loads)

    # -- loads
    # ---------------------------------------------------------------------------------------------

    def face_forces(self, face: WetFace, loading: Loading) -> Array:
        """Forces on the functions of a face [N], (functions * dim,): water; on the upstream face
        also silt and the added mass of the water in an earthquake.
        """
        case = self.case
        level = loading.tail if face.side in ("down", "bed") else loading.level
        if case["face_load"] == "uniform":
            pressure = np.full(len(face.y), self.unit_weight * level)
            return face.spread(-pressure[:, None] * face.normals)
        added = AddedPressure(0.0, self.interface.floor)
        if face.side == "up":
            added = AddedPressure.of(case, loading, self.interface.floor)

        def height(level: float, y: Array, tilt: Array) -> Array:
            return np.maximum(level - y, 0) + added.height(level, y, tilt)

        def column(level: float, low: float, high: float) -> tuple[float, float]:
            still = water_column(level, low, high)
            quake = added.column(level, low, high, abs(face.normals[0, 0]))
            return still[0] + quake[0], still[1] + quake[1]

        forces = self.unit_weight * face.press(level, height, column)
        grown = loading.part("silt") if face.side == "up" else 0.0
        if grown > 0 and case["silt_height"] > 0:
            weight = grown * case["rho_silt"] * case["g"]
            depth = lambda level, y, _tilt: np.maximum(level - y, 0)
            silt = face.press(case["silt_height"], depth, water_column).reshape(-1, self.bulk.dim)
            # horizontal pressure on the vertical projection, vertical one on the horizontal
            silt *= [weight * case["silt_K0"], weight * case["silt_weight"], 0][: self.bulk.dim]
            forces += silt.ravel()
        return forces

    def unit_loads(self, loading: Loading) -> dict[str, float]:
        """Sizes of the unit loads that act: weights [N/m3], line forces [N/m], strains [-]."""
        case, quake = self.case, loading.part("quake")
        concrete = case["rho_dam"] * case["g"]
        loads = {
            "dam_x": case["k_h"] * quake * concrete,
            "dam_y": (case["k_v"] * quake - 1) * concrete,
            "foundation_y": 0.0 if case["in_situ"] else -case["rho_found"] * case["g"],
        }
        loads |= {"lower_x": loads["dam_x"], "lower_y": loads["dam_y"]}
        for name, force in line_forces(case, loading).items():
            loads |= {f"{name}_{axis}": part for axis, part in zip("xy", force, strict=True)}
        loads |= thermal_strains(case, loading)
        return {name: value for name, value in loads.items() if value and name in self.bulk.units}

    def _external_forces(self, loading: Loading) -> tuple[Array, Array]:
        """Forces on the loaded unknowns (m,), and t_0 (j,) of them and of the unit loads."""
        bulk = self.bulk
        forces = np.zeros(bulk.pressure.shape[1])
        for name, face in self.interface.faces.items():
            dofs = bulk.dof_of_face[name]
            np.add.at(forces, dofs[dofs >= 0], self.face_forces(face, loading)[dofs >= 0])
        total = bulk.pressure @ forces
        for name, size in self.unit_loads(loading).items():
            total += size * bulk.units[name]
        return forces, total

    def rate(self, of: Callable[[Loading], Array], loading: Loading) -> Array:
        """The derivative with the reservoir level of a function that is nearly linear in it.

        It is zero for an empty reservoir, and displacement control could not start: there it is
        taken at a small level.
        """
        height = self.case.size
        step = DIFFERENCE * max(height, abs(loading.level))
        level = loading.level if abs(loading.level) > EMPTY * height else SMALL_LEVEL * height
        above, below = (replace(loading, level=level + s) for s in (step, -step))
        return (of(above) - of(below)) / (2 * step)

    # -- water in the joint
    # ---------------------------------------------------------------------------------------------

    def head(self, loading: Loading, matrix: Sparse | None = None) -> Array:
        """Head [m] in a joint of uniform transmissivity, at the joint's nodes or at the places that
        an interpolation matrix of `JointFields` leads to: linear along the joint between the levels
        of reservoir and tailwater; a dry end has its own height, or the head of the other end if
        that is lower.

        Drains reduce the head above their outlet, the tailwater or their own height, by their
        effectiveness (EM 1110-2-2200); USBR counts the reduction from the reservoir's head.
        """
        case, along = self.case, self.interface.fields
        fields = along.heel_y, along.toe_y, along.xi
        heel, toe, xi = fields if matrix is None else (matrix @ field for field in fields)
        level, tail = loading.level, loading.tail
        first = np.maximum(level, np.minimum(heel, tail))
        last = np.maximum(tail, np.minimum(toe, level))
        if case["uplift"] != "drained":
            return first + (last - first) * xi
        at = case["drain_x"] / self.interface.length
        drained = first + (last - first) * (at if case["drain_reference"] == "linear" else 0)
        outlet = np.maximum(heel + (toe - heel) * at, max(case["drain_level"], loading.tail))
        drained = drained - case["drain_effectiveness"] * np.maximum(drained - outlet, 0)
        return np.where(
            xi < at,
            first + (drained - first) * xi / at,
            drained + (last - drained) * (xi - at) / (1 - at),
        )

    def uplift(self, loading: Loading, matrix: Sparse, y: Array, beyond: Array | float) -> Array:
        """Pressure [Pa], not below zero, at places of height y that an interpolation matrix of
        `JointFields` leads to; beyond: pressure of flowing water beyond the imposed one.
        """
        return np.maximum(self.unit_weight * (self.head(loading, matrix) - y) + beyond, 0)

    def lift(self, loading: Loading, beyond: Array | float = 0.0) -> Array:
        """Forces of the water in the joint on its two faces (j,)."""
        interface = self.interface
        weights, y = interface.water_points.weights, interface.water_points.positions[:, 1]
        pressure = self.uplift(loading, interface.fields.at_water, y, beyond)
        forces: Array = interface.opening_at_water.T @ (weights * pressure)
        return forces

    def _loads(self, loading: Loading) -> Array:
        """t_0 and, unless it flows, the water in the joint together (j,)."""
        total = self.external_forces(loading)[1]
        return total + self.lift(loading) if self.wet and not self.flowing else total

    def expand_to_nodes(self, inner: Array) -> Array:
        """A pressure at all nodes of the joint from that at the inner ones; zero at the ends."""
        pressure = np.zeros(self.interface.fields.nodes)
        pressure[self.interface.fields.inside] = inner
        return pressure

    def aperture(self, jump: Array, variables: Any) -> tuple[Array, Array, float]:
        """Conductivity at the law's points over that of the closed joint, its derivative with the
        opening, and the aperture of the closed joint [m].

        flow: cubic law. cracked: the same, but of the opening beyond that of a crack, and bounded
        where an open point has practically the full head.
        """
        opening = self.interface.flow.opening @ jump
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
        case, flow = self.case, self.interface.flow
        factor = self.aperture(jump, variables)[0]
        conductivity = factor * self.interface.points.weights
        head = self.head(loading)
        free = flow.solve(conductivity, self.unit_weight * head)
        if self.drains is None:
            return free
        nodes, points = self.drains
        own = self.interface.surface.points[nodes, 1]
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
        beyond = self.interface.fields.at_water @ self.expand_to_nodes(solution.pressure)
        return self.lift(loading, beyond), solution

    def residual(
        self,
        jump: Array,
        variables: Any,
        loading: Loading,
        mode: Mode = TANGENT,
        frozen_lift: Array | None = None,
        still: Still | None = None,
    ) -> Residual:
        """The residual and its derivatives.

        mode: of the law; frozen_lift (j,): replaces the lift of the flowing water; still: the joint
        whose opening the water follows instead.
        """
        interface, opened = self.interface, still or Still(jump, variables)
        at_points = interface.jumps(interface.at_points, jump)
        traction, tangent = self.law.evaluate(at_points, variables, mode)
        dried = still if self.case["quake_uplift"] == "zero" else None
        if dried:
            lost, lost_rate = self.lost_pressure(at_points[:, 0], variables, loading, dried)
            traction = traction + lost
        value = self.bulk.stiffness @ jump - self.loads(loading) + interface.forces(traction)

        flowing, solution = self.flowing and frozen_lift is None, None
        if flowing:
            lift, solution = self.flowing_lift(opened.jump, opened.variables, loading)
            value = value - lift
        elif frozen_lift is not None:
            value = value - frozen_lift

        def by_jump(secant: bool) -> Change:
            stiffness = tangent
            if secant:
                stiffness = (mode.frozen or self.law).secant_stiffness(at_points, variables)
            if dried:
                stiffness = stiffness + lost_rate
            change = interface.change(stiffness, self.undamaged)
            if solution is None or still:
                return change
            growing = self.aperture(jump, variables)[1] * interface.points.weights
            return replace(change, flow=interface.flow.derivative(solution, growing))

        def by_level() -> Array:
            slope = -self.rate(self._loads, loading)
            if flowing:
                lifted = lambda other: self.flowing_lift(opened.jump, opened.variables, other)[0]
                slope = slope - self.rate(lifted, loading)
            if dried:
                losing = lambda other: interface.forces(
                    self.lost_pressure(at_points[:, 0], variables, other, dried)[0]
                )
                slope = slope + self.rate(losing, loading)
            return slope

        return Residual(value, by_jump, by_level)

    def lost_pressure(
        self, opening: Array, variables: Any, loading: Loading, still: Still
    ) -> tuple[Array, Array]:
        """Pressure [Pa] that the water loses at the law's points in the crack that an earthquake
        opens, as a traction (q, 3), and its derivative (q, 3, 3).

        It grows by K_N with the opening beyond that of a crack, so that a point is as stiff as in
        contact until all of its pressure is lost.
        """
        number, K_N = len(opening), self.case["K_N"]
        traction, rate = np.zeros((number, 3)), np.zeros((number, 3, 3))
        fields, interface = self.interface.fields, self.interface
        beyond: Array | float = 0.0
        if self.flowing:
            solution = self.solve_flow(still.jump, still.variables, loading)
            beyond = fields.at_points @ self.expand_to_nodes(solution.pressure)
        y = interface.points.positions[:, 1]
        full = self.uplift(loading, fields.at_points, y, beyond)
        before = interface.jumps(interface.at_points, still.jump)[:, 0]
        cracked = before > self.law.opening_of_crack(still.variables, number)
        wider = np.where(cracked, 0, opening - self.law.opening_of_crack(variables, number))
        traction[:, 0] = np.clip(K_N * wider, 0, full)
        rate[:, 0, 0] = np.where((wider > 0) & (K_N * wider < full), K_N, 0)
        return traction, rate

    def pressure(
        self, jump: Array, variables: Any, loading: Loading, still: Still | None = None
    ) -> Pressure:
        """The water pressure in the joint at a jump; still: see `residual`."""
        interface, fields = self.interface, self.interface.fields
        opened = still or Still(jump, variables)
        inner: Array | float = 0.0
        if self.flowing:
            inner = self.solve_flow(opened.jump, opened.variables, loading).pressure
        beyond = self.expand_to_nodes(np.asarray(inner))

        def at(matrix: Sparse, positions: Array) -> Array:
            if not self.wet:
                return np.zeros(len(positions))
            return self.uplift(loading, matrix, positions[:, 1], matrix @ beyond)

        flux, leakage = None, 0.0
        if self.case["uplift"] == "flow":
            factor, _, narrowest = self.aperture(opened.jump, opened.variables)
            conductivity = self.case["rho_water"] * narrowest**3 * factor / (12 * self.case["visc"])
            total = self.unit_weight * self.head(loading) + beyond
            drains = () if self.drains is None else (self.drains[0],)
            flux, leakage = interface.flow.flux(conductivity, total, self.bulk.width, *drains)
        points = at(fields.at_points, interface.points.positions)
        water_points = at(fields.at_water, interface.water_points.positions)
        nodes = at(fields.at_locations, interface.space.locations)
        if still and self.case["quake_uplift"] == "zero":
            opening = interface.jumps(interface.at_points, jump)[:, 0]
            lost_at_points = self.lost_pressure(opening, variables, loading, still)[0][:, 0]
            weights = interface.points.weights  # at the nodes so that the resultant is the same
            spread = fields.at_points.T @ (weights * lost_at_points)
            lost_at_nodes = spread / (fields.at_points.T @ weights)
            points = points - lost_at_points
            water_points = water_points - fields.at_water @ lost_at_nodes
            nodes = np.maximum(nodes - fields.at_locations @ lost_at_nodes, 0)
        return Pressure(
            points=points, water_points=water_points, nodes=nodes, flux=flux, leakage=leakage
        )

    def crest(self, jump: Array, loading: Loading) -> float:
        """The crest's displacement along x [m]."""
        bulk = self.bulk
        value = bulk.crest_pressure @ self.external_forces(loading)[0] + bulk.crest_jump @ jump
        for name, size in self.unit_loads(loading).items():
            value += size * bulk.crest_units[name]
        return float(value)

    def crest_rate(self, loading: Loading) -> float:
        """Its derivative with the level."""
        forces = self.rate(lambda other: self.external_forces(other)[0], loading)
        return float(self.bulk.crest_pressure @ forces)
