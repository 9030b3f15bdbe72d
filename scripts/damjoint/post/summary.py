"""What a run has found, level by level, for people: in units by size."""

from __future__ import annotations

from textwrap import wrap

import numpy as np
from tabulate import tabulate

from ..model.results import Results
from ..statics import gravity
from .units import FLUXES, FORCES, LENGTHS, MOMENTS, Units, unit

#: Columns of the history at the requested levels: name, head, units.
SHOWN: tuple[tuple[str, str, Units], ...] = (
    ("level", "level", LENGTHS[:1]),
    ("tail_level", "tailwater", LENGTHS[:1]),
    ("N", "N'", FORCES),
    ("T", "T", FORCES),
    ("M", "M", MOMENTS),
    ("U", "uplift U", FORCES),
    ("x_resultant", "N' at x", LENGTHS[:1]),
    ("crack_length", "open or broken", LENGTHS[:1]),
    ("process_zone", "softening", LENGTHS[:1]),
    ("slip_length", "slipped", LENGTHS[:1]),
    ("max_opening", "largest opening", LENGTHS),
    ("crest_ux", "crest movement", LENGTHS),
    ("flux", "leakage", FLUXES),
)


def table(columns: list[tuple[str, np.ndarray, Units]]) -> dict:
    """Heads with units by size, and rows of text."""
    heads, cells = [], []
    for head, values, units in columns:
        name, factor = unit([np.nan_to_num(values)], units)
        heads.append(f"{head} [{name}]")
        cells.append([f"{v * factor + 0.0:.4g}" if np.isfinite(v) else "-" for v in values])
    return {"heads": heads, "rows": list(zip(*cells, strict=True))}


def levels_table(result: Results) -> dict:
    """The history at the requested levels and where the run has stopped; where the resultant is."""
    history, case = result.history, result.case
    rows = np.flatnonzero([np.isclose(case.requested, t).any() for t in history["time"]])
    if len(history["time"]):
        rows = np.union1d(rows, len(history["time"]) - 1)
    # a joint that is closed everywhere has its "largest opening" below 0
    history = history | {"max_opening": np.maximum(history["max_opening"], 0)}
    shown = [
        (head, history[name][rows], units)
        for name, head, units in SHOWN
        if (name != "flux" or case["uplift"] == "flow")
        and (name not in ("tail_level", "process_zone") or history[name].any())
    ]
    found = table(shown)
    length = case.joint_length
    found["heads"].append("N' in")
    where = (gravity.position(x, length) for x in history["x_resultant"][rows])
    found["rows"] = [(*row, at) for row, at in zip(found["rows"], where, strict=True)]
    return found


def text(result: Results) -> str:
    """The table of the levels as text, for the terminal."""
    found = levels_table(result)
    named = (head.partition(" [") for head in found["heads"])
    heads = ["\n".join([*wrap(name, 10), mark.strip() + size]) for name, mark, size in named]
    sides = *("right" for _ in heads[1:]), "left"
    return tabulate(found["rows"], heads, disable_numparse=True, colalign=sides)
