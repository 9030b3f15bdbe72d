"""Displacement and stress of the bodies, from the displacement jump of the joint."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...arrays import Array
from ...csr import CsrMatrix
from ...fem.bodies import Bodies, ElasticBody, material_of
from ...fem.elasticity import stress
from ...fem.glued_bodies import GluedBodies
from ...fem.gluing import Gluing
from ...joint.equilibrium import Equilibrium
from ...model.fields import Field
from ...solver.history import History
from ...solver.state import State


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


def eliminated_displacements(
    bodies: Bodies, states: list[tuple[Equilibrium, State]]
) -> dict[str, Array]:
    """Displacements (states, degrees of freedom) of each body in states of its equilibria.

    The glued bodies are also loaded by the forces -K_b J_b d of the jumps that a body carries; the
    water pressure in a joint acts on both joint faces and cancels.
    """
    gluing = Gluing.of(bodies)
    glued = GluedBodies.of(bodies.by_name, gluing)
    loads = np.zeros((glued.size, len(states)))
    jumps = {
        name: np.zeros((len(states), body.stiffness.shape[0]))
        for name, body in bodies.by_name.items()
    }
    for i, (equilibrium, state) in enumerate(states):
        for name, body in bodies.by_name.items():
            of_body = gluing.bodies[name]
            jumps[name][i, of_body.dofs] = of_body.jumps @ state.jump
            load = -(body.stiffness @ jumps[name][i])
            add_external_forces(load, body, equilibrium, state)
            loads[:, i] += np.bincount(glued.numbers[name], load, glued.size)
    solution = glued.solve(loads)

    return {n: solution[glued.numbers[n]].T + jumps[n] for n in bodies.by_name}


def recover(bodies: Bodies, scenes: list[tuple[Equilibrium, History]]) -> list[dict[float, Field]]:
    """Fields of the saved states of scenes on the same bodies, by scene and time. Displacements
    count from the state under the weight alone, if there is one.
    """
    states = [
        (equilibrium, state)
        for equilibrium, history in scenes
        for state in (*history.saved, *filter(None, [history.at_rest]))
    ]
    if not any(history.saved for _, history in scenes):
        return [{} for _ in scenes]
    bulk = states[0][0].bulk
    if isinstance(bulk.stiffness, CsrMatrix):  # uncondensed bodies
        from ...fem.uncondensed import Uncondensed

        assert isinstance(bulk, Uncondensed)
        parts = [bulk.displacements(state.jump) for _, state in states]
        displacements = {n: np.array([part[n] for part in parts]) for n in bodies.by_name}
    else:
        displacements = eliminated_displacements(bodies, states)
    at_locations, stresses = {}, {}
    material, dim = material_of(states[0][0].case), bodies.mesh.dim
    for name, values in displacements.items():
        body, space = bodies.by_name[name], bodies.by_name[name].space
        u = values.reshape(len(states), -1, dim)
        strains = None
        if body.unit_strains:
            strains = np.array([free_strain(body, *state) for state in states])
        stresses[name] = stress(space, u, material, strains)
        at_locations[name] = space.at_locations(u)
    nodes = {name: len(body.space.body.points) for name, body in bodies.by_name.items()}

    def fields_of(first: int, history: History) -> Iterator[tuple[float, Field]]:
        """Times and fields of a scene whose states start at a number."""
        rest = first + len(history.saved)
        start = {n: u[rest] if history.at_rest else 0 * u[0] for n, u in at_locations.items()}
        for i, state in enumerate(history.saved, first):
            moved = {name: u[i] - start[name] for name, u in at_locations.items()}
            of_time = {name: s[i] for name, s in stresses.items()}
            yield state.time, Field.of(moved, of_time, nodes)

    counts = [len(history.saved) + (history.at_rest is not None) for _, history in scenes]
    firsts = np.cumsum([0, *counts[:-1]])
    return [
        dict(fields_of(int(first), history))
        for first, (_, history) in zip(firsts, scenes, strict=True)
    ]
