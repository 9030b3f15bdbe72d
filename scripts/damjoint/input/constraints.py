"""Constraints between the values of a case, a function each; single values: `Parameter.check`.

All raise InputError, "name = value: must be ...".
"""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Mapping, Sequence

import numpy as np

from .. import InputError, require
from ..laws import LAWS
from .parameters import constants, declared
from .values import ParameterValues, flows, flows_in_time, has_drains, has_point, level_unknown

#: Usual values, from and to, in SI units: a density of 24 kN/m3 or a strength of 0.2 MPa without
#: its unit is none.
USUAL = {
    **dict.fromkeys(("rho_dam", "rho_found"), (1500.0, 4000.0)),
    "rho_water": (900.0, 1300.0),
    "rho_silt": (200.0, 1500.0),
    "mu": (0.1, 10.0),
    **dict.fromkeys(("adhesion", "sigma_max"), (1e3, 1e7)),
    "f_c": (1e5, 2e8),
    "ice_force": (1e3, 1e6),
    "visc": (1e-4, 0.1),
    **dict.fromkeys(("dam_height", "dam_base"), (0.0, 1000.0)),
}
#: Values of larger magnitude are those of no material or load: with them rounding decides whether
#: there is an equilibrium, which would be taken for a property of the dam. (A modulus up to the
#: limit makes a body rigid.) In SI units, in mm, t, s and in m, t, s.
LARGEST = {
    **dict.fromkeys(("E_dam", "E_found", "K_N", "K_T"), 1e20),
    "grout_pressure": 1e10,
    "saw_thickness": 1e5,
    **dict.fromkeys(("rho_dam", "rho_found", "rho_water", "rho_silt"), 1e5),
    "g": 1e6,
    **dict.fromkeys(("joint_head_offset", "silt_height"), 1e7),
    **dict.fromkeys(("ice_force", "anchor_force", "force_x", "force_y"), 1e10),
    **dict.fromkeys(("temperature_dam", "temperature_linear", "temperature_found"), 1e4),
    **dict.fromkeys(("expansion_dam", "expansion_found"), 1e-2),
    **dict.fromkeys(("k_h", "k_v"), 1e2),
    **dict.fromkeys(("traction_x", "traction_y"), 1e10),
}
#: Length over the dam's height below which the mesh generator takes two points for one.
LEAST_LENGTH = 1e-6
#: The largest closure and shear of an undamaged joint, rho g H/K over H, under a column of concrete
#: or water as high as the dam; usually 1e-7 to 1e-4. Beyond it the limit of small displacements
#: would end a run, not the strength of the dam.
LARGEST_CLOSURE = 0.01
#: The largest strain of the bodies, rho g H/E, under a column of concrete; usually 1e-6 to 1e-4.
#: Beyond it as before.
LARGEST_STRAIN = 0.1
#: The least stiffness of a joint, K L / (E n^2) with n elements; usually 1e-4 to 1. Below it
#: rounding of the rigid motion on the joint in the stiffness of the dam exceeds 1e-4 of the stress.
LOOSEST = 3e-12
#: The largest, K L / E; usually 1 to 1e4. Above it rounding of a slip or an opening in the points
#: beside it exceeds 1e-4 of the stress.
STIFFEST = 2e8
#: Value of added_mass: Zangar's pressure in place of Westergaard's.
ZANGAR = 2

#: Loads that grow linearly from t = <name>_t - 1 to <name>_t, by the parameters that are 0 without
#: them; and works on the joint, which do so, too.
STAGED = {
    "silt": ("silt_height",),
    "ice": ("ice_force",),
    "force": ("force_x", "force_y"),
    "anchor": ("anchor_force",),
    "quake": ("k_h", "k_v"),
    "temperature": ("temperature_dam", "temperature_linear", "temperature_found"),
    "traction": ("traction_x", "traction_y"),
}
WORKS = {"grout": ("grout_pressure",), "saw": ("saw_thickness",)}

