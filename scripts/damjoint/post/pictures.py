"""Pictures of a run: section, joint, history; in 3D also a view and maps of the joint; under
displacement control also the load curve.

Each is drawn into a figure or subfigure: side by side in CASE.png, alone in a report.
"""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure, FigureBase
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from .. import ROUND_OFF
from ..model.case import Case
from ..model.fields import (
    OPEN,
    SLIPPED,
    SOFTENING,
    Solution,
    along,
    distance,
    joint_body,
    row_of_nodes,
    state_of,
)
from ..model.results import Results
from ..statics import gravity
from ..statics.verdict import decisive_joint, overturning_level, statement
from . import validation
from .drawing import (
    BLUE,
    DARK,
    GREEN,
    GREY,
    ORANGE,
    RED,
    VIOLET,
    WATER,
    figure_of,
    legend_above,
    panels,
    write_picture,
)
from .outline import exaggeration, skin
from .section_picture import draw_section
from .units import FLUXES, LENGTHS, STRESSES, Units, unit

DPI = 110
#: Inches: width of the figure; heights of heading, section with joint, history, 3D view with maps.
WIDTH, HEAD, UPPER, HISTORY, SOLID = 13.0, 0.75, 7.2, 2.5, 4.6
#: Left margin [inches]; characters per inch and height in the figure of title and message.
MARGIN = 0.7
TITLE, MESSAGE = (8.5, 0.8), (14, 0.35)
#: Width of the panels on the right over that of the section on the left.
RIGHT = 1.15
#: Share of the shear's range that must be negative for the limit to be drawn with both signs.
BOTH_SIGNS = 0.02
#: Limits of an axis in percent: lines at 0 and 100 are visible.
PERCENT = (-3, 103)
DISTANCE = "distance from the heel along the joint [m]"


def draw(solution: Solution, folder: Path) -> Path:
    """Draw all into folder/<case>.png and return its path; a load curve into <case>_curve.png."""
    result = solution.result
    if result.case["drive"] != "level":
        write_picture(draw_curve(result), folder / f"{result.case.name}_curve.png", DPI)
    path = folder / f"{result.case.name}.png"
    write_picture(picture(solution), path, DPI, compress_level=2)
    return path


def picture(solution: Solution) -> Figure:
    """Section and joint at the last state, or that of the published numbers; the history."""
    result = solution.result
    case = result.case
    has_states = bool(len(result.joint["time"]))
    heights = [HEAD]
    if has_states:
        heights += [UPPER, HISTORY, SOLID] if case["dim"] == 3 else [UPPER, HISTORY]
    figure = figure_of(WIDTH, sum(heights))
    head, *parts = np.ravel(figure.subfigures(len(heights), 1, height_ratios=heights))
    write_heading(head, result)
    if has_states:
        time = shown_time(result)
        left, right = parts[0].subfigures(1, 2, width_ratios=(1, RIGHT))
        draw_dam(left, solution, time)
        joint = decisive_joint(result)
        own = result.joints[joint]
        draw_joint(right, own, time)
        if case.of_joints:
            right.suptitle(case.joint_names[joint], fontsize=9)
        draw_history(parts[1], own)
        if case["dim"] == 3:
            draw_solid(parts[2], solution, time)
    return figure


def shown_time(result: Results) -> float:
    """Requested time of the state drawn: the last, or that of the published numbers."""
    times = result.joint["time"]
    published_time = validation.reference_time(result.case)
    published = validation.references(result.case) and np.isclose(times, published_time).any()
    return published_time if published else times.max()


def write_heading(figure: FigureBase, result: Results) -> None:
    """Write the title of the picture and the message of the run."""
    width = figure.bbox.width / figure.dpi
    (per_inch, y), (small_per_inch, lower_y) = TITLE, MESSAGE
    title = textwrap.fill(heading(result), int(per_inch * width))
    figure.text(MARGIN / width, y, title, fontsize=13, va="top", parse_math=False)
    message = textwrap.fill(statement(result), int(small_per_inch * width))
    figure.text(MARGIN / width, lower_y, message, fontsize=9, color=RED, va="top")


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
    return title


def shear_limit(case: Case, rows: dict[str, np.ndarray]) -> tuple[str, np.ndarray] | None:
    """The joint's shear strength at each row [Pa], and its formula; None if it has none."""
    law = case.law
    if not law.limits_shear:
        return None
    hardening = " + H slip" if law.hardening_parameter and case.hardening_asked else ""
    strength = law.shear_strength(rows["sigma_n_eff"], rows["damage"], rows["slip"])
    return f"limit: {law.shear_strength_formula}{hardening}", strength


