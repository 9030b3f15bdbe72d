"""The softening curves of the laws bond and rupture, as in pro/softening.pro.

What remains of a strength follows from the progress xi: the opening beyond the strength, or the
slip, over the length at which linear softening of the same energy ends. The area below what remains
is 1/2 on both curves, so that the fracture energies do not depend on the curve.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array


class Linear:
    """1 - xi, up to xi = 1."""

    name = "linear"
    #: progress [-] from which on nothing remains
    end = 1.0
    #: largest slope of what remains [-]
    steepest = 1.0

    def remaining(self, progress: Array) -> Array:
        """What remains of a strength (q,), 1 to 0."""
        return 1 - progress

    def damage(self, progress: Array) -> Array:
        """What is lost of it (q,), 0 to 1."""
        return progress

    def rate(self, progress: Array) -> Array:
        """Derivative of the damage with the progress (q,)."""
        return np.ones_like(progress)

    def unloading(
        self, progress: Array, strength: float, begin: float, end: float
    ) -> tuple[Array, Array]:
        """Slope of the line from the origin to the curve [Pa/m], and its derivative with the
        progress (q,); strength [Pa] at the opening begin [m], progress 1 at the opening end.
        """
        opening = begin + progress * (end - begin)
        return strength * (1 - progress) / opening, -strength * end / opening**2

    def slip(
        self, excess: Array, stiffness: float, strength: float, progress: Array, per_slip: float
    ) -> Array:
        """The slip s (q,) [m] at which excess - stiffness s is what remains of a strength, after a
        progress that grows by per_slip s; without meaning if excess < strength remaining(progress).
        """
        return (excess - strength * (1 - progress)) / (stiffness - strength * per_slip)


class Exponential(Linear):
    """exp(-2 xi): in pure opening the traction of CZM_EXP_REG [R7.02.11]."""

    name = "exponential"
    #: less than the rounding of a strength
    end = 20.0
    steepest = 2.0

    def remaining(self, progress: Array) -> Array:
        """See `Linear`."""
        return np.asarray(np.exp(-2 * np.maximum(progress, 0)))

    def damage(self, progress: Array) -> Array:
        """See `Linear`."""
        return np.asarray(-np.expm1(-2 * progress))

    def rate(self, progress: Array) -> Array:
        """See `Linear`."""
        return 2 * self.remaining(progress)

    def unloading(
        self, progress: Array, strength: float, begin: float, end: float
    ) -> tuple[Array, Array]:
        """See `Linear`."""
        opening = begin + progress * (end - begin)
        stiffness = strength * self.remaining(progress) / opening
        return stiffness, -stiffness * (2 + (end - begin) / opening)

    def slip(
        self, excess: Array, stiffness: float, strength: float, progress: Array, per_slip: float
    ) -> Array:
        """See `Linear`: u = 2 per_slip s is the root of u + q (exp(-u) - 1) = v, q < 1; Newton's
        method from above, where it is monotone.
        """
        remaining = strength * self.remaining(progress)
        if not per_slip:
            return (excess - remaining) / stiffness
        scale = 2 * per_slip / stiffness
        q, v = scale * remaining, np.maximum(scale * (excess - remaining), 0)
        u = 2 * v / (1 - q + np.sqrt((1 - q) ** 2 + 4 / 3 * q * v))  # exp(-u) > 1 - u + u^2/3
        u = np.where(u <= 1, u, v + q)
        for _ in range(NEWTON_STEPS):
            u = u - (u + q * np.expm1(-u) - v) / (1 - q * np.exp(-u))
        return np.asarray(u / (2 * per_slip))


#: Steps of Newton's method [-]: the largest relative error after three is 3e-8.
NEWTON_STEPS = 5
#: By the parameter `softening`.
CURVES: dict[str, Linear] = {curve.name: curve for curve in (Linear(), Exponential())}