#: Most steps between two levels.
MOST_STEPS = 100_000
#: Most levels, each of which has its table.
MOST_LEVELS = 10_000


def check_values(
    case: ParameterValues, section: Mapping[str, Sequence[float]], by_parameters: bool
) -> None:
    """Values of a case; section: as in `Case`; by_parameters: whether they define its geometry."""
    check_energies(case)
    for name, parameter in declared().items():
        parameter.check(case.values[name])
    check_magnitudes(case)
    if by_parameters:
        check_strain(case, case["dam_height"])
        check_section(case, section)
        for name in STAGED["traction"]:
            rule = "be 0 but with a geometry of one's own that has the region traction"
            require(not case[name], name, case[name], rule)
        check_distances(case, section["joint_along"][0])
    else:
        linear, why = case["temperature_linear"], "it is linear between the faces of the section"
        rule = f"be 0 with a geometry of one's own ({why})"
        require(not linear, "temperature_linear", linear, rule)
    check_drains(case)
    check_time(case)
    check_works(case)
    if not by_parameters:
        why = "Zangar's pressure needs the angle of the section's upstream face"
        rule = f"be 0 or 1 with a geometry of one's own ({why})"
        require(case["added_mass"] != ZANGAR, "added_mass", ZANGAR, rule)
    for violation in LAWS[case["law"]].violations(case.values):
        raise InputError(violation)


def check_magnitudes(case: ParameterValues) -> None:
    """Values of materials and loads: at most LARGEST."""
    for name, largest in LARGEST.items():
        limits = f"{-largest:g} and {largest:g} {declared()[name].unit}"
        rule = f"be between {limits}, beyond any material or load"
        require(abs(case[name]) <= largest, name, case[name], rule)


def check_strain(case: ParameterValues, height: float) -> None:
    """Young's moduli: strain at most LARGEST_STRAIN under a column of concrete of a height [m]."""
    least = case["rho_dam"] * case["g"] * height / LARGEST_STRAIN
    rule = (
        f"be >= {least:.4g} Pa (rho_dam g H / {LARGEST_STRAIN:g}: a small strain under the weight "
        f"of the dam, H = {height:g} m; a unit is a factor: 25*GPa)"
    )
    for name in ("E_dam", "E_found"):
        require(case[name] >= least, name, case[name], rule)


def check_stiffness(
    case: ParameterValues, length: float, carries: bool = True, holds: bool = True
) -> None:
    """Stiffnesses of a joint of a length [m]: small closure and shear; rounding does not decide
    whether there is an equilibrium. carries: whether a body stands on it (an open contraction joint
    has next to none); holds: whether it alone holds a body against water.
    """
    softer = "E_dam" if case["E_dam"] <= case["E_found"] else "E_found"
    most = (
        STIFFEST * case[softer] / length,
        f"{STIFFEST:g} {softer} / L: beyond it rounding decides",
    )
    loosest = (
        LOOSEST * case["E_dam"] * case["n_joint"] ** 2 / length,
        f"{LOOSEST:g} E_dam n_joint^2 / L: below it rounding decides",
    )
    closes, shifts = (
        (
            case[density] * case["g"] / LARGEST_CLOSURE,
            f"{density} g / {LARGEST_CLOSURE:g}: {what} by a small part of the dam's height",
        )
        for density, what in (
            ("rho_dam", "the weight closes the joint"),
            ("rho_water", "the water shifts the dam"),
        )
    )
    limits = [("K_N", 1.0, closes), ("K_T", 1.0, shifts)]
    if declared()["pena_contact"].matters_in(case.values):
        limits.append(("pena_contact", case["K_N"], closes))
    for name, factor, small in limits:
        needed = holds if name == "K_T" else carries
        least = [(">=", *small), (">=", *loosest)] if needed else []
        unit = " Pa/m" if factor == 1 else ""
        for sign, bound, why in [*least, ("<=", *most)]:
            stiffness, rule = case[name] * factor, f"be {sign} {bound / factor:.4g}{unit} ({why})"
            within = stiffness >= bound if sign == ">=" else stiffness <= bound
            require(within, name, case[name], rule)


