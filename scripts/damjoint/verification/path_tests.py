"""Published tests of the path of a load that falls and rises: its states at given loads.

Each function is a family: the tests by the names that the column `modeling` of
reference/FAMILY.csv has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..input.resolve import load
from ..runner import compute


@dataclass(frozen=True)
class PathTest:
    """A case under control with a load of unknown factor, and where its path is read: factors, each
    where the path passes it for the first time after the one before, rising (True) or falling.
    """

    case: str
    read_at: Sequence[tuple[float, bool]]


def follow(test: PathTest, engine: str = "auto") -> dict[str, Array]:
    """Columns, a row per factor: t, the number of the row from 1; point_u [m], linear between the
    steps. engine: see `engine_of`.
    """
    history = compute(load(test.case), engine, fields=False).result.history
    return {"t": np.arange(1.0, len(test.read_at) + 1), "point_u": read(test, history)}


def read(test: PathTest, history: dict[str, Array]) -> Array:
    """The displacement of the point [m] at the factors of a test."""
    factor, moved, start, moves = history["load_factor"], history["point_u"], 0, list[float]()
    for value, rising in test.read_at:
        sign = 1 if rising else -1
        ends = np.diff(np.sign(sign * (factor - value))) > 0
        step = start + int(np.argmax(ends[start:]))
        share = (value - factor[step]) / (factor[step + 1] - factor[step])
        moves.append(float(moved[step] + share * (moved[step + 1] - moved[step])))
        start = step + 1
    return np.array(moves)


def ssnp133() -> dict[str, PathTest]:
    """The plate of modeling A, a factor of 0.1 for 1e7 N."""
    return {"A": PathTest("ssnp133", [(0.1, False), (0.11, True), (0.0474, False)])}


FAMILIES = {"ssnp133": ssnp133}
