"""damjoint quake."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from .cases import load_cases
from .options import Checked, Parser, say, table_width, time_span

SUMMARY = (
    "the dam through recorded earthquakes, after its static loads; continues if it was "
    "interrupted; exit code 1 if the dam does not stand after one of them"
)


def add(command: Parser) -> None:
    """Add the options."""
    command.add_settings()
    command.add_loading()
    command.add_all_steps()
    command.add_wide()
    command.add_case()
    command.add_path(
        "--record",
        "FILE",
        repeats=True,
        help="the ground's acceleration: a CSV file with time [s], horizontal and, if any, "
        "vertical, in record_unit, or a file of PEER or COSMOS, or two, H.AT2+V.AT2; repeatable: "
        "each earthquake has a folder with the name of its record (default: that of the case)",
    )
    command.add_path("--out", "FOLDER", help="output folder (default: out/CASE_quake)")
    command.add_jobs()
    command.add_engine(
        "condensed (auto, the default) or getdp (the reference GetDP model: tables only, and an "
        "interrupted run starts again)"
    )
    command.add_argument(
        "--fields",
        nargs="?",
        const="0:inf",
        action=Checked,
        convert=time_span,
        metavar="FIRST:LAST",
        help="write files of displacement and stress at up to 200 times between two times [s] "
        "(default: at the static states; --fields alone: over the whole record)",
    )
    command.add_no_picture()


def call(arguments: argparse.Namespace) -> int:
    """Run damjoint quake; 1 unless the dam is known to stand after each earthquake."""
    from ..studies import quake_getdp
    from ..studies.quake_result import text
    from ..studies.quake_study import Options, check, records_table, run_records

    picture, fields = not arguments.no_picture, arguments.fields is not None
    options = Options(arguments.engine, arguments.fields, fields, picture)
    cases = load_cases(arguments, [arguments.case], arguments.record or [None])
    out = arguments.out or Path("out") / f"{cases[0].name}_quake"
    for case in cases:
        check(case, options)
    if arguments.engine == "getdp":
        for line in quake_getdp.omitted_files(out, picture):
            say(f"damjoint: {line}", file=sys.stderr)
    results = run_records(cases, out, options, arguments.jobs)
    for result in results:
        steps = f"{result.summary['steps']} steps; {result.out}"
        say(f"{result.case.name}: {result.statement}; {steps}\n")
        tables = text(result.case, result.summary, table_width(arguments))
        say(tables, end="\n\n" if len(results) > 1 else "\n")
    if len(results) > 1:
        say(records_table(results, table_width(arguments)))
    return int(not all(result.stands for result in results))
