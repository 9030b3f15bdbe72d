"""Cohesive law of mixed mode, section 4.5 of reference/theory.md."""

from __future__ import annotations

from math import hypot, sqrt

from .point import Jump, Point, Values, damage_after


class Mixed(Point):
    """A point of law = mixed: largest equivalent jump kappa."""

    def __init__(self, values: Values) -> None:
        super().__init__(values)
        self.f_t, self.curve = values["sigma_max"], values["softening"]
        self.contact = values["pena_contact"] * self.K_N
        self.ratio = self.K_T / self.K_N
        self.delta_e = self.f_t / self.K_N
        self.L_C = 2 * values["G_f"] / self.f_t if self.f_t else 0.0
        self.kappa = self.delta_e

    def step(self, jump: Jump, begin: float, end: float, frozen: bool) -> None:
        """See `Point`."""
        shear = sqrt(self.ratio) * hypot(jump[1], jump[2])
        self.kappa = max(self.kappa, hypot(max(jump[0], 0.0), shear))
        self.jump = jump

    def damage(self, jump: Jump) -> float:
        """See `Point`."""
        if not self.f_t:
            return 1.0
        xi = (self.kappa - self.delta_e) / (self.L_C - self.delta_e)
        return damage_after(xi, self.curve)

    def traction(self, jump: Jump) -> Jump:
        """See `Point`."""
        r = self.f_t * (1 - self.damage(jump)) / self.kappa if self.f_t else 0.0
        normal = (r if jump[0] > 0 else self.contact) * jump[0]
        return (normal, r * self.ratio * jump[1], r * self.ratio * jump[2])

    def gapes(self, jump: Jump) -> bool:
        """See `Point`: open, after an equivalent jump where linear softening ends."""
        return jump[0] > 0 and self.kappa >= self.L_C

    def slip(self) -> float:
        """See `Point`: there is none."""
        return 0.0

    def strength(self, normal: float) -> float:
        """See `Point`: contact has no bound."""
        return float(max(1.0, sqrt(self.ratio)) * self.f_t + abs(normal))
