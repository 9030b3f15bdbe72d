"""The GetDP model in the window of Gmsh: cases/*.pro, without Python."""

import os
import re
import shutil
import subprocess
import sys
import time

import gmsh
import numpy as np
import pytest
from damjoint import data, runner
from damjoint.engines.getdp.gmsh_files import write_gmsh_files
from damjoint.engines.getdp.process import find_getdp
from damjoint.engines.getdp.tables import PRINTED, PRINTED_OF_JOINTS, complete_rows
from damjoint.input.casefile import read
from damjoint.input.parameters import declared, parameter, start_gmsh
from damjoint.input.resolve import load
from matplotlib.image import imread

#: An order 1 mesh that is solved in a second
COARSE = {"n_joint": 20.0, "h_dam": 2.0, "h_found": 4.0}


@pytest.fixture
def project(tmp_path):
    """A copy of geo, pro and cases: a run writes mesh and results beside the case."""
    for name in ("geo", "pro", "cases"):
        shutil.copytree(data(name), tmp_path / name, ignore=shutil.ignore_patterns("res"))
    return tmp_path / "cases"


def press_run(folder, changed):
    """Do what Run does, in Gmsh without a window: change parameters in the tree, redraw, mesh, run
    GetDP as a client of ONELAB. Returns the values of SEEN at the last step.
    """
    for label, value in changed.items():
        if isinstance(value, str):
            gmsh.onelab.setString(label, [value])
        else:
            gmsh.onelab.setNumber(label, [value])
    gmsh.clear()
    gmsh.parser.clear()
    gmsh.open(str(folder / "a.geo"))
    gmsh.model.mesh.generate(2)
    gmsh.write(str(folder / "a.msh"))
    gmsh.onelab.run(
        "GetDP", f"{find_getdp()} {folder / 'a.pro'} -msh {folder / 'a.msh'} -solve Fill -v 0"
    )
    row = {}
    for name, columns in (("history", PRINTED), ("joints", PRINTED_OF_JOINTS)):
        rows = complete_rows(folder / f"res/a/{name}.txt", columns)
        row |= dict(zip(columns, rows[-1], strict=True))
    return [row[name] for name in SEEN]


@pytest.mark.heavy
@pytest.mark.parametrize(
    "words, message",
    [
        ("level_2 20.5", "Level 2 = 20.5 m: must be between 0 and 20 m"),
        ("tail_level_1 -3", "Tailwater at level 1 = -3 m: must be between 0 and 20 m"),
        ("dam_height 4", "Level 4 = 9 m: must be between 0 and 8 m"),
        ("batter 5", "batter = 5: must be below dam_base (5 m)"),
        ("neck_height 10", "neck_height = 10: must be below dam_height (10 m)"),
        (
            "neck_height 3 -setnumber neck_batter 4",
            "neck_batter = 4: must be at most 3.5 m (dam_base - batter - dam_crest)",
        ),
        ("joint_height 11", "joint_height = 11: must be below dam_height (10 m)"),
        (
            "joint_slope 60 -setnumber dam_base 6",
            "joint_slope = 60: must let the joint leave the dam below its crest",
        ),
        ("force_x 1 -setnumber force_at 3", "anchor_at, drive_at: must lie on the dam's faces"),
    ],
)
def test_impossible_sections_are_refused_before_the_run(project, words, message):
    """In Gmsh and in GetDP: one line with the level, its value and the allowed range."""
    gmsh_command = [sys.executable, "-c", GMSH, str(project / "a.geo"), "-", "-v", "2"]
    for command in (gmsh_command, [find_getdp(), str(project / "a.pro"), "-v", "2"]):
        done = subprocess.run(
            [*command, "-setnumber", *words.split()], capture_output=True, text=True, check=False
        )
        lines = [line for line in (done.stdout + done.stderr).splitlines() if line.strip()]
        assert len(lines) == 1 and message in lines[0]
    assert done.returncode and not (project / "res").exists()


