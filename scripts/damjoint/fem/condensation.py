"""The bulk, eliminated exactly: what dam and foundation do to the joint.

Both bodies are linear elastic and do not change with the level, the law or the water. With their
unknowns away from the joint eliminated (Schur complements), the joint sees the dam (floating, S_d)
and the foundation (S_f):

    S_d u_d + t = f_d,    S_f u_f - t = f_f,    delta = u_d - u_f

(t: nodal forces of the joint's total traction on its upper lip). Eliminating u_d and u_f too leaves
the jump alone:

    t = t_0 - S delta,    M = S_d + S_f,    S = S_d - S_d M^-1 S_d,    t_0 = f_d - S_d M^-1 (f_d +
    f_f).

S is symmetric; the dam's rigid motions are its null space. Why not GetDP for the bulk: its start
alone takes as long as a whole 2D loading here, and an independent assembly checks the problem
definition (tests compare both).
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse

from ..model.case import Case
from ..model.loads import wet
from ..model.mesh import LINES, SIDES, Body, Face, Mesh, mesh_of
from .elasticity import Material, body_force, elasticity
from .elements import WATER, Space, points_of
from .factor import dense_memory, schur_complement
from .memory import bulk_size, check_memory

#: What the condensed bodies depend on besides the mesh.
MATERIAL = ("order", "hold_z", "E_dam", "E_found", "nu_dam", "nu_found")


def joint_size(case: Case) -> int:
    """Number of jump unknowns of a case, before any meshing (free meshes of order 2 have a few
    less).
    """
    dim, order = int(case["dim"]), int(case["order"])
    return (
        dim
        * (order * int(case["n_joint"]) + 1)
        * (order * int(case["n_layers"]) + 1 if dim == 3 else 1)
    )


#: Memory of a factorised body [bytes per unknown], as `damjoint bench` finds it in 2D.
PER_UNKNOWN = 2400


def check_size(case: Case) -> None:
    """Raise RunError, before any meshing, if a case asks for more memory than there is."""
    joint, bulk = joint_size(case), bulk_size(case)
    what = f"{bulk:.0f} unknowns, {joint} of them on the joint,"
    check_memory(dense_memory(joint) + PER_UNKNOWN * bulk, what)


def unknowns(functions: np.ndarray, dim: int, components: list[int] | None = None) -> np.ndarray:
    """Unknowns of functions, function by function, all components or some."""
    return (
        dim * functions[:, None] + np.array(range(dim) if components is None else components)
    ).ravel()


#: The bodies' weights that a load may need: region and component of its density.
WEIGHTS = {
    "dam": (("dam", 0), ("dam", 1)),
    "foundation": (("lower", 0), ("lower", 1), ("foundation", 1)),
}


def material_of(case: Case) -> Material:
    """Elasticity by region; under a lift joint is the dam's concrete."""
    dam, found = ((case[f"E_{n}"], case[f"nu_{n}"]) for n in ("dam", "found"))
    return {"dam": dam, "lower": dam, "foundation": found}


@dataclass
class Bodies:
    """Dam and foundation (with what lies under a lift joint) with their stiffness, before
    elimination.
    """

    mesh: Mesh
    dim: int
    #: by body, dam and foundation:
    spaces: dict[str, Space]
    #: functions of the joint
    joint: dict[str, np.ndarray]
    #: unknowns that are held
    held: dict[str, np.ndarray]
    #: stiffness matrices, all unknowns [N/m]
    stiffness: dict[str, sparse.csr_matrix]
    #: functions of the wet faces and of the lines where forces act, in their body's numbering
    faces: dict[str, np.ndarray]
    lines: dict[str, np.ndarray]
    #: wall seconds of their assembly
    seconds: float

    @staticmethod
    def of(case: Case) -> Bodies:
        """Mesh a case, number its unknowns and assemble.

        Raises RunError (mesh).
        """
        mesh = mesh_of(case)
        start, dim, order = time.perf_counter(), mesh.dim, int(case["order"])
        spaces = {name: Space(mesh.bodies[name], order) for name in BODIES}
        part = lambda body: Space(body, order)
        joint = part(mesh.bodies["joint"])
        held = {
            "dam": [],
            "foundation": [unknowns(spaces["foundation"].find(part(mesh.bodies["fixed"])), dim)],
        }
        if dim == 3 and case["hold_z"]:
            for name in BODIES:
                sides = spaces[name].find(part(within(mesh.bodies["sides"], mesh.bodies[name])))
                held[name].append(unknowns(sides, dim, [2]))
        material = material_of(case)
        lines = [name for name in LINES if name in mesh.bodies]
        return Bodies(
            mesh,
            dim,
            spaces,
            {name: space.find(joint) for name, space in spaces.items()},
            {n: np.unique(np.concatenate([*h, np.zeros(0, int)])) for n, h in held.items()},
            {name: elasticity(space, dim, material) for name, space in spaces.items()},
            {
                name: spaces[body_of(face)].find(part(face.surface))
                for name, face in mesh.faces.items()
                if wet(case, face)
            },
            {n: spaces[mesh.bearer(n)].find(part(mesh.bodies[n])) for n in lines},
            time.perf_counter() - start,
        )


