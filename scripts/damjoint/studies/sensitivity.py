"""Derivatives of results with parameters: of a run at its levels, of a critical level."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np

from .. import InputError, RunError
from ..arrays import Array, Value
from ..input.case import Case
from ..input.parameters import declared, of_any_joint, parameter
from ..input.resolve import varied
from ..model.results import Results, column_of, with_all_joints
from ..post.summary import aligned, fitted
from ..post.tables import write_csv
from ..solver.derivatives import (
    NOT_CONTINUOUS,
    Differentiation,
    Rates,
    Side,
    half_difference,
    history_row,
)
from ..solver.load_stepper import SAME_TIME, LoadStepper
from ..solver.path_point import Point
from ..solver.sides import SidesInStep
from ..statics.gravity import factors_of_state, with_crack
from ..threads import limited_threads
from ..units import with_slash

#: What the progress says while they are computed.
STAGE = "derivatives"
#: The file of the derivatives of a run.
FILE = "sensitivity.csv"

#: Safety factors whose derivatives are given, of a joint whose law limits its shear.
FACTORS = "SSF", "OSF"

#: Columns of history.csv that follow the parameters continuously, not lengths that count points;
#: end of the crack, safety factors.
CONTINUOUS = (
    *("crest_ux", "max_opening", "crack_end", "bonded_length", "N", "T", "M", "U", "x_resultant"),
    *("flux", *FACTORS),
)

#: Those that are printed, as changes by one percent of a parameter: name, unit, factor.
PRINTED = (
    *(("crest_ux", "mm", 1e3), ("max_opening", "µm", 1e6)),
    *(("N", "MN/m", 1e-6), ("T", "MN/m", 1e-6)),
)

#: Part of the largest change of a result below which another one is round-off.
ROUNDING = 1e-9

#: Difference of derivatives to one and to both sides, over them, beyond which there is a kink [-].
ONE_SIDED = 1e-3
#: Change of results by a relative change of a parameter by one, over them, up to which it is
#: round-off [-].
NOISE = 1e-5

#: Rise of the level with the displacement, over its mean on the path [-], up to which a point
#: counts as a limit point, whose level has a derivative: 5e-6 where a dam slides; 5e-4 gives 2 % of
#: error. Elsewhere a point is about to open, slip or break (0.03 with bond), or the crack grows.
LIMIT_POINT = 1e-4

#: All parameters that have a derivative and an effect, as the text of --sensitivity.
ALL = "all"

#: Column of a parameter's standard deviation among the changes.
DEVIATION = "deviation"

#: As PRINTED, in `damjoint check`.
PRINTED_OF_CHECKS = (
    *(("SSF", "-", 1.0), ("OSF", "-", 1.0)),
    *(("x_resultant", "m", 1.0), ("crack_end", "m", 1.0)),
)

#: Loads with which the bodies are condensed.
OF_BODIES = (
    *("ice_force", "force_x", "force_y", "anchor_force", "traction_x", "traction_y"),
    *("temperature_dam", "temperature_linear", "temperature_found"),
)

#: Parameters with which the bodies are condensed anew, so that each takes seconds: by name only.
CONDENSED = "nu", "nu_dam", "nu_found", "ice_level", "anchor_at"

#: Parameters of which one follows from the other if that is given.
ALTERNATIVES = "G_f", "pena_rupture"

#: Groups of parameters without an effect on a run, but for some of them.
WITHOUT_EFFECT, BUT = ("Earthquake", "Checks"), ("factor_mu", "factor_c")

#: Half of the difference of a parameter of the geometry, whose derivatives are those of two runs,
#: over its value [-]: so large that the difference between their meshes is small beside it.
OF_GEOMETRY = 5e-3


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives with a parameter, per its unit, by column; kink: whether a point of the joint is
    about to open, to slip or to break, so that they are those for a larger value (a smaller one at
    the parameter's maximum); of_runs: whether they are differences of two runs. None: not found.
    """

    name: str
    value: float
    time: float
    level: float
    derivatives: Mapping[str, float]
    kink: bool
    of_runs: bool = False

    @property
    def unit(self) -> str:
        """Of the parameter."""
        return of_any_joint(self.name).unit


