"""The output folder: the files of a run, and files that a run must not touch."""

import json
import shutil
import tempfile
from pathlib import Path

import gmsh
import numpy as np
import pytest
from damjoint import RunError
from damjoint.engines.getdp import process
from damjoint.input.case_names import CASES
from damjoint.storage import locked_folder
from test_output import read
from variants import further

SMALL = ("--set", "n_joint=10", "--set", "h_dam=3", "--set", "h_found=4")
BARE = (*SMALL, "--no-fields", "--no-picture")


@pytest.mark.heavy
@pytest.mark.parametrize("engine", ["getdp", "condensed"])
def test_files_of_the_user_in_the_folder_stay(command, tmp_path, engine):
    """Also in work/ and fields/, beside an earlier run."""
    mine = [
        "work/history.txt",
        "work/deep/notes.txt",
        "fields/mine.vtu",
        "photo.png",
        "none/my.csv",
    ]
    for name in mine:
        (tmp_path / "out" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "out" / name).write_text("mine")
    words = "run", "a", *SMALL, "--levels", "6", "--engine", engine, "--out", "out"
    assert command(*words)[0] == 0
    assert command(*words, "--no-picture")[0] == 0
    assert all((tmp_path / "out" / name).read_text() == "mine" for name in mine)


@pytest.mark.heavy
@pytest.mark.parametrize(
    "words",
    [
        (),
        ("--out", "here/there"),
        ("--out", 'it\'s "mine" é'),
    ],
)
def test_the_getdp_engine_accepts_any_folder_name(command, tmp_path, words):
    code, _, err = command("run", "c", *SMALL, "--levels", "3", "--engine", "getdp", *words)
    assert (code, err) == (0, "")
    folder = tmp_path / (words[1] if words else "out/c")
    assert len(read(folder / "joint.csv")["x"]) == 11
    assert sorted(p.name for p in folder.iterdir()) == [
        "c.png",
        "fields",
        "history.csv",
        "joint.csv",
        "run.json",
    ]


@pytest.mark.heavy
def test_results_of_an_earlier_run_are_removed(command, tmp_path):
    """Displacement control, two uplifts and three levels; then level control with one level."""
    words = "run", "a", *SMALL, "--out", "out"
    driven = "--set", "drive=heel", "--set", "drive_by=1e-8"
    assert command(*words, "--levels", "3,6,7", *driven)[0] == 0
    before = {str(p.relative_to(tmp_path / "out")) for p in (tmp_path / "out").rglob("*")}
    assert {"curve.csv", "a_curve.png", "none/joint.csv", "fields/dam_t3.vtu"} <= before
    assert command("run", "c", *SMALL, "--out", "out", "--levels", "6")[0] == 0
    after = {str(p.relative_to(tmp_path / "out")) for p in (tmp_path / "out").rglob("*")}
    fields = {"fields.pvd", "bulk.msh", "joint.msh"}
    fields |= {f"{part}_t1.vtu" for part in ("dam", "foundation", "joint")}
    tables = {"joint.csv", "history.csv", "run.json", "c.png", "fields"}
    assert after == tables | {f"fields/{name}" for name in fields}


def test_bad_input_leaves_an_earlier_run_unchanged(command, tmp_path):
    assert command("run", "c", *BARE, "--levels", "6", "--out", "out")[0] == 0
    before = {p: p.read_bytes() for p in (tmp_path / "out").iterdir()}
    assert command("run", "c", *BARE, "--levels", "60", "--out", "out")[0] == 2
    assert {p: p.read_bytes() for p in (tmp_path / "out").iterdir()} == before


