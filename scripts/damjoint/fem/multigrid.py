"""Preconditioner of the bodies with their joints: a V-cycle of smoothed aggregation (Vanek, Mandel
and Brezina, Computing 56, 1996), with the six rigid motions of each body in its coarse spaces.

What the joints carry changes in each iteration of Newton's method, from glued to open; the bodies
never do. So the coarse spaces depend on the bodies alone, and are made once:

- Aggregates are those of the glued bodies, each divided into its parts in each body. Then the
  aggregates of both faces of a joint match, and a coarse function exists with a jump and without.
- Prolongations are smoothed by the stiffness K of the bodies alone, and never cross a joint.

Of a new stiffness J of the joints, only the coarse matrices P^T J P and the blocks of the smoother
at the joints are made. The smoother is Chebyshev's method, scaled by the blocks of the diagonal
that belong to one glued function, so that a stiff joint is inside of a block.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..arrays import Array, IntArray, Sparse, distinct
from .uncondensed import Uncondensed

#: Number of unknowns up to which a level is the coarsest, and solved by a dense inverse.
COARSEST = 600
#: Size of the block that couples two nodes over those of both on the diagonal from which on the
#: coupling is strong: only along strong ones are aggregates formed, across thin elements.
STRONG = 0.02
#: Degree of Chebyshev's polynomial.
DEGREE = 2
#: Largest over smallest eigenvalue that it damps [-].
DAMPED = 10.0
#: Part of the largest singular value below which rigid motions of an aggregate are dependent.
DEPENDENT = 1e-6
#: Iterations of the power method.
POWER_ITERATIONS = 12
#: Factor by which its estimate of the largest eigenvalue is raised [-]: it is too small.
RAISED = 1.1


@dataclass(frozen=True)
class Level:
    """A level of n unknowns, the interpolation from m of the next one; in single precision."""

    #: K (n, n), and the inverse of the blocks of its diagonal
    stiffness: Sparse
    inverse: Sparse
    #: P (n, m) and P^T
    prolongation: Sparse
    restriction: Sparse
    #: unknowns on which the joints act (l,), and all of those nodes (k,)
    joint: IntArray
    beside: IntArray
    #: K and the nodes (k,) of the latter
    beside_stiffness: Sparse
    beside_node: IntArray
    #: from the unknowns on which the joints act to those of the next level (l, ...)
    joint_prolongation: Sparse


@dataclass(frozen=True)
class Smoother:
    """Chebyshev's method on a level with joints: A = K + J."""

    level: Level
    #: J (l, l)
    joints: Sparse
    #: inverse of the blocks of A's diagonal where the joints act (k, k)
    inverse: Sparse
    #: largest eigenvalue of the product of the inverse of all blocks with A
    largest: float = 0.0

    def product(self, x: Array) -> Array:
        """A x."""
        result: Array = self.level.stiffness @ x
        result[self.level.joint] += self.joints @ x[self.level.joint]
        return result

    def scaled(self, residual: Array) -> Array:
        """The product of the inverse of the blocks with a residual."""
        result: Array = self.level.inverse @ residual
        result[self.level.beside] = self.inverse @ residual[self.level.beside]
        return result

    def correction(self, residual: Array) -> Array:
        """An approximate A^-1 residual."""
        middle, half = (1 + 1 / DAMPED) / 2 * self.largest, (1 - 1 / DAMPED) / 2 * self.largest
        step = self.scaled(residual) / middle
        x, ratio = step, half / middle
        for _ in range(DEGREE - 1):
            residual = residual - self.product(step)
            ratio, before = 1 / (2 * middle / half - ratio), ratio
            step = ratio * before * step + 2 * ratio / half * self.scaled(residual)
            x = x + step
        return x


