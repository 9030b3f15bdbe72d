"""Random earthquakes verified from their result files, and the verification with altered files."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from damjoint.dynamics.frames import MOST_FRAMES
from damjoint.input.resolve import load
from damjoint.post.tables import EXACT, write_csv
from damjoint.studies import quake_study
from damjoint.studies.quake_study import Options
from damjoint_tools import (
    quake_comparison,
    quake_equations,
    random_quakes,
    random_scenes,
    stress,
    trust,
)
from damjoint_tools.random_quakes import RandomQuake, random_quake
from damjoint_witness import earthquake as witness_of_quakes
from damjoint_witness import water_in_motion, water_in_time
from damjoint_witness.files import Files, read_table
from damjoint_witness.verify import Witness
from quakes import BLOCK, DAM, earthquake, mean_slip, smooth_record, write_record
from variants import further


def verified_quake(settings, level, record, folder):
    """The verification of an earthquake."""
    scene = RandomQuake(settings, level, "0", 1, np.zeros((0, 3)), record)
    case = load("dam", settings, level, "0", 1, record=record)
    quake_study.run(replace(case, all_steps=True), folder, Options(picture=False, progress=False))
    files = Files(folder, tuple(scene.words))
    failed = files.record["verdict"] in ("not at rest", "broken without friction")
    return Witness(replace(files, exit_code=int(failed)))


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The verification of an earthquake of a dam with two joints."""
    folder = tmp_path_factory.mktemp("quake")
    record = smooth_record(folder / "wave.csv", 6.0, duration=0.6)
    settings = {"lift_heights": (20.0,), "law": ("friction", "bond"), "batter": 2.0}
    settings |= {"batter_height": 30.0, "added_mass": 2.0, "adhesion": (1e4, 1e5), "G_t": (50, 50)}
    settings |= {"damping_mass": 2.0, "record_rest": 0.6, "joint_damping_n": 1e8}
    return verified_quake(DAM | settings, "35", record, folder / "out")


@pytest.mark.heavy
def test_the_files_of_an_earthquake_violate_no_rule(files):
    assert files.violations() == []
    rows = files.shaken.rows
    assert np.abs(rows["slip_mean"]).max() > 1e-3 and 50 < len(files.shaken.frames) <= MOST_FRAMES
    # the inertia of the whole dam, with its water, is the change of the shear force
    assert np.ptp(rows["T_inertia"]) > 0.5 * files.shaken.size


@pytest.mark.parametrize("certain, found", [((True, True), 1), ((True, False), 0)])
def test_a_dam_stands_if_it_certainly_does_on_every_joint(files, monkeypatch, certain, found):
    """On one joint it may, while another one slides away (random earthquake 141-213)."""
    whole, steps = files.shaken, read_table(files.files.folder / "steps.csv")
    monkeypatch.setitem(whole.files.record["quake"], "after", {"equilibrium": False})
    monkeypatch.setattr(witness_of_quakes, "equilibrium_is_certain", lambda j: certain[j.number])
    assert len(list(witness_of_quakes.standing(whole, steps))) == found


@pytest.mark.parametrize(
    "name, wrong, part",
    [
        ("mass_damping", lambda joint: 0.0, "T"),
        ("forces_of", lambda joint, steps: (forces(joint, steps)[0], np.zeros((1, 3))), "N"),
    ],
)
def test_damping_and_dashpots_are_in_the_balance_of_momentum(files, monkeypatch, name, wrong, part):
    monkeypatch.setattr(witness_of_quakes, name, wrong)
    assert any(f"momentum: {part} is off" in line for line in files.violations())


forces = witness_of_quakes.forces_of


@pytest.mark.parametrize("number", further(1, [1, 0]))
@pytest.mark.parametrize(
    "table, column, change, message",
    further(
        3,
        [
            ("steps", "tau_1", lambda v: v * 1.0001, "shear stress off"),
            ("quake_joint", "p", lambda v: v * 1.01, "the integral of p"),
            ("quake", "T", lambda v: v + 100 * (np.arange(len(v)) == 60), "momentum: T is off"),
            ("quake", "N", lambda v: v * 1.0001, "momentum: N is off"),
            ("quake", "M", lambda v: v * 1.0001, "momentum: M is off"),
            ("quake", "T_inertia", lambda v: v * 1.0001, "momentum: T is off"),
            ("quake", "slip_mean", lambda v: v * 1.01, "residual slip is not"),
            ("quake_joint", "sigma_n_eff", lambda v: v * 1.01, "sigma_n_eff of quake_joint.csv"),
            ("steps", "sigma_n_eff", lambda v: v * 1.0001, "normal stress off"),
            ("quake_joint", "delta_n", lambda v: v * 1.001, "delta_n does not start at the static"),
            ("history", "T", lambda v: v * 1.001, "after the earthquake T ="),
        ],
    ),
)
def test_an_altered_column_of_a_joint_is_detected(
    files, tmp_path, number, table, column, change, message
):
    if table in ("quake_joint", "steps"):
        mine = read_table(files.files.folder / f"{table}.csv")["joint"] == number + 1
        found = altered(files, tmp_path, table, column, lambda v: np.where(mine, change(v), v))
    else:
        suffix = "_2" if number else ""
        found = altered(files, tmp_path, table, column + suffix, change)
    assert any(line.startswith(f"joint {number + 1}: ") and message in line for line in found)
    assert not any(line.startswith(f"joint {2 - number}: ") for line in found)


