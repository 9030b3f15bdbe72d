"""The window, by its ONELAB server: open, change, run, stop, save; without a display but for the
last test, which presses Run in the window itself.
"""

import itertools
import json
import re
import shutil
import subprocess
import sys
from math import ceil
from types import SimpleNamespace

import gmsh
import numpy as np
import pytest
from damjoint.gui import tree, views, window
from damjoint.gui.camera import result_camera
from damjoint.gui.curves import METRES
from damjoint.gui.graphs import INTERVALS, MARGIN, Scale, thinned
from damjoint.gui.layout import ABOVE, ABOVE_AXES, BELOW, BELOW_AXES, BESIDE_AXES, Layout
from damjoint.gui.layout import MARGIN as MARGIN_OF_SCENE
from damjoint.gui.sheet import Request, case_text, check_request, titles
from damjoint.gui.views import caption
from damjoint.gui.window import ACTION, Session
from damjoint.gui.worker import EngineProcess
from damjoint.input.resolve import load
from damjoint.mesh.mesh import mesh_of
from damjoint.statics.hints import hints
from damjoint.studies.check import compare_joints
from damjoint.units import LENGTHS
from PIL import Image
from quakes import DAM, smooth_record

SMALL = {"n_joint": 10.0, "h_dam": 3.0, "h_found": 4.0}
WORDS = [word for name, value in SMALL.items() for word in ("--set", f"{name}={value}")]


class User:
    """Actions of a user: type, press, wait."""

    def __init__(self, engines, case, **settings):
        self.engines, self.session = engines, Session(Request(case, settings))
        self.wait()

    def close(self):
        """The next window uses the engine's process."""
        if not self.session.busy:
            self.engines.append(self.session.engine)
            self.session.engine = SimpleNamespace(close=lambda: None)
        self.session.close()
        self.session = None

    def wait(self, until=lambda session: not session.busy):
        """Until a condition is true; nothing changes any more once the engine is idle."""
        while not until(self.session):
            assert self.session.busy, self.session.status
            self.session.turn(0.02)

    def press(self, action):
        gmsh.onelab.setString(ACTION, [action])
        self.session.turn()

    def type(self, name, value):
        """Type into a field; name: of the parameter or of the tree entry."""
        known = self.session.tree.known
        label = known[name].label if name in known else name
        if isinstance(value, str):
            gmsh.onelab.setString(label, [value])
        else:
            gmsh.onelab.setNumber(label, [value])
        self.press("check")
        self.wait()
        return self.session.status

    def run(self):
        self.press("run")
        self.wait()
        return self.session.status

    def save(self, folder):
        gmsh.onelab.setString(tree.FOLDER, [str(folder)])
        self.press(tree.SAVE_ACTION)
        self.wait()
        assert self.session.status == f"saved: {folder}"

    def entry(self, name):
        known = self.session.tree.known
        return json.loads(gmsh.onelab.get(known[name].label if name in known else name))

    @property
    def views(self):
        return [gmsh.view.option.getString(tag, "Name") for tag in gmsh.view.getTags()]


class SharedEngine(EngineProcess):
    """The engine's process; a closed window's serves the next, as a start takes long."""

    ready, used = None, False

    def messages(self, wait=0.0):
        if self.used:
            self.used = False
            yield self.ready
        for message in super().messages(wait):
            if message[0] == "ready":
                self.ready = message
            yield message


@pytest.fixture(scope="module")
def engines():
    """Processes of closed windows."""
    unused = []
    yield unused
    for engine in unused:
        engine.close()


@pytest.fixture
def open_window(engines, monkeypatch):
    users = []

    def engine():
        if not engines:
            return SharedEngine()
        engines[-1].used = True
        return engines.pop()

    def opened(case, **settings):
        users.append(User(engines, case, **settings))
        return users[-1]

    monkeypatch.setattr(window, "EngineProcess", engine)
    yield opened
    for user in users:
        if user.session:
            user.close()


@pytest.mark.heavy
def test_nothing_to_save_before_a_run(open_window, engines):
    """First, as it needs a process that has run nothing."""
    while engines:
        engines.pop().close()
    user = open_window("e")
    user.press(tree.SAVE_ACTION)
    user.wait()
    assert user.session.status == "nothing to save: press Run first"


def test_all_parameters_are_in_the_tree_with_their_range_and_without_buttons_of_no_effect(
    open_window,
):
    user = open_window("a")
    assert user.session.status == "ready: press Run"
    for name, parameter in user.session.tree.known.items():
        entry = user.entry(name)
        assert entry["help"].startswith(f"{name}: {parameter.allowed()}")
        if entry["type"] == "number":  # loop and graph buttons would have no effect
            choices = entry.get("choices", [])
            assert entry["step"] == 0
            if choices not in ([], [0, 1]):
                assert len(entry["valueLabels"]) == len(choices)
    assert user.entry(tree.CASE)["valueLabels"].keys() >= {"dam: own dam", "open a case file ..."}
    assert len(user.entry(tree.CASE)["choices"]) == len(user.session.tree.titles) + 1
    assert tree.get_text(tree.LEVELS) == "3, 6, 8, 9"


@pytest.mark.heavy
def test_only_what_matters_shows_and_followers_say_what_they_follow(open_window):
    user = open_window("a")
    assert user.entry("sigma_max")["visible"] and not user.entry("mu")["visible"]
    assert not user.entry("thickness")["visible"] and not user.entry("visc")["visible"]
    user.type("law", "friction")
    assert user.entry("mu")["visible"] and not user.entry("sigma_max")["visible"]
    user.type("E", 2e10)
    entry = user.entry("E_dam")
    assert entry["values"] == [2e10] and "= 2e+10 (-1: E)" in entry["help"]
    assert entry["label"] == "Young's modulus of the dam [Pa], follows"
    assert entry["attributes"]["Highlight"] == tree.FOLLOWS
    assert user.session.tree.sheet.case["E_dam"] == 2e10
    user.type("E_dam", 3e10)
    assert user.session.tree.sheet.case["E_dam"] == 3e10
    assert user.entry("E_dam")["label"] == "Young's modulus of the dam [Pa]"
    assert "Highlight" not in user.entry("E_dam")["attributes"]
    user.type("E_dam", -1.0)
    assert user.entry("E_dam")["values"] == [2e10]
    assert user.session.tree.sheet.case["E_dam"] == 2e10


