"""Tables of results: record arrays, data frames and data sets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from .. import ROUND_OFF, InputError
from ..arrays import Array, Value
from ..model.results import Columns, Results, history_columns, joint_columns

if TYPE_CHECKING:  # loaded when they are used, with what they draw with
    import pandas
    from matplotlib.figure import Figure


class JointTable(np.recarray):
    """Rows of joint.csv as a record array: a column by its name, and by some names in full.

    Signs: opening, tension and the downstream direction are positive.

    Example:
        >>> rows = run(case("dam", levels=[30, 40], n_joint=10)).joint.at(level=40)
        >>> len(rows), bool(rows.normal_stress.max() < 0)
        (21, True)
    """

    @property
    def opening(self) -> Array:
        """Opening [m]: `delta_n`, or 0 where the joint is compressed."""
        return np.asarray(np.maximum(self["delta_n"], 0.0))

    @property
    def tangential_jump(self) -> Array:
        """Displacement of the dam along x relative to the foundation [m]: `delta_t1`."""
        return np.asarray(self["delta_t1"])

    @property
    def normal_stress(self) -> Array:
        """Effective normal stress [Pa]: `sigma_n_eff`."""
        return np.asarray(self["sigma_n_eff"])

    @property
    def shear_stress(self) -> Array:
        """Shear stress along x [Pa]: `tau_1`."""
        return np.asarray(self["tau_1"])

    @property
    def pressure(self) -> Array:
        """Water pressure in the joint [Pa]: `p`."""
        return np.asarray(self["p"])

    @property
    def distance(self) -> Array:
        """Distance from the heel along the joint [m]: `s`."""
        return np.asarray(self["s"])

    def at(self, *, level: float | None = None, time: float | None = None) -> JointTable:
        """The rows of a requested level [m] (the last time it was reached) or time, from heel to
        toe. Raises InputError if there is no such table.
        """
        column, value = ("level", level) if time is None else ("time", time)
        if value is None or (level is None) == (time is None):
            raise InputError("at: must have a level or a time, not both")
        if not len(self):
            raise InputError(f"{column} = {value:g}: the table has no rows")
        near = np.isclose(self[column], value, rtol=ROUND_OFF, atol=ROUND_OFF)
        if not near.any():
            known = ", ".join(f"{v:g}" for v in dict.fromkeys(self[column].tolist()))
            raise InputError(f"{column} = {value:g}: must be one of {known}")
        rows: JointTable = self[self["time"] == self["time"][near].max()]
        return rows


#: Tables by name: values by column; unit and meaning of columns.
Tables: TypeAlias = Mapping[str, tuple[Mapping[str, Any], Columns]]


class WithTables:
    """A result with tables; the first one is that of `units` and, by default, of `to_pandas`."""

    @property
    def by_name(self) -> Tables:
        """Each table."""
        raise NotImplementedError

    def named(self, name: str) -> tuple[Mapping[str, Any], Columns]:
        """A table by its name. Raises InputError if there is none."""
        if name not in self.by_name:
            raise InputError(f"table = {name}: must be one of {', '.join(self.by_name)}")
        return self.by_name[name]

    @property
    def rows(self) -> np.recarray:
        """The first table as a record array."""
        return records(next(iter(self.by_name.values()))[0])

    @property
    def units(self) -> dict[str, str]:
        """Units of the columns."""
        table, columns = next(iter(self.by_name.values()))
        return {name: columns[name][0] for name in table if name in columns}

    def to_pandas(self, table: str = "") -> pandas.DataFrame:
        """A table, by default the first one, as a DataFrame with units in its `attrs`.

        Raises ImportError without pandas, InputError if there is no table of this name.
        """
        values, columns = self.named(table or next(iter(self.by_name)))
        data_frame = optional("pandas").DataFrame(dict(values))
        data_frame.attrs["units"] = {n: columns[n][0] for n in values if n in columns}
        return data_frame


def tables_of_run(results: Results) -> Tables:
    """The tables joint and history of a run."""
    return {
        "joint": (results.joint, joint_columns(results.case)),
        "history": (results.history, history_columns(results.case)),
    }


def records(table: Mapping[str, Any]) -> np.recarray:
    """A table as a record array."""
    arrays = {name: np.asarray(column) for name, column in table.items()}
    return np.rec.fromarrays(arrays.values(), dtype=[(n, a.dtype) for n, a in arrays.items()])


def by_column(rows: Sequence[Mapping[str, Value]]) -> dict[str, list[Value]]:
    """Rows of the same columns as {column: values}."""
    return {name: [row[name] for row in rows] for name in rows[0]}


def displayed(figure: Figure) -> Figure:
    """A figure with its ticks, after the backend is loaded by which a notebook shows it."""
    from matplotlib import pyplot

    from ..pictures.drawing import picture_style

    pyplot.draw_if_interactive()
    with picture_style():
        figure.draw_without_rendering()
    return figure


def attributes(column: tuple[str, str]) -> dict[str, str]:
    """Unit and meaning of a column as attributes of a variable of xarray."""
    unit, meaning = column
    return {"units": unit, "long_name": meaning}


def optional(package: str) -> ModuleType:
    """A package that damjoint does not require. Raises ImportError if it is not installed."""
    try:
        return import_module(package)
    except ImportError:
        raise ImportError(f"{package} is not installed: pip install {package}") from None
