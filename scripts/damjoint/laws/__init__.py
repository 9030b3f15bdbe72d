"""The joint laws, each a class after `Law` of base.py in the file of its name, as in pro/law_*.pro.

`rupture.py` has the class `Rupture`: the law of a case with law = rupture.
"""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from .base import Evidence, Law
from .friction import UNBREAKABLE

__all__ = ["COLUMNS", "LAWS", "UNBREAKABLE", "Evidence", "Law"]

#: By the value of the parameter `law`.
LAWS: dict[str, type[Law[Any]]] = {
    file.name: getattr(import_module(f".{file.name}", __name__), file.name.capitalize())
    for file in iter_modules(__path__)
    if file.name != "base"
}

#: Columns of joint.csv that only some laws have: {name: (unit, meaning)}.
COLUMNS = {name: column for law in LAWS.values() for name, column in law.columns.items()}
