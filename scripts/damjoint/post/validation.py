"""Comparison with published numbers: one table per family of tests, reference/FAMILY.csv."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from .. import data
from ..arrays import Array
from ..input.case import Case
from ..input.case_names import CASES
from ..model.results import Results
from .summary import aligned, fitted

#: The families, and what each test shows.
FAMILIES = {
    "ssnp142": "a 10 m dam under rising water: rupture and friction, uplift, flow, 2D and 3D, past "
    "the critical load",
    "ssnp133": "a plate torn off its base, rupture: the path of its force through two snap-backs",
    "ssnp143": "two blocks on a vertical joint: grouted, sawn; rupture and friction, 2D and 3D",
    "ssnp162": "the laws rupture and friction at one point: to and fro in tension and shear",
    "ssnp164": "the law endo at one point: tension, shear, both, opened and lifted by water",
    "ssnv503": "a slider on a plane of 30 degrees: sticks at 99 %, slips at 101 % of the friction",
    "ssnp166": "a notched beam, exponential softening: the force on it beyond its maximum",
    "sdnv138": "the dam of SSNP142 C and J in an earthquake: near overturning; with a dry joint",
    "slammer": "Newmark's rigid block: slips of SLAMMER under records in both signs; under a sine",
    "wtnp128": "a specimen with water in its notch, split by wedges slowly and fast: flow in time",
}
#: How a published number was read, column `read_as`: at a node; there from the Gauss points, as the
#: published code prints it; and likewise with the released slip of the last step counted twice.
NODE, EXTRAPOLATED, SLIP_TWICE = "node", "extrapolated", "slip twice"
EVALUATIONS = {
    NODE: "",
    EXTRAPOLATED: "extrapolated from Gauss points",
    SLIP_TWICE: "slip of the last step counted twice",
}
#: Distance [m] within which nodes have the same position: those along z in 3D.
SAME_NODE = 1e-6


@dataclass(frozen=True)
class Reference:
    """A published number: where, value, tolerance, source, and how it was read."""

    family: str
    modeling: str
    uplift: str
    quantity: str
    #: the position [m], a mean over the coordinates that are None; and t, None: `reference_time`
    x: float | None
    y: float | None
    z: float | None
    t: float | None
    value: float
    unit: str
    #: relative
    tolerance: float
    source: str
    note: str
    #: a key of EVALUATIONS
    read_as: str
    #: the published code's own value, where the reference is something else
    code: float | None = None


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
        """Pass or fail."""
        return "pass" if abs(self.difference) <= self.reference.tolerance else "fail"


@cache
def table(family: str) -> list[Reference]:
    """Read the published numbers of a family."""
    with (data("reference") / f"{family}.csv").open() as file:
        return [reference(family, row) for row in csv.DictReader(file)]


def reference(family: str, row: Mapping[str, str]) -> Reference:
    """A row of a table; columns that a family does not have are empty."""
    texts: dict[str, Any] = {n: row[n] for n in ("modeling", "quantity", "unit", "source", "note")}
    numbers = {n: float(row[n]) if row.get(n) else None for n in (*"xyzt", "code")}
    return Reference(
        family=family,
        uplift=row.get("uplift", ""),
        value=float(row["value"]),
        tolerance=float(row["rel_tolerance"]),
        read_as=row.get("read_as", NODE),
        **texts | numbers,
    )


def references(case: Case) -> list[Reference]:
    """Published numbers of a scene; empty if it differs from the published scene."""
    if not case.published:
        return []
    name, uplift = case.name.upper(), case["uplift"]
    every = (reference for family in FAMILIES for reference in table(family))
    return [r for r in every if r.modeling == name and r.uplift == uplift]


def reference_time(case: Case) -> float:
    """Time of the published numbers: the last, or the end of the displacement control."""
    return case.times[-1] if case["drive"] == "level" else case["drive_end"]


def modelings(family: str) -> list[str]:
    """The modelings of a family that are cases: names of their files."""
    names = {r.modeling.lower() for r in table(family) if r.uplift}
    return sorted(name for name in names if (CASES / f"{name}.case").exists())


def compare(result: Results) -> list[Comparison]:
    """Compare a scene with its published numbers at the nodes of the same position."""
    comparisons = []
    case = result.case
    for reference in references(case):
        time = reference_time(case) if reference.t is None else reference.t
        if reference.quantity in result.history:
            computed = result.state(time)[reference.quantity]
            comparisons.append(Comparison(reference, computed))
            continue
        rows = result.at(time) if reference.read_as == NODE else result.at_extrapolated(time)
        values = rows[reference.quantity]
        if reference.read_as == SLIP_TWICE:
            values = values + rows["slip"] - result.at(case.requested[-2])["slip"]
        position = {c: value for c in "xyz" if (value := getattr(reference, c)) is not None}
        away = np.sum([np.abs(rows[c] - value) for c, value in position.items()], axis=0)
        computed = values[away < away.min() + SAME_NODE].mean()
        comparisons.append(Comparison(reference, float(computed)))
    return comparisons


def last_time(family: str) -> float:
    """The last time [s] of the published numbers of a family that states them."""
    return max(r.t for r in table(family) if r.t is not None)


def compare_steps(family: str, modeling: str, columns: Mapping[str, Array]) -> list[Comparison]:
    """Compare the steps of a test other than a static run, by columns, with published numbers."""
    return [
        Comparison(r, float(columns[r.quantity][np.abs(columns["t"] - r.t).argmin()]))
        for r in table(family)
        if r.modeling == modeling and r.t is not None
    ]


def worst(comparisons: list[Comparison]) -> float:
    """Largest difference over its tolerance."""
    return max(abs(c.difference) / c.reference.tolerance for c in comparisons)


def columns_of(comparisons: list[Comparison], digits: int = 6) -> dict[str, list[str]]:
    """The comparisons as columns of text by heading, without those that are empty."""
    shown: Callable[[float | None], str] = lambda value: (
        "" if value is None else f"{value:.{digits}g}"
    )
    rows = [
        (
            c.reference.modeling,
            c.reference.uplift,
            c.reference.quantity,
            *(shown(getattr(c.reference, name)) for name in "xyzt"),
            shown(c.reference.value),
            shown(c.reference.code),
            shown(c.computed),
            c.reference.unit,
            f"{100 * c.difference:+.2f} %",
            f"{100 * c.reference.tolerance:g} %",
            c.verdict,
            c.reference.source,
            EVALUATIONS[c.reference.read_as],
            c.reference.note,
        )
        for c in comparisons
    ]
    heads = (
        *("case", "uplift", "quantity", *"xyzt", "reference", "published code", "computed", "unit"),
        *("difference", "tolerance", "verdict", "source", "evaluation", "note"),
    )
    columns = dict(zip(heads, map(list, zip(*rows, strict=True)), strict=True))
    return {h: cells for h, cells in columns.items() if any(cells) or h in ("unit", "verdict")}


def report(comparisons: list[Comparison], style: str = "simple") -> str:
    """Format the comparisons as a table of all columns and a summary; style: of tabulate."""
    from tabulate import tabulate

    columns = columns_of(comparisons)
    if not any(columns["unit"]):
        del columns["unit"]
    text = tabulate(columns, "keys", style, disable_numparse=True)
    return f"{text}\n\n{summary(comparisons)}"


#: Columns that a narrow table leaves out, in this order, and those that it leaves out where they
#: say the same of all rows.
LESS, SAME = ("evaluation", "source", "published code", "tolerance", "z", "y"), ("uplift", "x", "t")
#: Columns of text before the numbers, and after the verdict.
BEFORE, AFTER = ("case", "uplift", "quantity"), ("source", "evaluation")


def printed(comparisons: list[Comparison], width: int | None) -> str:
    """Format summary and comparisons of a family for a terminal's width, None: all columns."""
    columns = columns_of(comparisons, 6 if width is None else 5)
    columns.pop("note", None)
    units = columns.pop("unit")
    columns["quantity"] = [
        f"{quantity} [{unit}]" if unit else quantity
        for quantity, unit in zip(columns["quantity"], units, strict=True)
    ]
    if width is not None:  # the title above has the family's name
        family = comparisons[0].reference.family.upper()
        cases = [case.removeprefix(family) for case in columns["case"]]
        columns["case"] = cases if all(cases) else columns["case"]
    names, rows = list(columns), list(zip(*columns.values(), strict=True))
    heads = ["differs\nby" if name == "difference" else name for name in names]
    less = *LESS, *(name for name in SAME if len(set(columns.get(name, ()))) == 1)

    def draw(rows: list[tuple[str, ...]], shown: list[str]) -> str:
        texts = [sum(name in shown for name in group) for group in (BEFORE, AFTER)]
        return aligned(rows, shown, *texts)

    return f"{summary(comparisons)}\n\n{fitted(names, heads, rows, less, width, draw)}"


def summary(comparisons: list[Comparison]) -> str:
    """How many rows passed and failed, and the worst difference over its tolerance."""
    passed = sum(c.verdict == "pass" for c in comparisons)
    text = f"{passed} passed, {len(comparisons) - passed} failed"
    return f"{text}; the worst uses {worst(comparisons):.0%} of its tolerance"


def shown_time(result: Results) -> float:
    """Requested time of the state drawn: the last, or that of the published numbers."""
    times = result.joint["time"]
    published_time = reference_time(result.case)
    published = references(result.case) and np.isclose(times, published_time).any()
    return published_time if published else times.max()
