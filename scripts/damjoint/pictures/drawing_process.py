"""A process that draws pictures. It loads the plotting library while the first process solves."""

from __future__ import annotations

import contextlib
import gc
import multiprocessing
import os
import signal
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import TYPE_CHECKING

from .. import RunError

if TYPE_CHECKING:  # loading them takes the time that the second process saves
    import numpy as np

    from ..model.fields import Solution

#: Forked processes share what is loaded; new interpreters would load it again.
FORK = multiprocessing.get_context("fork")


class DrawingProcess:
    """Draws the pictures of solutions, each in a fork of its own; ends with its parent."""

    def __init__(self) -> None:
        self.pipe, other = FORK.Pipe()
        self.process = FORK.Process(target=serve, args=(other, self.pipe))
        self.process.start()
        other.close()
        self.group = self.process.pid or 0
        os.setpgid(self.group, self.group)  # Ctrl-C reaches the parent, which ends the group

    def __enter__(self) -> DrawingProcess:
        return self

    def __exit__(self, *_: object) -> None:
        """End the process and its forks, also before they have drawn what was sent."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.group, signal.SIGKILL)
        self.process.join()

    def send(self, solution: Solution, folder: Path) -> None:
        """Have the pictures of a solution drawn into a folder."""
        from ..post.validation import shown_time

        result = solution.result
        shown = {t: field for t, field in solution.fields.items() if t == shown_time(result)}
        with contextlib.suppress(OSError):  # has ended: `wait` raises
            self.pipe.send((replace(solution, fields=shown), folder))

    def wait(self) -> None:
        """Wait until the pictures of one of the solutions sent are drawn.

        Raises the error that drawing has raised; RunError if the process has ended.
        """
        try:
            error = self.pipe.recv()
        except (EOFError, OSError):
            raise RunError(ENDED) from None
        if error:
            raise error


def serve(pipe: Connection, of_parent: Connection) -> None:
    """Draw what arrives through a pipe until the parent closes it or ends."""
    of_parent.close()  # a copy of the parent's end, which would keep the pipe open
    gc.disable()  # a fork ends after a picture; searching the libraries' objects takes a quarter
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    with contextlib.suppress(EOFError, OSError):  # the parent has ended
        try:
            from matplotlib import artist

            # it makes the docstrings: a quarter of the time of loading it
            artist.kwdoc = lambda artist: ""
            from . import run_picture

            run_picture.prepare()
        except Exception as error:
            pipe.send(error)
            return
        drawing = dict[int, BaseProcess]()  # by what is ready when it has ended
        while True:
            for ready in wait([pipe, *drawing]):
                if ready is pipe:
                    process = FORK.Process(
                        target=answer, args=(pipe, run_picture.draw, *pipe.recv())
                    )
                    process.start()
                    drawing[process.sentinel] = process
                elif isinstance(ready, int) and not has_answered(drawing.pop(ready)):
                    pipe.send(RunError(ENDED))


#: The message if a process is killed; the results are saved before.
ENDED = "picture: the process that draws it has ended; `damjoint plot` draws it again"


def has_answered(process: BaseProcess) -> bool:
    """Whether a process that has ended was not killed."""
    process.join()
    return process.exitcode == 0


def answer(pipe: Connection, draw: Callable[..., object], solution: Solution, folder: Path) -> None:
    """Draw the pictures of a solution into a folder; send the error that this raises, or None."""
    error, several = None, len(os.sched_getaffinity(0)) > 1
    try:
        draw(solution, folder, joined if several else None)
    except Exception as raised:
        error = raised
    with contextlib.suppress(OSError):  # the first process has ended
        pipe.send(error)


def joined(draw: Callable[[int], np.ndarray]) -> np.ndarray:
    """Pixels of a picture of which a fork draws the second half: the darker ones of both halves."""
    import numpy as np

    pipe, other = FORK.Pipe(duplex=False)

    def send() -> None:
        pipe.close()  # else its end would wait for itself
        with contextlib.suppress(OSError):  # the first half's process has ended
            other.send(draw(1))

    process = FORK.Process(target=send)
    process.start()
    other.close()
    first = draw(0)
    try:
        second = pipe.recv()
    except (EOFError, OSError):  # it has ended, also in the middle of its answer
        second = draw(1)
    process.join()
    return np.minimum(first, second)
