"""Uncondensed bodies, solved iteratively, against condensed ones: one equation, two ways."""

import numpy as np
import pytest
from damjoint import InputError, RunError, library
from damjoint.engines.condensed.solve import solve
from damjoint.fem import memory, uncondensed
from damjoint.fem.bodies import Bodies
from damjoint.fem.condensation import condense
from damjoint.fem.uncondensed import uncondensed as keep
from damjoint.input.resolve import load
from damjoint.joint import iterative_system
from damjoint.joint.interface import Interface
from damjoint.joint.iterative_system import gmres
from damjoint.solver.load_stepper import LoadStepper
from damjoint.solver.path_point import PRECISION
from damjoint.studies import quake_study
from numpy.testing import assert_allclose

#: A dam of 15 m along z, of 7 000 unknowns.
SOLID = {"dim": 3.0, "n_joint": 8.0, "n_layers": 3.0, "h_dam": 8.0, "h_found": 25.0}
SOLID |= {"thickness": 15.0}
#: What makes its joint open, slip and soften up to its highest level.
WEAK = {
    "bond": {"law": "bond", "sigma_max": 1e5, "G_f": 50.0, "mu": 0.7},
    "friction": {"law": "friction", "mu": 0.75, "adhesion": 1e5},
    "rupture": {"law": "rupture", "sigma_max": 1e5},
    "endo": {"law": "endo", "sigma_max": 1e5, "G_f": 50.0, "adhesion": 1e5},
}
#: Columns that count the solution's work, or measure its error.
OF_SOLUTION = {"iterations", "cuts", "residual"}


@pytest.fixture(scope="module")
def both():
    """The bodies of SOLID, condensed and not."""
    case = load("dam", SOLID)
    bodies = Bodies.of(case)
    return [make(case, bodies) for make in (condense, keep)]


def histories(bulks, case):
    """The results of a case with each of two bulks."""
    return [
        LoadStepper(case, Interface(bulk, case["quadrature"], case["face_points"])).run()
        for bulk in bulks
    ]


def assert_same(one, other):
    """Compare results to 1e-6 of the largest value of each column (of forces: of all forces)."""
    assert len(one.history["level"]) == len(other.history["level"])
    force = max(np.abs(one.history[name]).max() for name in "NT")
    for name, expected in one.history.items():
        if name not in OF_SOLUTION:
            scale = force if name in ("N", "T", "T_z") else np.nanmax(np.abs(expected))
            assert_allclose(other.history[name], expected, rtol=0, atol=1e-6 * scale, err_msg=name)


@pytest.mark.heavy
@pytest.mark.parametrize(
    "law, uplift",
    [
        ("friction", "imposed"),
        *(
            (law, uplift)
            for law in WEAK
            for uplift in ("none", "imposed", "cracked", "flow")
            if (law, uplift) != ("friction", "imposed")
        ),
    ],
)
def test_results_of_condensed_bodies(both, law, uplift):
    one, other = histories(both, load("dam", SOLID | WEAK[law] | {"uplift": uplift}, "25,35,40"))
    assert not one.stopped
    assert_same(one, other)


@pytest.mark.heavy
def test_a_mechanism_stops_at_the_same_level():
    """The limit point of an equilibrium path has the path's precision."""
    settings = SOLID | WEAK["bond"] | {"uplift": "imposed", "mu": 0.4, "adhesion": 6e4}
    coarse = {"order": 1.0, "n_joint": 5.0, "n_layers": 2.0, "h_dam": 12.0, "h_found": 40.0}
    case = load("dam", settings | coarse, "20,30,40,45")
    bodies = Bodies.of(case)
    one, other = histories([make(case, bodies) for make in (condense, keep)], case)
    assert one.stopped and other.stopped
    assert one.info["mechanism"]["mode"] == other.info["mechanism"]["mode"] == "sliding"
    levels = [result.history["level"][-1] for result in (one, other)]
    assert_allclose(levels[1], levels[0], rtol=PRECISION)


@pytest.mark.heavy
@pytest.mark.parametrize(
    "name, settings, levels",
    [
        ("dam", SOLID | WEAK["friction"] | {"order": 2.0, "n_joint": 5.0}, "30,40"),
        ("dam", SOLID | WEAK["friction"] | {"lift_heights": (20.0,), "hold_z": 1.0}, "30,40"),
        # (only up to where sliding on many joints has a single equilibrium)
        ("valley_blocks", {"n_joint": 5.0, "h_dam": 16.0, "h_found": 60.0}, "20,30"),
    ],
)
def test_order_2_lifts_and_joints_that_meet(name, settings, levels):
    case = load(name, settings, levels)
    bodies = Bodies.of(case)
    one, other = histories([make(case, bodies) for make in (condense, keep)], case)
    assert_same(one, other)


