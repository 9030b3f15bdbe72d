"""The picture of a check: the section with its water, and hanging under the joint the uplift and
the effective stress, by the finite elements and by the gravity method.
"""

from __future__ import annotations

import textwrap
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..model.fields import SOFTENING, along, state_of
from ..model.parameters import constants
from ..model.results import Results
from ..statics.gravity import GravityMethod
from .drawing import BLUE, GREEN, ORANGE, RED, VIOLET, WATER, write_picture
from .pictures import heading
from .units import STRESSES, unit

CONCRETE, ROCK, SILT = "#c3ccd6", "#e6dcc8", "#a98d5d"
#: Depth and height of the two diagrams under the joint, over the joint's length.
UPLIFT_AT, STRESS_AT, TALL = 0.14, 0.52, 0.24

COMPUTED, HAND = "finite elements", "gravity method"
#: Of a stress, in every table and diagram.
SIGN = "tension > 0"


def draw_check(
    result: Results, method: GravityMethod, cells: list[tuple[str, ...]], why: str, folder: Path
) -> Path:
    """Draw the last saved state to folder/<case>_check.png and return its path.

    cells: the table beside it, its head in the first row; the first column is what, the others are
    what the methods say; why: what fails, in words.
    """
    figure = Figure(figsize=(11, 7.2))
    FigureCanvasAgg(figure)
    section = figure.add_axes((0.055, 0.075, 0.59, 0.81))
    beside = figure.add_axes((0.665, 0.075, 0.325, 0.81))
    head = textwrap.fill(heading(result), 100)
    figure.text(0.055, 0.975, head, fontsize=13, va="top", parse_math=False)
    figure.text(0.055, 0.94, textwrap.fill(why, 150), fontsize=9, color=RED, va="top")
    draw_scene(section, method)
    draw_joint(section, result, method)
    handles, labels = section.get_legend_handles_labels()
    beside.legend(handles, labels, loc="lower left", fontsize=9, frameon=False)
    beside.axis("off")
    draw_cells(beside, cells)
    path = folder / f"{method.case.name}_check.png"
    write_picture(figure, path, 130)
    return path


def draw_cells(axes: Axes, cells: list[tuple[str, ...]]) -> None:
    """A table in the upper part of axes."""
    height = min(0.045 * len(cells), 0.75)
    others = len(cells[0]) - 1
    first = 0.34 if others < 4 else 0.3
    widths = [first, *[(1 - first) / others] * others]
    table = axes.table(
        cells,
        colWidths=widths,
        cellLoc="right",
        edges="horizontal",
        bbox=(0, 1 - height, 1, height),
    )
    table.auto_set_font_size(False)
    table.set_fontsize(9)
    for (row, column), cell in table.get_celld().items():
        cell.set_edgecolor("#b0b0b0")
        cell.PAD = 0.03
        text = cell.get_text()
        text.set_parse_math(False)
        if column == 0:
            text.set_horizontalalignment("left")
        if row == 0:
            text.set_fontweight("bold")
        if text.get_text() == "fail":
            text.set_color(RED)


def chain(method: GravityMethod, side: str) -> np.ndarray:
    """The corners (n, 2) of the dam's face on a side, the part under a lift joint included, upwards
    or downstream.
    """
    found = method.case.section
    wanted = constants()[side][0]
    ends = zip(*(found[f"seg_{n}"] for n in ("side", "x0", "y0", "x1", "y1")), strict=True)
    corners = {c for s, *place in ends if s == wanted for c in (tuple(place[:2]), tuple(place[2:]))}
    return np.array(sorted(corners, key=lambda c: (c[1], c[0])))


