"""Displacement and stress of the bodies, from the joint's jump."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from ...results.fields import Field
from .bulk import Bodies, push_of_water, unknowns
from .elasticity import body_force, stress
from .equilibrium import Joint
from .factor import solve_symmetric
from .record import State


def recover(bodies: Bodies, scenes: list[tuple[Joint, list[State]]]) -> list[dict[float, Field]]:
    """The fields of some states of scenes on the same bodies, by scene and time: the bulk solved
    once more.

    Dam and foundation glued at the joint are one elastic body, loaded besides by the forces that
    the jump needs in the dam, -K_dam jump; the water in the joint acts on both lips and cancels.
    """
    dim, stiff_dam, stiff_foundation = bodies.dim, bodies.stiff_dam, bodies.stiff_foundation
    sizes = stiff_dam.shape[0], stiff_foundation.shape[0]
    # glue: each unknown of the dam in the numbering of the whole, the foundation's first
    glue = np.full(sizes[0], -1)
    glue[unknowns(bodies.joint_dam, dim)] = unknowns(bodies.joint_foundation, dim)
    own = np.flatnonzero(glue < 0)
    glue[own] = sizes[1] + np.arange(len(own))
    total = sizes[1] + len(own)
    ones = np.ones(sizes[0])
    spread = sparse.csr_matrix((ones, (np.arange(sizes[0]), glue)), (sizes[0], total))
    nothing = sparse.csr_matrix((len(own), len(own)))
    whole = sparse.block_diag([stiff_foundation, nothing]) + spread.T @ stiff_dam @ spread
    held = np.union1d(bodies.held_foundation, glue[bodies.held_dam])
    free = np.setdiff1d(np.arange(total), held)

    states = [(joint, state) for joint, some in scenes for state in some]
    if not states:
        return [{} for _ in scenes]
    case = states[0][0].case
    volume = body_force(bodies.dam, dim, 1), body_force(bodies.foundation, dim, 1)
    weight = [
        -case["g"] * case[rho] * v for rho, v in zip(("rho_dam", "rho_found"), volume, strict=True)
    ]
    push = push_of_water(case)
    jumps = np.zeros((len(states), sizes[0]))
    rights = np.zeros((total, len(states)))
    for i, (joint, state) in enumerate(states):
        jumps[i, unknowns(bodies.joint_dam, dim)[joint.bulk.free]] = state.jump
        load = weight[0] - stiff_dam @ jumps[i]
        for name, water in (("upstream", state.level), ("downstream", state.tail)):
            if name in joint.interface.faces:
                force = joint.face_forces(name, water)[0]
                for component, share in push[name].items():
                    np.add.at(load, dim * bodies.faces[name] + component, share * force)
        rights[:, i] = spread.T @ load
        rights[: sizes[1], i] += weight[1]
    solution = np.zeros((total, len(states)))
    solution[free] = solve_symmetric(whole.tocsr()[free][:, free], rights[free])

    spaces = {"dam": bodies.dam, "foundation": bodies.foundation}
    material = {
        "dam": (case["E_dam"], case["nu_dam"]),
        "foundation": (case["E_found"], case["nu_found"]),
    }
    moved = {"dam": solution[glue].T + jumps, "foundation": solution[: sizes[1]].T}
    moved = {name: u.reshape(len(states), -1, dim) for name, u in moved.items()}
    stresses = {name: stress(spaces[name], u, *material[name]) for name, u in moved.items()}
    at_nodes = {name: u[:, : len(spaces[name].body.points)] for name, u in moved.items()}
    at_nodes = {n: np.pad(u, ((0, 0), (0, 0), (0, 3 - dim))) for n, u in at_nodes.items()}
    found, i = [], 0
    for _, some in scenes:
        found.append({})
        for state in some:
            found[-1][state.time] = Field(
                {name: u[i] for name, u in at_nodes.items()},
                {name: s[i] for name, s in stresses.items()},
            )
            i += 1
    return found
