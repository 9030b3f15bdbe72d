"""Benchmarks: wall time and memory beside the published code's, error against time, growth, what
each option costs.
"""

from __future__ import annotations

import contextlib
import csv
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
from damjoint import RunError
from damjoint import accuracy as on_request
from damjoint.engines import engine_of
from damjoint.engines.condensed.cache import interface_of
from damjoint.fem.bodies import Bodies
from damjoint.fem.condensation import condense
from damjoint.joint.interface import Interface
from damjoint.model.case import ACCURACIES, Case, load
from damjoint.model.fields import along
from damjoint.model.results import Results
from damjoint.post import tables
from damjoint.post.validation import reference_time
from damjoint.run import run
from damjoint.solver.load_stepper import LoadStepper
from damjoint.statics.verdict import statement
from damjoint.storage import atomic_write
from damjoint.studies.sweep import pool_of, stepped
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from .provenance import provenance

#: code_aster 15.2, sequential, on a 2-core machine: seconds of wall time of the whole job without
#: meshing.
PUBLISHED = {
    "a": 3.9,
    "b": 44.1,
    "c": 2.0,
    "d": 19.1,
    "e": 25.4,
    "f": 168,
    "g": 5.1,
    "h": 27.6,
    "i": 4.6,
    "j": 3.7,
    "k": 5.2,
}

#: Scenes of the error-against-time benchmark: case, and what it is about.
SCENES = {"rupture": "a", "friction": "c", "flow": "e"}
QUANTITIES = ("heel_opening", "toe_stress", "crack_tip", "slip", "leakage")

#: Where the seconds of a run go; start: Python, libraries, reading the case.
PARTS = ("start", "mesh", "assembly", "condensation", "newton", "post")

#: What run.json calls a part that has another name here.
PART_OF_RUN = {"newton": "solve"}


def cold(arguments: list[str]) -> tuple[float, dict]:
    """Wall seconds and run.json of a damjoint run in a process of its own, with an empty cache, no
    fields, no picture.

    Raises RunError if it fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        command = [
            sys.executable,
            "-m",
            "damjoint.cli",
            "run",
            *arguments,
            "--no-fields",
            "--no-picture",
            "--out",
            f"{folder}/out",
        ]
        start = time.perf_counter()
        done = subprocess.run(
            command,
            env={**os.environ, "DAMJOINT_CACHE": ""},
            stdout=subprocess.DEVNULL,
            check=False,
        )
        wall = time.perf_counter() - start
        if done.returncode:
            raise RunError(
                f"bench: damjoint run {' '.join(arguments)} ended with exit code {done.returncode}"
            )
        told = json.loads(Path(folder, "out", "run.json").read_text())
        for further in Path(folder, "out").glob("*/run.json"):  # the other scene
            seconds = json.loads(further.read_text())["wall_seconds"]
            for part in ("solve", "post"):
                told["wall_seconds"][part] += seconds[part]
        return wall, told


class Kept:
    """What a benchmark has measured so far, a line of JSON each: one that was interrupted goes on
    where it was.

    The first line names code and machine; what another has measured is not taken. What is taken
    keeps the day on which it was begun.
    """

    def __init__(self, path: Path, short: bool) -> None:
        self.path, self.short = path, short
        #: of all that is measured
        self.provenance = provenance()
        lines = path.read_text().splitlines() if path.exists() else []
        self.known: dict[str, object] = {}
        with contextlib.suppress(ValueError):  # a half-written last line
            if lines and (begun := self.begun(json.loads(lines[0]))):
                self.provenance = begun
                for line in lines[1:]:
                    key, value = json.loads(line)
                    self.known[json.dumps(key)] = value
        pairs = [[json.loads(key), value] for key, value in self.known.items()]
        with atomic_write(path) as part:
            lines = [[short, self.provenance], *pairs]
            part.write_text("".join(json.dumps(one) + "\n" for one in lines))

    def begun(self, first: object) -> dict[str, str] | None:
        """The provenance in a file's first line, if it is of the same benchmark, code and
        machine.
        """
        match first:
            case [self.short, {"code": code, "machine": on} as found]:
                same = code == self.provenance["code"] and on == self.provenance["machine"]
                return found if same else None
        return None

    def has(self, key: tuple) -> bool:
        """Whether something was measured under a key."""
        return json.dumps(key) in self.known

    def once(self, key: tuple, measured: Callable[[], object]) -> object:
        """What was measured under a key; measured now if it was not. JSON's types alone."""
        name = json.dumps(key)
        if name not in self.known:
            self.known[name] = plain(measured())
            with self.path.open("a") as file:
                file.write(json.dumps([key, self.known[name]]) + "\n")
        return self.known[name]


