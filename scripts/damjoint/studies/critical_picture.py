"""The picture of a critical value: how far each dam that was tried can be filled."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..results.pictures import BLUE, GREEN, LENGTHS, ORANGE, RED, unit
from .branch import Branch

if TYPE_CHECKING:
    from .critical import Answer, Search


def draw(search: Search, answer: Answer, path: Path) -> None:
    """Draw level against crest for the two dams on both sides of the critical value and, but for a
    critical level, the level that every value can hold.
    """
    single = search.of == "level"
    figure = Figure(figsize=(7 if single else 12, 4.8), layout="constrained")
    FigureCanvasAgg(figure)
    *left, right = figure.subplots(1, 1 if single else 2, squeeze=False)[0]
    figure.suptitle(textwrap.fill(heading(search, answer), 70 if single else 120), fontsize=11)
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
        (True, GREEN, "^", "stands (the water rises no higher)"),
        (False, RED, "v", "fails: its highest equilibrium"),
    ):
        trials = [t for t in search.trials if t.stands == stands and t.branch.points]
        levels = [
            t.branch.target if stands else t.branch.points[t.branch.top].level for t in trials
        ]
        axes.plot([t.value for t in trials], levels, mark, color=color, label=label)
    if answer.value is not None:
        axes.axvline(answer.value, color="black", linewidth=0.8, label=f"{answer.value:.5g}")
    if answer.gravity is not None:
        label = f"gravity method {answer.gravity:.5g}"
        axes.axvline(answer.gravity, color="black", linestyle=":", linewidth=1, label=label)
    axes.set(xlabel=f"{search.of}" + f" [{search.unit.strip() or '-'}]", ylabel="level [m]")


def draw_branches(axes: Axes, search: Search, answer: Answer) -> None:
    """Level against crest of the last dam that stands and of the last one that fails.

    A branch that ends in a plateau is drawn up to where it is reached and half as far again.
    """
    chosen = [
        next((t for t in reversed(search.trials) if t.stands == s), None) for s in (True, False)
    ]
    branches = [(t, pushed_so_far(t.branch)) for t in chosen if t and t.branch.points]
    crests = [[p.last["crest_ux"] for p in points] for _, points in branches]
    name, factor = unit([abs(max(c, key=abs)) for c in crests], LENGTHS)
    for (trial, points), crest in zip(branches, crests, strict=True):
        label = f"{search.of} {trial.value:.6g}{search.unit}"
        color = GREEN if trial.stands else BLUE
        axes.plot(
            [c * factor for c in crest],
            [p.level for p in points],
            "o-",
            color=color,
            markersize=3,
            label="equilibria" if search.of == "level" else label,
        )
    if search.of == "level" and answer.value is not None:
        axes.axhline(answer.value, color=ORANGE, linewidth=0.8, label=f"{answer.value:.5g} m")
        if answer.gravity is not None:
            label = f"gravity method {answer.gravity:.5g} m"
            axes.axhline(answer.gravity, color="black", linestyle=":", linewidth=1, label=label)
    axes.set(xlabel=f"crest, downstream [{name}]", ylabel="level [m]")


def pushed_so_far(branch: Branch) -> list:
    """The points of a branch up to three times the push of its highest level."""
    far = 3 * (branch.points[branch.top].pushed or branch.size)
    return [p for p in branch.points if p.pushed <= far]
