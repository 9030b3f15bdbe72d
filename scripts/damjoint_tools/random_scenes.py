"""Random dams: drawn from a seed and a number, which reproduce them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, TypeAlias, TypeVar

import numpy as np
from damjoint.arrays import Setting
from damjoint.input.case import Case
from damjoint.input.parameters import declared
from damjoint.input.resolve import load
from damjoint.input.values import has_drains

Choice = TypeVar("Choice")
#: Settings by the name of the parameter.
Drawn: TypeAlias = dict[str, Any]

#: Third number of the seed of the lift joints, of temperature, works on the joint, waterstop, law =
#: endo and variants of loads, of joints that meet, of softening curves, of flow in time, of films,
#: of law = mixed, and of what is seldom asked for, which are drawn apart.
LIFT_DRAWS, WORKS_DRAWS, NETWORK_DRAWS, CURVE_DRAWS, TIME_DRAWS, FILM_DRAWS = 1, 3, 4, 5, 6, 7
MIXED_DRAWS, RARE_DRAWS = 8, 9
#: Parameters that are drawn for each joint, but for the place of its drains.
OF_JOINTS = (
    *("law", "K_N", "K_T", "sigma_max", "adhesion", "mu", "pena_rupture", "alpha", "pena_tang"),
    *("G_f", "G_t", "joint_slope", "uplift", "aperture_min", "drains"),
)
#: Young's modulus [Pa] up to which a change of temperature is as large as in a dam; that of a
#: stiffer body is smaller, so that the stress is not larger.
CONCRETE = 4e10
#: Height of the two blocks of a network [m].
NETWORK_HEIGHT = 45.0
#: Height of the highest lift over the dam's.
HIGHEST_LIFT = 0.85


#: Times at which other loads than the water's and the weight act in full.
LOAD_TIMES = "silt_t", "ice_t", "force_t", "anchor_t", "quake_t"


@dataclass(frozen=True)
class RandomScene:
    """Random dam: parameters that differ from the default dam's, and levels as in the command."""

    settings: Drawn
    levels: str
    tail_levels: str
    steps: int

    #: name of the case
    base: ClassVar[str] = "dam"

    @property
    def words(self) -> list[str]:
        """Arguments of the command `damjoint`."""
        changed = [
            word
            for name, value in self.settings.items()
            for word in ("--set", f"{name}={as_text(value)}")
        ]
        water = ["--levels", self.levels, "--tail-levels", self.tail_levels]
        return ["run", self.base, *changed, *water, "--steps", str(self.steps)]

    def rising_from(self, first: float, *levels: float) -> RandomScene:
        """The scene with a first level [m], at which all loads act in full and the ice presses, and
        others above it: the loads at a level are the same, whatever the levels before it.
        """
        tail = self.tail_levels.split(",")[-1]
        heights = [first, *(level for level in levels if level > first)]
        text = ",".join(f"{height:.10g}" for height in heights)
        settings = self.settings | dict.fromkeys(LOAD_TIMES, 1) | {"ice_level": first}
        return replace(self, settings=settings, levels=text, tail_levels=tail, steps=4)

    @property
    def without_default_hardening(self) -> RandomScene:
        """The scene without the hardening of a law that it does not ask for, which the search of a
        critical level omits.
        """
        drawn = self.settings.get("pena_tang", -1)
        given = drawn if isinstance(drawn, tuple) else (drawn,)
        values = tuple(0 if float(value) == -1 else value for value in given)
        hardening = values if isinstance(drawn, tuple) else values[0]
        return replace(self, settings=self.settings | {"pena_tang": hardening})

    @property
    def critical(self) -> list[str]:
        """Arguments of the command that finds its critical level."""
        words = self.words
        return ["critical", *words[1 : words.index("--steps")]]

    @property
    def case(self) -> Case:
        """The case as the command loads it."""
        return load(self.base, self.settings, self.levels, self.tail_levels, self.steps)


