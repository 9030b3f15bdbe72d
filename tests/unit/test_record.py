"""Records of the ground's acceleration, and the rigid block under them."""

import os

import numpy as np
import pytest
from damjoint import InputError
from damjoint.dynamics.record import MOST_STEPS, Record
from damjoint.dynamics.record_files import read
from damjoint.dynamics.rigid_block import RigidBlock
from damjoint.input.resolve import load
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
        ("time,a\n0,0\n0,1\n", "row 3: t = 0 s: must be > 0 s, the time before"),
        ("0,0\n", "must have 2 to"),
        ("0,0\n1,2,3\n", "row 2: 1,2,3: must have 2 or 3 numbers, as many as the others"),
        ("# a comment\n\n0,0\n1,x\n", "row 4: 1,x: must be numbers"),
        ("0,0\n1,nan\n", "row 2: 1,nan: must be finite numbers"),
        ("0,0\n1e300,1\n", "row 2: 1e300,1: .*the time within 1e"),
        ("0\n1\n", "row 1: 0: must have 2 or 3 numbers"),
    ],
)
def test_bad_files(tmp_path, text, message):
    path = tmp_path / "r.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read(path)


@pytest.mark.parametrize("name", ["/dev/zero", "pipe.csv", "."])
def test_a_record_that_may_not_end_is_refused(tmp_path, name):
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(InputError, match="must be a regular file"):
        read(tmp_path / name)


#: A record of 5 ms with a row that is too close to the one before.
UNEVEN = [0, 0.005, 0.010, 0.010001, 0.015, 0.020]


@pytest.mark.parametrize(
    "times, settings, message",
    [
        ([0, 0.005, 0.01], {"dt": 7.0}, "dt = 7: must be <= 0.005 s, the shortest interval of"),
        ([0, 0.005, 0.01], {"dt": 1e30}, "dt = 1e.30: must be <= 0.005 s"),
        ([0, 0.005, 0.01], {"dt": 1e-12}, "dt = 1e-12: must lead to at most 1000000 time steps"),
        (UNEVEN, {}, r"dt = -1, half the shortest .*before row 5; .*4.04e.06"),
        (UNEVEN, {"dt": 0.005}, r"dt = 0.005: must be <= 1e-06 s, .*before row 5"),
        ([0, 1e-12, 1e-3], {}, "row 3: t = 1e-12 s: must be >= 1e-09 s after"),
        ([0, 0.01, 0.02], {"record_rest": 1e30}, r"record_rest = 1e.30: must lead to .*2e.32 of"),
        ([0, 5e5, 1e6], {"dt": 0.5}, "dt = 0.5: must lead to at most"),
        ([0, 1, 2, 1e9], {}, r"row 5: t = 1e.09 s: must lead to"),
        ([0, 10, 20], {}, r"dt = -1, half the .*r.csv: must be <= 0.1 s, not 5 s; .*times in s"),
        ([0, 1, 2], {"dt": 0.5}, "dt = 0.5: must be <= 0.1 s"),
        ([0, 1, 2], {"record_scale": 1e300}, "row 3: must be at most 1000 g"),
    ],
)
def test_absurd_numbers_of_steps_are_forecast(tmp_path, times, settings, message):
    """The row of the file is named, or the parameter."""
    path = write_record(tmp_path / "r.csv", times, [0, *np.ones(len(times) - 1)])
    with pytest.raises(InputError, match=message):
        record(path, **settings)


def test_the_forecast_is_the_number_of_steps(tmp_path):
    path = write_record(tmp_path / "r.csv", [0, 0.01, 0.02], [0, 1, 0])
    most = MOST_STEPS * 0.005 - 0.02
    assert record(path, record_rest=most - 1e-3).duration == pytest.approx(most, abs=0.02)
    with pytest.raises(InputError, match="must lead to at most"):
        record(path, record_rest=most + 1e-3)
    assert record(path).time_step(load("dam")) == pytest.approx(0.005)
    assert record(path, dt=0.01).interval == pytest.approx(0.01)


@pytest.mark.parametrize("offset, slope", [(0.03, 0), (-0.03, 0.002), (0.003, 0)])
def test_an_offset_is_noticed_and_removed_on_request(tmp_path, offset, slope):
    """A wave without one; of a peak of 1 m/s2. Its line is found again."""
    times = np.arange(0, 10, 0.01)
    wave = np.sin(np.pi * times / 10) ** 2 * np.sin(2 * np.pi * 1.5 * times)
    line = offset + slope * times
    paths = [write_record(tmp_path / f"{k}.csv", times, wave + k * line, 0 * times) for k in (0, 1)]
    clean, shifted = (record(path, record_rest=0.0) for path in paths)
    assert clean.offsets() == []
    (text,) = shifted.offsets()
    assert "horizontal record leaves the ground with" in text
    corrected = record(paths[1], record_rest=0.0, record_baseline="corrected")
    assert corrected.offsets() == []
    rows = corrected.acceleration[-len(wave) :, 0]
    assert np.abs(rows - wave).max() < 0.05 * np.abs(line).max()


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
