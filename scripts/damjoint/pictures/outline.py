"""Outlines from the mesh: skins of the bodies; in the plane, the outlines of dam and foundation and
the faces that water presses on. Works for any section.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import ROUND_OFF
from ..arrays import Table
from ..input.case import Case
from ..mesh.body import SIDES, Body
from ..model.fields import distance

#: Relative distance of points that count as level: a user's crest may be slightly off.
LEVEL = 1e-6

#: Largest displacement drawn, over the dam's size.
DISPLACEMENT = 0.06

#: Corners of what is drawn of a cell, by its shape: its faces.
FACES = {**SIDES, "triangle": ([0, 1, 2],), "quad": ([0, 1, 2, 3],)}


def exaggeration(displacement: dict[str, np.ndarray], size: float) -> float:
    """Factor, of one digit, by which displacements are drawn; size: of the dam [m]."""
    largest = max((np.abs(u).max(initial=0) for u in displacement.values()), default=0)
    return float(f"{DISPLACEMENT * size / largest:.1g}") if largest > 0 else 1.0


def skin(body: Body) -> list[tuple[np.ndarray, np.ndarray]]:
    """Extract the skin of a body: faces (n, corners) as point numbers, and their elements (n,).

    In 2D all elements, in 3D the faces that belong to one element only.
    """
    tables: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
    first = 0
    for shape, table in body.cells:
        for side in FACES[shape]:
            tables.setdefault(len(side), []).append(
                (table[:, side], np.arange(first, first + len(table)))
            )
        first += len(table)
    parts = []
    for same_shape in tables.values():
        faces, owners = (np.concatenate(part) for part in zip(*same_shape, strict=True))
        # three corners identify a face; a single integer is faster to compare
        low, middle, high = np.sort(faces, axis=1).T[:3].astype(np.int64)
        key = (low * len(body.points) + middle) * len(body.points) + high
        _, index, count = np.unique(key, return_index=True, return_counts=True)
        outer = index[count == 1]
        parts.append((faces[outer], owners[outer]))
    return parts


def boundary(points: np.ndarray, faces: list[np.ndarray]) -> np.ndarray:
    """The longest closed line around plane faces, counterclockwise; point numbers."""
    edges = []
    for table in faces:
        (x, y), (x1, y1) = (
            points[t, :2].transpose(2, 0, 1) for t in (table, np.roll(table, -1, 1))
        )
        clockwise = np.sum(x * y1 - x1 * y, axis=1) < 0
        table = np.where(clockwise[:, None], table[:, ::-1], table)
        edges.append(np.stack([table, np.roll(table, -1, axis=1)], axis=-1).reshape(-1, 2))
    ends = np.concatenate(edges).astype(np.int64)
    key, reverse_key = ends @ (len(points), 1), ends @ (1, len(points))
    following = dict(ends[~np.isin(key, reverse_key)].tolist())
    loops = []
    while following:
        first, point = following.popitem()
        loops.append([first])
        while point != first:
            loops[-1].append(point)
            point = following.pop(point, first)
    return np.array(max(loops, key=len))


def area_between(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Area (n,) of the parallelograms of vectors (n, 2), > 0 if the second is to the left."""
    return first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]


