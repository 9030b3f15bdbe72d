"""Sweeps: one row per combination of parameters and water levels, resumable, on all cores or a dask
cluster.
"""

from __future__ import annotations

import csv
import hashlib
import itertools
import math
import os
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from .. import InputError, RunError, __version__
from ..engines.condensed.filling import Filling
from ..engines.condensed.interface import Interface
from ..results.tables import HISTORY
from ..results.verdict import statement, verdict
from ..scene import parameters
from ..scene.case import Case, load
from .bodies import interface_of


def values_of(text: str) -> tuple[str, list[str]]:
    """('name', ['v1', ...]) from 'name=v1,v2,...' or 'name=first:last:step'.

    Raises InputError.
    """
    name, equals, values = text.partition("=")
    bad = InputError(
        f"--vary {text}: must be NAME=V1,V2,... or NAME=FIRST:LAST:STEP with a step that leads "
        "from first to last"
    )
    if not equals or not values:
        raise bad
    if ":" not in values:
        found = [v.strip() for v in values.split(",")]
    else:
        try:
            first, last, step = (float(v) for v in values.split(":"))
        except ValueError:
            raise bad from None
        if not np.isfinite([first, last, step]).all() or step == 0 or (last - first) / step < 0:
            raise bad
        if (last - first) / step >= MOST_ROWS:
            raise InputError(f"--vary {text}: must give at most {MOST_ROWS} values")
        found = [f"{first + i * step:.12g}" for i in range(int((last - first) / step + 1e-9) + 1)]
    if name.strip() == "level":
        try:
            [float(v) for v in found]
        except ValueError:
            raise bad from None
    else:
        for value in found:
            parameters.parameter(name.strip()).check(value)
    return name.strip(), found


def combinations(
    case: str, vary: list[str], settings: dict
) -> Iterator[tuple[dict[str, str], Case]]:
    """All combinations: the varied values, and the case with them.

    level: the last level; the case's levels below it come first. Raises InputError.
    """
    axes = [values_of(text) for text in vary]
    names = [name for name, _ in axes]
    for name in names:
        if names.count(name) > 1 or name in settings:
            raise InputError(f"--vary {name}: must be given once, and not by --set as well")
    if math.prod(len(values) for _, values in axes) > MOST_ROWS:
        raise InputError(f"--vary: must give at most {MOST_ROWS} rows in all")
    base = load(case, settings)
    for values in itertools.product(*(v for _, v in axes)):
        chosen = dict(zip((n for n, _ in axes), values, strict=True))
        changed = {n: parameters.parameter(n).check(v) for n, v in chosen.items() if n != "level"}
        levels = tails = None
        if "level" in chosen:
            top = float(chosen["level"])
            levels, tails = up_to(base, top)
        yield chosen, load(case, settings | changed, levels, tails)


def up_to(base: Case, top: float) -> tuple[str, str]:
    """Levels and tailwater of a case up to a last level: those of its levels that lie below come
    first.

    The tailwater of the last level is the case's own where it first reaches that level (or its last
    one).
    """
    below = [i for i, level in enumerate(base.levels) if level < top]
    first = next((i for i, level in enumerate(base.levels) if level >= top), None)
    tail = base.tail_levels[-1]
    if first is not None and len(set(base.tail_levels)) > 1:
        before = base.levels[first - 1] if first else 0.0
        share = (
            (top - before) / (base.levels[first] - before) if base.levels[first] > before else 1.0
        )
        tail = base.tail_at(first + share)
    levels = [*(base.levels[i] for i in below), top]
    tails = [*(base.tail_levels[i] for i in below), tail]
    return tuple(",".join(f"{v:.12g}" for v in values) for values in (levels, tails))


def key_of(case: Case) -> str:
    """What identifies a scene and its loading in a result file."""
    return hashlib.sha256(
        repr(
            (sorted(case.values.items()), case.levels, case.tail_levels, case.times, __version__)
        ).encode()
    ).hexdigest()[:16]


#: Rows of a sweep at most.
MOST_ROWS = 1_000_000

#: What a row says in words.
SAID = ("verdict", "statement")

#: Rows that are computed together at most: they share the steps up to the levels where they part.
MOST = 8


def filled(case: Case, known: dict[tuple, Filling], interface: Interface) -> Filling:
    """The filling of a case, gone on with from its last level but one if that is known; known: by
    levels and times.
    """
    key = case.levels, case.tail_levels, case.times
    if key not in known:
        before = case.before_last_level()
        filling = (
            filled(before, known, interface).fork(case) if before else Filling(case, interface)
        )
        filling.run()
        known[key] = filling
    return known[key]


