"""Critical values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Value
from ..input.case import Case
from ..input.resolve import varied
from ..python_words import all_in_python, speaks_python
from .cases import as_case, as_list, noted, on_fixed_mesh
from .tables import Tables, WithTables, displayed, records, tables_of_run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..studies.critical import Search
    from ..studies.critical_value import CriticalValue


@dataclass(frozen=True, repr=False)
class Critical(WithTables):
    """A critical value, made by `critical`.

    Example:
        >>> limit = critical("dam", levels=40, n_joint=10, law="friction", adhesion=0.0)
        >>> round(limit.value, 1), limit.equilibria.dtype.names[:3]
        (46.1, ('trial', 'value', 'stands'))
    """

    answer: CriticalValue
    search: Search

    @property
    def value(self) -> float | None:
        """The largest load or smallest strength with an equilibrium; None if there is no limit."""
        return None if self.answer.value is None else float(self.answer.value)

    @property
    def mode(self) -> str:
        """How the dam fails beyond it: sliding, overturning, ..."""
        return self.answer.mode

    @property
    def confirmed(self) -> bool:
        """Whether a mechanism or statics confirms it."""
        return self.answer.confirmed

    @property
    def statement(self) -> list[str]:
        """The lines that `damjoint critical` prints."""
        from ..studies.critical_study import printed_lines

        return all_in_python(printed_lines(self.answer, self.search))

    @property
    def equilibria(self) -> np.recarray:
        """critical.csv: a row per equilibrium of each trial."""
        return records(self.named("equilibria")[0])

    def plot(self) -> Figure:
        """The picture of the search, as `damjoint critical` writes it."""
        from ..studies.critical_picture import figure_of
        from ..studies.critical_study import content

        return displayed(figure_of(content(self.search, self.answer)))

    @property
    def by_name(self) -> Tables:
        """The table equilibria; history and joint, up to the last equilibrium, if there is one."""
        from ..studies.critical import last_state
        from ..studies.critical_study import table
        from ..studies.failure_path import critical_columns

        columns = critical_columns(self.search.case) | {"value": (self.search.unit.strip(), "")}
        point = self.answer.point
        of_run = tables_of_run(last_state(self.search, point)) if point else {}
        return {"equilibria": (table(self.search), columns), **of_run}

    def __repr__(self) -> str:
        return "\n".join(self.statement)


@speaks_python
def critical(
    source: Case | str | Path = "dam",
    of: str = "level",
    *,
    levels: Sequence[float] | float | None = None,
    tail_levels: Sequence[float] | float | None = None,
    **parameters: Value,
) -> Critical:
    """The level, strength, uplift or parameter beyond which there is no equilibrium.

    Args:
        source: a case, or its name or path, see `case`. If it has an accuracy, the mesh is that
            which its levels require.
        of: level [m], strength (the factor that divides mu, adhesion, sigma_max and the fracture
            energies), uplift (effectiveness of the drains) or the name of a parameter.
        levels, tail_levels, parameters: changes of the case, see `case`.

    Raises:
        InputError: bad input, or a case in which there is nothing to vary.
        RunError: the case could not be computed.

    Example:
        >>> dry = case("dam", levels=40, n_joint=10, law="friction", adhesion=0.0)
        >>> limit = critical(dry)
        >>> limit.mode, limit.confirmed
        ('sliding', True)
    """
    from ..studies.critical import Search

    changed = varied(as_case(source), parameters, as_list(levels), as_list(tail_levels))
    search = Search(on_fixed_mesh(noted(changed)), of)
    answer = search.run()
    if answer.error:
        raise answer.error
    return Critical(answer, search)
