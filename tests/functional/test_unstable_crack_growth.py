"""Unstable crack growth at constant load, and the state after it."""

from collections import Counter
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from damjoint.input.resolve import load
from damjoint.laws import LAWS
from damjoint.solver import relaxation
from damjoint.solver.controls import LevelControl
from damjoint.solver.load_stepper import LoadStepper, Mechanism
from damjoint.solver.model import Begun
from damjoint.solver.relaxation import ROUGH
from damjoint.solver.step import MOST_FAILURES
from damjoint.statics.hints import hints
from damjoint.statics.verdict import verdict
from damjoint_witness.files import Files
from damjoint_witness.verify import Witness

#: A slender dam of realistic stiffness. Under uplift the crack of law = rupture grows unstably:
#: shear stiffness is lost on opening, and this law has no friction.
SLENDER = {"dam_height": 40, "dam_base": 28.8, "E": 1e10, "h_found": 7, "sigma_max": 100}


@pytest.mark.heavy
@pytest.mark.parametrize("uplift", ["flow", "imposed", "cracked"])
@pytest.mark.parametrize("n_joint", [50, 100])
def test_a_slender_dam_fills_to_its_crest(command, uplift, n_joint):
    """The files satisfy equilibrium and law, also in rounds with frozen damage, for flow."""
    overrides = SLENDER | {"uplift": uplift, "n_joint": n_joint}
    words = [w for name, value in overrides.items() for w in ("--set", f"{name}={value}")]
    words = ["run", "ssnp142", *words, "--levels", "40"]
    code, *_ = command(*words, "--out", "out", "--no-fields", "--no-picture", "--all-steps")
    run = Witness(Files(Path("out"), tuple(words), code))
    assert code == 0 and run.files.record["state"] == "complete"
    assert run.violations() == []
    if uplift == "flow":
        assert run.steps["frozen"].any()


@pytest.mark.heavy
def test_the_state_after_unstable_crack_growth_hardly_depends_on_the_steps(solve):
    levels = [",".join(f"{40 * (k + 1) / n:g}" for k in range(n)) for n in (1, 4, 16)]
    found = [solve("ssnp142", path, uplift="flow", **SLENDER)[0] for path in levels]
    assert all(result.last["level"] == 40 for result in found)
    openings = [result.last["max_opening"] for result in found]
    assert max(openings) < 1.05 * min(openings)


@pytest.mark.heavy
def test_a_hint_reports_unstable_crack_growth(solve):
    """The hint states that the results depend on steps and mesh, and what helps."""
    (unstable,) = solve("ssnp142", "40", uplift="flow", **SLENDER)
    assert verdict(unstable) == "stands" and min(unstable.info["unstable_growth"]) <= 40
    assert any("depends on steps and mesh" in hint for hint in hints(unstable))
    assert any("alpha = 2 keeps the stiffness" in hint for hint in hints(unstable))
    (stable,) = solve("ssnp142", "40", uplift="flow", alpha=2, **SLENDER)
    assert stable.last["level"] == 40 and not any("alpha" in hint for hint in hints(stable))


@pytest.mark.heavy
def test_a_relaxation_that_converges_slowly_is_ended_by_newtons_method(solve):
    """A rigid block stands up to 7.5 m; rounds of the relaxation alone end at 6.5 m."""
    dam = {"dam_height": 6.97, "dam_base": 4.28, "dam_crest": 0.693, "E": 1.79e10, "nu": 0.178}
    law = {"law": "rupture", "K_N": 8.55e12, "K_T": 1.17e13, "sigma_max": 75400, "alpha": 1}
    mesh = {"order": 1, "n_joint": 40, "found_side": 6.97, "found_depth": 6.97}
    more = {"pena_rupture": 83.2, "uplift": "cracked", "weight_first": 0, "tail_levels": "0.596"}
    (result,) = solve("ssnp142", "6.41,8.13", **dam, **law, **mesh, **more)
    assert verdict(result) == "overturning" and result.last["level"] > 7.4


def test_rounds_of_the_relaxation_are_solved_as_far_as_they_count(monkeypatch):
    """To a part of the law's residual: fewer iterations, the same state after the last round."""
    stepper = LoadStepper(load("e", {"E_dam": 21e9, "n_joint": 20.0}))
    stepper.weigh()
    relaxed = []
    for rough in (ROUGH, 0.0):
        monkeypatch.setattr(relaxation, "ROUGH", rough)
        relaxed.append(relaxation.relax(stepper.model, stepper.state, 3.0, LevelControl(8.0)))
    (one, balanced), (whole, also) = relaxed
    assert balanced and also and one.iterations < 0.9 * whole.iterations
    np.testing.assert_allclose(one.state.jump, whole.state.jump, rtol=0, atol=1e-14)


