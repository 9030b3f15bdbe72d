"""The picture of a critical value: how far each dam that was tried can be filled."""

from __future__ import annotations

import textwrap
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..post.drawing import write_picture
from ..post.pictures import BLUE, GREEN, LENGTHS, ORANGE, RED, unit
from ..solver.path import Point
from .failure_path import FailurePath


class Found(NamedTuple):
    """What is drawn: title, what is varied and its unit, (value, stands, branch) of each trial, the
    critical value by both methods (or None), the mode.
    """

    title: str
    of: str
    unit: str
    trials: list[tuple[float, bool, FailurePath]]
    value: float | None
    gravity: float | None
    mode: str


def draw(found: Found, path: Path) -> None:
    """Draw level against crest for the dams on both sides of the critical value and, but for a
    critical level, the highest level with every value.
    """
    single = found.of == "level"
    figure = Figure(figsize=(7.5 if single else 12, 4.8), layout="constrained")
    FigureCanvasAgg(figure)
    *left, right = figure.subplots(1, 1 if single else 2, squeeze=False)[0]
    said = textwrap.fill(heading(found), 75 if single else 120)
    figure.suptitle(said, fontsize=11, parse_math=False)
    for axes in left:
        draw_trials(axes, found)
    draw_branches(right, found)
    for axes in (*left, right):
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    write_picture(figure, path, 110)


def heading(found: Found) -> str:
    """What the picture shows, in a line."""
    if found.value is None:
        return f"{found.title}: no critical {found.of} found"
    said = f"{found.title}: critical {found.of} {found.value:.5g}{found.unit}"
    return said + (f", {found.mode}" if found.mode else "")


def draw_trials(axes: Axes, found: Found) -> None:
    """The highest level found with each value."""
    for stands, color, mark, label in (
        (True, GREEN, "^", "stands at the level asked for"),
        (False, RED, "v", "fails: its highest level"),
    ):
        branches = {v: branch for v, ends, branch in found.trials if ends == stands}
        levels = [b.target if stands else b.highest for b in branches.values()]
        axes.plot(list(branches), levels, mark, color=color, label=label)
    for value, style, label in marks(found):
        axes.axvline(value, color="black", linestyle=style, linewidth=0.9, label=label)
    axes.set(xlabel=f"{found.of} [{found.unit.strip() or '-'}]", ylabel="level [m]")


def marks(found: Found) -> list[tuple[float, str, str]]:
    """The critical values to be marked: value, line style, label."""
    by = ((found.value, "-", "critical"), (found.gravity, ":", "gravity method"))
    return [(v, style, f"{name} {v:.5g}") for v, style, name in by if v is not None]


def draw_branches(axes: Axes, found: Found) -> None:
    """Level against crest of the last dam that stands and of the last one that fails."""
    last = {ends: (value, branch) for value, ends, branch in found.trials if branch.points}
    shown = [(ends, value, until_beyond(branch)) for ends, (value, branch) in last.items()]
    crests = [[p.last["crest_ux"] for p in points] for *_, points in shown]
    name, factor = unit([abs(max(crest, key=abs)) for crest in crests], LENGTHS)
    for (stands, value, points), crest in zip(shown, crests, strict=True):
        label = f"{found.of} {value:.6g}{found.unit}"
        axes.plot(
            [moved * factor for moved in crest],
            [p.level for p in points],
            "o-",
            color=GREEN if stands else BLUE,
            markersize=3,
            label="equilibria" if found.of == "level" else label,
        )
    for value, style, label in marks(found) if found.of == "level" else ():
        axes.axhline(value, color=ORANGE, linestyle=style, linewidth=1.2, label=f"{label} m")
    axes.set(xlabel=f"crest, downstream [{name}]", ylabel="level [m]")


def until_beyond(path: FailurePath) -> list[Point]:
    """The points of a path up to twice the displacement of its highest level."""
    far = 2 * path.imposed(path.points[path.top])
    return [p for p in path.points if p.imposed <= far]
