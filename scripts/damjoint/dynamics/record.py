"""Records of the ground's acceleration: CSV files with the columns time [s], horizontal and, if
there is a third one, vertical acceleration.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from .. import ROUND_OFF, InputError
from ..arrays import Array
from ..model.case import Case

#: Standard gravity [m/s2], for records in g.
STANDARD_GRAVITY = 9.80665

#: Limit of the rows of a record.
MOST_ROWS = 1_000_000


@dataclass(frozen=True)
class Record:
    """Acceleration of the ground, linear between its times: > 0 downstream and upwards."""

    #: (n,) [s]; from 0
    times: Array
    #: (n, 2) [m/s2]: along x and y
    acceleration: Array

    @staticmethod
    def of(case: Case) -> Record:
        """The record of a case: scaled, from record_start on, followed by a rest.

        A record that does not start at zero gets a row of zeros one interval before: a load that is
        there at the start would be counted half. Raises InputError.
        """
        if case.record is None:
            raise InputError(
                'record: must be set, record = "FILE.csv"; in the case, or --record FILE.csv'
            )
        if case["record_unit"] == "unstated":
            raise InputError(
                "record_unit = unstated: must be m/s2 or g, the unit of the accelerations in "
                f"{case.record}"
            )
        rows = read(case.record)
        unit = STANDARD_GRAVITY if case["record_unit"] == "g" else 1.0
        parts = {"both": (1, 1), "horizontal": (1, 0), "vertical": (0, 1)}
        scale = unit * case["record_scale"] * np.array(parts[case["record_component"]])
        start, rest = case["record_start"], case["record_rest"]
        times, acceleration = rows[:, 0], rows[:, 1:] * scale
        if not times[0] <= start < times[-1]:
            raise InputError(
                f"record_start = {start:g}: must be >= {times[0]:g} and < {times[-1]:g} s, the "
                f"times of {case.record}"
            )
        if not acceleration.any():
            raise InputError(
                f"record = {case.record}: must have an acceleration other than zero "
                f"(record_component = {case['record_component']}, record_scale = "
                f"{case['record_scale']:g})"
            )
        interval = float(np.diff(times).min())
        first = at(times, acceleration, start)
        later = times > start + ROUND_OFF * interval
        times = np.concatenate([[start], times[later]])
        acceleration = np.vstack([first, acceleration[later]])
        if first.any():
            times = np.concatenate([[start - interval], times])
            acceleration = np.vstack([np.zeros(2), acceleration])
        if rest > 0:
            ends = times[-1] + np.array([interval, max(rest, 2 * interval)])
            times = np.concatenate([times, ends])
            acceleration = np.vstack([acceleration, np.zeros((2, 2))])
        return Record(times - times[0], acceleration)

    @property
    def duration(self) -> float:
        """The last time [s]."""
        return float(self.times[-1])

    @property
    def interval(self) -> float:
        """The shortest interval between two rows [s]."""
        return float(np.diff(self.times).min())

    def at(self, time: float) -> Array:
        """Acceleration along x and y (2,) [m/s2] at a time."""
        return at(self.times, self.acceleration, time)

    def velocity(self, times: Array) -> Array:
        """Velocity along x and y (n, 2) [m/s] at times (n,): the integral of the acceleration, zero
        before the record.
        """
        row = np.clip(np.searchsorted(self.times, times, "right") - 1, 0, None)
        since = np.maximum(times - self.times[row], 0)[:, None]
        mean = (self.acceleration[row] + at(self.times, self.acceleration, times)) / 2
        return self._velocities[row] + since * mean

    @cached_property
    def _velocities(self) -> Array:
        """Velocity at the times (n, 2)."""
        means = (self.acceleration[1:] + self.acceleration[:-1]) / 2
        return np.vstack([np.zeros(2), np.cumsum(np.diff(self.times)[:, None] * means, axis=0)])

    def delayed(self, time: float) -> Record:
        """The record later by a time [s], after rest."""
        return Record(
            np.append(0.0, self.times + time), np.vstack([np.zeros(2), self.acceleration])
        )


def at(times: Array, values: Array, time: float | Array) -> Array:
    """Values (n, 2) at times (n,), linear between them, at a time (2,) or at times (m, 2)."""
    return np.stack([np.interp(time, times, column) for column in values.T], axis=-1)


def read(path: Path) -> Array:
    """The rows of a record (n, 3): time, horizontal and vertical acceleration, 0 if it has none.

    Lines that begin with # are comments; the first line may be a heading. Raises InputError.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines = [line for line in file if line.strip() and not line.startswith("#")]
    except OSError as error:
        raise InputError(f"record = {path}: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise InputError(f"record = {path}: {error}") from None
    table = [[cell.strip() for cell in row] for row in csv.reader(lines[: MOST_ROWS + 2])]
    rows = []
    for number, row in enumerate(table):
        try:
            rows.append([float(cell) for cell in row])
        except ValueError:
            if number:
                raise InputError(
                    f"record = {path}, row {number + 1}: {','.join(row)[:60]}: must be numbers: "
                    "time [s], horizontal and, if any, vertical acceleration"
                ) from None
    widths = {len(row) for row in rows}
    if not 2 <= len(rows) <= MOST_ROWS or widths not in ({2}, {3}):
        raise InputError(
            f"record = {path}: must have 2 to {MOST_ROWS} rows of time [s], horizontal and, if "
            "any, vertical acceleration"
        )
    values = np.pad(np.array(rows), ((0, 0), (0, 3 - widths.pop())))
    if not np.isfinite(values).all() or not (np.diff(values[:, 0]) > 0).all():
        raise InputError(f"record = {path}: must have finite numbers, and times that increase")
    return values
