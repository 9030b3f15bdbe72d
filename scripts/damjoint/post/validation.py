"""Comparison with the published numbers of SSNP142 (reference/ssnp142.csv)."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .. import data
from ..model.case import CASES, Case
from ..model.results import Results

REFERENCE = data("reference") / "ssnp142.csv"
#: Distance along x [m] within which nodes are at the same place: those along z in 3D.
SAME_NODE = 1e-6


@dataclass(frozen=True)
class Reference:
    """A published number: where, value, tolerance, source, and how it was read."""

    modeling: str
    uplift: str
    quantity: str
    x: float
    value: float
    unit: str
    #: relative; None: for information only
    tolerance: float | None
    source: str
    note: str
    #: "node", or "extrapolated": a node value that the published code extrapolates from integration
    #: points
    read_as: str
    #: whether it is for information only although it has a tolerance: its sources contradict
    informative: bool = False


@dataclass(frozen=True)
class Comparison:
    """A published number and the computed value."""

    reference: Reference
    computed: float

    @property
    def difference(self) -> float:
        """Relative difference: computed over reference, minus 1."""
        return self.computed / self.reference.value - 1

    @property
    def verdict(self) -> str:
        """Pass or fail; info if the reference is for information only."""
        if self.reference.tolerance is None or self.reference.informative:
            return "info"
        return "pass" if abs(self.difference) <= self.reference.tolerance else "fail"


@lru_cache(maxsize=1)
def table() -> list[Reference]:
    """Read all published numbers."""
    with REFERENCE.open() as file:
        return [
            Reference(
                modeling=row["modeling"],
                uplift=row["uplift"],
                quantity=row["quantity"],
                x=float(row["x"]),
                value=float(row["value"]),
                unit=row["unit"],
                tolerance=float(row["rel_tolerance"]) if row["rel_tolerance"] else None,
                source=row["source"],
                note=row["note"],
                read_as=row["read_as"],
                informative=bool(row["informative"]),
            )
            for row in csv.DictReader(file)
        ]


def references(case: Case) -> list[Reference]:
    """Published numbers of a scene; empty if it differs from the published scene."""
    if not case.published:
        return []
    return [r for r in table() if r.modeling == case.name.upper() and r.uplift == case["uplift"]]


def reference_time(case: Case) -> float:
    """Time of the published numbers: the last, or the end of the displacement control."""
    return case.times[-1] if case["drive"] == "level" else case["drive_end"]


def modelings() -> list[str]:
    """List the cases that have published numbers and a case file."""
    return sorted(
        {r.modeling.lower() for r in table() if (CASES / f"{r.modeling.lower()}.case").exists()}
    )


def compare(result: Results) -> list[Comparison]:
    """Compare a scene with its published numbers at the nodes of the same x (mean over z), at
    `reference_time`.
    """
    comparisons = []
    case = result.case
    time = reference_time(case)
    for reference in references(case):
        rows = result.at(time) if reference.read_as == "node" else result.at_extrapolated(time)
        away = np.abs(rows["x"] - reference.x)
        computed = rows[reference.quantity][away < away.min() + SAME_NODE].mean()
        comparisons.append(Comparison(reference, float(computed)))
    return comparisons


def report(comparisons: list[Comparison], style: str = "simple") -> str:
    """Format the comparisons as a table and a summary line; style: a format of tabulate."""
    from tabulate import tabulate

    rows = [
        (
            c.reference.modeling,
            c.reference.uplift,
            c.reference.quantity,
            f"{c.reference.x:g}",
            f"{c.reference.value:.6g}",
            f"{c.computed:.6g}",
            c.reference.unit,
            f"{100 * c.difference:+.2f} %",
            "" if c.reference.tolerance is None else f"{100 * c.reference.tolerance:g} %",
            c.verdict,
            c.reference.source,
            "extrapolated from integration points" if c.reference.read_as == "extrapolated" else "",
        )
        for c in comparisons
    ]
    heads = (
        "case",
        "uplift",
        "quantity",
        "x [m]",
        "reference",
        "computed",
        "unit",
        "difference",
        "tolerance",
        "verdict",
        "source",
        "evaluation",
    )
    counts = {v: sum(c.verdict == v for c in comparisons) for v in ("pass", "fail", "info")}
    summary = "{pass} passed, {fail} failed, {info} for information only".format(**counts)
    return f"{tabulate(rows, heads, style, disable_numparse=True)}\n\n{summary}"


def shown_time(result: Results) -> float:
    """Requested time of the state drawn: the last, or that of the published numbers."""
    times = result.joint["time"]
    published_time = reference_time(result.case)
    published = references(result.case) and np.isclose(times, published_time).any()
    return published_time if published else times.max()
