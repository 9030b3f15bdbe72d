"""Scenes whose equilibrium Newton's method does not reach without further strategies."""

import numpy as np
import pytest
from damjoint.engines.getdp import process
from damjoint.input.resolve import load
from damjoint.laws.friction import FrictionVariables
from damjoint.mesh.mesh import mesh_of
from damjoint.solver.controls import LevelControl
from damjoint.solver.load_stepper import LoadStepper
from damjoint.solver.model import Model
from damjoint.solver.newton import Convergence, Iterate, NotConverged, Strategy, newton
from damjoint.statics.verdict import verdict
from variants import further

#: A dam of realistic stiffness; the shear release of its joint is far shorter than its jumps.
RELEASED = {"law": "rupture", "dam_height": 40, "dam_base": 30, "E": 1e10, "sigma_max": 0}


@pytest.mark.parametrize("uplift", further(1, ["imposed", "flow"]))
@pytest.mark.parametrize("n_joint", [60, pytest.param(100, marks=pytest.mark.heavy)])
def test_a_joint_without_tensile_strength_opens_in_one_step(solve, uplift, n_joint):
    """Some points are in equilibrium neither closed nor open, but within the shear release."""
    (result,) = solve("dam", "40", **RELEASED, uplift=uplift, n_joint=n_joint)
    assert verdict(result) == "stands"
    assert result.history["iterations"].sum() < 60
    assert 3e-6 < result.history["max_opening"][-1] < 6e-6


@pytest.mark.heavy
def test_short_shear_release_on_a_soft_dam(solve):
    """SSNP142's brittle joint (L_CT = 1e-10 m) opened by 4e-4 m; by another solver 4.142e-4 m."""
    (result,) = solve("ssnp142", "40", dam_height=40, dam_base=30, E=1e10, h_found=7)
    assert verdict(result) == "stands"
    assert result.history["max_opening"][-1] == pytest.approx(4.142e-4, rel=2e-3)


@pytest.mark.parametrize("overrides", [{"K_T": 9e14, "mu": 0.06}, {"K_T": 9e14, "mu": 0.04}])
def test_stiff_friction_without_hardening(solve, overrides):
    """With the tangent the whole joint alternates between slip forward and backward."""
    (result,) = solve("ssnp142", "1.5", law="friction", pena_tang=0, **overrides)
    assert not result.stopped and result.last["level"] == 1.5


#: A random dam of the verification: sawn by 90 um while its contact is compressed by 1 nm.
SAWN = {"dam_height": 8.54, "dam_base": 7.34, "dam_crest": 0.716, "E": 3.22e12, "nu": 0.0523}
SAWN |= {"law": "rupture", "K_N": 1.01e14, "K_T": 4.96e13, "sigma_max": 0.0, "alpha": 1}
SAWN |= {"pena_rupture": 1.86, "saw_thickness": 9.23e-5, "saw_t": 2, "n_joint": 40, "order": 1}


@pytest.mark.parametrize("steps", [1, 2, 3, 8])
def test_a_sawn_joint_closes_in_any_number_of_steps(solve, steps):
    """It was "not converged" with 1 to 4 and with 20 steps: the whole joint was open at first."""
    (result,) = solve("dam", "4.94,9.29", **SAWN, tail_levels="1.47", steps=steps)
    assert not result.stopped
    assert not result.history["cuts"].any()
    closure = result.joint["delta_n"][-41:]
    assert closure.min() == pytest.approx(-9.23e-5, rel=1e-3)


def test_secant_of_friction_is_stress_over_jump():
    law = load("ssnp142", {"law": "friction", "K_T": 9e14}).law
    rng = np.random.default_rng(1)
    jump = rng.normal(0, [1e-8, 2e-11, 2e-11], (200, 3)) - [5e-8, 0, 0]
    variables = FrictionVariables(np.zeros(200), rng.normal(0, 2e-11, (200, 2)), np.zeros(200))
    traction, _ = law.traction_and_tangent(jump, variables)
    secant = law.secant_stiffness(jump, variables)
    slid = law.trial(jump, variables).slip > 0
    assert 0 < slid.sum() < 200
    np.testing.assert_allclose(
        np.einsum("qij,qj->qi", secant, jump - np.pad(variables.plastic, ((0, 0), (1, 0)))),
        traction,
        rtol=1e-9,
    )
    assert np.all(np.diagonal(secant, axis1=1, axis2=2) > 0)


