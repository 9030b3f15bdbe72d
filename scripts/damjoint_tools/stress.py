"""Random scenes, each run by the command in a process of its own and verified from its files."""

from __future__ import annotations

import csv
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import as_completed
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from damjoint import InputError
from damjoint.model.case import Case, has_drains, load
from damjoint.storage import lock
from damjoint.studies.sweep import pool_of, read_done
from tqdm import tqdm

from .provenance import RECORDED, provenance
from .verification import Written, unjustified, violations

#: Columns of the result file.
COLUMNS = (
    *("scene", "class", "found", "dim", "law", "uplift", "drive", "verdict", "level", "asked"),
    *("steps", "iterations", "cuts", "seconds", "command"),
    *RECORDED,
)
#: What becomes of a scene.
CLASSES = VERIFIED, JUSTIFIED, UNDECIDED, DEFECT = (
    *("converged and verified", "stopped and justified", "stopped, undecided", "defect"),
)

#: Seconds after which a scene counts as one that does not end.
PATIENCE = 300

#: Every command in one thread: the scenes run side by side.
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}


@dataclass(frozen=True)
class Scene:
    """Parameters that differ from the default dam's, and its loading as the command takes it."""

    settings: dict[str, float | str]
    levels: str
    tail_levels: str
    steps: int

    @property
    def words(self) -> list[str]:
        """The command's, after `damjoint`."""
        changed = [
            word for item in self.settings.items() for word in ("--set", "{}={}".format(*item))
        ]
        water = ["--levels", self.levels, "--tail-levels", self.tail_levels]
        return ["run", "dam", *changed, *water, "--steps", str(self.steps)]

    @property
    def case(self) -> Case:
        """What it asks for."""
        return load("dam", self.settings, self.levels, self.tail_levels, self.steps)


class Dice:
    """Random numbers of three digits, for commands that can be read."""

    def __init__(self, seed: int, number: int) -> None:
        self.rng = np.random.default_rng([seed, number])

    def between(self, low: float, high: float) -> float:
        """Uniform."""
        return float(f"{self.rng.uniform(low, high):.3g}")

    def size(self, low: float, high: float) -> float:
        """Uniform in the logarithm."""
        return float(f"{np.exp(self.rng.uniform(np.log(low), np.log(high))):.3g}")

    def one_of(self, *choices: float | str) -> float | str:
        """Any of them, as likely as the others."""
        return choices[self.rng.integers(len(choices))]

    def happens(self, probability: float) -> bool:
        """Whether it does."""
        return bool(self.rng.random() < probability)


def random_scene(seed: int, number: int) -> Scene:
    """Scene of a number: any of the laws, uplifts, sections and loads, stiffnesses over orders of
    magnitude, levels up and down.
    """
    dice = Dice(seed, number)
    height, plain = dice.size(5, 150), dice.happens(0.5)
    solid = dice.happens(0.1)
    settings = mesh(dice, height, solid, plain) | section(dice, height, plain) | joint(dice)
    settings |= loads(dice, height) if not plain else {}
    settings["uplift"] = dice.one_of("none", "imposed", "drained", "cracked", "flow")
    if settings["uplift"] == "flow":
        settings["aperture_min"] = dice.size(1e-8, 1e-4)
    if settings["uplift"] == "cracked":
        settings["drains"] = dice.one_of(0, 1)
    settings["weight_first"] = dice.one_of(0, 1)
    number_of_levels = int(dice.one_of(1, 2, 3))
    levels = [dice.between(0.3 * height, 1.2 * height) for _ in range(number_of_levels)]
    levels = levels if dice.happens(0.3) else sorted(levels)
    tail = dice.between(0, 0.3 * height) if dice.happens(0.4) else 0.0
    if dice.happens(0.15):
        settings["drive"] = dice.one_of("heel", "crest")
        settings["drive_by"] = dice.size(1e-6, 1e-3) * height / 10
    steps, tails = int(dice.one_of(1, 1, 2, 4)), [tail]
    # what was thought of later is drawn last: the scenes without it stay what they were
    settings |= drains(dice, settings)
    if not plain and "joint_height" in settings and dice.happens(0.5):
        settings["joint_slope"] = dice.between(-5, 5)
    if not plain and dice.happens(0.15):
        settings["force_x"] = dice.size(5 * height**2, 150 * height**2)  # up to 3 % of the thrust
    if tail and dice.happens(0.3):
        tails = [dice.between(0, 0.3 * height) for _ in levels]
    if not solid and dice.happens(0.1):
        settings, tails = slender(dice, height), [0.0]
        levels = sorted(dice.between(0.6 * height, height) for _ in levels)
    water = (",".join(f"{level:g}" for level in heights) for heights in (levels, tails))
    return Scene(settings, *water, steps)


