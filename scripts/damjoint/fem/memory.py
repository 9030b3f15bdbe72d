"""Memory that is available, and estimates of what a case needs, before it is meshed."""

from __future__ import annotations

import math
import re
import resource
from pathlib import Path
from typing import TYPE_CHECKING

from .. import RunError
from ..input.case import Case
from ..progress import INTERVAL, clock

if TYPE_CHECKING:
    from .bodies import Bodies

#: Part of a limited address space that buffers of libraries take [bytes].
BUFFERS = 0.15e9

#: Seconds of bodies of a million unknowns and the power by which they grow, by dimension; measured
#: by `damjoint bench`, as all of these.
OF_BODIES = {2: (24.0, 1.12), 3: (350.0, 1.45)}
#: Seconds of the elimination of joints, over the cube of their unknowns.
ELIMINATION = 2e-10
#: Seconds of an iteration, over the same.
FACTORISATION = 1.1e-11
#: Iterations of a step, usually.
ITERATIONS = 5.0

# Uncondensed bodies in 3D are faster above a number of unknowns; measured by `damjoint bench`

#: Number of unknowns of a run of few steps.
ITERATED = 50_000
#: Number of unknowns of a run of many steps, over the power STEPS_POWER of their number.
PER_STEP = 3500
#: See above [-].
STEPS_POWER = 1.33
#: Further memory of uncondensed bodies after their assembly [bytes per unknown], measured likewise.
PER_UNKNOWN_ITERATED = 4000

#: Memory of a factorised body [bytes per unknown], measured in 2D by `damjoint bench`.
PER_UNKNOWN = 2400


def bulk_size(case: Case) -> float:
    """Estimate the number of unknowns of all bodies, within a factor of five.

    A triangle covers half of the square of its size. From the joint, whose elements are no larger
    there than a body is high, sizes grow to those of the crest and of the foundation's boundary;
    beside the joint with the distance from it. Order 2 has four unknowns a triangle. In 3D a free
    mesh is coarser across the valley, too, where its triangles are larger.
    """
    dim, order, near = int(case["dim"]), int(case["order"]), case.joint_length / case["n_joint"]
    height, depth, crest, far = (
        case[name] for name in ("dam_height", "found_depth", "h_dam", "h_found")
    )
    dam = (case["dam_base"] + case["dam_crest"]) / 2 / crest / min(near / height, 1)
    below = case["dam_base"] / far / min(near / depth, 1)
    beside = 2 * case["found_side"] * depth / far**2 * (1 + max(math.log(far / near), 0))
    layers = [1.0] * 3 if dim == 2 else [case["n_layers"]] * 3
    if dim == 3 and case["mesh_pattern"] == "free":  # 1/h^3 over a linear h, over 1/h^2
        shares = (near / crest + 1) / 2, (near / far + 1) / 2, near / far
        layers = [max(1.0, min(share, 1.0) * case["n_layers"]) for share in shares]
    triangles = 2 * (dam * layers[0] + below * layers[1] + beside * layers[2])
    return float(triangles * order**2 * (1 if dim == 2 else 4.5))


def joints_size(case: Case) -> int:
    """Number of jump unknowns of all joints (free meshes of order 2 have a few less)."""
    return sum(map(joint_size, case.joints))


def joint_size(case: Case) -> int:
    """Number of jump unknowns of a joint."""
    dim, order = int(case["dim"]), int(case["order"])
    return (
        dim
        * (order * int(case["n_joint"]) + 1)
        * (order * int(case["n_layers"]) + 1 if dim == 3 else 1)
    )


def dense_memory(unknowns: int) -> float:
    """Memory [bytes] of a Schur complement of so many unknowns and of the last fronts before it."""
    return 8.0 * unknowns**2 * 3