@dataclass(frozen=True)
class RandomNetwork(RandomScene):
    """Two random blocks of a 45 m dam on a base each, with a contraction joint between them."""

    base: ClassVar[str] = "monoliths"


def as_text(value: Setting) -> str:
    """Format a setting as in the command: a value, or those of all joints."""
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)


class RandomNumbers:
    """Random numbers, rounded to three digits to keep the commands readable."""

    def __init__(self, *seed: int) -> None:
        self.generator = np.random.default_rng(seed)

    def uniform(self, low: float, high: float) -> float:
        """Draw a number, uniformly distributed."""
        return float(f"{self.generator.uniform(low, high):.3g}")

    def log_uniform(self, low: float, high: float) -> float:
        """Draw a number whose logarithm is uniformly distributed."""
        return float(f"{np.exp(self.generator.uniform(np.log(low), np.log(high))):.3g}")

    def choice(self, *choices: Choice) -> Choice:
        """Draw one of the choices with equal probability."""
        return choices[self.generator.integers(len(choices))]

    def event(self, probability: float) -> bool:
        """Draw whether an event of this probability happens."""
        return bool(self.generator.random() < probability)


def random_scene(seed: int, number: int) -> RandomScene:
    """Draw scene `number` of a seed: a dam with one to four joints."""
    scene, rng = single_joint_scene(seed, number), RandomNumbers(seed, number, LIFT_DRAWS)
    scene = with_lifts(scene, rng) if rng.event(0.4) else scene
    scene = with_works(scene, RandomNumbers(seed, number, WORKS_DRAWS))
    rng = RandomNumbers(seed, number, NETWORK_DRAWS)
    scene = network(rng) if rng.event(0.06) else scene
    settings = with_mixed(scene.settings, RandomNumbers(seed, number, MIXED_DRAWS))
    settings = with_curve(settings, RandomNumbers(seed, number, CURVE_DRAWS))
    settings = with_time(settings, RandomNumbers(seed, number, TIME_DRAWS))
    settings = with_film(settings, RandomNumbers(seed, number, FILM_DRAWS))
    scene = replace(scene, settings=settings)
    return with_rare(scene, RandomNumbers(seed, number, RARE_DRAWS))


def with_rare(scene: RandomScene, rng: RandomNumbers) -> RandomScene:
    """Add to some scenes what is seldom asked for: other densities and gravity, weight of the rock,
    the published quadrature, a contact stiffness; of a section also an inclined neck, a force on
    any face, a joint above the heel, a later grouting, a uniform pressure on the upstream face.
    """
    settings, drawn = scene.settings, Drawn()
    some = [rng.event(0.2) for _ in range(8)]
    if some[0]:
        drawn |= {"g": 9.80665, "rho_dam": rng.uniform(2200, 2600)}
        drawn["rho_water"] = rng.uniform(990, 1030)
    if some[1]:
        drawn |= {"rho_found": rng.uniform(2000, 2800), "in_situ": rng.choice(0, 1)}
    if some[2]:
        drawn["nu_found"] = rng.uniform(0, 0.35)
    if some[3]:
        drawn["quadrature"] = "published"
    if some[4] and "rupture" in settings["law"]:
        drawn["pena_contact"] = rng.choice(2, 5)
    if scene.base != "dam":
        return replace(scene, settings=settings | drawn)
    height, crest, levels = settings["dam_height"], settings["dam_crest"], scene.levels
    if "neck_height" in settings and rng.event(0.5):
        widest = settings["dam_base"] - settings.get("batter", 0) - crest
        drawn["neck_batter"] = float(f"{rng.uniform(0.02, 0.2) * widest:.3g}")
    if "force_x" in settings or some[5]:
        size = 5000 * height**2  # the thrust
        face = rng.choice("upstream", "downstream", "crest")
        at = rng.uniform(0.3, 0.95) * height if face != "crest" else rng.uniform(0.2, 0.8) * crest
        up = rng.uniform(-0.03, 0.03) * size
        drawn |= {"force_face": face, "force_at": float(f"{at:.4g}"), "force_y": round(up)}
        if settings.get("mesh_pattern") == "regular":
            drawn["mesh_pattern"] = "free"
    if "grout_pressure" in settings:
        drawn["grout_t"] = rng.choice(1, levels.count(",") + 1)
    if some[6] and set(np.ravel(settings["uplift"])) - {"none"}:
        drawn["joint_head_offset"] = float(f"{rng.uniform(0.001, 0.03) * height:.3g}")
    uniform = some[7] and scene.tail_levels == "0"
    if uniform and not {"silt_height", "k_h"} & settings.keys():
        drawn["face_load"] = "uniform"  # twice the thrust
        levels = ",".join(f"{0.6 * float(level):.3g}" for level in levels.split(","))
    return replace(scene, settings=settings | drawn, levels=levels)


