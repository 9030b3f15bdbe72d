"""Random earthquakes verified from their result files, and the verification with altered files."""

import json
import shutil

import numpy as np
import pytest
from damjoint.dynamics.frames import MOST_FRAMES
from damjoint.model.case import load
from damjoint.post.tables import write_csv
from damjoint.studies import quake
from damjoint_tools import stress
from damjoint_tools.quake_verification import QuakeFiles, judge_quake, quake_violations
from damjoint_tools.verification import read_table
from quakes import DAM, smooth_record


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The files of an earthquake of a dam with two joints."""
    folder = tmp_path_factory.mktemp("quake")
    record = smooth_record(folder / "wave.csv", 6.0, duration=0.6)
    settings = {"lift_heights": (20.0,), "law": ("friction", "bond"), "batter": 2.0}
    settings |= {"batter_height": 30.0, "added_mass": 2.0, "adhesion": (1e4, 1e5), "G_t": (50, 50)}
    case = load("dam", DAM | settings, "35", record=record)
    quake.run(case, folder / "out", picture=False, progress=False)
    return QuakeFiles(case, folder / "out", 0)


def test_the_files_of_an_earthquake_violate_no_rule(files):
    assert quake_violations(files) == []
    rows = files.history
    assert np.abs(rows["slip_mean"]).max() > 1e-3 and 50 < len(files.joint) <= MOST_FRAMES
    # the inertia of the whole dam, with its water, is the change of the shear force
    assert np.ptp(rows["T_inertia"]) > 0.5 * files.weight


@pytest.mark.parametrize("number", [1, pytest.param(0, marks=pytest.mark.heavy)])
@pytest.mark.parametrize(
    "table, column, change, message",
    [
        ("quake", "T", lambda v: v + 100 * (np.arange(len(v)) == 60), "momentum: T is off"),
        ("quake", "N", lambda v: v * 1.0001, "momentum: N is off"),
        ("quake", "M", lambda v: v * 1.0001, "momentum: M is off"),
        ("quake", "T_inertia", lambda v: v * 1.0001, "momentum: T is off"),
        ("quake", "slip_mean", lambda v: v * 1.01, "residual slip is not"),
        ("quake_joint", "sigma_n_eff", lambda v: v * 1.01, "contact"),
        ("quake_joint", "tau_1", lambda v: v * 100 + 1e6, "shear"),
        ("quake_joint", "p", lambda v: v * 1.01, "the integral of p"),
        ("history", "T", lambda v: v * 1.001, "after the earthquake T ="),
    ],
)
def test_an_altered_column_of_a_joint_is_detected(
    files, tmp_path, number, table, column, change, message
):
    if table == "quake_joint":
        mine = read_table(files.folder / "quake_joint.csv")["joint"] == number + 1
        found = altered(files, tmp_path, table, column, lambda v: np.where(mine, change(v), v))
    else:
        suffix = "_2" if number else ""
        found = altered(files, tmp_path, table, column + suffix, change)
    name = files.whole.joint_names[number]
    assert any(line.startswith(f"{name}: ") and message in line for line in found), found
    assert not any(line.startswith(files.whole.joint_names[1 - number]) for line in found)


@pytest.mark.parametrize(
    "column, change, message",
    [
        ("crest_ax", lambda v: v * 1.001, "crest_ux is off"),
        ("ground_ax", lambda v: v * 1.001, "not that of the record"),
        ("ground_ay", lambda v: v + 1e-3, "not that of the record"),
        ("dt", lambda v: v * 1.001, "not the sums"),
        ("heel_opening", lambda v: v * np.nan, "not finite"),
        ("time", lambda v: np.append(v[:-1], v[-1] + 0.02), "the record at"),
    ],
)
def test_an_altered_column_of_the_motion_is_detected(files, tmp_path, column, change, message):
    found = altered(files, tmp_path, "quake", column, change)
    assert any(message in line for line in found), found


def altered(files, folder, table, column, change):
    """The violations after a change of a column of a table."""
    shutil.copytree(files.folder, folder, dirs_exist_ok=True)
    columns = read_table(folder / f"{table}.csv")
    columns[column] = change(columns[column])
    write_csv(folder / f"{table}.csv", columns)
    return quake_violations(QuakeFiles(files.whole, folder, 0))


@pytest.mark.parametrize(
    "statement, wrong", [("the jump reaches 4 m, beyond small displacements", True), ("why", False)]
)
def test_the_end_of_an_earthquake_is_judged(files, tmp_path, statement, wrong):
    shutil.copytree(files.folder, tmp_path, dirs_exist_ok=True)
    record = json.loads((tmp_path / "run.json").read_text())
    (tmp_path / "run.json").write_text(
        json.dumps(record | {"state": "failed", "statement": statement})
    )
    assert judge_quake(QuakeFiles(files.whole, tmp_path, 1))[0] == wrong


@pytest.mark.parametrize("number, seed", [(1, 6), pytest.param(2, 2, marks=pytest.mark.heavy)])
def test_random_earthquakes_have_no_defect_and_leave_static_scenes_as_they_are(
    command, tmp_path, number, seed
):
    before = stress.random_scene(1, 3)
    code, out, _ = command("stress", number, "--quake", "--seed", seed, "--out", "s.csv")
    assert code == 0 and f"{number} converged and verified" in out
    assert stress.random_scene(1, 3) == before
    rows = stress.read_rows(tmp_path / "s.csv")
    assert all("--record" in row["command"] and int(row["steps"]) > 100 for row in rows)
    records = {path.name for path in (tmp_path / "s_records").iterdir()}
    assert len(rows) == number and records == {f"{seed}-{k}.csv" for k in range(number)}


def test_random_earthquakes_can_be_loaded_and_have_all_laws_and_waters(tmp_path):
    cases = [stress.random_quake(5, number, tmp_path).case for number in range(30)]
    assert {case["law"] for case in cases} == {"rupture", "friction", "bond"}
    assert len({case["uplift"] for case in cases}) == 5
    assert {len(case.joints) for case in cases} == {1, 2, 3}
