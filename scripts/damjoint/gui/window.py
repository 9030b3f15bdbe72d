"""One session of the window: what happens when something is pressed or comes back; the event loop.

ONELAB tells of what the user does by one text, the action: "check" when a parameter has changed,
and the words of the buttons.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path

import gmsh

from .. import InputError, RunError, data
from ..model.case import Case
from ..model.mesh import shares
from ..model.parameters import assignments, listing, start_gmsh
from . import camera, tree, views
from .sheet import Request, Sheet
from .worker import Engine, Scene

#: What Gmsh's menu beside Run says of a database that is read or emptied counts as a change.
CHANGES = "check", "load", "reset"
ACTION, BUTTON = "ONELAB/Action", "ONELAB/Button"
RUN, STOP = ("Run", "run"), ("Stop", "stop")
#: Seconds: for the engine's process to start, for a turn of the event loop, between two lines of
#: progress.
START, TURN, QUIET = 60.0, 0.02, 0.2


class Session:
    """The state of the window, and what it does.

    With a window or without: `turn` looks once at what the user has done and at what the engine
    says; it never waits.
    """

    def __init__(self, request: Request, windowed: bool = False) -> None:
        prepare()
        self.windowed = windowed
        self.engine = Engine()
        self.folder = tempfile.TemporaryDirectory(prefix="damjoint_")
        #: checking, running, saving, or nothing of them
        self.busy = ""
        #: what waits for that to end: check, run, or nothing
        self.later = ""
        self.tree: tree.Tree | None = None
        self.status = ""
        #: the last run: its scenes, what was asked for, the line that says how it ended
        self.scenes: list[Scene] = []
        self.ran: Request | None = None
        self.outcome = "", tree.CALM
        #: the views of the last run, the runs kept for comparison, and the water before a run
        self.gallery: views.Gallery | None = None
        self.scene_shown = 0
        self.kept: list[tuple[Scene, views.Gallery]] = []
        self.water: views.Gallery | None = None
        #: what was run is called; and, before a run, what will be
        self.title = ""
        self.heading = views.Gallery()
        self.message = views.Gallery()
        self.drawn: tuple = ()
        self.aimed: tuple = ()
        self.started = self.quiet_until = 0.0
        tree.put(tree.text(ACTION, "", visible=False), button(RUN))
        self.say("starting ...", tree.CALM)
        kind, *told = next(self.engine.messages(START), ("late",))
        if kind != "ready":
            raise RunError(f"gui: the engine's process has not started ({kind})")
        self.tree = tree.Tree(*told)
        if windowed:
            self.update()
            gmsh.fltk.closeTreeItem("0Modules")
        self.check(request)

    def close(self) -> None:
        """End the engine's process and Gmsh, and remove what is temporary."""
        self.engine.close()
        self.folder.cleanup()
        gmsh.finalize()

    # what the user does

    def turn(self, wait: float = 0.0) -> None:
        """Look at the action and at the engine's messages; wait: at most so long for one [s]."""
        action = tree.get_text(ACTION)
        if action:
            gmsh.onelab.setString(ACTION, [""])
            self.act(action)
        for kind, *told in self.engine.messages(wait):
            getattr(self, f"on_{kind}")(*told)

    def act(self, action: str) -> None:
        """Do what has been pressed."""
        if action == STOP[1]:
            self.engine.stop()
            self.say("stopping after this step; Stop again: at once, nothing is kept", tree.WARN)
        elif action == RUN[1] and (self.busy == "saving" or not self.tree.sheet):
            self.later = "run"
        elif action == RUN[1] and self.busy != "running":
            self.run()
        elif action == tree.SAVE_ACTION and not self.busy:
            self.busy = "saving"
            self.say("saving ...", tree.CALM)
            self.engine.send("save", tree.get_text(tree.FOLDER))
        elif action in CHANGES and self.busy:
            self.later = self.later or "check"
        elif action == "reset" or not tree.get_text(tree.SAVE):  # the database is empty
            self.check(Request(self.tree.sheet.request.case))
        elif action in CHANGES and not self.other_scene():
            self.check()

    def other_scene(self) -> bool:
        """Whether the user has asked to see another scene of the last run; shows it then."""
        if not tree.get_text(tree.SCENE) or tree.chosen_scene(self.scenes) == self.scene_shown:
            return False
        self.show(tree.chosen_scene(self.scenes))
        return True

    def check(self, request: Request | None = None) -> None:
        """Have a request checked: what stands in the tree, if none is given."""
        if request := request or self.asked():
            self.engine.send("check", request)
            self.busy = "checking"

    def asked(self) -> Request | None:
        """What the tree asks for; None, and said, if that is bad.

        Results of anything else are hidden at once.
        """
        try:
            request = self.tree.asked()
        except InputError as error:
            self.hide_results()
            self.on_bad(str(error))
            return None
        if request != self.ran:
            self.hide_results()
        return request

    def run(self) -> None:
        """Have what stands in the tree run."""
        request = self.asked()
        if not request:
            return
        self.busy, self.started = "running", time.perf_counter()
        tree.put(button(STOP))
        self.say("running: mesh and bodies", tree.CALM)
        self.engine.send("run", request)

    # what the engine says

    def on_ready(self, *_: object) -> None:
        """Another process is there, after one that has died; it knows the same."""

    def on_checked(self, sheet: Sheet) -> None:
        """A request is good: parameters, drawing and water follow."""
        before = self.tree.sheet
        self.tree.show(sheet)
        drawn = drawing_of(sheet)
        if drawn != self.drawn:
            self.draw(sheet.case)
            self.drawn = drawn
            self.tree.show(sheet)  # reading the geometry has declared the parameters anew
        if sheet.request != self.ran:
            self.hide_results()
            views.show_heading(self.heading, sheet.heading)
        if self.busy == "running":
            self.update()
            return
        if before and before.path != sheet.path:
            self.drop_results()
        if not self.scenes:
            self.free("ready: press Run", tree.CALM)
        elif sheet.request != self.ran:
            self.free("changed since the run: press Run", tree.CALM)
        else:  # nothing that matters to it, or changed back
            self.outline(False)
            self.aim(sheet.case, True)
            tree.show_results(self.scenes, self.scene_shown)
            self.free(*self.outcome)

    def on_bad(self, why: str) -> None:
        """A value is bad: said in one line, nothing runs, everything stays."""
        self.free(why, tree.BAD)

    def on_failed(self, why: str) -> None:
        """A run, or what else was under way, has failed."""
        self.free(why, tree.BAD)

    def on_died(self, why: str) -> None:
        """The engine's process is gone, by a second Stop or by itself."""
        self.free(why, tree.BAD)

    def on_step(self, at: tuple[int, float]) -> None:
        """A step has converged; said a few times a second, since drawing costs more than a step."""
        if time.perf_counter() < self.quiet_until or self.engine.interrupted:
            return
        self.quiet_until = time.perf_counter() + QUIET
        case = self.tree.sheet.case
        scene, now = at
        several = f"uplift {case.scenes()[scene]['uplift']}, " if case.also_uplift else ""
        last = case.times[-1]
        self.say(
            f"running: {several}level {case.level_at(now):.3g} m, t = {now:.3g} of {last:g}",
            tree.CALM,
        )

    def on_done(self, scenes: list[Scene]) -> None:
        """A run has ended, at its last level or before."""
        self.keep_or_drop()
        self.scenes, self.title = scenes, self.tree.sheet.heading[0]
        self.show(0)
        took = f"{time.perf_counter() - self.started:.2f} s"
        trouble = [scene.said for scene in scenes if scene.said]
        self.outcome = f"done in {took}: the dam stands", tree.GOOD
        if trouble:
            self.outcome = f"{trouble[0]} ({took})", tree.WARN
        self.ran = self.tree.sheet.request
        self.free(*self.outcome)

    def on_saved(self, folder: str) -> None:
        """The last run is written."""
        self.free(f"saved: {folder}", tree.GOOD)

    # what is shown

    def free(self, status: str, color: str) -> None:
        """Ready for something else."""
        self.busy = ""
        tree.put(button(RUN))
        self.say(status, color)
        later, self.later = self.later, ""
        if later:
            getattr(self, later)()

    def say(self, status: str, color: str) -> None:
        """A line in the tree and at the bottom of the window; bad news in the picture, too."""
        self.status = status
        tree.say(status, color)
        self.message.close()
        if color == tree.BAD:
            self.message.write(20, 144, [status], views.RED, 15)
        self.update()
        if self.windowed:
            gmsh.fltk.setStatusMessage(status)

    def update(self) -> None:
        """Have the window follow."""
        if self.windowed:
            gmsh.fltk.update()
            gmsh.graphics.draw()

    def draw(self, case: Case) -> None:
        """The undeformed outline, to be meshed by Gmsh's key, and the water; results are hidden."""
        source = drawing = case.geometry or data("geo") / "dam.geo"
        if drawing.suffix == ".geo":  # it may take sizes from the case
            values = case.values if case.geometry else shares(case)
            text = assignments(values) + listing("levels", case.levels)
            drawing = Path(self.folder.name) / f"{case.name}.geo"
            drawing.write_text(f'{text}Include "{source}";\n')
        gmsh.model.remove()
        gmsh.open(str(drawing))
        tree.drop_plain_levels()
        if self.water:
            self.water.close()
        self.water = views.show_planned(case)
        self.outline(True)
        camera.turn_to(case["dim"] == 3)
        self.aim(case, False)

    def outline(self, shown: bool) -> None:
        """Show the undeformed outline with its water, or the results."""
        gmsh.option.setNumber("Geometry.Curves", shown)
        if self.water:
            self.water.show(shown)
        if self.gallery:
            self.gallery.show(not shown)
        if not shown:
            self.heading.close()

    def aim(self, case: Case, beside_graphs: bool) -> None:
        """Place the scene in the window anew when it has changed, else leave it to the user."""
        key = beside_graphs, camera.frame(case, not beside_graphs).tolist()
        if self.aimed != key:
            self.aimed = key
            gmsh.graphics.draw()  # or the box around all is that of before
            camera.aim(case, views.GRAPHS_WIDTH if beside_graphs else 0)

    def show(self, scene: int) -> None:
        """Show a scene of the last run in place of the views before."""
        if self.gallery:
            self.gallery.close()
        self.scene_shown = scene
        self.gallery = views.show(self.scenes[scene], self.title, [old for old, _ in self.kept])
        gmsh.model.mesh.clear()  # if the user has had one drawn: another one can be on top
        self.outline(False)
        self.aim(self.scenes[scene].result.case, True)
        tree.show_results(self.scenes, scene)
        self.update()

    def keep_or_drop(self) -> None:
        """Before new results come: the views there are kept for comparison, or go."""
        self.drop_graphs()
        if not tree.get_number(tree.KEEP):
            self.drop_results()
        elif self.gallery:
            self.gallery.put_aside(f"run {len(self.kept) + 1}:")
            self.kept.append((self.scenes[self.scene_shown], self.gallery))
            self.gallery = None

    def drop_graphs(self) -> None:
        """Gmsh's own graphs of results go: they would stay as they are."""
        for tag in gmsh.view.getTags():
            if gmsh.view.option.getString(tag, "Name") in tree.RESULTS.values():
                gmsh.view.remove(tag)

    def hide_results(self) -> None:
        """Show the undeformed outline and no results: none are of what the tree asks for."""
        tree.hide_results()
        self.drop_graphs()
        self.heading.close()
        self.outline(True)
        if self.tree.sheet:
            self.aim(self.tree.sheet.case, False)
        self.update()

    def drop_results(self) -> None:
        """What earlier runs have given goes."""
        for gallery in (*(kept for _, kept in self.kept), self.gallery):
            if gallery:
                gallery.close()
        self.scenes, self.kept, self.gallery, self.ran = [], [], None, None
        tree.hide_results()


