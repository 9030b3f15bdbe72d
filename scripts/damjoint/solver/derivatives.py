"""Derivatives of the states of a case with its parameters, by direct differentiation of its steps.

A converged step solves R(d, h; v, p) = 0 for the jumps d, at a level h, or with h unknown and a
displacement prescribed, u(d, h; p) = const; v: internal variables, pressures and stored water of
the state before, p: a parameter. Its derivative solves the same linear system

    K d' + R_h h' = -(R_p + R_v v'),    u_d d' + u_h h' = -u_p,

with the tangent K of the last iteration, and goes on from step to step with the state [Tsay and
Arora 1990; Kleiber et al. 1997]. The right side and v' are central differences along (v', 1) in
(v, p), of functions that are evaluated and not solved. Where K is not exactly the derivative of R,
as at open points, a second correction follows; its size shows a kink.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .. import InputError, RunError
from ..arrays import Array
from ..input.case import Case
from ..input.parameters import parameter
from ..input.resolve import varied
from ..joint.linear_system import Border
from ..model.loads import LEVEL, Loading
from ..model.results import history_table
from .controls import DisplacementControl, Prescribed
from .history import History
from .model import Begun, Model, StepResult
from .state import State, Trace

#: Half of the difference of a parameter, over its value [-]; of one that is zero in its unit, and
#: in these units.
DIFFERENCE = 1e-5
ZERO = {"Pa": 1.0, "Pa per m": 1e5, "N per m": 1e-1, "kg per m3": 1e-2}

#: Corrections of a derivative, and the last one over the derivative beyond which a point of the
#: joint is at a kink: about to open, to slip or to break [-].
CORRECTIONS, KINK = 3, 1e-5

#: Groups of parameters on which the mesh or the way to the solution depends.
NOT_CONTINUOUS = "Mesh", "Solver", "Geometry"


@dataclass(frozen=True)
class Side:
    """The model with a parameter on one side of its value, and its state."""

    model: Model
    state: State
    #: that under the weight alone, if displacements count from it
    at_rest: State | None = None


@dataclass(frozen=True)
class Derivative:
    """Of a state with a parameter: states on both sides, their distance, whether at a kink."""

    low: Side
    high: Side
    distance: float
    kink: bool

    def of(self, low: float, high: float) -> float:
        """Of a quantity, by its values on both sides."""
        return (high - low) / self.distance

    @property
    def level(self) -> float:
        """Of the level, where a displacement is prescribed [m over the unit]."""
        return self.of(self.low.state.loading.level, self.high.state.loading.level)

    def row(self) -> dict[str, float]:
        """Of the columns of history.csv."""
        low, high = (history_row(side) for side in (self.low, self.high))
        return {name: self.of(low[name], high[name]) for name in low}


def history_row(side: Side) -> dict[str, float]:
    """The row of history.csv of a state."""
    history = History(side.model.equilibrium, at_rest=side.at_rest)
    history.add(StepResult(side.state, 0, 0.0), 0)
    rows = {name: np.array(values, float) for name, values in history.rows.items()}
    table = history_table(side.model.case, rows)
    return {name: float(column[-1]) for name, column in table.items()}


def half_difference(case: Case, name: str) -> tuple[float, float, float]:
    """The value of a parameter, and those on both sides of it: the value itself where the
    parameter allows none beyond it.

    Raises InputError if a parameter has no derivative.
    """
    joint, _, of_joint = name.rpartition(".")
    known = parameter(of_joint)
    if known.text or known.choices or known.integer or known.group in NOT_CONTINUOUS:
        raise InputError(
            f"--sensitivity {name}: must be a parameter that is a number, and neither of geometry, "
            "mesh nor solver"
        )
    names = list(case.joint_names)
    if joint and joint not in names:
        raise InputError(f"--sensitivity {name}: must be of a joint: {', '.join(names)}")
    if not joint and known.of_joints and len({j[of_joint] for j in case.joints}) > 1:
        raise InputError(
            f"--sensitivity {name}: differs between the joints; must be of one: "
            f"{names[0]}.{of_joint}"
        )
    value = float(case.joints[names.index(joint) if joint else 0][of_joint])
    half = DIFFERENCE * abs(value) or ZERO.get(known.unit, 1e-5)
    low, high = value - half, value + half
    low, high = (end if known.allows(end) else value for end in (low, high))
    if low == high:
        raise InputError(
            f"--sensitivity {name}: has the value {value:g}, which follows from others"
        )
    return value, low, high


class Differentiation:
    """The derivatives of the states of a case along the updates that have led to one of them."""

    def __init__(self, model: Model, name: str) -> None:
        """name: of a parameter, or of one of a joint, "lift 25 m.mu". Raises InputError."""
        _, low, high = half_difference(model.case, name)
        self.model, self.distance = model, high - low
        self.models = [self.model_with(name, value) for value in (low, high)]
        self.kink = False

    def model_with(self, name: str, value: float) -> Model:
        """The model with a value."""
        case = varied(self.model.case, {name: value})
        case = replace(case, levels=self.model.case.levels, tail_levels=self.model.case.tail_levels)
        return Model(replace(case, times=self.model.case.times))

    def along(self, updates: Sequence[Trace]) -> list[Derivative]:
        """The derivative of each state of a path.

        Raises RunError if one of them was reached by relaxation with frozen damage.
        """
        state, results = self.model.start(), list[Derivative]()
        low, high = (Side(model, model.start()) for model in self.models)
        for update in updates:
            if update.frozen:
                raise RunError(
                    f"sensitivity: the crack has grown unstably at level "
                    f"{update.state.loading.level:.6g} m; the state after it has no derivative"
                )
            low, high = self.step(state, update, low, high)
            state = update.state
            if state.time == 0 and self.model.case["weight_first"]:
                low, high = (replace(side, at_rest=side.state) for side in (low, high))
            results.append(Derivative(low, high, self.distance, self.kink))
        return results

    def step(self, state: State, update: Trace, low: Side, high: Side) -> tuple[Side, Side]:
        """The states on both sides at the end of a step."""
        end, sides = update.state, (low, high)
        time, jump = end.time, end.jump
        begun = [side.model.begin(side.state, time) for side in sides]
        problems = [step.problem for step in begun]
        control = update.control if isinstance(update.control, DisplacementControl) else None
        unknown = control.unknown if control else LEVEL
        level, value = end.loading.level, unknown.of(end.loading)
        problem = self.model.begin(state, time).problem
        here = problem.residual(jump, end.loading)
        tangent, slope = here.by_jump(False), here.by_unknown(unknown) if control else None
        rate, level_rate = np.zeros(len(jump)), 0.0
        half = self.distance / 2
        for number in range(CORRECTIONS):
            jumps = [jump - half * rate, jump + half * rate]
            loadings = [
                unknown.at(step.model.loading(time, level), value + sign * half * level_rate)
                for step, sign in zip(begun, (-1, 1), strict=True)
            ]
            ends = zip(problems, jumps, loadings, strict=True)
            low_value, high_value = (p.residual(d, h).value for p, d, h in ends)
            right, border = -(high_value - low_value) / self.distance, None
            if control:
                assert slope is not None
                prescribed = Prescribed(control, self.model.equilibrium)
                measured = [
                    control.measure(step.model.equilibrium, d, h)
                    for step, d, h in zip(begun, jumps, loadings, strict=True)
                ]
                gap = -(measured[1] - measured[0]) / self.distance
                border = Border(slope, prescribed.row, prescribed.rate(end.loading), gap)
            change, level_change = problem.system.solve(tangent, right, border)
            rate, level_rate = rate + change, level_rate + level_change
            size = float(np.linalg.norm(rate))
            if number and np.linalg.norm(change) > KINK * size > 0:
                self.kink = True
        jumps = [jump - half * rate, jump + half * rate]
        loadings = [
            unknown.at(step.model.loading(time, level), value + sign * half * level_rate)
            for step, sign in zip(begun, (-1, 1), strict=True)
        ]
        return self.ends(begun, sides, jumps, loadings)

    @staticmethod
    def ends(
        begun: Sequence[Begun],
        sides: Sequence[Side],
        jumps: Sequence[Array],
        loadings: Sequence[Loading],
    ) -> tuple[Side, Side]:
        """Both sides at the end of a step."""
        low, high = (
            replace(side, state=step.end(jump, loading).after(side.state))
            for side, step, jump, loading in zip(sides, begun, jumps, loadings, strict=True)
        )
        return low, high
