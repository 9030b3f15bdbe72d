"""Picture of a safety check: section and water, and below the joint the diagrams of uplift and
effective stress, by finite elements and by the gravity method.
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..input.case import Case
from ..input.scene import BED, DOWN, FLOOR, UP
from ..model.fields import BROKEN, SOFTENING, along, joint_states
from ..model.loads import Loading
from ..model.results import Results
from ..statics.gravity import GravityMethod
from ..statics.rigid_block import RigidBlock
from ..units import STRESSES, unit
from .drawing import (
    BLUE,
    CONCRETE,
    DARK,
    GREEN,
    ORANGE,
    RED,
    STATES,
    WATER,
    arrow_style,
    draw_cells,
    figure_of,
    picture_style,
    write_picture,
)
from .run_picture import gravity_profile, heading
from .scene import (
    QUAKE,
    arrow,
    fluids,
    force_label,
    forces_on,
    level_label,
    loads_label,
    marked,
    undeformed_faces,
)
from .section_picture import draw_fluid

ROCK, SILT, EDGE = "#e6dcc8", "#a98d5d", "#5a5a5a"
LOWER_BODY = "#dde2e8"
#: Over the joint's length: depth of the two diagrams below the joint, height of each, depth of the
#: lines of cracks by the gravity method, length of a resultant's arrow.
UPLIFT_AT, STRESS_AT, TALL = 0.14, 0.52, 0.24
CRACK_AT, LONGER_AT, ARROW = -0.02, -0.04, 0.4
#: Least unit of depth over the dam's base; a diagram's name above its axis [points].
SHORTEST, NAME_ABOVE = 0.6, 13
#: Ground beside the dam over its base; below the dam over its height.
BESIDE, BELOW = 0.6, 0.1
#: Places along the joint between which a resultant is drawn; heel 0, toe 1.
DRAWN_RESULTANT = (-0.3, 1.3)
#: Size of the figure [inches]; of the figure: left and width of section and table, their bottom,
#: left margin, heights of a line of the title and of the reasons.
SIZE = (11.2, 8.2)
SECTION, TABLE = (0.06, 0.535), (0.61, 0.375)
BOTTOM, LEGEND, MARGIN, TITLE, REASON = 0.02, 0.145, 0.02, 0.031, 0.022
#: Of the tables' axes: height of a row and of the first table at most.
ROW, TALLEST = 0.04, 0.7
#: Length of a load's arrow over the dam's height.
LOAD_ARROW = 0.12

COMPUTED, HAND = "finite elements", "gravity method"
#: Sign of stresses in every table and diagram.
SIGN = "tension > 0"
ENDS = np.array([0.0, 1.0])


class Content(NamedTuple):
    """What the picture of a scene shows at its last saved state."""

    result: Results
    #: number of the joint with diagrams
    joint: int
    #: the gravity method on each joint
    methods: list[GravityMethod]
    #: table beside the picture, headings in the first row, quantities in the first column
    cells: list[tuple[str, ...]]
    #: a row per joint, its verdict last
    of_joints: list[tuple[str, ...]]
    #: the worst of all joints
    verdict: str
    #: the requirements that are not met
    why: str


def draw_check(content: Content, folder: Path) -> Path:
    """Write the picture of `figure_of_check` to folder/<case>_check.png and return its path."""
    path = folder / f"{content.result.case.name}_check.png"
    write_picture(figure_of_check(content), path, 120)
    return path


@picture_style()
def figure_of_check(content: Content) -> Figure:
    """Draw the last saved state of a scene."""
    result, joint, methods, cells, of_joints, verdict, why = content
    figure = figure_of(*SIZE)
    joint_result, method = result.joints[joint], methods[joint]
    name = result.case.named((joint,))
    of_joint = f"; diagrams: {name}" if name else ""
    title = textwrap.wrap(f"{heading(joint_result)}; check: {verdict}{of_joint}", 100)
    loads = textwrap.wrap(f"loads: {loads_label(result.case, method_loading(method))}", 150)
    reasons = textwrap.wrap(why, 150)
    top = 0.97 - TITLE * len(title) - REASON * (len(loads) + len(reasons))
    (left, width), bottom = SECTION, BOTTOM + LEGEND
    section = figure.add_axes((left, bottom, width, top - bottom))
    beside = figure.add_axes((TABLE[0], BOTTOM, TABLE[1], top - BOTTOM))
    figure.text(MARGIN, 0.985, "\n".join(title), fontsize=12, va="top", parse_math=False)
    y = 0.98 - TITLE * len(title)
    for lines, color in ((loads, EDGE), (reasons, RED)):
        text = "\n".join(lines)
        figure.text(MARGIN, y, text, fontsize=9, color=color, va="top", parse_math=False)
        y -= REASON * len(lines)
    draw_scene(section, method, result.case)
    draw_joints(section, methods, of_joints)
    draw_joint(section, joint_result, method)
    section.set_anchor("NW")
    handles, labels = section.get_legend_handles_labels()
    position: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (left - 0.02, 0.005)}
    figure.legend(handles, labels, **position, ncols=2, fontsize=8, frameon=False, handlelength=3)
    beside.axis("off")
    height = min(ROW * len(cells), TALLEST)
    draw_verdicts(beside, cells, 1 - height, height)
    if len(methods) > 1:
        below = min(ROW * len(of_joints), 0.97 - height)
        draw_verdicts(beside, of_joints, 0.97 - height - below, below)
    return figure


def method_loading(method: GravityMethod) -> Loading:
    """The loading of the gravity method."""
    return Loading.at(method.case, method.time, method.level, method.tail_level)


def draw_verdicts(axes: Axes, cells: list[tuple[str, ...]], bottom: float, height: float) -> None:
    """Draw a table into axes, from a bottom over a height of them; bad verdicts in red."""
    letters = [max(map(len, column)) + 2 for column in zip(*cells, strict=True)]
    table = draw_cells(axes, cells, letters, (0, bottom, 1, height), 9, 0.03)
    for cell in table.get_celld().values():
        if cell.get_text().get_text() in ("fail", "not judged"):
            cell.get_text().set_color(RED)


def draw_scene(axes: Axes, method: GravityMethod, scene: Case) -> None:
    """Draw rock, all bodies of a scene, and its loads; the body above a joint in another color."""
    case, body, loading = method.case, method.body, method_loading(method)
    assert isinstance(body, RigidBlock)  # no picture is drawn of a geometry of a user
    faces = undeformed_faces(scene)
    up, down, floor, bed = (by_height(faces[side]) for side in (UP, DOWN, FLOOR, BED))
    base, height = case["dam_base"], case["dam_height"]
    left, right = -BESIDE * base, (1 + BESIDE) * base
    lowest_diagram = UnderJoint(method).position(ENDS, STRESS_AT + 1.2 * TALL)[1].min()
    lowest = min(-BELOW * height, bed[0, 1] - BELOW * height, lowest_diagram)
    ground = np.unique(np.concatenate([floor, bed]), axis=0)
    ends = [(ground[-1, 0], lowest), (ground[0, 0], lowest)]
    axes.fill(*np.vstack([ground, ends]).T, color=ROCK, linewidth=0)
    of_fluids = fluids(scene, faces, loading, faces)
    for name, color in (("water", WATER), ("silt", SILT)):
        draw_fluid(axes, of_fluids[name], facecolor=color, alpha=0.4)
    for level, x in ((loading.level, left), (loading.tail, right)):
        if level > 0:
            axes.text(
                x,
                level,
                f" {level_label(level)} ",
                ha="left" if x < 0 else "right",
                va="bottom",
                fontsize=8,
            )
    axes.fill(*np.vstack([up, down[::-1]]).T, facecolor=LOWER_BODY, edgecolor=EDGE, lw=0.8)
    outline = body.outline + body.toe
    axes.fill(*outline.T, facecolor=CONCRETE, edgecolor=EDGE, linewidth=0.8)
    tips = {name: tip[:2] for name, tip in marked(scene, {}).items()}
    length = LOAD_ARROW * height
    for name, force in forces_on(scene, loading).items():
        if not force.any():
            continue
        if name == QUAKE:  # inside the dam: from the centroid of the body
            along = force / np.hypot(*force)
            tips[name] = np.array(body.area_and_centroid[1:]) + body.toe + length * along
        tail, tip = arrow(np.array([*tips[name], 0.0]), force, length)[0, :, :2]
        color = RED if name == QUAKE else DARK
        axes.annotate("", tip, tail, arrowprops=arrow_style(color), zorder=5)
        label = force_label(name, force)
        axes.annotate(label, tail, (0, 4), textcoords="offset points", fontsize=8, color=color)
    top = max(height, loading.level) + (length if len(tips) else 0)
    axes.set(
        xlim=(left, right),
        ylim=(lowest, 1.06 * top),
        aspect="equal",
        xlabel="x [m]",
        ylabel="y [m]",
    )


def by_height(edges: np.ndarray) -> np.ndarray:
    """Corners (n, 2) of a side's edges by height, those of the same height by x."""
    corners = np.unique(edges.reshape(-1, 2), axis=0)
    ordered: np.ndarray = corners[np.lexsort((corners[:, 0], corners[:, 1]))]
    return ordered


