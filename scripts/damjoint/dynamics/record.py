"""Records of the ground's acceleration: scaled, with their baseline corrected, and a rest."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .. import ROUND_OFF, InputError, require
from ..arrays import Array, IntArray
from ..input.case import Case
from ..input.parameters import TINY
from .record_files import STANDARD_GRAVITY, read

#: Limits of a record, beyond which it is refused. Acceleration over gravity; the strongest that
#: were recorded reach 4.
LARGEST = 1e3
#: Interval [s]; usually 5e-3 to 2e-2.
SHORTEST = 1e-9

#: Differences of intervals by the digits of the times in a file, relative.
DIGITS = 0.01

#: Limit of the time steps of an earthquake.
MOST_STEPS = 1_000_000
#: The longest time step [s]; dams vibrate with periods of 0.1 to 1 s.
LONGEST_STEP = 0.1

#: Velocity of the ground at the end of a record over its largest one, beyond which the record has
#: an offset.
OFFSET_SHARE = 0.1


@dataclass(frozen=True)
class Record:
    """Acceleration of the ground, linear between its times: > 0 downstream and upwards."""

    #: (n,) [s]; from 0
    times: Array
    #: (n, 2) [m/s2]: along x and y
    acceleration: Array

    @staticmethod
    def of(case: Case) -> Record:
        """The record of a case: scaled, from record_start on, its baseline corrected if required,
        followed by a rest.

        A record that does not start at zero gets a row of zeros one interval before: a load that is
        there at the start would be counted half. Raises InputError, also if the time step does not
        resolve it or leads to more than MOST_STEPS steps.
        """
        if case.record is None:
            raise InputError(
                'record: must be set, record = "FILE.csv"; in the case, or --record FILE.csv'
            )
        file = read(case.record, case.record_vertical)
        stated = file.in_si or case["record_unit"] != "unstated"
        rule = f"be m/s2 or g, the unit of the accelerations in {case.record}"
        require(stated, "record_unit", "unstated", rule)
        rows, lines = file.rows, file.lines
        unit = STANDARD_GRAVITY if case["record_unit"] == "g" and not file.in_si else 1.0
        parts = {"both": (1, 1), "horizontal": (1, 0), "vertical": (0, 1)}
        scale = unit * case["record_scale"] * np.array(parts[case["record_component"]])
        start, rest = case["record_start"], case["record_rest"]
        times, acceleration = rows[:, 0], rows[:, 1:] * scale
        large = np.flatnonzero(np.abs(acceleration).max(axis=1) > LARGEST * case["g"])
        scaled = f"record_scale = {case['record_scale']:g}"
        if len(large):
            limit = f"{LARGEST:g} g (record_unit = {case['record_unit']}, {scaled})"
            row = f"{case.record}, row {lines[large[0]]}"
            raise InputError(f"record = {row}: must be at most {limit}")
        rule = f"be >= {times[0]:g} and < {times[-1]:g} s, the times of {case.record}"
        require(times[0] <= start < times[-1], "record_start", start, rule)
        component = f"record_component = {case['record_component']}"
        rule = f"have an acceleration other than zero ({component}, {scaled})"
        require(acceleration.any(), "record", str(case.record), rule)
        interval = float(np.diff(times).min())
        check_steps(case, times, lines)
        first = at(times, acceleration, start)
        later = times > start + ROUND_OFF * interval
        times = np.concatenate([[start], times[later]])
        acceleration = np.vstack([first, acceleration[later]])
        if case["record_baseline"] == "corrected":
            acceleration = acceleration - baseline(times, acceleration)
            first = acceleration[0]
        if first.any():
            times = np.concatenate([[start - interval], times])
            acceleration = np.vstack([np.zeros(2), acceleration])
        if rest > 0:
            ends = times[-1] + np.array([interval, max(rest, 2 * interval)])
            times = np.concatenate([times, ends])
            acceleration = np.vstack([acceleration, np.zeros((2, 2))])
        return Record(times - times[0], acceleration)

    @property
    def duration(self) -> float:
        """The last time [s]."""
        return float(self.times[-1])

    @property
    def interval(self) -> float:
        """The shortest interval between two rows [s]."""
        return float(np.diff(self.times).min())

    def time_step(self, case: Case) -> float:
        """The longest time step [s]: dt, by default half the shortest interval."""
        return float(self.interval / 2 if case["dt"] == -1 else case["dt"])

    def at(self, time: float) -> Array:
        """Acceleration along x and y (2,) [m/s2] at a time."""
        return at(self.times, self.acceleration, time)

    def velocity(self, times: Array) -> Array:
        """Velocity along x and y (n, 2) [m/s] at times (n,), zero before the record."""
        row = np.clip(np.searchsorted(self.times, times, "right") - 1, 0, None)
        since = np.maximum(times - self.times[row], 0)[:, None]
        mean = (self.acceleration[row] + at(self.times, self.acceleration, times)) / 2
        return self._velocities[row] + since * mean

    @cached_property
    def _velocities(self) -> Array:
        """Velocity at the times (n, 2)."""
        return integral(self.times, self.acceleration)

    def offsets(self) -> list[str]:
        """What remains of the ground's velocity at the end, in words, a text for each component in
        which it is more than OFFSET_SHARE of the largest velocity.
        """
        texts = []
        for axis, velocity in zip(("horizontal", "vertical"), self._velocities.T, strict=True):
            last, largest = velocity[-1], np.abs(velocity).max()
            if abs(last) > OFFSET_SHARE * largest:
                texts.append(
                    f"the {axis} record leaves the ground with {last:.3g} m/s, its largest "
                    f"velocity is {largest:.3g} m/s: it may have an offset, which moves the dam "
                    "(record_baseline = corrected removes it)"
                )
        return texts

    def delayed(self, time: float) -> Record:
        """The record later by a time [s], after rest."""
        return Record(
            np.append(0.0, self.times + time), np.vstack([np.zeros(2), self.acceleration])
        )


def check_steps(case: Case, times: Array, lines: IntArray) -> None:
    """Raise InputError if the time steps of a case do not resolve its record, or are too many;
    lines: of the times (n,) in its file.
    """
    name, intervals, dt = f"record = {case.record}", np.diff(times), case["dt"]
    k, typical = int(intervals.argmin()), float(np.median(intervals))
    shortest, rest = float(intervals[k]), case["record_rest"]
    if shortest < SHORTEST:
        raise InputError(
            f"{name}, row {lines[k + 1]}: t = {times[k + 1]:g} s: must be >= {SHORTEST:g} s after "
            "the time before"
        )
    limit = f"the shortest interval of {case.record}"
    if shortest < typical * (1 - DIGITS):
        limit += f" (before row {lines[k + 1]}; half of its intervals are >= {typical:g} s)"
    require(dt <= shortest * (1 + DIGITS), "dt", dt, f"be <= {shortest:g} s, {limit}")
    duration = float(times[-1]) - case["record_start"]
    step = shortest / 2 if dt == -1 else dt
    number = (duration + rest) / max(step, TINY)
    cause = f"dt = {dt:g}" + (f", half {limit}" if dt == -1 else "")
    if number <= MOST_STEPS:
        if step > LONGEST_STEP * (1 + DIGITS):
            raise InputError(
                f"{cause}: must be <= {LONGEST_STEP:g} s, not {step:g} s; are the record's times "
                "in s?"
            )
        return
    if duration + rest > typical / 2 * MOST_STEPS:
        longest = f"{name}, row {lines[-1]}: t = {times[-1]:g} s"
        cause = f"record_rest = {rest:g}" if rest > duration else longest
    raise InputError(
        f"{cause}: must lead to at most {MOST_STEPS} time steps, not {number:.3g} of {step:.3g} s"
    )


def integral(times: Array, acceleration: Array) -> Array:
    """Velocity (n, 2) [m/s] at times (n,) of a piecewise linear acceleration (n, 2), from rest."""
    means = (acceleration[1:] + acceleration[:-1]) / 2
    return np.vstack([np.zeros(2), np.cumsum(np.diff(times)[:, None] * means, axis=0)])


def baseline(times: Array, acceleration: Array) -> Array:
    """The line in time (n, 2) [m/s2] without which the velocity is zero at the end and has the
    smallest mean square [after Berg and Housner 1961, there a parabola].
    """
    t, velocity = times - times[0], integral(times, acceleration)
    duration, weights = t[-1], np.gradient(t)
    mean = velocity[-1] / duration
    curve = t * (t - duration) / 2  # velocity of an acceleration t - duration/2
    slope = (weights * curve) @ (velocity - np.outer(t, mean)) / (weights @ curve**2)
    return mean + np.outer(t - duration / 2, slope)


def at(times: Array, values: Array, time: float | Array) -> Array:
    """Values (n, 2) at times (n,), linear between them, at a time (2,) or at times (m, 2)."""
    return np.stack([np.interp(time, times, column) for column in values.T], axis=-1)
