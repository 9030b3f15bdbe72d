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
from .base import Response, SofteningLaw

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
#: Most iterations for the damage, as in pro/law_endo.pro; usually 1 to 5. Then a bracket <= 2e-8.
MOST_ITERATIONS = 32
#: Where they end: change of log(alpha/(1 - alpha)) [-] by bisection, and by Newton's method, whose
#: error is then its square, below rounding.
ACCURACY, QUADRATIC = 1e-10, 1e-6


@dataclass(frozen=True)
class EndoVariables:
    """Internal variables at q points."""

    #: (q,), 0 to 1
    alpha: Array
    #: (q, 3): along t1, t2 and the normal [m]
    plastic: Array


class PlasticReturn(NamedTuple):
    """The return to the yield surface at a given damage; arrays (q,)."""

    #: plastic jump [m]: n, t1, t2
    plastic: tuple[Array, Array, Array]
    #: direction of the shear of the elastic trial: t1, t2
    direction: tuple[Array, Array]
    #: derivative of the plastic jump with the elastic trial stress [m/Pa]: n n, n along this
    #: direction, along it, across it
    compliance: tuple[Array, Array, Array, Array]
    #: derivative of the plastic jump with the damage, with the other sign [m]: n, along, across
    decline: tuple[Array, Array, Array]
    #: energy that one unit of damage releases, over G_f, and -d/d alpha of it (q,)
    release_rate: Array
    decrease: Array

    def in_plane(self, along: Array, across: Array) -> tuple[Array, Array]:
        """Components t1, t2 of a vector along and across the direction of the shear."""
        t1, t2 = self.direction
        return t1 * along - t2 * across, t2 * along + t1 * across


