"""What is prescribed in a step: the level, or a displacement, with the level or the factor of a
load unknown.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from .. import ROUND_OFF
from ..arrays import Array, BoolArray
from ..input.case import Case
from ..input.scene import POINT
from ..joint.equilibrium import Equilibrium
from ..joint.interface import Interface
from ..joint.joint_laws import JointLaws, JointVariables
from ..model.loads import LEVEL, Loading, Unknown
from .state import State

#: Relative difference of two displacements up to which they are the same [-], a few times what
#: rounding their last digits makes of it: no iteration reduces it, and over stiff joints it is more
#: than the tolerance of the residual.
LAST_DIGITS = 4 * np.finfo(float).eps


@dataclass(frozen=True)
class LevelControl:
    """The reservoir's level [m]."""

    level: float

    @property
    def key(self) -> Hashable:
        """What tells it from others of its kind."""
        return self.level


@dataclass(frozen=True)
class DisplacementControl:
    """A displacement [m]; the level, or the factor of a load, is unknown."""

    value: float
    unknown: Unknown = field(default=LEVEL, kw_only=True)

    def measure(self, equilibrium: Equilibrium, jump: Array, loading: Loading) -> float:
        """The displacement [m] that is prescribed, at a jump (j,)."""
        return float(self.gradient(equilibrium, jump) @ jump)

    def gradient(self, equilibrium: Equilibrium, jump: Array) -> Array:
        """Its derivative with the jump (j,), at a jump (j,)."""
        raise NotImplementedError

    @property
    def key(self) -> Hashable:
        """What tells it from others of its kind, with the same unknown."""
        return self.value

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

    def gradient(self, equilibrium: Equilibrium, jump: Array) -> Array:
        """See `DisplacementControl`."""
        return equilibrium.bulk.measures[self.name].jump

    def rate(self, equilibrium: Equilibrium, loading: Loading) -> float:
        """See `DisplacementControl`."""
        return equilibrium.displacement_rate(self.name, loading, self.unknown)


@dataclass(frozen=True)
class HeelControl(DisplacementControl):
    """The opening of the heel of the first joint."""

    def gradient(self, equilibrium: Equilibrium, jump: Array) -> Array:
        """See `DisplacementControl`."""
        return equilibrium.interface.joints[0].heel


@dataclass(frozen=True)
class DirectionControl(DisplacementControl):
    """How far the jumps move along a direction (j,): a sum of them with these weights."""

    direction: Array

    @property
    def key(self) -> Hashable:
        """See `DisplacementControl`."""
        return self.value, self.direction.tobytes()

    def gradient(self, equilibrium: Equilibrium, jump: Array) -> Array:
        """See `DisplacementControl`."""
        return self.direction


@dataclass(frozen=True, kw_only=True)
class DissipationControl(DisplacementControl):
    """The energy that the joints dissipate in a step [N m per m of thickness]: the work of their
    tractions, by the mean of those at its ends, less what they give back when they unload
    [Gutierrez 2004; Verhoosel, Remmers, Gutierrez 2009]. To it comes a small part that grows with
    what is unknown, by which the path goes on where nothing breaks, too.
    """

    laws: JointLaws
    interface: Interface
    #: the internal variables and the jump (j,) at the step's beginning
    variables: JointVariables
    begin: Array
    #: what is unknown there, and the part of it in the energy [N m per m over its unit]
    unknown_at_begin: float
    shift: float
    #: what the residual is measured by [N]
    reference: float

    def measure(self, equilibrium: Equilibrium, jump: Array, loading: Loading) -> float:
        """See `DisplacementControl`."""
        (before, t0, _), (now, t, _) = self.at_begin, self.at(jump)
        compliance, plastic = self.unloading
        energy = t0 * (now - plastic * before + compliance * t0)
        energy -= t * (before - plastic * now + compliance * t)
        joints = self.interface
        swept = joints.weights @ energy.sum(axis=1) / 2 / joints.joints[0].width
        return float(swept + self.shift * (self.unknown.of(loading) - self.unknown_at_begin))

    def gradient(self, equilibrium: Equilibrium, jump: Array) -> Array:
        """See `DisplacementControl`."""
        (before, t0, _), (now, t, tangent) = self.at_begin, self.at(jump)
        compliance, plastic = self.unloading
        by_traction = before - plastic * now + 2 * compliance * t
        to_origin = plastic[:, 0] == 0
        by_jump = t0.copy()
        by_jump[to_origin & (now[:, 0] <= 0), 0] = 0
        by_traction[to_origin & (t[:, 0] <= 0), 0] = 0
        rate = by_jump + plastic * t - np.einsum("qji,qj->qi", tangent, by_traction)
        joints = self.interface
        return np.asarray(joints.forces(rate) / 2 / joints.joints[0].width)

    def rate(self, equilibrium: Equilibrium, loading: Loading) -> float:
        """See `DisplacementControl`."""
        return self.shift

    def stiffness(self, equilibrium: Equilibrium) -> float:
        """See `DisplacementControl`."""
        return self.reference / abs(self.value)

    @cached_property
    def at_begin(self) -> tuple[Array, Array, Array]:
        """`at` the step's beginning."""
        return self.at(self.begin)

    def at(self, jump: Array) -> tuple[Array, Array, Array]:
        """Jumps (q, 3) of the points less what has been released, tractions (q, 3) and tangents
        (q, 3, 3) at a jump (j,); without contact, which is elastic.
        """
        jumps = self.interface.jumps(self.interface.at_points, jump)
        traction, tangent = self.laws.evaluate(jumps, self.variables)
        jumps = jumps - self.released
        to_origin = self.unloading[1][:, 0] == 0
        for values in jumps, traction:
            values[to_origin, 0] = np.maximum(values[to_origin, 0], 0)
        return jumps, traction, tangent()

    @cached_property
    def released(self) -> Array:
        """`Law.released_jump` of the points (q, 3)."""
        return self.laws.released_jump(self.variables)

    @cached_property
    def unloading(self) -> tuple[Array, Array]:
        """The compliance (q, 3) of elastic unloading from a plastic jump [m/Pa], and whether
        (1, 0) there is one along this axis: else tractions unload to the origin.
        """
        compliance = self.laws.unloading_compliance(self.variables)
        return compliance, (compliance > 0).astype(float)


