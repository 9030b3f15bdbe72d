"""Balance of momentum, motion, start and end of an earthquake, from its tables.

Section 11 of reference/theory.md. Momentum is balanced at every time step: the forces of the joint
by its law and its dashpots against loads by hand and the inertia of the bodies, in the weighted
form of the time integration. The laws are replayed as in statics.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .files import Files, Table, read_table, rows_where, split_by, without_suffix
from .reader import RequestedJoint, Values, differences
from .statics import along_joint, loads, weight
from .stops import Joint, equilibrium_is_certain
from .tables import DIGITS, rows_of_nodes, updates_of

#: Tolerance of the balance of momentum, relative to the dam's weight (times its base): the largest
#: residual of a step, summed over the joint.
MOMENTUM_TOLERANCE = 1e-6
#: Tolerance of motions relative to their largest value: twelve digits, summed over the steps.
MOTION_TOLERANCE = 1e-6
#: A dam at rest stays within this share of its largest slip [-], or ...
AT_REST = 0.01
#: ... within this slip over its height [-].
LEAST_MOTION = 2.2e-7
#: A joint without friction is broken beyond this share of its length [-].
BROKEN = 0.99
#: Value of damping_mass: of the concrete, not of the water that moves with it.
OF_CONCRETE = 1
#: Standard gravity [m/s2], of records in g.
STANDARD_GRAVITY = 9.80665
#: Share of the dam's height from which a slip is not a small displacement, about.
LARGE_SLIP = 0.05
#: Tolerance of integrals of a pressure that may have kinks between the nodes, relative to the
#: square of an element's share of the joint.
KINKS = 2.0
#: Largest time over which residual values are a mean [s].
MEAN_OVER = 1.0

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shaken(RequestedJoint):
    """A joint of a dam in an earthquake: its tables, and forces by hand."""

    files: Files

    @property
    def joints(self) -> list[Shaken]:
        """All joints."""
        return [Shaken(self.request, k, self.files) for k in range(len(self.request.joints))]

    @property
    def found(self) -> dict[str, Any]:
        """What run.json has of the earthquake."""
        return dict(self.files.record["quake"])

    @cached_property
    def rows(self) -> Table:
        """Columns of quake.csv, those of the joint without suffix."""
        return without_suffix(read_table(self.files.folder / "quake.csv"), self.number)

    @cached_property
    def frames(self) -> list[Table]:
        """Columns of quake_joint.csv at the joint, a table for each time."""
        table = read_table(self.files.folder / "quake_joint.csv")
        return split_by(rows_where(table, table["joint"] == self.number + 1), "time")

    @property
    def size(self) -> float:
        """Weight of the dam [N/m], the scale of all forces."""
        return weight(self.request.sections[0], self.request.joints[0])

    def static_row(self, after: bool = False) -> dict[str, float]:
        """The row of history.csv of the static loads, or that after the earthquake."""
        table = self.files.history_of(self.number)
        time = self.request.times[-1] if not after else len(self.request.levels) + 1
        k = int(np.argmin(np.abs(table["time"] - time)))
        return {name: float(column[k]) for name, column in table.items()}

    def by_hand(self, **values: float) -> Array:
        """T, N + U and M + M_U (3,) of all static loads, with other values of parameters."""
        levels, tails = self.request.levels[-1], self.request.tail_levels[-1]
        total = loads(self.section, self.values | values, self.request.times[-1], levels, tails)
        N, T, M = along_joint(self.section, total)
        return np.array([T, N, M])

    @property
    def unit_loads(self) -> Array:
        """T, N and M of a unit acceleration of the ground along x and y (2, 3)."""
        g = self.values["g"]
        return np.array([self.by_hand(k_h=-1 / g), self.by_hand(k_v=-1 / g)]) - self.by_hand()

    @property
    def residual_slip(self) -> float:
        """Mean slip over the last half of the rest, at most MEAN_OVER [m]."""
        rows = self.rows
        shaken = np.abs([rows["ground_ax"], rows["ground_ay"]]).max(axis=0) > 0
        rest = rows["time"][-1] - rows["time"][shaken].max(initial=0.0)
        over = min(MEAN_OVER, rest / 2) * (1 - DIGITS)
        last = rows["time"] > rows["time"][-1] - over
        return float(rows["slip_mean"][last].mean()) if rest else float(rows["slip_mean"][-1])

    def integral(self, acceleration: Array) -> tuple[Array, Array]:
        """Velocity and displacement (n, ...) of accelerations (n, ...) at the rows, from rest by
        Newmark's differences.
        """
        beta, gamma = self.newmark
        velocities, displacements = np.zeros((2, *acceleration.shape))
        u, v, a = np.zeros((3, *acceleration.shape[1:]))
        for k, (dt, now) in enumerate(zip(self.rows["dt"], acceleration, strict=True)):
            u = u + dt * v + dt**2 * ((0.5 - beta) * a + beta * now)
            v = v + dt * ((1 - gamma) * a + gamma * now)
            velocities[k], displacements[k], a = v, u, now
        return velocities, displacements

    def velocity(self, displacement: Array) -> Array:
        """Velocity (n, ...) of displacements (n, ...) at the rows, likewise."""
        beta, gamma = self.newmark
        velocities = np.zeros_like(displacement)
        u, v, a = np.zeros((3, *displacement.shape[1:]))
        for k, (dt, now) in enumerate(zip(self.rows["dt"], displacement, strict=True)):
            after = (now - u - dt * v) / (beta * dt**2) - (1 / (2 * beta) - 1) * a
            v = v + dt * ((1 - gamma) * a + gamma * after)
            velocities[k], u, a = v, now, after
        return velocities

    @property
    def newmark(self) -> tuple[float, float]:
        """Beta and gamma of the time integration."""
        alpha = self.values["hht_alpha"]
        return (1 - alpha) ** 2 / 4, 0.5 - alpha


def bookkeeping(whole: Shaken) -> Iterator[str]:
    """Check parameters, rows, frames, the ground's acceleration and the exit code."""
    files, rows = whole.files, whole.rows
    yield from differences(whole.request, files.record)
    reserve = "shear_reserve"  # inf with a law that does not limit the shear
    finite = (np.isfinite(v) | (reserve in name) & np.isposinf(v) for name, v in rows.items())
    if not all(values.all() for values in finite):
        yield "quake.csv: a value is not finite"
    for joint in whole.joints:
        if np.isinf(joint.rows[reserve]).all() != (joint.values["law"] == "rupture"):
            yield f"quake.csv: {reserve} of law = {joint.values['law']}"
    steps = np.diff(rows["time"], prepend=0.0)
    if (np.abs(steps - rows["dt"]) > DIGITS * rows["dt"].max()).any():
        yield "quake.csv: the times are not the sums of the steps"
    times = [frame["time"][0] for frame in whole.frames[1:]]
    if not np.isin(times, rows["time"]).all() or len(times) < 2:
        yield "quake_joint.csv: the frames are not at steps"
    ground = np.column_stack([rows["ground_ax"], rows["ground_ay"]])
    expected, end = ground_motion(whole, rows["time"])
    if np.abs(ground - expected).max() > DIGITS * np.abs(expected).max():
        yield "quake.csv: the ground's acceleration is not that of the record"
    over = rows["time"][-1] - end
    if not files.stopped and not -DIGITS < over < (1 + DIGITS) * rows["dt"].max():
        yield f"quake.csv: ends at {rows['time'][-1]:g} s, the record at {end:g} s"
    stands = not files.stopped and whole.found["after"]["equilibrium"] and whole.found["at_rest"]
    stands &= not any(
        joint.values["law"] == "rupture"
        and joint.rows["broken_length"][-1] > BROKEN * joint.section.length
        for joint in whole.joints
    )
    if files.exit_code != int(not stands):
        state = f"state {files.record['state']}, verdict {files.record['verdict']}"
        yield f"exit code {files.exit_code} with {state}"


