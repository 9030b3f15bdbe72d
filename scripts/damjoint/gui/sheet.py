"""Requests of the window's user, and the checked case with its parameters for the tree.

Loading a case empties the ONELAB database: only for the engine's process, not for the window's.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import gmsh

from .. import InputError
from ..accuracy import REFINED
from ..arrays import Setting, Settings
from ..input import casefile
from ..input.case import Case
from ..input.case_names import CASES, case_file
from ..input.parameters import (
    GEOMETRY_LISTS,
    INCLUDE,
    assignments,
    checked,
    declared,
    listing,
    parse_by_gmsh,
)
from ..input.refinement import first_mesh
from ..input.resolve import load
from ..input.written_case import add_settings, text_with_loading
from ..studies import quake
from ..studies.quake import Span


@dataclass(frozen=True)
class Request:
    """A case (letter, name or path) and the user's changes to it.

    levels, tail_levels: 'a,b,c' [m]; steps: equal steps between two levels; accuracy: coarse,
    standard, fine or a percentage; record: path of a record. None: the case's own. quake: whether
    the record follows the last level; frames: FIRST:LAST [s] of what is shown of it, None: all.
    """

    case: str
    overrides: Settings = field(default_factory=dict)
    levels: str | None = None
    tail_levels: str | None = None
    steps: str | None = None
    accuracy: str | None = None
    record: str | None = None
    quake: bool = False
    frames: str | None = None

    @property
    def span(self) -> Span:
        """`frames` as numbers. Raises InputError."""
        return quake.span_of("frames =", self.frames) if self.frames else None

    def load(self) -> Case:
        """Load the case as `damjoint run` or, with the record, `damjoint quake` does.

        Raises InputError.
        """
        if self.steps is not None and not self.steps.isdigit():
            raise InputError(f"steps = {self.steps}: must be an integer >= 1")
        steps = None if self.steps is None else int(self.steps)
        water = self.levels, self.tail_levels, steps, self.accuracy
        return load(self.case, self.overrides, *water, Path(self.record) if self.record else None)


#: Parameters that the titles of the package's cases mention.
TITLED = {"law", "uplift", "dim", "order", "mesh_pattern", "drive"}


@dataclass(frozen=True)
class Sheet:
    """A checked request with its case and the tree's entries."""

    request: Request
    case: Case
    #: declared ONELAB parameters, with values before -1 is resolved and visibility in this scene
    entries: list[dict[str, Any]]
    #: path of the case file
    path: str

    @property
    def problem(self) -> str:
        """Why its earthquake can not be computed: its fields show nevertheless; else empty."""
        try:
            if self.request.quake:
                quake.check(self.case, self.request.span)
        except InputError as error:
            return str(error)
        return ""

    @property
    def heading(self) -> tuple[str, str]:
        """Title of the case, and its joint law and uplift.

        A title that may mention a parameter that was changed is replaced by the case's name.
        """
        case, title = self.case, self.case.title
        if TITLED & set(self.request.overrides):
            title = f"case {case.name}, changed"
        water = " and ".join([case.of_all_joints("uplift"), *case.also_uplift])
        scene = f"law {case.of_all_joints('law')}, uplift {water}"
        record = case.record if self.request.quake else None
        return title, f"{scene}, {record.name}" if record else scene


def check_request(request: Request) -> Sheet:
    """Check a request and load its case.

    Values equal to the case's own are no changes: a case published with two uplifts keeps both.
    Raises InputError.
    """
    path = case_file(request.case)
    unchanged = Request(request.case, accuracy=request.accuracy)
    fill_database(unchanged, unchanged.load())
    case_values = {name: gmsh_value(declared()[name].label) for name in declared()}
    file = casefile.read(path)
    changes = {
        n: v
        for n, v in request.overrides.items()
        if n in file.of_joints or n in file.in_blocks or v != case_values.get(n)
    }
    request = replace(request, overrides=changes)
    case = request.load()
    fill_database(request, case)
    # one by one: Gmsh does not escape quotes, which may occur in paths among its own entries
    entries = [json.loads(gmsh.onelab.get(known.label)) for known in declared().values()]
    return Sheet(request, case, entries, str(path))


def fill_database(request: Request, case: Case) -> None:
    """Put a request that gives a case into the ONELAB database, with the first joint's values."""
    file = casefile.read(case_file(request.case))
    settings: dict[str, Setting] = {**file.defaults, **file.of_joints}
    settings |= first_block(case)
    settings |= first_mesh(case) if request.accuracy else {}
    settings |= {name: checked(name, value) for name, value in request.overrides.items()}
    for name in GEOMETRY_LISTS:
        settings.pop(name, None)
    first = {n: v[0] if isinstance(v, tuple) else v for n, v in settings.items()}
    lists = listing("levels", case.levels) + listing("times", case.times)
    if case.downstream_face:
        lists += listing("downstream_face", case.downstream_face)
    parse_by_gmsh(assignments(first) + lists + INCLUDE)


def first_block(case: Case) -> dict[str, Setting]:
    """What the first joint of a case has for itself in its file."""
    source = case.source
    if not source or not source.text.blocks:
        return {}
    if case.geometry:  # the mesh has the names of the joints
        return {n: case.values[n] for n in source.text.in_blocks if n not in source.overrides}
    return {**source.blocks(case.joint_names).get(casefile.block_name(case.joint_names[0]), {})}


def gmsh_value(label: str) -> float | str:
    """Value of a parameter in the ONELAB database after parsing."""
    numbers = gmsh.onelab.getNumber(label)
    return float(numbers[0]) if len(numbers) else gmsh.onelab.getString(label)[0]


def titles() -> dict[str, str]:
    """Menu of cases: title by name, the modelings of SSNP142 (one letter) first."""
    cases = {p.stem: casefile.read(p).texts["title"] for p in sorted(CASES.glob("*.case"))}
    cases.pop("ssnp142", None)  # common part of the modelings
    return dict(sorted(cases.items(), key=lambda item: (len(item[0]), item)))


def case_text(sheet: Sheet, run: Case) -> str:
    """Write the case file that repeats a run, with all that differs from the declared defaults.

    run: the case as solved, on the mesh that its accuracy requires.
    """
    case, request = sheet.case, sheet.request
    file = casefile.read(case_file(request.case))
    file.defaults |= first_mesh(case) if request.accuracy else {}
    add_settings(file, request.overrides)
    file.defaults |= {name: run[name] for name in REFINED} if request.accuracy else {}
    return text_with_loading(file, case, run.joint_names)
