"""What a user waits for: start, pictures and fields of runs, critical values, earthquakes; and the
order in which large 3D bodies are condensed.
"""

from __future__ import annotations

import tempfile
import time
from functools import partial
from typing import Any
from unittest import mock

import numpy as np
from damjoint import data
from damjoint.dynamics.history import QuakeHistory
from damjoint.dynamics.record import Record
from damjoint.dynamics.step import TimeStep
from damjoint.dynamics.stepper import Earthquake
from damjoint.engines.getdp import quake as getdp_quake
from damjoint.fem import factor
from damjoint.fem.bodies import Bodies
from damjoint.fem.condensation import condense
from damjoint.input.resolve import load
from damjoint.joint.interface import Interface
from damjoint.progress import track
from damjoint.solver.load_stepper import LoadStepper
from damjoint.studies.critical import Search
from threadpoolctl import threadpool_limits

from .bench_scenes import PUBLISHED, TABLES_ONLY, run_cold, time_process
from .bench_table import Measurements, Table

#: What `start` compares with.
NUMPY = "interpreter and numpy"

#: Searches of a critical value: quantity and settings of the case `dam`.
SEARCHES: dict[str, tuple[str, dict[str, Any]]] = {
    "level, law rupture": ("level", {"law": "rupture"}),
    "k_h, law rupture": ("k_h", {"law": "rupture"}),
    "strength, law bond": ("strength", {"law": "bond"}),
    "strength, bond, flow": ("strength", {"law": "bond", "uplift": "flow"}),
    "level, bond, cracked": ("level", {"law": "bond", "uplift": "cracked"}),
    "rupture, 20 elements": ("level", {"law": "rupture", "n_joint": 20.0}),
}


def start(measurements: Measurements) -> Table:
    """Measure the seconds of short commands in new processes, the best of five: tables of modeling
    C without a cache and from a cache that has its mesh and condensed bodies.
    """
    repetitions = 1 if measurements.short else 5
    table = Table("start", "command", "seconds", "times interpreter and numpy")
    seconds = dict[str, Any]()
    with tempfile.TemporaryDirectory() as cache:
        calls = {
            NUMPY: partial(time_process, ["-c", "import numpy"]),
            "damjoint --version": partial(time_process, ["-m", "damjoint", "--version"]),
            "damjoint --help": partial(time_process, ["-m", "damjoint", "--help"]),
            "run c, tables, no cache": lambda: run_cold("c")[0],
            "run c, tables, cache": lambda: run_cold("c", cache=cache)[0],
        }
        for command, call in track(calls.items(), "start"):
            best = lambda call=call: min(call() for _ in range(repetitions + 1))
            seconds[command] = measurements.get((table.name, command), best)
            table.add(command, seconds[command], seconds[command] / seconds[NUMPY])
    return table


def pictures(measurements: Measurements) -> Table:
    """Measure the seconds of plane modelings in new processes without a cache: tables only, with
    fields, with the picture, with both (the default).
    """
    files = {
        "tables": TABLES_ONLY,
        "with fields": TABLES_ONLY[1:],
        "with picture": TABLES_ONLY[:1],
        "with both": (),
    }
    table = Table("pictures", "case", *files, "both over tables", "published")

    def measure(name: str) -> tuple[Any, ...]:
        spent = [run_cold([name], options)[0] for options in files.values()]
        return *spent, spent[-1] / spent[0], PUBLISHED[name]

    plane = [name for name in PUBLISHED if load(name)["dim"] == 2]
    for name in track("c" if measurements.short else plane, "pictures"):
        table.add_measured(measurements, (name,), partial(measure, name))
    return table


