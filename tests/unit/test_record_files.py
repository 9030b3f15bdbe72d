"""Records in the formats of PEER and COSMOS, of two components, and what is wrong with a file."""

import numpy as np
import pytest
from damjoint import InputError
from damjoint.dynamics.record import Record
from damjoint.dynamics.record_files import read
from damjoint.input.casefile import record_files
from damjoint.input.resolve import load, varied

VALUES = np.array([0.0, 0.012, -0.3456, 0.21, 1e-5, -0.07, 0.003])


def peer(path, values=VALUES, dt=0.005, head="NPTS={n:>7}, DT= {dt:.5f} SEC"):
    """A file of PEER, five values in a line."""
    lines = ["PEER NGA STRONG MOTION DATABASE RECORD", "Somewhere, 1/1/1999, Station, 90"]
    lines += ["ACCELERATION TIME SERIES IN UNITS OF G", head.format(n=len(values), dt=dt)]
    words = [f"{v:15.7E}" for v in values]
    lines += ["".join(words[i : i + 5]) for i in range(0, len(words), 5)]
    path.write_text("\n".join([*lines, ""]))
    return path


def cosmos(path, values=VALUES, unit="cm/sec2(04)", interval=5.0, seconds=0, columns="5F12.4"):
    """A COSMOS file: text, integers, numbers with the interval [ms] as number 62, comments."""
    reals = [-999.0] * 100
    reals[61] = interval
    lines = ["Corrected acceleration   (Format v01.20 with 3 text lines)", "Somewhere", "Station"]
    lines += [" 100 Integer-header values follow on  10 lines, Format= (10I8)"]
    lines += ["".join(f"{-999:8d}" for _ in range(10))] * 10
    lines += [" 100 Real-header values follow on  20 lines, Format= (5F15.6)"]
    lines += ["".join(f"{v:15.6f}" for v in reals[i : i + 5]) for i in range(0, 100, 5)]
    lines += ["   1 Comment line(s) follow, each starting with a |:", "| x"]
    lines += [f"{len(values):8d} acceleration pts, approx {seconds:4d} secs, units={unit},"]
    lines[-1] += f"Format=({columns})"
    words = [f"{v:12.4f}" for v in values]
    lines += ["".join(words[i : i + 5]) for i in range(0, len(words), 5)]
    path.write_text("\n".join([*lines, "End-of-data for chan  1 acceleration", ""]))
    return path


@pytest.mark.parametrize("head", ["NPTS={n:>7}, DT= {dt:.5f} SEC", "{n}   {dt:.4f}   NPTS, DT"])
def test_peer(tmp_path, head):
    file = read(peer(tmp_path / "a.AT2", head=head))
    assert file.in_si and file.lines.tolist() == [5] * 5 + [6] * 2
    assert file.rows[:, 0] == pytest.approx(0.005 * np.arange(7))
    assert file.rows[:, 1] == pytest.approx(9.80665 * VALUES) and not file.rows[:, 2].any()


def test_cosmos(tmp_path):
    """Columns that touch; the interval of a file of raw values stands elsewhere, in seconds."""
    values = np.round(-1234.5678 * VALUES / 0.3456 * 7, 4)
    file = read(cosmos(tmp_path / "a.v2", values))
    assert file.in_si and file.rows[:, 1] == pytest.approx(0.01 * values)
    assert file.rows[:, 0] == pytest.approx(0.005 * np.arange(7))
    text = cosmos(
        tmp_path / "b.v1", np.round(VALUES, 4), unit="g (02)", interval=-999.0
    ).read_text()
    lines = text.splitlines()
    first = lines.index(" 100 Real-header values follow on  20 lines, Format= (5F15.6)")
    row = lines[first + 7]
    lines[first + 7] = row[:45] + f"{0.01:15.6f}" + row[60:]  # number 34
    (tmp_path / "b.v1").write_text("\n".join(lines))
    file = read(tmp_path / "b.v1")
    assert file.rows[1, 0] == pytest.approx(0.01)
    assert file.rows[:, 1] == pytest.approx(9.80665 * np.round(VALUES, 4))


def test_the_unit_of_a_file_need_not_be_said(tmp_path):
    settings = {"record_rest": 0.0, "record_scale": 2.0}
    of = Record.of(load("dam", settings, record=peer(tmp_path / "a.AT2")))
    assert of.acceleration[:, 0] == pytest.approx(2 * 9.80665 * VALUES)
    other = Record.of(load("dam", settings | {"record_unit": "g"}, record=tmp_path / "a.AT2"))
    assert other.acceleration == pytest.approx(of.acceleration)


def test_two_components(tmp_path):
    """The shorter one ends with zeros; a case file has both, beside it."""
    peer(tmp_path / "h.AT2")
    peer(tmp_path / "v.AT2", [0.1, 0.2])
    (tmp_path / "my.case").write_text('record = "h.AT2+v.AT2";\n')
    case = varied(load(str(tmp_path / "my.case")), {"mu": 0.7})
    assert (case.record.name, case.record_vertical.name) == ("h.AT2", "v.AT2")
    rows = read(case.record, case.record_vertical).rows
    assert rows[:, 1] == pytest.approx(9.80665 * VALUES)
    assert rows[:, 2] == pytest.approx(9.80665 * np.array([0.1, 0.2, 0, 0, 0, 0, 0]))
    (tmp_path / "a+b.csv").write_text("0,0\n1,1\n")
    assert record_files("a+b.csv", tmp_path) == (tmp_path / "a+b.csv",)


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda p: peer(p, head="nothing"), "must have NPTS and DT in its fourth line"),
        (lambda p: peer(p, head="NPTS= 9, DT= .005 SEC"), "must have 9 values, and has 7"),
        (lambda p: peer(p, head="NPTS= 7, DT= 0 SEC"), "interval of 0 s: must be > 0"),
        (lambda p: cosmos(p, unit="counts (50)"), "units = counts: must be accelerations in"),
        (lambda p: cosmos(p, seconds=90), "as number 62 or 34 of its real header"),
        (lambda p: peer(p, [0.0, np.nan]), "row 5: NAN: must be a finite number"),
    ],
)
def test_bad_files(tmp_path, make, message):
    with pytest.raises(InputError, match=message):
        read(make(tmp_path / "r.txt"))


def test_two_components_must_fit(tmp_path):
    one = peer(tmp_path / "a.AT2")
    slow = peer(tmp_path / "b.AT2", dt=0.01)
    (tmp_path / "c.csv").write_text("0,0\n0.005,1\n")
    with pytest.raises(InputError, match="accelerations at the same times"):
        read(one, slow)
    with pytest.raises(InputError, match="both state their unit, or none"):
        read(one, tmp_path / "c.csv")
