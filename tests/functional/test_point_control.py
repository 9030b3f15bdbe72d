"""A point's displacement prescribed, and the factor of a load unknown."""

from dataclasses import replace

import numpy as np
import pytest
from damjoint import InputError, runner
from damjoint.input.resolve import load
from damjoint.mesh.mesh import mesh_of
from damjoint.model.loads import COMPLETE
from damjoint.post import summary
from damjoint.solver.controls import BodyControl, Prescribed
from damjoint.solver.load_stepper import LoadStepper
from damjoint.solver.model import Model
from damjoint.statics.statement import path_statement
from damjoint.verification import path_tests
from numpy.testing import assert_allclose
from test_engines import agree

POINT = {"drive": "point", "n_joint": 20.0, "uplift": "none"}
#: Loads with an unknown factor: the value of the full load, and what the displacement grows by.
LOADS = {
    "force": ({"force_x": 1e6, "force_y": -2e5}, 2e-3),
    "quake": ({"k_h": 0.1, "k_v": 0.02}, 2e-3),
    "level": ({}, 4e-3),
}


def same_columns(one, other, reach=1e-7):
    """The last rows agree to a part of the largest of their kind."""
    for names in ("crest_ux", "max_opening"), ("N", "T"), ("level",), ("M",):
        scale = max(abs(other.last[name]) for name in names)
        for name in names:
            assert one.last[name] == pytest.approx(other.last[name], abs=reach * scale), name


def test_the_crest_as_a_point_is_the_crest(solve):
    """Its upstream end, along x, the level unknown."""
    by = {"drive_by": 4e-3, "n_joint": 20.0, "uplift": "none"}
    (crest,) = solve("dam", "30,40", drive="crest", **by)
    (point,) = solve("dam", "30,40", drive="point", drive_face="crest", **by)
    same_columns(point, crest, 1e-10)
    assert point.history["point_u"] == pytest.approx(point.history["crest_ux"], rel=1e-10)


def test_the_last_digits_of_a_displacement_are_not_missing():
    """Over stiff joints they weigh more than the tolerance, and no iteration reduces them."""
    model = Model(load("dam", {"n_joint": 10.0}))
    loading, jump = COMPLETE, np.full(len(model.equilibrium.bulk.stiffness), 1e-4)
    moved = BodyControl(0.0).measure(model.equilibrium, jump, loading)
    for off, missing in ((0.0, 0), (1e-16, 0), (6e-16, 0), (1e-14, 1), (1e-6, 1)):
        gap = Prescribed(BodyControl(moved * (1 + off)), model.equilibrium).gap(jump, loading)
        assert gap == pytest.approx(missing * off * moved, rel=0.1, abs=0)


@pytest.mark.parametrize("of", LOADS)
@pytest.mark.parametrize("dim", [2, pytest.param(3, marks=pytest.mark.heavy)])
def test_the_unknown_load_leads_to_the_prescribed_displacement(solve, of, dim):
    """The load of the factor that was computed, prescribed, leads to the same state."""
    full, by = LOADS[of]
    # the downstream end of the crest: a node without a controlled point, too
    at = {"drive_face": "downstream", "drive_at": 45.0, "drive_direction": "x", "drive_by": by}
    solid = {"dim": 3.0, "thickness": 5.0, "n_layers": 1.0, "n_joint": 8.0} if dim == 3 else {}
    settings = POINT | {"sigma_max": 1e4} | solid | full
    (driven,) = solve("dam", "30,30", drive_load=of, **settings | at)
    assert not driven.stopped
    moved = driven.history["point_u"]
    begun = moved[np.flatnonzero(driven.history["time"] <= 1)[-1]]
    assert moved[-1] - begun == pytest.approx(by, rel=1e-9)
    factor = driven.last["load_factor"]
    level = driven.last["level"] if of == "level" else 30
    known = settings | {name: factor * value for name, value in full.items()} | {"drive": "level"}
    (given,) = solve("dam", f"30,{level!r}", **known)
    same_columns(driven, given)
    shown = summary.levels_table(driven)
    assert ("point movement" in shown.names, f"{of} factor" in shown.names) == (True, of != "level")
    if of != "level":
        assert f"{factor:.4g}" == shown.rows[-1][0]
    assert driven.last["crack_length"] == pytest.approx(given.last["crack_length"])


