"""A joint law along the path of jumps in a file."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np

from .. import InputError
from ..engines.getdp.law import evaluate
from ..model.parameters import parameter
from ..post.tables import write_csv

JUMPS = ("delta_n", "delta_t1", "delta_t2")


def read_path(path: Path) -> dict[str, np.ndarray]:
    """A path file: columns delta_n, delta_t1, delta_t2 [m] and optionally p [Pa]. Raises
    InputError.
    """
    try:
        with path.open(newline="") as file:
            rows = list(csv.DictReader(file, skipinitialspace=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"path = {path}: {error}") from None
    heads = [h for h in ("delta_n", "delta_t1", "delta_t2", "p") if rows and h in rows[0]]
    if not rows or not set(JUMPS) <= set(heads):
        raise InputError(
            f"path = {path}: must have the columns delta_n,delta_t1,delta_t2 (and optionally p) "
            "and at least one row"
        )
    table = {}
    for head in heads:
        try:
            table[head] = np.array([float(row[head]) for row in rows])
        except (TypeError, ValueError):
            raise InputError(f"path = {path}: column {head} must hold numbers only") from None
        if not np.isfinite(table[head]).all():
            raise InputError(f"path = {path}: column {head} must hold finite numbers only")
    return table


def follow(law: str, path: Path, settings: dict, out: Path | None) -> None:
    """Evaluate a law along the path of a CSV file and write path and answer to out, or print
    them.
    """
    parameter("law").check(law)
    table = read_path(path)
    if out is not None and not out.parent.is_dir():
        raise InputError(f"out = {out}: must be a file in an existing folder")
    answer = evaluate(law, np.column_stack([table[n] for n in JUMPS]), table.get("p"), settings)
    write_csv(out or sys.stdout, {**table, **answer})
