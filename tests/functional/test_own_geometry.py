"""User geometries: equilibrium by integrals over the mesh, both engines, bad meshes."""

import gmsh
import numpy as np
import pytest
from damjoint import InputError, runner
from damjoint.input.parameters import empty_gmsh
from damjoint.input.resolve import load
from damjoint.mesh.mesh import Mesh
from damjoint.statics.hints import hints
from numpy.polynomial.legendre import leggauss

#: Gauss points and weights on a line, their products for a triangle: enough for a kink.
LINE, (X, W) = leggauss(400), leggauss(40)


def push(surface, pressure):
    """Force and point of action of each part of a surface under a pressure (y) [Pa]."""
    for _, table in surface.cells:
        for place, normal in zip(surface.points[table], surface.normals[: len(table)], strict=True):
            if len(place) == 2:
                u, w = (LINE[0][:, None] + 1) / 2, LINE[1] / 2 * np.linalg.norm(place[1] - place[0])
                at = place[0] + u * (place[1] - place[0])
            else:
                u, v = np.meshgrid(X, X)
                u, v = (u.ravel() + 1) / 2, (v.ravel() + 1) / 2
                a, b = place[1] - place[0], place[2] - place[0]
                at = place[0] + u[:, None] * a + (1 - u)[:, None] * v[:, None] * b
                area = np.linalg.norm(np.cross(a, b))
                w = np.outer(W, W).ravel() / 4 * (1 - u) * area
            yield at, -(w * pressure(at[:, 1]))[:, None] * normal


def resultants(case, level, tail):
    """N, T, M of the joint without uplift, by integrals over the mesh."""
    mesh = Mesh(case)
    dam, unit = mesh.bodies["dam"], case["rho_water"] * case["g"]
    parts = []
    for _, table in dam.cells:
        corners = dam.points[table][:, :, : mesh.dim]
        volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / (
            2 if mesh.dim == 2 else 6
        )
        down = np.array([0, -case["rho_dam"] * case["g"], 0])
        parts.append((dam.points[table].mean(axis=1), volume[:, None] * down))
    for face in mesh.faces.values():
        surface = tail if face.side == "down" else level
        parts += push(face.surface, lambda y, top=surface: unit * np.maximum(top - y, 0))
    place, force = (np.concatenate(both)[:, :2] for both in zip(*parts, strict=True))
    ends = {name: values[0] for name, values in mesh.joints[0].ends.items()}
    chord = np.array([ends["toe_x"] - ends["heel_x"], ends["toe_y"] - ends["heel_y"]])
    along = chord / np.linalg.norm(chord)
    across, arm = np.array([-along[1], along[0]]), place - [ends["toe_x"], ends["toe_y"]]
    total = force.sum(axis=0)
    moment = np.sum(arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0])
    return np.array([-total @ across, total @ along, moment]) / mesh.joints[0].width


@pytest.mark.parametrize(
    "name, tolerance", [("stepped", 1e-6), pytest.param("valley", 1e-5, marks=pytest.mark.heavy)]
)
def test_equilibrium_of_a_user_geometry(solve, name, tolerance):
    """The waterline cuts elements; in 3D the tolerance is that of the integration of this test."""
    (result,) = solve(name, "33.3", "6.1" if name == "stepped" else "0", uplift="none")
    expected = resultants(result.case, 33.3, result.last["tail_level"])
    found = [result.last[n] for n in "NTM"]
    assert found == pytest.approx(expected, rel=tolerance)
    wet = solve(name, "33.3", "6.1" if name == "stepped" else "0", uplift="imposed")[0].last
    assert wet["N"] + wet["U"] == pytest.approx(result.last["N"], rel=1e-9)


def test_a_hint_reports_drains_without_a_node(solve):
    (result,) = solve("stepped", "20", "0", uplift="drained", drain_x=6.4, n_joint=34)
    found = "\n".join(hints(result))
    assert "no node at the drains (drain_x = 6.4 m): the nearest is 0.1 m away" in found
    (result,) = solve("stepped", "20", "0", uplift="drained", drain_x=6, n_joint=34)
    assert "no node" not in "\n".join(hints(result))


@pytest.mark.heavy
@pytest.mark.parametrize("uplift", ["imposed", "drained", "flow", "cracked"])
def test_both_engines_agree_on_a_bent_joint(tmp_path, uplift):
    """At a level where the waterline cuts no element: there the GetDP model integrates exactly."""
    settings = {"n_joint": 34, "uplift": uplift, "drain_x": 6, "tolerance": 1e-11}
    case = load("stepped", settings, "45", "4")
    one, other = (
        runner.run(case, tmp_path / engine, False, False, False, engine)[0].at()
        for engine in ("condensed", "getdp")
    )
    for column in ("s", "delta_n", "delta_t1", "sigma_n", "tau_1", "p"):
        size = np.abs(one[column]).max()
        assert other[column] == pytest.approx(one[column], rel=0, abs=1e-6 * size), column


@pytest.mark.heavy
def test_the_coordinate_s_follows_the_joint(solve):
    (result,) = solve("stepped", "20", "0", uplift="none")
    rows = result.at()
    steps = np.hypot(np.diff(rows["x"]), np.diff(rows["y"]))
    assert np.diff(rows["s"]) == pytest.approx(steps, rel=1e-6)
    assert rows["s"][-1] == pytest.approx(38)


