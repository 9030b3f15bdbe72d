"""Verification of a run from its result files, independent of the engines.

The formulas are written again by hand: nothing of laws/, solver/ or engines/ is imported, so that
their errors are not repeated. Equilibrium is checked by the load resultants of the gravity
method, uplift by integration of the pressure along the joint, the inequalities of the joint law
node by node, and the reason of a stop by limit analysis of the rigid block.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from damjoint.model.case import Case, flows, has_drains
from damjoint.statics import gravity
from scipy.spatial import Delaunay

#: Tolerance of forces and moments, relative to the dam's weight (times its base): the largest
#: residual of a run (`coarsest` of pro/parameters.pro), summed over the joint.
BALANCE_TOLERANCE = 1e-5
#: Relative tolerance of written values: 12 digits, and stresses are differences of larger ones.
DIGITS_TOLERANCE = 1e-7
#: Tolerance of integrals of a pressure that may have kinks between the nodes, relative to the
#: square of an element's share of the joint.
KINK_TOLERANCE = 2.0
#: Least safety of a rigid block whose equilibrium counts as certain.
CERTAIN_SAFETY = 1.05
#: Share of its limit load from which on the rigid block counts as near that limit.
NEAR_LIMIT = 0.9
#: K_N h/E from which on a joint is too stiff for its mesh.
STIFF_JOINT = 100


def read_table(path: Path) -> dict[str, np.ndarray]:
    """Read the columns of a table of a run."""
    with path.open() as file:
        heads, *rows = csv.reader(file)
    values = np.array(rows, float).reshape(-1, len(heads))
    return dict(zip(heads, values.T, strict=True))


@dataclass(frozen=True)
class RunFiles:
    """Result files of a case in a folder, and the exit code of the command: the tables of one of
    its joints.
    """

    whole: Case
    folder: Path
    exit_code: int
    #: number of the joint, from 0
    number: int = 0

    @cached_property
    def case(self) -> Case:
        """The case of the joint: its parameters, and the section above it."""
        return self.whole.joints[self.number]

    @property
    def joints(self) -> list[RunFiles]:
        """The files for each joint."""
        return [replace(self, number=k) for k in range(len(self.whole.joints))]

    @property
    def name(self) -> str:
        """Name of the joint, empty if there is only one."""
        return self.whole.named((self.number,))

    @cached_property
    def record(self) -> dict:
        """The content of run.json."""
        return json.loads((self.folder / "run.json").read_text())

    @cached_property
    def history(self) -> dict[str, np.ndarray]:
        """Columns of history.csv, those of the joint without suffix."""
        return self.without_suffix(read_table(self.folder / "history.csv"))

    def without_suffix(self, table: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return a table with the columns of the joint without suffix."""
        suffix = f"_{self.number + 1}" if self.number else ""
        return table | {n: table[n + suffix] for n in table if suffix and n + suffix in table}

    @cached_property
    def joint(self) -> list[dict[str, np.ndarray]]:
        """Columns of joint.csv at the joint, a table for each time."""
        return self.tables("joint.csv")

    def tables(self, name: str) -> list[dict[str, np.ndarray]]:
        """Return the tables of a file at the joint, one for each time."""
        table = read_table(self.folder / name)
        rows = table["joint"] == self.number + 1
        table = {name: column[rows] for name, column in table.items()}
        times = dict.fromkeys(table["time"])
        return [{n: v[table["time"] == t] for n, v in table.items()} for t in times]

    @property
    def stopped(self) -> bool:
        """Whether the run ended before its last level."""
        return self.record["state"] != "complete"

    def row(self, time: float) -> dict[str, float]:
        """Return the row of the history at a time."""
        k = np.argmin(np.abs(self.history["time"] - time))
        return {name: float(column[k]) for name, column in self.history.items()}

    def rigid_body(self, time: float, level: float | None = None) -> gravity.GravityMethod:
        """Return loads and uplift of the gravity method at a time."""
        return gravity.at(self.case, time, level)

    @cached_property
    def weight(self) -> float:
        """Weight of the dam above the first joint [N/m], the scale of all forces."""
        first = self.whole.joints[0]
        return abs(gravity.at(first, first.times[-1], 0.0).loads[0].fy)

    @cached_property
    def length(self) -> float:
        """Length of the joint [m]."""
        return float(self.case.section["joint_length"][0])


