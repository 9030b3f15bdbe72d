"""What is prescribed in a step: the level, or a displacement, with the level or the factor of a
load unknown.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..arrays import Array
from ..input.case import Case
from ..input.scene import POINT
from ..joint.equilibrium import Equilibrium
from ..model.loads import LEVEL, Loading, Unknown
from .state import State


@dataclass(frozen=True)
class LevelControl:
    """The reservoir's level [m]."""

    level: float


@dataclass(frozen=True)
class DisplacementControl:
    """A displacement [m]; the level, or the factor of a load, is unknown."""

    value: float
    unknown: Unknown = field(default=LEVEL, kw_only=True)

    def measure(self, equilibrium: Equilibrium, jump: Array, loading: Loading) -> float:
        """The displacement [m] that is prescribed, at a jump (j,)."""
        return float(self.gradient(equilibrium) @ jump)

    def gradient(self, equilibrium: Equilibrium) -> Array:
        """Its derivative with the jump (j,)."""
        raise NotImplementedError

    def rate(self, equilibrium: Equilibrium, loading: Loading) -> float:
        """Its derivative with what is unknown in the loading."""
        return 0.0


@dataclass(frozen=True)
class BodyControl(DisplacementControl):
    """A displacement of the bodies, by its name among `Bodies.measures`: by default that of the
    crest along x.
    """

    name: str = "crest"

    def measure(self, equilibrium: Equilibrium, jump: Array, loading: Loading) -> float:
        """See `DisplacementControl`."""
        return equilibrium.displacement(self.name, jump, loading)

    def gradient(self, equilibrium: Equilibrium) -> Array:
        """See `DisplacementControl`."""
        return equilibrium.bulk.measures[self.name].jump

    def rate(self, equilibrium: Equilibrium, loading: Loading) -> float:
        """See `DisplacementControl`."""
        return equilibrium.displacement_rate(self.name, loading, self.unknown)


CrestControl = BodyControl


@dataclass(frozen=True)
class HeelControl(DisplacementControl):
    """The opening of the heel of the first joint."""

    def gradient(self, equilibrium: Equilibrium) -> Array:
        """See `DisplacementControl`."""
        return equilibrium.interface.joints[0].heel


@dataclass(frozen=True)
class DirectionControl(DisplacementControl):
    """How far the jumps move along a direction (j,): a sum of them with these weights."""

    direction: Array

    def gradient(self, equilibrium: Equilibrium) -> Array:
        """See `DisplacementControl`."""
        return self.direction


Control = LevelControl | DisplacementControl


class Prescribed:
    """A displacement control as a constraint on the joints of an equilibrium, see step.py."""

    def __init__(self, control: DisplacementControl, equilibrium: Equilibrium) -> None:
        self.control, self.equilibrium = control, equilibrium
        self.stiffness = equilibrium.case["K_N"] * equilibrium.bulk.width
        self.row, self.unknown = control.gradient(equilibrium), control.unknown
        #: the values that are looked for
        self.between = -np.inf, np.inf
        if self.unknown == LEVEL:
            self.between = 0.0, equilibrium.case.highest_level

    def gap(self, jump: Array, loading: Loading) -> float:
        """See `Constraint`."""
        return self.control.value - self.control.measure(self.equilibrium, jump, loading)

    def rate(self, loading: Loading) -> float:
        """See `Constraint`."""
        return self.control.rate(self.equilibrium, loading)


def drive_of(case: Case, value: float = 0.0) -> DisplacementControl:
    """The control of a case by its parameter `drive`, at a displacement [m]."""
    unknown = Unknown(case["drive_load"])
    if case["drive"] == "heel":
        return HeelControl(value, unknown=unknown)
    name = f"{POINT}_{case['drive_direction']}" if case["drive"] == "point" else "crest"
    return BodyControl(value, name, unknown=unknown)


def process_zone(equilibrium: Equilibrium, state: State) -> Array | None:
    """The mean jump of the points whose damage has grown in the step to a state, weighted by that
    growth, from the unknowns (j,): the opening of open ones, the slip of closed ones, each in the
    direction of that step; None if no damage has grown.
    """
    if state.previous is None:
        return None
    laws, interface = equilibrium.laws, equilibrium.interface
    ends = state.previous, state
    jumps = [interface.jumps(interface.at_points, end.jump) for end in ends]
    before, after = (
        laws.damage(jump, end.variables) for jump, end in zip(jumps, ends, strict=True)
    )
    opened = np.array([True, False, False]) == (jumps[1][:, :1] > 0)
    direction = (jumps[1] - jumps[0]) * opened
    size = np.linalg.norm(direction, axis=1)
    weights = interface.weights * np.maximum(after - before, 0) * (size > 0)
    if not weights.any():
        return None
    direction *= (weights / np.where(size > 0, size, 1) / weights.sum())[:, None]
    return interface.at_points.T @ direction[:, : interface.dim].ravel()
