"""An earthquake by the reference GetDP model: its tables and run.json."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .. import RunError
from ..arrays import Table
from ..dynamics.stepper import Earthquake
from ..engines.getdp import quake as engine
from ..fem.bodies import Bodies
from ..joint.interface import interface_of
from ..model.case import Case
from ..model.notes import remarks
from ..post import folder as folders
from ..post import tables
from ..progress import Progress
from ..solver.model import Model
from ..statics.verdict import statement
from ..versions import provenance
from . import quake, quake_summary


@dataclass(frozen=True, kw_only=True)
class GetdpQuakeResult:
    """The rows of an earthquake and what they amount to."""

    case: Case
    rows: Table
    #: for run.json
    summary: dict[str, Any]
    #: whether the verdict is that it stands after the earthquake
    stands: bool
    statement: str


def left_out(case: Case, out: Path, picture: bool) -> Iterator[str]:
    """Yield what a run into a folder does not do, in words; picture: whether one is wanted.

    Raises InputError.
    """
    check(case)
    found = folders.read_info(out)
    if found and found.get("state") in ("interrupted", "running"):
        yield f"out = {out}: --engine getdp starts an interrupted earthquake again"
    if picture:
        yield "--engine getdp draws no picture of an earthquake: its tables only"


def check(case: Case) -> None:
    """Raise InputError if GetDP can not compute the earthquake of a case."""
    quake.check(case)
    engine.check(case)


def run(case: Case, out: Path, progress: bool = True) -> GetdpQuakeResult:
    """Compute the earthquake of a case by GetDP and write its tables into a folder.

    An interrupted run starts again. Raises InputError, RunError.
    """
    check(case)
    with folders.claim_output_folder(case, out):
        try:
            vibrations = earthquake_of(case)
            found = solve(vibrations, progress)
        except BaseException as error:
            state = "failed" if isinstance(error, Exception) else "interrupted"
            folders.write_state(case, out, state, str(error) or "no step had converged")
            raise
        error = found.error
        if found.static.stopped:
            reason = statement(found.static)
            error = RunError(f"earthquake: the static loads have no equilibrium: {reason}")
        state = words = ""
        if error:
            state = "failed" if isinstance(error, Exception) else "interrupted"
            words = f"{state}: {error}" if str(error) else state
        result = result_of(vibrations, found, words)
        write(result, found, out, state)
        if error:
            raise error
    return result


def earthquake_of(case: Case) -> Earthquake:
    """The record, longest step, natural frequencies and damping of a case, of the condensed bodies;
    without any state.
    """
    with quake.single_thread():
        model = Model(case, interface_of(case))
        return Earthquake(model.case, model, model.start(), Bodies.of(case))


def solve(vibrations: Earthquake, progress: bool) -> engine.GetdpQuake:
    """Run GetDP, with a progress bar."""
    case, record = vibrations.case, vibrations.record
    options = {"bar_format": quake.BAR, "leave": False}
    with Progress(case.name, record.duration, progress, **options) as bar:
        reached = 0.0

        def on_step(time: float) -> None:
            nonlocal reached
            bar.update(time - reached)
            reached = time

        return engine.solve(case, record, vibrations.damping, vibrations.dt, on_step)


def result_of(vibrations: Earthquake, found: engine.GetdpQuake, words: str) -> GetdpQuakeResult:
    """The result; words: on an early end."""
    case, rows = vibrations.case, found.rows
    number = len(rows["time"])
    halvings = round(np.log2(vibrations.dt / rows["dt"].min())) if number else 0
    summary = quake_summary.summary(vibrations, rows, halvings)
    seconds = {name: round(value, 3) for name, value in found.seconds.items()}
    summary["seconds"] = seconds | {"steps": number}
    stands = False
    if not words:
        summary["after"] = {"equilibrium": bool(found.stands)}
        words = quake_summary.statement(case, summary)
        stands = quake_summary.verdict(case, summary) == quake_summary.STANDS
    return GetdpQuakeResult(case=case, rows=rows, summary=summary, stands=stands, statement=words)


def write(result: GetdpQuakeResult, found: engine.GetdpQuake, out: Path, state: str) -> None:
    """Write the tables of the static states, quake.csv and run.json."""
    static = found.static
    tables.write(static, out)
    tables.write_csv(out / quake.ROWS, result.rows)
    static.info |= {"notes": remarks(result.case), "quake": result.summary}
    static.info |= provenance(static.info.pop("getdp"))
    # a joint that has slipped everywhere is no failure here
    static.info["verdict"] = state or quake_summary.verdict(result.case, result.summary)
    folders.write_info(static, out, state, result.statement)
