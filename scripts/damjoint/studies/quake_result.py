"""The result of an earthquake, and its summary as tables."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from tabulate import tabulate

from ..arrays import Array
from ..arrays import Table as Columns
from ..model.case import Case
from ..model.fields import Field
from ..model.mesh import Mesh
from ..model.results import QUAKE, QUAKE_OF_JOINTS, Results, column_of, quake_columns
from ..post.summary import Table


@dataclass(frozen=True, kw_only=True)
class QuakeResult:
    """The rows of an earthquake and what they amount to."""

    case: Case
    rows: Columns
    #: time (rows,), distance from the heel (nodes,), effective normal stress (rows, nodes)
    stress: Columns
    #: the tables of the static loads; and with the state after the earthquake as a further row
    before: Results
    static: Results
    #: the tables of the frames; times in seconds
    frames: Results
    #: displacement and stress of the bodies by time of the static states, and of the frames
    static_fields: Callable[[], dict[float, Field]]
    fields: Callable[[], dict[float, Field]]
    #: states with the largest displacements, in 2D: name, time [s], and the displacement since the
    #: static state (nodes, 2) of each body [m]
    shapes: list[tuple[str, float, dict[str, Array]]]
    mesh: Mesh
    #: for run.json
    summary: dict[str, Any]
    #: whether the dam is in static equilibrium after the earthquake
    stands: bool
    #: interrupted or failed; empty if it has reached its end
    state: str
    statement: str

    @property
    def joint(self) -> int:
        """The number of the joint with the largest residual slip."""
        slips = [self.summary["residual"][column_of("slip", k)] for k in self.joints]
        return int(np.argmax(np.abs(slips)))

    @property
    def joints(self) -> range:
        """Numbers of the joints."""
        return range(len(self.case.joints))

    def rows_of(self, joint: int) -> Columns:
        """The rows of a joint, by its number, with the columns of QUAKE."""
        own = {name: column_of(name, joint) for name in QUAKE_OF_JOINTS}
        return {name: self.rows[own.get(name, name)] for name in QUAKE}


def row_of_peak(name: str, values: Array) -> int:
    """The row in which a column of quake.csv is largest; an overlap of a joint is no opening."""
    return int(np.argmax(values if "opening" in name else np.abs(values)))


def peaks_table(found: dict[str, Any], case: Case) -> Table:
    """Tabulate the peaks of a summary."""
    columns = quake_columns(case)
    rows = []
    for name, peak in found["peaks"].items():
        unit, meaning = columns[name]
        closed = "opening" in name and peak["value"] <= 0
        value = ("closed", "") if closed else (f"{peak['value']:.4g}", f"{peak['time']:.3f}")
        rows.append((meaning, unit, *value))
    return Table(["peak of", "unit", "value", "at t"], ["", "", "", "s"], rows)


#: Residual values of a summary: meaning, unit.
RESIDUAL = {
    "slip": ("residual slip", "m"),
    "tilt": ("residual tilt", "-"),
    "rigid_block": ("rigid block, slip", "m"),
}


def residual_table(found: dict[str, Any], case: Case) -> Table:
    """Tabulate the residual values of a summary."""
    rows = []
    for k in range(len(case.joints)):
        of = f" ({case.named((k,))})" if case.of_joints else ""
        for name, (meaning, unit) in RESIDUAL.items():
            if (value := found["residual"].get(column_of(name, k))) is not None:
                rows.append((meaning + of, unit, f"{value:.4g}"))
    return Table(["at rest", "unit", "value"], ["", "", ""], rows)


def modes(found: dict[str, Any]) -> str:
    """Natural frequencies and damping ratios of a summary."""
    frequencies = ", ".join(f"{f:.3g}" for f in found["frequencies"])
    ratios = ", ".join(f"{r:.1%}" for r in found["damping"]["ratios"])
    return f"natural frequencies, joint closed, with the water: {frequencies} Hz; damping {ratios}"


def text(case: Case, found: dict[str, Any]) -> str:
    """Peaks and residual values of a summary as printed tables."""
    tables = peaks_table(found, case), residual_table(found, case)
    parts = [tabulate(table.rows, table.heads, disable_numparse=True) for table in tables]
    return "\n\n".join([modes(found), *parts])