def orders(measurements: Measurements) -> Table:
    """Measure the seconds in which 3D bodies are condensed, in METIS's order and in MUMPS's own,
    one thread; and the largest difference of the condensed stiffness over its largest entry.
    """
    heads = "unknowns", "METIS", "MUMPS's own", "ratio", "difference"
    table = Table("orders", "n_joint", *heads)

    def measure(n: int) -> tuple[Any, ...]:
        size = {"dim": 3.0, "order": 1.0, "n_joint": n, "n_layers": max(1, n // 5)}
        case = load("a", size | {"h_dam": 20 / n, "h_found": 40 / n}, "9")
        bodies = Bodies.of(case)
        with threadpool_limits(1):
            first = condense(case, bodies)
            with mock.patch.object(factor, "metis", return_value=None):
                second = condense(case, bodies)
        spent = [bulk.seconds["condensation"] for bulk in (first, second)]
        one, other = np.asarray(first.stiffness), np.asarray(second.stiffness)
        ratio, relative = spent[1] / spent[0], np.abs(one - other).max() / np.abs(one).max()
        return first.unknowns, *spent, ratio, relative

    for n in track((20,) if measurements.short else (60, 90), "orders"):
        table.add_measured(measurements, (n,), partial(measure, n))
    return table


def critical(measurements: Measurements) -> Table:
    """Measure searches of critical values of the case `dam` in this process: seconds, meshing and
    condensation included, dams and equilibria computed, the value, and whether it is confirmed.
    """
    heads = "seconds", "dams", "equilibria", "value", "gravity method", "mode", "confirmed"
    table = Table("critical", "search", *heads)

    def measure(of: str, settings: dict[str, Any]) -> tuple[Any, ...]:
        coarse = {"n_joint": 20.0} if measurements.short else {}
        search = Search(load("dam", coarse | settings), of)
        begin = time.perf_counter()
        answer = search.run()
        if answer.error:
            raise answer.error
        spent = time.perf_counter() - begin
        equilibria = sum(len(trial.path.points) for trial in search.trials)
        values = answer.value, answer.gravity, answer.mode, "yes" if answer.confirmed else "no"
        return spent, len(search.trials), equilibria, *values

    for name in track(list(SEARCHES)[:: 2 if measurements.short else 1], "critical"):
        table.add_measured(measurements, (name,), partial(measure, *SEARCHES[name]))
    return table


#: The dam of 45 m in an earthquake: it slides, opens and closes.
QUAKE: dict[str, Any] = {
    "law": "friction",
    "mu": 0.8,
    "adhesion": 1e4,
    "pena_tang": 0.0,
    "uplift": "imposed",
}
QUAKE |= {"record_unit": "m/s2", "record_scale": 3.0, "dt": 0.0025, "n_joint": 40.0}
SOLID = {"dim": 3.0, "mesh_pattern": "split", "thickness": 10.0, "n_layers": 4.0, "order": 1.0}
SOLID |= {"n_joint": 20.0}
#: Scenes, and the part of the record [s] that is computed.
QUAKES: dict[str, tuple[dict[str, Any], float]] = {
    "2D, order 1, 0.5 s": ({"order": 1.0}, 0.5),
    "2D, order 2, 0.5 s": ({}, 0.5),
    "3D, order 1, 0.1 s": (SOLID, 0.1),
    "2D, order 2, whole record": ({}, np.inf),
}
#: Time of the record at which its strong part begins [s].
STRONG = 3.0


def quakes(measurements: Measurements) -> Table:
    """Measure time steps of an earthquake in both engines, one thread: milliseconds a step, set-up
    of the condensed engine in its steps, most halvings of a step, largest difference of the slip
    over the largest slip. The whole record by the condensed engine alone.
    """
    heads = "unknowns", "steps", "ms a step", "set-up in steps", "halvings"
    table = Table("quakes", "scene", *heads, "seconds", "GetDP: ms a step", "ratio", "difference")
    short = list(QUAKES)[:1]
    for name in track(short if measurements.short else QUAKES, "quakes"):
        table.add_measured(measurements, (name,), partial(measure_quake, *QUAKES[name]))
    return table


def measure_quake(settings: dict[str, Any], span: float) -> tuple[Any, ...]:
    """Measure a part [s] of a record; returns the columns of `quakes` but for the first."""
    start = {"record_start": STRONG} if np.isfinite(span) else {}
    record = data("reference") / "friuli.csv"
    case = load("dam", QUAKE | start | settings, "40", record=record)
    with threadpool_limits(1):
        bodies = Bodies.of(case)
        static = LoadStepper(case, Interface(condense(case, bodies), case["quadrature"]))
        static.run()
        begin = time.perf_counter()
        quake = Earthquake(static.case, static.model, static.state, bodies)
        quake.steps_of_length[0] = TimeStep(quake.problem, quake.dt)
        set_up = time.perf_counter() - begin
        quake.record = first_part(quake.record, span)
        history = QuakeHistory.of(quake)
        begin = time.perf_counter()
        for step in quake.steps():
            history.add(quake, step)
        spent = time.perf_counter() - begin
    number, times, slip = len(history), history.table["time"], history.table["slip_mean"]
    each = spent / number
    columns = quake.system.size, number, 1e3 * each, set_up / each, quake.halvings, spent
    if not np.isfinite(span):
        return *columns, "", "", ""
    other = getdp_quake.solve(quake.case, quake.record, quake.damping, quake.dt, lambda _time: None)
    if other.error:
        raise other.error
    by_getdp = other.seconds["earthquake"] / len(other.rows["time"])
    slip = np.interp(other.rows["time"], times, slip)  # a halved step has rows of its own
    difference = np.abs(other.rows["slip_mean"] - slip).max() / np.abs(slip).max()
    return *columns, 1e3 * by_getdp, by_getdp / each, difference


def first_part(record: Record, span: float) -> Record:
    """A record up to a time [s]."""
    shown = record.times <= span
    return Record(record.times[shown], record.acceleration[shown])
