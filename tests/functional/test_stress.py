"""Random dams verified from their result files, and the verification itself with altered files."""

import csv
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from damjoint import __version__, runner
from damjoint.post.tables import EXACT, write_csv
from damjoint_tools import random_scenes, stress, trust
from damjoint_tools.random_scenes import RandomScene
from damjoint_witness.files import Files, read_table
from damjoint_witness.verify import Witness

SCENES = {
    "rupture": {"law": "rupture", "uplift": "flow", "sigma_max": 1e4, "alpha": 0.0},
    "friction": {"law": "friction", "uplift": "cracked", "pena_tang": 5e9, "adhesion": 1e4},
    "bond": {"law": "bond", "uplift": "imposed", "sigma_max": 5e4, "adhesion": 5e4},
    "endo": {"law": "endo", "sigma_max": 5e4, "adhesion": 5e4, "uplift": "drained"},
    "grouted": {"law": "rupture", "uplift": "none", "grout_pressure": 4e5, "alpha": 2.0},
    "mixed": {"law": "mixed", "uplift": "flow", "sigma_max": 8e5, "G_f": 500.0, "dam_base": 28.0},
    "sawn": {"law": "friction", "uplift": "none", "saw_thickness": 2e-4, "saw_t": 2.0},
}
SEVERAL = {
    "lift_heights": (12.0, 25.0),
    "law": ("rupture", "friction", "bond"),
    "uplift": ("flow", "cracked", "imposed"),
    "pena_tang": 5e9,
    "joint_slope": (0.0, -2.0, 3.0),
    "silt_height": 10.0,
    "k_h": 0.05,
    "added_mass": 2.0,
}


def verified_run(settings, levels, folder, code=0, tail="0"):
    """The verification of a run of three steps from level to level, of 20 elements."""
    scene = RandomScene(settings | {"n_joint": 20.0}, levels, tail, 3)
    case = replace(scene.case, all_steps=True)
    runner.run(case, folder, fields=False, picture=False, progress=False)
    return Witness(Files(folder, tuple(scene.words), code))


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """runs(name): the verification of a run of SCENES, or of SEVERAL joints."""
    done = {}

    def once(name):
        if name not in done:
            settings = SCENES.get(name, SEVERAL)
            levels = "30,40" if settings is SEVERAL else "30,44,35"
            done[name] = verified_run(settings, levels, tmp_path_factory.mktemp(name), tail="3")
        return done[name]

    return once


def altered(run, folder, table, column, change):
    """The violations after a change of a column of a table."""
    shutil.copytree(run.files.folder, folder, dirs_exist_ok=True)
    columns = read_table(folder / f"{table}.csv")
    columns[column] = change(columns[column])
    write_csv(folder / f"{table}.csv", columns, EXACT)
    return Witness(replace(run.files, folder=folder)).violations()


@pytest.mark.parametrize("name", [*SCENES, "several"])
def test_the_files_of_a_run_violate_no_rule(runs, name):
    run = runs(name)
    assert run.violations() == []
    assert run.steps["frozen"].max() <= 1 and len(set(run.steps["update"])) > 5


def test_the_laws_are_replayed_in_the_states_that_matter(runs):
    """Damage, slip, grout and saw are not trivial in the runs above."""
    last = {name: runs(name).files.joint_tables[-1] for name in SCENES}
    for name in ("rupture", "bond", "endo"):
        assert 0 < last[name]["damage"].max() and last[name]["slip"].max() > 0
    open_at_44_m = runs("mixed").files.joint_tables[1]["delta_n"] > 0
    assert (last["mixed"]["damage"][open_at_44_m] > 0.01).any()
    assert last["friction"]["lambda"].max() > 1e-6
    assert last["grouted"]["joint_thickness"].max() > 1e-6 > 0
    assert last["sawn"]["joint_thickness"].min() < -1e-5


