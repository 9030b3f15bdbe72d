"""Picture of a reliability: probability of failure by each method, importance of the variables."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from ..pictures.drawing import BLUE, DARK, figure_of, panels, picture_style, write_picture
from .reliability import Reliability

#: Width of the picture, height of a row, of the space around the rows, and of a line of the heading
#: [inches]; letters in a line.
WIDTH, ROW, AROUND, LINE, LETTERS = 11.5, 0.3, 1.1, 0.2, 140
#: Labels in a decade of an axis of less than two decades.
FEW = (1, 2, 5)


def draw(results: Sequence[Reliability], title: str, values: Sequence[str], path: Path) -> None:
    """Draw to path; results: of single joints, then of all; values: name and value of each variable
    at the design point.
    """
    write_picture(figure_of_reliability(results, title, values), path, 110)


@picture_style()
def figure_of_reliability(
    results: Sequence[Reliability], title: str, values: Sequence[str]
) -> Figure:
    """Probabilities, of the samples with their interval, beside the importance factors."""
    whole = results[-1]
    index = f"; beta {whole.beta:.4g} (FORM)" if whole.form else ""
    heading = textwrap.wrap(title + index, LETTERS)
    heading += textwrap.wrap(whole.words(), LETTERS)
    rows = [row for one in results for row in probabilities(one, len(results) > 1)]
    head = 0.15 + LINE * len(heading)
    height = head + AROUND + ROW * max(len(rows), len(values), 3)
    figure = figure_of(WIDTH, height)
    figure.text(0.1 / WIDTH, 1 - 0.1 / height, "\n".join(heading), va="top", parse_math=False)
    margins = {"left": 2.2, "right": 0.3, "bottom": 0.6, "top": head + 0.35, "across": 2.7}
    left, right = panels(figure, 1, 2, **margins)[0]
    draw_probabilities(left, rows)
    right.set_title("importance; values at the design point", fontsize=9)
    shares = [100 * whole.importance[name] for name in whole.design]
    right.barh(range(len(shares)), shares, color=BLUE, height=0.6)
    right.set_yticks(range(len(shares)), values)
    right.set(xlim=(0, 100), ylim=(max(len(shares), 1) - 0.5, -0.5), xlabel="importance [%]")
    right.grid(axis="x", alpha=0.3)
    return figure


#: Label, probability, limits of its interval (nan: none).
Row = tuple[str, float, float, float]


def probabilities(one: Reliability, several: bool) -> list[Row]:
    """Rows of a reliability, those that it has; several: whether the joint is named."""
    of = f"{one.joint or 'all joints'}: " if several else ""
    named = ("FORM", one.form), ("SORM (Breitung)", one.breitung), ("SORM (Tvedt)", one.tvedt)
    rows = [(of + name, p, np.nan, np.nan) for name, p in named if p]
    if one.samples and one.sampled > 0:
        rows.append((f"{of}{one.samples} samples", one.sampled, one.low, one.high))
    return rows


def draw_probabilities(axes: Axes, rows: Sequence[Row]) -> None:
    """A mark for each probability, on a logarithmic axis, with its interval."""
    axes.set_title("probability of failure; line: interval of the samples", fontsize=9)
    for y, (_, p, low, high) in enumerate(rows):
        axes.plot([low, high], [y, y], "|-", color=DARK, linewidth=1.2)
        axes.plot([p], [y], "o", color=BLUE, markersize=5)
        axes.annotate(f"{p:.3g}", (p, y), (0, 5), textcoords="offset points", fontsize=8)
    axes.set_yticks(range(len(rows)), [name for name, *_ in rows])
    if rows:
        shown = np.array([row[1:] for row in rows])
        least, most = np.nanmin(shown[shown > 0]) / 2, min(1.0, np.nanmax(shown) * 2)
        axes.set_xscale("log")
        axes.set_xlim(least, most)
        axes.xaxis.set_major_locator(LogLocator(subs=FEW if most < 100 * least else (1,)))
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set(ylim=(len(rows) - 0.5, -0.7), xlabel="probability [-]")
    axes.grid(axis="x", alpha=0.3)
