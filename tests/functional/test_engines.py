"""Both engines against each other: laws point by point, and complete runs."""

from dataclasses import fields

import numpy as np
import pytest
from blocks import write_blocks
from damjoint import InputError, runner
from damjoint.engines.getdp import law, solve
from damjoint.input.case import Case
from damjoint.input.resolve import load
from damjoint.laws import LAWS
from damjoint.model.results import JOINT, Results
from variants import further


def random_path(law_name: str, seed: int, case: Case) -> np.ndarray:
    """Random walk of jumps (n, 3): closes, opens, softens, breaks and slides both ways."""
    rng = np.random.default_rng(seed)
    size = {
        "rupture": case["sigma_max"] / case["K_N"],
        "friction": case["adhesion"] / (case["mu"] * case["K_N"]),
        "bond": case["G_f"] / case["sigma_max"],
        "endo": case["G_f"] / case["sigma_max"],
        "mixed": case["G_f"] / case["sigma_max"],
    }[law_name]
    walk = np.cumsum(rng.normal(size=(200, 3)), axis=0) * 0.3 * size
    walk[:, 1:] *= 5
    return walk


#: Parameters of a law that the others' tests do not admit.
OWN = {"endo": {"adhesion": 1.2 * 0.35 * 1e4}}  # between mu sigma_max and 1.41 mu sigma_max

#: Grouted in three of the path's 200 steps, sawn later, grouted again.
GROUTED = {"grout_pressure": 5e3, "grout_t": 50.0}
WORKS = {
    "untouched": {},
    "grouted": GROUTED,
    "sawn": {"saw_thickness": 3e-8, "saw_t": 100.0},
    "sawn, grouted": {"saw_thickness": 3e-8, "saw_t": 30.0} | GROUTED,
    "grouted, sawn": {"saw_thickness": 3e-8, "saw_t": 100.0} | GROUTED,
}


EXPONENTIAL = {"softening": "exponential"}


@pytest.mark.parametrize("works", WORKS)
def test_grouted_and_sawn_laws_agree_point_by_point(works):
    """The laws of both engines along one path."""
    laws_agree("rupture", 1, WORKS[works])


@pytest.mark.parametrize("seed", [0, *(pytest.param(s, marks=pytest.mark.heavy) for s in (1, 2))])
def test_a_sawn_friction_law_agrees_point_by_point(seed):
    laws_agree("friction", seed, WORKS["sawn"])


@pytest.mark.parametrize("law_name", LAWS)
@pytest.mark.parametrize("seed", [1, *(pytest.param(s, marks=pytest.mark.heavy) for s in (0, 2))])
def test_laws_agree_point_by_point(law_name, seed):
    """The laws of pro/ and of the condensed engine along one path."""
    laws_agree(law_name, seed, {})


@pytest.mark.parametrize("law_name", ["bond", "rupture", "mixed"])
@pytest.mark.parametrize("seed", [1, *(pytest.param(s, marks=pytest.mark.heavy) for s in (0, 2))])
def test_laws_of_exponential_softening_agree_point_by_point(law_name, seed):
    laws_agree(law_name, seed, EXPONENTIAL)


def laws_agree(law_name, seed, works):
    changed = (
        works
        | {
            "K_N": 1e12,
            "K_T": 5e11,
            "mu": 0.35,
            "adhesion": 1000,
            "sigma_max": 1e4,
            "G_f": 2e-4,
            "G_t": 1e-5,
            "alpha": [0.0, 1.0, 1.5][seed],
            "pena_contact": 2.0,
            "pena_tang": 1e11,
            "pena_rupture": -1.0,
        }
        | OWN.get(law_name, {})
    )
    case = load("ssnp142", changed | {"law": law_name}, [0.0] * 200)
    jumps = random_path(law_name, seed, case)
    expected = law.evaluate(law_name, jumps, settings=changed)
    model, variables = case.law, case.law.initial(1)
    scale = np.abs(expected["sigma_n"]).max()
    for i, jump in enumerate(jumps[:, None, :]):
        variables = model.begin_step(variables, i, i + 1)
        traction, _ = model.traction_and_tangent(jump, variables)
        variables = model.update_internal_variables(jump, variables)
        numbers = [n for f in fields(variables) for n in np.ravel(getattr(variables, f.name))]
        names = model.variable_names
        found = [*traction[0], *numbers[: len(names)]]
        wanted = [expected[n][i] for n in ("sigma_n", "tau_1", "tau_2", *names)]
        assert np.allclose(found[:3], wanted[:3], rtol=1e-9, atol=1e-9 * scale)
        assert np.allclose(found[3:], wanted[3:], rtol=1e-9, atol=1e-9 * np.abs(jumps).max())
        assert model.damage(jump, variables)[0] == pytest.approx(expected["damage"][i], abs=1e-9)
        assert model.is_open(jump, variables)[0] == expected["open"][i]


