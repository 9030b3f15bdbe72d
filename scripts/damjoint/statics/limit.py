"""Limit analysis: loads that exceed the strength of the joint, whatever the distribution of stress.

The joint's resultants N, T, M follow from the loads alone, unless the water in it depends on its
opening. Where they exceed the strength there is no equilibrium (static theorem of limit analysis),
and a sample needs no load steps. The converse does not hold.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from ..input.case import Case
from ..input.values import flows, freezes_uplift
from ..joint.interface import Interface
from ..laws import UNBREAKABLE
from ..model.results import column_of
from ..solver.load_stepper import LoadStepper
from ..units import FORCES, MOMENTS, with_unit

#: Parameters on which N, T, M do not depend.
STRENGTHS = (*UNBREAKABLE, "sigma_max", "G_f", "G_t", "alpha", "pena_rupture", "pena_contact")

#: Relative excess over a bound that counts as failure, far above round-off.
MARGIN = 1e-6


@dataclass(frozen=True)
class Elastic:
    """A case whose joint does not fail; equal if the resultants are equal."""

    key: tuple[object, ...]
    case: Case = field(compare=False)
    interface: Interface = field(compare=False)

    @staticmethod
    def of(case: Case, interface: Interface) -> Elastic:
        """The case with a joint that does not fail."""
        values = tuple((n, v) for n, v in case.values.items() if n not in STRENGTHS)
        strong = case.with_values(UNBREAKABLE)
        joint_values = tuple(
            (joint.name, *((n, v) for n, v in joint.values.items() if n not in STRENGTHS))
            for joint in case.of_joints
        )
        key = values, joint_values, case.levels, case.tail_levels, case.times
        return Elastic(key, strong, interface)


@lru_cache(maxsize=1)
def resultants(elastic: Elastic) -> dict[str, np.ndarray]:
    """The history of a case whose joint does not fail; a sample has the same for all its rows."""
    return LoadStepper(elastic.case, elastic.interface).run().history


def elastic_heel_stress(case: Case, interface: Interface) -> float:
    """Largest effective normal stress [Pa] at the first joint's heel at the last level of a case
    whose joints do not fail. It depends on the mesh, as the heel is a corner.
    """
    rows = LoadStepper(Elastic.of(case, interface).case, interface).run().joints[0].at()
    return float(rows["sigma_n_eff"][rows["s"] <= rows["s"].min()].max())


def mechanism(case: Case, interface: Interface) -> tuple[str, str]:
    """How a case certainly fails, and why; both empty if its failure is not certain.

    Sliding: the shear exceeds the law's `shear_bound`. Overturning: with the tensile strength f
    and the joint's length L, the moment of the tension about the toe is at most f L^2/2.
    """
    follows = (flows(joint) or freezes_uplift(joint) for joint in case.joints)
    if case["drive"] != "level" or any(follows):
        return "", ""
    if case.geometry:
        case = case.with_joints(interface.of_joints)
    history = resultants(Elastic.of(case, interface))
    for k, joint in enumerate(case.joints):
        rows = {name: history[column_of(name, k)] for name in "NTM"} | {"level": history["level"]}
        if case.separates((k,)) and (failure := mechanism_of_joint(joint, rows))[0]:
            where = case.named((k,))
            return failure if not where else (f"{failure[0]} on {where}", failure[1])
    return "", ""


def mechanism_of_joint(case: Case, history: dict[str, np.ndarray]) -> tuple[str, str]:
    """See `mechanism`, of a case with a single joint; history: level, N, T, M at its steps."""
    length = case.section["joint_length"][0]
    shear = case.law.shear_bound(history["N"], length)
    tension = np.full_like(shear, case.law.tensile_strength * length**2 / 2)
    for name, demand, bound, units, words in (
        ("sliding", np.abs(history["T"]), shear, FORCES, "T = {} exceeds the strength, {}"),
        ("overturning", -history["M"], tension, MOMENTS, "-M = {} exceeds the resistance, {}"),
    ):
        exceeded = np.flatnonzero(demand > bound + MARGIN * np.abs(demand))
        if len(exceeded):
            first = exceeded[0]
            reason = words.format(*(with_unit(v[first], units, 6) for v in (demand, bound)))
            level = history["level"][first]
            return name, f"{name}: no equilibrium at level {level:.6g} m: {reason}"
    return "", ""
