"""Graphs beside the scene: round ticks, a grid, a line at zero, curves.

Gmsh draws its ticks at the ends of the range, and has one scale for all steps. Here the values of
each step are converted to intervals of a round scale; grid, line at zero and labels are views and
texts of their own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import gmsh
import numpy as np

from ..units import Units, unit
from .gallery import DARK, GREY, Color, Gallery
from .layout import Layout
from .shapes import Pieces

#: Intervals between the ticks of an axis; margin around them, in intervals.
INTERVALS, MARGIN = 4, 0.2
#: Round intervals over a power of ten.
ROUND = 1, 1.5, 2, 2.5, 3, 4, 5, 7.5, 10, 15, 20
#: Value over the smallest unit below which it is round-off.
TINY = 1e-3
#: A value, in intervals, that is beyond the range and hence not drawn.
BEYOND = 2.0 * INTERVALS
#: Colors of grid and zero line; size of the texts.
GRID: Color = (225, 225, 225, 255)
TEXT = 11
#: Name of the curves of earlier runs.
BEFORE = "before"


@dataclass(frozen=True)
class Scale:
    """A round scale: its lowest tick, the interval between ticks, the unit with its factor."""

    low: float
    interval: float
    unit: str
    factor: float

    @staticmethod
    def of(values: np.ndarray, units: Units) -> Scale:
        """The scale that covers values and zero; zero in the middle if all values are zero."""
        values = np.where(np.abs(values) * units[-1][1] < TINY, 0.0, values)
        name, factor = unit([values], units)
        low, high = min(0.0, values.min() * factor), max(0.0, values.max() * factor)
        if low == high:
            return Scale(-INTERVALS / 2, 1.0, name, factor)
        power = 10.0 ** math.floor(math.log10((high - low) / INTERVALS))
        for interval in (power * number for number in ROUND):
            first = math.floor(low / interval + TINY) * interval if high else -INTERVALS * interval
            last, slack = first + INTERVALS * interval, TINY * interval
            if first <= low + slack and last >= high - slack:
                break
        return Scale(first, interval, name, factor)

    def intervals(self, values: np.ndarray) -> np.ndarray:
        """Values [SI] in intervals above the lowest tick."""
        converted: np.ndarray = (values * self.factor - self.low) / self.interval
        return converted

    def label(self, tick: int) -> str:
        """Label of a tick."""
        return f"{self.low + tick * self.interval + 0.0:.4g}"


@dataclass
class Curve:
    """Curve of a graph: x (n,), y (steps, n); points: whether to mark them."""

    name: str
    x: np.ndarray
    y: np.ndarray
    color: Color
    points: bool = False


#: Title and units of both axes, y first; curves.
Graph = tuple[tuple[str, Units], tuple[str, Units], list[Curve]]


class Graphs:
    """Graphs in the columns of a layout, as many as there is space for.

    common: whether all steps have the same scale.
    """

    def __init__(self, gallery: Gallery, layout: Layout, common: bool) -> None:
        self.gallery, self.layout, self.common, self.count = gallery, layout, common, 0
        #: names of curves with their places and colors: written last, see `Gallery.write`
        self.names: list[tuple[str, float, float, Color]] = []

    def add(
        self,
        y_axis: tuple[str, Units],
        x_axis: tuple[str, Units],
        curves: list[Curve],
        now: np.ndarray | None = None,
        level: np.ndarray | None = None,
    ) -> None:
        """Add a graph, axes by title and units, if there is space for it; now, level: places on the
        x and on the y axis for each step, marked by lines.
        """
        if self.count >= self.layout.most_graphs:
            return
        x, y = self.layout.graph_position(self.count)
        self.count += 1
        across = np.concatenate([curve.x for curve in curves])
        along_x = Scale.of(across, x_axis[1])
        x_range = extent(along_x.intervals(np.append(across, 0.0)))
        count = max(len(curve.y) for curve in curves)
        steps = [self.values_at(curves, step) for step in range(count)]
        scales = [Scale.of(values, y_axis[1]) for values in steps]
        self.frame((x, y), (y_axis[0], x_axis[0]), (along_x, x_range), scales)
        if now is not None:
            self.line("now", (x, y), marks(along_x.intervals(now), x_range), DARK, width=1)
        if level is not None:
            of_steps = [scales[min(step, count - 1)] for step in range(len(level))]
            at_y = np.array([scale.intervals(y) for scale, y in zip(of_steps, level, strict=True)])
            pieces = line_pieces(np.array(x_range), at_y[:, None].repeat(2, axis=1), x_range)
            self.line("level shown", (x, y), pieces, DARK, width=1)
        named = [curve for curve in curves if curve.name not in ("", BEFORE)]
        for curve in sorted(curves, key=lambda curve: curve.name != BEFORE):  # drawn below others
            name = f"{y_axis[0]}, {curve.name}" if curve.name else y_axis[0]
            rows = np.broadcast_to(curve.y, (count, curve.y.shape[1]))
            lines = np.array([s.intervals(row) for s, row in zip(scales, rows, strict=True)])
            at_x = along_x.intervals(curve.x)
            if not curve.points:
                at_x, lines = thinned(at_x, lines)
            pieces = line_pieces(at_x, lines, x_range)
            self.line(name, (x, y), pieces, curve.color, curve.points, width=2)
            if curve in named and len(named) > 1:
                position = x + self.layout.graph_size[0], y - 15 + 13 * named.index(curve)
                self.names.append((curve.name, *position, curve.color))

    def write_names(self) -> None:
        """Write the names of all curves."""
        for name, x, y, color in self.names:
            self.gallery.write(x, y, [name], color, TEXT, "Right")

    def values_at(self, curves: list[Curve], step: int) -> np.ndarray:
        """Values of all curves that set the scale of a step."""
        chosen = [c.y if self.common or len(c.y) == 1 else c.y[step] for c in curves]
        return np.concatenate([values.ravel() for values in chosen])

    def frame(
        self,
        position: tuple[float, float],
        titles: tuple[str, str],
        x_axis: tuple[Scale, tuple[float, float]],
        scales: list[Scale],
    ) -> None:
        """Draw grid, box with a line at zero, and texts of a graph, its top left at a place."""
        (x, y), (width, height) = position, self.layout.graph_size
        across, (left, right) = x_axis
        low, high = extent(np.array([0.0, INTERVALS]))
        columns = np.arange(math.ceil(left), math.floor(right) + 1)
        rows = np.arange(INTERVALS + 1)
        # one line from side to side, along the sides between ticks
        over_rows, over_columns = fro(rows, left, right), fro(columns[::-1], low, high)
        grid = np.concatenate([over_rows, [(right, low)], over_columns[:, ::-1]])
        pieces = line_pieces(grid[:, 0], grid[None, :, 1], (left, right))
        self.line(f"{titles[0]}, grid", position, pieces, GRID)
        box = np.array([(left, low), (right, low), (right, high), (left, high), (left, low)])
        at_x = np.concatenate([box[:, 0], [left, right]])
        zeros = np.array([np.append(box[:, 1], s.intervals(np.zeros(2))) for s in scales])
        pieces = line_pieces(at_x, zeros, (left, right))
        tag = self.line(f"{titles[0]}, zero", position, pieces, GREY)
        self.gallery.color_texts(tag, DARK)

        def text(at_x: float, at_y: float, lines: list[str], align: str) -> None:
            self.gallery.label(tag, at_x, at_y, lines, TEXT, align)

        for row in rows.tolist():
            at_y = y + height * (high - row) / (high - low)
            text(x - 5, at_y + 4, [s.label(row) for s in scales], "Right")
        for column in columns.tolist():
            at_x = x + width * (column - left) / (right - left)
            text(at_x, y + height + 13, [across.label(column)], "Center")
        heads = [f"{titles[0]} [{s.unit}]" for s in scales]
        self.gallery.label(tag, x - BESIDE_TITLE, y - 8, heads, TEXT + 1, "Left")
        text(x + width / 2, y + height + 27, [f"{titles[1]} [{across.unit}]"], "Center")

    def line(
        self,
        name: str,
        position: tuple[float, float],
        pieces: Pieces,
        color: Color,
        points: bool = False,
        width: int = 1,
    ) -> int:
        """Draw pieces in intervals in a graph; returns the tag of its view."""
        low, high = extent(np.array([0.0, INTERVALS]))
        tag = self.gallery.add(
            name,
            [pieces],
            [color],
            Type=4,
            AutoPosition=0,
            PositionX=position[0],
            PositionY=position[1],
            Width=self.layout.graph_size[0],
            Height=self.layout.graph_size[1],
            RangeType=2,
            CustomMin=low,
            CustomMax=high,
            NbIso=0,
            AxesTicsX=0,
            ShowScale=0,
            Axes=0,
            LineWidth=width if color != GREY else 1,
            IntervalsType=3 if points else 2,
        )
        gmsh.view.option.setColor(tag, "Background2D", 255, 255, 255, 0)  # transparent
        return tag


def extent(values: np.ndarray) -> tuple[float, float]:
    """Range of values in intervals, with a margin."""
    return float(values.min()) - MARGIN, float(values.max()) + MARGIN


def fro(ticks: np.ndarray, start: float, end: float) -> np.ndarray:
    """Points (n, 2) of a line to and fro between start and end, once at each tick."""
    turns = np.where(np.arange(len(ticks))[:, None] % 2, [end, start], [start, end])
    return np.column_stack([turns.ravel(), ticks.repeat(2)])


#: Distance of a graph's title from its axes, to the left.
BESIDE_TITLE = 40


def line_pieces(x: np.ndarray, y: np.ndarray, x_range: tuple[float, float]) -> Pieces:
    """Lines through points x (n,), y (steps, n).

    Gmsh takes the range of x from the points: a line with values that are not drawn sets it.
    """
    if len(x) == 1:
        x, y = x.repeat(2), y.repeat(2, axis=1)
    points = np.zeros((len(x), 2, 3))
    points[1:, 0, 0], points[1:, 1, 0], points[0, :, 0] = x[:-1], x[1:], x_range
    values = np.stack([y[:, :-1], y[:, 1:]], axis=2)
    values = np.concatenate([np.full((len(y), 1, 2), BEYOND), values], axis=1)
    return Pieces(points, values[..., None])


def marks(x: np.ndarray, x_range: tuple[float, float]) -> Pieces:
    """Vertical lines over a graph, at each step at the place of its x (steps,)."""
    values = np.full((len(x), len(x), 4), BEYOND)
    values[np.arange(len(x)), np.arange(len(x)), 1:3] = extent(np.array([0.0, INTERVALS]))
    return line_pieces(x.repeat(4), values.reshape(len(x), -1), x_range)


#: In intervals: pitch of points below which one is left out, where the curve bends less than this.
PITCH, BEND = 0.06, 0.02


def thinned(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Thin a dense curve, x (n,) and y (steps, n): lines shorter than some pixels have gaps."""
    before, after = np.diff(x)[:-1], np.diff(x)[1:]
    share = np.divide(before, before + after, out=np.zeros_like(before), where=before + after > 0)
    bends = np.abs(y[:, 1:-1] - y[:, :-2] - share * (y[:, 2:] - y[:, :-2])).max(axis=0) > BEND
    shown = [0]
    for i, bend in enumerate(bends.tolist(), start=1):
        if bend or abs(x[i] - x[shown[-1]]) > PITCH:
            shown.append(i)
    shown.append(len(x) - 1)
    return x[shown], y[:, shown]