def violations(run: RunFiles) -> list[str]:
    """Return the rules that the files of a run violate, in words."""
    rules = (equilibrium, uplift, heads, contact, strength, irreversibility)
    found = list(bookkeeping(run))
    for joint in run.joints:
        prefix = f"{joint.name}: " if joint.name else ""
        found += [prefix + violation for rule in rules for violation in rule(joint)]
    return found


def bookkeeping(run: RunFiles) -> Iterator[str]:
    """Check parameters, order of rows, completeness of tables and the exit code."""
    record, case, history = run.record, run.whole, run.history
    if record["parameters"] != case.values:
        yield "run.json: parameters differ from those of the case"
    if not all(np.isfinite(v).all() for name, v in history.items() if "x_resultant" not in name):
        yield "history.csv: a value is not finite"
    if (np.diff(history["time"]) <= 0).any():
        yield "history.csv: times do not increase"
    saved = [[rows["time"][0] for rows in joint.joint] for joint in run.joints]
    if not run.stopped and any(times != list(case.requested) for times in saved):
        yield "joint.csv: a requested level is missing"
    mode, failing = failure(run)
    hardens = all(j.case["law"] == "friction" and j.case.hardening_asked for j in failing)
    failed = run.stopped or (mode == "sliding" and not hardens)
    if run.exit_code != int(failed):
        yield f"exit code {run.exit_code} with state {record['state']}, verdict {record['verdict']}"
    room = DIGITS_TOLERANCE * case["dam_height"]
    if case["drive"] == "level":
        prescribed = np.array([case.level_at(t) for t in history["time"]])
        if np.abs(history["level"] - prescribed).max(initial=0) > room:
            yield "history.csv: not at the prescribed level"
    prescribed = np.array([case.tail_at(t) for t in history["time"]])
    if np.abs(history["tail_level"] - prescribed).max(initial=0) > room:
        yield "history.csv: not at the prescribed tailwater"
    if (history["level"] < -room).any():
        yield f"level {history['level'].min():.4g} m is below 0"


def failure(run: RunFiles) -> tuple[str, list[RunFiles]]:
    """Return the mode of the verdict, and the files for the joints that it names, or for all."""
    mode, _, names = run.record["verdict"].partition(" on ")
    return mode, [joint for joint in run.joints if not names or joint.name in names.split(" and ")]


def equilibrium(run: RunFiles) -> Iterator[str]:
    """Check N + U and T in every row, M about the toe in the rows that have a joint table."""
    history = run.history
    for k, (time, level) in enumerate(zip(history["time"], history["level"], strict=True)):
        hand = run.rigid_body(time, level)
        for name, value, exact in (
            ("N + U", history["N"][k] + history["U"][k], hand.N + hand.U),
            ("T", history["T"][k], hand.T),
        ):
            if abs(value - exact) > BALANCE_TOLERANCE * run.weight:
                yield f"{name} = {value:.6g} N/m at t = {time:g}, by hand {exact:.6g}"
    for rows in run.joint:
        time = rows["time"][0]
        row = run.row(time)
        moment_of_uplift = water_resultants(run, rows)[1]
        exact = run.rigid_body(time, row["level"]).resultant.moment - moment_of_uplift
        room = (BALANCE_TOLERANCE + pressure_tolerance(run, rows)) * run.weight * run.length
        if abs(row["M"] - exact) > room:
            yield f"M = {row['M']:.6g} N m/m at t = {time:g}, by hand {exact:.6g}"


def pressure_tolerance(run: RunFiles, rows: dict[str, np.ndarray]) -> float:
    """Return the error of an integral of nodal pressures, relative to the dam's weight."""
    ends_inside = np.count_nonzero(rows["p"] == 0) > 1  # the water, between two nodes
    if run.case["uplift"] != "drained" and run.case["dim"] == 2 and not ends_inside:
        return 0.0
    return KINK_TOLERANCE * rows["p"].max() * run.length / run.case["n_joint"] ** 2 / run.weight


