"""Report of runs: one HTML page made from the files in their folders."""

from __future__ import annotations

import base64
import io
import json
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import gmsh
import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from matplotlib.figure import Figure

from .. import ROUND_OFF, InputError, __version__
from ..arrays import Value
from ..model.case import Case
from ..model.fields import Solution
from ..model.parameters import constants, declared, parse
from ..model.results import Results
from ..post import pictures, stored
from ..post.drawing import figure_of
from ..post.summary import Table, levels_table, table_of
from ..post.units import FORCES, MOMENTS
from ..statics.verdict import failed, statement, stiffness_ratio
from ..storage import atomic_write
from .check import UNCHECKED, SafetyCheck, compare_methods, hand_calculation, picture_table

#: Resolution of the rasterised parts of a picture.
DPI = 160
#: Sizes of the pictures [inches]: half of the page's width; its width; its width, in 3D.
HALF, WIDE, SOLID = (5.2, 5.8), (10.6, 2.4), (10.6, 4.4)
MINUTE = "%Y-%m-%d %H:%M"


@dataclass(frozen=True)
class Picture:
    """A picture of the page: CSS class of its size, caption, data address."""

    size: str
    caption: str
    address: str


@dataclass(frozen=True)
class RunSection:
    """Section of the page on a run."""

    folder: str
    title: str
    scene: str
    #: time of the run
    made: str
    #: pass, fail or not checked
    verdict: str
    #: verdict of the run itself: stands, sliding, ...
    run_verdict: str
    failures: list[str]
    hints: list[str]
    pictures: list[Picture]
    levels: Table
    #: safety check and loads; None for a user's own geometry
    check: Table | None
    loads: Table | None
    notes: list[str]
    #: parameter, meaning, value, unit, default
    differences: list[tuple[str, str, str, str, str]]
    #: mesh, solver, versions, times: name, value
    facts: list[tuple[str, str]]


def write(folders: list[Path], to: Path) -> None:
    """Write the page from the folders of runs, those of their further scenes included.

    Raises InputError if a folder is not that of a run, or the page can not be written.
    """
    runs = [run for folder in folders for run in stored.runs_in(folder)]
    inside = any(run.resolve() in to.resolve().parents for run in runs)
    if to.is_dir() or (inside and to.suffix != ".html"):
        raise InputError(f"to = {to}: must be a file; in the folder of a run it must end in .html")
    sections = [read_section(folder) for folder in runs]
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    page = environment.get_template("report.html.j2").render(
        runs=sections, version=__version__, now=f"{datetime.now():{MINUTE}}"
    )
    try:
        with atomic_write(to) as path:
            path.write_text(page, encoding="utf-8")
    except OSError as error:
        raise InputError(f"to = {to}: must be a writable file ({error.strerror})") from None


def read_section(folder: Path) -> RunSection:
    """Make the section of a run from its folder.

    Raises InputError if files are damaged.
    """
    solution = stored.read(folder)
    try:
        return run_section(folder, solution)
    except stored.DAMAGED as error:
        raise InputError(f"out = {folder}: damaged ({error!r}); run the case again") from None


def run_section(folder: Path, solution: Solution) -> RunSection:
    """Make the section of a run."""
    result = solution.result
    case, info = result.case, result.info
    check = None if case.geometry else compare_methods(result)  # of a section by parameters
    failures = failures_of(result, check)
    verdict = check.finite_elements.verdict if check else UNCHECKED
    made = datetime.fromtimestamp((folder / "run.json").stat().st_mtime)
    return RunSection(
        folder=str(folder),
        title=case.title,
        scene=describe_scene(case),
        made=f"{made:{MINUTE}}",
        verdict="fail" if failures else verdict,
        run_verdict=info["verdict"],
        failures=failures,
        hints=[*info["hints"]],
        pictures=pictures_of(solution) if len(result.joint["time"]) else [],
        levels=levels_table(result),
        check=check_table(check) if check else None,
        loads=loads_table(result) if check else None,
        notes=check.notes if check else [],
        differences=differences(case),
        facts=facts(result),
    )


def failures_of(result: Results, check: SafetyCheck | None) -> list[str]:
    """Messages on a run that failed and on requirements that are not met."""
    info = result.info
    messages = [info["statement"]] if info["state"] in ("failed", "interrupted") else []
    if check:
        messages += [f"{r.method}: {why}" for r in check.results for why in r.failures]
    elif failed(result):
        messages.append(statement(result))
    return messages


def describe_scene(case: Case) -> str:
    """Describe geometry, dimension, law and uplift in a line."""
    size = "{dam_height:g} m high, base {dam_base:g} m, crest {dam_crest:g} m".format(**case.values)
    size = f"geometry {case.geometry.name}" if case.geometry else size
    solid = "3D" if case.geometry else f"3D, {case['thickness']:g} m thick"
    plane = "plane strain" if case["dim"] == 2 else solid
    return f"{size}; {plane}; joint law {case['law']}; water in the joint: {case['uplift']}"


def differences(case: Case) -> list[tuple[str, str, str, str, str]]:
    """List the parameters that matter in the scene and differ from their default: name, meaning,
    value, unit, default.

    The default of an automatic parameter is the value that follows from the others.
    """
    known, values = declared(), case.values
    own = {n: v for n, v in values.items() if not known[n].automatic}
    automatic, defaults = parse(stored.parser_input(own, case.levels)), constants()
    matter = visible(case)
    rows = []
    for name, parameter in known.items():
        default = (automatic if parameter.automatic else defaults)[name][0]
        if name in matter and not same(values[name], default):
            texts = cell(values[name]), parameter.unit.strip("-"), cell(default)
            rows.append((name, parameter.description, *texts))
    return rows


