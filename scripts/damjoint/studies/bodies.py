"""The condensed bodies that a study's scenes share."""

from __future__ import annotations

from ..engines.condensed import cache
from ..joint.interface import Interface
from ..model.case import Case

_LAST: dict[tuple, Interface] = {}


def interface_of(case: Case) -> Interface:
    """The joint of a case with its condensed bodies; the last one used stays in memory."""
    key = *cache.key_of(case), case["quadrature"]
    if key not in _LAST:
        _LAST.clear()
        _LAST[key] = Interface(cache.cached(case)[0], case["quadrature"])
    return _LAST[key]
