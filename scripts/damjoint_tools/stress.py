"""Random dams, each run by the command in a new process and verified from its result files.

The verification is independent of the engines and of laws/: see verification.py.
"""

from __future__ import annotations

import csv
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import as_completed
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from damjoint import InputError
from damjoint.arrays import Setting
from damjoint.model.case import Case, has_drains, load
from damjoint.model.parameters import declared
from damjoint.progress import track
from damjoint.storage import lock
from damjoint.studies.sweep import pool_of, read_done

from .provenance import RECORDED, provenance
from .quake_verification import QuakeFiles, judge_quake, quake_violations
from .verification import RunFiles, judge_stop, violations

#: Columns of the result file.
COLUMNS = (
    *("scene", "class", "findings", "dim", "joints", "law", "uplift", "drive", "verdict", "level"),
    "highest_level",
    *("steps", "iterations", "cuts", "seconds", "command"),
    *RECORDED,
)
#: Outcomes of the verification.
CLASSES = VERIFIED, JUSTIFIED, UNDECIDED, DEFECT = (
    *("converged and verified", "stopped and justified", "stopped, undecided", "defect"),
)

#: Time limit of a scene [s].
TIME_LIMIT = 300

#: Third number of the seed of the lift joints and of earthquakes, which are drawn apart.
LIFT_DRAWS, QUAKE_DRAWS = 1, 2
#: Parameters that are drawn for each joint, but for the place of its drains.
OF_JOINTS = (
    *("law", "K_N", "K_T", "sigma_max", "adhesion", "mu", "pena_rupture", "alpha", "pena_tang"),
    *("G_f", "G_t", "joint_slope", "uplift", "aperture_min", "drains"),
)
#: Height of the highest lift over the dam's.
HIGHEST_LIFT = 0.85

#: One thread for each command, as several run at the same time.
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}


@dataclass(frozen=True)
class RandomScene:
    """Random dam: parameters that differ from the default dam's, and levels as in the command."""

    settings: dict[str, Setting]
    levels: str
    tail_levels: str
    steps: int

    @property
    def words(self) -> list[str]:
        """Arguments of the command `damjoint`."""
        changed = [
            word
            for name, value in self.settings.items()
            for word in ("--set", f"{name}={as_text(value)}")
        ]
        water = ["--levels", self.levels, "--tail-levels", self.tail_levels]
        return ["run", "dam", *changed, *water, "--steps", str(self.steps)]

    @property
    def case(self) -> Case:
        """The case as the command loads it."""
        return load("dam", self.settings, self.levels, self.tail_levels, self.steps)


@dataclass(frozen=True)
class RandomQuake(RandomScene):
    """Random dam with a random record, that is written into a file of the scene's name."""

    #: rows of time [s], horizontal and vertical acceleration [m/s2]
    record: np.ndarray = field(compare=False)
    file: Path

    @property
    def words(self) -> list[str]:
        """Arguments of the command `damjoint`."""
        return ["quake", *super().words[1:], "--record", str(self.file)]

    @property
    def case(self) -> Case:
        """The case as the command loads it; writes the record."""
        self.file.parent.mkdir(exist_ok=True)
        np.savetxt(self.file, self.record, "%.6g", ",")
        return replace(super().case, record=self.file)


def as_text(value: Setting) -> str:
    """Format a setting as in the command: a value, or those of all joints."""
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)


class RandomNumbers:
    """Random numbers, rounded to three digits to keep the commands readable."""

    def __init__(self, *seed: int) -> None:
        self.generator = np.random.default_rng(seed)

    def uniform(self, low: float, high: float) -> float:
        """Draw a number, uniformly distributed."""
        return float(f"{self.generator.uniform(low, high):.3g}")

    def log_uniform(self, low: float, high: float) -> float:
        """Draw a number whose logarithm is uniformly distributed."""
        return float(f"{np.exp(self.generator.uniform(np.log(low), np.log(high))):.3g}")

    def choice(self, *choices: float | str) -> float | str:
        """Draw one of the choices with equal probability."""
        return choices[self.generator.integers(len(choices))]

    def event(self, probability: float) -> bool:
        """Draw whether an event of this probability happens."""
        return bool(self.generator.random() < probability)


