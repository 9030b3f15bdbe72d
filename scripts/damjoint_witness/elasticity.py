"""Displacement jumps of the bodies, by scikit-fem, under their loads and the joints' tractions.

Each body of the mesh, from its file in fields/, is loaded by its weight, water and silt on its
faces, forces on lines, temperature, and by the tractions at the integration points in steps.csv
with the water in the joints. The displacements of a body above a joint are known up to a rigid
motion: those that fit the jumps best are added. Then the difference of the displacements on both
sides of a joint is its written jump.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.integrate import quad
from scipy.linalg import qr
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree
from skfem import (
    Basis,
    BilinearForm,
    ElementHex1,
    ElementHex2,
    ElementQuad1,
    ElementQuad2,
    ElementTetP1,
    ElementTetP2,
    ElementTriP1,
    ElementTriP2,
    ElementVector,
    ElementWedge1,
    LinearForm,
    MeshHex,
    MeshQuad,
    MeshTet,
    MeshTri,
    MeshWedge1,
)
from skfem.element.element_h1 import ElementH1
from skfem.helpers import ddot, div, sym_grad, trace
from skfem.refdom import RefHex, RefWedge

from .files import Files, Table, rows_where
from .reader import Point, Request, Values, section_above_base
from .solids import (
    REFERENCE_POINTS,
    ROCK,
    SAME,
    SHAPES,
    Array,
    IntArray,
    Points,
    Sides,
    Solid,
    on_segment,
    read_solids,
)
from .water import Heads, JointState, coordinates, heads_of, pressure
from .water import states as joint_states
from .water_in_time import heads_in_time

#: Rounding of a jump over the largest jump or displacement at the joints. What is more must be the
#: residual of the step: the forces in the joints that move the bodies by the difference, over those
#: that close the joints, are the residual, but that history.csv has it over the loads of the
#: highest level (0.25 to 2.4 of it in 12 steps of random dams 112-20 to 112-30). By the jumps
#: alone there is no bound: where stiff rock holds a joint, its displacements are small beside what
#: a force does to the concrete.
ROUNDING, SAME_RESIDUAL = 1e-10, 10.0
#: Sum of forces and moments on a body: the residual times OF_RESIDUAL, over the sizes of the forces
#: on the body that has the most, as it is one of the whole dam, and ROUNDING, over those on itself.
OF_RESIDUAL = 200.0
#: The waterline is raised, for the shape of the pressure only, by RAISE of a face's height until
#: force and lever can be distinguished: m_0 m_2 - m_1^2 > DISTINCT m_1^2.
DISTINCT, RAISE = 1e-3, 0.01


class ElementWedge2(ElementH1):  # type: ignore[misc]
    """Prism with products of the quadratic functions of its triangle and its axis; all functions
    are interior, as equal points are joined by `Stiffness`.
    """

    interior_dofs = 18
    maxdeg = 4
    dofnames = ("u",) * 18
    refdom = RefWedge
    doflocs = np.array([(*p, z) for z in (0, 1, 0.5) for p in REFERENCE_POINTS["triangle"]], float)

    def lbasis(self, X: Any, i: int) -> tuple[Any, Any]:
        """Value and gradient of function i."""
        x, y, z = X
        k, layer = i % 6, i // 6
        r, zero, one = 1 - x - y, 0 * x, 1 + 0 * x
        f, fx, fy = [
            (r * (2 * r - 1), 1 - 4 * r, 1 - 4 * r),
            (x * (2 * x - 1), 4 * x - 1, zero),
            (y * (2 * y - 1), zero, 4 * y - 1),
            (4 * x * r, 4 * (r - x), -4 * x),
            (4 * x * y, 4 * y, 4 * x),
            (4 * y * r, -4 * y, 4 * (r - y)),
        ][k]
        g, gz = [
            ((1 - z) * (1 - 2 * z), 4 * z - 3 * one),
            (z * (2 * z - 1), 4 * z - 1),
            (4 * z * (1 - z), 4 - 8 * z),
        ][layer]
        return f * g, np.array([fx * g, fy * g, f * gz])


#: Mesh and elements of order 1 and 2 by shape.
KINDS: dict[str, tuple[Any, Any, Any]] = {
    "triangle": (MeshTri, ElementTriP1, ElementTriP2),
    "quad": (MeshQuad, ElementQuad1, ElementQuad2),
    "tetra": (MeshTet, ElementTetP1, ElementTetP2),
    "wedge": (MeshWedge1, ElementWedge1, ElementWedge2),
    "hexahedron": (MeshHex, ElementHex1, ElementHex2),
}
#: Corners of a hexahedron in the order of Gmsh.
GMSH_HEXAHEDRON = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
GMSH_HEXAHEDRON += [(x, y, 1) for x, y, _ in GMSH_HEXAHEDRON]


def quadrature(shape: str, order: int) -> tuple[Array, Array]:
    """Reference points (d, q) and weights (q,) of the bodies: exact for the stiffness of simplices,
    and of quadrangles, prisms and hexahedra with parallel sides.
    """
    x, w = np.polynomial.legendre.leggauss(order + 1)
    line, on_line = (x + 1) / 2, w / 2
    if shape in ("quad", "hexahedron"):
        d = 2 if shape == "quad" else 3
        grid = np.stack(np.meshgrid(*[line] * d, indexing="ij")).reshape(d, -1)
        weights = np.stack(np.meshgrid(*[on_line] * d, indexing="ij")).reshape(d, -1)
        return grid, weights.prod(axis=0)
    if shape == "tetra":
        if order == 1:
            return np.full((3, 1), 0.25), np.array([1 / 6])
        a = (5 - math.sqrt(5)) / 20
        return np.full((3, 4), a) + (1 - 4 * a) * np.eye(3, 4, 1), np.full(4, 1 / 24)
    few = np.full((2, 1), 1 / 3), np.array([0.5])
    three = np.array([[1, 4, 1], [1, 1, 4]]) / 6, np.full(3, 1 / 6)
    if shape == "triangle":
        return few if order == 1 else three
    flat, area = three
    if order == 2:  # degree 5, with 7 points
        s = math.sqrt(15)
        coordinates, areas = [(1 / 3, 1 / 3)], [9 / 80]
        for b, part in (((6 - s) / 21, (155 - s) / 2400), ((6 + s) / 21, (155 + s) / 2400)):
            coordinates += [(b, b), (1 - 2 * b, b), (b, 1 - 2 * b)]
            areas += [part] * 3
        flat, area = np.array(coordinates).T, np.array(areas)
    points = [np.append(flat[:, i], z) for z in line for i in range(len(area))]
    return np.array(points).T, np.outer(on_line, area).ravel()


@BilinearForm  # type: ignore[untyped-decorator]
def elastic_energy(u: Any, v: Any, w: Any) -> Any:
    """Work of the stress of u on the strain of v; plane strain in 2D."""
    e = sym_grad(u)
    return w.lam * trace(e) * div(v) + 2 * w.mu * ddot(e, sym_grad(v))


# -- loads
# --------------------------------------------------------------------------------------------------


def grown(values: Values, name: str, time: float) -> float:
    """Return the factor of a load at a time: linear over the unit of time before its own."""
    since = time - values[f"{name}_t"]
    if name == "temperature" and since > 0 and values["temperature_period"]:
        return math.cos(2 * math.pi * since / values["temperature_period"])
    return float(min(max(since + 1, 0.0), 1.0))


@dataclass(frozen=True)
class Liquid:
    """Pressure of a liquid with its surface at a level, as heights [m]; with the added mass of
    Westergaard (share: 7/8 k_h) or Zangar (C_m k_h / 2), above a floor.
    """

    level: float
    floor: float = 0.0
    westergaard: float = 0.0
    zangar: float = 0.0

    def height(self, level: float, y: Array, tilt: Array | float) -> Array:
        """Heights of pressure for a surface at another level; tilt: |n_x| of the face."""
        depth = max(level - self.floor, 0.0)
        below = np.maximum(level - y, 0)
        added = self.westergaard * tilt * np.sqrt(depth * below)
        if self.zangar and depth:
            u = np.maximum(1 - ((y - self.floor) / depth) ** 2, 0) * (y < level)
            added = added + self.zangar * depth * (u + np.sqrt(u))
        return np.asarray(below + added)

    def resultant(self, low: float, high: float, tilt: float) -> tuple[float, float]:
        """Force and moment about low, per metre of height."""
        top = max(min(high, self.level), low)
        least, most = self.level - top, self.level - low
        # u = level - y: integrals of u and of u (u_most - u), those of sqrt(u) likewise
        force = (most**2 - least**2) / 2
        moment = most * force - (most**3 - least**3) / 3
        if self.westergaard:
            share = self.westergaard * tilt * math.sqrt(max(self.level - self.floor, 0))
            half = 2 / 3 * (most**1.5 - least**1.5)
            force += share * half
            moment += share * (most * half - 2 / 5 * (most**2.5 - least**2.5))
        if self.zangar:

            def added(y: float, power: int) -> float:
                height = float(self.height(self.level, np.array(y), tilt)) - (self.level - y)
                return height * (y - low) ** power

            force += quad(added, low, top, (0,), epsabs=0, epsrel=1e-12)[0]
            moment += quad(added, low, top, (1,), epsabs=0, epsrel=1e-12)[0]
        return force, moment


@dataclass(frozen=True)
class Face:
    """A straight face of the concrete in the plane of x and y, from its foot to its top."""

    foot: Point
    top: Point
    upstream: bool

    @property
    def rise(self) -> float:
        """Height [m]."""
        return self.top[1] - self.foot[1]

    @property
    def length(self) -> float:
        """Length [m]."""
        return math.dist(self.foot, self.top)

    @property
    def normal(self) -> Array:
        """Outward normal."""
        along = (np.array(self.top) - self.foot) / self.length
        return np.array([-along[1], along[0], 0]) * (1 if self.upstream else -1)


def faces_between(corners: Sequence[Point], heights: Sequence[float], upstream: bool) -> list[Face]:
    """Return the straight faces of a polyline, cut at the heights of its joints."""
    coordinates = {y: x for x, y in corners}
    xs, ys = np.array(corners).T
    if (np.diff(ys) <= 0).any():
        return []
    for y in heights:
        if ys[0] < y < ys[-1] and min(abs(ys - y)) > SAME * ys[-1]:
            coordinates[y] = float(np.interp(y, ys, xs))
    ends = [(coordinates[y], y) for y in sorted(coordinates)]
    return [Face(foot, top, upstream) for foot, top in pairwise(ends)]


def x_at(face: Sequence[Point], y: Any) -> Any:
    """Return the position of a face at heights, that of its end beyond its ends [m]."""
    x, heights = np.array(face).T
    return np.interp(y, heights, x)


@dataclass(frozen=True)
class Loads:
    """Loads at a time: levels of reservoir and tailwater [m]."""

    request: Request
    time: float
    level: float
    tail: float

    @property
    def values(self) -> Values:
        """Parameters of the first joint, which are those of bodies and loads."""
        return self.request.joints[0]

    def part(self, name: str) -> float:
        """Return the factor of a load."""
        return grown(self.values, name, self.time)

    @cached_property
    def reservoir(self) -> Liquid:
        """The water on the upstream faces."""
        v = self.values
        size = v["k_h"] * self.part("quake")
        if not size or not v["added_mass"]:
            return Liquid(self.level)
        if v["added_mass"] == 1:
            return Liquid(self.level, westergaard=7 / 8 * size)
        return Liquid(self.level, zangar=zangar_coefficient(v, self.level) / 2 * size)

    def lines(self) -> dict[str, tuple[Point, Array]]:
        """Return points and forces [N/m] of the loads on lines, by name."""
        v, whole = self.values, section_above_base(self.values)
        angle = math.radians(v["anchor_angle"])
        anchor = -v["anchor_force"] * np.array([math.sin(angle), math.cos(angle)])
        forces = np.array([v["force_x"], v["force_y"]])
        sides = {"upstream": whole.upstream, "downstream": whole.downstream}

        def point_at(face: str, at: float) -> Point:
            if face == "crest":
                return v["batter"] + at, v["dam_height"]
            return x_at(sides[face], at), at

        found = {
            "ice": (point_at("upstream", v["ice_level"]), np.array([v["ice_force"], 0.0])),
            "force": (point_at(v["force_face"], v["force_at"]), forces),
            "anchor": (point_at("crest", v["anchor_at"]), anchor),
        }
        return {n: (at, self.part(n) * force) for n, (at, force) in found.items() if force.any()}

    def strain(self, region: int) -> Callable[[Any], Any]:
        """Return the free thermal strain in a region at positions (2 or 3, ...)."""
        v, part = self.values, self.part("temperature")
        if region == ROCK:
            rock = part * v["expansion_found"] * v["temperature_found"]
            return lambda x: rock + 0 * x[0]
        whole = section_above_base(v)

        def of_dam(x: Any) -> Any:
            upstream, downstream = (x_at(s, x[1]) for s in (whole.upstream, whole.downstream))
            share = (x[0] - upstream) / (downstream - upstream) - 0.5
            change = v["temperature_dam"] + v["temperature_linear"] * share
            return part * v["expansion_dam"] * change

        return of_dam


def zangar_coefficient(values: Values, level: float) -> float:
    """Return Zangar's C_m by the angle of the upstream face: one whose vertical part is at least
    half of the dam's height is vertical, any other the line from its foot to the waterline.
    """
    batter, height = values["batter"], values["batter_height"]
    angle = 0.0
    if height > values["dam_height"] / 2 and level > 0:
        angle = math.degrees(math.atan(batter * min(level, height) / height / level))
    coefficients = [0.735, 0.67, 0.62, 0.55, 0.48, 0.40, 0.31, 0.225, 0.125, 0]
    return float(np.interp(angle, range(0, 100, 10), coefficients))


# -- bodies
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Stiffness:
    """Finite elements of a body: points of its functions (n, 3), stiffness and loads; degree of
    freedom dim * function + component.
    """

    solid: Solid
    dim: int
    order: int
    #: Young's modulus [Pa] and Poisson's ratio by region
    material: dict[int, tuple[float, float]]
    #: bases of the parts with one shape and region: basis, region, degrees of freedom
    parts: list[tuple[Any, int, IntArray]] = field(default_factory=list, init=False)

    @cached_property
    def _bases(self) -> list[tuple[Any, int]]:
        bases = []
        for shape, table, region in self.solid.cells:
            mesh_type, *elements = KINDS[shape]
            used, numbers = np.unique(table, return_inverse=True)
            corners = numbers.reshape(table.shape).T
            if shape == "hexahedron":
                order = [GMSH_HEXAHEDRON.index((x, y, z)) for x, y, z in RefHex.p.T.tolist()]
                corners = corners[order]
            points = self.solid.points[used, : self.dim].T
            mesh = mesh_type(np.ascontiguousarray(points), np.ascontiguousarray(corners))
            element = ElementVector(elements[self.order - 1]())
            rule = quadrature(shape, self.order)
            bases.append((Basis(mesh, element, quadrature=rule), region))
        return bases

    @cached_property
    def numbers(self) -> tuple[Array, list[Any]]:
        """Places of the functions (n, 3), and the degree of freedom of each of those of a part."""
        coordinates = np.concatenate([basis.doflocs.T for basis, _ in self._bases])
        pairs = cKDTree(coordinates).query_pairs(SAME * self.solid.size, output_type="ndarray")
        links = sparse.coo_matrix((np.ones(len(pairs)), pairs.T), (len(coordinates),) * 2)
        _, function = connected_components(links, directed=False)
        _, first = np.unique(function, return_index=True)
        at = np.zeros((len(first), 3))
        at[:, : self.dim] = coordinates[first]
        dofs, start = [], 0
        for basis, _ in self._bases:
            component = np.empty(basis.N, int)
            rows = basis.element_dofs
            component[rows] = (np.arange(len(rows)) % self.dim)[:, None]
            dofs.append(self.dim * function[start : start + basis.N] + component)
            start += basis.N
        return at, dofs

    @property
    def coordinates(self) -> Array:
        """Places of the functions (n, 3)."""
        return self.numbers[0]

    @cached_property
    def tree(self) -> Any:
        """Tree of the points."""
        return cKDTree(self.coordinates)

    def find(self, coordinates: Array) -> IntArray:
        """Return the functions at points (..., 3)."""
        distance, found = self.tree.query(coordinates)
        if distance.max(initial=0) > SAME * self.solid.size:
            raise ValueError("the meshes of two bodies differ at their joint")
        return np.asarray(found)

    def lame(self, region: int) -> tuple[float, float]:
        """Return Lame's constants of a region [Pa]."""
        young, poisson = self.material[region]
        shear = young / (2 * (1 + poisson))
        return 2 * shear * poisson / (1 - 2 * poisson), shear

    @cached_property
    def matrix(self) -> Any:
        """Stiffness [N/m]."""
        size = self.dim * len(self.coordinates)
        total = sparse.csr_matrix((size, size))
        for (basis, region), dofs in zip(self._bases, self.numbers[1], strict=True):
            lam, mu = self.lame(region)
            part = elastic_energy.assemble(basis, lam=lam, mu=mu).tocoo()
            entries = part.data, (dofs[part.row], dofs[part.col])
            total = total + sparse.coo_matrix(entries, (size, size)).tocsr()
        return total

    def volume_load(self, load: Callable[[int], tuple[Any, Callable[[Any], Any]]]) -> Array:
        """Return the forces of a density [N/m3] and of a free thermal strain, by region."""
        total = np.zeros(self.dim * len(self.coordinates))
        for (basis, region), dofs in zip(self._bases, self.numbers[1], strict=True):
            density, strain = load(region)
            lam, mu = self.lame(region)

            @LinearForm  # type: ignore[untyped-decorator]
            def form(v: Any, w: Any) -> Any:
                work = sum(float(b) * v[i] for i, b in enumerate(density))  # noqa: B023
                return work + (3 * lam + 2 * mu) * strain(w.x) * div(v)  # noqa: B023

            np.add.at(total, dofs, form.assemble(basis))
        return total

    def side_load(self, sides: Sides, traction: Sequence[float]) -> Array:
        """Return the forces of a uniform traction (3,) on sides."""
        points = sides.points()
        return self.forces(sides, points, np.tile(traction, (len(points.weights), 1)))

    def forces(self, sides: Sides, points: Any, traction: Array) -> Array:
        """Return the forces of tractions (q, 3) at points of sides."""
        total = np.zeros((len(self.coordinates), self.dim))
        at = self.find(sides.coordinates)[points.sides]
        weighted = (points.weights[:, None] * traction)[:, : self.dim]
        for k in range(at.shape[1]):
            np.add.at(total, at[:, k], points.functions[:, k, None] * weighted)
        return total.ravel()

    def rigid_motions(self, held: NDArray[np.bool_]) -> Array:
        """Return the rigid motions (dofs, m) that leave held degrees of freedom at rest; those of
        the body in the plane with one component held everywhere at some points.
        """
        x, y, z = (self.coordinates - self.coordinates.mean(axis=0)).T / self.solid.size
        zero, one = 0 * x, 1 + 0 * x
        in_plane = [(one, zero, zero), (zero, one, zero), (-y, x, zero)]
        others = [(zero, zero, one), (z, zero, -x), (zero, -z, y)]
        motions = in_plane + (others if self.dim == 3 and not held.any() else [])
        return np.stack(
            [np.stack(motion[: self.dim], axis=1).ravel() for motion in motions], axis=1
        )

    def solver(
        self, held: NDArray[np.bool_], floating: bool
    ) -> Callable[[Array], tuple[Array, float]]:
        """Return the solution for forces, with degrees of freedom held; of a floating body for the
        forces less their resultant, at rest in as many degrees of freedom as it has rigid motions;
        and the largest force out of balance [N].
        """
        free = np.flatnonzero(~held)
        motions = self.rigid_motions(held)[free] if floating else np.zeros((len(free), 0))
        at_rest = qr(motions.T, mode="economic", pivoting=True)[2][: motions.shape[1]]
        moving = np.setdiff1d(np.arange(len(free)), at_rest) if floating else np.arange(len(free))
        matrix = self.matrix[free[moving]][:, free[moving]].tocsc()
        factors = splu(matrix, "MMD_AT_PLUS_A", 0.0, options={"SymmetricMode": True})

        def solve(forces: Array) -> tuple[Array, float]:
            resultant = motions.T @ forces[free]
            right = forces[free] - motions @ np.linalg.solve(motions.T @ motions, resultant)
            solution = factors.solve(right[moving])
            solution += factors.solve(right[moving] - matrix @ solution)
            found = np.zeros(len(held))
            found[free[moving]] = solution
            return found, float(np.abs(resultant).max(initial=0))

        return solve


