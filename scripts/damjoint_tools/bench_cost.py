"""Seconds and memory: of the published cases, of growing meshes, of options, of rows of a sweep,
of several joints, and of flow under extreme parameters.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from damjoint import RunError
from damjoint.fem.bodies import Bodies
from damjoint.fem.condensation import condense
from damjoint.input.case import Case
from damjoint.input.resolve import load
from damjoint.joint.interface import Interface, interface_of
from damjoint.processes import process_pool
from damjoint.progress import track
from damjoint.runner import run
from damjoint.solver.load_stepper import LoadStepper
from damjoint.statics.verdict import verdict
from damjoint.studies.sweep import Solved, stepped
from threadpoolctl import threadpool_limits

from .bench_scenes import (
    PART_OF_RUN,
    PARTS,
    PUBLISHED,
    main_uplift,
    mesh_settings,
    run_cold,
    solve_timed,
)
from .bench_table import Measurements, Table

#: What is measured.
Call: TypeAlias = Callable[[], object]


def cases(measurements: Measurements) -> Table:
    """Measure all scenes of each modeling with published steps and meshes of the published size:
    seconds by PARTS, MB, ratio to the published code; unless short, those of the reference GetDP
    model, too.
    """
    columns = "seconds", *PARTS, "MB", "published", "times faster", "GetDP", "times faster, GetDP"
    table = Table("cases", "case", *columns)

    def measure(name: str) -> tuple[Any, ...]:
        wall, record = run_cold([name])
        spent = [record["wall_seconds"][PART_OF_RUN.get(part, part)] for part in PARTS[1:]]
        getdp = float("nan") if measurements.short else run_cold([name, "--engine", "getdp"])[0]
        published = PUBLISHED[name]
        faster = published, published / wall, getdp, published / getdp
        return wall, wall - sum(spent), *spent, record["peak_memory_mb"], *faster

    for name in track(PUBLISHED, "cases"):
        table.add_measured(measurements, (name,), partial(measure, name))
    total = {n: sum(c) for n, c in table.items() if n != "case"}
    table.add(
        "sum",
        *(total[n] for n in ("seconds", *PARTS)),
        max(table["MB"]),
        total["published"],
        total["published"] / total["seconds"],
        total["GetDP"],
        total["published"] / total["GetDP"],
    )
    return table


def growth(measurements: Measurements) -> Table:
    """Measure seconds and memory against the number of unknowns, each size in a new process."""
    table = Table("growth", "dim", "order", "n_joint", "unknowns", "seconds", "MB")
    short = measurements.short
    sizes = [(2, 2, n) for n in ((50, 100) if short else (50, 100, 200, 400))]
    sizes += [(3, 1, n) for n in ((20,) if short else (20, 40, 60, 90, 125))]

    def measure(dim: int, order: int, n: int) -> tuple[Any, ...]:
        settings = {"dim": dim, "order": order, "n_joint": n, "mesh_pattern": "free"}
        settings["uplift"] = "imposed"
        # uniform refinement: all element sizes in proportion to the joint's
        settings |= (
            {"h_dam": 15 / n, "h_found": 40 / n}
            if dim == 2
            else {"n_layers": max(1, n // 5), "h_dam": 20 / n, "h_found": 40 / n}
        )
        words = [word for k, v in settings.items() for word in ("--set", f"{k}={v}")]
        wall, record = run_cold(["a", *words, "--levels", "9", "--engine", "condensed"])
        return record["unknowns"], wall, record["peak_memory_mb"]

    for size in track(sizes, "growth"):
        table.add_measured(measurements, size, partial(measure, *size))
    return table


def engines(measurements: Measurements) -> Table:
    """Measure seconds and memory of the dam across a valley by condensed and by uncondensed bodies
    against the number of unknowns, each size in a new process.
    """
    parts = "mesh", "assembly", "condensation", "solve"
    table = Table("engines", "engine", "n_joint", "unknowns", "seconds", *parts, "MB")
    sizes = {"condensed": (10, 16, 27), "iterative": (10, 16, 27, 39, 62)}

    def measure(engine: str, n: int) -> tuple[Any, ...]:
        # uniform refinement of the default mesh
        settings = {"n_joint": n, "h_dam": 80 / n, "h_found": 250 / n}
        words = [word for k, v in settings.items() for word in ("--set", f"{k}={v}")]
        wall, record = run_cold(["valley", *words, "--engine", engine])
        spent = [record["wall_seconds"].get(part, 0.0) for part in parts]
        return record["unknowns"], wall, *spent, record["peak_memory_mb"]

    rows = [(engine, n) for engine, of_engine in sizes.items() for n in of_engine]
    for row in track([r for r in rows if r[1] <= 10 or not measurements.short], "engines"):
        table.add_measured(measurements, row, partial(measure, *row))
    return table


def exponents(table: Table, column: str = "dim", form: str = "{}D") -> list[str]:
    """Fit exponents of time and memory over the three largest sizes, for each value of a column."""
    lines = []
    for kind in dict.fromkeys(table[column]):
        rows = [i for i, value in enumerate(table[column]) if value == kind][-3:]
        if len(rows) > 1:
            n = np.log([table["unknowns"][i] for i in rows])
            time, memory = (
                np.polyfit(n, np.log([table[c][i] for i in rows]), 1)[0] for c in ("seconds", "MB")
            )
            powers = f"time ~ unknowns^{time:.2f}, memory ~ unknowns^{memory:.2f}"
            lines.append(f"{form.format(kind)}: {powers}")
    return lines


def memory_message() -> str:
    """Return the message of a run whose joint alone exceeds the memory of the machine."""
    case = load("b", {"n_joint": 1000.0, "n_layers": 1000.0})
    with tempfile.TemporaryDirectory() as folder:
        try:
            run(case, Path(folder), False, False, False)
        except RunError as error:
            return str(error)
    raise RunError("bench: a run that exceeds the memory did not fail")


def switches(measurements: Measurements) -> Table:
    """Measure the seconds of a run with and without each option, in one process, best of three."""
    repetitions = 1 if measurements.short else 3

    def best(call: Callable[[], object]) -> float:
        spent = []
        for _ in range(repetitions):
            start = time.perf_counter()
            call()
            spent.append(time.perf_counter() - start)
        return min(spent)

    def measure(
        with_option: Callable[[], object], without_option: Callable[[], object]
    ) -> tuple[float, float, float]:
        seconds = best(with_option), best(without_option)
        return *seconds, seconds[0] / seconds[1]

    table = Table("switches", "option", "with", "without", "ratio")
    with threadpool_limits(1), tempfile.TemporaryDirectory() as folder:
        for option, calls in track(options(Path(folder)).items(), "switches"):
            table.add_measured(measurements, (option,), partial(measure, *calls))
    return table


def options(folder: Path) -> dict[str, tuple[Call, Call]]:
    """Return the options whose cost is measured: calls with and without."""
    e, dry = load("e"), {"uplift": "none"}
    joint = Interface(condense(e, Bodies.of(e)), e["quadrature"])

    def filling(*loading: Any) -> Call:
        return lambda: LoadStepper(load("e", *loading), joint).run()

    def solving(*loading: Any) -> Call:
        return lambda: solve_timed(load("a", *loading))

    def writing(fields: bool, picture: bool) -> Call:
        return lambda: run(load("a"), folder, fields, picture, False)

    return {
        "pressure unknowns (flow instead of none)": (filling({}, "9"), filling(dry, "9")),
        "load unknown (drive=heel instead of level)": (
            filling(dry | {"drive": "heel"}, "8,9"),
            filling(dry, "8,9"),
        ),
        "20 steps instead of 1": (filling(dry, "9", None, 20), filling(dry, "9")),
        "z (3D layers instead of 2D)": (
            solving(mesh_settings(2, 50, 1.0, "layers", 3), "9"),
            solving(mesh_settings(2, 50, 1.0, "free", 2), "9"),
        ),
        "static condensation (instead of cached)": (
            lambda: solve_timed(load("e", dry, "9")),
            filling(dry, "9"),
        ),
        "a fine mesh far from the joint": (
            solving({"order": 2.0, "h_dam": 0.1, "h_found": 0.1}, "9"),
            solving({"order": 2.0}, "9"),
        ),
        "fields for ParaView and Gmsh": (writing(True, False), writing(False, False)),
        "the picture": (writing(False, True), writing(False, False)),
    }


def sweeps(measurements: Measurements) -> Table:
    """Measure the seconds of a further row of a sweep on a condensed mesh: a level between the last
    two (one step per level, as sweeps of levels have), and with published steps a weaker joint
    (sigma_max or mu) and a stiffer one (K_N, K_T); main scenes, published meshes, one thread.
    """
    rows = "first run", "another level", "steps", "another strength", "another stiffness"
    table = Table("sweeps", "case", "dim", *rows)

    for name in track("ac" if measurements.short else PUBLISHED, "sweeps"):
        main = {"uplift": main_uplift(name)}
        case = load(name, main)
        if case["drive"] == "level":
            key = name, int(case["dim"])
            table.add_measured(measurements, key, partial(sweep_rows, name, case, main))
    return table


def sweep_rows(name: str, case: Case, main: dict[str, Any]) -> tuple[Any, ...]:
    """Measure the rows of a sweep of a case; main: settings of its main scene."""
    strength = "sigma_max" if case["law"] == "rupture" else "mu"
    weaker = {strength: 0.9 * case[strength]}
    stiffer = {"K_N": 1.1 * case["K_N"], "K_T": 1.1 * case["K_T"]}
    ends = [
        ",".join(map(str, (*case.levels[:-1], top)))
        for top in (case.levels[-1], (case.levels[-2] + case.levels[-1]) / 2)
    ]
    first, further = (load(name, main, levels) for levels in ends)
    with threadpool_limits(1):
        bulk, known, spent = condense(case, Bodies.of(case)), Solved(), list[float]()
        joint = Interface(bulk, case["quadrature"])
        runs: list[Call] = [partial(stepped, row, known, joint) for row in (first, further)]
        runs += [LoadStepper(load(name, main | s), joint).run for s in (weaker, stiffer)]
        for call in runs:
            start = time.perf_counter()
            call()
            spent.append(time.perf_counter() - start)
    return *spent[:2], len(case.times), *spent[2:]


def joints(measurements: Measurements) -> Table:
    """Measure the seconds of a 45 m dam against the number of its joints, the base and lifts at
    equal distances, one thread; ratio: of the seconds to those of one joint.
    """
    columns = "unknowns", "condensation", "newton", "seconds", "CPU seconds", "iterations", "ratio"
    table = Table("joints", "joints", *columns)
    for number in track((1, 2) if measurements.short else (1, 2, 4, 8), "joints"):
        measured = measurements.get((table.name, number), partial(measure_joints, number))
        first = (table["seconds"] or measured[3:])[0]
        table.add(number, *measured, measured[3] / first)
    return table


def measure_joints(number: int) -> tuple[Any, ...]:
    """Measure a dam with a number of joints; returns the columns of `joints` but for the ratio."""
    lifts = {"lift_heights": tuple(45.0 * k / number for k in range(1, number))}
    case = load("dam", (lifts if number > 1 else {}) | {"uplift": "imposed"}, "30,40,45")
    with threadpool_limits(1):
        wall, cpu = time.perf_counter(), time.process_time()
        result, spent = solve_timed(case)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    iterations = result.history["iterations"].sum()
    return spent["unknowns"], spent["condensation"], spent["newton"], wall, cpu, iterations


def stress(measurements: Measurements) -> Table:
    """Run flow with extreme parameters, over many decades, and water up to the crest."""
    grid = list(
        product(
            ("rupture", "friction"), (1e-9, 1e-8, 1e-6, 1e-4), (1e9, 1e12, 1e14), (1e10, 3e11, 3e12)
        )
    )
    grid = grid[::18] if measurements.short else grid
    measured = "end", "level", "iterations", "cuts", "seconds"
    table = Table("stress", "law", "aperture_min", "K_N", "E", *measured)
    with process_pool(os.cpu_count() or 1) as pool:
        ends = {
            values: pool.submit(run_of_grid, *values)
            for values in grid
            if (table.name, *values) not in measurements
        }
        for values in track(grid, "stress"):
            table.add_measured(measurements, values, partial(of_grid, ends, values))
    return table


def of_grid(ends: Mapping[tuple[Any, ...], Future[Any]], values: tuple[Any, ...]) -> Any:
    """The result of a combination of `stress`."""
    return ends[values].result()


def run_of_grid(law: str, aperture: float, stiffness: float, young: float) -> tuple[Any, ...]:
    """Run a combination of `stress`; how it ended, last level, iterations, cuts, seconds."""
    settings = {"aperture_min": aperture, "K_N": stiffness, "K_T": stiffness, "E": young}
    settings |= mesh_settings(2, 50, 1.0, "free", 2) | {"pena_tang": 0.1 * stiffness}
    case = load("e" if law == "rupture" else "g", settings, "3,6,8,9,10")
    with threadpool_limits(1):
        start = time.perf_counter()
        result = LoadStepper(case, interface_of(case)).run()
        spent = time.perf_counter() - start
    history = result.history
    level = history["level"][-1] if len(history["level"]) else 0.0
    return verdict(result), level, history["iterations"].sum(), history["cuts"].sum(), spent


def precision(measurements: Measurements) -> list[str]:
    """Check equilibrium and mass balance on a fine mesh, which hold to machine precision."""
    n = 80 if measurements.short else 320
    return measurements.get(("checks",), partial(balances, n))


def balances(n: int) -> list[str]:
    """Return the errors of equilibrium and mass balance with n elements along the joint."""
    case = load("g", mesh_settings(2, n, 1.0, "free", 2))
    result, spent = solve_timed(case)
    last = result.last
    thrust = case["rho_water"] * case["g"] * last["level"] ** 2 / 2
    flux = result.at()["flux"]
    return [
        f"G with {spent['unknowns']} unknowns: shear over thrust minus one "
        f"{last['T'] / thrust - 1:.1e}",
        f"flux at the toe over flux at the heel minus one {flux[-1] / flux[0] - 1:.1e}",
    ]
