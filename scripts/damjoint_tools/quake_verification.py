"""Verification of an earthquake from its result files, independent of the engine.

As verification.py, of which the rules for the joints are applied to the frames. Momentum is
balanced at every time step: the forces of the joint that its law gives against loads by hand and
the inertia of the bodies, in the weighted form of the time integration.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np
from damjoint.model.case import Case
from damjoint.statics import gravity

from .verification import (
    DIGITS_TOLERANCE,
    RunFiles,
    contact,
    equilibrium_exists,
    heads,
    irreversibility,
    pressure_tolerance,
    read_table,
    strength,
    uplift,
    water_resultants,
)

#: Tolerance of the balance of momentum, relative to the dam's weight (times its base): the largest
#: residual of a step, summed over the joint.
MOMENTUM_TOLERANCE = 1e-6
#: Tolerance of motions relative to their largest value: twelve digits, summed over the steps.
MOTION_TOLERANCE = 1e-6
#: A dam at rest stays within this share of its largest slip, or this slip [m]; a joint without
#: friction is broken beyond this share of its length.
AT_REST, LEAST_MOTION, BROKEN = 0.01, 1e-5, 0.99
#: Value of damping_mass: of the concrete, not of the water that moves with it.
OF_CONCRETE = 1
#: Standard gravity [m/s2], of records in g.
STANDARD_GRAVITY = 9.80665
#: Share of the dam's height from which a slip is not a small displacement, about.
LARGE_SLIP = 0.05
#: Largest time over which residual values are a mean [s].
MEAN_OVER = 1.0


class QuakeFiles(RunFiles):
    """Result files of an earthquake: `history` are the rows of quake.csv, `joint` the frames."""

    @cached_property
    def history(self) -> dict[str, np.ndarray]:
        """Columns of quake.csv with those of the static loads, which do not change."""
        table = self.without_suffix(read_table(self.folder / "quake.csv"))
        level, tail = (np.full(len(table["time"]), v) for v in self.water)
        return table | {"crack_length": table["open_length"], "level": level, "tail_level": tail}

    @cached_property
    def joint(self) -> list[dict[str, np.ndarray]]:
        """Columns of quake_joint.csv at the joint, a table for each frame but the static state."""
        return self.tables("quake_joint.csv")[1:]

    @property
    def residual_slip(self) -> float:
        """Mean slip over the last half of the rest, at most MEAN_OVER [m]."""
        rows = self.history
        shaken = np.abs([rows["ground_ax"], rows["ground_ay"]]).max(axis=0) > 0
        rest = rows["time"][-1] - rows["time"][shaken].max(initial=0.0)
        over = min(MEAN_OVER, rest / 2) * (1 - DIGITS_TOLERANCE)
        last = rows["time"] > rows["time"][-1] - over
        return float(rows["slip_mean"][last].mean()) if rest else float(rows["slip_mean"][-1])

    @property
    def water(self) -> tuple[float, float]:
        """Reservoir and tailwater during the earthquake."""
        return self.case.levels[-1], self.case.tail_levels[-1]

    def static_row(self, after: bool = False) -> dict[str, float]:
        """Return the row of history.csv of the static loads, or that after the earthquake."""
        table = self.without_suffix(read_table(self.folder / "history.csv"))
        time = self.case.times[-1] if not after else len(self.case.levels) + 1
        k = np.argmin(np.abs(table["time"] - time))
        return {name: float(column[k]) for name, column in table.items()}

    def rigid_body(self, time: float, level: float | None = None) -> gravity.GravityMethod:
        """Return the static loads of the gravity method."""
        return gravity.at(self.case, self.case.times[-1], self.water[0])

    def by_hand(self, **values: float) -> np.ndarray:
        """Return the parts of T, N + U and M + uplift (3,) of all loads with other values."""
        case = self.case.with_values(values)
        block = gravity.RigidBlock(case)
        loads = gravity.loads_on(case, block, case.times[-1], *self.water)
        total, (tx, ty) = gravity.resultant_of("sum", list(loads)), block.along
        shear, normal = tx * total.fx + ty * total.fy, ty * total.fx - tx * total.fy
        return np.array([shear, normal, total.moment])


def quake_violations(run: QuakeFiles) -> list[str]:
    """Return the rules that the files of an earthquake violate, in words."""
    found = list(bookkeeping(run)) + list(motion(run))
    water = uplift_in_closed_parts if run.whole["quake_uplift"] == "zero" else uplift
    rules = (start, momentum, after, summary, water, heads, contact, strength, irreversibility)
    for joint in run.joints:
        prefix = f"{joint.name}: " if joint.name else ""
        found += [prefix + violation for rule in rules for violation in rule(joint)]
    return found


def bookkeeping(run: QuakeFiles) -> Iterator[str]:
    """Check parameters, rows, frames, the ground's acceleration and the exit code."""
    record, case, rows = run.record, run.whole, run.history
    if record["parameters"] != case.values:
        yield "run.json: parameters differ from those of the case"
    reserve = "shear_reserve"  # inf with a law that does not limit the shear
    if not all(np.isfinite(rows[name]).all() for name in rows if reserve not in name):
        yield "quake.csv: a value is not finite"
    for joint in run.joints:
        if np.isinf(joint.history[reserve]).all() != (joint.case["law"] == "rupture"):
            yield f"quake.csv: {reserve} of law = {joint.case['law']}"
    steps = np.diff(rows["time"], prepend=0.0)
    if (np.abs(steps - rows["dt"]) > DIGITS_TOLERANCE * rows["dt"].max()).any():
        yield "quake.csv: the times are not the sums of the steps"
    times = [rows["time"][0] for rows in run.joint]
    if not np.isin(times, rows["time"]).all() or len(times) < 2:
        yield "quake_joint.csv: the frames are not at steps"
    ground = np.column_stack([rows["ground_ax"], rows["ground_ay"]])
    expected, end = ground_motion(run, rows["time"])
    if np.abs(ground - expected).max() > DIGITS_TOLERANCE * np.abs(expected).max():
        yield "quake.csv: the ground's acceleration is not that of the record"
    over = rows["time"][-1] - end
    if not run.stopped and not -DIGITS_TOLERANCE < over < (1 + DIGITS_TOLERANCE) * rows["dt"].max():
        yield f"quake.csv: ends at {rows['time'][-1]:g} s, the record at {end:g} s"
    found = record["quake"]
    stands = not run.stopped and found["after"]["equilibrium"] and found["at_rest"]
    stands &= not any(
        joint.case["law"] == "rupture"
        and joint.history["broken_length"][-1] > BROKEN * joint.length
        for joint in run.joints
    )
    if run.exit_code != int(not stands):
        yield f"exit code {run.exit_code} with state {record['state']}, verdict {record['verdict']}"