def test_the_line_of_the_shear_release_is_the_law_within_it_and_extended_outside():
    law = load("ssnp142", {"sigma_max": 0}).law
    variables = law.initial(3)
    jump = np.array([[0.25, 1e6, 0], [-3.0, 1e6, 0], [5.0, 1e6, 0]]) * law.L_CT
    line, tangent_of = law.evaluate(jump, variables, np.ones(3, bool))
    np.testing.assert_allclose(line[:, 1], law.K_T * np.array([0.75, 4, -4]) * 1e6 * law.L_CT)
    np.testing.assert_allclose(tangent_of()[:, 1, 0], -law.K_T * 1e6)
    assert law.release_side(jump, variables).tolist() == [0, -1, 1]
    np.testing.assert_array_equal(line[0], law.traction_and_tangent(jump, variables)[0][0])


def test_if_the_first_step_fails_the_weight_is_applied_first(monkeypatch):
    """The weight alone gives no row; its cut of the step is counted."""
    direct_step, weigh, order = LoadStepper.direct_step, LoadStepper.weigh, []

    def failing_once(self, time, smallest):
        order.append("step")
        return direct_step(self, time, smallest) if len(order) > 1 else None

    def weighing(self):
        order.append("weight")
        return weigh(self)

    monkeypatch.setattr(LoadStepper, "direct_step", failing_once)
    monkeypatch.setattr(LoadStepper, "weigh", weighing)
    stepper = LoadStepper(load("dam", {"n_joint": 10, "weight_first": 0}, "30,40"))
    stepper.run()
    result = stepper.results()
    assert verdict(result) == "stands" and order == ["step", "weight", "step", "step"]
    assert result.history["time"].tolist() == [1, 2] and result.history["cuts"].tolist() == [1, 0]


def test_the_last_level_is_exact_to_the_smallest_step(solve):
    """T = mu N + c L at 7.45784 m dry; between levels 6 and 8 m 1/1024 of a step is 2 mm."""
    (result,) = solve("c", "3,6,8,9", uplift="none", pena_tang=0)
    assert 7.45784 - 2 / 1024 < result.last["level"] < 7.4579


@pytest.mark.heavy
def test_a_dam_that_overturns_is_given_up_soon(solve, tmp_path):
    """The reference GetDP model ends strategies that diverge: 530 corrections, and 1980 where each
    takes all of its iterations. Its last level is that of the condensed engine.
    """
    settings = {"n_joint": 20, "h_dam": 2, "h_found": 4}
    case, solved = load("a", settings, "15"), []
    mesh_of(case).write(tmp_path / "scene.msh")
    process.Runner().execute(
        process.write_problem(case, None, tmp_path, {"views": 0.0}),
        ["-msh", "scene.msh", "-solve", "Fill"],
        on_line=lambda line: "Solve[Equilibrium]" in line and solved.append(line),
    )
    assert (tmp_path / "status.txt").read_text() == "1\n"
    *_, last = (tmp_path / "history.txt").read_text().splitlines()
    expected = solve("a", "15", **settings)[0].last["level"]
    assert float(last.split()[2]) == pytest.approx(expected, abs=15 / 1024)
    assert 0 < len(solved) < 1000


