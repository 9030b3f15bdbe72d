"""The curves that the window shows: along the joint, over the levels, over an earthquake."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..arrays import Table
from ..model.fields import along
from ..pictures.scene import is_extruded
from ..units import FORCES, LENGTHS, STRESSES, Units
from .gallery import BLUE, DARK, GREEN, GREY, LAKE, ORANGE, RED, Color
from .graphs import BEFORE, Curve, Graph, Graphs
from .numbers import ACCELERATIONS, SECONDS
from .scene import SolvedScene

METRES: Units = LENGTHS[:1]
#: Parts of the time of an earthquake of which the smallest and the largest value are drawn.
PARTS = 300
#: Curves along the joint, the most important first: title, units, curves (name, column, color).
ALONG_JOINT: tuple[tuple[str, Units, tuple[tuple[str, str, Color], ...]], ...] = (
    ("opening", LENGTHS, (("", "delta_n", BLUE),)),
    ("normal stress", STRESSES, (("total", "sigma_n", BLUE), ("effective", "sigma_n_eff", GREEN))),
    ("shear stress", STRESSES, (("", "tau_1", ORANGE),)),
    ("slip", LENGTHS, (("jump", "delta_t1", ORANGE), ("slip", "slip", DARK))),
    ("water pressure", STRESSES, (("", "p", LAKE),)),
)
#: Columns and graphs that only a scene with water in the joint has.
OF_WATER = "sigma_n_eff", "p"


def show_graphs(graphs: Graphs, scene: SolvedScene, before: Sequence[SolvedScene]) -> None:
    """Show the graphs of a scene for which there is space, the most important first.

    before: earlier runs, whose last curves are drawn in grey.
    """
    joint, levels = list[Graph](), list[Graph]()
    if scene.times.size and is_extruded(scene.result.case):
        joint = graphs_along_joint(scene, [other for other in before if other.times.size])
    if scene.quake is not None:
        rows = within(scene.quake, scene.times)
        others = [within(other.quake, scene.times) for other in before if other.quake is not None]
        for graph in graphs_over_time(rows, [other for other in others if len(other["time"])]):
            graphs.add(*graph, now=scene.times.clip(rows["time"][0]))
    elif len(scene.result.history["time"]):
        levels = graphs_of_history(scene, before)
    positions = marks_of_steps(scene) if levels else []
    marked = list(zip(levels, positions, strict=True))
    unmarked = [(graph, UNMARKED) for graph in joint]
    for graph, (now, level) in (*unmarked[:2], *marked[:1], *unmarked[2:], *marked[1:]):
        graphs.add(*graph, now=now, level=level)
    graphs.write_names()


#: Curves of an earthquake, the most important first: title, units, (name, column, color) of each.
OVER_TIME: tuple[tuple[str, Units, tuple[tuple[str, str, Color], ...]], ...] = (
    ("ground", ACCELERATIONS, (("x", "ground_ax", DARK), ("y", "ground_ay", ORANGE))),
    ("crest movement", LENGTHS, (("", "crest_ux", BLUE),)),
    ("opening", LENGTHS, (("heel", "heel_opening", RED), ("toe", "toe_opening", GREEN))),
    ("slip", LENGTHS, (("", "slip_mean", ORANGE),)),
    (
        "shear force T",
        FORCES,
        (("T", "T", BLUE), ("strength", "strength", RED), ("", "strength against", RED)),
    ),
)


def graphs_over_time(rows: Table, earlier: list[Table]) -> list[Graph]:
    """Graphs of the rows of an earthquake; earlier: those of earlier runs, for comparison."""
    shown = []
    for title, units, parts in OVER_TIME:
        curves = [
            Curve(name, *envelope(rows, column), color)
            for name, column, color in parts
            if column in rows and (column != "ground_ay" or rows[column].any())
        ]
        first = parts[0][1]
        curves += [Curve(BEFORE, *envelope(other, first), GREY) for other in earlier]
        shown.append(((title, units), ("time", SECONDS), curves))
    return shown


def within(rows: Table, times: np.ndarray) -> Table:
    """The rows between the second frame, or the one before if they are regular, and the last one;
    all rows with the frame of the static state alone.
    """
    first = max(2 * times[1] - times[2], 0.0) if len(times) > 2 else 0.0
    shown = (rows["time"] >= first) & (rows["time"] <= (times[-1] or math.inf))
    return {name: column[shown] for name, column in rows.items()}


def envelope(rows: Table, column: str) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) and values (1, n) of a column: the smallest and the largest of each part."""
    chosen = [
        part[[first, last]]
        for part in np.array_split(np.arange(len(rows["time"])), PARTS)
        if len(part)
        for first, last in [sorted((rows[column][part].argmin(), rows[column][part].argmax()))]
    ]
    index = np.unique(chosen)
    return rows["time"][index], rows[column][index][None]


