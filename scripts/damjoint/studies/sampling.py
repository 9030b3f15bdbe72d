"""Uncertain parameters: samples from scipy's distributions, probability of failure, sensitivity."""

from __future__ import annotations

import warnings
from typing import Literal

import numpy as np
from scipy import linalg, stats

from .. import InputError
from ..arrays import Array, IntArray
from ..input.arithmetic import arguments_of, check_units, explained, parsed_call

#: Distributions by scipy's names, and `normal`.
DISTRIBUTIONS = {
    name: kind for name, kind in vars(stats).items() if isinstance(kind, stats.rv_continuous)
}
DISTRIBUTIONS["normal"] = stats.norm
#: Without distributions that have no closed form: each value takes minutes.
for slow in ("ksone", "kstwo", "levy_stable", "studentized_range"):
    del DISTRIBUTIONS[slow]

#: Confidence level of the interval of a probability.
CONFIDENCE = 0.95

#: Most iterations for a correlated sample, which then stays as it is.
MOST_ITERATIONS = 30
#: Tolerance of its rank correlations [-].
TOLERANCE = 1e-4


def distribution(
    name: str, text: str, option: str = "--sample", unit: str = ""
) -> stats.distributions.rv_frozen:
    """The distribution of 'normal(1.0, 0.15)': a name of scipy.stats with its shapes, loc, scale.
    option: that has it, for messages; unit: of its numbers, empty: any.

    Raises InputError.
    """
    setting, rule = f"{option} {name}={text}", "must be a distribution of scipy.stats with numbers"
    message = f"{setting}: {rule}"
    try:
        kind, numbers, named = parsed_call(text, unit)
    except ValueError as error:
        rule += ", such as normal(1.0,0.15) or uniform(0.5,scale=0.3)"
        raise InputError(explained(setting, rule, error)) from None
    if kind not in DISTRIBUTIONS:
        known = "normal, lognorm, truncnorm, uniform, triang, weibull_min, gumbel_r, beta, ..."
        raise InputError(f"{message}; {kind} is none; known: {known}")
    shapes = [*filter(None, (DISTRIBUTIONS[kind].shapes or "").split(", "))]
    listed, texts = arguments_of(text)
    further = [texts[name] for name in ("loc", "scale") if name in texts]
    check_units(setting, [*listed[len(shapes) :], *further])
    arguments = ", ".join([*shapes, "loc", "scale"])
    try:
        with np.errstate(all="ignore"):
            frozen = DISTRIBUTIONS[kind](*numbers, **named)
            spread = frozen.std()
    except (TypeError, ValueError, ArithmeticError):
        spread = np.nan
    if np.isnan(spread) or spread == 0:
        raise InputError(f"{message}; {kind}({arguments}), as in scipy.stats")
    return frozen


def correlation(text: str, names: list[str]) -> tuple[int, int, float]:
    """Numbers and Spearman's rank correlation of two names from 'mu,adhesion=-0.5'.

    Raises InputError.
    """
    listed, _, number = text.partition("=")
    pair = [name.strip() for name in listed.split(",")]
    try:
        value = float(number)
    except ValueError:
        value = np.nan
    if len(set(pair)) != 2 or not set(pair) <= set(names) or not -1 < value < 1:
        raise InputError(
            f"--correlate {text}: must be A,B=R, two of the sampled names ({', '.join(names)}) and "
            "their rank correlation between -1 and 1"
        )
    return names.index(pair[0]), names.index(pair[1]), value


def draw(
    number: int, distributions: dict[str, str], design: str, seed: int, correlations: list[str]
) -> dict[str, Array]:
    """Draw `number` values of each name from distributions as texts.

    correlations: 'A,B=R' each; design: latin (hypercube: McKay, Beckman, Conover 1979),
    monte-carlo or sobol, see `sobol_design`. Raises InputError.
    """
    frozen = [distribution(name, text) for name, text in distributions.items()]
    pairs = [correlation(text, list(distributions)) for text in correlations]
    generator = np.random.default_rng(seed)
    if design == "latin":
        shares = stats.qmc.LatinHypercube(len(frozen), seed=generator).random(number)
    elif design == "sobol":
        shares = sobol_design(number, len(frozen), seed)
    else:
        shares = generator.random((number, len(frozen)))
    if pairs:
        shares = correlated(shares, pairs)
    with np.errstate(all="ignore"):  # infinite values are refused later
        return {name: frozen[i].ppf(shares[:, i]) for i, name in enumerate(distributions)}


