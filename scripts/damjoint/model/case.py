"""Cases: a scene and its loading, read from a case file, with overrides, checked."""

from __future__ import annotations

import math
import operator
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from .. import RUN_GEO, InputError, data
from ..laws import LAWS, Law
from . import casefile
from .parameters import (
    INCLUDE,
    assignments,
    constants,
    declared,
    independent,
    listing,
    number,
    parse,
)

CASES = data("cases")

#: Steps between two levels at most.
MOST_STEPS = 100_000

#: Levels that are asked for at most: each has its table.
MOST_LEVELS = 10_000


#: Values of pro/parameters.pro that the engines share and nobody sets.
SHARED = (
    "attempt_growth",
    "attempt_secant",
    "attempt_release",
    "attempt_iterations",
    "cut",
    "round_off",
    "coarsest",
    "artificial",
    "sudden",
    "crack_aperture",
    "crack_most",
)

#: What pro/section.pro finds of the section: the joint's ends, the faces' segments, the marks where
#: line forces act.
SECTION = (
    *("heel_x", "heel_y", "toe_x", "toe_y", "joint_length", "joint_along", "crest_x", "neck_y"),
    *("seg_side", "seg_body", "seg_x0", "seg_y0", "seg_x1", "seg_y1"),
    *("mark_region", "mark_x", "mark_y", "mark_segment"),
)


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
    #: whether it is a case of the package as it was published, but for mesh and solver
    published: bool = False
    #: whether pena_tang has been set: a dam whose whole joint slips is meant to stand on it
    hardening_asked: bool = False
    #: the relative error asked for; None: the mesh is as it is
    accuracy: float | None = None
    #: the user's own geometry instead of the section by parameters
    geometry: Path | None = None
    #: what the solvers share besides the parameters: {name: values}, from pro/parameters.pro
    shared: dict[str, list[float]] = field(default_factory=dict, compare=False, repr=False)
    #: the section, by the names of pro/section.pro
    section: dict[str, list[float]] = field(default_factory=dict, compare=False, repr=False)

    def __getitem__(self, name: str) -> float | str:
        return self.values[name]

    @cached_property
    def law(self) -> Law[Any]:
        """The joint's law with its parameters."""
        solver = {name: self.shared[name][0] for name in ("artificial", "sudden")}
        return LAWS[self.values["law"]](self.values | solver)

    @property
    def joint_length(self) -> float:
        """From heel to toe, straight [m]."""
        return self.section["joint_length"][0]

    @property
    def size(self) -> float:
        """A length of the dam [m]: what is small beside it is small."""
        return self.joint_length if self.geometry else self["dam_height"]

    @property
    def joint_along(self) -> float:
        """From heel to toe along the joint [m]; a mean in 3D."""
        return self.section["joint_along"][0]

    @property
    def requested(self) -> tuple[float, ...]:
        """The times at which a level of the list or the end of a prescribed displacement is
        reached; the last.
        """
        ends = {self["drive_end"]} if self["drive"] != "level" else set()
        return tuple(t for t in self.times if t == round(t) or t in ends or t == self.times[-1])

    @property
    def highest_level(self) -> float:
        """The highest water level that is allowed [m]."""
        return math.inf if self.geometry else ceiling(self.values)

    @property
    def reached(self) -> float:
        """The highest level of the reservoir [m]; if it is driven, the highest it may have."""
        return max(self.levels) if self["drive"] == "level" else self.highest_level

    def level_at(self, time: float) -> float:
        """Reservoir level [m] at a time, linear between the levels, from 0 at t = 0."""
        return between(self.levels, time)

    def tail_at(self, time: float) -> float:
        """Tailwater level [m] at a time."""
        return between(self.tail_levels, time)

    def before_last_level(self) -> Case | None:
        """The case without its last level; None if there is only one, or the level is not what is
        prescribed.
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

    def changed(self, values: Mapping[str, float | str]) -> Case:
        """The case with other values of independent parameters, as `load` makes it, without
        Gmsh's parser.

        Raises InputError.
        """
        checked = {name: declared()[name].check(value) for name, value in values.items()}
        if not checked.keys() <= independent():
            raise KeyError(*checked.keys() - independent())
        values = self.values | checked
        check_energies({name: [v] for name, v in values.items()} | {"softening_twice": [0.0]})
        check_drains(values, self.joint_length)
        check_works(values)
        return replace(self, values=values, published=False)

    def scenes(self) -> list[Case]:
        """The case itself, then the other uplift modes it is published with."""
        others = (
            replace(self, values={**self.values, "uplift": mode}, also_uplift=())
            for mode in self.also_uplift
        )
        return [self, *others]


def between(levels: tuple[float, ...], time: float) -> float:
    """Level at a time, linear between the levels at t = 1, 2, ..., from 0 at t = 0; later the last
    one.
    """
    points, time = (0.0, *levels), min(time, len(levels))
    i = min(int(time), len(points) - 2)
    return points[i] + (time - i) * (points[i + 1] - points[i])


def is_name(text: str) -> bool:
    """Whether a text can be a case's name, which its files and its folder carry: one part of a path
    that leads nowhere else, with nothing that a terminal would obey.
    """
    single = Path(text).name == text and text.strip(".")
    return bool(single) and text.isprintable() and len(text.encode()) <= LONGEST_NAME


#: Bytes of a case's name, for a file's has 255.
LONGEST_NAME = 200


def case_file(case: str) -> Path:
    """The file of a case given by letter, name or path.

    Raises InputError if there is none, or its name can not be that of a folder.
    """
    for path in (CASES / f"{case.lower()}.case", Path(case)):
        if path.suffix == ".case" and os.path.isfile(path):  # False for any name, however odd
            if not is_name(path.stem):
                raise InputError(
                    f"case {case!r}: must be called by printable letters, at most {LONGEST_NAME} "
                    "bytes, and not . or .."
                )
            return path
    names = ", ".join(path.stem for path in sorted(CASES.glob("*.case")))
    raise InputError(f"case {case}: unknown; allowed: {names}, or the path of a .case file")


#: Relative errors by name.
ACCURACIES = {"coarse": 0.03, "standard": 0.01, "fine": 0.002}


def relative_error(accuracy: str) -> float:
    """The relative error that an accuracy stands for: coarse, standard, fine or a percentage.

    Raises InputError.
    """
    if accuracy in ACCURACIES:
        return ACCURACIES[accuracy]
    try:
        found = number(accuracy.removesuffix("%")) / 100 if accuracy.endswith("%") else math.nan
    except ValueError:
        found = math.nan
    if not 0 < found < 1:
        raise InputError(
            f"accuracy = {accuracy}: must be one of {', '.join(ACCURACIES)}, or a percentage "
            "> 0 and < 100, such as 0.5%"
        )
    return found


def flows(values: Mapping | Case) -> bool:
    """Whether the water in the joint is computed, from the opening."""
    return values["uplift"] in ("cracked", "flow")


def has_drains(values: Mapping | Case) -> bool:
    """Whether drains draw on the water in the joint."""
    return values["uplift"] == "drained" or bool(flows(values) and values["drains"])


def has_plane_fields(case: Case) -> bool:
    """Whether nothing varies along z."""
    return case["dim"] == 2 or bool(case["hold_z"]) or max(case["nu_dam"], case["nu_found"]) == 0


def first_mesh(case: Case) -> dict[str, float | str]:
    """Mesh and order from which an accuracy is looked for.

    Order 2, triangles, in 3D extruded and cut into tetrahedra: these contain the plane fields
    exactly, however thick they are.
    """
    solid = case["dim"] == 3
    n = 32 if not solid else 16 if has_plane_fields(case) else 8
    return {
        "order": 2.0,
        "mesh_pattern": "split" if solid else "free",
        "n_layers": 1.0,
        "quadrature": "full",
        "n_joint": float(n),
        "h_dam": -1.0,
        "h_found": -1.0,
    }


def load(
    case: str,
    overrides: Mapping[str, float | str] | None = None,
    levels: str | None = None,
    tail_levels: str | None = None,
    steps: int | None = None,
    accuracy: str | None = None,
) -> Case:
    """Read a case, apply overrides and check everything.

    case: letter, name or path; overrides: {name: value}; levels, tail_levels: 'a,b,c' in metres,
    reached at t = 1, 2, 3; steps: equal steps between two levels; accuracy: coarse, standard, fine
    or a percentage, chooses order, first mesh (overrides win) and one step per level. Raises
    InputError.
    """
    path, overrides = case_file(case), dict(overrides or {})
    asked = None
    if accuracy is not None:
        asked, plain = relative_error(accuracy), load(case, overrides)
        overrides = first_mesh(plain) | overrides
        steps = steps or (1 if plain["drive"] == "level" else None)
    if steps is not None and not 1 <= steps <= MOST_STEPS:
        raise InputError(f"steps = {steps}: must be an integer >= 1 and <= {MOST_STEPS}")
    said = casefile.read(path)
    lists = dict(said.lists)
    if levels is not None:
        lists["levels"] = numbers("levels", levels)
    if levels is not None or steps is not None:
        lists.pop("times", None)
    own_tail = lists.pop("tail_levels", [0.0])
    known = declared()
    checked = {name: known[name].check(value) for name, value in overrides.items()}
    text = assignments(said.defaults | checked)
    found = parse(text + "".join(listing(n, v) for n, v in lists.items()) + INCLUDE)
    check_energies(found)
    geometry = said.texts.get("geometry")
    geometry = geometry and own_geometry(geometry)
    if not geometry:
        check_section(found)
    elif asked and geometry.suffix != ".geo":
        raise InputError(
            f"accuracy = {accuracy}: must not be asked of a mesh of one's own ({geometry.name}), "
            "which is as fine as it is"
        )
    values = {name: known[name].check(found[name][0]) for name in known}
    highest = math.inf if geometry else ceiling(values)
    heights = check_levels("levels", found["levels"], highest)
    if tail_levels is not None:
        own_tail = numbers("tail_levels", tail_levels)
    tails = check_levels("tail_levels", own_tail, highest)
    if len(set(tails)) == 1:
        tails = tails[:1] * len(heights)
    if len(tails) != len(heights):
        told = ",".join(f"{v:g}" for v in tails)
        whose = " (the case's own; give --tail-levels)" if tail_levels is None else ""
        raise InputError(
            f"tail_levels = {told}{whose}: must be one level or as many as levels ({len(heights)})"
        )
    check_drains(values, found["joint_length"][0])
    check_works(values)
    times = tuple(found["times"])
    if steps is not None:
        times = tuple(i + (k + 1) / steps for i in range(len(heights)) for k in range(steps))
    check_times(times, len(heights))
    if values["drive"] != "level":
        begin, end = values["drive_begin"], values["drive_end"]
        if not 0 <= begin < end <= len(heights):
            raise InputError(
                f"drive_begin, drive_end = {begin:g}, {end:g}: must be "
                f"0 <= drive_begin < drive_end <= {len(heights)} (the last t)"
            )
        times = tuple(sorted({*times, end, *([begin] if begin > 0 else [])}))
    also = said.texts.get("also_uplift", "").split() if "uplift" not in overrides else []
    also = tuple(known["uplift"].check(mode) for mode in also)
    if len({values["uplift"], *also}) <= len(also):
        raise InputError(
            f"also_uplift = {' '.join(also)}: must be other modes than uplift, each once"
        )
    shared = {n: found[n] for n in SHARED}
    return Case(
        path.stem,
        said.texts.get("title", path.stem),
        values,
        heights,
        tails,
        times,
        also,
        as_published(path, checked, levels, tail_levels),
        bool(found["hardening_asked"][0]),
        asked,
        geometry,
        shared,
        {n: found[n] for n in SECTION},
    )


def own_geometry(name: str) -> Path:
    """The file of a user's own geometry.

    Raises InputError if it is not there, or may be a program and nobody has allowed it to run.
    """
    path = Path(name)
    if not path.is_file():
        raise InputError(f"geometry = {name}: must be a file, a mesh that Gmsh reads or a .geo")
    own = data("geo").resolve() in path.resolve().parents
    if not (own or is_mesh(path)) and os.environ.get(RUN_GEO) != "1":
        raise InputError(
            f"geometry = {name}: is a program that Gmsh runs (a mesh ends in .msh and begins with "
            f"{MESH.decode()}); if you trust it, say --run-geo"
        )
    return path


#: What a mesh in Gmsh's format begins with.
MESH = b"$MeshFormat"


def is_mesh(path: Path) -> bool:
    """Whether a file can be nothing but data to Gmsh, which runs what it does not know as a .geo,
    whatever its name, and unpacks it before.
    """
    try:
        with path.open("rb") as file:
            return path.suffix == ".msh" and file.read(len(MESH)) == MESH
    except OSError as error:
        raise InputError(f"geometry = {path}: {error.strerror}") from None


def check_energies(found: Mapping[str, list]) -> None:
    """Raise InputError if a fracture energy is given twice, or too small for the joint's stiffness:
    a point would snap back.
    """
    law, values = found["law"][0], {n: v[0] for n, v in found.items() if v}
    if values["softening_twice"]:
        raise InputError(
            f"G_f, pena_rupture = {values['G_f']:g}, {values['pena_rupture']:g}: must be one of "
            "them, the other -1 (G_f = sigma_max^2 (1 + pena_rupture) / (2 K_N))"
        )
    for name, (least, formula) in LAWS[law].least_energies(values).items():
        if not values[name] > least:
            raise InputError(
                f"{name} = {values[name]:g}: must be > {least:.4g} N/m ({formula}, what the joint "
                "stores before it softens)"
            )


def as_published(path: Path, overrides: Mapping, *loading: str | None) -> bool:
    """Whether a case of the package is run with nothing changed but mesh, solver and uplift."""
    harmless = {n for n, p in declared().items() if p.group in ("Mesh", "Solver")}
    own = path.resolve().parent == CASES.resolve()
    return own and set(overrides) <= harmless | {"order", "uplift"} and not any(loading)


def check_section(found: Mapping[str, list]) -> None:
    """Raise InputError if parameters do not make a section, or a force does not act on it."""
    values = {name: v[0] for name, v in found.items() if v}
    height, base = values["dam_height"], values["dam_base"]
    for name, sign, holds in (
        ("batter_height", "<=", operator.le),
        ("neck_height", "<", operator.lt),
        ("joint_height", "<", operator.lt),
    ):
        if not holds(values[name], height):
            raise InputError(f"{name} = {values[name]:g}: must be {sign} dam_height ({height:g} m)")
    if not values["batter"] < base:
        raise InputError(f"batter = {values['batter']:g}: must be < dam_base ({base:g} m)")
    if not (values["toe_x"] - values["heel_x"] > 0 and values["toe_y"] < height):
        raise InputError(
            f"joint_slope = {values['joint_slope']:g}: must let the joint leave the dam below its "
            f"crest ({height:g} m)"
        )
    marks = [int(number) for number in found["mark_region"]]
    for force, name, region in (
        ("ice_force", "ice_level", "ICE"),
        ("force_x", "force_at", "FORCE"),
        ("force_y", "force_at", "FORCE"),
        ("anchor_force", "anchor_at", "ANCHOR"),
    ):
        if values[force] and int(values[region]) not in marks:
            face = {"ICE": "the upstream face", "FORCE": f"the {values['force_face']} face"}
            raise InputError(
                f"{name} = {values[name]:g}: must lie on {face.get(region, 'the crest')} of the dam"
            )
    plain = not (values["batter"] or values["neck_height"] or values["joint_height"] or marks)
    if values["mesh_pattern"] == "regular" and not plain:
        raise InputError(
            "mesh_pattern = regular: must be free, layers or split for a section with batter, "
            "neck, lift joint or line forces"
        )


def check_drains(values: Mapping, length: float) -> None:
    """Raise InputError if the drains are not under the dam, or do not suit a driven scene; length:
    of the joint [m].
    """
    if not has_drains(values):
        return
    if not values["drain_x"] < length:
        raise InputError(
            f"drain_x = {values['drain_x']:g}: must be < the joint's length ({length:g} m)"
        )
    if not flows(values) and values["drive"] != "level" and values["drain_level"] > 0:
        raise InputError(
            f"drain_level = {values['drain_level']:g}: must be 0 with drive = {values['drive']} "
            "(the pressure has to be linear in the level)"
        )


def check_works(values: Mapping) -> None:
    """Raise InputError if a joint is grouted or sawn whose law or uplift does not include it."""
    included = LAWS[values["law"]].has_works and not flows(values)
    for name in ("grout_pressure", "saw_thickness"):
        if values[name] > 0 and not included:
            laws = " or ".join(name for name, law in LAWS.items() if law.has_works)
            raise InputError(
                f"{name} = {values[name]:g}: must be 0 with law = {values['law']}, uplift = "
                f"{values['uplift']} (only law = {laws} includes it, with uplift = none, imposed "
                "or drained)"
            )


def numbers(name: str, text: str) -> list[float]:
    """Numbers from 'a,b,c'.

    Raises InputError if empty or malformed.
    """
    try:
        found = [number(v) for v in text.split(",")]
    except ValueError:
        found = []
    if not found or not all(map(math.isfinite, found)):
        raise InputError(f"{name} = {text}: must be a list of levels in metres, such as 3,6,8,9")
    return found


def ceiling(values: Mapping) -> float:
    """The highest water level that a dam may have [m]."""
    return constants()["highest_level"][0] * values["dam_height"]


def check_levels(name: str, levels: Iterable[float], highest: float) -> tuple[float, ...]:
    """Water levels [m]; above the crest the dam is overtopped.

    Raises InputError if one is negative or above the highest one, or if they are too many.
    """
    levels = tuple(levels)
    if len(levels) > MOST_LEVELS:
        raise InputError(f"{name}: are {len(levels)}, must be at most {MOST_LEVELS}")
    for level in levels:
        if not 0 <= level <= highest:
            limit = f"between 0 and {highest:g} m, twice the dam's height"
            raise InputError(
                f"{name} = {level:g}: must be {limit if highest < math.inf else '>= 0'}"
            )
    return levels


def check_times(times: tuple[float, ...], last: int) -> None:
    """Raise InputError if the times do not increase from above 0 to the last level's interval."""
    for before, time in zip((0.0, *times), times, strict=False):
        if not before < time <= last:
            raise InputError(
                f"times = {','.join(f'{t:g}' for t in times)}: must increase from above 0 "
                f"to at most {last} (level number i is reached at t = i)"
            )
    if times[-1] <= last - 1:
        raise InputError(
            f"times = {','.join(f'{t:g}' for t in times)}: must end after {last - 1}, on the way "
            f"to the last level (reached at t = {last})"
        )
