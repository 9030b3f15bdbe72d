"""A benchmark that is interrupted goes on where it was."""

import numpy as np
import pytest
from damjoint_tools.bench import Kept, Table


@pytest.fixture
def path(tmp_path):
    return tmp_path / "measured.jsonl"


def test_a_row_is_measured_once(path):
    for measured in (lambda: ("end", np.int64(2), 1.5), None):  # the second time nothing is called
        table = Table("stress", "law", "E", "end", "level", "cuts")
        table.once(Kept(path, False), ("bond", 1e-6), measured)
        assert table == {"law": ["bond"], "E": [1e-6], "end": ["end"], "level": [2], "cuts": [1.5]}


def test_a_half_written_row_is_measured_again(path):
    kept = Kept(path, False)
    kept.once(("a",), lambda: np.arange(3.0))
    kept.once(("b",), lambda: 1)
    path.write_text(path.read_text()[:-3])
    again = Kept(path, False)
    assert again.has(("a",)) and not again.has(("b",))
    assert again.once(("b",), lambda: 2) == 2
    assert Kept(path, False).once(("b",), lambda: 3) == 2


def test_what_other_code_has_measured_is_not_taken(path, monkeypatch):
    Kept(path, False).once(("a",), lambda: 1)
    assert not Kept(path, True).has(("a",))
    Kept(path, False).once(("a",), lambda: 1)
    other = {**Kept(path, False).provenance, "code": "other"}
    monkeypatch.setattr("damjoint_tools.bench.provenance", lambda: other)
    assert not Kept(path, False).has(("a",))
    assert Kept(path, False).provenance == other


def test_what_was_begun_earlier_keeps_its_day_and_commit(path, monkeypatch):
    """The same code under another commit, on another day: taken, and said to be of the first."""
    begun = Kept(path, False)
    begun.once(("a",), lambda: 1)
    later = {**begun.provenance, "date": "2999-01-01", "commit": "0000000"}
    monkeypatch.setattr("damjoint_tools.bench.provenance", lambda: later)
    again = Kept(path, False)
    assert again.has(("a",)) and again.provenance == begun.provenance