#: Options of Gmsh: nothing of its own when a parameter changes, and what the window looks like.
OPTIONS = {
    "Solver.AutoMesh": 0,
    "Solver.AutoSaveDatabase": 0,
    "Solver.AutoLoadDatabase": 0,
    "Solver.AutoCheck": 1,
    "General.Verbosity": 3,
    "General.Terminal": 0,
    "General.MenuWidth": 560,
    "General.GraphicsWidth": 1600,
    "General.GraphicsHeight": 900,
    "General.SmallAxes": 0,
    "General.Antialiasing": 1,
    "General.BackgroundGradient": 0,
    "General.GraphicsFontSize": 12,
    "General.GraphicsFontSizeTitle": 14,
    "Geometry.Points": 0,
}


def prepare() -> None:
    """Start Gmsh with the window's options, which it reads when a window opens."""
    start_gmsh()
    gmsh.option.setString("General.GraphicsFontEngine", "StringTexture")
    for name, value in OPTIONS.items():
        gmsh.option.setNumber(name, value)


def button(what: tuple[str, str]) -> dict:
    """Gmsh's button for an action: its label and the action's word."""
    return {"type": "string", "name": BUTTON, "values": list(what), "visible": False}


#: What the drawing shows besides mesh and water.
ACTING = "crest_water", "silt_height", "force_x", "force_y", "anchor_angle"


def drawing_of(sheet: Sheet) -> tuple:
    """What the drawing depends on."""
    case = sheet.case
    acting = [case[name] for name in ACTING]
    return sheet.path, shares(case), max(case.levels), max(case.tail_levels), acting


def gui(request: Request) -> None:
    """Open the window on a request and stay until it is closed.

    Raises InputError before anything opens, RunError where there is no display.
    """
    request.load()
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise RunError("gui: needs a display, and DISPLAY is not set")
    prepare()
    gmsh.fltk.initialize()
    session = Session(request, windowed=True)
    try:
        while gmsh.fltk.isAvailable():
            gmsh.fltk.wait(TURN)
            try:
                session.turn()
            except Exception as error:  # whatever it is, the window stays
                session.on_failed(f"{type(error).__name__}: {error}")
    except KeyboardInterrupt:
        pass  # Ctrl-C in the terminal closes the window, too
    finally:
        session.close()
