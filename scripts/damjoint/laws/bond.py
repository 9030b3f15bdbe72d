"""A bond that breaks and slides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..model.case import Case
from .base import Law, Memory


class Bond(Law):
    """A bond that breaks and slides (pro/law_bond.pro).

    Memory: the damage D of tension and cohesion, and the slip.
    """

    breaks = True

    def __init__(self, case: Case) -> None:
        self.K_N, self.K_T = case["K_N"], case["K_T"]
        self.strength, self.cohesion, self.mu = case["sigma_max"], case["adhesion"], case["mu"]
        self.artificial = case.shared["artificial"][0]
        self.delta_e = self.strength / self.K_N
        self.delta_c = 2 * case["G_f"] / (self.strength or self.cohesion or 1.0)
        self.per_slip = self.cohesion / (2 * case["G_t"])
        self.K_soft = self.K_T - self.cohesion * self.per_slip

    def start(self, points: int) -> Memory:
        """The virgin joint."""
        return Memory(np.zeros(points), np.zeros((points, 2)))

    def opened(self, opening: np.ndarray, damage: np.ndarray) -> np.ndarray:
        """Damage by the opening."""
        share = (opening - self.delta_e) / (self.delta_c - self.delta_e)
        return np.maximum(damage, np.clip(share, 0, 1))

    def softening(self, memory: Memory) -> tuple[float, float]:
        """The stiffness in slip, and the damage per slip [1/m]."""
        return (self.K_soft, self.per_slip) if memory.held is None else (self.K_T, 0.0)

    def hold(self, jump: np.ndarray, memory: Memory) -> Memory:
        """See `Law`: the damage stays what it is there, and a point that slides does not soften."""
        return replace(memory, held=1 - self.opened(jump[:, 0], memory.scalar))

    def trial(self, jump: np.ndarray, memory: Memory) -> tuple[np.ndarray, ...]:
        """Size and direction of the elastic shear stress, slip of this step, new damage, whether
        it is the opening's, and whether the bond is gone by the slip.

        The new damage is the larger of the opening's and the slip's, D + slip/lambda_c.
        """
        K_soft, per_slip = self.softening(memory)
        shear = self.K_T * (jump[:, 1:] - memory.vector)
        size = np.linalg.norm(shear, axis=1)
        excess = size + self.mu * self.K_N * np.minimum(jump[:, 0], 0)
        before, held = memory.scalar, memory.held
        opened = self.opened(jump[:, 0], before) if held is None else 1 - held
        if_opening = np.maximum((excess - self.cohesion * (1 - opened)) / self.K_T, 0)
        if_slip = (excess - self.cohesion * (1 - before)) / K_soft
        by_opening = before + per_slip * if_opening <= opened
        gone = ~by_opening & (before + per_slip * if_slip >= 1)
        slip = np.select([by_opening, gone], [if_opening, excess / self.K_T], if_slip)
        damage = np.select([by_opening, gone], [opened, 1.0], before + per_slip * if_slip)
        return size, shear / np.maximum(size, 1e-300)[:, None], slip, damage, by_opening, gone

    def back(self, damage: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Slope of the line to the origin in tension, and its derivative with the damage."""
        if not self.strength:
            return np.zeros_like(damage), np.zeros_like(damage)
        kappa = self.delta_e + damage * (self.delta_c - self.delta_e)
        return self.strength * (1 - damage) / kappa, -self.strength * self.delta_c / kappa**2

    def respond(
        self,
        jump: np.ndarray,
        memory: Memory,
        secant: bool = False,
        within: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Traction and (unsymmetric) tangent.

        secant: a positive stiffness that never softens instead of the tangent; within: none here.
        """
        size, n, slip, damage, by_opening, gone = self.trial(jump, memory)
        K_soft, per_slip = self.softening(memory)
        opening, sliding = jump[:, 0], slip > 0
        closed = opening <= 0
        slope, d_slope = self.back(damage)
        normal = np.where(closed, self.K_N, slope) * opening
        traction = np.column_stack([normal, (size - self.K_T * slip)[:, None] * n])
        left = 1 - self.K_T * slip / np.maximum(size, 1e-300)
        tangent = np.zeros((len(jump), 3, 3))
        weak = self.artificial * self.K_N
        if secant:
            tangent[:, 0, 0] = np.where(closed, self.K_N, np.maximum(slope, weak))
            shear = self.K_T * np.maximum(left, self.artificial)
            tangent[:, 1, 1] = tangent[:, 2, 2] = shear
            return traction, tangent
        growing = by_opening & (damage > memory.scalar) & (damage < 1)
        d_opened = np.where(growing, 1 / (self.delta_c - self.delta_e), 0)
        softens = ~(by_opening | gone)  # slip does the damage
        stiffness = np.where(softens, K_soft, self.K_T)
        with_size = self.K_T / stiffness * sliding
        pressing = self.mu * self.K_N * (opening < 0)
        with_opening = (pressing + self.cohesion * d_opened) / stiffness * sliding
        per_slip = per_slip * softens
        d_damage = d_opened + per_slip * with_opening
        open_stiffness = slope + opening * d_slope * d_damage
        broken = (damage >= 1) | (self.strength == 0)
        tangent[:, 0, 0] = np.select([closed, broken], [self.K_N, weak], open_stiffness)
        by_slip = opening * d_slope * per_slip * with_size
        tangent[:, 0, 1:] = np.where(closed | broken, 0, by_slip)[:, None] * n
        tangent[:, 1:, 0] = (-self.K_T * with_opening)[:, None] * n
        outer, eye = n[:, :, None] * n[:, None, :], np.eye(2)
        tangent[:, 1:, 1:] = self.K_T * (
            left[:, None, None] * (eye - outer)
            + (1 - with_size)[:, None, None] * outer
            + self.artificial * eye
        )
        return traction, tangent

    def shear_strength(self, jump: np.ndarray, memory: Memory) -> np.ndarray:
        """The cohesion that is left, and friction."""
        pressed = self.K_N * np.minimum(jump[:, 0], 0)
        return self.cohesion * (1 - memory.scalar) - self.mu * pressed

    def remember(self, jump: np.ndarray, memory: Memory) -> Memory:
        """The memory after convergence."""
        _, n, slip, damage, *_ = self.trial(jump, memory)
        if memory.held is not None:
            by_slip = np.minimum(memory.scalar + self.per_slip * slip, 1)
            damage = np.maximum(self.opened(jump[:, 0], memory.scalar), by_slip)
        return Memory(damage, memory.vector + slip[:, None] * n)

    def damage(self, jump: np.ndarray, memory: Memory) -> np.ndarray:
        """0 virgin to 1 broken."""
        return memory.scalar

    def open(self, jump: np.ndarray, memory: Memory) -> np.ndarray:
        """Whether the point is open and its bond gone."""
        return (jump[:, 0] > 0) & ((memory.scalar >= 1) | (self.strength == 0))

    def opens_at(self, memory: Memory) -> np.ndarray:
        """The opening from which on a point is open [m]."""
        bonded = (memory.scalar < 1) & (self.strength > 0)
        return np.where(bonded, self.delta_c, 0.0)

    def slid(self, jump: np.ndarray, memory: Memory) -> np.ndarray:
        """Whether the point has slipped."""
        return np.linalg.norm(memory.vector, axis=1) > 0
