"""Results of a run as arrays: the tables of the joint and of the history, with their columns."""

from __future__ import annotations

import functools
import operator
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias, TypedDict

import numpy as np

from .. import ROUND_OFF
from ..arrays import Array, Table
from ..input.case import Case
from ..input.values import has_point, level_unknown

#: Columns of joint.csv: a row per joint node and requested level.
JOINT = {
    "time": ("-", "t of the requested level"),
    "level": ("m", "reservoir level above the base (y = 0)"),
    "joint": ("-", "number of the joint, from the lowest"),
    "x": ("m", "coordinate of the node, downstream"),
    "y": ("m", "coordinate of the node, upwards from the base's heel"),
    "z": ("m", "coordinate of the node along the dam axis, 3D"),
    "delta_n": ("m", "normal jump, opening > 0"),
    "delta_t1": ("m", "tangential jump along x, dam moving downstream > 0"),
    "delta_t2": ("m", "tangential jump along z"),
    "sigma_n": ("Pa", "total normal stress, water included, compression < 0"),
    "tau_1": ("Pa", "shear stress along x, with the sign of the slip that it causes"),
    "tau_2": ("Pa", "shear stress along z"),
    "p": ("Pa", "water pressure in the joint"),
    "damage": ("-", "progress of the softening, 1 broken (endo: alpha); friction: 1 where open"),
    "slip": ("m", "plastic slip; rupture: tangential jump where K_t was last zero"),
    "s": ("m", "distance from the heel along the joint"),
    "sigma_n_eff": ("Pa", "effective normal stress, sigma_n + p"),
}
#: Additional column where water flows.
FLUX = {"flux": ("kg/(m s)", "mass flux towards the toe, mean of the elements around the node")}
#: Further columns of flow in time.
FILM = {
    "void_fraction": ("-", "part of the aperture that is not filled with water"),
    "Re": ("-", "Reynolds number of the flow, 2 flux / visc"),
    "water_mass": ("kg/m2", "mass of the water in the joint, per area, with its compression"),
}

#: Additional column where the joint is grouted or sawn.
THICKNESS = {"joint_thickness": ("m", "thickness that grout adds and the saw takes off (< 0)")}

#: Columns of steps.csv: a row per node and per integration point of every update of the internal
#: variables, in their order.
STEPS = {
    "update": ("-", "number of the update"),
    "begin": ("-", "t at which its step began; in an earthquake [s]"),
    "time": ("-", "t of the step; in an earthquake [s]"),
    "level": JOINT["level"],
    "tail_level": ("m", "tailwater level above the base"),
    "frozen": ("-", "1: by the law with frozen damage, in unstable crack growth"),
    "earthquake": ("-", "1: a time step of an earthquake"),
    "joint": JOINT["joint"],
    "weight": ("m", "length of joint that an integration point stands for; 0: a node"),
    **{name: JOINT[name] for name in ("x", "y", "z", "delta_n", "delta_t1", "delta_t2")},
    **{name: JOINT[name] for name in ("sigma_n_eff", "tau_1", "tau_2", "p", "damage", "slip")},
}

