"""The verdict of a run: whether the dam stands, how it fails, and hints on the result.

Only this module derives a failure from resultants.
"""

from __future__ import annotations

import numpy as np

from ..input.case import Case
from ..input.values import freezes_uplift, has_drains
from ..laws import Evidence
from ..model.loads import COMPLETE, thermal_strains
from ..model.results import Results, row_of_joint
from . import gravity


def verdict(results: Results) -> str:
    """One of: stands, sliding, overturning, broken through, out of range, not converged, no
    equilibrium, interrupted; a failure with its joint if there are several: "sliding on base".

    "no equilibrium": not even at the first step. "sliding" also where the whole joint has slipped
    or opened and only the hardening of the joint resists.
    """
    mode, joint = failure(results)
    return f"{mode} on {joint}" if joint else mode or "stands"


def failure(results: Results) -> tuple[str, str]:
    """How the dam fails, empty if it stands, and at which joint, if there are several."""
    if not results.last:
        return "no equilibrium", ""
    if results.stopped:
        return why_stopped(results)
    slipped = slipped_joints(results)
    return ("sliding", results.case.named(slipped)) if slipped else ("", "")


def failed(results: Results) -> bool:
    """Whether the run's exit code has to be 1: stopped, or sliding on a hardening that the user has
    not set.
    """
    if results.stopped or not results.last:
        return True
    slipped = slipped_joints(results)
    joints = [results.case.joints[k] for k in slipped]
    hardening_set = all(j.law.hardening_parameter and j.hardening_asked for j in joints)
    return bool(slipped) and not hardening_set


def decisive_joint(results: Results) -> int:
    """The number of the joint at which the dam fails; of a dam that stands, of the one that is
    cracked or has slipped over the largest part of its length.
    """
    if len(results.case.joint_names) == 1:
        return 0
    if failing := failing_joints(results):
        return failing[0]
    parts = [
        max(own.last[n] for n in ("crack_length", "slip_length")) / own.case.joint_along
        for own in results.joints
        if results.last
    ]
    return int(np.argmax(parts)) if parts else 0


def failing_joints(results: Results) -> tuple[int, ...]:
    """The numbers of the joints that the failure of a run names, of a single joint that one; empty
    if the dam stands, or if no joint is named.
    """
    mode, joints = failure(results)
    if not results.case.of_joints:
        return (0,) if mode else ()
    names, numbers = results.case.joint_names, list[int]()
    rest = joints and f"{joints} and "  # see `Case.named`; a name may begin another one
    while named := [name for name in names if rest.startswith(f"{name} and ")]:
        longest = max(named, key=len)
        numbers.append(names.index(longest))
        rest = rest.removeprefix(f"{longest} and ")
    return tuple(numbers)


def slipped_joints(results: Results) -> tuple[int, ...]:
    """The numbers of joints that have slipped along all of their length and alone hold what is
    above them; empty if there are none.
    """
    slipped = [k for k, own in enumerate(results.joints) if slipped_from(own) is not None]
    return results.case.separating(slipped)


def slipped_from(results: Results) -> float | None:
    """The level [m] from which on the whole joint, the only one of these results, has slipped or is
    open; None if a part of it sticks, or if a dam that has slipped stands by the joint law.

    A point that has slipped once counts as slipped. By the integration points of every
    step, or by the nodes at the last requested level. A change of temperature can let every point
    slip, in opposite directions: with it the shear force has to reach the strength, too.
    """
    if results.case.law.stands_slipped:
        return None
    if thermal_strains(results.case, COMPLETE):
        resistance = shear_resistance(results, results.last["N"])
        if abs(results.last["T"]) < (1 - AT_BOUND) * resistance < np.inf:
            return None
    history, base = results.history, results.case.joint_length
    slipped = np.maximum(history["slip_length"], history["crack_length"]) > base * (1 - 1e-9)
    if slipped.any() and slipped[-1]:
        return float(history["level"][np.flatnonzero(~slipped)[-1] + 1 if not slipped.all() else 0])
    rows = results.at() if len(results.joint["time"]) else {}
    if rows and np.all((rows["damage"] >= 1) | (rows["slip"] > 0)):
        return float(rows["level"][0])
    return None


