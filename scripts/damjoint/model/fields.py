"""Fields of a run: displacement and stress of the bodies; jump, stress and state of the joint."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..arrays import Array, IntArray, Table
from ..input.scene import numbered
from ..laws import COLUMNS, Law
from ..mesh.body import Body
from .results import FILM, FLUX, THICKNESS, Results


@dataclass
class Field:
    """The bodies at one time: displacement (nodes, 3) [m], stress (elements, 6) [Pa] at the
    middle of each element: xx, yy, zz, xy, yz, xz; with order 2 of the condensed engine also the
    displacement at the midpoints of `fem.elements.Space`.
    """

    displacement: dict[str, Array]
    stress: dict[str, Array]
    at_midpoints: dict[str, Array] = field(default_factory=dict)

    @staticmethod
    def of(
        displacement: dict[str, Array], stress: dict[str, Array], nodes: dict[str, int]
    ) -> Field:
        """From displacements at nodes, and then midpoints; nodes: their numbers."""
        return Field(
            {name: u[: nodes[name]] for name, u in displacement.items()},
            stress,
            {name: u[nodes[name] :] for name, u in displacement.items() if len(u) > nodes[name]},
        )


@dataclass
class Solution:
    """A solved scene: its tables, the bodies of its mesh, fields by requested time (or none)."""

    result: Results
    bodies: dict[str, Body]
    fields: dict[float, Field]

    def of_joint(self, number: int) -> Solution:
        """The same with the results and the surface of a single joint, by its number from 0."""
        name = numbered("joint", number)
        surface = {"joint": self.bodies[name]} if name in self.bodies else {}
        result = self.result.joints[number]
        return Solution(result, self.bodies | surface, self.fields)


#: Fields of the joint: name, unit, and the columns of joint.csv along x, y, z (or a single column).
OF_JOINT = {
    "jump": ("m", ("delta_t1", "delta_n", "delta_t2")),
    "traction": ("Pa", ("tau_1", "sigma_n", "tau_2")),
    "sigma_n_eff": ("Pa", ("sigma_n_eff",)),
    "p": ("Pa", ("p",)),
    "damage": ("-", ("damage",)),
    "slip": ("m", ("slip",)),
    **{name: (unit, (name,)) for name, (unit, _) in (COLUMNS | FLUX | FILM | THICKNESS).items()},
}


def distance(rows: Table) -> Array:
    """Distance from the heel along the joint [m]."""
    return rows.get("s", rows["x"])


def along(rows: Table) -> Table:
    """The joint's rows as curves over the distance s from the heel: means over z, or over equal
    parts of the joint where the mesh has no rows of nodes along z.
    """
    s = np.round(distance(rows), 9)
    if np.ptp(rows["z"]) > 0 and len(np.unique(s)) > len(s) / 2:
        part = s.max() / np.sqrt(len(s))
        s = (s // part + 0.5) * part
    s, node = np.unique(s, return_inverse=True)
    number = np.bincount(node)
    return {name: np.bincount(node, column) / number for name, column in rows.items()} | {"s": s}


#: States of the joint.
CLOSED, SLIPPED, SOFTENING, BROKEN = range(4)


def joint_states(rows: Table, law: Law[Any]) -> IntArray:
    """The state at each row of a joint's table: BROKEN, also closed, SOFTENING, SLIPPED, CLOSED."""
    # a law that does not soften has damage 0 or 1: values between are means over z
    softening = (rows["damage"] > 0) & law.softens
    unbroken = np.where(rows["slip"] > 0, SLIPPED, CLOSED)
    broken = rows["damage"] >= law.broken_damage
    return np.where(broken, BROKEN, np.where(softening, SOFTENING, unbroken))


def nearest_rows(points: Array, rows: Table) -> IntArray:
    """For each of some points (n, 3) the nearest row of the joint's table at one time (n,)."""
    positions = np.column_stack([rows[axis] for axis in "xyz"])
    # point by point: all distances at once need too much memory for a fine joint in 3D
    return np.array([np.argmin(((positions - point) ** 2).sum(axis=1)) for point in points], int)


def joint_body(bodies: dict[str, Body], joint: int) -> Body:
    """The surface of a joint, by its number from 0, in the bodies of a mesh."""
    return bodies[numbered("joint", joint)]


def joint_data(result: Results, body: Body, time: float) -> Table:
    """The table of the only joint of `result` at its mesh nodes: OF_JOINT, vectors by x, y, z."""
    rows = result.at(time)
    nearest = nearest_rows(body.points, rows)
    return {
        name: np.column_stack([rows[c][nearest] for c in columns]).squeeze()
        for name, (_, columns) in OF_JOINT.items()
        if columns[0] in rows
    }
