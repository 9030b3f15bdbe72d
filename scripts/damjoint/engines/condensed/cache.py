"""Condensed bodies kept on disk, by mesh and elasticity.

A file is numpy's npz (arrays only, nothing that could be executed) with a header: the version and
the scene it belongs to. What is foreign, damaged or of another version is ignored and made anew.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import zipfile
from dataclasses import fields
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy import linalg

from ... import RunError, __version__, data
from ...fem.condensation import MATERIAL, Bodies, Condensed, check_size, condense
from ...model.case import Case
from ...model.loads import overtopped
from ...model.mesh import Body, Mesh, mesh_of, shares

#: The cache is kept below this size [bytes]; the files longest unused go first.
LIMIT = 2_000_000_000


def folder() -> Path | None:
    """Where condensed bodies are kept: $DAMJOINT_CACHE (empty: nowhere), else the user's cache
    folder.
    """
    named = os.environ.get("DAMJOINT_CACHE")
    if named is not None:
        return Path(named) if named else None
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(home) / "damjoint" if os.path.isabs(home) else None


def key_of(case: Case) -> tuple:
    """What condensed bodies depend on."""
    shape = fingerprint(mesh_of(case)) if case.geometry else tuple(shares(case).items())
    faces = max(case.tail_levels) > 0, case["floor_water"], overtopped(case)
    if case.geometry:  # which are under water is not known without their heights
        faces = (*faces, case.reached, max(case.tail_levels))
    return (shape, *(case[n] for n in MATERIAL), *faces)


def fingerprint(mesh: Mesh) -> str:
    """A fingerprint of a mesh: its bodies and faces."""
    surfaces = {name: face.surface for name, face in mesh.faces.items()}
    digest = hashlib.sha256()
    for name, body in (mesh.bodies | surfaces).items():
        digest.update(name.encode() + body.points.tobytes() + body.node_tags.tobytes())
        for (shape, table), region in zip(body.cells, body.regions, strict=True):
            digest.update(f"{shape} {region}".encode() + table.tobytes())
    return digest.hexdigest()


@lru_cache(maxsize=1)
def sources() -> str:
    """A fingerprint of all that makes condensed bodies of a case: meshes and elements."""
    makers = sorted((Path(__file__).parents[2] / "fem").glob("*.py"))
    texts = [path.read_bytes() for path in (*sorted(data("geo").glob("*.geo")), *makers)]
    return hashlib.sha256(b"".join(texts)).hexdigest()


def cached(case: Case) -> tuple[Condensed, Bodies | None]:
    """The condensed bodies of a case, from the cache or made and kept there.

    Returns them, and if they had to be made what they were made of. Raises RunError (mesh, memory).
    """
    header = json.dumps([__version__, sources(), key_of(case)])
    place = folder()
    path = place and place / (hashlib.sha256(header.encode()).hexdigest()[:24] + ".npz")
    found = read(path, header) if path else None
    if found:
        return found, None
    if not case.geometry:
        check_size(case)
    try:
        with np.errstate(over="raise", invalid="raise"):
            bodies = Bodies.of(case)
            made = condense(case, bodies)
    except (ArithmeticError, RuntimeError, linalg.LinAlgError) as error:
        if isinstance(error, RunError):
            raise
        raise RunError(f"bodies: can not be eliminated ({error}); look at the geometry") from None
    if path:
        keep(made, header, path)
    return made, bodies


def read(path: Path, header: str) -> Condensed | None:
    """The bodies in a file, if they are there, whole and those of the header."""
    if not path.is_file():
        return None
    try:
        with np.load(path, allow_pickle=False) as file:
            if str(file["header"]) != header:
                return None
            found = unpacked({name: file[name] for name in file["names"].tolist()})
        path.touch()
        return found
    except Exception:  # numpy and zipfile raise whatever a damaged byte leads them to
        return None


def keep(made: Condensed, header: str, path: Path) -> None:
    """Write bodies to a file, whole or not at all; a cache that can not be written costs time
    only.
    """
    part = path.with_suffix(f".{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.unlink(missing_ok=True)
        # as numpy.savez does it, but closed also where the disk is full, and never through a link
        with zipfile.ZipFile(part, "x") as file:
            arrays = packed(made)
            about = {"header": np.array(header), "names": np.array(list(arrays))}
            for name, array in (about | arrays).items():
                with file.open(f"{name}.npy", "w", force_zip64=True) as entry:
                    np.lib.format.write_array(entry, array, allow_pickle=False)
        part.replace(path)
        prune(path.parent)
    except OSError:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)


def packed(made: Condensed) -> dict[str, np.ndarray]:
    """All of it as arrays: {"attribute", "attribute/name" or "attribute/name/part": array}."""
    flat = {}
    for field in fields(made):
        value = getattr(made, field.name)
        for name, item in value.items() if isinstance(value, dict) else [("", value)]:
            place = f"{field.name}/{name}" if isinstance(value, dict) else field.name
            if isinstance(item, Body):
                flat |= {f"{place}/{part}": getattr(item, part) for part in BODY}
                flat |= {f"{place}/cells/{i}/{s}": t for i, (s, t) in enumerate(item.cells)}
            else:
                flat[place] = np.asarray(item)
    return flat


BODY = ("points", "node_tags", "element_tags", "normals")


def unpacked(flat: dict[str, np.ndarray]) -> Condensed:
    """The bodies from their arrays.

    Raises KeyError, ValueError if something is missing.
    """

    def body(place: str) -> Body:
        cells = sorted(n for n in flat if n.startswith(f"{place}/cells/"))
        return Body(
            **{part: flat[f"{place}/{part}"] for part in BODY},
            cells=[(n.rsplit("/", 1)[1], flat[n]) for n in cells],
        )

    found = {}
    for field in fields(Condensed):
        here = [n for n in flat if n == field.name or n.startswith(f"{field.name}/")]
        if field.type == "Body":
            found[field.name] = body(field.name)
        elif field.type.startswith("dict"):
            names = dict.fromkeys(n.split("/")[1] for n in here)
            bodies = field.type == "dict[str, Body]"
            found[field.name] = {
                n: body(f"{field.name}/{n}") if bodies else plain(flat[f"{field.name}/{n}"])
                for n in names
            }
        else:
            found[field.name] = plain(flat[field.name])
    return Condensed(**found)


def plain(array: np.ndarray) -> np.ndarray | float | int:
    """An array, or the number in it if it has no dimension."""
    return array if array.ndim else array.item()


def prune(place: Path) -> None:
    """Delete the files longest unused until the cache is below its limit."""
    files = sorted(place.glob("*.npz"), key=lambda f: f.stat().st_mtime)
    total = sum(f.stat().st_size for f in files)
    for file in files:
        if total <= LIMIT:
            break
        total -= file.stat().st_size
        file.unlink(missing_ok=True)
