"""How a failure is told from resultants: on both sides of each limit."""

import numpy as np
import pytest
from damjoint.results import verdict
from damjoint.results.tables import HISTORY, Results
from damjoint.scene.case import load

#: Effective normal force [N/m] of all these states.
N = 1e6


def stopped(law, crack=0.0, **last):
    """A dam on a base of 5 m whose run has stopped in a state; crack: share of the base."""
    case = load("c", {"law": law, "pena_tang": 0, "uplift": "none"}, levels="3")
    length = case.joint_length
    state = {"N": N, "T": 0.0, "M": N * length / 2, "level": 2.0, "time": 0.5}
    state |= {"crack_length": crack * length, "slip_length": 0.0} | last
    history = {name: np.array([state.get(name, 0.0)]) for name in HISTORY}
    joint = dict.fromkeys(("time", "x", "s", "slip"), np.zeros(0))
    return Results(case, history, joint, {}, stopped=True)


@pytest.mark.parametrize(
    "crack, arm, overturns",
    [
        *((0.5, 0.09, True), (0.5, 0.11, False)),
        *((0.79, 0.11, False), (0.81, 0.11, True)),
        *((0.9, 0.19, True), (0.9, 0.21, False)),
    ],
)
def test_overturning_by_where_the_resultant_is(crack, arm, overturns):
    """In the last tenth of the base; in its last fifth where the crack has crossed most of it."""
    length = stopped("rupture").case.joint_length
    found = verdict.verdict(stopped("rupture", crack, M=arm * length * N))
    assert (found == "overturning") == overturns


@pytest.mark.parametrize("law", ["friction", "bond"])
@pytest.mark.parametrize("share, slides", [(0.97, False), (0.99, True)])
def test_sliding_by_the_share_of_the_capacity(law, share, slides):
    """mu N + c L of friction, mu N of a bond, within 2 %."""
    case = stopped(law).case
    cohesion = case["adhesion"] * case.joint_length if law == "friction" else 0
    found = verdict.verdict(stopped(law, T=share * (case["mu"] * N + cohesion)))
    assert (found == "sliding") == slides


@pytest.mark.parametrize("share, there", [(0.998, False), (0.9985, False), (0.9992, True)])
def test_how_near_to_the_bound_of_the_rigid_block_counts_as_there(share, there):
    """A thousandth."""
    result = stopped("friction")
    holds = result.case["mu"] * N + result.case["adhesion"] * result.case.joint_along
    said = verdict.bound(result.case, result.last | {"T": share * holds})
    assert ("reaches mu N + c L" in said) == there