@pytest.mark.parametrize("number", range(3))
@pytest.mark.parametrize(
    "table, column, message",
    [
        ("history", "N", "N + U"),
        ("history", "T", "T ="),
        ("history", "M", "M + M_U"),
        ("steps", "sigma_n_eff", "normal stress"),
        ("steps", "tau_1", "shear stress"),
        ("joint", "tau_1", "tau_1 of joint.csv"),
    ],
)
def test_an_altered_column_of_a_joint_is_detected_there(
    runs, tmp_path, number, table, column, message
):
    run, change = runs("several"), lambda v: 1.001 * v
    if table == "history":
        column += f"_{number + 1}" if number else ""
    else:
        rows = read_table(run.files.folder / f"{table}.csv")["joint"] == number + 1
        change = lambda v: np.where(rows, 1.001 * v, v)
    found = altered(run, tmp_path, table, column, change)
    assert found and all(line.startswith(f"joint {number + 1}: ") for line in found), found
    assert any(message in line for line in found), found


def zero_at_the_end(column):
    """Set the values of the last quarter of the rows to 0."""
    return np.where(np.arange(len(column)) < 0.75 * len(column), column, 0)


@pytest.mark.parametrize(
    "name, table, column, change, message",
    [
        ("bond", "history", "level", lambda v: v + 1e-3, "level is off"),
        ("bond", "history", "tail_level", lambda v: v + 1e-3, "tail_level is off"),
        ("bond", "history", "time", lambda v: v[::-1], "times do not increase"),
        ("bond", "history", "N", lambda v: v * (1 + 1e-6), "N + U"),
        ("bond", "history", "T", lambda v: v * (1 + 1e-6), "the integral is"),
        ("bond", "steps", "damage", zero_at_the_end, "damage off"),
        ("bond", "steps", "slip", lambda v: 1.0001 * v, "slip off"),
        ("bond", "steps", "delta_n", lambda v: 1.0001 * v, "normal stress off"),
        ("rupture", "steps", "damage", zero_at_the_end, "damage off"),
        ("rupture", "steps", "tau_1", zero_at_the_end, "shear stress off"),
        ("friction", "steps", "lambda", lambda v: 0.9999 * v, "lambda off"),
        ("endo", "steps", "damage", lambda v: 0.99 * v, "damage off"),
        ("mixed", "steps", "damage", lambda v: 0.99 * v, "damage off"),
        ("mixed", "steps", "tau_1", zero_at_the_end, "shear stress off"),
        ("grouted", "steps", "joint_thickness", lambda v: 1.0001 * v, "joint_thickness off"),
        ("sawn", "steps", "joint_thickness", lambda v: 1.0001 * v, "joint_thickness off"),
        ("rupture", "joint", "delta_n", lambda v: 1.0001 * v, "delta_n of joint.csv"),
        ("rupture", "joint", "p", lambda v: 1.0001 * v, "p of joint.csv"),
    ],
)
def test_an_altered_column_is_detected(runs, tmp_path, name, table, column, change, message):
    found = altered(runs(name), tmp_path, table, column, change)
    assert any(message in line for line in found), found


@pytest.mark.parametrize(
    "name, parameter, value, message",
    [
        ("bond", "G_t", 1100.0, "shear stress off"),
        ("bond", "K_T", 4.9e10, "shear stress off"),
        ("rupture", "alpha", 1.5, "shear stress off"),
        ("endo", "G_f", 101.0, "shear stress off"),
        ("mixed", "G_f", 501.0, "shear stress off"),
        ("mixed", "G_f", 501.0, "normal stress off"),
        ("mixed", "K_T", 4.9e10, "shear stress off"),
        ("sawn", "saw_thickness", 2.01e-4, "joint_thickness off"),
        ("grouted", "grout_pressure", 4.01e5, "joint_thickness off"),
        ("several", "silt_height", 10.1, "T ="),
        ("several", "k_h", 0.051, "T ="),
        ("several", "added_mass", 1.0, "T ="),
    ],
)
def test_a_run_of_another_value_is_detected(runs, tmp_path, name, parameter, value, message):
    run = runs(name)
    words = [*run.files.words, "--set", f"{parameter}={value}"]
    found = Witness(replace(run.files, words=tuple(words))).violations()
    assert any(message in line for line in found), found
    assert any(line.startswith(f"run.json: {parameter}") for line in found)


def test_a_wrong_exit_code_is_detected(runs):
    files = replace(runs("rupture").files, exit_code=1)
    assert Witness(files).violations() == ["exit code 1 with state complete, verdict stands"]