@pytest.mark.parametrize(
    "law_name, works",
    [
        *((name, {}) for name in LAWS),
        *(("rupture", works) for works in WORKS.values() if works),
        ("friction", WORKS["sawn"]),
        ("bond", EXPONENTIAL),
        ("mixed", EXPONENTIAL),
        ("rupture", EXPONENTIAL | WORKS["grouted, sawn"]),
    ],
)
def test_the_tangent_is_the_derivative(law_name, works):
    """Central differences, away from kinks of the law."""
    settings = (
        works
        | {"sigma_max": 1e4, "pena_tang": 1e11, "pena_rupture": -1.0, "G_f": 2e-4, "G_t": 1e-5}
        | OWN.get(law_name, {})
    )
    case = load("ssnp142", settings | {"law": law_name}, [0.0] * 200)
    model = case.law
    jumps = random_path(law_name, 7, case)
    before = 0.1 * jumps * [-1, 1, 1]
    variables = model.update_internal_variables(before, model.initial(len(jumps)))
    variables = model.begin_step(variables, 49.5, 49.8)
    step = 1e-6 * np.abs(jumps).max()
    _, tangent = model.traction_and_tangent(jumps, variables)
    agree = np.zeros(len(jumps), bool)
    for component in range(3):
        shift = np.eye(3)[component] * step
        slope = (
            model.traction_and_tangent(jumps + shift, variables)[0]
            - model.traction_and_tangent(jumps - shift, variables)[0]
        ) / (2 * step)
        close = np.abs(slope - tangent[:, :, component]).max(axis=1) < 1e-4 * case["K_T"]
        agree = close if component == 0 else agree & close
    assert agree.mean() > 0.98  # a difference may cross a kink


#: Columns of joint.csv of the same magnitude.
GROUPS = [list(JOINT)[k] for k in map(slice, (0, 5, 8, 12, 14), (5, 8, 12, 13, 15))]
GROUPS += [("slip", "lambda"), ("flux",), ("joint_thickness",)]


