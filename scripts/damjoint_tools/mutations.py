"""Mutations: errors put into a copy of the package, which the verification has to notice.

Each one changes a single place of the source. The commands of random scenes are run with the copy
until the verification finds something; the verification itself is that of this package.
"""

from __future__ import annotations

import itertools
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import as_completed
from dataclasses import dataclass
from pathlib import Path

import damjoint
from damjoint import RunError
from damjoint.processes import process_pool
from damjoint.progress import track
from damjoint.studies.result_file import rows_session

from .provenance import RECORDED, provenance
from .random_quakes import random_quake
from .random_scenes import RandomScene, random_scene
from .stress import ONE_THREAD, critical_levels, has_critical_level, run_of, same_code

#: Folders beside scripts/ that the package reads.
DATA = "pro", "geo", "cases", "reference"
#: Columns of the result file.
COLUMNS = ("mutation", "place", "relevant", "scene", "finding", *RECORDED)
#: Begin of the message of a command that is refused, by which no mutation is noticed.
REFUSED = "exit code 2:"
#: Relevant scenes at most, and scenes that are drawn to find them.
MOST_SCENES, MOST_DRAWN = 60, 600


def everywhere(_: RandomScene) -> bool:
    """Whether a mutation can matter in a scene: in all."""
    return True


def having(name: str, *values: object) -> Callable[[RandomScene], bool]:
    """Whether a scene sets a parameter, to one of some values if there are any, at any joint."""

    def matters(scene: RandomScene) -> bool:
        value = scene.settings.get(name, 0)
        values_of_joints = value if isinstance(value, tuple) else (value,)
        return any(v in values if values else v for v in values_of_joints)

    return matters


def both(*conditions: Callable[[RandomScene], bool]) -> Callable[[RandomScene], bool]:
    """Whether a scene fulfils all conditions."""
    return lambda scene: all(matters(scene) for matters in conditions)


def several(scene: RandomScene) -> bool:
    """Whether a scene has several joints."""
    return "lift_heights" in scene.settings


def tail(scene: RandomScene) -> bool:
    """Whether a scene has tailwater."""
    return any(float(level) for level in scene.tail_levels.split(","))


def levels(scene: RandomScene) -> bool:
    """Whether a scene has several levels."""
    return "," in scene.levels


def drained(scene: RandomScene) -> bool:
    """Whether a scene has drains that are no half as effective as none."""
    drains = having("uplift", "drained")(scene) or having("drains", 1)(scene)
    return drains and scene.settings.get("drain_effectiveness", 0.5) != 0.5


@dataclass(frozen=True)
class Mutation:
    """An error: a text of a file of the package, which occurs once, and what replaces it."""

    name: str
    file: str
    text: str
    instead: str
    #: whether it can matter in a scene
    matters: Callable[[RandomScene], bool] = everywhere
    #: looked for in earthquakes
    quake: bool = False
    #: the bodies' fields are needed to notice it
    fields: bool = False
    #: looked for in critical levels
    critical: bool = False

    def make(self, folder: Path) -> Path:
        """Copy the package into a folder with the error; returns the folder of its modules.

        Raises ValueError if the text does not occur exactly once.
        """
        source = Path(damjoint.__file__).parent
        copy = folder / "scripts" / source.name
        shutil.copytree(source, copy, ignore=shutil.ignore_patterns("__pycache__"))
        of_data = Path(self.file).parts[0] in DATA
        for name in DATA:
            beside = source.parents[1] / name
            if beside.exists() and not (copy / name).exists():
                if of_data:  # a file of geo/ includes those of pro/ beside it
                    shutil.copytree(beside, folder / name)
                else:
                    (folder / name).symlink_to(beside)
        path = (folder if of_data and not (copy / self.file).exists() else copy) / self.file
        before = path.read_text()
        if before.count(self.text) != 1:
            raise ValueError(
                f"{self.name}: {self.file} has {before.count(self.text)} times: {self.text}"
            )
        path.write_text(before.replace(self.text, self.instead))
        return copy.parent


