"""Scenes of the benchmark, how they are run and timed, and the quantities that are compared."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from damjoint import RunError
from damjoint.fem.bodies import Bodies
from damjoint.fem.condensation import condense
from damjoint.input.case import Case
from damjoint.input.resolve import load
from damjoint.joint.interface import Interface
from damjoint.model.fields import along
from damjoint.model.results import Results
from damjoint.post import tables
from damjoint.post.validation import reference_time
from damjoint.solver.load_stepper import LoadStepper

#: Seconds of wall time of code_aster 15.2 for each modeling: sequential, on a 2-core machine, the
#: whole job without meshing.
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

#: Scenes of the error-against-time benchmark by their subject.
SCENES = {"rupture": "a", "friction": "c", "flow": "e"}
QUANTITIES = ("heel_opening", "toe_stress", "crack_tip", "slip", "leakage")

#: Parts of the seconds of a run; start: Python, libraries, reading the case.
PARTS = ("start", "mesh", "assembly", "condensation", "newton", "post")

#: Parts with another name in run.json.
PART_OF_RUN = {"newton": "solve"}


def time_process(arguments: Sequence[str], cache: str = "") -> float:
    """Run Python with arguments in a new process; wall seconds.

    cache: folder of the cache, empty for none. Raises RunError if the process fails.
    """
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, *arguments],
        env={**os.environ, "DAMJOINT_CACHE": cache},
        stdout=subprocess.DEVNULL,
        check=False,
    )
    wall = time.perf_counter() - start
    if done.returncode:
        words = " ".join(arguments)
        raise RunError(f"bench: python {words} ended with exit code {done.returncode}")
    return wall


#: Options of a run that writes tables only.
TABLES_ONLY = "--no-fields", "--no-picture"


def run_cold(
    arguments: Sequence[str], options: Sequence[str] = TABLES_ONLY, cache: str = ""
) -> tuple[float, dict[str, Any]]:
    """Run a case in a new process, without a cache by default.

    Returns wall seconds and run.json, whose seconds are summed over the scenes of the case. Raises
    RunError if the run fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "out")
        words = "-m", "damjoint", "run", *arguments, *options, "--out", str(out)
        wall = time_process(words, cache)
        record = json.loads((out / "run.json").read_text())
        for further in out.glob("*/run.json"):
            seconds = json.loads(further.read_text())["wall_seconds"]
            for part in ("solve", "post"):
                record["wall_seconds"][part] += seconds[part]
        return wall, record


def solve_timed(case: Case) -> tuple[Results, dict[str, float]]:
    """Solve a scene in this process.

    Returns the results, and the seconds of PARTS but the start with the number of `unknowns`.
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


def quantities(result: Results) -> np.ndarray:
    """Return QUANTITIES at the time of the published numbers (the last level, or the end of the
    prescribed displacement), as means over z.
    """
    times = result.history["time"]
    reached = np.flatnonzero(np.isclose(times, reference_time(result.case)))
    step = reached[0] if len(reached) else -1  # a far too coarse mesh may stop before
    mean = along(result.at(times[step]))
    x = mean["x"]
    slip = np.sum((mean["slip"][1:] + mean["slip"][:-1]) / 2 * np.diff(x)) / x[-1]
    tip = crack_tip(x, mean["delta_n"])
    flux = result.history["flux"][step]
    return np.array([result.heel[step], mean["sigma_n"][-1], tip, slip, flux])


def crack_tip(x: np.ndarray, opening: np.ndarray) -> float:
    """Return where the opening, linear between the nodes, falls to zero; 0 if nothing is open."""
    last = np.flatnonzero(opening > 0).max(initial=0)
    if opening[last] <= 0:
        return 0.0
    return x[last] + (x[last + 1] - x[last]) * opening[last] / (opening[last] - opening[last + 1])


def relative_errors(values: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """Return the relative differences; 0 where the exact value is 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(exact == 0, 0, np.abs(values / exact - 1))


def mesh_settings(order: int, n: int, grading: float, pattern: str, dim: int) -> dict[str, Any]:
    """Return the parameters of a mesh with n elements along the joint of a dam of 10 m.

    grading: element sizes far from the joint, relative to those of --accuracy.
    """
    # the automatic sizes of pro/parameters.pro
    sizes = {"h_dam": 12.5 * grading / n**0.5, "h_found": 25 * grading / n**0.5}
    if dim == 3:
        thickness = 0.2 if pattern == "free" else 1.0
        sizes |= {"dim": 3.0, "thickness": thickness, "n_layers": 1.0, "hold_z": 1.0}
    else:
        sizes["dim"] = 2.0
    return {"order": float(order), "n_joint": float(n), "mesh_pattern": pattern, **sizes}


def main_uplift(name: str) -> str:
    """Return the main uplift mode of a case."""
    return str(load(name)["uplift"])
