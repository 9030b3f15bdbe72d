"""An earthquake by the reference GetDP model: its tables and run.json."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from .. import RunError
from ..dynamics.stepper import Earthquake
from ..engines.getdp import quake as engine
from ..fem.bodies import Bodies
from ..fem.factor import single_thread
from ..input.case import Case
from ..joint.interface import interface_of
from ..post import folder as folders
from ..session import study_end
from ..solver.model import Model
from ..statics.statement import statement
from . import quake, quake_summary
from .quake_result import QuakeTables


def omitted_files(out: Path, picture: bool) -> Iterator[str]:
    """Yield what a run into a folder does not do, in words; picture: whether one is wanted."""
    info = folders.read_info(out)
    if info and info.get("state") in ("interrupted", "running"):
        yield f"out = {out}: --engine getdp starts an interrupted earthquake again"
    if picture:
        yield "--engine getdp draws no picture of an earthquake: its tables only"


def compute(case: Case, progress: bool = True) -> QuakeTables:
    """The earthquake of a case by GetDP, up to its end or to an error.

    Raises RunError if nothing was computed.
    """
    with single_thread():  # of the condensed bodies, without any state
        model = Model(case, interface_of(case))
        vibrations = Earthquake(model.case, model, model.start(), Bodies.of(case))
    computed = solve(vibrations, progress)
    error, static = computed.error, computed.static
    if static.stopped:
        reason = statement(static)
        error = RunError(f"earthquake: the static loads have no equilibrium: {reason}")
    rows, number = computed.rows, len(computed.rows["time"])
    halvings = round(np.log2(vibrations.dt / rows["dt"].min())) if number else 0
    summary = quake_summary.summary(vibrations, rows, halvings, resolves_impacts=False)
    seconds = {name: round(value, 3) for name, value in computed.seconds.items()}
    summary["seconds"] = seconds | {"steps": number}
    if not error:
        summary["after"] = {"equilibrium": bool(computed.stands)}
    end = study_end(error)
    return QuakeTables.of(vibrations.case, static, summary, end, error=error, rows=rows)


def solve(vibrations: Earthquake, progress: bool) -> engine.GetdpQuake:
    """Run GetDP, with a progress bar."""
    case, record = vibrations.case, vibrations.record
    with quake.progress_bar(case, record, progress) as bar:
        reached = 0.0

        def on_step(time: float) -> None:
            nonlocal reached
            bar.update(time - reached)
            reached = time

        return engine.solve(case, record, vibrations.damping, vibrations.dt, on_step)
