"""Random dams verified from their result files, and the verification itself with altered files."""

import csv
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from damjoint import __version__, runner
from damjoint.model.case import load
from damjoint.post.tables import write_csv
from damjoint_tools import random_scenes, stress, trust, verification
from damjoint_tools.verification import RunFiles, judge_stop, read_table, violations

SCENES = {
    "rupture": {"law": "rupture", "uplift": "flow", "sigma_max": 1e4, "G_f": 10.0},
    "friction": {"law": "friction", "uplift": "cracked", "pena_tang": 5e9, "adhesion": 1e4},
    "bond": {"law": "bond", "uplift": "imposed"},
}
SEVERAL = {
    "lift_heights": (12.0, 25.0),
    "law": ("rupture", "friction", "bond"),
    "uplift": ("flow", "cracked", "imposed"),
    "pena_tang": 5e9,
    "joint_slope": (0.0, -2.0, 3.0),
}
DRAINED = {"drains": 1.0, "drain_x": 6.8}


@pytest.fixture(scope="module")
def lift_files(tmp_path_factory):
    """The files of a run of three joints."""
    case = load("dam", SEVERAL | {"n_joint": 20.0}, "30,40", "3")
    folder = tmp_path_factory.mktemp("lifts")
    runner.run(case, folder, fields=False, picture=False, progress=False)
    return RunFiles(case, folder, 0)


def test_the_files_of_a_run_of_several_joints_violate_no_rule(lift_files):
    assert [len(joint.joint) for joint in lift_files.joints] == [2, 2, 2]
    assert violations(lift_files) == []


@pytest.mark.parametrize("number", range(3))
@pytest.mark.parametrize(
    "table, column, message",
    [
        ("history", "N", "N + U"),
        ("history", "T", "T ="),
        ("history", "M", "M ="),
        ("history", "U", "U ="),
        ("joint", "sigma_n_eff", "contact"),
        ("joint", "tau_1", "shear"),
    ],
)
def test_an_altered_column_of_a_joint_is_detected_there(
    lift_files, tmp_path, number, table, column, message
):
    suffix = f"_{number + 1}" if table == "history" and number else ""
    rows = read_table(lift_files.folder / "joint.csv")["joint"] == number + 1
    if table == "history":
        change = lambda v: 1.01 * v
    else:
        change = lambda v: np.where(rows, 100 * v + 1e6, v)
    found = violations(altered(lift_files, tmp_path, table, column + suffix, change))
    name = lift_files.whole.joint_names[number]
    assert found and all(line.startswith(f"{name}: ") for line in found), found
    assert any(line.startswith(f"{name}: {message}") for line in found), found


@pytest.mark.heavy
def test_scenes_have_one_to_four_joints_and_can_be_loaded():
    scenes = [random_scenes.random_scene(7, number) for number in range(40)]
    assert {len(scene.case.joints) for scene in scenes} == {1, 2, 3, 4}
    for number, scene in enumerate(scenes):
        single = random_scenes.single_joint_scene(7, number)
        assert len(single.case.joints) == 1
        assert scene == single or "lift_heights" in scene.settings


@pytest.fixture(scope="module")
def run_files(tmp_path_factory):
    """run_files(law, drained): the files of a run of that law with cracks."""
    done = {}

    def once(law, drained=False):
        if (law, drained) not in done:
            settings = SCENES[law] | {"n_joint": 20.0} | (DRAINED if drained else {})
            case = load("dam", settings, "30,44,35", "3")
            folder = tmp_path_factory.mktemp(law)
            runner.run(case, folder, fields=False, picture=False, progress=False)
            done[law, drained] = RunFiles(case, folder, 0)
        return done[law, drained]

    return once


@pytest.mark.parametrize("law, drained", [*((law, False) for law in SCENES), ("rupture", True)])
def test_the_files_of_a_run_violate_no_rule(run_files, law, drained):
    assert violations(run_files(law, drained)) == []


@pytest.mark.parametrize("law", SCENES)
@pytest.mark.parametrize(
    "table, column, change, message",
    [
        ("history", "N", lambda v: v * 1.001, "N + U"),
        ("history", "T", lambda v: v * 1.001, "T ="),
        ("history", "M", lambda v: v * 1.001, "M ="),
        ("history", "level", lambda v: v + 1e-3, "not at the prescribed level"),
        ("history", "slip_length", lambda v: 1 - 0.1 * np.arange(len(v)), "slip_length falls"),
        ("joint", "p", lambda v: v * 1.01, "the integral of p"),
        ("joint", "sigma_n_eff", lambda v: v + 1e6, "tension"),
        ("joint", "sigma_n_eff", lambda v: v * 1.01, "contact"),
        ("joint", "tau_1", lambda v: v * 100 + 1e6, "shear"),
    ],
)
def test_an_altered_column_is_detected(run_files, tmp_path, law, table, column, change, message):
    found = violations(altered(run_files(law), tmp_path, table, column, change))
    assert any(message in line for line in found), found


def altered(files, folder, table, column, change):
    """Copy the files of a run to a folder and change a column of a table."""
    shutil.copytree(files.folder, folder, dirs_exist_ok=True)
    path = folder / f"{table}.csv"
    columns = read_table(path)
    columns[column] = change(columns[column])
    write_csv(path, columns)
    return RunFiles(files.whole, folder, 0)


