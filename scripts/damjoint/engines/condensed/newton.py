"""Newton's method with a line search that lets the residual rise for a moment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import linalg


@dataclass(frozen=True)
class Attempt:
    """One way of trying a step."""

    #: how much the residual may grow before a correction is halved
    growth: float
    #: whether the law's secant stiffness takes the place of the tangent
    secant: bool
    iterations: int
    halvings: int


@dataclass
class Iterate:
    """An iterate: jump and level, residual and its size, and its correction (jump, level)."""

    jump: np.ndarray
    level: float
    residual: np.ndarray
    size: float
    correction: Callable[[], tuple[np.ndarray, float]]


#: The iterate at a jump and a level.
Evaluate = Callable[[np.ndarray, float], Iterate]


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

    def met(self, now: Iterate, before: float, evaluate: Evaluate) -> bool:
        """Whether an iterate has converged; before: size of the residual one iteration ago."""
        if now.size <= self.size:
            return True
        if not 0.1 * before < now.size <= self.coarsest:  # it still falls, or is too large
            return False
        return now.size <= self.round_off * noise(now, evaluate)


#: x rounded to 43 of its 53 bits is x (2^10 + 1) - (x (2^10 + 1) - x): Veltkamp's splitting.
SPLITTER = 2.0**10


def noise(now: Iterate, evaluate: Evaluate) -> float:
    """The norm of the residual's change when the last bit of every unknown is rounded away."""
    larger = now.jump * (SPLITTER + 1)
    rounded = larger - (larger - now.jump)
    return np.linalg.norm(evaluate(rounded, now.level).residual - now.residual) / SPLITTER


def newton(
    evaluate: Evaluate, start: Iterate, limit: Limit, attempt: Attempt
) -> tuple[Iterate, int] | None:
    """The iterate that meets the limit, and the number of iterations; None if it is not found.

    A correction is halved only while it makes the residual grow more than attempt.growth times:
    while points open or break the residual has to rise, and a monotone line search would creep
    there.
    """
    now, sizes = start, []
    for iterations in range(attempt.iterations + 1):
        if limit.met(now, sizes[-1] if sizes else np.inf, evaluate):
            return now, iterations
        circle = any(abs(now.size - other) <= 1e-10 * now.size for other in sizes)
        if circle or not np.isfinite(now.size) or iterations == attempt.iterations:
            return None
        sizes.append(now.size)
        try:
            jump, level = now.correction()
        except (linalg.LinAlgError, ValueError):  # singular, or not a number
            return None
        fraction = 1.0
        for _ in range(attempt.halvings + 1):
            tried = evaluate(now.jump + fraction * jump, now.level + fraction * level)
            if tried.size <= attempt.growth * now.size:
                break
            fraction /= 2
        now = tried
    return None
