"""An earthquake: static loading, the record, and the static state that it leaves."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from .. import InputError, RunError, require
from ..arrays import Array, Table
from ..dynamics import absorbing, checkpoint
from ..dynamics.frames import at_nodes
from ..dynamics.history import QuakeHistory
from ..dynamics.record import Record
from ..dynamics.rigid_block import RigidBlock
from ..dynamics.stepper import Earthquake
from ..engines.condensed.recover import recover
from ..engines.condensed.solve import about
from ..fem.bodies import Bodies
from ..fem.factor import single_thread
from ..input.case import Case
from ..joint.interface import interface_of
from ..model.fields import Field
from ..model.results import column_of
from ..progress import Progress
from ..session import preparation, study_end
from ..solver.controls import LevelControl
from ..solver.history import JointState
from ..solver.load_stepper import LoadStepper
from ..solver.model import Model, StepOptions, StepResult
from ..solver.state import State, Trace
from ..solver.trace_table import trace_table
from ..statics.statement import statement
from . import quake_summary
from .quake_result import QuakeResult

#: First and last time of the frames [s]; None: the whole record.
Span: TypeAlias = tuple[float, float] | None

#: Wall seconds between two writes of a run under way.
BETWEEN_WRITES = 10.0

#: Format of the progress bar: seconds of the record.
BAR = "{desc} {n:.2f} of {total:.2f} s|{bar}| {elapsed}, {remaining} left"


def span_of(name: str, text: str) -> tuple[float, float]:
    """Two times FIRST:LAST [s] from a text; name: for the message. Raises InputError."""
    with contextlib.suppress(ValueError):
        first, last = map(float, text.split(":"))
        if 0 <= first < last:
            return first, last
    raise InputError(f"{name} {text}: must be two times FIRST:LAST [s], 0 <= FIRST < LAST")


def check(case: Case, span: Span = None) -> None:
    """Raise InputError if an earthquake of a case can not be computed; span: of the frames."""
    require(case["drive"] == "level", "drive", case["drive"], "be level for damjoint quake")
    for name in ("k_h", "k_v"):
        rule = "be 0 for damjoint quake: the record replaces the seismic coefficients"
        require(not case[name], name, case[name], rule)
    mode = case["quake_uplift"]
    if mode == "transient":
        has_flow = any(joint["uplift"] == "flow" for joint in case.joints)
        rule = "be crack, unchanged or zero without uplift = flow"
        require(has_flow, "quake_uplift", mode, rule)
        rule = (
            "be > 0 with quake_uplift = transient, else the pressure would leap as a point opens "
            "(water alone: aperture / 2.2 GPa; 1e-12 m/Pa with a little air)"
        )
        require(case["storage"], "storage", 0, rule)
    steady = mode == "crack" and case.stores_water
    rule = f"with time_unit = {case['time_unit']:g} (its flow is steady)"
    require(not steady, "quake_uplift", mode, f"be transient, unchanged or zero {rule}")
    absorbing.check(case)
    duration = Record.of(case).duration
    if span:
        rule = f"begin before the end of the record, {duration:g} s"
        require(span[0] < duration, "fields", f"{span[0]:g}:{span[1]:g}", rule)


#: State of an earthquake that goes on.
RUNNING = "running"


class QuakeRun:
    """An earthquake of a case under way."""

    def __init__(
        self, case: Case, span: Span = None, on_step: Callable[[float], None] = lambda _: None
    ) -> None:
        """Compute the static loads; on_step: is called with the time of each of their steps.

        Raises RunError if there is no static equilibrium.
        """
        start = time.perf_counter()
        self.static = static = LoadStepper(case, interface_of(case), on_step)
        static.run()
        if static.stopped:
            reason = statement(static.results())
            raise RunError(f"earthquake: the static loads have no equilibrium: {reason}")
        self.before = static.results()
        case = static.case  # with the joints of a user's own geometry
        self.quake = Earthquake(case, static.model, static.state, Bodies.of(case))
        self.history = QuakeHistory.of(self.quake, span)
        self.seconds = {"static": time.perf_counter() - start, "earthquake": 0.0, "steps": 0}

    def steps(self) -> Iterator[float]:
        """Compute the steps that remain, add their rows, and yield the length of each."""
        start, before = time.perf_counter(), len(self.history)
        for step in self.quake.steps():
            self.history.add(self.quake, step)
            now = time.perf_counter() - start, len(self.history) - before
            self.seconds["earthquake"], self.seconds["steps"] = now
            yield step.dt

    def result(self) -> QuakeResult:
        """The result at the end; the static state after it is the last row of the history."""
        quake, static = self.quake, self.static
        summary = self.summary()
        summary["seconds"] = {name: round(value, 3) for name, value in self.seconds.items()}
        after, trace = self.static_state_after(), quake.now.state.trace
        summary["after"] = {"equilibrium": after is not None}
        if after is not None:
            number = len(quake.case.levels) + 1.0
            state, trace = replace(after.state, time=number), after.state.trace
            static.history.add(replace(after, state=state), 0)
            static.history.save(state)
            last = static.history.last
            names = "crest_ux", "N", "T", "M", "crack_length", "broken_length"
            summary["after"] |= {name: last[name] for name in names}
        full = self.stands_with_full_uplift()
        if full is not None:
            summary["after"]["equilibrium_with_full_uplift_in_the_crack"] = full
        return self._result_of(summary, trace)

    def result_so_far(self, error: BaseException | None = None) -> QuakeResult:
        """The result up to now, or up to an error or interrupt."""
        self.history.end_at_complete_row(self.quake)
        where = f" after t = {self.quake.now.time:.6g} s of the record"
        end = study_end(error, where) if error else (RUNNING, f"{RUNNING}{where}")
        return self._result_of(self.summary(), self.quake.now.state.trace, end, error)

    def summary(self) -> dict[str, Any]:
        """See `quake_summary`, of the rows so far; with the slip of the rigid blocks, but
        for joints between bodies that other joints hold.
        """
        quake = self.quake
        summary = quake_summary.summary(quake, self.history.table, quake.halvings)
        for k, joint in enumerate(quake.case.joints if len(self.history) else ()):
            if not joint.law.has_friction or quake.case.graph.is_internal(k):
                continue
            if (block := rigid_block(quake, k).slip(quake.record)) is not None:
                summary["residual"][column_of("rigid_block", k)] = block
        return summary

    def _result_of(
        self,
        summary: dict[str, Any],
        trace: Trace | None,
        end: tuple[str, str] = ("", ""),
        error: BaseException | None = None,
    ) -> QuakeResult:
        """The result with a summary; trace: of the last state; end: state and message before the
        end of the record; error: that ended it early.
        """
        quake, history, static = self.quake, self.history, self.static.results()
        before = quake.problem.static.trace
        if trace and before:
            equilibrium = quake.problem.model.equilibrium
            times = history.rows["time"]
            static.steps = trace_table(equilibrium, trace, times, len(before.updates))
        seconds = {name: value for name, value in self.seconds.items() if name != "steps"}
        static.info |= about(quake.problem.model.equilibrium.bulk) | {"wall_seconds": seconds}
        return QuakeResult.of(
            quake.case,
            static,
            summary,
            end,
            error=error,
            rows=history.table,
            stress=self.stress_table(),
            before=self.before,
            frames=history.frames.results(quake),
            static_fields=self.static_fields,
            fields=lambda: history.frames.fields(
                quake, self.static_fields()[quake.problem.static.time]
            ),
            shapes=self.shapes(),
            mesh=quake.bodies.mesh,
        )

    def static_fields(self) -> dict[float, Field]:
        """Displacement and stress of the bodies by time of the static states."""
        scenes = [(self.static.model.equilibrium, self.static.history)]
        return recover(self.quake.bodies, scenes)[0]

    def static_state_after(self) -> StepResult | None:
        """The step to equilibrium under the last loads, with the joints as they are; None: none."""
        return static_step(self.static.model, self.quake.now.state)

    def stands_with_full_uplift(self) -> bool | None:
        """Whether there is an equilibrium after the earthquake with the full head in the crack;
        None if the water is not imposed.
        """
        case = self.quake.case
        if any(joint["uplift"] not in ("imposed", "drained") for joint in case.joints):
            return None
        cracked = case.with_values({"uplift": "cracked", "drains": 0.0})
        model = Model(cracked, self.quake.problem.model.equilibrium.interface)
        return static_step(model, self.quake.now.state) is not None

    def shapes(self) -> list[tuple[str, float, dict[str, Array]]]:
        """The states with the largest displacements, see `QuakeResult`."""
        if self.quake.case["dim"] == 3:
            return []
        system, whole = self.quake.system, self.quake.problem.whole
        return [
            (name, peak.time, at_nodes(system, whole(peak.displacement)))
            for name, peak in self.history.peaks.items()
            if peak.value > 0  # the joint may stay closed
        ]

    def stress_table(self) -> Table:
        """Effective normal stress along the first joint in time."""
        joint = self.quake.problem.model.equilibrium.interface.joints[0]
        return {
            "time": np.array(self.history.rows["time"]),
            "s": np.sort(joint.xi) * joint.length,
            "sigma_n_eff": np.array(self.history.stress, np.float32).reshape(-1, len(joint.xi)),
        }


def static_step(model: Model, end: State) -> StepResult | None:
    """The step from the end of an earthquake to the static equilibrium under the last loads; also
    from closed joints where they are open throughout, so that no contact guides Newton's method.
    """
    end, control = replace(end, stored=()), LevelControl(end.loading.level)
    found, interface = model.advance(end, end.time, control), model.equilibrium.interface
    if found or (interface.jumps(interface.at_points, end.jump)[:, 0] <= 0).any():
        return found
    closed = StepOptions(guess=(np.zeros_like(end.jump), end.loading.level))
    return model.advance(end, end.time, control, closed)


def outcome_of(case: Case) -> tuple[LoadStepper, dict[str, Any]]:
    """The earthquake of a case without files: static loading, summary. Raises RunError."""
    with single_thread():
        run = QuakeRun(case)
        for _ in run.steps():
            pass
        after = run.static_state_after()
    return run.static, run.summary() | {"after": {"equilibrium": after is not None}}


@dataclass(frozen=True)
class Checkpoint:
    """A file that keeps an earthquake under way, so that it can be continued."""

    path: Path
    #: fingerprint of the case
    key: str

    @property
    def exists(self) -> bool:
        """Whether the file has an earthquake of this key."""
        return checkpoint.exists(self.path, self.key)

    def read(self, run: QuakeRun) -> None:
        """Continue from the file."""
        checkpoint.read(self.path, self.key, run.quake, run.history)

    def write(self, run: QuakeRun) -> None:
        """Write the last converged step and all rows."""
        checkpoint.write(self.path, self.key, run.quake, run.history)


def compute(
    case: Case, span: Span = None, saved: Checkpoint | None = None, progress: bool = True
) -> QuakeResult:
    """The earthquake of a case, up to its end or to an error in its steps.

    span: of the frames [s], by default the whole record; saved: file from which it continues, if it
    exists, and that is written meanwhile. Raises RunError if the static loads can not be computed.
    """
    with single_thread():
        with preparation(case, progress):
            run = QuakeRun(case, span)
        if saved and saved.exists:
            saved.read(run)
        try:
            follow(run, saved, progress)
            return run.result()
        except BaseException as error:
            result = run.result_so_far(error)
            if saved:
                with contextlib.suppress(OSError):
                    saved.write(run)
            return result


def progress_bar(case: Case, record: Record, show: bool) -> Progress:
    """Progress over the seconds of a record."""
    return Progress(case.name, record.duration, show, bar_format=BAR, leave=False)


def follow(run: QuakeRun, saved: Checkpoint | None, progress: bool) -> None:
    """Compute the steps to the end of the record; saved: is written meanwhile."""
    written, quake = time.perf_counter(), run.quake
    with progress_bar(quake.case, quake.record, progress) as bar:
        bar.update(quake.now.time)
        for step in run.steps():
            bar.update(step)
            if saved and time.perf_counter() - written > BETWEEN_WRITES:
                saved.write(run)
                written = time.perf_counter()


def rigid_block(quake: Earthquake, number: int) -> RigidBlock:
    """The rigid block above a joint, held by its static normal force and by what the earthquake
    leaves of its cohesion.
    """
    problem, system = quake.problem, quake.system
    equilibrium = problem.model.equilibrium
    joint, law = equilibrium.interface.joints[number], equilibrium.laws.laws[number]
    row = JointState(equilibrium, problem.static, number).row
    above = quake.case.graph.separated([number])
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