def random_scene(seed: int, number: int) -> RandomScene:
    """Draw scene `number` of a seed: a dam with one to four joints."""
    scene, rng = single_joint_scene(seed, number), RandomNumbers(seed, number, LIFT_DRAWS)
    return with_lifts(scene, rng) if rng.event(0.4) else scene


def single_joint_scene(seed: int, number: int) -> RandomScene:
    """Draw a dam with one joint: any law, uplift, section and loads, stiffnesses over orders of
    magnitude, rising and falling levels. New draws are appended, so that old seeds stay
    reproducible.
    """
    rng = RandomNumbers(seed, number)
    height, plain = rng.log_uniform(5, 150), rng.event(0.5)
    solid = rng.event(0.1)
    settings = mesh(rng, height, solid, plain) | section(rng, height, plain) | joint(rng)
    settings |= loads(rng, height) if not plain else {}
    settings["uplift"] = rng.choice("none", "imposed", "drained", "cracked", "flow")
    if settings["uplift"] == "flow":
        settings["aperture_min"] = rng.log_uniform(1e-8, 1e-4)
    if settings["uplift"] == "cracked":
        settings["drains"] = rng.choice(0, 1)
    settings["weight_first"] = rng.choice(0, 1)
    number_of_levels = int(rng.choice(1, 2, 3))
    levels = [rng.uniform(0.3 * height, 1.2 * height) for _ in range(number_of_levels)]
    levels = levels if rng.event(0.3) else sorted(levels)
    tail = rng.uniform(0, 0.3 * height) if rng.event(0.4) else 0.0
    if rng.event(0.15):
        settings["drive"] = rng.choice("heel", "crest")
        settings["drive_by"] = rng.log_uniform(1e-6, 1e-3) * height / 10
    steps, tails = int(rng.choice(1, 1, 2, 4)), [tail]
    # draws added later
    settings |= drains(rng, settings)
    if not plain and "joint_height" in settings and rng.event(0.5):
        settings["joint_slope"] = rng.uniform(-5, 5)
    if not plain and rng.event(0.15):
        # up to 3 % of the thrust
        settings["force_x"] = rng.log_uniform(5 * height**2, 150 * height**2)
    if tail and rng.event(0.3):
        tails = [rng.uniform(0, 0.3 * height) for _ in levels]
    if not solid and rng.event(0.1):
        settings, tails = slender_dam(rng, height), [0.0]
        levels = sorted(rng.uniform(0.6 * height, height) for _ in levels)
    water = (",".join(f"{level:g}" for level in heights) for heights in (levels, tails))
    return RandomScene(settings, *water, steps)


def with_lifts(scene: RandomScene, rng: RandomNumbers) -> RandomScene:
    """Add one to three lift joints to a scene, each with its own law, strengths, slope, uplift and
    drains.
    """
    case, count = scene.case, int(rng.choice(1, 2, 3))
    height, settings = case["dam_height"], dict(scene.settings)
    if settings.get("mesh_pattern") == "regular":
        settings["mesh_pattern"] = "free"
    lowest = max(case.section["heel_y"][0], case.section["toe_y"][0])
    spacing = (HIGHEST_LIFT * height - lowest) / count
    settings["lift_heights"] = tuple(
        float(f"{lowest + (k + rng.uniform(0.6, 1)) * spacing:.4g}") for k in range(count)
    )
    # each end of a lift moves by less than the distance of two lifts, at least 0.6 of their spacing
    steepest = np.degrees(np.arctan(0.25 * spacing / case.joint_length))
    drawn = [
        joint(rng)
        | {
            "joint_slope": rng.uniform(-steepest, steepest) if rng.event(0.4) else 0.0,
            "uplift": rng.choice("none", "imposed", "drained", "cracked", "flow"),
            "aperture_min": rng.log_uniform(1e-8, 1e-4),
            "drains": rng.choice(0, 1),
        }
        for _ in range(count)
    ]
    drawn = [{n: v for n, v in settings.items() if n in OF_JOINTS}, *drawn]
    names = [n for n in OF_JOINTS if any(n in own for own in drawn)]
    default = {name: declared()[name].default for name in names}
    settings |= {n: tuple(own.get(n, default[n]) for own in drawn) for n in names}
    dry = replace(scene, settings=settings | {"uplift": "none"}).case
    lengths = [joint.joint_length for joint in dry.joints]
    settings["drain_x"] = tuple(rng.uniform(0.05 * length, 0.4 * length) for length in lengths)
    return replace(scene, settings=settings)


