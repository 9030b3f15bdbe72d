"""The log from which an interrupted benchmark is resumed."""

import numpy as np
import pytest
from damjoint_tools.bench_table import Measurements, Table


@pytest.fixture
def path(tmp_path):
    return tmp_path / "measured.jsonl"


def test_a_row_is_measured_only_the_first_time(path):
    for measure in (lambda: ("end", np.int64(2), 1.5), None):  # the second is not called
        table = Table("stress", "law", "E", "end", "level", "cuts")
        table.add_measured(Measurements(path, False), ("bond", 1e-6), measure)
        assert table == {"law": ["bond"], "E": [1e-6], "end": ["end"], "level": [2], "cuts": [1.5]}


def test_a_value_written_by_half_is_measured_again(path):
    interrupted = Measurements(path, False)
    interrupted.get(("a",), lambda: np.arange(3.0))
    interrupted.get(("b",), lambda: 1)
    path.write_text(path.read_text()[:-3])
    resumed = Measurements(path, False)
    assert ("a",) in resumed and ("b",) not in resumed
    assert resumed.get(("b",), lambda: 2) == 2
    assert Measurements(path, False).get(("b",), lambda: 3) == 2


def test_values_of_other_code_or_of_the_short_form_are_discarded(path, monkeypatch):
    Measurements(path, False).get(("a",), lambda: 1)
    assert ("a",) not in Measurements(path, True)
    Measurements(path, False).get(("a",), lambda: 1)
    other = {**Measurements(path, False).provenance, "code": "other"}
    monkeypatch.setattr("damjoint_tools.bench_table.provenance", lambda: other)
    assert ("a",) not in Measurements(path, False)
    assert Measurements(path, False).provenance == other


def test_a_resumed_benchmark_has_the_date_and_commit_of_its_first_value(path, monkeypatch):
    """The code is the same, the commit and the day are not."""
    first = Measurements(path, False)
    first.get(("a",), lambda: 1)
    later = {**first.provenance, "date": "2999-01-01", "commit": "0000000"}
    monkeypatch.setattr("damjoint_tools.bench_table.provenance", lambda: later)
    resumed = Measurements(path, False)
    assert ("a",) in resumed and resumed.provenance == first.provenance
