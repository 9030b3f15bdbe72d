"""Random dams, each run by the command in a new process and verified from its result files.

The verification is independent of the package: see damjoint_witness.
"""

from __future__ import annotations

import csv
import ctypes
import itertools
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import as_completed
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from damjoint import InputError, RunError
from damjoint.processes import process_pool
from damjoint.progress import track
from damjoint.studies.result_file import rows_session
from damjoint_witness import again
from damjoint_witness.earthquake import Shaken
from damjoint_witness.files import Files
from damjoint_witness.reader import read
from damjoint_witness.verify import Witness

from .provenance import RECORDED, provenance
from .quake_comparison import MEASURES, further_checks
from .random_quakes import RandomQuake, random_quake
from .random_scenes import RandomScene, as_text, random_scene

#: Columns of the result file.
COLUMNS = (
    *("scene", "class", "findings", "dim", "joints", "law", "uplift", "drive", "verdict", "level"),
    "highest_level",
    *("steps", "iterations", "cuts", "seconds", "command", "kind"),
    *MEASURES,
    *("steps_difference", "critical_level", "critical_difference"),
    *RECORDED,
)
#: Outcomes of the verification.
CLASSES = VERIFIED, JUSTIFIED, UNDECIDED, DEFECT = (
    *("converged and verified", "stopped and justified", "stopped, undecided", "defect"),
)

#: What only a part of the dams has, by a part of its command.
IN_TIME = {"flow in time": "time_unit="}

#: Every how many scenes the load steps and the critical level are computed again.
AGAIN = 5

#: What `damjoint quake` says of a dam that does not stand before the earthquake.
NO_START = "the static loads have no equilibrium"
#: Limit of a command's CPU time [s], and of its duration while others run, over that.
TIME_LIMIT, LONGEST = 300, 4

#: Options of a run of which only the verdict counts.
QUICKLY = "--no-picture", "--no-fields"

#: One thread for each command, as several run at the same time.
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}


def run_and_verify(scene: RandomScene, folder: Path, twice: bool = False) -> dict[str, object]:
    """Run a scene by the command and verify its files; returns its row without the number. twice:
    also with twice the steps, and its critical level.
    """
    start, case = time.perf_counter(), scene.case
    row: dict[str, object] = {
        "command": " ".join(["damjoint", *scene.words]),
        "highest_level": max(case.levels),
        "joints": len(case.joints),
        **{name: case[name] for name in ("dim", "drive")},
        **{name: as_text(scene.settings.get(name, case[name])) for name in ("law", "uplift")},
    }
    try:
        run = run_of(scene, folder, fields=True)
        row["seconds"] = f"{time.perf_counter() - start:.2f}"
        row |= {"verdict": run.files.record["verdict"]} | verified(run)
        if isinstance(scene, RandomQuake):
            row |= {"kind": scene.kind} | with_further_checks(scene, run, folder, row)
        elif twice:
            row |= computed_again(scene, run, folder, row)
    except RunError as error:
        row |= {"class": DEFECT, "findings": str(error)}
        if isinstance(scene, RandomQuake) and NO_START in str(error):
            row |= without_start(scene, folder)
        row.setdefault("seconds", f"{time.perf_counter() - start:.2f}")
    return row


def without_start(scene: RandomQuake, folder: Path) -> dict[str, object]:
    """Return class, findings and size of an earthquake whose static loads are said to have no
    equilibrium, by a run with these loads.
    """
    try:
        run = run_of(scene.before, folder, name="before", fields=True)
    except RunError as error:
        return {"kind": scene.kind, "class": DEFECT, "findings": str(error)}
    row = {"kind": scene.kind, "verdict": run.files.record["verdict"]} | verified(run)
    if not run.files.stopped:
        findings = f"{NO_START}, but a run with them has one"
        row |= {"class": DEFECT, "findings": findings}
    return row


def run_of(
    scene: RandomScene, folder: Path, *options: str, name: str = "out", fields: bool = False
) -> Witness:
    """Run a scene by the command with further options, and return its files, in folder/name;
    fields: with those of the bodies.

    Raises RunError if the command has written no result, or exceeds the time limit.
    """
    tables = "--no-picture", *(() if isinstance(scene, RandomQuake) or fields else ("--no-fields",))
    table_of_steps = () if "getdp" in options else ("--all-steps",)
    return Witness(files_of(scene.words, folder, *tables, *table_of_steps, *options, name=name))


