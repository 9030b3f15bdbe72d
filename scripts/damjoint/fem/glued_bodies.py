"""All bodies of a case glued at their joints: a single elastic body, assembled."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from ..arrays import Array, IntArray, Sparse
from ..classes import dataclass
from .bodies import ElasticBody
from .factor import solve_symmetric
from .gluing import Gluing


@dataclass(frozen=True, kw_only=True)
class GluedBodies:
    """All bodies, glued at the joints to a single elastic body; the last body's numbers first."""

    stiffness: Sparse
    #: degrees of freedom that are not fixed
    free: IntArray
    #: by body: the Boolean matrix of the numbers of its degrees of freedom
    numbers: dict[str, Sparse]

    @staticmethod
    def of(bodies: dict[str, ElasticBody], gluing: Gluing) -> GluedBodies:
        """Assemble bodies."""
        shared = np.full(gluing.nodes, -1)
        numbers, fixed, size = {}, list[IntArray](), 0
        for name, body in reversed(bodies.items()):
            of_body, own = gluing.bodies[name], body.stiffness.shape[0]
            number = np.full(own, -1)
            number[of_body.dofs] = shared[of_body.node]
            new = np.flatnonzero(number < 0)
            number[new] = size + np.arange(len(new))
            shared[of_body.node] = number[of_body.dofs]
            size += len(new)
            numbers[name] = number
            fixed.append(number[body.fixed_dofs])
        matrices = {
            name: sparse.csr_matrix((np.ones(len(n)), (np.arange(len(n)), n)), (len(n), size))
            for name, n in numbers.items()
        }
        stiffness = sum(m.T @ bodies[name].stiffness.scipy() @ m for name, m in matrices.items())
        free = np.setdiff1d(np.arange(size), np.concatenate(fixed))
        return GluedBodies(stiffness=stiffness.tocsr(), free=free, numbers=matrices)

    def motion(self, gluing: Gluing) -> dict[str, Sparse]:
        """By body b: T_b (degrees of freedom, n) of u_b = T_b w; w: the free displacements of the
        glued bodies, then the jumps that part them.
        """
        motion = {}
        for name, own in gluing.bodies.items():
            numbers, places = self.numbers[name], (own.dofs, np.arange(len(own.dofs)))
            shape = numbers.shape[0], len(own.dofs)
            placed = sparse.csr_matrix((np.ones(len(own.dofs)), places), shape)
            carried = placed @ own.jumps.scipy()
            motion[name] = sparse.hstack([numbers[:, self.free], carried], format="csr")
        return motion

    def solve(self, loads: Array) -> Array:
        """Displacements (n, m) under loads (n, m)."""
        solution = np.zeros(loads.shape)
        stiffness = self.stiffness[self.free][:, self.free]
        solution[self.free] = solve_symmetric(stiffness, loads[self.free])
        return solution
