"""The joints of condensed bodies, whatever their laws, water and levels: interpolations, assembly
of their stiffness, flow operators.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from .. import ROUND_OFF
from ..arrays import Array, IntArray, distinct
from ..csr import CsrMatrix, added, stacked
from ..fem import elements
from ..fem.cache import bodies_key, condensed_bodies
from ..fem.condensed import Condensed, CondensedJoint
from ..input.case import Case, OfJoint
from ..input.scene import UP
from ..mesh.chord import Chord
from ..mesh.joint_mesh import heel_normal
from ..model.network import Network
from .assembly import Assembly
from .flow import Flow, JointFields, Wetted
from .linear_system import LinearSystem, WoodburySystem
from .wet_faces import WetFace, points_where


def frames(normals: Array) -> Array:
    """Local axes of elements with these normals, in rows, (elements, 3, 3): normal; tangent 1, x
    projected onto the element (downstream); tangent 2, tangent 1 x normal (z on a level joint).
    """
    along = np.array([1.0, 0, 0]) - normals[:, :1] * normals
    # an element perpendicular to x: tangent 1 is the normal turned by a right angle, as elsewhere
    risers = np.linalg.norm(along, axis=1) < ROUND_OFF
    along[risers] = np.column_stack(
        [np.zeros(risers.sum()), -normals[risers, 0], np.zeros(risers.sum())]
    )
    along /= np.linalg.norm(along, axis=1)[:, None]
    return np.stack([normals, along, np.cross(along, normals)], axis=1)


def jumps_from(matrix: CsrMatrix, unknowns: Array, dim: int) -> Array:
    """delta_n, delta_t1, delta_t2 (q, 3) by a matrix of dim rows for each point."""
    jumps = np.zeros((matrix.shape[0] // dim, 3))
    jumps[:, :dim] = (matrix @ unknowns).reshape(-1, dim)
    return jumps


class JointInterface:
    """A joint of condensed bodies; unknowns: the free displacement jumps of all joints (j,)."""

    def __init__(self, bulk: Condensed, joint: CondensedJoint, quadrature: str) -> None:
        self.dim, self.order = bulk.dim, bulk.order
        self.mesh, self.surface = joint.mesh, joint.mesh.surface
        space = self.space = elements.Space(self.surface, bulk.order)
        #: jump of the space's functions from the unknowns, dim rows each
        self.unknowns = joint.dofs.matrix(self.dim * len(space.locations), bulk.size)
        #: number of Gauss points of the law, by shape
        self.rule = elements.JOINT[quadrature][bulk.order]
        self.points = elements.points_of(space, self.rule)
        self.frames = frames(self.surface.normals)
        #: whether the joint is a plane, up to rounding of its nodes
        self.flat = np.allclose(self.frames, self.frames[0], rtol=0, atol=ROUND_OFF)
        #: jump at the Gauss points from the unknowns, dim rows each: normal, tangent 1, tangent 2
        self.at_points = self.components(self.points.values, self.frames[self.points.elements])
        #: jump at the nodes likewise, dim rows for each of `rows`, indices of locations; where the
        #: joint bends, a node has rows in the frame of each of its elements
        self.rows, node_frames = self._node_frames()
        self.at_nodes = self.components(space.interpolation(bulk.order)[self.rows], node_frames)
        self.heel = self._heel_row()
        self.chord = Chord.of(self.mesh)
        #: extent along z [m], 1 in 2D
        self.width = self.mesh.width
        #: from heel to toe along the joint [m], a mean in 3D
        self.length = self.points.weights.sum() / self.width

    def _node_frames(self) -> tuple[IntArray, Array]:
        """Locations (rows,) and frames of their jumps (rows, 3, 3); on a plane joint one each."""
        if self.flat:
            number = len(self.space.locations)
            return np.arange(number), np.broadcast_to(self.frames[0], (number, 3, 3))
        tables = [table for _, table in self.space.connectivity]
        sizes = np.concatenate([np.full(len(t), t.shape[1]) for t in tables])
        rows = np.concatenate([t.ravel() for t in tables])
        return rows, np.repeat(self.frames, sizes, axis=0)

    def mean_at_nodes(self, values: Array) -> Array:
        """Mean at each location of values (rows,) or (rows, n) in the order of `rows`."""
        if len(self.rows) == len(self.space.locations):
            return values
        count = np.bincount(self.rows)
        columns = values[:, None] if values.ndim == 1 else values
        means = [np.bincount(self.rows, column) / count for column in columns.T]
        return np.column_stack(means) if values.ndim > 1 else means[0]

    def components(self, values: CsrMatrix, frames: Array, most: int = 3) -> CsrMatrix:
        """The first `most` components in frames (q, 3, 3) of the jump, interpolated by values (q,
        functions): point by point, from the unknowns.
        """
        parts = [values @ self.unknowns[c :: self.dim] for c in range(self.dim)]
        number = min(self.dim, most)

        def along(axes: Array) -> CsrMatrix:
            return added([part.scaled(axes[:, c]) for c, part in enumerate(parts)])

        rows = stacked([along(frames[:, k]) for k in range(number)])
        rows = rows.where(rows.data != 0)
        return rows[np.arange(rows.shape[0]).reshape(number, -1).T.ravel()]

    def jumps(self, matrix: CsrMatrix, unknowns: Array) -> Array:
        """delta_n, delta_t1, delta_t2 (q, 3) by at_points or at_nodes."""
        return jumps_from(matrix, unknowns, self.dim)

    @cached_property
    def unit_opening(self) -> Array:
        """Unknowns (j,) of an opening of 1 m along the whole joint; nearly, where joints meet."""
        normal = self.points.weights @ self.frames[self.points.elements, 0]
        normal /= np.linalg.norm(normal)
        return self.unknowns.T @ np.tile(normal[: self.dim], len(self.space.locations))

    def extrapolate(self, values: Array) -> Array:
        """Values (corners, n) at the corner nodes from values (q, n) at the Gauss points: a linear
        function of each element, mean over the elements around a node.
        """
        number, start = len(self.surface.points), 0
        total, count = np.zeros((number, values.shape[1])), np.zeros((number, 1))
        for shape, cells in self.surface.cells:
            points = self.rule[shape]
            of_cells = values[start : start + points * len(cells)].reshape(len(cells), points, -1)
            start += points * len(cells)
            at_corners = elements.to_corners(shape, points) @ of_cells
            np.add.at(total, cells, at_corners)
            np.add.at(count, cells, 1)
        return total / count

    def _heel_row(self) -> Array:
        """Mean opening along the heel, from the unknowns."""
        heel = elements.Space(self.mesh.heel, self.order)
        points = elements.points_of(heel, elements.WATER)
        functions = self.space.find(heel)
        normal = heel_normal(self.surface, heel.body)
        weights = np.zeros(len(self.space.locations))
        weights[functions] = points.values.T @ points.weights / points.weights.sum()
        return np.asarray(self.unknowns.T @ np.outer(weights, normal[: self.dim]).ravel())

    @property
    def section(self) -> dict[str, list[float]]:
        """Ends and length of the joint, by the names of pro/section.pro."""
        ends = self.mesh.ends
        return ends | {"joint_along": [float(self.length)]}

    # -- water

    @cached_property
    def wetted(self) -> Wetted:
        """The quadrature of the water's force on the whole joint."""
        points = elements.points_of(self.space, elements.WATER)
        linear = elements.points_of(elements.Space(self.surface, 1), elements.WATER)
        return self._wetted(points, linear.values)

    def wetted_within(self, distance: float) -> Wetted:
        """The same for the part within a distance from the heel [m]."""
        linear = elements.Space(self.surface, 1)
        height = self.fields.from_heel - distance
        points, fields = (points_where(space, height) for space in (self.space, linear))
        return self._wetted(points, fields.values)

    def _wetted(self, points: elements.Points, fields: CsrMatrix) -> Wetted:
        opening = self.components(points.values, self.frames[points.elements], 1)
        return Wetted(points=points, opening=opening, fields=fields)

    @cached_property
    def flow(self) -> Flow:
        """Operators of water that flows in the joint."""
        wet = self.wetted
        fields, weights = wet.fields, wet.points.weights
        return Flow(self.fields, self.points, weights, wet.opening, fields, self.at_points)

    @cached_property
    def fields(self) -> JointFields:
        """Scalar fields on the joint, and its path coordinate."""
        return JointFields(self.mesh, self.space, self.rule)

    @cached_property
    def xi(self) -> Array:
        """Normalised path coordinate of each location, from heel (0) to toe (1)."""
        return np.asarray(self.fields.at_locations @ self.fields.xi)

    def drains(self, distance: float) -> tuple[IntArray, Array]:
        """Nodes nearest to a line at a distance from the heel along the joint [m], and weights of
        the Gauss points (q,) in the elements beside them: those before the line sum up to one, and
        those behind it.
        """
        xi, tables = self.fields.xi, [table for _, table in self.surface.cells]
        at, near, same = distance / self.length, [], ROUND_OFF
        for table in tables:  # in each element that the line crosses, its nearest nodes
            low, high = xi[table].min(axis=1) - same, xi[table].max(axis=1) + same
            crossed = table[(low <= at) & (at <= high)]
            away = np.abs(xi[crossed] - at)
            near.append(crossed[away <= away.min(axis=1, keepdims=True) + same])
        nearest = np.concatenate(near)
        nodes = distinct(nearest[np.isin(nearest, self.fields.inside)])
        touching = np.concatenate([np.isin(table, nodes).any(axis=1) for table in tables])
        middles = np.concatenate([xi[table].mean(axis=1) for table in tables])
        weights = np.zeros(len(self.points.weights))
        for side in (-1, 1):
            beside = touching & (side * (middles - xi[nodes].mean()) > same)
            of_side = np.where(beside[self.points.elements], self.points.weights, 0)
            weights += of_side / (of_side.sum() or 1)
        return nodes, weights


