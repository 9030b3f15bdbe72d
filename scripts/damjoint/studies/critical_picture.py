"""Picture of a critical value: levels that the tried dams reach, and two equilibrium paths."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..post.drawing import BLUE, GREEN, ORANGE, RED, write_picture
from ..post.units import LENGTHS, unit
from ..solver.path import Point
from .failure_path import FailurePath, Trial

#: Ratio of the largest to the smallest value above which the values have a logarithmic axis.
WIDE = 30


class Content(NamedTuple):
    """Content of the picture: title, varied quantity and its unit, trials, critical value by both
    methods (None: not found), failure mode.
    """

    title: str
    of: str
    unit: str
    trials: list[Trial]
    value: float | None
    gravity: float | None
    mode: str


def draw(content: Content, path: Path) -> None:
    """Draw level against crest displacement on both sides of the critical value; unless that is a
    level, also the highest level with each value.
    """
    single = content.of == "level"
    figure = Figure(figsize=(7.5 if single else 12, 4.8), layout="constrained")
    FigureCanvasAgg(figure)
    *of_trials, of_paths = figure.subplots(1, 1 if single else 2, squeeze=False)[0]
    title = textwrap.fill(heading(content), 75 if single else 120)
    figure.suptitle(title, fontsize=11, parse_math=False)
    for axes in of_trials:
        draw_trials(axes, content)
    draw_paths(of_paths, content)
    for axes in (*of_trials, of_paths):
        axes.grid(alpha=0.3)
        if axes.get_legend_handles_labels()[0]:  # an interrupted search may have no trial
            axes.legend(fontsize=8)
    write_picture(figure, path, 110)


def heading(content: Content) -> str:
    """Title of the picture: critical value and failure mode."""
    if content.value is None:
        return f"{content.title}: no critical {content.of} found"
    text = f"{content.title}: critical {content.of} {content.value:.5g}{content.unit}"
    return text + (f", {content.mode}" if content.mode else "")


def draw_trials(axes: Axes, content: Content) -> None:
    """Draw the highest level reached with each value."""
    for stands, color, mark, label in (
        (True, GREEN, "^", "stands at the required level"),
        (False, RED, "v", "fails: its highest level"),
    ):
        paths = {trial.value: trial.path for trial in content.trials if trial.stands == stands}
        levels = [p.target if stands else p.highest for p in paths.values()]
        if paths:
            axes.plot(list(paths), levels, mark, color=color, label=label)
    values = [abs(trial.value) for trial in content.trials]
    if min(values) > 0 and max(values) > WIDE * min(values):
        axes.set_xscale("log")
    for value, style, label in critical_lines(content):
        axes.axvline(value, color="black", linestyle=style, linewidth=0.9, label=label)
    axes.set(xlabel=f"{content.of} [{content.unit.strip() or '-'}]", ylabel="level [m]")


def critical_lines(content: Content) -> list[tuple[float, str, str]]:
    """Lines that mark the critical values: value, line style, label."""
    lines = ((content.value, "-", "critical"), (content.gravity, ":", "gravity method"))
    return [(v, style, f"{name} {v:.5g}") for v, style, name in lines if v is not None]


def draw_paths(axes: Axes, content: Content) -> None:
    """Draw level against crest of the last dam that stands and of the last one that fails."""
    last = {trial.stands: trial for trial in content.trials if trial.path.points}
    paths = [points_shown(trial.path) for trial in last.values()]
    crests = [[p.last["crest_ux"] for p in points] for points in paths]
    name, factor = unit([abs(max(crest, key=abs)) for crest in crests], LENGTHS)
    for trial, points, crest in zip(last.values(), paths, crests, strict=True):
        label = f"{content.of} {trial.value:.6g}{content.unit}"
        axes.plot(
            [ux * factor for ux in crest],
            [p.level for p in points],
            "o-" if trial.stands or len(paths) == 1 else "s--",
            color=GREEN if trial.stands else BLUE,
            markersize=3,
            label="equilibria" if content.of == "level" else label,
        )
    for value, style, label in critical_lines(content) if content.of == "level" else ():
        axes.axhline(value, color=ORANGE, linestyle=style, linewidth=1.2, label=f"{label} m")
    axes.set(xlabel=f"crest, downstream [{name}]", ylabel="level [m]")


def points_shown(path: FailurePath) -> list[Point]:
    """Points of a path up to twice the displacement at its highest level."""
    far = 2 * path.imposed(path.points[path.top])
    return [p for p in path.points if p.imposed <= far]