#: Columns of history.csv: a row per converged step. Forces are per metre of thickness, in 3D too.
HISTORY = {
    "time": ("-", "t of the step"),
    "level": ("m", "reservoir level above the base (y = 0)"),
    "load_factor": (
        "-",
        "ratio of the level to that scheduled for this t; with drive_load the factor of that load",
    ),
    "iterations": ("-", "Newton iterations of the step"),
    "cuts": ("-", "how often the step was shortened: not converged, or pressure moved too far"),
    "residual": (
        "-",
        "norm of the out-of-balance forces over that of the loads at the highest water",
    ),
    "crack_length": ("m", "length of joint that is broken and open (rupture: that is broken)"),
    "process_zone": ("m", "length of softening joint: damaged and not broken; friction: 0"),
    "slip_length": ("m", "length of joint with released shear (rupture) or slip (other laws)"),
    "max_opening": ("m", "largest opening of a node"),
    "crest_ux": ("m", "displacement of the upstream edge of the crest along x"),
    "N": ("N/m", "effective normal force on the joint, compression > 0"),
    "T": ("N/m", "shear force on the joint, downstream > 0"),
    "M": ("N m/m", "moment of N about the toe, stabilising > 0"),
    "flux": ("kg/(m s)", "leakage: mass flux out of the toe"),
    "tail_level": ("m", "tailwater level above the base"),
    "U": ("N/m", "uplift: resultant of the water pressure in the joint"),
    "x_resultant": ("m", "position of N on the joint, from the heel"),
    "M_U": ("N m/m", "moment of U about the toe, lifting > 0"),
    "broken_length": ("m", "length of joint that is broken: D = 1; endo: D > 0.72; friction: open"),
    "bonded_length": ("m", "length of joint, weighted with the part of the cohesion that is left"),
}
#: Additional column in 3D.
LATERAL = {"T_z": ("N/m", "force on the joint along z, of the effective stress, 3D")}
#: Additional column with drive = point, dissipation.
OF_POINT = {"point_u": ("m", "displacement of the controlled point along drive_direction")}
#: Additional columns of flow in time. Volumes are per metre of thickness, in 3D too.
IN_TIME = {
    "water": ("m2", "water stored in the joint, per metre of thickness, with its compression"),
    "water_in": ("m2", "water that has come in by heel, toe and drains since the flow has a time"),
    "void": ("m2", "part of the joint's aperture that is not filled with water"),
    "p_max": ("Pa", "highest water pressure at a node of the joint"),
    "p_min": ("Pa", "lowest water pressure at a node of the joint"),
    "Re": ("-", "largest Reynolds number of the flow, 2 flux / visc; laminar up to about 2000"),
}
#: Those of a joint. With several joints: of the first one; of joint 2, 3, ... by `column_of`.
HISTORY_OF_JOINTS = (
    *("crack_length", "process_zone", "slip_length", "max_opening"),
    *("N", "T", "M", "flux", "U", "x_resultant", "M_U", "broken_length", "bonded_length", "T_z"),
    *IN_TIME,
)

#: Unit and meaning of columns by name.
Columns: TypeAlias = dict[str, tuple[str, str]]


def column_of(name: str, joint: int) -> str:
    """A column of history.csv of a joint, by its number from 0: N, N_2, N_3, ..."""
    return f"{name}_{joint + 1}" if joint else name


def row_of_joint(row: dict[str, float], joint: int) -> dict[str, float]:
    """A row of history.csv with the columns of a joint, by its number from 0, without suffix."""
    names = {name: column_of(name, joint) for name in HISTORY_OF_JOINTS}
    return row | {name: row[column] for name, column in names.items() if column in row}


def with_all_joints(
    columns: Columns, case: Case, of_joints: Collection[str] = HISTORY_OF_JOINTS
) -> Columns:
    """Columns of the first joint's table, then those of each joint that `of_joints` names."""
    others = {
        column_of(name, k): (columns[name][0], f"{joint}: {columns[name][1]}")
        for k, joint in enumerate(case.joint_names)
        if k
        for name in of_joints
        if name in columns
    }
    return columns | others


def of_control(case: Case) -> list[str]:
    """The columns of a case's history that displacement control determines."""
    factor = case["drive"] != "level" and not level_unknown(case)
    return ["load_factor"] * factor + list(OF_POINT) * has_point(case)


def history_columns(case: Case) -> Columns:
    """The columns of a case's history.csv: unit and meaning."""
    further = LATERAL if case["dim"] == 3 else {}
    in_time = IN_TIME if case.stores_water else {}
    of_point = {n: column for n, column in OF_POINT.items() if n in of_control(case)}
    return with_all_joints(HISTORY | further | in_time | of_point, case)


