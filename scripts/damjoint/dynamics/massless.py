"""Rock without mass in the time steps: it follows the bodies on it as at rest.

Of the unknowns w = (w_k, w_m) of a system those of the rock, w_m, have no mass and no load, and
their damping is a_1 times their stiffness: K_mm z_m + K_mk z_k = 0 for z = w + a_1 w' at any time,
from rest on, also in the difference of two times that HHT takes. Therefore w_m = T w_k with
T = -K_mm^-1 K_mk, as at rest, and the steps are those of w_k alone: M_kk, K_kk + K_km T, likewise
the damping. Exact, up to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from ..arrays import Array, IntArray, Sparse, others
from ..csr import CsrMatrix
from ..fem.factor import solve_symmetric
from .system import System

#: Number of entries of T up to which its product takes less time than the rock's elimination.
MOST_ENTRIES = 1_000_000
#: Difference of the rock's damping from a_1 times its stiffness, over the largest entry, up to
#: which it counts as rounding [-].
ROUNDING = 1e-12


@dataclass(frozen=True, kw_only=True)
class MasslessRock:
    """The unknowns (m,) that follow others, `edge` (e,), and all others, `retained` (k,)."""

    inside: IntArray
    retained: IntArray
    #: numbers among `retained`
    edge: IntArray
    #: T (m, e)
    follow: Array

    @staticmethod
    def of(system: System, damping: Sparse) -> MasslessRock | None:
        """The rock of a system with a damping (n, n); None if it has mass, if its damping is not
        proportional to its stiffness, or if it is large.
        """
        with_mass = np.asarray(abs(system.mass).sum(axis=1)).ravel() > 0
        with_mass[system.jumps] = True
        inside = np.flatnonzero(~with_mass)
        if not len(inside):
            return None
        rows, damped = system.stiffness[inside], damping.tocsr()[inside]
        share = abs(damped).sum() / abs(rows).sum()
        if abs(damped - share * rows).max() > ROUNDING * abs(damped).max():
            return None
        retained = others(system.size, inside)
        beside = rows[:, retained].tocsc()
        edge = np.flatnonzero(np.diff(beside.indptr))
        if len(inside) * len(edge) > MOST_ENTRIES:
            return None
        of_rock = CsrMatrix.of_scipy(rows[:, inside])
        follow = -solve_symmetric(of_rock, beside[:, edge].toarray())
        return MasslessRock(
            inside=inside, retained=retained, edge=edge, follow=np.ascontiguousarray(follow)
        )

    def reduce(self, matrix: Sparse) -> Sparse:
        """A symmetric matrix (n, n) in the unknowns `retained` (k, k)."""
        rows = matrix.tocsr()[self.inside]
        across, follow = rows[:, self.retained[self.edge]].T @ self.follow, self.follow
        added = across + across.T + follow.T @ (rows[:, self.inside] @ follow)
        size, number = len(self.retained), len(self.edge)
        entries = np.repeat(self.edge, number), np.tile(self.edge, number)
        at_edge = sparse.csr_matrix((added.ravel(), entries), (size, size))
        return (matrix.tocsr()[self.retained][:, self.retained] + at_edge).tocsr()

    def expand(self, displacement: Array) -> Array:
        """All unknowns (n, ...), from those of `retained` (k, ...)."""
        whole = np.empty((len(self.retained) + len(self.inside), *displacement.shape[1:]))
        whole[self.retained] = displacement
        whole[self.inside] = self.follow @ displacement[self.edge]
        return whole
