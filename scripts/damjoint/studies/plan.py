"""What a sweep goes over: values that are varied, sampled, or tied to them; one case per row."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .. import InputError
from ..model import parameters
from ..model.arithmetic import parsed, value_of
from ..model.case import Case, load

#: The texts of a row, by column.
Row = dict[str, str]

#: Rows of a sweep at most.
MOST_ROWS = 1_000_000


@dataclass(frozen=True)
class Loading:
    """How the case is filled, as `load` takes it."""

    levels: str | None = None
    tail_levels: str | None = None
    steps: int | None = None
    accuracy: str | None = None


#: By the case's own levels and steps.
AS_IT_IS = Loading()


@dataclass(frozen=True)
class Sample:
    """Distributions by name, as texts, and how many values are drawn how."""

    number: int
    laws: dict[str, str]
    design: str = "latin"
    seed: int = 0
    #: rank correlations, 'A,B=R' each
    correlate: list[str] = field(default_factory=list)

    def values(self) -> dict[str, list[str]]:
        """The values by name.

        Raises InputError.
        """
        from . import sampling

        drawn = sampling.draw(self.number, self.laws, self.design, self.seed, self.correlate)
        found = {name: [f"{v:.12g}" for v in values] for name, values in drawn.items()}
        for name, values in found.items():
            for value in values:
                try:
                    check(name, value)
                except InputError as error:
                    raise InputError(
                        f"--sample {name}={self.laws[name]}: draws {error}; truncnorm, uniform or "
                        "lognorm keep within bounds"
                    ) from None
        return found


def check(name: str, value: str) -> None:
    """Raise InputError if a row can not have this value; name: a parameter or level."""
    if name != "level":
        parameters.parameter(name).check(value)
        return
    try:
        finite = math.isfinite(parameters.number(value))
    except ValueError:
        finite = False
    if not finite:
        raise InputError(f"level = {value}: must be a level in metres")


def values_of(text: str) -> tuple[str, list[str]]:
    """('name', ['v1', ...]) from 'name=v1,v2,...' or 'name=first:last:step'.

    Raises InputError.
    """
    name, equals, values = text.partition("=")
    bad = InputError(
        f"--vary {text}: must be NAME=V1,V2,... or NAME=FIRST:LAST:STEP with a step that leads "
        "from first to last"
    )
    if not equals or not values:
        raise bad
    if ":" not in values:
        found = [v.strip() for v in values.split(",")]
    else:
        try:
            first, last, step = (parameters.number(v) for v in values.split(":"))
        except ValueError:
            raise bad from None
        if not np.isfinite([first, last, step]).all() or step == 0 or (last - first) / step < 0:
            raise bad
        if (last - first) / step >= MOST_ROWS:
            raise InputError(f"--vary {text}: must give at most {MOST_ROWS} values")
        found = [f"{first + i * step:.12g}" for i in range(int((last - first) / step + 1e-9) + 1)]
    for value in found:
        check(name.strip(), value)
    return name.strip(), found


def sample_of(words: list[str], **how: object) -> Sample:
    """The sample of the words N NAME=DISTRIBUTION ...; how: design, seed, correlate.

    Raises InputError.
    """
    number, *laws = words
    bad = InputError(
        f"--sample {' '.join(words)}: must be N NAME=DISTRIBUTION ..., such as "
        "1000 mu=normal(1.0,0.15)"
    )
    if not number.isdecimal() or not 1 <= int(number) <= MOST_ROWS or not laws:
        raise bad
    found = {}
    for text in laws:
        name, equals, law = (part.strip() for part in text.partition("="))
        if not equals or not law:
            raise bad
        if name in found:
            raise InputError(f"--sample {name}: must be given once")
        found[name] = law
    return Sample(int(number), found, **how)


@dataclass(frozen=True)
class Plan:
    """What a sweep goes over: all combinations of the varied values, each with the whole sample."""

    varied: dict[str, list[str]]
    sampled: dict[str, list[str]]
    #: expressions of the names that stand before
    tied: dict[str, str]
    #: whose critical value is a column: level, strength, uplift or a parameter; empty: none
    critical: str = ""

    @property
    def critical_columns(self) -> list[str]:
        """The columns of the critical value: itself, the mode, whether it is confirmed (1, 0), and
        what confirms it or does not.
        """
        names = f"critical_{self.critical}", "mode", "confirmed", "confirmed_by"
        return list(names) if self.critical else []

    @property
    def names(self) -> list[str]:
        """What every row has a value of."""
        return [*self.varied, *self.sampled, *self.tied]

    def rows(self) -> Iterator[Row]:
        """The values of each row.

        Raises InputError.
        """
        sample = [
            dict(zip(self.sampled, v, strict=True))
            for v in zip(*self.sampled.values(), strict=True)
        ]
        for values in itertools.product(*self.varied.values()):
            for drawn in sample or [{}]:
                row = dict(zip(self.varied, values, strict=True)) | drawn
                for name, expression in self.tied.items():
                    row[name] = tie(name, expression, row)
                yield row


def column_of(name: str) -> str:
    """The column of a plan's name: that of the level is the one asked for, history has another."""
    return f"{name}_asked" if name == "level" else name


