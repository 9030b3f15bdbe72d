"""Both ways of condensing bodies onto joints, and large symmetric matrices in place."""

import numpy as np
import pytest
from damjoint.arrays import BLOCK, mirror
from damjoint.fem.bodies import Bodies
from damjoint.fem.condensation import responses_body_by_body
from damjoint.fem.glued_elimination import responses_at_once
from damjoint.fem.gluing import Gluing
from damjoint.input.resolve import load


@pytest.mark.heavy
@pytest.mark.parametrize(
    "name, settings",
    [
        ("c", {}),
        ("dam", {"lift_heights": (15.0, 30.0), "n_joint": 10.0}),
        ("b", {"n_joint": 8.0, "n_layers": 2.0}),
    ],
)
def test_both_eliminations_agree(name, settings):
    bodies = Bodies.of(load(name, settings))
    gluing = Gluing.of(bodies)
    one, other = (
        eliminate(bodies, gluing) for eliminate in (responses_body_by_body, responses_at_once)
    )

    def close(values, expected):
        assert values == pytest.approx(expected, rel=0, abs=1e-9 * np.abs(expected).max())

    close(other.stiffness, one.stiffness)
    crest, expected = other.measures["crest"], one.measures["crest"]
    close(crest.jump, expected.jump)
    assert other.units.keys() == one.units.keys() == expected.units.keys()
    for load_name, forces in one.units.items():
        close(other.units[load_name], forces)
        close(crest.units[load_name], expected.units[load_name])
    for face, column in one.dof_of_face.items():
        own = other.dof_of_face[face]
        loaded = column >= 0
        assert np.array_equal(own >= 0, loaded) and loaded.any()
        close(other.pressure[:, own[loaded]], one.pressure[:, column[loaded]])
        close(crest.pressure[own[loaded]], expected.pressure[column[loaded]])


@pytest.mark.parametrize("order", "CF")
def test_mirror(order):
    matrix = np.random.default_rng(0).normal(size=(2 * BLOCK + 3,) * 2)
    symmetric = np.tril(matrix) + np.tril(matrix, -1).T
    values = np.array(matrix, order=order)
    assert np.shares_memory(mirror(values), values)
    assert np.array_equal(values, symmetric)
