"""Condensation of all bodies at once, in a single sparse factorisation: for 3D, where the joints
have too many unknowns for dense matrices of each body.

Unknowns w = (v, d): displacements v of the glued bodies, jumps d. A body moves by u_b = T_b w, so
that A = sum T_b^T K_b T_b; its Schur complement on d is S. Unit loads F, a border of A, give the
rest at the same time: t_0 = F_d - A_dv A_vv^-1 F_v, and F_v^T A_vv^-1 F_v, of which the row of a
unit force, as on the crest, has the displacement that it does work on.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from ..arrays import Array, IntArray, Sparse
from .bodies import Bodies
from .factor import bordered, dense_schur
from .glued_bodies import GluedBodies
from .gluing import Gluing
from .responses import Measure, Responses


def responses_at_once(bodies: Bodies, gluing: Gluing) -> Responses:
    """Eliminate all bodies in a single factorisation."""
    glued = GluedBodies.of(bodies.by_name, gluing)
    motion = glued.motion(gluing)
    unit_loads: dict[str, Array] = {}
    loaded: list[Sparse] = []
    dof_of_face: dict[str, IntArray] = {}
    count = 0
    for name, body in bodies.by_name.items():
        for load, forces in body.unit_loads.items():
            unit_loads[load] = unit_loads.get(load, 0) + motion[name].T @ forces
        dofs = bodies.loaded_dofs(name)
        column = np.full(body.stiffness.shape[0], -1)
        column[dofs] = count + np.arange(len(dofs))
        count += len(dofs)
        loaded.append(motion[name][dofs])
        dof_of_face |= {face: column[of_face] for face, of_face in body.face_dofs.items()}
    measures = {
        name: sparse.csr_matrix(motion[body].T @ row)
        for name, (body, row) in bodies.measures.items()
    }
    rows: list[Sparse] = [*loaded, *unit_loads.values(), *measures.values()]
    loads = sparse.vstack(rows, format="csr").T
    stiffness = sum(m.T @ bodies.by_name[name].stiffness.scipy() @ m for name, m in motion.items())
    matrix = bordered(stiffness, loads)
    del stiffness
    schur = dense_schur(matrix, np.arange(len(glued.free), matrix.shape[0]))
    number, last = gluing.unknowns, count + len(unit_loads)
    t_0, moved = schur[number:, :number], -schur[number + last :, number:]
    return Responses(
        stiffness=schur[:number, :number].copy(),
        units={n: row.copy() for n, row in zip(unit_loads, t_0[count:last], strict=True)},
        pressure=schur[:number, number : number + count].copy(),
        dof_of_face=dof_of_face,
        measures={
            name: Measure(
                jump=t_0[last + k].copy(),
                units=dict(zip(unit_loads, moved[k, count:last].tolist(), strict=True)),
                pressure=moved[k, :count].copy(),
            )
            for k, name in enumerate(measures)
        },
    )
