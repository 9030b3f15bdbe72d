"""Shape functions of order 2: number, continuity, exact quadratic fields."""

import numpy as np
import pytest
from damjoint.fem.elasticity import at_middles, body_force, elasticity, mass, stress, thermal_load
from damjoint.fem.elements import CORNERS, Space, basis, corners_of
from damjoint.mesh.body import Body
from scipy.sparse.linalg import spsolve

#: Numbers of functions: quadratic on simplices, products of quadratic ones on other shapes.
FUNCTIONS = {"vertex": 1, "line": 3, "triangle": 6, "quad": 9, "tetra": 10, "wedge": 18}
FUNCTIONS["hexahedron"] = 27
YOUNG, POISSON = 3e10, 0.2
#: Elements of a unit cell of a grid, by their corners.
CELLS = {
    "quad": [[0, 1, 2, 3]],
    "triangle": [[0, 1, 2], [0, 2, 3]],
    "hexahedron": [[0, 1, 2, 3, 4, 5, 6, 7]],
    "wedge": [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]],
    "tetra": [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]],
}
#: The same element with its nodes numbered from another corner.
TURNED = {"quad": [1, 2, 3, 0], "hexahedron": [1, 2, 3, 0, 5, 6, 7, 4], "wedge": [1, 2, 0, 4, 5, 3]}


def grid(shape, shake=0.2, size=2):
    """A body of distorted cells, some of them numbered from another corner, with unordered tags."""
    rng = np.random.default_rng(142)
    corners = corners_of("quad" if shape in ("quad", "triangle") else "hexahedron")
    dim = corners.shape[1]
    places = np.stack(np.meshgrid(*[np.arange(size + 1)] * dim, indexing="ij"), axis=-1)
    places = places.reshape(-1, dim)
    inside = ((places > 0) & (places < size)).all(axis=1)
    cells = places[(places < size).all(axis=1)][:, None] + (corners + 1).astype(int) // 2
    cells = np.ravel_multi_index(np.moveaxis(cells, 2, 0), (size + 1,) * dim)
    table = np.concatenate([cells[:, part] for part in CELLS[shape]])
    if shape in TURNED:
        table[::2] = table[::2][:, TURNED[shape]]
    points = np.zeros((len(places), 3))
    points[:, :dim] = places + shake * rng.uniform(-1, 1, places.shape) * inside[:, None]
    tags = 1 + rng.permutation(len(points))
    return Body(points, tags, [(shape, table)], np.arange(len(table)), ["dam"]), dim


def quadratic(dim):
    """A full quadratic displacement (points) -> (n, dim) and its second derivatives (component,
    dim, dim).
    """
    rng = np.random.default_rng(7)
    second = rng.normal(size=(dim, dim, dim))
    second += second.swapaxes(1, 2)
    first, constant = rng.normal(size=(dim, dim)), rng.normal(size=dim)

    def field(points):
        x = points[:, :dim]
        return constant + x @ first.T + np.einsum("cij,ni,nj->nc", second, x, x) / 2

    return field, second


@pytest.mark.parametrize("shape", CORNERS)
def test_dimension_of_the_space(shape):
    """The functions are independent; at the nodes only the nodal ones are not 0."""
    rng = np.random.default_rng(1)
    dim = corners_of(shape).shape[1]
    values = np.array([basis(shape, 2, u)[0] for u in rng.uniform(-1, 1, (60, dim))])
    assert values.shape[1] == FUNCTIONS[shape] == np.linalg.matrix_rank(values, tol=1e-9)
    at_nodes = np.array([basis(shape, 2, u)[0] for u in corners_of(shape)])
    assert at_nodes == pytest.approx(np.eye(*at_nodes.shape), abs=1e-15)


@pytest.mark.parametrize("shake", [0, 0.2])
@pytest.mark.parametrize("shape", CELLS)
def test_patch_test_of_order_2(shape, shake):
    """A quadratic displacement on the boundary, with its body force, is reproduced inside a mesh of
    distorted elements to rounding; so is its stress.
    """
    body, dim = grid(shape, shake)
    space = Space(body, 2)
    field, second = quadratic(dim)
    lam = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    mu = YOUNG / (2 * (1 + POISSON))
    # -div sigma of a linear strain
    density = -mu * np.einsum("cii->c", second) - (lam + mu) * np.einsum("iic->c", second)
    load = sum(density[c] * body_force(space, dim, c) for c in range(dim))
    stiffness = elasticity(space, dim, {"dam": (YOUNG, POISSON)}).scipy()
    wanted = spsolve(space.interpolation(2).scipy().tocsc(), field(space.locations))
    size = body.points[:, :dim].max()
    outside = np.isclose(space.locations[:, :dim] * (size - space.locations[:, :dim]), 0).any(
        axis=1
    )
    free = np.flatnonzero(np.repeat(~outside, dim))
    found = wanted.ravel().copy()
    found[free] = 0
    assert len(free) > dim
    found[free] = spsolve(stiffness[free][:, free].tocsc(), (load - stiffness @ found)[free])
    assert found == pytest.approx(wanted.ravel(), abs=1e-11 * np.abs(wanted).max())

    middles = np.pad(body.middles()[:, :dim], ((0, 0), (0, 3 - dim)))
    step = np.eye(3)[:dim] * 1e-3  # central differences of a quadratic field are exact
    slope = np.stack([(field(middles + h) - field(middles - h)) / 2e-3 for h in step], axis=2)
    shear = mu * (slope[:, 0, 1] + slope[:, 1, 0])
    computed = stress(space, found.reshape(1, -1, dim), {"dam": (YOUNG, POISSON)})[0, :, 3]
    assert computed == pytest.approx(shear, abs=1e-9 * np.abs(shear).max())


