"""Processes of GetDP: each runs pro/damjoint.pro in its own folder, into which it writes tables."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from ... import ROUND_OFF, InputError, RunError, data
from ...arrays import Array
from ...input.case import Case
from ...input.parameters import assignments, constants, declared, in_rows, listing, quoted
from ...input.scene import LINES, SIDES, TRACTION
from ...mesh.chord import Chord
from ...mesh.joint_mesh import JointMesh, heel_normal
from ...mesh.mesh import Mesh
from ...mesh.sides import area
from ...model.network import path_coordinate
from ...model.results import Info
from ...storage import check_end
from .paths import has_level_ends, lines, values_of_paths

#: Oldest suitable version of GetDP.
OLDEST = (3, 2)
#: Open MPI for a single process: without a search for networks it starts 0.25 s faster.
SINGLE_PROCESS = {
    "OMPI_MCA_ess_singleton_isolated": "1",
    "OMPI_MCA_btl": "self",
    "OMPI_MCA_pml": "ob1",
}
#: Time limit for a program to print its version [s].
VERSION_TIMEOUT = 60

#: Change of direction [rad] from which a joint is bent.
BENT = 1e-6

#: A number as GetDP prints it.
NUMBER = r"(\d+\.?\d*(?:e[+-]?\d+)?)"


def find_getdp() -> str:
    """Path of the GetDP program: $GETDP, then PATH.

    Raises InputError if there is none, or it is too old.
    """
    program = os.environ.get("GETDP") or "getdp"
    path = shutil.which(program)
    why = "no such program"
    if path:
        version = version_of(path)
        if tuple(map(int, re.findall(r"\d+", version)[:2])) >= OLDEST:
            return path
        why = f"version {version}" if version else "prints no version"
    raise InputError(
        f"GETDP = {program}: {why}; allowed: a GetDP >= 3.2 in $GETDP or on the PATH "
        "(Debian, Ubuntu: apt-get install getdp)"
    )


@lru_cache
def version_of(program: str) -> str:
    """The version that a GetDP program prints; empty if none."""
    with tempfile.TemporaryDirectory(prefix="damjoint-") as folder:
        try:
            done = subprocess.run(
                [program, "--version"],
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                env=environment(Path(folder)),
                timeout=VERSION_TIMEOUT,
            )
        except (OSError, subprocess.TimeoutExpired):
            return ""
    version = re.search(r"^\d+\.\d+[\w.-]*", done.stdout.decode(errors="replace"), re.M)
    return version[0] if version else ""


def environment(folder: Path, threads: int = 1) -> dict[str, str]:
    """Environment of GetDP in a folder, which also has the temporary files of Open MPI."""
    number = str(threads)
    fixed = {"TMPDIR": str(folder), "OPENBLAS_NUM_THREADS": number, "OMP_NUM_THREADS": number}
    return {**SINGLE_PROCESS, **os.environ, **fixed}


def user_lists(mesh: Mesh) -> dict[str, list[float]]:
    """The lists of pro/section.pro for a user's own geometry."""
    bodies, faces, heel = mesh.bodies, mesh.faces.values(), mesh.joints[0].heel
    length = area(heel) if mesh.dim == 3 else 1.0
    lines = [name for name in LINES if name in bodies]
    shapes = {shape for solid in mesh.solids.values() for shape, _ in solid.cells}
    number, lowest = numbers(mesh), constants()["UNDER"][0]
    points = np.concatenate([solid.points for solid in mesh.solids.values()])
    under_traction = [number[mesh.bearer(TRACTION)] + lowest] if TRACTION in bodies else []
    return {
        "own_side": [float(SIDES.index(face.side)) for face in faces],
        "own_body": [number[face.body] + lowest for face in faces],
        "own_low": [float(face.surface.points[:, 1].min()) for face in faces],
        "own_joints": [float(len(mesh.joints))],
        "own_bodies": [float(len(number))],
        "own_first_heel": [length, *heel_normal(mesh.joints[0].surface, heel)],
        "own_crest_body": [number[mesh.bearer("crest")]],
        "own_quadrangles": [float(not shapes <= {"triangle", "tetra"})],
        "own_mark_region": [constants()[name.upper()][0] for name in lines],
        "own_mark_body": [number[mesh.bearer(name)] + lowest for name in lines],
        **({"own_traction_body": under_traction} if under_traction else {}),
        "own_extent": np.column_stack([points.min(axis=0), points.max(axis=0)]).ravel().tolist(),
    }


