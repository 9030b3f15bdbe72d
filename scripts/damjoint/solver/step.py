"""A step solved by Newton's method: one strategy after the other, with the level prescribed or,
under displacement control, it or the factor of a load unknown. At rest and in motion alike.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ..arrays import Array
from ..joint.linear_system import Border
from ..joint.problem import JointProblem, Residual
from ..model.loads import LEVEL, Loading, Unknown
from .newton import Convergence, Diverged, Iterate, NotConverged, Strategy, newton

#: How often one after the other a strategy does not converge, after which it is not tried where
#: there are other ways. Of 155 random dams those that had failed so often took 10 % of the time, of
#: the slowest a third.
MOST_FAILURES = 3


class Constraint(Protocol):
    """A displacement that is prescribed in place of the level or of the factor of a load."""

    #: [N/m]; weight of its gap in the norm of the residual
    stiffness: float
    #: what is unknown, and between which values
    unknown: Unknown
    between: tuple[float, float]

    def gap(self, jump: Array, loading: Loading) -> float:
        """What is missing at a jump (j,) [m]."""
        ...

    def row(self, jump: Array) -> Array:
        """Its derivative with the jump (j,)."""
        ...

    def rate(self, loading: Loading) -> float:
        """Its derivative with what is unknown."""
        ...


@dataclass(frozen=True)
class Start:
    """A strategy, and where it starts: the jump (j,), and the level or what else is unknown."""

    strategy: Strategy
    jump: Array
    level: float
    #: there, where it is known
    residual: Residual | None = None


@dataclass(frozen=True)
class Plan:
    """How a step is solved."""

    #: tried in turn, until one converges
    starts: Sequence[Start]
    convergence: Convergence
    #: whether the others follow one that has diverged
    persist: bool = True
    #: how often one after the other each strategy has not converged; brought up to date
    failures: Counter[Strategy] = field(default_factory=Counter)


@dataclass(frozen=True)
class Solution:
    """The jump (j,), and the level or what else is unknown, of a converged step."""

    jump: Array
    level: float
    iterations: int
    #: norm of the residual [N], and the criterion of convergence
    size: float
    criterion: str


def not_given_up(strategies: Sequence[Strategy], failures: Counter[Strategy]) -> list[Strategy]:
    """The strategies that have not failed MOST_FAILURES times, see `Plan`."""
    return [strategy for strategy in strategies if failures[strategy] < MOST_FAILURES]


def solve(
    problem: JointProblem, loading: Loading, plan: Plan, constraint: Constraint | None = None
) -> Solution:
    """Solve a step from the first start that leads to convergence.

    loading: at the end of the step, but for the level, which the start says, or, with a constraint,
    what is unknown. Raises NotConverged, for the last start, if none does.
    """
    end = NotConverged("there is no strategy")
    for begin in plan.starts:
        try:
            solution = solve_from(problem, loading, begin, plan.convergence, constraint)
        except NotConverged as error:
            end = error
            plan.failures[begin.strategy] += 1
            if isinstance(error, Diverged) and not plan.persist:
                break
        else:
            plan.failures[begin.strategy] = 0
            return solution
    raise end


def solve_from(
    problem: JointProblem,
    loading: Loading,
    begin: Start,
    convergence: Convergence,
    constraint: Constraint | None,
) -> Solution:
    """From one start, see `solve`. Raises NotConverged."""
    strategy = begin.strategy
    unknown = constraint.unknown if constraint else LEVEL

    def evaluate(jump: Array, level: float, last: Iterate | None, most: float = np.inf) -> Iterate:
        side = releasing = None
        if strategy.release:
            side = problem.laws.release_side(problem.jumps(jump), problem.variables)
            if last and last.side is not None:
                crossing = side * last.side < 0
                releasing = crossing & ((side < 0) | (strategy.release > 1))
                side = np.where(releasing, 0, side)
        here = unknown.at(loading, level)
        known = begin.residual if last is None and jump is begin.jump else None
        residual = known or problem.residual(jump, here, releasing, most)
        size, gap = float(np.linalg.norm(residual.value)), 0.0
        if constraint:
            gap = constraint.gap(jump, here)
            size = float(np.hypot(size, constraint.stiffness * gap))

        def correction(secant: bool) -> tuple[Array, float]:
            border = None
            if constraint:
                rate = constraint.rate(here)
                row = constraint.row(jump)
                border = Border(residual.by_unknown(unknown), row, rate, gap)
            return problem.system.solve(residual.by_jump(secant), -residual.value, border)

        return Iterate(jump, level, residual.value, size, correction, side)

    with np.errstate(over="ignore", invalid="ignore"):  # a diverging iterate is discarded
        first = evaluate(begin.jump, begin.level, None)
        end, iterations, criterion = newton(evaluate, first, convergence, strategy)
    if np.abs(end.jump).max() > convergence.largest_jump:
        raise Diverged(f"a displacement jump exceeds {convergence.largest_jump:.3g} m")
    if constraint:
        least, most = constraint.between
        if not least <= end.level <= most:
            raise NotConverged(f"the displacement needs a level of {end.level:.6g} m")
    return Solution(end.jump, end.level, iterations, end.size, criterion)