def ground_motion(whole: Shaken, times: Array) -> tuple[Array, float]:
    """The ground's acceleration (n, 2) at times (n,), and the end of record and rest [s]; of a
    record that starts at t = 0 with no acceleration; before the rest it ends within an interval.
    """
    v, path = whole.values, whole.request.record
    assert path
    # without comments and heading
    lines = (line for line in path.read_text().splitlines() if line[:1].isdigit())
    table = np.array([line.split(",") for line in lines], float)
    end = float(table[-1, 0]) + v["record_rest"]
    if v["record_rest"] > 0:
        rest = np.zeros(table.shape[1])
        rest[0] = table[-1, 0] + np.diff(table[:, 0]).min()
        table = np.vstack([table, rest])
    scale = v["record_scale"] * (STANDARD_GRAVITY if v["record_unit"] == "g" else 1.0)
    axes = {"horizontal": {0}, "vertical": {1}, "both": {0, 1}}[v["record_component"]]
    result, record_times = np.zeros((len(times), 2)), table[:, 0] + travel_time(v, table[:, 0])
    for axis in axes & set(range(table.shape[1] - 1)):
        result[:, axis] = scale * np.interp(times, record_times, table[:, axis + 1], right=0.0)
    return result, end + travel_time(v, table[:, 0])