@pytest.mark.heavy
@pytest.mark.usefixtures("no_pictures")
@pytest.mark.parametrize(
    "newer",
    [["check", "c", "--out", "out"], ["run", "c", "--out", "out/c"], ["run", "c"]],
)
def test_the_table_of_a_check_does_not_stay_beside_a_newer_run_that_fails(
    command, tmp_path, monkeypatch, newer
):
    """Of the check, of one of its cases, or of another run into its folder."""
    words = *BARE[:-2], "--levels", "6"
    assert command("check", "c", *words, "--out", "out")[0] == 0
    table = tmp_path / "out" / "check.csv"
    assert command(*newer, *words[:-1], "600", "--out", "out")[0] == 2 and table.is_file()

    def failing(*_):
        raise RunError("no")

    monkeypatch.setattr("damjoint.runner.accuracy.solve", failing)
    words = *BARE[:-2], "--levels", "5"  # the same check would not be computed again
    assert command("run", "c", *words, "--out", "out/d")[0] == 1 and table.is_file()
    out = newer[-2:] if len(newer) > 2 else ("--out", "out")
    assert command(*newer[:2], *words, *out)[0] == 1 and not table.exists()


def test_a_check_csv_of_the_user_stays(command, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "check.csv").write_text("case,mine\nc,1\n")
    for out in "out/c", "out", "out":
        assert command("run", "c", *BARE, "--levels", "6", "--out", out)[0] == 0
        assert (tmp_path / "out" / "check.csv").read_text() == "case,mine\nc,1\n"


def test_two_checks_into_one_folder_are_refused(command, tmp_path):
    (tmp_path / "out").mkdir()
    with locked_folder(tmp_path / "out"):
        code, _, err = command("check", "c", "--out", "out")
    assert code == 2 and "another damjoint is writing to it" in err


@pytest.mark.heavy
def test_a_search_that_fails_removes_the_value_of_an_earlier_one(command, tmp_path, monkeypatch):
    words = "critical", "c", "--set", "n_joint=10", "--out", "out"
    assert command(*words)[0] == 0 and (tmp_path / "out" / "critical.csv").is_file()

    def failing(*_, **__):
        raise RunError("no")

    monkeypatch.setattr("damjoint.studies.critical.FailurePath", failing)
    assert command(*words)[0] == 1
    info = json.loads((tmp_path / "out" / "run.json").read_text())
    assert (info["state"], info["statement"]) == ("failed", "no")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["run.json"]


@pytest.mark.parametrize(
    "words, what",
    [
        (("run", "c", *BARE), "damjoint.runner.accuracy.solve"),
        (("critical", "c"), "damjoint.studies.critical.FailurePath"),
        (("quake", "dam", "--record", "wave.csv"), "damjoint.studies.quake.QuakeRun"),
    ],
)
@pytest.mark.parametrize("error, state", [(RunError, "failed"), (KeyboardInterrupt, "interrupted")])
def test_a_study_that_ends_without_results_says_where_and_when(
    command, tmp_path, monkeypatch, words, what, error, state
):
    """The same entries for each study."""
    (tmp_path / "wave.csv").write_text("time,horizontal\n0,0\n0.1,1\n0.2,0\n")

    def ends(*_, **__):
        raise error("no")

    monkeypatch.setattr(what, ends)
    settings = ("--set", "rho_dam=24") + (("--set", "record_unit=g") if words[0] == "quake" else ())
    assert command(*words, *settings, "--out", "out")[0] in (1, 130)
    info = json.loads((tmp_path / "out" / "run.json").read_text())
    assert info["state"] == state and info["machine"] and info["peak_memory_mb"] > 10
    assert {"commit", "wall_seconds", "statement"} <= info.keys() and info["versions"]["numpy"]
    assert any(note.startswith("rho_dam = 24 ") for note in info["notes"])


@pytest.mark.heavy
def test_a_removal_that_is_interrupted_is_completed_by_the_next_run(command, tmp_path, monkeypatch):
    """run.json, by which files are damjoint's, is removed last."""
    words = "run", "c", *SMALL, "--levels", "6", "--out", "out"
    assert command(*words)[0] == 0
    unlink = Path.unlink

    def killed(path, **options):
        unlink(path, **options)
        if path.name == "history.csv":
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", killed)
        assert command(*words)[0] == 130
    assert (tmp_path / "out" / "run.json").is_file()
    assert command("run", "a", *BARE, "--levels", "6", "--out", "out")[0] == 0
    assert not list((tmp_path / "out").rglob("c*")) and not (tmp_path / "out" / "fields").exists()