def check_energies(case: ParameterValues) -> None:
    """Fracture energies: larger than the elastic energy at the strength (no snap-back)."""
    for name, (least, formula) in LAWS[case["law"]].least_energies(case.values).items():
        why = f"{formula}, what the joint stores before it softens"
        require(case[name] > least, name, case[name], f"be > {least:.4g} N/m ({why})")


def check_softening(case: ParameterValues, twice: bool) -> None:
    """The softening of law = rupture: by G_f or pena_rupture, not both."""
    given = f"{case['G_f']:g}, {case['pena_rupture']:g}"
    formula = "G_f = sigma_max^2 (1 + pena_rupture) / (2 K_N)"
    require(not twice, "G_f, pena_rupture", given, f"be one of them, the other -1 ({formula})")


def check_lengths(case: ParameterValues) -> None:
    """Lengths of the dam's section and of the foundation: none, or such that a mesh can have."""
    height = case["dam_height"]
    least = LEAST_LENGTH * height
    names = ["dam_base", "dam_crest", "batter_height", "neck_height", "neck_batter", "joint_height"]
    names += ["found_side", "found_depth", *(["thickness"] if case["dim"] == 3 else [])]
    for name in names:
        rule = f"be >= {least:g} m ({OF_HEIGHT})"
        require(not 0 < case[name] < least, name, case[name], rule)
    for name in ("neck_height", "joint_height"):
        rule = f"be at least {least:g} m ({OF_HEIGHT}) below the crest ({height:g} m)"
        require(not height - least < case[name] < height, name, repr(case[name]), rule)


#: LEAST_LENGTH in words.
OF_HEIGHT = f"{LEAST_LENGTH:g} of dam_height"


def check_section(case: ParameterValues, section: Mapping[str, Sequence[float]]) -> None:
    """Lengths of the dam's section; positions of line forces on it."""
    check_lengths(case)
    height, base, batter = case["dam_height"], case["dam_base"], case["batter"]
    for name, sign, holds in (
        ("batter_height", "<=", operator.le),
        ("neck_height", "<", operator.lt),
        ("joint_height", "<", operator.lt),
        ("silt_height", "<=", operator.le),
    ):
        rule = f"be {sign} dam_height ({height:g} m)"
        require(holds(case[name], height), name, case[name], rule)
    require(batter < base, "batter", batter, f"be < dam_base ({base:g} m)")
    widest, neck = max(base - batter - case["dam_crest"], 0), case["neck_batter"]
    fits = not case["neck_height"] or neck <= widest * (1 + 1e-12)
    rule = f"be at most {widest:g} m (dam_base - batter - dam_crest)"
    require(fits, "neck_batter", neck, rule)
    leaves = section["toe_x"][0] > section["heel_x"][0] and section["toe_y"][0] < height
    rule = f"let the joint leave the dam below its crest ({height:g} m)"
    require(leaves, "joint_slope", case["joint_slope"], rule)
    marks, regions = section["mark_region"], constants()
    for force, name, region, face in (
        ("ice_force", "ice_level", "ICE", "the upstream face"),
        ("force_x", "force_at", "FORCE", f"the {case['force_face']} face"),
        ("force_y", "force_at", "FORCE", f"the {case['force_face']} face"),
        ("anchor_force", "anchor_at", "ANCHOR", "the crest"),
        ("drive", "drive_at", "POINT", f"the {case['drive_face']} face"),
    ):
        acts = has_point(case) if force == "drive" else case[force]
        on_face = not acts or regions[region][0] in marks
        require(on_face, name, case[name], f"lie on {face} of the dam")
    if batter or case["neck_height"] or case["joint_height"] or marks:
        check_pattern(case, "for a section with batter, neck, lift joint or line forces")


