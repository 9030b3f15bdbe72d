"""Results of a run as tables: joint.csv, history.csv, curve.csv."""

from __future__ import annotations

import csv
from dataclasses import dataclass, field
from pathlib import Path
from typing import TextIO

import numpy as np

from ..scene.case import Case
from ..storage import whole

#: Columns of joint.csv: a row per joint node and requested level.
JOINT = {
    "time": ("-", "t of the requested level"),
    "level": ("m", "reservoir level above the base (y = 0)"),
    "x": ("m", "place of the node: downstream"),
    "y": ("m", "place of the node: height"),
    "z": ("m", "place of the node: across, 3D"),
    "delta_n": ("m", "normal jump, opening > 0"),
    "delta_t1": ("m", "tangential jump along x, dam moving downstream > 0"),
    "delta_t2": ("m", "tangential jump along z"),
    "sigma_n": ("Pa", "total normal stress, water included, compression < 0"),
    "tau_1": ("Pa", "shear stress along x, of the sign of the slip it causes"),
    "tau_2": ("Pa", "shear stress along z"),
    "p": ("Pa", "water pressure in the joint"),
    "damage": ("-", "rupture, bond: used part of the softening, 1 broken; friction: 1 where open"),
    "slip": (
        "m",
        "rupture: tangential jump at the last free slide; else: plastic slip",
    ),
    "s": ("m", "distance from the heel along the joint"),
    "sigma_n_eff": ("Pa", "effective normal stress, sigma_n + p"),
}
#: One more where friction hardens with it.
HARDENING = {"lambda": ("m", "friction: cumulated plastic slip, which hardens")}
#: One more where water flows.
FLUX = {"flux": ("kg/(m s)", "mass flux towards the toe, mean of the elements around the node")}

#: Columns of history.csv: a row per converged step. Forces are per metre of thickness, in 3D too.
HISTORY = {
    "time": ("-", "t of the step"),
    "level": ("m", "reservoir level above the base (y = 0)"),
    "load_factor": ("-", "level over the level prescribed for this t"),
    "iterations": ("-", "Newton iterations of the step"),
    "cuts": ("-", "how often the step was shortened"),
    "residual": ("-", "remaining out-of-balance force over that of the highest water"),
    "crack_length": ("m", "broken (rupture) or open (friction, bond) joint"),
    "process_zone": ("m", "softening joint (rupture, bond): 0 < damage < 1, not open; friction: 0"),
    "slip_length": ("m", "released (rupture) or slipped (friction, bond) joint"),
    "max_opening": ("m", "largest opening of a node"),
    "crest_ux": ("m", "displacement of the upstream end of the crest along x"),
    "N": ("N/m", "effective normal force on the joint, compression > 0"),
    "T": ("N/m", "shear force on the joint, downstream > 0"),
    "M": ("N m/m", "moment of N about the toe, holding the dam down > 0"),
    "flux": ("kg/(m s)", "leakage: mass flux out of the toe"),
    "tail_level": ("m", "tailwater level above the base"),
    "U": ("N/m", "uplift: resultant of the water pressure in the joint"),
    "x_resultant": ("m", "where N meets the joint, from the heel"),
}

#: Columns of critical.csv: a row per equilibrium of each dam that was tried.
CRITICAL = {
    "trial": ("-", "number of the dam that was tried"),
    "value": ("", "what was varied: level [m], strength, or the parameter"),
    "stands": ("-", "1: there is an equilibrium with this value, 0: none was found"),
    "driven": ("-", "0: the level was prescribed, 1: a displacement, and the level found"),
    **{n: HISTORY[n] for n in ("level", "crest_ux", "crack_length", "slip_length", "N", "T", "M")},
    "pushed": ("m", "how far the dam was pushed where a displacement was prescribed"),
    "compression": ("Pa", "total compression at the toe"),
}

#: Columns of gravity.csv: a row per load on the body above the joint, and their sum.
LOADS = {
    "load": ("", "what acts"),
    "Fx": ("N/m", "horizontal force, downstream > 0"),
    "Fy": ("N/m", "vertical force, upwards > 0"),
    "moment": ("N m/m", "about the joint's toe, holding the dam down > 0"),
}

#: Columns of check.csv: a row per scene and answer at the last level, and one of differences.
CHECK = {
    "case": ("", "name of the case"),
    "answer": (
        "",
        "finite elements, gravity method (also with a longer crack), difference of the first two",
    ),
    "uplift": ("", "water in the joint"),
    "load": ("", "full; partial: the run stopped before its last t, where all loads are there"),
    "time": HISTORY["time"],
    **{name: HISTORY[name] for name in ("level", "tail_level", "N", "T", "M", "U", "x_resultant")},
    "sigma_n_heel": ("Pa", "total normal stress at the heel, compression < 0"),
    "sigma_n_toe": ("Pa", "total normal stress at the toe, compression < 0"),
    "sigma_n_eff_heel": ("Pa", "effective normal stress at the heel, compression < 0; 0: cracked"),
    "sigma_n_eff_toe": ("Pa", "effective normal stress at the toe, compression < 0"),
    "crack_length": HISTORY["crack_length"],
    "SSF": ("-", "sliding: (mu N + adhesion (length - crack_length)) / T"),
    "OSF": ("-", "overturning: stabilising over overturning moments about the toe"),
    "position": ("", "where N meets the joint: middle third, middle half, within base, outside"),
    "required_SSF": ("-", "what the case requires; 0: nothing"),
    "required_OSF": ("-", "what the case requires; 0: nothing"),
    "f_c": ("Pa", "compressive strength at the toe; 0: not checked"),
    "verdict": ("", "pass or fail; not checked: nothing fails, and nothing is required"),
    "why": ("", "why it fails"),
}