@pytest.mark.heavy
def test_results_and_saved_case_are_those_of_the_command(open_window, command, tmp_path):
    """The same bytes, from the command line and from the saved case file."""
    user = open_window("a", **SMALL)
    user.type("law", "friction")
    user.type("uplift", "flow")
    user.type(tree.LEVELS, "3, 5,6")
    user.type(tree.TAIL_LEVELS, "0,1,1")
    user.type(tree.STEPS, "2")
    assert tree.get_text(tree.TIMES) == "0.5, 1, 1.5, 2, 2.5, 3"
    assert user.run().startswith(("done in", "sliding"))
    user.save(tmp_path / "window")
    user.close()
    words = "--set", "law=friction", "--set", "uplift=flow", "--steps", "2"
    levels = "--levels", "3,5,6", "--tail-levels", "0,1,1"
    command("run", "a", *WORDS, *words, *levels, "--out", "batch")
    command("run", tmp_path / "window" / "a.case", "--out", "again")
    saved = sorted(p.relative_to(tmp_path / "window") for p in (tmp_path / "window").rglob("*.*"))
    for folder in ("batch", "again"):
        found = sorted(p.relative_to(tmp_path / folder) for p in (tmp_path / folder).rglob("*.*"))
        assert [p for p in saved if p.name != "a.case"] == found
        for name in ("joint.csv", "history.csv"):
            one, other = ((tmp_path / f / name).read_bytes() for f in ("window", folder))
            assert one == other


def numbers_shown(user):
    """The rows of numbers in the tree: value by label."""
    entries = [user.entry(name) for name in gmsh.onelab.getNames(f"{tree.NUMBERS}.*")]
    assert all(entry["readOnly"] and entry["attributes"]["Highlight"] for entry in entries)
    return {entry["label"]: entry["values"][0] for entry in entries}


@pytest.mark.heavy
def test_results_of_the_step_shown_are_in_the_tree_beside_the_gravity_method(open_window):
    """In units that suit their size; safety factors as those of `damjoint check`."""
    user = open_window("c", **SMALL)
    user.run()
    (scene,) = user.session.scenes
    result, shown = scene.result, numbers_shown(user)
    check = compare_joints(result)[0]
    both = [method.numbers for method in (check.finite_elements, check.gravity)]
    for label, column, factor in (
        ("N' [kN/m]", "N", 1e-3),
        ("N' at x [m]", "x_resultant", 1),
        ("SSF with mu, adhesion", "SSF", 1),
        ("OSF", "OSF", 1),
    ):
        values = [float(text) for text in shown[label].split(" | ")]
        assert values == pytest.approx([n[column] * factor for n in both], rel=5e-3), label
    assert shown["At t = 4"] == "finite elements | gravity method"
    assert shown["level [m]"] == "9" and not any("leakage" in label for label in shown)
    assert tree.get_text(tree.VERDICT) == "sliding"
    user.session.gallery.set_step(0)  # as Gmsh's arrows do
    user.session.turn()
    first = numbers_shown(user)
    assert first["level [m]"] == "3" and "At t = 1" in first
    uplift = float(first["uplift U [kN/m]"].partition(" | ")[0])
    assert 1e3 * uplift == pytest.approx(result.state(1.0)["U"], rel=5e-3)


@pytest.mark.heavy
def test_warnings_of_the_command_line_are_shown(open_window):
    user = open_window("g", **SMALL, mu=0.9)
    user.run()
    (scene,) = user.session.scenes
    notes = [text for label, text in numbers_shown(user).items() if label.startswith("Note")]
    assert notes == scene.warnings == hints(scene.result) and len(notes) >= 2
    start = "! the foundation reaches 5 m"
    assert any(line.startswith(start) for line in shown_results()[2])


@pytest.mark.heavy
def test_playing_shows_all_steps_with_their_numbers(open_window, monkeypatch):
    """From the first level to the last one; pressed again it stops, and a change ends it."""
    monkeypatch.setattr(window.export, "LEVEL", 0.05)
    user = open_window("c", **SMALL)
    user.press(tree.PLAY_ACTION)  # nothing to play
    assert user.session.next_play is None
    user.run()
    levels = []
    user.press(tree.PLAY_ACTION)
    while user.session.next_play is not None:
        levels.append(numbers_shown(user)["level [m]"])
        user.session.turn(0.01)
    assert list(dict.fromkeys(levels)) == ["3", "6", "8", "9"]
    user.press(tree.PLAY_ACTION)
    user.press(tree.PLAY_ACTION)
    assert user.session.next_play is None and user.session.gallery.step < 3


def test_lines_mark_the_step_shown_in_the_curves_of_the_level(open_window):
    """Over the level and the opening, crest and crack; the level of each step at its height."""
    user = open_window("c", **SMALL)
    user.run()
    assert user.views.count("level shown") == user.views.count("now") == 3
    _, (count,), (values,) = gmsh.view.getListData(tagged(user, "level shown"))
    heights = values.reshape(count, -1)[1, 6:].reshape(-1, 2)  # of both ends, step by step
    history = user.session.scenes[0].result.history["level"]
    scale = Scale.of(history, METRES)
    np.testing.assert_allclose(heights[:, 0], scale.intervals(np.array([3.0, 6.0, 8.0, 9.0])))
    np.testing.assert_allclose(heights[:, 0], heights[:, 1])


@pytest.mark.heavy
def test_nothing_above_the_parameters_moves_when_a_run_ends(open_window):
    """The same rows before and after it, and the case in the window's title."""
    user = open_window("a", **SMALL)
    above = lambda: [
        n for n in gmsh.onelab.getNames() if n < "0Modules" and user.entry(n)["visible"]
    ]
    before = above()
    assert {tree.FIELD, tree.JOINT, tree.UPLIFT, tree.MOTION, tree.VERDICT} <= set(before)
    assert gmsh.model.getFileName() == "a: A: rupture, 2D, order 1"
    user.run()
    assert above() == before and gmsh.onelab.getNames(f"{tree.NUMBERS}.*")


