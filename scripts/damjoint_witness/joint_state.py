"""A joint at a time, from its written rows: openings, heads at its ends, pressure."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import meshio
import numpy as np
from scipy.spatial import cKDTree

from .files import Files, Table, rows_where
from .reader import Request, RequestedJoint, Values
from .solids import SHAPES, Array, IntArray, Sides, corners_of, functions, rule

#: Positions of nodes have 9 decimals [m].
SAME_POINT = 1e-7
#: Times that differ by less are the same.
SAME_TIME = 1e-9
#: Aperture of the closed joint with uplift = cracked [m].
CRACK_APERTURE = 1 / 4.5e9
#: Its largest growth over it [-].
CRACK_MOST = 100.0
#: Reynolds number from which flow between smooth plates is turbulent [-].
TURBULENT = (96 / 0.316) ** (4 / 3)


@dataclass(frozen=True)
class JointState(RequestedJoint):
    """A joint at a time: rows of its nodes, its elements, and the openings."""

    rows: Table
    sides: tuple[Sides, ...]
    tail: float
    #: rows of its integration points when the step began; none: undamaged
    before: Table

    @property
    def level(self) -> float:
        """Level of the reservoir [m], with the offset of the joint's heel."""
        return float(self.rows["level"][0]) + float(self.values["joint_head_offset"])

    @cached_property
    def positions(self) -> Array:
        """Positions of the rows (n, 3)."""
        return coordinates(self.rows)

    @cached_property
    def ends(self) -> tuple[Array, Array]:
        """Positions (2,) of heel and toe in the plane of x and y."""
        s = self.rows["s"]
        return self.positions[s.argmin(), :2], self.positions[s.argmax(), :2]

    @cached_property
    def along(self) -> Array:
        """Direction (2,) from heel to toe of a plane joint."""
        heel, toe = self.ends
        return np.asarray((toe - heel) / np.linalg.norm(toe - heel))

    @property
    def length(self) -> float:
        """Distance from heel to toe [m]."""
        return float(np.linalg.norm(self.ends[1] - self.ends[0]))

    def distance(self, positions: Array) -> Array:
        """Return the distance from the heel at positions (q, 3) [m]."""
        return np.asarray((positions[:, :2] - self.ends[0]) @ self.along)

    @property
    def unit_weight(self) -> float:
        """Weight of water [N/m3]."""
        return float(self.values["rho_water"] * self.values["g"])

    def find(self, coordinates: Array) -> IntArray:
        """Return the rows at points (..., 3)."""
        distance, found = map(np.asarray, cKDTree(self.positions).query(coordinates))
        if distance.max(initial=0) > SAME_POINT:
            raise ValueError("joint.csv: a node of the joint's elements has no row")
        return np.asarray(found, int)

    def widening(self) -> list[Array]:
        """Return, of the elements of each shape, the hydraulic aperture over that of the closed
        joint at the points of the law (m, q).
        """
        found, start = [], 0
        for sides in self.sides:
            u, _ = joint_rule(sides.shape, sides.order, self.values["quadrature"])
            at = functions(sides.shape, sides.order, u)
            jump = self.rows["delta_n"][self.find(sides.coordinates)] @ at.T
            opening = np.maximum(jump, 0)
            if self.values["uplift"] == "flow":
                wider = np.maximum(jump + self.values["aperture_elastic"], 0)
                found.append(1 + wider / self.values["aperture_min"])
            elif self.values["uplift"] == "cracked":
                crack = self.crack_opening(start, opening.size).reshape(opening.shape)
                beyond = np.maximum(opening - crack, 0)
                aperture = CRACK_APERTURE * self.values["dam_height"]
                found.append(1 + np.minimum(beyond / aperture, CRACK_MOST))
            else:
                found.append(np.ones_like(opening))
            start += opening.size
        return found

    def slowed(self, cube: Array, slopes: Array) -> Array:
        """Return the flow between smooth plates over that of the cubic law, for the cubes of the
        aperture (m, q) and slopes of the head, of elements (m, 1) or at points (m, q): beyond the
        Reynolds number at which both friction factors are equal, 96/Re and 0.316/Re^(1/4), by the
        second one.
        """
        values = self.values
        gradient = self.unit_weight * np.abs(slopes)
        number = values["rho_water"] * cube * gradient / (6 * values["visc"] ** 2)
        return np.asarray(np.minimum(1.0, (TURBULENT / np.maximum(number, 1)) ** (3 / 7)))

    def crack_opening(self, start: int, number: int) -> Array:
        """Return the opening [m] beyond which integration points (start, ...) are cracked: what had
        broken before the step lets the water in.
        """
        values, f_t = self.values, float(self.values["sigma_max"])
        damage = self.before["damage"][start : start + number]
        damage = damage if len(damage) else np.zeros(number)
        if values["law"] == "friction":
            return np.full(number, values["adhesion"] / values["mu"] / values["K_N"])
        softened = 2 * values["G_f"] / f_t if f_t else 0.0
        if values["law"] == "rupture":
            softened = (1 + values["pena_rupture"]) * f_t / values["K_N"]
        if values["law"] == "endo":
            return np.full(number, softened)
        cracked = 1 - np.exp(-2) if values["softening"] == "exponential" else 1.0
        return np.where(damage >= cracked, 0.0, softened)


