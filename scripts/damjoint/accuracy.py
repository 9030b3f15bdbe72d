"""Mesh refinement until the estimated error of the results is below the required accuracy.

First the load steps are halved on the coarsest mesh until the results hardly change. Then the
elements along the joint are halved from mesh to mesh; those of the bodies follow. Each mesh costs
several times the one before: the last takes most of the time. The discretisation error
of a quantity is estimated from its last changes, as by Roache's grid convergence index (J. Fluids
Eng. 116, 1994), and includes the error of the load steps.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from . import RunError
from .engines import Engine, OnStep, Outcome
from .input.case import Case
from .input.refinement import has_plane_fields
from .model import process_zone
from .model.results import Results
from .statics.verdict import stiffness_ratio

#: Parameters that set the mesh, besides the sizes h_dam and h_found, which follow.
REFINED = ("n_joint", "n_layers")

#: Most elements along the joint: in the plane, in 3D with one layer, in 3D with several.
FINEST = {"plane": 512, "slice": 128, "solid": 32}

#: Share of the accuracy that the error of the load steps may use; the meshes use the rest.
STEP_SHARE = 0.25
#: Most halvings of the load steps; usually none to two. Beyond, the estimate says that they matter.
HALVINGS = 6
#: Shift of a new step's time off the integer times, at which levels are prescribed.
OFF_LEVEL = 1e-3

#: Compared quantities: label and unit.
QUANTITIES = {
    "level": ("level reached", "m"),
    "max_opening": ("largest opening", "m"),
    "crack_length": ("crack length", "m"),
    "slip_length": ("slip length", "m"),
    "slip": ("mean tangential jump", "m"),
    "crest_ux": ("crest", "m"),
    "flux": ("leakage", "kg/(m s)"),
    "toe_stress": ("stress at the toe", "Pa"),
}
#: Quantities with a resolution of one element of the joint.
COUNTED_IN_ELEMENTS = ("crack_length", "slip_length")

#: Largest K_N h/E of a joint so soft that the stress at its ends is not singular.
REGULAR_CORNER = 1.0

#: Least ratio of a change to the one before: second order. A faster decay counts as this one.
MIN_RATIO = 0.25
#: Largest ratio: hardly any convergence; the error is then three times the change, not more.
MAX_RATIO = 0.75
#: Roache's factor of safety for three meshes.
SAFETY_OF_THREE = 1.25
#: The same for two meshes, which show no order of convergence.
SAFETY_OF_TWO = 3.0
#: Number of elements by which a length may differ, with a margin for round-off.
ONE_ELEMENT = 1.001
#: Relative error of the load steps below which the summary does not mention it.
NEGLIGIBLE = 1e-4


@dataclass(frozen=True)
class Estimate:
    """Estimated error of a quantity on the last mesh, in the quantity's unit."""

    name: str
    #: value at the last compared level
    value: float
    #: largest error at the compared levels
    error: float
    #: reference of the relative error: the largest value at those levels; of an opening the
    #: largest jump of the joint in any direction
    scale: float
    #: error that is accepted because the quantity is counted in elements
    slack: float = 0.0
    #: whether the accuracy is required of it
    used: bool = True
    #: part of the error due to the load steps
    step_error: float = 0.0

    @property
    def relative(self) -> float:
        """Error over scale."""
        return self.error / self.scale if self.scale else 0.0

    def within(self, accuracy: float) -> bool:
        """Whether the error meets an accuracy, or none is required of the quantity."""
        return not self.used or self.error <= max(accuracy * self.scale, self.slack)

    @property
    def description(self) -> str:
        """Label and relative error, for a summary."""
        label, unit = QUANTITIES[self.name]
        counted = self.name in COUNTED_IN_ELEMENTS and self.error
        length = f" ({self.error:.2g} {unit}, counted in elements)" if counted else ""
        of = " of the joint's largest jump" if self.name == "max_opening" else ""
        return f"{label} {percent(self.relative)}{of}{length}"


