"""A case from its source: values that follow from others, the loading, and the checks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from .. import InputError
from ..arrays import Settings
from . import casefile, hydrograph
from .case import SECTION, SHARED, Case, check_joints
from .case_names import CASES, case_file
from .constraints import (
    check_also_uplift,
    check_drive,
    check_levels,
    check_softening,
    check_steps,
    check_tail_levels,
    check_times,
)
from .geometry_file import geometry_file
from .joints import names_of_section, parsed_by_joint, settings_of_joints, stacked_joints
from .parameters import GEOMETRY_LISTS, checked, declared, levels_of, listing
from .refinement import first_mesh, relative_error
from .source import Source

#: Settings for a law at one point: no weight, water or mesh limits its stiffness.
NO_DAM = {"rho_dam": 0.0, "rho_water": 0.0, "n_joint": 1.0}


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
    lift_heights, downstream_face [m], and of one joint "lift 25 m.mu"; levels, tail_levels: [m] at
    t = 1, 2, 3, also as a text 'a,b,c'; steps: equal steps between two levels; accuracy: coarse,
    standard, fine or a percentage, chooses order, first mesh (overrides win) and one step per
    level; record: file of the ground's acceleration. Raises InputError.
    """
    path = case_file(case)
    text = casefile.read(path)
    if record:
        text.texts["record"] = str(record)
    source = Source(path, text, {}, levels, tail_levels, steps, accuracy)
    return resolve(source.with_overrides(overrides or {}))


def resolve(source: Source) -> Case:
    """The case of a source, see `load`. Raises InputError."""
    path, file, accuracy = source.path, source.text, source.accuracy
    overrides, steps = source.overrides, source.steps
    error = None if accuracy is None else relative_error(accuracy)
    if accuracy is not None:
        plain = resolve(Source(path, file, overrides))
        overrides = {**first_mesh(plain), **overrides}
        steps = steps or (1 if plain["drive"] == "level" else None)
    if steps is not None:
        check_steps(steps)
    lists, tails, of_flood = loading_lists(source, steps)
    overrides = {name: checked(name, value) for name, value in overrides.items()}
    for name in GEOMETRY_LISTS:
        if name in overrides:
            given = overrides.pop(name)
            lists[name] = levels_of(name, given) if given else ()
    lifts, face = (lists.pop(name, ()) for name in GEOMETRY_LISTS)
    geometry = geometry_file(file.texts["geometry"]) if "geometry" in file.texts else None
    settings = {**of_flood, **file.defaults, **file.of_joints, **overrides}
    names = () if geometry else names_of_section(settings, lifts)
    values = settings_of_joints(settings, source.blocks(names), lifts, geometry)
    if geometry:
        check_geometry(geometry, face, accuracy)
    lists |= {"downstream_face": face} if face else {}
    listed = "".join(listing(n, v) for n, v in lists.items())
    variables, *of_joints = parsed_by_joint(values, listed, lifts)
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
        published=not file.of_user and as_published(source, overrides),
        hardening_requested=bool(variables["hardening_requested"][0]),
        accuracy=error,
        geometry=geometry,
        source=source,
        shared={n: variables[n] for n in SHARED},
        section={n: variables[n] for n in SECTION},
        lift_heights=lifts,
        downstream_face=face,
        of_joints=stacked_joints(variables, of_joints),
    )
    if "record" in file.texts:
        result = with_record(result, file.texts["record"])
    for joint, parsed in zip(result.joints, of_joints or [variables], strict=True):
        check_softening(joint, bool(parsed["softening_twice"][0]))
    check_joints(result)
    check_loading(result, tails, of_case=source.tail_levels is None)
    return with_drive_times(result)


