"""Parameters and cases: names, defaults, labels and ranges are read from pro/parameters.pro by Gmsh's parser."""

from __future__ import annotations

import difflib
import json
import math
import re
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import gmsh

from . import ROOT, InputError

DECLARATIONS = ROOT / "pro" / "parameters.pro"
CASES = ROOT / "cases"


def start_gmsh() -> None:
    """Start Gmsh once per process, quietly and without reading the user's settings."""
    if not gmsh.isInitialized():
        gmsh.initialize(readConfigFiles=False, interruptible=False)
        gmsh.option.setNumber("General.Verbosity", 0)  # what goes wrong is raised, and told in one line


@dataclass(frozen=True)
class Parameter:
    """One declared parameter: ONELAB label with its unit, range or choices."""

    name: str
    label: str
    text: bool = False
    minimum: float = -math.inf
    maximum: float = math.inf
    choices: tuple = ()
    integer: bool = False

    @property
    def meaning(self) -> str:
        """The label without its place in the ONELAB tree: description and unit."""
        return self.label.split("/")[-1].lstrip("0123456789")

    def allowed(self) -> str:
        """What is allowed, in words."""
        if self.choices:
            return "one of " + ", ".join(c if self.text else f"{c:g}" for c in self.choices)
        limits = []
        if self.minimum > -math.inf:
            limits.append("> 0" if self.minimum == 1e-30 else f">= {self.minimum:g}")
        if self.maximum < math.inf:
            limits.append("< 0.5" if self.maximum == 0.5 - 1e-9 else f"<= {self.maximum:g}")
        return ("an integer " if self.integer else "a number ") + " and ".join(limits)

    def check(self, value: float | str) -> float | str:
        """The value as a number or a choice.

        Raises InputError if it is not a number, out of range or not one of the choices.
        """
        bad = InputError(f"{self.name} = {value}: must be {self.allowed().strip()} ({self.meaning})")
        if self.text:
            if value not in self.choices:
                raise bad
            return value
        try:
            number = float(value)
        except ValueError:
            raise bad from None
        if not (math.isfinite(number) and self.minimum <= number <= self.maximum):
            raise bad
        if (self.choices and number not in self.choices) or (self.integer and number != round(number)):
            raise bad
        return number


def flush_parser() -> None:
    """After an error Gmsh's parser goes on with what was left of the text: let it, and forget what it finds."""
    with tempfile.NamedTemporaryFile("w", suffix=".geo") as file:
        file.write("nothing = 0;\n")
        file.flush()
        for _ in range(20):
            try:
                gmsh.parser.parse(file.name)
                gmsh.parser.clear()
                gmsh.parser.parse(file.name)
                if list(gmsh.parser.getNames()) == ["nothing"]:
                    break
            except Exception:  # what gmsh raises
                continue
    gmsh.parser.clear()


def parse(text: str) -> dict[str, list[float] | list[str]]:
    """What Gmsh's parser knows after reading a text: {name: values}.

    Raises InputError with Gmsh's own message if the text does not parse.
    """
    start_gmsh()
    gmsh.parser.clear()
    gmsh.onelab.clear()
    with tempfile.NamedTemporaryFile("w", suffix=".geo") as file:
        file.write(text)
        file.flush()
        try:
            gmsh.parser.parse(file.name)
        except Exception as error:  # what gmsh raises
            flush_parser()
            raise InputError(str(error).replace(file.name, "input")) from None
    found = {}
    for name in gmsh.parser.getNames():
        numbers = gmsh.parser.getNumber(name)
        found[name] = [float(v) for v in numbers] if len(numbers) else list(gmsh.parser.getString(name))
    return found


@lru_cache(maxsize=1)
def declared() -> dict[str, Parameter]:
    """All declared parameters by name."""
    parse(f'Include "{DECLARATIONS}";')
    labels = re.findall(r'(\w+) = \{(?:Str\[)?default_\1\b.*?Name\s+"([^"]+)"', DECLARATIONS.read_text(), re.S)
    parameters = {}
    for name, label in labels:
        entry = json.loads(gmsh.onelab.get(label))
        low, high = entry.get("min", -1e200), entry.get("max", 1e200)
        parameters[name] = Parameter(
            name, label, text=entry["type"] == "string",
            minimum=low if low > -1e200 else -math.inf, maximum=high if high < 1e200 else math.inf,
            choices=tuple(entry.get("choices", ())), integer=entry.get("step") == 1)
    return parameters


