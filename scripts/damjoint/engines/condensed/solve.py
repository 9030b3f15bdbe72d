"""The interface of engines/__init__.py for the condensed engine."""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

from ...fem.cache import cached
from ...fem.condensed import Condensed
from ...fem.memory import joint_size
from ...input.case import Case
from ...joint.interface import Interface
from ...mesh.mesh import mesh_of
from ...model.network import with_paths
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


def about(bulk: Condensed) -> dict[str, Any]:
    """Entries of run.json on the engine and its mesh."""
    return {
        "engine": "condensed",
        "factorisation": bulk.factorisation,
        "mesh": bulk.counts,
        "unknowns": bulk.unknowns,
    }


def threads_of(case: Case) -> int | None:
    """Number of threads that solve a case fastest; None: all."""
    return 1 if case.geometry or joint_size(case) < THREADED_UNKNOWNS else None


def solve(case: Case, on_step: OnStep, _fields: bool) -> Iterator[Outcome]:
    """The scenes of a case on one condensed mesh; see engines/__init__.py."""
    with limited_threads(threads_of(case)):
        start = time.perf_counter()
        bulk, made = cached(case)
        before = bulk.seconds if made else {"cache": time.perf_counter() - start}
        interface = Interface(bulk, case["quadrature"], case["face_points"])
        steppers: list[LoadStepper] = []
        recovered: list[dict[float, Field]] = []

        @lru_cache
        def bodies() -> Bodies:
            from ...fem.bodies import Bodies

            return made or Bodies.of(case)

        def fields(number: int) -> dict[float, Field]:
            """Fields of a scene; recovers those of all scenes with a single factorisation."""
            if len(recovered) < len(steppers):
                from .recover import recover

                scenes = [(s.model.equilibrium, s.history) for s in steppers]
                recovered[:] = recover(bodies(), scenes)
            return recovered[number]

        for number, scene in enumerate(case.scenes()):
            begin = time.perf_counter()
            error: BaseException | None = None
            stepper = LoadStepper(scene, interface, partial(on_step, number))
            steppers.append(stepper)
            try:
                stepper.run()
            except BaseException as caught:  # also an interrupt: converged steps are saved
                error = caught
                if stepper.history.complete(stepper.state):
                    stepper.save_last()
            result = stepper.results()
            seconds = before | {"solve": time.perf_counter() - begin}
            result.info |= about(bulk) | {"wall_seconds": seconds}
            yield Outcome(result, lambda: bodies().mesh, partial(fields, number), error)
