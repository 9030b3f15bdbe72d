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
from collections.abc import Callable, Collection, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from .. import InputError, RunError
from ..arrays import Array, BoolArray
from ..fem.cache import bodies_key
from ..fem.condensed import Condensed
from ..fem.moduli import Moduli
from ..input.case import SECTION, Case
from ..input.parameters import AUTOMATIC, declared, followers, parameter
from ..input.resolve import varied
from ..input.values import flows, flows_in_time, freezes_uplift
from ..joint.equilibrium import Equilibrium
from ..mesh.generate import MARKS
from ..model.results import column_of, history_table
from .controls import DisplacementControl, drive_control
from .history import History, JointState
from .load_stepper import SAME_TIME
from .model import Model, StepResult
from .sides import Alike, Linearised, Sides, SidesInStep, crack_ends
from .state import State, Trace

#: Half of the difference of a parameter, over its value [-].
DIFFERENCE = 3e-6
#: That of one that is zero: of a length over the size of the dam [-], small, as the load of silt
#: grows with the square of its height; of a stress over E_dam [-]; of a number, angle or
#: temperature [in its unit].
ZERO_LENGTH, ZERO_STRESS, ZERO_NUMBER = 1e-7, 5e-11, 1e-5

#: Parameters of the laws that are not of the group Joint, and of the loads not of the group Loads.
OF_LAW = "grout_pressure", "grout_t", "saw_thickness", "saw_t"
OF_LOADS = "rho_dam", "rho_found"
#: Moduli of the bodies; and of the parameters that are not loads those by which the body above a
#: joint is loaded.
MODULI = "E", "E_dam", "E_found"
LOADING = "rho_dam", "rho_water", "g"

#: Groups of parameters on which the mesh or the way to the solution depends, and times that decide
#: in which step a displacement is prescribed.
NOT_CONTINUOUS, TIMES = ("Mesh", "Solver", "Geometry"), ("drive_begin", "drive_end")


@dataclass(frozen=True)
class Side:
    """The model with a parameter on one side of its value, and its state."""

    model: Model
    state: State
    #: that under the weight alone, if displacements count from it
    at_rest: State | None = None


@dataclass(frozen=True)
class Rates:
    """Derivatives of a state with parameters (parameters,): of the level, where a displacement is
    prescribed [m over the unit], of values by their names; whether at a kink.
    """

    level: Array
    values: Mapping[str, Array]
    kink: BoolArray


def history_row(side: Side) -> dict[str, float]:
    """The row of history.csv of a state, and of each joint the end of its crack."""
    equilibrium = side.model.equilibrium
    history = History(equilibrium, at_rest=side.at_rest)
    history.add(StepResult(side.state, 0, 0.0), 0)
    rows = {name: np.array(values, float) for name, values in history.rows.items()}
    case = side.model.case
    row = {name: float(c[-1]) for name, c in history_table(case, rows).items()}
    for k in range(len(case.joints)):
        of = JointState(equilibrium, side.state, k)
        beyond = of.jump[:, 0] - of.law.opening_of_crack(of.variables, len(of.jump))
        row[column_of("crack_end", k)] = float(crack_ends(of.joint, beyond[None])[0])
    return row


def half_of_zero(case: Case, unit: str) -> float:
    """Half of the difference of a parameter that is zero, by its unit: the same in all consistent
    units of length, mass and time.
    """
    size, stress, g = case.size, ZERO_STRESS * case["E_dam"], case["g"]
    return {
        "m": ZERO_LENGTH * size,
        "Pa": stress,
        "Pa per m": stress / size,
        "N per m": stress * size,
        "N m per m": stress * size**2,
        "kg per m3": stress / (g * size),
        "m per Pa": ZERO_LENGTH * size / case["E_dam"],
    }.get(unit, ZERO_NUMBER)


def half_difference(case: Case, name: str) -> tuple[float, float, float]:
    """The value of a parameter, and those on both sides of it: the value itself where the
    parameter allows none beyond it.

    Raises InputError if a parameter has no derivative.
    """
    of_joint = name.rpartition(".")[2]
    known = parameter(of_joint)
    if not known.real or known.group in NOT_CONTINUOUS or of_joint in TIMES:
        raise InputError(
            f"--sensitivity {name}: must be a parameter that is a number, and neither of geometry, "
            f"mesh nor solver, nor {', '.join(TIMES)}"
        )
    value = float(case.single_value(name, f"--sensitivity {name}"))
    half = DIFFERENCE * abs(value) or half_of_zero(case, known.unit)
    low, high = value - half, value + half
    low, high = (end if known.allows(end) else value for end in (low, high))
    if not value and of_joint in MARKS:  # the first force adds a point to the mesh: on both sides
        low, high = half, 2 * half
    if low == high:
        raise InputError(
            f"--sensitivity {name}: has the value {value:g}, which follows from others"
        )
    return value, low, high


