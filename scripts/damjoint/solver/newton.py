"""Newton's method with a line search that lets the residual rise for a moment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import linalg


class Fallen(Exception):
    """An iterate has gone so far that nothing is likely to hold it."""


@dataclass(frozen=True)
class Attempt:
    """One way of trying a step."""

    #: how much the residual may grow before a correction is halved
    growth: float
    #: for how many iterations the law's secant stiffness takes the place of the tangent
    secant: int
    #: whether points that pass over the release of their shear stop in it first: no (0), those that
    #: close (1), all (2)
    release: int
    iterations: int
    halvings: int


@dataclass
class Iterate:
    """An iterate: jump and level, residual and its size, its correction (jump, level) by the law's
    tangent or by its secant, and where its points are in the release of their shear.
    """

    jump: np.ndarray
    level: float
    residual: np.ndarray
    size: float
    correction: Callable[[bool], tuple[np.ndarray, float]]
    side: np.ndarray | None = None


#: The iterate at a jump and a level, that follows another one or none.
Evaluate = Callable[..., Iterate]


@dataclass(frozen=True)
class Limit:
    """When an iterate has converged: residual <= tolerance * reference, or what rounding alone
    makes of it.

    A dam that has slid by a centimetre has terms in its residual that are 1e9 times its loads and
    cancel; no iteration gets below a few times their rounding. Noise: what the rounding of the
    unknowns does to the residual.
    """

    size: float
    #: residual up to which rounding is an excuse, and how many times the noise
    coarsest: float
    round_off: float
    #: the largest jump that a dam that stands can have [m]
    farthest: float

    def met(self, now: Iterate, before: float, evaluate: Evaluate) -> bool:
        """Whether an iterate has converged; before: size of the residual one iteration ago."""
        if now.size <= self.size:
            return True
        if not 0.1 * before < now.size <= self.coarsest:  # it still falls, or is too large
            return False
        return now.size <= self.round_off * noise(now, evaluate)


#: A residual that does not change by more than this part in DRIFT iterations: something slides or
#: falls, and nothing will hold it.
STILL, DRIFT = 1e-6, 4

#: x rounded to 43 of its 53 bits is x (2^10 + 1) - (x (2^10 + 1) - x): Veltkamp's splitting.
SPLITTER = 2.0**10


def noise(now: Iterate, evaluate: Evaluate) -> float:
    """The norm of the residual's change when the last bit of every unknown is rounded away."""
    larger = now.jump * (SPLITTER + 1)
    rounded = larger - (larger - now.jump)
    return np.linalg.norm(evaluate(rounded, now.level, None).residual - now.residual) / SPLITTER


def newton(
    evaluate: Evaluate, start: Iterate, limit: Limit, attempt: Attempt
) -> tuple[Iterate, int] | None:
    """The iterate that meets the limit, and the number of iterations; None if it is not found.

    Raises Fallen.

    A correction is halved only while it makes the residual grow more than attempt.growth times:
    while points open or break the residual has to rise, and a monotone line search would creep
    there.
    """
    now, sizes = start, []
    for iterations in range(attempt.iterations + 1):
        if limit.met(now, sizes[-1] if sizes else np.inf, evaluate):
            return now, iterations
        if not np.isfinite(now.size) or iterations == attempt.iterations or hopeless(now, sizes):
            return None
        if np.abs(now.jump).max() > limit.farthest:
            raise Fallen
        sizes.append(now.size)
        try:
            jump, level = now.correction(iterations < attempt.secant)
        except (linalg.LinAlgError, ValueError):  # singular, or not a number
            return None
        fraction = 1.0
        for _ in range(attempt.halvings + 1):
            tried = evaluate(now.jump + fraction * jump, now.level + fraction * level, now)
            if tried.size <= attempt.growth * now.size:
                break
            fraction /= 2
        now = tried
    return None


def hopeless(now: Iterate, sizes: list[float]) -> bool:
    """Whether an iterate has been there before, or its residual drifts along unchanged."""
    drifts = len(sizes) >= DRIFT and all(
        repeated(now.size, [size], STILL) for size in sizes[-DRIFT:]
    )
    return drifts or repeated(now.size, sizes, 1e-10)


def repeated(size: float, sizes: list[float], part: float) -> bool:
    """Whether a residual's size is one of earlier ones, but for a part of it."""
    return any(abs(size - earlier) <= part * size for earlier in sizes)
