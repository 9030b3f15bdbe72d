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

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from .. import InputError, RunError
from ..arrays import Array
from ..csr import CsrMatrix
from ..fem.cache import key_of
from ..input.case import Case
from ..input.parameters import independent, parameter
from ..input.resolve import varied
from ..joint.equilibrium import Equilibrium
from ..joint.linear_system import Border, DenseSystem, Tangent
from ..joint.problem import JointProblem
from ..model.loads import LEVEL, Loading, Unknown
from ..model.results import column_of, history_table
from .controls import DisplacementControl, Prescribed
from .history import History
from .model import Begun, Model, StepResult
from .state import State, Trace

#: Half of the difference of a parameter, over its value [-]; of one that is zero in its unit, and
#: in these units.
DIFFERENCE = 3e-6
ZERO = {"Pa": 1.0, "Pa per m": 1e5, "N per m": 1e-1, "kg per m3": 1e-2}

#: Corrections of a derivative, and the last one over the derivative beyond which a point of the
#: joint is at a kink: about to open, to slip or to break [-].
CORRECTIONS, KINK = 6, 1e-5
#: Correction over the derivative up to which there is no further one [-].
EXACT = 1e-9

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

    def row(self, values: Callable[[Side], dict[str, float]]) -> dict[str, float]:
        """Of values by name, such as `history_row`."""
        low, high = (values(side) for side in (self.low, self.high))
        return {name: self.of(low[name], high[name]) for name in low}


def history_row(side: Side) -> dict[str, float]:
    """The row of history.csv of a state, and of each joint the end of its crack."""
    equilibrium = side.model.equilibrium
    history = History(equilibrium, at_rest=side.at_rest)
    history.add(StepResult(side.state, 0, 0.0), 0)
    rows = {name: np.array(values, float) for name, values in history.rows.items()}
    case = side.model.case
    row = {name: float(c[-1]) for name, c in history_table(case, rows).items()}
    for k in range(len(case.joints)):
        row[column_of("crack_end", k)] = crack_end(equilibrium, side.state, k)
    return row


def crack_end(equilibrium: Equilibrium, state: State, number: int) -> float:
    """Where the crack from the heel of a joint, by its number, ends [m]: there the opening, linear
    between the Gauss points, is that from which on the law counts a point as crack; 0 without one.
    It follows the state continuously, the length of crack in history.csv counts points.
    """
    joint, law = equilibrium.interface.joints[number], equilibrium.laws.laws[number]
    if joint.dim == 3:
        return math.nan
    along = joint.chord.along[:2]
    heel = (joint.space.locations[:, :2] @ along).min()
    variables = state.variables.joints[number]
    jump = joint.jumps(joint.at_points, state.jump)
    place = joint.points.positions[:, :2] @ along - heel
    order = np.argsort(place)
    beyond = (jump[:, 0] - law.opening_of_crack(variables, len(jump)))[order]
    closed = np.flatnonzero(beyond <= 0)
    if not len(closed) or closed[0] == 0:
        return joint.length if not len(closed) else 0.0
    k = closed[0]
    part = beyond[k - 1] / (beyond[k - 1] - beyond[k])
    return float(place[order][k - 1] + part * (place[order][k] - place[order][k - 1]))


def half_difference(case: Case, name: str) -> tuple[float, float, float]:
    """The value of a parameter, and those on both sides of it: the value itself where the
    parameter allows none beyond it.

    Raises InputError if a parameter has no derivative.
    """
    joint, _, of_joint = name.rpartition(".")
    known = parameter(of_joint)
    if not known.real or known.group in NOT_CONTINUOUS:
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


