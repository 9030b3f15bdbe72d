"""A run verified from the files that it has written, by rules that no engine has a part in.

Equilibrium by the closed forms of the gravity method, the water's pressure integrated along the
joint, the joint law's inequalities node by node, and what a stopped run says of itself beside the
limit analysis of the rigid block.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from damjoint.model.case import Case, flows, has_drains
from damjoint.statics import gravity
from scipy.spatial import Delaunay

#: Forces and moments agree to this part of the dam's weight (times its base): what a run may leave
#: out of balance (`coarsest` of pro/parameters.pro), summed over the joint.
BALANCE = 1e-5
#: Twelve digits are written, and stresses are differences of larger ones.
DIGITS = 1e-7
#: Pressure known at nodes only, between which it may have a kink: times the element's share.
KINK = 2.0
#: By how much a rigid block must be on the safe side for its equilibrium to count as certain.
SAFE = 1.05
#: How close to its limit a joint must be for a reason that a stopped run gives to count as true.
NEAR = 0.9
#: K_N h/E of a joint that a run calls too stiff for its mesh.
STIFF = 100


def read_table(path: Path) -> dict[str, np.ndarray]:
    """A table of a run's folder by its columns."""
    with path.open() as file:
        heads, *rows = csv.reader(file)
    values = np.array(rows, float).reshape(-1, len(heads))
    return dict(zip(heads, values.T, strict=True))


@dataclass(frozen=True)
class Written:
    """What a run of a case has written, and how the command ended."""

    case: Case
    folder: Path
    exit_code: int

    @cached_property
    def told(self) -> dict:
        """run.json."""
        return json.loads((self.folder / "run.json").read_text())

    @cached_property
    def history(self) -> dict[str, np.ndarray]:
        """history.csv."""
        return read_table(self.folder / "history.csv")

    @cached_property
    def joint(self) -> list[dict[str, np.ndarray]]:
        """joint.csv, a table for each of its times."""
        table = read_table(self.folder / "joint.csv")
        return [{n: v[table["time"] == t] for n, v in table.items()} for t in times_of(table)]

    @property
    def stopped(self) -> bool:
        """Whether the run ended before its last level."""
        return self.told["state"] != "complete"

    def row(self, time: float) -> dict[str, float]:
        """The row of history at a time."""
        k = np.argmin(np.abs(self.history["time"] - time))
        return {name: float(column[k]) for name, column in self.history.items()}

    def by_hand(self, time: float, level: float | None = None) -> gravity.GravityMethod:
        """The gravity method at a time."""
        return gravity.at(self.case, time, level)

    @cached_property
    def weight(self) -> float:
        """Of the dam above the joint [N/m]: the size of all forces."""
        return abs(self.by_hand(self.case.times[-1], 0.0).loads[0].fy)

    @cached_property
    def length(self) -> float:
        """Of the joint [m]."""
        return float(self.case.section["joint_length"][0])


def times_of(table: dict[str, np.ndarray]) -> list[float]:
    """The times of a table, in its order."""
    return list(dict.fromkeys(table["time"]))


def violations(run: Written) -> list[str]:
    """What a run has written that can not be true; empty if it stands every test."""
    rules = (bookkeeping, equilibrium, uplift, water, contact, admissible, memory)
    return [said for rule in rules for said in rule(run)]


def bookkeeping(run: Written) -> Iterator[str]:
    """Parameters as asked for, rows in order, tables complete, exit code as in the reference."""
    told, case, history = run.told, run.case, run.history
    if told["parameters"] != case.values:
        yield "run.json: other parameters than asked for"
    if not all(np.isfinite(v).all() for name, v in history.items() if name != "x_resultant"):
        yield "history.csv: a value is not finite"
    if (np.diff(history["time"]) <= 0).any():
        yield "history.csv: times do not increase"
    saved = [rows["time"][0] for rows in run.joint]
    if not run.stopped and saved != list(case.requested):
        yield "joint.csv: a requested level is missing"
    slid = told["verdict"] == "sliding" and not (case["law"] == "friction" and case.hardening_asked)
    if run.exit_code != int(run.stopped or slid):
        yield f"exit code {run.exit_code} with state {told['state']}, verdict {told['verdict']}"
    if case["drive"] == "level":
        asked = np.array([case.level_at(t) for t in history["time"]])
        if np.abs(history["level"] - asked).max(initial=0) > DIGITS * case["dam_height"]:
            yield "history.csv: not at the level asked for"
    tails = np.array([case.tail_at(t) for t in history["time"]])
    if np.abs(history["tail_level"] - tails).max(initial=0) > DIGITS * case["dam_height"]:
        yield "history.csv: not at the tailwater asked for"
    if (history["level"] < -DIGITS * case["dam_height"]).any():
        yield f"level {history['level'].min():.4g} m is below 0"