def percent(part: float) -> str:
    """Format a ratio as a percentage with two digits."""
    return f"{100 * part:.2g} %"


def solve(case: Case, engine: Engine, on_step: OnStep, fields: bool) -> Iterator[Outcome]:
    """Yield the outcomes of a case's scenes, each on the mesh that the case's accuracy requires; on
    the case's own mesh if it requires none.

    Adds `error_estimate` to the content of run.json. Raises RunError.
    """
    if not case.accuracy:
        yield from engine(case, on_step, fields)
        return
    for number, scene in enumerate(case.scenes()):

        def solve_mesh(meshed: Case, number: int = number) -> Outcome:
            outcomes: Iterator[Outcome]
            outcomes = engine(meshed, lambda _, now: on_step(number, now), fields)
            return next(outcomes)

        yield refine_until_accurate(replace(scene, also_uplift=()), case.accuracy, solve_mesh)


def refine_until_accurate(
    case: Case, accuracy: float, solve_mesh: Callable[[Case], Outcome]
) -> Outcome:
    """Return the outcome of a scene on the first mesh with small enough errors.

    solve_mesh: solves the scene on one mesh. If a mesh fails or is too large the outcome on the
    mesh before is returned; after an interrupt, with the interrupt as its error. Raises RunError if
    the first mesh fails.
    """
    begin = time.perf_counter()
    case, outcome, step_errors = refine_steps(case, accuracy, solve_mesh)
    (_, *finer), why = mesh_sequence(case), "no finer mesh is tried"
    finest = finer[-1]["n_joint"] if finer else 0.0
    tried, estimates = [outcome.result], list[Estimate]()
    for meshed in finer:
        if outcome.error:
            break
        start = time.perf_counter()
        error: BaseException | None
        try:
            after = solve_mesh(meshed)
            error = after.error
        except (RunError, MemoryError, KeyboardInterrupt) as caught:
            error = caught
        if error:
            why = f"n_joint = {meshed['n_joint']:g}: {str(error) or type(error).__name__}"
            if not isinstance(error, Exception):
                why = f"interrupted on n_joint = {meshed['n_joint']:g}"
                outcome = replace(outcome, error=error)
            break
        if after.result.info["mesh"] == outcome.result.info["mesh"]:
            why = "the geometry's mesh does not follow n_joint"
            break
        outcome = after
        outcome.result.info["wall_seconds"]["coarser meshes"] = start - begin
        tried.append(outcome.result)
        estimates = estimate_errors(tried[-3:], accuracy, step_errors)
        if all(estimate.within(accuracy) for estimate in estimates):
            why = ""
            zones = [z for joint in outcome.result.joints for z in process_zone.too_short(joint)]
            if not any(zone.least <= finest for zone in zones):  # resolved, or never on any mesh
                break
    outcome.result.info["error_estimate"] = as_json(accuracy, tried, estimates, why)
    return outcome


def refine_steps(
    case: Case, accuracy: float, solve_mesh: Callable[[Case], Outcome]
) -> tuple[Case, Outcome, dict[str, float]]:
    """Halve the load steps until their error is a small share of the accuracy.

    Returns the case with these steps, its outcome, and the remaining error of each quantity. The
    error of a step is of first order in its length: twice the change when all steps are halved.
    """
    outcome, errors = solve_mesh(case), dict[str, float]()
    for _ in range(HALVINGS):
        if outcome.error:
            break
        halved = halve_steps(case)
        after = solve_mesh(halved)
        if after.error:
            return case, replace(outcome, error=after.error), errors
        pair = [outcome.result, after.result]
        times = common_times(pair)
        coarse, fine = values = [quantities_at(result, times) for result in pair]
        scales = {name: scale_of(pair[0], name, values, times) for name in coarse}
        errors = {
            name: 2 * float(np.abs(np.subtract(coarse[name], fine[name])).max(initial=0.0))
            for name in coarse
        }
        excluded = ("toe_stress", *COUNTED_IN_ELEMENTS)
        allowed = {n: STEP_SHARE * accuracy * scales[n] for n in errors if n not in excluded}
        if all(errors[name] <= limit for name, limit in allowed.items()):
            break
        case, outcome = halved, after
        errors = {name: error / 2 for name, error in errors.items()}
    return case, outcome, errors


