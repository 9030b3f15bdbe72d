"""The window by its real ONELAB server: opened, changed, run, stopped, saved; without a display
but for the last test, which presses Run in the real window.
"""

import json
import shutil
import subprocess
import sys
import time

import gmsh
import numpy as np
import pytest
from damjoint.gui import tree
from damjoint.gui.shapes import Deformed
from damjoint.gui.sheet import Request, titles
from damjoint.gui.views import captions
from damjoint.gui.window import ACTION, Session

SMALL = {"n_joint": 10.0, "h_dam": 3.0, "h_found": 4.0}
WORDS = [word for name, value in SMALL.items() for word in ("--set", f"{name}={value}")]


class Hand:
    """What a user does: types, presses, waits."""

    def __init__(self, case, **settings):
        self.session = Session(Request(case, settings))
        self.wait()

    def wait(self, until=lambda session: not session.busy, seconds=60):
        end = time.monotonic() + seconds
        while not until(self.session):
            assert time.monotonic() < end, self.session.status
            self.session.turn(0.02)

    def press(self, action):
        gmsh.onelab.setString(ACTION, [action])
        self.session.turn()

    def type(self, name, value):
        """Into a field, by the parameter's name or the tree's."""
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


@pytest.fixture
def open_window():
    hands = []

    def opened(case, **settings):
        hands.append(Hand(case, **settings))
        return hands[-1]

    yield opened
    for hand in hands:
        hand.session.close()


def test_all_parameters_with_what_is_allowed_and_no_dead_button(open_window):
    hand = open_window("a")
    assert hand.session.status == "ready: press Run"
    for name, parameter in hand.session.tree.known.items():
        entry = hand.entry(name)
        assert entry["help"].startswith(f"{name}: {parameter.allowed()}")
        if entry["type"] == "number":  # no loop or graph button that would do nothing
            choices = entry.get("choices", [])
            assert entry["step"] == 0 and (
                choices in ([], [0, 1]) or len(entry["valueLabels"]) == len(choices)
            )
    assert hand.entry(tree.CASE)["valueLabels"].keys() >= {"dam: own dam", "open a case file ..."}
    assert len(hand.entry(tree.CASE)["choices"]) == len(hand.session.tree.titles) + 1
    assert tree.get_text(tree.LEVELS) == "3, 6, 8, 9"


def test_only_what_matters_shows_and_followers_say_what_they_follow(open_window):
    hand = open_window("a")
    assert hand.entry("sigma_max")["visible"] and not hand.entry("mu")["visible"]
    assert not hand.entry("thickness")["visible"] and not hand.entry("visc")["visible"]
    hand.type("law", "friction")
    assert hand.entry("mu")["visible"] and not hand.entry("sigma_max")["visible"]
    hand.type("E", 2e10)
    entry = hand.entry("E_dam")
    assert entry["values"] == [-1] and entry["label"].startswith("E_dam = 2e+10 (-1: E): ")
    assert hand.session.tree.sheet.case["E_dam"] == 2e10
    hand.type("E_dam", 3e10)
    assert hand.session.tree.sheet.case["E_dam"] == 3e10
    assert hand.entry("E_dam")["label"] == "Young's modulus of the dam [Pa]"
    hand.type("E_dam", -1.0)
    assert hand.session.tree.sheet.case["E_dam"] == 2e10