def loading_lists(
    source: Source, steps: int | None
) -> tuple[dict[str, tuple[float, ...]], tuple[float, ...], dict[str, Any]]:
    """The lists of a case file, with the levels of the source or of a hydrograph; the tailwater
    levels; the hydrograph's settings; steps: between two levels, in place of the file's times.

    Raises InputError.
    """
    lists = {name: tuple(values) for name, values in source.text.lists.items()}
    if source.levels is not None:
        lists["levels"] = levels_of("levels", source.levels)
    if source.levels is not None or steps is not None:
        lists.pop("times", None)
    given = source.tail_levels is not None or "tail_levels" in lists
    tails = lists.pop("tail_levels", (0.0,))
    if source.tail_levels is not None:
        tails = levels_of("tail_levels", source.tail_levels)
    if "hydrograph" not in source.text.texts:
        return lists, tails, {}
    if "levels" in lists:
        raise InputError("levels: must not be set with a hydrograph, which has them")
    flood = hydrograph.read(Path(source.text.texts["hydrograph"]))
    if flood.tail_levels and given:
        raise InputError("tail_levels: must not be set with a hydrograph that has them")
    return lists | {"levels": flood.levels}, flood.tail_levels or tails, flood.settings


def check_geometry(geometry: Path, face: Sequence[float], accuracy: str | None) -> None:
    """Raise InputError if a user's own geometry has a downstream face or can not be refined."""
    if face:
        raise InputError(
            "downstream_face: must not be set for a geometry of one's own, whose mesh has the faces"
        )
    if accuracy is not None and geometry.suffix != ".geo":
        raise InputError(
            f"accuracy = {accuracy}: must not be set with a mesh as geometry "
            f"({geometry.name}), which can not be refined"
        )


def with_record(case: Case, text: str | Path) -> Case:
    """The case with a record: a path, or those of two components joined by +."""
    files = casefile.record_files(str(text))
    return replace(case, record=files[0], record_vertical=files[1] if len(files) > 1 else None)


def varied(
    case: Case,
    overrides: Settings | None = None,
    levels: str | Sequence[float] | None = None,
    tail_levels: str | Sequence[float] | None = None,
    steps: int | None = None,
    accuracy: str | None = None,
) -> Case:
    """The case with other values of any parameters, "base.mu" also where the case has a list, and
    with another loading or accuracy where they are not None; arguments as in `load`. The parameters
    that follow others follow them; name, record and `all_steps` stay.

    Raises InputError.
    """
    if case.source is None:
        raise InputError(f"case {case.name}: of stored results; must be a case that was loaded")
    given = {"levels": levels, "tail_levels": tail_levels, "steps": steps, "accuracy": accuracy}
    changes: dict[str, Any] = {n: value for n, value in given.items() if value is not None}
    settings: dict[str, Any] = dict(overrides or {})
    before = case.source.text.of_joints | case.source.overrides
    for name in [name for name in settings if "." in name]:
        joint, _, of_joint = name.rpartition(".")
        listed: Any = settings.get(of_joint, before.get(of_joint))
        if isinstance(listed, (list, tuple)) and of_joint not in (overrides or {}):
            value, entries = settings.pop(name), zip(case.joint_names, listed, strict=True)
            settings[of_joint] = tuple(value if n == joint else v for n, v in entries)
    result = resolve(replace(case.source.with_overrides(settings), **changes))
    attributes = ("name", "record", "record_vertical", "all_steps")
    return replace(result, **{name: getattr(case, name) for name in attributes})


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
        check_drive(case, number)


def with_drive_times(case: Case) -> Case:
    """The case with steps at begin and end of a prescribed displacement."""
    if case["drive"] == "level":
        return case
    ends = {case["drive_begin"], case["drive_end"]} - {0.0}
    return replace(case, times=tuple(sorted({*case.times, *ends})))


def equal_steps(levels: int, steps: int) -> tuple[float, ...]:
    """Times of equal steps between levels."""
    return tuple(i + (k + 1) / steps for i in range(levels) for k in range(steps))


def as_published(source: Source, overrides: Settings) -> bool:
    """Whether a case of the package is unchanged but for mesh, solver and uplift."""
    harmless = {n for n, p in declared().items() if p.group in ("Mesh", "Solver")}
    packaged = source.path.resolve().parent == CASES.resolve()
    other_levels = source.levels is not None or source.tail_levels is not None
    return packaged and set(overrides) <= harmless | {"order", "uplift"} and not other_levels