def test_only_files_of_damjoint_are_removed(command, tmp_path):
    """A run.json of another program; files with names of damjoint are overwritten."""
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "run.json").write_text('{"case": "../../elsewhere", "by": "me"}')
    (tmp_path / "out" / "curve.csv").write_text("mine")
    assert command("run", "c", *BARE, "--levels", "6", "--out", "out")[0] == 0
    assert (tmp_path / "out" / "curve.csv").read_text() == "mine"


@pytest.mark.parametrize("engine", further(1, ["condensed", "getdp"]))
def test_a_run_that_stops_writes_its_last_state(command, tmp_path, engine):
    """Tables, fields and picture, also between two requested levels."""
    hardening = "--set", "pena_tang=0", "--set", "uplift=none"
    words = "run", "c", *SMALL, *hardening, "--levels", "7.4,7.6", "--engine", engine
    code, out, err = command(*words)
    assert code == 1 and "sliding: no equilibrium beyond level 7.45" in out and err == ""
    record = json.loads((tmp_path / "out/c/run.json").read_text())
    assert (record["state"], record["verdict"]) == ("stopped", "sliding")
    joint, history = read(tmp_path / "out/c/joint.csv"), read(tmp_path / "out/c/history.csv")
    assert joint["time"].max() == history["time"][-1] and 1 < joint["time"].max() < 2
    assert len(list((tmp_path / "out/c/fields").glob("dam_t*.vtu"))) == 2


def test_a_dam_on_the_default_hardening_is_reported_as_sliding(command, tmp_path):
    """T > mu N + c L: statement, run.json, exit code 1; 0 if hardening is set."""
    words = "run", "c", *BARE, "--set", "uplift=none", "--levels", "7,9", "--set"
    code, out, _ = command(*words, "pena_tang=-1", "--out", "default")
    assert code == 1
    assert "sliding: the shear force on the joint exceeds its strength from level 9 m on" in out
    record = json.loads((tmp_path / "default" / "run.json").read_text())
    assert (record["state"], record["verdict"]) == ("complete", "sliding")
    code, out, _ = command(*words, "pena_tang=2e11", "--out", "set")
    assert code == 0 and "stands on the hardening pena_tang = 2e+11" in out


def test_the_last_level_always_has_a_joint_table(command, tmp_path):
    assert command("run", "k", *BARE)[0] == 0
    joint, history = (read(tmp_path / f"out/k/{name}.csv") for name in ("joint", "history"))
    assert joint["time"].max() == history["time"][-1] == 4.84
    assert np.isclose(joint["time"], 3.84).any()  # the end of the prescribed opening


def test_units_and_verdict_in_run_json(command, tmp_path):
    assert command("run", "e", *BARE, "--levels", "3")[0] == 0
    record = json.loads((tmp_path / "out/e/run.json").read_text())
    columns = [*read(tmp_path / "out/e/joint.csv"), *read(tmp_path / "out/e/history.csv")]
    assert set(columns) == set(record["units"]) and record["units"]["sigma_n_eff"] == "Pa"
    assert record["verdict"] == "stands" and record["state"] == "complete"


def test_tailwater_in_the_history(command, tmp_path):
    words = "run", "c", *BARE, "--levels", "6,9", "--tail-levels", "1,2", "--steps", "2"
    assert command(*words)[0] == 0
    history = read(tmp_path / "out/c/history.csv")
    assert list(history["tail_level"]) == [0.5, 1, 1.5, 2]
    uplift = 9810 * (history["level"] + history["tail_level"]) / 2 * 5
    assert np.allclose(history["U"], uplift, rtol=1e-9)


