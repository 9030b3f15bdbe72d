"""Where measured figures come from, and that two versions are never mixed."""

import shutil
import subprocess
import sys
from datetime import date
from pathlib import Path

import pytest
from damjoint import __version__
from damjoint_tools import pages, provenance

ROOT = Path(__file__).parents[2]
ONE = {"version": "1.2", "commit": "abc1234", "code": "f00", "machine": "PC", "date": "2030-01-02"}


def test_the_line_names_version_commit_day_and_machine():
    said = provenance.said
    assert said([ONE]) == "Measured with damjoint 1.2 (commit abc1234, 2030-01-02) on PC."
    installed = ONE | {"commit": ""}
    assert said([installed], "Computed") == "Computed with damjoint 1.2 (2030-01-02) on PC."
    later = ONE | {"date": "2030-01-05", "machine": "laptop"}
    assert "2030-01-02 to 2030-01-05) on PC and laptop." in said([later, ONE, ONE][::-1])


def test_figures_of_two_versions_or_of_none_have_no_line():
    with pytest.raises(ValueError, match=r"different versions: damjoint 1.2 \(abc1234\), 1.3 "):
        provenance.said([ONE, ONE | {"version": "1.3", "code": "f01"}])
    with pytest.raises(ValueError, match="do not say"):
        provenance.said([ONE, {"scene": "7-1"}])


def test_what_is_recorded_now():
    now = provenance.provenance()
    assert (now["version"], now["date"]) == (__version__, f"{date.today()}")
    assert len(now["code"]) == 64 and "cores" in now["machine"]


def test_the_commit_is_that_of_the_code(tmp_path):
    """Of a checkout, with its changes; none for a copy that lies in another project's checkout."""
    copy = tmp_path / "project" / "scripts" / "damjoint"
    shutil.copytree(ROOT / "scripts" / "damjoint", copy)
    (copy.parents[1] / "pro").mkdir()

    def git(*words):
        words = "-c", "user.name=n", "-c", "user.email=n@example.org", *words
        done = subprocess.run(["git", *words], cwd=copy.parents[1], capture_output=True, text=True)
        return done.stdout.strip()

    def told():
        tell = "from damjoint.studies.provenance import commit; print(commit())"
        words = [sys.executable, "-c", f"import sys; sys.path.insert(0, '{copy.parent}'); {tell}"]
        return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()

    git("init")
    assert told() == ""
    git("add", "-A")
    git("commit", "-m", "one")
    head = git("rev-parse", "--short=7", "HEAD")
    assert len(head) == 7 and told() == head
    (copy / "run.py").write_text("# changed")
    assert told() == f"{head} with changes"


def test_the_pages_have_a_place_for_the_line():
    for page, mark in (("README.md", "modelings"), ("reference/tour.md", "figures")):
        assert "\nnew\n<!-- /" in pages.between(mark, (ROOT / page).read_text(), "new")
