"""damjoint run --sensitivity: what the stiffnesses mean, and what of a run moves with them."""

import numpy as np
import pytest
from damjoint.input.resolve import load
from damjoint.studies import stiffness

SMALL = {"n_joint": 10.0, "h_dam": 15.0, "h_found": 60.0, "uplift": "cracked"}
WORDS = [word for name, value in SMALL.items() for word in ("--set", f"{name}={value}")]


def test_the_closure_under_the_weight_is_that_of_a_rigid_block():
    """rho g A/(K_N L) of the trapezium of 34 and 5 m, 45 m high: 6.076 um; K_N L/E = 136."""
    text = stiffness.meaning(load("dam", SMALL))
    closure = 2400 * 9.81 * (34 + 5) / 2 * 45 / (1e11 * 34)
    assert f"the weight closes the joint by {1e6 * closure:.3g} µm" in text
    assert text.endswith("K_N L/E = 136, K_N h/E = 13.6, K_T/K_N = 0.5")


@pytest.mark.heavy
def test_repeated_runs_are_those_of_a_tenth_and_ten_times_the_stiffness(solve):
    case = load("dam", SMALL, "45")
    runs = list(stiffness.repetitions(case, solve("dam", "45", **SMALL)[0], ["K_T"], "auto"))
    assert [label for label, _ in runs] == ["as set", "K_T / 10", "K_T x 10"]
    for (_, result), K_T in zip(runs, (5e10, 5e9, 5e11), strict=True):
        (wanted,) = solve("dam", "45", **SMALL, K_T=K_T)
        assert result.case["K_T"] == pytest.approx(K_T)
        np.testing.assert_allclose(result.joint["delta_t1"], wanted.joint["delta_t1"], rtol=1e-9)
    slips = [stiffness.last_state(result)["slip"] for _, result in runs]
    assert slips[1] > 5 * slips[0] > 10 * slips[2] > 0  # slip of an elastic joint
    assert len({f"{stiffness.last_state(r)['SSF']:.3f}" for _, r in runs}) == 1  # of the loads


@pytest.mark.heavy
def test_the_command_prints_a_row_for_each_joint_and_what_is_refused(command):
    """With a tenth of K_T the joint of friction stores more than G_t before it softens."""
    lifts = "--set", "lift_heights=20", "--set", "K_T=1e9", "--set", "G_t=100"
    words = "run", "dam", *WORDS, *lifts, "--levels", "30", "--no-picture", "--no-fields"
    code, out, _ = command(*words, "--sensitivity", "K_T", "--wide")
    assert code == 0 and "K_N of joint base: the weight closes the joint by" in out
    assert sum(line.startswith("K_T x 10") for line in out.splitlines()) == 2
    _, out, _ = command(*words, "--sensitivity", "K_T")
    assert sum(line.startswith("K_T x 10") for line in out.splitlines()) == 1
    assert "(lift 20 m: no change but of the tangential jump; rows with --wide)" in out
    assert "K_T / 10: G_t = 100: must be > 200 N/m" in out


@pytest.mark.heavy
def test_a_parameter_without_effect_is_named(command):
    """With law rupture no friction acts; N does not depend on K_N, which leaves round-off in it."""
    words = "run", "a", *WORDS[:6], "--no-picture", "--no-fields"
    code, out, _ = command(*words, "--levels", "3", "--sensitivity", "mu")
    assert code == 0 and "sensitivity: no effect of mu\n" in out
    _, out, _ = command(*words, "--levels", "3", "--sensitivity", "K_N")
    rows = [line.split() for line in out.splitlines() if line.startswith("K_N  ")]
    assert rows and all(row[-2:] == ["0", "0"] for row in rows)
    assert max(len(line) for line in out.splitlines() if line.startswith("as set")) <= 80


def test_only_stiffnesses_that_are_named_repeat_the_run():
    assert stiffness.named_in("mu, K_T,K_N") == ["K_N", "K_T"]
    assert stiffness.named_in("all") == stiffness.named_in("") == []


def test_a_run_says_what_the_stiffnesses_mean(command):
    _, out, _ = command("run", "a", "--no-picture", "--no-fields")
    assert "K_N: the weight closes the joint by 153 nm; K_N L/E = 1.67, " in out