@pytest.mark.heavy
def test_the_table_shows_all_levels_and_marks_the_one_shown(open_window):
    user = open_window("c", **SMALL)
    user.run()
    user.type(tree.CONTENT, views.TABLE)
    table, lines = user.session.scenes[0].table, shown_results()[2]
    assert len(table.rows) == 4 and {"SSF", "OSF", "N' in"} <= set(table.names)
    assert all(cell in lines for row in table.rows for cell in row)
    assert [line for line in lines if line == ">"] == [">"]
    assert user.type(tree.CONTENT, views.SCENE).startswith("sliding")
    assert any(name.startswith("displacement") for name in user.views)


@pytest.mark.heavy
def test_a_softening_joint_has_a_length_and_a_colour(open_window):
    coarse = {"n_joint": 20.0, "h_dam": 8.0, "h_found": 30.0}
    user = open_window("dam", law="bond", sigma_max=3e5, G_f=300.0, **coarse)
    user.type(tree.LEVELS, "40, 48")
    user.run()
    (scene,) = user.session.scenes
    zone = scene.result.last["process_zone"]
    assert float(numbers_shown(user)["softening [m]"]) == pytest.approx(zone, rel=5e-3)
    assert zone > 5 and user.views.count("joint softening") == 1
    assert "joint softening" in shown_results()[2]
    before, now = (caption(scene, step)[1] for step in range(2))
    assert "softening" not in before and now.endswith(f"crack 0 m, softening {zone:.3g} m")


@pytest.mark.heavy
def test_fields_and_scales_can_be_chosen(open_window):
    """Vertical stress replaces displacement, on the same deformed bodies; zero is in the middle of
    its scale; the scales are those of the step shown or of all steps.
    """
    user = open_window("a", **SMALL, uplift="none")
    user.run()
    option = lambda name: gmsh.view.option.getNumber(tagged(user, "displacement"), name)
    assert option("ExternalView") == -1 and option("RangeType") == 3  # each step has its range
    user.type(tree.SCALES, views.OF_ALL)
    assert option("RangeType") == 1
    user.type(tree.FIELD, views.STRESS)
    stress = tagged(user, "vertical stress")
    assert option("ExternalView") == gmsh.view.getIndex(stress)
    assert option("CustomMax") == -option("CustomMin") > 0
    of_all = option("CustomMax")
    user.type(tree.SCALES, views.OF_LEVEL)
    user.session.gallery.set_step(0)
    assert 0 < option("CustomMax") < of_all
    user.type("dam_crest", 2.0)
    user.run()  # the choices remain
    assert tree.display() == views.Display(field=views.STRESS)
    assert option("ExternalView") == gmsh.view.getIndex(tagged(user, "vertical stress"))


def tagged(user, start):
    """Tag of the first view whose name starts so."""
    names = zip(gmsh.view.getTags(), user.views, strict=True)
    return next(tag for tag, name in names if name.startswith(start))


@pytest.mark.heavy
def test_views_have_a_step_per_level_and_replace_the_earlier_ones(open_window):
    user = open_window("c", **SMALL)
    user.run()
    views = user.views
    for name in ("displacement [µm]", "water", "joint broken", "joint slipped"):
        assert name in views
    for start in (
        "opening",
        "slip, jump",
        "normal stress, total",
        "shear stress",
        "water pressure",
    ):
        assert start in views
    assert views.count("level") == 3
    for tag, name in zip(gmsh.view.getTags(), views, strict=True):
        data = gmsh.view.getListData(tag)
        if name == "displacement [µm]":
            corners = {"VQ": 4, "VT": 3}
            for kind, count, values in zip(*data, strict=True):
                steps = (len(values) / count / corners[kind] - 3) / 3
                assert steps == len(user.session.scenes[0].times) == 4
    user.run()
    assert user.views == views
    user.type(tree.KEEP, 1.0)
    user.type("mu", 0.7)
    user.run()
    assert "run 1: displacement [µm]" in user.views and "displacement [µm]" in user.views
    assert "opening, before" in user.views and "earlier runs" in shown_results()[2]
    user.type(tree.KEEP, 0.0)
    user.run()
    assert not any("run 1" in view for view in user.views)


@pytest.mark.heavy
def test_the_status_shows_whether_the_results_belong_to_the_parameters(open_window):
    user = open_window("c", **SMALL)
    done = user.run()
    assert user.type(tree.KEEP, 1.0) == done
    assert user.type("dam_crest", 2.0) == "changed since the run: press Run"
    visible = [gmsh.view.option.getNumber(tag, "Visible") for tag in gmsh.view.getTags()]
    assert sum(visible) == 4  # water beside the new outline with its level, and the heading
    assert user.type("dam_crest", 1.5) == done
    visible = [gmsh.view.option.getNumber(tag, "Visible") for tag in gmsh.view.getTags()]
    assert sum(visible) == len(visible) - 2  # all but the water before the run


#: Options of a view
SHOWN = "Visible", "TimeStep", "NbTimeStep"


def shown_results():
    """The verdict, the names of the numbers beside it, and the visible lines of text."""
    numbers = gmsh.onelab.getNames(f"{tree.NUMBERS}.*")
    lines = []
    for tag in gmsh.view.getTags():
        option = {n: gmsh.view.option.getNumber(tag, n) for n in SHOWN}
        if option["Visible"]:  # each text has a line for each step
            texts = gmsh.view.getListDataStrings(tag, 2)[1]
            lines += texts[int(option["TimeStep"]) :: int(option["NbTimeStep"])]
    lines = [line for line in lines if line.strip()]
    return tree.get_text(tree.VERDICT), numbers, lines


@pytest.mark.heavy
def test_results_of_other_parameters_are_removed_at_once(open_window):
    """Before the engine has answered: after a change of a parameter, of the case, a bad value, and
    Run pressed right after it; they return with the parameter.
    """
    user = open_window("c", **SMALL)
    assert shown_results() == (
        "not run yet",
        [],
        ["C: friction, 2D, order 1, quadrangles", C_SCENE],
    )
    user.run()
    assert user.views.count("displacement [µm]") == 1
    before = verdict, numbers, lines = shown_results()
    assert verdict == "sliding" and len(numbers) > 10 and C_SCENE in lines
    mu, own = user.session.tree.known["mu"].label, user.session.tree.sheet.case["mu"]
    for value, found in ((0.7, ("not run yet", [])), (own, before[:2])):
        gmsh.onelab.setNumber(mu, [value])
        user.press("check")
        assert shown_results()[:2] == ("not run yet", [])
        assert not any("level" in line for line in shown_results()[2])
        user.wait()
        assert shown_results()[:2] == found
    assert shown_results() == before
    for case in (float(len(titles())), 0.0):  # "open a case file ...", and modeling A
        gmsh.onelab.setNumber(tree.CASE, [case])
        user.press("check")
        assert shown_results()[:2] == ("not run yet", [])
    user.press("run")
    assert user.session.busy == "running" and shown_results()[:2] == ("not run yet", [])
    user.wait()
    assert shown_results()[0] == "stands"
    assert "A: rupture, 2D, order 1" in shown_results()[2]


