"""Modes of the water pressure in the joint."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..arrays import Values

if TYPE_CHECKING:
    from .case import Case


def flows(values: Values | Case) -> bool:
    """Whether the water pressure in the joint depends on its opening."""
    return values["uplift"] in ("cracked", "flow")


def has_drains(values: Values | Case) -> bool:
    """Whether drains lower the water pressure in the joint."""
    return values["uplift"] == "drained" or bool(flows(values) and values["drains"])
