"""Results from the tables of GetDP (pro/output.pro)."""

from __future__ import annotations

from itertools import takewhile
from pathlib import Path

import numpy as np

from ...input.case import Case
from ...input.values import flows_in_time
from ...mesh.mesh import Mesh
from ...model.fields import Field
from ...model.results import (
    FILM,
    FLUX,
    JOINT,
    THICKNESS,
    Results,
    column_of,
    history_table,
    joint_columns,
    joint_table,
)
from ...storage import check_end
from .process import numbers

#: Columns of history.txt (pro/step_control.pro) after "step"; of joints.txt after "joint".
PRINTED = [
    *("time", "level", "iterations", "cuts", "residual", "crest_ux", "heel"),
    *("load_factor", "point_u"),
]
PRINTED_OF_JOINTS = [
    *("crack_length", "process_zone", "slip_length", "max_opening"),
    *("N", "T", "M", "flux", "U", "M_U", "broken_length", "bonded_length", "T_z"),
]
#: and of water.txt, after "water": zero in a joint that stores none
PRINTED_OF_WATER = ["water", "water_in", "void", "p_max", "p_min"]


def read_simple_table(path: Path, components: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Points (elements, nodes, 3) and values (elements, nodes, components) of a SimpleTable.

    Raises OSError, ValueError if the file is missing or incomplete.
    """
    check_end(path, "\n")
    table = np.loadtxt(path, ndmin=2)
    points, values = np.split(table, [3 * table.shape[1] // (3 + components)], axis=1)
    return points.reshape(len(table), -1, 3), values.reshape(len(table), -1, components)


def nodes_of(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distinct points, sorted by x, then z, and for each of the points the row of its node."""
    rounded = np.round(points / max(1e-300, np.abs(points).max()), 9)
    _, first, inverse = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    return points[first], inverse.ravel()


def node_means(rows: np.ndarray, values: np.ndarray, number: int) -> np.ndarray:
    """Mean of the values at each of `number` nodes; rows: the node of each value."""
    total = np.zeros((number, values.shape[1]))
    np.add.at(total, rows, values)
    return total / np.bincount(rows, minlength=number)[:, None]


def complete_rows(file: Path, columns: list[str]) -> np.ndarray:
    """The complete rows (n, columns) of history.txt or joints.txt."""
    # a line without its end is incomplete
    lines = file.read_text().split("\n")[:-1] if file.exists() else []
    rows = (line.split()[1:] for line in lines)
    complete = takewhile(lambda row: len(row) == len(columns), rows)
    return np.array([*complete], float).reshape(-1, len(columns))


def read_history(case: Case, folder: Path) -> dict[str, np.ndarray]:
    """Complete steps of history.txt and joints.txt, {column: values}, and tail_level."""
    steps = complete_rows(folder / "history.txt", PRINTED)
    number = len(case.joints)
    of_joints = complete_rows(folder / "joints.txt", PRINTED_OF_JOINTS)
    steps = steps[: len(of_joints) // number]
    printed = dict(zip(PRINTED, steps.T, strict=True))
    if case["drive_load"] == "level":  # `history_table` makes it from the level
        del printed["load_factor"]
    for k in range(number):
        rows = of_joints[k::number][: len(steps)]
        names = [column_of(name, k) for name in PRINTED_OF_JOINTS]
        printed |= dict(zip(names, rows.T, strict=True))
    if case.stores_water:
        of_water = complete_rows(folder / "water.txt", PRINTED_OF_WATER)
        for k, joint in enumerate(case.joints):
            rows = of_water[k::number][: len(steps)]
            names = [column_of(name, k) for name in PRINTED_OF_WATER]
            printed |= dict(zip(names, rows.T, strict=True))
            printed[column_of("Re", k)] = np.zeros(len(steps))
            if flows_in_time(joint) and len(steps):
                flux = step_flux(folder / f"step_flux_{k}.txt", len(steps))
                printed[column_of("Re", k)] = 2 / joint["visc"] * np.abs(flux).max(axis=1)
                printed[column_of("flux", k)] = flux[:, -1]
    return printed | {"tail_level": np.array([case.tail_at(time) for time in printed["time"]])}


def step_flux(path: Path, number: int) -> np.ndarray:
    """Flux in the elements of a joint (steps, elements), from heel to toe, of the first steps.

    Raises OSError, ValueError if the file is missing or incomplete.
    """
    lines = path.read_text().split("\n")[:-1]
    table = np.loadtxt(lines, ndmin=2)
    elements = len(np.unique(table[:, 0]))
    return table[: number * elements, -1].reshape(number, -1)[:, table[:elements, 0].argsort()]


def saved_times(case: Case, history: dict[str, np.ndarray], stopped: bool) -> dict[int, float]:
    """Requested times that were reached, by the number in the names of GetDP's files."""
    done = history["time"]
    saved = {i + 1: t for i, t in enumerate(case.times) if t in case.requested and t in done}
    if stopped and len(done) and done[-1] not in case.times:  # the last converged state
        saved[int(np.isin(case.times, done).sum()) + 1] = float(done[-1])
    return saved


def read_joint(
    case: Case, joint: int, folder: Path, number: int, time: float, level: float
) -> tuple[np.ndarray, np.ndarray]:
    """Rows of a joint, by its number from 0, at a requested time, and the same extrapolated from
    the Gauss points. Raises OSError, ValueError if a file is missing or incomplete.
    """
    joint_case = case.joints[joint]

    def elements(name: str, components: int = 3) -> tuple[np.ndarray, np.ndarray]:
        return read_simple_table(folder / f"{name}_{joint}_{number}.txt", components)

    def table(name: str, components: int = 3) -> tuple[np.ndarray, np.ndarray]:
        points, values = elements(name, components)
        return points.reshape(-1, 3), values.reshape(-1, components)

    def more(name: str) -> np.ndarray:
        """A column that not every joint has."""
        if name not in joint_columns(joint_case):
            return np.full((len(nodes), 1), np.nan)
        if name in FILM:
            return film(name)
        file = name if name in FLUX | THICKNESS else "law_scalar"
        return node_means(rows, table(file, 1)[1], len(nodes))

    def film(name: str) -> np.ndarray:
        """A column of water that is stored in the joint."""
        if name == "Re":
            return 2 / joint_case["visc"] * np.abs(more("flux"))
        at, values = table(name, 1)
        along = np.argsort(at[:, 0])
        return np.interp(nodes[:, 0], at[along, 0], values[along, 0])[:, None]

    order = [1, 0, 2]  # y, x, z: normal, tangent 1, tangent 2
    points, jump = table("jump")
    nodes, rows = nodes_of(points)
    tables = jump, table("traction")[1], table("state")[1]
    jump, traction, state = (node_means(rows, values, len(nodes)) for values in tables)
    others = [more(name) for name in joint_columns(case) if name not in JOINT]
    when = np.tile([time, level, joint + 1.0], (len(nodes), 1))
    distance = joint_case.joint_along * node_means(rows, table("path", 1)[1], len(nodes))
    averaged = np.hstack(
        [when, nodes, jump[:, order], traction[:, order], state, distance, *others]
    )
    extrapolated = averaged.copy()
    for columns, name in (slice(6, 9), "jump"), (slice(9, 12), "traction"):
        means = [elements(f"mean_{name}_{k}") for k in range(len(MOMENTS))]
        corners = means[0][0]
        values = corner_values(corners, np.array([values[:, 0] for _, values in means]))
        _, corner_rows = nodes_of(np.vstack([nodes, corners.reshape(-1, 3)]))
        corner_rows = corner_rows[len(nodes) :]
        with np.errstate(invalid="ignore"):
            at_nodes = node_means(corner_rows, values[:, order], len(nodes))
        present = np.unique(corner_rows)
        extrapolated[present, columns] = at_nodes[present]
    return averaged, extrapolated


#: What element means are weighted with (pro/output.pro).
MOMENTS = "1", "x", "y", "z"


def corner_values(corners: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Values (elements x corners, 3) at the corners (elements, n, 3) of lines, triangles or
    quadrangles, from means over each element of a quantity times MOMENTS (4, elements, 3): the
    linear function with these means, or a constant if they are those of one Gauss point.
    """
    count = corners.shape[1]
    products = (1 + np.eye(count)) / (count * (count + 1))  # means of two nodal functions
    if count == 4:  # of a parallelogram
        products = np.array([np.roll([4, 2, 1, 2], k) for k in range(4)]) / 36
    middle = corners.mean(axis=1, keepdims=True)
    about = moments[1:] - middle.transpose(2, 0, 1) * moments[0]
    slopes = np.linalg.pinv((corners - middle).transpose(0, 2, 1) @ products, rcond=1e-9)
    parts = slopes @ about.transpose(1, 0, 2)
    return np.asarray(moments[0][:, None] + parts).reshape(-1, 3)


def read(case: Case, folder: Path) -> tuple[Results, dict[int, float]]:
    """Read the tables of a run, finished or not, up to the last converged step.

    Returns the results, and the times of the files by their number. Raises OSError, ValueError if
    a table of a finished run is incomplete.
    """
    history = read_history(case, folder)
    status = folder / "status.txt"
    text = status.read_text() if status.exists() else ""
    finished, stopped = bool(text), text == "1\n"
    if finished and not stopped and not np.isclose(history["time"], case.times[-1]).any():
        raise ValueError(f"history.txt: no step at t = {case.times[-1]:g}, the last one")
    blocks, saved = [], {}
    for number, time in saved_times(case, history, stopped).items():
        level = history["level"][np.flatnonzero(history["time"] == time)[0]]
        try:
            joints = range(len(case.joints))
            parts = [read_joint(case, k, folder, number, time, level) for k in joints]
            blocks.append([np.vstack(rows) for rows in zip(*parts, strict=True)])
        except (OSError, ValueError):  # GetDP was stopped while it wrote this table
            if finished:
                raise
            break
        saved[number] = time
    joint, extrapolated = (joint_table(case, [b[k] for b in blocks]) for k in (0, 1))
    table = history_table(case, history)
    return Results(case, table, joint, extrapolated, stopped, history["heel"]), saved


def read_values(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of nodes or elements, and their values, of GetDP's NodeTable or ElementTable.

    Raises OSError, ValueError if the file is missing or incomplete.
    """
    check_end(path, "\n")
    with path.open() as file:
        number, table = int(file.readline()), np.loadtxt(file, ndmin=2)
    if len(table) != number:
        raise ValueError(f"{path} has {len(table)} of {number} rows")
    return table[:, 0].astype(int), table[:, 1:]


def pick(numbers: np.ndarray, values: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Values of the wanted numbers, in their order."""
    order = np.argsort(numbers)
    return values[order[np.searchsorted(numbers, wanted, sorter=order)]]


def read_fields(folder: Path, saved: dict[int, float], mesh: Mesh) -> dict[float, Field]:
    """Fields of the bodies by time; saved: see `read`."""
    result, solids, body = {}, mesh.solids.items(), numbers(mesh)
    # under the weight alone, the reference of displacements
    files = {n: folder / f"u_{body[n]:.0f}_0.txt" for n, _ in solids}
    at_rest = {
        n: pick(*read_values(files[n]), solid.node_tags) if files[n].exists() else 0.0
        for n, solid in solids
    }
    for number, time in saved.items():
        elements, stress = read_values(folder / f"stress_{number}.txt")
        stress = stress[:, [0, 3, 5, 1, 4, 2]]
        displacement = {n: read_values(folder / f"u_{body[n]:.0f}_{number}.txt") for n, _ in solids}
        result[time] = Field(
            {n: pick(*displacement[n], solid.node_tags) - at_rest[n] for n, solid in solids},
            {n: pick(elements, stress, solid.element_tags) for n, solid in solids},
        )
    return result
