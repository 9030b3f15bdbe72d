"""Fields of a run: displacement and stress in the bodies, jump, stress and state on the joint; for ParaView and Gmsh."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import gmsh
import meshio
import numpy as np
from scipy import sparse

from . import fem
from .condense import Bodies, push_of_water, unknowns
from .condensed import Joint
from .factor import solve_symmetric
from .mesh import Body, Mesh
from .parameters import start_gmsh
from .results import Results, rows_at

BODIES = ("dam", "foundation")


@dataclass
class Field:
    """The bulk at one time: displacement (nodes, 3) [m] and stress (elements, 6) [Pa] by body.

    Stress: xx, yy, zz, xy, yz, xz at the middle of each element.
    """

    displacement: dict[str, np.ndarray]
    stress: dict[str, np.ndarray]


def read_table(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """GetDP's NodeTable or ElementTable with one value set each: numbers and values."""
    table = np.loadtxt(path, skiprows=1, ndmin=2)
    return table[:, 0].astype(int), table[:, 1:]


def pick(numbers: np.ndarray, values: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """The values that belong to the wanted numbers."""
    order = np.argsort(numbers)
    return values[order[np.searchsorted(numbers, wanted, sorter=order)]]


def from_getdp(result: Results, mesh: Mesh, work: Path) -> dict[float, Field]:
    """The fields that GetDP has left in its folder, by time."""
    found = {}
    for index, time in enumerate(result.case.times, 1):
        if not (work / f"u_dam_{index}.txt").exists():
            continue
        numbers, stress = read_table(work / f"stress_{index}.txt")
        stress = stress[:, [0, 3, 5, 1, 4, 2]]
        found[time] = Field({n: pick(*read_table(work / f"u_{n}_{index}.txt"), mesh.bodies[n].node_tags) for n in BODIES},
                            {n: pick(numbers, stress, mesh.bodies[n].element_tags) for n in BODIES})
    return found


def recover(result: Results, mesh: Mesh, joint: Joint) -> dict[float, Field]:
    """The fields of the condensed engine by time: the bulk solved once more, the jump given.

    Dam and foundation glued at the joint are one elastic body, loaded besides by the forces that the jump
    needs in the dam, -K_dam jump; the water in the joint acts on both lips and cancels.
    """
    case, dim = result.case, mesh.dim
    bodies = Bodies.of(case, mesh)
    stiff_dam, stiff_foundation = bodies.stiffness(case)
    sizes = stiff_dam.shape[0], stiff_foundation.shape[0]
    # glue: each unknown of the dam in the numbering of the whole, the foundation's first
    glue = np.full(sizes[0], -1)
    glue[unknowns(bodies.joint_dam, dim)] = unknowns(bodies.joint_foundation, dim)
    own = np.flatnonzero(glue < 0)
    glue[own] = sizes[1] + np.arange(len(own))
    total = sizes[1] + len(own)
    spread = sparse.csr_matrix((np.ones(sizes[0]), (np.arange(sizes[0]), glue)), (sizes[0], total))
    whole = sparse.block_diag([stiff_foundation, sparse.csr_matrix((len(own), len(own)))]) + spread.T @ stiff_dam @ spread
    held = np.union1d(bodies.held_foundation, glue[bodies.held_dam])
    free = np.setdiff1d(np.arange(total), held)
    weight = [-case["g"] * case[f"rho_{short}"] * fem.body_force(space, dim, 1)
              for short, space in (("dam", bodies.dam), ("found", bodies.foundation))]
    push = push_of_water(case)
    jumps, rights = [], []
    for _, jump, level, tail in result.states:
        whole_jump = np.zeros(sizes[0])
        whole_jump[unknowns(bodies.joint_dam, dim)[joint.bulk.free]] = jump
        load = weight[0] - stiff_dam @ whole_jump
        for name, water in (("upstream", level), ("downstream", tail)):
            if name in joint.interface.faces:
                force = joint.face_forces(name, water)[0]
                for component, share in push[name].items():
                    np.add.at(load, dim * bodies.faces[name] + component, share * force)
        rights.append((spread.T @ load + np.concatenate([weight[1], np.zeros(len(own))]))[free])
        jumps.append(whole_jump)
    solution = np.zeros((total, len(rights)))
    if rights:
        solution[free] = solve_symmetric(whole.tocsr()[free][:, free], np.column_stack(rights))
    found = {}
    for (time, *_), jump, u in zip(result.states, jumps, solution.T, strict=True):
        moved = {"dam": (u[glue] + jump).reshape(-1, dim), "foundation": u[: sizes[1]].reshape(-1, dim)}
        spaces = {"dam": bodies.dam, "foundation": bodies.foundation}
        material = {"dam": (case["E_dam"], case["nu_dam"]), "foundation": (case["E_found"], case["nu_found"])}
        found[time] = Field(
            {n: np.pad(v[: len(spaces[n].body.points)], ((0, 0), (0, 3 - dim))) for n, v in moved.items()},
            {n: fem.stress(spaces[n], v, *material[n]) for n, v in moved.items()})
    return found


def joint_data(result: Results, body: Body, time: float) -> dict[str, np.ndarray]:
    """The joint's table at its mesh nodes: jump and traction as vectors along x, y, z, and pressure, damage, slip."""
    rows = rows_at(result.joint, time)
    nearest = np.argmin((body.points[:, None, 0] - rows["x"]) ** 2 + (body.points[:, None, 2] - rows["z"]) ** 2, axis=1)
    vectors = {"jump": ("delta_t1", "delta_n", "delta_t2"), "traction": ("tau_1", "sigma_n", "tau_2")}
    data = {name: np.column_stack([rows[c][nearest] for c in columns]) for name, columns in vectors.items()}
    return data | {name: rows[name][nearest] for name in ("p", "damage", "slip")}


def write_fields(result: Results, mesh: Mesh, fields: dict[float, Field], folder: Path) -> None:
    """Write fields/: bulk_*.vtu and joint_*.vtu per requested time with fields.pvd, and *.pos views for Gmsh.

    Dam and foundation have their own points on the joint, so that the opening shows.
    """
    folder.mkdir(exist_ok=True)
    dam, foundation, joint = (mesh.bodies[n] for n in (*BODIES, "joint"))
    points = np.vstack([dam.points, foundation.points])
    cells = dam.cells + [(shape, c + len(dam.points)) for shape, c in foundation.cells]
    cuts = np.cumsum([len(c) for _, c in cells])[:-1]
    entries, joints = [], {}
    for time, field in fields.items():
        joints[time] = joint_data(result, joint, time)
        stress = np.vstack([field.stress[n] for n in BODIES])
        meshio.Mesh(points, cells, point_data={"displacement": np.vstack([field.displacement[n] for n in BODIES])},
                    cell_data={"stress": np.split(stress, cuts)}).write(folder / f"bulk_t{time:g}.vtu")
        meshio.Mesh(joint.points, joint.cells, point_data=joints[time]).write(folder / f"joint_t{time:g}.vtu")
        entries += [(time, 0, f"bulk_t{time:g}.vtu"), (time, 1, f"joint_t{time:g}.vtu")]
    lines = "".join(f'<DataSet timestep="{t!r}" part="{part}" file="{name}"/>\n' for t, part, name in entries)
    (folder / "fields.pvd").write_text(f'<VTKFile type="Collection" version="0.1">\n<Collection>\n{lines}</Collection>\n</VTKFile>\n')
    if not fields:
        return
    moved = [np.vstack([f.displacement[n] for n in BODIES]) for f in fields.values()]
    write_view("displacement", points, cells, [[u[c] for _, c in cells] for u in moved], folder)
    tensors = [np.split(np.vstack([f.stress[n] for n in BODIES])[:, [0, 3, 5, 3, 1, 4, 5, 4, 2]], cuts) for f in fields.values()]
    write_view("stress", points, cells, [[np.repeat(s[:, None], c.shape[1], 1) for s, (_, c) in zip(t, cells, strict=True)]
                                         for t in tensors], folder)
    for name in next(iter(joints.values())):
        columns = [d[name] if d[name].ndim > 1 else d[name][:, None] for d in joints.values()]
        write_view(name, joint.points, joint.cells, [[v[c] for _, c in joint.cells] for v in columns], folder)


#: Letters of Gmsh's list data: shape, and kind by number of components.
LETTERS = {"line": "L", "triangle": "T", "quad": "Q", "tetra": "S", "wedge": "I", "hexahedron": "H"}
KINDS = {1: "S", 3: "V", 9: "T"}


def write_view(name: str, points: np.ndarray, cells: list, steps: list[list[np.ndarray]], folder: Path) -> None:
    """One Gmsh view with a step per time: name.pos. steps: per time, per block of cells, values (e, nodes, components)."""
    start_gmsh()
    view = gmsh.view.add(name)
    for block, (shape, table) in enumerate(cells):
        place = points[table].transpose(0, 2, 1).reshape(len(table), -1)
        values = [s[block].reshape(len(table), -1) for s in steps]
        data = np.hstack([place, *values])
        gmsh.view.addListData(view, KINDS[steps[0][block].shape[2]] + LETTERS[shape], len(table), data.ravel())
    gmsh.view.write(view, str(folder / f"{name}.pos"))
    gmsh.view.remove(view)
