"""Whether a run that has stopped early had to: limit analysis from both sides.

*No equilibrium can be*: no distribution of stress over the integration points of a joint within the
strength that is left there has the resultants of the loads of the next step (a linear program). The
strength is what the law has left after the last state; where the law is not convex, its convex
hull, so that a joint whose cohesion is lost point by point may fail below the bound. Or the shear
exceeds what friction and the cohesion that is left carry under the tension that acts in the last
state. *Equilibrium is certain*: friction alone carries the resultant, well within the base, under
the most uplift. Between the two a stop is undecided.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from .files import Files, Table, rows_where
from .reader import Request, RequestedJoint, Values
from .statics import along_joint, loads

#: Least safety of a rigid block whose equilibrium counts as certain [-].
CERTAIN_SAFETY = 1.05
#: Least distance of its resultant from the ends of the joint [elements].
ELEMENTS_INSIDE = 3
#: The same over the length of the joint [-].
SHARE_INSIDE = 0.05
#: Largest load factor that is looked for.
MOST = 10.0
#: Damage at the peak of law = endo.
PEAK_OF_ENDO = 0.0619

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Forces:
    """Effective normal force and shear [N/m], moment about the toe [N m/m] in a joint."""

    N: float
    T: float
    M: float


@dataclass(frozen=True)
class Joint(RequestedJoint):
    """A joint of a run that has stopped."""

    files: Files
    #: rows of steps.csv of the joint's integration points after the last step
    points: Table

    @property
    def last(self) -> dict[str, float]:
        """The last row of the history of the joint; zeros before the first one."""
        rows = self.files.history_of(self.number).items()
        return {name: float(v[-1]) if len(v) else 0.0 for name, v in rows}

    def forces(self, most_uplift: bool) -> Forces:
        """Forces at the smallest step beyond the last state: under the uplift of that state, or the
        most that can be, the highest head along the whole joint.
        """
        v, last, request = self.values, self.last, self.request
        time = min(last["time"] + v["smallest_step"], request.times[-1])
        level, tail = request.level_at(time), request.tail_at(time)
        total, T, moment = along_joint(self.section, loads(self.section, v, time, level, tail))
        U, M_U, length = last["U"], last["M_U"], self.section.length
        if most_uplift and v["uplift"] != "none":
            low = min(self.section.heel[1], self.section.toe[1])
            head = max(level + v["joint_head_offset"], tail) - low
            pressure = max(v["rho_water"] * v["g"] * head, 0.0)
            U, M_U = pressure * length, pressure * length**2 / 2
        return Forces(total - U, T, moment - M_U)


def friction(v: Values) -> float:
    """Friction coefficient of a joint; the law mixed has none."""
    return 0.0 if v["law"] == "mixed" else float(v["mu"])


def strengths(rows: Table, v: Values) -> tuple[Array, Array]:
    """Largest tension (q,) that points have left, and shear (q,) at this tension, from which on it
    grows by mu times the pressure [Pa]; infinite without a bound.
    """
    damage, f, c, mu = rows["damage"], v["sigma_max"], v["adhesion"], v["mu"]
    if v["law"] == "bond":
        return f * (1 - damage), c * (1 - damage)
    if v["law"] == "mixed":  # the rectangle around the ellipse
        return f * (1 - damage), np.sqrt(v["K_T"] / v["K_N"]) * f * (1 - damage)
    if v["law"] == "rupture":
        left = 1 - damage if v["softening"] == "exponential" else np.where(damage < 1, 1.0, 0.0)
        return f * left, np.full(len(damage), np.inf)
    if v["law"] == "friction":  # the apex of the cone, and what slip has added
        endless = np.inf if v["hardening_requested"] and v["pena_tang"] else 0.0
        return np.full(len(damage), c / mu), v["pena_tang"] * rows["lambda"] + endless
    left = endo_strength(np.maximum(damage, PEAK_OF_ENDO)) / endo_strength(PEAK_OF_ENDO)
    return f * left, (c - mu * f) * left


def endo_strength(a: Any) -> Any:
    """S/sqrt(-S') of law = endo at a damage, section 4.4 of reference/theory.md."""
    return (1 - a) ** 3 / np.sqrt(a) / np.sqrt((1 - a) ** 2 * (2.5 * a + 0.5) / a**1.5)


def load_factor(joint: Joint, forces: Forces) -> float:
    """The largest factor by which the shear force and the distance of the normal force from the
    middle of the joint can be multiplied; less than 1: no equilibrium can be.

    A linear program for compression, beyond the tension left, and shear of the points.
    """
    rows, section, mu = joint.points, joint.section, friction(joint.values)
    tension, shear = strengths(rows, joint.values)
    along = np.cos(section.slope), np.sin(section.slope)
    s = (rows["x"] - section.heel[0]) * along[0] + (rows["y"] - section.heel[1]) * along[1]
    length, number = section.length, len(s)
    middle = forces.N * length / 2
    # forces over `size` at each point, moments over the length, so that all are of the order 1
    size = max(abs(forces.N), abs(forces.T), 1e-9)
    pulled, arm, w = rows["weight"] * tension / size, 1 - s / length, rows["weight"] / size
    none = np.zeros(number)
    equal = [
        [*np.ones(number), *none, 0.0],
        [*arm, *none, (middle - forces.M) / size / length],
        [*none, *np.ones(number), -forces.T / size],
    ]
    right = [forces.N / size + pulled.sum(), middle / size / length + pulled @ arm, 0.0]
    bound = np.isfinite(shear)
    eye, zero = np.eye(number)[bound], np.zeros((int(bound.sum()), 1))
    limits = np.vstack([np.hstack([-mu * eye, sign * eye, zero]) for sign in (1, -1)])
    found = linprog(
        [*none, *none, -1.0],
        A_ub=limits if bound.any() else None,
        b_ub=np.tile((w * shear)[bound], 2) if bound.any() else None,
        A_eq=equal,
        b_eq=right,
        bounds=[(0, None)] * number + [(None, None)] * number + [(0, MOST)],
    )
    return -float(found.fun or 0.0) if found.status == 0 else 0.0


def slides(joint: Joint, forces: Forces) -> bool:
    """Whether the shear force exceeds the shear strength that is left under the normal force, and
    under the tension that acts in the last state and presses on the other points.
    """
    rows, mu = joint.points, friction(joint.values)
    tension, cohesion = strengths(rows, joint.values)
    # of the other laws the strength is linear in the normal stress, tension included
    bond = joint.values["law"] == "bond"
    pulled = np.maximum(rows["sigma_n_eff"], 0) if bond else tension
    return bool(abs(forces.T) > mu * forces.N + rows["weight"] @ (cohesion + mu * pulled))


def equilibrium_is_certain(joint: Joint) -> bool:
    """Whether there is an equilibrium beyond the last state, by the static theorem without any
    strength but friction. Not certain where grout presses on the joint, or water that has no time
    to leave a crack that closes: they may lift the dam.
    """
    v, length, block = joint.values, joint.section.length, joint.forces(most_uplift=True)
    margin = max(SHARE_INSIDE, ELEMENTS_INSIDE / v["n_joint"]) * length
    inside = block.N > 0 and margin * block.N < block.M < block.N * (length - margin)
    holds = v["law"] == "rupture" or CERTAIN_SAFETY * abs(block.T) < friction(v) * block.N
    return bool(inside and holds and not (v["grout_pressure"] or v["time_unit"]))


def judge(files: Files, request: Request, steps: Table) -> tuple[bool, str]:
    """Judge a run that has stopped: whether it is wrong that it has, and a remark.

    A remark without an error: the stop is undecided.
    """
    verdict = str(files.record["verdict"])
    if files.record["state"] != "stopped":
        return True, str(files.record["statement"])
    if not request.sections:
        return False, f"{verdict}, joints that meet: not judged"
    joints = failing(files, request, steps, verdict)
    by_level = request.joints[0]["drive"] == "level"
    if not by_level:
        return False, f"{verdict}, displacement control: the level beyond is not known"
    if all(map(equilibrium_is_certain, joints)):
        return True, f"{verdict}, but there certainly is an equilibrium"
    beyond = [(joint, joint.forces(most_uplift=False)) for joint in joints]
    least = min(load_factor(*one) for one in beyond)
    if least <= 1 or any(slides(*one) for one in beyond):
        return False, ""
    return False, f"{verdict}, below the limit analysis by a factor of {least:.4g}"


def failing(files: Files, request: Request, steps: Table, verdict: str) -> Sequence[Joint]:
    """The joints that a verdict names, or all."""
    _, _, named = verdict.partition(" on ")
    names = [joint["name"] for joint in files.record["joints"]] or [""]
    end = steps["update"] == steps["update"].max(initial=0)
    found = []
    for k, name in enumerate(names):
        if not named or name in named.split(" and "):
            rows = rows_where(steps, end & (steps["joint"] == k + 1) & (steps["weight"] > 0))
            found.append(Joint(request, k, files, rows))
    return found
