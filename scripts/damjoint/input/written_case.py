"""The case file that repeats a case."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy

from .. import InputError
from ..arrays import Settings
from . import casefile
from .case import Case
from .casefile import CaseText
from .parameters import GEOMETRY_LISTS, checked, declared


def case_text(case: Case) -> str:
    """The text of the case file that repeats a case that was loaded. Raises InputError."""
    if case.source is None:
        raise InputError(f"case {case.name}: must be loaded from a case file")
    file = deepcopy(case.source.text)
    add_settings(file, case.source.overrides)
    return text_with_loading(file, case, case.joint_names)


def add_settings(file: CaseText, settings: Settings) -> None:
    """Set parameters in a case file. Raises InputError."""
    for name, value in settings.items():
        setting = checked(name, value)
        if name in declared():
            file.defaults.pop(name, None)
            file.of_joints.pop(name, None)
            for values in file.blocks.values():
                values.pop(name, None)
            if isinstance(setting, tuple):
                file.of_joints[name] = setting
            else:
                file.defaults[name] = setting


def text_with_loading(file: CaseText, case: Case, names: Sequence[str]) -> str:
    """A case file's text with title, loading, geometry; names: of the joints of blocks."""
    file.texts = {"title": case.title}
    if case.record:
        files = filter(None, (case.record, case.record_vertical))
        file.texts["record"] = "+".join(str(path.resolve()) for path in files)
    if case.geometry:
        file.texts["geometry"] = str(case.geometry.resolve())
    if case.also_uplift:
        file.texts["also_uplift"] = " ".join(case.also_uplift)
    file.lists = {
        "levels": list(case.levels),
        "tail_levels": list(case.tail_levels),
        "times": list(case.times),
    }
    file.lists |= {n: list(values) for n in GEOMETRY_LISTS if (values := getattr(case, n))}
    if file.of_joints and len(set(names)) == len(next(iter(file.of_joints.values()))):
        for k, name in enumerate(names):
            block = file.blocks.setdefault(casefile.block_name(name), {})
            block |= {n: values[k] for n, values in file.of_joints.items()}
        file.of_joints = {}
    return casefile.written(file)
