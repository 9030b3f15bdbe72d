"""Monotone filling in any number of steps, and the equilibrium path over unstable crack growth."""

import re
from dataclasses import replace

import numpy as np
import pytest
from damjoint.input.resolve import load
from damjoint.joint.interface import interface_of
from damjoint.solver.controls import LevelControl
from damjoint.solver.load_stepper import LoadStepper
from damjoint.solver.model import Model, StepResult
from damjoint.solver.path import STRENGTH_LOST, SURE, EquilibriumPath
from damjoint.solver.path_point import PRECISION, Point
from damjoint.statics.hints import hints, hints_on_path
from damjoint.statics.statement import level_of_growth, statement
from damjoint.statics.verdict import verdict
from damjoint.studies.critical import Search
from damjoint.studies.failure_path import FailurePath
from damjoint_tools.random_scenes import random_scene
from variants import further

#: 45 m dam with drains on a joint that cracks and slides slightly.
DAM = {"E_dam": 2e10, "E_found": 3e10, "sigma_max": 1e5, "G_f": 100, "n_joint": 40}
DAM |= {"uplift": "drained", "drain_x": 4, "drain_effectiveness": 0.5, "drain_level": 3}
#: Each law, with points that open, soften or slip at the last level.
LAWS = {
    "bond": {"law": "bond", "adhesion": 1e5, "mu": 1},
    "bond, exponential": {"law": "bond", "adhesion": 1e5, "mu": 1, "softening": "exponential"},
    "friction": {"law": "friction", "adhesion": 2e4, "mu": 0.9},
    "rupture": {"law": "rupture", "alpha": 1},
    "rupture, shear kept": {"law": "rupture", "alpha": 2},
    "mixed": {"law": "mixed", "sigma_max": 6e5, "G_f": 1000, "dam_base": 30},
}
LAWS["mixed, exponential"] = LAWS["mixed"] | {"sigma_max": 8e5, "softening": "exponential"}
#: A brittle bond that breaks over 20 of 30 m at constant level, and friction that holds the dam.
BRITTLE = {"law": "bond", "mu": 5, "dam_base": 30, "sigma_max": 2e6, "G_f": 100}
BRITTLE |= {"adhesion": 5e6, "G_t": 1e5, "n_joint": 60}
#: A bond without cohesion, close to overturning (gravity method: 46.201 m).
NEAR_LIMIT = {"law": "bond", "dam_height": 46.55, "dam_base": 25.078, "dam_crest": 3.0817}
NEAR_LIMIT |= {"E": 1.7599e10, "nu": 0.2, "K_N": 1.9375e12, "K_T": 1.3155e12, "n_joint": 56}
NEAR_LIMIT |= {"sigma_max": 393620, "adhesion": 0, "mu": 2.0653, "G_f": 183.29, "G_t": 23797}
NEAR_LIMIT |= {"h_dam": 8.8075, "h_found": 20.086, "found_side": 51.842, "found_depth": 39.497}
#: A stiff, brittle base below a soft lift that releases its shear (random dam 82-40, simplified).
STIFF_BASE = {"dam_height": 148, "n_joint": 10, "dam_base": 127, "dam_crest": 25.1, "E": 1.2e12}
STIFF_BASE |= {"law": ("bond", "rupture"), "K_N": (2.56e14, 1.66e8), "K_T": (4.3e14, 2.89e7)}
STIFF_BASE |= {"adhesion": (769e3, 0), "mu": (0.471, 0.714), "sigma_max": (19300, 0)}
STIFF_BASE |= {"G_f": (4.63, -1), "G_t": (153.8, 2000), "alpha": 1, "pena_rupture": (-1, 0.564)}
STIFF_BASE |= {"uplift": ("drained", "none"), "drain_x": (13, 10.1), "drain_effectiveness": 0.634}
STIFF_BASE |= {
    "drain_level": 41.9,
    "softening": "exponential",
    "lift_heights": (79.38,),
    "nu": 0.34,
}

