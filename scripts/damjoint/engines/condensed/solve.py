"""The interface of engines/__init__.py for the condensed engine."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import lru_cache, partial
from typing import TYPE_CHECKING

from ... import RunError
from ...csr import CsrMatrix
from ...fem.cache import condensed_bodies
from ...fem.condensed import Condensed
from ...fem.memory import joint_size
from ...input.case import Case
from ...joint.interface import Interface
from ...joint.linear_system import Stalled
from ...mesh.mesh import mesh_of
from ...model.network import with_paths
from ...model.results import Info
from ...solver.load_stepper import LoadStepper
from ...threads import limited_threads
from .. import OnStep, Outcome

if TYPE_CHECKING:  # takes as long to load as a whole 2D run
    from ...fem.bodies import Bodies
    from ...model.fields import Field

#: Number of jump unknowns from which on several threads of the linear algebra are faster than one.
THREADED_UNKNOWNS = 2000


def check(case: Case) -> None:
    """Raise InputError if a user's own geometry is unsuitable; all other cases are suitable."""
    if case.geometry:
        joints = mesh_of(case).joints
        with_paths(case.with_joints([joint.of_case for joint in joints]), joints)


def about(bulk: Condensed) -> Info:
    """Entries of run.json on the engine and its mesh."""
    return {
        "engine": "iterative" if isinstance(bulk.stiffness, CsrMatrix) else "condensed",
        "factorisation": bulk.factorisation,
        "mesh": bulk.counts,
        "unknowns": bulk.unknowns,
    }


def thread_number(case: Case) -> int | None:
    """Number of threads that solve a case fastest; None: all."""
    return 1 if case.geometry or joint_size(case) < THREADED_UNKNOWNS else None


def follow(
    case: Case, interface: Interface, on_step: Callable[[float], None]
) -> tuple[LoadStepper, BaseException | None]:
    """The loading of a scene to its end or to an error, also an interrupt: it saves its steps."""
    stepper = LoadStepper(case, interface, on_step)
    try:
        stepper.run()
    except BaseException as error:
        if stepper.history.complete(stepper.state):
            stepper.save_last()
        return stepper, error
    return stepper, None


def solve(case: Case, on_step: OnStep, _fields: bool, engine: str = "auto") -> Iterator[Outcome]:
    """The scenes of a case on one mesh; see engines/__init__.py.

    engine: see `engine_of`; where the iteration of auto stalls, the bodies are condensed.
    """
    with limited_threads(thread_number(case)):
        start = time.perf_counter()
        bulk, assembled = condensed_bodies(case, engine)
        before = bulk.seconds if assembled else {"cache": time.perf_counter() - start}
        interface = Interface(bulk, case["quadrature"], case["face_points"])
        steppers: list[LoadStepper] = []
        recovered: dict[int, dict[float, Field]] = {}

        @lru_cache
        def bodies() -> Bodies:
            from ...fem.bodies import Bodies

            return assembled or Bodies.of(case)

        def fields(number: int) -> dict[float, Field]:
            """Fields of a scene; recovers those of all scenes with a single factorisation."""
            if number not in recovered:
                from .recover import recover

                bulks = [s.model.equilibrium.bulk for s in steppers]
                numbers = [n for n, bulk in enumerate(bulks) if bulk is bulks[number]]
                scenes = [(steppers[n].model.equilibrium, steppers[n].history) for n in numbers]
                recovered.update(zip(numbers, recover(bodies(), scenes), strict=True))
            return recovered[number]

        for number, scene in enumerate(case.scenes()):
            begin = time.perf_counter()
            stepper, error = follow(scene, interface, partial(on_step, number))
            if engine == "auto" and isinstance(error, Stalled):
                with suppress(RunError):  # too little memory: the first error remains
                    interface = Interface(
                        condensed_bodies(case)[0], case["quadrature"], case["face_points"]
                    )
                    stepper, error = follow(scene, interface, partial(on_step, number))
            steppers.append(stepper)
            result = stepper.results()
            seconds = before | {"solve": time.perf_counter() - begin}
            result.info |= about(interface.bulk) | {"wall_seconds": seconds}
            yield Outcome(result, lambda: bodies().mesh, partial(fields, number), error)