@pytest.mark.parametrize("law", ["rupture", "friction"])
@pytest.mark.parametrize("order, dim", [(2, 2), (1, 3)])
def test_contact_stress_of_a_stiff_joint_does_not_oscillate(solve, law, order, dim):
    """Its largest value is close to that of a joint a hundred times softer. The published
    integration points are too few: they miss some modes of the jump.
    """
    shape = {"n_joint": 20, "h_dam": 12, "h_found": 40, "E": 2e10, "dim": dim, "order": order}
    if dim == 3:
        shape |= {"mesh_pattern": "split", "thickness": 4, "hold_z": 1}

    def largest(K_N, quadrature):
        stiffness = {"K_N": K_N, "K_T": K_N / 2, "law": law, "quadrature": quadrature}
        (result,) = solve("dam", "40", **shape, **stiffness)
        rows = result.at()
        return -(rows["sigma_n"] + rows["p"]).min()

    smooth = largest(1e11, "full")
    assert largest(1e13, "full") < 1.5 * smooth < 2.5 * smooth < largest(1e13, "published")


@pytest.mark.heavy
def test_unstable_crack_growth_ends_in_equilibrium(solve):
    """Brittle, stiff, on soft rock, with water in the crack."""
    bulk = {"dam_height": 120, "dam_base": 98, "dam_crest": 18.6, "neck_height": 15.3, "nu": 0.208}
    bulk |= {"E": 7.56e11, "E_found": 2.35e9, "found_side": 120, "found_depth": 120, "order": 1}
    joint = {"K_N": 1.02e14, "K_T": 1.97e13, "sigma_max": 4810, "pena_rupture": 240, "alpha": 1.5}
    joint |= {"joint_slope": 0.746, "ice_force": 588000, "uplift": "cracked", "n_joint": 20}
    (result,) = solve("dam", "89.2,126", steps=2, **bulk, **joint)
    assert verdict(result) == "stands" and result.last["level"] == 126


@pytest.mark.parametrize(
    "rest, ceiling, criterion",
    [(0.0, 1.0, "tolerance"), (1e-6, 1.0, "round-off"), (1e-6, 1e-7, ""), (1e-3, 1.0, "")],
)
def test_the_criterion_by_which_a_solution_ends(rest, ceiling, criterion):
    """A spring of 1e12 N/m to 0.1 m with a residual [N] below the last bit of the jump, 1e-5 N."""

    def evaluate(jump, level, last, most=np.inf):
        residual = 1e12 * (jump - 0.1)
        correction = lambda _secant: (-residual / 1e12, 0.0)
        return Iterate(jump, level, residual + rest, float(abs(residual + rest)[0]), correction)

    start = evaluate(np.zeros(1), 0.0, None)
    convergence = Convergence(1e11, 1e-9, ceiling, 5.0, 10.0)
    strategy = Strategy(3.0, 0, 0, 20, 4)
    if criterion:
        assert newton(evaluate, start, convergence, strategy)[2] == criterion
    else:
        message = f"the iterates repeat, with a residual of {rest / 1e11:.2g} of the loads"
        with pytest.raises(NotConverged, match=message):
            newton(evaluate, start, convergence, strategy)


@pytest.mark.parametrize(
    ("factor", "message"),
    [
        (0.5, "after 20 iterations the residual is 9.5e-07 of the loads"),
        (1e-9, "the residual stagnates at 1 of the loads"),
        (-2.0, "a displacement jump exceeds 10 m"),
        (np.nan, "the residual is not a finite number"),
    ],
)
def test_how_a_solution_ends_that_does_not_converge(factor, message):
    """A spring whose corrections are a part of what is missing, or in the wrong direction."""

    def evaluate(jump, level, last, most=np.inf):
        residual = 1e12 * (jump - 0.1)
        size = float(abs(residual)[0])
        return Iterate(jump, level, residual, size, lambda _: (-factor * residual / 1e12, 0.0))

    start = evaluate(np.zeros(1), 0.0, None)
    convergence = Convergence(1e11, 1e-9, 1.0, 5.0, 10.0)
    with pytest.raises(NotConverged, match=message):
        newton(evaluate, start, convergence, Strategy(1e30, 0, 0, 20, 4))


