"""damjoint report."""

from __future__ import annotations

import argparse
from pathlib import Path

from .options import Parser

SUMMARY = "write a report on runs and studies, as HTML or PDF"


def add(command: Parser) -> None:
    """Add the options."""
    command.add_path(
        "out",
        "FOLDER",
        nargs="+",
        help="output folders of runs, of damjoint check, reliability or calibrate, or the CSV file "
        "of a sweep with its fragility",
    )
    command.add_path(
        "--to",
        "FILE",
        default=Path("report.html"),
        help="the report; a PDF if the name ends in .pdf, which needs weasyprint (default: "
        "report.html)",
    )
    command.add_argument(
        "--dam", default="", metavar="NAME", help="name of the dam (default: the title of the runs)"
    )


def call(arguments: argparse.Namespace) -> int:
    """Run damjoint report."""
    from ..studies import report

    report.write(arguments.out, arguments.to, arguments.dam)
    print(arguments.to)
    return 0
