"""Picture of the fragility: curves with their intervals over the shares of the rows."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ..pictures.drawing import BLUE, DARK, GREEN, ORANGE, RED, VIOLET, picture_style, write_picture
from ..pictures.drawing import figure_of as drawing_of
from .fragility import Fit
from .quake_summary import INTENSITIES

COLORS = BLUE, RED, GREEN, ORANGE, VIOLET, DARK
#: Names of the intensities.
NAMES = {
    "peak_ground_ax": "largest acceleration of the ground",
    "peak_ground_vx": "largest velocity of the ground",
    "arias_x": "Arias' intensity",
    "spectral_ax": "spectral acceleration at the dam's first period",
}
#: Width of the picture over that of the intensities, as a factor on both sides [-].
MARGIN = 1.15


def draw(curves: Sequence[Fit], title: str, intensity: str, path: Path) -> None:
    """Draw the fragility of limits to path."""
    write_picture(figure_of(curves, title, intensity), path, 110)


@picture_style()
def figure_of(curves: Sequence[Fit], title: str, intensity: str) -> Figure:
    """The figure."""
    figure = drawing_of(9, 5.4, layout="constrained")
    axes = figure.subplots()
    least, most = (f(np.concatenate([c.intensity for c in curves])) for f in (np.min, np.max))
    x = np.geomspace(least / MARGIN, most * MARGIN, 200)
    for curve, color in zip(curves, COLORS * len(curves), strict=False):
        if curve.reason:
            axes.plot([], [], "none", label=f"{curve.words}: {curve.reason}")
            continue
        share, low, high = curve.probability(x)
        axes.fill_between(x, low, high, color=color, alpha=0.15, linewidth=0)
        words = f"{curve.words}: median {curve.median:.3g} {INTENSITIES[intensity]}"
        axes.plot(x, share, color=color, label=f"{words}, dispersion {curve.dispersion:.2g}")
        for at, part, lower, upper in curve.shares():
            axes.plot([at, at], [lower, upper], color=color, lw=0.8, alpha=0.7)
            axes.plot([at], [part], "o", color=color, ms=4)
        axes.plot(curve.intensity, curve.exceeds * 1.0, "|", color=color, ms=9, alpha=0.5)
    axes.plot([], [], "o-", color="grey", ms=4, lw=0.8, label="share of a group of rows")
    axes.fill_between([], [], color="grey", alpha=0.3, label="95 % interval of the curve")
    unit = INTENSITIES[intensity].replace("2", "$^2$")
    axes.set(xlabel=f"{NAMES[intensity]} [{unit}]", ylabel="probability to exceed the limit [-]")
    axes.set(ylim=(-0.03, 1.03), xlim=(x[0], x[-1]))
    axes.grid(alpha=0.3)
    figure.legend(fontsize=8, loc="outside lower center", ncols=2)
    title = f"{title}: fragility, {len(curves[0].exceeds)} rows, {curves[0].records} records"
    figure.suptitle(textwrap.fill(title, 100), fontsize=11, parse_math=False)
    return figure
