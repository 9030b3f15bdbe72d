"""Coupled cohesive-frictional law, after Alfano and Sacco (Int. J. Numer. Meth. Eng. 68, 2006).

Tension and cohesion soften together with one damage D, the larger of what the opening and what the
slip has done; friction acts on the pressed joint from the beginning. Internal variables: D and the
plastic slip.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..arrays import Array, BoolArray
from .base import SofteningLaw


@dataclass(frozen=True)
class BondVariables:
    """Internal variables at q points."""

    #: (q,), 0 to 1
    damage: Array
    #: (q, 2) [m]
    plastic: Array


class SlipAndDamage(NamedTuple):
    """Elastic trial, and what the step does to the bond (q,)."""

    #: size of the elastic shear stress [Pa] and its direction (q, 2)
    size: Array
    direction: Array
    #: slip of the step [m], damage after it
    slip: Array
    damage: Array
    #: whether the damage is that by the opening; whether the slip has used up the cohesion
    opening_governs: BoolArray
    broken_by_slip: BoolArray


class Bond(SofteningLaw[BondVariables]):
    """Strengths in tension and in shear that soften together, then friction."""

    variable_names = ("D", "slip_1", "slip_2")
    softens = stands_slipped = True

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        p = parameters
        self.K_N, self.K_T = p["K_N"], p["K_T"]
        self.artificial, self.yield_tolerance = p["artificial"], p["yield_tolerance"]
        self.tensile_strength, self.cohesion, self.mu = p["sigma_max"], p["adhesion"], p["mu"]
        self.delta_e = self.tensile_strength / self.K_N
        self.delta_c = 2 * p["G_f"] / (self.tensile_strength or self.cohesion or 1.0)
        #: 1/lambda_c
        self.damage_per_slip = self.cohesion / (2 * p["G_t"])
        #: stiffness in slip: cohesion is lost while the point slips
        self.K_soft = self.K_T - self.cohesion * self.damage_per_slip

    @classmethod
    def least_energies(cls, parameters: Mapping[str, Any]) -> dict[str, tuple[float, str]]:
        """See `Law`."""
        p = parameters
        return {
            "G_f": (p["sigma_max"] * p["sigma_max"] / (2 * p["K_N"]), "sigma_max^2/(2 K_N)"),
            "G_t": (p["adhesion"] * p["adhesion"] / (2 * p["K_T"]), "adhesion^2/(2 K_T)"),
        }

    # -- internal variables

    def initial(self, points: int) -> BondVariables:
        """See `Law`."""
        return BondVariables(np.zeros(points), np.zeros((points, 2)))

    def update_internal_variables(
        self, jump: Array, variables: BondVariables, frozen: Array | None = None
    ) -> BondVariables:
        """See `Law`; the damage that opening and slip do to a frozen bond is known after them."""
        step = self.slip_and_damage(jump, variables, frozen)
        damage = step.damage
        if frozen is not None:
            by_slip = np.minimum(variables.damage + self.damage_per_slip * step.slip, 1)
            damage = np.maximum(self.damage_by_opening(jump[:, 0], variables.damage), by_slip)
        return BondVariables(damage, variables.plastic + step.slip[:, None] * step.direction)

    def frozen_damage(self, jump: Array, variables: BondVariables) -> Array:
        """See `SofteningLaw`: that by the opening."""
        return self.damage_by_opening(jump[:, 0], variables.damage)

    # -- slip and damage of a step, as in pro/law_bond.pro

    def damage_by_opening(self, opening: Array, damage: Array) -> Array:
        """The damage after an opening (q,) [m]."""
        share = (opening - self.delta_e) / (self.delta_c - self.delta_e)
        return np.maximum(damage, np.clip(share, 0, 1))

    def slip_opening(self, excess: Array, size: Array, opened: Array) -> Array:
        """The slip (q,) [m] if the damage by opening governs."""
        beyond_yield = excess - self.cohesion * (1 - opened)
        return np.where(beyond_yield > self.yield_tolerance * size, beyond_yield / self.K_T, 0)

    def slip_and_damage(
        self, jump: Array, variables: BondVariables, frozen: Array | None = None
    ) -> SlipAndDamage:
        """Slip and damage that return the elastic trial to the yield surface; the damage is the
        larger of the opening's and the slip's, D + slip/lambda_c; frozen: see `SofteningLaw`.
        """
        before, K_soft, per_slip = variables.damage, self.K_soft, self.damage_per_slip
        if frozen is not None:
            K_soft, per_slip = self.K_T, 0.0
        shear = self.K_T * (jump[:, 1:] - variables.plastic)
        size = np.linalg.norm(shear, axis=1)
        excess = size + self.mu * self.K_N * np.minimum(jump[:, 0], 0)  # over friction
        opened = self.damage_by_opening(jump[:, 0], before) if frozen is None else frozen
        slip_opening = self.slip_opening(excess, size, opened)
        slip_softening = (excess - self.cohesion * (1 - before)) / K_soft
        softened = before + per_slip * slip_softening
        opening_governs = before + per_slip * slip_opening <= opened
        broken_by_slip = ~opening_governs & (softened >= 1)
        by_slip = np.where(broken_by_slip, excess / self.K_T, slip_softening)
        return SlipAndDamage(
            size=size,
            direction=shear / np.maximum(size, 1e-300)[:, None],
            slip=np.where(opening_governs, slip_opening, by_slip),
            damage=np.where(opening_governs, opened, np.where(broken_by_slip, 1.0, softened)),
            opening_governs=opening_governs,
            broken_by_slip=broken_by_slip,
        )

    # -- response

    def unloading_stiffness(self, damage: Array) -> tuple[Array, Array]:
        """Slope of the line to the origin in tension, and its derivative with the damage (q,)."""
        if not self.tensile_strength:
            return np.zeros_like(damage), np.zeros_like(damage)
        kappa = self.delta_e + damage * (self.delta_c - self.delta_e)
        strength = self.tensile_strength
        return strength * (1 - damage) / kappa, -strength * self.delta_c / kappa**2

    def remaining(self, step: SlipAndDamage) -> Array:
        """What the slip leaves of the elastic shear stress (q,), 1 to 0."""
        return 1 - self.K_T * step.slip / np.maximum(step.size, 1e-300)

    def slip_rates(
        self, opening: Array, before: Array, step: SlipAndDamage, per_slip: float, K_soft: float
    ) -> tuple[Array, Array, Array, Array]:
        """Derivatives of the slip with the norm of the elastic jump and with the opening, of the
        damage with the slip and with the opening (q,); per_slip, K_soft: see `slip_and_damage`.
        """
        growing = step.opening_governs & (step.damage > before) & (step.damage < 1)
        opened_rate = np.where(growing, 1 / (self.delta_c - self.delta_e), 0)
        softens = ~(step.opening_governs | step.broken_by_slip)  # the slip does the damage
        stiffness, slides = np.where(softens, K_soft, self.K_T), step.slip > 0
        by_norm = self.K_T / stiffness * slides
        friction_rate = self.mu * self.K_N * (opening < 0)
        by_opening = (friction_rate + self.cohesion * opened_rate) / stiffness * slides
        damaging = np.asarray(per_slip * softens, float)
        return by_norm, by_opening, damaging, opened_rate + damaging * by_opening

    def traction_and_tangent(
        self, jump: Array, variables: BondVariables, frozen: Array | None = None
    ) -> tuple[Array, Array]:
        """See `Law`; the tangent is not symmetric."""
        step, opening = self.slip_and_damage(jump, variables, frozen), jump[:, 0]
        soft = (self.damage_per_slip, self.K_soft) if frozen is None else (0.0, self.K_T)
        by_norm, by_opening, damage_by_slip, damage_by_opening = self.slip_rates(
            opening, variables.damage, step, *soft
        )
        unloading, unloading_rate = self.unloading_stiffness(step.damage)
        closed, n = opening <= 0, step.direction
        broken = (step.damage >= 1) | (self.tensile_strength == 0)
        normal = np.where(closed, self.K_N, unloading) * opening
        traction = np.column_stack([normal, (step.size - self.K_T * step.slip)[:, None] * n])

        tangent = np.zeros((len(jump), 3, 3))
        bonded = unloading + opening * unloading_rate * damage_by_opening
        open_stiffness = np.where(broken, self.artificial * self.K_N, bonded)
        tangent[:, 0, 0] = np.where(closed, self.K_N, open_stiffness)
        by_slip = opening * unloading_rate * damage_by_slip * by_norm
        tangent[:, 0, 1:] = np.where(closed | broken, 0, by_slip)[:, None] * n
        tangent[:, 1:, 0] = (-self.K_T * by_opening)[:, None] * n
        outer, eye = n[:, :, None] * n[:, None, :], np.eye(2)
        tangent[:, 1:, 1:] = self.K_T * (
            self.remaining(step)[:, None, None] * (eye - outer)
            + (1 - by_norm)[:, None, None] * outer
            + self.artificial * eye
        )
        return traction, tangent

    def secant_stiffness(
        self, jump: Array, variables: BondVariables, frozen: Array | None = None
    ) -> Array:
        """See `Law`."""
        step = self.slip_and_damage(jump, variables, frozen)
        weak, unloading = self.artificial * self.K_N, self.unloading_stiffness(step.damage)[0]
        matrix = np.zeros((len(jump), 3, 3))
        matrix[:, 0, 0] = np.where(jump[:, 0] <= 0, self.K_N, np.maximum(unloading, weak))
        shear = self.K_T * np.maximum(self.remaining(step), self.artificial)
        matrix[:, 1, 1] = matrix[:, 2, 2] = shear
        return matrix

    # -- meaning

    def damage(self, jump: Array, variables: BondVariables) -> Array:
        """See `Law`."""
        return variables.damage

    def is_open(self, jump: Array, variables: BondVariables) -> BoolArray:
        """See `Law`: open, and broken."""
        return (jump[:, 0] > 0) & ((variables.damage >= 1) | (self.tensile_strength == 0))

    def cohesion_left(self, jump: Array, variables: BondVariables) -> Array:
        """See `Law`."""
        return 1 - variables.damage

    def opening_of_crack(self, variables: BondVariables, points: int) -> Array:
        """See `Law`."""
        bonded = (variables.damage < 1) & (self.tensile_strength > 0)
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