def why_stopped(results: Results) -> tuple[str, str]:
    """Out of range, sliding, overturning, broken through or not converged; and the joint that
    fails, if there are several.

    Out of range: under displacement control the level of the next step, by extrapolation, would be
    below 0 or above the highest allowed. A failure is named if the equilibrium path shows its
    mechanism or the last converged state has reached a bound of statics; else the run has not
    converged.
    """
    case, last = results.case, results.last
    ahead = 2 * last["level"] - [0.0, *results.history["level"]][-2]
    if case["drive"] != "level" and not 0 <= ahead <= case.highest_level:
        return "out of range", ""
    shown = results.info.get("mechanism") or {}
    if shown.get("mode"):
        return shown["mode"], shown.get("joint", "")
    mode, _, joint = bound(results)
    return mode or "not converged", joint


def shear_resistance(results: Results, normal: float) -> float:
    """Shear force [N/m] that the joint, the only one of these results, transmits at the last saved
    state under an effective normal force; infinite if its law does not bound the shear.
    """
    case, damage, slip = results.case, mean(results, "damage"), mean(results, "slip")
    return case.law.shear_resistance(normal, case.joint_along, damage, slip)


#: Relative distance to a bound of statics within which a state has reached it: the last step of a
#: run is known to 1/1024 of the step between two levels.
AT_BOUND = 5e-3
#: Distance of the resultant from the toe, over the joint's length, within which the dam overturns:
#: at least, and in elements.
ARM_AT_TOE, ELEMENTS_AT_TOE = 0.01, 0.5


def bound(results: Results) -> tuple[str, str, str]:
    """The bound of statics that the last state has reached, sliding or overturning, why, and at
    which joint, if there are several; all empty if none. Joints that still carry more come last:
    one without a crack, by its tension, and one on a hardening that the user has set, by slipping.
    """
    case = results.case

    def carries_more(joint: tuple[int, Results]) -> tuple[bool, bool]:
        last = joint[1].last
        return joint[1].case.hardening_asked, not last["crack_length"] + last["process_zone"]

    for k, own in sorted(enumerate(results.joints), key=carries_more):
        mode, why = bound_of_joint(own)
        if mode and case.separates((k,)):
            return mode, why, case.named((k,))
    return "", "", ""


def bound_of_joint(results: Results) -> tuple[str, str]:
    """The bound that the only joint of these results has reached, and why; both empty if none.

    A rigid block on a joint without tension has M >= 0; on elements the compression ends within the
    last one at the toe. Friction's tension c/mu of the open part is no compression.
    """
    case, last = results.case, results.last
    length, resistance = case.joint_along, shear_resistance(results, last["N"])
    crack = last["crack_length"]
    pull = case.law.open_tension * crack
    normal, moment = last["N"] + pull, last["M"] + pull * (length - crack / 2)
    arm = moment / normal if normal > 0 else 0.0
    if arm < max(ARM_AT_TOE, ELEMENTS_AT_TOE / case["n_joint"]) * length:
        side = "from" if arm >= 0 else "beyond"
        return "overturning", f"the resultant is {abs(arm):.3g} m {side} the toe"
    if last["T"] >= (1 - AT_BOUND) * resistance:
        return (
            "sliding",
            f"T = {last['T']:.5g} N/m reaches the shear strength, {resistance:.5g} N/m",
        )
    return "", ""


#: Moments that differ by more, over N times the base, belong to different cracks.
SAME_CRACK = 0.01


def highest_by_statics(case: Case, last: dict[str, float]) -> tuple[float, str, str, str]:
    """The level [m] above which no equilibrium exists, how the dam fails, why, and at which joint,
    if there are several; infinite and empty where statics gives no bound.

    last: the last row of the history.
    """
    bounds = (
        (*highest_on_joint(joint, row_of_joint(last, k)), case.named((k,)))
        for k, joint in enumerate(case.joints)
        if case.separates((k,))
    )
    return min(bounds, default=(np.inf, "", "", ""))