def numbers(mesh: Mesh) -> dict[str, float]:
    """The number of each body in pro/joints.pro."""
    return {name: float(b) for b, name in enumerate(reversed(mesh.solids))}


def user_names(mesh: Mesh) -> str:
    """The list of pro/joints.pro with the names of the joints of a user's own geometry."""
    names = in_rows([quoted(joint.name) for joint in mesh.joints], 4)
    return f"own_joint_names() = Str[{names}];\n"


def position_of_joint(mesh: Mesh, number: int) -> str:
    """The values of pro/joints.pro for the position of a joint of a user's own geometry."""
    joint, of_body, chord = mesh.joints[number], numbers(mesh), Chord.of(mesh.joints[number])
    values = {name: ends[0] for name, ends in joint.ends.items()} | {
        "toe_z": float(joint.surface.points[joint.toe_nodes, 2].mean()),
        "width": joint.width,
        "upper": of_body[joint.upper],
        "lower": of_body[joint.lower],
        "level_ends": float(has_level_ends(joint)),
    }
    start, end = joint.heel_line
    vectors = {
        "chord": chord.plane.T @ chord.along,
        "upwards": chord.plane.T @ chord.normal,
        "heel_start": start,
        "heel_edge": end - start,
    }
    if mesh.dim == 2 and len(bends := straight_parts(joint)) > 2:
        vectors |= {"bend_x": bends[:, 0], "bend_y": bends[:, 1]}
    return lines(values) + "".join(listing(name, vector) for name, vector in vectors.items())


