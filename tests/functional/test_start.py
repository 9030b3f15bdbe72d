"""What a command loads: the time of a short run is that of its imports."""

import os
import subprocess
import sys

import pytest
from damjoint.fem import factor

HEAVY = "gmsh", "scipy", "matplotlib", "tabulate", "tqdm"
PROGRAM = f"""
import sys
from damjoint.cli import main
code = main(sys.argv[1:])
print("loaded:", *(name for name in {HEAVY} if name in sys.modules))
sys.exit(code)
"""


def loaded(cache, *words):
    """The modules of HEAVY that a command has loaded."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *words],
        env=os.environ | {"DAMJOINT_CACHE": str(cache)},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.splitlines()[-1].split()[1:]


@pytest.mark.heavy
@pytest.mark.parametrize("case", ["c", "g"])
def test_a_run_loads_gmsh_without_a_cache_and_numpy_alone_with_it(tmp_path, case):
    words = "run", case, "--no-fields", "--no-picture", "--out", str(tmp_path / "out")
    without = loaded(tmp_path / "cache", *words)
    assert "gmsh" in without and ("scipy" in without) == factor.is_slow()
    assert loaded(tmp_path / "cache", *words) == []


def test_what_is_registered_for_the_exit_is_called_before_the_process_ends(tmp_path):
    program = """
import atexit, sys
from damjoint.__main__ import main
atexit.register(print, "registered")
sys.argv = ["damjoint", "new", "my.case"]
sys.exit(main())
"""
    words = [sys.executable, "-c", program]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "registered" and len(done.stdout.splitlines()) == 2


def test_the_first_help_lists_the_commands_for_developers_apart(command):
    """At its end, a line each; then the exit codes, that of a value that is not confirmed too."""
    code, out, _ = command("--help")
    users, developers = out.split("\nfor developers:\n")
    names = [line.split()[0] for line in developers.split("\n\n")[0].splitlines()]
    assert code == 0 and names == ["stress", "bench", "law"]
    assert all(f"    {name} " not in users for name in names) and "    quake " in users
    assert "  3    critical: the value is not confirmed" in developers
