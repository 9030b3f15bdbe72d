"""damjoint reliability."""

from __future__ import annotations

import argparse
from pathlib import Path

from .cases import load_case
from .options import Parser, pairs, say

SUMMARY = (
    "probability that the water rises beyond the critical level: FORM, SORM, importance "
    "sampling, design point; needs openturns"
)


def add(command: Parser) -> None:
    """Add the options."""
    command.add_settings()
    command.add_water(
        "water levels [m above the heel] in this order; the last one is compared with the critical "
        "level unless the level is varied (default: those of the case)"
    )
    command.add_case()
    command.add_list(
        "--vary",
        "NAME=DISTRIBUTION",
        help="uncertain parameter, or level: a distribution of scipy.stats with its arguments "
        "(shapes, loc, scale), as in sweep --sample: mu=normal(1.0,0.15); of one joint: "
        "'lift 25 m.mu=normal(0.7,0.1)' (repeatable)",
    )
    command.add_list(
        "--tie",
        "NAME=EXPRESSION",
        help="parameter computed from those varied or tied before: adhesion=2e5*mu (repeatable)",
    )
    command.add_list(
        "--correlate",
        "A,B=R",
        help="rank correlation -1 < R < 1 of two uncertain parameters (repeatable; default: 0)",
    )
    command.add_integer(
        "--samples",
        0,
        default=500,
        help="critical levels of the importance sampling; 0: none (default: 500)",
    )
    command.add_integer("--seed", 0, default=0, help="seed of the random numbers (default: 0)")
    command.add_jobs()
    command.add_scheduler()
    command.add_path(
        "--out",
        "FOLDER",
        help="output folder; critical levels that are already in it are not computed again "
        "(default: out/CASE_reliability)",
    )


def call(arguments: argparse.Namespace) -> int:
    """Run damjoint reliability."""
    from ..studies import openturns_process
    from ..studies.reliability import Variables
    from ..studies.reliability_study import reliability

    openturns_process.version()
    distributions = pairs("--vary", arguments.vary, "mu=normal(1.0,0.15)")
    tied = pairs("--tie", arguments.tie, "adhesion=2e5*mu")
    variables = Variables(distributions, arguments.correlate, tied)
    case = load_case(arguments, arguments.case)
    out = arguments.out or Path("out") / f"{case.name}_reliability"
    options = arguments.samples, arguments.seed, out, arguments.jobs, arguments.scheduler
    _, lines = reliability(case, variables, *options)
    say("\n".join(lines))
    return 0
