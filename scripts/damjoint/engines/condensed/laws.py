"""The joint laws of pro/law_*.pro once more, for many points at once: the condensed engine's.

A law is a class with `start`, `respond` and `remember`, and what its memory means. Arrays: jump (q,
3) is delta_n, delta_t1, delta_t2 [m]; traction (q, 3) is sigma_n (effective), tau_1, tau_2 [Pa];
tangent (q, 3, 3) its derivative [Pa/m]; the memory a scalar (q,) and a vector (q, 2). Formulas:
design of JOINT_MECA_RUPT and JOINT_MECA_FROT (code_aster R7.01.25).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...scene.case import Case


@dataclass
class Memory:
    """What a joint remembers at q points: scalar (q,), vector (q, 2) [m]."""

    scalar: np.ndarray
    vector: np.ndarray


class Rupture:
    """Cohesive rupture.

    Memory: kappa, the largest opening so far, and the released slip.
    """

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
            else max(self.L_C * np.tan(case["alpha"] * np.pi / 4), case.shared["sudden"][0])
        )

    def start(self, points: int) -> Memory:
        """The virgin joint."""
        return Memory(np.full(points, self.delta_e), np.zeros((points, 2)))

    def broken(self, opening: np.ndarray, kappa: np.ndarray) -> np.ndarray:
        """Whether the bond has gone."""
        return (opening >= self.L_C) | (kappa >= self.L_C)

    def tangential(self, opening: np.ndarray) -> np.ndarray:
        """Tangential stiffness [Pa/m]."""
        return np.where(opening <= 0, self.K_T, self.K_T * np.maximum(1 - opening / self.L_CT, 0))

    def respond(
        self, jump: np.ndarray, memory: Memory, secant: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Traction and tangent; secant: the positive stiffness that never softens instead of the
        tangent.
        """
        opening, kappa, slip = jump[:, 0], memory.scalar, jump[:, 1:] - memory.vector
        closed, broken = opening <= 0, self.broken(opening, kappa)
        unloading = opening <= kappa
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
            [closed, broken, unloading], [self.contact, self.artificial * self.K_N, back], softening
        )
        shear = self.tangential(opening)
        traction = np.column_stack([normal, shear[:, None] * slip])
        tangent = np.zeros((len(jump), 3, 3))
        tangent[:, 0, 0] = (
            np.maximum(stiffness, self.artificial * self.K_N) if secant else stiffness
        )
        tangent[:, 1, 1] = tangent[:, 2, 2] = np.maximum(shear, self.artificial * self.K_T)
        if not secant:
            falling = np.where((opening > 0) & (opening < self.L_CT), -self.K_T / self.L_CT, 0)
            tangent[:, 1:, 0] = falling[:, None] * slip
        return traction, tangent

    def remember(self, jump: np.ndarray, memory: Memory) -> Memory:
        """The memory after convergence."""
        free = self.tangential(jump[:, 0]) <= 0
        return Memory(
            np.maximum(memory.scalar, jump[:, 0]),
            np.where(free[:, None], jump[:, 1:], memory.vector),
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
        return self.broken(jump[:, 0], memory.scalar) & (memory.scalar > 0)

    def slid(self, jump: np.ndarray, memory: Memory) -> np.ndarray:
        """Whether the point has let go along the joint."""
        return np.linalg.norm(memory.vector, axis=1) > 0


class Friction:
    """Mohr-Coulomb friction with hardening, implicit return.

    Memory: lambda, the cumulated slip, and the slip.
    """

    def __init__(self, case: Case) -> None:
        self.K_N, self.K_T, self.H = case["K_N"], case["K_T"], case["pena_tang"]
        self.mu, self.adhesion = case["mu"], case["adhesion"]
        self.artificial = case.shared["artificial"][0]
        self.opens_at = self.adhesion / (self.mu * self.K_N)

    def start(self, points: int) -> Memory:
        """The virgin joint."""
        return Memory(np.zeros(points), np.zeros((points, 2)))

    def trial(self, jump: np.ndarray, memory: Memory) -> tuple[np.ndarray, ...]:
        """Normal stress, size and direction of the elastic shear stress, slip of this step."""
        normal = self.K_N * np.minimum(jump[:, 0], self.opens_at)
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
        self, jump: np.ndarray, memory: Memory, secant: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Traction and (unsymmetric) tangent; the law never softens, so that secant changes
        nothing.
        """
        normal, size, n, slip = self.trial(jump, memory)
        traction = np.column_stack([normal, (size - self.K_T * slip)[:, None] * n])
        closed, sliding = jump[:, 0] <= self.opens_at, slip > 0
        tangent = np.zeros((len(jump), 3, 3))
        tangent[:, 0, 0] = np.where(closed, self.K_N, self.artificial * self.K_N)
        left = np.where(sliding, 1 - self.K_T * slip / np.maximum(size, 1e-300), 1.0)
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

    def remember(self, jump: np.ndarray, memory: Memory) -> Memory:
        """The memory after convergence."""
        _, _, n, slip = self.trial(jump, memory)
        return Memory(memory.scalar + slip, memory.vector + slip[:, None] * n)

    def damage(self, jump: np.ndarray, memory: Memory) -> np.ndarray:
        """1 where the joint is open."""
        return self.open(jump, memory).astype(float)

    def open(self, jump: np.ndarray, memory: Memory) -> np.ndarray:
        """Whether the opening is beyond that of the cap adhesion/mu."""
        return jump[:, 0] > self.opens_at

    def slid(self, jump: np.ndarray, memory: Memory) -> np.ndarray:
        """Whether the point has slipped."""
        return memory.scalar > 0


LAWS = {"rupture": Rupture, "friction": Friction}
