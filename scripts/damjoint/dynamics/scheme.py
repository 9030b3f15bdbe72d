"""Time integration by the method of Hilber, Hughes and Taylor (1977) [HHT].

M w1'' + (1 + alpha) X1 - alpha X0 = (1 + alpha) F1 - alpha F0, with X the forces of damping,
stiffness and joints, Newmark's differences (1959), beta = (1 - alpha)^2/4 and gamma = 1/2 - alpha.
alpha = 0 is Newmark's average acceleration.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, IntArray


@dataclass(frozen=True)
class Motion:
    """Displacement from the static state, velocity, acceleration (n,), relative to the ground."""

    displacement: Array
    velocity: Array
    acceleration: Array

    @staticmethod
    def at_rest(size: int) -> Motion:
        """No motion."""
        return Motion(*np.zeros((3, size)))

    def at(self, unknowns: IntArray) -> Motion:
        """That of some unknowns."""
        parts = self.displacement, self.velocity, self.acceleration
        return Motion(*(part[unknowns] for part in parts))


@dataclass(frozen=True)
class HHT:
    """The scheme for a parameter alpha in [-1/3, 0]."""

    alpha: float
    #: False: Newmark's method with the beta and gamma of alpha and equilibrium at the end of the
    #: step, which is of first order only
    weighted: bool = True

    @property
    def shift(self) -> float:
        """Alpha in the equilibrium."""
        return self.alpha if self.weighted else 0.0

    @property
    def beta(self) -> float:
        """Newmark's beta."""
        return (1 - self.alpha) ** 2 / 4

    @property
    def gamma(self) -> float:
        """Newmark's gamma."""
        return 0.5 - self.alpha

    def rates(self, dt: float) -> tuple[float, float]:
        """Derivatives of velocity and acceleration at the end of a step with the displacement."""
        return self.gamma / (self.beta * dt), 1 / (self.beta * dt**2)

    def history(self, motion: Motion, dt: float) -> tuple[Array, Array]:
        """What a motion before a step of dt leaves of velocity and acceleration at its end:
        velocity = rates[0] displacement - history[0], likewise the acceleration.
        """
        w, v, a = motion.displacement, motion.velocity, motion.acceleration
        of_acceleration = (w / dt + v) / (self.beta * dt) + (1 / (2 * self.beta) - 1) * a
        of_velocity = self.gamma * dt * of_acceleration - v - dt * (1 - self.gamma) * a
        return of_velocity, of_acceleration

    def step(self, motion: Motion, displacement: Array, dt: float) -> Motion:
        """The motion after a step to a displacement."""
        velocity_rate, acceleration_rate = self.rates(dt)
        of_velocity, of_acceleration = self.history(motion, dt)
        return Motion(
            displacement,
            velocity_rate * displacement - of_velocity,
            acceleration_rate * displacement - of_acceleration,
        )
