"""Critical levels of random dams in several ways."""

import pytest
from damjoint_tools.limit_levels import WAYS, limit_levels, spread, summary


@pytest.mark.heavy
def test_all_ways_lead_to_the_same_level_and_a_file_is_continued(tmp_path):
    (row,) = limit_levels(1, 3, tmp_path / "limits.csv", jobs=1)
    assert row["law"] == "bond"
    assert all(row[f"confirmed_{way}"] == "1" for way in range(len(WAYS)))
    assert spread(row) < 1e-4 and float(row["level_3"]) > 8.95
    assert limit_levels(1, 3, tmp_path / "limits.csv", jobs=1) == [row]


def row_of(law, *levels):
    """A row; levels: of each way, negative if it is not confirmed, 0 if there is none."""
    row = {"dam": "1-0", "law": law, "uplift": "none"}
    for way, level in enumerate(levels):
        row |= {f"level_{way}": str(abs(level)) if level else ""}
        row |= {f"confirmed_{way}": str(int(level > 0)), f"cpu_{way}": "1.5"}
    return row


def test_levels_that_differ_or_are_not_confirmed_are_listed():
    rows = [
        row_of("bond", 30, 30, 30, 30.01, 30),
        row_of("endo", 20, 0, -20, 20, 20),
        row_of("endo", *5 * [0]),
    ]
    _, bond, endo, *dams = summary(rows)
    assert bond.split()[:6] == ["bond", "1", "0", "of", "5", "0.0%"] and "3.3e-04" in bond
    assert endo.split()[:6] == ["endo", "2", "2", "of", "10", "20.0%"] and "0.0e+00" in endo
    assert dams == [
        "1-0 bond none: 30, 30, 30, 30.01, 30",
        "1-0 endo none: 20, no limit not confirmed, 20 not confirmed, 20, 20",
    ]
