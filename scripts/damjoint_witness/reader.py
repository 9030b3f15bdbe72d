"""What a command asks for: the words of the command line and the case file, read by itself.

The parameters of each joint are a plain dictionary, the section is a polygon. Defaults, and the
values that follow from others, are those of pro/parameters.pro, which is read as text.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any

#: Numbers and words by the name of the parameter.
Values = dict[str, Any]

#: Folders that have the declarations and the case files: of a checkout, of an installed package.
ROOTS = Path(__file__).parents[2], Path(__file__).parents[1] / "damjoint"
#: The value that stands for "computed from others".
AUTOMATIC = -1.0
#: Least number of elements on a lift joint, unless the first joint has fewer.
LEAST_ELEMENTS = 10


def data(name: str) -> Path:
    """Return the path of a file of the checkout or the package."""
    return next(root / name for root in ROOTS if (root / name).exists())


# -- declarations
# --------------------------------------------------------------------------------------------------


def without_comments(text: str) -> str:
    """Return the text without // comments."""
    return re.sub(r"//.*", "", text)


def value_of(text: str) -> float | str:
    """Read a number, a quotient of numbers, a word in quotes or a bare word."""
    text = text.strip()
    if text == "automatic":
        return AUTOMATIC
    parts = text.split("/")
    try:
        return math.prod([float(parts[0]), *(1 / float(part) for part in parts[1:])])
    except ValueError:
        return text.strip('"')


@cache
def defaults() -> Values:
    """Return the defaults of all parameters, by the first block of pro/parameters.pro."""
    text = without_comments(data("pro/parameters.pro").read_text())
    block = re.search(r"DefineConstant\[(.*?)\];", text, re.DOTALL)
    assert block
    found = re.findall(r'default_(\w+)\s*=\s*("[^"]*"|[^,]+)', block[1])
    return {name: value_of(value) for name, value in found}


@cache
def rules() -> tuple[tuple[str, str], ...]:
    """Return the automatic values in the order of pro/parameters.pro, then those of a joint: names
    and expressions.
    """
    files = "pro/parameters.pro", "pro/automatic_of_joint.pro"
    text = "".join(without_comments(data(file).read_text()) for file in files)
    pattern = r"(\w+) = \(\1 == automatic\) \? ([^:;]+) : \1;"
    return tuple((m[1], m[2]) for m in re.finditer(pattern, text))


def evaluated(expression: str, values: Values, levels: Sequence[float]) -> float:
    """Evaluate the expression of a rule."""
    plain = expression.replace("#levels()", str(len(levels)))
    plain = re.sub(r"Sqrt\[([^]]*)\]", r"(\1) ** 0.5", plain)
    if not re.fullmatch(r"[\w\s.+*/()-]*", plain):
        raise ValueError(f"{expression}: an expression of another form")
    return float(eval(plain, {"__builtins__": {}}, dict(values)))


def resolve(given: Values, levels: Sequence[float]) -> Values:
    """Return the parameters of a joint: those given, defaults, and what follows from others."""
    values = defaults() | given
    set_values = {name for name in given if given[name] != AUTOMATIC}
    for name, expression in rules():
        if values[name] == AUTOMATIC:
            values[name] = evaluated(expression, values, levels)
    if values["ice_level"] == AUTOMATIC:
        values["ice_level"] = min(max(0.0, *levels), values["dam_height"])
    # area under the softening and the elastic branch of the law rupture: s^2 (1 + P) / (2 K_N)
    by_length = "pena_rupture" in set_values and values["law"] == "rupture"
    elastic = values["sigma_max"] ** 2 / (2 * values["K_N"])
    if values["G_f"] == AUTOMATIC:
        values["G_f"] = elastic * (1 + values["pena_rupture"]) if by_length and elastic else 100.0
    if values["pena_rupture"] == AUTOMATIC:
        brittle = values["law"] == "rupture" and elastic
        values["pena_rupture"] = values["G_f"] / elastic - 1 if brittle else 1.0
    return values


# -- case files
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class CaseFile:
    """The statements of a case file: values, lists, and the values of single joints by name."""

    path: Path
    values: Values
    lists: dict[str, tuple[Any, ...]]
    blocks: dict[str, Values]

    def joint_names(self, dim: float) -> list[str]:
        """Return the names of the joints of a geometry by a mesh, from its .geo file."""
        text = without_comments((self.path.parent / self.values["geometry"]).read_text())
        return re.findall(rf'Physical {"Curve" if dim == 2 else "Surface"}\("joint ([^"]+)"', text)


