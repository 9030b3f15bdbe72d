"""Files of a run's fields, for ParaView and for Gmsh."""

from __future__ import annotations

import base64
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..arrays import Table
from ..fem import elements
from ..input.parameters import constants, start_gmsh
from ..mesh.body import Body
from ..model.fields import OF_JOINT, Field, Solution, joint_body, joint_data
from ..storage import atomic_write

#: Element types of order 1 in Gmsh by shape: number, dimension.
ELEMENTS = {
    "line": (1, 1),
    "triangle": (2, 2),
    "quad": (3, 2),
    "tetra": (4, 3),
    "hexahedron": (5, 3),
    "wedge": (6, 3),
}
#: Cell types of VTK by shape.
VTK_TYPES = {"line": 3, "triangle": 5, "quad": 9, "tetra": 10, "hexahedron": 12, "wedge": 13}
#: Corners of a wedge in the order of VTK, whose first triangle points outwards.
VTK_WEDGE = [0, 2, 1, 3, 5, 4]
#: Cells of order 2: VTK's type, and the pairs of corners in whose middles their further nodes are.
QUADRATIC = {
    "line3": (21, "01"),
    "triangle6": (22, "01 12 20"),
    "quad9": (28, "01 12 23 30 02"),
    "tetra10": (24, "01 12 20 03 13 23"),
    "wedge18": (32, "01 12 20 34 45 53 03 14 25 04 15 23"),
    "hexahedron27": (29, "01 12 23 30 45 56 67 74 04 15 26 37 07 16 05 36 02 46 06"),
}
VTK_TYPES |= {shape: number for shape, (number, _) in QUADRATIC.items()}
#: Components xx, xy, xz, yx, ... of a Gmsh tensor among those of `Field.stress`.
TENSOR = [0, 3, 5, 3, 1, 4, 5, 4, 2]

#: Names of the blocks in ParaView, by those of the files.
BLOCKS = {"bulk": "bodies", "joint": "joints"}
#: Names of fields with their units; the level is a value of the whole file.
DISPLACEMENT, STRESS, LEVEL = "displacement [m]", "stress [Pa]", "level [m]"

Cells = list[tuple[str, np.ndarray]]
#: A field on a mesh: name, kind (NodeData or ElementData), values by time.
View = tuple[str, str, dict[float, np.ndarray]]


def write_fields(solution: Solution, folder: Path) -> None:
    """Write the fields of a solution below folder: bulk_*.vtu and joint_*.vtu per requested time
    with fields.pvd (ParaView); bulk.msh and joint.msh with a view per field, all times in each
    (Gmsh).

    Dam and foundation have their own points on the joint, so that the opening is visible; the
    points of a joint move with the body below it. For ParaView the cells are quadratic where the
    fields have displacements at their midpoints.
    """
    folder.mkdir(exist_ok=True)
    fields, order = solution.fields, 2 if next(iter(solution.fields.values())).at_midpoints else 1
    bodies = {n: solution.bodies[n] for n in next(iter(fields.values())).displacement}
    surfaces = [joint_body(solution.bodies, k) for k in range(len(solution.result.joints))]
    fine = {name: of_order(body, order) for name, body in bodies.items()}
    points = np.concatenate([body.points for body in fine.values()])
    cells, regions = bulk_cells(fine)
    displacement = {t: np.vstack([f.displacement[n] for n in bodies]) for t, f in fields.items()}
    stress = {t: np.vstack([f.stress[n] for n in bodies]) for t, f in fields.items()}
    fine_surfaces = [of_order(surface, order) for surface in surfaces]
    joint = joined(fine_surfaces)
    on_joint = {time: joints_data(solution, fine_surfaces, time) for time in fields}

    for time, field in fields.items():
        whole = {LEVEL: solution.result.at(time)["level"][:1]}
        smallest, _, largest = principal(stress[time]).T
        in_elements = {
            STRESS: stress[time],
            "largest principal stress [Pa]": largest,
            "smallest principal stress [Pa]": smallest,
            "body": regions,
        }
        at_nodes = {DISPLACEMENT: np.vstack([everywhere(field, n) for n in bodies])}
        write_vtu(folder / f"bulk_t{time:g}.vtu", points, cells, at_nodes, in_elements, whole)
        on_faces = {
            DISPLACEMENT: displacement_of_joints(solution, field, order),
            "opening [m]": np.maximum(on_joint[time]["jump"][:, 1], 0),
            **{with_unit(name): values for name, values in on_joint[time].items()},
        }
        path = folder / f"joint_t{time:g}.vtu"
        write_vtu(path, joint.points, joint.cells, on_faces, {}, whole)
    write_collection(folder, fields)
    bulk_views: list[View] = [
        (DISPLACEMENT, "NodeData", displacement),
        (STRESS, "ElementData", {t: s[:, TENSOR] for t, s in stress.items()}),
    ]
    corners = np.concatenate(
        [
            np.arange(len(f.points)) < len(c.points)
            for f, c in zip(fine_surfaces, surfaces, strict=True)
        ]
    )
    joint_views: list[View] = [
        (with_unit(name), "NodeData", {t: d[name][corners] for t, d in on_joint.items()})
        for name in OF_JOINT
        if name in next(iter(on_joint.values()))
    ]
    with atomic_write(folder / "bulk.msh") as path:
        of_bodies = np.concatenate([body.points for body in bodies.values()])
        write_views(path, of_bodies, bulk_cells(bodies)[0], bulk_views)
    with atomic_write(folder / "joint.msh") as path:
        linear = joined(surfaces)
        write_views(path, linear.points, linear.cells, joint_views)


