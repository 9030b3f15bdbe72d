"""The joint laws of pro/law_*.pro once more, for many points at once: the condensed engine's.

A law is a class with `start`, `stage`, `respond`, `side`, `hold` and `remember`, and what its
memory means.
Arrays: jump (q, 3) is delta_n, delta_t1, delta_t2 [m]; traction (q, 3) is sigma_n (effective),
tau_1, tau_2 [Pa]; tangent (q, 3, 3) its derivative [Pa/m]; the memory a scalar (q,) and a vector
(q, 2).
Formulas: design of JOINT_MECA_RUPT and JOINT_MECA_FROT (code_aster R7.01.25).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass
class Memory:
    """What a joint remembers at q points: scalar (q,), vector (q, 2) [m]; and what is done to it in
    the step at hand.
    """

    scalar: np.ndarray
    vector: np.ndarray
    #: grout that has set (q,) [m]
    thickness: np.ndarray | float = 0.0
    #: thickness sawn away [m], and the opening that liquid grout leaves [m]
    sawn: float = 0.0
    most: float = np.inf
    #: while a burst is followed, in which nothing breaks or lets go any further (see `hold`): the
    #: share (q,) that is left of the shear stiffness (rupture) or of the bond (bond)
    held: np.ndarray | None = None


class Law:
    """What a law has that knows no works on the joint, releases no shear by opening, and does not
    break.
    """

    releases = breaks = False

    def stage(self, memory: Memory, begin: float, end: float) -> Memory:
        """The memory for a step from t = begin to end."""
        return memory

    def side(self, jump: np.ndarray, memory: Memory) -> np.ndarray:
        """Where a point is in that release: nowhere."""
        return np.zeros(len(jump), int)

    def hold(self, jump: np.ndarray, memory: Memory) -> Memory:
        """The memory with which nothing breaks or lets go beyond what it has at a jump; the next
        memory that it leads to holds nothing.
        """
        return memory

    def shear_strength(self, jump: np.ndarray, memory: Memory) -> np.ndarray | None:
        """The shear stress (q,) that slip cannot raise [Pa]; None if there is no such bound."""

    def in_process_zone(self, jump: np.ndarray, memory: Memory) -> np.ndarray:
        """Whether the point softens: part of its strength is used up, and it is not open."""
        damage = self.damage(jump, memory)
        return (damage > 0) & (damage < 1) & ~self.open(jump, memory)
