"""Safety checks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, overload

import numpy as np

from .. import InputError, runner
from ..input.case import Case
from ..model.results import Results
from ..python_words import speaks_python
from .cases import as_case, noted
from .tables import Tables, WithTables, by_column, displayed, records

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..studies.check import SafetyCheck


@dataclass(frozen=True, repr=False)
class Checks(WithTables, Sequence["SafetyCheck"]):
    """Safety checks, made by `check`: one for each case, uplift and joint.

    Of each check, `rows` are those of check.csv, `why` is the reason if it fails or is not judged,
    else empty, and `notes` are remarks on the result.

    Example:
        >>> usual = case("dam", levels=40, n_joint=10, required_SSF=1.5, name="usual")
        >>> checks = check([usual, case(usual, k_h=0.2, name="earthquake")])
        >>> [(one.case.name, one.rows[0]["verdict"]) for one in checks]
        [('usual', 'pass'), ('earthquake', 'fail')]
    """

    #: of each scene of each case, its results and the checks of its joints
    cases: Sequence[tuple[Results, list[SafetyCheck]]]

    @overload
    def __getitem__(self, number: int) -> SafetyCheck: ...

    @overload
    def __getitem__(self, number: slice) -> list[SafetyCheck]: ...

    def __getitem__(self, number: int | slice) -> SafetyCheck | list[SafetyCheck]:
        return [check for _, checks in self.cases for check in checks][number]

    def __len__(self) -> int:
        return sum(len(checks) for _, checks in self.cases)

    @property
    def by_name(self) -> Tables:
        """The table rows, that of check.csv: a row per case, joint and method, and one of the
        methods' difference.
        """
        from ..studies.check import CHECK

        return {"rows": (by_column([row for check in self for row in check.rows]), CHECK)}

    def plot(self, number: int = 0) -> Figure:
        """The picture of a case and uplift, by its number from 0, as `damjoint check` writes it.

        Raises InputError for a user's own geometry, which has none.
        """
        from ..pictures.check_picture import figure_of_check
        from ..studies.check_study import picture_content

        result, checks = self.cases[number]
        if result.case.geometry:
            raise InputError(
                f"case {result.case.name}: must be a section by parameters to be drawn"
            )
        return displayed(figure_of_check(picture_content(result, checks)))

    def loads(self, number: int = 0) -> np.recarray:
        """gravity.csv of a case and uplift, by its number from 0: loads of the gravity method on
        the body above each joint; without rows for a user's own geometry.
        """
        from ..studies.check_study import hand_calculations, loads_table

        return records(loads_table(hand_calculations(self.cases[number][0])))

    def __repr__(self) -> str:
        return "\n".join(map(repr, self))


@speaks_python
def check(cases: Case | str | Path | Sequence[Case | str | Path]) -> Checks:
    """Safety factors of a case or of several, by the finite elements and by the gravity method.

    Each is computed up to its last level. The result is a sequence of checks, see `Checks`.

    Args:
        cases: the load combinations, or a single one; cases, or their names or paths, see `case`.

    Raises:
        InputError: bad input.
        RunError: a case could not be computed.

    Example:
        >>> (base,) = check(case("dam", levels=40, n_joint=10, required_SSF=1.1))
        >>> [(row["answer"], row["verdict"]) for row in base.rows][:2]
        [('finite elements', 'pass'), ('gravity method', 'pass')]
    """
    from ..studies.check import compare_joints

    listed = [cases] if isinstance(cases, Case | str | Path) else cases
    combinations = [as_case(combination) for combination in listed]
    if not combinations:
        raise InputError("cases: must be at least one")
    for combination in combinations:
        noted(combination)
    outcomes = [outcome for one in combinations for outcome in runner.compute_scenes(one)]
    return Checks([(outcome.result, compare_joints(outcome.result)) for outcome in outcomes])
