"""The deformed scene as lines and faces, step by step.

All of it is meant to be shown as displaced by one factor: what has no displacement of its own
(water, marks that come and go) is given the one that brings it to its place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..results.fields import BODIES
from ..results.outline import skin
from ..scene.case import Case
from ..scene.mesh import Body
from .worker import Scene

#: Strips of the water beside a face: it follows the bent face.
STRIPS = 12


def frame(case: Case) -> tuple[float, float, float]:
    """What is shown of a scene: x from, x to, y from [m]; up to the crest."""
    height = case["dam_height"]
    beside = min(case["found_side"], 0.6 * height)
    return -beside, case["dam_base"] + beside, -min(case["found_depth"], 0.5 * height)


@dataclass
class Pieces:
    """Lines or faces: points (n, corners, 3) [m], values (steps, n, corners, components)."""

    points: np.ndarray
    values: np.ndarray

    def kind(self) -> str:
        """What Gmsh calls them in list data."""
        return {1: "S", 3: "V"}[self.values.shape[3]] + " PLTQ"[self.points.shape[1]]

    def listed(self) -> np.ndarray:
        """As list data: all x, y, z of an element, then its values step by step."""
        count = len(self.points)
        places = self.points.transpose(0, 2, 1).reshape(count, -1)
        return np.hstack([places, self.values.transpose(1, 0, 2, 3).reshape(count, -1)])


def rims(body: Body, faces: list[np.ndarray]) -> np.ndarray:
    """Edges where a skin ends or bends, (n, 2) point numbers."""
    edges, normals = [], []
    for table in faces:
        corners = body.points[table]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        across /= np.linalg.norm(across, axis=1)[:, None]
        for i in range(table.shape[1]):
            edges.append(table[:, [i, (i + 1) % table.shape[1]]])
            normals.append(across)
    edges, normals = np.sort(np.concatenate(edges), axis=1), np.concatenate(normals)
    order = np.lexsort(edges.T)
    edges, normals = edges[order], normals[order]
    _, at, count = np.unique(edges, axis=0, return_index=True, return_counts=True)
    alike = np.ones(len(at), bool)
    pairs = count == 2
    first = at[pairs]
    alike[pairs] = np.abs(np.einsum("ij,ij->i", normals[first], normals[first + 1])) < 0.9
    return edges[at[alike]]


@dataclass
class Deformed:
    """A scene drawn with its displacement times `scale`; at least one requested time reached."""

    scene: Scene

    def __post_init__(self) -> None:
        case, fields = self.scene.result.case, self.scene.fields
        self.times = [float(time) for time in self.scene.times]
        self.moved = {
            name: np.array([fields[time].displacement[name] for time in self.times])
            for name in BODIES
        }
        largest = max(np.abs(u).max() for u in self.moved.values())
        exact = 0.06 * case["dam_height"] / largest if largest > 0 else 1.0
        self.scale = float(f"{exact:.1g}")
        self.skins = {name: skin(self.scene.bodies[name]) for name in BODIES}
        self.depth = case["thickness"] if case["dim"] == 3 else 0.0

    def bodies(self) -> list[Pieces]:
        """The faces of dam and foundation with their displacement [m]."""
        return [
            Pieces(self.scene.bodies[name].points[faces], self.moved[name][:, faces])
            for name in BODIES
            for faces, _ in self.skins[name]
        ]

    def stress(self) -> list[Pieces]:
        """The same faces, undeformed, with the vertical stress of their elements [Pa]."""
        fields, found = self.scene.fields, []
        for name in BODIES:
            vertical = np.array([fields[time].stress[name][:, 1] for time in self.times])
            for faces, owners in self.skins[name]:
                values = np.repeat(vertical[:, owners, None, None], faces.shape[1], axis=2)
                found.append(Pieces(self.scene.bodies[name].points[faces], values))
        return found

    def outline(self) -> Pieces:
        """The edges of dam and foundation."""
        points, values = [], []
        for name in BODIES:
            body = self.scene.bodies[name]
            edges = rims(body, [faces for faces, _ in self.skins[name]])
            points.append(body.points[edges])
            values.append(self.moved[name][:, edges])
        return Pieces(np.concatenate(points), np.concatenate(values, axis=1))

    def lip(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """A body's lip on the side that is looked at: points (n, 3) from heel to toe, and their
        displacement (steps, n, 3).
        """
        points, base = self.scene.bodies[name].points, self.scene.result.case["dam_base"]
        near = 1e-9 * base
        on = (np.abs(points[:, 1]) < near) & (np.abs(points[:, 2] - self.depth) < near)
        on &= (points[:, 0] > -near) & (points[:, 0] < base + near)
        place = np.flatnonzero(on)[np.argsort(points[on, 0])]
        return points[place], self.moved[name][:, place]

    def at_lip(self, column: str, x: np.ndarray) -> np.ndarray:
        """A column of joint.csv at places along the side that is looked at, (steps, n)."""
        found = []
        for time in self.times:
            rows = self.scene.result.at(time)
            side = np.abs(rows["z"] - self.depth) < 1e-6 * max(self.depth, 1e-300)
            side = side if side.any() else np.ones(len(side), bool)
            found.append(np.interp(x, rows["x"][side], rows[column][side]))
        return np.array(found)

    def marks(self) -> dict[str, Pieces]:
        """Both lips of the joint where it is open or broken, and where it has slipped else.

        A part that is not in that state at a step is drawn in a point.
        """
        found: dict[str, list] = {"open": [], "slipped": []}
        for name in BODIES:
            points, moved = self.lip(name)
            gone = self.at_lip("damage", points[:, 0]) >= 1
            slid = self.at_lip("slip", points[:, 0]) > 0
            is_open = gone[:, :-1] & gone[:, 1:]
            has_slipped = slid[:, :-1] & slid[:, 1:] & ~is_open
            ends = np.stack([points[:-1], points[1:]], axis=1)
            to = np.stack([moved[:, :-1], moved[:, 1:]], axis=2)
            for state, where in (("open", is_open), ("slipped", has_slipped)):
                shown = to.copy()
                away = (to[:, :, 0] - to[:, :, 1]) + (ends[:, 0] - ends[:, 1]) / self.scale
                shown[:, :, 1] += np.where(where[:, :, None], 0.0, away)
                found[state].append(Pieces(ends, shown))
        return {
            state: Pieces(
                np.concatenate([p.points for p in parts]),
                np.concatenate([p.values for p in parts], axis=1),
            )
            for state, parts in found.items()
        }

    def water(self) -> Pieces:
        """Reservoir and tailwater up to their levels, and water between open lips."""
        corners = [self.reservoir(), self.crack()]
        if max(self.scene.result.case.tail_levels) > 0:
            corners.append(self.tailwater())
        return self.placed(np.concatenate(corners, axis=1))

    def placed(self, corners: np.ndarray) -> Pieces:
        """Faces whose corners (steps, n, 4, 3) move, as pieces whose displacement brings them
        there.
        """
        last = corners[-1]
        return Pieces(last, (corners - last) / self.scale)

    def reservoir(self) -> np.ndarray:
        """Quadrangles of the water upstream, (steps, n, 4, 3)."""
        case = self.scene.result.case
        level = [self.level("level", time) for time in self.times]
        return self.beside("upstream", level, lambda y: np.zeros_like(y), frame(case)[0])

    def tailwater(self) -> np.ndarray:
        """Quadrangles of the water downstream."""
        case = self.scene.result.case
        level = [self.level("tail_level", time) for time in self.times]
        lean = (case["dam_base"] - case["dam_crest"]) / case["dam_height"]
        face = lambda y: case["dam_base"] - lean * y
        return self.beside("downstream", level, face, frame(case)[1])

    def level(self, column: str, time: float) -> float:
        """A water level at a requested time [m]: the one found, if a displacement is prescribed."""
        history = self.scene.result.history
        return float(history[column][np.argmin(np.abs(history["time"] - time))])

    def beside(self, face: str, levels: list[float], face_x, far: float) -> np.ndarray:
        """Strips of water between a face, displaced, and x = far; in 3D both sides and the top."""
        dam = self.scene.bodies["dam"]
        near = 1e-9 * self.scene.result.case["dam_height"]
        on = np.abs(dam.points[:, 0] - face_x(dam.points[:, 1])) < near
        on &= np.abs(dam.points[:, 2] - self.depth) < near
        place = np.flatnonzero(on)[np.argsort(dam.points[on, 1])]
        found = []
        for moved, level in zip(self.moved["dam"], levels, strict=True):
            y = np.linspace(0, level, (1 if self.depth else STRIPS) + 1)
            x = face_x(y) + self.scale * np.interp(y, dam.points[place, 1], moved[place, 0])
            sides = []
            for z in {0.0, self.depth}:
                beside = np.column_stack([np.full_like(y, far), y, np.full_like(y, z)])
                wet = np.column_stack([x, y, np.full_like(y, z)])
                sides.append(np.stack([beside[:-1], wet[:-1], wet[1:], beside[1:]], axis=1))
            if self.depth:
                ends = (far, 0), (x[-1], 0), (x[-1], self.depth), (far, self.depth)
                sides.append(np.array([[(at, level, z) for at, z in ends]]))
            found.append(np.concatenate(sides))
        return np.array(found)

    def crack(self) -> np.ndarray:
        """Quadrangles of the water between open lips that stand under pressure."""
        below, down = self.lip("foundation")
        above, up = self.lip("dam")
        x = above[:, 0]
        wet = (self.at_lip("damage", x) >= 1) & (self.at_lip("p", x) > 0)
        wet = (wet[:, :-1] & wet[:, 1:])[..., None, None]
        low, high = below + self.scale * down, above + self.scale * up
        faces = np.stack([low[:, :-1], low[:, 1:], high[:, 1:], high[:, :-1]], axis=2)
        return np.where(wet, faces, faces[:, :, :1])