#: Friction on a joint that is stiff for its mesh, with water that enters (random dam 74-85).
STIFF_FRICTION = {"dam_height": 99.7, "dam_base": 95.1, "dam_crest": 18.3, "nu": 0.138, "mu": 1.06}
STIFF_FRICTION |= {"E": 7.66e9, "E_found": 1.22e12, "K_N": 3.98e14, "K_T": 2.56e14, "sigma_max": 0}
STIFF_FRICTION |= {
    "law": "friction",
    "adhesion": 0,
    "uplift": "cracked",
    "drains": 1,
    "n_joint": 10,
}
STIFF_FRICTION |= {"drain_x": 11.8, "drain_effectiveness": 0.492, "drain_level": 17.3}
SLIDES = {"uplift": "cracked", "sigma_max": 0, "adhesion": 2e4, "mu": 0.6, "n_joint": 10}


@pytest.mark.parametrize("law", further(4, LAWS))
def test_monotone_filling_does_not_depend_on_the_steps(solve, law):
    """1, 4 and 16 steps per level: the same joint to 1e-6 of its largest value."""
    found = [solve("dam", "30,40,45", "0,0,3", steps, **DAM | LAWS[law])[0] for steps in (1, 4, 16)]
    rows = [result.at() for result in found]
    assert rows[0]["delta_n"].max() > 1e-6  # something has opened
    for name in ("delta_n", "delta_t1", "sigma_n", "tau_1", "damage", "slip"):
        size = max(np.abs(rows[0][name]).max(), 1e-12)
        for other in rows[1:]:
            np.testing.assert_allclose(other[name], rows[0][name], rtol=0, atol=1e-6 * size)


@pytest.mark.heavy
def test_a_dam_on_a_brittle_bond_is_followed_beyond_its_limit_point(solve):
    """The level falls by almost 2 m while the crack grows, and rises again, to an equilibrium."""
    (result,) = solve("dam", "40,48,51", **BRITTLE)
    assert verdict(result) == "stands" and result.last["level"] == 51
    ((limit, lowest),) = result.info["limit_points"]
    assert 48 < limit < 51 and limit - lowest > 1
    result.info["limit_points"] += ((limit + 1e-6, lowest),)  # as where it is passed once more
    said = f"unstable crack growth at level {limit:.4g} m"
    assert sum(said in hint for hint in hints(result)) == 1
    # where the bond is broken it has no influence: a dam without a bond has nearly the same state
    (unbonded,) = solve("dam", "51", **BRITTLE | {"sigma_max": 0, "adhesion": 0})
    for name in ("N", "T", "M"):
        assert result.last[name] == pytest.approx(unbonded.last[name], rel=1e-6)
    free = unbonded.last["crack_length"]
    assert 0.93 * free < result.last["crack_length"] < free
    assert result.last["crest_ux"] == pytest.approx(unbonded.last["crest_ux"], rel=0.05)


def test_a_long_step_of_the_level_does_not_lead_to_the_falling_part_of_a_branch():
    """That from 7.2 to 24.07 m and its halves led to it: no level above had an equilibrium, and
    24.07 m was said to be the level of unstable growth, which is 24.413 m.
    """
    section = {"dam_height": 24.07, "dam_base": 21.77, "dam_crest": 1.885, "n_joint": 20}
    joint = {"law": "rupture", "sigma_max": 432.8e3, "pena_rupture": 0.6371, "alpha": 0.5}
    joint |= {"K_N": 8.308e11, "K_T": 8.951e11, "uplift": "cracked"}
    concrete = {"E": 2.086e10, "E_found": 6.107e10, "nu": 0.1621}
    case = load("dam", section | joint | concrete, "7.221,24.07", "0")
    path = FailurePath(case, interface_of(case), to_growth=True)
    assert path.points[-1].level == 24.07 and path.points[-1].damage.max() < 1e-3
    path.advance()
    assert path.points[-1].level > 24.07 and not path.starts


def test_with_flow_an_increment_does_not_pass_to_an_opening_with_more_water():
    """From 69.92 m a single increment led to 78.168 m, where the whole joint slips under more
    uplift: that was confirmed, beside 78.806 m from other first levels.
    """
    section = {"dam_height": 69.92, "dam_base": 57.29, "dam_crest": 11.57, "n_joint": 20}
    joint = {"law": "friction", "sigma_max": 50060, "adhesion": 35900, "mu": 0.9038}
    joint |= {"K_N": 1.816e11, "K_T": 1.729e11, "uplift": "flow"}
    concrete = {"E": 2.994e10, "E_found": 4.427e9, "nu": 0.2053}
    case = load("dam", section | joint | concrete, "20.976,69.92", "0")
    answer = Search(case, "level").run()
    assert answer.confirmed and answer.value == pytest.approx(78.806, rel=1e-4)