# -- check
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Dam:
    """The bodies of a scene, on one mesh."""

    request: Request
    solids: dict[str, Solid]
    #: bodies above and below each joint, and the positions of its nodes
    joints: tuple[tuple[str, str], ...]
    nodes: tuple[Array, ...]

    @property
    def values(self) -> Values:
        """Parameters of the first joint, which are those of bodies and loads."""
        return self.request.joints[0]

    @property
    def dim(self) -> int:
        """Dimension."""
        return int(self.values["dim"])

    @cached_property
    def bodies(self) -> dict[str, Stiffness]:
        """Finite elements of the bodies, by name."""
        v = self.values
        concrete, rock = (v["E_dam"], v["nu_dam"]), (v["E_found"], v["nu_found"])
        found = {}
        for name, solid in self.solids.items():
            regions = {region for _, _, region in solid.cells}
            material = {region: rock if region == ROCK else concrete for region in regions}
            found[name] = Stiffness(solid, self.dim, int(v["order"]), material)
        return found

    def held(self, name: str) -> NDArray[np.bool_]:
        """Return which degrees of freedom of a body are held: bottom and ends of the rock, with
        hold_z the end faces along z.
        """
        v, body = self.values, self.bodies[name]
        x, y, z = body.coordinates.T
        small = SAME * body.solid.size
        held = np.zeros((len(x), body.dim), bool)
        if name == "foundation":
            held[(x < x.min() + small) | (x > x.max() - small) | (y < y.min() + small)] = True
        if body.dim == 3 and v["hold_z"]:
            held[(z < z.min() + small) | (z > z.max() - small), 2] = True
        return held.ravel()

    @cached_property
    def solvers(self) -> dict[str, Callable[[Array], tuple[Array, float]]]:
        """Solution of each body for its forces."""
        return {
            name: body.solver(self.held(name), name != "foundation")
            for name, body in self.bodies.items()
        }

    @cached_property
    def sides(self) -> list[tuple[str, IntArray]]:
        """The bodies above and below each joint, and their degrees of freedom at its nodes."""
        sides = []
        for nodes, names in zip(self.nodes, self.joints, strict=True):
            for name in names:
                at = self.bodies[name].find(nodes)
                sides.append((name, (self.dim * at[:, None] + np.arange(self.dim)).ravel()))
        return sides

    @cached_property
    def compliance(self) -> Array:
        """The jumps (m, m) of unit forces that part the joints."""
        above, below = self.sides[::2], self.sides[1::2]
        count = sum(len(dofs) for _, dofs in above)
        moved = {name: np.zeros((len(self.held(name)), count)) for name in self.bodies}
        i = 0
        for (upper, upper_dofs), (lower, lower_dofs) in zip(above, below, strict=True):
            for pair in zip(upper_dofs, lower_dofs, strict=True):
                for name, dof, sign in zip((upper, lower), pair, (1, -1), strict=True):
                    force = np.zeros(len(moved[name]))
                    force[dof] = sign
                    moved[name][:, i] += self.solvers[name](force)[0]
                i += 1
        rows = [moved[name][dofs] for name, dofs in self.sides]
        return np.concatenate(rows[::2]) - np.concatenate(rows[1::2])

    # -- loads

    def loads_on(self, name: str, loads: Loads) -> Array:
        """Return the forces of all loads on a body but those in the joints."""
        v, body = self.values, self.bodies[name]
        quake = loads.part("quake")
        concrete = v["rho_dam"] * v["g"] * np.array([v["k_h"] * quake, v["k_v"] * quake - 1, 0])
        rock = np.array([0, 0 if v["in_situ"] else -v["rho_found"] * v["g"], 0])
        heat = any(v[f"temperature_{part}"] for part in ("dam", "linear", "found"))

        def by_region(region: int) -> tuple[Array, Callable[[Any], Any]]:
            weight = rock if region == ROCK else concrete
            strain = loads.strain(region) if heat else lambda x: 0 * x[0]
            return weight[: body.dim], strain

        total = body.volume_load(by_region)
        for face in self.faces:
            for sides in body.solid.sides_where(self.on(face.foot, face.top), body.order):
                total += self.on_face(body, sides, face, loads)
        for sides, level in self.level_faces(body, loads):
            weight = v["rho_water"] * v["g"] * (level - sides.corners[0, 0, 1])
            total += body.side_load(sides, [0.0, -weight, 0.0])
        for point, force in loads.lines().values():
            total += self.on_line(body, point, force)
        return total

    def on(self, start: Point, end: Point) -> Callable[[Array], NDArray[np.bool_]]:
        """Return the condition that a point lies between two of the section."""
        return on_segment(start, end, SAME * self.solids["foundation"].size)

    @cached_property
    def faces(self) -> list[Face]:
        """The straight faces of the concrete that water can load, each of one body."""
        if self.request.geometry:
            return [Face(foot, top, True) for foot, top in UPSTREAM[self.request.case]]
        whole, sections = section_above_base(self.values), self.request.sections
        return [
            *faces_between(whole.upstream, [s.heel[1] for s in sections], True),
            *faces_between(whole.downstream, [s.toe[1] for s in sections], False),
        ]

    def level_faces(self, body: Stiffness, loads: Loads) -> Iterator[tuple[Sides, float]]:
        """Yield level faces of a body under water, and its level: the crest, with floor_water the
        reservoir's floor and the bed of the tailwater.
        """
        v = self.values
        if self.request.geometry:
            return
        whole = section_above_base(v)
        (x1, _), (x0, y) = whole.crest
        on_crest = v["crest_water"] and v["face_load"] == "hydrostatic"
        edges = [((x0, y), (x1, y), loads.level)] if on_crest else []
        if v["floor_water"]:
            (base, toe_y), far = whole.toe, v["found_side"]
            edges += [((-far, 0.0), (0.0, 0.0), loads.level)]
            edges += [((base, toe_y), (base + far, toe_y), loads.tail)]
        for start, end, level in edges:
            if level > start[1]:
                for sides in body.solid.sides_where(self.on(start, end), body.order):
                    yield sides, level

    def on_face(self, body: Stiffness, sides: Sides, face: Face, loads: Loads) -> Array:
        """Return the forces of water, upstream also of silt, on a straight face of a body."""
        v = self.values
        water = loads.reservoir if face.upstream else Liquid(loads.tail)
        weight = v["rho_water"] * v["g"]
        if v["face_load"] == "uniform":
            return body.side_load(sides, -weight * water.level * face.normal)
        total = weight * self.press(body, sides, face, water)
        silt = loads.part("silt") if face.upstream else 0.0
        if silt and v["silt_height"]:
            weight = silt * v["rho_silt"] * v["g"]
            axes = [weight * v["silt_K0"], weight * v["silt_weight"], 0.0][: body.dim]
            pressed = self.press(body, sides, face, Liquid(v["silt_height"]))
            total += (pressed.reshape(-1, body.dim) * axes).ravel()
        return total

    def press(self, body: Stiffness, sides: Sides, face: Face, liquid: Liquid) -> Array:
        """Return the forces of a pressure [m]: its force and moment are exact by a factor that is
        linear in the height; in a geometry by a mesh, by integration of the wet part.
        """
        low, high = face.foot[1], face.top[1]
        if liquid.level <= low:
            return np.zeros(body.dim * len(body.coordinates))
        if self.request.geometry:
            return self.press_wet_part(body, sides, face, liquid)
        points, tilt = sides.points(), abs(face.normal[0])
        y, w = points.positions[:, 1], points.weights
        stretch = w.sum() / face.rise
        force, moment = (stretch * part for part in liquid.resultant(low, high, tilt))
        level = liquid.level
        while True:
            shape = liquid.height(level, y, tilt)
            m0, m1, m2 = (float(w @ (shape * (y - low) ** k)) for k in range(3))
            determinant = m0 * m2 - m1**2
            if determinant > DISTINCT * m1**2 or level > high:
                break
            level = max(level, low) + RAISE * face.rise
        b = (m0 * moment - m1 * force) / determinant
        a = (force - b * m1) / m0
        pressure = shape * (a + b * (y - low))
        return body.forces(sides, points, -pressure[:, None] * face.normal)

    def press_wet_part(self, body: Stiffness, sides: Sides, face: Face, liquid: Liquid) -> Array:
        """Return the forces of a pressure [m] below its surface, in 2D."""
        total = np.zeros(body.dim * len(body.coordinates))
        for corners in sides.corners:
            one = Sides(sides.shape, corners[None], sides.order)
            y0, y1 = corners[:, 1]
            if min(y0, y1) >= liquid.level:
                continue
            points = one.points()
            if max(y0, y1) > liquid.level:
                share = (liquid.level - min(y0, y1)) / abs(y1 - y0)
                low = corners[np.argmin(corners[:, 1])]
                wet = low + share * (corners - low)
                inner = Sides(sides.shape, wet[None], sides.order).points()
                points = one.at(inner.positions, inner.weights)
            pressure = liquid.height(liquid.level, points.positions[:, 1], abs(face.normal[0]))
            total += body.forces(one, points, -pressure[:, None] * face.normal)
        return total

    def on_line(self, body: Stiffness, point: Point, force: Array) -> Array:
        """Return the forces of a force per metre on a line along z at a point of a body's surface,
        where the mesh has nodes.
        """
        total = np.zeros((len(body.coordinates), body.dim))
        away = np.linalg.norm(body.coordinates[:, :2] - point, axis=1)
        nodes = np.flatnonzero(away < SAME * self.solids["foundation"].size)
        if body.dim == 2:
            total[nodes, :2] = force
        elif len(nodes):
            nodes = nodes[np.argsort(body.coordinates[nodes, 2])]
            ends = body.coordinates[nodes[:: body.order]]
            sides = Sides("line", np.stack([ends[:-1], ends[1:]], axis=1), body.order)
            return body.side_load(sides, [*force, 0.0])
        return np.asarray(total.ravel(), float)