def random_quake(seed: int, number: int, folder: Path) -> RandomQuake:
    """Draw earthquake `number` of a seed, with its record in a folder: a dam that stands before it,
    of any law, uplift and damping, with one to three joints.
    """
    rng = RandomNumbers(seed, number, QUAKE_DRAWS)
    height, solid = rng.log_uniform(8, 120), rng.event(0.1)
    base = rng.uniform(0.75 * height, 1.0 * height)
    settings = mesh(rng, height, solid, plain=False) | {
        "n_joint": 10.0 if solid else rng.choice(10, 20),
        "dam_base": base,
        "dam_crest": rng.uniform(0.08 * base, 0.2 * base),
        "E": rng.log_uniform(5e9, 1e11),
        "nu": rng.uniform(0, 0.35),
        "found_side": height,
        "found_depth": height,
    }
    settings["h_dam"], settings["h_found"] = height / 4, height / 2
    drawn = joint(rng)
    while not 1e9 <= drawn["K_N"] <= 1e13:
        drawn = joint(rng)
    settings |= drawn | {"mu": rng.uniform(0.75, 1.2)}
    if rng.event(0.6):  # weak: most of these slide or rock
        for name, largest in (("sigma_max", 3e4), ("adhesion", 2e4)):
            settings[name] = min(settings[name], rng.log_uniform(1e3, largest))
    if not solid and rng.event(0.3):
        settings["batter"] = rng.uniform(0.02 * base, 0.1 * base)
        settings["batter_height"] = rng.uniform(0.3 * height, 0.9 * height)
    if not solid and rng.event(0.2):
        settings["joint_slope"] = rng.uniform(-3, 5)
    settings["uplift"] = rng.choice("none", "imposed", "drained", "cracked", "flow")
    settings |= {
        "quake_uplift": rng.choice("crack", "unchanged", "zero"),
        "added_mass": rng.choice(0, 1, 2),
        "damping": rng.uniform(0.01, 0.1),
        "hht_alpha": rng.choice(-0.05, -0.05, 0, -0.2),
        "record_unit": rng.choice("m/s2", "g"),
        "record_component": rng.choice("both", "both", "horizontal"),
        "record_rest": rng.uniform(0.3, 1.2),
    }
    settings["record_scale"] = rng.choice(-1, 1) / (
        9.80665 if settings["record_unit"] == "g" else 1
    )
    level = f"{rng.uniform(0.3 * height, 0.85 * height):g}"
    record, file = random_record(rng), folder / f"{seed}-{number}.csv"
    scene = RandomQuake(settings, level, "0", 1, record, file)
    if not solid and rng.event(0.3):
        count = int(rng.choice(1, 2))
        heights = tuple(float(f"{height * (k + 1) / (count + 1.5):.4g}") for k in range(count))
        return replace(scene, settings=settings | {"lift_heights": heights})
    return scene


