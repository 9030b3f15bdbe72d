"""Measures of a ground motion: Arias intensity, significant duration, response spectrum."""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Array
from .record_files import STANDARD_GRAVITY

#: Damping ratio of the spectrum, and parts of the Arias intensity that bound the significant
#: duration [Trifunac and Brady 1975].
DAMPING, SIGNIFICANT = 0.05, (0.05, 0.95)
#: Steps in a period of the spectrum, at least.
STEPS_OF_PERIOD = 20


def arias_growth(times: Array, acceleration: Array) -> Array:
    """The Arias intensity (n,) [m/s] up to each of the times (n,) [s], pi/(2 g) times the integral
    of the squared acceleration (n,) [m/s2], which is linear between them [Arias 1970].
    """
    before, after = acceleration[:-1], acceleration[1:]
    squares = np.diff(times) * (before**2 + before * after + after**2) / 3
    return math.pi / (2 * STANDARD_GRAVITY) * np.append(0.0, np.cumsum(squares))


def significant_duration(times: Array, acceleration: Array) -> float:
    """The time [s] in which the Arias intensity grows between the parts SIGNIFICANT of its end;
    arguments as in `arias_growth`, with an acceleration that is not zero.
    """
    growth = arias_growth(times, acceleration)
    first, last = (np.interp(part * growth[-1], growth, times) for part in SIGNIFICANT)
    return float(last - first)


def spectrum(times: Array, acceleration: Array, periods: Array, damping: float = DAMPING) -> Array:
    """The pseudo-acceleration (k,) [m/s2] of oscillators of periods (k,) [s]: omega^2 times the
    largest displacement relative to the ground.

    Exact for an acceleration (n,) [m/s2] that is linear between the times (n,) [s] [Nigam and
    Jennings 1969]; the largest value is that of STEPS_OF_PERIOD instants in the shortest period.
    """
    longest = periods.min() / STEPS_OF_PERIOD
    parts = np.maximum(np.ceil(np.diff(times) / longest), 1).astype(int)
    begins = np.repeat(times[:-1], parts)
    number = np.arange(len(begins)) - np.repeat(np.cumsum(parts) - parts, parts)
    steps = np.repeat(np.diff(times) / parts, parts)
    ground = np.interp(np.append(begins + number * steps, times[-1]), times, acceleration)
    omega = 2 * math.pi / periods
    decay, damped = damping * omega, omega * math.sqrt(1 - damping**2)
    u, v, largest = np.zeros((3, len(periods)))
    for dt, start, end in zip(steps, ground, ground[1:], strict=False):
        slope = (end - start) / dt
        # a particular solution, linear in time, and the free vibration that the state adds to it
        drift = -slope / omega**2
        at_start = -start / omega**2 + 2 * damping * slope / omega**3
        free = u - at_start
        other = (v - drift + decay * free) / damped
        sine, cosine = np.sin(damped * dt), np.cos(damped * dt)
        fading = np.exp(-decay * dt)
        u = fading * (free * cosine + other * sine) + at_start + drift * dt
        v = drift + fading * (
            (damped * other - decay * free) * cosine - (damped * free + decay * other) * sine
        )
        largest = np.maximum(largest, np.abs(u))
    return omega**2 * largest
