"""The ONELAB tree: shows parameters, choices and results; reads the user's request.

Works on the current Gmsh session, with or without a window.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import operator
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import gmsh

from .. import InputError
from ..arrays import Setting
from ..dynamics.frames import MOST_FRAMES
from ..input.case import Case
from ..input.parameters import AUTOMATIC, GEOMETRY_LISTS, Parameter, levels_of
from ..input.refinement import ACCURACIES
from ..studies.quake import RUNNING
from . import views
from .scene import MOTIONS, SolvedScene
from .sheet import Request, Sheet
from .views import CONTENTS, FIELDS, Display

# Names in the tree. Digits order it and are not shown. The numbers of a run come last, below the
# parameters, which so stay where they are; Gmsh's own "0Modules" comes before these.
CASE = "00Case/0Case"
FILE = "00Case/1Case file"
STATUS = "01Run/00Status"
VERDICT = "01Run/01Verdict"
NUMBERS = "Results/1"
LEVELS = "Parameters/1Water levels/0Levels at t = 1, 2, ... [m]"
TAIL_LEVELS = "Parameters/1Water levels/1Tailwater [m]"
STEPS = "Parameters/1Water levels/2Steps between two levels"
TIMES = "Parameters/1Water levels/3Steps at t"
#: Switch of the earthquake; its group of parameters, with the record and the times shown.
QUAKE = "Parameters/0Scene/9Earthquake after the last level"
EARTHQUAKE = "Earthquake"
RECORD = "Parameters/91Earthquake/01Record: CSV file"
FRAMES = "Parameters/91Earthquake/02Show from : to [s]"
#: Parameters of other groups that an earthquake needs, too.
OF_EARTHQUAKE = "added_mass", "quake_uplift"
#: Heights of the lift joints; text of none.
LIFTS = "Parameters/2Geometry/26Lift joints above the first one [m]"
CORNERS = "Parameters/2Geometry/232Downstream face: x, y of corners, upwards [m]"
NONE_LISTED = "none"
#: Entries on the water levels.
OF_LEVELS = (LEVELS, TAIL_LEVELS, STEPS, TIMES)
ACCURACY = "Parameters/3Mesh/0Accuracy"
FIELD = "02Display/0Color of the bodies"
SCALES = "02Display/1Scales"
CONTENT = "02Display/2Show"
#: What is shown of a run: choosers in the order of `SolvedScene.choices`.
JOINT = "02Display/3Joint"
UPLIFT = "02Display/4Uplift"
MOTION = "02Display/5Motion"
CHOOSERS = JOINT, UPLIFT, MOTION
PLAY = "02Display/6Play all steps"
KEEP = "02Display/7Keep the last curves"
#: Groups of parameters that are closed at first, so that the results are not far below.
CLOSED = tuple(
    f"Parameters/{n}" for n in ("3Mesh", "4Bulk", "6Water", "7Loads", "8Solver", "9Checks")
)
FOLDER = "03Output/0Folder"
SAVE = "03Output/1Save"
PICTURE = "03Output/2Export picture"
ANIMATION = "03Output/3Export animation"

#: Actions of the buttons; "save" is Gmsh's own, for the database.
SAVE_ACTION, PICTURE_ACTION, ANIMATION_ACTION = "save results", "export picture", "export animation"
PLAY_ACTION = "play"
BUTTONS = (
    (PLAY, PLAY_ACTION, "show all steps with their numbers, one after the other; again: stop"),
    (SAVE, SAVE_ACTION, "tables, fields, picture and case file, into the folder"),
    (PICTURE, PICTURE_ACTION, "the drawing area as window.png, into the folder"),
    (ANIMATION, ANIMATION_ACTION, "all levels as window.gif, into the folder"),
)
#: Attributes of a button.
BUTTON = {"Macro": "Action", "Aspect": "Button"}
#: Choices: the case's own value; a case file of the user.
OWN, OPEN = "as the case", "open a case file ..."
#: Choice of the times of an earthquake that are shown.
WHOLE = "the whole record"

#: Verdict before a run.
NOT_RUN = "not run yet"

#: Colors of the status line.
CALM, GOOD, WARN, BAD = "LightSteelBlue1", "DarkSeaGreen1", "Orange", "LightCoral"
#: Color of the value of a parameter that follows others.
FOLLOWS = "LightGrey"


def put(*entries: dict[str, Any]) -> None:
    """Set ONELAB parameters; their groups stay open or closed."""
    for entry in entries:
        attributes = {**open_state(entry["name"]), **entry.get("attributes", {})}
        full = {"visible": True, "readOnly": False, **entry, "attributes": attributes}
        gmsh.onelab.set(json.dumps(full, ensure_ascii=False))


def open_state(name: str) -> dict[str, str]:
    """Attribute of an existing parameter on whether its group is closed."""
    with contextlib.suppress(ValueError, KeyError):
        return {"Closed": json.loads(gmsh.onelab.get(name))["attributes"]["Closed"]}
    return {}


def text(name: str, value: str, **more: Any) -> dict[str, Any]:
    """Entry of a text."""
    return {"type": "string", "name": name, "values": [value], **more}


def number(name: str, value: float, **more: Any) -> dict[str, Any]:
    """Entry of a number."""
    return {"type": "number", "name": name, "values": [float(value)], **more}


def get_text(name: str) -> str:
    """Read a text from the tree; empty if there is none."""
    return next(iter(gmsh.onelab.getString(name)), "").strip()


def get_number(name: str) -> float:
    """Read a number from the tree."""
    return float(gmsh.onelab.getNumber(name)[0])


def levels_text(levels: tuple[float, ...]) -> str:
    """Format levels as the user writes them."""
    return ", ".join(f"{v:.10g}" for v in levels)


def level_texts(case: Case) -> dict[str, str]:
    """Texts of the levels and tailwater levels of a case, by entry."""
    tails = case.tail_levels
    tails = tails[:1] if len(set(tails)) == 1 else tails
    return {LEVELS: levels_text(case.levels), TAIL_LEVELS: levels_text(tails)}


class Tree:
    """The current sheet in the tree, and the user's changes to it."""

    def __init__(self, titles: Mapping[str, str], known: Mapping[str, Parameter]) -> None:
        self.titles, self.known = titles, known
        self.short = short_labels(known)
        #: value of each parameter when it was last set: only what differs is a change of the user
        self.shown: dict[str, float | str] = {}
        #: the last checked sheet; None before the first one
        self.checked: Sheet | None = None
        #: entries of the fields as they were last set, by name; that with an error beside it
        self.fields: dict[str, dict[str, Any]] = {}
        self.marked = ""

    @property
    def sheet(self) -> Sheet:
        """The last checked sheet."""
        assert self.checked
        return self.checked

    def show(self, sheet: Sheet) -> None:
        """Put a sheet into the tree."""
        self.clear_error()
        new_case = not (self.checked and sheet.path == self.checked.path and get_text(SAVE))
        self.checked = sheet
        fields = [*self.scene_entries(sheet), *self.quake_entries(sheet)]
        fields += map(self.entry, sheet.entries)
        put(*fields)
        self.fields = {entry["name"]: entry for entry in fields}
        if new_case:
            put(
                text(FOLDER, str(Path("out") / sheet.case.name), help="folder that Save writes"),
                *display_entries(sheet.case),
                *(
                    text(name, action, help=note, attributes=BUTTON)
                    for name, action, note in BUTTONS
                ),
            )
        # read back, since the database may round a number
        self.shown = {e["name"]: value_of(e["name"]) for e in sheet.entries} | {
            name: value_of(name)
            for name in (CASE, FILE, LEVELS, TAIL_LEVELS, LIFTS, CORNERS, RECORD)
        }

    def scene_entries(self, sheet: Sheet) -> list[dict[str, Any]]:
        """Entries of case, water levels, steps and accuracy."""
        case, request = sheet.case, sheet.request
        menu = self.menu(sheet)
        texts = level_texts(case)
        times = ", ".join(f"{t:.4g}" for t in case.times)
        return [
            number(
                CASE,
                menu.index(self.title(request.case)),
                choices=list(range(len(menu))),
                valueLabels={title: index for index, title in enumerate(menu)},
                help="the modelings of SSNP142, your own dam, a case file",
            ),
            text(FILE, sheet.path, kind="file", help=f"{sheet.path}; choose one of your own"),
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
                LIFTS,
                levels_text(case.lift_heights) or NONE_LISTED,
                visible=not case.geometry,
                help=f"heights of their heels, from the lowest, or {NONE_LISTED}; values of each "
                "joint are set in a case file",
            ),
            text(
                CORNERS,
                levels_text(case.downstream_face) or NONE_LISTED,
                visible=not case.geometry,
                help="x, y of each corner between the base and the crest, from the lowest, or "
                f"{NONE_LISTED}: a straight face, or one with a neck",
            ),
            text(
                ACCURACY,
                request.accuracy or OWN,
                choices=[OWN, *ACCURACIES],
                help="coarse: 3 %, standard: 1 %, fine: 0.2 %, or any percentage; refines the mesh "
                "until the results' estimated error is smaller",
            ),
        ]

    def quake_entries(self, sheet: Sheet) -> list[dict[str, Any]]:
        """Entries of the earthquake: its switch, and what shows only with it."""
        request = sheet.request
        return [
            number(
                QUAKE,
                request.quake,
                choices=[0, 1],
                help="Run computes the static loads, then the record",
            ),
            text(
                RECORD,
                str(sheet.case.record or ""),
                kind="file",
                visible=request.quake,
                help="acceleration of the ground: time [s], horizontal and, if any, vertical",
            ),
            text(
                FRAMES,
                request.frames or WHOLE,
                choices=[WHOLE],
                visible=request.quake,
                help=f"FIRST:LAST, e.g. 2:5; up to {MOST_FRAMES} times between them are shown",
            ),
        ]

    def title(self, case: str) -> str:
        """Title of a case in the menu."""
        name = case.lower()
        if name not in self.titles:
            return Path(case).stem
        title = self.titles[name]
        return title if title.lower().startswith(f"{name}:") else f"{name}: {title}"

    def menu(self, sheet: Sheet) -> list[str]:
        """Entries of the menu of cases, in order, with that of an open case file."""
        titles = [self.title(name) for name in self.titles]
        title = self.title(sheet.request.case)
        return [*titles, *([] if title in titles else [title]), OPEN]

    def entry(self, declared: dict[str, Any]) -> dict[str, Any]:
        """Entry of a declared parameter; one that follows others shows the value that results.

        Has no step, and labels for its choices: else Gmsh shows buttons for loops, which have no
        effect.
        """
        parameter = next(p for p in self.known.values() if p.label == declared["name"])
        copied = "type", "name", "values", "visible", "choices"
        entry = {k: declared[k] for k in copied if k in declared}
        quake = self.sheet.request.quake
        if parameter.group == EARTHQUAKE:
            entry["visible"] = quake and declared["visible"]
        elif parameter.name in OF_EARTHQUAKE:
            entry["visible"] = quake or declared["visible"]
        elif parameter.of_joints:  # Gmsh knows the first joint only
            joints = self.sheet.case.joints
            entry["visible"] = any(parameter.matters_in(joint.values) for joint in joints)
        allowed = f"{parameter.name}: {parameter.allowed()}"
        note = declared.get("help", "") if not parameter.automatic else ""
        entry["help"] = ". ".join(filter(None, [allowed, parameter.meaning, note]))
        unit = f" [{parameter.unit}]" if parameter.unit not in ("", "-") else ""
        entry["label"] = self.short[parameter.name] + unit
        if values := self.of_joints(parameter):
            entry["label"] += f" = {values}"
            names = ", ".join(self.sheet.case.joint_names)
            entry["help"] += f". Values of {names}: {values}; one typed here is that of all joints"
        if parameter.text:
            return entry
        choices = declared.get("choices", [])
        if choices and choices != [0, 1]:
            labels = declared.get("valueLabels") or {f"{choice:g}": choice for choice in choices}
            entry["valueLabels"] = labels
        entry |= {
            "min": declared["min"],
            "max": declared["max"],
            "attributes": {"ReadOnlyRange": "1"},
        }
        if parameter.automatic and declared["values"][0] == AUTOMATIC:
            value = self.sheet.case[parameter.name]
            entry["values"] = [value]
            entry["label"] += ", follows"
            entry["help"] = f"{entry['help']} = {value:.6g} ({parameter.help})"
            entry["attributes"]["Highlight"] = FOLLOWS
        return entry

    def of_joints(self, parameter: Parameter) -> str:
        """The values of the joints, if the case sets some for itself; else empty."""
        source, name = self.sheet.case.source, parameter.name
        assert source  # the case has been loaded
        setting = {**source.text.of_joints, **source.overrides}.get(name)
        in_blocks = name in source.text.in_blocks and name not in source.overrides
        if not (isinstance(setting, tuple) or in_blocks):
            return ""
        values = (
            setting if isinstance(setting, tuple) else [j[name] for j in self.sheet.case.joints]
        )
        return ", ".join(v if isinstance(v, str) else f"{v:.6g}" for v in values)

    def request(self) -> Request:
        """Read the user's request; another case starts without changes.

        Raises InputError if no case file has been chosen yet.
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
        changed: dict[str, Setting] = {
            labels[label]: value_of(label)
            for label in labels
            if label in shown and value_of(label) != shown[label]
        }
        for name in GEOMETRY_LISTS:
            listed = get_text(FIELDS_OF_NAMES[name])
            if listed != shown[FIELDS_OF_NAMES[name]]:
                changed[name] = () if listed in (NONE_LISTED, "") else levels_of(name, listed)
        return replace(
            request,
            overrides={**request.overrides, **changed},
            levels=self.levels(LEVELS, request.levels),
            tail_levels=self.levels(TAIL_LEVELS, request.tail_levels),
            steps=chosen(STEPS, OWN),
            accuracy=chosen(ACCURACY, OWN),
            record=request.record if get_text(RECORD) == shown[RECORD] else get_text(RECORD),
            quake=bool(get_number(QUAKE)),
            frames=chosen(FRAMES, WHOLE),
        )

    def in_window_words(self, message: str) -> str:
        """A message on a value by its field's label, and beside the field; others as they are."""
        self.clear_error()
        match = re.fullmatch(ON_VALUE, message)
        names = FIELDS_OF_NAMES | {name: known.label for name, known in self.known.items()}
        name = names.get(match["name"], "") if match else ""
        if not match or name not in self.fields:
            return message
        self.marked, field, why = name, self.fields[name], match["why"]
        if match["name"] in self.known:  # its meaning is the label
            why = why.removesuffix(f" ({self.known[match['name']].meaning})")
        for words, of_window in WINDOW_WORDS.items():
            why = why.replace(words, of_window)
        label = shown_label(field)
        attributes = {**field.get("attributes", {}), "Highlight": BAD}
        changes = {"label": f"{label}: {why}", "help": why, "attributes": attributes}
        put({**field, "values": [value_of(name)], **changes})
        value = "" if match["value"] is None else f" = {match['value']}"
        return f"{label}{value}: {why}"

    def clear_error(self) -> None:
        """Remove the error beside a field."""
        if self.marked:
            field = self.fields[self.marked]
            put({"label": "", **field, "values": [value_of(self.marked)]})
        self.marked = ""

    def levels(self, name: str, before: str | None) -> str | None:
        """Read a list of levels; the earlier text if the numbers have not changed."""
        now = get_text(name).replace(";", ",")
        try:
            same = levels_of(name, now) == levels_of(name, self.shown[name])
        except InputError:  # reported when the case is loaded
            same = False
        return before if same else now


