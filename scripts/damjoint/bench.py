"""Benchmarks: wall time and memory against the peer, error against time, growth, and what each option costs."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path

import numpy as np
from tabulate import tabulate
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from . import RunError, parameters
from .condense import condense
from .condensed import Filling
from .mesh import Mesh
from .parameters import Case
from .results import Results
from .sweep import bulk_of

#: code_aster 15.2, sequential, on a 2-core machine: seconds of wall time of the whole job without meshing.
PEER = {"a": 3.9, "b": 44.1, "c": 2.0, "d": 19.1, "e": 25.4, "f": 168, "g": 5.1, "h": 27.6, "i": 4.6, "j": 3.7, "k": 5.2}

#: Scenes of the error-against-time benchmark: case, and what it is about.
SCENES = {"rupture": "a", "friction": "c", "flow": "e"}
QUANTITIES = ("heel_opening", "toe_stress", "crack_tip", "slip", "leakage")


def cold(arguments: list[str]) -> tuple[float, float]:
    """Wall seconds and peak memory [MB] of a damjoint command in a process of its own, with an empty cache."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "damjoint.cli", *arguments, "--out", f"{folder}/out"]
        start = time.perf_counter()
        done = subprocess.run(command, env={**os.environ, "DAMJOINT_CACHE": ""}, stdout=subprocess.DEVNULL, check=False)
        wall = time.perf_counter() - start
        if done.returncode:
            raise RunError(f"bench: damjoint {' '.join(arguments)} ended with exit code {done.returncode}")
        return wall, json.loads(Path(folder, "out", "run.json").read_text())["peak_memory_mb"]


def cases(short: bool) -> dict[str, list]:
    """Each modeling, all its scenes, published steps, meshes of the document's size: seconds, MB, ratio to the peer;
    unless short, the plain engine's seconds too."""
    table = {"case": [], "seconds": [], "memory_mb": [], "peer_seconds": [], "times_faster": [], "getdp_seconds": []}
    for name in tqdm(PEER, desc="cases", disable=not sys.stderr.isatty()):
        wall, memory = cold(["run", name, "--no-fields", "--no-picture"])
        plain = float("nan") if short else cold(["run", name, "--no-fields", "--no-picture", "--engine", "getdp"])[0]
        for column, value in zip(table.values(), (name, wall, memory, PEER[name], PEER[name] / wall, plain), strict=True):
            column.append(value)
    for column, value in zip(table.values(), ("sum", sum(table["seconds"]), max(table["memory_mb"]), sum(table["peer_seconds"]),
                                              sum(table["peer_seconds"]) / sum(table["seconds"]), sum(table["getdp_seconds"])), strict=True):
        column.append(value)
    return table


def measure(case: Case) -> tuple[Results, dict[str, float]]:
    """Solve a scene in this process; seconds of mesh, condensation and Newton, and the number of unknowns."""
    marks = [time.perf_counter()]
    mesh = Mesh(case)
    marks.append(time.perf_counter())
    bulk = condense(case, mesh, max(case.tail_levels) > 0)
    marks.append(time.perf_counter())
    result = Filling(case, bulk).run()
    marks.append(time.perf_counter())
    return result, dict(zip(("mesh_s", "condense_s", "newton_s"), np.diff(marks), strict=True), unknowns=bulk.unknowns)


def read_off(result: Results) -> np.ndarray:
    """QUANTITIES at the last level, means over z; the crack's tip where the opening interpolates to zero."""
    rows = result.at()
    x = np.unique(np.round(rows["x"], 9))
    mean = {n: np.array([rows[n][np.abs(rows["x"] - v) < 1e-8].mean() for v in x]) for n in ("delta_n", "sigma_n", "slip")}
    opening = mean["delta_n"]
    last = np.flatnonzero(opening > 0).max(initial=0)
    tip = x[last] + (x[last + 1] - x[last]) * opening[last] / (opening[last] - opening[last + 1]) if opening[last] > 0 else 0.0
    slip = np.sum((mean["slip"][1:] + mean["slip"][:-1]) / 2 * np.diff(x)) / x[-1]
    return np.array([result.heel[-1], mean["sigma_n"][-1], tip, slip, result.history["flux"][-1]])


def settings(order: int, n: int, grading: float, pattern: str, dim: int, height: float = 10.0) -> dict:
    """Mesh parameters of one point of the error-against-time benchmark; grading 1 as --accuracy, smaller finer far away."""
    sizes = {"h_dam": grading * 1.25 * height / n**0.5, "h_found": grading * 2.5 * height / n**0.5}
    solid = {"dim": 3.0, "thickness": 5.0 / n if pattern != "free" else 0.2, "n_layers": 1.0, "hold_z": 1.0} if dim == 3 else {"dim": 2.0}
    return {"order": float(order), "n_joint": float(n), "mesh_pattern": pattern, **sizes, **solid}