def equilibrium(run: Written) -> Iterator[str]:
    """N + U and T in every row, M about the toe in those that have a joint table."""
    history = run.history
    for k, (time, level) in enumerate(zip(history["time"], history["level"], strict=True)):
        hand = run.by_hand(time, level)
        for name, found, wanted in (
            ("N + U", history["N"][k] + history["U"][k], hand.N + hand.U),
            ("T", history["T"][k], hand.T),
        ):
            if abs(found - wanted) > BALANCE * run.weight:
                yield f"{name} = {found:.6g} N/m at t = {time:g}, by hand {wanted:.6g}"
    for rows in run.joint:
        time = rows["time"][0]
        row = run.row(time)
        lifting = water_resultants(run, rows)[1]
        wanted = run.by_hand(time, row["level"]).resultant.moment - lifting
        size = run.weight * run.length
        if abs(row["M"] - wanted) > (BALANCE + kink(run, rows)) * size:
            yield f"M = {row['M']:.6g} N m/m at t = {time:g}, by hand {wanted:.6g}"


def kink(run: Written, rows: dict[str, np.ndarray]) -> float:
    """What a pressure known at nodes only may be off by, over the dam's weight."""
    if run.case["uplift"] != "drained" and run.case["dim"] == 2:
        return 0.0
    return KINK * rows["p"].max() * run.length / run.case["n_joint"] ** 2 / run.weight


def water_resultants(run: Written, rows: dict[str, np.ndarray]) -> tuple[float, float]:
    """Force [N/m] and moment about the toe [N m/m], lifting > 0, of the pressure of a joint table:
    linear between its nodes, in 3D on a triangulation of them.
    """
    s, p = rows["s"], rows["p"]
    if run.case["dim"] == 2:
        order = np.argsort(s)
        corners, sizes = np.column_stack([order[:-1], order[1:]]), np.diff(s[order])
    else:
        places = np.column_stack([s, rows["z"]])
        corners = Delaunay(places).simplices
        a, b, c = places[corners].transpose(1, 0, 2)
        sizes = np.abs(np.linalg.det(np.stack([b - a, c - a], axis=1))) / 2
        sizes = sizes / np.ptp(rows["z"])
    p, arm = p[corners], run.length - s[corners]
    # of two linear functions over a simplex: (sum p_i arm_i + sum p_i sum arm_i) / (n (n + 1))
    n = corners.shape[1]
    products = (p * arm).sum(axis=1) + p.sum(axis=1) * arm.sum(axis=1)
    return float(sizes @ p.mean(axis=1)), float(sizes @ products / (n * (n + 1)))


def uplift(run: Written) -> Iterator[str]:
    """U is the integral of p, and where there is one that of the closed form."""
    for rows in run.joint:
        time = rows["time"][0]
        row = run.row(time)
        found = {"the integral of p": water_resultants(run, rows)[0]}
        if run.case["uplift"] in ("none", "imposed", "drained"):
            found["by hand"] = run.by_hand(time, row["level"]).U
        for how, wanted in found.items():
            if abs(wanted - row["U"]) > (DIGITS + kink(run, rows)) * run.weight:
                yield f"U = {row['U']:.6g} N/m at t = {time:g}, {how} {wanted:.6g}"


def water(run: Written) -> Iterator[str]:
    """The head lies between those of reservoir and tailwater, at a dry end its own height; water
    that flows leaks as much as it takes in anywhere.
    """
    case = run.case
    unit = case["rho_water"] * case["g"]
    if case["uplift"] == "none":
        if any(rows["p"].any() for rows in run.joint):
            yield "joint.csv: pressure in a dry joint"
        return
    for rows in run.joint:
        time = rows["time"][0]
        row = run.row(time)
        heel, toe = (case.section[name][0] for name in ("heel_y", "toe_y"))
        ends = max(row["level"], heel), max(row["tail_level"], toe)
        highest, lowest = max(ends), min(ends)
        if has_drains(case):  # down to their outlet: the tailwater, or the joint's own height
            lowest = min(lowest, max(row["tail_level"], min(heel, toe)))
        head = rows["y"] + rows["p"] / unit
        room = DIGITS * case["dam_height"]
        lifted = rows["p"] > 0  # elsewhere the air's pressure is the least
        if (head > highest + room).any() and (rows["p"][head > highest + room] > 0).any():
            yield f"pressure above the reservoir's head at t = {time:g}"
        if (head[lifted] < lowest - room).any():
            yield f"pressure below the tailwater's head at t = {time:g}"
        if "flux" in rows and case["dim"] == 2:
            yield from flux(run, rows, row["flux"])


