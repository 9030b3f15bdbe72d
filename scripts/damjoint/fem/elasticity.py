"""Linear elasticity of a body: stiffness, weight, thermal load, stress.

Plane strain in 2D.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..arrays import Array, BoolArray, IntArray, Sparse
from ..csr import CsrMatrix
from .elements import BULK, MASS, Space, basis, corners_of, geometry, nodal, points_of, tabulated

#: Young's modulus [Pa] and Poisson's ratio [-] by region.
Material = dict[str, tuple[float, float]]
#: Values (n,) at positions (n, 3).
Distribution = Callable[[Array], Array]


def lame(young: float, poisson: float) -> tuple[float, float]:
    """Lame's lambda and mu [Pa]."""
    return young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))


#: Number of elements computed at a time: limits memory, not the result.
MOST_ELEMENTS = 50_000
#: Number of entries assembled at a time, for the same reason.
MOST_ENTRIES = 5_000_000


def elasticity(space: Space, dim: int, material: Material) -> CsrMatrix:
    """Assemble the stiffness matrix [N/m] of an isotropic body, plane strain in 2D; degree of
    freedom dim * function + component.
    """
    size, parts = dim * len(space.locations), list[tuple[Array, IntArray, IntArray]]()

    def number() -> int:
        return sum(len(values) for values, _, _ in parts)

    def assembled() -> Sparse:
        from scipy import sparse

        values, rows, columns = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
        parts.clear()
        return sparse.coo_matrix((values, (rows, columns)), (size, size)).tocsr()

    whole: Sparse = None
    for (shape, table), region in zip(space.connectivity, space.body.regions, strict=True):
        for first in range(0, len(table), MOST_ELEMENTS):
            elements = table[first : first + MOST_ELEMENTS]
            block = element_stiffness(space, dim, shape, elements, *lame(*material[region]))
            dofs = (dim * elements[:, :, None] + np.arange(dim)).astype(np.int32)
            dofs, n = dofs.reshape(len(elements), -1), block.shape[1]
            rows, columns = np.repeat(dofs, n, axis=1), np.tile(dofs, n)
            parts.append((block.ravel(), rows.ravel(), columns.ravel()))
            if number() > MOST_ENTRIES:
                whole = assembled() if whole is None else whole + assembled()
    if whole is None and dim == 2:
        values, rows, columns = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
        return CsrMatrix.of_entries(values, rows, columns, (size, size))
    if parts:
        whole = assembled() if whole is None else whole + assembled()
    return CsrMatrix.of_scipy(whole)


def element_stiffness(
    space: Space, dim: int, shape: str, table: IntArray, lam: float, mu: float
) -> Array:
    """Stiffness (elements, n, n) of elements with these functions (elements, n / dim)."""
    points = space.body.points[:, :dim]
    rule = BULK[space.order][shape]
    _, gradients, nodal_gradients, weights = tabulated(shape, space.order, rule)
    cells = table[:, : nodal_gradients.shape[1]]
    n = table.shape[1]
    products = np.einsum("q,qak,qbl->qabkl", weights, gradients, gradients).reshape(
        len(weights), n * n, dim * dim
    )
    if affine(points, cells, nodal_gradients):  # one Jacobian serves all points
        products, nodal_gradients = products.sum(axis=0, keepdims=True), nodal_gradients[:1]
    block = np.zeros((n * n, len(table) * dim * dim))
    for product, dn in zip(products, nodal_gradients, strict=True):
        measure, inverse = geometry(points, cells, dn)
        inverse = np.moveaxis(inverse, 1, 0)
        # lambda div div + mu (grad : grad + grad : grad^T), from reference gradients (k, l) to
        # real ones (i, j); axes k, l, e, i, j
        outer = (measure[:, None] * inverse)[:, None, :, :, None] * inverse[None, :, :, None, :]
        laplace = np.einsum("kleii->kle", outer)
        hooke = (
            lam * outer + mu * outer.swapaxes(3, 4) + mu * laplace[..., None, None] * np.eye(dim)
        )
        block += product @ hooke.reshape(dim * dim, -1)
    block = block.reshape(n, n, len(table), dim, dim).transpose(2, 0, 3, 1, 4)
    return block.reshape(len(table), n * dim, n * dim)


#: Distortion over the size up to which an element counts as affine: rounding of Gmsh's nodes.
DISTORTION = 1e-9


def affine(points: Array, cells: IntArray, nodal_gradients: Array) -> bool:
    """Whether all elements are affine: simplices, parallelograms, straight prisms.

    nodal_gradients: (q, m, d) at several points.
    """
    change = nodal_gradients[1:] - nodal_gradients[:1]
    if not change.any():
        return True
    edges = points[cells] - points[cells[:, :1]]
    distortion = np.abs(np.einsum("qmd,eml->eqdl", change, edges)).max(axis=(1, 2, 3))
    return bool((distortion < DISTORTION * np.abs(edges).max(axis=(1, 2))).all())


