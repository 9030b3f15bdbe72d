"""Plan of a sweep: values that are varied, sampled or tied to them; one case per row."""

from __future__ import annotations

import itertools
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np

from .. import InputError
from ..arrays import Array, Settings, Value, Values
from ..input import parameters
from ..input.arithmetic import arithmetic_value, check_units, explained, quantity
from ..input.case import Case
from ..input.resolve import varied, with_record

#: A row of a result file: texts by column.
Row: TypeAlias = dict[str, str]

#: The name by which records of earthquakes are varied.
MOTION = "record"

#: Limit of the number of rows.
MOST_ROWS = 1_000_000

#: Designs of a sample: Latin hypercube, independent random rows, and that of Sobol's indices, with
#: as many blocks of rows as there are inputs and two more.
DESIGNS = ("latin", "monte-carlo", "sobol")

#: Share of a step by which the last value of FIRST:LAST:STEP may lie beyond LAST.
ROUNDING = 1e-9
#: Significant digits of the values, which are those of a result file.
DIGITS = 12


@dataclass(frozen=True)
class Sample:
    """A random sample: number of values, and distributions of scipy.stats by parameter, as texts.

    Sample(100, {"mu": "normal(0.8,0.1)"}); design: latin (hypercube), monte-carlo or sobol (of
    Sobol's indices, number * (inputs + 2) rows); correlate: rank correlations, "A,B=R" each.
    Raises InputError.

    Example:
        >>> sample = Sample(3, {"mu": "normal(0.8,0.1)"})
        >>> len(sample.values()["mu"])
        3
    """

    number: int
    distributions: dict[str, str]
    design: str = "latin"
    seed: int = 0
    correlate: Sequence[str] = ()

    def __post_init__(self) -> None:
        if self.number not in range(1, MOST_ROWS + 1):
            raise InputError(f"number = {self.number}: must be an integer from 1 to {MOST_ROWS}")
        if self.design not in DESIGNS:
            raise InputError(f"design = {self.design}: must be one of {', '.join(DESIGNS)}")
        if self.design == "sobol":
            if self.number < 2 or self.number & (self.number - 1):
                raise InputError(f"number = {self.number}: must be a power of 2 with design sobol")
            if self.correlate:
                raise InputError("--correlate: must not be given with design sobol")
        if not isinstance(self.seed, int) or self.seed < 0:
            raise InputError(f"seed = {self.seed}: must be an integer >= 0")
        if not self.distributions:
            raise InputError("--sample: must have a distribution, such as mu=normal(1.0,0.15)")
        if isinstance(self.correlate, str):
            raise InputError(f"correlate = {self.correlate}: must be a list of texts")
        from . import sampling  # loads scipy.stats

        for name, text in self.distributions.items():
            known = None if name == "level" else parameters.of_any_joint(name)
            if known and (known.text or known.choices):
                raise InputError(f"--sample {name}={text}: must be of a parameter that is a number")
            sampling.distribution(name, text, unit=quantity_of(name)[1])
        for text in self.correlate:
            sampling.correlation(text, [*self.distributions])

    @property
    def rows(self) -> int:
        """The number of rows."""
        blocks = len(self.distributions) + 2 if self.design == "sobol" else 1
        return int(self.number) * blocks

    def values(self) -> dict[str, list[Value]]:
        """The values by name. Raises InputError."""
        from . import sampling

        drawn = sampling.draw(
            int(self.number), self.distributions, self.design, self.seed, list(self.correlate)
        )
        values = {}
        for name, numbers in drawn.items():
            try:
                values[name] = [checked(name, rounded(number)) for number in numbers]
            except InputError as error:
                raise InputError(
                    f"--sample {name}={self.distributions[name]}: draws {error}; truncnorm, "
                    "uniform or lognorm keep within bounds"
                ) from None
        return values


def checked(name: str, value: Value) -> Value:
    """The value of a row, from a text or a number; name: a parameter, one of a single
    joint, level or record.

    Raises InputError.
    """
    if name == MOTION:
        return str(value)
    if name != "level":
        if "." in name:
            return parameters.of_one_joint(name, value)[2]
        return parameters.parameter(name).check(value)
    setting, rule = f"level = {value}", "must be a level in metres"
    try:
        level = quantity(value, "m") if isinstance(value, str) else value
    except ValueError as error:
        raise InputError(explained(setting, rule, error)) from None
    if not math.isfinite(level):
        raise InputError(f"{setting}: {rule}")
    return level


