"""Run the scenes of a case: mesh and condense once, follow the loading, write tables, fields and picture."""

from __future__ import annotations

import os
import re
import resource
import shutil
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path

from tqdm import tqdm

from . import InputError, getdp, results
from .mesh import Mesh
from .parameters import Case

ENGINES = ("auto", "condensed", "getdp")
#: Jump unknowns from which on a second thread of the linear algebra pays; below it waits and disturbs.
MANY = 3000


def check_writable(folder: Path) -> None:
    """Raise InputError if the output folder can not be made or written; makes nothing."""
    existing = folder
    while not existing.exists():
        existing = existing.parent
    if not existing.is_dir() or not os.access(existing, os.W_OK | os.X_OK):
        raise InputError(f"out = {folder}: must be a folder that can be written")


def scene_folder(case: Case, scene: Case, out: Path) -> Path:
    """Where a scene's files go: the case's main scene into out, any further one into out/<uplift>."""
    return out if scene["uplift"] == case["uplift"] else out / scene["uplift"]


class Progress:
    """A bar over the times of all scenes, on a terminal only."""

    def __init__(self, case: Case, scenes: list[Case], show: bool) -> None:
        self.bar = tqdm(total=len(scenes) * case.times[-1], desc=case.name, disable=not show or not sys.stderr.isatty(),
                        bar_format="{desc} {percentage:3.0f}%|{bar}| {elapsed}", leave=False)
        self.reached = [0.0] * len(scenes)

    def step(self, scene: int) -> Callable[[float], None]:
        """What a scene calls with the time of each converged step."""
        def on_step(now: float) -> None:
            self.bar.update(now - self.reached[scene])
            self.reached[scene] = now
        return on_step


def run(case: Case, out: Path, fields: bool = True, picture: bool = True, progress: bool = True,
        engine: str = "auto") -> list[results.Results]:
    """Run all scenes of a case and write their results below out.

    fields: also displacement, stress and joint fields for Gmsh and ParaView; picture: also a PNG;
    engine: condensed (auto) or getdp, the plain problem definition.
    Returns the results in the order of case.scenes(). A run that stops early, or is interrupted, leaves what
    has converged. Raises InputError, RunError.
    """
    if engine not in ENGINES:
        raise InputError(f"engine = {engine}: must be one of {', '.join(ENGINES)}")
    check_writable(out)
    if engine == "getdp":
        return run_getdp(case, out, fields, picture, progress)
    from threadpoolctl import threadpool_limits

    from . import condensed  # noqa: F401 (its BLAS libraries are loaded, and limited, from here on)
    from .condense import joint_size
    with threadpool_limits(1 if joint_size(case) < MANY else None):
        return run_condensed(case, out, fields, picture, progress)


def peak_memory() -> float:
    """Peak resident memory of this process [MB]."""
    try:  # getrusage also counts what the parent had before exec
        return float(re.search(r"VmHWM:\s+(\d+)", Path("/proc/self/status").read_text())[1]) / 1024
    except (OSError, TypeError):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def describe(result: results.Results, engine: str, counts: dict, unknowns: int | None, seconds: dict, getdp_version: str = "",
             memory: float = 0.0) -> None:
    """Fill in what run.json says of the run itself."""
    versions = {"damjoint": version("damjoint"), "gmsh": version("gmsh"), "python": sys.version.split()[0]}
    result.info = {"engine": engine, "mesh": counts, "unknowns": unknowns, "wall_seconds": seconds,
                   "peak_memory_mb": round(max(peak_memory(), memory), 1),
                   "versions": versions | ({"getdp": getdp_version} if getdp_version else {})}


def save(result: results.Results, folder: Path) -> None:
    """Write the tables of a scene, and take the time."""
    start = time.perf_counter()
    results.write(result, folder)
    result.info["wall_seconds"]["post"] = time.perf_counter() - start


def finish(result: results.Results, mesh: Mesh | None, found: Callable, folder: Path, fields: bool, picture: bool) -> None:
    """Write fields and picture of a scene, and the time that all writing took."""
    start = time.perf_counter()
    if fields or picture:
        at = found()
        if fields:
            from .fields import write_fields
            write_fields(result, mesh, at, folder / "fields")
        if picture:
            from .picture import draw
            draw(result, mesh, at, folder)
    result.info["wall_seconds"]["post"] += time.perf_counter() - start
    results.write_info(result, folder)


def run_condensed(case: Case, out: Path, fields: bool, picture: bool, progress: bool) -> list[results.Results]:
    """The condensed engine; see `run`."""
    from .condense import cached
    from .condensed import Filling

    start = time.perf_counter()
    bulk, mesh, hit = cached(case)
    before = {"cache": time.perf_counter() - start} if hit else bulk.seconds
    scenes = case.scenes()
    bar = Progress(case, scenes, progress)
    found = []
    for i, scene in enumerate(scenes):
        begin = time.perf_counter()
        filling = Filling(scene, bulk, bar.step(i))
        try:
            result = filling.run()
        except BaseException:
            results.write(filling.results(), scene_folder(case, scene, out))
            raise
        describe(result, "condensed", bulk.counts, bulk.unknowns, before | {"solve": time.perf_counter() - begin})
        save(result, scene_folder(case, scene, out))
        found.append((result, filling.joint))
    bar.bar.close()
    if (fields or picture) and mesh is None:
        mesh = Mesh(case)
    for result, joint in found:
        def recovered(result: results.Results = result, joint: object = joint) -> dict:
            from .fields import recover
            return recover(result, mesh, joint)
        finish(result, mesh, recovered, scene_folder(case, result.case, out), fields, picture)
    return [result for result, _ in found]


def run_getdp(case: Case, out: Path, fields: bool, picture: bool, progress: bool) -> list[results.Results]:
    """The plain engine: one GetDP process per scene, two at a time; see `run`."""
    getdp.find_getdp()
    scenes = case.scenes()
    folders = [scene_folder(case, scene, out) for scene in scenes]
    for folder in folders:
        shutil.rmtree(folder / "work", ignore_errors=True)
        (folder / "work").mkdir(parents=True)
    start = time.perf_counter()
    mesh = Mesh(case)
    mesh_file = out / "work" / "scene.msh"
    mesh.write(mesh_file)
    meshed = time.perf_counter()
    bar = Progress(case, scenes, progress)
    options = {"views": 0.0, "fields": float(fields or picture)}
    with ThreadPoolExecutor(2) as pool:
        told = [pool.submit(getdp.fill, scene, mesh_file, folder / "work", options, bar.step(i))
                for i, (scene, folder) in enumerate(zip(scenes, folders, strict=True))]
    bar.bar.close()
    found, failure = [], None
    for scene, folder, future in zip(scenes, folders, told, strict=True):
        result = results.read(scene, folder / "work")
        failure = failure or future.exception()
        engine = {} if future.exception() else future.result()
        seconds = {"mesh": meshed - start, "solve": engine.get("wall")}
        describe(result, "getdp", mesh.counts, engine.get("unknowns"), seconds, engine.get("version", ""), engine.get("memory", 0.0))
        save(result, folder)
        found.append(result)
    if failure:
        raise failure
    for result, folder in zip(found, folders, strict=True):
        def printed(result: results.Results = result, folder: Path = folder) -> dict:
            from .fields import from_getdp
            return from_getdp(result, mesh, folder / "work")
        finish(result, mesh, printed, folder, fields, picture)
    for folder in folders:
        shutil.rmtree(folder / "work")
    return found
