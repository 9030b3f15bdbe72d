"""Picture of derivatives: what one percent, or one standard deviation, more or less of each
parameter changes (a tornado).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import wrap

import numpy as np
from matplotlib.figure import Figure

from ..arrays import Value
from .drawing import BLUE, ORANGE, figure_of, picture_style, write_picture

#: Parameters that are drawn at most, the first ones; inches of a bar, and of a result.
MOST, BAR, PANEL = 12, 0.26, 2.6
#: Ending of the name of the picture, after that of the case.
ENDING = "_sensitivity.png"


def draw(listed: Sequence[Mapping[str, Value]], title: str, path: Path) -> None:
    """Draw changes (see `sensitivity.changes`), unless there are none."""
    drawn = [cells for cells in listed if cells.get("deviation", cells["value"])][:MOST]
    if drawn:
        write_picture(figure(drawn, title), path, 130)


@picture_style()
def figure(drawn: Sequence[Mapping[str, Value]], title: str) -> Figure:
    """A panel for each result that changes, a pair of bars for each parameter, the largest change
    on top.
    """
    heads = [n for n in drawn[0] if n.endswith("]") and any(cells[n] for cells in drawn)]
    width, height = 1.5 + PANEL * len(heads), 1.45 + BAR * len(drawn)
    picture = figure_of(width, height)
    text = "\n".join(wrap(title, int(14 * width)))
    picture.text(0.1 / width, 1 - 0.1 / height, text, va="top", fontsize=9, parse_math=False)
    rows = np.arange(len(drawn))
    by = "one standard deviation" if "deviation" in drawn[0] else "1 %"
    for k, head in enumerate(heads):
        position = (1.4 + k * PANEL) / width, 0.55 / height, 0.85 * PANEL / width
        axes = picture.add_axes((*position, BAR * len(drawn) / height))
        sizes = np.array([float(cells[head]) for cells in drawn])
        axes.barh(rows, sizes, color=BLUE, label=f"{by} more")
        axes.barh(rows, -sizes, color=ORANGE, label=f"{by} less")
        axes.axvline(0, color="black", linewidth=0.6)
        axes.set_yticks(rows, [str(cells["parameter"]) for cells in drawn] if not k else [])
        axes.set_ylim(len(drawn) - 0.5, -0.5)
        axes.set_xlabel(f"change of {head}", fontsize=8)
        axes.tick_params(labelsize=8)
        axes.xaxis.get_offset_text().set(fontsize=7)
        axes.locator_params(axis="x", nbins=5)
    bars = picture.axes[0].get_legend_handles_labels()
    corner = 1.0, 1 - 0.42 / height
    picture.legend(*bars, fontsize=7, ncols=2, loc="upper right", bbox_to_anchor=corner)
    return picture
