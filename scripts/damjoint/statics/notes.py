"""What a user should know of a case before it is computed: settings without effect, unusual values,
loads that act in part or not at all; of a geometry of one's own, what is understood of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..input.case import Case
from ..input.casefile import blocks_of
from ..input.constraints import STAGED, USUAL, WORKS
from ..input.parameters import declared
from ..input.scene import BED, DOWN, FLOOR, TAILWATER, TOP, UP
from ..input.values import has_drains
from ..mesh.generate import GEOMETRY
from ..mesh.mesh import Mesh, mesh_of
from ..mesh.topology import size_below
from ..mesh.user_geometry import LOWEST

#: Parameters of the section and its mesh that a user's .geo file may use and a mesh does not.
OF_SECTION = (
    *(n for n in GEOMETRY if n not in ("dim", "n_joint")),
    *("ice_level", "force_face", "force_at", "anchor_at", "drive_face", "drive_at"),
)
#: Names of the faces, for messages.
FACES = {
    UP: "upstream",
    DOWN: "downstream",
    TOP: "crest surface",
    FLOOR: "reservoir floor",
    BED: "tailwater bed",
}


def remarks(case: Case) -> list[str]:
    """What is understood of a case's own geometry, then the notes on the case.

    Raises InputError if the geometry is unsuitable.
    """
    sizes = understood(case)
    return [*([f"geometry: {sizes}"] if sizes else []), *notes(case)]


def notes(case: Case) -> list[str]:
    """Sentences on the settings and loads of a case, and on its own geometry.

    Raises InputError if that is unsuitable.
    """
    if not case.geometry:
        return notes_on_settings(case)
    mesh = mesh_of(case)
    lists = lists_as_blocks(case, [joint.name for joint in mesh.joints])
    return [*notes_on_settings(case), *lists, *notes_on_geometry(case, mesh)]


def notes_on_settings(case: Case) -> list[str]:
    """Those that need no mesh: on settings without effect, unusual values, and loads."""
    of_section: list[str] = []
    if not case.geometry:
        lists = lists_as_blocks(case, case.joint_names)
        of_section = [*overtopping(case, float(case["dam_height"])), *lists]
    return [*settings_in_vain(case), *unusual_values(case), *loads_in_part(case), *of_section]


def overtopping(case: Case, crest: float) -> Iterator[str]:
    """Yield that the highest level is above the crest [m]."""
    if case["rho_water"] and case["face_load"] == "hydrostatic" and max(case.levels) > crest:
        yield f"the highest level is above the crest, {crest:g} m: the overflow acts as still water"


def lists_as_blocks(case: Case, joints: Sequence[str]) -> Iterator[str]:
    """Yield how the lists of a case file are written as blocks of joints, by their names."""
    lists = case.source.text.of_joints if case.source else {}
    if lists and len(joints) == len(next(iter(lists.values()))):
        listed = ", ".join(f"{name}()" for name in lists)
        blocks = blocks_of(lists, joints).replace("\n", " ").strip()
        yield f"{listed}: the next version does not read lists of joints; write instead: {blocks}"


def settings_in_vain(case: Case) -> Iterator[str]:
    """Yield the parameters that a user has set and that have no effect."""
    known, ineffective = declared(), case.ineffective
    for name in ineffective:
        dry = case.record and name == "quake_uplift"
        yield f"{name} has no effect; it needs {'uplift' if dry else known[name].matters}"
    if case.geometry and case.geometry.suffix != ".geo":
        for name in case.given:
            if name in OF_SECTION and name not in ineffective:
                yield f"{name} has no effect; the geometry is a mesh, {case.geometry.name}"


def unusual_values(case: Case) -> Iterator[str]:
    """Yield the parameters whose values may be in another unit."""
    for name, value in case.unusual.items():
        if name not in case.ineffective:
            usual = "{:g} to {:g}".format(*USUAL[name])
            yield (
                f"{name} = {value:g} {declared()[name].unit} is unusual ({usual}); is it in "
                "another unit?"
            )


def loads_in_part(case: Case) -> Iterator[str]:
    """Yield the loads that do not act in full, or not at all, by time, level or another value."""
    last, highest = case.times[-1], case.reached
    for name, values in (STAGED | WORKS).items():
        for joint in case.joints:
            late = joint[f"{name}_t"] > last
            for load in (n for n in values if late and joint[n]):
                yield (
                    f"{load} = {joint[load]:g} acts in part: in full at {name}_t = "
                    f"{joint[f'{name}_t']:g}, and the loading ends at t = {last:g}"
                )
            if name not in WORKS:
                break  # of all joints
    if case.stores_water and case["time_start"] >= last:
        yield (
            f"time_start = {case['time_start']:g}: no water is stored, the loading ends at "
            f"t = {last:g}"
        )
    own_times = case.source and "times" in case.source.text.of_user
    for time, level in enumerate(case.levels, 1):
        if own_times and time not in case.times:
            yield f"the level {level:g} m at t = {time} is no load step: times() leaves it out"
    if case["ice_force"] and case["ice_level"] > highest and not case.geometry:
        yield f"ice_level = {case['ice_level']:g} m is above the water, {highest:g} m at most"
    for joint, name in zip(case.joints, case.joint_names, strict=True):
        where = f"{name}: " if case.of_joints else ""
        if has_drains(joint) and joint["drain_level"] >= highest > 0:
            yield (
                f"{where}drain_level = {joint['drain_level']:g} m: the drains never act, the water "
                f"reaches {highest:g} m"
            )
    if case["silt_height"] and not case["rho_silt"] * (case["silt_K0"] + case["silt_weight"]):
        yield f"silt_height = {case['silt_height']:g}: no load, by rho_silt, silt_K0, silt_weight"
    for body, changes in (("dam", ("dam", "linear")), ("found", ("found",))):
        for change in changes:
            if case[f"temperature_{change}"] and not case[f"expansion_{body}"]:
                yield f"temperature_{change} has no effect: expansion_{body} = 0"


def understood(case: Case) -> str:
    """Sizes and weight of a geometry of one's own, and what is under water; empty: a section."""
    if not case.geometry:
        return ""
    mesh = mesh_of(case)
    geometry, unit = mesh.user_geometry, "m2" if mesh.dim == 3 else "m"
    low, high = geometry.reach
    weight = case["rho_dam"] * case["g"] * geometry.volume
    joints = (
        f"{f'{joint.name} ' if len(mesh.joints) > 1 else ''}{joint.ends['joint_along'][0]:.5g} m"
        for joint in mesh.joints
    )
    parts = [
        f"dam {high - low:.5g} m high, from y = {low:.9g} to {high:.9g} m",
        f"joint{'s' if len(mesh.joints) > 1 else ''} {', '.join(joints)} from heel to toe",
        f"weight {weight / 1e6:.5g} {'MN' if mesh.dim == 3 else 'MN/m'}",
    ]
    under = []
    for side, name in FACES.items():
        surfaces = [face.surface for face in mesh.faces.values() if face.side == side]
        if surfaces and (case["floor_water"] or side not in (FLOOR, BED)):
            level = max(case.tail_levels) if side in TAILWATER else max(case.levels)
            wet = sum(size_below(surface, level).sum() for surface in surfaces)
            whole = sum(size_below(surface, np.inf).sum() for surface in surfaces)
            under.append(f"{name} {wet:.4g} of {whole:.4g} {unit}")
    return "; ".join([*parts, f"under water: {', '.join(under) or 'no face'}"])


