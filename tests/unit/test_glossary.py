"""The names that users meet are in the glossary or in a page that it links; public names of the
package use the field's terms."""

import ast
import re
from pathlib import Path

import damjoint
import pytest
from damjoint import cli
from damjoint.input.parameters import declared
from damjoint.laws import COLUMNS, LAWS
from damjoint.model.results import FLUX, HISTORY, JOINT, QUAKE
from damjoint.studies.check import CHECK
from damjoint.studies.failure_path import CRITICAL

PACKAGE = Path(damjoint.__file__).parent
ROOT = Path(__file__).parents[2]
REFERENCE = ROOT / "reference"
PAGES = sorted([*ROOT.glob("*.md"), *REFERENCE.glob("*.md")])
VERDICTS = "stands", "sliding", "overturning", "broken through", "out of range", "not converged"
VERDICTS += "no equilibrium", "interrupted", "pass", "fail", "not checked", "crushed toe"
#: Words that are no terms of the field, and what to write in their place.
FORBIDDEN = {
    "asked": "requested",
    "attempt": "strategy",
    "attempts": "strategies",
    "burst": "unstable crack growth",
    "driven": "displacement-controlled",
    "fallen": "diverged",
    "filling": "load stepper",
    "held": "frozen, fixed, locked",
    "hold": "freeze",
    "jumped": "displacement jump",
    "kept": "stored",
    "knee": "limit point",
    "lip": "joint face",
    "lips": "joint faces",
    "loose": "fully slipped",
    "pushed": "displacement, external force",
    "ran": "unstable crack growth",
    "remember": "update_internal_variables",
    "respond": "traction_and_tangent",
    "said": "message",
    "stage": "begin_step",
    "told": "message",
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
        (CHECK | CRITICAL | QUAKE, ["glossary", "results"]),
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


@pytest.mark.parametrize("page", ["reference/theory.md", "CONTRIBUTING.md"])
def test_every_section_that_is_named_is_a_link_to_its_title(page):
    """So that a reference does not lead to another section after one is inserted."""
    titles = re.findall(r"^## (\d+)\. (.*)$", (REFERENCE / "theory.md").read_text(), re.MULTILINE)
    anchors = {n: f"#{n}-" + re.sub(r"\W", "-", title.lower()) for n, title in titles}
    text = (REFERENCE.parent / page).read_text()
    named = re.findall(
        r"(?i)(\[?)sections?\s+(\d+)(?:\]\((?:reference/theory\.md)?([^)]*)\))?", text
    )
    assert named and all(begun and to == anchors[n] for begun, n, to in named), named


def test_the_glossary_is_a_table_of_five_columns():
    rows = [row for row in (REFERENCE / "glossary.md").read_text().splitlines() if row[:1] == "|"]
    assert all(row.count("|") == 6 for row in rows)
    terms = [row.split("|")[1].strip() for row in rows]
    assert len(set(terms)) == len(terms) <= 70


def slug(heading):
    """The anchor of a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_links_and_paths_in_the_pages_exist(page):
    text = page.read_text()
    for target, anchor in re.findall(r"\]\((?!https?:)([^)#]*)#?([^)]*)\)", text):
        linked = page.parent / target if target else page
        assert linked.exists(), target
        headings = re.findall(r"^#+ (.*)$", linked.read_text(), re.M) if anchor else []
        assert not anchor or anchor in map(slug, headings), f"{target}#{anchor}"
    for path in re.findall(r"`((?:pro|geo|cases|tests|scripts|reference)/[\w./]+)`", text):
        assert "NAME" in path or (ROOT / path).exists(), path


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
