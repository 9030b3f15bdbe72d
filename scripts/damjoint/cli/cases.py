"""Load and announce the case of a command."""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from .. import InputError
from .options import say

if TYPE_CHECKING:
    from ..input.case import Case


def load_case(arguments: argparse.Namespace, name: str) -> Case:
    """Load a case with the options of a command, and print the remarks on it."""
    return load_cases(arguments, [name])[0]


def load_cases(
    arguments: argparse.Namespace, names: Sequence[str], records: Sequence[Path | None] = (None,)
) -> list[Case]:
    """Load cases with the options of a command, each with the records of earthquakes, None for its
    own; print the remarks on them, and a warning if 3D runs are slow.
    """
    from ..input import parameters
    from ..input.resolve import load
    from ..statics.notes import remarks

    options = ("levels", "tail_levels", "steps", "accuracy")
    given = {option: getattr(arguments, option, None) for option in options}
    settings = parameters.settings(arguments.settings)
    cases: list[Case] = []
    printed = set[tuple[str, str]]()
    all_steps = getattr(arguments, "all_steps", False)
    if all_steps and arguments.engine == "getdp":
        raise InputError("--all-steps: must not be given with --engine getdp")
    for name, record in itertools.product(names, records):
        case = replace(load(name, settings, **given, record=record), all_steps=all_steps)
        cases.append(case)
        for remark in remarks(case):
            if (case.name, remark) not in printed:
                print_note(case, remark)
                printed.add((case.name, remark))
    if any(case["dim"] == 3 for case in cases) and getattr(arguments, "engine", "") != "getdp":
        warn_if_slow()
    return cases


def print_note(case: Case, note: str) -> None:
    """Print a note on a case to standard error."""
    say(f"damjoint: {case.name}: {note}", file=sys.stderr)


def warn_if_slow() -> None:
    """Print a warning if 3D runs are slow because MUMPS is not installed."""
    from ..fem import factor

    if factor.is_slow():
        say(
            f"damjoint: 3D runs take several times longer with {factor.name()} than with MUMPS; "
            "'make setup' installs MUMPS or prints the packages that it needs",
            file=sys.stderr,
        )
