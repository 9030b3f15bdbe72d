"""What a run has found, in words: whether the dam stands, and if not, how it fails.

This is the one place that reads a failure out of resultants.
"""

from __future__ import annotations

import numpy as np

from ..scene.case import Case, has_drains
from . import gravity
from .tables import Results


def verdict(results: Results) -> str:
    """One of: stands, sliding, overturning, out of range, no convergence, no equilibrium,
    interrupted.

    "no equilibrium": not even at the first step. "sliding" also where the whole joint has slipped
    or opened and the dam stands on nothing but the joint's hardening.
    """
    if not results.last:
        return "no equilibrium"
    if results.stopped:
        return why_stopped(results)
    return "sliding" if loose_from(results) is not None else "stands"


def failed(results: Results) -> bool:
    """Whether the run's exit code has to be 1: stopped, or sliding on a hardening that nobody asked
    for.
    """
    if results.stopped or not results.last:
        return True
    asked = results.case["law"] == "friction" and results.case.hardening_asked
    return loose_from(results) is not None and not asked


def loose_from(results: Results) -> float | None:
    """The level [m] from which on the whole joint has slipped or is open; None if a part of it
    still holds.

    Once slipped, a joint counts as slipped. Seen at the integration points of every step, or at the
    nodes of the last requested level. A bond does not harden: where all of it slips there is no
    equilibrium, and a dam that has come to rest stands on friction.
    """
    if results.case["law"] == "bond":
        return None
    history, base = results.history, results.case.joint_length
    gone = np.maximum(history["slip_length"], history["crack_length"]) > base * (1 - 1e-9)
    if gone.any() and gone[-1]:
        return float(history["level"][np.flatnonzero(~gone)[-1] + 1 if not gone.all() else 0])
    rows = results.at() if len(results.joint["time"]) else {}
    if rows and np.all((rows["damage"] >= 1) | (rows["slip"] > 0)):
        return float(rows["level"][0])
    return None


def why_stopped(results: Results) -> str:
    """Out of range, overturning, sliding or no convergence, from the last converged state.

    Out of range: a driven run whose level would, in one more step like its last, be below 0 or
    above the highest that is allowed.
    Overturning: the resultant of the compression is in the base's last tenth, or, where the crack
    has crossed most of it, in its last fifth; an open point of friction pulls with c/mu.
    Sliding: the shear is within 2 % of what the joint can hold, T <= mu N + c L + H (mean slip) L
    (N holds the tension c/mu of open points, so that c acts on all of L), for a bond beyond what
    remains once it has gone, mu N; or the whole joint has let go.
    """
    case, last = results.case, results.last
    base = case.joint_length
    ahead = 2 * last["level"] - [0.0, *results.history["level"]][-2]
    if case["drive"] != "level" and not 0 <= ahead <= case.highest_level:
        return "out of range"
    crack = last["crack_length"]
    pull = case["adhesion"] / case["mu"] * crack if case["law"] == "friction" else 0.0
    arm = 0.2 if crack > 0.8 * base else 0.1
    if last["M"] + pull * (base - crack / 2) < arm * base * (last["N"] + pull):
        return "overturning"
    if case["law"] == "friction":
        hardened = case["pena_tang"] * mean_slip(results) * base
        holds = case["mu"] * last["N"] + case["adhesion"] * base + hardened
        if last["T"] > 0.98 * holds:
            return "sliding"
    if case["law"] == "bond" and last["T"] > 0.98 * case["mu"] * last["N"]:
        return "sliding"
    if last["slip_length"] > 0.98 * base:
        return "sliding"
    return "no convergence"


def movement(case: Case, crack_length: float, x: np.ndarray, moved: np.ndarray) -> str:
    """Broken through, overturning or sliding, from how a dam that has lost its equilibrium goes on.

    crack_length: [m], after it; x (n,): distance of the joint's nodes from the heel; moved (n, 3):
    the change of their jumps.

    Sliding: the joint's slip is larger than what the rotation opens at the heel.
    """
    if crack_length > case.joint_along * (1 - 1e-9):
        return "broken through"
    rotation = np.polyfit(x, moved[:, 0], 1)[0] * np.ptp(x)
    return "overturning" if -rotation > abs(moved[:, 1].mean()) else "sliding"


#: How near to a bound of the rigid block counts as there, relatively.
AT_BOUND = 1e-3


def bound(case: Case, last: dict[str, float]) -> str:
    """Which bound of the rigid block resultants have reached, in words; empty if none.

    Friction without hardening and bond hold T <= mu N + c L, a joint without tension M >= 0.
    """
    length = case.joint_along
    holds = case["mu"] * last["N"] + case["adhesion"] * length
    bounded = case["law"] == "bond" or (case["law"] == "friction" and not case["pena_tang"])
    if bounded and last["T"] >= (1 - AT_BOUND) * holds:
        return f"T = {last['T']:.5g} N/m reaches mu N + c L"
    arm = last["M"] / last["N"] if last["N"] > 0 else 0.0
    if arm < 0.01 * length:
        side = "from" if arm >= 0 else "beyond"
        return f"the resultant is {abs(arm):.3g} m {side} the toe"
    return ""