def highest_on_joint(case: Case, last: dict[str, float]) -> tuple[float, str, str]:
    """The level [m] above which no equilibrium of a case's only joint exists, see
    `highest_by_statics`.

    Whatever the distribution of stress: with the tensile strength f over the length l that is not
    cracked, M >= -f l^2/2, and the shear is at most the law's `shear_bound`; the crack does not
    close as the level rises. A law whose open points transmit tension has l = the whole joint.
    """
    from scipy.optimize import brentq  # half of a run's start

    law, time = case.law, min(last["time"], case.times[-1])
    if case.geometry or case["uplift"] == "flow" or freezes_uplift(case):
        return np.inf, "", ""
    crack = 0.0 if law.open_tension else last["crack_length"]
    block = lambda level: gravity.with_crack(case, time, level, crack)
    at_last = block(last["level"])
    length = at_last.uncracked

    def moment(level: float) -> float:
        return block(level).M + law.tensile_strength * length**2 / 2

    def shear(level: float) -> float:
        state = block(level)
        return float(law.shear_bound(np.array(state.N), length)) - state.T

    reasons = (
        (moment, "overturning", "the resultant leaves the joint"),
        (shear, "sliding", "the shear exceeds the strength of the joint"),
    )
    bounds = [(np.inf, "", "")]
    if abs(at_last.M - last["M"]) < SAME_CRACK * abs(at_last.N) * case.joint_along:
        for reserve, mode, words in reasons:
            if reserve(last["level"]) > 0 > reserve(case.highest_level):
                root = brentq(reserve, last["level"], case.highest_level)
                bounds.append((root, mode, words))
    return min(bounds)


def mean(results: Results, column: str) -> float:
    """The mean of a column along the only joint of these results at the last saved state; 0 if
    there is none.
    """
    if not len(results.joint["time"]):
        return 0.0
    rows = results.at()
    place, inverse = np.unique(rows["s"].round(9), return_inverse=True)
    values = np.bincount(inverse, rows[column]) / np.bincount(inverse)
    return float(np.sum((values[1:] + values[:-1]) / 2 * np.diff(place)) / np.ptp(place))


def statement(results: Results) -> str:
    """Why and where a run has stopped, or that the dam slides; empty if it stands."""
    case, last, (mode, joint) = results.case, results.last, failure(results)
    if mode == "no equilibrium":
        return "no equilibrium even at the first step"
    if results.stopped:
        where = f"level {last['level']:.6g} m (t = {last['time']:.6g})"
        if mode == "out of range":
            return (
                f"out of range: the displacement needs a level below 0 or above "
                f"{case.highest_level:g} m beyond {where}; the last converged state is saved"
            )
        return f"{verdict(results)}: {reason_of_stop(results)}; the last converged state is saved"
    if not mode:
        return ""
    slipped = slipped_joints(results)
    level = max(slipped_from(results.joints[k]) or 0.0 for k in slipped)
    case = case.joints[slipped[0]]
    hardening, where = case.law.hardening_parameter, joint or "joint"
    slides = f"sliding: the whole {where} has slipped or is open from level {level:.6g} m on"
    if not hardening:
        return f"{slides}; the joint has no further shear strength"
    default = ", a numerical default; set it if your joint hardens"
    return (
        f"{slides}; the dam stands on the hardening {hardening} = {case[hardening]:.4g} Pa/m"
        f"{'' if case.hardening_asked else default}"
    )


def reason_of_stop(results: Results) -> str:
    """The mechanism or bound of statics at which a run has stopped, or that there is none."""
    case, last, shown = results.case, results.last, results.info.get("mechanism")
    where = f"level {last['level']:.6g} m (t = {last['time']:.6g})"
    if shown:
        ratio = shown["displacement_ratio"]
        along = f", followed to {ratio:.2g} times that displacement," if ratio > 1 else ""
        most = shown["level"]
        with_all = f" under the loads of t = {shown['time']:g}" if most < last["level"] else ""
        path = f"the equilibrium path{along} reaches {most:.6g} m at most{with_all}"
        return f"no equilibrium beyond {where}: {path}"
    _, reached, joint = bound(results)
    if reached:
        at_joint = f"{joint}: " if joint else ""
        return f"no equilibrium beyond {where}: {at_joint}{reached}"
    arm = case.joint_along - last["x_resultant"]
    return (
        f"no equilibrium is found beyond {where}, and no mechanism either{stiff_joint(results)}; "
        f"there the resultant is {arm:.3g} m from the toe, T/N' = {last['T'] / last['N']:.3g}"
    )


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


