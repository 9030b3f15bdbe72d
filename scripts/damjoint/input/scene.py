"""The parts of a scene: the rock, bodies of concrete, and joints between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

#: Material (suffix of E_, nu_ and rho_) of each region. The region lower: concrete bonded to rock.
MATERIALS = {"dam": "dam", "foundation": "found", "lower": "dam"}


@dataclass(frozen=True)
class Joint:
    """A joint: its name for messages, its two bodies, the names of its region and of its ends."""

    name: str
    upper: str
    lower: str
    region: str = "joint"
    heel: str = "heel"
    toe: str = "toe"


def numbered(name: str, number: int) -> str:
    """The name of a body or region of joint number 0, 1, ...: dam, dam 2, ..."""
    return f"{name} {number + 1}" if number else name


def stacked(names: Sequence[str]) -> list[Joint]:
    """The joints of a section, from the lowest: each below a body of its own."""
    bodies = ["foundation", *(numbered("dam", k) for k in range(len(names)))]
    parts = ("joint", "heel", "toe")
    return [
        Joint(name, bodies[k + 1], bodies[k], *(numbered(part, k) for part in parts))
        for k, name in enumerate(names)
    ]


#: Sides of a face, in the order of the numbers in pro/section.pro: reservoir, tailwater, water on
#: the crest, on the reservoir's floor, on the tailwater's bed.
SIDES = UP, DOWN, TOP, FLOOR, BED = "up", "down", "top", "floor", "bed"
#: Sides on which tailwater presses, not the reservoir.
TAILWATER = DOWN, BED

#: Regions of line forces; the last: where a displacement is prescribed, by its unit force.
LINES = *_, POINT = "ice", "force", "anchor", "point"
#: Region of a face under a traction.
TRACTION = "traction"
