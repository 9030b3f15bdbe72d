"""Sweeps: one row per combination of a plan's values, resumable, on all cores or a dask cluster."""

from __future__ import annotations

import contextlib
import csv
import hashlib
import multiprocessing
import os
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from pathlib import Path

from threadpoolctl import threadpool_limits
from tqdm import tqdm

from .. import InputError, RunError, __version__, accuracy
from ..engines import engine_of
from ..joint.interface import Interface
from ..model.case import Case, first_mesh, load
from ..model.results import HISTORY
from ..post.tables import as_text
from ..solver.load_stepper import LoadStepper
from ..statics.limit import mechanism
from ..statics.verdict import failed, statement, verdict
from ..storage import lock
from .bodies import interface_of
from .critical import Search
from .plan import AS_IT_IS, Loading, Plan, Row, cases_of, column_of


def key_of(case: Case) -> str:
    """What identifies a scene and its loading in a result file."""
    return hashlib.sha256(
        repr(
            (sorted(case.values.items()), case.levels, case.tail_levels, case.times, __version__)
        ).encode()
    ).hexdigest()[:16]


#: What a row says of its run as a whole: whether it fails (1, the exit code of `damjoint run`) or
#: stands (0), and how, in words.
SAID = ("failed", "verdict", "statement")

#: The verdict of a row whose computation has failed.
ERROR = "failed"

#: Verdicts that do not tell whether there is an equilibrium.
UNDECIDED = (ERROR, "not converged", "interrupted")

#: Rows that are computed together at most: they share the steps up to the levels where they part.
MOST = 8


def stepped(case: Case, known: dict[tuple, LoadStepper], interface: Interface) -> LoadStepper:
    """The loading of a case to its end, continued from its last level but one; known: those that
    have been computed, by levels and times.
    """
    key = case.levels, case.tail_levels, case.times
    if key not in known:
        before = case.before_last_level()
        stepper = (
            stepped(before, known, interface).fork(case) if before else LoadStepper(case, interface)
        )
        stepper.run()
        known[key] = stepper
    return known[key]


@dataclass(frozen=True)
class Task:
    """What one row asks for."""

    case: Case
    #: no search for the last equilibrium of a dam whose loads are beyond what its joint can hold
    quick: bool
    #: what `critical.Search` takes, if a critical value is asked for
    search: tuple = ()
    #: columns of that value
    columns: Sequence[str] = ()


def last_rows(tasks: list[Task]) -> list[dict[str, float | str]]:
    """For cases that differ in levels only: the columns of history.csv at the last level (empty if
    there is no equilibrium), what it says in words, and the critical value.
    """
    known = {}
    with threadpool_limits(1):
        return [last_row(task, known) | critical_value(task) for task in tasks]


def last_row(task: Task, known: dict[tuple, LoadStepper]) -> dict[str, float | str]:
    """The row of a case; one whose computation fails, in whatever way, says why: the others go
    on.
    """
    row = dict.fromkeys((*HISTORY, *SAID), "")
    try:
        interface = interface_of(task.case)
        found, why = mechanism(task.case, interface) if task.quick else ("", "")
        if found:
            return row | dict(zip(SAID, (1, found, why), strict=True))
        result = stepped(task.case, known, interface).results()
    except Exception as error:
        return row | dict(zip(SAID, (1, ERROR, in_words(error)), strict=True))
    last = {name: f"{value:.12g}" for name, value in result.last.items()}
    said = int(failed(result)), verdict(result), statement(result)
    return row | last | dict(zip(SAID, said, strict=True))


def in_words(error: Exception) -> str:
    """Why a computation has failed, in a line."""
    kind = "" if isinstance(error, RunError) else f"{type(error).__name__}: "
    return " ".join(f"{kind}{error}".split())


