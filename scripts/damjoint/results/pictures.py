"""The pictures of a run: the deformed dam, the joint with the published numbers on it, the load
curve.
"""

from __future__ import annotations

import textwrap
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg  # not pyplot: it costs half of a 2D run
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from ..scene.case import Case
from ..scene.mesh import Body, Mesh
from . import validation
from .fields import Field, row_of_nodes
from .tables import Results
from .verdict import overturning_level, statement

BLUE, ORANGE, WATER, RED, GREEN = "#0b5394", "#cc7a00", "#3d9be0", "#b3261e", "#3c7d3c"

#: Units by size: name, how many of it make one of the base unit.
LENGTHS = (("m", 1), ("mm", 1e3), ("µm", 1e6), ("nm", 1e9))
STRESSES = (("MPa", 1e-6), ("kPa", 1e-3), ("Pa", 1))


def unit(values: list[np.ndarray], units: tuple) -> tuple[str, float]:
    """The unit in which the largest of the values is at least one, and its factor."""
    largest = max((np.abs(v).max(initial=0) for v in values), default=0)
    return next((u for u in units if largest * u[1] >= 1), units[-1])


def sides_of(body: Body) -> list[np.ndarray]:
    """The plane cells of a body, or in 3D the element sides at z = 0, as rows of point numbers."""
    sides = {
        "tetra": ([0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]),
        "wedge": ([0, 1, 2], [3, 4, 5]),
        "hexahedron": ([0, 1, 2, 3], [4, 5, 6, 7]),
    }
    found = []
    for shape, table in body.cells:
        for side in sides.get(shape, (slice(None),)):
            faces = table[:, side]
            found.append(faces[np.all(np.abs(body.points[faces, 2]) < 1e-9, axis=1)])
    return found


