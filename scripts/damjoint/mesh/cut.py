"""A body cut along a joint inside it: the elements above the joint get nodes of their own."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np

from ..arrays import Array, IntArray
from .body import Body


def cut(body: Body, surface: Body, upwards: Array, new_tag: int) -> tuple[Body, IntArray]:
    """The body, cut; and the tags of the surface's nodes above it.

    A node around which all elements are still connected, a tip, is not divided. upwards: normals of
    the surface's elements, to the side above (elements, 3); new_tag: the first tag of new nodes.
    """
    tags = surface.node_tags.tolist()
    cells = [body.node_tags[row].tolist() for _, table in body.cells for row in table]
    around: dict[int, list[int]] = {tag: [] for tag in tags}
    for number, cell in enumerate(cells):
        for tag in around.keys() & set(cell):
            around[tag].append(number)
    facets = [frozenset(surface.node_tags[row].tolist()) for _, t in surface.cells for row in t]
    sides = body.middles(), surface.middles()

    def is_above(cell: int, tag: int) -> bool:
        """Whether a cell has a facet of the surface at a node, and is above it."""
        beside = [e for e, facet in enumerate(facets) if tag in facet and facet <= set(cells[cell])]
        return any((sides[0][cell] - sides[1][e]) @ upwards[e] > 0 for e in beside)

    moved: dict[int, list[int]] = {}
    for tag in tags:
        groups = connected(around[tag], cells, set(facets))
        if len(groups) > 1:
            above = [group for group in groups if any(is_above(cell, tag) for cell in group)]
            moved[tag] = [cell for group in above for cell in group]
    new = {tag: new_tag + k for k, tag in enumerate(moved)}
    index = {tag: i for i, tag in enumerate(body.node_tags.tolist())}
    tables, start = [], 0
    for shape, table in body.cells:
        changed = table.copy()
        for k, (tag, numbers) in enumerate(moved.items()):
            here = np.array([n - start for n in numbers if start <= n < start + len(table)], int)
            rows = changed[here]
            rows[rows == index[tag]] = len(body.points) + k
            changed[here] = rows
        tables.append((shape, changed))
        start += len(table)
    old = np.array([index[tag] for tag in moved], int)
    divided = replace(
        body,
        points=np.vstack([body.points, body.points[old]]),
        node_tags=np.concatenate([body.node_tags, np.array([*new.values()], body.node_tags.dtype)]),
        cells=tables,
    )
    return divided, np.array([new.get(tag, tag) for tag in tags], body.node_tags.dtype)


def connected(
    around: list[int], cells: list[list[int]], facets: set[frozenset[int]]
) -> list[set[int]]:
    """The cells around a node, by groups that are connected through sides that are no facets."""
    groups = [{cell} for cell in around]
    least = 2 if len(next(iter(facets))) == 2 else 3  # nodes of a side, in the plane and in space
    for one, other in combinations(around, 2):
        shared = frozenset(cells[one]) & frozenset(cells[other])
        if len(shared) >= least and shared not in facets:
            first, second = (next(g for g in groups if cell in g) for cell in (one, other))
            if first is not second:
                groups.remove(second)
                first |= second
    return groups
