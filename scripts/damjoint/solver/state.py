"""Converged states: what a step starts from and leads to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arrays import Array
from ..joint.equilibrium import Equilibrium, Pressure, Still
from ..laws import Law
from ..model.loads import Loading


@dataclass(frozen=True)
class Frozen:
    """The joint's law with frozen damage, at its integration points and at its nodes."""

    points: Law[Any]
    nodes: Law[Any]


@dataclass(frozen=True)
class State:
    """A converged state, with the internal variables of the law's points and of the nodes."""

    time: float
    loading: Loading
    #: the unknowns (j,) [m]
    jump: Array
    variables: Any
    #: by `rows` of the interface
    node_variables: Any
    #: of the water in the joint; the aperture of what had broken before the step lets it in
    pressure: Pressure | None = None
    #: the joint before the earthquake that acts, if the water follows from it
    still: Still | None = None
    #: the state before, without its own
    previous: State | None = None

    @staticmethod
    def undamaged(equilibrium: Equilibrium) -> State:
        """Before any load."""
        law, interface = equilibrium.law, equilibrium.interface
        number = len(interface.points.weights), len(interface.rows)
        jump = np.zeros(len(equilibrium.bulk.stiffness))
        return State(0.0, Loading(0.0, 0.0), jump, *(law.initial(n) for n in number))

    def after(self, previous: State) -> State:
        """This state, as the one that follows another."""
        return replace(self, previous=replace(previous, previous=None))

    def begin_step(self, law: Law[Any], time: float) -> State:
        """The state with the internal variables for a step to a time."""
        both = self.variables, self.node_variables
        points, nodes = (law.begin_step(v, self.time, time) for v in both)
        return replace(self, variables=points, node_variables=nodes)

    def freeze(self, equilibrium: Equilibrium) -> Frozen:
        """The law with the damage frozen that this state's jump leads to."""
        points, nodes = both_jumps(equilibrium, self.jump)
        law = equilibrium.law
        return Frozen(law.freeze(points, self.variables), law.freeze(nodes, self.node_variables))

    def update(self, equilibrium: Equilibrium, jump: Array, frozen: Frozen | None) -> State:
        """The state with a jump, and the internal variables after it."""
        points, nodes = both_jumps(equilibrium, jump)
        laws = frozen or Frozen(equilibrium.law, equilibrium.law)
        return replace(
            self,
            jump=jump,
            variables=laws.points.update_internal_variables(points, self.variables),
            node_variables=laws.nodes.update_internal_variables(nodes, self.node_variables),
        )


def both_jumps(equilibrium: Equilibrium, jump: Array) -> tuple[Array, Array]:
    """The jump at the law's points and at the nodes, (q, 3) each."""
    interface = equilibrium.interface
    return interface.jumps(interface.at_points, jump), interface.jumps(interface.at_nodes, jump)