@cache
def joint_rule(shape: str, order: int, quadrature: str) -> tuple[Array, Array]:
    """Reference points (q, d) and weights (q,) of the joint law: as many as integrate the square of
    the jump, or those of the published elements.
    """
    if shape == "triangle":
        if order == 2:
            return rule("triangle")
        if quadrature == "published":
            return np.full((1, 2), 1 / 3), np.array([0.5])
        return np.array([[1, 1], [4, 1], [1, 4]]) / 6, np.full(3, 1 / 6)
    x, w = np.polynomial.legendre.leggauss(2 if quadrature == "published" else order + 1)
    if shape == "line":
        return x[:, None], w
    return np.array([(a, b) for a in x for b in x]), np.outer(w, w).ravel()


def sides_of(files: Files, request: Request, number: int, rows: Table) -> tuple[Sides, ...]:
    """Return the elements of a joint: in 2D between its nodes along it, in 3D those of the file
    fields/joint_t*.vtu, joint_2_t*.vtu, ...
    """
    order = int(request.joints[0]["order"])
    if request.joints[0]["dim"] == 2:
        by_s = np.argsort(rows["s"])[::order]
        corners = np.column_stack([rows[name][by_s] for name in "xyz"])
        return (Sides("line", np.stack([corners[:-1], corners[1:]], axis=1), order),)
    name = f"joint_{number + 1}_t*.vtu" if number else "joint_t*.vtu"
    mesh: Any = meshio.read(next((files.folder / "fields").glob(name)))
    tables = [corners_of(block)[1] for block in mesh.cells]
    return tuple(Sides(SHAPES[t.shape[1]], mesh.points[t], order) for t in tables)


#: Head [m] at positions (q, 3).
Heads = Callable[[Array], Array]


def heads_at_ends(
    heel: float, toe: float, level: float, tail: float, flowing: bool
) -> tuple[float, float]:
    """Return the heads [m] at heel and toe of these heights. A dry end has its own elevation; water
    that flows does not enter there: a lower head on the other side holds here, too.
    """
    if level <= heel and tail <= toe:
        rest = min(heel, toe, max(level, tail))
        return rest, rest
    first = level if level > heel else min(heel, tail) if flowing else heel
    last = tail if tail > toe else min(toe, level) if flowing else toe
    return first, last


def line_over_drains(joint: JointState) -> tuple[list[float], list[float]]:
    """Return positions [m from the heel] and heads [m] of uplift = imposed or drained."""
    values, length = joint.values, joint.length
    heel, toe = (float(end[1]) for end in joint.ends)
    first, last = heads_at_ends(heel, toe, joint.level, joint.tail, flowing=False)
    if values["uplift"] != "drained":
        return [0, length], [first, last]
    at = values["drain_x"]
    undrained = first + (last - first) * at / length
    if values["drain_reference"] == "reservoir":
        undrained = first
    outlet = max(values["drain_level"], joint.tail, joint.ends[0][1] + at * joint.along[1])
    drained = undrained - values["drain_effectiveness"] * max(undrained - outlet, 0)
    return [0, at, length], [first, drained, last]


