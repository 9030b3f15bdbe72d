"""The result file of a sweep: keys of all that decides a row, interrupts, damage, deletion."""

import csv
import json
import os
import resource
from dataclasses import replace

import pytest
from damjoint import InputError, data
from damjoint.input.resolve import load, varied
from damjoint.mesh.mesh import mesh_of
from damjoint.processes import ProcessKilled, process_pool
from damjoint.studies import keys
from damjoint.studies.plan import Limits, Plan
from damjoint.studies.result_file import result_file
from damjoint.studies.sweep import row_key
from own_mesh import OwnMesh

pytestmark = pytest.mark.usefixtures("no_pictures")

SMALL = ("--set", "n_joint=10", "--set", "h_dam=3", "--set", "h_found=4")
WORDS = "sweep", "c", *SMALL, "--jobs", "1", "--out", "mu.csv"


def rows(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def own_case(folder, height=1.0, rename=()):
    """A case on a mesh of its own of a small dam, as high as set, with other names of regions."""
    mesh = OwnMesh.of(load("c", {"n_joint": 4.0, "h_dam": 5.0, "h_found": 5.0}))
    regions = {dict(rename).get(name, name): region for name, region in mesh.regions.items()}
    points = mesh.points.copy()
    points[points[:, 1] > 0, 1] *= height
    replace(mesh, points=points, regions=regions).write(folder / "own.msh")
    (folder / "own.case").write_text('geometry = "own.msh";\nlevels() = {3};\n')
    return load(str(folder / "own.case"))


def test_the_content_of_a_mesh_is_part_of_the_key(command, tmp_path):
    """The rows of another mesh of the same name are not returned as this one's."""
    own_case(tmp_path)
    words = "sweep", "own.case", "--vary", "mu=0.5", "--out", "mu.csv"
    assert "1 rows computed" in command(*words)[1]
    assert "nothing to compute" in command(*words)[1]
    own_case(tmp_path, height=1.5)
    assert "1 rows computed" in command(*words)[1]
    first, second = rows(tmp_path / "mu.csv")
    assert float(second["N"]) == pytest.approx(1.5 * float(first["N"]), rel=0.1)


def test_the_sides_of_a_mesh_are_part_of_the_key(tmp_path):
    case = own_case(tmp_path)
    key = keys.study_key(case)
    other = {"downstream": "crest surface"}
    assert keys.study_key(own_case(tmp_path, rename=other)) != key
    assert keys.study_key(own_case(tmp_path)) == key


def test_the_key_of_a_geometry_follows_the_values_and_files_that_it_uses(tmp_path, monkeypatch):
    """Not all values, for each of which the mesh would be made again."""
    monkeypatch.setenv("DAMJOINT_RUN_GEO", "1")
    (tmp_path / "own.geo").write_text('Include "inner.geo";\n')
    text = (data("geo") / "pressed.geo").read_text().replace('"../pro', f'"{data("pro")}')
    (tmp_path / "inner.geo").write_text(text)
    (tmp_path / "own.case").write_text('geometry = "own.geo";\nlevels() = {1};\n')
    case = load(str(tmp_path / "own.case"))
    mesh = mesh_of(case)
    assert mesh_of(varied(case, {"silt_height": 0.5, "mu": 0.7})) is mesh
    (tmp_path / "inner.geo").write_text(f"{text}\nused = silt_height;\n")
    other = mesh_of(case)
    assert other is not mesh and mesh_of(varied(case, {"mu": 0.7})) is other
    assert mesh_of(varied(case, {"silt_height": 0.5})) is not other


@pytest.mark.parametrize(
    "case, plan",
    [
        ({"pena_tang": 0.0}, {}),  # set to its default: the dam then stands on the hardening
        ({}, {"sampled": {"mu": [0.5]}}),  # rows that statics decides have no columns
        ({}, {"critical": "level"}),
        ({}, {"quake": Limits((0.1,))}),
    ],
)
def test_what_else_decides_a_row_is_part_of_the_key(case, plan):
    keys = [row_key(load("c"), Plan({}, {}, {}))]
    keys.append(row_key(load("c", case), Plan(**{"varied": {}, "sampled": {}, "tied": {}} | plan)))
    assert len(set(keys)) == 2


@pytest.mark.heavy
def test_a_torn_last_line_is_computed_again_and_no_other(command, tmp_path):
    """At each length of it; also of the first line."""
    assert command(*WORDS, "--vary", "mu=0.5,0.6")[0] == 0
    file = tmp_path / "mu.csv"
    whole = file.read_bytes()
    last = whole[:-1].rfind(b"\n") + 1
    for length in (last, last + 1, (last + len(whole)) // 2, len(whole) - 1):
        file.write_bytes(whole[:length])
        code, out, _ = command(*WORDS, "--vary", "mu=0.5,0.6")
        assert code == 0 and file.read_bytes() == whole
        assert "1 rows computed, 1 rows were there already; mu.csv" in out
    for length in (0, 1, 20):
        file.write_bytes(whole[:length])
        assert "2 rows computed" in command(*WORDS, "--vary", "mu=0.5,0.6")[1]
        assert file.read_bytes() == whole


def test_rows_that_another_process_adds_before_the_lock_are_kept(tmp_path):
    """The end is read and repaired under the lock."""
    path = tmp_path / "rows.csv"
    with result_file(path, ("key", "x"), ("x",)) as (file, done):
        file.add(["a", "1"])
        assert done == {}
        again = result_file(path, ("key", "x"), ("x",))
        with pytest.raises(InputError, match="another damjoint"), again:
            pass
        file.add(["b", "2"])
    path.write_text(path.read_text() + "c")
    with result_file(path, ("key", "x"), ("x",)) as (file, done):
        assert done == {"a": {"key": "a", "x": "1"}, "b": {"key": "b", "x": "2"}}
        assert path.read_text() == "key,x\na,1\nb,2\n"


def test_a_repair_that_is_interrupted_loses_no_row(tmp_path, monkeypatch):
    path = tmp_path / "rows.csv"
    path.write_text("key,x\na,1\nb")

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "ftruncate", interrupted)
    with pytest.raises(KeyboardInterrupt), result_file(path, ("key", "x"), ("x",)):
        pass
    assert path.read_text() == "key,x\na,1\nb"


@pytest.mark.parametrize("replaced", [False, True])
def test_a_file_that_is_deleted_meanwhile_is_one_line(command, tmp_path, monkeypatch, replaced):
    from damjoint.studies import sweep

    last_rows = sweep.last_rows

    def deleting(tasks):
        (tmp_path / "mu.csv").unlink()
        if replaced:
            (tmp_path / "mu.csv").write_text("mine")
        return last_rows(tasks)

    monkeypatch.setattr(sweep, "last_rows", deleting)
    code, _, err = command(*WORDS, "--vary", "mu=0.5")
    assert code == 1 and err.splitlines() == [err.strip()]
    assert "out = mu.csv: has been deleted or replaced meanwhile" in err
    assert [p.read_text() for p in tmp_path.glob("*.csv")] == ["mine"] * replaced


def test_a_full_disk_keeps_the_rows_before(tmp_path):
    """The error names the file; the torn row is removed by the next sweep."""
    path, soft_and_hard = tmp_path / "rows.csv", resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (13, soft_and_hard[1]))
        with result_file(path, ("key", "x"), ("x",)) as (file, _):
            file.add(["a", "1"])
            with pytest.raises(OSError, match=r"File too large: '.*rows\.csv'"):
                file.add(["b", "2"])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, soft_and_hard)
    assert path.read_text() == "key,x\na,1\nb,2"
    with result_file(path, ("key", "x"), ("x",)) as (file, done):
        assert [*done] == ["a"] and path.read_text() == "key,x\na,1\n"


