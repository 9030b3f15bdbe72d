"""Pictures of a run: section, joint, history; in 3D also a view and maps of the joint; under
displacement control also the load curve.

Each is drawn into a figure or subfigure: side by side in CASE.png, alone in a report.
"""

from __future__ import annotations

import math
import os
import textwrap
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import TwoSlopeNorm, to_rgba
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from .. import ROUND_OFF
from ..input.case import Case
from ..input.values import has_point, level_unknown
from ..mesh.body import Body
from ..model.fields import Solution, along, distance, joint_body, joint_states, nearest_rows
from ..model.loads import Loading
from ..model.results import Results
from ..post import validation
from ..post.summary import Table, joints_note, joints_table
from ..post.validation import shown_time
from ..statics import gravity
from ..statics.statement import statement
from ..statics.verdict import decisive_joint, overturning_level, verdict
from ..units import FLUXES, LENGTHS, STRESSES, Units, unit
from .drawing import (
    BLUE,
    DARK,
    GREEN,
    GREY,
    ORANGE,
    RED,
    STATES,
    VIOLET,
    WATER,
    AnyFigure,
    draw_cells,
    figure_of,
    figure_size,
    legend_above,
    panels,
    picture_style,
    pixels_of,
    runs_of,
    widen,
    write_picture,
    write_pixels,
)
from .outline import exaggeration, skin
from .scene import grown_label, level_label, loads_label, state_label, water_surface
from .section_picture import ABOVE_EDGE, draw_section

DPI = 120
#: Inches: size of the figure, which fits a page A4 across (in 3D with the maps: upright); height of
#: the history, of 3D view and maps, of a line of the title and of the message.
WIDTH, HEIGHT, HISTORY, SOLID = 11.2, 7.8, 1.85, 4.0
TITLE, MESSAGE = 0.3, 0.18
#: Left margin [inches]; characters per inch of title and message.
MARGIN, PER_INCH = 0.15, (9.5, 15)
#: Width of the panels on the right over that of the section on the left.
RIGHT = 1.25
#: Width of the table of all joints beside the history, over that of the figure.
BESIDE = 0.42
#: Colors of the joints in a panel.
COLORS = BLUE, ORANGE, GREEN, VIOLET, RED, DARK
#: Share of the shear's range that must be negative for the limit to be drawn with both signs.
BOTH_SIGNS = 0.02
#: Limits of an axis in percent: lines at 0 and 100 are visible.
PERCENT = (-3, 103)
#: Percentiles [%]: values outside them get the colors at the ends of a map's scale, but ...
SCALED = 2, 98
#: ... where the extreme is nearer to its percentile than this part of the range between both [-].
CLIPPED = 0.25
#: Ground shown around the dam in the view, over the dam's size.
AROUND = 0.3
#: Intervals of the scale of a map, about; its least range.
LEVELS, TINY = 10, 1e-9
#: Height of the curves of one of several joints, and of a row of their table [inches].
PER_JOINT, TABLE_ROW = 1.3, 0.2
#: Characters in a line of message and facts.
MESSAGE_LETTERS = int(PER_INCH[1] * WIDTH)
DISTANCE = "distance from the heel along the joint [m]"

#: Pixels of a picture by a function that draws one of its halves, see `picture`.
Join = Callable[[Callable[[int], np.ndarray]], np.ndarray]


def draw(solution: Solution, folder: Path, joined: Join | None = None) -> Path:
    """Draw all into folder/<case>.png and return its path; a load curve into <case>_curve.png.

    joined: the pixels of the picture from those of its halves, which it has drawn.
    """
    result = solution.result
    if result.case["drive"] != "level":
        write_picture(draw_curve(result), folder / f"{result.case.name}_curve.png", DPI)
    path = folder / f"{result.case.name}.png"
    half = lambda number: pixels_of(picture(solution, (number,)), DPI)
    pixels = joined(half) if joined else pixels_of(picture(solution), DPI)
    write_pixels(pixels, path, DPI, compress_level=2)
    return path


def prepare() -> None:
    """Load what drawing loads at its first use: fonts and the writer of PNG."""
    figure = figure_of(1, 1)
    figure.text(0, 0, "0")
    write_picture(figure, Path(os.devnull), DPI)


