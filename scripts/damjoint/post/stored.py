"""Read a run from the files in its folder."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import meshio
import numpy as np

from .. import InputError
from ..fem.elements import corners_of
from ..input.case import SECTION, SHARED, Case
from ..input.case_names import is_name
from ..input.joints import parsed_by_joint, stacked_joints
from ..input.parameters import GEOMETRY_LISTS, constants, declared, listing
from ..input.scene import numbered
from ..mesh.body import Body
from ..model.fields import Field, Solution
from ..model.results import Info, Results, history_columns
from .field_files import DISPLACEMENT, STRESS
from .folder import read_info, scene_folders

#: Errors that reading damaged files can raise; SyntaxError: by XML.
DAMAGED = (
    *(OSError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError),
    *(RecursionError, SyntaxError, meshio.ReadError),
)


def runs_in(folder: Path) -> list[Path]:
    """List the folder of a run and those of its case's further scenes.

    Raises InputError if it is not the folder of a run.
    """
    if not folder.is_dir() or read_info(folder) is None:
        raise InputError(f"out = {folder}: must be the folder of a run (with its run.json)")
    return [folder, *(scene for scene in scene_folders(folder) if read_info(scene) is not None)]


def read(folder: Path) -> Solution:
    """Read tables, mesh and fields (if written) of a run.

    Raises InputError if the run has no results or its files are damaged.
    """
    info = read_info(folder) or {}
    state = info.get("state", "unknown")
    if state == "complete" and "levels" not in info:
        raise InputError(f"out = {folder}: must be of run, check, critical or quake")
    if "parameters" not in info:
        raise InputError(f"out = {folder}: must be a run with results; its state is {state}")
    try:
        result = read_results(info, folder)
        times = np.unique(result.joint["time"])
        if info.get("frames"):  # the fields are those of an earthquake, at its own times
            times = times[:0]
        bodies, fields = read_fields(folder / "fields", times)
    except DAMAGED as error:
        why = error if isinstance(error, InputError) else f"damaged ({error!r}); run the case again"
        raise InputError(f"out = {folder}: {why}") from None
    return Solution(result, bodies, fields)


def read_results(info: dict[str, Any], folder: Path) -> Results:
    """Read the tables of a run; the extrapolated rows are not stored, and empty.

    Raises InputError if a column is missing, as in files of earlier versions.
    """
    history = read_csv(folder / "history.csv")
    joint = read_csv(folder / "joint.csv")
    case = case_of(info)
    required = ("history", history, history_columns(case)), ("joint", joint, ("joint",))
    for name, table, columns in required:
        if missing := [column for column in columns if column not in table]:
            version, lacks = info["versions"]["damjoint"], ", ".join(missing)
            raise InputError(f"{name}.csv of damjoint {version} lacks {lacks}: run the case again")
    heel = np.zeros(0)
    if case["drive"] != "level":
        heel = read_csv(folder / "curve.csv")["heel_opening"]
    stopped = info["state"] == "stopped"
    return Results(case, history, joint, {}, stopped, heel, info=cast(Info, info))


def case_of(info: dict[str, Any]) -> Case:
    """Build the case from the content of run.json.

    Raises KeyError, TypeError, InputError (a ValueError) if the content is incomplete or bad.
    """
    if not is_name(info["case"]):
        raise InputError(f"case {info['case']!r}: must be the name of a case")
    if missing := [n for n in declared() if n not in info["parameters"]]:
        version = info["versions"]["damjoint"]
        raise InputError(f"run.json of damjoint {version} lacks parameters: {', '.join(missing)}")
    values = {n: p.check(info["parameters"][n]) for n, p in declared().items()}
    levels, tail_levels, times = (finite(n, info[n]) for n in ("levels", "tail_levels", "times"))
    # of a run by an earlier version that had no such list: none
    lifts, face = (finite(name, info.get(name, [])) for name in GEOMETRY_LISTS)
    of_joints_given = [
        values | {n: declared()[n].check(v) for n, v in joint["values"].items()}
        for joint in info["joints"]
    ]
    parsed, *of_joints = parsed_by_joint(
        of_joints_given or [values],
        listing("levels", levels) + listing("downstream_face", face) * bool(face),
        lifts,
    )
    # a section by parameters is computed again
    ends = ("name", "upper", "lower", "section") if info["geometry"] else ()
    joints = tuple(
        replace(joint, **{name: stored[name] for name in ("hardening_requested", *ends)})
        for joint, stored in zip(stacked_joints(parsed, of_joints), info["joints"], strict=True)
    )
    return Case(
        name=info["case"],
        title=str(info["title"]).encode(errors="replace").decode(),
        values=values,
        levels=levels,
        tail_levels=tail_levels,
        times=times,
        published=bool(info["published"]),
        hardening_requested=bool(info["hardening_requested"]),
        shared={n: parsed[n] for n in SHARED},
        geometry=Path(info["geometry"]) if info["geometry"] else None,
        section={n: parsed[n] for n in SECTION} | info["section"],
        lift_heights=lifts,
        downstream_face=face,
        of_joints=joints,
    )


def finite(name: str, values: list[float]) -> tuple[float, ...]:
    """Convert a list of run.json to floats. Raises InputError if a number is not finite."""
    numbers = tuple(map(float, values))
    if not np.isfinite(numbers).all():
        raise InputError(f"{name} = {','.join(map(str, numbers))}: must be finite")
    return numbers


def read_csv(path: Path) -> dict[str, np.ndarray]:
    """Read a table of numbers by column; they may be nan. Raises OSError, ValueError."""
    check_file(path)
    with path.open(newline="") as file:
        head, *rows = csv.reader(file)
    numbers = np.array(rows, float).reshape(len(rows), len(head))
    if np.isinf(numbers).any():
        raise ValueError(f"{path.name} has infinite numbers")
    return dict(zip(head, numbers.T, strict=True))


def check_file(path: Path) -> None:
    """Raise OSError if a path is no regular file: reading a pipe would not end."""
    if not path.is_file():
        raise OSError(f"{path.name} is no regular file")


def read_fields(folder: Path, times: np.ndarray) -> tuple[dict[str, Body], dict[float, Field]]:
    """Read the bodies, and displacement and stress at the times that have files."""
    bodies: dict[str, Body] = {}
    fields: dict[float, Field] = {}
    for time in times.tolist():
        path = folder / f"bulk_t{time:g}.vtu"
        if path.is_file():
            check_file(folder / f"joint_t{time:g}.vtu")
            # not meshio.read: it exits the process if a file is damaged
            paths = path, folder / f"joint_t{time:g}.vtu"
            bulk, joint = (linear(meshio.vtu.read(p)) for p in paths)
            parts = {name: extract_body(bulk, regions) for name, regions in parts_of(bulk).items()}
            bodies = {name: body for name, (body, _, _) in parts.items()}
            bodies |= extract_joints(joint)
            displacement = bulk.point_data[DISPLACEMENT]
            fields[time] = Field(
                {name: displacement[points] for name, (_, points, _) in parts.items()},
                {name: stress for name, (_, _, stress) in parts.items()},
            )
    return bodies, fields


def linear(mesh: meshio.Mesh) -> meshio.Mesh:
    """A mesh with the corners of its cells only."""
    for block in mesh.cells:
        block.type = shape = block.type.rstrip("0123456789")
        block.data = block.data[:, : len(corners_of(shape))]
    return mesh


def parts_of(bulk: meshio.Mesh) -> dict[str, dict[int, str]]:
    """The bodies of a mesh, from the highest: their regions by number."""
    layer = int(constants()["LAYER"][0])
    present = np.unique(np.concatenate(bulk.cell_data["body"])).astype(int).tolist()
    dams = (number // layer for number in reversed(present))
    dam = int(constants()["DAM"][0])
    parts = {
        numbered("dam", k): {dam + k * layer: "dam"} for k in dams if dam + k * layer in present
    }
    rock = {int(constants()[name.upper()][0]): name for name in ("foundation", "lower")}
    return parts | {"foundation": rock}


def extract_joints(mesh: meshio.Mesh) -> dict[str, Body]:
    """The surfaces of the joints of a mesh, by the numbers of its points' joints."""
    number, joints = mesh.point_data["joint"].astype(int), {}
    for k in np.unique(number).tolist():
        tables = [block.data[number[block.data[:, 0]] == k] for block in mesh.cells]
        used = np.unique(np.concatenate([table.ravel() for table in tables]))
        cells = [
            (block.type, np.searchsorted(used, table))
            for block, table in zip(mesh.cells, tables, strict=True)
        ]
        shown = [(shape, table) for shape, table in cells if len(table)]
        joints[numbered("joint", k - 1)] = body_of(mesh.points[used], shown)
    return joints


def extract_body(bulk: meshio.Mesh, numbers: dict[int, str]) -> tuple[Body, np.ndarray, np.ndarray]:
    """Extract regions of a mesh, by number: body, indices of its points (n,), stress (elements, 6)
    [Pa].
    """
    blocks = [
        (numbers[number], block.type, block.data[region == number], stress[region == number])
        for block, region, stress in zip(
            bulk.cells, bulk.cell_data["body"], bulk.cell_data[STRESS], strict=True
        )
        for number in numbers
        if (region == number).any()
    ]
    names, shapes, tables, stresses = zip(*blocks, strict=True)
    used = np.unique(np.concatenate([table.ravel() for table in tables]))
    cells = [(s, np.searchsorted(used, t)) for s, t in zip(shapes, tables, strict=True)]
    return body_of(bulk.points[used], cells, names), used, np.concatenate(stresses)


def body_of(
    points: np.ndarray, cells: list[tuple[str, np.ndarray]], regions: Sequence[str] = ()
) -> Body:
    """Build a body with consecutive tags."""
    count = sum(len(table) for _, table in cells)
    tags, elements = np.arange(1, len(points) + 1), np.arange(1, count + 1)
    return Body(points, tags, cells, elements, list(regions))
