"""Common parts of the pictures: colors and patterns, figures with margins in inches, legends."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg  # not pyplot: it costs half of a 2D run
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure, SubFigure
from matplotlib.image import imsave
from matplotlib.patches import Patch
from matplotlib.table import Table
from matplotlib.transforms import Bbox

from ..model.fields import BROKEN, SLIPPED, SOFTENING
from ..storage import atomic_write

AnyFigure = Figure | SubFigure

BLUE, ORANGE, WATER, RED, GREEN = "#0b5394", "#cc7a00", "#3d9be0", "#b3261e", "#2e7d32"
VIOLET = "#8e24aa"
GREY, DARK, CONCRETE, ROCK, SILT = "#8a8a8a", "#333333", "#c3ccd6", "#d8c9ae", "#a1866f"
#: Lines of a table.
LINES = "#b0b0b0"


@contextlib.contextmanager
def picture_style() -> Iterator[None]:
    """Draw in the same style whatever that of a notebook, or of a matplotlibrc in the current
    folder, which is left as it is; also a decorator.
    """
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams["axes.formatter.useoffset"] = False
        matplotlib.rcParams["text.hinting"] = "none"  # takes a sixth of the time of a picture
        yield


class StateStyle(NamedTuple):
    """Text, color, line and pattern of a state of the joint, also for black and white."""

    label: str
    color: str
    line: Any
    hatch: str

    def area(self) -> dict[str, Any]:
        """Style of an area in this state."""
        faint = {"facecolor": to_rgba(self.color, 0.08), "edgecolor": to_rgba(self.color, 0.3)}
        return faint | {"hatch": self.hatch, "linewidth": 0}

    def patch(self) -> Patch:
        """Symbol of the state in a legend."""
        return Patch(**self.area(), label=self.label)


#: The joint's states that are marked, those that hide others first.
STATES = {
    BROKEN: StateStyle("broken", RED, "-", "///"),
    SOFTENING: StateStyle("softening", VIOLET, (0, (3, 1)), "xxx"),
    SLIPPED: StateStyle("slipped", ORANGE, (0, (1, 0.6)), "..."),
}
#: Distance of a y label from the left edge of its figure [inches].
LABEL = 0.2

#: Least distances of ticks [inches].
TICK = 0.5, 0.25
#: Least range of an axis over the largest value on it.
RANGE = 0.05


def figure_of(width: float, height: float, **options: Any) -> Figure:
    """Create an empty figure; sizes in inches."""
    figure = Figure(figsize=(width, height), **options)
    FigureCanvasAgg(figure)
    return figure


def figure_size(figure: AnyFigure) -> tuple[float, float]:
    """Width and height of a figure or subfigure [inches]."""
    return figure.bbox.width / figure.dpi, figure.bbox.height / figure.dpi


@picture_style()
def pixels_of(figure: Figure, dpi: int) -> np.ndarray:
    """The pixels of a figure (height, width, RGBA)."""
    figure.set_dpi(dpi)
    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())


def write_pixels(pixels: np.ndarray, path: Path, dpi: int, **options: int) -> None:
    """Write pixels as PNG; options: of PIL."""
    with atomic_write(path) as part:
        imsave(part, pixels, format="png", dpi=dpi, pil_kwargs=options)


def write_picture(figure: Figure, path: Path, dpi: int, **options: int) -> None:
    """Write a figure as PNG; options: of PIL."""
    write_pixels(pixels_of(figure, dpi), path, dpi, **options)


def panels(
    figure: AnyFigure,
    rows: int = 1,
    columns: int = 1,
    *,
    left: float = 0.7,
    right: float = 0.15,
    bottom: float = 0.5,
    top: float = 0.35,
    across: float = 0.75,
    down: float = 0.35,
) -> np.ndarray:
    """Create axes (rows, columns) in a figure or subfigure; margins and gaps in inches."""
    width, height = figure_size(figure)
    axes_width = (width - left - right - (columns - 1) * across) / columns
    axes_height = (height - bottom - top - (rows - 1) * down) / rows
    grid = {
        "left": left / width,
        "right": 1 - right / width,
        "bottom": bottom / height,
        "top": 1 - top / height,
        "wspace": across / axes_width,
        "hspace": down / axes_height,
    }
    table = figure.subplots(rows, columns, squeeze=False, gridspec_kw=grid)
    for axes in table.flat:
        # ticks take most of the time of a picture
        axes.locator_params(axis="x", nbins=max(2, min(5, int(axes_width / TICK[0]))))
        axes.locator_params(axis="y", nbins=max(2, min(5, int(axes_height / TICK[1]))))
        axes.tick_params(labelsize=8)
        axes.yaxis.set_label_coords((LABEL - left) / axes_width, 0.5)
    return table


def widen(axis: Axis) -> None:
    """Show at least a part RANGE of the largest value: a change in the last digits is none."""
    low, high = axis.get_view_interval()
    missing = RANGE * max(abs(low), abs(high)) - (high - low)
    if missing > 0:
        axis.set_view_interval(low - missing / 2, high + missing / 2, ignore=True)


def runs_of(values: np.ndarray) -> Iterator[tuple[int, int, int]]:
    """Runs of equal values (n,): value, first index, index after the last."""
    cuts = [0, *(np.flatnonzero(np.diff(values)) + 1).tolist(), len(values)]
    for first, end in pairwise(cuts):
        if end > first:
            yield int(values[first]), first, end


def polygons(corners: np.ndarray, **style: Any) -> PolyCollection:
    """Polygons of the same number of corners (n, corners, 2); style: of PolyCollection."""
    vertices: Any = corners  # an array is drawn faster than a sequence of arrays
    return PolyCollection(vertices, **style)


def arrow_style(color: str, **more: Any) -> dict[str, Any]:
    """Style of an annotation's arrow; more: what differs."""
    style = {"arrowstyle": "-|>", "color": color, "linewidth": 1.6, "shrinkA": 0, "shrinkB": 0}
    return style | more


def draw_cells(
    axes: Axes,
    cells: Sequence[Sequence[str]],
    letters: Sequence[int],
    box: tuple[float, float, float, float],
    size: float,
    pad: float,
    left: Sequence[int] = (0,),
) -> Table:
    """Draw a table, its first row bold, into a box of axes: left, bottom, width, height.

    letters: widths of the columns; size: of the font; pad: beside a text, over its cell's width;
    left: columns that are aligned to the left.
    """
    table = axes.table(
        cells,
        colWidths=[number / sum(letters) for number in letters],
        cellLoc="right",
        edges="horizontal",
        bbox=Bbox.from_bounds(*box),
    )
    table.auto_set_font_size(False)
    table.set_fontsize(size)
    for (row, column), cell in table.get_celld().items():
        cell.set_edgecolor(LINES)
        cell.PAD = pad
        text = cell.get_text()
        text.set_parse_math(False)
        if column in left:
            text.set_horizontalalignment("left")
        if row == 0:
            text.set_fontweight("bold")
    return table


def legend_above(axes: Axes) -> None:
    """Put the legend above the axes."""
    axes.legend(
        loc="lower left",
        bbox_to_anchor=(-0.01, 0.99),
        ncols=4,
        frameon=False,
        fontsize=7.5,
        borderpad=0.2,
        columnspacing=0.9,
        handletextpad=0.4,
        handlelength=2.0,
    )