@pytest.mark.heavy
@pytest.mark.parametrize(
    "text, message",
    [
        ("{20, 30, 25, 20}", "its corners up to (25, 20) must rise from one to the next"),
        ("{-2, 30}", "its corners up to (-2, 30) must rise from one to the next, downstream"),
        ("{20, 30, 9}", "downstream_face: must be pairs x, y of corners, upwards"),
        (
            "{20, 30}; default_neck_height = 3",
            "neck_height = 3: must be 0 with downstream_face",
        ),
    ],
)
def test_an_impossible_downstream_face_is_refused_before_the_run(project, text, message):
    (project / "dam.case").write_text(f"downstream_face() = {text};")
    gmsh_command = [sys.executable, "-c", GMSH, str(project / "dam.geo"), "-"]
    for command in (gmsh_command, [find_getdp(), str(project / "dam.pro")]):
        done = subprocess.run([*command, "-v", "2"], capture_output=True, text=True, check=False)
        lines = [line for line in (done.stdout + done.stderr).splitlines() if line.strip()]
        assert len(lines) == 1 and message in lines[0]
    assert done.returncode and not (project / "res").exists()


#: Joints that differ in law, water, strength; in what is computed from these; a name with a point
LIFTS = """
lift_heights() = {12.5, 25};
default_n_joint = 20;
default_h_dam = 8;
default_h_found = 30;
default_law = "friction";
default_adhesion = 5e4;
default_mu = 0.75;
Struct Joint::base [ mu 0.7, K_N 2e11 ];
Struct Joint::lift_12_5_m [ law "rupture", sigma_max 3e4, pena_rupture 4, uplift "cracked" ];
levels() = {40, 50};
"""


def run_in_gmsh(project, name, settings):
    """Mesh and run a case with Gmsh and GetDP alone; settings: numbers. The last row of each joint,
    by the columns of PRINTED_OF_JOINTS (joints, columns).
    """
    words = [word for item in settings.items() for word in ("-setnumber", item[0], str(item[1]))]
    mesh = [sys.executable, "-c", GMSH, f"{name}.geo", "-3", "-o", f"{name}.msh", *words]
    subprocess.run(mesh, cwd=project, check=True, capture_output=True)
    solve = [find_getdp(), f"{name}.pro", "-msh", f"{name}.msh", "-solve", "Fill", "-v", "2"]
    done = subprocess.run([*solve, *words], cwd=project, check=True, capture_output=True, text=True)
    assert "Error" not in done.stdout + done.stderr
    rows = complete_rows(project / f"res/{name}/joints.txt", PRINTED_OF_JOINTS)
    steps = complete_rows(project / f"res/{name}/history.txt", PRINTED)
    return rows.reshape(len(steps), -1, len(PRINTED_OF_JOINTS))[-1]


def points_of_views(file):
    """Coordinates X of the points of each view of a file; views of one name are steps."""
    found = {}
    for text in file.read_text().split("View ")[1:]:
        points = ",".join(re.findall(r"\((.*?)\)", text.split("{", 1)[1])).split(",")
        found.setdefault(text[1:].split(text[0])[0], []).append(np.array(points[::3], dtype=float))
    return found


def assert_as_in_python(rows, case, folder, tolerance=1e-5):
    """Compare the joints' last rows with those of a run from Python, of the same model."""
    # under a point's force N is a small rest of tension and compression, other in each engine; so
    # is the equilibrium of sliding on many joints
    engine = "getdp" if case["drive"] == "point" or len(case.joint_names) > 10 else "auto"
    (result, *_) = runner.run(case, folder, False, False, False, engine)
    joints = result.joints or [result]
    assert len(rows) == len(joints)
    largest = max(abs(own.last["N"]) for own in joints)
    for name in ("N", "T", "M", "U", "crack_length", "slip_length", "max_opening"):
        expected = np.array([own.last[name] for own in joints])
        printed = rows[:, PRINTED_OF_JOINTS.index(name)]
        size = largest if name in ("N", "T", "U") else np.abs(expected).max()
        assert printed == pytest.approx(expected, rel=tolerance, abs=1e-8 * size), name
    return joints


@pytest.mark.heavy
def test_lifts_without_python(project):
    """Three joints, two with values of their own, which Gmsh reads from their blocks."""
    (project / "own.case").write_text(LIFTS)
    for kind in ("geo", "pro"):
        text = (project / f"dam.{kind}").read_text()
        text = text.replace("dam.case", "own.case").replace("res/dam", "res/own")
        (project / f"own.{kind}").write_text(text)
    rows = run_in_gmsh(project, "own", {})
    case = load(str(project / "own.case"))
    base, lift, _ = assert_as_in_python(rows, case, project / "other")
    assert base.last["slip_length"] > 0 and lift.last["max_opening"] > 0
    curves = points_of_views(project / "res/own/curves.pos")
    # each joint has its own, one for each level, from its heel to its toe
    for title, joint in zip(("base", "lift 12.5 m", "lift 25 m"), case.joints, strict=True):
        steps = curves[f"opening, {title} [m]"]
        assert len(steps) == 2
        for points in steps:
            assert (np.diff(points) >= 0).all()
            assert points[[0, -1]] == pytest.approx([0, joint.joint_length], abs=1e-9)


