"""Layout of the drawing area: the scene on the left, graphs on the right; in pixels."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from textwrap import shorten, wrap

import gmsh

#: Left edge of texts and scene; margin around the scene.
LEFT, MARGIN = 20, 20
#: Baselines of title, law and uplift, and the three lines on the state; space above the scene.
TITLE, LAW, STATE, ABOVE = 26, 46, (68, 86, 104), 122
#: Space below the scene for color scales, legend and warnings; height of a line of them; most lines
#: of warnings.
BELOW, LINE, WARNINGS = 172, 15, 4
#: Places of the color scales from the left and the bottom; of the legend: width of an entry, most
#: entries, its bottom.
ENTRY, ENTRIES, LEGEND = 165, 6, -140
BARS = tuple((30 + ENTRY * i, -76) for i in range(3))

#: Width of an average character over the size of its font.
CHARACTER = 0.55


#: Place of an error: of its first line; height of a line, size of its font.
MESSAGE, MESSAGE_PITCH, MESSAGE_SIZE = (LEFT, 128), 17, 14
#: Least size of the drawing area for two columns of graphs and for one; width of a column; least
#: and largest height of a graph with its texts; most rows.
TWO_COLUMNS, ONE_COLUMN, COLUMN = 1000, 620, 268
GRAPH_HEIGHT, ROWS = (140, 218), 4
#: Texts of a graph: left and right of its axes, above and below them.
BESIDE_AXES, BEYOND_AXES, ABOVE_AXES, BELOW_AXES = 66, 24, 31, 38

#: Options with the sizes of Gmsh's window; GraphicsWidth includes the menu.
WINDOW = "GraphicsWidth", "GraphicsHeight", "MenuWidth"
#: Usual size of the window: drawing area with menu. Size that no screen has; space for the title
#: bar that a window manager puts above the window, and for its border below.
USUAL, UNLIMITED, TITLE_BAR, BORDER = (1600, 900), 10000, 36, 6
#: Share of the window's width that the menu takes, and its largest width.
MENU, MENU_WIDTH = 0.38, 560


@dataclass(frozen=True)
class Layout:
    """Layout for a drawing area of a size; by default that of a usual window."""

    width: float = USUAL[0] - MENU_WIDTH
    height: float = USUAL[1]

    @staticmethod
    def of_window(scratch: Path) -> Layout:
        """Layout for the current drawing area of Gmsh's window.

        scratch: file to which Gmsh writes its options, as it updates the sizes only then.
        """
        gmsh.write(str(scratch))
        size = {n: gmsh.option.getNumber(f"General.{n}") for n in WINDOW}
        return Layout(size["GraphicsWidth"] - size["MenuWidth"], size["GraphicsHeight"])

    @property
    def columns(self) -> int:
        """Columns of graphs."""
        return 2 if self.width >= TWO_COLUMNS else int(self.width >= ONE_COLUMN)

    @property
    def pitch(self) -> float:
        """Height of a graph with its texts."""
        return min(GRAPH_HEIGHT[1], max(GRAPH_HEIGHT[0], self.height / ROWS))

    @property
    def most_graphs(self) -> int:
        """Number of graphs for which there is space."""
        return self.columns * max(1, int(self.height // self.pitch))

    @property
    def scene_width(self) -> float:
        """Width of the scene."""
        return self.width - self.columns * COLUMN

    @property
    def graph_size(self) -> tuple[float, float]:
        """Width and height of a graph's axes."""
        return COLUMN - BESIDE_AXES - BEYOND_AXES, self.pitch - ABOVE_AXES - BELOW_AXES

    def graph_position(self, number: int) -> tuple[float, float]:
        """Top left corner of a graph's axes: x from the right edge (< 0), y from the top."""
        row, column = divmod(number, max(self.columns, 1))
        x = -COLUMN * (self.columns - column) + BESIDE_AXES
        return x, row * self.pitch + ABOVE_AXES

    @property
    def legend(self) -> list[tuple[float, float]]:
        """Places of the legend's entries: x from the left, y from the bottom (< 0)."""
        columns = max(1, int((self.scene_width - LEFT) // ENTRY))
        top = LEGEND - LINE * ((ENTRIES - 1) // columns)
        return [(LEFT + ENTRY * (i % columns), top + LINE * (i // columns)) for i in range(ENTRIES)]

    def wrapped(self, text: str, size: int) -> list[str]:
        """Wrap a text in a font size to the width of the scene."""
        return wrap(text, self.characters(size))

    def shortened(self, text: str, size: int) -> str:
        """Shorten a text in a font size to the width of the scene."""
        return shorten(text, self.characters(size), placeholder=" ...")

    def characters(self, size: int) -> int:
        """Number of characters in a font size over the width of the scene."""
        return max(20, int((self.scene_width - LEFT) / (CHARACTER * size)))


def open_window() -> None:
    """Open Gmsh's window as large as the screen, its title bar on the screen."""
    for name in WINDOW[:2]:
        gmsh.option.setNumber(f"General.{name}", UNLIMITED)
    gmsh.fltk.initialize()  # limits the sizes to the screen, and puts such a window at its top
    width, height = (gmsh.option.getNumber(f"General.{name}") for name in WINDOW[:2])
    gmsh.fltk.finalize()
    positions = {
        "GraphicsPositionX": 0,
        "GraphicsPositionY": TITLE_BAR,
        "GraphicsWidth": width,
        "GraphicsHeight": height - TITLE_BAR - BORDER,
    }
    for name, value in positions.items():
        gmsh.option.setNumber(f"General.{name}", value)
    gmsh.fltk.initialize()
    gmsh.option.setNumber("General.MenuWidth", min(MENU_WIDTH, int(MENU * width)))
