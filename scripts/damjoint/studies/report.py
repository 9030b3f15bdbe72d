"""Report of runs: an HTML page or a PDF made from the files in their folders."""

from __future__ import annotations

import csv
import logging
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from matplotlib.figure import Figure

from .. import ROUND_OFF, InputError, RunError, __version__
from ..dynamics.record_files import STANDARD_GRAVITY
from ..input.case import Case
from ..input.case_names import is_name
from ..input.values import flows_in_time
from ..model.fields import Solution
from ..model.results import Info, Results
from ..pictures import run_picture
from ..pictures.drawing import figure_of, picture_style
from ..pictures.report_picture import Picture, bands, embedded
from ..post import stored
from ..post.folder import HEADS, read_info
from ..post.summary import Table, formatted_table, joints_note, joints_table, levels_table
from ..post.validation import shown_time
from ..statics.gravity import GravityMethod
from ..statics.rigid_block import force, resultant_of
from ..statics.verdict import stiffness_ratio
from ..storage import atomic_write
from ..units import FORCES, METRES, MOMENTS, NUMBER, Units, unit, unit_of_time
from . import body_stress, report_input, report_quake, report_studies
from .check import (
    FAIL,
    NOT_JUDGED,
    REQUIRED,
    UNCHECKED,
    MethodResult,
    SafetyCheck,
    common_notes,
    compare_joints,
    hand_calculation,
    required_by_case,
    requirements,
    worst_verdict,
)
from .check_tables import SHOWN
from .report_input import Entry, by_runs, in_table
from .report_studies import StudySection

#: Sizes of the pictures [inches]: half of the page's width; its width; its width, in 3D.
HALF, WIDE, SOLID = (5.2, 4.9), (10.6, 2.1), (10.6, 4.4)
#: That of the stress, and height of the curves of one of several joints.
STRESS, PER_JOINT = (10.6, 4.2), 1.35
#: Highest pressure in a joint over that of the water outside, above which water is shut in [-].
SHUT_IN = 1.01
MINUTE = "%Y-%m-%d %H:%M"
#: A column for `formatted_table`: heading, values, units.
Column = tuple[str, np.ndarray, Units]
MILLIMETRES: Units = (("mm", 1e3),)

#: Columns of the summary: name, heading, units. A column without values is left out.
SUMMARY: tuple[tuple[str, str, Units], ...] = (
    ("level", "level", METRES),
    ("tail_level", "tailwater", METRES),
    ("N", "N'", FORCES),
    ("T", "T", FORCES),
    ("x_resultant", "N' at x", METRES),
    ("crack_length", "crack", METRES),
    ("SSF", "SSF", NUMBER),
    ("SSF_gravity", "SSF gravity", NUMBER),
    ("SSF_required", "SSF required", NUMBER),
    ("OSF", "OSF", NUMBER),
    ("OSF_gravity", "OSF gravity", NUMBER),
    ("OSF_required", "OSF required", NUMBER),
)


@dataclass(frozen=True)
class JointSection:
    """A joint in the report."""

    #: its name, as the start of a heading; empty if there is only one
    name: str
    #: at the requested levels, by finite elements
    levels: Table
    #: of the gravity method; None for a user's own geometry
    loads: Table | None
    formulas: list[str]


@dataclass(frozen=True)
class RunSection:
    """A run in the report."""

    number: int
    folder: str
    title: str
    scene: str
    uplift: str
    #: time of the run
    made: str
    #: pass, fail, not judged or not checked
    verdict: str
    #: verdict of the run itself: stands, sliding, ...
    run_verdict: str
    failures: list[str]
    #: hints on the result, critical value, discretisation error
    hints: list[str]
    pictures: list[Picture]
    joints: list[JointSection]
    #: several joints at the last level; else None
    of_joints: Table | None
    #: on that table; may be empty
    joints_note: str
    #: of `damjoint quake`; else None
    earthquake: report_quake.Earthquake | None
    #: of `damjoint calibrate`, else empty: sentences, tables by their headings
    calibration: tuple[list[str], dict[str, Table]]
    #: by their headings: flow in time, calibration, if they were drawn
    further: dict[str, Picture]
    #: level of the last state, as text; the same with what it is, of an earthquake
    level: str
    state: str
    #: both methods
    methods: Table
    #: notes on the comparison of both methods
    notes: list[str]
    #: of the bodies, at the last level
    stress: Stress
    #: values of the columns SUMMARY of each joint, by its name
    summary: dict[str, dict[str, float]]
    #: mesh, steps, engine: text by heading
    computation: dict[str, str]
    #: error of the mesh, as far as it is known
    error: str
    materials: dict[str, Entry]
    other_input: dict[str, Entry]
    limits: list[str]
    #: versions and machine by name
    versions: dict[str, str]


