"""The picture of the joint laws in the theory page."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from damjoint.arrays import Array
from damjoint.input.resolve import load
from damjoint.laws import LAWS, Law
from damjoint.pictures.drawing import picture_style, write_picture

#: Strengths at which all laws have the same tensile strength, cohesion and fracture energies.
MATERIAL = {"sigma_max": 2e5, "adhesion": 2e5, "mu": 0.8, "G_f": 100.0, "G_t": 100.0}
#: A law, and its softening curve if it is not linear.
EXPONENTIAL = "bond, exponential"
#: Compression of the sheared joint [Pa]; steps along a path.
PRESSURE, STEPS = 2e5, 400
#: Largest displacement jump of the picture [m].
LARGEST = 2e-3


def stresses(law: Law[Any], jump_after: Callable[[float, Any], tuple[float, float]]) -> Array:
    """Jumps and stresses (STEPS, 4) along a path: delta_n, delta_t [m], sigma_n, tau [Pa].

    jump_after: delta_n, delta_t for a share of `LARGEST` and the internal variables before it.
    """
    variables, rows = law.initial(1), []
    for share in np.linspace(0, 1, STEPS) ** 3:
        normal, tangential = jump_after(share * LARGEST, variables)
        jump = np.array([[normal, tangential, 0.0]])
        traction = law.traction_and_tangent(jump, variables)[0][0]
        variables = law.update_internal_variables(jump, variables)
        rows.append((normal, tangential, traction[0], traction[1]))
    return np.array(rows)


def pressed(law: Law[Any], tangential: float, variables: Any) -> tuple[float, float]:
    """The jump at which a sheared point carries `PRESSURE`, by bisection of its normal part."""
    low, high = -LARGEST, LARGEST
    for _ in range(60):
        middle = (low + high) / 2
        jump = np.array([[middle, tangential, 0.0]])
        too_low = law.traction_and_tangent(jump, variables)[0][0, 0] < -PRESSURE
        low, high = (middle, high) if too_low else (low, middle)
    return high, tangential


@picture_style()
def draw(path: Path) -> None:
    """Tension, shear under constant compression, and both together, a line for each law."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 3.8), layout="constrained")
    FigureCanvasAgg(figure)
    tension, shear, both = figure.subplots(1, 3)
    for name in (*sorted(LAWS), EXPONENTIAL):
        law_name, _, softening = name.partition(", ")
        curve = {"softening": softening} if softening else {}
        law = load("dam", {**MATERIAL, **curve, "law": law_name}).law
        opened = stresses(law, lambda size, _: (size, 0.0))
        sheared = stresses(law, partial(pressed, law))
        mixed = stresses(law, lambda size, _: (size, size))
        # bond is below the others where they coincide
        style = {"lw": 4, "alpha": 0.5} if name == "bond" else {"lw": 1.5}
        (line,) = tension.plot(1e3 * opened[:, 0], opened[:, 2] / 1e3, label=name, **style)
        style["color"] = line.get_color()
        shear.plot(1e3 * sheared[:, 1], sheared[:, 3] / 1e3, label=name, **style)
        both.plot(1e3 * mixed[:, 0], mixed[:, 2] / 1e3, label=name, **style)
        both.plot(1e3 * mixed[:, 0], mixed[:, 3] / 1e3, "--", **style)
    tension.set(title="tension", xlabel="opening [mm]", ylabel="$\\sigma_n'$ [kPa]")
    shear.set(title=f"shear under {PRESSURE / 1e3:g} kPa", xlabel="tangential jump [mm]")
    shear.set(ylabel="$\\tau$ [kPa]", ylim=(0, 500))
    both.set(title="both: opening = tangential jump", xlabel="opening [mm]")
    both.set(ylabel="$\\sigma_n'$ (full), $\\tau$ (dashed) [kPa]", ylim=(-20, 300))
    for axes in (tension, shear, both):
        axes.legend(fontsize=8)
        axes.grid(alpha=0.3)
    write_picture(figure, path, 110)
