"""Meshes of a case, made by Gmsh from geo/*.geo."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from .. import InputError, RunError
from ..arrays import IntArray, Setting
from ..input.case import Case
from ..input.constraints import check_levels_on_mesh, check_strain
from ..input.geometry_file import FileStates, file_states
from ..input.parameters import constants, start_gmsh
from ..input.scene import POINT, Joint, numbered, stacked
from ..input.values import has_point
from ..storage import check_end
from .body import Body
from .completeness import check
from .cut import cut
from .generate import generate, shares
from .joint_mesh import Face, JointMesh
from .regions import (
    LOADED,
    SHAPES,
    USER_FACES,
    USER_NAMES,
    FaceRegion,
    dimension,
    section_regions,
    user_regions,
)
from .sides import is_inside, outward, selected_part, sides
from .topology import inner_ends
from .user_geometry import NamedFace, UserGeometry

#: Limit of the joint's element tags: six digits in the keys of GetDP's internal variables.
MOST_TAGS = 1_000_000


@dataclass(frozen=True)
class GeometryFiles:
    """The files of a user's own geometry in their present state, and all else its mesh depends
    on: the parameters of a section's mesh, and those that a .geo file names.
    """

    files: FileStates
    parameters: tuple[tuple[str, Setting], ...]
    #: for making the mesh
    case: Case = field(compare=False)


@lru_cache(maxsize=1)
def mesh_of_files(geometry: GeometryFiles) -> Mesh:
    """The mesh of a user's own geometry, stored: its fingerprint is needed before the run."""
    return Mesh(geometry.case)


def mesh_of(case: Case) -> Mesh:
    """The mesh of a case; a user's own geometry is read again unless it is Gmsh's current mesh."""
    if not case.geometry:
        return Mesh(case)
    files, words = file_states(case.geometry)
    used = shares(case) | {n: v for n, v in case.values.items() if n in words}
    geometry = GeometryFiles(files, tuple(used.items()), case)
    mesh = mesh_of_files(geometry)
    if not mesh.is_current:
        mesh_of_files.cache_clear()
        mesh = mesh_of_files(geometry)
    check_loads(case, mesh)
    return mesh


def crest_level(case: Case) -> float:
    """Level of the crest [m]; of a user's own geometry the highest of its concrete."""
    if case.geometry:
        return mesh_of(case).user_geometry.reach[1]
    return float(case["dam_height"])


def check_loads(case: Case, mesh: Mesh) -> None:
    """Raise InputError if the mesh of a user's own geometry lacks what a load or support of the
    case acts on, or if its levels or lists of values are not those of this dam.
    """
    for name, region in LOADED.items():
        needed = case[name] and (name != "hold_z" or mesh.dim == 3)
        if needed and region not in mesh.bodies:
            group = {what: n for n, what in USER_NAMES.items()}[region]
            raise InputError(
                f"{name} = {case[name]:g}: must be 0, or geometry = {case.geometry} have the "
                f"region {group}"
            )
    if has_point(case) and POINT not in mesh.bodies:
        raise InputError(
            f"drive = {case['drive']}: must be another one, or geometry = {case.geometry} have the "
            "region point"
        )
    if case.source:
        case.source.check_lists([joint.name for joint in mesh.joints])
    low, high = mesh.user_geometry.reach
    check_strain(case, high - low)
    if case["face_load"] == "hydrostatic":
        for name, levels in (("levels", case.levels), ("tail_levels", case.tail_levels)):
            check_levels_on_mesh(name, levels, low, high)