SHARED = ("_regions", "_joints")  # ends of files that cases share
FILES = {kind: {f.stem for f in data("cases").glob(f"*.{kind}")} for kind in ("geo", "pro")}
WINDOWED = sorted(name for name in FILES["pro"] if not name.endswith(SHARED))
#: Of a case in Gmsh: a coarser mesh than the case's
COARSER = {"n_joint": 10.0}
#: Of one in 3D, too
COARSER_SOLID = COARSER | {"n_layers": 2.0, "h_dam": 4.0, "h_found": 8.0}


@pytest.mark.heavy
@pytest.mark.parametrize("name", WINDOWED)
def test_every_case_runs_in_gmsh(project, name):
    solid = STATEMENTS[name].defaults.get("dim") == 3
    values, levels, words = COARSER_SOLID if solid else COARSER, None, {}
    if name.startswith("valley"):
        values = {"n_joint": 5.0, "h_found": 60.0, "h_dam": 16.0}
    if name == "valley_blocks":  # 15 joints: in one step of few iterations
        levels, words = "20", {"n_levels": 1, "level_1": 20}
    elif name == "d_file":  # in one step
        values, levels = {"n_joint": 6.0}, "5.9"
        words = {"n_levels": 1, "level_1": 5.9, "n_steps": 1}
    elif name == "ssnp133":  # in a quarter of its steps, through both snap-backs
        levels, words = "0", {"n_levels": 1, "level_1": 0, "n_steps": 30}
    elif name == "ssnp166":  # to the beginning of the softening
        values, levels = values | {"drive_by": -0.15e-3}, "0"
        words = {"n_levels": 1, "level_1": 0, "n_steps": 2}
    case = load(name, values, levels, steps=words.get("n_steps"))
    if name in SOLID:  # N and T refer to the line from heel to toe of this mesh's curved base
        write_gmsh_files([case], project)
    rows = run_in_gmsh(project, name, values | words)
    # with points at the joint's nodes Gmsh meshes dam and rock otherwise
    joints = assert_as_in_python(rows, case, project / "other", 1e-3 if case.stores_water else 1e-5)
    results = project / "res" / name
    if case["dim"] == 2:
        curves = points_of_views(results / "curves.pos")
        assert sum(title.startswith("opening") for title in curves) == len(joints)
        if len(joints) == 1:  # as long as the joint, along its steps
            (points, *_) = curves["opening [m]"]
            assert points[-1] == pytest.approx(joints[0].case.joint_along)
        for points in (steps[0] for steps in curves.values()):
            assert abs(points[0]) < 1e-9 and (np.diff(points) >= 0).all()  # else by number
    else:
        assert all(list(results.glob(f"opening_{j}_*.pos")) for j in range(len(joints)))


def test_every_case_has_its_files_for_gmsh():
    """All cases but common parts."""
    common = {"ssnp142", "ssnp143"}
    names = {path.stem for path in data("cases").glob("*.case")} - common
    assert names == set(WINDOWED) == {n for n in FILES["geo"] if not n.endswith(SHARED)}


STATEMENTS = {name: read(data("cases") / f"{name}.case") for name in WINDOWED}
#: Of a geometry of their own, or with a hydrograph
OWN = [n for n, case in STATEMENTS.items() if {"geometry", "hydrograph"}.intersection(case.texts)]
SOLID = {name for name in OWN if STATEMENTS[name].defaults.get("dim") == 3}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.heavy if n in SOLID else ()) for n in OWN]
)
def test_files_that_are_made_are_current(name, tmp_path):
    """As damjoint_tools.gmsh_files writes them; what several share is in a file of its own."""
    write_gmsh_files([load(name)], tmp_path)
    for kind in ("geo", "pro"):
        stored = (data("cases") / f"{name}.{kind}").read_text()
        for line in re.findall(r'Include "\w+_(?:regions.geo|joints.pro)";\n', stored):
            stored = stored.replace(line, (data("cases") / line.split('"')[1]).read_text())
        assert (tmp_path / f"{name}.{kind}").read_text() == stored


