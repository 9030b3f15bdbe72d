"""damjoint check."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from .cases import load_cases
from .options import CASE, Parser, deviations, say, table_width

if TYPE_CHECKING:
    from ..input.case import Case

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
    command.add_sensitivity("the safety factors and of the results, sensitivity.csv of each case,")


def call(arguments: argparse.Namespace) -> int:
    """Run damjoint check; 1 if a safety factor is too low or not judged."""
    from ..studies.check import NOT_JUDGED
    from ..studies.check_study import check_cases
    from ..studies.check_tables import text_table

    cases, out = load_cases(arguments, arguments.cases), arguments.out
    derivatives = arguments.sensitivity or "", deviations(arguments)
    checks = check_cases(cases, out, arguments.jobs, *derivatives)
    errors = [f"{check.case.name}: {check.accuracy}" for check in checks if check.accuracy]
    derived = change_lines(cases, out, table_width(arguments)) if arguments.sensitivity else []
    say(
        "\n\n".join(
            [text_table(checks, table_width(arguments)), *errors, *derived, str(out / "check.csv")]
        )
    )
    return int(any(result.verdict in ("fail", NOT_JUDGED) for c in checks for result in c.results))


def change_lines(cases: Sequence[Case], out: Path, width: int | None) -> list[str]:
    """What the parameters change in each scene of cases, by its record below out; width: of the
    terminal, None: all columns.
    """
    from ..post import folder as folders
    from ..studies import sensitivity

    texts = []
    for scene in (scene for case in cases for scene in case.scenes()):
        case = next(case for case in cases if case.name == scene.name)
        info = folders.read_info(folders.scene_folder(case, scene, out / case.name)) or {}
        if derived := info.get("sensitivity"):
            words = sensitivity.words(derived, width)
            texts.append(f"{scene.name}, uplift {scene['uplift']}:\n{words}")
    return texts
