"""Displacement jumps of the bodies, by scikit-fem, under their loads and the joints' tractions.

Each body of the mesh, from its file in fields/, is loaded by its weight, water and silt on its
faces, forces on lines, temperature, and by the tractions at the integration points in steps.csv
with the water in the joints. The displacements of a body above a joint are known up to a rigid
motion: those that fit the jumps best are added. Then the difference of the displacements on both
sides of a joint is its written jump.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .body_loads import Face, Liquid, Loads, faces_between
from .files import Files, Table, rows_where
from .finite_elements import Stiffness
from .joint_state import Heads, JointState, coordinates, pressure
from .joint_state import states as joint_states
from .network import heads_of
from .reader import Point, Request, Values, section_above_base
from .solids import (
    ROCK,
    SAME,
    SHAPES,
    Array,
    IntArray,
    Points,
    Sides,
    Solid,
    on_segment,
    read_solids,
)
from .water_in_time import heads_in_time

#: Rounding of a jump over the largest jump or displacement at the joints. What is more must be the
#: residual of the step: the forces in the joints that move the bodies by the difference, over those
#: that close the joints, are the residual, but that history.csv has it over the loads of the
#: highest level (0.25 to 2.4 of it in 12 steps of random dams 112-20 to 112-30). By the jumps
#: alone there is no bound: where stiff rock holds a joint, its displacements are small beside what
#: a force does to the concrete.
ROUNDING, SAME_RESIDUAL = 1e-10, 10.0
#: Sum of forces and moments on a body: the residual times OF_RESIDUAL, over the sizes of the forces
#: on the body that has the most, as it is one of the whole dam, and ROUNDING, over those on itself.
OF_RESIDUAL = 200.0
#: The waterline is raised, for the shape of the pressure only, by RAISE of a face's height until
#: force and lever can be distinguished: m_0 m_2 - m_1^2 > DISTINCT m_1^2.
DISTINCT, RAISE = 1e-3, 0.01


@dataclass(frozen=True)
class Dam:
    """The bodies of a scene, on one mesh."""

    request: Request
    solids: dict[str, Solid]
    #: bodies above and below each joint, and the positions of its nodes
    joints: tuple[tuple[str, str], ...]
    nodes: tuple[Array, ...]

    @property
    def values(self) -> Values:
        """Parameters of the first joint, which are those of bodies and loads."""
        return self.request.joints[0]

    @property
    def dim(self) -> int:
        """Dimension."""
        return int(self.values["dim"])

    @cached_property
    def bodies(self) -> dict[str, Stiffness]:
        """Finite elements of the bodies, by name."""
        v = self.values
        concrete, rock = (v["E_dam"], v["nu_dam"]), (v["E_found"], v["nu_found"])
        found = {}
        for name, solid in self.solids.items():
            regions = {region for _, _, region in solid.cells}
            material = {region: rock if region == ROCK else concrete for region in regions}
            found[name] = Stiffness(solid, self.dim, int(v["order"]), material)
        return found

    def held(self, name: str) -> NDArray[np.bool_]:
        """Return which degrees of freedom of a body are held: bottom and ends of the rock, with
        hold_z the end faces along z.
        """
        v, body = self.values, self.bodies[name]
        x, y, z = body.coordinates.T
        small = SAME * body.solid.size
        held = np.zeros((len(x), body.dim), bool)
        if name == "foundation":
            held[(x < x.min() + small) | (x > x.max() - small) | (y < y.min() + small)] = True
        if body.dim == 3 and v["hold_z"]:
            held[(z < z.min() + small) | (z > z.max() - small), 2] = True
        return held.ravel()

    @cached_property
    def solvers(self) -> dict[str, Callable[[Array], tuple[Array, float]]]:
        """Solution of each body for its forces."""
        return {
            name: body.solver(self.held(name), name != "foundation")
            for name, body in self.bodies.items()
        }

    @cached_property
    def sides(self) -> list[tuple[str, IntArray]]:
        """The bodies above and below each joint, and their degrees of freedom at its nodes."""
        sides = []
        for nodes, names in zip(self.nodes, self.joints, strict=True):
            for name in names:
                at = self.bodies[name].find(nodes)
                sides.append((name, (self.dim * at[:, None] + np.arange(self.dim)).ravel()))
        return sides

    @cached_property
    def compliance(self) -> Array:
        """The jumps (m, m) of unit forces that part the joints."""
        above, below = self.sides[::2], self.sides[1::2]
        count = sum(len(dofs) for _, dofs in above)
        moved = {name: np.zeros((len(self.held(name)), count)) for name in self.bodies}
        i = 0
        for (upper, upper_dofs), (lower, lower_dofs) in zip(above, below, strict=True):
            for pair in zip(upper_dofs, lower_dofs, strict=True):
                for name, dof, sign in zip((upper, lower), pair, (1, -1), strict=True):
                    force = np.zeros(len(moved[name]))
                    force[dof] = sign
                    moved[name][:, i] += self.solvers[name](force)[0]
                i += 1
        rows = [moved[name][dofs] for name, dofs in self.sides]
        return np.concatenate(rows[::2]) - np.concatenate(rows[1::2])

    # -- loads

    def loads_on(self, name: str, loads: Loads) -> Array:
        """Return the forces of all loads on a body but those in the joints."""
        v, body = self.values, self.bodies[name]
        quake = loads.part("quake")
        concrete = v["rho_dam"] * v["g"] * np.array([v["k_h"] * quake, v["k_v"] * quake - 1, 0])
        rock = np.array([0, 0 if v["in_situ"] else -v["rho_found"] * v["g"], 0])
        heat = any(v[f"temperature_{part}"] for part in ("dam", "linear", "found"))

        def by_region(region: int) -> tuple[Array, Callable[[Any], Any]]:
            weight = rock if region == ROCK else concrete
            strain = loads.strain(region) if heat else lambda x: 0 * x[0]
            return weight[: body.dim], strain

        total = body.volume_load(by_region)
        for face in self.faces:
            for sides in body.solid.sides_where(self.on(face.foot, face.top), body.order):
                total += self.on_face(body, sides, face, loads)
        for sides, depth in self.level_faces(body, loads):
            weight = v["rho_water"] * v["g"] * depth
            total += body.side_load(sides, [0.0, -weight, 0.0])
        for point, force in loads.lines().values():
            total += self.on_line(body, point, force)
        return total

    def on(self, start: Point, end: Point) -> Callable[[Array], NDArray[np.bool_]]:
        """Return the condition that a point lies between two of the section."""
        return on_segment(start, end, SAME * self.solids["foundation"].size)

    @cached_property
    def faces(self) -> list[Face]:
        """The straight faces of the concrete that water can load, each of one body."""
        if self.request.geometry:
            return [Face(foot, top, True) for foot, top in UPSTREAM[self.request.case]]
        whole, sections = section_above_base(self.values), self.request.sections
        return [
            *faces_between(whole.upstream, [s.heel[1] for s in sections], True),
            *faces_between(whole.downstream, [s.toe[1] for s in sections], False),
        ]

    def level_faces(self, body: Stiffness, loads: Loads) -> Iterator[tuple[Sides, float]]:
        """Yield level faces of a body under water, and its depth above them: the crest, with
        floor_water the reservoir's floor and the bed of the tailwater; uniform: as if at y = 0.
        """
        v = self.values
        uniform = v["face_load"] == "uniform"
        if self.request.geometry:
            return
        whole = section_above_base(v)
        (x1, _), (x0, y) = whole.crest
        on_crest = v["crest_water"] and v["face_load"] == "hydrostatic"
        edges = [((x0, y), (x1, y), loads.level)] if on_crest else []
        if v["floor_water"]:
            (base, toe_y), far = whole.toe, v["found_side"]
            edges += [((-far, 0.0), (0.0, 0.0), loads.level)]
            edges += [((base, toe_y), (base + far, toe_y), loads.tail)]
        for start, end, level in edges:
            if (depth := level - (0.0 if uniform else start[1])) > 0:
                for sides in body.solid.sides_where(self.on(start, end), body.order):
                    yield sides, depth

    def on_face(self, body: Stiffness, sides: Sides, face: Face, loads: Loads) -> Array:
        """Return the forces of water, upstream also of silt, on a straight face of a body."""
        v = self.values
        water = loads.reservoir if face.upstream else Liquid(loads.tail)
        weight = v["rho_water"] * v["g"]
        if v["face_load"] == "uniform":
            return body.side_load(sides, -weight * water.level * face.normal)
        total = weight * self.press(body, sides, face, water)
        silt = loads.part("silt") if face.upstream else 0.0
        if silt and v["silt_height"]:
            weight = silt * v["rho_silt"] * v["g"]
            axes = [weight * v["silt_K0"], weight * v["silt_weight"], 0.0][: body.dim]
            pressed = self.press(body, sides, face, Liquid(v["silt_height"]))
            total += (pressed.reshape(-1, body.dim) * axes).ravel()
        return total

    def press(self, body: Stiffness, sides: Sides, face: Face, liquid: Liquid) -> Array:
        """Return the forces of a pressure [m]: its force and moment are exact by a factor that is
        linear in the height; in a geometry by a mesh, by integration of the wet part.
        """
        low, high = face.foot[1], face.top[1]
        if liquid.level <= low:
            return np.zeros(body.dim * len(body.coordinates))
        if self.request.geometry:
            return self.press_wet_part(body, sides, face, liquid)
        points, tilt = sides.points(), abs(face.normal[0])
        y, w = points.positions[:, 1], points.weights
        stretch = w.sum() / face.rise
        force, moment = (stretch * part for part in liquid.resultant(low, high, tilt))
        level = liquid.level
        while True:
            shape = liquid.height(level, y, tilt)
            m0, m1, m2 = (float(w @ (shape * (y - low) ** k)) for k in range(3))
            determinant = m0 * m2 - m1**2
            if determinant > DISTINCT * m1**2 or level > high:
                break
            level = max(level, low) + RAISE * face.rise
        b = (m0 * moment - m1 * force) / determinant
        a = (force - b * m1) / m0
        pressure = shape * (a + b * (y - low))
        return body.forces(sides, points, -pressure[:, None] * face.normal)

    def press_wet_part(self, body: Stiffness, sides: Sides, face: Face, liquid: Liquid) -> Array:
        """Return the forces of a pressure [m] below its surface, in 2D."""
        total = np.zeros(body.dim * len(body.coordinates))
        for corners in sides.corners:
            one = Sides(sides.shape, corners[None], sides.order)
            y0, y1 = corners[:, 1]
            if min(y0, y1) >= liquid.level:
                continue
            points = one.points()
            if max(y0, y1) > liquid.level:
                share = (liquid.level - min(y0, y1)) / abs(y1 - y0)
                low = corners[np.argmin(corners[:, 1])]
                wet = low + share * (corners - low)
                inner = Sides(sides.shape, wet[None], sides.order).points()
                points = one.at(inner.positions, inner.weights)
            pressure = liquid.height(liquid.level, points.positions[:, 1], abs(face.normal[0]))
            total += body.forces(one, points, -pressure[:, None] * face.normal)
        return total

    def on_line(self, body: Stiffness, point: Point, force: Array) -> Array:
        """Return the forces of a force per metre on a line along z at a point of a body's surface,
        where the mesh has nodes.
        """
        total = np.zeros((len(body.coordinates), body.dim))
        away = np.linalg.norm(body.coordinates[:, :2] - point, axis=1)
        nodes = np.flatnonzero(away < SAME * self.solids["foundation"].size)
        if body.dim == 2:
            total[nodes, :2] = force
        elif len(nodes):
            nodes = nodes[np.argsort(body.coordinates[nodes, 2])]
            ends = body.coordinates[nodes[:: body.order]]
            sides = Sides("line", np.stack([ends[:-1], ends[1:]], axis=1), body.order)
            return body.side_load(sides, [*force, 0.0])
        return np.asarray(total.ravel(), float)


#: Upstream faces of the geometries by a mesh: monoliths.geo.
UPSTREAM: dict[str, list[tuple[Point, Point]]] = {"monoliths": [((0.0, 0.0), (0.0, 45.0))]}


@dataclass(frozen=True)
class JointForces:
    """A joint at a time: its elements, rows of its nodes and integration points."""

    state: JointState
    heads: Heads
    nodes: Table
    points: Table
    #: pressure [Pa] at which voids form in the water
    least: float = 0.0

    @cached_property
    def frame(self) -> Array:
        """Normal and tangents (3, 3) in rows: from the body below to that above, downstream,
        their product.
        """
        x, y = self.state.along
        normal, tangent = np.array([-y, x, 0.0]), np.array([x, y, 0.0])
        return np.array([normal, tangent, np.cross(tangent, normal)])

    def jumps(self, table: Table) -> Array:
        """Return the jumps (n, 3) along x, y, z of rows."""
        return np.column_stack([table[f"delta_{k}"] for k in ("n", "t1", "t2")]) @ self.frame

    def forces(self, body: Stiffness) -> Array:
        """Return the forces of tractions and water on a body above the joint."""
        (sides,) = self.state.sides
        wet = wet_points(self.state, sides)
        p = pressure(self.state, self.heads, self.least)(wet.positions)
        return self.tractions(body) + body.forces(sides, wet, p[:, None] * self.frame[0])

    def tractions(self, body: Stiffness) -> Array:
        """Return the forces of the tractions on a body above the joint."""
        table = self.points
        traction = np.column_stack([table[k] for k in ("sigma_n_eff", "tau_1", "tau_2")])
        positions = coordinates(table)
        width = float(np.ptp(coordinates(self.nodes)[:, 2])) if body.dim == 3 else 1.0
        (sides,) = self.state.sides
        at = sides.at(positions, width * table["weight"])
        return -body.forces(sides, at, traction @ self.frame)


def wet_points(state: JointState, sides: Sides) -> Points:
    """Return the quadrature of the water in a joint: of elements that a waterstop cuts, over their
    wet part.
    """
    points, stop = sides.points(), state.values["waterstop"]
    if state.values["uplift"] != "waterstop":
        return points
    positions, weights = [np.zeros((0, 3))], [np.zeros(0)]
    for corners in sides.corners:
        for part in wet_parts(corners, state.distance(corners) - stop):
            inner = Sides(SHAPES[len(part)], part[None], 1).points()
            positions.append(inner.positions)
            weights.append(inner.weights)
    return sides.at(np.concatenate(positions), np.concatenate(weights))


def wet_parts(corners: Array, beyond: Array) -> list[Array]:
    """Return the part of an element where a linear function of its corners (n,) is negative: the
    element itself, a part of a line, a rectangle, or triangles.
    """
    if beyond.min() >= 0:
        return []
    if beyond.max() <= 0:
        return [corners]
    if len(corners) != 3:  # shortened along the joint
        share = beyond.min() / np.ptp(beyond)
        ends = corners[beyond <= beyond.min() + SAME], corners[beyond >= beyond.max() - SAME]
        along = ends[1].mean(axis=0) - ends[0].mean(axis=0)
        far = (beyond > (beyond.min() + beyond.max()) / 2)[:, None]
        return [corners - far * (1 + share) * along]
    polygon = []
    for i, k in ((0, 1), (1, 2), (2, 0)):
        if beyond[i] <= 0:
            polygon.append(corners[i])
        if beyond[i] * beyond[k] < 0:
            share = beyond[i] / (beyond[i] - beyond[k])
            polygon.append(corners[i] + share * (corners[k] - corners[i]))
    return [np.array([polygon[0], *polygon[i : i + 2]]) for i in range(1, len(polygon) - 1)]


def violations(files: Files, request: Request, steps: Table) -> Iterator[str]:
    """Yield where the jumps differ from those of the bodies under their loads and the tractions."""
    names = [(j["upper"], j["lower"]) for j in files.record["joints"]] or [("dam", "foundation")]
    written = list(written_states(files, request, steps))
    if written:
        nodes = tuple(coordinates(joint.nodes) for joint in written[0][0])
        dam = Dam(request, read_solids(files.folder / "fields"), tuple(names), nodes)
    for joints, loads, residual in written:
        yield from jumps_at(dam, joints, loads, residual)


def written_states(
    files: Files, request: Request, steps: Table
) -> Iterator[tuple[list[JointForces], Loads, float]]:
    """Yield the joints, the loads and the residual of each state whose tables are written."""
    in_time = heads_in_time(files, request, steps)
    for update, states in joint_states(files, request, steps):
        rows = rows_where(steps, steps["update"] == update)
        joints, stored = [], in_time.get(update, {})
        for joint, steady in zip(states, heads_of(states), strict=True):
            heads = stored.get(joint.number, steady)
            least = joint.values["pressure_min"] if joint.number in stored else 0.0
            table = rows_where(rows, rows["joint"] == joint.number + 1)
            nodes, points = (rows_where(table, (table["weight"] > 0) == w) for w in (False, True))
            joints.append(JointForces(joint, heads, nodes, points, least))
        time, level, tail = (float(rows[name][0]) for name in ("time", "level", "tail_level"))
        residual = residual_at(files, float(states[0].rows["time"][0]))
        yield joints, Loads(request, time, level, tail), residual


def residual_at(files: Files, time: float) -> float:
    """Return the residual of the step at a time."""
    history = files.history
    return float(history["residual"][np.argmin(np.abs(history["time"] - time))])


def jumps_at(
    dam: Dam, joints: Sequence[JointForces], loads: Loads, residual: float
) -> Iterator[str]:
    """Yield where the jumps at a time differ."""
    forces = {name: dam.loads_on(name, loads) for name in dam.bodies}
    for joint, (upper, lower) in zip(joints, dam.joints, strict=True):
        forces[upper] += joint.forces(dam.bodies[upper])
        forces[lower] -= joint.forces(dam.bodies[lower])
    found = {name: dam.solvers[name](force) for name, force in forces.items()}
    sizes = {name: float(np.abs(force).sum()) for name, force in forces.items()}
    for name, (_, imbalance) in found.items():
        most = OF_RESIDUAL * residual * max(sizes.values()) + ROUNDING * sizes[name]
        if name != "foundation" and imbalance > most:
            part = imbalance / sizes[name]
            yield f"{name} out of balance by {part:.3g} of its forces at t = {loads.time:g}"
    fit = Fit.of(dam, joints, {name: u for name, (u, _) in found.items()})
    if fit.error > ROUNDING * fit.scale:
        part = out_of_balance(dam, joints, fit)
        if part > SAME_RESIDUAL * residual:
            off = f"{fit.error:.3g} m, {fit.error / fit.scale:.3g} of the largest, by {part:.3g}"
            yield f"jumps off by {off} of the forces from the bodies' at t = {loads.time:g}"


@dataclass(frozen=True)
class Fit:
    """What displacements of the bodies, with the rigid motions that fit best, leave of the written
    jumps.
    """

    #: the written jumps, and what is left of them (m,), the jumps of the rigid motions (m, c)
    written: Array
    left: Array
    motions: Array
    #: largest jump or displacement at a joint [m]
    scale: float

    @property
    def error(self) -> float:
        """Largest difference [m]."""
        return float(np.abs(self.left).max())

    @staticmethod
    def of(dam: Dam, joints: Sequence[JointForces], displacements: dict[str, Array]) -> Fit:
        """Fit displacements by name of the body."""
        motions = {
            name: body.rigid_motions(dam.held(name))
            for name, body in dam.bodies.items()
            if name != "foundation"
        }
        ends = dict(zip(motions, np.cumsum([m.shape[1] for m in motions.values()]), strict=True))
        columns = sum(m.shape[1] for m in motions.values())
        sides = []
        for name, dofs in dam.sides:
            moved = np.zeros((len(dofs), columns))
            if name in motions:
                first = ends[name] - motions[name].shape[1]
                moved[:, first : ends[name]] = motions[name][dofs]
            sides.append((displacements[name][dofs], moved))
        above, below = sides[::2], sides[1::2]
        matrix = np.concatenate([a[1] - b[1] for a, b in zip(above, below, strict=True)])
        elastic = np.concatenate([a[0] - b[0] for a, b in zip(above, below, strict=True)])
        written = [joint.jumps(joint.nodes)[:, : dam.dim].ravel() for joint in joints]
        right = np.concatenate(written) - elastic
        fit = np.linalg.lstsq(matrix, right, rcond=None)[0]
        largest = max(float(np.abs(elastic + moved @ fit).max()) for elastic, moved in sides)
        largest = max(largest, *(float(np.abs(jumps).max()) for jumps in written))
        return Fit(np.concatenate(written), right - matrix @ fit, matrix, largest)


def out_of_balance(dam: Dam, joints: Sequence[JointForces], fit: Fit) -> float:
    """Return the norm of the nodal forces in the joints that move the bodies by what is left of the
    jumps, over the norm of those that close the joints, as the residual is defined.
    """
    compliance, count = dam.compliance, len(fit.left)
    size, rigid = np.abs(compliance).max(), fit.motions
    system = np.block([[compliance / size, rigid], [rigid.T, np.zeros((rigid.shape[1],) * 2)]])
    right = np.zeros((len(system), 2))
    right[:count] = np.column_stack([fit.left, fit.written]) / size
    forces = np.linalg.lstsq(system, right, rcond=None)[0][:count]
    tractions = [
        joint.tractions(dam.bodies[name])[dofs]
        for joint, (name, dofs) in zip(joints, dam.sides[::2], strict=True)
    ]
    closing = forces[:, 1] - np.concatenate(tractions)
    return float(np.linalg.norm(forces[:, 0]) / np.linalg.norm(closing))