def parameter(name: str) -> Parameter:
    """The declared parameter of this name. Raises InputError, with the nearest names, if there is none."""
    known = declared()
    if name not in known:
        near = difflib.get_close_matches(name, known, 3) or sorted(known)
        raise InputError(f"{name}: unknown parameter; allowed: {', '.join(near)}")
    return known[name]


def settings(pairs: Iterable[str]) -> dict[str, float | str]:
    """{name: checked value} from texts 'name=value'. Raises InputError."""
    values = {}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not equals:
            raise InputError(f"--set {pair}: must be NAME=VALUE")
        values[name.strip()] = parameter(name.strip()).check(value.strip())
    return values


def resolve(case_text: str, overrides: Mapping[str, float | str]) -> dict[str, list]:
    """All values after the case and the overrides, dependent defaults included."""
    lines = [case_text]
    for name, value in overrides.items():
        lines.append(f'default_{name} = "{value}";' if isinstance(value, str) else f"default_{name} = {value!r};")
    return parse("\n".join([*lines, f'Include "{DECLARATIONS}";\n']))


@dataclass(frozen=True)
class Case:
    """A scene and its loading, fully resolved: everything a run depends on."""

    name: str
    title: str
    values: dict[str, float | str]
    #: reservoir and tailwater [m] at t = 1, 2, ...
    levels: tuple[float, ...]
    tail_levels: tuple[float, ...]
    #: converged steps asked for; those in `requested` have a joint table
    times: tuple[float, ...]
    #: further uplift modes that the published case runs
    also_uplift: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> float | str:
        return self.values[name]

    @property
    def requested(self) -> tuple[float, ...]:
        """The times at which a level of the list, or the end of a prescribed displacement, is reached."""
        ends = {self["drive_end"]} if self["drive"] != "level" else set()
        return tuple(t for t in self.times if t == round(t) or t in ends) or self.times[-1:]

    def level_at(self, time: float) -> float:
        """Reservoir level [m] at a time, linear between the levels, from 0 at t = 0."""
        points = (0.0, *self.levels)
        i = min(int(time), len(points) - 2)
        return points[i] + (time - i) * (points[i + 1] - points[i])

    def before_last_level(self) -> Case | None:
        """The case without its last level; None if there is only one, or the level is not what is prescribed."""
        before = len(self.levels) - 1
        if not before or self["drive"] != "level":
            return None
        return replace(self, levels=self.levels[:-1], tail_levels=self.tail_levels[:-1], times=tuple(t for t in self.times if t <= before))

    def scenes(self) -> list[Case]:
        """The case itself, then the other uplift modes it is published with."""
        return [self, *(replace(self, values={**self.values, "uplift": mode}, also_uplift=()) for mode in self.also_uplift)]


def case_file(case: str) -> Path:
    """The file of a case given by letter, name or path. Raises InputError if there is none."""
    for path in (CASES / f"{case.lower()}.case", Path(case)):
        if path.suffix == ".case" and path.is_file():
            return path
    names = ", ".join(path.stem for path in sorted(CASES.glob("*.case")))
    raise InputError(f"case {case}: unknown; allowed: {names}, or the path of a .case file")


#: For an accuracy: elements along the joint, and layers in 3D where something varies along z; see `damjoint bench`.
ACCURACIES = {"coarse": (40, 1), "standard": (100, 2), "fine": (200, 4)}


def far_sizes(height: float, n: float) -> dict[str, float]:
    """Element sizes far from a joint of n elements, under a dam of a height [m], that do not spoil its accuracy."""
    return {"h_dam": 1.25 * height / n**0.5, "h_found": 2.5 * height / n**0.5}


