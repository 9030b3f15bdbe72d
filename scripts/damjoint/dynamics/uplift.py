"""Water pressure in the joints during an earthquake."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Array, BoolArray
from ..input.case import Case
from ..joint.water import JointWater, Pressure
from ..solver.state import State
from .step import Problem


def pressures_in_motion(case: Case, problem: Problem, state: State) -> tuple[Pressure, ...]:
    """The water pressure in each joint in a step that begins at a state; see quake_uplift in
    pro/parameters.pro [USACE EM 1110-2-2200].
    """
    static, mode = problem.static.pressures, case["quake_uplift"]
    equilibrium = problem.model.equilibrium
    if mode == "zero":
        jumps = equilibrium.interface.jumps(equilibrium.interface.at_points, state.jump)
        parts = zip(
            equilibrium.water,
            static,
            state.variables.split(jumps),
            state.variables.joints,
            strict=True,
        )
        return tuple(
            without(pressure, water, water.law.gapes(jump, variables))
            for water, pressure, jump, variables in parts
        )
    if mode == "transient":  # where it flows solved with the jumps
        return state.pressures
    if mode == "crack" and equilibrium.flowing:
        return equilibrium.water_in_step(state.variables).pressures(state.jump, state.loading)
    return static


def without(pressure: Pressure, water: JointWater, gapes: BoolArray) -> Pressure:
    """A pressure, and none in the elements whose points (q,) all gape, nor at their nodes."""
    joint, starts = water.joint, 0
    points = joint.points.elements
    elements = np.bincount(points, gapes) == np.bincount(points)
    nodes = np.zeros(len(joint.space.locations), bool)
    for _, table in joint.space.connectivity:
        nodes[table[elements[starts : starts + len(table)]]] = True
        starts += len(table)

    def rest(values: Array, dry: BoolArray) -> Array:
        return np.where(dry, 0.0, values)

    return replace(
        pressure,
        points=rest(pressure.points, elements[points]),
        water_points=rest(pressure.water_points, elements[water.wetted.points.elements]),
        nodes=rest(pressure.nodes, nodes),
    )
