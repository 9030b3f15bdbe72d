"""An earthquake by the reference GetDP model: one process computes the static loads, the time steps
(pro/quake.pro) and the static equilibrium after them.
"""

from __future__ import annotations

import re
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ... import InputError, RunError, require
from ...arrays import Table, Value
from ...dynamics.record import Record
from ...dynamics.stepper import Damping
from ...input.case import Case
from ...mesh.mesh import mesh_of
from ...model.network import with_paths
from ...model.results import Results, column_of, quake_columns
from . import process, tables
from .solve import check as check_static
from .solve import check_sizes

#: Columns of quake.txt (pro/quake.pro), after the word "motion", and of quake_joints.txt, after
#: "joint": those of quake.csv, but displacements and jumps count from the undeformed dam, slip_mean
#: is an integral over the joint, and shear_reserve is the largest shear force.
ROWS = ["time", "ground_ax", "ground_ay", "crest_ux", "crest_ax", "iterations", "dt", "residual"]
ROWS_OF_JOINTS = [
    *("heel_opening", "toe_opening", "slip_mean", "slip_heel", "slip_toe"),
    *("N", "T", "M", "U", "shear_reserve", "open_length", "broken_length"),
]
#: Those that count from the static state, the first row.
FROM_STATIC = "slip_mean", "slip_heel", "slip_toe"

#: Values that parameters must have: no others are part of this model.
NEEDED: dict[str, Value] = {"face_load": "hydrostatic", "face_points": 0.0}
NEEDED |= {"rock_mass": 0.0, "time_integration": "HHT"}


@dataclass(frozen=True, kw_only=True)
class GetdpQuake:
    """What GetDP has computed, up to its end or to an error."""

    #: the static rows, with that after the earthquake as a further one
    static: Results
    #: quake.csv
    rows: Table
    #: whether there is a static equilibrium after the earthquake; None: its end was not reached
    stands: bool | None
    #: wall seconds of the static loads and of the time steps
    seconds: dict[str, float]
    error: BaseException | None = None


def check(case: Case) -> None:
    """Raise InputError if GetDP can not compute the earthquake of a case."""
    check_static(case)
    mode, quake = case["quake_uplift"], "for an earthquake with engine = getdp"
    rule = "be crack, unchanged or zero with engine = getdp"
    require(mode != "transient", "quake_uplift", mode, rule)
    plane = f"be one in 2D, or a section by parameters {quake}"
    require(not case.geometry or case["dim"] == 2, "geometry", str(case.geometry), plane)
    for name, needed in NEEDED.items():
        allowed = needed if isinstance(needed, str) else f"{needed:g}"
        require(case[name] == needed, name, case[name], f"be {allowed} {quake}")


def solve(
    case: Case, record: Record, damping: Damping, dt: float, on_step: Callable[[float], None]
) -> GetdpQuake:
    """The earthquake of a case; GetDP works in a temporary folder.

    dt: longest time step [s]; on_step: is called with the time of each time step. Raises
    InputError if a joint is not straight.
    """
    mesh = mesh_of(case)
    check_sizes(case, mesh)
    case = case.with_joints([joint.of_case for joint in mesh.joints])
    if case.geometry:
        case = with_paths(case, mesh.joints)
        for joint, of_mesh in zip(case.joints, mesh.joints, strict=True):
            rule = f"joint {of_mesh.name} must be straight for an earthquake with engine = getdp"
            if not joint.has_straight_joint:
                raise InputError(f"geometry = {case.geometry}: {rule}")
    options = {"views": 0.0, "fields": 0.0, "damping_a0": damping.a0, "damping_a1": damping.a1}
    lists = {
        f"record_{axis}": np.column_stack([record.times, column]).ravel().tolist()
        for axis, column in zip("xy", record.acceleration.T, strict=True)
    }
    began = time.perf_counter()
    shaking: list[float] = []

    def watch(line: str) -> None:
        if match := re.match(rf"motion {process.NUMBER} ", line):
            shaking.append(time.perf_counter())
            on_step(float(match[1]))

    with tempfile.TemporaryDirectory(prefix="damjoint-") as name:
        folder = Path(name)
        mesh.write(folder / "scene.msh")
        problem = process.write_problem(case.with_values({"dt": dt}), mesh, folder, options, lists)
        usage, error = process.Usage(), None
        try:
            arguments = ["-msh", "scene.msh", "-solve", "Fill"]
            usage = process.Runner().execute(problem, arguments, 1, watch)
        except BaseException as caught:  # also an interrupt: the rows so far are results
            error = caught
        stands = None
        if (folder / "after.txt").exists():
            stands = (folder / "after.txt").read_text() == "1\n"
        try:
            static = tables.read(with_state_after(case) if stands else case, folder)[0]
            rows = read_rows(case, folder)
        except (OSError, ValueError, IndexError) as damage:
            raise error or RunError(f"GetDP: its tables can not be read: {damage}") from None
    if stands is None and not static.stopped and not error:
        last = rows["time"][-1] if len(rows["time"]) else 0.0
        error = RunError(f"earthquake: after t = {last:.6g} s no equilibrium with any time step")
    ends = (shaking[:1] or [time.perf_counter()])[0], (shaking[-1:] or [time.perf_counter()])[0]
    seconds = {"static": ends[0] - began, "earthquake": ends[1] - ends[0]}
    info = usage.about(mesh, {**seconds})
    return GetdpQuake(
        static=replace(static, case=case, info=info),
        rows=rows,
        stands=stands,
        seconds=seconds,
        error=error,
    )


def with_state_after(case: Case) -> Case:
    """A case whose last level stays until the next time, that of the state after the earthquake."""
    return replace(
        case,
        levels=(*case.levels, case.levels[-1]),
        tail_levels=(*case.tail_levels, case.tail_levels[-1]),
        times=(*case.times, len(case.levels) + 1.0),
    )


def read_rows(case: Case, folder: Path) -> Table:
    """The complete rows of quake.txt and quake_joints.txt, as those of quake.csv that GetDP
    computes.

    Raises OSError, ValueError if a file is damaged.
    """
    steps = tables.complete_rows(folder / "quake.txt", ROWS)
    of_joints = tables.complete_rows(folder / "quake_joints.txt", ROWS_OF_JOINTS)
    number = len(case.joints)
    rows = dict(zip(ROWS, steps.T, strict=True))
    rows["crest_ux"] = rows["crest_ux"] - rows["crest_ux"][:1]
    for k, joint in enumerate(case.joints):
        of_joint = dict(zip(ROWS_OF_JOINTS, of_joints[k::number][: len(steps)].T, strict=True))
        for name in FROM_STATIC:
            of_joint[name] = of_joint[name] - of_joint[name][:1]
        of_joint["slip_mean"] /= joint.joint_length
        strength = of_joint["shear_reserve"] if joint.law.shear_strength_formula else np.inf
        of_joint["shear_reserve"] = strength - np.abs(of_joint["T"])
        rows |= {column_of(name, k): values for name, values in of_joint.items()}
    return {name: rows[name][1:] for name in quake_columns(case) if name in rows}