class Multigrid:
    """The levels of the bodies; `cycle_with` makes a preconditioner of them."""

    def __init__(self, bodies: Uncondensed) -> None:
        matrix, rigid, body, node = bodies.elastic, bodies.rigid, bodies.body, bodies.node
        number, joint = int(body.max()) + 1, bodies.on_joints
        #: the unknowns on which the joints act
        self.joint = joint
        self.levels: list[Level] = []
        while matrix.shape[0] > COARSEST:
            node = np.unique(node, return_inverse=True)[1]
            inverse = block_inverse(matrix, node)
            largest = largest_eigenvalue(inverse.dot, matrix.dot, len(node))
            parts, part = np.unique(
                aggregates(graph(matrix, node, rigid))[node] * number + body, return_inverse=True
            )
            tentative, rigid, owner = tentative_prolongation(part, rigid)
            smoothed = tentative - inverse @ (matrix @ tentative) * (4 / 3 / largest)
            restriction = smoothed.T.tocsr()
            beside = np.flatnonzero(np.isin(node, node[joint]))
            from_joint = smoothed[joint]
            below = distinct(from_joint.indices)
            level = Level(
                stiffness=single(matrix),
                inverse=single(inverse),
                prolongation=single(smoothed),
                restriction=single(restriction),
                joint=joint,
                beside=beside,
                beside_stiffness=matrix[beside][:, beside],
                beside_node=np.unique(node[beside], return_inverse=True)[1],
                joint_prolongation=from_joint[:, below],
            )
            self.levels.append(level)
            matrix, joint = (restriction @ (matrix @ smoothed)).tocsr(), below
            node, body = np.divmod(parts[owner], number)
        #: K of the coarsest level, and the unknowns there on which the joints act
        self.coarsest: Array = matrix.toarray()
        self.coarsest_joint = joint

    def cycle_with(self, joints: Sparse) -> Callable[[Array], Array]:
        """The V-cycle, an approximate inverse of the bodies with a stiffness of the joints, which
        may be unsymmetric (on the unknowns `joint`).
        """
        smoothers = list[Smoother]()
        for level in self.levels:
            entries = joints.tocoo()
            at = np.searchsorted(level.beside, level.joint)
            size = len(level.beside)
            added = sparse.csr_matrix(
                (entries.data, (at[entries.row], at[entries.col])), (size, size)
            )
            blocks = block_inverse(level.beside_stiffness + added, level.beside_node)
            smoother = Smoother(level, single(joints), single(blocks))
            size = level.stiffness.shape[0]
            largest = largest_eigenvalue(smoother.scaled, smoother.product, size)
            smoothers.append(replace(smoother, largest=largest))
            joints = level.joint_prolongation.T @ (joints @ level.joint_prolongation)
        matrix = self.coarsest.copy()
        matrix[np.ix_(self.coarsest_joint, self.coarsest_joint)] += joints.toarray()
        coarsest = np.linalg.inv(matrix)

        def cycle(residual: Array, depth: int = 0) -> Array:
            if depth == len(smoothers):
                return np.asarray(single(coarsest @ residual))
            level, smoother = self.levels[depth], smoothers[depth]
            x = smoother.correction(residual)
            below = cycle(level.restriction @ (residual - smoother.product(x)), depth + 1)
            x = x + level.prolongation @ below
            return np.asarray(x + smoother.correction(residual - smoother.product(x)))

        return lambda residual: cycle(single(residual)).astype(float)


def single(values: Any) -> Any:
    """An array or a matrix in single precision."""
    return values.astype(np.float32)


def graph(matrix: Sparse, node: IntArray, rigid: Array) -> Sparse:
    """Which nodes a matrix (n, n) couples strongly, each with itself; without unknowns that have
    no part in rigid motions (n, 6).
    """
    used = np.flatnonzero(rigid.any(axis=1))
    shape = len(node), int(node.max()) + 1
    at = sparse.csr_matrix((np.ones(len(used), np.float32), (used, node[used])), shape)
    squares = at.T @ (single(matrix).power(2) @ at)
    size = np.sqrt(squares.diagonal())
    squares = squares.tocoo()
    strong = squares.data >= STRONG**2 * size[squares.row] * size[squares.col]
    nodes = np.arange(shape[1])
    rows, columns = (np.append(part[strong], nodes) for part in (squares.row, squares.col))
    return sparse.csr_matrix((np.ones(len(rows), np.int8), (rows, columns)), (shape[1],) * 2)