def draw_joints(axes: Axes, methods: list[GravityMethod], of_joints: list[tuple[str, ...]]) -> None:
    """Draw each of several joints with its name and verdict beside its toe."""
    if len(methods) == 1:
        return
    for method, (name, *_, verdict) in zip(methods, of_joints[1:], strict=True):
        color = RED if verdict in ("fail", "not judged") else "black"
        ends = np.array([method.body.heel, method.body.toe])
        axes.plot(*ends.T, color=color, linewidth=1.2, zorder=3)
        axes.annotate(
            f"{name}: {verdict}",
            tuple(ends[1]),
            (6, 3),
            textcoords="offset points",
            fontsize=8,
            color=color,
        )


class UnderJoint:
    """Coordinates below the joint: distance s from the heel along it, over its length, and depth,
    over its length or, below a short lift joint, part of the base.
    """

    def __init__(self, method: GravityMethod) -> None:
        body = method.body
        self.heel, self.length = np.array(body.heel), body.length
        self.along = np.array(body.along)
        self.down = np.array([self.along[1], -self.along[0]])
        self.unit_depth = max(body.length, SHORTEST * method.case["dam_base"])

    def position(self, s: np.ndarray | float, depth: np.ndarray | float) -> np.ndarray:
        """Transform to x, y (2, ...) [m]."""
        axes = zip(self.heel, self.along, self.down, strict=True)
        return np.array([x + self.length * a * s + self.unit_depth * d * depth for x, a, d in axes])