@pytest.mark.parametrize(
    ("residuals", "message"),
    [
        # a cycle of two iterations, up to less than a thousandth
        ([9, 3, 2, 4, 2.001, 4.001, 1, 0], "the iterates repeat, with a residual of 4 of"),
        # nothing smaller than the 2 for five iterations
        ([9, 3, 2, 4, 3.5, 5, 8, 7, 1, 0], "5 iterations have not reduced the residual, 7 of the"),
        ([9, 3, 2, 4, 3.5, 5, 8, 1, 0], ""),
    ],
)
def test_a_solution_that_does_not_come_nearer_is_given_up(residuals, message):
    """Residuals in the order of the iterations, over the loads."""
    sizes = iter(map(float, residuals))

    def evaluate(jump, level, last, most=np.inf):
        size = next(sizes)
        return Iterate(jump, level, np.array([size]), size, lambda _: (np.ones(1), 0.0))

    start = evaluate(np.zeros(1), 0.0, None)
    convergence, strategy = Convergence(1.0, 1e-9, 0.0, 5.0, 1e3), Strategy(1e30, 0, 0, 20, 4, 5)
    if not message:
        assert newton(evaluate, start, convergence, strategy)[1] == len(residuals) - 1
        return
    with pytest.raises(NotConverged, match=message):
        newton(evaluate, start, convergence, strategy)


def test_a_strategy_that_has_not_helped_three_times_is_kept_for_the_smallest_step(monkeypatch):
    """None converges: the step is cut to a quarter, and to a quarter, and so on, to 1/1024."""
    tried = []

    def solve_from(problem, loading, begin, convergence, constraint):
        tried.append((begin.strategy, begin.level))
        raise NotConverged("given up")

    monkeypatch.setattr("damjoint.solver.step.solve_from", solve_from)
    monkeypatch.setattr("damjoint.solver.load_stepper.over_unstable_growth", lambda *_: (None, 0))
    stepper = LoadStepper(load("dam", {"n_joint": 5, "law": "rupture"}, "30"))
    stepper.run()
    for strategy in stepper.model.strategies[1:-1]:
        levels = [level for way, level in tried if way == strategy and level > 0]
        assert levels[:4] == [30, 30 / 4, 30 / 16, 30 / 1024]


def test_a_run_that_would_stop_relaxes_in_steps_that_are_longer_than_the_smallest(monkeypatch):
    """One of 8/1024 leads on, and those of 1/1024 to 4/1024 do not."""
    stepper, times = LoadStepper(load("dam", {"n_joint": 5, "law": "rupture"}, "30,40")), []
    for _ in stepper.steps_to(1):
        pass
    reached = stepper.model.advance(stepper.state, 1 + 8 / 1024, LevelControl(30 + 80 / 1024))

    def over_unstable_growth(model, begin, time, *_):
        times.append((time - 1) * 1024)
        return (reached, True) if times[-1] == 8 else (None, False)

    growth = "damjoint.solver.load_stepper.over_unstable_growth"
    monkeypatch.setattr(growth, over_unstable_growth)
    monkeypatch.setattr(Model, "advance", lambda *_: None)
    next(stepper.steps_to(2))
    assert times == [1024, 256, 64, 16, 4, 1, 2, 4, 8]
    assert stepper.state.time == 1 + 8 / 1024 and not stepper.stopped
    assert stepper.relaxed_at == (reached.state.loading.level,)


def test_a_run_that_stops_says_how_its_last_solution_ended(solve):
    """A dam that overturns, on a joint whose equilibrium path is not followed."""
    overturns = {"uplift": "none", "rho_dam": 1200, "K_N": 1e13, "K_T": 1e13}
    (result,) = solve("i", "5,10", **overturns)
    assert result.info["end_of_solution"] == "a displacement jump exceeds 1 m"
    (result,) = solve("i", "5", **overturns)
    assert "end_of_solution" not in result.info


def test_steps_that_converge_by_round_off_are_listed(solve):
    """At 9 m all of the joint has slid by centimetres, which only a soft hardening ends; at 3 and
    6 m it holds. The times are in run.json.
    """
    (result,) = solve("c", "3,6,9", pena_tang=1e6)
    assert result.last["slip_length"] == pytest.approx(5)
    assert result.info["converged_by_round_off"] == [3]
    (result,) = solve("c", "3,6,9")
    assert "converged_by_round_off" not in result.info