def draw_scene(axes: Axes, method: GravityMethod) -> None:
    """Rock, dam, water, silt."""
    case = method.case
    up, down, bed = (chain(method, side) for side in ("UP", "DOWN", "BED"))
    base, height = case["dam_base"], case["dam_height"]
    top = max(height, method.level)
    left, right = -0.45 * base, 1.45 * base
    lowest = UnderJoint(method).place(np.array([0, 1]), STRESS_AT + 1.2 * TALL)[1].min()
    floor = min(-0.1 * height, bed[0, 1] - 0.1 * height, lowest)
    toe = down[0]
    rock = [(left, floor), (left, 0), (0, 0), toe, (right, toe[1]), (right, floor)]
    axes.fill(*np.transpose(rock), color=ROCK, linewidth=0)
    for face, outer, surface, color in (
        (up, left, method.level, WATER),
        (up, left, case["silt_height"], SILT),
        (down, right, method.tail_level, WATER),
    ):
        draw_fluid(axes, face, outer, surface, color)
    if method.level > height:
        crest = [up[-1, 0], down[-1, 0]]
        axes.fill_between(crest, height, method.level, color=WATER, alpha=0.4, linewidth=0)
    axes.fill(*np.vstack([up, down[::-1]]).T, facecolor="#dde2e8", edgecolor="#5a5a5a", lw=0.8)
    outline = method.body.outline + method.body.toe
    axes.fill(*outline.T, facecolor=CONCRETE, edgecolor="#5a5a5a", linewidth=0.8)
    axes.set(
        xlim=(left, right), ylim=(floor, 1.06 * top), aspect="equal", xlabel="x [m]", ylabel="y [m]"
    )


def draw_fluid(axes: Axes, face: np.ndarray, outer: float, surface: float, color: str) -> None:
    """A fluid between a face and the picture's edge."""
    if surface <= face[0, 1]:
        return
    y = np.union1d(np.clip(face[:, 1], None, surface), [surface])
    x = np.interp(y, face[:, 1], face[:, 0])
    axes.fill_betweenx(y, x, outer, color=color, alpha=0.4, linewidth=0)
    axes.plot([outer, x[-1]], [surface, surface], color=color, linewidth=1)


class UnderJoint:
    """Places by the distance s from the heel along the joint and the depth d under it, both over
    the joint's length.
    """

    def __init__(self, method: GravityMethod) -> None:
        body = method.body
        self.heel, self.length = np.array(body.heel), body.length
        self.along = np.array(body.along)
        self.down = np.array([self.along[1], -self.along[0]])

    def place(self, s: np.ndarray | float, depth: np.ndarray | float) -> np.ndarray:
        """Coordinates (2, ...)."""
        away = zip(self.heel, self.along, self.down, strict=True)
        return np.array([x + self.length * (a * s + d * depth) for x, a, d in away])


def draw_joint(axes: Axes, result: Results, method: GravityMethod) -> None:
    """Joint, crack, resultants; under it uplift and effective stress of both methods."""
    under, last = UnderJoint(method), result.last
    ends = np.array([0, 1])
    axes.plot(*under.place(ends, 0), color="black", linewidth=1.2)
    axes.plot(*under.place((1 + ends) / 3, 0), color=GREEN, lw=3, label="middle third", zorder=3)
    if method.crack_length:
        line = under.place(ends * method.crack_length / under.length, -0.02)
        axes.plot(*line, "--", color=RED, label=f"crack, {HAND}", zorder=4)
    for longer in method.further:
        line = under.place(ends * longer.crack_length / under.length, -0.04)
        axes.plot(*line, ":", color=RED, label=f"longer crack, {HAND}", zorder=4)
    rows = along(result.at()) if last else {}
    answer = COMPUTED + (", partial load" if result.partial_load else "")
    none = np.zeros(0)
    x = rows.get("x", none)
    s = (x - x[0]) / np.ptp(x) if rows else none
    if rows and last["crack_length"]:
        line = under.place(s, np.where(rows["damage"] >= 1, 0, np.nan))
        axes.plot(*line, color=RED, linewidth=3, label=f"crack, {answer}", zorder=4)
    if rows and (softening := state_of(rows) == SOFTENING).any():
        line = under.place(s, np.where(softening, 0, np.nan))
        axes.plot(*line, color=VIOLET, linewidth=3, label=f"softening, {answer}", zorder=2)
    pressure = method.uplift.s / under.length, method.uplift.p
    stress = effective_stress(method), rows.get("sigma_n_eff", none)
    for depth, name, color, hanging, (by_hand, computed) in (
        (UPLIFT_AT, "uplift", WATER, 1, (pressure, rows.get("p", none))),
        (STRESS_AT, f"effective stress, {SIGN}", ORANGE, -1, stress),
    ):
        label = f"{name}, {answer}"
        draw_diagram(axes, under, depth, name, label, color, hanging, by_hand, (s, computed))
    if rows:
        draw_resultant(axes, under, last, BLUE, "-")
        axes.plot([], [], color=BLUE, label=f"resultant, {answer}")
    forces = {"N": method.N, "T": method.T, "x_resultant": method.x_resultant}
    draw_resultant(axes, under, forces, "black", "--")
    axes.plot([], [], "--", color="black", label=f"the same, {HAND}")


