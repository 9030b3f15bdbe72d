"""Cohesive rupture, with grouting and sawing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..model.case import Case
from .base import Law, Memory


class Rupture(Law):
    """Cohesive rupture, with grouting and sawing.

    Memory: kappa, the largest opening so far, and the released slip. Openings here are those beyond
    the thickness that grout and saw leave.
    """

    breaks = True

    def __init__(self, case: Case) -> None:
        self.K_N, self.K_T, self.contact = (
            case["K_N"],
            case["K_T"],
            case["pena_contact"] * case["K_N"],
        )
        p = case["pena_rupture"]
        self.delta_e = case["sigma_max"] / self.K_N
        self.L_C = (1 + p) * self.delta_e
        self.sigma_c = case["sigma_max"] * (1 + p) / p
        self.artificial = case.shared["artificial"][0]
        self.L_CT = (
            np.inf
            if case["alpha"] >= 2
            else max(self.L_C * np.tan(case["alpha"] * np.pi / 4), case.shared["release_length"][0])
        )
        self.grout, self.grout_t = case["grout_pressure"] / self.contact, case["grout_t"]
        self.saw, self.saw_t = case["saw_thickness"], case["saw_t"]

    def start(self, points: int) -> Memory:
        """The virgin joint."""
        return Memory(np.full(points, self.delta_e), np.zeros((points, 2)))

    def stage(self, memory: Memory, begin: float, end: float) -> Memory:
        """The memory for a step from t = begin to end: grout_in and sawn_at of pro/law.pro."""
        if not (self.grout or self.saw):
            return memory
        liquid = self.grout > 0 and begin < self.grout_t and end > self.grout_t - 1
        most = -self.grout * min(end - self.grout_t + 1, 1) if liquid else np.inf
        return replace(memory, sawn=self.saw * min(max(end - self.saw_t + 1, 0), 1), most=most)

    def opening(self, jump: np.ndarray, memory: Memory) -> np.ndarray:
        """The opening beyond the thickness that grout and saw leave."""
        return np.minimum(jump[:, 0] - memory.thickness + memory.sawn, memory.most)

    def broken(self, opening: np.ndarray, memory: Memory) -> np.ndarray:
        """Whether the bond has gone."""
        before = (memory.scalar >= self.L_C) | (memory.sawn > 0)
        return before | (opening >= self.L_C) if memory.held is None else before

    def share(self, opening: np.ndarray, memory: Memory) -> np.ndarray:
        """What is left of the tangential stiffness, 0 to 1."""
        if memory.held is not None:
            return memory.held
        return np.where(opening <= 0, 1, np.maximum(1 - opening / self.L_CT, 0))

    def hold(self, jump: np.ndarray, memory: Memory) -> Memory:
        """See `Law`: the shear's share as it is, and no larger opening counts as one."""
        return replace(memory, held=self.share(self.opening(jump, memory), memory))

    @property
    def releases(self) -> bool:
        """Whether opening ends the tangential stiffness."""
        return np.isfinite(self.L_CT)

    def side(self, jump: np.ndarray, memory: Memory) -> np.ndarray:
        """Where a point is: before the release of its shear (-1), in it (0), beyond it (1)."""
        opening = self.opening(jump, memory)
        return np.select([opening <= 0, opening < self.L_CT], [-1, 0], 1)

    def respond(
        self,
        jump: np.ndarray,
        memory: Memory,
        secant: bool = False,
        within: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Traction and tangent.

        secant: the positive stiffness that never softens instead of the tangent; within: the points
        whose shear is on the line of its release, wherever they are.
        """
        opening, kappa, slip = (
            self.opening(jump, memory),
            memory.scalar,
            jump[:, 1:] - memory.vector,
        )
        closed, broken = opening <= 0, self.broken(opening, memory)
        liquid = opening >= memory.most
        unloading = opening <= (kappa if memory.held is None else np.inf)
        with np.errstate(divide="ignore", invalid="ignore"):
            back = self.sigma_c * (1 - kappa / self.L_C) / kappa  # secant stiffness
            normal = np.select(
                [closed, broken, unloading],
                [self.contact * opening, 0, back * opening],
                self.sigma_c * (1 - opening / self.L_C),
            )
            softening = (
                normal / opening
                if secant
                else np.full_like(opening, -self.sigma_c / self.L_C if self.L_C else 0)
            )
        stiffness = np.select(
            [liquid | broken & ~closed, closed, unloading],
            [self.artificial * self.K_N, self.contact, back],
            softening,
        )
        shear = self.K_T * self.share(opening, memory)
        traction = np.column_stack([normal, shear[:, None] * slip])
        tangent = np.zeros((len(jump), 3, 3))
        tangent[:, 0, 0] = (
            np.maximum(stiffness, self.artificial * self.K_N) if secant else stiffness
        )
        tangent[:, 1, 1] = tangent[:, 2, 2] = np.maximum(shear, self.artificial * self.K_T)
        if not secant and memory.held is None:
            falling = np.where((opening > 0) & (opening < self.L_CT), -self.K_T / self.L_CT, 0)
            tangent[:, 1:, 0] = falling[:, None] * slip
        if within is not None and within.any():
            line = self.K_T * (1 - opening[within] / self.L_CT)
            traction[within, 1:] = line[:, None] * slip[within]
            tangent[within, 1:, 0] = -self.K_T / self.L_CT * slip[within]
        return traction, tangent

    def remember(self, jump: np.ndarray, memory: Memory) -> Memory:
        """The memory after convergence."""
        opening = self.opening(jump, memory)
        free = self.share(opening, memory) <= 0
        grouted = np.maximum(jump[:, 0] - memory.thickness + memory.sawn - memory.most, 0)
        return replace(
            memory,
            scalar=np.maximum(memory.scalar, opening),
            vector=np.where(free[:, None], jump[:, 1:], memory.vector),
            thickness=memory.thickness + grouted,
            held=None,
        )

    def damage(self, jump: np.ndarray, memory: Memory) -> np.ndarray:
        """0 virgin to 1 broken."""
        partly = (
            (memory.scalar - self.delta_e) / (self.L_C - self.delta_e)
            if self.delta_e < self.L_C
            else 0 * memory.scalar
        )
        return np.where(self.open(jump, memory), 1.0, partly)

    def open(self, jump: np.ndarray, memory: Memory) -> np.ndarray:
        """Whether the point belongs to the crack."""
        return self.broken(self.opening(jump, memory), memory) & (memory.scalar > 0)

    def opens_at(self, memory: Memory) -> np.ndarray:
        """The opening from which on a point is open [m]."""
        return np.where(memory.scalar >= self.L_C, 0.0, self.L_C)

    def slid(self, jump: np.ndarray, memory: Memory) -> np.ndarray:
        """Whether the point has let go along the joint."""
        return np.linalg.norm(memory.vector, axis=1) > 0
