"""The line of a page on the origin of its figures, which are of one version."""

import shutil
import subprocess
import sys
from datetime import date
from importlib import metadata
from pathlib import Path

import pytest
from damjoint import __version__, versions
from damjoint_tools import pages, provenance

ROOT = Path(__file__).parents[2]
VALUES = "1.2", "abc1234", "f00", "PC", "2030-01-02"
RECORD = dict(zip(provenance.RECORDED, VALUES, strict=True))


def test_the_line_has_version_commit_date_and_machine():
    line = provenance.source_line
    assert line([RECORD]) == "Measured with damjoint 1.2 (commit abc1234, 2030-01-02) on PC."
    installed = RECORD | {"commit": ""}
    assert line([installed], "Computed") == "Computed with damjoint 1.2 (2030-01-02) on PC."
    later = RECORD | {"date": "2030-01-05", "machine": "laptop"}
    assert "2030-01-02 to 2030-01-05) on PC and laptop." in line([later, RECORD, RECORD][::-1])


def test_figures_of_two_versions_or_of_an_unknown_one_are_refused():
    with pytest.raises(ValueError, match=r"different versions: damjoint 1.2 \(abc1234\), 1.3 "):
        provenance.source_line([RECORD, RECORD | {"version": "1.3", "code": "f01"}])
    with pytest.raises(ValueError, match="unknown version"):
        provenance.source_line([RECORD, {"scene": "7-1"}])


def test_provenance_of_figures_measured_now():
    now = provenance.provenance()
    assert (now["version"], now["date"]) == (__version__, f"{date.today()}")
    assert len(now["code"]) == 64 and "cores" in now["machine"]


def test_the_commit_is_that_of_the_checkout_with_its_changes(tmp_path):
    """A copy within another project's checkout has no commit."""
    copy = tmp_path / "project" / "scripts" / "damjoint"
    for package in ("damjoint", "damjoint_tools"):
        shutil.copytree(ROOT / "scripts" / package, copy.with_name(package))
    (copy.parents[1] / "pro").mkdir()

    def git(*words):
        words = "-c", "user.name=n", "-c", "user.email=n@example.org", *words
        done = subprocess.run(["git", *words], cwd=copy.parents[1], capture_output=True, text=True)
        return done.stdout.strip()

    def commit():
        script = "from damjoint.versions import commit; print(commit())"
        words = [sys.executable, "-c", f"import sys; sys.path.insert(0, '{copy.parent}'); {script}"]
        return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()

    git("init")
    assert commit() == ""
    git("add", "-A")
    git("commit", "-m", "first")
    head = git("rev-parse", "--short=7", "HEAD")
    assert len(head) == 7 and commit() == head
    (copy / "runner.py").write_text("# changed")
    assert commit() == f"{head} with changes"


def test_readme_and_tour_have_a_place_for_the_line():
    for page, mark in (("README.md", "modelings"), ("reference/tour.md", "figures")):
        assert "\nnew\n<!-- /" in pages.between(mark, (ROOT / page).read_text(), "new")


def test_versions_are_those_of_the_installed_packages():
    expected = {name: metadata.version(name) for name in versions.PACKAGES}
    assert expected.items() <= versions.versions().items()
    assert versions.installed("damjoint-nowhere") == ""