def check_pattern(case: ParameterValues, condition: str) -> None:
    """The pattern of the mesh in a section that the regular one does not suit, in words."""
    rule = f"be free, layers or split {condition}"
    require(case["mesh_pattern"] != "regular", "mesh_pattern", "regular", rule)


def check_downstream_face(case: ParameterValues, face: Sequence[float]) -> None:
    """Corners of the downstream face between base and crest (x, y, x, y, ... [m]): upwards, and
    downstream of the upstream face.
    """
    listed, neck = f"downstream_face = {in_list(face)}", case["neck_height"]
    height, batter = case["dam_height"], case["batter"]
    least = LEAST_LENGTH * height
    pairs = "be pairs x,y, for each corner its x and its height"
    require(len(face) % 2 == 0, "downstream_face", in_list(face), pairs)
    require(not neck, "neck_height", neck, "be 0 with downstream_face")
    check_pattern(case, "with downstream_face")
    corners = downstream_corners(case, face)
    for (_, low), (_, high) in itertools.pairwise(corners):
        if not high - low >= least:
            raise InputError(
                f"{listed}: the heights of its corners must increase from above the base's toe "
                f"({corners[0][1]:g} m) to below the crest ({height:g} m), each by {least:g} m or "
                f"more ({OF_HEIGHT})"
            )
    x, y = zip(*corners, strict=True)
    # the upstream face is straight between these heights, the other one between its corners
    for at in sorted({*y, case["batter_height"]} if batter else y):
        upstream = batter * min(max(at, 0.0) / case["batter_height"], 1.0)
        where = f"at x > {upstream:g} m at a height of {at:g} m"
        rule = f"lie downstream of the upstream face, {where}"
        holds = bool(np.interp(at, y, x) - upstream >= least)
        require(holds, "downstream_face", in_list(face), rule)


def downstream_corners(case: ParameterValues, face: Sequence[float]) -> list[tuple[float, float]]:
    """Corners of the downstream face [m] from the base to the crest; face: those between."""
    base, crest = case["dam_base"], case["batter"] + case["dam_crest"]
    slope = 0.0 if case["joint_height"] else math.tan(math.radians(case["joint_slope"]))
    between = zip(face[::2], face[1::2], strict=True)
    return [(base, base * slope), *between, (crest, case["dam_height"])]


def check_joints_on_face(
    case: ParameterValues, face: Sequence[float], sections: Sequence[Mapping[str, Sequence[float]]]
) -> None:
    """Joints of a section with corners of the downstream face as in `check_downstream_face`: the
    line of a joint meets the face only at its toe. sections: of each joint.
    """
    for section in sections:
        x0, y0, x1, y1 = (section[name][0] for name in ("heel_x", "heel_y", "toe_x", "toe_y"))
        for x, y in downstream_corners(case, face):
            side = (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)  # > 0: above the line
            near = LEAST_LENGTH * case["dam_height"]
            if abs(y - y1) > near and (y > y1) != (side > near * (x1 - x0)):
                raise InputError(
                    f"downstream_face = {in_list(face)}: its corner at ({x:g}, {y:g}) must be "
                    f"{'above' if y > y1 else 'below'} the line of the joint from ({x0:g}, {y0:g}) "
                    f"to ({x1:g}, {y1:g})"
                )


def check_lift_heights(heights: Sequence[float], height: float) -> None:
    """Heights of the joints above the first one [m]: within the dam, of a height [m]."""
    least, listed = LEAST_LENGTH * height, f"lift_heights = {in_list(heights)}: each must be"
    for lift in heights:
        if not 0 < lift < height:
            raise InputError(f"{listed} > 0 and < dam_height ({height:g} m)")
        if not least <= lift <= height - least:
            where = "above the base and below the crest"
            raise InputError(f"{listed} at least {least:g} m ({OF_HEIGHT}) {where}")