def visible(case: Case) -> set[str]:
    """Parameters that matter in the scene, by the visibility in their declarations."""
    parse(stored.parser_input(case.values, case.levels))
    entry = lambda p: json.loads(gmsh.onelab.get(p.label))
    return {name for name, p in declared().items() if entry(p).get("visible", True)}


def same(value: Value, default: Value) -> bool:
    """Whether a parameter has its default value, but for rounding."""
    if isinstance(value, str) or isinstance(default, str):
        return value == default
    return bool(np.isclose(value, default, ROUND_OFF, 0))


def cell(value: Value) -> str:
    """Format the value of a parameter."""
    return value if isinstance(value, str) else f"{value:.6g}"


def loads_table(result: Results) -> Table:
    """Tabulate the loads on the body above the joint, and the uplift, at the last level."""
    columns = hand_calculation(result).table()
    table = table_of(
        [
            ("downstream", np.array(columns["Fx"]), FORCES),
            ("upwards", np.array(columns["Fy"]), FORCES),
            ("moment about the toe", np.array(columns["moment"]), MOMENTS),
        ]
    )
    rows = [(name, *row) for name, row in zip(columns["load"], table.rows, strict=True)]
    return Table(["load", *table.names], ["", *table.units], rows)


def check_table(check: SafetyCheck) -> Table:
    """Tabulate both methods and what is required."""
    heads, *rows = picture_table(check)
    return Table([*heads], [""] * len(heads), rows)


def pictures_of(solution: Solution) -> list[Picture]:
    """Draw the pictures of a run."""
    result = solution.result
    case, time = result.case, pictures.shown_time(result)
    at_level = f"at level {result.state(time)['level']:.4g} m"
    section, joint, history = figure_of(*HALF), figure_of(*HALF), figure_of(*WIDE)
    pictures.draw_dam(section, solution, time)
    pictures.draw_joint(joint, solution, time)
    pictures.draw_history(history, result)
    colors = "Red: open or broken; violet: softening; orange: slipped."
    drawn = [
        ("half", section, f"The dam and its loads {at_level}, deformed."),
        ("half", joint, f"The joint {at_level}: jumps, normal stress, shear. {colors}"),
        ("full", history, "All converged steps."),
    ]
    if case["dim"] == 3 and solution.fields:
        solid = figure_of(*SOLID)
        pictures.draw_solid(solid, solution, time)
        drawn.append(("full", solid, "In 3D: deformed, and the joint unrolled."))
    if case["drive"] != "level":
        drawn.append(("half", pictures.draw_curve(result), "Load against opening."))
    return [Picture(size, caption, embedded(figure)) for size, figure, caption in drawn]


def embedded(figure: Figure) -> str:
    """Encode a figure as a data address: SVG with rasterised meshes."""
    file = io.BytesIO()
    figure.savefig(file, format="svg", dpi=DPI, metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(file.getvalue()).decode()


def facts(result: Results) -> list[tuple[str, str]]:
    """Describe critical value, mesh, steps, engine, times and versions."""
    info = result.info
    engine = filter(None, [info["engine"], info.get("factorisation")])
    return [
        *critical_fact(info.get("critical")),
        ("mesh", mesh_fact(result)),
        (
            "stiffness of the joint over that of an element, K_N h/E",
            f"{stiffness_ratio(result):.3g}",
        ),
        ("error of the mesh", error_fact(result)),
        ("steps", steps_fact(result)),
        ("engine", ", ".join(engine)),
        (
            "seconds",
            ", ".join(f"{name} {value:.2g}" for name, value in info["wall_seconds"].items()),
        ),
        ("versions", ", ".join(f"{name} {number}" for name, number in info["versions"].items())),
    ]


def critical_fact(info: dict[str, Any] | None) -> list[tuple[str, str]]:
    """Result of `damjoint critical`, if run.json has it."""
    if not info or info["value"] is None:
        return []
    unit = info["unit"]
    parts = [f"{info['value']:.6g} {unit}".strip(), info["mode"]]
    if info["doubt"]:
        parts.append(f"not confirmed: {info['doubt']}")
    by_hand = {"gravity method": info["gravity_method"]} | info.get("gravity_method_with", {})
    parts += [f"{n} {v:.6g} {unit}".strip() for n, v in by_hand.items() if v is not None]
    return [(f"critical {info['of']}, and the last state before it", "; ".join(parts))]


def mesh_fact(result: Results) -> str:
    """Size of the mesh."""
    case, mesh = result.case, result.info["mesh"]
    return (
        f"{mesh['nodes']} nodes, {mesh['elements']} elements, {mesh['joint_elements']} in the "
        f"joint ({case['n_joint']:g} from heel to toe), order {case['order']:g}; "
        f"{result.info['unknowns']} unknowns"
    )


def error_fact(result: Results) -> str:
    """Error that --accuracy has estimated; else how to estimate it."""
    if "error_estimate" in result.info:
        return str(result.info["error_estimate"]["statement"])
    own = result.case.geometry and result.case.geometry.suffix != ".geo"
    how = "compare a run on a finer mesh" if own else "damjoint run --accuracy 1% estimates it"
    return f"not estimated; {how}"


def steps_fact(result: Results) -> str:
    """Steps, iterations and residual."""
    history = result.history
    return (
        f"{len(history['time'])} converged, {history['iterations'].sum():.0f} iterations; largest "
        f"residual {history['residual'].max(initial=0):.1g} of the force of the highest water"
    )
