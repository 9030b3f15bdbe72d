"""The shapes of a scene in plain numbers: bodies, water, silt, forces, joints with their states and
cracks, drains, resultants, and the texts of their labels.

matplotlib draws them at one time (section_picture, check_picture), Gmsh at all times of a run
(gui/shapes.py). Displaced shapes are exaggerated by a common factor.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from contourpy import FillType, contour_generator

from .. import ROUND_OFF
from ..arrays import Array, IntArray, Table
from ..input.case import Case
from ..input.parameters import constants
from ..input.scene import BED, DOWN, FLOOR, LINES, POINT, SIDES, TOP, UP
from ..mesh.body import Body
from ..model.fields import BROKEN, Field, distance, joint_body, joint_states, nearest_rows
from ..model.loads import COMPLETE, Loading, line_forces, thermal_strains
from ..model.results import Results
from ..statics import gravity
from ..units import FORCES, STRESSES, with_unit
from .outline import Section, area_between, exaggeration, joint_lines, section_outline, skin

#: Sides of a section below water: of the reservoir, of water on the crest, of the tailwater.
RESERVOIR, OVER, TAIL = (UP, FLOOR), (TOP,), (BED, DOWN)
#: Name of the earthquake among the forces, and its coefficients along x and y.
QUAKE, COEFFICIENTS = "earthquake", ("k_h", "k_v")
#: Places of the middle third over the length of the joint.
MIDDLE = np.linspace(1 / 3, 2 / 3, 11)
#: Arrows of a uniform pressure: places along the face, away from its ends.
PRESSED = np.linspace(0.04, 0.96, 9)
#: Bodies above and below a single joint.
BODIES = "dam", "foundation"

#: Edges (n, 2, 2) [m] of the faces of a section by side.
Faces = Mapping[str, Array]


def undeformed_faces(case: Case) -> Faces:
    """The faces of a section by parameters."""
    section = case.section
    ends = [[section["seg_x0"], section["seg_y0"]], [section["seg_x1"], section["seg_y1"]]]
    edges = np.array(ends).transpose(2, 0, 1)
    return {name: edges[np.equal(section["seg_side"], k)] for k, name in enumerate(SIDES)}


def displaced_faces(section: Section) -> Faces:
    """The faces of a section of the displaced mesh; the ground reaches a dam that slipped."""
    up, down = section.upstream, section.downstream
    floor, bed = np.vstack([up[-1:], section.floor]), np.vstack([section.bed, down[:1]])
    lines = {UP: up, DOWN: down, TOP: section.crest, FLOOR: floor, BED: bed}
    return {name: np.stack([line[:-1], line[1:]], axis=1) for name, line in lines.items()}


def fluid_above(edges: Array, level: float) -> Array:
    """Quadrangles (n, 4, 2) between edges (n, 2, 2) and a level; without area if it is below."""
    order = np.argsort(edges[:, :, 1:], axis=1, kind="stable")
    low, high = np.take_along_axis(edges, order, axis=1).transpose(1, 0, 2)
    rise, wet = high[:, 1] - low[:, 1], level > low[:, 1]
    share = np.divide(level - low[:, 1], rise, out=np.ones(len(rise)), where=rise > 0)
    end = low + (share.clip(0, 1) * wet)[:, None] * (high - low)
    surface = [np.column_stack([at[:, 0], np.where(wet, level, at[:, 1])]) for at in (end, low)]
    return np.stack([low, end, *surface], axis=1)


def fluids(case: Case, faces: Faces, loading: Loading, undeformed: Faces) -> dict[str, Array]:
    """Quadrangles (n, 4, 2) of water and silt above the faces of a section.

    Faces that are above a level when undeformed stay dry: the displacement is exaggerated.
    """

    def fill(sides: Sequence[str], level: float) -> Array:
        edges, before = (np.concatenate([f[side] for side in sides]) for f in (faces, undeformed))
        return fluid_above(edges, level if level > before[:, :, 1].min() else -np.inf)

    on_crest = loading.level if case["crest_water"] else -np.inf
    silt = case["silt_height"] if loading.part("silt") else -np.inf
    water = fill(RESERVOIR, loading.level), fill(OVER, on_crest), fill(TAIL, loading.tail)
    return {"water": np.concatenate(water), "silt": fill(RESERVOIR, silt)}


def forces_on(case: Case, loading: Loading) -> dict[str, Array]:
    """Line forces (2,) [N/m] at a loading and the earthquake's coefficients, by name; also 0."""
    forces = {name: np.array(force) for name, force in line_forces(case, loading).items()}
    inertia = np.array([case[name] for name in COEFFICIENTS])
    return forces | ({QUAKE: loading.part("quake") * inertia} if inertia.any() else {})


