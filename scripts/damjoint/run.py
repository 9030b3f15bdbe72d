"""Run the scenes of a case: mesh once, solve, write tables, fields and picture."""

from __future__ import annotations

import os
import shutil
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path

from tqdm import tqdm

from . import InputError, RunError, getdp, mesh, results
from .parameters import Case


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


def run(case: Case, out: Path, fields: bool = True, picture: bool = True, progress: bool = True) -> list[results.Results]:
    """Run all scenes of a case and write their results below out.

    fields: also displacement, stress and joint fields for Gmsh and ParaView; picture: also a PNG.
    Returns the results in the order of case.scenes(). A run that stops early, or is interrupted, leaves what
    has converged. Raises InputError, RunError.
    """
    getdp.find_getdp()
    check_writable(out)
    scenes = case.scenes()
    folders = [scene_folder(case, scene, out) for scene in scenes]
    for folder in folders:
        shutil.rmtree(folder / "work", ignore_errors=True)
        (folder / "work").mkdir(parents=True)
    start = time.perf_counter()
    mesh_file = out / "work" / "scene.msh"
    counts = mesh.write_mesh(case, mesh_file)
    meshed = time.perf_counter()

    bar = tqdm(total=len(scenes) * case.times[-1], desc=case.name, unit="t", disable=not progress or not sys.stderr.isatty(),
               bar_format="{desc} {percentage:3.0f}%|{bar}| {elapsed}")
    reached = [0.0] * len(scenes)

    def one(i: int) -> dict:
        def on_step(t: float) -> None:
            bar.update(t - reached[i])
            reached[i] = t

        options = {"views": float(fields), "fields": float(fields)}
        return getdp.fill(scenes[i], mesh_file, folders[i] / "work", options, on_step)

    found = []
    try:
        with ThreadPoolExecutor(2) as pool:
            told = [pool.submit(one, i) for i in range(len(scenes))]
            if picture:  # matplotlib loads while GetDP works
                from .picture import draw
            if fields:
                from .fields import write_fields
    finally:
        bar.close()
        solved = time.perf_counter()
        failure = None
        for scene, folder, future in zip(scenes, folders, told, strict=True):
            result = results.read(scene, folder / "work")
            failure = failure or future.exception()
            engine = future.result() if not future.exception() else {}
            result.info = {
                "mesh": counts, "unknowns": engine.get("unknowns"), "engine": "getdp",
                "versions": {"damjoint": version("damjoint"), "getdp": engine.get("version"), "gmsh": version("gmsh"),
                             "python": sys.version.split()[0]},
                "peak_memory_mb": engine.get("memory"),
                "wall_seconds": {"mesh": meshed - start, "solve": solved - meshed}}
            found.append(result)
            results.write(result, folder)
    if failure:
        raise failure
    for result, folder in zip(found, folders, strict=True):
        if fields:
            write_fields(result, mesh_file, folder)
        if picture:
            draw(result, mesh_file, folder)
        result.info["wall_seconds"]["post"] = time.perf_counter() - solved
        results.write(result, folder)
    for folder in folders:
        shutil.rmtree(folder / "work")
    return found
