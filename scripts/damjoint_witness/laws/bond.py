"""Coupled cohesive-frictional law, section 4.3 of reference/theory.md."""

from __future__ import annotations

from itertools import pairwise
from math import hypot

from .point import Jump, Point, Values, damage_after

#: Halvings of the interval of the slip of exponential softening.
HALVINGS = 100


class Bond(Point):
    """A point of law = bond: progress xi of the softening, slip s."""

    def __init__(self, values: Values) -> None:
        super().__init__(values)
        self.f_t, self.c, self.mu = values["sigma_max"], values["adhesion"], values["mu"]
        self.delta_e = self.f_t / self.K_N
        self.delta_c = 2 * values["G_f"] / (self.f_t or self.c or 1.0)
        self.lambda_c = 2 * values["G_t"] / self.c if self.c else float("inf")
        self.curve = values["softening"]
        self.xi, self.s = 0.0, (0.0, 0.0)

    def opened(self, opening: float) -> float:
        """The larger of xi and the progress of an opening [m]."""
        return max(self.xi, (opening - self.delta_e) / (self.delta_c - self.delta_e))

    def left(self, xi: float) -> float:
        """What is left of the strengths."""
        return 1 - damage_after(xi, self.curve)

    def step(self, jump: Jump, begin: float, end: float, frozen: bool) -> None:
        """See `Point`."""
        opening, xi_o = jump[0], self.opened(jump[0])
        xi_frozen = self.opened(self.jump[0])
        trial = [self.K_T * (jump[k + 1] - self.s[k]) for k in (0, 1)]
        size = hypot(*trial)
        pressed = self.mu * min(self.K_N * opening, 0.0)

        def progress(slip: float) -> float:
            return max(xi_o, self.xi + slip / self.lambda_c)

        def f(slip: float) -> float:
            xi = xi_frozen if frozen else progress(slip)
            return size + pressed - self.K_T * slip - self.c * self.left(xi)

        slip = 0.0
        if f(0.0) > 0 and self.curve == "exponential":
            low, slip = 0.0, size / self.K_T
            for _ in range(HALVINGS):
                middle = (low + slip) / 2
                low, slip = (middle, slip) if f(middle) > 0 else (low, middle)
        elif f(0.0) > 0:  # piecewise linear: the root is between two of its kinks
            kinks = []
            if self.c:
                kinks = [(xi_o - self.xi) * self.lambda_c, (1 - self.xi) * self.lambda_c]
            most = size / self.K_T
            ends = sorted({0.0, most, *(kink for kink in kinks if 0 < kink < most)})
            for low, high in pairwise(ends):
                slip = high
                if f(high) <= 0:
                    slip = low + (high - low) * f(low) / (f(low) - f(high))
                    break
        self.xi = progress(slip)
        if slip:
            self.s = (self.s[0] + slip * trial[0] / size, self.s[1] + slip * trial[1] / size)
        self.jump = jump

    def traction(self, jump: Jump) -> Jump:
        """See `Point`: after a step the point is on or below the yield surface."""
        opening = jump[0]
        normal = self.K_N * opening
        if opening > 0:
            kappa = self.delta_e + self.xi * (self.delta_c - self.delta_e)
            normal = self.f_t * self.left(self.xi) / kappa * opening if self.f_t else 0.0
        return (normal, self.K_T * (jump[1] - self.s[0]), self.K_T * (jump[2] - self.s[1]))

    def damage(self, jump: Jump) -> float:
        """See `Point`."""
        return damage_after(self.xi, self.curve)

    def gapes(self, jump: Jump) -> bool:
        """See `Point`: open, without the tension of linear softening."""
        return jump[0] > 0 and (self.xi >= 1 or not self.f_t)

    def slip(self) -> float:
        """See `Point`."""
        return hypot(*self.s)

    def strength(self, normal: float) -> float:
        """See `Point`."""
        return float(self.f_t + self.c + self.mu * max(-normal, 0.0))
