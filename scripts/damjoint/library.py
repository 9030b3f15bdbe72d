"""The interface for Python: `import damjoint as dj`.

    case = dj.case("dam", levels=[30, 40, 45], mu=0.8)
    run = dj.run(case)
    run.verdict, run.joint.at(level=45).opening.max()

Results have `plot()`, the picture of the command, and `to_pandas()`, a table as a DataFrame.

Names and units are those of the parameters and of the tables (reference/parameters.md, results.md).
Only `Run.save` writes to disk.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from . import LIBRARY, ROUND_OFF, InputError, RunError, accuracy
from .arrays import Array, Table, Value
from .engines import Outcome, engine_of
from .engines.condensed.solve import threads_of
from .input.case import Case as Case
from .input.case_names import is_name
from .input.resolve import load, varied
from .laws import LAWS as LAWS
from .laws import Law as Law
from .model.fields import Solution
from .model.results import (
    HISTORY,
    IN_TIME,
    LATERAL,
    MODES,
    Columns,
    Results,
    history_columns,
    joint_columns,
    quake_columns,
)
from .progress import track
from .python_words import all_in_python, in_python, speaks_python
from .solver.load_stepper import LoadStepper
from .solver.state import State
from .statics.hints import hints
from .statics.notes import notes
from .statics.statement import statement
from .statics.verdict import verdict
from .studies.plan import Plan, cases_of, column_of, in_file, listed, plan_with
from .studies.plan import Sample as Sample
from .threads import limited_threads

if TYPE_CHECKING:  # loaded when they are used, with what they draw with
    import pandas
    import xarray
    from matplotlib.figure import Figure

    from .dynamics.modes import NaturalModes
    from .studies.calibrate import Calibration
    from .studies.check import SafetyCheck
    from .studies.critical import Search
    from .studies.critical_value import CriticalValue
    from .studies.quake_result import QuakeTables
    from .studies.reliability import CriticalLevels
    from .studies.reliability import Reliability as OfJoint

#: What `import damjoint` offers.
__all__ = [*LIBRARY]


@speaks_python
def case(
    source: Case | str | Path = "dam",
    *,
    levels: Sequence[float] | float | None = None,
    tail_levels: Sequence[float] | float | None = None,
    steps: int | None = None,
    accuracy: str | None = None,
    record: str | Path | None = None,
    name: str | None = None,
    **parameters: Value,
) -> Case:
    """A case of the package, of a case file, or a variation of another case.

    What is not given is that of the source. A case is a mapping of all parameters: `case["mu"]` or
    `case.mu` is a value, `"mu" in case`, `case.keys()`; printed, it shows what differs from the
    defaults. `case.law` is the joint law itself, `case["law"]` its name.

    Args:
        source: letter or name of a case of the package, path of a case file, or a case.
        levels: of the reservoir [m] at t = 1, 2, ...
        tail_levels: of the tailwater [m] at t = 1, 2, ..., or the same at all times.
        steps: equal load steps between two levels.
        accuracy: coarse, standard, fine or a percentage; mesh and steps are refined for it.
        record: CSV of the ground's acceleration, for `quake`.
        name: of the case in tables and of its files, by default that of the source.
        parameters: by name, in SI units, as in reference/parameters.md, or as a text with a unit,
            "20*GPa".

    Raises:
        InputError: name, value, and what is allowed.

    Example:
        >>> dam = case("dam", levels=[30, 40], mu=0.8, n_joint=10)
        >>> dam["mu"], dam.levels
        (0.8, (30.0, 40.0))
        >>> dam
        dam: levels 30, 40 m; n_joint = 10
    """
    loading = as_list(levels), as_list(tail_levels), steps, accuracy
    if isinstance(source, Case):
        result = varied(source, parameters, *loading)
    else:
        result = load(str(source), parameters, *loading)
    if name is not None and not is_name(name):
        raise InputError(f"name = {name!r}: must be a text that can be the name of a file")
    path = result.record if record is None else Path(record)
    return replace(result, name=result.name if name is None else name, record=path)


def as_case(source: Case | str | Path) -> Case:
    """A case as it is, or that of a name or path."""
    return source if isinstance(source, Case) else case(source)


def noted(case: Case, frames: int = 4) -> Case:
    """The case, after a warning for each note on it: settings without effect, loads in part, ...

    frames: from here to the user's call; a function that `speaks_python` is two.
    """
    for note in notes(case):
        warnings.warn(f"{case.name}: {in_python(note)}", stacklevel=frames)
    return case


def as_list(levels: Sequence[float] | float | None) -> list[float] | None:
    """Levels as a list, also of a single one."""
    return None if levels is None else np.atleast_1d(levels).tolist()


class JointTable(np.recarray):
    """Rows of joint.csv as a record array: a column by its name, and by some names in full.

    Signs: opening, tension and the downstream direction are positive.

    Example:
        >>> rows = run(case("dam", levels=[30, 40], n_joint=10)).joint.at(level=40)
        >>> len(rows), bool(rows.normal_stress.max() < 0)
        (21, True)
    """

    @property
    def opening(self) -> Array:
        """Opening [m]: `delta_n`, or 0 where the joint is compressed."""
        return np.asarray(np.maximum(self["delta_n"], 0.0))

    @property
    def tangential_jump(self) -> Array:
        """Displacement of the dam along x relative to the foundation [m]: `delta_t1`."""
        return np.asarray(self["delta_t1"])

    @property
    def normal_stress(self) -> Array:
        """Effective normal stress [Pa]: `sigma_n_eff`."""
        return np.asarray(self["sigma_n_eff"])

    @property
    def shear_stress(self) -> Array:
        """Shear stress along x [Pa]: `tau_1`."""
        return np.asarray(self["tau_1"])

    @property
    def pressure(self) -> Array:
        """Water pressure in the joint [Pa]: `p`."""
        return np.asarray(self["p"])

    @property
    def distance(self) -> Array:
        """Distance from the heel along the joint [m]: `s`."""
        return np.asarray(self["s"])

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


class WithTables:
    """A result with tables; the first one is that of `units` and, by default, of `to_pandas`."""

    @property
    def by_name(self) -> Mapping[str, tuple[Mapping[str, Any], Columns]]:
        """Each table by its name: values by column; unit and meaning of columns."""
        raise NotImplementedError

    def named(self, name: str) -> tuple[Mapping[str, Any], Columns]:
        """A table by its name. Raises InputError if there is none."""
        if name not in self.by_name:
            raise InputError(f"table = {name}: must be one of {', '.join(self.by_name)}")
        return self.by_name[name]

    @property
    def units(self) -> dict[str, str]:
        """Units of the columns."""
        table, columns = next(iter(self.by_name.values()))
        return {name: columns[name][0] for name in table if name in columns}

    def to_pandas(self, table: str = "") -> pandas.DataFrame:
        """A table, by default the first one, as a DataFrame with units in its `attrs`.

        Raises ImportError without pandas, InputError if there is no table of this name.
        """
        values, columns = self.named(table or next(iter(self.by_name)))
        data_frame = optional("pandas").DataFrame(dict(values))
        data_frame.attrs["units"] = {n: columns[n][0] for n in values if n in columns}
        return data_frame


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
        from .pictures.run_picture import picture

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
        from .runner import write_outcomes

        write_outcomes(self.case, [self.outcome], Path(out))

    @property
    def by_name(self) -> Mapping[str, tuple[Table, Columns]]:
        """The tables joint and history."""
        results, case = self.results, self.case
        return {
            "joint": (results.joint, joint_columns(case)),
            "history": (results.history, history_columns(case)),
        }

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

        from .post.summary import levels_table

        levels = levels_table(self.results)
        table = tabulate(levels.rows, levels.heads, tablefmt="html", disable_numparse=True)
        return f"<p>{escape(repr(self))}</p>{table}"


def records(table: Mapping[str, Any]) -> np.recarray:
    """A table as a record array."""
    arrays = {name: np.asarray(column) for name, column in table.items()}
    return np.rec.fromarrays(arrays.values(), dtype=[(n, a.dtype) for n, a in arrays.items()])


def displayed(figure: Figure) -> Figure:
    """A figure with its ticks, after the backend is loaded by which a notebook shows it."""
    from matplotlib import pyplot

    from .pictures.drawing import picture_style

    pyplot.draw_if_interactive()
    with picture_style():
        figure.draw_without_rendering()
    return figure


def attributes(column: tuple[str, str]) -> dict[str, str]:
    """Unit and meaning of a column as attributes of a variable of xarray."""
    unit, meaning = column
    return {"units": unit, "long_name": meaning}


def optional(package: str) -> ModuleType:
    """A package that damjoint does not require. Raises ImportError if it is not installed."""
    from importlib import import_module

    try:
        return import_module(package)
    except ImportError:
        raise ImportError(f"{package} is not installed: pip install {package}") from None


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
    return solved(noted(as_case(source)), engine)


def solved(case: Case, engine: str = "auto") -> Run:
    """See `run`; without notes."""
    single = replace(case, also_uplift=())
    scenes = accuracy.solve(single, engine_of(single, engine), lambda scene, time: None, True)
    outcome = next(scenes)
    if outcome.error:
        raise outcome.error
    outcome.result.info.setdefault("wall_seconds", {})
    return Run(outcome)


@dataclass(frozen=True, repr=False)
class Step:
    """A converged step of `fill`.

    Example:
        >>> step = next(fill(case("dam", levels=30, n_joint=10)))
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