def zero_at_the_end(column):
    """Set the values of the last of three times to 0."""
    return np.where(np.arange(len(column)) < len(column) * 2 // 3, column, 0)


@pytest.mark.parametrize(
    "law, table, column, change, message",
    [
        ("rupture", "joint", "damage", zero_at_the_end, "damage falls"),
        ("bond", "joint", "damage", zero_at_the_end, "damage falls"),
        ("bond", "joint", "damage", lambda v: v + 1, "damage is out of its range"),
        ("friction", "joint", "lambda", zero_at_the_end, "lambda falls"),
        ("friction", "joint", "lambda", lambda v: 0.999 * v, "shear: beyond the law"),
        ("friction", "joint", "lambda", lambda v: 0.999 * v, "slip is more than lambda"),
        ("friction", "joint", "lambda", np.negative, "lambda is out of its range"),
        ("rupture", "joint", "p", lambda v: v + 1e6, "pressure above the reservoir's head"),
        ("rupture", "joint", "p", lambda v: 0 * v + 1, "pressure below the tailwater's head"),
        ("rupture", "joint", "flux", lambda v: v * np.linspace(1, 1.01, len(v)), "flux varies"),
        ("bond", "joint", "sigma_n_eff", np.negative, "contact: off"),
        ("bond", "history", "tail_level", lambda v: v + 1e-3, "not at the prescribed tailwater"),
        ("bond", "history", "time", lambda v: v[::-1], "times do not increase"),
    ],
)
def test_a_value_that_no_law_allows_is_detected(
    run_files, tmp_path, law, table, column, change, message
):
    found = violations(altered(run_files(law), tmp_path, table, column, change))
    assert any(message in line for line in found), found


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda v, s: np.where(s == s.min(), 1.01 * v, v), "flux varies"),
        (lambda v, s: np.where(s < 6.8, 0, v), "drains give"),
    ],
)
def test_a_flux_that_drains_can_not_cause_is_detected(run_files, tmp_path, change, message):
    """Upstream of the drains the flux is uniform and not less than the leakage."""
    files = run_files("rupture", drained=True)
    s = read_table(files.folder / "joint.csv")["s"]
    found = violations(altered(files, tmp_path, "joint", "flux", lambda v: change(v, s)))
    assert found and all(message in line for line in found), found


def test_a_wrong_exit_code_is_detected(run_files):
    files = run_files("rupture")
    assert violations(RunFiles(files.whole, files.folder, 1)) == [
        "exit code 1 with state complete, verdict stands"
    ]


@pytest.mark.parametrize(
    "level, mu, verdict, remark",
    [
        (30, 0.8, "sliding", "but there certainly is an equilibrium"),
        (44, 0.6, "sliding", ""),
        (44, 0.6, "overturning", "but the rigid block is not near that limit"),
    ],
)
def test_the_reason_of_a_stop_is_judged_by_the_rigid_block(tmp_path, level, mu, verdict, remark):
    """With mu = 0.6 it slides at 40.6 m (T = mu N), with the resultant well within the base."""
    settings = {"law": "friction", "adhesion": 0.0, "mu": mu, "pena_tang": 0.0, "n_joint": 20.0}
    case = load("dam", settings, str(level), "3")
    runner.run(case, tmp_path, fields=False, picture=False, progress=False)
    record = json.loads((tmp_path / "run.json").read_text())
    record |= {"state": "stopped", "verdict": verdict}
    (tmp_path / "run.json").write_text(json.dumps(record))
    wrong, found = judge_stop(RunFiles(case, tmp_path, 1))
    assert wrong == bool(remark) and found.endswith(remark) and bool(found) == bool(remark)


def test_stress_is_reproducible_and_resumed_and_makes_a_page(command, monkeypatch):
    monkeypatch.setattr(stress, "TIME_LIMIT", 60)
    code, out, _ = command("stress", 2, "--seed", 3, "--out", "s.csv")
    assert code == 0 and "0 defect; s.csv" in out
    before = Path("s.csv").read_text()
    command("stress", 2, "--seed", 3, "--out", "s.csv")
    assert Path("s.csv").read_text() == before
    rows = list(csv.DictReader(before.splitlines()))
    assert {row["scene"] for row in rows} == {"3-0", "3-1"}
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
    row = stress.run_and_verify(random_scenes.random_scene(7, 111), tmp_path)
    assert row["class"] == stress.DEFECT
    assert row["findings"] == "not finished after 1 s of CPU time"


@pytest.mark.heavy
def test_random_dams_have_no_defect(tmp_path):
    rows = stress.stress(60, 7, tmp_path / "stress.csv")
    defects = [row for row in rows if row["class"] == stress.DEFECT]
    assert len(rows) == 60 and not defects, defects


def test_verification_imports_neither_engines_nor_laws():
    source = Path(verification.__file__).read_text()
    imports = [line for line in source.splitlines() if line.startswith(("import ", "from "))]
    assert len(imports) > 5
    assert not [line for line in imports if re.search(r"\b(engines|laws|solver|joint|fem)\b", line)]
