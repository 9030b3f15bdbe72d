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

from ...scene.case import Case
from ...scene.mesh import Body, Mesh
from .elasticity import body_force, elasticity
from .elements import Space
from .factor import check_memory, dense_memory, schur_complement

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


def bulk_size(case: Case) -> float:
    """About the number of unknowns of both bodies, before any meshing.

    A triangle has half of the product of the sizes at both ends of the body, order 2 four unknowns
    a triangle. (Prisms and tetrahedra: within a factor of three.)
    """
    dim, order, near = int(case["dim"]), int(case["order"]), case["dam_base"] / case["n_joint"]
    dam = (case["dam_base"] + case["dam_crest"]) / 2 * case["dam_height"]
    foundation = (case["dam_base"] + 2 * case["found_side"]) * case["found_depth"]
    triangles = 2 * (dam / (near * case["h_dam"]) + foundation / (near * case["h_found"]))
    return triangles * order**2 * (1 if dim == 2 else 1.5 * case["n_layers"])


#: Memory of a factorised body [bytes per unknown], as `damjoint bench` finds it in 2D.
PER_UNKNOWN = 2000


def check_size(case: Case) -> None:
    """Raise RunError, before any meshing, if a case asks for more memory than there is."""
    joint, bulk = joint_size(case), bulk_size(case)
    check_memory(dense_memory(joint) + PER_UNKNOWN * bulk, int(bulk), joint)


def unknowns(functions: np.ndarray, dim: int, components: list[int] | None = None) -> np.ndarray:
    """Unknowns of functions, function by function, all components or some."""
    return (
        dim * functions[:, None] + np.array(range(dim) if components is None else components)
    ).ravel()


@dataclass
class Bodies:
    """Dam and foundation with their stiffness, before elimination."""

    mesh: Mesh
    dim: int
    dam: Space
    foundation: Space
    #: functions of the joint, and of the faces, in the dam's numbering; of the joint in the
    #: foundation's
    joint_dam: np.ndarray
    joint_foundation: np.ndarray
    faces: dict[str, np.ndarray]
    #: unknowns that are held
    held_dam: np.ndarray
    held_foundation: np.ndarray
    #: stiffness matrices, all unknowns [N/m]
    stiff_dam: sparse.csr_matrix
    stiff_foundation: sparse.csr_matrix
    #: wall seconds of their assembly
    seconds: float

    @staticmethod
    def of(case: Case) -> Bodies:
        """Mesh a case, number its unknowns and assemble.

        Raises RunError (mesh).
        """
        mesh = Mesh(case)
        start, dim, order = time.perf_counter(), mesh.dim, int(case["order"])
        space = {name: Space(body, order) for name, body in mesh.bodies.items()}
        dam, foundation = space["dam"], space["foundation"]
        held = {"dam": [], "foundation": [unknowns(foundation.find(space["fixed"]), dim)]}
        if dim == 3 and case["hold_z"]:
            for name, body in (("dam", dam), ("foundation", foundation)):
                held[name].append(unknowns(on_sides(body, case["thickness"]), dim, [2]))
        joined = {
            n: np.unique(np.concatenate(h)) if h else np.zeros(0, int) for n, h in held.items()
        }
        return Bodies(
            mesh,
            dim,
            dam,
            foundation,
            dam.find(space["joint"]),
            foundation.find(space["joint"]),
            {name: dam.find(space[name]) for name in ("upstream", "downstream")},
            joined["dam"],
            joined["foundation"],
            elasticity(dam, dim, case["E_dam"], case["nu_dam"]),
            elasticity(foundation, dim, case["E_found"], case["nu_found"]),
            time.perf_counter() - start,
        )


def on_sides(space: Space, thickness: float) -> np.ndarray:
    """Functions that do not vanish on the z faces: nodes there, and edges that lie in a face."""
    at = [np.abs(space.body.points[:, 2] - z) < 1e-9 * thickness for z in (0, thickness)]
    edges = [
        face[space.edges].all(axis=1) if len(space.edges) else np.zeros(0, bool) for face in at
    ]
    return np.flatnonzero(np.concatenate([at[0] | at[1], edges[0] | edges[1]]))


@dataclass
class Condensed:
    """The condensed bodies: matrices on the free jump unknowns (j of them) and the responses to
    loads.
    """

    dim: int
    order: int
    base: float
    #: thickness along z [m], 1 in 2D
    width: float
    counts: dict[str, int]
    unknowns: int
    joint: Body
    faces: dict[str, Body]
    #: jump unknowns, dim * joint function + component, that are not held
    free: np.ndarray
    #: S (j, j), see above
    stiffness: np.ndarray
    #: t_0 per unit of: weight density of dam and of foundation [N/m3] along -y, (j,); force on each
    #: function of a face along the outward pressure, (j, functions)
    weight_dam: np.ndarray
    weight_foundation: np.ndarray
    pressure: dict[str, np.ndarray]
    #: the crest's displacement along x: per jump (j,), weight densities, force on a face's
    #: functions
    crest_jump: np.ndarray
    crest_weight_dam: float
    crest_weight_foundation: float
    crest_pressure: dict[str, np.ndarray]
    #: wall seconds of mesh, assembly and condensation
    seconds: dict[str, float]


def push_of_water(case: Case) -> dict[str, dict[int, float]]:
    """Direction of the water's force on the dam: {face: {component: share}}."""
    height, lean = case["dam_height"], case["dam_base"] - case["dam_crest"]
    slope = np.hypot(height, lean)
    return {"upstream": {0: 1.0}, "downstream": {0: -height / slope, 1: -lean / slope}}