def fill(source: Case | str | Path) -> Iterator[Step]:
    """Solve a case with the condensed engine and yield each converged step.

    The computation stops where the loop over the steps ends.

    Args:
        source: a case, or its name or path, see `case`.

    Raises:
        InputError: bad input.
        RunError: a step could not be computed.

    Example:
        >>> [step.level for step in fill(case("dam", levels=[30, 40], n_joint=10))]
        [30.0, 40.0]
    """
    case = noted(as_case(source), 3)
    threads = threads_of(case)
    with limited_threads(threads):
        stepper = LoadStepper(case)
    steps = stepper.steps()
    while True:
        with limited_threads(threads):  # not in the loop over the steps
            state = next(steps, None)
        if state is None:
            return
        yield Step(state, stepper.history.last)


@dataclass(frozen=True, repr=False)
class Checks(WithTables, Sequence["SafetyCheck"]):
    """Safety checks, made by `check`: one for each case and joint.

    Of each check, `rows` are those of check.csv, `why` is the reason if it fails or is not judged,
    else empty, and `notes` are remarks on the result.

    Example:
        >>> usual = case("dam", levels=40, n_joint=10, required_SSF=1.5, name="usual")
        >>> checks = check([usual, case(usual, k_h=0.2, name="earthquake")])
        >>> [(one.case.name, one.rows[0]["verdict"]) for one in checks]
        [('usual', 'pass'), ('earthquake', 'fail')]
    """

    #: of each case, its results and the checks of its joints
    cases: Sequence[tuple[Results, list[SafetyCheck]]]

    @overload
    def __getitem__(self, number: int) -> SafetyCheck: ...

    @overload
    def __getitem__(self, number: slice) -> list[SafetyCheck]: ...

    def __getitem__(self, number: int | slice) -> SafetyCheck | list[SafetyCheck]:
        return [check for _, checks in self.cases for check in checks][number]

    def __len__(self) -> int:
        return sum(len(checks) for _, checks in self.cases)

    @property
    def rows(self) -> np.recarray:
        """check.csv: a row per case, joint and method, and one of the methods' difference."""
        return records(self.named("rows")[0])

    @property
    def by_name(self) -> Mapping[str, tuple[Mapping[str, Any], Columns]]:
        """The table rows."""
        from .studies.check import CHECK

        return {"rows": (by_column([row for check in self for row in check.rows]), CHECK)}

    def plot(self, number: int = 0) -> Figure:
        """The picture of a case, by its number from 0, as `damjoint check` writes it.

        Raises InputError for a user's own geometry, which has none.
        """
        from .pictures.check_picture import figure_of_check
        from .studies.check_study import picture_content

        result, checks = self.cases[number]
        if result.case.geometry:
            raise InputError(
                f"case {result.case.name}: must be a section by parameters to be drawn"
            )
        return displayed(figure_of_check(picture_content(result, checks)))

    def __repr__(self) -> str:
        return "\n".join(map(repr, self))


