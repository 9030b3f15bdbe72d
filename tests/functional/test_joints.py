"""Dams with several joints: statics of each, which one fails, closed forms."""

import numpy as np
import pytest
from damjoint import InputError
from damjoint.input.resolve import load
from damjoint.joint.interface import interface_of
from damjoint.mesh.mesh import Mesh
from damjoint.model.results import column_of
from damjoint.pictures import run_picture
from damjoint.post import stored
from damjoint.solver.load_stepper import LoadStepper
from damjoint.statics import gravity
from damjoint.statics.statement import statement
from damjoint.statics.verdict import decisive_joint, failed, verdict
from damjoint.studies.check import FINITE_ELEMENTS, GRAVITY, compare_joints
from scipy.optimize import brentq
from sections import resultants

LIFTS = (12.0, 25.0, 38.0)
COARSE = {"n_joint": 24.0, "order": 1.0}
#: Contact and friction only, without hardening.
DRY_FRICTION = {"law": "friction", "adhesion": 0.0, "pena_tang": 0.0, "uplift": "none"}
#: A section with batter, neck and joints of different slopes.
SLOPES = {
    "batter": 4.0,
    "batter_height": 18.0,
    "neck_height": 5.0,
    "dam_crest": 6.0,
    "joint_slope": (3.0, -2.0, 4.0, 0.0),
    "silt_height": 15.0,
    "k_h": 0.05,
    "anchor_force": 1e5,
}


def solved(levels, case="dam", **settings):
    """The results of a case with lift joints."""
    case = load(case, COARSE | {"lift_heights": LIFTS} | settings, levels)
    return LoadStepper(case, interface_of(case)).run()


@pytest.mark.heavy
def test_elements_of_a_coarse_joint_below_a_fine_crest():
    """The joint's size holds where that of the crest is smaller."""
    lift = COARSE | {"n_joint": 10.0, "lift_heights": (15.0,)}
    fine, equal = (Mesh(load("dam", lift | {"h_dam": size})).counts for size in (2.0, 3.4))
    assert fine == equal


@pytest.mark.heavy
@pytest.mark.parametrize("uplift", ["none", "imposed"])
def test_resultants_of_each_joint_are_those_of_statics(uplift):
    results = solved([30, 42], uplift=uplift, K_N=(1e11, 2e11, 5e10, 1e12), **SLOPES)
    assert len(results.joints) == 4
    for own in results.joints:
        for row, level in enumerate((30.0, 42.0)):
            time = row + 1.0
            block = gravity.with_crack(own.case, time, level, 0.0)
            computed = [own.history[name][row] for name in "NTMU"]
            scale = abs(block.N) * np.array([1, 1, own.case.joint_length, 1])
            assert np.abs(computed - np.array([block.N, block.T, block.M, block.U])).max() < (
                1e-9 * scale.max()
            )


@pytest.mark.heavy
@pytest.mark.parametrize("pattern", ["layers", "free"])
def test_resultants_of_each_joint_in_3d(pattern):
    solid = {"dim": 3.0, "mesh_pattern": pattern, "n_joint": 8.0, "thickness": 6.0}
    results = solved([42], uplift="imposed", **(solid | SLOPES))
    for own in results.joints:
        block = gravity.with_crack(own.case, 1.0, 42.0, 0.0)
        computed = [own.last[name] for name in "NTU"]
        assert computed == pytest.approx([block.N, block.T, block.U], rel=1e-6)


@pytest.mark.parametrize("joint", range(4))
def test_gravity_method_lift_by_lift(joint):
    """By a quadrature over the outline above the joint; the earthquake acts in full."""
    flat = SLOPES | {"joint_slope": (0.0, -2.0, 4.0, 0.0)}
    case = load("dam", flat | {"lift_heights": LIFTS, "uplift": "none", "added_mass": 0.0}, [42.0])
    own = case.joints[joint]
    block = gravity.with_crack(own, 1.0, 42.0, 0.0)
    exact = resultants(own, 42.0, 0.0)
    assert np.allclose([block.N, block.T, block.M], exact, rtol=1e-9, atol=0)