MUTATIONS = (
    Mutation(
        "drains: 1 - e for e",
        "joint/water.py",
        "drained = drained - effectiveness * np.maximum(",
        "drained = drained - (1 - effectiveness) * np.maximum(",
        both(drained, having("uplift", "drained")),
    ),
    Mutation(
        "sign of the drains",
        "joint/water.py",
        "drained = drained - effectiveness * np.maximum(",
        "drained = drained + effectiveness * np.maximum(",
        having("uplift", "drained"),
    ),
    Mutation(
        "drains of the first joint in all",
        "joint/water.py",
        'at = case["drain_x"] / self.joint.length',
        'at = float(case.source.overrides["drain_x"][0]) / self.joint.length',
        both(several, lambda s: "drained" in s.settings["uplift"][1:]),
    ),
    Mutation(
        "square law for the cubic law of flow",
        "joint/water.py",
        "w.scale * (1 + at[0]) ** 3 * w.joint.points.weights",
        "w.scale * (1 + at[0]) ** 2 * w.joint.points.weights",
        having("uplift", "flow"),
    ),
    Mutation(
        "storage x 1.02",
        "joint/water.py",
        'stored = self.members[0].case["storage"] * flow.points.weights',
        'stored = 1.02 * self.members[0].case["storage"] * flow.points.weights',
        having("time_unit"),
    ),
    Mutation(
        "one history of the water for all drains",
        "joint/flow_in_time.py",
        "begins = self.begin.parts or (self.begin,) * 2",
        "begins = (self.begin,) * 2",
        both(having("time_unit"), having("drains", 1), drained),
    ),
    Mutation(
        "voids from no pressure on",
        "joint/water.py",
        'lowest=self.members[0].case["pressure_min"],',
        "lowest=0.0,",
        both(having("time_unit"), having("pressure_min")),
    ),
    Mutation(
        "fade of the drains beside a crack x 0.9",
        "joint/water.py",
        "remaining = 1 - float(beside @ wider) / most",
        "remaining = 1 - 0.9 * float(beside @ wider) / most",
        both(having("uplift", "cracked"), having("drains", 1)),
    ),
    Mutation(
        "water in a joint that has not cracked",
        "joint/water.py",
        "opening = opening - self.law.opening_of_crack(variables, len(opening))",
        "opening = opening - 0 * self.law.opening_of_crack(variables, len(opening))",
        having("uplift", "cracked"),
    ),
    Mutation(
        "voids lose their water",
        "joint/flow_in_time.py",
        "change=self.opened + self.storage * pressure - void,",
        "change=self.opened + self.storage * pressure,",
        having("time_unit"),
    ),
    Mutation(
        "elastic aperture x 1.02",
        "joint/water.py",
        'opening = opening + self.case["aperture_elastic"]',
        'opening = opening + 1.02 * self.case["aperture_elastic"]',
        having("aperture_elastic"),
    ),
    Mutation(
        "exponent 4/7 of turbulent flow: 1/2",
        "joint/turbulence.py",
        "EXPONENT = 4 / 7",
        "EXPONENT = 1 / 2",
        having("turbulent"),
    ),
    Mutation(
        "G_t x 1.1",
        "laws/bond.py",
        'self.progress_per_slip = self.cohesion / (2 * p["G_t"])',
        'self.progress_per_slip = self.cohesion / (2.2 * p["G_t"])',
        both(having("law", "bond"), having("adhesion")),
    ),
    Mutation(
        "bond strengths x 0.8",
        "laws/bond.py",
        'self.tensile_strength, self.cohesion, self.mu = p["sigma_max"], p["adhesion"], p["mu"]',
        "self.tensile_strength, self.cohesion, self.mu = "
        '0.8 * p["sigma_max"], 0.8 * p["adhesion"], p["mu"]',
        both(having("law", "bond"), lambda s: having("adhesion")(s) or having("sigma_max")(s)),
    ),
    Mutation(
        "maximum of the damage dropped",
        "laws/bond.py",
        "return np.maximum(progress, np.minimum(share, self.curve.end))",
        "return np.clip(share, 0, self.curve.end)",
        having("law", "bond"),
    ),
    Mutation(
        "exponential softening: exp(-1.98 xi)",
        "laws/softening.py",
        "np.exp(-2 * np.maximum(progress, 0))",
        "np.exp(-1.98 * np.maximum(progress, 0))",
        having("softening"),
    ),
    Mutation(
        "equivalent jump of mixed without K_T/K_N",
        "laws/mixed.py",
        "shear = self.ratio * (slip[0] ** 2 + slip[1] ** 2)",
        "shear = slip[0] ** 2 + slip[1] ** 2",
        having("law", "mixed"),
    ),
    Mutation(
        "G_f of mixed x 1.02",
        "laws/mixed.py",
        'self.L_C = 2 * p["G_f"] / self.tensile_strength if self.tensile_strength else 0.0',
        'self.L_C = 2.04 * p["G_f"] / self.tensile_strength if self.tensile_strength else 0.0',
        having("law", "mixed"),
    ),
    Mutation(
        "mu of the first joint in all laws",
        "joint/equilibrium.py",
        "JointLaws([joint_case.law for joint_case in case.joints])",
        "JointLaws([each.with_values({'mu': case['mu']}).law for each in case.joints])",
        both(several, having("law", "friction", "bond", "endo")),
    ),
    Mutation(
        "alpha of rupture: tan(alpha pi/5)",
        "laws/rupture.py",
        "np.tan(self.alpha * np.pi / 4)",
        "np.tan(self.alpha * np.pi / 5)",
        both(having("law", "rupture"), having("alpha")),
    ),
    Mutation(
        "K_T x 1.01",
        "laws/friction.py",
        'self.K_N, self.K_T, self.H = p["K_N"], p["K_T"], p["pena_tang"]',
        'self.K_N, self.K_T, self.H = p["K_N"], 1.01 * p["K_T"], p["pena_tang"]',
        having("law", "friction"),
    ),
    Mutation(
        "thickness of the saw x 1.02",
        "laws/friction.py",
        'self.saw, self.saw_t = p["saw_thickness"], p["saw_t"]',
        'self.saw, self.saw_t = 1.02 * p["saw_thickness"], p["saw_t"]',
        both(having("saw_thickness"), having("law", "friction")),
    ),
    Mutation(
        "silt x 1.02",
        "joint/equilibrium.py",
        'weight = grown * case["rho_silt"] * case["g"]',
        'weight = 1.02 * grown * case["rho_silt"] * case["g"]',
        having("silt_height"),
    ),
    Mutation(
        "ice x 1.02",
        "model/loads.py",
        '"ice": (case["ice_force"], 0.0),',
        '"ice": (1.02 * case["ice_force"], 0.0),',
        having("ice_force"),
    ),
    Mutation(
        "tailwater on the face x 1.02",
        "joint/equilibrium.py",
        "level = loading.tail if face.side in BY_TAIL else loading.level",
        "level = 1.02 * loading.tail if face.side in BY_TAIL else loading.level",
        tail,
    ),
    Mutation(
        "added mass x 1.02",
        "model/loads.py",
        "factor = zangar_share(case, level) / 2 if zangar else 7 / 8",
        "factor = 1.02 * (zangar_share(case, level) / 2 if zangar else 7 / 8)",
        having("k_h"),
    ),
    Mutation(
        "temperature x 1.1",
        "model/loads.py",
        'uniform = case["expansion_dam"] * case["temperature_dam"]',
        'uniform = 1.1 * case["expansion_dam"] * case["temperature_dam"]',
        having("temperature_dam"),
        fields=True,
    ),
    Mutation(
        "modulus of plane stress",
        "fem/elasticity.py",
        "return young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))",
        "return young * poisson / (1 - poisson**2), young / (2 * (1 + poisson))",
        having("nu"),
        fields=True,
    ),
    Mutation(
        "Poisson's ratio x 1.05",
        "fem/elasticity.py",
        "return young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))",
        "return young * (p := 1.05 * poisson) / ((1 + p) * (1 - 2 * p)), young / (2 * (1 + p))",
        having("nu"),
        fields=True,
    ),
    Mutation(
        "order of the levels",
        "input/case.py",
        "points, time = (0.0, *levels), min(time, len(levels))",
        "points, time = (0.0, *levels[::-1]), min(time, len(levels))",
        levels,
    ),
    Mutation(
        "damping by the mass x 1.1",
        "dynamics/stepper.py",
        'a0 = a1 * w1 * w2 if case["damping_mass"] != WITHOUT else 0.0',
        'a0 = 1.1 * a1 * w1 * w2 if case["damping_mass"] != WITHOUT else 0.0',
        having("damping_mass"),
        quake=True,
    ),
    Mutation(
        "no water in a crack that has closed",
        "dynamics/uplift.py",
        "water.law.gapes(jump, variables)",
        "water.law.is_open(jump, variables)",
        both(having("quake_uplift", "zero"), having("law", "rupture")),
        quake=True,
    ),
    Mutation(
        "uniform pressure x 1.02",
        "joint/equilibrium.py",
        "pressure = np.full(len(face.y), self.unit_weight * level)",
        "pressure = np.full(len(face.y), 1.02 * self.unit_weight * level)",
        having("face_load", "uniform"),
    ),
    Mutation(
        "force of the upstream face on the downstream one",
        "pro/section.pro",
        '!StrCmp(force_face, "upstream") ? UP : DOWN;',
        '!StrCmp(force_face, "upstream") ? DOWN : UP;',
        having("force_face", "upstream", "downstream"),
    ),
    Mutation(
        "neck_batter x 1.02",
        "pro/section.pro",
        "down_x() += crest_x + neck_batter;",
        "down_x() += crest_x + 1.02 * neck_batter;",
        having("neck_batter"),
    ),
    Mutation(
        "grouting half a unit of t earlier",
        "laws/rupture.py",
        'p["grout_pressure"] / self.K_contact, p["grout_t"]',
        'p["grout_pressure"] / self.K_contact, p["grout_t"] - 0.5',
        having("grout_pressure"),
    ),
    Mutation(
        "joint_head_offset dropped",
        "model/loads.py",
        'reservoir = level + case["joint_head_offset"]',
        "reservoir = level",
        having("joint_head_offset"),
    ),
    Mutation(
        "weight of the rock always in equilibrium",
        "joint/equilibrium.py",
        '"foundation_y": 0.0 if case["in_situ"] else',
        '"foundation_y": 0.0 if True else',
        both(having("rho_found"), having("in_situ", 0)),
        fields=True,
    ),
    Mutation(
        "temperature of the rock x 1.1",
        "model/loads.py",
        'case["expansion_found"] * case["temperature_found"]',
        '1.1 * case["expansion_found"] * case["temperature_found"]',
        having("temperature_found"),
        fields=True,
    ),
    Mutation(
        "ends fixed along z in any 3D scene",
        "fem/bodies.py",
        'if dim == 3 and case["hold_z"]:',
        "if dim == 3:",
        both(having("dim"), having("hold_z", 0)),
        fields=True,
    ),
    Mutation(
        "sign of k_v",
        "joint/equilibrium.py",
        '"dam_y": (case["k_v"] * quake - 1) * concrete,',
        '"dam_y": (-case["k_v"] * quake - 1) * concrete,',
        having("k_v"),
    ),
    Mutation(
        "G_f of bond x 1.02",
        "laws/bond.py",
        'self.delta_c = 2 * p["G_f"] /',
        'self.delta_c = 2.04 * p["G_f"] /',
        both(having("law", "bond"), having("sigma_max")),
    ),
    Mutation(
        "sign of the vertical acceleration",
        "dynamics/record.py",
        'parts = {"both": (1, 1),',
        'parts = {"both": (1, -1),',
        having("record_component", "both"),
        quake=True,
    ),
    Mutation(
        "tangential dashpots of the joint x 1.1",
        "dynamics/stepper.py",
        'normal, tangential = case["joint_damping_n"], case["joint_damping_t"]',
        'normal, tangential = case["joint_damping_n"], 1.1 * case["joint_damping_t"]',
        having("joint_damping_t"),
        quake=True,
    ),
    Mutation(
        "critical level x 0.99",
        "studies/critical.py",
        "result = self.result(point.level, path, point)",
        "result = self.result(0.99 * point.level, path, point)",
        has_critical_level,
        critical=True,
    ),
    Mutation(
        "critical level x 1.01",
        "studies/critical.py",
        "result = self.result(point.level, path, point)",
        "result = self.result(1.01 * point.level, path, point)",
        has_critical_level,
        critical=True,
    ),
    Mutation(
        "storage in an earthquake x 1.02",
        "joint/water.py",
        'stored = self.members[0].case["storage"] * flow.points.weights',
        'stored = 1.02 * self.members[0].case["storage"] * flow.points.weights',
        having("quake_uplift", "transient"),
        quake=True,
    ),
)


