"""An earthquake: static loading, the record, and the static state that it leaves."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from tabulate import tabulate
from threadpoolctl import threadpool_limits

from .. import InputError, RunError
from ..arrays import Table
from ..dynamics import checkpoint
from ..dynamics.history import QuakeHistory
from ..dynamics.record import Record
from ..dynamics.rigid_block import RigidBlock
from ..dynamics.stepper import Earthquake
from ..engines.condensed.solve import about
from ..fem import factor
from ..fem.bodies import Bodies
from ..joint.interface import interface_of
from ..model.case import Case
from ..model.results import QuakeResult, column_of, quake_columns
from ..post import folder as folders
from ..post import tables
from ..progress import Progress
from ..solver.controls import LevelControl
from ..solver.history import joint_row
from ..solver.load_stepper import LoadStepper
from ..solver.model import Model, StepResult
from ..solver.state import State
from ..statics.verdict import statement
from ..storage import atomic_write
from ..versions import versions

#: Files of an earthquake: rows, stress along the joint in time, the run under way.
ROWS, STRESS, CHECKPOINT = "quake.csv", "quake_stress.npz", "quake_state.npz"

#: Wall seconds between two writes of a run under way.
BETWEEN_WRITES = 10.0

#: The last part of the rest over which the residual values are a mean [s].
MEAN_OVER = 1.0

#: Format of the progress bar: seconds of the record.
BAR = "{desc} {n:.2f} of {total:.2f} s|{bar}| {elapsed}, {remaining} left"

#: Columns of which the largest size is reported.
PEAKS = ("ground_ax", "crest_ux", "crest_ax")
PEAKS_OF_JOINTS = ("heel_opening", "toe_opening", "slip_mean", "open_length")


def check(case: Case) -> None:
    """Raise InputError if an earthquake of a case can not be computed."""
    if case["drive"] != "level":
        raise InputError(f"drive = {case['drive']}: must be level for damjoint quake")
    for name in ("k_h", "k_v"):
        if case[name]:
            raise InputError(
                f"{name} = {case[name]:g}: must be 0 for damjoint quake: the record replaces the "
                "seismic coefficients"
            )
    Record.of(case)


def run(case: Case, out: Path, picture: bool = True, progress: bool = True) -> QuakeResult:
    """Compute the earthquake of a case and write its results into a folder.

    A run that was interrupted continues with the same command. Raises InputError, RunError.
    """
    check(case)
    start = time.perf_counter()
    folders.check_writable(out)
    key = checkpoint.fingerprint(case)
    resumed = (out / CHECKPOINT).is_file()
    with single_thread(), folders.claim_output_folder(case, out, keep=resumed):
        try:
            static, quake = prepared(case)
        except BaseException as error:
            state = "failed" if isinstance(error, Exception) else "interrupted"
            folders.write_state(case, out, state, str(error) or "no step had converged")
            raise
        history = checkpoint.read(out / CHECKPOINT, key, quake) if resumed else None
        if resumed and history is None:
            folders.clear(out)
        history = history or QuakeHistory.of(case)
        first = len(history)
        before = time.perf_counter()
        try:
            follow(quake, history, out / CHECKPOINT, key, progress)
        except BaseException as error:
            history.end_at_complete_row(quake)
            state = "failed" if isinstance(error, Exception) else "interrupted"
            reached = f"{state} after t = {quake.now.time:.6g} s of the record"
            why = f"{reached}: {error}" if str(error) else reached
            with contextlib.suppress(OSError):
                checkpoint.write(out / CHECKPOINT, key, quake, history)
            write_tables(static, history, quake, out)
            write_info(static, out, summary(quake, history), state, why)
            raise
        seconds = {
            "static": before - start,
            "earthquake": time.perf_counter() - before,
            "steps": len(history) - first,
        }
        result = finished(static, quake, history, seconds)
        write_tables(static, history, quake, out)
        write_info(static, out, result.summary, "", result.statement)
        if picture:
            from .quake_picture import draw  # matplotlib takes long to load

            draw(result, out)
        (out / CHECKPOINT).unlink(missing_ok=True)
    return result


@contextlib.contextmanager
def single_thread() -> Iterator[None]:
    """Compute with a single thread, also in MUMPS: the matrices of a step are small."""
    factor.library()  # a limit reaches only libraries that are loaded
    with threadpool_limits(1):
        yield


def outcome_of(case: Case) -> tuple[LoadStepper, bool, dict[str, Any]]:
    """The earthquake of a case without files: static loading, whether there is an equilibrium after
    the earthquake, summary.

    Raises RunError.
    """
    with single_thread():
        static, quake = prepared(case)
        history = QuakeHistory.of(case)
        for _ in whole(quake, history):
            pass
        after = static_state_after(static.model, quake.now.state)
    return static, after is not None, summary(quake, history)


def prepared(case: Case) -> tuple[LoadStepper, Earthquake]:
    """The static loading of a case, and its earthquake before the first step.

    Raises RunError if there is no static equilibrium.
    """
    interface = interface_of(case)
    static = LoadStepper(case, interface)
    static.run()
    if static.stopped:
        raise RunError(
            f"earthquake: the static loads have no equilibrium: {statement(static.results())}"
        )
    case = static.case  # with the joints of a user's own geometry
    return static, Earthquake(case, static.model, static.state, Bodies.of(case))


def follow(quake: Earthquake, history: QuakeHistory, path: Path, key: str, progress: bool) -> None:
    """Compute the steps to the end of the record; writes the run under way into a file."""
    written = time.perf_counter()
    options = {"bar_format": BAR, "leave": False}
    with Progress(quake.case.name, quake.record.duration, progress, **options) as bar:
        bar.update(quake.now.time)
        for step in whole(quake, history):
            bar.update(step)
            if time.perf_counter() - written > BETWEEN_WRITES:
                checkpoint.write(path, key, quake, history)
                written = time.perf_counter()


def whole(quake: Earthquake, history: QuakeHistory) -> Iterator[float]:
    """Compute the steps, add their rows, and yield the length of each."""
    for step in quake.steps():
        history.add(quake, step)
        yield step.dt


def finished(
    static: LoadStepper, quake: Earthquake, history: QuakeHistory, seconds: dict[str, float]
) -> QuakeResult:
    """The result of an earthquake that has reached its end, with the static state after it as a
    further row of the static history.
    """
    found = summary(quake, history)
    found["seconds"] = {name: round(value, 3) for name, value in seconds.items()}
    after = static_state_after(static.model, quake.now.state)
    found["after"] = {"equilibrium": after is not None}
    if after is not None:
        number = len(quake.case.levels) + 1.0
        state = replace(after.state, time=number)
        static.history.add(replace(after, state=state), 0)
        static.history.save(state)
        last = static.history.last
        found["after"] |= {name: last[name] for name in ("crest_ux", "N", "T", "M", "crack_length")}
    full = with_full_uplift(quake)
    if full is not None:
        found["after"]["equilibrium_with_full_uplift_in_the_crack"] = full
    return QuakeResult(
        case=quake.case,
        rows=history.table,
        stress=stress_table(quake, history),
        shapes=shapes(quake, history),
        bodies={name: space.body for name, space in quake.system.spaces.items()},
        summary=found,
        stands=after is not None,
        statement=statement_of(quake.case, found),
    )


def static_state_after(model: Model, end: State) -> StepResult | None:
    """The step to the static equilibrium under the last loads, with the joints as they are; None if
    none is found.
    """
    return model.advance(end, end.time, LevelControl(end.loading.level))


def with_full_uplift(quake: Earthquake) -> bool | None:
    """Whether there is an equilibrium after the earthquake with the full head in the crack; None if
    the water is not imposed.
    """
    case = quake.case
    if any(joint["uplift"] not in ("imposed", "drained") for joint in case.joints):
        return None
    cracked = case.with_values({"uplift": "cracked", "drains": 0.0})
    model = Model(cracked, quake.problem.model.equilibrium.interface)
    return static_state_after(model, quake.now.state) is not None


def shapes(
    quake: Earthquake, history: QuakeHistory
) -> list[tuple[str, float, dict[str, np.ndarray]]]:
    """The states with the largest displacements, see `QuakeResult`."""
    system, result = quake.system, []
    if quake.case["dim"] == 3:
        return result
    for name, peak in history.peaks.items():
        moved = {
            body: (matrix @ peak.displacement).reshape(-1, 2)[
                : len(system.spaces[body].body.points)
            ]
            for body, matrix in system.motion.items()
        }
        result.append((name, peak.time, moved))
    return result


def stress_table(quake: Earthquake, history: QuakeHistory) -> Table:
    """Effective normal stress along the first joint in time."""
    joint = quake.problem.model.equilibrium.interface.joints[0]
    return {
        "time": np.array(history.rows["time"]),
        "s": np.sort(joint.xi) * joint.length,
        "sigma_n_eff": np.array(history.stress, np.float32),
    }


def summary(quake: Earthquake, history: QuakeHistory) -> dict[str, Any]:
    """Peaks with their times, residual values, frequencies, damping and the rigid block."""
    case, rows, record = quake.case, history.table, quake.record
    result: dict[str, Any] = {
        "record": str(case.record),
        "duration": record.duration,
        "time": quake.now.time,
        "steps": len(history),
        "dt": quake.dt,
        "halvings": quake.halvings,
        "iterations": float(np.sum(rows["iterations"])),
        "frequencies": quake.frequencies.tolist(),
        "damping": asdict(quake.damping)
        | {"ratios": [quake.damping.ratio(f) for f in quake.frequencies]},
        "quake_uplift": case["quake_uplift"],
    }
    if not len(history):
        return result
    result |= peaks_and_rest(case, rows)
    for k, joint in enumerate(case.joints):
        block = rigid_block(quake, k).slip(record) if joint.law.limits_shear else None
        if block is not None:
            result["residual"][column_of("rigid_block", k)] = block
    return result


def peaks_and_rest(case: Case, rows: Table) -> dict[str, Any]:
    """Largest values with their times, and residual slip and tilt, from the rows of quake.csv."""
    joints = range(len(case.joints))
    peaks = {}
    for name in (*PEAKS, *(column_of(name, k) for k in joints for name in PEAKS_OF_JOINTS)):
        row = int(np.argmax(np.abs(rows[name])))
        peaks[name] = {"value": rows[name][row], "time": rows["time"][row]}
    last = rows["time"] > rows["time"][-1] - MEAN_OVER
    residual = {}
    for k in joints:
        heel, toe, slip = (
            rows[column_of(name, k)][last].mean()
            for name in ("heel_opening", "toe_opening", "slip_mean")
        )
        residual[column_of("slip", k)] = slip
        residual[column_of("tilt", k)] = (heel - toe) / case.joints[k].joint_along
    return {"peaks": peaks, "residual": residual}


def statement_of(case: Case, found: dict[str, Any]) -> str:
    """What a summary says of the end of an earthquake."""
    slips = [
        f"{1e3 * found['residual'][column_of('slip', k)]:.3g} mm" for k in range(len(case.joints))
    ]
    end = (
        "the dam stands after the earthquake"
        if found["after"]["equilibrium"]
        else "no static equilibrium is found after the earthquake"
    )
    return f"residual slip {', '.join(slips)}; {end}"


def rigid_block(quake: Earthquake, number: int) -> RigidBlock:
    """The rigid block above a joint, held by its static normal force and by what the earthquake
    leaves of its cohesion.
    """
    problem, system = quake.problem, quake.system
    equilibrium = problem.model.equilibrium
    joint, law = equilibrium.interface.joints[number], equilibrium.laws.laws[number]
    row = joint_row(equilibrium, problem.static, number)
    above = quake.case.above([number])
    along, across = (
        system.translation(joint, above, direction)
        for direction in (joint.chord.along, joint.chord.normal)
    )
    end = quake.now.state
    jump = joint.jumps(joint.at_points, end.jump)
    weights = joint.points.weights / joint.points.weights.sum()
    damage = float(weights @ law.damage(jump, end.variables.joints[number]))
    cohesion = law.shear_resistance(0.0, joint.length, damage, 0.0)
    return RigidBlock(
        normal=row["N"],
        shear=row["T"],
        friction=law.mu,
        cohesion=cohesion,
        mass=float(along @ system.mass @ along) / joint.width,
        shear_by_ground=along @ system.inertia / joint.width,
        normal_by_ground=across @ system.inertia / joint.width,
    )


def write_tables(static: LoadStepper, history: QuakeHistory, quake: Earthquake, out: Path) -> None:
    """Write the tables of the static states, quake.csv and the stress along the first joint."""
    tables.write(static.results(), out)
    tables.write_csv(out / ROWS, history.table)
    with atomic_write(out / STRESS) as part, part.open("wb") as file:
        np.savez_compressed(file, **stress_table(quake, history))


def write_info(static: LoadStepper, out: Path, found: dict[str, Any], state: str, why: str) -> None:
    """Write run.json."""
    results = static.results()
    results.info |= about(static.model.equilibrium.bulk)
    seconds = {n: v for n, v in found.get("seconds", {}).items() if n != "steps"}
    results.info |= {"quake": found, "versions": versions(), "wall_seconds": seconds}
    if "after" in found:  # a joint that has slipped everywhere is no failure here
        stands = found["after"]["equilibrium"]
        results.info["verdict"] = "stands" if stands else "no equilibrium"
    folders.write_info(results, out, state, why)


def text(case: Case, found: dict[str, Any]) -> str:
    """Peaks and residual values of a summary as printed tables."""
    units = {"slip": "m", "tilt": "-", "rigid_block": "m"}
    meaning = {"slip": "residual slip", "tilt": "residual tilt", "rigid_block": "rigid block, slip"}
    columns = quake_columns(case)
    peaks = [
        (name, columns[name][0], f"{p['value']:.4g}", f"{p['time']:.3f}")
        for name, p in found["peaks"].items()
    ]
    rest = [
        (name.replace(base, meaning[base]), units[base], f"{value:.4g}")
        for name, value in found["residual"].items()
        for base in units
        if name.startswith(base)
    ]
    frequencies = ", ".join(f"{f:.3g}" for f in found["frequencies"])
    ratios = ", ".join(f"{r:.1%}" for r in found["damping"]["ratios"])
    lines = [
        f"natural frequencies, joint closed, with the water: {frequencies} Hz; damping {ratios}",
        tabulate(peaks, ("peak of", "unit", "value", "at t [s]"), disable_numparse=True),
        tabulate(rest, ("at rest", "unit", "value"), disable_numparse=True),
    ]
    return "\n\n".join(lines)
