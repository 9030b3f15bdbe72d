"""Cohesive rupture with grouting and sawing, section 4.1 of reference/theory.md."""

from __future__ import annotations

from math import hypot, inf, pi, tan

from .point import Jump, Point, Values, damage_after, ramp

#: Regularisation length of the shear release, over the height of the dam.
RELEASE = 1e-13
#: Rounding of an opening over the lengths of which it is the difference.
ROUNDING = 1e-15


class Rupture(Point):
    """A point of law = rupture: largest opening kappa, tangential jump at the last release."""

    def __init__(self, values: Values) -> None:
        super().__init__(values)
        P, self.f_t = values["pena_rupture"], values["sigma_max"]
        self.contact = values["pena_contact"] * self.K_N
        self.delta_e = self.f_t / self.K_N
        self.L_C = (1 + P) * self.delta_e
        self.sigma_c = self.f_t * (1 + P) / P
        alpha, shortest = values["alpha"], RELEASE * values["dam_height"]
        self.L_CT = inf if alpha == 2 else max(self.L_C * tan(alpha * pi / 4), shortest)
        self.p_g, self.grout_t = values["grout_pressure"], values["grout_t"]
        self.saw, self.saw_t = values["saw_thickness"], values["saw_t"]
        self.curve = values["softening"]
        self.kappa, self.released = self.delta_e, (0.0, 0.0)
        #: thickness of the grout; the opening before sawing; of the saw [m]
        self.grout, self.before, self.sawn = 0.0, 0.0, 0.0

    def thickness(self) -> float:
        """Thickness that grout adds and the saw takes off, < 0 [m]."""
        return self.grout - self.sawn if self.p_g else -max(self.sawn - self.before, 0.0)

    def opening(self, jump: Jump) -> float:
        """The opening beyond that thickness [m]."""
        return jump[0] - self.thickness()

    def shear_share(self, opening: float) -> float:
        """What is left of the shear stiffness at an opening."""
        return 1.0 if opening <= 0 else max(0.0, 1 - opening / self.L_CT)

    def step(self, jump: Jump, begin: float, end: float, frozen: bool) -> None:
        """See `Point`."""
        self.sawn = self.saw * ramp(end, self.saw_t)
        liquid = self.p_g and begin < self.grout_t and end > self.grout_t - 1
        # of a liquid grout: at most the opening -p/(beta K_N)
        least = -self.p_g * ramp(end, self.grout_t) / self.contact if liquid else inf
        share = self.shear_share(min(self.opening(self.jump), least))
        if liquid:
            self.grout = max(self.grout, jump[0] + self.sawn - least)
        opening = self.opening(jump)
        if (share if frozen else self.shear_share(opening)) <= 0:
            self.released = jump[1:]
        self.kappa = max(self.kappa, opening)
        if self.saw and not self.sawn:
            self.before = max(jump[0], 0.0)
        self.jump = jump

    def broken(self, opening: float) -> bool:
        """Whether the tensile strength is lost."""
        ends = self.curve == "linear" or not self.f_t
        ended = ends and max(opening, self.kappa) >= self.L_C
        return ended or self.sawn > 0

    def stress(self, kappa: float) -> float:
        """The stress on the softening curve [Pa]."""
        if self.curve == "linear":
            return self.sigma_c * (1 - kappa / self.L_C)
        return self.f_t * (1 - self.lost(kappa))

    def lost(self, kappa: float) -> float:
        """The part of the strength that is lost on it."""
        return damage_after((kappa - self.delta_e) / (self.L_C - self.delta_e), self.curve)

    def traction(self, jump: Jump) -> Jump:
        """See `Point`."""
        opening = self.opening(jump)
        if opening <= 0:
            normal = self.contact * opening
        elif self.broken(opening):
            normal = 0.0
        elif opening <= self.kappa:
            normal = self.stress(self.kappa) * opening / self.kappa
        else:
            normal = self.stress(opening)
        K_t = self.K_T * self.shear_share(opening)
        return (normal, K_t * (jump[1] - self.released[0]), K_t * (jump[2] - self.released[1]))

    def damage(self, jump: Jump) -> float:
        """See `Point`."""
        if self.broken(self.opening(jump)) and self.kappa > 0:
            return 1.0
        return self.lost(self.kappa) if self.L_C else 0.0

    def gapes(self, jump: Jump) -> bool:
        """See `Point`: open, after an opening where linear softening ends."""
        opening = self.opening(jump)
        return opening > 0 and (max(opening, self.kappa) >= self.L_C or self.sawn > 0)

    def slip(self) -> float:
        """See `Point`."""
        return hypot(*self.released)

    def further(self) -> dict[str, float]:
        """See `Point`."""
        return {"joint_thickness": self.thickness()}

    def shear_rounding(self, jump: Jump) -> float:
        """See `Point`: within the release of the shear, which may be shorter than 1e-11 m."""
        rounding = ROUNDING * (abs(jump[0]) + self.grout + self.sawn)
        if not -rounding < self.opening(jump) < self.L_CT + rounding:
            return 0.0
        slip = hypot(jump[1] - self.released[0], jump[2] - self.released[1])
        return self.K_T * slip * rounding / self.L_CT

    def strength(self, normal: float) -> float:
        """See `Point`: contact and elastic shear have no bound."""
        return float(self.f_t + abs(normal))
