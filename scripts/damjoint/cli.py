"""The command line: the options of each command and the function that runs it."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import io
import os
import sys
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from . import RUN_GEO, InputError, RunError, __version__
from .storage import SAVED

if TYPE_CHECKING:
    from argparse import _SubParsersAction as Commands

    from .model.case import Case
    from .post.drawing_process import DrawingProcess
    from .studies.plan import Plan, Row

CASE = "a letter a to k (verification case SSNP142), dam, or the path of a .case file"
ENGINE = (
    "auto (default), condensed (both bodies condensed onto the joint; fast) or getdp (the "
    "reference GetDP model)"
)
TAIL_LEVELS = "tailwater levels [m], one or as many as levels (default: those of the case)"
JOBS = "number of processes (default: one per core)"
RESUMED = "CSV of results; rows that are already in it are not computed again"


class Checked(argparse.Action):
    """Action that stores `convert(name, text)`, which raises InputError. As a `type`,
    argparse would replace its message.
    """

    def __init__(self, *, convert: Callable[[str, str], object], **options: object) -> None:
        super().__init__(**options)
        self.convert = partial(convert, self.dest)

    def __call__(
        self, parser: Parser, namespace: argparse.Namespace, values: object, _: str | None = None
    ) -> None:
        """Store the value, or the list of values."""
        listed = isinstance(values, list)
        value = [self.convert(text) for text in values] if listed else self.convert(str(values))
        setattr(namespace, self.dest, value)


def integer(name: str, text: str, least: int) -> int:
    """Return an argument as an integer of at least `least`. Raises InputError."""
    if not text.strip().isdecimal() or int(text) < least:
        raise InputError(f"{name} = {text}: must be an integer >= {least}")
    return int(text)


def slip(name: str, text: str) -> float:
    """Return an argument as a length [m]. Raises InputError."""
    from .model.arithmetic import number

    try:
        value = number(text)
    except ValueError:
        value = 0.0
    if not value > 0:
        raise InputError(f"--{name} {text}: must be a slip > 0 m")
    return value


def time_span(name: str, text: str) -> tuple[float, float]:
    """Return an argument FIRST:LAST as two times [s]. Raises InputError."""
    from .studies.quake import span_of

    return span_of(f"--{name}", text)


def path(name: str, text: str) -> Path:
    """Return an argument as a path. Raises InputError if it is empty: the current folder."""
    if not text.strip():
        raise InputError(f"{name} = {text!r}: must be a path")
    return Path(text)


def levels(name: str, text: str) -> tuple[float, ...]:
    """Return an argument as water levels [m]. Raises InputError."""
    from .model.parameters import levels_of

    return levels_of(name, text)


class Help(argparse.HelpFormatter):
    """Help as wide as the terminal. (argparse loads shutil for it, and that what compresses.)"""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, width=terminal_width() - 2)


def terminal_width() -> int:
    """Number of columns: $COLUMNS, else of the terminal, else 80."""
    with contextlib.suppress(KeyError, ValueError):
        if int(os.environ["COLUMNS"]) > 0:
            return int(os.environ["COLUMNS"])
    with contextlib.suppress(OSError, ValueError, AttributeError):
        return os.get_terminal_size(sys.__stdout__.fileno()).columns or 80
    return 80


class Parser(argparse.ArgumentParser):
    """Parser of arguments that raises InputError."""

    def __init__(self, **options: object) -> None:
        super().__init__(formatter_class=Help, **options)

    def error(self, message: str) -> None:
        """Raise InputError instead of printing the usage."""
        raise InputError(message)

    def add_integer(self, name: str, least: int, **options: object) -> None:
        """Add an argument that is an integer >= least."""
        convert = partial(integer, least=least)
        self.add_argument(name, action=Checked, convert=convert, metavar="N", **options)

    def add_path(self, name: str, metavar: str, **options: object) -> None:
        """Add an argument that is a path."""
        self.add_argument(name, action=Checked, convert=path, metavar=metavar, **options)

    def add_levels(self, name: str, **options: object) -> None:
        """Add an option that is a list of water levels."""
        self.add_argument(name, action=Checked, convert=levels, metavar="H1,H2,...", **options)

    def add_list(self, name: str, metavar: str, **options: object) -> None:
        """Add an option that may be repeated."""
        self.add_argument(name, action="append", default=[], metavar=metavar, **options)


def settings_options() -> Parser:
    """Options of all commands that load a case."""
    options = Parser(add_help=False)
    options.add_list(
        "--set",
        "NAME=VALUE",
        dest="settings",
        help="value of a parameter, in the unit of reference/parameters.md or with one of its own: "
        "E_dam=20*GPa (repeatable; default: that of the case)",
    )
    options.add_argument(
        "--run-geo",
        action="store_true",
        help="allow Gmsh to run the .geo file that the case names as its geometry; such a file can "
        "run any program (default: refused)",
    )
    return options


def water_options() -> Parser:
    """Options of the commands that fill the reservoir."""
    options = Parser(add_help=False)
    options.add_levels(
        "--levels",
        help="water levels [m above the heel] at t = 1, 2, ..., rising or falling: 3,6,8,9 "
        "(default: those of the case)",
    )
    options.add_levels("--tail-levels", help=TAIL_LEVELS)
    return options


def accuracy_options() -> Parser:
    """The option of the commands that choose the mesh."""
    options = Parser(add_help=False)
    options.add_argument(
        "--accuracy",
        metavar="PERCENT",
        help="refine the mesh until the estimated errors are smaller: coarse (3 %%), standard "
        "(1 %%), fine (0.2 %%) or a percentage such as 0.5%% (default: no refinement)",
    )
    return options


def loading_options() -> Parser:
    """Options of the water and of the load steps."""
    options = Parser(add_help=False, parents=[water_options()])
    options.add_integer(
        "--steps",
        1,
        help="number of equal load steps between two levels (default: those of the case, or 1 if "
        "--levels is set)",
    )
    return options


def add_command(commands: Commands, call: Callable, summary: str, *options: Parser) -> Parser:
    """Add the command `damjoint NAME`.

    call: function do_NAME of the parsed arguments; returns the exit code. options: shared options.
    """
    command = commands.add_parser(
        call.__name__.removeprefix("do_"),
        parents=options,
        help=summary,
        description=f"{summary[0].upper()}{summary[1:]}.",
    )
    command.set_defaults(call=call)
    return command


def parser(word: str = "") -> Parser:
    """Return the parser of the command: of all commands, or of the one that the first word of the
    command line names.
    """
    top = Parser(
        prog="damjoint",
        description="Concrete gravity dams on a thin joint: opening, cracking, sliding and uplift.",
        epilog="damjoint COMMAND --help explains the options of a command.",
    )
    top.add_argument("--version", action="version", version=__version__)
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)
    adders = (
        *(add_run, add_check, add_plot, add_report, add_gui, add_new, add_validate, add_critical),
        *(add_quake, add_sweep, add_stress, add_bench, add_law),
    )
    named = [add for add in adders if add.__name__ == f"add_{word}"]
    for add in named or adders:
        add(commands)
    return top


def add_run(commands: Commands) -> None:
    """Add damjoint run."""
    summary = "fill the reservoir of a case; exit code 1 if the dam fails or the run stops early"
    options = settings_options(), loading_options(), accuracy_options()
    command = add_command(commands, do_run, summary, *options)
    command.add_argument("case", metavar="CASE", help=CASE)
    command.add_path("--out", "FOLDER", help="output folder (default: out/CASE)")
    command.add_argument(
        "--no-fields", action="store_true", help="write no files of displacement and stress"
    )
    command.add_argument("--no-picture", action="store_true", help="draw no PNG")
    command.add_argument("--engine", default="auto", metavar="NAME", help=ENGINE)


def do_run(arguments: argparse.Namespace) -> int:
    """Run damjoint run; 0, or 1 if the dam fails or the run stopped before its last level."""
    if arguments.no_picture:
        return run_and_print(arguments, None)
    from .post.drawing_process import DrawingProcess

    with DrawingProcess() as drawing:  # before the other libraries are loaded
        return run_and_print(arguments, drawing)


def run_and_print(arguments: argparse.Namespace, drawing: DrawingProcess | None) -> int:
    """Run a case and print its results; drawing: draws its pictures (None: there are none)."""
    from .post import summary
    from .runner import run
    from .statics.verdict import failed, hints, path_statement, statement, verdict

    case = load_case(arguments, arguments.case)
    out = arguments.out or Path("out") / case.name
    fields, picture = not arguments.no_fields, drawing is not None
    code = 0
    if case["dim"] == 3 and arguments.engine != "getdp":
        warn_if_slow()
    for result in run(case, out, fields, picture, engine=arguments.engine, drawing=drawing):
        history = result.history
        print(
            f"{case.name}, uplift {result.case['uplift']}: {verdict(result)}; "
            f"{len(history['time'])} steps, {history['iterations'].sum():.0f} iterations; {out}"
        )
        if result.last:
            print(f"\n{summary.text(result)}")
        driven = case["drive"] != "level"
        lines = [path_statement(result) if driven else "", statement(result), *hints(result)]
        lines.append(result.info.get("error_estimate", {}).get("statement", ""))
        if any(lines):
            print("", *filter(None, lines), sep="\n")
        code = max(code, int(failed(result)))
    return code


def add_check(commands: Commands) -> None:
    """Add damjoint check."""
    summary = (
        "safety factors by finite elements and by the gravity method; exit code 1 if one is too "
        "low or not judged"
    )
    options = settings_options(), water_options(), accuracy_options()
    command = add_command(commands, do_check, summary, *options)
    command.add_argument("cases", nargs="+", metavar="CASE", help=f"load combinations, each {CASE}")
    command.add_path(
        "--out",
        "FOLDER",
        default=Path("out/check"),
        help="folder of check.csv, with a folder for each case (default: out/check)",
    )


def do_check(arguments: argparse.Namespace) -> int:
    """Run damjoint check; 1 if a safety factor is too low or not judged."""
    from .studies.check import NOT_JUDGED, check_cases, text_table

    cases = [load_case(arguments, name) for name in arguments.cases]
    if any(case["dim"] == 3 for case in cases):
        warn_if_slow()
    checks = check_cases(cases, arguments.out)
    errors = [f"{check.case.name}: {check.accuracy}" for check in checks if check.accuracy]
    print("\n\n".join([text_table(checks), *errors, str(arguments.out / "check.csv")]))
    return int(any(result.verdict in ("fail", NOT_JUDGED) for c in checks for result in c.results))


def add_plot(commands: Commands) -> None:
    """Add damjoint plot."""
    command = add_command(commands, do_plot, "draw the pictures of a run again")
    command.add_path("out", "FOLDER", help="output folder of the run")


def do_plot(arguments: argparse.Namespace) -> int:
    """Run damjoint plot."""
    from .post import pictures, stored

    runs = [(folder, stored.read(folder)) for folder in stored.runs_in(arguments.out)]
    for folder, result in runs:
        print(pictures.draw(result, folder))
        if "quake" in result.result.info:
            print(
                "damjoint: of an earthquake only the static states are drawn again", file=sys.stderr
            )
    return 0


def add_report(commands: Commands) -> None:
    """Add damjoint report."""
    command = add_command(commands, do_report, "write a report on runs, as HTML or PDF")
    command.add_path(
        "out", "FOLDER", nargs="+", help="output folders of runs, or that of damjoint check"
    )
    command.add_path(
        "--to",
        "FILE",
        default=Path("report.html"),
        help="the report; a PDF if the name ends in .pdf, which needs weasyprint (default: "
        "report.html)",
    )


def do_report(arguments: argparse.Namespace) -> int:
    """Run damjoint report."""
    from .studies import report

    report.write(arguments.out, arguments.to)
    print(arguments.to)
    return 0


def add_gui(commands: Commands) -> None:
    """Add damjoint gui."""
    command = add_command(commands, do_gui, "open a case in a window", settings_options())
    command.add_argument(
        "case", nargs="?", default="dam", metavar="CASE", help=f"{CASE} (default: dam)"
    )


def do_gui(arguments: argparse.Namespace) -> int:
    """Run damjoint gui; 0 when the window is closed."""
    from .gui.sheet import Request
    from .gui.window import gui
    from .model import parameters

    gui(Request(arguments.case, parameters.settings(arguments.settings)))
    return 0


def load_case(arguments: argparse.Namespace, name: str) -> Case:
    """Load a case with the options of a command, and print the remarks on it."""
    from .model import parameters
    from .model.case import load
    from .model.notes import remarks

    options = ("levels", "tail_levels", "steps", "accuracy", "record")
    given = {option: getattr(arguments, option, None) for option in options}
    case = load(name, parameters.settings(arguments.settings), **given)
    for remark in remarks(case):
        print_note(case, remark)
    return case


def print_note(case: Case, note: str) -> None:
    """Print a note on a case to standard error."""
    print(f"damjoint: {case.name}: {note}", file=sys.stderr)


def warn_if_slow() -> None:
    """Print a warning if 3D runs are slow because MUMPS is not installed."""
    from .fem import factor

    if factor.is_slow():
        print(
            f"damjoint: 3D runs take several times longer with {factor.name()} than with MUMPS; "
            "'make setup' installs MUMPS or prints the packages that it needs",
            file=sys.stderr,
        )


def add_new(commands: Commands) -> None:
    """Add damjoint new."""
    summary = "write a case file with all parameters, explained in comments"
    command = add_command(commands, do_new, summary)
    command.add_path("path", "MY.case", help="the file; it must not exist yet")


def do_new(arguments: argparse.Namespace) -> int:
    """Run damjoint new."""
    from .model import template

    template.write(arguments.path)
    print(f"{arguments.path}: a 45 m dam on rock; damjoint run {arguments.path}")
    return 0


def add_validate(commands: Commands) -> None:
    """Add damjoint validate."""
    summary = "compare with the published numbers; exit code 1 if a row fails"
    command = add_command(commands, do_validate, summary)
    command.add_argument(
        "tests",
        nargs="*",
        metavar="FAMILY|CASE",
        default=["ssnp142"],
        help="families of tests (ssnp142, ssnp143, ssnp162, ssnp164, ssnv503, sdnv138; all) or "
        "cases, such as the modelings a to k of SSNP142 (default: ssnp142)",
    )
    command.add_path(
        "--out",
        "FOLDER",
        default=Path("out"),
        help="folder that gets a folder for each case (default: out)",
    )
    help_engine = f"{ENGINE}, for cases; tests of a point and of an earthquake: condensed"
    command.add_argument("--engine", default="auto", metavar="NAME", help=help_engine)


def do_validate(arguments: argparse.Namespace) -> int:
    """Run damjoint validate; 1 if a row fails."""
    from .post import validation
    from .studies import validate

    families, failed = validate.chosen(arguments.tests), False
    summaries = []
    for family, names in families.items():
        comparisons = list(validate.compare(family, names, arguments.out, arguments.engine))
        print(f"{family.upper()}: {validation.FAMILIES[family]}\n")
        print(validation.report(comparisons), end="\n\n" if len(families) > 1 else "\n")
        summaries.append(f"{family}: {validation.summary(comparisons)}")
        failed |= any(c.verdict == "fail" for c in comparisons)
    if len(families) > 1:
        print("\n".join(summaries))
    return int(failed)


def add_critical(commands: Commands) -> None:
    """Add damjoint critical."""
    summary = (
        "find the level, strength factor or parameter beyond which there is no equilibrium; exit "
        "code 1 if there is none or it is not confirmed"
    )
    command = add_command(commands, do_critical, summary, settings_options())
    command.add_argument("case", metavar="CASE", help=CASE)
    command.add_argument(
        "--of",
        default="level",
        metavar="WHAT",
        help="level [m], strength (factor that divides mu, c, f_t and the fracture energies), "
        "uplift (effectiveness of the drains), k_h or any other parameter (default: level)",
    )
    command.add_levels(
        "--levels",
        help="water levels [m above the heel] in this order; a critical value other than the level "
        "is that at the last level (default: those of the case)",
    )
    command.add_levels("--tail-levels", help=TAIL_LEVELS)
    command.add_path("--out", "FOLDER", help="output folder (default: out/CASE_critical)")


def do_critical(arguments: argparse.Namespace) -> int:
    """Run damjoint critical; 1 if there is no critical value or it is not confirmed."""
    from .studies.critical_study import critical

    case = load_case(arguments, arguments.case)
    answer, lines = critical(case, arguments.of, arguments.out)
    print("\n".join(lines))
    return int(not answer.confirmed)


def add_quake(commands: Commands) -> None:
    """Add damjoint quake."""
    summary = (
        "the dam through a recorded earthquake, after its static loads; continues if it was "
        "interrupted; exit code 1 if the dam does not stand after it"
    )
    command = add_command(commands, do_quake, summary, settings_options(), loading_options())
    command.add_argument("case", metavar="CASE", help=CASE)
    command.add_path(
        "--record",
        "FILE",
        help="CSV of the ground's acceleration: time [s], horizontal and, if any, vertical, in "
        "record_unit (default: that of the case)",
    )
    command.add_path("--out", "FOLDER", help="output folder (default: out/CASE_quake)")
    help_engine = f"{ENGINE}: tables only, and an interrupted run starts again"
    command.add_argument("--engine", default="auto", metavar="NAME", help=help_engine)
    command.add_argument(
        "--fields",
        nargs="?",
        const="0:inf",
        action=Checked,
        convert=time_span,
        metavar="FIRST:LAST",
        help="write files of displacement and stress at up to 200 times between two times [s] "
        "(default: none; --fields alone: the whole record)",
    )
    command.add_argument("--no-picture", action="store_true", help="draw no PNG")


def do_quake(arguments: argparse.Namespace) -> int:
    """Run damjoint quake; 1 if the dam does not stand after the earthquake, or if that is not
    known.
    """
    from .engines import engine_of
    from .studies import quake, quake_getdp
    from .studies.quake_result import QuakeResult, text

    case = load_case(arguments, arguments.case)
    engine_of(case, arguments.engine)
    if arguments.engine == "getdp" and arguments.fields:
        raise InputError("--fields: must not be given with --engine getdp")
    if case["dim"] == 3 and arguments.engine != "getdp":
        warn_if_slow()
    out = arguments.out or Path("out") / f"{case.name}_quake"
    result: QuakeResult | quake_getdp.GetdpQuakeResult
    if arguments.engine == "getdp":
        for line in quake_getdp.left_out(case, out, not arguments.no_picture):
            print(f"damjoint: {line}", file=sys.stderr)
        result = quake_getdp.run(case, out)
    else:
        fields = arguments.fields is not None
        result = quake.run(case, out, arguments.fields, fields, not arguments.no_picture)
    print(f"{case.name}: {result.statement}; {len(result.rows['time'])} steps; {out}\n")
    print(text(result.case, result.summary))
    return int(not result.stands)


def add_sweep(commands: Commands) -> None:
    """Add damjoint sweep."""
    summary = "run a case with many values of its parameters, listed or random; CSV and chart"
    options = settings_options(), loading_options(), accuracy_options()
    command = add_command(commands, do_sweep, summary, *options)
    command.add_argument("case", metavar="CASE", help=CASE)
    command.add_list(
        "--vary",
        "NAME=VALUES",
        help="values of a parameter, or of level, in its unit: NAME=V1,V2,... or "
        "NAME=FIRST:LAST:STEP; all combinations are run (repeatable)",
    )
    command.add_list(
        "--tie",
        "NAME=EXPRESSION",
        help="parameter computed from those varied, sampled or tied before: adhesion=2e5*mu "
        "(repeatable)",
    )
    command.add_argument(
        "--sample",
        nargs="+",
        metavar=("N", "NAME=DISTRIBUTION"),
        help="N random rows for each combination of --vary, from distributions of scipy.stats "
        "with their arguments (shapes, loc, scale): 1000 mu=normal(1.0,0.15)",
    )
    command.add_argument(
        "--design",
        choices=("latin", "monte-carlo"),
        default="latin",
        help="Latin hypercube or independent random rows of --sample (default: latin)",
    )
    command.add_integer(
        "--seed", 0, default=0, help="seed of the random numbers of --sample (default: 0)"
    )
    command.add_list(
        "--correlate",
        "A,B=R",
        help="rank correlation -1 < R < 1 of two sampled parameters (repeatable; default: 0)",
    )
    command.add_argument(
        "--critical",
        nargs="?",
        const="level",
        default="",
        metavar="WHAT",
        help="add the critical value of each row: level (default), strength, ... as --of of "
        "damjoint critical",
    )
    command.add_argument(
        "--quake",
        metavar="SLIP",
        action=Checked,
        convert=slip,
        help="each row is the earthquake of the case's record; it fails if the residual slip "
        "exceeds SLIP [m]: with --vary record_scale=... and --sample a fragility (default: none)",
    )
    command.add_integer("--jobs", 1, help=JOBS)
    command.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="run on the dask.distributed scheduler at this address (default: this machine)",
    )
    command.add_path("--out", "FILE", help=f"{RESUMED} (default: CASE_sweep.csv)")


def do_sweep(arguments: argparse.Namespace) -> int:
    """Run damjoint sweep."""
    from .model import parameters
    from .studies.plan import cases_of, plan_of, sample_of
    from .studies.sweep import meshed, sweep

    out = arguments.out or Path(f"{Path(arguments.case).stem}_sweep.csv")
    settings = parameters.settings(arguments.settings)
    options = {name: getattr(arguments, name) for name in ("design", "seed", "correlate")}
    if not arguments.sample and arguments.correlate:
        raise InputError(f"--correlate {arguments.correlate[0]}: needs --sample")
    sample = sample_of(arguments.sample, **options) if arguments.sample else None
    plan = plan_of(arguments.vary, arguments.tie, sample, settings, arguments.critical)
    plan = dataclasses.replace(plan, slip_limit=arguments.quake)
    case = load_case(arguments, arguments.case)
    if case.accuracy:
        case, estimate = meshed(case)
        print(f"mesh of all rows, refined for the unchanged case: {estimate}")
    on_note = partial(print_note, case)
    count, rows = sweep(case, plan, out, arguments.jobs, arguments.scheduler, on_note)
    print(f"{count} rows computed; {out}")
    loaded = () if plan.sampled else cases_of(case, plan)
    cases = [row_case for _, row_case in loaded]
    report_sweep(arguments.case, plan, rows, cases, out)
    return 0


def report_sweep(case: str, plan: Plan, rows: list[Row], cases: list[Case], out: Path) -> None:
    """Print the statistics of a sweep and draw its chart beside its CSV file."""
    from .studies import chart
    from .studies.plan import CHART, beside

    if plan.sampled:
        from .studies import outcome

        print(outcome.report(plan, rows, out))
    picture = beside(out, CHART)
    reason = chart.draw(plan, rows, cases, f"{Path(case).stem}: {len(rows)} rows", picture)
    print(reason or picture)


def add_stress(commands: Commands) -> None:
    """Add damjoint stress."""
    summary = "run random dams and verify their result files; exit code 1 if there is a defect"
    command = add_command(commands, do_stress, summary)
    command.add_integer(
        "count", 1, nargs="?", default=500, help="number of random dams (default: 500)"
    )
    command.add_integer("--seed", 1, default=1, help="seed of the random numbers (default: 1)")
    command.add_argument("--quake", action="store_true", help="random earthquakes instead")
    command.add_integer("--jobs", 1, help=JOBS)
    command.add_path(
        "--out", "FILE", default=Path("stress.csv"), help=f"{RESUMED} (default: stress.csv)"
    )


def do_stress(arguments: argparse.Namespace) -> int:
    """Run damjoint stress; 1 if a run is a defect."""
    stress = tool("stress")
    options = arguments.seed, arguments.out, arguments.jobs, arguments.quake
    rows = stress.stress(arguments.count, *options)
    for row in rows:
        if row["class"] == stress.DEFECT:
            print(f"{row['scene']}: {row['findings']}\n  {row['command']}")
    numbers = stress.counts(rows)
    counted = "; ".join(f"{number} {name}" for name, number in numbers.items())
    print(counted, arguments.out, sep="; ")
    return int(numbers[stress.DEFECT] > 0)


def add_bench(commands: Commands) -> None:
    """Add damjoint bench."""
    summary = "measure time, memory and discretisation error; resumed if it was interrupted"
    command = add_command(commands, do_bench, summary)
    command.add_argument("--short", action="store_true", help="two minutes instead of thirty")
    command.add_path(
        "--out",
        "FOLDER",
        default=Path("out/bench"),
        help="folder of the page, tables and picture (default: out/bench)",
    )


def do_bench(arguments: argparse.Namespace) -> int:
    """Run damjoint bench."""
    tool("bench_page").bench(arguments.out, arguments.short)
    return 0


def tool(name: str) -> ModuleType:
    """Import a module of damjoint_tools. Raises RunError if the tools are not installed."""
    try:
        return import_module(f"damjoint_tools.{name}")
    except ModuleNotFoundError as error:
        if not str(error.name).startswith("damjoint_tools"):
            raise
        raise RunError(
            "damjoint_tools is not installed: this command needs it; install damjoint from its "
            "source folder (pip install .)"
        ) from None


def add_law(commands: Commands) -> None:
    """Add damjoint law."""
    summary = "evaluate a joint law along a path of displacement jumps"
    command = add_command(commands, do_law, summary, settings_options())
    command.add_argument("law", metavar="LAW", help="rupture, friction, bond or endo")
    command.add_path(
        "--path",
        "FILE",
        required=True,
        help="CSV with columns delta_n, delta_t1, delta_t2 [m] and, if there is water, p [Pa]; "
        "row n is the state at t = n",
    )
    command.add_path("--out", "FILE", help="CSV of results (default: print it)")


def do_law(arguments: argparse.Namespace) -> int:
    """Run damjoint law."""
    from .model import parameters
    from .studies import law_path

    settings = parameters.settings(arguments.settings)
    law_path.follow(arguments.law, arguments.path, settings, arguments.out)
    return 0


def check_encoding(word: str) -> None:
    """Raise InputError if a word of the command line is not text in the encoding of the locale."""
    try:
        word.encode()
    except UnicodeEncodeError:
        raise InputError(
            f"{word!a}: must be text in the locale's encoding ({sys.getfilesystemencoding()}); "
            "LANG=C.UTF-8 has all letters"
        ) from None


def one_line(error: BaseException) -> str:
    """Return the message of an error in one line; line ends and control characters, which could
    change the terminal's state, are escaped.
    """
    escape = lambda c: c if c.isprintable() else c.encode("unicode_escape").decode()
    return "damjoint: " + "".join(map(escape, str(error)))


def with_negative_lists(words: list[str]) -> list[str]:
    """Return the words with `--levels -1,3` as `--levels=-1,3`: argparse takes a word that begins
    with a minus sign for an option.
    """
    words = list(words)
    for i in reversed(range(len(words) - 1)):
        if words[i] in ("--levels", "--tail-levels"):
            words[i : i + 2] = [f"{words[i]}={words[i + 1]}"]
    return words


def main(argv: list[str] | None = None) -> int:
    """Run a command: 0 done, 1 failed, 2 bad input, 130 interrupted."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # µ and mathematical signs in a plain locale
    words = sys.argv[1:] if argv is None else argv
    SAVED.clear()
    try:
        for word in words:
            check_encoding(word)
        arguments = parser(*words[:1]).parse_args(with_negative_lists(words))
        if getattr(arguments, "run_geo", False):
            os.environ[RUN_GEO] = "1"  # an environment variable, for the processes of a sweep
        return arguments.call(arguments)
    except InputError as error:
        message, code = one_line(error), 2
    except MemoryError as error:
        message, code = f"damjoint: out of memory; {error}".rstrip("; "), 1
    # OSError: full disk, no permission; ImportError: a library that has been removed
    except (RunError, OSError, ImportError) as error:
        message, code = one_line(error), 1
    except KeyboardInterrupt:
        kept = "; results finished so far are saved" if SAVED else ""
        message, code = f"damjoint: interrupted{kept}", 130
    print(message, file=sys.stderr)
    return code
