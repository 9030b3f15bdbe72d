"""Linear systems of Newton's method with the bodies of a large 3D model uncondensed, by GMRES.

GMRES (Saad and Schultz, SIAM J. Sci. Stat. Comput. 7, 1986) serves all tangents: those of friction
are unsymmetric, those of softening indefinite. Its preconditioner is a cycle of multigrid with the
positive semidefinite part of the laws' tangents and without the derivative of flowing water.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.linalg import norm

from ..arrays import Array
from ..fem.multigrid import Multigrid
from ..fem.uncondensed import Uncondensed
from .assembly import Assembly
from .linear_system import Border, Stalled, Tangent, lift_matrix

#: Residual over the right side at which a solution ends [-]: Newton's method corrects the rest, in
#: one or two more iterations than with exact solutions.
ACCURACY = 1e-2
#: Most iterations, usually 5 to 15, and ...
MOST_ITERATIONS = 150
#: ... the residual after them [-] above which the iteration stalls.
STALLED = 0.1


class IterativeSystem:
    """Linear systems of uncondensed bodies with joints; see `LinearSystem`."""

    def __init__(self, assembly: Assembly, bodies: Uncondensed) -> None:
        self.assembly, self.bodies, self.elastic = assembly, bodies, bodies.elastic
        #: iterations of GMRES so far
        self.iterations = 0

    @cached_property
    def multigrid(self) -> Multigrid:
        """The levels of the bodies."""
        return Multigrid(self.bodies)

    def solve(
        self, tangent: Tangent, right: Array, border: Border | None = None
    ) -> tuple[Array, float]:
        """See `LinearSystem`.

        Raises Stalled.
        """
        elastic, on_joints = self.elastic, self.multigrid.joint
        joints = self.assembly.whole(tangent.law)[on_joints].columns(on_joints).scipy()
        precondition = self.multigrid.cycle_with(joints)
        flow = tangent.flow
        lift = lift_matrix(tangent.flowing) if flow else None

        def product(x: Array) -> Array:
            result: Array = elastic @ x
            result[on_joints] += joints @ x[on_joints]
            if flow and lift:
                result -= lift @ (flow.pressure @ x[flow.columns])
            return result

        if border is None:
            x, iterations = gmres(product, right, precondition)
            self.iterations += iterations
            return x, 0.0
        by_slope = precondition(border.slope)
        pivot = border.rate - border.row @ by_slope
        # a force for the gap, as that of the slope for the same displacement
        weight = norm(border.slope) / abs(pivot) if pivot else 1.0

        def bordered(x: Array) -> Array:
            gap = weight * (border.row @ x[:-1] + border.rate * x[-1])
            return np.append(product(x[:-1]) + x[-1] * border.slope, gap)

        def eliminated(right: Array) -> Array:
            x = precondition(right[:-1])
            s = (right[-1] / weight - border.row @ x) / pivot
            return np.append(x - s * by_slope, s)

        whole, iterations = gmres(bordered, np.append(right, weight * border.gap), eliminated)
        self.iterations += iterations
        return whole[:-1], float(whole[-1])


def gmres(
    product: Callable[[Array], Array], right: Array, precondition: Callable[[Array], Array]
) -> tuple[Array, int]:
    """Solve a linear system to ACCURACY, preconditioned from the right; also the number of
    iterations.

    Raises Stalled.
    """
    size = norm(right)
    if not size:
        return np.zeros_like(right), 0
    basis, directions = [right / size], list[Array]()
    hessenberg = np.zeros((MOST_ITERATIONS + 1, MOST_ITERATIONS))
    for k in range(MOST_ITERATIONS):
        directions.append(precondition(basis[k]))
        new = product(directions[k])
        for i, vector in enumerate(basis):
            hessenberg[i, k] = vector @ new
            new = new - hessenberg[i, k] * vector
        hessenberg[k + 1, k] = norm(new)
        first = np.eye(k + 2, 1)[:, 0]
        factors = np.linalg.lstsq(hessenberg[: k + 2, : k + 1], first, rcond=None)[0]
        rest = norm(first - hessenberg[: k + 2, : k + 1] @ factors)
        if rest <= ACCURACY or not hessenberg[k + 1, k]:
            break
        basis.append(new / hessenberg[k + 1, k])
    if not rest <= STALLED:
        raise Stalled(
            f"engine = iterative: the residual of a linear system is {rest:.2g} of its right side "
            f"after {MOST_ITERATIONS} iterations, as elements are too flat, or the dam is near "
            "failure; use engine = condensed"
        )
    return size * sum(f * d for f, d in zip(factors, directions, strict=True)), len(directions)
