"""Benchmark of scenes that are hard to solve in 2D, and of critical levels: what they wait for."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import cache, partial
from typing import Any
from unittest.mock import patch

import numpy as np
from damjoint.input.case import Case
from damjoint.input.resolve import load
from damjoint.joint.interface import interface_of
from damjoint.joint.linear_system import WoodburySystem
from damjoint.joint.step_water import StepFlow, StepWater
from damjoint.progress import track
from damjoint.solver import step
from damjoint.solver.load_stepper import LoadStepper
from damjoint.solver.newton import NotConverged
from damjoint.statics.verdict import verdict
from damjoint.studies.critical import Search
from threadpoolctl import threadpool_limits

from .bench_table import Measurements, Table
from .random_scenes import random_scene

#: Scenes that are always measured: case, values.
NAMED: dict[str, tuple[str, dict[str, Any]]] = {
    "e, E_dam = 21 GPa": ("e", {"E_dam": 21e9}),
    "80 m, cracked, drains, no tension": (
        "dam",
        {"dam_height": 80, "uplift": "cracked", "drains": 1, "drain_x": 6}
        | {"drain_effectiveness": 2 / 3, "sigma_max": 0},
    ),
}
#: Seed and number of the random dams of which the slowest in 2D are listed, and how many are.
SEED, RANDOM, SLOWEST = 1, 200, 10
#: The same of the short benchmark.
FEW = 4

#: Rows of `sweep dam --critical`: settings, the parameter that is varied, and its values in two
#: rows, of which the second one is measured.
ROWS: dict[str, tuple[dict[str, Any], str, tuple[float, float]]] = {
    "friction": ({"law": "friction"}, "mu", (0.70, 0.72)),
    "friction, cracked": ({"law": "friction", "uplift": "cracked"}, "mu", (0.70, 0.72)),
    "bond": ({"law": "bond"}, "sigma_max", (0.200e6, 0.202e6)),
    "bond, cracked": ({"law": "bond", "uplift": "cracked"}, "sigma_max", (0.200e6, 0.202e6)),
    "rupture": ({"law": "rupture"}, "sigma_max", (0.200e6, 0.202e6)),
    "endo": ({"law": "endo", "adhesion": 0.26e6, "mu": 1.0}, "sigma_max", (0.200e6, 0.202e6)),
}

#: How often a linear system is timed, of which the best counts.
REPETITIONS = 20


class Clock:
    """CPU seconds of the parts of a solution, and its numbers of solutions and iterations."""

    def __init__(self) -> None:
        self.seconds = dict.fromkeys(("given up", "linear systems", "water"), 0.0)
        self.solutions = self.given_up = self.iterations = 0

    def timed(self, part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """A function whose seconds are added to a part."""

        def call(*arguments: Any, **options: Any) -> Any:
            start = time.process_time()
            try:
                return function(*arguments, **options)
            finally:
                self.seconds[part] += time.process_time() - start

        return call

    def solve_from(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """A solution by one strategy."""
        start, self.solutions = time.process_time(), self.solutions + 1
        try:
            return function(*arguments)
        except NotConverged:
            self.given_up += 1
            self.seconds["given up"] += time.process_time() - start
            raise

    def solve_system(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """An iteration."""
        self.iterations += 1
        return self.timed("linear systems", function)(*arguments)

    def columns(self, unknowns: int, spent: float) -> tuple[Any, ...]:
        """COLUMNS of a solution that has taken so many seconds."""
        shares = (100 * seconds / spent for seconds in self.seconds.values())
        counts = self.solutions, self.given_up, self.iterations
        return unknowns, spent, *counts, *shares, self.iterations * factorisation(unknowns)


@cache
def factorisation(unknowns: int) -> float:
    """The seconds that LAPACK takes to solve a dense system, the best of REPETITIONS."""
    matrix = np.eye(unknowns) + np.random.default_rng(0).random((unknowns, unknowns)) / unknowns
    right, seconds = np.ones(unknowns), list[float]()
    for _ in range(REPETITIONS):
        start = time.perf_counter()
        np.linalg.solve(matrix, right)
        seconds.append(time.perf_counter() - start)
    return min(seconds)


@contextmanager
def clock() -> Iterator[Clock]:
    """Measure the solutions of this process."""
    measured, system = Clock(), WoodburySystem.solve
    solve_from = partial(measured.solve_from, step.solve_from)
    with ExitStack() as stack:
        for owner, name, function in (
            (step, "solve_from", solve_from),
            (WoodburySystem, "solve", lambda *arguments: measured.solve_system(system, *arguments)),
            (StepWater, "flow", measured.timed("water", StepWater.flow)),
            (StepFlow, "tangent", measured.timed("water", StepFlow.tangent)),
        ):
            stack.enter_context(patch.object(owner, name, function))
        yield measured


#: What is measured of scenes and rows: CPU seconds, numbers, the parts of the seconds [%] in
#: solutions that were given up, in linear systems and in the water, and the seconds that LAPACK
#: takes to factorise as many matrices of all unknowns, below which no Newton's method comes that
#: factorises one in each iteration.
COLUMNS = (
    *("unknowns", "seconds", "solutions", "given up", "iterations"),
    *("given up [%]", "linear systems [%]", "water [%]", "LAPACK alone"),
)


def hard(measurements: Measurements) -> Table:
    """Solve hard scenes and random dams in 2D: COLUMNS of the load steps."""
    table = Table("hard", "scene", *COLUMNS, "end")
    scenes = {name: partial(load, *case) for name, case in NAMED.items()}
    for number in range(FEW if measurements.short else RANDOM):
        scene = random_scene(SEED, number)
        if scene.case["dim"] == 2:
            scenes[f"random {SEED}-{number}"] = partial(getattr, scene, "case")
    for name, of in track(scenes.items(), "hard scenes"):
        table.add_measured(measurements, (name,), partial(measure_of, of))
    return table


def measure_of(case: Callable[[], Case]) -> tuple[Any, ...]:
    """`measure` a case that is loaded then."""
    return measure(case())


def measure(case: Case) -> tuple[Any, ...]:
    """Measure a scene; returns the columns of `hard` but for the first."""
    with threadpool_limits(1), clock() as measured:
        stepper = LoadStepper(case, interface_of(case))
        start = time.process_time()
        result = stepper.run()
        columns = measured.columns(stepper.model.equilibrium.bulk.size, time.process_time() - start)
    return *columns, verdict(result)


def rows(measurements: Measurements) -> Table:
    """Compute a further row of sweeps with `--critical`: COLUMNS of the search of the critical
    level, the level, and whether it is confirmed.
    """
    table = Table("rows", "row", *COLUMNS, "level [m]", "confirmed")
    for name in track(list(ROWS)[:1] if measurements.short else ROWS, "rows"):
        table.add_measured(measurements, (name,), partial(measure_row, *ROWS[name]))
    return table


def measure_row(
    settings: dict[str, Any], varied: str, values: tuple[float, float]
) -> tuple[Any, ...]:
    """Measure a row after another one; returns the columns of `rows` but for the first."""
    with threadpool_limits(1):
        for value in values:  # the first one condenses the bodies
            search = Search(load("dam", settings | {varied: value}), "level")
            with clock() as measured:
                start = time.process_time()
                answer = search.find()
                spent = time.process_time() - start
        unknowns = search.trials[0].path.stepper.model.equilibrium.bulk.size
        columns = measured.columns(unknowns, spent)
    return *columns, answer.value, "yes" if answer.confirmed else "no"


def slowest(table: Table) -> Table:
    """The rows of the named scenes and of the slowest others."""
    rows = list(zip(*table.values(), strict=True))
    seconds = list(table).index("seconds")
    others = sorted(rows[len(NAMED) :], key=lambda row: -row[seconds])
    chosen = Table(table.name, *table)
    for row in rows[: len(NAMED)] + others[:SLOWEST]:
        chosen.add(*row)
    return chosen
