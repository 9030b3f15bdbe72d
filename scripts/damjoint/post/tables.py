"""Tables of a run as CSV files: joint.csv, history.csv, curve.csv, steps.csv."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np

from ..arrays import Table, Value
from ..model.results import Results, of_control
from ..storage import SAVED, atomic_write

#: A column of a table: numbers or texts.
Column = np.ndarray | Sequence[float | str]
#: Decimals of coordinates in metres: the mesh generator's last digits differ between machines.
DECIMALS = 9
#: Format of numbers, and of those that stresses are computed from again.
DIGITS, EXACT = ".12g", ".17g"


def as_text(cell: str) -> str:
    """Escape a text that a spreadsheet would evaluate as a formula, by an apostrophe."""
    try:
        float(cell)
    except ValueError:
        return "'" + cell if cell[:1] in tuple("=+-@\t\r") else cell
    return cell


def write_csv(target: Path | TextIO, table: Mapping[str, Column], digits: str = DIGITS) -> None:
    """Write a table to a path or open file: numbers in a format, texts escaped by `as_text`."""
    if isinstance(target, Path):
        with atomic_write(target) as path, path.open("w", newline="") as file:
            write_csv(file, table, digits)
        if any(len(column) for column in table.values()):
            SAVED.add(target)
        return
    writer = csv.writer(target, lineterminator="\n")
    writer.writerow(table)
    rows = zip(*table.values(), strict=True)
    writer.writerows(
        [as_text(v) if isinstance(v, str) else format(v, digits) for v in row] for row in rows
    )


def write_rows(target: Path, rows: Sequence[Mapping[str, Value]]) -> None:
    """Write rows of the same columns, with all digits of their numbers."""
    with atomic_write(target) as path, path.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def rounded(joint: Table) -> Table:
    """The table of the joints with rounded coordinates."""
    return joint | {axis: np.round(joint[axis], DECIMALS) + 0.0 for axis in "xyz"}


def write(results: Results, folder: Path) -> None:
    """Write joint.csv and history.csv into a folder; under displacement control also curve.csv."""
    case, history = results.case, results.history
    write_csv(folder / "joint.csv", rounded(results.joint))
    write_csv(folder / "history.csv", history)
    if results.steps:
        write_csv(folder / "steps.csv", results.steps, EXACT)
    if case["drive"] != "level":
        pressure = case["rho_water"] * case["g"] * history["level"]
        curve = {
            "time": history["time"],
            "level": history["level"],
            "pressure": pressure,
            "heel_opening": results.heel,
            "crest_ux": history["crest_ux"],
            **{name: history[name] for name in of_control(case)},
        }
        write_csv(folder / "curve.csv", curve)