#: The second line of modeling C's heading.
C_SCENE = "law friction, uplift imposed"


@pytest.mark.heavy
def test_the_heading_follows_law_and_water(open_window):
    user = open_window("c", **SMALL)
    user.run()
    user.type("law", "rupture")
    user.type("uplift", "none")
    changed = ["case c, changed", "law rupture, uplift none"]
    assert shown_results()[2] == changed
    user.run()
    assert [line for line in shown_results()[2] if line in changed] == changed
    assert not any("friction" in line for line in shown_results()[2])
    user.type("law", "friction")
    user.type("uplift", "imposed")
    assert shown_results()[2] == ["C: friction, 2D, order 1, quadrangles", C_SCENE]


def test_the_drawing_follows_the_geometry_and_can_be_meshed(open_window):
    user = open_window("e")
    assert gmsh.model.getBoundingBox(-1, -1)[4] == pytest.approx(10, abs=1e-6)
    user.type("dam_height", 12.0)
    assert gmsh.model.getBoundingBox(-1, -1)[4] == pytest.approx(12, abs=1e-6)
    assert user.views == ["water", "labels of the loads", "text", "text"]
    gmsh.model.mesh.generate(2)
    assert len(gmsh.model.mesh.getNodes()[0]) > 100


def test_lift_joints_are_drawn(open_window, tmp_path):
    mine = tmp_path / "mine.case"
    mine.write_text("lift_heights() = {20}; levels() = {30};")
    open_window(str(mine))
    heights = [gmsh.model.getBoundingBox(*curve)[4] for curve in gmsh.model.getEntities(1)]
    assert pytest.approx(20, abs=1e-6) in heights


def test_the_corners_of_the_downstream_face_can_be_changed(open_window, tmp_path):
    mine = tmp_path / "mine.case"
    mine.write_text("downstream_face() = {30, 12, 12, 30}; levels() = {30};")
    user = open_window(str(mine))
    assert tree.get_text(tree.CORNERS) == "30, 12, 12, 30"

    def corner(x, y):
        points = (gmsh.model.getBoundingBox(*point)[:2] for point in gmsh.model.getEntities(0))
        return any(point == pytest.approx((x, y), abs=1e-6) for point in points)

    assert corner(30, 12) and corner(12, 30)
    user.type(tree.CORNERS, "25, 14")
    assert corner(25, 14) and not corner(12, 30)
    sheet = user.session.tree.sheet
    (tmp_path / "saved.case").write_text(case_text(sheet, sheet.case))
    user.type(tree.CORNERS, "none")
    assert not corner(25, 14) and not user.session.tree.sheet.case.downstream_face
    # last: it parses in the database of the window
    assert load(str(tmp_path / "saved.case")).downstream_face == (25, 14)


@pytest.mark.heavy
def test_each_joint_of_a_case_with_several_is_shown_and_saved(open_window, command, tmp_path):
    """A changed value is that of all joints, heights can change; the saved case: the same bytes."""
    mine = tmp_path / "mine.case"
    mine.write_text(
        'lift_heights() = {15, 25}; default_law = "friction"; default_mu = 1; levels() = {30};'
        'default_uplift = "drained"; Struct Joint::base [ law "bond", mu 0.9 ];'
    )
    user = open_window(str(mine), **SMALL)
    law = user.entry("law")
    assert law["values"] == ["bond"] and law["label"] == "Joint law = bond, friction, friction"
    assert user.entry("G_t")["visible"] and user.entry("pena_tang")["visible"]
    assert tree.get_text(tree.LIFTS) == "15, 25"
    user.type(tree.LIFTS, "15, 20")
    user.type("mu", 0.8)
    assert user.run().startswith("done in")
    assert sorted(user.entry(tree.JOINT)["choices"]) == ["base", "lift 15 m", "lift 20 m"]
    for scene in user.session.scenes:
        user.type(tree.JOINT, scene.choices[0])
        assert numbers_shown(user)["Joint"] == scene.choices[0]
        normal = scene.joint_result.last["N"]
        assert scene.numbers[0].elements["N"] == normal
        assert scene.numbers[0].rigid["N"] == pytest.approx(normal, rel=1e-8)
    user.save(tmp_path / "window")
    user.type(tree.LIFTS, "none")
    assert not user.session.tree.sheet.case.of_joints
    user.close()
    saved = load(str(tmp_path / "window/mine.case"))
    assert [j["law"] for j in saved.joints] == ["bond", "friction", "friction"]
    assert [j["mu"] for j in saved.joints] == [0.8, 0.8, 0.8]
    assert command("run", tmp_path / "window/mine.case", "--out", tmp_path / "again")[0] == 0
    for name in ("joint.csv", "history.csv"):
        one, other = ((tmp_path / folder / name).read_bytes() for folder in ("window", "again"))
        assert one == other


def test_a_saved_case_has_its_own_geometry(tmp_path):
    sheet = check_request(Request("monoliths", {"K_N": 5e10}))
    (tmp_path / "saved.case").write_text(case_text(sheet, sheet.case))
    saved = load(str(tmp_path / "saved.case"))
    assert saved.geometry.samefile(sheet.case.geometry)
    assert saved.values == sheet.case.values and saved.of_joints == sheet.case.of_joints


def test_all_blocks_of_a_dam_are_shown():
    case = load("monoliths", {"n_joint": 8.0, "dim": 3.0})
    mesh = mesh_of(case)
    dam = np.concatenate([mesh.bodies[name].points for name in ("dam", "dam 2")])
    box = result_camera(case, mesh.bodies).box
    assert (box[0] <= dam.min(axis=0)).all() and (box[1] >= dam.max(axis=0)).all()


