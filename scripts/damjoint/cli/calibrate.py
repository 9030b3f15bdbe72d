"""damjoint calibrate."""

from __future__ import annotations

import argparse
from pathlib import Path

from .cases import load_case
from .options import Parser, path, say

SUMMARY = (
    "find the values of parameters with which a case computes what was measured; exit code 1 if "
    "the model does not explain the measurements, 3 if they do not determine a parameter"
)

#: Exit codes.
NOT_EXPLAINED, NOT_DETERMINED = 1, 3


def add(command: Parser) -> None:
    """Add the options."""
    command.add_settings()
    command.add_case()
    command.add_argument(
        "measured",
        metavar="MEASURED.CSV",
        help="a row per reading: level [m], if wanted tail_level and date, and of each instrument "
        "a column of history.csv, or head_S, the piezometric head [m] S m from the heel, with its "
        "standard deviations in NAME_sd; SI units",
    )
    command.add_list(
        "--free",
        "NAMES",
        help="parameters that are searched, from the values of the case: K_N,E_found, of one joint "
        "JOINT.NAME; or one with limits, NAME=LOW:HIGH, or a prior, NAME=normal(MEAN,SD) or "
        "lognorm(S,0,MEDIAN) (repeatable)",
    )
    command.add_jobs()
    command.add_path("--out", "FOLDER", help="output folder (default: out/CASE_calibrated)")
    command.add_no_picture()


def call(arguments: argparse.Namespace) -> int:
    """Run damjoint calibrate."""
    from ..studies.calibrate import free_of
    from ..studies.calibrate_study import calibrate, printed_lines
    from ..studies.measurements import read

    case = load_case(arguments, arguments.case)
    measurements = read(path("measured", arguments.measured), case)
    free = free_of(case, arguments.free)
    out = arguments.out or Path("out") / f"{case.name}_calibrated"
    answer = calibrate(case, free, measurements, out, arguments.jobs, not arguments.no_picture)
    say("\n".join([*printed_lines(answer), str(out)]))
    if answer.findings or not answer.converged:
        return NOT_EXPLAINED
    return NOT_DETERMINED if answer.undetermined else 0
