"""The elastic bodies of a case before elimination: function spaces, stiffness, unit loads."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .. import ROUND_OFF
from ..arrays import Array, IntArray, distinct, others
from ..csr import CsrMatrix
from ..input.case import Case
from ..input.scene import LINES, MATERIALS, POINT, TRACTION
from ..mesh.body import Body
from ..mesh.mesh import Mesh, mesh_of
from ..model.loads import COMPLETE, across, thermal_strains, wet
from .elasticity import Distribution, Material, at_middles, body_force, elasticity, thermal_load
from .elements import WATER, Space, points_of

#: Weights that act, region and component: concrete also along x (earthquake).
WEIGHTS = (("dam", 0), ("dam", 1), ("lower", 0), ("lower", 1), ("foundation", 1))


def material_of(case: Case) -> Material:
    """Elastic constants by region."""
    return {region: (case[f"E_{name}"], case[f"nu_{name}"]) for region, name in MATERIALS.items()}


@dataclass(frozen=True, kw_only=True)
class ElasticBody:
    """A linear elastic body of n degrees of freedom, dim * function + component."""

    space: Space
    #: (n, n) [N/m]
    stiffness: CsrMatrix
    #: load vectors (n,) by name: weight densities dam_x, dam_y, lower_x, ... [N/m3], forces per
    #: metre of a line ice_x, ice_y, ... [N/m], tractions [Pa], thermal strains dam_uniform, ... [-]
    unit_loads: dict[str, Array]
    #: thermal strains of those of unit_loads at the middle of each element (elements,)
    unit_strains: dict[str, Array]
    #: degrees of freedom: zero, and those of them along z on the end faces; on each of its joints,
    #: by number and whether the body is above it, in the joint's order; of each wet face, in its
    #: order
    fixed_dofs: IntArray
    fixed_along_z: IntArray
    joint_dofs: dict[tuple[int, bool], IntArray]
    face_dofs: dict[str, IntArray]

    @property
    def free_stiffness(self) -> CsrMatrix:
        """The stiffness of the degrees of freedom that are not fixed."""
        free = others(self.stiffness.shape[0], self.fixed_dofs)
        return self.stiffness[free].columns(free)

    @staticmethod
    def of(case: Case, mesh: Mesh, name: str) -> ElasticBody:
        """Number the degrees of freedom of a body and assemble it."""
        dim, order = mesh.dim, int(case["order"])
        body = mesh.solids[name]
        space = Space(body, order)

        def dofs(part: Body, components: Sequence[int] = range(dim)) -> IntArray:
            functions = space.find(Space(part, order))
            return np.ravel(dim * functions[:, None] + np.array(components))

        material = material_of(case)
        strains = {n: s for n, s in unit_strains(case).items() if s[0] in body.regions}
        thermal = {n: thermal_load(space, dim, material, *s) for n, s in strains.items()}
        along_z = np.zeros(0, int)
        if dim == 3 and case["hold_z"]:
            along_z = distinct(dofs(within(mesh.bodies["sides"], body), [2]))
        return ElasticBody(
            space=space,
            stiffness=elasticity(space, dim, material),
            unit_loads=dict(unit_loads(space, mesh, name)) | thermal,
            unit_strains={n: at_middles(space, *strain) for n, strain in strains.items()},
            fixed_dofs=distinct(
                np.concatenate([dofs(within(mesh.bodies["fixed"], body)), along_z])
            ),
            fixed_along_z=along_z,
            joint_dofs={
                (number, above): dofs(joint.face(above))
                for number, joint in enumerate(mesh.joints)
                for above, owner in ((True, joint.upper), (False, joint.lower))
                if name == owner
            },
            face_dofs={
                n: dofs(face.surface)
                for n, face in mesh.faces.items()
                if face.body == name and wet(case, face.side, face.lowest)
            },
        )


def unit_loads(space: Space, mesh: Mesh, name: str) -> Iterator[tuple[str, Array]]:
    """Names and load vectors (n,) of the unit loads that can act on a body."""
    dim = mesh.dim
    for region, component in WEIGHTS:
        if region in space.body.regions:
            yield f"{region}_{'xyz'[component]}", body_force(space, dim, component, region)
    for line in (*LINES, TRACTION):
        if line in mesh.bodies and mesh.bearer(line) == name:
            part = Space(mesh.bodies[line], space.order)
            points = points_of(part, WATER)
            for component in (0, 1):
                load = np.zeros(dim * len(space.locations))
                load[dim * space.find(part) + component] = points.values.T @ points.weights
                yield f"{line}_{'xyz'[component]}", load


def unit_strains(case: Case) -> dict[str, tuple[str, Distribution]]:
    """Region and distribution of the thermal strains of a case, by name."""
    distributions: dict[str, Distribution] = {
        "uniform": lambda positions: np.ones(len(positions)),
        "linear": lambda positions: across(case, positions),
    }
    names = [name.split("_") for name in thermal_strains(case, COMPLETE)]
    return {f"{region}_{form}": (region, distributions[form]) for region, form in names}


def within(surface: Body, body: Body) -> Body:
    """The part of a surface that belongs to a body."""
    inside = np.isin(surface.node_tags, body.node_tags)
    cells = [(shape, table[inside[table].all(axis=1)]) for shape, table in surface.cells]
    used = distinct(np.concatenate([table.ravel() for _, table in cells]))
    number = np.zeros(len(surface.points), int)
    number[used] = np.arange(len(used))
    return Body(
        surface.points[used],
        surface.node_tags[used],
        [(shape, number[table]) for shape, table in cells],
        np.zeros(0, int),
    )


@dataclass(frozen=True, kw_only=True)
class Bodies:
    """The bodies of a case on one mesh."""

    mesh: Mesh
    by_name: dict[str, ElasticBody]
    #: wall seconds of their assembly
    seconds: float
    #: regions whose displacements are needed besides the crest's, see `measures`
    measured: tuple[str, ...] = ()

    @staticmethod
    def of(case: Case) -> Bodies:
        """Mesh a case and assemble its bodies. Raises RunError (mesh)."""
        mesh = mesh_of(case)
        start = time.perf_counter()
        by_name = {name: ElasticBody.of(case, mesh, name) for name in mesh.solids}
        measured = (POINT,) * (POINT in mesh.bodies)
        seconds = time.perf_counter() - start
        return Bodies(mesh=mesh, by_name=by_name, seconds=seconds, measured=measured)

    def loaded_dofs(self, name: str) -> IntArray:
        """Degrees of freedom of the wet faces of a body that a pressure loads: none along an axis
        that every normal of the face is perpendicular to, and no fixed ones.
        """
        body, dim, dofs = self.by_name[name], self.mesh.dim, [np.zeros(0, int)]
        for face, of_face in body.face_dofs.items():
            normals = self.mesh.faces[face].surface.normals[:, :dim]
            loaded = np.abs(normals).max(axis=0) > ROUND_OFF
            dofs.append(of_face.reshape(-1, dim)[:, loaded].ravel())
        every = distinct(np.concatenate(dofs))
        return every[~np.isin(every, body.fixed_dofs)]

    @property
    def crest(self) -> tuple[str, int]:
        """The body that bears the crest, and the crest's degree of freedom along x."""
        name, mesh = self.mesh.bearer("crest"), self.mesh
        functions = self.by_name[name].space.find(Space(mesh.bodies["crest"], 1))
        return name, int(functions[0]) * mesh.dim

    @property
    def measures(self) -> dict[str, tuple[str, Array]]:
        """Displacements that may be prescribed or printed, each a body and what they are of its
        degrees of freedom (n,): crest, along x; point_x, point_y, ..., those that unit forces on a
        region do work on, over the thickness: of the controlled point the mean over its line in 3D.
        """
        body, crest = self.crest
        row = np.zeros(self.by_name[body].stiffness.shape[0])
        row[crest] = 1.0
        measures = {"crest": (body, row)}
        for region in self.measured:
            bearer, width = self.mesh.bearer(region), self.mesh.joints[0].width
            loads = self.by_name[bearer].unit_loads
            measures |= {n: (bearer, loads[n] / width) for n in (f"{region}_x", f"{region}_y")}
        return measures

    @property
    def without_supports(self) -> Bodies:
        """The same bodies, fixed along z on the end faces only."""
        free = {n: replace(b, fixed_dofs=b.fixed_along_z) for n, b in self.by_name.items()}
        return replace(self, by_name=free)
