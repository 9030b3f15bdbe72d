"""Fragility: the probability that an earthquake of an intensity exceeds a limit.

P(x) = Phi(ln(x / median) / dispersion), fitted by maximum likelihood to the rows of a sweep, each
of which exceeds the limit or not: a probit regression on ln x [Shinozuka et al. 2000; Baker 2015].
Rows of one record at several scales depend on each other: the covariance of the estimates is that
of the sums of their scores by record (the sandwich of Liang and Zeger 1986, with the factor
n / (n - 1) of few records), and their intervals are by Student's t with n - 1 degrees of freedom.
Rows of one record alone count as independent of each other, which is said.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy import optimize, stats

from .. import InputError
from ..arrays import Array, BoolArray, IntArray, Value
from ..post.summary import aligned
from ..post.tables import write_rows
from . import sampling
from .plan import FRAGILITY, MOTION, Plan, Row, beside, numbers
from .quake_summary import INTENSITIES
from .sweep import exceeds

#: Tolerance of the most likely probit and slope, relative [-].
TOLERANCE = 1e-10
#: Groups of rows whose shares are drawn.
GROUPS = 8


@dataclass(frozen=True)
class Fit:
    """The fragility of a limit."""

    #: what the limit means
    words: str
    #: (n,) intensity of the rows that are decided, and whether each exceeds the limit
    intensity: Array
    exceeds: BoolArray
    #: (n,) number of the record of each
    record: IntArray
    #: number of the rows that are not decided
    undecided: int

    @property
    def reason(self) -> str:
        """Why there is no curve; empty if there is one."""
        if self.exceeds.all() or not self.exceeds.any():
            return "no row exceeds it" if not self.exceeds.any() else "all rows exceed it"
        least, most = self.intensity[self.exceeds].min(), self.intensity[~self.exceeds].max()
        if least > most:
            return f"no row up to {most:.4g} exceeds it, all do from {least:.4g} on: no dispersion"
        if least == most:  # also then the likelihood grows without end as the dispersion vanishes
            return f"no row below {most:.4g} exceeds it, all do beyond: no dispersion"
        if self.slope <= 0:
            return "the share of the rows that exceed it does not grow with the intensity"
        return ""

    @property
    def _logs(self) -> Array:
        """(n, 2): one, and ln of the intensity over its geometric mean."""
        logs = np.log(self.intensity)
        return np.column_stack([np.ones(len(logs)), logs - logs.mean()])

    def _ratios(self, estimate: Array) -> tuple[Array, Array, Array]:
        """Sign of each row, 1 if it exceeds the limit; probit of what it does; density over
        probability there.
        """
        sign = np.where(self.exceeds, 1.0, -1.0)
        z = sign * (self._logs @ estimate)
        return sign, z, np.exp(stats.norm.logpdf(z) - stats.norm.logcdf(z))

    def scores(self, estimate: Array) -> Array:
        """(n, 2): derivative of each row's log-likelihood with the estimate (2,)."""
        sign, _, ratio = self._ratios(estimate)
        return np.asarray(self._logs * (sign * ratio)[:, None])

    def information(self, estimate: Array) -> Array:
        """(2, 2): minus the second derivative of the log-likelihood."""
        _, z, ratio = self._ratios(estimate)
        return np.asarray((self._logs * (ratio * (z + ratio))[:, None]).T @ self._logs)

    @cached_property
    def _estimate(self) -> Array:
        """(2,): the probit at the mean of ln x, and its slope with ln x, the most likely ones."""

        def slope(estimate: Array) -> Array:
            return np.asarray(self.scores(estimate).mean(axis=0))

        def bend(estimate: Array) -> Array:
            return -self.information(estimate) / len(self.exceeds)

        first = np.array([stats.norm.ppf(self.exceeds.mean()), 0.0])
        return np.asarray(optimize.root(slope, first, jac=bend, tol=TOLERANCE).x)

    @property
    def slope(self) -> float:
        """Of the probit with ln x [-]."""
        return float(self._estimate[1])

    @property
    def median(self) -> float:
        """Intensity at which the limit is exceeded by half."""
        return float(np.exp(np.log(self.intensity).mean() - self._estimate[0] / self.slope))

    @property
    def dispersion(self) -> float:
        """Standard deviation of ln of the intensity at which the limit is exceeded [-]."""
        return 1 / self.slope

    @property
    def records(self) -> int:
        """The number of records."""
        return len(np.unique(self.record))

    @cached_property
    def covariance(self) -> Array:
        """(2, 2) of the estimate: by record, or of independent rows if there is one."""
        inverse = np.linalg.inv(self.information(self._estimate))
        number = self.records
        if number == 1:
            return np.asarray(inverse)
        scores = self.scores(self._estimate)
        sums = [scores[self.record == k].sum(axis=0) for k in np.unique(self.record)]
        middle = number / (number - 1) * sum(np.outer(s, s) for s in sums)
        return np.asarray(inverse @ middle @ inverse)

    @property
    def quantile(self) -> float:
        """Half width of an interval in standard errors."""
        tail = (1 - sampling.CONFIDENCE) / 2
        most = self.records - 1
        return float(stats.t.isf(tail, most) if most else stats.norm.isf(tail))

    def probability(self, intensity: Array) -> tuple[Array, Array, Array]:
        """The probability (m,) at intensities (m,), and the limits of its interval."""
        shift = np.log(intensity) - np.log(self.intensity).mean()
        logs = np.column_stack([np.ones(len(shift)), shift])
        middle = logs @ self._estimate
        width = self.quantile * np.sqrt(np.einsum("ij,jk,ik->i", logs, self.covariance, logs))
        low, share, high = (stats.norm.cdf(middle + side * width) for side in (-1, 0, 1))
        return share, low, high

    def median_interval(self) -> tuple[float, float]:
        """The intensities at which the interval of the curve has the probability of a half (Fieller
        1954); 0 and infinity where it has not.
        """
        a, b = self._estimate
        v, q = self.covariance, self.quantile**2
        # (a + b s)^2 = q (v00 + 2 s v01 + s^2 v11)
        roots = np.roots([b * b - q * v[1, 1], 2 * (a * b - q * v[0, 1]), a * a - q * v[0, 0]])
        if b * b <= q * v[1, 1] or np.iscomplex(roots).any():
            return 0.0, math.inf
        low, high = np.exp(np.sort(roots.real) + np.log(self.intensity).mean())
        return float(low), float(high)

    def shares(self) -> list[tuple[float, float, float, float]]:
        """Geometric mean of the intensity, share, and limits of its interval as if its rows were
        independent, of up to GROUPS groups of rows by their intensity.
        """
        order = np.argsort(self.intensity, kind="stable")
        parts = np.array_split(order, min(GROUPS, max(len(order) // 3, 1)))
        different = np.unique(self.intensity)
        if len(different) <= GROUPS:
            parts = [np.flatnonzero(self.intensity == value) for value in different]
        result = []
        for part in parts:
            x = float(np.exp(np.log(self.intensity[part]).mean()))
            result.append((x, *sampling.probability(int(self.exceeds[part].sum()), 0, len(part))))
        return result

    def row(self) -> dict[str, Value]:
        """The row of the table."""
        fitted = not self.reason
        low, high = self.median_interval() if fitted else ("", "")
        return {
            "limit": self.words,
            "rows": len(self.exceeds),
            "records": self.records,
            "exceed": int(self.exceeds.sum()),
            "undecided": self.undecided,
            "median": self.median if fitted else "",
            "median_low": low,
            "median_high": high,
            "dispersion": self.dispersion if fitted else "",
            "reason": self.reason,
        }


def fits(plan: Plan, rows: Sequence[Row], intensity: str) -> list[Fit]:
    """The fragility of each limit of a plan of earthquakes; intensity: a column of its rows.

    Raises InputError.
    """
    if intensity not in INTENSITIES:
        raise InputError(f"intensity = {intensity}: must be one of {', '.join(INTENSITIES)}")
    assert plan.quake
    values = numbers(list(rows), intensity)
    names = [row.get(MOTION, "") for row in rows]
    record = np.array([names.index(name) for name in names])
    result = []
    for (kind, limit), words in zip(plan.quake.listed, plan.quake.words(), strict=True):
        answers = [exceeds(row, row["verdict"], kind, limit) for row in rows]
        decided = np.array([answer is not None for answer in answers]) & np.isfinite(values)
        if decided.any():
            exceeded = np.array([bool(answer) for answer in answers])[decided]
            undecided = int((~decided).sum())
            result.append(Fit(words, values[decided], exceeded, record[decided], undecided))
    return result


def report(curves: Sequence[Fit], out: Path, intensity: str) -> str:
    """The fragility of limits as text; writes OUT_fragility.csv."""
    if not curves:
        return "no row is decided: no fragility"
    table, unit = [curve.row() for curve in curves], INTENSITIES[intensity]
    write_rows(beside(out, FRAGILITY[0]), [{"intensity": intensity, **row} for row in table])
    cells = []
    for row, curve in zip(table, curves, strict=True):
        low, high = row["median_low"], row["median_high"]
        interval = f"{row['median']:.4g} ({low:.4g} to {high:.4g})" if low != "" else "-"
        cells.append(
            {
                **{name: row[name] for name in ("limit", "rows", "exceed", "undecided")},
                f"median [{unit}]": interval,
                "dispersion": f"{curve.dispersion:.3g}" if low != "" else "-",
            }
        )
    records = curves[0].records
    how = (
        f"{sampling.CONFIDENCE:.0%} interval, from the scatter between {records} records"
        if records > 1
        else f"{sampling.CONFIDENCE:.0%} interval of independent rows: rows of one record are not"
    )
    heads = [name.replace(" [", "\n[") for name in cells[0]]
    lines = aligned([tuple(map(str, c.values())) for c in cells], heads, left=1, right=1)
    reasons = [f"{curve.words}: {curve.reason}" for curve in curves if curve.reason]
    return "\n".join([f"Fragility, lognormal in {intensity} ({how})", lines, *reasons])
