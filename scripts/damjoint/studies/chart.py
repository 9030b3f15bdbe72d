"""Chart of a sweep: curves over one varied parameter, maps over two, statistics of a sample."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..model import parameters
from ..post.drawing import BLUE, ORANGE, RED, write_picture
from ..post.units import LENGTHS, Units, unit
from .plan import Plan, Row, column_of, numbers

#: Quantities drawn: label and units.
DRAWN: dict[str, tuple[str, Units]] = {
    "crack_length": ("open or broken joint", LENGTHS[:1]),
    "max_opening": ("largest opening", LENGTHS),
    "crest_ux": ("crest, downstream", LENGTHS),
}


def draw(plan: Plan, rows: list[Row], title: str, path: Path) -> str:
    """Draw the rows of a sweep to path.

    Returns a message if there is no chart for what was varied, else an empty text.
    """
    axes = [name for name, values in plan.varied.items() if all(map(is_number, values))]
    others = [name for name in plan.varied if name not in axes]
    if plan.sampled:
        fits = not others and len(axes) <= 1
        drawing = draw_probability if axes else draw_sample
    else:
        fits = len(axes) == 1 or (len(axes) == 2 and not others)
        drawing = draw_curves if len(axes) == 1 else draw_maps
    if not fits:
        return (
            f"no chart of {len(plan.varied)} varied parameters ({', '.join(plan.varied)}): needs "
            "one or two with numbers as values, beside a sample at most one"
        )
    figure = Figure(figsize=(10, 4.8), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(textwrap.fill(title, 100), fontsize=11, parse_math=False)
    drawing(figure, plan, rows, axes)
    write_picture(figure, path, 110)
    return ""


def is_number(text: str) -> bool:
    """Whether a varied value is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


#: Names and units of what is varied besides parameters.
QUANTITIES = {
    "level": ("water level", "m"),
    "strength": ("strength reduction", "-"),
    "uplift": ("drain_effectiveness", "-"),
}


def quantity(name: str) -> tuple[str, str]:
    """Name and unit of a varied or critical quantity."""
    return QUANTITIES.get(name) or (name, parameters.parameter(name).unit)


def label(name: str) -> str:
    """The label of an axis: name and unit."""
    words, size = quantity(name)
    return f"{words} [{size}]" if size else words


def fails(rows: list[Row]) -> np.ndarray:
    """Whether each row fails."""
    return np.array([row["failed"] == "1" for row in rows])


def is_marked(plan: Plan, rows: list[Row]) -> np.ndarray:
    """Whether each row gets a cross: the dam fails, or its critical value is not confirmed."""
    if plan.critical:
        return np.array([row["confirmed"] != "1" for row in rows])
    return fails(rows)


def panels_of(figure: Figure, plan: Plan) -> Iterator[tuple[Axes, tuple[str, tuple[str, Units]]]]:
    """Create axes side by side for the quantities drawn: DRAWN, or the critical value alone."""
    drawn = DRAWN
    if plan.critical:
        words, size = quantity(plan.critical)
        drawn = {plan.critical_columns[0]: (f"critical {words}", ((size, 1),))}
    return zip(figure.subplots(1, len(drawn), squeeze=False)[0], drawn.items(), strict=True)


def draw_curves(figure: Figure, plan: Plan, rows: list[Row], names: list[str]) -> None:
    """Draw each quantity over the varied parameter, a curve per combination of the other values."""
    (name,) = names
    others = [other for other in plan.varied if other != name]
    curves: dict[str, list[Row]] = {}
    for row in sorted(rows, key=lambda row: float(row[column_of(name)])):
        curves.setdefault(", ".join(row[column_of(o)] for o in others), []).append(row)
    for panel, (column, (words, units)) in panels_of(figure, plan):
        size, factor = unit([np.nan_to_num(numbers(rows, column))], units)
        for number, (others_text, curve) in enumerate(curves.items()):
            x, y = numbers(curve, column_of(name)), numbers(curve, column) * factor
            bad, color = is_marked(plan, curve), f"C{number}" if others else BLUE
            values = np.where(bad, np.nan, y)
            panel.plot(x, values, "o-", markersize=4, color=color, label=others_text)
            panel.plot(x[bad], y[bad], "x", color=color if others else RED)
        mark = "black" if others else RED
        meaning = "not confirmed" if plan.critical else "fails: last state before"
        panel.plot([], [], "x", color=mark, label=meaning)
        panel.set(xlabel=label(name), ylabel=f"{words} [{size}]")
        panel.grid(alpha=0.3)
    if is_marked(plan, rows).any() or others:
        panel.legend(fontsize=8)


