"""`damjoint calibrate`: the search, its files and its printed lines."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..engines.condensed.solve import about
from ..input import parameters
from ..input.case import Case
from ..input.written_case import case_text
from ..model.results import Info
from ..post.summary import aligned
from ..post.tables import Column, write_csv
from ..session import Session, preparation, session
from ..storage import atomic_write
from ..units import with_slash
from .calibrate import CONFIDENCE, Calibration, Fit, Free
from .calibrate_picture import draw
from .measurements import Measurements

#: Files: estimates; measured and computed values.
ESTIMATES, RESIDUALS = "calibration.csv", "residuals.csv"
#: Headings of the printed estimates.
HEADS = ["parameter", "unit", "start", "estimate", f"{CONFIDENCE:.0%} interval"]


def calibrate(
    case: Case,
    free: list[Free],
    measurements: Measurements,
    out: Path,
    jobs: int | None = None,
    picture: bool = True,
) -> Calibration:
    """Calibrate a case and write its files into a folder: the tables of the calibrated run, the
    estimates, the residuals, a case file, a picture.

    jobs: number of processes. Raises InputError, RunError.
    """
    measurements.loaded(case)  # checks the levels, before an earlier study is removed
    with session(case, out) as study:
        answer = compute(case, free, measurements, jobs)
        save(study, answer, picture)
    return answer


def compute(
    case: Case,
    free: list[Free],
    measurements: Measurements,
    jobs: int | None = None,
    progress: bool = True,
) -> Calibration:
    """Calibrate a case; nothing is written. Raises InputError, RunError."""
    with preparation(case, progress) as shown:

        def on_run(runs: int, squares: float) -> None:
            shown.describe(f"{case.name}: run {runs}, sum of squares {squares:.4g}")

        return Fit(case, free, measurements, jobs, on_run).run()


def save(study: Session, answer: Calibration, picture: bool) -> None:
    """Write the files of a calibration."""
    name = study.case.name
    stepper = answer.stepper
    assert stepper
    result = stepper.results()
    entries: Info = {"calibration": as_json(answer), "wall_seconds": {"search": study.seconds}}
    result.info |= about(stepper.model.equilibrium.bulk) | entries
    study.save(result, more=partial(write_tables, answer))
    file = study.out / "calibrated.case"
    with atomic_write(file) as part:
        part.write_text(case_text(answer.case))
    if picture:
        study.add(result, lambda out: draw(answer, out / f"{name}_calibration.png"))


def write_tables(answer: Calibration, out: Path) -> None:
    """Write the estimates and the residuals."""
    write_csv(out / ESTIMATES, estimates_table(answer))
    write_csv(out / RESIDUALS, residuals_table(answer))


def estimates_table(answer: Calibration) -> dict[str, Column]:
    """A row per parameter: start, estimate, interval, whether it is determined (1, 0), and its
    correlations with the others, empty without one.
    """
    names = [one.name for one in answer.free]
    table: dict[str, Column] = {
        "parameter": names,
        "unit": [parameters.of_any_joint(name).unit for name in names],
        "start": np.array([one.start for one in answer.free]),
        "estimate": answer.estimates,
        "low": answer.intervals[:, 0],
        "high": answer.intervals[:, 1],
        "determined": np.array([float(name not in answer.undetermined) for name in names]),
    }
    return table | {
        f"correlation_{name}": ["" if np.isnan(v) else float(v) for v in row]
        for name, row in zip(names, answer.correlation, strict=True)
    }


def residuals_table(answer: Calibration) -> dict[str, Column]:
    """A row per measured value: reading, date, level, its column, measured, computed, standard
    deviation, and their difference over it.
    """
    measurements, residuals = answer.measurements, answer.residuals
    rows = [
        (k, number)
        for number in range(len(measurements.levels))
        for k in range(len(measurements.series))
        if np.isfinite(residuals[k, number])
    ]
    series = measurements.series
    return {
        "reading": np.array([number + 1.0 for _, number in rows]),
        "date": [measurements.dates[number] for _, number in rows],
        "level": np.array([measurements.levels[number] for _, number in rows]),
        "series": [series[k].name for k, _ in rows],
        "measured": np.array([series[k].measured[number] for k, number in rows]),
        "computed": np.array([answer.computed[k, number] for k, number in rows]),
        "standard_deviation": np.array([series[k].deviation[number] for k, number in rows]),
        "residual": np.array([residuals[k, number] for k, number in rows]),
    }


def as_json(answer: Calibration) -> dict[str, Any]:
    """The entry `calibration` of run.json."""
    return {
        "parameters": {
            one.name: {"start": one.start, "estimate": estimate, "interval": list(interval)}
            for one, estimate, interval in zip(
                answer.free, answer.estimates.tolist(), answer.intervals.tolist(), strict=True
            )
        },
        "undetermined": answer.undetermined,
        "measured_values": answer.measurements.number,
        "chi2": answer.squares,
        "degrees_of_freedom": answer.freedom,
        "verdict": verdict(answer),
        "findings": answer.findings,
        "converged": answer.converged,
        "runs": answer.runs,
    }


def verdict(answer: Calibration) -> str:
    """Whether the calibrated model explains the measurements, in words."""
    if not answer.converged:
        return f"the search has not converged after {answer.runs} runs"
    if answer.findings:
        return "the model does not explain the measurements"
    return f"the residuals are those of the given standard deviations: {answer.all_squares}"


def printed_lines(answer: Calibration) -> list[str]:
    """The printed lines: verdict, estimates, what is not determined, findings."""
    names = ", ".join(one.name for one in answer.free)
    count = f"{answer.measurements.number} values in {len(answer.measurements.levels)} readings"
    lines = [f"{answer.case.name}: {names} calibrated to {count}, {answer.runs} runs"]
    lines += [verdict(answer), *answer.findings, "", estimates_text(answer), ""]
    lines += [
        f"{name}: not determined by these measurements, or at its limit"
        for name in answer.undetermined
    ]
    lines += [
        f"{one}, {other}: hardly told apart (correlation {value:.3f})"
        for one, other, value in answer.alike
    ]
    return lines


def estimates_text(answer: Calibration) -> str:
    """The estimates as a printed table."""
    rows: list[tuple[str, ...]] = [
        (
            one.name,
            with_slash(parameters.of_any_joint(one.name).unit),
            f"{one.start:.4g}",
            f"{estimate:.4g}",
            f"{low:.4g} to {high:.4g}",
        )
        for one, estimate, (low, high) in zip(
            answer.free, answer.estimates, answer.intervals, strict=True
        )
    ]
    return aligned(rows, HEADS, left=2)
