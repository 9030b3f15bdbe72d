"""The engine in its own process.

Loading a case and meshing clear Gmsh's model and the ONELAB database, which the window uses; and
the window must respond while the engine works. The process is started once, with all imports.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from .. import InputError, RunError, accuracy
from ..engines import Outcome
from ..engines.condensed import solve as engine
from ..model.fields import Field
from ..model.mesh import Body
from ..model.parameters import declared
from ..model.results import Results
from ..post.summary import Table
from ..runner import early_end, write_outcomes
from ..statics.verdict import decisive_joint, failed, statement
from ..storage import atomic_write
from .numbers import Numbers, table_of_levels, warnings
from .sheet import Request, Sheet, case_text, check_request, titles

#: First line of case files that Save may replace.
SAVED = "// Saved by the window of damjoint; replaced when a run is saved to this folder again.\n"


@dataclass
class SolvedScene:
    """The results of a scene, for the window."""

    result: Results
    bodies: dict[str, Body]
    #: displacement and stress by requested time
    fields: dict[float, Field]
    #: interrupted or failed; empty if no error ended the run
    end_state: str
    #: why it ended or failed; empty if the dam stands
    message: str
    failed: bool
    #: at each of `times`
    numbers: list[Numbers]
    table: Table
    warnings: list[str]

    @staticmethod
    def of(outcome: Outcome) -> SolvedScene:
        """Convert an outcome; computes the bodies' fields."""
        result, (state, _) = outcome.result, early_end(outcome)
        own = result.joints[decisive_joint(result)]
        message = statement(result)
        if state and isinstance(outcome.error, (InputError, RunError)):
            message = str(outcome.error)
        elif state:
            message = reached(state, result)
        return SolvedScene(
            result,
            outcome.mesh().bodies,
            outcome.fields(),
            end_state=state,
            message=message,
            failed=bool(state) or failed(result),
            numbers=[Numbers.at(own, time) for time in np.unique(result.joint["time"])],
            table=table_of_levels(own),
            warnings=warnings(result),
        )

    @property
    def joint(self) -> int:
        """The number of the joint whose curves and numbers are shown."""
        return decisive_joint(self.result)

    @property
    def own(self) -> Results:
        """The results of that joint."""
        return self.result.joints[self.joint]

    @property
    def times(self) -> np.ndarray:
        """Requested times that were reached: the steps of every view."""
        return np.unique(self.result.joint["time"])


def reached(state: str, result: Results) -> str:
    """What a run has reached before it was interrupted, or failed: level, mesh, estimated error."""
    case, estimate = result.case, result.info.get("error_estimate")
    if not result.last:
        return state
    words = f"{state} at level {result.last['level']:.4g} m of {case.levels[-1]:.4g} m"
    if estimate:
        meshes = estimate["n_joint"]
        errors = [q["relative"] for q in estimate["quantities"].values() if q["used"]]
        words += f" on mesh {len(meshes)} (n_joint = {meshes[-1]})"
        if errors:
            words += f"; estimated errors up to {accuracy.percent(max(errors))}"
            words += f" of {accuracy.percent(estimate['accuracy'])} required"
    return words


class Stop:
    """Request to stop, by SIGINT.

    Before the first step it interrupts at once; later after the next converged step.
    """

    def __init__(self) -> None:
        self.requested = self.at_once = False
        signal.signal(signal.SIGINT, self.on_signal)

    def on_signal(self, _number: int, _frame: FrameType | None) -> None:
        """Handle the signal."""
        self.requested = True
        if self.at_once:
            self.at_once = False
            raise KeyboardInterrupt

    def after_step(self) -> None:
        """Raise KeyboardInterrupt if a stop is requested."""
        self.at_once = False
        if self.requested:
            raise KeyboardInterrupt