def check_lifts(
    case: ParameterValues,
    heights: Sequence[float],
    sections: Sequence[Mapping[str, Sequence[float]]],
) -> None:
    """Heights of the joints above the first one [m]; sections: of each joint, from the lowest."""
    check_pattern(case, "with lift_heights")
    for lower, upper in itertools.pairwise(sections):
        for end in ("heel", "toe"):
            low, high = (section[f"{end}_y"][0] for section in (lower, upper))
            rule = (
                f"increase from above the first joint; the {end} of a joint, at {high:g} m, is "
                f"not above that of the one below it, {low:g} m"
            )
            above = high - low >= LEAST_LENGTH * case["dam_height"]
            require(above, "lift_heights", in_list(heights), rule)


def check_distances(case: ParameterValues, length: float) -> None:
    """Distances of drains and waterstop from the heel: within the length of the joint [m]."""
    present = {"drain_x": has_drains(case), "waterstop": case["uplift"] == "waterstop"}
    for name in present:
        within = not present[name] or case[name] < length
        require(within, name, case[name], f"be < the joint's length ({length:g} m)")


def check_drains(case: ParameterValues) -> None:
    """Drains: with a prescribed displacement their pressure has to be linear in the level."""
    if has_drains(case) and not flows(case) and level_unknown(case):
        rule = f"be 0 with drive = {case['drive']} (the pressure has to be linear in the level)"
        require(case["drain_level"] <= 0, "drain_level", case["drain_level"], rule)


def check_time(case: ParameterValues) -> None:
    """Flow in time: of uplift = flow, without a pseudo-static earthquake."""
    pseudo_static = bool(case["k_h"] or case["k_v"])
    timeless = "with k_h or k_v (a pseudo-static earthquake has no time)"
    if case["quake_uplift"] == "transient":
        rule = f"be crack, unchanged or zero {timeless}"
        require(not pseudo_static, "quake_uplift", "transient", rule)
        rule = "be another with uplift = cracked"
        require(case["uplift"] != "cracked", "quake_uplift", "transient", rule)
    if case["uplift"] == "flow":
        stores, why = case["storage"], "a metre of head would store more than a metre of water"
        rule = f"be at most 1 / (rho_water g) ({why})"
        require(stores * case["rho_water"] * case["g"] <= 1, "storage", stores, rule)
    if flows_in_time(case):
        unit, rule = case["time_unit"], "be 0 with uplift = cracked (its water does not need time)"
        require(case["uplift"] != "cracked", "time_unit", unit, rule)
        require(not pseudo_static, "time_unit", unit, f"be 0 {timeless}")


def check_works(case: ParameterValues) -> None:
    """Grouting and sawing: of laws and uplifts that include them."""
    included = () if flows(case) else LAWS[case["law"]].works
    for name in ("grout_pressure", "saw_thickness"):
        laws = " or ".join(law for law, rules in LAWS.items() if name in rules.works)
        rule = (
            f"be 0 with law = {case['law']}, uplift = {case['uplift']} (only law = {laws} includes "
            "it, with uplift = none, imposed, drained or waterstop)"
        )
        require(case[name] <= 0 or name in included, name, case[name], rule)


def check_steps(steps: int) -> None:
    """Number of steps between two levels."""
    rule = f"be an integer >= 1 and <= {MOST_STEPS}"
    whole = isinstance(steps, int) and 1 <= steps <= MOST_STEPS
    require(whole, "steps", str(steps), rule)


def highest_level(case: ParameterValues) -> float:
    """The highest water level at a section [m]."""
    return float(constants()["highest_level"][0] * case["dam_height"])


