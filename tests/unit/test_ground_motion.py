"""Measures of a ground motion against closed forms."""

import numpy as np
import pytest
from damjoint.dynamics import ground_motion
from damjoint.dynamics.record_files import STANDARD_GRAVITY
from numpy.testing import assert_allclose


def test_arias_intensity_of_a_ramp_and_of_a_sine():
    times = np.array([0.0, 1.0, 3.0])
    growth = ground_motion.arias_growth(times, np.array([0.0, 2.0, 2.0]))
    factor = np.pi / (2 * STANDARD_GRAVITY)
    assert_allclose(growth, factor * np.array([0, 4 / 3, 4 / 3 + 8]))
    times = np.linspace(0, 10, 20001)
    sine = ground_motion.arias_growth(times, 3 * np.sin(2 * np.pi * times))
    assert sine[-1] == pytest.approx(factor * 9 / 2 * 10, rel=1e-5)


def test_significant_duration_of_a_constant_acceleration():
    assert ground_motion.significant_duration(
        np.array([0.0, 4.0]), np.array([1.0, 1.0])
    ) == pytest.approx(0.9 * 4)


def test_spectrum_of_a_step_is_that_of_the_closed_form():
    """Of an acceleration a it is a (1 + exp(-pi z/sqrt(1 - z^2))), with rows of any length."""
    periods, damping = np.array([0.1, 0.37, 1.0]), 0.05
    overshoot = 1 + np.exp(-np.pi * damping / np.sqrt(1 - damping**2))
    for times in (np.array([0.0, 5.0]), np.array([0.0, 0.013, 0.4, 1.1, 5.0])):
        found = ground_motion.spectrum(times, np.full(len(times), 2.0), periods, damping)
        assert_allclose(found, 2 * overshoot, rtol=5e-3)


@pytest.mark.heavy
def test_spectrum_of_a_sine_at_resonance_and_of_a_stiff_oscillator():
    times = np.linspace(0, 40, 8001)
    wave = np.sin(2 * np.pi * times)  # period 1 s
    stiff, resonant = ground_motion.spectrum(times, wave, np.array([0.02, 1.0]), 0.05)
    assert resonant == pytest.approx(1 / (2 * 0.05), rel=1e-3)
    assert stiff == pytest.approx(1, rel=2e-3)
