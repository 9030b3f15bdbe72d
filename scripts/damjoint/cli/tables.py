"""damjoint tables."""

from __future__ import annotations

import argparse
from pathlib import Path

from .. import InputError
from .options import Parser

SUMMARY = "write the tables of results for a spreadsheet: a workbook, or CSV with a decimal comma"


def add(command: Parser) -> None:
    """Add the options."""
    command.add_argument(
        "results",
        type=Path,
        metavar="RESULTS",
        help="output folder of any command, or a CSV file such as that of damjoint sweep",
    )
    command.add_argument(
        "--decimal",
        choices=[",", "."],
        help="write CSV files with this decimal sign; with a comma, semicolons separate the cells "
        "(default: a workbook, by openpyxl)",
    )
    command.add_path(
        "--out",
        "PATH",
        help="workbook, or with --decimal a folder (default: RESULTS_tables.xlsx, RESULTS_tables)",
    )


def call(arguments: argparse.Namespace) -> int:
    """Run damjoint tables."""
    from ..post import spreadsheet

    results, decimal = arguments.results, arguments.decimal
    tables = spreadsheet.tables_of(results)
    beside = results.resolve().with_suffix("") if results.is_file() else results.resolve()
    out = arguments.out or Path(f"{beside}_tables{'' if decimal else '.xlsx'}")
    if not decimal and out.suffix != ".xlsx":
        raise InputError(f"out = {out}: must end in .xlsx, or be a folder with --decimal")
    if decimal and out.resolve() == results.resolve():
        raise InputError(f"out = {out}: must not be the folder of the results")
    if decimal:
        spreadsheet.write_csv_files(tables, out, decimal)
    else:
        spreadsheet.write_workbook(tables, out)
    print(f"{len(tables)} tables; {out}")
    return 0