@pytest.mark.parametrize(
    "level, law, mu, wrong, remark",
    [
        (30, "friction", 0.8, True, "but there certainly is an equilibrium"),
        (44, "friction", 0.6, False, ""),
        (38, "friction", 0.6, False, "below the limit analysis by a factor of"),
        (38, "bond", 0.6, False, "below the limit analysis by a factor of"),
    ],
)
def test_the_reason_of_a_stop_is_judged_by_limit_analysis(tmp_path, level, law, mu, wrong, remark):
    """With mu = 0.6 it slides at 40.6 m (T = mu N), with the resultant well within the base; at
    38 m friction is used by more than 0.9, which is no reason to stop.
    """
    settings = {"law": law, "adhesion": 0.0, "mu": mu, "sigma_max": 0.0}
    run = verified_run(settings | {"pena_tang": 0.0}, str(level), tmp_path, 1)
    record = json.loads((tmp_path / "run.json").read_text())
    record |= {"state": "stopped", "verdict": "sliding"}
    (tmp_path / "run.json").write_text(json.dumps(record))
    found = Witness(run.files).stop()
    assert found[0] == wrong and remark in found[1] and bool(remark) == bool(found[1])


@pytest.mark.parametrize(
    "factor, remark", [(0.99, ""), (1.01, "limit analysis by a factor of 1.01")]
)
def test_the_law_mixed_bears_shear_by_its_strength_without_friction(tmp_path, factor, remark):
    """T = sqrt(K_T/K_N) f_t L is the limit of an undamaged joint, under pressure too."""
    run = verified_run({"law": "mixed", "sigma_max": 4e6, "G_f": 1e5}, "38", tmp_path)
    assert run.files.joint_tables[-1]["damage"].max() == 0
    record = json.loads((tmp_path / "run.json").read_text())
    record |= {"state": "stopped", "verdict": "sliding"}
    (tmp_path / "run.json").write_text(json.dumps(record))
    shear = 1000 * 9.81 * 38**2 / 2
    strength = factor * shear / 34 / np.sqrt(0.5)  # of 34 m, K_T = K_N/2
    words = (*run.files.words, "--set", f"sigma_max={float(strength)!r}")
    wrong, found = Witness(replace(run.files, words=words, exit_code=1)).stop()
    assert not wrong and remark in found and bool(remark) == bool(found)


@pytest.mark.heavy
def test_scenes_have_all_that_is_drawn_and_can_be_loaded():
    scenes = [random_scenes.random_scene(7, number) for number in range(80)]
    assert {len(scene.case.joints) for scene in scenes} == {1, 2, 3, 4}
    words = "\n".join(" ".join(scene.words) for scene in scenes)
    for drawn in ("law=endo", "temperature_dam", "grout_pressure", "saw_thickness", "monoliths"):
        assert drawn in words
    assert any("mixed" in np.ravel(scene.settings["law"]) for scene in scenes)
    assert "uplift=waterstop" in words and "quake_uplift=unchanged" in words
    for drawn in ("time_unit", "face_load=uniform", "neck_batter", "joint_head_offset"):
        assert drawn in words
    for drawn in ("in_situ=0", "quadrature=published", "force_face=upstream"):
        assert drawn in words
    for number, scene in enumerate(scenes):  # later draws leave the first ones as they were
        single = random_scenes.single_joint_scene(7, number)
        assert len(single.case.joints) == 1
        kept = "dam_height", "dam_base", "E", "nu", "weight_first"
        if scene.base == "dam":
            assert all(scene.settings.get(n) == single.settings.get(n) for n in kept)


