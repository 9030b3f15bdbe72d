"""damjoint law."""

from __future__ import annotations

import argparse

from .options import Parser

SUMMARY = "evaluate a joint law along a path of displacement jumps"


def add(command: Parser) -> None:
    """Add the options."""
    command.add_settings()
    command.add_argument("law", metavar="LAW", help="rupture, friction, bond, endo or mixed")
    command.add_path(
        "--path",
        "FILE",
        required=True,
        help="CSV with columns delta_n, delta_t1, delta_t2 [m] and, if there is water, p [Pa]; "
        "row n is the state at t = n",
    )
    command.add_path("--out", "FILE", help="CSV of results (default: print it)")


def call(arguments: argparse.Namespace) -> int:
    """Run damjoint law."""
    from ..input import parameters
    from ..studies import law_path

    settings = parameters.settings(arguments.settings)
    law_path.follow(arguments.law, arguments.path, settings, arguments.out)
    return 0
