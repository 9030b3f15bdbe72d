"""Case: a scene and its loading, from a case file and overrides, checked."""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from .. import RUN_GEO, InputError, data
from ..arrays import Setting, Settings, Value, Values
from ..laws import LAWS, Law
from . import casefile
from .arithmetic import number
from .constraints import (
    USUAL,
    check_acting,
    check_also_uplift,
    check_distances,
    check_drive,
    check_levels,
    check_lift_heights,
    check_lifts,
    check_softening,
    check_steps,
    check_stiffness,
    check_tail_levels,
    check_times,
    check_values,
    highest_level,
)
from .parameters import (
    INCLUDE,
    assignments,
    checked,
    constants,
    declared,
    independent,
    levels_of,
    listing,
    parse,
)
from .scene import stacked
from .values import ParameterValues
from .values import flows as flows
from .values import freezes_uplift as freezes_uplift
from .values import has_drains as has_drains

CASES = data("cases")

#: Constants of pro/parameters.pro that both engines use.
SHARED = (
    *("strategy_growth", "strategy_secant", "strategy_release", "strategy_iterations", "cut"),
    *("round_off", "coarsest", "artificial", "yield_tolerance", "release_length"),
    *("crack_aperture", "crack_most", "zangar_angle", "zangar_cm"),
)

#: Those of them that the laws use.
SOLVER = "artificial", "yield_tolerance", "release_length"

#: Variables of pro/section.pro: the joint's ends, the segments of the faces, the marks of line
#: forces.
SECTION = (
    *("heel_x", "heel_y", "toe_x", "toe_y", "joint_length", "joint_along", "crest_x", "neck_y"),
    *("seg_side", "seg_body", "seg_x0", "seg_y0", "seg_x1", "seg_y1"),
    *("mark_region", "mark_x", "mark_y", "mark_segment"),
)


