"""What is kept of a loading: a row of history per step, the joint's tables at the requested
levels.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..joint.equilibrium import Joint, Pressure
from ..laws import Memory
from ..model.case import Case
from ..model.loads import Loading
from ..model.results import HISTORY, Results, history_table, joint_columns, joint_table

#: What is found at each step; the other columns of HISTORY are made from these.
FOUND = (*(set(HISTORY) - {"load_factor", "x_resultant"}), "heel")


@dataclass(frozen=True)
class State:
    """A converged state: what the next step starts from, with the memory of the law's points and of
    the nodes.
    """

    time: float
    loading: Loading
    jump: np.ndarray
    memory: Memory
    #: by `rows` of the interface
    nodes: Memory
    #: of the water it is in equilibrium with: what had broken before lets in
    pressure: Pressure | None = None

    @staticmethod
    def virgin(joint: Joint) -> State:
        """Before any load."""
        law, interface = joint.law, joint.interface
        memories = law.start(len(interface.points.weights)), law.start(len(interface.rows))
        return State(0.0, Loading(0.0, 0.0), np.zeros(len(joint.bulk.stiffness)), *memories)

    def staged(self, joint: Joint, time: float) -> State:
        """The state with the memories for a step that goes on to a time."""
        memories = (joint.law.stage(m, self.time, time) for m in (self.memory, self.nodes))
        return replace(self, **dict(zip(("memory", "nodes"), memories, strict=True)))

    def held(self, joint: Joint) -> State:
        """The state with memories with which nothing breaks or lets go any further."""
        at_points, at_nodes = seen(joint, self.jump)
        memory, nodes = joint.law.hold(at_points, self.memory), joint.law.hold(at_nodes, self.nodes)
        return replace(self, memory=memory, nodes=nodes)

    def remember(self, joint: Joint, jump: np.ndarray) -> tuple[Memory, Memory]:
        """The memories after a step to a jump."""
        at_points, at_nodes = seen(joint, jump)
        return joint.law.remember(at_points, self.memory), joint.law.remember(at_nodes, self.nodes)


def seen(joint: Joint, jump: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The jump as the law's points and the nodes see it, (q, 3) each."""
    interface = joint.interface
    return tuple(interface.jumps(m, jump) for m in (interface.at_points, interface.at_nodes))


@dataclass
class Record:
    """Rows and tables of a loading."""

    joint: Joint
    #: the state under the weight alone, from where displacements count; None: from no load at all
    at_rest: State | None = None
    #: FOUND, a value per step
    rows: dict[str, list[float]] = field(default_factory=lambda: {name: [] for name in FOUND})
    #: per requested level: the joint's rows, and those extrapolated from element means
    tables: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)
    #: the states of the tables
    saved: list[State] = field(default_factory=list)

    def copy(self) -> Record:
        """Another one, to go on with by itself."""
        rows = {name: list(values) for name, values in self.rows.items()}
        return replace(self, rows=rows, tables=list(self.tables), saved=list(self.saved))

    @property
    def saved_until(self) -> float:
        """The time of the last table."""
        return self.saved[-1].time if self.saved else 0.0

    def complete(self, state: State) -> bool:
        """Whether the row of a state is there, and whole: an interruption can come at any time."""
        whole = len({len(values) for values in self.rows.values()}) == 1
        return whole and self.rows["time"][-1:] == [state.time]

    def add(self, state: State, iterations: int, cuts: int, residual: float) -> None:
        """The row of a converged step."""
        joint, law, interface = self.joint, self.joint.law, self.joint.interface
        at_points = interface.jumps(interface.at_points, state.jump)
        traction, _ = law.respond(at_points, state.memory)
        weights = interface.points.weights / joint.bulk.width
        frames = interface.frames[interface.points.elements]
        along_axes = np.einsum("qk,qkc->qc", traction, frames)
        N, T, M = interface.chord.resultants(weights, interface.points.positions, along_axes)
        pressure = state.pressure
        lifted = interface.surface.normals[interface.water_points.elements]
        uplift = interface.water_points.weights * pressure.water_points / joint.bulk.width
        row = {
            "time": state.time,
            "level": state.loading.level,
            "tail_level": state.loading.tail,
            "iterations": iterations,
            "cuts": cuts,
            "residual": residual,
            "crack_length": weights @ law.open(at_points, state.memory),
            "process_zone": weights @ law.in_process_zone(at_points, state.memory),
            "slip_length": weights @ law.slid(at_points, state.memory),
            "max_opening": interface.jumps(interface.at_nodes, state.jump)[:, 0].max(),
            "crest_ux": self.crest(state),
            "N": N,
            "T": T,
            "M": M,
            "U": uplift @ lifted[:, :2] @ interface.chord.normal,
            "flux": pressure.leakage,
            "heel": interface.heel @ state.jump,
        }
        for name, value in row.items():
            self.rows[name].append(float(value))

    def crest(self, state: State) -> float:
        """The crest's movement along x [m]."""
        start = self.at_rest and self.joint.crest(self.at_rest.jump, self.at_rest.loading)
        return self.joint.crest(state.jump, state.loading) - (start or 0.0)

    def save(self, state: State) -> None:
        """The joint at the state last added, node by node; and with jump and stress made from
        element means.
        """
        joint, law, interface = self.joint, self.joint.law, self.joint.interface
        place, corners = interface.space.locations, len(interface.surface.points)
        pressure = state.pressure
        jump = interface.jumps(interface.at_nodes, state.jump)
        traction, _ = law.respond(jump, state.nodes)
        seen = interface.mean_at_nodes(
            np.column_stack(
                [
                    jump,
                    traction,
                    law.damage(jump, state.nodes),
                    np.linalg.norm(state.nodes.vector, axis=1),
                ]
            )
        )
        seen[:, 3] -= pressure.nodes
        columns = [
            np.full((len(place), 2), (state.time, state.loading.level)),
            place,
            seen[:, :6],
            pressure.nodes[:, None],
            seen[:, 6:],
            interface.xi[:, None] * interface.length,
        ]
        if "lambda" in joint_columns(joint.case):
            columns.append(interface.mean_at_nodes(state.nodes.scalar)[:, None])
        if pressure.flux is not None:
            columns.append(self.node_means(pressure.flux[:, None], True))
        table = np.hstack(columns)
        at_points = interface.jumps(interface.at_points, state.jump)
        stress, _ = law.respond(at_points, state.memory)
        stress[:, 0] -= pressure.points
        weights, elements = interface.points.weights, interface.points.elements
        total = np.bincount(elements, weights)
        parts = (*at_points.T, *stress.T)
        means = np.column_stack([np.bincount(elements, weights * v) / total for v in parts])
        extra = table.copy()
        extra[:corners, 5:11] = self.node_means(means, False)
        self.saved.append(state)
        self.tables.append((table, extra))

    def node_means(self, values: np.ndarray, middles: bool) -> np.ndarray:
        """Mean over the joint elements around each node (and each middle of an edge) of element
        values (e, m).
        """
        space = self.joint.interface.space
        number = len(space.locations) if middles else len(space.body.points)
        total, count, start = np.zeros((number, values.shape[1])), np.zeros(number), 0
        for (_, whole), (_, cells) in zip(space.connectivity, space.body.cells, strict=True):
            table = whole if middles else cells
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
