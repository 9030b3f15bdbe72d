"""Values of all parameters by name: case["mu"], case.mu."""

from __future__ import annotations

from collections.abc import ItemsView, Iterator, KeysView
from typing import TYPE_CHECKING, Literal, TypeAlias, overload

from ..arrays import Value, Values

#: The parameters whose values are texts, for type checkers: all others are numbers.
TextName: TypeAlias = (
    Literal["law", "uplift", "softening", "drain_reference", "face_load", "force_face"]
    | Literal["drive", "drive_load", "drive_direction", "drive_face", "mesh_pattern", "quadrature"]
    | Literal["record_unit", "record_component", "record_baseline", "time_integration"]
    | Literal["quake_uplift", "required_position"]
)


class ParameterValues:
    """The values of all parameters, automatic ones resolved: a mapping, also by attributes."""

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


def listed(values: Values) -> str:
    """Values by name as text: mu = 0.8, law = bond."""
    return ", ".join(
        f"{name} = {value if isinstance(value, str) else format(value, 'g')}"
        for name, value in values.items()
    )


def level_unknown(values: Values | ParameterValues) -> bool:
    """Whether the reservoir's level is unknown, and a displacement prescribed."""
    return values["drive"] != "level" and values["drive_load"] == "level"


def factor_unknown(values: Values | ParameterValues) -> bool:
    """Whether the factor of a load is unknown, and a displacement prescribed."""
    return values["drive"] != "level" and values["drive_load"] != "level"


def has_point(values: Values | ParameterValues) -> bool:
    """Whether the displacement of a point is prescribed or, under dissipation control, recorded."""
    return values["drive"] in ("point", "dissipation")


def flows(values: Values | ParameterValues) -> bool:
    """Whether the water pressure in the joint depends on its opening."""
    return values["uplift"] in ("cracked", "flow")


def flows_in_time(values: Values | ParameterValues) -> bool:
    """Whether water flows in the joint, needs time for it, and is stored there."""
    return bool(flows(values) and values["time_unit"])


def has_drains(values: Values | ParameterValues) -> bool:
    """Whether drains lower the water pressure in the joint."""
    return values["uplift"] == "drained" or bool(flows(values) and values["drains"])


def freezes_uplift(values: Values | ParameterValues) -> bool:
    """Whether a joint's pressure in a pseudo-static earthquake follows from the joint before it."""
    mode, uplift = values["quake_uplift"], values["uplift"]
    if uplift == "none" or not (values["k_h"] or values["k_v"]):
        return False
    return mode == "zero" or (mode == "unchanged" and flows(values))