@picture_style()
def picture(solution: Solution, halves: tuple[int, ...] = (0, 1)) -> Figure:
    """Section and joint at the last state, or that of the published numbers; the history.

    halves: the parts that are drawn, which take about the same time: heading, section and history;
    joints, view and maps.
    """
    result = solution.result
    case, several = result.case, len(result.joints) > 1
    has_states = bool(len(result.joint["time"]))
    title = textwrap.wrap(heading(result), int(PER_INCH[0] * WIDTH))
    facts = [line for fact in facts_of(result) for line in textwrap.wrap(fact, MESSAGE_LETTERS)]
    message = textwrap.wrap(statement(result), MESSAGE_LETTERS)
    head = TITLE * len(title) + MESSAGE * (len(facts) + len(message)) + 0.05
    heights = [head]
    if has_states:
        rows = len(result.joints) * PER_JOINT if several and not has_maps(solution) else 0.0
        middle = max(HEIGHT - head - HISTORY, rows)
        heights += [middle, max(HISTORY, several * (1 + len(result.joints)) * TABLE_ROW)]
        if case["dim"] == 3 and solution.fields and not is_user_solid(case):
            heights.append(SOLID)
    figure = figure_of(WIDTH, sum(heights))
    top, *parts = figure.subfigures(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
    if has_states:
        time = shown_time(result)
        left, right = parts[0].subfigures(1, 2, width_ratios=(1, RIGHT))
    if 0 in halves:
        write_heading(top, title, facts, message)
    if has_states and 0 in halves:
        draw_dam(left, solution, time)
        draw_histories(parts[1], result, time)
    if has_states and 1 in halves:
        draw_all_joints(right, solution, time)
        if len(parts) > 2:
            draw_solid(parts[2], solution, time)
    return figure


def write_heading(
    figure: AnyFigure, title: list[str], facts: list[str], message: list[str]
) -> None:
    """Write the lines of title, facts and message."""
    width, height = figure_size(figure)
    x, y = MARGIN / width, 1 - 0.1 / height
    figure.text(x, y, "\n".join(title), fontsize=12, va="top", parse_math=False)
    y -= TITLE * len(title) / height
    for lines, color in ((facts, DARK), (message, RED)):
        figure.text(x, y, "\n".join(lines), fontsize=8.5, color=color, va="top", parse_math=False)
        y -= MESSAGE * len(lines) / height


def heading(result: Results) -> str:
    """Title of the picture: case, uplift, level, tailwater, leakage; verdict."""
    case, state = result.case, result.last
    if len(result.joint["time"]):
        state = result.state(shown_time(result))
    title = f"{case.title}, uplift {case.of_all_joints('uplift')}"
    if state:
        title += f", level {level_label(state['level'])}"
        if state["tail_level"] > 0:
            title += f", tailwater {level_label(state['tail_level'])}"
    flowing = [joint for joint in result.joints if joint.case["uplift"] == "flow"]
    if state and flowing:
        leakage = sum(joint.state(state["time"])["flux"] for joint in flowing)
        title += f", leakage {leakage:.3g} kg/(m s)"
    return f"{title}: {verdict(result)}"


def facts_of(result: Results) -> list[str]:
    """Loads at the state shown; resultants, SSF and place of N on the decisive joint."""
    if not len(result.joint["time"]):
        return []
    case, time = result.case, shown_time(result)
    state, number = result.state(time), decisive_joint(result)
    loading = Loading.at(case, time, state["level"], state["tail_level"])
    joint_result, name = result.joints[number], case.named((number,))
    on_joint = state_label(joint_result.case, joint_result.state(time))
    return [f"loads: {loads_label(case, loading)}", f"{name}: {on_joint}" if name else on_joint]


def shear_limit(case: Case, rows: dict[str, np.ndarray]) -> tuple[str, np.ndarray] | None:
    """The joint's shear strength at each row [Pa], and its formula; None if it has none."""
    law = case.law
    if not law.shear_strength_formula:
        return None
    hardening = " + H slip" if law.hardening_parameter and case.hardening_requested else ""
    strength = law.shear_strength(rows["sigma_n_eff"], rows["damage"], rows["slip"])
    return f"limit: {law.shear_strength_formula}{hardening}", strength


def has_maps(solution: Solution) -> bool:
    """Whether the joints are drawn as maps, not as curves: surfaces of any shape (without fields
    their mesh is not known).
    """
    return bool(solution.fields) and is_user_solid(solution.result.case)


def draw_joint(figure: AnyFigure, solution: Solution, time: float) -> None:
    """Draw the only joint of a solution: curves along it or maps."""
    if has_maps(solution):
        draw_maps(figure, solution, time)
    else:
        axes = panels(figure, 3, 1, bottom=0.62, top=0.28, down=0.32)[:, 0]
        draw_curves(list(axes), solution.result, time)
        finish_curves(figure, list(axes), [solution.result], time)


def draw_all_joints(figure: AnyFigure, solution: Solution, time: float) -> None:
    """Draw the joint, or several as equals: small curves of each, a row each from the highest; maps
    of their openings where they are surfaces of any shape.
    """
    joints = solution.result.joints
    if len(joints) == 1:
        draw_joint(figure, solution, time)
    elif has_maps(solution):
        draw_openings(figure, solution, time)
    else:
        grid = panels(
            figure, len(joints), 3, left=0.55, bottom=0.62, top=0.75, across=0.6, down=0.42
        )[::-1]
        names = solution.result.case.joint_names
        for row, joint, name in zip(grid, joints, names, strict=True):
            draw_curves(list(row), joint, time)
            for axes in row:
                axes.set_title(name, fontsize=7.5, loc="left", pad=2)
                axes.yaxis.label.set_fontsize(7)
                axes.tick_params(labelsize=7)
                axes.yaxis.set_label_coords(-0.4 / (axes.bbox.width / axes.figure.dpi), 0.5)
        for column in grid.T:  # a curve may be missing in the uppermost row
            drawn = [axes.get_legend_handles_labels() for axes in column[::-1]]
            curves = {name: line for lines in drawn for line, name in zip(*lines, strict=True)}
            column[-1].legend(
                [*curves.values()],
                [*curves],
                loc="lower left",
                bbox_to_anchor=(-0.2, 1.12),
                ncols=1,
                fontsize=6,
                frameon=False,
                borderpad=0.1,
                columnspacing=0.6,
                handletextpad=0.3,
                handlelength=1.6,
                labelspacing=0.2,
            )
        mark_states(figure, joints, time)
        for axes in grid[0]:
            axes.set_xlabel("s from heel [m]", fontsize=8)


def draw_curves(axes: list[Axes], result: Results, time: float) -> None:
    """Draw jumps, normal stress and shear along the only joint of these results (means over z in
    3D), with the published values, or without any the stress of the gravity method.
    """
    case, curves = result.case, along(result.at(time))
    s, states = curves["s"], joint_states(curves, case.law)
    jumps, normals, shears = axes
    draw_jumps(jumps, case, curves)
    factor = draw_normal_stress(normals, case, curves)
    if not (validation.references(case) or case.geometry):
        draw_gravity_stress(normals, gravity.at(case, time, result.state(time)["level"]), factor)
    draw_shear(shears, case, curves)
    ends = np.concatenate([s[:1], (s[1:] + s[:-1]) / 2, s[-1:]])
    for panel in axes:
        full_height = panel.get_xaxis_transform()
        for number, first, end in runs_of(states):
            if number in STATES:
                parts = [(ends[first], ends[end] - ends[first])]
                style = STATES[number].area()
                panel.broken_barh(parts, (0, 1), transform=full_height, zorder=0, **style)
        panel.axhline(0, color="black", linewidth=0.5)
        panel.grid(alpha=0.3)
        panel.margins(x=0.01)


def finish_curves(figure: AnyFigure, axes: list[Axes], results: list[Results], time: float) -> None:
    """Write the legends of the curves along a joint and the axis below them."""
    for panel in axes:
        panel.tick_params(labelbottom=panel is axes[-1])
        legend_above(panel)
    axes[-1].set_xlabel(DISTANCE, fontsize=9)
    mark_states(figure, results, time)


def mark_states(figure: AnyFigure, results: list[Results], time: float) -> None:
    """Write the legend of the states that occur at some joints."""
    states = [joint_states(along(joint.at(time)), joint.case.law) for joint in results]
    occurring = [STATES[n].patch() for n in STATES if any((part == n).any() for part in states)]
    if occurring:
        above = ABOVE_EDGE / figure_size(figure)[1]
        position: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.1, above)}
        style: dict[str, Any] = {"fontsize": 7.5, "frameon": False, "borderpad": 0.2}
        figure.legend(handles=occurring, ncols=len(occurring), **position, **style)


