"""damjoint check."""

from __future__ import annotations

import argparse
from pathlib import Path

from .cases import load_cases
from .options import CASE, Parser, say, table_width

SUMMARY = (
    "safety factors by finite elements and by the gravity method; exit code 1 if one is too "
    "low or not judged"
)


def add(command: Parser) -> None:
    """Add the options."""
    command.add_settings()
    command.add_water()
    command.add_accuracy()
    command.add_wide()
    command.add_argument("cases", nargs="+", metavar="CASE", help=f"load combinations, each {CASE}")
    command.add_path(
        "--out",
        "FOLDER",
        default=Path("out/check"),
        help="folder of check.csv, with a folder for each case; cases that are finished there are "
        "not computed again (default: out/check)",
    )
    command.add_jobs()


def call(arguments: argparse.Namespace) -> int:
    """Run damjoint check; 1 if a safety factor is too low or not judged."""
    from ..studies.check import NOT_JUDGED
    from ..studies.check_study import check_cases
    from ..studies.check_tables import text_table

    checks = check_cases(load_cases(arguments, arguments.cases), arguments.out, arguments.jobs)
    errors = [f"{check.case.name}: {check.accuracy}" for check in checks if check.accuracy]
    say(
        "\n\n".join(
            [text_table(checks, table_width(arguments)), *errors, str(arguments.out / "check.csv")]
        )
    )
    return int(any(result.verdict in ("fail", NOT_JUDGED) for c in checks for result in c.results))
