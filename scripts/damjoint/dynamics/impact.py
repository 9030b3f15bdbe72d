"""Impacts: what is above a joint leaves it or lands on it within a time step.

A step changes kinetic and elastic energy by the mean of its forces at both ends times the
displacement (Newmark's average acceleration). At a Gauss point with c = min(delta_n, 0) this takes
w K_N (c0 + c1)/2 (d1 - d0) from the bodies, where the contact stores w K_N (c1^2 - c0^2)/2: equal
while the point is closed, but a point that opens adds -w K_N c0 d1/2, and one that closes loses
-w K_N c1 d0/2. A mass may leave a contact that a step does not resolve with three times its
velocity. The shares are small if the step is a tenth of the contact's period or less.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import Array, IntArray
from ..input.case import Case
from ..joint.interface import JointInterface
from .step import Moving, Problem

#: Energy that the contact may add or lose in a step, over that of the impact [-].
MOST_CHANGE = 0.02

#: Height over the size of the dam from which a fall counts as an impact [-]: 0.01 mm of 45 m.
LEAST_FALL = 2.2e-7


@dataclass(frozen=True, kw_only=True)
class Contact:
    """A joint that parts what is above it from the rest."""

    joint: JointInterface
    #: its unknowns among those of the steps (j,)
    jumps: IntArray
    #: K_N [Pa/m]
    stiffness: float
    #: above the joint [kg], and the energy of its least fall [J]
    mass: float
    least: float

    @staticmethod
    def of(problem: Problem, case: Case, number: int) -> Contact | None:
        """The contact of a joint, by its number; None if other joints hold what is above it."""
        joint = problem.model.equilibrium.interface.joints[number]
        above = case.graph.separated([number])
        if not above:
            return None
        across = problem.system.translation(joint, above, joint.chord.normal)
        mass = float(across @ problem.system.mass @ across)
        return Contact(
            joint=joint,
            jumps=np.searchsorted(problem.retained, problem.system.jumps),
            stiffness=case.joints[number]["K_N"],
            mass=mass,
            least=mass * case["g"] * LEAST_FALL * case.size,
        )

    @property
    def period(self) -> float:
        """Period of the mass on the closed joint [s]."""
        return 2 * math.pi * math.sqrt(self.mass / self.stiffness / self.joint.points.weights.sum())

    def normal(self, jump: Array) -> Array:
        """Normal component (q,) at the Gauss points of a jump or its velocity (j,)."""
        return self.joint.jumps(self.joint.at_points, jump)[:, 0]

    def resolved(self, begin: Moving, end: Moving) -> bool:
        """Whether the contact changes the energy of an impact in a step by MOST_CHANGE or less;
        also where what is above the joint neither leaves it nor lands on it as a whole.
        """
        before, after = self.normal(begin.state.jump), self.normal(end.state.jump)
        if (before > 0).all() == (after > 0).all():
            return True
        closed, closes = np.minimum(before, 0), np.minimum(after, 0)
        work = (closed + closes) * (after - before) - (closes**2 - closed**2)
        weights = self.joint.points.weights
        change = self.stiffness / 2 * abs(weights @ work)
        speeds = [
            weights @ self.normal(moving.retained.velocity[self.jumps]) ** 2 / weights.sum()
            for moving in (begin, end)
        ]
        return bool(change <= MOST_CHANGE * (self.mass / 2 * min(speeds) + self.least))
