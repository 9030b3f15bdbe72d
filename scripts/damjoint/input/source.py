"""What a case is made from, and what differs from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from .. import InputError
from ..arrays import Setting, Settings, Value
from . import casefile
from .parameters import (
    checked,
)
from .values import flows as flows
from .values import freezes_uplift as freezes_uplift
from .values import has_drains as has_drains


@dataclass(frozen=True)
class Source:
    """What a case is made from: the statements of a case file, and what differs from them; all but
    the first two as in `load`.
    """

    path: Path
    text: casefile.CaseText
    overrides: dict[str, Setting]
    levels: str | Sequence[float] | None = None
    tail_levels: str | Sequence[float] | None = None
    steps: int | None = None
    accuracy: str | None = None

    def check_lists(self, joints: Sequence[str]) -> None:
        """Raise InputError if a list has not one value for each joint of a geometry, by their
        names.
        """
        overrides = {name: checked(name, value) for name, value in self.overrides.items()}
        for name, values in lists_of_joints({**self.text.of_joints, **overrides}).items():
            if len(values) != len(joints):
                raise InputError(
                    f"{name} = {','.join(map(str, values))}: must be one value, or one for each "
                    f"joint of the geometry ({len(joints)}: {', '.join(joints)})"
                )

    def with_overrides(self, overrides: Settings) -> Source:
        """The source with further overrides, which win."""
        return replace(self, overrides={**self.overrides, **overrides})


def lists_of_joints(settings: Settings) -> dict[str, tuple[Value, ...]]:
    """The settings that are lists, with a value for each joint."""
    return {n: v for n, v in settings.items() if isinstance(v, tuple)}