def travel_time(v: Values, times: Array) -> float:
    """The time [s] that a shear wave needs through rock with mass, in whole intervals of the
    record.
    """
    if not v["rock_mass"]:
        return 0.0
    speed = math.sqrt(v["E_found"] / (2 * (1 + v["nu_found"]) * v["rho_found"]))
    interval = float(np.diff(times).min())
    return math.ceil(v["found_depth"] / speed / interval) * interval


def motion(whole: Shaken) -> Iterator[str]:
    """Check that the crest's displacement is that of its acceleration, from rest."""
    rows = whole.rows
    _, displacement = whole.integral(rows["crest_ax"] - rows["ground_ax"])
    worst = np.abs(displacement - rows["crest_ux"]).max()
    if worst > MOTION_TOLERANCE * np.abs(rows["crest_ux"]).max():
        yield f"crest_ux is off by {worst:.3g} m from the integral of crest_ax"


def start(joint: Shaken) -> Iterator[str]:
    """Check that the first frame is the static state."""
    first = joint.frames[0]
    still = joint.files.tables_of(joint.number)
    static = next(rows for rows in still if rows["time"][0] == joint.request.times[-1])
    for name in ("delta_n", "delta_t1", "sigma_n", "tau_1", "p"):
        if np.abs(first[name] - static[name]).max() > DIGITS * np.abs(static[name]).max():
            yield f"quake_joint.csv: {name} does not start at the static state"


def mass_damping(joint: Shaken) -> float:
    """a0 [1/s] of Rayleigh's damping, 0 without the part of the mass."""
    v, frequencies = joint.values, joint.found["frequencies"]
    ends = (v["damping_f1"], frequencies[0]), (v["damping_f2"], frequencies[-1])
    w1, w2 = (2 * np.pi * (computed if given == -1 else given) for given, computed in ends)
    return float((v["damping_mass"] > 0) * 2 * v["damping"] * w1 * w2 / (w1 + w2))


def at_points(joint: Shaken, steps: Table) -> tuple[list[Table], Table]:
    """The rows of the integration points after each time step, and in the static state before."""
    rows = rows_where(steps, (steps["joint"] == joint.number + 1) & (steps["weight"] > 0))
    updates = split_by(rows, "update")
    moving = [u for u in updates if u["earthquake"][0]]
    first = next(n for n, u in enumerate(updates) if u["earthquake"][0])
    return moving, updates[first - 1]


