"""damjoint run."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .cases import load_case
from .options import Parser, deviations, say, table_width

if TYPE_CHECKING:
    from ..model.results import Results
    from ..pictures.drawing_process import DrawingProcess


SUMMARY = "fill the reservoir of a case; exit code 1 if the dam fails or the run stops early"


def add(command: Parser) -> None:
    """Add the options."""
    command.add_settings()
    command.add_loading()
    command.add_accuracy()
    command.add_all_steps()
    repeated = "; K_N, K_T: the run at a tenth and ten times of it, too"
    command.add_sensitivity("the results at each level, sensitivity.csv,", repeated)
    command.add_wide()
    command.add_case()
    command.add_path("--out", "FOLDER", help="output folder (default: out/CASE)")
    command.add_argument(
        "--no-fields", action="store_true", help="write no files of displacement and stress"
    )
    command.add_no_picture()
    command.add_engine()


def call(arguments: argparse.Namespace) -> int:
    """Run damjoint run; 0, or 1 if the dam fails or the run stopped before its last level."""
    if arguments.no_picture:
        return run_and_print(arguments, None)
    from ..pictures.drawing_process import DrawingProcess

    with DrawingProcess() as drawing:  # before the other libraries are loaded
        return run_and_print(arguments, drawing)


def run_and_print(arguments: argparse.Namespace, drawing: DrawingProcess | None) -> int:
    """Run a case and print its results; drawing: draws its pictures (None: there are none)."""
    from ..post import summary
    from ..runner import run
    from ..statics.hints import hints
    from ..statics.statement import path_statement, statement
    from ..statics.verdict import failed, verdict
    from ..studies import stiffness

    case = load_case(arguments, arguments.case)
    out = arguments.out or Path("out") / case.name
    fields, picture = not arguments.no_fields, drawing is not None
    code, options = 0, dict[str, Any]()
    uncertain = deviations(arguments)
    if arguments.sensitivity:
        from ..studies import sensitivity

        names = sensitivity.names_of(case, arguments.sensitivity, True, uncertain)
        options["further"] = partial(sensitivity.write, names, picture, deviations=uncertain)
        options["stage"] = sensitivity.STAGE
    options |= {"engine": arguments.engine, "drawing": drawing}

    def show(result: Results) -> None:
        """Print a scene, before its pictures are drawn."""
        steps, iterations = len(result.history["time"]), int(result.history["iterations"].sum())
        say(
            f"{case.name}, uplift {result.case['uplift']}: {verdict(result)}; {steps} "
            f"step{'s' * (steps != 1)}, {iterations} iteration{'s' * (iterations != 1)}; {out}"
        )
        driven = case["drive"] != "level"
        if reasons := [
            *filter(None, [path_statement(result) if driven else "", statement(result)])
        ]:
            say(*reasons)
        if result.last:
            say(f"\n{summary.text(result, table_width(arguments))}")
        if derived := result.info.get("sensitivity"):
            say("", sensitivity.words(derived, table_width(arguments)))
        lines = [stiffness.meaning(result.case) if result.last else "", *hints(result)]
        lines.append(result.info.get("error_estimate", {}).get("statement", ""))
        if any(lines):
            say("", *filter(None, lines))

    options["on_saved"] = show
    for result in run(case, out, fields, picture, **options):
        repeated = stiffness.named_in(arguments.sensitivity or "")
        if repeated and result.last:
            runs = stiffness.repetitions(result.case, result, repeated, arguments.engine)
            say(*stiffness.lines(list(runs), table_width(arguments)))
        code = max(code, int(failed(result)))
    return code