def flux(run: Written, rows: dict[str, np.ndarray], leakage: float) -> Iterator[str]:
    """Water that flows in a plane joint is as much everywhere as leaks at the toe, but for what
    drains take at the node nearest to them.
    """
    case, s, flux, time = run.case, rows["s"], rows["flux"], rows["time"][0]
    near = run.length / case["n_joint"]
    # what the whole head drives through the closed joint: without a head there is rounding alone
    closed = case["rho_water"] * case["aperture_min"] ** 3 / (12 * case["visc"])
    slope = case["rho_water"] * case["g"] * max(case.levels) / run.length
    size = DIGITS * max(np.abs(flux).max(), closed * slope)
    before, after = np.zeros(len(s), bool), np.ones(len(s), bool)
    if has_drains(case):
        before, after = s < case["drain_x"] - near, s > case["drain_x"] + near
    taken_in = flux[before].mean() if before.any() else leakage
    for part, wanted in ((before, taken_in), (after, leakage)):
        off = np.abs(flux[part] - wanted).max(initial=0)
        if off > size:
            yield f"flux varies along the joint by {off:.3g} kg/(m s) at t = {time:g}"
    if taken_in < leakage - size:
        yield f"drains give {leakage - taken_in:.3g} kg/(m s) at t = {time:g}"


def contact(run: Written) -> Iterator[str]:
    """A closed point is pressed by K_N times its overlap, an open one is not pressed."""
    case = run.case
    stiffness = case["K_N"] * (case["pena_contact"] if case["law"] == "rupture" else 1.0)
    for rows in run.joint:
        stress, opening = rows["sigma_n_eff"], rows["delta_n"]
        size = DIGITS * (np.abs(rows["sigma_n"]) + rows["p"]).max()
        wanted = stiffness * np.minimum(opening, 0)
        off = np.where(opening < 0, np.abs(stress - wanted), np.maximum(-stress, 0))
        if (off > size).any():
            yield f"contact: off by {off.max():.3g} Pa at t = {rows['time'][0]:g}"


def admissible(run: Written) -> Iterator[str]:
    """No more tension than the bond bears, no more shear than the law lets through."""
    for rows in run.joint:
        tension, shear = limits(run, rows)
        size = DIGITS * (np.abs(rows["sigma_n"]) + rows["p"]).max()
        found = np.hypot(rows["tau_1"], rows["tau_2"])
        size_shear = size + DIGITS * found.max()
        for name, excess, room in (
            ("tension", rows["sigma_n_eff"] - tension, size),
            ("shear", found - shear, size_shear),
        ):
            if (excess > room).any():
                worst = f"{excess.max():.3g} Pa at t = {rows['time'][0]:g}"
                yield f"{name}: beyond the law by {worst}"