def test_changed_run_and_saved_as_in_batch(open_window, command, tmp_path):
    """The same bytes, from the command line and from the case file that was saved."""
    hand = open_window("a", **SMALL)
    hand.type("law", "friction")
    hand.type("uplift", "flow")
    hand.type(tree.LEVELS, "3, 5,6")
    hand.type(tree.TAIL_LEVELS, "0,1,1")
    hand.type(tree.STEPS, "2")
    assert tree.get_text(tree.TIMES) == "0.5, 1, 1.5, 2, 2.5, 3"
    assert hand.run().startswith(("done in", "sliding"))
    hand.save(tmp_path / "window")
    hand.session.close()
    words = "--set", "law=friction", "--set", "uplift=flow", "--steps", "2"
    levels = "--levels", "3,5,6", "--tail-levels", "0,1,1"
    command("run", "a", *WORDS, *words, *levels, "--out", "batch")
    command("run", tmp_path / "window" / "a.case", "--out", "again")
    hand.session = Session(Request("a"))  # for the fixture to close
    saved = sorted(p.relative_to(tmp_path / "window") for p in (tmp_path / "window").rglob("*.*"))
    for folder in ("batch", "again"):
        found = sorted(p.relative_to(tmp_path / folder) for p in (tmp_path / folder).rglob("*.*"))
        assert [p for p in saved if p.name != "a.case"] == found
        for name in ("joint.csv", "history.csv"):
            one, other = ((tmp_path / f / name).read_bytes() for f in ("window", folder))
            assert one == other


def test_results_stand_in_the_tree(open_window):
    hand = open_window("c", **SMALL)
    hand.run()
    result = hand.session.scenes[0].result
    names = {n.rpartition("/")[2].lstrip("0123456789"): n for n in gmsh.onelab.getNames("01Res.*")}
    for column, name in tree.RESULTS.items():
        entry = json.loads(gmsh.onelab.get(names[name]))
        assert entry["readOnly"] and entry["attributes"]["Highlight"]
        if entry["visible"]:
            assert np.allclose(entry["choices"], result.history[column], rtol=1e-12)
            assert entry["values"][0] == pytest.approx(result.last[column], rel=1e-12)
    assert tree.get_text(tree.VERDICT) == "sliding"
    assert not json.loads(gmsh.onelab.get(names["Leakage [kg per m s]"]))["visible"]


def test_a_softening_joint_is_a_number_and_a_color(open_window):
    coarse = {"n_joint": 20.0, "h_dam": 8.0, "h_found": 30.0}
    hand = open_window("dam", law="bond", sigma_max=3e5, G_f=300.0, **coarse)
    hand.type(tree.LEVELS, "40, 48")
    hand.run()
    (entry,) = (hand.entry(n) for n in gmsh.onelab.getNames("01Res.*") if "process zone" in n)
    zone = hand.session.scenes[0].result.last["process_zone"]
    assert entry["visible"] and entry["values"][0] == pytest.approx(zone) and zone > 5
    assert "softening joint" in hand.views
    tag = gmsh.view.getTags()[hand.views.index("softening joint")]
    assert "violet: joint softening" in str(gmsh.view.getListDataStrings(tag, 2))
    before, now = captions(Deformed(hand.session.scenes[0]))
    assert "softening" not in before and now.endswith(f"crack 0 m, softening {zone:.3g} m")


def test_views_have_a_step_per_level_and_replace_those_before(open_window):
    hand = open_window("c", **SMALL)
    hand.run()
    views = hand.views
    for name in ("displacement [m]", "water", "open or broken joint", "slipped joint"):
        assert name in views
    for start in ("opening", "slip", "normal stress", "shear stress", "water pressure", "level"):
        assert any(view.startswith(f"{start} [") for view in views), start
    for tag, name in zip(gmsh.view.getTags(), views, strict=True):
        data = gmsh.view.getListData(tag)
        if name == "displacement [m]":
            corners = {"VQ": 4, "VT": 3}
            for kind, count, values in zip(*data, strict=True):
                steps = (len(values) / count / corners[kind] - 3) / 3
                assert steps == len(hand.session.scenes[0].times) == 4
    hand.run()
    assert hand.views == views
    hand.type(tree.KEEP, 1.0)
    hand.type("mu", 0.7)
    hand.run()
    assert "run 1: displacement [m]" in hand.views and "displacement [m]" in hand.views
    assert "opening, before [nm]" in hand.views
    hand.type(tree.KEEP, 0.0)
    hand.run()
    assert not any("run 1" in view for view in hand.views)


