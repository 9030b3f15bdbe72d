"""Sentences on the end of a run, and on its path."""

from __future__ import annotations

import numpy as np

from .. import ROUND_OFF
from ..input.case import Case
from ..input.constraints import STAGED
from ..input.values import has_drains, level_unknown
from ..model.results import Results
from ..solver.path_point import FALL, PRECISION
from ..units import FORCES, STRESSES, with_unit
from . import gravity
from .verdict import (
    STIFF_JOINT,
    Bound,
    bound,
    failure,
    slides_from,
    stiffness_ratio,
    strength_known,
    verdict,
)

#: Why there is no equilibrium above a bound of statics, by how the dam fails there.
REASONS = {
    "overturning": "the resultant leaves the joint",
    "sliding": "the shear exceeds the strength of the joint",
}


def statement(results: Results) -> str:
    """Why and where a run has stopped, or that the dam slides; empty if it stands."""
    case, last, why = results.case, results.last, failure(results)
    mode, joint = why.mode, why.at(case)
    if not last:
        return reason_at_first(results, mode)
    if results.stopped:
        where = where_stopped(results)
        if mode == "out of range":
            return (
                f"out of range: the displacement needs a level below 0 or above "
                f"{case.highest_level:g} m beyond {where}; the last converged state is saved"
            )
        return f"{verdict(results)}: {reason_of_stop(results)}; the last converged state is saved"
    if not mode:
        return ""
    level = max(slides_from(results.joints[k]) or 0.0 for k in why.joints)
    case = case.joints[why.joints[0]]
    hardening, where = case.law.hardening_parameter, joint or "joint"
    what = f"the whole {where} has slipped or is open"
    if strength_known(case):
        what = f"the shear force on the {where} exceeds its strength"
    slides = f"sliding: {what} from level {level:.6g} m on"
    if not hardening:
        return f"{slides}; the joint has no further shear strength"
    default = ", a numerical default; set it if your joint hardens"
    return (
        f"{slides}; the dam stands on the hardening {hardening} = {case[hardening]:.4g} Pa/m"
        f"{'' if case.hardening_requested else default}"
    )


def reason_at_first(results: Results, mode: str) -> str:
    """Why a run has no step at all: by statics, or because none has converged; mode: of failure."""
    if mode in REASONS:
        level = results.case.level_at(results.case.times[0])
        return f"{verdict(results)}: no equilibrium at level {level:.6g} m: {REASONS[mode]}"
    end = results.info.get("end_of_solution")
    return (
        "not converged: no equilibrium is found at the first step, and none is excluded by statics"
        + (f"; {end}" if end else "")
    )


def reason_of_stop(results: Results) -> str:
    """The mechanism or bound of statics at which a run has stopped, or that there is none. The
    state after unstable crack growth, and so its strength, depends on steps and mesh.
    """
    case, last, shown = results.case, results.last, results.info.get("mechanism")
    where = where_stopped(results)
    if (grown := level_of_growth(results)) is not None:
        where += f", after unstable crack growth at level {grown:.6g} m"
    if shown:
        ratio = shown["displacement_ratio"]
        along = f" (followed to {ratio:.2g} times the displacement of that level)"
        most = shown["level"]
        with_all = f" under the loads of t = {shown['time']:g}" if most < last["level"] else ""
        path = f"the equilibrium path reaches {most:.6g} m at most{with_all}"
        path += along if ratio > 1 else ""
        return f"no equilibrium beyond {where}: {path}"
    reached = bound(results)
    if reached.mode:
        joint = case.named(reached.joints)
        at_joint = f"{joint}: " if joint else ""
        return f"no equilibrium beyond {where}: {at_joint}{words_of_bound(reached)}"
    arm = case.joint_along - last["x_resultant"]
    end = results.info.get("end_of_solution")
    return (
        f"no equilibrium is found beyond {where}, and no mechanism either{stiff_joint(results)}; "
        + (f"{end}; " if end else "")
        + f"there the resultant is {arm:.3g} m from the toe, T/N' = {last['T'] / last['N']:.3g}"
    )


