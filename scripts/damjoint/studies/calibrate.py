"""Calibration: the values of parameters with which a case computes what was measured.

Weighted least squares [scipy.optimize.least_squares, trust region reflective] over the logarithm of
parameters that are positive, and over others as they are. Measured values have independent normal
errors of given standard deviations, priors are further terms. Intervals are those of the profile
likelihood [Venzon and Moolgavkar 1988] with residuals of second order around the estimate; where
this has none, as beside a limit, those of the problem linearised there [Seber and Wild 1989].
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from scipy import optimize, stats

from .. import InputError, RunError
from ..arrays import Array
from ..input import parameters
from ..input.arithmetic import check_units, explained, quantity
from ..input.case import Case
from ..input.resolve import varied
from ..processes import as_finished, process_count
from ..solver.load_stepper import LoadStepper
from ..threads import limited_threads
from . import sampling
from .measurements import Measurements, Series
from .sensitivity import has_derivative

#: Confidence level of the intervals.
CONFIDENCE = 0.95
#: Step of the differences in a scaled parameter: its logarithm, or its value over its scale.
STEP = 1e-3
#: Relative change of the sum of squares at which the search ends: of a hundred values that fit,
#: 1e-3 of chi2, 0.03 standard deviations of an estimate. Below, kinks of the points decide.
SAME_SQUARES = 1e-5
#: Change of the scaled parameters, over themselves, at which it ends.
SAME_PARAMETERS = 1e-6
#: Derivative of half the sum of squares by a scaled parameter at which it ends.
SMALLEST_GRADIENT = 1e-10
#: Most iterations of the search.
MOST_ITERATIONS = 50
#: A parameter without limits stays within this factor of its start value, up and down.
FACTOR = 1e4
#: A parameter is not determined if the standard deviation of its logarithm, or of its value over
#: its scale, is larger: the interval then covers more than a factor of 50.
DETERMINED = 1.0
#: A correlation above which two parameters are said to act alike.
ALIKE = 0.95
#: Singular values over the largest one below which a direction has no effect.
NO_EFFECT = 1e-10
#: The probability, of all tests of the residuals together, with which a right model is rejected.
SIGNIFICANCE = 0.01
#: Fewest values of a series whose residuals are tested for trends.
FEWEST = 8
#: Farthest end of an interval of the profile likelihood, in standard deviations [-].
FARTHEST = 6.0
#: Weighted residual of a reading that a trial of the search does not reach.
UNREACHED = 1e3


@dataclass(frozen=True)
class Free:
    """A free parameter, scaled: x = ln(value / start) if it is positive, else (value - start) /
    scale.
    """

    name: str
    start: float
    low: float
    high: float
    positive: bool
    scale: float
    #: mean and standard deviation of a prior of the value, or of its logarithm; None: no prior
    prior: tuple[float, float, bool] | None = None

    def value(self, x: float) -> float:
        """The value of a scaled one."""
        return self.start * math.exp(x) if self.positive else self.start + self.scale * x

    def scaled(self, value: float) -> float:
        """The scaled value, also of an infinite one."""
        if self.positive:
            return math.log(value / self.start) if value > 0 else -math.inf
        return (value - self.start) / self.scale

    def slope(self, x: float) -> float:
        """The derivative of the value with the scaled one."""
        return self.value(x) if self.positive else self.scale

    def residual(self, x: float) -> float:
        """The weighted residual of the prior."""
        assert self.prior
        mean, deviation, logarithm = self.prior
        value = self.value(x)
        return ((math.log(value) if logarithm else value) - mean) / deviation

    def residual_slope(self, x: float) -> float:
        """The derivative of that residual."""
        assert self.prior
        _, deviation, logarithm = self.prior
        return self.slope(x) / deviation / (self.value(x) if logarithm else 1.0)


def free_of(case: Case, texts: Sequence[str]) -> list[Free]:
    """The free parameters of NAME,NAME, NAME=LOW:HIGH or NAME=normal(MEAN,SD) and
    NAME=lognorm(S,0,MEDIAN), which start at the case's values; JOINT.NAME: of one joint.

    Raises InputError.
    """
    found: list[Free] = []
    for text in texts:
        for part in [text] if "=" in text else text.split(","):
            name, equals, limits = (word.strip() for word in part.partition("="))
            if any(name == other.name for other in found):
                raise InputError(f"--free {name}: must be given once")
            found.append(free(case, name, limits if equals else None))
    if not found:
        raise InputError("--free: must name a parameter, such as K_N")
    return found


def free(case: Case, name: str, limits: str | None) -> Free:
    """A free parameter; limits: LOW:HIGH, a prior, or None. Raises InputError."""
    declared = parameters.of_any_joint(name)
    text = f"--free {name}" + (f"={limits}" if limits is not None else "")
    if not declared.real:
        raise InputError(f"{text}: must be of a parameter that is a real number")
    start = float(case.single_value(name, text))  # with one for all it would be another dam
    low, high, prior = declared.minimum, declared.maximum, None
    if limits is not None and "(" in limits:
        prior = parsed_prior(text, name, limits)
        if not low <= start <= high:
            raise InputError(f"{text}: must start at a value, {name} = {start:g}")
    elif limits is not None:
        low, high = limits_of(text, limits, declared.unit)
        low, high = max(low, declared.minimum), min(high, declared.maximum)
        if not low <= start <= high:
            raise InputError(f"{text}: must contain the start value, {name} = {start:g}")
    positive = declared.minimum >= 0 and start > 0
    if positive:
        low, high, scale = max(low, start / FACTOR), min(high, start * FACTOR), start
    elif limits is None:
        raise InputError(
            f"{text}: starts at {start:g}; must have limits, {name}=LOW:HIGH, or a prior, "
            f"{name}=normal(MEAN,SD)"
        )
    else:
        scale = prior[1] if prior else (high - low) / 4
    return Free(name, start, low, high, positive, scale, prior)


def limits_of(text: str, limits: str, unit: str) -> tuple[float, float]:
    """The numbers of LOW:HIGH in a unit. Raises InputError."""
    rule = "must be LOW:HIGH, normal(MEAN,SD) or lognorm(S,0,MEDIAN)"
    check_units(text, limits.split(":"))
    try:
        low, high = (quantity(part, unit) for part in limits.split(":"))
    except ValueError as error:
        raise InputError(explained(text, rule, error)) from None
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError(f"{text}: {rule}")
    return low, high


def parsed_prior(text: str, name: str, words: str) -> tuple[float, float, bool]:
    """Mean and standard deviation of a normal prior; of a lognormal one those of the logarithm, and
    True. Raises InputError.
    """
    frozen = sampling.distribution(name, words, "--free", parameters.of_any_joint(name).unit)
    kind = words.partition("(")[0].strip()
    if kind in ("normal", "norm"):
        return float(frozen.mean()), float(frozen.std()), False
    if kind != "lognorm" or frozen.support()[0] != 0:
        raise InputError(f"{text}: a prior must be normal(MEAN,SD) or lognorm(S,0,MEDIAN)")
    median = float(frozen.median())
    above = float(frozen.ppf(stats.norm.cdf(1)))  # by a standard deviation
    return math.log(median), math.log(above / median), True


@dataclass
class Calibration:
    """The result of a calibration."""

    #: the case with the estimates and the levels of the readings
    case: Case
    free: list[Free]
    measurements: Measurements
    #: scaled parameters, and the covariance of their errors; inf where they are not determined
    x: Array
    covariance: Array
    #: what the calibrated case computes (series, readings)
    computed: Array
    #: number of runs, and whether the search came to its end
    runs: int = 0
    converged: bool = True
    #: ends of the intervals of the scaled parameters (parameters, 2), nan: by their deviations
    ends: Array | None = None
    #: the run of the case with the estimates
    stepper: LoadStepper | None = None
    #: interval of each parameter, low and high (parameters, 2)
    intervals: Array = field(init=False)

    def __post_init__(self) -> None:
        width = stats.norm.ppf((1 + CONFIDENCE) / 2) * self.deviations
        linear = np.column_stack([self.x - width, self.x + width])
        ends = linear if self.ends is None else np.where(np.isnan(self.ends), linear, self.ends)
        limits = []
        for one, pair in zip(self.free, ends, strict=True):
            low, high = one.scaled(one.low), one.scaled(one.high)
            limits.append([one.value(float(v)) for v in np.clip(pair, low, high)])
        self.intervals = np.array(limits)

    @property
    def estimates(self) -> Array:
        """The values of the parameters."""
        return np.array([one.value(x) for one, x in zip(self.free, self.x, strict=True)])

    @property
    def deviations(self) -> Array:
        """Standard deviations of the scaled parameters."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Array:
        """Correlations of the estimates; nan where a parameter is not determined."""
        deviations = np.where(np.isfinite(self.deviations), self.deviations, np.nan)
        return self.covariance / np.outer(deviations, deviations)

    @property
    def undetermined(self) -> list[str]:
        """Parameters that the measurements do not determine, or whose estimate is at a limit."""
        names = []
        for one, x, deviation in zip(self.free, self.x, self.deviations, strict=True):
            low, high = one.scaled(one.low), one.scaled(one.high)
            at_limit = min(x - low, high - x) < STEP
            if not deviation <= DETERMINED or at_limit:
                names.append(one.name)
        return names

    @property
    def alike(self) -> list[tuple[str, str, float]]:
        """Pairs of parameters that the measurements hardly tell apart, and their correlations."""
        correlation, names = self.correlation, [one.name for one in self.free]
        return [
            (names[i], names[j], float(correlation[i, j]))
            for i in range(len(names))
            for j in range(i)
            if abs(correlation[i, j]) > ALIKE
        ]

    @property
    def residuals(self) -> Array:
        """Measured minus computed over the standard deviation (series, readings); nan."""
        series = self.measurements.series
        measured = np.array([one.measured for one in series])
        return (measured - self.computed) / np.array([one.deviation for one in series])

    @property
    def squares(self) -> float:
        """Sum of the squares of the weighted residuals, without the priors."""
        return float(np.nansum(self.residuals**2))

    @property
    def freedom(self) -> int:
        """Degrees of freedom: measured values less free parameters without a prior."""
        return self.measurements.number - sum(one.prior is None for one in self.free)

    @property
    def findings(self) -> list[str]:
        """What the residuals show that errors of the given standard deviations would not."""
        tests = [test for k in range(len(self.computed)) for test in self.tests(k)]
        tests.append((stats.chi2.sf(self.squares, max(self.freedom, 1)), self.all_squares))
        return [text for chance, text in tests if chance < SIGNIFICANCE / len(tests)]

    @property
    def all_squares(self) -> str:
        """The sum of squares in words."""
        return f"chi2 = {self.squares:.4g} with {self.freedom} degrees of freedom"

    def tests(self, number: int) -> list[tuple[float, str]]:
        """Tests of the residuals of a series: the probability of a deviation as large by chance,
        and the deviation in words.
        """
        one: Series = self.measurements.series[number]
        read = np.isfinite(one.measured)
        r, n = self.residuals[number][read], int(read.sum())
        times, levels = self.measurements.times[read], np.array(self.measurements.levels)[read]
        mean, spread = float(r.mean()), float(np.mean(r**2)) ** 0.5
        sign = "above" if mean > 0 else "below"
        found = [
            (
                math.erfc(abs(mean) * math.sqrt(n / 2)),
                f"{one.name}: measured on average {abs(mean):.2g} standard deviations {sign} "
                "computed",
            ),
            (
                float(stats.chi2.sf(n * spread**2, n)),
                f"{one.name}: residuals of {spread:.2g} standard deviations (root mean square)",
            ),
        ]
        if n < FEWEST or np.ptp(r) == 0:
            return found
        centred = r - mean
        lag = float(centred[1:] @ centred[:-1] / (centred @ centred))
        found.append(
            (
                math.erfc(abs(lag) * math.sqrt(n / 2)),
                f"{one.name}: neighbouring residuals correlate ({lag:.2f})",
            )
        )
        for what, along in (("time", times), ("the level", levels)):
            if np.ptp(along) > 0:
                trend = stats.spearmanr(along, r)
                text = f"{one.name}: residuals follow {what} (rank correlation {trend[0]:.2f})"
                found.append((float(trend[1]), text))
        return found