@pytest.mark.heavy
@pytest.mark.parametrize("weakest", [3, 1, 2])
def test_lowest_closed_form_of_friction_joints_fails_and_is_named(weakest):
    """T = mu N' on each joint; the weakest has half of the friction that the others need."""
    mu = [2.0, 2.0, 2.0, 2.0]
    mu[weakest] = (0.75, 0.65, 0.6, 0.4)[weakest]
    case = load("dam", COARSE | DRY_FRICTION | {"lift_heights": LIFTS, "mu": tuple(mu)}, [80.0])

    def excess(level, own):
        block = gravity.with_crack(own, 1.0, level, 0.0)
        return block.T - own["mu"] * block.N

    exact = {}
    for name, own in zip(case.joint_names, case.joints, strict=True):
        if excess(80.0, own) > 0:
            exact[name] = brentq(excess, 10, 80, args=(own,))
    name = min(exact, key=exact.get)
    assert name == case.joint_names[weakest]
    results = LoadStepper(case, interface_of(case)).run()
    assert verdict(results) == f"sliding on {name}"
    assert results.last["level"] == pytest.approx(exact[name], rel=1e-3)


@pytest.mark.heavy
@pytest.mark.parametrize("hardening, fails", [((-1.0, 1e9), False), ((1e9, -1.0), True)])
def test_a_joint_slides_on_a_hardening_that_is_not_set_for_it(tmp_path, hardening, fails):
    """The lift at 25 m slips along its whole length, T > mu N; its own pena_tang decides."""
    from damjoint import runner
    from damjoint.studies.critical import Search

    settings = COARSE | DRY_FRICTION | {"lift_heights": (25.0,), "mu": (2.0, 0.3)}
    case = load("dam", settings | {"pena_tang": hardening}, [44.0])
    (result,) = runner.run(case, tmp_path, False, False, False)
    for results in (result, stored.read(tmp_path).result):
        assert failed(results) == fails
        assert ("numerical default" in statement(results)) == fails
    # a critical value does not rely on it
    used = tuple(max(value, 0.0) for value in hardening)
    assert Search(case, "level").settings["pena_tang"] == used


@pytest.mark.heavy
def test_strong_joints_tend_to_the_monolith():
    """The crest's displacement, with an error of first order in the joints' compliance."""
    crest = []
    for stiffness in (1e13, 1e14, 1e15):
        strong = {"K_N": stiffness, "K_T": stiffness, "law": "friction", "adhesion": 1e30}
        crest.append(solved([40], uplift="none", **strong).last["crest_ux"])
    first, second = np.diff(crest)
    assert abs(second / crest[-1]) < 1e-3
    assert first / second == pytest.approx(10, rel=0.02)


def test_flow_in_each_joint_has_its_own_heads():
    """Leakage of closed joints: rho g H w^3 / (12 eta L), H of the heel above the toe."""
    apertures = (1e-4, 2e-4, 3e-4, 1e-4)
    strong = {"law": "friction", "adhesion": 1e30}
    results = solved([40], uplift="flow", aperture_min=apertures, **strong)
    case = results.case
    closed = [k for k, own in enumerate(results.joints) if own.at()["delta_n"].max() <= 0]
    assert len(closed) >= 2
    for k in closed:
        own = case.joints[k]
        head = max(40 - max(0.0, own.section["toe_y"][0]), 0)  # a dry toe has its own height
        flux = 1000 * 1000 * 9.81 * head * apertures[k] ** 3 / (12e-3 * own.joint_along)
        assert results.last[column_of("flux", k)] == pytest.approx(flux, rel=1e-9)


def test_the_table_has_the_rows_of_each_joint():
    results = solved([40], law=("bond", "friction", "bond", "rupture"))
    rows = results.at()
    assert set(rows["joint"]) == {1, 2, 3, 4}
    for own, height in zip(results.joints, (0.0, *LIFTS), strict=True):
        joint = own.at()
        assert np.allclose(joint["y"], height)
        assert np.all(np.diff(joint["s"]) > 0)
        assert ("lambda" in joint) == (own.case["law"] == "friction")
    assert np.isnan(rows["lambda"][rows["joint"] != 2]).all()


