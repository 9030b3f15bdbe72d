"""One HTML page from the files of runs: what an engineer lays before a reviewer."""

from __future__ import annotations

import base64
import io
import json
from datetime import datetime
from pathlib import Path

import gmsh
import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from matplotlib.figure import Figure

from .. import InputError, __version__
from ..model.case import Case
from ..model.fields import Solution
from ..model.parameters import constants, declared, parse
from ..model.results import Results
from ..post import pictures, stored
from ..post.drawing import figure_of
from ..post.summary import levels_table, table
from ..post.units import FORCES, MOMENTS
from ..statics.verdict import failed, statement, stiffness_ratio
from ..storage import atomic_write
from .check import UNCHECKED, SafetyCheck, compare_methods, hand_calculation, picture_table

#: Of the parts of a picture that are dots, not lines.
DPI = 160


def write(folders: list[Path], to: Path) -> None:
    """Write the page from the folders of runs, those of their further scenes included.

    Raises InputError if one of them is no run's folder, or the page can not be written.
    """
    runs = [run for folder in folders for run in stored.runs_in(folder)]
    inside = any(run.resolve() in to.resolve().parents for run in runs)
    if to.is_dir() or (inside and to.suffix != ".html"):
        raise InputError(
            f"to = {to}: must be a file, in the folder of a run one that ends in .html"
        )
    parts = [read_part(folder) for folder in runs]
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    page = environment.get_template("report.html.j2").render(
        runs=parts, version=__version__, now=f"{datetime.now():%Y-%m-%d %H:%M}"
    )
    try:
        with atomic_write(to) as path:
            path.write_text(page, encoding="utf-8")
    except OSError as error:
        raise InputError(f"to = {to}: {error}") from None


def read_part(folder: Path) -> dict:
    """What the page says of the run in a folder.

    Raises InputError if its files are not what a run writes.
    """
    solution = stored.read(folder)
    try:
        return part_of(folder, solution)
    except stored.DAMAGED as error:
        raise InputError(f"out = {folder}: damaged: {error!r}") from None


def part_of(folder: Path, solution: Solution) -> dict:
    """What the page says of a run, for the template."""
    result = solution.result
    case, told = result.case, result.info
    # the gravity method knows sections by parameters only
    found = None if case.geometry else compare_methods(result)
    fails = [statement(result)] if found is None and failed(result) else []
    for answer in found.results if found else ():
        fails += [f"{answer.method}: {why}" for why in answer.failures]
    if told["state"] in ("failed", "interrupted"):
        fails.insert(0, told["statement"])
    made = datetime.fromtimestamp((folder / "run.json").stat().st_mtime)
    return {
        "folder": str(folder),
        "title": case.title,
        "name": case.name,
        "verdict": told["verdict"],
        "judged": "fail" if fails else found.finite_elements.verdict if found else UNCHECKED,
        "fails": fails,
        "hints": [*told["hints"]],
        "made": f"{made:%Y-%m-%d %H:%M}",
        "scene": scene_of(case),
        "differences": differences(case),
        "levels": levels_table(result),
        "loads": loads_table(result) if found else None,
        "check": check_table(found) if found else None,
        "notes": found.notes if found else [],
        "pictures": pictures_of(solution) if len(result.joint["time"]) else [],
        "facts": facts(result),
    }


def scene_of(case: Case) -> str:
    """The dam, dimension, law and water in a line."""
    size = "{dam_height:g} m high, base {dam_base:g} m, crest {dam_crest:g} m".format(**case.values)
    size = f"geometry {case.geometry.name}" if case.geometry else size
    solid = "3D" if case.geometry else f"3D, {case['thickness']:g} m thick"
    plane = "plane strain" if case["dim"] == 2 else solid
    return f"{size}; {plane}; joint law {case['law']}; water in the joint: {case['uplift']}"


def differences(case: Case) -> list[tuple[str, str, str, str, str]]:
    """Parameters that matter and are not what they would be by themselves: name, meaning, value,
    unit, default.

    What follows other parameters is compared with what it would follow.
    """
    known = declared()
    values = case.values
    own = {n: v for n, v in values.items() if not known[n].automatic}
    follow, plain = parse(stored.resolved(own, case.levels)), constants()
    seen = visible(case)
    rows = []
    for name, parameter in known.items():
        usual = (follow if parameter.automatic else plain)[name][0]
        if name in seen and not same(values[name], usual):
            unit = parameter.unit.strip("-")
            rows.append((name, parameter.description, said(values[name]), unit, said(usual)))
    return rows


def visible(case: Case) -> set[str]:
    """The parameters that matter in the scene, as their declarations tell the window."""
    parse(stored.resolved(case.values, case.levels))
    entry = lambda p: json.loads(gmsh.onelab.get(p.label))
    return {name for name, p in declared().items() if entry(p).get("visible", True)}


