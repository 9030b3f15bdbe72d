"""Picture of an earthquake: record, crest, openings, slip, forces and joint stress over one time
axis; the dam at its peaks.
"""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..dynamics.record_files import STANDARD_GRAVITY
from ..model.loads import Loading
from ..model.results import column_of
from ..pictures.drawing import (
    BLUE,
    CONCRETE,
    DARK,
    GREEN,
    GREY,
    ORANGE,
    RED,
    ROCK,
    VIOLET,
    figure_of,
    panels,
    picture_style,
    polygons,
    write_picture,
)
from ..pictures.outline import exaggeration
from ..pictures.scene import loads_label, state_label
from .quake_result import QuakeResult

#: Height of the curves, and of the deformed dams below them [inches].
CURVES, SHAPES = 12.0, 2.6
#: Colors of heel and toe, joint by joint.
COLORS = (RED, GREEN), (ORANGE, BLUE), (VIOLET, DARK), ("#6d4c41", "#00838f")
#: Entries of a legend in a row with large letters.
IN_ROW = 5
#: Part of the stresses within the colors of the map [%].
SHOWN = 99
#: Largest number of rows of the map of the stress.
MOST_ROWS = 1500


def draw(result: QuakeResult, folder: Path) -> Path:
    """Draw the picture of an earthquake into its folder; its path."""
    path = folder / f"{result.case.name}_quake.png"
    write_picture(figure(result), path, dpi=130)
    return path


@picture_style()
def figure(result: QuakeResult) -> Figure:
    """The figure."""
    shapes = SHAPES if result.shapes else 0.0
    picture = figure_of(9.0, CURVES + shapes)
    title = textwrap.wrap(f"{result.case.title}: {result.statement}", 100)
    facts = [line for text in facts_of(result) for line in textwrap.wrap(text, 125)]
    picture.text(0.05, 0.992, "\n".join(title), va="top", fontsize=10, parse_math=False)
    below = 0.992 - 0.2 * len(title) / (CURVES + shapes)
    style: dict[str, Any] = {"va": "top", "fontsize": 8, "color": DARK, "parse_math": False}
    picture.text(0.05, below, "\n".join(facts), **style)
    top = 0.4 + 0.2 * len(title) + 0.14 * len(facts)
    axes = panels(picture, 7, left=0.9, right=1.1, top=top, bottom=0.5 + shapes, down=0.25)[:, 0]
    draw_curves(axes[:6], result)
    for ax in axes[:6]:
        above = {"loc": "lower right", "bbox_to_anchor": (1.01, 0.97), "frameon": False}
        number = len(ax.get_legend_handles_labels()[0])
        close = {"handlelength": 1.2, "columnspacing": 0.8, "handletextpad": 0.3}
        ax.legend(fontsize=7 if number <= IN_ROW else 5.5, ncols=number, **above, **close)
        ax.tick_params(labelbottom=False, labelsize=8)
    draw_stress(picture, axes[6], result)
    draw_shapes(picture, result)
    return picture


def draw_curves(axes: np.ndarray, result: QuakeResult) -> None:
    """Draw ground, crest along x and its acceleration, openings, slip and forces, an axes each."""
    case, rows = result.case, result.rows
    curves = [
        ("ground [m/s$^2$]", [("along x", rows["ground_ax"], DARK)]),
        ("crest $u_x$ [mm]", [("relative to the ground", 1e3 * rows["crest_ux"], BLUE)]),
        ("crest $a_x$ [m/s$^2$]", [("absolute", rows["crest_ax"], BLUE)]),
        ("opening [mm]", []),
        ("slip [mm]", []),
        ("forces [MN/m]", forces(result)),
    ]
    if rows["ground_ay"].any():
        curves[0][1].append(("along y", rows["ground_ay"], ORANGE))
    for k in most_slip(result):
        name = f", {case.joint_names[k]}" if len(case.joints) > 1 else ""
        heel, toe = COLORS[k % len(COLORS)]
        for end, color in (("heel", heel), ("toe", toe)):
            opening = 1e3 * np.maximum(rows[column_of(f"{end}_opening", k)], 0)
            curves[3][1].append((f"{end}{name}", opening, color))
        curves[4][1].append((f"mean{name}", 1e3 * rows[column_of("slip_mean", k)], heel))
    for ax, (label, lines) in zip(axes, curves, strict=True):
        for name, values, color in lines:
            ax.plot(rows["time"], values, color=color, lw=0.8, label=name)
        ax.set_ylabel(label, fontsize=8)
        ax.grid(alpha=0.3)
        ax.set_xlim(0, rows["time"][-1])
    block = result.summary["residual"].get("rigid_block")
    if block is not None:
        end = f", {case.joint_names[0]}" if len(case.joints) > 1 else ""
        words = f"rigid block at the end{end}"
        axes[4].axhline(1e3 * block, color=DARK, lw=0.8, ls="--", label=words)
    draw_strength(axes[5], result)


