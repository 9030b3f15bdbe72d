"""The results of a safety check as tables: for the terminal, and for the picture of a scene."""

from __future__ import annotations

import math
from functools import partial
from itertools import groupby
from textwrap import wrap

import numpy as np

from ..pictures.check_picture import SIGN
from ..post.summary import aligned, fitted
from ..units import FORCES, METRES, MOMENTS, NUMBER, STRESSES, Units, unit
from .check import (
    DIFFERENCE,
    FAIL,
    FINITE_ELEMENTS,
    GRAVITY,
    LONGER,
    Row,
    SafetyCheck,
    common_notes,
    position_by_case,
    required_by_case,
    verdict_line,
    worst_verdict,
)

#: Difference over the largest value of a quantity below which the printed table shows 0.
SHOWN_DIFFERENCE = 1e-5

#: Columns of the printed table: heading by name, in groups that share a unit.
SHOWN: tuple[tuple[Units, dict[str, str]], ...] = (
    (METRES, {"level": "level"}),
    (FORCES, {"N": "N'", "T": "T", "U": "U"}),
    (MOMENTS, {"M": "M"}),
    (METRES, {"x_resultant": "N' at x"}),
    (STRESSES, {"sigma_n_eff_heel": "eff. heel", "sigma_n_eff_toe": "eff. toe"}),
    (METRES, {"crack_length": "crack"}),
    (FORCES, {"cohesion": "c B", "cohesion_undamaged": "c L"}),
    (NUMBER, {"SSF": "SSF", "OSF": "OSF"}),
)


#: Columns that a narrow table leaves out, in this order.
LESS = ("level", "c L", "c B", "eff. toe", "eff. heel", "M", "N' at x", "U", "crack", "T", "N'")

#: Methods in a table that is too wide with their full names.
SHORT = {FINITE_ELEMENTS: "FE", GRAVITY: "gravity", LONGER: "longer crack"}
#: Characters of a column of names at least.
NARROWEST = 8


def text_table(checks: list[SafetyCheck], width: int | None = None) -> str:
    """Format verdicts, table, notes; width: of the terminal, None: all columns."""
    rows = [row for check in checks for row in check.printed_rows]
    is_difference = np.array([row["answer"] == DIFFERENCE for row in rows])
    columns, heads, names = [], [], ["case", "method"]
    for units, shown in SHOWN:
        values = np.array([[row[name] for row in rows] for name in shown], dtype=float)
        finite = values[np.isfinite(values)]
        size, factor = units[0] if units in (FORCES, MOMENTS) else unit([finite], units)
        least = SHOWN_DIFFERENCE * np.abs(finite).max(initial=0)
        values[is_difference & (np.abs(values) < least)] = 0
        sign = f"\n{SIGN}" if units is STRESSES else ""
        names += shown.values()
        heads += [f"{title}\n[{size or '-'}]{sign}" for title in shown.values()]
        columns += [list(map(cell, line * factor, is_difference)) for line in values]
    verdicts = ([row[name] for row in rows] for name in ("position", "verdict"))
    scenes = [scene_label(checks, row) for row in rows]
    loads = [", partial load" * (row.get("load") == "partial") for row in rows]
    methods = [row["answer"] + part for row, part in zip(rows, loads, strict=True)]
    first, common = "case", f"{checks[0].case.name}, " if checks else ""
    if all(scene.startswith(common) for scene in scenes):  # only joints or uplifts differ
        first = "joint" if len({row["joint"] for row in rows}) > 1 else "uplift"
    of_case = common if first != "case" else ""
    columns = [[scene.removeprefix(of_case) for scene in scenes], methods, *columns, *verdicts]
    heads = [first, "method", *heads, "N' in", "check"]
    draw = partial(aligned, left=2, right=1)

    def drawn() -> str:
        cells = list(zip(*columns, strict=True))
        return fitted([*names, "N' in", "check"], heads, cells, LESS, width, draw)

    table = drawn()
    if width is not None and (excess := max(map(len, table.splitlines())) - width) > 0:
        short = (SHORT.get(name := str(row["answer"]), name) for row in rows)
        columns[1] = [answer + part for answer, part in zip(short, loads, strict=True)]
        excess -= max(map(len, methods)) - max(map(len, columns[1]))
        columns[0] = in_rows(columns[0], max(map(len, columns[0])) - max(excess, 0))
        table = drawn()
    lines = [
        f"{scene}, {row['answer']}: {'fails, ' * (row['verdict'] == FAIL)}{row['why']}"
        for scene, row in zip(scenes, rows, strict=True)
        if row["why"]
    ]
    verdict_lines = [
        f"{scene_label(checks, check.finite_elements.row)}: {verdict_line(check)}"
        for check in checks
    ]
    parts = "\n".join([*verdict_lines, *lines]), table, "\n".join(labelled_notes(checks))
    return "\n\n".join(filter(None, parts))