def highest_by_statics(case: Case, last: dict[str, float]) -> tuple[float, str, str]:
    """The level [m] above which a state has no equilibrium any more, how it fails and why, in
    words; infinite and empty where statics does not tell.

    Whatever the distribution of stress: with the tensile strength f, over the length l that is not
    cracked, M >= -f l^2/2, and with friction T <= mu (N + f l) + c l; the crack does not close as
    the level rises. The law friction keeps f = c/mu, of which its N has taken account, and l is the
    whole joint.
    """
    from scipy.optimize import brentq  # half of a run's start

    law, time = case["law"], min(last["time"], case.times[-1])
    if case.geometry or case["uplift"] == "flow":
        return np.inf, "", ""
    strength, _ = gravity.tensile_strength(case)
    crack = 0.0 if law == "friction" else last["crack_length"]
    block = lambda level: gravity.with_crack(case, time, level, crack)
    length = block(last["level"]).uncracked
    tension = strength * length if law == "bond" else 0.0

    def moment(level: float) -> float:
        return block(level).M + strength * length**2 / 2

    def shear(level: float) -> float:
        found = block(level)
        return case["mu"] * max(found.N + tension, 0.0) + case["adhesion"] * length - found.T

    reasons = [(moment, "overturning", "the resultant leaves the joint")]
    if law == "bond" or (law == "friction" and not case["pena_tang"]):
        reasons.append((shear, "sliding", "the shear passes what the joint holds"))
    found = [(np.inf, "", "")]
    if np.isclose(block(last["level"]).M, last["M"], 0.05):  # else the crack is another one
        for spare, mode, words in reasons:
            if spare(last["level"]) > 0 > spare(case.highest_level):
                found.append((brentq(spare, last["level"], case.highest_level), mode, words))
    return min(found)


def mean_slip(results: Results) -> float:
    """Mean slip along the joint at the last saved state [m]."""
    if not len(results.joint["time"]):
        return 0.0
    rows = results.at()
    place, inverse = np.unique(rows["x"].round(9), return_inverse=True)
    slip = np.bincount(inverse, rows["slip"]) / np.bincount(inverse)
    return float(np.sum((slip[1:] + slip[:-1]) / 2 * np.diff(place)) / np.ptp(place))


def statement(results: Results) -> str:
    """In words: why and where a run has stopped, or that the dam slides; empty if it stands."""
    case, last, found = results.case, results.last, verdict(results)
    if found == "no equilibrium":
        return "no equilibrium even at the first step"
    if results.stopped:
        hint = stiff_joint(results) if found == "no convergence" else ""
        where = f"level {last['level']:.6g} m (t = {last['time']:.6g})"
        if found == "out of range":
            return (
                f"out of range: the displacement asks for a level below 0 or above "
                f"{case.highest_level:g} m beyond {where}; the last converged state is saved"
            )
        return f"{found}{hint}: no equilibrium beyond {where}; the last converged state is saved"
    if found == "stands":
        return ""
    said = (
        f"sliding: the whole joint has slipped or is open from level {loose_from(results):.6g} m on"
    )
    if case["law"] != "friction":
        return said + "; nothing holds it along the joint"
    asked = "" if case.hardening_asked else ", a default that no joint has; set it if yours hardens"
    return (
        f"{said}; the dam stands on the hardening pena_tang = {case['pena_tang']:.4g} Pa/m{asked}"
    )


#: K_N h/E beyond which a joint is stiff for its mesh: the published points make its node stresses
#: oscillate, and convergence is hard.
STIFF = 100


def stiffness_ratio(results: Results) -> float:
    """K_N h/E: the joint's stiffness over that of the bulk within an element's length h."""
    case = results.case
    length = case.joint_length / case["n_joint"]
    return case["K_N"] * length / min(case["E_dam"], case["E_found"])


def stiff_joint(results: Results) -> str:
    """A hint to a run that has not converged, if the joint is too stiff for its elements."""
    ratio = stiffness_ratio(results)
    if ratio < STIFF:
        return ""
    why = f"the joint is too stiff for this mesh: K_N h/E = {ratio:.3g}"
    return f" ({why}; refine n_joint or lower K_N)"


#: A foundation that reaches less far than this many heights of the dam makes the crack too long: a
#: 45 m dam at 45 m has 10.7, 5.3, 4.2, 3.2 m of it with 5, 34, 60, 120 m.
FOUNDATION = 1.5
#: K_N L/E below which the joint gives way more than the dam: the stress is that of a rigid block.
SOFT = 1


