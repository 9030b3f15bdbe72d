"""Results as Gmsh views: list data with a step per requested level, so that Gmsh's arrows step
through the levels.

Works on the current Gmsh session, with or without a window.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from textwrap import wrap

import gmsh
import numpy as np

from ..input.case import Case
from ..model.fields import (
    BROKEN,
    CLOSED,
    SLIPPED,
    SOFTENING,
    distance,
    joint_body,
    joint_states,
    nearest_rows,
)
from ..studies.quake import RUNNING
from ..units import LENGTHS, STRESSES, unit, unit_of_time, with_unit
from . import layout as screen
from .camera import CLIPPED, undeformed_camera
from .curves import show_graphs
from .gallery import (
    BALANCED,
    DARK,
    GREEN,
    GREY,
    LAKE,
    ORANGE,
    RED,
    SILT,
    STONE,
    VIOLET,
    WATER,
    Color,
    Gallery,
)
from .graphs import Graphs
from .layout import LEFT, Layout
from .numbers import three_digits
from .scene import SolvedScene
from .shapes import Deformed, Label, Pieces, undeformed_loads

#: Offset of a layer along z over the dam's size: lines and faces in one plane hide one another.
LAYER = 5e-4
#: Fields that color the bodies: displacement is the default.
FIELDS = DISPLACEMENT, STRESS = "displacement", "vertical stress"
#: Scales of curves and colors.
SCALES = OF_LEVEL, OF_ALL = "of the level shown", "of all levels"
#: What the drawing area shows.
CONTENTS = SCENE, TABLE = "scene and curves", "table of all levels"


@dataclass(frozen=True)
class Display:
    """The user's choices of what is shown."""

    field: str = DISPLACEMENT
    scales: str = OF_LEVEL
    content: str = SCENE

    @property
    def common(self) -> bool:
        """Whether all levels have the same scale."""
        return self.scales == OF_ALL


#: Entry of the legend: color and text.
Entry = tuple[Color, str]
#: States of the joint that are marked, with their legend.
STATES: dict[int, Entry] = {
    BROKEN: (RED, "joint broken"),
    SOFTENING: (VIOLET, "joint softening"),
    SLIPPED: (ORANGE, "joint slipped"),
}
#: Color and layer of the loads. Water is behind the bodies: it reaches under an overhang.
LOAD_STYLES = {
    "water": (WATER, -2),
    "silt": (SILT, -1),
    "water in the crack": (LAKE, 3),
    "forces": (DARK, 4),
}
#: Text sizes: title, law and uplift, state, legend and warnings.
SIZES = 17, 13, 14, 12


def show_undeformed_loads(case: Case) -> Gallery:
    """Show the loads of the last level on the undeformed dam, before a run."""
    gallery = Gallery()
    loads, labels = undeformed_loads(case, undeformed_camera(case).box)
    show_loads(gallery, case, loads, labels, {"ShowScale": 0, "Light": 0})
    return gallery


def show_loads(
    gallery: Gallery,
    case: Case,
    loads: dict[str, Pieces],
    labels: list[Label],
    options: dict[str, float],
) -> None:
    """Show water, silt and forces, each in its layer, with their levels and magnitudes."""
    for name, pieces in loads.items():
        color, number = LOAD_STYLES[name]
        gallery.add(name, [pieces], [color], **options, **layer(case, number), LineWidth=3)
    if labels:
        tag = gallery.write(0, 0, [" "] * len(labels[0].lines), DARK, SIZES[3])
        gmsh.view.option.setString(tag, "Name", "labels of the loads")
        for label in labels:
            gallery.label_point(tag, label.point, label.lines, SIZES[3], label.align)


def layer(case: Case, number: int) -> dict[str, float]:
    """Options of a layer."""
    return {"OffsetZ": number * LAYER * case.size}


def show_heading(gallery: Gallery, heading: tuple[str, str], layout: Layout) -> None:
    """Show two lines: title of the case; joint law and uplift."""
    title, scene = heading
    shortened = layout.shortened(title, SIZES[0])
    gallery.write(LEFT, screen.TITLE, [shortened], DARK, SIZES[0])
    gallery.write(LEFT, screen.LAW, [scene], DARK, SIZES[1])


