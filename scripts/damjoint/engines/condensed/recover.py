"""Displacement and stress of the bodies, from the joint's jump."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from ...fem.condensation import Bodies, body_of, material_of, unit_loads, unknowns
from ...fem.elasticity import stress
from ...fem.factor import solve_symmetric
from ...joint.equilibrium import Equilibrium
from ...model.fields import Field
from ...solver.history import History


def recover(bodies: Bodies, scenes: list[tuple[Equilibrium, History]]) -> list[dict[float, Field]]:
    """The fields of the saved states of scenes on the same bodies, by scene and time: the bulk
    solved once more. Displacements count from the state under the weight alone, if there is one.

    Dam and foundation glued at the joint are one elastic body, loaded besides by the forces that
    the jump needs in the dam, -K_dam jump; the water in the joint acts on both lips and cancels.
    """
    dim, stiff_dam = bodies.dim, bodies.stiffness["dam"]
    sizes = stiff_dam.shape[0], bodies.stiffness["foundation"].shape[0]
    # glue: each unknown of the dam in the numbering of the whole, the foundation's first
    lips = {name: unknowns(functions, dim) for name, functions in bodies.joint.items()}
    glue = np.full(sizes[0], -1)
    glue[lips["dam"]] = lips["foundation"]
    own = np.flatnonzero(glue < 0)
    glue[own] = sizes[1] + np.arange(len(own))
    total = sizes[1] + len(own)
    ones = np.ones(sizes[0])
    spread = sparse.csr_matrix((ones, (np.arange(sizes[0]), glue)), (sizes[0], total))
    nothing = sparse.csr_matrix((len(own), len(own)))
    whole = sparse.block_diag([bodies.stiffness["foundation"], nothing]) + (
        spread.T @ stiff_dam @ spread
    )
    held = np.union1d(bodies.held["foundation"], glue[bodies.held["dam"]])
    free = np.setdiff1d(np.arange(total), held)

    states = [
        (joint, state)
        for joint, record in scenes
        for state in (*record.saved, *filter(None, [record.at_rest]))
    ]
    if not any(record.saved for _, record in scenes):
        return [{} for _ in scenes]
    case = states[0][0].case
    units = {name: unit_loads(bodies, name) for name in bodies.spaces}
    jumps = np.zeros((len(states), sizes[0]))
    rights = np.zeros((total, len(states)))
    for i, (joint, state) in enumerate(states):
        jumps[i, lips["dam"][joint.bulk.free]] = state.jump
        load = {"dam": -stiff_dam @ jumps[i], "foundation": np.zeros(sizes[1])}
        for name, face in joint.interface.faces.items():
            body, places = body_of(bodies.mesh.faces[name]), unknowns(bodies.faces[name], dim)
            np.add.at(load[body], places, joint.face_forces(face, state.loading))
        for name, size in joint.units_of(state.loading).items():
            for body, columns in units.items():
                if name in columns:
                    load[body] += size * columns[name]
        rights[:, i] = spread.T @ load["dam"]
        rights[: sizes[1], i] += load["foundation"]
    solution = np.zeros((total, len(states)))
    solution[free] = solve_symmetric(whole.tocsr()[free][:, free], rights[free])

    moved = {"dam": solution[glue].T + jumps, "foundation": solution[: sizes[1]].T}
    moved = {name: u.reshape(len(states), -1, dim) for name, u in moved.items()}
    material = material_of(case)
    stresses = {name: stress(bodies.spaces[name], u, material) for name, u in moved.items()}
    at_nodes = {name: u[:, : len(bodies.spaces[name].body.points)] for name, u in moved.items()}
    at_nodes = {n: np.pad(u, ((0, 0), (0, 0), (0, 3 - dim))) for n, u in at_nodes.items()}
    found, i = [], 0
    for _, record in scenes:
        number = len(record.saved)
        start = {n: u[i + number] if record.at_rest else 0 * u[0] for n, u in at_nodes.items()}
        found.append(
            {
                state.time: Field(
                    {name: u[i + k] - start[name] for name, u in at_nodes.items()},
                    {name: s[i + k] for name, s in stresses.items()},
                )
                for k, state in enumerate(record.saved)
            }
        )
        i += number + (record.at_rest is not None)
    return found
