"""The dam of theme A2 of the ICOLD benchmark workshop of 1999 beside its published cracks: what
each value that is not published changes. Nothing is judged.
"""

from __future__ import annotations

from dataclasses import dataclass

from damjoint.arrays import Value
from damjoint.input.resolve import load
from damjoint.solver.load_stepper import LoadStepper

from .markdown import markdown

#: Published: tips of the crack [m from the heel] at these levels, over the height; the last 0.28 m
#: above the crest.
TIPS = (7.2, 12.0, 18.0, 24.0)
LEVELS = (0.7, 0.8, 0.9496, 80.28 / 80)
HEIGHT = 80.0


@dataclass(frozen=True)
class Variation:
    """A value that is not published, as it is in the case and otherwise."""

    settings: dict[str, Value]
    #: the part of the full load that the per cent are of: of the height (1), of the thrust (2)
    power: int = 1


#: A joint that only sliding would limit, at a slope that it does not reach.
NO_TENSION: dict[str, Value] = {"law": "friction", "adhesion": 1e4, "mu": 1.5}
#: By what is varied.
VARIATIONS = {
    "the case": Variation({}),
    "per cent of the thrust, not of the height": Variation({}, 2),
    "crest 10 m wide, not 5": Variation({"dam_crest": 10.0}),
    "density 2300 kg/m3, not 2400": Variation({"rho_dam": 2300.0}),
    "tensile strength 0.3 MPa, not 0.8": Variation({"sigma_max": 3e5}),
    "tensile strength 0.1 MPa": Variation({"sigma_max": 1e5}),
    "G_f 50 N/m, not 100": Variation({"G_f": 50.0}),
    "cohesion 1 MPa, not 2.8": Variation({"adhesion": 1e6}),
    "K_N, K_T ten times": Variation({"K_N": 1e12, "K_T": 5e11}),
    "K_N, K_T a quarter": Variation({"K_N": 2.5e10, "K_T": 1.25e10}),
    "no water in the joint": Variation({"uplift": "none"}),
    "no tensile strength (friction, mu 1.5)": Variation(NO_TENSION),
    "the same, of the thrust": Variation(NO_TENSION, 2),
    "the same, of the thrust, 2300 kg/m3": Variation(NO_TENSION | {"rho_dam": 2300.0}, 2),
}


def levels(power: int) -> list[float]:
    """The levels [m]: those below the crest by the height or by the thrust."""
    return [HEIGHT * (part ** (1 / power) if part < 1 else part) for part in LEVELS]


def tips(variation: Variation) -> list[str]:
    """The crack at the levels: broken and open length and, with what softens, its end [m]."""
    given = ",".join(map(repr, levels(variation.power)))
    results = LoadStepper(load("icold1999", variation.settings, given)).run()
    cells = []
    for time in range(1, len(LEVELS) + 1):
        row = results.state(time)
        if row["time"] < time:
            cells.append(f"none beyond {results.last['level']:.2f} m")
            continue
        reach = row["crack_length"] + row["process_zone"]
        cells.append(f"{row['crack_length']:.1f} ({reach:.1f})")
    return cells


def table() -> str:
    """The cracks at the levels, a row for each variation."""
    heads = (
        "crack, in brackets with its process zone [m]",
        *(
            f"{100 * part:.4g} %" if part < 1 else f"{HEIGHT * (part - 1):.2g} m over the crest"
            for part in LEVELS
        ),
    )
    rows = [("published", *(f"{tip:g}" for tip in TIPS))]
    rows += [(name, *tips(variation)) for name, variation in VARIATIONS.items()]
    return markdown(rows, heads)


ABOUT = """## ICOLD 1999, theme A2, not judged

A dam 80 m high and 60 m wide in an imminent failure flood (`cases/icold1999.case`, with what is
published and where). The crest's width, the density, the stiffness of the joint and what the per
cent are of were not found; strengths, energies and friction are those of another paper on the
dam. Each row changes one of them: no row has the published cracks, the tensile strength and the
density move them most. Printed by `python -m damjoint_tools.pages icold`."""
