"""Files of records of the ground's acceleration: CSV, PEER (.AT2), COSMOS (.V1, .V2).

CSV has the columns time [s], horizontal and, if there is a third one, vertical acceleration. The
other formats have one component and its unit; a vertical one is a file of its own.
"""

from __future__ import annotations

import contextlib
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import InputError
from ..arrays import Array, IntArray
from ..storage import read_limited_text

#: Standard gravity [m/s2], for records in g.
STANDARD_GRAVITY = 9.80665

#: Limits of a record, beyond which it is refused. Rows; strong motion has 1e3 to 1e5.
MOST_ROWS = 1_000_000
#: Bytes of its file.
LONGEST = 200_000_000
#: Time [s], with room for times since an epoch.
LATEST = 1e10

#: The third line of a file of PEER, and its interval and number of values on the fourth.
PEER = re.compile(r"ACCELERATION TIME (SERIES|HISTORY) IN UNITS OF G", re.IGNORECASE)
PEER_SIZES = (
    re.compile(r"NPTS\s*=\s*(?P<n>\d+)\s*,\s*DT\s*=\s*(?P<dt>[\d.E+-]+)", re.IGNORECASE),
    re.compile(r"^\s*(?P<n>\d+)\s+(?P<dt>[\d.E+-]+)\s+NPTS\s*,\s*DT", re.IGNORECASE),
)
#: The line of a COSMOS file before its values, and that before the numbers of its header.
COSMOS = re.compile(
    r"^\s*(?P<n>\d+)\s+.*pts,\s*approx\s+(?P<seconds>[\d.]+)\s+secs,\s*units\s*=\s*(?P<unit>[^(]*)"
    r"\(.*\),\s*Format\s*=\s*\(\s*\d+[FEG](?P<width>\d+)",
    re.IGNORECASE,
)
COSMOS_HEADER = re.compile(
    r"^\s*(?P<n>\d+)\s+Real-header.*Format\s*=\s*\(\s*(?P<columns>\d+)[FEG](?P<width>\d+)",
    re.IGNORECASE,
)
#: Units of COSMOS files in m/s2.
COSMOS_UNITS = {"cm/sec2": 0.01, "cm/sec/sec": 0.01, "cm/sec**2": 0.01, "g": STANDARD_GRAVITY}
#: Places of the interval in the numbers of a COSMOS header, and their units [s]: of the values that
#: follow, and of the values as recorded, which are those of files without the first.
COSMOS_INTERVALS = (61, 1e-3), (33, 1.0), (33, 1e-3)


@dataclass(frozen=True)
class RecordFile:
    """The rows of a record as its file has them."""

    #: (n, 3): time [s], horizontal and vertical acceleration, 0 if it has none
    rows: Array
    #: (n,) numbers of the rows among the lines of the file
    lines: IntArray
    #: whether the accelerations are in m/s2, by the unit that the file states
    in_si: bool = False


def read(path: Path, vertical: Path | None = None) -> RecordFile:
    """The rows of a record; vertical: the file of its vertical component, of the same instants.

    Raises InputError.
    """
    file = read_one(path)
    if vertical is None:
        return file
    other, name = read_one(vertical), f"record = {path}+{vertical}"
    if file.rows[:, 2].any() or other.rows[:, 2].any():
        raise InputError(f"{name}: must be two files of one component each")
    if file.in_si != other.in_si:
        raise InputError(f"{name}: must be two files that both state their unit, or none of them")
    number = min(len(file.rows), len(other.rows))
    if not np.allclose(file.rows[:number, 0], other.rows[:number, 0], rtol=1e-6):
        raise InputError(f"{name}: must be two files with accelerations at the same times")
    longer = file if len(file.rows) >= len(other.rows) else other
    rows = longer.rows.copy()
    rows[:, 1:] = 0.0
    rows[: len(file.rows), 1] = file.rows[:, 1]
    rows[: len(other.rows), 2] = other.rows[:, 1]
    return RecordFile(rows, longer.lines, file.in_si)


def record_bytes(path: Path | None, vertical: Path | None = None) -> bytes:
    """The content of the files of a record; empty without one."""
    return b"".join(file.read_bytes() for file in (path, vertical) if file)


def read_one(path: Path) -> RecordFile:
    """The rows of a file. Raises InputError."""
    name = f"record = {path}"
    lines = read_limited_text(path, name, LONGEST).splitlines()
    if any(map(PEER.search, lines[:4])):
        return read_peer(name, lines)
    for number, line in enumerate(lines):
        if match := COSMOS.match(line):
            return read_cosmos(name, lines, number, match)
    return read_csv(name, lines)


def read_peer(name: str, lines: list[str]) -> RecordFile:
    """The rows of the lines of a file of PEER, in g."""
    for number, line in enumerate(lines[:8], start=1):
        for sizes in PEER_SIZES:
            if match := sizes.search(line):
                words = [
                    (n, w) for n, row in enumerate(lines[number:], number + 1) for w in row.split()
                ]
                dt = parsed_number(name, number, match["dt"])
                return of_values(name, words, int(match["n"]), dt, STANDARD_GRAVITY)
    raise InputError(f"{name}: must have NPTS and DT in its fourth line, as files of PEER have")