def names_of(
    case: Case, text: str, geometry: bool = False, uncertain: Iterable[str] = ()
) -> list[str]:
    """Parameters from a text NAME,NAME,..., or all of a case but those of the geometry.

    geometry: whether these are allowed; uncertain: some of them. Raises InputError if one of them
    has no derivative, or if an uncertain one is none of them or a load of zero.
    """
    names = all_of(case) if text.strip() == ALL else listed_in(case, text, geometry)
    for name in uncertain:
        if name not in names:
            raise InputError(f"--vary {name}: must be a parameter of --sensitivity {text}")
        if name in OF_BODIES and not case[name]:
            raise InputError(f"--vary {name}: is zero; give its mean by --set {name}=VALUE")
    return names


def listed_in(case: Case, text: str, geometry: bool) -> list[str]:
    """Parameters from a text NAME,NAME,..., see `names_of`. Raises InputError."""
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if not name or names.count(name) > 1:
            raise InputError(f"--sensitivity {text}: must be NAME,NAME,... or {ALL}, each once")
        if not (geometry and is_of_geometry(case, name)):
            half_difference(case, name)
    return names


def deviations_of(distributions: Mapping[str, str]) -> dict[str, float]:
    """Standard deviations of parameters by name, from their distributions as of a sample.

    Raises InputError.
    """
    from .sampling import distribution

    result = dict[str, float]()
    for name, text in distributions.items():
        result[name] = float(distribution(name, text, "--vary", of_any_joint(name).unit).std())
        if not np.isfinite(result[name]):
            raise InputError(f"--vary {name}={text}: must have a finite standard deviation")
    return result


def is_of_geometry(case: Case, name: str) -> bool:
    """Whether derivatives with a parameter are those of two runs."""
    known = None if "." in name else parameter(name)
    if not known or known.group != "Geometry" or not known.real:
        return False
    return not case.geometry and isinstance(case[name], float) and case[name] != 0


def all_of(case: Case) -> list[str]:
    """The parameters of a case with a derivative and an effect; of each joint where they differ."""
    names = []
    for name, known in declared().items():
        if not known.real or known.group in NOT_CONTINUOUS:
            continue
        if known.group in WITHOUT_EFFECT and name not in BUT:
            continue
        if not any(known.matters_in(joint.values) for joint in case.joints):
            continue
        if name in OF_BODIES and not case[name]:  # a load that does not act
            continue
        if name in CONDENSED:
            continue
        differs = known.of_joints and len({joint[name] for joint in case.joints}) > 1
        for one in [f"{j}.{name}" for j in case.joint_names] if differs else [name]:
            with contextlib.suppress(InputError):  # it follows from others
                value, *_ = half_difference(case, one)
                if name in ALTERNATIVES:
                    varied(case, {one: value})
                names.append(one)
    return names


def has_derivative(case: Case, name: str) -> bool:
    """Whether a parameter has derivatives by direct differentiation."""
    try:
        half_difference(case, name)
    except InputError:
        return False
    return True


def of_run(case: Case, names: Sequence[str]) -> list[Sensitivity]:
    """Derivatives at the levels of a case, each with all parameters, up to the last equilibrium.

    Raises InputError, RunError.
    """
    with limited_threads(1):
        stepper = LoadStepper(replace(case, all_steps=True))
        stepper.run()
        updates, ends = stepper.saved_updates
        columns = list(with_all_joints(dict.fromkeys(CONTINUOUS, ("", "")), stepper.case))
        direct = [name for name in names if has_derivative(stepper.case, name)]
        others = [name for name in names if name not in direct]
        rates = list[Rates]()
        if direct:
            rates, _ = Differentiation(stepper.model, direct).along(updates, ends, values_of_sides)
        # near a kink: also those for a larger value, which are others at a kink
        kinks = rates[-1].kink.tolist() if rates else []
        near = [name for name, kink in zip(direct, kinks, strict=False) if kink]
        larger, _ = Differentiation(stepper.model, near, one_sided=True).along(
            updates if near else [], ends, values_of_sides
        )
        rows, sizes = [], {}
        if near:
            sizes = values_of(Side(stepper.model, stepper.state, stepper.history.at_rest))
        for k, name in enumerate(direct):
            value, *_ = half_difference(stepper.case, name)
            for number, (last, of) in enumerate(zip(ends, rates, strict=False)):
                state = updates[last].state
                row, kink = row_at(of, k, columns), False
                if of.kink[k]:
                    other = row_at(larger[number], near.index(name), columns)
                    noise = {c: NOISE * abs(sizes[c] / (value or 1)) for c in columns}
                    kink = differ(row, other, noise)
                    row = other if kink else row
                at = float(state.time), float(state.loading.level)
                rows.append(Sensitivity(name, value, *at, row, kink))
        for name in others:
            rows += of_two_runs(stepper, name, columns)
    return rows