def test_the_joint_of_the_least_factor_speaks_for_a_dam_that_stands():
    """Though another one has slipped farther; with the coefficient of each joint."""
    strength = {"mu": (0.1, 1.0, 0.65, 1.0), "adhesion": (5.5e5, 0.0, 0.0, 0.0)}
    results = solved([40], law="friction", **strength)
    factors = [
        (j.case["mu"] * j.last["N"] + j.case["adhesion"] * j.case.joint_length) / j.last["T"]
        for j in results.joints
    ]
    slipped = [j.last["slip_length"] / j.case.joint_length for j in results.joints]
    assert verdict(results) == "stands"
    assert decisive_joint(results) == np.argmin(factors) != np.argmax(slipped)
    assert run_picture.facts_of(results)[1].startswith("lift 12 m: ")


@pytest.mark.heavy
def test_a_run_is_read_as_it_was_written(tmp_path):
    from damjoint import runner

    case = load("dam", COARSE | {"lift_heights": LIFTS, "mu": (0.9, 1.0, 0.8, 1.0)}, [40.0])
    (result,) = runner.run(case, tmp_path, progress=False)
    solution = stored.read(tmp_path)
    again = solution.result
    assert again.case.joint_names == case.joint_names
    for own, other in zip(result.joints, again.joints, strict=True):
        assert own.case.values == other.case.values
        assert own.case.section == other.case.section
        assert np.allclose(own.at()["sigma_n"], other.at()["sigma_n"], rtol=1e-9)
    assert set(solution.bodies) >= {"dam", "dam 4", "foundation", "joint", "joint 4"}
    assert set(solution.fields[1.0].displacement) == {
        *("dam", "dam 2", "dam 3", "dam 4", "foundation")
    }


def test_check_has_a_row_per_joint_by_both_methods():
    results = solved([42], uplift="none", law="friction", adhesion=1e30)
    checks = compare_joints(results)
    assert [check.gravity.joint for check in checks] == list(results.case.joint_names)
    for check in checks:
        rows = {row["answer"]: row for row in check.rows}
        elements, rigid = rows[FINITE_ELEMENTS], rows[GRAVITY]
        assert all(elements[n] == pytest.approx(rigid[n], rel=1e-8) for n in "NTM")
        assert elements["OSF"] == pytest.approx(rigid["OSF"], rel=1e-8)


def test_settings_of_a_joint_apply_to_it_alone():
    """A joint without tensile strength at 25 m opens, the others do not."""
    weak = {"sigma_max": (5e6, 5e6, 0.0, 5e6), "adhesion": (1e6, 1e6, 1e4, 1e6)}
    weak["G_f"] = (1e6, 1e6, 10.0, 1e6)
    results = solved([60], uplift="none", law="bond", **weak)
    cracks = [own.last["crack_length"] for own in results.joints]
    assert cracks[2] > 1
    assert cracks[0] == cracks[1] == cracks[3] == 0


@pytest.mark.parametrize(
    "settings, words",
    [
        ({"mu": (0.9, 1.0)}, "mu = 0.9,1.0: must be one value, or as many as there are joints (4)"),
        ({"lift_heights": (25.0, 12.0, 38.0)}, "lift_heights = 25,12,38: must increase"),
        (
            {"lift_heights": (12.0, 25.0, 50.0)},
            "lift_heights = 12,25,50: each must be > 0 and < dam_height (45 m)",
        ),
        ({"E_dam": (1e10, 2e10, 1e10, 1e10)}, "E_dam = 1"),
        ({"mu": (0.9, -1.0, 1.0, 1.0)}, "mu = -1: must be"),
        ({"mesh_pattern": "regular"}, "mesh_pattern = regular: must be"),
        ({"joint_slope": (20.0, -20.0, 0.0, 0.0)}, "lift_heights = 12,25,38: must increase"),
    ],
)
def test_bad_input_of_several_joints(settings, words):
    with pytest.raises(InputError) as error:
        load("dam", {"lift_heights": LIFTS} | settings)
    assert words in str(error.value)


