"""Entries of the cache: complete, of this scene and version, or computed again; nothing in a file
is executed.
"""

import json
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
from damjoint import storage
from damjoint.fem import cache
from damjoint.input.resolve import load
from damjoint.input.scene import TAILWATER

SMALL = {"n_joint": 6.0, "h_dam": 4.0, "h_found": 4.0}


@pytest.fixture
def entry(tmp_path, monkeypatch):
    """A cache with one entry: its file and the condensed bodies in it."""
    monkeypatch.setenv("DAMJOINT_CACHE", str(tmp_path))
    written, bodies = cache.condensed_bodies(load("a", SMALL))
    assert bodies is not None
    (file,) = tmp_path.glob("*.bin")
    return file, written


def same(first, second):
    return np.array_equal(first.stiffness, second.stiffness) and first.counts == second.counts


def test_all_of_an_entry_is_read_again(entry):
    """Types, names, numbers; arrays, by rows or columns, which decides the order of summation."""
    _, written = entry
    result, bodies = cache.condensed_bodies(load("a", SMALL))
    assert bodies is None and list(result.faces) == ["face2"]
    arrays = [], []
    trees = [cache.pack(c, a) for c, a in zip((result, written), arrays, strict=True)]
    assert trees[0] == trees[1] and len(arrays[0]) > 20
    for array, before in zip(*arrays, strict=True):
        assert array.dtype == before.dtype and np.array_equal(array, before)
        assert array.flags.c_contiguous == before.flags.c_contiguous


def test_bodies_in_the_cache_have_all_faces_under_water(tmp_path, monkeypatch):
    """A face above the tailwater of the case condensed first, which another's reaches: the neck."""
    monkeypatch.setenv("DAMJOINT_CACHE", str(tmp_path))
    below, lower, above = (
        load("dam", SMALL | {"neck_height": 10}, (44.0,), (tail,)) for tail in (3.0, 4.0, 42.0)
    )
    downstream = [
        [
            face.low
            for face in cache.condensed_bodies(case)[0].faces.values()
            if face.side in TAILWATER
        ]
        for case in (below, above)
    ]
    assert [sorted(heights) for heights in downstream] == [[0], [0, 35]]
    assert cache.bodies_key(below) == cache.bodies_key(lower)