def test_no_step_is_tried_above_the_level_at_which_a_joint_slides(monkeypatch):
    """A higher one has no equilibrium; the run ends at that level."""
    stepper = LoadStepper(load("dam", SLIDES, "20,45"))
    tried, advance = [], Model.advance

    def recorded(self, state, time, control, options=None):
        tried.extend([control.level] if isinstance(control, LevelControl) else [])
        return advance(self, state, time, control, options)

    monkeypatch.setattr(Model, "advance", recorded)
    result = stepper.run()
    assert verdict(result) == "sliding" and result.last["level"] < 44
    assert tried == [0, 20, 45]  # over the last one the path leads


@pytest.mark.heavy
def test_a_run_stops_at_the_critical_level(solve):
    """Over a limit point it overturns at the level of `critical` after unstable crack growth."""
    levels = "23.275,37.24,41.895,46.55"
    (result,) = solve("dam", levels, weight_first=0, **NEAR_LIMIT)
    answer = Search(load("dam", NEAR_LIMIT | {"weight_first": 0.0}, levels), "level").run()
    assert verdict(result) == "overturning" and answer.growth == answer.value
    assert result.last["level"] == pytest.approx(answer.after["by displacement"], rel=1e-3)
    assert result.last["level"] == pytest.approx(answer.gravity, rel=1e-3)
    (highest,) = re.findall(r"reaches (\S+) m at most \(followed to", statement(result))
    assert 0 <= float(highest) - result.last["level"] <= PRECISION * answer.value


@pytest.mark.heavy
@pytest.mark.parametrize("seed, softening", [*enumerate(2 * ["linear", "exponential"])])
def test_more_strength_never_fails_earlier(solve, seed, softening):
    """Random dams of 20 to 60 m on brittle bonds, with more tensile strength, fracture energy or
    cohesion. More cohesion causes less slip and so more opening: up to 0.3 % of the level. Linear
    softening of half the energies is nowhere above the exponential curve.
    """
    rng = np.random.default_rng(seed)
    height = rng.uniform(20, 60)
    dam = {"law": "bond", "dam_height": height, "dam_base": height * rng.uniform(0.55, 0.7)}
    dam |= {"n_joint": 20, "K_N": 10 ** rng.uniform(10.5, 12), "mu": rng.uniform(0.7, 2)}
    dam |= {"sigma_max": 10 ** rng.uniform(4.7, 6), "G_f": 10 ** rng.uniform(1.3, 2.3)}
    dam |= {"adhesion": 10 ** rng.uniform(4.7, 6), "G_t": 10 ** rng.uniform(2, 4)}
    dam["softening"] = softening
    levels = ",".join(f"{share * height:.4g}" for share in (0.6, 0.9, 1.3))
    reached = lambda **more: solve("dam", levels, **dam | more)[0].last["level"]
    least = (1 - 1e-3) * reached()
    assert reached(G_f=3 * dam["G_f"]) >= least
    assert reached(G_f=4 * dam["G_f"], sigma_max=2 * dam["sigma_max"]) >= least
    assert reached(G_t=4 * dam["G_t"]) >= least
    assert reached(G_t=4 * dam["G_t"], adhesion=2 * dam["adhesion"]) >= 0.997 * least
    half = {"softening": "linear", "G_f": dam["G_f"] / 2, "G_t": dam["G_t"] / 2}
    assert reached() >= (1 - 1e-3) * reached(**half)


@pytest.mark.heavy
@pytest.mark.parametrize("steps", [2, 3, 5])
def test_the_highest_level_of_a_run_does_not_depend_on_its_steps(solve, steps):
    """A crest that moves back has two equilibria at one level; a long step leads to the lower one,
    from which the level does not rise.
    """
    bond = {"law": "bond", "uplift": "flow", "sigma_max": 25e3, "adhesion": 188e3, "mu": 0.91}
    bond |= {"n_joint": 20, "G_f": 45.5, "G_t": 193.2}
    (one,), (several,) = (solve("dam", "30,40,45,50", None, n, **bond) for n in (1, steps))
    assert one.stopped and several.stopped
    highest = one.history["level"].max()
    assert several.history["level"].max() == pytest.approx(highest, rel=1e-4)