#: Upstream faces of the geometries by a mesh: monoliths.geo.
UPSTREAM: dict[str, list[tuple[Point, Point]]] = {"monoliths": [((0.0, 0.0), (0.0, 45.0))]}


@dataclass(frozen=True)
class JointForces:
    """A joint at a time: its elements, rows of its nodes and integration points."""

    state: JointState
    heads: Heads
    nodes: Table
    points: Table
    #: pressure [Pa] at which voids form in the water
    least: float = 0.0

    @cached_property
    def frame(self) -> Array:
        """Normal and tangents (3, 3) in rows: from the body below to that above, downstream,
        their product.
        """
        x, y = self.state.along
        normal, tangent = np.array([-y, x, 0.0]), np.array([x, y, 0.0])
        return np.array([normal, tangent, np.cross(tangent, normal)])

    def jumps(self, table: Table) -> Array:
        """Return the jumps (n, 3) along x, y, z of rows."""
        return np.column_stack([table[f"delta_{k}"] for k in ("n", "t1", "t2")]) @ self.frame

    def forces(self, body: Stiffness) -> Array:
        """Return the forces of tractions and water on a body above the joint."""
        (sides,) = self.state.sides
        wet = wet_points(self.state, sides)
        p = pressure(self.state, self.heads, self.least)(wet.positions)
        return self.tractions(body) + body.forces(sides, wet, p[:, None] * self.frame[0])

    def tractions(self, body: Stiffness) -> Array:
        """Return the forces of the tractions on a body above the joint."""
        table = self.points
        traction = np.column_stack([table[k] for k in ("sigma_n_eff", "tau_1", "tau_2")])
        positions = coordinates(table)
        width = float(np.ptp(coordinates(self.nodes)[:, 2])) if body.dim == 3 else 1.0
        (sides,) = self.state.sides
        at = sides.at(positions, width * table["weight"])
        return -body.forces(sides, at, traction @ self.frame)