def ground_motion(run: QuakeFiles, times: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the ground's acceleration (n, 2) at times (n,), and the end of record and rest [s]; of
    a record that starts at t = 0 with no acceleration.
    """
    case = run.whole
    lines = case.record.read_text().splitlines()  # without comments and heading
    table = np.array([line.split(",") for line in lines if line[:1].isdigit()], float)
    scale = case["record_scale"] * (STANDARD_GRAVITY if case["record_unit"] == "g" else 1.0)
    axes = {"horizontal": {0}, "vertical": {1}, "both": {0, 1}}[case["record_component"]]
    result, record_times = np.zeros((len(times), 2)), table[:, 0] + travel_time(case, table[:, 0])
    for axis in axes & set(range(table.shape[1] - 1)):
        result[:, axis] = scale * np.interp(times, record_times, table[:, axis + 1], right=0.0)
    return result, float(record_times[-1] + case["record_rest"])


def travel_time(case: Case, times: np.ndarray) -> float:
    """Return the time [s] that a shear wave needs through rock with mass, in whole intervals of the
    record.
    """
    if not case["rock_mass"]:
        return 0.0
    speed = np.sqrt(case["E_found"] / (2 * (1 + case["nu_found"]) * case["rho_found"]))
    interval = np.diff(times).min()
    return float(np.ceil(case["found_depth"] / speed / interval) * interval)


def integral(run: QuakeFiles, acceleration: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return velocity and displacement (n, ...) of accelerations (n, ...) at the rows, from rest by
    Newmark's differences.
    """
    alpha = run.case["hht_alpha"]
    beta, gamma = (1 - alpha) ** 2 / 4, 0.5 - alpha
    velocities, displacements = np.zeros((2, *acceleration.shape))
    u, v, a = np.zeros((3, *acceleration.shape[1:]))
    for k, (dt, now) in enumerate(zip(run.history["dt"], acceleration, strict=True)):
        u = u + dt * v + dt**2 * ((0.5 - beta) * a + beta * now)
        v = v + dt * ((1 - gamma) * a + gamma * now)
        velocities[k], displacements[k], a = v, u, now
    return velocities, displacements


def motion(run: QuakeFiles) -> Iterator[str]:
    """Check that the crest's displacement is that of its acceleration, from rest."""
    rows = run.history
    _, displacement = integral(run, rows["crest_ax"] - rows["ground_ax"])
    worst = np.abs(displacement - rows["crest_ux"]).max()
    if worst > MOTION_TOLERANCE * np.abs(rows["crest_ux"]).max():
        yield f"crest_ux is off by {worst:.3g} m from the integral of crest_ax"


def start(run: QuakeFiles) -> Iterator[str]:
    """Check that the first frame is the static state."""
    first, still = run.tables("quake_joint.csv")[0], run.tables("joint.csv")
    static = next(rows for rows in still if rows["time"][0] == run.case.times[-1])
    for name in ("delta_n", "delta_t1", "sigma_n", "tau_1", "p"):
        if np.abs(first[name] - static[name]).max() > DIGITS_TOLERANCE * np.abs(static[name]).max():
            yield f"quake_joint.csv: {name} does not start at the static state"


def unit_loads(run: QuakeFiles) -> np.ndarray:
    """Return the parts of T, N and M of a unit acceleration of the ground along x and y (2, 3)."""
    g, static = run.case["g"], run.by_hand()
    return np.array([run.by_hand(k_h=-1 / g), run.by_hand(k_v=-1 / g)]) - static


def mass_damping(run: QuakeFiles) -> float:
    """Return a0 [1/s] of Rayleigh's damping, 0 without the part of the mass."""
    case, frequencies = run.case, run.record["quake"]["frequencies"]
    ends = (case["damping_f1"], frequencies[0]), (case["damping_f2"], frequencies[-1])
    w1, w2 = (2 * np.pi * (own if given == -1 else given) for given, own in ends)
    return float((case["damping_mass"] > 0) * 2 * case["damping"] * w1 * w2 / (w1 + w2))


def momentum(run: QuakeFiles) -> Iterator[str]:
    """Check T, N + U and, if the water does not change, M at every step: (1 + alpha) F1 - alpha F0
    = static load + inertia + damping by the mass, in which the ground's acceleration and the
    damping are weighted, too. No part of the damping by the stiffness is left in these sums.

    Dashpots, and the velocity of the concrete without the water, are not in the tables: with them
    the equations of all unknowns are verified instead.
    """
    rows, case = run.history, run.case
    if case["joint_damping_n"] or case["joint_damping_t"]:
        return
    if case["damping_mass"] == OF_CONCRETE and case["added_mass"]:
        return
    alpha = case["hht_alpha"] if case["time_integration"] == "HHT" else 0.0
    weighted = lambda values, before: (
        (1 + alpha) * values - alpha * np.vstack([before, values[:-1]])
    )
    ground = np.column_stack([rows["ground_ax"], rows["ground_ay"]]) @ unit_loads(run)
    inertia = np.column_stack([rows[f"{name}_inertia"] for name in "TNM"])
    static, none = run.by_hand(), np.zeros(3)
    static[2] = run.static_row()["M"]  # less the moment of the water
    forces = np.column_stack([rows["T"], rows["N"] + rows["U"], rows["M"]])
    velocity, _ = integral(run, inertia - ground)
    expected = static + inertia + weighted(ground, none) - ground
    expected += mass_damping(run) * weighted(velocity, none)
    error = np.abs(weighted(forces, static) - expected)
    constant = np.ptp(rows["U"]) <= DIGITS_TOLERANCE * run.weight
    for k, name in enumerate(["T", "N", "M"] if constant else ["T", "N"]):
        share = error[:, k] / (run.weight * (run.length if name == "M" else 1.0))
        if share.max() > MOMENTUM_TOLERANCE:
            time = rows["time"][share.argmax()]
            yield f"momentum: {name} is off by {share.max():.3g} of the weight at t = {time:g} s"


def uplift_in_closed_parts(run: QuakeFiles) -> Iterator[str]:
    """Check U between the integral of p, which is written as 0 at the ends of an element without
    water, too, and the static uplift.
    """
    room, most = DIGITS_TOLERANCE * run.weight, run.static_row()["U"]
    for rows in run.joint:
        least, found = water_resultants(run, rows)[0], run.row(rows["time"][0])["U"]
        kinks = pressure_tolerance(run, rows) * run.weight
        if not least - room - kinks <= found <= most + room:
            time = rows["time"][0]
            yield f"U = {found:.6g} N/m at t = {time:g}, not from {least:.6g} to {most:.6g}"


def after(run: QuakeFiles) -> Iterator[str]:
    """Check the static state after the earthquake: N + U and T by hand; that there is one if the
    rigid block certainly stands.
    """
    found = run.record["quake"].get("after")
    if found is None:
        return
    if not found["equilibrium"]:
        if all(equilibrium_exists(joint) for joint in run.joints):
            yield "no equilibrium after the earthquake, but there certainly is one"
        return
    row, hand = run.static_row(after=True), run.by_hand()
    for name, value, exact in (("T", row["T"], hand[0]), ("N + U", row["N"] + row["U"], hand[1])):
        if abs(value - exact) > 10 * MOMENTUM_TOLERANCE * run.weight:
            yield f"after the earthquake {name} = {value:.6g} N/m, by hand {exact:.6g}"


def elastic_slip(run: QuakeFiles) -> float:
    """Return the largest elastic part of the slip in the last half of the record and rest [m]."""
    rows = run.history
    late = rows["time"] > rows["time"][-1] / 2
    return float(np.ptp(rows["T"][late])) / (run.case["K_T"] * run.length)


def judge_quake(run: QuakeFiles) -> tuple[bool, str]:
    """Judge an earthquake that has not reached its end.

    Returns whether that is wrong, and its reason. A step that does not converge is neither proved
    right nor wrong; a slip beyond small displacements is right if the rows have it.
    """
    reason = run.record["statement"]
    if "beyond small displacements" not in reason:
        return False, reason
    slips = [np.abs(joint.history["slip_mean"]).max(initial=0) for joint in run.joints]
    return max(slips) < LARGE_SLIP * run.whole["dam_height"], ""


def summary(run: QuakeFiles) -> Iterator[str]:
    """Check peaks and residual slip of run.json against the rows."""
    found, rows = run.record["quake"], run.history
    suffix = f"_{run.number + 1}" if run.number else ""
    slip, largest = run.residual_slip, np.abs(rows["slip_mean"]).max()
    room = DIGITS_TOLERANCE * max(largest, 1e-9)
    if found["at_rest"]:
        if abs(found["residual"][f"slip{suffix}"] - slip) > room:
            yield "run.json: the residual slip is not the mean of the last rows"
        moved = abs(rows["slip_mean"][-1] - slip)
        if moved > AT_REST * largest + LEAST_MOTION + elastic_slip(run):
            yield f"run.json: at rest, but {moved:.3g} m off its residual slip at the end"
    if abs(abs(found["peaks"][f"slip_mean{suffix}"]["value"]) - largest) > room:
        yield "run.json: the peak of the slip is not that of the rows"
