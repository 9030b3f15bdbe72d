"""Reading of a run's files into plain arrays."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Columns of a table by name.
Table = dict[str, NDArray[np.float64]]


def read_table(path: Path) -> Table:
    """Read the columns of a table."""
    with path.open() as file:
        heads, rows = file.readline().strip().split(","), file.readlines()
    values = np.loadtxt(rows, delimiter=",", ndmin=2) if rows else np.zeros((0, len(heads)))
    return dict(zip(heads, values.T, strict=True))


def rows_where(table: Table, which: NDArray[np.bool_]) -> Table:
    """The rows of a table where a condition (n,) holds."""
    return {name: column[which] for name, column in table.items()}


def split_by(table: Table, name: str) -> list[Table]:
    """The parts of a table of successive rows with the same value in a column."""
    ends = np.flatnonzero(np.diff(table[name])) + 1
    parts = {column: np.split(values, ends) for column, values in table.items()}
    if not len(table[name]):
        return []
    return [{column: parts[column][k] for column in parts} for k in range(len(ends) + 1)]


@dataclass(frozen=True)
class Files:
    """Result files of a command `damjoint run ...` or `damjoint quake ...`, without its --out."""

    folder: Path
    #: the words after `damjoint`
    words: tuple[str, ...]
    exit_code: int = 0

    @cached_property
    def record(self) -> dict[str, Any]:
        """The content of run.json."""
        return dict(json.loads((self.folder / "run.json").read_text()))

    @cached_property
    def history(self) -> Table:
        """Columns of history.csv."""
        return read_table(self.folder / "history.csv")

    def history_of(self, joint: int) -> Table:
        """Columns of history.csv, those of a joint (from 0) without suffix."""
        return without_suffix(self.history, joint)

    @cached_property
    def joint_tables(self) -> list[Table]:
        """Columns of joint.csv, all joints."""
        return split_by(read_table(self.folder / "joint.csv"), "time")

    def tables_of(self, joint: int) -> list[Table]:
        """Columns of joint.csv at a joint (from 0), a table for each time."""
        return [rows_where(table, table["joint"] == joint + 1) for table in self.joint_tables]

    @property
    def stopped(self) -> bool:
        """Whether the run ended before its last level."""
        return bool(self.record["state"] != "complete")


def without_suffix(table: Table, joint: int) -> Table:
    """A table with the columns of a joint (from 0) without suffix."""
    suffix = f"_{joint + 1}"
    of_joint = {n: table[n + suffix] for n in table if joint and n + suffix in table}
    return table | of_joint
