"""The result of an earthquake, and its summary as tables."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from ..arrays import Array
from ..arrays import Table as Columns
from ..dynamics import ground_motion
from ..input.case import Case
from ..mesh.mesh import Mesh
from ..model.fields import Field
from ..model.results import QUAKE, QUAKE_OF_JOINTS, Results, column_of, quake_columns
from ..post.summary import Table, aligned, fitted
from . import quake_summary

if TYPE_CHECKING:
    from typing_extensions import Self


@dataclass(frozen=True, kw_only=True)
class QuakeTables:
    """The rows of an earthquake by either engine, up to its end or an error, and what they mean."""

    case: Case
    rows: Columns
    #: the tables of the static loads, with the state after the earthquake as a further row
    static: Results
    #: for run.json
    summary: dict[str, Any]
    #: interrupted or failed; empty if it has reached its end
    state: str = ""
    statement: str
    #: the error that ended it early, to be raised when it is saved
    error: BaseException | None = None

    @classmethod
    def of(
        cls,
        case: Case,
        static: Results,
        summary: dict[str, Any],
        end: tuple[str, str] = ("", ""),
        **others: Any,
    ) -> Self:
        """The result with a summary; end: state and message of an early end."""
        state, words = end
        static.info["quake"] = summary
        # a joint that has slipped everywhere is no failure here
        static.info["verdict"] = state or quake_summary.verdict(case, summary)
        return cls(
            case=case,
            static=static,
            summary=summary,
            state=state,
            statement=words or quake_summary.statement(case, summary),
            **others,
        )

    @property
    def verdict(self) -> str:
        """See `quake_summary.verdict`; failed or interrupted if it ended early."""
        return str(self.static.info["verdict"])

    @property
    def stands(self) -> bool:
        """Whether the verdict is that it stands after the earthquake."""
        return self.verdict == quake_summary.STANDS


@dataclass(frozen=True, kw_only=True)
class QuakeResult(QuakeTables):
    """An earthquake by the condensed engine, with its frames and fields."""

    #: time (rows,), distance from the heel (nodes,), effective normal stress (rows, nodes)
    stress: Columns
    #: the tables of the static loads
    before: Results
    #: the tables of the frames; times in seconds
    frames: Results
    #: displacement and stress of the bodies by time of the static states, and of the frames
    static_fields: Callable[[], dict[float, Field]]
    fields: Callable[[], dict[float, Field]]
    #: states with the largest displacements, in 2D: name, time [s], and the displacement since the
    #: static state (nodes, 2) of each body [m]
    shapes: list[tuple[str, float, dict[str, Array]]]
    mesh: Mesh

    @property
    def joint(self) -> int:
        """The number of the joint with the largest slip at the end."""
        return quake_summary.largest_slip(self.case, self.summary)

    @property
    def joints(self) -> range:
        """Numbers of the joints."""
        return range(len(self.case.joints))

    def joint_rows(self, joint: int) -> Columns:
        """The rows of a joint, by its number, with the columns of QUAKE."""
        of_joint = {name: column_of(name, joint) for name in QUAKE_OF_JOINTS}
        return {name: self.rows[of_joint.get(name, name)] for name in QUAKE}


#: Peaks that are printed in mm: columns of quake.csv, of all joints.
DISPLACEMENTS = "crest_ux", "heel_opening", "toe_opening", "slip_mean"


def peak_cells(name: str, peak: dict[str, float], unit: str) -> tuple[str, str, str]:
    """Unit, value and time [s] of a peak; name: its column of quake.csv."""
    unit = "mm" if name.startswith(DISPLACEMENTS) else unit
    if "opening" in name and peak["value"] <= 0:
        return unit, "closed", ""
    return unit, in_unit(peak["value"], unit), f"{peak['time']:.3f}"


def in_unit(value: float, unit: str) -> str:
    """A value in SI units, in a unit: mm or that of SI."""
    return quake_summary.in_millimetres(value, 4) if unit == "mm" else f"{value:.4g}"


def peaks_table(summary: dict[str, Any], case: Case, of_joints: bool = True) -> Table:
    """Tabulate the peaks of a summary, without what a meaning says of other laws; of_joints: also
    those of the joints.
    """
    columns, rows = quake_columns(case), list[tuple[str, ...]]()
    for name, peak in summary["peaks"].items():
        unit, meaning = columns[name]
        if of_joints or name in quake_summary.PEAKS:
            words = re.split("[:(]", meaning)[0].strip()
            rows.append((words, *peak_cells(name, peak, unit)))
    return Table(["peak of", "unit", "value", "at t"], ["", "", "", "s"], rows)


#: Columns of the table of the joints: heading, unit, name in the peaks or the values at the end.
OF_JOINTS = (
    ("opening, heel", "mm", "heel_opening"),
    ("toe", "mm", "toe_opening"),
    ("open", "m", "open_length"),
    ("broken", "m", "broken_length"),
    ("slip", "mm", "slip_mean"),
)


def joints_table(summary: dict[str, Any], case: Case) -> Table:
    """Tabulate the joints after an earthquake, a row each: peaks, then the values at its end."""
    ends = AT_REST if summary["at_rest"] else MOVING
    rows = []
    for k, joint in enumerate(case.joint_names):
        peaks = [
            peak_cells(name, summary["peaks"][column_of(name, k)], unit)[1]
            for _, unit, name in OF_JOINTS
        ]
        values = [(summary[group].get(column_of(n, k)), unit) for group, n, _, unit in ends]
        at_end = ["-" if value is None else in_unit(value, unit) for value, unit in values]
        rows.append((joint, *peaks, *at_end))
    heads = [(f"peak of {h}" if "," in h else h, unit) for h, unit, _ in OF_JOINTS]
    heads += [(meaning, unit.strip("-")) for _, _, meaning, unit in ends]
    names, units = zip(*heads, strict=True)
    return Table(["joint", *names], ["", *units], rows)


#: Values of a summary at rest, and at the end of a dam that is not: group, name, meaning, unit.
AT_REST = [
    ("residual", "slip", "residual slip", "mm"),
    ("residual", "tilt", "residual tilt", "-"),
    ("residual", "rigid_block", "rigid block, slip", "mm"),
]
MOVING = [
    ("end", "slip", "slip, not at rest", "mm"),
    ("end", "change", "its change without shaking", "mm"),
    ("residual", "rigid_block", "rigid block, slip", "mm"),
]


def residual_table(summary: dict[str, Any], case: Case) -> Table:
    """Tabulate the residual values of a summary."""
    rows = list[tuple[str, ...]]()
    for k in range(len(case.joints)):
        of = f" ({case.named((k,))})" if case.of_joints else ""
        for group, name, meaning, unit in AT_REST if summary["at_rest"] else MOVING:
            if (value := summary[group].get(column_of(name, k))) is not None:
                rows.append((meaning + of, unit, in_unit(value, unit)))
    head = "at rest" if summary["at_rest"] else "not at rest"
    return Table([head, "unit", "value"], ["", "", ""], rows)


def modes(summary: dict[str, Any]) -> str:
    """Natural modes of a summary with their damping, and the frequencies of the damping."""
    texts = []
    for mode in summary["modes"]:
        axis, share = max((mode[f"along_{a}"], a) for a in "xy")[::-1]
        texts.append(
            f"{mode['frequency']:.3g} Hz ({share:.0%} of the mass along {axis}, damping "
            f"{mode['damping']:.1%})"
        )
    words = ", ".join(texts)
    return f"natural modes, joint closed, with the water: {words}; {damping_text(summary)}"


def damping_text(summary: dict[str, Any]) -> str:
    """What Rayleigh's damping of a summary is set to, and which part of it acts."""
    damping = summary["damping"]
    first, second = damping["first"], damping["second"]
    ratio = math.pi * damping["a1"] * (first + second)
    acts = "its stiffness part alone acts (damping_mass = 0), with less damping in these modes"
    if damping["a0"]:
        acts = "mass of concrete" + (" and water" if damping["with_water"] else "")
        acts = f"its parts by stiffness and {acts} act"
    return f"Rayleigh damping set to {100 * ratio:.3g} % at {first:.3g} and {second:.3g} Hz: {acts}"


