"""What a request from the window comes to: a checked case, and its parameters for the tree.

Works where Gmsh's parser may be used freely (reading a case empties the ONELAB database): in the
engine's process, not in the window's.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import gmsh

from .. import InputError
from ..accuracy import REFINED
from ..model import casefile
from ..model.case import CASES, Case, case_file, first_mesh, load
from ..model.parameters import declared


@dataclass(frozen=True)
class Request:
    """What the user asks for: a case (letter, name or path) and what differs from it.

    levels, tail_levels: 'a,b,c' [m]; steps: equal steps between two levels; accuracy: coarse,
    standard, fine or a percentage. None: the case's own.
    """

    case: str
    overrides: Mapping[str, float | str] = field(default_factory=dict)
    levels: str | None = None
    tail_levels: str | None = None
    steps: str | None = None
    accuracy: str | None = None

    def load(self) -> Case:
        """The case, as `damjoint run` reads it.

        Raises InputError.
        """
        if self.steps is not None and not self.steps.isdigit():
            raise InputError(f"steps = {self.steps}: must be an integer >= 1")
        steps = None if self.steps is None else int(self.steps)
        return load(self.case, self.overrides, self.levels, self.tail_levels, steps, self.accuracy)


#: What the titles of cases tell of.
TITLED = {"law", "uplift", "dim", "order", "mesh_pattern", "drive"}


@dataclass(frozen=True)
class Sheet:
    """A request that has been checked: the case it comes to, and what the tree shows of it."""

    request: Request
    case: Case
    #: ONELAB parameters as the declarations have them, with their values before -1 is resolved,
    #: and whether they matter in this scene
    entries: list[dict]
    #: path of the case file
    path: str

    @property
    def heading(self) -> tuple[str, str]:
        """What the case is called, and its joint law and water.

        Of a title that tells of more ("C: friction, 2D"), the name, once that has been changed.
        """
        case, title = self.case, self.case.title
        if TITLED & set(self.request.overrides):
            title = f"{title.partition(':')[0]}, changed"
        water = " and ".join([case["uplift"], *case.also_uplift])
        return title, f"law {case['law']}, uplift {water}"


def fill(request: Request) -> Sheet:
    """Check a request.

    Values that are the case's own count as not asked for: a case that is published with two uplifts
    keeps both. Raises InputError.
    """
    path = case_file(request.case)
    declared()
    replace(request, overrides={}, levels=None, tail_levels=None, steps=None).load()
    own = {name: gmsh_value(declared()[name].label) for name in declared()}
    asked = {n: v for n, v in request.overrides.items() if v != own[n]}
    request = replace(request, overrides=asked)
    case = request.load()
    # one by one: Gmsh does not mask quotes, which paths among its own entries may have
    entries = [json.loads(gmsh.onelab.get(known.label)) for known in declared().values()]
    return Sheet(request, case, entries, str(path))


def gmsh_value(label: str) -> float | str:
    """The value that the parser has left in the ONELAB database."""
    numbers = gmsh.onelab.getNumber(label)
    return float(numbers[0]) if len(numbers) else gmsh.onelab.getString(label)[0]


def titles() -> dict[str, str]:
    """The menu of cases: {name: what it is}, the verification's modelings first."""
    found = {p.stem: casefile.read(p).texts["title"] for p in sorted(CASES.glob("*.case"))}
    found.pop("ssnp142", None)  # what the modelings share, and no modeling
    return dict(sorted(found.items(), key=lambda item: (len(item[0]), item)))


def case_text(sheet: Sheet, run: Case) -> str:
    """The case file that repeats a request, all that differs from the declarations' defaults; run:
    the case as it was solved, on the mesh that its accuracy has asked for.
    """
    case, request = sheet.case, sheet.request
    said = casefile.read(case_file(request.case))
    said.defaults |= first_mesh(case) if request.accuracy else {}
    said.defaults |= request.overrides
    said.defaults |= {name: run[name] for name in REFINED} if request.accuracy else {}
    said.texts = {"title": case.title}
    if case.also_uplift:
        said.texts["also_uplift"] = " ".join(case.also_uplift)
    said.lists = {
        "levels": list(case.levels),
        "tail_levels": list(case.tail_levels),
        "times": list(case.times),
    }
    return casefile.written(said)
