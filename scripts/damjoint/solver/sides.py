"""A state of a case with each of several parameters on both sides of its value, to first order: the
linear system of a step at its end, and the step on all sides at once, see derivatives.py.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any

import numpy as np

from ..arrays import Array, BoolArray, IntArray
from ..csr import CsrMatrix
from ..joint.flow import FlowDerivative
from ..joint.interface import JointInterface
from ..joint.linear_system import Border, Tangent
from ..joint.problem import JointProblem, rate
from ..joint.water import Pressure, WaterSystem
from ..laws import Law
from ..model.loads import LEVEL, Loading
from ..model.results import column_of
from .controls import BodyControl, DisplacementControl, Prescribed
from .model import Begun, Model
from .state import State, Trace

#: Corrections of a derivative at most.
CORRECTIONS = 6
#: Correction over the derivative up to which there is no further one [-].
EXACT = 1e-7
#: Last correction over the derivative beyond which a point of the joint is at a kink [-]: about to
#: open, to slip or to break.
KINK = 1e-5
#: Last correction over the derivative beyond which there is no derivative [-].
LOST = 1e-3
#: Correction times the distance of the sides, over the jumps, up to which it is round-off [-].
ROUNDING = 1e-13


def crack_ends(joint: JointInterface, beyond: Array) -> Array:
    """Where the crack from the heel of a joint ends [m] (n,): there the opening, linear between the
    Gauss points, is that from which on the law counts a point as crack; 0 without one. It follows
    the state continuously, the length of crack in history.csv counts points.

    beyond: the openings less that (n, q).
    """
    if joint.dim == 3:
        return np.full(len(beyond), math.nan)
    along = joint.chord.along[:2]
    heel = (joint.space.locations[:, :2] @ along).min()
    position = joint.points.positions[:, :2] @ along - heel
    order = np.argsort(position)
    position, beyond, rows = position[order], beyond[:, order], np.arange(len(beyond))
    closed = beyond <= 0
    first = closed.argmax(axis=1)
    last = np.maximum(first - 1, 0)
    step = beyond[rows, last] - beyond[rows, first]
    part = np.divide(beyond[rows, last], step, out=np.zeros(len(rows)), where=first > 0)
    ends = position[last] + part * (position[first] - position[last])
    return np.where(closed.any(axis=1), np.where(first > 0, ends, 0.0), joint.length)


@dataclass(frozen=True)
class Linearised:
    """The linear system of a step at its end, for all parameters at once."""

    problem: JointProblem
    tangent: Tangent
    #: with a prescribed displacement; its gap is that of each right side
    border: Border | None

    def solve(self, rights: Array, gaps: Array) -> tuple[Array, Array]:
        """The solutions (j, k) for right sides (j, k), and the rates (k,) of the level for gaps
        (k,), zero without border.

        Raises LinAlgError if the system is singular.
        """
        system, border = self.problem.system, self.border
        if not isinstance(self.problem.stiffness, CsrMatrix):
            columns, rates = system.solve(
                self.tangent, rights, border and replace(border, gap=gaps)
            )
            return columns, rates if border else np.zeros(len(gaps))
        found = [
            system.solve(self.tangent, right, border and replace(border, gap=float(gap)))
            for right, gap in zip(rights.T, gaps, strict=True)
        ]
        return np.array([x for x, _ in found]).T, np.array([s for _, s in found])


@dataclass
class Alike:
    """Sides (n,) on which a joint has the same law: its internal variables at the Gauss points and
    at the nodes of the sides, one side after the other, and those of the beginning of a step.
    """

    law: Law[Any]
    sides: IntArray
    points: Any
    nodes: Any
    begun: tuple[Any, Any] = (None, None)

    def begin(self, begin: float, end: float) -> None:
        """Begin a step."""
        both = self.points, self.nodes
        self.begun = tuple(self.law.begin_step(v, begin, end) for v in both)

    def response(self, jumps: Array, variables: Any) -> tuple[Array, Array]:
        """Tractions (n, q, 3) and tangents (n, q, 3, 3) at jumps (n, q, 3) of the Gauss points."""
        traction, tangent = self.law.traction_and_tangent(jumps.reshape(-1, 3), variables)
        return traction.reshape(jumps.shape), tangent.reshape(*jumps.shape, 3)

    def finish(self, at_points: Array, at_nodes: Array) -> None:
        """End the step at jumps (n, q, 3)."""
        update = self.law.update_internal_variables
        self.points = update(at_points.reshape(-1, 3), self.begun[0])
        self.nodes = update(at_nodes.reshape(-1, 3), self.begun[1])

    def of(self, side: int) -> tuple[Any, Any]:
        """The internal variables of a side: of Gauss points and nodes."""
        chosen, number = np.flatnonzero(self.sides == side), len(self.sides)
        return parts_of(self.points, chosen, number), parts_of(self.nodes, chosen, number)


def parts_of(variables: Any, chosen: IntArray, number: int) -> Any:
    """The chosen ones of a number of equal parts of the arrays of internal variables."""
    if variables is None or len(chosen) == number:
        return variables
    values = {f.name: getattr(variables, f.name) for f in fields(variables)}
    arrays = {n: v for n, v in values.items() if isinstance(v, np.ndarray) and v.ndim}
    parts = {n: v.reshape(number, -1, *v.shape[1:])[chosen] for n, v in arrays.items()}
    return replace(variables, **{n: v.reshape(-1, *v.shape[2:]) for n, v in parts.items()})


class Sides:
    """The models of a case with each parameter below and above its value, the low ones before the
    high ones, and their states at the end of the last step.
    """

    #: the model of the case, and that of each side
    model: Model
    models: list[Model]
    #: of each side the offset of the parameter from its value (sides,)
    offsets: Array
    #: number of parameters, and of each the distance of its sides, and whether it is of the loads
    number: int
    distance: Array
    loading: list[bool]
    #: whether the equation of each side is evaluated apart, as its water follows from states
    #: before, or not linearly from the jumps; their states, if so
    apart: bool
    states: list[State]
    #: of each joint the sides with the same law
    joints: list[list[Alike]]
    #: of the sides, the displacement of the crest from which it counts, and the one from which that
    #: counts which the case prescribes
    crest_at_rest: Array
    drive_from: Array
    #: of the parameters: whether at a kink, and whether their rates were not found
    kink: BoolArray
    lost: BoolArray

    @property
    def alike(self) -> list[Alike]:
        """The sides alike, of all joints."""
        return [one for joint in self.joints for one in joint]

    def of_joints(self, starts: Sequence[int]) -> list[tuple[slice, list[Alike]]]:
        """The points of each joint, that start there, and its sides alike."""
        return [(slice(*ends), j) for ends, j in zip(pairwise(starts), self.joints, strict=True)]


class SidesInStep:
    """All sides in a step, to first order around its end."""

    def __init__(self, sides: Sides, state: State, update: Trace) -> None:
        """state: in which the step begins; update: in which it ends."""
        self.sides, self.before, self.end = sides, state, update.state
        control, model = update.control, sides.model
        self.control = control if isinstance(control, DisplacementControl) else None
        self.unknown = self.control.unknown if self.control else LEVEL
        self.problem = problem = model.begin(state, self.end.time).problem
        here, border = problem.residual(self.end.jump, self.end.loading), None
        if self.control:
            given = Prescribed(self.control, model.equilibrium)
            slope = here.by_unknown(self.unknown)
            row = given.row(self.end.jump)
            border = Border(slope, row, given.rate(self.end.loading), 0.0)
        self.linear = Linearised(problem, here.by_jump(False), border)
        #: of the parameters: rates of the jump and of what is unknown beside it
        self.rate = np.zeros((sides.number, len(self.end.jump)))
        self.level_rate = np.zeros(sides.number)
        #: of the sides: jumps at which the laws have last been evaluated, tractions and tangents
        points = len(sides.offsets), *self.linear.tangent.law.shape
        self.evaluated, self.traction = np.zeros((2, *points[:-1]))
        self.tangents = np.zeros(points)
        #: of the sides: their steps, if each is evaluated apart
        self.begun = list[Begun]()
        if sides.apart:
            pairs = zip(sides.models, sides.states, strict=True)
            self.begun = [one.begin(before, self.end.time) for one, before in pairs]
        for alike in sides.alike:
            alike.begin(state.time, self.end.time)
        self.move()

    # -- the sides at the end of the step

    def move(self) -> None:
        """Move the sides by the rates."""
        offsets = self.sides.offsets
        #: the jumps (sides, j); what is unknown beside them (sides,), less that of the end
        self.jumps = self.end.jump + offsets[:, None] * np.tile(self.rate, (2, 1))
        self.shifts = offsets * np.tile(self.level_rate, 2)

    @cached_property
    def loadings(self) -> list[Loading]:
        """The loads of the sides at the level of the end."""
        end = self.end
        return [model.loading(end.time, end.loading.level) for model in self.sides.models]

    def loading(self, side: int) -> Loading:
        """The loads of a side."""
        of = self.loadings[side]
        if not self.control:
            return of
        return self.unknown.at(of, self.unknown.of(self.end.loading) + float(self.shifts[side]))

    def at(self, matrix: CsrMatrix, some: IntArray | slice = slice(None)) -> Array:
        """The jumps (some, q, 3) of some sides, at points by `at_points` or `at_nodes`."""
        dim, unknowns = self.sides.model.equilibrium.interface.dim, self.jumps[some]
        jumps = np.zeros((len(unknowns), matrix.shape[0] // dim, 3))
        jumps[:, :, :dim] = matrix.on_rows(unknowns).reshape(len(jumps), -1, dim)
        return jumps

    def evaluate(self, some: IntArray) -> None:
        """Evaluate the laws at the Gauss points, of some sides."""
        at_points = self.sides.model.equilibrium.interface.at_points
        self.evaluated[some] = self.at(at_points, some)
        for part, joint in self.sides.of_joints(self.problem.variables.starts):
            for alike in joint:
                if not len(chosen := np.flatnonzero(np.isin(alike.sides, some))):
                    continue
                sides, variables = alike.sides[chosen], alike.begun[0]
                variables = parts_of(variables, chosen, len(alike.sides))
                of = alike.response(self.evaluated[sides, part], variables)
                self.traction[sides, part], self.tangents[sides, part] = of

    def residuals(self, some: IntArray) -> Array:
        """The forces out of balance (some, j) of some sides."""
        jumps, shifts, sides, problem = self.jumps[some], self.shifts, self.sides, self.problem
        if sides.apart:
            values = np.zeros_like(jumps)
            for row, k in enumerate(some.tolist()):
                residual = self.begun[k].problem.residual(self.jumps[k], self.loading(k))
                values[row], self.tangents[k] = residual.value, residual.by_jump(False).law
            return values
        values = (problem.stiffness @ jumps.T).T
        base = sides.model.equilibrium
        if self.control:
            slope = rate(base.loads, self.end.loading, problem.size, self.unknown)
        for row, k in enumerate(some.tolist()):
            of = sides.models[k].equilibrium
            if of.bulk is not base.bulk:
                values[row] = of.bulk.stiffness @ jumps[row]
            if of.loads is not base.loads:
                values[row] -= of.loads(self.loading(k))
            elif self.control:
                values[row] -= base.loads(self.end.loading) + shifts[k] * slope
            else:
                values[row] -= base.loads(self.end.loading)
        self.evaluate(some)
        values += base.interface.forces(self.traction[some])
        if base.flowing:
            values -= self.lifts(some)
        return values

    def lifts(self, some: IntArray) -> Array:
        """Forces (some, j) of the water that flows, of some sides: where it is that of the case, to
        first order around the end.
        """
        end, water, total = self.end, self.problem.water, np.zeros((len(some), len(self.end.jump)))
        assert water
        for number, system in enumerate(water.flowing):
            nodal, part = self.nodal(number)[some], np.zeros_like(total)
            for joint in system.members:
                beyond = joint.wetted.fields.on_rows(nodal[:, joint.nodes])
                part += joint.lift(end.loading, beyond)
            if self.control:
                lift = partial(self.lift_of, system, end.jump)
                slope = rate(lift, end.loading, self.problem.size, self.unknown)
                part += self.shifts[some, None] * slope
            for row, k in enumerate(some.tolist()):
                own = self.sides.models[k].equilibrium.flowing[number]
                if own is not system:
                    part[row] = self.lift_of(own, self.jumps[k], self.loading(k))
            total += part
        return total

    def lift_of(self, system: WaterSystem, jump: Array, loading: Loading) -> Array:
        """Forces (j,) of the water that flows in a system."""
        assert self.problem.water
        return replace(self.problem.water, flowing=(system,)).flow(jump, loading).lift

    @cached_property
    def solved(self) -> list[tuple[Array, FlowDerivative | None]]:
        """Of each `flowing` at the end: pressure beyond the imposed one at the nodes, and its
        derivative with the unknowns at the inner ones.
        """
        end, water = self.end, self.problem.water
        assert water
        flow = water.flow(end.jump, end.loading)
        return [
            (
                system.expand_to_nodes(solution),
                system.derivative(end.jump, water.variables, solution, None),
            )
            for system, solution in zip(water.flowing, flow.solutions, strict=True)
        ]

    def nodal(self, number: int) -> Array:
        """Of one of `flowing` the pressure beyond the imposed one at the nodes (sides, n)."""
        system, moved = self.sides.model.equilibrium.flowing[number], self.jumps - self.end.jump
        nodal, rates = self.solved[number]
        values = np.tile(nodal, (len(moved), 1))
        if rates:
            values[:, system.fields.inside] += moved[:, rates.columns] @ rates.pressure.T
        return values

    # -- their derivatives

    def solve(self) -> None:
        """Solve for the rates: first with the tangent of the end; where they need more than a
        correction, the parameter has a kink, or is so near to one that the sides are beyond it.
        Their corrections are those of the tangents of both sides.
        """
        sides, size = self.sides, np.linalg.norm(self.end.jump)
        number, distance = sides.number, sides.distance
        some = np.arange(number)
        for correction in range(CORRECTIONS if number else 0):
            low, high = np.split(self.residuals(np.concatenate([some, some + number])), 2)
            rights = (low - high).T / distance[some]
            if correction < 2:
                change, level_change = self.linear.solve(rights, self.gaps()[some])
            else:
                change, level_change = self.by_tangents_of_sides(some, rights)
            self.rate[some] += change.T
            self.level_rate[some] += level_change
            self.move()
            if not correction:
                continue
            error, rate = (np.linalg.norm(v, axis=-1) for v in (change.T, self.rate[some]))
            seen = error * distance[some] > ROUNDING * size
            sides.kink[some] |= seen & (error > KINK * rate)
            lost = some[seen & (error > LOST * rate)]
            some = some[seen & (error > EXACT * rate)]
            if not len(some):
                return
        if number:
            sides.lost[lost] = True

    def by_tangents_of_sides(self, some: IntArray, rights: Array) -> tuple[Array, Array]:
        """The corrections of some rates, each with the tangents of its sides: their mean, weighted
        by how far the sides are from the state.
        """
        gaps, number, tangent = self.gaps(), self.sides.number, self.linear.tangent
        columns = []
        for k, right in zip(some.tolist(), rights.T, strict=True):
            pair = [k, k + number]
            weights = np.abs(self.sides.offsets[pair]) / np.abs(self.sides.offsets[pair]).sum()
            of = replace(tangent, law=np.tensordot(weights, self.tangents[pair], 1))
            linear = replace(self.linear, tangent=of)
            columns.append(linear.solve(right[:, None], gaps[[k]]))
        changes, level_changes = zip(*columns, strict=True)
        return np.hstack(changes), np.concatenate(level_changes)

    def gaps(self) -> Array:
        """What is missing of the rates (parameters,) of a prescribed displacement; 0 without."""
        border, control, number = self.linear.border, self.control, self.sides.number
        if border is None or control is None:
            return np.zeros(number)
        gaps, base = -(self.rate @ border.row + border.rate * self.level_rate), self.sides.model
        for k in range(number):
            pair = k, k + number
            of = [self.sides.models[side].equilibrium for side in pair]
            if of[0].external_forces is not base.equilibrium.external_forces:
                low, high = (
                    control.measure(one, self.jumps[side], self.loading(side))
                    for one, side in zip(of, pair, strict=True)
                )
                gaps[k] = (low - high) / self.sides.distance[k]
        if base.case["drive"] != "level":
            values = self.sides.drive_from + self.prescribed_share
            gaps += (values[number:] - values[:number]) / self.sides.distance
        return np.asarray(gaps)

    @property
    def prescribed_share(self) -> Array:
        """What the case adds to the prescribed displacement at the beginning [m], of the sides."""
        case = self.sides.model.case
        begin, end = case["drive_begin"], case["drive_end"]
        whole = np.array([model.case["drive_by"] for model in self.sides.models])
        return np.asarray(whole * (self.end.time - begin) / (end - begin))

    def measured(self, control: DisplacementControl) -> Array:
        """A displacement by its control [m], of the sides."""
        pairs = zip(self.sides.models, self.jumps, strict=True)
        return np.array(
            [control.measure(m.equilibrium, d, self.loading(k)) for k, (m, d) in enumerate(pairs)]
        )

    # -- the states of the sides, where the next step begins

    def finish(self) -> None:
        """End the step on all sides."""
        sides, interface = self.sides, self.sides.model.equilibrium.interface
        at_points, at_nodes = self.at(interface.at_points), self.at(interface.at_nodes)
        for (of_points, joint), (of_nodes, _) in self.joints:
            for alike in joint:
                alike.finish(at_points[alike.sides, of_points], at_nodes[alike.sides, of_nodes])
        if sides.apart:
            sides.states = [self.state(k) for k in range(len(sides.offsets))]

    @property
    def joints(self) -> list[tuple[tuple[slice, list[Alike]], tuple[slice, list[Alike]]]]:
        """The Gauss points and the nodes of each joint, with its sides alike."""
        starts = self.end.variables.starts, self.end.node_variables.starts
        return list(zip(*(self.sides.of_joints(s) for s in starts), strict=True))

    def state(self, side: int) -> State:
        """The state of a side at the end of the step."""
        model, end = self.sides.models[side], self.end
        water, jump, loading = self.begun[side].problem.water, self.jumps[side], self.loading(side)
        parts = [
            next(alike.of(side) for alike in joint if side in alike.sides)
            for joint in self.sides.joints
        ]
        points, nodes = (tuple(part[k] for part in parts) for k in (0, 1))
        assert water
        return State(
            time=end.time,
            loading=loading,
            jump=jump,
            variables=replace(end.variables, joints=points),
            node_variables=replace(end.node_variables, joints=nodes),
            pressures=water.pressures(jump, loading),
            stored=water.stored(jump, loading, end.time) if model.in_time else (),
            before_quake=water.before_quake,
        )

    # -- what is recorded of the sides (sides,), as in `History`

    def displacement(self, name: str) -> Array:
        """A displacement of the bodies by its name [m]."""
        return self.measured(BodyControl(0.0, name))

    def pressures(self, joint: int) -> list[Pressure]:
        """The water in a joint, by its number."""
        sides, base, end = self.sides, self.sides.model.equilibrium, self.end
        if sides.apart:
            return [state.pressures[joint] for state in sides.states]
        assert self.problem.water
        water, variables, result = base.water[joint], self.problem.water.variables, []
        nodal: Sequence[Array | None] = [None] * len(sides.offsets)
        if water.system in base.flowing and not self.control:
            nodal = list(self.nodal(base.flowing.index(water.system))[:, water.nodes])
        for side, (model, jump) in enumerate(zip(sides.models, self.jumps, strict=True)):
            of = model.equilibrium.water[joint]
            if of is water and not (self.control or water.flowing):
                result.append(end.pressures[joint])
                continue
            beyond = nodal[side] if of is water else None
            result.append(of.pressure(jump, variables, self.loading(side), beyond=beyond))
        return result

    def row(self) -> dict[str, Array]:
        """Time and level, the columns of history.csv that follow the parameters continuously, and
        of each joint `crack_end`.
        """
        interface, number = self.sides.model.equilibrium.interface, len(self.sides.offsets)
        at_points, at_nodes = (self.at(m) for m in (interface.at_points, interface.at_nodes))
        if self.sides.apart:
            self.evaluate(np.arange(number))
        # the last correction is small: that of the tractions is linear
        change = np.einsum("sqij,sqj->sqi", self.tangents, at_points - self.evaluated)
        traction = self.traction + change
        row = {
            "time": np.full(number, self.end.time),
            "level": np.array([self.loading(k).level for k in range(number)]),
            "crest_ux": self.displacement("crest") - self.sides.crest_at_rest,
        }
        for k, ((of_points, joint), (of_nodes, _)) in enumerate(self.joints):
            of = self.row_of_joint(k, at_points[:, of_points], traction[:, of_points], joint)
            of["max_opening"] = at_nodes[:, of_nodes, 0].max(axis=1)
            row |= {column_of(name, k): values for name, values in of.items()}
        return row

    def row_of_joint(
        self, number: int, jumps: Array, traction: Array, sides: list[Alike]
    ) -> dict[str, Array]:
        """Those of a joint, by its number, at jumps and tractions (sides, q, 3) of its points."""
        base = self.sides.model.equilibrium
        joint = base.interface.joints[number]
        chord, weights = joint.chord, joint.points.weights / joint.width
        bonded, opening = np.empty(jumps.shape[:2]), np.empty(jumps.shape[:2])
        for alike in sides:
            law, flat = alike.law, jumps[alike.sides].reshape(-1, 3)
            shape = len(alike.sides), len(weights)
            bonded[alike.sides] = law.cohesion_left(flat, alike.points).reshape(shape)
            of_crack = law.opening_of_crack(alike.points, len(flat))
            opening[alike.sides] = of_crack.reshape(shape)
        along_axes = np.einsum("sqk,qkc->sqc", traction, joint.frames[joint.points.elements])
        N, T, M = chord.resultants(weights, joint.points.positions, along_axes)
        pressures, wetted = self.pressures(number), base.water[number].wetted.points
        water = np.array([one.water_points for one in pressures])
        lifting = -water[:, :, None] * joint.surface.normals[wetted.elements]
        U, _, _ = chord.resultants(wetted.weights / joint.width, wetted.positions, lifting)
        length = self.sides.model.case.joints[number].joint_length
        return {
            "crack_end": crack_ends(joint, jumps[:, :, 0] - opening),
            "bonded_length": bonded @ weights,
            "N": N,
            "T": T,
            "M": M,
            "U": U,
            "x_resultant": length - np.divide(M, N, out=np.full(len(N), np.nan), where=N > 0),
            "flux": np.array([one.leakage for one in pressures]),
        }
