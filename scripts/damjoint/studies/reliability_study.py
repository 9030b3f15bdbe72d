"""`damjoint reliability`: its files and its printed lines."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats
from tabulate import tabulate

from ..input.case import Case
from ..input.written_case import case_text
from ..post.folder import case_entries
from ..processes import check_jobs
from ..progress import Progress
from ..session import session
from ..storage import atomic_write
from ..units import with_slash
from . import openturns_process, reliability_picture, sampling
from .plan import quantity_of
from .reliability import (
    CriticalLevels,
    Reliability,
    Variables,
    analysed,
    cells_of,
    columns_of,
    design_case,
)
from .result_file import result_file
from .sweep import scheduler_client, search_of

#: Files of the study: the critical levels, and the case of the design point.
ROWS, DESIGN = "reliability.csv", "design_point.case"
#: Ending of the name of the picture, after that of the case.
PICTURE = "_reliability.png"


def reliability(
    case: Case,
    variables: Variables,
    samples: int,
    seed: int,
    out: Path,
    jobs: int | None = None,
    scheduler: str | None = None,
) -> tuple[list[Reliability], list[str]]:
    """Compute the reliability of a case and write its files below out; critical levels that an
    earlier study of the same variables has left there are not computed again.

    Returns that of each of several joints, then that of all; and the printed lines. Raises
    InputError, RunError.
    """
    openturns_process.version()  # checks that it is installed
    check_jobs(jobs)
    search_of(case, "level")  # checks the case
    variables.rank_correlations()
    medians = variables.values(np.zeros(len(variables.names)))
    CriticalLevels(case, variables).case_of("", medians)  # checks names, ties and values
    rows, columns = out / ROWS, columns_of(variables)
    keep = of_same_columns(rows, columns)
    with scheduler_client(scheduler) as client, session(case, out, keep) as study:
        numeric = [c for c in columns if c in ("critical_level", "confirmed")]
        with result_file(rows, columns, numeric) as (file, known):
            levels = CriticalLevels(case, variables, jobs, client, known)
            with Progress(case.name, bar_format="{desc} {elapsed}", leave=False) as shown:
                doing = ""

                def report(message: str = "") -> None:
                    nonlocal doing
                    doing = message or doing
                    shown.describe(f"{case.name}: {doing}, {levels.computed} critical levels")

                def save(*row: Any) -> None:
                    file.add(cells_of(variables, *row))
                    report()

                levels.on_row = save
                results = list(analysed(levels, samples, seed, report))
            file.check_exists()
        if results[-1].form:
            design = design_case(levels, results[-1])
            with atomic_write(out / DESIGN) as part:
                part.write_text(case_text(design), encoding="utf-8")
            values = [
                f"{name} = {value:.4g} {unit_of(name)}".removesuffix(" -")
                for name, value in results[-1].design.items()
            ]
            path = out / f"{case.name}{PICTURE}"
            reliability_picture.draw(results, heading(levels), values, path)
        entries = {"reliability": as_json(levels, results), **case_entries(case)}
        study.save_without_results("complete", "", entries)
    return results, printed_lines(levels, results, out)


def of_same_columns(path: Path, columns: Sequence[str]) -> bool:
    """Whether a file is of a study of the same variables."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return next(csv.reader(file), []) == list(columns)
    except (OSError, ValueError, csv.Error):
        return False


def as_json(levels: CriticalLevels, results: Sequence[Reliability]) -> dict[str, Any]:
    """The entry `reliability` of run.json."""
    variables = levels.variables

    def entry(one: Reliability) -> dict[str, Any]:
        numbers = {
            "beta": one.beta,
            "form": one.form,
            "sorm_breitung": one.breitung,
            "sorm_tvedt": one.tvedt,
            "sampled": one.sampled if one.samples else None,
            "interval": [one.low, one.high] if one.samples else None,
        }
        return {
            "joint": one.joint,
            **numbers,
            "samples": one.samples,
            "converged": one.converged,
            "design_point": dict(one.design),
            "importance": dict(one.importance),
            "agreement": one.words(),
        }

    return {
        "distributions": dict(variables.distributions),
        "correlate": list(variables.correlate),
        "tied": dict(variables.tied),
        "openturns": openturns_process.version(),
        "critical_levels": len(levels.used),
        "not_confirmed": levels.unconfirmed,
        "undecided": levels.undecided,
        "of": [entry(one) for one in results],
    }


def reliability_index(probability: float) -> float:
    """Reliability index of a probability."""
    return float(-stats.norm.ppf(probability))


def methods(one: Reliability) -> list[tuple[str, str, str]]:
    """Method, probability and reliability index of a reliability."""
    named = [("FORM", one.form), ("SORM (Breitung)", one.breitung), ("SORM (Tvedt)", one.tvedt)]
    rows = [
        (
            name,
            "-" if p is None else f"{p:.4g}",
            "-" if p is None else f"{reliability_index(p):.4g}",
        )
        for name, p in named
    ]
    if one.samples:
        share = f"{one.sampled:.4g} ({one.low:.4g} to {one.high:.4g})"
        betas = [f"{reliability_index(p):.4g}" for p in (one.sampled, one.high, one.low)]
        between = "{} ({} to {})".format(*betas) if one.sampled else "-"
        rows.append((f"{one.samples} samples", share, between))
    return rows


def heading(levels: CriticalLevels) -> str:
    """What the probability is of."""
    case, fixed = levels.case, "level" not in levels.variables.names
    what = f"level {case.levels[-1]:g} m" if fixed else "the level"
    return f"{case.name}: probability that {what} exceeds the critical level"


def printed_lines(levels: CriticalLevels, results: Sequence[Reliability], out: Path) -> list[str]:
    """The printed lines."""
    *single, whole = results
    lines = [f"{heading(levels)}; {out}", ""]
    interval = f"{sampling.CONFIDENCE:.0%} interval"
    heads = ["method", f"probability ({interval})", f"beta ({interval})"]
    lines += [tabulate(methods(whole), heads, disable_numparse=True), ""]
    verdicts = [(f"{one.joint}: " if one.joint else "", one.words()) for one in results]
    lines += [joint + words for joint, words in verdicts if words]
    if whole.form and not whole.converged:
        lines.append("the search for the design point has not converged: FORM is doubtful")
    count = len(levels.used)
    if levels.undecided:
        lines.append(f"{levels.undecided} of {count} critical levels failed: counted as failures")
    if levels.unconfirmed:
        lines.append(f"{levels.unconfirmed} of {count} critical levels are not confirmed")
    design = [
        (name, f"{value:.6g}", unit_of(name), f"{round(100 * whole.importance[name], 2):.3g}")
        for name, value in whole.design.items()
    ]
    heads = ["design point", "value", "unit", "importance [%]"]
    if whole.form:
        table = tabulate(design, heads, disable_numparse=True)
        lines += ["", table, f"as a case: {out / DESIGN}"]
    if single:
        rows = [(one.joint, *(cell for cell in (m[1] for m in methods(one)))) for one in single]
        heads = ["joint alone", *(m[0] for m in methods(whole))]
        lines += ["", tabulate(rows, heads, disable_numparse=True)]
    lines += ["", f"{count} critical levels, {levels.computed} of them computed now"]
    return lines


def unit_of(name: str) -> str:
    """Unit of a variable."""
    return with_slash(quantity_of(name)[1])
