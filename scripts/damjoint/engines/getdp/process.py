"""GetDP as a process: it runs pro/damjoint.pro in a folder of its own and leaves its tables
there.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

from ... import InputError, RunError, data
from ...model.case import Case
from ...model.mesh import LINES, SIDES, Mesh, area, heel_normal
from ...model.parameters import assignments, constants, listing
from ...storage import check_end

OLDEST = (3, 2)
#: One process talks to no other: without looking for networks Open MPI starts a quarter of a second
#: sooner.
ALONE = {
    "OMPI_MCA_ess_singleton_isolated": "1",
    "OMPI_MCA_btl": "self",
    "OMPI_MCA_pml": "ob1",
}
#: Seconds in which a program has to say its version.
PATIENCE = 60


#: A number that GetDP prints.
NUMBER = r"(\d+\.?\d*(?:e[+-]?\d+)?)"


def find_getdp() -> str:
    """The GetDP program: $GETDP, then PATH.

    Raises InputError if there is none that can be used.
    """
    program = os.environ.get("GETDP") or "getdp"
    found = shutil.which(program)
    why = "no such program"
    if found:
        told = version_of(found)
        if tuple(map(int, re.findall(r"\d+", told)[:2])) >= OLDEST:
            return found
        why = f"version {told}" if told else "does not say a version"
    raise InputError(
        f"GETDP = {program}: {why}; allowed: a GetDP >= 3.2 in $GETDP or on the PATH "
        "(Debian, Ubuntu: apt-get install getdp)"
    )


@lru_cache
def version_of(program: str) -> str:
    """The version that a GetDP says it has; empty if it says none."""
    with tempfile.TemporaryDirectory(prefix="damjoint-") as folder:
        try:
            done = subprocess.run(
                [program, "--version"],
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                env=environment(Path(folder)),
                timeout=PATIENCE,
            )
        except (OSError, subprocess.TimeoutExpired):
            return ""
    told = re.search(r"^\d+\.\d+[\w.-]*", done.stdout.decode(errors="replace"), re.M)
    return told[0] if told else ""


def environment(folder: Path, threads: int = 1) -> dict[str, str]:
    """The environment of a GetDP that works in a folder; what Open MPI leaves stays there."""
    number = str(threads)
    own = {"TMPDIR": str(folder), "OPENBLAS_NUM_THREADS": number, "OMP_NUM_THREADS": number}
    return {**ALONE, **os.environ, **own}


def own_lists(mesh: Mesh) -> dict[str, list[float]]:
    """What pro/section.pro has to know of a user's own geometry."""
    (joint,), bodies, faces = mesh.joints.values(), mesh.bodies, mesh.faces.values()
    length = area(joint.heel) if mesh.dim == 3 else 1.0
    normal, crest = heel_normal(joint.surface, joint.heel), bodies["crest"].points[0]
    lines = [name for name in LINES if name in bodies]
    shapes = {shape for solid in mesh.solids.values() for shape, _ in solid.cells}
    return {
        "own_side": [float(SIDES.index(face.side)) for face in faces],
        "own_body": [float(face.body != joint.upper) for face in faces],
        "own_low": [float(face.surface.points[:, 1].min()) for face in faces],
        "own_ends": [
            *(values[0] for values in joint.ends.values()),
            *(joint.width, length, *normal[:2], *crest),
        ],
        "own_quadrangles": [float("quad" in shapes)],
        "own_mark_region": [constants()[name.upper()][0] for name in lines],
        "own_mark_body": [float(mesh.bearer(name) != joint.upper) for name in lines],
    }


