"""Published tests of the joint laws on one element: paths of a point, row by row a step.

Each function is a family: the tests by the names that the column `modeling` of
reference/FAMILY.csv has. Units are those of the published test.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import toms748

from ..arrays import Array, Value, Values
from ..input.resolve import NO_DAM, load
from ..laws import Law

#: Largest jump that a loaded point is searched within [m].
LARGEST_JUMP = 10.0
#: Accuracy of the search [m].
ACCURACY = 1e-20


@dataclass(frozen=True)
class Loaded:
    """A component of the jump in equilibrium: traction + spring x jump = load [Pa, Pa/m]."""

    load: float
    spring: float = 0.0


#: A component of a step: the jump itself [m], or in equilibrium with a load.
Control = float | Loaded


@dataclass(frozen=True)
class LawTest:
    """A law with its parameters, and its steps: t, then normal, first and second tangential."""

    law: str
    settings: Values
    steps: Sequence[tuple[float, Control, Control, Control]]
    #: of the water in the joint
    pressure: float = 0.0


def follow(test: LawTest) -> dict[str, Array]:
    """Columns, a row per step: t, jump, effective traction, damage; u_x, u_y, the jump of a plane
    inclined by 30 degrees; total_sigma_n; largest_sigma_n up to the step.
    """
    law = load("dam", {**NO_DAM, **test.settings, "law": test.law}).law
    variables, jump, rows, before = law.initial(1), np.zeros(3), [], 0.0
    for time, *controls in test.steps:
        variables, before = law.begin_step(variables, before, time), time
        # prescribed components first; of loaded ones the normal one, independent of the others
        order = sorted(range(3), key=lambda k: isinstance(controls[k], Loaded))
        for k in order:
            control = controls[k]
            jump[k] = (
                in_equilibrium(law, variables, jump, k, control)
                if isinstance(control, Loaded)
                else control
            )
        traction = law.traction_and_tangent(jump[None], variables)[0][0]
        variables = law.update_internal_variables(jump[None], variables)
        rows.append((time, *jump, *traction, *law.damage(jump[None], variables)))
    names = "t", "delta_n", "delta_t1", "delta_t2", "sigma_n", "tau_1", "tau_2", "damage"
    columns = dict(zip(names, np.array(rows).T, strict=True))
    half, across = 0.5, np.sqrt(0.75)  # sine and cosine of 30 degrees
    columns["u_x"] = across * columns["delta_t1"] - half * columns["delta_n"]
    columns["u_y"] = half * columns["delta_t1"] + across * columns["delta_n"]
    columns["total_sigma_n"] = columns["sigma_n"] - test.pressure
    columns["largest_sigma_n"] = np.maximum.accumulate(columns["sigma_n"])
    return columns


def in_equilibrium(
    law: Law[Any], variables: Any, jump: Array, component: int, control: Loaded
) -> float:
    """The component of the jump at which a loaded point is in equilibrium."""
    at = jump.copy()

    def excess(value: float) -> float:
        at[component] = value
        traction = law.traction_and_tangent(at[None], variables)[0][0, component]
        return float(traction + control.spring * value - control.load)

    size = 1e-9
    while excess(jump[component] - size) > 0 or excess(jump[component] + size) < 0:
        size *= 4
        if size > LARGEST_JUMP:
            raise ValueError(f"no equilibrium of component {component} at jump {jump}")
    bounds = jump[component] - size, jump[component] + size
    return float(toms748(excess, *bounds, xtol=ACCURACY))


def ramp(times: Sequence[float], values: Sequence[float]) -> Iterator[tuple[float, float]]:
    """Steps of length 1 along a piecewise linear function of t."""
    for t in np.arange(1.0, times[-1] + 1):
        yield float(t), float(np.interp(t, times, values))


#: Steps of a test, see `LawTest`.
Steps = list[tuple[float, Control, Control, Control]]


def pulled(path: Iterable[tuple[float, float]], E: float, pressure: float = 0.0) -> Steps:
    """Steps of a joint and a cube of 1 m in series, of Young's modulus E [Pa], pulled by
    displacements at times; pressure: of the water in the joint [Pa].
    """
    return [(t, Loaded(E * u + pressure, E), 0.0, 0.0) for t, u in path]


def sheared(times: Sequence[float], normal: Sequence[float], along: Sequence[float]) -> Steps:
    """Steps of prescribed jumps, normal and along the first tangent."""
    both = zip(ramp(times, normal), ramp(times, along), strict=True)
    return [(t, n, s, 0.0) for (t, n), (_, s) in both]


def ssnp162() -> dict[str, LawTest]:
    """A cube of 1 m and a joint in series, pulled by a displacement; the joint alone in shear.

    Other modelings are these on other elements: B, C, M, N, O that of A; F, Q, R of E; H, I of G; P
    of D; K, L of J.
    """
    tests, quarters = dict[str, LawTest](), (0, 15, 30, 45, 60)
    rupture: dict[str, Value] = {"K_N": 1e12, "K_T": 2e12, "sigma_max": 1e5, "alpha": 1.5}
    rupture |= {"pena_rupture": 0.5, "pena_contact": 3.0}
    E, elastic, broken = 3e12, 1e5 / 1e12 + 1e5 / 3e12, 1.5e-7
    softened = 0.2 * elastic + 0.8 * broken
    path = (0, elastic, softened, -elastic, broken * 0.99999999)
    tests["A I"] = LawTest("rupture", rupture, pulled(ramp(quarters, path), E))
    normal = (0, 1.1e-7, 1.1e-7, 2.2e-8, 2.2e-8)
    steps = sheared(quarters, normal, (0, 0, broken, broken, 0))
    tests["A II"] = LawTest("rupture", rupture, steps)
    # in 3D, sheared along z
    normal = (0, 1.1e-7, 1.1e-7, 1.1e-7 / 9, 1.1e-7 / 9)
    across = dict(ramp((0, 30, 60), (0, -broken, broken)))
    steps = [(t, n, 0.0, across[t]) for t, n in ramp(quarters, normal)]
    tests["B III"] = LawTest("rupture", rupture, steps)
    # with water of 500 Pa in the joint
    p = 500.0
    elastic = 1e5 / 1e12 + (1e5 - p) / E
    softened = 0.2 * elastic + 0.8 * broken
    path = (0, elastic, softened, -elastic, broken * 0.99999999)
    tests["G"] = LawTest("rupture", rupture, pulled(ramp(quarters, path), E, p), p)

    friction: Values = {"K_N": 1e12, "K_T": 2e12, "mu": 0.5, "adhesion": 1e5, "pena_tang": 2e6}
    E, quarters = 3e10, (0, 5, 10, 15, 20)
    elastic = 2e5 / 1e12 + 2e5 / E
    path = (0, elastic, 2 * elastic, -elastic / 3, 1e-10 * elastic)
    tests["D I"] = LawTest("friction", friction, pulled(ramp(quarters, path), E))
    normal = (0, 0, -elastic / 3, -elastic / 3, -elastic / 3)
    steps = sheared(quarters, normal, (0, *(3 * elastic * sign for sign in (1, 1, -1, 1))))
    tests["D II"] = LawTest("friction", friction, steps)
    # with water of 50 kPa in the joint
    wet: Values = {"K_N": 1e7, "K_T": 2e7, "mu": 0.5, "adhesion": 1e5, "pena_tang": 20.0}
    p = 5e4
    elastic = 2e5 / 1e7 + (2e5 - p) / E
    wet_path = (0, elastic, 2 * elastic, -((2e5 / 3 - p) / 1e7 + 2e5 / 3 / E))
    tests["J I"] = LawTest("friction", wet, pulled(ramp(quarters[:-1], wet_path), E, p), p)
    # in 3D: sheared to and fro while it slips across
    soft: Values = {"K_N": 0.1, "K_T": 0.15, "mu": 0.2, "adhesion": 0.1, "pena_tang": 1e-7}
    turns = (0, 15, 30, 45, 60)
    along = dict(ramp(turns, (0, 0, 20, -20, 20)))
    across = dict(ramp((0, 30, 60), (0, 50 / 3, 50)))
    closed = dict(ramp(turns, (0, -50, -50, -50, -50)))
    steps = [(t, closed[t], along[t], across[t] if t > 15 else 0.0) for t in along]
    tests["E"] = LawTest("friction", soft, steps)
    return tests


def ssnp164() -> dict[str, LawTest]:
    """A cube of 1 m and a joint of law endo in series."""
    endo: dict[str, Value] = {"K_N": 1e12, "K_T": 2e12, "sigma_max": 9000.0, "adhesion": 1e4}
    endo |= {"mu": 1.0, "G_f": 1.0}
    E = 3e12
    path = [*ramp((0, 20, 40, 60, 80), (0, 6e-6, 1e-4, 5e-4, 4.9999e-4))]
    along = ramp((0, 10, 20, 30, 40, 50), (0, 0, 5e-7, 3e-5, 9e-5, 5e-4))
    pressed = ramp((0, 10, 20, 30, 40), (0, 1e5, 1e6, 1e7, 1e8))
    to_and_fro = (0, 0, 5e-7, 3e-5, 2.9995e-5, 9e-5, 5e-4)
    lifted = ramp((0, 10, 20, 30, 40, 50, 60), to_and_fro)
    return {
        "A": LawTest("endo", endo, pulled(path, E)),
        "B": LawTest("endo", endo, [(t, Loaded(-1e4), jump, 0.0) for t, jump in along]),
        # the joint's other face is moved across by 1e-6 m
        "C": LawTest("endo", endo, [(t, Loaded(E * u, E), 0.0, -1e-6) for t, u in path]),
        # water presses the cube against a wall
        "D": LawTest("endo", endo, [(t, Loaded(p, E), 0.0, 0.0) for t, p in pressed]),
        # as B, while water lifts the cube up to two thirds of the pressure on it
        "E": LawTest(
            "endo", endo, [(t, Loaded(-1e4 * (1 - t / 90)), jump, 0.0) for t, jump in lifted]
        ),
    }


def ssnv503() -> dict[str, LawTest]:
    """A slider 40 mm long on a plane inclined by 30 degrees, pressed by 300 MPa and pushed along
    the plane by 99 and 101 % of the friction, against two springs of 2 N/mm [mm, MPa].
    """
    friction: Values = {"K_N": 1e5, "K_T": 1e5, "mu": 0.3, "adhesion": 0.0}
    pushed = {"J": 0.0, "J 99 %": 0.99, "J 101 %": 1.01}
    return {
        name: LawTest(
            "friction",
            friction,
            [(t, Loaded(-300 * t), Loaded(share * 0.3 * 300 * t, 4 / 40), 0.0) for t in (0.5, 1.0)],
        )
        for name, share in pushed.items()
    }


FAMILIES = {"ssnp162": ssnp162, "ssnp164": ssnp164, "ssnv503": ssnv503}
