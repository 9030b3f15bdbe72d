"""The mesh of a user's own geometry: its elements, their sides, and what of them has a name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .. import InputError
from ..arrays import Array, BoolArray, IntArray, distinct
from ..input.scene import DOWN, Joint
from .body import Body
from .topology import (
    SHAPE_OF_SIDE,
    Part,
    at,
    element_node_tags,
    element_sizes,
    row_numbers,
    side_tags,
    size_below,
    unnamed_parts,
)

#: Regions of concrete.
CONCRETE = ("dam", "lower")

#: Least height of a dam that is not named in a note [m].
LOWEST = 0.5

#: Part of a normal along an axis from which on a face counts as facing along it [-].
FACING = 1e-3

#: Relative size below which an extent or size is 0.
FLAT = 1e-9


class NamedFace(NamedTuple):
    """A face as the mesh names it: its name, the kind of its body, its side, its elements."""

    name: str
    kind: str
    side: str
    surface: Body


class UserGeometry:
    """The mesh of a user's own geometry by regions, before joints inside bodies are cut."""

    def __init__(
        self,
        file: Path,
        dim: int,
        regions: Mapping[str, Body],
        solids: Mapping[str, Body],
        joints: Sequence[Joint],
        faces: Sequence[NamedFace],
    ) -> None:
        """regions: joints, their ends and all others but faces, by name."""
        self.file, self.dim, self.regions, self.solids = file, dim, regions, solids
        self.joints, self.faces = joints, faces
        surfaces = [regions[joint.region] for joint in joints]
        surfaces += [face.surface for face in faces]
        self.supports = [name for name in ("fixed", "sides") if name in regions]
        surfaces += [regions[name] for name in self.supports]
        parts = [side_tags(solid) for solid in solids.values()]
        counts = [len(solid.element_tags) for solid in solids.values()]
        starts = np.cumsum([0, *counts])[:-1]
        #: node tags of the sides of all elements, by blocks; element and body of each side
        self.rows = [table for rows, _ in parts for table in rows]
        self.owners = np.concatenate(
            [s + o for s, (_, owners) in zip(starts, parts, strict=True) for o in owners]
        )
        self.body_of = np.repeat(np.arange(len(counts)), counts)
        #: number of each side; equal for the same side of two elements
        self.sides, *others = row_numbers(self.rows, *map(element_node_tags, surfaces))
        #: the numbers of the elements of joints, faces and supports
        self.of_joints = others[: len(joints)]
        self.of_faces = others[len(joints) : len(joints) + len(faces)]
        self.of_supports = others[len(joints) + len(faces) :]

    def bad(self, why: str) -> InputError:
        """The error of this geometry."""
        return InputError(f"geometry = {self.file}: {why}")

    # -- its parts
    # ----------------------------------------------------------------------------------------------

    @cached_property
    def middles(self) -> Array:
        """The middle of each element of the bodies (elements, 3)."""
        return np.concatenate([solid.middles() for solid in self.solids.values()])

    @cached_property
    def points(self) -> tuple[IntArray, Array]:
        """Tags of all nodes of the bodies, sorted, and their positions (n, 3)."""
        tags = np.concatenate([solid.node_tags for solid in self.solids.values()]).astype(int)
        positions = np.concatenate([solid.points for solid in self.solids.values()])
        tags, first = np.unique(tags, return_index=True)
        return tags, positions[first]

    @cached_property
    def is_concrete(self) -> BoolArray:
        """Which elements of the bodies are concrete, not rock."""
        return np.concatenate(
            [
                np.full(len(table), region in CONCRETE)
                for solid in self.solids.values()
                for region, (_, table) in zip(solid.regions, solid.cells, strict=True)
            ]
        )

    @cached_property
    def concrete(self) -> Array:
        """Positions of the nodes of the concrete (n, 3)."""
        return np.concatenate(
            [
                solid.points[distinct(table.ravel())]
                for solid in self.solids.values()
                for region, (_, table) in zip(solid.regions, solid.cells, strict=True)
                if region in CONCRETE
            ]
        )

    @cached_property
    def reach(self) -> tuple[float, float]:
        """The lowest and the highest level of the concrete [m]."""
        heights = self.concrete[:, 1]
        return float(heights.min()), float(heights.max())

    @property
    def height(self) -> float:
        """Height of the concrete [m]."""
        low, high = self.reach
        return high - low

    @property
    def volume(self) -> float:
        """Volume of the concrete [m3], in the plane its area [m2]."""
        sizes = np.concatenate([element_sizes(solid) for solid in self.solids.values()])
        return float(sizes[self.is_concrete].sum())

    @cached_property
    def skin(self) -> IntArray:
        """The sides that belong to one element only: the surface of dam and rock."""
        return np.flatnonzero(np.bincount(self.sides)[self.sides] == 1)

    @cached_property
    def surface(self) -> Body:
        """The surface of dam and rock, in the order of `skin`, with normals outwards."""
        tags, points = self.points
        cells, start = list[tuple[str, IntArray]](), 0
        for table in self.rows:
            sides = self.skin[(start <= self.skin) & (self.skin < start + len(table))] - start
            cells.append((SHAPE_OF_SIDE[table.shape[1]], np.searchsorted(tags, table[sides])))
            start += len(table)
        surface = Body(points, tags, cells, np.zeros(0, int))
        normals = surface.unit_normals()
        out = surface.middles() - self.middles[self.owners[self.skin]]
        normals[np.einsum("ij,ij->i", normals, out) < 0] *= -1
        surface.normals = normals
        return surface

    @cached_property
    def name_of_skin(self) -> list[str]:
        """The side of the face, or `fixed`, that each element of the surface is in; empty: none."""
        named = {
            number: face.side
            for face, numbers in zip(self.faces, self.of_faces, strict=True)
            for number in numbers.tolist()
        }
        for name, numbers in zip(self.supports, self.of_supports, strict=True):
            named |= {number: named.get(number, name) for number in numbers.tolist()}
        return [named.get(number, "") for number in self.sides[self.skin].tolist()]

    @cached_property
    def unnamed(self) -> list[Part]:
        """The connected parts of the surface in no face; they end at joints."""
        ends: dict[tuple[int, ...], str] = {}
        for joint in self.joints:
            tables, _ = side_tags(self.regions[joint.region])
            ends |= dict.fromkeys(sorted_rows(tables), "joint")
        for joint in self.joints:
            for kind, region in (("heel", joint.heel), ("toe", joint.toe)):
                ends |= dict.fromkeys(sorted_rows(element_node_tags(self.regions[region])), kind)
        return list(unnamed_parts(self.surface, self.name_of_skin, ends))

    def open_parts(self, side: str, level: float) -> float:
        """Length or area [m, m2] of the concrete's surface below a level that faces upstream or
        downstream, as the face of that side, and is in no face. Cavities do not count.
        """
        sign = 1 if side == DOWN else -1
        facing = sign * self.surface.normals[:, 0] > FACING
        bare = np.zeros(len(self.skin), bool)
        for part in self.unnamed:
            bare[part.elements] = bool(part.names)
        chosen = facing & bare & self.is_concrete[self.owners[self.skin]]
        return float(size_below(self.surface, level)[chosen].sum())

    @property
    def cavities(self) -> list[str]:
        """A position on each part of the surface that nothing bounds: inside dam or rock."""
        return [self.on_part(part) for part in self.unnamed if not part.names]

    @property
    def fixed_concrete(self) -> float:
        """Length or area of the dam's surface that is fixed [m, m2]."""
        is_dam = np.array([name != "foundation" for name in self.solids])
        sizes, names = element_sizes(self.surface), np.array(self.name_of_skin)
        fixed = is_dam[self.body_of[self.owners[self.skin]]] & (names == "fixed")
        return float(sizes[fixed].sum())

    @property
    def coincident(self) -> str:
        """The position of two nodes that do not connect what meets there; empty: there are none."""
        points = self.points[1]
        whole = np.round(points / (FLAT * np.ptp(points))).astype(int)
        _, first, count = np.unique(whole, axis=0, return_index=True, return_counts=True)
        return at(points[first[np.argmax(count > 1)]]) if (count > 1).any() else ""

    def on_part(self, part: Part) -> str:
        """The position of an element of a part of the surface, for messages."""
        return at(self.surface.middles()[part.elements[0]])

    def middle_of_side(self, side: int) -> Array:
        """The middle of a side, by its number among all."""
        tags, points = self.points
        for table in self.rows:
            if side < len(table):
                break
            side -= len(table)
        middle: Array = points[np.searchsorted(tags, table[side])].mean(axis=0)
        return middle

    def at_node(self, tag: int) -> str:
        """The position of a node, for messages."""
        tags, points = self.points
        return at(points[np.searchsorted(tags, tag)])


def sorted_rows(tables: list[IntArray]) -> Iterator[tuple[int, ...]]:
    """Yield the rows of some tables of tags, each sorted."""
    for table in tables:
        yield from map(tuple, np.sort(table, axis=1).tolist())
