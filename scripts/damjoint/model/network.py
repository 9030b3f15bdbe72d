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
    networks = [connected([joints[k] for k in sorted(g)], tuple(sorted(g))) for g in groups]
    for network in networks:
        check(network, [joints[k] for k in network.numbers], [cases[k] for k in network.numbers])
    check_waterstops(joints, cases)
    return networks


def ends_of(joint: JointMesh) -> IntArray:
    """Tags of the nodes at heel and toe of a joint."""
    return np.concatenate([joint.heel.node_tags, joint.toe.node_tags])


def connected(joints: Sequence[JointMesh], numbers: tuple[int, ...]) -> Network:
    """The network of some joints that meet."""
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
    single = len(heel.node_tags) == len(toe.node_tags) == 1 or dim == 3
    ends = len(heel.node_tags) > 0 and len(toe.node_tags) > 0 and single
    return Network(
        numbers=numbers,
        mesh=replace(first, surface=surface, heel=heel, toe=toe, upper_tags=tags),
        nodes=nodes,
        branched=bool(not ends or len(closed) or most_sides(surface) > 2),
        in_series=len(inner) > len(closed),
        closed=closed,
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
    if len(modes) > 1 and any(map(flows, cases)):
        raise InputError(
            f"uplift = {', '.join(modes)}: must be the same in joints that meet ({names}), but for "
            "none and waterstop, imposed and drained"
        )
    drained = [case for case in cases if flows(case) and has_drains(case)]
    for name, of_cases in (("joint_head_offset", cases), ("drain_effectiveness", drained)):
        values = dict.fromkeys(case[name] for case in of_cases)
        if len(values) > 1:
            listed = ", ".join(f"{value:g}" for value in values)
            raise InputError(f"{name} = {listed}: must be the same in joints that meet ({names})")
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
