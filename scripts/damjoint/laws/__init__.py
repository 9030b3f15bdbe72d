"""The joint laws: one file each, the same as in pro/law_*.pro, evaluated for many points at once.

A further law is a class after `Law` of base.py in a file of its own and a row of `LAWS` here.
"""

from __future__ import annotations

from typing import Any

from .base import TANGENT, Evidence, Law, Mode
from .bond import Bond
from .friction import UNBREAKABLE, Friction
from .rupture import Rupture

__all__ = ["COLUMNS", "LAWS", "TANGENT", "UNBREAKABLE", "Evidence", "Law", "Mode"]

#: By the value of the parameter `law`.
LAWS: dict[str, type[Law[Any]]] = {"rupture": Rupture, "friction": Friction, "bond": Bond}

#: Columns of joint.csv that only some laws have: {name: (unit, meaning)}.
COLUMNS = {name: column for law in LAWS.values() for name, column in law.columns.items()}
