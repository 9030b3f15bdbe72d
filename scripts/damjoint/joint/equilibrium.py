"""The joints with the condensed bodies around them (see fem/condensation.py) at rest: laws, loads,
water, and the problem of a step made from them.
"""

from __future__ import annotations

from collections.abc import Collection
from copy import copy
from functools import lru_cache

import numpy as np

from ..arrays import Array
from ..input.case import Case
from ..input.scene import BED, DOWN
from ..model.loads import (
    LEVEL,
    AddedPressure,
    Loading,
    Unknown,
    line_forces,
    thermal_strains,
    water_column,
)
from .flow_in_time import TimeStep
from .interface import Interface
from .joint_laws import JointLaws, JointVariables
from .problem import JointProblem, rate
from .step_water import StepWater
from .water import BeforeQuake, JointWater, water_systems
from .wet_faces import WetFace

#: Sides of the faces under the tailwater.
BY_TAIL = DOWN, BED


class Equilibrium:
    """The joints with the condensed bodies: their laws, their water and the static loads."""

    def __init__(self, case: Case, interface: Interface) -> None:
        self.case, self.bulk, self.interface = case, interface.bulk, interface
        self.water = [
            JointWater(joint_case, joint, number)
            for number, (joint_case, joint) in enumerate(
                zip(case.joints, interface.joints, strict=True)
            )
        ]
        #: where water flows
        systems = water_systems(self.water, interface)
        self.flowing = tuple(system for system in systems if system.members[0].flowing)
        self.unit_weight = case["rho_water"] * case["g"]
        self.laws = JointLaws([joint_case.law for joint_case in case.joints])
        #: whether the state under rising water depends on the steps that lead to it; in a crack
        #: water enters after the step that has opened it
        self.path_dependent = any(
            joint_case.law.path_dependent or joint_case["uplift"] == "cracked"
            for joint_case in case.joints
        )
        #: tangent (q, 3, 3) of the undamaged joints
        points = [len(joint.points.weights) for joint in interface.joints]
        self.undamaged = self.laws.undamaged_tangent(points)
        #: loaded unknowns on which a face acts, and the functions of the face that are among them
        self.loaded = {
            name: (dofs[dofs >= 0], np.flatnonzero(dofs >= 0))
            for name, dofs in interface.bulk.dof_of_face.items()
        }
        self.keep_loads()

    def keep_loads(self) -> None:
        """Keep the last loads."""
        #: unit loads by the parts of the loads that act
        self.sizes = lru_cache(maxsize=4)(lambda grown: self.unit_loads(Loading(0.0, 0.0, grown)))
        #: what does not follow the level of the next, by the tailwater and the parts of the loads
        self.other_forces = lru_cache(maxsize=4)(self._other_forces)
        #: forces on the loaded unknowns and t_0; with the water in the joints: of the last loadings
        self.external_forces = lru_cache(maxsize=8)(self._external_forces)
        self.loads = lru_cache(maxsize=8)(self._loads)

    def with_laws(self, case: Case) -> Equilibrium:
        """The same for another case that differs in parameters of the laws."""
        other = copy(self)
        other.case = case
        pairs = zip(case.joints, self.case.joints, self.laws.laws, strict=True)
        other.laws = JointLaws([law if a.values == b.values else a.law for a, b, law in pairs])
        return other

    def with_cracks(self, some: Collection[JointWater]) -> Equilibrium:
        """The same with the water of some joints, that exchange none with others, in the cracks of
        the laws of this case.
        """
        if not some:
            return self
        other = copy(self)
        changed = {water: water.with_law(self.case.joints[water.number]) for water in some}
        systems = {water.system: new.system for water, new in changed.items()}
        other.water = [changed.get(water, water) for water in self.water]
        other.flowing = tuple(systems.get(system, system) for system in self.flowing)
        return other

    def with_loads(self, case: Case) -> Equilibrium:
        """The same for another case that differs in loads other than water in the joints."""
        other = copy(self)
        other.case = case
        other.keep_loads()
        return other

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
            return face.pressed(pressure)
        added = AddedPressure(0.0, self.interface.floor)
        if face.side == "up" and loading.part("quake"):
            added = AddedPressure.of(case, loading, self.interface.floor)

        def height(level: float, y: Array, tilt: Array) -> Array:
            depth = np.maximum(level - y, 0)
            return depth + added.height(level, y, tilt) if added.size else depth

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

    def forces_on_faces(self, loading: Loading, by_tail: bool) -> Array:
        """Forces (m,) on the loaded unknowns, of the faces under the tailwater or of the others."""
        forces = np.zeros(self.bulk.pressure.shape[1])
        for name, face in self.interface.faces.items():
            if (face.side in BY_TAIL) == by_tail:
                dofs, functions = self.loaded[name]
                np.add.at(forces, dofs, self.face_forces(face, loading)[functions])
        return forces

    def _other_forces(self, tail: float, grown: tuple[float, ...]) -> tuple[Array, Array]:
        forces = self.forces_on_faces(Loading(0.0, tail), by_tail=True)
        total = self.bulk.pressure @ forces
        for name, size in self.sizes(grown).items():
            total += size * self.bulk.units[name]
        return forces, total

    def _external_forces(self, loading: Loading) -> tuple[Array, Array]:
        """Forces on the loaded unknowns (m,), and t_0 (j,) of them and of the unit loads."""
        forces, total = self.other_forces(loading.tail, loading.grown)
        by_level = self.forces_on_faces(loading, by_tail=False)
        return forces + by_level, total + self.bulk.pressure @ by_level

    def _loads(self, loading: Loading) -> Array:
        """t_0 and, unless it flows, the water in the joints together (j,)."""
        total = self.external_forces(loading)[1]
        for water in self.water:
            if water.wet and not water.flowing:
                total = total + water.lift(loading)
        return total

    # -- steps
    # ---------------------------------------------------------------------------------------------

    def water_in_step(
        self,
        variables: JointVariables,
        before_quake: BeforeQuake | None = None,
        steps: tuple[TimeStep, ...] = (),
    ) -> StepWater:
        """The water in the joints for the internal variables of a step's beginning; before_quake:
        the joints before the earthquake that acts, if the water follows from them; steps: see
        `StepWater`.
        """
        return StepWater(
            joints=self.water,
            flowing=self.flowing,
            variables=variables,
            before_quake=before_quake,
            steps=steps,
        )

    def problem(
        self,
        variables: JointVariables,
        before_quake: BeforeQuake | None = None,
        laws: JointLaws | None = None,
        steps: tuple[TimeStep, ...] = (),
    ) -> JointProblem:
        """The equilibrium at the end of a step, see `water_in_step`; laws: with frozen damage."""
        return JointProblem(
            interface=self.interface,
            stiffness=self.bulk.stiffness,
            system=self.interface.system(self.undamaged),
            laws=laws or self.laws,
            variables=variables,
            loads=self.loads,
            size=self.case.size,
            water=self.water_in_step(variables, before_quake, steps),
        )

    # -- displacements of the bodies

    def displacement(self, name: str, jump: Array, loading: Loading) -> float:
        """A displacement by its name among `Bodies.measures` [m]."""
        measure = self.bulk.measures[name]
        value = measure.pressure @ self.external_forces(loading)[0] + measure.jump @ jump
        for load, size in self.sizes(loading.grown).items():
            value += size * measure.units[load]
        return float(value)

    def displacement_rate(self, name: str, loading: Loading, unknown: Unknown) -> float:
        """Its derivative with what is unknown in the loading."""
        measure, size = self.bulk.measures[name], self.case.size
        forces = rate(lambda other: self.external_forces(other)[0], loading, size, unknown)
        total = measure.pressure @ forces
        if unknown != LEVEL:
            more = unknown.at(loading, unknown.of(loading) + 1)
            for sign, sizes in ((1, self.sizes(more.grown)), (-1, self.sizes(loading.grown))):
                total += sign * sum(size * measure.units[load] for load, size in sizes.items())
        return float(total)
