"""The engine in its own process.

Loading a case and meshing clear Gmsh's model and the ONELAB database, which the window uses; and
the window must respond while the engine works. The process is started once, with all imports.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from types import FrameType
from typing import Any, TypeAlias

from .. import InputError, accuracy
from ..engines.condensed import solve as engine
from ..fem.factor import single_thread
from ..input.case import Case
from ..input.parameters import declared
from ..runner import write_outcomes
from ..session import session
from ..storage import atomic_write
from ..studies import quake, quake_study
from .scene import SolvedScene, level_reached
from .sheet import Request, Sheet, case_text, check_request, titles

#: Least time between two pictures of an earthquake while it is computed [s].
LIVE = 1.5
#: First line of case files that Save may replace.
SAVED = "// Saved by the window of damjoint; replaced when a run is saved to this folder again.\n"


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

    def __enter__(self) -> None:
        """Begin a run."""
        self.requested, self.at_once = False, True

    def __exit__(self, *_: object) -> None:
        """End a run."""
        self.at_once = False

    def after_step(self) -> None:
        """Raise KeyboardInterrupt if a stop is requested."""
        self.at_once = False
        if self.requested:
            raise KeyboardInterrupt


def serve(pipe: Connection) -> None:
    """Process the messages of the window until it closes.

    In: ("check", Request), ("run", Request), ("save", folder). Out: ("ready", titles, parameters),
    ("checked", Sheet), ("step", what was reached), ("live", [SolvedScene] so far), ("done",
    [SolvedScene]), ("failed", message), ("saved", folder).
    """
    stop = Stop()
    pipe.send(("ready", titles(), declared()))
    last: tuple[Case, str, Write] | None = None
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
                if sheet.problem:
                    raise InputError(sheet.problem)
                run = run_quake if sheet.request.quake else run_case
                scenes, write = run(sheet, pipe, stop)
                pipe.send(("done", scenes))
                last = sheet.case, case_text(sheet, scenes[0].result.case), write
        except KeyboardInterrupt:
            pipe.send(("failed", "stopped before the first step"))
        except Exception as error:  # shown in the window, which stays open
            pipe.send(("failed", str(error) or type(error).__name__))


#: Writes the files of a run into a folder.
Write: TypeAlias = Callable[[Path], None]


def run_case(sheet: Sheet, pipe: Connection, stop: Stop) -> tuple[list[SolvedScene], Write]:
    """Solve the scenes of a case; sends a message after each converged step, with the number of the
    pass through the levels: an accuracy takes several, with smaller steps and elements.

    Raises an error before the first step; a later error is in the scene.
    """
    outcomes, case = [], sheet.case
    last = [0, 1, 0.0]

    def on_step(scene: int, time: float) -> None:
        before, number, reached_time = last
        number = 1 if scene != before else number + (time <= reached_time)
        last[:] = scene, number, time
        several = f"uplift {case.scenes()[scene]['uplift']}, " if case.also_uplift else ""
        several += f"pass {number}, " if case.accuracy else ""
        pipe.send(("step", several + level_reached(case, case.level_at(time), time)))
        stop.after_step()

    with stop:
        for outcome in accuracy.solve(case, engine.solve, on_step, True):
            outcomes.append(outcome)
            if outcome.error:
                break
    if outcomes[-1].error and not any(outcome.result.last for outcome in outcomes):
        raise outcomes[-1].error
    scenes = []
    for outcome in outcomes:
        scenes += SolvedScene.of(outcome)
    return scenes, partial(write_outcomes, case, outcomes)


def run_quake(sheet: Sheet, pipe: Connection, stop: Stop) -> tuple[list[SolvedScene], Write]:
    """Solve the static loads of a case and its earthquake; as `run_case`."""
    case, error = sheet.case, None

    def on_step(time: float) -> None:
        pipe.send(("step", level_reached(case, case.level_at(time), time)))
        stop.after_step()

    with single_thread():
        with stop:
            under_way = quake.QuakeRun(case, sheet.request.span, on_step)
            live = Live(pipe)
            try:
                for _ in under_way.steps():
                    now = under_way.quake.now.time, under_way.quake.record.duration
                    pipe.send(("step", "earthquake, t = {:.2f} s of {:.2f} s".format(*now)))
                    stop.after_step()
                    live.send(under_way)
            except (Exception, KeyboardInterrupt) as caught:
                if not len(under_way.history):
                    raise
                error = caught
        result = under_way.result_so_far(error) if error else under_way.result()

    def write(folder: Path) -> None:
        with session(case, folder) as study:
            quake_study.save(study, result, fields=True, picture=True)

    return SolvedScene.of_earthquake(result), write


class Live:
    """Sends the scenes of an earthquake after LIVE seconds, in a fifth of the time at most."""

    def __init__(self, pipe: Connection) -> None:
        self.pipe, self.next, self.frames = pipe, time.perf_counter() + LIVE, 1

    def send(self, under_way: quake.QuakeRun) -> None:
        """Send the scenes so far, if it is time and there are further frames."""
        start, frames = time.perf_counter(), len(under_way.history.frames)
        if start < self.next or frames == self.frames:
            return
        self.frames = frames
        self.pipe.send(("live", SolvedScene.of_earthquake(under_way.result_so_far())))
        self.next = time.perf_counter() + max(LIVE, 4 * (time.perf_counter() - start))


def save(folder: str, last: tuple[Case, str, Write] | None) -> None:
    """Write the last run, by its case, the text of a case file that repeats it, and its files.

    Replaces only case files written by the window. Raises InputError if there is no run or no
    folder, or the folder can not be written.
    """
    if last is None:
        raise InputError("nothing to save: press Run first")
    if not folder.strip():
        raise InputError("out: name a folder")
    case, text, write = last
    file = Path(folder) / f"{case.name}.case"
    if file.exists() and not file.read_bytes().startswith(SAVED.encode()):
        raise InputError(
            f"out = {folder}: must not have a {file.name} of your own; choose another folder"
        )
    write(Path(folder))
    with atomic_write(file) as part:
        part.write_text(SAVED + text, encoding="utf-8")


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

        If the process has ended: ("failed", message), and a new process is started.
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
            yield "failed", message

    def stop(self) -> None:
        """Stop a run after the next converged step; at the second call at once, without results."""
        if self.interrupted:
            self.killed = True
            self.process.kill()
        else:
            assert self.process.pid is not None  # it has been started
            os.kill(self.process.pid, signal.SIGINT)
        self.interrupted = True

    def close(self) -> None:
        """End the process."""
        self.pipe.close()
        self.process.kill()
        self.process.join()