def serve(pipe: Connection) -> None:
    """Process the messages of the window until it closes.

    In: ("check", Request), ("run", Request), ("save", folder). Out: ("ready", titles, parameters),
    ("checked", Sheet), ("rejected", message), ("step", (number of the scene, pass, time)),
    ("done", [SolvedScene]), ("failed", message), ("saved", folder).
    """
    stop = Stop()
    pipe.send(("ready", titles(), declared()))
    last: tuple[Sheet, list[Outcome]] | None = None
    while True:
        try:
            kind, argument = pipe.recv()
        except (EOFError, OSError):
            return
        try:
            if kind == "save":
                save(argument, last)
                pipe.send(("saved", argument))
                continue
            sheet = check_request(argument)
            pipe.send(("checked", sheet))
            if kind == "run":
                outcomes = run_case(sheet, pipe, stop)
                pipe.send(("done", [SolvedScene.of(outcome) for outcome in outcomes]))
                last = sheet, outcomes
        except InputError as error:
            pipe.send(("rejected", str(error)))
        except KeyboardInterrupt:
            pipe.send(("failed", "stopped before the first step"))
        except Exception as error:  # shown in the window, which stays open
            pipe.send(("failed", str(error) or type(error).__name__))


def run_case(sheet: Sheet, pipe: Connection, stop: Stop) -> list[Outcome]:
    """Solve the scenes of a case; sends a message after each converged step, with the number of the
    pass through the levels: an accuracy takes several, with smaller steps and elements.

    Raises an error before the first step; a later error is in the outcome.
    """
    outcomes = []
    last = [0, 1, 0.0]

    def on_step(scene: int, time: float) -> None:
        before, number, reached_time = last
        number = 1 if scene != before else number + (time <= reached_time)
        last[:] = scene, number, time
        pipe.send(("step", (scene, number, time)))
        stop.after_step()

    stop.requested, stop.at_once = False, True
    try:
        for outcome in accuracy.solve(sheet.case, engine, on_step, True):
            outcomes.append(outcome)
            if outcome.error:
                break
    finally:
        stop.at_once = False
    if outcomes[-1].error and not any(outcome.result.last for outcome in outcomes):
        raise outcomes[-1].error
    return outcomes


def save(folder: str, last: tuple[Sheet, list[Outcome]] | None) -> None:
    """Write the last run and a case file that repeats it.

    Replaces only case files written by the window. Raises InputError if there is no run or no
    folder, or the folder can not be written.
    """
    if last is None:
        raise InputError("nothing to save: press Run first")
    if not folder.strip():
        raise InputError("out: name a folder")
    sheet, outcomes = last
    file = Path(folder) / f"{sheet.case.name}.case"
    if file.exists() and not file.read_bytes().startswith(SAVED.encode()):
        raise InputError(
            f"out = {folder}: must not have a {file.name} of your own; choose another folder"
        )
    write_outcomes(sheet.case, outcomes, Path(folder))
    with atomic_write(file) as part:
        part.write_text(SAVED + case_text(sheet, outcomes[0].result.case), encoding="utf-8")


class EngineProcess:
    """The engine's process, from the window's side: sends and receives messages."""

    def __init__(self) -> None:
        self.start()

    def start(self) -> None:
        """Start the process."""
        context = multiprocessing.get_context("spawn")  # a forked process shares Gmsh's state
        self.pipe, other = context.Pipe()
        self.process = context.Process(target=serve, args=(other,), daemon=True)
        self.process.start()
        other.close()
        self.interrupted = self.killed = False

    def send(self, kind: str, argument: Request | str) -> None:
        """Send a message, see `serve`."""
        self.interrupted = False
        with contextlib.suppress(OSError):  # `messages` reports a dead process
            self.pipe.send((kind, argument))

    def messages(self, wait: float | None = 0.0) -> Iterator[tuple[Any, ...]]:
        """Receive messages; wait: longest time for the first one [s], None: until it comes.

        If the process has died: ("died", message), and a new process is started.
        """
        try:
            while self.pipe.poll(wait):
                yield self.pipe.recv()
                wait = 0.0
        except (EOFError, OSError):
            self.process.join(1)
            message = f"the engine's process ended (exit code {self.process.exitcode}): press Run"
            message = "stopped at once, no results" if self.killed else message
            self.start()
            yield "died", message

    def stop(self) -> None:
        """Stop a run after the next converged step; at the second call at once, without results."""
        if self.interrupted:
            self.killed = True
            self.process.kill()
        else:
            os.kill(self.process.pid, signal.SIGINT)
        self.interrupted = True

    def close(self) -> None:
        """End the process."""
        self.pipe.close()
        self.process.kill()
        self.process.join()
