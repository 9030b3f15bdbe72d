"""The condensed engine: the loading followed on the joint alone (see condense.py), with the strategy of pro/strategy.pro.

Unknown: the jump. Residual R = N^T W t(jump) - (water in the joint) + S jump - t_0(level) = 0; the pressure of
flowing water is solved for the jump at hand before every residual, and its derivative enters the tangent.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from .condense import Condensed
from .interface import Change
from .laws import LAWS, Memory
from .parameters import Case
from .results import HISTORY, JOINT, Results, why_stopped

TOLERANCE = 1e-9
GROWTH = 3.0
#: Attempts at a step, in this order: how much the residual may grow before a correction is halved, and whether
#: the law's secant stiffness takes the place of the tangent.
ATTEMPTS = ((GROWTH, False), (1e9, False), (GROWTH, True), (1.0, False))
MAX_ITERATIONS = 30
#: Before giving up, the secant once more for as long as a burst of breaking points may last.
BURST_ITERATIONS = 300
MAX_HALVINGS = 10
CUT = 0.25
SMALLEST_STEP = 1 / 1024  # in t


@dataclass
class State:
    """A converged state: what the next step starts from."""

    time: float
    level: float
    jump: np.ndarray
    memory: Memory
    nodes: Memory


class Joint:
    """The joint of a case with the condensed bodies around it: residual, tangent and what is read from them."""

    def __init__(self, case: Case, bulk: Condensed) -> None:
        self.case, self.bulk, self.interface = case, bulk, bulk.interface
        self.wet, self.flowing = case["uplift"] != "none", case["uplift"] == "flow"
        self.unit_weight = case["rho_water"] * case["g"]
        self.law = LAWS[case["law"]](case)
        self.virgin = self.law.respond(np.zeros((1, 3)), self.law.start(1))[1][0]
        self.known_loads = None, (np.zeros(0), np.zeros(0))  # of the last (level, tail)

    # -- loads ---------------------------------------------------------------------------------------------

    def face_forces(self, name: str, level: float) -> tuple[np.ndarray, np.ndarray]:
        """Forces of the water on the functions of a face [N] and their derivative with its level.

        With the factor a + b y of pro/loads.pro: exact resultant and moment in spite of the waterline's kink.
        """
        points, height, base = self.interface.faces[name], self.case["dam_height"], self.case["dam_base"]
        y = points.positions[:, 1]
        stretch = 1.0 if name == "upstream" else np.hypot(height, base - self.case["dam_crest"]) / height
        if self.case["face_load"] == "uniform":
            pressure, slope = np.full_like(y, level), np.ones_like(y)
            force, moment = level * height, level * height**2 / 2
        else:
            pressure, slope, under = np.maximum(level - y, 0), (level > y).astype(float), min(level, height)
            force, moment = level * under - under**2 / 2, level * under**2 / 2 - under**3 / 3
        force, moment = force * stretch * self.bulk.width, moment * stretch * self.bulk.width
        m0, m1, m2 = (points.weights @ (pressure * y**k) for k in range(3))
        det = m0 * m2 - m1**2
        b = (m0 * moment - m1 * force) / det if det > 1e-3 * m1**2 else 0.0
        a = (force - b * m1) / m0 if m0 > 0 else 1.0
        factor = self.unit_weight * points.weights * (a + b * y)
        return points.values.T @ (factor * pressure), points.values.T @ (factor * slope)

    def linear_pressure(self, x: np.ndarray, level: float, tail: float) -> np.ndarray:
        """Pressure linear from heel to toe [Pa]."""
        return self.unit_weight * (level + (tail - level) * x / self.bulk.base)

    def loads(self, level: float, tail: float) -> tuple[np.ndarray, np.ndarray]:
        """t_0 and the imposed part of the water in the joint together (j,), and their derivative with the level."""
        if self.known_loads[0] == (level, tail):
            return self.known_loads[1]
        case, bulk, interface = self.case, self.bulk, self.interface
        force, slope = self.face_forces("upstream", level)
        total = case["g"] * (case["rho_dam"] * bulk.weight_dam + case["rho_found"] * bulk.weight_foundation)
        total = total + bulk.pressure["upstream"] @ force
        rate = bulk.pressure["upstream"] @ slope
        if tail > 0:
            total = total + bulk.pressure["downstream"] @ self.face_forces("downstream", tail)[0]
        if self.wet:
            w, x = interface.water_points.weights, interface.water_points.positions[:, 0]
            total = total + interface.water.T @ (w * self.linear_pressure(x, level, tail))
            rate = rate + interface.water.T @ (w * self.unit_weight * (1 - x / bulk.base))
        self.known_loads = (level, tail), (total, rate)
        return total, rate

    def solve_flow(self, jump: np.ndarray, level: float, tail: float) -> tuple[np.ndarray, object]:
        """Pressure beyond the linear one at the inner nodes for an opening, and the solution's sensitivity.

        The conductivity w^3 is scaled by aperture_min^-3.
        """
        aperture = 1 + np.maximum(self.interface.flow.opening @ jump, 0) / self.case["aperture_min"]
        return self.interface.flow.solve(aperture**3 * self.interface.points.weights, self.unit_weight * (level - tail))

    def residual(self, jump: np.ndarray, memory: Memory, level: float, tail: float, secant: bool = False
                 ) -> tuple[np.ndarray, Callable[[], tuple[Change, np.ndarray]]]:
        """The residual (j,), and a function that gives its derivatives with jump (a change of the virgin joint's) and level (j,)."""
        interface = self.interface
        traction, tangent = self.law.respond(interface.jumps(interface.at_points, jump), memory, secant)
        load, rate = self.loads(level, tail)
        value = self.bulk.stiffness @ jump - load + interface.forces(traction)
        if not self.flowing:
            return value, lambda: (interface.change(tangent, self.virgin), -rate)
        flow = interface.flow
        pressure, solution = self.solve_flow(jump, level, tail)
        value = value - flow.lift @ pressure

        def derivatives() -> tuple[Change, np.ndarray]:
            narrowest = self.case["aperture_min"]
            opening = flow.opening @ jump
            growing = np.where(opening > 0, 3 / narrowest * (1 + opening / narrowest) ** 2, 0) * interface.points.weights
            change = interface.change(tangent, self.virgin)
            change.pressure, change.columns, per_drop = flow.sensitivity(solution, growing)
            return change, -rate - flow.lift @ (self.unit_weight * per_drop)

        return value, derivatives

    def crest(self, jump: np.ndarray, level: float, tail: float) -> tuple[float, np.ndarray, float]:
        """The crest's displacement along x [m], and its derivatives with jump and level."""
        case, bulk = self.case, self.bulk
        force, slope = self.face_forces("upstream", level)
        value = case["g"] * (case["rho_dam"] * bulk.crest_weight_dam + case["rho_found"] * bulk.crest_weight_foundation)
        value += bulk.crest_pressure["upstream"] @ force + bulk.crest_jump @ jump
        if tail > 0:
            value += bulk.crest_pressure["downstream"] @ self.face_forces("downstream", tail)[0]
        return float(value), bulk.crest_jump, float(bulk.crest_pressure["upstream"] @ slope)


class Filling:
    """The loading of a case followed step by step; the converged steps are rows, the requested levels tables."""

    def __init__(self, case: Case, bulk: Condensed, on_step: Callable[[float], None] = lambda time: None) -> None:
        self.case, self.joint, self.on_step = case, Joint(case, bulk), on_step
        self.driven = case["drive"] != "level"
        start = np.zeros(len(bulk.free))
        law, interface = self.joint.law, bulk.interface
        self.state = State(0.0, 0.0, start, law.start(len(interface.points.weights)), law.start(len(interface.space.place)))
        self.reference = self.unbalanced(case)
        self.rows, self.tables, self.heel, self.saved = [], [], [], []
        self.displacement = self.left = 0.0
        self.stopped = False

    def unbalanced(self, case: Case) -> float:
        """Norm of the residual of the untouched joint under the highest water: what convergence is measured by."""
        joint, law = self.joint, self.joint.law
        virgin = law.start(len(joint.interface.points.weights))
        return np.linalg.norm(joint.residual(np.zeros(len(joint.bulk.free)), virgin, max(case.levels), max(case.tail_levels))[0])

    def fork(self, case: Case) -> Filling:
        """Another filling, of a case that agrees with this one's as far as this one has come, to go on from there."""
        other = copy(self)
        other.case, other.reference = case, self.unbalanced(case)
        for name in ("rows", "tables", "heel", "saved"):
            setattr(other, name, list(getattr(self, name)))
        return other

    def run(self) -> Results:
        """Follow all the times of the case that are still to come."""
        cuts, dt = 0, np.inf
        for target in self.case.times:
            if target <= self.state.time:
                continue
            while self.state.time < target and not self.stopped:
                time = min(self.state.time + dt, target)
                time = target if target - time < 1e-9 else time
                found = next(filter(None, (self.solve(time, *attempt) for attempt in ATTEMPTS)), None)
                if found is None:
                    dt, cuts = CUT * (time - self.state.time), cuts + 1
                    if dt < SMALLEST_STEP:
                        time, found = target, self.solve(target, GROWTH, True, BURST_ITERATIONS)
                        self.stopped = found is None
                if found:
                    dt = 2 * (time - self.state.time)
                    self.accept(time, cuts, *found)
                    cuts = 0
            if self.stopped:
                break
            dt = np.inf
            if target in self.case.requested:
                self.save()
        if self.stopped and self.state.time > 0 and (not self.saved or self.saved[-1][0] < self.state.time):
            self.save()
        return self.results()

    def water_at(self, time: float) -> tuple[float, float, bool, float]:
        """Reservoir and tailwater level, whether a displacement is prescribed instead, and how much."""
        case = self.case
        level, tail = case.level_at(time), np.interp(time, range(len(case.levels) + 1), (0.0, *case.tail_levels))
        if not self.driven:
            return level, tail, False, 0.0
        begin, end, last = case["drive_begin"], case["drive_end"], case.times[-1]
        if time > end + 1e-9:  # the level goes on from where it was left
            level = self.left + (case.level_at(last) - self.left) * (time - end) / (last - end)
        target = self.displacement + case["drive_by"] * (time - begin) / (end - begin)
        return level, tail, begin + 1e-9 < time < end + 1e-9, target

    def solve(self, time: float, growth: float, secant: bool, most: int = MAX_ITERATIONS) -> tuple | None:
        """Newton from the last state: (jump, level, tail, iterations, residual), or None."""
        joint, memory = self.joint, self.state.memory
        level, tail, prescribed, target = self.water_at(time)
        level = self.state.level if prescribed else level
        jump, limit = self.state.jump, TOLERANCE * self.reference
        stiff = joint.case["K_N"] * joint.bulk.width

        def evaluate(jump: np.ndarray, level: float) -> tuple:
            value, derivatives = joint.residual(jump, memory, level, tail, secant)
            if not prescribed:
                return np.linalg.norm(value), value, derivatives, None
            if self.case["drive"] == "heel":
                row, rate, gap = joint.interface.heel, 0.0, joint.interface.heel @ jump - target
            else:
                found, row, rate = joint.crest(jump, level, tail)
                gap = found - target
            return np.hypot(np.linalg.norm(value), stiff * gap), value, derivatives, (row, rate, gap)

        size, value, derivatives, border = evaluate(jump, level)
        iterations, sizes = 0, []
        while not size <= limit:
            if any(abs(size - other) <= 1e-10 * size for other in sizes):
                return None  # Newton goes round in circles
            sizes.append(size)
            fallen = np.abs(jump).max() > 0.1 * self.case["dam_height"]
            if iterations == most or not np.isfinite(size) or fallen:
                return None
            change, slope = derivatives()
            edge = border and (slope, *border[:2], -border[2])
            try:
                step, rise = joint.interface.solve(joint.virgin, change, -value, edge)
            except (linalg.LinAlgError, ValueError):
                return None
            iterations += 1
            fraction, old = 1.0, size
            for _ in range(MAX_HALVINGS + 1):
                size, value, derivatives, border = evaluate(jump + fraction * step, level + fraction * rise)
                if size <= growth * old:
                    break
                fraction /= 2
            else:
                fraction *= 2
            jump, level = jump + fraction * step, level + fraction * rise
        return jump, level, tail, iterations, size / self.reference

    def accept(self, time: float, cuts: int, jump: np.ndarray, level: float, tail: float, iterations: int, residual: float) -> None:
        """Commit a converged step and write its row of history."""
        joint, law, interface = self.joint, self.joint.law, self.joint.interface
        at_points, at_nodes = interface.jumps(interface.at_points, jump), interface.jumps(interface.at_nodes, jump)
        memory, nodes = law.remember(at_points, self.state.memory), law.remember(at_nodes, self.state.nodes)
        self.state = State(time, level, jump, memory, nodes)
        self.tail = tail
        traction, _ = law.respond(at_points, memory)
        weights, x = interface.points.weights / joint.bulk.width, interface.points.positions[:, 0]
        heel = float(interface.heel @ jump)
        crest = joint.crest(jump, level, tail)[0]
        self.pressure = joint.solve_flow(jump, level, tail)[0] if joint.flowing else None
        flux = self.flux()[1] if joint.flowing else 0.0
        scheduled = self.case.level_at(time)
        self.rows.append((time, level, level / scheduled if scheduled else 1.0, iterations, cuts, residual,
                          weights @ law.open(at_points, memory), weights @ law.slid(at_points, memory), at_nodes[:, 0].max(), crest,
                          -weights @ traction[:, 0], weights @ traction[:, 1], -weights @ (traction[:, 0] * (joint.bulk.base - x)), flux))
        self.heel.append(heel)
        if self.driven:
            if time < self.case["drive_begin"] + 1e-9:
                self.displacement = heel if self.case["drive"] == "heel" else crest
            if time < self.case["drive_end"] + 1e-9:
                self.left = level
        self.on_step(time)

    def flux(self) -> tuple[np.ndarray, float]:
        """Mass flux along x: mean of each joint element [kg/(m s)], and out of the toe per metre of thickness."""
        joint, case, points, flow = self.joint, self.case, self.joint.interface.points, self.joint.interface.flow
        steepness = joint.unit_weight * (self.tail - self.state.level) / joint.bulk.base
        aperture = case["aperture_min"] + np.maximum(flow.opening @ self.state.jump, 0)
        conductivity = case["rho_water"] * aperture**3 / (12 * case["visc"])
        if joint.bulk.dim == 2:  # the same in every element: the drop over the resistances in series
            total = np.sum(flow.lengths**2 / np.bincount(points.elements, points.weights * conductivity))
            flux = -steepness * joint.bulk.base / total
            return np.full(len(flow.lengths), flux), flux
        q = -conductivity * (flow.inner_slopes[0] @ self.pressure + steepness)
        means = np.bincount(points.elements, points.weights * q) / np.bincount(points.elements, points.weights)
        column = joint.bulk.base / case["n_joint"]
        last = points.positions[:, 0] > joint.bulk.base - column
        return means, float(np.sum((points.weights * q)[last]) / column / joint.bulk.width)

    def save(self) -> None:
        """The joint at the current state, node by node; and with jump and stress made from element means."""
        joint, law, state, interface = self.joint, self.joint.law, self.state, self.joint.interface
        place, corners = interface.space.place, len(joint.bulk.joint.points)
        jump = interface.jumps(interface.at_nodes, state.jump)
        traction, _ = law.respond(jump, state.nodes)
        pressure = joint.linear_pressure(place[:, 0], state.level, self.tail) if joint.wet else np.zeros(len(place))
        at_points = interface.jumps(interface.at_points, state.jump)
        stress, _ = law.respond(at_points, state.memory)
        x = interface.points.positions[:, 0]
        beyond = np.zeros(len(x))
        if joint.flowing:
            whole = np.zeros(corners)
            whole[interface.flow.inside] = self.pressure
            pressure = pressure + interface.flow.at_nodes @ whole
            beyond = interface.flow.values @ whole
        if joint.wet:
            stress[:, 0] -= joint.linear_pressure(x, state.level, self.tail) + beyond
        traction[:, 0] -= pressure
        columns = [np.full((len(place), 2), (state.time, state.level)), place, jump, traction, pressure[:, None],
                   law.damage(jump, state.nodes)[:, None], np.linalg.norm(state.nodes.vector, axis=1)[:, None]]
        if joint.flowing:
            columns.append(self.node_means(self.flux()[0][:, None], True))
        table = np.hstack(columns)
        weights, elements = interface.points.weights, interface.points.elements
        total = np.bincount(elements, weights)
        means = np.column_stack([np.bincount(elements, weights * v) / total for v in (*at_points.T, *stress.T)])
        extra = table.copy()
        extra[:corners, 5:11] = self.node_means(means, False)
        self.saved.append((state.time, state.jump, state.level, self.tail))
        self.tables.append((table, extra))

    def node_means(self, values: np.ndarray, middles: bool) -> np.ndarray:
        """Mean over the joint elements around each node (and each middle of an edge) of element values (e, m)."""
        space = self.joint.interface.space
        number = len(space.place) if middles else len(space.body.points)
        total, count, start = np.zeros((number, values.shape[1])), np.zeros(number), 0
        for (_, whole), (_, cells) in zip(space.connectivity, space.body.cells, strict=True):
            table = whole if middles else cells
            rows = np.repeat(np.arange(start, start + len(table)), table.shape[1])
            np.add.at(total, table.ravel(), values[rows])
            np.add.at(count, table.ravel(), 1)
            start += len(table)
        return total / count[:, None]

    def results(self) -> Results:
        """All tables so far."""
        names = JOINT + ("flux",) * self.joint.flowing
        history = dict(zip(HISTORY, np.array(self.rows, float).reshape(-1, len(HISTORY)).T, strict=True))
        stack = lambda k: np.vstack([t[k] for t in self.tables]) if self.tables else np.zeros((0, len(names)))  # noqa: E731
        tables = [dict(zip(names, stack(k).T, strict=True)) for k in (0, 1)]
        return Results(self.case, history, *tables, why_stopped(self.case, history) if self.stopped else "", np.array(self.heel),
                       self.saved)
