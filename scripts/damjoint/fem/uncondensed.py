"""The bodies with nothing eliminated, for large models in 3D: time and memory of a Schur complement
on the joints grow faster than the model.

The unknowns are the free displacements u of all bodies, and the jump of a joint is the difference
of those of the bodies above and below it. The equation of the joints (see joint/problem.py) is the
same, with the stiffness of the bodies in place of S and their loads in place of t_0.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from ..arrays import Array, IntArray, Sparse, distinct
from ..csr import CsrMatrix
from ..input.case import Case
from .bodies import Bodies, ElasticBody
from .condensed import Condensed, CondensedJoint, JointDofs
from .memory import PER_UNKNOWN_ITERATED, check_memory


@dataclass(frozen=True, kw_only=True)
class Uncondensed(Condensed):
    """The bodies of a case in 3D with nothing eliminated; unknowns: their n free displacements."""

    #: by body: the number of each of its degrees of freedom among the unknowns; -1: fixed
    numbers: dict[str, IntArray]
    #: of each unknown (n,): its body, and the number of its function where the bodies are glued
    body: IntArray
    place: IntArray
    #: rigid motions of each body (n, 6); zero for functions that are zero at all nodes
    rigid: Array

    @property
    def elastic(self) -> Sparse:
        """The stiffness of the bodies as a matrix (n, n) of scipy."""
        assert isinstance(self.stiffness, CsrMatrix)
        return self.stiffness.scipy()

    def displacements(self, unknowns: Array) -> dict[str, Array]:
        """Displacements of the degrees of freedom of each body, from the unknowns (n,)."""
        every = np.append(unknowns, 0.0)  # the last one: of what is fixed
        return {name: every[number] for name, number in self.numbers.items()}

    @property
    def on_joints(self) -> IntArray:
        """The unknowns of which the jumps are differences."""
        return distinct(np.concatenate([joint.dofs.columns for joint in self.joints]))


def rigid_motions(body: ElasticBody) -> Array:
    """Six rigid motions (degrees of freedom, 6), rotations about the centre over the size."""
    points = body.space.body.points - body.space.body.points.mean(axis=0)
    points = points / np.abs(points).max()
    motions = np.zeros((len(body.space.locations), 3, 6))
    nodes = motions[: len(points)]  # the products N_a N_b of order 2 are no part of a linear field
    for axis in range(3):
        nodes[:, axis, axis] = 1
        one, other = (axis + 1) % 3, (axis + 2) % 3
        nodes[:, one, 3 + axis], nodes[:, other, 3 + axis] = -points[:, other], points[:, one]
    return motions.reshape(-1, 6)


def uncondensed(case: Case, bodies: Bodies) -> Uncondensed:
    """The bodies of a case in 3D with nothing eliminated."""
    start, mesh = time.perf_counter(), bodies.mesh
    size = sum(body.stiffness.shape[0] for body in bodies.by_name.values())
    check_memory(PER_UNKNOWN_ITERATED * size, f"{size} unknowns")
    by_name = bodies.by_name
    sizes = [body.stiffness.shape[0] for body in by_name.values()]
    first = dict(zip(by_name, np.cumsum([0, *sizes[:-1]]).tolist(), strict=True))
    every = np.concatenate(
        [np.isin(np.arange(n), b.fixed_dofs) for n, b in zip(sizes, by_name.values(), strict=True)]
    )
    number = np.where(every, -1, np.cumsum(~every) - 1)
    free = np.flatnonzero(~every)
    count = len(free)

    joints, glued = list[CondensedJoint](), list[IntArray]()
    for k, joint in enumerate(mesh.joints):
        sides = [
            first[name] + by_name[name].joint_dofs[k, above]
            for name, above in ((joint.upper, True), (joint.lower, False))
        ]
        glued.append(np.column_stack(sides))
        parts = [np.flatnonzero((number[side] >= 0) & (sides[0] != sides[1])) for side in sides]
        dofs = JointDofs(
            rows=np.concatenate(parts),
            columns=np.concatenate([number[s[p]] for s, p in zip(sides, parts, strict=True)]),
            factors=np.repeat([1.0, -1.0], [len(part) for part in parts]),
        )
        joints.append(CondensedJoint(mesh=joint, dofs=dofs))
    pairs = np.concatenate(glued)[::3] // 3  # of functions
    functions = sum(sizes) // 3
    graph = sparse.coo_matrix((np.ones(len(pairs)), (*pairs.T,)), (functions,) * 2)
    place = connected_components(graph, directed=False)[1]

    units: dict[str, Array] = {}
    dof_of_face: dict[str, IntArray] = {}
    loaded = [first[name] + bodies.loaded_dofs(name) for name in by_name]
    column = np.full(sum(sizes), -1)
    column[np.concatenate(loaded)] = np.arange(sum(map(len, loaded)))
    for name, body in by_name.items():
        of_body = slice(first[name], first[name] + body.stiffness.shape[0])
        for load, forces in body.unit_loads.items():
            whole = units.setdefault(load, np.zeros(count))
            whole[number[of_body][~every[of_body]]] += forces[~every[of_body]]
        dof_of_face |= {face: column[of_body][dofs] for face, dofs in body.face_dofs.items()}
    pressed = number[np.concatenate(loaded)]
    spread = np.ones(len(pressed)), pressed, np.arange(len(pressed))
    crest_body, crest = bodies.crest
    at_crest = np.zeros(count)
    at_crest[number[first[crest_body] + crest]] = 1.0
    return Uncondensed(
        stiffness=block_diagonal([body.free_stiffness for body in by_name.values()]),
        units=units,
        pressure=CsrMatrix.of_entries(*spread, (count, len(pressed))),
        dof_of_face=dof_of_face,
        crest_jump=at_crest,
        crest_units=dict.fromkeys(units, 0.0),
        crest_pressure=np.zeros(len(pressed)),
        dim=mesh.dim,
        order=int(case["order"]),
        width=mesh.joints[0].width,
        counts=mesh.counts,
        unknowns=count,
        joints=joints,
        faces={n: face for n, face in mesh.faces.items() if n in dof_of_face},
        factorisation="none: smoothed aggregation",
        seconds={
            "mesh": mesh.seconds,
            "assembly": bodies.seconds + time.perf_counter() - start,
        },
        numbers={n: number[f : f + s] for (n, f), s in zip(first.items(), sizes, strict=True)},
        body=np.repeat(np.arange(len(sizes)), sizes)[free],
        place=place[free // 3],
        rigid=np.concatenate([rigid_motions(body) for body in by_name.values()])[free],
    )


def block_diagonal(matrices: list[CsrMatrix]) -> CsrMatrix:
    """Matrices along the diagonal."""
    return CsrMatrix.of_scipy(sparse.block_diag([m.scipy() for m in matrices], format="csr"))
