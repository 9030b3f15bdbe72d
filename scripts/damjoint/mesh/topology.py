"""Sides, neighbours and connected parts of the elements of a mesh; their sizes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..arrays import Array, IntArray, determinant
from .body import SIDES, Body

#: Shape of a side by its number of corners.
SHAPE_OF_SIDE = {2: "line", 3: "triangle", 4: "quad"}

#: Simplices that make up an element.
SIMPLICES_OF = {
    "line": ((0, 1),),
    "triangle": ((0, 1, 2),),
    "quad": ((0, 1, 2), (0, 2, 3)),
    "tetra": ((0, 1, 2, 3),),
    "hexahedron": ((0, 1, 3, 4), (1, 2, 3, 6), (1, 3, 4, 6), (1, 4, 5, 6), (3, 4, 6, 7)),
    "wedge": ((0, 1, 2, 3), (1, 2, 3, 4), (2, 3, 4, 5)),
}


class Part(NamedTuple):
    """A connected part of a surface without a name: its elements, the names of what bounds it."""

    elements: IntArray
    names: frozenset[str]


def side_tags(body: Body) -> tuple[list[IntArray], list[IntArray]]:
    """Node tags of the sides of a body's elements, by side and shape, and their elements."""
    rows, owners, start = list[IntArray](), list[IntArray](), 0
    for shape, table in body.cells:
        for corners in SIDES[shape]:
            rows.append(body.node_tags[table[:, corners]].astype(int))
            owners.append(start + np.arange(len(table)))
        start += len(table)
    return rows, owners


def element_node_tags(body: Body) -> list[IntArray]:
    """Node tags of a body's elements, a table for each block of cells."""
    return [body.node_tags[table].astype(int) for _, table in body.cells]


def row_numbers(*groups: list[IntArray]) -> list[IntArray]:
    """A number for each row of groups of tables of tags, equal for rows of the same tags."""
    width = max([1, *(table.shape[1] for group in groups for table in group)])
    rows = [np.zeros((0, width), int)]
    for group in groups:
        for table in group:
            full = np.zeros((len(table), width), int)
            full[:, : table.shape[1]] = np.sort(table, axis=1)
            rows.append(full)
    columns = np.concatenate(rows).T
    numbers = np.zeros(columns.shape[1], int)
    for column in columns:
        both = numbers * (int(column.max(initial=0)) + 1) + column
        numbers = np.unique(both, return_inverse=True)[1].ravel()
    ends = np.cumsum([sum(map(len, group)) for group in groups])[:-1]
    return np.split(numbers, ends)


def neighbours(numbers: IntArray, owners: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """The owners of equal numbers, in pairs; and the numbers."""
    order = np.argsort(numbers, kind="stable")
    same = numbers[order][1:] == numbers[order][:-1]
    return owners[order][:-1][same], owners[order][1:][same], numbers[order][1:][same]


def components(first: IntArray, second: IntArray, count: int) -> IntArray:
    """A number for each of `count` items, equal for those that pairs of items connect."""
    labels = np.arange(count)
    while True:
        before = labels
        labels = labels.copy()
        least = np.minimum(labels[first], labels[second])
        for ends in (first, second):
            np.minimum.at(labels, before[ends], least)
        labels = labels[labels]
        if (labels == before).all():
            return labels


def unnamed_parts(
    surface: Body, names: Sequence[str], ends: Mapping[tuple[int, ...], str]
) -> Iterator[Part]:
    """Yield the connected parts of a surface that have no name.

    names: of each element of the surface, empty for none; ends: names of some of its edges (in the
    plane: points), by their node tags; a part ends there, too.
    """
    rows, owners = (np.concatenate(tables) for tables in side_tags(surface))
    edges, of_ends = row_numbers([rows], [np.array(list(ends), int)] if ends else [])
    name_of = dict(zip(of_ends.tolist(), ends.values(), strict=True))
    at_end = np.isin(edges, of_ends)
    name = np.array(names, str)
    bare = name == ""
    inner = bare[owners] & ~at_end
    part = components(*neighbours(edges[inner], owners[inner])[:2], len(name))
    around: dict[int, set[str]] = {p: set() for p in np.unique(part[bare]).tolist()}
    bound = bare[owners] & at_end
    for p, edge in zip(part[owners[bound]].tolist(), edges[bound].tolist(), strict=True):
        around[p].add(name_of[edge])
    first, second, _ = neighbours(edges[~at_end], owners[~at_end])
    for one, other in ((first, second), (second, first)):
        beside = bare[one] & ~bare[other]
        for p, label in zip(part[one[beside]].tolist(), name[other[beside]].tolist(), strict=True):
            around[p].add(label)
    for p, labels in around.items():
        yield Part(np.flatnonzero(bare & (part == p)), frozenset(labels))


def inner_ends(ends: Sequence[Body], surfaces: Sequence[Body], skin: Body) -> list[IntArray]:
    """Tags of the nodes of each end of a joint, heel or toe, that lies inside the dam or on its
    rock, at another joint, and not on the surface: there the water comes from the other joint.

    surfaces: of the joints; skin: the surface of dam and rock.
    """
    tags, count = np.unique(
        np.concatenate([surface.node_tags for surface in surfaces]), return_counts=True
    )
    shared = tags[count > 1]
    sides = [table[np.isin(table, shared).any(axis=1)] for table in element_node_tags(skin)]
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


def element_sizes(body: Body) -> Array:
    """Length, area or volume of each element [m, m2, m3]."""
    sizes = [np.zeros(0)]
    for shape, table in body.cells:
        total = np.zeros(len(table))
        for corners in SIMPLICES_OF[shape]:
            points = body.points[table[:, corners]]
            edges = points[:, 1:] - points[:, :1]
            squared = determinant(edges @ edges.transpose(0, 2, 1))
            total += np.sqrt(np.maximum(squared, 0)) / (1, 1, 2, 6)[len(corners) - 1]
        sizes.append(total)
    return np.concatenate(sizes)


def size_below(surface: Body, level: float) -> Array:
    """Length or area of each element of a surface below a level [m, m2]."""
    sizes = [np.zeros(0)]
    for shape, table in surface.cells:
        total = np.zeros(len(table))
        for corners in SIMPLICES_OF[shape]:
            simplex = Body(surface.points, surface.node_tags, [], surface.element_tags)
            simplex.cells = [(SHAPE_OF_SIDE[len(corners)], table[:, corners])]
            heights = np.sort(surface.points[table[:, corners]][:, :, 1] - level, axis=1)
            total += element_sizes(simplex) * part_below(heights)
        sizes.append(total)
    return np.concatenate(sizes)


def part_below(heights: Array) -> Array:
    """The part of lines (n, 2) or triangles (n, 3) below 0, from ascending heights of corners."""
    low, middle, high = heights[:, 0], heights[:, -2], heights[:, -1]
    with np.errstate(divide="ignore", invalid="ignore"):
        if heights.shape[1] == 2:
            part = -low / (high - low)
        else:
            lower = low**2 / ((middle - low) * (high - low))
            upper = 1 - high**2 / ((high - low) * (high - middle))
            part = np.where(middle > 0, lower, upper)
    return np.where(high <= 0, 1.0, np.where(low >= 0, 0.0, part))


def at(point: Array) -> str:
    """A position, for messages."""
    return ", ".join(f"{c:.6g}" for c in point)