def test_the_status_says_whether_the_results_are_those_of_the_parameters(open_window):
    hand = open_window("c", **SMALL)
    done = hand.run()
    assert hand.type(tree.KEEP, 1.0) == done
    assert hand.type("dam_crest", 2.0) == "changed since the run: press Run"
    visible = [gmsh.view.option.getNumber(tag, "Visible") for tag in gmsh.view.getTags()]
    assert sum(visible) == 2  # the water beside the new outline, and the heading
    assert hand.type("dam_crest", 1.5) == done
    visible = [gmsh.view.option.getNumber(tag, "Visible") for tag in gmsh.view.getTags()]
    assert sum(visible) == len(visible) - 2  # all but that water, and the stress


def shown_results():
    """The verdict, the names of the numbers beside it, and the visible lines of text."""
    numbers = [
        n for n in gmsh.onelab.getNames("01Results/.*") if n not in (tree.STATUS, tree.VERDICT)
    ]
    seen = [t for t in gmsh.view.getTags() if gmsh.view.option.getNumber(t, "Visible")]
    lines = [line for tag in seen for line in gmsh.view.getListDataStrings(tag, 2)[1]]
    return tree.get_text(tree.VERDICT), numbers, lines


def test_results_of_anything_else_are_gone_at_once(open_window):
    """Before the engine has answered: another parameter, another case, a bad choice, Run pressed
    right after it; and back again with the parameter."""
    hand = open_window("c", **SMALL)
    assert shown_results() == (
        "not run yet",
        [],
        ["C: friction, 2D, order 1, quadrangles", C_SCENE],
    )
    hand.run()
    assert hand.views.count("displacement [m]") == 1
    before = verdict, numbers, lines = shown_results()
    assert verdict == "sliding" and len(numbers) > 10 and C_SCENE in lines
    mu, own = hand.session.tree.known["mu"].label, hand.session.tree.sheet.case["mu"]
    for value, found in ((0.7, ("not run yet", [])), (own, before[:2])):
        gmsh.onelab.setNumber(mu, [value])
        hand.press("check")
        assert shown_results()[:2] == ("not run yet", [])
        assert not any("level" in line for line in shown_results()[2])
        hand.wait()
        assert shown_results()[:2] == found
    assert shown_results() == before
    for case in (float(len(titles())), 0.0):  # "open a case file ...", and modeling A
        gmsh.onelab.setNumber(tree.CASE, [case])
        hand.press("check")
        assert shown_results()[:2] == ("not run yet", [])
    hand.press("run")
    assert hand.session.busy == "running" and shown_results()[:2] == ("not run yet", [])
    hand.wait()
    assert shown_results()[0] == "stands"
    assert "A: rupture, 2D, order 1" in shown_results()[2]


#: The second line of modeling C's heading.
C_SCENE = "law friction, uplift imposed"


def test_the_title_follows_law_and_water(open_window):
    hand = open_window("c", **SMALL)
    hand.run()
    hand.type("law", "rupture")
    hand.type("uplift", "none")
    changed = ["case c, changed", "law rupture, uplift none"]
    assert shown_results()[2] == changed
    hand.run()
    assert [line for line in shown_results()[2] if line in changed] == changed
    assert not any("friction" in line for line in shown_results()[2])
    hand.type("law", "friction")
    hand.type("uplift", "imposed")
    assert shown_results()[2] == ["C: friction, 2D, order 1, quadrangles", C_SCENE]


def test_drawing_follows_geometry_and_can_be_meshed(open_window):
    hand = open_window("e")
    assert gmsh.model.getBoundingBox(-1, -1)[4] == pytest.approx(10, abs=1e-6)
    hand.type("dam_height", 12.0)
    assert gmsh.model.getBoundingBox(-1, -1)[4] == pytest.approx(12, abs=1e-6)
    assert hand.views == ["water", "heading"]
    gmsh.model.mesh.generate(2)
    assert len(gmsh.model.mesh.getNodes()[0]) > 100


