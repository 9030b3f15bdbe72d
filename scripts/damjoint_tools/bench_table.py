"""Tables of a benchmark, and the log from which an interrupted benchmark is resumed."""

from __future__ import annotations

import contextlib
import csv
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from damjoint.storage import atomic_write

from .provenance import provenance


class Measurements:
    """Log of measured values, a line of JSON each.

    The first line holds the form of the benchmark and the provenance. A log of other code, of
    another machine or of the other form is discarded; a log that is resumed keeps its first day.
    """

    def __init__(self, path: Path, short: bool) -> None:
        self.path, self.short = path, short
        self.provenance = provenance()
        #: measured values; keys as JSON
        self.values: dict[str, object] = {}
        with contextlib.suppress(ValueError):  # last line written by half
            self._read()
        pairs = [[json.loads(key), value] for key, value in self.values.items()]
        with atomic_write(path) as part:
            lines = [[short, self.provenance], *pairs]
            part.write_text("".join(json.dumps(line) + "\n" for line in lines))

    def _read(self) -> None:
        """Read the log if it is of this benchmark. Raises ValueError at a damaged line."""
        first, *lines = self.path.read_text().splitlines() if self.path.exists() else ["null"]
        match json.loads(first):
            case [self.short, {"code": code, "machine": machine} as earlier]:
                if (code, machine) != (self.provenance["code"], self.provenance["machine"]):
                    return
            case _:
                return
        self.provenance = earlier
        for line in lines:
            key, value = json.loads(line)
            self.values[json.dumps(key)] = value

    def __contains__(self, key: tuple[Any, ...]) -> bool:
        return json.dumps(key) in self.values

    def get(self, key: tuple[Any, ...], measure: Callable[[], object]) -> Any:
        """Return the value under a key, as JSON's types; measure it if it is not in the log."""
        name = json.dumps(key)
        if name not in self.values:
            self.values[name] = to_json(measure())
            with self.path.open("a") as file:
                file.write(json.dumps([key, self.values[name]]) + "\n")
        return self.values[name]


def to_json(value: object) -> object:
    """Convert to JSON's types: numpy's numbers to Python's, tuples and arrays to lists."""
    if isinstance(value, (list, tuple, np.ndarray)):
        return [to_json(item) for item in value]
    return value.item() if isinstance(value, np.generic) else value


class Table(dict[str, list[Any]]):
    """Columns of a table, {name: values}, filled row by row."""

    def __init__(self, name: str, *columns: str) -> None:
        super().__init__({column: [] for column in columns})
        self.name = name

    def add(self, *values: object) -> None:
        """Add a row."""
        for column, value in zip(self.values(), values, strict=True):
            column.append(value)

    def add_measured(
        self, measurements: Measurements, key: tuple[Any, ...], measure: Callable[[], Sequence[Any]]
    ) -> None:
        """Add a row: the key in the first columns, the measured values in the others."""
        self.add(*key, *measurements.get((self.name, *key), measure))

    def rows_where(self, *first: object) -> np.ndarray:
        """Return the indices of the rows whose first columns have these values."""
        return np.flatnonzero(
            [row[: len(first)] == first for row in zip(*self.values(), strict=True)]
        )

    def write(self, path: Path) -> None:
        """Write the table as CSV."""
        with path.open("w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(self)
            writer.writerows(zip(*self.values(), strict=True))
