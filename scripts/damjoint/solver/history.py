"""What is recorded of a loading: a row of history per step, the joint's tables at the requested
levels.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import Array
from ..joint.equilibrium import Equilibrium
from ..model.case import Case
from ..model.results import HISTORY, Results, history_table, joint_table
from .model import StepResult
from .state import State

#: What is recorded of each step; the other columns of HISTORY are made from these.
RECORDED = (*(set(HISTORY) - {"load_factor", "x_resultant"}), "heel")


@dataclass
class History:
    """Rows and tables of a loading."""

    equilibrium: Equilibrium
    #: the state under the weight alone, from where displacements count; None: from no load at all
    at_rest: State | None = None
    #: RECORDED, a value per step
    rows: dict[str, list[float]] = field(default_factory=lambda: {name: [] for name in RECORDED})
    #: per requested level: the joint's rows, and those extrapolated from element means
    tables: list[tuple[Array, Array]] = field(default_factory=list)
    #: the states of the tables
    saved: list[State] = field(default_factory=list)

    def copy(self) -> History:
        """Another one, that can be continued independently."""
        rows = {name: list(values) for name, values in self.rows.items()}
        return replace(self, rows=rows, tables=list(self.tables), saved=list(self.saved))

    @property
    def last(self) -> dict[str, float]:
        """The last row."""
        return {name: values[-1] for name, values in self.rows.items()}

    def iterations_since(self, rows: int) -> int:
        """The Newton iterations of all steps after a number of rows."""
        return int(sum(self.rows["iterations"][rows:]))

    def __len__(self) -> int:
        return len(self.rows["time"])

    @property
    def saved_until(self) -> float:
        """The time of the last table."""
        return self.saved[-1].time if self.saved else 0.0

    def complete(self, state: State) -> bool:
        """Whether the row of a state is complete: an interruption can come at any time."""
        equal = len({len(values) for values in self.rows.values()}) == 1
        return equal and self.rows["time"][-1:] == [state.time]

    def add(self, step: StepResult, cuts: int) -> None:
        """The row of a converged step; cuts: how often it was shortened."""
        state, equilibrium = step.state, self.equilibrium
        law, interface = equilibrium.law, equilibrium.interface
        at_points = interface.jumps(interface.at_points, state.jump)
        traction, _ = law.traction_and_tangent(at_points, state.variables)
        weights = interface.points.weights / equilibrium.bulk.width
        frames = interface.frames[interface.points.elements]
        along_axes = np.einsum("qk,qkc->qc", traction, frames)
        N, T, M = interface.chord.resultants(weights, interface.points.positions, along_axes)
        pressure = state.pressure
        assert pressure is not None  # of any converged state
        normals = interface.surface.normals[interface.water_points.elements]
        uplift = interface.water_points.weights * pressure.water_points / equilibrium.bulk.width
        row = {
            "time": state.time,
            "level": state.loading.level,
            "tail_level": state.loading.tail,
            "iterations": step.iterations,
            "cuts": cuts,
            "residual": step.residual,
            "crack_length": weights @ law.is_open(at_points, state.variables),
            "process_zone": weights @ law.in_process_zone(at_points, state.variables),
            "slip_length": weights @ law.has_slipped(state.variables, len(weights)),
            "max_opening": interface.jumps(interface.at_nodes, state.jump)[:, 0].max(),
            "crest_ux": self.crest(state),
            "N": N,
            "T": T,
            "M": M,
            "U": uplift @ normals[:, :2] @ interface.chord.normal,
            "flux": pressure.leakage,
            "heel": interface.heel @ state.jump,
        }
        for name, value in row.items():
            self.rows[name].append(float(value))

    def crest(self, state: State) -> float:
        """The crest's displacement along x [m]."""
        crest, rest = self.equilibrium.crest, self.at_rest
        return crest(state.jump, state.loading) - (crest(rest.jump, rest.loading) if rest else 0.0)

    def save(self, state: State) -> None:
        """The joint at the state last added, node by node; and with jump and stress made from
        element means.
        """
        equilibrium = self.equilibrium
        law, interface = equilibrium.law, equilibrium.interface
        place, corners = interface.space.locations, len(interface.surface.points)
        pressure, variables = state.pressure, state.node_variables
        assert pressure is not None  # of any converged state
        jump = interface.jumps(interface.at_nodes, state.jump)
        traction, _ = law.traction_and_tangent(jump, variables)
        damage, slip = law.damage(jump, variables), law.slip(variables, len(jump))
        nodes = interface.mean_at_nodes(np.column_stack([jump, traction, damage, slip]))
        nodes[:, 3] -= pressure.nodes
        columns = [
            np.full((len(place), 2), (state.time, state.loading.level)),
            place,
            nodes[:, :6],
            pressure.nodes[:, None],
            nodes[:, 6:],
            interface.xi[:, None] * interface.length,
        ]
        of_law = law.column_values(variables)
        columns += [interface.mean_at_nodes(of_law[name])[:, None] for name in law.columns]
        if pressure.flux is not None:
            columns.append(self.node_means(pressure.flux[:, None], True))
        table = np.hstack(columns)
        at_points = interface.jumps(interface.at_points, state.jump)
        stress, _ = law.traction_and_tangent(at_points, state.variables)
        stress[:, 0] -= pressure.points
        weights, elements = interface.points.weights, interface.points.elements
        total = np.bincount(elements, weights)
        parts = (*at_points.T, *stress.T)
        means = np.column_stack([np.bincount(elements, weights * v) / total for v in parts])
        extrapolated = table.copy()
        extrapolated[:corners, 5:11] = self.node_means(means, False)
        self.saved.append(state)
        self.tables.append((table, extrapolated))

    def node_means(self, values: Array, middles: bool) -> Array:
        """Mean over the joint elements around each node (and each middle of an edge) of element
        values (e, m).
        """
        space = self.equilibrium.interface.space
        number = len(space.locations) if middles else len(space.body.points)
        total, count, start = np.zeros((number, values.shape[1])), np.zeros(number), 0
        for (_, functions), (_, cells) in zip(space.connectivity, space.body.cells, strict=True):
            table = functions if middles else cells
            rows = np.repeat(np.arange(start, start + len(table)), table.shape[1])
            np.add.at(total, table.ravel(), values[rows])
            np.add.at(count, table.ravel(), 1)
            start += len(table)
        return total / count[:, None]

    def results(self, case: Case, stopped: bool) -> Results:
        """All tables so far."""
        rows = {name: np.array(values, float) for name, values in self.rows.items()}
        joint, extrapolated = (joint_table(case, [t[k] for t in self.tables]) for k in (0, 1))
        return Results(case, history_table(case, rows), joint, extrapolated, stopped, rows["heel"])