@pytest.mark.heavy
def test_flow_in_time_is_selected_and_counted(tmp_path):
    """`--with`: the first scenes of a seed that have it; a row of the page, another with drains."""
    for words, records, features in (
        ("time_unit=", None, trust.FEATURES_OF_DAMS),
        ("quake_uplift=transient", tmp_path, trust.FEATURES_OF_QUAKES),
    ):
        scenes = [
            [stress.scene_of(7, n, records).words for n in stress.numbers_of(3, 7, records, with_)]
            for with_ in (words, "")
        ]
        chosen, first = ([" ".join(scene) for scene in drawn] for drawn in scenes)
        assert len(chosen) == len(first) == 3 and all(words in command for command in chosen)
        commands = {*chosen, *(command for command in first if words not in command)}
        rows = [{"command": command, "class": stress.VERIFIED} for command in commands]
        table = trust.classes(rows, with_words=features).splitlines()
        counts = {row.split("|")[1].strip(): row.split("|")[2].strip() for row in table[2:]}
        assert counts["flow in time"] == "3" and counts["all"] == str(len(rows)) != "3"
        with_drains = [c for c in chosen if re.search(r"drains=[0,]*1", c)]
        assert counts["flow in time, with drains"] == str(len(with_drains))


def test_a_low_critical_level_is_checked_from_levels_below_it(monkeypatch, tmp_path):
    """Runs from a level above it found no equilibrium at 0.995 of it."""
    scene, firsts = RandomScene({"dam_height": 30.0}, "20", "0", 1), []

    def files_of(words, folder, *options, name):
        firsts.append(float(words[words.index("--levels") + 1].split(",")[0]))
        value = {"value": 6.0, "mode": "sliding", "joint": "", "confirmed": "so", "doubt": ""}
        return SimpleNamespace(record={"critical": value, "verdict": "sliding"}, stopped=False)

    def run_of(scene, folder, name, fields):
        run = SimpleNamespace(files=files_of(scene.words, folder, name=name), violations=list)
        run.request, run.steps = SimpleNamespace(sections=[]), {}
        return run

    monkeypatch.setattr(stress, "files_of", files_of)
    monkeypatch.setattr(stress, "run_of", run_of)
    assert stress.critical_levels(scene, tmp_path)[0] == []
    assert firsts == pytest.approx([9.0, *[1.8] * (len(firsts) - 1)]) and len(firsts) == 8


@pytest.mark.heavy
def test_stress_is_reproducible_and_resumed_and_makes_a_page(command, monkeypatch):
    pytest.importorskip("skfem")
    monkeypatch.setattr(stress, "TIME_LIMIT", 60)
    code, out, _ = command("stress", 1, "--seed", 3, "--seeds", 2, "--out", "s.csv")
    assert code == 0 and "0 defect; s.csv" in out
    before = Path("s.csv").read_text()
    command("stress", 1, "--seed", 3, "--seeds", 2, "--out", "s.csv")
    assert Path("s.csv").read_text() == before
    rows = list(csv.DictReader(before.splitlines()))
    assert {row["scene"] for row in rows} == {"3-0", "4-0"}
    assert stress.random_scene(3, 1) == stress.random_scene(3, 1) != stress.random_scene(3, 0)
    mark, page = trust.trust_section(Path("s.csv"))
    assert mark == "dams" and "2 random scenes" in page and trust.VERIFIED in page
    assert f"Measured with damjoint {__version__} (" in page
    assert rows[0]["date"] in page and rows[0]["machine"] in page
    # rows of different code are neither added to one file nor shown on one page
    other = before.replace(rows[0]["code"], "of-other-code", 1)
    Path("s.csv").write_text(other)
    code, _, error = command("stress", 3, "--seed", 3, "--out", "s.csv")
    assert code == 2 and error.count("\n") == 1 and "out = s.csv: must be a new file" in error
    assert Path("s.csv").read_text() == other
    with pytest.raises(ValueError, match="figures of different versions"):
        trust.trust_section(Path("s.csv"))


@pytest.mark.heavy
def test_a_scene_beyond_its_time_limit_is_a_defect(tmp_path, monkeypatch):
    monkeypatch.setattr(stress, "TIME_LIMIT", 1)
    monkeypatch.setattr(stress, "LONGEST", 100)  # not the duration, which other work prolongs
    row = stress.run_and_verify(random_scenes.random_scene(7, 111), tmp_path)
    assert row["class"] == stress.DEFECT
    assert row["findings"] == "not finished after 1 s of CPU time"


@pytest.mark.heavy
def test_random_dams_have_no_defect(tmp_path):
    rows = stress.stress(2, 8, tmp_path / "stress.csv")
    defects = [row for row in rows if row["class"] == stress.DEFECT]
    assert len(rows) == 2 and not defects, defects