@pytest.fixture
def draw(tmp_path):
    """draw(changes): a case file of a dam of two blocks, with changes of its mesh."""

    def make(rename=(), apart=False, order=1):
        empty_gmsh()
        geo = gmsh.model.geo
        corners = [(0, 0), (2, 0), (2, 3), (0, 3), (-4, 0), (-4, -4), (6, -4), (6, 0)]
        p = [geo.addPoint(x, y, 0, 1) for x, y in corners]
        lines = [geo.addLine(p[i], p[i + 1]) for i in range(3)] + [geo.addLine(p[3], p[0])]
        under = [(0, 4), (4, 5), (5, 6), (6, 7), (7, 1)]
        below = [geo.addLine(p[i], p[k]) for i, k in under]
        face = geo.addLine(p[0], p[1]) if apart else lines[0]
        dam = geo.addPlaneSurface([geo.addCurveLoop(lines)])
        rock = geo.addPlaneSurface([geo.addCurveLoop([*below, -face])])
        geo.synchronize()
        if apart:
            gmsh.model.mesh.setTransfiniteCurve(face, 7)
        regions = {
            "dam": (2, [dam]),
            "foundation": (2, [rock]),
            "joint": (1, [lines[0]]),
            "upstream": (1, [lines[3]]),
            "fixed": (1, below[1:4]),
            "heel": (0, [p[0]]),
            "toe": (0, [p[1]]),
            "crest": (0, [p[3]]),
        }
        for name, (d, tags) in regions.items():
            if new := dict(rename).get(name, name):
                gmsh.model.addPhysicalGroup(d, tags, name=new)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(tmp_path / "own.msh"))
        path = tmp_path / "own.case"
        path.write_text('geometry = "own.msh";\nlevels() = {1};\n')
        return path

    return make


def test_a_mesh_file_of_the_user(draw, solve):
    (result,) = solve(str(draw()), uplift="none")
    assert result.last["T"] == pytest.approx(9810 / 2)
    assert result.last["N"] == pytest.approx(2400 * 9.81 * 6)


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"rename": {"toe": ""}}, "no region toe"),
        ({"rename": {"upstream": "usptream"}}, 'region "usptream" is not known'),
        ({"rename": {"fixed": "joint", "joint": "fixed"}}, "also meet beside the joint"),
        (
            {"rename": {"upstream": "reservoir floor"}},
            "reservoir floor: its elements must be sides of its body",
        ),
        ({"apart": True}, "sides of"),
        ({"order": 2}, "must be of order 1"),
    ],
)
def test_a_bad_geometry_is_refused(draw, refused, tmp_path, changes, message):
    path = draw(**changes)
    line = refused("run", path)
    assert f"geometry = {tmp_path / 'own.msh'}" in line and message in line


def test_a_mesh_of_the_wrong_dimension_is_refused(draw):
    with pytest.raises(InputError, match="has dimension 0: must be 1 with dim = 3"):
        Mesh(load(str(draw()), {"dim": 3}))


@pytest.mark.parametrize("name", ["trap.geo", "trap.GEO", "trap.msh", "trap.txt", "trap.msh.gz"])
def test_a_geo_file_is_not_run_without_run_geo(tmp_path, refused, monkeypatch, name):
    """Gmsh runs files of any unknown type."""
    monkeypatch.delenv("DAMJOINT_RUN_GEO", raising=False)  # of a command before, in this process
    (tmp_path / name).write_text(f'SystemCall "touch {tmp_path}/run";\nPoint(1) = {{0, 0, 0}};\n')
    (tmp_path / "own.case").write_text(f'geometry = "{name}";\n')
    assert "--run-geo" in refused("run", tmp_path / "own.case")


@pytest.mark.parametrize(
    "name, content, message",
    [
        ("own.med", b"\x89HDF\r\n", "own.med: must be a mesh in Gmsh's format, which"),
        ("own.msh", b"<xml>", "own.msh: must be a mesh in Gmsh's format, which"),
        ("own.geo", b"Point(1) = {0, 0, 0};", "is a program that Gmsh runs; if you trust it"),
        *((f"own.{kind}", b"", "is empty") for kind in ("msh", "med", "geo")),
    ],
)
@pytest.mark.parametrize("allowed", ["0", "1"])
def test_a_file_is_called_what_it_is(tmp_path, monkeypatch, name, content, message, allowed):
    """With --run-geo, too, an empty one is refused."""
    monkeypatch.setenv("DAMJOINT_RUN_GEO", allowed)
    (tmp_path / name).write_bytes(content)
    (tmp_path / "own.case").write_text(f'geometry = "{name}";\nlevels() = {{1}};\n')
    if content and allowed == "1":
        assert load(str(tmp_path / "own.case")).geometry == tmp_path / name
        return
    with pytest.raises(InputError, match=message) as error:
        load(str(tmp_path / "own.case"))
    assert ("program that" in str(error.value)) == (name == "own.geo" and bool(content))


def test_an_options_file_beside_a_mesh_is_not_run(draw, tmp_path):
    """Gmsh would read own.msh.opt after own.msh."""
    case = load(str(draw()))
    (tmp_path / "own.msh.opt").write_text(f'SystemCall "touch {tmp_path}/run";\n')
    assert Mesh(case).nodes and not (tmp_path / "run").exists()


@pytest.mark.parametrize("length", [11, 20, 300, 0.5])
def test_a_truncated_mesh_is_refused(draw, refused, tmp_path, length):
    """A good mesh after it is read."""
    path, mesh = draw(), tmp_path / "own.msh"
    whole = mesh.read_bytes()
    mesh.write_bytes(whole[: int(length * len(whole)) if length < 1 else length])
    assert f"geometry = {mesh}" in refused("run", path)
    mesh.write_bytes(whole)
    assert Mesh(load(str(path))).nodes