def critical_value(task: Task) -> dict[str, float | str]:
    """The columns of a critical value; where the search fails it says why."""
    if not task.search:
        return {}
    try:
        answer = Search(*task.search).run()
    except Exception as error:
        return dict(zip(task.columns, ("", "", 0, in_words(error)), strict=True))
    value = "" if answer.value is None else f"{answer.value:.12g}"
    said = value, answer.mode, int(answer.confirmed), answer.why or answer.doubt
    return dict(zip(task.columns, said, strict=True))


def search_for(
    case: str, plan: Plan, settings: dict, loading: Loading, row: Row, one: Case
) -> tuple:
    """What `Search` takes for the critical value of a row of a plan, whose case is given."""
    if not plan.critical:
        return ()
    changed = settings | {n: one[n] for n in row if n != "level"}
    levels, tails = (",".join(map(repr, v)) for v in (one.levels, one.tail_levels))
    return case, plan.critical, changed, levels, tails


def bundles(tasks: dict[str, Task]) -> list[list[str]]:
    """The keys of cases that differ in levels only, together; at most MOST of them, for rows to
    come in time.
    """
    groups: dict[tuple, list[str]] = {}
    for key, task in tasks.items():
        groups.setdefault(tuple(sorted(task.case.values.items())), []).append(key)
    return [keys[i : i + MOST] for keys in groups.values() for i in range(0, len(keys), MOST)]


def read_done(path: Path, columns: list[str], numeric: Sequence[str]) -> dict[str, Row]:
    """The complete rows of a result file by key, its first column; a half-written last line is cut
    off.

    numeric: the columns that hold nothing but numbers. Raises InputError.
    """
    if not path.exists() or not path.stat().st_size:
        return {}
    damaged = f"out = {path}: line {{}} is damaged; take it away, and its row is computed again"
    try:
        text = path.read_text()
    except UnicodeDecodeError as error:
        lines = path.read_bytes()[: error.start].count(b"\n")
        raise InputError(damaged.format(lines + 1)) from None
    whole = text[: text.rfind("\n") + 1]
    rows = csv.DictReader(whole.splitlines(), restval=None, strict=True)
    if rows.fieldnames != columns:
        raise InputError(
            f"out = {path}: must be a new file or one of the same sweep "
            f"(columns {','.join(columns)})"
        )
    done = {}
    try:
        for row in rows:
            if None in row or None in row.values():
                raise ValueError
            for name in numeric:
                float(row[name] or "nan")
            done[row[columns[0]]] = row
    except ValueError:
        raise InputError(damaged.format(rows.line_num)) from None
    except csv.Error:  # of the row after the last one that was read
        raise InputError(damaged.format(rows.line_num + 1)) from None
    if whole != text:
        path.write_text(whole)
    return done


@contextlib.contextmanager
def pool_of(jobs: int) -> Iterator[ProcessPoolExecutor]:
    """Processes that end with this one, even where it is killed; once one fails, or the caller,
    nothing more is begun.
    """
    with ProcessPoolExecutor(jobs, initializer=end_with_parent) as pool:
        try:
            yield pool
        except BaseException:
            pool.shutdown(cancel_futures=True)  # waits: a pool that has gone cancels nothing
            raise


def end_with_parent() -> None:
    """End this process when the one that has started it is gone."""

    def wait() -> None:
        multiprocessing.parent_process().join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def spread(tasks: dict[str, Task], jobs: int, scheduler: str | None) -> Iterator[tuple[str, dict]]:
    """(key, row) of each task as it is done: here, in `jobs` processes, or on a dask scheduler."""
    work = bundles(tasks)
    chosen = [[tasks[key] for key in keys] for keys in work]
    if scheduler:
        try:
            from dask.distributed import Client
            from dask.distributed import as_completed as as_finished
        except ImportError:
            raise InputError(
                "--scheduler: needs dask.distributed; pip install 'damjoint[cluster]'"
            ) from None
        try:
            client = Client(scheduler, timeout=10)
        except (OSError, ValueError) as error:
            raise InputError(
                f"--scheduler {scheduler}: no scheduler answers there ({error})"
            ) from None
        with client:
            futures = {
                client.submit(last_rows, some, key=f"damjoint-{'-'.join(keys)}"): keys
                for keys, some in zip(work, chosen, strict=True)
            }
            for future in as_finished(futures):
                yield from zip(futures[future], future.result(), strict=True)
    elif jobs == 1 or len(work) == 1:
        for keys, some in zip(work, chosen, strict=True):
            yield from zip(keys, last_rows(some), strict=True)
    else:
        with pool_of(jobs) as pool:
            waiting = {
                pool.submit(last_rows, some): keys for keys, some in zip(work, chosen, strict=True)
            }
            try:
                for future in as_completed(waiting):
                    yield from zip(waiting[future], future.result(), strict=True)
            except BrokenProcessPool:
                raise RunError(
                    "sweep: a process was killed (out of memory?); what has been finished is "
                    "saved, the same command goes on; --jobs 1 takes least memory"
                ) from None