def scenes_of(mutation: Mutation, seed: int, folder: Path) -> Iterator[tuple[str, RandomScene]]:
    """Names and scenes of a seed in which a mutation can matter; folder: of records."""
    draw = (lambda k: random_quake(seed, k, folder)) if mutation.quake else None
    drawn = ((k, draw(k) if draw else random_scene(seed, k)) for k in range(MOST_DRAWN))
    relevant = ((f"{seed}-{k}", scene) for k, scene in drawn if mutation.matters(scene))
    return itertools.islice(relevant, MOST_SCENES)


def look_for(mutation: Mutation, seed: int) -> dict[str, object]:
    """Run the relevant scenes with a mutation until it is noticed; returns its row."""
    row: dict[str, object] = {"mutation": mutation.name, "place": mutation.file, "relevant": 0}
    with tempfile.TemporaryDirectory(prefix="damjoint-mutation-") as name:
        folder = Path(name)
        modules = mutation.make(folder)
        os.environ |= ONE_THREAD | {"PYTHONPATH": str(modules)}
        for scene_name, scene in scenes_of(mutation, seed, folder / "records"):
            _ = scene.case  # of an earthquake it writes the record
            row["relevant"] = int(str(row["relevant"])) + 1
            out = folder / scene_name
            out.mkdir()
            try:
                findings = found_in(scene, out, mutation)
            except RunError as error:
                if str(error).startswith(REFUSED):
                    raise
                findings = [str(error)]
            shutil.rmtree(out)
            if findings:
                return row | {"scene": scene_name, "finding": findings[0]}
    return row


