"""Files of a run's fields, for ParaView and for Gmsh."""

from __future__ import annotations

import base64
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from ..arrays import Table
from ..fem import elements
from ..input.parameters import constants, start_gmsh
from ..input.scene import numbered
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

#: Names of fields with their units; the level is a value of the whole file.
DISPLACEMENT, STRESS, LEVEL = "displacement [m]", "stress [Pa]", "level [m]"

Cells = list[tuple[str, np.ndarray]]
#: A field on a mesh: name, kind (NodeData or ElementData), values by time.
View = tuple[str, str, dict[float, np.ndarray]]


def write_fields(solution: Solution, folder: Path) -> None:
    """Write the fields of a solution below folder: a .vtu file for each body, joint and requested
    time with fields.pvd (ParaView); bulk.msh and joint.msh with a view per field, all times in each
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
    fine_surfaces = [of_order(surface, order) for surface in surfaces]
    regions = {name: bulk_cells({name: body})[1] for name, body in bodies.items()}
    pairs = list(zip(solution.result.joints, fine_surfaces, strict=True))
    on_joints = {t: [joint_data(joint, surface, t) for joint, surface in pairs] for t in fields}
    for time, field in fields.items():
        whole = {LEVEL: solution.result.at(time)["level"][:1]}
        for name, body in fine.items():
            smallest, _, largest = principal(field.stress[name]).T
            in_elements = {
                STRESS: field.stress[name],
                "largest principal stress [Pa]": largest,
                "smallest principal stress [Pa]": smallest,
                "body": regions[name],
            }
            at_nodes = {DISPLACEMENT: everywhere(field, name)}
            path = field_path(folder, name, time)
            write_vtu(path, body.points, body.cells, at_nodes, in_elements, whole)
        for k, surface in enumerate(fine_surfaces):
            on_faces = {
                DISPLACEMENT: displacement_of_joint(solution, field, k, order),
                "opening [m]": np.maximum(on_joints[time][k]["jump"][:, 1], 0),
                **{with_unit(name): values for name, values in on_joints[time][k].items()},
            }
            path = field_path(folder, numbered("joint", k), time)
            write_vtu(path, surface.points, surface.cells, on_faces, {}, whole)
    write_collection(solution, [*reversed(bodies)], folder)
    displacement = {t: np.vstack([f.displacement[n] for n in bodies]) for t, f in fields.items()}
    stress = {t: np.vstack([f.stress[n] for n in bodies]) for t, f in fields.items()}
    bulk_views: list[View] = [
        (DISPLACEMENT, "NodeData", displacement),
        (STRESS, "ElementData", {t: s[:, TENSOR] for t, s in stress.items()}),
    ]
    at_nodes_of_all = {time: joined_data(on_joints[time], surfaces) for time in fields}
    joint_views: list[View] = [
        (with_unit(name), "NodeData", {t: d[name] for t, d in at_nodes_of_all.items()})
        for name in OF_JOINT
        if name in next(iter(at_nodes_of_all.values()))
    ]
    with atomic_write(folder / "bulk.msh") as path:
        points = np.concatenate([body.points for body in bodies.values()])
        write_views(path, points, bulk_cells(bodies)[0], bulk_views)
    with atomic_write(folder / "joint.msh") as path:
        joint = joined(surfaces)
        write_views(path, joint.points, joint.cells, joint_views)


def field_path(folder: Path, part: str, time: float) -> Path:
    """File for ParaView of a body or joint at a time: dam_2_t1.5.vtu."""
    return folder / f"{part.replace(' ', '_')}_t{time:g}.vtu"


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
        middles = elements.function_locations(shape, 2)[len(corners) :]
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


def joined_data(parts: Sequence[Table], surfaces: Sequence[Body]) -> Table:
    """The tables of all joints, see `joint_data`, at the nodes of their surfaces, which come first
    in each; nan where a joint has no such column.
    """
    pairs = [(p, np.full(len(s.points), np.nan)) for p, s in zip(parts, surfaces, strict=True)]
    return {
        name: np.concatenate([part.get(name, none)[: len(none)] for part, none in pairs])
        for name in OF_JOINT
        if any(name in part for part in parts)
    }


def with_unit(name: str) -> str:
    """The name of an array of a joint with its unit: jump [m]."""
    return f"{name} [{OF_JOINT[name][0]}]"


def displacement_of_joint(solution: Solution, field: Field, joint: int, order: int) -> np.ndarray:
    """Displacement (n, 3) [m] of the body below a joint, by its number from 0, at its points."""
    of_joints = solution.result.case.of_joints
    lower = of_joints[joint].lower if of_joints else "foundation"
    below, surface = solution.bodies[lower], joint_body(solution.bodies, joint)
    nodes = elements.Space(below, order).find(elements.Space(surface, order))
    return everywhere(field, lower)[nodes]


def principal(stress: np.ndarray) -> np.ndarray:
    """Principal stresses (n, 3), ascending, of stresses (n, 6): xx, yy, zz, xy, yz, xz."""
    return np.linalg.eigvalsh(stress[:, TENSOR].reshape(-1, 3, 3))


def bulk_cells(bodies: dict[str, Body]) -> tuple[Cells, np.ndarray]:
    """Cells of bodies with common point numbers, and the region number of each cell (n,)."""
    cells, regions, first = [], [], 0
    for name, body in bodies.items():
        cells += [(shape, table + first) for shape, table in body.cells]
        for region, (_, table) in zip(body.regions, body.cells, strict=True):
            regions.append(np.full(len(table), region_number(name, region)))
        first += len(body.points)
    return cells, np.concatenate(regions)


def region_number(body: str, region: str) -> int:
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


def write_collection(solution: Solution, bodies: Sequence[str], folder: Path) -> None:
    """Write fields.pvd: the .vtu files of all times, with the names of their bodies and joints."""
    blocks = block_names(solution, bodies)
    entries = [
        f'<DataSet timestep="{shown!r}" name={quoteattr(block)} part="{part}" '
        f'file="{field_path(folder, name, time).name}"/>\n'
        for time, shown in shown_times(solution).items()
        for part, (name, block) in enumerate(blocks.items())
    ]
    collection = f"<Collection>\n{''.join(entries)}</Collection>"
    with atomic_write(folder / "fields.pvd") as path:
        path.write_text(f'<VTKFile type="Collection" version="0.1">\n{collection}\n</VTKFile>\n')


def block_names(solution: Solution, bodies: Sequence[str]) -> dict[str, str]:
    """Names of the bodies and joints for ParaView, by those of the mesh: of a section with lifts
    `dam above lift 12 m`, `joint lift 12 m`.
    """
    case = solution.result.case
    above = {j.upper: f"dam above {j.name}" for j in case.of_joints if not case.geometry}
    joints = {
        numbered("joint", k): f"joint {case.named((k,))}".strip()
        for k in range(len(solution.result.joints))
    }
    return {name: above.get(name, name) for name in bodies} | joints


def shown_times(solution: Solution) -> dict[float, float]:
    """The time that ParaView shows for each time of the fields: the reservoir level [m] where it
    rises from each to the next and loads have no time of their own, else the time itself.
    """
    times = [*solution.fields]
    levels = [float(solution.result.at(time)["level"][0]) for time in times]
    case = solution.result.case
    rises = bool(np.all(np.diff(levels) > 0)) and not case["time_unit"]
    return dict(zip(times, levels if rises else times, strict=True))


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