@pytest.mark.heavy
@pytest.mark.parametrize(
    "column, change, message",
    [
        ("crest_ax", lambda v: v * 1.001, "crest_ux is off"),
        ("ground_ax", lambda v: v * 1.001, "not that of the record"),
        ("ground_ay", lambda v: v + 1e-3, "not that of the record"),
        ("dt", lambda v: v * 1.001, "not the sums"),
        ("heel_opening", lambda v: v * np.nan, "not finite"),
        ("shear_reserve", lambda v: 0 * v + np.inf, "shear_reserve of law = friction"),
        ("time", lambda v: np.append(v[:-1], v[-1] + 0.02), "the record at"),
    ],
)
def test_an_altered_column_of_the_motion_is_detected(files, tmp_path, column, change, message):
    found = altered(files, tmp_path, "quake", column, change)
    assert any(message in line for line in found), found


def altered(files, folder, table, column, change):
    """The violations after a change of a column of a table."""
    shutil.copytree(files.files.folder, folder, dirs_exist_ok=True)
    columns = read_table(folder / f"{table}.csv")
    columns[column] = change(columns[column])
    write_csv(folder / f"{table}.csv", columns, EXACT)
    return Witness(replace(files.files, folder=folder)).violations()


RUPTURE = {"law": "rupture", "sigma_max": 2e5}
LIFT = {"lift_heights": (20.0,), "uplift": ("flow", "cracked")}


@pytest.mark.heavy
@pytest.mark.parametrize(
    "settings",
    [
        RUPTURE | {"quake_uplift": "zero"},
        {"uplift": "flow", "quake_uplift": "crack"},
        LIFT | {"quake_uplift": "zero"},
        LIFT | {"quake_uplift": "crack"},
        {"uplift": "cracked", "quake_uplift": "unchanged"},
    ],
)
def test_the_water_of_every_step_follows_from_the_openings(tmp_path, settings):
    """By each rule; of another rule the pressure is wrong, while the joint opens and closes."""
    record = smooth_record(tmp_path / "wave.csv", 6.0, duration=0.4)
    run = verified_quake(DAM | settings | {"record_rest": 0.1}, "35", record, tmp_path / "out")
    assert run.violations() == []
    other = "unchanged" if settings["quake_uplift"] != "unchanged" else "crack"
    joints = tuple({**values, "quake_uplift": other} for values in run.request.joints)
    found = water_in_motion.violations(run.files, replace(run.request, joints=joints), run.steps)
    assert any("Pa at t = " in words for words in found)


@pytest.mark.heavy
@pytest.mark.parametrize("turbulent, other", [(0, {"storage": 1.02e-12}), (1, {"turbulent": 0})])
def test_the_stored_water_of_every_step_is_replayed(tmp_path, turbulent, other):
    """With another storage, or as laminar flow, the pressure is wrong, while the joint opens and
    closes.
    """
    record = smooth_record(tmp_path / "wave.csv", 6.0, duration=0.3)
    settings = {"uplift": "flow", "quake_uplift": "transient", "storage": 1e-12}
    settings |= {"turbulent": turbulent, "record_rest": 0.1}
    run = verified_quake(DAM | settings, "35", record, tmp_path / "out")
    assert run.violations() == []
    joints = tuple({**values, **other} for values in run.request.joints)
    found = water_in_time.violations(run.files, replace(run.request, joints=joints), run.steps)
    assert "joint 1: p of the flow in time off" in "".join(found)


@pytest.mark.parametrize("column", ["delta_n", "tau_1", "p"])
def test_the_state_after_an_earthquake_is_in_the_table_of_all_steps(files, column):
    """The last row is that of the static state, after the time steps; each table of it agrees."""
    steps, still = files.steps, files.files.joint_tables[-1]
    last = steps["update"] == steps["update"].max()
    assert not steps["earthquake"][last].any() and (steps["time"][last] == 2).all()
    nodes = last & (steps["weight"] == 0)
    scale = np.abs(still[column]).max()
    assert np.sort(steps[column][nodes]) == pytest.approx(np.sort(still[column]), abs=1e-9 * scale)