def write_problem(
    case: Case, mesh: Mesh | None, folder: Path, options: dict[str, float] | None = None
) -> Path:
    """Write the problem file of a case into folder (scene.pro); its results go beside it.

    mesh: of a user's own geometry.
    """
    save_step = [float(t in case.requested) for t in case.times]
    lists = {
        "levels": case.levels,
        "tail_levels": case.tail_levels,
        "times": case.times,
        "save_step": save_step,
    }
    if case.geometry:
        lists |= own_lists(mesh)
    path = folder / "scene.pro"
    path.write_text(
        assignments(case.values)
        + "".join(listing(name, values) for name, values in lists.items())
        + "".join(f"{name} = {value!r};\n" for name, value in (options or {}).items())
        + f'out_dir = "./";\nInclude "{data("pro")}/damjoint.pro";\n'
    )
    return path


#: Processes under way, to be ended when their run is interrupted.
RUNNING: list[subprocess.Popen] = []


def stop_all() -> None:
    """End all processes under way."""
    for process in RUNNING:
        process.kill()


def execute(
    problem: Path,
    arguments: list[str],
    threads: int = 1,
    on_line: Callable[[str], None] = lambda line: None,
) -> dict:
    """Run GetDP on a problem file, in its folder, and return {version, unknowns, wall, memory}.

    arguments: after the problem file; threads: of the linear algebra; on_line: called with each
    line printed. Raises RunError with GetDP's first error line, and its last lines where it ended
    without one.
    """
    program = find_getdp()
    command = [program, problem.name, *arguments, "-v", "4"]
    errors, last = [], []
    told = {"version": version_of(program), "unknowns": 0, "wall": 0.0, "memory": 0.0}
    process = subprocess.Popen(
        command,
        cwd=problem.parent,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=environment(problem.parent, threads),
        errors="replace",
    )
    RUNNING.append(process)
    try:
        for line in process.stdout:
            last = [*last[-2:], line.strip()]
            if line.startswith(("Error", "Fatal", "Warning")) or "Error   :" in line:
                errors.append(line.strip())
            elif match := re.search(r"System 1/\d+: (\d+) Dofs", line):
                told["unknowns"] = int(match[1])
            elif match := re.search(rf"Stopped.*Wall = {NUMBER}s.*Mem = {NUMBER}Mb", line):
                told["wall"], told["memory"] = float(match[1]), float(match[2])
            on_line(line)
        process.wait()
    finally:  # also where on_line has been interrupted
        process.kill()
        process.wait()  # its folder is removed next
        RUNNING.remove(process)
    if process.returncode or errors:
        why = (
            errors[0]
            if errors
            else f"ended with exit code {process.returncode}: {' | '.join(last)}"
        )
        raise RunError(f"GetDP: {why}")
    return told


#: With which of its blocks GetDP's numbering of the unknowns (.pre) can end.
LAST_BLOCKS = "DofData", "ElementsXEdges", "ElementsXFacets", "ExtendedGroup"


def fill(
    case: Case,
    mesh: Mesh,
    mesh_file: Path,
    folder: Path,
    fields: bool = False,
    on_step: Callable[[float], None] = lambda time: None,
) -> dict:
    """Follow the loading of a case.

    Tables are left in folder (see tables.py); returns what `execute` tells.
        fields: also displacement and stress; on_step: called with the time of each converged step.
    Raises RunError, OSError (a full disk, which GetDP itself does not notice).
    """
    problem, steps = write_problem(case, mesh, folder, {"views": 0.0, "fields": float(fields)}), []

    def watch(line: str) -> None:
        if match := re.match(rf"step {NUMBER} ", line):
            steps.append(line)
            on_step(float(match[1]))

    threads = 1 if case["dim"] == 2 else 2
    told = execute(problem, ["-msh", str(mesh_file), "-solve", "Fill"], threads, watch)
    if (numbering := problem.with_suffix(".pre")).exists():  # GetDP reads back what it wrote
        check_end(numbering, *(f"$End{block}\n" for block in LAST_BLOCKS))
    if steps:  # printed, and written
        check_end(folder / "history.txt", "".join(steps))
    status = folder / "status.txt"
    if not status.exists():
        raise RunError("GetDP: ended without saying how far it went")
    check_end(status, "\n")
    return told
