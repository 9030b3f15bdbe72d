"""Statistics of a sweep's sample: probability of failure, and its sensitivity to the inputs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from tabulate import tabulate

from ..arrays import Value
from ..post.tables import write_rows
from . import sampling
from .plan import STATISTICS, Plan, Row, beside, column_of, numbers
from .sweep import UNDECIDED

#: Outcomes whose rank correlation with the inputs is computed: the failure over all rows, others
#: over the rows that stand, or of earthquakes over all that are at rest.
FAILED = "failed"
STATIC = ("crack_length", "max_opening", "crest_ux")
OF_QUAKES = ("residual_slip", "residual_tilt")

#: Half of the interval of one of Sobol's indices beyond which the rows are too few for it [-].
VAGUE = 0.5


def groups(plan: Plan, rows: list[Row], independent: bool = False) -> list[tuple[Row, list[Row]]]:
    """The combinations of varied values, and the rows of the sample with them; independent: only
    those that are, the first two blocks of a design for Sobol's indices.
    """
    most = 2 * plan.sobol if independent and plan.sobol else None
    columns = [column_of(name) for name in plan.varied]
    samples: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        samples.setdefault(tuple(row[c] for c in columns), []).append(row)
    return [(dict(zip(columns, k, strict=True)), rows[:most]) for k, rows in samples.items()]


def probabilities(plan: Plan, rows: list[Row]) -> list[dict[str, Value]]:
    """For each combination of the varied values: numbers of rows, of failures and of undecided
    rows; the probability of failure and the limits of its interval.
    """
    table: list[dict[str, Value]] = []
    for values, sample in groups(plan, rows, independent=True):
        undecided = sum(row["verdict"] in UNDECIDED for row in sample)
        fails = sum(row["failed"] == "1" for row in sample) - undecided
        share, low, high = sampling.probability(fails, undecided, len(sample))
        counts = {"rows": len(sample), "fail": fails, "undecided": undecided}
        table.append({**values, **counts, "probability": share, "low": low, "high": high})
    return table


def sensitivities(plan: Plan, rows: list[Row]) -> list[dict[str, Value]]:
    """For each combination of the varied values and each sampled input: Spearman's rank correlation
    with the outcomes and a critical value; nan where an outcome does not change.
    """
    table: list[dict[str, Value]] = []
    for values, sample in groups(plan, rows, independent=True):
        stand = np.array([row["failed"] == "0" for row in sample])
        static = plan.quake is None
        results = {o: numbers(sample, o) for o in (FAILED, *(STATIC if static else OF_QUAKES))}
        for outcome in STATIC if static else ():
            results[outcome][~stand] = np.nan
        results |= {c: numbers(sample, c) for c in plan.critical_columns[:1]}
        for name in plan.sampled:
            drawn = numbers(sample, column_of(name))
            ranks = {o: sampling.sensitivity(drawn, y) for o, y in results.items()}
            table.append({**values, "input": name, **ranks})
    return table


def indices(plan: Plan, rows: list[Row]) -> list[dict[str, Value]]:
    """For each combination of the varied values and each sampled input: Sobol's indices of the
    outcomes that all rows have; of the failure always.
    """
    table: list[dict[str, Value]] = []
    number, static = len(plan.sampled), OF_QUAKES if plan.quake else STATIC
    for values, sample in groups(plan, rows):
        for outcome in (FAILED, *static, *plan.critical_columns[:1]):
            y = numbers(sample, outcome)
            if not np.isfinite(y).all() or np.ptp(y) == 0:
                continue
            first, total, *widths = sampling.sobol_indices(y, number)
            for k, name in enumerate(plan.sampled):
                cells = {"first": first[k], "first_interval": widths[0][k]}
                cells |= {"total": total[k], "total_interval": widths[1][k]}
                numbers_of = {n: float(v) for n, v in cells.items()}
                table.append({**values, "outcome": outcome, "input": name, **numbers_of})
    return table


def is_vague(row: Mapping[str, Value]) -> bool:
    """Whether the interval of one of Sobol's indices in a row is wide, or not known: of an input
    that changes nothing the index is 0 without an interval.
    """
    names = [name for name in ("first", "total") if row.get(name)]
    return not all(float(row[f"{name}_interval"]) <= VAGUE for name in names)


def report(plan: Plan, rows: list[Row], out: Path) -> str:
    """Both tables as text; writes OUT_probability.csv and OUT_sensitivity.csv beside the rows."""
    texts = []
    interval = f"low, high: {sampling.CONFIDENCE:.0%} interval"
    titles = f"Probability of failure ({interval})", "Rank correlation with the outcome"
    tables = probabilities(plan, rows), sensitivities(plan, rows)
    named = list(zip(STATISTICS, titles, tables, strict=False))
    if plan.sobol and (shares := indices(plan, rows)):
        title = f"Sobol's indices, with half of their {sampling.CONFIDENCE:.0%} intervals"
        named.append((STATISTICS[-1], title, shares))
    for ending, title, table in named:
        write_rows(beside(out, ending), table)
        cells = [{n: None if v != v else v for n, v in row.items()} for row in table]  # nan
        texts.append(f"{title}\n{tabulate(cells, 'keys', floatfmt='.4g', missingval='-')}")
        if vague := [str(row["outcome"]) for row in table if is_vague(row)]:
            texts[-1] += (
                f"\n{plan.sobol} rows in a block are too few for the indices of "
                f"{', '.join(dict.fromkeys(vague))}: a larger --sample determines them"
            )
    return "\n\n".join(texts)
