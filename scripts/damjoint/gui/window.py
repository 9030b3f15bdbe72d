"""Session of the window: actions of the user, messages of the engine; the event loop.

ONELAB reports what the user does as one text, the action: "check" after a change of a parameter,
else the action of a button.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import gmsh

from .. import InputError, RunError, data
from ..input.case import Case
from ..input.parameters import listing, start_gmsh
from ..mesh.generate import as_text, shares
from . import export, tree, views
from .camera import result_camera, undeformed_camera
from .gallery import RED, Gallery
from .layout import MESSAGE, MESSAGE_PITCH, MESSAGE_SIZE, Layout, open_window
from .scene import SolvedScene
from .sheet import Request, Sheet
from .worker import EngineProcess

#: Actions after changes of parameters; load, reset: of the database, from Gmsh's menu beside Run.
CHANGES = "check", "load", "reset"
ACTION, BUTTON = "ONELAB/Action", "ONELAB/Button"
RUN, STOP = ("Run", "run"), ("Stop", "stop")
#: Seconds: a turn of the event loop; between progress messages, as drawing costs more than a step;
#: between looks at the size of the drawing area.
TURN, PROGRESS, LOOK = 0.02, 0.2, 0.4


class Session:
    """State of the window, and its reactions; works with or without a window.

    `turn` handles the user's action and the engine's messages, and never waits.
    """

    def __init__(self, request: Request, windowed: bool = False) -> None:
        if not windowed:
            prepare()
        self.windowed = windowed
        self.engine = EngineProcess()
        self.folder = tempfile.TemporaryDirectory(prefix="damjoint_")
        #: checking, running, saving, or empty
        self.busy = ""
        #: check or run, postponed while busy; or empty
        self.pending = ""
        self.status = ""
        #: the last run: scenes, request, status line with its color, title
        self.scenes: list[SolvedScene] = []
        self.last_request: Request | None = None
        self.last_status = "", tree.CALM
        self.title = ""
        #: views of the last run, runs for comparison, loads before a run
        self.gallery: Gallery | None = None
        self.scene_shown = 0
        self.earlier: list[tuple[SolvedScene, Gallery]] = []
        self.loads: Gallery | None = None
        #: views of the heading before a run and of an error message
        self.heading = Gallery()
        self.message = Gallery()
        #: keys of the current drawing and view, to detect changes
        self.drawn: tuple[Any, ...] = ()
        self.fitted: tuple[Any, ...] = ()
        self.started = self.next_progress = self.next_look = 0.0
        #: when the next step is shown while the steps are played
        self.next_play: float | None = None
        #: the request that runs; whether its results so far are shown
        self.running: Request | None = None
        self.live = False
        self.layout = Layout()
        #: what the user has chosen to see, and the step shown, at the last turn
        self.display, self.step = views.Display(), 0
        tree.put(tree.text(ACTION, "", visible=False), button(RUN))
        self.show_status("starting ...", tree.CALM)
        kind, *content = next(self.engine.messages(None))
        if kind != "ready":
            raise RunError(f"gui: the engine's process has not started ({kind}); try again")
        self.tree = tree.Tree(*content)
        self.check(request)

    def close(self) -> None:
        """End the engine's process and Gmsh, and remove temporary files."""
        self.engine.close()
        self.folder.cleanup()
        gmsh.finalize()

    # actions of the user

    def turn(self, wait: float = 0.0) -> None:
        """Handle the action and the engine's messages; wait: longest time for one [s]."""
        action = tree.get_text(ACTION)
        if action:
            gmsh.onelab.setString(ACTION, [""])
            self.act(action)
        for kind, *content in self.engine.messages(wait):
            getattr(self, f"on_{kind}")(*content)
        self.follow_window()
        self.play()
        self.follow_step()

    def follow_window(self) -> None:
        """Adapt the layout to the drawing area, if its size has changed; looks now and then."""
        if not self.windowed or time.perf_counter() < self.next_look:
            return
        self.next_look = time.perf_counter() + LOOK
        layout = Layout.of_window(Path(self.folder.name) / "window.opt")
        if layout != self.layout:
            self.layout = layout
            self.redraw()

    def follow_step(self) -> None:
        """Show the numbers of the step that Gmsh shows."""
        if self.shows_results and self.gallery and self.gallery.step != self.step:
            self.step = self.gallery.step
            self.gallery.set_step(self.step)
            tree.show_numbers(self.scenes[self.scene_shown], self.step)
            self.update()

    def play(self) -> None:
        """Show the next step, if the steps are played and it is time; the numbers follow. (Gmsh's
        own animation returns only at its end.)
        """
        if self.next_play is None or time.perf_counter() < self.next_play:
            return
        last = len(self.scenes[self.scene_shown].times) - 1 if self.scenes else 0
        if not (self.shows_results and self.gallery) or self.gallery.step >= last:
            self.next_play = None
            return
        self.next_play = time.perf_counter() + self.seconds_of_step
        self.gallery.set_step(self.gallery.step + 1)

    @property
    def seconds_of_step(self) -> float:
        """How long a step is shown while they are played."""
        return export.LEVEL if self.scenes[self.scene_shown].quake is None else export.FRAME

    def start_or_stop_playing(self) -> None:
        """Play all steps from the first one; stop if they are played."""
        playing, self.next_play = self.next_play is not None, None
        if not playing and self.shows_results and self.gallery:
            self.gallery.set_step(0)
            self.next_play = time.perf_counter() + self.seconds_of_step

    def act(self, action: str) -> None:
        """Do an action."""
        if action == STOP[1]:
            self.stop()
        elif action == RUN[1] and (self.busy == "saving" or not self.tree.checked):
            self.pending = "run"
        elif action == RUN[1] and self.busy != "running":
            self.run()
        elif action == tree.PLAY_ACTION:
            self.start_or_stop_playing()
        elif action == tree.SAVE_ACTION and not self.busy:
            self.busy = "saving"
            self.show_status("saving ...", tree.CALM)
            self.engine.send("save", tree.get_text(tree.FOLDER))
        elif action in (tree.PICTURE_ACTION, tree.ANIMATION_ACTION) and not self.busy:
            self.export(action)
        elif action in CHANGES and self.busy:
            self.pending = self.pending or "check"
        elif action == "reset" or not tree.get_text(tree.SAVE):  # the database has been emptied
            self.check(Request(self.tree.sheet.request.case))
        elif action in CHANGES and not self.other_display():
            self.check()

    def stop(self) -> None:
        """Stop a run after its current step; the second time at once."""
        if self.busy == "running":
            self.engine.stop()
            self.show_status(
                "stopping after this step; Stop again: at once, without results", tree.WARN
            )

    def other_display(self) -> bool:
        """Show what the user has chosen to see of the last run; whether that has changed."""
        before = self.display, self.scene_shown
        self.display = tree.display()
        scene = tree.chosen_scene(self.scenes) if self.scenes else self.scene_shown
        if (self.display, scene) == before:
            return False
        if self.shows_results:
            self.show(scene)
        return True

    def export(self, action: str) -> None:
        """Write the drawing area as a picture, or all levels as an animation."""
        folder, gallery = tree.get_text(tree.FOLDER), self.gallery
        self.show_status("exporting ...", tree.CALM)
        try:
            if not self.windowed or not self.shows_results or not gallery:
                raise InputError("nothing to export: press Run in the window first")
            if action == tree.PICTURE_ACTION:
                file = export.picture(folder)
            else:
                file = export.animation(folder, gallery, self.scenes[self.scene_shown])
        except (InputError, OSError) as error:
            self.show_status(str(error), tree.BAD)
        else:
            self.show_status(f"exported: {file}", tree.GOOD)

    def check(self, request: Request | None = None) -> None:
        """Let the engine check a request, by default that of the tree."""
        if request := request or self.request():
            self.engine.send("check", request)
            self.busy = "checking"

    def request(self) -> Request | None:
        """Read the request from the tree; None, with a message, if it is bad.

        Hides results that are not of this request.
        """
        try:
            request = self.tree.request()
        except InputError as error:
            self.hide_results()
            self.on_failed(str(error))
            return None
        if request != self.last_request:
            self.hide_results()
        return request

    def run(self) -> None:
        """Let the engine run the tree's request."""
        request = self.request()
        if not request:
            return
        self.busy, self.started = "running", time.perf_counter()
        self.running, self.live = request, False
        tree.put(button(STOP))
        self.show_status("running: mesh and bodies", tree.CALM)
        self.engine.send("run", request)

    # messages of the engine

    def on_ready(self, *_: Any) -> None:
        """A new process has started; nothing to update."""

    def on_checked(self, sheet: Sheet) -> None:
        """A request is good: update parameters, drawing and loads."""
        before = self.tree.checked
        self.tree.show(sheet)
        drawn = drawing_key(sheet)
        if drawn != self.drawn:
            self.draw(sheet.case)
            self.drawn = drawn
            self.tree.show(sheet)  # opening the geometry has declared the parameters again
        if not before:
            self.close_groups()
        if sheet.request != self.last_request:
            self.hide_results()
            views.show_heading(self.heading, sheet.heading, self.layout)
        if self.busy == "running":
            self.update()
            return
        if before and before.path != sheet.path:
            self.drop_results()
        if sheet.problem:
            self.free(self.tree.in_window_words(sheet.problem), tree.BAD)
        elif not self.scenes:
            self.free("ready: press Run", tree.CALM)
        elif sheet.request != self.last_request:
            self.free("changed since the run: press Run", tree.CALM)
        else:  # unchanged, or changed back
            self.show(self.scene_shown)
            self.free(*self.last_status)

    def close_groups(self) -> None:
        """Close the groups of the tree that are closed at first."""
        self.update()
        for group in ("0Modules", *tree.CLOSED) if self.windowed else ():
            gmsh.fltk.closeTreeItem(group)

    def on_failed(self, message: str) -> None:
        """A value is bad; a run, check or save has failed; or the engine's process has ended."""
        if self.live:
            self.live = False
            self.drop_results()
            self.outline(True)
        self.free(self.tree.in_window_words(message), tree.BAD)

    def on_step(self, reached: str) -> None:
        """A step has converged: show what it has reached, a few times a second."""
        if time.perf_counter() < self.next_progress or self.engine.interrupted:
            return
        self.next_progress = time.perf_counter() + PROGRESS
        self.show_status(f"running: {reached}", tree.CALM)

    def on_live(self, scenes: list[SolvedScene]) -> None:
        """An earthquake goes on: show its last time, if it is of the tree's request."""
        if self.busy != "running" or self.tree.request() != self.running:
            return
        self.show_run(scenes)
        self.live = True

    def show_run(self, scenes: list[SolvedScene]) -> int:
        """Show the last step of a run; the number of the scene shown first."""
        if not self.live:
            self.keep_or_drop()
        self.scenes, self.title = scenes, self.tree.sheet.heading[0]
        first = next((k for k, scene in enumerate(scenes) if scene.quake), 0)
        self.step = max(len(scenes[first].times) - 1, 0)
        self.show(first)
        return first

    def on_done(self, scenes: list[SolvedScene]) -> None:
        """A run has ended, at its last level or before: show its results."""
        first = self.show_run(scenes)
        self.live = False
        took = f"{time.perf_counter() - self.started:.2f} s"
        problems = [scene.message for scene in scenes[first:] if scene.message]
        self.last_status = f"done in {took}: {scenes[first].statement}", tree.GOOD
        if problems:
            self.last_status = f"{problems[0]} ({took})", tree.WARN
        self.last_request = self.tree.sheet.request
        self.free(*self.last_status)

    def on_saved(self, folder: str) -> None:
        """The last run has been written."""
        self.free(f"saved: {folder}", tree.GOOD)

    # display

    def free(self, status: str, color: str) -> None:
        """Show a status, and do what is pending."""
        self.busy = ""
        tree.put(button(RUN))
        self.show_status(status, color)
        pending, self.pending = self.pending, ""
        if pending:
            getattr(self, pending)()

    def show_status(self, status: str, color: str) -> None:
        """Show a line in the tree and at the bottom of the window; an error in the picture, too."""
        self.status = status
        tree.show_status(status, color)
        self.message.close()
        if color == tree.BAD:
            self.show_message(status)
        self.update()
        if self.windowed:
            gmsh.fltk.setStatusMessage(status)

    def show_message(self, message: str) -> None:
        """Show an error in the drawing area."""
        x, y = MESSAGE
        for i, line in enumerate(self.layout.wrapped(message, MESSAGE_SIZE)):
            self.message.write(x, y + i * MESSAGE_PITCH, [line], RED, MESSAGE_SIZE)

    def update(self) -> None:
        """Redraw the window."""
        if self.windowed:
            gmsh.fltk.update()
            gmsh.graphics.draw()

    def draw(self, case: Case) -> None:
        """Draw the undeformed outline, which Gmsh's key 2 meshes, and the loads; hide results."""
        source = drawing = case.geometry or data("geo") / "dam.geo"
        if drawing.suffix == ".geo":  # may use parameters of the case
            values = case.values if case.geometry else shares(case)
            text = as_text(values) + listing("levels", case.levels)
            drawing = Path(self.folder.name) / f"{case.name}.geo"
            drawing.write_text(f'{text}Include "{source}";\n')
        gmsh.model.remove()
        gmsh.open(str(drawing))
        gmsh.model.setFileName(f"{case.name}: {case.title}")  # the window's title
        tree.drop_level_entries()
        if self.loads:
            self.loads.close()
        self.loads = views.show_undeformed_loads(case)
        self.outline(True)
        self.fit_view()

    def outline(self, shown: bool) -> None:
        """Show the undeformed outline with its loads, or the results."""
        gmsh.option.setNumber("Geometry.Curves", shown)
        if self.loads:
            self.loads.show(shown)
        if self.gallery:
            self.gallery.show(not shown)

    @property
    def shows_results(self) -> bool:
        """Whether the drawing area shows the results of the tree's request."""
        return bool(self.scenes) and tree.get_text(tree.VERDICT) != tree.NOT_RUN

    def fit_view(self) -> None:
        """Position what is shown if it or its area has changed; else keep the user's view."""
        if self.shows_results:
            scene = self.scenes[self.scene_shown]
            camera = result_camera(scene.result.case, scene.bodies)
            width = self.layout.scene_width
        else:
            camera, width = undeformed_camera(self.tree.sheet.case), self.layout.width
        key = camera.box.tolist(), camera.turn, self.layout, width
        if self.fitted != key:
            if not self.fitted or self.fitted[1] != camera.turn:
                camera.rotate()  # else keeps a rotation by the user
            self.fitted = key
            gmsh.graphics.draw()  # updates the bounding box
            camera.fit(self.layout, width)

    def redraw(self) -> None:
        """Draw again what is shown, in the current layout."""
        if self.shows_results:
            self.show(self.scene_shown)
        elif self.tree.checked:
            self.heading.close()
            views.show_heading(self.heading, self.tree.sheet.heading, self.layout)
            self.fit_view()
            self.update()

    def show(self, scene: int) -> None:
        """Replace the views by those of a scene of the last run, at the same step."""
        # views that would be removed later, too, would change the indices of those of the gallery
        for gallery in (self.gallery, self.heading, self.message):
            if gallery:
                gallery.close()
        self.scene_shown, shown = scene, self.scenes[scene]
        self.step = min(self.step, max(len(shown.times) - 1, 0))
        before = [earlier for earlier, _ in self.earlier]
        self.gallery = views.show(shown, self.title, self.layout, self.display, before, self.step)
        gmsh.model.mesh.clear()  # a mesh drawn by the user may differ from that of the run
        self.outline(False)
        tree.show_results(self.scenes, scene, self.step)
        self.fit_view()
        self.update()

    def keep_or_drop(self) -> None:
        """Archive the current results for comparison, or remove them."""
        if not tree.get_number(tree.KEEP):
            self.drop_results()
        elif self.gallery:
            self.gallery.archive(f"run {len(self.earlier) + 1}:")
            self.earlier.append((self.scenes[self.scene_shown], self.gallery))
            self.gallery = None

    def hide_results(self) -> None:
        """Show the undeformed outline without results, as none are of the tree's request."""
        tree.hide_results()
        self.heading.close()
        self.outline(True)
        if self.tree.checked:
            self.fit_view()
        self.update()

    def drop_results(self) -> None:
        """Remove the results of all runs."""
        for gallery in (*(gallery for _, gallery in self.earlier), self.gallery):
            if gallery:
                gallery.close()
        self.scenes, self.earlier, self.gallery, self.last_request = [], [], None, None
        tree.hide_results()


