"""One case, solved and written."""

from __future__ import annotations

import re
import resource
import sys
import time
from importlib.metadata import version
from pathlib import Path

from tqdm import tqdm

from . import __version__, accuracy
from .engines import Outcome, engine_of
from .model.case import Case
from .model.fields import Solution
from .post import folder as folders
from .post import tables


class Progress:
    """A bar over the times of all scenes, on a terminal only."""

    def __init__(self, case: Case, show: bool) -> None:
        count = len(case.scenes())
        self.bar = tqdm(
            total=count * case.times[-1],
            desc=case.name,
            disable=not show or not sys.stderr.isatty(),
            bar_format="{desc} {percentage:3.0f}%|{bar}| {elapsed}",
            leave=False,
        )
        self.reached = [0.0] * count

    def step(self, scene: int, now: float) -> None:
        """What the engines call."""
        self.bar.update(now - self.reached[scene])
        self.reached[scene] = now


def run(
    case: Case,
    out: Path,
    fields: bool = True,
    picture: bool = True,
    progress: bool = True,
    engine: str = "auto",
) -> list[tables.Results]:
    """Run all scenes of a case and write their results below out, in place of an earlier run's.

    fields: also displacement, stress and joint fields for Gmsh and ParaView; picture: also a PNG;
    engine: condensed (auto) or getdp, the plain problem definition.
    Returns the results in the order of case.scenes(). A run that stops early, or is interrupted,
    leaves what has converged. Raises InputError, RunError.
    """
    chosen = engine_of(case, engine)
    bar, found = Progress(case, progress), []
    with folders.taken(case, out):  # only now: bad input leaves an earlier run as it is
        try:
            for outcome in accuracy.solve(case, chosen, bar.step, fields or picture):
                save(outcome, case, out)
                found.append(outcome)
                if outcome.error:
                    raise outcome.error
        except BaseException as error:
            if not found:
                state = "failed" if isinstance(error, Exception) else "interrupted"
                folders.say(case, out, state, str(error) or "nothing had converged")
            raise
        bar.bar.close()
        for outcome in found if fields or picture else []:
            finish(outcome, case, out, fields, picture)
    return [outcome.result for outcome in found]


def keep(case: Case, outcomes: list[Outcome], out: Path) -> None:
    """Write outcomes of a case below out as `run` does, in place of an earlier run's.

    Raises InputError if out can not be written.
    """
    with folders.taken(case, out):
        for outcome in outcomes:
            save(outcome, case, out)
        for outcome in outcomes:
            finish(outcome, case, out, fields=True, picture=True)


def save(outcome: Outcome, case: Case, out: Path) -> None:
    """Write the tables of a scene of a case below out, and run.json with what it took."""
    folder = folders.scene_folder(case, outcome.result.case, out)
    folder.mkdir(exist_ok=True)
    start, result = time.perf_counter(), outcome.result
    tables.write(result, folder)
    result.info["wall_seconds"]["post"] = time.perf_counter() - start
    versions = {"damjoint": __version__, "gmsh": version("gmsh"), "python": sys.version.split()[0]}
    plain = result.info.pop("getdp", {})
    if plain.get("version"):
        versions["getdp"] = plain["version"]
    memory = max(peak_memory(), plain.get("peak_memory_mb") or 0.0)
    result.info |= {"peak_memory_mb": round(memory, 1), "versions": versions}
    folders.write_info(result, folder, *ended(outcome))


def ended(outcome: Outcome) -> tuple[str, str]:
    """How a scene ended before its time, failed or interrupted, and why; empty if it did not."""
    if not outcome.error:
        return "", ""
    last = outcome.result.last
    where = f" after level {last['level']:.6g} m" if last else " before the first step"
    state = "failed" if isinstance(outcome.error, Exception) else "interrupted"
    return state, f"{state}{where}" + (f": {outcome.error}" if str(outcome.error) else "")


def finish(outcome: Outcome, case: Case, out: Path, fields: bool, picture: bool) -> None:
    """Write fields and picture of a scene, and the time that all writing took."""
    start, result = time.perf_counter(), outcome.result
    folder = folders.scene_folder(case, result.case, out)
    solution = Solution(result, outcome.mesh().bodies, outcome.fields())
    if fields and solution.fields:
        from .post.field_files import write_fields

        write_fields(solution, folder / "fields")
    if picture:
        from .post.pictures import draw

        draw(solution, folder)
    result.info["wall_seconds"]["post"] += time.perf_counter() - start
    folders.write_info(result, folder, *ended(outcome))


def peak_memory() -> float:
    """Peak resident memory of this process [MB]."""
    try:  # getrusage also counts what the parent had before exec
        told = Path("/proc/self/status").read_text()
        return float(re.search(r"VmHWM:\s+(\d+)", told)[1]) / 1024
    except (OSError, TypeError):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
