"""What is recorded of an earthquake: a row per time step, and the stress along the joints."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import Array, Table
from ..model.results import IN_TIME, column_of, quake_columns
from ..solver.history import JointState
from .frames import Frames
from .step import Moving
from .stepper import Converged, Earthquake


def row_of_joint(at: JointState, before: JointState) -> dict[str, float]:
    """QUAKE_OF_JOINTS of a joint at a state; before: at the static one."""
    joint, law, row = at.joint, at.law, at.row
    (heel, toe), (heel_before, toe_before) = at.ends, before.ends
    jump, variables, weights = at.jump, at.variables, joint.points.weights
    damage, slip = law.damage(jump, variables), law.slip(variables, len(jump))
    strength = weights @ law.shear_strength(at.traction[:, 0], damage, slip) / joint.width
    return {
        "heel_opening": heel[0],
        "toe_opening": toe[0],
        "slip_mean": weights @ (jump - before.jump)[:, 1] / weights.sum(),
        "slip_heel": heel[1] - heel_before[1],
        "slip_toe": toe[1] - toe_before[1],
        **{name: row[name] for name in ("N", "T", "M", "U")},
        "shear_reserve": strength - abs(row["T"]),
        "open_length": row["crack_length"],
        "broken_length": row["broken_length"],
        **{name: row[name] for name in IN_TIME if name in row},
    }


#: States whose displacement is stored: column of quake.csv and sign.
PEAK_STATES = {
    "crest downstream": ("crest_ux", 1),
    "crest upstream": ("crest_ux", -1),
    "heel open": ("heel_opening", 1),
    "toe open": ("toe_opening", 1),
}


@dataclass(frozen=True)
class Peak:
    """A state in which a quantity is largest."""

    value: float
    time: float
    #: displacement of `Problem.retained` since the static state (k,)
    displacement: Array


@dataclass
class QuakeHistory:
    """Rows and frames of an earthquake so far."""

    #: columns of quake.csv
    rows: dict[str, list[float]]
    frames: Frames
    #: see `System.resultants`, of each joint, from the acceleration of `Problem.retained`
    inertia: list[Array]
    #: the joints in the static state
    before: list[JointState]
    #: effective normal stress at the first joint's nodes, from heel to toe, of each row [Pa]
    stress: list[Array] = field(default_factory=list)
    #: by PEAK_STATES
    peaks: dict[str, Peak] = field(default_factory=dict)
    #: numbers of complete rows and of their frames, and the state of the last row: an interruption
    #: can come at any time
    complete: tuple[int, int, Moving | None] = (0, 1, None)

    @staticmethod
    def of(quake: Earthquake, span: tuple[float, float] | None = None) -> QuakeHistory:
        """No rows, and the frame of the static state; span: as in `Frames`."""
        equilibrium, graph = quake.problem.model.equilibrium, quake.case.graph
        joints, static = equilibrium.interface.joints, quake.problem.static
        # what follows the retained unknowns has no mass
        retained = np.append(quake.problem.retained, quake.system.size + np.arange(2))
        return QuakeHistory(
            {name: [] for name in quake_columns(quake.case)},
            Frames.of(quake, span),
            [
                quake.system.resultants(joint, graph.separated([k]))[:, retained]
                for k, joint in enumerate(joints)
            ],
            [JointState(equilibrium, static, k) for k in range(len(joints))],
        )

    def __len__(self) -> int:
        return len(self.rows["time"])

    @property
    def table(self) -> Table:
        """The rows by column."""
        return {name: np.array(values) for name, values in self.rows.items()}

    def end_at_complete_row(self, quake: Earthquake) -> None:
        """Remove a row that an interruption has left incomplete, and its step."""
        number, frames, last = self.complete
        self.rows = {name: values[:number] for name, values in self.rows.items()}
        self.stress = self.stress[:number]
        self.frames.cut(frames)
        quake.now = last or quake.problem.at_rest

    def add(self, quake: Earthquake, step: Converged) -> None:
        """The row of a converged step."""
        motion, state, crest = step.end.retained, step.end.state, quake.problem.crest
        row = {
            "time": step.end.time,
            "ground_ax": step.ground[0],
            "ground_ay": step.ground[1],
            "crest_ux": float((crest @ motion.displacement)[0]),
            "crest_ax": float((crest @ motion.acceleration)[0]) + step.ground[0],
            "iterations": step.iterations,
            "dt": step.dt,
            "residual": step.residual,
        }
        joints = [replace(before, state=state) for before in self.before]
        for k, at in enumerate(joints):
            of_joint = row_of_joint(at, self.before[k])
            forces = self.inertia[k] @ np.concatenate([motion.acceleration, step.ground])
            of_joint |= dict(zip(("T_inertia", "N_inertia", "M_inertia"), forces, strict=True))
            row |= {column_of(name, k): value for name, value in of_joint.items()}
        first = joints[0].joint  # its effective normal stress from heel to toe
        stress = first.mean_at_nodes(joints[0].node_traction[:, 0])[np.argsort(first.xi)]
        for name, values in self.rows.items():
            values.append(float(row[name]))
        self.stress.append(stress)
        for name, (column, sign) in PEAK_STATES.items():
            value = sign * float(row[column])
            if name not in self.peaks or value > self.peaks[name].value:
                self.peaks[name] = Peak(value, step.end.time, motion.displacement)
        if self.frames.wanted(step.end.time, quake.record.duration):
            self.frames.add(quake, step.end, step.iterations, step.residual)
        self.complete = len(self.stress), len(self.frames), step.end