#: K_N h/E beyond which a joint is stiff for its mesh: the published points make its node stresses
#: oscillate, and convergence is hard.
STIFF_JOINT = 100


def stiffness_ratio(results: Results) -> float:
    """K_N h/E: the joint's stiffness over that of the bulk within an element's length h."""
    case = results.case
    length = case.joint_length / case["n_joint"]
    return case["K_N"] * length / min(case["E_dam"], case["E_found"])


def stiff_joint(results: Results) -> str:
    """The hint, in brackets, that the joint is too stiff for its elements; empty if it is not."""
    ratio = stiffness_ratio(results)
    if ratio < STIFF_JOINT:
        return ""
    why = f"the joint is too stiff for this mesh: K_N h/E = {ratio:.3g}"
    return f" ({why}; refine n_joint or lower K_N)"


#: Depth and width of the foundation over the dam's height below which the crack is too long: a 45 m
#: dam at 45 m has a crack of 10.7, 5.3, 4.2, 3.2 m with a foundation of 5, 34, 60, 120 m.
LEAST_FOUNDATION = 1.5
#: K_N L/E below which the joint is softer than the dam: the stress is that of a rigid block.
SOFT_JOINT = 1


def hints(results: Results) -> list[str]:
    """Hints on a result besides its verdict: limits of the model, what to change; with several
    joints those of a joint with its name.
    """
    case, of_joints = results.case, list[str]()
    for k, own in enumerate(results.joints):
        name = case.named((k,))
        of_joints += (f"{name}: {hint}" if name else hint for hint in hints_on_joint(own))
    if case.published:
        return of_joints
    return of_joints + hints_on_run(results)


def hints_on_joint(results: Results) -> list[str]:
    """Hints on the stiffness of the only joint of these results."""
    case, messages = results.case, list[str]()
    ratio = stiffness_ratio(results)
    if ratio >= STIFF_JOINT and case["quadrature"] == "published":
        messages.append(
            f"K_N h/E = {ratio:.3g}: the joint is stiff for this mesh, its node stresses oscillate "
            "(N, T, M do not): set quadrature = full"
        )
    soft = case["K_N"] * case.joint_length / min(case["E_dam"], case["E_found"])
    if soft < SOFT_JOINT:
        messages.append(
            f"K_N L/E = {soft:.3g}: the joint is softer than the dam; a closed joint of "
            "concrete on rock has 10 to 1000"
        )
    return messages


def hints_on_run(results: Results) -> list[str]:
    """Hints on the model as a whole, and on the last state of each joint."""
    case, last, messages = results.case, results.last, list[str]()
    reach = min(case["found_side"], case["found_depth"])
    if case["dim"] == 3 and case["hold_z"] and not case.geometry:
        messages.append(
            "an extruded section with hold_z = 1 is in plane strain: dim = 2 has the same "
            "solution in less time"
        )
    if not case.geometry and reach < LEAST_FOUNDATION * case["dam_height"]:
        messages.append(
            f"the foundation reaches {reach:g} m: less than {LEAST_FOUNDATION:g} heights of the "
            "dam make the crack too long"
        )
    if levels := results.info.get("unstable_growth"):
        messages.append(
            f"unstable crack growth at level {min(levels):.4g} m: the state after it depends on "
            "steps and mesh"
        )
    for limit, lowest in results.info.get("limit_points", ()):
        messages.append(
            f"unstable crack growth at level {limit:.4g} m: along the equilibrium path the level "
            f"falls to {lowest:.4g} m before it rises again"
        )
    if results.info.get("engine") == "getdp" and verdict(results) == "not converged":
        messages.append(
            "the engine getdp does not follow the equilibrium path beyond a limit point: "
            "--engine condensed does"
        )
    unstable = bool(levels) or verdict(results) == "not converged"
    for k, own in enumerate(results.joints if last else []):
        name, last = case.named((k,)), own.last
        share = tension_share(own.case, last)
        evidence = Evidence(last["crack_length"], unstable, share)
        of_joint = [*own.case.law.hints(evidence), *hints_on_state(own, last)]
        messages += (f"{name}: {hint}" if name else hint for hint in of_joint)
    return messages


