"""Loads that no joint of a given strength can hold, whatever happens in it.

The joint's resultants N, T, M follow from the loads alone, unless the water in it follows its
opening. Where they pass what the strength allows everywhere at once there is no equilibrium (static
theorem of limit analysis, its necessary side): a sample need not search for one. Where they do not,
nothing is said.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..joint.interface import Interface
from ..laws import UNBREAKABLE
from ..model.case import Case, flows
from ..solver.load_stepper import LoadStepper

#: Parameters of which N, T, M do not depend.
STRENGTHS = (*UNBREAKABLE, "sigma_max", "G_f", "G_t", "alpha", "pena_rupture", "pena_contact")

#: Part of a bound by which it must be passed: far more than rounding makes.
MARGIN = 1e-6

_LAST: dict[tuple, dict[str, np.ndarray]] = {}


def resultants(case: Case, interface: Interface) -> dict[str, np.ndarray]:
    """The history of a case whose joint does not fail; the last one stays in memory."""
    values = tuple((n, v) for n, v in case.values.items() if n not in STRENGTHS)
    key = values, case.levels, case.tail_levels, case.times
    if key not in _LAST:
        _LAST.clear()
        strong = replace(case, values=case.values | UNBREAKABLE)
        _LAST[key] = LoadStepper(strong, interface).run().history
    return _LAST[key]


def elastic_heel_stress(case: Case, interface: Interface) -> float:
    """Largest effective normal stress [Pa] at the heel at the last level of a case whose joint does
    not fail: the heel is a corner, it depends on the mesh.
    """
    rows = LoadStepper(replace(case, values=case.values | UNBREAKABLE), interface).run().at()
    return float(rows["sigma_n_eff"][rows["s"] <= rows["s"].min()].max())


def mechanism(case: Case, interface: Interface) -> tuple[str, str]:
    """How a case fails for certain, and why, in words; both empty where the loads do not tell.

    Sliding: the shear exceeds the law's `shear_bound`. Overturning: with the tensile strength f
    and the joint's length L, the tension holds the dam down by f L^2/2 about the toe at most.
    """
    if flows(case) or case["drive"] != "level":
        return "", ""
    history, length = resultants(case, interface), case.section["joint_length"][0]
    shear = case.law.shear_bound(history["N"], length)
    for name, demand, bound, words in (
        ("sliding", np.abs(history["T"]), shear, "the shear T = {:.6g} N/m, what holds {:.6g} N/m"),
        (
            "overturning",
            -history["M"],
            np.full_like(shear, case.law.tensile_strength * length**2 / 2),
            "the moment -M = {:.6g} N, what holds {:.6g} N",
        ),
    ):
        beyond = np.flatnonzero(demand > bound + MARGIN * np.abs(demand))
        if len(beyond):
            first = beyond[0]
            told = words.format(demand[first], bound[first])
            return name, f"{name}: no equilibrium at level {history['level'][first]:.6g} m: {told}"
    return "", ""
