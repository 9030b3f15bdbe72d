"""Constraints between the values of a case, a function each; single values: `Parameter.check`.

All raise InputError, "name = value: must be ...".
"""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Mapping, Sequence

import numpy as np

from .. import InputError
from ..laws import LAWS
from .parameters import constants, declared
from .values import (
    ParameterValues,
    flows,
    flows_in_time,
    has_drains,
    has_point,
    level_unknown,
)

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
            if case[name]:
                raise InputError(
                    f"{name} = {case[name]:g}: must be 0 but with a geometry of one's own that has "
                    "the region traction"
                )
        check_distances(case, section["joint_along"][0])
    elif case["temperature_linear"]:
        raise InputError(
            f"temperature_linear = {case['temperature_linear']:g}: must be 0 with a geometry of "
            "one's own (it is linear between the faces of the section)"
        )
    check_drains(case)
    check_time(case)
    check_works(case)
    if not by_parameters and case["added_mass"] == ZANGAR:
        raise InputError(
            "added_mass = 2: must be 0 or 1 with a geometry of one's own (Zangar's pressure needs "
            "the angle of the section's upstream face)"
        )
    for violation in LAWS[case["law"]].violations(case.values):
        raise InputError(violation)


def check_magnitudes(case: ParameterValues) -> None:
    """Values of materials and loads: at most LARGEST."""
    for name, largest in LARGEST.items():
        if abs(case[name]) > largest:
            unit = declared()[name].unit
            raise InputError(
                f"{name} = {case[name]:g}: must be between {-largest:g} and {largest:g} {unit}, "
                "beyond any material or load"
            )


def check_strain(case: ParameterValues, height: float) -> None:
    """Young's moduli: strain at most LARGEST_STRAIN under a column of concrete of a height [m]."""
    least = case["rho_dam"] * case["g"] * height / LARGEST_STRAIN
    for name in ("E_dam", "E_found"):
        if case[name] < least:
            raise InputError(
                f"{name} = {case[name]:g}: must be >= {least:.4g} Pa (rho_dam g H / "
                f"{LARGEST_STRAIN:g}: a small strain under the weight of the dam, H = {height:g} "
                "m; a unit is a factor: 25*GPa)"
            )


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
        for sign, bound, why in [*least, ("<=", *most)]:
            if (case[name] * factor < bound) if sign == ">=" else (case[name] * factor > bound):
                unit = " Pa/m" if factor == 1 else ""
                raise InputError(
                    f"{name} = {case[name]:g}: must be {sign} {bound / factor:.4g}{unit} ({why})"
                )


def check_energies(case: ParameterValues) -> None:
    """Fracture energies: larger than the elastic energy at the strength (no snap-back)."""
    for name, (least, formula) in LAWS[case["law"]].least_energies(case.values).items():
        if not case[name] > least:
            raise InputError(
                f"{name} = {case[name]:g}: must be > {least:.4g} N/m ({formula}, what the joint "
                "stores before it softens)"
            )


def check_softening(case: ParameterValues, twice: bool) -> None:
    """The softening of law = rupture: by G_f or pena_rupture, not both."""
    if twice:
        raise InputError(
            f"G_f, pena_rupture = {case['G_f']:g}, {case['pena_rupture']:g}: must be one of them, "
            "the other -1 (G_f = sigma_max^2 (1 + pena_rupture) / (2 K_N))"
        )