def water_resultants(run: RunFiles, rows: dict[str, np.ndarray]) -> tuple[float, float]:
    """Return force [N/m] and moment about the toe [N m/m], upwards > 0, of the pressure in a joint
    table: linear between its nodes, in 3D on a triangulation of them.
    """
    s, p = rows["s"], rows["p"]
    if run.case["dim"] == 2:
        order = np.argsort(s)
        corners, sizes = np.column_stack([order[:-1], order[1:]]), np.diff(s[order])
    else:
        points = np.column_stack([s, rows["z"]])
        corners = Delaunay(points).simplices
        a, b, c = points[corners].transpose(1, 0, 2)
        sizes = np.abs(np.linalg.det(np.stack([b - a, c - a], axis=1))) / 2
        sizes = sizes / np.ptp(rows["z"])
    p, arm = p[corners], run.length - s[corners]
    # mean of the product of linear functions: (sum p_i arm_i + sum p_i sum arm_i) / (n (n + 1))
    n = corners.shape[1]
    products = (p * arm).sum(axis=1) + p.sum(axis=1) * arm.sum(axis=1)
    return float(sizes @ p.mean(axis=1)), float(sizes @ products / (n * (n + 1)))


def uplift(run: RunFiles) -> Iterator[str]:
    """Check that U is the integral of p and, where there is a closed form, equal to it."""
    for rows in run.joint:
        time = rows["time"][0]
        row = run.row(time)
        exact = {"the integral of p": water_resultants(run, rows)[0]}
        if run.case["uplift"] in ("none", "imposed", "drained"):
            exact["by hand"] = run.rigid_body(time, row["level"]).U
        for how, value in exact.items():
            room = (DIGITS_TOLERANCE + pressure_tolerance(run, rows)) * run.weight
            if abs(value - row["U"]) > room:
                yield f"U = {row['U']:.6g} N/m at t = {time:g}, {how} {value:.6g}"


def heads(run: RunFiles) -> Iterator[str]:
    """Check that the head lies between those of reservoir and tailwater (at a dry end its own
    height), and that water which flows is conserved.
    """
    case = run.case
    unit_weight = case["rho_water"] * case["g"]
    if case["uplift"] == "none":
        if any(rows["p"].any() for rows in run.joint):
            yield "joint.csv: pressure in a dry joint"
        return
    for rows in run.joint:
        time = rows["time"][0]
        row = run.row(time)
        heel, toe = (case.section[name][0] for name in ("heel_y", "toe_y"))
        ends = max(row["level"] + case["joint_head_offset"], heel), max(row["tail_level"], toe)
        highest, lowest = max(ends), min(ends)
        if has_drains(case):  # their outlet may be as low as the tailwater or the joint
            lowest = min(lowest, max(row["tail_level"], min(heel, toe)))
        head = rows["y"] + rows["p"] / unit_weight
        room = DIGITS_TOLERANCE * case["dam_height"]
        wet = rows["p"] > 0  # elsewhere the pressure is that of the air
        if (head[wet] > highest + room).any():
            yield f"pressure above the reservoir's head at t = {time:g}"
        if (head[wet] < lowest - room).any():
            yield f"pressure below the tailwater's head at t = {time:g}"
        if "flux" in row and case["uplift"] == "flow" and case["dim"] == 2:
            yield from flux(run, rows, row["flux"])


def flux(run: RunFiles, rows: dict[str, np.ndarray], leakage: float) -> Iterator[str]:
    """Check that the flux of a plane joint is uniform on both sides of the drains, equal to the
    leakage [kg/(m s)] downstream of them, and that drains take no negative flux; drains act on the
    node nearest to them.
    """
    case, s, flux, time = run.case, rows["s"], rows["flux"], rows["time"][0]
    element = run.length / case["n_joint"]
    # scale: flux of the closed joint under the whole head; without a head there is only rounding
    closed = case["rho_water"] * case["aperture_min"] ** 3 / (12 * case["visc"])
    slope = case["rho_water"] * case["g"] * max(case.levels) / run.length
    room = DIGITS_TOLERANCE * max(np.abs(flux).max(), closed * slope)
    upstream, downstream = np.zeros(len(s), bool), np.ones(len(s), bool)
    if has_drains(case):
        upstream, downstream = s < case["drain_x"] - element, s > case["drain_x"] + element
    inflow = flux[upstream].mean() if upstream.any() else leakage
    for part, exact in ((upstream, inflow), (downstream, leakage)):
        difference = np.abs(flux[part] - exact).max(initial=0)
        if difference > room:
            yield f"flux varies along the joint by {difference:.3g} kg/(m s) at t = {time:g}"
    if inflow < leakage - room:
        yield f"drains give {leakage - inflow:.3g} kg/(m s) at t = {time:g}"


