"""Changes of temperature: closed forms of free expansion and bending in both engines, time, what
they must not change."""

import shutil
import subprocess
import sys

import damjoint as dj
import gmsh
import numpy as np
import pytest
from damjoint import InputError, data
from damjoint.engines.getdp.process import find_getdp
from damjoint.fem.cache import bodies_key
from damjoint.input.parameters import start_gmsh
from damjoint.input.resolve import load
from damjoint.model.loads import Loading
from numpy.testing import assert_allclose

#: A weightless wall, 2 m thick and 20 m high, free to slide on its base.
WALL = {"dam_base": 2, "dam_crest": 2, "dam_height": 20, "n_joint": 8, "h_dam": 1, "h_found": 20}
WALL |= {"E": 2e10, "nu": 0.2, "rho_dam": 0, "law": "rupture", "K_T": 1e3, "uplift": "none"}
SOLID = {"dim": 3, "thickness": 1, "mesh_pattern": "split", "n_joint": 4}
#: The 45 m dam on a coarse mesh.
DAM = {"n_joint": 20, "h_dam": 8, "h_found": 30}
WARM = {"temperature_dam": -8.0, "temperature_linear": 15.0, "temperature_found": 3.0}


@pytest.mark.heavy
@pytest.mark.parametrize(
    "engine, solid",
    [
        ("condensed", False),
        ("condensed", True),
        ("getdp", False),
        ("getdp", True),
    ],
)
def test_a_free_wall_expands_and_bends_without_stress(engine, solid):
    """Uniform 10 K: the upstream edge moves by alpha T b/2 from the middle of the base. 10 K warmer
    downstream than upstream: the curvature is alpha T/b, in 3D of the horizontal sections, too.
    In plane strain both times 1 + nu, and sigma_zz is prevented.
    """
    settings = WALL | (SOLID if solid else {})
    alpha, b, h, w = 1e-5, 2, 20, 1 if solid else 0
    free = 1 if solid else 1.2
    for warm, moved in (
        ({"temperature_dam": 10.0}, -free * alpha * 10 * b / 2),
        ({"temperature_linear": 10.0}, free * alpha * 10 / b * (b**2 / 12 - h**2 / 2 - w**2 / 12)),
    ):
        run = dj.run(dj.case("dam", levels=[0], **settings, **warm), engine=engine)
        assert run.history.crest_ux[-1] == pytest.approx(moved, rel=1e-6)
        assert np.abs(run.joint.sigma_n).max() < 10 and np.abs(run.joint.tau_1).max() < 10
        (field,) = run.solution.fields.values()
        stress, x = field.stress["dam"], run.solution.bodies["dam"].middles()[:, 0]
        change = warm.get("temperature_dam", 0) + warm.get("temperature_linear", 0) * (x / b - 0.5)
        prevented = np.zeros_like(stress)
        prevented[:, 2] = 0 if solid else -2e10 * alpha * change
        assert_allclose(stress, prevented, atol=50)  # of prevented 2 MPa


@pytest.mark.parametrize("engine", ["condensed", "getdp"])
def test_warm_rock_without_lateral_contraction_is_pressed_by_its_fixed_ends(engine):
    """nu = 0, inside: the surface rises by alpha T depth, and sigma_xx = sigma_zz = -E alpha T."""
    rock = {"found_depth": 5, "found_side": 50, "nu": 0, "temperature_found": 10, "h_found": 2}
    run = dj.run(dj.case("dam", levels=[0], **WALL | rock), engine=engine)
    (field,), body = run.solution.fields.values(), run.solution.bodies["foundation"]
    stress = field.stress["foundation"][np.abs(body.middles()[:, 0]) < 10]
    expected = np.zeros_like(stress)
    expected[:, [0, 2]] = -2e10 * 1e-5 * 10
    assert_allclose(stress, expected, atol=100)  # of 2 MPa
    surface = np.isclose(body.points[:, 1], 0) & (np.abs(body.points[:, 0]) < 10)
    moved = field.displacement["foundation"][surface, 1]
    assert moved == pytest.approx(1e-5 * 10 * 5, rel=1e-4)


def test_the_temperature_causes_no_resultants():
    """It is in equilibrium with itself: N, T, M are those of statics."""
    settings = DAM | {"levels": [30, 44], "joint_slope": 3, "batter": 4, "law": "friction"}
    cold, warm = (dj.run(dj.case("dam", **settings, **w)).history for w in ({}, WARM))
    for name in ("N", "T", "M"):
        assert_allclose(warm[name], cold[name], rtol=1e-7)
    assert abs(warm.crest_ux[-1] - cold.crest_ux[-1]) > 1e-3


