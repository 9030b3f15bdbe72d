"""Newmark's (1965) rigid block on the joint, under the same record."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from .record import Record

#: Steps in the shortest interval of a record.
REFINEMENT = 20


@dataclass(frozen=True, kw_only=True)
class RigidBlock:
    """A block that the joint's largest shear force mu N + cohesion holds."""

    #: static forces on the joint, N (compression > 0) and T (downstream > 0) [N/m]
    normal: float
    shear: float
    #: friction coefficient, and the force of cohesion [N/m]
    friction: float
    cohesion: float
    #: mass [kg/m]; forces of unit ground accelerations along x and y (2,) on the joint [kg/m]
    mass: float
    shear_by_ground: Array
    normal_by_ground: Array

    def slip(self, record: Record) -> float | None:
        """The slip [m] at the end of a record, downstream > 0; None if the static loads move it.

        Piecewise constant forces; friction implicit, so that the block stops without oscillating.
        """
        if abs(self.shear) > self.friction * self.normal + self.cohesion:
            return None
        dt = record.interval / REFINEMENT
        times = np.arange(dt / 2, record.duration, dt)
        ground = np.column_stack(
            [np.interp(times, record.times, column) for column in record.acceleration.T]
        )
        pushing = self.shear - ground @ self.shear_by_ground
        normal = np.maximum(self.normal + ground @ self.normal_by_ground, 0)
        holding = dt * np.maximum(self.friction * normal + self.cohesion, 0) / self.mass
        slip = velocity = 0.0
        for push, most in zip(dt * pushing / self.mass, holding, strict=True):
            trial = velocity + push
            now = float(np.sign(trial) * max(abs(trial) - most, 0.0))
            slip += dt * (velocity + now) / 2
            velocity = now
        return slip