def accuracy(short: bool) -> dict[str, list]:
    """Error of QUANTITIES against an overkill solution, and the seconds spent.

    Overkill: order 2, 320 elements along the joint (80 when short); its own remaining error is estimated from the
    observed order between the two finest meshes before it.
    """
    numbers = (10, 20) if short else (10, 20, 40, 80, 160)
    table: dict[str, list] = {n: [] for n in ("scene", "dim", "pattern", "order", "n_joint", "grading", "unknowns", "mesh_s", "condense_s",
                                              "newton_s", "seconds", *(f"error_{q}" for q in QUANTITIES))}
    with threadpool_limits(1):
        for scene, name in SCENES.items():
            finest = 80 if short else 320
            exact = read_off(measure(parameters.load(name, settings(2, finest, 0.5, "free", 2) | {"uplift": plain_uplift(name)}))[0])
            runs = [(2, pattern, order, n, grading) for pattern in ("free", "regular") for order in (1, 2) for n in numbers
                    for grading in ((1.0, 0.5) if pattern == "free" and not short else (1.0,))]
            runs += [(3, pattern, order, n, 1.0) for pattern in ("layers", "free") for order in (1, 2) for n in numbers if n <= 40]
            for dim, pattern, order, n, grading in tqdm(runs, desc=scene, disable=not sys.stderr.isatty()):
                case = parameters.load(name, settings(order, n, grading, pattern, dim) | {"uplift": plain_uplift(name)})
                result, spent = measure(case)
                with np.errstate(divide="ignore", invalid="ignore"):
                    error = np.where(exact == 0, 0, np.abs(read_off(result) / exact - 1))
                seconds = spent["mesh_s"] + spent["condense_s"] + spent["newton_s"]
                row = (scene, dim, pattern, order, n, grading, spent["unknowns"], *list(spent.values())[:3], seconds, *error)
                for column, value in zip(table.values(), row, strict=True):
                    column.append(value)
    return table


def plain_uplift(name: str) -> str:
    """The main uplift mode of a case."""
    return str(parameters.load(name)["uplift"])


