"""What the pictures have in common: colors, sizes in inches, legends that cover nothing."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg  # not pyplot: it costs half of a 2D run
from matplotlib.figure import Figure, FigureBase

from ..storage import atomic_write

matplotlib.rcdefaults()  # not what a matplotlibrc in the present folder says

BLUE, ORANGE, WATER, RED, GREEN = "#0b5394", "#cc7a00", "#3d9be0", "#b3261e", "#2e7d32"
VIOLET = "#8e24aa"
GREY, DARK, CONCRETE, ROCK, SILT = "#8a8a8a", "#333333", "#c3ccd6", "#d8c9ae", "#a1866f"


def figure_of(width: float, height: float) -> Figure:
    """An empty figure, sizes in inches."""
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure


def write_picture(figure: Figure, path: Path, dpi: int, **how: int) -> None:
    """Write a figure; how: what PIL takes."""
    with atomic_write(path) as part:
        figure.savefig(part, dpi=dpi, format="png", pil_kwargs=how)


def panels(
    figure: FigureBase,
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
    """Axes (rows, columns) in a figure or a part of one; margins and gaps in inches."""
    width, height = figure.bbox.size / figure.dpi
    inner = (width - left - right - (columns - 1) * across) / columns
    deep = (height - bottom - top - (rows - 1) * down) / rows
    where = {
        "left": left / width,
        "right": 1 - right / width,
        "bottom": bottom / height,
        "top": 1 - top / height,
        "wspace": across / inner,
        "hspace": down / deep,
    }
    found = figure.subplots(rows, columns, squeeze=False, gridspec_kw=where)
    for axes in found.flat:
        axes.locator_params(nbins=6)  # of the time of a picture, most goes into ticks
        axes.tick_params(labelsize=9)
        axes.yaxis.set_label_coords((0.2 - left) / inner, 0.5)
    return found


def legend_above(axes: Axes, columns: int = 4) -> None:
    """The legend over the panel, where it covers nothing."""
    axes.legend(
        loc="lower left",
        bbox_to_anchor=(-0.01, 0.99),
        ncols=columns,
        frameon=False,
        fontsize=8,
        borderpad=0.2,
        columnspacing=1.2,
        handlelength=1.6,
    )
