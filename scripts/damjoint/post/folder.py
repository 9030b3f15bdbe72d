"""The output folder of a run: run.json, removal of an earlier run's results.

Removed are only files with the names that a run writes, and only beside a run.json of damjoint.
"""

from __future__ import annotations

import contextlib
import csv
import json
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from .. import InputError, __version__
from ..input.case import Case, OfJoint
from ..input.case_names import is_name
from ..input.parameters import GEOMETRY_LISTS, declared
from ..model.results import Results, history_columns, joint_columns
from ..statics.hints import hints
from ..statics.statement import statement
from ..statics.verdict import verdict
from ..storage import PART, atomic_write, locked_folder

#: The record of a study: case, state, versions, machine, times.
RECORD = "run.json"
#: Files of a run: tables, pictures CASE....png, fields.
TABLES = (
    *("joint.csv", "history.csv", "curve.csv", "steps.csv", "gravity.csv", "critical.csv"),
    *("quake.csv", "quake_joint.csv", "quake_stress.npz", "quake_state.npz"),
    *("modes.csv", "reliability.csv", "design_point.case", "sensitivity.csv", RECORD),
    *("calibration.csv", "residuals.csv", "calibrated.case"),
)
PICTURES = (
    *("", "_curve", "_check", "_critical", "_quake", "_modes", "_water", "_sensitivity"),
    "_calibration",
)
#: Files of a body or a joint for ParaView, and all of fields/; in those of earlier versions all
#: bodies were `bulk`.
PARTS = r"(foundation|(dam|joint)(_\d+)?)_t[\w.+-]+\.vtu"
FIELDS = PARTS + r"|bulk_t[\w.+-]+\.vtu|(bulk|joint)\.msh|fields\.pvd"
#: States of a run that has come to its end: the last one; of the loads or of the equilibria.
COMPLETE, STOPPED = "complete", "stopped"
#: The tables of studies of several cases, in the folder above theirs, and their first columns.
CHECK, RECORDS = "check.csv", "records.csv"
HEADS = {CHECK: ["case", "joint", "answer", "uplift"], RECORDS: ["folder", "record"]}


def check_writable(folder: Path) -> None:
    """Raise InputError if the output folder can not be created or written, or if a link or special
    file in it has the name of a file of a run.

    Creates nothing.
    """
    existing = folder
    try:
        while not (existing.exists() or existing.is_symlink()):
            existing = existing.parent
        if not existing.is_dir() or not os.access(existing, os.W_OK | os.X_OK):
            raise InputError(f"out = {folder}: must be a folder that can be written")
        for inner in (folder / "fields", *scene_folders(folder)):
            if inner.is_symlink() or (inner.exists() and not inner.is_dir()):
                name = inner.name
                raise InputError(f"out = {folder}: its {name} must be a folder, and not a link")
        for name in (*TABLES, *HEADS):
            if (folder / name).exists() and not (folder / name).is_file():
                raise InputError(f"out = {folder}: its {name} must be a regular file")
    except OSError as error:  # a name too long, a loop of links
        raise InputError(f"out = {folder}: {error.strerror}") from None


@contextlib.contextmanager
def claim_output_folder(name: str, folder: Path, keep: bool = False) -> Iterator[None]:
    """Create and lock the output folder of a run, and remove an earlier run's results, also the
    table of a study of which it was a part; name: of its case; keep: not those of a run that is to
    be continued.

    Raises InputError if the folder can not be written or is locked; an earlier run stays then.
    """
    with claim_study_folder(folder):
        if not keep:
            clear(folder)
        remove_tables(folder.resolve().parent, folder.resolve().name)
        write_state(name, folder / RECORD, "running")
        yield


@contextlib.contextmanager
def claim_study_folder(folder: Path) -> Iterator[None]:
    """Create and lock the folder of a study of several cases, and remove the table of an earlier
    one.

    Raises InputError if the folder can not be written or is locked; an earlier table stays then.
    """
    check_writable(folder)
    folder.mkdir(parents=True, exist_ok=True)
    with locked_folder(folder):
        remove_tables(folder)
        yield


def folders_in(path: Path) -> set[str]:
    """Names of the folders in the table of a study of several cases; empty if there is none."""
    head_of_table = HEADS[path.name]
    try:
        if not path.is_file():
            return set()
        with path.open(newline="", encoding="utf-8", errors="replace") as file:
            head, *rows = csv.reader(file)
    except (OSError, ValueError, csv.Error):  # no line, or a foreign file
        return set()
    return {row[0] for row in rows if row} if head[: len(head_of_table)] == head_of_table else set()