def with_mixed(settings: Drawn, rng: RandomNumbers) -> Drawn:
    """Settings, in some without works in one joint with law = mixed. It has no friction, so that a
    dam stands only on what is left of its strength in shear, f_t sqrt(K_T/K_N), one to twenty times
    the mean shear stress.
    """
    if not rng.event(0.12) or {"grout_pressure", "saw_thickness"} & settings.keys():
        return settings
    several = isinstance(settings["law"], tuple)
    which = int(rng.choice(*range(len(settings["law"])))) if several else 0

    def own(name: str) -> float:
        return float(np.ravel(settings[name])[which])

    K_N = own("K_N")
    K_T = K_N if rng.event(0.3) else own("K_T")  # the former: CZM_EXP_REG
    mean = 9810 * settings.get("dam_height", NETWORK_HEIGHT) / 2
    strength = float(f"{rng.log_uniform(1, 20) * mean * np.sqrt(K_N / K_T):.3g}")
    energy = rng.log_uniform(1.5, 100) * max(strength**2 / 2 / K_N, 1)
    changed: Drawn = {
        "law": "mixed",
        "K_T": K_T,
        "sigma_max": strength,
        "G_f": float(f"{energy:.4g}"),
    }
    if several:
        for name, value in changed.items():
            values = list(settings.get(name, [declared()[name].default] * len(settings["law"])))
            values[which] = value
            changed[name] = tuple(values)
    contact = {"pena_contact": rng.choice(1, 10)}
    return settings | changed | contact


def with_time(settings: Drawn, rng: RandomNumbers) -> Drawn:
    """Settings, in some of dams with flow that of the water in time, within its conditions: no
    joint with `cracked`, no earthquake, no controlled displacement.
    """
    waters = set(np.ravel(settings["uplift"]))
    other = {"drive", "k_h"} & settings.keys()
    if not rng.event(0.5) or "flow" not in waters or "cracked" in waters or other:
        return settings
    return settings | {
        "time_unit": rng.log_uniform(0.1, 1e5),
        "time_start": rng.choice(0, 1),
        "storage": rng.log_uniform(1e-13, 1e-10),
        "pressure_min": rng.choice(0, -1e5),
    }


def with_film(settings: Drawn, rng: RandomNumbers) -> Drawn:
    """Settings, in some with flow an aperture that closing stress narrows, and turbulence (some
    with a thin liquid, so that it matters).
    """
    narrows, fast = rng.event(0.3), rng.event(0.3)
    if "flow" not in np.ravel(settings["uplift"]):
        return settings
    drawn = {"aperture_elastic": rng.log_uniform(1e-7, 1e-3)} if narrows else {}
    fast = fast or ("dim" in settings and rng.event(0.6))
    if fast:
        drawn |= {"turbulent": 1, "visc": rng.log_uniform(1e-6, 1e-3)}
    return settings | drawn


