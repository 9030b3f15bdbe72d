"""Chart of a sweep: curves over one varied parameter, maps over two with many values, statistics of
a sample.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import XAxis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from .. import InputError
from ..input.case import Case
from ..pictures.drawing import BLUE, ORANGE, RED, picture_style, widen, write_picture
from ..pictures.drawing import figure_of as drawing_of
from ..statics.gravity import sliding_factor
from ..units import LENGTHS, NUMBER, Units, unit
from .plan import Plan, Row, column_of, numbers, quantity_of
from .report_input import suitable_unit
from .sweep import UNDECIDED

#: Quantities drawn: label and units.
OPENING = "max_opening"
DRAWN: dict[str, tuple[str, Units]] = {
    "crack_length": ("crack", LENGTHS[:1]),
    OPENING: ("largest opening", LENGTHS),
    "crest_ux": ("crest, downstream", LENGTHS),
}
#: Those of earthquakes.
SLIP = "residual_slip"
DRAWN_OF_QUAKES: dict[str, tuple[str, Units]] = {
    SLIP: ("residual slip", LENGTHS),
    "residual_tilt": ("residual tilt", (("rad", 1), ("mrad", 1e3), ("µrad", 1e6))),
    "rigid_block_slip": ("slip of a rigid block", LENGTHS),
    "peak_ground_ax": ("largest acceleration of the ground", (("m/s$^2$", 1),)),
}
#: The safety factor, which is no column of the rows.
FACTOR, FACTOR_LABEL = "SSF", "safety factor against sliding"
#: Most values of a parameter that are drawn as single curves or ticks.
FEW = 5
#: Height of the crosses of rows that fail over that of their panel, curve by curve.
EDGE = 0.04
#: Most labels along an axis of a map.
LABELS = 10
#: Colors and markers of curves; markers of verdicts.
CURVES = [*zip((BLUE, ORANGE, "#2e7d32", "#8e24aa", "#333333"), "os^Dv", strict=True)]
VERDICTS = "os^DvP*X"


class Table(NamedTuple):
    """What is drawn: the plan of a sweep, its rows, the case of each."""

    plan: Plan
    rows: list[Row]
    cases: list[Case]

    def values(self, column: str) -> np.ndarray:
        """A column of the rows, or their SSF; nan where there is no value."""
        if column != FACTOR:
            return numbers(self.rows, column)
        sizes = zip(*(numbers(self.rows, n) for n in ("N", "T", "bonded_length")), strict=True)
        factors = [
            sliding_factor(case, normal, shear, bonded)
            for case, (normal, shear, bonded) in zip(self.cases, sizes, strict=True)
        ]
        return np.where(np.isfinite(factors), factors, np.nan)

    def curves(self, order: np.ndarray, names: list[str]) -> dict[str, list[int]]:
        """The numbers of the rows, in an order, by the values of some names, as text."""
        curves: dict[str, list[int]] = {}
        for i in order:
            key = ", ".join(f"{name} {value_text(name, self.rows[i])}" for name in names)
            curves.setdefault(key, []).append(i)
        return curves


def draw(plan: Plan, rows: list[Row], cases: list[Case], title: str, path: Path) -> str:
    """Draw the rows of a sweep, each with its case, to path.

    Returns a message if there is no chart for what was varied, else an empty text.
    """
    try:
        write_picture(figure_of(plan, rows, cases, title), path, 110)
    except InputError as error:
        return str(error)
    return ""


@picture_style()
def figure_of(plan: Plan, rows: list[Row], cases: list[Case], title: str) -> Figure:
    """The chart of the rows of a sweep, each with its case.

    Raises InputError if there is none for what was varied.
    """
    axes = [name for name, values in plan.varied.items() if all(map(is_number, values))]
    others = [name for name in plan.varied if name not in axes]
    counts = {name: len(set(plan.varied[name])) for name in axes}
    if plan.sampled:
        fits = not others and len(axes) <= 1
        drawing = draw_probability if axes else draw_sample
    else:
        fits = len(axes) <= 1 or (len(axes) == 2 and not others)
        many = len(axes) == 2 and min(counts.values()) > FEW
        drawing = draw_maps if many else draw_curves
    if not fits:
        raise InputError(
            f"no chart of {len(plan.varied)} varied parameters ({', '.join(plan.varied)}): needs "
            "at most two with numbers as values, beside a sample at most one"
        )
    high = not plan.sampled and not plan.critical
    figure = drawing_of(10, 7 if high else 4.8, layout="constrained")
    figure.suptitle(textwrap.fill(title, 100), fontsize=11, parse_math=False)
    along = sorted(axes, key=lambda name: -counts[name]) if drawing is draw_curves else axes
    drawing(figure, Table(plan, rows, cases), along or others[:1])
    return figure


def is_number(value: float | str) -> bool:
    """Whether a varied value is a number."""
    try:
        float(value)
    except ValueError:
        return False
    return True


def axis_of(name: str, values: np.ndarray) -> tuple[str, float]:
    """The label of the axis of a varied or sampled name, and the factor to the unit that suits."""
    words, size = quantity_of(name)
    size, factor = suitable_unit(size, values)
    return f"{words} [{size}]" if size else words, factor


def value_text(name: str, row: Row) -> str:
    """The value of a varied name in a row, with its unit."""
    text = row[column_of(name)]
    if not is_number(text):
        return text
    size, factor = suitable_unit(quantity_of(name)[1], np.array([float(text)]))
    return f"{float(text) * factor:.6g} {size}".rstrip(" -")


def heading(case: Case, plan: Plan, number: int) -> str:
    """The title of the chart of a sweep of a case: its rows, and what is common to all of them."""
    common = [name for name in ("law", "uplift") if name not in plan.names]
    facts = [f"{name} {case.of_all_joints(name)}" for name in common]
    if "level" not in plan.names and plan.critical != "level":
        facts.append(f"level {case.levels[-1]:g} m")
    return f"{case.title}: {', '.join([f'{number} rows', *facts])}"


#: Largest value of a varied name over its smallest from which its axis is logarithmic: the larger
#: ones would hide the others.
DECADE = 10


def fails(rows: list[Row]) -> np.ndarray:
    """Whether each row fails."""
    return np.array([row["failed"] == "1" for row in rows])


def is_marked(plan: Plan, rows: list[Row]) -> np.ndarray:
    """Whether each row gets a cross: the dam fails, or its critical value is not confirmed."""
    if plan.critical:
        return np.array([row["confirmed"] != "1" for row in rows])
    return fails(rows)


def drawn_quantities(plan: Plan) -> dict[str, tuple[str, Units]]:
    """The quantities of the rows that are drawn: label and units by column."""
    return dict(DRAWN_OF_QUAKES if plan.quake else DRAWN)


def panels_of(figure: Figure, table: Table) -> Iterator[tuple[Axes, str, tuple[str, Units]]]:
    """Create axes for what is drawn: DRAWN and SSF, those of earthquakes, or critical values."""
    plan, drawn = table.plan, drawn_quantities(table.plan)
    if plan.critical:
        words, size = quantity_of(plan.critical)
        drawn = {plan.critical_columns[0]: (f"critical {words}", ((size, 1),))}
    elif not plan.quake:
        drawn[FACTOR] = FACTOR_LABEL, NUMBER
    shape = (2, 2) if len(drawn) > 1 else (1, 1)
    panels = figure.subplots(*shape, squeeze=False).ravel()
    for unused in panels[len(drawn) :]:
        unused.remove()
    return zip(panels, drawn, drawn.values(), strict=False)


def draw_curves(figure: Figure, table: Table, names: list[str]) -> None:
    """Draw each quantity over the first name, a curve per combination of the other values."""
    plan, name = table.plan, names[0]
    column, others = column_of(name), [other for other in plan.varied if other != name]
    texts = [row[column] for row in table.rows]
    categories = None if all(map(is_number, texts)) else list(dict.fromkeys(texts))
    x = np.array([categories.index(t) if categories else float(t) for t in texts])
    x_label, x_factor = (name, 1.0) if categories else axis_of(name, x)
    x = x * x_factor
    curves = table.curves(np.argsort(x, kind="stable"), others)
    bad = is_marked(plan, table.rows)
    # of a static row that fails the last state is at another level: it would set the scale
    valued = bool(plan.critical or plan.quake)
    for panel, drawn, (words, units) in panels_of(figure, table):
        values = table.values(drawn)
        if drawn == OPENING:  # of a joint that is closed everywhere it is an overlap
            values = np.maximum(values, 0.0)
        shown = values if valued else values[~bad]
        limits = plan.quake.slip if drawn == SLIP and plan.quake else ()
        size, factor = unit([np.nan_to_num(shown), np.array([*limits])], units)
        for number, (key, members) in enumerate(sorted(curves.items(), key=lambda item: item[1])):
            color, mark = CURVES[number % len(CURVES)]
            good = np.where(bad[members], np.nan, values[members] * factor)
            line = "none" if categories else "-"
            panel.plot(x[members], good, mark, color=color, ms=4.5, linestyle=line, label=key)
            if plan.critical and not categories:  # values that are not confirmed are on it, too
                panel.plot(x[members], values[members] * factor, color=color, lw=0.8, zorder=1)
            failing, cross = [i for i in members if bad[i]], color if others else RED
            at_value = [i for i in failing if valued and np.isfinite(values[i])]
            panel.plot(x[at_value], values[at_value] * factor, "x", color=cross)
            at_edge = [i for i in failing if i not in at_value]
            edge: dict[str, Any] = {"transform": panel.get_xaxis_transform(), "color": cross}
            panel.plot(x[at_edge], np.full(len(at_edge), EDGE * (1 + number)), "x", **edge)
        if categories:
            panel.set_xticks(range(len(categories)), categories)
            panel.set_xlim(-0.5, len(categories) - 0.5)
        else:
            scale_axis(panel.xaxis, x)
        panel.set(xlabel=x_label, ylabel=f"{words} [{size or '-'}]")
        panel.grid(alpha=0.3)
        if drawn == FACTOR:
            draw_verdicts(panel, table, x, values)
        if limits:
            least = np.nanmin(values, initial=0.0)
            draw_limits(panel, [v * factor for v in limits], least < 0)
        if np.nan_to_num(shown).any():
            widen(panel.yaxis)
        else:
            note_zero(panel, int(np.isfinite(shown).sum()), len(x), valued)
    handles, labels = panel.get_legend_handles_labels()
    named = {text: handle for text, handle in zip(labels, handles, strict=True) if text in curves}
    if bad.any():
        undecided = any(row["verdict"] in UNDECIDED for row in table.rows)
        meaning = "fails or undecided" if undecided else "fails"
        meaning = "not confirmed" if plan.critical else meaning
        (named[meaning],) = panel.plot([], [], "x", color="black" if others else RED)
    named.pop("", None)
    if named:
        below: dict[str, Any] = {"loc": "outside lower center", "fontsize": 8}
        figure.legend(list(named.values()), list(named), ncols=min(len(named), 4), **below)


def note_zero(panel: Axes, number: int, rows: int, valued: bool) -> None:
    """Say that a number of the rows have zero, the others none; valued: also rows that fail."""
    panel.set(yticks=[0] if number else [], ylim=(-1, 1))
    text = f"zero in all rows that {'have a value' if valued else 'stand'}"
    text = "zero in all rows" if number == rows else text
    text = text if number else ("no row has a value" if valued else "all rows fail")
    panel.text(0.5, 0.6, text, ha="center", transform=panel.transAxes)


def scale_axis(axis: XAxis, values: np.ndarray) -> None:
    """Scale the axis of varied values (n,): logarithmic beyond a decade; few are its ticks."""
    if values.min() > 0 and values.max() >= DECADE * values.min():
        axis.axes.set_xscale("log")
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    if len(set(values)) <= FEW:
        axis.set_ticks(sorted(set(values)), labels=[f"{v:g}" for v in sorted(set(values))])
        axis.set_minor_locator(NullLocator())


def draw_verdicts(panel: Axes, table: Table, x: np.ndarray, values: np.ndarray) -> None:
    """Mark each row by its verdict, and the factor that all rows require, if they do."""
    verdicts = np.array([row["verdict"] for row in table.rows])
    for mark, verdict in zip(VERDICTS, dict.fromkeys(verdicts.tolist()), strict=False):
        alike = verdicts == verdict
        style: dict[str, Any] = {"color": "black", "mfc": "white", "markersize": 7, "zorder": 4}
        panel.plot(x[alike], values[alike], mark, **style, label=verdict)
    required = {case["required_SSF"] for case in table.cases}
    if len(required) == 1 and (least := required.pop()):
        panel.axhline(least, color="black", linestyle="--", lw=0.9, label=f"required {least:g}")
    handles, labels = panel.get_legend_handles_labels()
    shown = [(h, t) for h, t in zip(handles, labels, strict=True) if t in {*verdicts} or "req" in t]
    panel.legend(*zip(*shown, strict=True), fontsize=8)


def draw_limits(panel: Axes, limits: list[float], both: bool) -> None:
    """Draw slips beyond which a row fails, in the panel's unit; both: in both directions."""
    for line in (side * limit for side in (1, -1)[: 1 + both] for limit in limits):
        panel.axhline(line, color="black", linestyle="--", lw=0.9, label="limit")
    panel.legend(*[parts[-1:] for parts in panel.get_legend_handles_labels()], fontsize=8)


