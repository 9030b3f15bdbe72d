"""Pictures of a run: section, joint, history; in 3D also a view and maps of the joint; under
displacement control also the load curve.

Each is drawn into a figure or subfigure: side by side in CASE.png, alone in a report.
"""

from __future__ import annotations

import os
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure, FigureBase
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from .. import ROUND_OFF
from ..input.case import Case
from ..mesh.body import Body
from ..model.fields import Solution, along, distance, row_of_nodes, state_of
from ..model.results import Results
from ..statics import gravity
from ..statics.statement import statement
from ..statics.verdict import decisive_joint, overturning_level
from . import validation
from .drawing import (
    BLUE,
    DARK,
    GREEN,
    GREY,
    LABEL,
    ORANGE,
    RED,
    STATES,
    VIOLET,
    WATER,
    figure_of,
    legend_above,
    panels,
    pixels_of,
    runs_of,
    write_picture,
    write_pixels,
)
from .outline import exaggeration, skin
from .section_picture import draw_section
from .units import FLUXES, LENGTHS, STRESSES, Units, unit
from .validation import shown_time

DPI = 120
#: Inches: size of the figure, which fits a page A4 across (in 3D with the maps: upright); height of
#: the history, of 3D view and maps, of a line of the title and of the message.
WIDTH, HEIGHT, HISTORY, SOLID = 11.2, 7.8, 1.85, 4.0
TITLE, MESSAGE = 0.3, 0.18
#: Left margin [inches]; characters per inch of title and message.
MARGIN, PER_INCH = 0.15, (9.5, 15)
#: Width of the panels on the right over that of the section on the left.
RIGHT = 1.25
#: Width of the bars of all joints beside the history, over that of the figure; inches per letter of
#: their names.
SHARES, PER_LETTER = 0.25, 0.068
#: Share of the shear's range that must be negative for the limit to be drawn with both signs.
BOTH_SIGNS = 0.02
#: Limits of an axis in percent: lines at 0 and 100 are visible.
PERCENT = (-3, 103)
#: Percentiles between which a map has a scale; its last colors are those of all values beyond.
SCALED, CLIPPED = (2, 98), 0.25
#: Ground shown around the dam in the view, over the dam's size.
AROUND = 0.3
#: Intervals of the scale of a map, about; its least range.
LEVELS, TINY = 10, 1e-9
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


def picture(solution: Solution, halves: tuple[int, ...] = (0, 1)) -> Figure:
    """Section and joint at the last state, or that of the published numbers; the history.

    halves: the parts that are drawn, which take about the same time: heading, section and history;
    joint, view and maps.
    """
    result = solution.result
    case = result.case
    has_states = bool(len(result.joint["time"]))
    title = textwrap.wrap(heading(result), int(PER_INCH[0] * WIDTH))
    message = textwrap.wrap(statement(result), int(PER_INCH[1] * WIDTH))
    head = TITLE * len(title) + MESSAGE * len(message) + 0.05
    heights = [head]
    if has_states:
        heights += [HEIGHT - head - HISTORY, HISTORY]
        if case["dim"] == 3 and solution.fields and not is_own_solid(case):
            heights.append(SOLID)
    figure = figure_of(WIDTH, sum(heights))
    top, *parts = np.ravel(figure.subfigures(len(heights), 1, height_ratios=heights))
    if has_states:
        time, shares = shown_time(result), case.of_joints and is_own_solid(case)
        left, right = parts[0].subfigures(1, 2, width_ratios=(1, RIGHT))
        own = solution.of_joint(decisive_joint(result))
        if shares:
            right, below = right.subfigures(2, 1)
    if 0 in halves:
        write_heading(top, title, message)
    if has_states and 0 in halves:
        draw_dam(left, solution, time)
        if shares:
            draw_history(parts[1], own.result)
        else:
            draw_histories(parts[1], result, time)
    if has_states and 1 in halves:
        draw_joint(right, own, time)
        if shares:
            draw_shares(below, result, time)
        if len(parts) > 2:
            draw_solid(parts[2], solution, time)
    return figure


def write_heading(figure: FigureBase, title: list[str], message: list[str]) -> None:
    """Write the lines of title and message."""
    width, height = figure.bbox.size / figure.dpi
    x, y = MARGIN / width, 1 - 0.1 / height
    figure.text(x, y, "\n".join(title), fontsize=12, va="top", parse_math=False)
    y -= TITLE * len(title) / height
    figure.text(x, y, "\n".join(message), fontsize=8.5, color=RED, va="top", parse_math=False)


