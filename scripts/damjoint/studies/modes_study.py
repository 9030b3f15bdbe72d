"""`damjoint modes`: natural modes of a case, their files and their picture."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from ..dynamics.modes import NaturalModes, natural_modes
from ..engines.condensed.solve import check
from ..fem.factor import single_thread
from ..input.case import Case
from ..input.constraints import ZANGAR
from ..pictures import modes_picture
from ..post import tables
from ..post.summary import aligned
from ..session import preparation, session
from .quake_result import damping_text

#: Headings of the printed table.
HEADS = [
    *("water", "rock", "mode", "frequency\n[Hz]", "period\n[s]"),
    *("mass along\nx [%]", "along\ny [%]", "damping\n[%]"),
]
#: File of the modes; its picture is CASE_modes.png.
ROWS = "modes.csv"


def compute(case: Case, number: int, progress: bool = True) -> NaturalModes:
    """The lowest modes of a case. Raises InputError, RunError."""
    with single_thread(), preparation(case, progress):
        return natural_modes(case, number)


def run(case: Case, number: int, out: Path, picture: bool = True) -> NaturalModes:
    """Compute the modes of a case and write run.json, modes.csv and a picture into a folder.

    Raises InputError, RunError.
    """
    check(case)
    natural = compute(case, number)  # which checks the number: before an earlier study is removed
    with session(case, out) as study:
        columns = {name: column.tolist() for name, column in natural.table.items()}
        tables.write_csv(out / ROWS, natural.table)
        if picture:
            modes_picture.draw(natural, about(natural), out / f"{case.name}_modes.png")
        given = {"parameters": case.values, "level": case.levels[-1], "number": number}
        study.save_without_results("complete", "", {"modes": given | columns})
    return natural


def text(natural: NaturalModes) -> str:
    """The modes as a printed table."""
    rows: list[tuple[str, ...]] = [
        (
            *((variant.water, variant.rock) if number == 1 else ("", "")),
            f"{number}",
            f"{mode.frequency:.4g}",
            f"{1 / mode.frequency:.4g}",
            f"{100 * mode.along_x:.1f}",
            f"{100 * mode.along_y:.1f}",
            f"{100 * mode.damping:.2g}",
        )
        for variant in natural.variants
        for number, mode in enumerate(variant.modes, start=1)
    ]
    return aligned(rows, HEADS, left=2)


def about(natural: NaturalModes) -> str:
    """What the modes are of, in words."""
    case = natural.case
    water = f"added mass after {'Zangar' if case['added_mass'] == ZANGAR else 'Westergaard'}"
    water = water if case["added_mass"] else "added_mass = 0: the reservoir has no mass"
    first = natural.variants[0]
    damping = damping_text({"damping": asdict(first.damping)})
    return (
        f"joints closed and undamaged; reservoir {case.levels[-1]:g} m, {water}; with "
        f"{first.water} and {first.rock} rock {damping}"
    )