def numbers(rows: list[Row], column: str) -> np.ndarray:
    """A column as numbers; nan where there is none."""
    return np.array([float(row[column]) if row[column] else np.nan for row in rows])


def beside(out: Path, ending: str) -> Path:
    """The path of a file that belongs to a result file."""
    return out.with_name(out.stem + ending)


def tie(name: str, expression: str, row: Row) -> str:
    """The value of an expression of a row's values.

    Raises InputError.
    """
    known = {}
    for other, value in row.items():
        try:
            known[other] = parameters.number(value)
        except ValueError:  # a text, such as a law
            continue
    try:
        value = f"{value_of(parsed(expression), known):.12g}"
    except ValueError:
        raise InputError(
            f"--tie {name}={expression}: must be arithmetic with + - * / ^ ( ), Pi and the names "
            f"varied, sampled or tied before ({', '.join(known)})"
        ) from None
    check(name, value)
    return value


def plan_of(
    vary: list[str], tied: list[str], sample: Sample | None, settings: dict, critical: str = ""
) -> Plan:
    """The plan of the texts NAME=VALUES, NAME=EXPRESSION and a sample; settings: what is set;
    critical: as in Plan.

    Raises InputError.
    """
    axes = [values_of(text) for text in vary]
    ties = [tuple(part.strip() for part in text.partition("=")[::2]) for text in tied]
    for text, (_, expression) in zip(tied, ties, strict=True):
        if not expression:
            raise InputError(f"--tie {text}: must be NAME=EXPRESSION, such as adhesion=2e5*mu")
    laws = [*sample.laws] if sample else []
    names = [("--vary", n) for n, _ in axes] + [("--sample", n) for n in laws]
    names += [("--tie", n) for n, _ in ties]
    for place, (option, name) in enumerate(names):
        if name in settings or any(name == other for _, other in names[:place]):
            raise InputError(
                f"{option} {name}: must be given once, and not by --set, --vary, --sample or --tie "
                "as well"
            )
    if not axes and not sample:
        raise InputError("--vary, --sample: one must be given, such as --vary mu=0.3:0.8:0.05")
    number = math.prod(len(values) for _, values in axes) * (sample.number if sample else 1)
    if number > MOST_ROWS:
        raise InputError(f"--vary, --sample: must give at most {MOST_ROWS} rows in all")
    if any(critical == name for _, name in names):
        raise InputError(f"--critical {critical}: must not be varied, sampled or tied as well")
    return Plan(dict(axes), sample.values() if sample else {}, dict(ties), critical)


def cases_of(case: str, plan: Plan, settings: dict, loading: Loading) -> Iterator[tuple[Row, Case]]:
    """The values of each row, and the case with them.

    level: the last level; the levels of the case (or the loading) below it come first. Raises
    InputError.
    """
    words, known = vars(loading), {}
    base = load(case, settings, **words)
    for row in plan.rows():
        alone = {n: v for n, v in row.items() if n in parameters.independent()}
        key = tuple(v for n, v in row.items() if n not in alone)
        if key not in known:
            changed = settings | {n: v for n, v in row.items() if n != "level"}
            ends = up_to(base, float(row["level"])) if "level" in row else {}
            known[key] = load(case, changed, **(words | ends))
        yield row, known[key].changed(alone)


def up_to(base: Case, top: float) -> dict[str, str]:
    """Levels and tailwater of a case up to a last level: those of its levels that lie below come
    first.

    The tailwater of the last level is the case's own where it first reaches that level (or its last
    one).
    """
    below = [i for i, level in enumerate(base.levels) if level < top]
    first = next((i for i, level in enumerate(base.levels) if level >= top), None)
    tail = base.tail_levels[-1]
    if first is not None and len(set(base.tail_levels)) > 1:
        before = base.levels[first - 1] if first else 0.0
        share = (
            (top - before) / (base.levels[first] - before) if base.levels[first] > before else 1.0
        )
        tail = base.tail_at(first + share)
    levels = [*(base.levels[i] for i in below), top]
    tails = [*(base.tail_levels[i] for i in below), tail]
    joined = lambda values: ",".join(f"{v:.12g}" for v in values)
    return {"levels": joined(levels), "tail_levels": joined(tails)}