@pytest.mark.parametrize("engine", ["getdp", "condensed"])
def test_an_interrupted_run_writes_its_converged_steps(tmp_path, monkeypatch, engine):
    """Ctrl-C after the second step."""
    from damjoint import runner
    from damjoint.input.resolve import load

    def interrupt(self, scene, now):
        if now > 1:
            raise KeyboardInterrupt

    monkeypatch.setattr(runner.RunProgress, "step", interrupt)
    case = load("c", {"n_joint": 10.0, "h_dam": 3.0, "h_found": 4.0})
    with pytest.raises(KeyboardInterrupt):
        runner.run(case, tmp_path / "out", False, False, False, engine)
    history = read(tmp_path / "out" / "history.csv")
    assert 1 <= len(history["time"]) < 5
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert (
        record["state"] == record["verdict"] == "interrupted"
        and "after level" in record["statement"]
    )


@pytest.fixture
def fake_getdp(tmp_path, monkeypatch):
    """fake_getdp(script, version): use a shell script instead of GetDP."""

    def make(script, version="3.2.0"):
        fake = tmp_path / "getdp"
        fake.write_text(f'#!/bin/sh\n[ "$1" = --version ] && echo {version} && exit\n{script}\n')
        fake.chmod(0o755)
        monkeypatch.setenv("GETDP", str(fake))
        process.version_of.cache_clear()

    yield make
    process.version_of.cache_clear()


@pytest.mark.parametrize("printed", ["rubbish", "step abc", "step 1e+-.5 x", "Error   : it hurts"])
def test_invalid_output_of_getdp_is_reported(command, tmp_path, fake_getdp, printed):
    fake_getdp(f"echo '{printed}'; exit 3")
    code, _, err = command("run", "c", *BARE, "--engine", "getdp")
    assert code == 1 and len(err.splitlines()) == 1 and printed in err
    assert json.loads((tmp_path / "out/c/run.json").read_text())["state"] == "failed"


@pytest.mark.parametrize(
    "left, message",
    [
        ("true", "ended without writing status.txt"),
        ("echo 0 > status.txt; touch history.txt", "no step at t = 4"),
        ("echo 0 > status.txt; echo step 1 3 x y z 1 1 1 1 > history.txt", "'x'"),
        ("echo 0 > status.txt; head -c 900 /dev/urandom > history.txt", "tables can not be read"),
        (
            "echo 1 > status.txt; echo step 1 3 1 1 1 1 1 1 1 > history.txt; "
            "echo joint 1 1 1 1 1 1 1 1 1 1 1 1 1 > joints.txt",
            "jump_0_1",
        ),
        ("head -c 3000000 /dev/zero", "ended without writing status.txt"),
    ],
)
def test_an_invalid_file_of_getdp_is_reported(command, tmp_path, fake_getdp, left, message):
    """GetDP returns 0, as it does on a full disk."""
    fake_getdp(left)
    code, out, err = command("run", "c", *BARE, "--engine", "getdp")
    assert (code, out) == (1, "") and len(err.splitlines()) == 1 and message in err
    assert json.loads((tmp_path / "out/c/run.json").read_text())["state"] == "failed"


@pytest.fixture(scope="module")
def first_run(tmp_path_factory):
    """Script that runs GetDP; from the second time on it copies files and output of the first."""
    record = tmp_path_factory.mktemp("getdp") / "record"
    run = f'{shutil.which("getdp")} "$@" > printed && cp -r . {record}'
    return f"[ -d {record} ] || {{ {run}; }}; cp -r {record}/. . && cat printed"


