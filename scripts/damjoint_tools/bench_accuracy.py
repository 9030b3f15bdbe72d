"""Discretisation errors: reference solutions, error against time, and the estimates of
--accuracy.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from damjoint import accuracy as refinement
from damjoint.engines import engine_of
from damjoint.input.case import Case
from damjoint.input.refinement import ACCURACIES
from damjoint.input.resolve import load
from damjoint.model.results import Results
from damjoint.progress import track

from .bench_scenes import (
    PARTS,
    PUBLISHED,
    QUANTITIES,
    SCENES,
    main_uplift,
    mesh_settings,
    quantities,
    relative_errors,
    run_cold,
    solve_timed,
)
from .bench_table import Measurements, Table

#: Ordinary concrete on rock, with a weak joint: E [Pa], strengths [Pa].
ROCK = {"E_dam": 2e10, "E_found": 3e10, "sigma_max": 2e4, "adhesion": 1e5, "mu": 1.0}

#: Scenes with the stiffness of a real dam: case, parameters besides ROCK, K_N = K_T [Pa/m],
#: levels [m].
DAMS: dict[str, tuple[str, dict[str, Any], float, str | None]] = {
    "rupture, no uplift": ("dam", {"law": "rupture", "uplift": "none"}, 1e12, "45,49"),
    "rupture, imposed": ("dam", {"law": "rupture", "uplift": "imposed"}, 1e11, "40,45"),
    "rupture, flow": ("dam", {"law": "rupture", "uplift": "flow"}, 1e11, "40,45"),
    "friction, drained": ("dam", {"law": "friction", "uplift": "drained"}, 1e12, "40,48"),
    "friction, imposed": ("dam", {"law": "friction", "uplift": "imposed"}, 1e11, "40,46"),
    "friction, cracked": ("dam", {"law": "friction", "uplift": "cracked"}, 1e12, "40,45"),
    "friction, flow": ("dam", {"law": "friction", "uplift": "flow"}, 1e12, "40,45"),
    "bond, drained": ("dam", {"law": "bond", "uplift": "drained", "G_f": 10.0}, 1e12, "40,48"),
    "bond, cracked": ("dam", {"law": "bond", "uplift": "cracked", "G_f": 10.0}, 1e11, "40,45"),
    "bond, flow": ("dam", {"law": "bond", "uplift": "flow", "G_f": 10.0}, 1e11, "40,45"),
    "friction, 3D slice": (
        "dam",
        {"law": "friction", "uplift": "drained", "dim": 3.0, "thickness": 1.0, "hold_z": 1.0},
        1e11,
        "40,46",
    ),
    "bond, sloping section": ("sloping", {"adhesion": 2e5}, 1e12, None),
}

#: Load steps per level as published.
PUBLISHED_STEPS = "published"


def overkill(measurements: Measurements) -> tuple[dict[str, np.ndarray], Table]:
    """Compute reference solutions on the finest mesh.

    Returns QUANTITIES of the main scene of each case, {case: values}, and the table of their
    convergence for SCENES: observed order, and remaining error by Richardson extrapolation. Plane
    strain of order 2, 640 elements along the joint (80 if short), far from it elements half as
    large as those of --accuracy; the 3D cases are plane, too (nu = 0, nothing varies along z).
    """
    numbers = (20, 40, 80) if measurements.short else (160, 320, 640)
    columns = *(f"n = {n}" for n in numbers), "observed order", "remaining error [%]"
    exact, table = {}, Table("overkill", "scene", "quantity", *columns)

    def measure(name: str, n: int) -> np.ndarray:
        settings = mesh_settings(2, n, 0.5, "free", 2) | {"uplift": main_uplift(name)}
        return quantities(solve_timed(load(name, settings))[0])

    scene_of = {case: scene for scene, case in SCENES.items()}
    for name in track(scene_of if measurements.short else PUBLISHED, "overkill"):
        wanted = numbers if name in scene_of else numbers[-1:]
        values = [
            measurements.get(("overkill", name, n), partial(measure, name, n)) for n in wanted
        ]
        exact[name] = np.array(values[-1])
        if name in scene_of:
            add_convergence(table, scene_of[name], np.array(values))
    return exact, table


def add_convergence(table: Table, scene: str, values: np.ndarray) -> None:
    """Add a row for each quantity that is not 0; values: (3 meshes, QUANTITIES)."""
    for quantity, sequence in zip(QUANTITIES, values.T, strict=True):
        if sequence[-1]:
            before, last = np.abs(np.diff(sequence))
            order = np.log2(before / last) if last else np.inf
            # without convergence of order 1 the last difference instead of the extrapolation
            remaining = last / (2**order - 1) if order > 1 else last
            table.add(scene, quantity, *sequence, order, 100 * remaining / abs(sequence[-1]))


def accuracy(measurements: Measurements, exact: dict[str, np.ndarray], start: float) -> Table:
    """Measure error against time: a row per scene of SCENES and mesh, with published steps, and
    for one mesh with other numbers of steps.

    exact: QUANTITIES of the reference solutions; start: seconds of the start of a process.
    """
    columns = "dim", "pattern", "order", "n_joint", "grading", "steps"
    measured = "unknowns", "seconds", *PARTS, *(f"error_{q}" for q in QUANTITIES), "worst"
    table = Table("accuracy", "scene", *columns, *measured)

    def measure(name: str, mesh: tuple[Any, ...]) -> tuple[Any, ...]:
        dim, pattern, order, n, grading, steps = mesh
        settings = mesh_settings(order, n, grading, pattern, dim) | {"uplift": main_uplift(name)}
        result, spent = solve_timed(
            load(name, settings, steps=None if steps == PUBLISHED_STEPS else steps)
        )
        parts = [(spent | {"start": start})[part] for part in PARTS]
        errors = relative_errors(quantities(result), exact[name])
        return spent["unknowns"], sum(parts), *parts, *errors, max(errors)

    for scene, name in SCENES.items():
        for mesh in track(meshes(measurements.short), scene):
            table.add_measured(measurements, (scene, *mesh), partial(measure, name, mesh))
    return table


def meshes(short: bool) -> list[tuple[Any, ...]]:
    """Return the meshes of the error-against-time benchmark: dimension, pattern, order, elements
    along the joint, grading, steps.
    """
    numbers = (10, 20) if short else (10, 20, 40, 80, 160, 320)
    gradings = (1.0,) if short else (2.0, 1.0, 0.5)
    most_3d = {"layers": 80, "split": 160, "free": 40}
    orders = (1, 2)
    published = [(2, "free", o, n, g) for o in orders for n in numbers for g in gradings]
    published += [(2, "regular", o, n, 1.0) for o in orders for n in numbers]
    published += [
        (3, pattern, o, n, 1.0)
        for pattern, most in most_3d.items()
        for o in orders
        for n in numbers
        if n <= most
    ]
    other_steps = [(2, "free", 2, numbers[-2], 1.0, steps) for steps in (1, 2, 4)]
    return [*((*mesh, PUBLISHED_STEPS) for mesh in published), *other_steps]


def recommended(measurements: Measurements, exact: dict[str, np.ndarray]) -> Table:
    """Measure the main scene of each case: the worst error of the published mesh and steps, and
    error and seconds of --accuracy.
    """
    levels = list(ACCURACIES)[: 1 if measurements.short else None]
    measured = "error [%]", "seconds", "of these start"
    columns = (f"{level}: {what}" for level in levels for what in measured)
    table = Table("recommended", "case", "published: error [%]", "published", *columns)

    def worst(result: Results, name: str) -> float:
        return 100 * float(np.max(relative_errors(quantities(result), exact[name])))

    def measure(name: str) -> list[Any]:
        main = {"uplift": main_uplift(name)}
        row = [worst(solve_timed(load(name, main))[0], name), PUBLISHED[name]]
        for level in levels:
            error = worst(solve_refined(load(name, main, accuracy=level)), name)
            words = [name, "--accuracy", level, "--set", f"uplift={main['uplift']}"]
            wall, record = run_cold(words)
            row += [error, wall, wall - sum(record["wall_seconds"].values())]
        return row

    for name in track(list(exact), "accuracy"):
        table.add_measured(measurements, (name,), partial(measure, name))
    table.add(
        "sum, worst", *(max(c) if "error" in n else sum(c) for n, c in table.items() if n != "case")
    )
    return table


def solve_refined(case: Case) -> Results:
    """Solve a scene on the mesh of its --accuracy."""
    engine = engine_of(case, "auto")
    return next(refinement.solve(case, engine, lambda *_: None, False)).result


def estimates(measurements: Measurements) -> Table:
    """Compare the errors that --accuracy estimates of DAMS with the true ones, in percent:
    "estimated / true".

    The reference solution has the same mesh rule with 1024 elements along the joint (256 if
    short), in 3D 96, and four times as many load steps.
    """
    finest, levels = (256.0, ["coarse"]) if measurements.short else (1024.0, ["coarse", "standard"])
    columns = [n for n in refinement.QUANTITIES if n not in ("level", "toe_stress")]
    table = Table("estimates", "scene", "accuracy", "reached", "n_joint", *columns)

    def measure(scene: str) -> list[list[Any]]:
        name, differs, stiffness, water = DAMS[scene]
        settings = ROCK | {"K_N": stiffness, "K_T": stiffness} | differs
        solid = settings.get("dim") == 3
        rows, exact = [], None
        for level in levels[:1] if solid else levels:
            case = load(name, settings, water, accuracy=level)
            result = solve_refined(case)
            exact = exact or solve_timed(refined(case, 96.0 if solid else finest))[0]
            record = result.info["error_estimate"]
            cells = [estimated_and_true(n, record["quantities"], result, exact) for n in columns]
            reached = "yes" if record["reached"] else "no"
            rows.append([level, reached, record["n_joint"][-1], *cells])
        return rows

    for scene in track(DAMS, "estimates"):
        if not measurements.short or "imposed" in scene:
            for row in measurements.get(("estimates", scene), partial(measure, scene)):
                table.add(scene, *row)
    return table


def refined(case: Case, n: float) -> Case:
    """Return a case with n elements along the joint, as --accuracy, and load steps cut in four."""
    finer = refinement.refine_mesh(case, n / case["n_joint"])
    return replace(refinement.halve_steps(refinement.halve_steps(finer)), accuracy=None)


def estimated_and_true(name: str, record: dict[str, Any], result: Results, exact: Results) -> str:
    """Return the estimated and the true error [%] of a quantity, over all levels that both results
    have reached; empty if there is no estimate.
    """
    if name not in record:
        return ""
    error, relative = record[name]["error"], record[name]["relative"]
    times = [t for t in refinement.reached_times(result) if t in refinement.reached_times(exact)]
    values, true = (
        np.array(refinement.quantities_at(r, sorted(times))[name]) for r in (result, exact)
    )
    scale = error / relative if relative else np.abs(true).max() or 1.0
    return f"{100 * relative:.2g} / {100 * np.abs(values - true).max() / scale:.2g}"
