"""Mohr-Coulomb friction."""

from __future__ import annotations

import numpy as np

from ..model.case import Case
from .base import Law, Memory


class Friction(Law):
    """Mohr-Coulomb friction with hardening, implicit return.

    Memory: lambda, the cumulated slip, and the slip.
    """

    def __init__(self, case: Case) -> None:
        self.K_N, self.K_T, self.H = case["K_N"], case["K_T"], case["pena_tang"]
        self.mu, self.adhesion = case["mu"], case["adhesion"]
        self.artificial = case.shared["artificial"][0]
        self.cap_opening = self.adhesion / (self.mu * self.K_N)

    def start(self, points: int) -> Memory:
        """The virgin joint."""
        return Memory(np.zeros(points), np.zeros((points, 2)))

    def trial(self, jump: np.ndarray, memory: Memory) -> tuple[np.ndarray, ...]:
        """Normal stress, size and direction of the elastic shear stress, slip of this step."""
        normal = self.K_N * np.minimum(jump[:, 0], self.cap_opening)
        shear = self.K_T * (jump[:, 1:] - memory.vector)
        size = np.linalg.norm(shear, axis=1)
        beyond = size + self.mu * normal - self.H * memory.scalar - self.adhesion
        return (
            normal,
            size,
            shear / np.maximum(size, 1e-300)[:, None],
            np.maximum(beyond / (self.K_T + self.H), 0),
        )

    def respond(
        self,
        jump: np.ndarray,
        memory: Memory,
        secant: bool = False,
        within: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Traction and (unsymmetric) tangent.

        secant: stress over jump, without the coupling, instead of the tangent; within: none here.
        """
        normal, size, n, slip = self.trial(jump, memory)
        traction = np.column_stack([normal, (size - self.K_T * slip)[:, None] * n])
        closed, sliding = jump[:, 0] <= self.cap_opening, slip > 0
        tangent = np.zeros((len(jump), 3, 3))
        tangent[:, 0, 0] = np.where(closed, self.K_N, self.artificial * self.K_N)
        left = np.where(sliding, 1 - self.K_T * slip / np.maximum(size, 1e-300), 1.0)
        if secant:
            along = self.K_T * np.maximum(left, self.artificial)
            tangent[:, 1, 1] = tangent[:, 2, 2] = along
            return traction, tangent
        along = np.where(sliding, self.H / (self.K_T + self.H), 1.0)
        outer = n[:, :, None] * n[:, None, :]
        eye = np.eye(2)
        tangent[:, 1:, 1:] = self.K_T * (
            left[:, None, None] * (eye - outer)
            + along[:, None, None] * outer
            + self.artificial * sliding[:, None, None] * eye
        )
        # where nothing slides the direction does not matter: K_T times the unit matrix
        tangent[~sliding, 1:, 1:] = self.K_T * eye
        coupling = np.where(
            sliding & closed, -self.K_T / (self.K_T + self.H) * self.mu * self.K_N, 0
        )
        tangent[:, 1:, 0] = coupling[:, None] * n
        return traction, tangent

    def shear_strength(self, jump: np.ndarray, memory: Memory) -> np.ndarray | None:
        """adhesion - mu sigma_n, if nothing hardens."""
        normal, *_ = self.trial(jump, memory)
        return None if self.H else self.adhesion - self.mu * normal

    def remember(self, jump: np.ndarray, memory: Memory) -> Memory:
        """The memory after convergence."""
        _, _, n, slip = self.trial(jump, memory)
        return Memory(memory.scalar + slip, memory.vector + slip[:, None] * n)

    def damage(self, jump: np.ndarray, memory: Memory) -> np.ndarray:
        """1 where the joint is open."""
        return self.open(jump, memory).astype(float)

    def open(self, jump: np.ndarray, memory: Memory) -> np.ndarray:
        """Whether the opening is beyond that of the cap adhesion/mu."""
        return jump[:, 0] > self.cap_opening

    def opens_at(self, memory: Memory) -> np.ndarray:
        """The opening from which on a point is open [m]."""
        return np.full(len(memory.scalar), self.cap_opening)

    def slid(self, jump: np.ndarray, memory: Memory) -> np.ndarray:
        """Whether the point has slipped."""
        return memory.scalar > 0
