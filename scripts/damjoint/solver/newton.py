"""Newton's method with a line search that allows the residual to rise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array


class Diverged(Exception):
    """An iterate exceeds the displacement limit."""


@dataclass(frozen=True)
class Strategy:
    """One way of solving a step."""

    #: how much the residual may grow before a correction is halved
    growth: float
    #: number of iterations with the law's secant stiffness in place of the tangent
    secant: int
    #: whether points that cross the release interval of their shear are placed inside it for one
    #: iteration: no (0), those that close (1), all (2)
    release: int
    iterations: int
    halvings: int


@dataclass(frozen=True)
class Iterate:
    """An iterate: jump and level, residual and its norm, its correction (jump, level) by the law's
    tangent or by its secant, and the side of the shear release of each point.
    """

    jump: Array
    level: float
    residual: Array
    size: float
    correction: Callable[[bool], tuple[Array, float]]
    side: NDArray[np.int_] | None = None


#: The iterate at a jump and a level, after another one or as the first.
Evaluate = Callable[[Array, float, Iterate | None], Iterate]


@dataclass(frozen=True)
class Convergence:
    """When an iterate has converged: norm of the residual <= tolerance, or not above what rounding
    alone makes of it.

    After a slip of a centimetre the terms of the residual are 1e9 times the loads and cancel; no
    iteration gets below a few times their rounding.
    """

    tolerance: float
    #: norm of the residual up to which rounding is accepted as its cause, and how many times the
    #: residual of rounded unknowns it may be
    coarsest: float
    round_off: float
    #: the largest jump of an equilibrium of small displacements [m]
    largest_jump: float

    def reached(self, now: Iterate, before: float, evaluate: Evaluate) -> bool:
        """Whether an iterate has converged; before: norm of the residual one iteration ago."""
        if now.size <= self.tolerance:
            return True
        if not 0.1 * before < now.size <= self.coarsest:  # it still falls, or is too large
            return False
        return bool(now.size <= self.round_off * rounding(now, evaluate))


#: Relative change of the residual below which it stagnates, over so many iterations: something
#: slides or falls.
STAGNATION, ITERATIONS = 1e-6, 4

#: Relative difference of residuals below which two iterates are the same.
SAME = 1e-10

#: x rounded to 43 of its 53 bits is x (2^10 + 1) - (x (2^10 + 1) - x): Veltkamp's splitting.
SPLITTER = 2.0**10


def rounding(now: Iterate, evaluate: Evaluate) -> float:
    """Norm of the residual's change when the last bit of every unknown is rounded away."""
    larger = now.jump * (SPLITTER + 1)
    rounded = larger - (larger - now.jump)
    change = evaluate(rounded, now.level, None).residual - now.residual
    return float(np.linalg.norm(change)) / SPLITTER


def newton(
    evaluate: Evaluate, start: Iterate, convergence: Convergence, strategy: Strategy
) -> tuple[Iterate, int] | None:
    """The converged iterate and the number of iterations; None if there is none.

    Raises Diverged.

    A correction is halved only while it makes the residual grow more than strategy.growth times:
    while points open or break the residual has to rise, which a monotone line search prevents.
    """
    now, sizes = start, list[float]()
    for iterations in range(strategy.iterations + 1):
        if convergence.reached(now, sizes[-1] if sizes else np.inf, evaluate):
            return now, iterations
        if not np.isfinite(now.size) or iterations == strategy.iterations or stagnates(now, sizes):
            return None
        if np.abs(now.jump).max() > convergence.largest_jump:
            raise Diverged
        sizes.append(now.size)
        try:
            jump, level = now.correction(iterations < strategy.secant)
        except (np.linalg.LinAlgError, ValueError):  # singular, or not a number
            return None
        fraction = 1.0
        for _ in range(strategy.halvings + 1):
            new = evaluate(now.jump + fraction * jump, now.level + fraction * level, now)
            if new.size <= strategy.growth * now.size:
                break
            fraction /= 2
        now = new
    return None


def stagnates(now: Iterate, sizes: list[float]) -> bool:
    """Whether the residual repeats, or has not changed over ITERATIONS iterations."""
    unchanged = len(sizes) >= ITERATIONS and all(
        repeats(now.size, [size], STAGNATION) for size in sizes[-ITERATIONS:]
    )
    return unchanged or repeats(now.size, sizes, SAME)


def repeats(size: float, sizes: list[float], tolerance: float) -> bool:
    """Whether a residual's norm is one of earlier ones, within a relative tolerance."""
    return any(abs(size - earlier) <= tolerance * size for earlier in sizes)