def sobol_design(number: int, inputs: int, seed: int) -> Array:
    """Uniform numbers (number (inputs + 2), inputs) for Sobol's indices [Saltelli et al. 2010]: two
    samples A and B of a quasi-random sequence, and for each input A with that column of B.
    """
    both = stats.qmc.Sobol(2 * inputs, seed=seed).random(number)
    first, second = both[:, :inputs], both[:, inputs:]
    mixed = [np.where(np.arange(inputs) == column, second, first) for column in range(inputs)]
    return np.concatenate([first, second, *mixed])


def sobol_indices(outcome: Array, inputs: int) -> tuple[Array, Array, Array, Array]:
    """Sobol's indices of first order and total ones (inputs,), and half of the width of their
    intervals by bootstrap, of the outcomes of `sobol_design`; nan: the outcomes that are drawn
    again, few of which differ, may all be the same.
    """
    first, second, *mixed = np.split(outcome[None, :], inputs + 2, axis=1)
    blocks: dict[Literal["f_A", "f_B", "f_AB"], Array]
    blocks = {"f_A": first, "f_B": second, "f_AB": np.array(mixed)}
    with np.errstate(invalid="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", stats.DegenerateDataWarning)
        result = stats.sobol_indices(func=blocks, n=first.shape[1])
        again = result.bootstrap(confidence_level=CONFIDENCE)
    intervals = again.first_order.confidence_interval, again.total_order.confidence_interval
    widths = [np.ravel(interval.high - interval.low) / 2 for interval in intervals]
    return np.ravel(result.first_order), np.ravel(result.total_order), widths[0], widths[1]


def correlated(shares: Array, pairs: list[tuple[int, int, float]]) -> Array:
    """Reorder the columns of uniform numbers to the order of a Gaussian copula with given rank
    correlations (Iman and Conover 1982), which leaves the values, and a Latin hypercube, unchanged.

    The sample's own correlation is removed from its scores first, as in that paper, unless it has
    no more values than inputs. Then the correlations are corrected by half of the remaining error
    of the ranks, iteratively; the best order is returned. Raises InputError.
    """
    number, inputs = shares.shape
    wanted = rank_correlations(pairs, inputs)
    root = copula(wanted)
    scores, corrected = stats.norm.ppf(shares), wanted
    orders: list[tuple[float, IntArray]] = []
    if number > inputs:
        factor = linalg.cholesky(np.corrcoef(scores.T), lower=True)
        scores = linalg.solve_triangular(factor, stats.zscore(scores).T, lower=True).T
    for _ in range(MOST_ITERATIONS):
        ranks = (scores @ root.T).argsort(axis=0).argsort(axis=0)
        error = wanted - np.corrcoef(ranks.T) if number > inputs else np.zeros_like(wanted)
        orders.append((float(np.abs(error).max()), ranks))
        if orders[-1][0] < TOLERANCE:
            break
        corrected = corrected + error / 2
        try:
            root = copula(corrected)
        except linalg.LinAlgError:
            break
    _, ranks = min(orders, key=lambda order: order[0])
    return np.take_along_axis(np.sort(shares, axis=0), ranks, axis=0)


def rank_correlations(pairs: list[tuple[int, int, float]], inputs: int) -> Array:
    """The matrix of rank correlations of inputs, of which some pairs have one. Raises InputError if
    it is not that of any Gaussian copula.
    """
    ranks = np.eye(inputs)
    for i, j, rank in pairs:
        ranks[i, j] = ranks[j, i] = rank
    try:
        copula(ranks)
    except linalg.LinAlgError:
        raise InputError(
            "--correlate: must form a positive definite matrix of correlations"
        ) from None
    return ranks


def copula(ranks: Array) -> Array:
    """Cholesky's lower factor of the correlation of normal scores with given rank correlations.

    Raises LinAlgError.
    """
    return linalg.cholesky(2 * np.sin(np.pi * ranks / 6), lower=True)


def probability(failed: int, undecided: int, number: int) -> tuple[float, float, float]:
    """Share of failures among `number` rows and the limits of its interval (Clopper and Pearson
    1934).

    undecided: rows besides `failed` whose computation has not converged. The share counts them as
    failures, the lower limit does not. The interval is that of independent rows; the error of a
    Latin hypercube is smaller if the outcome is monotone in every input.
    """
    least, most = (
        stats.binomtest(k, number).proportion_ci(CONFIDENCE, "exact")
        for k in (failed, failed + undecided)
    )
    return (failed + undecided) / number, float(least.low), float(most.high)


def sensitivity(values: Array, outcome: Array) -> float:
    """Spearman's rank correlation of two columns; nan: one is constant, or less than three rows."""
    both = np.isfinite(values) & np.isfinite(outcome)
    if np.sum(both) < 3 or min(np.ptp(values[both]), np.ptp(outcome[both])) == 0:
        return np.nan
    return float(stats.spearmanr(values[both], outcome[both]).statistic)
