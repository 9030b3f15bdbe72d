"""Whether the mesh of a user's own geometry is complete.

An element that is missing or doubled, or a face with a hole, changes the results without a sign of
it in them.
"""

from __future__ import annotations

import itertools

import numpy as np

from .. import ROUND_OFF
from ..arrays import Array, IntArray
from ..input.scene import BED, DOWN, FLOOR, LINES, TOP, TRACTION, UP, Joint
from .body import Body
from .topology import (
    at,
    components,
    element_node_tags,
    element_sizes,
    neighbours,
    row_numbers,
    side_tags,
    unnamed_parts,
)
from .user_geometry import FACING, FLAT, UserGeometry

#: Greatest height of a dam [m], that of a section, too; the highest dams reach 335.
HIGHEST = 1000.0
#: Distance from the origin, over the size of the mesh, from which on coordinates lack digits.
FARTHEST = 1e4
#: Part of a normal along an axis from which on a face mostly faces along it [-]: up to 26 degrees.
MOSTLY = 0.9
#: Axis and sign of the normals of a face as a whole, by its side.
DIRECTIONS = {UP: (0, -1), DOWN: (0, 1), TOP: (1, 1), FLOOR: (1, 1), BED: (1, 1)}
#: Faces that water presses on together: what only these bound is a hole in them.
RESERVOIR, TAILWATER = frozenset({UP, TOP, FLOOR}), frozenset({DOWN, BED})
#: What a joint is, by the dimension.
CHAIN = {2: "chain of elements", 3: "connected surface"}


def label(joint: Joint) -> str:
    """A joint's name in a message."""
    return f"joint {joint.name}" if joint.name != "joint" else "joint"


def check(geometry: UserGeometry) -> None:
    """Raise InputError if the mesh is not complete."""
    check_elements(geometry)
    check_doubled(geometry)
    check_overlaps(geometry)
    check_contacts(geometry)
    for joint in geometry.joints:
        check_joint(geometry, joint)
    check_faces(geometry)
    check_connected(geometry)
    check_directions(geometry)
    check_holes(geometry)
    check_size(geometry)


def check_elements(geometry: UserGeometry) -> None:
    """Raise InputError if coordinates are no numbers, if a plane mesh is not in the plane of x
    and y, or if an element has no size.
    """
    points = geometry.points[1]
    if not np.isfinite(points).all():
        raise geometry.bad("it has coordinates that are not finite")
    if geometry.dim == 2 and np.ptp(points[:, 2]) > FLAT * np.ptp(points):
        raise geometry.bad("its z must be the same everywhere with dim = 2 (y points up)")
    sizes = np.concatenate([element_sizes(solid) for solid in geometry.solids.values()])
    flat = sizes <= FLAT**2 * np.median(sizes)
    if flat.any():
        raise geometry.bad(f"an element has no size, at {at(geometry.middles[np.argmax(flat)])}")


def check_doubled(geometry: UserGeometry) -> None:
    """Raise InputError if an element occurs twice in bodies, in joints or in faces."""
    joints = [(label(joint), geometry.regions[joint.region]) for joint in geometry.joints]
    faces = [(face.name, face.surface) for face in geometry.faces]
    for group in (list(geometry.solids.items()), joints + faces):
        numbers = row_numbers(*(element_node_tags(body) for _, body in group))
        count = np.bincount(np.concatenate(numbers))
        if (count > 1).any():
            twice = int(np.argmax(count > 1))
            names = [
                n for (n, _), elements in zip(group, numbers, strict=True) if twice in elements
            ]
            number = int((count > 1).sum())
            occur = f"{number} elements occur" if number > 1 else "1 element occurs"
            raise geometry.bad(
                f"{' and '.join(names)}: {occur} twice; each must be there once, and in one region"
            )


def check_overlaps(geometry: UserGeometry) -> None:
    """Raise InputError if a side has more than two elements, or two on the same side of it."""
    tags, points = geometry.points
    count = np.bincount(geometry.sides)[geometry.sides]
    corners = [
        points[np.searchsorted(tags, np.sort(table)[:, -geometry.dim :])] for table in geometry.rows
    ]
    origin = np.concatenate([c[:, 0] for c in corners])
    if geometry.dim == 2:
        along = np.concatenate([c[:, 1] - c[:, 0] for c in corners])
        normals = np.column_stack([along[:, 1], -along[:, 0], np.zeros(len(along))])
    else:
        normals = np.concatenate([np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]) for c in corners])
    above = np.einsum("ij,ij->i", geometry.middles[geometry.owners] - origin, normals) > 0
    first, second, _ = neighbours(geometry.sides, np.arange(len(geometry.sides)))
    wrong = np.concatenate([np.flatnonzero(count > 2), first[above[first] == above[second]]])
    if len(wrong):
        raise geometry.bad(
            f"its elements overlap at {at(origin[wrong[0]])}: a side must have an element on "
            "either side, at most"
        )


