"""damjoint bench."""

from __future__ import annotations

import argparse
from pathlib import Path

from .options import Parser
from .tools import tool

SUMMARY = "measure time, memory and discretisation error; continues if interrupted"


def add(command: Parser) -> None:
    """Add the options."""
    command.add_argument("--short", action="store_true", help="two minutes instead of thirty")
    command.add_path(
        "--out",
        "FOLDER",
        default=Path("out/bench"),
        help="folder of the page, tables and picture (default: out/bench)",
    )


def call(arguments: argparse.Namespace) -> int:
    """Run damjoint bench."""
    tool("bench_page").bench(arguments.out, arguments.short)
    return 0