def level_of_growth(results: Results) -> float | None:
    """The level [m] above which others are reached after unstable crack growth: the state then
    depends on steps and mesh, or the level has fallen on the way. None if there is none.
    """
    info = results.info
    falls = (top for top, low in info.get("limit_points", ()) if low < (1 - FALL) * top)
    steps = (*info.get("broken_at_once", ()), *info.get("passed_over", ()))
    begins = (begin for begin, _ in steps)
    return min((*info.get("unstable_growth", ()), *falls, *begins), default=None)


def where_stopped(results: Results) -> str:
    """The last level and time; the highest level of the equilibrium path where the last state is
    its limit point: the same to the precision.
    """
    level, shown = float(results.last["level"]), results.info.get("mechanism")
    most = shown["level"] if shown else level
    level = most if level < most <= (1 + PRECISION) * level else level
    return f"level {level:.6g} m (t = {results.last['time']:.6g})"


def words_of_bound(reached: Bound) -> str:
    """Why a state has reached a bound of statics; empty if it has reached none."""
    if reached.mode == "overturning":
        side = "from" if reached.value >= 0 else "beyond"
        return f"the resultant is {abs(reached.value):.3g} m {side} the toe"
    if reached.mode == "sliding":
        force, strength = (with_unit(v, FORCES, 5) for v in (reached.value, reached.strength))
        return f"T = {force} reaches the shear strength, {strength}"
    return ""


def stiff_joint(results: Results) -> str:
    """The hint, in brackets, that the joint is too stiff for its elements; empty if it is not."""
    ratio = stiffness_ratio(results)
    if ratio < STIFF_JOINT:
        return ""
    why = f"the joint is too stiff for this mesh: K_N h/E = {ratio:.3g}"
    return f" ({why}; refine n_joint or lower K_N)"


def cracks_and_drains(case: Case, crack: float, block: gravity.GravityMethod) -> str:
    """On which side of the drains the crack ends by each method, and what follows, with the uplift
    that has the full head in the crack; empty with another uplift, or if neither crack passes them.

    case: of the joint; crack: its length [m] by the finite elements; block: the gravity method.
    """
    at = case["drain_x"]
    blocks = (block, *block.further)
    if case["uplift"] != "cracked" or not has_drains(case):
        return ""
    if max(crack, *(state.crack_length for state in blocks)) <= at:
        return ""

    def ends(length: float) -> str:
        if length > at:
            return f"a crack of {length:.4g} m has passed them: the full head acts, no drainage"
        where = f"a crack of {length:.4g} m ends before them" if length else "no crack"
        return f"{where}: they lower the head"

    by_hand = "; or, if it grows further, ".join(ends(state.crack_length) for state in blocks)
    return (
        f"drains at {at:g} m, full head in the crack: finite elements (stress of the elastic dam, "
        f"largest at the heel): {ends(crack)}; gravity method (stress linear along the joint): "
        f"{by_hand}"
    )


def path_statement(results: Results) -> str:
    """The largest level of a run under displacement control, and whether its path snaps back."""
    history, case = results.history, results.case
    level, time = history["level"], history["time"]
    if not len(level):
        return "no step has converged"
    driven = (time > case["drive_begin"] - ROUND_OFF) & (time < case["drive_end"] + ROUND_OFF)
    load, what = case["rho_water"] * case["g"] * level.max(), "level"
    text = f"largest load: level {level.max():.5g} m ({with_unit(load, STRESSES, 5)})"
    if not level_unknown(case):
        level, what = np.abs(history["load_factor"]), "factor"
        acting = [name for name in STAGED[case["drive_load"]] if case[name]]
        text = f"largest load: {level.max():.5g} times {' and '.join(acting)}"
    elif case["drive_by"] < 0:
        return text + "; the displacement was reversed"
    falls = bool((np.diff(level[driven]) < 0).any())
    if case["drive"] == "dissipation":
        moves = np.diff(history["point_u"][driven])
        turns = bool((moves < 0).any() and (moves > 0).any())
        return text + "; the point " + ("moves to and fro: snap-back" if turns else "moves one way")
    text += f"; the {what} " + ("falls while the displacement grows" if falls else "always rises")
    if not level_unknown(case):
        return text
    moved = history["crest_ux"][driven], results.heel[driven]
    back = any(bool((np.diff(m) < 0).any()) for m in moved)
    return text + ("; snap-back occurs" if back else "; no snap-back")
