"""Options of the command line: their types, and those that several commands share."""

from __future__ import annotations

import argparse
import shutil
import sys
import textwrap
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NoReturn, TextIO

from .. import InputError

CASE = (
    "a letter a to k (verification case SSNP142), dam, another case of the package (lifts, koyna, "
    "flood, ...), or the path of a .case file"
)
ENGINE = (
    "condensed (the bodies condensed onto the joint), iterative (large 3D: uncondensed), auto "
    "(default: one of these, by size and steps) or getdp (the reference GetDP model)"
)
RESUMED = "CSV of results; rows that are already in it are not computed again"


class Checked(argparse.Action):
    """Stores `convert(name, text)`, or raises its InputError, which `type` would replace."""

    def __init__(
        self, *, convert: Callable[[str, str], object], repeats: bool = False, **options: Any
    ) -> None:
        """repeats: whether the option may be repeated, which makes a list of its values."""
        super().__init__(**options)
        self.convert, self.repeats = partial(convert, self.dest), repeats

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: object,
        _: str | None = None,
    ) -> None:
        """Store the value, or the list of values."""
        listed = values if isinstance(values, list) else None
        value = self.convert(str(values)) if listed is None else list(map(self.convert, listed))
        before = getattr(namespace, self.dest) or [] if self.repeats else []
        setattr(namespace, self.dest, [*before, value] if self.repeats else value)


def integer(name: str, text: str, least: int) -> int:
    """Return an argument as an integer of at least `least`. Raises InputError."""
    if not text.strip().isdecimal() or int(text) < least:
        raise InputError(f"{name} = {text}: must be an integer >= {least}")
    return int(text)


def time_span(name: str, text: str) -> tuple[float, float]:
    """Return an argument FIRST:LAST as two times [s]. Raises InputError."""
    from ..studies.quake import span_of

    return span_of(f"--{name}", text)


def path(name: str, text: str) -> Path:
    """Return an argument as a path. Raises InputError if it is empty: the current folder."""
    if not text.strip():
        raise InputError(f"{name} = {text!r}: must be a path")
    return Path(text)


def levels(name: str, text: str) -> tuple[float, ...]:
    """Return an argument as water levels [m]. Raises InputError."""
    from ..input.parameters import levels_of

    return levels_of(name, text)


