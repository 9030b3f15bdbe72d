"""The dashpots of the published test SDNV138 (code_aster), for verification: time_integration.

They act between the corner nodes of a joint element while its first Gauss point, at the end of the
last step, is closed: that at the heel's end of an element of order 1, at the toe's of order 2.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import sparse

from ..arrays import Array, Sparse
from ..csr import CsrMatrix
from ..joint.interface import JointInterface
from ..solver.state import State
from .step import Problem


def with_corner_dashpots(problem: Problem, state: State) -> Problem:
    """A problem with its dashpots as damping, for a step that begins at a state."""
    jumps, joints = problem.system.jumps, problem.model.equilibrium.interface.joints
    parts = [corner_dashpots(joint, problem.dashpots, state) for joint in joints]
    others = sparse.csr_matrix((jumps[0], jumps[0]))
    damping = problem.damping + sparse.block_diag([others, sum(parts)], format="csr")
    return replace(problem, damping=damping, dashpots=np.zeros(3))


def corner_dashpots(joint: JointInterface, dashpots: Array, state: State) -> Sparse:
    """Damping of the dashpots (3,) [Pa s/m] of a joint at a state (j, j): the area of each closed
    element in equal parts at its corners.
    """
    points, opening = joint.points, joint.jumps(joint.at_points, state.jump)[:, 0]
    from_first = points.positions[:, 0] * (1 if joint.order == 1 else -1)
    order = np.lexsort((from_first, points.elements))
    _, starts = np.unique(points.elements[order], return_index=True)
    areas = np.bincount(points.elements, points.weights) * (opening[order[starts]] < 0)
    result, first = sparse.csr_matrix((len(state.jump), len(state.jump))), 0
    for _, cells in joint.surface.cells:
        of_cells, corners = slice(first, first + len(cells)), cells.shape[1]
        first += len(cells)
        size = cells.size, len(joint.space.locations)
        values = CsrMatrix(np.ones(cells.size), cells.ravel(), np.arange(cells.size + 1), size)
        frames = np.repeat(joint.frames[of_cells], corners, axis=0)
        at_corners = joint.components(values, frames).scipy()
        parts = np.outer(np.repeat(areas[of_cells] / corners, corners), dashpots[: joint.dim])
        result = result + at_corners.T @ sparse.diags(parts.ravel()) @ at_corners
    return result
