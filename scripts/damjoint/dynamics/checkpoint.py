"""An earthquake under way on disk, from which an interrupted run continues.

An entry as in the cache (see storage.py) with numpy's npz: nothing that could be executed.
"""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..arrays import Array
from ..fem.cache import bodies_key, sources
from ..input.case import Case
from ..storage import read_entry, write_entry
from . import record_files
from .history import Peak, QuakeHistory
from .scheme import Motion
from .stepper import Earthquake


def fingerprint(case: Case, span: tuple[float, float] | None) -> str:
    """Hash of all that an earthquake depends on; span: of its frames."""
    record = record_files.record_bytes(case.record, case.record_vertical)
    values = [joint.values for joint in case.joints]
    loading = case.levels, case.tail_levels, case.times
    scene = json.dumps(
        [__version__, sources(), bodies_key(case), values, loading, span], default=str
    )
    return hashlib.sha256(scene.encode() + record).hexdigest()


def leaves(value: Any) -> Iterator[Array]:
    """The arrays and numbers in a tree of dataclasses and tuples."""
    if is_dataclass(value) and not isinstance(value, type):
        for part in fields(value):
            yield from leaves(getattr(value, part.name))
    elif isinstance(value, (tuple, list)):
        for item in value:
            yield from leaves(item)
    elif value is not None:
        yield np.asarray(value, float)


def with_leaves(value: Any, arrays: Iterator[Array]) -> Any:
    """A tree of the same form with other arrays and numbers."""
    if is_dataclass(value) and not isinstance(value, type):
        parts = {f.name: with_leaves(getattr(value, f.name), arrays) for f in fields(value)}
        return replace(value, **parts)
    if isinstance(value, (tuple, list)):
        return type(value)(with_leaves(item, arrays) for item in value)
    if value is None:
        return None
    array = next(arrays)
    return float(array) if array.ndim == 0 else array


def write(path: Path, key: str, quake: Earthquake, history: QuakeHistory) -> None:
    """Write the last converged step and all rows; key: fingerprint of the case."""
    now = quake.now
    variables = now.state.variables.joints, now.state.node_variables.joints
    content: dict[str, Any] = {
        "time": np.array(now.time),
        "jump": now.state.jump,
        "motion": np.array(list(leaves(now.retained))),
        "forces": now.forces,
        "columns": np.array(list(history.rows)),
        "rows": np.array(list(history.rows.values())),
        "stress": np.array(history.stress),
        "frames": np.array(history.frames.displacement),
        "frame_rows": np.array(list(history.frames.history.rows.values())),
        "frame_tables": np.array(history.frames.history.tables),
        "peaks": np.array(list(history.peaks)),
        "peak_values": np.array([[peak.value, peak.time] for peak in history.peaks.values()]),
        "peak_states": np.array([peak.displacement for peak in history.peaks.values()]),
    }
    content |= {f"variable_{i}": leaf for i, leaf in enumerate(leaves(variables))}
    content |= {f"stored_{i}": leaf for i, leaf in enumerate(leaves(now.state.stored))}
    with write_entry(path, key) as file:
        np.savez(file, **content)


def exists(path: Path, key: str) -> bool:
    """Whether a file has a run under way of this key, and is not damaged."""
    try:
        with read_entry(path, key):
            return True
    except (OSError, ValueError):
        return False


def read(path: Path, key: str, quake: Earthquake, history: QuakeHistory) -> None:
    """Continue an earthquake from a file that `exists`, with its rows."""
    with read_entry(path, key) as file, np.load(file) as arrays_by_name:
        stored = dict(arrays_by_name)
    static = quake.problem.static
    arrays = (stored[f"variable_{i}"] for i in itertools.count())
    points, nodes = with_leaves((static.variables.joints, static.node_variables.joints), arrays)
    state = replace(
        static,
        jump=stored["jump"],
        variables=replace(static.variables, joints=points),
        node_variables=replace(static.node_variables, joints=nodes),
        stored=with_leaves(static.stored, (stored[f"stored_{i}"] for i in itertools.count())),
    )
    rows = dict(zip(stored["columns"].tolist(), stored["rows"].tolist(), strict=True))
    frame_rows = zip(history.frames.history.rows, stored["frame_rows"].tolist(), strict=True)
    frames = replace(
        history.frames,
        history=replace(
            history.frames.history,
            rows=dict(frame_rows),
            tables=[(table, extrapolated) for table, extrapolated in stored["frame_tables"]],
        ),
        displacement=list(stored["frames"]),
    )
    stress = list(stored["stress"])
    names = stored["peaks"].tolist()
    values = zip(stored["peak_values"].tolist(), stored["peak_states"], strict=True)
    peaks = {n: Peak(v[0], v[1], w) for n, (v, w) in zip(names, values, strict=True)}
    now = replace(
        quake.problem.at_rest,
        time=float(stored["time"]),
        state=state,
        retained=Motion(*stored["motion"]),
        forces=stored["forces"],
    )
    history.rows, history.frames, history.stress, history.peaks = rows, frames, stress, peaks
    history.complete = len(stress), len(frames), now
    quake.now = now