#: In 3D a coarser mesh.
COARSE = {"n_joint": 20.0, "n_layers": 1.0, "h_dam": 2.0, "h_found": 4.0}
THICK = COARSE | {"n_layers": 4.0}
BOND = {"law": "bond", "mu": 1.0, "adhesion": 1e4, "G_f": 1e-4, "G_t": 1e-2, "pena_rupture": -1.0}
SCENES = {
    **{letter: {} for letter in "acegijk"},
    **dict.fromkeys("bd", THICK),
    **dict.fromkeys("fh", COARSE),
    "f split": COARSE | {"mesh_pattern": "split"},
    # slides by a centimetre: rounding limits the residual before 1e-9 of the loads
    "a sliding": {"law": "friction"},
    "c without adhesion": {"adhesion": 0.0},
    "c published face": {"face_points": 2.0},
    "d published face": THICK | {"face_points": 4.0},
    "e bond": BOND,
    "f bond": COARSE | BOND,
    "e exponential": BOND | EXPONENTIAL,
    "c exponential": EXPONENTIAL | {"law": "rupture", "sigma_max": 3e3, "alpha": 1.5},
    # the crack grouted and the level lowered; the bond removed by sawing
    "a grouted": {"grout_pressure": 1e4, "grout_t": 3.5, "levels": "3,6,9,9,2"},
    "a sawn": {"saw_thickness": 1e-6, "saw_t": 2.0, "levels": "3,6,6,8"},
    "c sawn": {"saw_thickness": 1e-7, "saw_t": 3.0, "levels": "3,9,6"},
    # the first step does not converge: the weight alone is applied before it
    "g weak": {"mu": 0.06, "adhesion": 0.0, "pena_tang": 0.0, "nu": 0.3, "E": 1e10}
    | {"n_joint": 20.0, "levels": "2"},
    "c stiff, no hardening": {"K_T": 9e14, "mu": 0.06, "pena_tang": 0.0, "levels": "1,2"},
    "i soft, no strength": {"E": 1e10, "sigma_max": 0.0, "K_N": 1e11, "K_T": 5e10, "nu": 0.2},
}
#: Sections and loads of the 45 m dam: parameters, levels, tailwater.
SMALL = {"n_joint": 20.0, "h_dam": 8.0, "h_found": 30.0}
SHAPE = {"batter": 4.0, "batter_height": 20.0, "neck_height": 6.0, "neck_batter": 2.0}
POLYGON = {"batter": 2.0, "downstream_face": (30.0, 12.0, 12.0, 30.0, 6.0, 40.0)}
STAGED = {"silt_height": 12.0, "ice_force": 1e5, "ice_level": 40.0, "anchor_force": 2e6}
STAGED |= {"anchor_angle": 10.0, "k_h": 0.1, "k_v": 0.05, "floor_water": 1.0, "force_x": 3e4}
STEEP = {"batter": 5.0, "batter_height": 35.0}
HEAVY_SILT = {"silt_height": 12.0, "silt_weight": 1.0, "k_h": 0.1, "added_mass": 2.0}
WARM = {"temperature_dam": -8.0, "temperature_linear": 15.0, "temperature_found": 3.0}
#: Strong enough not to lose much in a step, which the condensed engine alone tries again by shorter
YEAR = {"temperature_period": 3.0, "joint_slope": -4.0, "adhesion": 1e6}
#: Within an element of a lift joint
STOPPED = {"joint_height": 20.0, "uplift": "waterstop", "waterstop": 5.2, "sigma_max": 2e4}
SOLID = {"dim": 3.0, "thickness": 3.0, "n_layers": 2.0, "mesh_pattern": "split", "n_joint": 10.0}
DRAINS = {"drains": 1.0, "drain_x": 6.1, "sigma_max": 1e4}
FADING = {"dam_height": 80.0, "dam_base": 60.0, "uplift": "cracked", "sigma_max": 0.0}
BROKEN = {"uplift": "cracked", "law": "friction", "adhesion": 2e5}
SECTIONS = {
    "all loads": (SHAPE | STAGED, "20,41", "0"),
    "lift, all loads": (SHAPE | STAGED | {"joint_height": 10.0, "law": "bond"}, "20,41", "0"),
    "polygon, all loads": (POLYGON | STAGED | WARM, "20,41", "0,14"),
    "solid polygon": (SOLID | POLYGON | {"joint_height": 20.0}, "20,45", "0,30"),
    "falling base": ({"joint_slope": -4.0, "law": "friction", "adhesion": 4e5}, "30,44", "2"),
    "bed below the heel": ({"joint_slope": -4.0, "floor_water": 1.0}, "30,44", "0,5"),
    "sloping lift": ({"joint_height": 20.0, "joint_slope": 3.0} | SHAPE, "30,46.5", "0,24"),
    "drains, overtopped": ({"uplift": "drained", "joint_slope": 3.0}, "20,46.5", "0,5"),
    "drains, USBR": ({"uplift": "drained", "drain_reference": "reservoir"}, "20,45", "0,5"),
    "Zangar, silt's weight": (STEEP | HEAVY_SILT, "20,41,41", "0"),
    "Zangar, lift": (SHAPE | HEAVY_SILT | {"joint_height": 8.0, "law": "rupture"}, "20,41,47", "0"),
    "cracked": ({"uplift": "cracked", "law": "rupture", "sigma_max": 1e5}, "20,40,45", "0,0,5"),
    "cracked bond": ({"uplift": "cracked", "law": "bond", "joint_slope": 2.0}, "20,40,46", "0"),
    "endo, flow": ({"law": "endo", "uplift": "flow"}, "30,41", "2"),
    "endo, cracked": ({"law": "endo", "uplift": "cracked", "G_f": 20.0}, "30,41", "0"),
    "flow driven": ({"uplift": "flow", "drive": "crest", "drive_by": 1e-3}, "20,40", "0"),
    "drains, flow": (DRAINS | {"uplift": "flow", "joint_slope": 2.0}, "30,46", "0,5"),
    "drains, flow driven": (DRAINS | {"uplift": "flow", "drive": "crest"}, "20,40", "0"),
    "drains, cracked": (DRAINS | BROKEN, "40,50", "0,5"),
    "drains, cracked beside them": (DRAINS | FADING | {"drain_x": 6.0}, "60,78", "0"),
    "drains in the crack": (DRAINS | BROKEN | {"drain_x": 1.8, "order": 1.0}, "40,48,49", "0"),
    "waterstop": (STOPPED | {"joint_slope": 6.0}, "30,47,41", "0"),
    "waterstop driven": (STOPPED | {"drive": "crest", "drive_by": 5e-4}, "40,45", "0"),
    "solid": (SOLID | SHAPE | {"joint_slope": 4.0, "silt_height": 12.0, "k_h": 0.1}, "20,41", "0"),
    "temperature": (SHAPE | WARM | {"joint_slope": 3.0, "k_h": 0.05}, "20,41", "0"),
    "temperature, lift": (WARM | {"joint_height": 10.0, "law": "bond", "order": 1.0}, "20,41", "0"),
    "a year": (WARM | YEAR, "30,44,40", "2"),
    "temperature, quadrangles": (WARM | {"mesh_pattern": "regular"}, "30,44", "2"),
    "temperature driven": (WARM | {"drive": "crest", "drive_by": 1e-3}, "20,40", "0"),
    "temperature, solid": (SOLID | SHAPE | WARM, "20,41", "0"),
    "settling rock": ({"rho_found": 2700.0, "in_situ": 0.0}, "30,44", "0"),
    "solid, waterstop": (SOLID | STOPPED | {"joint_slope": 6.0, "order": 1.0}, "30,47,41", "0"),
    "solid lift, flow": (SOLID | {"joint_height": 20.0, "uplift": "flow"}, "30,41", "0"),
}