def row_at(rates: Rates, parameter: int, columns: Iterable[str]) -> dict[str, float]:
    """The derivatives with a parameter, by its number, of columns that have one."""
    row = {c: float(rates.values[c][parameter]) for c in columns if c in rates.values}
    return {column: value for column, value in row.items() if np.isfinite(value)}


def differ(
    row: Mapping[str, float], other: Mapping[str, float], noise: Mapping[str, float]
) -> bool:
    """Whether derivatives differ by more than what a difference to one side costs, and noise."""
    return row.keys() != other.keys() or any(
        abs(row[c] - v) > ONE_SIDED * max(abs(row[c]), abs(v)) + noise[c] for c, v in other.items()
    )


def values_of(side: Side) -> dict[str, float]:
    """The row of history.csv of a state, the end of each crack, and of joints whose law limits
    their shear the FACTORS.
    """
    row = history_row(side)
    for k, joint in enumerate(side.model.case.joints):
        of_joint = {n: row[column_of(n, k)] for n in ("N", "T", "M", "bonded_length")}
        state = of_joint | {n: row[n] for n in ("time", "level")}
        factors = factors_of_state(joint, state) if joint.law.has_friction else {}
        row |= {column_of(name, k): factors.get(name, np.nan) for name in FACTORS}
    return row


def values_of_sides(step: SidesInStep) -> dict[str, Array]:
    """The same of the sides of parameters at the end of a step, (sides,) each."""
    row = step.row()
    for k, joint in enumerate(step.sides.model.case.joints):
        factors = np.full((len(FACTORS), len(row["time"])), np.nan)
        if joint.law.has_friction:
            at = step.end.time, step.end.loading.level
            block = None if joint.geometry else with_crack(joint, *at, 0.0)
            for side, model in enumerate(step.sides.models):
                state = {n: row[column_of(n, k)][side] for n in ("N", "T", "M", "bonded_length")}
                state |= {n: row[n][side] for n in ("time", "level")}
                same = not (step.control or step.sides.loading[side % step.sides.number])
                of = factors_of_state(model.case.joints[k], state, block if same else None)
                factors[:, side] = [of[name] for name in FACTORS]
        row |= {column_of(name, k): values for name, values in zip(FACTORS, factors, strict=True)}
    return row


def of_two_runs(stepper: LoadStepper, name: str, columns: Sequence[str]) -> list[Sensitivity]:
    """Derivatives with a parameter of the geometry: central differences of two runs; none where
    these are not at the same time, as below the critical level of each.

    Raises InputError, RunError.
    """
    case = stepper.case
    value = float(case[name])
    sides = list[list[dict[str, float]]]()
    for sign in (-1, 1):
        other = varied(case, {name: value * (1 + sign * OF_GEOMETRY)})
        other = replace(other, levels=case.levels, tail_levels=case.tail_levels, times=case.times)
        run = LoadStepper(other)
        run.run()
        at_rest = run.history.at_rest
        sides.append([values_of(Side(run.model, s, at_rest)) for s in run.history.saved])
    rows = []
    for number, state in enumerate(stepper.history.saved):
        both, row = [of[number] for of in sides if number < len(of)], dict[str, float]()
        if len(both) == 2 and all(abs(of["time"] - state.time) < SAME_TIME for of in both):
            low, high = both
            row = {
                column: (high[column] - low[column]) / (2 * OF_GEOMETRY * value)
                for column in columns
                if column in low and np.isfinite([low[column], high[column]]).all()
            }
        at = float(state.time), float(state.loading.level)
        rows.append(Sensitivity(name, value, *at, row, kink=False, of_runs=True))
    return rows