@pytest.mark.parametrize(
    "statement, wrong", [("the jump reaches 4 m, beyond small displacements", True), ("why", False)]
)
def test_the_end_of_an_earthquake_is_judged(files, tmp_path, statement, wrong):
    shutil.copytree(files.files.folder, tmp_path, dirs_exist_ok=True)
    record = json.loads((tmp_path / "run.json").read_text())
    (tmp_path / "run.json").write_text(
        json.dumps(record | {"state": "failed", "statement": statement})
    )
    assert Witness(replace(files.files, folder=tmp_path)).stop()[0] == wrong


@pytest.mark.heavy
@pytest.mark.parametrize("number, seed", [(1, 23), (2, 2)])
def test_random_earthquakes_have_no_defect_and_leave_static_scenes_as_they_are(
    command, tmp_path, number, seed
):
    before = random_scenes.random_scene(1, 3)
    code, out, _ = command("stress", number, "--quake", "--seed", seed, "--out", "s.csv")
    assert code == 0 and f"{number} converged and verified" in out
    assert random_scenes.random_scene(1, 3) == before
    rows = stress.read_rows(tmp_path / "s.csv")
    assert all("--record" in row["command"] and int(row["steps"]) > 100 for row in rows)
    records = {path.name for path in (tmp_path / "s_records").iterdir()}
    assert len(rows) == number and records == {f"{seed}-{k}.csv" for k in range(number)}
    mark, page = trust.trust_section(tmp_path / "s.csv")
    assert mark == "earthquakes" and f"{number} random earthquakes" in page
    assert f"(seed {seed})" in page and trust.QUAKES_VERIFIED in page


@pytest.mark.heavy
def test_random_earthquakes_can_be_loaded_and_have_all_laws_and_waters(tmp_path):
    scenes = [random_quake(7, number, tmp_path) for number in range(60)]
    cases = [scene.case for scene in scenes]
    assert {law for case in cases for law in (joint["law"] for joint in case.joints)} == {
        *("rupture", "friction", "bond", "mixed")
    }
    assert len({case["uplift"] for case in cases}) == 5
    assert {len(case.joints) for case in cases} == {1, 2, 3}
    assert {scene.kind for scene in scenes} == set(random_quakes.KINDS)
    assert {check for scene in scenes for check in scene.checks} == set(random_quakes.CHECKS)
    for name in ("rock_mass", "damping_mass", "joint_damping_n", "damping_f1", "turbulent"):
        assert {bool(scene.settings.get(name)) for scene in scenes} == {True, False}
    assert {case["time_integration"] for case in cases} == {"HHT", "published"}


# -- the equations of all unknowns


@pytest.mark.heavy
@pytest.mark.parametrize(
    "settings",
    [
        {"hht_alpha": 0.0, "joint_damping_n": 1e8, "joint_damping_t": 5e7},
        {"rock_mass": 1.0, "rho_found": 2600.0, "quake_uplift": "zero", "damping_mass": 1.0},
        {"time_integration": "published", "joint_damping_n": 1e8},
    ],
)
def test_the_equations_of_all_unknowns_and_the_balance_of_energy(tmp_path, settings):
    """Energy is conserved with alpha = 0, and otherwise lost; wrong masses are noticed."""
    record = smooth_record(tmp_path / "wave.csv", 6.0, duration=0.3)
    short = DAM | settings | {"record_rest": 0.1}
    quake = earthquake(record, short, "35")
    found = quake_equations.follow(quake)
    assert abs(mean_slip(quake)) > 1e-4 and found["residual"] < 1e-8
    if settings.get("hht_alpha") == 0:
        assert abs(found["lost"]) < 1e-8 and found["rise"] < 1e-8
    else:
        assert 1e-6 < found["lost"] < 0.2
    wrong = earthquake(record, short, "35")
    wrong.system = replace(wrong.system, mass=1.0001 * wrong.system.mass)
    assert quake_equations.follow(wrong)["residual"] > 1e-6


# -- further runs, and closed forms


@pytest.mark.heavy
def test_the_slip_of_a_rigid_block_is_compared_with_its_closed_form(tmp_path):
    """Under a half sine (Newmark 1965), 0.054306889 m; another friction is noticed."""
    times = np.arange(0, 0.3025, 0.0025)
    values = np.maximum(8 * np.sin(np.pi * times / 0.3), 0)
    record = write_record(tmp_path / "r.csv", times, values)
    run = verified_quake(BLOCK | {"dt": 0.0025}, "0", record, tmp_path / "out")
    assert run.violations() == []
    assert quake_comparison.sliding_block(run.shaken)[-1] == pytest.approx(-0.054306889, rel=5e-4)
    measures, violated = quake_comparison.closed_form(None, run.shaken, None)
    assert measures["closed_form"] < 1e-3 and not violated
    words = (*run.files.words, "--set", "mu=0.6")
    rough = Witness(replace(run.files, words=words))
    assert quake_comparison.closed_form(None, rough.shaken, None)[1]


