"""The documentation site, built by `make docs`: the pages and notebooks of the repository, and the
library's reference from its docstrings. It needs no network: formulas are MathML, and theme,
search and fonts are files of the site.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import damjoint
import ziamath
from docutils import nodes
from latex2mathml.converter import convert
from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx
from sphinx.ext.napoleon import Config, GoogleDocstring
from sphinx.util.logging import getLogger
from sphinx.writers.html5 import HTML5Translator

LOGGER = getLogger(__name__)
FONT = "STIXTwoMath-Regular.ttf"

project, version = "damjoint", damjoint.__version__
author = copyright = "The damjoint developers"
html_math_renderer = "mathml"
html_title = f"damjoint {version}"

extensions = ["myst_nb", "sphinx.ext.autodoc"]
root_doc = "README"
include_patterns = ["*.md", "reference/site/*.md", "reference/*.md", "reference/notebooks/*.ipynb"]
exclude_patterns = [".*", "**/.*", "out", "tests"]

html_theme = "furo"
html_copy_source = False
html_show_sourcelink = False
# a font with the large brackets and roots of formulas, which few systems have
html_static_path = ["site.css", "search.js", str(Path(ziamath.__file__).parent / "fonts" / FONT)]
html_css_files = ["site.css"]
smartquotes = False
highlight_language = "none"

myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 4  # as in the links between the pages
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 600  # [s] of a cell
nb_merge_streams = True

default_role = "code"  # of `name` in a docstring
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_type_aliases = {"Array": "Array", "BoolArray": "BoolArray", "Table": "Table"}
add_module_names = False

#: The pages by heading, in the order of the navigation. README.md can not list them itself: the
#: list is a statement of Sphinx.
CONTENTS = {
    "Use": (
        *("reference/usage", "reference/studies", "reference/cluster", "reference/choosing"),
        *("reference/tour", "reference/window"),
        *("reference/python", "reference/notebooks/tour", "reference/notebooks/reliability"),
        "reference/notebooks/law",
    ),
    "Reference": (
        *("reference/theory", "reference/parameters", "reference/results"),
        *("reference/site/library", "reference/glossary"),
    ),
    "Verification": (
        "reference/ssnp142",
        "reference/published",
        "reference/trust",
        "reference/benchmarks",
    ),
    "Project": ("CONTRIBUTING", "CHANGELOG"),
}


def add_contents(app: Sphinx, page: str, text: list[str]) -> None:
    """Add CONTENTS to the first page."""
    if page == root_doc:
        for heading, pages in CONTENTS.items():
            entries = "\n".join(pages)
            text[0] += f"\n```{{toctree}}\n:hidden:\n:caption: {heading}\n\n{entries}\n```\n"


def visit_math(writer: HTML5Translator, node: nodes.math | nodes.math_block) -> None:
    """Write a formula, as MathML."""
    block = isinstance(node, nodes.math_block)
    formula = convert(node.astext(), display="block" if block else "inline")
    if "\\" in formula or "$" in formula:
        LOGGER.warning(f"formula {node.astext()!r}: has a command that is unknown", location=node)
    writer.body.append(f'<div class="math">{formula}</div>' if block else formula)
    raise nodes.SkipNode


def parse_sections(
    app: Sphinx, what: str, name: str, item: object, options: object, lines: list[str]
) -> None:
    """Convert the sections Args and Raises in the docstring of a function for Sphinx. In other
    docstrings sphinx.ext.napoleon would take the words before a colon for a type.
    """
    if what in ("function", "method"):
        lines[:] = GoogleDocstring(lines, Config(), what=what, name=name, obj=item).lines()


def add_index(app: Sphinx, error: Exception | None) -> None:
    """Copy the first page to index.html, which browsers and servers open."""
    if not error:
        shutil.copy(Path(app.outdir, f"{root_doc}.html"), Path(app.outdir, "index.html"))


def sections_of(app: Sphinx) -> Iterator[tuple[str, str, str, str, str]]:
    """Page, its title, heading, anchor and text of each section, without that of its sections."""
    for page in sorted(app.env.found_docs):
        title = app.env.titles[page].astext()
        for section in app.env.get_doctree(page).findall(nodes.section):
            parts = [part for part in section.children if not isinstance(part, nodes.section)]
            heading, *others = (part.astext() for part in parts)
            text = " ".join(" ".join(others).split())
            yield page, title, heading, section["ids"][0], text


def add_search(
    app: Sphinx, page: str, template: str, context: dict[str, object], _: object
) -> None:
    """Load the search by section in the page of the search."""
    if page == "search":
        for name in ("search_text.js", "search.js"):  # after searchtools.js
            app.add_js_file(name, loading_method="defer")


def write_search_text(app: Sphinx, error: Exception | None) -> None:
    """Write the texts of all sections for search.js."""
    if not error:
        text = f"const SEARCH_TEXT = {json.dumps([*sections_of(app)], ensure_ascii=False)};\n"
        Path(app.outdir, "_static", "search_text.js").write_text(text)


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.add_html_math_renderer("mathml", (visit_math, None), (visit_math, None))
    app.add_lexer("gmsh", TextLexer)  # Pygments has none for .geo files
    app.connect("source-read", add_contents)
    app.connect("autodoc-process-docstring", parse_sections)
    app.connect("build-finished", add_index)
    app.connect("html-page-context", add_search)
    app.connect("build-finished", write_search_text)