def chosen(name: str, default: str) -> str | None:
    """Read a text from the tree; None if it is empty or the default."""
    value = get_text(name)
    return None if value in ("", default) else value


def short_labels(known: Mapping[str, Parameter]) -> dict[str, str]:
    """Labels of parameters: their descriptions up to the first comma, unless two have the same."""
    short = {name: p.description.split(",")[0] for name, p in known.items()}
    labels = list(short.values())
    return {n: s if labels.count(s) == 1 else known[n].description for n, s in short.items()}


def value_of(name: str) -> float | str:
    """Read a parameter from the tree, a number or a text."""
    values = gmsh.onelab.getNumber(name)
    return float(values[0]) if len(values) else get_text(name)


def show_status(status: str, color: str) -> None:
    """Show the status line."""
    put(text(STATUS, status, readOnly=True, help=status, attributes={"Highlight": color}))


def show_verdict(name: str, color: str, why: str) -> None:
    """Show a verdict; why: its tooltip."""
    put(text(VERDICT, name, readOnly=True, help=why, attributes={"Highlight": color}))


def display_entries(case: Case) -> list[dict[str, Any]]:
    """Entries of what is shown of a case, each with its first choice."""
    choices = {
        FIELD: (FIELDS, "field of dam and foundation"),
        SCALES: (views.SCALES, "scales of curves and colors"),
        CONTENT: (CONTENTS, "drawing area"),
    }
    entries = [
        text(name, names[0], choices=list(names), help=note)
        for name, (names, note) in choices.items()
    ]
    uplifts = [case.of_all_joints("uplift"), *case.also_uplift]
    entries += choosers(list(itertools.product(case.joint_names, uplifts, MOTIONS[:1])), 0)
    help_of_keep = "curves of the last run stay in grey, its views in Modules / Post-processing"
    return [*entries, number(KEEP, 0, choices=[0, 1], help=help_of_keep)]


