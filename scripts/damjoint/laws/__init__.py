"""The joint laws of pro/law_*.pro, one file each."""

from __future__ import annotations

from .base import Law, Memory
from .bond import Bond
from .friction import Friction
from .rupture import Rupture

__all__ = ["LAWS", "Law", "Memory"]

#: By the value of the parameter `law`.
LAWS: dict[str, type[Law]] = {"rupture": Rupture, "friction": Friction, "bond": Bond}
