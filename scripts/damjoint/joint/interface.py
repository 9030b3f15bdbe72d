"""The joint of condensed bodies, whatever its law, its water and its levels: interpolations, flow
operators, and the linear systems of Newton's method.

The tangent is that of the virgin joint, A_0 = S + K_0, plus what has changed where the joint has
opened, broken or slid: A = A_0 + L - B P (L: the law's change, on few rows; P: the derivative of
flowing water's pressures; B: how they lift). With C = A_0^-1, made once, A x = r reads

    x = C (r - f + B p),    f = L x,    p = P x,

a system of the forces f on the rows of L and the pressures p only (Woodbury). Bordered by one more
equation it stays regular where the load has its peak and A is singular.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg, sparse

from ..fem import elements
from ..fem.condensation import Condensed
from ..model.mesh import ends_of, heel_normal
from .flow import Along, Flow
from .wet_faces import WetFace


@dataclass
class Change:
    """L and P, without their zero rows and columns."""

    #: L (rows, j): the law's
    law: sparse.csr_matrix
    rows: np.ndarray
    #: P (p, columns), if water flows
    pressure: np.ndarray | None = None
    columns: np.ndarray | None = None


def frames(normals: np.ndarray) -> np.ndarray:
    """Normal, tangent 1 (downstream, along x as far as the joint lets it) and tangent 2 (tangent 1
    x normal; z on a level joint) of elements with these normals: (elements, 3, 3), in rows.
    """
    along = np.array([1.0, 0, 0]) - normals[:, :1] * normals
    # a riser, which x meets at right angles: the normal turned by as much as elsewhere
    risers = np.linalg.norm(along, axis=1) < 1e-9
    along[risers] = np.column_stack(
        [np.zeros(risers.sum()), -normals[risers, 0], np.zeros(risers.sum())]
    )
    along /= np.linalg.norm(along, axis=1)[:, None]
    return np.stack([normals, along, np.cross(along, normals)], axis=1)


@dataclass(frozen=True)
class Chord:
    """From heel to toe: what resultants refer to. In 3D the means of both lines."""

    toe: np.ndarray
    #: unit vectors towards the toe and upwards from it, in the x-y plane
    along: np.ndarray
    normal: np.ndarray
    length: float

    @staticmethod
    def of(bulk: Condensed) -> Chord:
        """The chord of a joint."""
        heel, toe = (
            bulk.joint.points[nodes][:, :2].mean(axis=0) for nodes in (bulk.heel, bulk.toe)
        )
        length = float(np.linalg.norm(toe - heel))
        along = (toe - heel) / length
        return Chord(toe, along, np.array([-along[1], along[0]]), length)

    def resultants(
        self, weights: np.ndarray, places: np.ndarray, traction: np.ndarray
    ) -> tuple[float, float, float]:
        """N (compression > 0), T (downstream > 0) and M (about the toe, holding down > 0) of a
        traction (q, 3) along x, y, z at places (q, 3).
        """
        force = weights[:, None] * traction[:, :2]
        total, arm = force.sum(axis=0), places[:, :2] - self.toe
        moment = np.sum(arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0])
        return -total @ self.normal, total @ self.along, float(moment)


class Interface:
    """Interpolation matrices of the joint from the unknowns, the jumps of `bulk.free`."""

    def __init__(self, bulk: Condensed, quadrature: str) -> None:
        self.bulk, self.dim = bulk, bulk.dim
        space = self.space = elements.Space(bulk.joint, bulk.order)
        #: how many points of the law each shape has
        self.rule = elements.JOINT[quadrature][bulk.order]
        self.points = elements.points_of(space, self.rule)
        self.frames = frames(bulk.joint.normals)
        #: whether it is a plane, but for the rounding of its nodes
        self.flat = np.allclose(self.frames, self.frames[0], rtol=0, atol=1e-9)
        #: jump at the law's points (dim rows each: normal, tangent 1, tangent 2)
        self.at_points = self._components(self.points.values, self.frames[self.points.elements])
        self.from_points = self.at_points.T.tocsr()
        self.touched = self.from_points != 0
        #: jump at the nodes, in the same way: `at_nodes` has a row for each of `rows`, an index of
        #: a place and its frame; where the joint bends a node is seen from each of its elements
        self.rows, seen = self._seen()
        self.at_nodes = self._components(space.at_places(bulk.order)[self.rows], seen)
        self.water_points = elements.points_of(space, elements.WATER)
        across = self.frames[self.water_points.elements]
        #: opening at the water's points
        self.water = self._components(self.water_points.values, across, 1)
        self.faces = {
            name: WetFace(surface, bulk.kinds[name], bulk.order, bulk.dim)
            for name, surface in bulk.faces.items()
        }
        self.heel = self._heel_row()
        upstream = [f.surface.points[:, 1].min() for f in self.faces.values() if f.side == "up"]
        #: height of the reservoir's floor [m]
        self.floor = min(upstream, default=0.0)
        self.chord = Chord.of(bulk)
        #: from heel to toe along the joint [m], a mean in 3D
        self.length = self.points.weights.sum() / bulk.width
        self._made_for, self._compliance = None, None

    def _seen(self) -> tuple[np.ndarray, np.ndarray]:
        """Places and the frames in which their jumps are seen: one each on a plane joint."""
        if self.flat:
            number = len(self.space.place)
            return np.arange(number), np.broadcast_to(self.frames[0], (number, 3, 3))
        tables = [table for _, table in self.space.connectivity]
        sizes = np.concatenate([np.full(len(t), t.shape[1]) for t in tables])
        rows = np.concatenate([t.ravel() for t in tables])
        return rows, np.repeat(self.frames, sizes, axis=0)

    def at_places(self, values: np.ndarray) -> np.ndarray:
        """The mean at each place of values by `rows`."""
        if len(self.rows) == len(self.space.place):
            return values
        count = np.bincount(self.rows)
        mean = lambda column: np.bincount(self.rows, column) / count
        return np.column_stack([mean(v) for v in values.T]) if values.ndim > 1 else mean(values)

    def _select(self, component: int) -> sparse.csr_matrix:
        """A displacement component of the space's functions, from the unknowns."""
        functions, parts = np.divmod(self.bulk.free, self.dim)
        here = np.flatnonzero(parts == component)
        return sparse.csr_matrix(
            (np.ones(len(here)), (functions[here], here)),
            (len(self.space.place), len(self.bulk.free)),
        )

    def _components(
        self, values: sparse.csr_matrix, frames: np.ndarray, most: int = 3
    ) -> sparse.csr_matrix:
        """Interpolation (q, functions) of the jump's components in frames (q, 3, 3), the first
        `most` of them: point by point, from the unknowns.
        """
        parts = [values @ self._select(c) for c in range(self.dim)]
        number = min(self.dim, most)
        stacked = sparse.vstack(
            [
                sum(
                    parts[c].multiply(frames[:, k, c, None])
                    for c in range(self.dim)
                    if frames[:, k, c].any()
                )
                for k in range(number)
            ],
            format="csr",
        )
        return stacked[np.arange(stacked.shape[0]).reshape(number, -1).T.ravel()]

    def jumps(self, matrix: sparse.csr_matrix, unknowns: np.ndarray) -> np.ndarray:
        """delta_n, delta_t1, delta_t2 (q, 3) by at_points or at_nodes."""
        return np.pad((matrix @ unknowns).reshape(-1, self.dim), ((0, 0), (0, 3 - self.dim)))

    def forces(self, traction: np.ndarray) -> np.ndarray:
        """Nodal forces of a traction (q, 3) at the law's points."""
        return self.from_points @ (self.points.weights[:, None] * traction[:, : self.dim]).ravel()

    def _heel_row(self) -> np.ndarray:
        """The heel's opening, mean along it, from the unknowns."""
        heel = elements.Space(self.bulk.heel_line, self.bulk.order)
        points = elements.points_of(heel, elements.WATER)
        functions = self.space.find(heel)
        normal = heel_normal(self.bulk.joint, heel.body)
        weights = np.zeros(len(self.space.place))
        weights[functions] = points.values.T @ points.weights / points.weights.sum()
        functions, parts = np.divmod(self.bulk.free, self.dim)
        return weights[functions] * normal[parts]

    @property
    def section(self) -> dict[str, list[float]]:
        """The joint's ends and length, by the names of pro/section.pro."""
        heel = self.chord.toe - self.chord.length * self.chord.along
        return ends_of(heel, self.chord.toe, self.length)

    # -- flow
    # ----------------------------------------------------------------------------------------------

    @cached_property
    def flow(self) -> Flow:
        """The operators of water that flows in the joint."""
        return Flow(self.along, self.points, self.water_points, self.water, self.at_points)

    @cached_property
    def along(self) -> Along:
        """Scalar fields along the joint, and how far each place is on the way to the toe."""
        return Along(self.bulk, self.space, self.rule)

    @cached_property
    def way(self) -> np.ndarray:
        """How far each place is on the way from heel (0) to toe (1)."""
        return self.along.at_places @ self.along.way

    def drains(self, distance: float) -> tuple[np.ndarray, np.ndarray]:
        """The nodes nearest to a line at a distance from the heel along the joint [m], and the
        law's points beside them.
        """
        way, tables = self.along.way, [table for _, table in self.bulk.joint.cells]
        at, near, same = distance / self.length, [], 1e-9
        for table in tables:  # in each element that the line crosses, its nearest nodes
            low, high = way[table].min(axis=1) - same, way[table].max(axis=1) + same
            crossed = table[(low <= at) & (at <= high)]
            away = np.abs(way[crossed] - at)
            near.append(crossed[away <= away.min(axis=1, keepdims=True) + same])
        nodes = np.intersect1d(np.concatenate(near), self.along.inside)
        beside = np.concatenate([np.isin(table, nodes).any(axis=1) for table in tables])
        return nodes, np.flatnonzero(beside[self.points.elements])

    # -- linear systems
    # ------------------------------------------------------------------------------------

    def stiffness(self, tangent: np.ndarray, points: np.ndarray) -> sparse.csr_matrix:
        """Stiffness (j, j) of the joint that some of the law's points add with a tangent (points,
        3, 3).
        """
        number, d = len(points), self.dim
        if not number:
            return sparse.csr_matrix((len(self.bulk.free),) * 2)
        here = self.at_points[(d * points[:, None] + np.arange(d)).ravel()]
        blocks = self.points.weights[points, None, None] * tangent[:, :d, :d]
        return (
            here.T
            @ (
                sparse.bsr_matrix(
                    (blocks, np.arange(number), np.arange(number + 1)), (d * number,) * 2
                )
                @ here
            )
        ).tocsr()

    def compliance(self, virgin: np.ndarray) -> np.ndarray:
        """C = (S + K_0)^-1 (j, j) for a tangent (3, 3) that all points have; the last one is
        kept.
        """
        if self._made_for is None or not np.array_equal(virgin, self._made_for):
            number = len(self.points.weights)
            matrix = (
                self.bulk.stiffness
                + self.stiffness(
                    np.broadcast_to(virgin, (number, 3, 3)), np.arange(number)
                ).toarray()
            )
            factor, info = linalg.lapack.dpotrf(matrix.T, lower=True, overwrite_a=True, clean=False)
            if info:
                raise linalg.LinAlgError("the joint does not hold the dam")
            inverse, _ = linalg.lapack.dpotri(factor, lower=True, overwrite_c=True)
            self._compliance, self._made_for = np.tril(inverse) + np.tril(inverse, -1).T, virgin
            self.__dict__.pop("lifted", None)
        return self._compliance

    @cached_property
    def lifted(self) -> np.ndarray:
        """C B (j, p), of the compliance last asked for."""
        return np.ascontiguousarray((self.flow.lift.T @ self._compliance).T)

    def change(self, tangent: np.ndarray, virgin: np.ndarray) -> Change:
        """The law's change for a tangent (q, 3, 3)."""
        differs = (tangent != virgin).any(axis=2)[:, : self.dim]  # rows: components of the traction
        points, rows = (
            np.flatnonzero(differs.any(axis=1)),
            np.flatnonzero(self.touched @ differs.ravel()),
        )
        return Change(self.stiffness(tangent[points] - virgin, points)[rows], rows)

    def solve(
        self, virgin: np.ndarray, change: Change, right: np.ndarray, border: tuple | None
    ) -> tuple[np.ndarray, float]:
        """x (j,) and s of A x + slope s = right and, with a border (slope, row, rate, gap), row x +
        rate s = gap.

        Raises LinAlgError if the system is singular.
        """
        compliance, law, rows, columns = (
            self.compliance(virgin),
            change.law,
            change.rows,
            change.columns,
        )
        m, start = len(rows), compliance @ right
        size = m + (0 if columns is None else len(change.pressure))
        small = np.zeros((size + (border is not None),) * 2)
        wanted = np.zeros(len(small))
        touched = np.unique(law.indices)
        small[:m, :m] = law[:, touched] @ compliance[np.ix_(touched, rows)]
        wanted[:m] = law @ start
        if columns is not None:
            small[:m, m:size] = -(law @ self.lifted)
            small[m:size, :m] = change.pressure @ compliance[np.ix_(columns, rows)]
            small[m:size, m:size] = -(change.pressure @ self.lifted[columns])
            wanted[m:size] = change.pressure @ start[columns]
        small[np.arange(size), np.arange(size)] += 1
        if border is not None:
            slope, row, rate, gap = border
            along, across = compliance @ slope, compliance @ row
            small[:m, size], small[size, :m] = law @ along, -across[rows]
            if columns is not None:
                small[m:size, size], small[size, m:size] = (
                    change.pressure @ along[columns],
                    row @ self.lifted,
                )
            small[size, size], wanted[size] = rate - row @ along, gap - row @ start
        found = lu_solve(small, wanted)
        force = np.zeros(len(right))
        force[rows] = found[:m]
        x, s = start - compliance @ force, found[size] if border is not None else 0.0
        if columns is not None:
            x += self.lifted @ found[m:size]
        if border is not None:
            x -= s * along
        return x, s


def lu_solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solution by LU, the matrix overwritten or not.

    Raises LinAlgError if it is singular.     A large matrix is factorised in single precision,
    twice as fast, and the solution refined; in double precision     where that does not converge.
    """
    if not right.any():
        return np.zeros_like(right)
    if len(right) > 300:
        factors, pivots, info = linalg.lapack.sgetrf(matrix.T.astype(np.float32), overwrite_a=True)
        found, left, size = np.zeros_like(right), right, np.linalg.norm(right)
        for _ in range(0 if info else 8):
            correction = linalg.lapack.sgetrs(factors, pivots, left / size, trans=1)[0]
            found = found + size * correction
            left, before = right - matrix @ found, size
            size = np.linalg.norm(left)
            if size <= 1e-12 * np.linalg.norm(right):
                return found
            if not size < 0.1 * before:
                break
    factors, pivots, info = linalg.lapack.dgetrf(matrix.T, overwrite_a=True)
    if info:
        raise linalg.LinAlgError("singular matrix")
    return linalg.lapack.dgetrs(factors, pivots, right, trans=1)[0]