def wet_points(state: JointState, sides: Sides) -> Points:
    """Return the quadrature of the water in a joint: of elements that a waterstop cuts, over their
    wet part.
    """
    points, stop = sides.points(), state.values["waterstop"]
    if state.values["uplift"] != "waterstop":
        return points
    positions, weights = [np.zeros((0, 3))], [np.zeros(0)]
    for corners in sides.corners:
        for part in wet_parts(corners, state.distance(corners) - stop):
            inner = Sides(SHAPES[len(part)], part[None], 1).points()
            positions.append(inner.positions)
            weights.append(inner.weights)
    return sides.at(np.concatenate(positions), np.concatenate(weights))


def wet_parts(corners: Array, beyond: Array) -> list[Array]:
    """Return the part of an element where a linear function of its corners (n,) is negative: the
    element itself, a part of a line, a rectangle, or triangles.
    """
    if beyond.min() >= 0:
        return []
    if beyond.max() <= 0:
        return [corners]
    if len(corners) != 3:  # shortened along the joint
        share = beyond.min() / np.ptp(beyond)
        ends = corners[beyond <= beyond.min() + SAME], corners[beyond >= beyond.max() - SAME]
        along = ends[1].mean(axis=0) - ends[0].mean(axis=0)
        far = (beyond > (beyond.min() + beyond.max()) / 2)[:, None]
        return [corners - far * (1 + share) * along]
    polygon = []
    for i, k in ((0, 1), (1, 2), (2, 0)):
        if beyond[i] <= 0:
            polygon.append(corners[i])
        if beyond[i] * beyond[k] < 0:
            share = beyond[i] / (beyond[i] - beyond[k])
            polygon.append(corners[i] + share * (corners[k] - corners[i]))
    return [np.array([polygon[0], *polygon[i : i + 2]]) for i in range(1, len(polygon) - 1)]