def limits(run: Written, rows: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The largest tension and shear [Pa] at the nodes: of the law and its written memory."""
    case, normal = run.case, rows["sigma_n_eff"]
    left = 1 - rows["damage"]
    if case["law"] == "rupture":
        slid = np.hypot(rows["delta_t1"], rows["delta_t2"]) + rows["slip"]
        return case["sigma_max"] * left, case["K_T"] * slid
    pressed = -case["mu"] * np.minimum(normal, 0)
    if case["law"] == "bond":
        return case["sigma_max"] * left, case["adhesion"] * left + pressed
    cap = np.full_like(normal, case["adhesion"] / case["mu"])
    return cap, case["adhesion"] - case["mu"] * normal + case["pena_tang"] * rows["lambda"]


def memory(run: Written) -> Iterator[str]:
    """What is broken or has slipped stays so."""
    case, history = run.case, run.history
    lasting = ["slip_length", *(["crack_length"] if case["law"] == "rupture" else [])]
    for name in lasting:
        if (np.diff(history[name]) < -DIGITS * run.length).any():
            yield f"{name} falls"
    name = "lambda" if case["law"] == "friction" else "damage"
    for rows in run.joint:
        if (rows[name] < 0).any() or (rows["damage"] > 1).any():
            yield f"{name} is out of its range at t = {rows['time'][0]:g}"
        if case["law"] == "friction" and (rows["slip"] > rows[name] * (1 + DIGITS)).any():
            yield f"slip is more than lambda at t = {rows['time'][0]:g}"
    for before, after in zip(run.joint, run.joint[1:], strict=False):
        if (after[name] < before[name] - DIGITS * before[name].max()).any():
            yield f"{name} falls before t = {after['time'][0]:g}"


# -- why a run has stopped
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Block:
    """The rigid block on its joint: effective normal force, shear, moment about the toe."""

    N: float
    T: float
    M: float


def blocks(run: Written) -> tuple[Block, Block]:
    """At the smallest step beyond the last converged state: the block under the least uplift, that
    of the last state, and under the most, the reservoir's whole head everywhere if the crack lets
    it in.
    """
    case = run.case
    start = run.history["time"].max(initial=0)
    time = min(start + case["smallest_step"], case.times[-1])
    hand = run.by_hand(time)
    moment = hand.resultant.moment
    if flows(case):
        least = water_resultants(run, run.joint[-1]) if run.joint else (0.0, 0.0)
        pressure = max(hand.uplift.p.max(), 0.0)
        most = pressure * run.length, pressure * run.length**2 / 2
    else:
        least = most = hand.U, hand.uplift.moment
    return tuple(Block(hand.N + hand.U - u, hand.T, moment - m) for u, m in (least, most))


def certain(run: Written) -> bool:
    """Whether the state that was not found exists by the static theorem: without any strength but
    friction, under the most uplift, the resultant well within the base and the shear held.
    """
    case, (_, block) = run.case, blocks(run)
    pressed = max(0.05, 3 / case["n_joint"]) * run.length
    inside = block.N > 0 and pressed * block.N < block.M < block.N * (run.length - pressed)
    holds = case["law"] == "rupture" or SAFE * abs(block.T) < case["mu"] * block.N
    return inside and holds


def reached(run: Written, block: Block) -> dict[str, bool]:
    """For each reason, whether the rigid block is near that limit.

    Overturning: about the toe, or about the heel, against the largest tension, which a bond has
    only where it has not broken, and not if it is about to break at one end; sliding: against
    friction, a bond's cohesion being gone, or friction's cohesion and what its slip has hardened.
    Not converged: one of these, or a bond that is about to break at an end of the joint, after
    which nothing may hold.
    """
    case, length = run.case, run.length
    cohesion, tension = 0.0, case["sigma_max"]
    if case["law"] == "friction":
        slip = run.joint[-1]["lambda"].max() if run.joint else 0.0
        cohesion = case["adhesion"] + case["pena_tang"] * slip
        tension = case["adhesion"] / case["mu"]
    holds = case["mu"] * block.N + cohesion * length
    lever = block.M, block.N * length - block.M
    # linear stress at both ends, as in the gravity method; a bond that breaks there pulls no more
    ends = [(2 * block.N * length - 6 * arm) / length**2 for arm in lever]
    breaks = case["law"] != "friction" and max(ends) > NEAR * tension
    bonded = length
    if case["law"] != "friction":
        bonded -= run.history["crack_length"][-1:].sum()
    held = min(lever) + (0.0 if breaks else tension * bonded**2 / 2)
    found = {
        "overturning": held < (1 - NEAR) * abs(block.N) * length,
        "sliding": case["law"] != "rupture" and abs(block.T) > NEAR * holds,
    }
    return found | {"not converged": breaks or any(found.values())}


def stiffness_ratio(case: Case) -> float:
    """K_N h/E: the joint's stiffness over the bulk's within an element's length h."""
    softest = min(case["E_dam"], case["E_found"])
    return case["K_N"] * case.section["joint_length"][0] / case["n_joint"] / softest


def unjustified(run: Written) -> tuple[bool, str]:
    """Whether it is wrong that a run has stopped, or the reason that it gives; and what is to be
    said of that, empty if nothing is.

    Not wrong, but not proved to be right either: not converged, of a joint that is too stiff for
    its mesh, and says so, of a displacement, whose level is not known beforehand, and where the
    rigid block is neither certain to stand nor near a limit. A crack that lets the reservoir in may
    run through the joint at once, from far off any limit: the block under the most uplift tells.
    """
    said = run.told["verdict"]
    if run.told["state"] != "stopped":
        return True, run.told["statement"]
    undecided = said in ("not converged", "no equilibrium")
    if run.case["drive"] == "level" and certain(run):
        return True, f"{said}, where an equilibrium is certain"
    if undecided and stiffness_ratio(run.case) >= STIFF:
        return False, f"{said}, K_N h/E = {stiffness_ratio(run.case):.3g}"
    if run.case["drive"] != "level":
        return False, f"{said} of a driven run" if undecided else ""
    reason = "not converged" if undecided else said
    if any(reached(run, block)[reason] for block in blocks(run)):
        return False, ""
    return not undecided, f"{said}, which the rigid block does not explain"
