"""Natural modes of a dam without a record: joints closed and undamaged, with and without its water,
on the elastic rock without mass and on rigid rock.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from .. import InputError
from ..arrays import Array, Table
from ..fem.bodies import Bodies
from ..fem.cache import condensed_bodies
from ..input.case import Case
from ..joint.interface import Interface
from ..mesh.mesh import Mesh
from ..model.results import MODES
from ..solver.load_stepper import LoadStepper
from .frames import at_nodes
from .stepper import FREQUENCIES, Damping, Mode
from .system import ROCK, System

#: Rocks and waters that are computed; the first of each are those of an earthquake's damping.
ELASTIC, RIGID = "massless", "rigid"
WITH_WATER, EMPTY = "reservoir", "none"


@dataclass(frozen=True, kw_only=True)
class Variant:
    """The modes with a rock and a water, undamped."""

    rock: str
    water: str
    #: of an earthquake of this variant
    damping: Damping
    #: from the lowest, with their damping ratios
    modes: list[Mode]
    #: of each mode the displacement (nodes, dim) of each body, at most 1
    shapes: list[dict[str, Array]]


@dataclass(frozen=True, kw_only=True)
class NaturalModes:
    """The natural modes of a case."""

    case: Case
    mesh: Mesh
    variants: list[Variant]

    @property
    def table(self) -> Table:
        """A row for each mode of each variant, with the columns of MODES."""
        rows = [
            (v.rock, v.water, number, m.frequency, 1 / m.frequency, m.along_x, m.along_y, m.damping)
            for v in self.variants
            for number, m in enumerate(v.modes, start=1)
        ]
        columns = zip(*rows, strict=True)
        return {name: np.array(column) for name, column in zip(MODES, columns, strict=True)}


def on_rigid_rock(system: System) -> System:
    """The system without the unknowns that move the rock."""
    moving = np.unique(system.motion[ROCK].tocsr().indices)
    free = np.setdiff1d(np.arange(system.size), moving)
    return replace(
        system,
        mass=system.mass[free][:, free].tocsr(),
        solid=system.solid[free][:, free].tocsr(),
        stiffness=system.stiffness[free][:, free].tocsr(),
        motion={name: matrix.tocsr()[:, free] for name, matrix in system.motion.items()},
        inertia=system.inertia[free],
        crest=system.crest.tocsr()[:, free],
        jumps=np.searchsorted(free, system.jumps),
    )


def natural_modes(case: Case, number: int) -> NaturalModes:
    """The lowest natural modes of a case, so many of each variant.

    The water's mass is that of the last level. Raises InputError if there are not so many.
    """
    bulk, assembled = condensed_bodies(case)
    bodies = assembled or Bodies.of(case)
    interface = Interface(bulk, case["quadrature"], case["face_points"])
    stepper = LoadStepper(case, interface)  # with the joints of a user's own geometry
    undamaged = interface.assembly.whole(stepper.model.equilibrium.undamaged)

    def variants() -> Iterator[Variant]:
        for water, rock in itertools.product((WITH_WATER, EMPTY), (ELASTIC, RIGID)):
            values = {"rock_mass": 0.0} | ({"added_mass": 0.0} if water == EMPTY else {})
            scene = stepper.case.with_values(values)
            system = System.of(scene, bodies, interface)
            system = on_rigid_rock(system) if rock == RIGID else system
            computed = max(number, FREQUENCIES)
            if computed >= system.size:
                raise InputError(f"number = {number}: must be < {system.size}, the unknowns")
            frequencies, shapes = system.frequencies(undamaged, computed)
            damping = Damping.of(scene, frequencies[:FREQUENCIES])
            yield Variant(
                rock=rock,
                water=water,
                damping=damping,
                modes=Mode.of(system, damping, frequencies, shapes)[:number],
                shapes=[scaled(at_nodes(system, shape)) for shape in shapes.T[:number]],
            )

    return NaturalModes(case=stepper.case, mesh=bodies.mesh, variants=list(variants()))


def scaled(shape: dict[str, Array]) -> dict[str, Array]:
    """A shape with a largest component of 1."""
    values = np.concatenate([moved.ravel() for moved in shape.values()])
    largest = values[np.abs(values).argmax()]
    return {name: moved / largest for name, moved in shape.items()}