def violations(files: Files, request: Request, steps: Table) -> Iterator[str]:
    """Yield where the jumps differ from those of the bodies under their loads and the tractions."""
    names = [(j["upper"], j["lower"]) for j in files.record["joints"]] or [("dam", "foundation")]
    written = list(written_states(files, request, steps))
    if written:
        nodes = tuple(coordinates(joint.nodes) for joint in written[0][0])
        dam = Dam(request, read_solids(files.folder / "fields"), tuple(names), nodes)
    for joints, loads, residual in written:
        yield from jumps_at(dam, joints, loads, residual)


def written_states(
    files: Files, request: Request, steps: Table
) -> Iterator[tuple[list[JointForces], Loads, float]]:
    """Yield the joints, the loads and the residual of each state whose tables are written."""
    in_time = heads_in_time(files, request, steps)
    for update, states in joint_states(files, request, steps):
        rows = rows_where(steps, steps["update"] == update)
        joints, stored = [], in_time.get(update, {})
        for joint, steady in zip(states, heads_of(states), strict=True):
            heads = stored.get(joint.number, steady)
            least = joint.values["pressure_min"] if joint.number in stored else 0.0
            table = rows_where(rows, rows["joint"] == joint.number + 1)
            nodes, points = (rows_where(table, (table["weight"] > 0) == w) for w in (False, True))
            joints.append(JointForces(joint, heads, nodes, points, least))
        time, level, tail = (float(rows[name][0]) for name in ("time", "level", "tail_level"))
        residual = residual_at(files, float(states[0].rows["time"][0]))
        yield joints, Loads(request, time, level, tail), residual