def is_automatic(case: Case, name: str) -> bool:
    """Whether the value of a parameter of a case follows from others."""
    of_source = (case.source.text.defaults, case.source.overrides) if case.source else ()
    given = any(of.get(name, AUTOMATIC) != AUTOMATIC for of in of_source)
    return declared()[name].automatic and not given


def water_differs(case: Case, other: Case) -> bool:
    """Whether the water in a joint differs between cases that differ in a parameter of its law: in
    a crack, from another opening on.
    """
    if case["uplift"] != "cracked":
        return False
    opening, other_opening = (c.law.opening_of_crack(c.law.initial(1), 1) for c in (case, other))
    return bool(opening[0] != other_opening[0])


def follows_none(case: Case, name: str) -> bool:
    """Whether no other value of a case, and no part of its section, follows from a parameter, as
    the place of a line force does from its size.
    """
    for other in followers(name):
        if other in SECTION or (other == "line_size" and not case[name]):
            return False
        known = declared().get(other)
        acts = known and any(known.matters_in(joint.values) for joint in case.joints)
        if acts and is_automatic(case, other):
            return False
    return True


def linear_flow(case: Case) -> bool:
    """Whether the derivatives of the water that flows in a joint follow from those of the jumps: in
    steady laminar flow.
    """
    return not (case["turbulent"] or flows_in_time(case))


