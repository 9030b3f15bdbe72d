"""Water pressure in the joints during an earthquake: frozen, or changed where a joint is open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Array, BoolArray
from ..joint.interface import JointInterface
from ..joint.water import JointWater, Pressure
from ..model.case import Case
from ..solver.state import State
from .step import Problem


def pressures_in_motion(case: Case, problem: Problem, state: State) -> tuple[Pressure, ...]:
    """The water pressure in each joint in a step that begins at a state.

    frozen: that of the static state (the water has no time to flow in or out); zero: none where the
    joint is open; full: the reservoir's where it is open from the heel on [USACE EM 1110-2-2200].
    """
    static, mode = problem.static.pressures, case["quake_uplift"]
    if mode == "frozen":
        return static
    equilibrium = problem.model.equilibrium
    jumps = equilibrium.interface.jumps(equilibrium.interface.at_points, state.jump)
    result = []
    for k, water in enumerate(equilibrium.water):
        if not water.wet:
            result.append(static[k])
            continue
        own = state.variables.split(jumps)[k]
        is_open = water.law.is_open(own, state.variables.joints[k])
        joint = water.joint
        points = joint.points.elements
        elements = np.bincount(points, is_open) == np.bincount(points)
        if mode == "full":
            elements &= from_heel(joint, elements)
        result.append(changed(water, static[k], elements, state, mode))
    return tuple(result)


def from_heel(joint: JointInterface, elements: BoolArray) -> BoolArray:
    """Elements between the heel and the first one that is closed."""
    xi = joint.fields.xi
    middles = np.concatenate([xi[table].mean(axis=1) for _, table in joint.surface.cells])
    closed = middles[~elements]
    return np.asarray(middles < closed.min(initial=np.inf))


def changed(
    water: JointWater, static: Pressure, elements: BoolArray, state: State, mode: str
) -> Pressure:
    """The pressure in a joint with that in its open elements replaced: at points; at a node where
    one of its elements is open.
    """
    joint = water.joint
    head = state.loading.level + water.case["joint_head_offset"]

    def replaced(pressure: Array, is_open: BoolArray, heights: Array) -> Array:
        open_pressure = np.maximum(water.unit_weight * (head - heights), 0) * (mode == "full")
        return np.where(is_open, open_pressure, pressure)

    nodes = np.zeros(len(joint.space.locations), bool)
    start = 0
    for _, table in joint.space.connectivity:
        nodes[table[elements[start : start + len(table)]]] = True
        start += len(table)
    return replace(
        static,
        points=replaced(
            static.points, elements[joint.points.elements], joint.points.positions[:, 1]
        ),
        water_points=replaced(
            static.water_points,
            elements[joint.water_points.elements],
            joint.water_points.positions[:, 1],
        ),
        nodes=replaced(static.nodes, nodes, joint.space.locations[:, 1]),
    )
