"""Unstable crack growth at constant load: the state after it, where the law is in equilibrium."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..arrays import Array
from .controls import Control, LevelControl
from .model import Begun, Model, StepOptions, StepResult
from .newton import Strategy, repeats
from .state import State
from .step import not_given_up

#: Most rounds of the alternate minimisation; usually fewer than 70. Then the last state is returned
#: as one in which the law is not in equilibrium.
ROUNDS = 100

#: Residual of the law at the relaxed state, over the loads, above which Newton's method is not
#: tried from there without placing points in the release of their shear [-]. Of 132 random dams and
#: 25 cases, what converged had begun below 0.3, and nothing above 1.
FAR = 1.0

#: Relative difference of the residuals of two rounds below which they have led to the same state
#: [-]. The rounds then repeat themselves, and end without a state.
SAME = 1e-6

#: Residual up to which a round is solved, over that of the law after the last one [-]: the next one
#: continues from its end. With ten times less the crest of e with E_dam = 21 GPa is 1e-9 beside
#: that of rounds solved to the tolerance, with this 4e-8, with ten times more 2e-7.
ROUGH = 1e-4

#: Ratio of the residuals of two rounds up to which the next one begins where they lead on to [-].
#: Where the residual grows by more a further part of the joint breaks, and another movement begins.
MOST_GROWTH = 1.5

#: The residuals of the rounds fall steadily if their last ratios differ by less than this part of
#: the last one [-]: then the same points soften or slide in all of them, and the state to which
#: they lead is known.
STEADY = 0.01
#: Number of these ratios.
RATIOS = 3
#: How far an equilibrium of the law may be beside that state, over the distance to it [-].
BESIDE = 0.1


def relax(
    model: Model,
    begin: State,
    time: float,
    control: Control,
    failures: Counter[Strategy] | None = None,
) -> tuple[StepResult, bool] | None:
    """The state after unstable crack growth by alternate minimisation, and whether the law is in
    equilibrium there; None if there is none. The step is solved with frozen damage, then the damage
    is updated, until the law is in equilibrium or after ROUNDS of them.

    Where the flow cannot be solved for together with the jump its pressure is frozen, too. The
    relaxed state is more damaged than a direct step would give. failures: of the strategies with
    frozen damage, see `Plan`; None: all are tried.
    """
    equilibrium, state = model.equilibrium, begin
    laws, iterations, sizes = equilibrium.laws, 0, list[float]()
    relaxed: StepResult | None = None
    moved = np.zeros_like(begin.jump)  # in the last round
    before_quake = model.before_quake(begin, time)
    strategies = [strategy for strategy in model.strategies[:-1] if not strategy.release]
    if failures is None:
        failures = Counter()
    else:
        strategies[1:] = not_given_up(strategies[1:], failures)
    steps = model.water_steps(begin, time)
    since = 0  # the round from which on the residuals may be steady
    for _ in range(ROUNDS):
        start = state.begin_step(laws, time)
        frozen = start.freeze(equilibrium)
        coupled = strategies[:1] if equilibrium.flowing else strategies
        begun = model.begin(start, time, frozen)
        step, rough = None, ROUGH * sizes[-1] if sizes else 0.0
        if steady(sizes[since:]):
            since, ratio = len(sizes), sizes[-1] / sizes[-2]
            ahead = ratio / (1 - ratio) * moved
            step = equilibrium_ahead(model.begin(start, time), control, strategies[0], ahead)
        if step is None and len(sizes) > 1 and sizes[-1] < MOST_GROWTH * sizes[-2]:
            # from where the last round leads on to: at its own end all slip and contact would begin
            # elastic, and yield again one after the other
            last, level = begun.predict(control, extrapolate=False)
            guess = last + sizes[-1] / sizes[-2] * moved, level
            options = StepOptions(strategies[:1], persist=False, guess=guess, rough=rough)
            step = begun.solve(control, options)
        options = StepOptions(coupled, persist=False, rough=rough, failures=failures)
        step = step or begun.solve(control, options)
        if step is None and equilibrium.flowing:
            level = control.level if isinstance(control, LevelControl) else start.loading.level
            opened = before_quake or start
            water = equilibrium.water_in_step(opened.variables, steps=steps)
            lift = water.flow(opened.jump, model.loading(time, level)).lift
            begun = replace(begun, constant_lift=lift)
            options = replace(options, strategies=strategies)
            step = begun.solve(control, options)
        if step is None:
            return None
        iterations += step.iterations
        moved = step.state.jump - state.jump
        state = replace(step.state, time=begin.time, stored=begin.stored)
        jump, variables = state.jump, state.begin_step(laws, time).variables
        problem = equilibrium.problem(variables, before_quake, steps=steps)
        size = float(np.linalg.norm(problem.residual(jump, state.loading).value))
        if size <= model.convergence.tolerance:
            water = equilibrium.water_in_step(variables, before_quake, steps)
            pressures = water.pressures(jump, state.loading)
            balanced = replace(step.state, pressures=pressures).after(begin)
            return StepResult(balanced, iterations, size / (model.reference or 1.0)), True
        if repeats(size, sizes, SAME):
            return None
        sizes.append(size)
        relaxed = replace(step, iterations=iterations)
    return (relaxed, False) if relaxed else None


def steady(sizes: Sequence[float]) -> bool:
    """Whether the residuals of the last rounds fall by the same factor."""
    ratios = np.divide(sizes[1:], sizes[:-1])[-RATIOS:]
    return bool(
        len(ratios) == RATIOS and ratios.max() < 1 and np.ptp(ratios) <= STEADY * ratios[-1]
    )


def equilibrium_ahead(
    begun: Begun, control: Control, strategy: Strategy, ahead: Array
) -> StepResult | None:
    """The equilibrium of the law itself at which rounds end that fall steadily, a movement (j,)
    ahead; None if there is none beside it.
    """
    last, level = begun.predict(control, extrapolate=False)
    end = last + ahead
    step = begun.solve(control, StepOptions([strategy], guess=(end, level)))
    if step and np.abs(step.state.jump - end).max() <= BESIDE * np.abs(ahead).max():
        return step
    return None


def over_unstable_growth(
    model: Model,
    begin: State,
    time: float,
    control: Control,
    accept_relaxed: bool,
    failures: Counter[Strategy] | None = None,
    frozen_failures: Counter[Strategy] | None = None,
) -> tuple[StepResult | None, bool]:
    """A step over unstable crack growth, and whether it is the relaxed state: by Newton's method
    from that state, by the law from the last one; where it does not converge and `accept_relaxed`,
    the relaxed state itself, if the law is in equilibrium there. failures: see `Plan`;
    frozen_failures: see `relax`.
    """
    end = relax(model, begin, time, control, frozen_failures)
    if end is None:
        return None, False
    relaxed, balanced = end
    begun, jump, loading = model.begin(begin, time), relaxed.state.jump, relaxed.state.loading
    size = float(np.linalg.norm(begun.problem.residual(jump, loading).value))
    direct = model.strategies[:1] if size <= FAR * model.reference else []
    accepted, release = accept_relaxed and balanced, model.release_strategies
    failures = Counter() if failures is None else failures
    strategies = [*direct, *(not_given_up(release, failures) if accepted else release)]
    options = StepOptions(strategies, persist=False, guess=(jump, loading.level), failures=failures)
    step = begun.solve(control, options)
    if step:
        return replace(step, iterations=relaxed.iterations + step.iterations), False
    return (relaxed, True) if accepted else (None, False)
