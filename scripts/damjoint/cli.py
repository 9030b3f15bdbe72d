"""The command line: the commands of `damjoint --help`."""

from __future__ import annotations

import argparse
import io
import os
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from . import RUN_GEO, InputError, RunError, __version__

if TYPE_CHECKING:
    from .studies.plan import Plan, Row


class Parser(argparse.ArgumentParser):
    """Bad input gets one line here, too."""

    def error(self, message: str) -> None:
        """Raises InputError with argparse's message, which names the argument and its value."""
        raise InputError(re.sub(r"^argument --([\w-]+): (\S+): must", r"\1 = \2: must", message))


def whole(text: str) -> int:
    """An integer of at least 1."""
    if not text.strip().isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text}: must be an integer >= 1")
    return int(text)


def natural(text: str) -> int:
    """An integer of at least 0."""
    if not text.strip().isdecimal():
        raise argparse.ArgumentTypeError(f"{text}: must be an integer >= 0")
    return int(text)


def path(text: str) -> Path:
    """A path that has been named: an empty one would be the folder one happens to be in."""
    if not text.strip():
        raise argparse.ArgumentTypeError(f"{text!r}: must be a path")
    return Path(text)


def parser() -> argparse.ArgumentParser:
    """The argument parser of the command."""
    top = Parser(
        prog="damjoint",
        description="Gravity dams on a thin joint that opens, breaks, slides and lets water in.",
    )
    top.add_argument("--version", action="version", version=__version__)
    commands = top.add_subparsers(dest="command", required=True)
    settings = Parser(add_help=False)
    settings.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        dest="settings",
        help="change a parameter (repeatable)",
    )
    settings.add_argument(
        "--run-geo",
        action="store_true",
        help="let Gmsh run the .geo file that the case names as its geometry: it is a program",
    )
    of_case = "a letter a..k, dam, or the path of a .case file"
    of_engine = "auto, condensed (the bulk eliminated once) or getdp (the plain problem definition)"

    water = Parser(add_help=False)
    add = water.add_argument
    add("--levels", help="water levels [m] reached at t = 1, 2, ...: 3,6,8,9; may go down, too")
    add(
        "--tail-levels",
        help="tailwater levels [m], one or as many as levels (default: the case's own)",
    )
    add(
        "--accuracy",
        metavar="PERCENT",
        help="coarse (3 %%), standard (1 %%), fine (0.2 %%) or any percentage, such as 0.5%%: "
        "refines the mesh until the results' estimated error is smaller",
    )

    loading = Parser(add_help=False, parents=[water])
    loading.add_argument("--steps", type=whole, help="equal steps between two levels (default 1)")

    run = commands.add_parser(
        "run", parents=[settings, loading], help="fill the reservoir of a case"
    )
    add = run.add_argument
    add("case", help=of_case)
    add("--out", type=path, help="output folder (default out/CASE)")
    add("--no-fields", action="store_true", help="no displacement and stress fields")
    add("--no-picture", action="store_true", help="no PNG")
    add("--engine", default="auto", help=of_engine)
    run.set_defaults(call=do_run)

    safety = commands.add_parser(
        "check",
        parents=[settings, water],
        help="safety factors by finite elements and by hand; exit code 1 if one is too low",
    )
    add = safety.add_argument
    add("cases", nargs="+", metavar="CASE", help=f"load combinations: {of_case}")
    add(
        "--out",
        type=path,
        default=Path("out/check"),
        help="where check.csv and the cases' folders go (default out/check)",
    )
    safety.set_defaults(call=do_check)

    plot = commands.add_parser("plot", help="redraw a run's pictures from its files")
    plot.add_argument("out", type=path, metavar="OUT", help="a folder that a run has written")
    plot.set_defaults(call=do_plot)

    report = commands.add_parser("report", help="one HTML page from the files of runs")
    add = report.add_argument
    add("out", type=path, nargs="+", metavar="OUT", help="folders that runs have written")
    add("--to", type=path, default=Path("report.html"), help="the page (default report.html)")
    report.set_defaults(call=do_report)

    window = commands.add_parser("gui", parents=[settings], help="a case in Gmsh's window")
    window.add_argument("case", nargs="?", default="dam", help=of_case)
    window.set_defaults(call=do_gui)

    new = commands.add_parser("new", help="write a commented case file to begin with")
    new.add_argument("path", type=path, metavar="MY.case", help="the file to write")
    new.set_defaults(call=do_new)

    check = commands.add_parser(
        "validate", help="compare with the published numbers; exit code 1 if a row fails"
    )
    add = check.add_argument
    add("cases", nargs="*", metavar="CASE", help="letters; default: all")
    add("--out", type=path, default=Path("out"), help="where the cases' folders go (default out)")
    add("--engine", default="auto", help=of_engine)
    check.set_defaults(call=do_validate)

    limit = commands.add_parser(
        "critical",
        parents=[settings],
        help="the level, strength or parameter at which no equilibrium is left",
    )
    add = limit.add_argument
    add("case", help=of_case)
    add(
        "--of",
        default="level",
        metavar="WHAT",
        help="level (default), strength (factor that divides mu, c, f_t and the fracture "
        "energies), uplift (effectiveness of the drains), k_h or any parameter",
    )
    add("--levels", help="water levels [m] on the way; all but a critical level ask for the last")
    add("--tail-levels", help="tailwater levels [m], one or as many as levels")
    add("--out", type=path, help="output folder (default out/CASE_critical)")
    limit.set_defaults(call=do_critical)

    vary = commands.add_parser(
        "sweep",
        parents=[settings, loading],
        help="one row per combination of parameters and levels, or per row of a sample; a chart",
    )
    add = vary.add_argument
    add("case", help=of_case)
    add(
        "--vary",
        action="append",
        default=[],
        metavar="NAME=VALUES",
        help="NAME=V1,V2,... or NAME=FIRST:LAST:STEP; NAME may be level (repeatable)",
    )
    add(
        "--tie",
        action="append",
        default=[],
        metavar="NAME=EXPRESSION",
        help="arithmetic of the names varied, sampled or tied before: adhesion=2e5*mu (repeatable)",
    )
    add(
        "--sample",
        nargs="+",
        metavar=("N", "NAME=DISTRIBUTION"),
        help="N rows for each combination of --vary, drawn from distributions with scipy.stats' "
        "names and arguments (shapes, loc, scale): 1000 mu=normal(1.0,0.15)",
    )
    add("--design", choices=("latin", "monte-carlo"), default="latin", help="of the sample")
    add("--seed", type=natural, default=0, help="of the sample (default 0)")
    add(
        "--correlate",
        action="append",
        default=[],
        metavar="A,B=R",
        help="rank correlation of two sampled names (repeatable)",
    )
    add(
        "--critical",
        nargs="?",
        const="level",
        default="",
        metavar="WHAT",
        help="also the critical level (default), strength, ... of each row, as damjoint critical",
    )
    add("--jobs", type=whole, help="processes (default: all cores)")
    add("--scheduler", metavar="ADDRESS", help="a dask.distributed scheduler instead")
    add("--out", type=path, help="result file, resumed if it exists (default CASE_sweep.csv)")
    vary.set_defaults(call=do_sweep)

    trial = commands.add_parser(
        "stress", help="random scenes verified from their files; exit code 1 if one is a defect"
    )
    add = trial.add_argument
    add("count", nargs="?", type=whole, default=500, metavar="N", help="scenes (default 500)")
    add("--seed", type=whole, default=1, help="of the random numbers (default 1)")
    add("--jobs", type=whole, help="processes (default: all cores)")
    add(
        "--out",
        type=path,
        default=Path("stress.csv"),
        help="result file, resumed if it exists (default stress.csv)",
    )
    trial.set_defaults(call=do_stress)

    speed = commands.add_parser("bench", help="time, error, growth and costs")
    add = speed.add_argument
    add("--short", action="store_true", help="two minutes instead of thirty")
    add(
        "--out",
        type=path,
        default=Path("out/bench"),
        help="folder of page, tables and picture (default out/bench)",
    )
    speed.set_defaults(call=do_bench)

    law = commands.add_parser(
        "law", parents=[settings], help="evaluate a joint law along a path of jumps"
    )
    add = law.add_argument
    add("law", help="rupture, friction or bond")
    add(
        "--path",
        type=path,
        required=True,
        help="CSV with delta_n,delta_t1,delta_t2 [m] and optionally p [Pa]; row n: step to t = n",
    )
    add("--out", type=path, help="output CSV (default: standard output)")
    law.set_defaults(call=do_law)
    return top