BODIES = ("dam", "foundation")


def body_of(face: Face) -> str:
    """The body a face belongs to."""
    return face.body


def within(surface: Body, body: Body) -> Body:
    """The part of a surface that belongs to a body."""
    inside = np.isin(surface.node_tags, body.node_tags)
    cells = [(shape, table[inside[table].all(axis=1)]) for shape, table in surface.cells]
    used = np.unique(np.concatenate([table.ravel() for _, table in cells]))
    place = np.zeros(len(surface.points), int)
    place[used] = np.arange(len(used))
    return Body(
        surface.points[used],
        surface.node_tags[used],
        [(shape, place[table]) for shape, table in cells],
        np.zeros(0, int),
    )


@dataclass
class Condensed:
    """The condensed bodies: matrices on the free jump unknowns (j of them) and the responses to
    loads.
    """

    dim: int
    order: int
    #: thickness along z [m], 1 in 2D
    width: float
    counts: dict[str, int]
    unknowns: int
    joint: Body
    #: nodes of the joint at its heel and at its toe; the heel itself
    heel: np.ndarray
    toe: np.ndarray
    heel_line: Body
    #: the wet faces; of each its number in SIDES, low and high
    faces: dict[str, Body]
    kinds: dict[str, np.ndarray]
    #: jump unknowns, dim * joint function + component, that are not held
    free: np.ndarray
    #: S (j, j), see above
    stiffness: np.ndarray
    #: t_0 of unit loads (j,), by name: weight densities dam_x, dam_y, lower_x, ... [N/m3] along the
    #: axes, forces per metre of a line ice_x, ice_y, ... [N/m]
    units: dict[str, np.ndarray]
    #: t_0 of unit forces on loaded unknowns (j, m), and which of these belongs to each unknown of a
    #: face (functions * dim,); -1: none, it is held or never loaded
    pressure: np.ndarray
    places: dict[str, np.ndarray]
    #: the crest's displacement along x: per jump (j,), unit loads, forces on loaded unknowns (m,)
    crest_jump: np.ndarray
    crest_units: dict[str, float]
    crest_pressure: np.ndarray
    #: wall seconds of mesh, assembly and condensation
    seconds: dict[str, float]


@dataclass
class Reduced:
    """A body reduced to its joint unknowns (n of them): stiffness S (n, n); the forces there of
    unit forces on loaded unknowns (n, l) and of unit loads (n, k). The loaded unknowns move by
    flexibility (forces - coupling^T u).
    """

    stiffness: np.ndarray
    spread: np.ndarray
    units: np.ndarray
    coupling: np.ndarray
    #: K_ll (l, l) and the unit loads on the loaded unknowns (l, k)
    kept: np.ndarray
    on_kept: np.ndarray

    @staticmethod
    def of(
        stiffness: sparse.csr_matrix,
        loads: np.ndarray,
        held: np.ndarray,
        joint: np.ndarray,
        loaded: np.ndarray,
    ) -> Reduced:
        """Schur complement of a body; loads (unknowns, k): unit loads."""
        kept = np.setdiff1d(np.arange(stiffness.shape[0]), held)
        place = np.full(stiffness.shape[0], -1)
        place[kept] = np.arange(len(kept))
        n, ends = len(joint), np.concatenate([place[joint], place[loaded]])
        schur, on_ends = schur_complement(stiffness[kept][:, kept], ends, loads[kept])
        jj, jl, ll = schur[:n, :n], schur[:n, n:], schur[n:, n:]
        on_joint, on_kept = on_ends[:n], on_ends[n:]
        if not len(loaded):
            return Reduced(jj, jl, on_joint, jl, ll, on_kept)
        spread = linalg.solve(ll, jl.T, assume_a="pos").T
        reduced = jj - spread @ jl.T
        return Reduced(
            (reduced + reduced.T) / 2, -spread, on_joint - spread @ on_kept, jl, ll, on_kept
        )


def unit_loads(bodies: Bodies, name: str) -> dict[str, np.ndarray]:
    """The unit loads that can act on a body, as load vectors (unknowns,)."""
    dim, space, found = bodies.dim, bodies.spaces[name], {}
    for region, component in WEIGHTS[name]:
        if region in space.body.regions:
            found[f"{region}_{'xyz'[component]}"] = body_force(space, dim, component, region)
    for line, functions in bodies.lines.items():
        if bodies.mesh.bearer(line) == name:
            points = points_of(Space(bodies.mesh.bodies[line], space.order), WATER)
            for component in (0, 1):
                column = np.zeros(dim * len(space.place))
                column[dim * functions + component] = points.values.T @ points.weights
                found[f"{line}_{'xyz'[component]}"] = column
    return found