def random_record(rng: RandomNumbers) -> np.ndarray:
    """Draw a record: three waves that begin and end smoothly, up to 1 g, the vertical component
    smaller.
    """
    times = np.arange(0, rng.uniform(0.8, 1.6), 0.01)
    window = np.sin(np.pi * times / times[-1]) ** 2
    waves = [
        sum(
            rng.uniform(0.2, 1)
            * np.sin(2 * np.pi * (rng.log_uniform(1, 9) * times + rng.uniform(0, 1)))
            for _ in range(3)
        )
        for _ in range(2)
    ]
    peak = rng.log_uniform(1.5, 10)
    along, up = (peak * window * wave / np.abs(wave).max() for wave in waves)
    return np.column_stack([times, along, 0.6 * up])


def slender_dam(rng: RandomNumbers, height: float) -> dict[str, float | str]:
    """Draw a slender dam of realistic stiffness on a joint that loses its shear stiffness on
    opening: under uplift its crack grows unstably.
    """
    base = rng.uniform(0.68, 0.78) * height
    return {
        "dam_height": height,
        "dam_base": base,
        "dam_crest": rng.uniform(0.05 * base, 0.2 * base),
        "n_joint": rng.choice(20, 40, 80),
        "E": rng.log_uniform(1e10, 4e10),
        "found_side": height,
        "found_depth": height,
        "law": "rupture",
        "K_N": rng.log_uniform(1e11, 1e13),
        "K_T": rng.log_uniform(1e11, 1e13),
        "sigma_max": rng.choice(0, rng.log_uniform(1e2, 1e5)),
        "alpha": rng.choice(0, 0.5, 1, 1.5),
        "uplift": rng.choice("imposed", "cracked", "flow"),
        "weight_first": 1,
    }


def mesh(rng: RandomNumbers, height: float, solid: bool, plain: bool) -> dict[str, float | str]:
    """Draw dimension and mesh; coarse, as equilibrium holds on any mesh."""
    settings = {"dam_height": height, "order": rng.choice(1, 2), "n_joint": rng.choice(10, 20, 40)}
    if not solid:
        settings["mesh_pattern"] = rng.choice("free", "regular") if plain else "free"
        return settings
    return settings | {
        "dim": 3,
        "n_joint": 10,
        "mesh_pattern": rng.choice("free", "layers", "split"),
        "thickness": rng.uniform(0.1 * height, 0.3 * height),
        "hold_z": rng.choice(0, 1),
        "n_layers": rng.choice(1, 2),
        "h_dam": float(f"{height / 4:.3g}"),
        "h_found": float(f"{height / 2:.3g}"),
    }


def section(rng: RandomNumbers, height: float, plain: bool) -> dict[str, float | str]:
    """Draw outline and elasticity of the bodies."""
    base = rng.uniform(0.45 * height, 1.0 * height)
    drawn = {
        "dam_base": base,
        "dam_crest": rng.uniform(0.05 * base, 0.2 * base),
        "E": rng.log_uniform(1e9, 1e13),
        "nu": rng.uniform(0, 0.35),
        "found_side": height,
        "found_depth": height,
    }
    if plain:
        return drawn
    if rng.event(0.3):
        drawn["E_found"] = rng.log_uniform(1e9, 1e13)
    if rng.event(0.4):
        drawn["batter"] = rng.uniform(0.02 * base, 0.2 * base)
        drawn["batter_height"] = rng.uniform(0.3 * height, 0.9 * height)
    if rng.event(0.3):
        drawn["neck_height"] = rng.uniform(0.02 * height, 0.15 * height)
    if rng.event(0.4):
        drawn["joint_slope"] = rng.uniform(-8, 12)
    elif rng.event(0.3):
        drawn["joint_height"] = rng.uniform(0.1 * height, 0.5 * height)
    return drawn


