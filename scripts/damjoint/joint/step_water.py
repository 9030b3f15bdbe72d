"""The water in the joints in a step, that follows the jumps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Array, BoolArray
from ..model.loads import Loading
from .flow import FlowDerivative, FlowSolution
from .flow_in_time import FlowInTime, StoredWater, TimeStep
from .joint_laws import JointVariables
from .linear_system import Tangent
from .water import BeforeQuake, JointWater, Pressure, WaterSystem


@dataclass(frozen=True, kw_only=True)
class StepWater:
    """The water in the joints for the internal variables of a step's beginning: it follows the
    jumps of the step or, with quake_uplift = unchanged or zero, those before a pseudo-static
    earthquake.
    """

    joints: list[JointWater]
    #: where it flows
    flowing: tuple[WaterSystem, ...]
    variables: JointVariables
    before_quake: BeforeQuake | None = None
    #: in which each of `flowing` stores water; empty: the flow is steady
    steps: tuple[TimeStep, ...] = ()

    @property
    def flowing_in_steps(self) -> list[tuple[WaterSystem, TimeStep | None]]:
        """Where water flows, each with its step, None if the flow is steady."""
        return list(zip(self.flowing, self.steps or (None,) * len(self.flowing), strict=True))

    def flow(self, jump: Array, loading: Loading) -> StepFlow:
        """The water that flows, at a jump (j,)."""
        solutions = [
            system.solve(jump, self.variables, loading, self.before_quake, step)
            for system, step in self.flowing_in_steps
        ]
        lift = np.zeros(len(jump))
        for (system, step), solution in zip(self.flowing_in_steps, solutions, strict=True):
            nodal = system.expand_to_nodes(solution)
            for water in system.members:
                beyond = water.wetted.fields @ nodal[water.nodes]
                lift += water.lift(loading, beyond, water.lowest(step))
        return StepFlow(water=self, jump=jump, lift=lift, solutions=solutions)

    @cached_property
    def beside(self) -> BoolArray:
        """The unknowns (j,) on which flowing water does not act."""
        beside = np.ones(self.joints[0].wetted.opening.shape[1], bool)
        for system in self.flowing:
            for water in system.members:
                beside[water.wetted.opening.indices] = False
        return beside

    @property
    def loses_pressure(self) -> bool:
        """Whether a crack that a pseudo-static earthquake opens is dry, see `lost_pressure`."""
        return self.before_quake is not None and any(water.dry_crack for water in self.joints)

    def lost_pressure(self, at_points: Array, loading: Loading) -> tuple[Array, Array]:
        """The losses of `JointWater.lost_pressure` at the points of all joints, for jumps (q, 3)
        there: as a traction (q, 3), and its derivative (q, 3, 3).
        """
        assert self.before_quake
        openings = self.variables.split(at_points[:, 0])
        losses = [
            water.lost_pressure(opening, variables, loading, self.before_quake)
            for water, opening, variables in zip(
                self.joints, openings, self.variables.joints, strict=True
            )
        ]
        traction, derivative = (np.concatenate(parts) for parts in zip(*losses, strict=True))
        return traction, derivative

    def pressures(self, jump: Array, loading: Loading) -> tuple[Pressure, ...]:
        """The water pressure in each joint at a jump (j,)."""
        steps = dict(zip(self.flowing, self.steps, strict=False))
        return tuple(
            water.pressure(
                jump, self.variables, loading, self.before_quake, steps.get(water.system)
            )
            for water in self.joints
        )

    def stored(self, jump: Array, loading: Loading, time: float) -> tuple[StoredWater, ...]:
        """What each of `flowing` stores at the end of the step, at a time and a jump (j,)."""
        ends = list[StoredWater]()
        for system, step in self.flowing_in_steps:
            if step is None:
                ends.append(system.stored_at(jump, self.variables, loading, time))
                continue
            solution = system.solve(jump, self.variables, loading, self.before_quake, step)
            assert isinstance(solution, FlowInTime)
            ends.append(solution.stored(time, step.begin))
        return tuple(ends)


@dataclass(frozen=True, kw_only=True)
class StepFlow:
    """The water that flows in the joints at a jump (j,)."""

    water: StepWater
    jump: Array
    #: its forces on the joint faces (j,)
    lift: Array
    #: of each of `StepWater.flowing`
    solutions: list[FlowSolution]

    def tangent(self, law: Array) -> Tangent:
        """The derivative of the joints' forces, with that of the laws (q, 3, 3)."""
        water = self.water
        following = [
            (system.flow, derivative)
            for (system, step), solution in zip(water.flowing_in_steps, self.solutions, strict=True)
            if (
                derivative := system.derivative(
                    self.jump, water.variables, solution, water.before_quake, step
                )
            )
        ]
        joined = FlowDerivative.joined([derivative for _, derivative in following])
        return Tangent(law, joined, tuple(flow for flow, _ in following))
