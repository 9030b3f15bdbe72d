"""The surface of the dam and its rock, and the ends of joints that do not reach it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import IntArray
from .body import SIDES, Body


def inner_ends(
    ends: Sequence[Body], surfaces: Sequence[Body], solids: Sequence[Body]
) -> list[IntArray]:
    """Tags of the nodes of each end of a joint, heel or toe, that lies inside the dam or on its
    rock, at another joint, and not on the surface: there the water comes from the other joint.

    surfaces: of the joints; solids: the bodies.
    """
    tags, count = np.unique(
        np.concatenate([surface.node_tags for surface in surfaces]), return_counts=True
    )
    shared = tags[count > 1]
    skin = skin_at(shared, solids)
    return [inner_part(end, shared, skin) for end in ends]


def inner_part(end: Body, shared: IntArray, skin: list[IntArray]) -> IntArray:
    """Tags of the nodes of an end that only elements inside have: those of which all nodes are
    shared with other joints, and that are no part of the skin.
    """
    elements = np.concatenate([end.node_tags[table] for _, table in end.cells])

    def on_skin(element: IntArray) -> bool:
        return any((np.isin(sides, element).sum(axis=1) == len(element)).any() for sides in skin)

    inside = np.isin(elements, shared).all(axis=1)
    inside &= np.array([not on_skin(element) for element in elements])
    return np.setdiff1d(elements[inside], elements[~inside])


def skin_at(nodes: IntArray, solids: Sequence[Body]) -> list[IntArray]:
    """The sides of cells that no other cell of the bodies has, as node tags (sides, corners), by
    their number of corners; of the cells at some nodes.
    """
    tables: dict[int, list[IntArray]] = {}
    for solid in solids:
        for shape, cells in solid.cells:
            at_nodes = np.isin(solid.node_tags[cells], nodes).any(axis=1)
            for side in SIDES[shape]:
                sides = solid.node_tags[cells[at_nodes][:, side]]
                tables.setdefault(len(side), []).append(sides)
    skin = []
    for of_shape in tables.values():
        sides, count = np.unique(
            np.sort(np.concatenate(of_shape), axis=1), axis=0, return_counts=True
        )
        skin.append(sides[count == 1])
    return skin
