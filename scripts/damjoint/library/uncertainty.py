"""What uncertain parameters amount to: reliability, calibration, derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .. import RunError
from ..arrays import Value
from ..input.case import Case
from ..python_words import speaks_python
from .cases import as_case, noted, on_fixed_mesh
from .tables import Tables, WithTables, by_column, records

if TYPE_CHECKING:
    from ..studies.calibrate import Calibration
    from ..studies.reliability import CriticalLevels
    from ..studies.reliability import Reliability as OfJoint


@dataclass(frozen=True, repr=False)
class Reliability(WithTables):
    """The probability that the water rises beyond the critical level, made by `reliability`.

    Example:
        >>> dry = case("dam", levels=[30, 36], n_joint=10, order=1, law="friction", adhesion=0.0)
        >>> likely = {"mu": "lognorm(0.12,scale=0.74)", "level": "gumbel_r(38.5,0.6)"}
        >>> result = reliability(dry, **likely, samples=20, jobs=1)
        >>> round(result.beta, 2), result.words
        (2.71, ['FORM agrees with the samples'])
        >>> critical(result.design_case).mode
        'sliding'
    """

    #: of each of several joints if no other could fail, then that of all
    results: Sequence[OfJoint]
    levels: CriticalLevels
    #: of each critical level the cells of reliability.csv
    level_rows: Sequence[Mapping[str, Value]] = ()

    @property
    def case(self) -> Case:
        """The case with the values that are not uncertain."""
        return self.levels.case

    @property
    def beta(self) -> float:
        """Reliability index by FORM [-]."""
        return self.results[-1].beta

    @property
    def design(self) -> Mapping[str, float]:
        """The design point: the most probable values with which the dam fails, by name."""
        return self.results[-1].design

    @property
    def importance(self) -> Mapping[str, float]:
        """Importance factors by name; their sum is 1."""
        return self.results[-1].importance

    @property
    def design_case(self) -> Case:
        """The case of the design point, filled to its level."""
        from ..studies.reliability import design_case

        return design_case(self.levels, self.results[-1])

    @property
    def words(self) -> list[str]:
        """Whether the methods agree, of each row."""
        return [one.words() for one in self.results]

    @property
    def by_name(self) -> Tables:
        """The table rows, one per joint if no other could fail, and one of all: joint (empty: all),
        beta, probabilities form, breitung, tvedt (SORM), sampled with the limits low, high of its
        95 % interval; nan where a method has none. The table levels, one row per critical level as
        in reliability.csv: of_joint, the varied values, critical_level [m], mode, joint, confirmed,
        confirmed_by, its derivatives `d_NAME`; nan where it has none.
        """
        names = "joint", "beta", "form", "breitung", "tvedt", "sampled", "low", "high"
        cells = {n: [getattr(one, n) for one in self.results] for n in names}
        table = {n: np.array([np.nan if v is None else v for v in cells[n]]) for n in names}
        texts, units = ("of_joint", "mode", "joint", "confirmed_by"), {"critical_level": ("m", "")}
        levels = {
            name: [np.nan if v == "" and name not in texts else v for v in column]
            for name, column in (by_column(self.level_rows) if self.level_rows else {}).items()
        }
        return {"rows": (table, dict.fromkeys(names[1:], ("-", ""))), "levels": (levels, units)}

    def __repr__(self) -> str:
        whole = self.results[-1]
        share = whole.sampled if whole.samples else whole.form
        return f"{self.case.name}: probability of failure {share:.3g}, beta by FORM {self.beta:.4g}"


@speaks_python
def reliability(
    source: Case | str | Path = "dam",
    *,
    correlate: Sequence[str] = (),
    tie: Mapping[str, str] | None = None,
    samples: int = 500,
    seed: int = 0,
    jobs: int | None = None,
    **distributions: str,
) -> Reliability:
    """The probability that the water rises beyond the critical level, by FORM, SORM and importance
    sampling; needs openturns. Nothing is written.

    Args:
        source: a case, or its name or path, see `case`; its last level counts unless `level` is
            uncertain.
        correlate: rank correlations, "A,B=R" each.
        tie: parameters computed from the others, such as `{"adhesion": "2e5*mu"}`.
        samples: critical levels of the importance sampling; 0: none.
        seed: of the random numbers.
        jobs: number of processes (default: one per core).
        distributions: of scipy.stats by parameter, as texts, "normal(0.8,0.1)"; `level` [m]; of one
            joint by `**{"lift 25 m.mu": "normal(0.7,0.1)"}`.

    Raises:
        InputError: bad input, a value that a parameter does not allow, or no openturns.
        RunError: a process was killed.

    Example:
        >>> dry = case("dam", levels=[30, 36], n_joint=10, order=1, law="friction", adhesion=0.0)
        >>> result = reliability(dry, mu="normal(0.8,0.06)", level="normal(38,1)", samples=0)
        >>> result.rows.joint.tolist(), sorted(result.importance)
        ([''], ['level', 'mu'])
    """
    from ..processes import check_jobs
    from ..studies.reliability import CriticalLevels, Variables, analysed, level_row

    check_jobs(jobs)
    variables, rows = Variables(distributions, correlate, tie or {}), list[Mapping[str, Value]]()
    levels = CriticalLevels(on_fixed_mesh(noted(as_case(source))), variables, jobs)
    levels.on_row = lambda _, *row: rows.append(level_row(variables, *row))
    return Reliability(list(analysed(levels, samples, seed, lambda message: None)), levels, rows)


@speaks_python
def calibrate(
    source: Case | str | Path,
    measured: str | Path,
    free: Sequence[str],
    *,
    jobs: int | None = None,
    progress: bool = False,
) -> Calibration:
    """Find the values of parameters with which a case computes what was measured.

    Nothing is written. The result has `estimates`, `intervals` of 95 % (parameters, 2),
    `correlation`, `residuals` over the standard deviations (series, readings), `undetermined` and
    `findings`, what the residuals show against the model; `case` is the calibrated one.

    Args:
        source: a case, or its name or path, see `case`.
        measured: CSV with a row per reading: level [m], if wanted tail_level and date, and of each
            instrument a column of history.csv, or head_S, the piezometric head [m] S m from the
            heel, with its standard deviations in NAME_sd; SI units.
        free: parameters, each as "K_N", of one joint "base.K_N", with limits "K_N=1e9:1e12" or
            with a prior "mu=normal(0.8,0.1)"; they start at the values of the case.
        jobs: number of processes (default: one per core).
        progress: show a bar, or where there is no terminal a line every ten seconds.

    Raises:
        InputError: bad input.
        RunError: the dam has no equilibrium at a reading with the start values.

    Example:
        >>> from tempfile import NamedTemporaryFile
        >>> file = NamedTemporaryFile("w", suffix=".csv")
        >>> file.write("level,head_14,head_14_sd\\n20,9,0.5\\n30,13,0.5\\n").__class__
        <class 'int'>
        >>> file.flush()
        >>> dam = case("dam", n_joint=10, uplift="drained", drain_x=14)
        >>> calibrate(dam, file.name, ["drain_effectiveness"], jobs=1).free[0].name
        'drain_effectiveness'
    """
    from ..studies.calibrate import free_of
    from ..studies.calibrate_study import compute
    from ..studies.measurements import read

    chosen = on_fixed_mesh(noted(as_case(source)))
    measurements = read(Path(measured), chosen)
    names = [free] if isinstance(free, str) else list(free)
    return compute(chosen, free_of(chosen, names), measurements, jobs, progress)


@speaks_python
def sensitivity(
    source: Case | str | Path,
    *names: str,
    critical: bool = False,
    vary: Mapping[str, str] | None = None,
) -> np.recarray:
    """Derivatives with parameters, by direct differentiation of the steps; nothing is written.

    A row per parameter and level: parameter, unit, value, level [m], kink (1: they are one-sided),
    and the derivatives, in SI units per unit of the parameter, of columns of history.csv or of
    critical_level.

    Args:
        source: a case, or its name or path, see `case`.
        names: parameters, or one of a joint, "lift 25 m.mu"; none: all that have an effect, but
            those of the geometry, whose derivatives are differences of two runs (of_runs: 1).
        critical: of the critical level instead of the results of a run.
        vary: distributions by parameter, as texts, see `reliability`; their standard deviations
            are the column `deviation` (nan without one).

    Raises:
        InputError: a parameter that has no derivative, or a distribution of another one.
        RunError: a state after unstable crack growth, or no critical level.

    Example:
        >>> dry = case("dam", levels=[30, 36], n_joint=10, order=1, law="friction", adhesion=0.0)
        >>> rates = sensitivity(dry, "mu", critical=True)
        >>> rates.parameter.tolist(), bool(rates.critical_level > 0)
        (['mu'], True)
    """
    from ..studies.critical import Search
    from ..studies.sensitivity import ALL, DEVIATION, deviations_of, names_of, of_point, of_run
    from ..studies.sensitivity import table as formatted_table

    chosen, deviations = on_fixed_mesh(noted(as_case(source))), deviations_of(vary or {})
    listed_names = names_of(chosen, ",".join(names) or ALL, not critical, deviations)
    if critical:
        answer = Search(replace(chosen, all_steps=True), "level").find()
        if answer.value is None or answer.point is None:
            raise RunError(f"no critical level: {answer.doubt}")
        rows = of_point(answer.point, listed_names)
    else:
        rows = of_run(chosen, listed_names)
    table = formatted_table(rows)
    if deviations:
        table[DEVIATION] = [deviations.get(row.name, np.nan) for row in rows]
    return records(table)
