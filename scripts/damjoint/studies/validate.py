"""Run published tests, family by family, and compare them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from .. import InputError, RunError
from ..model.case import load
from ..post import validation
from ..post.validation import FAMILIES, Comparison
from ..runner import run
from ..statics.verdict import statement
from . import law_tests


def chosen(names: Sequence[str]) -> dict[str, list[str]]:
    """The tests by family: of families, of cases, of "all".

    Raises InputError if a name is neither.
    """
    tests: dict[str, list[str]] = {}
    for name in FAMILIES if "all" in names else names:
        if name in FAMILIES:
            tests[name] = tests_of(name)
        else:
            tests.setdefault(family_of(name), []).append(name)
    return tests


def tests_of(family: str) -> list[str]:
    """The tests of a family."""
    points = law_tests.FAMILIES.get(family, dict)()
    return [*validation.modelings(family), *points]


def family_of(name: str) -> str:
    """The family of a case.

    Raises InputError if the case has no published numbers.
    """
    references = validation.references(load(name))
    if not references:
        cases = [case for family in FAMILIES for case in validation.modelings(family)]
        allowed = ", ".join([*FAMILIES, "all", *cases])
        raise InputError(f"case {name}: has no reference values; must be one of {allowed}")
    return references[0].family


def compare(
    family: str, names: Sequence[str], out: Path, engine: str, picture: bool = True
) -> Iterator[Comparison]:
    """Run tests of a family, cases with their results in folders in `out`.

    Raises RunError if a case stops before its last level.
    """
    points = law_tests.FAMILIES.get(family, dict)()
    for name in names:
        if name in points:
            yield from validation.compare_point(family, name, law_tests.follow(points[name]))
            continue
        case = load(name)
        for result in run(case, out / case.name, False, picture, engine=engine):
            if result.stopped:
                raise RunError(f"{case.name}: {statement(result)}")
            yield from validation.compare(result)