def body_force(space: Space, dim: int, component: int, region: str | None = None) -> Array:
    """Load vector of a unit force density along a component [m3 per function]; region: or all."""
    points = points_of(space, BULK[space.order])
    load = np.zeros((len(space.locations), dim))
    load[:, component] = points.values.T @ (points.weights * inside(space, region)[points.elements])
    return load.ravel()


def mass(space: Space, dim: int, densities: dict[str, float]) -> Sparse:
    """Assemble the consistent mass matrix [kg] of a body with a density [kg/m3] in some of its
    regions; degree of freedom dim * function + component.
    """
    from scipy import sparse

    points, rows, columns, values = space.body.points[:, :dim], [], [], []
    for (shape, table), region in zip(space.connectivity, space.body.regions, strict=True):
        if not densities.get(region):
            continue
        functions, _, dn, weights = tabulated(shape, space.order, MASS[space.order][shape])
        cells = table[:, : dn.shape[1]]
        measures = np.array([geometry(points, cells, d)[0] for d in dn])
        density = densities[region] * weights[:, None] * measures
        blocks = np.einsum("qe,qa,qb->eab", density, functions, functions, optimize=True)
        rows.append(np.repeat(table, table.shape[1], axis=1).ravel())
        columns.append(np.tile(table, (1, table.shape[1])).ravel())
        values.append(blocks.ravel())
    size = len(space.locations)
    scalar = sparse.csr_matrix((size, size))
    if values:
        indices = np.concatenate(rows), np.concatenate(columns)
        scalar = sparse.coo_matrix((np.concatenate(values), indices), (size, size)).tocsr()
    return sparse.kron(scalar, sparse.eye(dim), format="csr")


def thermal_modulus(young: float, poisson: float) -> float:
    """Stress over prevented thermal strain [Pa], of any direction: 3 lambda + 2 mu."""
    return young / (1 - 2 * poisson)


def thermal_load(
    space: Space, dim: int, material: Material, region: str, strain: Distribution
) -> Array:
    """Load vector [N] of a free thermal strain, equal in all directions, in a region of the body:
    the integral of the prevented stress times the divergence of each function.
    """
    points = points_of(space, BULK[space.order], gradients=True)
    size = points.weights * inside(space, region)[points.elements] * strain(points.positions)
    size = thermal_modulus(*material[region]) * size
    return np.column_stack([points.gradients[i].T @ size for i in range(dim)]).ravel()


def inside(space: Space, region: str | None) -> BoolArray:
    """Whether each element of a body is in a region, or in any."""
    return by_element(space, [region in (None, of_element) for of_element in space.body.regions])


def by_element(space: Space, values: list[Any]) -> Any:
    """Values of the regions of a body, in the order of its elements (elements,)."""
    return np.repeat(values, [len(table) for _, table in space.connectivity])


def at_middles(space: Space, region: str, strain: Distribution) -> Array:
    """A strain in a region of the body at the middle of each element (elements,)."""
    values: Array = inside(space, region) * strain(space.body.middles())
    return values


def stress(
    space: Space, displacements: Array, material: Material, thermal: Array | None = None
) -> Array:
    """Stress xx, yy, zz, xy, yz, xz (states, elements, 6) at the middle of each element.

    displacements: (states, functions, 2 or 3); thermal: free thermal strain at the middle of each
    element (states, elements)
    """
    number, _, dim = displacements.shape
    blocks = []
    for (shape, table), region in zip(space.connectivity, space.body.regions, strict=True):
        lam, mu = lame(*material[region])
        middle = corners_of(shape).mean(axis=0)
        _, gradients = basis(shape, space.order, middle)
        dn = nodal(shape, middle)[1]
        _, inverse = geometry(space.body.points[:, :dim], table[:, : len(dn)], dn)
        slopes = gradients @ inverse
        gradient = np.zeros((number, len(table), 3, 3))
        for state, displacement in zip(gradient, displacements, strict=True):
            state[:, :dim, :dim] = displacement[table].transpose(0, 2, 1) @ slopes
        strain = (gradient + gradient.swapaxes(2, 3)) / 2
        full = 2 * mu * strain
        for i in range(3):
            full[:, :, i, i] += lam * np.trace(strain, axis1=2, axis2=3)
        parts = [full[:, :, i, k] for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))]
        blocks.append(np.stack(parts, axis=2))
    result = np.concatenate(blocks, axis=1)
    if thermal is not None:
        moduli = [thermal_modulus(*material[region]) for region in space.body.regions]
        result[:, :, :3] -= (by_element(space, moduli) * thermal)[:, :, None]
    return result
