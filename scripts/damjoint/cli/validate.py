"""damjoint validate."""

from __future__ import annotations

import argparse
from pathlib import Path

from .options import ENGINE, Parser, say, table_width

SUMMARY = "compare with the published numbers; exit code 1 if a row fails"


def add(command: Parser) -> None:
    """Add the options."""
    command.add_argument(
        "tests",
        nargs="*",
        metavar="FAMILY|CASE",
        default=["ssnp142"],
        help="families of tests (ssnp142, ssnp133, ssnp143, ssnp162, ssnp164, ssnv503, ssnp166, "
        "sdnv138, slammer, wtnp128; all) or cases, such as the modelings a to k of SSNP142 "
        "(default: ssnp142)",
    )
    command.add_path(
        "--out",
        "FOLDER",
        default=Path("out"),
        help="folder that gets a folder for each case (default: out)",
    )
    command.add_jobs()
    command.add_wide()
    command.add_engine(
        f"{ENGINE}, for cases and paths of a load; tests of a point and of an earthquake: condensed"
    )


def call(arguments: argparse.Namespace) -> int:
    """Run damjoint validate; 1 if a row fails."""
    from ..post import validation
    from ..verification import validate

    families, failed = validate.chosen(arguments.tests), False
    summaries = []
    for family, names in families.items():
        options = validate.Options(arguments.out, arguments.engine)
        comparisons = list(validate.compare(family, names, options, arguments.jobs))
        say(f"{family.upper()}: {validation.FAMILIES[family]}\n")
        table = validation.printed(comparisons, table_width(arguments))
        say(table, end="\n\n" if len(families) > 1 else "\n")
        summaries.append(f"{family}: {validation.summary(comparisons)}")
        failed |= any(c.verdict == "fail" for c in comparisons)
    if len(families) > 1:
        say(*summaries)
    return int(failed)
