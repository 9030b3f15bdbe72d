"""The deformed scene as lines and faces, step by step.

All of it is meant to be shown as displaced by one factor: what has no displacement of its own
(water, marks that come and go) is given the one that brings it to its place.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..model.case import Case
from ..model.fields import BODIES, OPEN, SLIPPED, SOFTENING, distance, nearest_rows, state_of
from ..model.loads import Loading, line_forces
from ..model.mesh import SIDES, Body
from ..post.outline import section_of, skin
from .worker import Scene

#: Length of a force's arrow, over the dam's height.
ARROW = 0.12
#: What water stands above: the lines of a section.
RESERVOIR, OVER, TAIL = ("upstream", "floor"), ("crest",), ("bed", "downstream")


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


def standing(edges: np.ndarray, level: float) -> np.ndarray:
    """Quadrangles (n, 4, 2) of what stands above edges (n, 2, 2) up to a level; of no area where
    the level is below.
    """
    order = np.argsort(edges[:, :, 1:], axis=1, kind="stable")
    low, high = np.take_along_axis(edges, order, axis=1).transpose(1, 0, 2)
    rise, wet = high[:, 1] - low[:, 1], level > low[:, 1]
    share = np.divide(level - low[:, 1], rise, out=np.ones(len(rise)), where=rise > 0)
    end = low + (share.clip(0, 1) * wet)[:, None] * (high - low)
    surface = [np.column_stack([at[:, 0], np.where(wet, level, at[:, 1])]) for at in (end, low)]
    return np.stack([low, end, *surface], axis=1)


def in_space(quads: np.ndarray, depth: float) -> np.ndarray:
    """Quadrangles of `standing`, (..., n, 4, 2), with z; over a depth both sides, and the top."""
    near, far = (np.insert(quads, 2, z, axis=-1) for z in (depth, 0.0))
    if not depth:
        return near
    top = np.concatenate([near[..., 2:, :], far[..., :1:-1, :]], axis=-2)
    return np.concatenate([near, far, top], axis=-3)


def arrow(tip: np.ndarray, force: np.ndarray, length: float) -> np.ndarray:
    """Lines (3, 2, 3) of an arrow that ends at tip (3,), along a force (2,): a point if that is
    nothing.
    """
    x, y = force / (np.hypot(*force) or 1.0)
    behind = length * np.array([(x, y, 0), (x + y / 2, y - x / 2, 0), (x - y / 2, y + x / 2, 0)])
    behind[1:] /= 4  # the barbs
    return np.stack([tip - behind, np.broadcast_to(tip, (3, 3))], axis=1)


def extruded(case: Case) -> bool:
    """Whether one plane section tells all of the geometry."""
    return not (case.geometry and case["dim"] == 3)


def sized(corners: np.ndarray) -> bool:
    """Whether some of the elements (..., corners, 3) are more than points."""
    return bool(np.ptp(corners, axis=-2).any())


def planned(case: Case) -> dict[str, Pieces]:
    """What acts on the undeformed section in the end, of that there is: water, silt, forces."""
    if case.geometry:  # its faces are known with its mesh
        return {}
    section, depth = case.section, case["thickness"] if case["dim"] == 3 else 0.0
    ends = [[section["seg_x0"], section["seg_y0"]], [section["seg_x1"], section["seg_y1"]]]
    edges = np.array(ends).transpose(2, 0, 1)
    before = lambda *sides: edges[np.isin(section["seg_side"], [SIDES.index(n) for n in sides])]
    level, tail = max(case.levels), max(case.tail_levels)
    over = level if case["crest_water"] else -np.inf
    water = (before("up", "floor"), level), (before("top"), over), (before("down", "bed"), tail)
    silt = standing(before("up", "floor"), case["silt_height"])
    forces = line_forces(case, Loading.at(case, np.inf, level, tail)).values()
    tips = [
        np.array([x, y, depth]) for x, y in zip(section["mark_x"], section["mark_y"], strict=True)
    ]
    length = ARROW * case.size
    arrows = [arrow(*mark, length) for mark in zip(tips, map(np.array, forces), strict=True)]
    found = {
        "water": in_space(np.concatenate([standing(*part) for part in water]), depth),
        "silt": in_space(silt, depth),
        "forces": np.concatenate([np.zeros((0, 2, 3)), *arrows]),
    }
    still = lambda corners: Pieces(corners, np.ones((1, *corners.shape[:2], 1)))
    return {name: still(corners) for name, corners in found.items() if sized(corners)}


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
        exact = 0.06 * case.size / largest if largest > 0 else 1.0
        self.scale = float(f"{exact:.1g}")
        self.skins = {name: skin(self.scene.bodies[name]) for name in BODIES}
        self.depth = self.scene.bodies["dam"].points[:, 2].max()
        self.rows = [self.scene.result.at(time) for time in self.times]
        states = [self.scene.result.state(time) for time in self.times]
        self.loadings = [
            Loading.at(case, time, state["level"], state["tail_level"])
            for time, state in zip(self.times, states, strict=True)
        ]
        # the joint's nodes on the side that is looked at, from heel to toe, and their rows
        joint, way = self.scene.bodies["joint"], distance(self.rows[0])
        near = joint.points[:, 2] > joint.points[:, 2].max() - 1e-9 * way.max()
        row = nearest_rows(joint.points[near], self.rows[0])
        order = np.argsort(way[row])
        self.lip_tags, self.lip_rows = joint.node_tags[near][order], row[order]
        #: undeformed, and step by step; None where one section does not tell all
        ends = np.column_stack([self.rows[0][axis] for axis in "xy"])[[way.argmin(), way.argmax()]]
        self.still, *self.sections = (
            section_of(self.scene.bodies, fields[time].displacement, scale, ends)
            if extruded(case)
            else None
            for time, scale in [(self.times[0], 0.0), *((t, self.scale) for t in self.times)]
        )

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
        body = self.scene.bodies[name]
        place = np.searchsorted(body.node_tags, self.lip_tags)
        return body.points[place], self.moved[name][:, place]

    def at_lip(self, values: Callable[[dict[str, np.ndarray]], np.ndarray]) -> np.ndarray:
        """What comes of the joint's rows, along that side, (steps, n)."""
        return np.array([values(rows)[self.lip_rows] for rows in self.rows])

    def marks(self) -> dict[str, Pieces]:
        """Both lips of the joint where it is open or broken, softens, or has slipped.

        A part that is not in that state at a step is drawn in a point.
        """
        states = {"open": OPEN, "softening": SOFTENING, "slipped": SLIPPED}
        found: dict[str, list] = {name: [] for name in states}
        state = self.at_lip(state_of)
        both = np.minimum(state[:, :-1], state[:, 1:])
        for name in BODIES:
            points, moved = self.lip(name)
            ends = np.stack([points[:-1], points[1:]], axis=1)
            to = np.stack([moved[:, :-1], moved[:, 1:]], axis=2)
            for name, number in states.items():
                where, shown = both == number, to.copy()
                away = (to[:, :, 0] - to[:, :, 1]) + (ends[:, 0] - ends[:, 1]) / self.scale
                shown[:, :, 1] += np.where(where[:, :, None], 0.0, away)
                found[name].append(Pieces(ends, shown))
        return {
            state: Pieces(
                np.concatenate([p.points for p in parts]),
                np.concatenate([p.values for p in parts], axis=1),
            )
            for state, parts in found.items()
        }

    def beside(self) -> dict[str, Pieces]:
        """What acts on the dam, of that there is: water, silt, forces."""
        found = {"water": self.water(), "silt": self.silt(), "forces": self.forces()}
        return {name: self.placed(corners) for name, corners in found.items() if sized(corners)}

    def water(self) -> np.ndarray:
        """Reservoir and tailwater up to their levels, and water between open lips."""
        level, tail = ([getattr(now, name) for now in self.loadings] for name in ("level", "tail"))
        over = level if self.scene.result.case["crest_water"] else [-np.inf] * len(level)
        parts = (RESERVOIR, level), (OVER, over), (TAIL, tail)
        return np.concatenate([*(self.held(*part) for part in parts), self.crack()], axis=1)

    def silt(self) -> np.ndarray:
        """What has settled upstream, as soon as some of it presses."""
        height = self.scene.result.case["silt_height"]
        return self.held(
            RESERVOIR, [height if now.part("silt") else -np.inf for now in self.loadings]
        )

    def forces(self) -> np.ndarray:
        """Arrows of forces and earthquake; points where there is nothing of them yet."""
        case, found = self.scene.result.case, []
        for i, now in enumerate(self.loadings):
            forces = [(self.tips(name)[i], f) for name, f in line_forces(case, now).items()]
            if self.still:
                push = now.part("quake") * np.array([case["k_h"], case["k_v"]])
                forces.append((np.append(self.sections[i].dam.centroid, self.depth), push))
            arrows = [arrow(tip, np.array(f), ARROW * case.size) for tip, f in forces]
            found.append(np.concatenate([np.zeros((0, 2, 3)), *arrows]))
        return np.array(found)

    def tips(self, name: str) -> np.ndarray:
        """Where a line force acts, on the side that is looked at, (steps, 3)."""
        line = self.scene.bodies[name]
        tag = line.node_tags[line.points[:, 2].argmax()]
        owner = next(n for n in BODIES if tag in self.scene.bodies[n].node_tags)
        at = np.searchsorted(self.scene.bodies[owner].node_tags, tag)
        return self.scene.bodies[owner].points[at] + self.scale * self.moved[owner][:, at]

    def placed(self, corners: np.ndarray) -> Pieces:
        """Faces whose corners (steps, n, 4, 3) move, as pieces whose displacement brings them
        there.
        """
        last = corners[-1]
        return Pieces(last, (corners - last) / self.scale)

    def held(self, shore: tuple[str, ...], levels: list[float]) -> np.ndarray:
        """What stands above lines of the section up to a level by step, (steps, n, 4, 3).

        Lines that it does not reach undeformed stay dry: a displacement is exaggerated.
        """
        if not self.still:
            return np.zeros((len(levels), 0, 4, 3))
        line = lambda section: np.concatenate([getattr(section, name) for name in shore])
        ground, found = line(self.still)[:, 1].min(), []
        for section, level in zip(self.sections, levels, strict=True):
            edges = np.stack([line(section)[:-1], line(section)[1:]], axis=1)
            found.append(standing(edges, level if level > ground else -np.inf))
        return in_space(np.array(found), self.depth)

    def crack(self) -> np.ndarray:
        """Quadrangles of the water between open lips that stand under pressure."""
        below, down = self.lip("foundation")
        above, up = self.lip("dam")
        wet = self.at_lip(lambda rows: (state_of(rows) == OPEN) & (rows["p"] > 0))
        wet = (wet[:, :-1] & wet[:, 1:])[..., None, None]
        low, high = below + self.scale * down, above + self.scale * up
        faces = np.stack([low[:, :-1], low[:, 1:], high[:, 1:], high[:, :-1]], axis=2)
        return np.where(wet, faces, faces[:, :, :1])
