"""Values of all parameters, by name and by section: case["mu"], case.joint.mu."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, overload

from ..arrays import Value, Values
from .parameters import declared

#: The parameters whose values are texts, for type checkers: all others are numbers.
TextName: TypeAlias = Literal[
    "law", "uplift", "face_load", "drive", "mesh_pattern", "quadrature", "force_face"
]


class Section:
    """The values of one group of pro/parameters.pro: numbers, but for those that a subclass names.

    Not to be changed: a case is.
    """

    def __init__(self, values: Values) -> None:
        vars(self).update(values)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"{name}: values of a case can not be set")

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> float: ...


class Scene(Section):
    """Dimension and order, joint law, water, and what is prescribed."""

    law: str
    uplift: str
    face_load: str
    drive: str


class MeshSize(Section):
    """Pattern and sizes of the mesh."""

    mesh_pattern: str
    quadrature: str


class Loads(Section):
    """Loads besides the water."""

    force_face: str


class ParameterValues:
    """The values of all parameters, those that follow others resolved."""

    values: dict[str, Value]

    @overload
    def __getitem__(self, name: TextName) -> str: ...  # type: ignore[overload-overlap]

    @overload
    def __getitem__(self, name: str) -> float: ...

    def __getitem__(self, name: str) -> Value:
        return self.values[name]

    def _group(self, name: str) -> dict[str, Value]:
        """The values of a group of parameters."""
        return {n: self.values[n] for n, known in declared().items() if known.group == name}

    @cached_property
    def scene(self) -> Scene:
        """Dimension and order, joint law, water, and what is prescribed."""
        return Scene(self._group("Scene"))

    @cached_property
    def dimensions(self) -> Section:
        """Lengths of the dam's section and of its foundation."""
        return Section(self._group("Geometry"))

    @cached_property
    def mesh(self) -> MeshSize:
        """Pattern and sizes of the mesh."""
        return MeshSize(self._group("Mesh"))

    @cached_property
    def material(self) -> Section:
        """Elasticity and density of dam and foundation."""
        return Section(self._group("Bulk"))

    @cached_property
    def joint(self) -> Section:
        """Stiffness, strength and fracture energy of the joint."""
        return Section(self._group("Joint"))

    @cached_property
    def water(self) -> Section:
        """Density and viscosity of the water, aperture of the closed joint, drains."""
        return Section(self._group("Water"))

    @cached_property
    def loads(self) -> Loads:
        """Loads besides the water, works on the joint."""
        return Loads(self._group("Loads"))

    @cached_property
    def solver(self) -> Section:
        """Tolerance and limits of the solver."""
        return Section(self._group("Solver"))

    @cached_property
    def checks(self) -> Section:
        """Safety factors and strength that are required."""
        return Section(self._group("Checks"))


def flows(values: Values | ParameterValues) -> bool:
    """Whether the water pressure in the joint depends on its opening."""
    return values["uplift"] in ("cracked", "flow")


def has_drains(values: Values | ParameterValues) -> bool:
    """Whether drains lower the water pressure in the joint."""
    return values["uplift"] == "drained" or bool(flows(values) and values["drains"])