def of_point(point: Point, names: Sequence[str]) -> list[Sensitivity]:
    """Derivatives of the level of a point at which a path is highest: there the level does not
    change with the displacement that was prescribed, so that its derivative is that of the highest
    level, the one that a left null vector of the tangent gives.

    Raises InputError, RunError where it has none.
    """
    trace = point.state.trace
    if trace is None:
        raise RunError("sensitivity: the path was followed without its updates")
    rows = []
    with limited_threads(1):
        (end,), rise = Differentiation(point.model, names).along(trace.updates)
        if abs(rise) > LIMIT_POINT:
            raise RunError(
                "sensitivity: the critical level has no derivative: at its last equilibrium a "
                "point is about to open, slip or break, or the crack grows unstably; search it "
                "again with another value"
            )
        # near a kink: also those for a larger value, as in `of_run`
        near = [name for name, kink in zip(names, end.kink, strict=True) if kink]
        larger = dict[str, dict[str, float]]()
        if near:
            (other,), _ = Differentiation(point.model, near, one_sided=True).along(trace.updates)
            larger = dict(zip(near, map(of_level, other.level.tolist()), strict=True))
        for name, rate in zip(names, end.level.tolist(), strict=True):
            value, *_ = half_difference(point.model.case, name)
            row = of_level(rate)
            above = larger.get(name, row)
            kink = differ(row, above, {"critical_level": 0.0})
            at = float(point.state.time), float(point.level)
            rows.append(Sensitivity(name, value, *at, (kink and above) or row, kink))
    if not any(row.derivatives for row in rows):
        raise RunError(not_found(names))
    return rows


def of_level(rate: float) -> dict[str, float]:
    """The derivative of a critical level, if it is found."""
    return {"critical_level": rate} if np.isfinite(rate) else {}


def table(rows: Sequence[Sensitivity]) -> dict[str, list[Value]]:
    """sensitivity.csv: a row per parameter and level."""
    names = list(dict.fromkeys(name for row in rows for name in row.derivatives))
    return {
        "parameter": [row.name for row in rows],
        "unit": [row.unit for row in rows],
        "value": [row.value for row in rows],
        "time": [row.time for row in rows],
        "level": [row.level for row in rows],
        "kink": [float(row.kink) for row in rows],
        "of_runs": [float(row.of_runs) for row in rows],
        **{name: [row.derivatives.get(name, np.nan) for row in rows] for name in names},
    }


def write(
    names: Sequence[str],
    picture: bool,
    results: Results,
    folder: Path,
    printed: Sequence[tuple[str, str, float]] = PRINTED,
    deviations: Mapping[str, float] | None = None,
) -> None:
    """Write the derivatives of a run into its folder, and their picture; what is printed of them,
    as in `changes`, is added to its info.
    """
    try:
        rows = of_run(results.case, names)
    except RunError as error:
        results.info["sensitivity"] = {"statement": str(error), "changes": [], "without": []}
        return
    write_csv(folder / FILE, {n: np.array(v) for n, v in table(rows).items()})
    sizes = {n: abs(v) for n, v in results.last.items()}
    listed = changes(rows, printed, sizes, deviations)
    without, lost = without_change(rows, listed, deviations or names)
    results.info["sensitivity"] = {
        "statement": "" if listed else "\n".join(without_lines(without, lost)),
        "changes": listed,
        "without": without,
        "not_found": lost,
    }
    if picture and listed:
        draw_changes(listed, results.case, rows[-1].level, folder)


def at_last_step(rows: Sequence[Sensitivity]) -> list[Sensitivity]:
    """Those at the last level; it may stand before the last step, too, as before an earthquake."""
    return [*{row.name: row for row in rows if row.level == rows[-1].level}.values()]


def without_change(
    rows: Sequence[Sensitivity], listed: Sequence[Mapping[str, Value]], names: Iterable[str]
) -> tuple[list[str], list[str]]:
    """The parameters without an effect, and those whose derivatives are not found, of the names of
    those that might be among the changes listed.
    """
    lost = {row.name for row in at_last_step(rows) if not row.derivatives}
    rest = [n for n in names if n not in {row["parameter"] for row in listed}]
    return [n for n in rest if n not in lost], [n for n in rest if n in lost]


def without_lines(without: Sequence[str], lost: Sequence[str]) -> list[str]:
    """What is printed of them."""
    lines = [f"sensitivity: no effect of {', '.join(without)}"] if without else []
    return [*lines, not_found(lost)] if lost else lines


