"""The condensed bodies: all that the joints need of them."""

from __future__ import annotations

from dataclasses import dataclass

from ..arrays import Array, IntArray
from ..csr import CsrMatrix
from ..mesh.joint_mesh import Face, JointMesh
from .responses import Responses


@dataclass(frozen=True, kw_only=True)
class JointDofs:
    """The jumps of a joint, dim * function + component, from the unknowns: entries of a matrix."""

    rows: IntArray
    columns: IntArray
    factors: Array

    def matrix(self, jumps: int, unknowns: int) -> CsrMatrix:
        """The matrix (jumps, unknowns)."""
        return CsrMatrix.of_entries(self.factors, self.rows, self.columns, (jumps, unknowns))


@dataclass(frozen=True, kw_only=True)
class CondensedJoint:
    """A joint of condensed bodies."""

    mesh: JointMesh
    dofs: JointDofs


@dataclass(frozen=True, kw_only=True)
class Condensed(Responses):
    """The condensed bodies of a case."""

    dim: int
    order: int
    #: thickness along z [m], 1 in 2D
    width: float
    counts: dict[str, int]
    #: number of free degrees of freedom of all bodies
    unknowns: int
    joints: list[CondensedJoint]
    #: the wet faces
    faces: dict[str, Face]
    #: library that eliminated them, with its version
    factorisation: str
    #: wall seconds of mesh, assembly and condensation
    seconds: dict[str, float]
