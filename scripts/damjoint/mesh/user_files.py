"""The files of a user's own geometry, and all else that its mesh depends on."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

from .. import data
from ..arrays import Setting
from ..input.case import Case
from .body import Body as Body


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


#: A statement by which a .geo file takes in another file.
INCLUDES = r"\b(?:Include|Merge)\s+\"([^\"]*)\""


def files_of(path: Path, known: dict[Path, str]) -> dict[Path, str]:
    """A .geo file and those that it includes, but for the declarations, with their text; added to
    those that are known.
    """
    if path in known or data("pro").resolve() in path.resolve().parents or not path.is_file():
        return known
    known[path] = path.read_text(errors="replace")
    for name in re.findall(INCLUDES, known[path]):
        files_of(path.parent / name, known)
    return known