@dataclass
class PlaneBody:
    """A body in the plane: points (n, 2) [m] undeformed and displaced (exaggerated), faces by
    region, outline as point numbers.
    """

    points: np.ndarray
    moved: np.ndarray
    faces: dict[str, list[np.ndarray]]
    loop: np.ndarray

    @property
    def centroid(self) -> np.ndarray:
        """Centroid of the displaced outline, by the shoelace formula (2,) [m]."""
        start = self.moved[self.loop]
        end = np.roll(start, -1, axis=0)
        cross = area_between(start, end)
        return cross @ (start + end) / (3 * cross.sum())

    def nearest(self, position: np.ndarray) -> int:
        """Index in the outline of the point nearest to a place (2,)."""
        return int(np.argmin(((self.points[self.loop] - position) ** 2).sum(axis=1)))

    def between(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Point numbers of the outline between the points nearest to two places (2,)."""
        first, last = self.nearest(start), self.nearest(end)
        return np.roll(self.loop, -first)[: (last - first) % len(self.loop) + 1]


def plane_body(body: Body, displacement: np.ndarray, scale: float) -> PlaneBody | None:
    """Cut a body at its lowest z; None if it has no face there."""
    points = body.points[:, :2]
    low = body.points[:, 2].min() + ROUND_OFF * np.ptp(points, axis=0).max()
    region = np.repeat(body.regions, [len(table) for _, table in body.cells])
    faces: dict[str, list[np.ndarray]] = {}
    for table, owners in skin(body):
        front = np.all(body.points[table, 2] < low, axis=1)
        for name in dict.fromkeys(body.regions):
            selected = front & (region[owners] == name)
            faces.setdefault(name, []).extend([table[selected]] if selected.any() else [])
    tables = [table for of_region in faces.values() for table in of_region]
    if not tables:
        return None
    moved = points + scale * displacement[:, :2]
    return PlaneBody(points, moved, faces, boundary(points, tables))


@dataclass(frozen=True)
class JointLine:
    """A joint of a section: names of its bodies, heel and toe (2,) [m]."""

    upper: str
    lower: str
    heel: np.ndarray
    toe: np.ndarray


def joint_lines(case: Case, rows: list[Table]) -> list[JointLine]:
    """The joints of a case, from the rows of each at one time."""
    bodies = [(joint.upper, joint.lower) for joint in case.of_joints] or [("dam", "foundation")]
    lines = []
    for names, of_joint in zip(bodies, rows, strict=True):
        s = distance(of_joint)
        ends = (np.array([of_joint[axis][i] for axis in "xy"]) for i in (s.argmin(), s.argmax()))
        lines.append(JointLine(*names, *ends))
    return lines


@dataclass
class Section:
    """The plane section: bodies by name, and joints."""

    bodies: dict[str, PlaneBody]
    joints: list[JointLine]

    def __post_init__(self) -> None:
        self.foundation = self.bodies["foundation"]
        #: all bodies above the foundation
        self.dam = union([body for name, body in self.bodies.items() if name != "foundation"])
        on_rock = [joint for joint in self.joints if joint.lower == "foundation"]
        #: ends of the dam on the foundation (2,) [m]
        self.heel = min((joint.heel for joint in on_rock), key=lambda end: end[0])
        self.toe = max((joint.toe for joint in on_rock), key=lambda end: end[0])
        around = self.dam.between(self.toe, self.heel)
        height = self.dam.points[around, 1]
        crest = np.flatnonzero(height >= height.max() - LEVEL * np.ptp(height))
        #: displaced faces and crest of the dam, each from downstream to upstream (n, 2) [m]
        self.downstream = self.dam.moved[around[: crest[0] + 1]]
        self.crest = self.dam.moved[around[crest[0] : crest[-1] + 1]]
        self.upstream = self.dam.moved[around[crest[-1] :]]
        ground = self.foundation.between(self.heel, self.toe)
        x = self.foundation.points[ground, 0]
        near = LEVEL * np.ptp(x)
        left = np.flatnonzero(x < x.min() + near)[0]
        right = np.flatnonzero(x > x.max() - near)[-1]
        #: displaced ground: upstream from the heel outwards, downstream inwards to the toe
        self.floor = self.foundation.moved[ground[: left + 1]]
        self.bed = self.foundation.moved[ground[right:]]


def union(bodies: list[PlaneBody]) -> PlaneBody:
    """Several bodies as one; its outline passes their joints."""
    if len(bodies) == 1:
        return bodies[0]
    starts = np.cumsum([0, *(len(body.points) for body in bodies)])
    points = np.concatenate([body.points for body in bodies])
    moved = np.concatenate([body.moved for body in bodies])
    faces: dict[str, list[np.ndarray]] = {}
    for start, body in zip(starts, bodies, strict=False):
        for name, tables in body.faces.items():
            faces.setdefault(name, []).extend(table + start for table in tables)
    positions = np.round(points / np.ptp(points, axis=0).max(), 9)
    _, first, same = np.unique(positions, axis=0, return_index=True, return_inverse=True)
    glued = first[same.ravel()]  # points of the same place as a single one
    tables = [glued[table] for of_region in faces.values() for table in of_region]
    return PlaneBody(points, moved, faces, boundary(points, tables))


def section_outline(
    bodies: dict[str, Body],
    displacement: dict[str, np.ndarray],
    scale: float,
    joints: list[JointLine],
) -> Section | None:
    """Cut the displaced mesh at its lowest z; None: no face there, or a joint in a body."""
    if any(joint.upper == joint.lower for joint in joints):
        return None
    planes = {n: plane_body(bodies[n], u, scale) for n, u in displacement.items()}
    shown = {name: plane for name, plane in planes.items() if plane}
    return Section(shown, joints) if len(shown) == len(planes) else None