def not_found(names: Iterable[str]) -> str:
    """What is printed of parameters whose derivatives are not found."""
    return (
        f"sensitivity: no derivative with {', '.join(names)} is found: the state is near a kink or "
        "at the end of the path, or the joint so stiff that the derivative is round-off"
    )


def words(derived: Mapping[str, Any], width: int | None = None) -> str:
    """What is printed of the derivatives in the info of a run: the changes, and which parameters
    have no effect; width: of the terminal, None: all columns.
    """
    if derived["statement"]:
        return str(derived["statement"])
    lines = without_lines(derived.get("without", []), derived.get("not_found", []))
    return "\n".join([text(derived["changes"], width), *lines])


def draw_changes(
    listed: Sequence[Mapping[str, Value]], case: Case, level: float, folder: Path
) -> None:
    """Draw changes at a level into the folder of a study of a case."""
    from ..pictures import sensitivity_picture as picture

    by = "standard deviation" if DEVIATION in listed[0] else "percent"
    title = f"{case.title}: change by one {by} of a parameter, level {level:.6g} m"
    picture.draw(listed, title, folder / f"{case.name}{picture.ENDING}")


def changes(
    rows: Sequence[Sensitivity],
    printed: Sequence[tuple[str, str, float]],
    sizes_of: Mapping[str, float] | None = None,
    deviations: Mapping[str, float] | None = None,
) -> list[dict[str, Value]]:
    """What one percent more of each parameter changes at the last level, the largest change first;
    of a parameter that is zero, its unit, after the others. Those without an effect are left out.
    sizes_of: of the results, by column, for what is round-off beside them. deviations: standard
    deviations, by parameter; those listed are then these, with the change by one of them.
    """
    rows = [row for row in rows if not deviations or row.name in deviations]
    last = [row for row in at_last_step(rows) if row.derivatives] if rows else []
    if not last:
        return []
    by_name = deviations or {row.name: 0.01 * row.value or 1.0 for row in last}
    printed = [entry for entry in printed if all(entry[0] in row.derivatives for row in last)]
    heads = [f"{name} [{unit}]" for name, unit, _ in printed]
    sizes = np.array(
        [[row.derivatives[n] * by * by_name[row.name] for n, _, by in printed] for row in last]
    )
    largest = np.abs(sizes).max(axis=0)
    if sizes_of:
        largest = np.maximum(largest, [sizes_of.get(n, 0.0) * by for n, _, by in printed])
    sizes[np.abs(sizes) < ROUNDING * largest] = 0.0
    listed: list[dict[str, Value]] = []
    after = [not deviations and row.value == 0 for row in last]
    for k in sorted(range(len(last)), key=lambda k: (after[k], -abs(sizes[k, 0]))):
        row = last[k]
        if not sizes[k].any():
            continue
        unit = with_slash(row.unit)
        cells: dict[str, Value] = {"parameter": row.name, "unit": unit, "value": row.value}
        cells |= {DEVIATION: deviations[row.name]} if deviations else {}
        cells |= dict(zip(heads, sizes[k].tolist(), strict=True))
        note = "at a kink" if row.kink else "of two runs" if row.of_runs else ""
        listed.append(cells | {"note": note})
    return listed


def text(listed: Sequence[Mapping[str, Value]], width: int | None = None) -> str:
    """Changes as a printed table; width: of the terminal, None: all columns."""
    names = [name for name in listed[0] if name != "note"]
    rows = [
        tuple(
            f"{v:.{4 if n in ('value', DEVIATION) else 3}g}"
            if isinstance(v := row[n], float)
            else str(v)
            for n in names
        )
        for row in listed
    ]
    title = "Change by one percent more of a parameter (by its unit, if it is 0)"
    if DEVIATION in names:
        title = "Change by one standard deviation more of a parameter"
    heads = [name.replace(" [", "\n[") for name in names]
    shown = [name.partition(" [")[0] for name in names]
    first = 3 + (DEVIATION in names)  # result, always printed
    table = fitted(shown, heads, rows, shown[:first:-1], width, partial(aligned, left=2, right=-1))
    lines = [title, table]
    for note in dict.fromkeys(row["note"] for row in listed if row["note"]):
        of = ", ".join(str(row["parameter"]) for row in listed if row["note"] == note)
        lines += wrap(f"{note}: {of}", width or 10_000)
    return "\n".join(lines)
