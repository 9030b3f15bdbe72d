"""The parts of a scene: two named bodies and the joint between them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Solid:
    """An elastic body: material (suffix of E_, nu_ and rho_) by region."""

    materials: dict[str, str]


@dataclass(frozen=True)
class Joint:
    """A joint: its two bodies, the regions of its ends, the parameter that selects its law."""

    upper: str
    lower: str
    heel: str
    toe: str
    law: str


#: Bodies by name. The region under a lift joint is of the dam's concrete.
SOLIDS = {
    "dam": Solid({"dam": "dam"}),
    "foundation": Solid({"foundation": "found", "lower": "dam"}),
}
#: Joints by the name of their region.
JOINTS = {"joint": Joint(upper="dam", lower="foundation", heel="heel", toe="toe", law="law")}
#: The name of the only joint.
(JOINT_NAME,) = JOINTS

#: Sides of a face, in the order of the numbers in pro/section.pro: reservoir, tailwater, water on
#: the crest, on the reservoir's floor, on the tailwater's bed.
SIDES = UP, DOWN, TOP, FLOOR, BED = "up", "down", "top", "floor", "bed"
