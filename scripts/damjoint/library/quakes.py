"""Earthquakes and natural modes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import InputError
from ..arrays import Array, Table
from ..input.case import Case
from ..input.resolve import with_record
from ..model.results import MODES, joint_columns, quake_columns
from ..python_words import speaks_python
from .cases import as_case, noted, on_fixed_mesh
from .tables import JointTable, Tables, WithTables, displayed, records, tables_of_run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..dynamics.modes import NaturalModes
    from ..studies.quake_result import QuakeTables


@dataclass(frozen=True, repr=False)
class Quake(WithTables):
    """An earthquake of a case, made by `quake`.

    Example:
        >>> wave = [f"{i / 50},{2 * (i % 10 == 0)}" for i in range(20)]
        >>> _ = Path("wave.csv").write_text("time,horizontal\\n" + "\\n".join(wave))
        >>> shaken = case("dam", levels=30, n_joint=10, record="wave.csv", record_unit="m/s2")
        >>> result = quake(case(shaken, record_rest=0.5))
        >>> result.stands, result.units["crest_ux"]
        (True, 'm')
    """

    #: summary (see results.md), verdict, statement, stands
    tables: QuakeTables

    @property
    def case(self) -> Case:
        """The case."""
        return self.tables.case

    @property
    def history(self) -> np.recarray:
        """history.csv: the static states, with that after the earthquake as a further row."""
        return records(self.tables.static.history)

    @property
    def joint(self) -> JointTable:
        """joint.csv: the joints in the static states."""
        return records(self.tables.static.joint).view(JointTable)

    @property
    def frames(self) -> JointTable | None:
        """quake_joint.csv: the joints at up to 200 times [s]; None by GetDP."""
        frames = getattr(self.tables, "frames", None)
        return records(frames.joint).view(JointTable) if frames else None

    @property
    def stress(self) -> Table | None:
        """Effective normal stress [Pa] along the first joint in time, as in quake_stress.npz; None
        by GetDP.
        """
        return getattr(self.tables, "stress", None)

    @property
    def summary(self) -> dict[str, Any]:
        """Peaks, values at rest, modes, damping, notes: `quake` in run.json."""
        return self.tables.summary

    @property
    def verdict(self) -> str:
        """stands, no equilibrium, not at rest, broken without friction."""
        return self.tables.verdict

    @property
    def stands(self) -> bool:
        """Whether the dam stands after the earthquake."""
        return self.tables.stands

    @property
    def statement(self) -> str:
        """What the end of the earthquake amounts to."""
        return self.tables.statement

    def plot(self) -> Figure:
        """The picture of the earthquake, as `damjoint quake` writes it.

        Raises InputError if it is by GetDP, which has none.
        """
        from ..studies.quake_picture import figure
        from ..studies.quake_result import QuakeResult

        if not isinstance(self.tables, QuakeResult):
            raise InputError("engine = getdp: must be condensed for a picture of the earthquake")
        return displayed(figure(self.tables))

    @property
    def by_name(self) -> Tables:
        """The tables rows, that of quake.csv: a row per time step; history, joint and, not by
        GetDP, frames.
        """
        frames, case = getattr(self.tables, "frames", None), self.case
        columns = joint_columns(case) | {"time": ("s", "")}
        in_time = {"frames": (frames.joint, columns)} if frames else {}
        rows = self.tables.rows, quake_columns(case)
        return {"rows": rows, **tables_of_run(self.tables.static), **in_time}

    def __repr__(self) -> str:
        return f"{self.case.name}: {self.statement}"


@speaks_python
def quake(
    source: Case | str | Path = "dam",
    *,
    record: str | Path | None = None,
    engine: str = "auto",
    progress: bool = False,
) -> Quake:
    """The dam through a recorded earthquake, after its static loads; nothing is written.

    Args:
        source: a case, or its name or path, see `case`.
        record: file of the ground's acceleration, see `case` (default: that of the case).
        engine: condensed (auto), or getdp, the reference model.
        progress: show a bar, or where there is no terminal a line every ten seconds.

    Raises:
        InputError: bad input, or an earthquake that the engine can not compute.
        RunError: no static equilibrium, or a step that could not be computed.

    Example:
        >>> wave = [f"{i / 50},{2 * (i % 10 == 0)}" for i in range(20)]
        >>> _ = Path("wave.csv").write_text("time,horizontal\\n" + "\\n".join(wave))
        >>> coarse = case("dam", levels=30, n_joint=10, record_unit="m/s2", record_rest=0.5)
        >>> quake(coarse, record="wave.csv").rows.dtype.names[:2]
        ('time', 'ground_ax')
    """
    from ..studies import quake_study

    chosen = as_case(source)
    chosen = on_fixed_mesh(noted(chosen if record is None else with_record(chosen, record)))
    options = quake_study.Options(engine, progress=progress)
    quake_study.check(chosen, options)
    tables = quake_study.compute(chosen, options)
    if tables.error:
        raise tables.error
    return Quake(tables)


@dataclass(frozen=True, repr=False)
class Modes(WithTables):
    """The natural modes of a case, made by `modes`.

    Example:
        >>> natural = modes(case("dam", levels=40, n_joint=10, order=1), number=2)
        >>> natural.units["frequency"], natural.rows.mode.tolist()
        ('Hz', [1, 2, 1, 2, 1, 2, 1, 2])
    """

    #: the modes of each water on each rock, with their shapes
    natural: NaturalModes

    @property
    def case(self) -> Case:
        """The case."""
        return self.natural.case

    @property
    def frequencies(self) -> Array:
        """Frequencies [Hz] with the reservoir on massless rock, as in an earthquake."""
        return np.array([mode.frequency for mode in self.natural.variants[0].modes])

    @property
    def by_name(self) -> Tables:
        """The table rows, that of modes.csv: a row per mode of each water on each rock."""
        return {"rows": (self.natural.table, MODES)}

    def plot(self) -> Figure:
        """The picture of the modes, as `damjoint modes` writes it."""
        from ..pictures.modes_picture import figure
        from ..studies.modes_study import about

        return displayed(figure(self.natural, about(self.natural)))

    def __repr__(self) -> str:
        listed = ", ".join(f"{frequency:.4g}" for frequency in self.frequencies)
        return f"{self.case.name}: {listed} Hz"


@speaks_python
def modes(source: Case | str | Path = "dam", *, number: int = 5) -> Modes:
    """Natural modes of a case, without a record: joints closed and undamaged, with and without the
    mass of the water, on massless and on rigid rock; nothing is written.

    Args:
        source: a case, or its name or path, see `case`.
        number: modes of each, the lowest ones.

    Raises:
        InputError: bad input, or fewer unknowns than modes.
        RunError: too little memory.

    Example:
        >>> natural = modes(case("dam", levels=40, n_joint=10, order=1), number=2)
        >>> sorted(set(natural.rows.rock.tolist())), len(natural.frequencies)
        (['massless', 'rigid'], 2)
    """
    from ..studies import modes_study

    if number < 1:
        raise InputError(f"number = {number}: must be an integer >= 1")
    return Modes(modes_study.compute(on_fixed_mesh(noted(as_case(source))), number, progress=False))
