"""The settings of each joint of a case, and the variables that follow from them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .. import InputError
from ..arrays import Settings, Value, Values
from .arithmetic import number
from .case import SECTION, OfJoint
from .casefile import block_name, joint_name
from .geometry_file import joints_in
from .parameters import INCLUDE, assignments, declared, listing, parse
from .scene import stacked
from .source import lists_of_joints


def settings_of_joints(
    settings: Settings,
    blocks: Mapping[str, Mapping[str, Value]],
    lifts: tuple[float, ...],
    geometry: Path | None,
) -> list[dict[str, Value]]:
    """The settings of each joint, from the lowest.

    blocks: of single joints, by their keys; lifts: heights of the joints above the first [m].
    Raises InputError if a list has another length than there are joints, or there is no joint of a
    block. Of a geometry of one's own the mesh has the joints: its names are read if there are
    blocks; else, until the mesh is read, see `Source.check_lists`, there are as many as the longest
    list has values.
    """
    lists = lists_of_joints(settings)
    single = {n: v for n, v in settings.items() if not isinstance(v, tuple)}
    if geometry and lifts:
        raise InputError(
            "lift_heights: must not be set for a geometry of one's own, whose mesh has the joints"
        )
    by_mesh = geometry and not blocks
    names = names_of_section(single, lifts)
    if geometry and blocks:
        names = names_of_geometry(single, geometry)
    keys = [block_name(name) for name in names]
    for key in blocks:
        if keys.count(key) != 1:
            raise InputError(
                f"Struct Joint::{key}: there {'are several' if key in keys else 'is no'} such joint"
                "; must be one of " + ", ".join(f"Joint::{k}" for k in keys)
            )
    count = max([1, *map(len, lists.values())]) if by_mesh else len(names)
    for name, values in lists.items():
        if len(values) != count and not by_mesh:
            raise InputError(
                f"{name} = {','.join(map(str, values))}: must be one value, or "
                + (
                    f"one for each joint of the geometry ({count}: {', '.join(names)})"
                    if geometry
                    else f"as many as there are joints ({count})"
                )
            )
        lists[name] = values + values[-1:] * (count - len(values))
    heights = {} if geometry else {"joint_height": lifts}
    return [
        {
            **single,
            **({} if by_mesh else blocks.get(keys[k], {})),
            **{n: v[k] for n, v in lists.items()},
            **({n: v[k - 1] for n, v in heights.items()} if k else {}),
        }
        for k in range(count)
    ]


def names_of_section(settings: Settings, lifts: tuple[float, ...]) -> tuple[str, ...]:
    """The names of the joints of a section, from the lowest."""
    lowest = number(str(settings.get("joint_height", default_of("joint_height"))))
    return tuple(map(joint_name, (lowest, *lifts)))


def names_of_geometry(settings: Values, geometry: Path) -> tuple[str, ...]:
    """The names of the joints of a geometry of one's own, in its order, by the settings for all."""
    variables = parse(assignments(settings) + INCLUDE)
    return joints_in(geometry, {n: variables[n][0] for n in declared()})


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
            parse(assignments({**settings, **sizes, "n_joint": n}) + listed + base + INCLUDE)
            for settings, n in zip(values, elements, strict=True)
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
            hardening_requested=bool(parsed["hardening_requested"][0]),
        )
        for joint, parsed in zip(stacked(names), of_joints, strict=True)
    )


def default_of(name: str) -> float:
    """The default of a parameter that is a number."""
    return float(declared()[name].default)