@dataclass(frozen=True)
class Source:
    """What a case is made from: the statements of a case file, and what differs from them; all but
    the first two as in `load`.
    """

    path: Path
    text: casefile.CaseText
    overrides: dict[str, Setting]
    levels: str | Sequence[float] | None = None
    tail_levels: str | Sequence[float] | None = None
    steps: int | None = None
    accuracy: str | None = None

    def check_lists(self, joints: Sequence[str]) -> None:
        """Raise InputError if a list has not one value for each joint of a geometry, by their
        names.
        """
        overrides = {name: checked(name, value) for name, value in self.overrides.items()}
        for name, values in lists_of_joints({**self.text.of_joints, **overrides}).items():
            if len(values) != len(joints):
                raise InputError(
                    f"{name} = {','.join(map(str, values))}: must be one value, or one for each "
                    f"joint of the geometry ({len(joints)}: {', '.join(joints)})"
                )

    def with_overrides(self, overrides: Settings) -> Source:
        """The source with further overrides, which win."""
        return replace(self, overrides={**self.overrides, **overrides})


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
    hardening_asked: bool = False


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
    hardening_asked: bool = False
    #: the required relative error; None: the mesh is not refined
    accuracy: float | None = None
    #: whether every update of the internal variables is written
    all_steps: bool = False
    #: the user's own geometry instead of the section by parameters
    geometry: Path | None = None
    #: file of the ground's acceleration, for `damjoint quake`
    record: Path | None = None
    #: what it is made from; None for a case of stored results, which can not be varied
    source: Source | None = field(default=None, compare=False, repr=False)
    #: SHARED of pro/parameters.pro
    shared: dict[str, list[float]] = field(default_factory=dict, compare=False, repr=False)
    #: SECTION of pro/section.pro
    section: dict[str, list[float]] = field(default_factory=dict, compare=False, repr=False)
    #: heights of the joints above the first one [m]
    lift_heights: tuple[float, ...] = ()
    #: an entry for each joint, from the lowest; empty if there is only one
    of_joints: tuple[OfJoint, ...] = ()

    @cached_property
    def joints(self) -> tuple[Case, ...]:
        """The case of each joint, from the lowest: its own values, and the section above it."""
        if not self.of_joints:
            return (self,)
        return tuple(
            replace(
                self,
                values=self.values | own.values,
                section=own.section,
                hardening_asked=own.hardening_asked,
                lift_heights=(),
                of_joints=(),
            )
            for own in self.of_joints
        )

    @property
    def given(self) -> dict[str, Setting]:
        """The parameters that a user has set: in a case file of their own, or beside it; not what a
        case or preset of the package sets.
        """
        if self.source is None:
            return {}
        text, known = self.source.text, declared()
        of_file = {**text.defaults, **text.of_joints}
        of_user = {n: v for n, v in of_file.items() if n in text.of_user}
        return {n: v for n, v in {**of_user, **self.source.overrides}.items() if n in known}

    @property
    def ineffective(self) -> tuple[str, ...]:
        """Those of `given` that differ from their default, though they matter at no joint."""
        known = declared()
        of_joints = [joint.values for scene in self.scenes() for joint in scene.joints]
        return tuple(
            name
            for name, value in self.given.items()
            if not any(known[name].matters_in(values) for values in of_joints)
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
        return tuple(own.name for own in self.of_joints) or (joint_name(self["joint_height"]),)

    def of_all_joints(self, name: str) -> str:
        """The values of a parameter at all joints, each once, as text."""
        return ", ".join(dict.fromkeys(str(joint[name]) for joint in self.joints))

    def above(self, numbers: Collection[int]) -> set[str]:
        """The bodies that without the joints of these numbers have no connection to the rock."""
        if not self.of_joints:
            return {"dam"} if numbers else set()
        pairs = [(own.lower, own.upper) for own in self.of_joints]
        rest = [pair for k, pair in enumerate(pairs) if k not in numbers]
        reached, before = {"foundation"}, set[str]()
        while reached != before:
            before = set(reached)
            reached |= {name for pair in rest if reached & set(pair) for name in pair}
        return {name for pair in pairs for name in pair} - reached

    def separates(self, numbers: Collection[int]) -> bool:
        """Whether without the joints of these numbers a body has no connection to the rock."""
        return bool(self.above(numbers))

    def separating(self, numbers: Sequence[int]) -> tuple[int, ...]:
        """The first of some joints, by their numbers, that alone holds what is above it; or those
        on the rock, if all of these are among them; else none.
        """
        alone = [(k,) for k in numbers if self.separates((k,))]
        on_rock = tuple(
            k for k, own in enumerate(self.of_joints) if own.lower == "foundation" != own.upper
        )
        together = [on_rock] if set(on_rock) <= set(numbers) else []
        return next(iter([*alone, *together]), ())

    def named(self, numbers: Sequence[int]) -> str:
        """The names of joints by their numbers; empty if there is only one joint."""
        return " and ".join(self.joint_names[k] for k in numbers) if self.of_joints else ""

    def with_values(self, values: Values) -> Case:
        """The case with other values, the same for all joints; without the checks of `changed`."""
        others = tuple(
            replace(own, values={n: v for n, v in own.values.items() if n not in values})
            for own in self.of_joints
        )
        return replace(self, values={**self.values, **values}, of_joints=others)

    def with_joints(self, joints: Sequence[OfJoint]) -> Case:
        """The case of a user's own geometry, with the names and ends of its joints.

        Raises InputError if the case has drains or a waterstop beyond the end of a joint.
        """
        same = [replace(joint, hardening_asked=self.hardening_asked) for joint in joints]
        known = self.of_joints or same
        ends = [self.section | joint.section for joint in joints]
        of_joints = (
            replace(joint, values=own.values, section=section, hardening_asked=own.hardening_asked)
            for own, joint, section in zip(known, joints, ends, strict=True)
        )
        several = tuple(of_joints) if len(joints) > 1 else ()
        case = replace(self, section=ends[0], of_joints=several)
        for own, joint in zip(case.joints, joints, strict=True):
            length = own.section["joint_along"][0]
            check_distances(own, length)
            on_rock = joint.lower == "foundation" != joint.upper
            check_stiffness(own, length, carries=on_rock, holds=len(joints) == 1)
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
        return max(self.levels) if self["drive"] == "level" else self.highest_level

    def level_at(self, time: float) -> float:
        """Reservoir level [m] at a time, linear between the levels, from 0 at t = 0."""
        return between(self.levels, time)

    def tail_at(self, time: float) -> float:
        """Tailwater level [m] at a time."""
        return between(self.tail_levels, time)

    def before_last_level(self) -> Case | None:
        """The case without its last level; None if it has only one level or a prescribed
        displacement.
        """
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

    def varied(
        self,
        overrides: Settings | None = None,
        levels: str | Sequence[float] | None = None,
        tail_levels: str | Sequence[float] | None = None,
        steps: int | None = None,
        accuracy: str | None = None,
    ) -> Case:
        """The case with other values of any parameters, and with another loading or accuracy where
        they are not None; arguments as in `load`. The parameters that follow others follow them.

        Raises InputError.
        """
        if self.source is None:
            raise InputError(f"case {self.name}: of stored results; must be a case that was loaded")
        given = {"levels": levels, "tail_levels": tail_levels, "steps": steps, "accuracy": accuracy}
        changes: dict[str, Any] = {n: value for n, value in given.items() if value is not None}
        return resolve(replace(self.source.with_overrides(overrides or {}), **changes))

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


def joint_name(height: float) -> str:
    """The name of a joint whose heel is at a height [m]."""
    return f"lift {height:g} m" if height else "base"


def is_name(text: str) -> bool:
    """Whether a text can be the name of a case, of its files and of its folder: one part of a path,
    printable, neither . nor ..
    """
    single = Path(text).name == text and text.strip(".")
    return bool(single) and text.isprintable() and len(text.encode()) <= LONGEST_NAME


#: Limit of a case's name [bytes]; that of a file's name is 255.
LONGEST_NAME = 200


def case_file(case: str) -> Path:
    """The file of a case, by letter, name or path.

    Raises InputError if there is none, or its name can not be that of a folder.
    """
    for path in (CASES / f"{case.lower()}.case", Path(case)):
        if path.suffix == ".case" and os.path.isfile(path):  # does not raise, whatever the name
            if not is_name(path.stem):
                raise InputError(
                    f"case {case!r}: must be called by printable letters, at most {LONGEST_NAME} "
                    "bytes, and not . or .."
                )
            return path
    if Path(case).suffix == ".case":
        raise InputError(f"case {case}: there is no such file; damjoint new {case} writes one")
    names = ", ".join(path.stem for path in sorted(CASES.glob("*.case")))
    raise InputError(f"case {case}: unknown; allowed: {names}, or the path of a .case file")


#: Relative errors by name.
ACCURACIES = {"coarse": 0.03, "standard": 0.01, "fine": 0.002}


def relative_error(accuracy: str) -> float:
    """The relative error of an accuracy: coarse, standard, fine or a percentage.

    Raises InputError.
    """
    if accuracy in ACCURACIES:
        return ACCURACIES[accuracy]
    try:
        error = number(accuracy.removesuffix("%")) / 100 if accuracy.endswith("%") else math.nan
    except ValueError:
        error = math.nan
    if not 0 < error < 1:
        raise InputError(
            f"accuracy = {accuracy}: must be one of {', '.join(ACCURACIES)}, or a percentage "
            "> 0 and < 100, such as 0.5%"
        )
    return error


def has_plane_fields(case: Case) -> bool:
    """Whether nothing varies along z."""
    return case["dim"] == 2 or bool(case["hold_z"]) or max(case["nu_dam"], case["nu_found"]) == 0


def first_mesh(case: Case) -> dict[str, float | str]:
    """Mesh and order with which a refinement for an accuracy begins.

    Order 2, triangles, in 3D extruded and cut into tetrahedra: these represent plane fields exactly
    for any thickness.
    """
    solid = case["dim"] == 3
    n = 32 if not solid else 16 if has_plane_fields(case) else 8
    return {
        "order": 2.0,
        "mesh_pattern": "split" if solid else "free",
        "n_layers": 1.0,
        "quadrature": "full",
        "face_points": 0.0,
        "n_joint": float(n),
        "h_dam": -1.0,
        "h_found": -1.0,
    }


def load(
    case: str,
    overrides: Settings | None = None,
    levels: str | Sequence[float] | None = None,
    tail_levels: str | Sequence[float] | None = None,
    steps: int | None = None,
    accuracy: str | None = None,
    record: Path | None = None,
) -> Case:
    """Read a case file, apply overrides, resolve the parameters that follow others, check all.

    case: letter, name or path; overrides: {name: value, or a value for each joint}, also
    lift_heights [m]; levels, tail_levels: [m] at t = 1, 2, 3, also as a text 'a,b,c'; steps: equal
    steps between two levels; accuracy: coarse, standard, fine or a percentage, chooses order, first
    mesh (overrides win) and one step per level; record: file of the ground's acceleration. Raises
    InputError.
    """
    path = case_file(case)
    text = casefile.read(path)
    if record:
        text.texts["record"] = str(record)
    return resolve(Source(path, text, dict(overrides or {}), levels, tail_levels, steps, accuracy))


def resolve(source: Source) -> Case:
    """The case of a source, see `load`.

    Raises InputError.
    """
    path, file, overrides = source.path, source.text, source.overrides
    levels, tail_levels = source.levels, source.tail_levels
    steps, accuracy, error = source.steps, source.accuracy, None
    if accuracy is not None:
        error, plain = relative_error(accuracy), resolve(Source(path, file, overrides))
        overrides = {**first_mesh(plain), **overrides}
        steps = steps or (1 if plain["drive"] == "level" else None)
    if steps is not None:
        check_steps(steps)
    lists = {name: tuple(values) for name, values in file.lists.items()}
    if levels is not None:
        lists["levels"] = levels_of("levels", levels)
    if levels is not None or steps is not None:
        lists.pop("times", None)
    tails = lists.pop("tail_levels", (0.0,))
    if tail_levels is not None:
        tails = levels_of("tail_levels", tail_levels)
    overrides = {name: checked(name, value) for name, value in overrides.items()}
    lifts = lists.pop("lift_heights", ())
    if "lift_heights" in overrides:
        given = overrides.pop("lift_heights")
        lifts = levels_of("lift_heights", given) if given else ()
    geometry = own_geometry(file.texts["geometry"]) if "geometry" in file.texts else None
    values = settings_of_joints({**file.defaults, **file.of_joints, **overrides}, lifts, geometry)
    listed = "".join(listing(n, v) for n, v in lists.items())
    variables, *of_joints = parsed_by_joint(values, listed, lifts)
    if accuracy is not None and geometry and geometry.suffix != ".geo":
        raise InputError(
            f"accuracy = {accuracy}: must not be set with a mesh as geometry "
            f"({geometry.name}), which can not be refined"
        )
    heights = tuple(variables["levels"])
    also = () if "uplift" in overrides else tuple(file.texts.get("also_uplift", "").split())
    result = Case(
        name=path.stem,
        title=file.texts.get("title", path.stem),
        values={name: variables[name][0] for name in declared()},
        levels=heights,
        tail_levels=tails[:1] * len(heights) if len(set(tails)) == 1 else tails,
        times=tuple(variables["times"]) if steps is None else equal_steps(len(heights), steps),
        also_uplift=also,
        published=as_published(path, overrides, levels, tail_levels),
        hardening_asked=bool(variables["hardening_asked"][0]),
        accuracy=error,
        geometry=geometry,
        record=Path(file.texts["record"]) if "record" in file.texts else None,
        source=source,
        shared={n: variables[n] for n in SHARED},
        section={n: variables[n] for n in SECTION},
        lift_heights=lifts,
        of_joints=stacked_joints(variables, of_joints),
    )
    for joint, parsed in zip(result.joints, of_joints or [variables], strict=True):
        check_softening(joint.joint, bool(parsed["softening_twice"][0]))
    check_joints(result)
    check_loading(result, tails, of_case=tail_levels is None)
    return with_drive_times(result)


def lists_of_joints(settings: Settings) -> dict[str, tuple[Value, ...]]:
    """The settings that are lists, with a value for each joint."""
    return {n: v for n, v in settings.items() if isinstance(v, tuple)}


def settings_of_joints(
    settings: Settings, lifts: tuple[float, ...], geometry: Path | None
) -> list[dict[str, Value]]:
    """The settings of each joint, from the lowest.

    lifts: heights of the joints above the first [m]. Raises InputError if a list has another length
    than there are joints; of a geometry of one's own the mesh has them: until it is read, see
    `Source.check_lists`, there are as many as the longest list has values.
    """
    lists = lists_of_joints(settings)
    single = {n: v for n, v in settings.items() if not isinstance(v, tuple)}
    if geometry and lifts:
        raise InputError(
            "lift_heights: must not be set for a geometry of one's own, whose mesh has the joints"
        )
    number = max([1, *map(len, lists.values())]) if geometry else 1 + len(lifts)
    for name, values in lists.items():
        if len(values) != number and not geometry:
            raise InputError(
                f"{name} = {','.join(map(str, values))}: must be one value, or as many as there "
                f"are joints ({number})"
            )
        lists[name] = values + values[-1:] * (number - len(values))
    heights = {} if geometry else {"joint_height": lifts}
    return [
        {
            **single,
            **{n: v[k] for n, v in lists.items()},
            **({n: v[k - 1] for n, v in heights.items()} if k else {}),
        }
        for k in range(number)
    ]


def parsed_by_joint(
    values: list[dict[str, Value]], listed: str, lifts: tuple[float, ...]
) -> list[dict[str, list[Any]]]:
    """Variables of Gmsh's parser for a case, and, if it has several joints, for each of them alone.

    values: settings of each joint; listed: the lists of the case, as text.
    """
    several = ""
    if lifts:
        slopes = (number(str(v.get("joint_slope", default_of("joint_slope")))) for v in values[1:])
        several = listing("lift_heights", lifts) + listing("lift_slopes", slopes)
    whole = parse(assignments(values[0]) + listed + several + INCLUDE)
    if len(values) == 1:
        return [whole]
    elements = whole["all_elements"] if lifts else [whole["n_joint"][0]] * len(values)
    sizes = {n: whole[n][0] for n in ("h_dam", "h_found")}
    base = f"base_toe_y = {whole['base_toe_y'][0]!r};\n"
    return [
        whole,
        *(
            parse(assignments({**own, **sizes, "n_joint": n}) + listed + base + INCLUDE)
            for own, n in zip(values, elements, strict=True)
        ),
    ]


def stacked_joints(
    variables: dict[str, list[Any]], of_joints: list[dict[str, list[Any]]]
) -> tuple[OfJoint, ...]:
    """The joints of a section, from the variables of `parsed_by_joint`."""
    names = [joint_name(parsed["joint_height"][0]) for parsed in of_joints]
    return tuple(
        OfJoint(
            name=joint.name,
            upper=joint.upper,
            lower=joint.lower,
            values={n: parsed[n][0] for n in declared() if parsed[n] != variables[n]},
            section={n: parsed[n] for n in SECTION},
            hardening_asked=bool(parsed["hardening_asked"][0]),
        )
        for joint, parsed in zip(stacked(names), of_joints, strict=True)
    )


def default_of(name: str) -> float:
    """The default of a parameter that is a number."""
    return float(declared()[name].default)


def check_joints(case: Case) -> None:
    """Check the values of a case, joint by joint, and the heights of its lifts.

    Raises InputError.
    """
    if case.lift_heights:
        check_lift_heights(case.lift_heights, case["dam_height"])
    for joint, name in zip(case.joints, case.joint_names, strict=True):
        try:
            check_values(joint, joint.section, joint.geometry is None)
            check_acting(joint, joint.times[-1])
        except InputError as error:  # of a value for all joints the first one
            where = "" if joint is case.joints[0] else f"{name}: "
            raise InputError(f"{where}{error}") from None
    if case.lift_heights:
        sections = [joint.section for joint in case.joints]
        check_lifts(case, case.lift_heights, sections)


def check_loading(case: Case, tails: Sequence[float], of_case: bool) -> None:
    """Check levels, times and further uplift modes of a case; tails: tailwater levels as listed;
    of_case: whether they are those of the case file.

    Raises InputError.
    """
    number = len(case.levels)
    check_levels("levels", case.levels, case.highest_level)
    check_levels("tail_levels", tails, case.highest_level)
    check_tail_levels(case.tail_levels, number, of_case)
    check_times(case.times, number)
    check_also_uplift(case.also_uplift, case["uplift"])
    if case["drive"] != "level":
        check_drive(case["drive_begin"], case["drive_end"], number)


def with_drive_times(case: Case) -> Case:
    """The case with steps at begin and end of a prescribed displacement."""
    if case["drive"] == "level":
        return case
    ends = {case["drive_begin"], case["drive_end"]} - {0.0}
    return replace(case, times=tuple(sorted({*case.times, *ends})))


def equal_steps(levels: int, steps: int) -> tuple[float, ...]:
    """Times of equal steps between levels."""
    return tuple(i + (k + 1) / steps for i in range(levels) for k in range(steps))


def own_geometry(name: str) -> Path:
    """The file of a user's own geometry.

    Raises InputError if it does not exist, or may be a program that is not allowed to run.
    """
    path = Path(name)
    if not path.is_file():
        raise InputError(f"geometry = {name}: must be a file, a mesh that Gmsh reads or a .geo")
    if not path.stat().st_size:
        raise InputError(f"geometry = {name}: is empty; must be a mesh that Gmsh reads or a .geo")
    own = data("geo").resolve() in path.resolve().parents
    if own or is_mesh(path) or os.environ.get(RUN_GEO) == "1":
        return path
    if path.suffix == ".geo":
        raise InputError(
            f"geometry = {name}: is a program that Gmsh runs; if you trust it, add --run-geo"
        )
    raise InputError(
        f"geometry = {name}: must be a mesh in Gmsh's format, which ends in .msh and begins with "
        f"{MESH.decode()} (gmsh FILE -save -o mesh.msh converts others), or a .geo. Gmsh might "
        "run such a file as a program; if you trust it, add --run-geo"
    )


#: First bytes of a mesh in Gmsh's format.
MESH = b"$MeshFormat"


def is_mesh(path: Path) -> bool:
    """Whether Gmsh reads a file as data: it unpacks and runs a file of unknown format as a .geo,
    whatever its name.
    """
    try:
        with path.open("rb") as file:
            return path.suffix == ".msh" and file.read(len(MESH)) == MESH
    except OSError as error:
        raise InputError(f"geometry = {path}: {error.strerror}") from None


def as_published(path: Path, overrides: Settings, *loading: str | Sequence[float] | None) -> bool:
    """Whether a case of the package is unchanged but for mesh, solver and uplift."""
    harmless = {n for n, p in declared().items() if p.group in ("Mesh", "Solver")}
    own = path.resolve().parent == CASES.resolve()
    return (
        own
        and set(overrides) <= harmless | {"order", "uplift"}
        and all(levels is None for levels in loading)
    )