@dataclass(frozen=True)
class Stress:
    """Stress in the bodies of a run: pictures, tables, and what is missing."""

    pictures: list[Picture]
    tables: list[Table]
    note: str


def write(folders: list[Path], to: Path, dam: str = "") -> None:
    """Write the report on the runs in folders, those of their further scenes included: a PDF if its
    name ends in .pdf, else HTML. dam: its name, by default the title of the runs.

    A folder of `damjoint check` has a run per load combination; that of a reliability, or the CSV
    file of a sweep with its fragility, is a study. Raises InputError if a folder is
    not that of a run, or the file can not be written; RunError if weasyprint is not installed.
    """
    rendered = renderer(to)
    paths = list[Path]()
    for folder in folders:
        runs = (run for part in parts_of(folder) for run in stored.runs_in(part))
        paths += [folder] if is_study(folder) else runs
    if to.is_dir() or to.suffix.lower() not in (".html", ".pdf"):
        raise InputError(f"to = {to}: must be a file that ends in .html or .pdf")
    sections = [
        report_studies.read(path, number) if is_study(path) else read_section(path, number)
        for number, path in enumerate(paths, start=1)
    ]
    page = rendered(page_of(sections, dam))
    try:
        with atomic_write(to) as path:
            path.write_bytes(page)
    except OSError as error:
        raise InputError(f"to = {to}: must be a writable file ({error.strerror})") from None


def renderer(to: Path) -> Callable[[str], bytes]:
    """Return the function that converts the HTML page to the content of a file.

    Raises RunError if it is a PDF and weasyprint is not installed.
    """
    if to.suffix.lower() != ".pdf":
        return str.encode
    try:
        import weasyprint
    except (ImportError, OSError) as error:  # OSError: without the library Pango
        reason = str(error).splitlines()[0]
        raise RunError(
            f"to = {to}: a PDF needs weasyprint ({reason}): pip install weasyprint, apt install "
            "libpangoft2-1.0-0; or print the .html page from a browser"
        ) from None

    def pdf(page: str) -> bytes:
        """The page as PDF. Raises RunError if a picture, as weasyprint only logs, is not whole."""
        errors = ErrorLog(logging.ERROR)
        weasyprint.LOGGER.addHandler(errors)
        try:
            document = weasyprint.HTML(string=page).write_pdf()
        finally:
            weasyprint.LOGGER.removeHandler(errors)
        if errors.messages:
            why = errors.messages[0].split(" data:")[0]
            raise RunError(f"to = {to}: nothing is written, weasyprint: {why}")
        return bytes(document)

    return pdf