#: What a trial computes: the series, or None if the dam has no equilibrium at a reading.
Computed = Array | None


def trial(measurements: Measurements, case: Case) -> Computed:
    """What a case computes in place of the measurements; None without an equilibrium."""
    with limited_threads(1):
        try:
            return measurements.computed(case)
        except RunError:
            return None


class Fit:
    """The search for the values of the free parameters."""

    def __init__(
        self,
        case: Case,
        free: list[Free],
        measurements: Measurements,
        jobs: int | None = None,
        on_run: Callable[[int, float], None] = lambda runs, squares: None,
    ) -> None:
        """jobs: number of processes for the derivatives; on_run: called with the number of runs and
        the least sum of squares so far.
        """
        self.case, self.free, self.measurements = measurements.loaded(case), free, measurements
        self.jobs, self.on_run, self.runs, self.least = jobs, on_run, 0, math.inf
        self.measured = np.array([one.measured for one in measurements.series])
        self.deviation = np.array([one.deviation for one in measurements.series])
        self.read = np.isfinite(self.measured)
        #: last scaled parameters and what they compute, and the run of the last that has all
        self.last: tuple[Array, Computed] = np.array([]), None
        self.stepper: LoadStepper | None = None

    def at(self, x: Array) -> Case:
        """The case with scaled parameters."""
        return varied(self.case, {f.name: f.value(v) for f, v in zip(self.free, x, strict=True)})

    def computed(self, x: Array) -> Computed:
        """What the case computes with scaled parameters."""
        if not np.array_equal(self.last[0], x):
            found: Computed = None
            with limited_threads(1), contextlib.suppress(RunError):
                self.stepper = self.measurements.run_of(self.at(x))
                found = self.measurements.of_run(self.stepper)
            self.last = x.copy(), found
            self.runs += 1
        return self.last[1]

    def weighted(self, x: Array, computed: Computed) -> Array:
        """The weighted residuals, with those of the priors."""
        priors = [f.residual(v) for f, v in zip(self.free, x, strict=True) if f.prior]
        if computed is None:
            return np.concatenate([np.full(self.read.sum(), UNREACHED), priors])
        residuals = (computed - self.measured) / self.deviation
        return np.concatenate([residuals[self.read], priors])

    def residuals(self, x: Array) -> Array:
        """The weighted residuals of scaled parameters."""
        weighted = self.weighted(x, self.computed(x))
        self.least = min(self.least, float(weighted @ weighted))
        self.on_run(self.runs, self.least)
        return weighted

    def derivatives(self, x: Array, central: bool = False) -> Array:
        """The derivatives of the weighted residuals (residuals, parameters): by direct
        differentiation of the run, by differences with parameters with which a computed value has
        no exact one.

        Raises RunError if the dam has no equilibrium beside a difference.
        """
        slopes = self.exact(x)
        others = np.flatnonzero(np.isnan(slopes).any(axis=0)).tolist()
        slopes[:, others] = self.by_differences(x, others, central)
        return slopes

    def exact(self, x: Array) -> Array:
        """Those by direct differentiation; nan where there is none."""
        slopes = np.full((len(self.weighted(x, self.computed(x))), len(self.free)), np.nan)
        some = [k for k, one in enumerate(self.free) if has_derivative(self.case, one.name)]
        at_each = list(zip(self.free, x.tolist(), strict=True))
        priors = np.diag([f.residual_slope(v) if f.prior else 0.0 for f, v in at_each])
        with limited_threads(1), contextlib.suppress(InputError, RunError, np.linalg.LinAlgError):
            assert self.stepper
            rates = self.measurements.rates_of_run(self.stepper, [self.free[k].name for k in some])
            scales = np.array([f.slope(v) for f, v in at_each])[some]
            weighted = (rates / self.deviation[:, :, None])[self.read] * scales
            of_priors = priors[[f.prior is not None for f in self.free]]
            slopes[:, some] = np.vstack([weighted, of_priors[:, some]])
        return slopes

    def by_differences(self, x: Array, numbers: Sequence[int], central: bool) -> Array:
        """Those with parameters of some numbers, one step away from a limit."""
        steps = []
        for k in numbers:
            one = self.free[k]
            step = STEP if x[k] + STEP <= one.scaled(one.high) else -STEP
            for factor in (1, -1) if central else (1,):
                shifted = x.copy()
                shifted[k] = np.clip(
                    x[k] + factor * step, one.scaled(one.low), one.scaled(one.high)
                )
                steps.append((k, shifted))
        found = self.computed_at([shifted for _, shifted in steps])
        start = self.weighted(x, self.computed(x))
        slopes = np.zeros((len(start), len(numbers)))
        ends: dict[int, list[tuple[float, Array]]] = {k: [] for k in numbers}
        for number, (k, shifted) in enumerate(steps):
            if found[number] is not None:
                ends[k].append((shifted[k], self.weighted(shifted, found[number])))
        for column, (k, reached) in enumerate(ends.items()):
            pairs = [*reached, (x[k], start)] if len(reached) < 2 else reached
            (x1, r1), (x0, r0) = pairs[0], pairs[-1]
            if x1 == x0:
                name = self.free[k].name
                raise RunError(f"{name}: the dam has no equilibrium beside {self.at(x)[name]:g}")
            slopes[:, column] = (r1 - r0) / (x1 - x0)
        return slopes

    def computed_at(self, points: Sequence[Array]) -> list[Computed]:
        """What the case computes at several scaled parameters, in parallel."""
        work, cases = partial(trial, self.measurements), [self.at(point) for point in points]
        jobs = process_count(self.jobs, len(cases))
        found = dict(as_finished(work, cases, jobs) if jobs > 1 else enumerate(map(work, cases)))
        self.runs += len(cases)
        return [found[number] for number in range(len(cases))]

    def profile(self, x: Array, covariance: Array) -> Array | None:
        """The ends (parameters, 2) of the intervals of the profile likelihood around an estimate,
        nan where there is none; None if a parameter is not determined, or if the dam has no
        equilibrium within a standard deviation.
        """
        deviations = np.sqrt(np.diag(covariance))
        limits = np.array([[one.scaled(v) for v in (one.low, one.high)] for one in self.free])
        inside = np.minimum(x - limits[:, 0], limits[:, 1] - x) > deviations
        if not (deviations <= DETERMINED).all() or not inside.all():
            return None
        number, units = len(x), np.diag(deviations)
        pairs = [(i, j) for i in range(number) for j in range(i)]
        points = [*(x + units), *(x - units), *(x + units[i] + units[j] for i, j in pairs)]
        found = self.computed_at([np.clip(point, *limits.T) for point in points])
        if any(computed is None for computed in found):
            return None
        parts = [self.weighted(p, c) for p, c in zip(points, found, strict=True)]
        values, start = np.array(parts), self.weighted(x, self.computed(x))
        above, below, mixed = np.split(values, [number, 2 * number])
        bends = np.zeros((number, number, len(start)))
        bends[np.diag_indices(number)] = above + below - 2 * start
        for (i, j), value in zip(pairs, mixed, strict=True):
            bends[i, j] = bends[j, i] = (
                value - start - (above - below)[[i, j]].sum(axis=0) / 2
            ) - (bends[i, i] + bends[j, j]) / 2
        ends = Quadratic(start, (above - below) / 2, bends).profile_ends()
        return x[:, None] + deviations[:, None] * ends

    def run(self) -> Calibration:
        """Find the estimates.

        Raises RunError if the dam has no equilibrium with the start values.
        """
        start = np.zeros(len(self.free))
        self.stepper = self.measurements.run_of(self.case)
        self.last = start.copy(), self.measurements.of_run(self.stepper)  # its error is the user's
        self.runs = 1
        low = np.array([one.scaled(one.low) for one in self.free])
        high = np.array([one.scaled(one.high) for one in self.free])
        found = optimize.least_squares(
            self.residuals,
            np.clip(start, low, high),
            self.derivatives,
            bounds=(low, high),
            ftol=SAME_SQUARES,
            xtol=SAME_PARAMETERS,
            gtol=SMALLEST_GRADIENT,
            max_nfev=MOST_ITERATIONS,
        )
        computed = self.computed(found.x)
        if computed is None:
            raise RunError("the search ended where the dam has no equilibrium at a reading")
        covariance = inverse(self.derivatives(found.x, central=True))
        ends = self.profile(found.x, covariance)
        return Calibration(
            case=self.at(found.x),
            free=self.free,
            measurements=self.measurements,
            x=found.x,
            covariance=covariance,
            computed=computed,
            runs=self.runs,
            converged=found.status > 0,
            ends=ends,
            stepper=self.stepper,
        )


