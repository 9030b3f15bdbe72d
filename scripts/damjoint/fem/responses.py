"""What the condensed bodies are to the joints: stiffness and responses to loads."""

from __future__ import annotations

from dataclasses import dataclass

from ..arrays import Array, IntArray
from ..csr import CsrMatrix


@dataclass(frozen=True, kw_only=True)
class Measure:
    """A displacement of the bodies [m]: per jump (j,), by unit loads, by unit forces (m,)."""

    jump: Array
    units: dict[str, float]
    pressure: Array


@dataclass(frozen=True, kw_only=True)
class Responses:
    """Of bodies condensed onto j free jump unknowns, with m forces on wet faces."""

    #: S (j, j), see condensation.py; sparse if nothing is eliminated, see uncondensed.py
    stiffness: Array | CsrMatrix
    #: t_0 of unit loads (j,), see ElasticBody.unit_loads
    units: dict[str, Array]
    #: t_0 of unit forces on the loaded degrees of freedom (j, m), and the column of each degree of
    #: freedom of a face (functions * dim,); -1: none, it is fixed or never loaded
    pressure: Array | CsrMatrix
    dof_of_face: dict[str, IntArray]
    #: displacements by name, see `Bodies.measures`
    measures: dict[str, Measure]

    @property
    def size(self) -> int:
        """Number of unknowns j."""
        return self.stiffness.shape[0]
