"""Cohesive law of mixed mode: one equivalent jump softens tension and shear together, no friction.

With the exponential curve of softening.py and K_T = K_N it is CZM_EXP_REG [R7.02.11]. Internal
variable: kappa, the largest equivalent jump so far [m], at least delta_e.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Array, BoolArray
from .base import Response, SofteningLaw
from .softening import CURVES


@dataclass(frozen=True)
class MixedVariables:
    """Internal variable at q points."""

    #: (q,) [m]
    kappa: Array


class Mixed(SofteningLaw[MixedVariables]):
    """sigma_n' = r delta_n, tau = r (K_T/K_N) delta_t, r(kappa) the curve's secant; contact."""

    variable_names = ("kappa",)
    softens = True
    has_friction = False

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        p = parameters
        self.curve = CURVES[p["softening"]]
        self.broken_damage = float(self.curve.damage(np.float64(1)))
        self.K_N, self.K_T, self.K_contact = p["K_N"], p["K_T"], p["pena_contact"] * p["K_N"]
        self.ratio, self.artificial = self.K_T / self.K_N, p["artificial"]
        self.ratios = np.array([1, self.ratio, self.ratio])
        self.tensile_strength = p["sigma_max"]
        self.delta_e = self.tensile_strength / self.K_N
        #: where linear softening ends; without strength there is none
        self.L_C = 2 * p["G_f"] / self.tensile_strength if self.tensile_strength else 0.0

    # -- internal variable

    def initial(self, points: int) -> MixedVariables:
        """See `Law`."""
        return MixedVariables(np.full(points, self.delta_e))

    def update_internal_variables(
        self, jump: Array, variables: MixedVariables, frozen: Array | None = None
    ) -> MixedVariables:
        """See `Law`; what a step does to frozen damage is known after it."""
        return MixedVariables(self.frozen_damage(jump, variables))

    def frozen_damage(self, jump: Array, variables: MixedVariables) -> Array:
        """See `SofteningLaw`: kappa."""
        return np.maximum(variables.kappa, self.equivalent(jump))

    # -- response

    def equivalent(self, jump: Array) -> Array:
        """The equivalent jump sqrt(<delta_n>^2 + (K_T/K_N) |delta_t|^2) (q,) [m]."""
        opening, *slip = jump.T
        shear = self.ratio * (slip[0] ** 2 + slip[1] ** 2)
        return np.asarray(np.sqrt(np.maximum(opening, 0) ** 2 + shear))

    def progress(self, kappa: Array) -> Array:
        """Progress of the softening at the largest equivalent jump (q,) [-]."""
        if not self.tensile_strength:
            return np.full(len(kappa), self.curve.end)
        share = (kappa - self.delta_e) / (self.L_C - self.delta_e)
        return np.minimum(share, self.curve.end)

    def secant(self, kappa: Array) -> tuple[Array, Array]:
        """r [Pa/m] and its derivative with kappa (q,)."""
        if not self.tensile_strength:
            return np.zeros(len(kappa)), np.zeros(len(kappa))
        progress, ends = self.progress(kappa), (self.delta_e, self.L_C)
        stiffness, rate = self.curve.unloading(progress, self.tensile_strength, *ends)
        ended = progress >= self.curve.end
        rate = rate / (self.L_C - self.delta_e)
        return np.where(ended, 0, stiffness), np.where(ended, 0, rate)

    def response(
        self, jump: Array, variables: MixedVariables, frozen: Array | None = None
    ) -> Response:
        """See `Law`; the tangent is symmetric."""
        kappa = self.frozen_damage(jump, variables) if frozen is None else frozen
        stiffness, rate = self.secant(kappa)
        opening = jump[:, 0]
        traction = stiffness[:, None] * (jump * self.ratios)
        traction[:, 0] = np.where(opening <= 0, self.K_contact, stiffness) * opening

        def tangent_of() -> Array:
            tangent = self.stiffness(jump, stiffness)
            if frozen is None:
                direction = jump * self.ratios
                np.maximum(opening, 0, out=direction[:, 0])
                growth = np.where(kappa > variables.kappa, rate / np.maximum(kappa, 1e-300), 0)
                tangent += (growth[:, None] * direction)[:, :, None] * direction[:, None, :]
            return tangent

        return traction, tangent_of

    def stiffness(self, jump: Array, secant: Array) -> Array:
        """The diagonal stiffness (q, 3, 3) at a constant kappa, at least the artificial one."""
        matrix = np.zeros((len(jump), 3, 3))
        stiffness = np.maximum(secant, self.artificial * self.K_N)
        matrix[:, 0, 0] = np.where(jump[:, 0] <= 0, self.K_contact, stiffness)
        matrix[:, 1, 1] = matrix[:, 2, 2] = self.ratio * stiffness
        return matrix

    def secant_stiffness(
        self, jump: Array, variables: MixedVariables, frozen: Array | None = None
    ) -> Array:
        """See `Law`."""
        kappa = self.frozen_damage(jump, variables) if frozen is None else frozen
        return self.stiffness(jump, self.secant(kappa)[0])

    # -- meaning

    def damage(self, jump: Array, variables: MixedVariables) -> Array:
        """See `Law`."""
        return self.curve.damage(self.progress(variables.kappa))

    def is_open(self, jump: Array, variables: MixedVariables) -> BoolArray:
        """See `Law`: open, and broken."""
        return (jump[:, 0] > 0) & (variables.kappa >= self.L_C)

    def cohesion_left(self, jump: Array, variables: MixedVariables) -> Array:
        """See `Law`."""
        return 1 - self.damage(jump, variables)

    def opening_of_crack(self, variables: MixedVariables, points: int) -> Array:
        """See `Law`."""
        return np.where(variables.kappa >= self.L_C, 0.0, self.L_C)

    # -- strength

    def shear_strength(self, sigma_n: Array, damage: Array | float, slip: Array | float) -> Array:
        """See `Law`: sqrt(K_T/K_N) times what f_t (1 - D) leaves beside the tension."""
        strength = self.tensile_strength * (1 - damage)
        beside = np.maximum(strength**2 - np.maximum(sigma_n, 0) ** 2, 0)
        return np.sqrt(self.ratio * beside)

    def tension_left(self, damage: Array) -> Array:
        """See `Law`: f_t (1 - D)."""
        return self.tensile_strength * (1 - damage)

    shear_strength_formula = "sqrt(K_T/K_N (f_t^2 (1 - D)^2 - <sigma'>^2))"

    def shear_bound(self, normal: Array, length: float) -> Array:
        """See `Law`."""
        return np.full(np.shape(normal), np.sqrt(self.ratio) * self.tensile_strength * length)