class Differentiation(Sides):
    """The derivatives of the states of a case along the updates that have led to one of them.

    Each parameter has two sides, models with the parameter below and above its value. What the
    parameter does not change is shared with the model of the case, and evaluated for all sides at
    once: the laws joint by joint, the bodies, the loads, the water that flows.
    """

    def __init__(self, model: Model, names: Sequence[str], one_sided: bool = False) -> None:
        """names: of parameters, or of one of a joint, "lift 25 m.mu"; one_sided: whether the low
        sides have the values themselves. Raises InputError.
        """
        self.model, self.names, self.key = model, list(names), bodies_key(model.case)
        self.apart = any(
            freezes_uplift(joint) or (flows(joint) and not linear_flow(joint))
            for joint in model.case.joints
        )
        self.loading = [
            n in LOADING or parameter(n).group == "Loads"
            for n in (m.rpartition(".")[2] for m in names)
        ]
        self.models, offsets = list[Model](), list[float]()
        ends = [half_difference(model.case, name) for name in names]
        middle = [(low + high) / 2 for _, low, high in ends]
        if one_sided:
            middle = [
                value if low <= value else m
                for m, (value, low, _) in zip(middle, ends, strict=True)
            ]
            ends = [(v, max(v, low), high) if high > v else (v, low, v) for v, low, high in ends]
        self.alone = self.without_followers(
            {n: low for n, (_, low, _) in zip(names, ends, strict=True)}
        )
        for side in (1, 2):
            for name, end in zip(names, ends, strict=True):
                self.models.append(self.model_with(name, end[side]))
                offsets.append(end[side] - middle[len(offsets) % len(names)])
        self.offsets = np.array(offsets)
        self.number, self.distance = len(ends), np.array([high - low for _, low, high in ends])
        self.states = [side.start() for side in self.models] if self.apart else []
        self.crest_at_rest = np.zeros(2 * self.number)
        self.drive_from = np.zeros(2 * self.number)
        self.kink, self.lost = np.zeros((2, self.number), bool)
        self.joints = [self.alike_at(k) for k in range(len(model.equilibrium.laws.laws))]

    def alike_at(self, joint: int) -> list[Alike]:
        """The sides with the same law of a joint, by its number."""
        sides = dict[int, list[int]]()
        laws = [model.equilibrium.laws.laws[joint] for model in self.models]
        for number, law in enumerate(laws):
            sides.setdefault(id(law), []).append(number)
        of = self.model.equilibrium.interface.joints[joint]
        q, rows = len(of.points.weights), len(of.rows)
        return [
            Alike(
                law := laws[s[0]], np.array(s), law.initial(q * len(s)), law.initial(rows * len(s))
            )
            for s in sides.values()
        ]

    def model_with(self, name: str, value: float) -> Model:
        """The model with a value: what does not depend on the parameter is that of the model."""
        model, of_joint = self.model, name.rpartition(".")[2]
        case, known = model.case, parameter(of_joint)
        if of_joint in MODULI and self.moduli and self.moduli.known:
            return self.with_modulus(self.moduli, name, value)
        if name in self.alone:
            other = case.with_value(name, value)
        else:
            other = varied(case, {name: value})
            other = replace(other, levels=case.levels, tail_levels=case.tail_levels)
            other = replace(other, times=case.times)
        if bodies_key(other) != self.key:
            whole = Model(other)
            whole.equilibrium.laws = model.equilibrium.laws
            return whole
        same_loads = model.equilibrium
        if known.group == "Joint" or of_joint in OF_LAW:
            joints = zip(same_loads.water, case.joints, other.joints, strict=True)
            cracks = [water for water, a, b in joints if water_differs(a, b)]
            same_loads = same_loads.with_laws(other)
            if not (self.apart or any(water.system.network for water in cracks)):
                return model.sharing(other, same_loads.with_cracks(cracks))
        elif of_joint in OF_LOADS or known.group == "Loads":
            return model.sharing(other, same_loads.with_loads(other))
        equilibrium = Equilibrium(other, same_loads.interface)
        equilibrium.laws = same_loads.laws
        return model.sharing(other, equilibrium)

    def without_followers(self, values: Mapping[str, float]) -> set[str]:
        """Those of parameters from which no other value of the case follows. Where a formula has
        some of them, such as that of an automatic G_f, which is a constant with most laws, the case
        is resolved once with other values of these.
        """
        case = self.model.case
        alone = {name for name in values if follows_none(case, name.rpartition(".")[2])}
        doubtful = {n: v for n, v in values.items() if n not in alone and n not in MODULI}
        if not doubtful:
            return alone
        try:
            expected, resolved = case, varied(case, doubtful)
        except InputError:  # G_f and pena_rupture exclude each other
            return alone
        for name, value in doubtful.items():
            expected = expected.with_value(name, value)
        same = all(
            a.section == b.section
            and all(a[n] == b[n] or not p.matters_in(a.values) for n, p in declared().items())
            for a, b in zip(expected.joints, resolved.joints, strict=True)
        )
        return alone | doubtful.keys() if same else alone

    def with_modulus(self, moduli: Moduli, name: str, value: float) -> Model:
        """The model with another E, E_dam or E_found, to first order around that of the case."""
        model, case = self.model, self.model.case
        changes = {name: value}
        if name == "E":
            changes |= {n: value for n in ("E_dam", "E_found") if is_automatic(case, n)}
        dam, found = (changes.get(n, case[n]) / case[n] - 1 for n in ("E_dam", "E_found"))
        other = model.equilibrium.with_loads(case.with_values(changes))
        other.bulk = moduli.changed(dam, found)
        other.interface = copy(other.interface)
        other.interface.bulk = other.bulk
        return model.sharing(other.case, other)

    @cached_property
    def moduli(self) -> Moduli | None:
        """The bodies with other moduli; None if nothing is condensed."""
        bulk = self.model.equilibrium.bulk
        return Moduli(self.model.case, bulk) if type(bulk) is Condensed else None

    def along(
        self,
        updates: Sequence[Trace],
        wanted: Collection[int] = (),
        values: Callable[[SidesInStep], dict[str, Array]] = lambda step: {},
    ) -> tuple[list[Rates], float]:
        """The derivatives along the updates of a path, of those whose numbers are wanted and of the
        last one, and its `level_rise` at the end; values: of the sides (sides,) at a step's end.

        Raises RunError if an update is a relaxation with frozen damage, under dissipation control
        or after the end of a prescribed displacement.
        """
        state, results, case = self.model.start(), list[Rates](), self.model.case
        drives = case["drive"] != "level"
        for number, update in enumerate(updates):
            if drives and (
                case["drive"] == "dissipation" or update.state.time > case["drive_end"] + SAME_TIME
            ):
                raise RunError(
                    f"sensitivity: drive = {case['drive']}: a state under dissipation control, or "
                    "after drive_end, has no derivative"
                )
            if update.frozen:
                raise RunError(
                    f"sensitivity: the crack has grown unstably at level "
                    f"{update.state.loading.level:.6g} m; the state after it has no derivative"
                )
            step = SidesInStep(self, state, update)
            step.solve()
            step.finish()
            state = update.state
            if state.time == 0 and self.model.case["weight_first"]:
                self.crest_at_rest = step.displacement("crest")
            if drives and state.time < case["drive_begin"] + SAME_TIME:
                self.drive_from = step.measured(drive_control(case))
            if number in wanted or number == len(updates) - 1:
                rates = {n: self.rate_of(v) for n, v in values(step).items()}
                level = np.where(self.lost, np.nan, step.level_rate)
                results.append(Rates(level, rates, self.kink.copy()))
        return results, self.level_rise(updates, step.linear) if updates else math.inf

    def rate_of(self, values: Array) -> Array:
        """The derivatives (parameters,) of values (sides,)."""
        with np.errstate(invalid="ignore"):  # of an infinite safety factor
            rates = (values[self.number :] - values[: self.number]) / self.distance
        return np.where(self.lost, np.nan, rates)

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