Control = LevelControl | DisplacementControl


class Prescribed:
    """A displacement control as a constraint on the joints of an equilibrium, see step.py."""

    def __init__(self, control: DisplacementControl, equilibrium: Equilibrium) -> None:
        self.control, self.equilibrium = control, equilibrium
        self.stiffness = control.stiffness(equilibrium)
        self.unknown = control.unknown
        #: the values that are looked for
        self.between = -np.inf, np.inf
        if self.unknown == LEVEL:
            self.between = 0.0, equilibrium.case.highest_level

    def gap(self, jump: Array, loading: Loading) -> float:
        """See `Constraint`; none if it is that of the last digits."""
        value, measured = self.control.value, self.control.measure(self.equilibrium, jump, loading)
        gap = value - measured
        return 0.0 if abs(gap) <= LAST_DIGITS * max(abs(value), abs(measured)) else gap

    def row(self, jump: Array) -> Array:
        """See `Constraint`."""
        return self.control.gradient(self.equilibrium, jump)

    def rate(self, loading: Loading) -> float:
        """See `Constraint`."""
        return self.control.rate(self.equilibrium, loading)


def drive_control(case: Case, value: float = 0.0) -> DisplacementControl:
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
    return mean_along(interface, direction, interface.weights * np.maximum(after - before, 0))


def mean_slip(equilibrium: Equilibrium, state: State) -> Array | None:
    """The mean slip of the points that have slipped in the step to a state, each in the direction
    of that step, from the unknowns (j,); None if none has.
    """
    if state.previous is None:
        return None
    interface = equilibrium.interface
    direction = interface.jumps(interface.at_points, state.jump - state.previous.jump)
    direction[:, 0] = 0
    return mean_along(interface, direction, interface.weights)


def mean_along(interface: Interface, direction: Array, weights: Array) -> Array | None:
    """The mean jump of points along the direction (q, 3) of each, from the unknowns (j,): of those
    that have one, with weights (q,); None if none counts.
    """
    size = np.linalg.norm(direction, axis=1)
    weights = weights * (size > 0)
    if not weights.any():
        return None
    direction = direction * (weights / np.where(size > 0, size, 1) / weights.sum())[:, None]
    return interface.at_points.T @ direction[:, : interface.dim].ravel()


def crack_tip(equilibrium: Equilibrium, state: State) -> tuple[Array, float] | None:
    """The opening, from the unknowns (j,), of the point that opens next, and how far it is from its
    next stage [m], see `Law.stages`: of the points that are not broken, or that release their
    shear, the one with the largest jump; None if it does not open in the step to a state, or has no
    further stage.
    """
    if state.previous is None:
        return None
    interface, variables = equilibrium.interface, state.variables
    before, after = (
        interface.jumps(interface.at_points, end.jump) for end in (state.previous, state)
    )
    laws = equilibrium.laws.laws
    parts = zip(laws, variables.split(after), variables.joints, strict=True)
    opens = list[BoolArray]()
    for law, jump, own in parts:
        released = law.released_part(jump, own)
        releases = (released > 0) & (released < 1)
        opens.append(law.releases_shear & (releases | (law.damage(jump, own) < 1)))
    opening = np.where(np.concatenate(opens), after[:, 0], -np.inf)
    point = int(np.argmax(opening))
    number = int(np.searchsorted(variables.starts, point, side="right")) - 1
    stages = [stage for stage in laws[number].stages if stage > (1 + ROUND_OFF) * opening[point]]
    if not stages or not opening[point] > before[point, 0]:
        return None
    direction = np.zeros((len(after), interface.dim))
    direction[point, 0] = 1.0
    return interface.at_points.T @ direction.ravel(), stages[0] - float(opening[point])
