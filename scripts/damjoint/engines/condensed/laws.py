"""The joint laws of pro/law_*.pro once more, for many points at once: the condensed engine's.

A law is a class with `start`, `stage`, `respond`, `side`, `hold` and `remember`, and what its
memory means.
Arrays: jump (q, 3) is delta_n, delta_t1, delta_t2 [m]; traction (q, 3) is sigma_n (effective),
tau_1, tau_2 [Pa]; tangent (q, 3, 3) its derivative [Pa/m]; the memory a scalar (q,) and a vector
(q, 2).
Formulas: design of JOINT_MECA_RUPT and JOINT_MECA_FROT (code_aster R7.01.25).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...scene.case import Case


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
            else max(self.L_C * np.tan(case["alpha"] * np.pi / 4), case.shared["sudden"][0])
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


LAWS = {"rupture": Rupture, "friction": Friction, "bond": Bond}
