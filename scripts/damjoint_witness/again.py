"""A scene again: with twice as many load steps, and its critical level from several starts.

Under a water level that rises step by step the state does not depend on the steps (section 8 of
reference/theory.md). The critical level does not depend on the level that the search starts from,
if the way of the loads is the same; just below it there is an equilibrium, which is verified like
any other run, and just above it none is certain by statics, nor possible where the strength cannot
change in between; nor does a run with few or many load steps stand there, but on another branch.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from . import stops
from .files import Files, Table, read_table, split_by
from .reader import Request

#: Difference of jumps between two numbers of steps, over the largest jump (theory, section 8).
SAME_STATE = 1e-6
#: Difference of confirmed critical levels over the level: their precision.
SAME_LEVEL = 1e-4
#: Relative reserve of the bound within which a level is at it: the precision of the search.
AT_THE_BOUND = 2e-3
#: Level from which all searches rise, over the dam's height, or over the critical level if this one
#: is so low that other starts would lie below the first [-].
FIRST_START = 0.3
#: Levels of the second and third start, over the first critical level [-].
STARTS = 0.6, 0.9
#: Level of the state below it, over the first critical level [-].
BELOW = 0.995
#: Level of the state above it, over the first critical level [-].
ABOVE = 1.005
#: Level above it to which runs are made, over the first critical level [-], and their load steps.
RUNS_TO, RUN_STEPS = 1.002, (1, 4, 16)
#: Levels from which on a run that has jumped to another branch may stand above it, over it [-].
JUMPED_NEAR = 0.95


#: The failure that ends a branch only: there may be an equilibrium above it.
UNSTABLE = "unstable crack growth"

#: Entries of run.json with levels at which a state has jumped to another branch.
JUMPS = "unstable_growth", "broken_at_once", "passed_over"


# -- load steps
# --------------------------------------------------------------------------------------------------


def follows_history(request: Request, first_step: bool = True) -> bool:
    """Return whether the state under rising water may depend on the way there: where a joint slips
    under a load that the water turns back (temperature; earthquake and anchor against the water),
    grouting and sawing, a first step that bears the weight with a part of the water (unless
    first_step is false: it is the same), a controlled displacement; where water flows in time.
    """
    first = request.joints[0]
    heat = any(first[f"temperature_{part}"] for part in ("dam", "linear", "found"))
    works = any(v["grout_pressure"] or v["saw_thickness"] for v in request.joints)
    against = first["k_h"] < 0 or (first["anchor_force"] > 0 and first["anchor_angle"] > 0)
    driven = first["drive"] != "level" or (first_step and not first["weight_first"])
    return bool(heat or works or against or driven or first["time_unit"])


def follows_steps(request: Request, *records: dict[str, Any]) -> bool:
    """Return whether a state may depend on the load steps: on the history; after levels that fall;
    of water that enters a crack after the step that has opened it; after unstable crack growth; of
    a weight that has not converged alone; of slip whose direction in a 3D joint turns, which a step
    takes as constant.
    """
    falls = any(list(levels) != sorted(levels) for levels in (request.levels, request.tail_levels))
    names = *JUMPS, "limit_points", "weight_with_water"
    unstable = any(record.get(name) for record in records for name in names)
    entering = any(v["uplift"] == "cracked" for v in request.joints)
    turns = request.joints[0]["dim"] == 3 and any(v["law"] != "rupture" for v in request.joints)
    return follows_history(request) or falls or unstable or entering or turns


def difference(one: Files, other: Files) -> float:
    """Return the largest difference of a jump in the last tables of two runs, over the largest
    jump.
    """
    last = [jumps(files.joint_tables[-1]) for files in (one, other)]
    return float(np.abs(last[0] - last[1]).max() / np.abs(last[0]).max())


def jumps(table: Table) -> Any:
    """Return the jumps (n, 3) of a table."""
    return np.column_stack([table[f"delta_{axis}"] for axis in ("n", "t1", "t2")])


def goes_back(steps: Table) -> bool:
    """Return whether slip or damage of a point of a joint changes in a step of the water and not in
    the next one, or whether it slips to the other side there. Where none does, each step ends on
    the law's limit or within it, whatever the steps between.
    """
    updates = split_by(steps, "update")  # the first: the weight
    names = "damage", "slip", "delta_t1", "delta_t2"
    states = np.array([[update[name] for name in names] for update in updates])
    if len(states) < 3:
        return False
    damage, slip, *shear = np.diff(states, axis=0).swapaxes(0, 1)
    slips = np.abs(slip) > SAME_STATE * np.abs(states[:, 2:]).max()
    ends = [changes[:-1] & ~changes[1:] for changes in (damage > SAME_STATE, slips)]
    turns = slips[:-1] & (sum(x[:-1] * x[1:] for x in shear) < 0)
    return bool(np.any([*ends, turns]))


def other_steps(request: Request, one: Files, other: Files) -> Iterator[str]:
    """Yield how the last state differs between two numbers of load steps; other: with more."""
    if one.stopped or other.stopped or follows_steps(request, one.record, other.record):
        return
    if goes_back(read_table(other.folder / "steps.csv")):
        return
    found = difference(one, other)
    if found > SAME_STATE:
        yield f"with twice the steps the jumps differ by {found:.3g} of the largest"


# -- critical levels
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Critical:
    """A critical level as run.json has it."""

    level: float
    mode: str
    joint: str
    #: the reason; empty: not confirmed
    confirmed: str

    @staticmethod
    def of(record: dict[str, Any]) -> Critical | None:
        """Return that of a run.json; None without a level."""
        found = record.get("critical") or {}
        if not found.get("value"):
            return None
        reason = "" if found["doubt"] else found["confirmed"]
        return Critical(found["value"], found["mode"], found["joint"], reason)


def starts(found: Sequence[Critical]) -> Iterator[str]:
    """Yield how confirmed critical levels from several starts differ."""
    levels = [critical.level for critical in found if critical.confirmed]
    if len(levels) > 1 and np.ptp(levels) > SAME_LEVEL * max(levels):
        yield f"critical levels from several starts: {', '.join(f'{x:.8g}' for x in levels)} m"


def above(critical: Critical, files: Files, request: Request, steps: Table) -> Iterator[str]:
    """Yield what statics says against a confirmed critical level; files, request, steps: of the run
    to a level just below it.
    """
    if not critical.confirmed or not request.sections or critical.mode == UNSTABLE:
        return
    beyond = replace(request, levels=(ABOVE / BELOW * request.levels[-1],))
    verdict = f"{critical.mode} on {critical.joint}" if critical.joint else critical.mode
    # the search omits the hardening that a case does not ask for
    plastic = steps | {"lambda": 0 * steps["lambda"]} if "lambda" in steps else steps
    joints = stops.failing(files, beyond, plastic, verdict)
    if all(map(stops.equilibrium_is_certain, joints)):
        yield f"above the critical level {critical.level:.6g} m there certainly is an equilibrium"
    by_friction = critical.mode == "sliding" and all(map(has_constant_strength, joints))
    least = min(stops.load_factor(j, j.forces(most_uplift=False)) for j in joints)
    if by_friction and least > 1 + AT_THE_BOUND:
        yield (
            f"sliding at the critical level {critical.level:.6g} m, but statics allows {least:.4g} "
            "times the loads above it"
        )


def stands_above(critical: Critical, runs: Sequence[Files]) -> Iterator[str]:
    """Yield which of the runs to a level above a confirmed critical level stand, without having
    jumped to another branch near it; nothing of unstable growth, which ends a branch only.
    """
    if not critical.confirmed or critical.mode == UNSTABLE:
        return
    for files in runs:
        if files.record["verdict"] != "stands" or jumped_to(files) > JUMPED_NEAR * critical.level:
            continue
        rows = files.history
        yield (
            f"a run of {len(rows['time'])} steps stands at {rows['level'][-1]:.6g} m, above the "
            f"critical level {critical.level:.6g} m"
        )


def jumped_to(files: Files) -> float:
    """Return the highest level [m] at which a run says that it has jumped to another branch, or has
    passed a limit point; 0 if there is none.
    """
    found = [files.record.get(name) or [0.0] for name in (*JUMPS, "limit_points")]
    return float(max(np.max(levels) for levels in found))


def has_constant_strength(joint: stops.Joint) -> bool:
    """Return whether the strength of a joint does not depend on its state, nor the loads on its
    opening.
    """
    v = joint.values
    dry = v["uplift"] not in ("flow", "cracked")
    plastic = v["law"] == "friction" and not (v["hardening_requested"] and v["pena_tang"])
    return bool(
        dry and (plastic or (v["law"] == "bond" and not v["sigma_max"] and not v["adhesion"]))
    )