def found_in(scene: RandomScene, folder: Path, mutation: Mutation) -> list[str]:
    """What the verification of a scene finds."""
    if mutation.critical:
        return critical_levels(scene, folder)[0]
    run = run_of(scene, folder, fields=mutation.fields)
    wrong, remark = run.stop() if run.files.stopped else (False, "")
    return [*run.violations(), *([remark] if wrong else [])]


def look_for_number(number: int, seed: int) -> dict[str, object]:
    """`look_for` a mutation by its number, in another process."""
    return look_for(MUTATIONS[number], seed)


def mutate(seed: int, out: Path, jobs: int | None = None) -> list[dict[str, str]]:
    """Look for those mutations in the scenes of a seed that are not in the result file yet; returns
    the rows of all, in the order of MUTATIONS.

    out: CSV of COLUMNS; a row is written when a mutation is noticed, or in no scene. Raises
    InputError, also if the rows in the file were computed by other code.
    """
    now, about = provenance(), {"mutate": {"rows": len(MUTATIONS), "seed": seed}}
    with rows_session("mutate", out, COLUMNS, (), about) as (study, done):
        same_code(out, done.values(), now)
        missing = [k for k, mutation in enumerate(MUTATIONS) if mutation.name not in done]
        with process_pool(jobs or os.cpu_count() or 1) as pool:
            waiting = [pool.submit(look_for_number, k, seed) for k in missing]
            for future in track(as_completed(waiting), "mutate", len(waiting)):
                cells = future.result() | now
                study.add([str(cells.get(name, "")) for name in COLUMNS])
        done = study.file.read()
    return [done[mutation.name] for mutation in MUTATIONS]