def meshed(case: str, settings: dict, loading: Loading) -> tuple[dict, Loading, str]:
    """Settings and loading of a sweep on one mesh, that which the loading's accuracy asks for of
    the case before anything is varied; and its errors there, in words.

    Raises InputError, RunError.
    """
    one = load(case, settings, **vars(loading))
    (outcome, *_) = accuracy.solve(
        replace(one, also_uplift=()), engine_of(one, "auto"), lambda *_: None, False
    )
    if outcome.error:
        raise outcome.error
    mesh = first_mesh(one) | settings | {n: outcome.result.case[n] for n in accuracy.REFINED}
    steps = loading.steps or (1 if one["drive"] == "level" else None)
    said = outcome.result.info["error_estimate"]["statement"]
    return mesh, replace(loading, steps=steps, accuracy=None), said


def sweep(
    case: str,
    plan: Plan,
    settings: dict,
    out: Path,
    loading: Loading = AS_IT_IS,
    jobs: int | None = None,
    scheduler: str | None = None,
    progress: Callable = tqdm,
) -> tuple[int, list[Row]]:
    """Compute what is missing in out (CSV); the number of rows computed, and all rows of the plan.

    Columns: key, the plan's names (level as level_asked), the columns of history.csv, whether it
    failed, verdict and statement, the critical value. Each row is written whole when it is done; a
    sweep that is interrupted goes on where it was. Raises InputError, RunError.
    """
    if jobs is not None and jobs < 1:
        raise InputError(f"jobs = {jobs}: must be an integer >= 1")
    if not out.parent.is_dir():
        raise InputError(f"out = {out}: must be a file in an existing folder")
    chosen, tasks, keys = {}, {}, []
    for values, one in cases_of(case, plan, settings, loading):
        search = search_for(case, plan, settings, loading, values, one)
        keys.append(key_of(one))
        chosen[keys[-1]] = values
        tasks[keys[-1]] = Task(one, bool(plan.sampled), search, plan.critical_columns)
    results = [*HISTORY, *SAID, *plan.critical_columns]
    columns = ["key", *map(column_of, plan.names), *results]
    done = read_done(out, columns, (*HISTORY, "failed"))
    missing = {key: task for key, task in tasks.items() if key not in done}
    if missing:
        first = next(iter(missing.values()))
        if first.search:
            Search(*first.search)  # what is asked for is checked here
        interface_of(first.case)  # condensed once, before the processes start
    with out.open("a", newline="") as file:
        lock(file.fileno(), out)
        writer = csv.writer(file, lineterminator="\n")
        if not file.tell():
            writer.writerow(columns)
        rows = spread(missing, jobs or os.cpu_count() or 1, scheduler) if missing else ()
        for key, row in progress(
            rows, total=len(missing), desc=f"sweep {case}", disable=not sys.stderr.isatty()
        ):
            cells = *chosen[key].values(), *(row[c] for c in results)
            writer.writerow([key, *(as_text(str(cell)) for cell in cells)])
            file.flush()
    found = read_done(out, columns, ())
    return len(missing), [found[key] for key in keys]
