"""Damage and plasticity coupled, section 4.4 of reference/theory.md."""

from __future__ import annotations

from math import exp, hypot, log, log1p, sqrt

from .point import Jump, Point, Values

#: Damage at which the strengths are largest.
PEAK = (sqrt(3 / 7) - 0.5) / 2.5
#: Least and largest damage of a point that yields.
LEAST, LARGEST = 1e-18, 1 - 1e-12
#: Halvings of the interval of log(alpha/(1 - alpha)).
HALVINGS = 64


def S(alpha: float) -> float:
    """S = (1 - alpha)^3/sqrt(alpha)."""
    return float((1 - alpha) ** 3 / sqrt(alpha))


def minus_dS(alpha: float) -> float:
    """-dS/d alpha."""
    return float((1 - alpha) ** 2 * (3 / sqrt(alpha) + (1 - alpha) / (2 * alpha**1.5)))


class Endo(Point):
    """A point of law = endo: damage alpha, plastic jump p."""

    def __init__(self, values: Values) -> None:
        super().__init__(values)
        self.f_t, self.c, self.mu = values["sigma_max"], values["adhesion"], values["mu"]
        self.G = values["G_f"]
        factor = minus_dS(PEAK) / (2 * self.G * S(PEAK) ** 2)
        self.B_n = factor * self.f_t**2
        self.B_t = factor * (self.c**2 - self.mu**2 * self.f_t**2)
        self.alpha, self.p = 0.0, (0.0, 0.0, 0.0)

    def plastic(self, jump: Jump, alpha: float) -> Jump:
        """The plastic jump that minimises the energy at a damage."""
        soft = S(max(alpha, LEAST))
        K, B, p0 = (self.K_N, self.K_T, self.K_T), (self.B_n, self.B_t, self.B_t), self.p
        X = [K[i] * (jump[i] - p0[i]) - soft * B[i] * p0[i] for i in range(3)]
        A_n, A_t = self.K_N + soft * self.B_n, self.K_T + soft * self.B_t
        size = hypot(X[1], X[2])
        rate = (size + self.mu * X[0]) / (A_t + self.mu**2 * A_n)
        if rate <= 0:
            return p0
        if size <= A_t * rate:  # to the apex
            return (p0[0] + X[0] / A_n, p0[1] + X[1] / A_t, p0[2] + X[2] / A_t)
        return (
            p0[0] + self.mu * rate,
            p0[1] + rate * X[1] / size,
            p0[2] + rate * X[2] / size,
        )

    def released(self, jump: Jump, alpha: float) -> float:
        """Energy that one unit of damage releases, over G_f."""
        p = self.plastic(jump, alpha)
        work = self.B_n * p[0] ** 2 + self.B_t * (p[1] ** 2 + p[2] ** 2)
        return minus_dS(max(alpha, LEAST)) * work / (2 * self.G)

    def step(self, jump: Jump, begin: float, end: float, frozen: bool) -> None:
        """See `Point`; after a step with frozen damage, the damage that the jump does."""
        if self.released(jump, self.alpha) > 1:
            least = max(self.alpha, LEAST)
            low, high = (log(a) - log1p(-a) for a in (least, LARGEST))
            for _ in range(HALVINGS):
                middle = (low + high) / 2
                if self.released(jump, 1 / (1 + exp(-middle))) > 1:
                    low = middle
                else:
                    high = middle
            self.alpha = max(self.alpha, 1 / (1 + exp(-high)))
        self.p = self.plastic(jump, self.alpha)
        self.jump = jump

    def traction(self, jump: Jump) -> Jump:
        """See `Point`."""
        K = (self.K_N, self.K_T, self.K_T)
        n, t1, t2 = (K[i] * (jump[i] - self.p[i]) for i in range(3))
        return (n, t1, t2)

    def damage(self, jump: Jump) -> float:
        """See `Point`."""
        return self.alpha

    def gapes(self, jump: Jump) -> bool:
        """See `Point`: in tension, and open by more than where linear softening would end."""
        return jump[0] > max(self.p[0], 2 * self.G / self.f_t)

    def slip(self) -> float:
        """See `Point`: the tangential part of the plastic jump."""
        return hypot(self.p[1], self.p[2])

    def strength(self, normal: float) -> float:
        """See `Point`."""
        return float(self.f_t + self.c + self.mu * max(-normal, 0.0))
