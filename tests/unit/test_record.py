"""Records of the ground's acceleration, and the rigid block under them."""

import numpy as np
import pytest
from damjoint import InputError
from damjoint.dynamics.record import Record, read
from damjoint.dynamics.rigid_block import RigidBlock
from damjoint.model.case import load
from quakes import write_record


def record(path, **settings):
    return Record.of(load("dam", {"record_unit": "m/s2", **settings}, record=path))


def test_component_scale_unit_and_rest(tmp_path):
    path = write_record(tmp_path / "r.csv", [0, 0.01, 0.02], [0, 1, 2], [0, -1, 3])
    own = record(path, record_scale=-2.0, record_rest=1.0)
    assert own.times == pytest.approx([0, 0.01, 0.02, 0.03, 1.02])
    assert own.acceleration == pytest.approx(
        np.array([[0, 0], [-2, 2], [-4, -6], [0, 0], [0, 0]], float)
    )
    assert own.interval == pytest.approx(0.01)
    assert own.at(0.005) == pytest.approx([-1, 1])
    in_g = record(path, record_unit="g", record_component="vertical", record_rest=0.0)
    assert in_g.acceleration == pytest.approx(9.80665 * np.array([[0, 0], [0, -1], [0, 3]]))


def test_a_record_that_does_not_start_at_zero_is_preceded_by_it(tmp_path):
    path = write_record(tmp_path / "r.csv", [1, 1.01, 1.02, 1.03], [0, 1, 2, 3])
    own = record(path, record_start=1.015, record_rest=0.0)
    assert own.times == pytest.approx([0, 0.01, 0.015, 0.025])
    assert own.acceleration[:, 0] == pytest.approx([0, 1.5, 2, 3])


def test_the_velocity_is_the_integral_of_the_acceleration(tmp_path):
    path = write_record(tmp_path / "r.csv", [0, 0.1, 0.3], [0, 2, 1], [0, -4, 0])
    own = record(path, record_rest=0.0).delayed(0.5)
    assert own.times == pytest.approx([0, 0.5, 0.6, 0.8])
    times = np.array([-1, 0.5, 0.55, 0.6, 0.7, 0.8, 0.9])
    expected = np.array(
        [[0, 0, 0.025, 0.1, 0.275, 0.4, 0.5], [0, 0, -0.05, -0.2, -0.5, -0.6, -0.6]]
    )
    assert own.velocity(times) == pytest.approx(expected.T, abs=1e-15)


@pytest.mark.parametrize(
    "text, message",
    [
        ("time,a\n0,0\n0,1\n", "times that increase"),
        ("0,0\n", "must have 2 to"),
        ("0,0\n1,2,3\n", "must have 2 to"),
        ("0,0\n1,x\n", "row 2: 1,x: must be numbers"),
        ("0,0\n1,nan\n", "finite numbers"),
        ("0\n1\n", "must have 2 to"),
    ],
)
def test_bad_files(tmp_path, text, message):
    path = tmp_path / "r.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read(path)


def test_rigid_block_in_closed_form():
    """A rectangle of acceleration (Newmark 1965)."""
    own = Record(np.array([0, 1e-4, 0.2, 0.2001, 0.7]), np.array([[0, 8, 8, 0, 0], [0] * 5]).T)
    block = RigidBlock(
        normal=9.81,
        shear=0.0,
        friction=0.5,
        cohesion=0.0,
        mass=1.0,
        shear_by_ground=np.array([1.0, 0]),
        normal_by_ground=np.array([0, 1.0]),
    )
    way = (8 - 0.5 * 9.81) * 8 * 0.2**2 / (2 * 0.5 * 9.81)
    assert block.slip(own) == pytest.approx(-way, rel=5e-4)
