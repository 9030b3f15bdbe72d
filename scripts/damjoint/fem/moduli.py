"""Condensed bodies with slightly different moduli, without condensing them for each.

All responses are homogeneous in the moduli of concrete and rock together: the stiffness is
proportional to them, the joints' forces by loads do not change, displacements are inverse to them.
Their derivatives with E_found so follow from those with E_dam [Euler's theorem].
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from ..arrays import Array
from ..input.case import Case
from .cache import condensed_bodies
from .condensed import Condensed

#: Half of the difference of E_dam, over its value [-].
STEP = 1e-4
#: Endings of the unit loads that are strains, whose forces are proportional to the moduli.
STRAINS = "_uniform", "_linear"

Response = TypeVar("Response", Array, float)


class Moduli:
    """The condensed bodies of a case beside its moduli, to first order."""

    def __init__(self, case: Case, bulk: Condensed) -> None:
        self.case, self.bulk = case, bulk

    @cached_property
    def sides(self) -> tuple[Condensed, Condensed]:
        """The bodies with E_dam below and above its value; as all bodies, from the cache or added
        to it.

        Raises RunError.
        """
        pair = (self.case["E_dam"] * (1 + sign * STEP) for sign in (-1, 1))
        low, high = (condensed_bodies(self.case.with_values({"E_dam": E}))[0] for E in pair)
        return low, high

    @property
    def known(self) -> bool:
        """Whether the known bodies have the same wet faces: a search's may have more."""
        return all(one.pressure.shape == self.bulk.pressure.shape for one in self.sides)

    def changed(self, dam: float, found: float) -> Condensed:
        """The bodies with relative changes of E_dam and E_found."""
        bulk = self.bulk
        low, high = self.sides if dam != found else (bulk, bulk)

        def of(value: Response, low: Response, high: Response, degree: int) -> Response:
            """A response that is homogeneous of a degree."""
            result = value * (1 + degree * found) if degree else value
            return result if dam == found else result + (high - low) * ((dam - found) / (2 * STEP))

        def strain(name: str) -> int:
            return int(name.endswith(STRAINS))

        units = {n: of(v, low.units[n], high.units[n], strain(n)) for n, v in bulk.units.items()}
        measures = {
            name: replace(
                one,
                jump=of(one.jump, a.jump, b.jump, 0),
                pressure=of(one.pressure, a.pressure, b.pressure, -1),
                units={
                    n: of(v, a.units[n], b.units[n], strain(n) - 1) for n, v in one.units.items()
                },
            )
            for name, one in bulk.measures.items()
            for a, b in [(low.measures[name], high.measures[name])]
        }

        def dense(name: str, degree: int) -> Array:
            ends = (np.asarray(getattr(one, name), float) for one in (bulk, low, high))
            value, below, above = ends
            return of(value, below, above, degree)

        return replace(
            bulk,
            stiffness=dense("stiffness", 1),
            pressure=dense("pressure", 0),
            units=units,
            measures=measures,
        )