def with_weight(
    stiffness: sparse.csr_matrix, space: Space, dim: int, held: np.ndarray, keep: np.ndarray
) -> np.ndarray:
    """Schur complement (k + 1, k + 1) of a body on the k unknowns `keep` and, as one more column,
    the load of a unit weight density along -y.
    """
    kept = np.setdiff1d(np.arange(stiffness.shape[0]), held)
    place = np.full(stiffness.shape[0], -1)
    place[kept] = np.arange(len(kept))
    column = sparse.csr_matrix(-body_force(space, dim, 1)[kept][:, None])
    bordered = sparse.bmat([[stiffness[kept][:, kept], column], [column.T, None]], format="csr")
    return schur_complement(bordered, np.append(place[keep], len(kept)))


def condense(case: Case, bodies: Bodies) -> Condensed:
    """Eliminate the bulk of a case."""
    start, dim, mesh = time.perf_counter(), bodies.dim, bodies.mesh

    joint = unknowns(bodies.joint_dam, dim)
    free_mask = ~np.isin(joint, bodies.held_dam)
    free = np.flatnonzero(free_mask)
    joint_dam, joint_foundation = (
        joint[free_mask],
        unknowns(bodies.joint_foundation, dim)[free_mask],
    )

    # Loaded unknowns of the dam besides the joint's: x on the upstream face, x and y on the
    # downstream face
    push = push_of_water(case)
    if not max(case.tail_levels) > 0:
        del push["downstream"]
    wanted = np.concatenate(
        [unknowns(bodies.faces[name], dim, list(c)) for name, c in push.items()]
    )
    loaded = np.setdiff1d(wanted, np.concatenate([joint, bodies.held_dam]))

    schur = with_weight(
        bodies.stiff_dam, bodies.dam, dim, bodies.held_dam, np.concatenate([joint_dam, loaded])
    )
    nj, nl = len(joint_dam), len(loaded)
    jj, jl, ll = schur[:nj, :nj], schur[:nj, nj : nj + nl], schur[nj : nj + nl, nj : nj + nl]
    weight_j, weight_l = schur[:nj, -1], schur[nj : nj + nl, -1]
    spread = linalg.solve(ll, jl.T, assume_a="pos").T  # (j, loaded)
    dam = jj - spread @ jl.T
    dam = (dam + dam.T) / 2
    force_weight = weight_j - spread @ weight_l

    schur = with_weight(
        bodies.stiff_foundation, bodies.foundation, dim, bodies.held_foundation, joint_foundation
    )
    force_weight_foundation = schur[:-1, -1].copy()

    both = linalg.cholesky(schur[:-1, :-1] + dam, lower=True, overwrite_a=True)
    half = linalg.solve_triangular(both, dam, lower=True)  # L^-1 S_d
    stiffness = dam - half.T @ half

    def transmitted(
        force_dam: np.ndarray, force_foundation: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """t_0 of forces on the two lips."""
        return force_dam - half.T @ linalg.solve_triangular(
            both, force_dam + force_foundation, lower=True
        )

    # Water on the faces: a force on a function is one on unknowns of the joint or on loaded ones
    row_of = {u: i for i, u in enumerate(loaded)}
    column_of = {u: i for i, u in enumerate(joint_dam)}
    crest = row_of[
        dim
        * int(np.argmin(np.abs(bodies.dam.body.points - [0, case["dam_height"], 0]).sum(axis=1)))
    ]
    crest_row = linalg.solve(ll, np.eye(nl)[crest], assume_a="pos")
    # crest = crest_row (forces - jl^T u_d),  u_d = delta + M^-1 (f_d + f_f - S_d delta)
    crest_lip = -(jl @ crest_row)
    crest_both = linalg.cho_solve((both, True), crest_lip)
    pressure, crest_pressure = {}, {}
    for name, components in push.items():
        on_joint = np.zeros((nj, len(bodies.faces[name])))
        on_loaded = np.zeros((nl, len(bodies.faces[name])))
        for i, function in enumerate(bodies.faces[name]):
            for component, share in components.items():
                u = dim * function + component
                if u in row_of:
                    on_loaded[row_of[u], i] += share
                elif u in column_of:
                    on_joint[column_of[u], i] += share
        force = on_joint - spread @ on_loaded
        pressure[name] = transmitted(force)
        crest_pressure[name] = crest_row @ on_loaded + crest_both @ force
    return Condensed(
        dim,
        int(case["order"]),
        case["dam_base"],
        case["thickness"] if dim == 3 else 1.0,
        mesh.counts,
        bodies.stiff_dam.shape[0]
        + bodies.stiff_foundation.shape[0]
        - len(bodies.held_dam)
        - len(bodies.held_foundation),
        mesh.bodies["joint"],
        {name: mesh.bodies[name] for name in push},
        free,
        stiffness,
        transmitted(force_weight),
        transmitted(np.zeros(nj), force_weight_foundation),
        pressure,
        crest_lip - dam @ crest_both,
        float(crest_row @ weight_l + crest_both @ force_weight),
        float(crest_both @ force_weight_foundation),
        crest_pressure,
        {
            "mesh": mesh.seconds,
            "assembly": bodies.seconds,
            "condensation": time.perf_counter() - start,
        },
    )
