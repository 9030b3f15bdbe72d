"""The condensed engine: the loading followed on the joint alone (see condense.py), with the strategy of pro/strategy.pro.

Unknown: the jump. Residual R = N^T W t(jump) - (water in the joint) + S jump - t_0(level) = 0; the pressure of
flowing water is solved for the jump at hand before every residual, and its derivative enters the tangent.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse

from . import fem
from .condense import Condensed
from .laws import LAWS, Memory
from .parameters import Case
from .results import HISTORY, JOINT, Results, why_stopped

TOLERANCE = 1e-9
#: Attempts at a step, in this order: how much the residual may grow before a correction is halved, and whether
#: the law's secant stiffness takes the place of the tangent.
ATTEMPTS = ((3.0, False), (1e9, False), (3.0, True), (1.0, False))
MAX_ITERATIONS = 30
MAX_HALVINGS = 6
CUT = 0.25
SMALLEST_STEP = 1 / 1024  # in t


def solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Dense LU, the matrix overwritten. Raises LinAlgError if it is singular."""
    factors, pivots, info = linalg.lapack.dgetrf(matrix.T, overwrite_a=True)
    if info:
        raise linalg.LinAlgError("singular matrix")
    return linalg.lapack.dgetrs(factors, pivots, right, trans=1)[0]


def rows(matrix: sparse.csr_matrix) -> np.ndarray | sparse.csr_matrix:
    """Small matrices are faster dense."""
    return matrix.toarray() if matrix.shape[0] * matrix.shape[1] < 400_000 else matrix.tocsr()