def with_curve(settings: Drawn, rng: RandomNumbers) -> Drawn:
    """Settings, in some with exponential softening, which needs twice the fracture energy in shear;
    the curve is drawn from its own numbers, so that all else is what it was.
    """
    if not rng.event(0.4) or not {"bond", "rupture", "mixed"} & set(np.ravel(settings["law"])):
        return settings
    energies = {}
    if "G_t" in settings:
        drawn = settings["G_t"]
        doubled = [2 * float(energy) for energy in np.ravel(drawn)]
        energies["G_t"] = tuple(doubled) if isinstance(drawn, tuple) else doubled[0]
    return settings | {"softening": "exponential"} | energies


def network(rng: RandomNumbers) -> RandomNetwork:
    """Draw joints that meet: law, strengths and water of each; water may flow in all of them."""
    drawn = [joint(rng) | {"aperture_min": rng.log_uniform(1e-7, 1e-4)} for _ in range(3)]
    wet = rng.choice("imposed", "flow", "cracked")
    others = {
        "imposed": ("imposed", "none"),
        "flow": ("flow", "cracked"),
        "cracked": ("cracked", "flow"),
    }
    drawn[0]["uplift"], drawn[1]["uplift"] = wet, rng.choice(wet, *others[wet])
    drawn[2]["uplift"] = rng.choice("none", "none", "imposed", "flow" if wet == "flow" else "none")
    for own in drawn[:2]:
        own["drains"] = rng.choice(0, 1) if own["uplift"] in ("flow", "cracked") else 0
    settings = of_joints(drawn) | {
        "n_joint": rng.choice(10, 20, 30),
        "order": rng.choice(1, 2),
        "E": rng.log_uniform(5e9, 1e12),
        "nu": rng.uniform(0, 0.35),
        "drain_x": rng.uniform(2, 10),
        "drain_effectiveness": rng.uniform(0, 1),
    }
    levels = sorted(rng.uniform(15, 45) for _ in range(int(rng.choice(1, 2))))
    tail = rng.choice(0, rng.uniform(0, 12))
    return RandomNetwork(settings, ",".join(map(str, levels)), str(tail), int(rng.choice(1, 2)))


def with_works(scene: RandomScene, rng: RandomNumbers) -> RandomScene:
    """Add to some scenes a change of temperature and variants of their loads; in some with a single
    joint the law endo, grouting or sawing, or a waterstop.
    """
    settings, drawn = scene.settings, Drawn()
    if rng.event(0.25):
        stiffest = max(settings["E"], settings.get("E_found", 0))
        drawn |= temperature(rng, min(8.0, 8.0 * CONCRETE / stiffest))
    if "silt_height" in settings and rng.event(0.5):
        drawn |= {"silt_weight": 1, "silt_K0": rng.uniform(0.3, 0.8)}
    if "k_h" in settings:
        drawn |= {"added_mass": rng.choice(1, 2), "quake_uplift": rng.choice("crack", "unchanged")}
    if "drained" in settings["uplift"] and rng.event(0.3):
        drawn["drain_reference"] = "reservoir"
    if "lift_heights" not in settings:
        law, uplift = settings["law"], settings["uplift"]
        if rng.event(0.15) and "mu" in settings:  # not a slender dam
            law, drawn = "endo", drawn | endo(rng, settings)
        still = uplift in ("none", "imposed", "drained")
        if still and rng.event(0.5) and "drive" not in settings:
            if law == "rupture" and rng.event(0.5):
                drawn["grout_pressure"] = rng.log_uniform(1e3, 3e5)
            if law in ("rupture", "friction"):
                last = scene.levels.count(",") + 1
                drawn["saw_thickness"] = rng.log_uniform(1e-6, 1e-4)
                drawn["saw_t"] = min(rng.choice(1, 2), last)
        if uplift == "imposed" and rng.event(0.2):
            drawn |= {"uplift": "waterstop", "waterstop": rng.uniform(0, settings["dam_base"] / 3)}
    return replace(scene, settings=settings | drawn)