def files_of(words: list[str], folder: Path, *options: str, name: str) -> Files:
    """Run a command with further options, and return its files, in folder/name.

    Raises RunError if it has written no result, or exceeds the time limit.
    """
    folders = {"DAMJOINT_CACHE": str(folder / "cache"), "TMPDIR": str(folder)}
    out = "--out", str(folder / name)
    try:
        done = subprocess.run(
            [sys.executable, "-m", "damjoint", *words, *options, *out],
            env=os.environ | ONE_THREAD | folders,
            capture_output=True,
            text=True,
            timeout=LONGEST * TIME_LIMIT,
            preexec_fn=limit,
            start_new_session=True,
        )
    except subprocess.TimeoutExpired:
        raise RunError(f"not finished after {LONGEST * TIME_LIMIT} s") from None
    if done.returncode == -signal.SIGXCPU:
        raise RunError(f"not finished after {TIME_LIMIT} s of CPU time")
    files = Files(folder / name, tuple(words), done.returncode)
    try:
        complete = not {"verdict", "critical"}.isdisjoint(files.record)
    except OSError:
        complete = False
    if not complete:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise RunError(f"exit code {done.returncode}: {last}") from None
    return files


#: Number of prctl's option by which a process gets a signal when its parent ends.
SIGNAL_OF_PARENT = 1
LIBC = ctypes.CDLL(None)


def limit() -> None:
    """Limit the CPU time of this process, and kill it with its parent, whose folder it writes."""
    resource.setrlimit(resource.RLIMIT_CPU, (TIME_LIMIT, TIME_LIMIT + 1))
    LIBC.prctl(SIGNAL_OF_PARENT, signal.SIGKILL)


def with_further_checks(
    scene: RandomQuake, run: Witness, folder: Path, row: dict[str, object]
) -> dict[str, object]:
    """Return numbers of further checks of a verified earthquake, and its class and findings."""
    if row["class"] != VERIFIED:
        return {}
    runs = itertools.count(1)

    def again(changed: RandomQuake, *options: str) -> Shaken:
        return run_of(changed, folder, *options, name=f"again_{next(runs)}").shaken

    measures, findings = further_checks(scene, run.shaken, again)
    numbers: dict[str, object] = {name: f"{v:.3g}" for name, v in measures.items()}
    return numbers | {"class": DEFECT if findings else VERIFIED, "findings": "; ".join(findings)}


def computed_again(
    scene: RandomScene, run: Witness, folder: Path, row: dict[str, object]
) -> dict[str, object]:
    """Compute a verified scene with twice the steps, and its critical level from three starts;
    returns the differences, and class and findings of the row with what is found.
    """
    if row["class"] == DEFECT:
        return {}
    findings, numbers = list[object](), dict[str, Any]()
    if row["class"] == VERIFIED:
        doubled = run_of(replace(scene, steps=2 * scene.steps), folder, name="doubled").files
        findings += again.other_steps(run.request, run.files, doubled)
        if not doubled.stopped:
            numbers["steps_difference"] = again.difference(run.files, doubled)
    if has_critical_level(scene):
        more, differences = critical_levels(scene, folder)
        findings, numbers = [*findings, *more], numbers | differences
    if findings:
        findings = [text for text in (row["findings"], *findings) if text]
        return numbers | {"class": DEFECT, "findings": "; ".join(map(str, findings))}
    return {name: f"{value:.8g}" for name, value in numbers.items()}


def has_critical_level(scene: RandomScene) -> bool:
    """Whether the critical level of a scene is found: in 2D, if it does not follow the history."""
    request = read(scene.words)
    return request.joints[0]["dim"] == 2 and not again.follows_history(request, first_step=False)


def critical_levels(scene: RandomScene, folder: Path) -> tuple[list[str], dict[str, float]]:
    """Find the critical level of a scene from three starts below it, and verify the state below a
    confirmed one, and that none stands above it; returns what is found, and numbers for the row.
    """
    start = again.FIRST_START * scene.case["dam_height"]

    def rising(*levels: float) -> RandomScene:
        return scene.rising_from(start, *levels)

    def search(name: str, *levels: float) -> again.Critical | None:
        return again.Critical.of(files_of(rising(*levels).critical, folder, name=name).record)

    first = search("critical")
    while first and start >= min(again.STARTS) * first.level:
        start = again.FIRST_START * first.level
        first = search(f"critical_above_{start:g}")
    if first is None:
        return [], {}
    starts = [search(f"critical_{part:g}", part * first.level) for part in again.STARTS]
    results = [first, *filter(None, starts)]
    levels = [result.level for result in results if result.confirmed]
    findings, numbers = list(again.starts(results)), {"critical_level": first.level}
    if len(levels) > 1:
        numbers["critical_difference"] = (max(levels) - min(levels)) / max(levels)
    if first.confirmed:
        below = run_of(rising(again.BELOW * first.level), folder, name="below", fields=True)
        findings += [f"below the critical level: {text}" for text in below.violations()]
        if below.files.stopped:
            findings.append(f"no equilibrium at {again.BELOW:g} of the critical level")
        else:
            findings += again.above(first, below.files, below.request, below.steps)
        beyond = rising(again.RUNS_TO * first.level).without_default_hardening
        runs = (
            files_of(replace(beyond, steps=steps).words, folder, *QUICKLY, name=f"above_{steps}")
            for steps in again.RUN_STEPS
        )
        findings += again.stands_above(first, list(runs))
    return findings, numbers


