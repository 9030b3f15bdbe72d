"""Case: a scene and its loading, from a case file and overrides, checked."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from .. import ROUND_OFF, InputError
from ..arrays import Setting, Value, Values
from ..laws import LAWS, Law
from .casefile import joint_name as joint_name
from .constraints import (
    USUAL,
    check_acting,
    check_distances,
    check_downstream_face,
    check_joints_on_face,
    check_lift_heights,
    check_lifts,
    check_stiffness,
    check_values,
    highest_level,
)
from .joint_graph import ROCK, JointGraph
from .parameters import GEOMETRY_LISTS, constants, declared, independent, of_one_joint
from .source import Source
from .values import ParameterValues, flows_in_time, level_unknown, listed
from .values import flows as flows
from .values import freezes_uplift as freezes_uplift
from .values import has_drains as has_drains

#: Constants of pro/parameters.pro that both engines use.
SHARED = (
    *("strategy_growth", "strategy_secant", "strategy_release", "strategy_iterations", "cut"),
    *("round_off", "rounding_ceiling", "artificial", "yield_tolerance", "release_length"),
    *("crack_aperture", "crack_most", "zangar_angle", "zangar_cm", "dissipation_shift"),
)

#: Those of them that the laws use.
SOLVER = "artificial", "yield_tolerance", "release_length"

#: Variables of pro/section.pro: ends of the joint, segments of the faces, marks of line forces.
SECTION = (
    *("heel_x", "heel_y", "toe_x", "toe_y", "joint_length", "joint_along"),
    *("seg_side", "seg_body", "seg_x0", "seg_y0", "seg_x1", "seg_y1"),
    *("mark_region", "mark_x", "mark_y", "mark_segment"),
)


@dataclass(frozen=True, kw_only=True)
class OfJoint:
    """What a joint of several has for itself: the values that differ from the case's, and SECTION
    with this joint alone; its name and those of the bodies above and below it.
    """

    name: str
    upper: str
    lower: str
    values: dict[str, Value]
    section: dict[str, list[float]] = field(compare=False, repr=False)
    #: as in Case
    hardening_requested: bool = False

    @property
    def joint_values(self) -> dict[str, Value]:
        """The values of parameters that each joint may have for itself."""
        known = declared()
        return {n: value for n, value in self.values.items() if known[n].of_joints}


@dataclass(frozen=True, kw_only=True)
class Case(ParameterValues):
    """A scene and its loading: all that a run depends on. With several joints, its values are those
    of the first one; each of `joints` is a case of a single joint.
    """

    name: str
    title: str
    values: dict[str, Value]
    #: reservoir and tailwater [m] at t = 1, 2, ...
    levels: tuple[float, ...]
    tail_levels: tuple[float, ...]
    #: t of the converged steps; joint tables are written at those in `requested`
    times: tuple[float, ...]
    #: further uplift modes of a published case
    also_uplift: tuple[str, ...] = ()
    #: whether it is a published case of the package, but for mesh, solver and uplift
    published: bool = False
    #: whether pena_tang has been set: then a dam stands though its whole joint slips
    hardening_requested: bool = False
    #: the required relative error; None: the mesh is not refined
    accuracy: float | None = None
    #: whether every update of the internal variables is written
    all_steps: bool = False
    #: the user's own geometry instead of the section by parameters
    geometry: Path | None = None
    #: file of the ground's acceleration, for `damjoint quake`
    record: Path | None = None
    #: file of its vertical component, if that is another one
    record_vertical: Path | None = None
    #: what it is made from; None for a case of stored results, which can not be varied
    source: Source | None = field(default=None, compare=False, repr=False)
    #: SHARED of pro/parameters.pro
    shared: dict[str, list[float]] = field(default_factory=dict, compare=False, repr=False)
    #: SECTION of pro/section.pro
    section: dict[str, list[float]] = field(default_factory=dict, compare=False, repr=False)
    #: heights of the joints above the first one [m]
    lift_heights: tuple[float, ...] = ()
    #: corners of the downstream face between base and crest, upwards: x, y, x, y, ... [m]
    downstream_face: tuple[float, ...] = ()
    #: an entry for each joint, from the lowest; empty if there is only one
    of_joints: tuple[OfJoint, ...] = ()

    def __repr__(self) -> str:
        levels = ", ".join(f"{level:g}" for level in self.levels)
        lists = "".join(
            f", {name} {', '.join(f'{value:g}' for value in values)} m"
            for name in GEOMETRY_LISTS
            if (values := getattr(self, name))
        )
        parts = [f"{self.name}: levels {levels} m{lists}", listed(self.not_default)]
        parts += [f"{joint.name}: {listed(joint.joint_values)}" for joint in self.of_joints]
        return "; ".join(part for part in parts if part and not part.endswith(": "))

    @property
    def not_default(self) -> dict[str, Value]:
        """Parameters that differ from their default; of automatic ones those that are set."""
        of_source: set[str] = set()
        if self.source is not None:
            of_source = {*self.source.text.defaults, *self.source.overrides}
        return {
            name: self.values[name]
            for name, known in declared().items()
            if self.values[name] != constants()[name][0]
            and (name in of_source or not known.automatic)
        }

    @cached_property
    def joints(self) -> tuple[Case, ...]:
        """The case of each joint, from the lowest: its own values, and the section above it."""
        if not self.of_joints:
            return (self,)
        return tuple(
            replace(
                self,
                values=self.values | joint.values,
                section=joint.section,
                hardening_requested=joint.hardening_requested,
                lift_heights=(),
                of_joints=(),
            )
            for joint in self.of_joints
        )

    @property
    def given(self) -> dict[str, Setting]:
        """The parameters that a user has set, in a case file or beside it; not the package's."""
        if self.source is None:
            return {}
        text, known = self.source.text, declared()
        of_blocks = {n: tuple(text.of_block(n)) for n in text.in_blocks}
        of_file = {**text.defaults, **of_blocks, **text.of_joints}
        of_user = {n: v for n, v in of_file.items() if n in text.of_user}
        return {n: v for n, v in {**of_user, **self.source.overrides}.items() if n in known}

    @property
    def ineffective(self) -> tuple[str, ...]:
        """Those of `given` that differ from their default, though they matter at no joint."""
        known = declared()
        of_joints = [joint.values for scene in self.scenes() for joint in scene.joints]
        of_record = {
            "added_mass": True,
            "quake_uplift": any(v["uplift"] != "none" for v in of_joints),
        }
        return tuple(
            name
            for name, value in self.given.items()
            if not any(known[name].matters_in(values) for values in of_joints)
            and not (self.record and of_record.get(name))
            and value != constants()[name][0]
        )

    @property
    def unusual(self) -> dict[str, float]:
        """Those of `given` with a value that is neither 0 nor within USUAL, by name."""
        pairs = [(n, joint[n]) for n in self.given if n in USUAL for joint in self.joints]
        return {n: v for n, v in pairs if v and not USUAL[n][0] <= v <= USUAL[n][1]}

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, for messages."""
        return tuple(joint.name for joint in self.of_joints) or (joint_name(self["joint_height"]),)

    def of_all_joints(self, name: str) -> str:
        """The values of a parameter at all joints, each once, as text."""
        return ", ".join(dict.fromkeys(str(joint[name]) for joint in self.joints))

    @cached_property
    def graph(self) -> JointGraph:
        """The bodies and the joints between them."""
        pairs = tuple((joint.lower, joint.upper) for joint in self.of_joints)
        return JointGraph(pairs or ((ROCK, "dam"),))

    @property
    def stores_water(self) -> bool:
        """Whether water flows in time in a joint, and is stored there."""
        return any(map(flows_in_time, self.joints))

    def separates(self, numbers: Collection[int]) -> bool:
        """Whether without the joints of these numbers a body has no connection to the rock."""
        return bool(self.graph.separated(numbers))

    def named(self, numbers: Sequence[int]) -> str:
        """The names of joints by their numbers; empty if there is only one joint."""
        return " and ".join(self.joint_names[k] for k in numbers) if self.of_joints else ""

    def with_values(self, values: Values) -> Case:
        """The case with other values, the same for all joints; without the checks of `changed`."""
        others = tuple(
            replace(joint, values={n: v for n, v in joint.values.items() if n not in values})
            for joint in self.of_joints
        )
        return replace(self, values={**self.values, **values}, of_joints=others)

    def single_value(self, name: str, given: str) -> Value:
        """The value of a parameter, the same for all joints, or of one joint, "lift 25 m.mu";
        given: how it was given, for the message.

        Raises InputError if there is no such joint, or the parameter is of the whole dam, or, of
        all joints, differs between them.
        """
        joint, _, of_joint = name.rpartition(".")
        names = self.joint_names
        if joint and joint not in names:
            raise InputError(f"{given}: must be of a joint: {', '.join(names)}")
        values = dict(zip(names, (one[of_joint] for one in self.joints), strict=True))
        if joint:
            return of_one_joint(name, values[joint])[2]
        if len(set(values.values())) > 1:
            raise InputError(
                f"{given}: differs between the joints; must be of one: {names[0]}.{of_joint}"
            )
        return self[of_joint]

    def with_value(self, name: str, value: Value) -> Case:
        """The case with another value of a parameter, or of that of one joint, "lift 25 m.mu";
        without the checks of `changed`.
        """
        joint, _, of_joint = name.rpartition(".")
        if not joint or not self.of_joints:
            return self.with_values({of_joint: value})
        old, names = {of_joint: self.values[of_joint]}, self.joint_names
        others = tuple(
            replace(one, values=old | one.values | ({of_joint: value} if one.name == joint else {}))
            for one in self.of_joints
        )
        first = {of_joint: value} if joint == names[0] else {}
        return replace(self, values=self.values | first, of_joints=others)

    def with_joints(self, joints: Sequence[OfJoint]) -> Case:
        """The case of a user's own geometry, with the names and ends of its joints.

        Raises InputError if the case has drains or a waterstop beyond the end of a joint.
        """
        same = [replace(joint, hardening_requested=self.hardening_requested) for joint in joints]
        ends = [self.section | joint.section for joint in joints]
        values = [(joint.values, joint.hardening_requested) for joint in self.of_joints or same]
        of_joints = (
            replace(joint, values=set_values, section=section, hardening_requested=hardens)
            for (set_values, hardens), joint, section in zip(values, joints, ends, strict=True)
        )
        several = tuple(of_joints) if len(joints) > 1 else ()
        case = replace(self, section=ends[0], of_joints=several)
        for joint_case, joint in zip(case.joints, joints, strict=True):
            length = joint_case.section["joint_along"][0]
            check_distances(joint_case, length)
            on_rock = joint.lower == "foundation" != joint.upper
            check_stiffness(
                joint_case, length, carries=on_rock, holds=len(joints) == 1 and self.has_water
            )
        return case

    @cached_property
    def law(self) -> Law[Any]:
        """The joint's law with its parameters."""
        solver = {name: self.shared[name][0] for name in SOLVER}
        return LAWS[self["law"]](self.values | solver)

    @property
    def joint_length(self) -> float:
        """Distance from heel to toe [m]."""
        return self.section["joint_length"][0]

    @property
    def size(self) -> float:
        """Characteristic length of the dam [m]."""
        return self.joint_length if self.geometry else self["dam_height"]

    @property
    def joint_along(self) -> float:
        """Length from heel to toe along the joint [m]; its mean in 3D."""
        return self.section["joint_along"][0]

    @property
    def has_straight_joint(self) -> bool:
        """Whether the joint is straight from heel to toe."""
        return self.joint_along <= (1 + ROUND_OFF) * self.joint_length

    @property
    def requested(self) -> tuple[float, ...]:
        """The times of the levels and of the end of a prescribed displacement; the last time."""
        ends = {self["drive_end"]} if self["drive"] != "level" else set()
        return tuple(t for t in self.times if t == round(t) or t in ends or t == self.times[-1])

    @property
    def highest_level(self) -> float:
        """The highest allowed water level [m]."""
        return math.inf if self.geometry else highest_level(self)

    @property
    def reached(self) -> float:
        """The highest level of the reservoir [m]; the highest allowed if it is not prescribed."""
        return self.highest_level if level_unknown(self) else max(self.levels)

    @property
    def has_water(self) -> bool:
        """Whether water stands on either side of the dam at some time."""
        return level_unknown(self) or max(*self.levels, *self.tail_levels) > 0

    def level_at(self, time: float) -> float:
        """Reservoir level [m] at a time, linear between the levels, from 0 at t = 0."""
        return between(self.levels, time)

    def tail_at(self, time: float) -> float:
        """Tailwater level [m] at a time."""
        return between(self.tail_levels, time)

    def before_last_level(self) -> Case | None:
        """The case without its last level; None if it has no other, or prescribes displacements."""
        before = len(self.levels) - 1
        if not before or self["drive"] != "level":
            return None
        return replace(
            self,
            levels=self.levels[:-1],
            tail_levels=self.tail_levels[:-1],
            times=tuple(t for t in self.times if t <= before),
        )

    def changed(self, values: Values) -> Case:
        """The case with other values of independent parameters, without Gmsh's parser.

        Raises InputError, and KeyError if other parameters depend on one of them.
        """
        checked = {name: declared()[name].check(value) for name, value in values.items()}
        if not checked.keys() <= independent():
            raise KeyError(*checked.keys() - independent())
        source = self.source and self.source.with_overrides(checked)
        result = replace(self.with_values(checked), source=source, published=False)
        check_joints(result)
        return result

    def scenes(self) -> list[Case]:
        """The case itself, then with its further uplift modes."""
        return [self, *(self.with_uplift(mode) for mode in self.also_uplift)]

    def with_uplift(self, mode: str) -> Case:
        """The case with another uplift, and no further uplift modes."""
        source = self.source and self.source.with_overrides({"uplift": mode})
        return replace(self.with_values({"uplift": mode}), source=source, also_uplift=())


