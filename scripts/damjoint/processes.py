"""Work in several processes, which end with the command."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from typing import TypeVar

from . import InputError, RunError
from .progress import track

Item = TypeVar("Item")
Result = TypeVar("Result")


class ProcessKilled(RunError):
    """A process of a pool has ended without a result; saved: number of the rows in the file."""

    def __init__(self, saved: int = 0) -> None:
        kept = f"; {saved} rows are saved, the same command continues" if saved else ""
        super().__init__(
            f"a process was killed (out of memory?){kept}; --jobs 1 needs least memory"
        )


@contextlib.contextmanager
def process_pool(jobs: int) -> Iterator[ProcessPoolExecutor]:
    """Processes that end with their parent, even if it is killed, and after an error in a process
    or in the caller. Raises ProcessKilled if one of them is killed.
    """
    with ProcessPoolExecutor(jobs, initializer=end_with_parent) as pool:
        try:
            yield pool
        except BrokenProcessPool:
            raise ProcessKilled from None
        except BaseException:
            for process in list(pool._processes.values()):  # the pool would wait for their tasks
                process.terminate()
            raise


def end_with_parent() -> None:
    """End this process when its parent ends, and at once and without words if it is interrupted:
    an exception would be taken for the result of its task, or leave the pool's queue locked. (The
    other signals end a fork of a command so, see __main__.py.)
    """
    if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    def wait() -> None:
        if parent := multiprocessing.parent_process():
            parent.join()
            os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def check_jobs(jobs: int | None) -> None:
    """Raise InputError if a number of processes is not positive."""
    if jobs is not None and jobs < 1:
        raise InputError(f"jobs = {jobs}: must be an integer >= 1")


def process_count(jobs: int | None, tasks: int) -> int:
    """Number of processes for so many tasks; jobs: at most, by default one per core."""
    return min(jobs or os.cpu_count() or 1, tasks)


def as_finished(
    work: Callable[[Item], Result], items: Sequence[Item], jobs: int
) -> Iterator[tuple[int, Result]]:
    """(number, result) of each item as its work is finished in one of several processes."""
    with process_pool(jobs) as pool:
        waiting = {pool.submit(work, item): number for number, item in enumerate(items)}
        for future in as_completed(waiting):
            yield waiting[future], future.result()


def without_progress(work: Callable[[Item, bool], Result], item: Item) -> Result:
    """The result of an item."""
    return work(item, False)


def in_processes(
    work: Callable[[Item, bool], Result], items: Sequence[Item], jobs: int | None, title: str
) -> Iterator[tuple[int, Result]]:
    """(number, result) of each item as its work is finished: of a single job in this process, where
    the work shows its own progress (its second argument), else in several.

    jobs: number of processes, by default one per core. Raises InputError.
    """
    check_jobs(jobs)
    several = process_count(jobs, len(items))
    if several == 1:
        yield from ((number, work(item, True)) for number, item in enumerate(items))
    else:
        finished = as_finished(partial(without_progress, work), items, several)
        yield from track(finished, title, len(items))
