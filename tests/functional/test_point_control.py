"""A point's displacement prescribed, and the factor of a load unknown."""

import numpy as np
import pytest
from damjoint import InputError, runner
from damjoint.input.resolve import load
from damjoint.mesh.mesh import mesh_of
from damjoint.post import summary
from damjoint.solver.load_stepper import LoadStepper
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


def test_dissipation_control_prescribes_the_energy_of_the_joints():
    """SSNP133: once the right ligament has broken, while the left one bears little, the energy is
    G_f times its length, with the known part of the work; before, the point has moved back.
    """
    stepper = LoadStepper(load("ssnp133", {}, steps=50))
    case, history = stepper.case, stepper.history
    for _ in stepper.steps():
        if history.last["broken_length_2"] > 349:
            break
    shift = case.shared["dissipation_shift"][0]
    swept = case["drive_energy"] * stepper.state.time
    energy = swept - shift / 2 * stepper.controlled_displacement()
    assert energy == pytest.approx(100 * 350, rel=0.02)
    moved = np.array(history.rows["point_u"])
    assert moved[-1] < 0.5 * moved.max()


@pytest.mark.heavy
def test_both_engines_follow_two_snap_backs(tmp_path):
    """SSNP133, by 40 steps."""
    options = {"fields": False, "picture": False, "progress": False}
    results = [
        runner.run(load("ssnp133", {}, steps=40), tmp_path / name, engine=name, **options)[0]
        for name in ("condensed", "getdp")
    ]
    for name in ("load_factor", "point_u"):
        one, other = (result.history[name] for result in results)
        assert_allclose(one, other, rtol=0, atol=1e-6 * np.abs(one).max())
    assert "moves to and fro: snap-back" in path_statement(results[0])


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
        ({"drive": "dissipation"}, "drive_load = level: must be force or traction.*proportional"),
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