@pytest.mark.parametrize(
    ("name", "value", "why"),
    [
        (tree.LEVELS, "3, 60", "levels = 60: must be between 0 and 20 m"),
        (tree.LEVELS, "high", "levels = high: must be a list of levels in metres"),
        (tree.TAIL_LEVELS, "1, 2", "tail_levels = 1,2: must be one level or as many"),
        (tree.STEPS, "0", "steps = 0: must be an integer >= 1"),
        (tree.STEPS, "two", "steps = two: must be an integer >= 1"),
        (tree.ACCURACY, "best", "accuracy = best: must be one of coarse, standard, fine"),
        (tree.FILE, "nowhere.case", "case nowhere.case: unknown"),
        (tree.CASE, float(len(titles())), "case file: choose it"),
        ("nu", 0.6, "nu = 0.6: must be"),
        ("n_joint", 10.5, "n_joint = 10.5: must be an integer"),
        ("law", "glue", "law = glue: must be one of rupture, friction"),
    ],
)
def test_a_bad_value_is_one_line_and_nothing_runs(open_window, name, value, why):
    hand = open_window("e", **SMALL)
    before = gmsh.onelab.getNumber(name) if isinstance(value, float) and "/" in name else None
    was = tree.value_of(name) if "/" in name else hand.session.tree.sheet.case[name]
    assert hand.type(name, value).startswith(why)
    assert "\n" not in hand.session.status
    assert hand.run().startswith(why) and not hand.session.scenes
    assert hand.entry(tree.STATUS)["attributes"]["Highlight"] == tree.BAD
    hand.type(name, before[0] if before is not None else was)
    assert hand.run().startswith("done in")


def test_what_is_pressed_meanwhile_is_done_afterwards(open_window, tmp_path):
    hand = open_window("c", **SMALL)
    done = hand.run()
    gmsh.onelab.setString(tree.FOLDER, [str(tmp_path / "c")])
    hand.press(tree.SAVE_ACTION)
    hand.press("run")
    hand.press("check")
    hand.wait()
    assert hand.session.status.startswith(done.partition("(")[0])
    assert (tmp_path / "c" / "joint.csv").exists()


def test_stop_keeps_what_has_converged(open_window, tmp_path):
    hand = open_window("e", **SMALL)
    hand.type(tree.STEPS, "2000")
    hand.press("run")
    hand.wait(lambda session: "level 3." in session.status)
    assert gmsh.onelab.getString("ONELAB/Button") == ["Stop", "stop"]
    hand.press("stop")
    hand.wait()
    assert hand.session.status.startswith("interrupted at level")
    assert gmsh.onelab.getString("ONELAB/Button") == ["Run", "run"]
    scene = hand.session.scenes[0]
    history = scene.result.history
    assert len(history["time"]) > 2000 and list(scene.times) == [1.0, history["time"][-1]]
    assert "displacement [m]" in hand.views
    hand.save(tmp_path / "stopped")
    assert json.loads((tmp_path / "stopped/run.json").read_text())["state"] == "interrupted"
    hand.press("run")
    hand.press("stop")
    hand.press("stop")
    hand.wait()
    assert hand.session.status in ("stopped at once, no results", "stopped before the first step")
    hand.type(tree.STEPS, "1")
    assert hand.run().startswith("done in")


def test_an_emptied_database_is_filled_again(open_window):
    """Reset, in Gmsh's menu beside Run."""
    hand = open_window("a")
    hand.type("E", 1e10)
    gmsh.onelab.clear()
    hand.press("reset")
    hand.wait()
    assert hand.entry("E")["values"] == [3e12] and tree.get_text(tree.SAVE)
    assert gmsh.onelab.getString("ONELAB/Button") == ["Run", "run"]


def test_nothing_to_save_before_a_run(open_window, tmp_path):
    hand = open_window("e")
    hand.press(tree.SAVE_ACTION)
    hand.wait()
    assert hand.session.status == "nothing to save: press Run first"


