"""Values of all parameters, by name and by group: case["mu"], case.joint.mu."""

from __future__ import annotations

from collections.abc import ItemsView, Iterator, KeysView
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, overload

from ..arrays import Value, Values
from .parameters import declared

#: The parameters whose values are texts, for type checkers: all others are numbers.
TextName: TypeAlias = Literal[
    "law",
    "uplift",
    "face_load",
    "drive",
    "mesh_pattern",
    "quadrature",
    "force_face",
    "drain_reference",
    "quake_uplift",
    "required_position",
    "record_unit",
    "record_component",
    "record_baseline",
    "time_integration",
]


class Group:
    """The values of one group of pro/parameters.pro as attributes that can not be set: numbers, but
    for those that a subclass declares.
    """

    def __init__(self, values: Values) -> None:
        vars(self).update(values)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"{name}: values of a case can not be set")

    def __repr__(self) -> str:
        return listed(vars(self))

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> float: ...


class SceneGroup(Group):
    """Dimension and order, joint law, water, and what is prescribed."""

    law: str
    uplift: str
    face_load: str
    drive: str


class MeshGroup(Group):
    """Pattern and sizes of the mesh."""

    mesh_pattern: str
    quadrature: str


class WaterGroup(Group):
    """Density and viscosity of the water, aperture of the closed joint, drains."""

    drain_reference: str


class LoadGroup(Group):
    """Loads besides the water."""

    force_face: str
    quake_uplift: str


class CheckGroup(Group):
    """Safety factors, position of the resultant and strength that are required."""

    required_position: str


class EarthquakeGroup(Group):
    """Record of the ground, time integration, damping."""

    record_unit: str
    record_component: str
    record_baseline: str
    time_integration: str


class ParameterValues:
    """The values of all parameters, those that follow others resolved: a mapping, whose values are
    attributes, too.
    """

    values: dict[str, Value]

    @overload
    def __getitem__(self, name: TextName) -> str: ...  # type: ignore[overload-overlap]

    @overload
    def __getitem__(self, name: str) -> float: ...

    def __getitem__(self, name: str) -> Value:
        return self.values[name]

    def __contains__(self, name: object) -> bool:
        return name in self.values

    def __iter__(self) -> Iterator[str]:
        return iter(self.values)

    def __len__(self) -> int:
        return len(self.values)

    def keys(self) -> KeysView[str]:
        """Names of all parameters."""
        return self.values.keys()

    def items(self) -> ItemsView[str, Value]:
        """All parameters: name and value."""
        return self.values.items()

    def get(self, name: str, default: Value | None = None) -> Value | None:
        """The value of a parameter, or the default if there is no parameter of this name."""
        return self.values.get(name, default)

    if not TYPE_CHECKING:  # a type checker shall report unknown attributes

        def __getattr__(self, name: str) -> Value:
            values = vars(self).get("values", {})  # empty while it is copied
            if name in values and not hasattr(type(self), name):
                return values[name]
            raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.values]

    def _ipython_key_completions_(self) -> list[str]:
        return list(self.values)

    def _group(self, name: str) -> dict[str, Value]:
        """The values of a group of parameters."""
        return {n: self.values[n] for n, known in declared().items() if known.group == name}

    @cached_property
    def scene(self) -> SceneGroup:
        """Dimension and order, joint law, water, and what is prescribed."""
        return SceneGroup(self._group("Scene"))

    @cached_property
    def dimensions(self) -> Group:
        """Lengths of the dam's section and of its foundation."""
        return Group(self._group("Geometry"))

    @cached_property
    def mesh(self) -> MeshGroup:
        """Pattern and sizes of the mesh."""
        return MeshGroup(self._group("Mesh"))

    @cached_property
    def material(self) -> Group:
        """Elasticity and density of dam and foundation."""
        return Group(self._group("Bulk"))

    @cached_property
    def joint(self) -> Group:
        """Stiffness, strength and fracture energy of the joint."""
        return Group(self._group("Joint"))

    @cached_property
    def water(self) -> WaterGroup:
        """Density and viscosity of the water, aperture of the closed joint, drains."""
        return WaterGroup(self._group("Water"))

    @cached_property
    def loads(self) -> LoadGroup:
        """Loads besides the water, works on the joint."""
        return LoadGroup(self._group("Loads"))

    @cached_property
    def earthquake(self) -> EarthquakeGroup:
        """Record of the ground, time integration, damping."""
        return EarthquakeGroup(self._group("Earthquake"))

    @cached_property
    def solver(self) -> Group:
        """Tolerance and limits of the solver."""
        return Group(self._group("Solver"))

    @cached_property
    def checks(self) -> CheckGroup:
        """Safety factors, position of the resultant and strength that are required."""
        return CheckGroup(self._group("Checks"))


def listed(values: Values) -> str:
    """Values by name as text: mu = 0.8, law = bond."""
    return ", ".join(
        f"{name} = {value if isinstance(value, str) else format(value, 'g')}"
        for name, value in values.items()
    )


def flows(values: Values | ParameterValues) -> bool:
    """Whether the water pressure in the joint depends on its opening."""
    return values["uplift"] in ("cracked", "flow")


def has_drains(values: Values | ParameterValues) -> bool:
    """Whether drains lower the water pressure in the joint."""
    return values["uplift"] == "drained" or bool(flows(values) and values["drains"])


def freezes_uplift(values: Values | ParameterValues) -> bool:
    """Whether the water pressure in the joint during a pseudo-static earthquake follows from the
    joint before it.
    """
    mode, uplift = values["quake_uplift"], values["uplift"]
    if uplift == "none" or not (values["k_h"] or values["k_v"]):
        return False
    return mode == "zero" or (mode == "unchanged" and flows(values))
