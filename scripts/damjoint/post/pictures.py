"""The pictures of a run: section, joint, history, in 3D the whole and the joint as maps; the load
curve of a driven run.

Each is drawn into a figure or a part of one: side by side in CASE.png, alone in a report.
"""

from __future__ import annotations

import textwrap
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import FigureBase
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from ..model.case import Case
from ..model.fields import (
    OPEN,
    SLIPPED,
    SOFTENING,
    Solution,
    along,
    distance,
    row_of_nodes,
    state_of,
)
from ..model.results import Results
from ..statics import gravity
from ..statics.verdict import overturning_level, statement
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
from .outline import skin
from .section_picture import draw_section, exaggeration
from .units import FLUXES, LENGTHS, STRESSES, unit

DPI = 110
#: Inches: the whole width, heading, section with joint, history, what 3D has besides.
WIDTH, HEAD, UPPER, HISTORY, SOLID = 13.0, 0.75, 7.2, 2.5, 4.6


def draw(solution: Solution, folder: Path) -> Path:
    """Draw all into folder/<case>.png and return its path; a driven run's load curve into another.

    The state drawn is the last one, or that which published numbers belong to.
    """
    result = solution.result
    case = result.case
    states = bool(len(result.joint["time"]))
    parts = [HEAD, *([UPPER, HISTORY, *([SOLID] if case["dim"] == 3 else [])] if states else [])]
    figure = figure_of(WIDTH, sum(parts))
    head, *parts = np.ravel(figure.subfigures(len(parts), 1, height_ratios=parts))
    write_heading(head, result)
    if states:
        time = shown_time(result)
        left, right = parts[0].subfigures(1, 2, width_ratios=(1, 1.15))
        draw_dam(left, solution, time)
        draw_joint(right, result, time)
        draw_history(parts[1], result)
        if case["dim"] == 3:
            draw_solid(parts[2], solution, time)
    if case["drive"] != "level":
        write_picture(draw_curve(result), folder / f"{case.name}_curve.png", DPI)
    path = folder / f"{case.name}.png"
    write_picture(figure, path, DPI, compress_level=2)
    return path


def shown_time(result: Results) -> float:
    """The requested time that is drawn: the last, or that of the published numbers."""
    times = result.joint["time"]
    at = validation.read_at(result.case)
    published = validation.references(result.case) and np.isclose(times, at).any()
    return at if published else times.max()


def write_heading(figure: FigureBase, result: Results) -> None:
    """What the picture shows, and what the run has said."""
    width = figure.bbox.width / figure.dpi
    head = textwrap.fill(heading(result), int(8.5 * width))
    figure.text(0.7 / width, 0.8, head, fontsize=13, va="top", parse_math=False)
    said = textwrap.fill(statement(result), int(14 * width))
    figure.text(0.7 / width, 0.35, said, fontsize=9, color=RED, va="top")


def heading(result: Results) -> str:
    """What the picture shows, in a line."""
    case, last = result.case, result.last
    if len(result.joint["time"]):
        last = result.state(shown_time(result))
    said = f"{case.title}, uplift {case['uplift']}"
    if not last:
        return said
    said += f", level {last['level']:.4g} m"
    if last["tail_level"] > 0:
        said += f", tailwater {last['tail_level']:.4g} m"
    if case["uplift"] == "flow":
        said += f", leakage {last['flux']:.3g} kg/(m s)"
    return said


def shear_limit(case: Case, rows: dict[str, np.ndarray]) -> tuple[str, np.ndarray] | None:
    """The joint's shear strength at each row [Pa], and its formula; None if it has none."""
    law = case.law
    if not law.limits_shear:
        return None
    hardening = " + H slip" if law.hardening_parameter and case.hardening_asked else ""
    strength = law.shear_strength(rows["sigma_n_eff"], rows["damage"], rows["slip"])
    return f"limit: {law.shear_strength_formula}{hardening}", strength


def draw_joint(figure: FigureBase, result: Results, time: float) -> None:
    """Jumps, normal stresses and shear along the joint (means over z in 3D), with the published
    values or, where there are none, the stress of the gravity method.
    """
    case, curves = result.case, along(result.at(time))
    jumps, normals, shears = panels(figure, 3, 1, top=0.5, down=0.42).flat
    draw_jumps(jumps, case, curves)
    factor = draw_normal_stress(normals, case, curves)
    if not (validation.references(case) or case.geometry):
        draw_by_hand(normals, gravity.at(case, time, result.state(time)["level"]), factor)
    draw_shear(shears, case, curves)
    state = state_of(curves)
    for axes in (jumps, normals, shears):
        across = axes.get_xaxis_transform()
        for number, color in ((OPEN, RED), (SOFTENING, VIOLET), (SLIPPED, ORANGE)):
            look = {"color": color, "alpha": 0.07, "linewidth": 0, "transform": across}
            axes.fill_between(curves["s"], 0, 1, where=state == number, **look)
        axes.axhline(0, color="black", linewidth=0.5)
        axes.grid(alpha=0.3)
        axes.margins(x=0.01)
        axes.tick_params(labelbottom=axes is shears)
        legend_above(axes)
    shears.set_xlabel("distance from the heel along the joint [m]")


