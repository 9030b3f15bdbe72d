"""Table of every update of the internal variables of a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..arrays import Array, Table
from ..joint.equilibrium import Equilibrium
from ..laws import Law
from ..model.results import step_columns
from .state import Trace


def trace_table(
    equilibrium: Equilibrium, trace: Trace, earthquake: Sequence[float] = (), static: int = 0
) -> Table:
    """The table of all updates, see `step_columns`.

    earthquake: times [s] of its steps; static: number of updates before it. Those after it are of
    the static equilibrium, by whose number in history.csv they are known.
    """
    updates, columns = trace.updates, step_columns(equilibrium.case)
    end = static + len(earthquake)
    times = [update.state.time for update in updates]
    times[static:end] = earthquake
    if earthquake:
        times[end:] = [len(equilibrium.case.levels) + 1.0] * (len(updates) - end)
    blocks = []
    for number, (update, time) in enumerate(zip(updates, times, strict=True)):
        state, moving = update.state, static <= number < end
        of_step = {
            "update": number + 1,
            "begin": times[number - 1] * (number > static) if moving else update.begin,
            "time": time,
            "level": state.loading.level,
            "tail_level": state.loading.tail,
            "frozen": update.frozen,
            "earthquake": moving,
        }
        for k, joint in enumerate(equilibrium.interface.joints):
            law, nodes, points = equilibrium.laws.laws[k], joint.rows, joint.points
            pressure = state.pressures[k]
            of_nodes = at_points(
                law,
                joint.jumps(joint.at_nodes, state.jump),
                state.node_variables.joints[k],
                joint.space.locations[nodes],
            )
            of_points = at_points(
                law,
                joint.jumps(joint.at_points, state.jump),
                state.variables.joints[k],
                points.positions,
            )
            of_nodes |= {"weight": np.zeros(len(nodes)), "p": pressure.nodes[nodes]}
            of_points |= {"weight": points.weights / joint.width, "p": pressure.points}
            for table in (of_nodes, of_points):
                known = of_step | table | {"joint": k + 1}
                rows = len(table["weight"])
                values = (known.get(name, np.nan) for name in columns)
                blocks.append(np.column_stack([np.broadcast_to(v, rows) for v in values]))
    return dict(zip(columns, np.vstack(blocks).T if blocks else [[]] * len(columns), strict=True))


def at_points(law: Law[Any], jump: Array, variables: Any, positions: Array) -> Table:
    """Columns of points (q,) of a law at jumps (q, 3)."""
    traction, _ = law.traction_and_tangent(jump, variables)
    number = len(jump)
    return {
        **dict(zip("xyz", positions.T, strict=True)),
        **dict(zip(("delta_n", "delta_t1", "delta_t2"), jump.T, strict=True)),
        **dict(zip(("sigma_n_eff", "tau_1", "tau_2"), traction.T, strict=True)),
        "damage": law.damage(jump, variables),
        "slip": law.slip(variables, number),
        "joint_thickness": law.added_thickness(variables, number),
        **law.column_values(variables),
    }
