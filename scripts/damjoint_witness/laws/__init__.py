"""The joint laws at a point, replayed along the jumps that a run has written.

Scalar Python from the formulas of section 4 of reference/theory.md.
"""

from __future__ import annotations

from .bond import Bond
from .endo import Endo
from .friction import Friction
from .mixed import Mixed
from .point import Point
from .rupture import Rupture

LAWS: dict[str, type[Point]] = {
    "bond": Bond,
    "endo": Endo,
    "friction": Friction,
    "mixed": Mixed,
    "rupture": Rupture,
}