def mesh_for(accuracy: str, case: Case) -> dict[str, float | str]:
    """Mesh and order for an accuracy of about 3 % (coarse), 1 % (standard) or 0.2 % (fine); measured by bench.

    Order 2, triangles, in 3D extruded and cut into tetrahedra: these contain the plane fields exactly, however thick
    they are. Raises InputError.
    """
    if accuracy not in ACCURACIES:
        raise InputError(f"accuracy = {accuracy}: must be one of {', '.join(ACCURACIES)}")
    (n, layers), solid = ACCURACIES[accuracy], case["dim"] == 3
    plane = case["hold_z"] or max(case["nu_dam"], case["nu_found"]) == 0
    return {"order": 2.0, "mesh_pattern": "split" if solid else "free", "n_layers": 1.0 if plane else float(layers),
            "n_joint": float(n), **far_sizes(case["dam_height"], n)}


def load(case: str, overrides: Mapping[str, float | str] | None = None, levels: str | None = None,
         tail_levels: str | None = None, steps: int | None = None, accuracy: str | None = None) -> Case:
    """Read a case, apply overrides and check everything.

    case: letter, name or path; overrides: {name: value}; levels, tail_levels: 'a,b,c' in metres, reached at
    t = 1, 2, 3; steps: equal steps between two levels; accuracy: coarse, standard or fine, chooses mesh and
    order (overrides win) and one step per level. Raises InputError.
    """
    overrides = dict(overrides or {})
    path = case_file(case)
    if accuracy is not None:
        plain = load(case, overrides)
        overrides = mesh_for(accuracy, plain) | overrides
        steps = steps or (1 if plain["drive"] == "level" else None)
    text = path.read_text()
    known = declared()
    for name in re.findall(r"^\s*default_(\w+)\s*=", text, re.M):
        parameter(name)
    if levels is not None:  # defaults such as drive_begin follow the levels
        text += f"\nlevels() = {{{', '.join(map(repr, numbers('levels', levels)))}}};"
    found = resolve(text, overrides)
    values = {name: known[name].check(found[name][0]) for name in known}
    heights = check_levels("levels", found["levels"], values)
    default_tails = found["tail_levels"] if levels is None else [0.0]
    tails = check_levels("tail_levels", default_tails if tail_levels is None else numbers("tail_levels", tail_levels), values)
    if len(tails) not in (1, len(heights)):
        raise InputError(f"tail_levels = {','.join(f'{v:g}' for v in tails)}: must be one level or as many as levels ({len(heights)})")
    tails = tails * len(heights) if len(tails) == 1 else tails
    if steps is not None and steps < 1:
        raise InputError(f"steps = {steps}: must be an integer >= 1")
    if levels is None and steps is None:
        times = tuple(found["times"])
    else:
        times = tuple(i + (k + 1) / (steps or 1) for i in range(len(heights)) for k in range(steps or 1))
    if values["drive"] != "level":
        begin, end = values["drive_begin"], values["drive_end"]
        if not 0 <= begin < end <= len(heights):
            raise InputError(f"drive_begin, drive_end = {begin:g}, {end:g}: must be 0 <= drive_begin < drive_end <= {len(heights)} (the last t)")
        times = tuple(sorted({*times, end, *([begin] if begin > 0 else [])}))
    also = tuple(found.get("also_uplift", [""])[0].split()) if "uplift" not in overrides else ()
    title = found.get("title", [path.stem])[0]
    return Case(path.stem, title, values, heights, tails, times, also)


def numbers(name: str, text: str) -> list[float]:
    """Numbers from 'a,b,c'. Raises InputError if empty or malformed."""
    try:
        found = [float(v) for v in text.split(",")]
    except ValueError:
        found = []
    if not found or not all(map(math.isfinite, found)):
        raise InputError(f"{name} = {text}: must be a list of levels in metres, such as 3,6,8,9")
    return found


def check_levels(name: str, levels: Iterable[float], values: Mapping) -> tuple[float, ...]:
    """Water levels [m]. Raises InputError if one is negative or above the crest."""
    for level in levels:
        if not 0 <= level <= values["dam_height"]:
            raise InputError(f"{name} = {level:g}: must be between 0 and the crest ({values['dam_height']:g} m)")
    return tuple(levels)
