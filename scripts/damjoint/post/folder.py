"""The folder of a run: run.json, and what an earlier run has left there.

Only files that carry a run's own names, beside a run.json that damjoint has written, are ever
removed.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
from collections.abc import Iterator
from pathlib import Path

from .. import InputError, __version__
from ..model.case import Case, is_name
from ..model.parameters import declared
from ..model.results import HISTORY, Results, joint_columns
from ..statics.verdict import hints, statement, verdict
from ..storage import PART, atomic_write, locked_folder

#: Names that a run writes, besides its pictures.
TABLES = ("joint.csv", "history.csv", "curve.csv", "gravity.csv", "critical.csv", "run.json")
FIELDS = re.compile(r"(bulk|joint)(_t[\w.+-]+\.vtu|\.msh)|fields\.pvd")


def check_writable(folder: Path) -> None:
    """Raise InputError if the output folder can not be made or written, or what stands in it would
    lead a run out of it; makes nothing.
    """
    existing = folder
    try:
        while not (existing.exists() or existing.is_symlink()):
            existing = existing.parent
        if not existing.is_dir() or not os.access(existing, os.W_OK | os.X_OK):
            raise InputError(f"out = {folder}: must be a folder that can be written")
        for name in ("fields", *declared()["uplift"].choices):
            inner = folder / name
            if inner.is_symlink() or (inner.exists() and not inner.is_dir()):
                raise InputError(f"out = {folder}: its {name} must be a folder, and not a link")
        for name in TABLES:
            if (folder / name).exists() and not (folder / name).is_file():
                raise InputError(f"out = {folder}: its {name} must be a file")
    except OSError as error:  # too long a name, a circle of links
        raise InputError(f"out = {folder}: {error.strerror}") from None


@contextlib.contextmanager
def taken(case: Case, folder: Path) -> Iterator[None]:
    """Take a folder for a run of a case, in place of an earlier one's results.

    Raises InputError if that can not be, and leaves an earlier run as it is.
    """
    check_writable(folder)
    folder.mkdir(parents=True, exist_ok=True)
    with locked_folder(folder):
        clear(folder)
        say(case, folder, "running")
        yield


def scene_folder(case: Case, scene: Case, out: Path) -> Path:
    """Where a scene's files go: the case's main scene into out, any further one into
    out/<uplift>.
    """
    return out if scene["uplift"] == case["uplift"] else out / scene["uplift"]


def earlier(folder: Path) -> dict | None:
    """The run.json of an earlier run in this folder; None if there is none that damjoint has
    written.
    """
    file = folder / "run.json"
    try:
        told = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
        json.dumps(told, ensure_ascii=False).encode()  # half of a letter can not be printed
        return told if told["versions"]["damjoint"] and isinstance(told["case"], str) else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def clear(folder: Path) -> None:
    """Remove what an earlier run has left in a folder, and below it in the folders of further
    scenes.
    """
    told = earlier(folder)
    for name in declared()["uplift"].choices:  # where further scenes of a case go
        if told is not None and (folder / name).is_dir() and not (folder / name).is_symlink():
            clear(folder / name)
            remove_if_empty(folder / name)
    if told is None:
        return
    pictures = ("", "_curve", "_check", "_critical")
    names = [*TABLES, *(f"{told['case']}{end}.png" for end in pictures)]
    for name in names:
        if is_name(name):
            for mark in ("", PART):
                (folder / (mark + name)).unlink(missing_ok=True)
    fields = folder / "fields"
    if fields.is_dir() and not fields.is_symlink():
        for file in fields.iterdir():
            if FIELDS.fullmatch(file.name.removeprefix(PART)):
                file.unlink()
        remove_if_empty(fields)


def remove_if_empty(folder: Path) -> None:
    """Remove a folder that has nothing in it."""
    if not any(folder.iterdir()):
        folder.rmdir()


def say(case: Case, folder: Path, state: str, statement: str = "") -> None:
    """Make the folder of a case and say in its run.json how far a run is that has no results yet:
    running, interrupted or failed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    told = {"case": case.name, "state": state, "statement": statement}
    write_json(folder, told | {"versions": {"damjoint": __version__}})


def write_info(results: Results, folder: Path, state: str = "", why: str = "") -> None:
    """Write run.json: parameters, verdict, sizes, versions, seconds, memory, units of the tables.

    state: interrupted or failed, and why; else it is stopped or complete.
    """
    case = results.case
    write_json(
        folder,
        {
            "case": case.name,
            "title": case.title,
            "state": state or ("stopped" if results.stopped else "complete"),
            "verdict": state or verdict(results),
            "statement": why or statement(results),
            "hints": hints(results),
            "parameters": case.values,
            "levels": case.levels,
            "tail_levels": case.tail_levels,
            "times": case.times,
            "geometry": str(case.geometry or ""),
            "section": case.section if case.geometry else {},  # else it follows from parameters
            "published": case.published,
            "hardening_asked": case.hardening_asked,
            **results.info,
            "units": {n: unit for n, (unit, _) in (joint_columns(case) | HISTORY).items()},
        },
    )


def write_json(folder: Path, told: dict) -> None:
    """Write run.json."""
    with atomic_write(folder / "run.json") as path:
        path.write_text(json.dumps(told, indent=2) + "\n")