@dataclass(frozen=True)
class Linearised:
    """The linear system of a step at its end, for all parameters at once."""

    problem: JointProblem
    tangent: Tangent
    #: with a prescribed displacement; its gap is that of each right side
    border: Border | None

    @cached_property
    def matrix(self) -> Array:
        """The dense matrix with its border."""
        assert not isinstance(self.problem.stiffness, CsrMatrix)
        system = DenseSystem(self.problem.interface.assembly, self.problem.stiffness)
        matrix = system.matrix(self.tangent)
        if border := self.border:
            corner = np.array([[border.rate]])
            matrix = np.block([[matrix, border.slope[:, None]], [border.row[None], corner]])
        return matrix

    def solve(self, rights: Array, gaps: Array) -> tuple[Array, Array]:
        """The solutions (j, k) for right sides (j, k), and the rates (k,) of the level for gaps
        (k,), zero without border.

        Raises LinAlgError if the system is singular.
        """
        if isinstance(self.problem.stiffness, CsrMatrix):
            borders = [self.border and replace(self.border, gap=float(gap)) for gap in gaps]
            system, pairs = self.problem.system, zip(rights.T, borders, strict=True)
            columns = [system.solve(self.tangent, right, border) for right, border in pairs]
            return np.array([x for x, _ in columns]).T, np.array([s for _, s in columns])
        whole = np.vstack([rights, gaps]) if self.border else rights
        solution = np.asarray(np.linalg.solve(self.matrix, whole), float)
        return (solution[:-1], solution[-1]) if self.border else (solution, np.zeros(len(gaps)))


@dataclass
class Parameter:
    """A parameter with the models on both sides of its value, and their states along a path."""

    distance: float
    models: tuple[Model, Model]
    sides: tuple[Side, Side]
    kink: bool = False
    #: of the step under way: its beginnings on both sides, their problems, rates of jump and level
    begun: Sequence[Begun] = ()
    problems: Sequence[JointProblem] = ()
    rate: Array = field(default_factory=lambda: np.zeros(0))
    level_rate: float = 0.0
    #: of its loads what the level rate is of
    unknown: Unknown = LEVEL

    def begin(self, time: float, size: int, unknown: Unknown) -> None:
        """Begin a step to a time; size: of the jumps; unknown: beside them."""
        self.unknown = unknown
        self.begun = [side.model.begin(side.state, time) for side in self.sides]
        self.problems = [step.problem for step in self.begun]
        self.rate, self.level_rate = np.zeros(size), 0.0

    def ends(self, end: State) -> list[tuple[Begun, JointProblem, Array, Loading]]:
        """On each side beginning, problem, jump and loading at the end of the step, to first order;
        end: of the step between them.
        """
        result = []
        for sign, step, problem in zip((-1, 1), self.begun, self.problems, strict=True):
            half = sign * self.distance / 2
            loading = step.model.loading(end.time, end.loading.level)
            value = self.unknown.of(end.loading) + half * self.level_rate
            loading = self.unknown.at(loading, value)
            result.append((step, problem, end.jump + half * self.rate, loading))
        return result

    def right(self, end: State) -> Array:
        """The right side (j,) that remains."""
        low, high = (p.residual(jump, loading).value for _, p, jump, loading in self.ends(end))
        return (low - high) / self.distance

    def gap(self, end: State, control: DisplacementControl | None) -> float:
        """That of the prescribed displacement; 0 without."""
        if control is None:
            return 0.0
        low, high = (
            control.measure(step.model.equilibrium, jump, loading)
            for step, _, jump, loading in self.ends(end)
        )
        return (low - high) / self.distance

    def add(self, change: Array, level_change: float, correction: bool) -> bool:
        """Add to the rates; whether they need a further correction. correction: whether these are
        changes of a derivative, which are large at a kink.
        """
        self.rate, self.level_rate = self.rate + change, self.level_rate + level_change
        error, size = float(np.linalg.norm(change)), float(np.linalg.norm(self.rate))
        self.kink |= correction and error > KINK * size > 0
        return not correction or error > EXACT * size

    def end(self, end: State, at_rest: bool) -> Derivative:
        """The derivative at the end of the step, where the next one begins; at_rest: whether
        displacements count from there.
        """
        low, high = (
            replace(side, state=step.end(jump, loading).after(side.state))
            for side, (step, _, jump, loading) in zip(self.sides, self.ends(end), strict=True)
        )
        if at_rest:
            low, high = (replace(side, at_rest=side.state) for side in (low, high))
        self.sides = low, high
        return Derivative(low, high, self.distance, self.kink)


