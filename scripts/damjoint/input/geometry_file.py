"""The file of a user's own geometry: a mesh, or a program that Gmsh runs."""

from __future__ import annotations

import contextlib
import os
import re
import tempfile
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import TypeAlias

from .. import RUN_GEO, InputError, RunError, data
from ..arrays import Value
from .parameters import assignments, start_gmsh


def geometry_file(name: str) -> Path:
    """The file of a user's own geometry.

    Raises InputError if it does not exist, or may be a program that is not allowed to run.
    """
    path = Path(name)
    if not path.is_file():
        raise InputError(f"geometry = {name}: must be a file, a mesh that Gmsh reads or a .geo")
    if not path.stat().st_size:
        raise InputError(f"geometry = {name}: is empty; must be a mesh that Gmsh reads or a .geo")
    if path.suffix.lower() == ".inp":
        raise InputError(
            f"geometry = {name}: Gmsh does not read it; must be converted to a .msh: "
            'reference/usage.md, "Meshes and drawings of other programs"'
        )
    packaged = data("geo").resolve() in path.resolve().parents
    if packaged or is_mesh(path) or os.environ.get(RUN_GEO) == "1":
        return path
    if path.suffix == ".geo":
        raise InputError(
            f"geometry = {name}: is a program that Gmsh runs; if you trust it, add --run-geo"
        )
    raise InputError(
        f"geometry = {name}: must be a mesh in Gmsh's format, which ends in .msh and begins with "
        f"{MESH.decode()} (gmsh FILE -save -o mesh.msh converts other meshes; drawings: "
        'reference/usage.md, "Meshes and drawings of other programs"), or a .geo. Gmsh might run '
        "such a file as a program; if you trust it, add --run-geo"
    )


#: Path, time of the last change and size of files.
FileStates: TypeAlias = tuple[tuple[Path, int, int], ...]
#: First bytes of a mesh in Gmsh's format.
MESH = b"$MeshFormat"


def is_mesh(path: Path) -> bool:
    """Whether Gmsh reads a file as data: it runs one of unknown format, whatever its name."""
    try:
        with path.open("rb") as file:
            return path.suffix == ".msh" and file.read(len(MESH)) == MESH
    except OSError as error:
        raise InputError(f"geometry = {path}: {error.strerror}") from None


#: A statement by which a .geo file takes in another file.
INCLUDES = r"\b(?:Include|Merge)\s+\"([^\"]*)\""


def files_of(path: Path, known: dict[Path, str]) -> dict[Path, str]:
    """Add the texts of a .geo file and of those that it includes, but for the declarations."""
    if path in known or data("pro").resolve() in path.resolve().parents or not path.is_file():
        return known
    known[path] = path.read_text(errors="replace")
    for name in re.findall(INCLUDES, known[path]):
        files_of(path.parent / name, known)
    return known


def file_states(path: Path) -> tuple[FileStates, set[str]]:
    """State of the files of a user's own geometry; words of a .geo, its parameters among them."""
    texts = files_of(path, {}) if path.suffix == ".geo" else {path: ""}
    files = ((file, file.stat()) for file in texts)
    words = set(re.findall(r"\w+", " ".join(texts.values())))
    return tuple((file, state.st_mtime_ns, state.st_size) for file, state in files), words


@contextlib.contextmanager
def opened(geometry: Path | None, settings: str) -> Iterator[None]:
    """Open a user's own geometry in Gmsh, else the section; a .geo file after settings as text.

    Raises InputError if Gmsh refuses the user's file, also in the block; RunError of the section.
    """
    gmsh, source = start_gmsh(), geometry or data("geo") / "dam.geo"
    gmsh.parser.clear()
    gmsh.onelab.clear()
    # in a folder of its own: Gmsh runs a file of options, FILE.opt, beside the file it opens
    with tempfile.TemporaryDirectory(prefix="damjoint-") as folder:
        path = Path(folder) / f"scene{source.suffix}"
        if source.suffix == ".geo":
            path.write_text(f'{settings}Include "{source}";\n')
        else:
            path.symlink_to(source)
        try:
            gmsh.open(str(path))
            yield
        except Exception as error:  # what gmsh raises
            if not geometry:
                raise RunError(f"mesh: {error}") from None
            gmsh.finalize()  # else Gmsh remains busy with a file that it could not read
            raise InputError(f"geometry = {geometry}: {error}") from None


def joints_in(path: Path, values: Mapping[str, Value]) -> tuple[str, ...]:
    """The names of the joints of a user's own geometry, in the mesh's order, without its mesh.

    values: of all parameters, of which a .geo file may use some. Raises InputError if it can not
    be read.
    """
    files, words = file_states(path)
    used = {n: v for n, v in values.items() if n in words or f"default_{n}" in words}
    return joints_by_gmsh(files, assignments(used), assignments(values))


@lru_cache(maxsize=4)
def joints_by_gmsh(files: FileStates, used: str, values: str) -> tuple[str, ...]:
    """See `joints_in`; Gmsh's current model remains."""
    gmsh, (path, _, _) = start_gmsh(), files[0]
    before = gmsh.model.getCurrent() if gmsh.model.list() else ""
    with opened(path, values):
        groups = gmsh.model.getPhysicalGroups()
        names = [gmsh.model.getPhysicalName(*group) for group in groups]
    gmsh.model.remove()
    if before:
        gmsh.model.setCurrent(before)
    parts = (name.strip().lower().partition(" ") for name in names)
    return tuple(name or "joint" for region, _, name in parts if region == "joint")
