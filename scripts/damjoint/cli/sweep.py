"""damjoint sweep."""

from __future__ import annotations

import argparse
import dataclasses
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from .. import InputError
from .cases import load_case, print_note
from .options import RESUMED, Checked, Parser, say, slip, table_width

if TYPE_CHECKING:
    from ..input.case import Case
    from ..studies.plan import Plan, Row


SUMMARY = "run a case with many values of its parameters, listed or random; CSV and chart"


def add(command: Parser) -> None:
    """Add the options."""
    command.add_settings()
    command.add_loading()
    command.add_accuracy()
    command.add_wide()
    command.add_case()
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
        choices=("latin", "monte-carlo", "sobol"),
        default="latin",
        help="Latin hypercube or independent random rows of --sample, or the design of Sobol's "
        "indices, of which N, a power of 2, has N (inputs + 2) rows (default: latin)",
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
    command.add_jobs()
    command.add_scheduler()
    command.add_path("--out", "FILE", help=f"{RESUMED} (default: CASE_sweep.csv)")


def call(arguments: argparse.Namespace) -> int:
    """Run damjoint sweep."""
    from ..input import parameters
    from ..studies.plan import plan_of, sample_of
    from ..studies.sweep import PlannedRows, meshed, rows_table, sweep

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
        say(f"mesh of all rows, refined for the unchanged case: {estimate}")
    on_note = partial(print_note, case)
    planned = PlannedRows(case, plan)
    count, rows = sweep(planned, out, arguments.jobs, arguments.scheduler, on_note)
    say(f"{count} rows computed; {out}\n")
    say(f"{rows_table(plan, rows, table_width(arguments))}\n")
    report_sweep(case, plan, rows, [] if plan.sampled else planned.cases, out)
    return 0


def report_sweep(case: Case, plan: Plan, rows: list[Row], cases: list[Case], out: Path) -> None:
    """Print the statistics of a sweep and draw its chart beside its CSV file."""
    from ..studies import chart
    from ..studies.plan import CHART, beside

    if plan.sampled:
        from ..studies import outcome

        say(outcome.report(plan, rows, out))
    picture = beside(out, CHART)
    reason = chart.draw(plan, rows, cases, chart.heading(case, plan, len(rows)), picture)
    say(reason or str(picture))