def case_file(name: str) -> CaseFile:
    """Read a case of the package, or a file, of statements `name = value;`, `name() = {a, b};` and
    `Struct Joint::name [ parameter value, ... ];`. Without default_ a value is the same.
    """
    path = Path(name) if name.endswith(".case") else data(f"cases/{name}.case")
    text = without_comments(path.read_text())
    if "Include" in text:
        raise ValueError(f"{path}: a case that includes another one")
    values, lists, blocks = {}, {}, {}
    block = r"Struct Joint::(\w+)\s*\[([^]]*)\];"
    for joint, content in re.findall(block, text):
        pairs = (part.split(maxsplit=1) for part in content.split(","))
        blocks[joint] = {key: value_of(value) for key, value in pairs}
    for left, brackets, right in re.findall(
        r"(\w+)(\(\))?\s*=\s*([^;]*);", re.sub(block, "", text)
    ):
        if brackets:
            lists[left] = tuple(map(value_of, right.strip(" {}\n").split(",")))
        else:
            values[left.removeprefix("default_")] = value_of(right)
    return CaseFile(path, values, lists, blocks)


# -- section
# --------------------------------------------------------------------------------------------------

Point = tuple[float, float]


@dataclass(frozen=True)
class Section:
    """Section of a dam (x downstream, y up, from the heel of its base) above a joint [m]."""

    heel: Point
    toe: Point
    #: corners of the upstream face from the heel up, and of the downstream face from the toe up
    upstream: tuple[Point, ...]
    downstream: tuple[Point, ...]

    @property
    def length(self) -> float:
        """Distance from heel to toe [m]."""
        return math.dist(self.heel, self.toe)

    @property
    def slope(self) -> float:
        """Angle of the joint, rising towards the toe > 0 [rad]."""
        return math.atan2(self.toe[1] - self.heel[1], self.toe[0] - self.heel[0])

    @property
    def crest(self) -> tuple[Point, Point]:
        """Ends of the crest, from downstream to upstream."""
        return self.downstream[-1], self.upstream[-1]

    @property
    def outline(self) -> tuple[Point, ...]:
        """Corners of the concrete above the joint, counterclockwise from the toe."""
        return *self.downstream, *reversed(self.upstream)


def polyline_from(start: Point, corners: Sequence[Point]) -> tuple[Point, ...]:
    """Return the part of a face above one of its points: that point, and the corners above it."""
    return start, *(corner for corner in corners if corner[1] > start[1])


def joint_on(whole: Section, heel_y: float, slope: float) -> Section:
    """Return the section above the lift joint at a height of its heel [m], with a slope [degrees],
    of the section above the base.
    """
    heel_x = whole.upstream[-1][0]
    for (x0, y0), (x1, y1) in zip(whole.upstream, whole.upstream[1:], strict=False):
        if y0 <= heel_y <= y1:
            heel_x = x0 + (x1 - x0) * (heel_y - y0) / (y1 - y0)
            break
    rise = math.tan(math.radians(slope))
    above = [y - heel_y - rise * (x - heel_x) for x, y in whole.downstream]
    k = next(k for k in range(1, len(above)) if above[k] >= 0)
    (x0, y0), (x1, y1) = whole.downstream[k - 1 : k + 1]
    part = above[k - 1] / (above[k - 1] - above[k])
    heel, toe = (heel_x, heel_y), (x0 + part * (x1 - x0), y0 + part * (y1 - y0))
    return Section(
        heel, toe, polyline_from(heel, whole.upstream), polyline_from(toe, whole.downstream)
    )