@dataclass
class Results:
    """What a run has found: tables as {column: array}."""

    case: Case
    #: a row per converged step, columns HISTORY
    history: dict[str, np.ndarray]
    #: a row per joint node and requested level, columns `joint_columns`
    joint: dict[str, np.ndarray]
    #: the same rows with jumps and stresses extrapolated from element means, as published codes
    #: print them
    extrapolated: dict[str, np.ndarray]
    #: whether the run ended before its last level
    stopped: bool = False
    #: opening of the heel [m] at each row of history
    heel: np.ndarray = field(default_factory=lambda: np.zeros(0))
    #: what run.json says of the run itself: engine, sizes, versions, seconds
    info: dict = field(default_factory=dict)

    def at(self, time: float | None = None) -> dict[str, np.ndarray]:
        """The joint rows of a requested time, the last one by default, from heel to toe."""
        return rows_at(self.joint, time)

    def at_extrapolated(self, time: float | None = None) -> dict[str, np.ndarray]:
        """As `at`, with jump and stress extrapolated from the integration points."""
        return rows_at(self.extrapolated, time)

    def state(self, time: float) -> dict[str, float]:
        """The row of the history at a time, or next to it."""
        row = np.argmin(np.abs(self.history["time"] - time))
        return {name: float(column[row]) for name, column in self.history.items()}

    @property
    def last(self) -> dict[str, float]:
        """The last row of the history; empty before the first step."""
        return {name: float(column[-1]) for name, column in self.history.items() if len(column)}

    @property
    def partial_load(self) -> bool:
        """Whether the last state is short of the case's last time, at which levels and loads are
        those asked for; a prescribed displacement asks for none.
        """
        time = self.last.get("time", 0.0)
        return self.case["drive"] == "level" and time < self.case.times[-1] - 1e-9


def rows_at(table: dict[str, np.ndarray], time: float | None = None) -> dict[str, np.ndarray]:
    """The rows of one time (the last one by default), sorted from heel to toe, then by z."""
    time = table["time"].max() if time is None else time
    rows = np.flatnonzero(np.isclose(table["time"], time))
    s, z = (np.round(table[n][rows] / (np.abs(table["s"]).max() or 1.0), 9) for n in "sz")
    rows = rows[np.lexsort((z, s))]
    return {name: column[rows] for name, column in table.items()}


def joint_columns(case: Case) -> dict[str, tuple[str, str]]:
    """The columns of a case's joint.csv: unit and meaning."""
    hardening, flux = case["law"] == "friction", case["uplift"] == "flow"
    return JOINT | (HARDENING if hardening else {}) | (FLUX if flux else {})


def joint_table(case: Case, blocks: list[np.ndarray]) -> dict[str, np.ndarray]:
    """The joint's table from blocks of rows, one per requested time: its columns in their order,
    but for sigma_n_eff.

    Adds that one and sorts each block from heel to toe, then by z.
    """
    columns = joint_columns(case)
    given = [name for name in columns if name != "sigma_n_eff"]
    rows = np.vstack(blocks) if blocks else np.zeros((0, len(given)))
    table = dict(zip(given, rows.T, strict=True))
    table["sigma_n_eff"] = table["sigma_n"] + table["p"]
    table = {name: table[name] for name in columns}
    times = list(dict.fromkeys(table["time"]))
    parts = [rows_at(table, time) for time in times]
    return {
        name: np.concatenate([p[name] for p in parts]) if parts else table[name] for name in table
    }


def history_table(case: Case, rows: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The history from what an engine has found at each step; load_factor and x_resultant are made
    here.
    """
    scheduled = np.array([case.level_at(time) for time in rows["time"]])
    factor = np.divide(rows["level"], scheduled, out=np.ones_like(scheduled), where=scheduled > 0)
    # where M = N (length - x)
    arm = np.divide(rows["M"], rows["N"], out=np.full_like(scheduled, np.nan), where=rows["N"] > 0)
    rows = rows | {"load_factor": factor, "x_resultant": case.joint_length - arm}
    return {name: rows[name] for name in HISTORY}


def as_text(cell: str) -> str:
    """A cell of a table that a spreadsheet shows and does not compute: a text that begins as a
    formula does gets an apostrophe before it, a number none.
    """
    try:
        float(cell)
    except ValueError:
        return "'" + cell if cell[:1] in tuple("=+-@\t\r") else cell
    return cell


def write_csv(target: Path | TextIO, table: dict[str, np.ndarray | list]) -> None:
    """Write a table with its column names to a path or an open file; numbers with twelve digits,
    texts so that no spreadsheet takes them for a formula.
    """
    if isinstance(target, Path):
        with whole(target) as path, path.open("w", newline="") as file:
            write_csv(file, table)
        return
    writer = csv.writer(target, lineterminator="\n")
    writer.writerow(table)
    rows = zip(*table.values(), strict=True)
    writer.writerows(
        [as_text(v) if isinstance(v, str) else f"{v:.12g}" for v in row] for row in rows
    )


def write(results: Results, folder: Path) -> None:
    """Write joint.csv and history.csv into a folder; curve.csv (load against opening) of a driven
    case.
    """
    case, history = results.case, results.history
    joint = dict(results.joint)
    for axis in "xyz":  # the mesh generator's last digits
        joint[axis] = np.round(joint[axis], 9) + 0.0
    write_csv(folder / "joint.csv", joint)
    write_csv(folder / "history.csv", history)
    if case["drive"] != "level":
        pressure = case["rho_water"] * case["g"] * history["level"]
        curve = {
            "time": history["time"],
            "level": history["level"],
            "pressure": pressure,
            "heel_opening": results.heel,
            "crest_ux": history["crest_ux"],
        }
        write_csv(folder / "curve.csv", curve)
