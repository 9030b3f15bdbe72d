"""The lengths of the fracture process zones, by the material, against the elements of the joint.

l = 9 pi/32 E' G/f^2 (Palmer and Rice 1973, Rice 1980: of a shear crack between half planes, which
an opening one has, too; Hillerborg's length E G/f^2 times a factor): in tension with G_f and f_t,
in shear with G_t and the cohesion c, as friction remains. E' = E/(1 - nu^2), the harmonic mean of
both bodies. With less than three elements in it the stresses ahead of a crack follow the mesh and
not the material, and the crack starts later (Turon et al. 2007).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from ..input.case import Case
from .results import Results

#: Factor of the zone's length [-].
RICE = 9 * math.pi / 32
#: Least number of elements in it.
LEAST = 3
#: Most elements of a joint in 2D; where the zone needs more, no mesh resolves it.
MOST = 2000


@dataclass(frozen=True)
class Zone:
    """A process zone of a case's only joint."""

    case: Case
    #: its formula, and its length [m]
    formula: str
    length: float

    @property
    def elements(self) -> float:
        """The number of elements in it."""
        return self.length * self.case["n_joint"] / self.case.joint_length

    @property
    def least(self) -> int:
        """The least number of elements of the joint with which it has `LEAST`."""
        return math.ceil(LEAST * self.case.joint_length / self.length)


def zone(case: Case, energy: str, strength: str, formula: str) -> Zone:
    """The zone of an energy [N/m] and a strength [Pa], by their parameters."""
    compliance = sum((1 - case[f"nu_{b}"] ** 2) / case[f"E_{b}"] for b in ("dam", "found")) / 2
    return Zone(case, formula, float(RICE * case[energy] / (compliance * case[strength] ** 2)))


def tension(case: Case) -> Zone | None:
    """The zone ahead of an opening crack; None if the joint does not soften or has no strength."""
    if not (case.law.softens and case["sigma_max"]):
        return None
    return zone(case, "G_f", "sigma_max", "9 pi/32 E' G_f/f_t^2")


def shear(case: Case) -> Zone | None:
    """The zone ahead of a slip; None if the joint has no cohesion that softens by an energy."""
    if "G_t" not in case.law.least_energies(case.values) or not case["adhesion"]:
        return None
    return zone(case, "G_t", "adhesion", "9 pi/32 E' G_t/c^2")


def unresolved(case: Case) -> bool:
    """Whether a zone of the only joint of a case would have fewer than `LEAST` elements."""
    return any(ahead and ahead.elements < LEAST for ahead in (tension(case), shear(case)))


def too_short(results: Results) -> Iterator[Zone]:
    """Yield the zones of the only joint of these results with fewer than `LEAST` elements: of
    tension where it has opened beyond the strength f_t/K_N, of shear where it has slipped by more
    than an element beyond the crack.
    """
    case, history = results.case, results.history
    element = case.joint_length / case["n_joint"]
    opened = history["max_opening"].max(initial=0.0) > case["sigma_max"] / case["K_N"]
    slipped = (history["slip_length"] - history["crack_length"]).max(initial=0.0) > element
    for ahead, has_formed in ((tension(case), opened), (shear(case), slipped)):
        if ahead and has_formed and ahead.elements < LEAST:
            yield ahead
