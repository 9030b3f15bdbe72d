"""The engines that solve a case, with the same interface.

`check(case)` of engines/condensed/solve.py and of engines/getdp/solve.py raises InputError;
`solve(case, on_step, fields)` yields an Outcome for each scene (fields: whether the fields of the
bodies are needed) and raises RunError. Engines write no output folders.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

from .. import InputError
from ..input.case import Case
from ..mesh.mesh import Mesh
from ..model.results import Results

if TYPE_CHECKING:
    from ..model.fields import Field

ENGINES = ("auto", "condensed", "iterative", "getdp")

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


#: The function `solve` of an engine.
Engine = Callable[[Case, OnStep, bool], Iterator[Outcome]]


def check_engine(case: Case, name: str = "auto", allowed: Sequence[str] = ENGINES) -> ModuleType:
    """The module of the engine of a name.

    Raises InputError if there is none, or if it can not run the case.
    """
    if name not in allowed:
        raise InputError(f"engine = {name}: must be one of {', '.join(allowed)}")
    if name == "iterative" and case["dim"] == 2:
        raise InputError("engine = iterative: must be auto, condensed or getdp with dim = 2")
    package = "getdp" if name == "getdp" else "condensed"
    module = import_module(f".{package}.solve", __name__)
    module.check(case)
    return module


def engine_of(case: Case, name: str) -> Engine:
    """The engine of a name: condensed; iterative, the same with its bodies uncondensed, in 3D;
    auto, the one of these that suits the size of the case; or getdp, the reference GetDP model.

    Raises InputError, see `check_engine`.
    """
    module = check_engine(case, name)
    return module.solve if name == "getdp" else partial(module.solve, engine=name)