@pytest.mark.parametrize("size", further(1, [0, -1]))
@pytest.mark.parametrize(
    "name",
    further(
        6,
        [
            *("scene.pre", "history.txt", "joints.txt", "status.txt", "jump_0_1.txt"),
            *("traction_0_2.txt", "path_0_2.txt", "mean_jump_0_0_1.txt", "law_scalar_0_2.txt"),
            *("u_1_1.txt", "stress_2.txt"),
        ],
    ),
)
def test_a_truncated_file_of_getdp_is_reported(
    command, tmp_path, fake_getdp, first_run, name, size
):
    """GetDP does not report a full disk; it must not be taken for a failure of the dam."""
    fake_getdp(f"{first_run} && head -c {size} {name} > cut && mv cut {name}")
    code, out, err = command("run", "c", *BARE[:-2], "--levels", "3,6", "--engine", "getdp")
    assert (code, out) == (1, "") and len(err.splitlines()) == 1 and name in err
    assert json.loads((tmp_path / "out/c/run.json").read_text())["state"] == "failed"


def test_a_law_table_of_getdp_without_a_row_is_reported(command, tmp_path, fake_getdp):
    (tmp_path / "path.csv").write_text("delta_n,delta_t1,delta_t2\n0,0,0\n1e-6,0,0\n")
    fake_getdp(f"{shutil.which('getdp')} \"$@\" && sed -i '$d' law.txt")
    code, out, err = command("law", "rupture", "--path", "path.csv")
    assert (code, out) == (1, "") and "1 of 2 rows" in err and len(err.splitlines()) == 1


def test_a_truncated_mesh_is_reported(command, tmp_path, monkeypatch):
    """Gmsh does not report a full disk."""
    monkeypatch.setattr(gmsh, "write", lambda path: Path(path).write_bytes(b"$MeshFormat"))
    code, out, err = command("run", "c", *BARE, "--levels", "3,6", "--engine", "getdp")
    assert (code, out) == (1, "") and len(err.splitlines()) == 1 and "scene.msh" in err


@pytest.mark.parametrize("version", ["2.11.3", "rubbish"])
def test_a_wrong_version_of_getdp_leaves_an_earlier_run_unchanged(
    command, tmp_path, fake_getdp, version
):
    assert command("run", "c", *BARE, "--levels", "6")[0] == 0
    before = {p: p.read_bytes() for p in (tmp_path / "out/c").iterdir()}
    fake_getdp("exit 1", version)
    code, _, err = command("run", "c", *BARE, "--levels", "6", "--engine", "getdp")
    assert code == 2 and "version" in err and "GetDP >= 3.2" in err and len(err.splitlines()) == 1
    assert {p: p.read_bytes() for p in (tmp_path / "out/c").iterdir()} == before


@pytest.mark.heavy
def test_no_temporary_file_of_getdp_remains(command, tmp_path, monkeypatch):
    """Nor of Open MPI."""
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    process.version_of.cache_clear()
    assert command("run", "c", *BARE, "--levels", "6", "--engine", "getdp")[0] == 0
    assert list((tmp_path / "tmp").iterdir()) == []


def test_a_run_that_fails_early_removes_the_results_of_an_earlier_one(command, tmp_path):
    """The bodies can not be eliminated: one line, also in run.json."""
    assert command("run", "c", *BARE, "--out", "out")[0] == 0
    thin = "--set", "dam_height=1e-12", "--levels", "0"
    code, _, err = command("run", "c", *BARE, *thin, "--out", "out")
    assert code == 1 and len(err.splitlines()) == 1
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["run.json"]
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert record["state"] == "failed" and record["statement"] in err


@pytest.mark.heavy
def test_a_title_may_be_long_and_contain_dollar_signs(command, tmp_path):
    (tmp_path / "ssnp142.case").write_text((CASES / "ssnp142.case").read_text())
    title = "costs $5_{ and $6 " * 12
    text = (
        f'Include "ssnp142.case"; title = "{title}"; default_n_joint = 10; default_drive = "heel";'
    )
    (tmp_path / "my.case").write_text(text)
    assert command("run", "my.case", "--no-fields")[0] == 0
    assert (tmp_path / "out/my/my.png").exists() and (tmp_path / "out/my/my_curve.png").exists()