@pytest.mark.heavy
@pytest.mark.parametrize("scene", SCENES)
def test_runs_of_both_engines_agree(scene, tmp_path):
    """joint.csv to 1e-6 of the largest jump, stress, ..."""
    settings = dict(SCENES[scene])
    agree(load(scene[0], settings, settings.pop("levels", None)), tmp_path)


@pytest.mark.heavy
@pytest.mark.parametrize("scene", SECTIONS)
def test_runs_of_both_engines_agree_on_sections_and_loads(scene, tmp_path):
    settings, levels, tails = SECTIONS[scene]
    agree(load("dam", SMALL | {"tolerance": 1e-10} | settings, levels, tails), tmp_path)


#: Dams with several joints: case, parameters, levels, tailwater. At the last level more than one
#: joint opens, softens or slips.
LIFTS = SMALL | {"lift_heights": (12.0, 25.0, 38.0)}
OF_LAWS = {"law": ("bond", "rupture", "endo", "friction"), "sigma_max": (2e5, 2e4, 2e4, 0.0)}
OF_LAWS |= {"adhesion": (2e5, 0.0, 1.9e4, 1e4), "mu": (0.8, 0.8, 0.8, 0.6)}
OF_WATER = {"uplift": ("flow", "drained", "cracked", "imposed"), "aperture_min": 5e-5}
SLOPES = {"joint_slope": (0.0, -2.0, 3.0, 0.0), "dam_crest": 6.0}
FLOW = {"uplift": "flow", "aperture_min": (1e-5, 2e-5, 1e-4, 1e-5), "K_N": (1e11, 2e11, 5e10, 1e12)}
WORKS_ON_LIFTS = {"lift_heights": (15.0, 30.0), "law": ("friction", "rupture", "friction")}
WORKS_ON_LIFTS |= {"grout_pressure": (0.0, 2e5, 0.0), "grout_t": 2.0, "saw_t": 2.0}
WORKS_ON_LIFTS |= {"saw_thickness": (0.0, 0.0, 1e-4), "sigma_max": 0.0, "adhesion": 1e5}
DRAINED = {"uplift": ("flow", "cracked", "flow", "flow"), "drains": 1.0}
DRAINED |= {"drain_x": (6.1, 4.0, 2.1, 1.0), "drain_effectiveness": 0.3}
WEAK = {"sigma_max": (2e5, 2e4, 2e4, 2e4)}
TWO_LIFTS = {"joint_height": 10.0, "lift_heights": (25.0,), "law": "friction"}
TWO_LIFTS |= {"adhesion": (1e5, 1e4)}
MONOLITHS = {"h_dam": 8.0, "h_found": 30.0}
OF_BASES = {"law": ("rupture", "bond", "friction"), "sigma_max": 2e4, "adhesion": (0.0, 2e4, 0.0)}
OF_BASES |= {"pena_tang": 1e9, "order": 2.0}
SOLID_BLOCKS = {"dim": 3.0, "n_joint": 8.0, "h_dam": 10.0, "h_found": 60.0}
SEVERAL = {
    "all loads": ("dam", LIFTS | STAGED | WARM | SLOPES | SHAPE | {"sigma_max": 2e4}, "20,45", "0"),
    "lift above a lift": ("dam", SMALL | TWO_LIFTS, "51", "0"),
    "T, laws and water": (
        "monoliths",
        MONOLITHS | OF_BASES | {"uplift": ("flow", "cracked", "none")},
        "45",
        "0",
    ),
    "T, waterstop": (
        "monoliths",
        MONOLITHS | OF_BASES | {"uplift": ("flow", "imposed", "waterstop"), "waterstop": 1.3},
        "45",
        "0",
    ),
}
HEAVY = {
    "laws and water": ("dam", LIFTS | OF_LAWS | OF_WATER | SLOPES | SHAPE, "30,47", "2"),
    "drains": ("dam", LIFTS | FLOW | WEAK | DRAINED, "30,49.3", "0,3"),
    "crest driven": ("dam", LIFTS | WEAK | {"drive": "crest", "drive_by": 6e-3}, "40,41", "0"),
    "grouted, sawn": ("dam", SMALL | WORKS_ON_LIFTS, "30,40,50", "0"),
    "lifts": ("lifts", SMALL | WEAK, "30,45,48.5", "0"),
    "flow": ("dam", LIFTS | FLOW | WEAK, "30,49.3", "0,3"),
    "heel driven": ("dam", LIFTS | WEAK | {"drive": "heel", "drive_by": 2e-4}, "40,46", "0"),
    "T": ("monoliths", MONOLITHS, "45", "0"),
    "T, solid": ("monoliths", SOLID_BLOCKS, "45", "0"),
    "T, solid, flow": (
        "monoliths",
        SOLID_BLOCKS
        | {"uplift": ("flow", "flow", "none"), "aperture_min": (1e-4, 2e-4, 1e-4), "order": 1.0},
        "45",
        "0",
    ),
    "T, solid, waterstop": (
        "monoliths",
        SOLID_BLOCKS
        | {"uplift": ("imposed", "imposed", "waterstop"), "waterstop": 1.3, "order": 1.0},
        "45",
        "0",
    ),
    "T, solid, laws": (
        "monoliths",
        SOLID_BLOCKS | OF_BASES | {"uplift": "none", "order": 1.0},
        "45",
        "0",
    ),
    "solid": ("lifts", SOLID | WEAK | {"h_dam": 10.0, "h_found": 60.0}, "30,49", "0"),
}