@speaks_python
def check(cases: Case | str | Path | Sequence[Case | str | Path]) -> Checks:
    """Safety factors of a case or of several, by the finite elements and by the gravity method.

    Each is computed up to its last level. The result is a sequence of checks, see `Checks`.

    Args:
        cases: the load combinations, or a single one; cases, or their names or paths, see `case`.

    Raises:
        InputError: bad input.
        RunError: a case could not be computed.

    Example:
        >>> (base,) = check(case("dam", levels=40, n_joint=10, required_SSF=1.1))
        >>> [(row["answer"], row["verdict"]) for row in base.rows][:2]
        [('finite elements', 'pass'), ('gravity method', 'pass')]
    """
    from .studies.check import compare_joints

    listed = [cases] if isinstance(cases, Case | str | Path) else cases
    combinations = [as_case(combination) for combination in listed]
    for combination in combinations:
        noted(combination)
    results = [solved(combination).results for combination in combinations]
    return Checks([(result, compare_joints(result)) for result in results])


@dataclass(frozen=True, repr=False)
class Critical(WithTables):
    """A critical value, made by `critical`.

    Example:
        >>> limit = critical("dam", levels=40, n_joint=10, law="friction", adhesion=0.0)
        >>> round(limit.value, 1), limit.equilibria.dtype.names[:3]
        (46.1, ('trial', 'value', 'stands'))
    """

    answer: CriticalValue
    search: Search

    @property
    def value(self) -> float | None:
        """The largest load or smallest strength with an equilibrium; None if there is no limit."""
        return None if self.answer.value is None else float(self.answer.value)

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
        from .studies.critical_study import printed_lines

        return all_in_python(printed_lines(self.answer, self.search))

    @property
    def equilibria(self) -> np.recarray:
        """critical.csv: a row per equilibrium of each trial."""
        return records(self.named("equilibria")[0])

    def plot(self) -> Figure:
        """The picture of the search, as `damjoint critical` writes it."""
        from .studies.critical_picture import figure_of
        from .studies.critical_study import content

        return displayed(figure_of(content(self.search, self.answer)))

    @property
    def by_name(self) -> Mapping[str, tuple[Mapping[str, Any], Columns]]:
        """The table equilibria."""
        from .studies.critical_study import table
        from .studies.failure_path import critical_columns

        columns = critical_columns(self.search.case) | {"value": (self.search.unit.strip(), "")}
        return {"equilibria": (table(self.search), columns)}

    def __repr__(self) -> str:
        return "\n".join(self.statement)


