"""Whether the mesh of a user's own geometry is complete, and its sizes.

An element that is missing or doubled, or a face with a hole, changes the results without a sign of
it in them.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .. import ROUND_OFF, InputError
from ..arrays import Array, BoolArray, IntArray, distinct
from ..input.scene import BED, DOWN, FLOOR, LINES, TOP, UP, Joint
from .body import Body
from .topology import (
    SHAPE_OF_SIDE,
    Part,
    at,
    components,
    neighbours,
    numbers_of,
    sides_of,
    size_below,
    sizes_of,
    tags_of,
    unnamed_parts,
)

#: Regions of concrete.
CONCRETE = ("dam", "lower")

#: Greatest height of a dam [m], that of a section, too; the highest dams reach 335.
HIGHEST = 1000.0
#: Least height of a dam that is not named in a note [m].
LOWEST = 0.5

#: Distance from the origin, over the size of the mesh, from which on coordinates lack digits.
FARTHEST = 1e4

#: Part of a normal along an axis from which on a face counts as facing along it [-].
FACING = 1e-3

#: The same from which on it does so mostly [-]: up to 26 degrees from the axis.
MOSTLY = 0.9

#: Relative size below which an extent or size is 0.
FLAT = 1e-9

#: Axis and sign of the normals of a face as a whole, by its side.
DIRECTIONS = {UP: (0, -1), DOWN: (0, 1), TOP: (1, 1), FLOOR: (1, 1), BED: (1, 1)}

#: Faces that water presses on together: what only these bound is a hole in them.
RESERVOIR, TAILWATER = frozenset({UP, TOP, FLOOR}), frozenset({DOWN, BED})


class NamedFace(NamedTuple):
    """A face as the mesh names it: its name, the kind of its body, its side, its elements."""

    name: str
    kind: str
    side: str
    surface: Body


class UserGeometry:
    """The mesh of a user's own geometry by its regions, before bodies are cut along joints inside
    them.
    """

    def __init__(
        self,
        file: Path,
        dim: int,
        regions: Mapping[str, Body],
        solids: Mapping[str, Body],
        joints: Sequence[Joint],
        faces: Sequence[NamedFace],
    ) -> None:
        """regions: joints, their ends and all others but faces, by name.

        Raises InputError if the mesh is not complete.
        """
        self.file, self.dim, self.regions, self.solids = file, dim, regions, solids
        self.joints, self.faces = joints, faces
        surfaces = [regions[joint.region] for joint in joints]
        surfaces += [face.surface for face in faces]
        self.supports = [name for name in ("fixed", "sides") if name in regions]
        surfaces += [regions[name] for name in self.supports]
        parts = [sides_of(solid) for solid in solids.values()]
        counts = [len(solid.element_tags) for solid in solids.values()]
        starts = np.cumsum([0, *counts])[:-1]
        #: node tags of the sides of all elements, by blocks; element and body of each side
        self.rows = [table for rows, _ in parts for table in rows]
        self.owners = np.concatenate(
            [s + o for s, (_, owners) in zip(starts, parts, strict=True) for o in owners]
        )
        self.body_of = np.repeat(np.arange(len(counts)), counts)
        #: number of each side; equal for the same side of two elements
        self.sides, *others = numbers_of(self.rows, *map(tags_of, surfaces))
        #: the numbers of the elements of joints, faces and supports
        self.of_joints = others[: len(joints)]
        self.of_faces = others[len(joints) : len(joints) + len(faces)]
        self.of_supports = others[len(joints) + len(faces) :]
        self.check()

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

    @property
    def height(self) -> float:
        """Height of the concrete [m]."""
        return float(np.ptp(self.concrete[:, 1]))

    @property
    def volume(self) -> float:
        """Volume of the concrete [m3], in the plane its area [m2]."""
        sizes = np.concatenate([sizes_of(solid) for solid in self.solids.values()])
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
            tables, _ = sides_of(self.regions[joint.region])
            ends |= dict.fromkeys(sorted_rows(tables), "joint")
        for joint in self.joints:
            for kind, region in (("heel", joint.heel), ("toe", joint.toe)):
                ends |= dict.fromkeys(sorted_rows(tags_of(self.regions[region])), kind)
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
    def gaps_of_support(self) -> list[str]:
        """A position on each part of the surface that only fixed elements bound."""
        return [self.on_part(part) for part in self.unnamed if part.names == {"fixed"}]

    @property
    def fixed_concrete(self) -> float:
        """Length or area of the dam's surface that is fixed [m, m2]."""
        is_dam = np.array([name != "foundation" for name in self.solids])
        sizes, names = sizes_of(self.surface), np.array(self.name_of_skin)
        fixed = is_dam[self.body_of[self.owners[self.skin]]] & (names == "fixed")
        return float(sizes[fixed].sum())

    @property
    def coincident(self) -> str:
        """The position that two nodes share, which do not connect what meets there; empty if there
        are none.
        """
        points = self.points[1]
        whole = np.round(points / (FLAT * np.ptp(points))).astype(int)
        _, first, count = np.unique(whole, axis=0, return_index=True, return_counts=True)
        return at(points[first[np.argmax(count > 1)]]) if (count > 1).any() else ""

    def on_part(self, part: Part) -> str:
        """The position of an element of a part of the surface, for messages."""
        return at(self.surface.middles()[part.elements[0]])

    # -- checks
    # ----------------------------------------------------------------------------------------------

    def check(self) -> None:
        """Raise InputError if the mesh is not complete."""
        self.check_elements()
        self.check_doubled()
        self.check_overlaps()
        self.check_contacts()
        for joint in self.joints:
            self.check_joint(joint)
        self.check_faces()
        self.check_connected()
        self.check_directions()
        self.check_holes()
        self.check_size()

    def check_elements(self) -> None:
        """Raise InputError if coordinates are no numbers, if a plane mesh is not in the plane of x
        and y, or if an element has no size.
        """
        points = self.points[1]
        if not np.isfinite(points).all():
            raise self.bad("it has coordinates that are not finite")
        if self.dim == 2 and np.ptp(points[:, 2]) > FLAT * np.ptp(points):
            raise self.bad("its z must be the same everywhere with dim = 2 (y points up)")
        sizes = np.concatenate([sizes_of(solid) for solid in self.solids.values()])
        flat = sizes <= FLAT**2 * np.median(sizes)
        if flat.any():
            raise self.bad(f"an element has no size, at {at(self.middles[np.argmax(flat)])}")

    def check_doubled(self) -> None:
        """Raise InputError if an element occurs twice in bodies, in joints or in faces."""
        joints = [(label(joint), self.regions[joint.region]) for joint in self.joints]
        faces = [(face.name, face.surface) for face in self.faces]
        for group in (list(self.solids.items()), joints + faces):
            numbers = numbers_of(*(tags_of(body) for _, body in group))
            count = np.bincount(np.concatenate(numbers))
            if (count > 1).any():
                twice = int(np.argmax(count > 1))
                names = [
                    n for (n, _), elements in zip(group, numbers, strict=True) if twice in elements
                ]
                number = int((count > 1).sum())
                occur = f"{number} elements occur" if number > 1 else "1 element occurs"
                raise self.bad(
                    f"{' and '.join(names)}: {occur} twice; each must be there once, and in one "
                    "region"
                )

    def check_overlaps(self) -> None:
        """Raise InputError if a side has more than two elements, or two on the same side of it."""
        tags, points = self.points
        count = np.bincount(self.sides)[self.sides]
        corners = [
            points[np.searchsorted(tags, np.sort(table)[:, -self.dim :])] for table in self.rows
        ]
        origin = np.concatenate([c[:, 0] for c in corners])
        if self.dim == 2:
            along = np.concatenate([c[:, 1] - c[:, 0] for c in corners])
            normals = np.column_stack([along[:, 1], -along[:, 0], np.zeros(len(along))])
        else:
            normals = np.concatenate(
                [np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]) for c in corners]
            )
        above = np.einsum("ij,ij->i", self.middles[self.owners] - origin, normals) > 0
        first, second, _ = neighbours(self.sides, np.arange(len(self.sides)))
        wrong = np.concatenate([np.flatnonzero(count > 2), first[above[first] == above[second]]])
        if len(wrong):
            raise self.bad(
                f"its elements overlap at {at(origin[wrong[0]])}: a side must have an element on "
                "either side, at most"
            )

    def check_contacts(self) -> None:
        """Raise InputError if an element of a joint is no side of both bodies, or if bodies meet
        beside the joints.
        """
        names, bodies = list(self.solids), self.body_of[self.owners]
        first, second, numbers = neighbours(self.sides, bodies)
        beside = (first != second) & ~np.isin(numbers, np.concatenate(self.of_joints))
        if beside.any():
            number = numbers[beside][0]
            side = np.flatnonzero(self.sides == number)
            a, b = (names[bodies[k]] for k in side)
            where = self.middle_of_side(int(side[0]))
            raise self.bad(f"{a} and {b} also meet beside the joint, at {at(where)}")
        on_joints = np.concatenate([self.regions[j.region].node_tags for j in self.joints])
        for a, b in itertools.combinations(names, 2):
            shared = np.intersect1d(self.solids[a].node_tags, self.solids[b].node_tags)
            apart = np.setdiff1d(shared, on_joints).astype(int)
            if len(apart):
                raise self.bad(
                    f"{a} and {b} also meet beside the joint, at {self.at_node(apart[0])}"
                )
        for joint, numbers in zip(self.joints, self.of_joints, strict=True):
            for body in (joint.upper, joint.lower):
                if not np.isin(numbers, self.sides[bodies == names.index(body)]).all():
                    raise self.bad(
                        f"{label(joint)}: its elements must be sides of those of {body} (a "
                        "conforming mesh)"
                    )

    def check_joint(self, joint: Joint) -> None:
        """Raise InputError if a joint is no chain of elements (2D), or connected surface (3D), that
        heel and toe bound.
        """
        surface = self.regions[joint.region]
        rows, owners = (list(part) for part in sides_of(surface))
        heel, toe = (tags_of(self.regions[end]) for end in (joint.heel, joint.toe))
        sides, of_heel, of_toe = numbers_of(rows, heel, toe)
        owner = np.concatenate(owners)
        count = np.bincount(sides, minlength=int(max(of_heel.max(), of_toe.max())) + 1)
        whole = f"{label(joint)}: must be a {CHAIN[self.dim]} from heel to toe"
        part = components(*neighbours(sides, owner)[:2], len(surface.element_tags))
        if part.any():
            number, where = len(set(part.tolist())), surface.middles()[part > 0][0]
            raise self.bad(
                f"{whole}; it has {number} parts that are not connected, one at {at(where)}"
            )
        if (count > 2).any():
            where = surface.middles()[owner[np.argmax(count[sides] > 2)]]
            raise self.bad(f"{whole}; it branches at {at(where)}")
        for name, region, nodes in (("heel", joint.heel, of_heel), ("toe", joint.toe, of_toe)):
            if self.dim == 2 and len(nodes) != 1:
                raise self.bad(f"{name} of {label(joint)}: must be one point, not {len(nodes)}")
            off = count[nodes] != 1
            if off.any():
                where = self.regions[region].middles()[np.argmax(off)]
                lies = "inside it" if count[nodes][off][0] else "not on it"
                raise self.bad(
                    f"{name} of {label(joint)}: must be its end; {at(where)} lies {lies}"
                )
        if np.isin(of_heel, of_toe).any():
            raise self.bad(f"{label(joint)}: heel and toe must be two ends")
        if self.dim == 3:
            self.check_rim(joint)
        ends = [self.regions[region].points[:, 0].mean() for region in (joint.heel, joint.toe)]
        if ends[1] < ends[0] - ROUND_OFF * np.ptp(self.points[1]):
            raise self.bad(
                f"toe at x = {ends[1]:g}, heel at {ends[0]:g}: x must point downstream (mirror it)"
            )
        if np.isin(surface.node_tags, self.regions["fixed"].node_tags).any():
            raise self.bad("fixed: must not touch the joint")

    def check_rim(self, joint: Joint) -> None:
        """Raise InputError if heel or toe of a joint in space have a gap."""
        surface = self.regions[joint.region]
        rows = np.concatenate(sides_of(surface)[0])
        sides, *ends = numbers_of(
            [rows], *(tags_of(self.regions[e]) for e in (joint.heel, joint.toe))
        )
        outer = np.flatnonzero(np.bincount(sides)[sides] == 1)
        nodes = np.searchsorted(surface.node_tags, rows[outer])
        rim = Body(surface.points, surface.node_tags, [("line", nodes)], np.zeros(0, int))
        names = np.full(len(outer), "", dtype="<U4")
        for name, end in zip(("heel", "toe"), ends, strict=True):
            names[np.isin(sides[outer], end)] = name
        for part in unnamed_parts(rim, names.tolist(), {}):
            if len(part.names) == 1:
                (name,), where = part.names, rim.middles()[part.elements[0]]
                raise self.bad(f"{name} of {label(joint)}: has a gap at {at(where)}")

    def check_connected(self) -> None:
        """Raise InputError if a part of a body is connected to no joint, or a part of the rock is
        not held.
        """
        in_joints = np.isin(self.sides, np.concatenate(self.of_joints))
        first, second, _ = neighbours(self.sides[~in_joints], self.owners[~in_joints])
        part = components(first, second, len(self.body_of))
        loose = ~np.isin(part, part[self.owners[in_joints]])
        if loose.any():
            name = list(self.solids)[self.body_of[np.argmax(loose)]]
            where = at(self.middles[np.argmax(loose)])
            raise self.bad(f"{name}: its part at {where} is connected to no joint")
        fixed = np.isin(self.sides, self.of_supports[self.supports.index("fixed")])
        rock = self.body_of == list(self.solids).index("foundation")
        free = rock & ~np.isin(part, part[self.owners[fixed]])
        if free.any():
            where = at(self.middles[np.argmax(free)])
            raise self.bad(f"foundation: its part at {where} is not held by fixed")

    def check_faces(self) -> None:
        """Raise InputError if an element of a face or support is not on the surface of its body, or
        a point that is output or loaded not on a body.
        """
        kinds = [name.split(" ")[0] == "dam" for name in self.solids]
        is_dam = np.array(kinds)[self.body_of[self.owners]]
        named = [(face.name, face.surface, is_dam == (face.kind == "dam")) for face in self.faces]
        every = np.ones(len(is_dam), bool)
        named += [(name, self.regions[name], every) for name in self.supports]
        for (name, surface, bodies), numbers in zip(
            named, [*self.of_faces, *self.of_supports], strict=True
        ):
            if not np.isin(numbers, self.sides[bodies]).all():
                raise self.bad(f"{name}: its elements must be sides of its body's (conforming)")
            inside = ~np.isin(numbers, self.sides[self.skin])
            if inside.any():
                where = at(surface.middles()[np.argmax(inside)])
                raise self.bad(f"{name}: must be on the surface of its body; {where} is not")
        for name in ("crest", *LINES):
            if (
                name in self.regions
                and not np.isin(self.regions[name].node_tags, self.points[0]).all()
            ):
                raise self.bad(f"{name}: must be on a body of the mesh")
        if len(self.regions["crest"].node_tags) != 1:
            number = len(self.regions["crest"].node_tags)
            raise self.bad(f"crest: must be one point, not {number}")

    def check_directions(self) -> None:
        """Raise InputError if a face as a whole looks opposite to what its name says, or if the
        rock lies above the dam.
        """
        normals, sizes = self.surface.normals, sizes_of(self.surface)
        for face, numbers in zip(self.faces, self.of_faces, strict=True):
            on_face = np.isin(self.sides[self.skin], numbers)
            axis, sign = DIRECTIONS[face.side]
            along = sign * (normals[on_face, axis] * sizes[on_face]).sum()
            if along < -FACING * sizes[on_face].sum():
                raise self.bad(
                    f"{face.name}: looks along {'-' if sign > 0 else ''}{'xy'[axis]}: x must point "
                    "downstream, y up"
                )
        across, total = np.zeros(3), 0.0
        for joint, numbers in zip(self.joints, self.of_joints, strict=True):
            if joint.lower == "foundation" != joint.upper:
                sizes = sizes_of(self.regions[joint.region])
                across += sizes @ self.normals_from_rock(joint, numbers)
                total += sizes.sum()
        if across[1] < -FACING * total:
            raise self.bad("the rock lies above the dam: y must point up")
        if abs(across[2]) > MOSTLY * total:
            raise self.bad("the joint on the rock faces along z: y must point up, z along the dam")

    def normals_from_rock(self, joint: Joint, numbers: IntArray) -> Array:
        """Unit normals of a joint's elements, by their numbers as sides, into its upper body."""
        surface = self.regions[joint.region]
        upper = self.body_of[self.owners] == list(self.solids).index(joint.upper)
        sides, owners = self.sides[upper], self.owners[upper]
        order = np.argsort(sides)
        above = owners[order][np.searchsorted(sides[order], numbers)]
        normals = surface.unit_normals()
        out = self.middles[above] - surface.middles()
        normals[np.einsum("ij,ij->i", normals, out) < 0] *= -1
        return normals

    def check_holes(self) -> None:
        """Raise InputError if elements of the surface are in no face, though only one face, or
        several that the same water presses on, are around them.
        """
        normals = self.surface.normals
        rock = ~self.is_concrete[self.owners[self.skin]]
        names = {face.side: face.name for face in self.faces}
        for part in self.unnamed:
            for wet, end, sign in ((RESERVOIR, "heel", -1), (TAILWATER, "toe", 1)):
                faces = part.names & wet
                rest = part.names - wet
                to_end = rest == {end} and bool(
                    (rock | (sign * normals[:, 0] > FACING))[part.elements].all()
                )
                if (faces and not rest) or (faces - {TOP} and to_end):
                    listed = " and ".join(names[side] for side in sorted(faces))
                    number = len(part.elements)
                    are = f"{number} elements are" if number > 1 else "1 element is"
                    where = self.on_part(part)
                    raise self.bad(f"{listed}: has a hole; {are} in no face, at {where}")

    def check_size(self) -> None:
        """Raise InputError if the geometry has a size that no dam has."""
        if self.height > HIGHEST:
            raise self.bad(
                f"the dam is {self.height:g} m high: must be at most {HIGHEST:g} m (its unit is "
                "the metre; a mesh in mm has to be scaled by 1e-3)"
            )
        points = self.points[1]
        extent, away = np.ptp(points, axis=0).max(), np.abs(points).max()
        if away > FARTHEST * extent:
            raise self.bad(
                f"it lies {away:g} m from the origin: must be at most {FARTHEST:g} times its size, "
                f"{extent:g} m (y = 0 is that of the water levels)"
            )

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


#: What a joint is, by the dimension.
CHAIN = {2: "chain of elements", 3: "connected surface"}


def label(joint: Joint) -> str:
    """A joint's name in a message."""
    return f"joint {joint.name}" if joint.name != "joint" else "joint"


def sorted_rows(tables: list[IntArray]) -> Iterator[tuple[int, ...]]:
    """Yield the rows of some tables of tags, each sorted."""
    for table in tables:
        yield from map(tuple, np.sort(table, axis=1).tolist())
