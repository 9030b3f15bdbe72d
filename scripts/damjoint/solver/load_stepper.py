"""The loading of a case followed from its first to its last step, with the strategy of
pro/strategy.pro.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..joint.interface import Interface
from ..model.case import Case
from ..model.loads import Loading
from ..model.results import Results
from .history import State
from .path import ROUGH, SURE, Path, Point
from .stepping import Stepper


class Filling(Stepper):
    """The loading of a case followed step by step; the converged steps are rows, the requested
    levels tables.
    """

    def __init__(
        self, case: Case, interface: Interface, on_step: Callable[[float], None] = lambda time: None
    ) -> None:
        super().__init__(case, interface, on_step)
        self.stopped = False
        #: whether a path has been followed to its end
        self.followed = False
        #: how the dam fails, once its equilibrium path has shown that it does
        self.mechanism: dict[str, float | str] = {}
        #: the levels from which the path has fallen and to which it has come back, and its lowest
        #: ones on the way [m]
        self.snapped: tuple[tuple[float, float], ...] = ()
        #: the levels at which the joint ran on, to a state that depends on the way there
        self.ran_on: tuple[float, ...] = ()

    def run(self) -> Results:
        """Follow all the times of the case that are still to come."""
        for target in self.case.times:
            if target > self.state.time and not self.stopped:
                self.reach(target)
                if target in self.case.requested and not self.stopped:
                    self.record.save(self.state)
        if self.stopped:
            self.keep_last()
        return self.results()

    def rest(self) -> bool:
        """The state under the weight alone, from where displacements count; whether there is one.

        It has no row in the history.
        """
        found = self.solve_by(self.attempts(), 0.0)
        if found is None:
            return False
        self.state = found[0]
        if self.case["weight_first"]:
            self.record.at_rest = self.state
        if self.driven:
            self.displacement = self.driven_displacement(self.state)
        return True

    def keep_last(self) -> None:
        """Make a table of the last converged state, if there is none yet."""
        if self.state.time > 0 and self.record.saved_until < self.state.time:
            self.record.save(self.state)

    def reach(self, target: float) -> None:
        """Steps up to a time; a step that fails is cut, the next ones grow back.

        The first step holds the weight, too, at any length: it is cut to the weight alone first.
        """
        # what is driven from t = 0 on counts from the weight alone, too
        first = self.case["weight_first"] or (self.driven and self.case["drive_begin"] == 0)
        if first and self.state.time == 0 and not self.state.jump.any():
            self.rest()
        *attempts, last_resort = self.attempts()
        cuts, dt, weighed = 0, np.inf, self.state.time > 0 or self.state.jump.any()
        while self.state.time < target and not self.stopped:
            time = min(self.state.time + dt, target)
            time = target if target - time < 1e-9 else time
            smallest = time - self.state.time < self.case["smallest_step"] * (1 + 1e-9)
            ended = self.followed and (self.mechanism or not smallest)
            quick = ended or (self.ran_on and not smallest)
            likely = attempts[:1] if quick else attempts
            found = self.solve_by(likely, time, ahead=True, insist=smallest)
            if found is None and not weighed:
                weighed = True
                if self.rest():
                    cuts += 1
                    continue
            if found is None and not ended:
                found = self.snap_through(time, cuts, smallest)
            if found is None:
                tried, cuts = time - self.state.time, cuts + 1
                dt = max(self.case.shared["cut"][0] * tried, self.case["smallest_step"])
                if smallest and self.mechanism:
                    self.stopped = True
                elif smallest:
                    time, found = target, self.solve_by([last_resort], target)
                    self.stopped = found is None
            if found:
                dt = 2 * (time - self.state.time)
                self.accept(cuts, *found)
                cuts = 0

    def snap_through(
        self, time: float, cuts: int, smallest: bool
    ) -> tuple[State, int, float] | None:
        """A step over unstable crack growth, after which there is no equilibrium near the last one.

        Along the equilibrium path, unless opening ends the shear stiffness: such a path has a kink
        and a turn at every point. Else, and where the path is not found, by relaxation.
        """
        law, found = self.joint.law, None
        if not (law.releases or self.driven or self.followed) and (smallest or not cuts):
            found = self.along_path(time)
            if self.followed and not smallest:  # shorter steps from where the path has ended
                return None
        if found is None and (law.breaks or self.joint.flowing):
            known = self.ran_on or smallest or cuts > 0
            if relaxed := self.relaxed(time, wherever=law.breaks and bool(known)):
                *found, own = relaxed
                if not own:
                    self.ran_on += (found[0].loading.level,)
        return found

    def along_path(self, time: float) -> tuple[State, int, float] | None:
        """A step along the equilibrium path, until the level of its time is there.

        If it never is the dam fails: `mechanism`. Then, and where the path is lost, its highest
        level is the last step if only the level changes in it; else shorter steps are to be tried.
        """
        begin, wanted = self.state, self.case.level_at(time)
        if begin.time == 0 or wanted < begin.loading.level:
            return None
        start = Point(self.fork(self.case))
        path = Path([start], time)
        path.advance()
        if path.stuck:
            return None
        same = self.same_but_for_level(path.points[1].filling.state.loading, begin.loading)
        if not same:
            del path.points[0]  # no point of this path: other loads acted
        while path.points[-1].level < wanted:
            # an earlier path's mechanism, under other loads, does not end this one
            failing = path.slides or path.settled(ROUGH if path.stuck else SURE)
            if failing:
                self.fails(path)
            if failing or path.stuck:
                path.refine()
                if failing:
                    self.mechanism["level"] = float(path.highest)
                self.followed = same
                if same:
                    self.end_at_knee(path)
                return None
            path.advance()
        levels = [point.level for point in path.points]
        last, beyond = start.filling, path.points[-1].filling
        jump = beyond.state.jump
        if len(levels) > 1:
            last = path.points[-2].filling
            share = (wanted - levels[-2]) / (levels[-1] - levels[-2])
            jump = last.state.jump + share * (jump - last.state.jump)
        found = last.solve_by(self.attempts()[:3], time, start=(jump, wanted))
        if found is None:
            return None
        self.note_falls(levels)
        spent = sum(beyond.record.rows["iterations"][len(self.record.rows["time"]) :])
        return found[0], int(spent) + found[1], found[2]

    def note_falls(self, levels: list[float]) -> None:
        """Remember from where, and how far, the level of a path has fallen on its way."""
        falls = np.flatnonzero(np.diff(levels) < 0)
        if len(falls):
            self.snapped += ((float(levels[falls[0]]), float(min(levels[falls[0] :]))),)

    def same_but_for_level(self, one: Loading, other: Loading) -> bool:
        """Whether two loadings differ in nothing else that acts."""
        loads = (self.joint.loads(replace(loading, level=0.0)) for loading in (one, other))
        return one.tail == other.tail and np.array_equal(*loads)

    def fails(self, path: Path) -> None:
        """The mechanism of a path that has no equilibrium at the level asked for."""
        pushed = path.points[-1].pushed / (path.points[path.knee].pushed or path.size)
        self.mechanism = {"mode": path.mode, "pushed": float(pushed), "time": path.time}

    def end_at_knee(self, path: Path) -> None:
        """Take a path's highest level as a step, in which nothing else has changed."""
        top, begin = path.points[path.knee], self.state
        state, rise = top.filling.state, top.level - begin.loading.level
        if rise > 0:
            share = rise / (self.case.level_at(path.time) - begin.loading.level)
            rows = top.filling.record.rows
            reached = replace(state, time=begin.time + share * (path.time - begin.time))
            spent = sum(rows["iterations"][len(self.record.rows["time"]) :])
            self.accept(0, reached, int(spent), rows["residual"][-1])
            self.note_falls([point.level for point in path.points[: path.knee + 1]])

    def results(self) -> Results:
        """All tables so far, and what is known of failure and unstable crack growth."""
        found = self.record.results(self.case, self.stopped)
        if not self.stopped:
            self.mechanism = {}  # another way has been found
        elif self.mechanism:  # the last steps of the level may have gone a little further
            time, last = self.mechanism["time"], self.state.loading
            if self.same_but_for_level(Loading.at(self.case, time, 0.0, last.tail), last):
                self.mechanism["level"] = max(self.mechanism["level"], float(last.level))
        about = {"mechanism": self.mechanism, "snapped": self.snapped, "ran_on": self.ran_on}
        found.info = {name: value for name, value in about.items() if value}
        return found