def degradation(alpha: Array) -> tuple[Array, Array, Array]:
    """S = (1 - alpha)^3/sqrt(alpha) and its first two derivatives."""
    rest = 1 - alpha
    share = rest / np.sqrt(alpha)
    rate = share / alpha
    return (
        share * rest**2,
        -rate * rest * (2.5 * alpha + 0.5),
        rate / alpha * (3.75 * alpha**2 + 1.5 * alpha + 0.75),
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
        normal, *shear = self.plastic_return(jump, variables, alpha).plastic
        return EndoVariables(alpha, np.column_stack([*shear, normal]))

    # -- the return at a given damage, as in pro/law_endo.pro

    def plastic_return(self, jump: Array, variables: EndoVariables, alpha: Array) -> PlasticReturn:
        """The plastic jump of least energy at a damage (q,), and what a unit of damage releases."""
        S, dS, d2S = degradation(np.maximum(alpha, LEAST))
        (K_n, K_t, _), (B_n, B_t, _), mu = self.K, self.B, self.mu
        (d_n, d_1, d_2), (before_1, before_2, before_n) = jump.T, variables.plastic.T
        # the elastic trial of X = sigma - S B p
        stiff_n, stiff_t, back = K_n + S * B_n, K_t + S * B_t, S * B_t
        X_n = K_n * (d_n - before_n) - S * B_n * before_n
        X_1, X_2 = (K_t * (d - p) - back * p for d, p in ((d_1, before_1), (d_2, before_2)))
        size = np.hypot(X_1, X_2)
        least = np.maximum(size, 1e-300)
        t_1, t_2 = np.where(size > 0, X_1 / least, 1.0), X_2 / least
        # the flow along the normal (mu, 1) of the yield surface, or to its apex
        stiff = stiff_t + mu**2 * stiff_n
        multiplier = np.maximum(size + mu * X_n, 0) / stiff
        flows = multiplier > 0
        apex = flows & (size < stiff_t * multiplier)
        smooth, to_n, to_t = flows / stiff, 1 / stiff_n, 1 / stiff_t
        nn, na = np.where(apex, to_n, mu**2 * smooth), np.where(apex, 0, mu * smooth)
        aa, cc = np.where(apex, to_t, smooth), np.where(apex, to_t, multiplier / least)
        p_n = before_n + np.where(apex, X_n * to_n, mu * multiplier)
        slip = np.where(apex, size * to_t, multiplier)
        p_1, p_2 = before_1 + slip * t_1, before_2 + slip * t_2
        # the back stress B p along n, along the shear and across it
        b_n, b_a, b_c = B_n * p_n, B_t * (t_1 * p_1 + t_2 * p_2), B_t * (t_1 * p_2 - t_2 * p_1)
        decline = dS * (nn * b_n + na * b_a), dS * (na * b_n + aa * b_a), dS * (cc * b_c)
        work = (b_n * p_n + B_t * (p_1**2 + p_2**2)) / (2 * self.energy)
        relieved = (b_n * decline[0] + b_a * decline[1] + b_c * decline[2]) / self.energy
        return PlasticReturn(
            plastic=(p_n, p_1, p_2),
            direction=(t_1, t_2),
            compliance=(nn, na, aa, cc),
            decline=decline,
            release_rate=-dS * work,
            decrease=d2S * work - dS * relieved,
        )

    def damaged(self, jump: Array, variables: EndoVariables) -> Array:
        """The damage after the step (q,): the root of release_rate = 1, by Newton's method between
        the logarithms of the rate and of alpha/(1 - alpha), within a bracket.
        """
        alpha = variables.alpha.copy()
        at = self.plastic_return(jump, variables, alpha)
        grows = at.release_rate > 1
        if not grows.any():
            return alpha
        jump, rate, decrease = jump[grows], at.release_rate[grows], at.decrease[grows]
        variables = EndoVariables(alpha[grows], variables.plastic[grows])
        share = np.maximum(variables.alpha, LEAST)
        odds = np.log(share) - np.log1p(-share)
        low, high = odds, np.full(len(odds), np.log(LARGEST) - np.log1p(-LARGEST))
        for _ in range(MOST_ITERATIONS):
            low, high = np.where(rate > 1, odds, low), np.where(rate > 1, high, odds)
            newton = odds + np.log(rate) * rate / (decrease * share * (1 - share))
            inside = (newton >= low) & (newton <= high)
            step = np.where(inside, newton, (low + high) / 2) - odds
            odds = odds + step
            share = 1 / (1 + np.exp(-odds))
            if np.all(np.abs(step) <= np.where(inside, QUADRATIC, ACCURACY)):
                break
            at = self.plastic_return(jump, variables, share)
            rate, decrease = at.release_rate, at.decrease
        alpha[grows] = np.maximum(share, variables.alpha)
        return alpha

    # -- response

    def response(
        self, jump: Array, variables: EndoVariables, frozen: Array | None = None
    ) -> Response:
        """See `Law`; the tangent is symmetric."""
        alpha = self.damaged(jump, variables) if frozen is None else frozen
        at = self.plastic_return(jump, variables, alpha)

        def tangent_of() -> Array:
            tangent = self.stiffness(at)
            if frozen is None:
                decrease = np.where(alpha > variables.alpha, at.decrease * self.energy, np.inf)
                normal, *shear = at.decline
                b = self.K * np.column_stack([normal, *at.in_plane(*shear)])
                b /= np.sqrt(decrease)[:, None]
                tangent -= b[:, :, None] * b[:, None, :]
            return tangent

        return self.K * (jump - np.column_stack(at.plastic)), tangent_of

    def stiffness(self, at: PlasticReturn) -> Array:
        """The tangent (q, 3, 3) of the joint that flows at constant damage."""
        (nn, na, aa, cc), (t_1, t_2) = at.compliance, at.direction
        flow = np.empty((len(nn), 3, 3))
        flow[:, 0, 0], along = nn, aa - cc
        flow[:, 0, 1] = flow[:, 1, 0] = na * t_1
        flow[:, 0, 2] = flow[:, 2, 0] = na * t_2
        flow[:, 1, 2] = flow[:, 2, 1] = along * t_1 * t_2
        flow[:, 1, 1], flow[:, 2, 2] = cc + along * t_1**2, cc + along * t_2**2
        flow *= (self.artificial - 1) * np.multiply.outer(self.K, self.K)
        flow += np.diag(self.K)
        return flow

    def secant_stiffness(
        self, jump: Array, variables: EndoVariables, frozen: Array | None = None
    ) -> Array:
        """See `Law`: the tangent at constant damage."""
        alpha = self.damaged(jump, variables) if frozen is None else frozen
        return self.stiffness(self.plastic_return(jump, variables, alpha))

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