def contact(run: RunFiles) -> Iterator[str]:
    """Check that the contact stress is K_N times the overlap, and zero at open points."""
    case = run.case
    stiffness = case["K_N"] * (case["pena_contact"] if case["law"] == "rupture" else 1.0)
    for rows in run.joint:
        stress, opening = rows["sigma_n_eff"], rows["delta_n"]
        exact = stiffness * np.minimum(opening, 0)
        error = np.where(opening < 0, np.abs(stress - exact), np.maximum(-stress, 0))
        if (error > stress_tolerance(rows)).any():
            yield f"contact: off by {error.max():.3g} Pa at t = {rows['time'][0]:g}"


def stress_tolerance(rows: dict[str, np.ndarray]) -> float:
    """Return the tolerance of effective normal stresses [Pa]."""
    return DIGITS_TOLERANCE * (np.abs(rows["sigma_n"]) + rows["p"]).max()


def strength(run: RunFiles) -> Iterator[str]:
    """Check that tension and shear are within the strengths of the law."""
    for rows in run.joint:
        tension, shear = strengths(run, rows)
        size = np.hypot(rows["tau_1"], rows["tau_2"])
        room = stress_tolerance(rows)
        room_shear = room + DIGITS_TOLERANCE * size.max()
        for name, excess, allowed in (
            ("tension", rows["sigma_n_eff"] - tension, room),
            ("shear", size - shear, room_shear),
        ):
            if (excess > allowed).any():
                worst = f"{excess.max():.3g} Pa at t = {rows['time'][0]:g}"
                yield f"{name}: beyond the law by {worst}"