def draw_jumps(axes: Axes, case: Case, curves: dict[str, np.ndarray]) -> None:
    """Opening, tangential jump and slip."""
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
    """Total and effective normal stress, and the water pressure between them.

    Returns how many of the unit drawn make a Pa.
    """
    stress, factor = unit([curves["sigma_n"], curves["sigma_n_eff"]], STRESSES)
    s = curves["s"]
    axes.plot(s, curves["sigma_n"] * factor, color=BLUE, label="total (tension > 0)")
    if case["uplift"] != "none":
        effective = curves["sigma_n_eff"] * factor
        axes.plot(s, effective, "--", color=DARK, label="effective")
        look = {"color": WATER, "alpha": 0.25, "linewidth": 0}
        axes.fill_between(s, -curves["p"] * factor, 0, **look, label="uplift")
    draw_published(axes, case, curves, {"sigma_n": BLUE}, factor)
    axes.set_ylabel(f"normal stress [{stress}]")
    return factor


def draw_by_hand(axes: Axes, hand: gravity.GravityMethod, factor: float) -> None:
    """The effective stress by the gravity method: none over the crack, linear beyond it."""
    if hand.stands:
        crack, length = hand.crack_length, hand.body.length
        s, stress = [0, crack, crack, length], [0, 0, hand.tip_stress, hand.sigma_n_eff_toe]
        axes.plot(
            s, np.array(stress) * factor, ":", color=GREY, linewidth=1.8, label="gravity method"
        )


def draw_shear(axes: Axes, case: Case, curves: dict[str, np.ndarray]) -> None:
    """Shear stress, and what the law lets it reach, of both signs where both occur."""
    limit = shear_limit(case, curves)
    stress, factor = unit([curves["tau_1"], *([limit[1]] if limit else [])], STRESSES)
    shear = curves["tau_1"] * factor
    axes.plot(curves["s"], shear, color=ORANGE, label="shear stress (downstream > 0)")
    if limit:
        words, size = limit
        axes.plot(curves["s"], size * factor, "--", color=GREEN, label=words)
        if shear.min() < -0.02 * np.ptp(shear):
            axes.plot(curves["s"], -size * factor, "--", color=GREEN)
    axes.set_ylabel(f"shear stress [{stress}]")


def draw_published(
    axes: Axes, case: Case, curves: dict[str, np.ndarray], colors: dict[str, str], factor: float
) -> None:
    """The published values of some quantities, with their tolerances, at the time they are of."""
    rows = validation.references(case)
    if not np.isclose(curves["time"][0], validation.read_at(case)):
        return
    for name, color in colors.items():
        some = [r for r in rows if r.quantity == name and r.tolerance is not None]
        if some:
            value = np.array([r.value for r in some]) * factor
            spread = np.abs(value) * [r.tolerance for r in some]
            look = {"fmt": "o", "markersize": 4, "color": color, "mfc": "white", "capsize": 2}
            label = "published" if name != "delta_t1" else None  # beside delta_n: once is enough
            axes.errorbar([r.x for r in some], value, spread, **look, label=label)


def draw_history(figure: FigureBase, result: Results) -> None:
    """Opening, crest movement, crack and, where water flows, leakage against the level."""
    history, flowing = result.history, result.case["uplift"] == "flow"
    shown = [
        ("largest opening", LENGTHS, [("max_opening", BLUE, "")]),
        ("crest movement", LENGTHS, [("crest_ux", BLUE, "")]),
        (
            "part of the joint",
            (("%", 100 / joint_length(result)),),
            [
                ("crack_length", RED, "open"),
                ("slip_length", ORANGE, "slipped"),
                *([("process_zone", VIOLET, "softening")] if history["process_zone"].any() else []),
            ],
        ),
        *([("leakage", FLUXES, [("flux", BLUE, "")])] if flowing else []),
    ]
    where = panels(figure, 1, len(shown), left=0.85, across=0.95).flat
    for axes, (what, units, lines) in zip(where, shown, strict=True):
        name, factor = unit([history[column] for column, *_ in lines], units)
        # dashed and dotted over the first one: they often coincide
        for (column, color, label), style in zip(lines, ("o-", "o--", "o:"), strict=False):
            values = history[column] * factor
            axes.plot(history["level"], values, style, color=color, markersize=3, label=label)
        axes.set(xlabel="reservoir level [m]", ylabel=f"{what} [{name}]")
        axes.grid(alpha=0.3)
        if name == "%":
            axes.set_ylim(-3, 103)
        if lines[0][2]:
            legend_above(axes)


