"""Keys that identify finished results: hashes of all that decides them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import Any

from .. import __version__
from ..fem.cache import fingerprint
from ..input.case import Case
from ..mesh.mesh import mesh_of
from ..versions import code_fingerprint


def study_key(case: Case, *others: Any) -> str:
    """The key of a scene and its loading, and of others that decide the result."""
    return hashlib.sha256(repr([*case_identity(case), *others]).encode()).hexdigest()[:16]


def case_identity(case: Case) -> Iterator[Any]:
    """All that decides the results of a scene, also the content of a mesh and the code."""
    yield sorted(case.values.items())
    yield from (case.levels, case.tail_levels, case.times, case.hardening_requested)
    for joint in case.of_joints:
        yield joint.name, joint.hardening_requested, sorted(joint.values.items())
    yield __version__
    yield code_fingerprint()
    if case.geometry:
        yield fingerprint(mesh_of(case))
