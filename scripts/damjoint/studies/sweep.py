"""Sweep: one row per combination of a plan's values, resumable, on all cores or a dask cluster."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, TypeAlias

from .. import InputError, RunError, accuracy, runner
from ..arrays import Value, Values
from ..dynamics import record_files
from ..engines import check_engine
from ..input.case import Case
from ..input.refinement import first_mesh
from ..input.resolve import equal_steps, resolve, with_drive_times
from ..input.source import Source
from ..joint.interface import Interface, interface_of
from ..model.results import history_columns
from ..post.folder import case_entries
from ..post.summary import Draw, aligned, fitted
from ..processes import ProcessKilled, as_finished, check_jobs, process_count
from ..progress import Progress, track
from ..solver.load_stepper import LoadStepper
from ..statics.limit import mechanism
from ..statics.notes import notes_on_settings, remarks
from ..statics.statement import statement
from ..statics.verdict import failed, verdict
from ..threads import limited_threads
from . import keys, quake, quake_summary
from .critical import QUICK, Search
from .plan import (
    CHART,
    FRAGILITY,
    STATISTICS,
    Limits,
    Plan,
    Row,
    beside,
    column_of,
    in_file,
    planned_cases,
    quantity_of,
)
from .quake_summary import NO_FRICTION, NOT_AT_REST, QUAKE_COLUMNS
from .result_file import rows_session


def row_key(case: Case, plan: Plan) -> str:
    """The key of a row in a result file: of all that decides it, and what a plan computes of it."""
    given = case.source.overrides if case.source else {}
    quick = sorted(QUICK.keys() & given.keys()) if plan.critical else []
    others = [bool(plan.sampled), plan.critical, quick, plan.quake and plan.quake.listed]
    if plan.quake:
        others.append(record_files.record_bytes(case.record, case.record_vertical))
    return keys.study_key(case, *others)


#: Columns of the outcome: whether the dam fails (1, the exit code of `damjoint run`) or stands (0),
#: its verdict and statement.
OUTCOME = ("failed", "verdict", "statement")

#: The verdict of a row whose computation has raised an error.
ERROR = "failed"

#: Verdicts from which it is not known whether there is an equilibrium.
UNDECIDED = (ERROR, "not converged", "interrupted", NOT_AT_REST, NO_FRICTION)

#: Limit of the rows that are computed together: they share the steps up to their common level.
MOST_TOGETHER = 8

#: Most bundles in a task of a scheduler.
MOST_IN_TASK = 50
#: Least tasks for each of its threads: bundles in a task are so few that there are these.
TASKS_PER_THREAD = 10

#: Solved cases that differ in levels only, by levels, tailwater and times.
Solved: TypeAlias = dict[tuple[tuple[float, ...], ...], LoadStepper]


def stepped(case: Case, solved: Solved, interface: Interface) -> LoadStepper:
    """The load steps of a case to its end, continued from its last level but one."""
    key = case.levels, case.tail_levels, case.times
    if key not in solved:
        before = case.before_last_level()
        stepper = (
            stepped(before, solved, interface).fork(case)
            if before
            else LoadStepper(case, interface)
        )
        stepper.run()
        solved[key] = stepper
    return solved[key]


@dataclass(frozen=True)
class Task:
    """The computation of one row."""

    case: Case
    #: whether load steps are omitted if the loads certainly exceed the strength of the joint
    quick: bool
    #: the search of its critical value, if there is one, and its columns
    search: Callable[[], Search] | None = None
    columns: Sequence[str] = ()
    #: as in Plan
    quake: Limits | None = None


def last_rows(tasks: list[Task]) -> list[dict[str, Value]]:
    """Rows of cases that differ in levels only: the columns of history.csv at the last level (empty
    if there is no equilibrium), the outcome, the critical value.
    """
    solved: Solved = {}
    with limited_threads(1):
        return [
            (quake_row(task, task.quake) if task.quake else last_row(task, solved))
            | critical_value(task)
            for task in tasks
        ]


def rows_of_bundles(
    rows_of: Callable[[list[Any]], list[dict[str, Value]]], bundles: list[list[Any]]
) -> list[dict[str, Value]]:
    """The rows of several bundles; rows_of: those of one."""
    return [row for tasks in bundles for row in rows_of(tasks)]


def last_row(task: Task, solved: Solved) -> dict[str, Value]:
    """The row of a case; an error is an outcome, and the sweep continues."""
    row: dict[str, Value] = dict.fromkeys(history_columns(task.case), "")
    try:
        interface = interface_of(task.case)
        mode, why = mechanism(task.case, interface) if task.quick else ("", "")
        if mode:
            return row | dict(zip(OUTCOME, (1.0, mode, why), strict=True))
        result = stepped(task.case, solved, interface).results()
    except Exception as error:
        return row | dict(zip(OUTCOME, (1.0, ERROR, error_message(error)), strict=True))
    outcome = float(failed(result)), verdict(result), statement(result)
    return row | result.last | dict(zip(OUTCOME, outcome, strict=True))


#: The verdicts of a row that exceeds a limit of one kind.
EXCEEDED = {"slip": "residual slip", "opening": "opening"}


def quake_row(task: Task, limits: Limits) -> dict[str, Value]:
    """The row of a case whose last level is followed by an earthquake: it fails if it exceeds one
    of the limits: the residual slip (or, if the dam is not at rest, that at the end), the opening,
    or that the dam stands after it. A dam that does not stand exceeds all of them.
    """
    case = task.case
    row: dict[str, Value] = dict.fromkeys([*history_columns(case), *QUAKE_COLUMNS], "")
    try:
        static, summary = quake.outcome_of(case)
    except Exception as error:
        return row | dict(zip(OUTCOME, (1.0, ERROR, error_message(error)), strict=True))
    row |= static.results().last | quake_summary.columns(case, summary)
    verdict, words = quake_summary.verdict(case, summary), quake_summary.statement(case, summary)
    exceeded = [kind for kind, limit in limits.listed if exceeds(row, verdict, kind, limit)]
    if exceeded and verdict in (quake_summary.STANDS, NOT_AT_REST):
        verdict = EXCEEDED[exceeded[0]]
    values = [f"{1e3 * v:.3g} mm{'' if k == 'slip' else f' {k}'}" for k, v in limits.listed if v]
    words = "; ".join([words, *([f"limit {', '.join(values)}"] if values else [])])
    fails = float(verdict != quake_summary.STANDS)
    return row | dict(zip(OUTCOME, (fails, verdict, words), strict=True))


def exceeds(row: Mapping[str, Value], verdict: str, kind: str, limit: float) -> bool | None:
    """Whether a row of an earthquake exceeds a limit of `Limits`; None if that is not known.

    A dam that is not at rest exceeds a slip by that at its end, or it is not known.
    """
    if verdict == quake_summary.NO_EQUILIBRIUM:
        return True
    if row["end_slip"] == "" or verdict == NO_FRICTION:
        return None
    at_rest = row["residual_slip"] != ""
    if kind == "opening":
        return float(row["peak_opening"]) > limit
    slip = abs(float(row["residual_slip" if at_rest else "end_slip"]))
    return True if kind == "slip" and slip > limit else False if at_rest else None


def error_message(error: Exception) -> str:
    """The message of an error in one line."""
    kind = "" if isinstance(error, RunError) else f"{type(error).__name__}: "
    return " ".join(f"{kind}{error}".split())


def critical_value(task: Task) -> dict[str, Value]:
    """The columns of a critical value, or of the error of its search."""
    if not task.search:
        return {}
    try:
        answer = task.search().find()
    except Exception as error:
        return dict(zip(task.columns, ("", "", 0.0, error_message(error)), strict=True))
    value = "" if answer.value is None else answer.value
    cells = value, answer.mode, float(answer.confirmed), answer.why or answer.doubt
    return dict(zip(task.columns, cells, strict=True))


def planned(case: Case, plan: Plan) -> Iterator[tuple[str, Values, Task]]:
    """Key, values and task of each row of a plan. Raises InputError."""
    rows = track(planned_cases(case, plan), "values of the rows", plan.number)
    for row, varied in rows:
        search = partial(search_of, varied, plan.critical) if plan.critical else None
        if plan.quake:
            quake.check(varied)
        if varied.geometry and varied.stores_water:
            check_engine(varied)  # checks the paths of the water
        task = Task(varied, bool(plan.sampled), search, plan.critical_columns, plan.quake)
        yield row_key(varied, plan), row, task


def source_of(case: Case) -> Source:
    """Where a case comes from. Raises InputError if it was read from the files of a run."""
    if case.source is None:
        raise InputError(f"case {case.name}: must be loaded from a case file")
    return case.source


def search_of(case: Case, quantity: str) -> Search:
    """The search of a row's critical value, with one step per level."""
    levels, tails, times = case.levels, case.tail_levels, equal_steps(len(case.levels), 1)
    source = replace(source_of(case), levels=levels, tail_levels=tails, steps=None)
    return Search(with_drive_times(replace(case, times=times, source=source)), quantity)


