"""The eleven modelings of SSNP142 against the published numbers; numbers of iterations."""

import pytest
from damjoint.post import validation

#: at most so many Newton iterations: in one step, in all of them (both uplifts of a, b, i counted
#: apart)
ITERATIONS = {
    "a": (6, None),
    "b": (6, None),
    "c": (5, None),
    "d": (5, None),
    "e": (None, 45),
    "f": (None, 50),
    "g": (None, 32),
    "h": (None, 14),
    "i": (6, None),
    "j": (5, None),
    "k": (None, 120),
}
MODELINGS = [
    pytest.param(name, marks=pytest.mark.heavy) if name in "bdfh" else name for name in ITERATIONS
]


@pytest.mark.parametrize("name", MODELINGS)
def test_published_values(solve, name):
    comparisons = [c for result in solve(name) for c in validation.compare(result)]
    missed = [c for c in comparisons if c.verdict == "fail"]
    assert not missed, "\n" + validation.report(missed)
    assert sum(c.verdict == "pass" for c in comparisons) >= 5


@pytest.mark.parametrize("name", MODELINGS)
def test_iterations_at_the_published_steps(solve, name):
    in_a_step, in_all = ITERATIONS[name]
    for result in solve(name):
        history = result.history
        assert not result.stopped
        assert len(history["time"]) == len(result.case.times)  # no step was cut
        assert history["cuts"].sum() == 0
        assert in_a_step is None or history["iterations"].max() <= in_a_step
        assert in_all is None or history["iterations"].sum() <= in_all


def test_validate_prints_the_table(command, tmp_path):
    code, out, _ = command("validate", "c", "j")
    assert code == 0
    assert ", 0 failed, " in out.splitlines()[-1]
    assert (tmp_path / "out" / "c" / "joint.csv").exists()


def test_validate_exits_with_1_if_a_row_fails(command, monkeypatch):
    """With the references of the first case changed by 10 %."""
    from dataclasses import replace

    rows = [replace(r, value=1.1 * r.value) for r in validation.table() if r.tolerance]
    monkeypatch.setattr(validation, "table", lambda: rows)
    code, out, _ = command("validate", "c")
    assert code == 1
    assert " 0 failed" not in out.splitlines()[-1]
