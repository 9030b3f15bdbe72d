"""The deformed scene as lines and faces, step by step.

Gmsh scales all displacements by the same factor. Water and marks, which have no displacement, are
assigned the displacement that brings them to their place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..input.case import Case
from ..mesh.body import Body
from ..model.fields import BROKEN, SLIPPED, SOFTENING
from ..model.loads import Loading, line_forces
from ..pictures.scene import (
    Scene,
    arrow,
    fluids,
    force_label,
    level_label,
    marked,
    undeformed_faces,
)
from .camera import Camera, result_camera
from .scene import SolvedScene

#: Length of a force's arrow over the dam's size, and of the resultant's.
ARROW, RESULTANT = 0.12, 0.25
#: Distance of the middle third below the joint, over the dam's size.
THIRD = 0.02
#: Points along the joint that are drawn, about: shorter lines are drawn with gaps.
JOINT_POINTS = 60
#: Cosine of the angle between faces above which a skin counts as smooth.
SMOOTH = 0.9


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
        positions = self.points.transpose(0, 2, 1).reshape(count, -1)
        return np.hstack([positions, self.values.transpose(1, 0, 2, 3).reshape(count, -1)])

    def times(self, factor: float) -> Pieces:
        """The pieces with values multiplied by a factor."""
        return Pieces(self.points, self.values * factor)


@dataclass
class Label:
    """Text at a point (3,) of the scene [m], a line per step."""

    point: np.ndarray
    lines: list[str]
    align: str = "Left"


#: Height of a label over the length of an arrow.
LINE = 0.8


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
        position = tail + np.array([0.0, LINE * number * length, 0.0])
        align = "Right" if x > 0 and not steep else "Left"
        labels.append(Label(position, [f" {text} " for text in texts], align))
        tails += [] if steep else [tail]
    return labels


def level_labels(levels: list[float], tails: list[float], box: np.ndarray) -> list[Label]:
    """Labels of both water surfaces, one for each step, at the sides of a box (2, 3) [m]: below the
    reservoir's surface, as forces have their labels above it; above the tailwater's.
    """
    (left, _, _), (right, _, front) = box
    steps = range(len(levels))
    return [
        Label(
            np.array([x, height, front]),
            [f" {level_label(height)} " * (i == j) for j in steps],
            align,
        )
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


def in_space(quads: np.ndarray, depth: float) -> np.ndarray:
    """Extrude quadrangles of `fluid_above`, (..., n, 4, 2), by a depth: both sides and the top."""
    near, far = (np.insert(quads, 2, z, axis=-1) for z in (depth, 0.0))
    if not depth:
        return near
    top = np.concatenate([near[..., 2:, :], far[..., :1:-1, :]], axis=-2)
    return np.concatenate([near, far, top], axis=-3)


def has_extent(corners: np.ndarray) -> bool:
    """Whether any of the elements (..., corners, 3) is more than a point."""
    return bool(np.ptp(corners, axis=-2).any())


def undeformed_loads(case: Case, box: np.ndarray) -> tuple[dict[str, Pieces], list[Label]]:
    """Water, silt and forces of the last level on the undeformed section, of those that act, and
    their labels at the sides of a box (2, 3) [m].

    Empty for a user's own geometry, whose faces are known only with its mesh.
    """
    if case.geometry:
        return {}, []
    faces, depth = undeformed_faces(case), case["thickness"] if case["dim"] == 3 else 0.0
    loading = Loading.at(case, np.inf, max(case.levels), max(case.tail_levels))
    loads = {n: in_space(f, depth) for n, f in fluids(case, faces, loading, faces).items()}
    forces, tips = line_forces(case, loading), marked(case, {})
    length = ARROW * case.size
    arrows = {name: arrow(tips[name], np.array(f), length) for name, f in forces.items()}
    labels = arrow_labels([(a, [force_label(n, np.array(forces[n]))]) for n, a in arrows.items()])
    labels += level_labels([loading.level], [loading.tail], box)
    loads["forces"] = np.concatenate([np.zeros((0, 2, 3)), *arrows.values()])
    shown = {n: corners for n, corners in loads.items() if has_extent(corners)}
    return {n: Pieces(c, np.ones((1, *c.shape[:2], 1))) for n, c in shown.items()}, labels


class Deformed:
    """The pieces of a scene that has reached a requested time."""

    def __init__(self, solved: SolvedScene) -> None:
        self.solved, times = solved, [float(time) for time in solved.times]
        loadings = [solved.loading(time) for time in times]
        self.scene = Scene(
            solved.result, solved.bodies, solved.fields, times, loadings, JOINT_POINTS
        )
        self.scale, self.moved = self.scene.scale, self.scene.moved
        self.camera: Camera = result_camera(self.scene.case, solved.bodies)

    def bodies(self) -> list[Pieces]:
        """Faces of dam and foundation with their displacement [m]."""
        return [
            Pieces(self.scene.bodies[name].points[faces], self.moved[name][:, faces])
            for name in self.moved
            for faces, _ in self.scene.skins[name]
        ]

    def vertical_stress(self) -> list[np.ndarray]:
        """Vertical stress of the elements of each body (steps, elements) [Pa]."""
        fields = [self.solved.fields[time] for time in self.scene.times]
        return [np.array([field.stress[name][:, 1] for field in fields]) for name in self.moved]

    def stress(self) -> list[Pieces]:
        """Undeformed faces of dam and foundation with the vertical stress of the elements [Pa]."""
        pieces = []
        for name, vertical in zip(self.moved, self.vertical_stress(), strict=True):
            for faces, owners in self.scene.skins[name]:
                values = np.repeat(vertical[:, owners, None, None], faces.shape[1], axis=2)
                pieces.append(Pieces(self.scene.bodies[name].points[faces], values))
        return pieces

    def outline(self) -> Pieces:
        """Edges of dam and foundation."""
        points, values = [], []
        for name in self.moved:
            body = self.scene.bodies[name]
            edges = sharp_edges(body, [faces for faces, _ in self.scene.skins[name]])
            points.append(body.points[edges])
            values.append(self.moved[name][:, edges])
        return Pieces(np.concatenate(points), np.concatenate(values, axis=1))

    def occurring(self) -> np.ndarray:
        """The states of the joints on the near side."""
        return np.unique(np.concatenate([np.ravel(j.damage_states) for j in self.scene.joints]))

    def marks(self) -> dict[int, Pieces]:
        """Both faces of each joint, by state: broken, softening, slipped.

        A segment that is not in that state at a step collapses to a point.
        """
        ends, moved, of_segments = [], [], []
        for joint in self.scene.joints:
            for upper in (True, False):
                points, displacement = self.scene.face(joint, upper)
                ends.append(np.stack([points[:-1], points[1:]], axis=1))
                moved.append(np.stack([displacement[:, :-1], displacement[:, 1:]], axis=2))
                of_segments.append(joint.segment_states)
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
        of_sections = self.scene.fluids()
        loads = {
            name: in_space(np.array([step[name] for step in of_sections]), self.scene.depth)
            for name in (of_sections[0] if of_sections else ())
        }
        cracks = [self.scene.crack(joint) for joint in self.scene.joints]
        loads["water in the crack"] = np.concatenate(cracks, axis=1)
        arrows = [lines for _, _, lines in self.forces()]
        none = np.zeros((len(self.scene.times), 0, 2, 3))
        loads["forces"] = np.concatenate([none, *arrows], axis=1)
        return {
            name: self.placed(corners) for name, corners in loads.items() if has_extent(corners)
        }

    def forces(self) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """Forces that act: name, values (steps, 2), arrows (steps, 3, 2, 3), points where zero."""
        length = ARROW * self.scene.case.size
        return [
            (name, values, arrows(tips, values, length))
            for name, (tips, values) in self.scene.forces().items()
        ]

    def labels(self) -> list[Label]:
        """Labels of the forces and of the water surfaces."""
        labels = arrow_labels(
            [
                (lines[-1], [force_label(name, force) for force in values])
                for name, values, lines in self.forces()
            ]
        )
        if self.scene.undeformed:
            levels = [(now.level, now.tail) for now in self.scene.loadings]
            reservoir, tail = ([pair[k] for pair in levels] for k in range(2))
            labels += level_labels(reservoir, tail, self.camera.box)
        return labels

    def resultant(self) -> Pieces:
        """Resultant of the shown joint's forces without its water, and the joint's middle third."""
        joint, size = self.scene.joints[self.solved.joint], self.scene.case.size
        third = self.scene.middle_third(joint) - [0, THIRD * size, 0]
        lines = arrows(*self.scene.resultant(joint), RESULTANT * size)
        segments = np.stack([third[:, :-1], third[:, 1:]], axis=2)
        return self.placed(np.concatenate([segments, lines], axis=1))

    def placed(self, corners: np.ndarray) -> Pieces:
        """Pieces whose displacement moves their corners to places (steps, n, corners, 3)."""
        last = corners[-1]
        return Pieces(last, (corners - last) / self.scale)


def arrows(tips: np.ndarray, forces: np.ndarray, length: float) -> np.ndarray:
    """Lines (steps, 3, 2, 3) of arrows, see `arrow`."""
    return np.array([arrow(*step, length) for step in zip(tips, forces, strict=True)])
