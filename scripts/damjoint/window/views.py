"""
Results as Gmsh views: list data with a step per requested level, so that Gmsh's arrows play the
filling.

Works on the current Gmsh session, with or without a window.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field

import gmsh
import numpy as np

from ..results.pictures import LENGTHS, STRESSES, along, heading, unit
from ..scene.case import Case
from .shapes import Deformed, Pieces
from .worker import Scene

Color = tuple[int, int, int, int]

BLUE: Color = (11, 83, 148, 255)
ORANGE: Color = (214, 120, 0, 255)
RED: Color = (200, 20, 20, 255)
GREEN: Color = (46, 125, 50, 255)
DARK: Color = (60, 60, 60, 255)
WATER: Color = (61, 155, 224, 130)
#: From little to much displacement, and from pressed to free.
STONE = ((226, 222, 212), (168, 187, 205), (88, 137, 186), (11, 60, 120))
FIRE = ((11, 60, 120), (88, 137, 186), (226, 222, 212), (200, 60, 30))

#: Pixels of a graph, and from its left edge and top to those of the next.
GRAPH_SIZE, GRAPH_PITCH = (175, 118), (268, 218)



class Gallery:
    """The views of one run; `close` takes them away."""

    def __init__(self) -> None:
        self.tags: list[int] = []

    def add(
        self, name: str, pieces: list[Pieces], colors: Sequence[tuple], **numbers: float
    ) -> int:
        """
        A view of some pieces, in one color or a scale of colors; numbers: its options.

        Returns its tag.
        """
        tag = gmsh.view.add(name)
        self.tags.append(tag)
        blocks: dict[str, list[np.ndarray]] = {}
        for piece in pieces:
            blocks.setdefault(piece.kind(), []).append(piece.listed())
        for kind, some in blocks.items():  # a second call with the same kind would replace the first
            data = np.vstack(some)
            gmsh.view.addListData(tag, kind, len(data), data.ravel())
        steps = max((piece.values.shape[0] for piece in pieces), default=1)
        for option, value in {"TimeStep": steps - 1, "ShowTime": 0, **numbers}.items():
            gmsh.view.option.setNumber(tag, option, value)
        gmsh.view.option.setColor(tag, "Text2D", *colors[0])
        paint(tag, colors)
        return tag

    def write(self, x: float, y: float, lines: list[str], color: Color, size: int) -> int:
        """Text in pixels from the top left (negative x: from the right), a line per step."""
        tag = gmsh.view.add("text")
        self.tags.append(tag)
        label(tag, x, y, lines, size)
        gmsh.view.option.setColor(tag, "Text2D", *color)
        gmsh.view.option.setNumber(tag, "TimeStep", len(lines) - 1)
        return tag

    def show(self, shown: bool) -> None:
        """Show or hide all of it."""
        for tag in set(self.tags) & set(gmsh.view.getTags()):
            gmsh.view.option.setNumber(tag, "Visible", shown)

    def close(self) -> None:
        """Remove those of the views that are still there."""
        for tag in set(self.tags) & set(gmsh.view.getTags()):
            gmsh.view.remove(tag)
        self.tags = []


def label(tag: int, x: float, y: float, lines: list[str], size: int) -> None:
    """Text of a view, in pixels."""
    style = ["Align", "Left", "Font", "Helvetica", "FontSize", str(size)]
    gmsh.view.addListDataString(tag, [x, y], lines, style)


def paint(tag: int, colors: Sequence[tuple]) -> None:
    """Give a view its scale of colors: one, or some between which the others lie."""
    table = np.array([(*color, 255)[:4] for color in colors], float)
    at = np.linspace(0, len(table) - 1, 64)
    shades = np.column_stack([np.interp(at, range(len(table)), c) for c in table.T]).round()
    text = ", ".join("{%d, %d, %d, %d}" % tuple(shade) for shade in shades)
    with tempfile.NamedTemporaryFile("w", suffix=".geo") as file:
        file.write(f"View[{gmsh.view.getIndex(tag)}].ColorTable = {{ {text} }};\n")
        file.flush()
        gmsh.parser.parse(file.name)
    gmsh.parser.clear()


def outline_water(case: Case) -> Gallery:
    """The water of the highest levels beside the undeformed dam: what is seen before a run."""
    gallery = Gallery()
    depth = case["thickness"] if case["dim"] == 3 else 0.0
    height = case["dam_height"]
    lean = (case["dam_base"] - case["dam_crest"]) / height
    beside = min(case["found_side"], 1.2 * height)
    far = -beside, case["dam_base"] + beside
    faces = []
    for level, x, slope, end in (
        (max(case.levels), 0.0, 0.0, far[0]),
        (max(case.tail_levels), case["dam_base"], lean, far[1]),
    ):
        corners = [(end, 0), (x, 0), (x - slope * level, level), (end, level)]
        faces += [[(*corner, z) for corner in corners] for z in {0.0, depth} if level > 0]
    if faces:
        points = np.array(faces, float)
        pieces = Pieces(points, np.ones((1, *points.shape[:2], 1)))
        gallery.add("water", [pieces], [WATER], ShowScale=0, Light=0)
    return gallery


def show(scene: Scene) -> Gallery:
    """All views of a scene; its last text and curves alone if no requested level was reached."""
    gallery = Gallery()
    if scene.times.size:
        deformed = Deformed(scene)
        show_deformed(gallery, deformed)
        if scene.result.case["dim"] == 3:
            show_maps(gallery, deformed)
        show_curves(gallery, scene)
        gallery.write(20, 52, captions(deformed), DARK, 15)
    if len(scene.result.history["time"]) > 1:
        show_history(gallery, scene)
    gallery.write(20, 28, [heading_of(scene)], DARK, 18)
    return gallery


def heading_of(scene: Scene) -> str:
    """The first line: what was run."""
    return heading(scene.result).split(", level")[0]


def captions(deformed: Deformed) -> list[str]:
    """A line per step: level, opening, crack."""
    result, lines = deformed.scene.result, []
    for time in deformed.times:
        row = int(np.argmin(np.abs(result.history["time"] - time)))
        now = {name: float(column[row]) for name, column in result.history.items()}
        tail = f", tailwater {now['tail_level']:.4g} m" if now["tail_level"] > 0 else ""
        lines.append(
            f"level {now['level']:.4g} m{tail}: largest opening {in_unit(now['max_opening'])}, "
            f"crack {now['crack_length']:.3g} m; displacement x {deformed.scale:g}"
        )
    return lines


def in_unit(length: float) -> str:
    """A length in a unit that suits it."""
    name, factor = unit([np.array([length])], LENGTHS)
    return f"{length * factor:.3g} {plain(name)}"


def plain(name: str) -> str:
    """A unit in letters that every font of the window has."""
    return name.replace("µm", "1e-6 m").replace("nm", "1e-9 m")


def show_deformed(gallery: Gallery, deformed: Deformed) -> None:
    """Dam and foundation, their outline, water, crack and slip, all displaced by one factor."""
    height = deformed.scene.result.case["dam_height"]
    moves = {"VectorType": 5, "DisplacementFactor": deformed.scale}
    scale = {"AutoPosition": 0, "PositionX": 40, "PositionY": -60, "Width": 300, "Height": 14}
    gallery.add("displacement [m]", deformed.bodies(), STONE, **moves, **scale, Light=0)
    gallery.add(
        "vertical stress [Pa]", deformed.stress(), FIRE, **scale, Light=0, Visible=0,
    )
    flat = {**moves, "ShowScale": 0, "Light": 0}
    gallery.add("water", [deformed.water()], [WATER], **flat)
    gallery.add("outline", [deformed.outline()], [DARK], **flat, LineWidth=1.5)
    marks = deformed.marks()
    above = {**flat, "LineWidth": 5, "OffsetZ": 1e-3 * height}
    slipped = gallery.add("slipped joint", [marks["slipped"]], [ORANGE], **above)
    broken = gallery.add("open or broken joint", [marks["open"]], [RED], **above)
    label(broken, 20, 76, ["red: joint open or broken"], 13)
    label(slipped, 210, 76, ["orange: joint slipped"], 13)


def show_maps(gallery: Gallery, deformed: Deformed) -> None:
    """In 3D, the joint laid out below the foundation: opening, pressure, state."""
    scene = deformed.scene
    case, joint = scene.result.case, scene.bodies["joint"]
    rows = [scene.result.at(time) for time in deformed.times]
    far = (joint.points[:, None, 0] - rows[0]["x"]) ** 2
    nearest = np.argmin(far + (joint.points[:, None, 2] - rows[0]["z"]) ** 2, axis=1)
    length, per_m = unit([r["delta_n"] for r in rows], LENGTHS)
    stress, per_pa = unit([r["p"] for r in rows], STRESSES)
    state = [np.where(r["damage"] >= 1, 2.0, np.where(r["slip"] > 0, 1.0, 0.0)) for r in rows]
    shown = (
        (f"opening of the joint [{plain(length)}]", [r["delta_n"] * per_m for r in rows], STONE),
        (f"pressure in the joint [{stress}]", [r["p"] * per_pa for r in rows], STONE),
        ("state: closed, slipped, open", state, (STONE[0], ORANGE, RED)),
    )
    for i, (name, values, colors) in enumerate(shown):
        below = np.array([0, -case["found_depth"] - (i + 1) * 0.12 * case["dam_height"], 0])
        pieces = [
            Pieces(joint.points[table] + below, np.array(values)[:, nearest][:, table, None])
            for _, table in joint.cells
        ]
        place = {"AutoPosition": 0, "PositionX": 40, "PositionY": -110 - 50 * i}
        gallery.add(name, pieces, colors, **place, Width=300, Height=14, Light=0)


@dataclass
class Curve:
    """A line of a graph: x (n,) or (steps, n), y (steps, n)."""

    name: str
    x: np.ndarray
    y: np.ndarray
    color: Color


def show_curves(gallery: Gallery, scene: Scene) -> None:
    """Along the joint (means over z in 3D): opening, slip, stresses, pressure."""
    rows = [along(scene.result.at(time)) for time in scene.times]
    x, where = rows[0]["x"], "x [m], heel to toe"

    def curve(name: str, column: str, color: Color) -> Curve:
        return Curve(name, x, np.array([r[column] for r in rows]), color)

    graph(gallery, 0, "opening", LENGTHS, where, [curve("", "delta_n", BLUE)])
    slips = [curve("moved", "delta_t1", ORANGE), curve("slip", "slip", DARK)]
    graph(gallery, 1, "slip", LENGTHS, where, slips)
    normal = [curve("total", "sigma_n", BLUE)]
    if scene.result.case["uplift"] != "none":
        normal.append(curve("effective", "sigma_n_eff", GREEN))
    graph(gallery, 2, "normal stress", STRESSES, where, normal)
    graph(gallery, 3, "shear stress", STRESSES, where, [curve("", "tau_1", ORANGE)])
    graph(gallery, 4, "water pressure", STRESSES, where, [curve("", "p", WATER[:3] + (255,))])


def show_history(gallery: Gallery, scene: Scene) -> None:
    """Level over opening, crest movement and crack length, all converged steps."""
    history, case = scene.result.history, scene.result.case
    driven = case["drive"] != "level"
    opening = scene.result.heel if driven else history["max_opening"]
    name = "heel opening" if driven else "largest opening"
    for place, title, values in ((5, name, opening), (6, "crest movement", history["crest_ux"])):
        length, factor = unit([values], LENGTHS)
        curve = Curve("", values * factor, history["level"][None], BLUE)
        x_label = f"{title} [{plain(length)}]"
        graph(gallery, place, "level", (("m", 1),), x_label, [curve], points=True)
    crack = Curve("", history["crack_length"], history["level"][None], RED)
    graph(gallery, 7, "level", (("m", 1),), "crack length [m]", [crack], points=True)


def graph(
    gallery: Gallery,
    place: int,
    title: str,
    units: tuple,
    x_label: str,
    curves: list[Curve],
    points: bool = False,
) -> None:
    """
    Curves in one graph, at one of the places on the right (two columns, from the top left).

    units: of which the values get the one that suits them; points: marked on the curve.
    """
    name, factor = unit([curve.y for curve in curves], units)
    low = min(0.0, *(float(curve.y.min()) * factor for curve in curves))
    high = max(0.0, *(float(curve.y.max()) * factor for curve in curves))
    if high - low < 1e-12 * max(abs(high), abs(low), 1e-300) or high == low:
        high = low + 1.0
    column, row = place % 2, place // 2
    x = -GRAPH_PITCH[0] * (2 - column) + 70
    y = 40 + GRAPH_PITCH[1] * row
    for i, curve in enumerate(curves):
        steps, count = curve.y.shape
        spots = np.zeros((count, 3))
        spots[:, 0] = curve.x
        lines = np.stack([spots[:-1], spots[1:]], axis=1)
        values = np.stack([curve.y[:, :-1], curve.y[:, 1:]], axis=2)[..., None] * factor
        tag = gallery.add(
            f"{title} [{plain(name)}]" if not i else f"{title}, {curve.name} [{plain(name)}]",
            [Pieces(lines, values.reshape(steps, count - 1, 2, 1))],
            [curve.color],
            Type=4,
            AutoPosition=0,
            PositionX=x,
            PositionY=y,
            Width=GRAPH_SIZE[0],
            Height=GRAPH_SIZE[1],
            RangeType=2,
            CustomMin=low,
            CustomMax=high,
            NbIso=4,
            Axes=0 if i else 3,
            LineWidth=2,
            IntervalsType=3 if points else 2,
            PointSize=4,
            AxesTicsX=3,
        )
        gmsh.view.option.setString(tag, "Format", "%.3g")
        gmsh.view.option.setString(tag, "AxesFormatX", "%.3g")
        gmsh.view.option.setString(tag, "AxesLabelX", x_label)
        if curve.name:
            label(tag, x + GRAPH_SIZE[0] - 60, y - 8 - 14 * (len(curves) - 1 - i), [curve.name], 12)
