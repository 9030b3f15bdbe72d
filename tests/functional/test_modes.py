"""`damjoint modes` against closed forms, dense eigenvalues and the modes of an earthquake."""

import json

import damjoint as dj
import numpy as np
import pytest
from damjoint.dynamics import modes
from damjoint.input.resolve import load
from damjoint.pictures import modes_picture
from damjoint.pictures.drawing import CONCRETE, ROCK
from damjoint.post import stored
from damjoint.studies import modes_study
from matplotlib.colors import to_hex
from numpy.testing import assert_allclose
from PIL import Image
from quakes import BLOCK, DAM, earthquake, smooth_record

#: Frequency of a beam fixed at one end: this, squared, over 2 pi and its length squared, times the
#: root of its bending stiffness over its mass per length.
FIXED_END = 1.875104, 4.694091


def variant(found, water, rock):
    """The modes of a water on a rock."""
    (chosen,) = (v for v in found.variants if (v.water, v.rock) == (water, rock))
    return chosen


def test_a_wall_on_rigid_rock_is_a_beam():
    """Bending of a slender wall in plane strain; shear lowers the second frequency more."""
    wall = {"dam_height": 40, "dam_base": 1.5, "dam_crest": 1.5, "h_dam": 0.75, "n_joint": 4}
    stiff = {"K_N": 1e13, "K_T": 1e13, "E": 2e10, "nu": 0.2, "found_side": 5, "found_depth": 5}
    found = modes.natural_modes(load("dam", wall | stiff, "1"), 2)
    bending = 2e10 / (1 - 0.2**2) * 1.5**3 / 12
    expected = [k**2 / (2 * np.pi * 40**2) * np.sqrt(bending / (2400 * 1.5)) for k in FIXED_END]
    dry = variant(found, "none", "rigid")
    assert_allclose([mode.frequency for mode in dry.modes], expected, rtol=1e-2)
    rock = dry.shapes[0]["foundation"]
    assert not rock.any() and variant(found, "none", "massless").shapes[0]["foundation"].any()
    # the crest moves most, by 1
    crest = dry.shapes[0]["dam"][np.argmax(found.mesh.bodies["dam"].points[:, 1])]
    assert np.abs(crest[0]) == pytest.approx(1, rel=1e-3)


def test_a_block_on_a_soft_joint_is_a_spring_with_the_mass_of_the_water():
    """It slides on K_T L with its mass and that of the water, 7/12 rho H^2 on a vertical face."""
    soft = {"dam_height": 8.0, "K_N": 1e11, "K_T": 1e6, "law": "bond"}
    found = modes.natural_modes(load("dam", BLOCK | soft, "8"), 1)
    solid, water = 2400 * 64, 7 / 12 * 1000 * 64
    for name, mass in (("none", solid), ("reservoir", solid + water)):
        (mode,) = variant(found, name, "rigid").modes
        assert mode.frequency == pytest.approx(np.sqrt(1e6 * 8 / mass) / (2 * np.pi), rel=2e-3)
        assert mode.along_x == pytest.approx(1, rel=1e-3)


def test_modes_are_those_of_an_earthquake(tmp_path):
    """With the reservoir on massless rock, also in damping and share of the mass."""
    quake = earthquake(smooth_record(tmp_path / "r.csv", 1.0), DAM, "40")
    first = modes.natural_modes(load("dam", DAM, "40"), 3).variants[0]
    assert (first.water, first.rock) == ("reservoir", "massless")
    for mode, expected in zip(first.modes, quake.modes, strict=True):
        for name in ("frequency", "damping", "along_x", "along_y"):
            assert getattr(mode, name) == pytest.approx(getattr(expected, name), rel=1e-6)


def test_water_and_elastic_rock_lower_the_frequencies():
    found = modes.natural_modes(load("dam", DAM, "40"), 1)
    wet, wet_rigid, dry, dry_rigid = (v.modes[0].frequency for v in found.variants)
    assert wet < min(wet_rigid, dry) and max(wet_rigid, dry) < dry_rigid
    assert found.table["frequency"].tolist() == [wet, wet_rigid, dry, dry_rigid]


