"""Verdicts from resultants, on both sides of each limit."""

from dataclasses import replace

import numpy as np
import pytest
from damjoint.input.case import OfJoint
from damjoint.input.resolve import load
from damjoint.model.results import HISTORY, Results
from damjoint.statics import verdict
from damjoint.statics.hints import hints
from damjoint.statics.statement import statement as statement_of

#: Effective normal force of all states [N/m].
N = 1e6


def stopped(law, crack=0.0, n_joint=50.0, **last):
    """A run that has stopped in this state, on a base of 5 m; crack: share of the base."""
    case = load("c", {"law": law, "pena_tang": 0, "uplift": "none", "n_joint": n_joint}, levels="3")
    length = case.joint_length
    state = {"N": N, "T": 0.0, "M": N * length / 2, "level": 2.0, "time": 0.5}
    state |= {"crack_length": crack * length, "slip_length": 0.0} | last
    state["x_resultant"] = length - state["M"] / N
    history = {name: np.array([state.get(name, 0.0)]) for name in HISTORY}
    joint = dict.fromkeys(("time", "x", "s", "slip"), np.zeros(0))
    return Results(case, history, joint, {}, stopped=True)


@pytest.mark.parametrize(
    "n_joint, crack, arm, overturns",
    [
        *((50.0, 0.5, 0.0099, True), (50.0, 0.5, 0.0101, False)),
        *((200.0, 0.9, 0.0099, True), (200.0, 0.9, 0.0101, False)),
        *((10.0, 0.9, 0.049, True), (10.0, 0.9, 0.051, False)),
    ],
)
def test_overturning_by_the_position_of_the_resultant(n_joint, crack, arm, overturns):
    """In the last hundredth of the base, or in the last half of an element, whatever the crack."""
    result = stopped("rupture", crack, n_joint)
    assert verdict.verdict(result) == "not converged"
    result.history["M"] += (arm - 0.5) * result.case.joint_length * N
    assert (verdict.verdict(result) == "overturning") == overturns
    assert (verdict.bound(result).mode == "overturning") == overturns


@pytest.mark.parametrize("law", ["friction", "bond"])
@pytest.mark.parametrize("share, slides", [(0.994, False), (0.996, True)])
def test_sliding_by_the_share_of_the_shear_strength(law, share, slides):
    """mu N + c L, to half a percent, by which the last step of a run may be below it."""
    result = stopped(law)
    holds = result.case["mu"] * N + result.case["adhesion"] * result.case.joint_along
    result.history["T"] += share * holds
    assert (verdict.verdict(result) == "sliding") == slides
    assert ("reaches the shear strength" in statement_of(result)) == slides


def with_joint(law, damage, stress):
    """A stopped run whose joint has a damage and an effective normal stress [Pa] everywhere."""
    result = stopped(law)
    ends = np.array([0, result.case.joint_along])
    columns = dict.fromkeys(("time", "joint"), np.ones(2)) | dict.fromkeys(("x", "s"), ends)
    columns |= {n: np.zeros(2) for n in ("slip", "y", "z")}
    columns |= {"damage": np.full(2, damage), "sigma_n_eff": np.full(2, stress)}
    result.joint.update(columns)
    return result


def test_sliding_of_a_bond_by_its_undamaged_cohesion():
    """Half of c L at damage 1/2; all of friction."""
    for law, left in (("bond", 0.5), ("friction", 1.0)):
        result = with_joint(law, 0.5, 0.0)
        assert verdict.shear_resistance(result, 0.0) == pytest.approx(
            left * result.case["adhesion"] * result.case.joint_along
        )


def test_tension_presses_on_the_rest_of_a_bond():
    """N is the pressure less the tension: the friction of a bond acts on the pressure, that of the
    law friction, whose tension takes from the cohesion, on N.
    """
    tension = 1e5
    for law, pressed in (("bond", tension), ("friction", 0.0)):
        result = with_joint(law, 0.0, tension)
        case, length = result.case, result.case.joint_along
        assert verdict.shear_resistance(result, N) == pytest.approx(
            case["mu"] * (N + pressed * length) + case["adhesion"] * length
        )


