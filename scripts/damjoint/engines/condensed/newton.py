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
    """An iterate: jump and level, size of the residual, and its correction (jump, level)."""

    jump: np.ndarray
    level: float
    size: float
    correction: Callable[[], tuple[np.ndarray, float]]


def newton(
    evaluate: Callable[[np.ndarray, float], Iterate], start: Iterate, limit: float, attempt: Attempt
) -> tuple[Iterate, int] | None:
    """
    The iterate whose residual is at most `limit`, and the number of iterations; None if it is not
    found.

    A correction is halved only while it makes the residual grow more than attempt.growth times:
    while points open or break the residual has to rise, and a monotone line search would creep
    there.
    """
    now, sizes = start, []
    for iterations in range(attempt.iterations + 1):
        if now.size <= limit:
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