def test_a_killed_process_is_an_error_that_counts_the_saved_rows(command, tmp_path, monkeypatch):
    from damjoint.studies import sweep

    def killed(tasks, jobs, scheduler):
        key, task = next(iter(tasks.items()))
        yield key, sweep.last_rows([task])[0]
        with process_pool(1) as pool:
            pool.submit(os._exit, 9).result()

    without_rows = r"^a process was killed \(out of memory\?\); --jobs 1"
    with pytest.raises(ProcessKilled, match=without_rows), process_pool(1) as pool:
        pool.submit(os._exit, 9).result()
    monkeypatch.setattr(sweep, "spread", killed)
    code, _, err = command(*WORDS, "--vary", "mu=0.5,0.6")
    assert code == 1 and "1 rows are saved, the same command continues" in err
    assert len(rows(tmp_path / "mu.csv")) == 1


def test_bad_input_and_a_sweep_without_a_row_leave_no_file(command, tmp_path, monkeypatch):
    from damjoint.studies import sweep

    code, _, err = command(*WORDS, "--vary", "mu=0.5", "--scheduler", "nowhere")
    assert code == 2 and not (tmp_path / "mu.csv").exists()

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(sweep, "last_rows", interrupted)
    code, _, err = command(*WORDS, "--vary", "mu=0.5")
    assert (code, err) == (130, "damjoint: interrupted\n") and not list(tmp_path.iterdir())


def test_an_interrupt_says_what_is_saved(command, tmp_path, monkeypatch):
    from damjoint.studies import sweep

    last_rows, done = sweep.last_rows, []

    def interrupted(tasks):
        if done:
            raise KeyboardInterrupt
        done.append(tasks)
        return last_rows(tasks)

    monkeypatch.setattr(sweep, "last_rows", interrupted)
    (tmp_path / "mu.png").touch()
    code, _, err = command(*WORDS, "--vary", "mu=0.5,0.6")
    assert (code, err) == (130, "damjoint: interrupted; results finished so far are saved\n")
    assert len(rows(tmp_path / "mu.csv")) == 1
    assert not (tmp_path / "mu.png").exists()  # of the rows before
    record = json.loads((tmp_path / "mu_run.json").read_text())
    assert (record["state"], record["statement"]) == ("interrupted", "1 rows were added")
    assert record["machine"] and record["wall_seconds"]
    monkeypatch.setattr(sweep, "last_rows", last_rows)
    for added in (1, 1):  # nothing is missing the second time: the record stays
        assert command(*WORDS, "--vary", "mu=0.5,0.6")[0] == 0
        record = json.loads((tmp_path / "mu_run.json").read_text())
        assert (record["state"], record["rows_added"], record["sweep"]["rows"]) == (
            "complete",
            added,
            2,
        )
