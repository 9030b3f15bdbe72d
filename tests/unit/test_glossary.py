"""The names that users meet are in the glossary or in a page that it links; public names of the
package use the field's terms."""

import ast
import re
from pathlib import Path

import damjoint
import pytest
from damjoint import cli
from damjoint.laws import COLUMNS, LAWS
from damjoint.model.parameters import declared
from damjoint.model.results import FLUX, HISTORY, JOINT
from damjoint.studies.check import CHECK
from damjoint.studies.failure_path import CRITICAL

PACKAGE = Path(damjoint.__file__).parent
REFERENCE = Path(__file__).parents[2] / "reference"
VERDICTS = "stands", "sliding", "overturning", "broken through", "out of range", "not converged"
VERDICTS += "no equilibrium", "interrupted", "pass", "fail", "not checked", "crushed toe"
#: Words that are no terms of the field, and what to write in their place.
FORBIDDEN = {
    "attempt": "strategy",
    "attempts": "strategies",
    "burst": "unstable crack growth",
    "jumped": "displacement jump",
    "knee": "limit point",
    "loose": "fully slipped",
    "remember": "update_internal_variables",
    "stage": "begin_step",
    "virgin": "undamaged",
}


def names_in(*pages):
    """What stands between backticks."""
    text = "".join((REFERENCE / f"{page}.md").read_text() for page in pages)
    return set(re.findall(r"`([^`\n]+)`", text))


@pytest.mark.parametrize(
    "names, pages",
    [
        (JOINT | COLUMNS | FLUX | HISTORY, ["glossary"]),
        (CHECK | CRITICAL, ["glossary", "results"]),
        (LAWS, ["glossary"]),
        (declared()["uplift"].choices, ["glossary"]),
        (declared()["quadrature"].choices, ["glossary"]),
        (VERDICTS, ["glossary"]),
        (declared(), ["glossary", "parameters"]),
    ],
    ids=["columns", "tables", "laws", "uplift", "quadrature", "verdicts", "parameters"],
)
def test_public_names_are_explained(names, pages):
    assert set(names) <= names_in(*pages)


def test_every_command_is_in_the_page_on_usage():
    (commands,) = (a.choices for a in cli.parser()._actions if a.dest == "command")
    text = (REFERENCE / "usage.md").read_text()
    assert not [name for name in commands if f"damjoint {name}" not in text]


def test_the_glossary_is_a_table_of_five_columns():
    rows = [row for row in (REFERENCE / "glossary.md").read_text().splitlines() if row[:1] == "|"]
    assert all(row.count("|") == 6 for row in rows)
    terms = [row.split("|")[1].strip() for row in rows]
    assert len(set(terms)) == len(terms) <= 70


def public_names():
    """Modules, classes and functions without an underscore in front: path and name."""
    for path in PACKAGE.rglob("*.py"):
        where = path.relative_to(PACKAGE)
        yield where, path.stem
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, (ast.ClassDef, ast.FunctionDef)) and node.name[0] != "_":
                yield where, node.name


def test_public_names_are_terms_of_the_field():
    """Each word of name_of_something or NameOfSomething."""
    words = lambda name: re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower().split("_")
    found = [
        f"{where}: {name}: {word} ({FORBIDDEN[word]})"
        for where, name in public_names()
        for word in words(name)
        if word in FORBIDDEN
    ]
    assert not found, "\n".join(found)