def test_lists_of_several_joints_on_the_command_line(open_window):
    user = open_window("dam", lift_heights=(15.0,), mu=(0.9, 1.0), **SMALL)
    assert user.entry("mu")["label"] == "Friction coefficient mu = 0.9, 1"
    assert len(user.session.tree.sheet.case.joints) == 2


BAD_VALUES = [
    (tree.LEVELS, "3, 60", "Levels at t = 1, 2, ... [m] = 60: must be between 0 and 20 m"),
    (tree.LEVELS, "high", "Levels at t = 1, 2, ... [m] = high: must be a list of levels in metres"),
    (tree.TAIL_LEVELS, "1, 2", "Tailwater [m] = 1,2: must be one level or as many"),
    (tree.STEPS, "0", "Steps between two levels = 0: must be an integer >= 1"),
    (tree.STEPS, "two", "Steps between two levels = two: must be an integer >= 1"),
    (tree.ACCURACY, "best", "Accuracy = best: must be one of coarse, standard, fine"),
    (tree.FILE, "nowhere.case", "case nowhere.case: there is no such file"),
    (tree.CASE, float(len(titles())), "case file: choose it"),
    ("nu", 0.6, "Poisson's ratio of dam and foundation = 0.6: must be a number >= 0 and < 0.5"),
    ("n_joint", 10.5, "Elements from heel to toe = 10.5: must be an integer"),
    ("law", "glue", "Joint law = glue: must be one of rupture, friction"),
]


@pytest.mark.heavy
def test_a_bad_value_is_reported_in_one_line_and_not_run(open_window):
    """One after the other in one window; with the value of before the case runs again."""
    user = open_window("e", **SMALL)
    user.type(tree.LEVELS, "3")
    for name, value, why in BAD_VALUES:
        before = gmsh.onelab.getNumber(name) if isinstance(value, float) and "/" in name else None
        was = tree.value_of(name) if "/" in name else user.session.tree.sheet.case[name]
        shown = user.type(name, value)
        assert shown.startswith(why) and "\n" not in shown and "[-])" not in shown
        if "must be" in why:  # beside the field, too, until it is good
            field = user.session.tree.marked
            assert field == (name if "/" in name else user.session.tree.known[name].label)
            entry = gmsh.onelab.get(field)  # Gmsh does not escape quotes
            assert ": must be" in entry and re.search(f'"Highlight":"{tree.BAD}"', entry)
        scenes = user.session.scenes
        assert user.run().startswith(why) and user.session.scenes is scenes
        assert user.entry(tree.STATUS)["attributes"]["Highlight"] == tree.BAD
        user.type(name, before[0] if before is not None else was)
        assert user.run().startswith("done in"), name
        assert not user.session.tree.marked and ": must be" not in gmsh.onelab.get(field)


@pytest.mark.heavy
def test_buttons_pressed_during_a_run_act_after_it(open_window, tmp_path):
    user = open_window("c", **SMALL)
    done = user.run()
    gmsh.onelab.setString(tree.FOLDER, [str(tmp_path / "c")])
    user.press(tree.SAVE_ACTION)
    user.press("run")
    user.press("check")
    user.wait()
    assert user.session.status.startswith(done.partition("(")[0])
    assert (tmp_path / "c" / "joint.csv").exists()


@pytest.mark.heavy
def test_stop_keeps_the_converged_steps(open_window, tmp_path):
    user = open_window("e", **SMALL)
    user.type(tree.STEPS, "200")
    user.press("run")
    user.wait(lambda session: re.search(r"level [3-8]\.", session.status))
    assert gmsh.onelab.getString("ONELAB/Button") == ["Stop", "stop"]
    user.press("stop")
    user.wait()
    assert re.match(r"interrupted at level [3-8]\.?\d* m, t = \S+ of \d+ \(", user.session.status)
    assert gmsh.onelab.getString("ONELAB/Button") == ["Run", "run"]
    scene = user.session.scenes[0]
    times = scene.result.history["time"]
    assert len(times) > 200 and list(scene.times) == [*range(1, ceil(times[-1])), times[-1]]
    assert any(name.startswith("displacement [") for name in user.views)
    user.save(tmp_path / "stopped")
    assert json.loads((tmp_path / "stopped/run.json").read_text())["state"] == "interrupted"
    user.press("run")
    user.press("stop")
    user.press("stop")
    user.wait()
    assert user.session.status in ("stopped at once, no results", "stopped before the first step")
    user.type(tree.STEPS, "1")
    assert user.run().startswith("done in")


@pytest.mark.heavy
def test_after_reset_the_parameters_are_restored(open_window):
    """Reset in the menu of Gmsh beside Run."""
    user = open_window("a")
    user.type("E", 1e10)
    gmsh.onelab.clear()
    user.press("reset")
    user.wait()
    assert user.entry("E")["values"] == [3e12] and tree.get_text(tree.SAVE)
    assert gmsh.onelab.getString("ONELAB/Button") == ["Run", "run"]


@pytest.mark.heavy
def test_a_case_file_of_the_user_is_not_overwritten(open_window, tmp_path):
    """Nor the target of a link; a file saved by the window itself is overwritten."""
    user = open_window("c", **SMALL)
    user.run()
    own, behind = tmp_path / "own" / "c.case", tmp_path / "behind.txt"
    for folder in ("own", "linked", "new"):
        (tmp_path / folder).mkdir()
    own.write_text("// mine\n")
    behind.write_text("mine, too\n")
    (tmp_path / "linked" / "c.case").symlink_to(behind)
    for folder in ("own", "linked"):
        gmsh.onelab.setString(tree.FOLDER, [str(tmp_path / folder)])
        user.press(tree.SAVE_ACTION)
        user.wait()
        assert user.session.status.endswith(
            "must not have a c.case of your own; choose another folder"
        )
        assert [p.name for p in (tmp_path / folder).iterdir()] == ["c.case"]
    assert own.read_text() == "// mine\n" and behind.read_text() == "mine, too\n"
    user.save(tmp_path / "new")
    user.save(tmp_path / "new")
    gmsh.onelab.setString(tree.FOLDER, [""])
    user.press(tree.SAVE_ACTION)
    user.wait()
    assert user.session.status == "out: name a folder"