def aggregates(graph: Sparse) -> IntArray:
    """Number of the aggregate of each node of a graph: what is around roots no two of which have a
    neighbour in common, the first ones in a random order.
    """
    size = graph.shape[0]
    rank = np.random.default_rng(0).permutation(size)

    def highest(values: NDArray[Any]) -> NDArray[Any]:
        """The highest value of each node and its neighbours."""
        return np.maximum.reduceat(values[graph.indices], graph.indptr[:-1])

    undecided, roots = np.ones(size, bool), np.zeros(size, bool)
    while undecided.any():
        ranks = np.where(undecided, rank, -1)
        new = undecided & (highest(highest(ranks)) == rank)
        roots |= new
        undecided &= ~highest(highest(new))
    aggregate = np.where(roots, np.cumsum(roots) - 1, -1)
    for _ in range(2):
        aggregate = np.where(aggregate < 0, highest(aggregate), aggregate)
    return aggregate


def tentative_prolongation(part: IntArray, rigid: Array) -> tuple[Sparse, Array, IntArray]:
    """Orthonormal rigid motions of each part of the unknowns, zero elsewhere (n, m); the rigid
    motions by them (m, 6), and the part of each (m,).
    """
    sizes = np.bincount(part)
    order, starts = np.argsort(part, kind="stable"), np.cumsum(sizes) - sizes
    owners, coarse, rows, columns, values = [], [], [], [], []
    count = 0
    for size in distinct(sizes):
        parts = np.flatnonzero(sizes == size)
        unknowns = order[starts[parts][:, None] + np.arange(size)]
        basis, strengths, by_basis = np.linalg.svd(rigid[unknowns], full_matrices=False)
        which, number = np.nonzero(strengths > DEPENDENT * strengths[:, :1])
        owners.append(parts[which])
        coarse.append(strengths[which, number, None] * by_basis[which, number])
        rows.append(unknowns[which].ravel())
        columns.append(np.repeat(count + np.arange(len(which)), size))
        values.append(basis[which, :, number].ravel())
        count += len(which)
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    tentative = sparse.csr_matrix(entries, (len(part), count))
    return tentative, np.concatenate(coarse), np.concatenate(owners)


def block_inverse(matrix: Sparse, node: IntArray) -> Sparse:
    """The inverse of a matrix's blocks (n, n) of a node; unknowns without stiffness stay so."""
    size, entries = len(node), matrix.tocoo()
    inside = node[entries.row] == node[entries.col]
    row, column, value = (part[inside] for part in (entries.row, entries.col, entries.data))
    sizes = np.bincount(node)
    order, starts = np.argsort(node, kind="stable"), np.cumsum(sizes) - sizes
    position = np.empty(size, int)
    position[order] = np.arange(size) - starts[node[order]]
    rows, columns, values = [], [], []
    for width in distinct(sizes[sizes > 0]):
        nodes = np.flatnonzero(sizes == width)
        number = np.full(len(sizes), -1)
        number[nodes] = np.arange(len(nodes))
        of_these = np.flatnonzero(number[node[row]] >= 0)
        blocks = np.zeros((len(nodes), width, width))
        r, c = row[of_these], column[of_these]
        blocks[number[node[r]], position[r], position[c]] = value[of_these]
        diagonal = np.einsum("pii->pi", blocks)
        empty = diagonal <= 0
        diagonal[empty] = 1
        inverse = np.linalg.inv(blocks)
        np.einsum("pii->pi", inverse)[empty] = 0
        unknowns = order[starts[nodes][:, None] + np.arange(width)]
        rows.append(np.repeat(unknowns, width, axis=1).ravel())
        columns.append(np.tile(unknowns, width).ravel())
        values.append(inverse.ravel())
    of_blocks = np.concatenate(rows), np.concatenate(columns)
    return sparse.csr_matrix((np.concatenate(values), of_blocks), (size, size))


def largest_eigenvalue(
    scaled: Callable[[Array], Array], product: Callable[[Array], Array], size: int
) -> float:
    """The largest eigenvalue of `scaled` after `product`, by the power method, raised a little."""
    x: Array = single(np.random.default_rng(0).random(size) - 0.5)
    for _ in range(POWER_ITERATIONS):
        x = scaled(product(x / np.linalg.norm(x)))
    return RAISED * float(np.linalg.norm(x))