def residual_at(files: Files, time: float) -> float:
    """Return the residual of the step at a time."""
    history = files.history
    return float(history["residual"][np.argmin(np.abs(history["time"] - time))])


def jumps_at(
    dam: Dam, joints: Sequence[JointForces], loads: Loads, residual: float
) -> Iterator[str]:
    """Yield where the jumps at a time differ."""
    forces = {name: dam.loads_on(name, loads) for name in dam.bodies}
    for joint, (upper, lower) in zip(joints, dam.joints, strict=True):
        forces[upper] += joint.forces(dam.bodies[upper])
        forces[lower] -= joint.forces(dam.bodies[lower])
    found = {name: dam.solvers[name](force) for name, force in forces.items()}
    sizes = {name: float(np.abs(force).sum()) for name, force in forces.items()}
    for name, (_, imbalance) in found.items():
        most = OF_RESIDUAL * residual * max(sizes.values()) + ROUNDING * sizes[name]
        if name != "foundation" and imbalance > most:
            part = imbalance / sizes[name]
            yield f"{name} out of balance by {part:.3g} of its forces at t = {loads.time:g}"
    fit = Fit.of(dam, joints, {name: u for name, (u, _) in found.items()})
    if fit.error > ROUNDING * fit.scale:
        part = out_of_balance(dam, joints, fit)
        if part > SAME_RESIDUAL * residual:
            off = f"{fit.error:.3g} m, {fit.error / fit.scale:.3g} of the largest, by {part:.3g}"
            yield f"jumps off by {off} of the forces from the bodies' at t = {loads.time:g}"