def bundles(tasks: dict[str, Task]) -> list[list[str]]:
    """Keys of cases that differ in levels only, at most MOST_TOGETHER: rows are written in time."""
    groups: dict[str, list[str]] = {}
    for key, task in tasks.items():
        same = replace(task.case, levels=(), tail_levels=(), times=())
        groups.setdefault(keys.study_key(same), []).append(key)
    return [
        group[i : i + MOST_TOGETHER]
        for group in groups.values()
        for i in range(0, len(group), MOST_TOGETHER)
    ]


def spread(
    tasks: dict[str, Task], jobs: int, scheduler: str | None
) -> Iterator[tuple[str, dict[str, Value]]]:
    """(key, row) of each finished task of a sweep, see `spread_bundles`."""
    with scheduler_client(scheduler) as client:
        yield from spread_bundles(last_rows, bundles(tasks), tasks, jobs, client)


def scheduler_client(scheduler: str | None) -> Any:
    """A client of dask of a scheduler at an address, None without one. Raises InputError."""
    if not scheduler:
        return contextlib.nullcontext()
    try:
        from dask.distributed import Client
    except ImportError:
        raise InputError(
            "--scheduler: needs dask.distributed; pip install 'damjoint[cluster]'"
        ) from None
    try:
        return Client(scheduler, timeout=10)
    except (OSError, ValueError) as error:
        raise InputError(
            f"--scheduler {scheduler}: no scheduler answers at this address ({error})"
        ) from None


