"""A run read back from the files in its folder."""

from __future__ import annotations

import csv
from pathlib import Path

import meshio
import numpy as np

from .. import InputError
from ..scene.case import SECTION, SHARED, Case
from ..scene.mesh import Body
from ..scene.parameters import INCLUDE, assignments, constants, declared, listing, parse
from .fields import Field, Solution
from .folder import SCENES, earlier
from .tables import Results

#: What is raised where files are not what a run writes; a SyntaxError by XML.
DAMAGED = (OSError, ValueError, LookupError, TypeError, SyntaxError, meshio.ReadError)


def runs_in(folder: Path) -> list[Path]:
    """The folder of a run and those of its case's further scenes.

    Raises InputError if it is none.
    """
    if not folder.is_dir() or earlier(folder) is None:
        raise InputError(f"out = {folder}: must be the folder of a run (with its run.json)")
    return [folder, *(folder / s for s in SCENES if earlier(folder / s) is not None)]


def read(folder: Path) -> Solution:
    """What a run has written: tables, mesh, fields as far as there are any.

    Raises InputError, naming the folder, if the run has no results, or its files are damaged.
    """
    told = earlier(folder) or {}
    if "parameters" not in told:
        raise InputError(f"out = {folder}: has no results, its run is {told.get('state', 'none')}")
    try:
        result = results_of(told, folder)
        bodies, fields = fields_in(folder / "fields", np.unique(result.joint["time"]))
    except DAMAGED as error:
        why = error if isinstance(error, InputError) else f"damaged: {error!r}"
        raise InputError(f"out = {folder}: {why}") from None
    return Solution(result, bodies, fields)


def results_of(told: dict, folder: Path) -> Results:
    """The tables with what run.json says; the rows extrapolated as published codes do are not
    kept.
    """
    history = read_csv(folder / "history.csv")
    case = case_of(told)
    heel = np.zeros(0)
    if case["drive"] != "level":
        heel = read_csv(folder / "curve.csv")["heel_opening"]
    return Results(
        case,
        history,
        read_csv(folder / "joint.csv"),
        {},
        stopped=told["state"] == "stopped",
        heel=heel,
        info=told,
    )


def case_of(told: dict) -> Case:
    """The case that run.json tells of.

    Raises KeyError, TypeError, InputError (a ValueError) if it tells of none.
    """
    name = told["case"]
    if Path(name).name != name:
        raise InputError(f"case {name!r}: must be the name of a case")
    if missing := [n for n in declared() if n not in told["parameters"]]:
        made = told["versions"]["damjoint"]
        raise InputError(f"parameters {', '.join(missing)} are unknown to its damjoint {made}")
    values = {n: p.check(told["parameters"][n]) for n, p in declared().items()}
    lists = {n: tuple(map(float, told[n])) for n in ("levels", "tail_levels", "times")}
    found = parse(resolved(values, lists["levels"]))
    return Case(
        name,
        str(told["title"]),
        values,
        **lists,
        published=bool(told["published"]),
        hardening_asked=bool(told["hardening_asked"]),
        shared={n: found[n] for n in SHARED},
        section={n: found[n] for n in SECTION},
    )


def resolved(values: dict, levels: tuple[float, ...]) -> str:
    """A text by which Gmsh's parser finds what follows from some parameters and the levels."""
    return assignments(values) + listing("levels", levels) + INCLUDE


def read_csv(path: Path) -> dict[str, np.ndarray]:
    """A table of numbers by column."""
    with path.open(newline="") as file:
        head, *rows = csv.reader(file)
    numbers = np.array(rows, float).reshape(len(rows), len(head))
    return dict(zip(head, numbers.T, strict=True))


def fields_in(folder: Path, times: np.ndarray) -> tuple[dict[str, Body], dict[float, Field]]:
    """Bodies, and displacement and stress at the times of which there are files."""
    bodies, fields = {}, {}
    names = {int(constants()[n.upper()][0]): n for n in ("dam", "foundation", "lower")}
    for time in times.tolist():
        path = folder / f"bulk_t{time:g}.vtu"
        if path.is_file():
            # not meshio.read: it leaves the process where a file is damaged
            bulk, joint = (meshio.vtu.read(p) for p in (path, folder / f"joint_t{time:g}.vtu"))
            parts = {name: part(bulk, number) for number, name in names.items()}
            bodies = {n: p[0] for n, p in parts.items() if len(p[0].points)}
            bodies["joint"] = body_of(joint.points, [(b.type, b.data) for b in joint.cells])
            fields[time] = Field(
                {n: bulk.point_data["displacement"][parts[n][1]] for n in parts if n in bodies},
                {n: parts[n][2] for n in parts if n in bodies},
            )
    return bodies, fields


def part(bulk: meshio.Mesh, number: int) -> tuple[Body, np.ndarray, np.ndarray]:
    """The part of a mesh with a region's number: as a body, its points there, its stress."""
    blocks, stresses = [], []
    for block, numbers, stress in zip(
        bulk.cells, bulk.cell_data["body"], bulk.cell_data["stress"], strict=True
    ):
        own = numbers == number
        if own.any():
            blocks.append((block.type, block.data[own]))
            stresses.append(stress[own])
    if not blocks:
        return body_of(np.zeros((0, 3)), []), np.zeros(0, int), np.zeros((0, 6))
    used = np.unique(np.concatenate([table.ravel() for _, table in blocks]))
    cells = [(shape, np.searchsorted(used, table)) for shape, table in blocks]
    return body_of(bulk.points[used], cells), used, np.concatenate(stresses)


def body_of(points: np.ndarray, cells: list[tuple[str, np.ndarray]]) -> Body:
    """A body with tags of its own."""
    count = sum(len(table) for _, table in cells)
    return Body(points, np.arange(1, len(points) + 1), cells, np.arange(1, count + 1))