def front(seconds: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Indices of the points that no other beats in both time and error, by time."""
    order = np.argsort(seconds)
    best = np.minimum.accumulate(error[order])
    return order[np.concatenate([[True], best[1:] < best[:-1]])]


def growth(short: bool) -> dict[str, list]:
    """Seconds and memory against the number of unknowns, each size in a process of its own."""
    table: dict[str, list] = {n: [] for n in ("dim", "order", "n_joint", "unknowns", "seconds", "memory_mb")}
    sizes = [(2, n) for n in ((50, 100) if short else (50, 100, 200, 400))]
    sizes += [(3, n) for n in ((20,) if short else (20, 40, 60, 80))]
    for dim, n in tqdm(sizes, desc="growth", disable=not sys.stderr.isatty()):
        chosen = {"dim": dim, "order": 2 if dim == 2 else 1, "n_joint": n, "mesh_pattern": "free", "uplift": "imposed"}
        # uniform refinement: every size goes with the joint's
        chosen |= {"h_dam": 15 / n, "h_found": 40 / n} if dim == 2 else {"n_layers": max(1, n // 5), "h_dam": 20 / n, "h_found": 40 / n}
        pairs = [part for k, v in chosen.items() for part in ("--set", f"{k}={v}")]
        wall, memory = cold(["run", "a", *pairs, "--levels", "9", "--no-fields", "--no-picture"])
        unknowns = count_unknowns(parameters.load("a", {k: parameters.parameter(k).check(v) for k, v in chosen.items()}))
        for column, value in zip(table.values(), (dim, chosen["order"], n, unknowns, wall, memory), strict=True):
            column.append(value)
    return table


def count_unknowns(case: Case) -> int:
    """Displacement unknowns of a case's mesh."""
    from .condense import Bodies

    bodies = Bodies.of(case, Mesh(case))
    free = bodies.dim * (len(bodies.dam.place) + len(bodies.foundation.place))
    return free - len(bodies.held_dam) - len(bodies.held_foundation)


def exponents(table: dict[str, list]) -> list[str]:
    """Fitted exponents of time and memory, from the two largest sizes on."""
    lines = []
    for dim in (2, 3):
        rows = [i for i, d in enumerate(table["dim"]) if d == dim][-3:]
        if len(rows) > 1:
            n = np.log([table["unknowns"][i] for i in rows])
            fits = [np.polyfit(n, np.log([table[c][i] for i in rows]), 1)[0] for c in ("seconds", "memory_mb")]
            lines.append(f"{dim}D: time ~ unknowns^{fits[0]:.2f}, memory ~ unknowns^{fits[1]:.2f}")
    return lines


def switches(short: bool) -> dict[str, list]:
    """What a scene pays for each thing it may need: seconds with and without, in one process, best of three."""
    def best(call: Callable[[], object]) -> float:
        spent = []
        for _ in range(1 if short else 3):
            start = time.perf_counter()
            call()
            spent.append(time.perf_counter() - start)
        return min(spent)

    with threadpool_limits(1):
        dry = parameters.load("e", {"uplift": "none"}, "9")
        wet = parameters.load("e", {}, "9")
        bulk = condense(dry, Mesh(dry), False)
        table: dict[str, list] = {"option": [], "with_s": [], "without_s": []}

        def add(option: str, with_it: Callable, without: Callable) -> None:
            for column, value in zip(table.values(), (option, best(with_it), best(without)), strict=True):
                column.append(value)

        fill = lambda case: lambda: Filling(case, bulk).run()  # noqa: E731
        add("pressure unknowns (flow instead of none)", fill(wet), fill(dry))
        add("load unknown (drive=heel instead of level)", fill(parameters.load("e", {"uplift": "none", "drive": "heel"}, "8,9")),
            fill(parameters.load("e", {"uplift": "none"}, "8,9")))
        add("20 steps instead of 1", fill(parameters.load("e", {"uplift": "none"}, "9", None, 20)), fill(dry))
        flat, solid = (parameters.load("a", settings(2, 50, 1.0, p, d), "9") for p, d in (("free", 2), ("layers", 3)))
        add("z (3D layers instead of 2D)", lambda: measure(solid), lambda: measure(flat))
        add("condensing the bulk anew (instead of keeping it)", lambda: measure(dry), fill(dry))
        fine = parameters.load("a", {"order": 2.0, "h_dam": 0.1, "h_found": 0.1}, "9")
        graded = parameters.load("a", {"order": 2.0}, "9")
        add("fine mesh far from the joint", lambda: measure(fine), lambda: measure(graded))
    table["ratio"] = [a / b for a, b in zip(table["with_s"], table["without_s"], strict=True)]
    return table


def one_of_the_grid(values: tuple) -> tuple:
    """A combination of the stress grid: values, how it ended, the last level, iterations, cuts, seconds."""
    law, aperture, stiffness, young = values
    case = parameters.load("e" if law == "rupture" else "g", settings(2, 50, 1.0, "free", 2) | {
        "aperture_min": aperture, "K_N": stiffness, "K_T": stiffness, "E": young, "pena_tang": 0.1 * stiffness}, "3,6,8,9,10")
    with threadpool_limits(1):
        start = time.perf_counter()
        result = Filling(case, bulk_of(case)).run()
        spent = time.perf_counter() - start
    history = result.history
    level = history["level"][-1] if len(history["level"]) else 0.0
    return (*values, result.stopped.split(":")[0] or "converged", level, history["iterations"].sum(), history["cuts"].sum(), spent)


def stress(short: bool) -> dict[str, list]:
    """The flow to its limits: closed aperture, joint and bulk stiffness over many decades, the reservoir filled to the crest."""
    grid = list(product(("rupture", "friction"), (1e-9, 1e-8, 1e-6, 1e-4), (1e9, 1e12, 1e14), (1e10, 3e11, 3e12)))
    grid = grid[::18] if short else grid
    columns = ("law", "aperture_min", "K_N", "E", "end", "level", "iterations", "cuts", "seconds")
    with ProcessPoolExecutor() as pool:
        rows = list(tqdm(pool.map(one_of_the_grid, grid), total=len(grid), desc="stress", disable=not sys.stderr.isatty()))
    return {name: list(column) for name, column in zip(columns, zip(*rows, strict=True), strict=True)}


def checks() -> list[str]:
    """What holds to machine precision, on a fine mesh: equilibrium and mass balance."""
    case = parameters.load("g", settings(2, 160, 1.0, "free", 2))
    result, _ = measure(case)
    last = {n: c[-1] for n, c in result.history.items()}
    thrust = case["rho_water"] * case["g"] * last["level"] ** 2 / 2
    rows = result.at()
    return [f"shear over thrust minus one: {last['T'] / thrust - 1:.1e}",
            f"flux at the toe over flux at the heel minus one: {rows['flux'][-1] / rows['flux'][0] - 1:.1e}"]


def draw(table: dict[str, list], path: Path) -> None:
    """Error (worst of the quantities) against time, log-log, with the efficient front, a panel per scene."""
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    columns = {n: np.array(c) for n, c in table.items()}
    worst = np.max([columns[f"error_{q}"] for q in QUANTITIES], axis=0)
    figure, panels = plt.subplots(1, len(SCENES), figsize=(13, 4.3), sharey=True, layout="constrained")
    for axes, scene in zip(panels, SCENES, strict=True):
        here = columns["scene"] == scene
        for dim, pattern, marker in ((2, "free", "o"), (2, "regular", "s"), (3, "layers", "^"), (3, "free", "v")):
            for order, color in ((1, "#cc7a00"), (2, "#0b5394")):
                rows = here & (columns["dim"] == dim) & (columns["pattern"] == pattern) & (columns["order"] == order)
                axes.loglog(columns["seconds"][rows], 100 * worst[rows], marker, color=color, markersize=4, alpha=0.7,
                            label=f"{dim}D {pattern}, order {order}")
        flat = np.flatnonzero(here & (columns["dim"] == 2))
        best = flat[front(columns["seconds"][flat], worst[flat])]
        axes.loglog(columns["seconds"][best], 100 * worst[best], "k-", linewidth=0.8, label="efficient front, 2D")
        axes.set(title=scene, xlabel="seconds (mesh, condensation, Newton)")
        axes.grid(alpha=0.3, which="both")
    panels[0].set_ylabel("worst error [%]")
    panels[-1].legend(fontsize=6)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def as_text(table: dict[str, list], digits: str = ".3g") -> str:
    """A table in Markdown."""
    return tabulate(table, headers="keys", tablefmt="github", floatfmt=digits)


def write(table: dict[str, list], path: Path) -> None:
    """A table as CSV."""
    path.write_text("\n".join([",".join(table)] + [",".join(str(v) for v in row) for row in zip(*table.values(), strict=True)]) + "\n")


def bench(out: Path, short: bool, readme: Path | None) -> None:
    """Run everything, write tables (CSV) and picture into out, print the tables; refresh the part of readme between
    the marks <!-- bench --> and <!-- /bench -->.
    """
    out.mkdir(parents=True, exist_ok=True)
    tables = {"cases": cases(short), "switches": switches(short), "growth": growth(short), "stress": stress(short),
              "accuracy": accuracy(short)}
    for name, table in tables.items():
        write(table, out / f"{name}.csv")
    draw(tables["accuracy"], out / "accuracy.png")
    columns = {n: np.array(c) for n, c in tables["accuracy"].items()}
    worst = np.max([columns[f"error_{q}"] for q in QUANTITIES], axis=0)
    rows = []
    for scene in SCENES:
        here = np.flatnonzero((columns["scene"] == scene) & (columns["dim"] == 2))
        for i in here[front(columns["seconds"][here], worst[here])]:
            rows.append((scene, columns["pattern"][i], columns["order"][i], columns["n_joint"][i], columns["unknowns"][i],
                         columns["seconds"][i], 100 * worst[i]))
    efficient = tabulate(rows, ("scene", "pattern", "order", "n_joint", "unknowns", "seconds", "worst error [%]"), "github", floatfmt=".3g")
    text = "\n\n".join([
        "Modelings, cold start, all scenes, published steps (seconds; peer: code_aster 15.2):", as_text(tables["cases"]),
        "Efficient settings in 2D:", efficient, "What a scene pays for:", as_text(tables["switches"]),
        "Flow pressed to its limits (aperture_min 1e-9 to 1e-4 m, K_N 1e9 to 1e14 Pa/m, E 1e10 to 3e12 Pa, level to the crest), how the "
        f"{len(tables['stress']['end'])} combinations end: " + ", ".join(f"{k} {v}" for k, v in Counter(tables["stress"]["end"]).items())
        + f"; at most {max(tables['stress']['seconds']):.1f} s each.",
        "Growth:", as_text(tables["growth"]), "; ".join(exponents(tables["growth"])), "; ".join(checks())])
    print(text)
    if readme:
        page = readme.read_text()
        readme.write_text(re.sub(r"(<!-- bench -->\n).*?(<!-- /bench -->)", lambda m: m[1] + text + "\n" + m[2], page, flags=re.S))
