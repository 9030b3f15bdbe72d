"""damjoint sweep."""

from __future__ import annotations

import argparse
import dataclasses
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from .. import InputError
from .cases import load_case, print_note
from .options import RESUMED, Parser, say, table_width

if TYPE_CHECKING:
    from ..arrays import Value
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
    add_values(command)
    add_kind(command)
    command.add_jobs()
    command.add_scheduler()
    command.add_path("--out", "FILE", help=f"{RESUMED} (default: CASE_sweep.csv)")


def add_values(command: Parser) -> None:
    """Add the options for the values of the rows."""
    command.add_list(
        "--vary",
        "NAME=VALUES",
        help="values of a parameter, or of level, in its unit: NAME=V1,V2,... or "
        "NAME=FIRST:LAST:STEP (FIRST, FIRST + STEP, ... up to LAST); all combinations are run "
        "(repeatable)",
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
        help="Latin hypercube or independent random rows of --sample, or the design of Sobol's "
        "indices, of which N, a power of 2, has N (inputs + 2) rows (default: latin)",
    )
    command.add_integer("--seed", 0, help="seed of the random numbers of --sample (default: 0)")
    command.add_list(
        "--correlate",
        "A,B=R",
        help="rank correlation -1 < R < 1 of two sampled parameters (repeatable; default: 0)",
    )


def add_kind(command: Parser) -> None:
    """Add the options for what a row is: a run by default, a critical value or an earthquake."""
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
        metavar="LIMITS",
        help="each row is an earthquake; it fails if the residual slip exceeds a limit [m], 0.05, "
        "or another one, slip=0.05,slip=0.2,opening=0.01, or if the dam does not stand: a "
        "fragility curve for each (default: none)",
    )
    command.add_path(
        "--record",
        "FILE",
        repeats=True,
        help="record of the rows of --quake, as in damjoint quake; repeatable: each row with each "
        "record (default: that of the case)",
    )
    command.add_argument(
        "--both-signs",
        action="store_true",
        help="also each record reversed: record_scale and its negative (with --quake)",
    )
    command.add_argument(
        "--intensity",
        choices=("peak_ground_ax", "peak_ground_vx", "arias_x", "spectral_ax"),
        help="column that is the intensity of the fragility: largest acceleration or velocity of "
        "the ground, Arias' intensity, spectral acceleration at the dam's first period (default: "
        "peak_ground_ax)",
    )


def call(arguments: argparse.Namespace) -> int:
    """Run damjoint sweep."""
    from ..input import parameters
    from ..studies.plan import MOTION, Limits, in_both_signs, plan_of, sample_of
    from ..studies.result_file import check_path
    from ..studies.sweep import PlannedRows, meshed, rows_table, sweep

    out = arguments.out or Path(f"{Path(arguments.case).stem}_sweep.csv")
    settings = parameters.settings(arguments.settings)
    check_path(out)
    of_sample = {name: getattr(arguments, name) for name in ("design", "seed", "correlate")}
    options = {name: value for name, value in of_sample.items() if value not in (None, [])}
    if not arguments.sample and options:
        raise InputError(f"--{', --'.join(options)}: needs --sample")
    sample = sample_of(arguments.sample, **options) if arguments.sample else None
    limits = None if arguments.quake is None else Limits.of(arguments.quake)
    if not limits and (arguments.record or arguments.both_signs or arguments.intensity):
        raise InputError("--record, --both-signs, --intensity: need --quake")
    motions: dict[str, list[Value]] = {}
    if arguments.record:
        motions[MOTION] = [str(file) for file in arguments.record]
    given = arguments.vary, arguments.tie, sample, settings, arguments.critical, motions
    plan = plan_of(*given, signs=arguments.both_signs)
    case = load_case(arguments, arguments.case)
    if arguments.both_signs:
        plan = in_both_signs(plan, float(case["record_scale"]))
    plan = dataclasses.replace(plan, quake=limits)
    if case.accuracy:
        case, estimate = meshed(case)
        say(f"mesh of all rows, refined for the unchanged case: {estimate}")
    on_note = partial(print_note, case)
    planned = PlannedRows(case, plan)
    count, rows = sweep(planned, out, arguments.jobs, arguments.scheduler, on_note)
    kept = len(rows) - count
    computed = f"{count} rows computed" if count or not kept else "nothing to compute"
    say(f"{computed}{f', {kept} rows were there already' if kept else ''}; {out}\n")
    say(f"{rows_table(plan, rows, table_width(arguments))}\n")
    intensity = arguments.intensity or "peak_ground_ax"
    report_sweep(case, plan, rows, [] if plan.sampled else planned.cases, out, intensity)
    return 0


def report_sweep(
    case: Case, plan: Plan, rows: list[Row], cases: list[Case], out: Path, intensity: str
) -> None:
    """Print the statistics of a sweep and draw its charts beside its CSV file."""
    from ..studies import chart
    from ..studies.plan import CHART, FRAGILITY, beside

    if plan.sampled:
        from ..studies import outcome

        say(outcome.report(plan, rows, out))
    if plan.quake:
        from ..studies import fragility, fragility_picture

        curves, drawn = fragility.fits(plan, rows, intensity), beside(out, FRAGILITY[1])
        say(f"\n{fragility.report(curves, out, intensity)}")
        if any(not curve.reason for curve in curves):
            fragility_picture.draw(curves, case.title, intensity, drawn)
            say(f"{drawn}\n")
    picture = beside(out, CHART)
    reason = chart.draw(plan, rows, cases, chart.heading(case, plan, len(rows)), picture)
    say(reason or str(picture))
