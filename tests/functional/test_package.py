"""The wheel, installed into a fresh environment, runs a case from another folder."""

import json
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).parents[2]


def call(*words, **options):
    done = subprocess.run(
        [str(w) for w in words], capture_output=True, text=True, check=False, **options
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.heavy
def test_the_wheel_runs_in_a_fresh_environment(tmp_path):
    call(sys.executable, "-m", "build", "--wheel", "--outdir", tmp_path, CHECKOUT)
    (wheel,) = tmp_path.glob("damjoint-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith("/METADATA"))
        assert not re.search(rb"\]\((?!https?:)", archive.read(name))  # links work on an index
    call(sys.executable, "-m", "venv", "--without-pip", tmp_path / "env")
    python = tmp_path / "env" / "bin" / "python"
    # modules are compiled when they are used, which few are
    install = "--python", python, "install", "-q", "--no-compile"
    call(sys.executable, "-m", "pip", *install, wheel)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    environment = {**os.environ, "DAMJOINT_CACHE": "", "PYTHONPATH": ""}
    command = tmp_path / "env" / "bin" / "damjoint"
    for engine in ("condensed", "getdp"):
        words = "run", "c", "--levels", "6", "--engine", engine, "--out", engine
        call(command, *words, cwd=elsewhere, env=environment)
        assert json.loads((elsewhere / engine / "run.json").read_text())["verdict"] == "stands"
    call(command, "report", "condensed", cwd=elsewhere, env=environment)
    assert (elsewhere / "report.html").stat().st_size > 10_000
    out = call(command, "validate", "c", cwd=elsewhere, env=environment)
    assert ", 0 failed;" in out
    tools = "from damjoint_tools import bench_page, pages, stress"  # of commands and make
    call(python, "-c", tools, cwd=elsewhere, env=environment)
    (elsewhere / "own.case").write_text('Include "presets/usace_usual.case";')
    read = "from damjoint.input.resolve import load; print(load('own.case')['required_SSF'])"
    assert call(python, "-c", read, cwd=elsewhere, env=environment) == "2.0\n"
    where = call(
        python, "-c", "import damjoint; print(damjoint.data('pro'))", cwd=elsewhere, env=environment
    )
    assert where.startswith(str(tmp_path / "env"))