@pytest.mark.parametrize("period, parts", [(0, [0, 0.5, 1, 1, 1, 1]), (4, [0, 0.5, 1, 0, -1, 1])])
def test_the_change_grows_over_a_unit_of_time_and_then_follows_a_cosine(period, parts):
    case = load("dam", WARM | {"temperature_t": 2.0, "temperature_period": float(period)})
    times = 1, 1.5, 2, 3, 4, 6
    found = [Loading.at(case, t, 0, 0).part("temperature") for t in times]
    assert_allclose(found, parts, atol=1e-15)
    assert Loading.at(case, 3.5, 0, 0).part("quake") == 1


@pytest.mark.heavy
@pytest.mark.parametrize("engine", ["condensed", "getdp"])
def test_summer_and_winter_move_an_elastic_dam_by_opposite_amounts(engine):
    """The joint stays closed under the weight; in spring there is no movement."""
    year = {"temperature_period": 4, "law": "rupture", "sigma_max": 1e9, "G_f": 1e9, **WARM}
    run = dj.run(dj.case("dam", levels=[0] * 4, **DAM, **year), engine=engine)
    crest = run.history.crest_ux
    assert abs(crest[0]) > 1e-3
    assert_allclose(crest, crest[0] * np.array([1, 0, -1, 0]), atol=1e-8 * abs(crest[0]))


def test_without_a_change_of_temperature_the_bodies_are_the_same():
    plain = bodies_key(load("dam"))
    assert bodies_key(load("dam", {"expansion_dam": 2e-5, "temperature_period": 3.0})) == plain
    assert bodies_key(load("dam", {"temperature_found": 1.0, "expansion_found": 0.0})) == plain
    assert bodies_key(load("dam", {"temperature_found": 1.0})) != plain
    cool, warm = (load("dam", {"temperature_dam": t}) for t in (-1.0, 9.0))
    assert bodies_key(cool) == bodies_key(warm)


def test_slip_in_opposite_directions_is_no_sliding():
    """A contraction lets every point of the joint slip; the dam slides only if the shear force
    reaches the strength."""
    case = {"law": "friction", "temperature_dam": -20, "temperature_t": 1, **DAM}
    stands = dj.run(dj.case("dam", levels=[45], mu=0.8, adhesion=0.0, **case))
    slides = dj.run(dj.case("dam", levels=[45], mu=0.5, adhesion=0.0, **case))
    slipped = stands.history.slip_length[-1]
    assert slipped == pytest.approx(34) and stands.verdict == "stands"
    assert slides.verdict == "sliding"


@pytest.mark.heavy
def test_an_own_geometry_has_a_uniform_temperature_only():
    water = {"levels": [10], "tail_levels": 4}
    cold, warm = (dj.run(dj.case("stepped", temperature_dam=t, **water)) for t in (-5, 5))
    assert cold.history.crest_ux[-1] > 0 > warm.history.crest_ux[-1]
    with pytest.raises(InputError, match="temperature_linear = 5: must be 0"):
        dj.case("stepped", temperature_linear=5)


@pytest.mark.heavy
def test_the_view_of_the_stress_in_gmsh_is_without_the_free_strain(tmp_path):
    """The plain problem definition, with a case that has units."""
    for name in ("geo", "pro", "cases"):
        shutil.copytree(data(name), tmp_path / name, ignore=shutil.ignore_patterns("res"))
    cases, units = tmp_path / "cases", {"E": "20*GPa", "K_T": "1*kPa/m", "temperature_dam": "10*K"}
    lines = [f"default_{n} = {units.get(n, repr(v))};" for n, v in (WALL | units).items()]
    text = "\n".join(lines).replace("'", '"') + "\nlevels() = {0};\n"
    (cases / "dam.case").write_text(text)
    mesh = [sys.executable, "-c", "import gmsh, sys; gmsh.initialize(sys.argv, run=True)"]
    run = [find_getdp(), "cases/dam.pro", "-msh", "dam.msh", "-solve", "Fill", "-v", "1"]
    for words in ([*mesh, "-2", "cases/dam.geo", "-o", "dam.msh", "-v", "1"], run):
        subprocess.run(words, cwd=tmp_path, check=True)
    start_gmsh()
    gmsh.merge(str(cases / "res/dam/stress_1.pos"))
    (kind,), _, (values,) = gmsh.view.getListData(gmsh.view.getTags()[-1])
    gmsh.view.remove(gmsh.view.getTags()[-1])
    triangles = values.reshape(-1, 9 + 27)
    centre, stress = triangles[:, :9].reshape(-1, 3, 3).mean(axis=2), triangles[:, 9:18]
    dam = stress[centre[:, 1] > 0]
    assert kind == "TT"
    assert_allclose(dam[:, [0, 4, 8]], np.tile([0, 0, -2e6], (len(dam), 1)), atol=100)