def verified(run: Witness) -> dict[str, object]:
    """Verify a run; returns its class, findings and size."""
    quake, stopped = run.request.command == "quake", run.files.stopped
    broken = run.violations()
    wrong, remark = run.stop() if stopped else (False, "")
    fine = UNDECIDED if remark else JUSTIFIED if stopped else VERIFIED
    rows = run.shaken.rows if quake else run.files.history
    levels = run.request.levels[-1:] if quake else rows["level"]
    return {
        "class": DEFECT if broken or wrong else fine,
        "findings": "; ".join(filter(None, [*broken, remark])),
        "level": f"{max(levels, default=0):.6g}",
        "steps": len(rows["time"]),
        "iterations": int(rows["iterations"].sum()),
        "cuts": run.files.record["quake"]["halvings"] if quake else int(rows["cuts"].sum()),
    }


def scene_of(seed: int, number: int, records: Path | None) -> RandomScene:
    """Return a scene; records: as in `row_of`."""
    return random_quake(seed, number, records) if records else random_scene(seed, number)


def numbers_of(count: int, seed: int, records: Path | None, words: str) -> list[int]:
    """Return the numbers of the first scenes of a seed whose command contains these words."""
    if not words:
        return list(range(count))
    commands = ((n, " ".join(scene_of(seed, n, records).words)) for n in itertools.count())
    return list(itertools.islice((n for n, command in commands if words in command), count))


def row_of(seed: int, number: int, records: Path | None, parent: Path) -> dict[str, object]:
    """Return the row of a scene; records: folder of records; parent: of the folder of its runs."""
    tempfile.tempdir = str(parent)  # of all that this process writes, as it may be killed
    scene = scene_of(seed, number, records)
    with tempfile.TemporaryDirectory() as folder:
        row = run_and_verify(scene, Path(folder), twice=number % AGAIN == 0)
    return {"scene": name_of(seed, number)} | row


def rows_as_completed(
    scenes: list[tuple[int, int]], jobs: int, records: Path | None
) -> Iterator[dict[str, object]]:
    """Compute the rows of scenes, by seed and number, in parallel, in the order in which they are
    finished.
    """
    # removed by this process, as the others may be killed, with their commands
    folder = tempfile.TemporaryDirectory(prefix="damjoint-", ignore_cleanup_errors=True)
    with folder as name, process_pool(jobs) as pool:
        waiting = [pool.submit(row_of, *scene, records, Path(name)) for scene in scenes]
        yield from (future.result() for future in as_completed(waiting))


def stress(
    count: int,
    seed: int,
    out: Path,
    jobs: int | None = None,
    quake: bool = False,
    seeds: int = 1,
    words: str = "",
) -> list[dict[str, str]]:
    """Run those of the first `count` scenes of so many seeds, from a first one on, that are not in
    the result file yet; returns the rows of all.

    out: CSV of COLUMNS; a row is written when its scene is finished. quake: earthquakes, with their
    records in a folder beside the file. words: of the commands of all these scenes. Raises
    InputError, also if the rows in the file were computed by other code, or scikit-fem is missing.
    """
    if not find_spec("skfem"):
        raise InputError("stress: needs scikit-fem; install it by pip install 'damjoint[test]'")
    now = provenance()
    records = out.resolve().with_name(f"{out.stem}_records") if quake else None
    scenes = [
        (of, number)
        for of in range(seed, seed + seeds)
        for number in numbers_of(count, of, records, words)
    ]
    about = {"rows": len(scenes), "seed": seed, "seeds": seeds, "quake": quake, "with": words}
    with rows_session("stress", out, COLUMNS, ("dim", "seconds"), {"stress": about}) as (
        study,
        done,
    ):
        same_code(out, done.values(), now)
        missing = [scene for scene in scenes if name_of(*scene) not in done]
        rows = rows_as_completed(missing, jobs or os.cpu_count() or 1, records)
        for row in track(rows, "stress", len(missing)):
            cells = row | now
            study.add([str(cells.get(name, "")) for name in COLUMNS])
        done = study.file.read()
    return [done[name_of(*scene)] for scene in scenes]


def name_of(seed: int, number: int) -> str:
    """Return the name of a scene."""
    return f"{seed}-{number}"


def same_code(out: Path, rows: Iterable[dict[str, str]], now: dict[str, str]) -> None:
    """Raise InputError if a result file has rows of other code than now, see `provenance`."""
    for before in rows:
        if before["code"] != now["code"]:
            other = f"damjoint {before['version']} ({before['commit'] or before['date']})"
            raise InputError(
                f"out = {out}: must be a new file; this file has rows of {other}, other code"
            )


def read_rows(path: Path) -> list[dict[str, str]]:
    """Read the rows of a result file."""
    with path.open() as file:
        return list(csv.DictReader(file))


def counts(rows: list[dict[str, str]]) -> dict[str, int]:
    """Count the scenes of each class."""
    return {name: sum(row["class"] == name for row in rows) for name in CLASSES}