@pytest.mark.heavy
def test_an_engine_that_was_killed_is_started_again(open_window):
    """Killed during a run, as if memory were exhausted."""
    user = open_window("e", **SMALL)
    user.type(tree.STEPS, "2000")
    user.press("run")
    user.wait(lambda session: " level " in session.status)
    user.session.engine.process.kill()
    user.wait()
    assert user.session.status == "the engine's process ended (exit code -9): press Run"
    user.type(tree.STEPS, "1")
    assert user.run().startswith("done in")


def test_the_reason_of_a_stop_is_shown(open_window):
    user = open_window("c", **SMALL, pena_tang=0.0)
    status = user.run()
    assert status.startswith("sliding: no equilibrium beyond level")
    assert user.entry(tree.STATUS)["attributes"]["Highlight"] == tree.WARN


@pytest.mark.heavy
def test_other_cases_and_files_can_be_opened(open_window, tmp_path):
    user = open_window("a", **SMALL)
    user.run()
    user.type(tree.CASE, float(list(user.session.tree.titles).index("dam")))
    assert user.session.tree.sheet.case.name == "dam" and user.views[0] == "water"
    assert tree.get_text(tree.LEVELS) == "30, 40, 45"
    assert user.session.tree.sheet.request.overrides == {}
    mine = tmp_path / "mine.case"
    mine.write_text("default_dam_height = 20; default_dam_base = 16; levels() = {15, 18};")
    user.type(tree.FILE, str(mine))
    assert tree.get_text(tree.LEVELS) == "15, 18" and "mine" in user.entry(tree.CASE)["valueLabels"]
    user.type("dam_height", 21.0)
    assert user.session.tree.sheet.case.name == "mine"
    assert "unknown; allowed" in user.type(tree.FILE, 5000 * "x")
    user.type(tree.FILE, "")  # no file chosen: the case stays
    assert user.run().startswith("done in")


@pytest.mark.heavy
def test_both_uplifts_of_a_published_case_are_run(open_window):
    user = open_window("a", **SMALL)
    user.run()
    assert user.entry(tree.UPLIFT)["choices"] == ["imposed", "none"]
    assert any(view.startswith("water pressure") for view in user.views)
    user.type(tree.UPLIFT, "none")
    assert not any(view.startswith("water pressure") for view in user.views)
    user.type("uplift", "imposed")  # the value of the case: both again
    user.run()
    assert len(user.session.scenes) == 2


@pytest.mark.heavy
def test_an_earthquake_follows_the_static_loads(open_window, command, tmp_path):
    """With the switch on its parameters appear; its results are those of the command, at the times
    chosen; without it nothing of it is left.
    """
    small = {n: v for n, v in DAM.items() if n != "record_unit"}
    user = open_window("dam", **small | {"dt": 0.005, "record_rest": 0.5})
    hidden = "record_scale", "quake_uplift", tree.RECORD, tree.FRAMES
    assert not any(user.entry(name)["visible"] for name in hidden)
    user.type(tree.LEVELS, "30")
    assert user.type(tree.QUAKE, 1.0) == "Record: CSV file: must be chosen"
    assert all(user.entry(name)["visible"] for name in hidden)
    assert user.run() == user.entry(tree.RECORD)["label"] == "Record: CSV file: must be chosen"
    record = smooth_record(tmp_path / "wave.csv", 5.0, duration=0.5)
    assert "= unstated: must be m/s2 or g" in user.type(tree.RECORD, str(record))
    assert user.entry("record_unit")["attributes"]["Highlight"] == tree.BAD
    assert user.type("record_unit", "m/s2") == "ready: press Run"
    assert "Highlight" not in user.entry("record_unit").get("attributes", {})
    assert "must be two times" in user.type(tree.FRAMES, "0.5")
    user.type(tree.FRAMES, "0:0.5")
    assert user.run().startswith("done in") and "residual slip" in user.session.status
    before, earthquake = user.session.scenes
    assert before.times.tolist() == [1] and len(earthquake.times) == 101
    strength, against = (earthquake.quake[name] for name in ("strength", "strength against"))
    assert strength.min() >= 0 and np.array_equal(against, -strength)
    assert (np.abs(earthquake.quake["T"]) <= strength * (1 + 1e-6)).all()
    assert user.entry(tree.MOTION)["choices"] == ["static loads", "earthquake"]
    user.session.gallery.set_step(40)
    user.session.turn()
    shown, (_, _, lines) = numbers_shown(user), shown_results()
    assert "At t = 0.2 s" in shown and "residual slip" in shown and "ground acceleration" in shown
    assert any(line.startswith("t = 0.200 s of 1 s") for line in lines)
    assert {"law friction, uplift imposed, wave.csv", "slip [mm]", "crest movement [mm]"} <= set(
        lines
    )
    user.save(tmp_path / "window")
    user.type(tree.CONTENT, views.TABLE)
    assert {"ground", "slip"} <= set(shown_results()[2])
    user.type(tree.CONTENT, views.SCENE)
    user.type(tree.MOTION, "static loads")
    assert any(line.startswith("level 30 m") for line in shown_results()[2])
    user.type(tree.QUAKE, 0.0)
    assert tree.get_text(tree.VERDICT) == tree.NOT_RUN
    assert user.run().startswith("done in") and len(user.session.scenes) == 1
    user.close()
    code, _, _ = command("quake", tmp_path / "window" / "dam.case", "--out", "again")
    assert code == 0
    for name in ("quake.csv", "joint.csv", "history.csv"):
        one, other = ((tmp_path / f / name).read_bytes() for f in ("window", "again"))
        assert one == other
    assert (tmp_path / "window" / "fields" / "dam_t0.2.vtu").exists()


@pytest.mark.heavy
def test_stop_keeps_the_steps_of_an_earthquake(open_window, tmp_path):
    record = smooth_record(tmp_path / "wave.csv", 1.0, duration=20.0)
    user = open_window("dam", **DAM)
    user.type(tree.LEVELS, "30")
    user.type(tree.RECORD, str(record))
    user.type(tree.QUAKE, 1.0)
    user.press("run")
    user.wait(lambda session: session.live)  # its results so far, while it is computed
    assert tree.get_text(tree.VERDICT) == "running" and user.session.busy == "running"
    live = len(user.session.scenes[1].times)
    assert any(" s (running), ground acceleration" in line for line in shown_results()[2])
    assert live > 1 and numbers_shown(user)["At t = " + f"{user.session.scenes[1].times[-1]:.4g} s"]
    user.wait(lambda session: len(session.scenes[1].times) > live)
    user.press("stop")
    user.wait()
    assert re.match(r"interrupted after t = [\d.]+ s of the record", user.session.status)
    earthquake = user.session.scenes[1]
    assert len(earthquake.times) > 1 and earthquake.end_state == "interrupted"
    user.save(tmp_path / "stopped")
    assert json.loads((tmp_path / "stopped/run.json").read_text())["state"] == "interrupted"


