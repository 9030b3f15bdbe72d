"""Mass, damping and stiffness of the glued bodies and of the jumps that part them.

Unknowns w = (v, d), relative to the ground and to the static state: displacement v of the glued
bodies, jumps d of the joints (see fem/gluing.py). A body moves by u_b = T_b w, so that a jump
carries the mass of all that is above it: M = sum T_b^T M_b T_b, likewise K.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, eigsh

from ..arrays import Array, IntArray, Sparse
from ..csr import CsrMatrix
from ..fem.bodies import Bodies, ElasticBody
from ..fem.elasticity import mass
from ..fem.elements import Space
from ..fem.factor import partial_factors
from ..fem.glued_bodies import GluedBodies
from ..fem.gluing import Gluing
from ..input.case import Case
from ..input.parameters import TINY
from ..input.scene import UP
from ..joint.interface import Interface, JointInterface
from ..joint.wet_faces import WetFace
from ..model.loads import AddedPressure

#: Displacement (n, 3) of points (n, 3) in a rigid motion.
Motion = Callable[[Array], Array]

#: The body and the region of the rock.
ROCK = "foundation"

#: Regions that always have mass, and the parameter of their density.
MASSIVE = {"dam": "rho_dam", "lower": "rho_dam"}


@dataclass(frozen=True, kw_only=True)
class System:
    """The matrices over w (n,), of which the last ones, `jumps`, are those of the joints."""

    mass: Sparse
    #: mass without the added water
    solid: Sparse
    stiffness: Sparse
    #: T_b (degrees of freedom, n) and function space of each body
    motion: dict[str, Sparse]
    spaces: dict[str, Space]
    #: mass times a unit acceleration of the ground along x and y (n, 2)
    inertia: Array
    #: total mass that moves along x and y (2,)
    total: Array
    #: displacement of the crest along x and y (2, n)
    crest: Sparse
    jumps: IntArray

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return int(self.mass.shape[0])

    @staticmethod
    def of(case: Case, bodies: Bodies, interface: Interface) -> System:
        """Assemble a case's bodies with added mass at the last level; rock_mass: no supports."""
        densities = {region: case[name] for region, name in MASSIVE.items()}
        if case["rock_mass"]:
            bodies, densities = bodies.without_supports, densities | {ROCK: case["rho_found"]}
        gluing = Gluing.of(bodies)
        glued = GluedBodies.of(bodies.by_name, gluing)
        dim, size = bodies.mesh.dim, len(glued.free) + gluing.unknowns
        stiffness: Sparse = sparse.csr_matrix((size, size))
        solid, water, inertia, total = stiffness, stiffness, np.zeros((size, 2)), np.zeros(2)
        motion = glued.motion(gluing)
        for name, body in bodies.by_name.items():
            moved = motion[name]
            of_solid = mass(body.space, dim, densities)
            of_water = added_mass(case, interface, body)
            stiffness = stiffness + moved.T @ body.stiffness.scipy() @ moved
            solid = solid + moved.T @ of_solid @ moved
            water = water + moved.T @ of_water @ moved
            x, y = (nodal(body.space, dim, uniform(axis)) for axis in np.eye(3)[:2])
            # the water follows a vertical motion of the ground
            forces = np.column_stack([(of_solid + of_water) @ x, of_solid @ y])
            inertia += moved.T @ forces
            total += np.array([x @ forces[:, 0], y @ forces[:, 1]])
        return System(
            mass=(solid + water).tocsr(),
            solid=solid.tocsr(),
            stiffness=stiffness.tocsr(),
            motion=motion,
            spaces={name: body.space for name, body in bodies.by_name.items()},
            inertia=inertia,
            total=total,
            crest=crest_rows(bodies, motion),
            jumps=np.arange(len(glued.free), size),
        )

    def translation(self, joint: JointInterface, above: Collection[str], along: Array) -> Array:
        """The unknowns (n,) of a unit translation along x and y (2,) of the bodies of these names,
        which a joint separates from the others.
        """
        return self.rigid_motion(joint, above, uniform(np.array([*along, 0.0])))

    def rigid_motion(self, joint: JointInterface, above: Collection[str], motion: Motion) -> Array:
        """The unknowns (n,) of a rigid motion of named bodies that a joint parts from others."""
        result = np.zeros(self.size)
        moving = sorted(self.motion, key=lambda name: name not in above)
        # the others last: shared degrees of freedom are those of the lower body
        for name in moving:
            value = nodal(self.spaces[name], joint.dim, motion) * (name in above)
            of_body = self.motion[name][:, : self.jumps[0]]
            touched = np.unique(of_body.indices)
            result[touched] = (of_body.T @ value)[touched]
        jumps, value = joint.unknowns.scipy(), nodal(joint.space, joint.dim, motion)
        result[self.jumps] = (jumps.T @ value) / np.maximum(np.ravel(abs(jumps).sum(axis=0)), 1)
        return result

    def resultants(self, joint: JointInterface, above: Collection[str]) -> Array:
        """The parts of T, N and M of a joint, per metre, that are inertia of the bodies above it
        (3, n + 2): from the acceleration relative to the ground and that of the ground along x
        and y.
        """
        chord = joint.chord

        def turned(points: Array) -> Array:
            arm = points @ chord.plane.T - chord.toe
            return arm[:, ::-1] * [1, -1] @ chord.plane

        of_forces = (
            uniform(-chord.along @ chord.plane),
            uniform(chord.normal @ chord.plane),
            turned,
        )
        motions = np.array([self.rigid_motion(joint, above, motion) for motion in of_forces])
        return np.hstack([(self.mass @ motions.T).T, motions @ self.inertia]) / joint.width

    def frequencies(self, of_joints: CsrMatrix, number: int) -> tuple[Array, Array]:
        """The lowest natural frequencies (number,) [Hz] with a stiffness of the joints (j, j), and
        their modes (n, number), undamped.
        """
        n, j = self.size, len(self.jumps)
        joint = sparse.block_diag(
            [sparse.csr_matrix((n - j, n - j)), of_joints.scipy()], format="csr"
        )
        matrix = (self.stiffness + joint).tocsr()
        factors = partial_factors(matrix, self.jumps)
        inverse = np.linalg.inv(factors.schur)
        solve = lambda right: factors.expand(inverse @ factors.reduce(np.ravel(right)))
        squares, modes = eigsh(
            matrix,
            k=number,
            M=self.mass,
            sigma=0.0,
            OPinv=LinearOperator((n, n), matvec=solve),
            v0=np.ones(n),
        )
        order = np.argsort(squares)
        return np.sqrt(squares[order]) / (2 * math.pi), modes[:, order]


