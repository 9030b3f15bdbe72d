"""The comparison with the published numbers (reference/ssnp142.csv)."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .. import data
from ..model.case import CASES, Case
from ..model.results import Results

REFERENCE = data("reference") / "ssnp142.csv"


@dataclass(frozen=True)
class Reference:
    """One published number: where, how much, how exactly, from whom, and how it was read."""

    modeling: str
    uplift: str
    quantity: str
    x: float
    value: float
    unit: str
    #: None: information only
    tolerance: float | None
    source: str
    note: str
    #: "node", or "extrapolated": a node value made from integration points by the published code
    read_as: str


@dataclass(frozen=True)
class Comparison:
    """A reference and what was computed."""

    reference: Reference
    computed: float

    @property
    def difference(self) -> float:
        """Relative difference, computed over reference minus one."""
        return self.computed / self.reference.value - 1

    @property
    def verdict(self) -> str:
        """Pass, fail, or info where the reference carries no tolerance, or the document prints
        another value.
        """
        if (
            self.reference.tolerance is None
            or self.reference.note == "the document prints another value"
        ):
            return "info"
        return "pass" if abs(self.difference) <= self.reference.tolerance else "fail"


@lru_cache(maxsize=1)
def table() -> list[Reference]:
    """All reference rows."""
    with REFERENCE.open() as file:
        return [
            Reference(
                r["modeling"],
                r["uplift"],
                r["quantity"],
                float(r["x"]),
                float(r["value"]),
                r["unit"],
                float(r["rel_tolerance"]) if r["rel_tolerance"] else None,
                r["source"],
                r["note"],
                r["read_as"],
            )
            for r in csv.DictReader(file)
        ]


def references(case: Case) -> list[Reference]:
    """The reference rows of a scene, if it is what has been published."""
    if not case.published:
        return []
    return [r for r in table() if r.modeling == case.name.upper() and r.uplift == case["uplift"]]


def read_at(case: Case) -> float:
    """The time the references belong to: the last, or the end of the prescribed displacement."""
    return case.times[-1] if case["drive"] == "level" else case["drive_end"]


def modelings() -> list[str]:
    """The cases that have reference rows and a case file."""
    return sorted(
        {r.modeling.lower() for r in table() if (CASES / f"{r.modeling.lower()}.case").exists()}
    )


def compare(result: Results) -> list[Comparison]:
    """Every reference row of the scene beside the computed value: at the node of the same x, mean
    over z.

    Read at the last level, or at the end of the prescribed displacement.
    """
    found = []
    case = result.case
    time = read_at(case)
    for reference in references(case):
        rows = result.at(time) if reference.read_as == "node" else result.at_extrapolated(time)
        near = np.abs(rows["x"] - reference.x)
        found.append(
            Comparison(reference, float(rows[reference.quantity][near < near.min() + 1e-6].mean()))
        )
    return found


def report(comparisons: list[Comparison], style: str = "simple") -> str:
    """The table as text, and its summary line; style: as tabulate has them."""
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
        "",
        "source",
        "read as",
    )
    counts = {v: sum(c.verdict == v for c in comparisons) for v in ("pass", "fail", "info")}
    summary = "{pass} passed, {fail} failed, {info} for information only".format(**counts)
    return f"{tabulate(rows, heads, style, disable_numparse=True)}\n\n{summary}"