def draw_jumps(axes: Axes, case: Case, curves: dict[str, np.ndarray]) -> None:
    """Draw opening, tangential jump and slip."""
    length, factor = unit([curves["delta_n"], curves["delta_t1"]], LENGTHS)
    for name, style, color, label in (
        ("delta_n", "-", BLUE, "opening"),
        ("delta_t1", "-.", ORANGE, "tangential, downstream > 0"),
        ("slip", ":", ORANGE, f"|{case.law.slip_name}|"),
    ):
        axes.plot(curves["s"], curves[name] * factor, style, color=color, label=label)
    draw_published(axes, case, curves, {"delta_n": BLUE, "delta_t1": ORANGE}, factor)
    axes.set_ylabel(f"jump [{length}]", fontsize=9)


def draw_normal_stress(axes: Axes, case: Case, curves: dict[str, np.ndarray]) -> float:
    """Draw total and effective normal stress, and the water pressure between them.

    Returns the factor from Pa to the unit drawn.
    """
    stress, factor = unit([curves["sigma_n"], curves["sigma_n_eff"]], STRESSES)
    s = curves["s"]
    axes.plot(s, curves["sigma_n"] * factor, color=BLUE, label="total, tension > 0")
    if case["uplift"] != "none":
        effective = curves["sigma_n_eff"] * factor
        axes.plot(s, effective, "--", color=DARK, label="effective")
        style: dict[str, Any] = {"color": WATER, "alpha": 0.25, "linewidth": 0}
        axes.fill_between(s, -curves["p"] * factor, 0, **style, label="uplift")
    draw_published(axes, case, curves, {"sigma_n": BLUE}, factor)
    axes.set_ylabel(f"normal stress [{stress}]", fontsize=9)
    return factor