def notes_on_geometry(case: Case, mesh: Mesh) -> Iterator[str]:
    """Yield what of the loads finds no face, and what of the mesh may be a mistake."""
    geometry, sides = mesh.user_geometry, {face.side for face in mesh.faces.values()}
    lowest = {s: min(f.lowest for f in mesh.faces.values() if f.side == s) for s in sides}
    level, tail = max(case.levels), max(case.tail_levels)
    if case.source and case.source.levels is None and "levels" not in case.source.text.lists:
        listed = ", ".join(f"{h:g}" for h in case.levels)
        yield f"no levels are set: {listed} m are those of the default section"
    unit = "m2" if mesh.dim == 3 else "m"
    for side, surface, what in ((UP, level, "highest level"), (DOWN, tail, "highest tailwater")):
        if not case["rho_water"] or surface <= 0:
            continue
        if side not in sides:
            water = "reservoir" if side == UP else "tailwater"
            yield f"no face {FACES[side]}: no pressure of the {water} on it"
        elif case["face_load"] == "hydrostatic" and surface < lowest[side]:
            yield (
                f"the {what}, {surface:g} m, does not reach the dam's face {FACES[side]}, which "
                f"begins at y = {lowest[side]:g} m"
            )
        elif bare := geometry.open_parts(side, surface):
            yield (
                f"{bare:.4g} {unit} of the dam's surface below the {what} point {FACES[side]} and "
                "are in no face: no water presses on them"
            )
    if case["rho_water"]:
        _, top = geometry.reach
        if level > top and case["crest_water"] and TOP not in sides:
            yield f"no face crest surface: no pressure on the crest (y = {top:g} m) below the water"
        else:
            yield from overtopping(case, top)
        if case["floor_water"] and not sides & {FLOOR, BED}:
            yield "floor_water = 1 has no effect: no face reservoir floor or tailwater bed"
    if case["silt_height"] > 0 and (UP not in sides or case["silt_height"] <= lowest[UP]):
        yield f"silt_height = {case['silt_height']:g} m reaches no face upstream: no silt acts"
    yield from ends_beside_the_water(case, mesh)
    for part in geometry.unnamed:
        if part.names == {"fixed"}:
            yield f"fixed: has a gap at {geometry.on_part(part)}, where the rock is free"
    if fixed := geometry.fixed_concrete:
        yield f"fixed holds {fixed:.4g} {unit} of the dam's own surface"
    if where := geometry.coincident:
        yield f"two nodes lie at {where}: what meets there is not connected"
    if cavities := geometry.cavities:
        several = f"{len(cavities)} cavities, one" if len(cavities) > 1 else "a cavity"
        yield f"the mesh has {several} at {cavities[0]}"
    crest, (_, high) = geometry.regions["crest"].points[0, 1], geometry.reach
    if UP in sides and crest < high - geometry.height / 2:
        yield f"crest lies at y = {crest:.5g} m, the dam reaches {high:.5g} m: not its crest"
    if geometry.height < LOWEST:
        yield f"the dam is {geometry.height:g} m high; is the mesh in another unit?"


