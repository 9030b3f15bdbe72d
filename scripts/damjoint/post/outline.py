"""The mesh seen from outside: the skins of its bodies; in the plane, the outlines of the body above
the joint and of what lies under it, with the faces that water stands against.

All of it comes from the mesh, whatever the section.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model.mesh import Body

#: Faces of cells: corners by shape.
FACES = {
    "triangle": ([0, 1, 2],),
    "quad": ([0, 1, 2, 3],),
    "tetra": ([0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]),
    "wedge": ([0, 1, 2], [3, 4, 5], [0, 1, 4, 3], [1, 2, 5, 4], [0, 2, 5, 3]),
    "hexahedron": (
        [0, 1, 2, 3],
        [4, 5, 6, 7],
        [0, 1, 5, 4],
        [1, 2, 6, 5],
        [2, 3, 7, 6],
        [3, 0, 4, 7],
    ),
}


def skin(body: Body) -> list[tuple[np.ndarray, np.ndarray]]:
    """What is seen of a body: faces as rows of point numbers, and the element each belongs to.

    In 2D all elements, in 3D the faces that belong to one element only.
    """
    found: dict[int, list] = {}
    first = 0
    for shape, table in body.cells:
        for side in FACES[shape]:
            found.setdefault(len(side), []).append(
                (table[:, side], np.arange(first, first + len(table)))
            )
        first += len(table)
    parts = []
    for some in found.values():
        faces, owners = (np.concatenate(part) for part in zip(*some, strict=True))
        # three corners tell a face, and one number the three
        low, middle, high = np.sort(faces, axis=1).T[:3].astype(np.int64)
        name = (low * len(body.points) + middle) * len(body.points) + high
        _, at, count = np.unique(name, return_index=True, return_counts=True)
        outer = at[count == 1]
        parts.append((faces[outer], owners[outer]))
    return parts


def boundary(points: np.ndarray, faces: list[np.ndarray]) -> np.ndarray:
    """The longest closed line around plane faces, counterclockwise, as point numbers."""
    edges = []
    for table in faces:
        (x, y), (x1, y1) = (
            points[t, :2].transpose(2, 0, 1) for t in (table, np.roll(table, -1, 1))
        )
        clockwise = np.sum(x * y1 - x1 * y, axis=1) < 0
        table = np.where(clockwise[:, None], table[:, ::-1], table)
        edges.append(np.stack([table, np.roll(table, -1, axis=1)], axis=-1).reshape(-1, 2))
    ends = np.concatenate(edges).astype(np.int64)
    name, back = ends @ (len(points), 1), ends @ (1, len(points))
    follow = dict(ends[~np.isin(name, back)].tolist())
    loops = []
    while follow:
        first, here = follow.popitem()
        loops.append([first])
        while here != first:
            loops[-1].append(here)
            here = follow.pop(here, first)
    return np.array(max(loops, key=len))


@dataclass
class Plane:
    """A body in the plane: places (n, 2) [m] before and after its displacement (exaggerated), faces
    by region, its outline as point numbers.
    """

    points: np.ndarray
    moved: np.ndarray
    faces: dict[str, list[np.ndarray]]
    loop: np.ndarray

    @property
    def centroid(self) -> np.ndarray:
        """Of what its displaced outline holds, by the shoelace formula (2,) [m]."""
        here = self.moved[self.loop]
        after = np.roll(here, -1, axis=0)
        cross = here[:, 0] * after[:, 1] - after[:, 0] * here[:, 1]
        return cross @ (here + after) / (3 * cross.sum())

    def nearest(self, place: np.ndarray) -> int:
        """Where in the outline the point nearest to a place (2,) is."""
        return int(np.argmin(((self.points[self.loop] - place) ** 2).sum(axis=1)))

    def between(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """The outline from the point nearest to a place to that nearest to another, point
        numbers.
        """
        first, last = self.nearest(start), self.nearest(end)
        return np.roll(self.loop, -first)[: (last - first) % len(self.loop) + 1]


def plane_of(body: Body, displacement: np.ndarray, scale: float) -> Plane | None:
    """A body at its lowest z; None if it shows no face there."""
    points = body.points[:, :2]
    low = body.points[:, 2].min() + 1e-9 * np.ptp(points, axis=0).max()
    region = np.repeat(body.regions, [len(table) for _, table in body.cells])
    faces = {}
    for table, owners in skin(body):
        front = np.all(body.points[table, 2] < low, axis=1)
        for name in dict.fromkeys(body.regions):
            own = front & (region[owners] == name)
            faces.setdefault(name, []).extend([table[own]] if own.any() else [])
    tables = [table for some in faces.values() for table in some]
    if not tables:
        return None
    moved = points + scale * displacement[:, :2]
    return Plane(points, moved, faces, boundary(points, tables))


@dataclass
class Section:
    """The plane section: the dam above the joint, what lies under it, the joint's ends."""

    dam: Plane
    under: Plane
    heel: np.ndarray
    toe: np.ndarray

    def __post_init__(self) -> None:
        self.lips = (
            (self.dam, self.dam.between(self.heel, self.toe)),
            (self.under, self.under.between(self.toe, self.heel)[::-1]),
        )
        around = self.dam.between(self.toe, self.heel)
        height = self.dam.points[around, 1]
        top = np.flatnonzero(height > height.max() - 1e-6 * np.ptp(height))
        #: height of the crest before the displacement [m]
        self.top = height.max()
        #: faces and crest of the dam, each from downstream to upstream
        self.downstream = self.dam.moved[around[: top[0] + 1]]
        self.crest = self.dam.moved[around[top[0] : top[-1] + 1]]
        self.upstream = self.dam.moved[around[top[-1] :]]
        ground = self.under.between(self.heel, self.toe)
        x = self.under.points[ground, 0]
        near = 1e-6 * np.ptp(x)
        left = np.flatnonzero(x < x.min() + near)[0]
        right = np.flatnonzero(x > x.max() - near)[-1]
        #: what lies under the joint: from the heel outwards upstream, and downstream to the toe
        self.floor = self.under.moved[ground[: left + 1]]
        self.bed = self.under.moved[ground[right:]]

    def reservoir(self, level: float) -> np.ndarray:
        """The polygon that stands against the faces upstream, and over the crest, up to a level,
        (n, 2) [m].
        """
        crest = self.crest[: -1 if level > self.top else 0]
        return filled(np.concatenate([crest, self.upstream, self.floor]), level)

    def tailwater(self, level: float) -> np.ndarray:
        """The polygon that stands against the faces downstream up to a level, (n, 2) [m]."""
        return filled(np.concatenate([self.bed, self.downstream]), level)


def section_of(
    bodies: dict[str, Body], displacement: dict[str, np.ndarray], scale: float, ends: np.ndarray
) -> Section | None:
    """The section of a mesh at its lowest z, displaced; None if it shows none there.

    ends: heel and toe of the joint (2, 2 or 3) [m].
    """
    planes = [plane_of(bodies[n], displacement[n], scale) for n in ("dam", "foundation")]
    return Section(*planes, ends[0, :2], ends[1, :2]) if all(planes) else None


def filled(shore: np.ndarray, level: float) -> np.ndarray:
    """What a shore (n, 2), open above, holds up to a level, as a polygon (possibly empty)."""
    rim = max(level, shore[:, 1].max()) + 1
    polygon = np.concatenate([[[shore[0, 0], rim]], shore, [[shore[-1, 0], rim]]])
    found = []
    for here, after in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if here[1] <= level:
            found.append(here)
        if (here[1] - level) * (after[1] - level) < 0:
            found.append(here + (after - here) * (level - here[1]) / (after[1] - here[1]))
    return np.array(found).reshape(-1, 2)
