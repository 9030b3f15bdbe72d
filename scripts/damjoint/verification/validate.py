"""Run published tests, family by family, and compare them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from .. import InputError, RunError
from ..arrays import Array
from ..input.resolve import load
from ..post import validation
from ..post.validation import FAMILIES, Comparison
from ..processes import in_processes
from ..runner import run
from ..statics.statement import statement
from . import block_tests, law_tests, path_tests, quake_tests, wedge_tests


def chosen(names: Sequence[str]) -> dict[str, list[str]]:
    """The tests by family: of families, of cases, of "all".

    Raises InputError if a name is neither.
    """
    tests: dict[str, list[str]] = {}
    for name in FAMILIES if "all" in names else names:
        if name in FAMILIES:
            tests[name] = tests_of(name)
        else:
            tests.setdefault(published_family(name), []).append(name)
    return tests


def tests_of(family: str) -> list[str]:
    """The tests of a family."""
    return [*validation.modelings(family), *tests_without_case(family, "auto")]


def tests_without_case(family: str, engine: str) -> dict[str, Callable[[], dict[str, Array]]]:
    """The tests of a family that are not static runs of a case: functions that compute their
    columns, a row per step. engine: of the paths of a load, see `engine_of`.
    """
    laws = law_tests.FAMILIES.get(family, dict)()
    quakes = quake_tests.FAMILIES.get(family, dict)()
    wedges = wedge_tests.FAMILIES.get(family, dict)()
    tests: dict[str, Callable[[], dict[str, Array]]] = {}
    for name, law in laws.items():
        tests[name] = partial(law_tests.follow, law)
    for name, path in path_tests.FAMILIES.get(family, dict)().items():
        tests[name] = partial(path_tests.follow, path, engine)
    for name, quake in quakes.items():
        tests[name] = partial(quake_tests.follow, quake, validation.last_time(family))
    for name, block in block_tests.FAMILIES.get(family, dict)().items():
        tests[name] = partial(block_tests.follow, block)
    for name, wedge in wedges.items():
        tests[name] = partial(wedge_tests.follow, wedge)
    return tests


def published_family(name: str) -> str:
    """The family of a case. Raises InputError if the case has no published numbers."""
    references = validation.references(load(name))
    if not references:
        cases = [case for family in FAMILIES for case in validation.modelings(family)]
        allowed = ", ".join([*FAMILIES, "all", *cases])
        raise InputError(f"case {name}: has no reference values; must be one of {allowed}")
    return references[0].family


@dataclass(frozen=True)
class Options:
    """How tests are run: folder of the results of cases, engine, whether pictures are drawn."""

    out: Path
    engine: str = "auto"
    picture: bool = True


def compare(
    family: str, names: Sequence[str], options: Options, jobs: int | None = 1
) -> Iterator[Comparison]:
    """Run tests of a family in so many processes (None: one per core).

    Raises RunError if a case stops before its last level.
    """
    tasks = [(family, name, options) for name in names]
    compared = dict(in_processes(compare_test, tasks, jobs, family))
    for number in range(len(tasks)):
        yield from compared[number]


def compare_test(task: tuple[str, str, Options], progress: bool) -> list[Comparison]:
    """Run a test of a family."""
    family, name, options = task
    others = tests_without_case(family, options.engine)
    if name in others:
        return list(validation.compare_steps(family, name, others[name]()))
    case, compared = load(name), list[Comparison]()
    out, engine = options.out / case.name, options.engine
    for result in run(case, out, False, options.picture, progress, engine):
        if result.stopped:
            raise RunError(f"{case.name}: {statement(result)}")
        compared += validation.compare(result)
    return compared