def heading(result: Results) -> str:
    """Title of the picture: case, uplift, level, tailwater, leakage."""
    case, state = result.case, result.last
    if len(result.joint["time"]):
        state = result.state(shown_time(result))
    title = f"{case.title}, uplift {case['uplift']}"
    if not state:
        return title
    title += f", level {state['level']:.4g} m"
    if state["tail_level"] > 0:
        title += f", tailwater {state['tail_level']:.4g} m"
    if case["uplift"] == "flow":
        title += f", leakage {state['flux']:.3g} kg/(m s)"
    shown = case.named((decisive_joint(result),))
    return title + (f"; curves: {shown}" if shown else "")


def shear_limit(case: Case, rows: dict[str, np.ndarray]) -> tuple[str, np.ndarray] | None:
    """The joint's shear strength at each row [Pa], and its formula; None if it has none."""
    law = case.law
    if not law.limits_shear:
        return None
    hardening = " + H slip" if law.hardening_parameter and case.hardening_asked else ""
    strength = law.shear_strength(rows["sigma_n_eff"], rows["damage"], rows["slip"])
    return f"limit: {law.shear_strength_formula}{hardening}", strength


def draw_joint(figure: FigureBase, solution: Solution, time: float) -> None:
    """Draw the joint: curves along it, or maps where it is a surface of any shape (without fields
    its mesh is not known).
    """
    if solution.fields and is_own_solid(solution.result.case):
        draw_maps(figure, solution, time)
    else:
        draw_curves(figure, solution.result, time)


def draw_curves(figure: FigureBase, result: Results, time: float) -> None:
    """Draw jumps, normal stress and shear along the joint (means over z in 3D), with the published
    values, or without any the stress of the gravity method.
    """
    case, curves = result.case, along(result.at(time))
    s, states = curves["s"], state_of(curves, case.law)
    jumps, normals, shears = panels(figure, 3, 1, bottom=0.62, top=0.28, down=0.32).flat
    draw_jumps(jumps, case, curves)
    factor = draw_normal_stress(normals, case, curves)
    if not (validation.references(case) or case.geometry):
        draw_gravity_stress(normals, gravity.at(case, time, result.state(time)["level"]), factor)
    draw_shear(shears, case, curves)
    ends = np.concatenate([s[:1], (s[1:] + s[:-1]) / 2, s[-1:]])
    for axes in (jumps, normals, shears):
        full_height = axes.get_xaxis_transform()
        for number, first, end in runs_of(states):
            if number in STATES:
                parts = [(ends[first], ends[end] - ends[first])]
                style = STATES[number].area()
                axes.broken_barh(parts, (0, 1), transform=full_height, zorder=0, **style)
        axes.axhline(0, color="black", linewidth=0.5)
        axes.grid(alpha=0.3)
        axes.margins(x=0.01)
        axes.tick_params(labelbottom=axes is shears)
        legend_above(axes)
    shears.set_xlabel(DISTANCE, fontsize=9)
    occurring = [style.patch() for number, style in STATES.items() if (states == number).any()]
    if occurring:
        place = {"loc": "lower left", "bbox_to_anchor": (0.1, 0), "ncols": len(occurring)}
        figure.legend(handles=occurring, **place, fontsize=7.5, frameon=False, borderpad=0.2)


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
        style = {"color": WATER, "alpha": 0.25, "linewidth": 0}
        axes.fill_between(s, -curves["p"] * factor, 0, **style, label="uplift")
    draw_published(axes, case, curves, {"sigma_n": BLUE}, factor)
    axes.set_ylabel(f"normal stress [{stress}]", fontsize=9)
    return factor


def draw_gravity_stress(axes: Axes, method: gravity.GravityMethod, factor: float) -> None:
    """Draw the effective stress of the gravity method."""
    if method.stands:
        s, stress = gravity_profile(method)
        style = {"color": GREY, "linewidth": 1.8, "label": "gravity method"}
        axes.plot(s, stress * factor, ":", **style)


def gravity_profile(method: gravity.GravityMethod) -> tuple[np.ndarray, np.ndarray]:
    """Effective stress of the gravity method: distances from the heel [m] and values [Pa], tension
    > 0; zero in the crack, linear beyond its tip, zero if the entire joint is cracked.
    """
    crack, length = method.crack_length, method.body.length
    if not method.uncracked:
        return np.array([0.0, length]), np.zeros(2)
    s, stress = [crack, length], [method.tip_stress, method.sigma_n_eff_toe]
    return (
        (np.array([0.0, crack, *s]), np.array([0.0, 0.0, *stress]))
        if crack
        else (np.array(s), np.array(stress))
    )


