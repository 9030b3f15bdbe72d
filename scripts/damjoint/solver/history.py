"""What is recorded of a loading: a row of history per step, the joint's tables at the requested
levels.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Array
from ..input.case import Case
from ..input.scene import POINT
from ..joint.equilibrium import Equilibrium
from ..joint.interface import JointInterface
from ..joint.water import Pressure
from ..laws import Law
from ..model.loads import Unknown
from ..model.results import (
    FILM,
    HISTORY_OF_JOINTS,
    IN_TIME,
    THICKNESS,
    Results,
    column_of,
    history_columns,
    history_table,
    joint_columns,
    joint_table,
    of_control,
)
from .model import StepResult
from .newton import BY_ROUND_OFF
from .state import State

#: What is recorded of each step, and of each joint; the other columns of HISTORY are made from
#: these.
RECORDED = ("time", "level", "tail_level", "iterations", "cuts", "residual", "crest_ux")
RECORDED_OF_JOINTS = (
    *(n for n in HISTORY_OF_JOINTS if n not in {"x_resultant", *IN_TIME}),
    "heel",
)

#: Part of the reservoir's head that the water loses at most in a crack that it has entered [-].
LOST_HEAD = 1e-3
#: The part of a joint under the full head of the reservoir [-], recorded with cracked uplift.
FULL_HEAD = "full_head"


def recorded(case: Case) -> list[str]:
    """Names of what is recorded of the joints of a case."""
    of_joints = [*RECORDED_OF_JOINTS, *(n for n in history_columns(case) if n in IN_TIME)]
    if any(joint["uplift"] == "cracked" for joint in case.joints):
        of_joints.append(FULL_HEAD)
    return [column_of(name, k) for k in range(len(case.joints)) for name in of_joints]


def row_of_control(history: History, state: State) -> dict[str, float]:
    """The columns `of_control` at a state."""
    case = history.equilibrium.case
    of = {
        "load_factor": lambda: Unknown(case["drive_load"]).of(state.loading),
        "point_u": lambda: history.displacement(f"{POINT}_{case['drive_direction']}", state),
    }
    return {name: of[name]() for name in of_control(case)}


@dataclass(frozen=True)
class JointState:
    """A joint, by its number, at a state."""

    equilibrium: Equilibrium
    state: State
    number: int

    @property
    def joint(self) -> JointInterface:
        """The joint."""
        return self.equilibrium.interface.joints[self.number]

    @property
    def law(self) -> Law[Any]:
        """Its law."""
        return self.equilibrium.laws.laws[self.number]

    @property
    def variables(self) -> Any:
        """Internal variables of its Gauss points."""
        return self.state.variables.joints[self.number]

    @property
    def node_variables(self) -> Any:
        """Internal variables of its nodes, by the joint's `rows`."""
        return self.state.node_variables.joints[self.number]

    @property
    def pressure(self) -> Pressure:
        """Of the water in it."""
        return self.state.pressures[self.number]

    @cached_property
    def jump(self) -> Array:
        """At its Gauss points (q, 3) [m]."""
        return self.joint.jumps(self.joint.at_points, self.state.jump)

    @cached_property
    def traction(self) -> Array:
        """At its Gauss points (q, 3) [Pa]."""
        return self.law.traction_and_tangent(self.jump, self.variables)[0]

    @cached_property
    def node_jump(self) -> Array:
        """At its nodes (rows, 3) [m]."""
        return self.joint.jumps(self.joint.at_nodes, self.state.jump)

    @cached_property
    def node_traction(self) -> Array:
        """At its nodes (rows, 3) [Pa]."""
        return self.law.traction_and_tangent(self.node_jump, self.node_variables)[0]

    @cached_property
    def ends(self) -> tuple[Array, Array]:
        """delta_n and delta_t1 at its heel and at its toe (2,) [m]."""
        nodes, mesh = self.joint.mean_at_nodes(self.node_jump), self.joint.mesh
        heel, toe = (nodes[n].mean(axis=0)[:2] for n in (mesh.heel_nodes, mesh.toe_nodes))
        return heel, toe

    @cached_property
    def row(self) -> dict[str, float]:
        """RECORDED_OF_JOINTS; with flow in time IN_TIME, too."""
        joint, law, jump, variables = self.joint, self.law, self.jump, self.variables
        weights = joint.points.weights / joint.width
        frames = joint.frames[joint.points.elements]
        along_axes = np.einsum("qk,qkc->qc", self.traction, frames)
        N, T, M = joint.chord.resultants(weights, joint.points.positions, along_axes)
        wetted = self.equilibrium.water[self.number].wetted.points
        normals = joint.surface.normals[wetted.elements]
        water = -self.pressure.water_points[:, None] * normals
        U, _, M_U = joint.chord.resultants(wetted.weights / joint.width, wetted.positions, water)
        return {
            "crack_length": weights @ law.is_open(jump, variables),
            "process_zone": weights @ law.in_process_zone(jump, variables),
            "slip_length": weights @ law.has_slipped(variables, len(weights)),
            "broken_length": weights @ law.is_broken(jump, variables),
            "bonded_length": weights @ law.cohesion_left(jump, variables),
            "max_opening": self.node_jump[:, 0].max(),
            "N": N,
            "T": T,
            "M": M,
            "T_z": weights @ along_axes[:, 2],
            "U": U,
            "M_U": M_U,
            "flux": self.pressure.leakage,
            "heel": joint.heel @ self.state.jump,
            FULL_HEAD: self.full_head,
            **(self.in_time if self.state.stored else {}),
        }

    @property
    def full_head(self) -> float:
        """The part in which the water has the full head of the reservoir [-]: the crack that it has
        entered from there, not one that the tailwater enters; 0 but with cracked uplift.
        """
        water, weights = self.equilibrium.water[self.number], self.joint.points.weights
        if water.case["uplift"] != "cracked":
            return 0.0
        reservoir = self.state.loading.level + water.case["joint_head_offset"]
        depth = reservoir - self.joint.points.positions[:, 1]
        full = self.pressure.points >= (1 - LOST_HEAD) * self.equilibrium.unit_weight * depth
        return float(weights @ (full & (depth > 0)) / weights.sum())

    @property
    def in_time(self) -> dict[str, float]:
        """The columns IN_TIME; zero without flowing water."""
        water, flowing = self.equilibrium.water[self.number], self.equilibrium.flowing
        if water.system not in flowing:
            return dict.fromkeys(IN_TIME, 0.0)
        return water.in_time(self.state.stored[flowing.index(water.system)], self.pressure)

    @property
    def film(self) -> dict[str, Array]:
        """The columns FILM at the locations; zero without flowing water. What air a dry end has
        drawn in counts up to its aperture.
        """
        joint, water = self.joint, self.equilibrium.water[self.number]
        flowing, stored = self.equilibrium.flowing, self.state.stored
        none = np.zeros(len(joint.space.locations))
        if water.system not in flowing or not stored or self.pressure.flux is None:
            return dict.fromkeys(FILM, none)
        of_system = stored[flowing.index(water.system)]
        share = np.minimum(of_system.void / water.system.volume(self.state.jump), 1)
        number = 2 * np.abs(node_means(joint, self.pressure.flux)) / water.case["visc"]
        mass = water.case["rho_water"] * of_system.volume / water.system.area
        at_nodes = joint.fields.at_locations @ np.column_stack([share, mass])[water.nodes]
        columns = at_nodes[:, 0], number, at_nodes[:, 1]
        return dict(zip(FILM, columns, strict=True))

    def table(self) -> tuple[Array, Array]:
        """Its rows, node by node, columns `joint_columns` but for sigma_n_eff; and the same with
        jump and stress extrapolated from the Gauss points.
        """
        joint, law, variables = self.joint, self.law, self.node_variables
        pressure, locations, jump = self.pressure, joint.space.locations, self.node_jump
        damage, slip = law.damage(jump, variables), law.slip(variables, len(jump))
        nodes = joint.mean_at_nodes(np.column_stack([jump, self.node_traction, damage, slip]))
        nodes[:, 3] -= pressure.nodes
        columns = {
            "time": np.full(len(locations), self.state.time),
            "level": np.full(len(locations), self.state.loading.level),
            "joint": np.full(len(locations), self.number + 1.0),
            **dict(zip("xyz", locations.T, strict=True)),
            **dict(zip(JUMP_AND_STRESS, nodes.T, strict=False)),
            "p": pressure.nodes,
            "damage": nodes[:, 6],
            "slip": nodes[:, 7],
            "s": joint.xi * joint.length,
        }
        case = self.equilibrium.case
        if THICKNESS.keys() & joint_columns(case.joints[self.number]).keys():
            added = law.added_thickness(variables, len(jump))
            columns |= dict.fromkeys(THICKNESS, joint.mean_at_nodes(added))
        of_law = law.column_values(variables)
        columns |= {name: joint.mean_at_nodes(of_law[name]) for name in law.columns}
        if pressure.flux is not None:
            columns["flux"] = node_means(joint, pressure.flux)
        if FILM.keys() & joint_columns(case.joints[self.number]).keys():
            columns |= self.film
        stress = self.traction.copy()
        stress[:, 0] -= pressure.points
        extrapolated = {name: columns[name].copy() for name in JUMP_AND_STRESS}
        at_corners = joint.extrapolate(np.hstack([self.jump, stress]))
        for name, values in zip(JUMP_AND_STRESS, at_corners.T, strict=True):
            extrapolated[name][: len(joint.surface.points)] = values
        nothing = np.full(len(locations), np.nan)  # of a column that only other joints have
        names = [name for name in joint_columns(case) if name != "sigma_n_eff"]
        tables = columns, columns | extrapolated
        one, other = (np.column_stack([t.get(name, nothing) for name in names]) for t in tables)
        return one, other


