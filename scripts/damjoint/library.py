"""The interface for Python: `import damjoint as dj`.

    case = dj.case("dam", levels=[30, 40, 45], mu=0.8)
    run = dj.run(case)
    run.verdict, run.joint.at(level=45).delta_n.max()

Names and units are those of the parameters and of the tables (reference/parameters.md, results.md).
Only `Run.save` writes to disk.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import ROUND_OFF, InputError, accuracy
from .arrays import Table, Value
from .engines import Outcome, engine_of
from .laws import LAWS, Law
from .model.case import Case, load
from .model.fields import Solution
from .model.results import Results
from .solver.load_stepper import LoadStepper
from .solver.state import State
from .statics.verdict import hints, statement, verdict

if TYPE_CHECKING:  # loaded when they are used, with what they draw with
    from .studies.check import SafetyCheck
    from .studies.critical import CriticalValue, Search

__all__ = ["LAWS", "Critical", "Law", "Run", "Step", "case", "check", "critical", "fill", "run"]


def case(
    source: str | Path = "dam",
    *,
    levels: Sequence[float] | float | None = None,
    tail_levels: Sequence[float] | float | None = None,
    steps: int | None = None,
    accuracy: str | None = None,
    **parameters: Value,
) -> Case:
    """A case with parameters of one's own.

    source: letter or name of a case of the package, or path of a case file; levels, tail_levels:
    of reservoir and tailwater [m] at t = 1, 2, ...; steps: equal steps between two levels;
    accuracy: coarse, standard, fine or a percentage, see `damjoint run --help`; parameters: by
    name, in SI units, or as a text with a unit, "20*GPa". Raises InputError.
    """
    heights = as_list(levels), as_list(tail_levels)
    return load(str(source), parameters, *heights, steps, accuracy)


def as_list(levels: Sequence[float] | float | None) -> list[float] | None:
    """Levels as a list, also of a single one."""
    return None if levels is None else np.atleast_1d(levels).tolist()


class JointTable(np.recarray):
    """Rows of joint.csv as a record array."""

    def at(self, *, level: float | None = None, time: float | None = None) -> JointTable:
        """The rows of a requested level [m] (the last time it was reached) or time, from heel to
        toe. Raises InputError if there is no such table.
        """
        column, value = ("level", level) if time is None else ("time", time)
        if value is None:
            raise InputError("at: must have a level or a time")
        near = np.isclose(self[column], value, rtol=ROUND_OFF, atol=ROUND_OFF)
        if not near.any():
            known = ", ".join(f"{v:g}" for v in dict.fromkeys(self[column].tolist()))
            raise InputError(f"{column} = {value:g}: must be one of {known}")
        rows: JointTable = self[self["time"] == self["time"][near].max()]
        return rows


@dataclass(frozen=True)
class Run:
    """A scene that has been solved."""

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
        return statement(self.results)

    @property
    def hints(self) -> list[str]:
        """What to know of the result besides its verdict."""
        return hints(self.results)

    def plot(self) -> Any:
        """The picture of the run, a matplotlib Figure."""
        from .post.pictures import picture

        return picture(self.solution)

    @property
    def solution(self) -> Solution:
        """Tables, mesh bodies, and displacement and stress of the bodies by requested time."""
        outcome = self.outcome
        return Solution(outcome.result, outcome.mesh().bodies, outcome.fields())

    def save(self, out: str | Path) -> None:
        """Write tables, fields and picture into a folder, as `damjoint run` does.

        Raises InputError if it cannot be written.
        """
        from .runner import write_outcomes

        write_outcomes(self.case, [self.outcome], Path(out))

    def to_pandas(self, table: str = "joint") -> Any:
        """joint or history as a pandas DataFrame.

        Raises ImportError without pandas, InputError for another table.
        """
        tables = {"joint": self.results.joint, "history": self.results.history}
        if table not in tables:
            raise InputError(f"table = {table}: must be one of {', '.join(tables)}")
        import pandas

        return pandas.DataFrame(tables[table])

    def __repr__(self) -> str:
        last = self.results.last
        reached = f", level {last['level']:.6g} m" if last else ""
        return f"<Run of {self.case.name}: {self.verdict}{reached}>"


def records(table: Table) -> np.recarray:
    """A table as a record array."""
    return np.rec.fromarrays(list(table.values()), names=list(table))


def run(source: Case | str | Path, *, engine: str = "auto") -> Run:
    """Solve a case; nothing is written. A published case with several uplifts: the first one.

    engine: condensed (auto), or getdp. Raises InputError, RunError; an interrupted run raises
    KeyboardInterrupt.
    """
    chosen = source if isinstance(source, Case) else case(source)
    single = replace(chosen, also_uplift=())
    scenes = accuracy.solve(single, engine_of(single, engine), lambda scene, time: None, True)
    outcome = next(scenes)
    if outcome.error:
        raise outcome.error
    outcome.result.info.setdefault("wall_seconds", {})
    return Run(outcome)


@dataclass(frozen=True)
class Step:
    """A converged step of `fill`."""

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


def fill(source: Case | str | Path) -> Iterator[Step]:
    """Solve a case step by step in the condensed engine; stop whenever you like.

    Raises InputError, RunError.
    """
    chosen = source if isinstance(source, Case) else case(source)
    stepper = LoadStepper(chosen)
    for state in stepper.steps():
        yield Step(state, stepper.history.last)


def check(cases: Sequence[Case]) -> list[SafetyCheck]:
    """Safety factors of load combinations, by the finite elements and by the gravity method.

    `rows` of a check are those of check.csv, `why` is empty if nothing fails, `notes` are what to
    know. Raises InputError, RunError.
    """
    from .studies.check import check_has_section, compare_joints

    for one in cases:
        check_has_section(one)
    return [check for one in cases for check in compare_joints(run(one).results)]


@dataclass(frozen=True)
class Critical:
    """A critical value."""

    answer: CriticalValue
    search: Search

    @property
    def value(self) -> float | None:
        """The largest load or smallest strength with an equilibrium; None if there is no limit."""
        return self.answer.value

    @property
    def mode(self) -> str:
        """How the dam fails beyond it: sliding, overturning, ..."""
        return self.answer.mode

    @property
    def confirmed(self) -> bool:
        """Whether a mechanism or statics confirms it."""
        return self.answer.confirmed

    @property
    def statement(self) -> list[str]:
        """The lines that `damjoint critical` prints."""
        return self.answer.lines(self.search)

    @property
    def equilibria(self) -> np.recarray:
        """critical.csv: a row per equilibrium of each trial."""
        from .studies.critical import table

        return records(table(self.search))


def critical(
    source: str | Path = "dam",
    of: str = "level",
    *,
    levels: Sequence[float] | float | None = None,
    tail_levels: Sequence[float] | float | None = None,
    **parameters: Value,
) -> Critical:
    """The level, strength, uplift or parameter at which no equilibrium is left.

    source, levels, tail_levels, parameters: as of `case`; of: level, strength, uplift or the name
    of a parameter. Raises InputError, RunError.
    """
    from .studies.critical import Search

    search = Search(str(source), of, parameters, as_list(levels), as_list(tail_levels))
    return Critical(search.run(), search)