#: Columns of quake.csv: unit and meaning. Displacements are relative to the ground.
QUAKE = {
    "time": ("s", "time from the start of the computation"),
    "ground_ax": ("m/s2", "acceleration of the ground, downstream > 0"),
    "ground_ay": ("m/s2", "acceleration of the ground, upwards > 0"),
    "crest_ux": ("m", "displacement of the crest along x since the static state"),
    "crest_ax": ("m/s2", "absolute acceleration of the crest along x"),
    "heel_opening": ("m", "opening of the joint at the heel"),
    "toe_opening": ("m", "opening of the joint at the toe"),
    "slip_mean": ("m", "mean tangential jump since the static state, downstream > 0"),
    "slip_heel": ("m", "the same at the heel"),
    "slip_toe": ("m", "the same at the toe"),
    "N": ("N/m", "effective normal force on the joint, compression > 0"),
    "T": ("N/m", "shear force on the joint, downstream > 0"),
    "M": ("N m/m", "moment of N about the toe, stabilising > 0"),
    "U": ("N/m", "uplift: resultant of the water pressure in the joint"),
    "T_inertia": ("N/m", "part of T: inertia of all that is above the joint, with its water"),
    "N_inertia": ("N/m", "the same part of N"),
    "M_inertia": ("N m/m", "the same part of M"),
    "shear_reserve": ("N/m", "largest shear force that the joint transmits, mu N + c L, minus |T|"),
    "open_length": HISTORY["crack_length"],
    "broken_length": HISTORY["broken_length"],
    "iterations": ("-", "Newton iterations of the step"),
    "dt": ("s", "length of the step"),
    "residual": ("-", "norm of the out-of-balance forces over that of the static loads"),
}
#: Those of a joint. With several joints: of the first one; of joint 2, 3, ... by `column_of`.
QUAKE_OF_JOINTS = (
    *("heel_opening", "toe_opening", "slip_mean", "slip_heel", "slip_toe"),
    *("N", "T", "M", "U", "T_inertia", "N_inertia", "M_inertia", "shear_reserve"),
    *("open_length", "broken_length"),
    *IN_TIME,
)
#: Columns of modes.csv: a row per natural mode, with each water on each rock.
MODES = {
    "rock": ("", "massless: elastic, without mass; or rigid"),
    "water": ("", "reservoir: its added mass at the last level; or none"),
    "mode": ("-", "number of the mode, from the lowest"),
    "frequency": ("Hz", "natural frequency, undamped, joints closed and undamaged"),
    "period": ("s", "its inverse"),
    "mass_x": ("-", "effective modal mass along x over the mass that moves along x"),
    "mass_y": ("-", "the same along y; in 3D, modes along z have neither"),
    "damping": ("-", "damping ratio by the Rayleigh damping of an earthquake of this row"),
}


def quake_columns(case: Case) -> Columns:
    """The columns of a case's quake.csv: unit and meaning."""
    in_time = IN_TIME if case["quake_uplift"] == "transient" else {}
    return with_all_joints(QUAKE | in_time, case, QUAKE_OF_JOINTS)


class Info(TypedDict, total=False):
    """About the run itself, entries of run.json; all others are those of `folder.write_info`."""

    #: the mechanism at the end of a path, see `Mechanism`
    mechanism: dict[str, Any]
    #: whether the weight alone has not converged, and acts with the first level
    weight_with_water: bool
    #: level of each limit point, and the lowest one after it [m]
    limit_points: Sequence[tuple[float, float]]
    #: levels of unstable crack growth [m]
    unstable_growth: Sequence[float]
    #: levels [m] before and after each step in which a joint breaks at once
    broken_at_once: Sequence[tuple[float, float]]
    #: levels [m] before and after each step of which a half leads to no equilibrium
    passed_over: Sequence[tuple[float, float]]
    #: time [-] of the largest change of the water pressure beyond that of the levels, and this [Pa]
    pressure_moves: tuple[float, float]
    #: how the last solution ended without an equilibrium
    end_of_solution: str
    #: times of the steps that rounding keeps from the tolerance
    converged_by_round_off: Sequence[float]
    engine: str
    factorisation: str
    mesh: dict[str, Any]
    unknowns: int | None
    #: [s] by part of the work
    wall_seconds: dict[str, Any]
    #: of --accuracy; of critical, calibrate, quake and --sensitivity
    error_estimate: dict[str, Any]
    critical: dict[str, Any]
    calibration: dict[str, Any]
    quake: dict[str, Any]
    sensitivity: dict[str, Any]
    #: whether the fields are those of the frames of an earthquake
    frames: bool
    notes: Sequence[str]
    key: str
    #: version and memory of GetDP
    getdp: dict[str, Any]
    peak_memory_mb: float
    versions: dict[str, str]
    commit: str
    machine: str
    #: of stored results
    state: str
    verdict: str
    statement: str
    hints: list[str]


