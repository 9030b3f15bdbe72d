"""The deformed scene as lines and faces, step by step.

Gmsh scales all displacements by the same factor. Water and marks, which have no displacement, are
assigned the displacement that brings them to their place.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import ROUND_OFF
from ..arrays import Table
from ..input.case import Case
from ..input.scene import BED, DOWN, FLOOR, SIDES, TOP, UP
from ..laws import Law
from ..mesh.body import Body
from ..model.fields import (
    BROKEN,
    SLIPPED,
    SOFTENING,
    distance,
    joint_body,
    nearest_rows,
    state_of,
)
from ..model.loads import Loading, line_forces
from ..model.results import Results
from ..post.outline import exaggeration, joint_lines, section_of, skin
from ..post.units import FORCES, with_unit
from .camera import Camera, result_camera, undeformed_camera
from .scene import SolvedScene

#: Length of a force's arrow over the dam's size, and of the resultant's.
ARROW, RESULTANT = 0.12, 0.25
#: Distance of the middle third below the joint, over the dam's size; its places along the joint.
THIRD, MIDDLE = 0.02, np.linspace(1 / 3, 2 / 3, 11)
#: Points along the joint that are drawn, about: shorter lines are drawn with gaps.
JOINT_POINTS = 60
#: Cosine of the angle between faces above which a skin counts as smooth.
SMOOTH = 0.9
#: Lines of a section below water: of the reservoir, of water on the crest, of the tailwater.
RESERVOIR, OVER, TAIL = ("upstream", "floor"), ("crest",), ("bed", "downstream")


@dataclass
class Pieces:
    """Lines or faces: points (n, corners, 3) [m], values (steps, n, corners, components)."""

    points: np.ndarray
    values: np.ndarray

    def kind(self) -> str:
        """Kind of the elements in Gmsh's list data."""
        return {1: "S", 3: "V"}[self.values.shape[3]] + " PLTQ"[self.points.shape[1]]

    def list_data(self) -> np.ndarray:
        """Gmsh's list data: all x, y, z of an element, then its values step by step."""
        count = len(self.points)
        places = self.points.transpose(0, 2, 1).reshape(count, -1)
        return np.hstack([places, self.values.transpose(1, 0, 2, 3).reshape(count, -1)])

    def times(self, factor: float) -> Pieces:
        """The pieces with values multiplied by a factor."""
        return Pieces(self.points, self.values * factor)


@dataclass
class Label:
    """Text at a point (3,) of the scene [m], a line per step."""

    point: np.ndarray
    lines: list[str]
    align: str = "Left"


def force_label(name: str, force: np.ndarray) -> str:
    """Name and magnitude of a line force (2,) [N/m]; of the earthquake its coefficients."""
    if name == QUAKE:
        return ", ".join(f"{n} = {v:.3g}" for n, v in zip(("k_h", "k_v"), force, strict=True) if v)
    return f"{name} {with_unit(float(np.hypot(*force)), FORCES, 3)}"


#: Height of a label over the length of an arrow.
LINE = 0.8
#: Name of the earthquake among the forces.
QUAKE = "earthquake"


def arrow_labels(arrows: list[tuple[np.ndarray, list[str]]]) -> list[Label]:
    """Labels of arrows (3, 2, 3) with their texts: above an arrow that is steep, else beside its
    tail; those of arrows at the same place above one another.
    """
    labels, tails = list[Label](), list[np.ndarray]()
    for lines, texts in arrows:
        tail, tip = lines[0]
        x, y, _ = tip - tail
        length = np.hypot(x, y)
        steep = abs(y) > abs(x)
        number = 0 if steep else sum(np.hypot(*(tail - t)[:2]) < length for t in tails)
        place = tail + np.array([0.0, LINE * number * length, 0.0])
        align = "Right" if x > 0 and not steep else "Left"
        labels.append(Label(place, [f" {text} " for text in texts], align))
        tails += [] if steep else [tail]
    return labels


def level_labels(levels: list[float], tails: list[float], box: np.ndarray) -> list[Label]:
    """Labels of both water surfaces, one for each step, at the sides of a box (2, 3) [m]: below the
    reservoir's surface, as forces have their labels above it; above the tailwater's.
    """
    (left, _, _), (right, _, front) = box
    steps = range(len(levels))
    return [
        Label(np.array([x, height, front]), [f" {height:.4g} m " * (i == j) for j in steps], align)
        for x, heights, align in ((left, levels, "TopLeft"), (right, tails, "Right"))
        for i, height in enumerate(heights)
        if height > 0
    ]


