"""damjoint plot."""

from __future__ import annotations

import argparse
import sys

from .options import Parser

SUMMARY = "draw the pictures of a run again"


def add(command: Parser) -> None:
    """Add the options."""
    command.add_path("out", "FOLDER", help="output folder of the run")


def call(arguments: argparse.Namespace) -> int:
    """Run damjoint plot."""
    from ..pictures import run_picture, water_picture
    from ..post import stored

    runs = [(folder, stored.read(folder)) for folder in stored.runs_in(arguments.out)]
    for folder, result in runs:
        print(run_picture.draw(result, folder))
        if water_picture.has(result.result):
            print(water_picture.draw(result.result, folder))
        if "quake" in result.result.info:
            print(
                "damjoint: of an earthquake only the static states are drawn again", file=sys.stderr
            )
    return 0