def halve_steps(case: Case) -> Case:
    """Cut each load step of a case in two; no new step ends at an integer time, those of levels."""
    middles = [(a + b) / 2 for a, b in zip((0.0, *case.times), case.times, strict=False)]
    middles = [t + OFF_LEVEL * (t == round(t)) for t in middles]
    return replace(case, times=tuple(sorted({*case.times, *middles})))


def mesh_sequence(case: Case) -> list[Case]:
    """Return the case on its own mesh and on finer ones, up to FINEST."""
    kind = "plane" if case["dim"] == 2 else "slice" if has_plane_fields(case) else "solid"
    cases = [case]
    while 2 * cases[-1]["n_joint"] <= FINEST[kind]:
        cases.append(refine_mesh(cases[-1]))
    return cases


def refine_mesh(case: Case, factor: float = 2) -> Case:
    """Multiply the number of elements along the joint; the automatic sizes far from it follow."""
    refined = {
        "n_joint": factor * case["n_joint"],
        "n_layers": case["n_layers"] * (1 if has_plane_fields(case) else factor),
        **{name: case[name] / factor**0.5 for name in ("h_dam", "h_found")},
    }
    return case.with_values(refined)


def estimate_errors(
    results: list[Results], accuracy: float, step_errors: dict[str, float]
) -> list[Estimate]:
    """Estimate the errors on the last of two or three meshes, load steps included.

    Compared are the requested levels that all runs have reached, and the last level itself if it is
    not prescribed or not reached.
    """
    last = results[-1]
    case = last.case
    times = common_times(results)
    values = [quantities_at(result, times) for result in results]
    if case["drive"] == "level" and not any(result.stopped for result in results):
        values = [{n: v for n, v in row.items() if n != "level"} for row in values]
    element = case.joint_along / case["n_joint"]
    estimates = []
    for name in values[-1]:
        table = np.array([row[name] for row in values])
        if not table.size:
            continue
        scale, slack = scale_of(last, name, values, times), 0.0
        counted, step_error = name in COUNTED_IN_ELEMENTS, step_errors.get(name, 0.0)
        error = float(discretisation_error(table, counted).max()) + step_error
        if counted and scale:
            error = max(error, element)
            slack = ONE_ELEMENT * element if accuracy * case["n_joint"] >= 1 else 0.0
        used = name != "toe_stress" or stiffness_ratio(results[0]) <= REGULAR_CORNER
        value = float(table[-1, -1])
        estimates.append(Estimate(name, value, error, scale, slack, used, step_error))
    return estimates


def scale_of(
    last: Results, name: str, values: list[dict[str, list[float]]], times: list[float]
) -> float:
    """Reference of the relative error of a quantity, see `Estimate`."""
    if name == "max_opening" and times:
        return max(largest_jump(last, t) for t in times)
    return float(np.abs([row[name] for row in values]).max(initial=0.0))


def reached_times(result: Results) -> set[float]:
    """Requested times that a run has reached."""
    times = np.unique(result.joint["time"])
    return {t for t in result.case.requested if np.isclose(times, t).any()}


def common_times(results: list[Results]) -> list[float]:
    """Requested times of the last run that all runs have reached, in order."""
    reached = set.intersection(*map(reached_times, results))
    return [t for t in results[-1].case.requested if t in reached]


def quantities_at(result: Results, times: list[float]) -> dict[str, list[float]]:
    """QUANTITIES at requested times; the level also at the end of the run."""
    from scipy.integrate import trapezoid  # half of a run's start

    from .model.fields import along

    states = [result.state(t) for t in times]
    means = [along(result.at(t)) for t in times]
    values = {
        name: [state[name] for state in states] for name in QUANTITIES if name in result.history
    }
    if result.case["uplift"] != "flow":
        del values["flux"]
    values["level"] = [*values["level"], result.last.get("level", 0.0)]
    values["slip"] = [trapezoid(m["delta_t1"], m["s"]) / m["s"][-1] for m in means]
    values["toe_stress"] = [m["sigma_n"][-1] for m in means]
    return {name: values[name] for name in QUANTITIES if name in values}