class ErrorLog(logging.Handler):
    """Keeps the messages of a log in place of writing them."""

    def __init__(self, level: int) -> None:
        super().__init__(level)
        self.messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a message."""
        self.messages.append(record.getMessage())


def is_study(path: Path) -> bool:
    """Whether a path is of a reliability or, as a CSV file, of a sweep; else of a run."""
    return path.suffix == ".csv" or "reliability" in (read_info(path) or {})


def page_of(sections: Sequence[RunSection | StudySection], dam: str = "") -> str:
    """Render the page; dam: its name, by default the title that all sections have."""
    runs = [section for section in sections if isinstance(section, RunSection)]
    titles = {section.title for section in sections}
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    rows = [(f"{run.number}", *run.computation.values()) for run in runs]
    heads = ["run", *runs[0].computation] if runs else []
    entries = by_runs([section.other_input for section in sections])
    listed = {name for name, entry, _ in entries if in_table(name, entry)}
    return environment.get_template("report.html.j2").render(
        sections=sections,
        runs=runs,
        studies=[section for section in sections if isinstance(section, StudySection)],
        dam=dam or (titles.pop() if len(titles) == 1 else ""),
        corner=f"{body_stress.CORNER:.0%}",
        summary=summary_table(runs),
        of_joints=any(name for run in runs for name in run.summary),
        computations=Table(heads, ["" for _ in heads], rows),
        materials=by_runs([section.materials for section in sections]),
        other_input=[row for row in entries if row[0] in listed],
        at_default=[row for row in entries if row[0] not in listed],
        limits=by_runs([dict.fromkeys(section.limits, "") for section in sections]),
        errors=by_runs([{run.error: ""} for run in runs]),
        versions=by_runs([section.versions for section in sections]),
        version=__version__,
        now=f"{datetime.now():{MINUTE}}",
    )


def parts_of(folder: Path) -> list[Path]:
    """List the folders of the runs in a folder of `damjoint check`, or of several earthquakes, in
    its order; the folder itself if it is another one.

    Raises InputError if its table is damaged.
    """
    table = next(filter(Path.is_file, (folder / name for name in HEADS)), None)
    if table is None:
        return [folder]
    try:
        with table.open(newline="", encoding="utf-8") as file:
            names = dict.fromkeys(row[HEADS[table.name][0]] for row in csv.DictReader(file))
    except (*stored.DAMAGED, csv.Error) as error:
        raise InputError(f"out = {folder}: its {table.name} is damaged ({error!r})") from None
    if not all(name and is_name(name) for name in names):
        raise InputError(f"out = {folder}: its {table.name} is damaged (names of folders)")
    return [folder / name for name in names]


def summary_table(runs: list[RunSection]) -> Table:
    """Tabulate the last state of each run, a row for each of its joints."""
    columns = list[Column]()
    states = [state for run in runs for state in run.summary.values()]
    for name, head, units in SUMMARY:
        values = np.array([state.get(name, math.nan) for state in states])
        if np.isfinite(values).any():
            columns.append((head, values, units))
    return formatted_table(columns)


def read_section(folder: Path, number: int) -> RunSection:
    """Make the section of a run, the number of the report's, from its folder.

    Raises InputError if files are damaged.
    """
    solution = stored.read(folder)
    try:
        return run_section(folder, number, solution)
    except stored.DAMAGED as error:
        raise InputError(f"out = {folder}: damaged ({error!r}); run the case again") from None


@picture_style()
def run_section(folder: Path, number: int, solution: Solution) -> RunSection:
    """Make the section of a run; number: in the report."""
    result = solution.result
    case, info, last = result.case, result.info, result.last
    checks = compare_joints(result)
    critical = critical_value(info.get("critical"))
    # requirements do not apply to the last state before a failure, nor to that after an earthquake,
    # in which the whole joint has slipped
    judged = not (critical or "quake" in info)
    failures, verdict = [], UNCHECKED
    if judged:
        failures = failure_messages(result, checks)
        verdict = FAIL if info["state"] in UNFINISHED else worst_verdict(*checks)
    elif required := requirements(case):
        state = "before failure" if critical else "after the earthquake"
        verdict = NOT_JUDGED
        failures = [f"{', '.join(required)}: {NOT_JUDGED} in the state {state}"]
    made = datetime.fromtimestamp((folder / "run.json").stat().st_mtime)
    return RunSection(
        number=number,
        folder=str(folder),
        title=case.title,
        scene=describe_scene(case),
        uplift=str(case["uplift"]),
        made=f"{made:{MINUTE}}",
        verdict=verdict,
        run_verdict="critical value" if critical else info["verdict"],
        failures=failures,
        hints=[
            *filter(None, [critical, earthquake(info), *info["hints"]]),
            *info.get("notes", []),
            *(info.get("critical") or {}).get("gravity_method_notes", ()),
        ],
        pictures=[Picture(n, text, embedded(fig)) for n, text, fig in drawn(solution)]
        if len(result.joint["time"])
        else [],
        joints=[
            joint_section(joint, result.case.named((k,))) for k, joint in enumerate(result.joints)
        ],
        of_joints=joints_table(result, result.last["time"])
        if case.of_joints and result.last
        else None,
        joints_note=joints_note(case),
        earthquake=report_quake.read(folder, case, info),
        calibration=report_studies.calibration(folder, info) if "calibration" in info else ([], {}),
        further=further_pictures(folder, result),
        level=f"{last['level']:.4g} m" if last else "",
        state=state_of_last(last, info.get("quake")),
        methods=methods_table(case, checks, judged=judged),
        notes=method_notes(checks),
        stress=stress_of(solution, checks),
        summary={
            case.named((k,)): joint_summary(check.case, check) for k, check in enumerate(checks)
        },
        computation=computation(result),
        error=discretisation_error(result),
        materials=report_input.materials(case),
        other_input=report_input.other_input(case),
        limits=[*report_input.limits(case, earthquake="quake" in info)],
        versions=report_studies.versions(info),
    )


def further_pictures(folder: Path, result: Results) -> dict[str, Picture]:
    """The pictures of flow in time, with its balance, and of a calibration, by their headings."""
    pictures, last = dict[str, Picture](), result.last
    water, fit = (folder / f"{result.case.name}_{n}.png" for n in ("water", "calibration"))
    if water.is_file() and "water_in" in last:
        caption = " ".join(
            water_of(joint, result.case.named((k,)) or "the joint")
            for k, joint in enumerate(result.joints)
            if flows_in_time(joint.case)
        )
        pictures["Flow in time"] = Picture("bands", caption, bands(water))
    calibration = result.info.get("calibration")
    if fit.is_file() and calibration:
        pictures["Calibration"] = Picture("bands", "", bands(fit))
    return pictures


def water_of(result: Results, name: str) -> str:
    """The water in a joint in which it flows in time, at the end and at most, in words."""
    case, last = result.case, result.last
    shown = result.history["time"] >= case["time_start"] - ROUND_OFF
    rows = {column: values[shown] for column, values in result.history.items()}
    seconds = (rows["time"] - case["time_start"]) * case["time_unit"]
    hours, factor = unit_of_time(seconds[-1])
    most = rows["water"].max()

    def litres(column: str) -> str:
        """Volume at the end, 0 if it is rounding."""
        return f"{1e3 * last[column] * (abs(last[column]) > ROUND_OFF * most) + 0.0:.4g} l/m"

    def at_most(column: str) -> str:
        return f"at {seconds[rows[column].argmax()] * factor:.4g} {hours}"

    head = max(last["level"] + case["joint_head_offset"], last["tail_level"])
    height = head - result.joint["y"].min()
    outside, inside = case["rho_water"] * case["g"] * max(height, 0) / 1e3, last["p_max"] / 1e3
    shut_in = (
        f" At the end it is up to {inside:.4g} kPa, more than the {outside:.4g} kPa outside: water "
        "that has not yet left the joint as it closed."
        if inside > SHUT_IN * outside
        else ""
    )
    return (
        f"Water in {name} at the end: {litres('water')}, of which {litres('water_in')} have come "
        f"in; void {litres('void')}. "
        f"Most water: {1e3 * most:.4g} l/m {at_most('water')}; highest pressure: "
        f"{rows['p_max'].max() / 1e3:.4g} kPa {at_most('p_max')}; largest Reynolds number: "
        f"{rows['Re'].max():.3g} {at_most('Re')}.{shut_in}"
    )


def state_of_last(last: Mapping[str, float], quake: Mapping[str, Any] | None) -> str:
    """What the last state is, by its row of the history and the summary of an earthquake."""
    if not last:
        return ""
    level = f"at level {last['level']:.4g} m"
    if not quake:
        return level
    after = quake.get("after", {}).get("equilibrium")
    return f"{level}, static, {'after' if after else 'before'} the earthquake"


def joint_section(result: Results, name: str) -> JointSection:
    """Make the section of a joint, the only one of these results; name: empty if it is alone."""
    # the loads one by one need a section by parameters
    rigid = None if result.case.geometry else hand_calculation(result)
    return JointSection(
        name=f"{name[0].upper()}{name[1:]}: " if name else "",
        levels=levels_table(result, MILLIMETRES),
        loads=loads_table(rigid) if rigid else None,
        formulas=formulas(rigid) if rigid and rigid.stands else [],
    )


def stress_of(solution: Solution, checks: list[SafetyCheck]) -> Stress:
    """Stress in the bodies at the last level."""
    result = solution.result
    if not len(result.joint["time"]):
        return Stress([], [], "")
    time = shown_time(result)
    pressure = body_stress.rock_pressure(solution, checks, time)
    tables = [pressure] if pressure else []
    if time not in solution.fields:
        return Stress([], tables, "Principal stresses: not known, the run has no fields.")
    pictures, section = [], body_stress.undeformed(solution, time)
    if section:
        figure = figure_of(*STRESS)
        body_stress.draw_principal(figure, solution, time, section)
        pictures.append(Picture("full", "", embedded(figure)))
        tables.append(body_stress.faces(solution, time, section))
    return Stress(pictures, [body_stress.extremes(solution, time), *tables], "")


#: States of a run that has not ended by itself.
UNFINISHED = "failed", "interrupted"


def failure_messages(result: Results, checks: list[SafetyCheck]) -> list[str]:
    """Messages on a run that failed and on requirements that are not met or not judged."""
    info = result.info
    messages = [info["statement"]] if info["state"] in UNFINISHED else []
    judged = [r for check in checks for r in check.results]
    reasons = ((label(r, result.case), why) for r in judged for why in (*r.failures, *r.not_judged))
    return [*messages, *(f"{name}: {why}" for name, why in reasons)]


def method_notes(checks: list[SafetyCheck]) -> list[str]:
    """Notes on the methods: those of all joints once, others with the name of their joint."""
    lines = (
        note if common else f"{check.finite_elements.joint}: {note}"
        for check, note, common in common_notes(checks)
    )
    return list(dict.fromkeys(lines))  # in their order


def describe_scene(case: Case) -> str:
    """Describe geometry, dimension, law and uplift in a line."""
    height, base, crest = (case[name] for name in ("dam_height", "dam_base", "dam_crest"))
    size = f"{height:g} m high, base {base:g} m, crest {crest:g} m"
    size = f"geometry {case.geometry.name}" if case.geometry else size
    solid = "3D" if case.geometry else f"3D, {case['thickness']:g} m thick"
    plane = "plane strain" if case["dim"] == 2 else solid
    law, water = (case.of_all_joints(name) for name in ("law", "uplift"))
    return f"{size}; {plane}; joint law {law}; water in the joint: {water}"


def joint_summary(case: Case, check: SafetyCheck) -> dict[str, float]:
    """Values of the columns SUMMARY of a joint in SI units; case: of the joint."""
    factors = required_by_case(case)
    values = dict(check.finite_elements.numbers)
    for name, factor in factors.items():
        values[f"{name}_required"] = factor
        if check.gravity:
            values[f"{name}_gravity"] = check.gravity.numbers[name]
    return values


def label(result: MethodResult, case: Case) -> str:
    """Method of a result, and its joint if the case has several."""
    return f"{result.joint}, {result.method}" if case.of_joints else result.method


def methods_table(case: Case, checks: list[SafetyCheck], judged: bool) -> Table:
    """Both methods at the last level of each joint, requirements, and verdicts that apply."""
    results = [result for check in checks for result in check.results]
    rows = [((r.joint, r.method), r.numbers, r.verdict) for r in results]
    factors = required_by_case(case)
    if np.isfinite([*factors.values()]).any():
        rows.append((("", REQUIRED), factors, ""))
    columns = list[Column]()
    levels = {r.numbers["level"] for r in results}
    for units, heads in SHOWN[len(levels) == 1 :]:  # a single level is in the heading
        values = [[numbers.get(n, math.nan) for _, numbers, _ in rows] for n in heads]
        columns += in_one_unit(heads.values(), np.array(values), units)
    names, sizes, cells = formatted_table(columns)
    verdicts = judged and any(r.verdict != UNCHECKED for r in results)
    first = 0 if case.of_joints else 1
    table = [
        (*words[first:], *row, *([verdict] if verdicts else []))
        for (words, _, verdict), row in zip(rows, cells, strict=True)
    ]
    words, end = ["joint", "method"][first:], [""] * verdicts
    without = [""] * len(words)
    return Table([*words, *names, *end], [*without, *sizes, *end], table)


def in_one_unit(heads: Iterable[str], values: np.ndarray, units: Units) -> Iterator[Column]:
    """Yield columns for `formatted_table` that share a unit; values: (columns, rows)."""
    for head, column in zip(heads, values, strict=True):
        yield head, column, (unit([values[np.isfinite(values)]], units),)


def loads_table(rigid: GravityMethod) -> Table:
    """Loads on the body above the joint, uplift, sum: forces, lever arms about the toe, moments."""
    loads = [*rigid.loads]
    if rigid.U:
        (tx, ty), away = rigid.body.along, rigid.uplift.moment / rigid.U
        loads.append(force("uplift", -ty * rigid.U, tx * rigid.U, (-away * tx, -away * ty)))
    rows = [*loads, resultant_of("sum", loads)]
    arms = [(arm(r.moment_of_fx, r.fx), arm(r.moment_of_fy, r.fy)) for r in loads]
    heights, distances = np.array([*arms, (math.nan, math.nan)]).T
    forces = np.array([[r.fx for r in rows], [r.fy for r in rows]])
    downstream, upwards = in_one_unit(["downstream", "upwards"], forces, FORCES)
    columns = [
        downstream,
        ("height above the toe", heights, METRES),
        upwards,
        ("distance upstream of the toe", distances, METRES),
        ("moment about the toe", np.array([r.moment for r in rows]), MOMENTS),
    ]
    return formatted_table(columns).beside("load", (row.name for row in rows))


def arm(moment: float, component: float) -> float:
    """Lever arm [m] of a component of a force; nan if there is none."""
    return -moment / component if component else math.nan


def formulas(rigid: GravityMethod) -> list[str]:
    """The gravity method's eccentricity, stresses and sliding factor in numbers (MN, m, MPa)."""
    case, length, uncracked = rigid.case, rigid.body.length, rigid.uncracked
    normal, shear, moment = (v / 1e6 for v in (rigid.N, rigid.T, rigid.M))
    toe, tip = rigid.sigma_n_eff_toe / 1e6, rigid.tip_stress / 1e6
    tip = 0.0 if abs(tip) < ROUND_OFF * abs(toe) else tip
    end = "toe" if rigid.eccentricity >= 0 else "heel"
    lines = [
        f"e = L/2 - M/N' = {length:.4g}/2 - {moment:.4g}/{normal:.4g} = "
        f"{rigid.eccentricity:.4g} m, towards the {end}; uncracked B = L - a = {uncracked:.4g} m",
        f"effective stress, tension > 0: upstream (2 N' B - 6 M)/B² = {tip:.4g} MPa, "
        f"toe (6 M - 4 N' B)/B² = {toe:.4g} MPa",
    ]
    if shear:
        lines.append(
            f"SSF = (µ N' + c B)/T = ({factored(case, 'mu', 1)} · {normal:.4g} + "
            f"{factored(case, 'c', 1e6)} · {uncracked:.4g})/{abs(shear):.4g} = {rigid.SSF:.4g}"
        )
    return lines