def in_rows(names: list[str], width: int) -> list[str]:
    """Each of the names once, wrapped over the rows that follow each other with it."""
    cells = list[str]()
    for name, same in groupby(names):
        rows = len(list(same))
        cells += [*wrap(name, max(width, NARROWEST), max_lines=rows), *[""] * rows][:rows]
    return cells


def labelled_notes(checks: list[SafetyCheck]) -> list[str]:
    """Notes with the scene and joint of each; one that all of a case have, once with its name."""
    lines = dict[str, None]()  # in their order
    for name in dict.fromkeys(check.case.name for check in checks):
        of_case = [check for check in checks if check.case.name == name]
        for check, note, common in common_notes(of_case):
            label = name if common else scene_label(checks, check.finite_elements.row)
            lines[f"{label}: {note}"] = None
    return list(lines)


def scene_label(checks: list[SafetyCheck], row: Row) -> str:
    """Name of a row's case, with uplift and joint where the case has several."""
    same = [c.finite_elements for c in checks if c.case.name == row["case"]]
    joints = list(dict.fromkeys(result.joint for result in same))
    scenes = {result.case["uplift"] for result in same if result.joint == joints[0]}
    parts = [row["case"]]
    parts += [row["uplift"]] if len(scenes) > 1 else []
    parts += [row["joint"]] if len(joints) > 1 else []
    return ", ".join(parts)


def cell(value: float, sign: bool = False) -> str:
    """Format a number with five digits, a difference with its sign and three; empty if nan."""
    if math.isnan(value):
        return ""
    return f"{value:.5g}" if not sign else f"{value:+.3g}" if value else "0"


def picture_table(check: SafetyCheck) -> list[tuple[str, ...]]:
    """Table beside the picture: a row per quantity."""
    longer = ["longer"] * len(check.longer)
    cells = [(f"stress: {SIGN}", "FE", "gravity", *longer, "required")]
    least = required_by_case(check.case)
    for units, names in SHOWN:
        values = [[result.numbers[name] for result in check.results] for name in names]
        size, factor = unit([np.array(values)[np.isfinite(values)]], units)
        for (name, title), line in zip(names.items(), values, strict=True):
            numbers = (cell(v * factor) for v in line)
            head = f"{title} [{size}]" if size else title
            cells.append((head, *numbers, cell(least.get(name, math.nan))))
    if where := position_by_case(check.case):
        cells.append(("N' in", *(result.position for result in check.results), where))
    if check.finite_elements.partial:
        cells.insert(1, ("load", "partial", "full", *("full" for _ in longer), ""))
    return [*cells, ("check", *(result.verdict for result in check.results), "")]


def joints_table(checks: list[SafetyCheck]) -> list[tuple[str, ...]]:
    """Joints of a scene: least factors of both methods, finite elements' N, the worse verdict."""
    cells: list[tuple[str, ...]] = [("joint", "SSF", "OSF", "N' in", "verdict")]
    for check in checks:
        numbers = [result.numbers for result in check.results]
        least = [np.nanmin([n[name] for n in numbers] + [np.inf]) for name in ("SSF", "OSF")]
        factors = (f"{f:.3g}" if f < np.inf else "-" for f in least)
        elements = check.finite_elements
        cells.append((elements.joint, *factors, elements.position, worst_verdict(check)))
    return cells
