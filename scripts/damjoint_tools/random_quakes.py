"""Random earthquakes: a random dam, joint or rigid block, with a random record."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from damjoint.arrays import Setting
from damjoint.input.case import Case

from .random_scenes import (
    CURVE_DRAWS,
    MIXED_DRAWS,
    TIME_DRAWS,
    Drawn,
    RandomNumbers,
    RandomScene,
    joint,
    mesh,
    of_joints,
    with_curve,
    with_mixed,
)

#: Third number of the seed of earthquakes, which are drawn apart.
QUAKE_DRAWS = 2

#: Kinds of scenes: the joint opens and slides; it stays elastic; a rigid block on it slides.
KINDS = DAM, ELASTIC, BLOCK = "dam", "elastic", "block"
#: What is computed beside the earthquake, see quake_comparison.py and quake_equations.py.
CHECKS = EQUATIONS, HALVED, STRONGER, REVERSED, GETDP, CLOSED_FORM = (
    *("equations", "halved", "stronger", "reversed", "getdp", "closed form"),
)

#: Interval of the records [s], and how often half of it is halved for the order of a scheme.
RECORD_STEP, MOST_HALVINGS = 0.01, 1
#: A strength that no earthquake reaches [Pa].
UNBREAKABLE = 1e9


@dataclass(frozen=True)
class RandomQuake(RandomScene):
    """Random dam with a random record, that is written into a file of the scene's name."""

    #: rows of time [s], horizontal and vertical acceleration [m/s2]
    record: np.ndarray = field(compare=False)
    file: Path
    #: one of KINDS
    kind: str = DAM
    #: of CHECKS
    checks: tuple[str, ...] = ()

    @property
    def words(self) -> list[str]:
        """Arguments of the command `damjoint`."""
        return ["quake", *super().words[1:], "--record", str(self.file)]

    @property
    def before(self) -> RandomScene:
        """The scene of its static loads."""
        return RandomScene(self.settings, self.levels, self.tail_levels, self.steps)

    @property
    def case(self) -> Case:
        """The case as the command loads it; writes the record."""
        self.file.parent.mkdir(exist_ok=True)
        np.savetxt(self.file, self.record, "%.6g", ",")
        return replace(super().case, record=self.file)

    def changed(self, **settings: Setting) -> RandomQuake:
        """Return the scene with other settings."""
        return replace(self, settings=self.settings | settings)


def random_quake(seed: int, number: int, folder: Path) -> RandomQuake:
    """Draw earthquake `number` of a seed, with its record in a folder: a dam of
    any law, uplift and damping, with one to three joints; in one of eight scenes each on an elastic
    joint, or a rigid block. New draws are appended, so that old seeds stay reproducible.
    """
    rng = RandomNumbers(seed, number, QUAKE_DRAWS)
    height, solid = rng.log_uniform(8, 120), rng.event(0.1)
    base = rng.uniform(0.75 * height, 1.0 * height)
    settings = mesh(rng, height, solid, plain=False) | {
        "n_joint": 10.0 if solid else rng.choice(10, 20),
        "dam_base": base,
        "dam_crest": rng.uniform(0.08 * base, 0.2 * base),
        "E": rng.log_uniform(5e9, 1e11),
        "nu": rng.uniform(0, 0.35),
        "found_side": height,
        "found_depth": height,
    }
    settings["h_dam"], settings["h_found"] = height / 4, height / 2
    drawn = quake_joint(rng)
    settings |= drawn
    if not solid and rng.event(0.3):
        settings["batter"] = rng.uniform(0.02 * base, 0.1 * base)
        settings["batter_height"] = rng.uniform(0.3 * height, 0.9 * height)
    if not solid and rng.event(0.2):
        settings["joint_slope"] = rng.uniform(-3, 5)
    settings["uplift"] = rng.choice("none", "imposed", "drained", "cracked", "flow")
    settings |= {
        "quake_uplift": rng.choice("crack", "unchanged", "zero"),
        "added_mass": rng.choice(0, 1, 2),
        "damping": rng.uniform(0.01, 0.1),
        "hht_alpha": rng.choice(-0.05, -0.05, 0, -0.2),
        "record_unit": rng.choice("m/s2", "g"),
        "record_component": rng.choice("both", "both", "horizontal"),
        "record_rest": rng.uniform(0.3, 1.2),
    }
    settings["record_scale"] = rng.choice(-1, 1) / (
        9.80665 if settings["record_unit"] == "g" else 1
    )
    level = f"{rng.uniform(0.3 * height, 0.85 * height):g}"
    record, file = random_record(rng), folder / f"{seed}-{number}.csv"
    if not solid and rng.event(0.3):
        count = int(rng.choice(1, 2))
        settings["lift_heights"] = tuple(
            float(f"{height * (k + 1) / (count + 1.5):.4g}") for k in range(count)
        )
    # draws added later
    kind = rng.choice(*6 * [DAM], ELASTIC, BLOCK)
    scene = RandomQuake(settings, level, "0", 1, record, file, kind)
    draw = {DAM: dam, ELASTIC: elastic, BLOCK: block}[kind]
    drawn_scene = draw(rng, scene, solid)
    settings = drawn_scene.settings
    if kind == DAM:
        settings = with_mixed(settings, RandomNumbers(seed, number, MIXED_DRAWS))
    settings = with_curve(settings, RandomNumbers(seed, number, CURVE_DRAWS))
    drawn_scene = replace(drawn_scene, settings=settings)
    if kind != DAM:
        return drawn_scene
    return with_transient(drawn_scene, RandomNumbers(seed, number, TIME_DRAWS))


