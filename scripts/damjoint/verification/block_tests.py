"""Published slips of Newmark's rigid block: those of SLAMMER (Jibson et al. 2013, U.S. Geological
Survey), with which pySLAMMER is verified, under records in both signs; and of single sines.

The block slips to one side only, downwards on a slope, where the acceleration of the ground exceeds
that of yield. Each function is a family: the tests by the names that the column `modeling` of
reference/FAMILY.csv has.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import data
from ..arrays import Array
from ..dynamics.record import Record
from ..dynamics.record_files import STANDARD_GRAVITY, read
from ..dynamics.rigid_block import RigidBlock

#: Records, reference/slammer_NAME.at2: of those of SLAMMER that pySLAMMER ships the two shortest
#: with an interval of 0.005 s; at longer ones the slips of SLAMMER are up to 8 % larger.
#: Each with the peak and yield accelerations [g] of the tests whose slips are half a centimetre and
#: more.
RECORDS = {
    "WWT-180": [(0.5, 0.05), (0.4, 0.1), (0.4, 0.2)],
    "NS1-280": [(0.5, 0.05), (0.4, 0.1)],
}
#: Yield accelerations [g] under a sine of 1 g; its frequency [Hz] and intervals in its period.
YIELDS, FREQUENCY, INTERVALS = (0.1, 0.2, 0.4, 0.6, 0.8), 2.0, 1000
#: Acceleration of yield against the slope [g], which no record reaches.
UPWARDS = 100.0


@dataclass(frozen=True)
class BlockTest:
    """A block with a yield acceleration [g] under a record."""

    record: Record
    strength: float

    def slip(self) -> float:
        """Its slip [m]."""
        block = RigidBlock(
            normal=1.0,
            shear=(UPWARDS - self.strength) / 2 * STANDARD_GRAVITY,
            friction=(UPWARDS + self.strength) / 2 * STANDARD_GRAVITY,
            cohesion=0.0,
            mass=1.0,
            shear_by_ground=np.array([-1.0, 0.0]),
            normal_by_ground=np.zeros(2),
        )
        return block.slip(self.record) or 0.0


def follow(test: BlockTest) -> dict[str, Array]:
    """The column `slip` [m] at the end of a test, t."""
    return {"t": np.array([test.record.duration]), "slip": np.array([test.slip()])}


def scaled(name: str, peak: float) -> Record:
    """A record of which the largest acceleration [g] is a peak; < 0: with the other sign."""
    times, values = read(data("reference") / f"slammer_{name}.at2").rows[:, :2].T
    values = values * peak * STANDARD_GRAVITY / np.abs(values).max()
    return Record(times, np.column_stack([values, np.zeros_like(values)]))


def sine() -> Record:
    """A single sine of 1 g."""
    phase = np.linspace(0, 2 * np.pi, INTERVALS + 1)
    values = STANDARD_GRAVITY * np.sin(phase)
    times = phase / (2 * np.pi * FREQUENCY)
    return Record(times, np.column_stack([values, np.zeros_like(values)]))


def slammer() -> dict[str, BlockTest]:
    """Records in both signs, and a sine."""
    tests = {f"sine {y:g}": BlockTest(sine(), y) for y in YIELDS}
    for name, peaks in RECORDS.items():
        for peak, strength in peaks:
            for sign in (1, -1):
                key = f"{name} {sign * peak:+g} {strength:g}"
                tests[key] = BlockTest(scaled(name, sign * peak), strength)
    return tests


FAMILIES = {"slammer": slammer}
