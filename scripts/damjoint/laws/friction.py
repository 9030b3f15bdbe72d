"""Mohr-Coulomb friction with hardening (JOINT_MECA_FROT, code_aster R7.01.25), implicit return.

Internal variables: lambda, the accumulated plastic slip [m], the plastic slip, and the opening
before sawing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ..arrays import Array, BoolArray
from ..units import STRESSES, with_unit
from .base import Evidence, Law, Response

#: Parameters of a joint that stays elastic under any load.
UNBREAKABLE: dict[str, float | str] = {
    "law": "friction",
    "mu": 1.0,
    "adhesion": 1e30,
    "pena_tang": 0.0,
}


@dataclass(frozen=True)
class FrictionVariables:
    """Internal variables at q points."""

    #: (q,) [m]
    accumulated: Array
    #: (q, 2) [m]
    plastic: Array
    #: (q,) [m], and the thickness of the saw in the step under way
    gap: Array
    sawn: float = 0.0


class Trial(NamedTuple):
    """The elastic predictor and what it leads to (q,)."""

    #: normal stress, size of the elastic shear stress [Pa], its direction (q, 2), slip of the step
    normal: Array
    size: Array
    direction: Array
    slip: Array
    #: whether the point is open
    open: BoolArray


class Friction(Law[FrictionVariables]):
    """Contact that transmits tension up to c/mu, and shear up to c - mu sigma_n + H lambda."""

    variable_names = ("lambda", "slip_1", "slip_2", "gap")
    columns: Mapping[str, tuple[str, str]] = {
        "lambda": ("m", "friction: cumulated plastic slip, which hardens")
    }
    path_dependent = False
    hardening_parameter = "pena_tang"
    works = ("saw_thickness",)

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        p = parameters
        self.K_N, self.K_T, self.H = p["K_N"], p["K_T"], p["pena_tang"]
        self.unloading_compliance = 0.0, 1 / self.K_T, 1 / self.K_T
        self.mu, self.adhesion = p["mu"], p["adhesion"]
        self.artificial, self.yield_tolerance = p["artificial"], p["yield_tolerance"]
        self.hardens = bool(self.H)
        self.tensile_strength = self.open_tension = self.adhesion / self.mu
        self.cap_opening = self.adhesion / (self.mu * self.K_N)
        self.saw, self.saw_t = p["saw_thickness"], p["saw_t"]

    # -- internal variables

    def initial(self, points: int) -> FrictionVariables:
        """See `Law`."""
        return FrictionVariables(np.zeros(points), np.zeros((points, 2)), np.zeros(points))

    def begin_step(
        self, variables: FrictionVariables, begin: float, end: float
    ) -> FrictionVariables:
        """See `Law`; sawn_at of pro/law.pro."""
        if not self.saw:
            return variables
        return replace(variables, sawn=self.saw * min(max(end - self.saw_t + 1, 0), 1))

    def update_internal_variables(
        self, jump: Array, variables: FrictionVariables
    ) -> FrictionVariables:
        """See `Law`."""
        trial = self.trial(jump, variables)
        return FrictionVariables(
            variables.accumulated + trial.slip,
            variables.plastic + trial.slip[:, None] * trial.direction,
            np.maximum(jump[:, 0], 0) if self.saw and not variables.sawn else variables.gap,
            variables.sawn,
        )

    # -- response

    def opening(self, jump: Array, variables: FrictionVariables) -> Array:
        """The opening beyond what the saw has removed."""
        opening = jump[:, 0]
        return opening - self.added_thickness(variables, len(jump)) if self.saw else opening

    def added_thickness(self, variables: FrictionVariables, points: int) -> Array:
        """See `Law`: the thickness of the saw less the opening before."""
        return -np.maximum(variables.sawn - variables.gap, 0)

    def trial(self, jump: Array, variables: FrictionVariables) -> Trial:
        """The elastic predictor and the slip that returns it to the yield surface."""
        opening = self.opening(jump, variables)
        normal = self.K_N * np.minimum(opening, self.cap_opening)
        shear = self.K_T * (jump[:, 1:] - variables.plastic)
        size = np.hypot(shear[:, 0], shear[:, 1])
        excess = size + self.mu * normal - self.H * variables.accumulated - self.adhesion
        direction = shear / np.maximum(size, 1e-300)[:, None]
        slips = excess > self.yield_tolerance * size
        slip = np.where(slips, excess / (self.K_T + self.H), 0)
        return Trial(normal, size, direction, slip, opening > self.cap_opening)

    def response(self, jump: Array, variables: FrictionVariables) -> Response:
        """See `Law`."""
        trial = self.trial(jump, variables)
        traction = np.empty((len(jump), 3))
        traction[:, 0] = trial.normal
        traction[:, 1:] = (trial.size - self.K_T * trial.slip)[:, None] * trial.direction
        return traction, lambda: self.tangent(trial)

    def tangent(self, trial: Trial) -> Array:
        """The tangent (q, 3, 3), which is not symmetric."""
        _, size, n, slip, opened = trial
        tangent = np.zeros((len(size), 3, 3))
        tangent[:, 0, 0] = self.normal_stiffness(opened)
        tangent[:, 1, 1] = tangent[:, 2, 2] = self.K_T
        slides = slip > 0
        if not slides.any():
            return tangent
        across = 1 - self.K_T * slip / np.maximum(size, 1e-300)
        along = np.where(slides, self.H / (self.K_T + self.H), 1.0)
        difference = (self.K_T * (along - across))[:, None] * n
        tangent[:, 1:, 1:] = difference[:, :, None] * n[:, None, :]
        across = self.K_T * (across + self.artificial * slides)
        tangent[:, 1, 1] += across
        tangent[:, 2, 2] += across
        coupling = -self.K_T / (self.K_T + self.H) * self.mu * self.K_N
        tangent[:, 1:, 0] = (coupling * (slides & ~opened))[:, None] * n
        return tangent

    def secant_stiffness(self, jump: Array, variables: FrictionVariables) -> Array:
        """See `Law`: stress over jump, without coupling."""
        _, size, _, slip, opened = self.trial(jump, variables)
        matrix = np.zeros((len(jump), 3, 3))
        share = np.where(slip > 0, 1 - self.K_T * slip / np.maximum(size, 1e-300), 1.0)
        matrix[:, 0, 0] = self.normal_stiffness(opened)
        matrix[:, 1, 1] = matrix[:, 2, 2] = self.K_T * np.maximum(share, self.artificial)
        return matrix

    def normal_stiffness(self, opened: BoolArray) -> Array:
        """K_N, next to nothing where the point is open (q,)."""
        return np.where(opened, self.artificial * self.K_N, self.K_N)

    # -- meaning

    def is_open(self, jump: Array, variables: FrictionVariables) -> BoolArray:
        """See `Law`: beyond the opening at which the tension reaches c/mu."""
        return self.opening(jump, variables) > self.cap_opening

    def cohesion_left(self, jump: Array, variables: FrictionVariables) -> Array:
        """See `Law`: all of it, also where the point is open."""
        return np.ones(len(jump))

    def opening_of_crack(self, variables: FrictionVariables, points: int) -> Array:
        """See `Law`."""
        return np.full(points, self.cap_opening)

    def slip(self, variables: FrictionVariables, points: int) -> Array:
        """See `Law`: the plastic slip."""
        return np.linalg.norm(variables.plastic, axis=1)

    def has_slipped(self, variables: FrictionVariables, points: int) -> BoolArray:
        """See `Law`."""
        return variables.accumulated > 0

    def column_values(self, variables: FrictionVariables) -> dict[str, Array]:
        """See `Law`."""
        return {"lambda": variables.accumulated}

    # -- strength

    def shear_strength(self, sigma_n: Array, damage: Array | float, slip: Array | float) -> Array:
        """See `Law`: c - mu sigma_n + H slip."""
        return self.adhesion - self.mu * sigma_n + self.H * slip

    shear_strength_formula = "c + mu |sigma'|"

    def shear_bound(self, normal: Array, length: float) -> Array:
        """See `Law`: tension lowers the strength elsewhere by as much as it presses there."""
        if self.hardens:
            return super().shear_bound(normal, length)
        return np.maximum(self.mu * normal + self.adhesion * length, 0)

    def hints(self, evidence: Evidence) -> Iterator[str]:
        """See `Law`."""
        if self.open_tension * evidence.crack_length:
            share = evidence.tension_share
            part = "" if np.isnan(share) else f" ({share:.0%} of the overturning moment)"
            yield (
                f"the joint is open over {evidence.crack_length:.3g} m and transmits tension "
                f"there, adhesion/mu = {with_unit(self.open_tension, STRESSES)}{part}, at any "
                "opening, as the friction law is published: law = bond does not"
            )