def along(rows: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The joint's rows as curves over x: means over z."""
    x, place = np.unique(np.round(rows["x"], 9), return_inverse=True)
    number = np.bincount(place)
    return {name: np.bincount(place, column) / number for name, column in rows.items()} | {"x": x}


def draw(result: Results, mesh: Mesh, fields: dict[float, Field], folder: Path) -> Path:
    """Draw the last saved state to folder/<case>.png and return its path; fields: at least the last
    one.

    Left: the deformed bodies, displacement exaggerated so that it shows. Right: jumps and stresses
    along the joint (means over z in 3D), with the published values of the case. In 3D below: the
    joint seen from above.
    """
    case = result.case
    solid = case["dim"] == 3
    figure = Figure(figsize=(12, 9.3 if solid else 7))
    FigureCanvasAgg(figure)
    bottom = 0.36 if solid else 0.08
    grid = figure.add_gridspec(
        2,
        2,
        width_ratios=(1, 1.3),
        left=0.06,
        right=0.985,
        bottom=bottom,
        top=0.88,
        wspace=0.16,
        hspace=0.12,
    )
    section = figure.add_subplot(grid[:, 0])
    jumps, stresses = (figure.add_subplot(grid[i, 1]) for i in (0, 1))
    head = textwrap.fill(heading(result), 105)
    figure.text(0.06, 0.99, head, fontsize=12.5, va="top", parse_math=False)
    said = statement(result)
    if said:
        figure.text(0.06, 0.94, textwrap.fill(said, 170), fontsize=9, color=RED, va="top")
    if len(result.joint["time"]):
        rows = result.at()
        draw_section(section, result, mesh, fields, rows)
        draw_joint(jumps, stresses, case, along(rows))
        if solid:
            draw_maps(figure, mesh.bodies["joint"], result)
    if case["drive"] != "level":
        draw_curve(result, folder / f"{case.name}_curve.png")
    path = folder / f"{case.name}.png"
    figure.savefig(path, dpi=110)
    return path


def heading(result: Results) -> str:
    """What the picture shows, in a line."""
    case, last = result.case, result.last
    said = f"{case.title}, uplift {case['uplift']}"
    if not last:
        return said
    said += f", level {last['level']:.4g} m"
    if last["tail_level"] > 0:
        said += f", tailwater {last['tail_level']:.4g} m"
    if case["uplift"] == "flow":
        said += f", leakage {last['flux']:.3g} kg/(m s)"
    return said


def draw_section(
    axes: Axes, result: Results, mesh: Mesh, fields: dict[float, Field], rows: dict[str, np.ndarray]
) -> None:
    """The deformed bodies, the water beside them, the open part of the joint in red."""
    case, last = result.case, result.last
    base, height = case["dam_base"], case["dam_height"]
    moved = fields[max(fields)].displacement if fields else {}
    largest = max((np.abs(u).max() for u in moved.values()), default=0)
    scale = 0.06 * height / largest if largest > 0 else 1.0
    for name, color in (("foundation", "#d8c9ae"), ("dam", "#c3ccd6")) if moved else ():
        body = mesh.bodies[name]
        place = (body.points + scale * moved[name])[:, :2]
        for faces in sides_of(body):
            axes.add_collection(
                PolyCollection(place[faces], facecolor=color, edgecolor="#5a5a5a", linewidth=0.15)
            )
    if "dam" in moved:
        dam = mesh.bodies["dam"]
        lip = np.flatnonzero((np.abs(dam.points[:, 1]) < 1e-9) & (np.abs(dam.points[:, 2]) < 1e-9))
        lip = lip[np.argsort(dam.points[lip, 0])]
        curves = along(rows)
        broken = np.interp(dam.points[lip, 0], curves["x"], curves["damage"]) >= 1
        place = (dam.points + scale * moved["dam"])[lip, :2]
        open_parts = np.stack([place[:-1], place[1:]], axis=1)[broken[:-1] & broken[1:]]
        axes.add_collection(LineCollection(open_parts, color=RED, linewidth=2.5))
    beside = min(case["found_side"], 0.6 * height)
    axes.fill_between([-beside, 0], 0, last["level"], color=WATER, alpha=0.4, linewidth=0)
    tail = last["tail_level"]
    if tail > 0:
        lean = (base - case["dam_crest"]) / height
        right = base + beside
        axes.fill(
            [base, right, right, base - lean * tail], [0, 0, tail, tail], color=WATER, alpha=0.4
        )
    axes.set(
        xlim=(-1.03 * beside, base + 1.03 * beside),
        ylim=(-1.03 * min(case["found_depth"], 0.5 * height), 1.1 * height),
        aspect="equal",
        xlabel="x [m]",
        ylabel="y [m]",
    )
    axes.set_title(
        f"displacement x {scale:.2g}" + (", broken or open joint red" if len(rows["x"]) else ""),
        fontsize=10,
    )


def draw_joint(jumps: Axes, stresses: Axes, case: Case, curves: dict[str, np.ndarray]) -> None:
    """Jumps and stresses over x, with the published values."""
    x = curves["x"]
    slipped = "released slip" if case["law"] == "rupture" else "slip"
    length, per_m = unit([curves["delta_n"], curves["delta_t1"]], LENGTHS)
    jumps.plot(x, curves["delta_n"] * per_m, color=BLUE, label="opening")
    jumps.plot(x, curves["delta_t1"] * per_m, color=ORANGE, label="tangential jump (downstream)")
    jumps.plot(x, curves["slip"] * per_m, "--", color=ORANGE, label=f"{slipped}, size")
    stress, per_pa = unit([curves["sigma_n"], curves["tau_1"]], STRESSES)
    stresses.plot(x, curves["sigma_n"] * per_pa, color=BLUE, label="normal stress, total")
    if case["uplift"] != "none":
        effective = curves["sigma_n_eff"] * per_pa
        stresses.plot(x, effective, "--", color=BLUE, label="normal stress, effective")
        stresses.plot(x, -curves["p"] * per_pa, ":", color=WATER, label="minus water pressure")
    stresses.plot(x, curves["tau_1"] * per_pa, color=ORANGE, label="shear stress")
    marks = {
        "delta_n": (jumps, per_m, BLUE),
        "delta_t1": (jumps, per_m, ORANGE),
        "sigma_n": (stresses, per_pa, BLUE),
    }
    published = validation.references(case) if curves["time"][0] == validation.read_at(case) else []
    for row in published:
        if row.quantity in marks and row.tolerance is not None:
            axes, factor, color = marks[row.quantity]
            spread = abs(row.value * row.tolerance * factor)
            axes.errorbar(
                row.x,
                row.value * factor,
                spread,
                fmt="o",
                markersize=4,
                color=color,
                mfc="white",
                capsize=2,
            )
    jumps.set(ylabel=f"jump [{length}]")
    jumps.tick_params(labelbottom=False)
    stresses.set(ylabel=f"stress [{stress}]", xlabel="x [m], heel to toe")
    for axes in (jumps, stresses):
        axes.axhline(0, color="black", linewidth=0.5)
        axes.legend(fontsize=8, loc="best")
        axes.grid(alpha=0.3)


def draw_maps(figure: Figure, joint: Body, result: Results) -> None:
    """The joint seen from above: opening and effective normal stress at its nodes."""
    rows = result.at()
    nearest = row_of_nodes(joint, rows)
    for i, (name, label, units, colors) in enumerate(
        (
            ("delta_n", "opening", LENGTHS, "Blues"),
            ("sigma_n_eff", "effective normal stress", STRESSES, "Blues_r"),
        )
    ):
        axes = figure.add_axes((0.06 + 0.47 * i, 0.06, 0.37, 0.2))
        bar = figure.add_axes((0.44 + 0.47 * i, 0.06, 0.012, 0.2))
        size, factor = unit([rows[name]], units)
        values = rows[name][nearest] * factor
        for _, table in joint.cells:
            faces = PolyCollection(
                joint.points[table][:, :, [0, 2]],
                array=values[table].mean(axis=1),
                cmap=colors,
                edgecolor="face",
            )
            faces.set_clim(values.min(), values.max())
            axes.add_collection(faces)
        axes.autoscale_view()
        axes.set(xlabel="x [m], heel to toe", ylabel="z [m]")
        axes.set_title(f"{label} [{size}]", fontsize=10)
        figure.colorbar(faces, cax=bar)


def draw_curve(result: Results, path: Path) -> None:
    """The level against the heel's opening; for a uniform pressure also where the rigid dam turns
    over.
    """
    case, history = result.case, result.history
    figure = Figure(figsize=(7, 4.5), layout="tight")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    begin = history["time"] > case["drive_begin"] + 1e-9
    end = history["time"] > case["drive_end"] + 1e-9
    length, factor = unit([result.heel], LENGTHS)
    for phase, label, style in (
        (~begin, "level prescribed", "o-"),
        (begin & ~end, f"{case['drive']} prescribed", "s-"),
        (end, "level prescribed again", "^-"),
    ):
        axes.plot(
            result.heel[phase] * factor, history["level"][phase], style, markersize=4, label=label
        )
    if case["face_load"] == "uniform" and case["uplift"] == "none":
        bound = overturning_level(case)
        label = f"rigid dam turns over: {bound:.3f} m"
        axes.axhline(bound, color="black", linestyle="--", linewidth=0.8, label=label)
    axes.set(xlabel=f"opening of the heel [{length}]", ylabel="level [m]")
    axes.set_title(textwrap.fill(case.title, 70), parse_math=False)
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=110)
