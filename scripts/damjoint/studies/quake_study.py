"""`damjoint quake`: earthquakes of a case by one or several records, their files and their rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from .. import InputError
from ..arrays import Value
from ..dynamics.checkpoint import fingerprint
from ..engines import check_engine
from ..engines.getdp import quake as getdp_quake
from ..input.case import Case
from ..model.fields import Solution
from ..post import folder as folders
from ..post import tables
from ..post.field_files import write_fields
from ..post.summary import aligned, fitted
from ..session import Session, finished, session, several
from ..storage import atomic_write
from . import quake, quake_getdp, quake_summary
from .plan import in_file
from .quake import Checkpoint, Span
from .quake_result import QuakeResult, QuakeTables

#: Files of an earthquake: rows, tables of the joints in the frames, stress along the first joint in
#: time, the run under way.
ROWS, FRAMES, STRESS = "quake.csv", "quake_joint.csv", "quake_stress.npz"
CHECKPOINT = "quake_state.npz"


@dataclass(frozen=True)
class Options:
    """How earthquakes are computed, and what is written of them."""

    engine: str = "auto"
    #: of the frames [s]; None: the whole record
    span: Span = None
    fields: bool = False
    picture: bool = True
    progress: bool = True


@dataclass(frozen=True)
class Ended:
    """An earthquake that has come to its end."""

    case: Case
    out: Path
    #: see `QuakeTables`
    summary: dict[str, Any]
    verdict: str
    statement: str

    @classmethod
    def of(cls, result: QuakeTables, out: Path) -> Ended:
        """What is printed of a result; out: its folder."""
        return cls(result.case, out, result.summary, result.verdict, result.statement)

    @property
    def row(self) -> dict[str, Value]:
        """Its row of records.csv."""
        names = {"folder": self.out.name, "record": str(self.case.record or "")}
        columns = quake_summary.columns(self.case, self.summary)
        return {**names, **columns, "verdict": self.verdict, "statement": self.statement}

    @property
    def stands(self) -> bool:
        """Whether the dam stands after it."""
        return self.verdict == quake_summary.STANDS


def check(case: Case, options: Options) -> None:
    """Raise InputError if the earthquake of a case can not be computed so."""
    check_engine(case, options.engine, ("auto", "condensed", "getdp"))
    quake.check(case, options.span)
    if options.engine == "getdp":
        if options.fields:
            raise InputError("--fields: must not be given with --engine getdp")
        getdp_quake.check(case)


def compute(case: Case, options: Options, saved: Checkpoint | None = None) -> QuakeTables:
    """The earthquake of a case, up to its end or to an error; nothing is written but `saved`.

    Raises InputError, RunError.
    """
    if options.engine == "getdp":
        return quake_getdp.compute(case, options.progress)
    return quake.compute(case, options.span, saved, options.progress)


def run(case: Case, out: Path, options: Options = Options(), key: str = "") -> QuakeTables:
    """Compute the earthquake of a case and write its results into a folder.

    key: see `session`. An interrupted one continues with the same command, but not by GetDP. Raises
    InputError, RunError.
    """
    check(case, options)
    folders.check_writable(out)
    saved = Checkpoint(out / CHECKPOINT, fingerprint(case, options.span))
    # a table of all steps is that of a run without interruption
    continues = options.engine != "getdp" and not case.all_steps
    with session(case, out, continues and saved.exists, key) as study:
        result = compute(case, options, saved if continues else None)
        ended = result.error is None
        save(study, result, options.fields and ended, options.picture and ended)
        if result.error:
            raise result.error
        saved.path.unlink(missing_ok=True)
    return result


def save(study: Session, result: QuakeTables, fields: bool, picture: bool) -> None:
    """Write the files of an earthquake; of the condensed engine also fields, those of the frames or
    else of the static states, and with picture the picture.
    """
    study.save(result.static, result.state, result.statement, partial(write_tables, result))
    if not isinstance(result, QuakeResult) or result.error:
        return
    if fields:
        solution = Solution(result.frames, result.mesh.bodies, result.fields())
    else:
        solution = Solution(result.static, result.mesh.bodies, result.static_fields())
    result.static.info["frames"] = fields
    study.add(result.static, lambda out: write_fields(solution, out / "fields"))
    if picture:
        from .quake_picture import draw  # matplotlib takes long to load

        study.add(result.static, partial(draw, result))


def write_tables(result: QuakeTables, out: Path) -> None:
    """Write the tables of an earthquake."""
    tables.write_csv(out / ROWS, result.rows)
    if isinstance(result, QuakeResult):
        tables.write_csv(out / FRAMES, tables.rounded(result.frames.joint))
        with atomic_write(out / STRESS) as part, part.open("wb") as file:
            np.savez_compressed(file, **result.stress)  # type: ignore[arg-type]


def run_records(
    cases: Sequence[Case], out: Path, options: Options, jobs: int | None = None
) -> list[Ended]:
    """Compute the earthquakes of a case by several records, each into a folder below out that has
    the name of its record; a single one into out.

    Writes records.csv. Earthquakes that have come to their end are not computed again by the same
    command. Raises InputError, RunError.
    """
    for case in cases:
        check(case, options)
    if len(cases) == 1:
        return [Ended.of(run(cases[0], out, options), out)]
    names = [case.record.stem if case.record else "" for case in cases]
    for case, name in zip(cases, names, strict=True):
        if names.count(name) > 1:
            raise InputError(f"record {case.record}: must be given once, and have its own name")
    tasks = {out / n: (case, out / n, options) for case, n in zip(cases, names, strict=True)}
    for results in several(run_record, tasks, out, jobs, "quake"):
        if len(results) == len(cases):
            rows = [result.row for result in results]
            columns = {name: [in_file(row[name]) for row in rows] for name in rows[0]}
            tables.write_csv(out / folders.RECORDS, columns)
    return results


def run_record(task: tuple[Case, Path, Options], progress: bool) -> Ended:
    """Compute an earthquake, or read that of an earlier command."""
    case, out, options = task
    key = f"{fingerprint(case, options.span)} {options} {case.all_steps}"
    if finished(out, key):
        info = folders.read_info(out) or {}
        return Ended(case, out, info["quake"], info["verdict"], info["statement"])
    return Ended.of(run(case, out, replace(options, progress=progress), key), out)


#: Columns of the printed table of several earthquakes, and their headings.
SHOWN = (
    *("folder", "peak_ground_ax", "peak_ground_vx", "arias_x", "spectral_ax"),
    *("residual_slip", "residual_tilt", "rigid_block_slip", "peak_opening", "verdict"),
)
HEADS = (
    *("record", "ground\n[m/s2]", "\n[m/s]", "Arias\n[m/s]", "Sa(T1)\n[m/s2]"),
    *("residual\nslip [m]", "tilt", "rigid\nblock [m]", "opening\n[m]", "verdict"),
)


def records_table(results: Sequence[Ended], width: int | None = None) -> str:
    """Table of earthquakes: acceleration, residuals, verdict; width: None: all columns."""
    cells = [
        [v if isinstance(v, str) else f"{v:.4g}" for v in (r.row[name] for name in SHOWN)]
        for r in results
    ]
    less = SHOWN[7], SHOWN[6], SHOWN[8], *SHOWN[4:0:-1]
    return fitted(SHOWN, HEADS, cells, less, width, partial(aligned, left=1))