def sharp_edges(body: Body, faces: list[np.ndarray]) -> np.ndarray:
    """Edges at which a skin ends or bends, (n, 2) point numbers."""
    pairs_of_points, normals_of_faces = [], []
    for table in faces:
        corners = body.points[table]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        for i in range(table.shape[1]):
            pairs_of_points.append(table[:, [i, (i + 1) % table.shape[1]]])
            normals_of_faces.append(normal)
    edges = np.sort(np.concatenate(pairs_of_points), axis=1)
    normals = np.concatenate(normals_of_faces)
    order = np.lexsort(edges.T)
    edges, normals = edges[order], normals[order]
    _, index, count = np.unique(edges, axis=0, return_index=True, return_counts=True)
    sharp = np.ones(len(index), bool)
    shared = count == 2
    first = index[shared]
    cosine = np.abs(np.einsum("ij,ij->i", normals[first], normals[first + 1]))
    sharp[shared] = cosine < SMOOTH
    return edges[index[sharp]]


def fluid_above(edges: np.ndarray, level: float) -> np.ndarray:
    """Quadrangles (n, 4, 2) between edges (n, 2, 2) and a level; without area if it is below."""
    order = np.argsort(edges[:, :, 1:], axis=1, kind="stable")
    low, high = np.take_along_axis(edges, order, axis=1).transpose(1, 0, 2)
    rise, wet = high[:, 1] - low[:, 1], level > low[:, 1]
    share = np.divide(level - low[:, 1], rise, out=np.ones(len(rise)), where=rise > 0)
    end = low + (share.clip(0, 1) * wet)[:, None] * (high - low)
    surface = [np.column_stack([at[:, 0], np.where(wet, level, at[:, 1])]) for at in (end, low)]
    return np.stack([low, end, *surface], axis=1)


def in_space(quads: np.ndarray, depth: float) -> np.ndarray:
    """Extrude quadrangles of `fluid_above`, (..., n, 4, 2), by a depth: both sides and the top."""
    near, far = (np.insert(quads, 2, z, axis=-1) for z in (depth, 0.0))
    if not depth:
        return near
    top = np.concatenate([near[..., 2:, :], far[..., :1:-1, :]], axis=-2)
    return np.concatenate([near, far, top], axis=-3)


def arrow(tip: np.ndarray, force: np.ndarray, length: float) -> np.ndarray:
    """Lines (3, 2, 3) of an arrow that ends at tip (3,), along a force (2,); a point if it is 0."""
    x, y = force / (np.hypot(*force) or 1.0)
    behind = length * np.array([(x, y, 0), (x + y / 2, y - x / 2, 0), (x - y / 2, y + x / 2, 0)])
    behind[1:] /= 4  # the barbs
    return np.stack([tip - behind, np.broadcast_to(tip, (3, 3))], axis=1)


def is_extruded(case: Case) -> bool:
    """Whether one plane section represents the geometry."""
    return not (case.geometry and case["dim"] == 3)


def has_extent(corners: np.ndarray) -> bool:
    """Whether any of the elements (..., corners, 3) is more than a point."""
    return bool(np.ptp(corners, axis=-2).any())


def undeformed_loads(case: Case) -> tuple[dict[str, Pieces], list[Label]]:
    """Water, silt and forces of the last level on the undeformed section, of those that act, and
    their labels.

    Empty for a user's own geometry, whose faces are known only with its mesh.
    """
    if case.geometry:
        return {}, []
    section, depth = case.section, case["thickness"] if case["dim"] == 3 else 0.0
    ends = [[section["seg_x0"], section["seg_y0"]], [section["seg_x1"], section["seg_y1"]]]
    edges = np.array(ends).transpose(2, 0, 1)
    faces = lambda *sides: edges[np.isin(section["seg_side"], [SIDES.index(n) for n in sides])]
    level, tail = max(case.levels), max(case.tail_levels)
    over = level if case["crest_water"] else -np.inf
    water = (faces(UP, FLOOR), level), (faces(TOP), over), (faces(DOWN, BED), tail)
    silt = fluid_above(faces(UP, FLOOR), case["silt_height"])
    forces = line_forces(case, Loading.at(case, np.inf, level, tail))
    tips = [
        np.array([x, y, depth]) for x, y in zip(section["mark_x"], section["mark_y"], strict=True)
    ]
    length = ARROW * case.size
    arrows = [arrow(tip, np.array(f), length) for tip, f in zip(tips, forces.values(), strict=True)]
    named = zip(arrows, forces.items(), strict=True)
    labels = arrow_labels([(a, [force_label(name, np.array(f))]) for a, (name, f) in named])
    labels += level_labels([level], [tail], undeformed_camera(case).box)
    loads = {
        "water": in_space(np.concatenate([fluid_above(*part) for part in water]), depth),
        "silt": in_space(silt, depth),
        "forces": np.concatenate([np.zeros((0, 2, 3)), *arrows]),
    }
    fixed = lambda corners: Pieces(corners, np.ones((1, *corners.shape[:2], 1)))
    return {n: fixed(corners) for n, corners in loads.items() if has_extent(corners)}, labels