def choosers(choices: list[tuple[str, str, str]], shown: int) -> list[dict[str, Any]]:
    """Entries of joint, uplift and motion, of scenes with these choices."""
    notes = "whose curves and numbers are shown", "of both published ones", "loads or earthquake"
    listed = (list(dict.fromkeys(names)) for names in zip(*choices, strict=True))
    return [
        text(name, now, choices=names, help=note, readOnly=len(names) == 1)
        for name, now, names, note in zip(CHOOSERS, choices[shown], listed, notes, strict=True)
    ]


def display() -> Display:
    """What the user has chosen to see."""
    return Display(*(get_text(name) for name in (FIELD, SCALES, CONTENT)))


def show_results(scenes: list[SolvedScene], shown: int, step: int) -> None:
    """Show the results of a scene at a step: finite elements beside the gravity method."""
    scene = scenes[shown]
    color = WARN if scene.failed or scene.message else GOOD
    color = CALM if scene.end_state == RUNNING else color
    show_verdict(scene.end_state or scene.verdict, color, scene.statement)
    put(*choosers([s.choices for s in scenes], shown))
    show_numbers(scene, step)


def show_numbers(scene: SolvedScene, step: int) -> None:
    """Show the numbers of a scene at a step, and its warnings."""
    clear_numbers()
    if not scene.numbers:
        return
    rows = scene.numbers[step].rows()
    if joint := scene.result.case.named((scene.joint,)):
        rows.insert(0, ("Joint", joint, "whose numbers and curves are shown: Display / Joint"))
    entries = [(*row, "LightYellow") for row in rows]
    entries += [(f"Note {i + 1}", w, w, WARN) for i, w in enumerate(scene.warnings)]
    for i, (label, value, note, highlight) in enumerate(entries):
        more = {"help": note, "attributes": {"Highlight": highlight}}
        put(text(f"{NUMBERS}{i:02d}", value, label=label, readOnly=True, **more))


