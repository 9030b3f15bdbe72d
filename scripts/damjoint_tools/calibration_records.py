"""Synthetic records of ten years at a dam with drains, and what `damjoint calibrate` makes of them.

    python -m damjoint_tools.calibration_records out/calibrations.csv

A row per record: whether the interval of each free parameter contains the truth, whether the right
model is rejected, and, of every tenth record, whether the model without drains is. Rows that are
in the file are not computed again.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from damjoint.arrays import Setting
from damjoint.input.resolve import load, varied
from damjoint.progress import track
from damjoint.studies.calibrate import Fit, free_of
from damjoint.studies.measurements import Measurements, Series
from damjoint.studies.result_file import rows_session

from .provenance import RECORDED, provenance, source_line
from .stress import read_rows

#: Readings of a year, and their number in a record.
OF_YEAR, READINGS = 6, 60
#: A dam of few elements, with drains and a season of the temperature.
SETTINGS: dict[str, Setting] = {
    "n_joint": 8,
    "order": 1,
    "found_side": 45.0,
    "found_depth": 45.0,
    "uplift": "drained",
    "drain_x": 10.0,
    "temperature_t": 1.0,
    "temperature_period": OF_YEAR,
}
#: Free parameters: as the records are made, and where the search begins.
TRUTH = {"E_found": 2e10, "temperature_dam": 4.0, "drain_effectiveness": 0.6}
START = {"E_found": 2.5e10, "temperature_dam": 3.0, "drain_effectiveness": 0.5}
FREE = "E_found", "temperature_dam=-20:20", "drain_effectiveness"
#: Standard deviations of the errors of the instruments [m], and joint and place of the piezometer.
ERRORS = {"crest_ux": 5e-5, "head_10": 0.3}
#: A wrong model, without drains, and of which records: every tenth.
WRONG: dict[str, Setting] = {"uplift": "imposed"}
OF_WRONG = 10

#: Columns of the file.
COLUMNS = (
    *("record", *TRUTH, "converged", "rejected", "wrong_rejected", "seconds", "runs"),
    *RECORDED,
)


def record(number: int) -> Measurements:
    """The measurements of a record: what the dam of the TRUTH has, with normal errors."""
    readings = np.arange(READINGS)
    levels = 30 + 8 * np.sin(2 * np.pi * (readings / OF_YEAR - 0.25))
    none = np.zeros(READINGS)
    series = [
        Series(name, "m", none, none + error, 0, 10.0 if name == "head_10" else None)
        for name, error in ERRORS.items()
    ]
    empty = Measurements(tuple(levels.tolist()), None, ("",) * READINGS, tuple(series))
    exact = empty.computed(empty.loaded(load("dam", {**SETTINGS, **TRUTH})))
    errors = np.random.default_rng(number).normal(size=exact.shape)
    rows = zip(series, exact, errors, strict=True)
    measured = (replace(s, measured=v + e * s.deviation) for s, v, e in rows)
    return replace(empty, series=tuple(measured))


def row_of(number: int) -> dict[str, object]:
    """The row of a record."""
    measurements, case = record(number), load("dam", {**SETTINGS, **START})
    begin = time.process_time()
    right = Fit(case, free_of(case, FREE), measurements, jobs=1).run()
    seconds = time.process_time() - begin
    wrong = ""
    if number % OF_WRONG == 0:
        other = varied(case, WRONG)
        answer = Fit(other, free_of(other, FREE[:2]), measurements, jobs=1).run()
        wrong = str(int(bool(answer.findings)))
    low, high = right.intervals.T
    inside = [a < v < b for a, v, b in zip(low, TRUTH.values(), high, strict=True)]
    return {
        "record": number,
        **{n: int(found) for n, found in zip(TRUTH, inside, strict=True)},
        "converged": int(right.converged),
        "rejected": int(bool(right.findings)),
        "wrong_rejected": wrong,
        "seconds": round(seconds, 2),
        "runs": right.runs,
        **provenance(),
    }


def summary(rows: Sequence[dict[str, str]]) -> str:
    """What the rows show, with their origin."""
    count = {n: sum(int(row[n]) for row in rows) for n in (*TRUTH, "converged", "rejected")}
    wrong = [int(row["wrong_rejected"]) for row in rows if row["wrong_rejected"]]
    slowest = max(float(row["seconds"]) for row in rows)
    covered = ", ".join(f"{n} {count[n]}" for n in TRUTH)
    return "\n".join(
        [
            f"{len(rows)} records; truth within the 95 % interval: {covered}",
            f"converged {count['converged']}; right model rejected {count['rejected']}; "
            f"model without drains rejected {sum(wrong)} of {len(wrong)}",
            f"at most {slowest:.3g} CPU s a record",
            source_line(rows),
        ]
    )


def main() -> None:
    """Compute the rows that are missing, and print what all show."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("file", type=Path, help="CSV file of the rows")
    parser.add_argument("--records", type=int, default=100, help="number of records")
    arguments = parser.parse_args()
    path: Path = arguments.file
    path.parent.mkdir(parents=True, exist_ok=True)
    about, numeric = {"calibrations": {"records": arguments.records}}, ("record", "seconds")
    with rows_session("calibrations", path, COLUMNS, numeric, about) as (study, done):
        missing = [number for number in range(arguments.records) if str(number) not in done]
        for row in track(map(row_of, missing), "calibrations", len(missing)):
            study.add([str(row[name]) for name in COLUMNS])
    print(summary(read_rows(path)))


if __name__ == "__main__":
    main()
