"""Coupled cohesive-frictional law, after Alfano and Sacco (Int. J. Numer. Meth. Eng. 68, 2006).

Tension and cohesion soften together with one damage D, the larger of what the opening and what the
slip has done; friction acts on the pressed joint from the beginning. D follows from the progress xi
of the softening by the curve of softening.py; linear: D = xi. Internal variables: xi and the
plastic slip.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..arrays import Array, BoolArray
from .base import Response, SofteningLaw
from .softening import CURVES


@dataclass(frozen=True)
class BondVariables:
    """Internal variables at q points."""

    #: (q,), 0 to the end of the curve
    progress: Array
    #: (q, 2) [m]
    plastic: Array


class SlipAndDamage(NamedTuple):
    """Elastic trial, and what the step does to the bond (q,)."""

    #: size of the elastic shear stress [Pa] and its direction (q, 2)
    size: Array
    direction: Array
    #: slip of the step [m], progress of the softening after it
    slip: Array
    progress: Array
    #: whether the damage is that by the opening; whether the slip has used up the cohesion
    opening_governs: BoolArray
    broken_by_slip: BoolArray


class Bond(SofteningLaw[BondVariables]):
    """Strengths in tension and in shear that soften together, then friction."""

    softens = stands_slipped = True

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        p = parameters
        self.curve = CURVES[p["softening"]]
        self.variable_names = ("D" if self.curve.name == "linear" else "xi", "slip_1", "slip_2")
        self.broken_damage = float(self.curve.damage(np.float64(1)))
        self.K_N, self.K_T = p["K_N"], p["K_T"]
        self.unloading_compliance = 0.0, 1 / self.K_T, 1 / self.K_T
        self.artificial, self.yield_tolerance = p["artificial"], p["yield_tolerance"]
        self.tensile_strength, self.cohesion, self.mu = p["sigma_max"], p["adhesion"], p["mu"]
        self.delta_e = self.tensile_strength / self.K_N
        self.delta_c = 2 * p["G_f"] / (self.tensile_strength or self.cohesion or 1.0)
        #: 1/lambda_c
        self.progress_per_slip = self.cohesion / (2 * p["G_t"])

    @classmethod
    def least_energies(cls, parameters: Mapping[str, Any]) -> dict[str, tuple[float, str]]:
        """See `Law`."""
        p, steepest = parameters, CURVES[parameters["softening"]].steepest
        shear = p["adhesion"] * p["adhesion"] / (2 * p["K_T"]) * steepest
        formula = "adhesion^2/(2 K_T)" if steepest == 1 else "adhesion^2/K_T"
        return {**super().least_energies(parameters), "G_t": (shear, formula)}

    # -- internal variables

    def initial(self, points: int) -> BondVariables:
        """See `Law`."""
        return BondVariables(np.zeros(points), np.zeros((points, 2)))

    def update_internal_variables(
        self, jump: Array, variables: BondVariables, frozen: Array | None = None
    ) -> BondVariables:
        """See `Law`; the damage that opening and slip do to a frozen bond is known after them."""
        step = self.slip_and_damage(jump, variables, frozen)
        progress = step.progress
        if frozen is not None:
            by_slip = variables.progress + self.progress_per_slip * step.slip
            by_slip = np.minimum(by_slip, self.curve.end)
            progress = np.maximum(self.progress_by_opening(jump[:, 0], variables.progress), by_slip)
        return BondVariables(progress, variables.plastic + step.slip[:, None] * step.direction)

    def frozen_damage(self, jump: Array, variables: BondVariables) -> Array:
        """See `SofteningLaw`: the progress by the opening."""
        return self.progress_by_opening(jump[:, 0], variables.progress)

    # -- slip and damage of a step, as in pro/law_bond.pro

    def progress_by_opening(self, opening: Array, progress: Array) -> Array:
        """The progress after an opening (q,) [m]."""
        share = (opening - self.delta_e) / (self.delta_c - self.delta_e)
        return np.maximum(progress, np.minimum(share, self.curve.end))

    def slip_opening(self, excess: Array, size: Array, opened: Array) -> Array:
        """The slip (q,) [m] if the damage by opening governs."""
        beyond_yield = excess - self.cohesion * self.curve.remaining(opened)
        return np.where(beyond_yield > self.yield_tolerance * size, beyond_yield / self.K_T, 0)

    def slip_and_damage(
        self, jump: Array, variables: BondVariables, frozen: Array | None = None
    ) -> SlipAndDamage:
        """Slip and damage that return the elastic trial to the yield surface; the progress is the
        larger of the opening's and the slip's, xi + slip/lambda_c; frozen: see `SofteningLaw`.
        """
        before, curve = variables.progress, self.curve
        per_slip = self.progress_per_slip if frozen is None else 0.0
        shear = self.K_T * (jump[:, 1:] - variables.plastic)
        size = np.hypot(shear[:, 0], shear[:, 1])
        excess = size + self.mu * self.K_N * np.minimum(jump[:, 0], 0)  # over friction
        opened = self.progress_by_opening(jump[:, 0], before) if frozen is None else frozen
        slip_opening = self.slip_opening(excess, size, opened)
        slip_softening = curve.slip(excess, self.K_T, self.cohesion, before, per_slip)
        softened = before + per_slip * slip_softening
        opening_governs = before + per_slip * slip_opening <= opened
        broken_by_slip = ~opening_governs & (softened >= curve.end)
        by_slip = np.where(broken_by_slip, excess / self.K_T, slip_softening)
        return SlipAndDamage(
            size=size,
            direction=shear / np.maximum(size, 1e-300)[:, None],
            slip=np.where(opening_governs, slip_opening, by_slip),
            progress=np.where(opening_governs, opened, np.minimum(softened, curve.end)),
            opening_governs=opening_governs,
            broken_by_slip=broken_by_slip,
        )

    # -- response

    def unloading_stiffness(self, progress: Array) -> tuple[Array, Array]:
        """Slope of the line to the origin in tension, and its derivative with the progress (q,)."""
        if not self.tensile_strength:
            return np.zeros_like(progress), np.zeros_like(progress)
        strength, begin, end = self.tensile_strength, self.delta_e, self.delta_c
        return self.curve.unloading(progress, strength, begin, end)

    def remaining(self, step: SlipAndDamage) -> Array:
        """What the slip leaves of the elastic shear stress (q,), 1 to 0."""
        return 1 - self.K_T * step.slip / np.maximum(step.size, 1e-300)

    def slip_rates(
        self, opening: Array, before: Array, step: SlipAndDamage, per_slip: float
    ) -> tuple[Array, Array, Array, Array]:
        """Derivatives of the slip with the norm of the elastic jump and with the opening, of the
        progress with the slip and with the opening (q,); per_slip: see `slip_and_damage`.
        """
        loss = self.cohesion * self.curve.rate(step.progress)  # of cohesion with the progress
        K_soft = self.K_T - loss * per_slip
        growing = step.opening_governs & (step.progress > before) & (step.progress < self.curve.end)
        opened_rate = growing * (1 / (self.delta_c - self.delta_e))
        softens = ~(step.opening_governs | step.broken_by_slip)  # the slip does the damage
        compliance = (step.slip > 0) / np.where(softens, K_soft, self.K_T)
        by_norm = self.K_T * compliance
        friction_rate = self.mu * self.K_N * (opening < 0)
        by_opening = (friction_rate + loss * opened_rate) * compliance
        damaging = np.asarray(per_slip * softens, float)
        return by_norm, by_opening, damaging, opened_rate + damaging * by_opening

    def response(
        self, jump: Array, variables: BondVariables, frozen: Array | None = None
    ) -> Response:
        """See `Law`; the tangent is not symmetric."""
        step, opening = self.slip_and_damage(jump, variables, frozen), jump[:, 0]
        unloading, unloading_rate = self.unloading_stiffness(step.progress)
        closed, n = opening <= 0, step.direction
        traction = np.empty((len(jump), 3))
        traction[:, 0] = np.where(closed, self.K_N, unloading) * opening
        traction[:, 1:] = (step.size - self.K_T * step.slip)[:, None] * n

        def tangent_of() -> Array:
            per_slip = self.progress_per_slip if frozen is None else 0.0
            by_norm, by_opening, progress_by_slip, progress_by_opening = self.slip_rates(
                opening, variables.progress, step, per_slip
            )
            broken = (step.progress >= self.curve.end) | (self.tensile_strength == 0)
            tangent = np.empty((len(jump), 3, 3))
            loss = opening * unloading_rate
            bonded = unloading + loss * progress_by_opening
            open_stiffness = np.where(broken, self.artificial * self.K_N, bonded)
            tangent[:, 0, 0] = np.where(closed, self.K_N, open_stiffness)
            by_slip = np.where(closed | broken, 0, loss * progress_by_slip * by_norm)
            tangent[:, 0, 1:] = by_slip[:, None] * n
            tangent[:, 1:, 0] = (-self.K_T * by_opening)[:, None] * n
            remaining = self.remaining(step)  # across n, and 1 - by_norm along it
            along = (self.K_T * (1 - by_norm - remaining))[:, None] * n
            tangent[:, 1:, 1:] = along[:, :, None] * n[:, None, :]
            across = self.K_T * (remaining + self.artificial)
            tangent[:, 1, 1] += across
            tangent[:, 2, 2] += across
            return tangent

        return traction, tangent_of

    def secant_stiffness(
        self, jump: Array, variables: BondVariables, frozen: Array | None = None
    ) -> Array:
        """See `Law`."""
        step = self.slip_and_damage(jump, variables, frozen)
        weak, unloading = self.artificial * self.K_N, self.unloading_stiffness(step.progress)[0]
        matrix = np.zeros((len(jump), 3, 3))
        matrix[:, 0, 0] = np.where(jump[:, 0] <= 0, self.K_N, np.maximum(unloading, weak))
        shear = self.K_T * np.maximum(self.remaining(step), self.artificial)
        matrix[:, 1, 1] = matrix[:, 2, 2] = shear
        return matrix

    # -- meaning

    def damage(self, jump: Array, variables: BondVariables) -> Array:
        """See `Law`."""
        return self.curve.damage(variables.progress)

    def is_open(self, jump: Array, variables: BondVariables) -> BoolArray:
        """See `Law`: open, and broken."""
        return (jump[:, 0] > 0) & ((variables.progress >= 1) | (self.tensile_strength == 0))

    def cohesion_left(self, jump: Array, variables: BondVariables) -> Array:
        """See `Law`."""
        return self.curve.remaining(variables.progress)

    def opening_of_crack(self, variables: BondVariables, points: int) -> Array:
        """See `Law`."""
        bonded = (variables.progress < 1) & (self.tensile_strength > 0)
        return np.where(bonded, self.delta_c, 0.0)

    def slip(self, variables: BondVariables, points: int) -> Array:
        """See `Law`: the plastic slip."""
        return np.linalg.norm(variables.plastic, axis=1)

    # -- strength

    def shear_strength(self, sigma_n: Array, damage: Array | float, slip: Array | float) -> Array:
        """See `Law`: c (1 - D) + mu |sigma_n| where it is pressed."""
        return self.cohesion * (1 - damage) - self.mu * np.minimum(sigma_n, 0)

    def tension_left(self, damage: Array) -> Array:
        """See `Law`: f_t (1 - D)."""
        return self.tensile_strength * (1 - damage)

    shear_strength_formula = "c (1 - D) + mu |sigma'|"

    def shear_bound(self, normal: Array, length: float) -> Array:
        """See `Law`: tension elsewhere adds at most the strength times the length to N."""
        pressed = np.maximum(normal + self.tensile_strength * length, 0)
        return self.mu * pressed + self.cohesion * length