def do_run(arguments: argparse.Namespace) -> int:
    """damjoint run; 0, or 1 if the dam does not stand or the run stopped before its last level."""
    from .model import parameters
    from .model.case import load
    from .post import summary
    from .run import run
    from .statics.verdict import failed, hints, path_statement, statement, verdict

    case = load(
        arguments.case,
        parameters.settings(arguments.settings),
        arguments.levels,
        arguments.tail_levels,
        arguments.steps,
        arguments.accuracy,
    )
    out = arguments.out or Path("out") / case.name
    fields, picture = not arguments.no_fields, not arguments.no_picture
    code = 0
    if case["dim"] == 3 and arguments.engine != "getdp":
        warn_if_slow()
    for result in run(case, out, fields, picture, engine=arguments.engine):
        history = result.history
        print(
            f"{case.name}, uplift {result.case['uplift']}: {verdict(result)}; "
            f"{len(history['time'])} steps, {history['iterations'].sum():.0f} iterations; {out}"
        )
        if result.last:
            print(f"\n{summary.text(result)}")
        driven = case["drive"] != "level"
        said = [path_statement(result) if driven else "", statement(result), *hints(result)]
        said.append(result.info.get("error_estimate", {}).get("statement", ""))
        if any(said):
            print("", *filter(None, said), sep="\n")
        code = max(code, int(failed(result)))
    return code