@speaks_python
def critical(
    source: Case | str | Path = "dam",
    of: str = "level",
    *,
    levels: Sequence[float] | float | None = None,
    tail_levels: Sequence[float] | float | None = None,
    **parameters: Value,
) -> Critical:
    """The level, strength, uplift or parameter beyond which there is no equilibrium.

    Args:
        source: a case, or its name or path, see `case`. If it has an accuracy, the mesh is that
            which its levels require.
        of: level [m], strength (the factor that divides mu, adhesion, sigma_max and the fracture
            energies), uplift (effectiveness of the drains) or the name of a parameter.
        levels, tail_levels, parameters: changes of the case, see `case`.

    Raises:
        InputError: bad input, or a case in which there is nothing to vary.
        RunError: the case could not be computed.

    Example:
        >>> dry = case("dam", levels=40, n_joint=10, law="friction", adhesion=0.0)
        >>> limit = critical(dry)
        >>> limit.mode, limit.confirmed
        ('sliding', True)
    """
    from .studies.critical import Search

    changed = varied(as_case(source), parameters, as_list(levels), as_list(tail_levels))
    chosen = noted(changed)
    search = Search(on_fixed_mesh(chosen), of)
    return Critical(search.run(), search)


def on_fixed_mesh(chosen: Case) -> Case:
    """The case without its accuracy, on the mesh that this requires."""
    from .studies.sweep import meshed

    return meshed(chosen)[0] if chosen.accuracy else chosen


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
    def rows(self) -> np.recarray:
        """quake.csv: a row per time step."""
        return records(self.tables.rows)

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
        from .studies.quake_picture import figure
        from .studies.quake_result import QuakeResult

        if not isinstance(self.tables, QuakeResult):
            raise InputError("engine = getdp: must be condensed for a picture of the earthquake")
        return displayed(figure(self.tables))

    @property
    def by_name(self) -> Mapping[str, tuple[Table, Columns]]:
        """The tables rows, history, joint and, not by GetDP, frames."""
        static, frames, case = self.tables.static, getattr(self.tables, "frames", None), self.case
        joint = joint_columns(case)
        in_time = {"frames": (frames.joint, joint | {"time": ("s", "")})} if frames else {}
        return {
            "rows": (self.tables.rows, quake_columns(case)),
            "history": (static.history, history_columns(case)),
            "joint": (static.joint, joint),
            **in_time,
        }

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
        record: CSV of the ground's acceleration (default: that of the case).
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
    from .studies import quake_study

    chosen = as_case(source)
    chosen = noted(chosen if record is None else replace(chosen, record=Path(record)))
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
    def rows(self) -> np.recarray:
        """modes.csv: a row per mode of each water on each rock."""
        return records(self.natural.table)

    @property
    def frequencies(self) -> Array:
        """Frequencies [Hz] with the reservoir on massless rock, as in an earthquake."""
        return np.array([mode.frequency for mode in self.natural.variants[0].modes])

    @property
    def by_name(self) -> Mapping[str, tuple[Mapping[str, Any], Columns]]:
        """The table rows."""
        return {"rows": (self.natural.table, MODES)}

    def plot(self) -> Figure:
        """The picture of the modes, as `damjoint modes` writes it."""
        from .studies.modes_study import figure

        return displayed(figure(self.natural))

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
    from .studies import modes_study

    if number < 1:
        raise InputError(f"number = {number}: must be an integer >= 1")
    return Modes(modes_study.compute(noted(as_case(source)), number, progress=False))


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
    def rows(self) -> np.recarray:
        """A row per combination: the varied values (a level as level_requested), the last row of
        history.csv, failed, verdict, statement, the critical value; nan without an equilibrium.
        """
        return records(self.named("rows")[0])

    @property
    def probability(self) -> np.recarray:
        """Of a sample: its probability of failure for each combination of the varied values, and
        the limits of the 95 % interval.
        """
        from .studies.outcome import probabilities

        return self.statistics(probabilities(self.plan, self.texts))

    @property
    def sensitivity(self) -> np.recarray:
        """Of a sample: rank correlation of each sampled parameter with the outcomes."""
        from .studies.outcome import sensitivities

        return self.statistics(sensitivities(self.plan, self.texts))

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
        from .studies.chart import figure_of, heading

        cases = [] if self.plan.sampled else [case for _, case in cases_of(self.case, self.plan)]
        title = heading(self.case, self.plan, len(self.rows))
        return displayed(figure_of(self.plan, self.texts, cases, title))

    @property
    def by_name(self) -> Mapping[str, tuple[Mapping[str, Any], Columns]]:
        """The table rows."""
        from .studies.chart import quantity
        from .studies.quake_summary import QUAKE_UNITS

        units = QUAKE_UNITS | {name: u for name, (u, _) in history_columns(self.case).items()}
        units |= {column_of(name): quantity(name)[1] for name in self.plan.names}
        if self.plan.critical:
            units[self.plan.critical_columns[0]] = quantity(self.plan.critical)[1]
        rows = {name: column_array(name, values) for name, values in self.table.items()}
        return {"rows": (rows, {name: (unit, "") for name, unit in units.items()})}

    def __repr__(self) -> str:
        fails = sum(map(bool, self.table["failed"]))
        return f"sweep of {', '.join(self.plan.names)}: {len(self.rows)} rows, {fails} fail"