def draw_gravity_stress(axes: Axes, method: gravity.GravityMethod, factor: float) -> None:
    """Draw the effective stress of the gravity method."""
    if method.stands:
        s, stress = gravity_profile(method)
        axes.plot(s, stress * factor, ":", color=GREY, linewidth=1.8, label="gravity method")


def gravity_profile(method: gravity.GravityMethod) -> tuple[np.ndarray, np.ndarray]:
    """Effective stress of the gravity method: distances from the heel [m] and values [Pa], tension
    > 0; zero in the crack, linear beyond its tip, zero if the entire joint is cracked.
    """
    crack, length = method.crack_length, method.body.length
    if not method.uncracked:
        return np.array([0.0, length]), np.zeros(2)
    in_crack = [0.0, crack] if crack else []
    stress = [*(0.0 for _ in in_crack), method.tip_stress, method.sigma_n_eff_toe]
    return np.array([*in_crack, crack, length]), np.array(stress)


def draw_shear(axes: Axes, case: Case, curves: dict[str, np.ndarray]) -> None:
    """Draw the shear stress and its limit by the law, with both signs where both occur."""
    limit = shear_limit(case, curves)
    stress, factor = unit([curves["tau_1"], *([limit[1]] if limit else [])], STRESSES)
    shear = curves["tau_1"] * factor
    axes.plot(curves["s"], shear, color=ORANGE, label="shear stress, downstream > 0")
    if limit:
        label, size = limit
        size = np.maximum(size, 0.0)
        axes.plot(curves["s"], size * factor, "--", color=GREEN, label=label)
        if shear.min() < -BOTH_SIGNS * np.ptp(shear):
            axes.plot(curves["s"], -size * factor, "--", color=GREEN)
            axes.fill_between(
                curves["s"], -size * factor, size * factor, color=GREEN, alpha=0.08, linewidth=0
            )
    axes.set_ylabel(f"shear stress [{stress}]", fontsize=9)


def draw_published(
    axes: Axes, case: Case, curves: dict[str, np.ndarray], colors: dict[str, str], factor: float
) -> None:
    """Draw published values of some quantities with their tolerances, at the time they are for."""
    references = [
        r for r in validation.references(case) if r.y is None and r.read_as != validation.SLIP_TWICE
    ]
    if not np.isclose(curves["time"][0], validation.reference_time(case)):
        return
    for name, color in colors.items():
        rows = [r for r in references if r.quantity == name]
        if rows:
            value = np.array([r.value for r in rows]) * factor
            spread = np.abs(value) * [r.tolerance for r in rows]
            style: dict[str, Any] = {"fmt": "o", "markersize": 4, "color": color}
            style |= {"mfc": "white", "capsize": 2}
            label = "published" if name != "delta_t1" else None  # delta_n has the label
            axes.errorbar(np.array([r.x for r in rows], float), value, spread, **style, label=label)


def draw_histories(figure: AnyFigure, result: Results, time: float) -> None:
    """Draw the history of all joints and, if there are several, their table at a time beside it."""
    if not result.case.of_joints:
        draw_history(figure, history_panels(result), result)
        return
    left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(1 - BESIDE, BESIDE))[0]
    draw_history(left, panels_of_joints(result), result)
    draw_table(right, joints_table(result, time), joints_note(result.case))


class Panel(NamedTuple):
    """A panel of the history: quantity, units, lines with their values."""

    quantity: str
    units: Units
    lines: list[tuple[np.ndarray, str, str]]


def draw_history(figure: AnyFigure, shown: list[Panel], result: Results) -> None:
    """Draw panels over the level, below each other if high, and the steps of other loads."""
    high = figure.bbox.width < 2 * figure.bbox.height
    shape = (len(shown), 1) if high else (1, len(shown))
    row = panels(figure, *shape, bottom=0.42, top=0.25, down=0.55).ravel()
    level, marks = result.history["level"], changes_at_a_level(result)
    for axes, (quantity, units, lines) in zip(row, shown, strict=True):
        name, factor = unit([values for values, *_ in lines], units)
        # the lines often coincide: those drawn later are dashed or dotted
        for number, (values, color, label) in enumerate(lines):
            style = LINES[number % len(LINES)]
            axes.plot(level, values * factor, style, color=color, markersize=3, label=label)
        if not high or axes is row[-1]:
            axes.set_xlabel("reservoir level [m]", fontsize=9)
        axes.set_ylabel(f"{quantity} [{name}]", fontsize=8.5)
        axes.grid(alpha=0.3)
        widen(axes.yaxis)
        if not any(values.any() for values, *_ in lines):
            axes.set_yticks([0.0])  # no values below zero beside it
        if name == "%":
            axes.set_ylim(*PERCENT)
        for step, text in marks:
            mark_change(axes, (level[step], lines[0][0][step] * factor), text)
        # one legend for all panels of several joints
        without = row[-1] if high else row[0]
        if len(lines) > 1 and not (result.case.of_joints and axes is without):
            legend_above(axes)


