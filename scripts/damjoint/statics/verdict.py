"""The verdict of a run: whether the dam stands, how and at which joints it fails.

Only this module derives a failure from resultants; statement.py and hints.py say it in words.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from .. import ROUND_OFF
from ..arrays import Array, BoolArray
from ..input.case import Case
from ..input.values import freezes_uplift, level_unknown
from ..model.loads import COMPLETE, thermal_strains
from ..model.results import Results, row_of_joint
from . import gravity


@dataclass(frozen=True)
class Failure:
    """How the dam fails, and at which joints."""

    #: empty if it stands
    mode: str = ""
    #: numbers of the joints; empty if none is known to fail
    joints: tuple[int, ...] = ()

    def at(self, case: Case) -> str:
        """The names of the joints of a case; empty if it has only one."""
        return case.named(self.joints)


@dataclass(frozen=True)
class Bound:
    """A bound of statics that a state has reached."""

    #: overturning or sliding; empty if none is reached
    mode: str = ""
    #: of overturning: distance [m] of the resultant from the toe, < 0 beyond it; of sliding: shear
    #: force [N/m]
    value: float = np.nan
    #: of sliding: shear strength [N/m]
    strength: float = np.nan
    #: numbers of the joints
    joints: tuple[int, ...] = ()


def verdict(results: Results) -> str:
    """One of: stands, sliding, overturning, broken through, out of range, not converged,
    interrupted; a failure with its joint if there are several: "sliding on base".

    "sliding" also where the whole joint has slipped or opened, or its shear force exceeds its
    strength, and only the hardening of the joint resists.
    """
    why = failure(results)
    joint = why.at(results.case)
    return f"{why.mode} on {joint}" if joint else why.mode or "stands"


def failure(results: Results) -> Failure:
    """How the dam fails; a mode without joints if it is not known where."""
    if not results.last:
        return why_at_first(results.case)
    if results.stopped:
        return why_stopped(results)
    sliding = sliding_joints(results)
    return Failure("sliding", sliding) if sliding else Failure()


def failed(results: Results) -> bool:
    """Whether the exit code is 1: stopped, or sliding on a hardening that the user has not set."""
    if results.stopped or not results.last:
        return True
    sliding = sliding_joints(results)
    joints = [results.case.joints[k] for k in sliding]
    hardening_set = all(j.law.hardening_parameter and j.hardening_requested for j in joints)
    return bool(sliding) and not hardening_set


def decisive_joint(results: Results) -> int:
    """The number of the joint at which the dam fails; of a dam that stands, of the one with the
    least SSF, or if none has one, that is cracked or has slipped over the largest part of its
    length; but for joints between bodies that other joints hold.
    """
    if len(results.case.joint_names) == 1:
        return 0
    if failing := failing_joints(results):
        return failing[0]
    if not results.last:
        return 0

    def reserve(number: int) -> tuple[bool, float, float]:
        joint = results.joints[number]
        damaged = max(joint.last[n] for n in ("crack_length", "slip_length"))
        internal = results.case.graph.is_internal(number)
        return internal, sliding_factor(joint, joint.last), -damaged / joint.case.joint_along

    return min(range(len(results.joints)), key=reserve)


def sliding_factor(results: Results, state: Mapping[str, float]) -> float:
    """SSF of the only joint in a row of its history; infinite if its law does not limit shear."""
    if not results.case.law.has_friction:
        return np.inf
    forces = state["N"], state["T"], state["bonded_length"]
    return gravity.sliding_factor(results.case, *forces)


def failing_joints(results: Results) -> tuple[int, ...]:
    """The joints at which the dam fails, by number; empty if it stands or that is not known."""
    why = failure(results)
    return (0,) if why.mode and not results.case.of_joints else why.joints


def sliding_joints(results: Results) -> tuple[int, ...]:
    """The joints that alone hold what is above and slide, see `slides_from`."""
    sliding = [
        k for k, joint_result in enumerate(results.joints) if slides_from(joint_result) is not None
    ]
    return results.case.graph.separating(sliding)


def slides_from(results: Results) -> float | None:
    """The level [m] from which on the whole joint, the only one of these results, has slipped or is
    open, or its shear force exceeds its strength; None if it does not, or if a dam that has slipped
    stands by the joint law.
    """
    if results.case.law.stands_slipped:
        return None
    return exceeded_from(results) if strength_known(results.case) else slipped_from(results)


def strength_known(case: Case) -> bool:
    """Whether mu N + c L is the strength of the only joint, a straight one in 2D, until it hardens:
    a larger shear force is held by the hardening alone, also where a point sticks, and a smaller
    one by the strength, also where each point has slipped once.
    """
    return bool(case.law.hardening_parameter) and case["dim"] == 2 and case.has_straight_joint


def exceeded_from(results: Results) -> float | None:
    """The level [m] from which on the shear force exceeds mu N + c L; None if it does not."""
    case, history = results.case, results.history
    cohesion = case.law.shear_resistance(0.0, case.joint_along, 0.0, 0.0)
    strength = case.law.mu * history["N"] + cohesion
    exceeds = np.abs(history["T"]) > (1 + EXCEEDED) * strength
    return level_from(results, exceeds) if exceeds[-1] else None


def slipped_from(results: Results) -> float | None:
    """The level [m] from which on the whole joint has slipped or is open; None if a part sticks.

    A point that has slipped once counts as slipped. By the integration points of every
    step, or by the nodes at the last requested level. A change of temperature can let every point
    slip, in opposite directions: with it the shear force has to reach the strength, too.
    """
    if thermal_strains(results.case, COMPLETE):
        resistance = shear_resistance(results, results.last["N"])
        if abs(results.last["T"]) < (1 - AT_BOUND) * resistance < np.inf:
            return None
    history, base = results.history, results.case.joint_length
    slipped = np.maximum(history["slip_length"], history["crack_length"]) > base * (1 - ROUND_OFF)
    if slipped[-1]:
        return level_from(results, slipped)
    rows = results.at() if len(results.joint["time"]) else {}
    if rows and np.all((rows["damage"] >= 1) | (rows["slip"] > 0)):
        return float(rows["level"][0])
    return None


def level_from(results: Results, holds: BoolArray) -> float:
    """The level [m] of the first of the last steps, in all of which a condition holds; holds: in
    which steps it does.
    """
    others = np.flatnonzero(~holds)
    return float(results.history["level"][others[-1] + 1 if len(others) else 0])


def why_stopped(results: Results) -> Failure:
    """Out of range, sliding, overturning, broken through or not converged.

    Out of range: under displacement control the level of the next step, by extrapolation, would be
    below 0 or above the highest allowed. A failure is named if the equilibrium path shows its
    mechanism or the last converged state has reached a bound of statics; else the run has not
    converged.
    """
    case, last = results.case, results.last
    ahead = 2 * last["level"] - [0.0, *results.history["level"]][-2]
    if level_unknown(case) and not 0 <= ahead <= case.highest_level:
        return Failure("out of range")
    shown = results.info.get("mechanism") or {}
    if shown.get("mode"):
        return Failure(shown["mode"], tuple(shown.get("joints", ())))
    reached = bound(results)
    return Failure(reached.mode or "not converged", reached.joints)


def shear_resistance(results: Results, normal: float) -> float:
    """Shear force [N/m] that the joint, the only one of these results, transmits at the last saved
    state under an effective normal force: mu N and, point by point, what the law has more than mu
    times the pressure. Tension presses on the other points. Where a joint has broken at once it is
    the strength before, of the undamaged joint. Infinite if its law has no bound.
    """
    law, length = results.case.law, results.case.joint_along
    if not len(results.joint["time"]) or results.info.get("broken_at_once"):
        return law.shear_resistance(normal, length, 0.0, 0.0)
    rows = results.at()
    stress = rows["sigma_n_eff"]
    more = law.shear_strength(stress, rows["damage"], rows["slip"]) + law.mu * stress
    return law.mu * normal + mean_along(rows["s"], more) * length


#: By how much a shear force exceeds a strength, over it, if that is more than rounding [-].
EXCEEDED = 1e-6
#: Relative distance to a bound of statics within which a state has reached it: the last step of a
#: run is known to 1/1024 of the step between two levels.
AT_BOUND = 5e-3
#: Distance of the resultant from the toe, over the joint's length, within which the dam overturns.
ARM_AT_TOE = 0.01
#: The same over the length of an element of the joint, if that is more: the last integration point
#: is up to 0.2 elements from the toe.
ELEMENTS_AT_TOE = 0.5


def bound(results: Results) -> Bound:
    """The bound of statics that the last state has reached. Joints without reserve are checked
    first: one without a crack has its tension, one on a hardening that the user has set its slip.
    """
    case = results.case

    def has_reserve(joint: tuple[int, Results]) -> tuple[bool, bool]:
        last = joint[1].last
        return joint[1].case.hardening_requested, not last["crack_length"] + last["process_zone"]

    for k, joint_result in sorted(enumerate(results.joints), key=has_reserve):
        reached = bound_on_joint(joint_result)
        if reached.mode and case.separates((k,)):
            return replace(reached, joints=(k,))
    return Bound()


def bound_on_joint(results: Results) -> Bound:
    """The bound that the only joint of these results has reached.

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
        return Bound("overturning", arm)
    if last["T"] >= (1 - AT_BOUND) * resistance:
        return Bound("sliding", last["T"], resistance)
    return Bound()