def factored(case: Case, strength: str, unit: float) -> str:
    """mu or c, with the partial factor that divides it."""
    value, factor = case["mu" if strength == "mu" else "adhesion"], case[f"factor_{strength}"]
    return f"{value / unit:.4g}" + (f"/{factor:.4g}" if factor != 1 else "")


def drawn(solution: Solution) -> Iterator[tuple[str, str, Figure]]:
    """Yield the figures of a run: CSS class of the size, caption, figure."""
    result = solution.result
    time = shown_time(result)
    at_level = f"at level {result.state(time)['level']:.4g} m"
    several = len(result.joints) > 1
    has_fields = bool(solution.fields)
    if has_fields:
        section = figure_of(*HALF)
        run_picture.draw_dam(section, solution, time)
        what = "Dam" if run_picture.is_user_solid(result.case) else "Section and loads"
        yield "half", f"{what} {at_level}, deformed.", section
    maps = has_fields and run_picture.is_user_solid(result.case)
    colors = "" if maps else " Red: broken; violet: softening; orange: slipped."
    rows = several and not maps
    changes = len(np.unique(result.history["level"])) > 1  # else a single point or line
    if rows and has_fields and changes:
        yield "half", "", history_of(result, HALF)
    size = (WIDE[0], 1 + PER_JOINT * len(result.joints)) if rows else HALF if has_fields else SOLID
    joint = figure_of(*size)
    run_picture.draw_all_joints(joint, solution, time)
    layout = "half" if size is HALF else "full"
    yield layout, f"Joint{'s' if several else ''} {at_level}.{colors}", joint
    if changes and not (rows and has_fields):
        yield "full", "", history_of(result, WIDE)
    if result.case["dim"] == 3 and has_fields and not run_picture.is_user_solid(result.case):
        solid = figure_of(*SOLID)
        run_picture.draw_solid(solid, solution, time)
        yield "full", "In 3D: deformed, and maps of the joint.", solid
    if result.case["drive"] != "level":
        yield "half", "Load against opening.", run_picture.draw_curve(result)


