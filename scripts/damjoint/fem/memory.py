"""Memory: what is left of it, and what a case needs, known before it is meshed."""

from __future__ import annotations

import re
import resource
from pathlib import Path

from .. import RunError
from ..model.case import Case

#: Of an address space that is limited, what the libraries' own buffers take [bytes].
BUFFERS = 0.15e9


def bulk_size(case: Case) -> float:
    """About the number of unknowns of both bodies, before any meshing.

    A triangle has half of the product of the sizes at both ends of the body, order 2 four unknowns
    a triangle. (Prisms and tetrahedra: within a factor of three.)
    """
    dim, order, near = int(case["dim"]), int(case["order"]), case.joint_length / case["n_joint"]
    dam = (case["dam_base"] + case["dam_crest"]) / 2 * case["dam_height"]
    foundation = (case["dam_base"] + 2 * case["found_side"]) * case["found_depth"]
    triangles = 2 * (dam / (near * case["h_dam"]) + foundation / (near * case["h_found"]))
    return triangles * order**2 * (1 if dim == 2 else 1.5 * case["n_layers"])


def left() -> float:
    """Memory [bytes] that this process can still get: of the machine, and of its own address space
    where that is limited (`ulimit -v`). Infinite where nothing tells.
    """
    found = [float("inf")]
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    try:
        told = re.search(r"MemAvailable:\s+(\d+)", Path("/proc/meminfo").read_text())
        found.append(float(told[1]) * 1024)
        if limit != resource.RLIM_INFINITY:
            taken = re.search(r"VmSize:\s+(\d+)", Path("/proc/self/status").read_text())
            found.append(max(0.0, limit - float(taken[1]) * 1024 - BUFFERS))
    except (OSError, TypeError):
        pass
    return min(found)


def check_memory(needed: float, what: str) -> None:
    """Raise RunError if more memory [bytes] is needed than is left; what: the unknowns in words."""
    if needed > left():
        raise RunError(
            f"memory: {what} need about {needed / 1e9:.1f} GB and {left() / 1e9:.1f} GB are left; "
            "use a coarser mesh (n_joint, n_layers, h_dam, h_found)"
        )
