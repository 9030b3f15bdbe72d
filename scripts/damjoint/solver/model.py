"""The stepping interface: `Model(case).start()`, then `advance` from state to state.

A state is immutable; any number of steps can start from it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from .. import RunError
from ..arrays import Array
from ..input.case import Case
from ..input.values import freezes_uplift
from ..joint.equilibrium import Equilibrium
from ..joint.flow_in_time import TimeStep
from ..joint.interface import Interface, interface_of
from ..joint.problem import JointProblem
from ..joint.water import BeforeQuake
from ..model.loads import COMPLETE, LEVEL, Loading
from ..model.network import with_paths
from .controls import Control, DisplacementControl, LevelControl, Prescribed
from .newton import BY_TOLERANCE, Convergence, NotConverged, Strategy
from .state import State, StepLaws
from .step import Plan, Start, solve

#: Largest jump of an equilibrium of small displacements, over the size of the dam [-]; usually
#: below 1e-2. Beyond it a strategy has diverged.
LARGEST_JUMP = 0.1

#: A step of the level is extrapolated from the two states before it where it is at most this many
#: times as long as the step between them [-]. Without the extrapolation all points begin elastic,
#: and Newton's method may not find the state in which many of them yield.
LONGEST_EXTRAPOLATION = 4
#: The same of a step of a displacement, along which the path is smoother.
LONGEST_ALONG_PATH = 16

#: Iterations after the smallest residual, over the most of a strategy [-], after which it is given
#: up. Of 6000 solutions of random scenes that converged, 17 had waited longer for a smaller one;
#: those that did not converge spent half of their time so.
PATIENCE = 0.4
#: The same of strategies that place points inside the release of their shear: they soon converge.
PATIENCE_OF_RELEASE = 0.25


@dataclass(frozen=True)
class StepResult:
    """A converged step."""

    state: State
    iterations: int
    #: norm of the residual over the reference
    residual: float
    #: of convergence, see `Convergence`
    criterion: str = BY_TOLERANCE


@dataclass(frozen=True)
class StepOptions:
    """How a step is solved."""

    #: those of the model by default; they are tried until one converges
    strategies: Sequence[Strategy] | None = None
    #: whether the first one starts from the last two states
    extrapolate: bool = False
    #: whether the others follow one that has diverged
    persist: bool = True
    #: jump (j,) and level to start from in place of those of the last state
    guess: tuple[Array, float] | None = None
    #: norm of the residual up to which it is solved [N], where that is larger than the tolerance
    rough: float = 0.0
    #: see `Plan`
    failures: Counter[Strategy] = field(default_factory=Counter)


@dataclass(frozen=True)
class Begun:
    """A step of a model from a state to a time, before it is solved."""

    model: Model
    state: State
    #: the same with the internal variables of the step's beginning
    start: State
    time: float
    laws: StepLaws
    before_quake: BeforeQuake | None
    #: of what is stored in the joints, see `Model.water_steps`
    steps: tuple[TimeStep, ...]
    #: whether the damage of the laws is frozen
    frozen: bool = False
    #: forces (j,) of the flowing water that do not follow the jumps
    constant_lift: Array | None = None

    @property
    def problem(self) -> JointProblem:
        """Its equation."""
        given = self.start.variables, self.before_quake, self.laws.points, self.steps
        problem = self.model.equilibrium.problem(*given)
        if self.constant_lift is None:
            return problem
        return problem.with_constant_lift(self.constant_lift)

    def solve(self, control: Control, options: StepOptions) -> StepResult | None:
        """Solve it by the first strategy that converges; None if none does."""
        model, state, time, tried = self.model, self.state, self.time, options.strategies
        starts = [
            Start(
                strategy,
                *(options.guess or self.predict(control, options.extrapolate and not n)),
            )
            for n, strategy in enumerate(model.strategies if tried is None else tried)
        ]
        convergence = model.convergence
        convergence = replace(convergence, tolerance=max(convergence.tolerance, options.rough))
        plan = Plan(starts, convergence, options.persist, options.failures)
        constraint = None
        if isinstance(control, DisplacementControl):
            constraint = Prescribed(control, model.equilibrium)
        loading = model.loading(time, state.loading.level)
        unknown = constraint.unknown if constraint else LEVEL
        if unknown != LEVEL:
            loading = replace(loading, level=model.case.level_at(time))
        try:
            solution = solve(self.problem, loading, plan, constraint)
        except NotConverged as error:
            model.end_of_solution = str(error)
            return None
        new = self.end(solution.jump, unknown.at(loading, solution.level))
        residual = solution.size / (model.reference or 1.0)
        new = new.after(state).traced(state, self.frozen, control)
        return StepResult(new, solution.iterations, residual, solution.criterion)

    @cached_property
    def closing(self) -> Array | None:
        """Jump (j,) by which each joint closes over what the saw takes off in the step, if it does:
        from the last state the whole joint would be open.
        """
        laws, joints = self.model.equilibrium.laws, self.model.equilibrium.interface.joints
        changes = laws.changes_of_thickness(self.state.variables, self.start.variables)
        if not any(changes):
            return None
        parts = (change * joint.unit_opening for change, joint in zip(changes, joints, strict=True))
        return np.asarray(sum(parts))

    def predict(self, control: Control, extrapolate: bool) -> tuple[Array, float]:
        """See `Model.predict`; a joint that is sawn closes."""
        extrapolate &= self.closing is None
        jump, level = self.model.predict(self.state, self.time, control, extrapolate)
        return jump if self.closing is None else jump + self.closing, level

    def end(self, jump: Array, loading: Loading) -> State:
        """The state at its end, with a jump (j,)."""
        model, equilibrium = self.model, self.model.equilibrium
        given = self.start.variables, self.before_quake, self.steps
        water = equilibrium.water_in_step(*given)
        return replace(
            self.start.update(equilibrium.interface, self.laws, jump),
            time=self.time,
            loading=loading,
            pressures=water.pressures(jump, loading),
            before_quake=self.before_quake,
            stored=water.stored(jump, loading, self.time) if model.in_time else (),
        )


class Model:
    """The equilibrium of a case, and how a step of it is solved."""

    def __init__(self, case: Case, interface: Interface | None = None) -> None:
        """interface: the joints of the condensed bodies; by default from the cache, or made."""
        interface = interface or interface_of(case)
        if case.geometry:
            case = case.with_joints(interface.of_joints)
            case = with_paths(case, [joint.mesh for joint in interface.joints])
        self.case, self.equilibrium = case, Equilibrium(case, interface)
        self.reference = self.unbalanced()
        #: by which criterion the last solution ended that has not converged
        self.end_of_solution = ""

    def with_case(self, case: Case) -> Model:
        """The same for another case that differs in its levels and times, or in values that the
        equilibrium does not depend on.
        """
        if case is self.case:
            return self
        other = self.sharing(case, self.equilibrium)
        other.reference = other.unbalanced()
        return other

    def sharing(self, case: Case, equilibrium: Equilibrium) -> Model:
        """A model of another case and equilibrium, whose convergence is measured as here."""
        other = object.__new__(Model)
        other.case, other.equilibrium, other.reference = case, equilibrium, self.reference
        other.end_of_solution = ""
        return other

    def unbalanced(self) -> float:
        """Norm of the residual of the undamaged joint under the highest water: what convergence is
        measured by.
        """
        start, case = self.start(), self.case
        highest = replace(COMPLETE, level=max(case.levels), tail=max(case.tail_levels))
        problem = self.equilibrium.problem(start.variables)
        size = float(np.linalg.norm(problem.residual(start.jump, highest).value))
        if not np.isfinite(size):
            raise RunError("loads: are not finite numbers; look at densities, levels and gravity")
        return size

    @cached_property
    def strategies(self) -> tuple[Strategy, ...]:
        """The strategies for a step, in order; the last one, with many secant iterations, is the
        fallback of a step that can be cut no more.
        """
        parts = ("growth", "secant", "release", "iterations")
        table = zip(*(self.case.shared[f"strategy_{n}"] for n in parts), strict=True)
        halvings = int(self.case["max_halvings"])
        return tuple(
            Strategy(
                growth,
                int(secant),
                int(release),
                int(iterations),
                halvings,
                (PATIENCE_OF_RELEASE if release else PATIENCE) * iterations,
            )
            for growth, secant, release, iterations in table
            if not release or self.equilibrium.laws.releases_shear
        )

    @property
    def release_strategies(self) -> list[Strategy]:
        """Those after the first one that place points inside the release of their shear."""
        return [strategy for strategy in self.strategies[1:] if strategy.release]

    @property
    def convergence(self) -> Convergence:
        """When a step has converged."""
        shared, reference = self.case.shared, self.reference
        return Convergence(
            reference=reference,
            tolerance=self.case["tolerance"] * reference,
            rounding_ceiling=shared["rounding_ceiling"][0] * reference,
            round_off=shared["round_off"][0],
            largest_jump=LARGEST_JUMP * self.case.size,
        )

    def start(self) -> State:
        """The state before any load."""
        return State.undamaged(self.equilibrium)

    def loading(self, time: float, level: float) -> Loading:
        """The loads of a time, at a level [m]."""
        return Loading.at(self.case, time, level, self.case.tail_at(time))

    @property
    def in_time(self) -> bool:
        """Whether water that flows is stored in the joints."""
        return bool(self.equilibrium.flowing) and self.case.stores_water

    def water_steps(self, state: State, time: float) -> tuple[TimeStep, ...]:
        """The steps of what is stored in the joints from a state to a time; empty if the flow is
        steady: always, or as long as no time passes. A further step to the time of a state, on a
        path, repeats the step that has led to that state.
        """
        if not self.in_time:
            return ()
        steps = list[TimeStep]()
        for number, system in enumerate(self.equilibrium.flowing):
            if state.stored:
                begin = state.stored[number]
            else:
                begin = system.stored_at(state.jump, state.variables, state.loading, state.time)
            if time <= begin.time and begin.begin:
                begin = begin.begin
            start = max(begin.time, self.case["time_start"])
            seconds = (time - start) * self.case["time_unit"]
            if seconds <= 0:
                return ()
            steps.append(TimeStep(seconds=seconds, begin=begin))
        return tuple(steps)

    def before_quake(self, state: State, time: float) -> BeforeQuake | None:
        """The joints before the earthquake, for a step from a state to a time, if the water in one
        of them follows from that.
        """
        if not any(map(freezes_uplift, self.case.joints)) or not self.loading(time, 0.0).part(
            "quake"
        ):
            return None
        return state.before_quake or BeforeQuake(state.jump, state.variables)

    def begin(self, state: State, time: float, frozen: StepLaws | None = None) -> Begun:
        """A step from a state to a time; frozen: the laws with frozen damage."""
        laws = self.equilibrium.laws
        return Begun(
            model=self,
            state=state,
            start=state.begin_step(laws, time),
            time=time,
            laws=frozen or StepLaws(laws, laws),
            before_quake=self.before_quake(state, time),
            steps=self.water_steps(state, time),
            frozen=frozen is not None,
        )

    def advance(
        self, state: State, time: float, control: Control, options: StepOptions | None = None
    ) -> StepResult | None:
        """A step from a state to a time; None if no strategy converges."""
        return self.begin(state, time).solve(control, options or StepOptions())

    def damage_between(self, begin: State, end: State) -> float:
        """The largest mean difference of the damage of a joint in two states [-]."""
        laws, interface = self.equilibrium.laws, self.equilibrium.interface
        jumps = (interface.jumps(interface.at_points, state.jump) for state in (begin, end))
        before, after = (
            laws.damage(jump, state.variables)
            for jump, state in zip(jumps, (begin, end), strict=True)
        )
        parts = end.variables.split(interface.weights * np.abs(after - before))
        lengths = end.variables.split(interface.weights)
        return max(float(part.sum() / own.sum()) for part, own in zip(parts, lengths, strict=True))

    def advance_by_first(self, state: State, time: float, control: Control) -> StepResult | None:
        """A step by the first strategy only, from the extrapolation of the last two states."""
        first = self.strategies[:1]
        return self.advance(state, time, control, StepOptions(first, extrapolate=True))

    def advance_along(self, state: State, time: float, control: Control) -> StepResult | None:
        """`advance_by_first`, also by the strategies that place points inside the release of their
        shear.
        """
        strategies = [self.strategies[0], *self.release_strategies]
        return self.advance(state, time, control, StepOptions(strategies, extrapolate=True))

    def predict(
        self, state: State, time: float, control: Control, extrapolate: bool
    ) -> tuple[Array, float]:
        """Jump, and level or what else is unknown, where Newton's method starts: the last state's,
        or extrapolated where the loading continues in the same direction.
        """
        unknown = LEVEL if isinstance(control, LevelControl) else control.unknown
        level, before = unknown.of(state.loading), state.previous
        prescribed = control.level if isinstance(control, LevelControl) else None
        if extrapolate and before and before.time > 0:
            if self.case["drive"] != "level":
                new, now, old = time, state.time, before.time
            elif isinstance(control, LevelControl):
                new, now, old = control.level, level, before.loading.level
            else:
                new, (now, old) = control.value, (self.measure(control, s) for s in (state, before))
            ahead = (new - now) / (now - old) if now != old else 0.0
            longest = LONGEST_ALONG_PATH if prescribed is None else LONGEST_EXTRAPOLATION
            if 0 < ahead < longest:
                jump = state.jump + ahead * (state.jump - before.jump)
                rise = level - unknown.of(before.loading)
                return jump, level + ahead * rise if prescribed is None else prescribed
        return state.jump, level if prescribed is None else prescribed

    def measure(self, control: DisplacementControl, state: State) -> float:
        """The displacement of a control in a state [m]."""
        return control.measure(self.equilibrium, state.jump, state.loading)
