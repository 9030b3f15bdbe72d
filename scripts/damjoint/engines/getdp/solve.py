"""The interface of engines/__init__.py for the reference GetDP model: one process of GetDP per
scene, two at a time.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np

from ... import ROUND_OFF, InputError, RunError, data, require
from ...fem.memory import bulk_size, check_memory
from ...input.case import Case
from ...input.values import flows, flows_in_time, freezes_uplift, has_drains
from ...mesh.mesh import Mesh, mesh_of
from ...model.network import with_paths
from .. import OnStep, Outcome
from . import process, tables
from .paths import has_level_ends, values_of_paths

#: Mesh patterns in 3D with order 2: GetDP has no such functions on prisms and hexahedra.
SOLID = ("free", "split")


def check(case: Case) -> None:
    """Raise InputError if there is no GetDP, or it cannot run the case."""
    process.find_getdp()
    if case["dim"] == 3 and case["order"] == 2:
        rule = f"be one of {', '.join(SOLID)} with engine = getdp and order = 2 in 3D"
        require(case["mesh_pattern"] in SOLID, "mesh_pattern", case["mesh_pattern"], rule)
    if case.geometry:
        mesh = mesh_of(case)
        case = case.with_joints([joint.of_case for joint in mesh.joints])
        check_user_mesh(mesh, case)
    for joint in case.joints:
        check_joint(joint)


def check_joint(joint: Case) -> None:
    """Raise InputError if this engine cannot run a joint, from its case."""
    law, uplift, engine = joint["law"], joint["uplift"], "with engine = getdp"
    file, elastic = data("pro") / f"law_{law}.pro", joint["aperture_elastic"]
    require(file.is_file(), "law", law, f"have a file pro/{file.name} {engine}")
    if flows_in_time(joint):
        check_flow_in_time(joint)
    if uplift == "flow":
        require(not joint["turbulent"], "turbulent", 1, f"be 0 {engine} (cubic law)")
        require(not elastic, "aperture_elastic", elastic, f"be 0 {engine}")
    rule = f"be crack {engine} and uplift = {uplift}"
    require(not freezes_uplift(joint), "quake_uplift", joint["quake_uplift"], rule)
    if flows(joint) and (joint["dim"] == 3 or joint.geometry):
        rule = f"be 0 {engine} and uplift = {uplift} in 3D and in a geometry of one's own"
        require(not has_drains(joint), "drains", 1, rule)
    if uplift == "waterstop" and joint["dim"] == 3:
        require(joint["order"] != 2, "order", 2, f"be 1 {engine} and uplift = waterstop in 3D")


#: What this engine does not include with flow in time, and why.
NOT_IN_TIME = {
    "pressure_step": "its steps do not follow the pressure",
}


def check_flow_in_time(joint: Case) -> None:
    """Raise InputError if this engine cannot run a joint that stores water, from its case."""
    other = [f"and {n} = {joint[n]:g} ({why})" for n, why in NOT_IN_TIME.items() if joint[n]]
    if joint["dim"] == 3 or joint.geometry:
        other.insert(0, "in 3D and in a geometry of one's own (steady flow)")
    if joint["drive"] != "level":
        other.append(f"and drive = {joint['drive']} (steady flow)")
    rule = f"be 0 with engine = getdp {''.join(other[:1])}"
    require(not other, "time_unit", joint["time_unit"], rule)


def check_user_mesh(mesh: Mesh, case: Case) -> None:
    """Raise InputError if this engine cannot run a user's own geometry."""
    shapes = {shape for solid in mesh.solids.values() for shape, _ in solid.cells}
    suits = mesh.dim == 2 or shapes == {"tetra"} or case["order"] == 1
    rule = "have tetrahedra with engine = getdp and order = 2"
    require(suits, "geometry", str(case.geometry), rule)
    for joint in mesh.joints:
        rule = f"have triangles or quadrangles in joint {joint.name}, not both, with engine = getdp"
        faces = {shape for shape, _ in joint.surface.cells}
        require(len(faces) == 1, "geometry", str(case.geometry), rule)
    if mesh.divided:
        mesh.face_entities()
    values_of_paths(mesh, case)
    for joint, joint_case in zip(mesh.joints, case.joints, strict=True):
        if joint.upper == joint.lower:
            rule = f"joint {joint.name} must lie between two bodies with engine = getdp"
            raise InputError(f"geometry = {case.geometry}: {rule}")
        uplift = joint_case["uplift"]
        if uplift in ("drained", "cracked", "flow"):
            where = "with engine = getdp where heel or toe are not level"
            rule = f"be none, imposed or waterstop {where}"
            require(has_level_ends(joint), "uplift", uplift, rule)
        start, end = joint.heel_line
        to_line = np.linalg.norm(np.cross(joint.heel.points - start, end - start), axis=1)
        straight = uplift != "waterstop" or to_line.max() <= ROUND_OFF * case.size**2
        why = "with engine = getdp, as its heel is not straight"
        require(straight, "uplift", uplift, f"be another one in joint {joint.name} {why}")


#: Memory of GetDP [bytes per unknown], by dimension, and functions of order 2 per node of the mesh.
PER_UNKNOWN, EDGES = {2: 3000, 3: 8000}, {2: 4, 3: 8}


def check_sizes(case: Case, mesh: Mesh) -> None:
    """Raise RunError if the unknowns of a mesh need more memory than is available."""
    functions = mesh.nodes if case["order"] == 1 else EDGES[int(case["dim"])] * mesh.nodes
    check_size(case, case["dim"] * functions)


def check_size(case: Case, unknowns: float) -> None:
    """Raise RunError if so many unknowns need more memory than is available."""
    at_once = min(2, len(case.scenes()))
    check_memory(at_once * PER_UNKNOWN[int(case["dim"])] * unknowns, f"{unknowns:.0f} unknowns")


def solve(case: Case, on_step: OnStep, fields: bool) -> Iterator[Outcome]:
    """The scenes of a case; GetDP works in a temporary folder. See engines/__init__.py."""
    start = time.perf_counter()
    if not case.geometry:
        check_size(case, bulk_size(case))
    mesh = mesh_of(case)
    check_sizes(case, mesh)
    meshed = time.perf_counter() - start
    with tempfile.TemporaryDirectory(prefix="damjoint-") as name, ThreadPoolExecutor(2) as pool:
        mesh_file = Path(name) / "scene.msh"
        mesh.write(mesh_file, node_points=case.stores_water)
        case = case.with_joints([joint.of_case for joint in mesh.joints])
        if case.geometry:
            case = with_paths(case, mesh.joints)
        scenes, running, runner = case.scenes(), [], process.Runner()
        for number, scene in enumerate(scenes):
            folder = Path(name) / scene["uplift"]
            folder.mkdir()
            watch = lambda now, number=number: on_step(number, now)
            running.append(
                (folder, pool.submit(runner.solve, scene, mesh, mesh_file, folder, fields, watch))
            )
        for scene, (folder, future) in zip(scenes, running, strict=True):
            error: BaseException | None = None
            usage = process.Usage()
            try:
                usage = future.result()
            except BaseException as caught:
                error = caught
                if not isinstance(caught, Exception):  # interrupted
                    runner.stop()
            try:
                result, saved = tables.read(scene, folder)
                of_bodies = tables.read_fields(folder, saved, mesh) if fields and not error else {}
            except (OSError, ValueError, IndexError) as damage:
                raise error or RunError(f"GetDP: its tables can not be read: {damage}") from None
            result.info = usage.about(mesh, {"mesh": meshed, "solve": usage.wall})
            yield Outcome(result, lambda: mesh, partial(dict, of_bodies), error)