def test_another_dimension_is_refused(project):
    """The regions of a geometry of one's own are those of one dimension."""
    command = [
        sys.executable,
        "-c",
        GMSH,
        "monoliths.geo",
        "-",
        "-v",
        "2",
        "-setnumber",
        "dim",
        "3",
    ]
    done = subprocess.run(command, cwd=project, capture_output=True, text=True, check=False)
    assert "dim = 3: must be 2, as the regions in this file" in done.stdout + done.stderr


def test_values_of_joints_are_those_of_python():
    """The lists of pro/joints.pro."""
    text = (data("pro") / "joints.pro").read_text()
    listed = lambda name: re.findall(r'"(\w+)"', text.split(f"{name}() = Str[")[1].split("]")[0])
    own = {n: known for n, known in declared().items() if known.of_joints and n != "joint_slope"}
    assert listed("joint_numbers") == [n for n, known in own.items() if not known.text]
    assert listed("joint_texts") == [n for n, known in own.items() if known.text]
    for k, name in enumerate(listed("joint_texts")):
        assert listed(f"joint_choices_{k}") == list(own[name].choices)
    assert set(listed("joint_automatic")) == {n for n, known in own.items() if known.automatic}


def shake_in_gmsh(project, name, record, settings):
    """Run a case with Gmsh and GetDP, on a coarse mesh, through a record in its .pro file."""
    lines = (project / f"{name}.pro").read_text().splitlines(keepends=True)
    record += "damping_a0 = 0; damping_a1 = 1e-3;\n"
    (project / f"{name}.pro").write_text("".join([*lines[:-1], record, lines[-1]]))
    coarse = {"n_joint": 6, "order": 1, "h_dam": 20, "h_found": 60, "n_levels": 1, "dt": -1}
    run_in_gmsh(project, name, coarse | settings)


@pytest.mark.heavy
def test_a_dam_that_fails_by_the_earthquake_is_red(project):
    """The pulse breaks the joint, whose friction alone does not hold the dam at rest."""
    record = "record_x() = {0, 0, 0.1, 9, 0.2, 0}; record_y() = {0, 0, 0.2, 0};\n"
    weak = {"level_1": 44, "mu": 0.4, "adhesion": 3e5, "sigma_max": 1e5, "G_f": 10, "G_t": 100}
    shake_in_gmsh(project, "dam", record + "default_dt = 0.02;\n", weak)
    assert (project / "res/dam/after.txt").read_text().strip() == "0"
    status = (project / "res/dam/status.geo").read_text()
    assert "'fails in earthquake', " in status and "Tomato" in status


@pytest.mark.heavy
@pytest.mark.parametrize(
    "name, given, steps",
    [
        ("dam", "default_dt = 0.02;\n", 3),
        ("dam", "", 12),
        ("stepped", "default_dt = 0.02;\n", 3),
    ],
)
def test_an_earthquake_has_the_time_step_of_its_problem(project, name, given, steps):
    """As Gmsh's tree, made by the .geo file, has none (-1): that of the .pro file with the record,
    or half of the record's shortest interval.
    """
    record = "record_x() = {0, 0, 0.01, 0.5, 0.06, 0}; record_y() = {0, 0, 0.06, 0};\n"
    shake_in_gmsh(project, name, record + given, {"level_1": 30})
    rows = (project / f"res/{name}/quake.txt").read_text().splitlines()
    assert [float(row.split()[7]) for row in rows[1:]] == pytest.approx([0.06 / steps] * steps)
    assert (project / f"res/{name}/after.txt").read_text().strip() == "1"
    assert "'complete', " in (project / f"res/{name}/status.geo").read_text()
    for curve in range(2):  # of the crest, of the slip: over the time
        ((points,),) = points_of_views(project / f"res/{name}/motion_{curve}.pos").values()
        assert points == pytest.approx([float(row.split()[1]) for row in rows])


