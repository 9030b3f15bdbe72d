"""The documentation site: `make docs` has no warning, every link leads somewhere, nothing is loaded
from the network. The notebooks, which compare their results with closed forms, are run for it.
"""

import json
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted((ROOT / "reference" / "notebooks").glob("*.ipynb"))
#: Attributes by which a page loads a file, by tag.
LOADED = {"script": "src", "img": "src", "link": "href", "iframe": "src", "source": "src"}


class Page(HTMLParser):
    """Anchors, links and loaded files of a page."""

    def __init__(self, path):
        super().__init__()
        self.anchors, self.links, self.loaded, self.formulas = set(), [], [], 0
        self.feed(path.read_text())

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.anchors |= {attributes[n] for n in ("id", "name") if attributes.get(n)}
        self.formulas += tag == "math"
        if tag == "a" and attributes.get("href"):
            self.links.append(attributes["href"])
        if tag in LOADED and attributes.get(LOADED[tag]):
            self.loaded.append(attributes[LOADED[tag]])


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("docs")
    words = ["-q", "-W", "--keep-going", "-E", "-c", "reference/site", "-d"]
    command = [sys.executable, "-m", "sphinx", *words, folder / "doctrees", ".", folder / "site"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder / "site"


@pytest.fixture(scope="module")
def pages(site):
    return {path: Page(path) for path in site.rglob("*.html")}


def target(page, link):
    """The file and the anchor of a link within the site."""
    parts = urlsplit(link)
    path = (page.parent / unquote(parts.path)).resolve() if parts.path else page
    return path / "index.html" if path.is_dir() else path, unquote(parts.fragment)


@pytest.mark.heavy
def test_every_link_leads_to_a_file_and_an_anchor(site, pages):
    dead, seen = [], 0
    for page, content in pages.items():
        for link in (*content.links, *content.loaded):
            if urlsplit(link).scheme or link.startswith("data:"):
                continue
            path, anchor = target(page, link)
            known = pages[path].anchors | {"", "top"} if path in pages else {anchor}
            seen += 1
            if not path.is_file() or anchor not in known:
                dead.append((str(page.relative_to(site)), link))
    assert not dead
    assert seen > 1000


@pytest.mark.heavy
def test_nothing_is_loaded_from_the_network(site, pages):
    far = [(page, file) for page, p in pages.items() for file in p.loaded if urlsplit(file).netloc]
    assert not far
    for style in site.rglob("*.css"):
        assert not re.search(r"url\(\s*[\"']?(https?:)?//|@import", style.read_text()), style


@pytest.mark.heavy
def test_formulas_search_and_notebooks(site, pages):
    """All formulas are MathML, the pages are in the index, the notebooks have their pictures."""
    theory = pages[site / "reference" / "theory.html"]
    assert theory.formulas > 300
    index = json.loads((site / "searchindex.js").read_text().split("(", 1)[1].rsplit(")", 1)[0])
    names = {path.relative_to(ROOT).with_suffix("").as_posix() for path in NOTEBOOKS}
    names |= {"README", "reference/theory", "reference/site/library"}
    assert names <= set(index["docnames"])
    assert "uplift" in index["terms"]
    start = (site / "README.html").read_text().split("<pre>", 1)[1].split("</pre>", 1)[0]
    lines = re.sub(r"<[^>]*>", "", start).splitlines()
    assert max(map(len, lines)) <= 76  # what a window of 1280 pixels shows
    for path in NOTEBOOKS:
        html = site / path.relative_to(ROOT).with_suffix(".html")
        pictures = [file for file in pages[html].loaded if file.endswith(".png")]
        plots = re.findall(r"plt\.subplots|\.plot\(\)", path.read_text())
        assert len(pictures) == len(plots), path


#: Runs the search of a site (its folder) for stemmed words, each an argument, as a browser would.
SEARCH = """
const fs = require("fs"), [folder, ...words] = process.argv.slice(1);
const read = (name) => fs.readFileSync(`${folder}/_static/${name}`, "utf8");
const root = { dataset: { content_root: "./" } };
globalThis.document = { documentElement: root };
globalThis.window = {};
globalThis.DOCUMENTATION_OPTIONS = { FILE_SUFFIX: ".html" };
const found = `Search.performTermsSearch(new Set(${JSON.stringify(words)}), new Set()).map(
  (r) => [...r, Search.htmlToText("./" + r[0] + ".html", r[2])])`;
const code = ["searchtools.js", "search_text.js", "search.js"].map(read);
const all = ["const _ready = () => 0;", ...code, `JSON.stringify(${found})`].join("\\n");
console.log(require("vm").runInThisContext(all));
"""


@pytest.mark.heavy
def test_the_search_finds_sections_ranked_with_their_text(site, pages):
    """Of every section anchor and text are there; without a network."""
    text = (site / "_static" / "search_text.js").read_text()
    sections = json.loads(text.removeprefix("const SEARCH_TEXT = ").rstrip(";\n"))
    assert len(sections) > 100
    for page, _, heading, anchor, _ in sections:
        assert anchor in pages[site / f"{page}.html"].anchors, (page, heading)
    loaded = [file.split("?")[0] for file in pages[site / "search.html"].loaded]
    assert {"_static/search_text.js", "_static/search.js"} <= set(loaded)
    if not (node := shutil.which("node")):
        pytest.skip("node is not installed")
    for words, page, anchor in (
        (["exit", "code"], "reference/usage", "#exit-codes"),
        (["natur", "mode"], "reference/studies", "#natural-modes"),
    ):
        command = [node, "-e", SEARCH, str(site), *words]
        output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        results = json.loads(output)
        assert (results[0][0], results[0][2]) == (page, anchor)
        scores = [result[4] for result in results]
        assert scores == sorted(scores, reverse=True) and len(set(scores)) == len(scores)
        _, title, *_, excerpt = results[0]
        assert all(word in f"{title} {excerpt}".lower() for word in words)


@pytest.mark.heavy
def test_a_dead_link_and_an_unknown_command_are_errors(tmp_path):
    """What the site's build has to refuse."""
    for name in ("conf.py", "site.css", "search.js"):
        (tmp_path / name).write_text((ROOT / "reference" / "site" / name).read_text())
    (tmp_path / "README.md").write_text("# Page\n\n[a](#nowhere), [b](none.md), $\\nothing{a}$\n")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", ".", "site"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1
    for word in ("nowhere", "none.md", "nothing{a}"):
        assert word in done.stderr


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_are_stored_without_results(path):
    cells = json.loads(path.read_text())["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert len(code) > 5 and any("assert " in "".join(cell["source"]) for cell in code)
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)