def strengths(run: RunFiles, rows: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return tensile and shear strength [Pa] at the nodes, from the parameters of the law and the
    internal variables in the table.
    """
    case, normal = run.case, rows["sigma_n_eff"]
    undamaged = 1 - rows["damage"]
    if case["law"] == "rupture":
        slid = np.hypot(rows["delta_t1"], rows["delta_t2"]) + rows["slip"]
        return case["sigma_max"] * undamaged, case["K_T"] * slid
    friction = -case["mu"] * np.minimum(normal, 0)
    if case["law"] == "bond":
        return case["sigma_max"] * undamaged, case["adhesion"] * undamaged + friction
    apex = np.full_like(normal, case["adhesion"] / case["mu"])
    return apex, case["adhesion"] - case["mu"] * normal + case["pena_tang"] * rows["lambda"]


def irreversibility(run: RunFiles) -> Iterator[str]:
    """Check that damage, cumulated slip, crack and slipped length do not decrease."""
    case, history = run.case, run.history
    lengths = ["slip_length", *(["crack_length"] if case["law"] == "rupture" else [])]
    for name in set(lengths) & set(history):
        if (np.diff(history[name]) < -DIGITS_TOLERANCE * run.length).any():
            yield f"{name} falls"
    name = "lambda" if case["law"] == "friction" else "damage"
    for rows in run.joint:
        if (rows[name] < 0).any() or (rows["damage"] > 1).any():
            yield f"{name} is out of its range at t = {rows['time'][0]:g}"
        if case["law"] == "friction" and (rows["slip"] > rows[name] * (1 + DIGITS_TOLERANCE)).any():
            yield f"slip is more than lambda at t = {rows['time'][0]:g}"
    for before, after in zip(run.joint, run.joint[1:], strict=False):
        if (after[name] < before[name] - DIGITS_TOLERANCE * before[name].max()).any():
            yield f"{name} falls before t = {after['time'][0]:g}"


# -- reason of a stop
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Block:
    """Rigid block on the joint: effective normal force N and shear T [N/m], moment M about the toe
    [N m/m].
    """

    N: float
    T: float
    M: float


def rigid_blocks(run: RunFiles) -> tuple[Block, Block]:
    """Return the rigid block at the smallest step beyond the last converged state, under the least
    and the most uplift.

    They differ if the water in the joint is computed: least, the uplift of the last state; most,
    the highest head at the lowest point of the joint, along the whole joint.
    """
    case = run.case
    last = run.history["time"].max(initial=0)
    hand = run.rigid_body(min(last + case["smallest_step"], case.times[-1]))
    moment = hand.resultant.moment
    if flows(case):
        least = water_resultants(run, run.joint[-1]) if run.joint else (0.0, 0.0)
        head = max(hand.level + case["joint_head_offset"], hand.tail_level)
        lowest = min(case.section[name][0] for name in ("heel_y", "toe_y"))
        pressure = max(case["rho_water"] * case["g"] * (head - lowest), 0.0)
        most = pressure * run.length, pressure * run.length**2 / 2
    else:
        least = most = hand.U, hand.uplift.moment
    return tuple(Block(hand.N + hand.U - u, hand.T, moment - m) for u, m in (least, most))


def equilibrium_exists(run: RunFiles) -> bool:
    """Return whether there certainly is an equilibrium beyond the last state, by the static
    theorem: without any strength but friction and under the most uplift, the resultant is well
    within the base and the shear below friction.
    """
    case, (_, block) = run.case, rigid_blocks(run)
    margin = max(0.05, 3 / case["n_joint"]) * run.length
    inside = block.N > 0 and margin * block.N < block.M < block.N * (run.length - margin)
    rough = case["law"] == "rupture" or CERTAIN_SAFETY * abs(block.T) < case["mu"] * block.N
    return inside and rough


def limits_near(run: RunFiles, block: Block) -> dict[str, bool]:
    """Return for each reason of a stop whether the rigid block is near that limit.

    Overturning: about the toe or the heel, against the largest tension (of the undamaged part of a
    bond; none if it is about to break at an end). Sliding: against friction, and the cohesion of
    law = friction with the hardening of its slip. Not converged: one of these, or a bond that is
    about to break at an end of the joint, which may be followed by unstable crack growth.
    """
    case, length = run.case, run.length
    cohesion, tension = 0.0, case["sigma_max"]
    if case["law"] == "friction":
        slip = run.joint[-1]["lambda"].max() if run.joint else 0.0
        cohesion = case["adhesion"] + case["pena_tang"] * slip
        tension = case["adhesion"] / case["mu"]
    shear_resistance = case["mu"] * block.N + cohesion * length
    arms = block.M, block.N * length - block.M
    # stress linear along the joint, at both ends
    ends = [(2 * block.N * length - 6 * arm) / length**2 for arm in arms]
    breaks = case["law"] != "friction" and max(ends) > NEAR_LIMIT * tension
    undamaged = length
    if case["law"] != "friction":
        undamaged -= run.history["crack_length"][-1:].sum()
    moment_resistance = min(arms) + (0.0 if breaks else tension * undamaged**2 / 2)
    near = {
        "overturning": moment_resistance < (1 - NEAR_LIMIT) * abs(block.N) * length,
        "sliding": case["law"] != "rupture" and abs(block.T) > NEAR_LIMIT * shear_resistance,
    }
    return near | {"not converged": breaks or any(near.values())}


def stiffness_ratio(case: Case) -> float:
    """Return K_N h/E: stiffness of the joint over that of the bulk within an element length h."""
    softest = min(case["E_dam"], case["E_found"])
    return case["K_N"] * case.section["joint_length"][0] / case["n_joint"] / softest


def judge_stop(run: RunFiles) -> tuple[bool, str]:
    """Judge a run that has stopped.

    Returns whether it is wrong that it stopped, or the reason it gives, and a remark. A remark
    without an error is a stop that is neither proved right nor wrong: not converged and the joint
    too stiff for its mesh; displacement control, whose level is not known beforehand; a rigid block
    neither certain to stand nor near a limit. A crack under the full head may grow through
    the joint far below any limit, so the block is judged under the most uplift, too.
    """
    verdict = run.record["verdict"]
    if run.record["state"] != "stopped":
        return True, run.record["statement"]
    mode, failing = failure(run)
    undecided = mode in ("not converged", "no equilibrium")
    by_level = run.whole["drive"] == "level"
    if by_level and all(equilibrium_exists(joint) for joint in failing):
        return True, f"{verdict}, but there certainly is an equilibrium"
    stiffest = max(stiffness_ratio(joint.case) for joint in failing)
    if undecided and stiffest >= STIFF_JOINT:
        return False, f"{verdict}, K_N h/E = {stiffest:.3g}"
    if not by_level:
        return False, f"{verdict}, displacement control" if undecided else ""
    reason = "not converged" if undecided else mode
    blocks = [(joint, block) for joint in failing for block in rigid_blocks(joint)]
    if any(limits_near(joint, block)[reason] for joint, block in blocks):
        return False, ""
    return not undecided, f"{verdict}, but the rigid block is not near that limit"
