"""How a scene is solved: two engines behind one small interface.

`solve(case, on_step, fields)` of engines/condensed/solve.py and of engines/getdp/solve.py give,
scene by scene, an Outcome; they know nothing of output folders, and what uses them nothing of their
insides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module

from .. import InputError
from ..results.fields import Field
from ..results.tables import Results
from ..scene.case import Case
from ..scene.mesh import Mesh

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


def solve(case: Case, engine: str, on_step: OnStep, fields: bool) -> Iterator[Outcome]:
    """The scenes of a case, one after the other; fields: whether the bodies' fields will be asked
    for.

    engine: condensed (auto), or getdp, the plain problem definition. Raises InputError, RunError.
    """
    if engine not in ENGINES:
        raise InputError(f"engine = {engine}: must be one of {', '.join(ENGINES)}")
    name = "condensed" if engine == "auto" else engine
    yield from import_module(f".{name}.solve", __name__).solve(case, on_step, fields)