def draw_joint(figure: FigureBase, result: Results, time: float) -> None:
    """Draw jumps, normal stress and shear along the joint (means over z in 3D), with the published
    values, or without any the stress of the gravity method.
    """
    case, curves = result.case, along(result.at(time))
    jumps, normals, shears = panels(figure, 3, 1, top=0.5, down=0.42).flat
    draw_jumps(jumps, case, curves)
    factor = draw_normal_stress(normals, case, curves)
    if not (validation.references(case) or case.geometry):
        draw_gravity_stress(normals, gravity.at(case, time, result.state(time)["level"]), factor)
    draw_shear(shears, case, curves)
    state = state_of(curves)
    for axes in (jumps, normals, shears):
        full_height = axes.get_xaxis_transform()
        for number, color in ((OPEN, RED), (SOFTENING, VIOLET), (SLIPPED, ORANGE)):
            style = {"color": color, "alpha": 0.07, "linewidth": 0, "transform": full_height}
            axes.fill_between(curves["s"], 0, 1, where=state == number, **style)
        axes.axhline(0, color="black", linewidth=0.5)
        axes.grid(alpha=0.3)
        axes.margins(x=0.01)
        axes.tick_params(labelbottom=axes is shears)
        legend_above(axes)
    shears.set_xlabel(DISTANCE)


def draw_jumps(axes: Axes, case: Case, curves: dict[str, np.ndarray]) -> None:
    """Draw opening, tangential jump and slip."""
    length, factor = unit([curves["delta_n"], curves["delta_t1"]], LENGTHS)
    for name, style, color, label in (
        ("delta_n", "-", BLUE, "opening"),
        ("delta_t1", "-", ORANGE, "tangential (downstream > 0)"),
        ("slip", "--", ORANGE, f"{case.law.slip_name}, size"),
    ):
        axes.plot(curves["s"], curves[name] * factor, style, color=color, label=label)
    draw_published(axes, case, curves, {"delta_n": BLUE, "delta_t1": ORANGE}, factor)
    axes.set_ylabel(f"jump [{length}]")


def draw_normal_stress(axes: Axes, case: Case, curves: dict[str, np.ndarray]) -> float:
    """Draw total and effective normal stress, and the water pressure between them.

    Returns the factor from Pa to the unit drawn.
    """
    stress, factor = unit([curves["sigma_n"], curves["sigma_n_eff"]], STRESSES)
    s = curves["s"]
    axes.plot(s, curves["sigma_n"] * factor, color=BLUE, label="total (tension > 0)")
    if case["uplift"] != "none":
        effective = curves["sigma_n_eff"] * factor
        axes.plot(s, effective, "--", color=DARK, label="effective")
        style = {"color": WATER, "alpha": 0.25, "linewidth": 0}
        axes.fill_between(s, -curves["p"] * factor, 0, **style, label="uplift")
    draw_published(axes, case, curves, {"sigma_n": BLUE}, factor)
    axes.set_ylabel(f"normal stress [{stress}]")
    return factor


def draw_gravity_stress(axes: Axes, method: gravity.GravityMethod, factor: float) -> None:
    """Draw the effective stress of the gravity method: zero in the crack, linear beyond its tip."""
    if method.stands:
        crack, length = method.crack_length, method.body.length
        s = [0, crack, crack, length]
        stress = np.array([0, 0, method.tip_stress, method.sigma_n_eff_toe]) * factor
        axes.plot(s, stress, ":", color=GREY, linewidth=1.8, label="gravity method")


def draw_shear(axes: Axes, case: Case, curves: dict[str, np.ndarray]) -> None:
    """Draw the shear stress and its limit by the law, with both signs where both occur."""
    limit = shear_limit(case, curves)
    stress, factor = unit([curves["tau_1"], *([limit[1]] if limit else [])], STRESSES)
    shear = curves["tau_1"] * factor
    axes.plot(curves["s"], shear, color=ORANGE, label="shear stress (downstream > 0)")
    if limit:
        label, size = limit
        axes.plot(curves["s"], size * factor, "--", color=GREEN, label=label)
        if shear.min() < -BOTH_SIGNS * np.ptp(shear):
            axes.plot(curves["s"], -size * factor, "--", color=GREEN)
    axes.set_ylabel(f"shear stress [{stress}]")


def draw_published(
    axes: Axes, case: Case, curves: dict[str, np.ndarray], colors: dict[str, str], factor: float
) -> None:
    """Draw published values of some quantities with their tolerances, at the time they are for."""
    references = validation.references(case)
    if not np.isclose(curves["time"][0], validation.reference_time(case)):
        return
    for name, color in colors.items():
        rows = [r for r in references if r.quantity == name and r.tolerance is not None]
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


def draw_history(figure: FigureBase, result: Results) -> None:
    """Draw opening, crest displacement, crack and, with flow, leakage against the level."""
    panels_shown = history_panels(result)
    row = panels(figure, 1, len(panels_shown), left=0.85, across=0.95).flat
    for axes, (quantity, units, lines) in zip(row, panels_shown, strict=True):
        name, factor = unit([result.history[line.column] for line in lines], units)
        # the lines often coincide: those drawn later are dashed or dotted
        for line, style in zip(lines, ("o-", "o--", "o:"), strict=False):
            values = result.history[line.column] * factor
            look = {"color": line.color, "markersize": 3, "label": line.label}
            axes.plot(result.history["level"], values, style, **look)
        axes.set(xlabel="reservoir level [m]", ylabel=f"{quantity} [{name}]")
        axes.grid(alpha=0.3)
        if name == "%":
            axes.set_ylim(*PERCENT)
        if lines[0].label:
            legend_above(axes)


