"""Input of runs and limits of their model, as a report states them."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from .. import ROUND_OFF
from ..arrays import Value
from ..input.case import Case
from ..input.parameters import INCLUDE, Parameter, assignments, constants, declared, listing, parse
from ..input.resolve import equal_steps
from ..input.values import flows, flows_in_time, has_drains
from ..units import STRESSES, Units, unit

#: Units by the unit in the declarations; other units are printed as they are.
UNITS: dict[str, Units] = {
    "Pa": (("GPa", 1e-9), *STRESSES),
    "Pa per m": (("GPa/m", 1e-9), ("MPa/m", 1e-6), ("Pa/m", 1)),
    "N per m": (("kN/m", 1e-3), ("N/m", 1)),
    "kg per m3": (("kg/m³", 1),),
    "m per s2": (("m/s²", 1),),
    "-": (("", 1),),
}
#: Groups of parameters, and others, whose values need a source.
MATERIALS = ("Bulk", "Joint", "Water")
OTHER_MATERIALS = ("expansion_dam", "expansion_found")
#: Groups of parameters that are in the table of the input even with their default.
SCENE = ("Scene", "Geometry")
#: Defaults of the moduli of dam and foundation, which are listed themselves.
COMMON_MODULI = ("E", "nu")

LAWS = {
    "rupture": "cohesive law in tension with linear softening; no friction: a closed joint carries "
    "any shear, and the dam cannot slide",
    "friction": "Mohr-Coulomb friction with adhesion, without damage; the joint opens at the "
    "tension c/mu, which the open part still carries",
    "endo": "coupled damage and plasticity: tensile strength and cohesion soften with one fracture "
    "energy; friction remains, and slip opens the joint by mu",
    "bond": "coupled cohesive-frictional law: tensile strength and cohesion soften with their "
    "fracture energies, friction remains",
    "mixed": "cohesive law of mixed mode: one equivalent jump softens tension and shear together; "
    "no friction: a broken joint carries no shear, while the safety factors count mu and c",
}
UPLIFTS = {
    "none": "no water pressure",
    "imposed": "pressure linear from heel to toe, independent of the opening",
    "drained": "pressure piecewise linear from heel to drains to toe, independent of the opening",
    "cracked": "full reservoir head in the crack, linear beyond it",
    "flow": "laminar flow by the cubic law, with the computed opening",
    "waterstop": "reservoir pressure from the heel to the waterstop, none behind it",
}
ADDED_MASS = {1: "Westergaard", 2: "Zangar"}
QUAKE_UPLIFTS = {
    "crack": "that of the crack at each moment",
    "unchanged": "as before the earthquake",
    "zero": "none in the crack that the earthquake opens",
    "transient": "flow in time, solved together with the motion",
}
#: Loads by the parameters that are 0 without them.
LOADS = {
    "silt": ("silt_height",),
    "ice": ("ice_force",),
    "post-tensioning": ("anchor_force",),
    "earthquake": ("k_h", "k_v"),
    "temperature": ("temperature_dam", "temperature_linear", "temperature_found"),
}
DYNAMIC = "dynamic response, "
NEVER_MODELLED = (
    f"shrinkage, creep, swelling of the concrete, {DYNAMIC}pore pressure and "
    "seepage in concrete and rock"
)

K = TypeVar("K", bound=Hashable)
V = TypeVar("V", bound=Hashable)


class Entry(NamedTuple):
    """A quantity of the input: texts; default: empty if the value is the default."""

    meaning: str
    value: str
    unit: str = ""
    default: str = ""


def by_runs(runs: Sequence[Mapping[K, V]]) -> list[tuple[K, V, str]]:
    """Merge what runs have: key, value, numbers of the runs with it; empty if all have it."""
    owners: dict[K, dict[V, list[int]]] = {}
    for number, run in enumerate(runs, start=1):
        for key, value in run.items():
            owners.setdefault(key, {}).setdefault(value, []).append(number)
    return [
        (key, value, "" if len(numbers) == len(runs) else ranges(numbers))
        for key, values in owners.items()
        for value, numbers in values.items()
    ]


def ranges(numbers: list[int]) -> str:
    """Format increasing numbers: 1, 3 to 5."""
    groups: list[list[int]] = []
    for number in numbers:
        if groups and number == groups[-1][-1] + 1:
            groups[-1].append(number)
        else:
            groups.append([number])
    long = {True: "{0} to {1}", False: "{0}, {1}"}
    return ", ".join(
        f"{g[0]}" if len(g) == 1 else long[len(g) > 2].format(g[0], g[-1]) for g in groups
    )


def materials(case: Case) -> dict[str, Entry]:
    """List the properties of bodies, joint and water that matter in a case, by parameter."""
    return {n: e for n, e in parameters(case).items() if is_material(n)}


def is_material(name: str) -> bool:
    """Whether a parameter is a property of bodies, joint or water."""
    return declared()[name].group in MATERIALS or name in OTHER_MATERIALS


def other_input(case: Case) -> dict[str, Entry]:
    """List the other parameters that matter in a case by name, and its water levels."""
    entries = loading(case)
    entries |= {n: e for n, e in parameters(case).items() if not is_material(n)}
    if case.geometry:  # dimensions of the section do not apply; a .geo may use those that are set
        entries = {n: e for n, e in entries.items() if e.default or not of_section(n)}
    return entries


def of_section(name: str) -> bool:
    """Whether an entry is a dimension of the section by parameters."""
    return name in declared() and declared()[name].group == "Geometry"


def in_table(name: str, entry: Entry) -> bool:
    """Whether the table of the input has an entry; the others have their default, and less space:
    all parameters but those of the scene, and a detail of its geometry that is 0.
    """
    if entry.default or name not in declared():
        return True
    return declared()[name].group in SCENE and entry.value != "0"


def parameters(case: Case) -> dict[str, Entry]:
    """List the parameters that matter in a case by name; with the values of all joints where they
    differ.

    The default of an automatic parameter is the value that follows from the others, at the first
    joint.
    """
    known, values = declared(), case.values
    fixed = {n: v for n, v in values.items() if not known[n].automatic}
    given = assignments(fixed) + listing("levels", case.levels)
    automatic, defaults = parse(given + INCLUDE), constants()
    matter = visible(case)
    entries = {}
    for name, parameter in known.items():
        if name in matter and name not in COMMON_MODULI:
            joints = case.joints if parameter.of_joints else [case]
            default = (automatic if parameter.automatic else defaults)[name][0]
            entries[name] = entry(parameter, [joint[name] for joint in joints], default)
    return entries


def visible(case: Case) -> set[str]:
    """Parameters that matter in the scene, at one of its joints."""
    joints = [joint.values for joint in case.joints]
    return {n for n, known in declared().items() if any(map(known.matters_in, joints))}


def entry(parameter: Parameter, values: Sequence[Value], default: Value) -> Entry:
    """Format a parameter, with the value of each joint and its default where these differ."""
    shown = values[:1] if all(same(v, values[0]) for v in values) else values
    compared = values[:1] if parameter.automatic else values
    others = [] if all(same(v, default) for v in compared) else [default]
    if parameter.text:
        words = ", ".join(map(str, shown)), "", "".join(map(str, others))
        return Entry(parameter.description, *words)
    numbers = np.array([*shown, *others], float)
    name, factor = suitable_unit(parameter.unit, numbers)
    texts = [f"{v * factor:.6g}" for v in numbers]
    of_joints, of_default = texts[: len(shown)], texts[len(shown) :]
    return Entry(parameter.description, ", ".join(of_joints), name, *of_default)


def suitable_unit(known: str, values: np.ndarray) -> tuple[str, float]:
    """The unit in which values of a parameter are shown, and its number per the declared one."""
    return unit([values], UNITS.get(known, ((known, 1),)))


def same(value: Value, default: Value) -> bool:
    """Whether a parameter has its default value, but for rounding."""
    if isinstance(value, str) or isinstance(default, str):
        return value == default
    return bool(np.isclose(value, default, ROUND_OFF, 0))


def loading(case: Case) -> dict[str, Entry]:
    """List geometry file, water levels and load steps of a case."""

    def listed(values: Iterable[float]) -> str:
        return ", ".join(f"{v:.6g}" for v in values)

    steps = len(case.times) // len(case.levels)
    equal = np.array_equal(case.times, equal_steps(len(case.levels), steps)) if steps else False
    entries = {
        "levels": Entry("Reservoir levels at t = 1, 2, ...", listed(case.levels), "m"),
        "tail_levels": Entry("Tailwater levels at t = 1, 2, ...", listed(case.tail_levels), "m"),
        "times": Entry("t at the ends of the load steps", listed(case.times)),
    }
    if equal:
        entries["times"] = Entry("Load steps from level to level", f"{steps}")
    if case.lift_heights:
        text = "Heights of the heels of the lift joints"
        entries = {"lift_heights": Entry(text, listed(case.lift_heights), "m")} | entries
    if case.downstream_face:
        text = "Corners of the downstream face, x and height of each"
        entries = {"downstream_face": Entry(text, listed(case.downstream_face), "m")} | entries
    if case.of_joints:
        text = "Joints, in the order of values that differ"
        entries = {"joints": Entry(text, ", ".join(case.joint_names))} | entries
    if case.geometry:
        entries = {"geometry": Entry("Geometry file", case.geometry.name)} | entries
    return entries


def limits_of_joint(joint: Case) -> Iterator[str]:
    """Yield what the model of a joint includes: its law, its water, its drains."""
    law = LAWS.get(joint["law"], "a law of the user")
    yield f"Joint law {joint['law']}: {law}."
    if joint["law"] in ("bond", "rupture", "mixed") and joint["softening"] != "linear":
        yield f"Softening by the {joint['softening']} curve, of the same strengths and energies."
    water = UPLIFTS[joint["uplift"]]
    if joint["uplift"] == "flow" and joint["turbulent"]:
        water += "; beyond a Reynolds number of 2041 turbulent, between smooth faces"
    yield f"Water in the joint, uplift = {joint['uplift']}: {water}."
    if flows_in_time(joint):
        yield (
            "Flow in time: the joint stores water as it opens; none flows into rock or concrete."
        )
    if has_drains(joint):
        yield (
            f"Drains {joint['drain_x']:g} m from the heel with an effectiveness of "
            f"{joint['drain_effectiveness']:g}; their efficiency in service is not verified."
        )


def uplift_in_earthquake(case: Case) -> str:
    """What the water pressure in the joints follows during an earthquake, by `quake_uplift`: of the
    opening only where it depends on it.
    """
    of_joints: dict[str, list[int]] = {}
    for number, joint in enumerate(case.joints):
        mode = joint["quake_uplift"]
        text = QUAKE_UPLIFTS[mode if mode == "zero" or flows(joint) else "unchanged"]
        text = UPLIFTS["none"] if joint["uplift"] == "none" else text
        of_joints.setdefault(text, []).append(number)
    if len(of_joints) == 1:
        return next(iter(of_joints))
    return "; ".join(f"{text} ({case.named(numbers)})" for text, numbers in of_joints.items())


def limits(case: Case, earthquake: bool = False) -> Iterator[str]:
    """What the model of a case includes and what not, in sentences; earthquake: after statics."""
    yield from limits_of_model(case)
    yield from limits_of_loads(case, earthquake)
    yield (
        "Loads follow each other as listed; the result depends on their order, and internal "
        "variables of the joint are updated once per load step."
    )
    if not case.geometry:
        yield (
            "The gravity method treats the dam as a rigid block, with stress linear along the "
            "joint, which cracks from the heel only. The finite elements' stresses at heel and "
            "toe are those of corners and depend on the mesh."
        )


def limits_of_model(case: Case) -> Iterator[str]:
    """Those of geometry, bodies and joints."""
    yield "Displacements and strains are small: equilibrium is that of the undeformed geometry."
    if any("path" in joint.section for joint in case.joints):
        yield (
            "Water passes between joints that meet unless one has none or a waterstop. Its head "
            "is that of reservoir and tailwater where they end on the surface."
        )
    yield (
        "Dam and foundation are homogeneous, isotropic and linear elastic. Only the joint opens, "
        "cracks and slides; cracks elsewhere and other sliding planes are not modelled."
    )
    if case["dim"] == 2:
        yield (
            "Plane strain, per metre of thickness: no load is carried to abutments or to "
            "neighbouring blocks."
        )
    elif case.geometry:
        yield f"Three dimensions; geometry and supports are those of {case.geometry.name}."
    else:
        side = "fixed along z" if case["hold_z"] else "free"
        yield f"Three dimensions: the section over {case['thickness']:g} m, its z faces {side}."
    if not case.geometry:
        yield (
            f"The foundation reaches {case['found_side']:g} m beyond heel and toe and "
            f"{case['found_depth']:g} m down, with fixed sides and bottom."
        )
    of_joints: dict[str, list[int]] = {}
    for number, joint in enumerate(case.joints):
        for sentence in limits_of_joint(joint):
            of_joints.setdefault(sentence, []).append(number)
    for sentence, numbers in of_joints.items():
        some = len(numbers) < len(case.joints)
        yield sentence[:-1] + (f" ({case.named(numbers)})." if some else ".")


def limits_of_loads(case: Case, earthquake: bool) -> Iterator[str]:
    """Those of the loads, and what is not modelled; earthquake: after statics."""
    if case["face_load"] == "uniform":
        yield "The water pressure on the faces is uniform, not hydrostatic."
    if not case["floor_water"]:
        yield "No water pressure acts on the reservoir floor and on the tailwater bed."
    if case["k_h"] or case["k_v"]:
        pressure = ADDED_MASS.get(int(case["added_mass"]))
        yield (
            "The earthquake is pseudo-static: seismic coefficients times the weight"
            f"{f', added water pressure after {pressure}' if pressure else ''}; uplift: "
            f"{uplift_in_earthquake(case)}."
        )
    if any(case[name] for name in LOADS["temperature"]):
        yield "Changes of temperature are prescribed: no conduction of heat is computed."
    absent = [load for load, names in LOADS.items() if not any(case[n] for n in names)]
    never = NEVER_MODELLED
    if earthquake:
        if not case["rock_mass"]:
            yield "Earthquake: the rock has no mass and does not radiate."
        yield (
            "What an impact of the joint costs is the damping of the bodies and of the time "
            "integration; the mass of the water is that of an incompressible reservoir at the last "
            "level."
        )
        absent, never = [n for n in absent if n != "earthquake"], never.replace(DYNAMIC, "")
    yield f"Not modelled: {never}."
    if absent:
        yield f"Loads that are zero: {', '.join(absent)}."
