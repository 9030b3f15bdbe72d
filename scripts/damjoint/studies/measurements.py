"""Measurements at a dam: a CSV file with a row per reading, and what a run computes of the same."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .. import InputError, RunError
from ..arrays import Array
from ..input.case import Case
from ..input.resolve import varied
from ..joint.interface import interface_of
from ..model.results import Results, history_columns
from ..solver.derivatives import Differentiation
from ..solver.load_stepper import LoadStepper
from ..solver.sides import SidesInStep

#: Columns of the file besides those that are measured: of the reservoir and the tailwater [m above
#: the heel], and a text that is only copied.
LEVEL, TAIL, DATE = "level", "tail_level", "date"
#: Ending of the column with the standard deviations of a measured one.
DEVIATION = "_sd"
#: Beginning of a column of a piezometer: its distance from the heel follows, then "_2" in joint 2.
HEAD = "head_"
#: Columns of history.csv that nobody measures.
NOT_MEASURED = ("time", "level", "load_factor", "iterations", "cuts", "residual", "tail_level")


@dataclass(frozen=True)
class Series:
    """What one instrument has measured, a value per reading."""

    name: str
    unit: str
    #: nan where it was not read
    measured: Array
    #: standard deviations of the measured values
    deviation: Array
    #: of a piezometer: number of its joint from 0, and distance from the heel [m]
    joint: int = 0
    position: float | None = None

    def computed(self, results: Results, times: Array) -> Array:
        """The same quantity in a run, at times; nan where the run has none."""
        if self.position is None:
            at = np.round(results.history["time"], 9)
            values = dict(zip(at.tolist(), results.history[self.name], strict=True))
            return np.array([values.get(time, np.nan) for time in times.tolist()])
        case = results.case.joints[self.joint]
        table = results.of_joint(self.joint).joint
        weight = case["rho_water"] * case["g"]
        heads = table["p"] / weight + table["y"]
        rows = [np.flatnonzero(np.isclose(table["time"], time)) for time in times]
        interpolated = [
            np.interp(self.position, table["s"][r], heads[r]) if len(r) else np.nan for r in rows
        ]
        return np.array(interpolated)

    def of_sides(self, step: SidesInStep, row: Mapping[str, Array]) -> Array:
        """The same quantity on both sides of parameters at the end of a step (sides,), see
        `SidesInStep.row`; nan if it does not follow the parameters continuously.
        """
        if self.position is None:
            return row.get(self.name, np.full(len(step.jumps), np.nan))
        joint = step.sides.model.equilibrium.interface.joints[self.joint]
        s, y = joint.xi * joint.length, joint.space.locations[:, 1]
        order, pressures = np.argsort(s), step.pressures(self.joint)
        cases = [model.case.joints[self.joint] for model in step.sides.models]
        heads = [
            p.nodes / (case["rho_water"] * case["g"]) + y
            for p, case in zip(pressures, cases, strict=True)
        ]
        return np.array([np.interp(self.position, s[order], head[order]) for head in heads])


@dataclass(frozen=True)
class Measurements:
    """Readings of several instruments, at t = 1, 2, ..."""

    levels: tuple[float, ...]
    tail_levels: tuple[float, ...] | None
    dates: tuple[str, ...]
    series: tuple[Series, ...]

    @property
    def times(self) -> Array:
        """t of the readings."""
        return np.arange(1.0, len(self.levels) + 1)

    @property
    def number(self) -> int:
        """Number of measured values."""
        return sum(int(np.isfinite(one.measured).sum()) for one in self.series)

    def loaded(self, case: Case) -> Case:
        """The case with the water levels of the readings, a load step each."""
        return varied(case, {}, self.levels, self.tail_levels, 1)

    def computed(self, case: Case) -> Array:
        """What a run of a loaded case has in place of each measurement, see `of_run`."""
        return self.of_run(self.run_of(case))

    @staticmethod
    def run_of(case: Case) -> LoadStepper:
        """The run of a loaded case."""
        stepper = LoadStepper(replace(case, all_steps=True), interface_of(case))
        stepper.run()
        return stepper

    def rates_of_run(self, stepper: LoadStepper, names: Sequence[str]) -> Array:
        """The derivatives (series, readings, parameters) of what a run has in place of each
        measurement, with parameters of its case by their names; nan where there is none.

        Raises InputError, and RunError if a state has none.
        """
        updates, ends = stepper.saved_updates

        def values(step: SidesInStep) -> dict[str, Array]:
            row = step.row() if any(one.position is None for one in self.series) else {}
            return {one.name: one.of_sides(step, row) for one in self.series}

        rates, _ = Differentiation(stepper.model, names).along(updates, ends, values)
        return np.array([[of.values[one.name] for of in rates] for one in self.series])

    def of_run(self, stepper: LoadStepper) -> Array:
        """What a run has in place of each measurement (series, readings).

        Raises RunError if the dam has no equilibrium at one of the readings.
        """
        results = stepper.results()
        last = results.last.get("time", 0.0)
        if last < self.times[-1]:
            reading = math.floor(last) + 1
            raise RunError(
                f"reading {reading} (level {self.levels[reading - 1]:g} m): the run ends before it"
            )
        return np.array([one.computed(results, self.times) for one in self.series])


def read(path: Path, case: Case) -> Measurements:
    """Read the measurements of a case: columns `level` [m], if wanted `tail_level` [m] and `date`,
    then a column per instrument and one of its standard deviations, NAME_sd. NAME is a column of
    history.csv, in its unit, or head_S: piezometric head [m] in the joint S m from the heel (with
    several joints head_S_2, ...). An empty cell was not read.

    Raises InputError.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            numbered = [(reader.line_num, row) for row in reader if row]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: can not be read ({error})") from None
    if not numbered:
        raise InputError(f"{path}: must have a row of column names and a row per reading")
    lines, (head, *rows) = [number for number, _ in numbered[1:]], [row for _, row in numbered]
    head = [name.strip() for name in head]
    for name in head:
        if head.count(name) > 1:
            raise InputError(f"{path}: column {name}: must be given once")
    for number, row in zip(lines, rows, strict=True):
        if len(row) != len(head):
            rule = f"must have {len(head)} cells, has {len(row)}"
            if ";" in head[0]:
                rule = "must have commas between its cells, and decimal points"
            raise InputError(f"{path}: row {number}: {rule}")
    texts = {name: [row[k].strip() for row in rows] for k, name in enumerate(head)}
    if LEVEL not in texts or not rows:
        raise InputError(f"{path}: must have a column {LEVEL} [m] and a row per reading")
    names = [name for name in head if name not in (LEVEL, TAIL, DATE)]
    measured = [name for name in names if not name.endswith(DEVIATION)]
    for name in names:
        if name.endswith(DEVIATION) and name.removesuffix(DEVIATION) not in measured:
            raise InputError(f"{path}: column {name}: has no column {name.removesuffix(DEVIATION)}")
    if not measured:
        raise InputError(f"{path}: must have a measured column, such as crest_ux with crest_ux_sd")
    columns = TextColumns(path, lines, texts)
    series = tuple(measured_series(columns, case, name) for name in measured)
    water = {name: columns.values(name) for name in (LEVEL, TAIL) if name in texts}
    for name, levels in water.items():
        if not np.isfinite(levels).all():
            first = lines[int(np.flatnonzero(~np.isfinite(levels))[0])]
            raise InputError(f"{path}: row {first}: {name}: must be a level [m]")
    tails = tuple(water[TAIL].tolist()) if TAIL in water else None
    if tails is None and len(set(case.tail_levels)) > 1:
        changes = ", ".join(f"{level:g}" for level in case.tail_levels)
        raise InputError(f"{path}: needs a column {TAIL} [m]; that of the case is {changes}")
    dates = tuple(texts.get(DATE, [""] * len(rows)))
    return Measurements(tuple(water[LEVEL].tolist()), tails, dates, series)


