"""The ONELAB tree: parameters, choices and results shown in it; what the user asks for read back.

Works on the current Gmsh session, with or without a window.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import gmsh
import numpy as np

from .. import InputError
from ..model.case import ACCURACIES, Case, numbers
from ..model.parameters import AUTOMATIC, Parameter
from ..statics.verdict import verdict
from .sheet import Request, Sheet
from .worker import Scene

# Names in the tree. Digits order it and are not shown; Gmsh's own "0Modules" comes after results.
CASE = "00Case/0Case"
FILE = "00Case/1Case file"
STATUS = "01Results/00Status"
VERDICT = "01Results/01Verdict"
SCENE = "01Results/02Scene shown"
LEVELS = "Parameters/1Water levels/0Levels, reached at t = 1, 2, ... [m]"
TAIL_LEVELS = "Parameters/1Water levels/1Tailwater, one or as many [m]"
STEPS = "Parameters/1Water levels/2Steps between two levels"
TIMES = "Parameters/1Water levels/3Converged steps at t"
#: What the tree has of the water levels.
OF_LEVELS = (LEVELS, TAIL_LEVELS, STEPS, TIMES)
ACCURACY = "Parameters/3Mesh/0Accuracy"
FOLDER = "Parameters/8Output/0Folder"
KEEP = "Parameters/8Output/1Keep the last views for comparison"
SAVE = "Parameters/8Output/2Save tables, fields, picture and case file"

#: The action that its button tells; Gmsh's own "save" is of the database.
SAVE_ACTION = "save results"
#: What stands for "as the case has it" among choices, and for the choice of a case file.
OWN, OPEN = "as the case", "open a case file ..."

#: The verdict of what has not been run.
NOT_RUN = "not run yet"

#: Colors of the status line.
CALM, GOOD, WARN, BAD = "LightSteelBlue1", "DarkSeaGreen1", "Orange", "LightCoral"

#: Results by column of history.csv: name in the tree; empty where the scene has none.
RESULTS = {
    "level": "Water level [m]",
    "tail_level": "Tailwater level [m]",
    "max_opening": "Largest opening [m]",
    "crack_length": "Crack length [m]",
    "process_zone": "Fracture process zone, softening [m]",
    "slip_length": "Slipped length [m]",
    "crest_ux": "Crest movement, downstream > 0 [m]",
    "N": "Normal force N, effective [N per m]",
    "T": "Shear force T [N per m]",
    "M": "Moment M about the toe [N m per m]",
    "U": "Uplift U [N per m]",
    "x_resultant": "Resultant from the heel [m]",
    "flux": "Leakage [kg per m s]",
}


def put(*entries: dict) -> None:
    """Set ONELAB parameters; whether the user has closed their group is kept."""
    for entry in entries:
        told = {"visible": True, "readOnly": False, **entry}
        told["attributes"] = {**opened(entry["name"]), **entry.get("attributes", {})}
        gmsh.onelab.set(json.dumps(told, ensure_ascii=False))


def opened(name: str) -> dict[str, str]:
    """Whether the group of a parameter that is there has been closed or opened by the user."""
    with contextlib.suppress(ValueError, KeyError):
        return {"Closed": json.loads(gmsh.onelab.get(name))["attributes"]["Closed"]}
    return {}


def text(name: str, value: str, **more: object) -> dict:
    """A text parameter."""
    return {"type": "string", "name": name, "values": [value], **more}


def number(name: str, value: float, **more: object) -> dict:
    """A number."""
    return {"type": "number", "name": name, "values": [float(value)], **more}


def get_text(name: str) -> str:
    """The text that stands in the tree; empty if there is none."""
    return next(iter(gmsh.onelab.getString(name)), "").strip()


def get_number(name: str) -> float:
    """The number that stands in the tree."""
    return float(gmsh.onelab.getNumber(name)[0])


def listed(levels: tuple[float, ...]) -> str:
    """Levels as the user writes them."""
    return ", ".join(f"{v:.10g}" for v in levels)


def level_texts(case: Case) -> dict[str, str]:
    """Levels and tailwater of a case in the tree."""
    tails = case.tail_levels
    tails = tails[:1] if len(set(tails)) == 1 else tails
    return {LEVELS: listed(case.levels), TAIL_LEVELS: listed(tails)}


class Tree:
    """The parameters of one sheet after the other, and what the user has made of them."""

    def __init__(self, titles: Mapping[str, str], known: Mapping[str, Parameter]) -> None:
        self.titles, self.known = titles, known
        #: what each parameter showed when it was last set: only what differs was asked for
        self.shown: dict[str, float | str] = {}
        self.sheet: Sheet | None = None

    def show(self, sheet: Sheet) -> None:
        """Put a sheet into the tree."""
        other = self.sheet is None or sheet.path != self.sheet.path or not get_text(SAVE)
        self.sheet = sheet
        case, request = sheet.case, sheet.request
        menu = self.menu(sheet)
        texts = level_texts(case)
        times = ", ".join(f"{t:.4g}" for t in case.times)
        put(
            number(
                CASE,
                menu.index(self.title(request.case)),
                choices=list(range(len(menu))),
                valueLabels={title: place for place, title in enumerate(menu)},
                help="the modelings of SSNP142, your own dam, a case file",
            ),
            text(FILE, sheet.path, kind="file", help="choose a case file of your own"),
            text(
                LEVELS,
                texts[LEVELS],
                help="level number i is reached at t = i, from 0 at t = 0; may go down, too",
            ),
            text(TAIL_LEVELS, texts[TAIL_LEVELS], help="one level, or as many as levels"),
            text(
                STEPS,
                request.steps or OWN,
                choices=[OWN, "1", "2", "5", "10"],
                help=f'equal steps between two levels, or "{OWN}"',
            ),
            text(TIMES, times, readOnly=True, help=f"t = {times}"),
            text(
                ACCURACY,
                request.accuracy or OWN,
                choices=[OWN, *ACCURACIES],
                help="coarse: 3 %, standard: 1 %, fine: 0.2 %, or any percentage; refines the mesh "
                "until the results' estimated error is smaller",
            ),
            *map(self.entry, sheet.entries),
        )
        if other:
            put(
                text(FOLDER, str(Path("out") / case.name), help="where Save writes"),
                number(KEEP, 0, choices=[0, 1], help="views of the last run stay beside the new"),
                text(SAVE, SAVE_ACTION, attributes={"Macro": "Action", "Aspect": "Button"}),
            )
        # read back, since the database may round a number
        self.shown = {e["name"]: value_of(e["name"]) for e in sheet.entries} | {
            name: value_of(name) for name in (CASE, FILE, LEVELS, TAIL_LEVELS, STEPS, ACCURACY)
        }

    def title(self, case: str) -> str:
        """How a case is called in the menu."""
        name = case.lower()
        if name not in self.titles:
            return Path(case).stem
        said = self.titles[name]
        return said if said.lower().startswith(f"{name}:") else f"{name}: {said}"

    def menu(self, sheet: Sheet) -> list[str]:
        """The entries of the menu of cases, in order; a file's case is there while it is open."""
        own = [self.title(name) for name in self.titles]
        title = self.title(sheet.request.case)
        return [*own, *([] if title in own else [title]), OPEN]

    def entry(self, told: dict) -> dict:
        """A declared parameter as the window shows it.

        Without a step or bare choices: Gmsh's buttons for loops, which would do nothing, are off
        then. One that follows others says what, and its value.
        """
        parameter = next(p for p in self.known.values() if p.label == told["name"])
        entry = {k: told[k] for k in ("type", "name", "values", "visible", "choices") if k in told}
        allowed = f"{parameter.name}: {parameter.allowed()}"
        note = told.get("help", "") if not parameter.automatic else ""
        entry["help"] = f"{allowed}. {note}" if note else allowed
        entry["label"] = parameter.meaning
        if parameter.text:
            return entry
        choices = told.get("choices", [])
        if choices and choices != [0, 1]:
            labels = told.get("valueLabels") or {f"{choice:g}": choice for choice in choices}
            entry["valueLabels"] = labels
        entry |= {"min": told["min"], "max": told["max"], "attributes": {"ReadOnlyRange": "1"}}
        if parameter.automatic and told["values"][0] == AUTOMATIC:
            value = self.sheet.case[parameter.name]
            entry["label"] = (
                f"{parameter.name} = {value:.6g} ({parameter.help}): {parameter.meaning}"
            )
        return entry

    def asked(self) -> Request:
        """What the user asks for now.

        Another case starts afresh. Raises InputError where no case has been chosen yet.
        """
        request, shown = self.sheet.request, self.shown
        case, file = get_number(CASE), get_text(FILE)
        if file not in (shown[FILE], ""):
            return Request(file)
        if case != shown[CASE]:
            names = list(self.titles)
            if case < len(names):
                return Request(names[int(case)])
            if self.menu(self.sheet)[int(case)] == OPEN:
                raise InputError("case file: choose it in the field Case file, below the menu")
        labels = {parameter.label: name for name, parameter in self.known.items()}
        changed = {
            labels[label]: value_of(label)
            for label in labels
            if label in shown and value_of(label) != shown[label]
        }
        return replace(
            request,
            overrides={**request.overrides, **changed},
            levels=self.levels(LEVELS, request.levels),
            tail_levels=self.levels(TAIL_LEVELS, request.tail_levels),
            steps=None if get_text(STEPS) in ("", OWN) else get_text(STEPS),
            accuracy=None if get_text(ACCURACY) in ("", OWN) else get_text(ACCURACY),
        )

    def levels(self, name: str, before: str | None) -> str | None:
        """A list of levels: what was asked before, unless the numbers have changed."""
        now = get_text(name).replace(";", ",")
        try:
            same = numbers(name, now) == numbers(name, self.shown[name])
        except InputError:  # said when the case is read
            same = False
        return before if same else now


