"""Cases: made, varied, announced."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from .. import InputError
from ..arrays import Value
from ..input.case import Case
from ..input.case_names import is_name
from ..input.resolve import load, varied, with_record
from ..python_words import in_python, speaks_python
from ..statics.notes import notes


@speaks_python
def case(
    source: Case | str | Path = "dam",
    *,
    levels: Sequence[float] | float | None = None,
    tail_levels: Sequence[float] | float | None = None,
    steps: int | None = None,
    accuracy: str | None = None,
    record: str | Path | None = None,
    name: str | None = None,
    **parameters: Value,
) -> Case:
    """A case of the package, of a case file, or a variation of another case.

    What is not given is that of the source. A case is a mapping of all parameters: `case["mu"]` or
    `case.mu` is a value, `"mu" in case`, `case.keys()`; printed, it shows what differs from the
    defaults. `case.law` is the joint law itself, `case["law"]` its name.

    Args:
        source: letter or name of a case of the package, path of a case file, or a case.
        levels: of the reservoir [m] at t = 1, 2, ...
        tail_levels: of the tailwater [m] at t = 1, 2, ..., or the same at all times.
        steps: equal load steps between two levels.
        accuracy: coarse, standard, fine or a percentage; mesh and steps are refined for it.
        record: file of the ground's acceleration, for `quake`: CSV, .AT2 of PEER or COSMOS; of two
            such files with the horizontal and the vertical component "H.AT2+V.AT2".
        name: of the case in tables and of its files, by default that of the source.
        parameters: by name, in SI units, as in reference/parameters.md, or as a text with a unit,
            "20*GPa".

    Raises:
        InputError: name, value, and what is allowed.

    Example:
        >>> dam = case("dam", levels=[30, 40], mu=0.8, n_joint=10)
        >>> dam["mu"], dam.levels
        (0.8, (30.0, 40.0))
        >>> dam
        dam: levels 30, 40 m; n_joint = 10
    """
    loading = as_list(levels), as_list(tail_levels), steps, accuracy
    if isinstance(source, Case):
        result = varied(source, parameters, *loading)
    elif isinstance(source, str | Path):
        result = load(str(source), parameters, *loading)
    else:
        kind = type(source).__name__
        raise InputError(f"case: must be a case, or its name or path; it is of type {kind}")
    if name is not None and not is_name(name):
        raise InputError(f"name = {name!r}: must be a text that can be the name of a file")
    if record is not None:
        result = with_record(result, record)
    return result if name is None else replace(result, name=name)


def as_case(source: Case | str | Path) -> Case:
    """A case as it is, or that of a name or path."""
    return source if isinstance(source, Case) else case(source)


def noted(case: Case, frames: int = 4) -> Case:
    """The case, after a warning for each note on it: settings without effect, loads in part, ...

    frames: from here to the user's call; a function that `speaks_python` is two.
    """
    warn(case, notes(case), frames)
    return case


def warn(case: Case, lines: Sequence[str], frames: int) -> None:
    """Give a warning for each note on a case; frames: from the caller to the user's call."""
    for line in lines:
        warnings.warn(f"{case.name}: {in_python(line)}", stacklevel=frames + 1)


def as_list(levels: Sequence[float] | float | None) -> list[float] | None:
    """Levels as a list, also of a single one."""
    return None if levels is None else np.atleast_1d(levels).tolist()


def on_fixed_mesh(chosen: Case) -> Case:
    """The case without its accuracy, on the mesh that this requires."""
    from ..studies.sweep import meshed

    return meshed(chosen)[0] if chosen.accuracy else chosen
