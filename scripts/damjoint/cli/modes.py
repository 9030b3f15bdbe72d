"""damjoint modes."""

from __future__ import annotations

import argparse
from pathlib import Path

from .cases import load_case
from .options import Parser, say

SUMMARY = (
    "natural frequencies and shapes, without a record: joints closed, with and without water, on "
    "elastic and on rigid rock"
)


def add(command: Parser) -> None:
    """Add the options."""
    command.add_settings()
    command.add_water()
    command.add_case()
    command.add_integer("--number", 1, default=5, help="number of modes (default: 5)")
    command.add_path("--out", "FOLDER", help="output folder (default: out/CASE_modes)")
    command.add_no_picture()


def call(arguments: argparse.Namespace) -> int:
    """Run damjoint modes."""
    from ..studies import modes_study

    case = load_case(arguments, arguments.case)
    out = arguments.out or Path("out") / f"{case.name}_modes"
    natural = modes_study.run(case, arguments.number, out, not arguments.no_picture)
    say(f"{case.name}: {modes_study.about(natural)}; {out}\n\n{modes_study.text(natural)}")
    return 0