def show(
    scene: SolvedScene,
    title: str,
    layout: Layout,
    display: Display,
    before: Sequence[SolvedScene] = (),
    step: int | None = None,
) -> Gallery:
    """Show all views of a scene; heading and history alone if no requested level was reached.

    title: of the case; before: earlier runs, whose last curves are drawn in grey for comparison;
    step: that is shown first, by default the last.
    """
    gallery, case, legend = Gallery(step), scene.result.case, list[Entry]()
    if scene.quake is not None:  # scales that change with each frame would hide the motion
        display = replace(display, scales=OF_ALL)
    if display.content == TABLE:
        show_table(gallery, scene, layout)
    else:
        if scene.times.size:
            deformed = Deformed(scene)
            legend = show_deformed(gallery, deformed, display)
            if case["dim"] == 3:
                show_strips(gallery, deformed, display)
            captions = [caption(scene, step) for step in range(len(scene.times))]
            for y, lines in zip(screen.STATE, zip(*captions, strict=True), strict=True):
                gallery.write(LEFT, y, list(lines), DARK, SIZES[2])
        show_graphs(Graphs(gallery, layout, display.common), scene, before)
        legend += [(GREY, "earlier runs")] if before else []
        for position, (color, words) in zip(layout.legend, legend, strict=False):
            gallery.write(*position, [words], color, SIZES[3])
        show_warnings(gallery, scene.warnings, layout)
    record = f", {case.record.name}" if scene.quake is not None and case.record else ""
    law, uplift = (case.of_all_joints(name) for name in ("law", "uplift"))
    words = f"law {law}, uplift {uplift}{record}"
    show_heading(gallery, (title, words), layout)
    gallery.balance(gallery.step)
    return gallery


def caption(scene: SolvedScene, step: int) -> tuple[str, str, str]:
    """Three lines: level, opening and crack, factors; of an earthquake: time, crest, slip."""
    now, time = scene.numbers[step].elements, scene.times[step]
    name = scene.result.case.named((scene.joint,))
    if scene.quake is not None:
        rows = scene.numbers[step].rows()
        words = {label: f"{label} {value}" for label, value, _ in rows}
        on_joint = ", ".join(words[n] for n in ("heel opening", "toe opening", "slip"))
        end = f"of {scene.quake['time'][-1]:.4g} s"
        end = f"({RUNNING})" if scene.verdict == RUNNING else end  # how far, the status line says
        return (
            f"t = {time:.3f} s {end}, {words['ground acceleration']}",
            f"{words['crest movement']}, {words['crest acceleration']}",
            f"{name}: {on_joint}" if name else on_joint,
        )
    tail = f", tailwater {now['tail_level']:.4g} m" if now["tail_level"] > 0 else ""
    opening = now["max_opening"]
    state = f"opening {with_unit(opening, LENGTHS, 3)}" if opening > 0 else "closed"
    state += f", crack {now['crack_length']:.3g} m"
    if now["broken_length"] > now["crack_length"]:
        state += f", broken {now['broken_length']:.3g} m"
    if now["process_zone"] > 0:
        state += f", softening {now['process_zone']:.3g} m"
    resultant = f"N' at {three_digits(now['x_resultant'])} m"
    known = "SSF" if scene.result.case.law.has_friction else "", "OSF"
    factors = [f"{n} {three_digits(now[n])}" for n in known if n in now]
    where = scene.numbers[step].positions[0]
    last = scene.result.case.times[-1]
    return (
        f"level {now['level']:.4g} m{tail} (t = {time:.4g} of {last:g}{passed(scene, time)})",
        f"{name}: {state}" if name else state,
        ", ".join([*factors, f"{resultant}: {where}"]),
    )


def passed(scene: SolvedScene, time: float) -> str:
    """Of a time t, the time that has passed in water that is stored in a joint, in words."""
    case = scene.result.case
    if not case.stores_water:
        return ""
    start, last = case["time_start"], case.times[-1]
    name, factor = unit_of_time((last - start) * case["time_unit"])
    now, end = (max(t - start, 0) * case["time_unit"] * factor for t in (time, last))
    return f", {now:.4g} of {end:.4g} {name}"


