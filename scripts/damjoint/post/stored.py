"""Read a run from the files in its folder."""

from __future__ import annotations

import csv
import re
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
from ..input.scene import MATERIALS
from ..mesh.body import Body
from ..model.fields import Field, Solution
from ..model.results import Info, Results, history_columns
from .field_files import DISPLACEMENT, STRESS
from .folder import PARTS, read_info, scene_folders

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
    if state == "complete" and ("levels" not in info or "reliability" in info):
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
        end = f"_t{time:g}.vtu"
        paths = [path for path in folder.glob(f"*{end}") if re.fullmatch(PARTS, path.name)]
        joints, field = {}, Field({}, {})
        for path in sorted(paths, key=from_the_highest):
            check_file(path)
            # not meshio.read: it exits the process if a file is damaged
            mesh = linear(meshio.vtu.read(path))
            name = path.name.removesuffix(end).replace("_", " ")
            if name.startswith("joint"):
                joints[name], _ = corners_of_mesh(mesh)
            else:
                bodies[name], points, field.stress[name] = extract_body(mesh)
                field.displacement[name] = mesh.point_data[DISPLACEMENT][points]
        if paths:
            bodies |= joints
            fields[time] = field
    return bodies, fields


def from_the_highest(path: Path) -> tuple[bool, int]:
    """Order of the bodies by their files: dam 3, dam 2, dam, foundation."""
    number = re.match(r"[a-z]+_(\d+)_t", path.name)
    return path.name.startswith("foundation"), -int(number[1]) if number else -1


def linear(mesh: meshio.Mesh) -> meshio.Mesh:
    """A mesh with the corners of its cells only."""
    for block in mesh.cells:
        block.type = shape = block.type.rstrip("0123456789")
        block.data = block.data[:, : len(corners_of(shape))]
    return mesh


def corners_of_mesh(mesh: meshio.Mesh) -> tuple[Body, np.ndarray]:
    """The corners of a mesh and its cells as a body; the indices of these points (n,)."""
    used = np.unique(np.concatenate([block.data.ravel() for block in mesh.cells]))
    cells = [(block.type, np.searchsorted(used, block.data)) for block in mesh.cells]
    return body_of(mesh.points[used], cells), used


def extract_body(mesh: meshio.Mesh) -> tuple[Body, np.ndarray, np.ndarray]:
    """A body with its regions, the indices of its points (n,), stress (elements, 6) [Pa]."""
    regions = {int(constants()[name.upper()][0]): name for name in MATERIALS}
    layer, blocks, stresses = int(constants()["LAYER"][0]), [], []
    for block, numbers, stress in zip(
        mesh.cells, mesh.cell_data["body"], mesh.cell_data[STRESS], strict=True
    ):
        for number in np.unique(numbers).tolist():
            of_region = numbers == number
            name = regions[number % layer]
            blocks.append((name, meshio.CellBlock(block.type, block.data[of_region])))
            stresses.append(stress[of_region])
    names, cells = zip(*blocks, strict=True)
    mesh.cells = [*cells]
    body, used = corners_of_mesh(mesh)
    return replace(body, regions=[*names]), used, np.concatenate(stresses)


def body_of(points: np.ndarray, cells: list[tuple[str, np.ndarray]]) -> Body:
    """Build a body with consecutive tags."""
    count = sum(len(table) for _, table in cells)
    tags, elements = np.arange(1, len(points) + 1), np.arange(1, count + 1)
    return Body(points, tags, cells, elements)