@pytest.mark.heavy
def test_an_earthquake_of_a_solid_geometry_of_its_own_is_refused(project):
    """The engine has it for parametric sections, and in 2D."""
    path = project / "valley.pro"
    path.write_text(
        "record_x() = {0, 0, 0.01, 0.2}; record_y() = {0, 0, 0.01, 0};\n" + path.read_text()
    )
    command = [find_getdp(), str(path), "-v", "2"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode and "record_x: must be left out" in done.stdout + done.stderr


CHANGES = (
    COARSE | {"uplift": "none"},
    {"E": 3e11},
    {"E": 3e10, "nu": 0.2},
    {"K_N": 2e11, "K_T": 3e11},
    {"dam_height": 11.0, "dam_base": 6.0},
    {"n_joint": 25.0},
    {"sigma_max": 5e4},
)


@pytest.mark.heavy
def test_a_changed_parameter_changes_the_next_run(project):
    """Changes one after the other, compared with the other engine."""
    labels = {n: parameter(n).label for change in CHANGES for n in change}
    if gmsh.isInitialized():  # by other tests, whose variables the first run would take
        gmsh.finalize()
    start_gmsh()
    # in the home folder, otherwise of the same name for all processes
    gmsh.option.setString("Solver.SocketName", f".gmshsock_{os.getpid()}_")
    gmsh.onelab.clear()
    rows = [press_run(project, {labels[n]: v for n, v in change.items()}) for change in CHANGES]
    level = {"Parameters/1Water levels/20004Level 4 [m]": 8.5}
    rows.append(press_run(project, level))
    gmsh.onelab.clear()
    changed, levels = {}, "3,6,8,9"
    for change, row in zip((*CHANGES, {}), rows, strict=True):
        changed |= change
        levels = levels if change else "3,6,8,8.5"
        case = load("a", changed, levels)
        expected = solved(case, project)
        assert row == pytest.approx(expected, rel=1e-6), (change, levels)


#: Columns of the history that are compared.
SEEN = "level", "crack_length", "process_zone", "max_opening", "crest_ux"


def solved(case, folder):
    """SEEN at the last step, by the default engine."""
    result = runner.run(case, folder / "other", fields=False, picture=False, progress=False)[0]
    return [result.history[name][-1] for name in SEEN]


#: Gmsh's colours of the status in the tree; colour of the water
GREEN, RED, BLUE = (127, 218, 127), (255, 72, 63), (150, 190, 255)


@pytest.fixture
def window(project, tmp_path):
    """window(*arguments): the window of Gmsh with cases/a.pro, of fixed size, on its own virtual
    screen. Has press(): Run, until the status is displayed; and a picture.
    """
    for tool in ("Xvfb", "xdotool", "import"):
        if not shutil.which(tool):
            pytest.skip(f"{tool} is missing (apt-get install xvfb xdotool imagemagick)")
    read, write = os.pipe()
    server = ["Xvfb", "-displayfd", str(write), "-screen", "0", "1300x900x24", "-nolisten", "tcp"]
    screen = subprocess.Popen(
        [*server, "-noreset"],  # when its last client leaves, which may be a search of a window
        pass_fds=(write,),
        stderr=subprocess.DEVNULL,
    )
    os.close(write)
    with os.fdopen(read) as number:
        display = ":" + number.readline().strip()
    environment = os.environ | {
        "DISPLAY": display,
        "HOME": str(tmp_path),  # settings of the user are neither read nor written
        "LIBGL_ALWAYS_SOFTWARE": "1",
    }
    call = lambda *words: subprocess.run(words, env=environment, check=True)
    opened = [screen]

    def wait(condition):
        """Until a condition is true; without a window it would never be."""
        while not condition():
            assert opened[-1].poll() is None
            time.sleep(0.2)

    sizes = {"GraphicsWidth": 1200, "GraphicsHeight": 800, "MenuWidth": 330}
    places = {"GraphicsPositionX": 0, "GraphicsPositionY": 0}
    command = [sys.executable, "-c", GMSH, "-setstring", "Solver.Executable0", find_getdp()]
    for name, value in (sizes | places).items():
        command += ["-setnumber", f"General.{name}", str(value)]

    def open_window(*arguments):
        opened.append(
            subprocess.Popen([*command, *arguments, str(project / "a.pro")], env=environment)
        )
        search = ["xdotool", "search", "--onlyvisible", "--name", "Gmsh"]
        wait(lambda: subprocess.run(search, env=environment, check=False).returncode == 0)

        def press(name):
            results = project / "res/a"
            began, ended = results / "clear.geo", results / "status.geo"
            before = [stamp(began), stamp(ended)]
            pressed = 0.0

            def finished():
                nonlocal pressed
                # a click is lost if the window is not drawn yet
                if stamp(began) == before[0] and time.monotonic() > pressed + 10:
                    call("xdotool", "mousemove", "250", "818", "click", "1")
                    pressed = time.monotonic()
                # a run deletes the file of the one before
                return stamp(ended) not in (0, before[1])

            picture, shown = tmp_path / f"{name}.png", None

            def drawn():
                """The status is there, and the drawing does not change any more."""
                nonlocal shown
                call("import", "-window", "root", str(picture))
                shown, last = imread(picture), shown
                status = max(pixels(shown, colour) for colour in (GREEN, RED))
                return status > 500 and np.array_equal(shown, last)

            wait(finished)
            wait(drawn)
            return imread(picture)

        return press

    yield open_window
    for process in reversed(opened):
        process.kill()
        process.wait()


#: The gmsh command of the installed package
GMSH = "import sys, gmsh; gmsh.initialize(['gmsh', *sys.argv[1:]], run=True); gmsh.finalize()"


def stamp(file):
    return file.stat().st_mtime_ns if file.exists() else 0


def pixels(picture, colour):
    """Count the pixels of a colour."""
    return (np.abs(picture[..., :3] * 255 - colour).max(axis=2) < 3).sum()


@pytest.mark.heavy
def test_window_shows_a_complete_run(window, project):
    """Run twice: green both times, the first run's views removed, the water of each step drawn."""
    mesh = [word for n, value in COARSE.items() for word in ("-setnumber", n, str(value))]
    press, results = window("-setnumber", "order", "1", *mesh), project / "res/a"
    for name in ("first", "second"):
        picture = press(name)
        assert pixels(picture, GREEN) > 500 and not pixels(picture, RED) > 500
        assert pixels(picture, BLUE) > 5000
        assert (results / "status.geo").read_text().count("'complete'") == 2
        assert (results / "head.geo").read_text().count("Merge") == 1
    assert len(points_of_views(results / "curves.pos")["opening [m]"]) == 8
    (reservoir,) = results.glob("water_*.pos")
    assert water_heights(reservoir) == pytest.approx([3, 6, 8, 8.2, 8.4, 8.6, 8.8, 9])


def water_heights(file):
    """Height of the water in each step of a view: the displacement of the upper edge."""
    steps = file.read_text().split("){")[1].split("}")[0].replace("\n", "").split(",")
    return [float(height) for height in steps[7::12]]


def test_the_window_fits_a_small_screen(project):
    """A window of Gmsh's default size is enlarged; another size is the user's."""
    for width, expected in (800, 1180), (1000, 1000):
        start_gmsh()
        gmsh.option.setNumber("General.GraphicsWidth", width)
        gmsh.option.setNumber("General.MenuWidth", 200)
        gmsh.open(str(project / "a.geo"))
        assert gmsh.option.getNumber("General.GraphicsWidth") == expected


def test_results_of_other_parameters_are_not_called_complete(project):
    """A changed level takes effect on the status at once, also if its value is refused."""
    status = "0Results/0Status"
    start_gmsh()
    gmsh.onelab.clear()
    gmsh.open(str(project / "a.geo"))
    assert gmsh.onelab.getString(status) == ["not run yet"]
    gmsh.onelab.setNumber("0Results/1Water level [m]", [9.0])  # by a run
    for level, refused in (15.0, False), (25.0, True):
        gmsh.onelab.setString(status, ["complete"])
        gmsh.onelab.setNumber("Parameters/1Water levels/20004Level 4 [m]", [level])
        gmsh.clear()
        gmsh.parser.clear()
        if refused:
            with pytest.raises(Exception, match="Level 4 = 25 m"):
                gmsh.open(str(project / "a.geo"))
        else:
            gmsh.open(str(project / "a.geo"))
        assert gmsh.onelab.getString(status) == ["changed: press Run"]
    gmsh.finalize()  # else it remains busy with the file that it could not read


@pytest.mark.heavy
def test_window_shows_the_level_of_a_run_that_stops(window, project):
    """A dam that slides without hardening: red, with the level."""
    words = "-setstring law friction -setstring uplift none -setnumber pena_tang 0"
    words += " -setnumber n_joint 10"  # the sliding level does not depend on the mesh
    picture = window(*words.split())("stopped")
    assert pixels(picture, RED) > 500 and not pixels(picture, GREEN) > 500
    assert "Error" not in (project / "res/a/status.geo").read_text()  # it opens a dialogue
    assert "stopped_at = 7.4" in (project / "res/a/stopped.geo").read_text()