def section_above_base(first: Values) -> Section:
    """Return the section above the base, also of a dam whose first joint is a lift, from the
    parameters of the first joint.
    """
    height, base, batter = (first[name] for name in ("dam_height", "dam_base", "batter"))
    on_base = first["joint_height"] == 0
    toe_y = base * math.tan(math.radians(first["joint_slope"])) if on_base else 0.0
    crest_x, neck_y = batter + first["dam_crest"], height - first["neck_height"]
    face = first["downstream_face"]
    bend = [(batter, first["batter_height"])] if batter and first["batter_height"] < height else []
    neck = [(crest_x + first["neck_batter"], neck_y)] if first["neck_height"] else []
    return Section(
        (0.0, 0.0),
        (base, toe_y),
        ((0.0, 0.0), *bend, (batter, height)),
        ((base, toe_y), *neck, *zip(face[::2], face[1::2], strict=True), (crest_x, height)),
    )


def sections(joints: Sequence[Values]) -> tuple[Section, ...]:
    """Return the section above each joint, the lowest first, from their parameters."""
    whole = section_above_base(joints[0])
    return tuple(
        whole
        if not joint["joint_height"]
        else joint_on(whole, joint["joint_height"], joint["joint_slope"])
        for joint in joints
    )


# -- command
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Request:
    """What a command asks for: parameters of each joint, the lowest first, and the loading."""

    command: str
    case: str
    joints: tuple[Values, ...]
    #: reservoir and tailwater [m] at t = 1, 2, ...
    levels: tuple[float, ...]
    tail_levels: tuple[float, ...]
    #: t at the ends of the load steps
    times: tuple[float, ...]
    #: a geometry by a mesh: without sections
    geometry: str
    #: the ground's acceleration, of an earthquake
    record: Path | None
    #: other options, by name
    options: dict[str, str]

    @cached_property
    def sections(self) -> tuple[Section, ...]:
        """The section above each joint; empty for a geometry by a mesh."""
        return () if self.geometry else sections(self.joints)

    @property
    def requested(self) -> tuple[float, ...]:
        """Times at which tables are written: of the levels, the end of a controlled displacement,
        the last one.
        """
        first, last = self.joints[0], self.times[-1]
        ends = {first["drive_end"]} if first["drive"] != "level" else set()
        return tuple(t for t in self.times if t == round(t) or t in ends or t == last)

    def level_at(self, time: float) -> float:
        """Return the prescribed reservoir level [m] at a time."""
        return between(self.levels, time)

    def tail_at(self, time: float) -> float:
        """Return the tailwater level [m] at a time."""
        return between(self.tail_levels, time)


@dataclass(frozen=True)
class RequestedJoint:
    """A joint of a request, by its number from 0."""

    request: Request
    number: int

    @property
    def values(self) -> Values:
        """Its parameters."""
        return self.request.joints[self.number]

    @property
    def section(self) -> Section:
        """The section above it."""
        return self.request.sections[self.number]


def between(levels: Sequence[float], time: float) -> float:
    """Return the level at a time: linear from 0 at t = 0 over the levels at t = 1, 2, ..."""
    points, time = (0.0, *levels), min(max(time, 0.0), len(levels))
    k = min(int(time), len(points) - 2)
    return points[k] + (time - k) * (points[k + 1] - points[k])


def read(words: Sequence[str]) -> Request:
    """Read the words of a command after `damjoint`: `run dam --set name=value ...`.

    Raises ValueError for a word that is not understood.
    """
    command, case, *rest = words
    file = case_file(case)
    given, lists = dict(file.values), dict(file.lists)
    blocks = {joint: dict(values) for joint, values in file.blocks.items()}
    options: dict[str, str] = {}
    words_left = iter(rest)
    for word in words_left:
        if not word.startswith("--"):
            raise ValueError(f"{word}: neither an option nor its value")
        if word in ("--run-geo", "--no-fields", "--no-picture"):
            continue
        value = next(words_left)
        if word != "--set":
            options[word.removeprefix("--")] = value
            continue
        name, _, text = value.partition("=")
        for known in (lists, given, *blocks.values()):
            known.pop(name, None)
        parts = tuple(map(value_of, text.split(",")))
        if len(parts) > 1 or name in ("lift_heights", "downstream_face"):
            lists[name] = parts
        else:
            given[name] = parts[0]
    return request(command, replace(file, blocks=blocks), given, lists, options)


