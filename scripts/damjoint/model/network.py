"""Joints that meet, as a network for the water in them: what is connected, and where it ends."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .. import InputError
from ..arrays import IntArray, distinct
from ..classes import dataclass
from .body import Body
from .case import Case, flows, has_drains
from .mesh import JointMesh


@dataclass(frozen=True, kw_only=True)
class Network:
    """Joints that meet and carry water, or one that ends at a joint without water."""

    #: of the joints, from 0
    numbers: tuple[int, ...]
    #: the joints as one: the surface has their elements one joint after the other; heel and toe are
    #: the nodes where it ends at reservoir and tailwater, without elements
    mesh: JointMesh
    #: numbers of each joint's nodes in that surface
    nodes: tuple[IntArray, ...]
    #: whether it is more than one path (in 3D: surface) from heel to toe
    branched: bool
    #: whether a path goes on from one joint to another
    in_series: bool
    #: nodes where it ends at a joint without water
    closed: IntArray
    #: whether the flow is computed; then each joint's transmissivity where it is closed, over the
    #: first one's
    flowing: bool
    transmissivities: tuple[float, ...]


def carries_water(case: Case) -> bool:
    """Whether water passes through a joint, from its case: a waterstop ends the path."""
    return case["uplift"] not in ("none", "waterstop")


def networks_of(joints: Sequence[JointMesh], cases: Sequence[Case]) -> list[Network]:
    """The networks of a scene, from the meshes and cases of its joints; none where no joints meet.

    Raises InputError if joints that meet have settings that do not go together.
    """
    if not any(joint.meets for joint in joints):
        return []
    wet = [k for k, case in enumerate(cases) if carries_water(case)]
    open_ends = {k: np.setdiff1d(ends_of(joints[k]), joints[k].inner_ends) for k in wet}
    groups = [{k} for k in wet]
    for i, k in itertools.combinations(wet, 2):
        shared = np.intersect1d(joints[i].surface.node_tags, joints[k].surface.node_tags)
        if len(np.setdiff1d(shared, np.intersect1d(open_ends[i], open_ends[k]))):
            joined = [g for g in groups if i in g or k in g]
            groups = [g for g in groups if g not in joined] + [set().union(*joined)]
    groups = [g for g in groups if len(g) > 1 or len(joints[min(g)].inner_ends)]
    networks = []
    for numbers in (tuple(sorted(group)) for group in groups):
        members, own = [joints[k] for k in numbers], [cases[k] for k in numbers]
        networks.append(connected(members, own, numbers))
        check(networks[-1], members, own)
    check_waterstops(joints, cases)
    return networks


def ends_of(joint: JointMesh) -> IntArray:
    """Tags of the nodes at heel and toe of a joint."""
    return np.concatenate([joint.heel.node_tags, joint.toe.node_tags])


def connected(
    joints: Sequence[JointMesh], cases: Sequence[Case], numbers: tuple[int, ...]
) -> Network:
    """The network of some joints that meet, from their meshes, cases and numbers."""
    first, dim = joints[0], joints[0].dim
    surfaces = [joint.surface for joint in joints]
    all_tags = np.concatenate([s.node_tags for s in surfaces])
    tags, index = np.unique(all_tags, return_index=True)
    nodes = tuple(np.searchsorted(tags, s.node_tags) for s in surfaces)
    surface = Body(
        np.concatenate([s.points for s in surfaces])[index],
        tags,
        [
            (shape, own[table])
            for s, own in zip(surfaces, nodes, strict=True)
            for shape, table in s.cells
        ],
        np.concatenate([s.element_tags for s in surfaces]),
        normals=np.concatenate([s.normals for s in surfaces]),
    )
    inner = np.concatenate([joint.inner_ends for joint in joints])
    count = np.bincount(np.concatenate(nodes))

    def outer(ends: list[Body]) -> Body:
        own = np.setdiff1d(np.concatenate([end.node_tags for end in ends]), inner)
        return Body(surface.points[np.searchsorted(tags, own)], own, [], np.zeros(0, int))

    heel, toe = outer([j.heel for j in joints]), outer([j.toe for j in joints])
    closed = distinct(np.searchsorted(tags, inner)) if len(inner) else np.zeros(0, int)
    closed = closed[count[closed] == 1]
    # that of a crack does not depend on aperture_min
    by_aperture = any(case["uplift"] == "flow" for case in cases)
    apertures = [case["aperture_min"] if by_aperture else 1.0 for case in cases]
    single = len(heel.node_tags) == len(toe.node_tags) == 1 or dim == 3
    ends = len(heel.node_tags) > 0 and len(toe.node_tags) > 0 and single
    return Network(
        numbers=numbers,
        mesh=replace(first, surface=surface, heel=heel, toe=toe, upper_tags=tags),
        nodes=nodes,
        branched=bool(not ends or len(closed) or most_sides(surface) > 2),
        in_series=len(inner) > len(closed),
        closed=closed,
        flowing=any(map(flows, cases)),
        transmissivities=tuple((a / apertures[0]) ** 3 for a in apertures),
    )


def most_sides(surface: Body) -> int:
    """The largest number of elements of a surface at one of their sides (2D: at a node)."""
    if surface.cells[0][0] == "line":
        return int(np.bincount(np.concatenate([t.ravel() for _, t in surface.cells])).max())
    sides = np.concatenate(
        [np.stack([t, np.roll(t, -1, axis=1)], axis=2).reshape(-1, 2) for _, t in surface.cells]
    )
    return int(np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)[1].max())


def check(network: Network, joints: Sequence[JointMesh], cases: Sequence[Case]) -> None:
    """Raise InputError if the joints of a network can not have one flow of water."""
    names = " and ".join(joint.name for joint in joints)
    modes = list(dict.fromkeys(case["uplift"] for case in cases))
    if "drained" in modes and any(map(flows, cases)):
        raise InputError(
            f"uplift = {', '.join(modes)}: must not be drained in one of the joints that meet "
            f"({names}) and flow or cracked in another; there drains = 1"
        )
    effects = dict.fromkeys(c["drain_effectiveness"] for c in cases if flows(c) and has_drains(c))
    if len(effects) > 1:
        raise InputError(
            f"drain_effectiveness = {', '.join(f'{value:g}' for value in effects)}: must be the "
            f"same in joints that meet ({names}) with uplift = {modes[0]}"
        )
    if "drained" in modes and (network.branched or (network.mesh.dim == 3 and network.in_series)):
        raise InputError(
            f"uplift = drained: must be another one where the joints that meet ({names}) are not "
            "one path from heel to toe"
        )


def check_waterstops(joints: Sequence[JointMesh], cases: Sequence[Case]) -> None:
    """Raise InputError if the heel of a joint with a waterstop is not on the upstream face."""
    for joint, case in zip(joints, cases, strict=True):
        inner = np.isin(joint.heel.node_tags, joint.inner_ends).any()
        if case["uplift"] == "waterstop" and inner:
            raise InputError(
                f"uplift = waterstop: must be another one in joint {joint.name}, whose heel is at "
                "another joint, not on the upstream face"
            )
