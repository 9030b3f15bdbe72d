"""Converged states: what a step starts from and leads to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arrays import Array
from ..joint.equilibrium import Equilibrium
from ..joint.flow_in_time import StoredWater
from ..joint.interface import Interface
from ..joint.joint_laws import JointLaws, JointVariables
from ..joint.water import BeforeQuake, Pressure
from ..model.loads import Loading


@dataclass(frozen=True)
class StepLaws:
    """The laws of the joints in a step, at the integration points and at the nodes: the same, or
    with the damage frozen that each point has.
    """

    points: JointLaws
    nodes: JointLaws


@dataclass(frozen=True)
class State:
    """A converged state, with the internal variables of the law's points and of the nodes."""

    time: float
    loading: Loading
    #: the unknowns (j,) [m]
    jump: Array
    variables: JointVariables
    #: by `rows` of each joint
    node_variables: JointVariables
    #: of the water in each joint; the aperture of what had broken before the step lets it in
    pressures: tuple[Pressure, ...] = ()
    #: what is stored where water flows in time
    stored: tuple[StoredWater, ...] = ()
    #: the joints before the earthquake that acts, if the water follows from them
    before_quake: BeforeQuake | None = None
    #: the state before this one; of that the one before is not kept
    previous: State | None = None
    #: the updates that led to it, of a case with `all_steps`
    trace: Trace | None = None

    @staticmethod
    def undamaged(equilibrium: Equilibrium) -> State:
        """Before any load."""
        joints, laws = equilibrium.interface.joints, equilibrium.laws
        numbers = [len(j.points.weights) for j in joints], [len(j.rows) for j in joints]
        jump = np.zeros(equilibrium.bulk.size)
        points, nodes = (laws.initial(n) for n in numbers)
        return State(0.0, Loading(0.0, 0.0), jump, points, nodes)

    def traced(self, begin: State, frozen: bool, control: Any = None) -> State:
        """This state with the update that has led to it from another one; frozen: whether by the
        laws with frozen damage; control: what was prescribed.
        """
        if begin.trace is None:
            return self
        update = replace(self, previous=None, trace=None)
        return replace(self, trace=Trace(update, begin.time, frozen, begin.trace, control))

    def after(self, previous: State) -> State:
        """This state, as the one that follows another."""
        return replace(self, previous=replace(previous, previous=None))

    def begin_step(self, laws: JointLaws, time: float) -> State:
        """The state with the internal variables for a step to a time."""
        both = self.variables, self.node_variables
        points, nodes = (laws.begin_step(v, self.time, time) for v in both)
        return replace(self, variables=points, node_variables=nodes)

    def freeze(self, equilibrium: Equilibrium) -> StepLaws:
        """The laws with the damage frozen that this state's jump leads to."""
        points, nodes = both_jumps(equilibrium.interface, self.jump)
        laws = equilibrium.laws
        return StepLaws(
            laws.freeze(points, self.variables), laws.freeze(nodes, self.node_variables)
        )

    def update(self, interface: Interface, laws: StepLaws, jump: Array) -> State:
        """The state with a jump (j,), and the internal variables after it."""
        points, nodes = both_jumps(interface, jump)
        return replace(
            self,
            jump=jump,
            variables=laws.points.update_internal_variables(points, self.variables),
            node_variables=laws.nodes.update_internal_variables(nodes, self.node_variables),
        )


def both_jumps(interface: Interface, jump: Array) -> tuple[Array, Array]:
    """The jump at the laws' points and at the nodes, (q, 3) each."""
    return interface.jumps(interface.at_points, jump), interface.jumps(interface.at_nodes, jump)


@dataclass(frozen=True)
class Trace:
    """An update of the internal variables, and all before it."""

    state: State
    #: time at which its step began
    begin: float = 0.0
    #: whether by the laws with frozen damage
    frozen: bool = False
    #: None: of the undamaged joints
    before: Trace | None = None
    #: of `solver.controls`; None: of an earthquake
    control: Any = None

    @staticmethod
    def start(state: State) -> State:
        """The undamaged state, from which on updates are recorded."""
        return replace(state, trace=Trace(state))

    @property
    def updates(self) -> list[Trace]:
        """All updates, the first one first."""
        updates, one = list[Trace](), self
        while one.before is not None:
            updates.append(one)
            one = one.before
        return updates[::-1]