@pytest.mark.parametrize("scene", further(1, SEVERAL | HEAVY))
def test_runs_of_both_engines_agree_on_several_joints(scene, tmp_path):
    name, settings, levels, tails = (SEVERAL | HEAVY)[scene]
    (result,) = agree(load(name, {"tolerance": 1e-10} | settings, levels, tails), tmp_path)
    assert sum(map(changed, result.joints)) > 1


@pytest.mark.heavy
@pytest.mark.parametrize("tail", ["0", "15"])
def test_runs_of_both_engines_agree_on_uplift_between_ends_that_are_not_level(tail, tmp_path):
    """Across a valley: parts of heel and toe are dry. Uniform loads: no waterline in elements."""
    coarse = {"n_joint": 6.0, "h_dam": 12.0, "h_found": 40.0, "face_load": "uniform"}
    case = load("valley", coarse | {"tolerance": 1e-10}, "20,30", tail)
    (result,) = agree(case, tmp_path)
    assert changed(result)


def changed(results):
    """Whether a joint is open, softens or slips at the end."""
    return any(results.last[name] for name in ("crack_length", "process_zone", "slip_length"))


@pytest.mark.parametrize(
    "settings, message",
    [
        (SOLID | {"uplift": "waterstop"}, "order = 2: must be 1 .* uplift = waterstop in 3D"),
        (SOLID | {"uplift": "flow", "drains": 1.0}, "drains = 1: .* and uplift = flow in 3D"),
    ],
)
def test_water_that_getdp_does_not_have_is_refused(settings, message):
    with pytest.raises(InputError, match=message):
        solve.check(load("dam", settings))