def temperature(rng: RandomNumbers, most: float) -> Drawn:
    """Draw changes of temperature up to a size [K]."""
    drawn: Drawn = {
        "temperature_dam": rng.uniform(-most, most),
        "temperature_linear": rng.choice(0, rng.uniform(-most, most)),
        "temperature_found": rng.choice(0, rng.uniform(-most / 2, most / 2)),
    }
    return drawn | ({"temperature_period": rng.uniform(1, 4)} if rng.event(0.3) else {})


def endo(rng: RandomNumbers, settings: Drawn) -> Drawn:
    """Draw strengths of law = endo within its conditions."""
    mu, strength = settings["mu"], rng.log_uniform(3e3, 1e6)
    cohesion = float(f"{mu * strength * rng.uniform(1.05, 1.35):.4g}")
    least = 1.2968 * max(strength**2 / settings["K_N"], cohesion**2 / settings["K_T"])
    energy = float(f"{rng.log_uniform(1.5, 50) * max(least, 1):.4g}")
    return {"law": "endo", "sigma_max": strength, "adhesion": cohesion, "G_f": energy}


def single_joint_scene(seed: int, number: int) -> RandomScene:
    """Draw a dam with one joint: any law, uplift, section and loads, stiffnesses over orders of
    magnitude, rising and falling levels. New draws are appended, so that old seeds stay
    reproducible.
    """
    rng = RandomNumbers(seed, number)
    height, plain = rng.log_uniform(5, 150), rng.event(0.5)
    solid = rng.event(0.1)
    settings = mesh(rng, height, solid, plain) | section(rng, height, plain) | joint(rng)
    settings |= loads(rng, height) if not plain else {}
    settings["uplift"] = rng.choice("none", "imposed", "drained", "cracked", "flow")
    if settings["uplift"] == "flow":
        settings["aperture_min"] = rng.log_uniform(1e-8, 1e-4)
    if settings["uplift"] == "cracked":
        settings["drains"] = rng.choice(0, 1)
    settings["weight_first"] = rng.choice(0, 1)
    number_of_levels = int(rng.choice(1, 2, 3))
    levels = [rng.uniform(0.3 * height, 1.2 * height) for _ in range(number_of_levels)]
    levels = levels if rng.event(0.3) else sorted(levels)
    tail = rng.uniform(0, 0.3 * height) if rng.event(0.4) else 0.0
    if rng.event(0.15):
        settings["drive"] = rng.choice("heel", "crest")
        settings["drive_by"] = rng.log_uniform(1e-6, 1e-3) * height / 10
    steps, tails = int(rng.choice(1, 1, 2, 4)), [tail]
    # draws added later
    settings |= drains(rng, settings)
    if not plain and "joint_height" in settings and rng.event(0.5):
        settings["joint_slope"] = rng.uniform(-5, 5)
    if not plain and rng.event(0.15):
        # up to 3 % of the thrust
        settings["force_x"] = rng.log_uniform(5 * height**2, 150 * height**2)
    if tail and rng.event(0.3):
        tails = [rng.uniform(0, 0.3 * height) for _ in levels]
    if not solid and rng.event(0.1):
        settings, tails = slender_dam(rng, height), [0.0]
        levels = sorted(rng.uniform(0.6 * height, height) for _ in levels)
    reservoir, tailwater = (",".join(f"{h:g}" for h in heights) for heights in (levels, tails))
    return RandomScene(settings, reservoir, tailwater, steps)


