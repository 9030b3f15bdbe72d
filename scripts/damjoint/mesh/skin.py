"""The ends of joints that do not reach the surface of the dam and its rock."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import IntArray
from .body import Body
from .topology import tags_of


def inner_ends(ends: Sequence[Body], surfaces: Sequence[Body], skin: Body) -> list[IntArray]:
    """Tags of the nodes of each end of a joint, heel or toe, that lies inside the dam or on its
    rock, at another joint, and not on the surface: there the water comes from the other joint.

    surfaces: of the joints; skin: the surface of dam and rock.
    """
    tags, count = np.unique(
        np.concatenate([surface.node_tags for surface in surfaces]), return_counts=True
    )
    shared = tags[count > 1]
    sides = [table[np.isin(table, shared).any(axis=1)] for table in tags_of(skin)]
    return [inner_part(end, shared, sides) for end in ends]


def inner_part(end: Body, shared: IntArray, skin: list[IntArray]) -> IntArray:
    """Tags of the nodes of an end that only elements inside have: those of which all nodes are
    shared with other joints, and that are no part of the skin.

    skin: node tags of its elements, a table for each shape.
    """
    elements = np.concatenate([end.node_tags[table] for _, table in end.cells])

    def on_skin(element: IntArray) -> bool:
        return any((np.isin(sides, element).sum(axis=1) == len(element)).any() for sides in skin)

    inside = np.isin(elements, shared).all(axis=1)
    inside &= np.array([not on_skin(element) for element in elements])
    return np.setdiff1d(elements[inside], elements[~inside])
