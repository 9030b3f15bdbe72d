"""damjoint gui."""

from __future__ import annotations

import argparse

from .options import CASE, Parser

SUMMARY = "open a case in a window"


def add(command: Parser) -> None:
    """Add the options."""
    command.add_settings()
    command.add_argument(
        "case", nargs="?", default="dam", metavar="CASE", help=f"{CASE} (default: dam)"
    )


def call(arguments: argparse.Namespace) -> int:
    """Run damjoint gui; 0 when the window is closed."""
    from ..gui.sheet import Request
    from ..gui.window import gui
    from ..input import parameters

    gui(Request(arguments.case, parameters.settings(arguments.settings)))
    return 0