def with_lifts(scene: RandomScene, rng: RandomNumbers) -> RandomScene:
    """Add one to three lift joints to a scene, each with its own law, strengths, slope, uplift and
    drains.
    """
    case, count = scene.case, int(rng.choice(1, 2, 3))
    height, settings = case["dam_height"], dict(scene.settings)
    if settings.get("mesh_pattern") == "regular":
        settings["mesh_pattern"] = "free"
    lowest = max(case.section["heel_y"][0], case.section["toe_y"][0])
    spacing = (HIGHEST_LIFT * height - lowest) / count
    settings["lift_heights"] = tuple(
        float(f"{lowest + (k + rng.uniform(0.6, 1)) * spacing:.4g}") for k in range(count)
    )
    # each end of a lift moves by less than the distance of two lifts, at least 0.6 of their spacing
    steepest = np.degrees(np.arctan(0.25 * spacing / case.joint_length))
    drawn = [
        joint(rng)
        | {
            "joint_slope": rng.uniform(-steepest, steepest) if rng.event(0.4) else 0.0,
            "uplift": rng.choice("none", "imposed", "drained", "cracked", "flow"),
            "aperture_min": rng.log_uniform(1e-8, 1e-4),
            "drains": rng.choice(0, 1),
        }
        for _ in range(count)
    ]
    settings |= of_joints([settings, *drawn])
    dry = replace(scene, settings=settings | {"uplift": "none"}).case
    lengths = [joint.joint_length for joint in dry.joints]
    settings["drain_x"] = tuple(rng.uniform(0.05 * length, 0.4 * length) for length in lengths)
    return replace(scene, settings=settings)


def of_joints(drawn: list[Drawn]) -> Drawn:
    """Return the settings of OF_JOINTS for each joint, by default those of the declarations."""
    names = [n for n in OF_JOINTS if any(n in joint for joint in drawn)]
    default = {name: declared()[name].default for name in names}
    return {n: tuple(joint.get(n, default[n]) for joint in drawn) for n in names}


def slender_dam(rng: RandomNumbers, height: float) -> Drawn:
    """Draw a slender dam of realistic stiffness on a joint that loses its shear stiffness on
    opening: under uplift its crack grows unstably.
    """
    base = rng.uniform(0.68, 0.78) * height
    return {
        "dam_height": height,
        "dam_base": base,
        "dam_crest": rng.uniform(0.05 * base, 0.2 * base),
        "n_joint": rng.choice(20, 40, 80),
        "E": rng.log_uniform(1e10, 4e10),
        "found_side": height,
        "found_depth": height,
        "law": "rupture",
        "K_N": rng.log_uniform(1e11, 1e13),
        "K_T": rng.log_uniform(1e11, 1e13),
        "sigma_max": rng.choice(0, rng.log_uniform(1e2, 1e5)),
        "alpha": rng.choice(0, 0.5, 1, 1.5),
        "uplift": rng.choice("imposed", "cracked", "flow"),
        "weight_first": 1,
    }


def mesh(rng: RandomNumbers, height: float, solid: bool, plain: bool) -> Drawn:
    """Draw dimension and mesh; coarse, as equilibrium holds on any mesh."""
    settings: Drawn = {
        "dam_height": height,
        "order": rng.choice(1, 2),
        "n_joint": rng.choice(10, 20, 40),
    }
    if not solid:
        settings["mesh_pattern"] = rng.choice("free", "regular") if plain else "free"
        return settings
    return settings | {
        "dim": 3,
        "n_joint": 10,
        "mesh_pattern": rng.choice("free", "layers", "split"),
        "thickness": rng.uniform(0.1 * height, 0.3 * height),
        "hold_z": rng.choice(0, 1),
        "n_layers": rng.choice(1, 2),
        "h_dam": float(f"{height / 4:.3g}"),
        "h_found": float(f"{height / 2:.3g}"),
    }