def test_a_case_of_ones_own_is_not_overwritten(open_window, tmp_path):
    """Nor is a file that a link leads to; what the window itself has saved is."""
    hand = open_window("c", **SMALL)
    hand.run()
    own, behind = tmp_path / "own" / "c.case", tmp_path / "behind.txt"
    for folder in ("own", "linked", "new"):
        (tmp_path / folder).mkdir()
    own.write_text("// mine\n")
    behind.write_text("mine, too\n")
    (tmp_path / "linked" / "c.case").symlink_to(behind)
    for folder in ("own", "linked"):
        gmsh.onelab.setString(tree.FOLDER, [str(tmp_path / folder)])
        hand.press(tree.SAVE_ACTION)
        hand.wait()
        assert hand.session.status.endswith(
            "must not have a c.case of your own; choose another folder"
        )
        assert [p.name for p in (tmp_path / folder).iterdir()] == ["c.case"]
    assert own.read_text() == "// mine\n" and behind.read_text() == "mine, too\n"
    hand.save(tmp_path / "new")
    hand.save(tmp_path / "new")
    gmsh.onelab.setString(tree.FOLDER, [""])
    hand.press(tree.SAVE_ACTION)
    hand.wait()
    assert hand.session.status == "out: name a folder"


def test_an_engine_that_dies_is_started_again(open_window):
    """Killed while it works, as by a machine without memory."""
    hand = open_window("e", **SMALL)
    hand.type(tree.STEPS, "2000")
    hand.press("run")
    hand.wait(lambda session: "level 3." in session.status)
    hand.session.engine.process.kill()
    hand.wait()
    assert hand.session.status == "the engine's process ended (exit code -9): press Run"
    hand.type(tree.STEPS, "1")
    assert hand.run().startswith("done in")


def test_a_run_that_stops_says_why(open_window):
    hand = open_window("c", **SMALL, pena_tang=0.0)
    status = hand.run()
    assert status.startswith("sliding: no equilibrium beyond level")
    assert hand.entry(tree.STATUS)["attributes"]["Highlight"] == tree.WARN


def test_other_cases_and_files(open_window, tmp_path):
    hand = open_window("a", **SMALL)
    hand.run()
    hand.type(tree.CASE, float(list(hand.session.tree.titles).index("dam")))
    assert hand.session.tree.sheet.case.name == "dam" and hand.views == ["water", "heading"]
    assert tree.get_text(tree.LEVELS) == "30, 40, 45"
    assert hand.session.tree.sheet.request.overrides == {}
    mine = tmp_path / "mine.case"
    mine.write_text("default_dam_height = 20; default_dam_base = 16; levels() = {15, 18};")
    hand.type(tree.FILE, str(mine))
    assert tree.get_text(tree.LEVELS) == "15, 18" and "mine" in hand.entry(tree.CASE)["valueLabels"]
    hand.type("dam_height", 21.0)
    assert hand.session.tree.sheet.case.name == "mine"
    assert "unknown; allowed" in hand.type(tree.FILE, 5000 * "x")
    hand.type(tree.FILE, "")  # nothing is chosen: the case stays
    assert hand.run().startswith("done in")


def test_both_uplifts_of_a_published_case(open_window):
    hand = open_window("a", **SMALL)
    hand.run()
    assert hand.entry(tree.SCENE)["choices"] == ["imposed", "none"]
    assert any(view.startswith("water pressure") for view in hand.views)
    hand.type(tree.SCENE, "none")
    assert not any(view.startswith("water pressure") for view in hand.views)
    hand.type("uplift", "imposed")  # its own value: both again
    hand.run()
    assert len(hand.session.scenes) == 2


def test_accuracy_chooses_the_mesh(open_window):
    hand = open_window("a")
    hand.type(tree.ACCURACY, "coarse")
    assert (hand.entry("n_joint")["values"], hand.entry("order")["values"]) == ([32], [2])
    hand.type(tree.ACCURACY, tree.OWN)
    assert (hand.entry("n_joint")["values"], hand.entry("order")["values"]) == ([50], [1])


def test_3d_shows_the_joint_as_a_surface(open_window):
    hand = open_window("f", n_joint=8.0, h_dam=3.0, h_found=4.0)
    assert hand.run().startswith("done in")
    state = "joint: closed, slipped, softening, open"
    for start in ("opening of the joint", state, "water pressure"):
        assert any(view.startswith(start) for view in hand.views), start