def slender(dice: Dice, height: float) -> dict[str, float | str]:
    """A slender dam of real stiffness on a joint that lets go of its shear where it opens: under
    uplift its crack runs on at once.
    """
    base = dice.between(0.68, 0.78) * height
    return {
        "dam_height": height,
        "dam_base": base,
        "dam_crest": dice.between(0.05 * base, 0.2 * base),
        "n_joint": dice.one_of(20, 40, 80),
        "E": dice.size(1e10, 4e10),
        "found_side": height,
        "found_depth": height,
        "law": "rupture",
        "K_N": dice.size(1e11, 1e13),
        "K_T": dice.size(1e11, 1e13),
        "sigma_max": dice.one_of(0, dice.size(1e2, 1e5)),
        "alpha": dice.one_of(0, 0.5, 1, 1.5),
        "uplift": dice.one_of("imposed", "cracked", "flow"),
        "weight_first": 1,
    }


def mesh(dice: Dice, height: float, solid: bool, plain: bool) -> dict[str, float | str]:
    """Dimension and mesh: coarse ones, as equilibrium holds on any."""
    found = {"dam_height": height, "order": dice.one_of(1, 2), "n_joint": dice.one_of(10, 20, 40)}
    if not solid:
        found["mesh_pattern"] = dice.one_of("free", "regular") if plain else "free"
        return found
    return found | {
        "dim": 3,
        "n_joint": 10,
        "mesh_pattern": dice.one_of("free", "layers", "split"),
        "thickness": dice.between(0.1 * height, 0.3 * height),
        "hold_z": dice.one_of(0, 1),
        "n_layers": dice.one_of(1, 2),
        "h_dam": float(f"{height / 4:.3g}"),
        "h_found": float(f"{height / 2:.3g}"),
    }


def section(dice: Dice, height: float, plain: bool) -> dict[str, float | str]:
    """Outline and bulk."""
    base = dice.between(0.45 * height, 1.0 * height)
    found = {
        "dam_base": base,
        "dam_crest": dice.between(0.05 * base, 0.2 * base),
        "E": dice.size(1e9, 1e13),
        "nu": dice.between(0, 0.35),
        "found_side": height,
        "found_depth": height,
    }
    if plain:
        return found
    if dice.happens(0.3):
        found["E_found"] = dice.size(1e9, 1e13)
    if dice.happens(0.4):
        found["batter"] = dice.between(0.02 * base, 0.2 * base)
        found["batter_height"] = dice.between(0.3 * height, 0.9 * height)
    if dice.happens(0.3):
        found["neck_height"] = dice.between(0.02 * height, 0.15 * height)
    if dice.happens(0.4):
        found["joint_slope"] = dice.between(-8, 12)
    elif dice.happens(0.3):
        found["joint_height"] = dice.between(0.1 * height, 0.5 * height)
    return found


def joint(dice: Dice) -> dict[str, float | str]:
    """Law and strengths; fracture energies above what the joint stores before it softens."""
    found = {
        "law": dice.one_of("rupture", "friction", "bond"),
        "K_N": dice.size(1e8, 1e15),
        "sigma_max": dice.one_of(0, dice.size(1e3, 2e6)),
        "adhesion": dice.one_of(0, dice.size(1e3, 1e6)),
        "mu": dice.between(0.2, 1.2),
    }
    found["K_T"] = float(f"{found['K_N'] * dice.size(0.1, 2):.3g}")
    if found["law"] == "rupture":
        found["pena_rupture"] = dice.size(0.1, 1e3)
        found["alpha"] = dice.one_of(0, 1, 1.5, 2)
    if found["law"] == "friction":
        found["pena_tang"] = dice.one_of(-1, 0, float(f"{0.05 * found['K_T']:.3g}"))
    if found["law"] == "bond":
        found["G_f"] = dice.size(1.5, 100) * max(found["sigma_max"] ** 2 / 2 / found["K_N"], 1)
        found["G_t"] = dice.size(1.5, 100) * max(found["adhesion"] ** 2 / 2 / found["K_T"], 1)
        found |= {name: float(f"{found[name]:.4g}") for name in ("G_f", "G_t")}
    return found


def drains(dice: Dice, settings: dict[str, float | str]) -> dict[str, float | str]:
    """Drains where the water flows, and where they stand, what they take away and down to which
    level, wherever there are any.
    """
    found = {"drains": 1} if settings["uplift"] == "flow" and dice.happens(0.4) else {}
    if not has_drains({"drains": 0} | settings | found) or dice.happens(0.5):
        return found
    base, height = settings["dam_base"], settings["dam_height"]
    found["drain_x"] = dice.between(0.05 * base, 0.4 * base)
    found["drain_effectiveness"] = dice.between(0, 1)
    if "drive" not in settings:
        found["drain_level"] = dice.between(0, 0.3 * height)
    return found


