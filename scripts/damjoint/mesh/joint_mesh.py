"""The mesh of a joint, and that of a face that water can press on."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..arrays import Array, IntArray
from ..input.case import OfJoint
from .body import Body
from .sides import area

#: Extent along z over that along y below which a joint faces along z.
FLAT = 1e-6


@dataclass
class Face:
    """A face that water can press on: its surface, normals outwards; the name of its body; its side
    (one of SIDES); lowest and highest y [m] of a straight face (nan for any other).
    """

    surface: Body
    body: str
    side: str
    low: float = np.nan
    high: float = np.nan

    @property
    def lowest(self) -> float:
        """Lowest y [m]."""
        return float(self.surface.points[:, 1].min()) if np.isnan(self.low) else self.low


@dataclass
class JointMesh:
    """The mesh of a joint: its surface, normals from the lower to the upper body; the lines (in the
    plane: points) where it ends; names of its bodies.
    """

    dim: int
    surface: Body
    heel: Body
    toe: Body
    upper: str
    lower: str
    #: for messages
    name: str
    #: tags of the surface's nodes in the upper body; in the lower one they are the surface's
    upper_tags: IntArray
    #: whether it has nodes of other joints; tags of the nodes of heel and toe that lie at another
    #: joint, not on the surface of the dam and its rock
    meets: bool = False
    inner_ends: IntArray = field(default_factory=lambda: np.zeros(0, int))

    def face(self, above: bool) -> Body:
        """The surface as a part of the body above or below it."""
        return replace(self.surface, node_tags=self.upper_tags) if above else self.surface

    @cached_property
    def heel_nodes(self) -> IntArray:
        """Indices of the surface's nodes at the heel."""
        return np.flatnonzero(np.isin(self.surface.node_tags, self.heel.node_tags))

    @cached_property
    def toe_nodes(self) -> IntArray:
        """Indices of the surface's nodes at the toe."""
        return np.flatnonzero(np.isin(self.surface.node_tags, self.toe.node_tags))

    @property
    def width(self) -> float:
        """Extent along z, or along y if it faces along z [m]; 1 in the plane."""
        if self.dim == 2:
            return 1.0
        _, y, z = np.ptp(self.surface.points, axis=0)
        return float(z if z > FLAT * y else y)

    @property
    def heel_line(self) -> tuple[Array, Array]:
        """The two points (3,) of the heel farthest from its middle; in the plane the same."""
        points = self.heel.points
        along = points - points.mean(axis=0)
        first = int(np.argmax(np.linalg.norm(along, axis=1)))
        return points[first], points[int(np.argmin(along @ along[first]))]

    @property
    def ends(self) -> dict[str, list[float]]:
        """Heel, toe and length, by the names of pro/section.pro."""
        heel, toe = (line.points[:, :2].mean(axis=0) for line in (self.heel, self.toe))
        return ends_of(heel, toe, area(self.surface) / self.width)

    @property
    def of_case(self) -> OfJoint:
        """Name, bodies and ends, for its case."""
        return OfJoint(
            name=self.name, upper=self.upper, lower=self.lower, values={}, section=self.ends
        )


def heel_normal(joint: Body, heel: Body) -> Array:
    """The joint's normal at its heel, a mean of the elements there."""
    near = [np.isin(joint.node_tags[t], heel.node_tags).any(axis=1) for _, t in joint.cells]
    normal: Array = joint.normals[np.concatenate(near)].mean(axis=0)
    return normal


def ends_of(heel: Array, toe: Array, along: float) -> dict[str, list[float]]:
    """The joint by the names of pro/section.pro, from its ends (2,) and its length [m]."""
    length = float(np.linalg.norm(toe - heel))
    values = (*heel, *toe, length, along)
    names = ("heel_x", "heel_y", "toe_x", "toe_y", "joint_length", "joint_along")
    return {name: [float(value)] for name, value in zip(names, values, strict=True)}
