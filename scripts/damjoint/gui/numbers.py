"""Numbers of a run: finite elements beside the gravity method, step by step; a table of all."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..model.results import HISTORY, Results
from ..post.summary import SHOWN, Table, levels_table, requested_rows
from ..post.units import Units, unit
from ..statics import gravity
from ..statics.verdict import hints, path_statement

NUMBER: Units = (("-", 1),)
#: Safety factors: column, heading, meaning.
FACTORS = (
    (
        "SSF",
        "SSF with mu, adhesion",
        "sliding safety factor (mu N' + adhesion (length - crack)) / T, whatever the joint law",
    ),
    ("OSF", "OSF", "overturning safety factor: stabilising over overturning moments about the toe"),
)
#: What the gravity method computes.
BY_GRAVITY = "N", "T", "M", "U", "x_resultant", "crack_length", "SSF", "OSF"
#: Columns that are not shown where they are zero.
OPTIONAL = "tail_level", "U", "flux", "process_zone"
#: Between the numbers of the finite elements and of the gravity method.
BESIDE = " | "


@dataclass(frozen=True)
class Numbers:
    """Numbers at a step by column, in SI units: of the finite elements and, of a section by
    parameters, of the gravity method.
    """

    elements: dict[str, float]
    rigid: dict[str, float]
    length: float

    @staticmethod
    def at(result: Results, time: float) -> Numbers:
        """The numbers at a requested time."""
        case, state = result.case, result.state(time)
        state["max_opening"] = max(state["max_opening"], 0.0)  # below 0 in a closed joint
        if case.geometry:
            return Numbers(state, {}, case.joint_length)
        method = gravity.at(case, state["time"], state["level"])
        state |= gravity.factors_of_state(method, state)
        rigid = {name: float(getattr(method, name)) for name in BY_GRAVITY}
        return Numbers(state, rigid, case.joint_length)

    def rows(self) -> list[tuple[str, str, str]]:
        """Rows of label, value and tooltip; values of both methods in a common unit."""
        columns = [(name, head, units, HISTORY[name][1]) for name, head, units in SHOWN]
        columns += [(name, head, NUMBER, meaning) for name, head, meaning in FACTORS]
        rows = []
        for name, head, units, meaning in columns:
            both = [method[name] for method in (self.elements, self.rigid) if name in method]
            finite = np.nan_to_num(both, posinf=0.0)
            size, factor = unit([finite], units) if finite.any() else units[0]
            values = BESIDE.join(three_digits(value * factor) for value in both)
            if both and not (name in OPTIONAL and not any(both)):
                rows.append((f"[{size}] {head}".removeprefix("[-] "), values, meaning))
        where = "part of the joint where its normal force acts"
        return [*rows, ("N' in", BESIDE.join(self.positions), where)]

    @property
    def positions(self) -> list[str]:
        """In which part of the joint its normal force acts, by each method."""
        both = [m["x_resultant"] for m in (self.elements, self.rigid) if m]
        return [gravity.position(x, self.length) for x in both]


def three_digits(value: float) -> str:
    """Format a number with three digits."""
    if not math.isfinite(value):
        return "-"
    return f"{value:.0f}" if 1000 <= abs(value) < 1e6 else f"{value + 0.0:.3g}"


def table_of_levels(result: Results) -> Table:
    """Table of the requested levels, with safety factors."""
    table = levels_table(result)
    if result.case.geometry:
        return table
    times = result.history["time"][requested_rows(result)]
    numbers = [Numbers.at(result, time).elements for time in times]
    columns = [[three_digits(row[name]) for row in numbers] for name, *_ in FACTORS]
    rows = [(*row[:-1], *more, row[-1]) for row, *more in zip(table.rows, *columns, strict=True)]
    names = [*table.names[:-1], *(name for name, *_ in FACTORS), table.names[-1]]
    return Table(names, [*table.units, *("" for _ in FACTORS)], rows)


def warnings(result: Results) -> list[str]:
    """The hints that the command line prints below its table."""
    path = [path_statement(result)] if result.case["drive"] != "level" else []
    accuracy = result.info.get("error_estimate", {}).get("statement")
    return [*path, *hints(result), *([accuracy] if accuracy else [])]
