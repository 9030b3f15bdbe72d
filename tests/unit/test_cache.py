"""Condensed bodies in the cache: complete, of this scene and version, or computed again; nothing in
a file is executed.
"""

import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
from damjoint.fem import cache
from damjoint.model.case import load

SMALL = {"n_joint": 6.0, "h_dam": 4.0, "h_found": 4.0}


@pytest.fixture
def entry(tmp_path, monkeypatch):
    """A cache with one entry: its file and the condensed bodies in it."""
    monkeypatch.setenv("DAMJOINT_CACHE", str(tmp_path))
    written, bodies = cache.cached(load("a", SMALL))
    assert bodies is not None
    (file,) = tmp_path.glob("*.npz")
    return file, written


def same(first, second):
    return np.array_equal(first.stiffness, second.stiffness) and first.counts == second.counts


def test_all_of_an_entry_is_read_again(entry):
    """Types, names, numbers, arrays."""
    _, written = entry
    result, bodies = cache.cached(load("a", SMALL))
    assert bodies is None and list(result.faces) == ["face2"]
    arrays = {}, {}
    trees = [cache.pack(c, "", a) for c, a in zip((result, written), arrays, strict=True)]
    assert trees[0] == trees[1] and len(arrays[0]) > 20
    for name, array in arrays[0].items():
        assert array.dtype == arrays[1][name].dtype and np.array_equal(array, arrays[1][name])


def test_bodies_in_the_cache_have_all_faces_under_water(tmp_path, monkeypatch):
    """A face above the tailwater of the case that was condensed first: the neck, in a case whose
    tailwater reaches it.
    """
    monkeypatch.setenv("DAMJOINT_CACHE", str(tmp_path))
    below, lower, above = (
        load("dam", SMALL | {"neck_height": 10}, (44.0,), (tail,)) for tail in (3.0, 4.0, 42.0)
    )
    downstream = [
        [face.low for face in cache.cached(case)[0].faces.values() if face.tailwater]
        for case in (below, above)
    ]
    assert [sorted(heights) for heights in downstream] == [[0], [0, 35]]
    assert cache.key_of(below) == cache.key_of(lower)


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
        np.savez(file, header=np.array("something else"))
    elif damage == "pickle":
        file.write_bytes(pickle.dumps(Trap(tmp_path / "trap")))
    elif damage == "empty":
        file.write_bytes(b"")
    else:
        with np.load(file) as result:
            np.savez(file, **{**result, "header": np.array("0.0.0")})
    result, bodies = cache.cached(load("a", SMALL))
    assert bodies is not None and same(result, written)
    assert not (tmp_path / "trap").exists()
    assert cache.cached(load("a", SMALL))[1] is None  # stored again


@pytest.mark.parametrize(
    "place, value",
    [
        pytest.param(6, 99, id="version"),
        pytest.param(8, 1, id="encrypted"),
        pytest.param(10, 97, id="compression"),
        pytest.param(46, 0, id="name"),
    ],
)
def test_an_entry_with_a_changed_byte_is_replaced(entry, place, value):
    """In the directory of the zip file."""
    file, written = entry
    data = bytearray(file.read_bytes())
    data[data.index(b"PK\x01\x02") + place] = value
    file.write_bytes(data)
    result, bodies = cache.cached(load("a", SMALL))
    assert bodies is not None and same(result, written)
    assert cache.cached(load("a", SMALL))[1] is None  # replaced


def test_an_entry_without_an_array_is_computed_again(entry):
    """E.g. if the length of the array before it in the directory is damaged."""
    file, written = entry
    with np.load(file) as result:
        np.savez(
            file, **{name: result[name] for name in result.files if name != "bodies/units/dam_x"}
        )
    result, bodies = cache.cached(load("a", SMALL))
    assert bodies is not None and result.units.keys() == written.units.keys()


def test_a_pipe_in_place_of_an_entry_is_not_read(entry):
    file, written = entry
    file.unlink()
    os.mkfifo(file)
    result, bodies = cache.cached(load("a", SMALL))
    assert bodies is not None and same(result, written)


def test_nothing_is_written_through_links(entry, tmp_path_factory):
    file, _ = entry
    mine = tmp_path_factory.mktemp("mine") / "mine"
    mine.write_text("mine")
    file.with_suffix(f".{os.getpid()}").symlink_to(mine)
    file.write_bytes(b"")
    assert cache.cached(load("a", SMALL))[1] is not None
    assert mine.read_text() == "mine"
    assert cache.cached(load("a", SMALL))[1] is None


def test_an_array_of_objects_is_not_loaded(entry, tmp_path):
    file, written = entry
    with np.load(file) as result:
        arrays = dict(result)
    arrays["bodies/stiffness"] = np.array([Trap(tmp_path / "trap")], dtype=object)
    np.savez(file, **arrays)
    result, bodies = cache.cached(load("a", SMALL))
    assert bodies is not None and same(result, written) and not (tmp_path / "trap").exists()


def test_a_cache_that_can_not_be_written_is_ignored(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("DAMJOINT_CACHE", str(tmp_path / "file" / "below"))
    assert cache.cached(load("a", SMALL))[1] is not None


def test_an_entry_of_other_meshing_code_is_not_read(entry, monkeypatch):
    """After a change of geo/ or of the elements."""
    monkeypatch.setattr(cache, "sources", lambda: "changed")
    assert cache.cached(load("a", SMALL))[1] is not None


def test_the_least_recently_used_files_are_removed(tmp_path, monkeypatch):
    """Whatever their names, and no more than necessary."""
    for age, name in enumerate("bdac"):
        (tmp_path / f"{name}.npz").write_bytes(bytes(10))
        os.utime(tmp_path / f"{name}.npz", (0, 1e9 - 100 * age))
    monkeypatch.setattr(cache, "LIMIT", 20)
    cache.prune(tmp_path)
    assert sorted(file.stem for file in tmp_path.iterdir()) == ["b", "d"]


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
