"""The picture of a critical value: how far each dam that was tried can be filled."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..results.pictures import BLUE, GREEN, LENGTHS, ORANGE, RED, unit
from .branch import Branch, Point

if TYPE_CHECKING:
    from .critical import Answer, Search


def draw(search: Search, answer: Answer, path: Path) -> None:
    """Draw level against crest for the dams on both sides of the critical value and, but for a
    critical level, the highest level with every value.
    """
    single = search.of == "level"
    figure = Figure(figsize=(7.5 if single else 12, 4.8), layout="constrained")
    FigureCanvasAgg(figure)
    *left, right = figure.subplots(1, 1 if single else 2, squeeze=False)[0]
    said = textwrap.fill(heading(search, answer), 75 if single else 120)
    figure.suptitle(said, fontsize=11, parse_math=False)
    for axes in left:
        draw_trials(axes, search, answer)
    draw_branches(right, search, answer)
    for axes in (*left, right):
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    figure.savefig(path, dpi=110)


def heading(search: Search, answer: Answer) -> str:
    """What the picture shows, in a line."""
    if answer.value is None:
        return f"{search.own.title}: no critical {search.of} found"
    said = f"{search.own.title}: critical {search.of} {answer.value:.5g}{search.unit}"
    return said + (f", {answer.mode}" if answer.mode else "")


def draw_trials(axes: Axes, search: Search, answer: Answer) -> None:
    """The highest level found with each value."""
    for stands, color, mark, label in (
        (True, GREEN, "^", "stands at the level asked for"),
        (False, RED, "v", "fails: its highest level"),
    ):
        branches = {t.value: t.branch for t in search.trials if t.stands == stands}
        levels = [b.target if stands else b.highest for b in branches.values()]
        axes.plot(list(branches), levels, mark, color=color, label=label)
    for value, style, label in marks(answer):
        axes.axvline(value, color="black", linestyle=style, linewidth=0.9, label=label)
    axes.set(xlabel=f"{search.of} [{search.unit.strip() or '-'}]", ylabel="level [m]")


def marks(answer: Answer) -> list[tuple[float, str, str]]:
    """The critical values to be marked: value, line style, label."""
    by = ((answer.value, "-", "critical"), (answer.gravity, ":", "gravity method"))
    return [(v, style, f"{name} {v:.5g}") for v, style, name in by if v is not None]


def draw_branches(axes: Axes, search: Search, answer: Answer) -> None:
    """Level against crest of the last dam that stands and of the last one that fails."""
    last = {t.stands: t for t in search.trials if t.branch.points}
    shown = [(t, until_beyond(t.branch)) for t in last.values()]
    crests = [[p.last["crest_ux"] for p in points] for _, points in shown]
    name, factor = unit([abs(max(crest, key=abs)) for crest in crests], LENGTHS)
    for (trial, points), crest in zip(shown, crests, strict=True):
        label = f"{search.of} {trial.value:.6g}{search.unit}"
        axes.plot(
            [value * factor for value in crest],
            [p.level for p in points],
            "o-",
            color=GREEN if trial.stands else BLUE,
            markersize=3,
            label="equilibria" if search.of == "level" else label,
        )
    for value, style, label in marks(answer) if search.of == "level" else ():
        axes.axhline(value, color=ORANGE, linestyle=style, linewidth=1.2, label=f"{label} m")
    axes.set(xlabel=f"crest, downstream [{name}]", ylabel="level [m]")


def until_beyond(branch: Branch) -> list[Point]:
    """The points of a branch up to twice the push of its highest level."""
    far = 2 * (branch.points[branch.top].pushed or branch.size)
    return [p for p in branch.points if p.pushed <= far]
