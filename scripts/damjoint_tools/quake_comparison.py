"""What further runs of a random earthquake, and closed forms, say of it.

Each check returns numbers for the result file, and the rules that they violate, in words.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from damjoint_witness.earthquake import Shaken

from . import quake_equations
from .random_quakes import (
    CLOSED_FORM,
    ELASTIC,
    EQUATIONS,
    GETDP,
    HALVED,
    REVERSED,
    STRONGER,
    RandomQuake,
)

#: Numbers of the checks, by the columns of the result file.
MEASURES = {
    "residual": "largest residual of the equations of all unknowns, over the static loads",
    "energy_lost": "energy that the time integration takes, over the largest energy",
    "order": "order of the time integration, by steps of dt, dt/2 and dt/4, elastic joint",
    "change_by_dt": "change of the residual slip by half the time step, over the largest slip",
    "slip_if_stronger": "largest slip with 1.25 times the friction and cohesion, over that without",
    "asymmetry": "difference from the reversed motion and from 100 times a hundredth of the record",
    "engines": "difference between the engines, over the largest value",
    "engines_at_dt": "the same by steps of dt, where they find different equilibria of a step",
    "closed_form": "difference from the rigid block's slip, over its largest slip",
}

#: Tolerances of MEASURES: a step has a residual of 1e-9, and the small motion is a hundredth.
TOLERANCES = {"asymmetry": 1e-5, "engines": 1e-5}
#: Error of the measured order.
ORDER_TOLERANCE = 0.3
#: Factor of the strengths.
STRONGER_BY = 1.25
#: Times that differ by less are the same [s].
SAME_TIME = 1e-9
#: How many times shorter steps are in which the engines are compared again.
SHORTER = 8
#: Share of the record in the small motion.
SMALL = 0.01
#: Time step of the closed form [s].
FINE_STEP = 1e-5
#: Slip that is nothing [m], in comparisons.
NO_SLIP = 1e-6

#: Runs a scene with further options of the command, and returns its files.
Again: TypeAlias = Callable[..., Shaken]
#: Numbers, and violated rules.
Checked: TypeAlias = tuple[dict[str, float], list[str]]


def further_checks(scene: RandomQuake, run: Shaken, again: Again) -> Checked:
    """Return the numbers of all checks of a scene, and the rules that they violate."""
    measures, findings = dict[str, float](), list[str]()
    for check in scene.checks:
        numbers, violated = CHECK_BY_NAME[check](scene, run, again)
        measures |= numbers
        findings += violated
    for name in TOLERANCES.keys() & measures:
        if not measures[name] <= TOLERANCES[name]:
            findings.append(f"{name}: {measures[name]:.3g}, {MEASURES[name]}")
    return measures, findings


def equations(scene: RandomQuake, run: Shaken, again: Again) -> Checked:
    """Check the equations of all unknowns at each step, and the balance of energy."""
    numbers = quake_equations.measures(scene.case)
    measures = {"residual": numbers["residual"], "energy_lost": numbers["lost"]}
    violated = []
    if not numbers["residual"] <= quake_equations.RESIDUAL_TOLERANCE:
        violated.append(f"equations: residual {numbers['residual']:.3g} of the static loads")
    conserves = run.values["hht_alpha"] == 0
    room = quake_equations.ENERGY_TOLERANCE
    lost, rise = numbers["lost"], numbers["rise"]
    if not lost >= -room or (conserves and not (lost <= room and rise <= room)):
        violated.append(f"energy: {lost:.3g} lost, {rise:.3g} gained at rest of the ground")
    return measures, violated


def halved(scene: RandomQuake, run: Shaken, again: Again) -> Checked:
    """Run with steps of half the length; of an elastic joint also with a quarter, which gives the
    order, and measure the change of the residual slip of other joints.
    """
    dt = run.found["dt"]
    half = again(scene.changed(dt=dt / 2))
    if scene.kind != ELASTIC:
        slips = [
            (joint.residual_slip, other.residual_slip, np.abs(joint.rows["slip_mean"]).max())
            for joint, other in zip(run.joints, half.joints, strict=True)
        ]
        before, after, largest = max(slips, key=lambda slip: slip[2])
        return {"change_by_dt": abs(after - before) / largest} if largest > NO_SLIP else {}, []
    quarter = again(scene.changed(dt=dt / 4))
    crest = [
        files.rows["crest_ux"][step - 1 :: step]
        for files, step in ((run, 1), (half, 2), (quarter, 4))
    ]
    number = min(map(len, crest))  # the last step may end after the record
    changes = np.linalg.norm(np.diff([values[:number] for values in crest], axis=0), axis=1)
    order = float(np.log2(changes[0] / changes[1]))
    # published: of first order, with a small part of that order
    least = 1 if scene.case["time_integration"] == "published" else 2
    right = least - ORDER_TOLERANCE < order < 2 + ORDER_TOLERANCE
    return {"order": order}, [] if right else [f"order: {order:.3g}"]


def stronger(scene: RandomQuake, run: Shaken, again: Again) -> Checked:
    """Run with greater friction and cohesion, and measure the largest slip of any joint."""
    case = scene.case
    strengths = {
        name: tuple(STRONGER_BY * joint[name] for joint in case.joints)
        for name in ("mu", "adhesion")
    }
    other = again(scene.changed(**strengths))
    before, after = (
        max(np.abs(joint.rows["slip_mean"]).max() for joint in files.joints)
        for files in (run, other)
    )
    return {"slip_if_stronger": after / before} if before > NO_SLIP else {}, []


def reversed_motion(scene: RandomQuake, run: Shaken, again: Again) -> Checked:
    """Compare the motion with those of the reversed record and of a small part of it, which are
    the same times a factor for a linear joint.
    """
    scale, tolerance, worst = scene.case["record_scale"], scene.case["tolerance"], 0.0
    for factor in (-1.0, SMALL):
        residual = abs(factor) * tolerance  # as small beside the loads of the motion
        other = again(scene.changed(record_scale=factor * scale, tolerance=residual))
        for joint, changed in zip(run.joints, other.joints, strict=True):
            values, others = since_static(joint), since_static(changed)
            worst = max(
                worst,
                *(
                    float(np.abs(others[name] / factor - values[name]).max())
                    / float(np.abs(values[name]).max())
                    for name in values
                ),
            )
    return {"asymmetry": worst}, []


def since_static(run: Shaken) -> dict[str, np.ndarray]:
    """Return columns of quake.csv as differences from the static state."""
    rows, still = run.rows, run.static_row()
    result = {name: rows[name] for name in ("crest_ux", "crest_ax", "slip_mean")}
    return result | {name: rows[name] - still[name] for name in "NTM"}


def getdp(scene: RandomQuake, run: Shaken, again: Again) -> Checked:
    """Compare with the reference GetDP model.

    A long step in which a joint softens can have several equilibria, of which the engines may find
    different ones: where they differ, they are compared with shorter steps.
    """
    options = "--engine", "getdp"
    difference = differences(run, again(scene, *options))
    if difference <= TOLERANCES["engines"]:
        return {"engines": difference}, []
    short = scene.changed(dt=run.found["dt"] / SHORTER)
    same = differences(again(short), again(short, *options))
    return {"engines": same, "engines_at_dt": difference}, []


def differences(run: Shaken, other: Shaken) -> float:
    """Return the largest difference between the rows of two engines over the largest value of a
    column, of the slips over the largest slip; inf with other time steps. The reference may stop,
    where none of its steps converges, and does not halve the step of an impact: up to there.
    """
    rows, others = run.rows, other.rows
    count = len(others["time"])
    if other.files.stopped:
        rows = {name: column[:count] for name, column in rows.items()}
    common = min(len(rows["time"]), count)
    other_steps = np.abs(rows["time"][:common] - others["time"][:common]) > SAME_TIME
    first = int(np.argmax(other_steps)) if other_steps.any() else common
    if first < common and first > 0 and rows["dt"][first] < others["dt"][first]:
        rows, others = ({n: column[:first] for n, column in t.items()} for t in (rows, others))
    elif len(rows["time"]) != count or first < count:
        return np.inf
    names = [n for n in others if not n.startswith(("iterations", "residual", "shear_reserve"))]
    slips = [name for name in names if name.startswith("slip")]
    largest = max(np.abs(rows[name]).max() for name in slips)
    worst = 0.0
    for name in names:
        scale = largest if name in slips else np.abs(rows[name]).max()
        worst = max(worst, float(np.abs(others[name] - rows[name]).max() / (scale or 1.0)))
    return worst


def closed_form(scene: RandomQuake, run: Shaken, again: Again) -> Checked:
    """Compare the slip with that of Newmark's rigid block (1965) at every step.

    Where the block stops or turns, its velocity has errors that last while it slides: within a step
    at most mu g dt, and what the joint's spring gives back, 2 mu N / sqrt(K_T L m).
    """
    rows, v, exact = run.rows, run.values, sliding_block(run)
    error, largest = np.abs(rows["slip_mean"] - exact).max(), np.abs(exact).max()
    sliding = rows["dt"][np.abs(np.diff(exact, prepend=0.0)) > 0].sum()
    holding, stiffness = np.abs(rows["T"]).max(), v["K_T"] * run.section.length
    spring = 2 * holding / np.sqrt(-run.unit_loads[0, 0] * stiffness)
    velocity = v["mu"] * v["g"] * rows["dt"].max() + spring
    room = velocity * sliding + 2 * holding / stiffness
    violated = [f"closed form: slip off by {error:.3g} m"] if error > room else []
    return {"closed_form": error / largest} if largest > NO_SLIP else {}, violated


def sliding_block(run: Shaken) -> np.ndarray:
    """Return the slip (n,) at the rows of a rigid block on a level joint with dry friction."""
    rows, unit, static = run.rows, run.unit_loads, run.by_hand()
    time = np.arange(0, rows["time"][-1] + FINE_STEP, FINE_STEP)
    ground = [np.interp(time, rows["time"], rows[f"ground_a{axis}"]) for axis in "xy"]
    pushed = static[0] + unit[0, 0] * ground[0] + unit[1, 0] * ground[1]
    normal = static[1] - run.static_row()["U"] + unit[0, 1] * ground[0] + unit[1, 1] * ground[1]
    most, mass = run.values["mu"] * np.maximum(normal, 0), -unit[0, 0]
    slip, v, slips = 0.0, 0.0, []
    for push, friction in zip(pushed, most, strict=True):
        if v == 0 and abs(push) <= friction:
            slips.append(slip)
            continue
        against = np.sign(v) if v else np.sign(push)
        now = v + FINE_STEP * (push - against * friction) / mass
        now = 0.0 if v * now < 0 else now
        slip += FINE_STEP * (v + now) / 2
        v = now
        slips.append(slip)
    return np.interp(rows["time"], time, slips)


CHECK_BY_NAME: dict[str, Callable[[RandomQuake, Shaken, Again], Checked]] = {
    EQUATIONS: equations,
    HALVED: halved,
    STRONGER: stronger,
    REVERSED: reversed_motion,
    GETDP: getdp,
    CLOSED_FORM: closed_form,
}
