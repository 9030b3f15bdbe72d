"""Solve a case and write its results."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from . import accuracy, versions
from .engines import Outcome, engine_of
from .fem.memory import sizes
from .model.case import Case
from .model.results import Results
from .post import folder as folders
from .post import tables
from .progress import Progress

if TYPE_CHECKING:  # runs without a picture do not load it
    from .post.drawing_process import DrawingProcess


class RunProgress(Progress):
    """Progress over the times of all scenes."""

    def __init__(self, case: Case, show: bool) -> None:
        count = len(case.scenes())
        bar = "{desc} {percentage:3.0f}%|{bar}| {elapsed}"
        super().__init__(sizes(case), count * case.times[-1], show, bar_format=bar, leave=False)
        self.name, self.reached = case.name, [0.0] * count

    def step(self, scene: int, now: float) -> None:
        """Advance to the time of a converged step; called by the engines."""
        if self.title != self.name:
            self.describe(self.name)
        self.update(now - self.reached[scene])
        self.reached[scene] = now


def run(
    case: Case,
    out: Path,
    fields: bool = True,
    picture: bool = True,
    progress: bool = True,
    engine: str = "auto",
    drawing: DrawingProcess | None = None,
) -> list[Results]:
    """Solve all scenes of a case and write their results below out, replacing an earlier run's.

    fields: also write displacement, stress and joint fields for Gmsh and ParaView; picture: also a
    PNG; engine: condensed (auto) or getdp, the reference model; drawing: draws the pictures, by
    default this process does.
    Returns the results in the order of case.scenes(). A run that stops early or is interrupted
    writes its converged steps. Raises InputError, RunError.
    """
    chosen = engine_of(case, engine)
    outcomes = list[Outcome]()
    with folders.claim_output_folder(case, out):  # after the checks: bad input removes nothing
        try:
            versions.git_status()  # runs on another core meanwhile
            with RunProgress(case, progress) as shown:
                for outcome in accuracy.solve(case, chosen, shown.step, fields or picture):
                    save(outcome, case, out)
                    outcomes.append(outcome)
                    if outcome.error:
                        raise outcome.error
        except BaseException as error:
            if not outcomes:
                state = "failed" if isinstance(error, Exception) else "interrupted"
                folders.write_state(case, out, state, str(error) or "no step had converged")
            raise
        finally:
            versions.commit()
        if fields or picture:
            write_fields_and_pictures(outcomes, case, out, fields, picture, drawing)
    return [outcome.result for outcome in outcomes]


def write_outcomes(case: Case, outcomes: list[Outcome], out: Path) -> None:
    """Write outcomes of a case below out as `run` does, replacing an earlier run's.

    Raises InputError if out can not be written.
    """
    with folders.claim_output_folder(case, out):
        for outcome in outcomes:
            save(outcome, case, out)
        write_fields_and_pictures(outcomes, case, out, fields=True, picture=True)


def save(outcome: Outcome, case: Case, out: Path) -> None:
    """Write the tables of a scene of a case below out, and run.json with memory and times."""
    folder = folders.scene_folder(case, outcome.result.case, out)
    folder.mkdir(exist_ok=True)
    start, result = time.perf_counter(), outcome.result
    tables.write(result, folder)
    result.info["wall_seconds"]["post"] = time.perf_counter() - start
    result.info |= versions.provenance(result.info.pop("getdp", {}))
    folders.write_info(result, folder, *early_end(outcome))


def early_end(outcome: Outcome) -> tuple[str, str]:
    """State (failed or interrupted) and message of a scene that an error ended; else empty."""
    if not outcome.error:
        return "", ""
    last = outcome.result.last
    where = f" after level {last['level']:.6g} m" if last else " before the first step"
    state = "failed" if isinstance(outcome.error, Exception) else "interrupted"
    return state, f"{state}{where}" + (f": {outcome.error}" if str(outcome.error) else "")


def write_fields_and_pictures(
    outcomes: list[Outcome],
    case: Case,
    out: Path,
    fields: bool,
    picture: bool,
    drawing: DrawingProcess | None = None,
) -> None:
    """Write fields and pictures of the scenes of a case; add the seconds to run.json."""
    from .model.fields import Solution

    for outcome in outcomes:
        with added_seconds(outcome.result):
            folder = folders.scene_folder(case, outcome.result.case, out)
            solution = Solution(outcome.result, outcome.mesh().bodies, outcome.fields())
            if picture and drawing:
                drawing.send(solution, folder)
            if fields and solution.fields:
                from .post.field_files import write_fields

                write_fields(solution, folder / "fields")
            if picture and not drawing:
                from .post.pictures import draw

                draw(solution, folder)
    for outcome in outcomes:
        with added_seconds(outcome.result):
            if picture and drawing:
                drawing.wait()
        folder = folders.scene_folder(case, outcome.result.case, out)
        folders.write_info(outcome.result, folder, *early_end(outcome))


@contextlib.contextmanager
def added_seconds(result: Results) -> Iterator[None]:
    """Add the seconds of a block to those of writing the results."""
    start = time.perf_counter()
    yield
    result.info["wall_seconds"]["post"] += time.perf_counter() - start