@dataclass(frozen=True)
class Diagram:
    """A quantity [Pa] drawn below the joint, by both methods as (places s, values)."""

    name: str
    depth: float
    color: str
    #: 1: positive values are drawn downwards; -1: negative ones
    sign: int
    gravity: tuple[np.ndarray, np.ndarray]
    computed: tuple[np.ndarray, np.ndarray]


def draw_joint(axes: Axes, result: Results, method: GravityMethod) -> None:
    """Draw joint, crack and resultants; below them uplift and effective stress of both methods."""
    under, last = UnderJoint(method), result.last
    rows = along(result.at()) if last else {}
    label = COMPUTED + (", partial load" if result.partial_load else "")
    none = np.zeros(0)
    x = rows.get("x", none)
    s = (x - x[0]) / np.ptp(x) if rows else none
    draw_lines(axes, under, method)
    if rows:
        draw_states(axes, under, s, joint_states(rows, result.case.law), label)
    uplift = method.uplift.s / under.length, method.uplift.p
    computed_p, computed_stress = (rows.get(name, none) for name in ("p", "sigma_n_eff"))
    stress = f"effective stress, {SIGN}"
    by_hand, gravity_stress = gravity_profile(method)
    profile = by_hand / under.length, gravity_stress
    for diagram in (
        Diagram("uplift", UPLIFT_AT, WATER, 1, uplift, (s, computed_p)),
        Diagram(stress, STRESS_AT, ORANGE, -1, profile, (s, computed_stress)),
    ):
        draw_diagram(axes, under, diagram, f"{diagram.name}, {label}")
    if rows:
        draw_resultant(axes, under, last, BLUE, "-")
        axes.plot([], [], color=BLUE, label=f"resultant, {label}")
    forces = {"N": method.N, "T": method.T, "x_resultant": method.x_resultant}
    draw_resultant(axes, under, forces, "black", "--")
    axes.plot([], [], "--", color="black", label=f"the same, {HAND}")