def plain(value: object) -> object:
    """A value of JSON's types: numpy's numbers as Python's, tuples and arrays as lists."""
    if isinstance(value, (list, tuple, np.ndarray)):
        return [plain(one) for one in value]
    return value.item() if isinstance(value, np.generic) else value


class Table(dict):
    """Columns of a table, {name: values}, filled row by row."""

    def __init__(self, name: str, *columns: str) -> None:
        super().__init__({column: [] for column in columns})
        self.name = name

    def add(self, *values: object) -> None:
        """One more row."""
        for column, value in zip(self.values(), values, strict=True):
            column.append(value)

    def once(self, kept: Kept, key: tuple, cells: Callable[[], Sequence]) -> None:
        """One more row: a key of its first columns, and the cells that are measured under it."""
        self.add(*key, *kept.once((self.name, *key), cells))

    def rows(self, *where: object) -> np.ndarray:
        """Indices of the rows whose first columns have these values."""
        return np.flatnonzero(
            [row[: len(where)] == where for row in zip(*self.values(), strict=True)]
        )


def bar(things: Iterable, title: str) -> Iterable:
    """The things with a progress bar, on a terminal."""
    return tqdm(things, desc=title, disable=not sys.stderr.isatty())


def cases(kept: Kept) -> Table:
    """Each modeling, all its scenes, published steps, meshes of the document's size: seconds and
    where they went, MB, ratio to the published code; unless short, the plain engine's, too.
    """
    columns = "seconds", *PARTS, "MB", "published", "times faster", "GetDP", "times faster, GetDP"
    table = Table("cases", "case", *columns)

    def one(name: str) -> tuple:
        wall, told = cold([name])
        spent = [told["wall_seconds"][PART_OF_RUN.get(part, part)] for part in PARTS[1:]]
        getdp = float("nan") if kept.short else cold([name, "--engine", "getdp"])[0]
        published = PUBLISHED[name]
        faster = published, published / wall, getdp, published / getdp
        return wall, wall - sum(spent), *spent, told["peak_memory_mb"], *faster

    for name in bar(PUBLISHED, "cases"):
        table.once(kept, (name,), partial(one, name))
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


def measure(case: Case) -> tuple[Results, dict[str, float]]:
    """Solve a scene in this process; the seconds of PARTS but the start, and the number of
    unknowns.
    """
    bulk = condense(case, Bodies.of(case))
    begin = time.perf_counter()
    result = LoadStepper(case, Interface(bulk, case["quadrature"])).run()
    done = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        tables.write(result, Path(folder))
    return result, {
        **bulk.seconds,
        "newton": done - begin,
        "post": time.perf_counter() - done,
        "unknowns": bulk.unknowns,
    }


def read_off(result: Results) -> np.ndarray:
    """QUANTITIES where the published numbers are read (at the last level, or at the end of the
    prescribed displacement), means over z; the crack's tip where the opening interpolates to zero.
    """
    times = result.history["time"]
    reached = np.flatnonzero(np.isclose(times, reference_time(result.case)))
    step = reached[0] if len(reached) else -1  # a mesh far too coarse may stop before
    mean = along(result.at(times[step]))
    x, opening = mean["x"], mean["delta_n"]
    last = np.flatnonzero(opening > 0).max(initial=0)
    tip = (
        x[last] + (x[last + 1] - x[last]) * opening[last] / (opening[last] - opening[last + 1])
        if opening[last] > 0
        else 0.0
    )
    slip = np.sum((mean["slip"][1:] + mean["slip"][:-1]) / 2 * np.diff(x)) / x[-1]
    ends = result.heel[step], mean["sigma_n"][-1], tip, slip, result.history["flux"][step]
    return np.array(ends)


def worst(found: np.ndarray, exact: np.ndarray) -> float:
    """The largest relative difference of QUANTITIES."""
    return float(np.max(errors(found, exact)))


