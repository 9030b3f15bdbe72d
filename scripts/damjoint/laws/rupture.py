"""Cohesive rupture (JOINT_MECA_RUPT, code_aster R7.01.25), with grouting and sawing.

Internal variables: kappa, the largest opening so far [m]; the tangential jump at which the shear
was released; the thickness of grout that has set, or the opening before sawing. Openings here are
those beyond the thickness that grout and saw leave.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, BoolArray
from .base import Evidence, Response, SofteningLaw
from .softening import CURVES


@dataclass(frozen=True)
class RuptureVariables:
    """Internal variables at q points, and the works on the joint in the step under way."""

    #: (q,) [m]
    kappa: Array
    #: (q, 2) [m]
    released: Array
    #: (q,) [m]: of the grout; in a joint that is sawn and not grouted, its opening before
    thickness: Array | float = 0.0
    #: thickness of the saw [m], and the largest opening that liquid grout leaves [m]
    sawn: float = 0.0
    largest: float = np.inf


class Rupture(SofteningLaw[RuptureVariables]):
    """Softening in tension, elastic shear that the opening releases, contact."""

    variable_names = ("kappa", "released_1", "released_2", "thickness")
    slip_name = "released slip"
    softens = True
    works = ("grout_pressure", "saw_thickness")
    has_friction = False

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        p, penalty = parameters, parameters["pena_rupture"]
        self.curve = CURVES[p["softening"]]
        self.broken_damage = float(self.curve.damage(np.float64(1)))
        self.K_N, self.K_T, self.K_contact = p["K_N"], p["K_T"], p["pena_contact"] * p["K_N"]
        self.alpha, self.artificial = p["alpha"], p["artificial"]
        self.tensile_strength = p["sigma_max"]
        self.delta_e = p["sigma_max"] / self.K_N
        self.L_C = (1 + penalty) * self.delta_e
        self.sigma_c = p["sigma_max"] * (1 + penalty) / penalty  # the line at no opening
        #: opening at which nothing remains [m]
        self.L_end = self.L_C
        if self.curve.end > 1:
            self.L_end = self.delta_e + self.curve.end * (self.L_C - self.delta_e)
        self.L_CT = (
            np.inf
            if self.alpha >= 2
            else max(self.L_C * np.tan(self.alpha * np.pi / 4), p["release_length"])
        )
        self.releases_shear = bool(np.isfinite(self.L_CT))
        self.grout, self.grout_t = p["grout_pressure"] / self.K_contact, p["grout_t"]
        self.saw, self.saw_t = p["saw_thickness"], p["saw_t"]

    # -- internal variables

    def initial(self, points: int) -> RuptureVariables:
        """See `Law`."""
        return RuptureVariables(np.full(points, self.delta_e), np.zeros((points, 2)))

    def begin_step(self, variables: RuptureVariables, begin: float, end: float) -> RuptureVariables:
        """See `Law`; grout_in and sawn_at of pro/law_rupture.pro."""
        if not (self.grout or self.saw):
            return variables
        liquid = self.grout > 0 and begin < self.grout_t and end > self.grout_t - 1
        largest = -self.grout * min(end - self.grout_t + 1, 1) if liquid else np.inf
        sawn = self.saw * min(max(end - self.saw_t + 1, 0), 1)
        return replace(variables, sawn=sawn, largest=largest)

    def update_internal_variables(
        self, jump: Array, variables: RuptureVariables, frozen: Array | None = None
    ) -> RuptureVariables:
        """See `Law`."""
        v, opening = variables, self.opening(jump, variables)
        free = (self.shear_share(opening) if frozen is None else frozen) <= 0
        return replace(
            v,
            kappa=np.maximum(v.kappa, opening),
            released=np.where(free[:, None], jump[:, 1:], v.released),
            thickness=self.new_thickness(jump, v),
        )

    def new_thickness(self, jump: Array, variables: RuptureVariables) -> Array | float:
        """Thickness of the grout after a step; without grouting, the opening before sawing."""
        v = variables
        if self.grout:
            return v.thickness + np.maximum(self.gap(jump, v) - v.largest, 0)
        return np.maximum(jump[:, 0], 0) if self.saw and not v.sawn else v.thickness

    # -- response

    def released_jump(self, variables: RuptureVariables, points: int) -> Array:
        """See `Law`."""
        return np.column_stack([np.zeros(points), variables.released])

    def gap(self, jump: Array, variables: RuptureVariables) -> Array:
        """The opening beyond what grout and saw leave, before grout enters (q,) [m]."""
        return np.asarray(jump[:, 0] - self.added_thickness(variables, len(jump)))

    def added_thickness(self, variables: RuptureVariables, points: int) -> Array:
        """See `Law`; a joint that is only sawn loses the saw's thickness less its opening."""
        v = variables
        added = v.thickness - v.sawn if self.grout else -np.maximum(v.sawn - v.thickness, 0)
        return np.full(points, added)

    def opening(self, jump: Array, variables: RuptureVariables) -> Array:
        """The opening beyond the thickness that grout and saw leave (q,) [m]."""
        if not (self.grout or self.saw):
            return jump[:, 0]
        return np.minimum(self.gap(jump, variables), variables.largest)

    def is_broken_at(self, opening: Array, variables: RuptureVariables) -> BoolArray:
        """Whether a point has lost its tensile strength at an opening (q,) of the step."""
        return self.was_broken(variables) | (opening >= self.L_end)

    def was_broken(self, variables: RuptureVariables) -> BoolArray:
        """Whether it had at the beginning of the step."""
        return (variables.kappa >= self.L_end) | (variables.sawn > 0)

    def shear_share(self, opening: Array) -> Array:
        """Remaining part of the shear stiffness (q,): 1 to 0."""
        return np.minimum(np.maximum(1 - opening / self.L_CT, 0), 1)

    def shear_slope(self, opening: Array) -> Array:
        """Derivative of the shear stiffness with the opening (q,) [Pa/m2]."""
        return ((opening > 0) & (opening < self.L_CT)) * (-self.K_T / self.L_CT)

    def progress(self, kappa: Array) -> Array:
        """Progress of the softening at the largest opening (q,) [-]."""
        if self.delta_e < self.L_C:
            return np.asarray((kappa - self.delta_e) / (self.L_C - self.delta_e))
        return 0 * kappa

    def softening_stress(self, opening: Array) -> Array:
        """Normal stress of an opening that is the largest so far (q,)."""
        if self.curve.name == "linear":  # as published
            return np.asarray(self.sigma_c * (1 - opening / self.L_C))
        return self.tensile_strength * self.curve.remaining(self.progress(opening))

    def softening_slope(self, opening: Array) -> Array | float:
        """Its derivative with the opening (q,)."""
        if not self.L_C:
            return 0.0
        if self.curve.name == "linear":
            return -self.sigma_c / self.L_C
        rate = self.curve.rate(self.progress(opening))
        return -self.tensile_strength / (self.L_C - self.delta_e) * rate

    def normal_response(
        self,
        opening: Array,
        variables: RuptureVariables,
        frozen: Array | None,
        secant: bool = False,
    ) -> tuple[Array, Array]:
        """Normal stress, and its tangent or a secant stiffness that is positive (q,); with frozen
        damage open points do not soften.
        """
        v, weak, closed = variables, self.artificial * self.K_N, opening <= 0
        if frozen is None:
            broken, unloads = self.is_broken_at(opening, v), opening <= v.kappa
        else:
            broken, unloads = self.was_broken(v), np.ones(len(opening), bool)
        with np.errstate(divide="ignore", invalid="ignore"):  # without tensile strength
            unloading = self.softening_stress(v.kappa) / v.kappa
            stress = np.where(unloads, unloading * opening, self.softening_stress(opening))
            normal = np.where(closed, self.K_contact * opening, np.where(broken, 0, stress))
            softening = normal / opening if secant else self.softening_slope(opening)
        free = (opening >= v.largest) | broken & ~closed
        bonded = np.where(closed, self.K_contact, np.where(unloads, unloading, softening))
        stiffness = np.where(free, weak, bonded)
        return normal, np.maximum(stiffness, weak) if secant else stiffness

    def stiffness(self, normal: Array, shear_share: Array) -> Array:
        """The diagonal stiffness (q, 3, 3): normal, and the remaining shear stiffness."""
        matrix = np.zeros((len(normal), 3, 3))
        matrix[:, 0, 0] = normal
        matrix[:, 1, 1] = matrix[:, 2, 2] = self.K_T * np.maximum(shear_share, self.artificial)
        return matrix

    def response(
        self, jump: Array, variables: RuptureVariables, frozen: Array | None = None
    ) -> Response:
        """See `Law`; frozen: the remaining part of the shear stiffness."""
        opening, slip = self.opening(jump, variables), jump[:, 1:] - variables.released
        normal, slope = self.normal_response(opening, variables, frozen)
        share = self.shear_share(opening) if frozen is None else frozen
        traction = np.empty((len(jump), 3))
        traction[:, 0], traction[:, 1:] = normal, (self.K_T * share)[:, None] * slip

        def tangent_of() -> Array:
            tangent = self.stiffness(slope, share)
            if frozen is None and self.releases_shear:
                tangent[:, 1:, 0] = self.shear_slope(opening)[:, None] * slip
            return tangent

        return traction, tangent_of

    def secant_stiffness(
        self, jump: Array, variables: RuptureVariables, frozen: Array | None = None
    ) -> Array:
        """See `Law`."""
        opening = self.opening(jump, variables)
        share = self.shear_share(opening) if frozen is None else frozen
        normal = self.normal_response(opening, variables, frozen, secant=True)[1]
        return self.stiffness(normal, share)

    def frozen_damage(self, jump: Array, variables: RuptureVariables) -> Array:
        """See `SofteningLaw`: the remaining part of the shear stiffness."""
        return self.shear_share(self.opening(jump, variables))

    @property
    def stages(self) -> list[float]:
        """See `Law`."""
        softening = (self.delta_e, (self.delta_e + self.L_end) / 2, self.L_end)
        return sorted({self.L_CT / 2, self.L_CT, *softening})

    def released_part(self, jump: Array, variables: RuptureVariables) -> Array:
        """See `Law`."""
        return 1 - self.shear_share(self.opening(jump, variables))

    def release_side(self, jump: Array, variables: RuptureVariables) -> NDArray[np.int_]:
        """See `Law`."""
        opening = self.opening(jump, variables)
        return np.asarray(opening > 0, int) + (opening >= self.L_CT) - 1

    def shear_release(self, jump: Array, variables: RuptureVariables) -> tuple[Array, Array]:
        """See `Law`."""
        opening, slip = self.opening(jump, variables), jump[:, 1:] - variables.released
        line = self.K_T * (1 - opening / self.L_CT)
        return line[:, None] * slip, -self.K_T / self.L_CT * slip

    # -- meaning

    def damage(self, jump: Array, variables: RuptureVariables) -> Array:
        """See `Law`: the used part of the softening."""
        used = self.curve.damage(self.progress(variables.kappa))
        broken = self.is_broken_at(self.opening(jump, variables), variables)
        return np.where(broken & (variables.kappa > 0), 1.0, used)

    def is_open(self, jump: Array, variables: RuptureVariables) -> BoolArray:
        """See `Law`: whether it has softened by L_C, or has been sawn."""
        opening = np.maximum(self.opening(jump, variables), variables.kappa)
        return ((opening >= self.L_C) | (variables.sawn > 0)) & (variables.kappa > 0)

    def opening_of_crack(self, variables: RuptureVariables, points: int) -> Array:
        """See `Law`."""
        return np.where(variables.kappa >= self.L_C, 0.0, self.L_C)

    def slip(self, variables: RuptureVariables, points: int) -> Array:
        """See `Law`: the tangential jump at the last free slide."""
        return np.linalg.norm(variables.released, axis=1)

    def hints(self, evidence: Evidence) -> Iterator[str]:
        """See `Law`."""
        if self.releases_shear and evidence.unstable:
            yield (
                f"law = rupture with alpha = {self.alpha:g} loses its shear stiffness where it "
                "opens, and has no friction: the crack grows unstably; alpha = 2 keeps the "
                "stiffness, law = bond has friction"
            )
