"""Rock with mass in an earthquake: its boundary absorbs waves, and the record enters as a wave.

The free field is what the record does to level rock without a dam: a plane wave travels upwards, is
reflected by the surface, and there causes the record's motion, twice that of the wave. On the
boundary, of normal n, a traction of the free field and dashpots on what differs from it act in
place of the supports [Lysmer and Kuhlemeyer 1969]:

    t = sigma_f n - D (u' - u_f'),    D = rho c_p n n^T + rho c_s (1 - n n^T).

On a level base this is 2 rho c times the velocity of the upward wave, less rho c u'. The reactions
of the supports in the static state remain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from .. import require
from ..arrays import Array, Sparse
from ..fem.bodies import Bodies
from ..fem.elasticity import elasticity, lame, mass
from ..fem.elements import WATER, Space, points_of
from ..input.case import Case
from ..mesh.sides import outward
from .record import Record
from .system import ROCK


def check(case: Case) -> None:
    """Raise InputError if the rock of a case can not have mass but should."""
    if not case["rock_mass"]:
        return
    why = f"({case.geometry}): the record enters through level rock"
    require(not case.geometry, "rock_mass", 1, f"be 0 with a geometry of one's own {why}")
    require(case["rho_found"], "rho_found", 0, "be > 0 with rock_mass = 1")
    held = case["dim"] == 2 or case["hold_z"]
    require(held, "hold_z", 0, "be 1 with rock_mass = 1: the waves are plane")


def wave_speeds(case: Case) -> Array:
    """Speeds (2,) [m/s] of vertical waves of horizontal and vertical motion: c_s and c_p."""
    lam, mu = lame(case["E_found"], case["nu_found"])
    return np.sqrt(np.array([mu, lam + 2 * mu]) / case["rho_found"])


def travel_time(case: Case, interval: float) -> float:
    """Time [s] of a wave from the rock's base to its surface, up to a multiple of an interval."""
    return math.ceil(case["found_depth"] / wave_speeds(case).min() / interval) * interval


@dataclass(frozen=True, kw_only=True)
class FreeField:
    """The motion of level rock at q points, by the motion of its surface at y = 0."""

    record: Record
    #: y of the points, and of the rock's surface there (q,)
    y: Array
    surface: Array
    #: wave_speeds, and density [kg/m3]
    speeds: Array
    density: float

    def at(self, time: float) -> tuple[Array, Array]:
        """Velocity relative to the record's (q, 2) [m/s], and stress xy, yy (q, 2) [Pa]."""
        velocity, stress = np.zeros((2, len(self.y), 2))
        for axis, speed in enumerate(self.speeds):
            up, down = (
                self.record.velocity(time + path / speed)[:, axis] / 2
                for path in (-self.y, self.y - 2 * self.surface)
            )
            velocity[:, axis] = up + down
            stress[:, axis] = self.density * speed * (down - up)
        return velocity - self.record.velocity(np.array([time])), stress


@dataclass(frozen=True, kw_only=True)
class AbsorbingRock:
    """The rock and its boundary, over the unknowns (n,) of a System, relative to the record."""

    #: of the rock alone, and of the dashpots (n, n)
    mass: Sparse
    stiffness: Sparse
    dashpots: Sparse
    #: at q points of the boundary, and forces of its velocities and of its stresses (n, 2 q)
    field: FreeField
    by_velocity: Sparse
    by_stress: Sparse

    @staticmethod
    def of(case: Case, bodies: Bodies, motion: dict[str, Sparse], record: Record) -> AbsorbingRock:
        """motion: see System; record: of the rock's surface, later by `travel_time`."""
        space, moved, dim = bodies.by_name[ROCK].space, motion[ROCK], bodies.mesh.dim
        speeds, density, poisson = wave_speeds(case), case["rho_found"], case["nu_found"]
        boundary = bodies.mesh.bodies["fixed"]
        part = Space(boundary, space.order)
        points = points_of(part, WATER)
        of_elements = outward(boundary, space.body)
        assert of_elements is not None  # a section's boundary has sides of elements
        normals = of_elements[0][points.elements][:, :dim]
        dofs = np.ravel(dim * space.find(part)[:, None] + np.arange(dim))
        values = sparse.kron(points.values.scipy(), sparse.eye(dim)) @ moved[dofs]
        weighted = values.T @ sparse.diags(np.repeat(points.weights, dim))
        along = normals[:, :, None] * normals[:, None, :]
        impedance = density * (speeds[1] * along + speeds[0] * (np.eye(dim) - along))
        # traction of the stresses xy, yy, with the lateral ones of no lateral strain
        traction = np.zeros((len(normals), dim, 2))
        traction[:, :, 1] = poisson / (1 - poisson) * normals
        traction[:, [0, 1], [0, 1]] = normals[:, 1:2]
        traction[:, 1, 0] = normals[:, 0]
        x, y = boundary.points.T[:2]
        middle = case["dam_base"] / 2
        tops = np.where(points.positions[:, 0] < middle, y[x < middle].max(), y[x > middle].max())
        elastic = {"lower": (0.0, 0.0), ROCK: (case["E_found"], poisson)}

        def blocks(each: Array) -> Sparse:
            return sparse.block_diag(each, format="csr")

        return AbsorbingRock(
            mass=moved.T @ mass(space, dim, {ROCK: density}) @ moved,
            stiffness=moved.T @ elasticity(space, dim, elastic).scipy() @ moved,
            dashpots=weighted @ blocks(impedance) @ values,
            field=FreeField(
                record=record,
                y=points.positions[:, 1],
                surface=tops,
                speeds=speeds,
                density=density,
            ),
            by_velocity=weighted @ blocks(impedance[:, :, :2]),
            by_stress=weighted @ blocks(traction),
        )

    def load(self, time: float) -> Array:
        """Forces (n,) of the free field on the boundary at a time."""
        velocity, stress = self.field.at(time)
        force: Array = self.by_velocity @ velocity.ravel() + self.by_stress @ stress.ravel()
        return force
