"""Imports between the parts of the package go one way; pages made from the code are current."""

import ast
import re
from pathlib import Path

import damjoint
import pytest
from damjoint_tools import pages

PACKAGE = Path(damjoint.__file__).parent
WITNESS, ROOT = PACKAGE.with_name("damjoint_witness"), Path(__file__).parents[2]
#: Each part uses only those before it.
PARTS = ["", "arrays", "units", "csr", "threads", "storage", "progress", "processes", "versions"]
PARTS += ["laws", "input", "mesh", "model", "fem", "joint", "solver", "dynamics", "engines"]
PARTS += ["statics", "post", "pictures", "accuracy", "session", "runner", "studies", "verification"]
PARTS += ["python_words", "library", "gui", "cli", "__main__"]


def part_of(path):
    top = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    return "" if top == "__init__" else top


def imported(path):
    """The modules of the package that a file imports, as paths below it. The package itself imports
    none of them, see test_library.py: it names those of library for type checkers.
    """
    if path == PACKAGE / "__init__.py":
        return
    here = path.relative_to(PACKAGE).with_suffix("").parts
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = here[: len(here) - node.level]
            names = (node.module or "").split(".") if node.module else []
            yield from ((*base, *names, alias.name) for alias in node.names)


def test_sections_that_the_code_names_exist():
    folders, number = (PACKAGE, WITNESS, ROOT / "pro"), r"sections? (\d[\d.]*)\b"
    texts = [p.read_text() for f in folders for p in f.rglob("*") if p.suffix in (".py", ".pro")]
    headings = (ROOT / "reference" / "theory.md").read_text()
    named = {n.rstrip(".") for t in texts if "theory" in t for n in re.findall(number, t)}
    assert {"4", "4.3", "8"} <= named
    assert not [n for n in named if not re.search(rf"(?m)^##+ {re.escape(n)}\b", headings)]
    pages = {page for text in texts for page in re.findall(r'reference/(\w+\.md), "([^"]+)"', text)}
    assert pages
    for page, heading in pages:
        assert f"\n## {heading}\n" in (ROOT / "reference" / page).read_text()


def test_no_assertion_has_alternatives():
    for path in (ROOT / "tests").rglob("*.py"):
        asserted = [n for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Assert)]
        assert not [n.lineno for n in asserted for m in ast.walk(n) if isinstance(m, ast.Or)], path


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda p: str(p.name))
def test_a_module_imports_only_modules_above_it(path):
    for names in imported(path):
        used = names[0] if names[0] in PARTS or len(names) > 1 else ""
        assert PARTS.index(used) <= PARTS.index(part_of(path)), f"{path} imports {names}"


def test_the_engines_do_not_import_each_other():
    for engine, other in (("getdp", "condensed"), ("condensed", "getdp")):
        for path in (PACKAGE / "engines" / engine).rglob("*.py"):
            assert not any(other in names for names in imported(path)), path


def test_no_circular_imports():
    """Over all imports of all modules."""
    graph = {}
    for path in PACKAGE.rglob("*.py"):
        name = path.relative_to(PACKAGE).with_suffix("").parts
        name = name[:-1] if name[-1] == "__init__" else name
        graph[name] = set()
        for names in imported(path):
            target = next(
                (names[:n] for n in (len(names), len(names) - 1) if is_module(names[:n])), ()
            )
            if target != name:
                graph[name].add(target)
    done, under_way = set(), []

    def visit(name):
        assert name not in under_way, [*under_way, name]
        if name in done:
            return
        under_way.append(name)
        for target in graph.get(name, ()):
            visit(target)
        under_way.pop()
        done.add(name)

    for name in graph:
        visit(name)


def is_module(names):
    place = PACKAGE.joinpath(*names)
    return place.with_suffix(".py").is_file() or (place / "__init__.py").is_file()


@pytest.mark.parametrize("name", ["parameters", "results"])
def test_pages_are_current(name):
    """After a change of a parameter or a column: `make pages`."""
    path = Path(__file__).parents[2] / "reference" / f"{name}.md"
    assert path.read_text() == getattr(pages, f"{name}_page")()


@pytest.mark.parametrize("folder", ["pro", "geo", "cases"])
def test_lines_of_gmsh_and_getdp_files_are_not_too_long(folder):
    """In Python ruff checks it."""
    for path in damjoint.data(folder).rglob("*"):
        if path.suffix in (".pro", ".geo", ".case"):
            long = [line for line in path.read_text().splitlines() if len(line) > 100]
            assert not long, f"{path}: {long[0]}"


def test_functions_of_the_problem_definition_have_one_definition():
    """GetDP refuses a second one; only one law is read at a time."""
    places = {}
    for path in damjoint.data("pro").glob("*.pro"):
        place = "law" if path.name.startswith("law_") else path.name
        for name in re.findall(r"^\s+([A-Za-z_]\w*)\[\]\s*=", path.read_text(), re.M):
            places.setdefault(name, set()).add(place)
    assert len(places) > 100
    assert not {name: files for name, files in places.items() if len(files) > 1}


@pytest.mark.parametrize("path", sorted(WITNESS.rglob("*.py")), ids=lambda p: str(p.name))
def test_the_independent_verification_imports_nothing_of_the_package(path):
    """Also not by a relative import beyond its own folder, or by name."""
    depth = len(path.relative_to(WITNESS).parts)
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            names = [node.module or ""] if not node.level else []
            assert node.level <= depth
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            continue
        roots = {name.split(".")[0] for name in names}
        assert not roots & {"damjoint", "damjoint_tools", "importlib"}
