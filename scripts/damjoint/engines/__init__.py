"""The two engines that solve a case, with the same interface.

`check(case)` of engines/condensed/solve.py and of engines/getdp/solve.py raises InputError;
`solve(case, on_step, fields)` yields an Outcome for each scene (fields: whether the fields of the
bodies are needed) and raises RunError. Engines write no output folders.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

from .. import InputError
from ..input.case import Case
from ..mesh.mesh import Mesh
from ..model.results import Results

if TYPE_CHECKING:
    from ..model.fields import Field

ENGINES = ("auto", "condensed", "getdp")

#: What is called with the number of a scene and the time of each of its converged steps.
OnStep = Callable[[int, float], None]


@dataclass
class Outcome:
    """The results of a scene, up to its end or to an error."""

    result: Results
    #: the mesh; made at the first call if the engine did not need it
    mesh: Callable[[], Mesh]
    #: displacement and stress of the bodies by requested time
    fields: Callable[[], dict[float, Field]]
    #: the error that ended it early, to be raised when the result is saved
    error: BaseException | None = None


def engine_of(case: Case, name: str) -> ModuleType:
    """The engine of a name: condensed (auto), or getdp, the reference GetDP model.

    Raises InputError if there is none, or if it can not run the case.
    """
    if name not in ENGINES:
        raise InputError(f"engine = {name}: must be one of {', '.join(ENGINES)}")
    engine = import_module(f".{'condensed' if name == 'auto' else name}.solve", __name__)
    engine.check(case)
    return engine