def everywhere(field: Field, body: str) -> np.ndarray:
    """Displacement (n, 3) [m] of a body at its nodes and, where they are known, its midpoints."""
    parts = [field.displacement[body], field.at_midpoints.get(body, np.zeros((0, 3)))]
    return np.concatenate(parts)


def of_order(body: Body, order: int) -> Body:
    """A body with cells of an order; order 2: its points are its nodes and, after them, the
    midpoints of `elements.Space`.
    """
    if order == 1:
        return body
    space = elements.Space(body, 2)
    cells = []
    for shape, table in space.connectivity:
        name = f"{shape}{table.shape[1]}"
        corners = elements.corners_of(shape)
        middles = elements.locations_of(shape, 2)[len(corners) :]
        pairs = [tuple(map(int, pair)) for pair in QUADRATIC[name][1].split()]
        of_pairs = [(corners[a] + corners[b]) / 2 for a, b in pairs]
        indices = [int(np.abs(middles - at).sum(axis=1).argmin()) for at in of_pairs]
        order_of_vtk = [*range(len(corners)), *(len(corners) + k for k in indices)]
        cells.append((name, table[:, order_of_vtk]))
    return replace(body, points=space.locations, cells=cells)


def joined(surfaces: Sequence[Body]) -> Body:
    """Surfaces as one."""
    starts = np.cumsum([0, *(len(surface.points) for surface in surfaces)])
    return Body(
        np.concatenate([surface.points for surface in surfaces]),
        np.concatenate([surface.node_tags for surface in surfaces]),
        [
            (shape, table + start)
            for start, surface in zip(starts, surfaces, strict=False)
            for shape, table in surface.cells
        ],
        np.concatenate([surface.element_tags for surface in surfaces]),
    )


def joints_data(solution: Solution, surfaces: Sequence[Body], time: float) -> Table:
    """The tables of all joints at the points of their surfaces, see `joint_data`; nan where a joint
    has no such column.
    """
    parts = []
    for k, (joint, surface) in enumerate(zip(solution.result.joints, surfaces, strict=True)):
        number = np.full(len(surface.points), k + 1.0)
        parts.append(joint_data(joint, surface, time) | {"joint": number})
    names = [name for name in (*OF_JOINT, "joint") if any(name in part for part in parts)]
    missing = [np.full(len(part["joint"]), np.nan) for part in parts]
    return {
        name: np.concatenate([p.get(name, m) for p, m in zip(parts, missing, strict=True)])
        for name in names
    }


def with_unit(name: str) -> str:
    """The name of an array of a joint with its unit: jump [m]; joint, a number, has none."""
    return f"{name} [{OF_JOINT[name][0]}]" if name in OF_JOINT else name


def displacement_of_joints(solution: Solution, field: Field, order: int) -> np.ndarray:
    """Displacement (n, 3) [m] of the bodies below the joints, at the points of all joints."""
    parts = []
    lower_bodies = [joint.lower for joint in solution.result.case.of_joints] or ["foundation"]
    for k, lower in enumerate(lower_bodies):
        below, surface = solution.bodies[lower], joint_body(solution.bodies, k)
        nodes = elements.Space(below, order).find(elements.Space(surface, order))
        parts.append(everywhere(field, lower)[nodes])
    return np.concatenate(parts)


def principal(stress: np.ndarray) -> np.ndarray:
    """Principal stresses (n, 3), ascending, of stresses (n, 6): xx, yy, zz, xy, yz, xz."""
    return np.linalg.eigvalsh(stress[:, TENSOR].reshape(-1, 3, 3))


def bulk_cells(bodies: dict[str, Body]) -> tuple[Cells, np.ndarray]:
    """Collect the cells of bodies with common point numbers, and the region number of each cell
    (n,).
    """
    cells, regions, first = [], [], 0
    for name, body in bodies.items():
        cells += [(shape, table + first) for shape, table in body.cells]
        for region, (_, table) in zip(body.regions, body.cells, strict=True):
            regions.append(np.full(len(table), number_of(name, region)))
        first += len(body.points)
    return cells, np.concatenate(regions)


