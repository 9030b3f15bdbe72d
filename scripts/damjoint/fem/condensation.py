"""Static condensation of all bodies onto the joints.

The bodies are linear elastic and do not change with the level, the law or the water. With their
unknowns away from the joints eliminated (Schur complements S_b), the bodies b are coupled by the
joints alone. Glued at the joints they are a single elastic body, which the rock holds, with a
displacement v there; the jumps d of the joints part them (see gluing.py):

    u_b = R_b v + J_b d,    S_b u_b + (joint forces) = f_b

With v eliminated, too, the joints' nodal forces t, which work on the jumps, are

    t = t_0 - S d,    K = sum R_b^T S_b R_b,    C = sum R_b^T S_b J_b,
    S = sum J_b^T S_b J_b - C^T K^-1 C,    t_0 = sum J_b^T f_b - C^T K^-1 sum R_b^T f_b.

S is symmetric; the motions of the bodies that the joints alone hold are its null space. With a
single joint, v is the displacement of its lower face, K = S_u + S_l and C = S_u. That is how 2D is
computed; glued_elimination.py computes the same S and t_0 in 3D.

GetDP is not used for the bodies: its start alone takes as long as all steps of a 2D scene, and an
independent assembly checks the problem definition (tests compare both).
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Array, IntArray, distinct, others
from ..input.case import Case
from ..threads import scipy_linalg
from . import factor
from .bodies import Bodies, ElasticBody
from .condensed import Condensed, CondensedJoint
from .gluing import BodyDofs, Gluing
from .responses import Measure, Responses


@dataclass(frozen=True, kw_only=True)
class ReducedBody:
    """A body reduced to n degrees of freedom of a joint, with its responses to k unit loads and to
    unit forces on m degrees of freedom: l away from the joint, then those on the joint. The former
    move by loaded_stiffness^-1 (forces - coupling^T u).
    """

    #: degrees of freedom on which unit forces act (m,)
    dofs: IntArray
    #: (n, n)
    stiffness: Array
    #: forces on the joint: of unit forces (n, m), of unit loads (n, k)
    forces: Array
    units: Array
    #: (n, l), (l, l)
    coupling: Array
    loaded_stiffness: Array
    #: unit loads on the degrees of freedom away from the joint (l, k)
    loaded_units: Array

    @staticmethod
    def of(body: ElasticBody, joint: IntArray, loaded: IntArray) -> ReducedBody:
        """Schur complement of a body on degrees of freedom of a joint and loaded ones, of which
        those that are fixed are left out.
        """
        shared = np.flatnonzero(np.isin(joint, loaded))
        loaded = distinct(loaded)
        loaded = loaded[~np.isin(loaded, np.concatenate([joint, body.fixed_dofs]))]
        stiffness, loads = body.stiffness, np.column_stack(list(body.unit_loads.values()))
        size = stiffness.shape[0]
        free = others(size, body.fixed_dofs)
        number = np.full(size, -1)
        number[free] = np.arange(len(free))
        n, ends = len(joint), np.concatenate([number[joint], number[loaded]])
        schur, reduced_loads = factor.schur_complement(
            stiffness[free].columns(free), ends, loads[free]
        )
        jj, jl, ll = schur[:n, :n], schur[:n, n:], schur[n:, n:]
        units, loaded_units = reduced_loads[:n], reduced_loads[n:]
        spread = jl
        if len(loaded):
            to_joint = solve_positive(ll, jl.T).T
            jj = jj - to_joint @ jl.T
            jj, spread = (jj + jj.T) / 2, -to_joint
            units = units - to_joint @ loaded_units
        return ReducedBody(
            dofs=np.concatenate([loaded, joint[shared]]),
            stiffness=jj,
            forces=np.hstack([spread, np.eye(n)[:, shared]]),
            units=units,
            coupling=jl,
            loaded_stiffness=ll,
            loaded_units=loaded_units,
        )


#: Number of unknowns up to which numpy solves by LU: more operations, but scipy loads longer.
FEW = 600


def solve_positive(matrix: Array, right: Array) -> Array:
    """Solution of a dense symmetric positive definite system."""
    if len(matrix) <= FEW:
        return np.asarray(np.linalg.solve(matrix, right))
    solution: Array = scipy_linalg().solve(matrix, right, assume_a="pos")
    return solution


def solve_lower(factor: Array, right: Array) -> Array:
    """Solution of a dense lower triangular system."""
    if len(factor) <= FEW:
        return np.asarray(np.linalg.solve(factor, right))
    solution: Array = scipy_linalg().solve_triangular(factor, right, lower=True)
    return solution


def add_at(total: Array, indices: Any, values: Array) -> None:
    """Add values at positions of an array, which may be repeated."""
    rows = np.ravel(indices[0] if isinstance(indices, tuple) else indices)
    if len(distinct(rows)) == len(rows):
        total[indices] += values  # several times faster
    else:
        np.add.at(total, indices, values)


class JointElimination:
    """Displacements of the glued bodies on the joints eliminated."""

    def __init__(self, gluing: Gluing, reduced: dict[str, ReducedBody]) -> None:
        self.gluing = gluing
        glued = np.zeros((gluing.nodes, gluing.nodes))
        coupling = np.zeros((gluing.unknowns, gluing.nodes))
        by_jumps = np.zeros((gluing.unknowns, gluing.unknowns))
        for name, of_body in gluing.bodies.items():
            stiffness = reduced[name].stiffness
            # (a body that a joint is inside of has several degrees of freedom of a node)
            add_at(glued, np.ix_(of_body.node, of_body.node), stiffness)
            if len(of_body.jumps.data):
                carried = of_body.on_jumps(stiffness).T
                add_at(coupling.T, of_body.node, carried)
                by_jumps += of_body.on_jumps(carried)
        #: C^T
        self.coupling = coupling
        #: K, L of K = L L^T, and L^-1 C
        self.glued = glued
        self.factor = np.asarray(np.linalg.cholesky(glued), float)
        self.half = solve_lower(self.factor, coupling.T)
        #: S
        self.stiffness = by_jumps - self.half.T @ self.half

    def on_nodes(self, of_body: BodyDofs, forces: Array) -> Array:
        """Forces (n, ...) on the degrees of freedom of a body as forces on the glued ones."""
        total = np.zeros((self.gluing.nodes, *forces.shape[1:]))
        add_at(total, of_body.node, forces)
        return total

    def transmitted(self, of_body: BodyDofs, forces: Array) -> Array:
        """t_0 of forces (n, k) on the degrees of freedom of a body."""
        nodes = self.on_nodes(of_body, forces)
        through = self.half.T @ solve_lower(self.factor, nodes)
        return of_body.on_jumps(forces) - through


def responses_body_by_body(bodies: Bodies, gluing: Gluing) -> Responses:
    """Eliminate each body, then the displacements of the glued ones on the joints, dense: fastest
    where the joints have few unknowns.
    """
    loaded = {name: bodies.loaded_dofs(name) for name in bodies.by_name}
    for bearer, row in bodies.measures.values():
        loaded[bearer] = np.append(loaded[bearer], np.flatnonzero(row))
    reduced = {
        name: ReducedBody.of(body, gluing.bodies[name].dofs, loaded[name])
        for name, body in bodies.by_name.items()
    }
    joints = JointElimination(gluing, reduced)

    pressure: list[Array] = []
    units: dict[str, Array] = {}
    dof_of_face: dict[str, IntArray] = {}
    count = 0
    for name, body in bodies.by_name.items():
        part, of_body = reduced[name], gluing.bodies[name]
        pressure.append(joints.transmitted(of_body, part.forces))
        column = np.full(body.stiffness.shape[0], -1)
        column[part.dofs] = count + np.arange(len(part.dofs))
        count += len(part.dofs)
        dof_of_face |= {n: column[dofs] for n, dofs in body.face_dofs.items()}
        by_load = joints.transmitted(of_body, part.units)
        for i, load in enumerate(body.unit_loads):
            units[load] = units.get(load, 0) + by_load[:, i]

    return Responses(
        stiffness=joints.stiffness,
        units=units,
        pressure=np.hstack(pressure),
        dof_of_face=dof_of_face,
        measures={
            name: measured(bodies, reduced, joints, *measure)
            for name, measure in bodies.measures.items()
        },
    )


def measured(
    bodies: Bodies,
    reduced: dict[str, ReducedBody],
    joints: JointElimination,
    bearer: str,
    weights: Array,
) -> Measure:
    """A displacement of body c, weights of its degrees of freedom (n,): on those away from the
    joints row (forces - coupling^T u_c); u_c = R_c v + J_c d with v = K^-1 (sum R_b^T f_b - C d).
    """
    above, bearer_dofs = reduced[bearer], joints.gluing.bodies[bearer]
    size = len(above.loaded_stiffness)
    row = solve_positive(above.loaded_stiffness, weights[above.dofs[:size]])
    on_face = weights[bearer_dofs.dofs] - above.coupling @ row
    both = solve_positive(joints.glued, joints.on_nodes(bearer_dofs, on_face))
    pressure: list[Array] = []
    units: dict[str, float] = {}
    for name, body in bodies.by_name.items():
        part, node = reduced[name], joints.gluing.bodies[name].node
        direct = np.pad(row, (0, len(part.dofs) - size)) if name == bearer else 0
        pressure.append(direct + both[node] @ part.forces)
        moved = (row @ part.loaded_units if name == bearer else 0) + both[node] @ part.units
        for i, load in enumerate(body.unit_loads):
            units[load] = units.get(load, 0) + float(moved[i])
    return Measure(
        jump=bearer_dofs.on_jumps(on_face) - joints.coupling @ both,
        units=units,
        pressure=np.concatenate(pressure),
    )


def condense(case: Case, bodies: Bodies) -> Condensed:
    """Eliminate the bodies of a case."""
    start, mesh = time.perf_counter(), bodies.mesh
    gluing = Gluing.of(bodies)
    eliminate = responses_body_by_body
    if mesh.dim == 3:
        from .glued_elimination import responses_at_once as eliminate
    responses = eliminate(bodies, gluing)
    return Condensed(
        **vars(responses),
        dim=mesh.dim,
        order=int(case["order"]),
        width=mesh.joints[0].width,
        counts=mesh.counts,
        unknowns=sum(b.stiffness.shape[0] - len(b.fixed_dofs) for b in bodies.by_name.values()),
        joints=[
            CondensedJoint(mesh=joint, dofs=dofs)
            for joint, dofs in zip(mesh.joints, gluing.joints, strict=True)
        ],
        faces={n: face for n, face in mesh.faces.items() if n in responses.dof_of_face},
        factorisation=factor.name(),
        seconds={
            "mesh": mesh.seconds,
            "assembly": bodies.seconds,
            "condensation": time.perf_counter() - start,
        },
    )
