"""The file of a user's own geometry: a mesh, or a program that Gmsh runs."""

from __future__ import annotations

import os
from pathlib import Path

from .. import RUN_GEO, InputError, data
from .values import flows as flows
from .values import freezes_uplift as freezes_uplift
from .values import has_drains as has_drains


def own_geometry(name: str) -> Path:
    """The file of a user's own geometry.

    Raises InputError if it does not exist, or may be a program that is not allowed to run.
    """
    path = Path(name)
    if not path.is_file():
        raise InputError(f"geometry = {name}: must be a file, a mesh that Gmsh reads or a .geo")
    if not path.stat().st_size:
        raise InputError(f"geometry = {name}: is empty; must be a mesh that Gmsh reads or a .geo")
    own = data("geo").resolve() in path.resolve().parents
    if own or is_mesh(path) or os.environ.get(RUN_GEO) == "1":
        return path
    if path.suffix == ".geo":
        raise InputError(
            f"geometry = {name}: is a program that Gmsh runs; if you trust it, add --run-geo"
        )
    raise InputError(
        f"geometry = {name}: must be a mesh in Gmsh's format, which ends in .msh and begins with "
        f"{MESH.decode()} (gmsh FILE -save -o mesh.msh converts others), or a .geo. Gmsh might "
        "run such a file as a program; if you trust it, add --run-geo"
    )


#: First bytes of a mesh in Gmsh's format.
MESH = b"$MeshFormat"


def is_mesh(path: Path) -> bool:
    """Whether Gmsh reads a file as data: it unpacks and runs a file of unknown format as a .geo,
    whatever its name.
    """
    try:
        with path.open("rb") as file:
            return path.suffix == ".msh" and file.read(len(MESH)) == MESH
    except OSError as error:
        raise InputError(f"geometry = {path}: {error.strerror}") from None
