"""The chord of a joint, to which the resultants on it refer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from .joint_mesh import JointMesh


@dataclass(frozen=True, kw_only=True)
class Chord:
    """The line from heel to toe (3D: between means), to which resultants refer in a plane."""

    #: unit vectors of the plane (2, 3): x and y, unless the joint faces along z; then those towards
    #: the toe and along the joint's normal
    plane: Array
    toe: Array
    #: unit vectors in the plane: towards the toe, upwards
    along: Array
    normal: Array
    length: float

    @staticmethod
    def of(joint: JointMesh) -> Chord:
        """The chord of a joint."""
        surface = joint.surface
        ends = [surface.points[n].mean(axis=0) for n in (joint.heel_nodes, joint.toe_nodes)]
        plane, faces = np.eye(3)[:2], surface.normals.mean(axis=0)
        if np.abs(faces[:2]).max() < abs(faces[2]):
            across = np.cross(faces, ends[1] - ends[0])
            plane = np.array([np.cross(across, faces), faces])
            plane /= np.linalg.norm(plane, axis=1)[:, None]
        heel, toe = (plane @ end for end in ends)
        length = float(np.linalg.norm(toe - heel))
        along = (toe - heel) / length
        normal = np.array([-along[1], along[0]])
        return Chord(plane=plane, toe=toe, along=along, normal=normal, length=length)

    def resultants(
        self, weights: Array, positions: Array, traction: Array
    ) -> tuple[Array, Array, Array]:
        """N (compression > 0), T (downstream > 0) and M (about the toe, holding down > 0), (...,),
        of tractions (..., q, 3) along x, y, z at positions (q, 3).
        """
        force = weights[:, None] * (traction @ self.plane.T)
        total, arm = force.sum(axis=-2), positions @ self.plane.T - self.toe
        moment = np.sum(arm[:, 0] * force[..., 1] - arm[:, 1] * force[..., 0], axis=-1)
        return -total @ self.normal, total @ self.along, moment
