"""Files of a run."""

import contextlib
import csv
import io
import json
import shutil
import subprocess
import sys
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
from damjoint import cli
from damjoint.fem import elements
from damjoint.mesh.body import Body
from damjoint.post import summary
from damjoint.post.field_files import QUADRATIC, of_order, write_vtu
from damjoint.post.stored import read_fields
from damjoint.post.tables import write_csv
from numpy.testing import assert_allclose

JOINT = (
    "time,level,joint,x,y,z,delta_n,delta_t1,delta_t2,sigma_n,tau_1,tau_2,p,damage,slip,s,"
    "sigma_n_eff"
)
HISTORY = (
    "time,level,load_factor,iterations,cuts,residual,crack_length,process_zone,slip_length,max_opening,"
    "crest_ux,N,T,M,flux,tail_level,U,x_resultant,M_U,broken_length,bonded_length"
)


def test_a_text_in_a_table_is_not_a_formula_for_a_spreadsheet(tmp_path):
    """A number stays a number."""
    table = {"case": ["=1+1", "+x", "-2.5", "@x", "a=1"], "n": np.array([-1.0] * 5)}
    write_csv(tmp_path / "t.csv", table)
    cells = [line.split(",") for line in (tmp_path / "t.csv").read_text().splitlines()[1:]]
    assert [cell for cell, _ in cells] == ["'=1+1", "'+x", "-2.5", "'@x", "a=1"]
    assert {number for _, number in cells} == {"-1"}


def test_a_table_of_all_steps_is_written_on_demand(command, tmp_path):
    """Its last rows are those of joint.csv; a run without it removes it, and is the same."""
    words = "run", "dam", "--set", "n_joint=10", "--levels", "40", "--no-fields", "--no-picture"
    assert command(*words, "--all-steps")[0] == 0
    folder = tmp_path / "out" / "dam"
    steps, joint = read(folder / "steps.csv"), read(folder / "joint.csv")
    history = (folder / "history.csv").read_text()
    last = (steps["update"] == steps["update"].max()) & (steps["weight"] == 0)
    for name in ("delta_n", "sigma_n_eff", "tau_1", "damage"):
        assert_allclose(np.sort(steps[name][last]), np.sort(joint[name]), rtol=1e-11)
    assert command(*words)[0] == 0
    assert not (folder / "steps.csv").exists() and (folder / "history.csv").read_text() == history
    code, _, error = command(*words, "--all-steps", "--engine", "getdp")
    assert code == 2 and error.endswith("--all-steps: must not be given with --engine getdp\n")