def check_contacts(geometry: UserGeometry) -> None:
    """Raise InputError if a joint's element is no side of both bodies, or bodies meet elsewhere."""
    names, bodies = list(geometry.solids), geometry.body_of[geometry.owners]
    first, second, numbers = neighbours(geometry.sides, bodies)
    beside = (first != second) & ~np.isin(numbers, np.concatenate(geometry.of_joints))
    if beside.any():
        number = numbers[beside][0]
        side = np.flatnonzero(geometry.sides == number)
        a, b = (names[bodies[k]] for k in side)
        where = geometry.middle_of_side(int(side[0]))
        raise geometry.bad(f"{a} and {b} also meet beside the joint, at {at(where)}")
    on_joints = np.concatenate([geometry.regions[j.region].node_tags for j in geometry.joints])
    for a, b in itertools.combinations(names, 2):
        shared = np.intersect1d(geometry.solids[a].node_tags, geometry.solids[b].node_tags)
        apart = np.setdiff1d(shared, on_joints).astype(int)
        if len(apart):
            raise geometry.bad(
                f"{a} and {b} also meet beside the joint, at {geometry.at_node(apart[0])}"
            )
    for joint, numbers in zip(geometry.joints, geometry.of_joints, strict=True):
        for body in (joint.upper, joint.lower):
            if not np.isin(numbers, geometry.sides[bodies == names.index(body)]).all():
                raise geometry.bad(
                    f"{label(joint)}: its elements must be sides of those of {body} (a "
                    "conforming mesh)"
                )


def check_joint(geometry: UserGeometry, joint: Joint) -> None:
    """Raise InputError if a joint is no chain (2D) or connected surface (3D) from heel to toe."""
    surface = geometry.regions[joint.region]
    rows, owners = (list(part) for part in side_tags(surface))
    heel, toe = (element_node_tags(geometry.regions[end]) for end in (joint.heel, joint.toe))
    sides, of_heel, of_toe = row_numbers(rows, heel, toe)
    owner = np.concatenate(owners)
    count = np.bincount(sides, minlength=int(max(of_heel.max(), of_toe.max())) + 1)
    whole = f"{label(joint)}: must be a {CHAIN[geometry.dim]} from heel to toe"
    part = components(*neighbours(sides, owner)[:2], len(surface.element_tags))
    if part.any():
        number, where = len(set(part.tolist())), surface.middles()[part > 0][0]
        raise geometry.bad(
            f"{whole}; it has {number} parts that are not connected, one at {at(where)}"
        )
    if (count > 2).any():
        where = surface.middles()[owner[np.argmax(count[sides] > 2)]]
        raise geometry.bad(f"{whole}; it branches at {at(where)}")
    for name, region, nodes in (("heel", joint.heel, of_heel), ("toe", joint.toe, of_toe)):
        if geometry.dim == 2 and len(nodes) != 1:
            raise geometry.bad(f"{name} of {label(joint)}: must be one point, not {len(nodes)}")
        off = count[nodes] != 1
        if off.any():
            where = geometry.regions[region].middles()[np.argmax(off)]
            lies = "inside it" if count[nodes][off][0] else "not on it"
            raise geometry.bad(
                f"{name} of {label(joint)}: must be its end; {at(where)} lies {lies}"
            )
    if np.isin(of_heel, of_toe).any():
        raise geometry.bad(f"{label(joint)}: heel and toe must be two ends")
    if geometry.dim == 3:
        check_rim(geometry, joint)
    ends = [geometry.regions[region].points[:, 0].mean() for region in (joint.heel, joint.toe)]
    if ends[1] < ends[0] - ROUND_OFF * np.ptp(geometry.points[1]):
        raise geometry.bad(
            f"toe at x = {ends[1]:g}, heel at {ends[0]:g}: x must point downstream (mirror it)"
        )
    if np.isin(surface.node_tags, geometry.regions["fixed"].node_tags).any():
        raise geometry.bad("fixed: must not touch the joint")


