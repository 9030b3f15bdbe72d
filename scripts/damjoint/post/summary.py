"""Summary of a run by level, as a table for terminal and report."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import zip_longest
from textwrap import wrap
from typing import NamedTuple

import numpy as np

from .. import ROUND_OFF
from ..input.case import Case
from ..input.values import factor_unknown, flows_in_time
from ..model.results import Results
from ..statics import gravity
from ..statics.verdict import sliding_factor
from ..units import FLUXES, FORCES, LENGTHS, MOMENTS, NUMBER, Units, unit, unit_of_time

#: Columns of the summary: name in the history, heading, units.
SHOWN: tuple[tuple[str, str, Units], ...] = (
    ("level", "level", LENGTHS[:1]),
    ("tail_level", "tailwater", LENGTHS[:1]),
    ("N", "N'", FORCES),
    ("T", "T", FORCES),
    ("M", "M", MOMENTS),
    ("U", "uplift U", FORCES),
    ("x_resultant", "N' at x", LENGTHS[:1]),
    ("crack_length", "crack", LENGTHS[:1]),
    ("broken_length", "broken", LENGTHS[:1]),
    ("process_zone", "softening", LENGTHS[:1]),
    ("slip_length", "slipped", LENGTHS[:1]),
    ("max_opening", "largest opening", LENGTHS),
    ("crest_ux", "crest movement", LENGTHS),
    ("flux", "leakage", FLUXES),
)


class Table(NamedTuple):
    """A table of text: names and units of the columns (a unit may be empty), rows of cells."""

    names: list[str]
    units: list[str]
    rows: list[tuple[str, ...]]

    def beside(self, heading: str, names: Iterable[str]) -> Table:
        """The table with a first column of names."""
        rows = [(name, *row) for name, row in zip(names, self.rows, strict=True)]
        return Table([heading, *self.names], ["", *self.units], rows)

    @property
    def heads(self) -> list[str]:
        """Names with units."""
        return [
            f"{name} [{unit}]" if unit else name
            for name, unit in zip(self.names, self.units, strict=True)
        ]

    @property
    def stacked(self) -> list[str]:
        """Names in narrow lines, units below them."""
        return [
            "\n".join([*wrap(name, 10), *([f"[{unit}]"] if unit else [])])
            for name, unit in zip(self.names, self.units, strict=True)
        ]


def formatted_table(columns: Sequence[tuple[str, np.ndarray, Units]], digits: int = 4) -> Table:
    """Format columns (name, values, units) with some digits in units that suit their size; what is
    below ROUND_OFF of a column's largest value is rounding and shown as 0.
    """
    names, sizes, cells = [], [], []
    for name, values, units in columns:
        size, factor = unit([np.where(np.isfinite(values), values, 0.0)], units)
        rounding = ROUND_OFF * np.abs(values[np.isfinite(values)]).max(initial=0)
        values = np.where(np.abs(values) < rounding, 0.0, values)
        names.append(name)
        sizes.append(size)
        cells.append([f"{v * factor + 0.0:.{digits}g}" if np.isfinite(v) else "-" for v in values])
    return Table(names, sizes, list(zip(*cells, strict=True)))


def levels_table(result: Results, displacements: Units | None = None) -> Table:
    """Tabulate the history of a joint, the only one of these results, at the requested levels and
    at the end of the run; displacements: their units, by default those that suit their size.
    """
    history, case = result.history, result.case
    rows = requested_rows(result)
    # a joint that is closed everywhere has its "largest opening" below 0
    history = history | {"max_opening": np.maximum(history["max_opening"], 0)}
    first: list[tuple[str, np.ndarray, Units]] = []
    if flows_in_time(case):
        after = history["time"][rows] - case["time_start"]
        seconds = np.where(after > -ROUND_OFF, after * case["time_unit"], np.nan)
        first = [("time", seconds, (unit_of_time(np.nanmax(seconds, initial=0.0)),))]
    if factor_unknown(case):
        first.append((f"{case['drive_load']} factor", history["load_factor"][rows], NUMBER))
    if case["drive"] != "level" and "point_u" in history:
        moved = history["point_u"][rows]
        first.append(("point movement", moved, units_shown(LENGTHS, displacements)))
    names, sizes, cells = formatted_table(
        first
        + [
            # one unit of forces in all tables
            (head, history[name][rows], units_shown(units, displacements))
            for name, head, units in SHOWN
            if (name != "flux" or case["uplift"] == "flow")
            and (name not in ("tail_level", "process_zone") or history[name].any())
            and (name != "broken_length" or differs(history[name], history["crack_length"]))
        ]
    )
    thirds = (gravity.position(x, case.joint_length) for x in history["x_resultant"][rows])
    cells = [(*row, third) for row, third in zip(cells, thirds, strict=True)]
    return Table([*names, "N' in"], [*sizes, ""], cells)


def units_shown(units: Units, displacements: Units | None) -> Units:
    """The units of a column of `levels_table`: a single one of forces, in all tables."""
    if units is LENGTHS and displacements:
        return displacements
    return units[:1] if units in (FORCES, MOMENTS) else units


#: Columns of the table of the joints: name in the history, heading.
OF_JOINTS = (
    ("x_resultant", "N' at x"),
    ("crack_length", "crack"),
    ("broken_length", "broken"),
    ("process_zone", "softening"),
    ("slip_length", "slipped"),
)


def joints_table(result: Results, time: float) -> Table:
    """Tabulate the joints at a time, a row each: safety factor against sliding, position of N,
    lengths that are open, broken, softening, slipped; SSF in brackets: see `joints_note`.
    """
    joints = [(joint_result, joint_result.state(time)) for joint_result in result.joints]
    factors = [sliding_factor(joint_result, state) for joint_result, state in joints]
    columns: list[tuple[str, np.ndarray, Units]] = [("SSF", np.array(factors), NUMBER)]
    for name, head in OF_JOINTS:
        values = np.array([state[name] for _, state in joints])
        if name != "process_zone" or values.any():
            columns.append((head, values, LENGTHS[:1]))
    table = formatted_table(columns, 3).beside("joint", result.case.joint_names)
    thirds = (gravity.position(s["x_resultant"], j.case.joint_length) for j, s in joints)
    graph = result.case.graph
    rows = [
        (name, f"({factor})" if graph.is_internal(k) and factor != "-" else factor, *row, third)
        for k, ((name, factor, *row), third) in enumerate(zip(table.rows, thirds, strict=True))
    ]
    return Table([*table.names, "N' in"], [*table.units, ""], rows)


def joints_note(case: Case) -> str:
    """What the brackets in `joints_table` mean; empty if there are none."""
    internal = any(map(case.graph.is_internal, range(len(case.joints))))
    return "(SSF): between bodies that other joints hold; it is no limit" if internal else ""


def differs(broken: np.ndarray, crack: np.ndarray) -> bool:
    """Whether the joint was broken where it was closed, or open where it was not broken."""
    return not np.allclose(broken, crack, ROUND_OFF, 0)


def requested_rows(result: Results) -> np.ndarray:
    """Indices in the history of the requested levels that were reached, and of its last row."""
    times = result.history["time"]
    shown = np.array([np.isclose(result.case.requested, t).any() for t in times], bool)
    shown[-1:] = True
    return np.flatnonzero(shown)


#: Columns that a narrow table leaves out, in this order.
LESS = ("M", "uplift U", "broken", "softening", "tailwater", "leakage", "crest movement", "T")


def text(result: Results, width: int | None = None) -> str:
    """Format the tables of the levels for the terminal: of a single joint its levels, of several a
    row for each at the last level; the levels of each, too, with all columns (width = None).
    """
    case = result.case
    if not case.of_joints:
        return text_of_joint(result, width)
    last = result.last
    table = joints_table(result, last["time"])
    shown = aligned(table.rows, table.stacked, left=1)
    note = joints_note(case)
    at = f"level {last['level']:.4g} m"
    if factor_unknown(case):
        at += f", {case['drive_load']} factor {last['load_factor']:.4g}"
    joints = f"joints at {at}:\n{shown}" + (f"\n{note}" if note else "")
    if width is not None:
        return joints
    tables = zip(case.joint_names, map(text_of_joint, result.joints), strict=True)
    return "\n\n".join([joints, *(f"{name}:\n{table}" for name, table in tables)])


def text_of_joint(result: Results, width: int | None = None) -> str:
    """Format the table of the levels of the only joint of these results."""
    table = levels_table(result)
    return fitted(table.names, table.stacked, table.rows, LESS, width)


#: Draws a table of rows and headings.
Draw = Callable[[list[tuple[str, ...]], list[str]], str]


def fitted(
    names: Sequence[str],
    heads: Sequence[str],
    rows: Sequence[Sequence[str]],
    less: Sequence[str],
    width: int | None,
    drawn: Draw | None = None,
) -> str:
    """Draw a table, its columns by names and headings, without those of the columns `less`, in
    their order, that a width has no room for; width = None: all; drawn: by default `aligned`.
    """
    shown, hidden = list(range(len(names))), list[str]()

    def draw(shown: Sequence[int]) -> str:
        picked = [tuple(row[k] for k in shown) for row in rows]
        return (drawn or aligned)(picked, [heads[k] for k in shown])

    table = draw(shown)
    for name in less:
        if width is None or max(map(len, table.splitlines())) <= width:
            break
        if name in names:
            shown.remove(names.index(name))
            hidden.append(name)
            table = draw(shown)
    if width is None or not hidden:
        return table
    return "\n".join([table, *wrap(f"(--wide shows also: {', '.join(hidden)})", width)])


#: Blanks between two columns; a column is at least so much wider than its heading.
GAP = 2


def aligned(rows: list[tuple[str, ...]], heads: list[str], left: int = 0, right: int = 0) -> str:
    """Align rows of cells below headings of several lines; the first `left` columns, the last one
    and `right` before it to the left (right = -1: not the last either), the others to the right.
    (A package for this takes longer to load than the run to compute.)
    """
    lines = list(zip_longest(*(head.split("\n") for head in heads), fillvalue=""))
    widths = [
        max(*map(len, head), *map(len, cells))
        for head, cells in zip(zip(*lines, strict=True), zip(*rows, strict=True), strict=True)
    ]
    numbers = len(widths) - left - right - 1
    sides = [str.ljust] * left + [str.rjust] * numbers + [str.ljust] * (right + 1)

    def line(cells: Sequence[str]) -> str:
        padded = (side(c, w) for side, c, w in zip(sides, cells, widths, strict=True))
        return (" " * GAP).join(padded).rstrip()

    rule = (" " * GAP).join("-" * width for width in widths)
    return "\n".join([*map(line, lines), rule, *map(line, rows)])