@pytest.mark.parametrize("shape, corners", [("hexahedron", [0, 1, 5, 4]), ("wedge", [0, 1, 4, 3])])
def test_the_functions_of_a_face_are_those_of_the_body(shape, corners):
    """Positions and values are the same, numbered from any corner."""
    body, _ = grid(shape)
    cells = np.roll(body.cells[0][1][3:4, corners], 1, axis=1)
    used = np.unique(cells)
    quads = [("quad", np.searchsorted(used, cells))]
    face = Body(body.points[used], body.node_tags[used], quads, used[:1])
    whole, part = Space(body, 2), Space(face, 2)
    found = whole.find(part)
    assert len(np.unique(found)) == len(part.locations) == 9
    assert whole.locations[found] == pytest.approx(part.locations, abs=1e-12)
    here = whole.interpolation(2)[found].toarray()
    assert here[:, found] == pytest.approx(part.interpolation(2).toarray(), abs=1e-15)
    assert np.abs(here).sum() == pytest.approx(np.abs(here[:, found]).sum())


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("shape", CELLS)
def test_free_thermal_expansion_has_no_stress(shape, order):
    """On distorted elements; also of a temperature that is linear in x, which bends the body, with
    order 2. In plane strain the expansion is 1 + nu times larger, and sigma_zz is prevented.
    """
    body, dim = grid(shape)
    space, material = Space(body, order), {"dam": (YOUNG, POISSON)}
    stiffness = elasticity(space, dim, material).scipy()
    free = 1 + POISSON if dim == 2 else 1

    def bent(x):
        """Displacement of the strain x in all directions."""
        squares = x[:, :1] ** 2 - (x[:, 1:] ** 2).sum(axis=1, keepdims=True)
        return np.hstack([squares / 2, x[:, :1] * x[:, 1:]])

    fields = [(lambda p: np.ones(len(p)), lambda x: x)]
    if order == 2:
        fields.append((lambda p: p[:, 0], bent))
    for strain, displacement in fields:
        wanted = free * displacement(space.locations[:, :dim])
        wanted = spsolve(space.interpolation(2).scipy().tocsc(), wanted) if order == 2 else wanted
        load = thermal_load(space, dim, material, "dam", strain)
        assert stiffness @ wanted.ravel() == pytest.approx(load, abs=1e-12 * np.abs(load).max())
        thermal = at_middles(space, "dam", strain)[None]
        computed = stress(space, wanted.reshape(1, -1, dim), material, thermal)[0]
        prevented = np.zeros_like(computed)
        if dim == 2:
            prevented[:, 2] = -YOUNG * thermal[0]
        assert computed == pytest.approx(prevented, abs=1e-11 * YOUNG)


@pytest.mark.parametrize("shape", CELLS)
def test_the_mass_matrix_is_the_integral_of_products(shape):
    """rho integral of (x y)(1 + y), of the functions of order 2, on a grid of parallel sides."""
    body, dim = grid(shape, shake=0.0)
    space = Space(body, 2)
    matrix = mass(space, dim, {"dam": 3.0})

    def function(field):
        """Coefficients of a quadratic field along x, from its values at the locations."""
        values = field(space.locations)
        solution = np.linalg.lstsq(space.interpolation(2).toarray(), values, rcond=None)[0]
        return np.kron(solution, np.eye(dim)[0])

    one = function(lambda p: p[:, 0] * p[:, 1])
    other = function(lambda p: 1 + p[:, 1])
    exact = 2 * (2 + 8 / 3) * (2 if dim == 3 else 1)  # int x int (y + y^2), sides of 2
    assert one @ matrix @ other == pytest.approx(3 * exact)


def test_a_matrix_assembled_in_batches_is_the_same(monkeypatch):
    body, dim = grid("triangle")
    space, material = Space(body, 2), {"dam": (YOUNG, POISSON)}
    at_once = elasticity(space, dim, material).toarray()
    monkeypatch.setattr("damjoint.fem.elasticity.MOST_ELEMENTS", 3)
    monkeypatch.setattr("damjoint.fem.elasticity.MOST_ENTRIES", 800)
    in_batches = elasticity(space, dim, material).toarray()
    assert in_batches == pytest.approx(at_once, rel=1e-13, abs=1e-13 * np.abs(at_once).max())
