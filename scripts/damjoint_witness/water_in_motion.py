"""Water pressure in the joints in every time step of an earthquake, from the written openings.

By `quake_uplift`, section 5 and 11 of reference/theory.md: that of the static state, of the
openings at the beginning of the step, or none in the elements of the crack that are open then.
Water that is stored (`transient`): see water_in_time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from .files import Files, Table, rows_where, split_by
from .joint_state import JointState, coordinates, pressure, states, with_all_digits
from .network import FLOWING, heads_of
from .reader import Request
from .replay import gaping
from .solids import Array
from .water import DIGITS, IN_3D


def violations(files: Files, request: Request, steps: Table) -> Iterator[str]:
    """Yield of each joint the time step whose pressure is wrong, and by how much the worst one is;
    in 3D of an earthquake with fields, which have the elements of the joints.
    """
    first = request.joints[0]
    rule = first["quake_uplift"]
    if rule == "transient" or (first["dim"] == 3 and not (files.folder / "fields").is_dir()):
        return
    at_rest = next(
        joints
        for _, joints in states(files, request, steps)
        if joints[0].rows["time"][0] == request.times[-1]
    )
    updates = [
        split_by(rows_where(steps, steps["joint"] == k + 1), "update") for k in numbers(request)
    ]
    moving = [n for n, update in enumerate(updates[0]) if update["earthquake"][0]]
    if not moving:
        return
    static = pressures(at_rest, [of_joint[moving[0] - 1] for of_joint in updates])
    flows = rule == "crack" and any(joint["uplift"] in FLOWING for joint in request.joints)
    dry = (
        [without_water(joint, of_joint) for joint, of_joint in zip(at_rest, updates, strict=True)]
        if rule == "zero"
        else []
    )
    worst: dict[int, tuple[float, float]] = {}
    for n in moving:
        exact = static
        if flows:
            begin = [of_joint[n - 1] for of_joint in updates]
            exact = pressures(opened(at_rest, begin), begin)
        for k, joint in enumerate(at_rest):
            expected = np.where(dry[k][n - 1], 0, exact[k]) if dry else exact[k]
            error = float(np.abs(updates[k][n]["p"] - expected).max())
            scale = joint.unit_weight * max(joint.level, joint.tail, first["dam_height"])
            room = DIGITS if first["dim"] == 2 else IN_3D
            if not error <= room * scale and error > worst.get(k, (0.0, 0.0))[0]:
                worst[k] = error, float(updates[k][n]["time"][0])
    for k, (error, time) in worst.items():
        yield f"joint {k + 1}: p off by {error:.3g} Pa at t = {time:g} s of the earthquake"


def numbers(request: Request) -> range:
    """Return the numbers of the joints, from 0."""
    return range(len(request.joints))


def pressures(joints: Sequence[JointState], rows: Sequence[Table]) -> list[Array]:
    """Return the pressure [Pa] at the rows of each joint, nodes and integration points."""
    pairs = zip(joints, heads_of(joints), rows, strict=True)
    return [pressure(joint, heads)(coordinates(table)) for joint, heads, table in pairs]


def opened(joints: Sequence[JointState], begin: Sequence[Table]) -> list[JointState]:
    """Return the joints with the openings and the damage at the beginning of a step."""
    return [
        replace(
            joint,
            rows=with_all_digits(joint.rows, rows, rows),
            before=rows_where(rows, rows["weight"] > 0),
        )
        for joint, rows in zip(joints, begin, strict=True)
    ]


def without_water(joint: JointState, updates: Sequence[Table]) -> NDArray[np.bool_]:
    """Return the rows (updates, rows) of a joint that have no water after each update: integration
    points of the elements all of whose points gape, and the nodes of these elements.
    """
    rows = updates[0]
    at_points, where = rows["weight"] > 0, coordinates(rows)
    (sides,) = joint.sides
    points, nodes = np.flatnonzero(at_points), np.flatnonzero(~at_points)
    element = replace(sides, order=1).at(where[points], rows["weight"][points]).sides
    of_element = nodes[np.asarray(cKDTree(where[nodes]).query(sides.coordinates)[1])]
    open_points = gaping([rows_where(u, u["weight"] > 0) for u in updates], joint.values)
    dry = np.zeros((len(updates), len(where)), bool)
    for n, gapes in enumerate(open_points):
        closed = np.bincount(element, ~gapes, len(of_element)) > 0
        dry[n, points] = ~closed[element]
        dry[n, of_element[~closed].ravel()] = True
    return dry