def show_deformed(gallery: Gallery, deformed: Deformed, display: Display) -> list[Entry]:
    """Show bodies, outline, loads, crack and slip, displaced by one factor; returns a legend."""
    case = deformed.scene.case
    deformed.camera.clip(case.size)
    moves = {"VectorType": 5, "Clip": CLIPPED, "DisplacementFactor": deformed.scale}
    scale = {**color_bar(0), "Light": 0, "RangeType": 1 if display.common else 3}
    bodies, options = deformed.bodies(), {}
    if display.field == STRESS:
        name, factor = unit(deformed.vertical_stress(), STRESSES)
        stress = [pieces.times(factor) for pieces in deformed.stress()]
        scale["RangeType"] = 2
        tag = gallery.add(f"{STRESS} [{name}]", stress, BALANCED, **scale, Visible=0)
        gallery.hidden.append(tag)
        largest = np.max([np.abs(p.values).max(axis=(1, 2, 3)) for p in stress], axis=0)
        options = {"ExternalView": gmsh.view.getIndex(tag)}
    name, factor = unit(list(deformed.moved.values()), LENGTHS)
    shown = [pieces.times(factor) for pieces in bodies]
    factors = {**moves, "DisplacementFactor": deformed.scale / factor}
    colors = BALANCED if display.field == STRESS else STONE
    tag = gallery.add(f"{DISPLACEMENT} [{name}]", shown, colors, **factors, **scale, **options)
    if display.field == STRESS:
        gallery.balance_about_zero(tag, largest, display.common)
    flat = {**moves, "ShowScale": 0, "Light": 0}
    show_loads(gallery, case, deformed.loads(), deformed.labels(), flat)
    gallery.add("outline", [deformed.outline()], [DARK], **flat, **layer(case, 1), LineWidth=1.5)
    legend = [(DARK, f"displacement x {deformed.scale:g}")]
    occurring = deformed.occurring()
    for state, pieces in deformed.marks().items():
        if state in occurring:
            color, text = STATES[state]
            gallery.add(text, [pieces], [color], **flat, **layer(case, 2), LineWidth=2)
            legend.append((color, text))
    if deformed.scene.undeformed:
        above = {**flat, **layer(case, 5), "LineWidth": 2.5}
        gallery.add("resultant", [deformed.resultant()], [GREEN], **above)
        legend.append((GREEN, "resultant, middle third"))
    return legend


def color_bar(number: int) -> dict[str, float]:
    """Options of a color scale at one of the places at the bottom left."""
    x, y = screen.BARS[number]
    return {"AutoPosition": 0, "PositionX": x, "PositionY": y, "Width": 130, "Height": 10}