def straight_parts(joint: JointMesh) -> Array:
    """Ends of the straight parts of a joint in the plane, from heel to toe (n, 2); empty if a part
    turns from another one by more than a right angle.
    """
    order = np.argsort(path_coordinate(joint.surface, joint.heel_nodes, joint.toe_nodes))
    points = joint.surface.points[order, :2]
    along = np.diff(points, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    if (along @ along.T).min() < -ROUND_OFF:
        return np.zeros((0, 2))
    bent = np.linalg.norm(np.diff(along, axis=0), axis=1) > BENT
    ends: Array = points[[True, *bent, True]]
    return ends


def macro_of_joint(number: int, values: str) -> str:
    """The macro of pro/joints.pro that sets the values of a joint, by its number from 0."""
    return f"Macro Joint_{number}\n{values}Return\n"


def values_of_joint(case: Case) -> str:
    """The values of pro/joints.pro that the parameters of a joint set, from its case."""
    values = {n: case[n] for n, known in declared().items() if known.of_joints}
    return "".join(f"{name} = {quoted(value)};\n" for name, value in values.items())


def write_problem(
    case: Case,
    mesh: Mesh | None,
    folder: Path,
    options: dict[str, float] | None = None,
    more_lists: dict[str, list[float]] | None = None,
) -> Path:
    """Write the problem file of a case, scene.pro, into the folder of its results.

    mesh: of a user's own geometry; options, more_lists: further constants and lists of pro/*.pro.
    """
    lists: dict[str, Sequence[float]] = {
        "levels": case.levels,
        "tail_levels": case.tail_levels,
        "times": case.times,
        "save_step": [float(t in case.requested) for t in case.times],
    }
    of_joints = ""
    mesh = mesh if case.geometry else None
    if mesh:
        lists |= user_lists(mesh)
    lists |= more_lists or {}
    if mesh or case.of_joints:
        paths = values_of_paths(mesh, case) if mesh else [""] * len(case.joints)
        of_joints = "of_joints = 1;\n" + (user_names(mesh) if mesh else "")
        for k, joint in enumerate(case.joints):
            position = position_of_joint(mesh, k) if mesh else ""
            of_joints += macro_of_joint(k, values_of_joint(joint) + position + paths[k])
    if case.downstream_face:
        lists["downstream_face"] = case.downstream_face
    if case.lift_heights:
        lists["lift_heights"] = case.lift_heights
        lists["lift_slopes"] = [lift["joint_slope"] for lift in case.joints[1:]]
    path = folder / "scene.pro"
    path.write_text(
        of_joints
        + assignments(case.values)
        + "".join(listing(name, values) for name, values in lists.items())
        + "".join(f"{name} = {value!r};\n" for name, value in (options or {}).items())
        + f'out_dir = "./";\nInclude "{data("pro")}/damjoint.pro";\n'
    )
    return path


@dataclass
class Usage:
    """Version, size and cost of a process of GetDP; None: it failed."""

    version: str | None = None
    unknowns: int | None = None
    #: wall time [s], peak memory [MB]
    wall: float | None = None
    memory: float | None = None

    def about(self, mesh: Mesh, seconds: dict[str, float | None]) -> Info:
        """Entries of run.json on the engine, its mesh and its wall seconds."""
        return {
            "engine": "getdp",
            "mesh": mesh.counts,
            "unknowns": self.unknowns,
            "wall_seconds": seconds,
            "getdp": {"version": self.version, "peak_memory_mb": self.memory},
        }


#: Possible last blocks of GetDP's numbering of the unknowns (.pre).
LAST_BLOCKS = "DofData", "ElementsXEdges", "ElementsXFacets", "ExtendedGroup"


class Runner:
    """Runs processes of GetDP, from several threads."""

    def __init__(self) -> None:
        self._running: list[subprocess.Popen[str]] = []

    def stop(self) -> None:
        """End all processes that are running."""
        for process in self._running:
            process.kill()

    def execute(
        self,
        problem: Path,
        arguments: list[str],
        threads: int = 1,
        on_line: Callable[[str], None] = lambda line: None,
    ) -> Usage:
        """Run GetDP on a problem file, in its folder.

        arguments: after the problem file; threads: of the linear algebra; on_line: called with each
        printed line. Raises RunError with GetDP's first error, or else its last lines if it
        failed.
        """
        program = find_getdp()
        usage = Usage(version_of(program), 0, 0.0, 0.0)
        errors: list[str] = []
        last: list[str] = []
        process = subprocess.Popen(
            [program, problem.name, *arguments, "-v", "4"],
            cwd=problem.parent,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=environment(problem.parent, threads),
            errors="replace",
        )
        self._running.append(process)
        try:
            for line in process.stdout or ():
                last = [*last[-2:], line.strip()]
                if line.startswith(("Error", "Fatal", "Warning")) or "Error   :" in line:
                    errors.append(line.strip())
                elif match := re.search(r"System 1/\d+: (\d+) Dofs", line):
                    usage.unknowns = int(match[1])
                elif match := re.search(rf"Stopped.*Wall = {NUMBER}s.*Mem = {NUMBER}Mb", line):
                    usage.wall, usage.memory = float(match[1]), float(match[2])
                on_line(line)
            process.wait()
        finally:  # also if on_line was interrupted
            process.kill()
            process.wait()  # the caller removes its folder
            self._running.remove(process)
        if process.returncode or errors:
            ended = f"ended with exit code {process.returncode}: {' | '.join(last)}"
            raise RunError(f"GetDP: {errors[0] if errors else ended}")
        return usage

    def solve(
        self,
        case: Case,
        mesh: Mesh,
        mesh_file: Path,
        folder: Path,
        fields: bool = False,
        on_step: Callable[[float], None] = lambda time: None,
    ) -> Usage:
        """Solve all load steps of a case; its tables are in folder (see tables.py).

        fields: also displacement and stress; on_step: called with the time of each converged step.
        Raises RunError, OSError (a full disk, which GetDP itself does not notice).
        """
        problem = write_problem(
            case,
            mesh,
            folder,
            {"views": 0.0, "fields": float(fields)},
        )
        steps, of_joints = [], []

        def watch(line: str) -> None:
            if line.startswith("joint "):
                of_joints.append(line)
            elif match := re.match(rf"step {NUMBER} ", line):
                steps.append(line)
                on_step(float(match[1]))

        threads = 1 if case["dim"] == 2 else 2
        usage = self.execute(problem, ["-msh", str(mesh_file), "-solve", "Fill"], threads, watch)
        if (numbering := problem.with_suffix(".pre")).exists():  # GetDP reads it, too
            check_end(numbering, *(f"$End{block}\n" for block in LAST_BLOCKS))
        if steps:
            check_end(folder / "joints.txt", "".join(of_joints))
            check_end(folder / "history.txt", "".join(steps))
        status = folder / "status.txt"
        if not status.exists():
            raise RunError("GetDP: ended without writing status.txt")
        check_end(status, "\n")
        return usage
