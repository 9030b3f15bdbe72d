"""Template of a case file: the 45 m dam of the defaults, every parameter with its meaning."""

from __future__ import annotations

import re
from pathlib import Path

from .. import InputError
from ..storage import atomic_write
from .parameters import Parameter, declared

HEAD = """// {name} - a dam on rock. It runs as it is: damjoint run {name}
// Change the values of your dam. Lines that begin with // are the other parameters at their
// defaults; -1: the value follows from others, as the line says. A value is in
// the unit at the end of its line, or has a unit of its own: 25*GPa, 2.4*t/m3, 50*kN/m, 5*mm.

title = "{title}";

// Reservoir and tailwater [m above the base's heel] at t = 1, 2, ..., from 0; they may go down.
levels() = {{30, 40, 45}};
tail_levels() = {{0, 0, 3}};

// Corners of the downstream face between base and crest: x and height [m] of each, upwards.
// downstream_face() = {{20, 20, 8, 38}};

// Lift joints at these heights [m] above the base; the end of this file has values of one joint.
// lift_heights() = {{15, 30}};
"""

#: After the defaults, which must not follow a block that sets them.
TAIL = """
// Values that one of the joints base, lift_15_m, lift_30_m has for itself; in all others it has
// the defaults.
// Struct Joint::lift_15_m [ law "friction", mu 1, adhesion 0.1*MPa ];"""

#: Parameters that differ from dam to dam.
COMMON = (
    *("law", "uplift", "dam_base", "dam_crest", "dam_height", "E_dam", "E_found", "nu", "rho_dam"),
    *("K_N", "K_T", "sigma_max", "mu", "adhesion", "G_f", "G_t"),
)


def line(parameter: Parameter, value: str) -> str:
    """A statement and the parameter's meaning; a comment unless the parameter is in COMMON."""
    value = f'"{value}"' if parameter.text else value
    about = parameter.meaning + (f"; {parameter.matters}" if parameter.matters else "")
    if parameter.automatic:
        about += f"; {parameter.help}"
    if parameter.choices:
        about += f"; {parameter.allowed()}"
    mark = "" if parameter.name in COMMON else "// "
    return f"{mark}default_{parameter.name} = {value};  // {about}"


#: Values of the example: of parameters that are -1 by default, and with units.
EXAMPLE = {"E_dam": "25*GPa", "E_found": "25*GPa", "G_f": "100*N/m", "rho_dam": "2.4*t/m3"}
EXAMPLE |= {"sigma_max": "0.2*MPa", "adhesion": "0.2*MPa", "G_t": "1000*N/m"}


def text(name: str, title: str) -> str:
    """The text of the file."""
    lines, group = [HEAD.format(name=name, title=title)], ""
    for parameter in declared().values():
        if parameter.group != group:
            group = parameter.group
            lines.append(f"\n// {group}")
        lines.append(line(parameter, EXAMPLE.get(parameter.name, parameter.default)))
    return "\n".join([*lines, TAIL]) + "\n"


def write(path: Path) -> None:
    """Write the file.

    Raises InputError if the path exists, does not end in .case, or can not be written.
    """
    if path.suffix != ".case":
        raise InputError(f"new = {path}: must end in .case")
    if path.exists():
        raise InputError(f"new = {path}: must not exist yet")
    try:
        title = re.sub(r'["\\\n]', "'", path.stem)
        with atomic_write(path) as part:
            part.write_text(text(re.sub(r"\s", " ", path.name), title), encoding="utf-8")
    except OSError as error:
        raise InputError(f"new = {path}: {error}") from None