#: A batter, a neck, an inclined joint or a lift joint; water over the crest and below the dam.
SECTION = {"batter": 1.0, "batter_height": 5.0, "neck_height": 2.0}
LOADS = {"silt_height": 2.0, "ice_force": 1e3, "ice_level": 7.0, "anchor_force": 1e3, "k_h": 0.02}


@pytest.mark.parametrize("joint", [{"joint_slope": 5.0}, {"joint_height": 4.0}])
def test_water_and_loads_of_any_section(open_window, joint):
    """Before the run the water's area is that of the section's own outline; after it a bit more or
    less, as the faces are drawn displaced."""
    hand = open_window("e", **SMALL, **SECTION, **joint, **LOADS, uplift="imposed")
    hand.type(tree.LEVELS, "6, 10.5")
    hand.type(tree.TAIL_LEVELS, "0, 3")
    assert hand.views == ["water", "silt", "forces", "heading"]
    case = hand.session.tree.sheet.case
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
    tags = dict(zip(hand.views, gmsh.view.getTags(), strict=True))
    for name, size in expected.items():
        _, (count,), (values,) = gmsh.view.getListData(tags[name])
        x, y, _ = values.reshape(count, -1)[:, :12].reshape(count, 3, 4).transpose(1, 0, 2)
        doubled = np.sum(x * np.roll(y, -1, 1) - np.roll(x, -1, 1) * y, axis=1)
        assert np.abs(doubled).sum() / 2 == pytest.approx(size, rel=1e-9), name
    assert not hand.run().startswith("failed")
    for name in ("water", "silt", "forces"):
        assert name in hand.views
    rows = hand.session.scenes[0].result.at()
    graph = next(
        t for t in gmsh.view.getTags() if "shear stress" in gmsh.view.option.getString(t, "Name")
    )
    _, (count,), (values,) = gmsh.view.getListData(graph)
    assert values.reshape(count, -1)[:, 1].max() == pytest.approx(rows["s"].max(), rel=1e-6)


def test_no_display_and_bad_input_are_one_line(command, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert command("gui", "q")[::2][0] == 2
    code, _, error = command("gui", "a", "--set", "mu=-1")
    assert code == 2 and error.count("\n") == 1
    if sys.platform.startswith("linux"):
        code, _, error = command("gui", "a")
        assert code == 1 and "needs a display" in error


#: The Run button below the menu, from the window's left and bottom edge [pixels].
RUN_BUTTON = 476, -42


@pytest.mark.heavy
def test_run_is_pressed_in_the_real_window(tmp_path):
    """Under Xvfb: opens, is clicked, says that it is done; the screenshot stays in tmp_path."""
    missing = [n for n in ("Xvfb", "xvfb-run", "xdotool", "import") if not shutil.which(n)]
    if missing:
        pytest.skip(f"needs {', '.join(missing)} (apt: xvfb xdotool imagemagick)")
    script = tmp_path / "press.sh"
    script.write_text(PRESS.format(python=sys.executable, x=RUN_BUTTON[0], y=RUN_BUTTON[1]))
    words = ["xvfb-run", "-a", "-s", "-screen 0 1600x1000x24", "sh", str(script)]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert "done in" in done.stdout, done.stdout + done.stderr
    assert (tmp_path / "window.png").stat().st_size > 20_000


#: The session's status goes to standard output; a click on Run, and the picture after it.
PRESS = """
{python} -u -c '
from damjoint.window import window
from damjoint.window.sheet import Request
say = window.Session.say
def told(self, status, color):
    say(self, status, color)
    print(status)
window.Session.say = told
if __name__ == "__main__":
    window.gui(Request("e"))
' > said.txt 2>&1 &
for i in $(seq 100); do grep -q ready said.txt && break; sleep 0.2; done
sleep 1
window=$(xdotool search --name Gmsh | tail -1)
eval $(xdotool getwindowgeometry --shell $window)
xdotool mousemove $((X + {x})) $((Y + HEIGHT + {y})) click 1
for i in $(seq 100); do grep -q "done in" said.txt && break; sleep 0.2; done
sleep 1
import -window root window.png
kill $!
cat said.txt
"""