class Trap:
    """Object whose pickle creates a file when it is loaded."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


@pytest.mark.parametrize("damage", ["truncated", "foreign", "pickle", "empty", "other header"])
def test_a_damaged_entry_is_computed_again(entry, tmp_path, damage):
    file, written = entry
    whole = file.read_bytes()
    if damage == "truncated":
        file.write_bytes(whole[: len(whole) // 2])
    elif damage == "foreign":
        np.savez(file.open("wb"), header=np.array("something else"))
    elif damage == "pickle":
        file.write_bytes(pickle.dumps(Trap(tmp_path / "trap")))
    elif damage == "empty":
        file.write_bytes(b"")
    else:
        with storage.write_entry(file, "0.0.0") as other:
            other.write(whole.split(b"\n", 2)[2])
    result, bodies = cache.condensed_bodies(load("a", SMALL))
    assert bodies is not None and same(result, written)
    assert not (tmp_path / "trap").exists()
    assert cache.condensed_bodies(load("a", SMALL))[1] is None  # stored again


def flipped(whole, step=1):
    """The bytes with one bit changed: of all their bits, every step-th."""
    for bit in range(0, 8 * len(whole), step):
        damaged = bytearray(whole)
        damaged[bit // 8] ^= 1 << bit % 8
        yield bytes(damaged)


@pytest.mark.heavy
def test_an_entry_with_a_changed_bit_is_not_read(entry, monkeypatch):
    """Wherever it is: checksum, key, tree, the arrays' shapes and numbers."""
    file, _ = entry
    header = json.dumps([cache.__version__, cache.sources(), cache.bodies_key(load("a", SMALL))])
    assert cache.read(file, header) is not None
    whole = file.read_bytes()
    heads = [i for i in range(len(whole)) if whole.startswith(b"\x93NUMPY", i)]
    assert len(heads) > 20
    for first in (0, *heads[:3]):  # every bit of the lines before the arrays, and of three heads
        until = heads[0] if first == 0 else first + 128
        for part in flipped(whole[first:until], 1 if first else 5):
            file.write_bytes(whole[:first] + part + whole[until:])
            assert cache.read(file, header) is None
    for damaged in flipped(whole, 8 * len(whole) // 500):
        file.write_bytes(damaged)
        assert cache.read(file, header) is None


def test_an_entry_with_a_changed_bit_is_replaced(entry):
    file, written = entry
    file.write_bytes(next(flipped(file.read_bytes()[::-1]))[::-1])
    result, bodies = cache.condensed_bodies(load("a", SMALL))
    assert bodies is not None and same(result, written)
    assert cache.condensed_bodies(load("a", SMALL))[1] is None  # replaced


@pytest.mark.heavy
def test_a_value_with_a_changed_bit_is_computed_again(tmp_path, monkeypatch):
    """Every bit of the entry, and every length."""
    monkeypatch.setenv("DAMJOINT_CACHE", str(tmp_path))
    value = {"mu": [0.5], "uplift": ["imposed"]}
    assert storage.cached("variables", "key", lambda: value) == value
    (file,) = tmp_path.iterdir()
    whole = file.read_bytes()
    assert storage.cached("variables", "key", pytest.fail) == value
    for damaged in (*flipped(whole), *(whole[:length] for length in range(len(whole)))):
        file.write_bytes(damaged)
        assert storage.cached("variables", "key", lambda: value) is value
        assert file.read_bytes() == whole  # replaced


def test_a_value_of_another_key_or_in_a_pipe_is_computed_again(tmp_path, monkeypatch):
    monkeypatch.setenv("DAMJOINT_CACHE", str(tmp_path))
    monkeypatch.setattr(storage.zlib, "crc32", lambda *_: 1)  # the same file for all keys
    assert [storage.cached("variables", key, lambda k=key: k) for key in "aba"] == ["a", "b", "a"]
    (file,) = tmp_path.iterdir()
    file.unlink()
    os.mkfifo(file)
    assert storage.cached("variables", "a", lambda: 1) == 1


@pytest.mark.heavy
def test_a_run_with_any_damaged_entry_has_the_same_result(tmp_path, monkeypatch):
    """All kinds of entries that a run leaves; a value of the case that is another valid one."""
    small = [word for name, size in SMALL.items() for word in ("--set", f"{name}={size}")]
    words = ["run", "a", *small, "--no-fields", "--no-picture", "--out", str(tmp_path / "out")]
    environment = os.environ | {"DAMJOINT_CACHE": str(tmp_path / "cache")}

    def run():
        line = [sys.executable, "-m", "damjoint", *words]
        done = subprocess.run(line, env=environment, capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (0, "")
        return done.stdout, (tmp_path / "out" / "joint.csv").read_bytes()

    first = run()
    entries = list((tmp_path / "cache").iterdir())
    kinds = {entry.name.split("-")[0] for entry in entries}
    assert kinds - {"mumps"} == {"declarations", "variables", "bodies"}
    for entry in entries:
        content = entry.read_bytes()
        digit = content.find(b'"sigma_max": [') + 15 if entry.suffix == ".json" else -100
        entry.write_bytes(content[:digit] + bytes([content[digit] ^ 1]) + content[digit + 1 :])
    assert run() == first


def test_a_pipe_in_place_of_an_entry_is_not_read(entry):
    file, written = entry
    file.unlink()
    os.mkfifo(file)
    result, bodies = cache.condensed_bodies(load("a", SMALL))
    assert bodies is not None and same(result, written)


def test_nothing_is_written_through_links(entry, tmp_path_factory):
    file, _ = entry
    mine = tmp_path_factory.mktemp("mine") / "mine"
    mine.write_text("mine")
    file.with_name(storage.PART + file.name).symlink_to(mine)
    file.write_bytes(b"")
    assert cache.condensed_bodies(load("a", SMALL))[1] is not None
    assert mine.read_text() == "mine"
    assert cache.condensed_bodies(load("a", SMALL))[1] is None


def test_an_array_of_objects_is_not_loaded(entry, tmp_path):
    """Though the checksum is right."""
    file, written = entry
    header = json.dumps([cache.__version__, cache.sources(), cache.bodies_key(load("a", SMALL))])
    with storage.write_entry(file, header) as damaged:
        damaged.write(b'{"arrays": 1, "tree": {"array": 0}}\n')
        np.save(damaged, np.array([Trap(tmp_path / "trap")]), allow_pickle=True)
    result, bodies = cache.condensed_bodies(load("a", SMALL))
    assert bodies is not None and same(result, written)
    assert not (tmp_path / "trap").exists()


def test_a_cache_that_can_not_be_written_is_ignored(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("DAMJOINT_CACHE", str(tmp_path / "file" / "below"))
    assert cache.condensed_bodies(load("a", SMALL))[1] is not None


def test_an_entry_of_other_meshing_code_is_not_read(entry, monkeypatch):
    """After a change of geo/ or of the elements."""
    monkeypatch.setattr(cache, "sources", lambda: "changed")
    assert cache.condensed_bodies(load("a", SMALL))[1] is not None


def test_the_least_recently_used_files_are_removed(tmp_path, monkeypatch):
    """Whatever their names, and no more than necessary."""
    for age, name in enumerate("bdac"):
        (tmp_path / f"{name}.bin").write_bytes(bytes(10))
        os.utime(tmp_path / f"{name}.bin", (0, 1e9 - 100 * age))
    monkeypatch.setattr(cache, "LIMIT", 20)
    cache.prune(tmp_path)
    assert sorted(file.stem for file in tmp_path.iterdir()) == ["b", "d"]


@pytest.mark.heavy
def test_a_command_with_cached_data_does_not_start_gmsh(tmp_path, monkeypatch):
    """Parameters and the case are read from the cache, and give the same bytes."""
    monkeypatch.setenv("DAMJOINT_CACHE", str(tmp_path / "cache"))
    program = (
        "import sys; from damjoint.cli import main; code = main(sys.argv[1:]); "
        "print('gmsh' in sys.modules); sys.exit(code)"
    )
    small = [word for name, size in SMALL.items() for word in ("--set", f"{name}={size}")]
    loaded, tables = [], []
    for out in "first", "second":
        words = ["run", "a", *small, "--no-fields", "--no-picture", "--out", str(tmp_path / out)]
        result = subprocess.run([sys.executable, "-c", program, *words], capture_output=True)
        loaded.append(result.stdout.split()[-1])
        tables.append((tmp_path / out / "joint.csv").read_bytes())
    assert loaded == [b"True", b"False"] and tables[0] == tables[1]