class Differentiation:
    """The derivatives of the states of a case along the updates that have led to one of them."""

    def __init__(self, model: Model, names: Sequence[str]) -> None:
        """names: of parameters, or of one of a joint, "lift 25 m.mu". Raises InputError."""
        self.model = model
        self.parameters = dict[str, Parameter]()
        self.key = key_of(model.case)
        for name in names:
            _, low, high = half_difference(model.case, name)
            models = self.model_with(name, low), self.model_with(name, high)
            sides = Side(models[0], models[0].start()), Side(models[1], models[1].start())
            self.parameters[name] = Parameter(high - low, models, sides)

    def model_with(self, name: str, value: float) -> Model:
        """The model with a value: on the same bodies, unless they depend on the parameter."""
        case = self.model.case
        if name in independent():
            other = case.changed({name: value})
        else:
            other = varied(case, {name: value})
            other = replace(other, levels=case.levels, tail_levels=case.tail_levels)
            other = replace(other, times=case.times)
        same = key_of(other) == self.key
        return Model(other, self.model.equilibrium.interface if same else None)

    def along(self, updates: Sequence[Trace]) -> tuple[list[dict[str, Derivative]], float]:
        """The derivatives of each state of a path, by parameter, and its `level_rise` at the end.

        Raises RunError if one of them was reached by relaxation with frozen damage.
        """
        state, results = self.model.start(), list[dict[str, Derivative]]()
        for update in updates:
            if update.frozen:
                raise RunError(
                    f"sensitivity: the crack has grown unstably at level "
                    f"{update.state.loading.level:.6g} m; the state after it has no derivative"
                )
            linear = self.step(state, update)
            state = update.state
            at_rest = state.time == 0 and bool(self.model.case["weight_first"])
            results.append({n: p.end(state, at_rest) for n, p in self.parameters.items()})
        return results, self.level_rise(updates, linear) if updates else math.inf

    def level_rise(self, updates: Sequence[Trace], linear: Linearised) -> float:
        """How much the level still rises with the displacement prescribed at the end of a path,
        where its equation is linearised, over its mean rise on the path [-]: about 1 as long as
        all is elastic, 0 at a limit point; inf without a prescribed displacement.
        """
        first, last = updates[0].state, updates[-1]
        if linear.border is None or not isinstance(last.control, DisplacementControl):
            return math.inf
        measure = partial(self.model.measure, last.control)
        moved, risen = measure(last.state) - measure(first), last.state.loading.level
        size = len(linear.border.row)
        _, (rate,) = linear.solve(np.zeros((size, 1)), np.ones(1))
        return float(rate * moved / risen) if risen else math.inf

    def step(self, state: State, update: Trace) -> Linearised:
        """Solve for the rates of all parameters at the end of a step from a state; its equation,
        linearised there.
        """
        end = update.state
        control = update.control if isinstance(update.control, DisplacementControl) else None
        problem, border = self.model.begin(state, end.time).problem, None
        here = problem.residual(end.jump, end.loading)
        unknown = control.unknown if control else LEVEL
        if control:
            given = Prescribed(control, self.model.equilibrium)
            border = Border(here.by_unknown(unknown), given.row, given.rate(end.loading), 0.0)
        linear = Linearised(problem, here.by_jump(False), border)
        under_way = [*self.parameters]
        for part in self.parameters.values():
            part.begin(end.time, len(end.jump), unknown)
        for number in range(CORRECTIONS if under_way else 0):
            parts = [self.parameters[name] for name in under_way]
            rights = np.array([part.right(end) for part in parts]).T
            gaps = np.array([part.gap(end, control) for part in parts])
            changes, level_changes = linear.solve(rights, gaps)
            pairs = zip(under_way, parts, changes.T, level_changes.tolist(), strict=True)
            under_way = [n for n, p, x, s in pairs if p.add(x, s, number > 0)]
            if not under_way:
                break
        return linear
