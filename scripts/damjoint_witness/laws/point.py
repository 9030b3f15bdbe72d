"""What the laws at a point have in common."""

from __future__ import annotations

from collections.abc import Mapping
from math import exp
from typing import Any

#: Values of a joint's parameters.
Values = Mapping[str, Any]
#: Displacement jump [m]: delta_n, delta_t1, delta_t2.
Jump = tuple[float, float, float]


class Point:
    """A point of a joint with its internal variables."""

    def __init__(self, values: Values) -> None:
        self.K_N, self.K_T = float(values["K_N"]), float(values["K_T"])
        #: the jump after the last step
        self.jump: Jump = (0.0, 0.0, 0.0)

    def step(self, jump: Jump, begin: float, end: float, frozen: bool) -> None:
        """Update the internal variables by a step to a jump, from t = begin to end.

        frozen: the step was solved with the damage frozen to which the last jump leads.
        """
        raise NotImplementedError

    def traction(self, jump: Jump) -> Jump:
        """Effective normal stress and shear stresses [Pa] at a jump, after the step to it."""
        raise NotImplementedError

    def damage(self, jump: Jump) -> float:
        """The damage, 0 to 1."""
        raise NotImplementedError

    def gapes(self, jump: Jump) -> bool:
        """Whether it belongs to the crack and is not closed."""
        raise NotImplementedError

    def slip(self) -> float:
        """Size of the slip [m]."""
        raise NotImplementedError

    def further(self) -> dict[str, float]:
        """Values of further columns, by name [m]."""
        return {}

    def strength(self, normal: float) -> float:
        """Size of the strength [Pa] at an effective normal stress: the scale of errors."""
        raise NotImplementedError

    def shear_rounding(self, jump: Jump) -> float:
        """What the rounding of the opening changes in the shear stress [Pa]."""
        return 0.0

    def jumping(self, jump: Jump) -> float:
        """Distance in opening [m] to where the damage has a discontinuity."""
        return float("inf")


def damage_after(xi: float, curve: str) -> float:
    """The damage after a progress xi of the softening: the area below the rest is 1/2."""
    return 1 - exp(-2 * xi) if curve == "exponential" else min(xi, 1.0)


def ramp(time: float, complete: float) -> float:
    """Share of a work on the joint at a time: linear over the unit of t before it is complete."""
    return min(max(time - complete + 1, 0.0), 1.0)
