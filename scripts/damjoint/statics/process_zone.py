"""The length of the fracture process zone, by the material, against the elements of the joint.

l = 9 pi/32 E' G_f/f_t^2 (Rice 1980, of a crack between half planes; Hillerborg's length E G_f/f_t^2
times a factor), E' = E/(1 - nu^2), the harmonic mean of both bodies. With less than three elements
in it the stresses ahead of a crack follow the mesh and not the material, and the crack starts later
(Turon et al. 2007).
"""

from __future__ import annotations

import math

from ..input.case import Case
from ..model.results import Results

#: Factor of the zone's length [-].
RICE = 9 * math.pi / 32
#: Least number of elements in it.
LEAST = 3
#: Most elements of a joint in 2D; where the zone needs more, no mesh resolves it.
MOST = 2000


def length(case: Case) -> float:
    """Of a joint [m]; infinite if its law does not soften in tension or it has no strength."""
    if not (case.law.softens and case["sigma_max"]):
        return math.inf
    compliance = sum((1 - case[f"nu_{b}"] ** 2) / case[f"E_{b}"] for b in ("dam", "found")) / 2
    return float(RICE * case["G_f"] / (compliance * case["sigma_max"] ** 2))


def elements(results: Results) -> float:
    """The number of elements in the zone of the only joint of these results; infinite where it has
    not opened beyond the strength f_t/K_N.
    """
    case, history = results.case, results.history
    opened = history["max_opening"].max(initial=0.0) > case["sigma_max"] / case["K_N"]
    return length(case) * case["n_joint"] / case.joint_length if opened else math.inf


def least(case: Case) -> float:
    """The least number of elements of a joint with which its zone has `LEAST`."""
    return math.ceil(LEAST * case.joint_length / length(case))
