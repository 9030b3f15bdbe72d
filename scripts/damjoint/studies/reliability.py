"""Reliability: the probability that the water rises beyond the critical level.

The limit state is g = critical level - level [m]; the dam fails where g < 0. Its variables are
standard normal ones z, which follow from the uncertain parameters and have the correlation of a
Gaussian copula, as in a sample. The algorithms are those of OpenTURNS: FORM by the design point,
the nearest one of failure [Hasofer and Lind 1974; Abdo and Rackwitz 1990], SORM [Breitung 1984;
Tvedt 1990], importance sampling around the design points [Melchers 1989]. Derivatives are those of
the critical levels, by direct differentiation; where a level has none, as one that a mechanism or
a path of another mesh gives, central differences.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy import stats

from .. import InputError, RunError
from ..arrays import Array, BoolArray, Value, Values
from ..input.case import Case
from ..input.parameters import of_any_joint
from ..input.resolve import varied
from ..joint.interface import interface_of
from ..processes import process_count
from ..solver.path_point import PRECISION
from ..threads import limited_threads
from . import keys, sampling
from .critical import Search
from .critical_value import CriticalValue
from .openturns_process import OpenTurns, nearest_failure, openturns, points_around
from .plan import Plan, Sample, checked, in_file, planned_cases, rounded, up_to
from .sweep import ERROR, error_message, search_of, spread_bundles

#: Step of the central differences of levels, and of their derivatives for the curvatures, in
#: standard deviations of the normal variables [-].
STEP = 0.1
#: Level of a point over the critical level from which on its derivatives are not those of the
#: critical level, relative [-].
SAME_LEVEL = 1e-5
#: Half of the difference of an expression, over the value of a variable [-].
OF_EXPRESSIONS = 1e-4

#: Unit of the limit state in the search for a design point, over its slope where that begins, per
#: standard deviation [-]. The search adds |g| to half of the square of the distance: in a larger
#: unit it cuts its steps, in a smaller one a distance that is too large costs it nothing.
UNIT = 1 / 3

#: Tolerance of the design point, in standard deviations and relative, and of its limit state, in
#: its unit [-]; if that is not reached, the precision of a critical level is the tolerance.
TOLERANCE = 1e-4

#: Samples that are evaluated together.
BLOCK = 50

#: Standard errors of the samples beyond which another probability disagrees with them [-].
DISAGREES = 3.0

#: Level over the first one, from which a path begins that finds no equilibrium at that [-].
LOWER = 0.25

#: Standard normal value up to which the values of each parameter must be allowed, so that what a
#: sample of a thousand takes is refused before the first critical level [-].
REACH = 3.1

#: Adhesion of the joints that cannot fail in the limit state of another one, over E of the dam [-].
UNBREAKABLE = 50.0

#: Columns of a critical level in reliability.csv, after key, of_joint and the variables.
RESULTS = ("critical_level", "mode", "joint", "confirmed", "confirmed_by")


@dataclass(frozen=True)
class Variables:
    """Uncertain parameters: distributions of scipy.stats by name, as texts, rank correlations
    "A,B=R", parameters that are computed from them by expressions.

    Raises InputError.
    """

    distributions: Mapping[str, str]
    correlate: Sequence[str] = ()
    tied: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        try:
            if not self.distributions:
                raise InputError("--vary: must have a distribution, such as mu=normal(1.0,0.15)")
            Sample(1, dict(self.distributions), correlate=self.correlate)
        except InputError as error:
            raise InputError(str(error).replace("--sample", "--vary")) from None
        for name in self.tied:
            if name in self.distributions or name == "level":
                raise InputError(f"--tie {name}: must not be varied, and not be the level")
            check_continuous(f"--tie {name}", name)
        for name, text in self.distributions.items():
            if name != "level":
                check_continuous(f"--vary {name}={text}", name)
        for end in (-REACH, REACH):
            self.values([end] * len(self.names))

    @property
    def names(self) -> list[str]:
        """Names of the uncertain parameters."""
        return [*self.distributions]

    @cached_property
    def marginals(self) -> list[Any]:
        """Their distributions."""
        return [sampling.distribution(n, text) for n, text in self.distributions.items()]

    def values(self, z: Sequence[float] | Array) -> dict[str, float]:
        """The values by name at a point of the normal variables; see `values_at`."""
        return self.values_at(np.asarray([z], float))[0]

    def values_at(self, points: Array) -> list[dict[str, float]]:
        """The values by name at points (n, variables) of the normal variables, also in far tails.

        Raises InputError if a parameter does not allow its value.
        """
        rows: list[dict[str, float]] = [{} for _ in points]
        for name, kind, numbers in zip(self.names, self.marginals, points.T, strict=True):
            tails = stats.norm.cdf(-np.abs(numbers))
            values = np.where(numbers > 0, kind.isf(tails), kind.ppf(tails))
            try:
                for row, value in zip(rows, values, strict=True):
                    row[name] = float(checked(name, rounded(float(value))))
            except InputError as error:
                raise InputError(
                    f"--vary {name}={self.distributions[name]}: has {error}; truncnorm, uniform "
                    "or lognorm keep within bounds"
                ) from None
        return rows

    def slopes(self, z: Sequence[float] | Array) -> dict[str, float]:
        """The derivatives of the values with the normal variables, by name."""
        values = self.values(z)
        return {
            name: float(stats.norm.pdf(number) / kind.pdf(values[name]))
            for name, kind, number in zip(self.names, self.marginals, z, strict=True)
        }

    def rank_correlations(self) -> Array:
        """Their rank correlations, a matrix. Raises InputError if no Gaussian copula has them."""
        pairs = [sampling.correlation(text, self.names) for text in self.correlate]
        return sampling.rank_correlations(pairs, len(self.names))


def check_continuous(option: str, name: str) -> None:
    """Raise InputError if a name, of an option, is not of a parameter that is a real number."""
    if not of_any_joint(name).real:
        raise InputError(f"{option}: must be of a parameter that is a real number")


# -- critical levels
# --------------------------------------------------------------------------------------------------


def rows_of(tasks: list[tuple[Case, list[str]]]) -> list[dict[str, Value]]:
    """The columns RESULTS of cases, each a critical level, and its derivatives with parameters by
    their names, if it has them; a failed search has an empty level.
    """
    with limited_threads(1):
        return [row_of(case, names) for case, names in tasks]


def row_of(case: Case, names: list[str]) -> dict[str, Value]:
    """The columns of a critical level: that of the highest path that was followed where there is
    no limit, 0 where there is no equilibrium at any level; and its derivatives.
    """
    try:
        search = search_of(replace(case, all_steps=bool(names)), "level")
        answer = search.find()
        if answer.value is None and answer.point is None:
            search = lower(case)
            answer = search.find()
    except Exception as error:
        return dict(zip(RESULTS, ("", ERROR, "", 0.0, error_message(error)), strict=True))
    level = answer.value
    if level is None:
        level = answer.point.level if answer.point else 0.0
    cells = level, answer.mode, answer.joint, float(answer.confirmed), answer.why or answer.doubt
    row: dict[str, Value] = dict(zip(RESULTS, cells, strict=True))
    return row | (rates_of(answer, names) if names else {})


def rates_of(answer: CriticalValue, names: list[str]) -> dict[str, Value]:
    """The derivatives of a critical level with parameters, by their names; none where its point has
    none, is at a kink or has another level.
    """
    from .sensitivity import of_point

    if answer.point is None or answer.value is None:
        return {}
    if abs(answer.point.level - answer.value) > SAME_LEVEL * abs(answer.value):
        return {}
    try:
        rows = of_point(answer.point, names)
    except (InputError, RunError, np.linalg.LinAlgError):
        return {}
    if any(row.kink or not row.derivatives for row in rows):
        return {}
    return {rate_column(row.name): row.derivatives["critical_level"] for row in rows}


def rate_column(name: str) -> str:
    """The column of the derivative with a parameter."""
    return f"d_{name}"


def lower(case: Case) -> Search:
    """The search of a critical level that begins below the first level of the case."""
    levels = LOWER * case.levels[0], *case.levels
    tails = case.tail_levels[0], *case.tail_levels
    return search_of(varied(case, {}, levels, tails), "level")


class CriticalLevels:
    """Critical levels by the values of the variables, each computed once."""

    def __init__(
        self,
        case: Case,
        variables: Variables,
        jobs: int | None = 1,
        client: Any = None,
        known: Mapping[str, Mapping[str, Value]] | None = None,
    ) -> None:
        """jobs, client: see `spread_bundles`; known: rows by key, of an earlier study."""
        self.case, self.variables, self.jobs, self.client = case, variables, jobs, client
        self.known = {**(known or {})}
        #: number of levels that were computed; rows that this study has used, by key
        self.computed, self.used = 0, dict[str, Mapping[str, Value]]()
        #: called with key, joint, values and results of each that is computed
        self.on_row: Callable[[str, str, Values, Mapping[str, Value]], None] = lambda *_: None

    def case_of(self, joint: str, values: Values) -> Case:
        """The case of values; joint: the only one that can fail, empty for all of them.

        Raises InputError.
        """
        plan = Plan({}, {n: [v] for n, v in values.items()}, dict(self.variables.tied))
        if not joint:
            return next(case for _, case in planned_cases(self.case, plan)) if values else self.case
        settings = dict(next(plan.rows())) if values else {}
        unbreakable = UNBREAKABLE * self.case["E_dam"]
        for other in self.case.joint_names:
            if other != joint:
                mine = [name for name in settings if name.startswith(f"{other}.")]
                for name in mine:
                    del settings[name]
                settings |= {f"{other}.law": "friction", f"{other}.adhesion": unbreakable}
        return varied(self.case, settings)

    def matters(self, joint: str, name: str) -> bool:
        """Whether a variable acts on the critical level of a joint: no level, and of no other."""
        of_joint = name.rpartition(".")[0]
        return name != "level" and (not joint or of_joint in ("", joint))

    def rates(self, joint: str, row: Values) -> dict[str, float] | None:
        """The derivatives of the critical level with the variables, at values at which it is known;
        None if it has none there. Raises InputError.
        """
        chosen = {n: v for n, v in row.items() if self.matters(joint, n)}
        known = self.known[keys.study_key(self.case_of(joint, chosen), "reliability")]
        names = self.differentiated(joint)
        texts = [known.get(rate_column(name), "") for name in names]
        if "" in texts:
            return None
        given = dict(zip(names, map(float, texts), strict=True))
        result = {}
        for name, value in ((n, float(v)) for n, v in chosen.items()):
            step = OF_EXPRESSIONS * abs(value) or OF_EXPRESSIONS
            ends = [self.tied(chosen | {name: value + s}) for s in (-step, step)]
            slopes = {n: (ends[1][n] - ends[0][n]) / (2 * step) for n in ends[0]}
            of_tied = (given[n] * slope for n, slope in slopes.items() if n in given)
            result[name] = given.get(name, 0.0) + sum(of_tied)
        return result

    def tied(self, values: Values) -> dict[str, float]:
        """The values of the expressions of variables. Raises InputError."""
        plan = Plan({}, {n: [v] for n, v in values.items()}, dict(self.variables.tied))
        return {n: float(v) for n, v in next(plan.rows()).items() if n in self.variables.tied}

    def differentiated(self, joint: str) -> list[str]:
        """The parameters with which the level is differentiated."""
        names = [*self.variables.names, *self.variables.tied]
        return [name for name in names if self.matters(joint, name)]

    def of(
        self, joint: str, rows: Sequence[Values], rates: bool = False
    ) -> list[Mapping[str, Value]]:
        """The results for rows of values; rates: with derivatives. Raises InputError, RunError."""
        further = self.differentiated(joint) if rates else []
        chosen = [{n: v for n, v in row.items() if self.matters(joint, n)} for row in rows]
        cases = [self.case_of(joint, values) for values in chosen]
        names = [keys.study_key(case, "reliability") for case in cases]
        column = rate_column(further[0]) if further else "critical_level"
        tasks = {
            key: (case, further)
            for key, case in zip(names, cases, strict=True)
            if column not in self.known.get(key, {})
        }
        values_of = dict(zip(names, chosen, strict=True))
        if tasks:
            interface_of(next(iter(tasks.values()))[0])  # condensed before the processes start
            jobs, work = process_count(self.jobs, len(tasks)), [[key] for key in tasks]
            for key, result in spread_bundles(rows_of, work, tasks, jobs, self.client):
                self.computed += 1
                self.on_row(key, joint, values_of[key], result)
                # as the file has it: a study that continues takes the same points
                numbers = ["critical_level", *map(rate_column, further)]
                given = {n: result.get(n, "") for n in numbers}
                rest = {n: v if v == "" else rounded(float(v)) for n, v in given.items()}
                self.known[key] = {**result, **rest}
        results = [self.known[key] for key in names]
        self.used |= dict(zip(names, results, strict=True))
        return results

    @property
    def undecided(self) -> int:
        """How many of the levels used have no result."""
        return sum(row["mode"] == ERROR for row in self.used.values())

    @property
    def unconfirmed(self) -> int:
        """How many of them are not confirmed by a mechanism or a limit point."""
        return sum(float(row["confirmed"]) == 0 for row in self.used.values()) - self.undecided


class LimitState:
    """g [m] of normal variables: the critical level of all joints, or of one, minus the level."""

    def __init__(self, levels: CriticalLevels, joint: str = "") -> None:
        self.levels, self.joint = levels, joint

    def gradient(self, point: Any) -> Array:
        """The derivatives (n, 1) of g with the normal variables at a point: by those of the
        critical level, else differences: central, but at the medians, where the search begins.
        """
        variables, z = self.levels.variables, np.asarray(point, float)
        rates = self.rates(z)
        if rates is None:
            steps = STEP * np.eye(len(z))
            others = z - steps if z.any() else z[None]
            values = np.ravel(self.evaluated([*(z + steps), *others], False))
            high, low = values[: len(z)], values[len(z) :]
            return ((high - low) / (STEP * (2 if z.any() else 1)))[:, None]
        slopes = variables.slopes(z)
        of_level = {"level": -1.0}
        return np.array([[slopes[n] * (rates | of_level).get(n, 0.0)] for n in variables.names])

    def rates(self, z: Array) -> dict[str, float] | None:
        """The derivatives of the critical level with the variables; None if it has none."""
        self.evaluated([z])
        return self.levels.rates(self.joint, self.levels.variables.values(z))

    def hessian(self, point: Any) -> Array:
        """The second derivatives (n, n, 1) of g: central differences of the first ones; of values,
        two more for each pair of variables, where the critical level has no derivatives.
        """
        z = np.asarray(point, float)
        steps = STEP * np.eye(len(z))
        if self.rates(z) is None:
            i, j = np.triu_indices(len(z), 1)
            pairs = steps[i] + steps[j]
            points = [z, *(z + steps), *(z - steps), *(z + pairs), *(z - pairs)]
            values = np.ravel(self.evaluated(points, False))
            here, beside, both = np.split(values, [1, 1 + 2 * len(z)])
            sums = beside.reshape(2, -1).sum(axis=0) - 2 * here
            bends = np.diag(sums)
            bends[i, j] = (both.reshape(2, -1).sum(axis=0) - 2 * here - sums[i] - sums[j]) / 2
            bends[j, i] = bends[i, j]
            return bends[:, :, None] / STEP**2
        self.evaluated([*(z + steps), *(z - steps)])  # in parallel
        rows = [np.ravel(self.gradient(z + s)) - np.ravel(self.gradient(z - s)) for s in steps]
        bends = np.array(rows) / (2 * STEP)
        return ((bends + bends.T) / 2)[:, :, None]

    def evaluated(self, points: Any, rates: bool = True) -> Array:
        """g (points, 1) at points; where its level is not known, the dam counts as failed. rates:
        whether levels are computed with their derivatives.
        """
        rows = self.levels.variables.values_at(np.asarray(points, float))
        results = self.levels.of(self.joint, rows, rates)
        top = self.levels.case.levels[-1]
        margins = [
            float(result["critical_level"] or 0.0) - row.get("level", top)
            for row, result in zip(rows, results, strict=True)
        ]
        return np.array(margins)[:, None]


# -- methods
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Reliability:
    """The reliability of all joints, or of one."""

    joint: str
    #: by FORM: reliability index (negative where the medians fail), design point as normal
    #: variables and as values, importance factors by name (their sum is 1); whether it is found
    beta: float
    point: tuple[float, ...]
    design: Mapping[str, float]
    importance: Mapping[str, float]
    converged: bool
    #: probabilities of failure; None without a design point, or where a curvature does not allow
    #: them
    form: float | None
    breitung: float | None
    tvedt: float | None
    #: by importance sampling: share, limits of its interval, number of samples
    sampled: float = float("nan")
    low: float = float("nan")
    high: float = float("nan")
    samples: int = 0

    def words(self) -> str:
        """Whether the methods agree."""
        if not self.samples:
            return ""
        if self.form is None:
            return "no design point is found: the samples are plain Monte Carlo"
        if not self.sampled > 0:
            return "no sample has failed: the design point is doubtful"
        if self.agrees(self.form):
            return "FORM agrees with the samples"
        below, ratio = self.form < self.sampled, self.form / self.sampled
        side = "below the samples, on the unsafe side" if below else "above them, on the safe side"
        head = f"FORM is {100 * abs(1 - ratio):.0f} % {side}"
        second = [p for p in (self.breitung, self.tvedt) if p is not None]
        if any(map(self.agrees, second)):
            return f"{head}: the limit state is curved; SORM agrees with the samples"
        return (
            f"{head}, and SORM disagrees, too: the limit state has a kink or further design "
            "points; take the samples"
        )

    def agrees(self, probability: float) -> bool:
        """Whether a probability is so near to the sampled one that chance may be the reason."""
        above = probability > self.sampled
        half = self.high - self.sampled if above else self.sampled - self.low
        error = half / stats.norm.isf((1 - sampling.CONFIDENCE) / 2)
        return abs(probability - self.sampled) <= DISAGREES * error


def design_point(limit: LimitState, library: OpenTurns, start: Sequence[float]) -> Reliability:
    """FORM and SORM of a limit state; start: normal variables where the search begins.

    Raises InputError, RunError.
    """
    variables, precision = limit.levels.variables, PRECISION * limit.levels.case.levels[-1]
    unit = UNIT * float(np.linalg.norm(limit.gradient(start))) or 1.0
    tolerances = TOLERANCE, precision / unit
    problem = variables.rank_correlations(), start, tolerances, unit
    found = library.result(nearest_failure, *problem, answers=limit)
    if found is None:
        origin = dict.fromkeys(variables.names, float("nan"))
        nothing = (0.0,) * len(start), origin, origin
        return Reliability(limit.joint, float("nan"), *nothing, False, None, None, None)
    return Reliability(
        joint=limit.joint,
        beta=-found.distance if found.median_fails else found.distance,
        point=found.point,
        design=variables.values(found.point),
        importance=dict(zip(variables.names, found.importance, strict=True)),
        converged=found.converged,
        form=found.form,
        breitung=found.breitung,
        tvedt=found.tvedt,
    )


def sampled(
    limit: LimitState,
    library: OpenTurns,
    around: Sequence[Reliability],
    number: int,
    seed: int,
) -> tuple[float, float, float]:
    """Probability of failure by importance sampling around design points, and the limits of its
    interval: that of a sum of weighted Poisson numbers [Fay and Feuer 1997], with the variance of
    the weights. That of the normal distribution is too narrow above where few samples with large
    weights decide. Raises InputError, RunError.
    """
    ranks, centres = limit.levels.variables.rank_correlations(), [one.point for one in around]
    points, logs = library.result(points_around, ranks, centres, number, seed)
    blocks = [points[i : i + BLOCK] for i in range(0, number, BLOCK)]
    fails = np.concatenate([np.ravel(limit.evaluated(block, False)) < 0 for block in blocks])
    return weighted_share(np.exp(logs), fails)


def weighted_share(weights: Array, fails: BoolArray) -> tuple[float, float, float]:
    """The mean weight of the samples that fail, weights (n,), and the limits of its interval."""
    number, tail = len(weights), (1 - sampling.CONFIDENCE) / 2
    share = float(np.mean(weights * fails))
    variance = float(np.var(weights * fails, ddof=1)) / number if number > 1 else 0.0
    largest = float((weights[fails] if fails.any() else weights).max()) / number
    if not variance > 0:  # none or all fail, with equal weights
        variance = float(np.sum((weights * fails) ** 2)) / number**2
    low = 0.0
    if share > 0:
        low = variance / (2 * share) * float(stats.chi2.ppf(tail, 2 * share**2 / variance))
    mean, spread = share + largest, variance + largest**2
    high = spread / (2 * mean) * float(stats.chi2.isf(tail, 2 * mean**2 / spread))
    return min(share, 1.0), low, min(high, 1.0)


def analysed(
    levels: CriticalLevels, samples: int, seed: int, on_progress: Callable[[str], None]
) -> Iterator[Reliability]:
    """The reliability of each of several joints alone, if no other could fail, then that of all.

    Raises InputError, RunError.
    """
    several = levels.case.joint_names
    joints = list(several) if len(several) > 1 else []
    single: list[Reliability] = []
    origin = [0.0] * len(levels.variables.names)
    with openturns() as library:
        for joint in [*joints, ""]:
            limit = LimitState(levels, joint)
            where = f"{joint}: " if joint else ""
            on_progress(f"{where}design point")
            nearest = min((s for s in single if s.form), key=lambda s: s.beta, default=None)
            result = design_point(limit, library, nearest.point if nearest else origin)
            if samples:
                on_progress(f"{where}{samples} samples")
                around = [s for s in (*([] if joint else single), result) if s.form] or [result]
                share = sampled(limit, library, around, samples, seed)
                result = replace(
                    result, sampled=share[0], low=share[1], high=share[2], samples=samples
                )
            single.append(result)
            yield result


def design_case(levels: CriticalLevels, result: Reliability) -> Case:
    """The case of a design point, filled to its level. Raises InputError."""
    values = {n: v for n, v in result.design.items() if n != "level"}
    case = levels.case_of("", values)
    level = result.design.get("level")
    if level is not None:
        case = varied(case, {}, **up_to(case, level))
    return replace(case, title=f"{case.title}: design point")


def columns_of(variables: Variables) -> list[str]:
    """The columns of reliability.csv."""
    names = [n for n in variables.names if n != "level"]
    rates = [rate_column(n) for n in (*names, *variables.tied)]
    return ["key", "of_joint", *names, *RESULTS, *rates]


def level_row(
    variables: Variables, joint: str, values: Values, result: Mapping[str, Value]
) -> dict[str, Value]:
    """A critical level by the columns of reliability.csv but key; "" where it has no value."""
    cells = {"of_joint": joint, **values, **result}
    return {name: cells.get(name, "") for name in columns_of(variables)[1:]}


def cells_of(
    variables: Variables, key: str, joint: str, values: Values, result: Mapping[str, Value]
) -> list[str]:
    """A row of reliability.csv."""
    return [key, *map(in_file, level_row(variables, joint, values, result).values())]