@pytest.mark.heavy
def test_a_matplotlibrc_in_the_current_folder_has_no_effect(tmp_path):
    (tmp_path / "matplotlibrc").write_text("axes.facecolor: red\nfont.size: 40\n")
    script = (
        "from damjoint.pictures.drawing import picture_style\nimport matplotlib as m\n"
        "with picture_style(): print(m.rcParams['axes.facecolor'], m.rcParams['font.size'])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.stdout.split() == ["white", "10.0"], done.stderr


def read(path):
    with path.open() as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """The folder of a run and what it printed."""
    folder = tmp_path_factory.mktemp("ran") / "here" / "out"
    words = "run", "a", "--levels", "6,9", "--steps", "2", "--set", "n_joint=20"
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = cli.main([*words, "--out", str(folder)])
    assert (code, err.getvalue()) == (0, "")
    return folder, out.getvalue()


@pytest.fixture
def folder(ran):
    return ran[0]


@pytest.mark.heavy
def test_a_run_prints_what_each_level_has(ran):
    out = ran[1]
    assert "uplift imposed: stands; 4 steps" in out and "uplift none: stands; 4 steps" in out
    firsts = [line.split()[0] for line in out.splitlines() if line.startswith("   ")]
    assert [first for first in firsts if first.isdigit()] == ["6", "9"] * 2


def test_files_of_a_run(folder):
    joint, history = read(folder / "joint.csv"), read(folder / "history.csv")
    assert ",".join(joint) == JOINT and ",".join(history) == HISTORY
    assert_allclose(history["time"], [0.5, 1, 1.5, 2])
    assert_allclose(history["level"], [3, 6, 7.5, 9])
    assert_allclose(history["load_factor"], 1)
    assert np.all(history["residual"] <= 1e-9)
    assert_allclose(np.unique(joint["level"]), [6, 9])
    assert len(joint["x"]) == 2 * 21
    assert_allclose(np.unique(joint["x"]), np.linspace(0, 5, 21), atol=1e-9)
    assert_allclose(joint["p"], 9810 * joint["level"] * (1 - joint["x"] / 5), rtol=1e-9, atol=1e-6)
    assert joint["damage"].max() == 1  # the heel has opened
    assert history["max_opening"][-1] == pytest.approx(joint["delta_n"].max(), rel=1e-9)
    assert_allclose(joint["sigma_n_eff"], joint["sigma_n"] + joint["p"], rtol=1e-9, atol=1e-6)
    assert_allclose(history["U"], 9810 * history["level"] * 5 / 2, rtol=1e-9)
    assert_allclose(history["N"] + history["U"], 765_180, rtol=1e-6)
    assert_allclose(history["x_resultant"], 5 - history["M"] / history["N"], rtol=1e-9)
    order = np.lexsort((joint["z"], joint["x"], joint["time"]))
    assert np.array_equal(order, np.arange(len(order)))  # by level, x, z
    dry = read(folder / "none" / "joint.csv")
    assert_allclose(dry["p"], 0)

    record = json.loads((folder / "run.json").read_text())
    assert record["parameters"]["n_joint"] == 20 and record["parameters"]["K_N"] == 1e12
    assert record["levels"] == [6, 9] and record["statement"] == ""
    assert record["mesh"]["joint_elements"] == 20 and record["unknowns"] > 0
    assert set(record["wall_seconds"]) >= {"solve", "post"}

    assert next(folder.glob("*.png")).read_bytes()[:4] == b"\x89PNG"


def collection(fields):
    """Files of fields.pvd by the time and the name of the block that ParaView shows."""
    entries = ElementTree.parse(fields / "fields.pvd").iter("DataSet")
    return {(float(e.get("timestep")), e.get("name")): fields / e.get("file") for e in entries}


def test_fields_for_paraview(folder):
    """A time per level, which is the level; crest displacement as in history.csv, none at the
    bottom; jumps as in joint.csv.
    """
    shown = collection(folder / "fields")
    names = "dam", "foundation", "joint"
    assert {*shown} == {(level, name) for level in (6, 9) for name in names}
    joint, history = read(folder / "joint.csv"), read(folder / "history.csv")
    for level in (6, 9):
        dam, rock, lips = (meshio.read(shown[level, name]) for name in names)
        moved, lowest = (mesh.point_data["displacement [m]"] for mesh in (dam, rock))
        crest = np.all(np.isclose(dam.points, (0, 10, 0)), axis=1)
        at_level = history["level"] == level
        assert_allclose(moved[crest, 0], history["crest_ux"][at_level], rtol=1e-6)
        assert_allclose(lowest[np.isclose(rock.points[:, 1], -5)], 0, atol=1e-15)
        assert_allclose(
            np.sort(lips.point_data["jump [m]"][:, 1]),
            np.sort(joint["delta_n"][joint["level"] == level]),
            rtol=1e-6,
        )
        assert len(dam.cells[0].data) + len(rock.cells[0].data) == 918
        assert {m.field_data["level [m]"].item() for m in (dam, rock, lips)} == {level}
        jump = lips.point_data["jump [m]"][:, 1]
        assert_allclose(lips.point_data["opening [m]"], np.maximum(jump, 0))
        for mesh, number in ((dam, 1), (rock, 2)):
            (stress,) = mesh.cell_data["stress [Pa]"]
            largest, smallest = (
                mesh.cell_data[f"{which} principal stress [Pa]"][0]
                for which in ("largest", "smallest")
            )
            xx, yy, zz, xy, _, _ = stress.T
            middle, radius = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
            assert_allclose(largest, np.maximum(middle + radius, zz), atol=1e-6 * np.abs(yy).max())
            assert_allclose(smallest, np.minimum(middle - radius, zz), atol=1e-6 * np.abs(yy).max())
            assert np.all(mesh.cell_data["body"][0] == number)


@pytest.mark.heavy
def test_blocks_for_paraview_have_the_names_of_joints_and_times_are_levels_that_rise(
    command, tmp_path
):
    """A level that falls, or water that needs time: the time of the run."""
    small = "--set", "n_joint=10", "--set", "h_dam=30", "--set", "h_found=30", "--no-picture"
    fields = tmp_path / "out" / "dam" / "fields"
    assert (
        command("run", "dam", *small, "--set", "lift_heights=10,20.5", "--levels", "20,25")[0] == 0
    )
    bodies = "foundation", "dam above base", "dam above lift 10 m", "dam above lift 20.5 m"
    joints = "joint base", "joint lift 10 m", "joint lift 20.5 m"
    assert [*collection(fields)] == [(t, name) for t in (20, 25) for name in bodies + joints]
    highest, lift = (meshio.read(collection(fields)[25, n]) for n in (bodies[-1], joints[-1]))
    assert lift.points[:, 1] == pytest.approx(20.5) and highest.points[:, 1].min() == 20.5
    for levels in ("25,20", "20,20"):
        assert command("run", "dam", *small, "--levels", levels)[0] == 0
        assert {time for time, _ in collection(fields)} == {1, 2}
    flow = "--set", "uplift=flow", "--set", "time_unit=3600"
    assert command("run", "dam", *small, *flow, "--levels", "20,25")[0] == 0
    assert {time for time, _ in collection(fields)} == {1, 2}


@pytest.mark.heavy
@pytest.mark.parametrize("engine", ["condensed", "getdp"])
def test_the_points_of_each_joint_move_with_the_body_below_it(command, tmp_path, engine):
    """Above it the displacement is larger by the jump: x, y of a horizontal joint."""
    settings = "--set", "n_joint=10", "--set", "h_dam=30", "--set", "h_found=30"
    lifts = "--set", "lift_heights=10,20", "--levels", "25", "--no-picture", "--engine", engine
    # else displacements count from the state under the weight, jumps from none
    assert command("run", "dam", *settings, *lifts, "--set", "weight_first=0")[0] == 0
    fields = tmp_path / "out" / "dam" / "fields"
    parts = {path.stem.removesuffix("_t1"): meshio.read(path) for path in fields.glob("*.vtu")}
    for joint, lower, upper in (
        *(("joint", "foundation", "dam"), ("joint_2", "dam", "dam_2")),
        ("joint_3", "dam_2", "dam_3"),
    ):
        lips = parts[joint]
        at_joint, jump = (lips.point_data[n] for n in ("displacement [m]", "jump [m]"))
        for body, expected in ((lower, at_joint), (upper, at_joint + jump)):
            away = np.abs(parts[body].points[:, None] - lips.points).max(axis=2)
            assert away.min(axis=0).max() == 0
            moved = parts[body].point_data["displacement [m]"]
            assert_allclose(moved[away.argmin(axis=0)], expected, atol=1e-9)
        assert np.abs(at_joint).max() > 1e-4


def test_cells_of_order_2_have_their_midpoints(command, tmp_path):
    """Quadratic cells of VTK, the displacement at their further nodes that of the finite elements:
    the moment about the toe balances the weight's as curved sides do. Read back, only corners.
    """
    small = "--set", "n_joint=10", "--set", "h_dam=20", "--set", "h_found=30"
    assert command("run", "dam", *small, "--levels", "30", "--no-picture")[0] == 0
    folder = tmp_path / "out/dam/fields"
    dam, lips = (meshio.read(folder / f"{name}_t1.vtu") for name in ("dam", "joint"))
    assert [block.type for block in dam.cells] == ["triangle6"]
    assert [block.type for block in lips.cells] == ["line3"]
    joint = read(tmp_path / "out/dam/joint.csv")
    order = np.argsort(lips.points[:, 0])
    assert_allclose(lips.points[order, 0], joint["x"], atol=1e-9)
    assert_allclose(lips.point_data["jump [m]"][order, 1], joint["delta_n"], rtol=1e-9)
    (table,) = (block.data for block in dam.cells)
    corners, moved = dam.points[table], dam.point_data["displacement [m]"][table]
    for k, (a, b) in enumerate(((0, 1), (1, 2), (2, 0)), 3):
        assert_allclose(corners[:, k], (corners[:, a] + corners[:, b]) / 2, atol=1e-9)
        bent = moved[:, k] - (moved[:, a] + moved[:, b]) / 2
        assert 1e-3 < np.abs(bent).max() / np.abs(moved).max() < 0.1
    bodies, fields = read_fields(folder, np.array([1.0]))
    assert {shape for body in bodies.values() for shape, _ in body.cells} == {"triangle", "line"}
    for name, values in fields[1.0].displacement.items():
        assert len(values) == len(bodies[name].points)


@pytest.mark.parametrize("shape", ["line", "triangle", "quad", "tetra", "wedge", "hexahedron"])
def test_nodes_of_quadratic_cells_are_in_the_order_of_vtk(shape):
    """Those of VTK's own description: corners, edges, faces, middle."""
    corners = elements.corners_of(shape)
    points = np.pad(corners, ((0, 0), (0, 3 - corners.shape[1])))
    tags = np.arange(len(points))
    cell = of_order(Body(points, tags, [(shape, tags[None])], np.ones(1, int), [""]), 2)
    ((name, (table,)),) = cell.cells
    kind, pairs = QUADRATIC[name]
    assert meshio._vtk_common.vtk_to_meshio_type[kind] == name
    pairs = np.array([[*map(int, pair)] for pair in pairs.split()])
    assert np.array_equal(table[: len(points)], tags)
    assert_allclose(cell.points[table[len(points) :]], points[pairs].mean(axis=1))
    assert len(set(table)) == len(table) == meshio._mesh.num_nodes_per_cell[name]


def test_fields_of_any_cells_are_read_as_they_were_written(tmp_path):
    """Several shapes, floats and integers, scalars and vectors."""
    points = np.arange(27.0).reshape(9, 3)
    shapes = {"triangle": 3, "quad": 4, "tetra": 4, "wedge": 6, "hexahedron": 8, "line": 2}
    cells = [(n, np.arange(2 * k).reshape(2, k) % 9) for n, k in shapes.items()]
    on_points = {"u": points / 7, "number": np.arange(9)}
    of_all = {"level [m]": np.array([7.5])}
    in_cells = {"stress": np.arange(72.0).reshape(12, 6), "body": np.repeat([1, 2], 6)}
    write_vtu(tmp_path / "some.vtu", points, cells, on_points, in_cells, of_all)
    mesh = meshio.read(tmp_path / "some.vtu")
    assert np.array_equal(mesh.points, points)
    assert mesh.field_data == of_all
    assert 'Name="level [m]" NumberOfTuples="1"' in (tmp_path / "some.vtu").read_text()
    assert [block.type for block in mesh.cells] == [*shapes]
    assert all(np.array_equal(b.data, t) for b, (_, t) in zip(mesh.cells, cells, strict=True))
    for name, values in on_points.items():
        assert np.array_equal(mesh.point_data[name], values)
    for name, values in in_cells.items():
        assert np.array_equal(np.concatenate(mesh.cell_data[name]), values)


def test_fields_for_gmsh(folder):
    """Each view has dam and foundation, a step per level with its time, the unit in its name."""
    import gmsh
    from damjoint.input.parameters import start_gmsh

    start_gmsh()
    history = read(folder / "history.csv")
    for name, views in (("bulk", 2), ("joint", 6)):
        gmsh.merge(str(folder / "fields" / f"{name}.msh"))
        tags = gmsh.view.getTags()
        assert len(tags) == views
        for tag in tags:
            index = gmsh.view.getIndex(tag)
            assert gmsh.option.getString(f"View[{index}].Name").endswith("]")
            for step, time in ((0, 1.0), (1, 2.0)):
                _, places, values, found, _ = gmsh.view.getModelData(tag, step)
                assert found == time and len(places) == len(values) > 0
        if name == "bulk":
            _, nodes, moved, _, _ = gmsh.view.getModelData(tags[0], 1)
            place = [gmsh.model.mesh.getNode(int(n))[0] for n in nodes]
            top = np.flatnonzero(np.all(np.isclose(place, (0, 10, 0)), axis=1))
            assert moved[top[0]][0] == pytest.approx(history["crest_ux"][-1], rel=1e-6)
        gmsh.clear()


def test_flux_in_the_fields(command, tmp_path):
    small = "--set", "n_joint=10", "--set", "h_dam=3", "--set", "h_found=4"
    assert command("run", "e", *small, "--levels", "6", "--no-picture")[0] == 0
    lips = meshio.read(tmp_path / "out/e/fields/joint_t1.vtu")
    joint = read(tmp_path / "out/e/joint.csv")
    assert_allclose(lips.point_data["flux [kg/(m s)]"], joint["flux"][0], rtol=1e-6)


def test_vertical_stress_in_the_dam_balances_its_weight(folder):
    """At 6 m, over the elements that a horizontal section cuts near the crest: the weight above."""
    dam = meshio.read(folder / "none" / "fields" / "dam_t1.vtu")
    cells, stress = dam.cells[0].data, dam.cell_data["stress [Pa]"][0]
    middle = dam.points[cells].mean(axis=1)
    high = np.abs(middle[:, 1] - 8) < 1
    above = (
        2400 * 9.81 * (10 - middle[high, 1]) * (1.5 + 0.35 * (10 - middle[high, 1]) / 2)
    )  # N/m, of the trapezoid
    assert np.mean(stress[high, 1] * (1.5 + 0.35 * (10 - middle[high, 1]))) == pytest.approx(
        -np.mean(above), rel=0.1
    )


def test_a_hint_reports_a_joint_too_stiff_for_its_mesh(command, tmp_path):
    """Nodal stresses oscillate: K_N h/E = 1e14 * 0.5 / 1e10 = 5000."""
    small = "--set", "n_joint=10", "--set", "h_dam=3", "--set", "h_found=4"
    stiff = "--set", "K_N=1e14", "--set", "E=1e10", "--no-fields", "--no-picture"
    code, out, _ = command("run", "c", *small, *stiff, "--levels", "3")
    assert code == 0 and "K_N h/E = 5e+03" in out
    record = json.loads((tmp_path / "out/c/run.json").read_text())
    assert record["hints"][0] in out and "oscillate" in record["hints"][0]


@pytest.mark.heavy
def test_a_run_imports_no_library_that_it_does_not_need(tmp_path):
    """Optimisation, statistics and plotting take longer to import than a short run takes."""
    words = ["run", "c", "--no-fields", "--no-picture", "--out", str(tmp_path / "out")]
    heavy = ["scipy.optimize", "scipy.stats", "scipy.integrate", "matplotlib"]
    tell = f"import sys; from damjoint import cli; cli.main({words})"
    tell += f"; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", tell], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.heavy