def force_label(name: str, force: Array) -> str:
    """Name and size of a line force (2,) [N/m], of an earthquake its coefficients; empty: zero."""
    if name == QUAKE:
        return ", ".join(f"{n} = {v:.3g}" for n, v in zip(COEFFICIENTS, force, strict=True) if v)
    return f"{name} {with_unit(math.hypot(*force), FORCES, 3)}" if force.any() else ""


def resultant_label(name: str, state: Mapping[str, float]) -> str:
    """Magnitude and place of the effective resultant on a joint, from its row of the history."""
    which = f"on {name}:" if name else "resultant"
    size = with_unit(math.hypot(state["N"], state["T"]), FORCES[:1], 3)
    return f"{which} {size}, {state['x_resultant']:.3g} m from heel"


def loads_label(case: Case, loading: Loading) -> str:
    """The loads that act, as text: weight, levels, uplift, silt, forces, earthquake."""
    water = [("water", loading.level), ("tailwater", loading.tail)]
    water += [("silt", case["silt_height"] * (loading.part("silt") > 0))]
    named = (f"{name} {level_label(height)}" for name, height in water if height > 0)
    forces = (force_label(name, force) for name, force in forces_on(case, loading).items())
    uplift = f"uplift {case.of_all_joints('uplift')}"
    return ", ".join(["weight", *named, uplift, *filter(None, forces)])


def grown_label(case: Case, before: Loading, now: Loading) -> str:
    """The loads besides water that have changed between two loadings."""
    steps = [forces_on(case, loading) for loading in (before, now)]
    changed = [n for n in steps[1] if not np.array_equal(steps[0][n], steps[1][n])]
    labels = [force_label(name, steps[1][name]) or f"no {name}" for name in changed]
    staged = [n for n in ("silt", "temperature") if before.part(n) != now.part(n)]
    used = {"silt": case["silt_height"], "temperature": bool(thermal_strains(case, COMPLETE))}
    return ", ".join([*labels, *(name for name in staged if used[name])])


def state_label(case: Case, state: Mapping[str, float]) -> str:
    """Resultants, safety factor and place of N on a joint, from its case and row of the history."""
    forces = [
        f"{n} {with_unit(state[c], FORCES[:1], 3)}"
        for n, c in (("N'", "N"), ("T", "T"), ("U", "U"))
    ]
    factor = gravity.sliding_factor(case, state["N"], state["T"], state["bonded_length"])
    known = case.law.has_friction and np.isfinite(factor)
    where = gravity.position(state["x_resultant"], case.joint_length)
    acting = (
        f"N' at {state['x_resultant']:.3g} m: {where}" if np.isfinite(state["x_resultant"]) else ""
    )
    label = ", ".join(filter(None, [*forces, f"SSF {factor:.3g}" if known else "", acting]))
    plain = case["factor_mu"] == case["factor_c"] == 1
    if case["law"] == "bond" and case["sigma_max"] > 0 and plain and float(f"{factor:.3g}") < 1:
        label += " (below 1 in equilibrium: tension in the joint lowers N', but no friction)"
    return label


def level_label(level: float) -> str:
    """Level of a water surface."""
    return f"{level:.4g} m"


def arrow(tip: Array, force: Array, length: float) -> Array:
    """Lines (3, 2, 3) of an arrow that ends at tip (3,), along a force (2,); a point if it is 0.
    The first one is its shaft, from the tail.
    """
    x, y = force / (np.hypot(*force) or 1.0)
    behind = length * np.array([(x, y, 0), (x + y / 2, y - x / 2, 0), (x - y / 2, y + x / 2, 0)])
    behind[1:] /= 4  # the barbs
    return np.stack([tip - behind, np.broadcast_to(tip, (3, 3))], axis=1)


