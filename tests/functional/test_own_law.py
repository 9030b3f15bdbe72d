"""A further law is a class: the engine, the tables and the verdict take it as it is."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from damjoint import data
from damjoint.engines.getdp.process import Runner, write_problem
from damjoint.engines.getdp.tables import read_history
from damjoint.input.resolve import load
from damjoint.joint.interface import interface_of
from damjoint.laws import LAWS, Law
from damjoint.mesh.mesh import mesh_of
from damjoint.pictures.run_picture import shear_limit
from damjoint.solver.load_stepper import LoadStepper
from damjoint.statics.hints import hints
from damjoint.statics.verdict import verdict


class Springs(Law):
    """An elastic joint: K_N and K_T in tension and compression."""

    has_friction = False

    def __init__(self, parameters):
        self.stiffness = np.diag([parameters["K_N"], parameters["K_T"], parameters["K_T"]])

    def response(self, jump, variables):
        return jump @ self.stiffness, lambda: np.tile(self.stiffness, (len(jump), 1, 1))


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


#: The same law as a file of the problem definition
SPRINGS = """
law_variables = "unused unused_1 unused_2";
law_column = "";
law_has_grouting = 0;
law_has_sawing = 0;
law_has_release = 0;
Function {
  law_tangent[Sur_Law] = TensorDiag[K_T, K_N, K_T];
  law_secant[Sur_Law] = TensorDiag[K_T, K_N, K_T];
  law_traction[Sur_Law] = TensorDiag[K_T, K_N, K_T] * $1;
  law_initial_scalar[Sur_Law] = 0;
  law_new_scalar[Sur_Law] = $2;
  law_new_vector[Sur_Law] = $3;
  law_damage[Sur_Law] = 0;
  law_slip[Sur_Law] = 0;
  law_open[Sur_Law] = 0;
  law_slid[Sur_Law] = 0;
  law_critical_opening[Sur_Law] = 0;
}
"""


def test_a_toy_law_in_the_problem_definition(result, tmp_path):
    """One file, pro/law_springs.pro: the resultants are those of the Python class."""
    case = result.case
    shutil.copytree(data("pro"), tmp_path / "pro")
    (tmp_path / "pro/law_springs.pro").write_text(SPRINGS)
    mesh = mesh_of(case)
    mesh.write(tmp_path / "dam.msh")
    problem = write_problem(case, None, tmp_path, {"views": 0.0})
    problem.write_text(problem.read_text().replace(str(data("pro")), "pro"))
    Runner().execute(problem, ["-msh", "dam.msh", "-solve", "Fill"])
    history = read_history(case, tmp_path)
    for name in ("N", "T", "M", "heel"):
        expected = result.heel[-1] if name == "heel" else result.last[name]
        assert history[name][-1] == pytest.approx(expected, rel=1e-6)
    assert history["iterations"][-1] <= 1