def read_cosmos(name: str, lines: list[str], number: int, form: re.Match[str]) -> RecordFile:
    """The rows of the lines of a COSMOS file whose line of this number says how they are written.

    Its first component only. Raises InputError.
    """
    unit = COSMOS_UNITS.get(form["unit"].strip().lower())
    if unit is None:
        raise InputError(
            f"{name}, row {number + 1}: units = {form['unit'].strip()}: must be accelerations in "
            f"{', '.join(COSMOS_UNITS)}"
        )
    header = list[str]()
    for k, line in enumerate(lines[:number]):
        if head := COSMOS_HEADER.match(line):
            rows = -(-int(head["n"]) // int(head["columns"]))
            header = [w for row in lines[k + 1 : k + 1 + rows] for w in cells(row, head["width"])]
    count, seconds = int(form["n"]), float(form["seconds"])
    for index, size in COSMOS_INTERVALS:
        with contextlib.suppress(IndexError, ValueError):
            dt = float(header[index]) * size
            # the duration is rounded to a second
            if dt > 0 and abs(count * dt - seconds) <= 1 + dt:
                break
    else:
        raise InputError(
            f"{name}, row {number + 1}: must have the interval of its {count} values in "
            f"{seconds:g} s as number 62 or 34 of its real header"
        )
    values = [
        (n, word)
        for n, row in enumerate(lines[number + 1 :], number + 2)
        for word in cells(row, form["width"])
    ]
    return of_values(name, values, count, dt, unit)


def cells(line: str, width: str) -> list[str]:
    """The cells of a line with columns of a width; they may touch."""
    size = int(width)
    return [
        cell for i in range(0, len(line.rstrip()), size) if (cell := line[i : i + size].strip())
    ]


def of_values(
    name: str, words: list[tuple[int, str]], number: int, interval: float, unit: float
) -> RecordFile:
    """The rows of a number of values at equal intervals [s], each with the number of its line;
    unit: of the values [m/s2].

    Raises InputError.
    """
    if not 2 <= number <= MOST_ROWS:
        raise InputError(f"{name}: must have 2 to {MOST_ROWS} values, not {number}")
    if not interval > 0:
        raise InputError(f"{name}: interval of {interval:g} s: must be > 0")
    if len(words) < number:
        raise InputError(f"{name}: must have {number} values, and has {len(words)}")
    lines = np.array([line for line, _ in words[:number]])
    values = np.array([parsed_number(name, line, word) for line, word in words[:number]])
    rows = np.column_stack([interval * np.arange(number), unit * values, np.zeros(number)])
    return RecordFile(rows, lines, in_si=True)


def parsed_number(name: str, line: int, word: str) -> float:
    """A finite number in a line, by its number. Raises InputError."""
    with contextlib.suppress(ValueError):
        value = float(word)
        if np.isfinite(value):
            return value
    raise InputError(f"{name}, row {line}: {word[:60]}: must be a finite number")


def read_csv(name: str, lines: list[str]) -> RecordFile:
    """The rows of the lines of a CSV file.

    Lines that begin with # are comments; the first line may be a heading. Raises InputError.
    """
    meaning = "time [s], horizontal and, if any, vertical acceleration"
    rows, numbers = list[list[float]](), list[int]()
    heading = True  # the first line that is none
    for number, line in enumerate(lines, start=1):
        if not line.strip() or line.startswith("#"):
            continue
        if len(rows) == MOST_ROWS:
            raise InputError(f"{name}, row {number}: must have at most {MOST_ROWS} rows")
        try:
            row = [float(cell) for cell in line.split(",")]
        except ValueError:
            if not heading:
                raise InputError(
                    f"{name}, row {number}: {line.strip()[:60]}: must be numbers: {meaning}"
                ) from None
        else:
            if len(row) not in (2, 3) or (rows and len(row) != len(rows[0])):
                raise InputError(
                    f"{name}, row {number}: {line.strip()[:60]}: must have 2 or 3 numbers, as many "
                    f"as the others: {meaning}"
                )
            if not (np.isfinite(row).all() and abs(row[0]) <= LATEST):
                raise InputError(
                    f"{name}, row {number}: {line.strip()[:60]}: must be finite numbers, the time "
                    f"within {LATEST:g} s"
                )
            if rows and not row[0] > rows[-1][0]:
                raise InputError(
                    f"{name}, row {number}: t = {row[0]:g} s: must be > {rows[-1][0]:g} s, the "
                    "time before: times that increase"
                )
            rows.append(row)
            numbers.append(number)
        heading = False
    if len(rows) < 2:
        raise InputError(f"{name}: must have 2 to {MOST_ROWS} rows of {meaning}")
    values = np.array(rows)
    return RecordFile(np.pad(values, ((0, 0), (0, 3 - values.shape[1]))), np.array(numbers))