def do_check(arguments: argparse.Namespace) -> int:
    """damjoint check; 1 if a check is not met."""
    from .model import parameters
    from .model.case import load
    from .studies.check import check_cases, text_table

    settings = parameters.settings(arguments.settings)
    water = arguments.levels, arguments.tail_levels
    cases = [load(name, settings, *water, accuracy=arguments.accuracy) for name in arguments.cases]
    if any(case["dim"] == 3 for case in cases):
        warn_if_slow()
    checks = check_cases(cases, arguments.out)
    said = [f"{one.gravity.case.name}: {one.accuracy}" for one in checks if one.accuracy]
    print("\n\n".join([text_table(checks), *said, str(arguments.out / "check.csv")]))
    return int(any(result.failures for check in checks for result in check.results))


def do_plot(arguments: argparse.Namespace) -> int:
    """damjoint plot."""
    from .post import pictures, stored

    found = [(folder, stored.read(folder)) for folder in stored.runs_in(arguments.out)]
    for folder, solution in found:
        print(pictures.draw(solution, folder))
    return 0


def do_report(arguments: argparse.Namespace) -> int:
    """damjoint report."""
    from .studies import report

    report.write(arguments.out, arguments.to)
    print(arguments.to)
    return 0


def do_gui(arguments: argparse.Namespace) -> int:
    """damjoint gui; 0 when the window is closed."""
    from .gui.sheet import Request
    from .gui.window import gui
    from .model import parameters

    gui(Request(arguments.case, parameters.settings(arguments.settings)))
    return 0


def warn_if_slow() -> None:
    """Say before a 3D run that it takes several times longer than it need."""
    from .fem import factor

    if factor.is_slow():
        print(
            f"damjoint: {factor.name()} factorises, several times slower in 3D than MUMPS; "
            "'make setup' says what is missing",
            file=sys.stderr,
        )


def do_new(arguments: argparse.Namespace) -> int:
    """damjoint new."""
    from .model import template

    template.write(arguments.path)
    print(f"{arguments.path}: a 45 m dam on rock; damjoint run {arguments.path}")
    return 0


def do_validate(arguments: argparse.Namespace) -> int:
    """damjoint validate; 1 if a row fails."""
    from .model.case import load
    from .post import validation
    from .run import run
    from .statics.verdict import statement

    cases = [load(name) for name in arguments.cases or validation.modelings()]
    for case in cases:
        if not validation.references(case):
            allowed = ", ".join(validation.modelings())
            raise InputError(f"case {case.name}: has no reference values; allowed: {allowed}")
    comparisons = []
    for case in cases:
        out = arguments.out / case.name
        for result in run(case, out, fields=False, engine=arguments.engine):
            if result.stopped:
                raise RunError(f"{case.name}: {statement(result)}")
            comparisons += validation.compare(result)
    print(validation.report(comparisons))
    return int(any(c.verdict == "fail" for c in comparisons))


def do_critical(arguments: argparse.Namespace) -> int:
    """damjoint critical; 0, or 1 if there is no critical value, or none that is confirmed."""
    from .model import parameters
    from .studies.critical import critical

    answer, said = critical(
        arguments.case,
        arguments.of,
        parameters.settings(arguments.settings),
        arguments.levels,
        arguments.tail_levels,
        arguments.out,
    )
    print("\n".join(said))
    return int(not answer.confirmed)