def same(value: float | str, usual: float | str) -> bool:
    """Whether a parameter is what it would be by itself, but for rounding."""
    return value == usual if isinstance(value, str) else bool(np.isclose(value, usual, 1e-9, 0))


def said(value: float | str) -> str:
    """A parameter's value as text."""
    return value if isinstance(value, str) else f"{value:.6g}"


def loads_table(result: Results) -> dict:
    """The loads on the body above the joint, and the uplift, at the last level."""
    rows = hand_calculation(result).table()
    heads = ("downstream", FORCES), ("upwards", FORCES), ("moment about the toe", MOMENTS)
    names, *columns = rows.values()
    found = table([(h, np.array(v), u) for (h, u), v in zip(heads, columns, strict=True)])
    named = [(name, *row) for name, row in zip(names, found["rows"], strict=True)]
    return {"heads": ["load", *found["heads"]], "rows": named}


def check_table(found: SafetyCheck) -> dict:
    """The finite elements' answer beside the gravity method's, and what is required."""
    heads, *rows = picture_table(found)
    return {"heads": heads, "rows": rows}


def pictures_of(solution: Solution) -> list[dict[str, str]]:
    """The pictures of a run with their captions, as data addresses."""
    result = solution.result
    case, time = result.case, pictures.shown_time(result)
    level = result.state(time)["level"]
    section, joint, history = figure_of(5.2, 5.8), figure_of(5.2, 5.8), figure_of(10.6, 2.4)
    pictures.draw_dam(section, solution, time)
    pictures.draw_joint(joint, result, time)
    pictures.draw_history(history, result)
    found = [
        ("half", section, f"The dam and its loads at level {level:.4g} m, deformed."),
        (
            "half",
            joint,
            f"The joint at level {level:.4g} m: jumps, normal stress, shear. Red: open or broken; "
            "violet: softening; orange: slipped.",
        ),
        ("whole", history, "All converged steps."),
    ]
    if case["dim"] == 3 and solution.fields:
        solid = figure_of(10.6, 4.4)
        pictures.draw_solid(solid, solution, time)
        found.append(("whole", solid, "In 3D: deformed, and the joint unrolled."))
    if case["drive"] != "level":
        found.append(("half", pictures.draw_curve(result), "Load against opening."))
    return [{"size": s, "caption": c, "address": embedded(f)} for s, f, c in found]


def embedded(figure: Figure) -> str:
    """A figure as a data address: SVG, what is dense in it as dots."""
    file = io.BytesIO()
    figure.savefig(file, format="svg", dpi=DPI, metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(file.getvalue()).decode()


def critical_of(found: dict | None) -> list[tuple[str, str]]:
    """What `damjoint critical` has found, if it is its folder."""
    if not found or found["value"] is None:
        return []
    unit, by_hand = found["unit"], found["gravity_method"]
    said = [f"{found['value']:.6g} {unit}".strip(), found["mode"]]
    said += [f"not confirmed: {found['doubt']}"] if found["doubt"] else []
    values = {"gravity method": by_hand} | found.get("gravity_method_with", {})
    said += [f"{n} {v:.6g} {unit}".strip() for n, v in values.items() if v is not None]
    return [(f"critical {found['of']}, and the last state before it", "; ".join(said))]


def mesh_error(result: Results) -> str:
    """What --accuracy has estimated; without it, how to see the error."""
    if "error_estimate" in result.info:
        return result.info["error_estimate"]["statement"]
    own = result.case.geometry and result.case.geometry.suffix != ".geo"
    how = "a run on a finer mesh shows it" if own else "damjoint run --accuracy 1% estimates it"
    return f"not estimated; {how}"


def facts(result: Results) -> list[tuple[str, str]]:
    """Mesh, solver, versions, times."""
    case, told = result.case, result.info
    mesh, seconds = told["mesh"], told["wall_seconds"]
    versions = ", ".join(f"{name} {number}" for name, number in told["versions"].items())
    return [
        *critical_of(told.get("critical")),
        (
            "mesh",
            f"{mesh['nodes']} nodes, {mesh['elements']} elements, {mesh['joint_elements']} in the "
            f"joint ({case['n_joint']:g} from heel to toe), order {case['order']:g}; "
            f"{told['unknowns']} unknowns",
        ),
        (
            "stiffness of the joint over that of an element, K_N h/E",
            f"{stiffness_ratio(result):.3g}",
        ),
        ("error of the mesh", mesh_error(result)),
        (
            "steps",
            f"{len(result.history['time'])} converged, {result.history['iterations'].sum():.0f} "
            f"iterations; largest remaining residual "
            f"{result.history['residual'].max(initial=0):.1g} of the force of the highest water",
        ),
        ("engine", ", ".join(filter(None, [told["engine"], told.get("factorisation")]))),
        ("seconds", ", ".join(f"{name} {value:.2g}" for name, value in seconds.items())),
        ("versions", versions),
    ]