@pytest.mark.heavy
def test_a_path_whose_water_withdraws_again_at_the_same_place_ends():
    """Once continued at a level above the highest one, the same increments would follow again."""
    section = {"dam_height": 5.81, "dam_base": 4.40398, "dam_crest": 0.848, "n_joint": 40}
    rock = {"found_side": 5.81, "found_depth": 5.81, "K_N": 4.02e11, "K_T": 3.46e11, "E": 3.28e10}
    joint = {"law": "rupture", "sigma_max": 0, "alpha": 1, "uplift": "cracked", "weight_first": 1}
    case = Search(load("dam", section | rock | joint, "4.65,4.94", "0"), "level").base
    path = FailurePath(case, interface_of(case), case.highest_level)
    path.verified = False
    fill_on, times = path.fill_on, []

    def counted():
        times.append(path.top)
        assert len(times) < 10  # else without end
        fill_on()

    path.fill_on = counted
    path.follow(SURE)
    assert len(times) > 1
    assert path.leads_higher
    assert path.water_withdraws


@pytest.mark.heavy
def test_a_path_whose_level_falls_where_water_enters_goes_on_as_filling_does():
    """The crack grows through at 91.09 m, and the dam stands up to 101.26 m. From one first level
    the equilibria of falling level led nowhere, and 91.09 m was confirmed beside 101.26 m.
    """
    section = {"dam_height": 96.91, "dam_base": 61.42, "dam_crest": 7.75, "E_found": 7.261e9}
    joint = {"law": "endo", "uplift": "cracked", "sigma_max": 77210.0, "adhesion": 100200.0}
    joint |= {"K_N": 7.226e10, "K_T": 6.342e10, "mu": 1.03, "G_f": 44.64, "n_joint": 20}
    concrete = {"E": 1.935e10, "nu": 0.1313}
    case = Search(load("dam", section | joint | concrete, "29.073,64.9297"), "level").base
    path = FailurePath(case, interface_of(case), target=95.0)
    path.follow(SURE)
    assert path.passed_growth == pytest.approx(91.09, rel=1e-4)
    assert path.reached


@pytest.mark.heavy
def test_a_step_that_breaks_a_joint_at_once_is_tried_by_shorter_ones(solve):
    """One step leads to a base that has slipped whole at 154 m, with as much strength left as its
    shear; shorter ones lead to 190.5 m, and a path, without the lift, to 195.45 m.
    """
    found = [solve("dam", "44.4,190.5", "0", steps, **STIFF_BASE)[0] for steps in (1, 4)]
    for result in found:
        assert verdict(result) == "stands" and result.last["level"] == 190.5
        assert result.last["slip_length"] < 0.8 * result.case.joint_length
        assert not result.info.get("broken_at_once")
    one, four = (result.last for result in found)
    assert one["crest_ux"] == pytest.approx(four["crest_ux"], rel=1e-5)


@pytest.mark.heavy
def test_strength_that_a_step_has_destroyed_is_no_proof_of_sliding(solve):
    """Without shorter steps the base breaks at once, and holds no more than its shear."""
    (result,) = solve("dam", "44.4,190.5", "0", 4, **STIFF_BASE, smallest_step=1)
    ((begin, end),) = result.info["broken_at_once"]
    assert begin < result.last["level"] == end < 190.5
    assert verdict(result) == "not converged"
    assert "shear strength" not in statement(result)
    assert any("a joint breaks at once" in hint for hint in hints(result))


@pytest.mark.heavy
def test_a_stiff_joint_with_friction_stands_with_any_number_of_steps(solve):
    """With five steps it was "not converged" at 98.8 m: no strategy led from there to the last
    level, nor, from the last state, to a higher one.
    """
    five, four = (solve("dam", "107", "0", steps, **STIFF_FRICTION)[0] for steps in (5, 4))
    assert verdict(five) == verdict(four) == "stands"
    for name in ("crest_ux", "N", "T"):
        assert five.last[name] == pytest.approx(four.last[name], rel=1e-4)


