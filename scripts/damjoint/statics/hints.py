"""Hints on a result besides its verdict: limits of the model, what to change."""

from __future__ import annotations

import numpy as np

from ..arrays import Table
from ..input.case import Case
from ..input.values import flows_in_time, has_drains
from ..laws import Evidence
from ..model import process_zone
from ..model.results import Results
from ..units import STRESSES, with_unit
from . import gravity
from .statement import level_of_growth
from .verdict import STIFF_JOINT, stiffness_ratio, verdict

#: Depth and width of the foundation over the dam's height below which the crack is too long: a 45 m
#: dam at 45 m has a crack of 10.7, 5.3, 4.2, 3.2 m with a foundation of 5, 34, 60, 120 m.
LEAST_FOUNDATION = 1.5
#: K_N L/E below which the joint is softer than the dam: the stress is that of a rigid block.
SOFT_JOINT = 1
#: Bulk modulus of water [Pa].
WATER_MODULUS = 2.2e9
#: Change of pressure in a step of water in time, over that of the highest water, that is noted [-].
LARGE_MOVE = 0.5


def hints(results: Results) -> list[str]:
    """Hints besides the verdict: limits of the model, what to change; of several joints by name."""
    case, of_joints = results.case, list[str]()
    for k, joint_result in enumerate(results.joints):
        name = case.named((k,))
        of_joints += (f"{name}: {hint}" if name else hint for hint in hints_on_joint(joint_result))
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


#: Reynolds number up to which flow between parallel plates is laminar [-].
TURBULENT = 2000


def turbulence(case: Case, rows: Table) -> str:
    """What is said of flow that is not laminar, by rows of one joint; else empty."""
    if case["uplift"] != "flow" or not len(rows["U"]):
        return ""
    steady = 2 * np.abs(rows.get("flux", 0.0)) / case["visc"]
    number = float(np.max(rows.get("Re", steady)))
    if number <= TURBULENT or case["turbulent"]:
        return ""
    return (
        f"the Reynolds number of the flow reaches {number:.3g}: beyond {TURBULENT} it is "
        "turbulent, and resists more than the laminar film of the model; turbulent = 1"
    )


def hints_on_run(results: Results) -> list[str]:
    """Hints on the model as a whole, on the path, and on the last state of each joint."""
    messages = [*hints_on_model(results.case), *hints_on_path(results), *hints_on_time(results)]
    growth, stopped = results.info.get("unstable_growth"), verdict(results) == "not converged"
    for k, joint_result in enumerate(results.joints if results.last else []):
        name, last = results.case.named((k,)), joint_result.last
        share = tension_share(joint_result.case, last)
        evidence = Evidence(last["crack_length"], bool(growth) or stopped, share)
        of_joint = [*joint_result.case.law.hints(evidence), *hints_on_state(joint_result, last)]
        of_joint += filter(None, [turbulence(joint_result.case, joint_result.history)])
        messages += (f"{name}: {hint}" if name else hint for hint in of_joint)
    return messages


def hints_on_model(case: Case) -> list[str]:
    """Hints on the dimension and on the size of the foundation."""
    messages, reach = list[str](), min(case["found_side"], case["found_depth"])
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
    return messages


def hints_on_path(results: Results) -> list[str]:
    """Hints on what depends on the load steps, or on the engine."""
    messages = list[str]()
    if results.info.get("weight_with_water") and results.last:
        messages.append(
            "the weight alone has not converged: it acts with the first level, and the state may "
            "depend on the load steps"
        )
    if levels := results.info.get("unstable_growth"):
        messages.append(
            f"unstable crack growth at level {min(levels):.4g} m: the state after it depends on "
            "steps and mesh"
        )
    for begin, end in results.info.get("broken_at_once", ()):
        messages.append(
            f"from level {begin:.5g} to {end:.5g} m a joint breaks at once, and no shorter steps "
            "lead there: what is left of its strength may depend on the steps"
        )
    if steps := results.info.get("passed_over"):
        (begin, _), (_, end) = steps[0], steps[-1]
        where = f"from level {begin:.5g} to {end:.5g} m"
        several = f"{len(steps)} load steps {where} pass"
        messages.append(
            (several if len(steps) > 1 else f"the load step {where} passes")
            + " over a limit point, as a half of it leads to no equilibrium: the state after it "
            "depends on the steps"
        )
    # of the same digits where a step reaches just above the first one, so that it is passed twice
    digits = (tuple(f"{h:.4g}" for h in both) for both in results.info.get("limit_points", ()))
    for limit, lowest in dict.fromkeys(digits):
        messages.append(
            f"unstable crack growth at level {limit} m: along the equilibrium path the level falls "
            f"to {lowest} m before it rises again"
        )
    level = level_of_growth(results)
    if level is not None and results.case["drive"] == "level":
        messages.append(
            f"levels above {level:.5g} m are reached after unstable crack growth: damjoint "
            "critical finds the highest level of the continuous branch"
        )
    if results.info.get("engine") == "getdp" and verdict(results) == "not converged":
        messages.append(
            "the engine getdp does not follow the equilibrium path beyond a limit point: "
            "--engine condensed does"
        )
    return messages


def hints_on_time(results: Results) -> list[str]:
    """Hints on steps of water that flows in time."""
    case, messages = results.case, list[str]()
    timed = [joint for joint in case.joints if flows_in_time(joint)]
    if timed and case["storage"] == 0 and verdict(results) == "not converged":
        width = max(joint["aperture_min"] for joint in timed)
        messages.append(
            "storage = 0: a film without compressibility is much stiffer in a short step than the "
            f"joint; water in aperture_min has storage = {width / WATER_MODULUS:.2g}"
        )
    time, move = results.info.get("pressure_moves") or (0.0, 0.0)
    highest = case["rho_water"] * case["g"] * max(case.levels)
    if move > LARGE_MOVE * highest:
        messages.append(
            f"in the step to t = {time:.4g} the pressure in the joint changes by {move:.3g} Pa "
            "more than the levels: a step of this length may have several equilibria, and the "
            f"state then depends on the steps; pressure_step = {LARGE_MOVE * highest:.2g} halves it"
        )
    return messages


def tension_share(case: Case, last: dict[str, float]) -> float:
    """Part of the overturning moment that tension of open points balances; nan: not known."""
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
    for zone in process_zone.too_short(results):
        advice = f"; n_joint = {zone.least} or --accuracy resolves it"
        if zone.least > process_zone.MOST:
            advice = f", whatever n_joint: {zone.least} elements would be needed"
        messages.append(
            f"the fracture process zone is {zone.length:.2g} m long ({zone.formula}), less than "
            f"{process_zone.LEAST} elements of {element:.2g} m: the crack depends on the mesh"
            f"{advice}"
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
    fades = has_drains(case) and case["uplift"] == "cracked" and not case.geometry
    if fades and crack and case["drain_x"] - element < crack <= case["drain_x"]:
        messages.append(
            f"the crack ({crack:.3g} m) ends in the element before the drains "
            f"({case['drain_x']:g} m), in which it ends their effect by and by: the uplift depends "
            "on the mesh there"
        )
    if len(results.joint["time"]) and not case.law.open_tension * crack:
        rows = results.at()
        heel = rows["sigma_n_eff"][rows["s"] <= rows["s"].min()].mean()
        strength = case.law.tensile_strength
        if heel > IN_TENSION * strength > 0:
            messages.append(
                f"the heel is in tension, {with_unit(heel, STRESSES)} of the tensile strength of "
                f"{with_unit(strength, STRESSES)}"
            )
    return messages
