"""damjoint gui."""

from __future__ import annotations

import argparse

from .options import CASE, Parser, settings_options

SUMMARY = "open a case in a window"

#: Options that it shares with other commands.
SHARED = (settings_options,)


def add(command: Parser) -> None:
    """Add the options."""
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
