"""The engine in a process of its own.

Reading a case and meshing empty Gmsh's model and the ONELAB database, which the window needs; and a
window has to stay alive while its engine works. The process is started once and kept, with all
imports done: the second run is as fast as it can be.
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

import numpy as np

from .. import InputError, RunError, accuracy
from ..engines import Outcome
from ..engines.condensed import solve as engine
from ..model.fields import Field
from ..model.mesh import Body
from ..model.parameters import declared
from ..model.results import Results
from ..run import ended, keep
from ..statics.verdict import failed, statement
from ..storage import atomic_write
from .sheet import Request, Sheet, case_text, fill, titles

#: What a case file begins with that a save may replace.
SAVED = "// Saved by the window of damjoint, which writes it anew when a run is saved here again.\n"


@dataclass
class Scene:
    """A scene that has been run, as the window needs it."""

    result: Results
    bodies: dict[str, Body]
    #: displacement and stress by requested time
    fields: dict[float, Field]
    #: "", or how it ended before its time: interrupted, failed
    ended: str
    #: in words why; empty if the dam stands
    said: str
    failed: bool

    @staticmethod
    def of(outcome: Outcome) -> Scene:
        """What an outcome shows; computes the bodies' fields."""
        result, (how, _) = outcome.result, ended(outcome)
        said = statement(result)
        if how and isinstance(outcome.error, (InputError, RunError)):
            said = str(outcome.error)
        elif how:
            said = f"{how} at level {result.last['level']:.4g} m" if result.last else how
        bodies = outcome.mesh().bodies
        return Scene(result, bodies, outcome.fields(), how, said, bool(how) or failed(result))

    @property
    def times(self) -> np.ndarray:
        """The requested times that were reached: the steps of every view."""
        return np.unique(self.result.joint["time"])


class Stop:
    """The wish to stop, told by SIGINT.

    Before the first step it ends what is under way at once; from then on the engine asks for it
    after each converged step, when all that is kept of the step is there.
    """

    def __init__(self) -> None:
        self.wanted = self.at_once = False
        signal.signal(signal.SIGINT, self.take)

    def take(self, _number: int, _frame: FrameType | None) -> None:
        """What the signal calls."""
        self.wanted = True
        if self.at_once:
            self.at_once = False
            raise KeyboardInterrupt

    def after_step(self) -> None:
        """Raises KeyboardInterrupt if it is wanted."""
        self.at_once = False
        if self.wanted:
            raise KeyboardInterrupt


def serve(pipe: Connection) -> None:
    """Answer the window's messages until it is gone.

    In: ("check", Request), ("run", Request), ("save", folder). Out: ("ready", titles, parameters),
    ("checked", Sheet), ("bad", why), ("step", number of the scene, time), ("done", [Scene]),
    ("failed", why), ("saved", folder).
    """
    stop = Stop()
    pipe.send(("ready", titles(), declared()))
    # what a first run would load while somebody waits for it

    last: tuple[Sheet, list[Outcome]] | None = None
    while True:
        try:
            kind, asked = pipe.recv()
        except (EOFError, OSError):
            return
        try:
            if kind == "save":
                save(asked, last)
                pipe.send(("saved", asked))
                continue
            sheet = fill(asked)
            pipe.send(("checked", sheet))
            if kind == "run":
                outcomes = follow(sheet, pipe, stop)
                pipe.send(("done", [Scene.of(outcome) for outcome in outcomes]))
                last = sheet, outcomes
        except InputError as error:
            pipe.send(("bad", str(error)))
        except KeyboardInterrupt:
            pipe.send(("failed", "stopped before the first step"))
        except Exception as error:  # the window says it and lives on
            pipe.send(("failed", str(error) or type(error).__name__))


def follow(sheet: Sheet, pipe: Connection, stop: Stop) -> list[Outcome]:
    """The scenes of a case; each converged step is told.

    Raises what ends it before its first step (KeyboardInterrupt, RunError); later that is an
    outcome.
    """
    outcomes = []

    def on_step(scene: int, time: float) -> None:
        pipe.send(("step", (scene, time)))
        stop.after_step()

    stop.wanted, stop.at_once = False, True
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
    """Write the last run and the case file that repeats it, in place of one that the window has
    written before.

    Raises InputError if there is none, or no folder, or it can not be written.
    """
    if last is None:
        raise InputError("nothing to save yet: press Run first")
    if not folder.strip():
        raise InputError("out: name a folder")
    sheet, outcomes = last
    file = Path(folder) / f"{sheet.case.name}.case"
    if file.exists() and not file.read_bytes().startswith(SAVED.encode()):
        raise InputError(f"out = {folder}: has a {file.name} of its own: choose another folder")
    keep(sheet.case, outcomes, Path(folder))
    with atomic_write(file) as part:
        part.write_text(SAVED + case_text(sheet, outcomes[0].result.case), encoding="utf-8")


class Engine:
    """The window's end: sends messages, and hands out those that have come back."""

    def __init__(self) -> None:
        self.start()

    def start(self) -> None:
        """Start the process."""
        context = multiprocessing.get_context("spawn")  # a fork would share Gmsh's state
        self.pipe, other = context.Pipe()
        self.process = context.Process(target=serve, args=(other,), daemon=True)
        self.process.start()
        other.close()
        self.interrupted = self.killed = False

    def send(self, kind: str, asked: Request | str) -> None:
        """Ask for something: see serve."""
        self.interrupted = False
        with contextlib.suppress(OSError):  # a process that is gone is told by `messages`
            self.pipe.send((kind, asked))

    def messages(self, wait: float = 0.0) -> Iterator[tuple]:
        """What has come back; wait: at most so many seconds for a first one.

        A process that has died gives ("died", why), and another one is started.
        """
        try:
            while self.pipe.poll(wait):
                yield self.pipe.recv()
                wait = 0.0
        except (EOFError, OSError):
            self.process.join(1)
            why = f"the engine has ended ({self.process.exitcode}); press Run"
            why = "stopped at once, nothing kept" if self.killed else why
            self.start()
            yield "died", why

    def stop(self) -> None:
        """End a run after what has converged; the second time, at once and with nothing kept."""
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