def check_rim(geometry: UserGeometry, joint: Joint) -> None:
    """Raise InputError if heel or toe of a joint in space have a gap."""
    surface = geometry.regions[joint.region]
    rows = np.concatenate(side_tags(surface)[0])
    sides, *ends = row_numbers(
        [rows], *(element_node_tags(geometry.regions[e]) for e in (joint.heel, joint.toe))
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
            raise geometry.bad(f"{name} of {label(joint)}: has a gap at {at(where)}")


def check_connected(geometry: UserGeometry) -> None:
    """Raise InputError if a part of a body has no joint, or a part of the rock is not held."""
    in_joints = np.isin(geometry.sides, np.concatenate(geometry.of_joints))
    first, second, _ = neighbours(geometry.sides[~in_joints], geometry.owners[~in_joints])
    part = components(first, second, len(geometry.body_of))
    loose = ~np.isin(part, part[geometry.owners[in_joints]])
    if loose.any():
        name = list(geometry.solids)[geometry.body_of[np.argmax(loose)]]
        where = at(geometry.middles[np.argmax(loose)])
        raise geometry.bad(f"{name}: its part at {where} is connected to no joint")
    fixed = np.isin(geometry.sides, geometry.of_supports[geometry.supports.index("fixed")])
    rock = geometry.body_of == list(geometry.solids).index("foundation")
    free = rock & ~np.isin(part, part[geometry.owners[fixed]])
    if free.any():
        where = at(geometry.middles[np.argmax(free)])
        raise geometry.bad(f"foundation: its part at {where} is not held by fixed")


def check_faces(geometry: UserGeometry) -> None:
    """Raise InputError if an element of a face or support is not on the surface of its body, or
    a point that is output or loaded not on a body.
    """
    kinds = [name.split(" ")[0] == "dam" for name in geometry.solids]
    is_dam = np.array(kinds)[geometry.body_of[geometry.owners]]
    named = [(face.name, face.surface, is_dam == (face.kind == "dam")) for face in geometry.faces]
    every = np.ones(len(is_dam), bool)
    named += [(name, geometry.regions[name], every) for name in geometry.supports]
    for (name, surface, bodies), numbers in zip(
        named, [*geometry.of_faces, *geometry.of_supports], strict=True
    ):
        if not np.isin(numbers, geometry.sides[bodies]).all():
            raise geometry.bad(f"{name}: its elements must be sides of its body's (conforming)")
        inside = ~np.isin(numbers, geometry.sides[geometry.skin])
        if inside.any():
            where = at(surface.middles()[np.argmax(inside)])
            raise geometry.bad(f"{name}: must be on the surface of its body; {where} is not")
    for name in ("crest", *LINES, TRACTION):
        if (
            name in geometry.regions
            and not np.isin(geometry.regions[name].node_tags, geometry.points[0]).all()
        ):
            raise geometry.bad(f"{name}: must be on a body of the mesh")
    if len(geometry.regions["crest"].node_tags) != 1:
        number = len(geometry.regions["crest"].node_tags)
        raise geometry.bad(f"crest: must be one point, not {number}")


def check_directions(geometry: UserGeometry) -> None:
    """Raise InputError if a face looks opposite to its name, or the rock lies above the dam."""
    normals, sizes = geometry.surface.normals, element_sizes(geometry.surface)
    for face, numbers in zip(geometry.faces, geometry.of_faces, strict=True):
        on_face = np.isin(geometry.sides[geometry.skin], numbers)
        axis, sign = DIRECTIONS[face.side]
        along = sign * (normals[on_face, axis] * sizes[on_face]).sum()
        if along < -FACING * sizes[on_face].sum():
            raise geometry.bad(
                f"{face.name}: looks along {'-' if sign > 0 else ''}{'xy'[axis]}: x must point "
                "downstream, y up"
            )
    across, total = np.zeros(3), 0.0
    for joint, numbers in zip(geometry.joints, geometry.of_joints, strict=True):
        if joint.lower == "foundation" != joint.upper:
            sizes = element_sizes(geometry.regions[joint.region])
            across += sizes @ normals_from_rock(geometry, joint, numbers)
            total += sizes.sum()
    if across[1] < -FACING * total:
        raise geometry.bad("the rock lies above the dam: y must point up")
    if abs(across[2]) > MOSTLY * total:
        raise geometry.bad("the joint on the rock faces along z: y must point up, z along the dam")


def normals_from_rock(geometry: UserGeometry, joint: Joint, numbers: IntArray) -> Array:
    """Unit normals of a joint's elements, by their numbers as sides, into its upper body."""
    surface = geometry.regions[joint.region]
    upper = geometry.body_of[geometry.owners] == list(geometry.solids).index(joint.upper)
    sides, owners = geometry.sides[upper], geometry.owners[upper]
    order = np.argsort(sides)
    above = owners[order][np.searchsorted(sides[order], numbers)]
    normals = surface.unit_normals()
    out = geometry.middles[above] - surface.middles()
    normals[np.einsum("ij,ij->i", normals, out) < 0] *= -1
    return normals


def check_holes(geometry: UserGeometry) -> None:
    """Raise InputError if elements of the surface are in no face, though only one face, or
    several that the same water presses on, are around them.
    """
    normals = geometry.surface.normals
    rock = ~geometry.is_concrete[geometry.owners[geometry.skin]]
    names = {face.side: face.name for face in geometry.faces}
    for part in geometry.unnamed:
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
                where = geometry.on_part(part)
                raise geometry.bad(f"{listed}: has a hole; {are} in no face, at {where}")


def check_size(geometry: UserGeometry) -> None:
    """Raise InputError if the geometry has a size that no dam has."""
    if geometry.height > HIGHEST:
        raise geometry.bad(
            f"the dam is {geometry.height:g} m high: must be at most {HIGHEST:g} m (its unit is "
            "the metre; a mesh in mm has to be scaled by 1e-3)"
        )
    points = geometry.points[1]
    extent, away = np.ptp(points, axis=0).max(), np.abs(points).max()
    if away > FARTHEST * extent:
        raise geometry.bad(
            f"it lies {away:g} m from the origin: must be at most {FARTHEST:g} times its size, "
            f"{extent:g} m (y = 0 is that of the water levels)"
        )