def uniform(displacement: Array) -> Motion:
    """The translation by a displacement (3,)."""
    return lambda points: np.tile(displacement, (len(points), 1))


def nodal(space: Space, dim: int, motion: Motion) -> Array:
    """The displacement (degrees of freedom,) of a rigid motion."""
    result = np.zeros((len(space.locations), dim))
    result[: len(space.body.points)] = motion(space.body.points)[:, :dim]
    return result.ravel()


def crest_rows(bodies: Bodies, motion: dict[str, Sparse]) -> Sparse:
    """Displacement of the crest along x and y (2, n)."""
    mesh = bodies.mesh
    name = mesh.bearer("crest")
    functions = bodies.by_name[name].space.find(Space(mesh.bodies["crest"], 1))
    first = mesh.dim * int(functions[0])
    return motion[name][[first, first + 1]]


def added_mass(case: Case, interface: Interface, body: ElasticBody) -> Sparse:
    """Mass matrix of the water in front of the upstream faces of a body (degrees of freedom, ...).

    The mass per area whose inertia is the pressure of a horizontal acceleration (Westergaard 1933,
    Zangar 1952), normal to the face; on an inclined face it follows the normal component (Kuo
    1982). Zero with added_mass = 0.
    """
    size = body.stiffness.shape[0]
    result = sparse.csr_matrix((size, size))
    level = case.levels[-1]
    for name, dofs in body.face_dofs.items():
        face = interface.faces[name]
        if face.side != UP or not case["added_mass"] or level <= face.y.min():
            continue
        density = case["rho_water"] * water_depths(case, face, level, interface.floor)
        normal = sparse.hstack(
            [face.points.values.scaled(face.normals[:, axis]).scipy() for axis in range(face.dim)]
        ).tocsr()
        weighted = normal.T @ sparse.diags(face.points.weights * density) @ normal
        number = dofs.reshape(-1, face.dim).T.ravel()
        numbering = sparse.csr_matrix(
            (np.ones(len(number)), (number, np.arange(len(number)))), (size, len(number))
        )
        result += numbering @ weighted @ numbering.T
    return result


def water_depths(case: Case, face: WetFace, level: float, floor: float) -> Array:
    """Depth of water (q,) [m] that moves with the points of a face, along its normal; on a straight
    face with exact resultant and moment.
    """
    added = AddedPressure.unit(case, level, floor)
    if face.corrects:
        column = lambda surface, low, high: added.column(surface, low, high, face.tilt[0])
        heights = face.corrected(level, added.height, column)
    else:
        heights = added.height(level, face.y, face.tilt)
    return heights / np.maximum(face.tilt, TINY)