def joint_length(result: Results) -> float:
    """Heel to toe along the joint [m]."""
    return float(distance(result.joint).max())


def own_solid(case: Case) -> bool:
    """Whether a scene is a user's own geometry in 3D, whose sections differ."""
    return case["dim"] == 3 and case.geometry is not None


def draw_dam(figure: FigureBase, solution: Solution, time: float) -> None:
    """The section, or the whole where no section stands for it."""
    draw = draw_view if own_solid(solution.result.case) else draw_section
    draw(figure, solution, time)


def draw_solid(figure: FigureBase, solution: Solution, time: float) -> None:
    """In 3D: the deformed whole, if it is not drawn yet, and the joint unrolled as maps."""
    if own_solid(solution.result.case):
        draw_maps(figure, solution, time)
        return
    left, right = figure.subfigures(1, 2, width_ratios=(1, 1.15))
    draw_view(left, solution, time)
    draw_maps(right, solution, time)


def draw_view(figure: FigureBase, solution: Solution, time: float) -> None:
    """The skin of all bodies, deformed, in colors of the displacement."""
    field = solution.fields.get(time)
    if field is None:
        return
    scale = exaggeration(field.displacement, solution.result.case.size)
    sizes = {name: np.linalg.norm(u, axis=1) for name, u in field.displacement.items()}
    length, factor = unit(list(sizes.values()), LENGTHS)
    polygons, values = [], []
    for name, moved in field.displacement.items():
        body = solution.bodies[name]
        place = (body.points + scale * moved) @ TO_VIEW
        for table, _ in skin(body):
            polygons += list(place[table])
            values.append(sizes[name][table].mean(axis=1) * factor)
    axes = figure.add_axes((0.0, 0.0, 0.86, 0.95), projection="3d", computed_zorder=False)
    faces = Poly3DCollection(
        polygons, array=np.concatenate(values), cmap="YlGnBu", edgecolor=GREY, linewidth=0.1
    )
    faces.set_rasterized(True)
    axes.add_collection3d(faces)
    ends = np.concatenate(polygons)
    low, high = ends.min(axis=0), ends.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low, zoom=1.05)
    axes.view_init(elev=30, azim=-35)
    axes.set_axis_off()
    bar = figure.add_axes((0.88, 0.2, 0.02, 0.6))
    figure.colorbar(faces, cax=bar)
    axes.set_title(f"displacement [{length}], drawn x {scale:g}", fontsize=9, loc="left")


#: x, y, z to what matplotlib calls x, y, z: its z is the height.
TO_VIEW = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])


def draw_maps(figure: FigureBase, solution: Solution, time: float) -> None:
    """The joint unrolled, heel to toe and across: opening, effective normal stress, shear."""
    rows, joint = solution.result.at(time), solution.bodies["joint"]
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
    axes.set_xlabel("distance from the heel along the joint [m]")


def draw_curve(result: Results) -> FigureBase:
    """The level against the heel's opening; for a uniform pressure also where the rigid dam turns
    over.
    """
    case, history = result.case, result.history
    figure = figure_of(7, 4.5)
    (axes,) = panels(figure, top=0.6).flat
    begin = history["time"] > case["drive_begin"] + 1e-9
    end = history["time"] > case["drive_end"] + 1e-9
    length, factor = unit([result.heel], LENGTHS)
    for phase, label, style, color in (
        (~begin, "level prescribed", "o-", BLUE),
        (begin & ~end, f"{case['drive']} prescribed", "s-", ORANGE),
        (end, "level prescribed again", "^-", GREEN),
    ):
        steps = np.flatnonzero(phase | np.append(phase[1:], False))  # and the one before
        opening, level = result.heel[steps] * factor, history["level"][steps]
        axes.plot(opening, level, style, color=color, markersize=4, label=label)
    if case["face_load"] == "uniform" and case["uplift"] == "none":
        bound = overturning_level(case)
        label = f"rigid dam turns over: {bound:.3f} m"
        axes.axhline(bound, color="black", linestyle="--", linewidth=0.8, label=label)
    axes.set(xlabel=f"opening of the heel [{length}]", ylabel="level [m]")
    axes.set_title(textwrap.fill(case.title, 70), parse_math=False)
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)
    return figure