def test_accuracy_refines_the_mesh(open_window):
    user = open_window("a")
    user.type(tree.ACCURACY, "coarse")
    assert (user.entry("n_joint")["values"], user.entry("order")["values"]) == ([32], [2])
    user.type(tree.ACCURACY, tree.OWN)
    assert (user.entry("n_joint")["values"], user.entry("order")["values"]) == ([50], [1])


@pytest.mark.heavy
def test_the_joint_in_3d_is_shown_as_a_surface(open_window):
    user = open_window("f", n_joint=8.0, h_dam=3.0, h_found=4.0)
    assert user.run().startswith("done in")
    for name in ("opening [µm]", "state: as in the legend", "water pressure [kPa]"):
        assert name in user.views, name
    opening = tagged(user, "opening [")
    ends = [gmsh.view.option.getNumber(opening, f"Custom{end}") for end in ("Min", "Max")]
    assert ends[0] == -ends[1] < 0  # zero is in the middle of the scale
    _, counts, values = gmsh.view.getListData(tagged(user, "state"))
    for count, block in zip(counts, values, strict=True):  # one state an element
        corners = 4
        of_element = block.reshape(count, -1)[:, 3 * corners :].reshape(count, -1, corners)
        assert (np.ptp(of_element, axis=2) == 0).all() and set(of_element.ravel()) <= {0, 1, 2, 3}


#: A batter, a neck, an inclined joint or a lift joint; water over the crest and below the dam.
SECTION = {"batter": 1.0, "batter_height": 5.0, "neck_height": 2.0}
LOADS = {"silt_height": 2.0, "ice_force": 1e3, "ice_level": 7.0, "anchor_force": 1e3, "k_h": 0.02}


@pytest.mark.heavy
@pytest.mark.parametrize("joint", [{"joint_slope": 5.0}, {"joint_height": 4.0}])
def test_water_and_loads_are_drawn_for_any_section(open_window, joint):
    """Before the run the water's area is that of the outline; after it nearly, as faces move."""
    user = open_window("e", **SMALL, **SECTION, **joint, **LOADS, uplift="imposed")
    user.type(tree.LEVELS, "6, 10.5")
    user.type(tree.TAIL_LEVELS, "0, 3")
    assert user.views[:4] == ["water", "silt", "forces", "labels of the loads"]
    case = user.session.tree.sheet.case
    base, side, bed = 5.0, case["found_side"], joint.get("joint_slope", 0.0)
    bed = base * np.tan(np.radians(bed))
    slope = (base - 2.5) / (8 - bed)  # downstream, from the bed to the neck
    expected = {
        # floor, batter, crest; bed and slope
        "water": 10.5 * side
        + 1 * (10.5 - 2.5)
        + 1.5 * 0.5
        + (3 - bed) * side
        + slope * (3 - bed) ** 2 / 2,
        "silt": 2 * side + 2 * 0.4 / 2,
    }
    tags = dict(zip(user.views, gmsh.view.getTags(), strict=True))
    for name, size in expected.items():
        _, (count,), (values,) = gmsh.view.getListData(tags[name])
        x, y, _ = values.reshape(count, -1)[:, :12].reshape(count, 3, 4).transpose(1, 0, 2)
        doubled = np.sum(x * np.roll(y, -1, 1) - np.roll(x, -1, 1) * y, axis=1)
        assert np.abs(doubled).sum() / 2 == pytest.approx(size, rel=1e-9), name
    assert not user.run().startswith("failed")
    for name in ("water", "silt", "forces"):
        assert name in user.views
    rows = user.session.scenes[0].result.at()
    graph = next(
        t for t in gmsh.view.getTags() if "shear stress" in gmsh.view.option.getString(t, "Name")
    )
    _, (count,), (values,) = gmsh.view.getListData(graph)
    shown = values.reshape(count, -1)[:, 1].max() - MARGIN
    end = Scale.of(rows["s"], METRES).intervals(rows["s"].max())
    assert shown == pytest.approx(end, rel=1e-6)


