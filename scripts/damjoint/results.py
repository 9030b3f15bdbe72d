"""Results of a run: from the engine's tables to joint.csv, history.csv and run.json."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TextIO

import numpy as np

from .parameters import Case

JOINT = ("time", "level", "x", "y", "z", "delta_n", "delta_t1", "delta_t2", "sigma_n", "tau_1", "tau_2", "p", "damage", "slip")
HISTORY = ("time", "level", "load_factor", "iterations", "cuts", "residual", "crack_length", "slip_length", "max_opening",
           "crest_ux", "N", "T", "M", "flux")


@dataclass
class Results:
    """What a run has found: tables as {column: array}."""

    case: Case
    #: a row per converged step, columns HISTORY
    history: dict[str, np.ndarray]
    #: a row per joint node and requested level, columns JOINT, and flux (mass flux along x) where water flows
    joint: dict[str, np.ndarray]
    #: the same rows with delta_* and the stresses extrapolated from element means, as published codes print them
    extrapolated: dict[str, np.ndarray]
    #: empty, or why the run stopped and at which level
    stopped: str = ""
    #: opening of the heel [m] at each row of history
    heel: np.ndarray = field(default_factory=lambda: np.zeros(0))
    #: condensed engine: (time, jump unknowns, level, tailwater) of the requested times
    states: list = field(default_factory=list)
    info: dict = field(default_factory=dict)

    def at(self, time: float | None = None) -> dict[str, np.ndarray]:
        """The joint rows of a requested time, the last one by default, sorted by x and z."""
        return rows_at(self.joint, time)

    def at_extrapolated(self, time: float | None = None) -> dict[str, np.ndarray]:
        """As `at`, with jump and stress extrapolated from the integration points."""
        return rows_at(self.extrapolated, time)


def rows_at(table: dict[str, np.ndarray], time: float | None = None) -> dict[str, np.ndarray]:
    """The rows of one time (the last one by default), sorted by x, then z."""
    time = table["time"].max() if time is None else time
    rows = np.flatnonzero(np.isclose(table["time"], time))
    x, z = (np.round(table[n][rows] / max(np.abs(table["x"]).max(), 1e-300), 9) for n in "xz")
    rows = rows[np.lexsort((z, x))]
    return {name: column[rows] for name, column in table.items()}


def read_simple_table(path: Path, components: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """GetDP's SimpleTable on elements: points (elements x nodes, 3) and values (elements x nodes, components)."""
    table = np.loadtxt(path, ndmin=2)
    points = 3 * table.shape[1] // (3 + components)
    return table[:, :points].reshape(-1, 3), table[:, points:].reshape(-1, components)


