"""Load steps and critical levels of the independent verification."""

from dataclasses import replace

import numpy as np
import pytest
from damjoint import cli
from damjoint_tools.random_scenes import LOAD_TIMES, random_scene
from damjoint_witness import again
from damjoint_witness.files import Files, read_table
from damjoint_witness.reader import read

#: A dam that slides at 46.104 m (T = mu N).
DAM = "run dam --set n_joint=10 --set order=1 --set law=friction --set adhesion=0 --set pena_tang=0"
SLIDES = 46.1044


def written(folder, level, steps):
    words = tuple(f"{DAM} --levels {level} --steps {steps}".split())
    cli.main([*words, "--no-picture", "--no-fields", "--all-steps", "--out", str(folder)])
    return Files(folder, words)


def test_state_after_twice_the_steps_is_compared(tmp_path):
    one, other = (written(tmp_path / str(steps), 40, steps) for steps in (2, 4))
    request = read(one.words)
    assert list(again.other_steps(request, one, other)) == []
    assert again.difference(one, other) < again.SAME_STATE
    elsewhere = written(tmp_path / "elsewhere", 40.001, 4)
    (found,) = again.other_steps(request, one, elsewhere)
    assert "with twice the steps the jumps differ by" in found


@pytest.mark.parametrize(
    "words, history, steps",
    [
        ("--levels 20,30", False, False),
        ("--levels 30,20", False, True),
        ("--set uplift=cracked", False, True),
        ("--set temperature_dam=3", True, True),
        ("--set weight_first=0", True, True),
        ("--set k_h=-0.1", True, True),
        ("--set anchor_force=1e5 --set anchor_angle=5", True, True),
        ("--set drive=crest", True, True),
        ("--set law=friction --set saw_thickness=1e-5", True, True),
    ],
)
def test_states_that_follow_history_or_steps_are_not_compared(words, history, steps):
    request = read([*DAM.split(), *words.split()])
    assert (again.follows_history(request), again.follows_steps(request)) == (history, steps)
    assert again.follows_steps(request, {"unstable_growth": [20.0]})


@pytest.mark.parametrize(
    "damage, slip, shear, back",
    [
        ((0, 0.1, 0.2), (0, 1, 2), (0, 1, 2), False),
        ((0, 0, 0.2), (0, 0, 1), (0, 1, 2), False),
        ((0, 0.1, 0.1), (0, 1, 2), (0, 1, 2), True),
        ((0, 0, 0), (0, 1, 1), (0, 1, 1.5), True),
        ((0, 0, 0), (0, 1, 2), (0, 1, 0.5), True),
    ],
)
def test_slip_and_damage_that_end_under_rising_water_are_seen(damage, slip, shear, back):
    """Rows of a single point after the weight and two steps of the water."""
    columns = {"damage": damage, "slip": slip, "delta_t1": shear, "delta_t2": (0, 0, 0)}
    steps = {name: np.array(values, float) for name, values in columns.items()}
    assert again.goes_back({"update": np.array([1.0, 2.0, 3.0])} | steps) == back


def critical(value, confirmed="a reason", doubt="", joint="", mode="sliding"):
    found = {"value": value, "mode": mode, "joint": joint}
    return again.Critical.of({"critical": found | {"confirmed": confirmed, "doubt": doubt}})


def test_confirmed_levels_of_several_starts_agree():
    assert again.Critical.of({}) is None and critical(None) is None
    assert list(again.starts([critical(40.0), critical(40.003)])) == []
    assert list(again.starts([critical(40.0), critical(41.0, doubt="another one")])) == []
    (found,) = again.starts([critical(40.0), critical(40.005)])
    assert found == "critical levels from several starts: 40, 40.005 m"


def test_statics_confirms_a_critical_level_or_not(tmp_path):
    below = written(tmp_path / "below", again.BELOW * SLIDES, 2)
    steps = read_table(below.folder / "steps.csv")
    request = read(below.words)
    assert list(again.above(critical(SLIDES), below, request, steps)) == []
    # without the hardening that slip has added, which the search omits as well
    soft = tuple(word.replace("pena_tang=0", "pena_tang=-1") for word in below.words)
    slipped = steps | {"lambda": steps["lambda"] + 1.0}
    assert list(again.above(critical(SLIDES), below, read(soft), slipped)) == []
    low = written(tmp_path / "low", again.BELOW * 35, 2)
    steps, request = read_table(low.folder / "steps.csv"), read(low.words)
    certain, allowed = again.above(critical(35.0), low, request, steps)
    assert "above the critical level 35 m there certainly is an equilibrium" == certain
    assert "sliding at the critical level 35 m, but statics allows" in allowed
    assert not list(again.above(critical(35.0, doubt="not sure"), low, request, steps))
    assert not list(again.above(critical(35.0, mode=again.UNSTABLE), low, request, steps))


def test_no_run_stands_above_a_critical_level(tmp_path):
    """Only one that has jumped to another branch near it, or beyond unstable growth."""
    runs = [written(tmp_path / str(n), again.RUNS_TO * 0.99 * SLIDES, n) for n in (1, 4)]
    one, four = again.stands_above(critical(0.99 * SLIDES), runs)
    assert one == "a run of 1 steps stands at 45.7346 m, above the critical level 45.6434 m"
    assert four.startswith("a run of 4 steps")
    assert not list(again.stands_above(critical(0.99 * SLIDES, doubt="not sure"), runs))
    assert not list(again.stands_above(critical(0.99 * SLIDES, mode=again.UNSTABLE), runs))
    runs[0].record["passed_over"] = [[0.0, 45.7]]
    runs[1].record["unstable_growth"] = [20.0]
    assert list(again.stands_above(critical(0.99 * SLIDES), runs)) == [four]
    beyond = written(tmp_path / "beyond", again.RUNS_TO * SLIDES, 4)
    assert list(again.stands_above(critical(SLIDES), [beyond])) == []


def test_hardening_that_is_not_asked_for_is_omitted():
    scene = replace(random_scene(5, 2), settings={"law": "friction"})
    assert scene.without_default_hardening.settings["pena_tang"] == 0
    several = replace(scene, settings={"pena_tang": ("-1", 4e9)})
    assert several.without_default_hardening.settings["pena_tang"] == (0, 4e9)


def test_commands_of_a_scene_for_its_critical_level():
    scene = replace(random_scene(5, 2), levels="4,7,9", tail_levels="1,2,2.5")
    rising = scene.rising_from(3.0, 6.0)
    assert rising.critical[:2] == ["critical", "dam"] and "--steps" not in rising.critical
    assert read(rising.critical).joints == read(rising.words).joints
    request = read(rising.words)
    assert (request.levels, request.tail_levels, rising.steps) == ((3.0, 6.0), (2.5, 2.5), 4)
    assert all(request.joints[0][time] == 1 for time in LOAD_TIMES)
    assert scene.rising_from(3.0, 2.0).levels == "3"