@pytest.mark.parametrize("state", ["closed", "half open", "open", "slipping"])
def test_few_iterations_whatever_the_joint_carries(both, state, monkeypatch):
    """Also where the dam is near a mechanism: without stiffness it moves as a rigid body."""
    monkeypatch.setattr(iterative_system, "ACCURACY", 1e-8)
    joints = Interface(both[1], load("dam", SOLID)["quadrature"])
    x = np.concatenate([joint.points.positions[:, 0] for joint in joints.joints])
    tangent = np.tile(np.diag([1e11, 5e10, 5e10]), (len(x), 1, 1))
    tangent[x < {"half open": x.mean(), "open": np.inf}.get(state, -np.inf)] *= 1e-5
    if state == "slipping":  # by friction: unsymmetric
        tangent[:, 1] = [-0.8e11, 1.5e5, 0]
    system = joints.iterative_system
    multigrid, weight = system.multigrid, -both[1].units["dam_y"]
    stiffness = joints.assembly.whole(tangent).scipy()
    matrix = both[1].elastic + stiffness
    cycle = multigrid.cycle_with(stiffness[multigrid.joint][:, multigrid.joint].tocsr())
    solution, iterations = gmres(matrix.dot, weight, cycle)
    assert_allclose(matrix @ solution, weight, rtol=0, atol=2e-8 * np.linalg.norm(weight))
    assert iterations <= 60


@pytest.mark.heavy
def test_bodies_are_free_to_move_as_rigid_ones():
    bodies = Bodies.of(load("dam", SOLID)).without_supports
    for body in bodies.by_name.values():
        motions = uncondensed.rigid_motions(body)
        forces = body.stiffness @ motions
        assert np.abs(forces).max() < 1e-9 * np.abs(body.stiffness.data).max()
        assert np.linalg.matrix_rank(motions) == 6


@pytest.mark.heavy
def test_fields_of_both_ways():
    case = load("dam", SOLID | WEAK["friction"] | {"uplift": "none"}, "40")
    fields = [
        next(solve(case, lambda *_: None, True, engine)).fields()[1.0]
        for engine in ("condensed", "iterative")
    ]
    for of in ("displacement", "stress"):
        one, other = (getattr(field, of) for field in fields)
        for name, expected in one.items():
            scale = np.abs(expected).max()
            assert_allclose(other[name], expected, rtol=0, atol=1e-6 * scale, err_msg=of)


@pytest.mark.heavy
def test_the_choice_follows_size_steps_and_memory(monkeypatch):
    def iterates(steps):
        return memory.iterates(load("dam", SOLID, "40", steps=steps), bodies)

    bodies = Bodies.of(load("dam", SOLID))
    assert not iterates(1)
    monkeypatch.setattr(memory, "ITERATED", 1000)
    assert iterates(1) and not iterates(20)
    monkeypatch.setattr(memory, "available", lambda: 1e6)
    assert iterates(20)


@pytest.mark.heavy
def test_an_iteration_that_stalls_leads_to_condensed_bodies(monkeypatch):
    monkeypatch.setattr(memory, "ITERATED", 1000)
    case = load("dam", SOLID | {"h_found": 26.0}, "40")  # not in the cache
    chosen = lambda: next(solve(case, lambda *_: None, False))
    assert chosen().result.info["engine"] == "iterative"
    monkeypatch.setattr(iterative_system, "MOST_ITERATIONS", 1)
    monkeypatch.setattr(iterative_system, "STALLED", 1e-9)
    outcome = chosen()
    assert outcome.result.info["engine"] == "condensed"
    assert outcome.error is None and len(outcome.result.history["level"]) == 1
    with pytest.raises(RunError, match=r"engine = iterative: .* use engine = condensed"):
        library.run(case, engine="iterative")


def test_bad_input(monkeypatch):
    with pytest.raises(InputError, match=r"engine = iterative: must be .* with dim = 2"):
        library.run(load("a"), engine="iterative")
    with pytest.raises(InputError, match="must be one of auto, condensed, getdp"):
        quake_study.check(load("koyna", {"dim": 3.0}), quake_study.Options("iterative"))
    monkeypatch.setattr(memory, "available", lambda: 1e6)
    with pytest.raises(RunError, match=r"memory: .* unknowns, .* on the joint, need about"):
        library.run(load("dam", SOLID), engine="iterative")


@pytest.mark.parametrize("engine", ["auto", "iterative", "condensed"])
def test_a_model_that_is_too_large_is_refused_before_its_mesh(engine):
    memory.check_size(load("b"), engine)
    case = load("b", {"n_joint": 1000.0, "n_layers": 1000.0})
    with pytest.raises(RunError, match=r"memory: .* 3006003 of them on the joint, need about"):
        memory.check_size(case, engine)