def with_transient(scene: RandomQuake, rng: RandomNumbers) -> RandomQuake:
    """A scene, some of those with flow with that of the water in time while the earthquake acts,
    and of these some with drains, some with turbulent flow (half of them of a thin liquid).
    """
    waters = set(np.ravel(scene.settings["uplift"]))
    if not rng.event(0.5) or "flow" not in waters or "cracked" in waters:
        return scene
    drawn: Drawn = {"quake_uplift": "transient", "storage": rng.log_uniform(1e-13, 1e-10)}
    if rng.event(0.5):
        place = rng.uniform(0.05, 0.2) * scene.settings["dam_base"]
        drawn |= {"drains": 1, "drain_x": float(f"{place:.3g}")}
        drawn["drain_effectiveness"] = rng.uniform(0.2, 0.9)
    if rng.event(0.5):
        drawn["turbulent"] = 1
        if rng.event(0.5):
            drawn["visc"] = rng.log_uniform(1e-6, 1e-3)
    return replace(scene.changed(**drawn), checks=())


def quake_joint(rng: RandomNumbers) -> Drawn:
    """Draw law and strengths of a joint; most of them slide or rock in an earthquake."""
    drawn = joint(rng)
    while not 1e9 <= drawn["K_N"] <= 1e13:
        drawn = joint(rng)
    drawn["mu"] = rng.uniform(0.75, 1.2)
    if rng.event(0.6):
        for name, largest in (("sigma_max", 3e4), ("adhesion", 2e4)):
            drawn[name] = min(drawn[name], rng.log_uniform(1e3, largest))
    return drawn


def dam(rng: RandomNumbers, scene: RandomQuake, solid: bool) -> RandomQuake:
    """Draw own joints of the lifts, damping, dashpots, rock with mass, the published time
    integration, and what is computed beside the earthquake.
    """
    settings = dict(scene.settings)
    count = len(settings.get("lift_heights", ()))
    if count and rng.event(0.7):
        waters = "none", "imposed", "drained", "cracked"
        lifts = [quake_joint(rng) | {"uplift": rng.choice(*waters)} for _ in range(count)]
        settings |= of_joints([settings, *lifts])
    if rng.event(0.25):
        settings["damping_mass"] = 2
    if rng.event(0.15):
        settings |= {"damping_f1": rng.uniform(1, 5), "damping_f2": rng.uniform(10, 40)}
    if rng.event(0.25):
        for end, stiffness in (("n", settings["K_N"]), ("t", settings["K_T"])):
            largest = np.max(stiffness)
            settings[f"joint_damping_{end}"] = float(f"{rng.log_uniform(1e-5, 1e-3) * largest:.3g}")
    if rng.event(0.2):
        settings |= {"rock_mass": 1, "rho_found": rng.uniform(2000, 2800)}
        settings |= {"hold_z": 1} if solid else {}
    if rng.event(0.2):
        settings["dt"] = rng.choice(0.0025, 0.01)
    by_getdp = "rock_mass" not in settings and not solid and rng.event(0.2)
    if by_getdp:
        settings["n_joint"] = 10.0
    elif rng.event(0.15):
        settings["time_integration"] = "published"
    beside = rng.choice(EQUATIONS, EQUATIONS, HALVED, STRONGER)
    if beside == STRONGER and "rupture" in settings["law"]:  # of no friction
        beside = HALVED
    checks = {GETDP if by_getdp else beside}
    if checks == {EQUATIONS} and "damping_mass" in settings:
        settings["damping_mass"] = 1
    if "joint_damping_n" in settings:  # which are not in the balance of momentum by the files
        checks.add(EQUATIONS)
    return replace(scene, settings=settings, checks=tuple(sorted(checks)))


