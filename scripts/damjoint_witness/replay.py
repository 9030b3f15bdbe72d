"""Laws from both sides: every node's and integration point's history, replayed by `laws`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from math import hypot

import numpy as np
from numpy.typing import NDArray

from .files import Table, rows_where, split_by
from .laws import LAWS
from .laws.point import Values

#: Tolerance of stresses, relative to the strength; of damage.
TOLERANCE = 1e-6
#: Rounding of a stress over the stiffness times the jump, and over the stress itself [-].
ROUNDING = 1e-11
#: A stress that is none over the weight of a column of the dam, rho g H [-]: 1e-9 Pa under 45 m of
#: concrete.
NOTHING = 1e-15


def laws(steps: Table, joints: Sequence[Values]) -> Iterator[str]:
    """Check traction, damage, slip and the further internal variables of all updates of steps.csv;
    joints: values of each joint.
    """
    for k, values in enumerate(joints):
        rows = rows_where(steps, steps["joint"] == k + 1)
        if len(rows["update"]):
            yield from law_of_joint(rows, values, f"joint {k + 1}: " if len(joints) > 1 else "")


def law_of_joint(rows: Table, values: Values, prefix: str) -> Iterator[str]:
    """Check a joint: the first point that differs, and by how much the worst one does."""
    updates = split_by(rows, "update")
    times = times_of(updates)
    names = ("delta_n", "delta_t1", "delta_t2", "sigma_n_eff", "tau_1", "tau_2", "damage", "slip")
    table = np.array([[u[name] for name in names] for u in updates])  # (updates, names, points)
    further = [name for name in ("lambda", "joint_thickness") if name in rows]
    extra = np.array([[u[name] for name in further] for u in updates])
    worst: dict[str, tuple[float, float]] = {}
    weight = max(values["rho_dam"], values["rho_water"]) * values["g"] * values["dam_height"]
    for q in range(table.shape[2]):
        point = LAWS[values["law"]](values)
        history = table[:, :, q].tolist()
        for n, (begin, end, frozen) in enumerate(times):
            *row, damage, slip = history[n]
            jump = (row[0], row[1], row[2])
            point.step(jump, begin, end, frozen)
            after = point
            if frozen:  # with the damage that the step has done the point may slip further
                after = copy(point)
                after.step(jump, end, end, False)
            exact = after.traction(jump)
            size = point.K_N * abs(jump[0]) + point.K_T * hypot(jump[1], jump[2])
            room = TOLERANCE * point.strength(exact[0]) + ROUNDING * (size + abs(row[3]))
            room += NOTHING * weight
            room_of_shear = room + after.shear_rounding(jump)
            errors = {
                "normal stress": abs(row[3] - exact[0]) / room,
                "shear stress": hypot(row[4] - exact[1], row[5] - exact[2]) / room_of_shear,
                "slip": abs(slip - point.slip()) * point.K_T / room,
            }
            if point.K_N * point.jumping(jump) > room:
                errors["damage"] = abs(damage - point.damage(jump)) / TOLERANCE
            if further:
                known = point.further()
                for column, value in zip(further, extra[n, :, q].tolist(), strict=True):
                    if column in known:
                        errors[column] = abs(value - known[column]) * point.K_N / room
            for name, error in errors.items():
                if not error <= 1 and error > worst.get(name, (0.0, 0.0))[0]:
                    worst[name] = error, updates[n]["time"][0]
    for name, (error, time) in worst.items():
        yield f"{prefix}{name} off by {error:.3g} tolerances from the law at t = {time:g}"


def times_of(updates: Sequence[Table]) -> list[tuple[float, float, bool]]:
    """Beginning and end of the step of each update, and whether the damage was frozen; what acts on
    the joint with time, works, does not go on in an earthquake and after it.
    """
    times = [(u["begin"][0], u["time"][0], bool(u["frozen"][0])) for u in updates]
    shaken = False
    for n, update in enumerate(updates):
        shaken |= bool(update["earthquake"][0])
        if shaken:
            times[n] = (times[n - 1][1], times[n - 1][1], times[n][2])
    return times


def gaping(updates: Sequence[Table], values: Values) -> NDArray[np.bool_]:
    """Whether each point of a joint belongs to the crack and is not closed, after each update
    (updates, points), by the law.
    """
    names = ("delta_n", "delta_t1", "delta_t2")
    jumps = np.array([[u[name] for name in names] for u in updates])
    found = np.zeros((len(updates), jumps.shape[2]), bool)
    times = times_of(updates)
    for q in range(jumps.shape[2]):
        point = LAWS[values["law"]](values)
        history = jumps[:, :, q].tolist()
        for n, (begin, end, frozen) in enumerate(times):
            jump = (history[n][0], history[n][1], history[n][2])
            point.step(jump, begin, end, frozen)
            found[n, q] = point.gapes(jump)
    return found