def pressure(joint: JointState, heads: Heads, least: float = 0.0) -> Callable[[Array], Array]:
    """Return the pressure [Pa] at positions (q, 3) from the head there; least: where voids form."""
    values = joint.values

    def at(positions: Array) -> Array:
        if values["uplift"] == "none":
            return np.zeros(len(positions))
        full = np.maximum(joint.unit_weight * (heads(positions) - positions[:, 1]), least)
        if values["uplift"] != "waterstop":
            return np.asarray(full)
        stop = values["waterstop"]
        return np.asarray(full * (joint.distance(positions) <= stop + SAME_POINT) * (stop > 0))

    return at


def states(
    files: Files, request: Request, steps: Table
) -> Iterator[tuple[float, list[JointState]]]:
    """Yield at each requested time the number of its update and the joints."""
    for table in files.joint_tables:
        still = rows_where(steps, steps["earthquake"] == 0)
        update = update_at(still, table["time"][0], table["level"][0])
        tail = float(steps["tail_level"][steps["update"] == update][0])
        joints = []
        for k in range(len(request.joints)):
            opened, softened = water_follows(request.joints[k], steps, update)
            now, then = (
                rows_where(steps, (steps["update"] == number) & (steps["joint"] == k + 1))
                for number in (update, opened)
            )
            rows = with_all_digits(rows_where(table, table["joint"] == k + 1), now, then)
            sides = sides_of(files, request, k, rows)
            before = rows_where(steps, (steps["update"] == softened) & (steps["joint"] == k + 1))
            before = rows_where(before, before["weight"] > 0)
            joints.append(JointState(request, k, rows, sides, tail, before))
        yield update, joints


def water_follows(values: Values, steps: Table, update: float) -> tuple[float, float]:
    """Return the numbers of the updates whose openings and whose damage the water of an update
    follows: its own and the one before; in a pseudo-static earthquake with quake_uplift = unchanged
    the last one before it.
    """
    last = 1 - values["quake_t"]
    acts = bool(values["k_h"] or values["k_v"]) and values["quake_uplift"] == "unchanged"
    time = float(steps["time"][steps["update"] == update][0])
    if not acts or time + last <= 0:
        return update, update - 1
    earlier = float(steps["update"][steps["time"] + last <= SAME_TIME].max(initial=0))
    return earlier, earlier


def with_all_digits(rows: Table, now: Table, opened: Table) -> Table:
    """Return rows of a joint with the coordinates of the nodes in steps.csv, and with the openings
    that the water follows; none: closed.
    """
    nodes, then = (rows_where(table, table["weight"] == 0) for table in (now, opened))
    found = np.asarray(cKDTree(coordinates(nodes)).query(coordinates(rows))[1])
    exact = rows | {name: nodes[name][found] for name in "xyz"}
    openings = then["delta_n"][found] if len(then["delta_n"]) else np.zeros(len(found))
    return exact | {"delta_n": openings}


def coordinates(table: Table) -> Array:
    """Return the positions (n, 3) of rows."""
    return np.column_stack([table[name] for name in "xyz"])


def update_at(steps: Table, time: float, level: float) -> float:
    """Return the number of the last update at a time and level, which a table has with 12 digits.
    Points of an equilibrium path have the time of their step's end: they are found by the level.
    """
    by_level = np.abs(steps["level"] - level) <= SAME_TIME * max(abs(level), 1)
    exact = by_level & (np.abs(steps["time"] - time) <= SAME_TIME * max(time, 1))
    return float(steps["update"][exact if exact.any() else by_level].max())


def is_stored(request: Request, time: float) -> bool:
    """Whether water flows in time, see water_in_time, in the step to a time of the static loads."""
    first = request.joints[0]
    return bool(first["time_unit"] and time > first["time_start"])