def largest_jump(result: Results, time: float) -> float:
    """Largest displacement jump of the joint's nodes in any direction at a requested time [m]."""
    rows = result.at(time)
    jumps = [rows[name] for name in ("delta_n", "delta_t1", "delta_t2")]
    return float(np.linalg.norm(jumps, axis=0).max())


def discretisation_error(values: np.ndarray, counted: bool) -> np.ndarray:
    """Estimate the error of the last row of values on two or three meshes, coarse to fine.

    values: (meshes, n); counted: in elements. Of three values, Richardson's extrapolation with a
    factor of safety and the observed ratio of changes, within MIN_RATIO and MAX_RATIO; at least
    the error of second order by the change before, as two values may agree by chance. Values that
    oscillate show no order: half of their range (Stern et al., J. Fluids Eng. 123, 2001). Of two
    values, the change at first order with a larger factor; of those counted in elements the last
    change.
    """
    steps = np.diff(values, axis=0)
    changes = np.abs(steps)
    if counted or len(changes) == 1:
        last_change: np.ndarray = changes[-1]
        return last_change if counted else SAFETY_OF_TWO * last_change
    before, last = changes
    ratio = np.divide(last, before, out=np.full_like(last, MIN_RATIO), where=before > 0)
    ratio = np.clip(ratio, MIN_RATIO, MAX_RATIO)
    least = before * MIN_RATIO**2 / (1 - MIN_RATIO)
    error: np.ndarray = np.maximum(last * ratio / (1 - ratio), least)
    oscillates = steps[0] * steps[1] < 0
    error = np.where(oscillates, np.maximum(before, last) / 2, error)
    return SAFETY_OF_THREE * error


def as_json(
    accuracy: float, tried: list[Results], estimates: list[Estimate], why: str
) -> dict[str, Any]:
    """Entry `error_estimate` of run.json; why: the reason if the accuracy is not reached."""
    sizes = [int(result.case["n_joint"]) for result in tried]
    steps = len(tried[-1].case.times)
    return {
        "accuracy": accuracy,
        "reached": not why,
        "n_joint": sizes,
        "steps": steps,
        "quantities": {
            estimate.name: {
                "value": estimate.value,
                "error": estimate.error,
                "relative": estimate.relative,
                "unit": QUANTITIES[estimate.name][1],
                "used": estimate.used,
                "step_error": estimate.step_error,
            }
            for estimate in estimates
        },
        "statement": summary(accuracy, sizes, steps, estimates, why),
    }


def summary(
    accuracy: float, sizes: list[int], steps: int, estimates: list[Estimate], why: str
) -> str:
    """Describe the estimated errors in one line."""
    head = f"accuracy {100 * accuracy:g} %"
    if not estimates:
        return f"{head}: errors not estimated, only one mesh (n_joint = {sizes[0]}); {why}"
    coarser = ", ".join(map(str, sizes[:-1]))
    used = [estimate for estimate in estimates if estimate.used and estimate.scale]
    errors = ", ".join(estimate.description for estimate in used)
    text = f"{head}: {f'not reached, {why}' if why else 'reached'}; estimated errors with n_joint "
    plural = "s" if steps > 1 else ""
    text += f"= {sizes[-1]} (coarser: {coarser}) and {steps} load step{plural}: {errors}"
    of_steps = max((estimate.step_error / estimate.scale for estimate in used), default=0)
    if of_steps > NEGLIGIBLE:
        text += f"; of these up to {percent(of_steps)} by the load steps"
    corner = "; ".join(estimate.description for estimate in estimates if not estimate.used)
    return text + (f"; not required: {corner}, singular unless K_N h/E < 1" if corner else "")
