"""The equation of the joints in a step, at rest or in motion; unknowns: the jumps d.

    R(d) = S d + N^T W (t(d) + k (d - d_0) + l(d)) - f - p(d) = 0

S: stiffness of what is around the joints; N: interpolation of the jump at the Gauss points, W:
their weights; t: tractions of the laws; k, d_0: dashpots, in a time step springs from where they
are at rest; f: loads; p: forces of the water that flows in the joints, which is solved at the same
jump, so that its derivative is part of the tangent; l: what the water loses in a crack that a
pseudo-static earthquake opens. The equilibrium at rest has no dashpots, a time step has no loads
that follow the level, and water that follows the jumps with quake_uplift = transient only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.linalg import norm

from .. import ROUND_OFF
from ..arrays import Array, BoolArray
from ..csr import CsrMatrix
from ..model.loads import LEVEL, Loading, Unknown
from .interface import Interface
from .joint_laws import JointLaws, JointVariables
from .linear_system import LinearSystem, Tangent
from .step_water import StepWater

#: Step of the difference with the level, over the size of the dam or the level if that is larger:
#: larger ones lose digits where the loads bend, smaller ones by cancellation.
DIFFERENCE = 1e-5
#: Level over the size of the dam below which the reservoir counts as empty.
EMPTY = 1e-3
#: Level over the size of the dam at which the derivative of an empty reservoir is taken.
SMALL_LEVEL = 0.1


@dataclass(frozen=True)
class Dashpots:
    """Dashpots in a time step: stiffness (q, 3) [Pa/m], c of a point times the rate of the velocity
    with the jump at the end of the step, and the jump (q, 3) at which that velocity is zero.
    """

    stiffness: Array
    resting: Array

    def traction(self, jump: Array) -> Array:
        """The traction (q, 3) at a jump."""
        return self.stiffness * (jump - self.resting)

    @property
    def tangent(self) -> Array:
        """Its derivative (q, 3, 3)."""
        return self.stiffness[:, :, None] * np.eye(3)


@dataclass(frozen=True)
class Residual:
    """The forces out of balance at a jump and a level (j,), and their derivatives."""

    value: Array
    #: with the jump, by the law's tangent or by its secant (True)
    by_jump: Callable[[bool], Tangent]
    #: with the level, or with what else is unknown (j,)
    by_unknown: Callable[[Unknown], Array]


@dataclass(frozen=True, kw_only=True)
class JointProblem:
    """The joints in a step and what is around them, see above."""

    interface: Interface
    #: S (j, j), and what solves the linear systems of S and a tangent
    stiffness: Array | CsrMatrix
    system: LinearSystem
    #: of the Gauss points; their internal variables are those of the step's beginning
    laws: JointLaws
    variables: JointVariables
    #: forces (j,) that follow the level, and the size of the dam [m]; None: no loads do
    loads: Callable[[Loading], Array] | None = None
    size: float = 0.0
    #: forces (j,) that are constant in the step
    constant: Array | None = None
    #: that follows the jumps
    water: StepWater | None = None
    dashpots: Dashpots | None = None

    def with_constant_lift(self, lift: Array) -> JointProblem:
        """The same with constant forces of the flowing water (j,) in place of those that follow the
        jumps.
        """
        return replace(self, constant=lift, water=self.water and replace(self.water, flowing=()))

    def jumps(self, jump: Array) -> Array:
        """The jump (q, 3) at the Gauss points."""
        return self.interface.jumps(self.interface.at_points, jump)

    def traction(self, jump: Array) -> Array:
        """Tractions (q, 3) of laws and dashpots at a jump (j,)."""
        at_points = self.jumps(jump)
        traction, _ = self.laws.evaluate(at_points, self.variables)
        return traction + self.dashpots.traction(at_points) if self.dashpots else traction

    def residual(
        self,
        jump: Array,
        loading: Loading,
        releasing: BoolArray | None = None,
        most: float = np.inf,
    ) -> Residual:
        """The residual at a jump (j,) and its derivatives; releasing: see `JointLaws.evaluate`;
        most: if its norm exceeds this even without the flowing water, it is without that.
        """
        interface, water, at_points = self.interface, self.water, self.jumps(jump)
        traction, tangent = self.laws.evaluate(at_points, self.variables, releasing)
        beside = list[Array]()  # stiffnesses beside that of the laws
        if self.dashpots:
            traction = traction + self.dashpots.traction(at_points)
            beside.append(self.dashpots.tangent)
        loses = water is not None and water.loses_pressure
        if water and loses:
            lost, lost_rate = water.lost_pressure(at_points, loading)
            traction = traction + lost
            beside.append(lost_rate)
        value = self.stiffness @ jump
        if self.loads:
            value = value - self.loads(loading)
        value = value + interface.forces(traction)
        flow = None
        if water and water.flowing and not self.exceeds(value, water, most):
            flow = water.flow(jump, loading)
            value = value - flow.lift
        if self.constant is not None:
            value = value - self.constant

        def by_jump(secant: bool) -> Tangent:
            law = self.laws.secant_stiffness(at_points, self.variables) if secant else tangent()
            law = sum(beside, law)
            return flow.tangent(law) if flow else Tangent(law)

        def by_unknown(unknown: Unknown) -> Array:
            slope = np.zeros(len(jump))
            if self.loads:
                slope = -rate(self.loads, loading, self.size, unknown)
            if water and flow:
                further, step = ahead(loading, self.size, unknown)
                slope = slope - (water.flow(jump, further).lift - flow.lift) / step
            if water and loses:
                lost = lambda other: interface.forces(water.lost_pressure(at_points, other)[0])
                slope = slope + rate(lost, loading, self.size, unknown)
            return slope

        return Residual(value, by_jump, by_unknown)

    def exceeds(self, value: Array, water: StepWater, most: float) -> bool:
        """Whether the norm of a residual (j,) without flowing water and constant forces exceeds the
        most where flowing water does not act.
        """
        beside = value[water.beside]
        if self.constant is not None:
            beside = beside - self.constant[water.beside]
        return float(norm(beside)) > (1 + ROUND_OFF) * most


def ahead(loading: Loading, size: float, unknown: Unknown) -> tuple[Loading, float]:
    """A loading with a larger value of what is unknown, and by how much, for the derivative of what
    is linear in it: pressures of laminar flow in the level.
    """
    step = DIFFERENCE * max(size, abs(loading.level)) if unknown == LEVEL else 1.0
    return unknown.at(loading, unknown.of(loading) + step), step


def rate(
    of: Callable[[Loading], Array], loading: Loading, size: float, unknown: Unknown = LEVEL
) -> Array:
    """The derivative with what is unknown in the loading; size: of the dam [m].

    A load is linear in its factor. A function is nearly linear in the level; its derivative is zero
    for an empty reservoir, and displacement control could not start: there it is taken at a small
    level.
    """
    further, step = ahead(loading, size, unknown)
    if unknown != LEVEL:
        return of(further) - of(loading)
    level = loading.level if abs(loading.level) > EMPTY * size else SMALL_LEVEL * size
    above, below = (unknown.at(loading, level + s) for s in (step, -step))
    return (of(above) - of(below)) / (2 * step)
