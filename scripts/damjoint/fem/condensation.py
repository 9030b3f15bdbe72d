"""Static condensation of both bodies onto the joint.

The bodies are linear elastic and do not change with the level, the law or the water. With their
unknowns away from the joint eliminated (Schur complements), the upper body (floating, S_u) and the
lower body (S_l) are coupled by the joint alone:

    S_u u_u + t = f_u,    S_l u_l - t = f_l,    delta = u_u - u_l

(t: nodal forces of the joint's total traction on its upper face). Eliminating u_u and u_l too
leaves the displacement jump:

    t = t_0 - S delta,    M = S_u + S_l,    S = S_u - S_u M^-1 S_u,
    t_0 = f_u - S_u M^-1 (f_u + f_l).

S is symmetric; the rigid motions of the upper body are its null space. GetDP is not used for the
bodies: its start alone takes as long as all steps of a 2D scene, and an independent assembly checks
the problem definition (tests compare both).
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ..arrays import Array, IntArray
from ..model.case import Case
from ..model.mesh import Face, JointMesh
from . import factor
from .bodies import Bodies, ElasticBody
from .elements import Space


@dataclass(frozen=True, kw_only=True)
class CondensedJoint:
    """A joint of condensed bodies."""

    mesh: JointMesh
    #: jump unknowns, dim * function + component, that are not fixed
    free: IntArray


@dataclass(frozen=True, kw_only=True)
class Condensed:
    """The condensed bodies: stiffness of the free jump unknowns (j of them) and the responses to
    loads, with m degrees of freedom on which forces act.
    """

    dim: int
    order: int
    #: thickness along z [m], 1 in 2D
    width: float
    counts: dict[str, int]
    #: number of free degrees of freedom of all bodies
    unknowns: int
    joints: dict[str, CondensedJoint]
    #: the wet faces
    faces: dict[str, Face]
    #: S (j, j), see above
    stiffness: Array
    #: t_0 of unit loads (j,), see ElasticBody.unit_loads
    units: dict[str, Array]
    #: t_0 of unit forces on the loaded degrees of freedom (j, m), and the column of each degree of
    #: freedom of a face (functions * dim,); -1: none, it is fixed or never loaded
    pressure: Array
    dof_of_face: dict[str, IntArray]
    #: displacement of the crest along x: per jump (j,), by unit loads, by unit forces (m,)
    crest_jump: Array
    crest_units: dict[str, float]
    crest_pressure: Array
    #: library that eliminated them, with its version
    factorisation: str
    #: wall seconds of mesh, assembly and condensation
    seconds: dict[str, float]


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
        loaded = np.setdiff1d(loaded, np.concatenate([joint, body.fixed_dofs]))
        stiffness, loads = body.stiffness, np.column_stack(list(body.unit_loads.values()))
        size = stiffness.shape[0]
        free = np.setdiff1d(np.arange(size), body.fixed_dofs)
        number = np.full(size, -1)
        number[free] = np.arange(len(free))
        n, ends = len(joint), np.concatenate([number[joint], number[loaded]])
        schur, reduced_loads = factor.schur_complement(stiffness[free][:, free], ends, loads[free])
        jj, jl, ll = schur[:n, :n], schur[:n, n:], schur[n:, n:]
        units, loaded_units = reduced_loads[:n], reduced_loads[n:]
        spread = jl
        if len(loaded):
            to_joint = linalg.solve(ll, jl.T, assume_a="pos").T
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


def loaded_dofs(bodies: Bodies, body: ElasticBody) -> IntArray:
    """Degrees of freedom of the wet faces that a pressure loads: none along an axis that every
    normal of the face is perpendicular to.
    """
    dim, dofs = bodies.mesh.dim, [np.zeros(0, int)]
    for name, of_face in body.face_dofs.items():
        normals = bodies.mesh.faces[name].surface.normals[:, :dim]
        loaded = np.abs(normals).max(axis=0) > 1e-9
        dofs.append(of_face.reshape(-1, dim)[:, loaded].ravel())
    return np.concatenate(dofs)


class FaceElimination:
    """Displacements of both joint faces eliminated."""

    def __init__(self, upper: Array, lower: Array) -> None:
        """upper, lower: S_u and S_l (j, j)."""
        #: L of M = L L^T, and L^-1 S_u
        self.factor = linalg.cholesky(lower + upper, lower=True, overwrite_a=True)
        self.half = linalg.solve_triangular(self.factor, upper, lower=True)
        #: S
        self.stiffness = upper - self.half.T @ self.half

    def transmitted(self, forces: Array, on_upper: bool) -> Array:
        """t_0 of forces (j, k) on the upper or the lower joint face."""
        through = self.half.T @ linalg.solve_triangular(self.factor, forces, lower=True)
        return (forces if on_upper else 0) - through


def condense(case: Case, bodies: Bodies) -> Condensed:
    """Eliminate the bodies of a case."""
    start, mesh = time.perf_counter(), bodies.mesh
    ((joint_name, joint),) = mesh.joints.items()
    upper = bodies.by_name[joint.upper]
    is_free = ~np.isin(upper.joint_dofs, upper.fixed_dofs)
    crest = upper.space.find(Space(mesh.bodies["crest"], 1))[:1] * mesh.dim
    loaded = {name: loaded_dofs(bodies, body) for name, body in bodies.by_name.items()}
    loaded[joint.upper] = np.append(loaded[joint.upper], crest)
    reduced = {
        name: ReducedBody.of(body, body.joint_dofs[is_free], loaded[name])
        for name, body in bodies.by_name.items()
    }
    above = reduced[joint.upper]
    faces = FaceElimination(above.stiffness, reduced[joint.lower].stiffness)

    # The crest: row (forces - coupling^T u_u), with u_u = delta + M^-1 (f_u + f_l - S_u delta)
    size = len(above.loaded_stiffness)
    at_crest = 1.0 * (above.dofs[:size] == crest[0])
    row = linalg.solve(above.loaded_stiffness, at_crest, assume_a="pos")
    crest_face = -(above.coupling @ row)
    crest_both = linalg.cho_solve((faces.factor, True), crest_face)

    pressure: list[Array] = []
    crest_pressure: list[Array] = []
    units: dict[str, Array] = {}
    crest_units: dict[str, float] = {}
    dof_of_face: dict[str, IntArray] = {}
    count = 0
    for name, body in bodies.by_name.items():
        own, on_upper = reduced[name], name == joint.upper
        pressure.append(faces.transmitted(own.forces, on_upper))
        direct = np.pad(row, (0, len(own.dofs) - size)) if on_upper else 0
        crest_pressure.append(direct + crest_both @ own.forces)
        column = np.full(body.stiffness.shape[0], -1)
        column[own.dofs] = count + np.arange(len(own.dofs))
        count += len(own.dofs)
        dof_of_face |= {n: column[dofs] for n, dofs in body.face_dofs.items()}
        by_load = faces.transmitted(own.units, on_upper)
        moved = (row @ own.loaded_units if on_upper else 0) + crest_both @ own.units
        units |= {n: by_load[:, i] for i, n in enumerate(body.unit_loads)}
        crest_units |= {n: float(moved[i]) for i, n in enumerate(body.unit_loads)}

    return Condensed(
        dim=mesh.dim,
        order=int(case["order"]),
        width=joint.width,
        counts=mesh.counts,
        unknowns=sum(b.stiffness.shape[0] - len(b.fixed_dofs) for b in bodies.by_name.values()),
        joints={joint_name: CondensedJoint(mesh=joint, free=np.flatnonzero(is_free))},
        faces={name: face for name, face in mesh.faces.items() if name in dof_of_face},
        stiffness=faces.stiffness,
        units=units,
        pressure=np.hstack(pressure),
        dof_of_face=dof_of_face,
        crest_jump=crest_face - above.stiffness @ crest_both,
        crest_units=crest_units,
        crest_pressure=np.concatenate(crest_pressure),
        factorisation=factor.name(),
        seconds={
            "mesh": mesh.seconds,
            "assembly": bodies.seconds,
            "condensation": time.perf_counter() - start,
        },
    )
