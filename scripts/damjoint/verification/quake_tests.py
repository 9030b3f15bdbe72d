"""Published tests of the time integration: a dam through the first steps of a record.

Each function is a family: the tests by the names that the column `modeling` of
reference/FAMILY.csv has.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import ROUND_OFF, data
from ..arrays import Array, Values
from ..dynamics.stepper import Earthquake
from ..input.case import Case
from ..input.resolve import load
from ..studies.quake import QuakeRun


@dataclass(frozen=True)
class QuakeTest:
    """A case with its settings and water levels [m], under the record friuli.csv."""

    case: str
    settings: Values
    levels: str

    def load(self) -> Case:
        """The case."""
        record = data("reference") / "friuli.csv"
        return load(self.case, self.settings, self.levels, record=record)


def follow(test: QuakeTest, duration: float) -> dict[str, Array]:
    """Columns, as of `columns`, of a test up to a time of its record [s]. Raises RunError."""
    under_way = QuakeRun(test.load())
    quake = under_way.quake
    static = under_way.static_fields()[quake.case.times[-1]].displacement["dam"]
    # times count from the record's first value, before which there is a row of zeros
    return columns(quake, static, quake.record.times[1], duration)


def columns(quake: Earthquake, static: Array, start: float, duration: float) -> dict[str, Array]:
    """Columns, a row per step: t since a start [s]; crest_ax, heel_ax, absolute accelerations along
    x [m/s2], and crest_uy, heel_uy, vertical displacements [m], of the dam's upstream edges.

    static: displacement of the dam's nodes (n, 3) under the static loads. Raises RunError.
    """
    dim, points = int(quake.case["dim"]), quake.system.spaces["dam"].body.points
    positions = {"crest": np.array([0, quake.case["dam_height"], 0]), "heel": np.zeros(3)}
    nodes = {name: np.abs(points - at).sum(axis=1).argmin() for name, at in positions.items()}
    moved, rows = quake.system.motion["dam"], []
    for step in quake.steps():
        time, motion = step.end.time - start, step.end.motion
        displacement, acceleration = moved @ motion.displacement, moved @ motion.acceleration
        row = {"t": time}
        for name, node in nodes.items():
            row[f"{name}_ax"] = acceleration[dim * node] + step.ground[0]
            row[f"{name}_uy"] = displacement[dim * node + 1] + static[node, 1]
        rows.append(row)
        if time > duration - ROUND_OFF:
            break
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def sdnv138() -> dict[str, QuakeTest]:
    """The dam of SSNP142 C (B), of J (C), of J with a dry joint (D) from 3.01 s of the record on,
    on their meshes and by the published conventions.
    """
    shared: Values = {
        "damping": 0.0,
        "added_mass": 0.0,
        "record_unit": "m/s2",
        "record_start": 3.01,
        "record_rest": 0.0,
        "joint_damping_n": 1e9,
        "joint_damping_t": 2e9,
        "time_integration": "published",
    }
    levels = "2.9,5.9,7.9,8.4,8.9"
    return {
        "B": QuakeTest("c_file", {**shared, "dt": 0.005}, levels),
        "C": QuakeTest("j_file", {**shared, "dt": 0.01}, levels),
        "D": QuakeTest("j_file", {**shared, "dt": 0.01, "uplift": "none"}, levels),
    }


FAMILIES = {"sdnv138": sdnv138}
