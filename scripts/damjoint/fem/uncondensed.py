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
from ..mesh.joint_mesh import JointMesh
from .bodies import Bodies, ElasticBody
from .condensed import Condensed, CondensedJoint, JointDofs
from .memory import PER_UNKNOWN_ITERATED, check_memory
from .responses import Measure


@dataclass(frozen=True, kw_only=True)
class Uncondensed(Condensed):
    """The bodies of a case in 3D with nothing eliminated; unknowns: their n free displacements."""

    #: by body: the number of each of its degrees of freedom among the unknowns; -1: fixed
    numbers: dict[str, IntArray]
    #: of each unknown (n,): its body, and its node where the bodies are glued
    body: IntArray
    node: IntArray
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


class Numbering:
    """Numbers of all bodies' degrees of freedom, and of the free ones among the unknowns."""

    def __init__(self, bodies: Bodies) -> None:
        self.bodies = bodies.by_name
        self.sizes = [body.stiffness.shape[0] for body in self.bodies.values()]
        #: number of the first degree of freedom of each body
        self.first = dict(zip(self.bodies, np.cumsum([0, *self.sizes[:-1]]).tolist(), strict=True))
        every = zip(self.sizes, self.bodies.values(), strict=True)
        self.fixed = np.concatenate([np.isin(np.arange(n), b.fixed_dofs) for n, b in every])
        self.free = np.flatnonzero(~self.fixed)
        #: number of each degree of freedom among the unknowns; -1: fixed
        self.unknown = np.where(self.fixed, -1, np.cumsum(~self.fixed) - 1)

    def of_body(self, name: str) -> slice:
        """Those of a body."""
        return slice(self.first[name], self.first[name] + self.bodies[name].stiffness.shape[0])

    def of_joint(self, joint: JointMesh, number: int) -> tuple[IntArray, IntArray]:
        """Those of a joint, by its number, in the bodies above and below it."""
        above = self.bodies[joint.upper].joint_dofs[number, True]
        below = self.bodies[joint.lower].joint_dofs[number, False]
        return self.first[joint.upper] + above, self.first[joint.lower] + below

    def jumps(self, above: IntArray, below: IntArray) -> JointDofs:
        """The jumps of a joint: differences of the unknowns above and below it."""
        sides = above, below
        rows = [np.flatnonzero((self.unknown[side] >= 0) & (above != below)) for side in sides]
        return JointDofs(
            rows=np.concatenate(rows),
            columns=np.concatenate(
                [self.unknown[side[r]] for side, r in zip(sides, rows, strict=True)]
            ),
            factors=np.repeat([1.0, -1.0], [len(r) for r in rows]),
        )

    def nodes(self, glued: list[tuple[IntArray, IntArray]]) -> IntArray:
        """The node of each unknown, the same above and below a joint; glued: see `of_joint`."""
        dofs = np.concatenate([np.column_stack(sides) for sides in glued])
        pairs, count = dofs[::3] // 3, sum(self.sizes) // 3  # of functions
        graph = sparse.coo_matrix((np.ones(len(pairs)), (*pairs.T,)), (count, count))
        return np.asarray(connected_components(graph, directed=False)[1][self.free // 3])

    def unit_loads(self) -> dict[str, Array]:
        """Loads on the unknowns by the unit loads of all bodies."""
        units: dict[str, Array] = {}
        for name, body in self.bodies.items():
            unknown = self.unknown[self.of_body(name)]
            for load, forces in body.unit_loads.items():
                whole = units.setdefault(load, np.zeros(len(self.free)))
                whole[unknown[unknown >= 0]] += forces[unknown >= 0]
        return units


def uncondensed(case: Case, bodies: Bodies) -> Uncondensed:
    """The bodies of a case in 3D with nothing eliminated."""
    start, mesh = time.perf_counter(), bodies.mesh
    by_name, numbering = bodies.by_name, Numbering(bodies)
    size, count = sum(numbering.sizes), len(numbering.free)
    check_memory(PER_UNKNOWN_ITERATED * size, f"{size} unknowns")
    glued = [numbering.of_joint(joint, k) for k, joint in enumerate(mesh.joints)]
    loaded = np.concatenate([numbering.first[n] + bodies.loaded_dofs(n) for n in by_name])
    column = np.full(size, -1)
    column[loaded] = np.arange(len(loaded))
    dof_of_face = {
        face: column[numbering.of_body(name)][dofs]
        for name, body in by_name.items()
        for face, dofs in body.face_dofs.items()
    }
    spread = np.ones(len(loaded)), numbering.unknown[loaded], np.arange(len(loaded))
    units, measures = numbering.unit_loads(), dict[str, Measure]()
    for measure, (body, weights) in bodies.measures.items():
        row, unknown = np.zeros(count), numbering.unknown[numbering.of_body(body)]
        row[unknown[unknown >= 0]] = weights[unknown >= 0]
        measures[measure] = Measure(
            jump=row, units=dict.fromkeys(units, 0.0), pressure=np.zeros(len(loaded))
        )
    stiffness = [body.free_stiffness.scipy() for body in by_name.values()]
    rigid = np.concatenate([rigid_motions(body) for body in by_name.values()])
    return Uncondensed(
        stiffness=CsrMatrix.of_scipy(sparse.block_diag(stiffness, format="csr")),
        units=units,
        pressure=CsrMatrix.of_entries(*spread, (count, len(loaded))),
        dof_of_face=dof_of_face,
        measures=measures,
        dim=mesh.dim,
        order=int(case["order"]),
        width=mesh.joints[0].width,
        counts=mesh.counts,
        unknowns=count,
        joints=[
            CondensedJoint(mesh=joint, dofs=numbering.jumps(*sides))
            for joint, sides in zip(mesh.joints, glued, strict=True)
        ],
        faces={n: face for n, face in mesh.faces.items() if n in dof_of_face},
        factorisation="none: smoothed aggregation",
        seconds={"mesh": mesh.seconds, "assembly": bodies.seconds + time.perf_counter() - start},
        numbers={name: numbering.unknown[numbering.of_body(name)] for name in by_name},
        body=np.repeat(np.arange(len(by_name)), numbering.sizes)[numbering.free],
        node=numbering.nodes(glued),
        rigid=rigid[numbering.free],
    )