class Parser(argparse.ArgumentParser):
    """Parser of arguments that raises InputError."""

    def error(self, message: str) -> NoReturn:
        """Raise InputError instead of printing the usage."""
        raise InputError(message)

    def add_integer(self, name: str, least: int, **options: Any) -> None:
        """Add an argument that is an integer >= least."""
        convert = partial(integer, least=least)
        self.add_argument(name, action=Checked, convert=convert, metavar="N", **options)

    def add_path(self, name: str, metavar: str, **options: Any) -> None:
        """Add an argument that is a path."""
        self.add_argument(name, action=Checked, convert=path, metavar=metavar, **options)

    def add_levels(self, name: str, **options: Any) -> None:
        """Add an option that is a list of water levels."""
        self.add_argument(name, action=Checked, convert=levels, metavar="H1,H2,...", **options)

    def add_list(self, name: str, metavar: str, **options: Any) -> None:
        """Add an option that may be repeated."""
        self.add_argument(name, action="append", default=[], metavar=metavar, **options)

    # -- options that several commands share

    def add_case(self) -> None:
        """Add the case."""
        self.add_argument("case", metavar="CASE", help=CASE)

    def add_settings(self) -> None:
        """Add the options of all commands that load a case."""
        self.add_list(
            "--set",
            "NAME=VALUE",
            dest="settings",
            help="value of a parameter, in the unit of reference/parameters.md or with one of its "
            "own: E_dam=20*GPa; of one joint: 'lift 25 m.mu=0.7' (repeatable; default: that of the "
            "case)",
        )
        self.add_argument(
            "--run-geo",
            action="store_true",
            help="allow Gmsh to run the .geo file that the case names as its geometry; such a file "
            "can run any program (default: refused)",
        )

    def add_water(
        self,
        help: str = "water levels [m above the heel] at t = 1, 2, ..., rising or falling: 3,6,8,9 "
        "(default: those of the case)",
    ) -> None:
        """Add the levels of reservoir and tailwater; help: on the first."""
        self.add_levels("--levels", help=help)
        tail = "tailwater levels [m], one or as many as levels (default: those of the case)"
        self.add_levels("--tail-levels", help=tail)

    def add_loading(self) -> None:
        """Add the water levels and the load steps."""
        self.add_water()
        self.add_integer(
            "--steps",
            1,
            help="number of equal load steps between two levels (default: those of the case, or 1 "
            "if --levels is set)",
        )

    def add_accuracy(self) -> None:
        """Add the option of the commands that choose the mesh."""
        self.add_argument(
            "--accuracy",
            metavar="PERCENT",
            help="refine the mesh until the estimated errors are smaller: coarse (3 %%), standard "
            "(1 %%), fine (0.2 %%) or a percentage such as 0.5%% (default: no refinement)",
        )

    def add_all_steps(self) -> None:
        """Add the option of a table of all steps."""
        self.add_argument(
            "--all-steps",
            action="store_true",
            help="also write steps.csv: jumps, tractions and internal variables of every step at "
            "all nodes and integration points of the joints",
        )

    def add_sensitivity(self, what: str, note: str = "") -> None:
        """Add the options of derivatives; what: of which result; note: what else a name does."""
        self.add_argument(
            "--sensitivity",
            metavar="NAME,NAME,...",
            help=f"derivatives of {what} with these parameters, in the unit of each; of one joint: "
            f"'lift 25 m.mu'; all: of all that have an effect{note} (default: none)",
        )
        self.add_list(
            "--vary",
            "NAME=DISTRIBUTION",
            help="with --sensitivity: an uncertain parameter, as in reliability: "
            "mu=normal(1.0,0.15); what one standard deviation of each changes is printed and "
            "drawn, instead of one percent (repeatable)",
        )

    def add_wide(self) -> None:
        """Add the option of the commands that print tables, see `table_width`."""
        wide = "print all columns of the tables (default: those that fit the terminal)"
        self.add_argument("--wide", action="store_true", help=wide)

    def add_engine(self, engines: str = ENGINE) -> None:
        """Add the choice of the engine; engines: those of this command."""
        self.add_argument("--engine", default="auto", metavar="NAME", help=engines)

    def add_no_picture(self) -> None:
        """Add the option of a run without pictures."""
        self.add_argument("--no-picture", action="store_true", help="draw no PNG")

    def add_jobs(self) -> None:
        """Add the number of processes."""
        self.add_integer("--jobs", 1, help="number of processes (default: one per core)")

    def add_scheduler(self) -> None:
        """Add the address of a dask scheduler."""
        self.add_argument(
            "--scheduler",
            metavar="ADDRESS",
            help="run on the dask.distributed scheduler at this address (default: this machine)",
        )


def pairs(option: str, texts: list[str], example: str) -> dict[str, str]:
    """The texts NAME=WHAT of an option by name. Raises InputError."""
    result: dict[str, str] = {}
    for text in texts:
        name, equals, what = (part.strip() for part in text.partition("="))
        if not equals or not name or not what:
            raise InputError(f"{option} {text}: must be NAME=..., such as {example}")
        if name in result:
            raise InputError(f"{option} {name}: must be given once")
        result[name] = what
    return result


def deviations(arguments: argparse.Namespace) -> dict[str, float]:
    """Standard deviations of the uncertain parameters beside --sensitivity. Raises InputError."""
    if not arguments.vary:
        return {}
    if not arguments.sensitivity:
        raise InputError("--vary: needs --sensitivity")
    from ..studies.sensitivity import deviations_of

    return deviations_of(pairs("--vary", arguments.vary, "mu=normal(1.0,0.15)"))


def table_width(arguments: argparse.Namespace) -> int | None:
    """The width of printed tables; None with --wide."""
    return None if arguments.wide else shutil.get_terminal_size().columns


def say(*texts: str, end: str = "\n", file: TextIO | None = None) -> None:
    """Print texts to standard output or a file. On a terminal, lines that are wider are broken
    between words, but for rows of tables, which have columns two blanks apart.
    """
    stream, lines = file or sys.stdout, "\n".join(texts).split("\n")
    if stream.isatty():
        width = shutil.get_terminal_size().columns
        wrapper = textwrap.TextWrapper(width, break_long_words=False, break_on_hyphens=False)
        lines = [line if "  " in line.strip() else wrapper.fill(line) for line in lines]
    print("\n".join(lines), end=end, file=stream)
