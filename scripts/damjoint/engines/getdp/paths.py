"""Joints that meet, for pro/joints.pro: the path of the water through them."""

from __future__ import annotations

import math

import numpy as np

from ... import InputError
from ...arrays import IntArray, Value
from ...fem import elements
from ...joint.flow import JointFields, harmonic
from ...model.case import Case
from ...model.mesh import JointMesh, Mesh
from ...model.network import Network, networks_of

#: Height of an end that does not exist [m].
NOWHERE = 1e30


def values_of_paths(mesh: Mesh, case: Case) -> list[dict[str, Value]]:
    """The values of pro/joints.pro for the water in each joint of a user's own geometry.

    Raises InputError for networks that this engine can not compute.
    """
    values = [values_alone(joint) for joint in mesh.joints]
    for network in networks_of(mesh.joints, case.joints):
        of_network = values_side_by_side if mesh.dim == 3 else values_in_plane
        for number, of_joint in of_network(network, mesh.joints, case).items():
            scale = network.transmissivities[network.numbers.index(number)]
            common = common_values(network, case)
            values[number] = common | of_joint | {"closed_conductivity": scale}
    return values


def values_alone(joint: JointMesh) -> dict[str, Value]:
    """Those of a joint that meets no other one with water."""
    heel, toe = (joint.ends[name][0] for name in ("heel_y", "toe_y"))
    return {"path_heel_y": heel, "path_toe_y": toe, "path_rest_y": min(heel, toe)}


def common_values(network: Network, case: Case) -> dict[str, Value]:
    """Those that all joints of a network share."""
    first = case.joints[network.numbers[0]]
    return {
        "network": float(network.numbers[0]),
        "network_K_N": first["K_N"],
        "network_aperture": first["aperture_min"],
        "in_flow": float(network.flowing),
        "path_exits": float(network.branched),
    }


def refused(network: Network, joints: list[JointMesh], why: str) -> InputError:
    """The error of a network."""
    names = " and ".join(joints[k].name for k in network.numbers)
    return InputError(f"uplift: must be none with engine = getdp where joints meet ({names}) {why}")


def values_side_by_side(
    network: Network, joints: list[JointMesh], case: Case
) -> dict[int, dict[str, Value]]:
    """Those of joints in 3D that have their heels and toes on the surface: one path coordinate."""
    heel, toe = (end.points[:, 1] for end in (network.mesh.heel, network.mesh.toe))
    if network.branched or network.in_series:
        raise refused(network, joints, "in 3D, unless they lie side by side")
    if max(np.ptp(heel), np.ptp(toe)) > 1e-9 * case.size:
        raise refused(network, joints, "and their heels or toes are not level")
    ends = {"path_heel_y": float(heel[0]), "path_toe_y": float(toe[0])}
    path = {"joint_path": float(network.numbers[0]), "path_rest_y": min(ends.values())}
    return {k: {**ends, **path} for k in network.numbers}


def values_in_plane(
    network: Network, joints: list[JointMesh], case: Case
) -> dict[int, dict[str, Value]]:
    """Those of joints in 2D: one path with branches in which the water is at rest."""
    mesh, number = network.mesh, network.numbers
    if any(case.joints[k]["uplift"] == "drained" for k in number) and network.in_series:
        raise refused(network, joints, "in series and one is drained")
    surface = mesh.surface
    y = surface.points[:, 1]
    ends = [live(mesh.heel_nodes, y, case), live(mesh.toe_nodes, y, case)]
    if not network.branched:
        ends = [mesh.heel_nodes, mesh.toe_nodes]
    if max(map(len, ends)) > 1:
        raise refused(network, joints, "and water reaches more than one heel or toe")
    fixed = np.concatenate(ends)
    along = np.zeros(len(y))
    if len(fixed):
        rule = elements.JOINT["full"][1]
        fields = JointFields(mesh, elements.Space(surface, 1), rule, branched=True)
        along = harmonic(fields.laplace, fixed, np.isin(fixed, ends[1]).astype(float))
    heights = [float(y[nodes[0]]) if len(nodes) else NOWHERE for nodes in ends]
    rest = y[[*mesh.heel_nodes, *mesh.toe_nodes, *network.closed]].min()
    values: dict[int, dict[str, Value]] = {}
    for k, nodes in zip(number, network.nodes, strict=True):
        heel, toe = nodes[joints[k].heel_nodes[0]], nodes[joints[k].toe_nodes[0]]
        values[k] = {
            "path_heel_y": heights[0],
            "path_toe_y": heights[1],
            "path_rest_y": float(rest),
            "path_begin": float(along[heel]),
            "path_end": float(along[toe]),
            "open_heel": float(heel in fixed),
            "open_toe": float(toe in fixed),
        }
    return values


def live(nodes: IntArray, y: np.ndarray, case: Case) -> IntArray:
    """Those of some ends, by their heights, at which water can enter or leave."""
    reservoir = max(case.levels) if case["drive"] == "level" else math.inf
    highest = max(reservoir + case["joint_head_offset"], *case.tail_levels)
    return nodes[y[nodes] < highest]