def loads(dice: Dice, height: float) -> dict[str, float | str]:
    """Loads besides weight and water, sized by the water's thrust."""
    thrust, found = 1000 * 9.81 * height**2 / 2, {}
    if dice.happens(0.3):
        found["silt_height"] = dice.between(0.05 * height, 0.4 * height)
    if dice.happens(0.2):
        found["ice_force"] = dice.size(0.001 * thrust, 0.03 * thrust)
    if dice.happens(0.2):
        found["anchor_force"] = dice.size(0.01 * thrust, 0.2 * thrust)
        found["anchor_angle"] = dice.between(-5, 20)
    if dice.happens(0.25):
        found |= {"k_h": dice.between(-0.1, 0.2), "k_v": dice.between(-0.1, 0.1)}
    if dice.happens(0.15):
        found["floor_water"] = 1
    return found


def judged(scene: Scene, folder: Path) -> dict[str, object]:
    """Run a scene by the command and verify what it has written: its row but for the number."""
    case, start = scene.case, time.perf_counter()
    words = [*scene.words, "--no-fields", "--no-picture", "--out", str(folder / "out")]
    environment = os.environ | ONE_THREAD | {"DAMJOINT_CACHE": str(folder / "cache")}
    told = {
        "command": " ".join(["damjoint", *scene.words]),
        "asked": max(case.levels),
        **{name: case[name] for name in ("dim", "law", "uplift", "drive")},
    }
    try:
        done = subprocess.run(
            [sys.executable, "-m", "damjoint", *words],
            env=environment,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )
    except subprocess.TimeoutExpired:
        return told | {"class": DEFECT, "found": f"no end after {PATIENCE} s", "seconds": PATIENCE}
    told["seconds"] = f"{time.perf_counter() - start:.2f}"
    run = Written(case, folder / "out", done.returncode)
    try:
        said = run.told["verdict"]
    except (OSError, KeyError):
        last = (done.stderr.strip().splitlines() or ["nothing said"])[-1]
        return told | {"class": DEFECT, "found": f"exit code {done.returncode}: {last}"}
    broken = violations(run)
    wrong, why = unjustified(run) if run.stopped else (False, "")
    fine = UNDECIDED if why else JUSTIFIED if run.stopped else VERIFIED
    history = run.history
    return told | {
        "class": DEFECT if broken or wrong else fine,
        "found": "; ".join(filter(None, [*broken, why])),
        "verdict": said,
        "level": f"{history['level'].max(initial=0):.6g}",
        "steps": len(history["time"]),
        "iterations": int(history["iterations"].sum()),
        "cuts": int(history["cuts"].sum()),
    }


def one(seed: int, number: int) -> dict[str, object]:
    """The row of a scene."""
    with tempfile.TemporaryDirectory() as folder:
        row = judged(random_scene(seed, number), Path(folder))
    return {"scene": f"{seed}-{number}"} | row


def spread(seed: int, numbers: list[int], jobs: int) -> Iterator[dict[str, object]]:
    """The rows of scenes as they are done."""
    with pool_of(jobs) as pool:
        waiting = [pool.submit(one, seed, number) for number in numbers]
        yield from (future.result() for future in as_completed(waiting))


def stress(
    count: int, seed: int, out: Path, jobs: int | None = None, progress: Callable = tqdm
) -> list[dict[str, str]]:
    """Run what is missing of the scenes 0 .. count - 1 of a seed, and return the rows of them all.

    out: CSV of COLUMNS, a row written whole when it is done; what is in it already is not run
    again. Raises InputError, also where those are of other code.
    """
    if not out.parent.is_dir():
        raise InputError(f"out = {out}: must be a file in an existing folder")
    done = read_done(out, list(COLUMNS), ("dim", "seconds"))
    now = provenance()
    for row in done.values():
        if row["code"] != now["code"]:
            begun = f"begun with damjoint {row['version']} ({row['commit'] or row['date']})"
            raise InputError(f"out = {out}: {begun}, which is other code: name a new file")
    missing = [number for number in range(count) if f"{seed}-{number}" not in done]
    with out.open("a", newline="") as file:
        lock(file.fileno(), out)
        writer = csv.DictWriter(file, COLUMNS, restval="", lineterminator="\n")
        if not file.tell():
            writer.writeheader()
        rows = spread(seed, missing, jobs or os.cpu_count() or 1)
        for row in progress(
            rows, total=len(missing), desc="stress", disable=not sys.stderr.isatty()
        ):
            writer.writerow(row | now)
            file.flush()
    wanted = {f"{seed}-{number}" for number in range(count)}
    return [row for row in read_rows(out) if row["scene"] in wanted]


def read_rows(path: Path) -> list[dict[str, str]]:
    """The rows of a result file."""
    with path.open() as file:
        return list(csv.DictReader(file))


def counts(rows: list[dict[str, str]]) -> dict[str, int]:
    """How many scenes are of each class."""
    return {name: sum(row["class"] == name for row in rows) for name in CLASSES}