#: Options of Gmsh: no actions of its own after a change of a parameter; appearance of the window.
OPTIONS = {
    "Solver.AutoMesh": 0,
    "Solver.AutoSaveDatabase": 0,
    "Solver.AutoLoadDatabase": 0,
    "Solver.AutoCheck": 1,
    "General.Verbosity": 3,
    "General.Terminal": 0,
    "General.SmallAxes": 0,
    "General.Antialiasing": 1,
    "General.BackgroundGradient": 0,
    "General.GraphicsFontSize": 12,
    "General.GraphicsFontSizeTitle": 14,
    "Geometry.Points": 0,
}


def prepare() -> None:
    """Start Gmsh with the options of the window, before it opens."""
    start_gmsh()
    gmsh.onelab.clear()
    gmsh.option.setString("General.GraphicsFontEngine", "StringTexture")
    for name, value in OPTIONS.items():
        gmsh.option.setNumber(name, value)


def button(action: tuple[str, str]) -> dict[str, Any]:
    """Entry of Gmsh's button for an action: its label, the action."""
    return {"type": "string", "name": BUTTON, "values": list(action), "visible": False}


#: Parameters of loads that the drawing shows, besides the levels.
DRAWN_LOADS = "crest_water", "silt_height", "force_x", "force_y", "anchor_angle"


def drawing_key(sheet: Sheet) -> tuple[Any, ...]:
    """All that the drawing depends on."""
    case = sheet.case
    loads = [case[name] for name in DRAWN_LOADS]
    return sheet.path, shares(case), max(case.levels), max(case.tail_levels), loads


def gui(request: Request) -> None:
    """Open the window with a request; returns when it is closed.

    Raises InputError before the window opens, RunError without a display.
    """
    request.load()
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise RunError("gui: needs a display; set DISPLAY, or use damjoint run")
    prepare()
    open_window()
    session = Session(request, windowed=True)
    try:
        while gmsh.fltk.isAvailable():
            gmsh.fltk.wait(TURN)
            try:
                session.turn()
            except Exception as error:  # the window must stay open
                session.on_failed(f"{type(error).__name__}: {error}")
    except KeyboardInterrupt:
        pass  # Ctrl-C in the terminal closes the window, too
    finally:
        session.close()
