"""Solve a case and write its results."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from . import accuracy
from .engines import Outcome, engine_of
from .fem.memory import seconds, sizes
from .input.case import Case
from .model.results import Results
from .progress import INTERVAL, Progress
from .session import Session, session, study_end

if TYPE_CHECKING:  # runs without a picture do not load it
    from .pictures.drawing_process import DrawingProcess


class RunProgress(Progress):
    """Progress over the times of all scenes."""

    def __init__(self, case: Case, show: bool) -> None:
        count = len(case.scenes())
        bar = "{desc} {percentage:3.0f}%|{bar}| {elapsed}"
        total, soon = count * case.times[-1], seconds(case) > INTERVAL
        super().__init__(sizes(case), total, show, soon, bar_format=bar, leave=False)
        self.name, self.reached = case.name, [0.0] * count

    def step(self, scene: int, now: float) -> None:
        """Advance to the time of a converged step; called by the engines."""
        if self.title != self.name or self.stage:
            self.describe(self.name)
        self.update(now - self.reached[scene])
        self.reached[scene] = now


def compute(case: Case, engine: str = "auto", fields: bool = True) -> Outcome:
    """The outcome of a case with its first uplift alone; as `compute_scenes`."""
    return next(compute_scenes(replace(case, also_uplift=()), engine, fields))


def compute_scenes(case: Case, engine: str = "auto", fields: bool = True) -> Iterator[Outcome]:
    """The outcome of each scene of a case; nothing is written.

    engine: see `engine_of`; fields: whether those of the bodies are needed. Raises InputError,
    RunError.
    """
    for outcome in accuracy.solve(case, engine_of(case, engine), lambda *_: None, fields):
        if outcome.error:
            raise outcome.error
        yield outcome


def run(
    case: Case,
    out: Path,
    fields: bool = True,
    picture: bool = True,
    progress: bool = True,
    engine: str = "auto",
    drawing: DrawingProcess | None = None,
    key: str = "",
    further: Callable[[Results, Path], None] = lambda result, folder: None,
    stage: str = "",
    on_saved: Callable[[Results], None] = lambda result: None,
) -> list[Results]:
    """Solve all scenes of a case and write their results below out, replacing an earlier run's.

    fields: also write displacement, stress and joint fields for Gmsh and ParaView; picture: also a
    PNG; engine: see `engine_of`; drawing: draws the pictures, by
    default this process does; key: see `Session`; further: writes further tables of a scene into
    its folder; stage: what the progress says meanwhile; on_saved: called with each scene's results
    before fields and pictures are written, which may fail.
    Returns the results in the order of case.scenes(). A run that stops early or is interrupted
    writes its converged steps. Raises InputError, RunError.
    """
    solver, outcomes = engine_of(case, engine), list[Outcome]()
    with session(case, out, key=key) as study:
        shown = RunProgress(case, progress)
        with shown:
            for outcome in accuracy.solve(case, solver, shown.step, fields or picture):
                if stage:
                    shown.describe(case.name, stage)
                save(study, outcome, further)
                outcomes.append(outcome)
                if outcome.error:
                    raise outcome.error
        for outcome in outcomes:
            on_saved(outcome.result)
        if fields or picture:
            write_fields_and_pictures(study, outcomes, fields, picture, drawing)
    return [outcome.result for outcome in outcomes]


def write_outcomes(case: Case, outcomes: list[Outcome], out: Path) -> None:
    """Write outcomes of a case below out as `run` does, replacing an earlier run's.

    Raises InputError if out can not be written.
    """
    with session(case, out) as study:
        for outcome in outcomes:
            save(study, outcome)
        write_fields_and_pictures(study, outcomes, fields=True, picture=True)


def save(
    study: Session,
    outcome: Outcome,
    further: Callable[[Results, Path], None] = lambda result, folder: None,
) -> None:
    """Write the tables of a scene and its run.json."""
    ended = early_end(outcome.result, outcome.error)
    study.save(outcome.result, *ended, more=partial(further, outcome.result))


def early_end(result: Results, error: BaseException | None) -> tuple[str, str]:
    """State (failed or interrupted) and message of a scene that an error ended; else empty."""
    last = result.last
    where = f" after level {last['level']:.6g} m" if last else " before the first step"
    return study_end(error, where)


def write_fields_and_pictures(
    study: Session,
    outcomes: list[Outcome],
    fields: bool,
    picture: bool,
    drawing: DrawingProcess | None = None,
) -> None:
    """Write fields and pictures of saved scenes."""
    from .model.fields import Solution

    def write(outcome: Outcome, folder: Path) -> None:
        solution = Solution(outcome.result, outcome.mesh().bodies, outcome.fields())
        if picture and drawing:
            drawing.send(solution, folder)
        if fields and solution.fields:
            from .post.field_files import write_fields

            write_fields(solution, folder / "fields")
        if picture and not drawing:
            from .pictures.run_picture import draw

            draw(solution, folder)
        if picture and any(joint["time_unit"] for joint in outcome.result.case.joints):
            from .pictures import water_picture  # loads matplotlib

            if water_picture.has(outcome.result):
                water_picture.draw(outcome.result, folder)

    for outcome in outcomes:
        study.add(outcome.result, partial(write, outcome))
    if picture and drawing:
        wait = drawing.wait
        for outcome in outcomes:
            study.add(outcome.result, lambda _: wait())