def test_a_case_file_with_lists(tmp_path):
    path = tmp_path / "own.case"
    path.write_text(
        'lift_heights() = {12, 25};\nlaw() = {"bond", "friction", "bond"};\n'
        "default_mu = 0.7;\nmu() = {0.9, 2 * 0.5, 1};\nadhesion() = {1e5, 0, 0};\n"
        "default_adhesion = 3e5;\n"
    )
    case = load(str(path))
    assert case.joint_names == ("base", "lift 12 m", "lift 25 m")
    assert [own["law"] for own in case.joints] == ["bond", "friction", "bond"]
    assert [own["mu"] for own in case.joints] == [0.9, 1.0, 1.0]
    assert [own["adhesion"] for own in case.joints] == [3e5] * 3  # the later statement
    assert [own["mu"] for own in load(str(path), {"mu": 0.6}).joints] == [0.6] * 3
    path.write_text("E_dam() = {1e10, 2e10};")
    with pytest.raises(InputError, match=r"line 1: .*E_dam = .*: must be a single value"):
        load(str(path))


@pytest.mark.heavy
def test_the_mesh_of_one_joint_does_not_depend_on_an_earlier_mesh_of_several():
    one, several = load("dam", COARSE), load("dam", COARSE | {"lift_heights": LIFTS})
    before, _, after = Mesh(one), Mesh(several), Mesh(one)
    assert np.array_equal(before.bodies["dam"].points, after.bodies["dam"].points)


#: Random dams of an earlier draw, and the levels of the reservoir and the tail water: with three
#: lifts, and with one.
LIFTED = {"dam_height": 11.6, "order": 1, "n_joint": 10, "dam_base": 8.76, "dam_crest": 0.584}
LIFTED |= {"E": 1.57e9, "nu": 0.323, "found_side": 11.6, "found_depth": 11.6, "batter": 1.15}
LIFTED |= {"batter_height": 8.92, "lift_heights": (3.109, 6.511, 9.788), "law": "friction"}
LIFTED |= {"K_N": (1.13e9, 2.58e8, 5.12e13, 1.44e9), "K_T": (1.3e9, 3.87e8, 1.01e14, 7.56e8)}
LIFTED |= {"sigma_max": 0, "adhesion": (0, 0, 195000, 0), "mu": (0.377, 0.442, 0.495, 0.884)}
LIFTED |= {"pena_tang": (6.5e7, -1, 0, -1), "anchor_force": 40400, "anchor_angle": 0.579}
LIFTED |= {"k_h": 0.152, "k_v": 0.0179, "added_mass": 1, "quake_uplift": "unchanged"}
LIFTED |= {"uplift": ("imposed", "drained", "flow", "cracked"), "joint_slope": (0, -4.56, 0, -1.1)}
LIFTED |= {"weight_first": 1, "aperture_min": (1e-5, 5.33e-6, 1.82e-7, 4.22e-7)}
LIFTED |= {"drains": (0, 1, 0, 1), "drain_x": (2.17, 1.08, 1.48, 0.119)}
HELD = {"dam_height": 14.6, "n_joint": 40, "dam_base": 9.19, "dam_crest": 0.474, "neck_height": 1.8}
HELD |= {"E": 4.39e9, "nu": 0.0131, "E_found": 5.43e11, "found_side": 14.6, "found_depth": 14.6}
HELD |= {"law": "rupture", "softening": "exponential", "alpha": (0, 2), "lift_heights": (12.21,)}
HELD |= {"K_N": (2.8e9, 3.61e9), "K_T": (7.64e8, 2.93e9), "sigma_max": (550000, 0)}
HELD |= {"pena_rupture": (9.3, 0.703), "joint_slope": (0, -17), "uplift": ("imposed", "none")}
HELD |= {"ice_force": 6200, "k_h": 0.0608, "k_v": 0.00835, "added_mass": 2, "weight_first": 1}


@pytest.mark.parametrize(
    ("settings", "levels", "failure", "factor"),
    [
        pytest.param(
            *(LIFTED, "7.73,0", "sliding on lift 3.109 m", "SSF"), marks=pytest.mark.heavy
        ),
        (HELD, "13.9,1.63", "overturning on lift 12.21 m", "OSF"),
    ],
)
def test_the_joint_that_fails_is_named(settings, levels, failure, factor, solve):
    """Not one that slips on a hardening of its own, nor one that its tension holds: by statics
    without them the base would have failed first.
    """
    (result,) = solve("dam", *levels.split(","), 1, **settings)
    assert verdict(result) == failure
    level = result.last["level"]
    base, lift = (getattr(gravity.at(own, 1, level), factor) for own in result.case.joints[:2])
    assert base < lift and lift == pytest.approx(1, abs=0.021)
