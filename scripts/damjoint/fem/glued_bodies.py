"""All bodies of a case glued at their joints: a single elastic body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, IntArray, Sparse, others
from ..csr import CsrMatrix
from .bodies import ElasticBody
from .factor import solve_symmetric
from .gluing import Gluing


@dataclass(frozen=True, kw_only=True)
class GluedBodies:
    """All bodies, glued at the joints to a single elastic body of n degrees of freedom."""

    bodies: dict[str, ElasticBody]
    #: n
    size: int
    #: degrees of freedom that are not fixed
    free: IntArray
    #: by body: the number of each of its degrees of freedom; those of the last body come first
    numbers: dict[str, IntArray]

    @staticmethod
    def of(bodies: dict[str, ElasticBody], gluing: Gluing) -> GluedBodies:
        """Number the degrees of freedom."""
        shared = np.full(gluing.nodes, -1)
        numbers, fixed, size = {}, list[IntArray](), 0
        for name, body in reversed(bodies.items()):
            of_body, dofs = gluing.bodies[name], body.stiffness.shape[0]
            number = np.full(dofs, -1)
            number[of_body.dofs] = shared[of_body.node]
            new = np.flatnonzero(number < 0)
            number[new] = size + np.arange(len(new))
            shared[of_body.node] = number[of_body.dofs]
            size += len(new)
            numbers[name] = number
            fixed.append(number[body.fixed_dofs])
        free = others(size, np.concatenate(fixed))
        return GluedBodies(bodies=bodies, size=size, free=free, numbers=numbers)

    def motion(self, gluing: Gluing) -> dict[str, Sparse]:
        """By body b: T_b of u_b = T_b w; w: glued bodies' displacements, jumps between them."""
        from scipy import sparse

        def boolean(rows: IntArray, columns: IntArray, shape: tuple[int, int]) -> Sparse:
            return sparse.csr_matrix((np.ones(len(rows)), (rows, columns)), shape)

        motion = {}
        for name, of_body in gluing.bodies.items():
            number, count = self.numbers[name], len(self.numbers[name])
            glued = boolean(np.arange(count), number, (count, self.size))
            on_joints = np.arange(len(of_body.dofs))
            carried = (
                boolean(of_body.dofs, on_joints, (count, len(of_body.dofs))) @ of_body.jumps.scipy()
            )
            motion[name] = sparse.hstack([glued[:, self.free], carried], format="csr")
        return motion

    def stiffness(self) -> CsrMatrix:
        """Stiffness of the free degrees of freedom [N/m]."""
        position = np.full(self.size, -1, np.int32)
        position[self.free] = np.arange(len(self.free))
        parts = []
        for name, body in self.bodies.items():
            number = position[self.numbers[name]]
            rows = np.repeat(number, body.stiffness.counts)
            columns = number[body.stiffness.indices]
            free = (rows >= 0) & (columns >= 0)
            parts.append((body.stiffness.data[free], rows[free], columns[free]))
        values, rows, columns = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
        return CsrMatrix.of_entries(values, rows, columns, (len(self.free), len(self.free)))

    def solve(self, loads: Array) -> Array:
        """Displacements (n, m) under loads (n, m)."""
        solution = np.zeros(loads.shape)
        solution[self.free] = solve_symmetric(self.stiffness(), loads[self.free])
        return solution