class Mesh:
    """The mesh of a case: solids by name, joints from the lowest, faces, number of nodes; in
    `bodies` solids, joints and the other REGIONS.

    Raises RunError with Gmsh's message if there is no mesh for the parameters, InputError if a
    user's own geometry is unsuitable.
    """

    def __init__(self, case: Case) -> None:
        gmsh = start_gmsh()
        start = time.perf_counter()
        self.dim, self.geometry = int(case["dim"]), case.geometry
        generate(case)
        #: Gmsh's name of it
        self.model = gmsh.model.getFileName()
        self._read()
        geometry = self.geometry
        regions = user_regions(geometry, self.dim) if geometry else section_regions(case)
        names, bodies, faces = regions
        # from the highest: a line force at the end of a joint acts on the body above it
        dams = [name for name in bodies if name.split(" ")[0] == "dam"]
        solids = [*reversed(dams), "foundation"]
        groups = {name: [(name.split(" ")[0], bodies.pop(name))] for name in solids}
        if "lower" in bodies:
            groups["foundation"].append(("lower", bodies.pop("lower")))
        groups |= {name: [(name, tag)] for name, tag in bodies.items()}
        self.bodies = {
            name: self._body(dimension(name, self.dim), parts) for name, parts in groups.items()
        }
        self.solids = {name: self.bodies[name] for name in solids}
        scene = self._user_scene(names) if self.geometry else stacked(names)
        surfaces = [self._body(self.dim - 1, [(f"face{i}", f.tag)]) for i, f in enumerate(faces)]
        if self.geometry:
            self.user_geometry = self._checked(self.geometry, scene, faces, surfaces)
        self.joints = [
            JointMesh(
                dim=self.dim,
                surface=self.bodies[joint.region],
                heel=self.bodies[joint.heel],
                toe=self.bodies[joint.toe],
                upper=joint.upper,
                lower=joint.lower,
                name=joint.name,
                upper_tags=self._cut(joint),
            )
            for joint in scene
        ]
        if self.geometry:
            self._mark_junctions()
        self.faces: dict[str, Face] = {}
        for face, surface in zip(faces, surfaces, strict=True):
            for body, part in self._by_body(surface, face.body):
                self.faces[f"face{len(self.faces)}"] = Face(part, body, *face[2:])
        #: whether a face of a user's own geometry is part of several bodies
        self.divided = len(self.faces) > len(faces)
        #: elements of joints and faces of a user's own geometry that are numbered the other way
        #: round than Gmsh did
        self.turned: list[int] = []
        self._turn_outwards()
        last = max(joint.surface.element_tags.max() for joint in self.joints)
        if last >= MOST_TAGS:
            raise RunError(
                f"mesh: joint element tag {last}: must be below {MOST_TAGS}; use a coarser mesh"
            )
        #: wall seconds of meshing
        self.seconds = time.perf_counter() - start

    @property
    def is_current(self) -> bool:
        """Whether it is Gmsh's current mesh, which `write` writes."""
        gmsh = start_gmsh()
        return bool(gmsh.model.getFileName() == self.model)

    def _checked(
        self, file: Path, scene: list[Joint], faces: list[FaceRegion], surfaces: list[Body]
    ) -> UserGeometry:
        """The regions of a user's own geometry, complete."""
        kinds = {what: name for name, what in USER_FACES.items()}
        named = [
            NamedFace(kinds[face.body, face.side], face.body, face.side, surface)
            for face, surface in zip(faces, surfaces, strict=True)
        ]
        regions = {name: body for name, body in self.bodies.items() if name not in self.solids}
        geometry = UserGeometry(file, self.dim, regions, self.solids, scene, named)
        check(geometry)
        return geometry

    def _user_scene(self, names: tuple[str, ...]) -> list[Joint]:
        """The joints of a user's own geometry, each between the two bodies that share it.

        The lower one is the foundation; of two others, that on the right of the line from heel to
        toe or, of a joint that faces along z, that of the lower z.
        """
        if len(names) == 1 and len(self.solids) == 2:
            return stacked(names)
        scene = []
        for k, name in enumerate(names):
            surface = self.bodies[numbered("joint", k)]
            beside = [n for n, solid in self.solids.items() if sides(surface, solid).all()]
            if len(beside) == 1 and is_inside(surface, self.solids[beside[0]]):
                beside *= 2
            if len(beside) != 2:
                listed = " and ".join(beside) or "none"
                raise self._bad(
                    f"joint {name}: must lie between two bodies, or inside one (a conforming mesh);"
                    f" its elements are sides of {listed}"
                )
            upper, lower = beside
            normals = outward(surface, self.solids[lower])
            parts = [numbered(part, k) for part in ("joint", "heel", "toe")]
            ends = [self.bodies[part].points.mean(axis=0) for part in parts[1:]]
            if lower not in ("foundation", upper) and normals:
                mean, (heel, toe) = normals[0].mean(axis=0), ends
                chord = toe - heel
                if np.abs(mean[:2]).max() < abs(mean[2]):
                    upwards = mean[2]
                else:  # the normal from the lower body is on the left of the line
                    upwards = chord[0] * mean[1] - chord[1] * mean[0]
                if upwards < 0:
                    upper, lower = lower, upper
            scene.append(Joint(name, upper, lower, *parts))
        return scene

    def _cut(self, joint: Joint) -> IntArray:
        """Tags of a joint's nodes in the body above it, after a body that it is inside of is cut.

        Above is then the left of the line from heel to toe; in 3D larger y or, of a joint that
        faces along x or z, larger x or z.
        """
        surface = self.bodies[joint.region]
        if joint.upper != joint.lower:
            return surface.node_tags.copy()
        for name, other in self.bodies.items():
            same = name in (joint.upper, joint.region, joint.heel, joint.toe)
            if not same and np.isin(surface.node_tags, other.node_tags).any():
                raise self._bad(f"joint {joint.name}: inside a body it must not touch {name}")
        normals = surface.unit_normals()
        heel, toe = (self.bodies[name].points.mean(axis=0) for name in (joint.heel, joint.toe))
        if self.dim == 2:
            chord = toe - heel
            signs = np.sign(normals @ [-chord[1], chord[0], 0.0])
        else:
            largest = np.abs(normals.mean(axis=0)).argmax()
            signs = np.sign(normals[:, largest])
        last = max(body.node_tags.max() for body in self.solids.values())
        body, tags = cut(self.solids[joint.upper], surface, normals * signs[:, None], int(last) + 1)
        ends = np.concatenate([self.bodies[n].node_tags for n in (joint.heel, joint.toe)])
        at_ends = np.isin(surface.node_tags, ends)
        if (tags[at_ends] != surface.node_tags[at_ends]).any():
            raise self._bad(f"joint {joint.name}: inside a body it must not touch its surface")
        self.bodies[joint.upper] = self.solids[joint.upper] = body
        return tags

    def _mark_junctions(self) -> None:
        """Mark the joints that meet, and their ends that lie at other joints."""
        surfaces = [joint.surface for joint in self.joints]
        count = np.bincount(np.concatenate([s.node_tags for s in surfaces]).astype(int))
        ends = [end for joint in self.joints for end in (joint.heel, joint.toe)]
        if count.max() == 1:
            return
        inner = inner_ends(ends, surfaces, self.user_geometry.surface)
        self.joints = [
            replace(
                joint,
                meets=bool((count[joint.surface.node_tags] > 1).any()),
                inner_ends=np.union1d(*inner[2 * k : 2 * k + 2]),
            )
            for k, joint in enumerate(self.joints)
        ]

    def _by_body(self, surface: Body, body: str) -> list[tuple[str, Body]]:
        """A surface of the bodies of a kind, dam or foundation, divided by its body."""
        bodies = [name for name in self.solids if name.split(" ")[0] == body]
        if not self.geometry or len(bodies) == 1:
            return [(body, surface)]
        masks = {name: sides(surface, self.solids[name]) for name in bodies}
        if not np.any(list(masks.values()), axis=0).all():
            raise self._bad(f"a face of the {body}: its elements must be sides of its bodies'")
        return [(n, selected_part(surface, mask)) for n, mask in masks.items() if mask.any()]

    def _bad(self, why: str) -> InputError:
        """The error of a user's own geometry."""
        return InputError(f"geometry = {self.geometry}: {why}")

    def _read(self) -> None:
        """Read the nodes of Gmsh's current mesh."""
        gmsh = start_gmsh()
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        self.nodes = len(tags)
        self._place = np.zeros(int(tags.max(initial=0)) + 1, int)
        self._place[tags] = np.arange(len(tags))
        self._coordinates = coordinates.reshape(-1, 3)

    def _body(self, dimension: int, parts: list[tuple[str, int]]) -> Body:
        """The body of some regions (name, number of the physical group)."""
        gmsh = start_gmsh()
        blocks: dict[tuple[str, int], list[IntArray]] = {}
        numbers: dict[tuple[str, int], list[IntArray]] = {}
        for name, group in parts:
            for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, group):
                for kind, elements, nodes in zip(
                    *gmsh.model.mesh.getElements(dimension, entity), strict=True
                ):
                    block = nodes.reshape(len(elements), -1)
                    blocks.setdefault((name, kind), []).append(block)
                    numbers.setdefault((name, kind), []).append(elements)
        if not blocks:
            raise RunError(f"mesh: nothing in {parts[0][0]}; look at the geometry's proportions")
        flat = np.concatenate([b.ravel() for block in blocks.values() for b in block])
        used, cells = np.unique(flat, return_inverse=True)
        shapes: list[tuple[str, IntArray]] = []
        start = 0
        for (_, kind), block in blocks.items():
            table = np.vstack(block)
            if kind not in SHAPES:
                raise self._bad(f"elements of Gmsh's type {kind}: must be of order 1")
            shapes.append((SHAPES[kind], cells[start : start + table.size].reshape(table.shape)))
            start += table.size
        return Body(
            self._coordinates[self._place[used]],
            used,
            shapes,
            np.concatenate([t for n in numbers.values() for t in n]),
            [name for name, _ in blocks],
        )

    def _turn_outwards(self) -> None:
        """Give the joint normals from foundation to dam, and faces normals out of their bodies."""
        gmsh = start_gmsh()
        kinds = {kind: name for name, kind in USER_FACES.items()}
        surfaces = [("joint", joint.surface, self.solids[joint.lower]) for joint in self.joints]
        for face in self.faces.values():
            kind = "foundation" if face.body == "foundation" else "dam"
            surfaces.append((kinds[kind, face.side], face.surface, self.solids[face.body]))
        for name, surface, body in surfaces:
            normals = outward(surface, body)
            if normals is None:
                raise self._bad(f"{name}: its elements must be sides of its body's (conforming)")
            surface.normals, turned = normals
            if self.geometry and turned.any():  # for GetDP, which goes by the elements
                self.turned.extend(surface.element_tags[turned])
                gmsh.model.mesh.reverseElements(surface.element_tags[turned])

    def bearer(self, line: str) -> str:
        """The highest body with all nodes of crest or line of LINES: the force acts on it."""
        nodes = self.bodies[line].node_tags
        bearers = (n for n, s in self.solids.items() if np.isin(nodes, s.node_tags).all())
        return next(bearers, self.joints[0].lower)

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of nodes, elements (of the solids) and joint_elements."""
        joints = [joint.surface for joint in self.joints]
        return {
            "nodes": self.nodes,
            "elements": sum(len(solid.element_tags) for solid in self.solids.values()),
            "joint_elements": sum(len(surface.element_tags) for surface in joints),
        }

    def face_entities(self) -> list[list[int]]:
        """Gmsh's curves or surfaces of each of `faces`; the mesh must be Gmsh's current one.

        Raises InputError if one of them is part of several bodies.
        """
        gmsh, faces = start_gmsh(), list(self.faces.values())
        entities: list[list[int]] = [[] for _ in faces]
        for _, entity in gmsh.model.getEntities(self.dim - 1):
            parts = gmsh.model.mesh.getElements(self.dim - 1, entity)[1]
            tags = np.concatenate([np.zeros(0, int), *parts])
            for of_face, face in zip(entities, faces, strict=True):
                within = np.isin(tags, face.surface.element_tags)
                if within.any() and not within.all():
                    raise self._bad(
                        f"a face of {face.body}: must have curves or surfaces of its own with "
                        "engine = getdp, divided where the body ends"
                    )
                if within.any():
                    of_face.append(entity)
        return entities

    def divide_faces(self) -> None:
        """Give each of `faces` a physical group of its own, numbered as in pro/section.pro."""
        gmsh, first = start_gmsh(), int(constants()["SEGMENT"][0])
        entities, d = self.face_entities(), self.dim - 1
        gmsh.model.removePhysicalGroups([(d, first + i) for i in range(len(entities))])
        for i, of_face in enumerate(entities):
            gmsh.model.addPhysicalGroup(d, of_face, first + i)

    def add_node_points(self) -> None:
        """Make the nodes of each joint points of a physical group, see pro/flow_in_time.pro."""
        gmsh, first, layer = start_gmsh(), *(int(constants()[n][0]) for n in ("NODES", "LAYER"))
        highest = int(gmsh.model.mesh.getMaxElementTag())
        for k, joint in enumerate(self.joints):
            nodes, point = joint.surface.node_tags, gmsh.model.addDiscreteEntity(0)
            tags = highest + 1 + np.arange(len(nodes))
            gmsh.model.mesh.addElementsByType(point, 15, tags, nodes)
            gmsh.model.addPhysicalGroup(0, [point], first + k * layer)
            highest += len(nodes)

    def write(self, path: Path, node_points: bool = False) -> None:
        """Write the mesh, which must be Gmsh's current one, for GetDP (MSH 2.2, binary).

        node_points: with points at the nodes of the joints. Raises OSError if the disk is full,
        which Gmsh does not report; InputError as `face_entities`.
        """
        gmsh = start_gmsh()
        if node_points:
            self.add_node_points()
        if self.divided:
            self.divide_faces()
        gmsh.option.setNumber("Mesh.MshFileVersion", 2.2)
        # else elements are renumbered, shape by shape
        gmsh.option.setNumber("Mesh.PreserveNumberingMsh2", 1)
        gmsh.option.setNumber("Mesh.Binary", 1)
        gmsh.write(str(path))
        check_end(path, "$EndElements\n")
