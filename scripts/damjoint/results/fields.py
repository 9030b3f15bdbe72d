"""Fields of a run: displacement and stress of the bodies; jump, stress and state of the joint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..scene.mesh import Body
from .tables import FLUX, Results

BODIES = ("dam", "foundation")


@dataclass
class Field:
    """The bulk at one time: displacement (nodes, 3) [m] and stress (elements, 6) [Pa] by body.

    Stress: xx, yy, zz, xy, yz, xz at the middle of each element.
    """

    displacement: dict[str, np.ndarray]
    stress: dict[str, np.ndarray]


#: Fields of the joint: name, unit, and the columns of joint.csv along x, y, z (or the one column).
OF_JOINT = {
    "jump": ("m", ("delta_t1", "delta_n", "delta_t2")),
    "traction": ("Pa", ("tau_1", "sigma_n", "tau_2")),
    "sigma_n_eff": ("Pa", ("sigma_n_eff",)),
    "p": ("Pa", ("p",)),
    "damage": ("-", ("damage",)),
    "slip": ("m", ("slip",)),
    "flux": (FLUX["flux"][0], ("flux",)),
}


def row_of_nodes(body: Body, rows: dict[str, np.ndarray]) -> np.ndarray:
    """For each mesh node of the joint (n,) its row in the joint's table at one time."""
    far = (body.points[:, None, 0] - rows["x"]) ** 2 + (body.points[:, None, 2] - rows["z"]) ** 2
    return np.argmin(far, axis=1)


def joint_data(result: Results, body: Body, time: float) -> dict[str, np.ndarray]:
    """The joint's table at its mesh nodes: OF_JOINT by name, vectors along x, y, z."""
    rows = result.at(time)
    nearest = row_of_nodes(body, rows)
    return {
        name: np.column_stack([rows[c][nearest] for c in columns]).squeeze()
        for name, (_, columns) in OF_JOINT.items()
        if columns[0] in rows
    }