def graphs_along_joint(scene: SolvedScene, before: Sequence[SolvedScene]) -> list[Graph]:
    """Opening, stresses, slip and pressure along the joint (means over z in 3D)."""
    shown = []
    rows = [along(scene.joint_result.at(time)) for time in scene.times]
    earlier = [along(other.joint_result.at()) for other in before]
    wet = scene.result.case["uplift"] != "none"
    for title, units, parts in ALONG_JOINT:
        curves = [
            Curve(name, rows[0]["s"], np.array([r[column] for r in rows]), color)
            for name, column, color in parts
            if wet or column not in OF_WATER
        ]
        if curves:
            first = parts[0][1]
            curves += [Curve(BEFORE, other["s"], other[first][None], GREY) for other in earlier]
            shown.append(((title, units), ("from the heel", METRES), curves))
    return shown


#: Curves of the level: title, column, units, color.
OVER_LEVELS: tuple[tuple[str, str, Units, Color], ...] = (
    ("largest opening", "max_opening", LENGTHS, BLUE),
    ("crest movement", "crest_ux", LENGTHS, BLUE),
    ("crack length", "crack_length", METRES, RED),
)


def column_of_levels(scene: SolvedScene, column: str) -> np.ndarray:
    """A column of the history as drawn: heel's opening if it is controlled, else none below 0."""
    if column != "max_opening":
        return scene.joint_result.history[column]
    driven = scene.result.case["drive"] != "level"
    return scene.result.heel if driven else np.maximum(scene.joint_result.history[column], 0.0)


#: Places of the steps on both axes; None: not marked.
Places = tuple[np.ndarray | None, np.ndarray | None]
UNMARKED: Places = None, None


def marks_of_steps(scene: SolvedScene) -> list[Places]:
    """Places of the steps shown on both axes of the graphs of the history."""
    history = scene.joint_result.history
    rows = [int(np.argmin(np.abs(history["time"] - time))) for time in scene.times]
    if not rows:
        return [UNMARKED] * len(OVER_LEVELS)
    columns = [column_of_levels(scene, column) for _, column, *_ in OVER_LEVELS]
    return [(x[rows] if len(x) else None, history["level"][rows]) for x in columns]


def graphs_of_history(scene: SolvedScene, before: Sequence[SolvedScene]) -> list[Graph]:
    """The level over opening, crest displacement and crack length, all converged steps."""
    driven, shown = scene.result.case["drive"] != "level", []
    for title, column, units, color in OVER_LEVELS:
        title = "heel opening" if driven and column == "max_opening" else title
        curves = []
        for other in (scene, *before):
            history, x = other.joint_result.history, column_of_levels(other, column)
            if len(x):
                name, kind = ("", color) if other is scene else (BEFORE, GREY)
                curves.append(Curve(name, x, history["level"][None], kind, points=other is scene))
        shown.append((("level", METRES), (title, units), curves))
    return shown
