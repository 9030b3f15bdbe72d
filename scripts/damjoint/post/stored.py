"""A run read back from the files in its folder."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import meshio
import numpy as np

from .. import InputError
from ..model.case import SECTION, SHARED, Case, is_name
from ..model.fields import Field, Solution
from ..model.mesh import Body
from ..model.parameters import INCLUDE, assignments, constants, declared, listing, parse
from ..model.results import HISTORY, Results
from .folder import earlier

#: What is raised where files are not what a run writes; a SyntaxError by XML.
DAMAGED = (
    *(OSError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError),
    *(RecursionError, SyntaxError, meshio.ReadError),
)


def runs_in(folder: Path) -> list[Path]:
    """The folder of a run and those of its case's further scenes.

    Raises InputError if it is none.
    """
    if not folder.is_dir() or earlier(folder) is None:
        raise InputError(f"out = {folder}: must be the folder of a run (with its run.json)")
    scenes = (folder / mode for mode in declared()["uplift"].choices)
    return [folder, *(scene for scene in scenes if earlier(scene) is not None)]


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
    if missing := [name for name in HISTORY if name not in history]:
        made = told["versions"]["damjoint"]
        raise InputError(f"history.csv of damjoint {made} lacks {', '.join(missing)}: run it again")
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
    if not is_name(told["case"]):
        raise InputError(f"case {told['case']!r}: must be the name of a case")
    if missing := [n for n in declared() if n not in told["parameters"]]:
        made = told["versions"]["damjoint"]
        raise InputError(f"parameters {', '.join(missing)} are unknown to its damjoint {made}")
    values = {n: p.check(told["parameters"][n]) for n, p in declared().items()}
    lists = {n: tuple(map(float, told[n])) for n in ("levels", "tail_levels", "times")}
    for name, numbers in lists.items():
        if not np.isfinite(numbers).all():
            raise InputError(f"{name} = {','.join(map(str, numbers))}: must be finite")
    found = parse(resolved(values, lists["levels"]))
    return Case(
        name=told["case"],
        title=str(told["title"]).encode(errors="replace").decode(),
        values=values,
        **lists,
        published=bool(told["published"]),
        hardening_asked=bool(told["hardening_asked"]),
        shared={n: found[n] for n in SHARED},
        geometry=Path(told["geometry"]) if told["geometry"] else None,
        section={n: found[n] for n in SECTION} | told["section"],
    )


def resolved(values: dict, levels: tuple[float, ...]) -> str:
    """A text by which Gmsh's parser finds what follows from some parameters and the levels."""
    return assignments(values) + listing("levels", levels) + INCLUDE


def read_csv(path: Path) -> dict[str, np.ndarray]:
    """A table of numbers by column; where there is none they are nan, but never infinite."""
    check_file(path)
    with path.open(newline="") as file:
        head, *rows = csv.reader(file)
    numbers = np.array(rows, float).reshape(len(rows), len(head))
    if np.isinf(numbers).any():
        raise ValueError(f"{path.name} has infinite numbers")
    return dict(zip(head, numbers.T, strict=True))


def check_file(path: Path) -> None:
    """Raise OSError if it is none: a pipe would be read without end."""
    if not path.is_file():
        raise OSError(f"{path.name} is no file")


def fields_in(folder: Path, times: np.ndarray) -> tuple[dict[str, Body], dict[float, Field]]:
    """Bodies, and displacement and stress at the times of which there are files."""
    bodies, fields = {}, {}
    for time in times.tolist():
        path = folder / f"bulk_t{time:g}.vtu"
        if path.is_file():
            check_file(folder / f"joint_t{time:g}.vtu")
            # not meshio.read: it leaves the process where a file is damaged
            bulk, joint = (meshio.vtu.read(p) for p in (path, folder / f"joint_t{time:g}.vtu"))
            parts = {"dam": part(bulk, "dam"), "foundation": part(bulk, "foundation", "lower")}
            bodies = {name: body for name, (body, _, _) in parts.items()}
            bodies["joint"] = body_of(joint.points, [(b.type, b.data) for b in joint.cells])
            moved = bulk.point_data["displacement"]
            fields[time] = Field(
                {name: moved[used] for name, (_, used, _) in parts.items()},
                {name: stress for name, (_, _, stress) in parts.items()},
            )
    return bodies, fields


def part(bulk: meshio.Mesh, *regions: str) -> tuple[Body, np.ndarray, np.ndarray]:
    """Some regions of a mesh: as a body, its points there, its stress."""
    numbers = {constants()[name.upper()][0]: name for name in regions}
    blocks = [
        (numbers[number], block.type, block.data[own == number], stress[own == number])
        for block, own, stress in zip(
            bulk.cells, bulk.cell_data["body"], bulk.cell_data["stress"], strict=True
        )
        for number in numbers
        if (own == number).any()
    ]
    names, shapes, tables, stresses = zip(*blocks, strict=True)
    used = np.unique(np.concatenate([table.ravel() for table in tables]))
    cells = [(s, np.searchsorted(used, t)) for s, t in zip(shapes, tables, strict=True)]
    return body_of(bulk.points[used], cells, names), used, np.concatenate(stresses)


def body_of(
    points: np.ndarray, cells: list[tuple[str, np.ndarray]], regions: Sequence[str] = ()
) -> Body:
    """A body with tags of its own."""
    count = sum(len(table) for _, table in cells)
    tags, elements = np.arange(1, len(points) + 1), np.arange(1, count + 1)
    return Body(points, tags, cells, elements, list(regions))