def draw_shear(axes: Axes, case: Case, curves: dict[str, np.ndarray]) -> None:
    """Draw the shear stress and its limit by the law, with both signs where both occur."""
    limit = shear_limit(case, curves)
    stress, factor = unit([curves["tau_1"], *([limit[1]] if limit else [])], STRESSES)
    shear = curves["tau_1"] * factor
    axes.plot(curves["s"], shear, color=ORANGE, label="shear stress, downstream > 0")
    if limit:
        label, size = limit
        axes.plot(curves["s"], size * factor, "--", color=GREEN, label=label)
        if shear.min() < -BOTH_SIGNS * np.ptp(shear):
            axes.plot(curves["s"], -size * factor, "--", color=GREEN)
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
            style = {"fmt": "o", "markersize": 4, "color": color, "mfc": "white", "capsize": 2}
            label = "published" if name != "delta_t1" else None  # delta_n has the label
            axes.errorbar([r.x for r in rows], value, spread, **style, label=label)


class Line(NamedTuple):
    """A line of a panel: column of the history, color, label."""

    column: str
    color: str
    label: str = ""


def draw_histories(figure: FigureBase, result: Results, time: float) -> None:
    """Draw the history of the decisive joint and, beside it, the shares of all joints if there are
    several.
    """
    own = result.joints[decisive_joint(result)]
    if not result.case.of_joints:
        draw_history(figure, own)
        return
    left, right = figure.subfigures(1, 2, width_ratios=(1 - SHARES, SHARES))
    draw_history(left, own)
    draw_shares(right, result, time)


def draw_history(figure: FigureBase, result: Results) -> None:
    """Draw opening, crest displacement, crack and, with flow, leakage against the level."""
    panels_shown = history_panels(result)
    row = panels(figure, 1, len(panels_shown), bottom=0.42, top=0.25).flat
    for axes, (quantity, units, lines) in zip(row, panels_shown, strict=True):
        name, factor = unit([result.history[line.column] for line in lines], units)
        # the lines often coincide: those drawn later are dashed or dotted
        for line, style in zip(lines, ("o-", "s--", "^:"), strict=False):
            values = result.history[line.column] * factor
            look = {"color": line.color, "markersize": 3, "label": line.label}
            axes.plot(result.history["level"], values, style, **look)
        axes.set_xlabel("reservoir level [m]", fontsize=9)
        axes.set_ylabel(f"{quantity} [{name}]", fontsize=8.5)
        axes.grid(alpha=0.3)
        if name == "%":
            axes.set_ylim(*PERCENT)
        if lines[0].label:
            legend_above(axes)


def history_panels(result: Results) -> list[tuple[str, Units, list[Line]]]:
    """Panels of the history: quantity, units, lines."""
    lengths = [Line("broken_length", RED, "broken"), Line("slip_length", ORANGE, "slipped")]
    if result.history["process_zone"].any():
        lengths.append(Line("process_zone", VIOLET, "softening"))
    shown: list[tuple[str, Units, list[Line]]] = [
        ("largest opening", LENGTHS, [Line("max_opening", BLUE)]),
        ("crest movement", LENGTHS, [Line("crest_ux", BLUE)]),
        ("share of the joint", (("%", 100 / joint_length(result)),), lengths),
    ]
    if result.case["uplift"] == "flow":
        shown.append(("leakage", FLUXES, [Line("flux", BLUE)]))
    return shown


def draw_shares(figure: FigureBase, result: Results, time: float) -> None:
    """Draw which share of each joint is broken and has slipped at a requested time."""
    names = result.case.joint_names
    left = LABEL + PER_LETTER * max(map(len, names))
    (axes,) = panels(figure, left=left, bottom=0.42, top=0.25).flat
    for column, color, label, thick in (
        ("slip_length", ORANGE, "slipped", 0.8),
        ("broken_length", RED, "broken", 0.4),
    ):
        shares = [100 * own.state(time)[column] / own.case.joint_along for own in result.joints]
        axes.barh(range(len(names)), shares, thick, color=color, label=label)
    line = 72 * axes.bbox.height / axes.figure.dpi / len(names)  # [points]
    axes.set_yticks(range(len(names)), names, fontsize=min(7, line))
    axes.set_xlim(*PERCENT)
    axes.set_xlabel("share of each joint [%]", fontsize=9)
    axes.grid(axis="x", alpha=0.3)
    legend_above(axes)


def joint_length(result: Results) -> float:
    """Length of the joint from heel to toe, along it [m]."""
    return float(distance(result.joint).max())


def is_own_solid(case: Case) -> bool:
    """Whether the geometry is a user's own in 3D: one section does not represent it."""
    return case["dim"] == 3 and case.geometry is not None


def draw_dam(figure: FigureBase, solution: Solution, time: float) -> None:
    """Draw the section, or a 3D view if one section does not represent the geometry."""
    draw = draw_view if is_own_solid(solution.result.case) else draw_section
    draw(figure, solution, time)


def draw_solid(figure: FigureBase, solution: Solution, time: float) -> None:
    """Draw what an extruded section in 3D has besides: a view and maps of the joint."""
    left, right = figure.subfigures(1, 2, width_ratios=(1, RIGHT))
    draw_view(left, solution, time)
    draw_maps(right, solution.of_joint(decisive_joint(solution.result)), time)


