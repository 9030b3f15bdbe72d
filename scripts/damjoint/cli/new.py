"""damjoint new."""

from __future__ import annotations

import argparse

from .options import Parser

SUMMARY = "write a case file with all parameters, explained in comments"


def add(command: Parser) -> None:
    """Add the options."""
    command.add_path("path", "MY.case", help="the file; it must not exist yet")


def call(arguments: argparse.Namespace) -> int:
    """Run damjoint new."""
    from ..input import template

    template.write(arguments.path)
    print(f"{arguments.path}: a 45 m dam on rock; damjoint run {arguments.path}")
    return 0
