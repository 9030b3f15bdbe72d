"""`damjoint check`: load combinations, each run and checked in its folder."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from .. import InputError
from ..engines import check_engine
from ..input.case import Case
from ..model.results import Results
from ..pictures.check_picture import Content, draw_check
from ..post import folder as folders
from ..post import stored
from ..post.tables import write_csv
from ..runner import run
from ..session import finished, several
from ..statics.gravity import GravityMethod
from . import sensitivity
from .check import CHECK, SafetyCheck, compare_joints, hand_calculation, worst_verdict
from .check_tables import joints_table, picture_table
from .keys import study_key


def check_cases(
    cases: list[Case],
    out: Path,
    jobs: int | None = None,
    derivatives: str = "",
    deviations: Mapping[str, float] | None = None,
) -> list[SafetyCheck]:
    """Run cases, each into its folder below out, and check them; jobs: number of processes;
    derivatives: parameters with which the factors are differentiated, as `--sensitivity`;
    deviations: their standard deviations, see `sensitivity.changes`.

    Writes check.csv into out after each case; gravity.csv and CASE_check.png into each scene's
    folder, but not for a user's own geometry. Cases that have come to their end are not computed
    again by the same command. Raises InputError, RunError.
    """
    names = [case.name for case in cases]
    for case in cases:
        if derivatives:
            sensitivity.names_of(case, derivatives, True, deviations or ())
        if names.count(case.name) > 1:
            raise InputError(f"case {case.name}: must be given once, and have its own name")
        check_engine(case)
    also = derivatives, dict(deviations or {})
    tasks, checks = {out / case.name: (case, out / case.name, *also) for case in cases}, []
    for of_cases in several(check_case, tasks, out, jobs, "check"):
        checks = [check for of_case in of_cases for check in of_case]
        rows = [row for check in checks for row in check.rows]
        write_csv(out / folders.CHECK, {name: [row[name] for row in rows] for name in CHECK})
    return checks


def check_case(task: tuple[Case, Path, str, dict[str, float]], progress: bool) -> list[SafetyCheck]:
    """Run a case into a folder, or read its results of an earlier command, and check it."""
    case, out, derivatives, deviations = task
    further = [derivatives, *deviations.items()] if derivatives else []
    key = study_key(case, case.accuracy, case.also_uplift, *further)
    folder_of = partial(folders.scene_folder, case, out=out)
    results = list[Results]()
    with contextlib.suppress(InputError):  # a file is missing or damaged
        if finished(out, key):
            results = [stored.read(folder_of(scene)).result for scene in case.scenes()]
    if not results:
        options: dict[str, Any] = {}
        if derivatives:
            names = sensitivity.names_of(case, derivatives, geometry=True)
            write = partial(sensitivity.write, names, True, deviations=deviations)
            options["further"] = partial(write, printed=sensitivity.PRINTED_OF_CHECKS)
            options["stage"] = sensitivity.STAGE
        results = run(case, out, progress=progress, key=key, **options)
    checks = list[SafetyCheck]()
    for result in results:
        of_joints = compare_joints(result)
        checks += of_joints
        if case.geometry:
            continue
        methods = hand_calculations(result)
        write_csv(folder_of(result.case) / "gravity.csv", loads_table(methods))
        draw_check(picture_content(result, of_joints), folder_of(result.case))
    return checks


def hand_calculations(result: Results) -> list[GravityMethod]:
    """The gravity method on each joint of a section by parameters."""
    return [method for joint in result.joints if (method := hand_calculation(joint))]


def picture_content(result: Results, checks: list[SafetyCheck]) -> Content:
    """What the picture of a scene shows."""
    methods = hand_calculations(result)
    k = min(range(len(methods)), key=lambda k: checks[k].margin)
    tables = picture_table(checks[k]), joints_table(checks)
    return Content(result, k, methods, *tables, worst_verdict(*checks), checks[k].why)


def loads_table(methods: list[GravityMethod]) -> dict[str, list[Any]]:
    """Loads on the body above each joint; with the name of the joint if there are several."""
    tables = [method.table() for method in methods]
    if len(tables) == 1:
        return tables[0]
    names = [method.case.joint_names[0] for method in methods]
    rows = [name for name, table in zip(names, tables, strict=True) for _ in table["load"]]
    return {"joint": rows} | {n: [v for t in tables for v in t[n]] for n in tables[0]}