def between(levels: tuple[float, ...], time: float) -> float:
    """Level at a time: linear between 0 at t = 0 and the levels at t = 1, 2, ..., then constant."""
    points, time = (0.0, *levels), min(time, len(levels))
    i = min(int(time), len(points) - 2)
    return points[i] + (time - i) * (points[i + 1] - points[i])


def check_joints(case: Case) -> None:
    """Check the values of a case, joint by joint, and the heights of its lifts.

    Raises InputError.
    """
    if case.lift_heights:
        check_lift_heights(case.lift_heights, case["dam_height"])
    if case.downstream_face:
        check_downstream_face(case, case.downstream_face)
    for joint, name in zip(case.joints, case.joint_names, strict=True):
        try:
            check_values(joint, joint.section, joint.geometry is None)
            if joint.geometry is None:
                check_stiffness(joint, joint.joint_along, holds=joint.has_water)
            check_acting(joint, joint.times[-1])
        except InputError as error:  # of a value for all joints the first one
            where = "" if joint is case.joints[0] else f"{name}: "
            raise InputError(f"{where}{error}") from None
    sections = [joint.section for joint in case.joints]
    if case.downstream_face:
        check_joints_on_face(case, case.downstream_face, sections)
    if case.lift_heights:
        check_lifts(case, case.lift_heights, sections)
