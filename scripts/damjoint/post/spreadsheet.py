"""Tables of results for a spreadsheet: a workbook, or CSV files with a decimal comma."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from pathlib import Path

from .. import InputError
from ..storage import atomic_write

#: Rows of cells, the names of the columns first.
Rows = list[list[float | str]]
#: Limits of a workbook: length of a sheet's name, characters that it must not have, rows.
LONGEST, FORBIDDEN, MOST_ROWS = 31, "[]:*?/\\", 1_048_576


def tables_of(path: Path) -> dict[str, Rows]:
    """The tables of a CSV file, or of all CSV files in a folder and below it, by their names there.

    Raises InputError if there is none.
    """
    files = [path] if path.is_file() else sorted(path.rglob("*.csv"))
    if not files:
        raise InputError(f"{path}: must be a folder of results with tables, or a CSV file")
    start = path.parent if path.is_file() else path
    return {
        " ".join(file.relative_to(start).with_suffix("").parts): rows_of(file) for file in files
    }


def rows_of(file: Path) -> Rows:
    """The rows of a CSV file; a number that is not known is an empty cell.

    Raises InputError if it is not text.
    """
    try:
        with file.open(newline="", encoding="utf-8") as opened:
            return [list(map(parsed_cell, row)) for row in csv.reader(opened)]
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{file}: must be a CSV file ({error})") from None


def parsed_cell(text: str) -> float | str:
    """A number, or another text as it is; nan is empty."""
    try:
        value = float(text)
    except ValueError:
        return text
    return "" if math.isnan(value) else value if math.isfinite(value) else text


def write_workbook(tables: Mapping[str, Rows], path: Path) -> None:
    """Write tables as the sheets of a workbook, the names of their columns fixed above.

    Raises InputError without openpyxl, or if a table has too many rows.
    """
    try:
        from openpyxl import Workbook
    except ImportError:
        raise InputError(
            f"out = {path}: needs openpyxl; pip install openpyxl, or --decimal for CSV files"
        ) from None
    workbook, names = Workbook(), set[str]()
    workbook.remove(workbook.active)
    for table, rows in tables.items():
        if len(rows) > MOST_ROWS:
            raise InputError(f"{table}.csv: must have at most {MOST_ROWS} rows for a workbook")
        name = sheet_name(table, names)
        names.add(name.lower())
        sheet = workbook.create_sheet(name)
        for row in rows:
            sheet.append(row)
        sheet.freeze_panes = "A2"
    with atomic_write(path) as part:
        workbook.save(part)


def sheet_name(table: str, taken: set[str]) -> str:
    """A name of a sheet that no other has."""
    plain = "".join("_" if letter in FORBIDDEN else letter for letter in table)
    names = (
        f"{plain[: LONGEST - len(end)]}{end}" for end in ["", *(f" {k}" for k in range(2, 999))]
    )
    return next(name for name in names if name.lower() not in taken)


def write_csv_files(tables: Mapping[str, Rows], folder: Path, decimal: str) -> None:
    """Write tables as CSV files with a decimal sign; with a comma, cells end with semicolons."""
    folder.mkdir(parents=True, exist_ok=True)
    for table, rows in tables.items():
        with atomic_write(folder / f"{table}.csv") as part, part.open("w", newline="") as file:
            writer = csv.writer(file, delimiter=";" if decimal == "," else ",")
            for row in rows:
                writer.writerow([number_text(c, decimal) for c in row])


def number_text(cell: float | str, decimal: str) -> str:
    """A cell as text; texts as they are."""
    return cell if isinstance(cell, str) else format(cell, ".12g").replace(".", decimal)
