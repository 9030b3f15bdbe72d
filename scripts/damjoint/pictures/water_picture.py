"""Picture of flow in time: levels, open length and water in the joint, and a map of the pressure
along the joint over time.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ..arrays import Array
from ..model.results import Results
from ..statics.verdict import verdict
from ..units import unit_of_time
from .drawing import (
    BLUE,
    DARK,
    GREY,
    ORANGE,
    RED,
    WATER,
    figure_of,
    panels,
    picture_style,
    write_picture,
)
from .run_picture import facts_of

#: Size of the picture [inches].
SIZE = 9.0, 7.0


def has(results: Results) -> bool:
    """Whether there is flow in time to draw."""
    later = results.joint["time"] > results.case["time_start"]
    return bool(results.case.stores_water and later.any())


def draw(results: Results, folder: Path) -> Path:
    """Draw the picture of a run into its folder; its path."""
    path = folder / f"{results.case.name}_water.png"
    write_picture(figure(results), path, dpi=130)
    return path


@picture_style()
def figure(results: Results) -> Figure:
    """The figure, of the first joint in which water flows in time."""
    joint, result = next((k, r) for k, r in enumerate(results.joints) if r.case["uplift"] == "flow")
    case, rows = result.case, result.history
    unit, factor = unit_of_time((rows["time"][-1] - case["time_start"]) * case["time_unit"])

    def in_unit(t: Array) -> Array:
        return (t - case["time_start"]) * case["time_unit"] * factor

    picture = figure_of(*SIZE)
    name = results.case.named((joint,)) or "the joint"
    title = f"{results.case.title}, water in {name} in time: {verdict(results)}"
    picture.text(0.05, 0.985, title, va="top", fontsize=10, parse_math=False)
    facts = "at the end: " + "\n".join(facts_of(results))
    picture.text(0.05, 0.955, facts, va="top", fontsize=8, color=DARK, parse_math=False)
    levels, water, chart = panels(picture, 3, left=0.9, right=1.1, top=0.85, down=0.3)[:, 0]
    shown = rows["time"] >= case["time_start"] - 1e-9
    time = in_unit(rows["time"][shown])

    levels.plot(time, rows["level"][shown], color=BLUE, label="reservoir [m]")
    levels.plot(time, rows["crack_length"][shown], color=RED, label="open length [m]")
    levels.set_ylabel("m", fontsize=8)
    for column, color, words in (
        ("water", WATER, "stored"),
        ("water_in", ORANGE, "inflow"),
        ("void", GREY, "void"),
    ):
        water.plot(time, 1e3 * rows[column][shown], color=color, label=f"{words} [l/m]")
    water.set_ylabel("litres per m", fontsize=8)

    times = [t for t in np.unique(result.joint["time"]) if t >= case["time_start"] - 1e-9]
    tables = [result.at(t) for t in times]
    s, inverse, number = np.unique(
        tables[0]["s"].round(9), return_inverse=True, return_counts=True
    )  # in 3D a mean over the nodes at a distance from the heel
    values = np.array([np.bincount(inverse, table["p"]) / number for table in tables]).T / 1e3
    if len(times) > 1:
        mesh = chart.pcolormesh(
            in_unit(np.array(times)), s, values, shading="nearest", rasterized=True
        )
        box = chart.get_position()
        bar = picture.add_axes((box.x1 + 0.02, box.y0, 0.015, box.height))
        picture.colorbar(mesh, cax=bar).set_label("p [kPa]", fontsize=8)
        bar.tick_params(labelsize=7)
    chart.set_ylabel("s from heel [m]", fontsize=8)
    chart.set_xlabel(f"time [{unit}]", fontsize=8)
    for axes in (levels, water, chart):
        axes.set_xlim(time[0], time[-1] if len(time) > 1 else time[0] + 1)
    for axes in (levels, water):
        axes.tick_params(labelbottom=False)
        axes.grid(alpha=0.3)
        axes.legend(
            fontsize=7, ncols=3, loc="lower right", bbox_to_anchor=(1.01, 0.97), frameon=False
        )
    return picture