def draw_stress(picture: Figure, axes: Axes, result: QuakeResult) -> None:
    """Draw the map of the effective normal stress along the joint over time."""
    stress, times = result.stress, result.rows["time"]
    step = max(1, len(times) // MOST_ROWS)
    values = stress["sigma_n_eff"][::step].T / 1e6
    # the stress of the corner elements is singular
    bound = float(np.percentile(np.abs(values), SHOWN)) or 1.0
    colors: dict[str, Any] = {"cmap": "RdBu_r", "vmin": -bound, "vmax": bound}
    mesh = axes.pcolormesh(
        stress["time"][::step], stress["s"], values, shading="nearest", rasterized=True, **colors
    )
    axes.set_xlim(0, times[-1])
    if result.case.of_joints:
        axes.set_title(f"stress along {result.case.named((0,))}", loc="right", fontsize=7, pad=3)
    axes.set_ylabel("s from heel [m]", fontsize=8)
    axes.set_xlabel("t [s]", fontsize=8)
    axes.tick_params(labelsize=8)
    box = axes.get_position()
    bar = picture.add_axes((box.x1 + 0.02, box.y0, 0.015, box.height))
    picture.colorbar(mesh, cax=bar, extend="both").set_label("$\\sigma_n'$ [MPa]", fontsize=8)
    bar.tick_params(labelsize=7)


def most_slip(result: QuakeResult) -> list[int]:
    """The joints that are drawn, by number: as many as there are colors, those that slip most."""
    slip = [np.abs(result.rows[column_of("slip_mean", k)]).max() for k in result.joints]
    return sorted(sorted(result.joints, key=lambda k: -slip[k])[: len(COLORS)])


def facts_of(result: QuakeResult) -> list[str]:
    """The record with its largest acceleration; loads and state of each joint before it; notes."""
    case, before = result.case, result.before
    peak = np.abs(result.rows["ground_ax"]).max() / STANDARD_GRAVITY
    texts = [f"record {Path(result.summary['record']).name}, largest acceleration {peak:.3g} g"]
    if last := before.last:
        loading = Loading.at(case, last["time"], last["level"], last["tail_level"])
        texts.append(f"before it: {loads_label(case, loading)}")
    for name, joint_result in zip(case.joint_names, before.joints, strict=True):
        if joint_result.last:
            state = state_label(joint_result.case, joint_result.last)
            texts.append(f"{name}: {state}" if case.of_joints else state)
    return [*texts, *(f"note: {note}" for note in result.summary["notes"])]


def forces(result: QuakeResult) -> list[tuple[str, np.ndarray, str]]:
    """Curves of T and N' of the joint with the largest residual slip [MN/m]."""
    rows, name = result.joint_rows(result.joint), result.case.named((result.joint,))
    end = f", {name}" if name else ""
    curves = (f"N'{end}", rows["N"], GREY), (f"T{end}", rows["T"], BLUE)
    return [(words, values / 1e6, color) for words, values, color in curves]


def draw_strength(axes: Axes, result: QuakeResult) -> None:
    """Draw the shear force that the same joint transmits as a band of both signs."""
    rows = result.joint_rows(result.joint)
    strength = np.maximum(rows["shear_reserve"] + np.abs(rows["T"]), 0.0) / 1e6
    if np.isfinite(strength).all():  # a law may not limit shear
        style: dict[str, Any] = {"color": RED, "alpha": 0.12, "linewidth": 0}
        axes.fill_between(rows["time"], -strength, strength, **style, label="strength for T")
        for side in (strength, -strength):
            axes.plot(rows["time"], side, color=RED, lw=0.5)


def draw_shapes(picture: Figure, result: QuakeResult) -> None:
    """Draw the dam in the states with the largest displacements."""
    height = picture.get_size_inches()[1]
    for i, (name, time, moved) in enumerate(result.shapes):
        width = 0.94 / len(result.shapes)
        box = (0.03 + i * width, 0.45 / height, 0.96 * width, (SHAPES - 0.5) / height)
        axes = picture.add_axes(box)
        scale = exaggeration(moved, result.case.size)
        for body, displacement in moved.items():
            solid = result.mesh.bodies[body]
            points = solid.points[:, :2]
            color = ROCK if body == "foundation" else CONCRETE
            for _, table in solid.cells:
                cells = polygons((points + scale * displacement)[table], facecolor=color)
                cells.set(edgecolor=GREY, linewidth=0.15, rasterized=True)
                axes.add_collection(cells)
        dams = np.vstack(
            [result.mesh.bodies[name].points for name in moved if name != "foundation"]
        )
        low, high = dams.min(axis=0), dams.max(axis=0)
        room = 0.2 * result.case.size
        axes.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room / 2, high[1] + room / 2))
        axes.set_aspect("equal")
        axes.set_axis_off()
        # below: a report cuts the picture in the white above a panel, and its title stays with it
        text = f"{name}, t = {time:.3f} s\nx {scale:g}"
        axes.set_title(text, fontsize=8, y=0, va="top", pad=-2)
