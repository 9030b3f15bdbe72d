"""The life of a study in its output folder, the same for all commands.

The folder is claimed, what is finished is saved at once, with its versions, machine, memory and
times, and a study that ends early says so in run.json.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar, cast

from . import versions
from .fem.memory import seconds, sizes
from .input.case import Case
from .model.results import Info, Results
from .post import folder as folders
from .post import tables
from .progress import INTERVAL, Progress
from .statics.notes import remarks

Item = TypeVar("Item")
Result = TypeVar("Result")


def study_end(error: BaseException | None, where: str = "") -> tuple[str, str]:
    """State of a study that an error has ended, failed or interrupted, and its message; both empty
    without an error. where: how far it had come.
    """
    if error is None:
        return "", ""
    state = "failed" if isinstance(error, Exception) else "interrupted"
    return state, f"{state}{where}" + (f": {error}" if str(error) else "")


class Record:
    """The record of a study: run.json, or for rows in a CSV a file beside it."""

    def __init__(self, name: str, path: Path, notes: Sequence[str] = ()) -> None:
        """name: of the case; notes: on it."""
        self.name, self.path, self.notes = name, path, notes
        self.begun = time.perf_counter()
        #: whether it has the end of the study; how far that has come, if it ends without a message
        self.ended, self.reached = False, ""

    @property
    def seconds(self) -> float:
        """Wall seconds since the study has begun."""
        return time.perf_counter() - self.begun

    def save_without_results(
        self, state: str, statement: str, entries: Mapping[str, Any] | None = None
    ) -> None:
        """Write the record of a study without any equilibrium; entries: further ones."""
        self.ended = True
        further = {"notes": self.notes, "wall_seconds": {"all": self.seconds}, **(entries or {})}
        further |= versions.provenance({})
        folders.write_state(self.name, self.path, state, statement, further)

    @contextlib.contextmanager
    def recording(self) -> Iterator[None]:
        """Record an early end of the study that follows."""
        try:
            versions.git_status()  # runs on another core meanwhile
            yield
        except BaseException as error:
            if not self.ended:
                state, _ = study_end(error)
                self.save_without_results(state, str(error) or self.reached)
            raise
        finally:
            versions.commit()


class Session(Record):
    """A study of a case that has claimed its folder, see `session`."""

    def __init__(self, case: Case, out: Path, key: str = "") -> None:
        """key: of all that decides the results, see `finished`; empty: they are not used again."""
        super().__init__(case.name, out / folders.RECORD, remarks(case))
        self.case, self.out, self.key = case, out, key
        self.reached = "no step had converged"
        #: saved scenes: results, state and statement
        self.saved: list[tuple[Results, str, str]] = []

    def save(
        self,
        result: Results,
        state: str = "",
        statement: str = "",
        more: Callable[[Path], None] = lambda folder: None,
    ) -> None:
        """Write the tables of a scene, and run.json with notes, versions, machine, memory, times.

        state, statement: of an early end, see `folder.write_info`; more: writes further tables into
        the folder of the scene.
        """
        folder, start = self.folder(result), time.perf_counter()
        folder.mkdir(exist_ok=True)
        tables.write(result, folder)
        more(folder)
        self.saved.append((result, state, statement))
        self.ended = True
        info = result.info
        info.setdefault("wall_seconds", {})["post"] = time.perf_counter() - start
        about = versions.provenance(info.pop("getdp", {}))
        info |= cast(Info, about | {"notes": self.notes})
        folders.write_info(result, folder, state, statement)

    def add(self, result: Results, write: Callable[[Path], object]) -> None:
        """Write fields or pictures of a saved scene; adds their time to that of the tables."""
        start = time.perf_counter()
        write(self.folder(result))
        result.info["wall_seconds"]["post"] += time.perf_counter() - start

    def folder(self, result: Results) -> Path:
        """The folder of a scene."""
        return folders.scene_folder(self.case, result.case, self.out)

    def complete(self) -> None:
        """Write run.json again, with the times of fields and pictures, and the key."""
        for result, state, statement in self.saved:
            result.info |= {"key": self.key} if self.key else {}
            folders.write_info(result, self.folder(result), state, statement)


def preparation(case: Case, show: bool = True) -> Progress:
    """Progress of what comes before the first step of a study."""
    soon = seconds(case) > INTERVAL
    return Progress(sizes(case), None, show, soon, bar_format="{desc} {elapsed}", leave=False)


@contextlib.contextmanager
def session(case: Case, out: Path, keep: bool = False, key: str = "") -> Iterator[Session]:
    """Claim the output folder of a study of a case, in place of an earlier one's results; after the
    checks, so that bad input removes nothing. keep: continue an earlier one; key: see `Session`.

    Raises InputError if the folder can not be written or is locked, or if the geometry of the case
    is unsuitable.
    """
    study = Session(case, out, key)
    with folders.claim_output_folder(case.name, out, keep):
        with study.recording():
            yield study
        study.complete()


def finished(out: Path, key: str) -> bool:
    """Whether a folder has the results of a study of this key that has come to its end."""
    return (folders.read_info(out) or {}).get("key") == key


def several(
    work: Callable[[Item, bool], Result],
    items: Mapping[Path, Item],
    out: Path,
    jobs: int | None,
    title: str,
) -> Iterator[list[Result]]:
    """Compute studies of several cases, by their folders below out, in `jobs` processes; yields the
    results so far, in their order. Those that are running when one ends early have ended, too.

    work: computes an item, see `in_processes`. Raises InputError, RunError.
    """
    from .processes import in_processes  # a run starts without it

    done = dict[int, Result]()
    with folders.claim_study_folder(out):
        try:
            for number, result in in_processes(work, [*items.values()], jobs, title):
                done[number] = result
                yield [done[k] for k in sorted(done)]
        except BaseException as error:
            state, _ = study_end(error)
            for folder in items:
                info = folders.read_info(folder) or {}
                if info.get("state") == "running":
                    record, why = folder / folders.RECORD, "ended before its first result"
                    folders.write_state(info["case"], record, state, why)
            raise