def do_sweep(arguments: argparse.Namespace) -> int:
    """damjoint sweep."""
    from .model import parameters
    from .studies.plan import Schedule, plan_of, sample_of
    from .studies.sweep import meshed, sweep

    out = arguments.out or Path(f"{Path(arguments.case).stem}_sweep.csv")
    settings = parameters.settings(arguments.settings)
    how = {name: getattr(arguments, name) for name in ("design", "seed", "correlate")}
    if not arguments.sample and arguments.correlate:
        raise InputError(f"--correlate {arguments.correlate[0]}: needs --sample")
    sample = sample_of(arguments.sample, **how) if arguments.sample else None
    plan = plan_of(arguments.vary, arguments.tie, sample, settings, arguments.critical)
    loading = Schedule(arguments.levels, arguments.tail_levels, arguments.steps, arguments.accuracy)
    if loading.accuracy:
        settings, loading, said = meshed(arguments.case, settings, loading)
        print(f"one mesh for all rows, that of the case itself: {said}")
    count, rows = sweep(
        arguments.case, plan, settings, out, loading, arguments.jobs, arguments.scheduler
    )
    print(f"{count} rows computed; {out}")
    show(arguments.case, plan, rows, out)
    return 0


def show(case: str, plan: Plan, rows: list[Row], out: Path) -> None:
    """Say what a sweep has found, and draw it beside its rows."""
    from .studies import chart
    from .studies.plan import beside

    if plan.sampled:
        from .studies import outcome

        print(outcome.report(plan, rows, out))
    picture = beside(out, ".png")
    said = chart.draw(plan, rows, f"{Path(case).stem}: {len(rows)} rows", picture)
    print(said or picture)


def do_stress(arguments: argparse.Namespace) -> int:
    """damjoint stress; 1 if a scene is a defect."""
    from damjoint_tools.stress import DEFECT, counts, stress

    rows = stress(arguments.count, arguments.seed, arguments.out, arguments.jobs)
    for row in rows:
        if row["class"] == DEFECT:
            print(f"{row['scene']}: {row['found']}\n  {row['command']}")
    found = counts(rows)
    print("; ".join(f"{number} {name}" for name, number in found.items()), arguments.out, sep="; ")
    return int(found[DEFECT] > 0)


def do_bench(arguments: argparse.Namespace) -> int:
    """damjoint bench."""
    from damjoint_tools.bench_page import bench

    bench(arguments.out, arguments.short)
    return 0


def do_law(arguments: argparse.Namespace) -> int:
    """damjoint law."""
    from .model import parameters
    from .studies import law_path

    settings = parameters.settings(arguments.settings)
    law_path.follow(arguments.law, arguments.path, settings, arguments.out)
    return 0


def check_text(word: str) -> None:
    """Raise InputError if a word of the command has bytes that are no text in the locale."""
    try:
        word.encode()
    except UnicodeEncodeError:
        raise InputError(
            f"{word!a}: must be text in the locale's encoding ({sys.getfilesystemencoding()}); "
            "LANG=C.UTF-8 knows all letters"
        ) from None


def one_line(error: BaseException) -> str:
    """What went wrong, for a terminal: what would end the line or steer the terminal is escaped."""
    letter = lambda c: c if c.isprintable() else c.encode("unicode_escape").decode()
    return "damjoint: " + "".join(map(letter, str(error)))


def main(argv: list[str] | None = None) -> int:
    """The command: 0 done, 1 failed, 2 bad input, 130 interrupted."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a locale without a mu for the micrometres
    words = list(sys.argv[1:] if argv is None else argv)
    for i in reversed(range(len(words) - 1)):
        if words[i] in ("--levels", "--tail-levels"):  # a list that begins with a minus sign
            words[i : i + 2] = [f"{words[i]}={words[i + 1]}"]
    try:
        for word in words:
            check_text(word)
        arguments = parser().parse_args(words)
        if getattr(arguments, "run_geo", False):
            os.environ[RUN_GEO] = "1"  # for the processes of a sweep, too
        return arguments.call(arguments)
    except InputError as error:
        print(one_line(error), file=sys.stderr)
        return 2
    except RunError as error:
        print(one_line(error), file=sys.stderr)
        return 1
    except MemoryError as error:
        print(f"damjoint: memory: none is left; {error}".rstrip("; "), file=sys.stderr)
        return 1
    except (OSError, ImportError) as error:  # no space, no permission, a library that has gone
        print(one_line(error), file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        said = "interrupted; what has been finished is saved"
        print(f"damjoint: {said}", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
