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
from .base import Law


@dataclass(frozen=True)
class BondVariables:
    """Internal variables at q points."""

    #: (q,), 0 to 1
    damage: Array
    #: (q, 2) [m]
    plastic: Array


class Trial(NamedTuple):
    """The elastic predictor and what it leads to (q,)."""

    #: size of the elastic shear stress [Pa], its direction (q, 2), slip of the step, new damage
    size: Array
    direction: Array
    slip: Array
    damage: Array
    #: whether the damage is the opening's, and whether the slip has used up the cohesion
    by_opening: BoolArray
    broken: BoolArray


class Bond(Law[BondVariables]):
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
        self.damage_per_slip = self.cohesion / (2 * p["G_t"])
        #: stiffness in slip: cohesion is lost while the point slips
        self.K_slip = self.K_T - self.cohesion * self.damage_per_slip

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

    def update_internal_variables(self, jump: Array, variables: BondVariables) -> BondVariables:
        """See `Law`."""
        trial = self.trial(jump, variables)
        plastic = variables.plastic + trial.slip[:, None] * trial.direction
        return BondVariables(trial.damage, plastic)

    # -- response

    def damage_by_opening(self, opening: Array, damage: Array) -> Array:
        """The damage after an opening (q,) [m]."""
        share = (opening - self.delta_e) / (self.delta_c - self.delta_e)
        return np.maximum(damage, np.clip(share, 0, 1))

    def trial(self, jump: Array, variables: BondVariables) -> Trial:
        """The elastic predictor, and slip and damage that return it to the yield surface; the new
        damage is the larger of the opening's and the slip's, D + slip/lambda_c.
        """
        before, per_slip = variables.damage, self.damage_per_slip
        shear = self.K_T * (jump[:, 1:] - variables.plastic)
        size = np.linalg.norm(shear, axis=1)
        excess = size + self.mu * self.K_N * np.minimum(jump[:, 0], 0)
        opened = self.damage_by_opening(jump[:, 0], before)
        beyond = excess - self.cohesion * (1 - opened)
        if_opening = np.where(beyond > self.yield_tolerance * size, beyond / self.K_T, 0)
        if_slip = (excess - self.cohesion * (1 - before)) / self.K_slip
        by_opening = before + per_slip * if_opening <= opened
        broken = ~by_opening & (before + per_slip * if_slip >= 1)
        slip = np.where(by_opening, if_opening, np.where(broken, excess / self.K_T, if_slip))
        by_slip = np.where(broken, 1.0, before + per_slip * if_slip)
        damage = np.where(by_opening, opened, by_slip)
        direction = shear / np.maximum(size, 1e-300)[:, None]
        return Trial(size, direction, slip, damage, by_opening, broken)

    def unloading(self, damage: Array) -> tuple[Array, Array]:
        """Slope of the line to the origin in tension, and its derivative with the damage (q,)."""
        if not self.tensile_strength:
            return np.zeros_like(damage), np.zeros_like(damage)
        kappa = self.delta_e + damage * (self.delta_c - self.delta_e)
        strength = self.tensile_strength
        return strength * (1 - damage) / kappa, -strength * self.delta_c / kappa**2

    def traction_and_tangent(self, jump: Array, variables: BondVariables) -> tuple[Array, Array]:
        """See `Law`; the tangent is not symmetric."""
        size, n, slip, damage, by_opening, gone = self.trial(jump, variables)
        opening, slides = jump[:, 0], slip > 0
        closed = opening <= 0
        slope, d_slope = self.unloading(damage)
        normal = np.where(closed, self.K_N, slope) * opening
        traction = np.column_stack([normal, (size - self.K_T * slip)[:, None] * n])

        growing = by_opening & (damage > variables.damage) & (damage < 1)
        d_opened = np.where(growing, 1 / (self.delta_c - self.delta_e), 0)
        softens = ~(by_opening | gone)  # the slip does the damage
        stiffness = np.where(softens, self.K_slip, self.K_T)
        with_size = self.K_T / stiffness * slides
        pressing = self.mu * self.K_N * (opening < 0)
        with_opening = (pressing + self.cohesion * d_opened) / stiffness * slides
        per_slip = self.damage_per_slip * softens
        d_damage = d_opened + per_slip * with_opening
        broken = (damage >= 1) | (self.tensile_strength == 0)

        tangent = np.zeros((len(jump), 3, 3))
        open_slope = slope + opening * d_slope * d_damage
        weak = np.where(broken, self.artificial * self.K_N, open_slope)
        tangent[:, 0, 0] = np.where(closed, self.K_N, weak)
        by_slip = opening * d_slope * per_slip * with_size
        tangent[:, 0, 1:] = np.where(closed | broken, 0, by_slip)[:, None] * n
        tangent[:, 1:, 0] = (-self.K_T * with_opening)[:, None] * n
        across = 1 - self.K_T * slip / np.maximum(size, 1e-300)
        outer, eye = n[:, :, None] * n[:, None, :], np.eye(2)
        tangent[:, 1:, 1:] = self.K_T * (
            across[:, None, None] * (eye - outer)
            + (1 - with_size)[:, None, None] * outer
            + self.artificial * eye
        )
        return traction, tangent

    def secant_stiffness(self, jump: Array, variables: BondVariables) -> Array:
        """See `Law`."""
        size, _, slip, damage, *_ = self.trial(jump, variables)
        weak, slope = self.artificial * self.K_N, self.unloading(damage)[0]
        share = 1 - self.K_T * slip / np.maximum(size, 1e-300)
        matrix = np.zeros((len(jump), 3, 3))
        matrix[:, 0, 0] = np.where(jump[:, 0] <= 0, self.K_N, np.maximum(slope, weak))
        matrix[:, 1, 1] = matrix[:, 2, 2] = self.K_T * np.maximum(share, self.artificial)
        return matrix

    def freeze(self, jump: Array, variables: BondVariables) -> FrozenBond:
        """See `Law`."""
        return FrozenBond(self, self.damage_by_opening(jump[:, 0], variables.damage))

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


class FrozenBond(Bond):
    """The law with frozen damage: a point that slips does not soften."""

    def __init__(self, law: Bond, frozen: Array) -> None:
        vars(self).update(vars(law))
        self.law, self.frozen, self.damage_per_slip, self.K_slip = law, frozen, 0.0, law.K_T

    def damage_by_opening(self, opening: Array, damage: Array) -> Array:
        """See `Bond`."""
        return self.frozen

    def update_internal_variables(self, jump: Array, variables: BondVariables) -> BondVariables:
        """See `Law`: the damage that opening and slip of the step do is known after it."""
        trial = self.trial(jump, variables)
        by_slip = np.minimum(variables.damage + self.law.damage_per_slip * trial.slip, 1)
        damage = np.maximum(self.law.damage_by_opening(jump[:, 0], variables.damage), by_slip)
        plastic = variables.plastic + trial.slip[:, None] * trial.direction
        return BondVariables(damage, plastic)
