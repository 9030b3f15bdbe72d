"""The equilibrium of the joint with the condensed bodies around it (see bulk.py).

Unknown: the jump. Residual R = N^T W t(jump) - (water in the joint) + S jump - t_0(level) = 0; the
pressure of flowing water is solved for the jump at hand before every residual, and its derivative
enters the tangent.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...scene.case import Case
from .interface import Change, Interface
from .laws import LAWS, Memory


@dataclass
class Pressure:
    """Water pressure [Pa] at the law's points, at the water's points and at the nodes; and if it
    flows, its mass flux:

    mean of each joint element [kg/(m s)], and out of the toe per metre of thickness.
    """

    points: np.ndarray
    water_points: np.ndarray
    nodes: np.ndarray
    flux: np.ndarray | None = None
    leakage: float = 0.0


class Joint:
    """The joint of a case with the condensed bodies around it: residual, tangent and what is read
    from them.
    """

    def __init__(self, case: Case, interface: Interface) -> None:
        self.case, self.bulk, self.interface = case, interface.bulk, interface
        self.wet, self.flowing = case["uplift"] != "none", case["uplift"] == "flow"
        self.unit_weight = case["rho_water"] * case["g"]
        self.law = LAWS[case["law"]](case)
        self.virgin = self.law.respond(np.zeros((1, 3)), self.law.start(1))[1][0]
        self.known_loads = None, (np.zeros(0), np.zeros(0))  # of the last (level, tail)

    # -- loads
    # ---------------------------------------------------------------------------------------------

    def face_forces(self, name: str, level: float) -> tuple[np.ndarray, np.ndarray]:
        """Forces of the water on the functions of a face [N] and their derivative with its level.

        With the factor a + b y of pro/loads.pro: exact resultant and moment in spite of the
        waterline's kink.
        """
        points, height, base = (
            self.interface.faces[name],
            self.case["dam_height"],
            self.case["dam_base"],
        )
        y = points.positions[:, 1]
        stretch = (
            1.0 if name == "upstream" else np.hypot(height, base - self.case["dam_crest"]) / height
        )
        if self.case["face_load"] == "uniform":
            pressure, slope = np.full_like(y, level), np.ones_like(y)
            force, moment = level * height, level * height**2 / 2
        else:
            pressure, slope, under = (
                np.maximum(level - y, 0),
                (level > y).astype(float),
                min(level, height),
            )
            force, moment = level * under - under**2 / 2, level * under**2 / 2 - under**3 / 3
        force, moment = force * stretch * self.bulk.width, moment * stretch * self.bulk.width
        m0, m1, m2 = (points.weights @ (pressure * y**k) for k in range(3))
        det = m0 * m2 - m1**2
        b = (m0 * moment - m1 * force) / det if det > 1e-3 * m1**2 else 0.0
        a = (force - b * m1) / m0 if m0 > 0 else 1.0
        factor = self.unit_weight * points.weights * (a + b * y)
        return points.values.T @ (factor * pressure), points.values.T @ (factor * slope)

    def drains(self, level: float, tail: float) -> tuple[float, float, float]:
        """Where the drains are [m], the head there [m], and its derivative with the level.

        Without drains: the middle of a line from heel to toe. Else they take away their part of the
        head above their outlet or the tailwater (EM 1110-2-2200).
        """
        case, base = self.case, self.bulk.base
        if case["uplift"] != "drained":
            return base / 2, (level + tail) / 2, 0.5
        x, left = case["drain_x"], 1 - case["drain_effectiveness"]
        head, rate = level + (tail - level) * x / base, 1 - x / base
        outlet = max(case["drain_level"], tail)
        if head <= outlet:
            return x, head, rate
        return x, outlet + left * (head - outlet), left * rate

    def imposed_pressure(self, x: np.ndarray, level: float, tail: float) -> np.ndarray:
        """Pressure imposed in the joint [Pa]: linear from heel to drains to toe."""
        at, head, _ = self.drains(level, tail)
        return self.unit_weight * np.interp(x, (0, at, self.bulk.base), (level, head, tail))

    def imposed_rate(self, x: np.ndarray, level: float, tail: float) -> np.ndarray:
        """Its derivative with the level [Pa/m]."""
        at, _, rate = self.drains(level, tail)
        return self.unit_weight * np.interp(x, (0, at, self.bulk.base), (1, rate, 0))

    def loads(self, level: float, tail: float) -> tuple[np.ndarray, np.ndarray]:
        """t_0 and the imposed part of the water in the joint together (j,), and their derivative
        with the level.
        """
        if self.known_loads[0] == (level, tail):
            return self.known_loads[1]
        case, bulk, interface = self.case, self.bulk, self.interface
        force, slope = self.face_forces("upstream", level)
        total = case["g"] * (
            case["rho_dam"] * bulk.weight_dam + case["rho_found"] * bulk.weight_foundation
        )
        total = total + bulk.pressure["upstream"] @ force
        rate = bulk.pressure["upstream"] @ slope
        if tail > 0:
            total = total + bulk.pressure["downstream"] @ self.face_forces("downstream", tail)[0]
        if self.wet:
            w, x = interface.water_points.weights, interface.water_points.positions[:, 0]
            total = total + interface.water.T @ (w * self.imposed_pressure(x, level, tail))
            rate = rate + interface.water.T @ (w * self.imposed_rate(x, level, tail))
        self.known_loads = (level, tail), (total, rate)
        return total, rate

    def solve_flow(self, jump: np.ndarray, level: float, tail: float) -> tuple[np.ndarray, object]:
        """Pressure beyond the linear one at the inner nodes for an opening, and the solution's
        sensitivity.

        The conductivity w^3 is scaled by aperture_min^-3.
        """
        aperture = 1 + np.maximum(self.interface.flow.opening @ jump, 0) / self.case["aperture_min"]
        return self.interface.flow.solve(
            aperture**3 * self.interface.points.weights, self.unit_weight * (level - tail)
        )

    def residual(
        self, jump: np.ndarray, memory: Memory, level: float, tail: float, secant: bool = False
    ) -> tuple[np.ndarray, Callable[[], tuple[Change, np.ndarray]]]:
        """The residual (j,), and a function that gives its derivatives with jump (a change of the
        virgin joint's) and level (j,).
        """
        interface = self.interface
        traction, tangent = self.law.respond(
            interface.jumps(interface.at_points, jump), memory, secant
        )
        load, rate = self.loads(level, tail)
        value = self.bulk.stiffness @ jump - load + interface.forces(traction)
        if not self.flowing:
            return value, lambda: (interface.change(tangent, self.virgin), -rate)
        flow = interface.flow
        pressure, solution = self.solve_flow(jump, level, tail)
        value = value - flow.lift @ pressure

        def derivatives() -> tuple[Change, np.ndarray]:
            narrowest = self.case["aperture_min"]
            opening = flow.opening @ jump
            growing = (
                np.where(opening > 0, 3 / narrowest * (1 + opening / narrowest) ** 2, 0)
                * interface.points.weights
            )
            change = interface.change(tangent, self.virgin)
            change.pressure, change.columns, per_drop = flow.sensitivity(solution, growing)
            return change, -rate - flow.lift @ (self.unit_weight * per_drop)

        return value, derivatives

    def pressure(self, jump: np.ndarray, level: float, tail: float) -> Pressure:
        """The water's pressure in the joint for an opening."""
        interface, bulk = self.interface, self.bulk
        place = interface.space.place
        here = [interface.points.positions, interface.water_points.positions, place]
        if not self.wet:
            return Pressure(*(np.zeros(len(x)) for x in here))
        found = [self.imposed_pressure(x[:, 0], level, tail) for x in here]
        if not self.flowing:
            return Pressure(*found)
        flow = interface.flow
        inner = self.solve_flow(jump, level, tail)[0]
        whole = np.zeros(flow.nodes)
        whole[flow.inside] = inner
        steepness = self.unit_weight * (tail - level) / bulk.base
        aperture = self.case["aperture_min"] + np.maximum(flow.opening @ jump, 0)
        conductivity = self.case["rho_water"] * aperture**3 / (12 * self.case["visc"])
        beyond = flow.values @ whole, flow.at_water @ whole, flow.at_nodes @ whole
        return Pressure(
            *(p + more for p, more in zip(found, beyond, strict=True)),
            *flow.flux(conductivity, inner, steepness, self.case["n_joint"], bulk.width),
        )

    def crest(self, jump: np.ndarray, level: float, tail: float) -> tuple[float, np.ndarray, float]:
        """The crest's displacement along x [m], and its derivatives with jump and level."""
        case, bulk = self.case, self.bulk
        force, slope = self.face_forces("upstream", level)
        value = case["g"] * (
            case["rho_dam"] * bulk.crest_weight_dam
            + case["rho_found"] * bulk.crest_weight_foundation
        )
        value += bulk.crest_pressure["upstream"] @ force + bulk.crest_jump @ jump
        if tail > 0:
            value += bulk.crest_pressure["downstream"] @ self.face_forces("downstream", tail)[0]
        return float(value), bulk.crest_jump, float(bulk.crest_pressure["upstream"] @ slope)
