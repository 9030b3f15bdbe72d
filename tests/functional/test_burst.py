"""Bursts: what breaks at once under a standing load, and where it comes to rest."""

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from damjoint.laws import LAWS
from damjoint.model.case import load
from damjoint.statics.verdict import hints, verdict
from damjoint_tools.verification import Written, violations

#: A slender dam of real stiffness: under uplift the rupture law's crack runs on at once, as where
#: it opens it lets go of its shear, and no friction takes that over.
SLENDER = {"dam_height": 40, "dam_base": 28.8, "E": 1e10, "h_found": 7, "sigma_max": 100}


@pytest.mark.parametrize("uplift", ["imposed", "flow", "cracked"])
@pytest.mark.parametrize("n_joint", [50, pytest.param(100, marks=pytest.mark.heavy)])
def test_a_slender_dam_fills_to_its_crest(command, uplift, n_joint):
    """Verified by what has been written: equilibrium by hand, law, pressure and memory."""
    overrides = SLENDER | {"uplift": uplift, "n_joint": n_joint}
    words = [w for name, value in overrides.items() for w in ("--set", f"{name}={value}")]
    written = ("--levels", "40", "--out", "out", "--no-fields", "--no-picture")
    code, *_ = command("run", "ssnp142", *words, *written)
    run = Written(load("ssnp142", overrides, "40"), Path("out"), code)
    assert code == 0 and run.told["state"] == "complete"
    assert violations(run) == []


def test_where_a_burst_comes_to_rest_hardly_depends_on_the_steps(solve):
    levels = [",".join(f"{40 * (k + 1) / n:g}" for k in range(n)) for n in (1, 4, 16)]
    found = [solve("ssnp142", way, uplift="flow", **SLENDER)[0] for way in levels]
    assert all(result.last["level"] == 40 for result in found)
    openings = [result.last["max_opening"] for result in found]
    assert max(openings) < 1.05 * min(openings)


def test_a_burst_is_told(solve):
    """A run whose state depends on its way says so, and what helps."""
    (ran_on,) = solve("ssnp142", "40", uplift="flow", **SLENDER)
    assert verdict(ran_on) == "stands" and min(ran_on.info["unstable_growth"]) <= 40
    assert any("depends on steps and mesh" in hint for hint in hints(ran_on))
    assert any("alpha = 2 keeps the stiffness" in hint for hint in hints(ran_on))
    (kept,) = solve("ssnp142", "40", uplift="flow", alpha=2, **SLENDER)
    assert kept.last["level"] == 40 and not any("alpha" in hint for hint in hints(kept))


@pytest.mark.parametrize("law", LAWS)
def test_breaking_by_turns_leads_where_the_law_does(law):
    """At a given jump: held, and then let go, until nothing changes."""
    case = load("ssnp142", {"law": law, "sigma_max": 3e5, "adhesion": 2e5, "K_N": 1e11})
    model, rng = case.law, np.random.default_rng(5)
    jump = rng.normal(0, 1, (300, 3)) * [1.5e-5, 1e-5, 1e-5]
    begin = variables = model.initial(len(jump))
    first = lambda v: getattr(v, fields(v)[0].name)
    for _ in range(200):
        frozen = model.freeze(jump, variables)
        before, variables = variables, frozen.update_internal_variables(jump, variables)
        assert (first(variables) >= first(before)).all()  # nothing heals
    wanted = model.traction_and_tangent(jump, begin)[0]
    once = model.update_internal_variables(jump, begin)
    np.testing.assert_allclose(first(variables), first(once), rtol=1e-9)
    found = model.traction_and_tangent(jump, variables)[0]
    np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-6 * np.abs(wanted).max())


@pytest.mark.parametrize("law", ["rupture", "bond"])
def test_a_held_joint_breaks_nowhere(law):
    """Its stress is a straight line in the opening, and its tangent that line's."""
    case = load("ssnp142", {"law": law, "sigma_max": 3e5, "adhesion": 3e5, "K_N": 1e11})
    model = case.law
    openings = np.linspace(1e-6, 1e-3, 7)
    jump = np.column_stack([openings, np.full(7, 1e-8), np.zeros(7)])
    frozen = model.freeze(np.zeros((7, 3)), model.initial(7))
    traction, tangent = frozen.traction_and_tangent(jump, model.initial(7))
    np.testing.assert_allclose(traction, jump * [case["K_N"], case["K_T"], 0], rtol=1e-12)
    np.testing.assert_allclose(tangent[:, 0, 0], case["K_N"])
    assert not tangent[:, 1:, 0].any()