def column_array(name: str, values: list[Value]) -> np.ndarray:
    """A column of a sweep; an empty cell of a result that is a number becomes nan."""
    from .studies.quake_summary import QUAKE_UNITS

    numeric = name in HISTORY | LATERAL | IN_TIME | QUAKE_UNITS or name.startswith("critical_")
    return np.array([np.nan if numeric and value == "" else value for value in values])


def by_column(rows: Sequence[Mapping[str, Value]]) -> dict[str, list[Value]]:
    """Rows of the same columns as {column: values}."""
    return {name: [row[name] for row in rows] for name in rows[0]}


@speaks_python
def sweep(
    source: Case | str | Path = "dam",
    *,
    sample: Sample | None = None,
    tie: Mapping[str, str] | None = None,
    critical: str = "",
    quake: float | None = None,
    jobs: int | None = None,
    progress: bool = False,
    **values: Sequence[Value] | Value,
) -> Sweep:
    """Solve a case with all combinations of listed values, each with the entire sample.

    Nothing is written. A row that could not be computed has the verdict `failed`.

    Args:
        source: a case, or its name or path, see `case`. If it has an accuracy, the mesh of all
            rows is that which the case itself requires.
        sample: random values, such as `Sample(100, {"mu": "normal(0.8,0.1)"})`.
        tie: parameters computed from the others, such as `{"adhesion": "2e5*mu"}`.
        critical: also find the critical level, strength, ... of each row, see `critical`.
        quake: each row is the earthquake of the case's record; it fails if the residual slip
            exceeds this limit [m].
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
    from .processes import check_jobs
    from .studies.sweep import compute, notes_on_rows, planned

    check_jobs(jobs)
    if not values and not sample:
        raise InputError("sweep: must have values or a sample, such as mu=[0.8, 1.0]")
    if quake is not None and not quake > 0:
        raise InputError(f"quake = {quake}: must be a slip > 0 m")
    axes = [(name, listed(name, np.atleast_1d(v).tolist())) for name, v in values.items()]
    plan = plan_with(axes, list((tie or {}).items()), sample, {}, critical)
    plan = replace(plan, slip_limit=quake)
    base = noted(as_case(source))
    meshed = on_fixed_mesh(base)
    rows = list(planned(meshed, plan))
    tasks = {key: task for key, _, task in rows}
    computed = compute(tasks, jobs)
    for note in notes_on_rows(base, [task.case for task in tasks.values()]):
        warnings.warn(f"{base.name}: {in_python(note)}", stacklevel=3)
    results = dict(track(computed, "sweep", len(tasks)) if progress else computed)
    cells = [{column_of(n): v for n, v in row.items()} | results[key] for key, row, _ in rows]
    return Sweep(plan, by_column(cells), meshed)


@dataclass(frozen=True, repr=False)
class Reliability(WithTables):
    """The probability that the water rises beyond the critical level, made by `reliability`.

    Example:
        >>> dry = case("dam", levels=[30, 36], n_joint=10, order=1, law="friction", adhesion=0.0)
        >>> likely = {"mu": "lognorm(0.12,scale=0.74)", "level": "gumbel_r(38.5,0.6)"}
        >>> result = reliability(dry, **likely, samples=50, jobs=1)
        >>> round(result.beta, 2), result.words
        (2.71, ['FORM agrees with the samples'])
        >>> critical(result.design_case).mode
        'sliding'
    """

    #: of each of several joints if no other could fail, then that of all
    results: Sequence[OfJoint]
    levels: CriticalLevels

    @property
    def case(self) -> Case:
        """The case with the values that are not uncertain."""
        return self.levels.case

    @property
    def beta(self) -> float:
        """Reliability index by FORM [-]."""
        return self.results[-1].beta

    @property
    def rows(self) -> np.recarray:
        """A row per joint if no other could fail, and one of all: joint (empty: all), beta,
        probabilities form, breitung, tvedt (SORM), sampled with the limits low, high of its 95 %
        interval; nan where a method has none.
        """
        return records(self.named("rows")[0])

    @property
    def design(self) -> Mapping[str, float]:
        """The design point: the most probable values with which the dam fails, by name."""
        return self.results[-1].design

    @property
    def importance(self) -> Mapping[str, float]:
        """Importance factors by name; their sum is 1."""
        return self.results[-1].importance

    @property
    def design_case(self) -> Case:
        """The case of the design point, filled to its level."""
        from .studies.reliability import design_case

        return design_case(self.levels, self.results[-1])

    @property
    def words(self) -> list[str]:
        """Whether the methods agree, of each row."""
        return [one.words() for one in self.results]

    @property
    def by_name(self) -> Mapping[str, tuple[Mapping[str, Any], Columns]]:
        """The table rows."""
        names = "joint", "beta", "form", "breitung", "tvedt", "sampled", "low", "high"
        cells = {n: [getattr(one, n) for one in self.results] for n in names}
        table = {n: np.array([np.nan if v is None else v for v in cells[n]]) for n in names}
        return {"rows": (table, dict.fromkeys(names[1:], ("-", "")))}

    def __repr__(self) -> str:
        whole = self.results[-1]
        share = whole.sampled if whole.samples else whole.form
        return f"{self.case.name}: probability of failure {share:.3g}, beta by FORM {self.beta:.4g}"


@speaks_python
def reliability(
    source: Case | str | Path = "dam",
    *,
    correlate: Sequence[str] = (),
    tie: Mapping[str, str] | None = None,
    samples: int = 500,
    seed: int = 0,
    jobs: int | None = None,
    **distributions: str,
) -> Reliability:
    """The probability that the water rises beyond the critical level, by FORM, SORM and importance
    sampling; needs openturns. Nothing is written.

    Args:
        source: a case, or its name or path, see `case`; its last level counts unless `level` is
            uncertain.
        correlate: rank correlations, "A,B=R" each.
        tie: parameters computed from the others, such as `{"adhesion": "2e5*mu"}`.
        samples: critical levels of the importance sampling, in whole blocks of 50; 0: none.
        seed: of the random numbers.
        jobs: number of processes (default: one per core).
        distributions: of scipy.stats by parameter, as texts, "normal(0.8,0.1)"; `level` [m]; of one
            joint by `**{"lift 25 m.mu": "normal(0.7,0.1)"}`.

    Raises:
        InputError: bad input, a value that a parameter does not allow, or no openturns.
        RunError: a process was killed.

    Example:
        >>> dry = case("dam", levels=[30, 36], n_joint=10, order=1, law="friction", adhesion=0.0)
        >>> result = reliability(dry, mu="normal(0.8,0.06)", level="normal(38,1)", samples=0)
        >>> result.rows.joint.tolist(), sorted(result.importance)
        ([''], ['level', 'mu'])
    """
    from .processes import check_jobs
    from .studies.reliability import CriticalLevels, Variables, analysed

    check_jobs(jobs)
    variables = Variables(distributions, correlate, tie or {})
    levels = CriticalLevels(on_fixed_mesh(noted(as_case(source))), variables, jobs)
    return Reliability(list(analysed(levels, samples, seed, lambda message: None)), levels)


@speaks_python
def calibrate(
    source: Case | str | Path,
    measured: str | Path,
    free: Sequence[str],
    *,
    jobs: int | None = None,
    progress: bool = False,
) -> Calibration:
    """Find the values of parameters with which a case computes what was measured.

    Nothing is written. The result has `estimates`, `intervals` of 95 % (parameters, 2),
    `correlation`, `residuals` over the standard deviations (series, readings), `undetermined` and
    `findings`, what the residuals show against the model; `case` is the calibrated one.

    Args:
        source: a case, or its name or path, see `case`.
        measured: CSV with a row per reading: level [m], if wanted tail_level and date, and of each
            instrument a column of history.csv, or head_S, the piezometric head [m] S m from the
            heel, with its standard deviations in NAME_sd; SI units.
        free: parameters, each as "K_N", with limits "K_N=1e9:1e12" or with a prior
            "mu=normal(0.8,0.1)"; they start at the values of the case.
        jobs: number of processes (default: one per core).
        progress: show a bar, or where there is no terminal a line every ten seconds.

    Raises:
        InputError: bad input.
        RunError: the dam has no equilibrium at a reading with the start values.

    Example:
        >>> from tempfile import NamedTemporaryFile
        >>> file = NamedTemporaryFile("w", suffix=".csv")
        >>> file.write("level,head_14,head_14_sd\\n20,9,0.5\\n30,13,0.5\\n").__class__
        <class 'int'>
        >>> file.flush()
        >>> dam = case("dam", n_joint=10, uplift="drained", drain_x=14)
        >>> calibrate(dam, file.name, ["drain_effectiveness"], jobs=1).free[0].name
        'drain_effectiveness'
    """
    from .studies.calibrate import free_of
    from .studies.calibrate_study import compute
    from .studies.measurements import read

    chosen = noted(as_case(source))
    measurements = read(Path(measured), chosen)
    return compute(chosen, free_of(chosen, list(free)), measurements, jobs, progress)


@speaks_python
def sensitivity(source: Case | str | Path, *names: str, critical: bool = False) -> np.recarray:
    """Derivatives with parameters, by direct differentiation of the steps; nothing is written.

    A row per parameter and level: parameter, unit, value, level [m], kink (1: they are one-sided),
    and the derivatives, in SI units per unit of the parameter, of columns of history.csv or of
    critical_level.

    Args:
        source: a case, or its name or path, see `case`.
        names: parameters, or one of a joint, "lift 25 m.mu"; none: all that have an effect.
        critical: of the critical level instead of the results of a run.

    Raises:
        InputError: a parameter that has no derivative.
        RunError: a state after unstable crack growth, or no critical level.

    Example:
        >>> dry = case("dam", levels=[30, 36], n_joint=10, order=1, law="friction", adhesion=0.0)
        >>> rates = sensitivity(dry, "mu", critical=True)
        >>> rates.parameter.tolist(), bool(rates.critical_level > 0)
        (['mu'], True)
    """
    from .studies.critical import Search
    from .studies.sensitivity import ALL, names_of, of_point, of_run, table

    chosen = on_fixed_mesh(noted(as_case(source)))
    listed_names = names_of(chosen, ",".join(names) or ALL)
    if not critical:
        return records(table(of_run(chosen, listed_names)))
    answer = Search(replace(chosen, all_steps=True), "level").find()
    if answer.value is None or answer.point is None:
        raise RunError(f"no critical level: {answer.doubt}")
    return records(table(of_point(answer.point, listed_names)))