def test_runs_of_both_engines_agree_on_a_grouted_contraction_joint(tmp_path):
    """SSNP143: two bodies on strong joints, without water."""
    agree(load("ssnp143", {"tolerance": 1e-10}), tmp_path)


#: Four blocks, two by two: four bodies share the node in the middle, three each node below it.
CROSS = {
    "lower left": (0, 0, 5, 10),
    "lower right": (5, 0, 10, 10),
    "upper left": (0, 10, 5, 18),
    "upper right": (5, 10, 10, 18),
}
CROSS_JOINTS = {
    "left base": (0, 0, 5, 0),
    "right base": (5, 0, 10, 0),
    "left lift": (0, 10, 5, 10),
    "right lift": (5, 10, 10, 10),
    "lower contraction": (5, 0, 5, 10),
    "upper contraction": (5, 10, 5, 18),
}


@pytest.mark.heavy
def test_runs_of_both_engines_agree_where_four_bodies_meet(tmp_path):
    """The crest is the end of a joint, too."""
    write_blocks(tmp_path / "own.msh", CROSS, CROSS_JOINTS, size=2.0, crest=5)
    (tmp_path / "own.case").write_text('geometry = "own.msh";')
    laws = ("friction", "bond", "bond", "friction", "rupture", "friction")
    water = ("imposed", "flow", "cracked", "none", "none", "none")
    strengths = {"sigma_max": 1e4, "adhesion": 1e3, "pena_tang": 1e9, "order": 2.0}
    strengths["mu"] = (0.3, 0.8, 0.3, 0.3, 0.8, 0.3)
    settings = {"law": laws, "uplift": water, "tolerance": 1e-10, **strengths}
    case = load(str(tmp_path / "own.case"), settings, "10,18")
    (result,) = agree(case, tmp_path)
    assert len(result.joints) == 6 and sum(map(changed, result.joints)) > 2


BLOCKS = {"left": (0, 0, 10, 10), "right": (10, 0, 15, 10)}
BLOCK_JOINTS = {
    "left base": (0, 0, 10, 0),
    "right base": (10, 0, 15, 0),
    "contraction": (10, 10, 10, 0),
}
#: Uplift of these joints, and other settings.
NETWORKS = {
    "mixed": (("flow", "imposed", "cracked"), {}),
    "drained, driven": (
        ("imposed", "drained", "none"),
        {"drain_x": 1.0, "drive": "crest", "drive_by": 5e-4},
    ),
    "apertures in series": (("flow", "flow", "none"), {"K_N": (1e12, 2e12, 1e12)}),
    "three joints": (("flow", "flow", "flow"), {}),
    "cracked": (("cracked", "cracked", "cracked"), {}),
    "imposed": (("imposed", "imposed", "imposed"), {}),
    "up to a waterstop": (("waterstop", "flow", "none"), {"waterstop": 2.0}),
    "waterstop behind a joint": (("flow", "waterstop", "none"), {"waterstop": 2.3}),
    "imposed up to a waterstop": (("imposed", "waterstop", "imposed"), {"waterstop": 2.3}),
    "up to a dry joint": (("imposed", "none", "imposed"), {}),
    "drained": (("drained", "drained", "none"), {"drain_x": (3.0, 1.0, 1.0)}),
    "driven": (("flow", "cracked", "none"), {"drive": "crest", "drive_by": 5e-4}),
}


@pytest.mark.heavy
@pytest.mark.parametrize("scene", NETWORKS)
def test_runs_of_both_engines_agree_on_water_where_joints_meet(scene, tmp_path):
    write_blocks(tmp_path / "own.msh", BLOCKS, BLOCK_JOINTS)
    (tmp_path / "own.case").write_text('geometry = "own.msh";')
    uplift, more = NETWORKS[scene]
    settings = {"law": "bond", "sigma_max": 1e4, "adhesion": (5e3, 5e3, 1e4), "G_f": 30.0}
    settings |= {"mu": (0.5, 0.4, 0.3), "order": 1.0, "tolerance": 1e-10, "uplift": uplift}
    settings |= {"aperture_min": (1e-4, 2e-4, 3e-4)} | more
    case = load(str(tmp_path / "own.case"), settings, "6,9", "1,2")
    (result,) = agree(case, tmp_path)
    assert any(map(changed, result.joints))