def section(rng: RandomNumbers, height: float, plain: bool) -> Drawn:
    """Draw outline and elasticity of the bodies."""
    base = rng.uniform(0.45 * height, 1.0 * height)
    drawn: Drawn = {
        "dam_base": base,
        "dam_crest": rng.uniform(0.05 * base, 0.2 * base),
        "E": rng.log_uniform(1e9, 1e13),
        "nu": rng.uniform(0, 0.35),
        "found_side": height,
        "found_depth": height,
    }
    if plain:
        return drawn
    if rng.event(0.3):
        drawn["E_found"] = rng.log_uniform(1e9, 1e13)
    if rng.event(0.4):
        drawn["batter"] = rng.uniform(0.02 * base, 0.2 * base)
        drawn["batter_height"] = rng.uniform(0.3 * height, 0.9 * height)
    if rng.event(0.3):
        drawn["neck_height"] = rng.uniform(0.02 * height, 0.15 * height)
    if rng.event(0.4):
        drawn["joint_slope"] = rng.uniform(-8, 12)
    elif rng.event(0.3):
        drawn["joint_height"] = rng.uniform(0.1 * height, 0.5 * height)
    return drawn


def joint(rng: RandomNumbers) -> Drawn:
    """Draw law and strengths; fracture energies exceed the elastic energy at the strength."""
    drawn: Drawn = {
        "law": rng.choice("rupture", "friction", "bond"),
        "K_N": rng.log_uniform(1e8, 1e15),
        "sigma_max": rng.choice(0, rng.log_uniform(1e3, 2e6)),
        "adhesion": rng.choice(0, rng.log_uniform(1e3, 1e6)),
        "mu": rng.uniform(0.2, 1.2),
    }
    drawn["K_T"] = float(f"{drawn['K_N'] * rng.log_uniform(0.1, 2):.3g}")
    if drawn["law"] == "rupture":
        drawn["pena_rupture"] = rng.log_uniform(0.1, 1e3)
        drawn["alpha"] = rng.choice(0, 1, 1.5, 2)
    if drawn["law"] == "friction":
        drawn["pena_tang"] = rng.choice(-1, 0, float(f"{0.05 * drawn['K_T']:.3g}"))
    if drawn["law"] == "bond":
        pairs = ("G_f", "sigma_max", "K_N"), ("G_t", "adhesion", "K_T")
        for energy, strength, stiffness in pairs:
            elastic = drawn[strength] ** 2 / 2 / drawn[stiffness]
            drawn[energy] = float(f"{rng.log_uniform(1.5, 100) * max(elastic, 1):.4g}")
    return drawn


def drains(rng: RandomNumbers, settings: Drawn) -> Drawn:
    """Draw whether there are drains where water flows; their position, effectiveness, outlet."""
    drawn: Drawn = {"drains": 1} if settings["uplift"] == "flow" and rng.event(0.4) else {}
    if not has_drains({"drains": 0} | settings | drawn) or rng.event(0.5):
        return drawn
    base, height = settings["dam_base"], settings["dam_height"]
    drawn["drain_x"] = rng.uniform(0.05 * base, 0.4 * base)
    drawn["drain_effectiveness"] = rng.uniform(0, 1)
    if "drive" not in settings:
        drawn["drain_level"] = rng.uniform(0, 0.3 * height)
    return drawn


def loads(rng: RandomNumbers, height: float) -> Drawn:
    """Draw loads besides weight and water, as shares of the thrust of the water."""
    thrust, drawn = 1000 * 9.81 * height**2 / 2, Drawn()
    if rng.event(0.3):
        drawn["silt_height"] = rng.uniform(0.05 * height, 0.4 * height)
    if rng.event(0.2):
        drawn["ice_force"] = rng.log_uniform(0.001 * thrust, 0.03 * thrust)
    if rng.event(0.2):
        drawn["anchor_force"] = rng.log_uniform(0.01 * thrust, 0.2 * thrust)
        drawn["anchor_angle"] = rng.uniform(-5, 20)
    if rng.event(0.25):
        drawn |= {"k_h": rng.uniform(-0.1, 0.2), "k_v": rng.uniform(-0.1, 0.1)}
    if rng.event(0.15):
        drawn["floor_water"] = 1
    return drawn