def hints(results: Results) -> list[str]:
    """What an engineer should know of a result besides its verdict."""
    case, last, found = results.case, results.last, []
    ratio = stiffness_ratio(results)
    if ratio >= STIFF and case["quadrature"] == "published":
        found.append(
            f"K_N h/E = {ratio:.3g}: the joint is stiff for this mesh, its node stresses oscillate "
            "(N, T, M do not): take quadrature = full"
        )
    soft = case["K_N"] * case.joint_length / min(case["E_dam"], case["E_found"])
    if soft < SOFT:
        found.append(
            f"K_N L/E = {soft:.3g}: the joint gives way more than the dam; a closed joint of "
            "concrete on rock has 10 to 1000"
        )
    reach = min(case["found_side"], case["found_depth"])
    if case.published:
        return found
    if not case.geometry and reach < FOUNDATION * case["dam_height"]:
        found.append(
            f"the foundation reaches {reach:g} m: less than {FOUNDATION:g} heights of the dam make "
            "the crack too long"
        )
    if levels := results.info.get("ran_on"):
        found.append(
            f"at {min(levels):.4g} m the joint breaks in a burst: where it comes to rest from then "
            "on depends on steps and mesh"
        )
    releases = case["law"] == "rupture" and case["alpha"] < 2
    if releases and (levels or verdict(results) == "no convergence"):
        found.append(
            f"where it opens, law = rupture with alpha = {case['alpha']:g} lets go of its shear, "
            "and no friction takes it: the crack runs on at once; alpha = 2 keeps it, law = bond "
            "slides"
        )
    if last:
        found += seen_in(results, last)
    return found


def pulled_when_open(case: Case, last: dict[str, float]) -> str:
    """In words, what the law friction's tension c/mu of open points holds; empty if it holds
    nothing.
    """
    crack = last["crack_length"]
    if case["law"] != "friction" or not case["adhesion"] * crack:
        return ""
    tension, share = case["adhesion"] / case["mu"], ""
    if not case.geometry:
        time = min(last["time"], case.times[-1])
        block = gravity.with_crack(case, time, last["level"], 0.0)
        parts = [*(m for load in block.loads for m in load[3:]), last["M"] - block.resultant.moment]
        turning = -sum(m for m in parts if m < 0)
        pull = tension * crack * (block.body.length - crack / 2)
        share = f" ({pull / turning:.0%} of the overturning moment)" if turning else ""
    return (
        f"the joint is open over {crack:.3g} m and pulls there with adhesion/mu = "
        f"{tension / 1e3:.4g} kPa{share} at any opening, as the friction law is published: "
        "law = bond lets go"
    )


def seen_in(results: Results, last: dict[str, float]) -> list[str]:
    """What the last state shows: a crack counted in elements, drains in it, tension at the heel."""
    case, found, crack = results.case, [], last["crack_length"]
    element = case.joint_length / case["n_joint"]
    if crack > 0 and not (case.accuracy or case.geometry):
        found.append(
            f"the crack ({crack:.3g} m) ends somewhere in an element of {element:.2g} m; "
            "--accuracy 3% finds the mesh, and says how wrong it is"
        )
    if has_drains(case) and len(results.joint["time"]):  # a section's mesh has a node there
        away = np.abs(results.at()["s"] - case["drain_x"]).min()
        if away > 1e-5 * case.joint_along:
            found.append(
                f"the mesh has no node at the drains (drain_x = {case['drain_x']:g} m): the "
                f"nearest is {away:.2g} m away"
            )
    if has_drains(case) and crack > case["drain_x"]:
        kept = "" if case["uplift"] == "cracked" else "; their effect is kept all the same"
        found.append(
            f"the crack ({crack:.3g} m) has passed the drains ({case['drain_x']:g} m){kept}"
        )
    if pulled := pulled_when_open(case, last):
        found.append(pulled)
    elif len(results.joint["time"]):
        rows = results.at()
        heel = rows["sigma_n_eff"][rows["s"] <= rows["s"].min()].mean()
        strength = case["adhesion"] / case["mu"] if case["law"] == "friction" else case["sigma_max"]
        if heel > 1e-3 * strength > 0:
            found.append(
                f"the heel is in tension, {heel / 1e3:.4g} kPa of the {strength / 1e3:.4g} kPa "
                "that the joint is said to hold"
            )
    return found


def path_statement(results: Results) -> str:
    """In words, what a prescribed displacement has found: the largest level, and whether the path
    turns back.
    """
    history, case = results.history, results.case
    level, time = history["level"], history["time"]
    if not len(level):
        return "no step has converged"
    driven = (time > case["drive_begin"] - 1e-9) & (time < case["drive_end"] + 1e-9)
    load = case["rho_water"] * case["g"] * level.max()
    said = f"largest load: level {level.max():.5g} m ({load / 1e3:.5g} kPa)"
    if case["drive_by"] < 0:
        return said + "; the displacement was taken back"
    falls = bool((np.diff(level[driven]) < 0).any())
    moved = history["crest_ux"][driven], results.heel[driven]
    back = any(bool((np.diff(m) < 0).any()) for m in moved)
    said += "; the level " + ("falls while the displacement grows" if falls else "rises all along")
    return said + ("; snap-back met" if back else "; no snap-back")


def overturning_level(case: Case) -> float:
    """Level [m] of a uniform pressure at which the rigid dam without tension turns over about its
    toe: the moment is linear in it.
    """
    empty, one = (gravity.at(case, case.times[-1], level).M for level in (0.0, 1.0))
    return empty / (empty - one)
