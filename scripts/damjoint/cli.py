"""The command line: damjoint run | validate | sweep | bench | law."""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

from . import InputError, RunError, __version__


class Parser(argparse.ArgumentParser):
    """Bad input gets one line here, too."""

    def error(self, message: str) -> None:
        """Raises InputError with argparse's message, which names the argument and its value."""
        raise InputError(re.sub(r"^argument --([\w-]+): (\S+): must", r"\1 = \2: must", message))


def whole(text: str) -> int:
    """An integer of at least 1."""
    if not text.strip().isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text}: must be an integer >= 1")
    return int(text)


def parser() -> argparse.ArgumentParser:
    """The argument parser of the command."""
    top = Parser(prog="damjoint", description="Gravity dams on a thin joint that opens, breaks, slides and lets water in.")
    top.add_argument("--version", action="version", version=__version__)
    commands = top.add_subparsers(dest="command", required=True)
    settings = Parser(add_help=False)
    settings.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", dest="settings", help="change a parameter (repeatable)")

    run = commands.add_parser("run", parents=[settings], help="fill the reservoir of a case")
    run.add_argument("case", help="a letter a..k, dam, or the path of a .case file")
    run.add_argument("--levels", help="water levels [m] reached at t = 1, 2, ...: 3,6,8,9; may go down, too")
    run.add_argument("--tail-levels", help="tailwater levels [m], one or as many as levels")
    run.add_argument("--steps", type=whole, help="equal steps between two levels (default 1)")
    run.add_argument("--accuracy", help="coarse (about 3 %%), standard (1 %%) or fine (0.2 %%): chooses mesh, order and steps")
    run.add_argument("--out", type=Path, help="output folder (default out/CASE)")
    run.add_argument("--no-fields", action="store_true", help="no displacement and stress fields")
    run.add_argument("--no-picture", action="store_true", help="no PNG")
    run.add_argument("--engine", default="auto", help="auto, condensed (the bulk eliminated once) or getdp (the plain problem definition)")
    run.set_defaults(call=do_run)

    check = commands.add_parser("validate", help="compare with the published numbers; exit code 1 if a row fails")
    check.add_argument("cases", nargs="*", metavar="CASE", help="letters; default: all")
    check.add_argument("--out", type=Path, default=Path("out"), help="folder of the cases' output folders (default out)")
    check.add_argument("--engine", default="auto", help="as in run")
    check.set_defaults(call=do_validate)

    vary = commands.add_parser("sweep", parents=[settings], help="one row per combination of parameters and levels")
    vary.add_argument("case", help="as in run")
    vary.add_argument("--vary", action="append", default=[], metavar="NAME=VALUES", help="NAME=V1,V2,... or NAME=FIRST:LAST:STEP; NAME may be level")
    vary.add_argument("--jobs", type=whole, help="processes (default: all cores)")
    vary.add_argument("--scheduler", metavar="ADDRESS", help="a dask.distributed scheduler instead")
    vary.add_argument("--out", type=Path, help="result file, resumed if it exists (default CASE_sweep.csv)")
    vary.set_defaults(call=do_sweep)

    speed = commands.add_parser("bench", help="time, error, growth and costs, against the peer")
    speed.add_argument("--short", action="store_true", help="a minute instead of twenty")
    speed.add_argument("--out", type=Path, default=Path("out/bench"), help="folder of tables and picture (default out/bench)")
    speed.add_argument("--readme", type=Path, help="a page whose benchmark part is to be refreshed")
    speed.set_defaults(call=do_bench)

    law = commands.add_parser("law", parents=[settings], help="evaluate a joint law along a path of jumps")
    law.add_argument("law", help="rupture or friction")
    law.add_argument("--path", type=Path, required=True, help="CSV with delta_n,delta_t1,delta_t2 [m] and optionally p [Pa]")
    law.add_argument("--out", type=Path, help="output CSV (default: standard output)")
    law.set_defaults(call=do_law)
    return top


def do_run(arguments: argparse.Namespace) -> int:
    """damjoint run; 0, or 1 if the run stopped before its last level."""
    from . import parameters
    from .results import path_statement
    from .run import run

    case = parameters.load(arguments.case, parameters.settings(arguments.settings), arguments.levels, arguments.tail_levels, arguments.steps,
                           arguments.accuracy)
    out = arguments.out or Path("out") / case.name
    code = 0
    for result in run(case, out, not arguments.no_fields, not arguments.no_picture, engine=arguments.engine):
        history = result.history
        print(f"{case.name}, uplift {result.case['uplift']}: {len(history['time'])} steps, {history['iterations'].sum():.0f} iterations, "
              f"{history['cuts'].sum():.0f} cuts; level {history['level'][-1] if len(history['level']) else 0:g} m, "
              f"largest opening {history['max_opening'][-1] if len(history['level']) else 0:.4g} m; {out}")
        if case["drive"] != "level":
            print(path_statement(result))
        if result.stopped:
            print(result.stopped)
            code = 1
    return code


def do_validate(arguments: argparse.Namespace) -> int:
    """damjoint validate; 1 if a row fails."""
    from . import parameters, validate
    from .run import run

    cases = [parameters.load(name) for name in arguments.cases or validate.modelings()]
    for case in cases:
        if not validate.references(case):
            raise InputError(f"case {case.name}: has no reference values; allowed: {', '.join(validate.modelings())}")
    comparisons = []
    for case in cases:
        for result in run(case, arguments.out / case.name, fields=False, engine=arguments.engine):
            comparisons += validate.compare(result)
            if result.stopped:
                raise RunError(f"{case.name}: {result.stopped}")
    print(validate.report(comparisons))
    return int(any(c.verdict == "fail" for c in comparisons))


def do_sweep(arguments: argparse.Namespace) -> int:
    """damjoint sweep."""
    from . import parameters
    from .sweep import sweep

    out = arguments.out or Path(f"{Path(arguments.case).stem}_sweep.csv")
    count = sweep(arguments.case, arguments.vary, parameters.settings(arguments.settings), out, arguments.jobs, arguments.scheduler)
    print(f"{count} rows computed; {out}")
    return 0


def do_bench(arguments: argparse.Namespace) -> int:
    """damjoint bench."""
    from .bench import bench

    bench(arguments.out, arguments.short, arguments.readme)
    return 0


def do_law(arguments: argparse.Namespace) -> int:
    """damjoint law."""
    from . import law, parameters

    law.follow(arguments.law, arguments.path, parameters.settings(arguments.settings), arguments.out)
    return 0


def main(argv: list[str] | None = None) -> int:
    """Entry point: 0 done, 1 failed, 2 bad input, 130 interrupted."""
    words = list(sys.argv[1:] if argv is None else argv)
    for i in reversed(range(len(words) - 1)):  # a list that begins with a minus sign is a value, not an option
        if words[i] in ("--levels", "--tail-levels"):
            words[i : i + 2] = [f"{words[i]}={words[i + 1]}"]
    try:
        arguments = parser().parse_args(words)
        return arguments.call(arguments)
    except InputError as error:
        print(f"damjoint: {error}", file=sys.stderr)
        return 2
    except RunError as error:
        print(f"damjoint: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("damjoint: interrupted; everything up to the last converged step is saved", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
