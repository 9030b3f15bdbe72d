"""Hydrographs: water levels against time from a CSV file, as the levels of a case.

The columns are time (named hours, seconds or days), level [m] and, if any, tail_level [m]; rows in
the order of time. The first level has stood for long: it is reached at t = 1, from there a unit of
t is the shortest interval of the file, and levels are linear in between.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from .. import ROUND_OFF, InputError
from ..storage import read_limited_text

#: Units of the time [s], by the name of the first column.
SECONDS = {"seconds": 1.0, "hours": 3600.0, "days": 86400.0}
HEADS = ["level"], ["level", "tail_level"]
#: Most levels of a hydrograph, each of which has its table.
MOST_LEVELS = 2000
#: Bytes of its file.
LONGEST = 10_000_000


@dataclass(frozen=True)
class Hydrograph:
    """Water levels [m] at t = 1, 2, ...; tail_levels: None if the file has none."""

    #: seconds of a unit of t
    unit: float
    levels: tuple[float, ...]
    tail_levels: tuple[float, ...] | None

    @property
    def settings(self) -> dict[str, float]:
        """Parameters of a case that follow from it."""
        return {"time_unit": self.unit, "time_start": 1.0}


def read(path: Path) -> Hydrograph:
    """Read a hydrograph. Raises InputError."""
    name = f"hydrograph = {path}"
    text = read_limited_text(path, name, LONGEST)
    reader = csv.reader(text.splitlines())
    numbered = [(reader.line_num, line) for line in reader if line]
    head = [cell.strip() for cell in numbered.pop(0)[1]] if numbered else []
    if not head or head[0] not in SECONDS or head[1:] not in HEADS:
        raise InputError(
            f"{name}: its first row must be hours,level or hours,level,tail_level (or seconds, "
            "days; levels in m)"
        )
    rows = np.array([finite_numbers(f"{name}, row {k}", line, head) for k, line in numbered])
    if len(rows) < 2:
        raise InputError(f"{name}: must have two rows of numbers or more")
    times = (rows[:, 0] - rows[0, 0]) * SECONDS[head[0]]
    for k, (before, after) in enumerate(pairwise(times), 1):
        if not after > before:
            raise InputError(
                f"{name}, row {numbered[k][0]}: {head[0]} = {rows[k, 0]:g}: must be later than the "
                "row before"
            )
    unit = float(np.diff(times).min())
    number = math.ceil(times[-1] / unit * (1 - ROUND_OFF)) + 1
    if number > MOST_LEVELS:
        raise InputError(
            f"{name}: must be at most {MOST_LEVELS} times as long as its shortest interval"
        )
    at = np.minimum(unit * np.arange(number), times[-1])
    columns = [tuple(np.interp(at, times, column).tolist()) for column in rows[:, 1:].T]
    return Hydrograph(unit, columns[0], columns[1] if len(columns) > 1 else None)


def finite_numbers(where: str, line: Sequence[str], head: Sequence[str]) -> list[float]:
    """The numbers of a row, one for each column. Raises InputError."""
    try:
        values = [float(cell) for cell in line]
    except ValueError:
        values = []
    if len(values) != len(head) or not all(map(math.isfinite, values)):
        raise InputError(f"{where}: {','.join(line)}: must be {len(head)} finite numbers")
    return values