def check_lengths(case: ParameterValues) -> None:
    """Lengths of the dam's section and of the foundation: none, or such that a mesh can have."""
    height = case["dam_height"]
    least = LEAST_LENGTH * height
    names = ["dam_base", "dam_crest", "batter_height", "neck_height", "neck_batter", "joint_height"]
    names += ["found_side", "found_depth", *(["thickness"] if case["dim"] == 3 else [])]
    for name in names:
        if 0 < case[name] < least:
            raise InputError(f"{name} = {case[name]:g}: must be >= {least:g} m ({OF_HEIGHT})")
    for name in ("neck_height", "joint_height"):
        if height - least < case[name] < height:
            raise InputError(
                f"{name} = {case[name]!r}: must be at least {least:g} m ({OF_HEIGHT}) below the "
                f"crest ({height:g} m)"
            )


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
        if not holds(case[name], height):
            raise InputError(f"{name} = {case[name]:g}: must be {sign} dam_height ({height:g} m)")
    if not batter < base:
        raise InputError(f"batter = {batter:g}: must be < dam_base ({base:g} m)")
    widest = max(base - batter - case["dam_crest"], 0)
    if case["neck_height"] and case["neck_batter"] > widest * (1 + 1e-12):
        raise InputError(
            f"neck_batter = {case['neck_batter']:g}: must be at most {widest:g} m "
            "(dam_base - batter - dam_crest)"
        )
    if not (section["toe_x"][0] > section["heel_x"][0] and section["toe_y"][0] < height):
        raise InputError(
            f"joint_slope = {case['joint_slope']:g}: must let the joint leave the dam below its "
            f"crest ({height:g} m)"
        )
    marks, regions = section["mark_region"], constants()
    for force, name, region, face in (
        ("ice_force", "ice_level", "ICE", "the upstream face"),
        ("force_x", "force_at", "FORCE", f"the {case['force_face']} face"),
        ("force_y", "force_at", "FORCE", f"the {case['force_face']} face"),
        ("anchor_force", "anchor_at", "ANCHOR", "the crest"),
        ("drive", "drive_at", "POINT", f"the {case['drive_face']} face"),
    ):
        acts = has_point(case) if force == "drive" else case[force]
        if acts and regions[region][0] not in marks:
            raise InputError(f"{name} = {case[name]:g}: must lie on {face} of the dam")
    simple = not (batter or case["neck_height"] or case["joint_height"] or marks)
    if case["mesh_pattern"] == "regular" and not simple:
        raise InputError(
            "mesh_pattern = regular: must be free, layers or split for a section with batter, "
            "neck, lift joint or line forces"
        )


def check_downstream_face(case: ParameterValues, face: Sequence[float]) -> None:
    """Corners of the downstream face between base and crest (x, y, x, y, ... [m]): upwards, and
    downstream of the upstream face.
    """
    listed = f"downstream_face = {','.join(f'{v:g}' for v in face)}"
    height, batter = case["dam_height"], case["batter"]
    least = LEAST_LENGTH * height
    if len(face) % 2:
        raise InputError(f"{listed}: must be pairs x,y, for each corner its x and its height")
    if case["neck_height"]:
        raise InputError(f"neck_height = {case['neck_height']:g}: must be 0 with downstream_face")
    if case["mesh_pattern"] == "regular":
        raise InputError(
            "mesh_pattern = regular: must be free, layers or split with downstream_face"
        )
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
        if not np.interp(at, y, x) - upstream >= least:
            raise InputError(
                f"{listed}: must lie downstream of the upstream face, at x > {upstream:g} m at a "
                f"height of {at:g} m"
            )


def downstream_corners(case: ParameterValues, face: Sequence[float]) -> list[tuple[float, float]]:
    """Corners of the downstream face [m] from the base to the crest; face: those between."""
    base, crest = case["dam_base"], case["batter"] + case["dam_crest"]
    slope = 0.0 if case["joint_height"] else math.tan(math.radians(case["joint_slope"]))
    between = zip(face[::2], face[1::2], strict=True)
    return [(base, base * slope), *between, (crest, case["dam_height"])]


