"""What a case is made from, and what differs from it."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path

from .. import InputError
from ..arrays import Setting, Settings, Value
from . import casefile
from .parameters import checked, of_one_joint, parameter


@dataclass(frozen=True)
class Source:
    """What a case is made from: statements of a case file, and what differs, see `load`."""

    path: Path
    text: casefile.CaseText
    overrides: dict[str, Setting]
    levels: str | Sequence[float] | None = None
    tail_levels: str | Sequence[float] | None = None
    steps: int | None = None
    accuracy: str | None = None

    def check_lists(self, joints: Sequence[str]) -> None:
        """Raise InputError if a list has not one value for each named joint of a geometry."""
        overrides = {name: checked(name, value) for name, value in self.overrides.items()}
        for name, values in lists_of_joints({**self.text.of_joints, **overrides}).items():
            if len(values) != len(joints):
                raise InputError(
                    f"{name} = {','.join(map(str, values))}: must be one value, or one for each "
                    f"joint of the geometry ({len(joints)}: {', '.join(joints)})"
                )

    def blocks(self, names: Sequence[str]) -> dict[str, dict[str, Value]]:
        """The values of single joints by their keys, without those that overrides replace.

        names: of the joints of a section; empty for a geometry of one's own. Where overrides move
        the joints of the file, each keeps its values; without lifts only the first has any.
        """
        given = {
            key: {name: value for name, value in values.items() if name not in self.overrides}
            for key, values in self.text.blocks.items()
        }
        if names and {"lift_heights", "joint_height"} & self.overrides.keys():
            lowest = float(self.text.defaults.get("joint_height", 0.0))
            heights = (lowest, *self.text.lists.get("lift_heights", ()))
            before = [casefile.block_name(casefile.joint_name(height)) for height in heights]
            if len(before) == len(names) or len(names) == 1:
                moved = dict(zip(before, map(casefile.block_name, names), strict=False))
                gone = before[len(names) :]
                of_file, given = given, {}
                remaining = [key for key in of_file if key not in gone]
                for key in sorted(
                    remaining, key=lambda key: key not in moved
                ):  # those of overrides win
                    given.setdefault(moved.get(key, key), {}).update(of_file[key])
        return {key: values for key, values in given.items() if values}

    def with_overrides(self, overrides: Settings) -> Source:
        """The source with further overrides, which win. Those of one joint, "lift 25 m.mu", become
        values of its block; one of all joints beside them is for the others.

        Raises InputError.
        """
        merged, text = {**self.overrides, **overrides}, deepcopy(self.text)
        for name in [name for name in merged if "." in name]:
            joint, of_joint, value = of_one_joint(name, merged.pop(name))
            others = merged.pop(of_joint, text.of_joints.get(of_joint))
            if isinstance(others, (list, tuple)):
                raise InputError(f"{name} = {value}: {of_joint} is a list for all joints")
            if others is not None:
                text.defaults[of_joint] = parameter(of_joint).check(others)
                for values in text.blocks.values():
                    values.pop(of_joint, None)
            text.blocks.setdefault(casefile.block_name(joint), {})[of_joint] = value
            text.of_user.add(of_joint)
        return replace(self, overrides=merged, text=text)


def lists_of_joints(settings: Settings) -> dict[str, tuple[Value, ...]]:
    """The settings that are lists, with a value for each joint."""
    return {n: v for n, v in settings.items() if isinstance(v, tuple)}
