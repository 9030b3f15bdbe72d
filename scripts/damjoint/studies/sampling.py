"""Uncertain parameters: samples of scipy's distributions, probability of failure, sensitivities."""

from __future__ import annotations

import numpy as np
from scipy import linalg, stats

from .. import InputError
from ..model.arithmetic import call_of

#: Distributions by scipy's names, and the name by which everyone knows one of them.
LAWS = {name: law for name, law in vars(stats).items() if isinstance(law, stats.rv_continuous)}
LAWS["normal"] = stats.norm
#: Those without closed forms, of test statistics: a number of theirs takes minutes.
for slow in ("ksone", "kstwo", "levy_stable", "studentized_range"):
    del LAWS[slow]

#: Of the intervals of a probability.
CONFIDENCE = 0.95

#: How often the order of a correlated sample is improved at most, and the error in its rank
#: correlations that needs no more.
ROUNDS, CLOSE = 30, 1e-4


def law_of(name: str, text: str) -> stats.rv_continuous:
    """The distribution of 'normal(1.0, 0.15)': a name of scipy.stats with its shapes, loc, scale.

    Raises InputError.
    """
    said = f"--sample {name}={text}: must be a distribution of scipy.stats with numbers"
    try:
        kind, numbers, named = call_of(text)
    except ValueError:
        raise InputError(f"{said}, such as normal(1.0,0.15) or uniform(0.5,scale=0.3)") from None
    if kind not in LAWS:
        known = "normal, lognorm, truncnorm, uniform, triang, weibull_min, gumbel_r, beta, ..."
        raise InputError(f"{said}; {kind} is none; known: {known}")
    shapes = ", ".join((*filter(None, [LAWS[kind].shapes]), "loc", "scale"))
    try:
        with np.errstate(all="ignore"):
            law = LAWS[kind](*numbers, **named)
            spread = law.std()
    except (TypeError, ValueError, ArithmeticError):
        spread = np.nan
    if np.isnan(spread) or spread == 0:
        raise InputError(f"{said}; {kind}({shapes}), as scipy.stats has them")
    return law


def correlation(text: str, names: list[str]) -> tuple[int, int, float]:
    """Places and Spearman's rank correlation of two names from 'mu,adhesion=-0.5'.

    Raises InputError.
    """
    pair, _, number = text.partition("=")
    found = [name.strip() for name in pair.split(",")]
    try:
        value = float(number)
    except ValueError:
        value = np.nan
    if len(set(found)) != 2 or not set(found) <= set(names) or not -1 < value < 1:
        raise InputError(
            f"--correlate {text}: must be A,B=R, two of the sampled names ({', '.join(names)}) and "
            "their rank correlation between -1 and 1"
        )
    return names.index(found[0]), names.index(found[1]), value


def draw(
    number: int, laws: dict[str, str], design: str, seed: int, correlations: list[str]
) -> dict[str, np.ndarray]:
    """`number` values of each name, whose distributions are texts; correlations: 'A,B=R' each;
    design: latin (hypercube: McKay, Beckman, Conover 1979) or monte-carlo, plain.

    Raises InputError.
    """
    frozen = {name: law_of(name, text) for name, text in laws.items()}
    known = [correlation(text, list(laws)) for text in correlations]
    generator = np.random.default_rng(seed)
    if design == "latin":
        shares = stats.qmc.LatinHypercube(len(laws), seed=generator).random(number)
    else:
        shares = generator.random((number, len(laws)))
    if known:
        shares = correlated(shares, known)
    with np.errstate(all="ignore"):  # an infinite value is refused where it is used
        return {name: law.ppf(shares[:, i]) for i, (name, law) in enumerate(frozen.items())}


def correlated(shares: np.ndarray, pairs: list[tuple[int, int, float]]) -> np.ndarray:
    """The columns of uniform shares put into another order, that of a Gaussian copula with given
    rank correlations (Iman and Conover 1982): the values, and a Latin hypercube, stay as they are.

    The sample's own correlation is taken out of its scores first, as there. By half of what the
    ranks then still miss the correlations are corrected, and the best order is kept. A sample of no
    more values than inputs has no correlation that could be taken out. Raises InputError.
    """
    number, inputs = shares.shape
    wanted = np.eye(inputs)
    for i, j, rank in pairs:
        wanted[i, j] = wanted[j, i] = rank
    try:
        root = copula(wanted)
    except linalg.LinAlgError:
        raise InputError("--correlate: must be correlations that can hold together") from None
    scores, asked, found = stats.norm.ppf(shares), wanted, []
    if number > inputs:
        own = linalg.cholesky(np.corrcoef(scores.T), lower=True)
        scores = linalg.solve_triangular(own, stats.zscore(scores).T, lower=True).T
    for _ in range(ROUNDS):
        ranks = (scores @ root.T).argsort(axis=0).argsort(axis=0)
        missing = wanted - np.corrcoef(ranks.T) if number > inputs else np.zeros_like(wanted)
        found.append((np.abs(missing).max(), ranks))
        if found[-1][0] < CLOSE:
            break
        asked = asked + missing / 2
        try:
            root = copula(asked)
        except linalg.LinAlgError:
            break
    _, ranks = min(found, key=lambda one: one[0])
    return np.take_along_axis(np.sort(shares, axis=0), ranks, axis=0)


def copula(ranks: np.ndarray) -> np.ndarray:
    """Cholesky's lower factor of the correlation of normal scores with given rank correlations.

    Raises LinAlgError.
    """
    return linalg.cholesky(2 * np.sin(np.pi * ranks / 6), lower=True)


def probability(failed: int, undecided: int, number: int) -> tuple[float, float, float]:
    """Share of failures among `number` rows and its interval (Clopper and Pearson 1934).

    undecided: rows whose computation has not come to an end, besides `failed`. The share counts
    them as failures, the lower limit does not. Binomial: that of a Latin hypercube errs less where
    the outcome is monotone in every input.
    """
    least, most = (
        stats.binomtest(k, number).proportion_ci(CONFIDENCE, "exact")
        for k in (failed, failed + undecided)
    )
    return (failed + undecided) / number, float(least.low), float(most.high)


def sensitivity(values: np.ndarray, outcome: np.ndarray) -> float:
    """Spearman's rank correlation of an input with an outcome; nan where one of them is constant
    or less than three rows have it.
    """
    here = np.isfinite(values) & np.isfinite(outcome)
    if np.sum(here) < 3 or min(np.ptp(values[here]), np.ptp(outcome[here])) == 0:
        return np.nan
    return float(stats.spearmanr(values[here], outcome[here]).statistic)