def mark_change(axes: Axes, position: tuple[float, float], text: str) -> None:
    """Mark a point of a panel of the history; the text is on the side away from the frame."""
    axes.plot(*position, "o", color=RED, markersize=8, mfc="none", label="_changed")
    _, height = axes.transAxes.inverted().transform(axes.transData.transform(position))
    down, side = (-2, "top") if height > 0.5 else (2, "bottom")
    away: dict[str, Any] = {"xytext": (-7, down), "textcoords": "offset points"}
    axes.annotate(text, position, **away, ha="right", va=side, fontsize=7, color=RED)


#: Styles of the lines of a panel, so that they differ without colors.
LINES = "o-", "s--", "^:", "D-.", "v-", "x--", "P:", "*-."


def changes_at_a_level(result: Results) -> list[tuple[int, str]]:
    """Steps of the history at a level that it had before, at which other loads than the water have
    just changed, and which: of an earthquake its coefficients.
    """
    case, history, steps = result.case, result.history, list[tuple[int, str]]()
    loadings = [
        Loading.at(case, *(history[name][k] for name in ("time", "level", "tail_level")))
        for k in range(len(history["time"]))
    ]
    changed = [bool(grown_label(case, *pair)) for pair in pairwise(loadings)] + [False]
    first = 0
    for k, changes in enumerate(changed):
        if changes and not changed[k + 1]:  # the last step of a change
            before = history["level"][: k + 1]
            if np.isclose(before, history["level"][k + 1]).any():
                steps.append((k + 1, grown_label(case, loadings[first], loadings[k + 1])))
        first = first if changes else k + 1
    return steps


def history_panels(result: Results) -> list[Panel]:
    """Panels of the history of a single joint."""
    history = result.history
    share = {"broken": "broken_length", "slipped": "slip_length", "softening": "process_zone"}
    lengths = [
        (history[column], color, label)
        for (label, column), color in zip(share.items(), (RED, ORANGE, VIOLET), strict=True)
        if label != "softening" or history[column].any()
    ]
    shown = [
        # the largest opening of a joint that is closed everywhere is an overlap
        Panel("largest opening", LENGTHS, [(np.maximum(history["max_opening"], 0), BLUE, "")]),
        Panel("crest movement", LENGTHS, [(history["crest_ux"], BLUE, "")]),
        Panel("share of the joint", (("%", 100 / joint_length(result)),), lengths),
    ]
    if result.case["uplift"] == "flow":
        shown.append(Panel("leakage", FLUXES, [(history["flux"], BLUE, "")]))
    return shown


def panels_of_joints(result: Results) -> list[Panel]:
    """Panels of the history of several joints, a line each; of many the decisive one in color."""
    names, joints = result.case.joint_names, result.joints
    order, colors = list(range(len(joints))), [*COLORS]
    if len(joints) > len(COLORS):
        first = decisive_joint(result)
        order.sort(key=lambda k: (k != first, k))
        colors = [BLUE] + [GREY] * (len(joints) - 1)
        others = {first: names[first], order[1]: "others"}
        names = tuple(others.get(k, "_") for k in range(len(joints)))

    def lines(values: Callable[[Results], np.ndarray]) -> list[tuple[np.ndarray, str, str]]:
        return [(values(joints[k]), c, names[k]) for k, c in zip(order, colors, strict=False)]

    opening = lines(lambda joint: np.maximum(joint.history["max_opening"], 0))
    slipped = lines(lambda joint: joint.history["slip_length"] / joint.case.joint_along)
    return [
        Panel("largest opening", LENGTHS, opening),
        Panel("crest movement", LENGTHS, [(result.history["crest_ux"], BLUE, "")]),
        Panel("slipped share", (("%", 100),), slipped),
    ]


