"""Evaluate a joint law along a path of displacement jumps in a CSV file."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np

from .. import InputError
from ..arrays import Settings, Value
from ..engines.getdp.law import evaluate
from ..input.parameters import parameter
from ..post.tables import write_csv
from ..storage import read_limited_text

JUMPS = ("delta_n", "delta_t1", "delta_t2")
#: Longest file of a path [bytes].
LONGEST = 100_000_000


def read_path(path: Path) -> dict[str, np.ndarray]:
    """Read a path: columns delta_n, delta_t1, delta_t2 [m] and optionally p [Pa].

    Raises InputError.
    """
    lines = read_limited_text(path, f"path = {path}", LONGEST).splitlines()
    try:
        rows = list(csv.DictReader(lines, skipinitialspace=True))
    except csv.Error as error:
        raise InputError(f"path = {path}: must be a readable CSV file ({error})") from None
    names = [name for name in (*JUMPS, "p") if rows and name in rows[0]]
    if not rows or not set(JUMPS) <= set(names):
        raise InputError(
            f"path = {path}: must have the columns {','.join(JUMPS)} (and optionally p) "
            "and at least one row"
        )
    table = {}
    for name in names:
        try:
            table[name] = np.array([float(row[name]) for row in rows])
        except (TypeError, ValueError):
            raise InputError(f"path = {path}: column {name} must hold numbers only") from None
        if not np.isfinite(table[name]).all():
            raise InputError(f"path = {path}: column {name} must hold finite numbers only")
    return table


def follow(law: str, path: Path, settings: Settings, out: Path | None) -> None:
    """Evaluate a law along a path and write path and result to out; None: to standard output.

    Raises InputError.
    """
    parameter("law").check(law)
    values: dict[str, Value] = {}
    for name, value in settings.items():
        if isinstance(value, tuple):
            listed = ",".join(map(str, value))
            raise InputError(f"{name} = {listed}: must be a single value, a law has no joints")
        values[name] = value
    table = read_path(path)
    if out is not None and not out.parent.is_dir():
        raise InputError(f"out = {out}: must be a file in an existing folder")
    result = evaluate(law, np.column_stack([table[n] for n in JUMPS]), table.get("p"), values)
    write_csv(out or sys.stdout, {**table, **result})