@pytest.mark.heavy
def test_the_command_writes_rows_picture_and_run_json(painted, command, tmp_path):
    few = "--set", "n_joint=10", "--set", "order=1", "--levels", "30,40", "--number", "2"
    code, out, err = command("modes", "dam", *few)
    assert (code, err) == (0, "")
    folder = tmp_path / "out" / "dam_modes"
    info = json.loads((folder / "run.json").read_text())
    assert info["state"] == "complete" and info["modes"]["level"] == 40
    assert info["modes"]["parameters"]["n_joint"] == 10 and "numpy" in info["versions"]
    rows = np.genfromtxt(folder / "modes.csv", delimiter=",", names=True, dtype=None, encoding=None)
    assert rows["frequency"].tolist() == pytest.approx(info["modes"]["frequency"], rel=1e-9)
    found = dj.modes(dj.case("dam", levels=[30, 40], n_joint=10, order=1), number=2)
    assert_allclose(found.rows.frequency, rows["frequency"], rtol=1e-6)
    assert_allclose(found.frequencies, rows["frequency"][:2], rtol=1e-6)
    assert found.units["period"] == "s" and "Hz" in repr(found)
    lines = out.splitlines()
    assert "joints closed and undamaged; reservoir 40 m" in lines[0]
    assert "with reservoir and massless rock Rayleigh damping set to 5 % at " in lines[0]
    assert f"{rows['frequency'][0]:.4g}" in out and max(map(len, lines[1:])) <= 80
    drawn = np.asarray(Image.open(folder / "dam_modes.png").convert("L"))
    assert (drawn < 200).mean() > 0.05
    # another command in the folder removes them
    assert command("run", "dam", *few[:-2], "--no-picture", "--no-fields", "--out", folder)[0] == 0
    assert not {"modes.csv", "dam_modes.png"} & {path.name for path in folder.iterdir()}


def test_the_picture_shows_the_whole_dam_and_the_rock_around_it_in_their_colors():
    case = load("dam", {"n_joint": 4, "order": 1, "h_found": 40}, "40")
    axes = modes_picture.figure(modes_study.compute(case, 1), "modes").axes[0]
    (cells,) = axes.collections
    colors = {to_hex(color) for color in cells.get_facecolor()}
    assert colors == {ROCK, CONCRETE}
    # of the rock, which is wider than shown, only what lies around the dam
    width = case["found_side"] * 2 + case["dam_base"]
    assert np.ptp(axes.get_xlim()) < 0.5 * width and np.ptp(axes.get_ylim()) > case["dam_height"]


@pytest.mark.parametrize("number, message", [("0", "must be an integer >= 1"), ("500000", "< ")])
def test_a_bad_number_is_refused(command, tmp_path, number, message):
    small = "--set", "n_joint=4", "--set", "order=1", "--set", "h_found=40"
    code, out, err = command("modes", "dam", *small, "--number", number, "--out", "out")
    assert (code, out) == (2, "") and f"number = {number}: must be" in err and message in err


def test_a_report_on_modes_is_refused(command, tmp_path):
    """They are no run."""
    few = "--set", "n_joint=4", "--set", "order=1", "--no-picture", "--out", "found"
    assert command("modes", "dam", *few)[0] == 0
    code, _, err = command("report", "found")
    assert code == 2 and "must be of run, check, critical or quake" in err
    with pytest.raises(dj.InputError):
        stored.read(tmp_path / "found")


@pytest.mark.heavy
def test_modes_in_3d_and_of_several_joints(command, tmp_path, texts_drawn):
    """Held along z, an extruded section has those of the plane; free, a first one along z, of which
    no mass moves along x and y. A picture is drawn of lift joints and in 3D.
    """
    coarse = {"n_joint": 8, "order": 1, "h_dam": 8, "h_found": 30}
    plane = dj.modes(dj.case("dam", levels=40, **coarse), number=1)
    solid = dj.case("dam", levels=40, dim=3, thickness=5, **coarse)
    held = dj.modes(dj.case(solid, hold_z=1), number=1)
    assert held.frequencies == pytest.approx(plane.frequencies, rel=0.05)
    free = dj.modes(solid, number=1).rows[0]
    assert free.frequency < 0.5 * held.frequencies[0] and free.mass_x + free.mass_y < 1e-3
    settings = [word for name, v in coarse.items() for word in ("--set", f"{name}={v}")]
    for words in (("lifts",), ("dam", "--set", "dim=3", "--set", "thickness=5")):
        assert command("modes", *words, *settings, "--out", words[0])[0] == 0
        rows = json.loads((tmp_path / words[0] / "run.json").read_text())["modes"]
        first = f"mode 1: {rows['frequency'][0]:.3g} Hz"
        assert any(text.startswith(first) for text in texts_drawn.pop())


def test_a_wrong_number_leaves_the_modes_of_before(command, tmp_path):
    """Also one that only the number of unknowns refuses."""
    words = "modes", "dam", "--set", "n_joint=4", "--set", "order=1", "--no-picture", "--out", "m"
    assert command(*words)[0] == 0
    before = (tmp_path / "m" / "modes.csv").read_text()
    code, _, err = command(*words, "--number", "100000")
    assert code == 2 and "number = 100000" in err
    assert (tmp_path / "m" / "modes.csv").read_text() == before
