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

    def stiffness(self, equilibrium: Equilibrium) -> float:
        """The weight of what is missing of it in the norm of the residual, N over its unit: that
        of the closed joints.
        """
        return float(equilibrium.case["K_N"] * equilibrium.interface.weights.sum())


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


@dataclass(frozen=True)
class DissipationControl(DisplacementControl):
    """The energy that is dissipated in a step [N m per m of thickness], with a small part of the
    work of the load of unknown factor, by which it grows where nothing breaks, too: the area that
    the path of factor lambda and work U of the load of factor 1 sweeps about (U, -shift),
    ((lambda_0 + shift) U - (lambda + shift) U_0) / 2, from lambda_0, U_0 at the step's beginning
    [Gutierrez 2004; Verhoosel, Remmers, Gutierrez 2009]. Exact where unloading goes to U = 0.
    """

    #: lambda_0 + shift, U_0, and U before the control began
    factor: float = 0.0
    work: float = 0.0
    begun: float = 0.0
    shift: float = 0.0

    def measure(self, equilibrium: Equilibrium, jump: Array, loading: Loading) -> float:
        """See `DisplacementControl`."""
        work = work_of(equilibrium, jump, loading) - self.begun
        return (self.factor * work - (self.unknown.of(loading) + self.shift) * self.work) / 2

    def gradient(self, equilibrium: Equilibrium) -> Array:
        """See `DisplacementControl`."""
        row = sum(
            size * equilibrium.bulk.measures[name].jump for name, size in load_of(equilibrium)
        )
        return np.asarray(self.factor / 2 * row)

    def rate(self, equilibrium: Equilibrium, loading: Loading) -> float:
        """See `DisplacementControl`."""
        by_load = sum(
            size * equilibrium.displacement_rate(name, loading, self.unknown)
            for name, size in load_of(equilibrium)
        )
        return (self.factor * by_load - self.work) / 2

    def stiffness(self, equilibrium: Equilibrium) -> float:
        """See `DisplacementControl`."""
        return float(np.linalg.norm(self.gradient(equilibrium))) / abs(self.value)


def load_of(equilibrium: Equilibrium) -> list[tuple[str, float]]:
    """The components of the load of unknown factor, as unit loads, and their sizes."""
    load = equilibrium.case["drive_load"]
    return [(f"{load}_{axis}", equilibrium.case[f"{load}_{axis}"]) for axis in "xy"]


def work_of(equilibrium: Equilibrium, jump: Array, loading: Loading) -> float:
    """The work of the load of unknown factor, for the factor 1 [N m per m of thickness]."""
    return sum(
        size * equilibrium.displacement(name, jump, loading) for name, size in load_of(equilibrium)
    )


Control = LevelControl | DisplacementControl


class Prescribed:
    """A displacement control as a constraint on the joints of an equilibrium, see step.py."""

    def __init__(self, control: DisplacementControl, equilibrium: Equilibrium) -> None:
        self.control, self.equilibrium = control, equilibrium
        self.stiffness = control.stiffness(equilibrium)
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