@pytest.mark.heavy
@pytest.mark.parametrize("uplift", ["flow", "imposed", ["flow", "imposed", "cracked"]])
def test_runs_of_both_engines_agree_while_water_reaches_a_second_heel(uplift, tmp_path):
    """That of the contraction joint, on the crest."""
    write_blocks(tmp_path / "own.msh", BLOCKS, BLOCK_JOINTS)
    (tmp_path / "own.case").write_text('geometry = "own.msh";')
    settings = {"law": "bond", "sigma_max": (1e4, 1e4, 1e6), "adhesion": 1e6, "G_f": 300.0}
    settings |= {"order": 1.0, "tolerance": 1e-10, "uplift": uplift}
    settings |= {"aperture_min": (1e-4, 2e-4, 3e-4)}
    agree(load(str(tmp_path / "own.case"), settings, "5,9,12", "1,1,2"), tmp_path)


@pytest.mark.heavy
def test_networks_that_one_engine_can_not_compute_are_refused(tmp_path):
    """A second toe, on the crest; joints in 3D that do not lie side by side."""
    joints = BLOCK_JOINTS | {"contraction": (10, 0, 10, 10)}
    write_blocks(tmp_path / "own.msh", BLOCKS, joints)
    (tmp_path / "own.case").write_text('geometry = "own.msh";')
    words = r"uplift = flow: must be none in one of .* \(left base and right base and contraction\)"
    case = load(str(tmp_path / "own.case"), {"uplift": "flow"}, "12")
    with pytest.raises(InputError, match=f"{words}.*as water leaves at more than one toe"):
        solve.check(case)
    water = {"dim": 3.0, "uplift": "imposed", "n_joint": 6.0, "h_dam": 12.0, "h_found": 40.0}
    with pytest.raises(InputError, match="as they do not lie side by side"):
        solve.check(load("monoliths", water))


@pytest.mark.heavy
def test_a_face_that_is_not_divided_where_bodies_meet_is_refused(tmp_path):
    """Its elements are those of a single curve of the mesh."""
    path, joints = tmp_path / "own.msh", {"base": (0, 0, 10, 0), "lift": (0, 5, 10, 5)}
    write_blocks(path, {"low": (0, 0, 10, 5), "high": (0, 5, 10, 12)}, joints)
    (tmp_path / "own.case").write_text('geometry = "own.msh"; levels() = {5};')
    solve.check(load(str(tmp_path / "own.case")))
    lines = path.read_text().splitlines()
    (upstream,) = (line.split()[1] for line in lines if line.endswith('"upstream"'))
    fields = [line.split() for line in lines]
    for line in fields:
        if line[1:4] == ["1", "2", upstream]:  # a line of this group
            line[4] = "1000"
    path.write_text("\n".join(map(" ".join, fields)) + "\n")
    with pytest.raises(InputError, match=r"a face of dam.*divided where the body ends"):
        solve.check(load(str(tmp_path / "own.case")))


#: Columns of water in time in every step, and those whose largest value they are compared with.
WATER = {"water": "water", "water_in": "water", "void": "water", "p_max": "p_max", "p_min": "p_max"}
WATER |= {"Re": "Re"}


def difference(one, other):
    """The largest difference of two columns; 0 where both have no value."""
    assert (np.isnan(one) == np.isnan(other)).all()
    return np.nan_to_num(np.abs(one - other)).max()