def history_panels(result: Results) -> list[tuple[str, Units, list[Line]]]:
    """Panels of the history: quantity, units, lines."""
    lengths = [Line("crack_length", RED, "open"), Line("slip_length", ORANGE, "slipped")]
    if result.history["process_zone"].any():
        lengths.append(Line("process_zone", VIOLET, "softening"))
    shown: list[tuple[str, Units, list[Line]]] = [
        ("largest opening", LENGTHS, [Line("max_opening", BLUE)]),
        ("crest movement", LENGTHS, [Line("crest_ux", BLUE)]),
        ("part of the joint", (("%", 100 / joint_length(result)),), lengths),
    ]
    if result.case["uplift"] == "flow":
        shown.append(("leakage", FLUXES, [Line("flux", BLUE)]))
    return shown


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
    """Draw what 3D has besides: a view (if `draw_dam` has not drawn it) and maps of the joint."""
    if is_own_solid(solution.result.case):
        draw_maps(figure, solution, time)
        return
    left, right = figure.subfigures(1, 2, width_ratios=(1, RIGHT))
    draw_view(left, solution, time)
    draw_maps(right, solution, time)


def draw_view(figure: FigureBase, solution: Solution, time: float) -> None:
    """Draw the deformed skin of all bodies, in colors of the displacement."""
    field = solution.fields.get(time)
    if field is None:
        return
    scale = exaggeration(field.displacement, solution.result.case.size)
    sizes = {name: np.linalg.norm(u, axis=1) for name, u in field.displacement.items()}
    length, factor = unit(list(sizes.values()), LENGTHS)
    polygons, values = [], []
    for name, displacement in field.displacement.items():
        body = solution.bodies[name]
        points = (body.points + scale * displacement) @ TO_VIEW
        for table, _ in skin(body):
            polygons += list(points[table])
            values.append(sizes[name][table].mean(axis=1) * factor)
    axes = figure.add_axes((0.0, 0.0, 0.86, 0.95), projection="3d", computed_zorder=False)
    faces = Poly3DCollection(
        polygons, array=np.concatenate(values), cmap="YlGnBu", edgecolor=GREY, linewidth=0.1
    )
    faces.set_rasterized(True)
    axes.add_collection3d(faces)
    corners = np.concatenate(polygons)
    low, high = corners.min(axis=0), corners.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low, zoom=1.05)
    axes.view_init(elev=30, azim=-35)
    axes.set_axis_off()
    bar = figure.add_axes((0.88, 0.2, 0.02, 0.6))
    figure.colorbar(faces, cax=bar)
    axes.set_title(f"displacement [{length}], drawn x {scale:g}", fontsize=9, loc="left")


#: From our x, y, z to matplotlib's, whose z is the height.
TO_VIEW = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])


def draw_maps(figure: FigureBase, solution: Solution, time: float) -> None:
    """Draw maps of the unrolled joint: opening, effective normal stress, shear stress."""
    number = decisive_joint(solution.result)
    rows = solution.result.joints[number].at(time)
    joint = joint_body(solution.bodies, number)
    nearest = row_of_nodes(joint, rows)
    places = np.column_stack([distance(rows)[nearest], joint.points[:, 2]])
    shown = (
        ("delta_n", "opening", LENGTHS, "Blues"),
        ("sigma_n_eff", "effective normal stress", STRESSES, "Blues_r"),
        ("tau_1", "shear stress", STRESSES, "Oranges"),
    )
    for axes, (name, label, units, colors) in zip(
        panels(figure, len(shown), 1, right=0.3, down=0.4).flat, shown, strict=True
    ):
        size, factor = unit([rows[name]], units)
        values = rows[name][nearest] * factor
        for _, table in joint.cells:
            faces = PolyCollection(
                places[table], array=values[table].mean(axis=1), cmap=colors, edgecolor="face"
            )
            faces.set(clim=(values.min(), values.max()), rasterized=True)
            axes.add_collection(faces)
        axes.autoscale_view()
        axes.margins(0)
        axes.set_ylabel("z [m]")
        axes.set_title(f"{label} [{size}]", fontsize=9, loc="left")
        axes.tick_params(labelbottom=name == shown[-1][0])
        figure.colorbar(faces, ax=axes, pad=0.02)
    axes.set_xlabel(DISTANCE)


def draw_curve(result: Results) -> FigureBase:
    """Draw the level against the heel's opening; for a uniform pressure also the level at which the
    rigid dam overturns.
    """
    case, history = result.case, result.history
    figure = figure_of(7, 4.5)
    (axes,) = panels(figure, top=0.6).flat
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
    axes.set_title(textwrap.fill(case.title, 70), parse_math=False)
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)
    return figure
