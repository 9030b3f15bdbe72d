"""Views of one run: adding, hiding, removing; their colors and texts."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence

import gmsh
import numpy as np

from .shapes import Pieces

Color = tuple[int, int, int, int]

BLUE: Color = (11, 83, 148, 255)
ORANGE: Color = (214, 120, 0, 255)
RED: Color = (200, 20, 20, 255)
VIOLET: Color = (142, 36, 170, 255)
GREEN: Color = (46, 125, 50, 255)
DARK: Color = (60, 60, 60, 255)
GREY: Color = (150, 150, 150, 255)
LAKE: Color = (61, 155, 224, 255)
#: Opaque: where transparent faces meet there would be seams.
WATER: Color = (158, 206, 240, 255)
SILT: Color = (190, 172, 148, 255)
#: Smallest range of a color scale.
TINY = 1e-9
#: Color scale from small to large values.
STONE = ((226, 222, 212), (168, 187, 205), (88, 137, 186), (11, 60, 120))
#: Color scale from below to above zero.
BALANCED = ((11, 60, 120), (88, 137, 186), (240, 238, 232), (222, 120, 90), (170, 20, 20))


class Gallery:
    """The views of one run; `close` removes them.

    step: that is shown first; by default the last one.
    """

    def __init__(self, step: int | None = None) -> None:
        self.first_step = step
        self.tags: list[int] = []
        #: those that only lend their values to another view
        self.hidden: list[int] = []
        #: color scales that are balanced about zero: largest value of each step, by tag
        self.balanced: dict[int, np.ndarray] = {}

    def add(
        self, name: str, pieces: list[Pieces], colors: Sequence[tuple[int, ...]], **numbers: float
    ) -> int:
        """Add a view of pieces in one color or a color scale; numbers: its options.

        Returns its tag.
        """
        tag = gmsh.view.add(name)
        self.tags.append(tag)
        blocks: dict[str, list[np.ndarray]] = {}
        for piece in pieces:
            blocks.setdefault(piece.kind(), []).append(piece.list_data())
        for kind, parts in blocks.items():  # a second call with a kind would replace the first
            data = np.vstack(parts)
            gmsh.view.addListData(tag, kind, len(data), data.ravel())
        steps = max((piece.values.shape[0] for piece in pieces), default=1)
        self.set_time_step(tag, steps)
        for option, value in {"ShowTime": 0, "NbIso": 4, **numbers}.items():
            gmsh.view.option.setNumber(tag, option, value)
        gmsh.view.option.setString(tag, "Format", "%.3g")
        self.color_texts(tag, colors[0])
        paint(tag, colors)
        return tag

    def set_time_step(self, tag: int, steps: int) -> None:
        """Show the first step of the gallery in a view that has a number of steps."""
        step = steps - 1 if self.first_step is None else min(self.first_step, steps - 1)
        gmsh.view.option.setNumber(tag, "TimeStep", step)

    def color_texts(self, tag: int, color: tuple[int, ...]) -> None:
        """Set the color of the texts of a view."""
        for name in ("Text2D", "Text3D"):
            gmsh.view.option.setColor(tag, name, *color[:3])

    def write(
        self, x: float, y: float, lines: list[str], color: Color, size: int, align: str = "Left"
    ) -> int:
        """Write text at pixels from the top left (negative: from the right or bottom), a line per
        step. Returns the tag of its view, to which `label` adds more.

        Gmsh may draw all but the first text of a view in the color of an earlier view: views with
        several texts are dark, and come before those with a colored one.
        """
        tag = gmsh.view.add("text")
        self.tags.append(tag)
        self.label(tag, x, y, lines, size, align)
        self.color_texts(tag, color)
        self.set_time_step(tag, len(lines))
        return tag

    def label(
        self, tag: int, x: float, y: float, lines: list[str], size: int, align: str = "Left"
    ) -> None:
        """Add text to a view, at pixels as in `write`."""
        gmsh.view.addListDataString(tag, [x, y], lines, style(size, align))

    def label_point(
        self, tag: int, point: np.ndarray, lines: list[str], size: int, align: str = "Left"
    ) -> None:
        """Add text to a view at a point (3,) of the scene [m]."""
        gmsh.view.addListDataString(tag, point.tolist(), lines, style(size, align))

    @property
    def step(self) -> int:
        """The step that Gmsh shows."""
        shown = [tag for tag in self.tags if tag in gmsh.view.getTags()]
        return max((int(gmsh.view.option.getNumber(t, "TimeStep")) for t in shown), default=0)

    def set_step(self, step: int) -> None:
        """Show a step in all views that have it, with its balanced color scales."""
        for tag in set(self.tags) & set(gmsh.view.getTags()):
            last = int(gmsh.view.option.getNumber(tag, "NbTimeStep")) - 1
            gmsh.view.option.setNumber(tag, "TimeStep", min(step, last))
        self.balance(step)

    def balance_about_zero(self, tag: int, largest: np.ndarray, common: bool) -> None:
        """Color scale with zero in the middle; largest: of each step; common: one for all steps."""
        self.balanced[tag] = np.maximum(
            largest.max() if common else largest, TINY * np.ones_like(largest)
        )

    def balance(self, step: int) -> None:
        """Set the balanced color scales of a step."""
        for tag, largest in self.balanced.items():
            gmsh.view.option.setNumber(tag, "CustomMin", -largest[step])
            gmsh.view.option.setNumber(tag, "CustomMax", largest[step])

    def archive(self, prefix: str) -> None:
        """Hide all views and prefix their names, for the user to tick."""
        for tag in set(self.tags) & set(gmsh.view.getTags()):
            name = gmsh.view.option.getString(tag, "Name")
            gmsh.view.option.setString(tag, "Name", f"{prefix} {name}")
            gmsh.view.option.setNumber(tag, "Visible", 0)

    def show(self, shown: bool) -> None:
        """Show or hide all views."""
        for tag in set(self.tags) & set(gmsh.view.getTags()):
            gmsh.view.option.setNumber(tag, "Visible", shown and tag not in self.hidden)

    def close(self) -> None:
        """Remove the views that the user has not removed."""
        for tag in set(self.tags) & set(gmsh.view.getTags()):
            gmsh.view.remove(tag)
        self.tags = []


def style(size: int, align: str) -> list[str]:
    """Style of a text."""
    return ["Align", align, "Font", "Helvetica", "FontSize", str(size)]


def paint(tag: int, colors: Sequence[tuple[int, ...]]) -> None:
    """Set the color table of a view: one color, or interpolated between several."""
    table = np.array([(*color, 255)[:4] for color in colors], float)
    at = np.linspace(0, len(table) - 1, 64)
    shades = np.column_stack([np.interp(at, range(len(table)), c) for c in table.T]).round()
    text = ", ".join("{" + ", ".join(f"{part:.0f}" for part in shade) + "}" for shade in shades)
    with tempfile.NamedTemporaryFile("w", suffix=".geo") as file:
        file.write(f"View[{gmsh.view.getIndex(tag)}].ColorTable = {{ {text} }};\n")
        file.flush()
        gmsh.parser.parse(file.name)
    gmsh.parser.clear()
