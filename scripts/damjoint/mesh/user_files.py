"""The files of a user's own geometry, and all else that its mesh depends on."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from ..arrays import Setting
from ..input.case import Case


@dataclass(frozen=True)
class GeometryFiles:
    """The files of a user's own geometry in their present state, and all else its mesh depends
    on: the parameters of a section's mesh, and those that a .geo file names.
    """

    #: path, time of the last change, size
    files: tuple[tuple[Path, int, int], ...]
    parameters: tuple[tuple[str, Setting], ...]
    #: for making the mesh
    case: Case = field(compare=False)
