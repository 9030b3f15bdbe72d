"""Sweeps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .. import InputError
from ..arrays import Value
from ..input.case import Case
from ..model.results import HISTORY, IN_TIME, LATERAL, history_columns
from ..progress import track
from ..python_words import speaks_python
from ..studies.plan import (
    Limits,
    Plan,
    Sample,
    column_of,
    in_file,
    listed,
    plan_with,
    planned_cases,
    quantity_of,
)
from .cases import as_case, noted, on_fixed_mesh, warn
from .tables import Tables, WithTables, by_column, displayed, records

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class Sweep(WithTables):
    """The rows of a sweep, made by `sweep`.

    Example:
        >>> rows = sweep(case("dam", levels=40, n_joint=10), mu=[0.7, 0.9], jobs=1)
        >>> rows
        sweep of mu: 2 rows, 0 fail
        >>> rows.rows.mu.tolist(), rows.units["crest_ux"]
        ([0.7, 0.9], 'm')
    """

    plan: Plan
    table: Mapping[str, list[Value]]
    #: the case that is varied, on the mesh of all rows
    case: Case

    @property
    def probability(self) -> np.recarray:
        """Of a sample: its probability of failure for each combination of the varied values, and
        the limits of the 95 % interval.
        """
        from ..studies.outcome import probabilities

        return self.statistics(probabilities(self.plan, self.texts))

    @property
    def sensitivity(self) -> np.recarray:
        """Of a sample: rank correlation of each sampled parameter with the outcomes."""
        from ..studies.outcome import sensitivities

        return self.statistics(sensitivities(self.plan, self.texts))

    def fragility(self, intensity: str = "peak_ground_ax") -> np.recarray:
        """Of earthquakes: the lognormal fragility of each limit, by maximum likelihood: median with
        its 95 % interval, dispersion, numbers of rows; nan and the reason where there is none.

        Args:
            intensity: peak_ground_ax, peak_ground_vx, arias_x or spectral_ax.

        Raises:
            InputError: another intensity, or no earthquakes.
        """
        from ..studies.fragility import fits

        if not self.plan.quake:
            raise InputError("fragility: needs a sweep with quake = a limit")
        rows = [curve.row() for curve in fits(self.plan, self.texts, intensity)]
        numbers = ("median", "median_low", "median_high", "dispersion")
        return records(
            by_column([r | {n: np.nan if r[n] == "" else r[n] for n in numbers} for r in rows])
        )

    def statistics(self, rows: Sequence[Mapping[str, Value]]) -> np.recarray:
        """Rows of statistics, with the varied values as they were before they became texts."""
        table = by_column(rows)
        for name, values in self.plan.varied.items():
            original = {in_file(value): value for value in values}
            table[column_of(name)] = [original[str(text)] for text in table[column_of(name)]]
        return records(table)

    @property
    def texts(self) -> list[dict[str, str]]:
        """The rows as in a result file of `damjoint sweep`."""
        columns = ([in_file(value) for value in column] for column in self.table.values())
        return [dict(zip(self.table, row, strict=True)) for row in zip(*columns, strict=True)]

    def plot(self) -> Figure:
        """The chart of the rows, as `damjoint sweep` writes it.

        Raises InputError if there is none for what was varied.
        """
        from ..studies.chart import figure_of, heading

        cases = (
            [] if self.plan.sampled else [case for _, case in planned_cases(self.case, self.plan)]
        )
        title = heading(self.case, self.plan, len(self.rows))
        return displayed(figure_of(self.plan, self.texts, cases, title))

    @property
    def by_name(self) -> Tables:
        """The table rows, one per combination: the varied values (a level as level_requested), the
        last row of history.csv, failed, verdict, statement, the critical value; nan without an
        equilibrium.
        """
        from ..studies.quake_summary import QUAKE_UNITS

        units = QUAKE_UNITS | {name: u for name, (u, _) in history_columns(self.case).items()}
        units |= {column_of(name): quantity_of(name)[1] for name in self.plan.names}
        if self.plan.critical:
            units[self.plan.critical_columns[0]] = quantity_of(self.plan.critical)[1]
        rows = {name: column_array(name, values) for name, values in self.table.items()}
        return {"rows": (rows, {name: (unit, "") for name, unit in units.items()})}

    def __repr__(self) -> str:
        fails = sum(map(bool, self.table["failed"]))
        return f"sweep of {', '.join(self.plan.names)}: {len(self.rows)} rows, {fails} fail"


def limits_of(quake: float | Mapping[str, float | Sequence[float]] | None) -> Limits | None:
    """The limits of a sweep of earthquakes. Raises InputError."""
    if quake is None:
        return None
    given = quake if isinstance(quake, Mapping) else {"slip": quake}
    for name in given:
        if name not in ("slip", "opening"):
            raise InputError(f"quake: {name}: must be slip or opening")
    return Limits(**{n: tuple(np.atleast_1d(v).astype(float).tolist()) for n, v in given.items()})


def column_array(name: str, values: list[Value]) -> np.ndarray:
    """A column of a sweep; an empty cell of a result that is a number becomes nan."""
    from ..studies.quake_summary import QUAKE_UNITS

    numeric = name in HISTORY | LATERAL | IN_TIME | QUAKE_UNITS or name.startswith("critical_")
    return np.array([np.nan if numeric and value == "" else value for value in values])


@speaks_python
def sweep(
    source: Case | str | Path = "dam",
    *,
    sample: Sample | None = None,
    tie: Mapping[str, str] | None = None,
    critical: str = "",
    quake: float | Mapping[str, float | Sequence[float]] | None = None,
    jobs: int | None = None,
    progress: bool = False,
    **values: Sequence[Value | Path] | Value | Path,
) -> Sweep:
    """Solve a case with all combinations of listed values, each with the entire sample.

    Nothing is written. A row that could not be computed has the verdict `failed`.

    Args:
        source: a case, or its name or path, see `case`. If it has an accuracy, the mesh of all
            rows is that which the case itself requires.
        sample: random values, such as `Sample(100, {"mu": "normal(0.8,0.1)"})`.
        tie: parameters computed from the others, such as `{"adhesion": "2e5*mu"}`.
        critical: also find the critical level, strength, ... of each row, see `critical`.
        quake: each row is an earthquake; it fails if the residual slip exceeds this limit [m], or
            one of several, {"slip": [0.05, 0.2], "opening": 0.01}, or if the dam does not stand.
            The values `record` are the records, by default that of the case.
        jobs: number of processes (default: one per core).
        progress: show a bar, or where there is no terminal a line every ten seconds.
        values: lists of values of parameters, by name; `level` [m] is the last level.

    Raises:
        InputError: bad input.
        RunError: the mesh for an accuracy could not be computed, or a process was killed.

    Example:
        >>> sweep(case("dam", n_joint=10), level=[40, 70], jobs=1).rows.verdict.tolist()
        ['stands', 'sliding']
    """
    from ..processes import check_jobs
    from ..studies.sweep import PlannedRows

    check_jobs(jobs)
    if not (values or sample) or any(isinstance(v, Mapping) for v in values.values()):
        raise InputError("sweep: must have values or a sample, such as mu=[0.8, 1.0]")
    axes = [(name, listed(name, np.atleast_1d(np.array(v)).tolist())) for name, v in values.items()]
    plan = plan_with(axes, list((tie or {}).items()), sample, {}, critical)
    plan = replace(plan, quake=limits_of(quake))
    case = on_fixed_mesh(noted(as_case(source)))
    rows = PlannedRows(case, plan)
    computed = rows.compute(jobs)
    warn(case, rows.notes, 3)
    results = dict(track(computed, "sweep", len(rows.missing())) if progress else computed)
    cells = [
        {column_of(name): v for name, v in row.items()} | results[key]
        for key, row, _ in rows.planned
    ]
    return Sweep(plan, by_column(cells), case)