def elastic(rng: RandomNumbers, scene: RandomQuake, solid: bool) -> RandomQuake:
    """Draw a joint that no earthquake breaks, in which the water does not change; of a law whose
    shear stiffness does not depend on its opening. The steps resolve the first mode.
    """
    settings = scene.settings | {"quake_uplift": "unchanged"}
    if settings["law"] == "rupture":
        settings["law"] = rng.choice("friction", "bond")
    settings |= {"sigma_max": UNBREAKABLE, "adhesion": UNBREAKABLE}
    if settings["law"] == "bond":
        for energy, stiffness in (("G_f", "K_N"), ("G_t", "K_T")):
            settings[energy] = 10 * UNBREAKABLE**2 / settings[stiffness]
    if rng.event(0.3):
        settings |= {"rock_mass": 1, "rho_found": rng.uniform(2000, 2800)}
        settings |= {"hold_z": 1} if solid else {}
    if rng.event(0.3):
        settings["damping_mass"] = 2
    if rng.event(0.2):
        settings["time_integration"] = "published"
    frequency = 0.1 * np.sqrt(settings["E"] / 2400) / settings["dam_height"]  # about
    halvings = max(0, int(np.ceil(np.log2(40 * frequency * RECORD_STEP / 2))))
    checks = (REVERSED, HALVED) if halvings <= MOST_HALVINGS else (REVERSED,)
    settings["dt"] = RECORD_STEP / 2 / 2 ** min(halvings, MOST_HALVINGS)
    return replace(scene, settings=settings, checks=checks)


def block(rng: RandomNumbers, scene: RandomQuake, solid: bool) -> RandomQuake:
    """Draw a wide rigid block on a rigid ground, with dry friction: it slides and does not rock."""
    base, old = rng.uniform(4, 16), scene.settings
    height, peak = float(f"{base / rng.uniform(4, 6):.3g}"), np.abs(scene.record[:, 1]).max()
    kept = ("added_mass", "record_unit", "record_component", "record_rest", "record_scale")
    settings = {name: old[name] for name in kept} | {
        "dam_height": height,
        "dam_base": base,
        "dam_crest": base,
        "order": 1,
        "n_joint": 4,
        "E": 1e12,
        "K_N": 1e12,
        "K_T": 1e12,
        "law": "friction",
        "mu": float(f"{rng.uniform(0.2, 0.7) * min(peak, 6) / 9.81:.3g}"),
        "adhesion": 0,
        "pena_tang": 0,
        "uplift": rng.choice("none", "imposed"),
        "damping": 0.05,
        "hht_alpha": rng.choice(-0.05, -0.2),
        "found_side": height,
        "found_depth": height,
        "h_dam": height,
        "h_found": height,
        "dt": RECORD_STEP / 10,
    }
    level = f"{rng.uniform(0.1 * height, 0.5 * height):g}"
    return replace(scene, settings=settings, levels=level, checks=(CLOSED_FORM, EQUATIONS))


def random_record(rng: RandomNumbers) -> np.ndarray:
    """Draw a record: three smooth waves, up to 1 g, the vertical component smaller."""
    times = np.arange(0, rng.uniform(0.8, 1.6), RECORD_STEP)
    window = np.sin(np.pi * times / times[-1]) ** 2
    waves = [
        sum(
            rng.uniform(0.2, 1)
            * np.sin(2 * np.pi * (rng.log_uniform(1, 9) * times + rng.uniform(0, 1)))
            for _ in range(3)
        )
        for _ in range(2)
    ]
    peak = rng.log_uniform(1.5, 10)
    along, up = (peak * window * wave / np.abs(wave).max() for wave in waves)
    return np.column_stack([times, along, 0.6 * up])
