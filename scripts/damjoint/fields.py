"""Fields of a run for ParaView (.vtu, .pvd) and, as GetDP has written them, for Gmsh (.pos)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import gmsh
import meshio
import numpy as np

from .parameters import start_gmsh
from .results import Results, rows_at

#: Gmsh element types of order 1 by their VTK name.
SHAPES = {1: "line", 2: "triangle", 3: "quad", 4: "tetra", 5: "hexahedron", 6: "wedge"}
DAM, FOUNDATION, JOINT = 1, 2, 3


@dataclass
class Body:
    """One body of the mesh: points (n, 3), their node tags, cells by shape, element tags in that order."""

    points: np.ndarray
    node_tags: np.ndarray
    cells: list[tuple[str, np.ndarray]]
    element_tags: np.ndarray


def read_bodies(mesh_file: Path, dim: int) -> dict[int, Body]:
    """The dam, the foundation (dimension dim) and the joint (dim - 1) of a mesh file, by physical tag."""
    start_gmsh()
    gmsh.clear()
    gmsh.open(str(mesh_file))
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    place = np.zeros(int(tags.max()) + 1, int)
    place[tags] = np.arange(len(tags))
    coordinates = coordinates.reshape(-1, 3)
    bodies = {}
    for group, dimension in ((DAM, dim), (FOUNDATION, dim), (JOINT, dim - 1)):
        blocks, numbers = {}, {}
        for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, group):
            for kind, elements, nodes in zip(*gmsh.model.mesh.getElements(dimension, entity), strict=True):
                blocks.setdefault(kind, []).append(nodes.reshape(len(elements), -1))
                numbers.setdefault(kind, []).append(elements)
        used, cells = np.unique(np.concatenate([b.ravel() for block in blocks.values() for b in block]), return_inverse=True)
        shapes, start = [], 0
        for kind, block in blocks.items():
            table = np.vstack(block)
            shapes.append((SHAPES[kind], cells[start : start + table.size].reshape(table.shape)))
            start += table.size
        bodies[group] = Body(coordinates[place[used]], used, shapes, np.concatenate([t for n in numbers.values() for t in n]))
    return bodies


def read_table(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """GetDP's NodeTable or ElementTable with one value set each: numbers and values."""
    table = np.loadtxt(path, skiprows=1, ndmin=2)
    return table[:, 0].astype(int), table[:, 1:]


def pick(numbers: np.ndarray, values: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """The values that belong to the wanted numbers."""
    order = np.argsort(numbers)
    return values[order[np.searchsorted(numbers, wanted, sorter=order)]]


def displacement(bodies: dict[int, Body], work: Path, index: int) -> dict[int, np.ndarray]:
    """Displacement [m] at the points of dam and foundation, by physical tag."""
    names = {DAM: "u_dam", FOUNDATION: "u_foundation"}
    return {g: pick(*read_table(work / f"{n}_{index}.txt"), bodies[g].node_tags) for g, n in names.items()}


def write_fields(result: Results, mesh_file: Path, folder: Path) -> None:
    """Write fields/: bulk_*.vtu (displacement, stress) and joint_*.vtu per requested time, fields.pvd, and keep GetDP's .pos views.

    Dam and foundation have their own points on the joint, so that the opening shows. Stress: xx, yy, zz, xy,
    yz, xz at the middle of each element [Pa].
    """
    case, work, target = result.case, folder / "work", folder / "fields"
    target.mkdir(exist_ok=True)
    bodies = read_bodies(mesh_file, int(case["dim"]))
    offset = len(bodies[DAM].points)
    points = np.vstack([bodies[DAM].points, bodies[FOUNDATION].points])
    cells = bodies[DAM].cells + [(shape, c + offset) for shape, c in bodies[FOUNDATION].cells]
    elements = np.concatenate([bodies[DAM].element_tags, bodies[FOUNDATION].element_tags])
    cuts = np.cumsum([len(c) for _, c in cells])[:-1]
    sets = []
    for index, time in enumerate(case.times, 1):
        if not (work / f"u_dam_{index}.txt").exists():
            continue
        moved = displacement(bodies, work, index)
        numbers, stress = read_table(work / f"stress_{index}.txt")
        stress = pick(numbers, stress, elements)[:, [0, 3, 5, 1, 4, 2]]
        meshio.Mesh(points, cells, point_data={"displacement": np.vstack([moved[DAM], moved[FOUNDATION]])},
                    cell_data={"stress": np.split(stress, cuts)}).write(target / f"bulk_t{time:g}.vtu")
        joint, rows = bodies[JOINT], rows_at(result.joint, time)
        nearest = np.argmin((joint.points[:, None, 0] - rows["x"]) ** 2 + (joint.points[:, None, 2] - rows["z"]) ** 2, axis=1)
        data = {"jump": ("delta_t1", "delta_n", "delta_t2"), "traction": ("tau_1", "sigma_n", "tau_2")}
        point_data = {name: np.column_stack([rows[c][nearest] for c in columns]) for name, columns in data.items()}
        point_data |= {name: rows[name][nearest] for name in ("p", "damage", "slip")}
        meshio.Mesh(joint.points, joint.cells, point_data=point_data).write(target / f"joint_t{time:g}.vtu")
        sets += [(time, 0, f"bulk_t{time:g}.vtu"), (time, 1, f"joint_t{time:g}.vtu")]
        for view in work.glob(f"*_{index}.pos"):
            view.replace(target / f"{view.name.rsplit('_', 1)[0]}_t{time:g}.pos")
    lines = "".join(f'<DataSet timestep="{t!r}" part="{part}" file="{name}"/>\n' for t, part, name in sets)
    (target / "fields.pvd").write_text(f'<VTKFile type="Collection" version="0.1">\n<Collection>\n{lines}</Collection>\n</VTKFile>\n')
