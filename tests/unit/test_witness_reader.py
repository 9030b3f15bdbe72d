"""The reader of the independent verification: a command's words, declarations and section."""

import re
from dataclasses import replace
from pathlib import Path

import pytest
from damjoint_tools.random_scenes import random_scene
from damjoint_witness.reader import defaults, differences, read, value_of

PAGE = Path(__file__).parents[2] / "reference" / "parameters.md"


def test_defaults_are_those_of_the_page():
    """Which is made from the same declarations by another reader."""
    rows = [line.split("|") for line in PAGE.read_text().splitlines() if line.startswith("| `")]
    page = {row[1].strip(" `"): value_of(row[4]) for row in rows}
    assert len(page) > 100 and page == defaults()


def record_of(case):
    return {
        "levels": case.levels,
        "tail_levels": case.tail_levels,
        "times": case.times,
        "parameters": dict(case.values),
        "joints": [{"values": dict(joint.values)} for joint in case.of_joints],
    }


@pytest.mark.parametrize("number", [2, 5, 8, 13])
def test_values_of_each_joint_are_those_of_the_run(number):
    scene = random_scene(5, number)
    request, record = read(scene.words), record_of(scene.case)
    assert not list(differences(request, record))
    own = record["joints"][-1]["values"] if record["joints"] else record["parameters"]
    own["mu"] = 1.01 * request.joints[-1]["mu"]
    joint = max(1, len(record["joints"]))
    (found,) = differences(request, record)
    assert re.match(f"run.json: mu = .* at joint {joint}, by the command", found)


def test_differences_of_the_loading_are_noticed():
    scene = random_scene(5, 2)
    request, record = read(scene.words), record_of(scene.case)
    for name in ("levels", "tail_levels", "times"):
        changed = record | {name: tuple(1.01 * value for value in record[name])}
        assert [f.split()[1] for f in differences(request, changed)] == [name] * any(record[name])


def test_automatic_values_and_lists():
    words = "run dam --set lift_heights=20,30 --set mu=0.5,0.6,0.7 --set G_f=-1 --set law=rupture"
    request = read(f"{words} --set pena_rupture=3 --levels 30,40 --steps 2".split())
    assert [joint["mu"] for joint in request.joints] == [0.5, 0.6, 0.7]
    first, second = request.joints[:2]
    assert first["G_f"] == pytest.approx(2e5**2 * 4 / 2e11)
    assert first["found_side"] == 90 and first["ice_level"] == 40 and first["force_t"] == 2
    assert second["joint_height"] == 20 and second["n_joint"] == 63  # 100 x 21.1 / 34
    assert request.times == (0.5, 1, 1.5, 2) and request.requested == (1, 2)
    assert request.level_at(1.5) == 35
    assert [s.toe for s in request.sections[1:]] == [
        pytest.approx((34 - 29 * y / 45, y)) for y in (20, 30)
    ]


def test_case_file_with_joints_that_meet():
    request = read(["run", "monoliths", "--run-geo", "--set", "adhesion=1,2,3", "--levels", "30"])
    assert [joint["uplift"] for joint in request.joints] == ["imposed", "imposed", "none"]
    assert [joint["adhesion"] for joint in request.joints] == [1, 2, 3]
    assert request.geometry and not request.sections


def test_blocks_of_single_joints(tmp_path):
    path = tmp_path / "own.case"
    path.write_text(
        'default_law = "friction";  // of all\nlift_heights() = {12.5};\n'
        "Struct Joint::base [ mu 0.7 ];\n"
        'Struct Joint::lift_12_5_m [ mu 0.9, law "bond" ];\nlevels() = {30};\n'
    )
    request = read(["run", str(path)])
    assert [(v["mu"], v["law"]) for v in request.joints] == [(0.7, "friction"), (0.9, "bond")]
    assert [v["mu"] for v in read(["run", str(path), "--set", "mu=0.5"]).joints] == [0.5, 0.5]
    contraction = read(["run", "monoliths"]).joints[2]
    assert (contraction["mu"], contraction["uplift"]) == (0.6, "none")


def test_sections_have_batter_neck_and_slopes():
    words = "run dam --set batter=4 --set batter_height=20 --set neck_height=5"
    request = read(f"{words} --set lift_heights=10,42 --set joint_slope=5,-3,0".split())
    base, low, high = request.sections
    assert base.upstream == ((0, 0), (4, 20), (4, 45)) and base.crest == ((9, 45), (4, 45))
    assert low.heel == pytest.approx((2, 10)) and low.upstream[1:] == ((4, 20), (4, 45))
    assert high.downstream == (pytest.approx((9, 42)), (9, 45)) and high.length == pytest.approx(5)
    assert low.slope == pytest.approx(-0.0523598775598)
    sloping = read([*words.split(), "--set", "neck_batter=3"]).sections[0]
    assert sloping.downstream == ((34, 0), (12, 40), (9, 45))
    words = "run dam --set downstream_face=30,12,8,40 --set joint_height=20"
    polygon = read(words.split()).sections[0]
    assert polygon.downstream == (pytest.approx((30 - 22 * 8 / 28, 20)), (8, 40), (5, 45))
    assert replace(low, heel=base.heel).heel == (0, 0) and len(base.outline) == 6


def test_words_that_are_not_understood():
    with pytest.raises(ValueError, match="unknown"):
        read(["run", "dam", "--set", "mue=1"])
    with pytest.raises(ValueError, match="neither"):
        read(["run", "dam", "30"])