@pytest.mark.heavy
@pytest.mark.parametrize(
    "of, case, settings",
    [
        ("force", "dam", {"drive_at": 30.0}),
        # the concrete below the lift is part of the foundation's body; water moves with the face
        ("quake", "lifts", {"drive_at": 30.0, "n_joint": 10.0, "order": 1.0, "drive_by": 8e-3}),
    ],
)
def test_both_engines_agree_on_a_factor(tmp_path, of, case, settings):
    """A load that grows until the joint breaks, then falls."""
    settings = POINT | LOADS[of][0] | {"drive_load": of, "drive_by": 2e-3} | settings
    agree(load(case, settings, "30,30"), tmp_path)
    factors = [
        np.genfromtxt(file, delimiter=",", names=True)["load_factor"]
        for file in sorted(tmp_path.glob("*/history.csv"))
    ]
    assert_allclose(*factors, rtol=1e-6)


@pytest.mark.heavy
def test_dissipation_control_prescribes_the_energy_of_the_joints():
    """SSNP133, once the right ligament has broken: the areas below the curves of all points, less
    the triangles of unloading to the origin; before, the point has moved back.
    """
    stepper = LoadStepper(load("ssnp133", {}, steps=50))
    case, history, law = stepper.case, stepper.history, stepper.case.law
    for _ in stepper.steps():
        if history.last["broken_length_2"] > 349:
            break
    kappa = np.concatenate([v.kappa for v in stepper.state.variables.joints]).clip(max=law.L_C)
    elastic, strength = law.delta_e, law.tensile_strength
    left = strength * (law.L_C - kappa) / (law.L_C - elastic)
    dissipated = strength * elastic + (strength + left) * (kappa - elastic) - left * kappa
    joints = stepper.model.equilibrium.interface
    shift = case.shared["dissipation_shift"][0]
    swept = case["drive_energy"] * (stepper.state.time - shift * history.last["load_factor"])
    assert swept == pytest.approx(joints.weights @ dissipated / 2, rel=0.01)
    moved = np.array(history.rows["point_u"])
    assert moved[-2] < 0.2 * moved[:-1].max()


#: Bond dam whose crest snaps back at its highest level, 48.4725 m.
SNAP_BACK = {
    "n_joint": 20.0,
    "law": "bond",
    "uplift": "flow",
    "sigma_max": 25e3,
    "adhesion": 188e3,
    "mu": 0.91,
    "G_f": 45.5,
    "G_t": 193.2,
    "drive": "dissipation",
    "drive_face": "crest",
    "drive_energy": 3000.0,
}

SOLID = {"dim": 3.0, "thickness": 5.0, "n_layers": 1.0, "order": 1.0, "n_joint": 6.0}
#: A force at the crest that breaks the bond of a solid dam, beyond its largest value.
BY_FORCE = SOLID | {"law": "bond", "sigma_max": 1e5, "adhesion": 2e5, "G_f": 100.0}
BY_FORCE |= {"h_dam": 15.0, "h_found": 60.0, "drive": "dissipation", "drive_energy": 2e3}
BY_FORCE |= {"drive_load": "force", "force_x": 1e6}


def test_dissipation_control_follows_a_level_through_its_snap_back():
    stepper = LoadStepper(load("dam", SNAP_BACK, "47,48", steps=10))
    assert not stepper.run().stopped
    level, crest = (np.array(stepper.history.rows[name]) for name in ("level", "crest_ux"))
    top = level.argmax()
    assert level[top] == pytest.approx(48.4725, abs=1e-3)
    assert level[-1] < level[top] - 0.04
    assert crest[top] < crest.max() and crest[-1] < crest.max() - 4e-5