def errors(found: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """Relative differences; 0 where the exact value is."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(exact == 0, 0, np.abs(found / exact - 1))


def settings(
    order: int, n: int, grading: float, pattern: str, dim: int, height: float = 10.0
) -> dict:
    """Mesh parameters of one point of the error-against-time benchmark; grading 1 as --accuracy,
    smaller finer far away.
    """
    # as pro/parameters.pro has them
    sizes = {"h_dam": 1.25 * grading * height / n**0.5, "h_found": 2.5 * grading * height / n**0.5}
    solid = (
        {"dim": 3.0, "thickness": 0.2 if pattern == "free" else 1.0, "n_layers": 1.0, "hold_z": 1.0}
        if dim == 3
        else {"dim": 2.0}
    )
    return {"order": float(order), "n_joint": float(n), "mesh_pattern": pattern, **sizes, **solid}


def overkill(kept: Kept) -> tuple[dict[str, np.ndarray], Table]:
    """QUANTITIES of each modeling's main scene on the finest mesh, {case: values}, and for SCENES
    how they got there: observed order and remaining error by extrapolation.

    Plane strain of order 2, 640 elements along the joint (80 if short), twice finer than --accuracy
    far away; the 3D modelings are plane, too (nu = 0, nothing varies along z).
    """
    sizes = (20, 40, 80) if kept.short else (160, 320, 640)
    columns = *(f"n = {n}" for n in sizes), "observed order", "remaining error [%]"
    exact, table = {}, Table("overkill", "scene", "quantity", *columns)

    def one(name: str, n: int) -> np.ndarray:
        chosen = settings(2, n, 0.5, "free", 2) | {"uplift": main_uplift(name)}
        return read_off(measure(load(name, chosen))[0])

    for name in bar(SCENES.values() if kept.short else PUBLISHED, "overkill"):
        wanted = sizes if name in SCENES.values() else sizes[-1:]
        found = [kept.once(("overkill", name, n), partial(one, name, n)) for n in wanted]
        exact[name] = np.array(found[-1])
        if len(found) == 1:
            continue
        scene = next(s for s, c in SCENES.items() if c == name)
        for quantity, values in zip(QUANTITIES, np.transpose(found), strict=True):
            if values[-1]:
                before, last = np.abs(np.diff(values))
                order = np.log2(before / last) if last else np.inf
                # Richardson; where the differences do not shrink as they should, the last of them
                remaining = last / (2**order - 1) if order > 1 else last
                table.add(scene, quantity, *values, order, 100 * remaining / abs(values[-1]))
    return exact, table


def accuracy(kept: Kept, exact: dict[str, np.ndarray], start: float) -> Table:
    """Error of QUANTITIES against the overkill solution, and the seconds spent: a row per scene and
    mesh, published steps, and for one mesh other numbers of steps.
    """
    mesh = "dim", "pattern", "order", "n_joint", "grading", "steps"
    found = "unknowns", "seconds", *PARTS, *(f"error_{q}" for q in QUANTITIES), "worst"
    table = Table("accuracy", "scene", *mesh, *found)
    numbers = (10, 20) if kept.short else (10, 20, 40, 80, 160, 320)
    gradings = (1.0,) if kept.short else (2.0, 1.0, 0.5)
    published = "published"
    runs = [
        (2, "free", order, n, grading, published)
        for order in (1, 2)
        for n in numbers
        for grading in gradings
    ]
    runs += [(2, "regular", order, n, 1.0, published) for order in (1, 2) for n in numbers]
    runs += [
        (3, pattern, order, n, 1.0, published)
        for pattern, most in (("layers", 80), ("split", 160), ("free", 40))
        for order in (1, 2)
        for n in numbers
        if n <= most
    ]
    runs += [(2, "free", 2, numbers[-2], 1.0, steps) for steps in (1, 2, 4)]

    def one(name: str, chosen: tuple) -> tuple:
        dim, pattern, order, n, grading, steps = chosen
        asked = settings(order, n, grading, pattern, dim) | {"uplift": main_uplift(name)}
        case = load(name, asked, steps=None if steps == published else steps)
        result, spent = measure(case)
        spent["start"] = start
        parts = [spent[p] for p in PARTS]
        off = errors(read_off(result), exact[name])
        return spent["unknowns"], sum(parts), *parts, *off, max(off)

    for scene, name in SCENES.items():
        for chosen in bar(runs, scene):
            table.once(kept, (scene, *chosen), partial(one, name, chosen))
    return table


def recommended(kept: Kept, exact: dict[str, np.ndarray]) -> Table:
    """Each modeling's main scene: worst error of the published mesh and steps, and error and
    seconds of --accuracy.
    """
    levels = list(ACCURACIES)[: 1 if kept.short else None]
    told = "error [%]", "seconds", "of these start"
    columns = (f"{level}: {what}" for level in levels for what in told)
    table = Table("recommended", "case", "published: error [%]", "published", *columns)

    def one(name: str) -> list:
        main = {"uplift": main_uplift(name)}
        row = [100 * worst(read_off(measure(load(name, main))[0]), exact[name]), PUBLISHED[name]]
        for level in levels:
            result = accurate(load(name, main, accuracy=level))
            wall, told = cold([name, "--accuracy", level, "--set", f"uplift={main['uplift']}"])
            error = 100 * worst(read_off(result), exact[name])
            row += [error, wall, wall - sum(told["wall_seconds"].values())]
        return row

    for name in bar(list(exact), "accuracy"):
        table.once(kept, (name,), partial(one, name))
    table.add(
        "sum, worst", *(max(c) if "error" in n else sum(c) for n, c in table.items() if n != "case")
    )
    return table


def accurate(case: Case) -> Results:
    """The results of a scene, on the mesh that its accuracy asks for."""
    engine = engine_of(case, "auto")
    return next(on_request.solve(case, engine, lambda *_: None, False)).result


#: Ordinary concrete on rock, with a weak joint: E [Pa], strengths [Pa].
ROCK = {"E_dam": 2e10, "E_found": 3e10, "sigma_max": 2e4, "adhesion": 1e5, "mu": 1.0}

#: Scenes of a real dam's stiffness: case, parameters besides ROCK, levels [m].
DAMS = {
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


def estimates(kept: Kept) -> Table:
    """Errors in percent that --accuracy estimates of DAMS, and the true ones, "estimated / true",
    by the same mesh rule with 1024 elements along the joint (256 if short), in 3D with 96, and a
    quarter of the load steps.
    """
    finest, levels = (256.0, ["coarse"]) if kept.short else (1024.0, ["coarse", "standard"])
    columns = [n for n in on_request.QUANTITIES if n not in ("level", "toe_stress")]
    table = Table("estimates", "scene", "accuracy", "reached", "n_joint", *columns)

    def one(scene: str) -> list[list]:
        name, differs, stiffness, water = DAMS[scene]
        chosen = ROCK | {"K_N": stiffness, "K_T": stiffness} | differs
        solid = chosen.get("dim") == 3
        rows, exact = [], None
        for level in levels[:1] if solid else levels:
            case = load(name, chosen, water, accuracy=level)
            result = accurate(case)
            exact = exact or measure(on_finest(case, 96.0 if solid else finest))[0]
            told = result.info["error_estimate"]
            cells = [off(n, told["quantities"], result, exact) for n in columns]
            rows.append([level, "yes" if told["reached"] else "no", told["n_joint"][-1], *cells])
        return rows

    for scene in bar(DAMS, "estimates"):
        if not kept.short or "imposed" in scene:
            for row in kept.once(("estimates", scene), partial(one, scene)):
                table.add(scene, *row)
    return table


def on_finest(case: Case, n: float) -> Case:
    """A case on a mesh of n elements along the joint, by the rule of --accuracy, each load step cut
    in four.
    """
    found = on_request.refine_mesh(case, n / case["n_joint"])
    return replace(on_request.halve_steps(on_request.halve_steps(found)), accuracy=None)


def off(name: str, told: dict, result: Results, exact: Results) -> str:
    """Estimated and true error of a quantity, at all levels that both have reached [%]."""
    if name not in told:
        return ""
    one = told[name]
    times = [t for t in on_request.reached_times(result) if t in on_request.reached_times(exact)]
    pair = [np.array(on_request.quantities_at(r, sorted(times))[name]) for r in (result, exact)]
    scale = one["error"] / one["relative"] if one["relative"] else np.abs(pair[1]).max() or 1.0
    return f"{100 * one['relative']:.2g} / {100 * np.abs(pair[0] - pair[1]).max() / scale:.2g}"


def main_uplift(name: str) -> str:
    """The main uplift mode of a case."""
    return str(load(name)["uplift"])


def front(seconds: np.ndarray, error: np.ndarray, gain: float = 1.0) -> np.ndarray:
    """Indices of the points that no other beats in both time and error, by time; each below `gain`
    times the error before.
    """
    chosen = []
    for i in np.argsort(seconds):
        if not chosen or error[i] < gain * error[chosen[-1]]:
            chosen.append(i)
    return np.array(chosen)


def growth(kept: Kept) -> Table:
    """Seconds and memory against the number of unknowns, each size in a process of its own."""
    table = Table("growth", "dim", "order", "n_joint", "unknowns", "seconds", "MB")
    sizes = [(2, 2, n) for n in ((50, 100) if kept.short else (50, 100, 200, 400))]
    sizes += [(3, 1, n) for n in ((20,) if kept.short else (20, 40, 60, 90, 125))]

    def one(dim: int, order: int, n: int) -> tuple:
        chosen = {
            "dim": dim,
            "order": order,
            "n_joint": n,
            "mesh_pattern": "free",
            "uplift": "imposed",
        }
        # uniform refinement: every size goes with the joint's
        chosen |= (
            {"h_dam": 15 / n, "h_found": 40 / n}
            if dim == 2
            else {"n_layers": max(1, n // 5), "h_dam": 20 / n, "h_found": 40 / n}
        )
        pairs = [part for k, v in chosen.items() for part in ("--set", f"{k}={v}")]
        wall, told = cold(["a", *pairs, "--levels", "9"])
        return told["unknowns"], wall, told["peak_memory_mb"]

    for size in bar(sizes, "growth"):
        table.once(kept, size, partial(one, *size))
    return table


def beyond_memory() -> str:
    """What a run says whose joint alone needs more than the machine has."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            run(
                load("b", {"n_joint": 1000.0, "n_layers": 1000.0}),
                Path(folder),
                False,
                False,
                False,
            )
        except RunError as error:
            return str(error)
    raise RunError("bench: a joint beyond the memory has run")


