"""Units that suit the size of a value, for all that is shown: name, number per SI unit."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

Units = tuple[tuple[str, float], ...]

LENGTHS: Units = (("m", 1), ("mm", 1e3), ("µm", 1e6), ("nm", 1e9))
METRES = LENGTHS[:1]
#: A heading with units in brackets shows this one as nothing or [-].
NUMBER: Units = (("", 1.0),)
STRESSES: Units = (("MPa", 1e-6), ("kPa", 1e-3), ("Pa", 1))
FORCES: Units = (("MN/m", 1e-6), ("kN/m", 1e-3), ("N/m", 1))
MOMENTS: Units = (("MN m/m", 1e-6), ("kN m/m", 1e-3), ("N m/m", 1))
#: Mass flux per metre of thickness; tiny in a joint without a crack.
FLUXES: Units = tuple((f"{name}g/(m s)", 1000.0**i) for i, name in enumerate(["k", "", *"mµnp"]))


#: Units of zeros, where they are among the units.
OF_ZEROS = "mm", "MPa"


def unit(values: Iterable[np.ndarray], units: Units) -> tuple[str, float]:
    """The first unit in which the largest value is at least 1; of zeros one of OF_ZEROS, or the
    first one; name and factor.
    """
    largest = max((np.abs(v).max(initial=0) for v in values), default=0)
    if not largest:
        return next((u for u in units if u[0] in OF_ZEROS), units[0])
    return next((u for u in units if largest * u[1] >= 1), units[-1])


#: Units of a time [s], the largest first; least length of a time in its unit.
TIMES: Units = (("d", 1 / 86400), ("h", 1 / 3600), ("min", 1 / 60), ("s", 1))
LEAST_TIME = 4.0


def unit_of_time(length: float) -> tuple[str, float]:
    """The first unit of TIMES in which a length [s] is at least LEAST_TIME; name and factor."""
    return next((u for u in TIMES if length * u[1] >= LEAST_TIME), TIMES[-1])


def with_slash(unit: str) -> str:
    """A parameter's unit as it is printed: in ONELAB's labels a slash would separate groups."""
    return unit.replace(" per ", "/")


def with_unit(value: float, units: Units, digits: int = 4) -> str:
    """Format a value with some digits and its unit."""
    name, factor = unit([np.atleast_1d(value)], units)
    return f"{value * factor:.{digits}g} {name}"