def agree(case, tmp_path):
    """Assert equal joint.csv to 1e-6 of the largest jump, stress, ..., and equal resultants of all
    joints. Returns the results of the condensed engine.
    """
    reference, fast = (
        runner.run(case, tmp_path / name, fields=False, picture=False, progress=False, engine=name)
        for name in ("getdp", "condensed")
    )
    for a, b in zip(reference, fast, strict=True):
        assert not a.stopped and not b.stopped
        for time in a.case.requested:
            for table in Results.at, Results.at_extrapolated:
                rows = table(a, time), table(b, time)
                for group in GROUPS:
                    there = [column for column in group if column in rows[0]]
                    sizes = [np.nanmax(np.abs(rows[0][column])) for column in there]
                    for column in there:
                        worst = difference(rows[0][column], rows[1][column])
                        assert worst <= 1e-6 * max(sizes), (time, column)
        for name, of_scale in WATER.items() if "water" in a.history else ():
            scale = np.abs(b.history[of_scale]).max()
            assert a.history[name] == pytest.approx(b.history[name], abs=1e-6 * scale), name
        if "water" in a.history:  # at the toe, of the largest flux
            largest = b.history["Re"].max() * b.case["visc"] / 2
            assert a.history["flux"] == pytest.approx(b.history["flux"], abs=1e-6 * largest)
        for one, other in zip(a.joints, b.joints, strict=True):
            scale = np.abs([one.last["N"], one.last["T"], one.last["U"]]).max()
            for name in ("N", "T", "U", *(["T_z"] if one.case["dim"] == 3 else [])):
                assert one.last[name] == pytest.approx(other.last[name], abs=1e-6 * scale)
            moment = pytest.approx(other.last["M_U"], abs=1e-6 * scale * one.case.joint_along)
            assert one.last["M_U"] == moment
            for name in ("crack_length", "process_zone", "broken_length", "bonded_length"):
                reach = 1e-6 * one.case.joint_along
                assert one.last[name] == pytest.approx(other.last[name], abs=reach), name
    return fast


#: Water in time on a dam of 28 m without tension: parameters and levels.
IN_TIME = {
    "voids": ({"time_unit": 1.0, "storage": 1e-11, "pressure_min": -1e5}, (30.0, 44.0, 20.0)),
    "in a lift": (
        {"time_unit": 20.0, "lift_heights": (15.0,), "uplift": ("none", "flow")},
        (30.0, 44.0),
    ),
    "drains": (
        {"time_unit": 600.0, "drains": 1.0, "drain_x": 4.0, "drain_effectiveness": 0.7},
        (30.0, 44.0),
    ),
    "drains and voids": (
        {"time_unit": 1.0, "storage": 1e-11, "pressure_min": -1e5, "drains": 1.0, "drain_x": 4.0},
        (30.0, 44.0, 20.0),
    ),
    "inclined": (
        {"time_unit": 1.0, "storage": 1e-11, "pressure_min": -1e5, "joint_slope": 3.0},
        (30.0, 44.0, 20.0),
    ),
    # air enters at the dry toe, and a node gives no more water than it has
    "inclined, drains and air": (
        {
            "dam_height": 6.71,
            "dam_base": 5.3,
            "dam_crest": 0.414,
            "joint_slope": 3.36,
            "drains": 1.0,
        }
        | {"drain_effectiveness": 0.8, "pressure_min": -1e5, "time_unit": 2400.0}
        | {"law": "bond", "n_joint": 8.0, "aperture_min": 8.85e-5},
        (6.8,),
    ),
    "a crack that fills": ({"time_unit": 600.0, "storage": 1e-12, "order": 2.0}, (30.0, 44.0)),
    "a film that closes": ({"time_unit": 5.0, "storage": 1e-12}, (30.0, 44.0, 20.0)),
    "steady before": ({"time_unit": 60.0, "time_start": 1.0, "weight_first": 1.0}, (30.0, 44.0)),
}


@pytest.mark.heavy
@pytest.mark.parametrize(
    "scene",
    IN_TIME,
)
def test_runs_of_both_engines_agree_on_water_in_time(scene, tmp_path):
    settings, levels = IN_TIME[scene]
    dam = {"law": "friction", "adhesion": 0.0, "mu": 1.5, "dam_base": 28.0, "n_joint": 10.0}
    case = load("dam", dam | {"uplift": "flow"} | settings, levels, None, 5)
    (fast,) = agree(case, tmp_path)
    if scene == "voids":
        assert fast.history["void"].max() > 1e-6


@pytest.mark.parametrize("settings", [{"pressure_step": 1e4}, {"drive": "heel"}])
def test_water_in_time_that_one_engine_can_not_compute_is_refused(settings):
    case = load("dam", {"uplift": "flow", "time_unit": 60.0} | settings, (30.0, 40.0))
    (name,) = settings
    with pytest.raises(
        InputError, match=f"time_unit = 60: must be 0 with engine = getdp and {name}"
    ):
        solve.check(case)