#: Moments that differ by more, over N times the base, belong to different cracks.
SAME_CRACK = 0.01


def highest_by_statics(case: Case, last: dict[str, float]) -> tuple[float, str, str]:
    """The level [m] above which no equilibrium exists, how the dam fails, and at which joint, if
    there are several; infinite and empty where statics gives no bound.

    last: the last row of the history.
    """
    bounds = (
        (*highest_on_joint(joint, row_of_joint(last, k)), case.named((k,)))
        for k, joint in enumerate(case.joints)
        if case.separates((k,))
    )
    return min(bounds, default=(np.inf, "", ""))


def has_bounds(case: Case) -> bool:
    """Whether statics bounds the resultants on the only joint: they follow from loads and crack."""
    return not (case.geometry or case["uplift"] == "flow" or freezes_uplift(case))


def reserves(case: Case, state: gravity.GravityMethod) -> dict[str, float]:
    """The least moment [N m/m] and the largest shear [N/m] of a case's only joint, beyond those of
    a state, by how the dam fails where one is negative.

    Whatever the distribution of stress: with the tensile strength f over the length l that is not
    cracked, M >= -f l^2/2, and the shear is at most the law's `shear_bound`.
    """
    law, length = case.law, state.uncracked
    return {
        "overturning": state.M + law.tensile_strength * length**2 / 2,
        "sliding": float(law.shear_bound(np.array(state.N), length)) - state.T,
    }


