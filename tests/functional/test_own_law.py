"""A further law is a class: the engine, the tables and the verdict take it as it is."""

from dataclasses import replace

import numpy as np
import pytest
from damjoint.joint.interface import interface_of
from damjoint.laws import LAWS, Law
from damjoint.model.case import load
from damjoint.post.pictures import shear_limit
from damjoint.solver.load_stepper import LoadStepper
from damjoint.statics.verdict import hints, verdict


class Springs(Law):
    """An elastic joint: K_N and K_T in tension and compression."""

    limits_shear = False

    def __init__(self, parameters):
        self.stiffness = np.diag([parameters["K_N"], parameters["K_T"], parameters["K_T"]])

    def traction_and_tangent(self, jump, variables):
        return jump @ self.stiffness, np.tile(self.stiffness, (len(jump), 1, 1))


@pytest.fixture
def result(monkeypatch):
    monkeypatch.setitem(LAWS, "springs", Springs)
    case = load("dam", {"n_joint": 20}, "30")
    case = replace(case, values=case.values | {"law": "springs"})
    return LoadStepper(case, interface_of(case)).run()


def test_a_toy_law_follows_its_closed_form(result):
    """Stress is stiffness times jump at every node, and equilibrium is met."""
    case, rows = result.case, result.at()
    np.testing.assert_allclose(rows["sigma_n_eff"], case["K_N"] * rows["delta_n"], rtol=1e-9)
    np.testing.assert_allclose(rows["tau_1"], case["K_T"] * rows["delta_t1"], rtol=1e-9)
    thrust = case["rho_water"] * case["g"] * 30**2 / 2
    assert result.last["T"] == pytest.approx(thrust, rel=1e-9)
    assert result.last["iterations"] <= 1


def test_a_toy_law_needs_nothing_else(result):
    assert verdict(result) == "stands" and shear_limit(result.case, result.at()) is None
    assert not any("law" in hint for hint in hints(result))
    assert not result.at()["damage"][result.at()["delta_n"] < 0].any()
    assert not result.at()["slip"].any()