def clear_numbers() -> None:
    """Remove the numbers of a step from the tree."""
    for name in gmsh.onelab.getNames(f"{NUMBERS}.*"):
        gmsh.onelab.clear(name)


def hide_results() -> None:
    """Remove the results from the tree: they are not those of its parameters."""
    clear_numbers()
    show_verdict(NOT_RUN, CALM, "press Run")


def chosen_scene(scenes: list[SolvedScene]) -> int:
    """Index of the scene that the user has chosen: that with most of the choices."""
    chosen = [get_text(name) for name in CHOOSERS]
    alike = [sum(map(operator.eq, scene.choices, chosen)) for scene in scenes]
    return alike.index(max(alike))


def shown_label(entry: Mapping[str, Any]) -> str:
    """The label of an entry in the tree."""
    label: str = entry.get("label") or re.sub(r"^\d+", "", entry["name"].rsplit("/", 1)[-1])
    return label


#: A message on a value: of a joint, if there are several; name, value, what is allowed.
ON_VALUE = r"(?:[\w ]+: )?(?P<name>\w+)(?: = (?P<value>.*?))?: (?P<why>must .*)"
#: Words of the command line and of case files, and those of the window.
WINDOW_WORDS = {
    'must be set, record = "FILE.csv"; in the case, or --record FILE.csv': "must be chosen",
    " for damjoint quake": " for an earthquake",
}
#: What the window has in place of parameters, by the names in messages.
FIELDS_OF_NAMES = {
    "levels": LEVELS,
    "tail_levels": TAIL_LEVELS,
    "steps": STEPS,
    "lift_heights": LIFTS,
    "downstream_face": CORNERS,
    "accuracy": ACCURACY,
    "record": RECORD,
    "frames": FRAMES,
    "fields": FRAMES,
}


def drop_level_entries() -> None:
    """Remove the water levels that a .geo declares singly; in this tree they are lists."""
    for name in gmsh.onelab.getNames("Parameters/1Water levels/.*"):
        if name not in OF_LEVELS:
            gmsh.onelab.clear(name)
