"""damjoint stress."""

from __future__ import annotations

import argparse
from pathlib import Path

from .options import RESUMED, Parser
from .tools import tool

SUMMARY = "verify the result files of random dams; exit code 1 if there is a defect"


def add(command: Parser) -> None:
    """Add the options."""
    command.add_integer(
        "count", 1, nargs="?", default=500, help="number of random dams (default: 500)"
    )
    command.add_integer("--seed", 1, default=1, help="seed of the random numbers (default: 1)")
    command.add_integer(
        "--seeds", 1, default=1, help="so many dams of each of so many seeds (default: 1)"
    )
    command.add_argument("--quake", action="store_true", help="random earthquakes instead")
    command.add_argument(
        "--with",
        dest="words",
        metavar="WORDS",
        default="",
        help="only those whose command contains these words, such as time_unit= (default: all)",
    )
    command.add_argument(
        "--mutate",
        action="store_true",
        help="instead put errors into copies of the package, one by one, and look in which random "
        "dam the verification notices them; exit code 1 if more than one is not noticed",
    )
    command.add_jobs()
    command.add_path(
        "--out", "FILE", default=Path("stress.csv"), help=f"{RESUMED} (default: stress.csv)"
    )


def call(arguments: argparse.Namespace) -> int:
    """Run damjoint stress; 1 if a run is a defect."""
    if arguments.mutate:
        return mutate(arguments)
    stress = tool("stress")
    options = arguments.seed, arguments.out, arguments.jobs, arguments.quake, arguments.seeds
    rows = stress.stress(arguments.count, *options, arguments.words)
    for row in rows:
        if row["class"] == stress.DEFECT:
            print(f"{row['scene']}: {row['findings']}\n  {row['command']}")
    for kind, part in stress.IN_TIME.items():
        chosen = [row for row in rows if part in row["command"]]
        if chosen:
            print(f"{kind}: {as_counted(stress.counts(chosen))}")
    numbers = stress.counts(rows)
    print(as_counted(numbers), arguments.out, sep="; ")
    return int(numbers[stress.DEFECT] > 0)


def as_counted(numbers: dict[str, int]) -> str:
    """Numbers of scenes by class, in words."""
    return "; ".join(f"{number} {name}" for name, number in numbers.items())


def mutate(arguments: argparse.Namespace) -> int:
    """Run damjoint stress --mutate; 1 if more than one mutation is not noticed."""
    rows = tool("mutations").mutate(arguments.seed, arguments.out, arguments.jobs)
    for row in rows:
        noticed = f"{row['scene']}: {row['finding']}" if row["scene"] else "not noticed"
        print(f"{row['mutation']}: {noticed}")
    missed = sum(not row["scene"] for row in rows)
    print(f"{len(rows) - missed} of {len(rows)} mutations noticed; {arguments.out}")
    return int(missed > 1)
