"""Condensed bodies on disk: whole, of this scene and version, or made anew; nothing is executed."""

import pickle

import numpy as np
import pytest
from damjoint.engines.condensed import cache
from damjoint.scene.case import load

SMALL = {"n_joint": 6.0, "h_dam": 4.0, "h_found": 4.0}


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """A cache with one entry: the file, and what it holds."""
    monkeypatch.setenv("DAMJOINT_CACHE", str(tmp_path))
    made, bodies = cache.cached(load("a", SMALL))
    assert bodies is not None
    (file,) = tmp_path.iterdir()
    return file, made


def same(one, other):
    return np.array_equal(one.stiffness, other.stiffness) and one.counts == other.counts


def test_an_entry_is_found_again(kept):
    _, made = kept
    found, bodies = cache.cached(load("a", SMALL))
    assert bodies is None and same(found, made)
    assert [shape for shape, _ in found.joint.cells] == [shape for shape, _ in made.joint.cells]
    assert list(found.faces) == ["face2"] and found.width == made.width


class Trap:
    """What a pickle would run on loading."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


@pytest.mark.parametrize("damage", ["truncated", "foreign", "pickle", "empty", "other header"])
def test_a_bad_entry_is_made_anew(kept, tmp_path, damage):
    file, made = kept
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
        with np.load(file) as found:
            np.savez(file, **{**found, "header": np.array("0.0.0")})
    found, bodies = cache.cached(load("a", SMALL))
    assert bodies is not None and same(found, made)
    assert not (tmp_path / "trap").exists()
    assert cache.cached(load("a", SMALL))[1] is None  # and kept again


def test_an_array_of_objects_is_not_loaded(kept, tmp_path):
    file, made = kept
    with np.load(file) as found:
        arrays = dict(found)
    arrays["stiffness"] = np.array([Trap(tmp_path / "trap")], dtype=object)
    np.savez(file, **arrays)
    found, bodies = cache.cached(load("a", SMALL))
    assert bodies is not None and same(found, made) and not (tmp_path / "trap").exists()


def test_a_folder_that_can_not_be_written_costs_time_only(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("DAMJOINT_CACHE", str(tmp_path / "file" / "below"))
    assert cache.cached(load("a", SMALL))[1] is not None


def test_another_mesh_makes_other_bodies(kept, monkeypatch):
    """After a change of geo/ or of the elements nothing old is found."""
    monkeypatch.setattr(cache, "sources", lambda: "changed")
    assert cache.cached(load("a", SMALL))[1] is not None
