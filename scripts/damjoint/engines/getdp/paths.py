"""Joints that meet, for pro/joints.pro: the path of the water through them."""

from __future__ import annotations

import numpy as np

from ... import ROUND_OFF, InputError
from ...input.case import Case
from ...input.parameters import in_rows, listing
from ...mesh.joint_mesh import JointMesh
from ...mesh.mesh import Mesh
from ...model.network import HigherHeel, Network, PathDrains, WaterPath, plane_paths, water_networks


def values_of_paths(mesh: Mesh, case: Case) -> list[str]:
    """The values of pro/joints.pro for the water in each joint of a user's own geometry, as text.

    Raises InputError for networks that this engine can not compute.
    """
    alone = [WaterPath.of(joint) for joint in case.joints]
    texts = [path_text(path) if path else "" for path in alone]
    for network in water_networks(mesh.joints, case.joints):
        solid = mesh.dim == 3
        paths = side_by_side(network, mesh, case) if solid else in_plane(network, mesh, case)
        first = case.joints[network.numbers[0]]
        for k, scale in zip(network.numbers, network.transmissivities, strict=True):
            values = {
                "network": float(network.numbers[0]),
                "network_K_N": first["K_N"],
                "network_aperture": first["aperture_min"],
                "in_network": 1.0,
                "in_flow": float(network.flowing),
                "closed_conductivity": scale,
                "late_heel": float(reached_late(mesh.joints[k], paths[k])),
                "joint_path": float(network.numbers[0] if solid else k),
                "level_ends": float(not solid or has_level_ends(network.mesh)),
            }
            texts[k] = path_text(paths[k]) + lines(values)
    return texts


def path_text(path: WaterPath) -> str:
    """The values of pro/joints.pro of a path."""
    values = {f"path_{name}": getattr(path, name) for name in ("heel_y", "toe_y", "rest_y")}
    values |= {"path_begin": path.begin, "path_end": path.end, "path_exits": float(path.exits)}
    values |= {"open_heel": float(path.open_heel), "open_toe": float(path.open_toe)}
    text = lines(values)
    for name, kind, rows in (
        ("drain", PathDrains, path.drains),
        ("higher", HigherHeel, path.higher_heels),
    ):
        columns = zip(kind._fields, zip(*rows, strict=True), strict=False)
        text += "".join(listing(f"path_{name}_{column}", values) for column, values in columns)
    return text


def reached_late(joint: JointMesh, path: WaterPath) -> bool:
    """Whether the heel of a joint is one that the reservoir reaches above a level only."""
    outer = not np.isin(joint.heel.node_tags, joint.inner_ends).any()
    return bool(path.higher_heels) and outer and not path.open_heel


def has_level_ends(joint: JointMesh) -> bool:
    """Whether heel and toe of a joint are level."""
    size = np.abs(joint.surface.points).max()
    return all(np.ptp(end.points[:, 1]) < ROUND_OFF * size for end in (joint.heel, joint.toe))


def lines(values: dict[str, float]) -> str:
    """Lines of GetDP's language that set values, four on each."""
    return in_rows([f"{name} = {value!r};" for name, value in values.items()], 4, "") + "\n"


def refused(network: Network, mesh: Mesh, case: Case, why: str) -> InputError:
    """The error of a network."""
    names = " and ".join(mesh.joints[k].name for k in network.numbers)
    modes = ", ".join(dict.fromkeys(case.joints[k]["uplift"] for k in network.numbers))
    return InputError(
        f"uplift = {modes}: must be none in one of the joints that meet ({names}) with engine = "
        f"getdp, {why}"
    )


def side_by_side(network: Network, mesh: Mesh, case: Case) -> dict[int, WaterPath]:
    """The path through the joints of a network in 3D, which have heel and toe on the surface; its
    ends do not count where they are not level.
    """
    heel, toe = (end.points[:, 1] for end in (network.mesh.heel, network.mesh.toe))
    if network.branched or network.in_series:
        raise refused(network, mesh, case, "as they do not lie side by side")
    drained = any(case.joints[k]["uplift"] == "drained" for k in network.numbers)
    if not has_level_ends(network.mesh) and (network.flowing or drained):
        raise refused(network, mesh, case, "as their heels or toes are not level")
    ends = float(heel[0]), float(toe[0])
    path = WaterPath(heel_y=ends[0], toe_y=ends[1], rest_y=min(ends))
    return dict.fromkeys(network.numbers, path)


def in_plane(network: Network, mesh: Mesh, case: Case) -> dict[int, WaterPath]:
    """The path through each joint of a network in 2D."""
    paths = plane_paths(network, mesh.joints, case)
    if not paths:
        raise refused(network, mesh, case, "as water leaves at more than one toe or at a heel")
    return paths
