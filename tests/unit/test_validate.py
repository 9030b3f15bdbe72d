"""The reference table and the verdicts of the comparison."""

from dataclasses import replace

import numpy as np
import pytest
from damjoint import parameters, validate
from damjoint.results import HISTORY, JOINT, Results, nodes_of, why_stopped

REFERENCE = validate.Reference("A", "imposed", "delta_n", 1.3, 2e-7, "m", 0.01, "test", "", "node")


def test_reference_table():
    rows = validate.table()
    assert {r.modeling for r in rows} == set("ABCDEFGHIJK")
    assert {r.quantity for r in rows} <= {*JOINT, "flux"}
    assert {r.unit for r in rows} <= {"m", "Pa", "kg/m/s"}
    assert all(0 <= r.x <= 5 and r.value != 0 and r.source for r in rows)
    assert all(0 < r.tolerance <= 0.15 for r in rows if r.tolerance is not None)
    assert validate.modelings() == list("abcdefghijk")


@pytest.mark.parametrize("name", "abcdefghijk")
def test_every_scene_of_every_modeling_has_references(name):
    assert all(validate.references(scene) for scene in parameters.load(name).scenes())


@pytest.mark.parametrize("computed, tolerance, verdict", [
    (2.0e-7, 0.01, "pass"), (2.019e-7, 0.01, "pass"), (2.021e-7, 0.01, "fail"), (1.979e-7, 0.01, "fail"), (-2e-7, 0.01, "fail"),
    (float("nan"), 0.01, "fail"), (3e-7, None, "info")])
def test_verdict(computed, tolerance, verdict):
    comparison = validate.Comparison(replace(REFERENCE, tolerance=tolerance), computed)
    assert comparison.verdict == verdict


def test_difference_is_relative_to_the_reference():
    negative = validate.Comparison(replace(REFERENCE, value=-4.0), -4.2)
    assert negative.difference == pytest.approx(0.05)


def test_report_counts():
    rows = [validate.Comparison(REFERENCE, 2e-7), validate.Comparison(REFERENCE, 3e-7),
            validate.Comparison(replace(REFERENCE, tolerance=None), 1.0)]
    text = validate.report(rows)
    assert text.endswith("1 passed, 1 failed, 1 for information only")
    assert "+50.00 %" in text


def joint_table(rows):
    """Joint rows from (time, x, z, delta_n)."""
    table = {name: np.zeros(len(rows)) for name in JOINT}
    table["time"], table["x"], table["z"], table["delta_n"] = np.array(rows, float).T
    return table


def test_compare_reads_the_nearest_nodes_at_the_last_level_and_averages_over_z():
    case = parameters.load("a")
    table = joint_table([(3, 1.3, 0, 9), (4, 1.2, 0, 9), (4, 1.3, 0, 1e-7), (4, 1.3, 1, 3e-7), (4, 1.4, 0, 9)])
    found = validate.compare(Results(case, {}, table, table))
    at = [c.computed for c in found if c.reference.x == 1.3 and c.reference.quantity == "delta_n"]
    assert at and at == pytest.approx([2e-7] * len(at))


def test_nodes_shared_by_elements_are_found_once():
    points = np.array([(0.1, 0, 0), (0.2, 0, 0), (0.2 + 1e-14, 0, 0), (0.3, 0, 0), (0.1, 0, 0.5)])
    nodes, rows = nodes_of(points)
    assert len(nodes) == 4
    np.testing.assert_allclose(nodes[rows], points, atol=1e-9)


@pytest.mark.parametrize("name, last, reason", [
    ("c", {"N": 1e5, "T": 39_900, "M": 2e5}, "sliding"),  # holds 0.35 * 1e5 + 1000 * 5 = 40000
    ("a", {"N": 1e5, "T": 39_900, "M": 2e5, "crack_length": 4.9}, "overturning"),
    ("a", {"N": 1e5, "T": 39_900, "M": 1e3}, "overturning"),
    ("c", {"N": 1e5, "T": 20_000, "M": 2e5}, "no convergence")])
def test_why_a_run_stopped(name, last, reason):
    row = {**dict.fromkeys(HISTORY, 0.0), "level": 7.5, **last}
    said = why_stopped(parameters.load(name), {name: np.array([value]) for name, value in row.items()})
    assert said.startswith(reason) and "7.5 m" in said
