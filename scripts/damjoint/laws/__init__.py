"""The joint laws, each a class after `Law` of base.py in the file of its name, as in pro/law_*.pro.

`rupture.py` has the class `Rupture`: the law of a case with law = rupture.
"""

from __future__ import annotations

from collections.abc import Iterator, MutableMapping
from importlib import import_module
from pathlib import Path
from typing import Any

from .base import Evidence, Law

__all__ = ["COLUMNS", "LAWS", "UNBREAKABLE", "Evidence", "Law"]


class Laws(MutableMapping[str, type[Law[Any]]]):
    """Laws by name; one that has a file is imported when it is used."""

    def __init__(self, names: list[str]) -> None:
        self._laws: dict[str, type[Law[Any]] | None] = dict.fromkeys(names)

    def __getitem__(self, name: str) -> type[Law[Any]]:
        law = self._laws[name]
        if law is None:
            law = getattr(import_module(f".{name}", __name__), name.capitalize())
            self._laws[name] = law
        return law

    def __setitem__(self, name: str, law: type[Law[Any]]) -> None:
        self._laws[name] = law

    def __delitem__(self, name: str) -> None:
        del self._laws[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._laws)

    def __len__(self) -> int:
        return len(self._laws)

    def __repr__(self) -> str:
        return f"laws {', '.join(self)}"


#: By the value of the parameter `law`.
LAWS = Laws(
    sorted({f.stem for f in Path(__file__).parent.glob("[a-z]*.py")} - {"base", "softening"})
)


def __getattr__(name: str) -> Any:
    """COLUMNS of joint.csv that only some laws have, {name: (unit, meaning)}; UNBREAKABLE."""
    if name == "COLUMNS":
        return {name: column for law in LAWS.values() for name, column in law.columns.items()}
    if name == "UNBREAKABLE":
        from .friction import UNBREAKABLE

        return UNBREAKABLE
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