def request(
    command: str,
    file: CaseFile,
    given: Values,
    lists: dict[str, tuple[Any, ...]],
    options: dict[str, str],
) -> Request:
    """Return what values, lists and options ask for together."""
    own_times = lists.pop("times", ())
    if {"levels", "steps"} & options.keys():
        own_times = ()
    for option in ("levels", "tail-levels"):
        if option in options:
            lists[option.replace("-", "_")] = tuple(map(float, options.pop(option).split(",")))
    geometry, _ = str(given.pop("geometry", "")), given.pop("title", "")
    height = (defaults() | given)["dam_height"]
    levels = lists.pop("levels", tuple(part * height for part in (2 / 3, 8 / 9, 1)))
    tails = lists.pop("tail_levels", (0.0,))
    tails = tails * len(levels) if len(tails) == 1 else tails
    steps = int(options.pop("steps", 1))
    record = options.pop("record", None)
    lifts, face = (lists.pop(name, ()) for name in ("lift_heights", "downstream_face"))
    names = [f"lift {heel:g} m" for heel in (given.get("joint_height", 0), *lifts)]
    names[0] = names[0] if given.get("joint_height") else "base"
    if geometry:
        names = file.joint_names((defaults() | given)["dim"])
    blocks = [file.blocks.get(re.sub(r"\W", "_", name), {}) for name in names]
    count = len(names)
    unknown = {*given, *lists, *(key for block in blocks for key in block)} - defaults().keys()
    if unknown or any(len(values) != count for values in lists.values()):
        raise ValueError(f"{unknown or lists}: unknown, or not a value for each of {count} joints")
    joints = [
        given
        | blocks[k]
        | {name: values[k] for name, values in lists.items()}
        | ({"joint_height": lifts[k - 1]} if lifts and k else {})
        for k in range(count)
    ]
    resolved = [resolve(joint, levels) for joint in joints]
    for joint, given_values in zip(resolved, joints, strict=True):
        joint["downstream_face"] = face
        joint["hardening_requested"] = float(given_values.get("pena_tang", AUTOMATIC) != AUTOMATIC)
        if lifts:  # the sizes of the mesh are those of the first joint
            joint |= {name: resolved[0][name] for name in ("h_dam", "h_found")}
    if lifts:
        for joint, section in zip(resolved[1:], sections(resolved)[1:], strict=True):
            number = math.ceil(first_share(resolved, section.length))
            least = max(number, LEAST_ELEMENTS)
            joint["n_joint"] = float(min(least, resolved[0]["n_joint"]))
    times = {k + (i + 1) / steps for k in range(len(levels)) for i in range(steps)}
    times = set(own_times) or times
    if resolved[0]["drive"] != "level":
        times |= {resolved[0]["drive_begin"], resolved[0]["drive_end"]} - {0.0}
    return Request(
        *(command, file.path.stem, tuple(resolved), levels, tails, tuple(sorted(times)), geometry),
        Path(record) if record else None,
        options,
    )


def first_share(joints: Sequence[Values], length: float) -> float:
    """Return the elements on a joint of a length [m] that are as long as those of the first one."""
    return float(joints[0]["n_joint"] * length / sections(joints[:1])[0].length)


def differences(request: Request, record: dict[str, Any]) -> Iterator[str]:
    """Compare what a command asks for with what its run.json has, in words."""
    for name, expected in (("levels", request.levels), ("tail_levels", request.tail_levels)):
        if tuple(record[name]) != expected:
            yield f"run.json: {name} {record[name]}, by the command {expected}"
    if not same_numbers(record["times"], request.times):
        yield f"run.json: times {record['times']}, by the command {request.times}"
    written = [joint["values"] for joint in record["joints"]] or [{}]
    if len(written) != len(request.joints):
        yield f"run.json: {len(written)} joints, by the command {len(request.joints)}"
        return
    for k, (joint, values) in enumerate(zip(request.joints, written, strict=True)):
        claimed = record["parameters"] | values
        for name, value in claimed.items():
            if not same(value, joint[name]):
                yield f"run.json: {name} = {value} at joint {k + 1}, by the command {joint[name]}"


def same(a: Any, b: Any) -> bool:
    """Return whether two values are the same, up to the rounding of a formula."""
    if isinstance(a, str) or isinstance(b, str):
        return bool(a == b)
    return math.isclose(a, b, rel_tol=1e-12)


def same_numbers(a: Sequence[float], b: Sequence[float]) -> bool:
    """Return whether two lists have the same numbers, up to the rounding of a formula."""
    return len(a) == len(b) and all(map(same, a, b))