def check_joints_on_face(
    case: ParameterValues,
    face: Sequence[float],
    sections: Sequence[Mapping[str, Sequence[float]]],
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
                listed = ",".join(f"{v:g}" for v in face)
                raise InputError(
                    f"downstream_face = {listed}: its corner at ({x:g}, {y:g}) must be "
                    f"{'above' if y > y1 else 'below'} the line of the joint from ({x0:g}, {y0:g}) "
                    f"to ({x1:g}, {y1:g})"
                )


def check_lift_heights(heights: Sequence[float], height: float) -> None:
    """Heights of the joints above the first one [m]: within the dam, of a height [m]."""
    listed = ",".join(f"{h:g}" for h in heights)
    least = LEAST_LENGTH * height
    for lift in heights:
        if not 0 < lift < height:
            raise InputError(
                f"lift_heights = {listed}: each must be > 0 and < dam_height ({height:g} m)"
            )
        if not least <= lift <= height - least:
            raise InputError(
                f"lift_heights = {listed}: each must be at least {least:g} m ({OF_HEIGHT}) above "
                "the base and below the crest"
            )


def check_lifts(
    case: ParameterValues,
    heights: Sequence[float],
    sections: Sequence[Mapping[str, Sequence[float]]],
) -> None:
    """Heights of the joints above the first one [m]; sections: of each joint, from the lowest."""
    listed = ",".join(f"{h:g}" for h in heights)
    if case["mesh_pattern"] == "regular":
        raise InputError("mesh_pattern = regular: must be free, layers or split with lift_heights")
    for lower, upper in itertools.pairwise(sections):
        for end in ("heel", "toe"):
            low, high = (section[f"{end}_y"][0] for section in (lower, upper))
            if not high - low >= LEAST_LENGTH * case["dam_height"]:
                raise InputError(
                    f"lift_heights = {listed}: must increase from above the first joint; the {end} "
                    f"of a joint, at {high:g} m, is not above that of the one below it, {low:g} m"
                )


def check_distances(case: ParameterValues, length: float) -> None:
    """Distances of drains and waterstop from the heel: within the length of the joint [m]."""
    present = {"drain_x": has_drains(case), "waterstop": case["uplift"] == "waterstop"}
    for name in present:
        if present[name] and not case[name] < length:
            raise InputError(
                f"{name} = {case[name]:g}: must be < the joint's length ({length:g} m)"
            )


def check_drains(case: ParameterValues) -> None:
    """Drains: with a prescribed displacement their pressure has to be linear in the level."""
    level, drive = case["drain_level"], case["drive"]
    if has_drains(case) and not flows(case) and level_unknown(case) and level > 0:
        raise InputError(
            f"drain_level = {level:g}: must be 0 with drive = {drive} "
            "(the pressure has to be linear in the level)"
        )


def check_time(case: ParameterValues) -> None:
    """Flow in time: of uplift = flow, without a pseudo-static earthquake."""
    if case["quake_uplift"] == "transient":
        if case["k_h"] or case["k_v"]:
            raise InputError(
                "quake_uplift = transient: must be crack, unchanged or zero with k_h or k_v (a "
                "pseudo-static earthquake has no time)"
            )
        if case["uplift"] == "cracked":
            raise InputError("quake_uplift = transient: must be another with uplift = cracked")
    if case["uplift"] == "flow" and case["storage"] * case["rho_water"] * case["g"] > 1:
        raise InputError(
            f"storage = {case['storage']:g}: must be at most 1 / (rho_water g) (a metre of head "
            "would store more than a metre of water)"
        )
    if not flows_in_time(case):
        return
    unit = f"time_unit = {case['time_unit']:g}: must be 0"
    if case["uplift"] == "cracked":
        raise InputError(f"{unit} with uplift = cracked (its water does not need time)")
    if case["k_h"] or case["k_v"]:
        raise InputError(f"{unit} with k_h or k_v (a pseudo-static earthquake has no time)")


def check_works(case: ParameterValues) -> None:
    """Grouting and sawing: of laws and uplifts that include them."""
    included = () if flows(case) else LAWS[case["law"]].works
    for name in ("grout_pressure", "saw_thickness"):
        if case[name] > 0 and name not in included:
            laws = " or ".join(law for law, rules in LAWS.items() if name in rules.works)
            raise InputError(
                f"{name} = {case[name]:g}: must be 0 with law = {case['law']}, uplift = "
                f"{case['uplift']} (only law = {laws} includes it, with uplift = none, imposed, "
                "drained or waterstop)"
            )


def check_steps(steps: int) -> None:
    """Number of steps between two levels."""
    if not 1 <= steps <= MOST_STEPS:
        raise InputError(f"steps = {steps}: must be an integer >= 1 and <= {MOST_STEPS}")


def highest_level(case: ParameterValues) -> float:
    """The highest water level at a section [m]."""
    return float(constants()["highest_level"][0] * case["dam_height"])


def check_levels(name: str, levels: Sequence[float], highest: float) -> None:
    """Water levels [m] from 0 to `highest`; above the crest the dam is overtopped."""
    if len(levels) > MOST_LEVELS:
        raise InputError(f"{name} = {len(levels)} values: must be at most {MOST_LEVELS}")
    for level in levels:
        if not 0 <= level <= highest:
            limit = f"between 0 and {highest:g} m, twice the dam's height"
            raise InputError(
                f"{name} = {level:g}: must be {limit if highest < math.inf else '>= 0'}"
            )


def check_levels_on_mesh(name: str, levels: Sequence[float], low: float, high: float) -> None:
    """Water levels [m] at a dam of one's own geometry between two heights [m]: as of a section, at
    most twice its height above its lowest point. (Infinite: the search of a critical level.)
    """
    limit = low + constants()["highest_level"][0] * (high - low)
    for level in levels:
        if limit < level < math.inf:
            raise InputError(
                f"{name} = {level:g}: must be at most {limit:g} m, twice the dam's height above "
                f"its lowest point (the geometry's dam is from y = {low:g} to {high:g} m)"
            )


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
    if len(tails) != number:
        listed = ",".join(f"{v:g}" for v in tails)
        whose = " (the case's own; set --tail-levels)" if of_case else ""
        raise InputError(
            f"tail_levels = {listed}{whose}: must be one level or as many as levels ({number})"
        )


def check_times(times: Sequence[float], last: int) -> None:
    """Times of the steps: increasing from above 0 to the last level's interval."""
    listed = ",".join(f"{t:g}" for t in times)
    for before, time in zip((0.0, *times), times, strict=False):
        if not before < time <= last:
            raise InputError(
                f"times = {listed}: must increase from above 0 to at most {last} (level number i "
                "is reached at t = i)"
            )
    if times[-1] <= last - 1:
        raise InputError(
            f"times = {listed}: must end after {last - 1}, on the way to the last level (reached "
            f"at t = {last})"
        )


def check_drive(case: ParameterValues, last: int) -> None:
    """Times between which a displacement is prescribed; the load whose factor is unknown acts, and
    its factor is unknown to the end.
    """
    begin, end, load = case["drive_begin"], case["drive_end"], case["drive_load"]
    if case["drive"] == "dissipation":
        if load not in ("force", "traction"):
            raise InputError(f"drive_load = {load}: must be force or traction with dissipation")
        if not case["drive_energy"]:
            raise InputError("drive_energy = 0: must be > 0 N m per m with drive = dissipation")
    if load != "level":
        sizes = STAGED[load]
        if not any(case[name] for name in sizes):
            raise InputError(
                f"drive_load = {load}: must be level, or {' or '.join(sizes)} not 0 (the load "
                "whose factor is unknown)"
            )
        if end != last:
            raise InputError(f"drive_end = {end:g}: must be {last} (the last t) with drive_load")
    if not 0 <= begin < end <= last:
        raise InputError(
            f"drive_begin, drive_end = {begin:g}, {end:g}: must be "
            f"0 <= drive_begin < drive_end <= {last} (the last t)"
        )


def check_also_uplift(modes: Sequence[str], uplift: str) -> None:
    """Further uplift modes of a published case: each once."""
    for mode in modes:
        declared()["uplift"].check(mode)
    if len({uplift, *modes}) <= len(modes):
        raise InputError(
            f"also_uplift = {' '.join(modes)}: must be other modes than uplift, each once"
        )
