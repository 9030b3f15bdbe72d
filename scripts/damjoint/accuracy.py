"""The accuracy asked for, measured: a scene on finer and finer meshes until its answer changes by
less.

First the load steps are halved on the coarsest mesh until that changes next to nothing. Then from
mesh to mesh the elements along the joint are halved and those of the bodies follow. Each costs
several times the one before, so that most of the time goes into the last one. The error left in a
quantity is estimated from its last changes, as Roache's grid convergence index does (J. Fluids
Eng. 116, 1994), and holds that of the load steps.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np

from . import RunError
from .engines import OnStep, Outcome
from .model.case import Case, has_plane_fields
from .model.fields import along
from .model.results import Results
from .statics.verdict import stiffness_ratio

#: What makes a finer mesh besides the sizes h_dam and h_found, which follow.
REFINED = ("n_joint", "n_layers")

#: Elements along the joint at most: in the plane, in 3D with one layer, in 3D with several.
FINEST = {"plane": 512, "slice": 128, "solid": 32}

#: The part of the accuracy that the load steps may take, and how often they are halved at most.
STEP_SHARE, HALVINGS = 0.25, 6

#: What is compared: words and unit, by name.
QUANTITIES = {
    "level": ("level found", "m"),
    "max_opening": ("largest opening", "m"),
    "crack_length": ("crack length", "m"),
    "slip_length": ("slip length", "m"),
    "slip": ("mean tangential jump", "m"),
    "crest_ux": ("crest", "m"),
    "flux": ("leakage", "kg/(m s)"),
    "toe_stress": ("stress at the toe", "Pa"),
}
#: Those that are counted in whole elements.
LENGTHS = ("crack_length", "slip_length")

#: K_N h/E up to which a joint is so soft beside the bodies that no stress concentrates at its ends.
SOFT = 1.0

#: Change of a quantity over the change before it: at best that of order 2; above the largest one,
#: where it hardly converges, the error is taken for three times the change.
BEST, WORST = 0.25, 0.75
#: Roache's factors of safety, for three meshes and for two.
SAFETY, OF_TWO = 1.25, 3.0


@dataclass(frozen=True)
class Estimate:
    """What is likely to be wrong with a quantity on the last mesh."""

    name: str
    #: the quantity at the last level that was compared
    value: float
    #: the largest error at the levels that were compared
    error: float
    #: what the error is relative to: the largest value at those levels; of an opening the joint's
    #: largest jump, in whatever direction
    scale: float
    #: an error that is let pass because the quantity is counted in elements
    slack: float = 0.0
    #: whether the accuracy is asked of it
    used: bool = True
    #: the part of the error that the load steps make
    of_steps: float = 0.0

    @property
    def relative(self) -> float:
        """The error over the scale."""
        return self.error / self.scale if self.scale else 0.0

    def within(self, accuracy: float) -> bool:
        """Whether it is as small as asked for."""
        return not self.used or self.error <= max(accuracy * self.scale, self.slack)

    @property
    def words(self) -> str:
        """In a summary."""
        words, unit = QUANTITIES[self.name]
        counted = self.name in LENGTHS and self.error
        length = f" ({self.error:.2g} {unit}, counted in elements)" if counted else ""
        of = " of the joint's largest jump" if self.name == "max_opening" else ""
        return f"{words} {percent(self.relative)}{of}{length}"


def percent(part: float) -> str:
    """A part as a percentage of two digits."""
    return f"{100 * part:.2g} %"


def solve(case: Case, engine: ModuleType, on_step: OnStep, fields: bool) -> Iterator[Outcome]:
    """The scenes of a case as the engine's `solve` gives them, each on the mesh that the case's
    accuracy asks for; on its own mesh if it asks for none.

    Adds `error_estimate` to what run.json says. Raises RunError.
    """
    if not case.accuracy:
        yield from engine.solve(case, on_step, fields)
        return
    for number, scene in enumerate(case.scenes()):

        def once(meshed: Case, number: int = number) -> Outcome:
            return next(engine.solve(meshed, lambda _, now: on_step(number, now), fields))

        yield refined(replace(scene, also_uplift=()), once)


def refined(case: Case, once: Callable[[Case], Outcome]) -> Outcome:
    """The outcome of a scene on the first mesh that is fine enough; once: what solves it on one.

    A mesh that fails or is too large leaves the outcome of the one before; so does an interruption,
    as that outcome's error. Raises RunError if there is none before.
    """
    begin = time.perf_counter()
    case, outcome, of_steps = stepped(case, once)
    (_, *finer), why = meshes(case), "no finer mesh is tried"
    tried, found = [outcome.result], []
    for meshed in finer:
        if outcome.error:
            break
        start = time.perf_counter()
        try:
            after = once(meshed)
            error = after.error
        except (RunError, MemoryError, KeyboardInterrupt) as caught:
            error = caught
        if error:
            why = f"n_joint = {meshed['n_joint']:g}: {str(error) or type(error).__name__}"
            if not isinstance(error, Exception):
                outcome = replace(outcome, error=error)
            break
        if after.result.info["mesh"] == outcome.result.info["mesh"]:
            why = "the geometry's mesh does not follow n_joint"
            break
        outcome = after
        outcome.result.info["wall_seconds"]["coarser meshes"] = start - begin
        tried.append(outcome.result)
        found = estimates(tried[-3:], of_steps)
        if all(one.within(case.accuracy) for one in found):
            why = ""
            break
    outcome.result.info["error_estimate"] = told(case.accuracy, tried, found, why)
    return outcome


def stepped(case: Case, once: Callable[[Case], Outcome]) -> tuple[Case, Outcome, dict[str, float]]:
    """The case with as many load steps as its accuracy asks for, its outcome, and the error that
    these steps leave in each quantity.

    The error of a step is of order 1 in its length, hence twice the change from halving all steps.
    """
    outcome, errors = once(case), {}
    for _ in range(HALVINGS):
        if outcome.error:
            break
        halved = halve_steps(case)
        after = once(halved)
        if after.error:
            return case, replace(outcome, error=after.error), errors
        pair = [outcome.result, after.result]
        times = [t for t in case.requested if all(t in reached(one) for one in pair)]
        values = [read(one, times) for one in pair]
        scales = {name: scale_of(pair[0], name, values, times) for name in values[0]}
        errors = {
            name: 2 * float(np.abs(np.subtract(*(v[name] for v in values))).max(initial=0.0))
            for name in values[0]
        }
        asked = {n: e for n, e in errors.items() if n != "toe_stress" and n not in LENGTHS}
        if all(e <= STEP_SHARE * case.accuracy * scales[n] for n, e in asked.items()):
            break
        case, outcome = halved, after
        errors = {name: error / 2 for name, error in errors.items()}
    return case, outcome, errors


def halve_steps(case: Case) -> Case:
    """The case with each of its load steps cut in two, none of them at the time of a level."""
    middles = [(a + b) / 2 for a, b in zip((0.0, *case.times), case.times, strict=False)]
    middles = [t + 1e-3 * (t == round(t)) for t in middles]
    return replace(case, times=tuple(sorted({*case.times, *middles})))


def meshes(case: Case) -> list[Case]:
    """The case on its own mesh, then on finer ones."""
    kind = "plane" if case["dim"] == 2 else "slice" if has_plane_fields(case) else "solid"
    found = [case]
    while 2 * found[-1]["n_joint"] <= FINEST[kind]:
        found.append(finer(found[-1]))
    return found


def finer(case: Case, times: float = 2) -> Case:
    """The case with so many times as many elements along the joint; the sizes far away follow as
    automatic ones do.
    """
    now = case.values
    values = {
        "n_joint": times * now["n_joint"],
        "n_layers": now["n_layers"] * (1 if has_plane_fields(case) else times),
        **{name: now[name] / times**0.5 for name in ("h_dam", "h_found")},
    }
    return replace(case, values=now | values)


def estimates(tried: list[Results], of_steps: dict[str, float]) -> list[Estimate]:
    """The error left on the last of two or three meshes, with that of the load steps, at every
    requested level that all of them have reached, and in the last level itself where it is not
    prescribed or not reached.
    """
    last = tried[-1]
    case = last.case
    times = [t for t in case.requested if all(t in reached(one) for one in tried)]
    values = [read(one, times) for one in tried]
    if case["drive"] == "level" and not any(one.stopped for one in tried):
        values = [{n: v for n, v in one.items() if n != "level"} for one in values]
    element = case.joint_along / case["n_joint"]
    found = []
    for name in values[-1]:
        table = np.array([one[name] for one in values])
        if not table.size:
            continue
        scale, slack = scale_of(last, name, values, times), 0.0
        error = float(left(table, name in LENGTHS).max()) + of_steps.get(name, 0.0)
        if name in LENGTHS and scale:
            error = max(error, element)
            # a little more, for lengths that differ by just an element
            slack = 1.001 * element if case.accuracy * case["n_joint"] >= 1 else 0.0
        used = name != "toe_stress" or stiffness_ratio(tried[0]) <= SOFT
        value = float(table[-1, -1])
        found.append(Estimate(name, value, error, scale, slack, used, of_steps.get(name, 0.0)))
    return found


def scale_of(
    last: Results, name: str, values: list[dict[str, list[float]]], times: list[float]
) -> float:
    """What an error is relative to, see `Estimate`."""
    if name == "max_opening" and times:
        return max(largest_jump(last, t) for t in times)
    return float(np.abs([one[name] for one in values]).max(initial=0.0))


def reached(result: Results) -> set[float]:
    """The requested times that a run has reached."""
    times = np.unique(result.joint["time"])
    return {t for t in result.case.requested if np.isclose(times, t).any()}


def read(result: Results, times: list[float]) -> dict[str, list[float]]:
    """QUANTITIES at some requested times; the level also where the run has ended."""
    from scipy.integrate import trapezoid  # half of a run's start

    case, states = result.case, [result.state(t) for t in times]
    means = [along(result.at(t)) for t in times]
    found = {
        name: [state[name] for state in states] for name in QUANTITIES if name in result.history
    }
    if case["uplift"] != "flow":
        del found["flux"]
    found["level"] = [*found["level"], result.last.get("level", 0.0)]
    found["slip"] = [trapezoid(m["delta_t1"], m["s"]) / m["s"][-1] for m in means]
    found["toe_stress"] = [m["sigma_n"][-1] for m in means]
    return {name: found[name] for name in QUANTITIES if name in found}


def largest_jump(result: Results, time: float) -> float:
    """Of the joint's nodes, in whatever direction, at a requested time [m]."""
    rows = result.at(time)
    jumps = [rows[name] for name in ("delta_n", "delta_t1", "delta_t2")]
    return float(np.linalg.norm(jumps, axis=0).max())