@dataclass(frozen=True)
class TextColumns:
    """The cells of a file's columns as texts, and the numbers of their rows."""

    path: Path
    rows: Sequence[int]
    texts: Mapping[str, Sequence[str]]

    def values(self, name: str) -> Array:
        """The numbers of a column, nan where a cell is empty. Raises InputError."""
        values = np.full(len(self.rows), np.nan)
        for k, text in enumerate(self.texts[name]):
            try:
                values[k] = float(text) if text else np.nan
            except ValueError:
                values[k] = np.inf
            if np.isinf(values[k]):
                where = f"{self.path}: row {self.rows[k]}"
                raise InputError(f"{where}: {name} = {text}: must be a number, or empty")
        return values


def measured_series(columns: TextColumns, case: Case, name: str) -> Series:
    """The measurements of a column and of its standard deviations. Raises InputError."""
    known = {n: c for n, c in history_columns(case).items() if n not in NOT_MEASURED}
    bad = f"{columns.path}: column {name}:"
    joint, position, unit = 0, None, "m"
    if name.startswith(HEAD):
        joint, position = piezometer(bad, case, name)
    elif name in known:
        unit = known[name][0]
    else:
        raise InputError(f"{bad} must be one of {', '.join(known)}, or {HEAD}S")
    if name + DEVIATION not in columns.texts:
        raise InputError(f"{bad} needs its standard deviations, column {name}{DEVIATION}")
    measured, deviation = columns.values(name), columns.values(name + DEVIATION)
    wrong = np.flatnonzero(np.isfinite(measured) & ~(deviation > 0))
    if len(wrong):
        row = columns.rows[int(wrong[0])]
        raise InputError(f"{columns.path}: row {row}: {name}{DEVIATION}: must be > 0")
    if not np.isfinite(measured).any():
        raise InputError(f"{bad} must have a measured value")
    return Series(name, unit, measured, deviation, joint, position)


def piezometer(bad: str, case: Case, name: str) -> tuple[int, float]:
    """Number of the joint, from 0, and distance from its heel [m] of head_S or head_S_2.

    Raises InputError.
    """
    if case["dim"] == 3:
        raise InputError(f"{bad} a piezometer must be in a 2D case")
    distance, _, number = name.removeprefix(HEAD).partition("_")
    joints = case.joints
    try:
        joint, position = int(number or 1) - 1, float(distance)
    except ValueError:
        raise InputError(f"{bad} must be {HEAD}S, S the distance from the heel [m]") from None
    if not 0 <= joint < len(joints):
        raise InputError(f"{bad} joint {joint + 1}: must be one of 1 to {len(joints)}")
    length = joints[joint].joint_length
    if not 0 <= position <= length:
        raise InputError(f"{bad} must be 0 to {length:g} m from the heel")
    return joint, position