def history_of(result: Results, size: tuple[float, float]) -> Figure:
    """Draw the history of the joint, or of several as equals."""
    figure = figure_of(*size)
    shown = run_picture.panels_of_joints if result.case.of_joints else run_picture.history_panels
    run_picture.draw_history(figure, shown(result), result)
    return figure


def critical_value(info: dict[str, Any] | None) -> str:
    """Result of `damjoint critical`, if run.json has it."""
    if not info or info["value"] is None:
        return ""
    unit = info["unit"]
    doubt = f"not confirmed: {info['doubt']}" if info["doubt"] else ""
    mode, failing = info["mode"], info.get("joint")
    mode = f"{mode} on {failing}" if mode and failing else mode
    parts = [p for p in (f"{info['value']:.6g} {unit}".strip(), doubt, mode) if p]
    on = f" on {joint}" if (joint := info.get("gravity_method_joint")) else ""
    by_hand = {f"gravity method{on}": info["gravity_method"]}
    by_hand[f"on {info.get('joint')}"] = info.get("gravity_method_there")
    by_hand |= info.get("gravity_method_with", {})
    parts += [f"{n} {v:.6g} {unit}".strip() for n, v in by_hand.items() if v is not None]
    return f"the last state before failure, critical {info['of']} {'; '.join(parts)}"


