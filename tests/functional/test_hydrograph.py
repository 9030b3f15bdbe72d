"""Water levels against time from a file."""

import numpy as np
import pytest
from damjoint import InputError, cli
from damjoint.input import hydrograph
from damjoint.input.resolve import load
from damjoint.post import stored
from damjoint.studies import report_input

SMALL = "--set", "n_joint=10", "--set", "h_dam=4", "--set", "h_found=8"
CASE = 'default_uplift = "flow"; default_dam_base = 28; hydrograph = "flood.csv";'


def flood(folder, text, case=CASE):
    """A case with a hydrograph beside it."""
    (folder / "flood.csv").write_text(text)
    (folder / "my.case").write_text(case)
    return str(folder / "my.case")


def test_levels_and_times_follow_the_file(tmp_path):
    """In units of the shortest interval, linear between rows; from a level that has stood."""
    text = "hours,level,tail_level\n5,30,0\n6.5,36,3\n7,38,2\n"
    case = load(flood(tmp_path, text))
    assert case.levels == pytest.approx((30, 32, 34, 36, 38))
    assert case.tail_levels == pytest.approx((0, 1, 2, 3, 2))
    assert (case["time_unit"], case["time_start"], case.times) == (1800.0, 1.0, (1, 2, 3, 4, 5))
    faster = load(flood(tmp_path, text), {"time_unit": 60.0})
    assert faster["time_unit"] == 60 and faster.levels == case.levels


@pytest.mark.parametrize(
    "text, words",
    [
        ("hours,level\n0,30\n2,31\n1,32\n", "row 4: hours = 1: must be later"),
        ("hours,level\n0,30\n0,31\n", "row 3: hours = 0: must be later"),
        ("weeks,level\n0,30\n1,31\n", "first row must be hours,level"),
        ("", "first row must be hours,level"),
        ("hours,level\n0,30\n\n0,31\n", "row 4: hours = 0: must be later"),
        ("hours,level\n\n0,30\n1,high\n", "row 4: 1,high: must be 2 finite numbers"),
        ("hours,level\n0,30\n1,31,2\n", "row 3: 1,31,2: must be 2 finite numbers"),
        ("hours,level\n0,30\n", "two rows of numbers or more"),
        ("hours,level\n0,30\n1,nan\n", "row 3: 1,nan: must be 2 finite numbers"),
        ("seconds,level\n0,30\n1,31\n1e6,32\n", "at most 2000 times"),
        ("hours,level\n0,30\n1,99\n", "levels = 99: must be between"),
    ],
)
def test_bad_files_are_refused(refused, tmp_path, text, words):
    case = flood(tmp_path, text)
    assert words in refused("run", case, "--out", str(tmp_path / "out"))


def test_levels_beside_a_hydrograph_are_refused(tmp_path):
    text = "hours,level\n0,30\n1,36\n"
    with pytest.raises(InputError, match="levels: must not be set with a hydrograph"):
        load(flood(tmp_path, text), levels="30,40")
    with pytest.raises(InputError, match="No such file"):
        hydrograph.read(tmp_path / "none.csv")


@pytest.mark.heavy
def test_a_flood_with_picture_and_report(command, tmp_path, monkeypatch, texts_drawn):
    """The example with few elements: water stays behind in the crack that closes."""
    monkeypatch.chdir(tmp_path)
    assert cli.main(["run", "flood", *SMALL, "--out", "flood"]) == 0
    rows = stored.read(tmp_path / "flood").result.history
    assert rows["water"] - rows["water_in"] == pytest.approx(2.8e-4, rel=1e-6)
    assert (tmp_path / "flood" / "flood_water.png").exists()
    texts = next(t for t in texts_drawn if any("water in the joint in time" in s for s in t))
    assert {"reservoir [m]", "open length [m]", "stored [l/m]", "p [kPa]"} <= set(texts)
    reservoir = 9810 * rows["level"]
    assert np.all(rows["p_max"] >= reservoir * (1 - 1e-9))
    assert rows["p_max"][-1] > 1.1 * reservoir[-1]
    (tmp_path / "flood" / "flood_water.png").unlink()
    assert cli.main(["plot", "flood"]) == 0
    assert (tmp_path / "flood" / "flood_water.png").exists()
    assert cli.main(["report", "flood", "--to", "page.html"]) == 0
    page = (tmp_path / "page.html").read_text()
    assert "Flow in time" in page and "Water in the joint at the end" in page
    hours = rows["time"] - 1
    for name, text, factor, unit in (
        ("water", "Most water", 1e3, "l/m"),
        ("p_max", "highest pressure", 1e-3, "kPa"),
    ):
        most, at = factor * rows[name].max(), hours[rows[name].argmax()]
        assert f"{text}: {most:.4g} {unit} at {at:.4g} h" in page
    end = f"{rows['p_max'][-1] / 1e3:.4g} kPa, more than the {reservoir[-1] / 1e3:.4g} kPa outside"
    assert f"At the end it is up to {end}: water that has not yet left" in page
    assert "none flows into rock or concrete" in page and "smooth faces" not in page
    limits = list(report_input.limits(load("flood", {"turbulent": 1.0})))
    assert sum("beyond a Reynolds number of 2041 turbulent" in line for line in limits) == 1