def weighted(weights: np.ndarray, matrix: np.ndarray | sparse.csr_matrix) -> np.ndarray | sparse.csr_matrix:
    """diag(weights) matrix."""
    return weights[:, None] * matrix if isinstance(matrix, np.ndarray) else sparse.diags(weights) @ matrix


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
        self.case, self.bulk = case, bulk
        self.dim, self.order = int(case["dim"]), int(case["order"])
        self.wet, self.flowing = case["uplift"] != "none", case["uplift"] == "flow"
        self.unit_weight = case["rho_water"] * case["g"]
        self.base = case["dam_base"]
        self.width = case["thickness"] if self.dim == 3 else 1.0
        self.law = LAWS[case["law"]](case)

        space = fem.Space(bulk.joint, self.order)
        self.space = space
        self.points = fem.points_of(space, fem.JOINT[self.order])
        water = fem.points_of(space, fem.WATER)
        components = (1, 0, 2)[: self.dim]  # normal, tangent 1, tangent 2
        functions, parts = np.divmod(bulk.free, self.dim)
        select = [sparse.csr_matrix((np.ones((parts == c).sum()), (functions[parts == c], np.flatnonzero(parts == c))),
                                    (len(space.place), len(bulk.free))) for c in components]
        #: jump components at the law's points and at the nodes, from the unknowns
        self.at_points = [rows(self.points.values @ s) for s in select]
        middles = sparse.eye(len(space.place), format="lil")
        nodes = len(bulk.joint.points)
        for i, (a, b) in enumerate(space.edges):  # the middle of an edge: mean of its ends and a quarter of its function
            middles[nodes + i, nodes + i] = 0.25
            middles[nodes + i, a] = middles[nodes + i, b] = 0.5
        self.at_nodes = [rows(middles.tocsr() @ s) for s in select]
        self.water = rows(water.values @ select[0])
        self.water_points = water
        if self.flowing:
            self._prepare_flow()
        self.faces = {name: fem.points_of(fem.Space(body, self.order), fem.WATER) for name, body in bulk.faces.items()}
        self.opening_of_heel = self._heel_row()

    def _heel_row(self) -> np.ndarray:
        """The heel's opening, mean over z, from the unknowns."""
        x = np.abs(self.space.body.points[:, 0]) < 1e-9 * self.base
        weights = np.zeros(len(self.space.place))
        if self.dim == 2:
            weights[np.flatnonzero(x)] = 1
        else:
            heel = np.flatnonzero(x)
            heel = heel[np.argsort(self.space.body.points[heel, 2])]
            lengths = np.diff(self.space.body.points[heel, 2]) / self.width
            np.add.at(weights, heel[:-1], lengths / 2)
            np.add.at(weights, heel[1:], lengths / 2)
            for i, (a, b) in enumerate(self.space.edges):
                if x[a] and x[b]:
                    weights[len(x) + i] = abs(self.space.body.points[a, 2] - self.space.body.points[b, 2]) / self.width / 6
        functions, parts = np.divmod(self.bulk.free, self.dim)
        return np.where(parts == 1, weights[functions], 0)

    # -- loads ---------------------------------------------------------------------------------------------

    def face_forces(self, name: str, level: float) -> tuple[np.ndarray, np.ndarray]:
        """Forces of the water on the functions of a face [N] and their derivative with its level.

        With the factor a + b y of pro/loads.pro: exact resultant and moment in spite of the waterline's kink.
        """
        points, height = self.faces[name], self.case["dam_height"]
        y = points.positions[:, 1]
        stretch = 1.0 if name == "upstream" else np.hypot(height, self.base - self.case["dam_crest"]) / height
        if self.case["face_load"] == "uniform":
            pressure, slope = np.full_like(y, level), np.ones_like(y)
            force, moment = level * height, level * height**2 / 2
        else:
            pressure, slope, under = np.maximum(level - y, 0), (level > y).astype(float), min(level, height)
            force, moment = level * under - under**2 / 2, level * under**2 / 2 - under**3 / 3
        force, moment = force * stretch * self.width, moment * stretch * self.width
        m0, m1, m2 = (points.weights @ (pressure * y**k) for k in range(3))
        det = m0 * m2 - m1**2
        b = (m0 * moment - m1 * force) / det if det > 1e-3 * m1**2 else 0.0
        a = (force - b * m1) / m0 if m0 > 0 else 1.0
        factor = self.unit_weight * points.weights * (a + b * y)
        return points.values.T @ (factor * pressure), points.values.T @ (factor * slope)

    def linear_pressure(self, x: np.ndarray, level: float, tail: float) -> np.ndarray:
        """Pressure linear from heel to toe [Pa]."""
        return self.unit_weight * (level + (tail - level) * x / self.base)

    def loads(self, level: float, tail: float) -> tuple[np.ndarray, np.ndarray]:
        """t_0 and the imposed part of the water in the joint together (j,), and their derivative with the level."""
        case, bulk = self.case, self.bulk
        force, slope = self.face_forces("upstream", level)
        total = case["g"] * (case["rho_dam"] * bulk.weight_dam + case["rho_found"] * bulk.weight_foundation)
        total = total + bulk.pressure["upstream"] @ force
        rate = bulk.pressure["upstream"] @ slope
        if tail > 0:
            total = total + bulk.pressure["downstream"] @ self.face_forces("downstream", tail)[0]
        if self.wet:
            w, x = self.water_points.weights, self.water_points.positions[:, 0]
            total = total + self.water.T @ (w * self.linear_pressure(x, level, tail))
            rate = rate + self.water.T @ (w * self.unit_weight * (1 - x / self.base))
        return total, rate

    # -- flow ----------------------------------------------------------------------------------------------

    def _prepare_flow(self) -> None:
        pressure = fem.Space(self.bulk.joint, 1)
        at = fem.points_of(pressure, fem.JOINT[self.order], gradients=True)
        x = self.bulk.joint.points[:, 0]
        inside = np.flatnonzero((x > 1e-9 * self.base) & (x < self.base * (1 - 1e-9)))
        self.inside = inside
        if self.dim == 2:
            order = np.argsort(x[inside])
            self.inside_x = x[inside][order]
            self.back = np.argsort(order)  # from the order of x to that of `inside`
            self.along = np.argsort(x[self.bulk.joint.cells[0][1]].mean(axis=1))
        self.normal = np.flatnonzero(self.bulk.free % self.dim == 1)
        self.opening = self.at_points[0][:, self.normal]
        self.slopes = [rows(g[:, inside]) for g in at.gradients[: self.dim - 1]]
        at_water = fem.points_of(pressure, fem.WATER).values[:, inside].toarray()
        self.lift = self.water.T @ weighted(self.water_points.weights, at_water)
        self.pressure_slopes = at.gradients[: self.dim - 1]
        self.pressure_middles = np.vstack([np.eye(len(x)), *(np.eye(len(x))[[a]] / 2 + np.eye(len(x))[[b]] / 2
                                                             for a, b in self.space.edges)]) if self.order == 2 else np.eye(len(x))

    def solve_flow(self, jump: np.ndarray, level: float, tail: float, sensitivity: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pressure beyond the linear one at the inner nodes for an opening, and its derivatives with the normal
        jump unknowns and the level. The conductivity w^3 is scaled by aperture_min^-3.
        """
        opening = self.at_points[0] @ jump
        aperture = self.case["aperture_min"] + np.maximum(opening, 0)
        scale = self.case["aperture_min"] ** -3.0
        conductivity = scale * aperture**3 * self.points.weights
        rate = np.where(opening > 0, 3 * scale * aperture**2, 0) * self.points.weights
        return (self._in_series if self.dim == 2 else self._in_the_plane)(conductivity, rate, level, tail, sensitivity)

    def _in_series(self, conductivity: np.ndarray, rate: np.ndarray, level: float, tail: float, sensitivity: bool) -> tuple:
        """2D: the elements are resistances in series. No differences of nearly equal numbers, however far the
        conductivities lie apart (a factorised matrix loses the closed joint beside the open one).
        """
        lengths = np.bincount(self.points.elements, self.points.weights)
        resistance = lengths**2 / np.bincount(self.points.elements, conductivity)
        ahead = np.zeros(len(resistance) + 1)  # from the heel to each node, in order of x
        np.cumsum(resistance[self.along], out=ahead[1:])
        behind = np.zeros_like(ahead)
        behind[:-1] = np.cumsum(resistance[self.along][::-1])[::-1]
        total = ahead[-1]
        heel, toe = self.unit_weight * level, self.unit_weight * tail
        x = self.inside_x
        left, right = ahead[1:-1], behind[1:-1]
        pressure = (heel * right + toe * left) / total - self.linear_pressure(x, level, tail)
        if not sensitivity:
            return pressure[self.back], np.zeros(0), np.zeros(0)
        gradient = ((toe - heel) / total * resistance / lengths)[self.points.elements]
        coupling = self.slopes[0].T @ weighted(rate * gradient, self.opening)
        coupling = coupling if isinstance(coupling, np.ndarray) else coupling.toarray()
        green = np.minimum.outer(left, left) * np.minimum.outer(right, right) / total  # the inverse of the flow matrix
        by_level = self.unit_weight * (right / total - (1 - x / self.base))
        return pressure[self.back], -green[np.ix_(self.back, self.back)] @ coupling, by_level[self.back]

    def _in_the_plane(self, conductivity: np.ndarray, rate: np.ndarray, level: float, tail: float, sensitivity: bool) -> tuple:
        """3D: one symmetric positive definite system; not a number where the conductivities lie too far apart for it."""
        steepness = self.unit_weight * (tail - level) / self.base
        matrix = sum(g.T @ weighted(conductivity, g) for g in self.slopes)
        try:
            factor = linalg.cho_factor(matrix if isinstance(matrix, np.ndarray) else matrix.toarray())
        except (linalg.LinAlgError, ValueError):
            nothing = np.full(len(self.inside), np.nan)
            return nothing, np.full((len(nothing), len(self.normal)), np.nan), nothing
        pressure = linalg.cho_solve(factor, -(self.slopes[0].T @ (conductivity * steepness)))
        if not sensitivity:
            return pressure, np.zeros(0), np.zeros(0)
        gradient = [g @ pressure for g in self.slopes]
        gradient[0] = gradient[0] + steepness
        coupling = sum(g.T @ weighted(rate * d, self.opening) for g, d in zip(self.slopes, gradient, strict=True))
        coupling = coupling if isinstance(coupling, np.ndarray) else coupling.toarray()
        by_level = self.slopes[0].T @ (conductivity * self.unit_weight / self.base)
        return pressure, -linalg.cho_solve(factor, coupling), linalg.cho_solve(factor, by_level)

    # -- residual ------------------------------------------------------------------------------------------

    def jumps(self, matrices: list, unknowns: np.ndarray) -> np.ndarray:
        """delta_n, delta_t1, delta_t2 (q, 3) at points or nodes."""
        jump = np.zeros((matrices[0].shape[0], 3))
        for i, matrix in enumerate(matrices):
            jump[:, i] = matrix @ unknowns
        return jump

    def residual(self, jump: np.ndarray, memory: Memory, level: float, tail: float, secant: bool = False
                 ) -> tuple[np.ndarray, Callable[[], tuple[np.ndarray, np.ndarray]]]:
        """The residual (j,), and a function that gives its derivatives with jump (j, j) and level (j,)."""
        traction, tangent = self.law.respond(self.jumps(self.at_points, jump), memory, secant)
        load, rate = self.loads(level, tail)
        weights = self.points.weights
        value = self.bulk.stiffness @ jump - load
        for matrix, t in zip(self.at_points, traction.T, strict=False):
            value = value + matrix.T @ (weights * t)
        pressure = by_jump = by_level = None
        if self.flowing:
            pressure, by_jump, by_level = self.solve_flow(jump, level, tail, True)
            value = value - self.lift @ pressure

        def derivatives() -> tuple[np.ndarray, np.ndarray]:
            joint = sum(a.T @ weighted(weights * tangent[:, i, k], b) for i, a in enumerate(self.at_points)
                        for k, b in enumerate(self.at_points) if tangent[:, i, k].any())
            matrix = self.bulk.stiffness + joint
            slope = -rate
            matrix = np.asarray(matrix)
            if self.flowing:
                n = self.normal
                matrix[np.ix_(n, n)] -= self.lift[n] @ by_jump
                slope = slope - self.lift @ by_level
            return matrix, slope

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
        highest, highest_tail = max(case.levels), max(case.tail_levels)
        start = np.zeros(len(bulk.free))
        law, points = self.joint.law, self.joint.points
        self.state = State(0.0, 0.0, start, law.start(len(points.weights)), law.start(len(self.joint.space.place)))
        self.reference = np.linalg.norm(self.joint.residual(start, self.state.memory, highest, highest_tail)[0])
        self.rows, self.tables, self.heel, self.saved = [], [], [], []
        self.displacement = self.left = 0.0

    def run(self) -> Results:
        """Follow all the times of the case."""
        stopped, cuts, dt = False, 0, np.inf
        for target in self.case.times:
            while self.state.time < target and not stopped:
                time = min(self.state.time + dt, target)
                time = target if target - time < 1e-9 else time
                found = next(filter(None, (self.solve(time, *attempt) for attempt in ATTEMPTS)), None)
                if found is None:
                    dt, cuts = CUT * (time - self.state.time), cuts + 1
                    stopped = dt < SMALLEST_STEP
                else:
                    dt = 2 * (time - self.state.time)
                    self.accept(time, cuts, *found)
                    cuts = 0
            if stopped:
                break
            dt = np.inf
            if target in self.case.requested:
                self.save()
        if stopped and self.state.time > 0 and (not self.saved or self.saved[-1][0] < self.state.time):
            self.save()
        return self.results(stopped)

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

    def solve(self, time: float, growth: float, secant: bool) -> tuple | None:
        """Newton from the last state: (jump, level, tail, iterations, residual), or None."""
        joint, memory = self.joint, self.state.memory
        level, tail, prescribed, target = self.water_at(time)
        level = self.state.level if prescribed else level
        jump, limit = self.state.jump, TOLERANCE * self.reference
        stiff = joint.case["K_N"] * joint.width

        def evaluate(jump: np.ndarray, level: float) -> tuple:
            value, derivatives = joint.residual(jump, memory, level, tail, secant)
            if not prescribed:
                return np.linalg.norm(value), value, derivatives, None
            if self.case["drive"] == "heel":
                row, rate, gap = joint.opening_of_heel, 0.0, joint.opening_of_heel @ jump - target
            else:
                found, row, rate = joint.crest(jump, level, tail)
                gap = found - target
            return np.hypot(np.linalg.norm(value), stiff * gap), value, derivatives, (row, rate, gap)

        size, value, derivatives, border = evaluate(jump, level)
        iterations = 0
        while not size <= limit:
            fallen = np.abs(jump).max() > 0.1 * self.case["dam_height"]
            if iterations == MAX_ITERATIONS or not np.isfinite(size) or fallen:
                return None
            matrix, slope = derivatives()
            try:
                if border is None:
                    step, rise = solve(matrix, -value), 0.0
                else:
                    row, rate, gap = border
                    whole = np.block([[matrix, slope[:, None]], [stiff * row[None, :], np.array([[stiff * rate]])]])
                    solution = solve(whole, -np.append(value, stiff * gap))
                    step, rise = solution[:-1], solution[-1]
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
        joint, law = self.joint, self.joint.law
        at_points, at_nodes = joint.jumps(joint.at_points, jump), joint.jumps(joint.at_nodes, jump)
        memory, nodes = law.remember(at_points, self.state.memory), law.remember(at_nodes, self.state.nodes)
        self.state = State(time, level, jump, memory, nodes)
        self.tail = tail
        traction, _ = law.respond(at_points, memory)
        weights, x = joint.points.weights / joint.width, joint.points.positions[:, 0]
        heel = float(joint.opening_of_heel @ jump)
        crest = joint.crest(jump, level, tail)[0]
        self.pressure = joint.solve_flow(jump, level, tail, False)[0] if joint.flowing else None
        flux = self.flux()[1] if joint.flowing else 0.0
        scheduled = self.case.level_at(time)
        self.rows.append((time, level, level / scheduled if scheduled else 1.0, iterations, cuts, residual,
                          weights @ law.open(at_points, memory), weights @ law.slid(at_points, memory), at_nodes[:, 0].max(), crest,
                          -weights @ traction[:, 0], weights @ traction[:, 1], -weights @ (traction[:, 0] * (joint.base - x)), flux))
        self.heel.append(heel)
        if self.driven:
            if time < self.case["drive_begin"] + 1e-9:
                self.displacement = heel if self.case["drive"] == "heel" else crest
            if time < self.case["drive_end"] + 1e-9:
                self.left = level
        self.on_step(time)

    def flux(self) -> tuple[np.ndarray, float]:
        """Mass flux along x: mean of each joint element [kg/(m s)], and out of the toe per metre of thickness."""
        joint, case = self.joint, self.case
        whole = np.zeros(len(joint.bulk.joint.points))
        whole[joint.inside] = self.pressure
        steepness = joint.unit_weight * (self.tail - self.state.level) / joint.base
        aperture = case["aperture_min"] + np.maximum(joint.at_points[0] @ self.state.jump, 0)
        weights, elements = joint.points.weights, joint.points.elements
        conductivity = case["rho_water"] * aperture**3 / (12 * case["visc"])
        if joint.dim == 2:  # the same in every element: the drop over the resistances in series
            lengths = np.bincount(elements, weights)
            total = np.sum(lengths**2 / np.bincount(elements, weights * conductivity))
            flux = -steepness * joint.base / total
            return np.full(len(lengths), flux), flux
        q = -conductivity * (joint.pressure_slopes[0] @ whole + steepness)
        means = np.bincount(elements, weights * q) / np.bincount(elements, weights)
        column = joint.base / case["n_joint"]
        last = joint.points.positions[:, 0] > joint.base - column
        return means, float(np.sum((weights * q)[last]) / column / joint.width)

    def save(self) -> None:
        """The joint at the current state, node by node; and with jump and stress made from element means."""
        joint, law, state = self.joint, self.joint.law, self.state
        place, corners = joint.space.place, len(joint.bulk.joint.points)
        jump = joint.jumps(joint.at_nodes, state.jump)
        traction, _ = law.respond(jump, state.nodes)
        pressure = joint.linear_pressure(place[:, 0], state.level, self.tail) if joint.wet else np.zeros(len(place))
        at_points = joint.jumps(joint.at_points, state.jump)
        stress, _ = law.respond(at_points, state.memory)
        x = joint.points.positions[:, 0]
        beyond = np.zeros(len(x))
        if joint.flowing:
            whole = np.zeros(corners)
            whole[joint.inside] = self.pressure
            pressure = pressure + joint.pressure_middles @ whole
            beyond = fem.points_of(fem.Space(joint.bulk.joint, 1), fem.JOINT[joint.order]).values @ whole
        if joint.wet:
            stress[:, 0] -= joint.linear_pressure(x, state.level, self.tail) + beyond
        traction[:, 0] -= pressure
        columns = [np.full((len(place), 2), (state.time, state.level)), place, jump, traction, pressure[:, None],
                   law.damage(jump, state.nodes)[:, None], np.linalg.norm(state.nodes.vector, axis=1)[:, None]]
        if joint.flowing:
            columns.append(self.node_means(self.flux()[0][:, None], True))
        table = np.hstack(columns)
        weights, elements = joint.points.weights, joint.points.elements
        total = np.bincount(elements, weights)
        means = np.column_stack([np.bincount(elements, weights * v) / total for v in (*at_points.T, *stress.T)])
        extra = table.copy()
        extra[:corners, 5:11] = self.node_means(means, False)
        self.saved.append((state.time, state.jump, state.level, self.tail))
        self.tables.append((table, extra))

    def node_means(self, values: np.ndarray, middles: bool) -> np.ndarray:
        """Mean over the joint elements around each node (and each middle of an edge) of element values (e, m)."""
        space = self.joint.space
        number = len(space.place) if middles else len(space.body.points)
        total, count, start = np.zeros((number, values.shape[1])), np.zeros(number), 0
        for (_, whole), (_, cells) in zip(space.connectivity, space.body.cells, strict=True):
            table = whole if middles else cells
            rows = np.repeat(np.arange(start, start + len(table)), table.shape[1])
            np.add.at(total, table.ravel(), values[rows])
            np.add.at(count, table.ravel(), 1)
            start += len(table)
        return total / count[:, None]

    def results(self, stopped: bool) -> Results:
        """All tables so far."""
        names = JOINT + ("flux",) * self.joint.flowing
        history = dict(zip(HISTORY, np.array(self.rows, float).reshape(-1, len(HISTORY)).T, strict=True))
        stack = lambda k: np.vstack([t[k] for t in self.tables]) if self.tables else np.zeros((0, len(names)))  # noqa: E731
        tables = [dict(zip(names, stack(k).T, strict=True)) for k in (0, 1)]
        return Results(self.case, history, *tables, why_stopped(self.case, history) if stopped else "", np.array(self.heel),
                       self.saved)