def tension_share(case: Case, last: dict[str, float]) -> float:
    """Part of the overturning moment that the tension of the open points balances; nan if it is not
    known.
    """
    pull = case.law.open_tension * last["crack_length"]
    if case.geometry or not pull:
        return np.nan
    time = min(last["time"], case.times[-1])
    block = gravity.with_crack(case, time, last["level"], 0.0)
    parts = [*(m for load in block.loads for m in load[3:]), last["M"] - block.resultant.moment]
    overturning = -sum(m for m in parts if m < 0)
    arm = block.body.length - last["crack_length"] / 2
    return pull * arm / overturning if overturning else np.nan


#: Part of the tensile strength from which on the heel counts as in tension.
IN_TENSION = 1e-3
#: Distance of a node from the drains, over the joint's length, within which it is at the drains.
AT_DRAINS = 1e-5


def hints_on_state(results: Results, last: dict[str, float]) -> list[str]:
    """Hints on the last state: resolution of the crack, drains, tension at the heel."""
    case, messages, crack = results.case, [], last["crack_length"]
    element = case.joint_length / case["n_joint"]
    if crack > 0 and not (case.accuracy or case.geometry or "quake" in results.info):
        messages.append(
            f"the crack ({crack:.3g} m) ends somewhere in an element of {element:.2g} m; "
            "--accuracy 3% chooses the mesh and estimates the error"
        )
    if has_drains(case) and len(results.joint["time"]):  # a section's mesh has a node there
        away = np.abs(results.at()["s"] - case["drain_x"]).min()
        if away > AT_DRAINS * case.joint_along:
            messages.append(
                f"the mesh has no node at the drains (drain_x = {case['drain_x']:g} m): the "
                f"nearest is {away:.2g} m away"
            )
    if has_drains(case) and crack > case["drain_x"]:
        unchanged = "" if case["uplift"] == "cracked" else "; the model keeps their effect"
        messages.append(
            f"the crack ({crack:.3g} m) has passed the drains ({case['drain_x']:g} m){unchanged}"
        )
    if len(results.joint["time"]) and not case.law.open_tension * crack:
        rows = results.at()
        heel = rows["sigma_n_eff"][rows["s"] <= rows["s"].min()].mean()
        strength = case.law.tensile_strength
        if heel > IN_TENSION * strength > 0:
            messages.append(
                f"the heel is in tension, {heel / 1e3:.4g} kPa of the tensile strength of "
                f"{strength / 1e3:.4g} kPa"
            )
    return messages


def path_statement(results: Results) -> str:
    """The largest level of a run under displacement control, and whether its path snaps back."""
    history, case = results.history, results.case
    level, time = history["level"], history["time"]
    if not len(level):
        return "no step has converged"
    driven = (time > case["drive_begin"] - 1e-9) & (time < case["drive_end"] + 1e-9)
    load = case["rho_water"] * case["g"] * level.max()
    text = f"largest load: level {level.max():.5g} m ({load / 1e3:.5g} kPa)"
    if case["drive_by"] < 0:
        return text + "; the displacement was reversed"
    falls = bool((np.diff(level[driven]) < 0).any())
    moved = history["crest_ux"][driven], results.heel[driven]
    back = any(bool((np.diff(m) < 0).any()) for m in moved)
    text += "; the level " + ("falls while the displacement grows" if falls else "always rises")
    return text + ("; snap-back occurs" if back else "; no snap-back")


def overturning_level(case: Case) -> float:
    """Level [m] of a uniform pressure at which the rigid dam without tension turns over about its
    toe: the moment is linear in it.
    """
    at_0, at_1 = (gravity.at(case, case.times[-1], level).M for level in (0.0, 1.0))
    return at_0 / (at_0 - at_1)
