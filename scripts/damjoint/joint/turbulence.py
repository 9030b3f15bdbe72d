"""Turbulent flow between parallel plates.

With the mean velocity v = q / w, the hydraulic diameter 2 w and Re = 2 rho q / visc, the gradient
of the pressure is f rho v^2 / (4 w), the friction factor f the larger of 96 / Re (the cubic law)
and 0.316 Re^-1/4 [Blasius 1913]: they are equal at Re = 2041. With R the Reynolds number of the
cubic law, the flux is that of the cubic law times (2041 / R)^(3/7) where R > 2041.

The flow is solved by secant conductivities: the flux of the last iterate over its gradient. That
converges by a factor of 3/7 or less, and faster by Anderson's extrapolation [J. ACM 12, 1965].
In a level joint in 2D, where water is stored, the iterations after the first one are Newton's: the
flux is linear about that of the last iterate, and the voids are those of this linear flow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..arrays import Array, BoolArray
from .flow import FlowSolution, FlowSystem

#: Reynolds number at which the two friction factors are equal [-].
CRITICAL = (96 / 0.316) ** (4 / 3)
#: Exponent of the flux with the gradient, and with the aperture cubed, of turbulent flow [-].
EXPONENT = 4 / 7
#: Change of the logarithm of a conductivity in an iteration, at convergence [-].
TOLERANCE = 1e-11
#: The same of Newton's iterations, which square it.
NEWTON_TOLERANCE = 1e-7
#: Iterations at most; usually about ten. Of these by Newton's method; usually two.
ITERATIONS, NEWTON_ITERATIONS = 100, 8
#: Differences that the extrapolation uses.
DEPTH = 4


def slowed(gradients: list[Array], per_gradient: Array) -> Array:
    """The flux over that of the cubic law (q,), for gradients of the head times the water's weight
    along several axes (q,) and the Reynolds numbers of the cubic law per gradient (q,).
    """
    number = per_gradient * np.sqrt(sum(g**2 for g in gradients))
    return np.asarray((CRITICAL / np.maximum(number, CRITICAL)) ** (1 - EXPONENT))


def turbulent_flow(
    solve: Callable[[Array], FlowSolution],
    conductivity: Array,
    per_gradient: Array,
    guess: Array | None,
    solve_linear: Callable[[Array, list[Array]], FlowSolution] | None = None,
) -> tuple[FlowSolution, Array]:
    """The solution, and the flux over that of the cubic law (q,).

    solve: the flow of conductivities (q,), as in `FlowSystem.inverse_of`; conductivity: those of
    the cubic law; guess: of that ratio, on which the result does not depend; solve_linear: the flow
    of conductivities and a flux (q,) along the axes of the gradients; None: no Newton's method.
    nan if it does not converge.
    """
    log = np.zeros(len(conductivity)) if guess is None else np.log(guess)
    before: list[tuple[Array, Array]] = []
    for number in range(ITERATIONS):
        share = np.exp(log)
        solution = solve(conductivity * share)
        if not solution.systems:
            return solution, np.ones(len(log))
        (system,) = solution.systems
        new = slowed(system.gradients, per_gradient)
        change = np.log(new) - log
        if not np.isfinite(change).all():
            break
        if number == 0 and solve_linear and np.abs(change).max() >= TOLERANCE:
            found = by_newton(solve_linear, conductivity, per_gradient, system.gradients)
            if found:
                return found
        if np.abs(change).max() < TOLERANCE:
            if (new < 1).any():
                system = with_tangent(system, conductivity, share, new < 1)
            return replace(solution, systems=[system]), share
        before = [*before[-DEPTH:], (log, change)]
        log = np.minimum(extrapolated(before), 0)
    nothing = np.full(len(solution.pressure), np.nan)
    return replace(solution, pressure=nothing, systems=[]), np.ones(len(log))


def by_newton(
    solve_linear: Callable[[Array, list[Array]], FlowSolution],
    conductivity: Array,
    per_gradient: Array,
    gradients: list[Array],
) -> tuple[FlowSolution, Array] | None:
    """As `turbulent_flow` by Newton's method from gradients; None if it does not converge."""
    share = slowed(gradients, per_gradient)
    for _ in range(NEWTON_ITERATIONS):
        tangent = np.where(share < 1, EXPONENT * share, 1)
        beyond = conductivity * (tangent - share)  # of the flux, against the gradient
        solution = solve_linear(conductivity * tangent, [beyond * g for g in gradients])
        if not solution.systems:
            return None
        (system,) = solution.systems
        new = slowed(system.gradients, per_gradient)
        change = np.abs(np.log(new) - np.log(share)).max()
        if change < NEWTON_TOLERANCE:
            turbulent = (share < 1).any()
            system = replace(system, slowed=tangent) if turbulent else system
            return replace(solution, systems=[system]), new
        if not np.isfinite(change):
            return None
        share, gradients = new, system.gradients
    return None


def with_tangent(
    system: FlowSystem, conductivity: Array, share: Array, turbulent: BoolArray
) -> FlowSystem:
    """The system with the derivatives of flow that is turbulent at some points (q,), see
    `turbulent_flow`; their matrix is computed only where a tangent is.
    """
    tangent, inverse_of = np.where(turbulent, EXPONENT * share, 1), system.inverse_of
    assert inverse_of

    def inverse(coupling: Array) -> Array:
        return inverse_of(conductivity * share, conductivity * tangent)(coupling)

    return replace(system, inverse=inverse, slowed=tangent)


def extrapolated(before: list[tuple[Array, Array]]) -> Array:
    """The next iterate, from the last ones and their changes."""
    log, change = before[-1]
    if len(before) < 2:
        return log + change
    logs, changes = (np.diff([pair[k] for pair in before], axis=0) for k in (0, 1))
    shares = np.linalg.lstsq(changes.T, change, rcond=1e-10)[0]
    return np.asarray(log + change - shares @ (logs + changes))