def draw_table(figure: AnyFigure, table: Table, note: str) -> None:
    """Draw a table, its first and last columns to the left, and a note below it."""
    (axes,) = panels(figure, left=0.05, right=0.1, bottom=0.3 if note else 0.1, top=0.1).flat
    axes.set_axis_off()
    axes.text(0, -0.05, note, fontsize=7, va="top", color=DARK, transform=axes.transAxes)
    heads = [f"{n}\n[{u}]" if u else n for n, u in zip(table.names, table.units, strict=True)]
    columns = zip(table.names, *table.rows, strict=True)
    letters = [max(map(len, column)) + 2 for column in columns]
    height = figure_size(figure)[1] - (0.4 if note else 0.2)
    box = (0.0, 0.0, 1.0, min(1.0, (2 + len(table.rows)) * 0.22 / height))
    left = 0, len(heads) - 1
    cells = draw_cells(axes, [heads, *table.rows], letters, box, 7, 0.02, left)
    for column in range(len(heads)):
        cells[0, column].set_height(1.7 * cells[0, column].get_height())
    for row in range(len(table.rows) + 1):  # apart from the numbers before it
        cells[row, len(heads) - 1].PAD = 0.12


def joint_length(result: Results) -> float:
    """Length of the joint from heel to toe, along it [m]."""
    return float(distance(result.joint).max())


def is_user_solid(case: Case) -> bool:
    """Whether the geometry is a user's own in 3D: one section does not represent it."""
    return case["dim"] == 3 and case.geometry is not None


def draw_dam(figure: AnyFigure, solution: Solution, time: float) -> None:
    """Draw the section, or a 3D view if one section does not represent the geometry."""
    draw = draw_view if is_user_solid(solution.result.case) else draw_section
    draw(figure, solution, time)


def draw_solid(figure: AnyFigure, solution: Solution, time: float) -> None:
    """Draw what an extruded section in 3D has besides: a view and maps of the joint."""
    left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(1, RIGHT))[0]
    draw_view(left, solution, time)
    draw_maps(right, solution.of_joint(decisive_joint(solution.result)), time)


def draw_view(figure: AnyFigure, solution: Solution, time: float) -> None:
    """Draw the deformed skin of all bodies, in colors of the displacement, if there are fields."""
    field = solution.fields.get(time)
    if field is None:
        return
    scale = exaggeration(field.displacement, solution.result.case.size)
    sizes = {name: np.linalg.norm(u, axis=1) for name, u in field.displacement.items()}
    length, factor = unit(list(sizes.values()), LENGTHS)
    polygons, depths, values, near = [], [], [], []
    for name, displacement in field.displacement.items():
        body = solution.bodies[name]
        positions = (body.points + scale * displacement) @ VIEW
        near += [positions] if name != "foundation" else []
        for table, _ in skin(body):
            polygons += list(positions[table, :2])
            away = positions[table, 2]
            # the ground by its farthest corner: the water lies on it
            depths.append(away.min(axis=1) if name == "foundation" else away.mean(axis=1))
            values.append(sizes[name][table].mean(axis=1) * factor)
    state = solution.result.state(time)
    water = [cell @ VIEW for cell in water_surface(solution.bodies, state["level"])]
    depths.append(np.array([cell[:, 2].mean() for cell in water]))
    order = np.argsort(np.concatenate(depths))
    polygons += [cell[:, :2] for cell in water]
    colors = ScalarMappable(cmap="YlGnBu")
    shades = colors.to_rgba(np.concatenate(values))
    shades = np.concatenate([shades, np.full((len(water), 4), to_rgba(WATER, 0.45))])
    edges = [to_rgba(GREY)] * (len(shades) - len(water)) + [to_rgba(WATER, 0.0)] * len(water)
    (axes,) = panels(figure, left=0.15, right=0.85, bottom=0.15, top=0.3).flat
    faces = PolyCollection([polygons[i] for i in order])  # the nearest are drawn last
    faces.set(facecolor=shades[order], edgecolor=[edges[i] for i in order], linewidth=0.1)
    faces.set(rasterized=True)
    axes.add_collection(faces, autolim=False)
    dam = np.concatenate(near)[:, :2]
    around = AROUND * np.ptp(dam, axis=0).max()
    axes.update_datalim([dam.min(axis=0) - around, dam.max(axis=0) + around])
    axes.autoscale_view()
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_axis_off()
    title = f"displacement [{length}], drawn x {scale:g}"
    axes.set_title(title, fontsize=8, loc="left")
    figure.colorbar(colors, ax=axes, shrink=0.7, aspect=25).ax.tick_params(labelsize=8)
    draw_directions(axes, level_label(state["level"]) if len(water) else "")


def draw_directions(axes: Axes, level: str) -> None:
    """Draw the directions of x, y and z in the lower left corner of a view, and its water level."""
    start = np.array([0.12, 0.13])
    for direction, name in zip(VIEW[:, :2], ("x, downstream", "y", "z"), strict=True):
        end = start + 0.1 * direction
        style = {"arrowstyle": "-|>", "color": DARK, "shrinkA": 0, "shrinkB": 0}
        position: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "axes fraction"}
        axes.annotate("", tuple(end), tuple(start), **position, arrowprops=style, zorder=5)
        x, y = start + 0.135 * direction
        axes.text(x, y, name, transform=axes.transAxes, ha="center", va="center", fontsize=8)
    words = f"behind the dam, upstream: reservoir, {level}" if level else "upstream behind the dam"
    behind = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.5}
    axes.text(0.02, 0.97, words, transform=axes.transAxes, fontsize=8, va="top", bbox=behind)


