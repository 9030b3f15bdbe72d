"""Picture of an earthquake: record, crest, openings, slip and joint stress over one time axis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ..model.results import QuakeResult, column_of
from ..post.drawing import BLUE, DARK, GREEN, ORANGE, RED, figure_of, panels, write_picture

#: Largest number of rows of the map of the stress.
MOST_ROWS = 1500


def draw(result: QuakeResult, folder: Path) -> Path:
    """Draw the picture of an earthquake into its folder; its path."""
    path = folder / f"{result.case.name}_quake.png"
    write_picture(figure(result), path, dpi=130)
    return path


def figure(result: QuakeResult) -> Figure:
    """The figure."""
    case, rows, stress = result.case, result.rows, result.stress
    picture = figure_of(9.0, 11.0)
    picture.text(0.05, 0.985, f"{case.title}: {result.statement}", va="top", fontsize=10)
    axes = panels(picture, 6, left=0.9, right=1.1, top=0.55, down=0.2)[:, 0]
    time, joints = rows["time"], range(len(case.joints))
    curves = [
        ("ground [m/s$^2$]", [("along x", rows["ground_ax"], DARK)]),
        ("crest $u_x$ [mm]", [("relative to the ground", 1e3 * rows["crest_ux"], BLUE)]),
        ("crest $a_x$ [m/s$^2$]", [("absolute", rows["crest_ax"], BLUE)]),
        ("opening [mm]", []),
        ("slip [mm]", []),
    ]
    if rows["ground_ay"].any():
        curves[0][1].append(("along y", rows["ground_ay"], ORANGE))
    for k in joints:
        name = f", {case.joint_names[k]}" if len(case.joints) > 1 else ""
        style = (RED, GREEN) if k == 0 else (ORANGE, BLUE)
        for end, color in zip(("heel", "toe"), style, strict=True):
            opening = 1e3 * np.maximum(rows[column_of(f"{end}_opening", k)], 0)
            curves[3][1].append((f"{end}{name}", opening, color))
        curves[4][1].append((f"mean{name}", 1e3 * rows[column_of("slip_mean", k)], style[0]))
    block = result.summary["residual"]["rigid_block"]
    for ax, (label, lines) in zip(axes, curves, strict=False):
        for name, values, color in lines:
            ax.plot(time, values, color=color, lw=0.8, label=name)
        ax.set_ylabel(label, fontsize=8)
        ax.grid(alpha=0.3)
        ax.set_xlim(0, time[-1])
    if np.isfinite(block):
        axes[4].axhline(1e3 * block, color=DARK, lw=0.8, ls="--", label="rigid block, at the end")
    for ax in axes[:5]:
        ax.legend(fontsize=7, loc="upper right")
        ax.tick_params(labelbottom=False, labelsize=8)
    step = max(1, len(time) // MOST_ROWS)
    values = stress["sigma_n_eff"][::step].T / 1e6
    bound = float(np.abs(values).max()) or 1.0
    mesh = axes[5].pcolormesh(
        stress["time"][::step],
        stress["s"],
        values,
        cmap="RdBu_r",
        vmin=-bound,
        vmax=bound,
        shading="nearest",
        rasterized=True,
    )
    axes[5].set_xlim(0, time[-1])
    axes[5].set_ylabel("s from heel [m]", fontsize=8)
    axes[5].set_xlabel("t [s]", fontsize=8)
    axes[5].tick_params(labelsize=8)
    box = axes[5].get_position()
    bar = picture.add_axes((box.x1 + 0.02, box.y0, 0.015, box.height))
    picture.colorbar(mesh, cax=bar).set_label("$\\sigma_n'$ [MPa]", fontsize=8)
    bar.tick_params(labelsize=7)
    return picture
