"""`damjoint critical`: the search, its files and its printed lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from .. import RunError
from ..engines.condensed.recover import recover
from ..engines.condensed.solve import about
from ..fem.bodies import Bodies
from ..input.case import Case
from ..laws import Evidence
from ..mesh.mesh import crest_level
from ..model.fields import Solution
from ..model.results import Info, Results, row_of_joint
from ..post import folder as folders
from ..post.field_files import write_fields
from ..post.tables import write_csv
from ..runner import early_end
from ..session import Session, preparation, session, study_end
from ..solver.path_point import PRECISION, Point
from ..statics.hints import tension_share
from ..statics.statement import statement
from . import critical_picture as picture
from . import sensitivity as sensitivities
from .critical import Search, last_state
from .critical_value import AFTER_GROWTH, CriticalValue
from .failure_path import critical_columns, row

#: Name of the level at which a run stands, among those that are reached after unstable growth.
BY_RUN = "a run stands at"


def critical(
    case: Case,
    of: str,
    out: Path | None = None,
    sensitivity: Sequence[str] = (),
    deviations: Mapping[str, float] | None = None,
) -> tuple[CriticalValue, list[str]]:
    """Find a critical value of a case and write its files below out (default out/CASE_critical);
    sensitivity: parameters by which a critical level is differentiated; deviations: their standard
    deviations, see `sensitivity.changes`.

    Returns the result, and its lines of text. A search that is interrupted or fails writes its
    trials.
    Raises InputError, RunError.
    """
    search = Search(replace(case, all_steps=bool(sensitivity)), of)
    with session(search.case, out or Path("out") / f"{case.name}_critical") as study:
        with preparation(search.case) as shown:
            search.on_progress = lambda message: shown.describe(f"{case.name}: {message}")
            answer = search.run()
        save(study, search, answer)
        if answer.error:
            raise answer.error
        lines = printed_lines(answer, search)
        if sensitivity and answer.point and answer.value is not None:
            what = study.out, answer.point, sensitivity, deviations
            with preparation(search.case) as shown:
                shown.describe(f"{case.name}: {sensitivities.STAGE}")
                lines += ["", *derivative_lines(case.name, *what)]
    return answer, lines


def derivative_lines(
    name: str,
    out: Path,
    point: Point,
    names: Sequence[str],
    deviations: Mapping[str, float] | None = None,
) -> list[str]:
    """Write the derivatives of a critical level and their picture, with the name of the case; what
    is printed of them.
    """
    try:
        rows = sensitivities.of_point(point, names)
    except RunError as error:
        return [str(error)]
    write_csv(
        out / sensitivities.FILE, {n: np.array(v) for n, v in sensitivities.table(rows).items()}
    )
    printed = (("critical_level", "m", 1.0),)
    changes = sensitivities.changes(rows, printed, deviations=deviations)
    lines = sensitivities.without_lines(
        *sensitivities.without_change(rows, changes, deviations or names)
    )
    if not changes:
        return lines
    case = replace(point.model.case, name=name)
    sensitivities.draw_changes(changes, case, point.level, out)
    return [sensitivities.text(changes), *lines]


def table(search: Search) -> dict[str, np.ndarray]:
    """critical.csv: the equilibria of all trials."""
    points = [(k, t, p) for k, t in enumerate(search.trials, 1) for p in t.path.points]
    rows = [
        {"trial": number, "value": trial.value, "stands": float(trial.stands)} | row(point)
        for number, trial, point in points
    ]
    case = points[0][-1].model.case if points else search.case
    return {name: np.array([cells[name] for cells in rows]) for name in critical_columns(case)}


def printed_lines(answer: CriticalValue, search: Search) -> list[str]:
    """The printed lines."""
    of, name, unit = search.of, search.case.name, search.unit
    if answer.value is None:
        lines = [f"{name}: no critical {of} found: {answer.doubt}"]
    else:
        mode = f" ({answer.failure})" if answer.failure else ""
        critical = f"{name}: critical {of} {answer.value:.6g}{unit}"
        if answer.why:
            lines = [critical + mode, answer.why]
        else:
            lines = [f"{critical}, not confirmed: {answer.doubt}{mode}"]
    if of == "level" and answer.value is not None:
        crest = crest_level(search.case)
        if (depth := answer.value - crest) > PRECISION * crest:
            lines.append(
                f"the crest, at {crest:.6g} m, is overtopped: {depth:.3g} m of water above it"
            )
    lines += [*growth_lines(answer), *answer.events]
    if search.of == "strength" and set(search.partial.values()) != {1.0}:
        mu, cohesion = search.partial["mu"], search.partial["adhesion"]
        lines.append(f"beyond the partial factors factor_mu = {mu:g}, factor_c = {cohesion:g}")
    if answer.point:
        hardens = any(law.hardens for law in answer.point.model.equilibrium.laws.laws)
        if hardens and any(joint.hardening_requested for joint in search.case.joints):
            lines += filter(None, [statement(last_state(search, answer.point))])
    lines += filter(None, ["; ".join(answer.by_gravity(unit))])
    lines += answer.notes
    return lines + hints_at(answer.point) if answer.point else lines


def hints_at(point: Point) -> list[str]:
    """Hints of the laws at an equilibrium."""
    case, lines = point.model.case, list[str]()
    for k, joint in enumerate(case.joints):
        last, name = row_of_joint(point.last, k), case.named((k,))
        share = tension_share(joint, last)
        hints = joint.law.hints(Evidence(last["crack_length"], False, share))
        lines += (f"{name}: {hint}" if name else hint for hint in hints)
    return lines


def growth_lines(answer: CriticalValue) -> list[str]:
    """What is printed of unstable crack growth."""
    if answer.growth is None:
        return []
    lines = [f"first unstable crack growth: {answer.growth:.6g} m"]
    if answer.stands_at is not None:
        lines.append(f"after it, not confirmed: {BY_RUN} {answer.stands_at:.6g} m")
    elif answer.after:
        low, high = min(answer.after.values()), max(answer.after.values())
        ways = "; ".join(f"{level:.6g} m {name}" for name, level in answer.after.items())
        agree = len(answer.after) > 1 and high - low <= AFTER_GROWTH * high
        doubt = "" if agree else "not confirmed, it depends on how the growth ends: "
        lines.append(f"after unstable growth equilibria up to: {doubt}{ways}")
    return lines


def save(study: Session, search: Search, answer: CriticalValue) -> None:
    """Write the last equilibrium as `damjoint run` does, critical.csv and its picture."""
    state, _ = study_end(answer.error)
    shown = content(search, answer)
    entries: Info = {"critical": as_json(search, answer), "wall_seconds": {"search": study.seconds}}
    result, solution = shown.result, shown.solution
    if answer.point and result:
        result.info = about(answer.point.model.equilibrium.bulk) | entries
        study.save(result, *early_end(result, answer.error))
        if solution:
            study.add(result, lambda out: write_fields(solution, out / "fields"))
    else:
        study.save_without_results(state or folders.COMPLETE, answer.doubt, entries)
    if not search.trials:
        return
    write_csv(study.out / "critical.csv", table(search))
    picture.draw(shown, study.out / f"{search.case.name}_critical.png")


def solution_at(point: Point, result: Results) -> Solution:
    """The results of an equilibrium, from `last_state`, with displacement and stress of the bodies
    at the saved times.
    """
    model, history = point.model, point.history.copy()
    if point.state.time > history.saved_until:
        history.save(point.state)
    bodies = Bodies.of(model.case)
    fields = recover(bodies, [(model.equilibrium, history)])[0]
    return Solution(result, bodies.mesh.bodies, fields)


def content(search: Search, answer: CriticalValue) -> picture.Content:
    """The content of the picture."""
    what = search.case, search.of, search.unit, search.trials
    if not answer.point:
        return picture.Content(*what, answer, None)
    result = last_state(search, answer.point)
    solution = None if answer.error else solution_at(answer.point, result)
    return picture.Content(*what, answer, result, solution)


def as_json(search: Search, answer: CriticalValue) -> dict[str, Any]:
    """The entry `critical` of run.json."""
    by_run = {} if answer.stands_at is None else {BY_RUN: answer.stands_at}
    return {
        "of": search.of,
        "value": answer.value,
        "unit": search.unit.strip(),
        "mode": answer.mode,
        "joint": answer.joint,
        "first_unstable_growth": answer.growth,
        "after_unstable_growth": {**answer.after, **by_run},
        "events": answer.events,
        "confirmed": answer.why,
        "doubt": answer.doubt,
        "gravity_method": answer.gravity,
        "gravity_method_joint": answer.gravity_joint,
        "gravity_method_there": answer.gravity_there,
        "gravity_method_notes": list(answer.notes),
        "gravity_method_with": answer.gravity_with,
        "trials": len(search.trials),
    }