def ground(summary: dict[str, Any]) -> str:
    """The intensities of the ground motion of a summary."""
    of, first = summary["ground"], summary["frequencies"][0]
    spectrum = [(1 / first, of["spectral_ax"]), *of["spectrum"]]
    values = ", ".join(f"{value:.3g} at {period:.3g} s" for period, value in spectrum)
    return (
        f"ground motion along x: largest acceleration {of['peak_ground_ax']:.3g} m/s2, velocity "
        f"{of['peak_ground_vx']:.3g} m/s, Arias' intensity {of['arias_x']:.3g} m/s; spectral "
        f"acceleration (damping {ground_motion.DAMPING:.0%}) [m/s2], first at the dam's first "
        f"period: {values}"
    )


#: Columns of the table of the joints that a narrow table leaves out, in this order.
LESS = "broken", "open", "residual tilt", "toe"


def text(case: Case, summary: dict[str, Any], width: int | None = None) -> str:
    """Notes, peaks and residual values of a summary as printed tables, of several joints a row for
    each; width: of the terminal, None: all columns.
    """
    peaks = peaks_table(summary, case, of_joints=not case.of_joints)
    short = [(name.split(",")[0], *cells) for name, *cells in peaks.rows]  # without the sign
    parts = [aligned(short, peaks.stacked, left=2)]
    if case.of_joints:
        joints = joints_table(summary, case)
        draw = partial(aligned, left=1)
        parts.append(fitted(joints.names, joints.stacked, joints.rows, LESS, width, draw))
    else:
        rest = residual_table(summary, case)
        parts.append(aligned(rest.rows, rest.heads, left=2))
    lines = [*(f"note: {note}" for note in summary["notes"]), modes(summary), ground(summary)]
    return "\n\n".join(["\n".join(lines), *parts])