#: Bodies above and below a single joint.
BODIES = "dam", "foundation"


@dataclass(frozen=True)
class NearSide:
    """The nodes of a joint on the side towards the viewer, from heel to toe (n,): their tags and
    rows; its law, names of the bodies above and below, rows of the joint by step.
    """

    law: Law[Any]
    bodies: tuple[str, str]
    tags: np.ndarray
    row: np.ndarray
    rows: list[Table]

    def along(self, values: Callable[[Table], np.ndarray]) -> np.ndarray:
        """Evaluate a function of the joint's rows on the near side, (steps, n)."""
        return np.array([values(rows)[self.row] for rows in self.rows])

    @property
    def states(self) -> np.ndarray:
        """The states on the near side, (steps, n)."""
        return self.along(lambda rows: state_of(rows, self.law))


@dataclass
class Deformed:
    """A scene with its displacement times `scale`; it has reached a requested time."""

    scene: SolvedScene

    def __post_init__(self) -> None:
        case, fields = self.scene.result.case, self.scene.fields
        self.times = [float(time) for time in self.scene.times]
        #: displacement (steps, nodes, 3) by body [m]
        self.moved = {
            name: np.array([fields[time].displacement[name] for time in self.times])
            for name in fields[self.times[0]].displacement
        }
        self.scale = exaggeration(self.moved, case.size)
        self.camera: Camera = result_camera(case, self.scene.bodies)
        self.skins = {name: skin(self.scene.bodies[name]) for name in self.moved}
        self.depth = self.scene.bodies["dam"].points[:, 2].max()
        joints = self.scene.result.joints
        self.joints = [self.near_side(k, own) for k, own in enumerate(joints)]
        self.loadings = [self.scene.loading(time) for time in self.times]
        lines = joint_lines(case, [joint.rows[0] for joint in self.joints])
        #: sections, undeformed and by step; None if one section does not represent the geometry
        self.undeformed, *self.sections = (
            section_of(self.scene.bodies, fields[time].displacement, scale, lines)
            if is_extruded(case)
            else None
            for time, scale in [(self.times[0], 0.0), *((t, self.scale) for t in self.times)]
        )

    def near_side(self, number: int, result: Results) -> NearSide:
        """The near side of a joint, by its number; result: of that joint alone."""
        joint, rows = joint_body(self.scene.bodies, number), [result.at(t) for t in self.times]
        s = distance(rows[0])
        near = joint.points[:, 2] > joint.points[:, 2].max() - ROUND_OFF * s.max()
        row = nearest_rows(joint.points[near], rows[0])
        order = np.argsort(s[row])
        every = max(1, len(order) // JOINT_POINTS)
        order = order[np.unique([*range(0, len(order), every), len(order) - 1])]
        of_joints = self.scene.result.case.of_joints
        names = (of_joints[number].upper, of_joints[number].lower) if of_joints else BODIES
        return NearSide(result.case.law, names, joint.node_tags[near][order], row[order], rows)

    def bodies(self) -> list[Pieces]:
        """Faces of dam and foundation with their displacement [m]."""
        return [
            Pieces(self.scene.bodies[name].points[faces], self.moved[name][:, faces])
            for name in self.moved
            for faces, _ in self.skins[name]
        ]

    def vertical_stress(self) -> list[np.ndarray]:
        """Vertical stress of the elements of each body (steps, elements) [Pa]."""
        fields = [self.scene.fields[time] for time in self.times]
        return [np.array([field.stress[name][:, 1] for field in fields]) for name in self.moved]

    def stress(self) -> list[Pieces]:
        """Undeformed faces of dam and foundation with the vertical stress of the elements [Pa]."""
        pieces = []
        for name, vertical in zip(self.moved, self.vertical_stress(), strict=True):
            for faces, owners in self.skins[name]:
                values = np.repeat(vertical[:, owners, None, None], faces.shape[1], axis=2)
                pieces.append(Pieces(self.scene.bodies[name].points[faces], values))
        return pieces

    def outline(self) -> Pieces:
        """Edges of dam and foundation."""
        points, values = [], []
        for name in self.moved:
            body = self.scene.bodies[name]
            edges = sharp_edges(body, [faces for faces, _ in self.skins[name]])
            points.append(body.points[edges])
            values.append(self.moved[name][:, edges])
        return Pieces(np.concatenate(points), np.concatenate(values, axis=1))

    def joint_face(self, name: str, joint: NearSide) -> tuple[np.ndarray, np.ndarray]:
        """A body's face of a joint on the near side: points (n, 3) from heel to toe, and their
        displacement (steps, n, 3).
        """
        body = self.scene.bodies[name]
        index = np.searchsorted(body.node_tags, joint.tags)
        return body.points[index], self.moved[name][:, index]

    def occurring(self) -> np.ndarray:
        """The states of the joints on the near side."""
        return np.unique(np.concatenate([np.ravel(joint.states) for joint in self.joints]))

    def marks(self) -> dict[int, Pieces]:
        """Both faces of each joint, by state: broken, softening, slipped.

        A segment that is not in that state at a step collapses to a point.
        """
        ends, moved, of_segments = [], [], []
        for joint in self.joints:
            state = joint.states
            for name in joint.bodies:
                points, displacement = self.joint_face(name, joint)
                ends.append(np.stack([points[:-1], points[1:]], axis=1))
                moved.append(np.stack([displacement[:, :-1], displacement[:, 1:]], axis=2))
                of_segments.append(np.minimum(state[:, :-1], state[:, 1:]))
        segment_states = np.concatenate(of_segments, axis=1)
        segments, values = np.concatenate(ends), np.concatenate(moved, axis=1)
        collapse = (
            values[:, :, 0] - values[:, :, 1] + (segments[:, 0] - segments[:, 1]) / self.scale
        )
        marks = {}
        for number in (BROKEN, SOFTENING, SLIPPED):
            shown, in_state = values.copy(), segment_states == number
            shown[:, :, 1] += np.where(in_state[:, :, None], 0.0, collapse)
            marks[number] = Pieces(segments, shown)
        return marks

    def loads(self) -> dict[str, Pieces]:
        """Water, silt, water in the crack and forces on the deformed dam, of those that act."""
        arrows = [lines for _, _, lines in self.forces()]
        loads = {
            "water": self.water(),
            "silt": self.silt(),
            "water in the crack": np.concatenate([self.crack(j) for j in self.joints], axis=1),
            "forces": np.concatenate([np.zeros((len(self.times), 0, 2, 3)), *arrows], axis=1),
        }
        return {
            name: self.placed(corners) for name, corners in loads.items() if has_extent(corners)
        }

    def water(self) -> np.ndarray:
        """Reservoir and tailwater up to their levels."""
        level, tail = ([getattr(now, name) for now in self.loadings] for name in ("level", "tail"))
        over = level if self.scene.result.case["crest_water"] else [-np.inf] * len(level)
        parts = (RESERVOIR, level), (OVER, over), (TAIL, tail)
        return np.concatenate([self.fluid(*part) for part in parts], axis=1)

    def silt(self) -> np.ndarray:
        """Silt upstream, once it acts."""
        height = self.scene.result.case["silt_height"]
        heights = [height if now.part("silt") else -np.inf for now in self.loadings]
        return self.fluid(RESERVOIR, heights)

    def forces(self) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """Forces and earthquake that act: name, values (steps, 2), arrows (steps, 3, 2, 3), which
        are points as long as the force is zero.
        """
        case = self.scene.result.case
        lines = [line_forces(case, now) for now in self.loadings]
        acting = {name: np.array([step[name] for step in lines]) for name in lines[0]}
        places = {name: self.tips(name) for name, values in acting.items() if values.any()}
        if self.undeformed:
            inertia = np.array([case["k_h"], case["k_v"]])
            acting[QUAKE] = np.array([now.part("quake") * inertia for now in self.loadings])
            places[QUAKE] = np.array([(*s.dam.centroid, self.depth) for s in self.sections])
        length = ARROW * case.size
        arrows = lambda name, values: np.array(
            [arrow(tip, force, length) for tip, force in zip(places[name], values, strict=True)]
        )
        return [(n, values, arrows(n, values)) for n, values in acting.items() if values.any()]

    def labels(self) -> list[Label]:
        """Labels of the forces and of the water surfaces."""
        labels = arrow_labels(
            [
                (lines[-1], [force_label(name, f) * bool(f.any()) for f in values])
                for name, values, lines in self.forces()
            ]
        )
        if self.undeformed:
            levels = ([getattr(now, name) for now in self.loadings] for name in ("level", "tail"))
            labels += level_labels(*levels, self.camera.box)
        return labels

    def resultant(self) -> Pieces:
        """Resultant of the decisive joint's forces without the water in it, and the joint's middle
        third.
        """
        length, joint = self.scene.own.case.joint_length, self.joints[self.scene.joint]
        face, displacement = self.joint_face(joint.bodies[1], joint)
        s = joint.along(distance)[0]
        steps = []
        for moved, numbers in zip(
            face + self.scale * displacement, self.scene.numbers, strict=True
        ):
            on_joint = lambda part, moved=moved: np.stack(
                [np.interp(part * s.max(), s, axis) for axis in moved.T], axis=-1
            )
            now = numbers.elements
            third = on_joint(MIDDLE) - [0, THIRD * self.scene.result.case.size, 0]
            x, y = (moved[-1] - moved[0])[:2] / np.hypot(*(moved[-1] - moved[0])[:2])
            force = now["N"] * np.array([y, -x]) + now["T"] * np.array([x, y])
            at = now["x_resultant"] / length
            force, at = (force, at) if np.isfinite(at) else (np.zeros(2), 0.0)
            lines = arrow(on_joint(at), force, RESULTANT * self.scene.result.case.size)
            steps.append(np.concatenate([np.stack([third[:-1], third[1:]], axis=1), lines]))
        return self.placed(np.array(steps))

    def tips(self, name: str) -> np.ndarray:
        """Displaced points of application of a line force on the near side, (steps, 3)."""
        line = self.scene.bodies[name]
        tag = line.node_tags[line.points[:, 2].argmax()]
        owner = next(n for n in self.moved if tag in self.scene.bodies[n].node_tags)
        index = np.searchsorted(self.scene.bodies[owner].node_tags, tag)
        return self.scene.bodies[owner].points[index] + self.scale * self.moved[owner][:, index]

    def placed(self, corners: np.ndarray) -> Pieces:
        """Pieces whose displacement moves their corners to places (steps, n, corners, 3)."""
        last = corners[-1]
        return Pieces(last, (corners - last) / self.scale)

    def fluid(self, shore: tuple[str, ...], levels: list[float]) -> np.ndarray:
        """Quadrangles above lines of the section up to a level by step, (steps, n, 4, 3).

        Lines above the level when undeformed stay dry: the displacement is exaggerated.
        """
        if not self.undeformed:
            return np.zeros((len(levels), 0, 4, 3))
        line = lambda section: np.concatenate([getattr(section, name) for name in shore])
        ground, steps = line(self.undeformed)[:, 1].min(), []
        for section, level in zip(self.sections, levels, strict=True):
            edges = np.stack([line(section)[:-1], line(section)[1:]], axis=1)
            steps.append(fluid_above(edges, level if level > ground else -np.inf))
        return in_space(np.array(steps), self.depth)

    def crack(self, joint: NearSide) -> np.ndarray:
        """Quadrangles of the water under pressure between the faces of an open joint."""
        above, below = joint.bodies
        lower, lower_displacement = self.joint_face(below, joint)
        upper, upper_displacement = self.joint_face(above, joint)
        wet = (joint.states == BROKEN) & (joint.along(lambda rows: rows["p"]) > 0)
        wet = (wet[:, :-1] & wet[:, 1:])[..., None, None]
        low = lower + self.scale * lower_displacement
        high = upper + self.scale * upper_displacement
        faces = np.stack([low[:, :-1], low[:, 1:], high[:, 1:], high[:, :-1]], axis=2)
        return np.where(wet, faces, faces[:, :, :1])