def exponents(table: Table) -> list[str]:
    """Fitted exponents of time and memory over the three largest sizes."""
    lines = []
    for dim in (2, 3):
        rows = [i for i, d in enumerate(table["dim"]) if d == dim][-3:]
        if len(rows) > 1:
            n = np.log([table["unknowns"][i] for i in rows])
            fits = [
                np.polyfit(n, np.log([table[c][i] for i in rows]), 1)[0] for c in ("seconds", "MB")
            ]
            lines.append(f"{dim}D: time ~ unknowns^{fits[0]:.2f}, memory ~ unknowns^{fits[1]:.2f}")
    return lines


def switches(kept: Kept) -> Table:
    """What a scene pays for each thing it may need: seconds with and without, in one process, best
    of three.
    """

    def best(call: Callable[[], object]) -> float:
        spent = []
        for _ in range(1 if kept.short else 3):
            start = time.perf_counter()
            call()
            spent.append(time.perf_counter() - start)
        return min(spent)

    def ratio(*calls: Callable[[], object]) -> tuple[float, float, float]:
        seconds = [best(call) for call in calls]
        return *seconds, seconds[0] / seconds[1]

    def filling(*about: object) -> Callable[[], object]:
        return lambda: LoadStepper(load("e", *about), joint).run()

    def whole(*about: object) -> Callable[[], object]:
        return lambda: measure(load("a", *about))

    def written(fields: bool, picture: bool) -> Callable[[], object]:
        return lambda: run(load("a"), Path(folder), fields, picture, False)

    table, dry = Table("switches", "option", "with", "without", "ratio"), {"uplift": "none"}
    with threadpool_limits(1), tempfile.TemporaryDirectory() as folder:
        e = load("e")
        joint = Interface(condense(e, Bodies.of(e)), e["quadrature"])
        for option, with_it, without in bar(
            [
                ("pressure unknowns (flow instead of none)", filling({}, "9"), filling(dry, "9")),
                (
                    "load unknown (drive=heel instead of level)",
                    filling(dry | {"drive": "heel"}, "8,9"),
                    filling(dry, "8,9"),
                ),
                ("20 steps instead of 1", filling(dry, "9", None, 20), filling(dry, "9")),
                (
                    "z (3D layers instead of 2D)",
                    whole(settings(2, 50, 1.0, "layers", 3), "9"),
                    whole(settings(2, 50, 1.0, "free", 2), "9"),
                ),
                (
                    "the bulk condensed anew (instead of kept)",
                    lambda: measure(load("e", dry, "9")),
                    filling(dry, "9"),
                ),
                (
                    "a fine mesh far from the joint",
                    whole({"order": 2.0, "h_dam": 0.1, "h_found": 0.1}, "9"),
                    whole({"order": 2.0}, "9"),
                ),
                ("fields for ParaView and Gmsh", written(True, False), written(False, False)),
                ("the picture", written(False, True), written(False, False)),
            ],
            "switches",
        ):
            table.once(kept, (option,), partial(ratio, with_it, without))
    return table


