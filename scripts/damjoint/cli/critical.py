"""damjoint critical."""

from __future__ import annotations

import argparse

from .. import InputError
from .cases import load_case
from .options import Parser, deviations, say

SUMMARY = (
    "find the level, strength factor or parameter beyond which there is no equilibrium; exit "
    "code 1 if there is none, 3 if it is not confirmed"
)


def add(command: Parser) -> None:
    """Add the options."""
    command.add_settings()
    command.add_case()
    command.add_argument(
        "--of",
        default="level",
        metavar="WHAT",
        help="level [m], strength (factor that divides mu, c, f_t and the fracture energies), "
        "uplift (effectiveness of the drains), k_h or any other parameter (default: level)",
    )
    command.add_water(
        "water levels [m above the heel] in this order; a critical value other than the level is "
        "that at the last level (default: those of the case)"
    )
    command.add_sensitivity("the critical level, sensitivity.csv,")
    command.add_path("--out", "FOLDER", help="output folder (default: out/CASE_critical)")


#: Exit codes: there is no critical value; it is not confirmed.
NONE, NOT_CONFIRMED = 1, 3


def call(arguments: argparse.Namespace) -> int:
    """Run damjoint critical; NONE if there is no critical value, NOT_CONFIRMED."""
    from ..studies.critical_study import critical

    case = load_case(arguments, arguments.case)
    names, uncertain = list[str](), deviations(arguments)
    if arguments.sensitivity:
        from ..studies.sensitivity import names_of

        if arguments.of != "level":
            raise InputError(f"--sensitivity: needs --of level, not --of {arguments.of}")
        names = names_of(case, arguments.sensitivity, uncertain=uncertain)
    answer, lines = critical(case, arguments.of, arguments.out, names, uncertain)
    say("\n".join(lines))
    if answer.value is None:
        return NONE
    return 0 if answer.confirmed else NOT_CONFIRMED