def draw_diagram(
    axes: Axes,
    under: UnderJoint,
    depth: float,
    name: str,
    label: str,
    color: str,
    hanging: int,
    by_hand: tuple[np.ndarray, np.ndarray],
    computed: tuple[np.ndarray, np.ndarray],
) -> None:
    """A quantity [Pa] hanging under the joint at a depth, both methods as (places over the joint's
    length, values); the end values and the name are written beside it.

    label: of the computed one; hanging: 1 if what is positive is drawn downwards, -1 if what is
    negative is.
    """
    both = by_hand[1], computed[1]
    size, factor = unit(list(both), STRESSES)
    scale = hanging * TALL / (max(np.abs(v).max(initial=0) for v in both) or 1.0)
    outline = lambda s, v: under.place(
        np.concatenate([[0], s, [1]]), depth + scale * np.concatenate([[0], v, [0]])
    )
    axes.plot(*under.place(np.array([0, 1]), depth), color="black", linewidth=0.6)
    if len(computed[0]):
        axes.fill(*outline(*computed), color=color, alpha=0.35, linewidth=0)
        line = under.place(computed[0], depth + scale * computed[1])
        axes.plot(*line, color=color, label=label)
    axes.plot(*outline(*by_hand), "--", color="black", linewidth=1)
    axes.text(*under.place(0.5, depth - 0.02), name, ha="center", va="bottom", fontsize=9)
    for s, value, side in ((-0.015, by_hand[1][0], "right"), (1.015, by_hand[1][-1], "left")):
        said = f"{value * factor:.3g} {size}"
        axes.text(*under.place(s, depth), said, ha=side, va="center", fontsize=8.5)


def effective_stress(method: GravityMethod) -> tuple[np.ndarray, np.ndarray]:
    """Places over the joint's length and effective stress [Pa], tension > 0, of the gravity method:
    nothing in the crack, linear beyond it.
    """
    if not method.uncracked:
        return np.array([0.0, 1.0]), np.zeros(2)
    tip = method.crack_length / method.body.length
    s, stress = [tip, 1.0], [method.tip_stress, method.sigma_n_eff_toe]
    crack = [0.0, tip] if tip else []
    return np.array([*crack, *s]), np.array([*(0.0 for _ in crack), *stress])


def draw_resultant(
    axes: Axes, under: UnderJoint, last: dict[str, float], color: str, style: str
) -> None:
    """An arrow to where the force on the joint meets it, if that is near the joint."""
    s, size = last["x_resultant"] / under.length, np.hypot(last["N"], last["T"])
    if not (-0.3 < s < 1.3 and last["N"] > 0):
        return
    back = 0.4 / size
    start, end = under.place(s - back * last["T"], -back * last["N"]), under.place(s, 0)
    axes.annotate(
        "",
        end,
        start,
        arrowprops={
            "arrowstyle": "-|>",
            "color": color,
            "linestyle": style,
            "linewidth": 1.6,
            "shrinkA": 0,
            "shrinkB": 0,
        },
    )
