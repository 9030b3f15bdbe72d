"""The file of a case by its letter, name or path."""

from __future__ import annotations

import os
from pathlib import Path

from .. import InputError, data, meant

CASES = data("cases")


def is_name(text: str) -> bool:
    """Whether a text can name a case and its files: a printable part of a path, not . or .."""
    single = Path(text).name == text and text.strip(".")
    return bool(single) and text.isprintable() and len(text.encode()) <= LONGEST_NAME


#: Limit of a case's name [bytes]; that of a file's name is 255.
LONGEST_NAME = 200


def case_file(case: str) -> Path:
    """The file of a case, by letter, name or path.

    Raises InputError if there is none, or its name can not be that of a folder.
    """
    for path in (CASES / f"{case.lower()}.case", Path(case)):
        if path.suffix == ".case" and os.path.isfile(path):  # does not raise, whatever the name
            if not is_name(path.stem):
                raise InputError(
                    f"case {case!r}: must be called by printable letters, at most {LONGEST_NAME} "
                    "bytes, and not . or .."
                )
            return path
    if Path(case).suffix == ".case":
        raise InputError(f"case {case}: there is no such file; damjoint new {case} writes one")
    names = [path.stem for path in sorted(CASES.glob("*.case"))]
    hint = meant(case, names)
    hint += f"{' ' if hint else ''}allowed: {', '.join(names)}, or the path of a .case file"
    raise InputError(f"case {case}: unknown; {hint}")