def value_of(name: str) -> float | str:
    """The value of a parameter in the tree, a number or a text."""
    found = gmsh.onelab.getNumber(name)
    return float(found[0]) if len(found) else get_text(name)


def say(status: str, color: str) -> None:
    """Put a line into the status."""
    put(text(STATUS, status, readOnly=True, help=status, attributes={"Highlight": color}))


def show_verdict(said: str, color: str, why: str) -> None:
    """Put a verdict into the tree; why: in words, for its tooltip."""
    put(text(VERDICT, said, readOnly=True, help=why, attributes={"Highlight": color}))


def show_results(scenes: list[Scene], shown: int) -> None:
    """Put a scene's results into the tree: the last step's, all steps' as their range."""
    scene = scenes[shown]
    result, history = scene.result, scene.result.history
    said = scene.said or "the dam stands"
    color = WARN if scene.failed or scene.said else GOOD
    modes = [s.result.case["uplift"] for s in scenes]
    show_verdict(scene.ended or verdict(result), color, said)
    put(
        text(
            SCENE,
            modes[shown],
            choices=modes,
            visible=len(modes) > 1,
            label="Water in the joint: scene shown",
        ),
    )
    for i, (column, name) in enumerate(RESULTS.items()):
        values = history[column]
        there = len(values) > 0 and bool(np.isfinite(values[-1]))
        if column in ("tail_level", "U", "flux", "process_zone"):  # only where there is one
            there = there and bool(np.any(values != 0))
        put(
            number(
                f"01Results/{10 + i}{name}",
                values[-1] if there else 0,
                choices=[float(v) for v in values] if there else [],
                readOnly=True,
                visible=there,
                attributes={"Highlight": "LightYellow", "NumberFormat": "%.6g"},
            )
        )


def hide_results() -> None:
    """Take the results of an earlier run out of the tree: what it asks for has not been run."""
    for name in gmsh.onelab.getNames("01Results/.*"):
        if name not in (STATUS, VERDICT):
            gmsh.onelab.clear(name)
    show_verdict(NOT_RUN, CALM, "press Run")


def chosen_scene(scenes: list[Scene]) -> int:
    """Which of the scenes the user wants to see."""
    modes = [scene.result.case["uplift"] for scene in scenes]
    mode = get_text(SCENE)
    return modes.index(mode) if mode in modes else 0


def drop_plain_levels() -> None:
    """Drop the water levels of the plain problem definition, one entry each, which a .geo brings
    along: here they are lists.
    """
    for name in gmsh.onelab.getNames("Parameters/1Water levels/.*"):
        if name not in OF_LEVELS:
            gmsh.onelab.clear(name)
