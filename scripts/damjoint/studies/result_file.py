"""A CSV to which a sweep adds a row at a time, so that it can be interrupted and continued."""

from __future__ import annotations

import contextlib
import csv
import io
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import InputError, RunError
from ..post import folder as folders
from ..post.tables import as_text
from ..session import Record
from ..storage import SAVED, lock
from .plan import RECORD, Row, beside


@dataclass(frozen=True)
class ResultFile:
    """An open result file, which no other process writes to."""

    path: Path
    columns: Sequence[str]
    #: its number as an open file
    number: int

    @property
    def head(self) -> str:
        """Its first line."""
        return csv_line(self.columns)

    def text(self) -> str:
        """Its content. Raises InputError with the line if it is not text."""
        size = os.fstat(self.number).st_size
        content = os.pread(self.number, size, 0)
        try:
            return content.decode()
        except UnicodeDecodeError as error:
            raise self.damaged(content[: error.start].count(b"\n") + 1) from None

    def damaged(self, line: int) -> InputError:
        """The error of a damaged line."""
        return InputError(
            f"out = {self.path}: line {line} is damaged; delete it, and its row is computed again"
        )

    def read(self, numeric: Sequence[str] = ()) -> dict[str, Row]:
        """The complete rows by key, their first column; numeric: columns of numbers. A last line
        without an end was interrupted.

        Raises InputError.
        """
        text = self.text()
        if self.head.startswith(text):
            return {}
        complete = io.StringIO(text[: text.rfind("\n") + 1], newline="")
        rows = csv.DictReader(complete, restval=None, strict=True)
        if rows.fieldnames != list(self.columns):
            raise InputError(
                f"out = {self.path}: must be a new file or of the same sweep (columns "
                f"{','.join(self.columns)})"
            )
        done = {}
        try:
            for row in rows:
                if None in row or None in row.values():
                    raise ValueError
                for name in numeric:
                    float(row[name] or "nan")
                done[row[self.columns[0]]] = row
        except ValueError:
            raise self.damaged(rows.line_num) from None
        except csv.Error:  # of the row after the last one that was read
            raise self.damaged(rows.line_num + 1) from None
        return done

    def repair(self) -> None:
        """Remove an incomplete last line, and nothing else whenever it is interrupted."""
        text = self.text()
        os.ftruncate(self.number, len(text[: text.rfind("\n") + 1].encode()))

    def add(self, cells: Sequence[str]) -> None:
        """Add a row, whole or, on a full disk, to be repaired later; the first one after the names
        of the columns.

        Raises RunError if the file has been deleted or replaced; OSError.
        """
        self.check_exists()
        head = "" if os.fstat(self.number).st_size else self.head
        rest = (head + csv_line([as_text(cell) for cell in cells])).encode()
        try:
            while rest:
                rest = rest[os.write(self.number, rest) :]
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self.path)) from None
        SAVED.add(self.path)

    @property
    def exists(self) -> bool:
        """Whether the path still leads to this file."""
        try:
            return os.path.samestat(os.fstat(self.number), self.path.stat())
        except OSError:
            return False

    def check_exists(self) -> None:
        """Raise RunError if the path does not lead to this file any more."""
        if not self.exists:
            raise RunError(
                f"out = {self.path}: has been deleted or replaced meanwhile; its rows are lost, "
                "the same command computes them again"
            )


def check_path(path: Path) -> None:
    """Raise InputError if a file of rows can not be at a path; pictures are written beside it."""
    if path.suffix != ".csv":
        raise InputError(f"out = {path}: must end in .csv")
    if not path.parent.is_dir():
        raise InputError(f"out = {path}: must be a file in an existing folder")


@contextlib.contextmanager
def result_file(
    path: Path, columns: Sequence[str], numeric: Sequence[str]
) -> Iterator[tuple[ResultFile, dict[str, Row]]]:
    """Open and lock a result file, and repair its end; yields it with its complete rows by key. A
    file to which no row is added is not created.

    Raises InputError if it is of another sweep, damaged, or being written by another process.
    """
    check_path(path)
    if path.exists() and not path.is_file():
        raise InputError(f"out = {path}: must be a regular file")
    number = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o666)
    try:
        lock(number, path)
        file = ResultFile(path, columns, number)
        try:
            done = file.read(numeric)
            file.repair()
            yield file, done
        finally:
            if file.exists and not os.fstat(number).st_size:
                path.unlink()
    finally:
        os.close(number)


class SavedRows(Record):
    """A study that adds rows to a result file; its record beside it from the first row on."""

    def __init__(self, name: str, file: ResultFile, notes: Sequence[str]) -> None:
        super().__init__(name, beside(file.path, RECORD), notes)
        self.file, self.added, self.ended = file, 0, True

    def add(self, cells: Sequence[str]) -> None:
        """Add a row, see `ResultFile.add`."""
        if not self.added:
            folders.write_state(self.name, self.path, "running")
            self.ended = False
        self.file.add(cells)
        self.added += 1
        self.reached = f"{self.added} rows were added"


@contextlib.contextmanager
def rows_session(
    name: str,
    path: Path,
    columns: Sequence[str],
    numeric: Sequence[str],
    entries: Mapping[str, Any],
    notes: Sequence[str] = (),
) -> Iterator[tuple[SavedRows, dict[str, Row]]]:
    """The life of a study whose rows are in a CSV, as `session` for one in a folder.

    name: of its case; entries: of its record; see `result_file`, also for what it raises.
    """
    with result_file(path, columns, numeric) as (file, done):
        study = SavedRows(name, file, notes)
        with study.recording():
            yield study, done
            file.check_exists()
        recorded = (folders.read_record(study.path) or {}).get("state") == folders.COMPLETE
        if study.added or (done and not recorded):
            study.save_without_results(folders.COMPLETE, "", {**entries, "rows_added": study.added})


def csv_line(cells: Sequence[str]) -> str:
    """A line of a CSV."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(cells)
    return text.getvalue()
