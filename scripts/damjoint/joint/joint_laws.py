"""The laws of all joints at once: points joint by joint, each joint with its law.

The methods are those of `Law` (see laws/base.py); arrays are those of the joints, one after the
other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, BoolArray
from ..laws import Law
from ..laws.base import Response


@dataclass(frozen=True)
class JointVariables:
    """Internal variables of the points of each joint."""

    joints: tuple[Any, ...]
    #: where the points of each joint start, and the end of the last
    starts: tuple[int, ...]

    def split(self, values: NDArray[Any]) -> list[NDArray[Any]]:
        """Values (q, ...) of all points, joint by joint."""
        return [values[begin:end] for begin, end in pairwise(self.starts)]


class JointLaws:
    """The laws of the joints."""

    def __init__(self, laws: Sequence[Law[Any]]) -> None:
        self.laws = tuple(laws)

    @property
    def softens(self) -> bool:
        """Whether one of them softens."""
        return any(law.softens for law in self.laws)

    @property
    def releases_shear(self) -> bool:
        """Whether opening releases the shear stiffness of one of them."""
        return any(law.releases_shear for law in self.laws)

    # -- internal variables

    def initial(self, points: Sequence[int]) -> JointVariables:
        """Internal variables of undamaged joints with these numbers of points."""
        parts = (law.initial(n) for law, n in zip(self.laws, points, strict=True))
        return JointVariables(tuple(parts), (0, *np.cumsum(points).tolist()))

    def begin_step(self, variables: JointVariables, begin: float, end: float) -> JointVariables:
        """See `Law`."""
        pairs = zip(self.laws, variables.joints, strict=True)
        parts = tuple(law.begin_step(state, begin, end) for law, state in pairs)
        return JointVariables(parts, variables.starts)

    def update_internal_variables(self, jump: Array, variables: JointVariables) -> JointVariables:
        """See `Law`."""
        parts = self._each(Law.update_internal_variables, jump, variables)
        return JointVariables(tuple(parts), variables.starts)

    def changes_of_thickness(self, before: JointVariables, begun: JointVariables) -> list[float]:
        """Change of the mean `Law.added_thickness` of each joint as a step begins [m]; 0 where the
        internal variables are the same objects, as in all joints without works.
        """
        numbers = np.diff(before.starts).tolist()
        parts = zip(self.laws, before.joints, begun.joints, numbers, strict=True)
        return [
            0.0
            if old is new
            else float(law.added_thickness(new, n).mean() - law.added_thickness(old, n).mean())
            for law, old, new, n in parts
        ]

    def _each(
        self, method: Callable[..., Any], jump: Array, variables: JointVariables
    ) -> list[Any]:
        """The values of a method of `Law` with each joint's jumps and internal variables."""
        return [
            getattr(law, method.__name__)(jumps, state)
            for law, jumps, state in zip(
                self.laws, variables.split(jump), variables.joints, strict=True
            )
        ]

    def _joined(
        self, method: Callable[..., NDArray[Any]], jump: Array, variables: JointVariables
    ) -> Any:
        """The values of a method of `Law` for all points."""
        return np.concatenate(self._each(method, jump, variables))

    # -- response

    def unloading_compliance(self, variables: JointVariables) -> Array:
        """`Law.unloading_compliance` of all points (q, 3)."""
        compliances = [law.unloading_compliance for law in self.laws]
        return np.repeat(compliances, np.diff(variables.starts), axis=0)

    def released_jump(self, variables: JointVariables) -> Array:
        """See `Law`."""
        numbers = np.diff(variables.starts).tolist()
        parts = zip(self.laws, variables.joints, numbers, strict=True)
        return np.concatenate([law.released_jump(state, n) for law, state, n in parts])

    def undamaged_tangent(self, points: Sequence[int]) -> Array:
        """Tangent (q, 3, 3) of undamaged joints with these numbers of points."""
        one = (
            (law, law.traction_and_tangent(np.zeros((1, 3)), law.initial(1))) for law in self.laws
        )
        return np.concatenate(
            [
                np.repeat(tangent, n, axis=0)
                for (_, (_, tangent)), n in zip(one, points, strict=True)
            ]
        )

    def evaluate(
        self, jump: Array, variables: JointVariables, releasing: BoolArray | None = None
    ) -> Response:
        """The response of all points; releasing: points (q,), see `Law.evaluate`."""
        inside: list[Any] = [None] * len(self.laws)
        if releasing is not None:
            inside = variables.split(releasing)
        parts = [
            law.evaluate(jump, state, points)
            for law, jump, state, points in zip(
                self.laws, variables.split(jump), variables.joints, inside, strict=True
            )
        ]
        if len(parts) == 1:
            return parts[0]
        traction = np.concatenate([traction for traction, _ in parts])
        return traction, lambda: np.concatenate([tangent() for _, tangent in parts])

    def secant_stiffness(self, jump: Array, variables: JointVariables) -> Array:
        """See `Law`."""
        return np.asarray(self._joined(Law.secant_stiffness, jump, variables))

    def freeze(self, jump: Array, variables: JointVariables) -> JointLaws:
        """See `Law`."""
        return JointLaws(self._each(Law.freeze, jump, variables))

    def release_side(self, jump: Array, variables: JointVariables) -> NDArray[np.int_]:
        """See `Law`."""
        return np.asarray(self._joined(Law.release_side, jump, variables))

    # -- meaning

    def damage(self, jump: Array, variables: JointVariables) -> Array:
        """See `Law`."""
        return np.asarray(self._joined(Law.damage, jump, variables))
