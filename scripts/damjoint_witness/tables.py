"""Whether the tables of a run are complete, consistent, and those of the command."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from .files import Files, Table, rows_where, split_by
from .reader import Request, differences

#: Relative tolerance of written values: 12 digits, and stresses are differences of larger ones.
DIGITS = 1e-7
#: Of integrals over the points, relative to the sum of the sizes of their parts.
SUMS = 1e-9
#: Columns that joint.csv and steps.csv share, by unit.
COLUMNS = (
    ("delta_n", "delta_t1", "delta_t2", "slip"),
    ("sigma_n_eff", "tau_1", "tau_2", "p"),
    ("damage",),
)


def bookkeeping(files: Files, request: Request) -> Iterator[str]:
    """Check parameters, order of rows, levels, completeness of tables and the exit code."""
    yield from differences(request, files.record)
    history, first = files.history, request.joints[0]
    if not all(np.isfinite(v).all() for name, v in history.items() if "x_resultant" not in name):
        yield "history.csv: a value is not finite"
    if (np.diff(history["time"]) <= 0).any():
        yield "history.csv: times do not increase"
    written = [float(table["time"][0]) for table in files.joint_tables]
    if not files.stopped and written != list(request.requested):
        yield f"joint.csv: tables at t = {written}, requested {request.requested}"
    room = DIGITS * first["dam_height"]
    for name, prescribed in (("level", request.level_at), ("tail_level", request.tail_at)):
        if name == "level" and first["drive"] != "level":
            continue
        off = np.abs(history[name] - [prescribed(t) for t in history["time"]])
        if off.max(initial=0) > room:
            yield f"history.csv: {name} is off by {off.max():.3g} m from the prescribed one"
    if (history["level"] < -room).any():
        yield f"level {history['level'].min():.4g} m is below 0"
    mode, _, named = str(files.record["verdict"]).partition(" on ")
    names = [joint["name"] for joint in files.record["joints"]] or [""]
    failing = [
        v
        for v, name in zip(request.joints, names, strict=True)
        if not named or name in named.split(" and ")
    ]
    hardens = all(v["law"] == "friction" and v["hardening_requested"] for v in failing)
    failed = files.stopped or (mode == "sliding" and not hardens)
    if files.exit_code != int(failed):
        state = f"state {files.record['state']}, verdict {files.record['verdict']}"
        yield f"exit code {files.exit_code} with {state}"


def step_of(updates: list[Table], time: float, level: float) -> Table | None:
    """The last update at a level, the nearest in time; of the limit point of an equilibrium path
    the row has a time between those of its step.
    """
    same = [u for u in updates if abs(u["level"][0] - level) <= 1e-10 * (1 + abs(level))]
    away = [abs(u["time"][0] - time) for u in same]
    return next((u for u, d in zip(same[::-1], away[::-1], strict=True) if d == min(away)), None)


def updates_of(steps: Table, joint: int, nodes: bool) -> list[Table]:
    """The updates of steps.csv of a joint (from 0) at its nodes, or at its integration points."""
    at_nodes = steps["weight"] == 0
    return split_by(
        rows_where(steps, (steps["joint"] == joint + 1) & (at_nodes == nodes)), "update"
    )


def integrals(files: Files, request: Request, steps: Table) -> Iterator[str]:
    """Check that N, T and M of history.csv are the integrals of the written tractions over the
    integration points.
    """
    for k, section in enumerate(request.sections):
        updates, rows = updates_of(steps, k, nodes=False), files.history_of(k)
        along = math.cos(section.slope), math.sin(section.slope)
        for n, (time, level) in enumerate(zip(rows["time"], rows["level"], strict=True)):
            u = step_of(updates, time, level)
            if u is None:
                yield f"joint {k + 1}: steps.csv has no step of the row at t = {time:g}"
                break
            s = (u["x"] - section.heel[0]) * along[0] + (u["y"] - section.heel[1]) * along[1]
            pressed = -u["weight"] * u["sigma_n_eff"]
            parts = pressed, u["weight"] * u["tau_1"], pressed * (section.length - s)
            for name, part in zip("NTM", parts, strict=True):
                if abs(rows[name][n] - part.sum()) > SUMS * np.abs(part).sum():
                    off = f"{name} = {rows[name][n]:.9g}, the integral is {part.sum():.9g}"
                    yield f"joint {k + 1}: {off} at t = {time:g}"
                    return


def nodes(files: Files, request: Request, steps: Table) -> Iterator[str]:
    """Check that the rows of joint.csv are those of the nodes in steps.csv."""
    for k in range(len(request.joints)):
        updates = updates_of(steps, k, nodes=True)
        for table in files.tables_of(k):
            time, level = float(table["time"][0]), float(table["level"][0])
            yield from rows_of_nodes(table, step_of(updates, time, level), "joint.csv", k)


def rows_of_nodes(table: Table, step: Table | None, name: str, joint: int) -> Iterator[str]:
    """Check the rows of a table of a joint (from 0) at a time against those of steps.csv."""
    where = f"{name} is off at t = {table['time'][0]:g}"
    if step is None or len(step["x"]) != len(table["x"]):
        yield f"joint {joint + 1}: steps.csv has no step of {where}"
        return
    one, other = (np.lexsort([np.round(rows[axis], 6) for axis in "zyx"]) for rows in (table, step))
    for columns in COLUMNS:
        scale = max(np.abs(step[column]).max() for column in columns)
        for column in columns:
            off = np.abs(table[column][one] - step[column][other]).max()
            if off > SUMS * scale:
                yield f"joint {joint + 1}: {column} of {where}"
                return
