"""Coupled cohesive-frictional law, section 4.3 of reference/theory.md."""

from __future__ import annotations

from itertools import pairwise
from math import hypot

from .point import Jump, Point, Values


class Bond(Point):
    """A point of law = bond: damage D, slip s."""

    def __init__(self, values: Values) -> None:
        super().__init__(values)
        self.f_t, self.c, self.mu = values["sigma_max"], values["adhesion"], values["mu"]
        self.delta_e = self.f_t / self.K_N
        self.delta_c = 2 * values["G_f"] / (self.f_t or self.c or 1.0)
        self.lambda_c = 2 * values["G_t"] / self.c if self.c else float("inf")
        self.D, self.s = 0.0, (0.0, 0.0)

    def opened(self, opening: float) -> float:
        """The larger of D and the damage of an opening [m]."""
        share = (opening - self.delta_e) / (self.delta_c - self.delta_e)
        return max(self.D, min(max(share, 0.0), 1.0))

    def step(self, jump: Jump, begin: float, end: float, frozen: bool) -> None:
        """See `Point`."""
        opening, D_o = jump[0], self.opened(jump[0])
        D_frozen = self.opened(self.jump[0])
        trial = [self.K_T * (jump[k + 1] - self.s[k]) for k in (0, 1)]
        size = hypot(*trial)
        pressed = self.mu * min(self.K_N * opening, 0.0)

        def damage(slip: float) -> float:
            return min(1.0, max(D_o, self.D + slip / self.lambda_c))

        def f(slip: float) -> float:
            D = D_frozen if frozen else damage(slip)
            return size + pressed - self.K_T * slip - self.c * (1 - D)

        slip = 0.0
        if f(0.0) > 0:  # piecewise linear: the root is between two of its kinks
            kinks = [(D_o - self.D) * self.lambda_c, (1 - self.D) * self.lambda_c] if self.c else []
            most = size / self.K_T
            ends = sorted({0.0, most, *(kink for kink in kinks if 0 < kink < most)})
            for low, high in pairwise(ends):
                slip = high
                if f(high) <= 0:
                    slip = low + (high - low) * f(low) / (f(low) - f(high))
                    break
        self.D = damage(slip)
        if slip:
            self.s = (self.s[0] + slip * trial[0] / size, self.s[1] + slip * trial[1] / size)
        self.jump = jump

    def traction(self, jump: Jump) -> Jump:
        """See `Point`: after a step the point is on or below the yield surface."""
        opening = jump[0]
        normal = self.K_N * opening
        if opening > 0:
            kappa = self.delta_e + self.D * (self.delta_c - self.delta_e)
            normal = self.f_t * (1 - self.D) / kappa * opening if self.f_t else 0.0
        return (normal, self.K_T * (jump[1] - self.s[0]), self.K_T * (jump[2] - self.s[1]))

    def damage(self, jump: Jump) -> float:
        """See `Point`."""
        return self.D

    def slip(self) -> float:
        """See `Point`."""
        return hypot(*self.s)

    def strength(self, normal: float) -> float:
        """See `Point`."""
        return float(self.f_t + self.c + self.mu * max(-normal, 0.0))
