"""Displacement and stress of the bodies, from the displacement jump of the joint."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from ...arrays import Array, IntArray, Sparse
from ...fem.bodies import Bodies, ElasticBody, material_of
from ...fem.elasticity import stress
from ...fem.factor import solve_symmetric
from ...joint.equilibrium import Equilibrium
from ...model.fields import Field
from ...solver.history import History
from ...solver.state import State


@dataclass(frozen=True, kw_only=True)
class GluedBodies:
    """Both bodies, glued at the joint to a single elastic body; numbers of the lower body first."""

    stiffness: Sparse
    #: degrees of freedom that are not fixed
    free: IntArray
    #: number of each degree of freedom of the upper body, and the Boolean matrix of these numbers
    number: IntArray
    from_upper: Sparse

    @staticmethod
    def of(upper: ElasticBody, lower: ElasticBody) -> GluedBodies:
        """Assemble two bodies."""
        upper_size, lower_size = upper.stiffness.shape[0], lower.stiffness.shape[0]
        number = np.full(upper_size, -1)
        number[upper.joint_dofs] = lower.joint_dofs
        own = np.flatnonzero(number < 0)
        number[own] = lower_size + np.arange(len(own))
        size = lower_size + len(own)
        from_upper = sparse.csr_matrix(
            (np.ones(upper_size), (np.arange(upper_size), number)), (upper_size, size)
        )
        empty = sparse.csr_matrix((len(own), len(own)))
        stiffness = sparse.block_diag([lower.stiffness, empty]) + (
            from_upper.T @ upper.stiffness @ from_upper
        )
        fixed = np.union1d(lower.fixed_dofs, number[upper.fixed_dofs])
        free = np.setdiff1d(np.arange(size), fixed)
        return GluedBodies(
            stiffness=stiffness.tocsr(), free=free, number=number, from_upper=from_upper
        )

    def solve(self, loads: Array) -> Array:
        """Displacements (n, m) under loads (n, m)."""
        solution = np.zeros(loads.shape)
        stiffness = self.stiffness[self.free][:, self.free]
        solution[self.free] = solve_symmetric(stiffness, loads[self.free])
        return solution


def add_external_forces(
    load: Array, body: ElasticBody, equilibrium: Equilibrium, state: State
) -> None:
    """Add water, weight and line forces of a state to the load vector (n,) of a body."""
    for name, dofs in body.face_dofs.items():
        face = equilibrium.interface.faces[name]
        np.add.at(load, dofs, equilibrium.face_forces(face, state.loading))
    for name, size in equilibrium.unit_loads(state.loading).items():
        if name in body.unit_loads:
            load += size * body.unit_loads[name]


def free_strain(body: ElasticBody, equilibrium: Equilibrium, state: State) -> Array:
    """Free thermal strain of a state at the middle of each element of a body (elements,)."""
    sizes = equilibrium.unit_loads(state.loading)
    return np.sum([sizes.get(name, 0) * unit for name, unit in body.unit_strains.items()], axis=0)


def recover(bodies: Bodies, scenes: list[tuple[Equilibrium, History]]) -> list[dict[float, Field]]:
    """Fields of the saved states of scenes on the same bodies, by scene and time. Displacements
    count from the state under the weight alone, if there is one.

    The glued bodies are also loaded by the forces -K_u jump of the jump in the upper body; the
    water pressure in the joint acts on both joint faces and cancels.
    """
    states = [
        (equilibrium, state)
        for equilibrium, history in scenes
        for state in (*history.saved, *filter(None, [history.at_rest]))
    ]
    if not any(history.saved for _, history in scenes):
        return [{} for _ in scenes]
    (joint,) = bodies.mesh.joints.values()
    upper, lower = bodies.by_name[joint.upper], bodies.by_name[joint.lower]
    lower_size = lower.stiffness.shape[0]
    glued = GluedBodies.of(upper, lower)
    jumps = np.zeros((len(states), upper.stiffness.shape[0]))
    loads = np.zeros((glued.stiffness.shape[0], len(states)))
    for i, (equilibrium, state) in enumerate(states):
        jumps[i, upper.joint_dofs[equilibrium.interface.joint.free]] = state.jump
        on_upper, on_lower = -upper.stiffness @ jumps[i], np.zeros(lower_size)
        add_external_forces(on_upper, upper, equilibrium, state)
        add_external_forces(on_lower, lower, equilibrium, state)
        loads[:, i] = glued.from_upper.T @ on_upper
        loads[:lower_size, i] += on_lower
    solution = glued.solve(loads)

    displacements = {
        joint.upper: solution[glued.number].T + jumps,
        joint.lower: solution[:lower_size].T,
    }
    at_nodes, stresses = {}, {}
    material, dim = material_of(states[0][0].case), bodies.mesh.dim
    for name, values in displacements.items():
        body, space = bodies.by_name[name], bodies.by_name[name].space
        u = values.reshape(len(states), -1, dim)
        strains = None
        if body.unit_strains:
            strains = np.array([free_strain(body, *state) for state in states])
        stresses[name] = stress(space, u, material, strains)
        at_nodes[name] = np.pad(u[:, : len(space.body.points)], ((0, 0), (0, 0), (0, 3 - dim)))

    def fields_of(first: int, history: History) -> Iterator[tuple[float, Field]]:
        """Times and fields of a scene whose states start at a number."""
        rest = first + len(history.saved)
        start = {n: u[rest] if history.at_rest else 0 * u[0] for n, u in at_nodes.items()}
        for i, state in enumerate(history.saved, first):
            moved = {name: u[i] - start[name] for name, u in at_nodes.items()}
            yield state.time, Field(moved, {name: s[i] for name, s in stresses.items()})

    counts = [len(history.saved) + (history.at_rest is not None) for _, history in scenes]
    firsts = np.cumsum([0, *counts[:-1]])
    return [
        dict(fields_of(int(first), history))
        for first, (_, history) in zip(firsts, scenes, strict=True)
    ]
