"""Picture of natural modes."""

from __future__ import annotations

import textwrap
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from ..dynamics.modes import NaturalModes, Variant
from .drawing import CONCRETE, GREY, ROCK, figure_of, picture_style, write_picture
from .outline import skin
from .run_picture import VIEW

#: Largest displacement in the picture over the dam's size; ground around the dam.
DRAWN, AROUND = 0.12, 0.25
#: Size of a drawn mode [inches]; modes that are drawn; letters of the heading in an inch.
PANEL, MOST, LETTERS = 2.6, 5, 13


def draw(natural: NaturalModes, about: str, path: Path) -> None:
    """Write the picture, see `figure`."""
    write_picture(figure(natural, about), path, 130)


@picture_style()
def figure(natural: NaturalModes, about: str) -> Figure:
    """The shapes of the modes with water on elastic rock, all frequencies; about: their case."""
    first = natural.variants[0]
    number = min(len(first.modes), MOST)
    words = textwrap.wrap(f"{natural.case.title}: {about}", int(LETTERS * PANEL * number))
    head = 0.15 + 0.17 * len(words)
    foot = 0.2 + 0.17 * len(natural.variants)
    width, height = PANEL * number + 0.2, head + 0.4 + PANEL + foot
    picture = figure_of(width, height)
    y = 1 - 0.1 / height
    picture.text(0.1 / width, y, "\n".join(words), va="top", fontsize=9, parse_math=False)
    for k in range(number):
        position = (0.1 + k * PANEL) / width, foot / height, 0.96 * PANEL / width, PANEL / height
        axes = picture.add_axes(position)
        draw_shape(axes, natural, first, k)
        mode = first.modes[k]
        title = f"mode {k + 1}: {mode.frequency:.3g} Hz, {1 / mode.frequency:.3g} s\n"
        along_x, along_y = 100 * mode.along_x, 100 * mode.along_y
        title += f"{along_x:.0f} % of the mass along x, {along_y:.0f} % along y"
        axes.set_title(title, fontsize=8)
    lines = []
    for variant in natural.variants:
        values = ", ".join(f"{mode.frequency:.3g}" for mode in variant.modes)
        drawn = ", drawn" if variant is first else ""
        lines.append(f"water: {variant.water}; rock: {variant.rock}{drawn}: {values} Hz")
    picture.text(0.1 / width, 0.1 / height, "\n".join(lines), va="bottom", fontsize=8)
    return picture


def draw_shape(axes: Axes, natural: NaturalModes, variant: Variant, number: int) -> None:
    """Draw dam and rock displaced in a mode, in 3D seen from downstream and above."""
    mesh, shape = natural.mesh, variant.shapes[number]
    view = VIEW if mesh.dim == 3 else np.eye(3)
    scale = DRAWN * natural.case.size
    faces, depths, colors, near = [], [], [], []
    for name, moved in shape.items():
        body = mesh.solids[name]
        full = np.zeros((len(body.points), 3))
        full[:, : mesh.dim] = moved
        positions = (body.points + scale * full) @ view
        near += [body.points @ view] if name != "foundation" else []
        for table, _ in skin(body):
            faces += list(positions[table, :2])
            depths.append(positions[table, 2].mean(axis=1))
            colors += [ROCK if name == "foundation" else CONCRETE] * len(table)
    order = np.argsort(np.concatenate(depths), kind="stable")
    cells = PolyCollection([faces[i] for i in order], facecolor=[colors[i] for i in order])
    cells.set(edgecolor=GREY, linewidth=0.15, rasterized=True)
    axes.add_collection(cells, autolim=False)
    dam, room = np.concatenate(near)[:, :2], AROUND * natural.case.size
    (x0, y0), (x1, y1) = dam.min(axis=0) - room, dam.max(axis=0) + room
    axes.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal")
    axes.set_axis_off()