def number_of(body: str, region: str) -> int:
    """Number of a body's region: 1 dam, 1001 dam 2, ..."""
    _, _, which = body.partition(" ")
    layer = int(constants()["LAYER"][0]) * (int(which) - 1 if which else 0)
    return int(constants()[region.upper()][0]) + layer


def write_vtu(
    path: Path,
    points: np.ndarray,
    cells: Cells,
    point_data: Mapping[str, np.ndarray],
    cell_data: Mapping[str, np.ndarray],
    field_data: Mapping[str, np.ndarray],
) -> None:
    """Write a mesh with its data for ParaView, in VTK's XML format: arrays in base64, each after
    the number of its bytes.

    points: (n, 3); point_data, cell_data: arrays (n,) or (n, components) by name; field_data:
    arrays (1,) of the whole file.
    """
    counts = [len(table) for _, table in cells]
    corners = np.repeat([table.shape[1] for _, table in cells], counts)
    topology = {
        "connectivity": np.concatenate(
            [(t[:, VTK_WEDGE] if shape == "wedge" else t).ravel() for shape, t in cells]
        ),
        "offsets": np.cumsum(corners),
        "types": np.repeat([VTK_TYPES[shape] for shape, _ in cells], counts),
    }
    parts = {
        "Points": {"Points": points},
        "Cells": topology,
        "PointData": point_data,
        "CellData": cell_data,
    }
    content = "".join(data_arrays(tag, arrays) for tag, arrays in parts.items())
    order = f'byte_order="{sys.byteorder.title()}Endian" header_type="UInt64"'
    lines = [
        f'<VTKFile type="UnstructuredGrid" version="1.0" {order}>',
        f"<UnstructuredGrid>\n{data_arrays('FieldData', field_data)}"
        f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{sum(counts)}">',
        f"{content}</Piece>",
        "</UnstructuredGrid>",
        "</VTKFile>",
    ]
    with atomic_write(path) as part:
        part.write_text("\n".join(lines) + "\n")


def data_arrays(tag: str, arrays: Mapping[str, np.ndarray]) -> str:
    """XML element of arrays by name."""
    return f"<{tag}>\n{''.join(data_array(*item) for item in arrays.items())}</{tag}>\n"


def data_array(name: str, values: np.ndarray) -> str:
    """XML element of an array of floats or integers (n,) or (n, components), with its length, which
    VTK reads in FieldData.
    """
    kind = {"f": "Float", "i": "Int"}[values.dtype.kind] + str(8 * values.itemsize)
    size = f'NumberOfTuples="{len(values)}"'
    if values.ndim > 1:
        size += f' NumberOfComponents="{values.shape[1]}"'
    text = base64.b64encode(np.uint64(values.nbytes).tobytes() + values.tobytes()).decode()
    return f'<DataArray type="{kind}" Name="{name}" {size} format="binary">{text}</DataArray>\n'


def write_collection(folder: Path, fields: dict[float, Field]) -> None:
    """Write fields.pvd, which lists the .vtu files of all times."""
    entries = [
        f'<DataSet timestep="{time!r}" name="{block}" part="{part}" file="{name}_t{time:g}.vtu"/>\n'
        for time in fields
        for part, (name, block) in enumerate(BLOCKS.items())
    ]
    collection = f"<Collection>\n{''.join(entries)}</Collection>"
    with atomic_write(folder / "fields.pvd") as path:
        path.write_text(f'<VTKFile type="Collection" version="0.1">\n{collection}\n</VTKFile>\n')


def write_views(path: Path, points: np.ndarray, cells: Cells, views: list[View]) -> None:
    """Write a mesh with views, a step per time, for Gmsh."""
    gmsh = start_gmsh()
    before, scratch = gmsh.model.getCurrent(), "fields of damjoint"
    gmsh.model.add(scratch)
    tags = np.arange(1, len(points) + 1)
    dimension = ELEMENTS[cells[0][0]][1]
    entity = gmsh.model.addDiscreteEntity(dimension)
    gmsh.model.mesh.addNodes(dimension, entity, tags, points.ravel())
    first = 1
    for shape, table in cells:
        numbers = np.arange(first, first + len(table))
        gmsh.model.mesh.addElementsByType(entity, ELEMENTS[shape][0], numbers, (table + 1).ravel())
        first += len(table)
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.option.setNumber("PostProcessing.SaveMesh", 0)
    gmsh.write(str(path))
    for name, kind, steps in views:
        view = gmsh.view.add(name)
        numbers = tags if kind == "NodeData" else np.arange(1, first)
        for step, (time, values) in enumerate(steps.items()):
            values = values.reshape(len(numbers), -1)
            gmsh.view.addHomogeneousModelData(
                view, step, scratch, kind, numbers, values.ravel(), time, values.shape[1]
            )
        gmsh.view.write(view, str(path), append=True)
        gmsh.view.remove(view)
    gmsh.model.setCurrent(scratch)
    gmsh.model.remove()
    if before in gmsh.model.list():
        gmsh.model.setCurrent(before)