@pytest.mark.parametrize(
    "law, settings",
    [
        ("bond", {"mu": 1e-9}),  # with friction a point may slip while its pressure is taken off
        ("friction", {"adhesion": 0.0, "mu": 1e-9}),
        ("endo", {}),
        ("rupture", {"alpha": 2.0}),  # without release: its shear by an opening is not conservative
        ("mixed", {}),
    ],
)
def test_dissipated_energy_of_loading_and_unloading(law, settings):
    """From a state with random jumps: back along them nothing is dissipated, and the gradient is
    that of differences.
    """
    by_energy = {"drive": "dissipation", "drive_energy": 1e3, "drive_face": "crest"}
    settings = {"n_joint": 8.0, "uplift": "none", "law": law} | settings
    case = load("dam", settings | by_energy, "20,30")
    stepper, rng = LoadStepper(case), np.random.default_rng(3)
    equilibrium, state = stepper.model.equilibrium, stepper.state
    size = 1e-5
    for _ in range(2):
        move = size * rng.normal(size=len(state.jump))
        begun = stepper.model.begin(state, 1.0)
        state = replace(begun.end(state.jump + move, state.loading), time=state.time + 0.1)
    stepper.state = state
    control = stepper.dissipation(1.0)

    def energy(by):
        return control.measure(equilibrium, state.jump + by * move, state.loading)

    assert abs(energy(-1e-3)) < 1e-6 * energy(1.0)
    here, step = state.jump + 0.3 * move, 1e-6 * size
    ahead, behind = here + step * rng.normal(size=len(here)), here
    change = [control.measure(equilibrium, end, state.loading) for end in (ahead, behind)]
    gradient = control.gradient(equilibrium, (ahead + behind) / 2)
    assert gradient @ (ahead - behind) == pytest.approx(change[0] - change[1], rel=1e-5)


@pytest.mark.heavy
@pytest.mark.parametrize(
    "name, settings, levels, steps",
    [
        ("ssnp133", {}, None, 40),
        ("dam", SNAP_BACK | {"n_joint": 10.0}, "47,48", 8),
        ("dam", SNAP_BACK | {"n_joint": 10.0, "drive_load": "quake", "k_h": 0.1}, "40,40", 5),
        ("dam", BY_FORCE | {"uplift": "cracked"}, "30", 10),
    ],
    ids=["traction", "level", "quake", "force on a solid dam with water in its crack"],
)
def test_both_engines_follow_a_snap_back(tmp_path, name, settings, levels, steps):
    options = {"fields": False, "picture": False, "progress": False}
    case = load(name, settings, levels, steps=steps)
    results = [
        runner.run(case, tmp_path / engine, engine=engine, **options)[0]
        for engine in ("condensed", "getdp")
    ]
    for name in ("load_factor", "point_u"):
        one, other = (result.history[name] for result in results)
        assert_allclose(one, other, rtol=0, atol=1e-6 * np.abs(one).max())
    if name == "ssnp133":
        assert "moves to and fro: snap-back" in path_statement(results[0])
    if case["drive_load"] == "force":
        factor = results[0].history["load_factor"]
        assert factor[-1] < 0.9 * factor.max() and results[0].last["crack_length"] > 0


@pytest.mark.heavy
def test_the_path_of_the_plate_converges():
    """SSNP133 on finer meshes, of both orders: to 5 % from the points of the coarse published one,
    of which this package's mesh of as many elements has the first two.
    """
    paths = []
    for settings in ({"n_joint": 40.0}, {"n_joint": 20.0, "order": 2.0}):
        path = runner.compute(load("ssnp133", settings), fields=False).result.history
        paths.append(path_tests.read(path_tests.ssnp133()["A"], path))
    assert_allclose(paths[0], paths[1], rtol=5e-3)
    published = np.array([1.15791783e-3, 5.20165353e-3, 7.72441193e-3])
    assert (np.sign(paths[1] / published - 1) == [1, 1, -1]).all()


@pytest.mark.parametrize(
    "settings, message",
    [
        ({"drive_at": 50.0}, "drive_at = 50: must lie on the upstream face"),
        ({"drive_load": "force"}, "drive_load = force: must be level, or force_x or force_y not 0"),
        ({"drive_load": "quake", "k_h": 0.1, "drive_end": 1.5}, "drive_end = 1.5: must be 2"),
        ({"drive_load": "ice"}, "drive_load"),
        ({"drive_direction": "z"}, "drive_direction"),
        ({"traction_y": 1e4}, "traction_y = 10000: must be 0 but with a geometry of one's own"),
        (
            {"drive": "dissipation", "drive_load": "force", "force_x": 1.0},
            "drive_energy = 0: must be > 0",
        ),
    ],
)
def test_bad_controls(settings, message):
    with pytest.raises(InputError, match=message):
        load("dam", POINT | settings, "30,40")


def test_an_own_geometry_needs_the_point():
    case = load("ssnp143", {"drive": "point"})
    with pytest.raises(InputError, match="drive = point: must be another one, or geometry"):
        mesh_of(case)