def pressed(edges: Array) -> tuple[Array, Array]:
    """Tips (n, 2) of the arrows of a uniform pressure on a face and their direction (2,), inwards;
    edges: of the face, the body on the left of their directions.
    """
    corners = np.concatenate([edges[:, 0], edges[-1:, 1]])
    along = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    tips = np.column_stack([np.interp(PRESSED * along[-1], along, axis) for axis in corners.T])
    dx, dy = corners[-1] - corners[0]
    return tips, np.array([-dy, dx]) / math.hypot(dx, dy)


def pressure_label(case: Case, level: float) -> str:
    """Size of the uniform pressure of a level on a face; empty without one."""
    size = case["rho_water"] * case["g"] * level
    return f"pressure {with_unit(size, STRESSES)} on the face" if size else ""


def marked(case: Case, bodies: Mapping[str, Body]) -> dict[str, Array]:
    """Points (3,) [m] of the line forces, nearest to the viewer, of the mesh or the section."""
    section, depth = case.section, case["thickness"] if case["dim"] == 3 else 0.0
    names = [name for name in LINES if name != POINT]
    regions = {constants()[name.upper()][0]: name for name in names}
    corners = zip(
        section["mark_region"], section.get("mark_x", ()), section.get("mark_y", ()), strict=False
    )
    positions = {
        regions[number]: np.array([x, y, depth]) for number, x, y in corners if number in regions
    }
    of_mesh = {name: bodies[name].points for name in regions.values() if name in bodies}
    return positions | {name: line[line[:, 2].argmax()] for name, line in of_mesh.items()}


def is_extruded(case: Case) -> bool:
    """Whether one plane section represents the geometry."""
    return not (case.geometry and case["dim"] == 3)


@dataclass(frozen=True)
class JointShape:
    """The nodes of a joint on the side towards the viewer, from heel to toe (n,): their rows, and
    their numbers in the bodies above and below; its case, rows and states by step.
    """

    case: Case
    row: IntArray
    bodies: tuple[str, str]
    nodes: tuple[IntArray, IntArray]
    rows: list[Table]
    states: list[dict[str, float]]

    def along(self, values: Callable[[Table], Array]) -> Array:
        """Evaluate a function of the joint's rows on the near side, (steps, n)."""
        return np.array([values(rows)[self.row] for rows in self.rows])

    @property
    def damage_states(self) -> IntArray:
        """CLOSED to BROKEN on the near side, (steps, n)."""
        return np.array([joint_states(rows, self.case.law)[self.row] for rows in self.rows])

    @property
    def segment_states(self) -> IntArray:
        """Those of the segments between the nodes, (steps, n - 1)."""
        states = self.damage_states
        return np.minimum(states[:, :-1], states[:, 1:])

    @property
    def s(self) -> Array:
        """Distances from the heel along the joint (n,) [m]."""
        return self.along(distance)[0]