def ends_beside_the_water(case: Case, mesh: Mesh) -> Iterator[str]:
    """Yield the heels and toes at which the mesh says that other water stands than its faces say:
    a heel at no face of the reservoir, a toe at the upstream face.
    """
    geometry = mesh.user_geometry
    nodes = {UP: np.zeros(0, int), TOP: np.zeros(0, int), FLOOR: np.zeros(0, int)}
    for face in geometry.faces:
        if face.side in nodes:
            nodes[face.side] = np.union1d(nodes[face.side], face.surface.node_tags.astype(int))
    if not len(nodes[UP]) or not case["rho_water"]:
        return
    reservoir = np.concatenate(list(nodes.values()))
    cases = case.joints if case.of_joints else (case,) * len(mesh.joints)
    for joint, of_joint in zip(mesh.joints, cases, strict=True):
        outer = [~np.isin(end.node_tags, joint.inner_ends) for end in (joint.heel, joint.toe)]
        if of_joint["uplift"] == "none":
            continue
        name = f" of joint {joint.name}" if len(mesh.joints) > 1 else ""
        lowest = joint.heel.points[outer[0], 1].min(initial=np.inf)
        if max(case.levels) > lowest and not np.isin(joint.heel.node_tags, reservoir).any():
            yield (
                f"heel{name}: at y = {lowest:.5g} m it lies on no face that the reservoir presses "
                "on, and water enters there; if it does not, this end is the toe"
            )
        if np.isin(joint.toe.node_tags[outer[1]], nodes[UP]).any():
            yield f"toe{name}: lies on the face upstream, but has the head of the tailwater"