@pytest.mark.parametrize("law", ["rupture", "bond", "friction"])
def test_length_of_the_fracture_process_zone(command, tmp_path, law):
    """No crack yet, but metres of softening: the integral over the Gauss points is, to an element,
    the length from the heel over which the nodal damage is between 0 and 1; both engines agree.
    """
    settings = f"law={law}", "sigma_max=3e5", "G_f=300", "n_joint=20", "h_dam=8", "h_found=30"
    words = "--levels", "40,48", "--no-fields", "--no-picture"
    words += tuple(word for setting in settings for word in ("--set", setting))
    zones = []
    for engine in ("condensed", "getdp"):
        code, out, _ = command("run", "dam", *words, "--engine", engine, "--out", engine)
        history, joint = (read(tmp_path / engine / f"{n}.csv") for n in ("history", "joint"))
        last = joint["time"] == 2
        softening = (joint["damage"][last] > 0) & (joint["damage"][last] < 1)
        zone = history["process_zone"]
        assert code == 0 and zone[0] == 0
        assert ("softening" in out) == bool(softening.any()) == (law != "friction")
        if law != "friction":
            assert history["crack_length"][-1] == 0 and history["max_opening"][-1] > 0
            length = joint["s"][last][np.argmin(softening)]
            assert zone[-1] > 0.5 and zone[-1] == pytest.approx(length, abs=34 / 20)
        zones.append(zone)
    assert_allclose(zones[0], zones[1], atol=1e-9)