def remove_tables(folder: Path, name: str = "") -> None:
    """Remove tables of studies of several cases; name: only those with a case of this folder."""
    for table in HEADS:
        listed = folders_in(folder / table)
        if name in listed if name else listed:
            (folder / table).unlink(missing_ok=True)


def scene_folder(case: Case, scene: Case, out: Path) -> Path:
    """Folder of a scene: out for the case's main scene, out/<uplift> for any other."""
    return out if scene["uplift"] == case["uplift"] else out / scene["uplift"]


def scene_folders(folder: Path) -> list[Path]:
    """Folders that further scenes of a case may have below its own."""
    return [folder / str(mode) for mode in declared()["uplift"].choices]


def read_info(folder: Path) -> dict[str, Any] | None:
    """Read run.json of a folder; None if there is none, or it is not of damjoint."""
    return read_record(folder / RECORD)


def read_record(file: Path) -> dict[str, Any] | None:
    """Read the record of a study; None if there is none, or it is not of damjoint."""
    try:
        info: dict[str, Any]
        info = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
        json.dumps(info, ensure_ascii=False).encode()  # a lone surrogate can not be printed
        return info if info["versions"]["damjoint"] and isinstance(info["case"], str) else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def clear(folder: Path) -> None:
    """Remove the results of an earlier run from a folder and those of its further scenes."""
    info = read_info(folder)
    if info is None:
        return
    for inner in scene_folders(folder):
        if inner.is_dir() and not inner.is_symlink():
            clear(inner)
            remove_if_empty(inner)
    fields = folder / "fields"
    if fields.is_dir() and not fields.is_symlink():
        for file in fields.iterdir():
            if re.fullmatch(FIELDS, file.name.removeprefix(PART)):
                file.unlink()
        remove_if_empty(fields)
    for name in (*(f"{info['case']}{end}.png" for end in PICTURES), *TABLES):  # run.json last
        if is_name(name):
            for prefix in (PART, ""):
                (folder / (prefix + name)).unlink(missing_ok=True)


def remove_if_empty(folder: Path) -> None:
    """Remove a folder if it is empty."""
    if not any(folder.iterdir()):
        folder.rmdir()


def write_state(
    name: str,
    record: Path,
    state: str,
    statement: str = "",
    entries: Mapping[str, Any] | None = None,
) -> None:
    """Create the folder of a case and write the run.json of a run without results: running,
    interrupted or failed, and why; entries: further ones.
    """
    record.parent.mkdir(parents=True, exist_ok=True)
    info = {"case": name, "state": state, "statement": statement}
    write_json(record, {**info, "versions": {"damjoint": __version__}, **(entries or {})})


def write_info(results: Results, folder: Path, state: str = "", why: str = "") -> None:
    """Write run.json: parameters, verdict, sizes, versions, seconds, memory, units of the tables.

    state, why: interrupted or failed, and the message; by default stopped or complete.
    """
    case = results.case
    write_json(
        folder / RECORD,
        {
            "case": case.name,
            "state": state or (STOPPED if results.stopped else COMPLETE),
            "verdict": state or verdict(results),
            "statement": why or statement(results),
            "hints": hints(results),
            **case_entries(case),
            **results.info,
            "units": {
                n: unit for n, (unit, _) in (joint_columns(case) | history_columns(case)).items()
            },
        },
    )


def case_entries(case: Case) -> dict[str, Any]:
    """The entries of run.json from which `post.stored` builds a case again."""
    return {
        "title": case.title,
        "parameters": case.values,
        **{name: getattr(case, name) for name in GEOMETRY_LISTS},
        "joints": [stored(case, joint) for joint in case.of_joints],
        "levels": case.levels,
        "tail_levels": case.tail_levels,
        "times": case.times,
        "geometry": str(case.geometry or ""),
        # a section by parameters is computed again
        "section": case.section if case.geometry else {},
        "published": case.published,
        "hardening_requested": case.hardening_requested,
    }


def stored(case: Case, joint: OfJoint) -> dict[str, Any]:
    """What run.json has of a joint; a section by parameters is computed again."""
    return asdict(joint) | {"section": joint.section if case.geometry else {}}


def write_json(record: Path, info: dict[str, Any]) -> None:
    """Write run.json."""
    with atomic_write(record) as path:
        path.write_text(json.dumps(info, indent=2) + "\n")
