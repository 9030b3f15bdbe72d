"""The interface of a joint law: all that the package uses of it, for many points at once.

Arrays: jump (q, 3) is the displacement jump delta_n, delta_t1, delta_t2 [m]; traction (q, 3) is
sigma_n (effective), tau_1, tau_2 [Pa]; tangent (q, 3, 3) is its derivative with the jump [Pa/m].
Signs: opening > 0, tension > 0, downstream > 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, BoolArray

#: Traction (q, 3), and what computes its tangent (q, 3, 3), which the trials of a line search that
#: are not accepted do not need.
Response: TypeAlias = tuple[Array, Callable[[], Array]]

V = TypeVar("V")


@dataclass(frozen=True)
class Evidence:
    """Results of a run that `Law.hints` depends on."""

    crack_length: float
    #: whether a crack has grown unstably, or the run has not converged
    unstable: bool
    #: part of the overturning moment that the tension of the open points balances; nan: unknown
    tension_share: float


class Law(Generic[V]):
    """A law's response, internal variables V, strength and meaning; the defaults are those of an
    elastic joint, whose one method is `response`.

    Example:
        >>> class Springs(Law):
        ...     def response(self, jump, variables):
        ...         return 1e10 * jump, lambda: np.tile(1e10 * np.eye(3), (len(jump), 1, 1))
        >>> traction, tangent = Springs({}).traction_and_tangent(np.array([[1e-3, 0, 0]]), None)
        >>> traction.tolist(), tangent.shape
        ([[10000000.0, 0.0, 0.0]], (1, 3, 3))
    """

    #: names of the scalars in V, in the order of `LawVariables` of its .pro file
    variable_names: tuple[str, ...] = ()
    #: columns of joint.csv besides those of every law: {name: (unit, meaning)}
    columns: Mapping[str, tuple[str, str]] = {}
    #: what joint.csv calls the slip of this law
    slip_name = "slip"
    #: whether it softens, so that a crack can grow unstably
    softens = False
    #: whether the state under rising water depends on the steps that lead to it
    path_dependent = True
    #: whether friction and cohesion, mu and adhesion, bound its shear stress, so that it has a SSF
    has_friction = True
    #: parameter of its hardening modulus [Pa/m]; empty: it does not harden
    hardening_parameter = ""
    #: whether slip raises the shear strength
    hardens = False
    #: grouting and sawing that it includes, by their parameters
    works: tuple[str, ...] = ()
    #: whether a dam stands after all of its joint has slipped, without hardening
    stands_slipped = False
    #: coefficient of friction
    mu = 0.0
    #: tension [Pa] at which a closed point opens, and that an open point still transmits
    tensile_strength = 0.0
    open_tension = 0.0
    #: whether opening releases the shear stiffness
    releases_shear = False
    #: damage from which on a point counts as broken
    broken_damage = 1.0

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        """parameters: of pro/parameters.pro, by name."""

    def __repr__(self) -> str:
        return f"law {type(self).__name__.lower()}"

    @classmethod
    def least_energies(cls, parameters: Mapping[str, Any]) -> dict[str, tuple[float, str]]:
        """The energies [N/m] that the joint stores before it softens, and their formulas, by the
        parameter of the fracture energy that must be larger.
        """
        return {}

    @classmethod
    def violations(cls, parameters: Mapping[str, Any]) -> Iterator[str]:
        """Conditions of the law between parameters that their values violate, as messages."""
        yield from ()

    # -- internal variables

    def initial(self, points: int) -> V:
        """Internal variables of the undamaged joint."""
        return None  # type: ignore[return-value]

    def begin_step(self, variables: V, begin: float, end: float) -> V:
        """Internal variables for a step from t = begin to end."""
        return variables

    def update_internal_variables(self, jump: Array, variables: V) -> V:
        """Internal variables after a converged step."""
        return variables

    # -- response

    def response(self, jump: Array, variables: V) -> Response:
        """Traction (q, 3), and what computes the consistent tangent (q, 3, 3) where needed."""
        raise NotImplementedError

    def traction_and_tangent(self, jump: Array, variables: V) -> tuple[Array, Array]:
        """The response with its tangent (q, 3, 3)."""
        traction, tangent = self.response(jump, variables)
        return traction, tangent()

    def secant_stiffness(self, jump: Array, variables: V) -> Array:
        """A positive stiffness (q, 3, 3) that does not soften; here the tangent."""
        return self.traction_and_tangent(jump, variables)[1]

    def freeze(self, jump: Array, variables: V) -> Law[V]:
        """This law with the damage frozen that it has at a jump; here itself."""
        return self

    #: compliance [m/Pa] by which the traction along normal, tangent 1, 2 unloads from a plastic
    #: jump; 0: it unloads to the origin
    unloading_compliance: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def released_jump(self, variables: V, points: int) -> Array:
        """The origin (q, 3) to which tractions without a plastic jump unload [m]."""
        return np.zeros((points, 3))

    def release_side(self, jump: Array, variables: V) -> NDArray[np.int_]:
        """Where a point is: before the release of its shear (-1), in it (0), beyond it (1)."""
        return np.zeros(len(jump), int)

    def shear_release(self, jump: Array, variables: V) -> tuple[Array, Array]:
        """Shear stress (q, 2) on the line of the release, and its derivative by opening (q, 2)."""
        raise NotImplementedError

    def evaluate(self, jump: Array, variables: V, releasing: BoolArray | None = None) -> Response:
        """The response; releasing: points (q,) within `shear_release`."""
        traction, tangent = self.response(jump, variables)
        if releasing is None or not releasing.any():
            return traction, tangent
        shear, slope = self.shear_release(jump, variables)
        traction[releasing, 1:] = shear[releasing]

        def within() -> Array:
            matrix = tangent()
            matrix[releasing, 1:, 0] = slope[releasing]
            return matrix

        return traction, within

    # -- meaning of jump and internal variables

    def damage(self, jump: Array, variables: V) -> Array:
        """Used part of the strength: 0 undamaged to 1 broken; here 1 where the point is open."""
        return self.is_open(jump, variables).astype(float)

    def is_open(self, jump: Array, variables: V) -> BoolArray:
        """Whether a point belongs to the crack."""
        return jump[:, 0] > 0

    def gapes(self, jump: Array, variables: V) -> BoolArray:
        """Whether a point of the crack is not closed: beyond what grout and saw leave."""
        return self.is_open(jump, variables) & (
            jump[:, 0] > self.added_thickness(variables, len(jump))
        )

    def is_broken(self, jump: Array, variables: V) -> BoolArray:
        """Whether the damage of a point is `broken_damage` or more, whether it is open or not."""
        return self.damage(jump, variables) >= self.broken_damage

    def cohesion_left(self, jump: Array, variables: V) -> Array:
        """Remaining part of the cohesion of a point (q,), 1 to 0; here 1 until it is broken."""
        return np.where(self.is_broken(jump, variables), 0.0, 1.0)

    def opening_of_crack(self, variables: V, points: int) -> Array:
        """The opening [m] beyond which a point belongs to the crack."""
        return np.zeros(points)

    def slip(self, variables: V, points: int) -> Array:
        """Size of the plastic or released slip (q,) [m]."""
        return np.zeros(points)

    @property
    def stages(self) -> Sequence[float]:
        """Openings in the course of the release of the shear and of the softening [m]."""
        return ()

    def released_part(self, jump: Array, variables: V) -> Array:
        """The part of the shear stiffness that opening has released (q,)."""
        return np.zeros(len(jump))

    def has_slipped(self, variables: V, points: int) -> BoolArray:
        """Whether a point has slipped, or its shear has been released."""
        return self.slip(variables, points) > 0

    def in_process_zone(self, jump: Array, variables: V) -> BoolArray:
        """Whether a point softens: it is damaged and not broken."""
        return (self.damage(jump, variables) > 0) & ~self.is_broken(jump, variables)

    def added_thickness(self, variables: V, points: int) -> Array:
        """Thickness that grout adds to the joint and the saw takes off, < 0 (q,) [m]."""
        return np.zeros(points)

    def column_values(self, variables: V) -> dict[str, Array]:
        """The values (q,) of `columns`."""
        return {}

    # -- strength

    def shear_strength(self, sigma_n: Array, damage: Array | float, slip: Array | float) -> Array:
        """Largest shear stress (q,) [Pa] at a normal stress, damage, slip [m]; or infinite."""
        return np.full(np.shape(sigma_n), np.inf)

    @property
    def intact_cohesion(self) -> float:
        """Shear strength [Pa] of an undamaged point without normal stress; or infinite."""
        none = np.zeros(1)
        return float(self.shear_strength(none, none, none)[0])

    def tension_left(self, damage: Array) -> Array:
        """Tension (q,) [Pa] that points at a damage may still carry without a loss of their shear
        strength: it presses on the others.
        """
        return np.zeros(len(damage))

    #: its formula, for legends, without hardening
    shear_strength_formula = ""

    def shear_resistance(self, normal: float, length: float, damage: float, slip: float) -> float:
        """Shear force [N/m] that a joint of a length [m] transmits under an effective normal force
        (compression > 0), at a mean damage and slip [m]: mu N + c L, c reduced by the damage.
        """
        cohesion = self.shear_strength(np.zeros(1), damage, slip)[0]
        return float(self.mu * normal + cohesion * length)

    def shear_bound(self, normal: Array, length: float) -> Array:
        """Largest shear force [N/m] that a joint of a length [m] transmits under an effective
        normal force (compression > 0), however the stress is distributed; infinite without a bound.
        """
        return np.full(np.shape(normal), np.inf)

    # -- words

    def hints(self, evidence: Evidence) -> Iterator[str]:
        """What an engineer should know of a result of this law."""
        yield from ()


class SofteningLaw(Law[V]):
    """A law with damage, which can be frozen for a step: nothing breaks, slip does not soften.

    The methods of the response take `frozen`, what `frozen_damage` has returned; None: the damage
    grows.
    """

    @classmethod
    def least_energies(cls, parameters: Mapping[str, Any]) -> dict[str, tuple[float, str]]:
        """See `Law`."""
        strength, stiffness = parameters["sigma_max"], parameters["K_N"]
        return {"G_f": (strength * strength / (2 * stiffness), "sigma_max^2/(2 K_N)")}

    def frozen_damage(self, jump: Array, variables: V) -> Array:
        """What is frozen of each point at a jump (q,): its damage, or its share of stiffness."""
        raise NotImplementedError

    def response(self, jump: Array, variables: V, frozen: Array | None = None) -> Response:
        """See `Law`."""
        raise NotImplementedError

    def secant_stiffness(self, jump: Array, variables: V, frozen: Array | None = None) -> Array:
        """See `Law`."""
        raise NotImplementedError

    def update_internal_variables(
        self, jump: Array, variables: V, frozen: Array | None = None
    ) -> V:
        """See `Law`."""
        raise NotImplementedError

    def freeze(self, jump: Array, variables: V) -> Law[V]:
        """See `Law`."""
        return FrozenDamage(self, self.frozen_damage(jump, variables))


class FrozenDamage(Law[V]):
    """A softening law with frozen damage: its response and the internal variables after a step."""

    def __init__(self, law: SofteningLaw[V], frozen: Array) -> None:
        self.law, self.frozen = law, frozen

    def response(self, jump: Array, variables: V) -> Response:
        """See `Law`."""
        return self.law.response(jump, variables, self.frozen)

    def secant_stiffness(self, jump: Array, variables: V) -> Array:
        """See `Law`."""
        return self.law.secant_stiffness(jump, variables, self.frozen)

    def update_internal_variables(self, jump: Array, variables: V) -> V:
        """See `Law`."""
        return self.law.update_internal_variables(jump, variables, self.frozen)
