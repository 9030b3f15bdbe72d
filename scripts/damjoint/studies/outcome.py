"""What the sample of a sweep says: probability of failure, and which inputs it comes from."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from tabulate import tabulate

from ..storage import atomic_write
from . import sampling
from .plan import Plan, Row, beside, column_of, numbers
from .sweep import UNDECIDED

#: Outcomes whose rank correlation with the inputs is told: the failure over all rows, the others
#: over the rows that stand.
OUTCOMES = ("failed", "crack_length", "max_opening", "crest_ux")


def groups(plan: Plan, rows: list[Row]) -> list[tuple[Row, list[Row]]]:
    """The varied values, and the rows of the sample that have them."""
    columns = [column_of(name) for name in plan.varied]
    found: dict[tuple, list[Row]] = {}
    for row in rows:
        found.setdefault(tuple(row[c] for c in columns), []).append(row)
    return [(dict(zip(columns, k, strict=True)), some) for k, some in found.items()]


def probabilities(plan: Plan, rows: list[Row]) -> list[dict[str, object]]:
    """For each combination of the varied values: rows, how many fail, how many have not come to an
    end, the probability of failure and the limits of its interval.
    """
    found = []
    for values, some in groups(plan, rows):
        undecided = sum(row["verdict"] in UNDECIDED for row in some)
        fails = sum(row["failed"] == "1" for row in some) - undecided
        share, low, high = sampling.probability(fails, undecided, len(some))
        counts = {"rows": len(some), "fail": fails, "undecided": undecided}
        found.append(values | counts | {"probability": share, "low": low, "high": high})
    return found


def sensitivities(plan: Plan, rows: list[Row]) -> list[dict[str, object]]:
    """For each combination of the varied values and each sampled input: Spearman's rank correlation
    with the outcomes and a critical value; nan where an outcome does not change.
    """
    found = []
    for values, some in groups(plan, rows):
        stand = np.array([row["failed"] == "0" for row in some])
        results = {o: numbers(some, o) for o in OUTCOMES}
        for outcome in OUTCOMES[1:]:
            results[outcome][~stand] = np.nan
        results |= {c: numbers(some, c) for c in plan.critical_columns[:1]}
        for name in plan.sampled:
            drawn = numbers(some, column_of(name))
            ranks = {o: sampling.sensitivity(drawn, y) for o, y in results.items()}
            found.append(values | {"input": name} | ranks)
    return found


def report(plan: Plan, rows: list[Row], out: Path) -> str:
    """Both tables in words, written beside the rows: OUT_probability.csv, OUT_sensitivity.csv."""
    said = []
    interval = f"low, high: {sampling.CONFIDENCE:.0%} interval"
    for name, told, table in (
        ("probability", f"Probability of failure ({interval})", probabilities(plan, rows)),
        ("sensitivity", "Rank correlation with the outcome", sensitivities(plan, rows)),
    ):
        with atomic_write(beside(out, f"_{name}.csv")) as path, path.open("w", newline="") as file:
            writer = csv.DictWriter(file, table[0], lineterminator="\n")
            writer.writeheader()
            writer.writerows(table)
        cells = [{n: "-" if v != v else v for n, v in row.items()} for row in table]  # nan
        said.append(f"{told}\n{tabulate(cells, 'keys', floatfmt='.4g')}")
    return "\n\n".join(said)
