"""OpenTURNS in a process of its own, in which interrupts are blocked.

While any of its functions runs, OpenTURNS handles SIGINT by a C++ exception in whatever thread
receives the signal, which ends the process where no code expects one. The process that computes
critical levels never loads it, keeps its own handlers, and answers through a pipe.
"""

from __future__ import annotations

import contextlib
import importlib.metadata
import importlib.util
import multiprocessing
import signal
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from .. import InputError
from ..arrays import Array
from ..processes import ProcessKilled

#: A forked process shares what is loaded, and begins with the blocked signals of its parent.
FORK = multiprocessing.get_context("fork")
#: Signals that end a command; the parent ends the process itself.
INTERRUPTS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP

#: Iterations after which the search for a design point ends without one.
MOST_ITERATIONS = 20

#: A question to the parent: "evaluated", "gradient" or "hessian" of the limit state at points.
Ask = Callable[[str, Any], Any]


def version() -> str:
    """The version of the library. Raises InputError if it is not installed."""
    if importlib.util.find_spec("openturns") is None:
        raise InputError("reliability: needs openturns; pip install 'damjoint[reliability]'")
    return importlib.metadata.version("openturns")


# -- in the parent
# --------------------------------------------------------------------------------------------------


class OpenTurns:
    """The parent's side of the process, see `openturns`."""

    def __init__(self, pipe: Connection) -> None:
        self.pipe = pipe

    def result(self, work: Callable[..., Any], *arguments: Any, answers: Any = None) -> Any:
        """The result of work(ask, *arguments) in the process; answers: has the methods by which its
        questions are answered. Raises what these raise, after which the process is of no more use.
        """
        try:
            self.pipe.send((work, arguments))
            while True:
                what, value = self.pipe.recv()
                if what == "result":
                    return value
                if what == "error":
                    raise value
                self.pipe.send(getattr(answers, what)(value))
        except (EOFError, ConnectionError):
            raise ProcessKilled from None


@contextlib.contextmanager
def openturns() -> Iterator[OpenTurns]:
    """The process, which ends with the context or with its parent."""
    pipe, other = FORK.Pipe()
    process = FORK.Process(target=serve, args=(other, pipe), daemon=True)
    try:
        allowed = signal.pthread_sigmask(signal.SIG_BLOCK, INTERRUPTS)
        try:
            process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, allowed)
        other.close()
        yield OpenTurns(pipe)
    finally:
        if process.pid:
            process.kill()
            process.join()


# -- in the process
# --------------------------------------------------------------------------------------------------


def serve(pipe: Connection, of_parent: Connection) -> None:
    """Do the work that arrives through a pipe until the parent closes it or ends."""
    of_parent.close()  # a copy of the parent's end, which would keep the pipe open

    def ask(what: str, points: Any) -> Any:
        pipe.send((what, np.array(points, float)))
        return pipe.recv()

    with contextlib.suppress(EOFError, OSError):  # the parent has ended
        import openturns

        openturns.Log.Show(openturns.Log.NONE)  # its warnings would be mixed with ours
        while True:
            work, arguments = pipe.recv()
            try:
                message = "result", work(ask, *arguments)
            except (EOFError, OSError):
                raise
            except Exception as error:
                message = "error", error
            pipe.send(message)


@dataclass(frozen=True)
class DesignPoint:
    """The point of failure that is nearest to the medians: normal variables, its distance, whether
    the medians fail, importance factors, whether the search has converged; and probabilities of
    failure, None where a curvature does not allow one.
    """

    point: tuple[float, ...]
    distance: float
    median_fails: bool
    importance: tuple[float, ...]
    converged: bool
    form: float
    breitung: float | None
    tvedt: float | None


def normal(ranks: Array) -> Any:
    """The joint distribution of the normal variables with given rank correlations."""
    import openturns as ot

    pearson = ot.NormalCopula.GetCorrelationFromSpearmanCorrelation(ot.CorrelationMatrix(ranks))
    return ot.Normal([0.0] * len(ranks), [1.0] * len(ranks), pearson)


def nearest_failure(
    ask: Ask, ranks: Array, start: Sequence[float], tolerances: Sequence[float], unit: float
) -> DesignPoint | None:
    """The design point, by a search from a start; None if it finds none.

    tolerances: of point and limit state; of the limit state, if no point is found with the first;
    unit: of the limit state.
    """
    import openturns as ot

    function = ot.PythonFunction(
        len(ranks),
        1,
        func_sample=lambda points: ask("evaluated", points) / unit,
        gradient=lambda point: ask("gradient", point) / unit,
        hessian=lambda point: ask("hessian", point) / unit,
    )
    vector = ot.CompositeRandomVector(ot.Function(function), ot.RandomVector(normal(ranks)))
    event = ot.ThresholdEvent(vector, ot.Less(), 0.0)
    solver = ot.AbdoRackwitz()
    solver.setStartingPoint(list(start))
    solver.setMaximumIterationNumber(MOST_ITERATIONS)
    for set_error in (
        solver.setMaximumAbsoluteError,
        solver.setMaximumRelativeError,
        solver.setMaximumResidualError,
    ):
        set_error(tolerances[0])
    for tolerance in tolerances:
        solver.setMaximumConstraintError(tolerance)
        search = ot.FORM(solver, event)
        with contextlib.suppress(RuntimeError):
            search.run()
            break
    else:
        return None
    first, second = search.getResult(), ot.SORM(solver, event)
    second.run()
    curved = second.getResult()
    return DesignPoint(
        point=tuple(first.getPhysicalSpaceDesignPoint()),
        distance=first.getHasoferReliabilityIndex(),
        median_fails=first.getIsStandardPointOriginInFailureSpace(),
        importance=tuple(first.getImportanceFactors()),
        converged=first.getOptimizationResult().getStatus() == ot.OptimizationResult.SUCCESS,
        form=float(first.getEventProbability()),
        breitung=probability_of(curved.getEventProbabilityBreitung),
        tvedt=probability_of(curved.getEventProbabilityTvedt),
    )


def probability_of(method: Callable[[], float]) -> float | None:
    """A probability by a method of OpenTURNS, None if a curvature does not allow it."""
    try:
        value = float(method())
    except Exception:
        return None
    return value if 0 < value < 1 else None


def points_around(
    ask: Ask, ranks: Array, centres: Sequence[Sequence[float]], number: int, seed: int
) -> tuple[Array, Array]:
    """Random points (number, n) around design points, and logarithms (number,) of the weights by
    which their shares are those of the normal variables.
    """
    import openturns as ot

    whole = normal(ranks)
    deviations, matrix = whole.getStandardDeviation(), whole.getCorrelation()
    parts = [ot.Normal(list(centre), deviations, matrix) for centre in centres]
    density = parts[0] if len(parts) == 1 else ot.Mixture(parts)
    ot.RandomGenerator.SetSeed(seed)
    points = density.getSample(number)
    logs = np.ravel(whole.computeLogPDF(points)) - np.ravel(density.computeLogPDF(points))
    return np.array(points), logs