def scene_of(tmp_path, kind, checks, **settings):
    """A small scene with a wave as its record."""
    times = np.arange(0, 0.4, 0.01)
    wave = 4 * np.sin(np.pi * times / 0.39) ** 2 * np.sin(15 * times)
    record = np.column_stack([times, wave, 0.3 * wave])
    given = {n: v for n, v in DAM.items() if n not in settings} | settings
    scene = RandomQuake(given, "30", "0", 1, record, tmp_path / "r.csv", kind, checks)
    _ = scene.case  # writes the record
    return scene


ELASTIC = {"adhesion": 1e9, "quake_uplift": "unchanged", "dt": 0.005}


@pytest.mark.heavy
@pytest.mark.parametrize(
    "kind, checks, settings, expected",
    [
        ("elastic", ("reversed",), ELASTIC, {"asymmetry": (0, 1e-6)}),
        ("elastic", ("halved",), ELASTIC, {"order": (1.9, 2.1)}),
        ("dam", ("halved",), {}, {"change_by_dt": (1e-6, 0.1)}),
        ("dam", ("stronger",), {}, {"slip_if_stronger": (0.01, 0.95)}),
        ("dam", ("getdp",), {"dt": 0.01}, {"engines": (1e-16, 1e-6)}),
    ],
)
def test_further_runs_of_a_scene(tmp_path, kind, checks, settings, expected):
    scene = scene_of(tmp_path, kind, checks, **settings)
    run = stress.run_of(scene, tmp_path)
    row = {"class": stress.VERIFIED}
    found = stress.with_further_checks(scene, run, tmp_path, row)
    assert (found["class"], found["findings"]) == (stress.VERIFIED, "")
    for name, (low, high) in expected.items():
        assert low <= float(found[name]) <= high, found


@pytest.mark.heavy
def test_a_joint_that_slides_is_not_taken_for_an_elastic_one(tmp_path):
    scene = scene_of(tmp_path, "elastic", ("reversed",))
    run = stress.run_of(scene, tmp_path)
    found = stress.with_further_checks(scene, run, tmp_path, {"class": stress.VERIFIED})
    assert found["class"] == stress.DEFECT and "asymmetry" in found["findings"]


@pytest.mark.heavy
def test_engines_that_differ_are_compared_again_with_shorter_steps(files, tmp_path):
    """Softening: a step of 5 ms may have several equilibria."""
    altered(files, tmp_path, "quake", "N", lambda v: 1.01 * v)
    other = Witness(replace(files.files, folder=tmp_path)).shaken
    options_given, scene = [], scene_of(tmp_path, "dam", ("getdp",))

    def again(changed, *options):
        options_given.append((changed.settings.get("dt"), options))
        return other if len(options_given) == 1 else files.shaken

    measures, violated = quake_comparison.further_checks(scene, files.shaken, again)
    assert measures["engines"] == 0 and 1e-3 < measures["engines_at_dt"] and not violated
    getdp = ("--engine", "getdp")
    assert [options for _, options in options_given] == [getdp, (), getdp]
    assert [dt for dt, _ in options_given[1:]] == pytest.approx([0.005 / 8] * 2)
    measures, violated = quake_comparison.further_checks(
        scene, files.shaken, lambda _, *options: other if options else files.shaken
    )
    assert len(violated) == 1 and violated[0].startswith("engines: ")


@pytest.mark.heavy
def test_a_dam_that_does_not_stand_before_the_earthquake_is_judged_as_in_a_run(tmp_path):
    """It slides (T > mu N); with less water the command's refusal would be a defect."""
    settings = DAM | {"mu": 0.6, "adhesion": 0.0}
    record = np.array([[0, 0, 0], [0.1, 1, 0]], float)
    falls = RandomQuake(settings, "45", "0", 1, record, tmp_path / "r.csv")
    _ = falls.case
    row = stress.run_and_verify(falls, tmp_path)
    assert (row["class"], row["kind"]) == (stress.JUSTIFIED, random_quakes.DAM), row
    stands = replace(falls, levels="20")
    row = stress.without_start(stands, tmp_path)
    assert row["class"] == stress.DEFECT
    assert row["findings"] == f"{stress.NO_START}, but a run with them has one"