def test_a_missing_display_and_bad_input_are_reported_in_one_line(command, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert command("gui", "q")[::2][0] == 2
    code, _, error = command("gui", "a", "--set", "mu=-1")
    assert code == 2 and error.count("\n") == 1
    if sys.platform.startswith("linux"):
        code, _, error = command("gui", "a")
        assert code == 1 and "needs a display" in error


@pytest.mark.parametrize("size", [(1040, 880), (794, 608), (500, 600), (300, 200)])
def test_graphs_do_not_overlap_and_are_fewer_where_it_is_narrow(size):
    """Drawing areas of screens of 1600x1000 and 1280x720, and smaller ones."""
    layout = Layout(*size)
    assert layout.most_graphs == {1040: 8, 794: 4}.get(size[0], 0)
    width, height = layout.graph_size
    boxes = []
    for number in range(layout.most_graphs):
        x, y = layout.graph_position(number)
        left = layout.width + x
        boxes.append((left - BESIDE_AXES, left + width, y - ABOVE_AXES, y + height + BELOW_AXES))
        assert boxes[-1][0] >= layout.scene_width and boxes[-1][1] <= layout.width
        assert boxes[-1][2] >= 0 and boxes[-1][3] <= layout.height
    for (a0, a1, b0, b1), (c0, c1, d0, d1) in itertools.combinations(boxes, 2):
        assert min(min(a1, c1) - max(a0, c0), min(b1, d1) - max(b0, d0)) <= 0  # of their overlap


@pytest.mark.parametrize(
    ("values", "low", "interval", "unit"),
    [
        ([0, 0, 0], -2, 1, "mm"),  # in the middle
        ([1e-20, 0], -2, 1, "mm"),  # round-off
        ([0, 45], 0, 15, "m"),
        ([-3e-6, 1.4e-6], -3, 1.5, "µm"),
        ([-586, -100], -600, 150, "m"),
        ([-3e-7, 1.17e-3], 0, 0.3, "mm"),  # hardly below zero
    ],
)
def test_a_scale_has_round_ticks_and_covers_its_values_and_zero(values, low, interval, unit):
    scale = Scale.of(np.array(values, float), LENGTHS)
    places = scale.intervals(np.array([*values, 0.0]))
    assert places.min() >= -1e-3 and places.max() <= INTERVALS + 1e-3
    assert (scale.interval, scale.unit) == (pytest.approx(interval), unit)
    assert scale.low == pytest.approx(low)


def test_dense_curves_are_thinned_but_for_bends():
    """A spike of one point and a corner remain; points closer than a few pixels go."""
    x = np.linspace(0, 4, 2001)
    y = np.where(np.arange(2001) == 700, 3.0, np.maximum(x - 2, 0.0))[None]
    thin_x, thin_y = thinned(x, y)
    assert len(thin_x) < 80 and 3.0 in thin_y
    assert np.abs(np.interp(x, thin_x, thin_y[0]) - y[0]).max() < 0.03  # about a pixel


@pytest.mark.heavy
@pytest.mark.parametrize("screen", [(1600, 1000), (1280, 720)])
def test_run_in_the_window_on_a_virtual_screen(tmp_path, screen):
    """Opened no larger than the screen, clicked, finished, exported, resized under Xvfb; the
    screenshots stay in tmp_path.
    """
    missing = [n for n in ("Xvfb", "xvfb-run", "xdotool", "import") if not shutil.which(n)]
    if missing:
        pytest.skip(f"needs {', '.join(missing)} (apt: xvfb xdotool imagemagick)")
    script = tmp_path / "press.sh"
    script.write_text(PRESS.format(python=sys.executable))
    server = f"-noreset -screen 0 {screen[0]}x{screen[1]}x24"
    words = ["xvfb-run", "-a", "-s", server, "sh", str(script)]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    output = done.stdout + done.stderr
    assert done.returncode == 0, output
    assert "done in" in output and "exported: out/e/window.gif" in output
    top, width, height = map(int, re.search(r"window (\d+): (\d+) x (\d+)", output).groups())
    assert width <= screen[0] and 30 <= top and screen[1] - 10 <= height <= screen[1]
    assert "title Gmsh - e: E: rupture" in output
    areas = [tuple(map(float, size)) for size in re.findall(r"area (\S+) x (\S+)", output)]
    assert areas[-1][0] < areas[0][0] and areas[-1][1] < areas[0][1]  # after the resize
    for name in ("window", "resized"):
        assert (tmp_path / f"{name}.png").stat().st_size > 20_000
    with Image.open(tmp_path / "out/e/window.gif") as animation:
        assert animation.n_frames == 2 and animation.size == areas[0]  # at 8 and 9 m
    with Image.open(tmp_path / "out/e/window.png") as picture:
        assert picture.size == areas[0]
        pixels = np.asarray(picture.convert("RGB"))
    # the scene ends before the graphs, which it nearly reaches, below the texts
    right, scene = round(Layout(*areas[0]).scene_width), pixels[ABOVE : -BELOW - MARGIN_OF_SCENE]
    assert (scene[:, right - 1 : right + 3] == 255).all()
    assert (scene[:, : right // 2] < 255).any()


#: Prints the states of the session; Run is clicked, a picture and an animation exported, the window
#: made smaller. Each wait ends with what it waits for, or with the window.
PRESS = """
{python} -u -c '
from damjoint.gui import tree, window
from damjoint.gui.sheet import Request
show_status, redraw = window.Session.show_status, window.Session.redraw
exports = [tree.PICTURE_ACTION, tree.ANIMATION_ACTION]
def print_status(self, status, color):
    show_status(self, status, color)
    print(status)
    if exports and status.startswith(("done in", "exported")):
        tree.put(tree.text(window.ACTION, exports.pop(0), visible=False))
def print_area(self):
    redraw(self)
    print(f"area {{self.layout.width}} x {{self.layout.height}}")
window.Session.show_status, window.Session.redraw = print_status, print_area
if __name__ == "__main__":
    window.gui(Request("e"))
' > status.txt 2>&1 &
gui=$!
wait_for() {{ until eval "$1"; do kill -0 $gui || {{ cat status.txt; exit 1; }}; sleep 0.2; done; }}
wait_for 'grep -q ready status.txt'
wait_for 'xdotool search --onlyvisible --name Gmsh > windows.txt'
window=$(tail -1 windows.txt)
wait_for 'grep -q area status.txt'
eval $(xdotool getwindowgeometry --shell $window)
echo "window $Y: $((X + WIDTH)) x $((Y + HEIGHT))"
echo "title $(xdotool getwindowname $window)"
menu=$((WIDTH - $(grep area status.txt | tail -1 | sed "s/area \\([0-9]*\\).*/\\1/")))
xdotool mousemove $((X + menu - 80)) $((Y + HEIGHT - 42))
wait_for 'xdotool click 1; sleep 1; grep -q running status.txt'
wait_for 'grep -q window.gif status.txt'
import -window root window.png
xdotool windowsize $window $((WIDTH - 150)) $((HEIGHT - 80))
wait_for 'test $(grep -c area status.txt) -gt 1'
import -window root resized.png
kill $gui
cat status.txt
"""


@pytest.mark.heavy
def test_a_flood_shows_its_time_and_the_pressure_of_each_step(open_window):
    """Case flood: seconds of a unit of t and storage with their units; the curve of the pressure
    moves with the level, and the caption has the hours that have passed.
    """
    user = open_window("flood", n_joint=8.0, order=1.0)
    labels = [name for name in gmsh.onelab.getNames() if "Flow in time" in name]
    assert any("seconds of a unit" in n and n.endswith("[s]") for n in labels)
    assert any("stored by compressibility" in n and "[m per Pa]" in n for n in labels)
    user.run()
    (scene,) = user.session.scenes
    last = len(scene.times) - 1
    assert "16 of 16 h" in views.caption(scene, last)[0]
    assert "8 of 16 h" in views.caption(scene, last // 2)[0]
    assert len({tuple(scene.result.at(t)["p"]) for t in scene.times}) == len(scene.times) > 8
    assert any("pressure" in name for name in user.views)
