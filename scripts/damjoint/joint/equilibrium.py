"""The equilibrium of the joints with the condensed bodies around them (see fem/condensation.py).

Unknowns: the jumps. Residual R = N^T W t(jump) - (water in the joints) + S jump - t_0(loading) = 0;
the pressure of flowing water is solved at the same jump before every residual, and its derivative
is part of the tangent.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ..arrays import Array
from ..input.case import Case
from ..input.scene import BED, DOWN
from ..model.loads import AddedPressure, Loading, line_forces, thermal_strains, water_column
from .flow import FlowDerivative, FlowSolution
from .interface import Interface
from .joint_laws import TANGENT, JointLaws, JointVariables, Mode
from .linear_system import Change
from .water import BeforeQuake, JointWater, Pressure, water_systems
from .wet_faces import WetFace


@dataclass(frozen=True)
class Residual:
    """The forces out of balance at a jump and a level (j,), and their derivatives."""

    value: Array
    #: with the jump, a change of the undamaged joint's, by the law's tangent or by its secant
    by_jump: Callable[[bool], Change]
    #: with the level (j,)
    by_level: Callable[[], Array]


#: Sides of the faces under the tailwater.
BY_TAIL = DOWN, BED

#: Step of a difference with the level, over the size of the dam; level below which the reservoir
#: counts as empty, and the level that replaces it, over the same.
DIFFERENCE, EMPTY, SMALL_LEVEL = 1e-5, 1e-3, 0.1


class Equilibrium:
    """The joints with the condensed bodies: loads, water pressure, residual and tangent."""

    def __init__(self, case: Case, interface: Interface) -> None:
        self.case, self.bulk, self.interface = case, interface.bulk, interface
        self.water = [
            JointWater(own, joint, number)
            for number, (own, joint) in enumerate(zip(case.joints, interface.joints, strict=True))
        ]
        #: where water flows
        systems = water_systems(self.water, interface)
        self.flowing = tuple(system for system in systems if system.members[0].flowing)
        self.unit_weight = case["rho_water"] * case["g"]
        self.laws = JointLaws([own.law for own in case.joints])
        #: whether the state under rising water depends on the steps that lead to it; in a crack
        #: water enters after the step that has opened it
        self.path_dependent = any(
            own.law.path_dependent or own["uplift"] == "cracked" for own in case.joints
        )
        #: tangent (q, 3, 3) of the undamaged joints
        points = [len(joint.points.weights) for joint in interface.joints]
        self.undamaged = self.laws.undamaged_tangent(points)
        #: forces on the functions of a face under the tailwater, by its name and level: of the last
        self.tail_forces = lru_cache(maxsize=4)(
            lambda name, tail: self.face_forces(interface.faces[name], Loading(0.0, tail))
        )
        #: unit loads by the parts of the loads that act
        self.sizes = lru_cache(maxsize=4)(lambda grown: self.unit_loads(Loading(0.0, 0.0, grown)))
        #: loaded unknowns on which a face acts, and the functions of the face that are among them
        self.loaded = {
            name: (dofs[dofs >= 0], np.flatnonzero(dofs >= 0))
            for name, dofs in interface.bulk.dof_of_face.items()
        }
        #: forces on the loaded unknowns and t_0; with the water in the joints: of the last loadings
        self.external_forces = lru_cache(maxsize=8)(self._external_forces)
        self.loads = lru_cache(maxsize=8)(self._loads)

    # -- loads
    # ---------------------------------------------------------------------------------------------

    def face_forces(self, face: WetFace, loading: Loading) -> Array:
        """Forces on the functions of a face [N], (functions * dim,): water; on the upstream face
        also silt and the added mass of the water in an earthquake.
        """
        case = self.case
        level = loading.tail if face.side in BY_TAIL else loading.level
        if case["face_load"] == "uniform":
            pressure = np.full(len(face.y), self.unit_weight * level)
            return face.spread(-pressure[:, None] * face.normals)
        added = AddedPressure(0.0, self.interface.floor)
        if face.side == "up":
            added = AddedPressure.of(case, loading, self.interface.floor)

        def height(level: float, y: Array, tilt: Array) -> Array:
            return np.maximum(level - y, 0) + added.height(level, y, tilt)

        def column(level: float, low: float, high: float) -> tuple[float, float]:
            at_rest = water_column(level, low, high)
            quake = added.column(level, low, high, abs(face.normals[0, 0]))
            return at_rest[0] + quake[0], at_rest[1] + quake[1]

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
            by_tail = face.side in BY_TAIL
            on_face = (
                self.tail_forces(name, loading.tail) if by_tail else self.face_forces(face, loading)
            )
            dofs, functions = self.loaded[name]
            np.add.at(forces, dofs, on_face[functions])
        total = bulk.pressure @ forces
        for name, size in self.sizes(loading.grown).items():
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

    # -- water in the joints
    # ---------------------------------------------------------------------------------------------

    def _loads(self, loading: Loading) -> Array:
        """t_0 and, unless it flows, the water in the joints together (j,)."""
        total = self.external_forces(loading)[1]
        for water in self.water:
            if water.wet and not water.flowing:
                total = total + water.lift(loading)
        return total

    def flowing_lift(
        self,
        jump: Array,
        variables: JointVariables,
        loading: Loading,
        before_quake: BeforeQuake | None = None,
    ) -> tuple[Array, list[FlowSolution]]:
        """Forces of flowing water on the faces of the joints (j,), and the solution of each of
        `flowing`; before_quake: see `residual`.
        """
        total, solutions = np.zeros(len(jump)), []
        for system in self.flowing:
            solution = system.solve(jump, variables, loading, before_quake)
            beyond = system.expand_to_nodes(solution)
            for water in system.members:
                total += water.lift(loading, water.wetted.fields @ beyond[water.nodes])
            solutions.append(solution)
        return total, solutions

    def residual(
        self,
        jump: Array,
        variables: JointVariables,
        loading: Loading,
        mode: Mode = TANGENT,
        frozen_lift: Array | None = None,
        before_quake: BeforeQuake | None = None,
    ) -> Residual:
        """The residual and its derivatives.

        mode: of the laws; frozen_lift (j,): replaces the lift of the flowing water; before_quake:
        the joints whose opening the water follows instead, see `JointWater`.
        """
        interface = self.interface
        at_points = interface.jumps(interface.at_points, jump)
        traction, tangent = self.laws.evaluate(at_points, variables, mode)
        dry_before = before_quake if any(water.dry_crack for water in self.water) else None
        if dry_before:
            lost, lost_rate = self.lost_pressure(at_points, variables, loading, dry_before)
            traction = traction + lost
        value = self.bulk.stiffness @ jump - self.loads(loading) + interface.forces(traction)

        flowing, solutions = bool(self.flowing) and frozen_lift is None, list[FlowSolution]()
        if flowing:
            lift, solutions = self.flowing_lift(jump, variables, loading, before_quake)
            value = value - lift
        elif frozen_lift is not None:
            value = value - frozen_lift

        def by_jump(secant: bool) -> Change:
            stiffness = tangent
            if secant:
                stiffness = (mode.frozen or self.laws).secant_stiffness(at_points, variables)
            if dry_before:
                stiffness = stiffness + lost_rate
            change = interface.change(stiffness, self.undamaged)
            following = [
                (system.flow, derivative)
                for system, solution in zip(self.flowing, solutions, strict=False)
                if (derivative := system.derivative(jump, variables, solution, before_quake))
            ]
            flow = FlowDerivative.joined([derivative for _, derivative in following])
            return replace(change, flow=flow, flowing=tuple(flow for flow, _ in following))

        def by_level() -> Array:
            slope = -self.rate(self._loads, loading)
            if flowing:
                lifted = lambda other: self.flowing_lift(jump, variables, other, before_quake)[0]
                slope = slope - self.rate(lifted, loading)
            if dry_before:
                losing = lambda other: interface.forces(
                    self.lost_pressure(at_points, variables, other, dry_before)[0]
                )
                slope = slope + self.rate(losing, loading)
            return slope

        return Residual(value, by_jump, by_level)

    def lost_pressure(
        self, jump: Array, variables: JointVariables, loading: Loading, before_quake: BeforeQuake
    ) -> tuple[Array, Array]:
        """The losses of `JointWater.lost_pressure` at the points of all joints, for jumps (q, 3)
        there.
        """
        pairs = zip(self.water, variables.split(jump[:, 0]), variables.joints, strict=True)
        losses = [water.lost_pressure(own, v, loading, before_quake) for water, own, v in pairs]
        traction, rate = (np.concatenate(parts) for parts in zip(*losses, strict=True))
        return traction, rate

    def pressures(
        self,
        jump: Array,
        variables: JointVariables,
        loading: Loading,
        before_quake: BeforeQuake | None = None,
    ) -> tuple[Pressure, ...]:
        """The water pressure in each joint at a jump; before_quake: see `residual`."""
        return tuple(water.pressure(jump, variables, loading, before_quake) for water in self.water)

    def crest(self, jump: Array, loading: Loading) -> float:
        """The crest's displacement along x [m]."""
        bulk = self.bulk
        value = bulk.crest_pressure @ self.external_forces(loading)[0] + bulk.crest_jump @ jump
        for name, size in self.sizes(loading.grown).items():
            value += size * bulk.crest_units[name]
        return float(value)

    def crest_rate(self, loading: Loading) -> float:
        """Its derivative with the level."""
        forces = self.rate(lambda other: self.external_forces(other)[0], loading)
        return float(self.bulk.crest_pressure @ forces)