def test_rounds_whose_residuals_fall_steadily_are_ended_by_the_law(monkeypatch):
    """Newton's method leads in a third of the rounds to the state at which they end themselves."""
    dam = {"dam_height": 7.75, "dam_base": 4.81, "dam_crest": 0.846, "E": 1.36e10}
    law = {"law": "bond", "K_N": 1e12, "K_T": 1e12, "sigma_max": 0, "adhesion": 1e5, "mu": 0.7}
    mesh = {"n_joint": 10, "order": 1, "found_side": 7, "found_depth": 7}
    stepper = LoadStepper(load("dam", dam | law | mesh | {"G_f": 2, "G_t": 4}))
    stepper.weigh()
    rounds, states = [], []
    for steady in (relaxation.steady, lambda sizes: False):
        seen = []
        record = lambda sizes, steady=steady, seen=seen: seen.append(1) or steady(sizes)
        monkeypatch.setattr(relaxation, "steady", record)
        step, balanced = relaxation.relax(stepper.model, stepper.state, 1.0, LevelControl(7.75))
        assert balanced
        rounds.append(len(seen))
        states.append(step.state.jump)
    assert 3 <= rounds[0] < rounds[1] / 2
    np.testing.assert_allclose(*states, rtol=0, atol=1e-8 * np.abs(states[1]).max())


def test_steps_are_not_shortened_for_every_growth_beyond_the_end_of_a_path():
    """They are until relaxation has led beyond it once, and where a mechanism has been shown."""
    stepper = LoadStepper(load("e", {"E_dam": 21e9, "n_joint": 20.0}))
    stepper.weigh()
    assert not stepper.beyond_path(smallest=False)
    stepper.path_ended = True
    assert stepper.beyond_path(smallest=False) and not stepper.beyond_path(smallest=True)
    assert stepper.over_limit_point(3.0, cuts=1, smallest=True)
    assert not stepper.beyond_path(smallest=False)
    stepper.mechanism = Mechanism("sliding", 4.0, 3.0)
    assert stepper.beyond_path(smallest=False) and stepper.beyond_path(smallest=True)


def test_what_has_failed_with_frozen_damage_is_not_tried_again(monkeypatch):
    """First with flow and jump together, then with frozen pressure."""
    stepper = LoadStepper(load("e", {"E_dam": 21e9, "n_joint": 20.0}))
    stepper.weigh()
    model, tried = stepper.model, []
    spy = lambda self, control, options: tried.append(list(options.strategies))
    monkeypatch.setattr(Begun, "solve", spy)  # nothing converges
    first, *others = (one for one in model.strategies[:-1] if not one.release)
    for failures in (None, Counter(dict.fromkeys(model.strategies, MOST_FAILURES))):
        step = relaxation.relax(model, stepper.state, 3.0, LevelControl(8.0), failures)
        assert step is None
    assert others and tried == [[first], [first, *others], [first], [first]]


def test_a_steady_fall_needs_the_same_ratio_three_times():
    assert relaxation.steady([9, 8, 4, 2, 1]) and relaxation.steady([8, 4.01, 2, 1])
    assert not relaxation.steady([4, 2, 1]) and not relaxation.steady([8, 4.1, 2, 1])
    assert not relaxation.steady([1, 2, 4, 8]) and not relaxation.steady([1, 1, 1, 1])


@pytest.mark.parametrize("law", LAWS)
def test_alternate_minimisation_converges_to_the_law(law):
    """At constant jump: freeze the damage, update it, until it does not change."""
    case = load("ssnp142", {"law": law, "sigma_max": 3e5, "adhesion": 1.2e5, "K_N": 1e11})
    model, rng = case.law, np.random.default_rng(5)
    jump = rng.normal(0, 1, (300, 3)) * [1.5e-5, 1e-5, 1e-5]
    begin = variables = model.initial(len(jump))
    first = lambda v: getattr(v, fields(v)[0].name)
    for _ in range(200):
        frozen = model.freeze(jump, variables)
        before, variables = variables, frozen.update_internal_variables(jump, variables)
        assert (first(variables) >= first(before)).all()  # irreversible
    wanted = model.traction_and_tangent(jump, begin)[0]
    once = model.update_internal_variables(jump, begin)
    np.testing.assert_allclose(first(variables), first(once), rtol=1e-9)
    found = model.traction_and_tangent(jump, variables)[0]
    np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-6 * np.abs(wanted).max())


@pytest.mark.parametrize("law", ["rupture", "bond"])
def test_frozen_damage_gives_a_linear_law(law):
    """The stress is linear in the opening, with constant tangent."""
    case = load("ssnp142", {"law": law, "sigma_max": 3e5, "adhesion": 3e5, "K_N": 1e11})
    model = case.law
    openings = np.linspace(1e-6, 1e-3, 7)
    jump = np.column_stack([openings, np.full(7, 1e-8), np.zeros(7)])
    frozen = model.freeze(np.zeros((7, 3)), model.initial(7))
    traction, tangent = frozen.traction_and_tangent(jump, model.initial(7))
    np.testing.assert_allclose(traction, jump * [case["K_N"], case["K_T"], 0], rtol=1e-12)
    np.testing.assert_allclose(tangent[:, 0, 0], case["K_N"])
    assert not tangent[:, 1:, 0].any()