def draw_view(figure: FigureBase, solution: Solution, time: float) -> None:
    """Draw the deformed skin of all bodies, in colors of the displacement; no view without
    fields.
    """
    field = solution.fields.get(time)
    if field is None:
        return
    scale = exaggeration(field.displacement, solution.result.case.size)
    sizes = {name: np.linalg.norm(u, axis=1) for name, u in field.displacement.items()}
    length, factor = unit(list(sizes.values()), LENGTHS)
    polygons, depths, values, near = [], [], [], []
    for name, displacement in field.displacement.items():
        body = solution.bodies[name]
        places = (body.points + scale * displacement) @ VIEW
        near += [places] if name != "foundation" else []
        for table, _ in skin(body):
            polygons += list(places[table, :2])
            depths.append(places[table, 2].mean(axis=1))
            values.append(sizes[name][table].mean(axis=1) * factor)
    order = np.argsort(np.concatenate(depths))  # the nearest faces are drawn last
    (axes,) = panels(figure, left=0.15, right=0.85, bottom=0.15, top=0.3).flat
    faces = PolyCollection([polygons[i] for i in order], cmap="YlGnBu", edgecolor=GREY)
    faces.set(array=np.concatenate(values)[order], linewidth=0.1, rasterized=True)
    axes.add_collection(faces, autolim=False)
    dam = np.concatenate(near)[:, :2]
    around = AROUND * np.ptp(dam, axis=0).max()
    axes.update_datalim([dam.min(axis=0) - around, dam.max(axis=0) + around])
    axes.autoscale_view()
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_axis_off()
    title = f"displacement [{length}], drawn x {scale:g}"
    axes.set_title(title, fontsize=8, loc="left")
    figure.colorbar(faces, ax=axes, shrink=0.7, aspect=25).ax.tick_params(labelsize=8)


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


def draw_maps(figure: FigureBase, solution: Solution, time: float) -> None:
    """Draw maps of the joint in true shape: opening, effective normal stress, shear stress; below
    each other, or side by side if the joint is not much wider than high.
    """
    rows, joint = solution.result.at(time), solution.bodies["joint"]
    nearest = row_of_nodes(joint, rows)
    names, places = projected(joint)
    corners = np.concatenate(
        [table[:, part] for _, table in joint.cells for part in HALVES[table.shape[1]]]
    )
    shape = Triangulation(*places, corners)
    shown = (
        ("delta_n", "opening", LENGTHS),
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
    bar = axes.figure.colorbar(filled, ax=axes, pad=0.02, fraction=0.05, aspect=12)
    ticks = MaxNLocator(4).tick_values(levels[0], levels[-1])
    bar.set_ticks(ticks[(ticks >= levels[0]) & (ticks <= levels[-1])])
    bar.ax.tick_params(labelsize=7)


def scale_of(values: np.ndarray) -> tuple[float, float]:
    """Ends of a map's scale: the extremes, or percentiles that are far from them."""
    low, high = np.percentile(values, SCALED)
    near = CLIPPED * (high - low)
    least, most = values.min(), values.max()
    return least if low - least <= near else low, most if most - high <= near else high


def draw_curve(result: Results) -> FigureBase:
    """Draw the level against the heel's opening; for a uniform pressure also the level at which the
    rigid dam overturns.
    """
    case, history = result.case, result.history
    figure = figure_of(7, 4.5)
    title = textwrap.wrap(case.title, 80)
    (axes,) = panels(figure, top=0.15 + 0.2 * len(title)).flat
    driven = history["time"] > case["drive_begin"] + ROUND_OFF
    after = history["time"] > case["drive_end"] + ROUND_OFF
    length, factor = unit([result.heel], LENGTHS)
    for phase, label, style, color in (
        (~driven, "level prescribed", "o-", BLUE),
        (driven & ~after, f"{case['drive']} prescribed", "s-", ORANGE),
        (after, "level prescribed again", "^-", GREEN),
    ):
        steps = np.flatnonzero(phase | np.append(phase[1:], False))  # with the step before
        opening, level = result.heel[steps] * factor, history["level"][steps]
        axes.plot(opening, level, style, color=color, markersize=4, label=label)
    if case["face_load"] == "uniform" and case["uplift"] == "none":
        bound = overturning_level(case)
        label = f"rigid dam overturns: {bound:.3f} m"
        axes.axhline(bound, color="black", linestyle="--", linewidth=0.8, label=label)
    axes.set(xlabel=f"opening of the heel [{length}]", ylabel="level [m]")
    axes.set_title("\n".join(title), fontsize=11, parse_math=False)
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)
    return figure
