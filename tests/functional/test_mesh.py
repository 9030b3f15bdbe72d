"""Meshes: element counts as published, areas, nodes on the joint."""

import numpy as np
import pytest
from damjoint.input.parameters import start_gmsh
from damjoint.input.resolve import load
from damjoint.mesh import mesh
from damjoint.mesh.generate import generate
from damjoint.verification.wedge_tests import Groups

# Bulk and joint elements, from the table of the verification document.
PUBLISHED = {
    "a": (2264, 50),
    "i": (2264, 50),
    "e": (3626, 100),
    "g": (3626, 100),
    "c": (860 + 34, 50),
    "j": (860 + 34, 50),
    "b": (37583, 1146),
    "d": (37583, 1146),
    "f": (7435, 200),
    "h": (7435, 200),
}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.heavy) if n in "bdfh" else n for n in PUBLISHED]
)
def test_element_counts(name):
    counts = mesh.Mesh(load(name)).counts
    assert (counts["elements"], counts["joint_elements"]) == pytest.approx(PUBLISHED[name], rel=0.1)


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"mesh_pattern": "regular"},
        {"dim": 3, "mesh_pattern": "regular", "n_layers": 2},
        {"dim": 3, "mesh_pattern": "layers"},
        {"dim": 3, "mesh_pattern": "split"},
        {"dim": 3, "h_dam": 3, "h_found": 3},
    ],
)
def test_area_of_dam_and_foundation(settings):
    """32.5 and 15 x 5 m2 (times the thickness), by summation over the elements."""
    import gmsh

    mesh.Mesh(load("ssnp142", {"n_joint": 10, "thickness": 0.5, **settings}))
    dim = settings.get("dim", 2)
    for group, area in ((1, 32.5), (2, 75)):
        size = sum(
            np.sum(gmsh.model.mesh.getElementQualities(tags, "volume"))
            for entity in gmsh.model.getEntitiesForPhysicalGroup(dim, group)
            for tags in gmsh.model.mesh.getElements(dim, entity)[1]
        )
        assert size == pytest.approx(area * (0.5 if dim == 3 else 1), rel=1e-9)


@pytest.mark.parametrize("drain_x", [0.02, 6.1, 33.9])
@pytest.mark.parametrize(
    "settings",
    [
        {"n_joint": 20},
        {"n_joint": 1},
        {"n_joint": 20, "mesh_pattern": "regular"},
        {"n_joint": 20, "joint_slope": -5},
        {"n_joint": 20, "dam_base": 40, "joint_height": 6},
        *(
            {"n_joint": 20, "n_layers": 2, "dim": 3, "mesh_pattern": pattern}
            for pattern in ("free", "layers", "split", "regular")
        ),
    ],
)
def test_a_node_at_the_drains(settings, drain_x):
    """At any position, on a line along z; the number of elements of the joint is the same."""
    case = load("dam", {"drains": 1, "uplift": "cracked", "drain_x": drain_x} | settings)
    points = mesh.Mesh(case).bodies["joint"].points
    heel = [case.section[name][0] for name in ("heel_x", "heel_y")]
    away = np.hypot(*(points[:, :2] - heel).T).round(9)
    assert len(np.unique(away)) == max(settings["n_joint"], 2) + 1
    assert np.sum(away == drain_x) == np.sum(away == 0) == (3 if case["dim"] == 3 else 1)


def test_a_force_at_the_corner_of_the_crest():
    """Rounding puts it 5e-16 m beside the corner; there must be one point only."""
    found = mesh.Mesh(load("dam", {"batter": 0.6, "dam_crest": 3.5, "force_x": 1e4, "n_joint": 5}))
    assert (found.bodies["force"].node_tags == found.bodies["crest"].node_tags).all()


#: The end of the batter is just below the heel of a joint that falls to the toe.
BESIDE_HEEL = {"batter": 5.0, "batter_height": 8.9, "joint_height": 9.0, "joint_slope": -2.5}
SOLID = {"dim": 3.0, "n_layers": 2.0}


@pytest.mark.parametrize("settings", [{}, {"joint_height": 9.0}, SOLID, SOLID | BESIDE_HEEL])
def test_a_joint_lies_between_its_bodies(settings):
    """Its nodes are nodes of both; its normals point to the upper one; its ends bound it."""
    found = mesh.Mesh(load("dam", {"n_joint": 6.0, "mesh_pattern": "free"} | settings))
    (joint,) = found.joints
    assert found.solids.keys() == {joint.upper, joint.lower}
    for name, side in ((joint.upper, 1), (joint.lower, -1)):
        body = found.solids[name]
        assert np.isin(joint.surface.node_tags, body.node_tags).all()
        away = body.points.mean(axis=0) - joint.surface.points.mean(axis=0)
        assert (side * joint.surface.normals @ away > 0).all()
    x = joint.surface.points[:, 0]
    assert np.allclose(x[joint.heel_nodes], x.min()) and np.allclose(x[joint.toe_nodes], x.max())
    assert {face.body for face in found.faces.values()} == set(found.solids)


def test_options_that_a_geometry_sets_do_not_reach_the_next_mesh():
    """The section of a dam without a pattern takes no sizes from points; that of a wedge does."""
    first = len(Groups(10.0).points)
    start_gmsh().option.setNumber("Mesh.MeshSizeFactor", 3)
    generate(load("dam", {"mesh_pattern": "free", "n_joint": 4}))
    assert len(Groups(10.0).points) == first
