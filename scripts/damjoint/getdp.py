"""The plain engine: GetDP runs pro/damjoint.pro in a folder of its own and leaves its tables there."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

from . import ROOT, InputError, RunError
from .mesh import assignments, listing
from .parameters import Case

OLDEST = (3, 2)
#: One process talks to no other: without looking for networks Open MPI starts a quarter of a second sooner.
ALONE = {"OMPI_MCA_ess_singleton_isolated": "1", "OMPI_MCA_btl": "self", "OMPI_MCA_pml": "ob1"}


def find_getdp() -> str:
    """The GetDP program: $GETDP, then PATH. Raises InputError if there is none."""
    program = os.environ.get("GETDP") or "getdp"
    found = shutil.which(program)
    if not found:
        raise InputError(f"GETDP = {program}: no such program; allowed: a GetDP >= 3.2 in $GETDP or on the PATH "
                         "(Debian, Ubuntu: apt-get install getdp)")
    return found


def write_problem(case: Case, folder: Path, options: dict[str, float] | None = None) -> Path:
    """Write the problem file of a case into folder (scene.pro), to be run by GetDP or opened in Gmsh."""
    wanted = [float(t in case.requested) for t in case.times]
    lists = {"levels": case.levels, "tail_levels": case.tail_levels, "times": case.times, "wanted": wanted}
    path = folder / "scene.pro"
    path.write_text(
        f"// {case.title}\n" + assignments(case.values)
        + "".join(listing(name, values) for name, values in lists.items())
        + "".join(f"{name} = {value!r};\n" for name, value in (options or {}).items())
        + f'out_dir = "{folder}/";\nInclude "{ROOT}/pro/damjoint.pro";\n')
    return path


def execute(problem: Path, arguments: list[str], threads: int = 1,
            on_line: Callable[[str], None] = lambda line: None) -> dict:
    """Run GetDP on a problem file and return {version, unknowns, wall, memory}.

    arguments: after the problem file; threads: of the linear algebra; on_line: called with each line printed.
    Raises RunError with GetDP's first error line; the whole output stands in getdp.log beside the problem.
    """
    environment = {**ALONE, **os.environ, "OPENBLAS_NUM_THREADS": str(threads), "OMP_NUM_THREADS": str(threads)}
    command = [find_getdp(), str(problem), *arguments, "-v", "4"]
    errors, told = [], {"version": "", "unknowns": 0, "wall": 0.0, "memory": 0.0}
    with (problem.parent / "getdp.log").open("w") as log, subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment, errors="replace") as process:
        try:
            for line in process.stdout:
                log.write(line)
                if line.startswith(("Error", "Fatal", "Warning")) or "Error   :" in line:
                    errors.append(line.strip())
                elif match := re.search(r"\[GetDP ([\d.]+)", line):
                    told["version"] = match[1]
                elif match := re.search(r"System 1/\d+: (\d+) Dofs", line):
                    told["unknowns"] = int(match[1])
                elif match := re.search(r"Stopped.*Wall = ([\d.e+-]+)s.*Mem = ([\d.e+-]+)Mb", line):
                    told["wall"], told["memory"] = float(match[1]), float(match[2])
                on_line(line)
        except BaseException:
            process.kill()
            raise
    if told["version"] and tuple(int(v) for v in told["version"].split(".")[:2]) < OLDEST:
        raise InputError(f"GETDP = {command[0]}: version {told['version']}; allowed: 3.2 or newer")
    if process.returncode or errors:
        raise RunError(f"GetDP: {errors[0] if errors else f'ended with exit code {process.returncode}'} (see {log.name})")
    return told


def fill(case: Case, mesh: Path, folder: Path, options: dict[str, float] | None = None,
         on_step: Callable[[float], None] = lambda time: None) -> dict:
    """Follow the loading of a case. Tables are left in folder (see results.py); returns what `execute` tells.

    on_step: called with the time of each converged step.
    """
    problem = write_problem(case, folder, options)

    def watch(line: str) -> None:
        if line.startswith("step "):
            on_step(float(line.split()[1]))

    threads = 1 if case["dim"] == 2 else 2
    return execute(problem, ["-msh", str(mesh), "-solve", "Fill"], threads, watch)
