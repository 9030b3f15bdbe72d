"""Newton's method with a line search that allows the residual to rise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array


class NotConverged(Exception):
    """A solution has ended without convergence; its text says by which criterion."""


class Diverged(NotConverged):
    """An iterate exceeds the displacement limit."""


@dataclass(frozen=True)
class Strategy:
    """How Newton's method is applied to a step."""

    #: how much the residual may grow before a correction is halved
    growth: float
    #: number of iterations with the law's secant stiffness in place of the tangent
    secant: int
    #: whether points that cross the release interval of their shear are placed inside it for one
    #: iteration: no (0), those that close (1), all (2)
    release: int
    iterations: int
    halvings: int
    #: number of iterations without a smaller residual after which the solution ends
    patience: float = np.inf


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


class Evaluate(Protocol):
    """What computes an iterate."""

    def __call__(
        self, jump: Array, level: float, last: Iterate | None, most: float = np.inf
    ) -> Iterate:
        """The iterate at a jump and a level, after another one or as the first; if its size exceeds
        the most, any with a size that does.
        """
        ...


@dataclass(frozen=True)
class Convergence:
    """When an iterate has converged, by one of two criteria: `tolerance`, norm of the residual up
    to a tolerance; `round-off`, not above what rounding alone makes of it.

    After a slip of a centimetre the terms of the residual are 1e9 times the loads and cancel; no
    iteration gets below a few times their rounding.
    """

    #: norm of the residual of the undamaged joints under the highest water [N]: what the
    #: residual is measured by
    reference: float
    #: [N]; parameter `tolerance` times the reference, 1e-9 by default: smaller ones are not
    #: reached, larger ones show in the resultants
    tolerance: float
    #: [N]; `rounding_ceiling` times the reference: a larger residual is never put down to rounding
    rounding_ceiling: float
    #: [-]; how many times the residual of unknowns rounded in the last bit it may be, a few
    round_off: float
    #: [m]; largest jump of an equilibrium of small displacements, beyond which a strategy has
    #: diverged
    largest_jump: float

    def reached(self, now: Iterate, before: float, evaluate: Evaluate) -> str:
        """The criterion by which an iterate has converged, empty if by none; before: norm of the
        residual one iteration ago.
        """
        if now.size <= self.tolerance:
            return BY_TOLERANCE
        if not FALLS * before < now.size <= self.rounding_ceiling:  # it still falls, or is large
            return ""
        return BY_ROUND_OFF if now.size <= self.round_off * rounding(now, evaluate) else ""


#: Criteria by which a solution ends.
BY_TOLERANCE, BY_ROUND_OFF = "tolerance", "round-off"

#: A residual below this part of the one before still falls, and is iterated further [-].
FALLS = 0.1

#: Relative change of the residual below which it stagnates [-]: something slides or falls. Ten
#: times larger ends solutions that still converge, slowly.
STAGNATION = 1e-6
#: Number of iterations over which it does.
STAGNATING_ITERATIONS = 4

#: Relative difference of residuals below which two iterates are the same [-], and Newton's method
#: has come back to one of them: above the rounding of a norm, far below any progress.
SAME = 1e-10

#: Numbers of iterations of the cycles into which Newton's method may run.
CYCLES = range(2, 7)
#: Relative difference of the residuals of one cycle and the next below which it stays there [-]: of
#: 6000 solutions of random scenes that converged, two had come so near to a cycle before.
CYCLE = 1e-3

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
) -> tuple[Iterate, int, str]:
    """The converged iterate, the number of iterations and the criterion.

    Raises NotConverged.

    A correction is halved only while it makes the residual grow more than strategy.growth times:
    while points open or break the residual has to rise, which a monotone line search prevents.
    """
    now, sizes = start, list[float]()
    while True:
        iterations = len(sizes)
        criterion = convergence.reached(now, sizes[-1] if sizes else np.inf, evaluate)
        if criterion:
            return now, iterations, criterion
        if end := stop_reason(now, sizes, strategy):
            raise NotConverged(end.format(now.size / (convergence.reference or 1.0)))
        if np.abs(now.jump).max() > convergence.largest_jump:
            raise Diverged(f"a displacement jump exceeds {convergence.largest_jump:.3g} m")
        sizes.append(now.size)
        try:
            jump, level = now.correction(iterations < strategy.secant)
        except (np.linalg.LinAlgError, ValueError):  # singular, or not a number
            raise NotConverged("the tangent is singular") from None
        fraction = 1.0
        most = strategy.growth * now.size
        for remaining in range(strategy.halvings, -1, -1):
            at = now.jump + fraction * jump, now.level + fraction * level
            new = evaluate(*at, now, most if remaining else np.inf)
            if new.size <= most:
                break
            fraction /= 2
        now = new


def stop_reason(now: Iterate, sizes: list[float], strategy: Strategy) -> str:
    """Why an iterate that has not converged is the last one; empty if it is not.

    sizes: norms of the residual before it.
    """
    if not np.isfinite(now.size):
        return "the residual is not a finite number"
    if repeats(now.size, sizes, SAME) or cycles([*sizes, now.size]):
        return "the iterates repeat, with a residual of {:.2g} of the loads"
    if len(sizes) >= STAGNATING_ITERATIONS and all(
        repeats(now.size, [size], STAGNATION) for size in sizes[-STAGNATING_ITERATIONS:]
    ):
        return "the residual stagnates at {:.2g} of the loads"
    all_sizes = [*sizes, now.size]
    since = len(sizes) - all_sizes.index(min(all_sizes))
    if since >= strategy.patience:
        return f"{since} iterations have not reduced the residual, {{:.2g}} of the loads"
    if len(sizes) == strategy.iterations:
        return f"after {len(sizes)} iterations the residual is {{:.2g}} of the loads"
    return ""


def cycles(sizes: list[float]) -> bool:
    """Whether the last residuals repeat those of a cycle before them, see CYCLES. Residuals that
    are all the same stagnate, see `stop_reason`.
    """
    return any(
        len(sizes) >= 2 * n
        and all(abs(sizes[-k] - sizes[-k - n]) <= CYCLE * sizes[-k] for k in range(1, n + 1))
        and max(sizes[-n:]) > (1 + 2 * CYCLE) * min(sizes[-n:])
        for n in CYCLES
    )


def repeats(size: float, sizes: list[float], tolerance: float) -> bool:
    """Whether a residual's norm is one of earlier ones, within a relative tolerance."""
    return any(abs(size - earlier) <= tolerance * size for earlier in sizes)
