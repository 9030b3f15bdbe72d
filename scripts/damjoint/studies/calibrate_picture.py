"""Picture of a calibration: measured and computed values in time, residuals against the level."""

from __future__ import annotations

import textwrap
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..input import parameters
from ..pictures.drawing import BLUE, GREY, RED, figure_of, panels, picture_style, write_picture
from ..units import with_slash
from .calibrate import CONFIDENCE, Calibration

#: Sizes [inches]: width, height of a series.
WIDTH, HEIGHT = 10.0, 2.2
#: Units in which values are drawn, and the factor from SI.
DRAWN = {"crest_ux": ("mm", 1e3), "max_opening": ("mm", 1e3)}


def draw(answer: Calibration, path: Path) -> None:
    """Write the picture."""
    write_picture(figure(answer), path, 110)


@picture_style()
def figure(answer: Calibration) -> Figure:
    """A row per series: measured with twice its standard deviation, and computed, against the
    reading; the weighted residuals against the level.
    """
    estimates = "; ".join(estimate_words(answer, number) for number in range(len(answer.free)))
    words = [answer.case.title, estimates, *(answer.findings or [answer.all_squares])]
    lines = [line for text in words for line in textwrap.wrap(text, 130)]
    count = len(answer.measurements.series)
    top = 0.3 + 0.17 * len(lines)
    height = top + 0.35 + HEIGHT * count
    picture = figure_of(WIDTH, height)
    picture.text(
        0.1 / WIDTH, 1 - 0.1 / height, "\n".join(lines), va="top", fontsize=9, parse_math=False
    )
    table = panels(picture, count, 2, top=top, down=0.45)
    for number, (in_time, residuals) in enumerate(table):
        draw_series(in_time, answer, number)
        draw_residuals(residuals, answer, number)
    dates = answer.measurements.dates
    for in_time in table[:, 0] if any(dates) else ():
        in_time.xaxis.set_major_formatter(lambda t, _: dict(enumerate(dates, 1)).get(round(t), ""))
        in_time.tick_params(axis="x", labelsize=7)
    table[-1, 0].set_xlabel("date" if any(dates) else "reading", fontsize=8)
    table[-1, 1].set_xlabel("level [m]", fontsize=8)
    return picture


def estimate_words(answer: Calibration, number: int) -> str:
    """An estimate with its interval."""
    one, (low, high) = answer.free[number], answer.intervals[number]
    unit = with_slash(parameters.of_any_joint(one.name).unit)
    text = f"{one.name} = {answer.estimates[number]:.4g} {unit} ({low:.4g} to {high:.4g})"
    return text + (", not determined" if one.name in answer.undetermined else "")


def draw_series(axes: Axes, answer: Calibration, number: int) -> None:
    """Draw measured and computed values against the reading."""
    one = answer.measurements.series[number]
    unit, factor = DRAWN.get(one.name.rstrip("_0123456789"), (one.unit, 1.0))
    times, read = answer.measurements.times, np.isfinite(one.measured)
    bars = 2 * factor * one.deviation[read]
    style = {"fmt": "o", "markersize": 2.5, "elinewidth": 0.7, "color": GREY}
    label = "measured, 2 standard deviations"
    axes.errorbar(times[read], factor * one.measured[read], bars, label=label, **style)  # type: ignore[arg-type]
    axes.plot(times, factor * answer.computed[number], color=BLUE, linewidth=1.0, label="computed")
    axes.locator_params(axis="x", integer=True)
    axes.set_ylabel(f"{one.name} [{unit}]", fontsize=8)
    axes.grid(alpha=0.3)
    if number == 0:
        axes.legend(fontsize=7, loc="lower right", bbox_to_anchor=(1, 1), ncols=2)


def draw_residuals(axes: Axes, answer: Calibration, number: int) -> None:
    """Draw the weighted residuals against the level, with the interval in which most lie."""
    name = answer.measurements.series[number].name
    suspect = any(text.startswith(f"{name}:") for text in answer.findings)
    levels, residuals = np.array(answer.measurements.levels), answer.residuals[number]
    axes.axhspan(-1.96, 1.96, color=GREY, alpha=0.15, label=f"{CONFIDENCE:.0%} of all")
    axes.plot(levels, residuals, "o", markersize=2.5, color=RED if suspect else BLUE)
    axes.axhline(0, color=GREY, linewidth=0.7)
    axes.set_ylabel("residual / standard deviation", fontsize=8)
    axes.grid(alpha=0.3)
    if number == 0:
        axes.legend(fontsize=7, loc="lower right", bbox_to_anchor=(1, 1), ncols=2)