def spread_bundles(
    rows_of: Callable[[list[Any]], list[dict[str, Value]]],
    work: list[list[str]],
    tasks: Mapping[str, Any],
    jobs: int,
    client: Any,
) -> Iterator[tuple[str, dict[str, Value]]]:
    """(key, row) of each finished task: in this process, in `jobs` processes, or by a client.

    rows_of: the rows of the tasks of a bundle; work: the keys of each bundle. Raises InputError,
    RunError.
    """
    chosen = [[tasks[key] for key in keys] for keys in work]
    if client:
        from dask.distributed import as_completed

        threads = max(sum(client.nthreads().values()), 1)
        size = min(max(len(work) // (TASKS_PER_THREAD * threads), 1), MOST_IN_TASK)
        futures = {}
        for i in range(0, len(work), size):
            keys = list(chain.from_iterable(work[i : i + size]))
            name = f"damjoint-{hashlib.sha256(' '.join(keys).encode()).hexdigest()[:32]}"
            future = client.submit(rows_of_bundles, rows_of, chosen[i : i + size], key=name)
            futures[future] = keys
        for future in as_completed(futures):
            yield from zip(futures[future], future.result(), strict=True)
    elif jobs == 1 or len(work) == 1:
        for keys, some in zip(work, chosen, strict=True):
            yield from zip(keys, rows_of(some), strict=True)
    else:
        for number, rows in as_finished(rows_of, chosen, jobs):
            yield from zip(work[number], rows, strict=True)


class PlannedRows:
    """The rows of a plan for a case, to be computed."""

    def __init__(self, case: Case, plan: Plan) -> None:
        """Raises InputError."""
        self.case, self.plan = case, plan
        #: key, values and task of each
        self.planned = list(planned(case, plan))
        of_quake = QUAKE_COLUMNS if plan.quake else ()
        #: columns of the results, of which some have numbers only
        self.results = [*history_columns(case), *of_quake, *OUTCOME, *plan.critical_columns]
        self.numeric = [*history_columns(case), "failed"]

    @property
    def cases(self) -> list[Case]:
        """Their cases."""
        return [task.case for _, _, task in self.planned]

    @property
    def notes(self) -> list[str]:
        """The notes on rows that their case does not have, the first one on each parameter."""
        of_case, lines = notes_on_settings(self.case), dict[str, str]()
        for case in self.cases:
            for note in notes_on_settings(case):
                if note not in of_case:
                    lines.setdefault(note.split()[0], note)
        return list(lines.values())

    def as_json(self) -> dict[str, Any]:
        """The entries of its record; of random values only the names."""
        plan, case = self.plan, self.case
        about = {"rows": len(self.planned), "vary": plan.varied, "sample": [*plan.sampled]}
        limits = plan.quake and plan.quake.listed
        about |= {"tie": plan.tied, "critical": plan.critical, "limits": limits}
        return {"sweep": about, **case_entries(case)}

    def missing(self, known: Container[str] = ()) -> dict[str, Task]:
        """The tasks of the rows whose keys are not known."""
        return {key: task for key, _, task in self.planned if key not in known}

    def compute(
        self, jobs: int | None = None, scheduler: str | None = None, known: Container[str] = ()
    ) -> Iterator[tuple[str, dict[str, Value]]]:
        """(key, results) of each missing row when it is finished, in `jobs` processes (default: one
        per core) or by a scheduler.

        Raises InputError before the first row, RunError.
        """
        tasks = self.missing(known)
        if not tasks:
            return iter(())
        first = next(iter(tasks.values()))
        if first.search:
            first.search()  # checks the quantity
        interface_of(first.case)  # condensed before the processes start, which read it
        return spread(tasks, process_count(jobs, len(tasks)), scheduler)


def meshed(case: Case) -> tuple[Case, str]:
    """The case on the mesh that its accuracy requires before anything is varied; the estimated
    errors, as a sentence.

    Raises InputError, RunError.
    """
    with Progress(f"{case.name}, mesh of all rows", bar_format="{desc} {elapsed}", leave=False):
        outcome = runner.compute(case, fields=False)
    refined = {n: outcome.result.case[n] for n in accuracy.REFINED}
    estimate = outcome.result.info["error_estimate"]["statement"]
    source = source_of(case)
    steps = source.steps or (1 if case["drive"] == "level" else None)
    mesh = {**first_mesh(case), **source.overrides, **refined}
    return resolve(replace(source, overrides=mesh, steps=steps, accuracy=None)), estimate


def sweep(
    rows: PlannedRows,
    out: Path,
    jobs: int | None = None,
    scheduler: str | None = None,
    on_note: Callable[[str], None] = lambda note: None,
) -> tuple[int, list[Row]]:
    """Compute the rows that are missing in out (CSV); on_note: called with each note on rows
    before.

    Returns their number, and all rows. Columns: key, the plan's names (level as
    level_requested), the columns of history.csv, of an earthquake, OUTCOME, the critical value.
    Each finished row is written at once, so that an interrupted sweep can be continued. Raises
    InputError, RunError.
    """
    check_jobs(jobs)
    case, plan = rows.case, rows.plan
    values = {key: row for key, row, _ in rows.planned}
    columns = ["key", *map(column_of, plan.names), *rows.results]
    notes = [*remarks(case), *rows.notes]
    with rows_session(case.name, out, columns, rows.numeric, rows.as_json(), notes) as (
        study,
        done,
    ):
        computed, missing = rows.compute(jobs, scheduler, done), len(rows.missing(done))
        for note in rows.notes:
            on_note(note)
        try:
            for key, result in track(computed, f"sweep {case.name}", missing):
                if not study.added:  # of the rows before
                    for ending in (CHART, *STATISTICS, *FRAGILITY):
                        beside(out, ending).unlink(missing_ok=True)
                cells = *values[key].values(), *(result[c] for c in rows.results)
                study.add([key, *(in_file(cell) for cell in cells)])
        except ProcessKilled:
            raise ProcessKilled(study.added) from None
        done = study.file.read()
    return missing, [done[key] for key, *_ in rows.planned]


#: Rows of a sweep that are printed at most; columns beside those varied and of critical values, of
#: static runs and of earthquakes, the last ones left out first where the terminal is narrow.
PRINTED = 20
RESULTS = ("verdict", "level", "crack_length", "slip_length", "max_opening", "crest_ux", "N", "T")
#: Units in the printed table: of forces, openings and movements not that of the CSV file.
PRINTED_UNITS = dict.fromkeys(("level", "crack_length", "slip_length"), ("m", 1.0))
PRINTED_UNITS |= dict.fromkeys(("max_opening", "crest_ux", "residual_slip"), ("mm", 1000.0))
PRINTED_UNITS |= {
    "residual_tilt": ("rad", 1.0),
    "rigid_block_slip": ("mm", 1e3),
    "N": ("MN/m", 1e-6),
    "T": ("MN/m", 1e-6),
}
RESULTS_OF_QUAKES = ("verdict", "residual_slip", "residual_tilt", "rigid_block_slip")


def rows_table(plan: Plan, rows: list[Row], width: int | None = None) -> str:
    """The first rows of a sweep: what varies, verdict, results; width: None: all columns."""
    results = RESULTS_OF_QUAKES if plan.quake else RESULTS
    shown_always = [*map(column_of, plan.names), *plan.critical_columns[:3]]
    names = [n for n in dict.fromkeys([*shown_always, *results]) if rows and n in rows[0]]
    cells = [[short(name, row[name]) for name in names] for row in rows[:PRINTED]]
    units = {column_of(n): quantity_of(n)[1] for n in plan.names}
    if plan.critical:
        units[plan.critical_columns[0]] = quantity_of(plan.critical)[1]
    units |= {name: unit for name, (unit, _) in PRINTED_UNITS.items()}
    heads = [f"{n}\n[{units[n]}]" if units.get(n, "-") not in ("-", "") else n for n in names]
    if not rows:
        return ""
    more = len(rows) - PRINTED
    rest = f"\n... and {more} rows more" if more > 0 else ""
    drawn: Draw = lambda rows, heads: aligned(rows, heads) + rest
    return fitted(names, heads, cells, results[:0:-1], width, drawn)


def short(name: str, cell: str) -> str:
    """A cell of a row with four digits if it is a number; an overlap is no opening."""
    try:
        value = float(cell) * PRINTED_UNITS.get(name, ("", 1.0))[1]
    except ValueError:
        return cell
    return f"{max(value, 0.0) if name == 'max_opening' else value:.4g}"
