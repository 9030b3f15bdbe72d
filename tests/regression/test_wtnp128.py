"""WTNP128, the wedge splitting test with water: its equations, on a coarse mesh."""

import numpy as np
import pytest
from damjoint.verification import wedge_tests


@pytest.fixture(scope="module")
def splitting():
    """Three steps of the slow test, with elements of 10 mm along the crack."""
    splitting = wedge_tests.Splitting(wedge_tests.wtnp128()["A"], 10.0)
    for time in (40.0, 80.0, 120.0):
        splitting.advance(time)
    return splitting


def test_the_tangent_is_that_of_finite_differences(splitting):
    """Where the crack is open; that closed points store their opening is left out of it."""
    wedge, opening = 0.12, splitting.specimen.opening
    wider = 1.01 * splitting.unknowns  # else points load or unload
    now = splitting.at(wider, wedge)
    assert now.water.pressure.max() > 1e-3  # water follows the crack
    closed = opening @ wider < 1e-3
    way = np.random.default_rng(1).normal(size=len(splitting.unknowns)) * 1e-7
    way[np.unique(opening[np.flatnonzero(closed)].indices)] = 0
    assert np.count_nonzero(way) > 10
    above, below = (splitting.at(wider + s * way, wedge).residual for s in (1, -1))
    expected = now.tangent @ way
    assert (above - below) / 2 == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())


def test_the_water_is_kept(splitting):
    """What has entered from the notch is stored in the crack."""
    stored = splitting.stored
    opening = splitting.specimen.opening @ splitting.unknowns
    volume = splitting.fields.T @ (splitting.specimen.points.weights * opening)
    assert stored.inflow.sum() == pytest.approx(stored.volume.sum(), rel=1e-11)
    now = splitting.at(splitting.unknowns, 0.12)
    held = splitting.storage @ now.pressure
    assert now.water.change.sum() == pytest.approx(volume.sum() + held, rel=1e-11)


def test_the_measured_force_on_a_coarse_mesh(splitting):
    """Elements of 10 mm: within 20 % at 120 s between the forces measured at 100 and 150 s."""
    force, _ = splitting.advance(150.0)
    assert force == pytest.approx(-6.41, rel=0.2)