class Scene:
    """A scene at some times, displaced by a common factor: `scale`.

    result, bodies, fields: of the run; loadings: at each of the times; points: along a joint that
    are drawn, about (None: all).
    """

    def __init__(
        self,
        result: Results,
        bodies: Mapping[str, Body],
        fields: Mapping[float, Field],
        times: Sequence[float],
        loadings: Sequence[Loading],
        points: int | None = None,
    ) -> None:
        self.result, self.case, self.bodies = result, result.case, bodies
        self.times, self.loadings, self.points = list(times), list(loadings), points
        #: displacement (steps, nodes, 3) by body [m]
        self.moved = {
            name: np.array([fields[time].displacement[name] for time in self.times])
            for name in fields[self.times[0]].displacement
        }
        self.scale = exaggeration(self.moved, self.case.size)
        self.skins = {name: skin(bodies[name]) for name in self.moved}
        self.depth = max(bodies[name].points[:, 2].max() for name in self.moved)
        self.joints = [self.joint_shape(k, joint) for k, joint in enumerate(result.joints)]
        lines = joint_lines(self.case, [joint.rows[0] for joint in self.joints])
        #: sections, undeformed and by step; None if one section does not represent the geometry
        self.undeformed, *self.sections = (
            section_outline(dict(bodies), fields[time].displacement, scale, lines)
            if is_extruded(self.case)
            else None
            for time, scale in [(self.times[0], 0.0), *((t, self.scale) for t in self.times)]
        )

    def joint_shape(self, number: int, result: Results) -> JointShape:
        """The near side of a joint, by its number; result: of that joint alone."""
        joint, rows = joint_body(dict(self.bodies), number), [result.at(t) for t in self.times]
        s = distance(rows[0])
        near = joint.points[:, 2] > joint.points[:, 2].max() - ROUND_OFF * s.max()
        row = nearest_rows(joint.points[near], rows[0])
        order = np.argsort(s[row])
        every = max(1, len(order) // self.points) if self.points else 1
        order = order[np.unique([*range(0, len(order), every), len(order) - 1])]
        of_joints = self.case.of_joints
        names = (of_joints[number].upper, of_joints[number].lower) if of_joints else BODIES
        positions = joint.points[near][order]
        # by their places: the bodies of a stored run have other tags
        upper, lower = (
            nearest_rows(positions, dict(zip("xyz", self.bodies[name].points.T, strict=True)))
            for name in names
        )
        states = [result.state(time) for time in self.times]
        return JointShape(result.case, row[order], names, (upper, lower), rows, states)

    def face(self, joint: JointShape, upper: bool) -> tuple[Array, Array]:
        """The upper or lower face of a joint on the near side: points (n, 3) from heel to toe, and
        their displacement (steps, n, 3), not exaggerated.
        """
        which = 0 if upper else 1
        name, nodes = joint.bodies[which], joint.nodes[which]
        return self.bodies[name].points[nodes], self.moved[name][:, nodes]

    def displaced_face(self, joint: JointShape, upper: bool) -> Array:
        """The displaced upper or lower face of a joint (steps, n, 3)."""
        points, displacement = self.face(joint, upper)
        return points + self.scale * displacement

    def on_joint(self, joint: JointShape, s: Array | float) -> Array:
        """Points (steps, ..., 3) on a joint's displaced lower face at distances s from its heel."""
        face = self.displaced_face(joint, upper=False)
        return np.array(
            [np.stack([np.interp(s, joint.s, x) for x in step.T], axis=-1) for step in face]
        )

    def middle_third(self, joint: JointShape) -> Array:
        """Points (steps, n, 3) of a joint's middle third."""
        return self.on_joint(joint, MIDDLE * joint.s.max())

    def crack(self, joint: JointShape) -> Array:
        """Quadrangles (steps, n, 4, 3) of water under pressure in an open joint; points: none."""
        low, high = (self.displaced_face(joint, upper) for upper in (False, True))
        pressure = joint.along(lambda rows: rows["p"])
        wet = (joint.segment_states == BROKEN) & (pressure[:, :-1] > 0) & (pressure[:, 1:] > 0)
        faces = np.stack([low[:, :-1], low[:, 1:], high[:, 1:], high[:, :-1]], axis=2)
        return np.where(wet[..., None, None], faces, faces[:, :, :1])

    def resultant(self, joint: JointShape) -> tuple[Array, Array]:
        """Tips (steps, 3) and forces (steps, 2) of a joint's resultant; zero: without a place."""
        face = self.displaced_face(joint, upper=False)
        tips, forces = [], []
        for step, (line, state) in enumerate(zip(face, joint.states, strict=True)):
            x, y = (line[-1] - line[0])[:2] / np.hypot(*(line[-1] - line[0])[:2])
            force = state["N"] * np.array([y, -x]) + state["T"] * np.array([x, y])
            at = state["x_resultant"] / joint.case.joint_length
            force, at = (force, at) if np.isfinite(at) else (np.zeros(2), 0.0)
            tips.append(self.on_joint(joint, at * joint.s.max())[step])
            forces.append(force)
        return np.array(tips), np.array(forces)

    def fluids(self) -> list[dict[str, Array]]:
        """See `fluids`, by step; none if one section does not represent the geometry."""
        if not self.undeformed:
            return []
        dry = displaced_faces(self.undeformed)
        return [
            fluids(self.case, displaced_faces(section), loading, dry)
            for section, loading in zip(self.sections, self.loadings, strict=True)
            if section
        ]

    def forces(self) -> dict[str, tuple[Array, Array]]:
        """Forces and earthquake that act at any time: tips (steps, 3) and values (steps, 2)."""
        steps = [forces_on(self.case, now) for now in self.loadings]
        acting = {name: np.array([step[name] for step in steps]) for name in steps[0]}
        tips = {
            name: self.with_dam(point) for name, point in marked(self.case, self.bodies).items()
        }
        if self.undeformed:
            tips[QUAKE] = np.array([(*s.dam.centroid, self.depth) for s in self.sections if s])
        return {n: (tips[n], v) for n, v in acting.items() if v.any() and n in tips}

    def with_dam(self, point: Array) -> Array:
        """Displace a point (3,) of the dam, (steps, 3)."""
        squares = {
            name: ((self.bodies[name].points - point) ** 2).sum(axis=1)
            for name in self.moved
            if name != "foundation"
        }
        owner = min(squares, key=lambda name: squares[name].min())
        index = int(squares[owner].argmin())
        return self.bodies[owner].points[index] + self.scale * self.moved[owner][:, index]


#: Cells of the reservoir's surface along its shorter side.
CELLS = 24
#: Part of a triangle's side by which a place beside it is in it [-].
INSIDE = 1e-6


def water_surface(bodies: Mapping[str, Body], level: float) -> list[Array]:
    """Polygons (n, 3) of the reservoir's surface, upstream of the dam, up to the banks."""
    ground = bodies["foundation"].points
    dam = np.concatenate([b.points for n, b in bodies.items() if n.split(" ")[0] == "dam"])
    (left, _, back), (_, _, front) = ground.min(axis=0), ground.max(axis=0)
    right = dam[:, 0].min()
    size = min(right - left, front - back) / CELLS
    if size <= 0 or level <= ground[:, 1].min():
        return []
    x, z = (np.linspace(a, b, 1 + round((b - a) / size)) for a, b in ((left, right), (back, front)))
    positions = np.stack(np.meshgrid(x, z), axis=-1)
    heights = ground_heights(bodies["foundation"], positions.reshape(-1, 2)).reshape(len(z), len(x))
    generator = contour_generator(
        *(x, z, heights), fill_type=FillType.ChunkCombinedOffset, chunk_size=1
    )
    cells = generator.filled(heights.min() - size, level)[0]  # a chunk for each cell of the grid
    return [
        np.column_stack([cell[:-1, 0], np.full(len(cell) - 1, level), cell[:-1, 1]])
        for cell in cells
        if cell is not None
    ]


def ground_heights(ground: Body, positions: Array) -> Array:
    """Height of the top of the ground at places (n, 2): x, z. Between its nodes it is linear."""
    halves = [
        ground.points[table[:, [0, k, k + 1]]]
        for table, _ in skin(ground)
        for k in range(1, table.shape[1] - 1)
    ]
    triangles = np.concatenate(halves)
    flat = triangles[:, :, [0, 2]]
    first, second = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    area = area_between(first, second)
    lying = np.abs(area) > ROUND_OFF * (first**2 + second**2).sum(axis=1)  # others are vertical
    start, first, second, area = (values[lying] for values in (flat[:, 0], first, second, area))
    corners = triangles[lying, :, 1]
    heights = np.empty(len(positions))
    for i, away in enumerate(positions[:, None] - start):
        u, v = area_between(away, second) / area, area_between(first, away) / area
        inside = np.minimum(np.minimum(u, v), 1 - u - v) > -INSIDE
        parts = np.column_stack([1 - u - v, u, v])[inside]
        heights[i] = (parts * corners[inside]).sum(axis=1).max(initial=ground.points[:, 1].min())
    return heights
