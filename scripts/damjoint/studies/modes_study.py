"""`damjoint modes`: natural modes of a case, their files and their picture."""

from __future__ import annotations

import textwrap
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from ..dynamics.modes import NaturalModes, Variant, natural_modes
from ..fem.factor import single_thread
from ..input.case import Case
from ..input.constraints import ZANGAR
from ..pictures.drawing import CONCRETE, GREY, ROCK, figure_of, picture_style, write_picture
from ..pictures.outline import skin
from ..pictures.run_picture import VIEW
from ..post import tables
from ..post.summary import aligned
from ..session import preparation, session

#: Headings of the printed table.
HEADS = [
    *("water", "rock", "mode", "frequency\n[Hz]", "period\n[s]"),
    *("mass along\nx [%]", "along\ny [%]", "damping\n[%]"),
]
#: File of the modes; its picture is CASE_modes.png.
ROWS = "modes.csv"
#: Largest displacement in the picture over the dam's size; ground around the dam.
DRAWN, AROUND = 0.12, 0.25
#: Size of a drawn mode [inches]; modes that are drawn.
PANEL, MOST = 2.6, 5


def compute(case: Case, number: int, progress: bool = True) -> NaturalModes:
    """The lowest modes of a case. Raises InputError, RunError."""
    with single_thread(), preparation(case, progress):
        return natural_modes(case, number)


def run(case: Case, number: int, out: Path, picture: bool = True) -> NaturalModes:
    """Compute the modes of a case and write run.json, modes.csv and a picture into a folder.

    Raises InputError, RunError.
    """
    with session(case, out) as study:
        natural = compute(case, number)
        columns = {name: column.tolist() for name, column in natural.table.items()}
        tables.write_csv(out / ROWS, natural.table)
        if picture:
            write_picture(figure(natural), out / f"{case.name}_modes.png", 130)
        given = {"parameters": case.values, "level": case.levels[-1], "number": number}
        study.save_without_results("complete", "", {"modes": given | columns})
    return natural


def text(natural: NaturalModes) -> str:
    """The modes as a printed table."""
    rows: list[tuple[str, ...]] = [
        (
            *((variant.water, variant.rock) if number == 1 else ("", "")),
            f"{number}",
            f"{mode.frequency:.4g}",
            f"{1 / mode.frequency:.4g}",
            f"{100 * mode.along_x:.1f}",
            f"{100 * mode.along_y:.1f}",
            f"{100 * mode.damping:.2g}",
        )
        for variant in natural.variants
        for number, mode in enumerate(variant.modes, start=1)
    ]
    return aligned(rows, HEADS, left=2)


def about(natural: NaturalModes) -> str:
    """What the modes are of, in words."""
    case = natural.case
    water = f"added mass after {'Zangar' if case['added_mass'] == ZANGAR else 'Westergaard'}"
    water = water if case["added_mass"] else "added_mass = 0: the reservoir has no mass"
    part = "stiffness and mass parts" if case["damping_mass"] else "stiffness part"
    return (
        f"joints closed and undamaged; reservoir {case.levels[-1]:g} m, {water}; damping: "
        f"Rayleigh's of {100 * case['damping']:g} % as in an earthquake, its {part}"
    )


@picture_style()
def figure(natural: NaturalModes) -> Figure:
    """The shapes of the modes with the water on elastic rock, with the frequencies of all."""
    first = natural.variants[0]
    number = min(len(first.modes), MOST)
    words = textwrap.wrap(f"{natural.case.title}: {about(natural)}", 44 * number)
    head = 0.15 + 0.17 * len(words)
    foot = 0.2 + 0.17 * len(natural.variants)
    width, height = PANEL * number + 0.2, head + 0.4 + PANEL + foot
    picture = figure_of(width, height)
    y = 1 - 0.1 / height
    picture.text(0.1 / width, y, "\n".join(words), va="top", fontsize=9, parse_math=False)
    for k in range(number):
        place = (0.1 + k * PANEL) / width, foot / height, 0.96 * PANEL / width, PANEL / height
        axes = picture.add_axes(place)
        draw_shape(axes, natural, first, k)
        mode = first.modes[k]
        title = f"mode {k + 1}: {mode.frequency:.3g} Hz, {1 / mode.frequency:.3g} s\n"
        title += f"{mode.along_x:.0%} of the mass along x, {mode.along_y:.0%} along y"
        axes.set_title(title, fontsize=8)
    lines = []
    for variant in natural.variants:
        values = ", ".join(f"{mode.frequency:.3g}" for mode in variant.modes)
        lines.append(f"water: {variant.water}; rock: {variant.rock}: {values} Hz")
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
        places = (body.points + scale * full) @ view
        near += [body.points @ view] if name != "foundation" else []
        for table, _ in skin(body):
            faces += list(places[table, :2])
            depths.append(places[table, 2].mean(axis=1))
            colors += [ROCK if name == "foundation" else CONCRETE] * len(table)
    order = np.argsort(np.concatenate(depths), kind="stable")
    cells = PolyCollection([faces[i] for i in order], facecolor=[colors[i] for i in order])
    cells.set(edgecolor=GREY, linewidth=0.15, rasterized=True)
    axes.add_collection(cells, autolim=False)
    dam, room = np.concatenate(near)[:, :2], AROUND * natural.case.size
    (x0, y0), (x1, y1) = dam.min(axis=0) - room, dam.max(axis=0) + room
    axes.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal")
    axes.set_axis_off()