def test_a_history_without_a_column_is_refused_as_of_an_earlier_version(command, folder, tmp_path):
    folder = shutil.copytree(folder, tmp_path / "out")
    path = folder / "history.csv"
    lines = (line.split(",") for line in path.read_text().splitlines())
    path.write_text("".join(",".join([*row[:7], *row[8:]]) + "\n" for row in lines))
    code, _, error = command("plot", folder)
    assert code == 2 and error.count("\n") == 1
    assert "history.csv of damjoint" in error and "lacks process_zone" in error


@pytest.mark.parametrize("joints", [{}, {"lift_heights": (15.0, 30.0)}])
def test_printed_tables_fit_the_terminal(solve, joints):
    """Of several joints a row for each; with all columns also the levels of each."""
    settings = {"n_joint": 10.0, "h_dam": 12.0, "h_found": 60.0, "law": "bond"} | joints
    (result,) = solve("dam", (30.0, 45.0), **settings)
    for width in (80, 120):
        lines = summary.text(result, width).splitlines()
        assert max(map(len, lines)) <= width
    wide = summary.text(result)
    assert "uplift" in wide and "[nm]" not in wide and "[kN/m]" not in wide
    if joints:
        names = result.case.joint_names
        assert [line.split("  ")[0] for line in lines[-3:]] == list(names)
        assert all(f"{name}:\n" in wide for name in names)
    else:
        assert "uplift" not in summary.text(result, 80).splitlines()[0]
        assert summary.text(result, 80).endswith("(--wide shows also: M, uplift U, softening)")
