"""Unstable crack growth at constant load, and the state after it."""

from pathlib import Path

import numpy as np
import pytest
from damjoint.laws import LAWS
from damjoint.model.case import load
from damjoint.statics.verdict import hints, verdict
from damjoint_tools.verification import RunFiles, violations

#: A slender dam of realistic stiffness. Under uplift the crack of law = rupture grows unstably:
#: shear stiffness is lost on opening, and this law has no friction.
SLENDER = {"dam_height": 40, "dam_base": 28.8, "E": 1e10, "h_found": 7, "sigma_max": 100}


@pytest.mark.parametrize("uplift", ["imposed", "flow", "cracked"])
@pytest.mark.parametrize("n_joint", [50, pytest.param(100, marks=pytest.mark.heavy)])
def test_a_slender_dam_fills_to_its_crest(command, uplift, n_joint):
    """The result files satisfy equilibrium, law, pressure and irreversibility."""
    overrides = SLENDER | {"uplift": uplift, "n_joint": n_joint}
    words = [w for name, value in overrides.items() for w in ("--set", f"{name}={value}")]
    words += ["--levels", "40", "--out", "out", "--no-fields", "--no-picture"]
    code, *_ = command("run", "ssnp142", *words)
    files = RunFiles(load("ssnp142", overrides, "40"), Path("out"), code)
    assert code == 0 and files.record["state"] == "complete"
    assert violations(files) == []


def test_the_state_after_unstable_crack_growth_hardly_depends_on_the_steps(solve):
    levels = [",".join(f"{40 * (k + 1) / n:g}" for k in range(n)) for n in (1, 4, 16)]
    found = [solve("ssnp142", path, uplift="flow", **SLENDER)[0] for path in levels]
    assert all(result.last["level"] == 40 for result in found)
    openings = [result.last["max_opening"] for result in found]
    assert max(openings) < 1.05 * min(openings)


def test_a_hint_reports_unstable_crack_growth(solve):
    """The hint states that the results depend on steps and mesh, and what helps."""
    (ran_on,) = solve("ssnp142", "40", uplift="flow", **SLENDER)
    assert verdict(ran_on) == "stands" and min(ran_on.info["ran_on"]) <= 40
    assert any("depends on steps and mesh" in hint for hint in hints(ran_on))
    assert any("alpha = 2 keeps it, law = bond slides" in hint for hint in hints(ran_on))
    (kept,) = solve("ssnp142", "40", uplift="flow", alpha=2, **SLENDER)
    assert kept.last["level"] == 40 and not any("alpha" in hint for hint in hints(kept))


@pytest.mark.parametrize("law", LAWS)
def test_alternate_minimisation_converges_to_the_law(law):
    """At constant jump: freeze the damage, update it, until it does not change."""
    case = load("ssnp142", {"law": law, "sigma_max": 3e5, "adhesion": 2e5, "K_N": 1e11})
    model, rng = LAWS[law](case), np.random.default_rng(5)
    jump = rng.normal(0, 1, (300, 3)) * [1.5e-5, 1e-5, 1e-5]
    begin = memory = model.start(len(jump))
    for _ in range(200):
        held = model.hold(jump, memory)
        before, memory = memory, model.remember(jump, held)
        assert memory.held is None
        assert (memory.scalar >= before.scalar).all()  # irreversible
    wanted = model.respond(jump, begin)[0]
    once = model.remember(jump, begin)
    np.testing.assert_allclose(memory.scalar, once.scalar, rtol=1e-9)
    found = model.respond(jump, memory)[0]
    np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-6 * np.abs(wanted).max())


@pytest.mark.parametrize("law", ["rupture", "bond"])
def test_frozen_damage_gives_a_linear_law(law):
    """The stress is linear in the opening, with constant tangent."""
    case = load("ssnp142", {"law": law, "sigma_max": 3e5, "adhesion": 3e5, "K_N": 1e11})
    model = LAWS[law](case)
    openings = np.linspace(1e-6, 1e-3, 7)
    jump = np.column_stack([openings, np.full(7, 1e-8), np.zeros(7)])
    held = model.hold(np.zeros((7, 3)), model.start(7))
    traction, tangent = model.respond(jump, held)
    np.testing.assert_allclose(traction, jump * [case["K_N"], case["K_T"], 0], rtol=1e-12)
    np.testing.assert_allclose(tangent[:, 0, 0], case["K_N"])
    assert not tangent[:, 1:, 0].any()
