"""The mesh with which a refinement for an accuracy begins."""

from __future__ import annotations

import math

from .. import InputError
from .arithmetic import number
from .case import Case

#: Relative errors by name.
ACCURACIES = {"coarse": 0.03, "standard": 0.01, "fine": 0.002}


def relative_error(accuracy: str) -> float:
    """The relative error of an accuracy: coarse, standard, fine or a percentage.

    Raises InputError.
    """
    if accuracy in ACCURACIES:
        return ACCURACIES[accuracy]
    try:
        error = number(accuracy.removesuffix("%")) / 100 if accuracy.endswith("%") else math.nan
    except ValueError:
        error = math.nan
    if not 0 < error < 1:
        raise InputError(
            f"accuracy = {accuracy}: must be one of {', '.join(ACCURACIES)}, or a percentage "
            "> 0 and < 100, such as 0.5%"
        )
    return error


def has_plane_fields(case: Case) -> bool:
    """Whether nothing varies along z."""
    return case["dim"] == 2 or bool(case["hold_z"]) or max(case["nu_dam"], case["nu_found"]) == 0


def first_mesh(case: Case) -> dict[str, float | str]:
    """Mesh and order with which a refinement for an accuracy begins.

    Order 2, triangles, in 3D extruded and cut into tetrahedra: these represent plane fields exactly
    for any thickness.
    """
    solid = case["dim"] == 3
    n = 32 if not solid else 16 if has_plane_fields(case) else 8
    return {
        "order": 2.0,
        "mesh_pattern": "split" if solid else "free",
        "n_layers": 1.0,
        "quadrature": "full",
        "face_points": 0.0,
        "n_joint": float(n),
        "h_dam": -1.0,
        "h_found": -1.0,
    }
