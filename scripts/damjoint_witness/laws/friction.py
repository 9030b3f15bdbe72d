"""Mohr-Coulomb friction with hardening and sawing, section 4.2 of reference/theory.md."""

from __future__ import annotations

from math import hypot

from .point import Jump, Point, Values, ramp


class Friction(Point):
    """A point of law = friction: slip s, its cumulated length lambda, opening before sawing."""

    def __init__(self, values: Values) -> None:
        super().__init__(values)
        self.mu, self.c, self.H = values["mu"], values["adhesion"], values["pena_tang"]
        self.cap = self.c / (self.mu * self.K_N)
        self.saw, self.saw_t = values["saw_thickness"], values["saw_t"]
        self.lam, self.s, self.before, self.sawn = 0.0, (0.0, 0.0), 0.0, 0.0

    def opening(self, jump: Jump) -> float:
        """The opening beyond what the saw has taken [m]."""
        return jump[0] + max(self.sawn - self.before, 0.0)

    def normal(self, jump: Jump) -> float:
        """The normal stress [Pa]."""
        return self.K_N * min(self.opening(jump), self.cap)

    def step(self, jump: Jump, begin: float, end: float, frozen: bool) -> None:
        """See `Point`; there is no damage to freeze."""
        self.sawn = self.saw * ramp(end, self.saw_t)
        trial = [self.K_T * (jump[k + 1] - self.s[k]) for k in (0, 1)]
        size = hypot(*trial)
        f = size + self.mu * self.normal(jump) - self.H * self.lam - self.c
        if f > 0:
            slip = f / (self.K_T + self.H)
            self.lam += slip
            self.s = (self.s[0] + slip * trial[0] / size, self.s[1] + slip * trial[1] / size)
        if self.saw and not self.sawn:
            self.before = max(jump[0], 0.0)
        self.jump = jump

    def traction(self, jump: Jump) -> Jump:
        """See `Point`."""
        tau = [self.K_T * (jump[k + 1] - self.s[k]) for k in (0, 1)]
        return (self.normal(jump), tau[0], tau[1])

    def damage(self, jump: Jump) -> float:
        """See `Point`: 1 where open."""
        return float(self.opening(jump) > self.cap)

    def gapes(self, jump: Jump) -> bool:
        """See `Point`: beyond the largest tension."""
        return self.opening(jump) > self.cap

    def jumping(self, jump: Jump) -> float:
        """See `Point`."""
        return abs(self.opening(jump) - self.cap)

    def slip(self) -> float:
        """See `Point`."""
        return hypot(*self.s)

    def further(self) -> dict[str, float]:
        """See `Point`."""
        return {"lambda": self.lam, "joint_thickness": -max(self.sawn - self.before, 0.0)}

    def strength(self, normal: float) -> float:
        """See `Point`."""
        return float(self.c + self.c / self.mu + self.mu * abs(normal) + self.H * self.lam)
