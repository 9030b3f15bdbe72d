"""How a scene is solved: two engines behind one small interface.

`check(case)` of engines/condensed/solve.py and of engines/getdp/solve.py raises InputError, and
`solve(case, on_step, fields)` gives, scene by scene, an Outcome (fields: whether the bodies' fields
will be asked for; raises RunError). They know nothing of output folders, and what uses them nothing
of their insides. memory.py tells both what a case needs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from types import ModuleType

from .. import InputError
from ..model.case import Case
from ..model.fields import Field
from ..model.mesh import Mesh
from ..model.results import Results

ENGINES = ("auto", "condensed", "getdp")

#: What is called with the number of a scene and the time of each of its converged steps.
OnStep = Callable[[int, float], None]


@dataclass
class Outcome:
    """A scene, solved as far as it went."""

    result: Results
    #: the mesh, made when it is asked for if the engine had no need of it
    mesh: Callable[[], Mesh]
    #: displacement and stress of the bodies by requested time
    fields: Callable[[], dict[float, Field]]
    #: what ended it before its time, to be raised once the result is saved
    error: BaseException | None = None


def engine_of(case: Case, name: str) -> ModuleType:
    """The engine of a name: condensed (auto), or getdp, the plain problem definition.

    Raises InputError if there is none, or if it can not run the case.
    """
    if name not in ENGINES:
        raise InputError(f"engine = {name}: must be one of {', '.join(ENGINES)}")
    found = import_module(f".{'condensed' if name == 'auto' else name}.solve", __name__)
    found.check(case)
    return found
