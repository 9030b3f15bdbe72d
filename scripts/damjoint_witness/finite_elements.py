"""Finite elements of the bodies, by scikit-fem: stiffness, loads, rigid motions, solution."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
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

from .solids import (
    REFERENCE_POINTS,
    SAME,
    Array,
    IntArray,
    Sides,
    Solid,
)


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