@pytest.mark.heavy
def test_a_path_lost_from_an_earlier_state_is_followed_from_the_last_one(solve):
    """With three steps it was "not converged", 2e-5 below the limit point: the path from 40.67 m
    had led to another branch.
    """
    stiff = {"K_N": 1e12, "K_T": 4e12, "sigma_max": 8e5, "G_f": 100, "dam_base": 26}
    stiff |= {"law": "mixed", "uplift": "none", "n_joint": 20}
    (result,) = solve("dam", "38,42", None, 3, **stiff)
    assert verdict(result) == "sliding"
    (highest,) = re.findall(r"reaches (\S+) m at most", statement(result))
    assert result.last["level"] == pytest.approx(float(highest), rel=1e-4)


@pytest.mark.heavy
def test_a_step_over_a_limit_point_says_so_and_names_critical(solve):
    """A bond without tension stands at 48.7 m with 16 steps; its path ends at 48.49 m."""
    scene = replace(random_scene(31, 2).rising_from(7.5, 48.7), steps=16)
    (result,) = solve("dam", scene.levels, scene.tail_levels, 16, **scene.settings)
    assert verdict(result) == "stands"
    ((begin, end),) = result.info["passed_over"]
    assert begin < 48.49 < end == 48.7
    said = " ".join(hints_on_path(result))
    assert "the load step from level 46.125 to 48.7 m passes over a limit point" in said
    assert "levels above 46.125 m are reached after unstable crack growth" in said
    assert level_of_growth(result) == begin
    # where the mesh resolves the process zone no halves are computed
    assert not LoadStepper(load("a")).unresolved


#: A small dam on a stiff mixed joint: a limit point, passed by a path from before it (174-27).
PASSED = {"dam_height": 8.13, "dam_base": 3.8, "dam_crest": 0.191, "E": 1.28e9, "n_joint": 10}
PASSED |= {"mesh_pattern": "regular", "law": "mixed", "sigma_max": 64200, "G_f": 4.91, "order": 1}
PASSED |= {"K_N": 6.61e13, "K_T": 6.61e13, "uplift": "imposed", "weight_first": 0}


def rows_follow_one_another(stepper):
    """Whether each row of the history is of an update that has led to the last state."""
    updates = {update.state.loading.level for update in stepper.state.trace.updates}
    return set(stepper.history.rows["level"]) <= updates


@pytest.mark.heavy
def test_a_limit_point_that_another_path_passes_has_no_row():
    """The first one was 2e-5 lower, and no ancestor of the second."""
    stepper = LoadStepper(replace(load("dam", PASSED, "7.77", steps=4), all_steps=True))
    stepper.run()
    assert stepper.stopped
    assert rows_follow_one_another(stepper)


@pytest.mark.heavy
def test_a_step_to_the_other_equilibrium_of_its_level_is_taken_again():
    """A table beyond the limit point is replaced by that of the rising branch, and the path goes on
    from there.
    """
    dam = replace(load("dam", PASSED, "4,7.77"), all_steps=True)
    first = LoadStepper(dam)
    first.advance_to(1)
    path = EquilibriumPath([Point(first.model, first.state, first.history.copy())], 2)
    while path.levels[-1] >= 0.98 * path.highest:
        path.advance()
    end = path.points[-1]
    stepper = first.fork(replace(load("dam", PASSED, (4, end.level, 7.77)), all_steps=True))
    rising = stepper.fork(stepper.case)
    rising.advance_to(2)
    stepper.accept(StepResult(replace(end.state, time=2), 1, 0.0), cuts=0)
    stepper.save_last()
    assert abs(stepper.state.jump).max() > 1.01 * abs(rising.state.jump).max()
    stepper.run()
    off = abs(stepper.history.saved[0].jump - rising.state.jump).max()
    assert off < 1e-4 * abs(rising.state.jump).max()
    assert stepper.history.rows["level"][:2] == [4, end.level]
    assert stepper.state.loading.level == pytest.approx(path.highest, rel=1e-4)
    assert rows_follow_one_another(stepper)


@pytest.mark.heavy
def test_a_path_ends_where_all_strength_is_lost():
    """Nothing holds a dam whose mixed joint has broken whole: the path ends as the level falls."""
    case = load("dam", {"law": "mixed", "n_joint": 10})
    path = FailurePath(case, interface_of(case), target=60)
    path.follow(np.inf)
    levels = np.array([point.level for point in path.points])
    assert path.ended
    assert levels[-1] < STRENGTH_LOST * levels.max()
    assert levels[levels.argmax() : -1].min() >= STRENGTH_LOST * levels.max()
