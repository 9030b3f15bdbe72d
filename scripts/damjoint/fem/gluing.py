"""Bodies glued at their joints: which degrees of freedom coincide, and which jumps part them.

All bodies glued are a single elastic body with a displacement v, which the rock holds. Each joint
adds its jump to what is above it:

    u_b = v + (sum of the jumps between the lowest body at the node and b).

Where joints meet, m bodies share a node and m - 1 jumps are independent; the jump of any further
joint there is a sum of these.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, IntArray
from ..csr import CsrMatrix
from .bodies import Bodies
from .condensed import JointDofs

#: Size of a matrix up to which a dense product takes less time than scipy takes to load.
FEW_ENTRIES = 400_000

#: A sum of independent jumps: factors by their numbers.
Jumps = dict[int, float]


@dataclass(frozen=True, kw_only=True)
class BodyDofs:
    """The n degrees of freedom of a body on its joints."""

    dofs: IntArray
    #: number of the glued degree of freedom, whose displacement is v (n,)
    node: IntArray
    #: of the jumps that the body carries, from the unknowns (n, unknowns)
    jumps: CsrMatrix

    def on_jumps(self, forces: Array) -> Array:
        """Forces (n, ...) on the degrees of freedom as forces (unknowns, ...) on the jumps."""
        turned = self.jumps.T
        few = turned.shape[0] * turned.shape[1] <= FEW_ENTRIES
        return turned.toarray() @ forces if few else turned @ forces


@dataclass(frozen=True, kw_only=True)
class Gluing:
    """All bodies glued at all joints."""

    #: numbers of independent jumps, and of glued degrees of freedom
    unknowns: int
    nodes: int
    joints: list[JointDofs]
    bodies: dict[str, BodyDofs]

    @staticmethod
    def of(bodies: Bodies) -> Gluing:
        """Glue bodies; jumps fixed in the body above, or at a tip in a body, are no unknowns."""
        names = list(bodies.by_name)
        sizes = [body.stiffness.shape[0] for body in bodies.by_name.values()]
        first = dict(zip(names, np.cumsum([0, *sizes[:-1]]), strict=True))
        number, row, above, below = [], [], [], []
        for k, joint in enumerate(bodies.mesh.joints):
            upper, lower = bodies.by_name[joint.upper], bodies.by_name[joint.lower]
            on_upper = first[joint.upper] + upper.joint_dofs[k, True]
            on_lower = first[joint.lower] + lower.joint_dofs[k, False]
            fixed = np.isin(upper.joint_dofs[k, True], upper.fixed_dofs)
            free = np.flatnonzero(~fixed & (on_upper != on_lower))  # not at a tip
            number.append(np.full(len(free), k))
            row.append(free)
            above.append(on_upper[free])
            below.append(on_lower[free])
        of_joint, rows, up, low = map(np.concatenate, (number, row, above, below))

        roots, carried, independent = trees(up, low, sum(sizes))
        column = np.cumsum(independent) - 1
        unknowns = int(independent.sum())
        _, where, position = np.unique(roots[low], return_index=True, return_inverse=True)
        order = np.argsort(np.argsort(where))  # in the order in which the joints have them
        node = np.full(sum(sizes), -1)
        node[low] = node[up] = order[position]

        def of_body(name: str) -> BodyDofs:
            end = first[name] + sizes[names.index(name)]
            above, below = ((m >= first[name]) & (m < end) for m in (up, low))
            functions = np.column_stack([up, low])[np.column_stack([above, below])]
            functions = functions[np.sort(np.unique(functions, return_index=True)[1])]
            matrix = combined([carried.get(int(m), {}) for m in functions], column, unknowns)
            return BodyDofs(dofs=functions - first[name], node=node[functions], jumps=matrix)

        def of_joints(k: int) -> JointDofs:
            of_this = np.flatnonzero(of_joint == k)
            jumps = (
                {int(e): 1.0}
                if independent[e]
                else difference(carried.get(int(up[e]), {}), carried.get(int(low[e]), {}))
                for e in of_this
            )
            entries = combined(list(jumps), column, unknowns)
            return JointDofs(
                rows=rows[of_this][entries.rows], columns=entries.indices, factors=entries.data
            )

        return Gluing(
            unknowns=unknowns,
            nodes=len(where),
            joints=[of_joints(k) for k in range(len(bodies.mesh.joints))],
            bodies={name: of_body(name) for name in names},
        )


def trees(up: IntArray, low: IntArray, size: int) -> tuple[IntArray, dict[int, Jumps], np.ndarray]:
    """The tree of degrees of freedom that each jump e joins, from low[e] to up[e].

    Returns the root of each degree of freedom (size,), the sum of jumps from the root to it where
    it is not the root itself, and which jumps are independent (those that join two trees).
    """
    roots, independent = np.arange(size), np.ones(len(up), bool)
    shared = np.bincount(np.concatenate([up, low]), minlength=size) > 1
    meeting = shared[up] | shared[low]
    roots[up[~meeting]] = low[~meeting]
    carried: dict[int, Jumps] = {int(up[e]): {int(e): 1.0} for e in np.flatnonzero(~meeting)}
    members: dict[int, list[int]] = {}
    for e in np.flatnonzero(meeting).tolist():
        a, b = int(low[e]), int(up[e])
        keep, join = int(roots[a]), int(roots[b])
        if keep == join:
            independent[e] = False
            continue
        # u_b - u_a is jump e: what b's tree carries counts from a's root
        offset = difference(carried.get(a, {}), carried.get(b, {}))
        offset[e] = 1.0
        moved = members.pop(join, [join])
        for member in moved:
            roots[member] = keep
            carried[member] = difference(carried.get(member, {}), offset, -1.0)
        members.setdefault(keep, [keep]).extend(moved)
    return roots, carried, independent


def difference(one: Jumps, other: Jumps, factor: float = 1.0) -> Jumps:
    """one - factor * other, without zero terms."""
    result = dict(one)
    for jump, value in other.items():
        result[jump] = result.get(jump, 0.0) - factor * value
    return {jump: value for jump, value in result.items() if value}


def combined(rows: list[Jumps], column: IntArray, unknowns: int) -> CsrMatrix:
    """Sums of jumps as a matrix (rows, unknowns); column: of each jump."""
    pointers = np.cumsum([0, *map(len, rows)])
    jumps = np.array([jump for row in rows for jump in row], int)
    factors = np.array([value for row in rows for value in row.values()])
    return CsrMatrix(factors, column[jumps], pointers, (len(rows), unknowns))