def sizes(case: Case) -> str:
    """What a computation begins with, for the line of its progress: it may take long."""
    if case.geometry:
        return f"{case.name}, mesh and elimination of the bodies"
    joints = joints_size(case)
    unknowns = f"about {max(bulk_size(case), joints):.0f} unknowns, {joints} of them on the joints"
    expected = seconds(case)
    forecast = f", about {clock(expected)} in all" if expected > INTERVAL else ""
    return f"{case.name}, mesh and elimination of {unknowns}{forecast}"


def seconds(case: Case) -> float:
    """Forecast the seconds of a case on an idle machine, roughly.

    By `damjoint bench` (growth with size, several joints): the bodies by their unknowns; of the
    joints, whose matrices are dense, the cube of their unknowns once for the elimination and for
    each iteration.
    """
    if case.geometry:
        return 0.0
    joints, scenes = float(joints_size(case)), len(case.scenes())
    base, power = OF_BODIES[int(case["dim"])]
    bodies = base * (max(bulk_size(case), joints) / 1e6) ** power
    iterations = ITERATIONS * len(case.times) * scenes
    return bodies + joints**3 * (ELIMINATION + iterations * FACTORISATION)


def iterates(case: Case, bodies: Bodies) -> bool:
    """Whether a run is expected to be faster with its bodies uncondensed, or has no memory for the
    condensed ones.

    To condense takes nearly the square of the number of unknowns, but a step less than with
    uncondensed bodies. In 2D it always pays.
    """
    if case["dim"] == 2:
        return False
    unknowns = float(sum(body.stiffness.shape[0] for body in bodies.by_name.values()))
    jumps = 3 * sum(len(joint.upper_tags) for joint in bodies.mesh.joints)
    needed = dense_memory(jumps) + PER_UNKNOWN * unknowns
    steps = len(case.times) * len(case.scenes())
    return unknowns > max(ITERATED, PER_STEP * steps**STEPS_POWER) or needed > available()


def check_size(case: Case, engine: str = "condensed") -> None:
    """Raise RunError if a case certainly needs more memory than is available.

    engine: condensed, iterative or auto, see `condensed_bodies`. Of uncondensed bodies, which are
    checked again after the mesh, a third of the estimate is counted, at least the unknowns of the
    joints.
    """
    joint, bulk = joints_size(case), bulk_size(case)
    what = f"{bulk:.0f} unknowns, {joint} of them on the joint,"
    needed = dense_memory(joint) + PER_UNKNOWN * bulk
    if case["dim"] == 3 and engine != "condensed":
        uncondensed = PER_UNKNOWN_ITERATED * max(joint, bulk / 3)
        needed = uncondensed if engine == "iterative" else min(needed, uncondensed)
    check_memory(needed, what)


def available() -> float:
    """Memory [bytes] that this process can still allocate: of the machine, and of its address space
    where that is limited (`ulimit -v`). Infinite if the system does not report it.
    """
    bounds = [float("inf")]
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    try:
        bounds.append(kilobytes("/proc/meminfo", "MemAvailable"))
        if limit != resource.RLIM_INFINITY:
            bounds.append(max(0.0, limit - kilobytes("/proc/self/status", "VmSize") - BUFFERS))
    except (OSError, ValueError):
        pass
    return min(bounds)


def kilobytes(path: str, name: str) -> float:
    """An entry "name: number kB" of a file of the system [bytes]. Raises OSError, ValueError."""
    match = re.search(rf"{name}:\s+(\d+)", Path(path).read_text())
    if match is None:
        raise ValueError(f"{path}: no {name}")
    return float(match[1]) * 1024


def check_memory(needed: float, what: str) -> None:
    """Raise RunError if more memory [bytes] is needed than available; what: unknowns, in words."""
    if needed > available():
        raise RunError(
            f"memory: {what} need about {needed / 1e9:.1f} GB, {available() / 1e9:.1f} GB are "
            "available; use a coarser mesh (n_joint, n_layers, h_dam, h_found)"
        )
