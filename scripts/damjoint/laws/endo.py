"""Damage and plasticity coupled (JOINT_MECA_ENDO of code_aster).

Internal variables: the damage alpha, 0 to 1, and the plastic jump p, which dilates the joint. The
energy of a point [N/m] is (delta - p) K (delta - p)/2 + S(alpha) p B p/2 + G_f alpha, with
S = (1 - alpha)^3/sqrt(alpha). The plastic jump grows by the flow rule associated with
|X_t| + mu X_n <= 0, X = sigma - S B p. A step minimises the energy over p and alpha.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..arrays import Array, BoolArray
from .base import SofteningLaw

#: Damage at which tensile strength and cohesion are largest: the maximum of S^2/(-S').
PEAK = (np.sqrt(1.5 / 3.5) - 0.5) / 2.5
#: Damage at which a point snaps back first: the maximum of 2 S'^2/S'' - S, which K/B has to exceed.
STEEPEST = 0.2
#: Damage from which on a point counts as broken: -S' is the minimum of S^2/(-S'). In tension the
#: plastic opening is then 2 G_f/sigma_max, where linear softening would end; 9 % of the strengths
#: are left.
BROKEN = 0.7203615675
#: Least damage of a point that has yielded [-], at which S = 1e9.
LEAST = 1e-18
#: Largest damage [-], at which S = 1e-36.
LARGEST = 1 - 1e-12
#: Most iterations for the damage, as in pro/law_endo.pro; usually 3 to 7. Then a bracket <= 2e-8.
MOST_ITERATIONS = 32
#: Where they end: change of log(alpha/(1 - alpha)) [-]. Newton's method has then rounded digits.
ACCURACY = 1e-10


@dataclass(frozen=True)
class EndoVariables:
    """Internal variables at q points."""

    #: (q,), 0 to 1
    alpha: Array
    #: (q, 3): along t1, t2 and the normal [m]
    plastic: Array


class Flow(NamedTuple):
    """The plastic flow of a step; components of a vector: n, t1, t2."""

    #: growth of the plastic jump (q, 3) and its multiplier (q,) [m]
    growth: Array
    multiplier: Array
    #: normal of the yield surface (q, 3): mu and the direction of the shear
    normal: Array
    #: shear of the elastic trial (q,) [Pa]; stiffness of X against the plastic jump (q, 3) [Pa/m]
    size: Array
    stiffness: Array
    #: whether X returns to the apex (q,)
    apex: BoolArray


class PlasticReturn(NamedTuple):
    """The return to the yield surface at a given damage; components of a vector: n, t1, t2."""

    #: plastic jump (q, 3) [m], and its derivative with the elastic trial stress (q, 3, 3) [m/Pa]
    plastic: Array
    compliance: Array
    #: derivative of the plastic stress -K p with the damage (q, 3) [Pa]
    coupling: Array
    #: energy that one unit of damage releases, over G_f, and -d/d alpha of it (q,)
    release_rate: Array
    decrease: Array


def degradation(alpha: Array) -> tuple[Array, Array, Array]:
    """S = (1 - alpha)^3/sqrt(alpha) and its first two derivatives."""
    rest = 1 - alpha
    return (
        rest**3 / np.sqrt(alpha),
        -(rest**2) * (2.5 * alpha + 0.5) / alpha**1.5,
        rest * (3.75 * alpha**2 + 1.5 * alpha + 0.75) / alpha**2.5,
    )


class Endo(SofteningLaw[EndoVariables]):
    """Tensile strength and cohesion that soften with one damage; friction with its dilatancy."""

    variable_names = ("alpha", "plastic_1", "plastic_2", "plastic_n")
    softens = stands_slipped = True
    broken_damage = BROKEN

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        p = parameters
        self.K = np.array([p["K_N"], p["K_T"], p["K_T"]])
        self.unloading_compliance = 1 / p["K_N"], 1 / p["K_T"], 1 / p["K_T"]
        self.tensile_strength, self.cohesion, self.mu = p["sigma_max"], p["adhesion"], p["mu"]
        self.energy, self.artificial = p["G_f"], p["artificial"]
        self.delta_c = 2 * self.energy / self.tensile_strength
        S, dS, _ = degradation(np.array(PEAK))
        self.peak = -dS / S**2
        frictional = (self.mu * self.tensile_strength) ** 2
        squares = np.array([self.tensile_strength**2, *2 * [self.cohesion**2 - frictional]])
        #: hardening moduli B_n, B_t, B_t [Pa/m]
        self.B = self.peak * squares / (2 * self.energy)

    @classmethod
    def least_energies(cls, parameters: Mapping[str, Any]) -> dict[str, tuple[float, str]]:
        """See `Law`: K_N > 0.763 B_n, K_T > 0.763 (B_t + mu^2 B_n)."""
        p = parameters
        (S, dS, _), (S2, dS2, d2S2) = map(degradation, (np.array(PEAK), np.array(STEEPEST)))
        factor = (2 * dS2**2 / d2S2 - S2) * -dS / S**2 / 2
        least = max(p["sigma_max"] ** 2 / p["K_N"], p["adhesion"] ** 2 / p["K_T"])
        formula = f"{factor:.4f} max(sigma_max^2/K_N, adhesion^2/K_T)"
        return {"G_f": (float(factor * least), formula)}

    @classmethod
    def violations(cls, parameters: Mapping[str, Any]) -> Iterator[str]:
        """See `Law`: conditions of the published law."""
        strength, cohesion = parameters["sigma_max"], parameters["adhesion"]
        least = parameters["mu"] * strength
        if not strength > 0:
            yield f"sigma_max = {strength:g}: must be > 0 with law = endo"
        elif not least <= cohesion <= np.sqrt(2) * least:
            yield (
                f"adhesion = {cohesion:g}: must be between mu sigma_max ({least:g} Pa) and sqrt(2) "
                f"mu sigma_max ({np.sqrt(2) * least:g} Pa) with law = endo"
            )

    # -- internal variables

    def initial(self, points: int) -> EndoVariables:
        """See `Law`."""
        return EndoVariables(np.zeros(points), np.zeros((points, 3)))

    def update_internal_variables(
        self, jump: Array, variables: EndoVariables, frozen: Array | None = None
    ) -> EndoVariables:
        """See `Law`; the damage that a step does is known after it, also if it is frozen in it."""
        alpha = self.damaged(jump, variables)
        plastic = self.plastic_return(jump, variables, alpha).plastic
        return EndoVariables(alpha, plastic[:, [1, 2, 0]])

    # -- the return at a given damage, as in pro/law_endo.pro

    def elastic_trial(self, jump: Array, before: Array, S: Array) -> Array:
        """X with the plastic jump before the step (q, 3) [Pa]."""
        return np.asarray(self.K * (jump - before) - S[:, None] * self.B * before)

    def flow(self, trial: Array, S: Array) -> Flow:
        """The flow that returns an elastic trial of X to the yield surface, or to its apex."""
        stiffness = self.K + S[:, None] * self.B
        size = np.linalg.norm(trial[:, 1:], axis=1)
        direction = trial[:, 1:] / np.maximum(size, 1e-300)[:, None]
        normal = np.column_stack([np.full(len(direction), self.mu), direction])
        stiff = stiffness[:, 1] + self.mu**2 * stiffness[:, 0]
        multiplier = np.maximum(size + self.mu * trial[:, 0], 0) / stiff
        apex = (multiplier > 0) & (size < stiffness[:, 1] * multiplier)
        growth = np.where(apex[:, None], trial / stiffness, multiplier[:, None] * normal)
        return Flow(growth, multiplier, normal, size, stiffness, apex)

    def compliance(self, flow: Flow) -> Array:
        """Derivative of the plastic jump with the elastic trial (q, 3, 3) [m/Pa]."""
        stiff = flow.stiffness[:, 1] + self.mu**2 * flow.stiffness[:, 0]
        flows, direction = flow.multiplier > 0, flow.normal[:, 1:]
        compliance = flows[:, None, None] * flow.normal[:, :, None] * flow.normal[:, None, :]
        compliance /= stiff[:, None, None]
        across = flow.multiplier / np.maximum(flow.size, 1e-300)
        outer = direction[:, :, None] * direction[:, None, :]
        compliance[:, 1:, 1:] += across[:, None, None] * (np.eye(2) - outer)
        compliance[flow.apex] = np.eye(3) / flow.stiffness[flow.apex][:, None, :]
        return np.asarray(compliance)

    def plastic_return(self, jump: Array, variables: EndoVariables, alpha: Array) -> PlasticReturn:
        """The plastic jump of least energy at a damage (q,), and what a unit of damage releases."""
        S, dS, d2S = degradation(np.maximum(alpha, LEAST))
        before = variables.plastic[:, [2, 0, 1]]
        flow = self.flow(self.elastic_trial(jump, before, S), S)
        plastic, compliance = before + flow.growth, self.compliance(flow)
        back = self.B * plastic
        relief = np.einsum("qij,qj->qi", compliance, back)  # -dp/dS
        work = np.einsum("qi,qi->q", back, plastic)
        return PlasticReturn(
            plastic,
            compliance,
            self.K * relief * dS[:, None],
            -dS * work / (2 * self.energy),
            (d2S * work / 2 - dS**2 * np.einsum("qi,qi->q", back, relief)) / self.energy,
        )

    def damaged(self, jump: Array, variables: EndoVariables) -> Array:
        """The damage after the step (q,): the root of release_rate = 1, by Newton's method between
        the logarithms of the rate and of alpha/(1 - alpha), within a bracket.
        """
        alpha = variables.alpha.copy()
        grows = self.plastic_return(jump, variables, alpha).release_rate > 1
        if not grows.any():
            return alpha
        jump = jump[grows]
        variables = EndoVariables(alpha[grows], variables.plastic[grows])
        low = np.log(np.maximum(variables.alpha, LEAST)) - np.log1p(-variables.alpha)
        high = np.full(len(low), np.log(LARGEST) - np.log1p(-LARGEST))
        odds = np.where(variables.alpha > 0, low, 0.0)
        for _ in range(MOST_ITERATIONS):
            share = 1 / (1 + np.exp(-odds))
            at = self.plastic_return(jump, variables, share)
            low = np.where(at.release_rate > 1, odds, low)
            high = np.where(at.release_rate > 1, high, odds)
            slope = at.decrease * share * (1 - share) / at.release_rate
            newton = odds + np.log(at.release_rate) / slope
            inside = (newton >= low) & (newton <= high)
            step = np.where(inside, newton, (low + high) / 2) - odds
            odds = odds + step
            if (np.abs(step) <= ACCURACY).all():
                break
        alpha[grows] = np.maximum(1 / (1 + np.exp(-odds)), variables.alpha)
        return alpha

    # -- response

    def traction_and_tangent(
        self, jump: Array, variables: EndoVariables, frozen: Array | None = None
    ) -> tuple[Array, Array]:
        """See `Law`; the tangent is symmetric."""
        alpha = self.damaged(jump, variables) if frozen is None else frozen
        at = self.plastic_return(jump, variables, alpha)
        tangent = self.stiffness_with(at.compliance)
        if frozen is None:
            grows = alpha > variables.alpha
            b = at.coupling / np.sqrt(np.where(grows, at.decrease * self.energy, np.inf))[:, None]
            tangent = tangent - b[:, :, None] * b[:, None, :]
        return self.K * (jump - at.plastic), tangent

    def stiffness_with(self, compliance: Array) -> Array:
        """The tangent (q, 3, 3) of the joint that flows at constant damage."""
        flow = (1 - self.artificial) * self.K[:, None] * compliance * self.K
        return np.asarray(np.diag(self.K) - flow)

    def secant_stiffness(
        self, jump: Array, variables: EndoVariables, frozen: Array | None = None
    ) -> Array:
        """See `Law`: the tangent at constant damage."""
        alpha = self.damaged(jump, variables) if frozen is None else frozen
        return self.stiffness_with(self.plastic_return(jump, variables, alpha).compliance)

    def frozen_damage(self, jump: Array, variables: EndoVariables) -> Array:
        """See `SofteningLaw`."""
        return self.damaged(jump, variables)

    # -- meaning

    def damage(self, jump: Array, variables: EndoVariables) -> Array:
        """See `Law`."""
        return variables.alpha

    def is_open(self, jump: Array, variables: EndoVariables) -> BoolArray:
        """See `Law`: in tension, and open by 2 G_f/sigma_max, where linear softening would end."""
        return jump[:, 0] > np.maximum(variables.plastic[:, 2], self.delta_c)

    def cohesion_left(self, jump: Array, variables: EndoVariables) -> Array:
        """See `Law`."""
        return self.strength_left(variables.alpha)

    def strength_left(self, damage: Array | float) -> Array:
        """Part of tensile strength and cohesion at a damage (q,): 1 up to the peak."""
        S, dS, _ = degradation(np.maximum(damage, PEAK))
        return np.asarray(S * np.sqrt(self.peak / -dS))

    def opening_of_crack(self, variables: EndoVariables, points: int) -> Array:
        """See `Law`."""
        return np.full(points, self.delta_c)

    def slip(self, variables: EndoVariables, points: int) -> Array:
        """See `Law`: the tangential part of the plastic jump."""
        return np.linalg.norm(variables.plastic[:, :2], axis=1)

    def has_slipped(self, variables: EndoVariables, points: int) -> BoolArray:
        """See `Law`: beyond the peak; plastic jumps before it do not soften."""
        return (self.slip(variables, points) > 0) & (variables.alpha > PEAK)

    # -- strength

    def shear_strength(self, sigma_n: Array, damage: Array | float, slip: Array | float) -> Array:
        """See `Law`: C - mu sigma_n, C the cohesion at the damage, adhesion at the peak."""
        return self.cohesion * self.strength_left(damage) - self.mu * sigma_n

    shear_strength_formula = "c S/S_max + mu |sigma'|"

    def shear_bound(self, normal: Array, length: float) -> Array:
        """See `Law`: tension lowers the strength elsewhere by as much as it presses there."""
        return np.maximum(self.mu * normal + self.cohesion * length, 0)