@dataclass
class Results:
    """The results of a run: tables as {column: array}. With several joints, each of `joints` are
    the results of a single one.
    """

    case: Case
    #: a row per converged step, columns HISTORY
    history: Table
    #: a row per joint node and requested level, columns `joint_columns`
    joint: Table
    #: the same rows with jumps and stresses extrapolated from the Gauss points of each element, as
    #: published codes print them
    extrapolated: Table
    #: whether the run ended before its last level
    stopped: bool = False
    #: opening of the heel of the first joint [m] at each row of history
    heel: Array = field(default_factory=lambda: np.zeros(0))
    #: of a case with `all_steps`: its updates of the internal variables, see `step_columns`
    steps: Table | None = None
    info: Info = field(default_factory=lambda: Info())

    @property
    def joints(self) -> list[Results]:
        """The results of each joint, with its own case, rows, and columns of the history."""
        cases = self.case.joints
        return [self.of_joint(k) for k in range(len(cases))] if len(cases) > 1 else [self]

    def of_joint(self, number: int) -> Results:
        """The results of a joint, by its number from 0."""
        case = self.case.joints[number]
        history = {
            n: self.history[column_of(n, number) if n in HISTORY_OF_JOINTS else n]
            for n in history_columns(case)
        }
        return replace(
            self,
            case=case,
            history=history,
            joint=joint_rows(self.joint, number, joint_columns(case)),
            extrapolated=joint_rows(self.extrapolated, number, joint_columns(case)),
            heel=self.heel if number == 0 else np.zeros(0),
        )

    def at(self, time: float | None = None) -> Table:
        """The rows of the joints at a requested time (default: the last), from heel to toe."""
        return rows_at(self.joint, time)

    def at_extrapolated(self, time: float | None = None) -> Table:
        """As `at`, with jump and stress extrapolated from the Gauss points."""
        return rows_at(self.extrapolated, time)

    def state(self, time: float) -> dict[str, float]:
        """The row of the history nearest to a time."""
        row = np.argmin(np.abs(self.history["time"] - time))
        return {name: float(column[row]) for name, column in self.history.items()}

    @property
    def last(self) -> dict[str, float]:
        """The last row of the history; empty before the first step."""
        return {name: float(column[-1]) for name, column in self.history.items() if len(column)}

    @property
    def partial_load(self) -> bool:
        """Whether the last state is before all loads act; False with displacement control."""
        time = self.last.get("time", 0.0)
        return self.case["drive"] == "level" and time < self.case.times[-1] - ROUND_OFF


def joint_rows(table: Table, number: int, columns: Collection[str]) -> Table:
    """The rows and columns of a joint, by its number from 0."""
    if not table:
        return table
    rows = table["joint"] == number + 1
    return {name: table[name][rows] for name in columns}


def rows_at(table: Table, time: float | None = None) -> Table:
    """The rows of one time (default: the last), by joint, from heel to toe, then by z, y, x."""
    time = table["time"].max() if time is None else time
    rows = np.flatnonzero(np.isclose(table["time"], time))
    scale = np.abs(table["s"]).max() or 1.0
    x, y, z, s = (np.round(table[n][rows] / scale, 9) for n in "xyzs")
    rows = rows[np.lexsort((x, y, z, s, table["joint"][rows]))]
    return {name: column[rows] for name, column in table.items()}


def joint_columns(case: Case) -> Columns:
    """The columns of a case's joint.csv: unit and meaning."""
    of_laws = [dict(joint.law.columns) for joint in case.joints]
    flow = FLUX if any(joint["uplift"] == "flow" for joint in case.joints) else {}
    worked = any(joint["grout_pressure"] or joint["saw_thickness"] for joint in case.joints)
    works = THICKNESS if worked else {}
    film = FILM if case.stores_water else {}
    return functools.reduce(operator.or_, [JOINT, *of_laws, flow, film, works])


def step_columns(case: Case) -> Columns:
    """The columns of a case's steps.csv: unit and meaning."""
    further = {
        n: column for n, column in joint_columns(case).items() if n not in JOINT | FLUX | FILM
    }
    return STEPS | further


def joint_table(case: Case, blocks: list[Array]) -> Table:
    """The joints' table from blocks of rows, one per requested time, whose columns are those of the
    table but for sigma_n_eff.

    Adds sigma_n_eff and sorts each block as `rows_at`.
    """
    columns = joint_columns(case)
    names = [name for name in columns if name != "sigma_n_eff"]
    rows = np.vstack(blocks) if blocks else np.zeros((0, len(names)))
    table = dict(zip(names, rows.T, strict=True))
    table["sigma_n_eff"] = table["sigma_n"] + table["p"]
    table = {name: table[name] for name in columns}
    times = list(dict.fromkeys(table["time"]))
    parts = [rows_at(table, time) for time in times]
    return {
        name: np.concatenate([p[name] for p in parts]) if parts else table[name] for name in table
    }


def history_table(case: Case, rows: Table) -> Table:
    """The history from an engine's output at each step; adds load_factor and x_resultant."""
    scheduled = np.array([case.level_at(time) for time in rows["time"]])
    factor = np.divide(rows["level"], scheduled, out=np.ones_like(scheduled), where=scheduled > 0)
    rows = {"load_factor": factor} | rows
    for k, joint in enumerate(case.joints):
        N, M = (rows[column_of(name, k)] for name in "NM")
        # where M = N (length - x)
        arm = np.divide(M, N, out=np.full_like(scheduled, np.nan), where=N > 0)
        rows |= {column_of("x_resultant", k): joint.joint_length - arm}
    return {name: rows[name] for name in history_columns(case)}
