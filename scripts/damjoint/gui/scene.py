"""Solved scenes as the window shows them: the static loads, and an earthquake after them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import InputError, RunError, accuracy
from ..arrays import Table as Columns
from ..engines import Outcome
from ..input.case import Case
from ..mesh.body import Body
from ..model.fields import Field
from ..model.loads import Loading
from ..model.results import Results
from ..post.summary import Table
from ..runner import early_end
from ..statics.statement import statement
from ..statics.verdict import decisive_joint, failed, verdict
from ..studies.quake_result import QuakeResult
from .numbers import Numbers, QuakeNumbers, shown_rows, table_of_frames, table_of_levels, warnings

#: At rest, and after it.
MOTIONS = "static loads", "earthquake"


@dataclass(kw_only=True)
class SolvedScene:
    """The results of a scene, for the window."""

    #: its place among the scenes of a run: joint, uplift, motion
    choices: tuple[str, str, str]
    result: Results
    bodies: dict[str, Body]
    #: displacement and stress by time of the steps
    fields: dict[float, Field]
    verdict: str
    #: interrupted or failed; empty if no error ended the run
    end_state: str
    #: why it ended or failed; empty if the dam stands
    message: str
    #: how it has ended
    statement: str
    failed: bool
    #: number of the joint whose curves and numbers are shown
    joint: int
    #: at each of `times`
    numbers: list[Numbers]
    table: Table
    warnings: list[str]
    #: see `shown_rows`, of an earthquake; else None
    quake: Columns | None = None

    @staticmethod
    def of(outcome: Outcome) -> list[SolvedScene]:
        """The scenes of an outcome, one a joint, the decisive one first; computes the fields."""
        result, (state, _) = outcome.result, early_end(outcome.result, outcome.error)
        bodies, fields, times = outcome.mesh().bodies, outcome.fields(), times_of(result)
        message = statement(result)
        if state and isinstance(outcome.error, (InputError, RunError)):
            message = str(outcome.error)
        elif state:
            message = reached(state, result)
        return [
            SolvedScene(
                choices=scene_choices(result, joint, MOTIONS[0]),
                result=result,
                bodies=bodies,
                fields=fields,
                verdict=verdict(result),
                end_state=state,
                message=message,
                statement=message or "stands",
                failed=bool(state) or failed(result),
                joint=joint,
                numbers=[Numbers.at(joint_result, time) for time in times],
                table=table_of_levels(joint_result),
                warnings=warnings(result),
            )
            for joint, joint_result in shown_first(decisive_joint(result), result)
        ]

    @staticmethod
    def of_earthquake(quake: QuakeResult) -> list[SolvedScene]:
        """The scenes of the static loads and of the earthquake after them, one for each joint; of
        the earthquake that of the largest residual slip first.
        """
        static = Outcome(quake.before, lambda: quake.mesh, quake.static_fields)
        fields = quake.fields()
        scenes = SolvedScene.of(static)
        for joint, _ in shown_first(quake.joint, quake.frames):
            numbers = QuakeNumbers.of(quake, joint)
            earthquake = SolvedScene(
                choices=scene_choices(quake.frames, joint, MOTIONS[1]),
                result=quake.frames,
                bodies=quake.mesh.bodies,
                fields=fields,
                verdict=quake.static.info["verdict"],
                end_state=quake.state,
                message="" if quake.stands else quake.statement,
                statement=quake.statement,
                failed=not quake.stands,
                joint=joint,
                numbers=list(numbers),
                table=table_of_frames(numbers),
                warnings=[],
                quake=shown_rows(quake, joint),
            )
            scenes.append(earthquake)
        return scenes

    @property
    def joint_result(self) -> Results:
        """The results of the joint that is shown."""
        return self.result.joints[self.joint]

    @property
    def times(self) -> np.ndarray:
        """Times of the steps of every view: those levels that were reached, or [s] the frames."""
        return times_of(self.result)

    def loading(self, time: float) -> Loading:
        """The static loads at one of `times`."""
        state, case = self.result.state(time), self.result.case
        at = time if self.quake is None else case.times[-1]
        return Loading.at(case, at, state["level"], state["tail_level"])


def shown_first(joint: int, result: Results) -> list[tuple[int, Results]]:
    """The numbers and results of all joints, one of them first."""
    return sorted(enumerate(result.joints), key=lambda pair: pair[0] != joint)


def scene_choices(result: Results, joint: int, motion: str) -> tuple[str, str, str]:
    """See `SolvedScene.choices`; joint: its number."""
    return result.case.joint_names[joint], result.case.of_all_joints("uplift"), motion


def times_of(result: Results) -> np.ndarray:
    """Times of the tables of the joints."""
    return np.unique(result.joint["time"])


def level_reached(case: Case, level: float, time: float) -> str:
    """The level of a step and its time."""
    return f"level {level:.4g} m, t = {time:.4g} of {case.times[-1]:g}"


def reached(state: str, result: Results) -> str:
    """What a run has reached before it was interrupted, or failed: level, mesh, estimated error."""
    case, estimate = result.case, result.info.get("error_estimate")
    if not result.last:
        return state
    last = result.last
    words = f"{state} at {level_reached(case, last['level'], last['time'])}"
    if estimate:
        meshes = estimate["n_joint"]
        errors = [q["relative"] for q in estimate["quantities"].values() if q["used"]]
        words += f" on mesh {len(meshes)} (n_joint = {meshes[-1]})"
        if errors:
            words += f"; estimated errors up to {accuracy.percent(max(errors))}"
            words += f" of {accuracy.percent(estimate['accuracy'])} required"
    return words