def forces_of(joint: Shaken, steps: Table) -> tuple[Array, Array]:
    """T, N and M (n, 3) of the law by the written tractions of each time step, and those of the
    dashpots: c times the velocity of the jump where a point was closed at the start of the step.
    """
    moving, before = at_points(joint, steps)
    v, section = joint.values, joint.section
    along = math.cos(section.slope), math.sin(section.slope)
    s = (before["x"] - section.heel[0]) * along[0] + (before["y"] - section.heel[1]) * along[1]
    w, arm = before["weight"], section.length - s

    def column(name: str) -> Array:
        return np.array([u[name] for u in moving])

    def resultants(normal: Array, shear: Array) -> Array:
        return np.column_stack([shear @ w, -normal @ w, -normal @ (w * arm)])

    normal, shear = (column(n) - before[n] for n in ("delta_n", "delta_t1"))
    opening = np.vstack([before["delta_n"], column("delta_n")[:-1]])
    closed = opening <= 0
    dashpots = resultants(
        v["joint_damping_n"] * closed * joint.velocity(normal),
        v["joint_damping_t"] * closed * joint.velocity(shear),
    )
    return resultants(column("sigma_n_eff"), column("tau_1")), dashpots


def momentum(joint: Shaken, steps: Table) -> Iterator[str]:
    """Check T, N + U and, if the water does not change, M at every step: (1 + alpha) F1 - alpha F0
    = static load + inertia + damping by the mass, in which the ground's acceleration and the
    damping are weighted, too; F of the law, dashpots included. No part of the damping by the
    stiffness, and of absorbing boundaries, is in these sums.

    The velocity of the concrete without the water is not in the tables, and the published dashpots
    are at nodes: with them the equations of all unknowns are verified instead.
    """
    rows, v = joint.rows, joint.values
    by_law, dashpots = forces_of(joint, steps)
    written = np.column_stack([rows["T"], rows["N"], rows["M"]])
    scale = joint.size * np.array([1.0, 1.0, joint.section.length])
    if (np.abs(by_law - written) > MOMENTUM_TOLERANCE * scale).any():
        yield "quake.csv: T, N, M are not the integrals of the tractions"
    published = v["time_integration"] == "published"
    if (published and dashpots.any()) or (v["damping_mass"] == OF_CONCRETE and v["added_mass"]):
        return
    alpha = 0.0 if published else v["hht_alpha"]

    def weighted(values: Array, before: Array) -> Array:
        return (1 + alpha) * values - alpha * np.vstack([before, values[:-1]])

    ground = np.column_stack([rows["ground_ax"], rows["ground_ay"]]) @ joint.unit_loads
    inertia = np.column_stack([rows[f"{name}_inertia"] for name in "TNM"])
    static, none = joint.by_hand(), np.zeros(3)
    static[2] = joint.static_row()["M"]  # less the moment of the water
    forces = np.column_stack([rows["T"], rows["N"] + rows["U"], rows["M"]])
    velocity, _ = joint.integral(inertia - ground)
    expected = static + inertia + weighted(ground, none) - ground
    expected += mass_damping(joint) * weighted(velocity, none)
    error = np.abs(weighted(forces, static) + weighted(dashpots, none) - expected) / scale
    constant = np.ptp(rows["U"]) <= DIGITS * joint.size
    for k, name in enumerate(["T", "N", "M"] if constant else ["T", "N"]):
        if not error[:, k].max() <= MOMENTUM_TOLERANCE:
            time = rows["time"][error[:, k].argmax()]
            off = f"{error[:, k].max():.3g} of the weight at t = {time:g} s"
            yield f"momentum: {name} is off by {off}"


def after(joint: Shaken, steps: Table) -> Iterator[str]:
    """Check the static state after the earthquake: N + U and T by hand."""
    found = joint.found.get("after")
    if not found or not found["equilibrium"]:
        return
    row, hand = joint.static_row(after=True), joint.by_hand()
    for name, value, exact in (("T", row["T"], hand[0]), ("N + U", row["N"] + row["U"], hand[1])):
        if abs(value - exact) > 10 * MOMENTUM_TOLERANCE * joint.size:
            yield f"after the earthquake {name} = {value:.6g} N/m, by hand {exact:.6g}"


def standing(whole: Shaken, steps: Table) -> Iterator[str]:
    """Check that there is a static state after the earthquake if the rigid block on every joint
    certainly stands.
    """
    found = whole.found.get("after")
    if not found or found["equilibrium"]:
        return
    last = (
        Joint(joint.request, joint.number, joint.files, at_points(joint, steps)[0][-1])
        for joint in whole.joints
    )
    if all(map(equilibrium_is_certain, last)):
        yield "no equilibrium after the earthquake, but there certainly is one"


