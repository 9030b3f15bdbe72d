"""A published test of flow in time: wedges split a specimen whose notch is filled with water.

WTNP128, after the experiment of Slowik and Saouma (J. Struct. Eng. 126, 2000), on half of the
specimen, geo/wedge.geo. Units: mm, N, MPa, s; forces per mm of thickness. Conventions of the test:
water acts on a point of the crack once it is damaged, and flows freely ahead of it; a point stores
its opening and p/N; the notch is broken from the start. Its pressure is held at the nodes between
its ends; at the upper end, the membrane's, it is zero.

Each function is a family: the tests by the names that the column `modeling` of
reference/FAMILY.csv has.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import RunError, data
from ..arrays import Array, BoolArray, IntArray, Value
from ..csr import CsrMatrix
from ..fem import elements
from ..fem.elasticity import elasticity
from ..fem.factor import schur_complement
from ..input.geometry_file import opened
from ..input.parameters import empty_gmsh, start_gmsh
from ..input.resolve import NO_DAM, load
from ..joint.flow import Flow, JointFields
from ..joint.flow_in_time import FlowInTime, TimeStep, WaterBalance, stored_at_rest
from ..laws import Law
from ..laws.rupture import RuptureVariables
from ..mesh.body import Body
from ..mesh.joint_mesh import JointMesh

#: Poisson's ratio [-].
POISSON = 0.2
#: Force of the wedge on the slot's right side, x over -y [-].
SPLITTING = 3.73
#: Pressure held in the notch [MPa].
HELD = 0.21
#: Viscosity of the water [MPa s].
VISCOSITY = 1e-9
#: Stiffness of the membrane between notch and slot [MPa/mm].
MEMBRANE = 20.0
#: Hydraulic aperture of an undamaged point [mm].
WIDE = 10.0
#: Hydraulic aperture of a closed one, for a finite resistance [mm].
NARROW = 1e-12
#: Opening at which a point is damaged, over that at which linear softening ends, or over G/f_t of
#: exponential softening [-].
ADHERENCE = 1e-3
#: Gauss points of an element of the crack.
RULE = {"line": 2}
#: Largest residual over the largest force on the crack and by the wedge, at convergence [-].
TOLERANCE = 1e-9
#: Iterations of Newton's method at most.
ITERATIONS = 60


@dataclass(frozen=True, kw_only=True)
class WedgeTest:
    """A test: velocity at which the wedge opens the slot [mm/s], step and duration [s]; E, f_t
    [MPa], G [N/mm], softening; storage 1/N of the crack [mm/MPa].
    """

    velocity: float
    dt: float
    duration: float
    E: float
    f_t: float
    G: float
    softening: str
    storage: float

    @property
    def law(self) -> Law[RuptureVariables]:
        """Its law: the published ones in pure opening."""
        length = self.G / self.f_t
        if self.softening == "linear":
            begin, remaining, end = ADHERENCE * 2 * length, 1 - ADHERENCE, 2 * length
        else:
            begin = ADHERENCE * length
            remaining, end = np.exp(-ADHERENCE), begin + 2 * length
        strength = self.f_t * remaining
        settings: dict[str, Value] = {"sigma_max": strength, "K_N": strength / begin}
        settings |= {"pena_rupture": end / begin - 1, "pena_contact": 1.0}
        settings |= {"law": "rupture", "softening": self.softening}
        law: Law[RuptureVariables] = load("dam", {**NO_DAM, **settings}).law
        return law


class Groups:
    """The groups of geo/wedge.geo as parts of its mesh."""

    def __init__(self, size: float) -> None:
        """size: of the elements along the crack [mm]."""
        gmsh = empty_gmsh()
        with opened(data("geo") / "wedge.geo", f"size_path = {size};\n"):
            gmsh.model.mesh.generate(2)
        tags, points, _ = gmsh.model.mesh.getNodes()
        order = np.argsort(tags)
        self.tags, self.points = tags[order].astype(int), points.reshape(-1, 3)[order]

    def body(self, dimension: int, *names: str) -> Body:
        """Groups of a dimension as one part."""
        model, tables, numbers = start_gmsh().model, list[IntArray](), list[IntArray]()
        groups = {model.getPhysicalName(*g): g[1] for g in model.getPhysicalGroups(dimension)}
        for name in names:
            for entity in model.getEntitiesForPhysicalGroup(dimension, groups[name]):
                _, elements_of, nodes = model.mesh.getElements(dimension, entity)
                tables.append(nodes[0].reshape(len(elements_of[0]), -1).astype(int))
                numbers.append(elements_of[0])
        table = np.concatenate(tables)
        used, cells = np.unique(table, return_inverse=True)
        shape = {0: "vertex", 1: "line", 2: "triangle"}[dimension]
        return Body(
            points=self.points[np.searchsorted(self.tags, used)],
            node_tags=used,
            cells=[(shape, cells.reshape(table.shape))],
            element_tags=np.concatenate(numbers),
            regions=[names[0]],
        )


class Specimen:
    """Half of the specimen; unknowns (n + 1,): displacements along x of the crack's face and of the
    membrane's, and that along y at the wedge.
    """

    def __init__(self, E: float, size: float = 1.0) -> None:
        groups = Groups(size)
        crack, mouth, end = groups.body(1, "crack"), groups.body(0, "mouth"), groups.body(0, "end")
        space = elements.Space(groups.body(2, "specimen"), 2)
        nodes = space.body.node_tags
        matrix = elasticity(space, 2, {"specimen": (E, POISSON)})
        held, wedge = (
            2 * int(np.searchsorted(nodes, part.node_tags[0]))
            for part in (end, groups.body(0, "wedge"))
        )
        free = np.delete(np.arange(matrix.shape[0]), [held, held + 1])
        face = 2 * space.find(elements.Space(groups.body(1, "crack", "membrane"), 2))
        self.number = np.full(matrix.shape[0], -1)
        face = face[face != held]
        self.number[face] = np.arange(len(face))
        keep = np.searchsorted(free, np.append(face, [wedge + 1, wedge]))
        part = elements.Space(groups.body(1, "membrane"), 2)
        membrane = elements.points_of(part, RULE)
        spring = self.openings(space, part, membrane)
        stiffness, _ = schur_complement(matrix[free].columns(free), keep, np.zeros((len(free), 1)))
        stiffness[:-1, :-1] += MEMBRANE / 2 * (spring.T @ spring.scaled(membrane.weights)).toarray()
        #: of the unknowns and of the displacement along x at the wedge; the forces of the wedge
        #: are in equilibrium if its row for y, SPLITTING times, and that for x have the sum zero
        self.stiffness = stiffness
        line = elements.Space(crack, 2)
        self.points = elements.points_of(line, RULE)
        self.opening = self.openings(space, line, self.points)
        mesh = JointMesh(
            dim=2,
            surface=crack,
            heel=mouth,
            toe=end,
            upper="right",
            lower="left",
            name="crack",
            upper_tags=crack.node_tags,
        )
        #: water in the crack and the notch
        fields = JointFields(mesh, line, RULE)
        #: openings as jumps: normal, tangential
        jumps = CsrMatrix.of_entries(
            self.opening.data,
            2 * self.opening.rows,
            self.opening.indices,
            (2 * len(self.points.weights), self.opening.shape[1]),
        )
        self.flow = Flow(
            fields, self.points, self.points.weights, self.opening, fields.at_points, jumps
        )
        #: nodes of the notch whose pressure is held, and points of it, which are broken
        y = crack.points[:, 1]
        self.held = (y > size / 2) & (y < y.max() - size / 2)
        self.broken = self.points.positions[:, 1] > 0

    def openings(
        self, space: elements.Space, part: elements.Space, points: elements.Points
    ) -> CsrMatrix:
        """The opening at points of a part of the face: by symmetry twice the displacement."""
        columns = self.number[2 * space.find(part)][points.values.indices]
        moves = columns >= 0
        shape = len(points.weights), int(self.number.max()) + 2
        return CsrMatrix.of_entries(
            2 * points.values.data[moves], points.values.rows[moves], columns[moves], shape
        )


@dataclass(frozen=True, kw_only=True)
class Iterate:
    """Residual and tangent at an iterate, size of the forces in the crack, and its water."""

    residual: Array
    tangent: Array
    size: float
    water: FlowInTime
    pressure: Array


class Splitting:
    """A step of a test."""

    def __init__(self, test: WedgeTest, size: float = 1.0) -> None:
        self.test, self.law, self.specimen = test, test.law, Specimen(test.E, size)
        s = self.specimen
        flow, points = s.flow, len(s.points.weights)
        self.variables = self.law.initial(points)
        self.undamaged = self.variables.kappa[0]
        self.variables.kappa[s.broken] = 1e3 * test.G / test.f_t
        self.fields = flow.fields.at_points
        self.storage = self.fields.T @ (test.storage * s.points.weights)
        nothing = np.zeros(flow.fields.nodes)
        self.stored = stored_at_rest(nothing, nothing, self.storage, nothing, 0.0)
        self.heads = np.where(s.held, HELD, 0.0)
        self.known = s.held.copy()
        self.known[flow.fields.ends] = True
        self.unknowns = np.zeros(s.opening.shape[1])

    def damaged(self, opening: Array) -> BoolArray:
        """Whether points are damaged."""
        return np.asarray(np.maximum(self.variables.kappa, opening) > self.undamaged)

    def at(self, unknowns: Array, wedge: float) -> Iterate:
        """Residual and tangent at unknowns, and at a displacement of the wedge along x [mm]."""
        s, test = self.specimen, self.test
        weights, flow = s.points.weights, s.flow
        opening = s.opening @ unknowns
        jump = np.column_stack([opening, np.zeros((len(opening), 2))])
        traction, tangent = self.law.traction_and_tangent(jump, self.variables)
        damaged = self.damaged(opening)
        width = np.where(damaged, np.maximum(opening, 0), WIDE)
        grows = np.where(damaged & (opening > 0), 3 * width**2, 0)
        weighted = weights / (12 * VISCOSITY)
        balance = WaterBalance(
            flow=flow,
            step=TimeStep(seconds=test.dt, begin=self.stored),
            opened=self.fields.T @ (weights * opening),
            storage=self.storage,
            elevation=np.zeros(len(self.heads)),
            lowest=-np.inf,
        )
        none = np.zeros(len(self.heads), bool)
        conductivity = weighted * np.maximum(width, NARROW) ** 3
        water = balance.solve(conductivity, 0 * self.heads, self.heads, self.known, none, none)
        pressure = self.heads.copy()
        pressure[flow.inside] = water.pressure
        rates = flow.derivative(water, weighted * grows, weights / test.dt)
        acting = np.where(damaged, weights, 0) / 2
        forces = s.opening.T @ (weights / 2 * traction[:, 0] - acting * (self.fields @ pressure))
        whole = s.stiffness @ np.append(unknowns, wedge)
        residual = whole[:-1] + forces
        residual[-1] = whole[-1] + SPLITTING * whole[-2]
        slope = weights / 2 * tangent[:, 0, 0]
        matrix = s.stiffness[:-1, :-1] + (s.opening.T @ s.opening.scaled(slope)).toarray()
        by_water = s.opening.T @ self.fields.columns(flow.inside).scaled(acting)
        matrix[:, rates.columns] -= by_water @ rates.pressure
        matrix[-1] = s.stiffness[-1, :-1] + SPLITTING * s.stiffness[-2, :-1]
        size = np.abs(whole[:-2]).max() + abs(whole[-2])
        return Iterate(residual=residual, tangent=matrix, size=size, water=water, pressure=pressure)

    def advance(self, time: float) -> tuple[float, Array]:
        """A step to a time [s]: vertical force of the wedge [N/mm] and pressures [MPa]."""
        wedge, unknowns = self.test.velocity * time / 2, self.unknowns
        for _ in range(ITERATIONS):
            now = self.at(unknowns, wedge)
            if np.abs(now.residual).max() < TOLERANCE * now.size:
                break
            unknowns = unknowns - np.linalg.solve(now.tangent, now.residual)
        else:
            raise RunError(f"wedge test at {time:g} s: not converged")
        s = self.specimen
        opening = s.opening @ unknowns
        self.unknowns, self.stored = unknowns, now.water.stored(time, self.stored)
        jump = np.column_stack([opening, np.zeros((len(opening), 2))])
        self.variables = self.law.update_internal_variables(jump, self.variables)
        force = s.stiffness[-2] @ np.append(unknowns, wedge)
        return float(force), now.pressure


def follow(test: WedgeTest, size: float = 1.0) -> dict[str, Array]:
    """Columns, a row per step: t [s]; F_y, vertical force on a side of the slot [N/mm]; p_41, p_60,
    pressures at y = -41 and -60 mm [MPa]. Raises RunError.
    """
    step, rows = Splitting(test, size), []
    y = step.specimen.flow.fields.joint.surface.points[:, 1]
    order = np.argsort(y)
    for k in range(round(test.duration / test.dt)):
        time = (k + 1) * test.dt
        force, pressure = step.advance(time)
        at = np.interp([-41.0, -60.0], y[order], pressure[order])
        rows.append((time, force, *at))
    return dict(zip(("t", "F_y", "p_41", "p_60"), np.array(rows).T, strict=True))


def wtnp128() -> dict[str, WedgeTest]:
    """Slow with exponential softening (A), fast (B), slow with linear softening (C)."""
    slow = {"velocity": 0.002, "dt": 10.0, "E": 27500.0, "f_t": 3.25, "G": 0.150}
    fast = {"velocity": 0.2, "dt": 0.2, "E": 39000.0, "f_t": 3.3, "G": 0.178}
    return {
        "A": WedgeTest(**slow, duration=290.0, softening="exponential", storage=1 / 3e-4),
        "B": WedgeTest(**fast, duration=4.2, softening="exponential", storage=1 / 5e-4),
        "C": WedgeTest(**slow, duration=240.0, softening="linear", storage=1 / 3e-4),
    }


FAMILIES = {"wtnp128": wtnp128}
