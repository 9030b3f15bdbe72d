"""Numbers of a run, step by step: finite elements beside the gravity method, or those of an
earthquake; a table of all steps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .. import ROUND_OFF
from ..arrays import Table as Columns
from ..model.results import HISTORY, QUAKE, Results, column_of
from ..post.summary import SHOWN, Table, formatted_table, levels_table, requested_rows
from ..statics import gravity
from ..statics.hints import hints
from ..statics.notes import remarks
from ..statics.statement import path_statement
from ..studies.quake_result import QuakeResult
from ..studies.quake_summary import row_of_peak
from ..units import FORCES, LENGTHS, NUMBER, Units, unit, with_unit

#: Safety factors: column, heading, meaning.
FACTORS = (
    (
        "SSF",
        "SSF with mu, adhesion",
        "sliding safety factor (mu N' + the adhesion that is left) / T, whatever the joint law",
    ),
    ("OSF", "OSF", "overturning safety factor: stabilising over overturning moments about the toe"),
)
#: What the gravity method computes.
BY_GRAVITY = "N", "T", "M", "U", "x_resultant", "crack_length", "SSF", "OSF"
#: Columns that are not shown where they are zero.
OPTIONAL = "tail_level", "U", "flux", "process_zone", "broken_length"
#: Numbers of an earthquake: column of quake.csv, heading, units.
ACCELERATIONS: Units = (("m/s2", 1),)
SECONDS: Units = (("s", 1),)
QUAKE_SHOWN: tuple[tuple[str, str, Units], ...] = (
    ("ground_ax", "ground acceleration", ACCELERATIONS),
    ("crest_ax", "crest acceleration", ACCELERATIONS),
    ("crest_ux", "crest movement", LENGTHS),
    ("heel_opening", "heel opening", LENGTHS),
    ("toe_opening", "toe opening", LENGTHS),
    ("open_length", "crack", LENGTHS[:1]),
    ("broken_length", "broken", LENGTHS[:1]),
    ("slip_mean", "slip", LENGTHS),
    ("N", "N'", FORCES),
    ("T", "T", FORCES),
    ("shear_reserve", "strength - |T|", FORCES),
)
#: Those of which the largest size is shown; residual values of run.json, their headings and units.
PEAKS = QUAKE_SHOWN[:8]
RESIDUAL: tuple[tuple[str, str, Units], ...] = (
    ("slip", "residual slip", LENGTHS),
    ("tilt", "residual tilt", (("rad", 1), ("mrad", 1e3), ("µrad", 1e6))),
    ("rigid_block", "slip of a rigid block", LENGTHS),
)
#: Label, value and tooltip.
Row = tuple[str, str, str]
#: Between the numbers of the finite elements and of the gravity method.
BESIDE = " | "


@dataclass(frozen=True)
class Numbers:
    """Numbers at a step in SI units: finite elements; of a section also the gravity method."""

    elements: dict[str, float]
    rigid: dict[str, float]
    length: float

    @staticmethod
    def at(result: Results, time: float) -> Numbers:
        """The numbers at a requested time."""
        case, state = result.case, result.state(time)
        state["max_opening"] = max(state["max_opening"], 0.0)  # below 0 in a closed joint
        factors = gravity.factors_of_state(case, state)
        state |= {name: value for name, value in factors.items() if not math.isnan(value)}
        if case.geometry:
            return Numbers(state, {}, case.joint_length)
        method = gravity.at(case, state["time"], state["level"])
        rigid = {name: float(getattr(method, name)) for name in BY_GRAVITY}
        return Numbers(state, rigid, case.joint_length)

    def rows(self) -> list[Row]:
        """Rows of label, value and tooltip; values of both methods in a common unit."""
        columns = [(name, head, units, HISTORY[name][1]) for name, head, units in SHOWN]
        columns += [(name, head, NUMBER, meaning) for name, head, meaning in FACTORS]
        methods = BESIDE.join(["finite elements", "gravity method"][: 1 + bool(self.rigid)])
        shown = "the level that the drawing area shows"
        rows = [(f"At t = {self.elements['time']:.4g}", methods, shown)]
        for name, head, units, meaning in columns:
            both = [method[name] for method in (self.elements, self.rigid) if name in method]
            finite = np.nan_to_num(both, posinf=0.0)
            size, factor = unit([finite], units)
            values = BESIDE.join(three_digits(value * factor) for value in both)
            if both and not (name in OPTIONAL and not any(both)):
                rows.append((f"{head} [{size}]" if size else head, values, meaning))
        where = "part of the joint where its normal force acts"
        return [*rows, ("N' in", BESIDE.join(self.positions), where)]

    @property
    def positions(self) -> list[str]:
        """In which part of the joint its normal force acts, by each method."""
        both = [m["x_resultant"] for m in (self.elements, self.rigid) if m]
        return [gravity.position(x, self.length) for x in both]


@dataclass(frozen=True)
class QuakeNumbers(Numbers):
    """Numbers at a frame of an earthquake: `elements`; quake: its row of quake.csv; peaks: largest
    and residual values of all rows, as `rows`.
    """

    quake: dict[str, float]
    peaks: list[Row]

    @staticmethod
    def of(quake: QuakeResult, joint: int) -> list[QuakeNumbers]:
        """The numbers at all frames, of a joint by its number."""
        frames, rows, peaks = quake.frames.joints[joint], shown_rows(quake, joint), []
        for name, head, units in PEAKS:
            k = row_of_peak(name, rows[name])
            value = with_unit(rows[name][k], units, 3)
            peaks.append((f"largest {head}", f"{value} at {rows['time'][k]:.2f} s", QUAKE[name][1]))
        peaks += [("Note", note, note) for note in quake.summary["notes"]]
        if not quake.summary["at_rest"]:
            peaks.append(("At rest", "no", "at the end: no residual slip"))
        for name, head, units in RESIDUAL:
            value = quake.summary["residual"].get(column_of(name, joint))
            if value is not None:
                peaks.append((head, with_unit(value, units, 3), "mean over the end of the rest"))
        times = frames.history["time"]
        shown = f"{len(times)} times, {len(rows['time'])} steps"
        peaks.append(("Shown", shown, "the curves over time have all steps"))
        nearest = [int(np.argmin(np.abs(rows["time"] - time))) for time in times]
        return [
            QuakeNumbers(
                frames.state(time),
                {},
                frames.case.joint_length,
                quake={name: float(column[k]) for name, column in rows.items()},
                peaks=peaks,
            )
            for time, k in zip(times, nearest, strict=True)
        ]

    def rows(self) -> list[Row]:
        """See `Numbers`."""
        shown = "the time that the drawing area shows"
        rows = [(f"At t = {self.elements['time']:.4g} s", "earthquake", shown)]
        for name, head, units in QUAKE_SHOWN:
            if name in self.quake:
                rows.append((head, with_unit(self.quake[name], units, 3), QUAKE[name][1]))
        return [*rows, *self.peaks]


def shown_rows(quake: QuakeResult, joint: int) -> Columns:
    """The rows of quake.csv of a joint, by its number, without round-off, with openings not below 0
    and the shear strength in both directions.
    """
    rows = {
        name: np.where(np.abs(column) > ROUND_OFF * np.abs(column).max(), column, 0.0)
        for name, column in quake.joint_rows(joint).items()
        if np.isfinite(column).all()  # a law may not limit shear
    }
    rows |= {name: np.maximum(rows[name], 0.0) for name in ("heel_opening", "toe_opening")}
    if "shear_reserve" in rows:
        rows["strength"] = np.maximum(rows["shear_reserve"] + np.abs(rows["T"]), 0.0)
        rows["strength against"] = -rows["strength"]
    return rows


def table_of_frames(numbers: list[QuakeNumbers]) -> Table:
    """Table of the frames."""
    columns = ("time", "t", SECONDS), *QUAKE_SHOWN
    return formatted_table(
        [
            (head, np.array([row.quake[name] for row in numbers]), units)
            for name, head, units in columns
            if name in numbers[0].quake
        ]
    )


def three_digits(value: float) -> str:
    """Format a number with three digits."""
    if not math.isfinite(value):
        return "-"
    return f"{value:.0f}" if 1000 <= abs(value) < 1e6 else f"{value + 0.0:.3g}"


def table_of_levels(result: Results) -> Table:
    """Table of the requested levels, with safety factors."""
    table = levels_table(result)
    times = result.history["time"][requested_rows(result)]
    numbers = [Numbers.at(result, time).elements for time in times]
    factors = [name for name, *_ in FACTORS if all(name in row for row in numbers)]
    columns = [[three_digits(row[name]) for row in numbers] for name in factors]
    rows = [(*row[:-1], *more, row[-1]) for row, *more in zip(table.rows, *columns, strict=True)]
    names = [*table.names[:-1], *factors, table.names[-1]]
    return Table(names, [*table.units, *("" for _ in factors)], rows)


def warnings(result: Results) -> list[str]:
    """The hints that the command line prints below its table, then its remarks on the case: what a
    result means comes first where there is not room for all.
    """
    path = [path_statement(result)] if result.case["drive"] != "level" else []
    accuracy = result.info.get("error_estimate", {}).get("statement")
    notes = result.info["notes"] if "notes" in result.info else remarks(result.case)
    return [*path, *hints(result), *([accuracy] if accuracy else []), *notes]