def rounded(number: float) -> float:
    """A number with as many digits as a result file has."""
    return float(in_file(number))


def in_file(value: Value) -> str:
    """A value as a result file has it."""
    return value if isinstance(value, str) else f"{value:.{DIGITS}g}"


def listed(name: str, values: Sequence[Value | Path]) -> list[Value]:
    """Values of a parameter, of level or of record, checked and rounded as a result file has them.

    Raises InputError.
    """
    texts = [str(v) if isinstance(v, Path) else v for v in values]
    return [checked(name, v if isinstance(v, str) else rounded(v)) for v in texts]


def values_of(text: str) -> tuple[str, list[Value]]:
    """('name', [v1, ...]) from 'name=v1,v2,...' or 'name=first:last:step'. Raises InputError."""
    name, equals, values = text.partition("=")
    setting = f"--vary {text}"
    rule = (
        "must be NAME=V1,V2,... or NAME=FIRST:LAST:STEP with a step that leads from first to last"
    )
    bad = InputError(f"{setting}: {rule}")
    if not equals or not values:
        raise bad
    name = name.strip()
    check_units(setting, re.split("[,:]", values))
    if ":" not in values:
        return name, [checked(name, v.strip()) for v in values.split(",")]
    try:
        first, last, step = (quantity(v, quantity_of(name)[1]) for v in values.split(":"))
    except ValueError as error:
        raise InputError(explained(setting, rule, error)) from None
    if not np.isfinite([first, last, step]).all() or step == 0 or (last - first) / step < 0:
        raise bad
    if (last - first) / step >= MOST_ROWS:
        raise InputError(f"{setting}: must give at most {MOST_ROWS} values")
    number = int((last - first) / step + ROUNDING) + 1
    if number == 1 and last != first:
        raise bad
    return name, [checked(name, rounded(first + i * step)) for i in range(number)]


def sample_of(
    words: list[str], design: str = "latin", seed: int = 0, correlate: Sequence[str] = ()
) -> Sample:
    """The sample of the words N NAME=DISTRIBUTION ...; the rest as in Sample. Raises InputError."""
    number, *texts = words
    bad = InputError(
        f"--sample {' '.join(words)}: must be N NAME=DISTRIBUTION ..., such as "
        "1000 mu=normal(1.0,0.15)"
    )
    if not number.isdecimal() or not 1 <= int(number) <= MOST_ROWS or not texts:
        raise bad
    distributions: dict[str, str] = {}
    for text in texts:
        name, equals, distribution = (part.strip() for part in text.partition("="))
        if not equals or not distribution:
            raise bad
        if name in distributions:
            raise InputError(f"--sample {name}: must be given once")
        distributions[name] = distribution
    return Sample(int(number), distributions, design, seed, correlate)


@dataclass(frozen=True)
class Limits:
    """Limits of an earthquake: of the residual slip and of the largest opening of the joint with
    the largest slip [m]. That the dam does not stand is always one.
    """

    slip: tuple[float, ...] = ()
    opening: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        values = [*self.slip, *self.opening]
        if not all(math.isfinite(value) and value > 0 for value in values):
            raise InputError(f"quake = {', '.join(map(str, values))}: must be lengths > 0 m")

    @classmethod
    def of(cls, text: str) -> Limits:
        """Limits from a text SLIP, or "slip=0.05,slip=0.2,opening=0.01,standing".

        Raises InputError.
        """
        rule = (
            "must be a slip > 0 m, or limits slip=S,opening=O,standing, some of these or several "
            "of a kind"
        )
        bad = InputError(f"--quake {text}: {rule}")
        limits: dict[str, tuple[float, ...]] = {"slip": (), "opening": ()}
        for part in text.split(","):
            if part.strip() == STANDING:
                continue
            name, equals, words = (p.strip() for p in part.partition("="))
            name, words = (name, words) if equals else ("slip", name)
            try:
                value = quantity(words, "m")
            except ValueError as error:
                raise InputError(explained(f"--quake {text}", rule, error)) from None
            if name not in limits or not (math.isfinite(value) and value > 0):
                raise bad
            limits[name] = (*limits[name], value)
        return cls(**limits)

    @property
    def listed(self) -> list[tuple[str, float]]:
        """Kind and value [m] of each limit, the last one that the dam does not stand."""
        kinds = [("slip", v) for v in self.slip] + [("opening", v) for v in self.opening]
        return [*dict.fromkeys(kinds), (STANDING, 0.0)]

    def words(self) -> list[str]:
        """What each limit means."""
        names = {"slip": "residual slip", "opening": "opening"}
        return [
            f"{names[kind]} > {1e3 * v:.4g} mm" if kind in names else "does not stand"
            for kind, v in self.listed
        ]