def draw_maps(figure: Figure, plan: Plan, rows: list[Row], names: list[str]) -> None:
    """Draw each quantity over two varied parameters, with crosses where the dam fails."""
    x, y = (numbers(rows, column_of(name)) for name in names)
    (across, i), (up, j) = (np.unique(v, return_inverse=True) for v in (x, y))
    bad = is_marked(plan, rows)
    for panel, (column, (words, units)) in panels_of(figure, plan):
        values = np.where(bad, np.nan, numbers(rows, column))
        size, factor = unit([np.nan_to_num(values)], units)
        grid = np.full((len(up), len(across)), np.nan)
        grid[j, i] = values * factor
        colors = panel.pcolormesh(across, up, grid, shading="nearest", cmap="Blues")
        panel.plot(x[bad], y[bad], "x", color=RED, markersize=4)
        figure.colorbar(colors, ax=panel, label=f"{words} [{size}]", location="top", shrink=0.9)
        panel.set(xlabel=label(names[0]), ylabel=label(names[1]))
        panel.label_outer()
    if bad.any():
        meaning = "not confirmed" if plan.critical else "the dam fails"
        figure.supxlabel(f"crosses: {meaning}", fontsize=9, color=RED)


def draw_probability(figure: Figure, plan: Plan, rows: list[Row], names: list[str]) -> None:
    """Draw the probability of failure over the varied parameter, with its interval."""
    from .outcome import probabilities

    (name,), axes = names, figure.subplots()
    table = probabilities(plan, rows)
    x = np.array([float(row[column_of(name)]) for row in table])
    order = np.argsort(x)
    share, low, high = (np.array([row[n] for row in table])[order] for n in COLUMNS)
    axes.fill_between(x[order], low, high, color=BLUE, alpha=0.2, linewidth=0, label="interval")
    axes.plot(x[order], share, "o-", markersize=4, color=BLUE, label="share of the sample")
    axes.set(xlabel=label(name), ylabel="probability of failure [-]", ylim=(-0.02, 1.02))
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)


#: Columns of the table of probabilities: share of the sample, limits of its interval.
COLUMNS = "probability", "low", "high"


def draw_sample(figure: Figure, plan: Plan, rows: list[Row], names: list[str]) -> None:
    """Draw the sample over its two strongest inputs, and the rank correlations of all inputs."""
    from .outcome import probabilities, sensitivities

    table = sensitivities(plan, rows)
    outcome = "failed" if 0 < fails(rows).sum() < len(rows) else "max_opening"
    ranks = np.nan_to_num([row[outcome] for row in table])
    strongest = [table[i]["input"] for i in np.argsort(-np.abs(ranks))]
    points, bars = figure.subplots(1, 2, width_ratios=(1.3, 1))
    (row,) = probabilities(plan, rows)
    title = "probability of failure {:.4g} ({:.4g} to {:.4g})".format(*(row[c] for c in COLUMNS))
    points.set_title(title, fontsize=10)
    draw_points(points, rows, strongest[:2])
    bars.barh(
        [row["input"] for row in table], ranks, color=[ORANGE if r < 0 else BLUE for r in ranks]
    )
    bars.invert_yaxis()
    bars.axvline(0, color="black", linewidth=0.5)
    bars.set(xlim=(-1, 1), xticks=(-1, -0.5, 0, 0.5, 1), xlabel="Spearman's rank correlation [-]")
    explained = "failure" if outcome == "failed" else DRAWN[outcome][0]
    bars.set_title(f"influence on the {explained}", fontsize=10)
    bars.grid(alpha=0.3, axis="x")


def draw_points(axes: Axes, rows: list[Row], names: list[str]) -> None:
    """Draw the rows over two inputs, failures in red; over one input, histograms."""
    bad, inputs = fails(rows), [numbers(rows, column_of(name)) for name in names]
    axes.set(xlabel=label(names[0]))
    if len(names) == 1:
        parts = [inputs[0][~bad], inputs[0][bad]]
        axes.hist(parts, bins=30, stacked=True, color=[BLUE, RED], label=["stands", "fails"])
        axes.set(ylabel="rows [-]")
    else:
        for rows_shown, color, text in ((~bad, BLUE, "stands"), (bad, RED, "fails")):
            axes.plot(*(v[rows_shown] for v in inputs), ".", color=color, markersize=4, label=text)
        axes.set(ylabel=label(names[1]))
        axes.grid(alpha=0.3)
        axes.ticklabel_format(scilimits=(-3, 4))
    axes.legend(fontsize=8)