@pytest.mark.parametrize("engine, expected", [("getdp", True), ("condensed", False)])
def test_the_getdp_engine_has_a_hint_that_it_does_not_follow_the_path(engine, expected):
    result = stopped("bond")
    result.info["engine"] = engine
    assert any("does not follow the equilibrium path" in h for h in hints(result)) == expected


@pytest.mark.parametrize("mu, mode", [(0.1, "sliding"), (2.0, "not converged")])
def test_a_run_without_a_step_has_failed_only_by_statics(mu, mode):
    """T = 44 kN/m at 3 m: where the joint could bear it the solution is at fault, not the dam."""
    case = load("c", {"law": "friction", "adhesion": 0, "mu": mu, "pena_tang": 0}, levels="3")
    case = case.with_values({"rho_dam": 300.0})
    none = {name: np.zeros(0) for name in HISTORY}
    result = Results(case, none, dict.fromkeys(("time", "x", "s"), np.zeros(0)), {}, stopped=True)
    result.info["end_of_solution"] = "the residual stagnates at 0.1 of the loads"
    assert verdict.verdict(result) == mode
    expected = {
        "sliding": "sliding: no equilibrium at level 3 m: the shear exceeds the strength",
        "not converged": "none is excluded by statics; the residual stagnates at 0.1 of the loads",
    }
    assert expected[mode] in statement_of(result)


def test_the_statement_gives_the_mechanism_found_on_the_path():
    """Far from any bound the mechanism is the reason; without one the run has not converged."""
    result = stopped("bond")
    statement = statement_of(result)
    assert statement.startswith("not converged: no equilibrium is found beyond level 2 m")
    assert "and no mechanism either; there the resultant is 2.5 m from the toe" in statement
    result.info["end_of_solution"] = "the residual stagnates at 0.1 of the loads"
    assert "either; the residual stagnates at 0.1 of the loads; there the" in statement_of(result)
    result.info["mechanism"] = {
        "mode": "sliding",
        "level": 2.5,
        "displacement_ratio": 4.2,
        "time": 1.0,
    }
    statement = statement_of(result)
    assert statement.startswith("sliding: no equilibrium beyond level 2 m")
    assert "2.5 m at most (followed to 4.2 times the displacement of that level)" in statement
    result.info["mechanism"]["level"] = 2.0001  # the path's limit point is its last state
    assert "no equilibrium beyond level 2.0001 m" in statement_of(result)


def test_a_statement_after_unstable_crack_growth_names_its_lowest_level():
    """The strength that is left there depends on the steps, and so does the level of the stop."""
    result = stopped("bond")
    holds = result.case["mu"] * N + result.case["adhesion"] * result.case.joint_along
    result.history["T"] += holds
    result.info["unstable_growth"] = (1.75, 1.5)
    where = "no equilibrium beyond level 2 m (t = 0.5), after unstable crack growth at level 1.5 m"
    assert f"sliding: {where}: T = " in statement_of(result)


@pytest.mark.parametrize(
    "names", [("b10", "b1", "b1 and b"), ("b1", "b10", "b"), ("b", "b 1", "b1")]
)
@pytest.mark.parametrize("failing", [(0,), (1,), (2,), (1, 2), (0, 2)])
def test_the_failing_joints_are_those_of_the_mechanism(names, failing):
    """Whatever their names, one of which may begin another one."""
    result = stopped("friction")
    case = result.case.with_joints(
        [
            OfJoint(name=n, upper="dam", lower="foundation", values={}, section=result.case.section)
            for n in names
        ]
    )
    result = replace(result, case=case)
    result.info["mechanism"] = {"mode": "sliding", "joints": failing}
    assert verdict.failing_joints(result) == failing
    assert verdict.verdict(result) == f"sliding on {' and '.join(names[k] for k in failing)}"
    assert verdict.decisive_joint(result) == failing[0]
