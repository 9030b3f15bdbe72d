"""Concrete gravity dams on a thin joint that opens, breaks, slides and lets water in (GetDP and Gmsh)."""

from pathlib import Path

__version__ = "0.1.0"

#: The folder with geo/, pro/, cases/ and reference/.
ROOT = Path(__file__).resolve().parents[2]


class InputError(ValueError):
    """Bad input: one line that names the parameter, its value and what is allowed. The command exits with 2."""


class RunError(RuntimeError):
    """A computation that failed for another reason than the input. The command exits with 1."""
