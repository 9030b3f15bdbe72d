"""Joints that meet, as a network for the water in them: what is connected, and where it ends."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from .. import InputError, require
from ..arrays import Array, IntArray, distinct
from ..input.case import Case
from ..input.values import flows, flows_in_time, has_drains, level_unknown
from ..mesh.body import Body
from ..mesh.joint_mesh import JointMesh


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


def starts_inside(joint: JointMesh, case: Case) -> bool:
    """Whether the water before the waterstop of a joint comes from another joint."""
    at_joint = bool(np.isin(joint.heel.node_tags, joint.inner_ends).any())
    return case["uplift"] == "waterstop" and case["waterstop"] > 0 and at_joint


def sealed(joint: JointMesh, number: int) -> JointMesh:
    """A joint, by its number, that meets no other one at its toe: its waterstop ends the path."""
    tags, toe = joint.surface.node_tags.astype(int), joint.toe.node_tags.astype(int)
    distinct_tags = np.where(np.isin(tags, toe), (number + 1 << 40) + tags, tags)
    return replace(
        joint,
        surface=replace(joint.surface, node_tags=distinct_tags),
        toe=replace(joint.toe, node_tags=(number + 1 << 40) + toe),
        inner_ends=np.union1d(joint.inner_ends.astype(int), (number + 1 << 40) + toe),
    )


def water_networks(joints: Sequence[JointMesh], cases: Sequence[Case]) -> list[Network]:
    """The networks of a scene, from the meshes and cases of its joints; none where no joints meet.

    Raises InputError if joints that meet have settings that do not go together.
    """
    if not any(joint.meets for joint in joints):
        return []
    inside = [k for k, case in enumerate(cases) if starts_inside(joints[k], case)]
    if solid := [joints[k] for k in inside if joints[k].dim == 3]:
        raise InputError(
            f"uplift = waterstop: must be another one in joint {solid[0].name}, whose heel is at "
            "another joint, not on the upstream face"
        )
    joints = [sealed(joint, k) if k in inside else joint for k, joint in enumerate(joints)]
    passable = [k for k, case in enumerate(cases) if case["uplift"] not in ("none", "waterstop")]
    wet = sorted([*passable, *inside])
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
        members, member_cases = [joints[k] for k in numbers], [cases[k] for k in numbers]
        networks.append(connected(members, member_cases, numbers))
        check(networks[-1], members, member_cases)
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
            (shape, numbers[table])
            for s, numbers in zip(surfaces, nodes, strict=True)
            for shape, table in s.cells
        ],
        np.concatenate([s.element_tags for s in surfaces]),
        normals=np.concatenate([s.normals for s in surfaces]),
    )
    inner = np.concatenate([joint.inner_ends for joint in joints])
    count = np.bincount(np.concatenate(nodes))

    def outer(ends: list[Body]) -> Body:
        exits = np.setdiff1d(np.concatenate([end.node_tags for end in ends]), inner)
        return Body(surface.points[np.searchsorted(tags, exits)], exits, [], np.zeros(0, int))

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
    modes = dict.fromkeys(case["uplift"] for case in cases)
    drained, meeting = "drained" in modes, f"joints that meet ({names})"
    rule = (
        f"not be drained in one of the {meeting} and flow or cracked in another; there drains = 1"
    )
    require(not drained or not any(map(flows, cases)), "uplift", ", ".join(modes), rule)
    no_ends = not len(network.mesh.heel_nodes) and not len(network.mesh.toe_nodes)
    if no_ends and any(map(flows_in_time, cases)):
        why = "whose volume could not change (no equilibrium)"
        rule = f"be > 0 in joints without an end at the water ({names}), {why}"
        require(cases[0]["storage"], "storage", 0, rule)
    effects = dict.fromkeys(c["drain_effectiveness"] for c in cases if flows(c) and has_drains(c))
    given = ", ".join(f"{value:g}" for value in effects)
    require(len(effects) <= 1, "drain_effectiveness", given, f"be the same in {meeting}")
    branches = network.branched or (network.mesh.dim == 3 and network.in_series)
    rule = f"be another one where the {meeting} are not one path from heel to toe"
    require(not (drained and branches), "uplift", "drained", rule)


# -- paths in the plane

#: Height of an end that a path does not have [m].
NOWHERE = 1e30


class HigherHeel(NamedTuple):
    """A heel above the lowest one: level of the reservoir [m] above which water enters there, and
    the path coordinate of the joint's own heel and toe from then on.
    """

    level: float
    begin: float
    end: float


@dataclass(frozen=True, kw_only=True)
class WaterPath:
    """The path of the water through a joint in 2D and on in others; in branches it is at rest."""

    #: heights of its ends at reservoir and tailwater [m], NOWHERE if it has none; head of water at
    #: rest where both are dry, at most
    heel_y: float
    toe_y: float
    rest_y: float
    #: normalised path coordinate of heel and toe of the joint
    begin: float = 0.0
    end: float = 1.0
    #: levels of the tailwater [m] up to which it is the path
    highest_tail: float = NOWHERE
    #: whether no water enters at a dry end, even if the flow is not computed
    exits: bool = False
    #: whether the path ends at heel and toe of the joint
    open_heel: bool = True
    open_toe: bool = True
    #: higher heels, from below
    higher_heels: tuple[HigherHeel, ...] = ()
    #: drains of uplift = drained on a path through several joints
    drains: tuple[PathDrains, ...] = ()

    @staticmethod
    def of(case: Case) -> WaterPath | None:
        """That of the case of a joint; None if there is more than one, or in 3D."""
        section = case.section
        if "path" not in section:
            heel, toe = section["heel_y"][0], section["toe_y"][0]
            return WaterPath(heel_y=heel, toe_y=toe, rest_y=min(heel, toe))
        if not section["path"]:
            return None
        values: dict[str, Any] = dict(zip(NUMBERS, section["path"], strict=False))
        values |= zip(FLAGS, map(bool, section["path"][len(NUMBERS) :]), strict=True)
        heels, drains = section["path_higher_heels"], section["path_drains"]
        return WaterPath(
            **values,
            higher_heels=tuple(HigherHeel(*heels[k : k + 3]) for k in range(0, len(heels), 3)),
            drains=tuple(PathDrains(*drains[k : k + 4]) for k in range(0, len(drains), 4)),
        )

    def at(self, reservoir: float) -> WaterPath:
        """The path for a head of the reservoir [m]."""
        reached = [heel for heel in self.higher_heels if reservoir > heel.level]
        return replace(self, begin=reached[-1].begin, end=reached[-1].end) if reached else self

    @property
    def goes_on(self) -> bool:
        """Whether it goes on in another joint, or does not reach heel or toe."""
        return not (self.open_heel and self.open_toe and (self.begin, self.end) == (0, 1))

    @property
    def section(self) -> dict[str, list[float]]:
        """The path in the section of a case, from which `of` reads it."""
        return {
            "path": [float(getattr(self, name)) for name in (*NUMBERS, *FLAGS)],
            "path_higher_heels": [value for heel in self.higher_heels for value in heel],
            "path_drains": [value for drains in self.drains for value in drains],
        }


#: Attributes of a path in the section of a case, in their order.
NUMBERS = ("heel_y", "toe_y", "rest_y", "begin", "end", "highest_tail")
FLAGS = ("exits", "open_heel", "open_toe")


class PathDrains(NamedTuple):
    """Drains of uplift = drained on a path: path coordinate; height of their outlet [m], that of
    the joint there or of the gallery; effectiveness; path coordinate of the head that it counts
    from.
    """

    at: float
    outlet: float
    effectiveness: float
    reference: float


def with_paths(case: Case, joints: Sequence[JointMesh]) -> Case:
    """The case of a user's own geometry with the paths of the water through joints that meet.

    Raises InputError if joints that meet have settings that do not go together.
    """
    networks = water_networks(joints, case.joints)
    paths: dict[int, dict[str, list[float]]] = {}
    for network in networks:
        for k in network.numbers:
            paths[k] = {"path": [], "path_higher_heels": [], "path_drains": []}
        if network.mesh.dim == 2:
            paths |= {k: path.section for k, path in plane_paths(network, joints, case).items()}
    if not paths:
        return case
    of_joints = tuple(
        replace(joint, section=joint.section | paths.get(k, {}))
        for k, joint in enumerate(case.of_joints)
    )
    return replace(case, of_joints=of_joints)


def plane_paths(network: Network, joints: Sequence[JointMesh], case: Case) -> dict[int, WaterPath]:
    """The path through each joint of a network in 2D, by its number; empty if water may leave at
    more than one toe, or at a heel, at the levels of the case.
    """
    mesh, y = network.mesh, network.mesh.surface.points[:, 1]
    heels, toes = mesh.heel_nodes[np.argsort(y[mesh.heel_nodes])], mesh.toe_nodes
    reservoir = np.inf if level_unknown(case) else max(case.levels)
    reservoir += case["joint_head_offset"]
    if network.branched:
        toes = toes[y[toes] < max(reservoir, *case.tail_levels)]
    higher = heels[y[heels] > y[heels].min(initial=NOWHERE)]
    highest_tail = float(y[higher].min(initial=NOWHERE))
    if len(toes) > 1 or max(case.tail_levels) > highest_tail:
        return {}
    first = np.setdiff1d(heels, higher)
    levels = sorted(set(y[higher].tolist()))
    alongs = [path_coordinate(mesh.surface, first, toes)]
    alongs += [path_coordinate(mesh.surface, heels[y[heels] <= level], toes) for level in levels]
    rest = y[[*mesh.heel_nodes, *mesh.toe_nodes, *network.closed]].min()
    heel_y, toe_y = (float(y[nodes[0]]) if len(nodes) else NOWHERE for nodes in (first, toes))
    paths, drains = {}, []
    for k, nodes in zip(network.numbers, network.nodes, strict=True):
        heel, toe = nodes[joints[k].heel_nodes[0]], nodes[joints[k].toe_nodes[0]]
        (begin, end), *further = ((float(along[heel]), float(along[toe])) for along in alongs)
        paths[k] = WaterPath(
            heel_y=heel_y,
            toe_y=toe_y,
            rest_y=float(rest),
            begin=begin,
            end=end,
            highest_tail=highest_tail,
            exits=network.branched,
            open_heel=heel in first,
            open_toe=toe in toes,
            higher_heels=tuple(
                HigherHeel(level, *ends) for level, ends in zip(levels, further, strict=True)
            ),
        )
        of_joint = case.joints[k]
        if of_joint["uplift"] == "drained":
            share = of_joint["drain_x"] / of_joint.joint_along
            at, height = ((1 - share) * v[heel] + share * v[toe] for v in (alongs[0], y))
            outlet = max(of_joint["drain_level"], float(height))
            reference = float(at) if of_joint["drain_reference"] == "linear" else 0.0
            effect = of_joint["drain_effectiveness"]
            drains.append(PathDrains(float(at), outlet, effect, reference))
    return {k: replace(path, drains=tuple(sorted(drains))) for k, path in paths.items()}


def path_coordinate(surface: Body, heel: IntArray, toe: IntArray) -> Array:
    """Normalised path coordinate at the nodes of lines in the plane: 0 at the heel, 1 at the toe,
    linear along the path from one to the other, constant on branches; 0 or 1 with one of them only.
    """
    fixed = np.concatenate([heel, toe])
    along = np.zeros(len(surface.points))
    along[toe] = 1
    if not len(fixed):
        return along
    table = np.concatenate([rows for _, rows in surface.cells])
    lengths = np.linalg.norm(np.diff(surface.points[table], axis=1)[:, 0], axis=1)
    laplace = np.zeros((len(along),) * 2)
    for (a, b), length in zip(table, lengths, strict=True):
        laplace[[a, b, a, b], [a, b, b, a]] += np.array([1, 1, -1, -1]) / length
    free = np.setdiff1d(np.arange(len(along)), fixed)
    along[free] = np.linalg.solve(
        laplace[np.ix_(free, free)], -laplace[np.ix_(free, fixed)] @ along[fixed]
    )
    return along
