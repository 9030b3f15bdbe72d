"""Picture of a critical value: levels that the tried dams reach, and two equilibrium paths."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..input.case import Case
from ..mesh.mesh import crest_level
from ..model.fields import Solution
from ..model.loads import Loading
from ..model.results import Results
from ..pictures.drawing import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    RED,
    WATER,
    panels,
    picture_style,
    widen,
    write_picture,
)
from ..pictures.drawing import figure_of as drawing_of
from ..pictures.run_picture import draw_dam
from ..pictures.scene import loads_label, state_label
from ..solver.path_point import Point
from ..units import LENGTHS, unit
from .critical_value import CriticalValue
from .failure_path import FailurePath, Trial

#: Ratio of the largest to the smallest value above which the values have a logarithmic axis.
WIDE = 30
GRAVITY = "gravity method"
#: Widths of the dam and of a diagram, height below the heading [inches]; letters in an inch of the
#: heading's title and of its other lines.
DAM, CURVE, HEIGHT, TITLE, FACT = 7.0, 5.5, 5.4, 12, 14
#: Height of the axis labels and the legend below a diagram [inches].
LEGEND = 1.7
#: Line styles of the gravity method's values, by its assumptions.
DASHES: tuple[Any, ...] = ":", "--", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 3))


class Content(NamedTuple):
    """Content of the picture: case, varied quantity and its unit, trials, what the search found,
    its last equilibrium, and this with the fields of the bodies.
    """

    case: Case
    of: str
    unit: str
    trials: Sequence[Trial]
    answer: CriticalValue
    result: Results | None
    solution: Solution | None = None

    @property
    def facts(self) -> list[str]:
        """Why the value is confirmed, or why not and how the dam would fail; the loads; the joint
        that fails in its last equilibrium.
        """
        answer, result = self.answer, self.result
        would = f" ({answer.failure})" if answer.failure else ""
        facts = [answer.why or f"{answer.doubt}{would}"]
        if result and (last := result.last):
            loading = Loading.at(self.case, self.case.times[-1], last["level"], last["tail_level"])
            facts.append(f"loads: {loads_label(self.case, loading)}")
            names = result.case.joint_names
            k = names.index(answer.joint) if answer.joint in names else 0
            name = f"{names[k]}, last equilibrium" if self.case.of_joints else "last equilibrium"
            of_joint = result.joints[k]
            facts.append(f"{name}: {state_label(of_joint.case, of_joint.last)}")
        return facts

    @property
    def by_hand(self) -> dict[str, float]:
        """All values of the gravity method."""
        answer = self.answer
        if answer.gravity is None:
            return {}
        where = f" on {answer.gravity_joint}" if answer.gravity_joint else ""
        there = {} if answer.gravity_there is None else {f"on {answer.joint}": answer.gravity_there}
        named = {f"{GRAVITY} {n}": v for n, v in (there | {**answer.gravity_with}).items()}
        return {f"{GRAVITY}{where}": answer.gravity} | named


def draw(content: Content, path: Path) -> None:
    """Write the picture of a critical value."""
    write_picture(figure_of(content), path, 110)


@picture_style()
def figure_of(content: Content) -> Figure:
    """Draw level against crest displacement on both sides of the critical value; unless that is a
    level, also the highest level with each value; below, the dam in its last equilibrium.
    """
    curves, wide = 1 if content.of == "level" else 2, DAM if content.solution else 0.0
    width = CURVE * curves + wide
    title = textwrap.wrap(heading(content), int(TITLE * width))
    lines = [line for fact in content.facts for line in textwrap.wrap(fact, int(FACT * width))]
    head = 0.15 + 0.2 * len(title) + 0.17 * len(lines)
    figure = drawing_of(width, head + HEIGHT)
    rows = figure.subfigures(2, 1, squeeze=False, height_ratios=(head, HEIGHT))
    top, below = rows[:, 0]
    for texts, y, size in ((title, 0.08, 11), (lines, 0.12 + 0.2 * len(title), 9)):
        position = 0.1 / width, 1 - y / head
        top.text(*position, "\n".join(texts), va="top", fontsize=size, parse_math=False)
    of_curves = below
    if content.solution:
        ratios = wide, CURVE * curves
        of_dam, of_curves = below.subfigures(1, 2, squeeze=False, width_ratios=ratios)[0]
        draw_dam(of_dam, content.solution, float(content.solution.result.last["time"]))
    *of_trials, of_paths = panels(of_curves, 1, curves, bottom=LEGEND, top=0.2)[0]
    for axes in of_trials:
        draw_trials(axes, content)
    draw_paths(of_paths, content)
    for axes in (*of_trials, of_paths):
        draw_levels(axes, content)
        widen(axes.yaxis)
        axes.grid(alpha=0.3)
        if axes.get_legend_handles_labels()[0]:  # an interrupted search may have no trial
            position = 0, -0.5 / (HEIGHT - LEGEND - 0.2)
            axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=position, frameon=False)
    return figure


def draw_levels(axes: Axes, content: Content) -> None:
    """Draw the required level and the crest."""
    if content.of != "level":
        level = max(content.case.levels)
        label = f"required level {level:.5g} m"
        axes.axhline(level, color=WATER, linewidth=0.9, label=label)
    crest = crest_level(content.case)
    axes.axhline(crest, color=GREY, linestyle="-.", lw=0.9, label=f"crest {crest:.5g} m")


def heading(content: Content) -> str:
    """Title of the picture: critical value and failure mode."""
    title, answer = content.case.title, content.answer
    if answer.value is None:
        return f"{title}: no critical {content.of} found"
    text = f"{title}: critical {content.of} {answer.value:.5g}{content.unit}"
    if not answer.confirmed:
        return text + ", not confirmed"
    return text + (f", {answer.failure}" if answer.failure else "")


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


def critical_lines(content: Content) -> list[tuple[float, Any, str]]:
    """Lines that mark the critical values: value, line style, label."""
    by_hand = zip(content.by_hand.values(), DASHES, content.by_hand, strict=False)
    lines = [(content.answer.value, "-", "critical"), *by_hand]
    return [(v, style, f"{name} {v:.5g}") for v, style, name in lines if v is not None]


def draw_paths(axes: Axes, content: Content) -> None:
    """Draw level against crest of the last dam that stands and of the last one that fails."""
    last = {trial.stands: trial for trial in content.trials if trial.path.points}
    paths = [points_shown(trial.path) for trial in last.values()]
    crests = [[p.last["crest_ux"] for p in points] for points in paths]
    name, factor = unit([np.array(crest) for crest in crests], LENGTHS)
    for trial, points, crest in zip(last.values(), paths, crests, strict=True):
        end = "stands" if trial.stands else "fails"
        label = f"{content.of} {trial.value:.7g}{content.unit}: {end}"
        axes.plot(
            [ux * factor for ux in crest],
            [p.level for p in points],
            "o-" if trial.stands or len(paths) == 1 else "x--",
            color=BLUE if len(paths) == 1 else GREEN if trial.stands else RED,
            markersize=3 if trial.stands or len(paths) == 1 else 5,
            label="equilibria" if content.of == "level" else label,
        )
    for value, style, label in critical_lines(content) if content.of == "level" else ():
        axes.axhline(value, color=ORANGE, linestyle=style, linewidth=1.2, label=f"{label} m")
    axes.set(xlabel=f"crest, downstream [{name}]", ylabel="level [m]")


def points_shown(path: FailurePath) -> list[Point]:
    """Points of a path up to twice the displacement at its highest level."""
    far = 2 * path.imposed(path.points[path.top])
    return [p for p in path.points if p.imposed <= far]