def frames(joint: Shaken, steps: Table) -> Iterator[str]:
    """Check that the frames are those of the nodes in steps.csv."""
    updates = updates_of(steps, joint.number, nodes=True)
    times = np.array([u["time"][0] * u["earthquake"][0] for u in updates])
    for frame in joint.frames[1:]:
        step = updates[int(np.argmin(np.abs(times - frame["time"][0])))]
        yield from rows_of_nodes(frame, step, "quake_joint.csv", joint.number)


def uplift(joint: Shaken) -> Iterator[str]:
    """Check in 2D that U of each frame is the integral of the pressure, linear between the nodes;
    where an open element has no water, it is between this and the static uplift.
    """
    v, length = joint.values, joint.section.length
    if v["dim"] == 3:
        return
    most = joint.static_row()["U"] if v["quake_uplift"] == "zero" else -np.inf
    for frame in joint.frames[1:]:
        order = np.argsort(frame["s"])
        s, p = frame["s"][order], frame["p"][order]
        total = float(np.diff(s) @ (p[1:] + p[:-1]) / 2)
        kinks = (p == 0).sum() > 1 or v["uplift"] == "drained"
        room = DIGITS * joint.size + kinks * KINKS * p.max() * length / v["n_joint"] ** 2
        time = frame["time"][0]
        found = float(joint.rows["U"][np.argmin(np.abs(joint.rows["time"] - time))])
        if not total - room <= found <= max(total, most) + room:
            yield f"U = {found:.6g} N/m at t = {time:g}, the integral of p {total:.6g}"


def summary(joint: Shaken) -> Iterator[str]:
    """Check peaks and residual slip of run.json against the rows."""
    found, rows = joint.found, joint.rows
    suffix = f"_{joint.number + 1}" if joint.number else ""
    slip, largest = joint.residual_slip, np.abs(rows["slip_mean"]).max()
    room = DIGITS * max(largest, 1e-9)
    late = rows["time"] > rows["time"][-1] / 2
    elastic = float(np.ptp(rows["T"][late])) / (joint.values["K_T"] * joint.section.length)
    if found["at_rest"]:
        if abs(found["residual"][f"slip{suffix}"] - slip) > room:
            yield "run.json: the residual slip is not the mean of the last rows"
        moved = abs(rows["slip_mean"][-1] - slip)
        least = LEAST_MOTION * joint.values["dam_height"]
        if moved > AT_REST * largest + least + elastic:
            yield f"run.json: at rest, but {moved:.3g} m off its residual slip at the end"
    if abs(abs(found["peaks"][f"slip_mean{suffix}"]["value"]) - largest) > room:
        yield "run.json: the peak of the slip is not that of the rows"


def violations(whole: Shaken, steps: Table) -> Iterator[str]:
    """All rules that the files of an earthquake violate but those of the laws, in words."""
    yield from bookkeeping(whole)
    yield from motion(whole)
    yield from standing(whole, steps)
    for joint in whole.joints:
        yield from frames(joint, steps)
        prefix = f"joint {joint.number + 1}: "
        for rule in (start, uplift, summary):
            yield from (prefix + words for words in rule(joint))
        for with_steps in (momentum, after):
            yield from (prefix + words for words in with_steps(joint, steps))


def judge(whole: Shaken) -> tuple[bool, str]:
    """Judge an earthquake that has not reached its end: whether that is wrong, and its reason.

    A step that does not converge is neither proved right nor wrong; a slip beyond small
    displacements is right if the rows have it.
    """
    reason = str(whole.files.record["statement"])
    if "beyond small displacements" not in reason:
        return False, reason
    slips = [np.abs(joint.rows["slip_mean"]).max(initial=0) for joint in whole.joints]
    return bool(max(slips) < LARGE_SLIP * whole.values["dam_height"]), ""