def highest_on_joint(case: Case, last: dict[str, float]) -> tuple[float, str]:
    """The level [m] above which no equilibrium of a case's only joint exists, and how the dam fails
    there, see `highest_by_statics`.

    By its `reserves`; the crack does not close as the level rises. A law whose open points transmit
    tension has l = the whole joint.
    """
    from scipy.optimize import brentq  # half of a run's start

    if not has_bounds(case):
        return np.inf, ""
    time = min(last["time"], case.times[-1])
    crack = 0.0 if case.law.open_tension else last["crack_length"]

    def block(level: float) -> gravity.GravityMethod:
        return gravity.with_crack(case, time, level, crack)

    def reserve(mode: str, level: float) -> float:
        return reserves(case, block(level))[mode]

    bounds = [(np.inf, "")]
    at_last = block(last["level"])
    if abs(at_last.M - last["M"]) < SAME_CRACK * abs(at_last.N) * case.joint_along:
        now, most = (reserves(case, state) for state in (at_last, block(case.highest_level)))
        bounds += [
            (brentq(partial(reserve, mode), last["level"], case.highest_level), mode)
            for mode in now
            if now[mode] > 0 > most[mode]
        ]
    return min(bounds)


def why_at_first(case: Case) -> Failure:
    """How a dam without any step fails at the first time of its case, by the `reserves` of its
    joints without a crack; not converged if statics does not show that it fails.
    """
    time = case.times[0]
    level = case.level_at(time)
    if case["drive"] == "level":
        for k, joint in enumerate(case.joints):
            if has_bounds(joint) and case.separates((k,)):
                block = gravity.with_crack(joint, time, level, 0.0)
                for mode, reserve in reserves(joint, block).items():
                    if reserve < 0:
                        return Failure(mode, (k,))
    return Failure("not converged")


def mean_along(s: Array, values: Array) -> float:
    """The mean of values (n,) at positions s (n,) [m] along a joint, some of which may be equal."""
    position, inverse = np.unique(s.round(9), return_inverse=True)
    values = np.bincount(inverse, values) / np.bincount(inverse)
    return float(np.sum((values[1:] + values[:-1]) / 2 * np.diff(position)) / np.ptp(position))


#: K_N h/E beyond which a joint is stiff for its mesh: the published points make its node stresses
#: oscillate, and convergence is hard.
STIFF_JOINT = 100


def stiffness_ratio(results: Results) -> float:
    """K_N h/E: the joint's stiffness over that of the bulk within an element's length h."""
    case = results.case
    length = case.joint_length / case["n_joint"]
    return case["K_N"] * length / min(case["E_dam"], case["E_found"])


def overturning_level(case: Case) -> float:
    """Level [m] of a uniform pressure at which the rigid dam without tension turns over."""
    at_0, at_1 = (gravity.at(case, case.times[-1], level).M for level in (0.0, 1.0))
    return at_0 / (at_0 - at_1)
