"""Pictures and page of a run, made from its files."""

import html
import json
import re
import shutil

import numpy as np
import pytest
from damjoint import cli
from damjoint.post import stored
from damjoint.post.pictures import shear_limit
from numpy.testing import assert_allclose
from PIL import Image

SMALL = "--set", "n_joint=10", "--set", "h_dam=3", "--set", "h_found=4"
CASE = """title = "<i>my</i> dam & joint";
default_dam_height = 12;  default_dam_base = 8;  default_dam_crest = 2;
default_law = "friction";  default_mu = 0.75;  default_K_N = 2e10;
default_uplift = "drained";  default_required_SSF = 50;
levels() = {8, 10};  tail_levels() = {0, 1};
"""


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """The folder of a run."""
    work = tmp_path_factory.mktemp("ran")
    (work / "my.case").write_text(CASE)
    assert cli.main(["run", str(work / "my.case"), *SMALL, "--out", str(work / "my")]) == 0
    return work / "my"


@pytest.fixture
def folder(ran, tmp_path):
    """A copy of it that a test may change."""
    return shutil.copytree(ran, tmp_path / "out" / "my")


def test_plot_redraws_the_pictures_of_a_run(command, folder):
    path = folder / "my.png"
    drawn = np.asarray(Image.open(path)).astype(float)
    path.unlink()
    code, out, err = command("plot", folder)
    assert (code, out, err) == (0, f"{path}\n", "")
    again = np.asarray(Image.open(path)).astype(float)
    assert again.shape == drawn.shape and np.ptp(again) > 100
    # the tables have 12 digits: a line may be rounded to the next pixel
    assert np.mean(np.abs(again - drawn) > 8) < 1e-3


def test_plot_of_a_run_with_displacement_control(command, tmp_path):
    """Also its load curve; without fields there is no section."""
    assert command("run", "k", *SMALL, "--no-fields", "--no-picture")[0] == 0
    assert command("plot", "out/k")[0] == 0
    for name in ("k.png", "k_curve.png"):
        assert (tmp_path / "out" / "k" / name).stat().st_size > 10_000


def test_plot_and_report_of_a_user_geometry(command, tmp_path):
    """A stepped base, with the ends of the joint read from the mesh; no gravity method, which needs
    a section by parameters.
    """
    few = "--set", "n_joint=20", "--set", "order=1", "--levels", "40", "--tail-levels", "4"
    assert command("run", "stepped", *few)[0] == 0
    path = tmp_path / "out/stepped/stepped.png"
    drawn = path.read_bytes()
    assert command("plot", "out/stepped")[0] == 0
    assert path.stat().st_size == pytest.approx(len(drawn), rel=0.01)
    read = stored.read(tmp_path / "out/stepped")
    assert read.result.case.joint_length == pytest.approx(np.hypot(34, 4))
    assert command("report", "out/stepped")[0] == 0
    page = (tmp_path / "report.html").read_text()
    assert "geometry stepped.geo" in page and "Beside the gravity method" not in page


def damaged(folder, name, text):
    (folder / name).write_text(text)


@pytest.mark.parametrize("words", [("plot",), ("report", "--to", "page.html")])
@pytest.mark.parametrize(
    "harm, message",
    [
        (lambda f: (f / "run.json").unlink(), "must be the folder of a run"),
        (lambda f: damaged(f, "joint.csv", "x,y\n1\n"), "damaged"),
        (lambda f: damaged(f, "fields/bulk_t2.vtu", "<VTKFile"), "damaged"),
        (lambda f: change(f, parameters={}), "lacks parameters"),
        (lambda f: change(f, case="../../elsewhere"), "must be the name of a case"),
    ],
)
def test_a_bad_folder_is_reported_in_one_line(command, folder, tmp_path, harm, message, words):
    harm(folder)
    before = sorted(tmp_path.rglob("*"))
    code, out, err = command(*words, folder)
    assert (code, out) == (2, "") and len(err.splitlines()) == 1
    assert message in err and str(folder) in err
    assert sorted(tmp_path.rglob("*")) == before


def change(folder, **entries):
    record = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(record | entries))


def test_report_has_results_and_parameters(command, folder, tmp_path):
    """One page without external files."""
    assert command("run", "a", *SMALL, "--set", "order=1")[0] == 0
    code, out, err = command("report", folder, "out/a", "--to", "page.html")
    assert (code, out, err) == (0, "page.html\n", "")
    page = (tmp_path / "page.html").read_text()
    assert not re.search(r"(src|href)=\"(?!data:|#)|url\(|@import", page)
    assert "<i>" not in page and "&lt;i&gt;my&lt;/i&gt; dam &amp; joint" in page
    sections = page.split("<section")[1:]
    assert len(sections) == 3  # a has two scenes
    mine = sections[0]
    assert mine.count("data:image/svg+xml;base64,") == 3
    assert re.search(r"SSF [\d.]+ &lt; 50", mine) and ">fail<" in mine  # required by the case
    assert ">not checked<" in sections[1] and ">pass<" not in page  # case a requires none
    assert 'class="verdict not-checked"' in sections[1]
    words = re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", mine))
    assert "K_N Normal stiffness K_N 2e+10 Pa per m 1e+11" in words
    assert "dam_height" in words and "E_dam" not in words  # follows E, which is not set
    assert (
        "reservoir" in words
        and "tailwater" in words
        and "not estimated; damjoint run --accuracy 1% estimates it" in words
    )


def test_report_of_a_dam_that_passes_with_its_estimated_error(command, tmp_path):
    """The required factors are met; the estimated error of --accuracy is that of run.json."""
    needs = "--set", "required_SSF=0.1", "--levels", "40", "--accuracy", "coarse", "--no-picture"
    assert command("run", "dam", *needs)[0] == 0
    estimate = json.loads((tmp_path / "out/dam/run.json").read_text())["error_estimate"]
    assert command("report", "out/dam")[0] == 0
    page = (tmp_path / "report.html").read_text()
    assert 'class="verdict pass"' in page and "not checked" not in page
    assert estimate["statement"] and estimate["statement"] in html.unescape(page)
    assert "not estimated" not in page


def test_report_of_a_run_without_a_converged_step(command, tmp_path):
    """A dam too light to stand has no state to draw; the page states it."""
    light = "--set", "rho_dam=10", "--set", "law=friction", "--set", "smallest_step=0.5"
    assert command("run", "c", *SMALL, *light, "--levels", "9", "--out", "light")[0] == 1
    assert command("report", "light")[0] == 0
    assert ">fail<" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize("law", ["friction", "bond"])
def test_the_strength_drawn_is_that_of_the_law(solve, law):
    """Where a node has slipped, its shear is at the limit; nowhere is it above."""
    (result,) = solve("c", levels="7", n_joint=20, law=law, adhesion=2e4, G_t=100)
    rows = result.at()
    _, limit = shear_limit(result.case, rows)
    slipped = rows["slip"] > 0
    assert slipped.any() and not slipped.all()
    assert_allclose(np.abs(rows["tau_1"][slipped]), limit[slipped], rtol=1e-6)
    assert np.all(np.abs(rows["tau_1"]) <= limit * (1 + 1e-6))