def draw_maps(figure: Figure, table: Table, names: list[str]) -> None:
    """Draw each quantity over two varied parameters, with crosses where the dam fails."""
    plan, rows = table.plan, table.rows
    x, y = (numbers(rows, column_of(name)) for name in names)
    (across, i), (up, j) = (np.unique(v, return_inverse=True) for v in (x, y))
    bad = is_marked(plan, rows)
    for panel, column, (quantity_drawn, units) in panels_of(figure, table):
        hidden = bad & (plan.quake is None)
        values = np.where(hidden, np.nan, table.values(column))
        values = np.maximum(values, 0.0) if column == OPENING else values
        size, factor = unit([np.nan_to_num(values)], units)
        grid = np.full((len(up), len(across)), np.nan)
        grid[j, i] = values * factor
        colors = panel.pcolormesh(grid, cmap="Blues")
        if np.isfinite(values).any() and not np.nan_to_num(values).any():
            colors.set_clim(0, 1)
            words = "zero in all rows that stand" if bad.any() else "zero in all rows"
            panel.text(0.5, 0.5, words, ha="center", transform=panel.transAxes)
        panel.plot(i[bad] + 0.5, j[bad] + 0.5, "x", color=RED, markersize=4)
        bar = figure.colorbar(colors, ax=panel, label=f"{quantity_drawn} [{size or '-'}]")
        if not np.nan_to_num(values).any():
            bar.set_ticks([0])
        for axis, ends, name in ((panel.xaxis, across, names[0]), (panel.yaxis, up, names[1])):
            words, size_factor = axis_of(name, ends)
            shown = np.arange(0, len(ends), -(-len(ends) // LABELS))
            axis.set_ticks(shown + 0.5, [f"{v * size_factor:g}" for v in ends[shown]])
            axis.set_label_text(words)
        panel.label_outer()
    if bad.any():
        meaning = "not confirmed" if plan.critical else "the dam fails"
        figure.supxlabel(f"crosses: {meaning}", fontsize=9, color=RED)


def draw_probability(figure: Figure, table: Table, names: list[str]) -> None:
    """Draw the probability of failure over the varied parameter, with its interval."""
    from . import sampling
    from .outcome import probabilities

    (name,), axes = names, figure.subplots()
    shares = probabilities(table.plan, table.rows)
    x = np.array([float(row[column_of(name)]) for row in shares])
    words, factor = axis_of(name, x)
    x *= factor
    order = np.argsort(x)
    share, low, high = (np.array([row[n] for row in shares])[order] for n in COLUMNS)
    interval = f"its {sampling.CONFIDENCE:.0%} interval"
    axes.fill_between(x[order], low, high, color=BLUE, alpha=0.2, linewidth=0, label=interval)
    axes.plot(x[order], share, "o-", markersize=4, color=BLUE, label="share of the sample")
    scale_axis(axes.xaxis, x)
    axes.set(xlabel=words, ylabel="probability of failure [-]", ylim=(-0.02, 1.02))
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)


#: Columns of the table of probabilities: share of the sample, limits of its interval.
COLUMNS = "probability", "low", "high"


def draw_sample(figure: Figure, table: Table, names: list[str]) -> None:
    """Draw the sample over its two strongest inputs, and the rank correlations of all inputs."""
    from .outcome import probabilities, sensitivities

    plan, rows = table.plan, table.rows
    inputs = sensitivities(plan, rows)
    drawn = drawn_quantities(plan)
    other = SLIP if plan.quake else "max_opening"
    outcome = "failed" if 0 < fails(rows).sum() < len(rows) else other
    ranks = np.nan_to_num([row[outcome] for row in inputs])
    strongest = [inputs[i]["input"] for i in np.argsort(-np.abs(ranks))]
    points, bars = figure.subplots(1, 2, width_ratios=(1.3, 1))
    (row,) = probabilities(plan, rows)
    title = "probability of failure {:.4g} ({:.4g} to {:.4g})".format(*(row[c] for c in COLUMNS))
    points.set_title(title, fontsize=10)
    draw_points(points, rows, strongest[:2])
    bars.barh(
        [row["input"] for row in inputs], ranks, color=[ORANGE if r < 0 else BLUE for r in ranks]
    )
    bars.invert_yaxis()
    bars.axvline(0, color="black", linewidth=0.5)
    bars.set(xlim=(-1, 1), xticks=(-1, -0.5, 0, 0.5, 1), xlabel="Spearman's rank correlation [-]")
    explained = "failure" if outcome == "failed" else drawn[outcome][0]
    bars.set_title(f"influence on the {explained}", fontsize=10)
    bars.grid(alpha=0.3, axis="x")


def draw_points(axes: Axes, rows: list[Row], names: list[str]) -> None:
    """Draw the rows over two inputs, failures in red; over one input, histograms."""
    bad, inputs = fails(rows), [numbers(rows, column_of(name)) for name in names]
    axes_of = [axis_of(name, values) for name, values in zip(names, inputs, strict=True)]
    labels = [words for words, _ in axes_of]
    inputs = [values * factor for values, (_, factor) in zip(inputs, axes_of, strict=True)]
    axes.set(xlabel=labels[0])
    if len(names) == 1:
        parts = [inputs[0][~bad], inputs[0][bad]]
        axes.hist(parts, bins=30, stacked=True, color=[BLUE, RED], label=["stands", "fails"])
        axes.set(ylabel="rows [-]")
    else:
        for shown, mark, color, text in ((~bad, "o", BLUE, "stands"), (bad, "x", RED, "fails")):
            if shown.any():
                positions = [v[shown] for v in inputs]
                axes.plot(*positions, mark, color=color, markersize=3.5, label=text)
        axes.set(ylabel=labels[1])
        axes.grid(alpha=0.3)
        axes.ticklabel_format(scilimits=(-3, 4))
    axes.legend(fontsize=8)
