"""The joints of a small model in time steps: dense matrices, assembled by one product.

A time step takes few iterations, and there are thousands of them: for a few hundred unknowns the
Woodbury formula of joint/linear_system.py costs more than factorising the matrix itself.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from ..arrays import Array
from ..fem.condensed import Condensed
from ..joint.interface import Interface
from ..joint.linear_system import Border, Change, lu_solve

#: Largest number of unknowns.
MOST_UNKNOWNS = 400


class SmallInterface(Interface):
    """The same joints with other bodies around them."""

    def __init__(self, interface: Interface, bulk: Condensed) -> None:
        vars(self).update(vars(interface))
        self.bulk, self._undamaged = bulk, None
        number, d = len(self.weights), self.dim
        size = self.at_points.shape[1]
        rows, columns, values = [], [], []
        for q in range(number):
            block = self.at_points[d * q : d * (q + 1)]
            touched = np.unique(block.indices)
            local = block.columns(touched).toarray()
            # d (B^T W T B)[a, b] / d T[k, l]
            parts = self.weights[q] * np.einsum("ka,lb->abkl", local, local)
            places = touched[:, None] * size + touched
            rows.append(np.repeat(places.ravel(), d * d))
            entries = q * d * d + np.arange(d * d)
            columns.append(np.tile(entries, places.size))
            values.append(parts.ravel())
        joined = (np.concatenate(part) for part in (values, rows, columns))
        data, row, column = joined
        #: entries of the stiffness (j * j) from those of the tangents (q * dim * dim)
        self.assembly = sparse.csr_matrix((data, (row, column)), (size * size, number * d * d))

    def change(self, tangent: Array, undamaged: Array) -> Change:
        """See `Interface`: all rows, dense, with the stiffness of the undamaged joints."""
        size, d = self.at_points.shape[1], self.dim
        entries = np.ascontiguousarray(tangent[:, :d, :d]).ravel()
        law = (self.assembly @ entries).reshape(size, size)
        return Change(law=law, rows=np.arange(size))

    def solve(
        self, undamaged: Array, change: Change, right: Array, border: Border | None
    ) -> tuple[Array, float]:
        """See `Interface`; neither border nor flow."""
        return lu_solve(self.bulk.stiffness + change.law, right), 0.0
