"""Condensed bodies on disk, by mesh and elasticity.

The content of an entry (see storage.py) is a line of JSON, the values as a tree with the numbers of
arrays; then the arrays in numpy's own format: nothing that could be executed. A foreign or damaged
file or one of another version is ignored and replaced. (One file of many arrays, npz, takes several
times as long.)
"""

from __future__ import annotations

import contextlib
import json
import zlib
from dataclasses import fields
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import RunError, __version__, data
from ..arrays import Array
from ..input.case import Case
from ..input.scene import MATERIALS
from ..mesh.body import Body
from ..mesh.generate import shares
from ..mesh.joint_mesh import Face, JointMesh
from ..mesh.mesh import Mesh, mesh_of
from ..model.loads import COMPLETE, overtopped, thermal_strains, wet_segments
from ..storage import cache_folder, read_entry, write_entry
from .condensed import Condensed, CondensedJoint, JointDofs
from .memory import check_size, iterates
from .responses import Measure

if TYPE_CHECKING:
    from .bodies import Bodies

#: Parameters that the bodies depend on besides those of the mesh.
PARAMETERS = (
    *("order", "hold_z"),
    *(f"{p}_{name}" for p in ("E", "nu") for name in dict.fromkeys(MATERIALS.values())),
)

#: Size up to which the cache may grow [bytes]; the files longest unused are deleted first.
LIMIT = 2_000_000_000


def bodies_key(case: Case) -> tuple[object, ...]:
    """All that condensed bodies depend on."""
    shape: object = tuple(shares(case).items())
    under_water: tuple[float, ...] = wet_segments(case)
    if case.geometry:  # which of its faces are under water depends on heights that its mesh has
        shape = fingerprint(mesh_of(case))
        under_water = case.reached, max(case.tail_levels), case["floor_water"], overtopped(case)
    thermal = thermal_strains(case, COMPLETE)
    needed = *(case[n] for n in PARAMETERS), *under_water, *thermal
    return shape, *needed


@lru_cache(maxsize=1)
def fingerprint(mesh: Mesh) -> str:
    """Hash of a mesh: its bodies, faces and joints."""
    import hashlib

    surfaces = {name: face.surface for name, face in mesh.faces.items()}
    faces = [(face.body, face.side) for face in mesh.faces.values()]
    joints = [(joint.name, joint.upper, joint.lower) for joint in mesh.joints]
    digest = hashlib.sha256(repr([faces, joints]).encode())
    for name, body in (mesh.bodies | surfaces).items():
        digest.update(name.encode() + body.points.tobytes() + body.node_tags.tobytes())
        for (shape, table), region in zip(body.cells, body.regions, strict=True):
            digest.update(f"{shape} {region}".encode() + table.tobytes())
    return digest.hexdigest()


@lru_cache(maxsize=1)
def sources() -> str:
    """Checksum of the files by which condensed bodies are computed: meshes and elements."""
    package = Path(__file__).parents[1]
    code = package / "csr.py", *sorted(package.glob("mesh/*.py")), *sorted(package.glob("fem/*.py"))
    shapes = data("pro") / "section.pro", *sorted(data("geo").glob("*.geo"))
    texts = [path.read_bytes() for path in (*shapes, *code)]
    return f"{zlib.crc32(b''.join(texts)):08x}"


def condensed_bodies(case: Case, engine: str = "condensed") -> tuple[Condensed, Bodies | None]:
    """Condensed bodies of a case, from the cache or computed and added to it; and the bodies they
    were computed from, if they were.

    engine: condensed; iterative, uncondensed bodies; auto, what is expected to be faster, or to
    have enough memory. Raises RunError (mesh, memory).
    """
    header = json.dumps([__version__, sources(), bodies_key(case)])
    parent = cache_folder()
    path = parent and parent / f"bodies-{zlib.crc32(header.encode()):08x}.bin"
    stored = read(path, header) if path and engine != "iterative" else None
    if stored:
        return stored, None
    if not case.geometry:
        check_size(case, engine)
    from .bodies import Bodies
    from .condensation import condense

    try:
        with np.errstate(over="raise", invalid="raise"):
            bodies = Bodies.of(case)
            if engine == "iterative" or (engine == "auto" and iterates(case, bodies)):
                from .uncondensed import uncondensed

                return uncondensed(case, bodies), bodies
            condensed = condense(case, bodies)
    except (ArithmeticError, RuntimeError, np.linalg.LinAlgError) as error:
        if isinstance(error, RunError):
            raise
        raise RunError(f"bodies: can not be eliminated ({error}); look at the geometry") from None
    if path:
        write(condensed, header, path)
    return condensed, bodies


def read(path: Path, header: str) -> Condensed | None:
    """Condensed bodies in a file; None if it is missing, damaged or of another header."""
    try:
        with read_entry(path, header) as file:
            about = json.loads(file.readline())
            arrays = [np.load(file) for _ in range(about["arrays"])]
        condensed: Condensed = unpack(about["tree"], arrays)
        path.touch()
        return condensed
    except (OSError, ValueError):
        return None


def write(condensed: Condensed, header: str, path: Path) -> None:
    """Write condensed bodies to a file, whole or not at all, and none above the limit of the cache;
    an OSError only costs the entry.
    """
    arrays: list[Array] = []
    tree = pack(condensed, arrays)
    if sum(array.nbytes for array in arrays) > LIMIT:
        return
    with contextlib.suppress(OSError):
        with write_entry(path, header) as file:
            file.write(json.dumps({"tree": tree, "arrays": len(arrays)}).encode() + b"\n")
            for array in arrays:
                np.save(file, array)
        prune(path.parent)


#: The dataclasses of which condensed bodies are made.
CLASSES = {
    cls.__name__: cls
    for cls in (Condensed, CondensedJoint, JointDofs, Measure, JointMesh, Face, Body)
}


def pack(value: Any, arrays: list[Array]) -> object:
    """Tree of a value for JSON; its arrays are appended to `arrays`, and numbers in the tree."""
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {"array": len(arrays) - 1}
    if type(value) in CLASSES.values():
        content = {field.name: getattr(value, field.name) for field in fields(value)}
        return {"class": type(value).__name__, "fields": pack(content, arrays)}
    if isinstance(value, dict):
        return {"dict": {key: pack(v, arrays) for key, v in value.items()}}
    if isinstance(value, list | tuple):
        items = [pack(v, arrays) for v in value]
        return items if isinstance(value, list) else {"tuple": items}
    return value


def unpack(tree: Any, arrays: list[Array]) -> Any:
    """The value of a tree. Raises KeyError, IndexError, TypeError if something is missing."""
    if isinstance(tree, list):
        return [unpack(item, arrays) for item in tree]
    if not isinstance(tree, dict):
        return tree
    if "array" in tree:
        return arrays[tree["array"]]
    if "class" in tree:
        return CLASSES[tree["class"]](**unpack(tree["fields"], arrays))
    if "tuple" in tree:
        return tuple(unpack(tree["tuple"], arrays))
    return {key: unpack(item, arrays) for key, item in tree["dict"].items()}


def prune(parent: Path) -> None:
    """Delete the files longest unused until the cache is not above its limit."""
    kinds = ".bin", ".json", ".npz"  # the last: of earlier versions
    entries = [file for file in parent.iterdir() if file.suffix in kinds]
    files = sorted(entries, key=lambda f: f.stat().st_mtime)
    total = sum(f.stat().st_size for f in files)
    for file in files:
        if total <= LIMIT:
            break
        total -= file.stat().st_size
        file.unlink(missing_ok=True)