def joint(rng: RandomNumbers) -> dict[str, float | str]:
    """Draw law and strengths; fracture energies exceed the elastic energy at the strength."""
    drawn = {
        "law": rng.choice("rupture", "friction", "bond"),
        "K_N": rng.log_uniform(1e8, 1e15),
        "sigma_max": rng.choice(0, rng.log_uniform(1e3, 2e6)),
        "adhesion": rng.choice(0, rng.log_uniform(1e3, 1e6)),
        "mu": rng.uniform(0.2, 1.2),
    }
    drawn["K_T"] = float(f"{drawn['K_N'] * rng.log_uniform(0.1, 2):.3g}")
    if drawn["law"] == "rupture":
        drawn["pena_rupture"] = rng.log_uniform(0.1, 1e3)
        drawn["alpha"] = rng.choice(0, 1, 1.5, 2)
    if drawn["law"] == "friction":
        drawn["pena_tang"] = rng.choice(-1, 0, float(f"{0.05 * drawn['K_T']:.3g}"))
    if drawn["law"] == "bond":
        pairs = ("G_f", "sigma_max", "K_N"), ("G_t", "adhesion", "K_T")
        for energy, strength, stiffness in pairs:
            elastic = drawn[strength] ** 2 / 2 / drawn[stiffness]
            drawn[energy] = float(f"{rng.log_uniform(1.5, 100) * max(elastic, 1):.4g}")
    return drawn


def drains(rng: RandomNumbers, settings: dict[str, float | str]) -> dict[str, float | str]:
    """Draw whether there are drains where the water flows; position, effectiveness and outlet level
    of all drains.
    """
    drawn = {"drains": 1} if settings["uplift"] == "flow" and rng.event(0.4) else {}
    if not has_drains({"drains": 0} | settings | drawn) or rng.event(0.5):
        return drawn
    base, height = settings["dam_base"], settings["dam_height"]
    drawn["drain_x"] = rng.uniform(0.05 * base, 0.4 * base)
    drawn["drain_effectiveness"] = rng.uniform(0, 1)
    if "drive" not in settings:
        drawn["drain_level"] = rng.uniform(0, 0.3 * height)
    return drawn


def loads(rng: RandomNumbers, height: float) -> dict[str, float | str]:
    """Draw loads besides weight and water, as shares of the thrust of the water."""
    thrust, drawn = 1000 * 9.81 * height**2 / 2, {}
    if rng.event(0.3):
        drawn["silt_height"] = rng.uniform(0.05 * height, 0.4 * height)
    if rng.event(0.2):
        drawn["ice_force"] = rng.log_uniform(0.001 * thrust, 0.03 * thrust)
    if rng.event(0.2):
        drawn["anchor_force"] = rng.log_uniform(0.01 * thrust, 0.2 * thrust)
        drawn["anchor_angle"] = rng.uniform(-5, 20)
    if rng.event(0.25):
        drawn |= {"k_h": rng.uniform(-0.1, 0.2), "k_v": rng.uniform(-0.1, 0.1)}
    if rng.event(0.15):
        drawn["floor_water"] = 1
    return drawn


def run_and_verify(scene: RandomScene, folder: Path) -> dict[str, object]:
    """Run a scene by the command and verify its files; returns its row without the number."""
    case, start = scene.case, time.perf_counter()
    quake = isinstance(scene, RandomQuake)
    words = [*scene.words, *(() if quake else ("--no-fields",)), "--no-picture"]
    words += ["--out", str(folder / "out")]
    environment = os.environ | ONE_THREAD | {"DAMJOINT_CACHE": str(folder / "cache")}
    row = {
        "command": " ".join(["damjoint", *scene.words]),
        "highest_level": max(case.levels),
        "joints": len(case.joints),
        **{name: case[name] for name in ("dim", "drive")},
        **{name: as_text(scene.settings.get(name, case[name])) for name in ("law", "uplift")},
    }
    try:
        done = subprocess.run(
            [sys.executable, "-m", "damjoint", *words],
            env=environment,
            capture_output=True,
            text=True,
            timeout=TIME_LIMIT,
        )
    except subprocess.TimeoutExpired:
        finding = f"not finished after {TIME_LIMIT} s"
        return row | {"class": DEFECT, "findings": finding, "seconds": TIME_LIMIT}
    row["seconds"] = f"{time.perf_counter() - start:.2f}"
    run = (QuakeFiles if quake else RunFiles)(case, folder / "out", done.returncode)
    try:
        row["verdict"] = run.record["verdict"]
    except (OSError, KeyError):
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        return row | {"class": DEFECT, "findings": f"exit code {done.returncode}: {last}"}
    return row | verified(run)


