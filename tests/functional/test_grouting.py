"""The grouted joint between two elastic blocks (code_aster, SSNP143 A): published openings."""

import numpy as np
import pytest
from damjoint.fem.elasticity import body_force, elasticity
from damjoint.fem.elements import JOINT, Space, points_of
from damjoint.input.resolve import load
from damjoint.mesh.body import Body
from scipy import sparse
from scipy.sparse.linalg import spsolve

WIDTH, HEIGHT, N = 5.0, 10.0, 20
LAW = {"K_N": 1e12, "K_T": 1e12, "sigma_max": 0.0, "alpha": 1.0, "pena_rupture": 0.2}
PRESSURE = 5e4
#: y: opening computed by GEFDYN and its tolerance
PUBLISHED = {2: (6.38e-7, 0.06), 5: (2.14e-6, 0.07), 8: (3.88e-6, 0.07)}


def block():
    """A block of N/2 x N quadrangles and its vertical face at x = 0, listed upwards."""
    x, y = np.meshgrid(np.linspace(0, WIDTH, N // 2 + 1), np.linspace(0, HEIGHT, N + 1))
    points = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
    nodes = np.arange(len(points)).reshape(x.shape)
    corners = nodes[:-1, :-1], nodes[:-1, 1:], nodes[1:, 1:], nodes[1:, :-1]
    quads = np.column_stack([c.ravel() for c in corners])
    body = Body(points, nodes.ravel(), [("quad", quads)], np.arange(len(quads)), ["dam"])
    face, line = nodes[:, 0], np.column_stack([np.arange(N), np.arange(N) + 1])
    return Space(body, 2), Space(Body(points[face], face, [("line", line)], np.arange(N)), 2)


@pytest.mark.heavy
def test_published_openings_of_a_grouted_joint():
    """Two mirrored blocks, fixed at their base; weight at t = 1, grouted at 2, compared at 3."""
    space, face = block()
    stiffness = elasticity(space, 2, {"dam": (3e12, 0.25)}).scipy()
    weight = -2400 * 9.81 * body_force(space, 2, 1)
    points, functions = points_of(face, JOINT["published"][2]), len(space.locations)
    # by symmetry the opening is twice the displacement of the face
    pick = sparse.csr_matrix(
        (np.ones(len(face.locations)), (range(len(face.locations)), 2 * space.find(face))),
        (len(face.locations), 2 * functions),
    )
    opening = 2 * points.values.scipy() @ pick
    free = np.flatnonzero(np.repeat(space.locations[:, 1] > 0, 2))
    law = load("ssnp142", LAW | {"grout_pressure": PRESSURE, "grout_t": 2.0}).law
    variables, u = law.initial(len(points.weights)), np.zeros(2 * functions)
    for time in (1, 2, 3):
        variables, residual = law.begin_step(variables, time - 1, time), weight
        while np.linalg.norm(residual[free]) > 1e-9 * np.linalg.norm(weight):
            jump = np.pad((opening @ u)[:, None], ((0, 0), (0, 2)))
            traction, tangent = law.traction_and_tangent(jump, variables)
            # each block has half of the joint's work
            half = opening.T @ sparse.diags(points.weights / 2)
            residual = weight - stiffness @ u - half @ traction[:, 0]
            matrix = stiffness + half @ sparse.diags(tangent[:, 0, 0]) @ opening
            u[free] += spsolve(matrix[free][:, free].tocsc(), residual[free])
        variables = law.update_internal_variables(jump, variables)
    assert traction[:, 0] == pytest.approx(-PRESSURE, rel=1e-6)
    for y, (published, tolerance) in PUBLISHED.items():
        (node,) = np.flatnonzero((space.locations[:, 0] == 0) & (space.locations[:, 1] == y))
        assert 2 * u[2 * node] == pytest.approx(published, rel=tolerance)