def draw_lines(axes: Axes, under: UnderJoint, method: GravityMethod) -> None:
    """Draw the joint, its middle third, and the cracks by the gravity method."""
    axes.plot(*under.position(ENDS, 0), color="black", linewidth=1.2)
    axes.plot(*under.position((1 + ENDS) / 3, 0), color=GREEN, lw=3, label="middle third", zorder=3)
    if method.crack_length:
        line = under.position(ENDS * method.crack_length / under.length, CRACK_AT)
        axes.plot(*line, "--", color=RED, label=f"crack, {HAND}", zorder=4)
    for longer in method.further:
        line = under.position(ENDS * longer.crack_length / under.length, LONGER_AT)
        axes.plot(*line, ":", color=RED, label=f"longer crack, {HAND}", zorder=4)


def draw_states(
    axes: Axes, under: UnderJoint, s: np.ndarray, states: np.ndarray, label: str
) -> None:
    """Draw broken and softening part of the joint by the finite elements."""
    for number, order in ((BROKEN, 4), (SOFTENING, 2)):
        if (states == number).any():
            line, style = under.position(s, np.where(states == number, 0, np.nan)), STATES[number]
            look = {"color": style.color, "linestyle": style.line, "linewidth": 3, "zorder": order}
            axes.plot(*line, **look, label=f"{style.label}, {label}")


def draw_diagram(axes: Axes, under: UnderJoint, diagram: Diagram, label: str) -> None:
    """Draw a diagram with its name and the values of both methods at its ends."""
    by_hand, computed, depth = diagram.gravity, diagram.computed, diagram.depth
    both = by_hand[1], computed[1]
    size, factor = unit(list(both), STRESSES)
    scale = diagram.sign * TALL / (max(np.abs(v).max(initial=0) for v in both) or 1.0)

    def outline(s: np.ndarray, values: np.ndarray) -> np.ndarray:
        closed = np.concatenate([[0], values, [0]])
        return under.position(np.concatenate([[0], s, [1]]), depth + scale * closed)

    axes.plot(*under.position(ENDS, depth), color="black", linewidth=0.6)
    if len(computed[0]):
        axes.fill(*outline(*computed), color=diagram.color, alpha=0.35, linewidth=0)
        line = under.position(computed[0], depth + scale * computed[1])
        axes.plot(*line, color=diagram.color, label=label)
    axes.plot(*outline(*by_hand), "--", color="black", linewidth=1)
    above: dict[str, Any] = {"xytext": (0, NAME_ABOVE), "textcoords": "offset points"}
    axes.annotate(diagram.name, tuple(under.position(0.5, depth)), **above, ha="center", fontsize=9)
    for end, s, side in ((0, -0.015, "right"), (-1, 1.015, "left")):
        values = {"FE": computed[1], "gravity": by_hand[1]}
        shown = {name: f"{v[end] * factor:.3g} {size}" for name, v in values.items() if len(v)}
        same = len(set(shown.values())) == 1
        lines = [shown["gravity"]] if same else [f"{name} {v}" for name, v in shown.items()]
        x, y = under.position(s, depth)
        axes.text(x, y, "\n".join(lines), ha=side, va="center", fontsize=8)


def draw_resultant(
    axes: Axes, under: UnderJoint, last: dict[str, float], color: str, style: str
) -> None:
    """Draw the force on the joint as an arrow to where it meets the joint, if that is near it."""
    s, size = last["x_resultant"] / under.length, np.hypot(last["N"], last["T"])
    if not (DRAWN_RESULTANT[0] < s < DRAWN_RESULTANT[1] and last["N"] > 0):
        return
    back = ARROW / size
    height = back * last["N"] * under.length / under.unit_depth
    start, end = under.position(s - back * last["T"], -height), under.position(s, 0)
    axes.annotate("", tuple(end), tuple(start), arrowprops=arrow_style(color, linestyle=style))