def check_levels(name: str, levels: Sequence[float], highest: float) -> None:
    """Water levels [m] from 0 to `highest`; above the crest the dam is overtopped."""
    most = f"be at most {MOST_LEVELS}"
    require(len(levels) <= MOST_LEVELS, name, f"{len(levels)} values", most)
    limit = f"between 0 and {highest:g} m, twice the dam's height"
    rule = f"be {limit if highest < math.inf else '>= 0'}"
    for level in levels:
        require(0 <= level <= highest, name, level, rule)


def check_levels_on_mesh(name: str, levels: Sequence[float], low: float, high: float) -> None:
    """Water levels [m] at a dam of one's own geometry between two heights [m]: as of a section, at
    most twice its height above its lowest point. (Infinite: the search of a critical level.)
    """
    limit = low + constants()["highest_level"][0] * (high - low)
    rule = (
        f"be at most {limit:g} m, twice the dam's height above its lowest point (the geometry's "
        f"dam is from y = {low:g} to {high:g} m)"
    )
    for level in levels:
        require(not limit < level < math.inf, name, level, rule)


def check_acting(case: ParameterValues, end: float) -> None:
    """Loads and works: not such as begin only when the loading ends, at a time."""
    for name, values in (STAGED | WORKS).items():
        acting, time = [n for n in values if case[n]], case[f"{name}_t"]
        if acting and time - 1 >= end:
            raise InputError(
                f"{name}_t = {time:g}: must be < {end + 1:g}, as the loading ends at t = {end:g} "
                f"(level number i is reached at t = i): {acting[0]} = {case[acting[0]]:g}, which "
                f"begins at {name}_t - 1, would never act"
            )


def check_tail_levels(tails: Sequence[float], number: int, of_case: bool) -> None:
    """Tailwater levels: as many as levels; of_case: whether they are those of the case file."""
    given = in_list(tails) + (" (the case's own; set --tail-levels)" if of_case else "")
    rule = f"be one level or as many as levels ({number})"
    require(len(tails) == number, "tail_levels", given, rule)


def check_times(times: Sequence[float], last: int) -> None:
    """Times of the steps: increasing from above 0 to the last level's interval."""
    listed = in_list(times)
    rises = all(before < time <= last for before, time in itertools.pairwise((0.0, *times)))
    rule = f"increase from above 0 to at most {last} (level number i is reached at t = i)"
    require(rises, "times", listed, rule)
    rule = f"end after {last - 1}, on the way to the last level (reached at t = {last})"
    require(times[-1] > last - 1, "times", listed, rule)


def check_drive(case: ParameterValues, last: int) -> None:
    """Times between which a displacement is prescribed; the load whose factor is unknown acts, and
    its factor is unknown to the end.
    """
    begin, end, load = case["drive_begin"], case["drive_end"], case["drive_load"]
    if case["drive"] == "dissipation":
        rule = "be > 0 N m per m with drive = dissipation"
        require(case["drive_energy"], "drive_energy", 0, rule)
    if load != "level":
        sizes = STAGED[load]
        acts = any(case[name] for name in sizes)
        unknown = "the load whose factor is unknown"
        require(acts, "drive_load", load, f"be level, or {' or '.join(sizes)} not 0 ({unknown})")
        require(end == last, "drive_end", end, f"be {last} (the last t) with drive_load")
    rule = f"be 0 <= drive_begin < drive_end <= {last} (the last t)"
    require(0 <= begin < end <= last, "drive_begin, drive_end", f"{begin:g}, {end:g}", rule)


def check_also_uplift(modes: Sequence[str], uplift: str) -> None:
    """Further uplift modes of a published case: each once."""
    for mode in modes:
        declared()["uplift"].check(mode)
    once = len({uplift, *modes}) > len(modes)
    require(once, "also_uplift", " ".join(modes), "be other modes than uplift, each once")


def in_list(values: Sequence[float]) -> str:
    """Values as they are typed in an option."""
    return ",".join(f"{value:g}" for value in values)