@dataclass
class History:
    """Rows and tables of a loading."""

    equilibrium: Equilibrium
    #: the state under the weight alone, from where displacements count; None: from no load at all
    at_rest: State | None = None
    #: RECORDED, a value per step
    rows: dict[str, list[float]] = field(default_factory=dict)
    #: per requested level: the joint's rows, and those extrapolated from the Gauss points
    tables: list[tuple[Array, Array]] = field(default_factory=list)
    #: the states of the tables
    saved: list[State] = field(default_factory=list)
    #: times of the rows whose step has converged by round-off, see `Convergence`
    by_round_off: list[float] = field(default_factory=list)
    #: at the last state, see `joints`
    last_joints: list[JointState] = field(default_factory=list)

    def __post_init__(self) -> None:
        case = self.equilibrium.case
        names = *RECORDED, *recorded(case), *of_control(case)
        self.rows = self.rows or {name: [] for name in names}

    def copy(self) -> History:
        """Another one, that can be continued independently."""
        rows = {name: list(values) for name, values in self.rows.items()}
        return replace(
            self,
            rows=rows,
            tables=list(self.tables),
            saved=list(self.saved),
            by_round_off=list(self.by_round_off),
        )

    def until(self, time: float) -> History:
        """Another one with the rows and tables up to a time."""
        number, tables = (
            int(np.searchsorted(of, time, "right"))
            for of in (self.rows["time"], [state.time for state in self.saved])
        )
        return replace(
            self,
            rows={name: values[:number] for name, values in self.rows.items()},
            tables=self.tables[:tables],
            saved=self.saved[:tables],
            by_round_off=[known for known in self.by_round_off if known <= time],
        )

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
        state = step.state
        row = {
            "time": state.time,
            "level": state.loading.level,
            "tail_level": state.loading.tail,
            "iterations": step.iterations,
            "cuts": cuts,
            "residual": step.residual,
            "crest_ux": self.crest(state),
        }
        for k, joint in enumerate(self.joints(state)):
            row |= {column_of(name, k): value for name, value in joint.row.items()}
        row |= row_of_control(self, state)
        for name, values in self.rows.items():
            values.append(float(row[name]))
        if step.criterion == BY_ROUND_OFF:
            self.by_round_off.append(state.time)

    def joints(self, state: State) -> list[JointState]:
        """The joints at a state; those of the last one are kept, as its tables follow its row."""
        if not self.last_joints or self.last_joints[0].state is not state:
            number = len(self.equilibrium.interface.joints)
            self.last_joints = [JointState(self.equilibrium, state, k) for k in range(number)]
        return self.last_joints

    def crest(self, state: State) -> float:
        """The crest's displacement along x [m]."""
        return self.displacement("crest", state)

    def displacement(self, name: str, state: State) -> float:
        """A displacement by its name among `Bodies.measures` [m]."""
        of, rest = self.equilibrium.displacement, self.at_rest
        at_rest = of(name, rest.jump, rest.loading) if rest else 0.0
        return of(name, state.jump, state.loading) - at_rest

    def save(self, state: State) -> None:
        """The joints at the state last added, node by node; and with jump and stress extrapolated
        from the Gauss points.
        """
        parts = [joint.table() for joint in self.joints(state)]
        self.saved.append(state)
        table, extrapolated = (np.vstack(rows) for rows in zip(*parts, strict=True))
        self.tables.append((table, extrapolated))

    def results(self, case: Case, stopped: bool) -> Results:
        """All tables so far."""
        rows = {name: np.array(values, float) for name, values in self.rows.items()}
        joint, extrapolated = (joint_table(case, [t[k] for t in self.tables]) for k in (0, 1))
        return Results(case, history_table(case, rows), joint, extrapolated, stopped, rows["heel"])


#: Columns of joint.csv that are also extrapolated from the Gauss points.
JUMP_AND_STRESS = ("delta_n", "delta_t1", "delta_t2", "sigma_n", "tau_1", "tau_2")


def node_means(joint: JointInterface, values: Array) -> Array:
    """Mean over the joint elements around each node and each middle of an edge of element values
    (e,).
    """
    number, start = len(joint.space.locations), 0
    total, count = np.zeros(number), np.zeros(number)
    for _, functions in joint.space.connectivity:
        rows = np.repeat(np.arange(start, start + len(functions)), functions.shape[1])
        np.add.at(total, functions.ravel(), values[rows])
        np.add.at(count, functions.ravel(), 1)
        start += len(functions)
    return total / count