def earthquake(info: Info) -> str:
    """Statement of `damjoint quake`, if run.json has it."""
    summary = info.get("quake")
    if not summary or "at_rest" not in summary:
        return ""
    ground = abs(summary["peaks"]["ground_ax"]["value"])
    return (
        f"earthquake {Path(summary['record']).name}, {ground / STANDARD_GRAVITY:.3g} g: "
        f"{info['statement']}; N', T and the last row of the levels are those of the static state "
        "after it"
    )


def discretisation_error(result: Results) -> str:
    """Error that --accuracy has estimated; else how to estimate it."""
    if "error_estimate" in result.info:
        return str(result.info["error_estimate"]["statement"])
    of_mesh = result.case.geometry and result.case.geometry.suffix != ".geo"
    how = "compare a run on a finer mesh" if of_mesh else "damjoint run --accuracy 1% estimates it"
    return f"not estimated; {how}"


def computation(result: Results) -> dict[str, str]:
    """Mesh, steps, engine and time."""
    case, info, history = result.case, result.info, result.history
    mesh = info["mesh"]
    return {
        "nodes": f"{mesh['nodes']}",
        "elements": f"{mesh['elements']}",
        "in the joint": f"{mesh['joint_elements']}",
        "order": f"{case['order']:g}",
        "unknowns": f"{info['unknowns']}",
        "K_N h/E": f"{stiffness_ratio(result):.3g}",
        "steps": f"{len(history['time'])}",
        "iterations": f"{history['iterations'].sum():.0f}",
        "largest residual": f"{history['residual'].max(initial=0):.1g}",
        "engine": info["engine"],
        "time [s]": f"{sum(info['wall_seconds'].values()):.2g}",
    }