def view_from(azimuth: float, elevation: float) -> np.ndarray:
    """Matrix (3, 3) from x, y, z to the coordinates of a view, y upwards: right, up, towards the
    viewer; angles [degrees] of the viewer from x towards -z, and above the horizon.
    """
    a, e = np.radians([azimuth, elevation])
    towards = np.array([np.cos(e) * np.cos(a), np.sin(e), -np.cos(e) * np.sin(a)])
    right = np.array([-np.sin(a), 0, -np.cos(a)])
    return np.column_stack([right, np.cross(towards, right), towards])


#: From downstream and above: the ground does not hide the dam.
VIEW = view_from(-35, 30)


def draw_openings(figure: AnyFigure, solution: Solution, time: float) -> None:
    """Draw a map of the opening of each joint, in colors of a common scale."""
    joints = solution.result.joints
    across = math.ceil(math.sqrt(len(joints)))
    rows = [joint.at(time) for joint in joints]
    length, factor = unit([row["delta_n"] for row in rows], LENGTHS)
    openings = [np.maximum(row["delta_n"], 0.0) * factor for row in rows]
    largest = max(np.percentile(opening, SCALED[1]) for opening in openings) or 1.0
    shape = (math.ceil(len(joints) / across), across)
    grid = panels(figure, *shape, left=0.3, right=0.7, bottom=0.3, top=0.5, across=0.4, down=0.35)
    for number, axes in enumerate(grid.flat):
        if number >= len(joints):
            axes.remove()
            continue
        surface = joint_body(solution.bodies, number)
        names, positions = projected(surface)
        values = openings[number][nearest_rows(surface.points, rows[number])]
        colors = axes.tripcolor(
            Triangulation(positions[0], positions[1], triangulated(surface)),
            values,
            cmap="YlOrRd",
            vmin=0,
            vmax=largest,
            shading="gouraud",
            rasterized=True,
        )
        name = solution.result.case.joint_names[number]
        axes.set_title(f"{name} ({names[0]}, {names[1]})", fontsize=7, pad=2)
        axes.set_aspect("equal")
        axes.tick_params(labelsize=6)
        axes.locator_params(nbins=3)
    figure.text(0.02, 0.965, f"opening of all joints [{length}], axes [m]", fontsize=8, va="top")
    bar = figure.add_axes((0.93, 0.2, 0.015, 0.6))
    figure.colorbar(colors, cax=bar, extend="max").ax.tick_params(labelsize=7)


def triangulated(surface: Body) -> np.ndarray:
    """Triangles (n, 3) of the faces of a joint."""
    return np.concatenate(
        [table[:, part] for _, table in surface.cells for part in HALVES[table.shape[1]]]
    )


def draw_maps(figure: AnyFigure, solution: Solution, time: float) -> None:
    """Draw maps of the joint in true shape: opening, effective normal stress, shear stress; below
    each other, or side by side if the joint is not much wider than high.
    """
    rows, joint = solution.result.at(time), solution.bodies["joint"]
    nearest = nearest_rows(joint.points, rows)
    names, positions = projected(joint)
    shape = Triangulation(positions[0], positions[1], triangulated(joint))
    shown = (
        ("delta_n", "opening > 0, overlap < 0", LENGTHS),
        ("sigma_n_eff", "effective normal stress, tension > 0", STRESSES),
        ("tau_1", "shear stress, downstream > 0", STRESSES),
    )
    wide = np.ptp(shape.x) > WIDE * np.ptp(shape.y)
    table = (len(shown), 1) if wide else (1, len(shown))
    maps = panels(figure, *table, right=0.3, bottom=0.45, top=0.25, down=0.4)
    for axes, (name, label, units) in zip(maps.flat, shown, strict=True):
        size, factor = unit([rows[name]], units)
        draw_map(axes, shape, rows[name][nearest] * factor, f"{label} [{size}]", wide)
    for axes in maps[:, 0]:
        axes.set_ylabel(f"{names[1]} [m]", fontsize=9)
    for axes in maps[:-1].flat:
        axes.tick_params(labelbottom=False)
    for axes in maps[-1]:
        axes.set_xlabel(f"{names[0]} [m]", fontsize=9)


#: Width over height of the joint from which on its maps are below each other; letters in a line of
#: a title beside others.
WIDE, LETTERS = 2.0, 23
#: Height over width of a map below which it has a single tick.
NARROW = 0.08

#: Triangles of a face by the number of its corners.
HALVES = {3: ([0, 1, 2],), 4: ([0, 1, 2], [0, 2, 3])}


