"""The result of an earthquake, and its summary as tables."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tabulate import tabulate

from ..arrays import Array
from ..arrays import Table as Columns
from ..input.case import Case
from ..mesh.mesh import Mesh
from ..model.fields import Field
from ..model.notes import remarks
from ..model.results import QUAKE, QUAKE_OF_JOINTS, Results, column_of, quake_columns
from ..post.summary import Table
from . import quake_summary

if TYPE_CHECKING:
    from typing_extensions import Self


@dataclass(frozen=True, kw_only=True)
class QuakeTables:
    """The rows of an earthquake and what they amount to, by either engine, up to its end or to an
    error.
    """

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
        static.info |= {"notes": remarks(case), "quake": summary}
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

    def rows_of(self, joint: int) -> Columns:
        """The rows of a joint, by its number, with the columns of QUAKE."""
        of_joint = {name: column_of(name, joint) for name in QUAKE_OF_JOINTS}
        return {name: self.rows[of_joint.get(name, name)] for name in QUAKE}


def peaks_table(found: dict[str, Any], case: Case) -> Table:
    """Tabulate the peaks of a summary."""
    columns, rows = quake_columns(case), list[tuple[str, ...]]()
    for name, peak in found["peaks"].items():
        unit, meaning = columns[name]
        closed = "opening" in name and peak["value"] <= 0
        value = ("closed", "") if closed else (f"{peak['value']:.4g}", f"{peak['time']:.3f}")
        rows.append((meaning, unit, *value))
    return Table(["peak of", "unit", "value", "at t"], ["", "", "", "s"], rows)


#: Values of a summary at rest, and at the end of a dam that is not: group, name, meaning, unit.
AT_REST = [
    ("residual", "slip", "residual slip", "m"),
    ("residual", "tilt", "residual tilt", "-"),
    ("residual", "rigid_block", "rigid block, slip", "m"),
]
MOVING = [
    ("end", "slip", "slip, not at rest", "m"),
    ("end", "change", "its change without shaking", "m"),
    ("residual", "rigid_block", "rigid block, slip", "m"),
]


def residual_table(found: dict[str, Any], case: Case) -> Table:
    """Tabulate the residual values of a summary."""
    rows = list[tuple[str, ...]]()
    for k in range(len(case.joints)):
        of = f" ({case.named((k,))})" if case.of_joints else ""
        for group, name, meaning, unit in AT_REST if found["at_rest"] else MOVING:
            if (value := found[group].get(column_of(name, k))) is not None:
                rows.append((meaning + of, unit, f"{value:.4g}"))
    head = "at rest" if found["at_rest"] else "not at rest"
    return Table([head, "unit", "value"], ["", "", ""], rows)


def modes(found: dict[str, Any]) -> str:
    """Natural modes of a summary with their damping, and the frequencies of the damping."""
    texts = []
    for mode in found["modes"]:
        axis, share = max((mode[f"along_{a}"], a) for a in "xy")[::-1]
        texts.append(
            f"{mode['frequency']:.3g} Hz ({share:.0%} of the mass along {axis}, damping "
            f"{mode['damping']:.1%})"
        )
    damping = found["damping"]
    part = "stiffness"
    if damping["a0"]:
        part += " and mass of concrete" + (" and water" if damping["with_water"] else "")
    return (
        f"natural modes, joint closed, with the water: {', '.join(texts)}; Rayleigh damping by "
        f"{part}, set at {damping['first']:.3g} and {damping['second']:.3g} Hz"
    )


#: Width of a printed table beside its first column.
NUMBERS = 40


def text(case: Case, found: dict[str, Any], width: int | None = None) -> str:
    """Notes, peaks and residual values of a summary as printed tables; width: of the terminal."""
    tables = peaks_table(found, case), residual_table(found, case)
    options = {} if width is None else {"maxcolwidths": [max(width - NUMBERS, 20)]}
    parts = [tabulate(t.rows, t.heads, disable_numparse=True, **options) for t in tables]
    lines = [*(f"note: {note}" for note in found["notes"]), modes(found)]
    return "\n\n".join(["\n".join(lines), *parts])
