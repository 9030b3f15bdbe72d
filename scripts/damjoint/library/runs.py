"""A run, and its load steps one by one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import runner
from ..arrays import Table
from ..engines import Outcome
from ..engines.condensed.solve import thread_number
from ..input.case import Case
from ..model.fields import Solution
from ..model.results import Results
from ..python_words import all_in_python, in_python, speaks_python
from ..solver.load_stepper import LoadStepper
from ..solver.state import State
from ..statics.hints import hints
from ..statics.statement import statement
from ..statics.verdict import verdict
from ..threads import limited_threads
from .cases import as_case, noted, on_fixed_mesh
from .tables import (
    JointTable,
    Tables,
    WithTables,
    attributes,
    displayed,
    optional,
    records,
    tables_of_run,
)

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class Run(WithTables):
    """The results of a case, made by `run`.

    Example:
        >>> result = run(case("dam", levels=[30, 40], n_joint=10))
        >>> result
        dam: stands, level 40 m
        >>> result.history.level.tolist(), result.case.levels
        ([30.0, 40.0], (30.0, 40.0))
    """

    outcome: Outcome

    @property
    def results(self) -> Results:
        """Tables as {column: array}."""
        return self.outcome.result

    @property
    def case(self) -> Case:
        """The case that was solved; with an accuracy, on the mesh that it requires."""
        return self.results.case

    @property
    def joint(self) -> JointTable:
        """joint.csv: a row per node of the joint and requested level."""
        return records(self.results.joint).view(JointTable)

    @property
    def history(self) -> np.recarray:
        """history.csv: a row per converged step."""
        return records(self.results.history)

    @property
    def verdict(self) -> str:
        """stands, sliding, overturning, ...: see `damjoint.statics.verdict.verdict`."""
        return verdict(self.results)

    @property
    def statement(self) -> str:
        """Why and where the run has stopped; empty if the dam stands."""
        return in_python(statement(self.results))

    @property
    def hints(self) -> list[str]:
        """Remarks on the result."""
        return all_in_python(hints(self.results))

    def plot(self) -> Figure:
        """The picture of the run, as `damjoint run` writes it."""
        from ..pictures.run_picture import picture

        return displayed(picture(self.solution))

    @property
    def solution(self) -> Solution:
        """Tables, mesh bodies, and displacement and stress of the bodies by requested time."""
        outcome = self.outcome
        return Solution(outcome.result, outcome.mesh().bodies, outcome.fields())

    def save(self, out: str | Path) -> None:
        """Write tables, fields and picture into a folder, as `damjoint run` does.

        Raises InputError if it cannot be written.
        """
        runner.write_outcomes(self.case, [self.outcome], Path(out))

    @property
    def by_name(self) -> Tables:
        """The tables joint and history."""
        return tables_of_run(self.results)

    def to_xarray(self, table: str = "joint") -> xarray.Dataset:
        """joint or history as a Dataset with units: dimensions time and node, or time.

        Raises ImportError without xarray, InputError for another table.
        """
        data_set, (columns, described) = optional("xarray").Dataset, self.named(table)
        if table == "history":
            return data_set({n: ("time", v, attributes(described[n])) for n, v in columns.items()})
        times = len(np.unique(columns["time"]))
        blocks = {name: column.reshape(times, -1) for name, column in columns.items()}
        placed: dict[str, Any] = {name: (("time", "node"), b) for name, b in blocks.items()}
        placed |= {name: ("node", blocks[name][0]) for name in ("x", "y", "z", "s")}
        placed |= {name: ("time", blocks[name][:, 0]) for name in ("time", "level")}
        variables = {name: (*placed[name], attributes(described[name])) for name in placed}
        return data_set(variables).set_coords(["x", "y", "z", "s", "level"])

    def table(self, name: str) -> Table:
        """The table joint or history as {column: array}. Raises InputError for another name."""
        return {**self.named(name)[0]}

    def __repr__(self) -> str:
        last = self.results.last
        reached = f", level {last['level']:.6g} m" if last else ""
        return f"{self.case.name}: {self.verdict}{reached}"

    def _repr_html_(self) -> str:
        """Verdict and table of the levels, for a notebook."""
        from tabulate import tabulate

        from ..post.summary import levels_table

        levels = levels_table(self.results)
        table = tabulate(levels.rows, levels.heads, tablefmt="html", disable_numparse=True)
        return f"<p>{escape(repr(self))}</p>{table}"


@speaks_python
def run(source: Case | str | Path, *, engine: str = "auto") -> Run:
    """Solve a case; nothing is written. Of a published case with several uplifts: the first.

    A dam that fails is a result, see `Run.verdict`.

    Args:
        source: a case, or its name or path, see `case`.
        engine: condensed; iterative, with uncondensed bodies, for large models in 3D; auto, one of
            these by size and number of steps; or getdp, the reference model.

    Raises:
        InputError: the engine can not run the case.
        RunError: the case could not be computed.

    Example:
        >>> result = run(case("dam", levels=40, n_joint=10))
        >>> result.verdict, len(result.joint.opening)
        ('stands', 21)
    """
    return Run(runner.compute(noted(as_case(source)), engine))


@dataclass(frozen=True, repr=False)
class Step:
    """A converged step of `load_steps`.

    Example:
        >>> step = next(load_steps(case("dam", levels=30, n_joint=10)))
        >>> step, round(step.row["N"] / 1e6, 1)
        (t = 1, level 30 m, 15.7)
    """

    #: to start another step from, with `Model.advance`
    state: State
    #: its row of history.csv, but for load_factor and x_resultant
    row: Mapping[str, float]

    @property
    def time(self) -> float:
        """Time of the step."""
        return self.state.time

    @property
    def level(self) -> float:
        """Level of the reservoir [m]."""
        return self.state.loading.level

    def __repr__(self) -> str:
        return f"t = {self.time:g}, level {self.level:.6g} m"


def load_steps(source: Case | str | Path) -> Iterator[Step]:
    """Solve a case with the condensed engine and yield each converged step.

    The computation stops where the loop over the steps ends.

    Args:
        source: a case, or its name or path, see `case`.

    Raises:
        InputError: bad input.
        RunError: a step could not be computed.

    Example:
        >>> [step.level for step in load_steps(case("dam", levels=[30, 40], n_joint=10))]
        [30.0, 40.0]
    """
    case = on_fixed_mesh(noted(as_case(source), 3))
    threads = thread_number(case)
    with limited_threads(threads):
        stepper = LoadStepper(case)
    steps = stepper.steps()
    while True:
        with limited_threads(threads):  # not in the loop over the steps
            state = next(steps, None)
        if state is None:
            return
        yield Step(state, stepper.history.last)