#: The limit that the dam does not stand after an earthquake.
STANDING = "standing"


@dataclass(frozen=True)
class Plan:
    """The values of a sweep: all combinations of the varied ones, each with the entire sample."""

    varied: dict[str, list[Value]]
    sampled: dict[str, list[Value]]
    #: expressions of varied, sampled and previous tied names
    tied: dict[str, str]
    #: quantity whose critical value is computed: level, strength, uplift, a parameter; empty: none
    critical: str = ""
    #: limits beyond which a row fails, each row an earthquake; None: no earthquake
    quake: Limits | None = None
    #: number of rows of a block in the design of Sobol's indices; 0: another design
    sobol: int = 0

    @property
    def critical_columns(self) -> list[str]:
        """Columns of the critical value: value, mode, whether it is confirmed (1, 0), why (not)."""
        names = f"critical_{self.critical}", "mode", "confirmed", "confirmed_by"
        return list(names) if self.critical else []

    @property
    def names(self) -> list[str]:
        """Parameters of which each row has a value; level."""
        return [*self.varied, *self.sampled, *self.tied]

    @property
    def number(self) -> int:
        """The number of rows."""
        drawn = next(iter(self.sampled.values()), None)
        return math.prod(map(len, self.varied.values())) * (1 if drawn is None else len(drawn))

    def rows(self) -> Iterator[dict[str, Value]]:
        """The values of each row by name. Raises InputError."""
        draws = zip(*self.sampled.values(), strict=True)
        sample = [dict(zip(self.sampled, values, strict=True)) for values in draws]
        for values in itertools.product(*self.varied.values()):
            for drawn in sample or [{}]:
                row = dict(zip(self.varied, values, strict=True)) | drawn
                for name, expression in self.tied.items():
                    row[name] = tie(name, expression, row)
                yield row


def column_of(name: str) -> str:
    """The column of a plan's name; `level` is a column of the history."""
    return f"{name}_requested" if name == "level" else name


#: Names and units of what is varied or critical besides parameters.
QUANTITIES = {
    "level": ("water level", "m"),
    "record": ("record", ""),
    "strength": ("strength reduction", "-"),
    "uplift": ("drain_effectiveness", "-"),
}


def quantity_of(name: str) -> tuple[str, str]:
    """Name and unit of a varied or critical quantity. Raises InputError."""
    return QUANTITIES.get(name) or (name, parameters.of_any_joint(name).unit)


def numbers(rows: list[Row], column: str) -> Array:
    """A column as numbers; nan where it is empty."""
    return np.array([float(row[column]) if row[column] else np.nan for row in rows])


#: Endings of the files that are made of all rows of a result file, see `beside`.
CHART, STATISTICS = ".png", ("_probability.csv", "_sensitivity.csv", "_sobol.csv")
#: Ending of the record of a study beside its result file.
RECORD = "_run.json"
FRAGILITY = "_fragility.csv", "_fragility.png"


def beside(out: Path, ending: str) -> Path:
    """The path of a file that belongs to a result file."""
    return out.with_name(out.stem + ending)


def tie(name: str, expression: str, row: Values) -> Value:
    """The value of an expression of a row's values. Raises InputError."""
    known = {other: value for other, value in row.items() if not isinstance(value, str)}
    try:
        value = rounded(arithmetic_value(expression, quantity_of(name)[1], known))
    except ValueError as error:
        rule = (
            "must be arithmetic with + - * / ^ ( ), Pi, units and the names varied, sampled or "
            f"tied before ({', '.join(known)})"
        )
        raise InputError(explained(f"--tie {name}={expression}", rule, error)) from None
    return checked(name, value)


def plan_of(
    vary: list[str],
    tied: list[str],
    sample: Sample | None,
    settings: Settings,
    critical: str = "",
    motions: Mapping[str, list[Value]] = MappingProxyType({}),
    signs: bool = False,
) -> Plan:
    """The plan of the texts NAME=VALUES, NAME=EXPRESSION and a sample; settings: parameters that
    are set for all rows; critical: as in Plan; motions: further values by name, of earthquakes;
    signs: whether `in_both_signs` follows.

    Raises InputError.
    """
    axes = [*(values_of(text) for text in vary), *motions.items()]
    ties = []
    for text in tied:
        name, _, expression = (part.strip() for part in text.partition("="))
        if not expression:
            raise InputError(f"--tie {text}: must be NAME=EXPRESSION, such as adhesion=2e5*mu")
        ties.append((name, expression))
    return plan_with(axes, ties, sample, settings, critical, signs)