def condense(case: Case, bodies: Bodies) -> Condensed:
    """Eliminate the bulk of a case."""
    start, dim, mesh = time.perf_counter(), bodies.dim, bodies.mesh
    joint = {name: unknowns(bodies.joint[name], dim) for name in BODIES}
    free_mask = ~np.isin(joint["dam"], bodies.held["dam"])
    free = np.flatnonzero(free_mask)
    joint = {name: u[free_mask] for name, u in joint.items()}
    nj = len(free)

    # Loaded unknowns besides the joint's: along the normals of the wet faces
    wanted = {name: [np.zeros(0, int)] for name in BODIES}
    for name, functions in bodies.faces.items():
        face = mesh.faces[name]
        pushed = np.flatnonzero(np.abs(face.surface.normals[:, :dim]).max(axis=0) > 1e-9)
        wanted[body_of(face)].append(unknowns(functions, dim, list(pushed)))
    crest = bodies.spaces["dam"].find(Space(mesh.bodies["crest"], 1))[:1] * dim
    wanted["dam"].append(crest)
    reduced, loaded, names = {}, {}, {}
    for name in BODIES:
        taken = np.concatenate([joint[name], bodies.held[name]])
        loaded[name] = np.setdiff1d(np.concatenate(wanted[name]), taken)
        units = unit_loads(bodies, name)
        names[name], columns = list(units), np.column_stack(list(units.values()))
        reduced[name] = Reduced.of(
            bodies.stiffness[name], columns, bodies.held[name], joint[name], loaded[name]
        )

    dam = reduced["dam"].stiffness
    both = linalg.cholesky(reduced["foundation"].stiffness + dam, lower=True, overwrite_a=True)
    half = linalg.solve_triangular(both, dam, lower=True)  # L^-1 S_d
    stiffness = dam - half.T @ half

    def transmitted(forces: np.ndarray, upper: bool) -> np.ndarray:
        """t_0 of forces (j, k) on one of the lips."""
        through = half.T @ linalg.solve_triangular(both, forces, lower=True)
        return (forces if upper else 0) - through

    # The crest: row (forces on the loaded unknowns - jl^T u_d), with
    # u_d = delta + M^-1 (f_d + f_f - S_d delta)
    own = reduced["dam"]
    row = linalg.solve(own.kept, 1.0 * (loaded["dam"] == crest[0]), assume_a="pos")
    crest_lip = -(own.coupling @ row)
    crest_both = linalg.cho_solve((both, True), crest_lip)

    pressure, crest_pressure, units, crest_units, column = [], [], {}, {}, {}
    for name in BODIES:
        body, upper = reduced[name], name == "dam"
        # unit forces: on the loaded unknowns, then on those of the joint that are the faces', too
        ends = np.flatnonzero(np.isin(joint[name], np.concatenate(wanted[name])))
        forces = np.hstack([body.spread, np.eye(nj)[:, ends]])
        first = sum(p.shape[1] for p in pressure)
        pressure.append(transmitted(forces, upper))
        direct = np.concatenate([row, np.zeros(len(ends))]) if upper else 0
        crest_pressure.append(direct + crest_both @ forces)
        order = np.concatenate([loaded[name], joint[name][ends]])
        column[name] = np.full(bodies.stiffness[name].shape[0], -1)
        column[name][order] = first + np.arange(len(order))
        through = transmitted(body.units, upper)
        direct = row @ body.on_kept if upper else 0
        moved = direct + crest_both @ body.units
        units |= {n: through[:, i] for i, n in enumerate(names[name])}
        crest_units |= {n: float(moved[i]) for i, n in enumerate(names[name])}

    faces = {name: mesh.faces[name] for name in bodies.faces}
    joint_tags = mesh.bodies["joint"].node_tags
    total = sum(k.shape[0] for k in bodies.stiffness.values())
    return Condensed(
        dim,
        int(case["order"]),
        mesh.joints["joint"].width,
        mesh.counts,
        total - sum(len(h) for h in bodies.held.values()),
        mesh.bodies["joint"],
        np.flatnonzero(np.isin(joint_tags, mesh.bodies["heel"].node_tags)),
        np.flatnonzero(np.isin(joint_tags, mesh.bodies["toe"].node_tags)),
        mesh.bodies["heel"],
        {name: face.surface for name, face in faces.items()},
        {n: np.array([SIDES.index(f.side), f.low, f.high]) for n, f in faces.items()},
        free,
        stiffness,
        units,
        np.hstack(pressure),
        {
            name: column[body_of(face)][unknowns(bodies.faces[name], dim)]
            for name, face in faces.items()
        },
        crest_lip - dam @ crest_both,
        crest_units,
        np.concatenate(crest_pressure),
        {
            "mesh": mesh.seconds,
            "assembly": bodies.seconds,
            "condensation": time.perf_counter() - start,
        },
    )