def last_rows(cases: list[Case]) -> list[dict[str, float | str]]:
    """For cases that differ in levels only: the columns of history.csv at the last level, and what
    it says in words.
    """
    found, known = [], {}
    with threadpool_limits(1):
        for case in cases:
            try:
                filling = filled(case, known, interface_of(case))
            except RunError as error:
                failed = {"verdict": "failed", "statement": str(error)}
                found.append(dict.fromkeys(HISTORY, "") | failed)
                continue
            result = filling.results()
            last = {
                name: f"{column[-1]:.12g}" if len(column) else ""
                for name, column in result.history.items()
            }
            found.append(last | {"verdict": verdict(result), "statement": statement(result)})
    return found


def bundles(cases: dict[str, Case]) -> list[list[str]]:
    """The keys of cases that differ in levels only, together; at most MOST of them, for rows to
    come in time.
    """
    groups: dict[tuple, list[str]] = {}
    for key, case in cases.items():
        groups.setdefault(tuple(sorted(case.values.items())), []).append(key)
    return [keys[i : i + MOST] for keys in groups.values() for i in range(0, len(keys), MOST)]


def read_done(path: Path, columns: list[str]) -> set[str]:
    """The keys of the complete rows of a result file; a half-written last line is cut off.

    Raises InputError.
    """
    if not path.exists() or not path.stat().st_size:
        return set()
    text = path.read_text()
    whole = text[: text.rfind("\n") + 1]
    rows = list(csv.reader(whole.splitlines()))
    if not rows or rows[0] != columns:
        raise InputError(
            f"out = {path}: must be a new file or one of the same sweep "
            f"(columns {','.join(columns)})"
        )
    if whole != text:
        path.write_text(whole)
    return {row[0] for row in rows[1:] if len(row) == len(columns)}


def spread(cases: dict[str, Case], jobs: int, scheduler: str | None) -> Iterator[tuple[str, dict]]:
    """(key, row) of each case as it is done: here, in `jobs` processes, or on a dask scheduler."""
    work = bundles(cases)
    chosen = [[cases[key] for key in keys] for keys in work]
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
        with ProcessPoolExecutor(jobs) as pool:
            waiting = {
                pool.submit(last_rows, some): keys for keys, some in zip(work, chosen, strict=True)
            }
            try:
                for future in as_completed(waiting):
                    yield from zip(waiting[future], future.result(), strict=True)
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise


def sweep(
    case: str,
    vary: list[str],
    settings: dict,
    out: Path,
    jobs: int | None = None,
    scheduler: str | None = None,
    progress: Callable = tqdm,
) -> int:
    """Compute what is missing in out (CSV) and return the number of rows computed.

    Columns: key, the varied names (a varied level as level_asked), the columns of history.csv,
    verdict and statement. Each row is written whole when it is done; a sweep that is interrupted
    goes on where it was. Raises InputError.
    """
    if jobs is not None and jobs < 1:
        raise InputError(f"jobs = {jobs}: must be an integer >= 1")
    if not vary:
        raise InputError("--vary: must be given at least once, such as mu=0.3:0.8:0.05")
    if not out.parent.is_dir():
        raise InputError(f"out = {out}: must be a file in an existing folder")
    chosen, cases = {}, {}
    for values, one in combinations(case, vary, settings):
        chosen[key_of(one)], cases[key_of(one)] = values, one
    names = [f"{n}_asked" if n == "level" else n for n in next(iter(chosen.values()))]
    columns = ["key", *names, *HISTORY, *SAID]
    done = read_done(out, columns)
    missing = {key: one for key, one in cases.items() if key not in done}
    if not missing:
        return 0
    interface_of(next(iter(missing.values())))  # condensed once, before the processes start
    fresh = not out.exists() or not out.stat().st_size
    with out.open("a", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        if fresh:
            writer.writerow(columns)
        rows = spread(missing, jobs or os.cpu_count() or 1, scheduler)
        for key, row in progress(
            rows, total=len(missing), desc=f"sweep {case}", disable=not sys.stderr.isatty()
        ):
            writer.writerow([key, *chosen[key].values(), *(row[c] for c in (*HISTORY, *SAID))])
            file.flush()
    return len(missing)