def plan_with(
    axes: Sequence[tuple[str, list[Value]]],
    ties: Sequence[tuple[str, str]],
    sample: Sample | None,
    settings: Settings,
    critical: str,
    signs: bool = False,
) -> Plan:
    """The plan of checked values by name, expressions by name and a sample; the rest as `plan_of`.

    Raises InputError.
    """
    sampled = [*sample.distributions] if sample else []
    names = [("--vary", n) for n, _ in axes] + [("--sample", n) for n in sampled]
    names += [("--tie", n) for n, _ in ties]
    for index, (option, name) in enumerate(names):
        if name in settings or any(name == other for _, other in names[:index]):
            raise InputError(
                f"{option} {name}: must be given once, and not by --set, --vary, --sample or --tie "
                "as well"
            )
    for name, values in axes:
        value, times = Counter(values).most_common(1)[0]
        if times > 1:
            option = "--record" if name == MOTION else f"--vary {name}"
            raise InputError(f"{option}: {value} must be given once")
    if not (axes or sample or signs):
        raise InputError("--vary, --sample: one must be given, such as --vary mu=0.3:0.8:0.05")
    number = math.prod(len(values) for _, values in axes) * (sample.rows if sample else 1)
    if number > MOST_ROWS:
        raise InputError(f"--vary, --sample: must give at most {MOST_ROWS} rows in all")
    if any(critical == name for _, name in names):
        raise InputError(f"--critical {critical}: must not be varied, sampled or tied as well")
    sobol = sample.number if sample and sample.design == "sobol" else 0
    return Plan(dict(axes), sample.values() if sample else {}, dict(ties), critical, sobol=sobol)


def in_both_signs(plan: Plan, scale: float) -> Plan:
    """The plan with each record also reversed: record_scale has its values, by default the scale of
    the case, and their negatives.

    Raises InputError if it is sampled or tied.
    """
    scales = plan.varied.get("record_scale", [scale])
    if "record_scale" in plan.sampled | plan.tied:
        raise InputError("--both-signs: must not be given with a sampled or tied record_scale")
    values = [abs(float(scale)) for scale in scales]
    both: list[Value] = [*dict.fromkeys([*values, *(-value for value in values)])]
    return replace(plan, varied={**plan.varied, "record_scale": both})


def planned_cases(base: Case, plan: Plan) -> Iterator[tuple[dict[str, Value], Case]]:
    """The values of each row, and the case with them.

    level: the last level, after the levels of the case below it. Raises InputError.
    """
    independent = parameters.independent()
    # Gmsh's parser resolves a case once for all rows that differ in independent parameters only
    resolved: dict[tuple[Value, ...], Case] = {}
    for row in plan.rows():
        alone = {n: v for n, v in row.items() if n in independent}
        key = tuple(v for n, v in row.items() if n not in alone)
        if key not in resolved:
            changed = {n: v for n, v in row.items() if n not in ("level", MOTION)}
            loading = up_to(base, row["level"]) if "level" in row else {}
            of_row = varied(base, changed, **loading)
            resolved[key] = with_record(of_row, str(row[MOTION])) if MOTION in row else of_row
        yield row, resolved[key].changed(alone)


def up_to(base: Case, top: Value) -> dict[str, Any]:
    """Levels and tailwater of a case up to a last level: those of its levels that lie below come
    first.

    The tailwater at the last level is that of the case where it first reaches this level (or its
    last one).
    """
    top = float(top)
    below = [i for i, level in enumerate(base.levels) if level < top]
    first = next((i for i, level in enumerate(base.levels) if level >= top), None)
    tail = base.tail_levels[-1]
    if first is not None and len(set(base.tail_levels)) > 1:
        before = base.levels[first - 1] if first else 0.0
        rise = base.levels[first] - before
        tail = base.tail_at(first + ((top - before) / rise if rise > 0 else 1.0))
    levels = *(base.levels[i] for i in below), top
    tails = *(base.tail_levels[i] for i in below), tail
    return {"levels": levels, "tail_levels": tails}
