"""The names that users meet are in the glossary or in a page that it links; public names of the
package use the field's terms."""

import ast
import json
import re
from pathlib import Path

import damjoint
import pytest
from damjoint import cli
from damjoint.input.parameters import declared
from damjoint.laws import COLUMNS, LAWS
from damjoint.model.results import FLUX, HISTORY, IN_TIME, JOINT, LATERAL, QUAKE
from damjoint.studies.check import CHECK
from damjoint.studies.failure_path import CRITICAL

PACKAGE = Path(damjoint.__file__).parent
ROOT = Path(__file__).parents[2]
REFERENCE = ROOT / "reference"
PAGES = [*ROOT.glob("*.md"), *REFERENCE.glob("*.md"), *REFERENCE.glob("site/*.md")]
PAGES = sorted([*PAGES, *REFERENCE.glob("notebooks/*.ipynb")])
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
        (JOINT | COLUMNS | FLUX | HISTORY | LATERAL | IN_TIME, ["glossary"]),
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


def test_every_command_is_in_the_page_of_commands():
    (commands,) = (a.choices for a in cli.parser()._actions if a.dest == "command")
    text = (REFERENCE / "usage.md").read_text()
    assert not [name for name in commands if f"damjoint {name}" not in text]


def headings(page):
    """Of a page or notebook; lines of code begin with # too, but are no headings."""
    text = page.read_text()
    if page.suffix == ".ipynb":
        cells = [cell for cell in json.loads(text)["cells"] if cell["cell_type"] == "markdown"]
        text = "\n".join("".join(cell["source"]) for cell in cells)
    return re.findall(r"^#+ (.*)$", re.sub(r"^```.*?^```", "", text, flags=re.M | re.S), re.M)


def slug(heading):
    """The anchor of a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


@pytest.fixture(scope="module")
def anchors():
    """The anchors of the sections of the theory by number: "4" and "4.1"."""
    titles = headings(REFERENCE / "theory.md")
    return {match[1]: slug(t) for t in titles if (match := re.match(r"([\d.]*\d)\.? ", t))}


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_every_section_that_is_named_is_a_link_to_its_title(page, anchors):
    """So that a reference does not lead to another section after one is inserted."""
    named = re.findall(
        r"(?i)(\[?)\bsections?\s+(\d[\d.]*\b)(?:[^\]\[]*\]\((?:[\w./]*theory\.md)?#([^)]*)\))?",
        page.read_text(),
    )
    assert all(begun and to == anchors[n] for begun, n, to in named), named


def test_every_section_that_the_code_names_exists(anchors):
    """There it can be no link."""
    files = [
        path for folder in ("scripts", "pro", "geo", "cases") for path in (ROOT / folder).rglob("*")
    ]
    code = [path for path in files if path.suffix in (".py", ".pro", ".geo", ".case", ".j2")]
    text = "\n".join(path.read_text() for path in code)
    named = set(re.findall(r"\b[sS]ections?\s+(\d+(?:\.\d+)*)", text))
    assert {"4", "4.1", "11"} <= named <= set(anchors)


def test_the_glossary_is_a_table_of_five_columns():
    rows = [row for row in (REFERENCE / "glossary.md").read_text().splitlines() if row[:1] == "|"]
    assert all(row.count("|") == 6 for row in rows)
    terms = [row.split("|")[1].strip() for row in rows]
    assert len(set(terms)) == len(terms) <= 70


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_links_and_paths_in_the_pages_exist(page):
    """A link without an anchor leads to a file or folder, one with an anchor to a heading."""
    text = page.read_text()
    for target, anchor in re.findall(r"\]\((?!https?:)([^)#]*)#?([^)]*)\)", text):
        linked = page.parent / target if target else page
        assert linked.exists(), target
        known = {"", *map(slug, headings(linked))} if anchor else {""}
        assert anchor in known, f"{target}#{anchor}"
    for path in re.findall(r"`((?:pro|geo|cases|tests|scripts|reference)/[\w./]+)`", text):
        assert (ROOT / path).exists() == ("NAME" not in path), path


def test_every_page_is_on_the_site():
    """In the list CONTENTS of its settings, in which the first page itself is not."""
    listed = re.findall(r'"((?:reference/)?\w[\w/]*)"', (REFERENCE / "site/conf.py").read_text())
    pages = {path.relative_to(ROOT).with_suffix("").as_posix() for path in PAGES}
    assert pages - {"README"} <= set(listed)


def test_the_page_of_the_library_has_its_public_names():
    """Each function and class that `damjoint` offers, and no member that does not exist."""
    text = (REFERENCE / "site/library.md").read_text()
    listed = set(re.findall(r"auto\w+:: (?:damjoint\.)?([\w.]+)", text))
    assert set(damjoint.LIBRARY) <= {name.rsplit(".", 1)[-1] for name in listed}
    for name, members in re.findall(r"autoclass:: (\w+)\(?\)?\n   :members: (.+)", text):
        assert all(hasattr(getattr(damjoint, name), member) for member in members.split(", "))


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