def verified(run: RunFiles) -> dict[str, object]:
    """Verify a run; returns its class, findings and size."""
    quake = isinstance(run, QuakeFiles)
    broken = (quake_violations if quake else violations)(run)
    wrong, remark = (judge_quake if quake else judge_stop)(run) if run.stopped else (False, "")
    fine = UNDECIDED if remark else JUSTIFIED if run.stopped else VERIFIED
    history = run.history
    return {
        "class": DEFECT if broken or wrong else fine,
        "findings": "; ".join(filter(None, [*broken, remark])),
        "level": f"{history['level'].max(initial=0):.6g}",
        "steps": len(history["time"]),
        "iterations": int(history["iterations"].sum()),
        "cuts": int(history["cuts"].sum()) if not quake else run.record["quake"]["halvings"],
    }


def row_of(seed: int, number: int, records: Path | None) -> dict[str, object]:
    """Return the row of a scene; records: folder of the records of earthquakes."""
    scene = random_quake(seed, number, records) if records else random_scene(seed, number)
    with tempfile.TemporaryDirectory() as folder:
        row = run_and_verify(scene, Path(folder))
    return {"scene": f"{seed}-{number}"} | row


def rows_as_completed(
    seed: int, numbers: list[int], jobs: int, records: Path | None
) -> Iterator[dict[str, object]]:
    """Compute the rows of scenes in parallel, in the order in which they are finished."""
    with pool_of(jobs) as pool:
        waiting = [pool.submit(row_of, seed, number, records) for number in numbers]
        yield from (future.result() for future in as_completed(waiting))


def stress(
    count: int, seed: int, out: Path, jobs: int | None = None, quake: bool = False
) -> list[dict[str, str]]:
    """Run those of the scenes 0 .. count - 1 of a seed that are not in the result file yet; returns
    the rows of all.

    out: CSV of COLUMNS; a row is written when its scene is finished. quake: earthquakes, with their
    records in a folder beside the file. Raises InputError, also if the rows in the file were
    computed by other code.
    """
    if not out.parent.is_dir():
        raise InputError(f"out = {out}: must be a file in an existing folder")
    done = read_done(out, list(COLUMNS), ("dim", "seconds"))
    now = provenance()
    for row in done.values():
        if row["code"] != now["code"]:
            other = f"damjoint {row['version']} ({row['commit'] or row['date']})"
            raise InputError(
                f"out = {out}: must be a new file; this file has rows of {other}, other code"
            )
    names = [f"{seed}-{number}" for number in range(count)]
    missing = [number for number, name in enumerate(names) if name not in done]
    with out.open("a", newline="") as file:
        lock(file.fileno(), out)
        writer = csv.DictWriter(file, COLUMNS, restval="", lineterminator="\n")
        if not file.tell():
            writer.writeheader()
        records = out.resolve().with_name(f"{out.stem}_records") if quake else None
        rows = rows_as_completed(seed, missing, jobs or os.cpu_count() or 1, records)
        for row in track(rows, "stress", len(missing)):
            writer.writerow(row | now)
            file.flush()
    return [row for row in read_rows(out) if row["scene"] in names]


def read_rows(path: Path) -> list[dict[str, str]]:
    """Read the rows of a result file."""
    with path.open() as file:
        return list(csv.DictReader(file))


def counts(rows: list[dict[str, str]]) -> dict[str, int]:
    """Count the scenes of each class."""
    return {name: sum(row["class"] == name for row in rows) for name in CLASSES}
