"""An earthquake in a report: record, response spectrum, peaks, residual values, damping."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..arrays import Array
from ..arrays import Table as Columns
from ..dynamics import ground_motion
from ..dynamics.record import Record
from ..dynamics.record_files import STANDARD_GRAVITY
from ..input.case import Case
from ..input.parameters import declared
from ..model.results import Info, column_of
from ..pictures.drawing import BLUE, DARK, ORANGE, figure_of, panels
from ..pictures.report_picture import Picture, bands, embedded
from ..post import stored
from ..post.summary import Table, formatted_table
from . import quake_result, report_input

#: Size of the picture of the spectra [inches], and their periods [s].
SPECTRUM = (10.6, 2.3)
PERIODS = np.geomspace(0.03, 4.0, 80)
#: Components of a record: name, column of quake.csv.
COMPONENTS = ("horizontal", "ground_ax"), ("vertical", "ground_ay")


@dataclass(frozen=True)
class Earthquake:
    """An earthquake in the report."""

    spectra: Picture
    #: its picture, unless it was not drawn
    pictures: list[Picture]
    #: by heading
    tables: dict[str, Table]
    #: rigid block, water pressure, natural frequencies and damping, time steps
    notes: list[str]


def read(folder: Path, case: Case, info: Info) -> Earthquake | None:
    """The earthquake of a folder, if its run.json has results of `damjoint quake`.

    Raises OSError, ValueError if its table is damaged.
    """
    summary = info.get("quake")
    if not summary or "at_rest" not in summary:
        return None
    rows = stored.read_csv(folder / "quake.csv")
    # from rest at t = 0, where the table has no row
    rows = {name: np.append(0.0, rows[name]) for name in ("time", "ground_ax", "ground_ay")}
    path, first = folder / f"{case.name}_quake.png", 1 / summary["frequencies"][0]
    pictures = list[Picture]()
    if path.is_file():
        caption = "Earthquake: relative to the ground, since the static state before it."
        pictures.append(Picture("bands", caption, bands(path)))
    halved = "none of them halved"
    if summary["halvings"]:
        halved = f"halved up to {summary['halvings']} times where they did not converge"
    notes = [
        *(f"{note}." for note in summary["notes"]),
        *beside_rigid_block(case, summary),
        f"{quake_result.modes(summary)}.",
        f"Water pressure in the joint: {report_input.uplift_in_earthquake(case)}.",
        f"{summary['steps']} steps of {summary['dt']:g} s over {summary['time']:g} s, {halved}.",
    ]
    tables = {
        "ground motion": record_table(rows, first),
        "peaks": quake_result.peaks_table(summary, case, of_joints=not case.of_joints),
    }
    if case.of_joints:
        tables["all joints"] = quake_result.joints_table(summary, case)
    else:
        tables["end"] = quake_result.residual_table(summary, case)
    spectra = Picture("full", "", embedded(draw_spectra(rows, first)))
    return Earthquake(spectra, pictures, tables, [as_sentence(note) for note in notes])


def as_sentence(note: str) -> str:
    """A note with a capital letter, unless it begins with the name of a parameter."""
    return note if note.split()[0] in declared() else f"{note[0].upper()}{note[1:]}"


def components(rows: Columns) -> list[tuple[str, Array]]:
    """The components of the ground's acceleration that are not zero, by name [m/s2]."""
    return [(name, rows[column]) for name, column in COMPONENTS if rows[column].any()]


def record_table(rows: Columns, period: float) -> Table:
    """Tabulate the ground motion in the rows of an earthquake, a row for each component: largest
    acceleration, velocity, Arias intensity, significant duration, and the spectrum at a period [s].
    """
    time, of_records = rows["time"], components(rows)
    numbers = []
    for _, acceleration in of_records:
        velocity = Record(time, np.column_stack([acceleration] * 2)).velocity(time)
        at_period = ground_motion.spectrum(time, acceleration, np.array([period]))[0]
        numbers.append(
            [
                np.abs(acceleration).max() / STANDARD_GRAVITY,
                np.abs(velocity).max(),
                ground_motion.arias_growth(time, acceleration)[-1],
                ground_motion.significant_duration(time, acceleration),
                at_period / STANDARD_GRAVITY,
            ]
        )
    heads = (
        ("PGA", "g"),
        ("PGV", "m/s"),
        ("Arias intensity", "m/s"),
        ("significant duration, 5 to 95 %", "s"),
        (f"spectrum at T1 = {period:.3g} s", "g"),
    )
    columns = [
        (name, values, ((size, 1.0),))
        for (name, size), values in zip(heads, np.array(numbers).T, strict=True)
    ]
    return formatted_table(columns, 3).beside("record", (name for name, _ in of_records))


def draw_spectra(rows: Columns, period: float) -> Figure:
    """Draw record and response spectrum, with the first natural period [s]."""
    figure = figure_of(*SPECTRUM)
    record, response = panels(figure, 1, 2)[0]
    for (name, acceleration), color in zip(components(rows), (BLUE, ORANGE), strict=False):
        record.plot(rows["time"], acceleration / STANDARD_GRAVITY, color=color, lw=0.7, label=name)
        values = ground_motion.spectrum(rows["time"], acceleration, PERIODS) / STANDARD_GRAVITY
        response.semilogx(PERIODS, values, color=color, label=name)
    response.axvline(period, color=DARK, lw=0.8, ls="--", label="first natural period")
    response.legend(fontsize=7.5, frameon=False)
    record.set(xlabel="t [s]", ylabel="ground [g]", xlim=(0, rows["time"][-1]))
    words = f"pseudo-acceleration with {ground_motion.DAMPING:.0%} damping"
    response.set_title(words, fontsize=8, loc="left")
    response.set(xlabel="period [s]", ylabel="PSA [g]", xlim=(PERIODS[0], PERIODS[-1]))
    ticks = [0.05, 0.1, 0.2, 0.5, 1, 2]
    response.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    response.set_ylim(bottom=0)
    for axes in (record, response):
        axes.grid(alpha=0.3)
        axes.xaxis.label.set_fontsize(8)
        axes.yaxis.label.set_fontsize(8)
    return figure


def beside_rigid_block(case: Case, summary: dict[str, Any]) -> list[str]:
    """Why slip and rigid block differ, in words; empty without a block that stands at rest."""
    residual, peaks = summary["residual"], summary["peaks"]
    blocks = [k for k in range(len(case.joints)) if column_of("rigid_block", k) in residual]
    if not blocks or column_of("slip", 0) not in residual:
        return []
    crest, ground = (abs(peaks[name]["value"]) for name in ("crest_ax", "ground_ax"))
    return [
        "The rigid block [Newmark 1965] follows the ground, with the static uplift and, from the "
        "beginning, the cohesion that the earthquake leaves at its end. The dam of the finite "
        f"elements vibrates (the crest's acceleration is {crest / ground:.3g} times the ground's), "
        "which can add slip or take it away, and its cohesion holds until it has broken: the two "
        "slips are no bounds of each other."
    ]
