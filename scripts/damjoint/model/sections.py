"""Sections of a case: the values of one group of parameters as attributes, as in case.joint.mu."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..arrays import Values


class Section:
    """The values of one group of pro/parameters.pro: numbers, but for those that a subclass names.

    Not to be changed: a case is.
    """

    def __init__(self, values: Values) -> None:
        vars(self).update(values)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"{name}: values of a case can not be set")

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> float: ...


class Scene(Section):
    """Dimension and order, joint law, water, and what is prescribed."""

    law: str
    uplift: str
    face_load: str
    drive: str


class MeshSize(Section):
    """Pattern and sizes of the mesh."""

    mesh_pattern: str
    quadrature: str


class Loads(Section):
    """Loads besides the water."""

    force_face: str