def nodes_of(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distinct points, sorted by x, then z, and for each given point the row of its node."""
    rounded = np.round(points / max(1e-300, np.abs(points).max()), 9)
    _, first, inverse = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    return points[first], inverse.ravel()


def node_means(rows: np.ndarray, values: np.ndarray, number: int) -> np.ndarray:
    """Mean of the values that fall on each of `number` nodes; rows: the node of each value."""
    total = np.zeros((number, values.shape[1]))
    np.add.at(total, rows, values)
    return total / np.bincount(rows, minlength=number)[:, None]


def read(case: Case, folder: Path) -> Results:
    """Read what an engine has left in a folder, complete or not: everything up to the last converged step."""
    history_file = folder / "history.txt"
    steps = np.array([line.split()[1:] for line in history_file.read_text().splitlines()], float) if history_file.exists() else np.zeros((0, 15))
    time, level, iterations, cuts, residual, crack, slid, opening, crest, n, t, m, heel, flux_in, flux_out = steps.T
    scheduled = np.array([case.level_at(v) for v in time])
    factor = np.divide(level, scheduled, out=np.ones_like(level), where=scheduled > 0)
    history = dict(zip(HISTORY, (time, level, factor, iterations, cuts, residual, crack, slid, opening, crest, n, t, m,
                                 flux_out), strict=True))

    reached = [(i + 1, t) for i, t in enumerate(case.times) if t in case.requested and t in time]
    status = folder / "status.txt"
    stopped = ""
    if status.exists() and status.read_text().strip() != "0":
        stopped = why_stopped(case, history)
        if len(time) and time[-1] not in case.times:
            reached.append((int(np.sum(np.isin(case.times, time))) + 1, time[-1]))
    joint, extrapolated = [], []
    for index, t in reached:
        read_table = lambda name, n=3: read_simple_table(folder / f"{name}_{index}.txt", n)  # noqa: B023, E731
        points, jump = read_table("jump")
        nodes, rows = nodes_of(points)
        jump, traction, state = (node_means(rows, v, len(nodes)) for v in (jump, read_table("traction")[1], read_table("state")[1]))
        flux = [node_means(rows, read_table("flux", 1)[1], len(nodes))] if case["uplift"] == "flow" else []
        when = np.tile([t, history["level"][np.flatnonzero(time == t)[0]]], (len(nodes), 1))
        order = [1, 0, 2]  # y, x, z: normal, tangent 1, tangent 2
        joint.append(np.hstack([when, nodes, jump[:, order], traction[:, order], state, *flux]))
        corners, mean_jump = read_table("mean_jump")
        _, corner_rows = nodes_of(np.vstack([nodes, corners]))
        extra = joint[-1].copy()
        corner_rows = corner_rows[len(nodes):]
        present = np.unique(corner_rows)
        for columns, values in ((slice(5, 8), mean_jump), (slice(8, 11), read_table("mean_traction")[1])):
            with np.errstate(invalid="ignore"):
                extra[present, columns] = node_means(corner_rows, values[:, order], len(nodes))[present]
        extrapolated.append(extra)
    names = JOINT + ("flux",) * (case["uplift"] == "flow")
    columns = lambda blocks: dict(zip(names, (np.vstack(blocks) if blocks else np.zeros((0, len(names)))).T, strict=True))  # noqa: E731
    return Results(case, history, columns(joint), columns(extrapolated), stopped, heel)


def why_stopped(case: Case, history: dict[str, np.ndarray]) -> str:
    """In words, from the last converged state: the level, and whether the dam slides or turns over.

    Sliding when the shear is within 2 % of what friction and adhesion hold (or the whole joint has let go),
    overturning when the crack has crossed most of the base, or the resultant is in its last tenth.
    """
    if not len(history["time"]):
        return "no equilibrium even at the first step"
    last = {name: column[-1] for name, column in history.items()}
    base = case["dam_base"]
    holds = case["mu"] * last["N"] + case["adhesion"] * (base - last["crack_length"])
    if case["law"] == "friction" and last["T"] > 0.98 * holds:
        reason = "sliding"
    elif last["crack_length"] > 0.8 * base or last["M"] < 0.1 * last["N"] * base:
        reason = "overturning"
    elif last["slip_length"] > 0.98 * base:
        reason = "sliding"
    else:
        reason = "no convergence"
        stiff = case["K_N"] * base / case["n_joint"] / min(case["E_dam"], case["E_found"])
        if stiff > 100:
            reason += f" (the joint is too stiff for this mesh: K_N h/E = {stiff:.3g}; refine n_joint or lower K_N)"
    return f"{reason}: no equilibrium beyond level {last['level']:.6g} m (t = {last['time']:.6g}); the last converged state is saved"


def path_statement(results: Results) -> str:
    """In words, what a prescribed displacement has found: the largest level, and whether the path turns back."""
    history, case = results.history, results.case
    level, crest = history["level"], history["crest_ux"]
    driven = (history["time"] > case["drive_begin"] - 1e-9) & (history["time"] < case["drive_end"] + 1e-9)
    load = case["rho_water"] * case["g"] * level.max() if len(level) else 0
    said = f"largest load: level {level.max() if len(level) else 0:.5g} m ({load / 1e3:.5g} kPa)"
    falls = bool((np.diff(level[driven]) < 0).any())
    back = bool((np.diff(crest[driven]) < 0).any() or (np.diff(results.heel[driven]) < 0).any())
    said += "; the level falls while the displacement grows" if falls else "; the level rises all along"
    return said + ("; snap-back met" if back else "; no snap-back")


def write_csv(target: Path | TextIO, table: dict[str, np.ndarray]) -> None:
    """Write a table with its column names to a path or an open file; numbers with twelve digits."""
    if isinstance(target, Path):
        with target.open("w", newline="") as file:
            return write_csv(file, table)
    writer = csv.writer(target, lineterminator="\n")
    writer.writerow(table)
    writer.writerows([f"{v:.12g}" for v in row] for row in zip(*table.values(), strict=True))


def write(results: Results, folder: Path) -> None:
    """Write joint.csv, history.csv and run.json into a folder; curve.csv (load against opening) of a driven case."""
    folder.mkdir(parents=True, exist_ok=True)
    joint = dict(results.joint)
    for axis in "xyz":  # the mesh generator's last digits
        joint[axis] = np.round(joint[axis], 9) + 0.0
    write_csv(folder / "joint.csv", joint)
    write_csv(folder / "history.csv", results.history)
    case = results.case
    if case["drive"] != "level":
        history = results.history
        write_csv(folder / "curve.csv", {
            "time": history["time"], "level": history["level"], "pressure": case["rho_water"] * case["g"] * history["level"],
            "heel_opening": results.heel, "crest_ux": history["crest_ux"]})
    write_info(results, folder)


def write_info(results: Results, folder: Path) -> None:
    """Write run.json into a folder: parameters, sizes, versions, seconds, memory."""
    case = results.case
    (folder / "run.json").write_text(json.dumps(
        {"case": case.name, "title": case.title, "parameters": case.values, "levels": case.levels, "tail_levels": case.tail_levels,
         "times": case.times, "stopped": results.stopped, **results.info}, indent=2) + "\n")