@dataclass(frozen=True)
class Quadratic:
    """Weighted residuals of second order in p parameters z, in standard deviations."""

    #: (n,) at the estimate, z = 0; first (p, n) and second (p, p, n) derivatives
    start: Array
    slopes: Array
    bends: Array

    def residuals(self, z: Array) -> Array:
        """The residuals (n,)."""
        return np.asarray(self.start + z @ self.slopes + z @ np.tensordot(z, self.bends, 1) / 2)

    def jacobian(self, z: Array) -> Array:
        """Their derivatives (n, p)."""
        return np.asarray((self.slopes + np.tensordot(z, self.bends, 1)).T)

    def least(self, fixed: int | None, value: float, first: Array) -> tuple[float, Array]:
        """The least sum of squares, one parameter fixed at a value or none, and where it is; first:
        where the search begins.
        """
        free = [k for k in range(len(self.slopes)) if k != fixed]

        def whole(part: Array) -> Array:
            z = np.zeros(len(self.slopes))
            z[free] = part
            if fixed is not None:
                z[fixed] = value
            return z

        if not free:
            z = whole(np.zeros(0))
            return float(np.sum(self.residuals(z) ** 2)), z

        def residuals(part: Array) -> Array:
            return self.residuals(whole(part))

        def jacobian(part: Array) -> Array:
            return self.jacobian(whole(part))[:, free]

        found = optimize.least_squares(
            residuals,
            first[free],
            jacobian,
            method="lm" if len(self.start) >= len(free) else "trf",
        )
        return float(2 * found.cost), whole(found.x)

    def profile_ends(self) -> Array:
        """The values (p, 2) of each parameter at which the least sum of squares with the others is
        larger by the quantile of chi2; nan beyond FARTHEST.
        """
        number, most = len(self.slopes), float(stats.chi2.ppf(CONFIDENCE, 1))
        least, middle = self.least(None, 0.0, np.zeros(number))
        ends = np.full((number, 2), np.nan)
        for k in range(number):
            for side, sign in enumerate((-1, 1)):

                def excess(size: float, k: int = k, sign: int = sign) -> float:
                    value = middle[k] + sign * size
                    return self.least(k, value, middle)[0] - least - most

                if excess(FARTHEST) > 0:
                    ends[k, side] = middle[k] + sign * optimize.brentq(excess, 0.0, FARTHEST)
        return ends


def inverse(slopes: Array) -> Array:
    """Covariance of the estimates, the inverse of slopes' slopes; inf for parameters that take part
    in a direction without effect.
    """
    number = slopes.shape[1]  # rows of zeros: all directions, also of fewer values than parameters
    padded = np.vstack([slopes, np.zeros((number, number))])
    _, singular, directions = np.linalg.svd(padded, full_matrices=False)
    effect = singular > NO_EFFECT * max(singular.max(initial=0.0), 1.0)
    scaled = directions[effect].T / singular[effect]
    covariance: Array = scaled @ scaled.T
    silent = (np.abs(directions[~effect]) > np.sqrt(NO_EFFECT)).any(axis=0)
    covariance[np.diag_indices_from(covariance)] = np.where(silent, np.inf, np.diag(covariance))
    return covariance