def left(values: np.ndarray, counted: bool) -> np.ndarray:
    """The error left in the last row of values on finer and finer meshes (two or three of them).

    Richardson's extrapolation with a factor of safety and the order that three values show, held
    between BEST and WORST, and no less than what order 2 leaves of the change before: two values
    may agree by accident. Values that go to and fro show no order: half of their range is left
    (Stern et al., J. Fluids Eng. 123, 2001). Two values leave the change at order 1, with a larger
    factor; of those counted in elements it is the last change itself.
    """
    steps = np.diff(values, axis=0)
    changes = np.abs(steps)
    if counted or len(changes) == 1:
        return (1 if counted else OF_TWO) * changes[-1]
    before, last = changes
    ratio = np.divide(last, before, out=np.full_like(last, BEST), where=before > 0)
    ratio = np.clip(ratio, BEST, WORST)
    error = np.maximum(last * ratio / (1 - ratio), before * BEST**2 / (1 - BEST))
    to_and_fro = steps[0] * steps[1] < 0
    return SAFETY * np.where(to_and_fro, np.maximum(before, last) / 2, error)


def told(accuracy: float, tried: list[Results], found: list[Estimate], why: str) -> dict:
    """What run.json says; why: the accuracy is not reached, in words."""
    sizes = [int(one.case["n_joint"]) for one in tried]
    steps = len(tried[-1].case.times)
    return {
        "accuracy": accuracy,
        "reached": not why,
        "n_joint": sizes,
        "steps": steps,
        "quantities": {
            one.name: {
                "value": one.value,
                "error": one.error,
                "relative": one.relative,
                "unit": QUANTITIES[one.name][1],
                "used": one.used,
                "of_steps": one.of_steps,
            }
            for one in found
        },
        "statement": summary(accuracy, sizes, steps, found, why),
    }


def summary(accuracy: float, sizes: list[int], steps: int, found: list[Estimate], why: str) -> str:
    """The estimate in one line."""
    asked = f"accuracy {100 * accuracy:g} %"
    if not found:
        return f"{asked}: not known on one mesh, n_joint = {sizes[0]}; {why}"
    coarser = ", ".join(map(str, sizes[:-1]))
    errors = ", ".join(one.words for one in found if one.used and one.scale)
    said = f"{asked}: {f'not reached, {why}' if why else 'reached'}; "
    said += f"errors with n_joint = {sizes[-1]} (after {coarser}) and {steps} load steps: {errors}"
    of_steps = max((one.of_steps / one.scale for one in found if one.used and one.scale), default=0)
    if of_steps > 1e-4:
        said += f"; the load steps make up to {percent(of_steps)} of them"
    corner = "; ".join(one.words for one in found if not one.used)
    return said + (
        f"; not asked of the {corner}, a corner that needs K_N h/E < 1" if corner else ""
    )
