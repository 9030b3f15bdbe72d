"""Files of a run's fields, for ParaView and for Gmsh."""

from __future__ import annotations

from pathlib import Path

import gmsh
import meshio
import numpy as np

from ..model.fields import OF_JOINT, Solution, joint_data
from ..model.parameters import constants, start_gmsh
from ..storage import atomic_write


def write_fields(solution: Solution, folder: Path) -> None:
    """Write, below folder, for a solution that has fields, bulk_*.vtu and joint_*.vtu per requested
    time with fields.pvd (ParaView), and bulk.msh and joint.msh with a view per field, all times in
    each (Gmsh).

    Dam and foundation have their own points on the joint, so that the opening shows.
    """
    folder.mkdir(exist_ok=True)
    result, fields, joint = solution.result, solution.fields, solution.bodies["joint"]
    bodies = {n: solution.bodies[n] for n in next(iter(fields.values())).displacement}
    points = np.concatenate([b.points for b in bodies.values()])
    cells, body, first = [], [], 0
    for own in bodies.values():
        cells += [(shape, table + first) for shape, table in own.cells]
        for region, (_, table) in zip(own.regions, own.cells, strict=True):
            body.append(np.full(len(table), int(constants()[region.upper()][0])))
        first += len(own.points)
    cuts = np.cumsum([len(c) for _, c in cells])[:-1]
    entries, joints, moved, stresses = [], {}, {}, {}
    for time, field in fields.items():
        joints[time] = joint_data(result, joint, time)
        moved[time] = np.vstack([field.displacement[n] for n in bodies])
        stresses[time] = np.vstack([field.stress[n] for n in bodies])
        bulk = meshio.Mesh(
            points,
            cells,
            point_data={"displacement": moved[time]},
            cell_data={"stress": np.split(stresses[time], cuts), "body": body},
        )
        names = f"bulk_t{time:g}.vtu", f"joint_t{time:g}.vtu"
        with atomic_write(folder / names[0]) as path:
            bulk.write(path, compression=None)
        lips = meshio.Mesh(joint.points, joint.cells, point_data=joints[time])
        with atomic_write(folder / names[1]) as path:
            lips.write(path, compression=None)
        entries += [(time, part, name) for part, name in enumerate(names)]
    lines = "".join(f'<DataSet timestep="{t!r}" part="{k}" file="{n}"/>\n' for t, k, n in entries)
    collection = f"<Collection>\n{lines}</Collection>"
    with atomic_write(folder / "fields.pvd") as path:
        path.write_text(f'<VTKFile type="Collection" version="0.1">\n{collection}\n</VTKFile>\n')
    # xx, xy, xz, yx, ...: what Gmsh calls a tensor
    tensor = [0, 3, 5, 3, 1, 4, 5, 4, 2]
    of_bulk = [
        ("displacement [m]", "NodeData", moved),
        ("stress [Pa]", "ElementData", {t: s[:, tensor] for t, s in stresses.items()}),
    ]
    with atomic_write(folder / "bulk.msh") as path:
        write_views(path, points, cells, of_bulk)
    of_joint = [
        (f"{name} [{OF_JOINT[name][0]}]", "NodeData", {t: d[name] for t, d in joints.items()})
        for name in next(iter(joints.values()))
    ]
    with atomic_write(folder / "joint.msh") as path:
        write_views(path, joint.points, joint.cells, of_joint)


#: Gmsh's numbers of the shapes of order 1.
TYPES = {"line": 1, "triangle": 2, "quad": 3, "tetra": 4, "hexahedron": 5, "wedge": 6}
DIMENSION = {"line": 1, "triangle": 2, "quad": 2, "tetra": 3, "hexahedron": 3, "wedge": 3}


def write_views(
    path: Path, points: np.ndarray, cells: list, views: list[tuple[str, str, dict]]
) -> None:
    """A mesh and views on it, with a step per time: a file for Gmsh.

    views: name, kind, values by time.
    """
    start_gmsh()
    before, own = gmsh.model.getCurrent(), "fields of damjoint"
    gmsh.model.add(own)
    tags = np.arange(1, len(points) + 1)
    entity = gmsh.model.addDiscreteEntity(DIMENSION[cells[0][0]])
    dimension = DIMENSION[cells[0][0]]
    gmsh.model.mesh.addNodes(dimension, entity, tags, points.ravel())
    first = 1
    for shape, table in cells:
        numbers = np.arange(first, first + len(table))
        gmsh.model.mesh.addElementsByType(entity, TYPES[shape], numbers, (table + 1).ravel())
        first += len(table)
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.option.setNumber("PostProcessing.SaveMesh", 0)
    gmsh.write(str(path))
    for name, kind, steps in views:
        view = gmsh.view.add(name)
        places = tags if kind == "NodeData" else np.arange(1, first)
        for step, (time, values) in enumerate(steps.items()):
            values = values.reshape(len(places), -1)
            gmsh.view.addHomogeneousModelData(
                view, step, own, kind, places, values.ravel(), time, values.shape[1]
            )
        gmsh.view.write(view, str(path), append=True)
        gmsh.view.remove(view)
    gmsh.model.setCurrent(own)
    gmsh.model.remove()
    if before in gmsh.model.list():
        gmsh.model.setCurrent(before)