def sweeps(kept: Kept) -> Table:
    """What a sweep pays for one row more on a mesh that is condensed: a level between the last two
    (one step per level, as sweeps of levels take), and with published steps a joint that is weaker
    (sigma_max or mu), one that is stiffer (K_N, K_T); main scenes, published meshes, one thread.
    """
    rows = "first run", "another level", "steps", "another strength", "another stiffness"
    table = Table("sweeps", "case", "dim", *rows)

    def one(name: str, case: Case, main: dict) -> tuple:
        weaker = (
            {"sigma_max": 0.9 * case["sigma_max"]}
            if case["law"] == "rupture"
            else {"mu": 0.9 * case["mu"]}
        )
        stiffer = {"K_N": 1.1 * case["K_N"], "K_T": 1.1 * case["K_T"]}
        ends = [
            ",".join(map(str, (*case.levels[:-1], top)))
            for top in (case.levels[-1], (case.levels[-2] + case.levels[-1]) / 2)
        ]
        first, above = (load(name, main, levels) for levels in ends)
        with threadpool_limits(1):
            bulk, known, spent = condense(case, Bodies.of(case)), {}, []
            joint = Interface(bulk, case["quadrature"])
            runs = [partial(stepped, one, known, joint) for one in (first, above)]
            runs += [LoadStepper(load(name, main | s), joint).run for s in (weaker, stiffer)]
            for run_it in runs:
                start = time.perf_counter()
                run_it()
                spent.append(time.perf_counter() - start)
        return *spent[:2], len(case.times), *spent[2:]

    for name in bar("ac" if kept.short else PUBLISHED, "sweeps"):
        main = {"uplift": main_uplift(name)}
        case = load(name, main)
        if case["drive"] == "level":
            table.once(kept, (name, int(case["dim"])), partial(one, name, case, main))
    return table