def show_strips(gallery: Gallery, deformed: Deformed, display: Display) -> None:
    """Show the joint of a 3D scene as strips below it: opening, state, pressure.

    From heel to toe to the right; of a user's own geometry upwards, as seen from upstream.
    """
    scene = deformed.solved
    case, rows = scene.joint_result.case, deformed.scene.joints[scene.joint].rows
    joint = joint_body(scene.bodies, scene.joint)
    nearest = nearest_rows(joint.points, rows[0])
    s, z = distance(rows[0])[nearest], joint.points[:, 2]
    axes = (z, s) if case.geometry else (s, -z)
    shares = np.column_stack([(v - v.min()) / (np.ptp(v) or 1.0) for v in axes])

    def add(
        number: int,
        name: str,
        pieces: list[np.ndarray],
        colors: Sequence[tuple[int, ...]],
        options: dict[str, float],
    ) -> int:
        low, high = deformed.camera.strip(number)
        points = deformed.camera.points_at(low + shares * (high - low))
        faces = [
            Pieces(points[table], values)
            for (_, table), values in zip(joint.cells, pieces, strict=True)
        ]
        tag = gallery.add(name, faces, colors, **options, Light=0)
        head = low + [0, 1.12] * (high - low)
        gallery.label_point(tag, deformed.camera.points_at(head[None])[0], [name], SIZES[3])
        gmsh.view.option.setColor(tag, "Text3D", *DARK[:3])
        return tag

    def at_nodes(column: str, factor: float) -> list[np.ndarray]:
        values = np.array([r[column] for r in rows])[:, nearest] * factor
        return [values[:, table, None] for _, table in joint.cells]

    name, factor = unit([r["delta_n"] for r in rows], LENGTHS)
    opening = at_nodes("delta_n", factor)
    tag = add(0, f"opening [{name}]", opening, BALANCED, {**color_bar(1), "RangeType": 2})
    largest = np.max([np.abs(values).max(axis=(1, 2, 3)) for values in opening], axis=0)
    gallery.balance_about_zero(tag, largest, display.common)
    states = np.array([joint_states(r, case.law) for r in rows], float)[:, nearest]
    # one state an element: between nodes of different states others would appear
    of_elements = [
        np.repeat(states[:, table].min(axis=2, keepdims=True), table.shape[1], axis=2)[..., None]
        for _, table in joint.cells
    ]
    discrete = {"RangeType": 2, "CustomMin": CLOSED, "CustomMax": BROKEN, "IntervalsType": 3}
    colors = (STONE[0], ORANGE, VIOLET, RED)
    add(1, "state: as in the legend", of_elements, colors, {**discrete, "ShowScale": 0})
    if case["uplift"] != "none":
        name, factor = unit([r["p"] for r in rows], STRESSES)
        by_level = {"RangeType": 1 if display.common else 3}
        pressure = at_nodes("p", factor)
        add(2, f"water pressure [{name}]", pressure, STONE, {**color_bar(2), **by_level})


def show_warnings(gallery: Gallery, warnings: list[str], layout: Layout) -> None:
    """Show warnings at the bottom of the scene, as many lines as there is space for."""
    lines = [line for warning in warnings for line in layout.wrapped(f"! {warning}", SIZES[3])]
    if len(lines) > screen.WARNINGS:
        lines = [*lines[: screen.WARNINGS - 1], "... all notes are in Results"]
    for number, line in enumerate(lines):
        y = -screen.LINE * (len(lines) - number) + 8
        gallery.write(LEFT, y, [line], ORANGE, SIZES[3])


#: Table: top; height of a row; characters in a heading; smallest and largest size of its font.
TABLE_TOP, ROW, HEADING, FONT = 80, 17, 9, (8, 13)


def show_table(gallery: Gallery, scene: SolvedScene, layout: Layout) -> None:
    """Show the table of all levels, the level shown marked; some levels if there are too many."""
    table = scene.table
    names = [
        [*wrap(name, HEADING, break_long_words=False), f"[{size}]" if size else ""]
        for name, size in zip(table.names, table.units, strict=True)
    ]
    top = TABLE_TOP + screen.LINE * max(map(len, names)) + ROW / 2
    count = min(int((layout.height - top) // ROW), len(table.rows))
    rows = np.unique(np.linspace(0, len(table.rows) - 1, count).round().astype(int)).tolist()
    columns = zip(names, zip(*table.rows, strict=True), strict=True)
    widths = [max(map(len, [*words, *cells])) + 3 for words, cells in columns]
    room = (layout.width - 2 * LEFT) / screen.CHARACTER / sum(widths)
    size = int(np.clip(room, *FONT))
    rights = LEFT + np.cumsum(widths) * size * screen.CHARACTER
    tag = gallery.write(LEFT, 0, [" "], DARK, size)
    for right, words, cells in zip(rights, names, zip(*table.rows, strict=True), strict=True):
        for line, word in enumerate(words):
            gallery.label(tag, right, TABLE_TOP + screen.LINE * line, [word], size, "Right")
        for line, row in enumerate(rows):
            gallery.label(tag, right, top + ROW * line, [cells[row]], size, "Right")
    for line, row in enumerate(rows if scene.times.size else []):
        marks = [">" if row == step else " " for step in range(len(scene.times))]
        gallery.write(LEFT / 2, top + ROW * line, marks, RED, size)