@dataclass(frozen=True)
class Fit:
    """What displacements of the bodies, with the rigid motions that fit best, leave of the written
    jumps.
    """

    #: the written jumps, and what is left of them (m,), the jumps of the rigid motions (m, c)
    written: Array
    left: Array
    motions: Array
    #: largest jump or displacement at a joint [m]
    scale: float

    @property
    def error(self) -> float:
        """Largest difference [m]."""
        return float(np.abs(self.left).max())

    @staticmethod
    def of(dam: Dam, joints: Sequence[JointForces], displacements: dict[str, Array]) -> Fit:
        """Fit displacements by name of the body."""
        motions = {
            name: body.rigid_motions(dam.held(name))
            for name, body in dam.bodies.items()
            if name != "foundation"
        }
        ends = dict(zip(motions, np.cumsum([m.shape[1] for m in motions.values()]), strict=True))
        columns = sum(m.shape[1] for m in motions.values())
        sides = []
        for name, dofs in dam.sides:
            moved = np.zeros((len(dofs), columns))
            if name in motions:
                first = ends[name] - motions[name].shape[1]
                moved[:, first : ends[name]] = motions[name][dofs]
            sides.append((displacements[name][dofs], moved))
        above, below = sides[::2], sides[1::2]
        matrix = np.concatenate([a[1] - b[1] for a, b in zip(above, below, strict=True)])
        elastic = np.concatenate([a[0] - b[0] for a, b in zip(above, below, strict=True)])
        written = [joint.jumps(joint.nodes)[:, : dam.dim].ravel() for joint in joints]
        right = np.concatenate(written) - elastic
        fit = np.linalg.lstsq(matrix, right, rcond=None)[0]
        largest = max(float(np.abs(elastic + moved @ fit).max()) for elastic, moved in sides)
        largest = max(largest, *(float(np.abs(jumps).max()) for jumps in written))
        return Fit(np.concatenate(written), right - matrix @ fit, matrix, largest)


def out_of_balance(dam: Dam, joints: Sequence[JointForces], fit: Fit) -> float:
    """Return the norm of the nodal forces in the joints that move the bodies by what is left of the
    jumps, over the norm of those that close the joints, as the residual is defined.
    """
    compliance, count = dam.compliance, len(fit.left)
    size, rigid = np.abs(compliance).max(), fit.motions
    system = np.block([[compliance / size, rigid], [rigid.T, np.zeros((rigid.shape[1],) * 2)]])
    right = np.zeros((len(system), 2))
    right[:count] = np.column_stack([fit.left, fit.written]) / size
    forces = np.linalg.lstsq(system, right, rcond=None)[0][:count]
    tractions = [
        joint.tractions(dam.bodies[name])[dofs]
        for joint, (name, dofs) in zip(joints, dam.sides[::2], strict=True)
    ]
    closing = forces[:, 1] - np.concatenate(tractions)
    return float(np.linalg.norm(forces[:, 0]) / np.linalg.norm(closing))