def projected(joint: Body) -> tuple[list[str], np.ndarray]:
    """The joint in the plane of two axes in which its area is largest: their names, y last, else
    that of its longer side first, and the places of its nodes (2, n) [m].
    """
    normals = np.zeros(3)
    for _, table in joint.cells:
        first, second, *_, last = (joint.points[table[:, i]] for i in range(table.shape[1]))
        normals += np.abs(np.cross(second - first, last - first)).sum(axis=0)
    extent = np.ptp(joint.points, axis=0)
    axes = sorted(set(range(3)) - {int(normals.argmax())}, key=lambda i: (i == 1, -extent[i]))
    return ["xyz"[i] for i in axes], joint.points[:, axes].T


def draw_map(axes: Axes, shape: Triangulation, values: np.ndarray, title: str, wide: bool) -> None:
    """Draw a map of values at the nodes, with a thick line at zero; its scale diverges from zero,
    and ends before extremes of small parts of the joint. wide: whether its title fits into a line.
    """
    values = np.where(np.abs(values) < ROUND_OFF * np.abs(values).max(), 0, values)
    low, high = scale_of(values)
    if (low, high) != (values.min(), values.max()):
        title += f"; {values.min():.3g} to {values.max():.3g}, colors clipped"
    levels = MaxNLocator(LEVELS).tick_values(low, max(high, low + TINY))
    norm = TwoSlopeNorm(0, min(levels[0], -levels[-1] / 1e3), max(levels[-1], -levels[0] / 1e3))
    shown = np.clip(values, levels[0], levels[-1])
    filled = axes.tricontourf(shape, shown, levels, cmap="RdBu_r", norm=norm)
    axes.tricontour(shape, shown, levels, colors="black", linewidths=0.25)
    if values.min() < 0 < values.max():
        axes.tricontour(shape, values, [0], colors="black", linewidths=1.4)
    lines = [title] if wide else textwrap.wrap(title, LETTERS)
    axes.set_title("\n".join(lines), fontsize=8, loc="left")
    axes.set_aspect("equal")
    narrow = np.ptp(shape.y) < NARROW * np.ptp(shape.x)
    if narrow:  # ticks would overlap
        axes.set_yticks([shape.y.max()])
    bar = axes.figure.colorbar(filled, ax=axes, pad=0.02, fraction=0.05, aspect=12)
    ticks = np.asarray(MaxNLocator(4).tick_values(levels[0], levels[-1]))
    bar.set_ticks(ticks[(ticks >= levels[0]) & (ticks <= levels[-1])].tolist())
    bar.ax.tick_params(labelsize=7)


def scale_of(values: np.ndarray) -> tuple[float, float]:
    """Ends of a map's scale: the extremes, or percentiles that are far from them."""
    low, high = np.percentile(values, SCALED)
    near = CLIPPED * (high - low)
    least, most = values.min(), values.max()
    return least if low - least <= near else low, most if most - high <= near else high


@picture_style()
def draw_curve(result: Results) -> Figure:
    """Draw the level against the heel's opening; for a uniform pressure also the level at which the
    rigid dam overturns. Of a controlled point its displacement, of a load its factor.
    """
    case, history = result.case, result.history
    moved, load = result.heel, history["level"]
    labels, prescribed = ("opening of the heel", "level [m]"), "level prescribed"
    if has_point(case):
        moved = history["point_u"]
        labels = f"displacement of the point along {case['drive_direction']}", labels[1]
    if not level_unknown(case):
        load, prescribed = history["load_factor"], "load prescribed"
        labels = labels[0], f"factor of the {case['drive_load']} [-]"
    figure = figure_of(7, 4.5)
    title = textwrap.wrap(case.title, 80)
    (axes,) = panels(figure, top=0.15 + 0.2 * len(title)).flat
    driven = history["time"] > case["drive_begin"] + ROUND_OFF
    after = history["time"] > case["drive_end"] + ROUND_OFF
    length, factor = unit([moved], LENGTHS)
    for phase, label, style, color in (
        (~driven, prescribed, "o-", BLUE),
        (driven & ~after, f"{case['drive']} prescribed", "s-", ORANGE),
        (after, f"{prescribed} again", "^-", GREEN),
    ):
        if not phase.any():
            continue
        steps = np.flatnonzero(phase | np.append(phase[1:], False))  # with the step before
        axes.plot(moved[steps] * factor, load[steps], style, color=color, markersize=4, label=label)
    if case["face_load"] == "uniform" and case["uplift"] == "none" and level_unknown(case):
        bound = overturning_level(case)
        label = f"rigid dam overturns: {bound:.3f} m"
        axes.axhline(bound, color="black", linestyle="--", linewidth=0.8, label=label)
    axes.set(xlabel=f"{labels[0]} [{length}]", ylabel=labels[1])
    axes.set_title("\n".join(title), fontsize=11, parse_math=False)
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)
    return figure