def one_of_the_grid(values: tuple) -> tuple:
    """A combination of the stress grid: how it ended, the last level, iterations, cuts, seconds."""
    law, aperture, stiffness, young = values
    case = load(
        "e" if law == "rupture" else "g",
        settings(2, 50, 1.0, "free", 2)
        | {
            "aperture_min": aperture,
            "K_N": stiffness,
            "K_T": stiffness,
            "E": young,
            "pena_tang": 0.1 * stiffness,
        },
        "3,6,8,9,10",
    )
    with threadpool_limits(1):
        start = time.perf_counter()
        result = LoadStepper(case, interface_of(case)).run()
        spent = time.perf_counter() - start
    history = result.history
    level = history["level"][-1] if len(history["level"]) else 0.0
    end = statement(result).split(":")[0].replace(" (", ", ") or "converged"
    return (end, level, history["iterations"].sum(), history["cuts"].sum(), spent)


def stress(kept: Kept) -> Table:
    """The flow to its limits: closed aperture, joint and bulk stiffness over many decades, the
    reservoir filled to the crest.
    """
    grid = list(
        product(
            ("rupture", "friction"), (1e-9, 1e-8, 1e-6, 1e-4), (1e9, 1e12, 1e14), (1e10, 3e11, 3e12)
        )
    )
    grid = grid[::18] if kept.short else grid
    found = "end", "level", "iterations", "cuts", "seconds"
    table = Table("stress", "law", "aperture_min", "K_N", "E", *found)
    with pool_of(os.cpu_count() or 1) as pool:
        ends = {
            values: pool.submit(one_of_the_grid, values)
            for values in grid
            if not kept.has((table.name, *values))
        }
        for values in bar(grid, "stress"):
            table.once(kept, values, lambda v=values: ends[v].result())
    return table


def checks(kept: Kept) -> list[str]:
    """What holds to machine precision, on a fine mesh: equilibrium and mass balance."""
    return kept.once(("checks",), partial(precision, 80 if kept.short else 320))


def precision(n: int) -> list[str]:
    """`checks` with n elements along the joint."""
    case = load("g", settings(2, n, 1.0, "free", 2))
    result, spent = measure(case)
    last = {n: c[-1] for n, c in result.history.items()}
    thrust = case["rho_water"] * case["g"] * last["level"] ** 2 / 2
    rows = result.at()
    return [
        f"G with {spent['unknowns']} unknowns: shear over thrust minus one "
        f"{last['T'] / thrust - 1:.1e}",
        "flux at the toe over flux at the heel minus one "
        f"{rows['flux'][-1] / rows['flux'][0] - 1:.1e}",
    ]


def write_table(table: Table, path: Path) -> None:
    """A table as CSV."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table)
        writer.writerows(zip(*table.values(), strict=True))