class Interface:
    """The joints of condensed bodies; unknowns: their free displacement jumps (j,)."""

    def __init__(self, bulk: Condensed, quadrature: str, face_points: float = 0) -> None:
        self.bulk, self.dim = bulk, bulk.dim
        self.joints = [JointInterface(bulk, joint, quadrature) for joint in bulk.joints]
        #: of the Gauss points of all joints, joint by joint: weights; jump from the unknowns
        self.weights = np.concatenate([joint.points.weights for joint in self.joints])
        self.at_points = stacked([joint.at_points for joint in self.joints])
        #: likewise at the nodes, by the rows of each joint
        self.at_nodes = stacked([joint.at_nodes for joint in self.joints])
        self.from_points = self.at_points.T
        self.faces = {
            name: WetFace(face, bulk.order, bulk.dim, int(face_points))
            for name, face in bulk.faces.items()
        }
        upstream = [f.surface.points[:, 1].min() for f in self.faces.values() if f.side == UP]
        #: height of the reservoir floor [m]
        self.floor = min(upstream, default=0.0)
        self.assembly = Assembly(self.at_points, self.weights)
        self._system: WoodburySystem | None = None
        self._flows: dict[tuple[object, ...], Flow] = {}

    def jumps(self, matrix: CsrMatrix, unknowns: Array) -> Array:
        """delta_n, delta_t1, delta_t2 (q, 3) by at_points or at_nodes."""
        return jumps_from(matrix, unknowns, self.dim)

    def forces(self, traction: Array) -> Array:
        """Nodal forces (..., j) of a traction (..., q, 3) at the Gauss points."""
        weighted = self.weights[:, None] * traction[..., : self.dim]
        return self.from_points.on_rows(weighted.reshape(*traction.shape[:-2], -1))

    def network_flow(self, network: Network, waterstops: tuple[float | None, ...]) -> Flow:
        """Operators of water that flows in joints that meet; kept. waterstops: distance from the
        heel of each joint beyond which there is none.
        """
        key = network.numbers, network.branched, waterstops
        if key not in self._flows:
            linear, size = elements.Space(network.mesh.surface, 1), len(network.mesh.surface.points)
            joints = [self.joints[k] for k in network.numbers]
            parts = [
                joint.wetted_within(at) if at else joint.wetted
                for joint, at in zip(joints, waterstops, strict=True)
            ]
            fields = zip(parts, network.nodes, strict=True)
            self._flows[key] = Flow(
                JointFields(network.mesh, linear, joints[0].rule, network.branched),
                elements.points_of(linear, joints[0].rule),
                np.concatenate([part.points.weights for part in parts]),
                stacked([part.opening for part in parts]),
                stacked([part.fields.renumbered(nodes, size) for part, nodes in fields]),
                stacked([joint.at_points for joint in joints]),
            )
        return self._flows[key]

    @property
    def of_joints(self) -> list[OfJoint]:
        """Names, bodies and ends of the joints."""
        return [replace(joint.mesh.of_case, section=joint.section) for joint in self.joints]

    @cached_property
    def iterative_system(self) -> LinearSystem:
        """Linear systems of the joints with uncondensed bodies."""
        from ..fem.uncondensed import Uncondensed
        from .iterative_system import IterativeSystem

        assert isinstance(self.bulk, Uncondensed)
        return IterativeSystem(self.assembly, self.bulk)

    def system(self, undamaged: Array) -> LinearSystem:
        """Linear systems of the joints with the bodies around them; tangent (q, 3, 3) of the
        undamaged joints: of the last one, the system is kept.
        """
        if isinstance(self.bulk.stiffness, CsrMatrix):
            return self.iterative_system
        if self._system is None or not np.array_equal(undamaged, self._system.undamaged):
            self._system = WoodburySystem(self.assembly, self.bulk.stiffness, undamaged)
        return self._system


#: Number of unknowns up to which two interfaces are kept.
SMALL = 2000


class LastInterface:
    """The last interface, and the one before if both are small: a study computes its scenes mesh by
    mesh, and an interface with its dense matrices may take gigabytes. `sweep --critical` alternates
    between two face meshes, as water may stand on the crest in a search: both stay.
    """

    def __init__(self) -> None:
        self.last: dict[tuple[object, ...], Interface] = {}

    def of(self, case: Case) -> Interface:
        """The joints of a case with its condensed bodies."""
        rules = case["quadrature"], case["face_points"]
        key = *bodies_key(case), *rules
        if key not in self.last:
            small = [k for k, i in self.last.items() if i.bulk.size <= SMALL]
            self.last = {k: self.last[k] for k in small[-1:]}  # free the memory of others first
            self.last[key] = Interface(condensed_bodies(case)[0], *rules)
        return self.last[key]


#: The interface of this process: studies and tools share it.
interface_of = LastInterface().of
